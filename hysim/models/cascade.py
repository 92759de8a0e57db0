"""Models in series,  u -> stage 1 -> stage 2 -> ... -> y, and the search for their parameters.

The last stage that is not a transfer function carries the gain: what it is linear in stays linear, each of its columns
passing through the linear stages behind it. A structure of a transfer function before or behind it has the gain one at
rest, which the data could not tell from the other's (`hysim.plants._transfer_function_search`); its initial state is
linear behind the carrier, and zero before it. A stage before the carrier that is not such a structure is taken as it
is, and so is a transfer function that is given. Of transfer functions alone the first structure carries the gain.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial, reduce
from itertools import accumulate
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, checked
from hysim.kernels.stepping import one_behind_the_other
from hysim.models import protocols as roles
from hysim.models.compiled_step import startable
from hysim.models.composable import Composable
from hysim.models.inverse_search import searched_inverse
from hysim.models.joint_space import combined_variants, common_states, declared, together
from hysim.models.model import family
from hysim.models.parts import (
    compiled_law,
    compiled_pair,
    exchanged,
    labelled,
    labels,
    own,
    response_of,
    self_started,
    startable_pair,
)
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits, Startable, Subject, Variant, needs_time, placed
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.sum import Composite, Driven, assembled, known_slopes, started, time_of
from hysim.records import Record


@checked
class CascadeStructure(Subject, Composable):
    """Stages in series that are identified together; see `hysim.Cascade.structure`."""

    stages: tuple[Any, ...]

    def __post_init__(self) -> None:
        stages = started(self.stages, "stages")
        for stage in stages:
            if isinstance(stage, roles.LinearStage) and stage.initial_state:
                raise ValueError("a transfer function that is given must not hold an initial state")
        object.__setattr__(self, "stages", stages)
        if not isinstance(stages[self.carrier], roles.Identifiable):
            raise TypeError(f"no stage can be identified: a {type(stages[self.carrier]).__name__} carries the gain")

    @property
    def carrier(self) -> int:
        linear = [isinstance(stage, roles.LinearStage | roles.LinearStructure) for stage in self.stages]
        if not all(linear):
            return len(linear) - 1 - linear[::-1].index(False)
        return next((k for k, stage in enumerate(self.stages) if isinstance(stage, roles.LinearStructure)), 0)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        before = labels(self.stages)[: self.carrier]
        spaces = {
            label: partial(_at_rest, stage, record)
            if label in before
            else partial(stage.search_space, self._record_at(label, record))
            for label, stage in self._searched.items()
        }
        return together(declared(spaces, freedom))

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The columns of the carrier and of the initial states after it, through the following stages."""
        names, stages = labels(self.stages), self._by_label
        signals = record.u[np.newaxis, np.newaxis]
        for k in range(self.carrier):
            signals = _through(stages[names[k]], own(parameters, names[k]), signals, record)
        mine, carrier = own(parameters, names[self.carrier]), self.stages[self.carrier]
        columns = _regressors(carrier, mine, signals[:, 0], record)
        for name in names[self.carrier + 1 :]:
            stage, its = stages[name], own(parameters, name)
            passed = _through(stage, its, columns.transpose(0, 2, 1), record).transpose(0, 2, 1)
            added = stage.free_responses(its, record)
            n_sets = max(len(passed), len(added))
            blocks = (passed[..., :-1], added, passed[..., -1:])
            columns = np.concatenate([np.broadcast_to(block, (n_sets, *block.shape[1:])) for block in blocks], axis=-1)
        return columns

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        return Cascade(stages=assembled(self.stages, self._searched, parameters))

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        carrier, law = self.stages[self.carrier], model.stages[self.carrier]
        if needs_time(law):
            return ()
        return tuple(f"{labels(self.stages)[self.carrier]}: {note}" for note in carrier.notes(record, law))

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """The states that the stages from the carrier on leave to the record; a cascade has no cycle ahead of it."""
        stages = [*labelled(self.stages).items()][self.carrier :]
        with_state = {label: stage for label, stage in stages if isinstance(stage, roles.Identifiable)}
        states = common_states(with_state, self._record_at(stages[0][0], record))
        return tuple(state for state in states if state != "periodic")

    def variants(self) -> tuple[Variant, ...]:
        carrier = {labels(self.stages)[self.carrier]: self.stages[self.carrier]}
        return combined_variants(carrier, lambda others: replace(self, stages=exchanged(self.stages, others)))

    @property
    def _by_label(self) -> dict[str, Any]:
        """The stages; structures of transfer functions other than the carrier have the gain one."""
        return {
            label: stage.with_unit_gain() if isinstance(stage, roles.LinearStructure) and k != self.carrier else stage
            for k, (label, stage) in enumerate(labelled(self.stages).items())
        }

    @property
    def _searched(self) -> dict[str, Any]:
        carrier = labels(self.stages)[self.carrier]
        named = zip(self._by_label.items(), self.stages, strict=True)
        return {label: stage for (label, stage), own in named if label == carrier or stage is not own}

    def _record_at(self, label: str, record: Record) -> Record:
        """The record for one stage; the input of the carrier passes the stages before it, whose gain is about one."""
        if label != labels(self.stages)[self.carrier]:
            return record
        known = [stage for stage in self.stages[: self.carrier] if not isinstance(stage, roles.LinearStructure)]
        u = reduce(lambda v, stage: response_of(stage, v, time_of(stage, record)), known, record.u)
        return Record(u=u, y=record.y, t=record.t)


