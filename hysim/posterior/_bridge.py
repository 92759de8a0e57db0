"""The evidence from draws of the posterior by bridge sampling.

With draws q of the posterior p L / Z and draws of a proposal g, whose density is known,

    Z = E_g[h p L] / E_post[h g],    h = 1 / (n_1 p L / Z + n_2 g),

solved for Z by iteration (X.-L. Meng and W. H. Wong, Stat. Sinica 6 (1996) 831). The proposal is the one with which the
chains were drawn (`hysim.posterior._proposal`): it follows bent and divided posteriors, and does not depend on these
draws. The error is that of S. Fruehwirth-Schnatter (Econom. J. 7 (2004) 143), with the effective number of draws; it
is infinite where the walkers' paths do not agree.
"""

import math

import numpy as np

from hysim._frozen import FloatArray
from hysim.posterior._chains import effective_samples, split_rhat
from hysim.posterior._nested import LogEvidence
from hysim.posterior._sampler import Chains
from hysim.posterior._target import Target

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
