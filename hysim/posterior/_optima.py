"""Particles around the optima that `identify` has found.

A population from the prior may miss a narrow optimum, whose share of the prior is small and whose share of the
posterior is not. So a small population begins at distances of all sizes from each optimum, the likely of these points
survive, and moves of differential evolution spread them: they take the shape of the population whatever its scales.
"""

import numpy as np

from hysim._frozen import FloatArray
from hysim.posterior._proposal import moved
from hysim.posterior._target import Target

_MOST = 3  # optima, the best first
_EACH = 48  # particles of a population
_SIZES = (1e-6, 0.1)  # of the distances
_BEGUN = 8  # points for each particle
_FARTHEST = 3.0  # from the centre of the box, in which an optimum at a side begins
_SPREADING, _KEPT, _APART = 80, 6, 8  # moves, populations that are kept, and moves between these


def around_optima(target: Target, rng: np.random.Generator) -> FloatArray:
    """Particles (n, n_v) around the best optima of the fit."""
    populations = [_spread(target, start, rng) for start in target.optima[:_MOST]]
    return np.concatenate([np.empty((0, target.n_x + 1)), *populations])


def _spread(target: Target, start: FloatArray, rng: np.random.Generator) -> FloatArray:
    shortest, longest = np.log(_SIZES).tolist()
    sizes = np.exp(rng.uniform(shortest, longest, (_BEGUN * _EACH, 1)))
    v = np.clip(start, -_FARTHEST, _FARTHEST) + sizes * rng.standard_normal((len(sizes), start.size))
    value, prior = target.marginal(v)
    likely = np.argsort(-(value + prior + rng.gumbel(size=len(v))))[:_EACH]
    v, value, prior = v[likely], value[likely], prior[likely]
    kept = []
    for k in range(_SPREADING + _KEPT * _APART):
        v, value, prior = moved(target, v, value, prior, 1.0, rng)
        if k >= _SPREADING and (k - _SPREADING) % _APART == 0:
            kept.append(v)
    return np.concatenate(kept)
