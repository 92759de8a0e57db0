"""Levenberg and Marquardt's method, for many sets of numbers at once.

    minimise the loss f(x), near x about f = 1/2 ||J d - goal||^2,    step d:  min ||J d - goal||^2 + damping ||D d||^2

D are the norms of the columns of J. Each set has its own damping, which falls after a step that lowers the loss and
rises after one that does not. Several dampings may be tried at once.

**Least squares** for many small sets at once: the shortest solution b of min || C b - t ||, columns of C of length one.
For few columns by singular values. For many by the triangle of [C t] = Q R, which costs a fraction of that; where it
is nearly singular, by its singular values.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray

_RANK = 1e-11  # singular values of the normalised columns below this are taken as zero
_MANY = 8  # columns from which on a triangle costs clearly less
_LONG = 100_000  # rows that are taken at once, to bound the memory
_WELL = 1e9  # norm of an inverse below which no singular value is near `_RANK`


@dataclass(frozen=True)
class Settled:
    """Rows that stand for the samples of each record from `first` on.

    A sum of plays forgets what was before its record once the input has moved far enough. From there on the columns C
    and the target t of the regression are the same for every set of parameters. With [C t] = Q R, the triangle R stands
    for all of these samples: || C b - t || = || R [b, -1] || for all b, to rounding.

    `columns` are (n_rows, n_linear), `target` (n_rows,), `names` those of the linear parameters, and `scale` is the
    size of all outputs. Weights are taken into account.
    """

    first: tuple[int, ...]
    names: tuple[str, ...]
    columns: FloatArray
    target: FloatArray
    scale: float


def triangle(columns: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same regression with one row more than it has columns: the last one holds what no parameters explain."""
    if columns.shape[1] > _LONG:
        parts = (triangle(columns[:, part], target[:, part]) for part in pieces(columns.shape[1]))
        rows, goals = zip(*parts, strict=True)
        return triangle(np.concatenate(rows, axis=1), np.concatenate(goals, axis=1))
    both = np.asarray(np.linalg.qr(np.concatenate([columns, target[..., np.newaxis]], axis=2), mode="r"))
    return both[..., :-1], both[..., -1]


def pieces(n_samples: int) -> list[slice]:
    """Samples that are taken at once, to bound the memory."""
    return [slice(first, first + _LONG) for first in range(0, n_samples, _LONG)]


def least_squares(columns: FloatArray, target: FloatArray) -> FloatArray:
    """Solutions (n_sets, n_linear) for columns (n_sets, n_samples, n_linear) and targets (n_sets, n_samples)."""
    return (_by_triangle if columns.shape[2] >= _MANY else _by_singular_values)(columns, target)


def _by_singular_values(columns: FloatArray, target: FloatArray) -> FloatArray:
    basis, singular, right = np.linalg.svd(columns, full_matrices=False)
    inverse = np.where(singular > _RANK, 1.0 / np.maximum(singular, _RANK), 0.0)
    projected = inverse[..., np.newaxis] * (basis.transpose(0, 2, 1) @ target[..., np.newaxis])
    return np.asarray((right.transpose(0, 2, 1) @ projected)[..., 0])


def _by_triangle(columns: FloatArray, target: FloatArray) -> FloatArray:
    rows, goal = triangle(columns, target)
    n = columns.shape[2]
    solutions = np.empty((len(columns), n))
    is_well = np.zeros(len(columns), dtype=bool)
    if rows.shape[1] >= n:
        is_well = np.abs(np.diagonal(rows, axis1=1, axis2=2)).min(axis=1) > 1.0 / _WELL
        inverse = np.linalg.inv(rows[is_well, :n])
        solutions[is_well] = (inverse @ goal[is_well, :n, np.newaxis])[..., 0]
        is_well[is_well] = np.linalg.norm(inverse, axis=(1, 2)) < _WELL
    solutions[~is_well] = _by_singular_values(rows[~is_well], goal[~is_well])
    return solutions


Flags = npt.NDArray[np.bool_]
Sets = npt.NDArray[np.intp]

_LEAST_DAMPING = 1e-9  # in norms of columns: keeps a number where it is that has no effect
_LEAST_RIDGE = 1e-15  # likewise, in squared norms of columns
_PASSES = 4
_STRAIGHT = 20  # steps before any is bent: those that most descents need
_CENTRAL = 1e-6  # truncation and rounding of a central difference are both near 1e-10
_ONE_SIDED = 1e-7  # those of a one-sided one near 1e-7, at half the cost


@dataclass(frozen=True)
class Schedule:
    """Damping after a step: times `success` or `failure`; trials multiply it by `factors`; a set ends beyond `most`."""

    factors: tuple[float, ...] = (1.0,)
    success: float = 0.1
    failure: float = 10.0
    first: float = 1e-3
    least: float = 0.0
    most: float = 1e7


Evaluated = tuple[FloatArray, ...]
"""Values at points, arrays of n rows."""

System = tuple[FloatArray, FloatArray]
"""Jacobian and goal of a regression near points, arrays of n rows."""


