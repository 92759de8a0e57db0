"""The verb `compare_evidence`, and its result.

The evidence Z is the mean of the likelihood over the prior, by nested sampling or by bridge sampling.

**Nested sampling.** dynesty asks for one likelihood at a time. Here all walks for its next live points go on together,
each step one evaluation of many sets: `_Pool` gets all starts of ``rwalk`` at once, and walks in its place.
Sources: J. Skilling, Bayesian Anal. 1 (2006) 833; J. S. Speagle, Mon. Not. R. Astron. Soc. 493 (2020) 3132.

**Bridge sampling.** With draws q of the posterior p L / Z and draws of a proposal g, whose density is known,

    Z = E_g[h p L] / E_post[h g],    h = 1 / (n_1 p L / Z + n_2 g),

solved for Z by iteration (X.-L. Meng and W. H. Wong, Stat. Sinica 6 (1996) 831). The proposal is the one with which the
chains were drawn (`hysim.posterior._proposal`): it follows bent and divided posteriors, and does not depend on these
draws. The error is that of S. Fruehwirth-Schnatter (Econom. J. 7 (2004) 143), with the effective number of draws; it
is infinite where the walkers' paths do not agree.
"""

import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.blas import one_blas_thread
from hysim._basics.frozen import FloatArray, check_choice, check_count, frozen
from hysim._basics.libraries import optional
from hysim._basics.names import among
from hysim._basics.printing import aligned, frozen_result, listed, summary_text
from hysim._basics.progress import Reports, reports
from hysim.identification import Identification, identify
from hysim.posterior._sample import posed, walkers_of
from hysim.posterior._sampler import Chains, effective_samples, fewest_effective, sampled, split_rhat
from hysim.posterior._target import Target, given
from hysim.records import Record, several

_WALK = 40  # steps for each parameter: with 25 in all, ln Z of a bent posterior in five was 4 to 5 too low
_QUEUE = 5  # share of the live points that are replaced together: one in so many
_REMAINS = 0.01  # of ln Z: what may be missing at the end
_LOWEST = -1e300  # ln L of a set that has diverged


class LogEvidence(NamedTuple):
    """ln Z and its standard error, and the number of sets that were simulated."""

    value: float
    error: float
    evaluations: int


