"""States of a linear plant under an input that is linear on each piece of a step.

    x <- A x + B0 v + B1 v',    v and v' the input at the begin and the end of the piece

A step has one piece, or two where a delay cuts it. The matrices are exact: blocks of the exponential of

    [[F, g, 0], [0, 0, 1], [0, 0, 0]]    for x' = F x + g v in time counted in pieces,

which holds A = exp(F) beside the responses B0 + B1 to a held input and B1 to one that rises from zero to
one (C. Van Loan, IEEE Trans. Automat. Control 23, 1978).
"""

import math

import numpy as np

from hysim._frozen import FloatArray
from hysim.kernels._compile import kernel

_N_TERMS = 15  # 0.5^16 / 16! is below the rounding of one


@kernel
def exponentials(matrices: FloatArray, out: FloatArray) -> None:
    """Exponentials of `matrices`, (n_matrices, m, m), into `out`.

    D = exp(M / 2^k) - 1 by its Taylor series, then k times D <- 2 D + D^2: without the one, slow modes keep
    their digits beside fast ones. A matrix that is not finite gives nan, one that overflows infinities or nan.
    """
    m = matrices.shape[1]
    product = np.empty((m, m))
    for i in range(len(matrices)):
        norm = np.abs(matrices[i]).sum()
        if not norm < math.inf:
            out[i] = math.nan
            continue
        squarings = max(0, math.ceil(math.log2(norm)) + 1) if norm > 0.0 else 0
        scaled = matrices[i] * 0.5**squarings
        less_one = out[i]
        less_one[:] = 0.0
        for k in range(_N_TERMS, 0, -1):
            multiply(scaled, less_one, product)
            less_one[:] = (scaled + product) / k
        for _ in range(squarings):
            multiply(less_one, less_one, product)
            less_one[:] = 2.0 * less_one + product
        for row in range(m):
            less_one[row, row] += 1.0


@kernel
def multiply(left: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Product of two small square matrices; calling BLAS for them costs more than the product."""
    m = len(left)
    for row in range(m):
        for column in range(m):
            total = 0.0
            for k in range(m):
                total += left[row, k] * right[k, column]
            out[row, column] = total


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
        out[i, 0] = x0[i]
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


@kernel
def free_responses(step: FloatArray, out: FloatArray) -> None:
    """First rows of the powers of each plant's step matrix.

    `step` is (n_sets, n, n), `out` (n_sets, n_samples, n): the first state at every sample, from a one in each.
    """
    n_sets, n_samples, n = out.shape
    for i in range(n_sets):
        out[i, 0] = 0.0
        out[i, 0, :1] = 1.0
        for k in range(1, n_samples):
            for column in range(n):
                total = 0.0
                for row in range(n):
                    total += out[i, k - 1, row] * step[i, row, column]
                out[i, k, column] = total
