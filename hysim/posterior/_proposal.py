"""A proposal close to the posterior, which is a mixture and has a density of its own.

The linear parameters are nearly independent of the rest in the coordinates of the target (`hysim.posterior._target`):
standard normal. What is left are v = (coordinates of the search, ln sigma), few numbers with a distribution that may be
bent and divided. It is followed from the prior to the posterior by a population of particles (sequential Monte Carlo:
P. Del Moral, A. Doucet and A. Jasra, J. R. Stat. Soc. B 68 (2006) 411): powers of the likelihood that rise from 0 to 1
such that half the particles stay effective each time, resampling, moves of differential evolution. The likelihood is
taken at the best linear parameters and multiplied by the volume around them, which is exact for normal noise.

A narrow optimum has a small share of the prior, and particles may miss it: those around the optima of the fit
stand beside them (`hysim.posterior._sampler`). A mixture is fitted to all, and anew to its own draws with their
weights, until these are even enough: what the particles got wrong, such as the shares of separate optima, weights put
right. What is thin and bent needs more parts than that, and the proposal grows.

**The mixture** is one of Student's t distributions that is close to weighted points. Its parts begin at some of the
points, each with the shape of the points near it, and move by steps of expectation and maximisation, which raise the
mean of ln density over the points (O. Cappe and others, Stat. Comput. 18 (2008) 447, for points that are draws with
weights). Parts to which few points belong vanish. A wide part around all points is added.

**Growth.** Draws of a proposal have weights, posterior density by proposal density. Where a weight is large the
proposal is too low: parts are added there, with the shape of the weighted points near by, and further points are drawn
from them. All points are then weighted anew by the mixture of everything that was drawn (incremental mixture importance
sampling: A. Raftery and L. Bao, Biometrics 66 (2010) 1162). Parts follow a bent ridge, one after another. The density
is that of v, with the linear parameters integrated out (`hysim.posterior._target`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.posterior._target import Target

FEWEST_EACH = 4
"""Points for each coordinate and one more: fewer shape no part. Chosen by hand."""

PARTS = 32
"""Parts of a mixture at first; chosen by hand."""

_STEPS = 12  # by hand: of expectation and maximisation
_NEIGHBOURS = 0.02  # by hand: share of the points that shape a part at first
_WIDE = 0.1  # by hand: share of the part around all
_FREEDOM = 5  # at least: tails heavier than those of a normal distribution, with a variance
_NORMAL_SPREAD = 1.05  # of e: a little wider than the standard normal distribution
_RIDGE = 1e-12  # variance of a part in units of that of all points, at least
_TINY = 1e-300


@dataclass(frozen=True)
class Proposal:
    """Mixture of t distributions for v, times independent normal ones for e."""

    centres: FloatArray  # (n_parts, n_v)
    roots: FloatArray  # (n_parts, n_v, n_v), lower triangles
    share: FloatArray  # (n_parts,), of each part
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
        return np.concatenate([v[:, :-1], e, v[:, -1:]], axis=1)

    def log_density(self, q: FloatArray) -> FloatArray:
        """Logarithm of the density at points (n_sets, n_dim), (n_sets,)."""
        x, e, s = np.split(q, [self.centres.shape[1] - 1, -1], axis=1)
        v, e = np.concatenate([x, s], axis=1), e / _NORMAL_SPREAD
        constant = self.n_linear * (0.5 * math.log(2.0 * math.pi) + math.log(_NORMAL_SPREAD))
        return np.asarray(self.log_density_of_v(v) - 0.5 * np.sum(e**2, axis=1) - constant)

    def log_density_of_v(self, v: FloatArray) -> FloatArray:
        """Logarithm of the density of v alone, (n_sets,)."""
        return np.asarray(np.log(self.densities(v)[0].sum(axis=1)))

    def densities(self, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Each part's share of the density of v, and the squared distance from its centre, (n_sets, n_parts)."""
        n_v, n_parts = v.shape[1], len(self.centres)
        inverse, offset, scale = self._prepared
        places = (v @ inverse - offset).reshape(len(v), n_v, n_parts)
        places *= places
        squares = places.sum(axis=1)
        return _whole_power(1.0 / (1.0 + squares / self.freedom), (self.freedom + n_v) // 2) * scale, squares

    def beside(self, other: "Proposal", share_of_other: float) -> "Proposal":
        return _together([(self, 1.0 - share_of_other), (other, share_of_other)], 1.0)

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


def _together(proposals: Sequence[tuple[Proposal, float]], total: float) -> Proposal:
    """The mixture of proposals, each with its part of the `total`."""
    share = np.concatenate([each.share * part / total for each, part in proposals])
    centres, roots = (np.concatenate(each) for each in zip(*((p.centres, p.roots) for p, _ in proposals), strict=True))
    return Proposal(centres, roots, share, proposals[0][0].n_linear)


def _whole_power(base: FloatArray, exponent: int) -> FloatArray:
    if exponent == 1:
        return base
    root = _whole_power(base, exponent // 2)
    return root * root * base if exponent % 2 else root * root


def mixture(v: FloatArray, weight: FloatArray, n_linear: int, rng: np.random.Generator, parts: int = PARTS) -> Proposal:
    """The proposal closest to points (n, n_v) with weights (n,), whose `parts` begin at some of the points."""
    weight = weight / weight.sum()
    mean = weight @ v
    covariance = _covariance(v - mean, weight)
    around = np.asarray(np.linalg.cholesky(2.0 * covariance), dtype=np.float64)
    wide = Proposal(mean[np.newaxis], around[np.newaxis], np.ones(1), n_linear)
    chosen = rng.choice(len(v), parts, p=weight)
    share = np.full(parts, 1.0 / parts)
    closest = Proposal(v[chosen], _shapes(v[chosen], v, covariance), share, n_linear)
    for _ in range(_STEPS):
        closest = _closer(closest, v, weight, covariance)
    return closest.beside(wide, _WIDE)


def even_mixture(v: FloatArray, target: Target, rng: np.random.Generator, parts: int = PARTS) -> Proposal:
    """The proposal closest to points of equal weights."""
    return mixture(v, np.ones(len(v)), target.n_linear, rng, parts)


def _closer(parts: Proposal, v: FloatArray, weight: FloatArray, covariance: FloatArray) -> Proposal:
    """One step of expectation and maximisation; parts of few points vanish."""
    density, squares = parts.densities(v)
    belongs = density * (weight / np.maximum(density.sum(axis=1), _TINY))[:, np.newaxis]
    near = belongs * (parts.freedom + v.shape[1]) / (parts.freedom + squares)
    share = belongs.sum(axis=0)
    kept = share > 0.0
    kept[kept] = share[kept] ** 2 > FEWEST_EACH * (v.shape[1] + 1) * (belongs[:, kept] ** 2).sum(axis=0)
    if not kept.any():
        return parts
    belongs, near, share = belongs[:, kept], near[:, kept], share[kept]
    centres = (near / near.sum(axis=0)).T @ v
    off = v[np.newaxis] - centres[:, np.newaxis]
    local = np.swapaxes(off, 1, 2) @ (off * near.T[..., np.newaxis]) / share[:, np.newaxis, np.newaxis]
    roots = _roots(local + _RIDGE * covariance, covariance)
    return Proposal(centres, roots, share / share.sum(), parts.n_linear)


def _roots(local: FloatArray, covariance: FloatArray) -> FloatArray:
    """Lower triangles of covariances (n_parts, n_v, n_v); those that rounding has made flat get the least variance."""
    try:
        return np.asarray(np.linalg.cholesky(local))
    except np.linalg.LinAlgError:
        root = np.linalg.cholesky(covariance)
        half = np.linalg.solve(root, local)
        size, axes = np.linalg.eigh(np.linalg.solve(root, np.swapaxes(half, 1, 2)))
        white = (axes * np.maximum(size, _RIDGE)[:, np.newaxis]) @ np.swapaxes(axes, 1, 2)
        return np.asarray(root @ np.linalg.cholesky(white))


def _shapes(centres: FloatArray, v: FloatArray, covariance: FloatArray) -> FloatArray:
    """Root of the covariance of the points near each centre, (n_centres, n_v, n_v), by way of white coordinates."""
    root = np.linalg.cholesky(covariance)
    near, every = (np.linalg.solve(root, each.T).T for each in (centres, v))
    distances = np.sum(near**2, axis=1)[:, np.newaxis] - 2.0 * near @ every.T + np.sum(every**2, axis=1)
    count = min(len(v), max(int(_NEIGHBOURS * len(v)), 4 * v.shape[1] + 4))
    chosen = every[np.argpartition(distances, count - 1, axis=1)[:, :count]]
    off = chosen - chosen.mean(axis=1, keepdims=True)
    local = np.swapaxes(off, 1, 2) @ off / count
    return np.asarray(root @ np.linalg.cholesky(local + _RIDGE * np.eye(v.shape[1])))


def _covariance(off: FloatArray, weight: FloatArray) -> FloatArray:
    covariance = off.T @ (off * weight[:, np.newaxis])
    return np.asarray(covariance + np.diag(_RIDGE * np.diag(covariance) + _TINY))


_FIRST = 4096  # by hand: points of the proposal that grows
_GROWTHS = 25  # by hand: rounds
_ADDED, _EACH = 8, 256  # by hand: parts of a round, and points that are drawn from each
_NEAR = 160  # by hand: points that shape a part
_EVENLY = 0.01  # by hand: share of the weights near a part that is spread evenly: no part is flat
_TRIED = 800  # by hand: points that may be centres, those of the largest weights
_COVERED = 0.3  # by hand: share of the points near a centre that are not centres any more
_LEAST_VARIANCE = 1e-10  # variance of a part in units of that of all points, at least
_LEAST_PRODUCT = 1e-14
_FITTED, _PARTS = 4096, 64  # by hand: points, drawn by their weights, that a mixture of so many parts is fitted to
_BESIDE = 0.3  # by hand: share of all parts beside that mixture


def grown(base: Proposal, target: Target, rng: np.random.Generator) -> tuple[Proposal, Proposal]:
    """`base` with the parts that grew, mixed with many parts fitted to the points; and the former alone."""
    v = target.without_linear(base.draw(_FIRST, rng))
    log_density = np.add(*target.marginal(v))
    added: list[Proposal] = []
    total = _FIRST * base.densities(v)[0].sum(axis=1)  # of densities times numbers of points
    for _ in range(_GROWTHS):
        new = _parts(v, _weights(log_density, total), target.n_linear)
        further = target.without_linear(new.draw(_EACH * len(new.centres), rng))
        total += _density(new, v)
        added.append(new)
        below = _FIRST * base.densities(further)[0].sum(axis=1) + sum(_density(each, further) for each in added)
        v, total = np.concatenate([v, further]), np.concatenate([total, below])
        log_density = np.concatenate([log_density, np.add(*target.marginal(further))])
    chosen = rng.choice(len(v), _FITTED, p=_weights(log_density, total))
    fitted = even_mixture(v[chosen], target, rng, _PARTS)
    every = _together([(base, _FIRST), *((each, _EACH * len(each.centres)) for each in added)], len(v))
    return fitted.beside(every, _BESIDE), every


def _density(parts: Proposal, v: FloatArray) -> FloatArray:
    return np.asarray(_EACH * len(parts.centres) * parts.densities(v)[0].sum(axis=1))


def _weights(log_density: FloatArray, total: FloatArray) -> FloatArray:
    log_weight = log_density - np.log(total)
    weight = np.exp(log_weight - log_weight.max())
    return np.asarray(weight / weight.sum())


def _parts(v: FloatArray, weight: FloatArray, n_linear: int) -> Proposal:
    """Parts at points of large weight that are not near one another."""
    mean = weight @ v
    covariance = (v - mean).T @ ((v - mean) * weight[:, np.newaxis])
    root = np.linalg.cholesky(covariance + np.diag(_LEAST_VARIANCE * np.diag(covariance) + _LEAST_PRODUCT))
    white = np.linalg.solve(root, v.T).T
    is_free, centres, roots = np.ones(len(v), dtype=bool), [], []
    for place in np.argsort(-weight)[:_TRIED]:
        if is_free[place]:
            off = white - white[place]
            squares = np.einsum("ij,ij->i", off, off)
            near = np.argpartition(squares, _NEAR)[:_NEAR]
            is_free[near[squares[near] < np.quantile(squares[near], _COVERED)]] = False
            share = (1.0 - _EVENLY) * weight[near] / weight[near].sum() + _EVENLY / _NEAR
            local = off[near].T @ (off[near] * share[:, np.newaxis])
            centres.append(v[place])
            roots.append(root @ np.linalg.cholesky(local + _LEAST_VARIANCE * np.eye(len(mean))))
        if len(centres) == _ADDED:
            break
    even = np.full(len(centres), 1.0 / len(centres))
    return Proposal(np.array(centres), np.array(roots), even, n_linear)


_PARTICLES, _PARTICLES_EACH = 1024, 256  # by hand: at most, and for each number in v
_MOVES = 6  # by hand: of each particle between two looks at the mean of ln L
_LEVEL = 0.1  # by hand: rise of power times that mean in so many moves, from which on it counts as level
_MOST_LOOKS = 12  # by hand: at each power
_HALF = 0.5  # of the particles stay effective at each power, the usual share of sequential Monte Carlo
_WHOLE = 0.15  # by hand: share of the moves by a whole difference, which go from one optimum to another
_EARLY = 0.6  # by hand: power of the likelihood whose particles shape some parts of the mixture
EARLY_SHARE = 0.2  # by hand: of the mixture
_MOST_POWERS = 100  # by hand: an end where rounding would go on for ever
_IMPROVING = 4  # by hand: draws that improve a proposal, for each particle
_ROUNDS = 3  # by hand: of improvement
_EVEN_ENOUGH = 0.45  # by hand: effective share of the draws, from which on a further round gains little
POOR, GOOD = 0.1, 0.6
"""Effective shares of the draws of a proposal: below them it grows, for few samples and for many. Chosen by hand."""


def proposal_for(
    target: Target, near: FloatArray, rng: np.random.Generator, least: float = POOR
) -> tuple[Proposal, Proposal]:
    """The proposal that the particles, and those `near` optima, shape, improved by draws from itself with weights.

    The second one reaches farther, and is a part of the first. Improvement ends where few draws have all the weight. A
    proposal whose effective share is below `least` grows.
    """
    population = particles(target, rng)
    v, early = (np.concatenate([each, near]) for each in population)
    if min(_distinct(v), _distinct(early)) < _fewest(target):
        numbers = f"{_distinct(v)} of {len(v)} draws from the priors agree with the records"
        raise ValueError(f"the posterior was not found: {numbers}; pass narrower priors")
    reaching = even_mixture(early, target, rng)
    proposal = even_mixture(v, target, rng).beside(reaching, EARLY_SHARE)
    drawn, weights = np.empty((0, target.n_x + 1)), np.empty(0)
    best, best_share = proposal, 0.0
    for _ in range(_ROUNDS + 1):
        q = proposal.draw(_IMPROVING * len(population[0]), rng)
        log_weight = target.log_posterior(q) - proposal.log_density(q)
        share = _effective_share(log_weight)
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


def _distinct(v: FloatArray) -> int:
    return len(np.unique(v, axis=0))


def _fewest(target: Target) -> int:
    return FEWEST_EACH * (target.n_x + 2)


def _effective_share(log_weight: FloatArray) -> float:
    weight = np.exp(log_weight - log_weight.max())
    return float(weight.sum() ** 2 / (weight**2).sum() / weight.size)


def particles(target: Target, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Particles (n, n_v) of about the posterior of v, and those at a lower power, which reach farther."""
    v = target.prior_draws(min(_PARTICLES, _PARTICLES_EACH * (target.n_x + 1)), rng)
    value, prior = target.marginal(v)
    power, early = 0.0, np.empty((0, v.shape[1]))
    for _ in range(_MOST_POWERS):
        step = _next_power(value, 1.0 - power)
        power += step
        weight = np.exp(step * (value - value.max()))
        places = (np.arange(len(v)) + rng.random()) / len(v)
        chosen = np.minimum(np.searchsorted(np.cumsum(weight / weight.sum()), places), len(v) - 1)
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

    if _effective_share(most * value) >= _HALF:
        return most
    low, high = 0.0, most
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _effective_share(middle * value) >= _HALF else (low, middle)
    return max(high, 1e-12)


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
