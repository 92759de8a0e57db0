"""The verb `identify`: declare, search, describe."""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim import metrics
from hysim._cycles import TOLERANCE
from hysim._frozen import FloatArray
from hysim._parallel import Progress, at_most
from hysim.identification._descent import Descent
from hysim.identification._diagnostics import loop_widths, whiteness, width_stderr
from hysim.identification._noise import Gaussian, Noise, Quantised, Robust
from hysim.identification._problem import Problem, problem
from hysim.identification._profile import Profile, profiles, threshold
from hysim.identification._resampling import bootstrap, left_out_errors
from hysim.identification._result import Candidate, Identification, Width
from hysim.identification._search import PERFECT, Optimum, optima, polish
from hysim.identification._uncertainty import Uncertainty, uncertainty
from hysim.identification.folds import folds
from hysim.models.search_space import Freedom, Identifiable
from hysim.records import Record

LEVEL = 0.95
TAILS = (0.025, 0.975)
N_BOOTSTRAP = 500
_SAME = 1e-6  # relative difference of two costs that are the same
_FAINT = 0.3  # quanta: noise below does not spread the rounding
_EXACT = 100.0  # smallest sigmas: below, nothing is left to explain


def identify(
    model_or_class: Any,
    record_or_records: Record | Sequence[Record],
    *,
    fixed: Mapping[str, float] | None = None,
    free: Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    initial: str | Sequence[str] | None = None,
    noise: str = "gaussian",
    intervals: str = "linear",
    cross_validate: str | int | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify a model's parameters on one or several records, by its error in free run.

    Parameters
    ----------
    model_or_class : model, model class or structure
        `hysim.BoucWen`, `hysim.TransferFunction.structure(poles=4, zeros=1)`, ... A class gives its
        defaults as one start of the search, an instance its values.
    record_or_records : Record or sequence of Record
        Input and output, and for models with dynamics the time. Several records share all parameters but
        those of the state at the first sample: where it is free, each has its own, ``z0[0]``, ``z0[1]``, ...
    fixed : mapping, optional
        Parameters that are not free, and their values.
    free : sequence of str, optional
        Names to take out of the set that is held by default. Of each redundant group one is held, for
        Bouc-Wen ``A = 1``, since only A times gain can be told.
    bounds : mapping, optional
        Name to (lower, upper), in place of the family's own box.
    initial : {"free", "rest", "periodic"}, or one of them for each record, optional
        Whether the state at the first sample is identified, is rest, or is that of a steady cycle (the
        record repeats itself); by default as the family has it (free for a memory, as the structure says
        for a transfer function).
    noise : {"gaussian", "quantised", "robust"}
        What the output is disturbed by: normal noise; normal noise before a sensor that rounds to multiples
        of `Record.resolution`, so that each output is an interval; or Student's t with 4 degrees of freedom,
        for records with outliers. The likelihood of the last two begins at the optima of the first.
    intervals : {"linear", "profile", "bootstrap"}
        How `Identification.intervals`, at 95 %, are found: from the standard errors, by the profile of the
        likelihood, or from 500 records drawn anew.
    cross_validate : {None, "loo", "cycles", "records"} or int, optional
        ``"loo"`` leaves one output sample out at a time, an int one of that many blocks of samples, ``"cycles"``
        a cycle of the input (not the first, which tells the state), ``"records"`` a record; the input is kept.
        Fills `Identification.cv_rmse` and `Identification.cv_residual`.
    seed : int
        Of the starts of the search, and of what is drawn. The optimum does not depend on it.
    workers : int, optional
        Number of threads; by default one for each core.
    progress : callable, optional
        Called as ``progress(done, total)``.

    Returns
    -------
    Identification

    Raises
    ------
    ValueError
        If a name or an option is unknown, nothing is free, the record is too short for the parameters, its input
        is constant, or it has no resolution for quantised noise.
    TypeError
        If the first argument is not something that can be identified.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    >>> rec = hs.Record(u=u, y=hs.BoucWen(beta=0.7, gamma=0.3, gain=2.0).response(u))
    >>> fit = hs.identify(hs.BoucWen, rec, fixed={"n": 1.0, "feedthrough": 0.0})
    >>> round(fit.estimates["beta"], 6), round(fit.estimates["gain"], 6)
    (0.7, 2.0)
    """
    family, records = _family(model_or_class), _records(record_or_records)
    if intervals not in ("linear", "profile", "bootstrap"):
        raise ValueError(f'intervals must be "linear", "profile" or "bootstrap", got {intervals!r}')
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed must be an integer from 0 on, got {seed!r}")
    with at_most(workers):
        whole = problem(family, records, _freedom(fixed or {}, free, bounds or {}), initial)
        if not whole.space.names:
            raise ValueError("every parameter is fixed: nothing is left to identify")
        if whole.y.size < len(whole.space.names):
            raise ValueError(
                f"{whole.y.size} samples cannot tell {len(whole.space.names)} parameters: fix some of them"
            )
        left_out = _left_out(cross_validate, whole)
        density = _density(noise, whole)
        squares = optima(whole, seed=seed, progress=progress)
        if not squares:
            raise ValueError("no law in the box stays finite on this record: check its units, or give bounds")
        if isinstance(density, Quantised):
            density = density.at_least(squares[0].cost, whole.y.size - len(whole.space.names))
        search = _Search(whole, density, noise, seed)
        found = search.likely(squares)
        result, found = search.described(found, intervals, squares[0].x)
        thetas = np.array([optimum.theta for optimum in found])
        errors = left_out_errors(whole, search.noise, thetas, left_out)
        return replace(
            result,
            regions=search.regions(found[0]),
            cv_residual=errors,
            cv_rmse=float(np.sqrt(np.mean(errors[~np.isnan(errors)] ** 2))) if left_out else float("nan"),
        )


def _records(given: Record | Sequence[Record]) -> tuple[Record, ...]:
    records = (given,) if isinstance(given, Record) else given
    if not isinstance(records, Sequence) or not all(isinstance(record, Record) for record in records):
        what = type(given).__name__
        raise TypeError(f"identify takes a Record or several of them, got {what}: hs.Record(u=u, y=y)")
    if not records:
        raise ValueError("there is no record to identify from")
    return tuple(records)


def _freedom(fixed: Mapping[str, float], free: Sequence[str], bounds: Mapping[str, tuple[float, float]]) -> Freedom:
    for name, value in fixed.items():
        if not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
            raise ValueError(f"fixed must hold finite numbers, got {value!r} for {name!r}")
    for name, pair in bounds.items():
        if np.shape(pair) != (2,):
            raise ValueError(f"bounds of {name!r} must be (lower, upper), got {pair!r}")
    return Freedom(fixed, (free,) if isinstance(free, str) else tuple(free), bounds)


def _family(model_or_class: Any) -> Identifiable:
    """The object that declares the search: a class stands for the model with its defaults."""
    family: Any = model_or_class
    if not all(callable(getattr(family, name, None)) for name in ("search_space", "regressors", "assemble")):
        raise TypeError(f"identify takes a model, a model class or a structure, got {model_or_class!r}")
    belongs_to_the_class = inspect.ismethod(family.search_space)
    if isinstance(family, type) and not belongs_to_the_class:
        required = [f.name for f in fields(family) if f.default is MISSING and f.default_factory is MISSING]
        if required:
            raise TypeError(
                f"{family.__name__} has no defaults for {', '.join(required)}: pass an instance as the start, "
                "or use discover"
            )
        family = family()
    return family  # type: ignore[no-any-return]


def _density(noise: str, whole: Problem) -> Noise:
    floor = PERFECT * (float(np.abs(whole.y).max()) or 1.0)
    if noise == "gaussian":
        return Gaussian(floor)
    if noise == "robust":
        return Robust(floor)
    if noise != "quantised":
        raise ValueError(f'noise must be "gaussian", "quantised" or "robust", got {noise!r}')
    quanta = {part.record.resolution for part in whole.parts}
    if len(quanta) != 1 or None in quanta:
        raise ValueError("quantised noise needs the sensor's quantum, the same for all records: Record(resolution=...)")
    return Quantised(float(quanta.pop() or 0.0))


def _left_out(cross_validate: str | int | None, whole: Problem) -> list[npt.NDArray[np.intp]]:
    if cross_validate is None:
        return []
    if cross_validate == "records":
        if len(whole.parts) < 2:
            raise ValueError('cross_validate="records" needs at least 2 records')
        return np.split(np.arange(whole.y.size), whole.cuts[1:-1])
    if cross_validate == "cycles":
        return _cycles(whole)
    return folds(cross_validate, whole.y.size, name="cross_validate")


def _cycles(whole: Problem) -> list[npt.NDArray[np.intp]]:
    """The samples between every second turning point of each record's input, but the first, which tell its state."""
    left_out = []
    for part, begin in zip(whole.parts, whole.cuts, strict=False):
        cuts = part.record.reversals(TOLERANCE)[1::2]
        left_out += [begin + samples for samples in np.split(np.arange(len(part.record)), cuts)[1:]]
    if not left_out:
        raise ValueError('cross_validate="cycles" needs at least 2 cycles of the input')
    return left_out


@dataclass(frozen=True)
class _Optimum:
    """A local optimum: theta (n_theta,), minus the log-likelihood, sigma, and whether the search converged."""

    theta: FloatArray
    loss: float
    sigma: float
    converged: bool


@dataclass(frozen=True)
class _Search:
    """One problem with its noise."""

    problem: Problem
    noise: Noise
    noise_name: str
    seed: int

    @property
    def descent(self) -> Descent:
        return Descent(self.problem, self.noise, self.problem.y[np.newaxis], np.ones((1, self.problem.y.size)))

    def likely(self, squares: Sequence[Optimum]) -> list[_Optimum]:
        """Distinct optima, best first: those of the sum of squares, and for other noise what they descend to."""
        x = np.array([optimum.x for optimum in squares])
        theta = np.concatenate([x, self.problem.solve(x)[0]], axis=1)
        steps = 0 if isinstance(self.noise, Gaussian) else 200
        reached = self.descent.run(theta, tolerance=1e-9, steps=steps)
        ranked = np.argsort(reached.loss, kind="stable")
        found: list[_Optimum] = []
        for k in ranked[np.isfinite(reached.loss[ranked])].tolist():
            perfect = bool(found) and found[0].sigma <= _EXACT * PERFECT * self.problem.scale
            if not found or (not perfect and reached.loss[k] - found[-1].loss > 0.5 * self.problem.y.size * _SAME):
                found.append(
                    _Optimum(reached.theta[k], float(reached.loss[k]), float(reached.sigma[k]), squares[k].converged)
                )
        return found

    def regions(self, best: _Optimum) -> dict[str, Candidate]:
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
        self, found: list[_Optimum], intervals: str, least_squares: FloatArray
    ) -> tuple[Identification, list[_Optimum]]:
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

    def _uncertainty(self, best: _Optimum) -> Uncertainty:
        residual, sigma = self.residual(best.theta)[np.newaxis], np.full((1, 1), best.sigma)
        return uncertainty(self.problem, best.theta, self.noise.terms(residual, sigma).curvature[0])

    def _profiles(self, found: list[_Optimum], known: Uncertainty) -> tuple[dict[str, Profile], FloatArray | None]:
        n_samples, n_names = self.problem.y.size, len(self.problem.space.names)
        if n_samples <= n_names:
            return {}, None
        limit = threshold(n_samples, n_names, LEVEL)
        inside = [optimum for optimum in found if 2.0 * (optimum.loss - found[0].loss) < limit]
        thetas, losses = np.array([each.theta for each in inside]), np.array([each.loss for each in inside])
        return profiles(self.descent, thetas, losses, known.covariance, known.with_names, limit)

    def _described(
        self, found: list[_Optimum], known: Uncertainty, intervals: str, curves: Mapping[str, Profile]
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
        notes = whole.family.notes(first, chosen.model) if hasattr(whole.family, "notes") else ()
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
        )

    def _draws(self, best: _Optimum, residual: FloatArray) -> FloatArray:
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
        """Of Student's distribution with the degrees of freedom that are left."""
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
    """How the search ended, and what the data cannot tell."""
    phrases = ["converged" if converged else "the search did not converge", *known.reasons]
    inputs = [part.record.u for part in whole.parts]
    if not any(np.ptp(part.record.y) for part in whole.parts):
        phrases.append("the output is constant: nothing shows how it depends on the input")
    if all((np.diff(u) >= 0.0).all() or (np.diff(u) <= 0.0).all() for u in inputs):
        phrases.append("the input never turns back: nothing shows what unloading does")
    for name, curve in curves.items():
        if any(curve.at_box):
            phrases.append(f"the interval of {name} ends at the box")
    if rivals:
        what = "optimum" if len(rivals) == 1 else "optima"
        phrases.append(f"{len(rivals)} other {what} within the noise")
    return [*phrases, *notes]
