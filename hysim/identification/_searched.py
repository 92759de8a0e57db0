"""One searched problem with its noise: the optima, their intervals, and the result that describes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray
from hysim.identification._descent import Descent
from hysim.identification._diagnostics import loop_widths, whiteness, width_stderr
from hysim.identification._noise import Gaussian, Noise, Quantised
from hysim.identification._problem import Problem
from hysim.identification._profile import Profile, profiles, threshold
from hysim.identification._resampling import bootstrap
from hysim.identification._result import Candidate, Identification, Width
from hysim.identification._search import PERFECT, Optimum, optima, polish
from hysim.identification._uncertainty import Uncertainty, uncertainty
from hysim.identification.sentences import sentences

LEVEL = 0.95
TAILS = (0.025, 0.975)
N_BOOTSTRAP = 500
_SAME = 1e-6  # relative difference of two costs that are the same
_FAINT = 0.3  # quanta: noise below does not spread the rounding
_EXACT = 100.0  # smallest sigmas: below, nothing is left to explain


@dataclass(frozen=True)
class LocalOptimum:
    """A local optimum: theta (n_theta,), minus the log-likelihood, sigma, and whether the search converged."""

    theta: FloatArray
    loss: float
    sigma: float
    converged: bool


@dataclass(frozen=True)
class Search:
    """One problem with its noise."""

    problem: Problem
    noise: Noise
    noise_name: str
    seed: int

    @property
    def descent(self) -> Descent:
        return Descent(self.problem, self.noise, self.problem.y[np.newaxis], np.ones((1, self.problem.y.size)))

    def likely(self, squares: Sequence[Optimum]) -> list[LocalOptimum]:
        """Distinct optima, best first: those of the sum of squares, and for other noise what they descend to."""
        x = np.array([optimum.x for optimum in squares])
        theta = np.concatenate([x, self.problem.solve(x)[0]], axis=1)
        steps = 0 if isinstance(self.noise, Gaussian) else 200
        reached = self.descent.run(theta, tolerance=1e-9, steps=steps)
        ranked = np.argsort(reached.loss, kind="stable")
        found: list[LocalOptimum] = []
        for k in ranked[np.isfinite(reached.loss[ranked])].tolist():
            perfect = bool(found) and found[0].sigma <= _EXACT * PERFECT * self.problem.scale
            if not found or (not perfect and reached.loss[k] - found[-1].loss > 0.5 * self.problem.y.size * _SAME):
                found.append(
                    LocalOptimum(
                        reached.theta[k], float(reached.loss[k]), float(reached.sigma[k]), squares[k].converged
                    )
                )
        return found

    def regions(self, best: LocalOptimum) -> dict[str, Candidate]:
        """The best candidate inside each named region that the optimum is not in."""
        space, candidates = self.problem.space, {}
        x = best.theta[: len(space.coordinates)]
        for name, (lower, upper) in space.regions.items():
            if np.all(x >= lower) and np.all(x <= upper):
                continue
            box = replace(space, lower=lower, upper=upper, starts=np.clip(space.starts, lower, upper), regions={})
            inside = replace(self, problem=replace(self.problem, space=box))
            if squares := optima(inside.problem, seed=self.seed):
                candidates[name] = inside.candidate(inside.likely(squares)[0].theta)
        return candidates

    def candidate(self, theta: FloatArray) -> Candidate:
        """The model at `theta`, and how well it fits."""
        whole, n_x = self.problem, len(self.problem.space.coordinates)
        parameters = whole.estimates(theta[:n_x], theta[n_x:])
        residual = self.residual(theta)
        own = () if len(whole.parts) == 1 else [name for name in whole.own.state if name not in whole.own.held]
        shared = {name: value for name, value in parameters.items() if name not in own}
        return Candidate(
            model=whole.family.assemble(parameters),
            estimates=shared | dict(zip(whole.space.names, self.named(theta), strict=True)),
            fit_percent=metrics.fit_percent(whole.y, whole.y - residual),
            rmse=float(np.sqrt(np.mean(residual**2))),
        )

    def residual(self, theta: FloatArray) -> FloatArray:
        """Measured minus model."""
        return np.asarray(self.problem.y - self.descent.outputs(theta[np.newaxis])[0])

    def named(self, theta: FloatArray) -> list[float]:
        """The free parameters, in the order of their names."""
        n_x = len(self.problem.space.coordinates)
        return np.ravel(self.problem.named(theta[np.newaxis, :n_x], theta[np.newaxis, n_x:])).tolist()

    def described(
        self, found: list[LocalOptimum], intervals: str, least_squares: FloatArray
    ) -> tuple[Identification, list[LocalOptimum]]:
        """The result at the best optimum; a better one that its profiles meet takes its place.

        `least_squares` are the coordinates of the least sum of squares.
        """
        known = self._uncertainty(found[0])
        curves: dict[str, Profile] = {}
        if intervals == "profile":
            curves, better = self._profiles(found, known)
            if better is not None:
                n_x = len(self.problem.space.coordinates)
                found = self.likely(polish(self.problem, better[np.newaxis, :n_x])) + found
                found = sorted(found, key=lambda optimum: optimum.loss)
                known = self._uncertainty(found[0])
                curves, _ = self._profiles(found, known)
        result = self._described(found, known, intervals, curves)
        if isinstance(self.noise, Gaussian):
            return result, found
        theta = np.concatenate([least_squares, self.problem.solve(least_squares[np.newaxis])[0][0]])
        return replace(result, least_squares=self.candidate(theta)), found

    def _uncertainty(self, best: LocalOptimum) -> Uncertainty:
        residual, sigma = self.residual(best.theta)[np.newaxis], np.full((1, 1), best.sigma)
        return uncertainty(self.problem, best.theta, self.noise.terms(residual, sigma).curvature[0])

    def _profiles(self, found: list[LocalOptimum], known: Uncertainty) -> tuple[dict[str, Profile], FloatArray | None]:
        n_samples, n_names = self.problem.y.size, len(self.problem.space.names)
        if n_samples <= n_names:
            return {}, None
        limit = threshold(n_samples, n_names, LEVEL)
        inside = [optimum for optimum in found if 2.0 * (optimum.loss - found[0].loss) < limit]
        thetas, losses = np.array([each.theta for each in inside]), np.array([each.loss for each in inside])
        return profiles(self.descent, thetas, losses, known.covariance, known.with_names, limit)

    def _described(
        self, found: list[LocalOptimum], known: Uncertainty, intervals: str, curves: Mapping[str, Profile]
    ) -> Identification:
        from scipy.stats import chi2

        best, whole = found[0], self.problem
        names = whole.space.names
        residual, chosen = self.residual(best.theta), self.candidate(best.theta)
        limit = float(chi2.ppf(LEVEL, len(names))) if names else 0.0
        rivals = tuple(self.candidate(each.theta) for each in found[1:] if 2.0 * (each.loss - best.loss) < limit)
        stderr = np.sqrt(np.diag(known.covariance))
        draws = self._draws(best, residual) if intervals == "bootstrap" else np.empty((0, best.theta.size))
        spans = self._intervals(intervals, chosen.estimates, stderr, curves, draws)
        first = whole.parts[0].record
        x, linear = np.split(best.theta, [len(whole.space.coordinates)])
        models = tuple(whole.family.assemble(whole.estimates(x, linear, k)) for k in range(len(whole.parts)))
        notes = whole.family.notes(first, chosen.model)
        if len(draws) and isinstance(self.noise, Quantised) and best.sigma < _FAINT * self.noise.quantum:
            notes = ("noise this far below the quantum hardly changes a record drawn anew: ask for profiles", *notes)
        return Identification(
            model=chosen.model,
            models=models,
            estimates=chosen.estimates,
            stderr=dict(zip(names, stderr.tolist(), strict=True)),
            intervals=spans,
            interval_method=intervals,
            profiles=curves,
            covariance=known.covariance,
            condition=known.condition,
            redundant=known.redundant,
            free_names=names,
            n_parameters=len(names),
            fit_percent=chosen.fit_percent,
            rmse=chosen.rmse,
            fpe=metrics.fpe(residual, len(names)),
            aic=metrics.aic(residual, len(names)),
            bic=metrics.bic(residual, len(names)),
            noise=self.noise_name,
            sigma=best.sigma,
            log_likelihood=-best.loss,
            least_squares=None,
            residual=residual,
            resolution=first.resolution,
            response_stderr=known.output,
            loop_width=self._width(best.theta, known, draws),
            whiteness=whiteness(residual, len(names)),
            success=best.converged,
            message="; ".join(_phrases(best.converged, whole, known, rivals, curves, notes)),
            rivals=rivals,
            seed=self.seed,
            warnings=sentences(
                spread=float(np.std(whole.y)),
                size=whole.scale,
                rmse=chosen.rmse,
                whiteness=whiteness(residual, len(names)),
                stderr=dict(zip(names, stderr.tolist(), strict=True)),
                reasons=known.reasons,
                success=best.converged,
            ),
        )

    def _draws(self, best: LocalOptimum, residual: FloatArray) -> FloatArray:
        """Theta as it could have come out, (n_draws, n_theta)."""
        if residual.size <= len(self.problem.space.names):
            return np.empty((0, best.theta.size))
        return bootstrap(self.problem, self.noise, best.theta, residual, best.sigma, draws=N_BOOTSTRAP, seed=self.seed)

    def _intervals(
        self,
        intervals: str,
        estimates: Mapping[str, float],
        stderr: FloatArray,
        curves: Mapping[str, Profile],
        draws: FloatArray,
    ) -> dict[str, tuple[float, float]]:
        space, n_x = self.problem.space, len(self.problem.space.coordinates)
        unknown = dict.fromkeys(space.names, (np.nan, np.nan))
        if intervals == "profile":
            return unknown | {name: (curve.lower, curve.upper) for name, curve in curves.items()}
        if intervals == "bootstrap":
            if not len(draws):
                return unknown
            ends = np.quantile(self.problem.named(draws[:, :n_x], draws[:, n_x:]), TAILS, axis=0)
            told = np.isfinite(stderr)
            return unknown | {
                name: (float(ends[0, k]), float(ends[1, k])) for k, name in enumerate(space.names) if told[k]
            }
        reach = stderr * self._quantile()
        return {
            name: (estimates[name] - float(each), estimates[name] + float(each))
            for name, each in zip(space.names, reach, strict=True)
        }

    def _quantile(self) -> float:
        """Quantile of Student's distribution for the remaining degrees of freedom."""
        from scipy.stats import t

        freedom = self.problem.y.size - len(self.problem.space.names)
        return float(t.ppf(TAILS[1], freedom)) if freedom > 0 else float("nan")

    def _width(self, theta: FloatArray, known: Uncertainty, draws: FloatArray) -> Width | None:
        """The loop's largest width with its band; None where the first record has no loop."""
        value = loop_widths(self.descent, theta[np.newaxis])
        if not value.size:
            return None
        width = float(value[0])
        if len(draws):
            lower, upper = np.quantile(loop_widths(self.descent, draws), TAILS).tolist()
        else:
            reach = self._quantile() * width_stderr(self.descent, theta, known.of_theta)
            lower, upper = width - reach, width + reach
        return Width(value=width, lower=lower, upper=upper)


def _phrases(
    converged: bool,
    whole: Problem,
    known: Uncertainty,
    rivals: Sequence[Candidate],
    curves: Mapping[str, Profile],
    notes: Sequence[str],
) -> list[str]:
    """Message of how the search ended, and which parameters the data do not determine."""
    phrases = ["converged" if converged else "the search did not converge", *known.reasons]
    inputs = [part.record.u for part in whole.parts]
    if all((np.diff(u) >= 0.0).all() or (np.diff(u) <= 0.0).all() for u in inputs):
        phrases.append("the input never turns back: nothing shows what unloading does")
    for name, curve in curves.items():
        if any(curve.at_box):
            phrases.append(f"the interval of {name} ends at the box")
    if rivals:
        what = "optimum" if len(rivals) == 1 else "optima"
        phrases.append(f"{len(rivals)} other {what} within the noise")
    return [*phrases, *notes]
