"""A mixture of Student's t distributions that is close to weighted points.

Its parts begin at some of the points, each with the shape of the points near it, and move by steps of expectation and
maximisation, which raise the mean of ln density over the points (O. Cappe and others, Stat. Comput. 18 (2008) 447, for
points that are draws with weights). Parts to which few points belong vanish. A wide part around all points is added.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hysim._frozen import FloatArray

FEWEST_EACH = 4
"""Points for each coordinate and one more: fewer shape no part."""

PARTS = 32
"""Parts of a mixture at first."""

_STEPS = 12  # of expectation and maximisation
_NEIGHBOURS = 0.02  # share of the points that shape a part at first
_WIDE = 0.1  # share of the part around all
_FREEDOM = 5  # at least
_NORMAL_SPREAD = 1.05  # of e: a little wider than the standard normal distribution
_RIDGE = 1e-12  # variance of a part in units of that of all points, at least
_TINY = 1e-300


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
        return np.asarray(np.log(self.densities(v)[0].sum(axis=1)))

    def densities(self, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Each part's share of the density of v, and the squared distance from its centre, (n_sets, n_parts)."""
        n_v, n_parts = v.shape[1], len(self.centres)
        inverse, offset, scale = self._prepared
        places = (v @ inverse - offset).reshape(len(v), n_v, n_parts)
        places *= places
        squares = places.sum(axis=1)
        return _power(1.0 / (1.0 + squares / self.freedom), (self.freedom + n_v) // 2) * scale, squares

    def beside(self, other: "Proposal", share_of_other: float) -> "Proposal":
        """This proposal with another one that has a small share."""
        share = np.concatenate([(1.0 - share_of_other) * self.share, share_of_other * other.share])
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


def mixture(v: FloatArray, weight: FloatArray, n_linear: int, rng: np.random.Generator, parts: int = PARTS) -> Proposal:
    """The proposal closest to points (n, n_v) with weights (n,), whose `parts` begin at some of the points."""
    weight = weight / weight.sum()
    mean = weight @ v
    covariance = _covariance(v - mean, weight)
    n_x, around = v.shape[1] - 1, np.asarray(np.linalg.cholesky(2.0 * covariance), dtype=np.float64)
    wide = Proposal(mean[np.newaxis], around[np.newaxis], np.ones(1), n_x, n_linear)
    chosen = rng.choice(len(v), parts, p=weight)
    share = np.full(parts, 1.0 / parts)
    closest = Proposal(v[chosen], _shapes(v[chosen], v, covariance), share, n_x, n_linear)
    for _ in range(_STEPS):
        closest = _closer(closest, v, weight, covariance)
    return closest.beside(wide, _WIDE)


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
    return Proposal(centres, roots, share / share.sum(), parts.n_x, parts.n_linear)


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