def _at_rest(stage: Any, record: Record, freedom: Freedom) -> SearchSpace:
    """The space of a stage in front of the carrier, in whose initial state nothing is linear."""
    space: SearchSpace = stage.search_space(record, replace(freedom, initial="rest"))
    if space.linear:
        raise ValueError(f"{space.linear[0]!r} cannot be free in front of the stage that carries the gain")
    return replace(space, columns=(), state=())


def _through(stage: Any, parameters: Parameters, signals: FloatArray, record: Record) -> FloatArray:
    """Outputs (n_sets, n_signals, n_samples) of a stage for the inputs `signals`, of this shape or (1, ...)."""
    if isinstance(stage, roles.LinearStage):
        return stage.filtered_sets(parameters, signals, record.sample_time)
    each = signals.reshape(-1, signals.shape[-1])
    return np.reshape([response_of(stage, u, time_of(stage, record)) for u in each], signals.shape)


def _regressors(carrier: Any, parameters: Parameters, inputs: FloatArray, record: Record) -> FloatArray:
    """The carrier's columns for one input, or for one of each set, (n_sets or 1, n_samples)."""
    if len(inputs) == 1:
        return np.asarray(carrier.regressors(parameters, Record(u=inputs[0], y=record.y, t=record.t)))
    sets = [{name: np.ravel(values)[k : k + 1] for name, values in parameters.items()} for k in range(len(inputs))]
    return np.concatenate(
        [carrier.regressors(one, Record(u=u, y=record.y, t=record.t)) for one, u in zip(sets, inputs, strict=True)]
    )