def nested_evidence(target: Target, live_points: int, seed: int) -> LogEvidence:
    """ln Z from so many live points; its error falls with the root of their number."""
    dynesty = optional("dynesty", "nested sampling", "bayes")
    if live_points <= 2 * target.n_dim:
        least = 2 * target.n_dim + 1
        raise ValueError(f"live_points must be at least {least} for {target.n_dim} parameters, got {live_points}")
    before = target.evaluations

    def log_likelihood(cube: FloatArray) -> FloatArray:
        return np.maximum(np.nan_to_num(target.log_likelihood_in_cube(cube), nan=_LOWEST), _LOWEST)

    samplers = dynesty.internal_samplers
    sampler = dynesty.NestedSampler(
        lambda point: float(log_likelihood(point[np.newaxis])[0]),
        lambda cube: cube,
        target.n_dim,
        nlive=live_points,
        bound="multi",
        sample=samplers.RWalkSampler(ndim=target.n_dim, ncdim=target.n_dim, walks=_WALK * target.n_dim),
        pool=_Pool(samplers, log_likelihood, max(2, live_points // _QUEUE)),
        first_update={"min_ncall": 0, "min_eff": 100.0},
        rstate=np.random.default_rng(seed),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of plateaus, where laws diverge
        sampler.run_nested(dlogz=_REMAINS, print_progress=False)
    result = sampler.results
    return LogEvidence(float(result.logz[-1]), float(result.logzerr[-1]), target.evaluations - before)


def _walked(arguments: list[Any], log_likelihood: Callable[[FloatArray], FloatArray], result: Any) -> list[Any]:
    """Each start after its walk: steps in a ball shaped by the bound's axes, those below ln L* refused."""
    u = np.array([each.u for each in arguments])
    axes = np.array([each.scale * each.axes for each in arguments])
    least = np.array([each.loglstar for each in arguments])
    steps, n = arguments[0].kwargs["walks"], u.shape[1]
    rng = np.random.default_rng([int(np.random.default_rng(each.rseed).integers(2**63)) for each in arguments[:1]])
    values, accepted = np.full(len(u), np.nan), np.zeros(len(u), dtype=int)
    for _ in range(steps):
        normal = rng.standard_normal(u.shape)
        radius = rng.random((len(u), 1)) ** (1.0 / n) / np.linalg.norm(normal, axis=1, keepdims=True)
        trial = u + (axes @ (radius * normal)[..., np.newaxis])[..., 0]
        places = np.flatnonzero(((trial > 0.0) & (trial < 1.0)).all(axis=1))
        if not places.size:
            continue
        reached = log_likelihood(trial[places])
        better = reached > least[places]
        replaced = places[better]
        u[replaced], values[replaced] = trial[replaced], reached[better]
        accepted[replaced] += 1
    unmoved = np.flatnonzero(accepted == 0)
    if unmoved.size:
        values[unmoved] = log_likelihood(u[unmoved])
    return [
        result(
            u=point,
            v=point.copy(),
            logl=value,
            ncalls=steps,
            tuning_info={"accept": count, "reject": steps - count, "scale": each.scale},
            evaluation_history=[],
            proposal_stats={"n_accept": count, "n_reject": steps - count},
        )
        for point, value, count, each in zip(u, values.tolist(), accepted.tolist(), arguments, strict=True)
    ]


class _Pool(NamedTuple):
    """A pool in dynesty's sense that is one thread, and walks from all starts at once."""

    samplers: Any
    log_likelihood: Callable[[FloatArray], FloatArray]
    size: int

    def map(self, function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
        if function is self.samplers.RWalkSampler.sample:
            return _walked(list(items), self.log_likelihood, self.samplers.SamplerReturn)
        return [function(item) for item in items]


_DRAWS = 20_000
_ROUNDS = 1000
_SETTLED = 1e-10
_LARGEST_RHAT = 1.2  # of the walkers' terms: beyond it ln Z is not found


def bridge_evidence(target: Target, chains: Chains, seed: int) -> LogEvidence:
    """ln Z from chains of the posterior, with the number of all sets that this target has simulated."""
    drawn = chains.proposal.draw(_DRAWS, np.random.default_rng(seed))
    of_posterior = chains.log_density.ravel() - chains.proposal.log_density(chains.flat)
    of_proposal = target.log_posterior(drawn) - chains.proposal.log_density(drawn)
    effective = fewest_effective(chains.q)
    log_z = _iterated(of_posterior, of_proposal, effective)
    posterior_share = effective / (effective + _DRAWS)
    error = _error(of_posterior - log_z, of_proposal - log_z, posterior_share, chains.log_density.shape)
    return LogEvidence(log_z, error, target.evaluations)


def _iterated(of_posterior: FloatArray, of_proposal: FloatArray, effective: float) -> float:
    """ln Z from ln(p L / g) at draws of the posterior and of the proposal."""
    from scipy.special import logsumexp

    share = math.log(effective / (effective + _DRAWS)), math.log(_DRAWS / (effective + _DRAWS))
    log_z = float(np.median(of_posterior))
    for _ in range(_ROUNDS):
        above = of_proposal - np.logaddexp(share[0] + of_proposal - log_z, share[1])
        below = -np.logaddexp(share[0] + of_posterior - log_z, share[1])
        last, log_z = log_z, float(logsumexp(above) - math.log(above.size) - logsumexp(below) + math.log(below.size))
        if abs(log_z - last) < _SETTLED:
            break
    return log_z


def _error(of_posterior: FloatArray, of_proposal: FloatArray, share: float, shape: tuple[int, ...]) -> float:
    """Standard error of ln Z; arguments are ln(p L / (Z g)). Infinite where walkers do not agree."""
    with np.errstate(over="ignore"):
        above = 1.0 / (share + (1.0 - share) * np.exp(-of_proposal))
        below = 1.0 / (share * np.exp(of_posterior) + 1.0 - share)
    paths = below.reshape(shape)
    if not split_rhat(paths) <= _LARGEST_RHAT:
        return math.inf
    independent = min(effective_samples(paths), float(below.size))
    variance = above.var() / above.mean() ** 2 / above.size + below.var() / below.mean() ** 2 / independent
    return float(np.sqrt(variance))


FACTORS = (0.5, 1.0, 2.0)
"""Sizes of the boxes of the priors, in units of the boxes of the search."""

DECIDED = 3.0
"""Odds from which on a model is preferred: "positive" evidence (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995)."""

_ERRORS = 2.0  # standard errors of a difference by which the odds must be above that
_EFFECTIVE = 2_000  # effective ones, for bridge sampling
_STEPS = 6_000  # at most: with fewer draws the error is larger, and says so


@frozen
class EvidenceRow:
    """Evidence of one model.

    Parameters
    ----------
    name : str
        Name of the model.
    n_parameters : int
        Free parameters, without sigma.
    fit_percent : float
        Of the identified model [%].
    log_evidence, error : tuple of float
        ln Z with the boxes of the priors halved, as they are, and doubled, and their standard errors; an error is
        infinite where bridge sampling has not found ln Z.
    n_evaluations : int
        Number of parameter sets that were simulated.
    """

    name: str
    n_parameters: int
    fit_percent: float
    log_evidence: tuple[float, ...]
    error: tuple[float, ...]
    n_evaluations: int


@frozen_result
class Evidence:
    """Evidences of models on the same records, and which model the data prefer.

    Parameters
    ----------
    rows : tuple of EvidenceRow
        One for each model, the largest evidence with the boxes of the search first.
    factors : tuple of float
        Sizes of the boxes in which the evidences were computed, in units of the boxes of the search.
    noise : {"gaussian", "quantised", "robust"}
    method : {"nested", "bridge"}
    seed : int
        Seed of the draws.
    """

    rows: tuple[EvidenceRow, ...]
    factors: tuple[float, ...] = FACTORS
    noise: str
    method: str
    seed: int = 0

    def __getitem__(self, name: str) -> EvidenceRow:
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(f"no model is called {name!r}; the models are {', '.join(row.name for row in self.rows)}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the models, the most probable first."""
        return tuple(row.name for row in self.rows)

    def probabilities(self, factor: float = 1.0) -> dict[str, float]:
        """Posterior probability of each model with boxes of this size, if all are equally probable before."""
        place = self.factors.index(factor)
        logs = np.array([row.log_evidence[place] for row in self.rows])
        share = np.exp(logs - logs.max())
        return dict(zip(self.names, (share / share.sum()).tolist(), strict=True))

    def odds(self, name: str, other: str) -> float:
        """Least odds of a model against another one, over the sizes of the boxes."""
        return math.exp(min(np.subtract(self[name].log_evidence, self[other].log_evidence).tolist()))

    @property
    def best(self) -> tuple[str, ...]:
        """Most probable model for each size of the boxes."""
        columns = np.array([row.log_evidence for row in self.rows])
        return tuple(self.names[k] for k in columns.argmax(axis=0).tolist())

    @property
    def undecided(self) -> tuple[str, ...]:
        """Models that are the most probable one, or not surely less probable than 1 : 3, for some size of the boxes."""
        values = np.array([row.log_evidence for row in self.rows])
        errors = np.array([row.error for row in self.rows])
        top = values.argmax(axis=0)
        behind = values.max(axis=0) - values
        reach = math.log(DECIDED) + _ERRORS * np.hypot(errors, errors[top, np.arange(top.size)])
        near = (behind <= np.where(behind == 0.0, 0.0, reach)).any(axis=1)
        return tuple(name for name, is_near in zip(self.names, near.tolist(), strict=True) if is_near)

    @property
    def sentence(self) -> str:
        """Which model the data prefer, in words; a preference holds with the boxes halved and doubled too."""
        near = self.undecided
        others = [name for name in self.names if name not in near]
        if len(near) == 1:
            if not others:
                return f"{_quoted(near[0])} is the only model"
            odds = min(self.odds(near[0], other) for other in others)
            return f"the data prefer {_quoted(near[0])}, odds {_rounded(odds)} : 1, with every box"
        return f"the data do not decide between {listed([*map(_quoted, near)])}: {self._reason}{self._behind(others)}"

    @property
    def _reason(self) -> str:
        lost = [_quoted(row.name) for row in self.rows if not np.isfinite(row.error).all()]
        if lost:
            return f"the evidence of {listed(lost)} was not found"
        return "it depends on the boxes" if len(set(self.best)) > 1 else "their odds are too near to 1 : 1"

    def _behind(self, others: Sequence[str]) -> str:
        if not others:
            return ""
        values = np.array([row.log_evidence for row in self.rows])
        least = float(np.min(values.max(axis=0) - [self[name].log_evidence for name in others]))
        return f"; each other model has odds of 1 : {_rounded(math.exp(least))} or less, with every box"

    def summary(self) -> str:
        """A table of all models, and the sentence."""
        probable = self.probabilities()
        boxes = [f"ln Z, boxes x {factor:g}" for factor in self.factors]
        table = [["model", "parameters", "fit [%]", *boxes, "probability"]]
        for row in self.rows:
            logs = (f"{value:.2f} +- {error:.2f}" for value, error in zip(row.log_evidence, row.error, strict=True))
            share = f"{probable[row.name]:.2g}"
            table.append([row.name, str(row.n_parameters), f"{row.fit_percent:.2f}", *logs, share])
        return "\n".join([self._head(), *aligned(table), self.sentence])

    def __str__(self) -> str:
        probable = self.probabilities()
        place = self.factors.index(1.0)
        rows = {
            row.name: f"ln Z {row.log_evidence[place]:.2f} +- {row.error[place]:.2f}, "
            f"probability {probable[row.name]:.2g}"
            for row in self.rows[:6]
        }
        return summary_text([self._head(), f"  {self.sentence}"], rows)

    def _head(self) -> str:
        return f"Evidence of {len(self.rows)} models, {self.noise} noise, by {self.method} sampling"


@reports
def compare_evidence(
    models: Mapping[str, Any],
    record_or_records: Record | Sequence[Record],
    *,
    noise: str = "gaussian",
    priors: Mapping[str, Mapping[str, Any]] | None = None,
    initial: str | Sequence[str] | None = None,
    method: str = "bridge",
    live_points: int = 500,
    seed: int = 0,
    progress: Reports = None,
) -> Evidence:
    """Compare models by their evidence, the probability of the records under each model and its priors.

    The evidence Z is the mean of the likelihood over the prior: a model with parameters that the records do not need
    spreads its prior over what was not measured, and loses. It depends on the boxes of the priors. So it is computed
    with all boxes halved about their centres, as they are, and doubled, and a model is preferred only if it is in all
    three. The prior of sigma is common to all models, and stays.

    Parameters
    ----------
    models : mapping
        Name to a model class, a model or a structure, which is identified first, or to a result of `hysim.identify` on
        the same records.
    record_or_records : Record or sequence of Record
        The records that all models are to explain.
    noise : {"gaussian", "quantised", "robust"}
        As in `hysim.identify`.
    priors : mapping, optional
        Name of a model to its priors, as in `hysim.sample_posterior`. A distribution is not halved nor doubled.
    initial : str or sequence of str, optional
        As in `hysim.identify`, for all models.
    method : {"bridge", "nested"}
        Bridge sampling from draws of emcee, or nested sampling by dynesty, which shares nothing with it but the
        likelihood, and takes 10 to 30 times as long for a larger error. Bridge sampling ends after 6000 steps of its
        walkers: where they do not agree by then, the error is infinite, and `Evidence.sentence` says so.
    live_points : int
        Of nested sampling: the error of ln Z falls with the root of their number.
    seed : int
        The same seed gives the same evidences to the last bit.
    progress : callable or False, optional
        Called as ``progress(done, total)`` after each evidence; see `hysim.simulate`.

    Returns
    -------
    Evidence

    Raises
    ------
    ValueError, ImportError
        If there is no model, an option is unknown, or a prior does not fit (see `hysim.sample_posterior`); if dynesty
        or emcee is not installed: ``pip install 'hysim[bayes]'``.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> at_zero = hs.identify(hs.Line, rec, fixed={"offset": 0.0})
    >>> result = hs.compare_evidence({"through zero": at_zero}, rec)
    >>> result.sentence
    'through zero is the only model'
    """
    records = several(record_or_records, "compare_evidence")
    if not models:
        raise ValueError("compare_evidence takes at least one model: {name: model}")
    if unknown := [name for name in priors or {} if name not in models]:
        known = among(unknown[0], models)
        raise ValueError(f"priors are for {unknown[0]!r}, which is no model here: there are {known}")
    fits = {name: _fitted(model, records, noise, initial) for name, model in models.items()}
    evidence = partial(log_evidence, noise=noise, initial=initial, method=method, live_points=live_points, seed=seed)
    rows = list[EvidenceRow]()
    for name, fit in fits.items():
        results = list[LogEvidence]()
        for factor in FACTORS:
            results.append(evidence(fit, records, priors=(priors or {}).get(name), factor=factor))
            if progress:
                progress(len(FACTORS) * len(rows) + len(results), len(FACTORS) * len(fits))
        log_z, error, evaluations = zip(*results, strict=True)
        quality: dict[str, Any] = {"n_parameters": fit.n_parameters, "fit_percent": fit.fit_percent}
        rows.append(EvidenceRow(name=name, log_evidence=log_z, error=error, n_evaluations=sum(evaluations), **quality))
    rows.sort(key=lambda row: -row.log_evidence[FACTORS.index(1.0)])
    return Evidence(rows=tuple(rows), noise=noise, method=method, seed=seed)


def log_evidence(
    fit: Identification,
    record_or_records: Record | Sequence[Record],
    *,
    noise: str | None = None,
    priors: Mapping[str, Any] | None = None,
    initial: str | Sequence[str] | None = None,
    factor: float = 1.0,
    method: str = "nested",
    live_points: int = 500,
    seed: int = 0,
) -> LogEvidence:
    """ln Z of one fit with boxes enlarged by `factor`; arguments as of `compare_evidence`, `priors` of this model."""
    records = several(record_or_records, "log_evidence")
    check_choice("method", method, ("nested", "bridge"))
    check_count("live_points", live_points)
    with one_blas_thread():
        posterior = posed(fit, records, noise, given(priors or {}), initial, factor)
        if method == "nested":
            return nested_evidence(posterior, live_points, seed)
        walkers = walkers_of(posterior.n_dim, None, _EFFECTIVE)
        chains = sampled(posterior, walkers=walkers, samples=_EFFECTIVE, seed=seed, most_steps=_STEPS)
        return bridge_evidence(posterior, chains, seed)


def _fitted(model: Any, records: Sequence[Record], noise: str, initial: str | Sequence[str] | None) -> Identification:
    if isinstance(model, Identification):
        return model
    return identify(model, records if len(records) > 1 else records[0], noise=noise, initial=initial, admissible=False)


def _quoted(name: str) -> str:
    return f'"{name}"' if "," in name else name


def _rounded(odds: float) -> str:
    return f"{odds:.2g}" if not 10.0 <= odds < 1e4 else f"{odds:.0f}"
