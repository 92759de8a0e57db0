"""The result of `identify`."""

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray, frozen
from hysim._basics.printing import aligned, bic_in_words, folded, frozen_result, summary_text, wrapped
from hysim.interop import frame
from hysim.models.cascade import Cascade
from hysim.models.storage import Stored


@frozen
class Candidate:
    """One optimum: a model and how well it fits; the fields are those of `Identification`."""

    model: Any
    estimates: Mapping[str, float]
    fit_percent: float
    rmse: float


@frozen
class Width:
    """Largest width of a loop, and its interval at 95 % [unit of y]."""

    value: float
    lower: float
    upper: float


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


@frozen_result
class Choice:
    """Families that were tried on records.

    Parameters
    ----------
    family : str
        The chosen one.
    left_out, continued, beyond : mapping
        By family, the rms error [unit of y] of parts that the fits leave out, and of the record's rest after fits to
        its beginning, within its inputs and beyond; nan without such parts, inf where a fit failed or diverged.
    score : mapping
        By family, the geometric mean of these errors over the least of each, of which the last counts half; the best
        first. A family that was clearly worse in the first round has the errors of that.
    bic : mapping
        The BIC of the families whose scores are within a twentieth of the best; the lowest one is chosen.
    untried : tuple of str
        Families for which there was no time.
    amplitude : float
        Largest amplitude of the input after a cut over that before it; nan without a continuation.
    span : (float, float)
        Lowest and highest input [unit of u].
    seconds : float
        Of the processor.
    passed_over : mapping
        By family, why it was not compared, as without a time in the records, or why it is not chosen although it is
        before the chosen one: the law of its complete search is unsafe, or the search did not succeed.
    """

    family: str
    left_out: Mapping[str, float]
    continued: Mapping[str, float]
    beyond: Mapping[str, float]
    score: Mapping[str, float]
    bic: Mapping[str, float]
    untried: tuple[str, ...]
    amplitude: float
    span: tuple[float, float]
    seconds: float
    passed_over: Mapping[str, str] = field(default_factory=dict)

    @property
    def undecided(self) -> tuple[str, ...]:
        """Further families whose scores are within a twentieth of the best: parts left out do not tell them apart."""
        return tuple(name for name in self.bic if name not in (self.family, *self.passed_over))

    def __str__(self) -> str:
        return "\n".join([*folded(self.in_words()), self.to_text()])

    def in_words(self) -> str:
        """The choice, those that only the BIC tells from it, the next family, and the inputs for which it holds."""
        fitted = [name for name, score in self.score.items() if score < math.inf and name not in self.passed_over]
        others = [name for name in fitted if name not in (self.family, *self.undecided)]
        words = [f"{self.family} is the best of {len(fitted)} families by what they predict"]
        if self.undecided:
            words.append(f"only the BIC decides between it and {', '.join(self.undecided)}")
        if others:
            more = f"{self.score[others[0]] / self.score[self.family]:.3g} times its"
            words.append(f"the next is {others[0]} with {'the same' if more[:2] == '1 ' else more} error")
        for why in dict.fromkeys(self.passed_over.values()):
            names = ", ".join(name for name, reason in self.passed_over.items() if reason == why)
            words.append(f"passed over ({why}): {names}")
        if math.isnan(self.amplitude):
            words.append("no part was long enough to be continued")
        else:
            words.append(f"continued up to {self.amplitude:.3g} times the amplitude before")
        words.append(f"inputs beyond {self.span[0]:.4g} to {self.span[1]:.4g} are untried")
        if self.untried:
            words.append(f"no time for {', '.join(self.untried)}")
        return f"{'; '.join(words)}; {self.seconds:.2g} s"

    def to_text(self) -> str:
        """The table for a terminal, the best first."""
        columns = self.left_out, self.continued, self.beyond, self.score
        rows = [["family", "left out", "continued", "beyond", "over the best", "BIC"]]
        for name in self.score:
            bic = f"{self.bic[name]:.5g}" if name in self.bic else ""
            rows.append([name, *(f"{each[name]:.3g}" for each in columns), bic])
        header, *lines = aligned(rows)
        return "\n".join([header, "-" * len(header), *lines])

    def to_frame(self) -> Any:
        """The families as a `pandas.DataFrame`, one row each, the best first; ImportError without pandas."""
        names = ("left_out", "continued", "beyond", "score", "bic")
        columns = {name: vars(self)[name] for name in names}
        return frame(
            {name: [each.get(family, math.nan) for family in self.score] for name, each in columns.items()},
            index=("family", [*self.score]),
            notes={"family": self.family, "seconds": self.seconds},
        )