@family
class Cascade(Composite):
    """Models in series; ``first >> second`` is short for it.

    A law in front of linear dynamics is Hammerstein's structure, linear dynamics in front of a law are Wiener's. The
    input of a stage at the samples is the output of the stage before, and is between them as for any input.

    Parameters
    ----------
    stages : tuple of models
        Laws, such as `PrandtlIshlinskii`, and plants that depend on time, such as `TransferFunction`, in their order.

    Raises
    ------
    TypeError, ValueError
        If a stage is not a model with a response, or the cascade is empty.

    Examples
    --------
    >>> import hysim as hs
    >>> stack = hs.BoucWen(feedthrough=1.0, gain=-0.3) >> hs.mode(2.0, 0.1)
    >>> stack.response([0.0, 1.0, 1.0], sample_time=0.5).round(6).tolist()
    [0.0, 0.0, 0.34929]
    """

    stages: tuple[Any, ...]

    members_are: ClassVar[str] = "stages"

    @classmethod
    def structure(cls, *stages: Any) -> CascadeStructure:
        """Stages in their order for `hysim.identify` and `hysim.compare`: classes, structures, and models as starts.

        The last stage that is not a transfer function carries the gain; see `hysim.models.cascade`.

        Examples
        --------
        >>> import numpy as np, hysim as hs
        >>> u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
        >>> true = hs.Play(threshold=0.3, gain=2.0) >> hs.TransferFunction(num=(3.0,), den=(1.0, 3.0))
        >>> rec = hs.Record(u=u, y=true.response(u, 0.1), t=0.1 * np.arange(u.size))
        >>> fit = hs.identify(hs.Cascade.structure(hs.Play, hs.TransferFunction.structure(poles=1, zeros=0)), rec)
        >>> round(fit.estimates["play.gain"], 6), round(fit.estimates["transfer_function.den[1]"], 6)
        (2.0, 3.0)
        """
        return CascadeStructure(stages=stages)

    @property
    def behind_filter(self) -> Any:
        """The cascade without the filters of a noisy input at its front, which inverses leave out."""
        first, *others = self.stages
        if not (isinstance(first, Composable) and first.filters_input and others):
            return self
        return others[0] if len(others) == 1 else Cascade(stages=tuple(others)).behind_filter

    def inverse_response(self, y: npt.ArrayLike, u0: float | None = None) -> FloatArray:
        """Input that gives the output `y`; see `hysim.Law.inverse_response`. A filter at the front is left out."""
        model = self.behind_filter
        return np.asarray(model.inverse_response(y, u0)) if model is not self else super().inverse_response(y, u0)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        """The inverse at rest at `u0`, stepped; see `hysim.Law.compiled_inverse`."""
        model = self.behind_filter
        if isinstance(model, roles.StepwiseInvertible) and model is not self:
            return model.compiled_inverse(u0, limits, sample_time)
        return searched_inverse(model, CompiledLaw(*model.compiled(u0)), limits=limits)

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> "Cascade":
        stages, level = [], u0
        for stage in self.stages:
            stages.append(placed(stage, level, u_range))
            known = level is not None and isinstance(stage, roles.Placeable) and not needs_time(stage)
            level = float(stages[-1].response([level])[0]) if known else None
            is_filter = isinstance(stage, Composable) and stage.filters_input
            u_range = u_range if is_filter else None  # what passes a filter keeps its range
        return Cascade(stages=tuple(stages))

    def _driven(self, u: FloatArray, members: Sequence[Driven]) -> tuple[FloatArray, list[FloatArray]]:
        outputs = [*accumulate(members, lambda v, stage: stage(v), initial=u)][1:]
        return outputs[-1], outputs

    def compiled(self, u0: float = 0.0, *, sample_time: float | None = None) -> CompiledLaw:
        laws, level = [], u0
        for stage in self.stages:
            laws.append(compiled_law(stage, level, sample_time))
            step, parameters, state = laws[-1]
            level = step(parameters, state.copy(), level)  # at rest it stays
        return reduce(lambda first, second: compiled_pair(one_behind_the_other, first, second), laws)

    def startable(self, sample_time: float | None = None) -> Startable:
        first, *others = (startable(stage, sample_time) for stage in self.stages)
        behind = [self_started(stage) for stage in others]
        return reduce(lambda first, second: startable_pair(one_behind_the_other, first, second), behind, first)

    @property
    def known_slopes(self) -> tuple[float, float]:
        return reduce(_bounds_of_products, known_slopes(self.stages))

    def as_structure(self) -> CascadeStructure:
        """The structure of the same members, those that can be identified as starts."""
        return CascadeStructure(stages=self.stages)


def _bounds_of_products(first: tuple[float, float], second: tuple[float, float]) -> tuple[float, float]:
    if not all(map(math.isfinite, (*first, *second))):
        return -math.inf, math.inf
    products = [a * b for a in first for b in second]
    return min(products), max(products)
