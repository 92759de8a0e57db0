"""How much a record would tell of the numbers of a law: its Fisher information, and one number of it."""

from typing import Any, Literal

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.law import Law

Criterion = Literal["D", "A", "E"]
_DIFFERENCE = 1e-4  # of a number, or of one where that is smaller: both errors of a central difference are near 1e-8
_LEAST = 1e-12  # eigenvalue of an information of columns of length one, below which a direction is not determined


def sizes_of(law: Law, names: tuple[str, ...]) -> FloatArray:
    """Units in which numbers are judged: their sizes, one for zeros."""
    values = np.array([law.scalars[name] for name in names])
    return np.where(values == 0.0, 1.0, np.abs(values))


def information(law: Law, names: tuple[str, ...], u: FloatArray, noise: float) -> FloatArray:
    """Information on the numbers in units of their sizes, (n_names, n_names), by central differences."""
    steps = _DIFFERENCE * sizes_of(law, names)
    own: dict[str, Any] = {name: np.full(2 * len(names), law.scalars[name]) for name in names}
    for k, name in enumerate(names):
        own[name][2 * k] += steps[k]
        own[name][2 * k + 1] -= steps[k]
    outputs = law.outputs(own, u)
    with np.errstate(invalid="ignore"):
        slopes = (outputs[0::2] - outputs[1::2]) / (2.0 * _DIFFERENCE * noise)
    return np.asarray(slopes @ slopes.T) if np.isfinite(slopes).all() else np.zeros((len(names),) * 2)


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
