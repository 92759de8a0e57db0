"""Confidence intervals by the likelihood's profile.

    D(v) = 2 (min over theta with p(theta) = v of loss - min of loss)

The interval of a parameter p holds the values with D(v) <= N ln(1 + t^2 / (N - d)), t the quantile of Student's
distribution with N - d degrees of freedom, which is exact for a linear model and normal noise. Its ends are found by
the secant method on sqrt(D), all ends of all parameters at once; an interval that reaches a search bound ends
there. Other optima inside the interval count too.
"""

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, frozen
from hysim.identification._descent import Constraint, Descent

_ENOUGH = 0.01  # of sqrt(D) at the end of an interval
_ROUNDS = 30
_FARTHEST = 4.0  # growth of a step that does not reach the end yet
_CLOSE = 1e-3  # two values this close, in standard errors, are one
_FLAT = 1e-4  # of the loss: a descent that gains less rests
_BETTER = 0.02  # of the deviance: below minus this, an optimum is another


@frozen
class Profile:
    """Likelihood's profile of one parameter.

    `lower` and `upper` are the interval at 95 %, infinite where the profile stays inside the `limit` of the deviance;
    `at_box` says whether the box ends it. `deviance` (n_points,) is twice the fall of the log-likelihood at `values`.
    """

    lower: float
    upper: float
    at_box: tuple[bool, bool]
    values: FloatArray
    deviance: FloatArray
    limit: float


def threshold(n_samples: int, n_parameters: int, level: float) -> float:
    from scipy.stats import t

    freedom = n_samples - n_parameters
    quantile = t.ppf(0.5 * (1.0 + level), freedom)
    return float(n_samples * np.log1p(quantile**2 / freedom))


class _Ends:
    """Outermost values inside and innermost ones outside (nan if unknown) of each interval, with sqrt(D) there."""

    def __init__(self, values: FloatArray, root: FloatArray, theta: FloatArray, slope: FloatArray) -> None:
        self.inside, self.r_inside = values.copy(), root.copy()
        self.origin, self.r_origin = values.copy(), root.copy()
        self.outside, self.r_outside = np.full(values.size, np.nan), np.full(values.size, np.inf)
        self.theta, self.slope = theta.copy(), slope.copy()
        self.end = np.full(values.size, np.nan)
        self.doubtful = np.zeros(values.size, dtype=bool)  # whether the outer value was reached from farther away

    def move_in(self, which: npt.NDArray[np.intp], values: FloatArray, root: FloatArray, theta: FloatArray) -> None:
        step, distance = values - self.inside[which], values - self.origin[which]
        far = np.abs(step) > 0.1 * np.abs(distance)  # of neighbours the difference is that of how far each descended
        self.slope[which[far]] = (theta[far] - self.theta[which[far]]) / step[far, np.newaxis]
        self.inside[which], self.r_inside[which], self.theta[which] = values, root, theta
        self.doubtful[which] = np.isfinite(self.outside[which]) & (self.outside[which] != values)
        self.outside[which] = np.where(self.doubtful[which], self.outside[which], np.nan)

    def move_out(self, which: npt.NDArray[np.intp], values: FloatArray, root: FloatArray) -> None:
        self.outside[which], self.r_outside[which], self.doubtful[which] = values, root, False


