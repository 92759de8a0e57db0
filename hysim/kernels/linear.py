"""States of a linear plant under an input that is linear on each piece of a step.

    x <- A x + B0 v + B1 v',    v and v' the input at the begin and the end of the piece

A step has one piece, or two where a delay cuts it. All matrices are exact: exponentials, made outside.
"""

import numpy as np

from hysim._frozen import FloatArray
from hysim.kernels._compile import kernel


@kernel
def states(
    A: FloatArray, B0: FloatArray, B1: FloatArray, begin: FloatArray, end: FloatArray, x0: FloatArray, out: FloatArray
) -> None:
    """States at the begin of every step and after the last, of many plants.

    `A` is (n_sets, n_pieces, n, n), `B0` and `B1` (n_sets, n_pieces, n), `begin` and `end` (n_steps, n_pieces),
    `x0` (n_sets, n), `out` (n_sets, n_steps + 1, n).
    """
    n_sets, n_pieces, n = B0.shape
    previous = np.empty(n)
    for i in range(n_sets):
        for j in range(n):
            out[i, 0, j] = x0[i, j]
        for k in range(begin.shape[0]):
            target = out[i, k + 1]
            target[:] = out[i, k]
            for piece in range(n_pieces):
                previous[:] = target
                for row in range(n):
                    total = B0[i, piece, row] * begin[k, piece] + B1[i, piece, row] * end[k, piece]
                    for column in range(n):
                        total += A[i, piece, row, column] * previous[column]
                    target[row] = total
