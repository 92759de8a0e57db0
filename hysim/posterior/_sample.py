"""The verb `sample_posterior`, its result, and bands of what a model with uncertain parameters does."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.blas import one_blas_thread
from hysim._basics.frozen import FloatArray, check_count, read_only
from hysim._basics.libraries import optional
from hysim._basics.printing import aligned, csv_text, frozen_result, quantity, summary_text, wrapped
from hysim._basics.progress import Reports, reports
from hysim.errors import SimulationError
from hysim.identification import Identification, Width
from hysim.identification.likelihood import Problem, again, density, optima
from hysim.metrics.rows import max_widths
from hysim.models.protocols import needs_time
from hysim.posterior._sampler import Chains, effective_samples, sampled, split_rhat
from hysim.posterior._target import Given, Target, check_names, given, linear, searched
from hysim.records import Record, even_step, several

LARGEST_RHAT = 1.05
"""R-hat above which the chains do not agree: `Posterior.warnings` says so."""

_WALKERS, _WALKERS_PER_DIMENSION = 128, 4  # at most, and at least
_SAMPLES_PER_WALKER = 25  # effective ones: of shorter paths R-hat is large by chance
_MOST_STEPS = 100_000


@frozen_result
class Prediction:
    """Outputs of draws of the parameters for one input.

    Parameters
    ----------
    u : array, shape (n_samples,) [unit of u]
        Input.
    outputs : array, shape (n, n_samples) [unit of y]
        One output for each draw; a draw whose output diverges is left out.
    measured : array, shape (n, n_samples) [unit of y]
        The same with noise, as the sensor would measure it.
    level : float
        Probability of the bands.
    loop_width : Width or None
        Median and band of the largest width of the loop [unit of y]; None without a complete cycle.
    widths : array, shape (n,) or (0,)
        Largest width of each draw [unit of y].
    """

    u: FloatArray
    outputs: FloatArray
    measured: FloatArray
    level: float
    loop_width: Width | None
    widths: FloatArray

    @property
    def y(self) -> FloatArray:
        """Median output at each sample, shape (n_samples,)."""
        return np.asarray(np.median(self.outputs, axis=0))

    @property
    def band(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper side of the band of the output, shape (n_samples,) each."""
        return _band(self.outputs, self.level)

    @property
    def measured_band(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper side of the band of the next measurement, shape (n_samples,) each."""
        return _band(self.measured, self.level)

    def __str__(self) -> str:
        low, high = self.band
        width = self.loop_width
        lines = [f"Prediction of {len(self.outputs)} draws at {self.u.size} samples, bands at {100.0 * self.level:g} %"]
        rows = {
            "output": f"band {quantity(float((high - low).mean()))} wide on average",
            "loop width": f"{width.value:.4g}, from {width.lower:.4g} to {width.upper:.4g}" if width else "",
        }
        return summary_text(lines, rows)


@frozen_result
class Posterior:
    """Draws of all free parameters of a model from their distribution given the records.

    Parameters
    ----------
    model : model
        The identified model, whose parameters were sampled.
    samples : mapping
        Name to draws, shape (n_draws * n_walkers,), draw by draw: every free parameter, the linear ones included, and
        ``"sigma"``, the scale of the noise [unit of y].
    log_density : array, shape (n_draws * n_walkers,)
        Logarithm of likelihood times prior, in the coordinates of the sampler, up to a constant.
    n_walkers : int
        Number of walkers of the ensemble.
    effective_samples : mapping
        Name to the number of independent draws whose mean would be as sure.
    rhat : mapping
        Name to R-hat, the spread of all halves of the walkers' paths over that within them: near 1 where paths agree.
    noise : {"gaussian", "quantised", "robust"}
    resolution : float or None
        Quantum of the sensor [unit of y].
    priors : mapping
        Name of each coordinate to its prior in words.
    states : mapping
        Name to draws of a state at the first sample that follows from the parameters, where the record is periodic.
    acceptance : float
        Share of the proposed moves that were accepted.
    n_evaluations : int
        Number of parameter sets that were simulated.
    seed : int
        Seed of the draws.
    warnings : tuple of str
        Sentences on chains that do not agree or are too short.
    """

    model: Any
    samples: Mapping[str, FloatArray]
    log_density: FloatArray
    n_walkers: int
    effective_samples: Mapping[str, float]
    rhat: Mapping[str, float]
    noise: str
    resolution: float | None
    priors: Mapping[str, str] = field(default_factory=dict)
    states: Mapping[str, FloatArray] = field(default_factory=dict)
    acceptance: float
    n_evaluations: int
    seed: int
    warnings: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The sampled parameters, and sigma."""
        return tuple(self.samples)

    @property
    def table(self) -> FloatArray:
        """All draws, shape (n_draws * n_walkers, n_names)."""
        return np.column_stack([self.samples[name] for name in self.names])

    @property
    def mean(self) -> dict[str, float]:
        """Mean of each parameter."""
        return {name: float(draws.mean()) for name, draws in self.samples.items()}

    @property
    def median(self) -> dict[str, float]:
        """Median of each parameter."""
        return {name: float(np.median(draws)) for name, draws in self.samples.items()}

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters, shape (n_names, n_names), in the order of `names`."""
        return np.atleast_2d(np.cov(self.table, rowvar=False))

    def chains(self, name: str) -> FloatArray:
        """Draws of one parameter, shape (n_draws, n_walkers)."""
        return self.samples[name].reshape(-1, self.n_walkers)

    def interval(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Name to the central interval of probability `level`, with equal tails; ValueError unless 0 < level < 1."""
        tails = _tails(level)
        ends = {name: np.quantile(draws, tails).tolist() for name, draws in self.samples.items()}
        return {name: (low, high) for name, (low, high) in ends.items()}

    def predict(
        self, u: npt.ArrayLike, *, t: npt.ArrayLike | None = None, n: int = 400, level: float = 0.95, seed: int = 0
    ) -> Prediction:
        """Bands of the output, and of the loop width, for an input `u` (n_samples,) [unit of u].

        The model starts from the state that each draw has at the first sample of the first record. Models that depend
        on time need the times `t` (n_samples,) [s]. `n` is the number of draws, at most as many as there are, `level`
        the probability of the bands, and `seed` that of the choice of the draws and of the noise.
        """
        inputs, tails = read_only(u, "u", ndim=1), _tails(level)
        check_count("n", n)
        rng = np.random.default_rng(seed)
        total = len(self.samples["sigma"])
        chosen = rng.choice(total, min(n, total), replace=False)
        outputs, kept = _outputs(self, inputs, t, chosen)
        noise = density(self.noise, self.resolution)
        widths = max_widths(inputs, outputs)
        return Prediction(
            u=inputs,
            outputs=outputs,
            measured=noise.draw(outputs, self.samples["sigma"][kept], rng),
            level=tails[1] - tails[0],
            loop_width=_interval(widths, tails),
            widths=widths,
        )

    def to_csv(self) -> str:
        """All draws with every digit, one in a line, below the names."""
        return csv_text([self.names, *self.table.tolist()])

    def to_arviz(self) -> Any:
        """The draws as the installed arviz holds them: a DataTree, or InferenceData before arviz 1.0.

        Chains are walkers. Group ``posterior`` has the parameters, ``sample_stats`` ``lp``. ImportError without arviz.
        """
        posterior = {name: self.chains(name).T for name in self.names}
        stats = {"lp": self.log_density.reshape(-1, self.n_walkers).T}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # arviz 0.23 announces its successor once a day
            warnings.filterwarnings("ignore", "More chains")  # than draws: an ensemble may have many walkers
            arviz = optional("arviz", "a container of arviz", "bayes")
            if int(arviz.__version__.partition(".")[0]) < 1:
                return arviz.from_dict(posterior=posterior, sample_stats=stats)
            return arviz.from_dict({"posterior": posterior, "sample_stats": stats})

    def rows(self) -> list[dict[str, Any]]:
        """Name, median, lower and upper, mean, standard_deviation, effective_samples and rhat of each parameter."""
        ends, median = self.interval(), self.median
        return [
            {
                "name": name, "median": median[name], "lower": ends[name][0], "upper": ends[name][1],
                "mean": float(draws.mean()), "standard_deviation": float(draws.std(ddof=1)),
                "effective_samples": self.effective_samples[name], "rhat": self.rhat[name],
            }
            for name, draws in self.samples.items()
        ]  # fmt: skip

    def summary(self) -> str:
        """All parameters with median, interval, mean, standard deviation, effective samples and R-hat."""
        table = [["parameter", "median", "interval at 95 %", "mean", "deviation", "effective", "R-hat"]]
        for name, median, low, high, mean, deviation, effective, rhat in map(dict.values, self.rows()):
            values = f"{median:.5g}", f"{low:.5g} to {high:.5g}", f"{mean:.5g}", f"{deviation:.2g}"
            table.append([name, *values, f"{effective:.0f}", f"{rhat:.3f}"])
        lines = [self._head(), *aligned(table), *(f"  prior of {name}: {words}" for name, words in self.priors.items())]
        return "\n".join([*lines, *(["Warnings"] if self.warnings else []), *(f"  {each}" for each in self.warnings)])

    def __str__(self) -> str:
        ends = self.interval()
        values = [f"{name} {self.mean[name]:.4g} [{ends[name][0]:.4g}, {ends[name][1]:.4g}]" for name in self.names]
        moves = f"{100.0 * self.acceptance:.0f} % of the moves accepted"
        chains = f"{self.n_walkers} walkers, R-hat at most {max(self.rhat.values()):.3f}, {moves}"
        rows = {"chains": chains, "warnings": "; ".join(self.warnings)}
        return summary_text([self._head(), wrapped(values, most=5)], rows)

    def _head(self) -> str:
        fewest = min(self.effective_samples.values())
        size = f"{self.log_density.size} draws, {fewest:.0f} effective ones at least"
        return f"Posterior of {type(self.model).__name__}: {size}, {self.noise} noise"


def _outputs(draws: Posterior, u: FloatArray, t: npt.ArrayLike | None, chosen: Any) -> tuple[FloatArray, Any]:
    """Outputs of the chosen draws that stay finite, and which these are."""
    timed = needs_time(draws.model)
    if timed and t is None:
        raise ValueError(f"a {type(draws.model).__name__} depends on time: pass t=")
    further = (even_step(read_only(t, "t", ndim=1)),) if timed and t is not None else ()
    columns = {_own(name, draws.model): values for name, values in draws.samples.items() if name != "sigma"}
    columns |= dict(draws.states)
    rows, kept = [], []
    for k in chosen.tolist():
        law = draws.model.with_scalars({name: float(values[k]) for name, values in columns.items() if name})
        try:
            rows.append(law.response(u, *further))
        except SimulationError:
            continue
        kept.append(k)
    return np.array(rows).reshape(-1, u.size), kept


def _own(name: str, model: Any) -> str:
    """The model's name of a parameter; of a state of one record that of the first one, and empty for the others."""
    if name in model.scalars:
        return name
    base, _, record = name.rpartition("[")
    return base if record == "0]" else ""


def _interval(widths: FloatArray, tails: tuple[float, float]) -> Width | None:
    if not widths.size:
        return None
    low, middle, high = np.quantile(widths, [tails[0], 0.5, tails[1]]).tolist()
    return Width(value=middle, lower=low, upper=high)


def _band(rows: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    low, high = np.quantile(rows, _tails(level), axis=0)
    return low, high


def _tails(level: float) -> tuple[float, float]:
    if not 0.0 < level < 1.0:
        raise ValueError(f"level must be between 0 and 1, got {level}")
    return 0.5 * (1.0 - level), 0.5 * (1.0 + level)


@reports
def sample_posterior(
    fit: Identification,
    record_or_records: Record | Sequence[Record],
    *,
    noise: str | None = None,
    priors: Mapping[str, Any] | None = None,
    initial: str | Sequence[str] | None = None,
    samples: int = 10_000,
    walkers: int | None = None,
    most_steps: int = _MOST_STEPS,
    seed: int = 0,
    progress: Reports = None,
) -> Posterior:
    """Draw the free parameters of an identified model, and the scale of its noise, from their posterior distribution.

    The density of the parameters given the records is likelihood times prior. All parameters are sampled by emcee, the
    linear ones and sigma included; the likelihood of all walkers is computed at once.

    Parameters
    ----------
    fit : Identification
        Result of `hysim.identify`: its free parameters are sampled, the others are held.
    record_or_records : Record or sequence of Record
        The records that the model was identified from, in the same order.
    noise : {"gaussian", "quantised", "robust"}, optional
        As in `identify`; by default the fit's. Sigma is sampled. Rounded values have their interval's probability.
    priors : mapping, optional
        Name of a free parameter, or ``"sigma"``, to (low, high) or a frozen distribution of scipy.stats. (low, high) is
        flat in the coordinate of the search, which is the logarithm where the search has one; linear parameters are
        flat in themselves. A distribution is one of the parameter. By default coordinates are flat in the box of the
        search, and linear parameters flat within three spans of the output of what they add to it; bounds that were
        given to `identify` are ends of flat priors, and its weights hold.
    initial : str or sequence of str, optional
        As it was passed to `hysim.identify`; needed where it was ``"periodic"`` or ``"still"``.
    samples : int
        Number of effective samples of each parameter.
    walkers : int, optional
        Number of walkers, even; by default one for 25 samples, but at most 128, and at least four for each parameter.
    most_steps : int
        Steps of the walkers after which sampling ends in any case.
    seed : int
        The same seed gives the same draws to the last bit.
    progress : callable or False, optional
        Called as ``progress(done, total)`` with effective samples; see `hysim.simulate`.

    Returns
    -------
    Posterior

    Raises
    ------
    ValueError
        If the records are others than those of the fit, a name or an option is unknown, a parameter has no finite box
        and no prior, no parameters near the fit have a probability, or weights other than 0 and one more meet noise
        that is not normal.
    ImportError
        If emcee is not installed: ``pip install 'hysim[bayes]'``.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> fit = hs.identify(hs.Line, rec)
    >>> post = hs.sample_posterior(fit, rec, samples=200, walkers=16)
    >>> post.names
    ('offset', 'slope', 'sigma')
    >>> abs(post.mean["slope"] - fit.estimates["slope"]) < fit.stderr["slope"]
    True
    """
    if not isinstance(fit, Identification):
        raise TypeError(f"sample_posterior takes a result of hs.identify, got {fit!r}")
    records = several(record_or_records, "sample_posterior")
    for name, value in (("samples", samples), ("most_steps", most_steps)):
        check_count(name, value)
    own = given(priors or {})
    with one_blas_thread():
        posterior = posed(fit, records, noise, own, initial)
        n = walkers_of(posterior.n_dim, walkers, samples)
        chains = sampled(posterior, walkers=n, samples=samples, seed=seed, most_steps=most_steps, progress=progress)
        return described(fit, posterior, chains, samples, seed)


def posed(
    fit: Identification,
    records: Sequence[Record],
    noise: str | None,
    priors: Mapping[str, Given],
    initial: str | Sequence[str] | None,
    factor: float = 1.0,
) -> Target:
    """The posterior of a fit; `factor` enlarges the boxes."""
    quanta = {record.resolution for record in records}
    kind = density(noise or fit.noise, quanta.pop() if len(quanta) == 1 else None)
    names = {*fit.free_names, *(name.rpartition("[")[0] for name in fit.free_names)}
    limits = {name: pair for name, pair in fit.bounds.items() if name in fit.free_names}
    priors = {**given({name: pair for name, pair in limits.items() if np.isfinite(pair).all()}), **priors}
    bounds = {**limits, **{name: (prior.low, prior.high) for name, prior in priors.items() if name in names}}
    problem = again(fit, records, bounds, initial)
    if kind.name != "gaussian" and np.unique(fit.weights[fit.weights > 0.0]).size > 1:
        raise ValueError(f'samples of different weights are for noise="gaussian", got {kind.name!r}')
    check_names(problem, fit.free_names, priors)
    quantum = records[0].resolution if kind.name == "quantised" else None
    v_prior, b_prior = searched(problem, priors, quantum, factor), linear(problem, priors, factor)
    posterior = Target(problem.close(), kind, v_prior, b_prior)
    posterior.begin_at(optima(fit, problem, bounds, initial), fit.sigma)
    return posterior


def walkers_of(n_dim: int, walkers: int | None, samples: int) -> int:
    """Number of walkers; a ValueError for one that is odd, or less than twice the number of parameters."""
    if walkers is None:
        wanted = min(_WALKERS, samples // _SAMPLES_PER_WALKER)
        return max(wanted, _WALKERS_PER_DIMENSION * n_dim) // 2 * 2
    check_count("walkers", walkers)
    if walkers % 2 or walkers < 2 * n_dim:
        raise ValueError(f"walkers must be even, and at least {2 * n_dim} for {n_dim} parameters, got {walkers}")
    return walkers


def described(fit: Identification, posterior: Target, chains: Chains, samples: int, seed: int) -> Posterior:
    n_walkers = chains.q.shape[1]
    table = chains.parameters.reshape(-1, len(posterior.names))
    paths = {name: chains.parameters[..., k] for k, name in enumerate(posterior.names)}
    effective = {name: effective_samples(path) for name, path in paths.items()}
    rhat = {name: split_rhat(path) for name, path in paths.items()}
    return Posterior(
        model=fit.model,
        samples={name: read_only(table[:, k], finite=False) for k, name in enumerate(posterior.names)},
        log_density=chains.log_density.ravel(),
        n_walkers=n_walkers,
        effective_samples=effective,
        rhat=rhat,
        noise=posterior.noise.name,
        resolution=posterior.problem.parts[0].record.resolution,
        priors=posterior.priors_in_words(),
        states=_states(posterior.problem, chains.flat),
        acceptance=chains.acceptance,
        n_evaluations=posterior.evaluations,
        seed=seed,
        warnings=_warnings(effective, rhat, samples),
    )


def _states(problem: Problem, q: FloatArray) -> dict[str, FloatArray]:
    """States of the first record that follow from the parameters, as those of a periodic record."""
    if not (problem.parts[0].before and problem.own.state):
        return {}
    known = problem.parameters(q[:, : problem.n_x])
    names = [name for name in problem.own.state if name in known]
    return {name: read_only(np.broadcast_to(known[name], len(q)), finite=False) for name in names}


def _warnings(effective: Mapping[str, float], rhat: Mapping[str, float], samples: int) -> tuple[str, ...]:
    sentences = []
    apart = [name for name, value in rhat.items() if not value <= LARGEST_RHAT]
    if apart:
        advice = "do not use the intervals; pass a larger most_steps, or narrower priors"
        sentences.append(f"the walkers do not agree on {', '.join(apart)} (R-hat above {LARGEST_RHAT:g}): {advice}")
    fewest = min(effective.values())
    if fewest < samples:
        sentences.append(f"{fewest:.0f} effective samples in place of {samples}: pass a larger most_steps")
    return tuple(sentences)
