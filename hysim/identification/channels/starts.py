"""Starts of a search for parameters that depend on channels: short searches of the law itself.

The law without a dependence, on all records, and the law on the records of each value of the channels, one after the
other; polynomials of least squares through the parameters that these have are the second start.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hysim._channels import steady
from hysim.errors import SimulationError
from hysim.identification._budget import Budget
from hysim.identification._problem import problem
from hysim.identification._search import brief_optimum
from hysim.models.dependent_structure import DependentStructure
from hysim.models.search_space import Freedom
from hysim.models.varying import weights
from hysim.records import Record

_MOST_GROUPS = 12

Initial = str | Sequence[str] | None


def begun(
    structure: DependentStructure,
    records: Sequence[Record],
    freedom: Freedom,
    initial: Initial,
    max_evaluations: int | None = None,
) -> DependentStructure:
    """The structure with starts where short searches of its law end; itself where nothing searched depends.

    All of them together simulate half of `max_evaluations` parameter sets at most.
    """
    if all(name in structure.columns for name in structure.at):
        return structure
    groups = _groups(structure, records)
    share = None if max_evaluations is None else max_evaluations / (2.0 * (1 + len(groups)))

    def found(chosen: Sequence[int]) -> dict[str, float] | None:
        own = initial if initial is None or isinstance(initial, str) else [initial[k] for k in chosen]
        return _found(structure.law, [records[k] for k in chosen], freedom, own, share)

    alike = found(range(len(records)))
    starts = [] if alike is None else [_alike(structure, alike)]
    if 1 < len(groups) <= _MOST_GROUPS:
        known = [each for numbers in groups.values() if (each := found(numbers)) is not None]
        first = [records[numbers[0]] for numbers in groups.values()]
        starts[:0] = [_through(structure, first, known)] if len(known) == len(groups) else []
    return replace(structure, starts=tuple(starts))


def _found(
    law: Any, records: Sequence[Record], freedom: Freedom, initial: Initial, share: float | None
) -> dict[str, float] | None:
    """The parameters of the law where a short search of so many parameter sets ends; None if it finds nothing."""
    budget = None if share is None else Budget(share * sum(map(len, records)))
    try:
        attempt = problem(law, records, freedom, initial).within(budget)
        x, cost = brief_optimum(attempt)
    except (ValueError, ArithmeticError, SimulationError):  # such as too few samples for the law alone
        return None
    return attempt.estimates(attempt.completed(x[np.newaxis])[0]) if np.isfinite(cost) else None


def _groups(structure: DependentStructure, records: Sequence[Record]) -> dict[tuple[float, ...], list[int]]:
    """Numbers of the records by the values of their channels; none if a channel varies along a record."""
    channels = sorted({channel for channel, _ in structure.depends.values()})
    groups: dict[tuple[float, ...], list[int]] = {}
    for k, record in enumerate(records):
        values = [steady(record.channels[channel]) for channel in channels]
        if any(np.ndim(value) for value in values):
            return {}
        groups.setdefault(tuple(values), []).append(k)
    return groups


def _through(
    structure: DependentStructure, records: Sequence[Record], known: Sequence[Mapping[str, float]]
) -> dict[str, float]:
    """Values of polynomials through the `known` parameters of the law on some records, and medians of the others."""
    start = {name: float(np.median([each[name] for each in known])) for name in known[0]}
    for name, at in structure.at.items():
        if name in start:
            channel = structure.depends[name][0]
            rows = weights(at, [steady(record.channels[channel]) for record in records])
            values = np.linalg.lstsq(rows, np.array([each[name] for each in known]), rcond=None)[0]
            start |= dict(zip(structure.names[name], values.tolist(), strict=True))
            del start[name]
    return start


def _alike(structure: DependentStructure, known: Mapping[str, float]) -> dict[str, float]:
    """The parameters of the law as a start at which nothing depends on a channel."""
    start = dict(known)
    for name, names in structure.names.items():
        if name in start:
            start |= dict.fromkeys(names, start.pop(name))
    return start
