"""The search for an actuator: the columns in which its output is affine, and where to begin.

The columns are those of its law, through everything behind it. The law sees the voltage, at the ends of sub-steps where
an amplifier takes time. What is behind it is linear and begins at rest, so that each column passes through it by
itself, exactly as an `Actuator` passes it (`hysim.plants.chain`). Of many sets of parameters those that share the
law's, or those of the other parts, share the work on them.

The search for a mode and a delay begins with points spread over their box on the fastest record. A light mode is found
from afar by a broad one: at a first pass of wide dampings a grid of frequencies is dense enough, at a second one, about
the best of it, light dampings are tried. All other coordinates have the values that are known.
"""

import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim._basics.parallel import in_chunks
from hysim.kernels import actuator_columns as kernels
from hysim.models.search_space import Parameters, SearchSpace
from hysim.plants.chain import Chain, Stages
from hysim.plants.linear_parts import DAMPING, FREQUENCY, GAIN
from hysim.plants.stages import Amplifier
from hysim.records import Record

Rows = npt.NDArray[np.intp]
_SETS_PER_THREAD = 2
MOST_LATE = 13  # samples of delay that are tried where no descent finds it
_PER_DECADE = 55  # frequencies: a step is half the width of the narrower mode that is tried
_BROAD = (0.03, 0.2)  # damping ratios
_LIGHT = (0.003, 0.012, 0.04)
_NEAR, _N_NEAR = 0.04, 11  # share of a frequency about which finer ones are tried, and how many
_SHARES = (-0.3, -0.05, 0.05, 0.3)  # gains of a further mode
_DELAYS = (0.0, 1.5, 3.0, 6.0, 10.0)  # samples
_NEAR_DELAYS = (-0.8, 0.0, 0.8)  # likewise, beside those of the best points
_MIDDLES = (-1.5, -0.5, 0.5, 1.5, 2.5)  # samples from a whole delay
_DELAY = "vibration.delay"
_TIME_CONSTANT = "amplifier.time_constant"
_SLOWER = (10.0, 50.0, 250.0)  # times the shortest time constant
_MOST_BEGUN = 2  # sets of known coordinates beside which points are spread


def columns_through(
    law: Any, shape: Parameters, parts: Parameters, stages: Callable[[Mapping[str, float]], Stages], record: Record
) -> FloatArray:
    """Columns (n_sets, n_samples, n_columns + 1) for the law's parameters and those of the other parts."""
    step = record.sample_time
    n_sets = max((np.size(value) for value in (*shape.values(), *parts.values())), default=1)
    own, of_law = _distinct(shape, n_sets)
    values, of_parts = _distinct(parts, n_sets)
    chains = [_chain(stages(each), step) for each in values]
    drives = [_voltage(chain, record.u) for chain in chains]
    blocks: dict[tuple[int, int], FloatArray] = {}
    for drive, mine in _by_drive(drives, of_law, of_parts):
        chosen = {name: np.array([own[k][name] for k in mine]) for name in shape}
        columns = law.regressors(chosen, Record(u=drives[drive], y=drives[drive], t=_times(drives[drive], record)))
        columns = np.broadcast_to(columns, (len(mine), *columns.shape[1:]))
        blocks |= {(drive, k): np.ascontiguousarray(block.T) for k, block in zip(mine, columns, strict=True)}
    first = _first_of_equal(drives)
    n_columns = len(next(iter(blocks.values())))
    pairs, which = np.unique(np.stack([of_parts, of_law], axis=1), axis=0, return_inverse=True)
    out = np.empty((len(pairs), n_columns, len(record)))

    def work(start: int, stop: int) -> None:
        for k in range(start, stop):
            part, own_law = pairs[k].tolist()
            _pass(chains[part], blocks[first[part], own_law], out[k])

    in_chunks(work, len(pairs), minimum=_SETS_PER_THREAD, n_samples=len(record))
    return np.asarray(out[np.ravel(which)].transpose(0, 2, 1))


def _pass(chain: Chain, w: FloatArray, out: FloatArray) -> None:
    """Columns `w` (n_columns, n_fine) through the stage after the law; constant ones have its gain at rest."""
    stage, row = chain.stage, chain.output_row
    gain = float(row[0] + row[1] + row[2] + row[3:] @ stage.rest)
    still = (w == w[:, :1]).all(axis=1)
    out[still] = gain * w[still, :1]
    if not still.all():
        moving = np.empty((int(np.count_nonzero(~still)), out.shape[1]))
        kernels.through(stage.decline, stage.A, stage.B, row, stage.rest, stage.lag, chain.substeps, w[~still], moving)
        out[~still] = moving


def _distinct(parameters: Parameters, n_sets: int) -> tuple[list[dict[str, float]], Rows]:
    names = list(parameters)
    if not names:
        return [{}], np.zeros(n_sets, dtype=np.intp)
    table = np.stack([np.broadcast_to(np.ravel(parameters[name]), n_sets) for name in names], axis=1)
    rows, which = np.unique(table, axis=0, return_inverse=True)
    return [dict(zip(names, row, strict=True)) for row in rows.tolist()], np.ravel(which)


