"""Starts of the search for a mode and a delay: points spread over their box on the fastest record.

A light mode is found from afar by a broad one: at a first pass of wide dampings a grid of frequencies is dense enough,
at a second one, about the best of it, light dampings are tried. All other coordinates have the values that are known.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.search_space import SearchSpace
from hysim.plants.whole.linear_parts import DAMPING, FREQUENCY, GAIN

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
    """The end (1, n_x) of a descent, and points with delays in the middle of the samples about its own.

    Slopes by the delay jump at whole samples, where a descent may rest that should go on.
    """
    if _DELAY not in space.coordinates:
        return end
    whole = np.round(end[0, space.coordinates.index(_DELAY)])
    return np.unique(np.concatenate([end, _spread(space, {_DELAY: whole + np.array(_MIDDLES)}, end)]), axis=0)


def _names(modes: int) -> tuple[str, str, str]:
    frequency, damping, gain = (f"vibration.{name}[{modes - 1}]" for name in (FREQUENCY, DAMPING, GAIN))
    return frequency, damping, gain


def _spread(space: SearchSpace, axes: Mapping[str, Any], base: FloatArray) -> FloatArray:
    """Every combination of values of the axes that the space has, beside each of the base points."""
    own = {name: values for name, values in axes.items() if name in space.coordinates}
    if not own:
        return base
    places = [space.coordinates.index(name) for name in own]
    grid = np.array(list(itertools.product(*own.values()))).reshape(-1, len(places))
    spread = np.repeat(base, len(grid), axis=0)
    spread[:, places] = np.tile(grid, (len(base), 1))
    return np.clip(spread, space.lower, space.upper)
