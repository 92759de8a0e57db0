"""A proposal close to the posterior, with a density of its own.

The linear parameters are nearly independent of the rest in the coordinates of the target (`hysim.posterior._target`):
standard normal. What is left are v = (coordinates of the search, ln sigma), few numbers with a distribution that may be
bent and divided. It is followed from the prior to the posterior by a population of particles (sequential Monte Carlo:
P. Del Moral, A. Doucet and A. Jasra, J. R. Stat. Soc. B 68 (2006) 411): powers of the likelihood that rise from 0 to 1
such that half the particles stay effective each time, resampling, moves of differential evolution. The likelihood is
taken at the best linear parameters and multiplied by the volume around them, which is exact for normal noise.

The proposal is a mixture of Student's t distributions at some of the particles, each with the shape of the particles
near it, and of one around all. How narrow the parts are is chosen by their density at other particles.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.posterior._target import Target

_PARTICLES, _PARTICLES_EACH = 1024, 256  # at most, and for each number in v
_CENTRES, _CENTRES_EACH = 384, 64  # likewise
_FEWEST_EACH = 4  # distinct particles for each number in v and one more: fewer shape no mixture
_NEIGHBOURS = 0.02  # share of the particles that shape a part of the mixture
_WIDTHS = (0.1, 0.2, 0.4, 0.7, 1.0)  # of the parts, in units of that shape
_WIDE = 0.1  # share of the part around all
_FREEDOM = 5  # at least
_BLOCK = 64  # points whose distances to all parts stay in the processor's cache
_NORMAL_SPREAD = 1.05  # of e: a little wider than the standard normal distribution
_MOVES = 6  # of each particle between two looks at the mean of ln L
_LEVEL = 0.1  # rise of power times that mean in so many moves, from which on it counts as level
_MOST_LOOKS = 12  # at each power
_HALF = 0.5
_WHOLE = 0.15  # share of the moves by a whole difference
_EARLY = 0.6  # power of the likelihood whose particles shape some parts of the mixture
_EARLY_SHARE = 0.25  # of the mixture
_MOST_POWERS = 100
_RIDGE = 1e-9
_IMPROVING = 4  # draws that improve a proposal, for each particle
_ROUNDS = 3
_EVEN_ENOUGH = 0.5  # effective share of the draws


@dataclass(frozen=True)
class Proposal:
    """Mixture of t distributions for v, times independent normal ones for e."""

    centres: FloatArray  # (n_parts, n_v)
    roots: FloatArray  # (n_parts, n_v, n_v), lower triangles
    share: FloatArray  # (n_parts,), of each part
    n_x: int
    n_linear: int

    @property
    def freedom(self) -> int:
        """Degrees of freedom: 5 or 6, such that the exponent of the density is a whole number."""
        n_v: int = self.centres.shape[1]
        return _FREEDOM + (_FREEDOM + n_v) % 2

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Points (n, n_dim)."""
        part = rng.choice(self.share.size, n, p=self.share)
        heavy = np.sqrt(rng.chisquare(self.freedom, n) / self.freedom)[:, np.newaxis]
        normal = rng.standard_normal((n, self.centres.shape[1])) / heavy
        v = self.centres[part] + (self.roots[part] @ normal[..., np.newaxis])[..., 0]
        e = _NORMAL_SPREAD * rng.standard_normal((n, self.n_linear))
        return np.concatenate([v[:, : self.n_x], e, v[:, self.n_x :]], axis=1)

    def log_density(self, q: FloatArray) -> FloatArray:
        """Logarithm of the density at points (n_sets, n_dim), (n_sets,)."""
        v = np.concatenate([q[:, : self.n_x], q[:, -1:]], axis=1)
        e = q[:, self.n_x : -1] / _NORMAL_SPREAD
        constant = self.n_linear * (0.5 * math.log(2.0 * math.pi) + math.log(_NORMAL_SPREAD))
        return np.asarray(self.log_density_of_v(v) - 0.5 * np.sum(e**2, axis=1) - constant)

    def log_density_of_v(self, v: FloatArray) -> FloatArray:
        """Logarithm of the density of v alone, (n_sets,)."""
        blocks = [self._log_density_of_block(v[k : k + _BLOCK]) for k in range(0, len(v), _BLOCK)]
        return np.concatenate(blocks) if blocks else np.empty(0)

    def _log_density_of_block(self, v: FloatArray) -> FloatArray:
        n_v, n_parts = v.shape[1], len(self.centres)
        inverse, offset, scale = self._prepared
        places = (v @ inverse - offset).reshape(len(v), n_v, n_parts)
        places *= places
        parts: FloatArray = 1.0 / (1.0 + places.sum(axis=1) / self.freedom)
        return np.asarray(np.log(_power(parts, (self.freedom + n_v) // 2) @ scale))

    def beside(self, other: "Proposal") -> "Proposal":
        """This proposal with another one that has a small share."""
        share = np.concatenate([(1.0 - _EARLY_SHARE) * self.share, _EARLY_SHARE * other.share])
        centres, roots = np.concatenate([self.centres, other.centres]), np.concatenate([self.roots, other.roots])
        return Proposal(centres, roots, share, self.n_x, self.n_linear)

    @cached_property
    def _prepared(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Inverse roots side by side, a coordinate of all parts together; centres times these; factor of each part."""
        n_parts, n_v = self.centres.shape
        inverse: FloatArray = np.asarray(np.linalg.inv(self.roots), dtype=np.float64)
        ends = math.lgamma(0.5 * (self.freedom + n_v)) - math.lgamma(0.5 * self.freedom)
        constant = math.exp(ends - 0.5 * n_v * math.log(self.freedom * math.pi))
        scale = self.share * constant / np.abs(np.diagonal(self.roots, axis1=1, axis2=2)).prod(axis=1)
        columns = inverse.transpose(2, 1, 0).reshape(n_v, n_v * n_parts)
        return columns, np.einsum("pij,pj->ip", inverse, self.centres).ravel(), scale


def _power(base: FloatArray, exponent: int) -> FloatArray:
    """A whole power, by squares: faster than a general one."""
    if exponent == 1:
        return base
    root = _power(base, exponent // 2)
    return root * root * base if exponent % 2 else root * root


def mixture(v: FloatArray, n_linear: int, rng: np.random.Generator) -> Proposal:
    """The proposal that has the shape of particles (n, n_v), of which some may be there several times."""
    distinct, times = np.unique(v, axis=0, return_counts=True)
    order = rng.permutation(len(distinct))
    own, others = order[: min(_CENTRES, _CENTRES_EACH * v.shape[1], len(order) // 2)], order[len(order) // 2 :]
    covariance = _regular(np.atleast_2d(np.cov(v, rowvar=False)))
    centres = np.concatenate([distinct[own], v.mean(axis=0, keepdims=True)])
    shapes, wide = _shapes(distinct[own], distinct, covariance), np.linalg.cholesky(2.0 * covariance)[np.newaxis]
    share = np.append((1.0 - _WIDE) * times[own] / times[own].sum(), _WIDE)
    tried = [
        Proposal(centres, np.concatenate([width * shapes, wide]), share, v.shape[1] - 1, n_linear) for width in _WIDTHS
    ]
    return max(tried, key=lambda each: float(each.log_density_of_v(distinct[others]) @ times[others]))


def _shapes(centres: FloatArray, v: FloatArray, covariance: FloatArray) -> FloatArray:
    """Root of the covariance of the particles near each centre, (n_centres, n_v, n_v), by way of white coordinates."""
    root = np.linalg.cholesky(covariance)
    near, every = (np.linalg.solve(root, each.T).T for each in (centres, v))
    distances = np.sum(near**2, axis=1)[:, np.newaxis] - 2.0 * near @ every.T + np.sum(every**2, axis=1)
    count = min(len(v), max(int(_NEIGHBOURS * len(v)), 4 * v.shape[1] + 4))
    chosen = every[np.argpartition(distances, count - 1, axis=1)[:, :count]]
    off = chosen - chosen.mean(axis=1, keepdims=True)
    local = np.swapaxes(off, 1, 2) @ off / count
    return np.asarray(root @ np.linalg.cholesky(local + 1e-6 * np.eye(v.shape[1])))


def _regular(covariance: FloatArray) -> FloatArray:
    return covariance + np.diag(_RIDGE * np.diag(covariance) + 1e-300)


def proposal_for(target: Target, rng: np.random.Generator) -> tuple[Proposal, Proposal]:
    """The proposal that the particles shape, improved by draws from itself with weights until these are even enough.

    The second one reaches farther, and is a part of the first. Improvement ends where few draws have all the weight.
    """
    v, early = particles(target, rng)
    if min(_distinct(v), _distinct(early)) < _fewest(target):
        raise ValueError(
            f"the posterior was not found: {_distinct(v)} of {len(v)} draws from the priors are left beside the "
            "records; pass narrower priors"
        )
    reaching = mixture(early, target.n_linear, rng)
    proposal = mixture(v, target.n_linear, rng).beside(reaching)
    drawn, logs = np.empty((0, target.n_dim)), np.empty(0)
    best, best_share = proposal, 0.0
    for _ in range(_ROUNDS + 1):
        q = proposal.draw(_IMPROVING * len(v), rng)
        log_weight = target.log_posterior(q) - proposal.log_density(q)
        share = _even(log_weight)
        if share > best_share:
            best, best_share = proposal, share
        if share > _EVEN_ENOUGH:
            break
        weight = np.exp(log_weight - log_weight.max())
        drawn = np.concatenate([drawn, q])
        logs = np.concatenate([logs, weight / weight.sum() * share])
        chosen = target.without_linear(drawn[_resampled(logs / logs.sum(), rng, len(q))])
        if _distinct(chosen) < _fewest(target):
            break
        proposal = mixture(chosen, target.n_linear, rng).beside(reaching)
    return best, reaching


def _distinct(v: FloatArray) -> int:
    return len(np.unique(v, axis=0))


def _fewest(target: Target) -> int:
    """Number of distinct particles that can shape a mixture."""
    return _FEWEST_EACH * (target.n_x + 2)


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
            v, value, prior = _moved(target, v, value, prior, power, rng)
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


def _moved(
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