@functools.lru_cache(maxsize=1024)  # a search comes back to the best of some hundred points
def _chain(stages: Stages, step: float) -> Chain:
    """The stages at a sample time; where inputs are compared, they are the same for all of them."""
    return Chain(stages, step)


def _voltage(chain: Chain, u: FloatArray) -> FloatArray:
    amplifier: Amplifier = chain.amplifier
    if not amplifier.dynamic:
        return amplifier.voltage(u)
    return chain.driven(u, chain.rest(float(u[0])))[0].v


def _times(drive: FloatArray, record: Record) -> FloatArray:
    return record.sample_time * len(record) / drive.size * np.arange(float(drive.size))


def _first_of_equal(drives: list[FloatArray]) -> list[int]:
    return [next(j for j, other in enumerate(drives) if np.array_equal(drive, other)) for drive in drives]


def _by_drive(drives: list[FloatArray], of_law: Rows, of_parts: Rows) -> list[tuple[int, list[int]]]:
    first = np.array(_first_of_equal(drives))
    pairs = {(int(drive), int(k)) for drive, k in zip(first[of_parts], of_law, strict=True)}
    return [(drive, sorted(k for d, k in pairs if d == drive)) for drive in sorted({drive for drive, _ in pairs})]


def as_points(space: SearchSpace, known: Sequence[Mapping[str, float]]) -> FloatArray:
    """Coordinates (n, n_x) by name, the missing ones as of each start of the space; without any these starts."""
    rows = [
        [each.get(name, value) for name, value in zip(space.coordinates, start, strict=True)]
        for each in known or ({},)
        for start in space.starts.tolist()
    ]
    return np.unique(rows, axis=0) if len(rows) > 1 else np.array(rows).reshape(len(rows), -1)


def points(space: SearchSpace, modes: int, known: Sequence[Mapping[str, float]]) -> FloatArray:
    """Points (n, n_x) spread over the last of so many modes and the delay."""
    frequency, damping, gain = _names(modes)
    axes: dict[str, Any] = {}
    if frequency in space.coordinates:
        low, high = (side[space.coordinates.index(frequency)] for side in (space.lower, space.upper))
        count = 1 + int(np.ceil((high - low) / np.log(10.0) * _PER_DECADE))
        axes[frequency] = np.linspace(low, high, count)
    axes |= {damping: np.log(_BROAD), gain: _SHARES} if modes else {}
    axes |= {_DELAY: _DELAYS} if modes < 2 else {}
    if modes < 2 and _TIME_CONSTANT in space.coordinates:
        axes[_TIME_CONSTANT] = space.lower[space.coordinates.index(_TIME_CONSTANT)] + np.log(_SLOWER)
    return _spread(space, axes, as_points(space, known)[:_MOST_BEGUN])


def finer(space: SearchSpace, modes: int, best: FloatArray) -> FloatArray:
    """Points (n, n_x) of lighter dampings about the frequencies and delays of the `best` ones, and these."""
    frequency, damping, _ = _names(modes)
    if not {frequency, damping} & {*space.coordinates}:
        return best
    about = []
    for point in best:
        axes: dict[str, Any] = {damping: np.log(_LIGHT)}
        if frequency in space.coordinates:
            centre = point[space.coordinates.index(frequency)]
            axes[frequency] = centre + np.linspace(-_NEAR, _NEAR, _N_NEAR)
        if _DELAY in space.coordinates:
            axes[_DELAY] = point[space.coordinates.index(_DELAY)] + np.array(_NEAR_DELAYS)
        about.append(_spread(space, axes, point[np.newaxis]))
    return np.concatenate([best, *about])


def between_samples(space: SearchSpace, end: FloatArray) -> FloatArray:
    """The end (1, n_x) of a descent, and points between whole samples of delay, where slopes jump."""
    if _DELAY not in space.coordinates:
        return end
    nearest = np.round(end[0, space.coordinates.index(_DELAY)])
    return np.unique(np.concatenate([end, _spread(space, {_DELAY: nearest + np.array(_MIDDLES)}, end)]), axis=0)


def _names(modes: int) -> tuple[str, str, str]:
    frequency, damping, gain = (f"vibration.{name}[{modes - 1}]" for name in (FREQUENCY, DAMPING, GAIN))
    return frequency, damping, gain


def _spread(space: SearchSpace, axes: Mapping[str, Any], base: FloatArray) -> FloatArray:
    """Every combination of values of the axes that the space has, with each of the base points."""
    own = {name: values for name, values in axes.items() if name in space.coordinates}
    if not own:
        return base
    places = [space.coordinates.index(name) for name in own]
    grid = np.array(list(itertools.product(*own.values()))).reshape(-1, len(places))
    spread = np.repeat(base, len(grid), axis=0)
    spread[:, places] = np.tile(grid, (len(base), 1))
    return np.clip(spread, space.lower, space.upper)
