"""The search for the parameters of a cascade.

The last stage that is not a transfer function carries the gain: what it is linear in stays linear, each of its columns
passing through the linear stages behind it. A structure of a transfer function before or behind it has the gain one at
rest, which the data could not tell from the other's (`hysim.plants._unit_gain`); its initial state is linear behind
the carrier, and zero before it. A stage before the carrier that is not such a structure is taken as it is, and so is a
transfer function that is given. Of transfer functions alone the first structure carries the gain.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, checked
from hysim.models._sum_search import assembled, started, time_of
from hysim.models.composable import Composable, composed
from hysim.models.joint_space import combined_variants, common_states, declared, together
from hysim.models.parts import exchanged, labels, own, response_of
from hysim.models.protocols import (
    Identifiable,
    LinearStage,
    LinearStructure,
    UnitGainStructure,
    Variant,
    needs_time,
)
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record


@checked
class CascadeStructure(Identifiable, Composable):
    """Stages to be identified one behind the other; see `hysim.Cascade.structure`."""

    stages: tuple[Any, ...]

    def __post_init__(self) -> None:
        stages = started(self.stages, "stages")
        for stage in stages:
            if isinstance(stage, LinearStage) and stage.initial_state:
                raise ValueError("a transfer function that is given must not hold an initial state")
        object.__setattr__(self, "stages", stages)
        if not isinstance(stages[self.carrier], Identifiable):
            raise TypeError(f"no stage can be identified: a {type(stages[self.carrier]).__name__} carries the gain")

    @property
    def carrier(self) -> int:
        """Which stage carries the gain."""
        linear = [isinstance(stage, LinearStage | LinearStructure) for stage in self.stages]
        if not all(linear):
            return len(linear) - 1 - linear[::-1].index(False)
        return next((k for k, stage in enumerate(self.stages) if isinstance(stage, LinearStructure)), 0)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The stages' spaces side by side."""
        names = labels(self.stages)
        before = names[: self.carrier]
        spaces = declared(
            {
                label: lambda free, label=label, stage=stage: (  # type: ignore[misc]
                    _at_rest(stage, record, free)
                    if label in before
                    else stage.search_space(self._record_at(label, record), free)
                )
                for label, stage in self._searched.items()
            },
            freedom,
        )
        return together(spaces)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The columns of the carrier and of the initial states behind it, through the stages behind them."""
        names, stages = labels(self.stages), self._by_label
        signals = record.u[np.newaxis, np.newaxis]
        for k in range(self.carrier):
            signals = _through(stages[names[k]], own(parameters, names[k]), signals, record)
        mine, carrier = own(parameters, names[self.carrier]), self.stages[self.carrier]
        columns = _regressors(carrier, mine, signals[:, 0], record)
        for name in names[self.carrier + 1 :]:
            stage, its = stages[name], own(parameters, name)
            passed = _through(stage, its, columns.transpose(0, 2, 1), record).transpose(0, 2, 1)
            added = stage.free_responses(its, record) if isinstance(stage, UnitGainStructure) else passed[..., :0]
            n_sets = max(len(passed), len(added))
            blocks = (passed[..., :-1], added, passed[..., -1:])
            columns = np.concatenate([np.broadcast_to(block, (n_sets, *block.shape[1:])) for block in blocks], axis=-1)
        return columns

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The cascade with these parameters."""
        return composed(">>", assembled(self.stages, self._searched, parameters))

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        """Remarks of the law that carries the gain."""
        carrier, law = self.stages[self.carrier], model.stages[self.carrier]
        if needs_time(law):
            return ()
        return tuple(f"{labels(self.stages)[self.carrier]}: {note}" for note in carrier.notes(record, law))

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """The states that the stages from the carrier on leave to the record; a cascade has no cycle ahead of it."""
        seen = self._record_at(labels(self.stages)[self.carrier], record)
        return tuple(state for state in common_states(self._with_state, seen) if state != "periodic")

    def variants(self) -> tuple[Variant, ...]:
        """The choices of the carrier."""
        carrier = {labels(self.stages)[self.carrier]: self.stages[self.carrier]}
        return combined_variants(carrier, lambda others: replace(self, stages=exchanged(self.stages, others)))

    @property
    def _with_state(self) -> dict[str, Any]:
        """The stages whose state can be free, by their labels: the carrier, and the structures behind it."""
        stages = list(zip(labels(self.stages), self.stages, strict=True))[self.carrier :]
        return {label: stage for label, stage in stages if isinstance(stage, Identifiable)}

    @property
    def _by_label(self) -> dict[str, Any]:
        """The stages, structures of transfer functions beside the carrier with the gain one."""
        return {
            label: stage.with_unit_gain() if isinstance(stage, LinearStructure) and k != self.carrier else stage
            for k, (label, stage) in enumerate(zip(labels(self.stages), self.stages, strict=True))
        }

    @property
    def _searched(self) -> dict[str, Any]:
        carrier = labels(self.stages)[self.carrier]
        return {
            label: stage
            for label, stage in self._by_label.items()
            if label == carrier or isinstance(stage, UnitGainStructure)
        }

    def _record_at(self, label: str, record: Record) -> Record:
        """The record as a stage sees it: the carrier behind those before it, which have a gain of about one."""
        if label != labels(self.stages)[self.carrier]:
            return record
        known = [stage for stage in self.stages[: self.carrier] if not isinstance(stage, LinearStructure)]
        u = reduce(lambda v, stage: response_of(stage, v, time_of(stage, record)), known, record.u)
        return Record(u=u, y=record.y, t=record.t)


def _at_rest(stage: UnitGainStructure, record: Record, freedom: Freedom) -> SearchSpace:
    """The space of a stage in front of the carrier, in whose initial state nothing is linear."""
    space = stage.search_space(record, replace(freedom, initial="rest"))
    if space.linear:
        raise ValueError(f"{space.linear[0]!r} cannot be free in front of the stage that carries the gain")
    return replace(space, columns=(), state=())


def _through(stage: Any, parameters: Parameters, signals: FloatArray, record: Record) -> FloatArray:
    """Outputs (n_sets, n_signals, n_samples) of a stage for the inputs `signals`, of this shape or (1, ...)."""
    if isinstance(stage, UnitGainStructure):
        return stage.filtered_sets(parameters, signals, record.sample_time)
    each = signals.reshape(-1, signals.shape[-1])
    if isinstance(stage, LinearStage):
        return stage.filtered(each, record.sample_time).reshape(signals.shape)
    return np.reshape([response_of(stage, u, time_of(stage, record)) for u in each], signals.shape)


def _regressors(carrier: Any, parameters: Parameters, inputs: FloatArray, record: Record) -> FloatArray:
    """The carrier's columns for one input, or for one of each set, (n_sets or 1, n_samples)."""
    if len(inputs) == 1:
        return np.asarray(carrier.regressors(parameters, Record(u=inputs[0], y=record.y, t=record.t)))
    sets = [{name: np.ravel(values)[k : k + 1] for name, values in parameters.items()} for k in range(len(inputs))]
    return np.concatenate(
        [carrier.regressors(one, Record(u=u, y=record.y, t=record.t)) for one, u in zip(sets, inputs, strict=True)]
    )
