"""The search spaces of several parts as one, and what the parts leave to the record.

Names of a part begin with its label, as in ``"bouc_wen.beta"``. Coordinates stand one behind the other; starts are the
combinations of the parts' starts. Columns of different parts that are always the same, such as two offsets or the
slopes of two lines, can be told only together: all but the last are held, unless the user says which.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._basics.names import check_parameters
from hysim.models.by_structure import searched
from hysim.models.parts import share_of
from hysim.models.protocols import Variant
from hysim.models.search_space import Freedom, SearchSpace
from hysim.records import Record

_SAME = 1e-12  # rounding of a column
_MOST_STARTS = 16

Space = Callable[[Freedom], SearchSpace]
"""A part's `search_space` on a record."""


def together(spaces: Mapping[str, SearchSpace]) -> SearchSpace:
    """One space with the coordinates of several parts, by their labels."""
    parts = list(spaces.items())

    def named(names: Callable[[SearchSpace], Iterable[str]]) -> tuple[str, ...]:
        return tuple(f"{label}.{name}" for label, space in parts for name in names(space))

    def mapped(values: Callable[[SearchSpace], Mapping[str, Any]]) -> dict[str, Any]:
        return {f"{label}.{name}": value for label, space in parts for name, value in values(space).items()}

    cuts = np.cumsum([len(space.coordinates) for _, space in parts])[:-1]
    box = [np.concatenate([(s.lower, s.upper)[side] for _, s in parts]) for side in (0, 1)]
    drawn = [space.drawn or (space.lower, space.upper) for _, space in parts]
    regions = {}
    for k, (label, space) in enumerate(parts):
        for name, region in space.regions.items():
            sides = [np.split(side, cuts) for side in box]
            for pieces, piece in zip(sides, region, strict=True):
                pieces[k] = piece
            regions[f"{label}.{name}"] = (np.concatenate(sides[0]), np.concatenate(sides[1]))

    def parameters(x: FloatArray) -> dict[str, FloatArray]:
        pieces = np.split(np.atleast_2d(x), cuts, axis=1)
        return {
            f"{label}.{name}": values
            for (label, space), piece in zip(parts, pieces, strict=True)
            for name, values in space.parameters(piece).items()
        }

    screened = [space.screened for _, space in parts if space.coordinates]
    return SearchSpace(
        coordinates=named(lambda space: space.coordinates),
        lower=box[0],
        upper=box[1],
        starts=_starts([space for _, space in parts]),
        names=named(lambda space: space.names),
        columns=named(lambda space: space.columns),
        linear=named(lambda space: space.linear),
        held=mapped(lambda space: space.held),
        parameters=parameters,
        redundant=tuple(tuple(f"{label}.{name}" for name in group) for label, s in parts for group in s.redundant),
        regions=regions,
        bounds=mapped(lambda space: space.bounds),
        state=named(lambda space: space.state),
        physical=mapped(lambda space: space.physical),
        screened=None if None in screened else max((n for n in screened if n is not None), default=0),
        drawn=(np.concatenate([low for low, _ in drawn]), np.concatenate([high for _, high in drawn])),
    )


def declared(spaces: Mapping[str, Space], freedom: Freedom) -> dict[str, SearchSpace]:
    """Each part's space with its share of what the user says."""
    asked = {label: space(replace(freedom, fixed={}, free=(), bounds={})) for label, space in spaces.items()}
    known = [f"{label}.{name}" for label, space in asked.items() for name in (*space.names, *space.held)]
    check_parameters(known, fixed=freedom.fixed, free=freedom.free, bounds=freedom.bounds)
    return {label: _of_part(label, space, freedom) for label, space in spaces.items()}


def _of_part(label: str, space: Space, freedom: Freedom) -> SearchSpace:
    try:
        return space(share_of(freedom, label))
    except ValueError as error:
        raise ValueError(f"{label}: {error}") from None