class Trial(NamedTuple):
    """Points that were aimed at (n, n_x), the same as they were evaluated, and what was evaluated there."""

    aim: FloatArray
    end: FloatArray
    evaluated: Evaluated


_BENT = Schedule(success=0.3, failure=3.0)  # of steps that are bent: the damping stays near what the valley allows


class Problem(Protocol):
    """A loss to minimise; `sets` (n,) says which set each point belongs to."""

    def evaluate(self, x: FloatArray, sets: Sets) -> tuple[FloatArray, Evaluated]:
        """Losses (n,) at points `x` (n, n_x), which it may change in place, and arrays that `linearised` needs."""
        ...

    def linearised(self, x: FloatArray, sets: Sets, evaluated: Evaluated) -> System: ...

    def stepped(self, x: FloatArray, sets: Sets, system: System, damping: FloatArray) -> FloatArray: ...


class Reached(NamedTuple):
    """Ends of a descent (n_sets, n_x), their losses, the arrays evaluated there, and whether each set came to rest."""

    x: FloatArray
    loss: FloatArray
    evaluated: Evaluated
    at_rest: Flags


def descend(
    problem: Problem,
    x: FloatArray,
    *,
    steps: int,
    tolerance: float = 0.0,
    relative: float = 0.0,
    hopeless: float = np.inf,
    schedule: Schedule = Schedule(),
    bend: Callable[[FloatArray, Sets, FloatArray, FloatArray, Evaluated, Trial], FloatArray] | None = None,
) -> Reached:
    """Descend from `x` (n_sets, n_x) until a step lowers the loss by at most `tolerance` + `relative` times the loss.

    A set also ends where the remaining steps, if as good as the last, would not bring it below `hopeless`. After the
    first steps `bend` is called with points, sets, J, dampings, values at the points, and trials: it returns other ends
    of the steps, and the better count. From then on a set that no step lowers is not at rest: slopes are too coarse.
    """
    x, every, factors = x.copy(), np.arange(len(x)), np.array(schedule.factors)
    loss, evaluated = problem.evaluate(x, every)
    damping, is_stale = np.full(len(x), schedule.first), np.ones(len(x), dtype=bool)
    stuck = np.zeros(len(x), dtype=bool)
    moving = every[np.isfinite(loss)]
    jacobian = goal = np.empty(0)
    for remaining in range(steps - 1, -1, -1):
        if not moving.size:
            break
        fresh = moving[is_stale[moving]]
        if fresh.size == len(x):
            jacobian = goal = np.empty(0)  # their memory is needed now
            jacobian, goal = problem.linearised(x, every, evaluated)
        elif fresh.size:
            system = problem.linearised(x[fresh], fresh, tuple(each[fresh] for each in evaluated))
            if not jacobian.size:
                jacobian, goal = (np.zeros((len(x), *each.shape[1:])) for each in system)
            jacobian[fresh], goal[fresh] = system
        is_stale[fresh] = False
        sets = np.repeat(moving, factors.size)
        dampings = np.outer(damping[moving], factors).ravel()
        trial = problem.stepped(x[sets], sets, (_rows(jacobian, sets), _rows(goal, sets)), dampings)
        aim = trial.copy()
        losses, evaluated_there = problem.evaluate(trial, sets)
        if bend is not None and steps - remaining > _STRAIGHT:
            schedule = _BENT
            begin, straight = tuple(_rows(each, sets) for each in evaluated), Trial(aim, trial, evaluated_there)
            bent = bend(x[sets], sets, _rows(jacobian, sets), dampings, begin, straight)
            bent_losses, evaluated_bent = problem.evaluate(bent, sets)
            is_lower = bent_losses < losses
            rivals = bent, bent_losses, *evaluated_bent
            for values, others in zip((trial, losses, *evaluated_there), rivals, strict=True):
                values[is_lower] = others[is_lower]
        best = losses.reshape(-1, factors.size).argmin(axis=1) + factors.size * np.arange(moving.size)
        before, gained = loss[moving], loss[moving] - losses[best]
        is_better = losses[best] < before
        won, place = moving[is_better], best[is_better]
        x[won], loss[won], is_stale[won] = trial[place], losses[place], True
        for values, trial_values in zip(evaluated, evaluated_there, strict=True):
            values[won] = trial_values[place]
        del evaluated_there
        lowered = np.clip(dampings[best] * schedule.success, schedule.least, schedule.most)
        damping[moving] = np.where(is_better, lowered, damping[moving] * schedule.failure)
        rests = (gained <= tolerance + relative * before) | (before - (1 + remaining) * gained > hopeless)
        is_stuck = damping[moving] > schedule.most
        stuck[moving] = is_stuck & (schedule is _BENT)
        moving = moving[~(is_better & rests | is_stuck)]
    return Reached(x, loss, evaluated, ~(np.isin(every, moving) | stuck))


def _rows(values: FloatArray, sets: Sets) -> FloatArray:
    """Rows of these sets; where they are all, the array itself, to bound the memory."""
    return values if np.array_equal(sets, np.arange(len(values))) else values[sets]


