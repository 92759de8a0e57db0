"""How often does `compare` call two models different that predict equally well?

Errors of two models are drawn with the same distribution: first-order autoregressive noise, normal or with heavy tails
(t, 2 degrees of freedom), each alone or with white noise that both share. Or the second model's absolute errors differ
from the first one's by such noise directly. `python experiments/equal_models.py` prints the share of pairs whose
probability is below 5 %, and the power: the share of pairs that differ by half that are called different.
"""

import numpy as np
from scipy.signal import lfilter

from hysim.comparison._verdict import LEVEL, probability

PAIRS = 1500
SAMPLES = 52, 200, 1000
CORRELATIONS = 0.0, 0.5, 0.9, 0.95


def noise(rng: np.random.Generator, n: int, correlation: float, heavy: bool, pairs: int) -> np.ndarray:
    """Autoregressive noise (pairs, n)."""
    shape = pairs, n + 300
    white = rng.standard_t(2, shape) if heavy else rng.standard_normal(shape)
    return np.asarray(lfilter([1.0], [1.0, -correlation], white, axis=1)[:, 300:])


def share(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the pairs (n_pairs, n) that are called different [%]."""
    return 100.0 * float(np.mean([probability(*pair) < LEVEL for pair in zip(a, b, strict=True)]))


def main(pairs: int = PAIRS) -> list[dict[str, float]]:
    """Count, print and return the shares."""
    rows = []
    for heavy in (False, True):
        for correlation in CORRELATIONS:
            for n in SAMPLES:
                rng = np.random.default_rng(0)
                a, b = (noise(rng, n, correlation, heavy, pairs) for _ in range(2))
                white = rng.standard_normal(a.shape)
                level = 1e4 * float(np.median(np.abs(a)))
                rows.append(
                    {
                        "heavy tails": float(heavy),
                        "correlation": correlation,
                        "samples": float(n),
                        "alone": share(a, b),
                        "shared noise": share(a + white, b + white),
                        "difference": share(level + 1e3 * a, np.full(a.shape, level)),
                        "power": share(1.5 * a, b),
                    }
                )
                print({name: round(value, 2) for name, value in rows[-1].items()}, flush=True)
    return rows


if __name__ == "__main__":
    main()
