"""The verb `sample_posterior`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hysim._blas import one_blas_thread
from hysim._frozen import FloatArray, check_count
from hysim._progress import Reports, reports
from hysim.identification import Identification
from hysim.identification.likelihood.densities import density
from hysim.identification.likelihood.refit import Problem, again, optima
from hysim.posterior._chains import effective_samples, split_rhat
from hysim.posterior._priors import Given, check_names, given
from hysim.posterior._result import LARGEST_RHAT, Posterior
from hysim.posterior._sampler import Chains, sampled
from hysim.posterior._target import Target, target
from hysim.records import Record, several

_WALKERS, _WALKERS_PER_DIMENSION = 128, 4  # at most, and at least
_SAMPLES_PER_WALKER = 25  # effective ones: of shorter paths R-hat is large by chance
_MOST_STEPS = 100_000


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
        As in `hysim.identify`; by default that of the fit. Its sigma is sampled. Rounded values have the probability of
        their interval.
    priors : mapping, optional
        Name of a free parameter, or ``"sigma"``, to (low, high) or a frozen distribution of scipy.stats. (low, high) is
        flat in the coordinate of the search, which is the logarithm where the search has one; linear parameters are
        flat in themselves. A distribution is one of the parameter. By default coordinates are flat in the box of the
        search, and linear parameters flat within three spans of the output of what they add to it.
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
        Called as ``progress(done, total)`` with effective samples.
        By default calls beyond 2 s report on the standard error; False turns this off.

    Returns
    -------
    Posterior

    Raises
    ------
    ValueError
        If the records are others than those of the fit, a name or an option is unknown, a parameter has no finite box
        and no prior, or no parameters near the fit have a probability.
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
    records = several(record_or_records, "sample_posterior")
    for name, value in (("samples", samples), ("most_steps", most_steps)):
        check_count(name, value)
    own = given(priors or {})
    with one_blas_thread():
        posterior = posed(fit, records, noise, own, initial)
        number = walkers_of(posterior.n_dim, walkers, samples)
        chains = sampled(
            posterior,
            walkers=number,
            samples=samples,
            seed=seed,
            most_steps=most_steps,
            progress=progress or None,
        )
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
    bounds = {name: (prior.low, prior.high) for name, prior in priors.items() if name in names}
    problem = again(fit, records, bounds, initial)
    check_names(problem, fit.free_names, priors)
    posterior = target(problem, kind, priors, records[0].resolution, factor)
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
    """The result."""
    n_walkers = chains.q.shape[1]
    table = chains.parameters.reshape(-1, len(posterior.names))
    paths = {name: chains.parameters[..., k] for k, name in enumerate(posterior.names)}
    effective = {name: effective_samples(path) for name, path in paths.items()}
    rhat = {name: split_rhat(path) for name, path in paths.items()}
    return Posterior(
        model=fit.model,
        samples={name: _read_only(table[:, k]) for k, name in enumerate(posterior.names)},
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


def _read_only(values: FloatArray) -> FloatArray:
    column = np.ascontiguousarray(values)
    column.setflags(write=False)
    return column


def _states(problem: Problem, q: FloatArray) -> dict[str, FloatArray]:
    """States of the first record that follow from the parameters, as those of a periodic record."""
    if not (problem.parts[0].before and problem.own.state):
        return {}
    known = problem.parameters(q[:, : problem.n_x])
    return {name: _read_only(np.broadcast_to(known[name], len(q))) for name in problem.own.state if name in known}


def _warnings(effective: Mapping[str, float], rhat: Mapping[str, float], samples: int) -> tuple[str, ...]:
    sentences = []
    apart = [name for name, value in rhat.items() if not value <= LARGEST_RHAT]
    if apart:
        sentences.append(
            f"the walkers do not agree on {', '.join(apart)} (R-hat above {LARGEST_RHAT:g}): do not use the intervals; "
            "pass a larger most_steps, or narrower priors"
        )
    fewest = min(effective.values())
    if fewest < samples:
        sentences.append(f"{fewest:.0f} effective samples in place of {samples}: pass a larger most_steps")
    return tuple(sentences)