def bounded_steps(
    jacobian: FloatArray,
    goal: FloatArray,
    damping: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    *,
    is_free: Flags | None = None,
    n_damped: int | None = None,
) -> FloatArray:
    """Damped steps (n_sets, n_x) between `lower` and `upper`, except for numbers that are free of bounds.

    A step beyond a bound ends there, and the others make the best of it. The first `n_damped` numbers are damped. All
    of this is done on a triangle with the same sums of squares, so that samples count once.
    """
    at_bound, steps = np.zeros(lower.shape, dtype=bool), np.zeros(lower.shape)
    rows, goals = triangle(jacobian, goal)
    for _ in range(_PASSES):
        short = goals - (rows @ np.where(at_bound, steps, 0.0)[..., np.newaxis])[..., 0]
        others = _regressed(np.where(at_bound[:, np.newaxis], 0.0, rows), short, damping, n_damped)
        steps = np.where(at_bound, steps, others)
        beyond = ((steps < lower) | (steps > upper)) & ~at_bound
        if is_free is not None:
            beyond &= ~is_free
        if not beyond.any():
            break
        steps = np.clip(steps, lower, upper)
        at_bound |= beyond
    return steps


def _regressed(jacobian: FloatArray, goal: FloatArray, damping: FloatArray, n_damped: int | None) -> FloatArray:
    norms = np.linalg.norm(jacobian, axis=1)
    norms[norms == 0.0] = 1.0
    strength = np.full(norms.shape, _LEAST_DAMPING)
    strength[:, :n_damped] += np.sqrt(damping)[:, np.newaxis]
    below = strength[..., np.newaxis] * np.eye(norms.shape[1])
    Q, R = np.linalg.qr(np.concatenate([jacobian / norms[:, np.newaxis], below], axis=1))
    projected = Q[:, : goal.shape[1]].transpose(0, 2, 1) @ goal[..., np.newaxis]
    return np.asarray(np.linalg.solve(R, projected)[..., 0] / norms)


@dataclass(frozen=True)
class SumOfSquares:
    """Sum of squared residuals between bounds, for one set.

    `residuals` maps points (n, n_x) to residuals (n, n_samples), `slopes` a point and its residual to derivatives
    (n_samples, n_x), and `sizes`, if given, a point to the scales D (n_x,).
    """

    residuals: Callable[[FloatArray], FloatArray]
    slopes: Callable[[FloatArray, FloatArray], FloatArray]
    lower: FloatArray | float = -np.inf
    upper: FloatArray | float = np.inf
    sizes: Callable[[FloatArray], FloatArray] | None = None

    def evaluate(self, x: FloatArray, sets: Sets) -> tuple[FloatArray, Evaluated]:
        residual = self.residuals(x)
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.sum(residual**2, axis=1)
        return np.where(np.isfinite(squares), squares, np.inf), (residual,)

    def linearised(self, x: FloatArray, sets: Sets, evaluated: Evaluated) -> System:
        residual = evaluated[0][0]
        jacobian = self.slopes(x[0], residual)
        return (jacobian.T @ jacobian)[np.newaxis], -(jacobian.T @ residual)[np.newaxis]

    def stepped(self, x: FloatArray, sets: Sets, system: System, damping: FloatArray) -> FloatArray:
        """The next points; numbers at a bound against which the gradient pushes stay."""
        jacobian, goal = system
        sizes = np.sqrt(np.diagonal(jacobian, axis1=1, axis2=2))
        stays = ((x <= self.lower) & (goal < 0.0)) | ((x >= self.upper) & (goal > 0.0)) | (sizes == 0.0)
        if self.sizes is not None:
            sizes = np.array([self.sizes(each) for each in x])
        sizes = np.where(stays, 1.0, sizes)
        scaled = jacobian / (sizes[:, :, np.newaxis] * sizes[:, np.newaxis, :])
        scaled[stays[:, :, np.newaxis] | stays[:, np.newaxis, :]] = 0.0
        scaled += (damping[:, np.newaxis, np.newaxis] + _LEAST_RIDGE) * np.eye(x.shape[1])
        goal = np.where(stays, 0.0, goal / sizes)
        steps = np.linalg.solve(scaled, goal[..., np.newaxis])[..., 0] / sizes
        return np.clip(x + steps, self.lower, self.upper)


def differences(
    residuals: Callable[[FloatArray], FloatArray], x: FloatArray, residual: FloatArray, *, central: bool
) -> FloatArray:
    """Derivatives (n_samples, n_x) of the residual at `x` (n_x,), central or one-sided."""
    width = _CENTRAL if central else _ONE_SIDED
    steps = width * np.eye(x.size)
    if not central:
        return np.asarray(((residuals(x + steps) - residual) / width).T)
    ahead, behind = np.split(residuals(np.concatenate([x + steps, x - steps])), 2)
    return np.asarray(((ahead - behind) / (2.0 * width)).T)
