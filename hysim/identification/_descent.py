"""Many sets of parameters descend together: all of a problem's parameters, any noise, a constraint if wanted.

A set is theta = (x, b), coordinates and linear parameters. With J = dm/dtheta, the slopes g and curvatures W >= 0 of
the loss in the model's output m, and the best sigma for the residuals at hand, a step d solves the weighted regression

    minimise  1/2 || W^(1/2) J d + W^(-1/2) g ||^2 + damping || D d ||^2,

D the norms of the columns of x (Levenberg, Marquardt; the loss is linear in no other way in b, whose part of the
step is not damped). A constraint "this parameter has that value" is kept by eliminating one coordinate, the pivot,
from the step, and by bringing the pivot back onto the constraint after it.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.identification._noise import Noise
from hysim.identification._problem import Problem

Flags = npt.NDArray[np.bool_]

N_STEPS = 60
_STUCK = 1e7  # damping beyond which no step can help
_FLOOR = 1e-9  # damping of everything, in norms of columns: a column without effect keeps its place
_RESTORING = 12
_PASSES = 4
_ON_CONSTRAINT = 1e-11  # relative error of the constrained value


@dataclass(frozen=True)
class Constraint:
    """In each set the parameter `place` of `space.names` has the value `value`; both (n_sets,)."""

    place: npt.NDArray[np.intp]
    value: FloatArray

    def of(self, sets: Flags | npt.NDArray[np.intp]) -> "Constraint":
        """The constraint of some of the sets."""
        return Constraint(self.place[sets], self.value[sets])


@dataclass(frozen=True)
class Reached:
    """Where the sets have come to: theta (n_sets, n_theta); minus the log-likelihood, sigma, and whether it rests."""

    theta: FloatArray
    loss: FloatArray
    sigma: FloatArray
    at_rest: Flags


@dataclass(frozen=True)
class Descent:
    """What does not change on the way: targets and weights are (n_sets, n_samples), or (1, n_samples) for all.

    `projected` solves for b anew after each step, which leads farther from a poor start; it is for sums of squares.
    """

    problem: Problem
    noise: Noise
    targets: FloatArray
    weights: FloatArray
    projected: bool = False

    def run(
        self, theta: FloatArray, *, constraint: Constraint | None = None, tolerance: float = 1e-5, steps: int = N_STEPS
    ) -> Reached:
        """Descend from `theta` (n_sets, n_theta) until a step lowers the loss by less than `tolerance`."""
        theta = np.clip(theta, *self.box())
        n_sets = len(theta)
        targets, weights = (np.broadcast_to(each, (n_sets, each.shape[1])) for each in (self.targets, self.weights))
        if constraint is not None:
            theta = self._restored(theta, constraint, self._pivots(theta, constraint)[0])
        outputs, columns = self._evaluated(theta)
        loss, sigma = self._loss(targets - outputs, weights)
        if constraint is not None:
            loss[~self._kept(theta, constraint)] = np.inf
        damping = np.full(n_sets, 1e-3)
        moving = np.flatnonzero(np.isfinite(loss))
        slopes, stale = np.zeros((n_sets, targets.shape[1], theta.shape[1])), np.ones(n_sets, dtype=bool)
        for _ in range(steps):
            if not moving.size:
                break
            fresh = moving[stale[moving]]
            if fresh.size:
                slopes[fresh], stale[fresh] = self._slopes(theta[fresh], outputs[fresh], columns[fresh]), False
            bound = None if constraint is None else constraint.of(moving)
            residual = targets[moving] - outputs[moving]
            trial = self._step(theta[moving], slopes[moving], residual, weights[moving], sigma[moving],
                               damping[moving], bound)  # fmt: skip
            trial_outputs, trial_columns = self._evaluated(trial)
            trial_loss, trial_sigma = self._loss(targets[moving] - trial_outputs, weights[moving])
            if bound is not None:
                trial_loss[~self._kept(trial, bound)] = np.inf
            better = trial_loss < loss[moving]
            gained = np.where(better, loss[moving] - trial_loss, 0.0)
            won = moving[better]
            theta[won], outputs[won], columns[won] = trial[better], trial_outputs[better], trial_columns[better]
            loss[won], sigma[won], stale[won] = trial_loss[better], trial_sigma[better], True
            damping[moving] *= np.where(better, 0.1, 10.0)
            stays = better & (gained < tolerance) | (damping[moving] > _STUCK)
            moving = moving[~stays]
        return Reached(theta, loss, sigma[:, 0], ~np.isin(np.arange(n_sets), moving))

    def outputs(self, theta: FloatArray) -> FloatArray:
        """The model's outputs at `theta`, (n_sets, n_samples)."""
        n_x = len(self.problem.space.coordinates)
        return self.problem.model(theta[:, :n_x], theta[:, n_x:])

    def _evaluated(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Outputs and columns at `theta`, whose linear part is changed in place to the best where it is projected."""
        n_x = len(self.problem.space.coordinates)
        columns, fixed_part = self.problem.split(theta[:, :n_x])
        if self.projected:
            theta[:, n_x:] = self.problem.regression(columns, self.problem.y - fixed_part)[0]
        with np.errstate(over="ignore", invalid="ignore"):
            return fixed_part + (columns @ theta[:, n_x:, np.newaxis])[..., 0], columns

    def _loss(self, residual: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Minus the log-likelihood (n_sets,), and the best sigma (n_sets, 1); a set that is not finite is inf."""
        lost: Flags = np.logical_not((np.abs(residual) < 1e150).all(axis=1))
        residual = np.where(lost[:, np.newaxis], 0.0, residual)
        sigma = self.noise.scale(residual, weights)
        loss = np.sum(weights * self.noise.terms(residual, sigma).loss, axis=1)
        loss[lost] = np.inf
        return loss, sigma

    def _slopes(self, theta: FloatArray, outputs: FloatArray, columns: FloatArray) -> FloatArray:
        """dm/dtheta, (n_sets, n_samples, n_theta), by one-sided differences in x: exact enough to descend by."""
        n_sets, n_x = len(theta), len(self.problem.space.coordinates)
        if not n_x:
            return columns
        ends, steps = self.problem.beside(theta[:, :n_x])
        moved = self.problem.model(ends.reshape(-1, n_x), np.repeat(theta[:, n_x:], n_x, axis=0))
        with np.errstate(over="ignore", invalid="ignore"):
            by_x = (moved.reshape(n_sets, n_x, -1) - outputs[:, np.newaxis]) / steps[..., np.newaxis]
        by_x[~np.isfinite(by_x)] = 0.0
        return np.concatenate([by_x.transpose(0, 2, 1), columns], axis=2)

    def _step(
        self,
        theta: FloatArray,
        slopes: FloatArray,
        residual: FloatArray,
        weights: FloatArray,
        sigma: FloatArray,
        damping: FloatArray,
        constraint: Constraint | None,
    ) -> FloatArray:
        """The next trial."""
        _, slope, curvature = self.noise.terms(residual, sigma)
        root = np.sqrt(weights * np.maximum(curvature, 1e-12 / sigma**2))
        J = root[..., np.newaxis] * slopes
        goal = -weights * slope / np.where(root > 0.0, root, 1.0)
        lower, upper = self.box()
        pivot, shares = (None, None) if constraint is None else self._pivots(theta, constraint)
        rows = np.arange(len(theta))
        if pivot is not None and shares is not None:
            J = J + J[rows, :, pivot][..., np.newaxis] * shares[:, np.newaxis]
            J[rows, :, pivot] = 0.0
        held = np.zeros(theta.shape, dtype=bool)
        step = np.zeros(theta.shape)
        for _ in range(_PASSES):  # what would leave the box goes to its side, and the others make the best of it
            left = goal - (J @ np.where(held, step, 0.0)[..., np.newaxis])[..., 0]
            moved = _regression(
                np.where(held[:, np.newaxis], 0.0, J), left, damping, len(self.problem.space.coordinates)
            )
            step = np.where(held, step, moved)
            beyond = ((theta + step < lower) | (theta + step > upper)) & ~held
            if pivot is not None:
                beyond[rows, pivot] = False
            if not beyond.any():
                break
            step = np.clip(step, lower - theta, upper - theta)
            held |= beyond
        if pivot is None or shares is None or constraint is None:
            return np.clip(theta + step, lower, upper)
        step[rows, pivot] = np.sum(shares * step, axis=1)
        return self._restored(np.clip(theta + step, lower, upper), constraint, pivot)

    def box(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of theta."""
        space, linear = self.problem.space, self.problem.linear_box()
        return np.concatenate([space.lower, linear[0]]), np.concatenate([space.upper, linear[1]])

    def _named(self, theta: FloatArray, place: npt.NDArray[np.intp]) -> FloatArray:
        n_x = len(self.problem.space.coordinates)
        return self.problem.named(theta[:, :n_x], theta[:, n_x:])[np.arange(len(theta)), place]

    def _pivots(self, theta: FloatArray, constraint: Constraint) -> tuple[npt.NDArray[np.intp], FloatArray]:
        """The element of theta that each constraint is solved for, and d theta_pivot / d theta_others on it."""
        by_theta = named_slopes(self.problem, theta)[np.arange(len(theta)), constraint.place]
        space = self.problem.space
        weight = np.concatenate([space.upper - space.lower, np.ones(len(space.linear))])
        pivot = np.argmax(np.abs(by_theta) * weight, axis=1)
        slope = by_theta[np.arange(len(theta)), pivot]
        shares = -by_theta / np.where(slope == 0.0, 1.0, slope)[:, np.newaxis]
        shares[np.arange(len(theta)), pivot] = 0.0
        return pivot, shares

    def _restored(self, theta: FloatArray, constraint: Constraint, pivot: npt.NDArray[np.intp]) -> FloatArray:
        """Move the pivot onto the constraint by the secant method, inside the box."""
        theta, rows = theta.copy(), np.arange(len(theta))
        lower, upper = (side[pivot] for side in self.box())
        short = constraint.value - self._named(theta, constraint.place)
        slope = named_slopes(self.problem, theta)[rows, constraint.place, pivot]
        for _ in range(_RESTORING):
            if (np.abs(short) <= _ON_CONSTRAINT * np.abs(constraint.value)).all():
                break
            before = theta[rows, pivot]
            moved = before + short / np.where(slope == 0.0, np.inf, slope)
            theta[rows, pivot] = np.clip(moved, lower, upper)
            left = constraint.value - self._named(theta, constraint.place)
            went = theta[rows, pivot] - before
            slope = np.where(went == 0.0, slope, (short - left) / np.where(went == 0.0, 1.0, went))
            short = left
        return theta

    def _kept(self, theta: FloatArray, constraint: Constraint) -> Flags:
        short = np.abs(constraint.value - self._named(theta, constraint.place))
        return np.asarray(short <= 1e3 * _ON_CONSTRAINT * np.abs(constraint.value))


def named_slopes(problem: Problem, theta: FloatArray) -> FloatArray:
    """d(the user's parameters)/d(theta), (n_sets, n_names, n_theta), by central differences."""
    space, n_x = problem.space, len(problem.space.coordinates)
    x, linear = theta[:, :n_x], theta[:, n_x:]
    slopes = np.zeros((len(theta), len(space.names), theta.shape[1]))
    for place, name in enumerate(space.linear):
        slopes[:, space.names.index(name), n_x + place] = 1.0
    if n_x:
        ahead, behind, steps = problem.neighbours(x)
        repeated = np.repeat(linear, n_x, axis=0)
        ends = [problem.named(end.reshape(-1, n_x), repeated).reshape(len(x), n_x, -1) for end in (ahead, behind)]
        slopes[:, :, :n_x] = ((ends[0] - ends[1]) / steps[..., np.newaxis]).transpose(0, 2, 1)
    return slopes


def _regression(J: FloatArray, goal: FloatArray, damping: FloatArray, n_x: int) -> FloatArray:
    """Least squares steps (n_sets, n_theta), damped in the first `n_x` elements."""
    norms = np.linalg.norm(J, axis=1)
    norms[norms == 0.0] = 1.0
    strength = np.full(J.shape[::2], _FLOOR)
    strength[:, :n_x] += np.sqrt(damping)[:, np.newaxis]
    below = strength[..., np.newaxis] * np.eye(J.shape[2])
    Q, R = np.linalg.qr(np.concatenate([J / norms[:, np.newaxis], below], axis=1))
    projected = Q[:, : goal.shape[1]].transpose(0, 2, 1) @ goal[..., np.newaxis]
    return np.asarray(np.linalg.solve(R, projected)[..., 0] / norms)
