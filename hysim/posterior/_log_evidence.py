"""The evidence Z, the mean of the likelihood over the prior, by nested sampling or by bridge sampling.

**Nested sampling.** dynesty asks for one likelihood at a time. Here all walks for its next live points go on together,
each step one evaluation of many sets: `_Together` has the walks of ``rwalk``, `_Pool` hands it all starts at once.
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
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._basics.libraries import optional
from hysim.posterior._sampler import Chains, effective_samples, split_rhat
from hysim.posterior._target import Target

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

    walk = _together(dynesty.internal_samplers, log_likelihood)
    sampler = dynesty.NestedSampler(
        lambda point: float(log_likelihood(point[np.newaxis])[0]),
        lambda cube: cube,
        target.n_dim,
        nlive=live_points,
        bound="multi",
        sample=walk(ndim=target.n_dim, ncdim=target.n_dim, walks=_WALK * target.n_dim),
        pool=_Pool(walk, max(2, live_points // _QUEUE)),
        first_update={"min_ncall": 0, "min_eff": 100.0},
        rstate=np.random.default_rng(seed),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of plateaus, where laws diverge
        sampler.run_nested(dlogz=_REMAINS, print_progress=False)
    result = sampler.results
    return LogEvidence(float(result.logz[-1]), float(result.logzerr[-1]), target.evaluations - before)


def _together(samplers: Any, log_likelihood: Callable[[FloatArray], FloatArray]) -> Any:
    """The class of walks in lockstep under this likelihood, as a subclass of dynesty's random walk."""

    class Together(samplers.RWalkSampler):  # type: ignore[misc]
        @staticmethod
        def walk_all(arguments: list[Any]) -> list[Any]:
            return _walked(arguments, log_likelihood, samplers.SamplerReturn)

    return Together


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


class _Pool:
    """A pool in dynesty's sense that is one thread, and passes all starts of walks on at once."""

    def __init__(self, walk: Any, size: int) -> None:
        self.walk, self.size = walk, size

    def map(self, function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
        if function is self.walk.sample:
            return list(self.walk.walk_all(list(items)))
        return [function(item) for item in items]


_DRAWS = 20_000
_ROUNDS = 1000
_SETTLED = 1e-10
_LARGEST_RHAT = 1.2  # of the walkers' terms: beyond it ln Z is not found


def bridge_evidence(target: Target, chains: Chains, seed: int) -> LogEvidence:
    """ln Z from chains of the posterior, with the number of all sets that this target has simulated."""
    rng = np.random.default_rng(seed)
    drawn = chains.proposal.draw(_DRAWS, rng)
    of_posterior = chains.log_density.ravel() - chains.proposal.log_density(chains.flat)
    of_proposal = target.log_posterior(drawn) - chains.proposal.log_density(drawn)
    effective = min(effective_samples(chains.q[..., k]) for k in range(target.n_dim))
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