def without_repetition(
    space: SearchSpace, columns: Callable[[FloatArray], FloatArray], values: Mapping[str, float], freedom: Freedom
) -> SearchSpace:
    """The space in which all but one of the linear parameters with equal columns are held, at `values` or at zero."""
    points = np.stack([space.lower + share * (space.upper - space.lower) for share in (0.45, 0.55)])
    shapes = np.concatenate(columns(points), axis=0)  # two places in the box: what moves with neither is the same
    chosen = {*freedom.free, *freedom.bounds}
    held = dict(space.held)
    for group in _alike(space, shapes):
        free = [name for name in group if name not in held]
        candidates = [name for name in free if name not in chosen]
        held |= {name: values.get(name, 0.0) for name in candidates[: len(free) - 1]}
    return replace(
        space,
        names=tuple(name for name in space.names if name not in held),
        linear=tuple(name for name in space.linear if name not in held),
        held=held,
        bounds={name: pair for name, pair in space.bounds.items() if name not in held},
    )


def columns_beside(blocks: Sequence[FloatArray], known: FloatArray | float = 0.0) -> FloatArray:
    """Blocks (n_sets or 1, n_samples, n_columns + 1) of columns and an output as one; `known` is an output alone."""
    n_sets = max([len(block) for block in blocks], default=1)
    joint = [np.broadcast_to(block, (n_sets, *block.shape[1:])) for block in blocks]
    beside = sum((block[..., -1:] for block in joint), known)
    return np.concatenate([*(block[..., :-1] for block in joint), beside], axis=-1)


def _alike(space: SearchSpace, shapes: FloatArray) -> list[list[str]]:
    """Groups of linear parameters whose columns (n, n_columns) are multiples of each other."""
    finite = np.isfinite(shapes).all(axis=0)
    norms = np.linalg.norm(np.where(finite, shapes, 0.0), axis=0)
    unit = np.where(finite, shapes, 0.0) / np.where(norms > 0.0, norms, 1.0)
    groups: list[tuple[FloatArray, list[str]]] = []
    for name, column, norm in zip(space.columns, unit.T, norms, strict=True):
        if norm == 0.0:
            continue
        like = [names for other, names in groups if abs(abs(float(other @ column)) - 1.0) < _SAME]
        if like:
            like[0].append(name)
        else:
            groups.append((column, [name]))
    return [names for _, names in groups if len(names) > 1]


def _starts(spaces: Sequence[SearchSpace]) -> FloatArray:
    """Combinations of the parts' starts, the first ones of each first; the middle of the box without starts."""
    choices = [space.starts if len(space.starts) else 0.5 * (space.lower + space.upper)[np.newaxis] for space in spaces]
    ranked = sorted(product(*(range(len(rows)) for rows in choices)), key=sum)[:_MOST_STARTS]
    return np.array([np.concatenate([rows[k] for rows, k in zip(choices, places, strict=True)]) for places in ranked])


def common_states(parts: Mapping[str, Any], record: Record) -> tuple[str, ...]:
    """Values of `initial` that every part with a state leaves to the record; empty if one leaves nothing open."""
    offered = [searched(part).assumed_states(record) for part in parts.values() if part.search_space(record).state]
    return tuple(state for state in offered[0] if all(state in each for each in offered)) if offered else ()


def combined_variants(parts: Mapping[str, Any], assembled: Callable[[Mapping[str, Any]], Any]) -> tuple[Variant, ...]:
    """Every combination of the parts' variants; `assembled` gives the whole with other parts by their labels."""
    choices = {label: variants for label, part in parts.items() if (variants := searched(part).variants())}
    if not choices:
        return ()
    return tuple(
        Variant(
            assembled({label: each.family for label, each in zip(choices, chosen, strict=True)}),
            " and ".join(f"{label} with {each.words}" for label, each in zip(choices, chosen, strict=True)),
            all(each.offered for each in chosen),
        )
        for chosen in product(*choices.values())
    )
