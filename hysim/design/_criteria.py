"""One number of a Fisher information, and what it leaves undetermined."""

from typing import Literal

import numpy as np

from hysim._frozen import FloatArray

Criterion = Literal["D", "A", "E"]
_LEAST = 1e-12  # eigenvalue of an information of columns of length one, below which a direction is not determined
_TAKES_PART = 1e-3  # share of a number in such a direction, from which on it is not determined


def merit(matrix: FloatArray, criterion: Criterion) -> float:
    """Measure to maximise, a number that is proportional to the number of samples; zero if a direction is not seen.

    D is the root of the determinant, A the harmonic mean of the eigenvalues, E the smallest one.
    """
    size = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    if not (size > 0.0).all() or np.linalg.eigvalsh(matrix / np.outer(size, size))[0] < _LEAST:
        return 0.0
    if criterion == "D":
        return float(np.exp(np.linalg.slogdet(matrix)[1] / len(matrix)))
    if criterion == "A":
        return float(len(matrix) / np.trace(np.linalg.inv(matrix)))
    return float(np.linalg.eigvalsh(matrix)[0])


def spreads(matrix: FloatArray) -> FloatArray:
    """Standard errors (n_names,) of an information; infinite where it does not determine a number."""
    size = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    usable = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(usable, usable))
    seen = values > _LEAST
    variances = (vectors[:, seen] ** 2 / values[seen]).sum(axis=1)
    unseen = (np.abs(vectors[:, ~seen]) > _TAKES_PART).any(axis=1) | (size == 0.0)
    return np.asarray(np.where(unseen, np.inf, np.sqrt(variances) / usable))
