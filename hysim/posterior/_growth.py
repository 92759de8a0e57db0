"""A proposal that grows where it is too low, for posteriors that are thin and bent.

Draws of a proposal have weights, posterior density by proposal density. Where a weight is large the proposal is too
low: parts are added there, with the shape of the weighted points near by, and further points are drawn from them. All
points are then weighted anew by the mixture of everything that was drawn (incremental mixture importance sampling:
A. Raftery and L. Bao, Biometrics 66 (2010) 1162). Parts follow a bent ridge, one after another.

The density is that of v, with the linear parameters integrated out (`hysim.posterior._target`).
"""

import numpy as np

from hysim._frozen import FloatArray
from hysim.posterior._mixture import Proposal, mixture
from hysim.posterior._target import Target

_FIRST = 4096  # points of the proposal that grows
_ROUNDS = 25
_ADDED, _EACH = 8, 256  # parts of a round, and points that are drawn from each
_NEAR = 160  # points that shape a part
_EVENLY = 0.01  # share of the weights near a part that is spread evenly: no part is flat
_TRIED = 800  # points that may be centres, those of the largest weights
_COVERED = 0.3  # share of the points near a centre that are not centres any more
_RIDGE = 1e-10  # variance of a part in units of that of all points, at least
_TINY = 1e-14
_FITTED, _PARTS = 4096, 64  # points, drawn by their weights, that a mixture of so many parts is fitted to
_BESIDE = 0.3  # share of all parts beside that mixture


def grown(base: Proposal, target: Target, rng: np.random.Generator) -> tuple[Proposal, Proposal]:
    """A mixture of many parts fitted to the points, beside `base` with the parts that grew; and the latter alone."""
    v = target.without_linear(base.draw(_FIRST, rng))
    log_density = _log_density(target, v)
    added: list[Proposal] = []
    total = _FIRST * base.densities(v)[0].sum(axis=1)  # of densities times numbers of points
    for _ in range(_ROUNDS):
        new = _parts(v, _weights(log_density, total), base)
        further = target.without_linear(new.draw(_EACH * len(new.centres), rng))
        total += _density(new, v)
        added.append(new)
        below = _FIRST * base.densities(further)[0].sum(axis=1) + sum(_density(each, further) for each in added)
        v, total = np.concatenate([v, further]), np.concatenate([total, below])
        log_density = np.concatenate([log_density, _log_density(target, further)])
    chosen = rng.choice(len(v), _FITTED, p=_weights(log_density, total))
    fitted = mixture(v[chosen], np.ones(_FITTED), target.n_linear, rng, parts=_PARTS)
    every = _together(base, added, len(v))
    return fitted.beside(every, _BESIDE), every


def _log_density(target: Target, v: FloatArray) -> FloatArray:
    value, prior = target.marginal(v)
    return value + prior


def _density(parts: Proposal, v: FloatArray) -> FloatArray:
    """Density times the number of points that were drawn."""
    return np.asarray(_EACH * len(parts.centres) * parts.densities(v)[0].sum(axis=1))


def _weights(log_density: FloatArray, total: FloatArray) -> FloatArray:
    log_weight = log_density - np.log(total)
    weight = np.exp(log_weight - log_weight.max())
    return np.asarray(weight / weight.sum())


def _parts(v: FloatArray, weight: FloatArray, base: Proposal) -> Proposal:
    """Parts at points of large weight that are not near one another."""
    mean = weight @ v
    covariance = (v - mean).T @ ((v - mean) * weight[:, np.newaxis])
    root = np.linalg.cholesky(covariance + np.diag(_RIDGE * np.diag(covariance) + _TINY))
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
            roots.append(root @ np.linalg.cholesky(local + _RIDGE * np.eye(len(mean))))
        if len(centres) == _ADDED:
            break
    even = np.full(len(centres), 1.0 / len(centres))
    return Proposal(np.array(centres), np.array(roots), even, base.n_x, base.n_linear)


def _together(base: Proposal, added: list[Proposal], n: int) -> Proposal:
    """The mixture from which `n` points were drawn, in all."""
    every = [(base, _FIRST), *((each, _EACH * len(each.centres)) for each in added)]
    return Proposal(
        np.concatenate([each.centres for each, _ in every]),
        np.concatenate([each.roots for each, _ in every]),
        np.concatenate([each.share * count / n for each, count in every]),
        base.n_x,
        base.n_linear,
    )
