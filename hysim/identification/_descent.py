"""The descent of many sets of parameters: all parameters of a problem, any noise, a constraint if wanted.

A set is theta = (x, b), coordinates and linear parameters. With J = dm/dtheta, the slopes g and curvatures W >= 0 of
the loss in the model's output m, and the best sigma for the residuals at hand, a step d solves the weighted regression

    minimise  1/2 || W^(1/2) J d + W^(-1/2) g ||^2 + damping || D d ||^2

(`hysim.identification.marquardt`; the loss is linear in no other way in b, whose part of the step is not damped). Laws
that nearly forget a parameter, or nearly diverge, have sums of squares like narrow bent valleys, with curvatures that
differ by 1e9: there steps are bent (M. K. Transtrum and J. P. Sethna, arXiv:1201.5885, 2012), and the slopes of stiff
coordinates are taken over shorter distances. A constraint "this parameter has that value" is kept by eliminating one
coordinate, the pivot, from the step, and by bringing the pivot back onto the constraint after it.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.identification._noise import Noise
from hysim.identification._problem import Problem
from hysim.identification.marquardt import Evaluated, Flags, Sets, System, Trial, bounded_steps, descend

N_STEPS = 60
_MOST_AT_ONCE = 1_000_000  # samples of all sets that descend together, to bound the memory
_TRIALS = 3  # sets that a step tries, for the budget
_RESTORING = 12
_ON_CONSTRAINT = 1e-11  # relative error of the constrained value
_LARGEST = 1e150  # beyond it squares overflow
_STIFF = 1e-5  # relative change of the outputs by a difference, from which on a slope is taken by a shorter one
_CHANGE = 1e-7  # likewise by the shorter one: truncation and rounding stay small
_CHANGE_OF_CLOSE = 1e3  # likewise at least, in units of the accuracy of a law that stands for another


class Constraint(NamedTuple):
    """In each set the parameter `place` of `space.names` has the value `value`; both (n_sets,)."""

    place: Sets
    value: FloatArray


class Reached(NamedTuple):
    """Ends of a descent: theta (n_sets, n_theta), minus the log-likelihood, sigma, and whether each came to rest."""

    theta: FloatArray
    loss: FloatArray
    sigma: FloatArray
    at_rest: Flags


@dataclass(frozen=True)
class Descent:
    """Outputs `targets` to be met with `weights`, (n_sets or 1, n_samples); `projected` solves for b at each step."""

    problem: Problem
    noise: Noise
    targets: FloatArray
    weights: FloatArray
    projected: bool = False

    def run(
        self, theta: FloatArray, *, constraint: Constraint | None = None, tolerance: float = 1e-5, steps: int = N_STEPS
    ) -> Reached:
        """Descend from `theta` (n_sets, n_theta) until a step lowers the loss by less than `tolerance`."""
        few = max(1, _MOST_AT_ONCE // self.problem.y.size)
        if len(theta) > few and constraint is None:
            parts = []
            for k in (slice(first, first + few) for first in range(0, len(theta), few)):
                own = replace(self, targets=_some(self.targets, k), weights=_some(self.weights, k))
                parts.append(own.run(theta[k], tolerance=tolerance, steps=steps))
            return Reached(*map(np.concatenate, zip(*parts, strict=True)))
        targets, weights = (np.broadcast_to(each, (len(theta), each.shape[1])) for each in (self.targets, self.weights))
        sets = _Sets(self, targets, weights * self.problem.weights, constraint)
        theta = np.clip(theta, *self.box())
        if constraint is not None:
            theta = self.restored(theta, constraint, self.pivots(theta, constraint)[0])
        if (budget := self.problem.budget) is not None:
            steps = budget.steps(steps, len(theta) * (self.problem.n_x + _TRIALS), self.problem.y.size)
        bend = sets.bent if constraint is None else None
        reached = descend(sets, theta, tolerance=tolerance, steps=steps, bend=bend)
        return Reached(reached.x, reached.loss, reached.evaluated[2][:, 0], reached.at_rest)

    def box(self) -> tuple[FloatArray, FloatArray]:
        space, linear = self.problem.space, self.problem.linear_box()
        return np.concatenate([space.lower, linear[0]]), np.concatenate([space.upper, linear[1]])

    def slopes(self, theta: FloatArray, outputs: FloatArray, columns: FloatArray) -> FloatArray:
        """dm/dtheta, (n_sets, n_samples, n_theta), at points with these `outputs` and `columns`."""
        n_sets, n_x = len(theta), self.problem.n_x
        jacobian = np.empty((n_sets, n_x + columns.shape[2], outputs.shape[1]))  # rows are in one piece
        jacobian[:, n_x:] = columns.transpose(0, 2, 1)
        if not n_x:
            return jacobian.transpose(0, 2, 1)
        x = theta[:, :n_x]
        ends, steps = self.problem.beside(x)
        changes = jacobian[:, :n_x]
        self._change(changes, theta, outputs, ends, np.indices(steps.shape).reshape(2, -1))
        stiff, shares = self._stiff(changes, outputs)
        places: Sets = np.stack(np.nonzero(stiff))
        ends[stiff] = x[places[0]] + shares[:, np.newaxis] * (ends[stiff] - x[places[0]])
        steps[stiff] = ends[(*places, places[1])] - x[stiff]
        self._change(changes, theta, outputs, ends, places)
        with np.errstate(over="ignore", invalid="ignore"):
            changes /= steps[..., np.newaxis]
        changes[~np.isfinite(changes)] = 0.0
        return jacobian.transpose(0, 2, 1)

    def _change(
        self, changes: FloatArray, theta: FloatArray, outputs: FloatArray, ends: FloatArray, places: Sets
    ) -> None:
        """Fill in `changes` (n_sets, n_x, n_samples) of the `outputs` where the coordinates at `places` (2, n) end."""
        for part in self.problem.chunks(places.shape[1]):
            sets, coordinates = places[:, part]
            there = theta[sets]
            there[:, : self.problem.n_x] = ends[sets, coordinates]
            with np.errstate(over="ignore", invalid="ignore"):
                changes[sets, coordinates] = self.problem.model(there) - outputs[sets]

    def _stiff(self, changes: FloatArray, outputs: FloatArray) -> tuple[Flags, FloatArray]:
        """Sets and coordinates whose change is too large for a slope, and the shares of their distances that do."""
        wanted = max(_CHANGE, _CHANGE_OF_CLOSE * self.problem.accuracy)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            sizes = np.linalg.norm(changes, axis=2) / np.linalg.norm(outputs, axis=1)[:, np.newaxis]
        stiff = np.isfinite(sizes) & (sizes > max(_STIFF, wanted))
        return stiff, wanted / sizes[stiff]

    def pivots(self, theta: FloatArray, constraint: Constraint) -> tuple[Sets, FloatArray]:
        """Element of theta that each constraint is solved for, and d theta_pivot / d theta_others on it."""
        rows = np.arange(len(theta))
        by_theta = named_slopes(self.problem, theta)[rows, constraint.place]
        space = self.problem.space
        weight = np.concatenate([space.upper - space.lower, np.ones(len(space.linear))])
        pivot = np.argmax(np.abs(by_theta) * weight, axis=1)
        slope = by_theta[rows, pivot]
        shares = -by_theta / np.where(slope == 0.0, 1.0, slope)[:, np.newaxis]
        shares[rows, pivot] = 0.0
        return pivot, shares

    def restored(self, theta: FloatArray, constraint: Constraint, pivot: Sets) -> FloatArray:
        """The pivot brought onto the constraint by the secant method, inside the box."""
        theta, rows = theta.copy(), np.arange(len(theta))
        lower, upper = (side[pivot] for side in self.box())
        short = self.short(theta, constraint)
        slope = named_slopes(self.problem, theta)[rows, constraint.place, pivot]
        for _ in range(_RESTORING):
            if (np.abs(short) <= _ON_CONSTRAINT * np.abs(constraint.value)).all():
                break
            before, short_before = theta[rows, pivot], short
            theta[rows, pivot] = np.clip(before + short / np.where(slope == 0.0, np.inf, slope), lower, upper)
            short, step = self.short(theta, constraint), theta[rows, pivot] - before
            slope = np.where(step == 0.0, slope, (short_before - short) / np.where(step == 0.0, 1.0, step))
        return theta

    def keeps(self, theta: FloatArray, constraint: Constraint) -> Flags:
        allowed = 1e3 * _ON_CONSTRAINT * np.abs(constraint.value)
        return np.asarray(np.abs(self.short(theta, constraint)) <= allowed)

    def short(self, theta: FloatArray, constraint: Constraint) -> FloatArray:
        """Value of the constraint minus that of the parameter, (n_sets,)."""
        named = self.problem.named(theta)
        return np.asarray(constraint.value - named[np.arange(len(theta)), constraint.place])


@dataclass(frozen=True)
class _Sets:
    descent: Descent
    targets: FloatArray
    weights: FloatArray
    constraint: Constraint | None

    def evaluate(self, x: FloatArray, sets: Sets) -> tuple[FloatArray, Evaluated]:
        """Minus the log-likelihood; outputs, columns, sigma. If `projected`, the linear part of `x` is solved for."""
        problem, n_x = self.descent.problem, self.descent.problem.n_x
        columns, fixed_part = problem.split(x[:, :n_x])
        if self.descent.projected:
            x[:, n_x:] = problem.regression(columns, problem.y - fixed_part)[0]
        with np.errstate(over="ignore", invalid="ignore"):
            outputs = fixed_part + (columns @ x[:, n_x:, np.newaxis])[..., 0]
        residual, weights = self.targets[sets] - outputs, self.weights[sets]
        diverged: Flags = np.logical_not((np.abs(residual) < _LARGEST).all(axis=1))
        residual = np.where(diverged[:, np.newaxis], 0.0, residual)
        sigma = self.descent.noise.scale(residual, weights)
        loss = np.sum(weights * self.descent.noise.terms(residual, sigma).loss, axis=1)
        if (constraint := self._constraint(sets)) is not None:
            diverged |= np.logical_not(self.descent.keeps(x, constraint))
        loss[diverged] = np.inf
        return loss, (outputs, columns, sigma)

    def linearised(self, x: FloatArray, sets: Sets, evaluated: Evaluated) -> System:
        outputs, columns, sigma = evaluated
        jacobian = self.descent.slopes(x, outputs, columns)
        _, slope, curvature = self.descent.noise.terms(self.targets[sets] - outputs, sigma)
        root = self._root(sets, curvature, sigma)
        jacobian *= root[..., np.newaxis]
        return jacobian, -self.weights[sets] * slope / np.where(root > 0.0, root, 1.0)

    def _root(self, sets: Sets, curvature: FloatArray, sigma: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(self.weights[sets] * np.maximum(curvature, 1e-12 / sigma**2)))

    def stepped(self, x: FloatArray, sets: Sets, system: System, damping: FloatArray) -> FloatArray:
        (lower, upper), n_x, (jacobian, goal) = self.descent.box(), self.descent.problem.n_x, system
        constraint = self._constraint(sets)
        if constraint is None:
            steps = bounded_steps(jacobian, goal, damping, lower - x, upper - x, n_damped=n_x)
            return np.clip(x + steps, lower, upper)
        pivot, shares = self.descent.pivots(x, constraint)
        rows, is_pivot = np.arange(len(x)), np.zeros(x.shape, dtype=bool)
        is_pivot[rows, pivot] = True
        jacobian = jacobian + jacobian[rows, :, pivot][..., np.newaxis] * shares[:, np.newaxis]
        jacobian[rows, :, pivot] = 0.0
        steps = bounded_steps(jacobian, goal, damping, lower - x, upper - x, is_free=is_pivot, n_damped=n_x)
        steps[rows, pivot] = np.sum(shares * steps, axis=1)
        return self.descent.restored(np.clip(x + steps, lower, upper), constraint, pivot)

    def bent(
        self, x: FloatArray, sets: Sets, jacobian: FloatArray, damping: FloatArray, begin: Evaluated, straight: Trial
    ) -> FloatArray:
        """Points (n_sets, n_x) at the ends of `straight` steps from `x` that are bent along the curvature of outputs.

        The second derivative of the outputs along a step is known from its two ends.
        """
        (lower, upper), n_x = self.descent.box(), self.descent.problem.n_x
        outputs, _, sigma = begin
        ahead, columns, _ = straight.evaluated
        curvature = self.descent.noise.terms(self.targets[sets] - outputs, sigma).curvature
        with np.errstate(over="ignore", invalid="ignore"):
            ahead = ahead + (columns @ (straight.aim - straight.end)[:, n_x:, np.newaxis])[..., 0]
            beyond = self._root(sets, curvature, sigma) * (ahead - outputs)
            beyond -= (jacobian @ (straight.aim - x)[..., np.newaxis])[..., 0]
        beyond[~(np.abs(beyond) < _LARGEST).all(axis=1)] = 0.0
        at_bound = (straight.aim == lower) | (straight.aim == upper)
        room = (np.where(at_bound, 0.0, side - straight.aim) for side in (lower, upper))
        return np.asarray(straight.aim + bounded_steps(jacobian, -beyond, damping, *room, n_damped=n_x))

    def _constraint(self, sets: Sets) -> Constraint | None:
        if self.constraint is None:
            return None
        return Constraint(self.constraint.place[sets], self.constraint.value[sets])


def _some(rows: FloatArray, sets: slice) -> FloatArray:
    return rows[sets] if len(rows) > 1 else rows


def named_slopes(problem: Problem, theta: FloatArray) -> FloatArray:
    """d(the user's parameters)/d(theta), (n_sets, n_names, n_theta), by central differences."""
    space, n_x = problem.space, problem.n_x
    slopes = np.zeros((len(theta), len(space.names), theta.shape[1]))
    for place, name in enumerate(space.linear):
        slopes[:, space.names.index(name), n_x + place] = 1.0
    if n_x:
        ahead, behind, steps = problem.neighbours(theta[:, :n_x])
        values = []
        for end in (ahead, behind):
            there = np.repeat(theta, n_x, axis=0)
            there[:, :n_x] = end.reshape(-1, n_x)
            values.append(problem.named(there).reshape(len(theta), n_x, -1))
        slopes[:, :, :n_x] = ((values[0] - values[1]) / steps[..., np.newaxis]).transpose(0, 2, 1)
    return slopes
