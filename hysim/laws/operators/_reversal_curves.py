"""The Everett function from first-order reversal curves, between the turning points as well.

A curve turns at a_m on its way up from the lowest input L and falls back to it. On its way down it measures

    E(a_m, b) = (y(a_m) - y(b)) / 2

at each of its samples b. Between two curves, with t = (a - a_m) / (a_(m+1) - a_m),

    E(a, b) = (1 - t) E(a_m, b) + t E(a_(m+1), b) + r(a) c(b)     for b up to a_m
    E(a, b) = t E(a_(m+1), b') + r(a) c(b')                       for b from a_m to a, b' stretched to end at a_(m+1)

r(a) is half of what the output on the rise to a_(m+1) is above a straight line from a_m. The relays between the curves
have it in proportion to their weights' sizes: c(b) is the total variation of E(a_(m+1), .) - E(a_m, .) above b over
that above the lowest input. So the rise is met as well as the curves, and a law whose density is even between the
turning points is returned exactly, whatever the levels.
"""

from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.records import Record

_MOST_LEVELS = 100  # beside turning points
_CLOSEST = 1e-3  # distance of levels, as a fraction of the span


class ReversalCurve(NamedTuple):
    """A way down, and the rise before it; None if the record begins at the turning point."""

    fall: Record
    rise: Record | None

    @property
    def turn(self) -> float:
        """Input at which the curve turns."""
        return float(self.fall.u[0])

    def everett(self, b: FloatArray) -> FloatArray:
        """E(turn, b) at inputs from the lowest to the turning point."""
        return np.asarray(0.5 * (self.fall.y[0] - _at(b, self.fall)))


def curves_of(record: Record, tolerance: float) -> list[ReversalCurve]:
    """The curves of a record by their turning points, of equal ones the last; a ValueError if it has none."""
    low, slack = float(record.u.min()), tolerance * float(np.ptp(record.u))
    branches = record.branches(tolerance)
    curves: dict[float, ReversalCurve] = {}
    for before, branch in zip((None, *branches), branches, strict=False):
        if branch.u[-1] >= branch.u[0]:
            continue
        if branch.u[-1] > low + slack:
            raise ValueError(
                f"the way down from {branch.u[0]:g} must end at the lowest input {low:g}, it ends at {branch.u[-1]:g}"
            )
        curves[float(branch.u[0])] = ReversalCurve(branch, before)
    if not curves:
        raise ValueError("the input never falls: a reversal curve is a way up and the way down after it")
    return [curves[turn] for turn in sorted(curves)]


def levels_of(low: float, curves: list[ReversalCurve]) -> FloatArray:
    """The turning points and all inputs of the curves; even steps between turning points if these are too many."""
    turns = np.array([low, *(curve.turn for curve in curves)])
    span = float(turns[-1] - low)
    every = np.unique(np.concatenate([turns, *(curve.fall.u for curve in curves)]))
    every = every[(every >= low) & (every <= turns[-1])]
    if every.size <= _MOST_LEVELS and np.diff(every).min() >= _CLOSEST * span:
        return np.asarray(every)
    parts = np.maximum(np.round(np.diff(turns) * _MOST_LEVELS / span), 1).astype(int)
    steps = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(turns[:-1], turns[1:], parts, strict=True)]
    return np.append(np.concatenate(steps), turns[-1])


def everett_between(low: float, levels: FloatArray, curves: list[ReversalCurve]) -> FloatArray:
    """E at the pairs of levels (upper, lower), zero above the diagonal; beyond the curves as at their ends."""
    table = np.zeros((levels.size, levels.size))
    turn, below = low, np.zeros(levels.size)
    for curve in curves:
        above = np.where(levels < curve.turn, curve.everett(levels), 0.0)
        between = np.flatnonzero((levels > turn) & (levels <= curve.turn))
        reached = (levels[between] - turn) / (curve.turn - turn)
        share = _share(above - below)
        for k, t, r in zip(between, reached, _above_line(curve, turn, levels[between], reached), strict=True):
            table[k] = np.where(levels <= turn, (1.0 - t) * below + t * above + r * share, 0.0)
            inner = (levels > turn) & (levels < levels[k])
            stretched = turn + (levels[inner] - turn) / t
            table[k, inner] = t * curve.everett(stretched) + r * np.interp(stretched, levels, share)
        turn, below = curve.turn, above
    table[levels > turn] = below
    return table


def _share(difference: FloatArray) -> FloatArray:
    """Total variation above each level over that above the lowest one."""
    above = np.append(np.cumsum(np.abs(np.diff(difference))[::-1])[::-1], 0.0)
    return above / (above[0] or 1.0)


def _above_line(curve: ReversalCurve, turn: float, levels: FloatArray, reached: FloatArray) -> FloatArray:
    """Half of what the rise to a curve is above a straight line from the turning point before."""
    if curve.rise is None:
        return np.zeros(levels.size)
    start, end = _at(np.array([turn, curve.turn]), curve.rise)
    return np.asarray(0.5 * (_at(levels, curve.rise) - start - reached * (end - start)))


def _at(inputs: FloatArray, branch: Record) -> FloatArray:
    """Outputs of a branch where its input passes the inputs."""
    order = np.argsort(branch.u, kind="stable")
    return np.interp(inputs, branch.u[order], branch.y[order])
