"""One searched problem with its noise: the optima, their intervals, and the result that describes them.

**Confidence intervals by the likelihood's profile.**

    D(v) = 2 (min over theta with p(theta) = v of loss - min of loss)

The interval of a parameter p holds the values with D(v) <= N ln(1 + t^2 / (N - d)), t the quantile of Student's
distribution with N - d degrees of freedom, which is exact for a linear model and normal noise. Its ends are found by
the secant method on sqrt(D), all ends of all parameters at once; an interval that reaches a search bound ends
there. Other optima inside the interval count too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim._columns.turning import TOLERANCE
from hysim.identification._assumptions import Treated
from hysim.identification._descent import Constraint, Descent
from hysim.identification._noise import Gaussian, Noise, Quantised, Robust
from hysim.identification._problem import Numbers, Problem
from hysim.identification._result import Candidate, Identification, Profile, Width
from hysim.identification._search import PERFECT, Optimum, polish
from hysim.identification._uncertainty import (
    Uncertainty,
    bootstrap,
    by_energy,
    fit_measures,
    loop_widths,
    uncertainty,
    width_stderr,
)
from hysim.identification.doubts import is_exact, odd_residuals, sentences
from hysim.identification.marquardt import Sets
from hysim.records import Record

LEVEL = 0.95
TAILS = (0.025, 0.975)
N_BOOTSTRAP = 500
N_DISTURBED = 20  # records with other noise of the input: a spread to a sixth
_INSIDE, _STEP = 1e-9, 1e-6  # of the box: the solver begins inside, and takes such differences
_SAME = 1e-6  # relative difference of two costs that are the same
_FAINT = 0.3  # quanta: noise below does not spread the rounding
_EXACT = 100.0  # smallest sigmas: below, nothing is left to explain


class LocalOptimum(NamedTuple):
    """Local optimum: theta (n_theta,), minus the log-likelihood, sigma, and whether the search converged."""

    theta: FloatArray
    loss: float
    sigma: float
    converged: bool


@dataclass(frozen=True)
class Search:
    problem: Problem
    noise: Noise
    seed: int
    treatment: Treated
    by_energy: bool = False

    @property
    def descent(self) -> Descent:
        return Descent(self.problem, self.noise, self.problem.y[np.newaxis], np.ones((1, self.problem.y.size)))

    def likely(self, squares: Sequence[Optimum]) -> list[LocalOptimum]:
        if isinstance(self.noise, Robust):  # an outlier may move the least squares to another valley
            squares = [*squares, *(Optimum(x, np.inf, converged=False) for x in self.problem.space.starts)]
        theta = self.problem.completed(np.array([optimum.x for optimum in squares]))
        steps = 0 if isinstance(self.noise, Gaussian) else 200
        reached = self.descent.run(theta, tolerance=1e-9, steps=steps)
        ranked = np.argsort(reached.loss, kind="stable")
        distinct: list[LocalOptimum] = []
        for k in ranked[np.isfinite(reached.loss[ranked])].tolist():
            loss, sigma = float(reached.loss[k]), float(reached.sigma[k])
            perfect = bool(distinct) and distinct[0].sigma <= _EXACT * PERFECT * self.problem.scale
            if not distinct or (not perfect and loss - distinct[-1].loss > 0.5 * self.problem.y.size * _SAME):
                distinct.append(
                    LocalOptimum(reached.theta[k], loss, sigma, squares[k].converged or bool(reached.at_rest[k]))
                )
        return distinct

    def on_energy(self, best: LocalOptimum) -> tuple["Search", list[LocalOptimum]]:
        """The search and the optimum near the `best` one whose work along the records has the least squared error.

        The linear parameters are solved for at each point, as those of the output are.
        """
        from scipy.optimize import least_squares, lsq_linear

        problem, n_x = self.problem, self.problem.n_x
        box, width = problem.linear_box(), problem.space.upper - problem.space.lower
        unit = problem.scale * max(float(np.ptp(record.u)) for record, _ in problem.pieces)

        def solved(x: FloatArray) -> tuple[FloatArray, FloatArray]:
            columns, fixed_part = problem.split(x[np.newaxis])
            works = problem.work(np.column_stack([columns[0], problem.y - fixed_part[0]])) / unit
            if not np.isfinite(works).all():  # no better than no output
                return np.zeros(works.shape[1] - 1), problem.work(problem.y[:, np.newaxis])[:, 0] / unit
            size = np.linalg.norm(works[:, -1]) or 1.0
            linear = lsq_linear(works[:, :-1], works[:, -1] / size, bounds=np.array(box) / size, method="bvls")
            return linear.x * size, linear.fun * size

        x = best.theta[:n_x]
        if n_x:
            inside = np.clip(x, problem.space.lower + _INSIDE * width, problem.space.upper - _INSIDE * width)
            limits = problem.space.lower, problem.space.upper
            x = least_squares(lambda x: solved(x)[1], inside, bounds=limits, x_scale=width, diff_step=_STEP).x
        theta = np.append(x, solved(x)[0])
        reached = self.descent.run(theta[np.newaxis], tolerance=1e-9, steps=0)
        optimum = LocalOptimum(theta, float(reached.loss[0]), float(reached.sigma[0]), best.converged)
        return replace(self, by_energy=True), [optimum]

    def candidate(self, theta: FloatArray) -> Candidate:
        problem = self.problem
        parameters, residual, kept = problem.estimates(theta), self.residual(theta), problem.weights > 0.0
        own = () if len(problem.parts) == 1 else [name for name in problem.own.state if name not in problem.own.held]
        shared = {name: value for name, value in parameters.items() if name not in own}
        named = problem.named(theta[np.newaxis])[0].tolist()
        return Candidate(
            model=problem.family.assemble(parameters),
            estimates=shared | dict(zip(problem.space.names, named, strict=True)),
            fit_percent=metrics.fit_percent(problem.y[kept], (problem.y - residual)[kept]),
            rmse=metrics.rmse(residual[kept], 0.0 * residual[kept]),
        )

    def residual(self, theta: FloatArray) -> FloatArray:
        return np.asarray(self.problem.y - self.problem.model(theta[np.newaxis])[0])

    def described(
        self, likely: list[LocalOptimum], intervals: str, least_squares: FloatArray
    ) -> tuple[Identification, list[LocalOptimum]]:
        """Result at the best optimum, or at a better one that its profiles meet; `least_squares` are coordinates."""
        known = self._uncertainty(likely[0])
        curves: dict[str, Profile] = {}
        if intervals == "profile":
            curves, better = self._profiles(likely, known)
            if better is not None:
                likely = self.likely(polish(self.problem, better[np.newaxis, : self.problem.n_x])) + likely
                likely = sorted(likely, key=lambda optimum: optimum.loss)
                known = self._uncertainty(likely[0])
                curves, _ = self._profiles(likely, known)
        result = self._described(likely, known, intervals, curves)
        if isinstance(self.noise, Gaussian) and not self.by_energy:
            return result, likely
        plain = self.candidate(self.problem.completed(least_squares[np.newaxis])[0])
        return replace(result, least_squares=plain), likely

    def _uncertainty(self, best: LocalOptimum) -> Uncertainty:
        residual, sigma = self.residual(best.theta)[np.newaxis], np.full((1, 1), best.sigma)
        curvature = self.noise.terms(residual, sigma).curvature[0]
        if isinstance(self.noise, Robust):  # the information of each sample, which is less
            curvature = np.broadcast_to(self.noise.spread(sigma)[0] ** -2.0, curvature.shape)
        known = uncertainty(self.problem, best.theta, curvature)
        if known.slopes is None or not (self.by_energy or self.treatment.noises):
            return known
        noises = self.treatment.noises
        disturbances = self._by_input_noise(best.theta) if noises else np.zeros((1, self.problem.n_samples))
        if self.by_energy:
            return by_energy(known, self.problem, best.theta, best.sigma, disturbances)
        return known.with_disturbances(disturbances, curvature * self.problem.weights)

    def _by_input_noise(self, theta: FloatArray) -> FloatArray:
        """Changes of the output (n_draws, n_samples) by noise of the input that is drawn anew."""
        rng, treatment = np.random.default_rng(self.seed), self.treatment

        def output(inputs: Sequence[FloatArray]) -> FloatArray:
            pairs = zip(self.problem.parts, inputs, strict=True)
            parts = [replace(part, record=replace(part.record, u=u)) for part, u in pairs]
            return np.asarray(replace(self.problem, parts=tuple(parts)).model(theta[np.newaxis])[0])

        def measured(record: Record, noise: float) -> FloatArray:
            u = record.u + noise * rng.standard_normal(len(record))
            return u if treatment.front is None else treatment.front.response(u)

        quiet = output([record.u for record in treatment.quiet])
        known = [*zip(treatment.quiet, treatment.noises, strict=True)]
        draws = [output([measured(*each) for each in known]) for _ in range(N_DISTURBED)]
        return np.array(draws) - quiet

    def _profiles(self, likely: list[LocalOptimum], known: Uncertainty) -> tuple[dict[str, Profile], FloatArray | None]:
        n_samples, n_names = self.problem.n_samples, len(self.problem.space.names)
        if n_samples <= n_names:
            return {}, None
        limit = float(n_samples * np.log1p(self._quantile() ** 2 / (n_samples - n_names)))
        inside = [optimum for optimum in likely if 2.0 * (optimum.loss - likely[0].loss) < limit]
        thetas, losses = np.array([each.theta for each in inside]), np.array([each.loss for each in inside])
        return _profiles(self.descent, thetas, losses, known, limit)

    def _described(
        self, likely: list[LocalOptimum], known: Uncertainty, intervals: str, curves: Mapping[str, Profile]
    ) -> Identification:
        from scipy.stats import chi2

        best, problem, names = likely[0], self.problem, self.problem.space.names
        residual, chosen = self.residual(best.theta), self.candidate(best.theta)
        kept = problem.weights > 0.0
        share = np.sqrt(problem.weights[kept])
        measures = fit_measures(problem.y[kept], residual[kept], len(names))
        by_weight = fit_measures(problem.y[kept], share * residual[kept], len(names))
        measures |= {name: by_weight[name] for name in ("fpe", "aic", "bic", "whiteness")}
        limit = float(chi2.ppf(LEVEL, len(names))) if names else 0.0
        rivals = tuple(self.candidate(each.theta) for each in likely[1:] if 2.0 * (each.loss - best.loss) < limit)
        stderr = dict(zip(names, np.sqrt(np.diag(known.covariance)).tolist(), strict=True))
        n_draws = N_BOOTSTRAP if intervals == "bootstrap" and problem.n_samples > len(names) else 0
        draws = bootstrap(problem, self.noise, best.theta, residual, best.sigma, draws=n_draws, seed=self.seed)
        spread, exact = float(np.std(problem.y)), is_exact(problem, chosen.rmse)
        why, probability = (*known.stopped, *known.reasons), measures["whiteness"]
        told = sentences(
            spread=spread, exact=exact, whiteness=probability, stderr=stderr, reasons=why, success=best.converged
        )
        odd = odd_residuals(problem, residual, is_robust=isinstance(self.noise, Robust))
        return Identification(
            model=chosen.model,
            models=tuple(problem.family.assemble(problem.estimates(best.theta, k)) for k in range(len(problem.parts))),
            estimates=chosen.estimates,
            stderr=stderr,
            intervals=self._intervals(intervals, chosen.estimates, stderr, curves, draws),
            interval_method=intervals,
            profiles=curves,
            covariance=known.covariance,
            condition=known.condition,
            redundant=known.redundant,
            free_names=names,
            n_parameters=len(names),
            **measures,
            noise=self.noise.name,
            sigma=best.sigma,
            log_likelihood=-best.loss,
            residual=residual,
            resolution=problem.parts[0].record.resolution,
            response_stderr=known.output,
            loop_width=self._width(best.theta, known, draws),
            success=best.converged and not known.stopped,
            message="; ".join([*_phrases(best.converged, problem, known, rivals, curves), *self._notes(best, draws)]),
            rivals=rivals,
            seed=self.seed,
            warnings=(*known.stopped, *told, *odd),
        )

    def _notes(self, best: LocalOptimum, draws: FloatArray) -> list[str]:
        family, record = self.problem.family, self.problem.parts[0].record
        notes = []
        if len(draws) and isinstance(self.noise, Quantised) and best.sigma < _FAINT * self.noise.quantum:
            notes.append('with noise this far below the quantum bootstrap intervals are too short: use "profile"')
        return [*notes, *family.notes(record, family.assemble(self.problem.estimates(best.theta)))]

    def _intervals(
        self, intervals: str, estimates: Numbers, stderr: Numbers, curves: Mapping[str, Profile], draws: FloatArray
    ) -> dict[str, tuple[float, float]]:
        unknown = dict.fromkeys(stderr, (np.nan, np.nan))
        if intervals == "profile":
            return unknown | {name: (curve.lower, curve.upper) for name, curve in curves.items()}
        if intervals == "bootstrap":
            if not len(draws):
                return unknown
            ends = np.quantile(self.problem.named(draws), TAILS, axis=0).T.tolist()
            both = zip(stderr, ends, strict=True)
            return unknown | {name: (low, high) for name, (low, high) in both if np.isfinite(stderr[name])}
        reach = {name: value * self._quantile() for name, value in stderr.items()}
        return {name: (estimates[name] - each, estimates[name] + each) for name, each in reach.items()}

    def _quantile(self) -> float:
        from scipy.stats import t

        freedom = self.problem.n_samples - len(self.problem.space.names)
        return float(t.ppf(TAILS[1], freedom)) if freedom > 0 else float("nan")

    def _width(self, theta: FloatArray, known: Uncertainty, draws: FloatArray) -> Width | None:
        value = loop_widths(self.descent, theta[np.newaxis])
        if not value.size:
            return None
        width = float(value[0])
        if len(draws):
            lower, upper = np.quantile(loop_widths(self.descent, draws), TAILS).tolist()
        else:
            reach = self._quantile() * width_stderr(self.problem, theta, known.of_theta, known.slopes)
            lower, upper = width - reach, width + reach
        return Width(value=width, lower=lower, upper=upper)


def _phrases(
    converged: bool, problem: Problem, known: Uncertainty, rivals: Sequence[Candidate], curves: Mapping[str, Profile]
) -> list[str]:
    ended = known.stopped or (("converged",) if converged else ())
    phrases = [*ended, *(() if converged else ("the search did not converge",)), *known.reasons]
    turning = [any(part.record.reversals(least).size for part in problem.parts) for least in (0.0, TOLERANCE)]
    if not all(turning):
        what = f"turns back by at most {100.0 * TOLERANCE:.0f} % of its span" if any(turning) else "never turns back"
        phrases.append(f"the input {what}: the parameters of unloading are not determined")
    ends = [name for name, curve in curves.items() if any(curve.at_box)]
    phrases += [f"the interval of {name} ends at its search bound" for name in ends]
    if rivals:
        phrases.append(f"{len(rivals)} other {'optimum' if len(rivals) == 1 else 'optima'} within the noise")
    return phrases


_ENOUGH = 0.01  # of sqrt(D) at the end of an interval
_ROUNDS = 30
_FARTHEST = 4.0  # growth of a step that does not reach the end yet
_CLOSE = 1e-3  # two values this close, in standard errors, are one
_FLAT = 1e-4  # of the loss: a descent that gains less rests
_BETTER = 0.02  # of the deviance: below minus this, an optimum is another


class _Ends:
    """Outermost values inside and innermost ones outside (nan if unknown) of each interval, with sqrt(D) there."""

    def __init__(self, place: Sets, side: FloatArray, values: FloatArray, deviance: FloatArray) -> None:
        self.place, self.side, self.points = place, side, [(place, values, deviance)]  # parameters; -1 at lower ends
        self.inside, self.r_inside = values.copy(), np.sqrt(deviance)
        self.origin, self.r_origin = values.copy(), np.sqrt(deviance)
        self.outside, self.r_outside = np.full(values.size, np.nan), np.full(values.size, np.inf)
        self.end = np.full(values.size, np.nan)
        self.doubtful = np.zeros(values.size, dtype=bool)  # whether the outer value was reached from farther away

    def move_in(self, which: Sets, values: FloatArray, root: FloatArray) -> None:
        self.inside[which], self.r_inside[which] = values, root
        self.doubtful[which] = np.isfinite(self.outside[which]) & (self.outside[which] != values)
        self.outside[which] = np.where(self.doubtful[which], self.outside[which], np.nan)

    def move_out(self, which: Sets, values: FloatArray, root: FloatArray) -> None:
        self.outside[which], self.r_outside[which], self.doubtful[which] = values, root, False

    def farther(self, won: Sets, step: FloatArray, root: float) -> FloatArray:
        gone, risen = np.abs(self.inside - self.origin)[won], (self.r_inside - self.r_origin)[won]
        straight = 1.1 * (root - self.r_inside[won]) * gone / np.where(risen > 0.0, risen, np.inf)
        return np.where(risen > 0.0, np.clip(straight, 0.1 * step, _FARTHEST * step), _FARTHEST * step)

    def trial(self, active: Sets, step: FloatArray, root: float) -> FloatArray:
        inside, outside = self.inside[active], self.outside[active]
        r_in, r_out = self.r_inside[active], self.r_outside[active]
        share = np.where(np.isfinite(r_out), (root - r_in) / np.where(np.isfinite(r_out), r_out - r_in, 1.0), 0.5)
        between = inside + np.clip(share, 0.1, 0.9) * (outside - inside)
        ahead = inside + self.side[active] * step[active]
        again = self.doubtful[active] & ((outside - ahead) * self.side[active] <= 0.0)
        return np.where(np.isnan(outside), ahead, np.where(again, outside, between))

    def curves(self, names: tuple[str, ...], limit: float) -> dict[str, Profile]:
        at_box = np.isnan(self.end) & np.isfinite(self.outside) & ~np.isfinite(self.r_outside)
        open_ended = np.where(np.isnan(self.outside), self.side * np.inf, self.inside)
        end = np.where(np.isnan(self.end), open_ended, self.end)
        places, visited, deviance = (np.concatenate(parts) for parts in zip(*self.points, strict=True))
        result = {}
        for k in np.unique(self.place).tolist():
            low, high = (np.flatnonzero((self.place == k) & (self.side == sign)) for sign in (-1.0, 1.0))
            lowest, highest = low[np.argmin(end[low])], high[np.argmax(end[high])]
            mine = np.flatnonzero(places == k)
            mine = mine[_outline(visited[mine], deviance[mine])]
            result[names[k]] = Profile(
                lower=float(end[lowest]),
                upper=float(end[highest]),
                at_box=(bool(at_box[lowest]), bool(at_box[highest])),
                values=visited[mine],
                deviance=deviance[mine],
                limit=limit,
            )
        return result


def _profiles(
    descent: Descent, optima: FloatArray, losses: FloatArray, known: Uncertainty, limit: float
) -> tuple[dict[str, Profile], FloatArray | None]:
    """Profiles of all parameters with a standard error, and a better optimum (n_theta,) if one was met.

    `optima` (n_optima, n_theta) lie within the `limit` of the deviance, best first.
    """
    variance, root = np.diag(known.covariance), float(np.sqrt(limit))
    free = np.flatnonzero(np.isfinite(variance) & (variance > 0.0))
    if not free.size:
        return {}, None
    grid = np.meshgrid(free, [-1.0, 1.0], np.arange(len(optima)), indexing="ij")
    place, start = grid[0].ravel(), grid[2].ravel()
    side: FloatArray = grid[1].ravel().astype(float)
    values, theta = descent.problem.named(optima)[start, place], optima[start]
    ends = _Ends(place, side, values, 2.0 * np.maximum(losses[start] - losses[0], 0.0))
    stderr, slope = np.sqrt(variance[place]), (known.with_names[:, place] / variance[place]).T.copy()
    step = stderr * np.maximum(root - ends.r_inside, 0.2 * root)
    trial = values + side * step
    active = np.arange(place.size)
    better: tuple[float, FloatArray] | None = None
    for _ in range(_ROUNDS):
        if not active.size:
            break
        at = trial[active]
        guess = theta[active] + (at - ends.inside[active])[:, np.newaxis] * slope[active]
        reached = descent.run(guess, constraint=Constraint(place[active], at), tolerance=_FLAT)
        deviance = 2.0 * (reached.loss - losses[0])
        lowest = int(np.argmin(deviance))
        if deviance[lowest] < -_BETTER and (better is None or deviance[lowest] < better[0]):
            better = float(deviance[lowest]), reached.theta[lowest]
        finite = np.isfinite(deviance)
        ends.points.append((place[active][finite], at[finite], deviance[finite]))
        r = np.sqrt(np.maximum(deviance, 0.0))
        inner = r <= root
        won, lost = active[inner], active[~inner]
        change = at[inner] - ends.inside[won]
        far = np.abs(change) > 0.1 * np.abs(at[inner] - ends.origin[won])  # others differ by how far they descended
        slope[won[far]] = (reached.theta[inner] - theta[won])[far] / change[far, np.newaxis]
        theta[won] = reached.theta[inner]
        ends.move_in(won, at[inner], r[inner])
        ends.move_out(lost, at[~inner], r[~inner])
        close = np.abs(r - root) <= _ENOUGH * root
        ends.end[active[close]] = at[close]
        gap = np.abs(ends.outside[active] - ends.inside[active])
        step[won] = ends.farther(won, step[won], root)
        trial[active] = ends.trial(active, step, root)
        active = active[~close & (ends.doubtful[active] | ~(gap <= _CLOSE * stderr[active]))]
    return ends.curves(descent.problem.space.names, limit), None if better is None else better[1]


def _outline(values: FloatArray, deviance: FloatArray) -> Sets:
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