def profiles(
    descent: Descent,
    optima: FloatArray,
    losses: FloatArray,
    covariance: FloatArray,
    spread: FloatArray,
    limit: float,
) -> tuple[dict[str, Profile], FloatArray | None]:
    """Profiles of all parameters with a standard error, and a better optimum (n_theta,) if one was met.

    `optima` (n_optima, n_theta) lie within the `limit` of the deviance, best first. `covariance` (n_names, n_names) is
    that of the parameters, `spread` (n_theta, n_names) that of theta with them.
    """
    problem = descent.problem
    variance = np.diag(covariance)
    known = np.flatnonzero(np.isfinite(variance) & (variance > 0.0))
    if not known.size:
        return {}, None
    grid = np.meshgrid(known, [-1.0, 1.0], np.arange(len(optima)), indexing="ij")
    place, start = grid[0].ravel(), grid[2].ravel()
    side: FloatArray = grid[1].ravel().astype(float)
    values = problem.named(optima)[start, place]
    stderr, root = np.sqrt(variance[place]), float(np.sqrt(limit))
    deviance = 2.0 * np.maximum(losses[start] - losses[0], 0.0)
    slope = (spread[:, place] / variance[place]).T
    ends = _Ends(values, np.sqrt(deviance), optima[start], slope)
    points = [(place, values, deviance)]
    step = stderr * np.maximum(root - ends.r_inside, 0.2 * root)
    trial = values + side * step
    active = np.arange(place.size)
    better: tuple[float, FloatArray] | None = None
    for _ in range(_ROUNDS):
        if not active.size:
            break
        at = trial[active]
        guess = ends.theta[active] + (at - ends.inside[active])[:, np.newaxis] * ends.slope[active]
        reached = descent.run(guess, constraint=Constraint(place[active], at), tolerance=_FLAT)
        deviance = 2.0 * (reached.loss - losses[0])
        lowest = int(np.argmin(deviance))
        if deviance[lowest] < -_BETTER and (better is None or deviance[lowest] < better[0]):
            better = float(deviance[lowest]), reached.theta[lowest]
        finite = np.isfinite(deviance)
        points.append((place[active][finite], at[finite], deviance[finite]))
        r = np.sqrt(np.maximum(deviance, 0.0))
        inner = r <= root
        won, lost = active[inner], active[~inner]
        ends.move_in(won, at[inner], r[inner], reached.theta[inner])
        ends.move_out(lost, at[~inner], r[~inner])
        close = np.abs(r - root) <= _ENOUGH * root
        ends.end[active[close]] = at[close]
        gap = np.abs(ends.outside[active] - ends.inside[active])
        step[won] = _farther(ends, won, step[won], root)
        trial[active] = _next(ends, active, side, step, root)
        active = active[~close & (ends.doubtful[active] | ~(gap <= _CLOSE * stderr[active]))]
    at_box = np.isnan(ends.end) & np.isfinite(ends.outside) & ~np.isfinite(ends.r_outside)
    open_ended = np.where(np.isnan(ends.outside), side * np.inf, ends.inside)
    end = np.where(np.isnan(ends.end), open_ended, ends.end)
    curves = _gathered(problem.space.names, place, side, end, at_box, points, limit)
    return curves, None if better is None else better[1]


def _next(ends: _Ends, active: npt.NDArray[np.intp], side: FloatArray, step: FloatArray, root: float) -> FloatArray:
    inside, outside = ends.inside[active], ends.outside[active]
    r_in, r_out = ends.r_inside[active], ends.r_outside[active]
    share = np.where(np.isfinite(r_out), (root - r_in) / np.where(np.isfinite(r_out), r_out - r_in, 1.0), 0.5)
    between = inside + np.clip(share, 0.1, 0.9) * (outside - inside)
    ahead = inside + side[active] * step[active]
    again = ends.doubtful[active] & ((outside - ahead) * side[active] <= 0.0)
    return np.where(np.isnan(outside), ahead, np.where(again, outside, between))


def _farther(ends: _Ends, won: npt.NDArray[np.intp], step: FloatArray, root: float) -> FloatArray:
    gone, risen = np.abs(ends.inside - ends.origin)[won], (ends.r_inside - ends.r_origin)[won]
    straight = 1.1 * (root - ends.r_inside[won]) * gone / np.where(risen > 0.0, risen, np.inf)
    return np.where(risen > 0.0, np.clip(straight, 0.1 * step, _FARTHEST * step), _FARTHEST * step)


def _gathered(
    names: tuple[str, ...],
    place: npt.NDArray[np.intp],
    side: FloatArray,
    end: FloatArray,
    at_box: npt.NDArray[np.bool_],
    points: list[tuple[npt.NDArray[np.intp], FloatArray, FloatArray]],
    limit: float,
) -> dict[str, Profile]:
    places, visited, deviance = (np.concatenate(parts) for parts in zip(*points, strict=True))
    result = {}
    for k in np.unique(place).tolist():
        low, high = (np.flatnonzero((place == k) & (side == sign)) for sign in (-1.0, 1.0))
        lowest, highest = low[np.argmin(end[low])], high[np.argmax(end[high])]
        mine = places == k
        order = _outline(visited[mine], deviance[mine])
        result[names[k]] = Profile(
            lower=float(end[lowest]),
            upper=float(end[highest]),
            at_box=(bool(at_box[lowest]), bool(at_box[highest])),
            values=visited[mine][order],
            deviance=deviance[mine][order],
            limit=limit,
        )
    return result


def _outline(values: FloatArray, deviance: FloatArray) -> npt.NDArray[np.intp]:
    """Points of the profile in order of their values, without those that a point farther out lies below."""
    centre = values[np.argmin(deviance)]
    outline: list[int] = []
    for sign in (-1.0, 1.0):
        lowest = np.inf
        for k in np.lexsort((deviance, -sign * values)).tolist():
            if sign * (values[k] - centre) >= 0.0 and deviance[k] < lowest:
                lowest = deviance[k]
                outline.append(k)
    chosen = np.unique(outline)
    return chosen[np.argsort(values[chosen], kind="stable")]
