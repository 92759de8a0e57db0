"""Records whose law is known, for the tests of `discover`."""

import itertools
from collections.abc import Callable

import numpy as np

import hysim as hs

LAW = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3)
TRUTH = {"u'": 1.0, "u' |z|": -0.3, "|u'| z": -0.6}

DAHL = {"u'": 1.0, "|u'| y": -1.0}
COLEMAN_HODGDON = {"u'": 0.345, "|u'| u": 3.1635, "|u'| y": -1.0}
QUADRATIC = {"u'": 1.0, "u' y^2": -0.2, "|u'| u": 0.3, "|u'| y": -0.7}


def zigzag(*corners: float, per_branch: int = 30) -> np.ndarray:
    """Straight branches from corner to corner."""
    pieces = [np.linspace(a, b, per_branch)[1:] for a, b in itertools.pairwise(corners)]
    return np.concatenate([corners[:1], *pieces])


CYCLES = zigzag(0.0, 2.0, -2.0, 1.5, -1.0, 2.0, -2.0, 1.0)


def multisine(n_samples: int = 300, amplitude: float = 2.0) -> np.ndarray:
    """Four sines of fixed phases."""
    t = np.linspace(0.0, 1.0, n_samples)
    phases = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, 4)
    u = sum(np.sin(2.0 * np.pi * k * t + phase) for k, phase in zip((1, 2, 3, 5), phases, strict=True))
    return amplitude * u / np.abs(u).max()


def record_of(
    response: Callable[[np.ndarray], np.ndarray], u: np.ndarray | None = None, *, noise: float = 0.0, seed: int = 0
) -> hs.Record:
    """The response with noise of this share of its standard deviation."""
    u = multisine() if u is None else u
    y = response(u)
    return hs.Record(u=u, y=y + noise * y.std() * np.random.default_rng(seed).standard_normal(u.size))


def duhem(terms: dict[str, float]) -> Callable[[np.ndarray], np.ndarray]:
    """The response of a Duhem law."""
    return hs.Duhem.from_terms(terms).response
