"""Least squares for many small sets at once: the shortest solution b of min || C b - t ||, columns of C of length one.

For few columns by singular values. For many by the triangle of [C t] = Q R, which costs a fraction of that; where it
is nearly singular, by its singular values.
"""

from dataclasses import dataclass

import numpy as np

from hysim._frozen import FloatArray

_RANK = 1e-11  # singular values of the normalised columns below this are taken as zero
_MANY = 8  # columns from which on a triangle costs clearly less
_WELL = 1e9  # norm of an inverse below which no singular value is near `_RANK`


@dataclass(frozen=True)
class Settled:
    """Rows that stand for the samples of each record from `first` on.

    A sum of plays forgets what was before its record once the input has moved far enough. From there on the columns C
    and the target t of the regression are the same for every set of parameters. With [C t] = Q R, the triangle R stands
    for all of these samples: || C b - t || = || R [b, -1] || for all b, to rounding.

    `columns` are (n_rows, n_linear), `target` (n_rows,), `names` those of the linear parameters, and `scale` is the
    size of all outputs. Weights are taken into account.
    """

    first: tuple[int, ...]
    names: tuple[str, ...]
    columns: FloatArray
    target: FloatArray
    scale: float


def triangle(columns: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Columns (n_sets, n_rows, n_linear) and target (n_sets, n_rows) of the same regression with few rows.

    There is one row more than there are columns: the last one holds what no parameters explain.
    """
    both = np.asarray(np.linalg.qr(np.concatenate([columns, target[..., np.newaxis]], axis=2), mode="r"))
    return both[..., :-1], both[..., -1]


def least_squares(columns: FloatArray, target: FloatArray) -> FloatArray:
    """Solutions (n_sets, n_linear) for columns (n_sets, n_samples, n_linear) and targets (n_sets, n_samples)."""
    return (_by_triangle if columns.shape[2] >= _MANY else _by_singular_values)(columns, target)


def _by_singular_values(columns: FloatArray, target: FloatArray) -> FloatArray:
    """`least_squares` by singular values."""
    basis, singular, right = np.linalg.svd(columns, full_matrices=False)
    inverse = np.where(singular > _RANK, 1.0 / np.maximum(singular, _RANK), 0.0)
    projected = inverse[..., np.newaxis] * (basis.transpose(0, 2, 1) @ target[..., np.newaxis])
    return np.asarray((right.transpose(0, 2, 1) @ projected)[..., 0])


def _by_triangle(columns: FloatArray, target: FloatArray) -> FloatArray:
    """`least_squares` by triangles, where they have full rank."""
    rows, goal = triangle(columns, target)
    n = columns.shape[2]
    solutions = np.empty((len(columns), n))
    is_well = np.zeros(len(columns), dtype=bool)
    if rows.shape[1] >= n:
        is_well = np.abs(np.diagonal(rows, axis1=1, axis2=2)).min(axis=1) > 1.0 / _WELL
        inverse = np.linalg.inv(rows[is_well, :n])
        solutions[is_well] = (inverse @ goal[is_well, :n, np.newaxis])[..., 0]
        is_well[is_well] = np.linalg.norm(inverse, axis=(1, 2)) < _WELL
    solutions[~is_well] = _by_singular_values(rows[~is_well], goal[~is_well])
    return solutions