@frozen_result
class Identification(Stored):
    """Parameters of a model, identified on one or several records.

    Parameters
    ----------
    model : model
        The identified model, from the state at the first sample of the first record: its `u0` is the input there, and
        its `u_range` that of the records. Where a noisy input needs it, the law is behind a `hysim.ReversalFilter`.
    models : tuple of model
        One for each record, from the state at its first sample.
    estimates : mapping
        Every parameter by name, the fixed ones included.
    stderr : mapping
        Standard error of each free parameter by the linearised model; nan where the data do not determine it.
    intervals : mapping
        Name to (lower, upper) at 95 %; nan where the data do not determine it.
    interval_method : {"linear", "profile", "bootstrap"}
    profiles : mapping
        Name to the profile of the likelihood, where it was computed.
    covariance : array, shape (n_parameters, n_parameters)
        Covariance of the free parameters, in the order of `free_names`.
    condition : float
        Condition number of the Jacobian whose columns have length one.
    redundant : tuple of tuples of str
        Groups of parameters that the data do not determine separately.
    free_names, n_parameters
        The parameters that were identified, and their number d.
    fit_percent, rmse : float
        100 (1 - ||residual|| / ||y - mean(y)||), and the residual's root mean square [unit of y].
    fpe, aic, bic : float
        V (1 + d/N) / (1 - d/N), N ln V + 2 d, N ln V + d ln N, with V the mean squared residual.
    noise : {"gaussian", "quantised", "robust"}
    sigma, log_likelihood : float
        Most likely scale of the noise [unit of y], and the largest likelihood without constants.
    least_squares : Candidate or None
        Optimum of the sum of squares of y, where the noise is not Gaussian or the work is fitted.
    residual : array, shape (n,)
        Measured minus model, ``record.y - model.response(record.u)``, one record after the other [unit of y]. Of a
        `hysim.StructureRecord` its sensors one behind the other, each in units of its noise.
    resolution : float or None
        Quantum of the sensor [unit of y].
    response_stderr : array, shape (n,)
        Standard error of the model's output [unit of y].
    loop_width : Width or None
        Largest width of the first record's loop; None without a complete cycle.
    whiteness : float
        Probability of residuals at least as correlated if they were white (Ljung and Box); nan if unknown.
    success : bool
        Whether the search converged to an optimum inside the search box, and the law is safe on smaller cycles or was
        asked for by ``admissible=False``. It may be at a bound of physics (damage does not heal) or a given one.
    message : str
        How the search ended, which parameters are at a bound, and which the data do not determine.
    rivals : tuple of Candidate
        Other optima whose likelihood ratio is inside the 95 % region of this one, best first.
    regions : mapping
        The best laws with and without restriction, beside the one that is returned: ``"admissible"``, that of the
        region which the family names so or is safe on smaller cycles, if the best law of all is not; or
        ``"unrestricted"``, if the admissible one is returned. See `admissible` of `hysim.identify`.
    cv_rmse, cv_residual : float, and array, shape (n,)
        Cross-validated rmse, and measured minus model at each sample by the fit without it [unit of y]; nan if unknown.
    seed : int
        Seed of the search.
    warnings : tuple of str
        Sentences on a search that did not converge, a constant output, unknown standard errors, correlated residuals,
        input and output that may be swapped, or a response off the record that leaves the measured range by far.
    unsafe : str
        First line of the summary where the law is not safe on smaller cycles within its record's range; else empty.
    choice : Choice, optional
        The families that were tried, where none was given.
    weights : array, shape (n,)
        Weights of the samples as they were given; empty without.
    bounds : mapping
        Bounds of parameters as they were given.
    """

    json_name = "identification"
    json_parts = (Candidate, Width, Profile, Choice)

    model: Any
    models: tuple[Any, ...]
    estimates: Mapping[str, float] = field(default_factory=dict)
    stderr: Mapping[str, float] = field(default_factory=dict)
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    interval_method: str = "linear"
    profiles: Mapping[str, Profile] = field(default_factory=dict)
    covariance: FloatArray = field(default_factory=lambda: np.empty(0))  # JSON keeps no second axis of an empty matrix
    condition: float = float("nan")
    redundant: tuple[tuple[str, ...], ...] = ()
    free_names: tuple[str, ...] = ()
    n_parameters: int
    fit_percent: float
    rmse: float
    fpe: float
    aic: float
    bic: float
    noise: str = "gaussian"
    sigma: float
    log_likelihood: float
    least_squares: Candidate | None = None
    residual: FloatArray
    resolution: float | None
    response_stderr: FloatArray
    loop_width: Width | None
    whiteness: float
    success: bool
    message: str
    rivals: tuple[Candidate, ...] = ()
    regions: Mapping[str, Candidate] = field(default_factory=dict)
    cv_rmse: float = float("nan")
    cv_residual: FloatArray = field(default_factory=lambda: np.empty(0))
    seed: int = 0
    warnings: tuple[str, ...] = ()
    unsafe: str = ""
    choice: Choice | None = None
    weights: FloatArray = field(default_factory=lambda: np.empty(0))
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def family(self) -> str:
        """Name of the model's family, with that of a filter of its input: ``"ReversalFilter >> BoucWen"``."""
        stages = self.model.stages if isinstance(self.model, Cascade) else (self.model,)
        return " >> ".join(type(stage).__name__ for stage in stages)

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the free parameters, shape (n_parameters, n_parameters); nan where it is unknown."""
        scale = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.covariance / np.outer(scale, scale))

    @property
    def residual_quanta(self) -> FloatArray | None:
        """Residual in quanta of the sensor, shape (n,); None without a resolution."""
        return None if self.resolution is None else self.residual / self.resolution

    def __str__(self) -> str:
        free = [f"{name} {self.estimates[name]:.4g}{_error_in_words(self.stderr[name])}" for name in self.free_names]
        fixed = [f"{name} {value:.4g}" for name, value in self.estimates.items() if name not in self.free_names]
        return summary_text(
            [
                *(folded(self.unsafe, first="", indent="  ") if self.unsafe else []),
                f"Identification of {self.family}: {self._fit_in_words()}, rmse {self.rmse:.4g}, "
                f"{self.n_parameters} parameters{self._failure_in_words()}",
                wrapped(free, most=4),
                wrapped(fixed, most=1, first="  held: "),
            ],
            {
                "residual": f"{self._residual_in_words()}, {self.residual.size} samples",
                "loop width": self._width_in_words(", from {:.4g} to {:.4g}"),
                "cross-validated": "" if np.isnan(self.cv_rmse) else f"rmse {self.cv_rmse:.4g}",
                "search": self.message,
                "choice": "" if self.choice is None else self.choice.in_words(),
                "warnings": "; ".join(self.warnings),
            },
        )

    def summary(self) -> str:
        """Report of several lines."""
        family = self.family
        lines = [self.unsafe] if self.unsafe else []
        lines += [
            f"{family}: {self._fit_in_words()}, rmse {self.rmse:.4g}, FPE {self.fpe:.4g}, "
            f"{bic_in_words(self.bic)}, {self.n_parameters} parameters from {self.residual.size} samples"
            f"{self._failure_in_words()}"
        ]
        lines += [self._line(name) for name in self.free_names]
        fixed = [f"{name} = {value:g}" for name, value in self.estimates.items() if name not in self.free_names]
        lines += [f"  held: {', '.join(fixed)}"] if fixed else []
        lines += [f"  residual: {self._residual_in_words()}"]
        if self.loop_width is not None:
            lines.append(f"  loop width {self._width_in_words('  [{:.4g}, {:.4g}]')}")
        if not np.isnan(self.cv_rmse):
            lines.append(f"  cross-validated rmse {self.cv_rmse:.4g}")
        lines += [
            f"  best {name}: fit {each.fit_percent:.2f} %{_ASKED.get(name, '')}" for name, each in self.regions.items()
        ]
        lines.append(f"  {self.message}")
        if self.choice is not None:
            lines += [f"  {line}" for line in [*folded(self.choice.in_words()), *self.choice.to_text().splitlines()]]
        return "\n".join([*lines, *(["Warnings"] if self.warnings else []), *(f"  {each}" for each in self.warnings)])

    def to_frame(self) -> Any:
        """The parameters as a `pandas.DataFrame`, one row each, by their names; ImportError without pandas.

        The columns are estimate, stderr, lower and upper (of the interval at 95 %) and free; unknown numbers are nan,
        also those of a parameter that was held. ``attrs`` has the family and the measures of the fit.
        """
        names, unknown = [*self.estimates], float("nan")
        ends = [self.intervals.get(name, (unknown, unknown)) for name in names]
        return frame(
            {
                "estimate": [float(self.estimates[name]) for name in names],
                "stderr": [float(self.stderr.get(name, unknown)) for name in names],
                "lower": [float(lower) for lower, _ in ends],
                "upper": [float(upper) for _, upper in ends],
                "free": [name in self.free_names for name in names],
            },
            index=("parameter", names),
            notes={"family": self.family, "success": self.success, "message": self.message}
            | {name: float(vars(self)[name]) for name in ("fit_percent", "rmse", "cv_rmse", "fpe", "aic", "bic")},
        )

    def _line(self, name: str) -> str:
        lower, upper = self.intervals[name]
        ends = "" if np.isnan(lower) and np.isnan(upper) else f"  [{lower:.5g}, {upper:.5g}]"
        return f"  {name} = {self.estimates[name]:.6g}{_error_in_words(self.stderr[name])}{ends}"

    def _width_in_words(self, bounds: str) -> str:
        """The width with its bounds in some words, and which record it is of; the empty text without a cycle."""
        if (width := self.loop_width) is None:
            return ""
        ends = bounds.format(width.lower, width.upper) if np.isfinite(width.lower) else ""
        return f"{width.value:.4g}{ends}{', of the first record' * (len(self.models) > 1)}"

    def _fit_in_words(self) -> str:
        return "fit not defined" if np.isnan(self.fit_percent) else f"fit {self.fit_percent:.2f} %"

    def _failure_in_words(self) -> str:
        return "" if self.success or self.unsafe else f", NOT converged: {self.message.partition('; ')[0]}"

    def _residual_in_words(self) -> str:
        counted = self.residual[self.weights > 0.0] if self.weights.size else self.residual
        largest = float(np.abs(counted).max())
        words = [f"largest {largest:.4g}"]
        if self.resolution is not None:
            words = [f"largest {largest / self.resolution:.2f} quanta, rms {self.rmse / self.resolution:.2f}"]
        if self.noise != "gaussian":
            words.append(f"{self.noise} noise of sigma {self.sigma:.4g}")
        if not np.isnan(self.whiteness):
            words.append(f"p = {self.whiteness:.2g} if white")
        return ", ".join(words)


_ASKED = {"admissible": " (admissible=True)", "unrestricted": " (admissible=False)"}


def _error_in_words(stderr: float) -> str:
    return ", standard error unknown" if np.isnan(stderr) else f" +- {stderr:.2g}"
