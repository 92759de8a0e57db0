"""The best subsets of the columns of a linear least-squares problem, by sweeping columns out.

    minimise ||r + J (x' - x)||^2 over x' that are zero where a column is left out

With C = (J^T J)^-1 and the optimum of all columns, leaving out column j costs x_j^2 / C_jj, moves the others by
-C_j x_j / C_jj, and turns C into C - C_j C_j^T / C_jj. The subsets of each size follow from those of one more column;
of each size the `width` cheapest are followed, which with WIDTH are all up to 12 columns. A chain of sweeps adds small
positive costs, so that nothing cancels where the residual is rounding.

Source: G. M. Furnival and R. W. Wilson, Regressions by leaps and bounds, Technometrics 16 (1974) 499.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray

WIDTH = 924  # the subsets of 6 of 12 columns
_RIDGE = 1e-12  # on steps of columns of unit size: sweeps stay exact to 1e-4 where columns depend on each other

_LEAST = 0.5  # C of columns of unit size has diagonals of 1 and more, but for rounding


class Subsets(NamedTuple):
    """Subsets of one size: columns included (n_subsets, n), optima (n_subsets, n), zero elsewhere, and costs."""

    included: npt.NDArray[np.bool_]
    x: FloatArray
    cost: FloatArray


def best_subsets(
    jacobian: FloatArray,
    residual: FloatArray,
    x: FloatArray,
    removable: npt.NDArray[np.bool_],
    *,
    width: int = WIDTH,
) -> Iterator[Subsets]:
    """The `width` best subsets of each size, from all columns down to those that are not `removable` (n,).

    `jacobian` (n_samples, n) and `residual` (n_samples,) are those at `x` (n,).
    """
    sizes = np.linalg.norm(jacobian, axis=0)
    sizes[sizes == 0.0] = 1.0
    ridge = np.sqrt(_RIDGE) * np.eye(x.size)
    basis, triangle = np.linalg.qr(np.vstack([jacobian / sizes, ridge]))
    root = np.linalg.solve(triangle, np.eye(x.size))
    C = root @ root.T
    step = -root @ (basis[: residual.size].T @ residual)
    rest = residual + jacobian @ (step / sizes)
    included, best = np.ones((1, x.size), dtype=bool), (x * sizes + step)[np.newaxis]
    cost, C = np.array([float(rest @ rest)]), C[np.newaxis]
    while True:
        yield Subsets(included, best / sizes, cost)
        diagonal = np.maximum(np.diagonal(C, axis1=1, axis2=2), _LEAST)
        losses = np.where(included & removable, best**2 / diagonal, np.inf)
        parents, columns = _cheapest(included, cost[:, np.newaxis] + losses, width)
        if not parents.size:
            return
        here, rows = np.arange(parents.size), C[parents, columns]
        pivot = diagonal[parents, columns][:, np.newaxis]
        cost = cost[parents] + losses[parents, columns]
        best = best[parents] - rows * (best[parents, columns][:, np.newaxis] / pivot)
        C = C[parents] - rows[:, :, np.newaxis] * (rows / pivot)[:, np.newaxis, :]
        included = included[parents]
        included[here, columns] = False
        best[~included] = 0.0
        C[here, columns], C[here, :, columns] = 0.0, 0.0


def _cheapest(
    included: npt.NDArray[np.bool_], costs: FloatArray, width: int
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Parents and columns whose removal leaves the `width` cheapest different subsets, cheapest first."""
    parents, columns = np.nonzero(np.isfinite(costs))
    codes = (1 << np.arange(included.shape[1]))[::-1]
    subsets = included[parents] @ codes - codes[columns]
    order = np.lexsort((subsets, costs[parents, columns]))
    first = np.sort(np.unique(subsets[order], return_index=True)[1])[:width]
    return parents[order][first], columns[order][first]
