"""A memory that nobody measured, from the equation of motion along a measured displacement.

    m y'' + c y' + k y + z = u,    z' = sum of coefficients times terms in (y', z)

For given coefficients z follows from y by integration, so that neither y'' nor z' is ever taken of noise, and no kink
of |y'| or |z| is smoothed. Both sides of the equation of motion are filtered alike (`hysim.models.equation_of_motion`),
which keeps it an identity; its error is about one of the displacement. It is linear in m, c and k, which are projected
out, and its slopes along the coefficients come with z: a Gauss-Newton step is a regression on terms. Since z = A y is
no error of the equation where k is free, only the memory's curvature tells A from k; the descent begins from several
shares of the stiffness.

Reversals that noise makes add to the length of y's path, so the numbers are biased by a percent or so: they begin a
refinement by simulation.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from hysim._frozen import FloatArray
from hysim.discovery._marquardt import descended
from hysim.discovery._memory_terms import RELAXATION, MemoryTerm, bouc_wen_terms, cases, law
from hysim.discovery._term_regression import BLOCKS, FLOOR, TermRegression, term_regression
from hysim.kernels import hidden as kernels
from hysim.models.equation_of_motion import Filter, Linear, Motion, filtering
from hysim.models.resampling import interpolated

POWERS = (1.0, 2.0, 3.0)
SHARES = (0.2, 0.5, 0.8)  # of the stiffness of small motions, in A
PLANT = ("mass", "damping", "stiffness")

_FINER = 4  # increments of y for each sample
_DEGREE = 3


class Regressed(NamedTuple):
    """A law, the plant that goes with it, and the share of the filtered force that they leave unexplained."""

    coefficients: dict[MemoryTerm, float]
    plant: dict[str, float]
    error: float


class _Along(NamedTuple):
    """One motion: its filter, its increments, their time, and how much of the memory along them is kept."""

    filtered: Filter
    steps: FloatArray
    h: float
    kept: slice


class HiddenMemory:
    """Regressions of the memory along one or several motions of one plant, parts of which may be `known`."""

    def __init__(self, motions: Sequence[Motion], linear: Linear, known: Mapping[str, float]) -> None:
        self.linear, self.known = linear, dict(known)
        self._along = [_along(motion, linear) for motion in motions]
        force = self._stacked([motion.force for motion in motions], 0)
        sides = {
            name: self._stacked([motion.y for motion in motions], power)
            for name, power in zip(PLANT, (2, 1, 0), strict=True)
        }
        self._target = force - sum((value * sides[name] for name, value in known.items()), np.zeros_like(force))
        self._free = [name for name in PLANT if name not in known]
        self._columns = np.array([sides[name] for name in self._free]).reshape(-1, force.size).T
        self._basis = np.linalg.qr(self._columns / np.linalg.norm(self._columns, axis=0))[0]
        self._size = float(np.linalg.norm(force))

    def fit(self, terms: Sequence[MemoryTerm]) -> Regressed | None:
        """The law of these terms, the first of which is u', from the best of several starts; None if all escape."""
        spring = self.linear.stiffness
        shares = [1.0 - self.known["stiffness"] / spring] if "stiffness" in self.known else SHARES
        starts = [np.array([max(share, 0.01) * spring, *np.zeros(len(terms) - 1)]) for share in shares]
        found = [each for start in starts if (each := self._descended(terms, start)) is not None]
        return min(found, key=lambda each: each.error, default=None)

    def nearest(self) -> Regressed | None:
        """The Bouc-Wen law with a whole n, or the linear relaxation, of the smallest error; None if all diverge."""
        laws = [bouc_wen_terms(n) for n in POWERS] + [(bouc_wen_terms(1.0)[0], RELAXATION)]
        found = [each for terms in laws if (each := self.fit(terms)) is not None]
        return min(found, key=lambda each: each.error, default=None)

    def regression(self, library: Sequence[MemoryTerm]) -> TermRegression:
        """The regression of what a linear spring leaves on all terms, whose slopes are those about z = A y."""
        spring = bouc_wen_terms(1.0)[0]
        terms = (spring, *(term for term in library if term != spring))
        share = 1.0 - self.known.get("stiffness", 0.5 * self.linear.stiffness) / self.linear.stiffness
        x = np.array([share * self.linear.stiffness, *np.zeros(len(terms) - 1)])
        rows = self._memory(terms, x)
        if rows is None:
            raise ValueError("the displacement is not finite or too large")
        target = self._target - rows[0] + rows[1] * x[0]
        edges = [target.size * k // BLOCKS for k in range(BLOCKS + 1)]
        blocks = [slice(*pair) for pair in itertools.pairwise(edges)]
        floor = FLOOR * self._size / float(np.sqrt(target.size))
        return term_regression(terms, self._columns, rows[1:].T, target, floor, blocks)

    def _descended(self, terms: Sequence[MemoryTerm], start: FloatArray) -> Regressed | None:
        def left(x: FloatArray) -> FloatArray | None:
            rows = self._memory(terms, x)
            return None if rows is None else self._projected(self._target - rows[0])

        def slopes(x: FloatArray) -> tuple[FloatArray, FloatArray]:
            rows = self._memory(terms, x)
            columns = np.empty((self._target.size, 0)) if rows is None else rows[1:].T
            return self._projected(columns), np.linalg.norm(columns, axis=0)

        return self._regressed(terms, descended(left, slopes, start))

    def _regressed(self, terms: Sequence[MemoryTerm], x: FloatArray) -> Regressed | None:
        rows = self._memory(terms, x)
        if rows is None:
            return None
        goal = self._target - rows[0]
        plant = np.linalg.lstsq(self._columns, goal, rcond=None)[0].tolist()
        error = float(np.linalg.norm(self._projected(goal))) / self._size
        found = dict(zip(terms, x.tolist(), strict=True))
        return Regressed(found, self.known | dict(zip(self._free, plant, strict=True)), error)

    def _memory(self, terms: Sequence[MemoryTerm], x: FloatArray) -> FloatArray | None:
        """Filtered memory and its slopes along the coefficients, (1 + n_terms, n_rows); None if it escapes."""
        polynomial, _, _, relaxation = law(dict(zip(terms, x.tolist(), strict=True)), _DEGREE)
        whole = [term for term in terms if term.whole]
        units = np.array([cases(term, _DEGREE) for term in whole])
        place = [1 + (len(whole) if term is RELAXATION else whole.index(term)) for term in terms]
        signals = []
        for each in self._along:
            found = np.zeros((2 + len(whole), each.steps.size + 1))
            if not kernels.along(each.steps, each.h, polynomial, relaxation, units, found[0], found[1:]):
                return None
            signals.append(found[[0, *place]][:, each.kept])
        rows = self._stacked(signals, 0)
        return rows if np.isfinite(rows).all() else None

    def _stacked(self, signals: Sequence[FloatArray], power: int) -> FloatArray:
        return np.concatenate(
            [each.filtered(signal, power) for each, signal in zip(self._along, signals, strict=True)], axis=-1
        )

    def _projected(self, rows: FloatArray) -> FloatArray:
        return np.asarray(rows - self._basis @ (self._basis.T @ rows))


def _along(motion: Motion, linear: Linear) -> _Along:
    h = motion.sample_time / _FINER
    if motion.periodic:
        fine = interpolated(motion.y, _FINER)
        steps = np.diff(np.tile(fine, 2), append=fine[0])
        return _Along(filtering(motion, linear), steps, h, slice(fine.size, -1, _FINER))
    places = np.arange((motion.y.size - 1) * _FINER + 1) / _FINER
    fine = CubicSpline(np.arange(motion.y.size), motion.y)(places)
    return _Along(filtering(motion, linear), np.diff(fine), h, slice(None, None, _FINER))
