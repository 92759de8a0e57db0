"""A proposal close to the posterior, which is a mixture (`hysim.posterior._mixture`) and has a density of its own.

The linear parameters are nearly independent of the rest in the coordinates of the target (`hysim.posterior._target`):
standard normal. What is left are v = (coordinates of the search, ln sigma), few numbers with a distribution that may be
bent and divided. It is followed from the prior to the posterior by a population of particles (sequential Monte Carlo:
P. Del Moral, A. Doucet and A. Jasra, J. R. Stat. Soc. B 68 (2006) 411): powers of the likelihood that rise from 0 to 1
such that half the particles stay effective each time, resampling, moves of differential evolution. The likelihood is
taken at the best linear parameters and multiplied by the volume around them, which is exact for normal noise.

A narrow optimum has a small share of the prior, and particles may miss it: those around the optima of the fit
(`hysim.posterior._optima`) stand beside them. A mixture is fitted to all, and anew to its own draws with their weights,
until these are even enough: what the particles got wrong, such as the shares of separate optima, weights put right.
What is thin and bent needs more parts than that (`hysim.posterior._growth`).
"""

import math

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.posterior._growth import grown
from hysim.posterior._mixture import FEWEST_EACH, Proposal, mixture
from hysim.posterior._target import Target

_PARTICLES, _PARTICLES_EACH = 1024, 256  # at most, and for each number in v
_MOVES = 6  # of each particle between two looks at the mean of ln L
_LEVEL = 0.1  # rise of power times that mean in so many moves, from which on it counts as level
_MOST_LOOKS = 12  # at each power
_HALF = 0.5
_WHOLE = 0.15  # share of the moves by a whole difference
_EARLY = 0.6  # power of the likelihood whose particles shape some parts of the mixture
EARLY_SHARE = 0.2  # of the mixture
_MOST_POWERS = 100
_IMPROVING = 4  # draws that improve a proposal, for each particle
_ROUNDS = 3
_EVEN_ENOUGH = 0.45  # effective share of the draws
POOR, GOOD = 0.1, 0.6
"""Effective shares of the draws of a proposal: below them it grows, for few samples and for many."""


def proposal_for(
    target: Target, near: FloatArray, rng: np.random.Generator, least: float = POOR
) -> tuple[Proposal, Proposal]:
    """The proposal that the particles, and those `near` optima, shape, improved by draws from itself with weights.

    The second one reaches farther, and is a part of the first. Improvement ends where few draws have all the weight. A
    proposal whose effective share is below `least` grows (`hysim.posterior._growth`).
    """
    population = particles(target, rng)
    v, early = (np.concatenate([each, near]) for each in population)
    if min(_distinct(v), _distinct(early)) < _fewest(target):
        raise ValueError(
            f"the posterior was not found: {_distinct(v)} of {len(v)} draws from the priors are left beside the "
            "records; pass narrower priors"
        )
    reaching = _of(early, target, rng)
    proposal = _of(v, target, rng).beside(reaching, EARLY_SHARE)
    drawn, weights = np.empty((0, target.n_x + 1)), np.empty(0)
    best, best_share = proposal, 0.0
    for _ in range(_ROUNDS + 1):
        q = proposal.draw(_IMPROVING * len(population[0]), rng)
        log_weight = target.log_posterior(q) - proposal.log_density(q)
        share = _even(log_weight)
        if share > best_share:
            best, best_share = proposal, share
        if share > _EVEN_ENOUGH:
            break
        weight = np.exp(log_weight - log_weight.max())
        drawn = np.concatenate([drawn, target.without_linear(q)])
        weights = np.concatenate([weights, weight / weight.sum() * share])
        if weights.sum() ** 2 < _fewest(target) * (weights**2).sum():
            break
        proposal = mixture(drawn, weights, target.n_linear, rng).beside(reaching, EARLY_SHARE)
    return (best, reaching) if best_share > least else grown(best, target, rng)


def _of(v: FloatArray, target: Target, rng: np.random.Generator) -> Proposal:
    return mixture(v, np.ones(len(v)), target.n_linear, rng)


def _distinct(v: FloatArray) -> int:
    return len(np.unique(v, axis=0))


def _fewest(target: Target) -> int:
    """Number of distinct particles that can shape a mixture."""
    return FEWEST_EACH * (target.n_x + 2)


def _even(log_weight: FloatArray) -> float:
    """Effective share of weights: one where all are equal."""
    weight = np.exp(log_weight - log_weight.max())
    return float(weight.sum() ** 2 / (weight**2).sum() / weight.size)


def particles(target: Target, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Particles (n, n_v) of about the posterior of v, drawn from the prior, and those at a lower power on the way.

    The latter reach farther: parts of the proposal with their shape keep the weights of rare draws bounded.
    """
    v = target.prior_draws(min(_PARTICLES, _PARTICLES_EACH * (target.n_x + 1)), rng)
    value, prior = target.marginal(v)
    power, early = 0.0, np.empty((0, v.shape[1]))
    for _ in range(_MOST_POWERS):
        step = _next_power(value, 1.0 - power)
        power += step
        weight = np.exp(step * (value - value.max()))
        chosen = _resampled(weight / weight.sum(), rng, len(v))
        v, value, prior = v[chosen], value[chosen], prior[chosen]
        v, value, prior = _settled(target, v, value, prior, power, rng)
        early = v if power <= _EARLY or not early.size else early
        if power >= 1.0:
            break
    return v, early


def _settled(
    target: Target, v: FloatArray, value: FloatArray, prior: FloatArray, power: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """All particles after moves that have brought their mean likelihood to its level at this power."""
    for _ in range(_MOST_LOOKS):
        before = float(value.mean())
        for _ in range(_MOVES):
            v, value, prior = moved(target, v, value, prior, power, rng)
        if power * (float(value.mean()) - before) < _LEVEL:
            break
    return v, value, prior


def _next_power(value: FloatArray, most: float) -> float:
    """Step of the power that leaves half the particles effective, by bisection."""

    if _even(most * value) >= _HALF:
        return most
    low, high = 0.0, most
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _even(middle * value) >= _HALF else (low, middle)
    return max(high, 1e-12)


def _resampled(weight: FloatArray, rng: np.random.Generator, n: int) -> npt.NDArray[np.intp]:
    """Places of `n` draws with these weights, whose sum is one."""
    places = (np.arange(n) + rng.random()) / n
    return np.minimum(np.searchsorted(np.cumsum(weight), places), weight.size - 1)


def moved(
    target: Target, v: FloatArray, value: FloatArray, prior: FloatArray, power: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """One move of differential evolution of all particles, each half by the differences of the other."""
    n, n_v = v.shape
    v, value, prior = v.copy(), value.copy(), prior.copy()
    order = rng.permutation(n)
    for own, other in ((order[: n // 2], order[n // 2 :]), (order[n // 2 :], order[: n // 2])):
        first, second = rng.integers(other.size, size=(2, own.size))
        scale = 2.38 / math.sqrt(2.0 * n_v) * rng.uniform(0.4, 1.1, own.size)
        scale = np.where(rng.random(own.size) < _WHOLE, 1.0, scale)
        trial = v[own] + scale[:, np.newaxis] * (v[other[first]] - v[other[second]])
        trial += 1e-6 * rng.standard_normal(trial.shape)
        new_value, new_prior = target.marginal(trial)
        gain = power * (new_value - value[own]) + new_prior - prior[own]
        taken = np.log(rng.random(own.size)) < gain
        v[own[taken]], value[own[taken]], prior[own[taken]] = trial[taken], new_value[taken], new_prior[taken]
    return v, value, prior
