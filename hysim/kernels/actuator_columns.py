"""Columns of a law's output through the linear stage of an actuator, each from rest at its first value.

    x_(j+1) = A x_j + B_0 w_(j-d) + B_1 w_(j-1-d) + B_2 w_(j-2-d),    y_j = C x_j + D_0 w_(j-d) + D_1 w_(j-1-d) + ...

These are the equations of `hysim.kernels.loop`, for an input that is known: w_j is the law's output in sub-step j, and
an output is taken at the begin of each sample. The first states do not look at the others: they are the creep.
"""

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import kernel


@kernel
def through(
    decline: FloatArray,
    A: FloatArray,
    B: FloatArray,
    row: FloatArray,
    rest: FloatArray,
    lag: int,
    substeps: int,
    w: FloatArray,
    out: FloatArray,
) -> None:
    """Outputs (n_columns, n_samples) into `out` for `w`, (n_columns, n_samples * substeps).

    `decline` (n_creep,), `A` (order - n_creep, order), `B` (3, order), `row` (order + 3,) and `rest` (order,) are those
    of a `SampledStage`; `lag` is d.
    """
    n_columns, n_samples = out.shape
    creeping, order = decline.size, rest.size
    B0, B1, B2, C = B[0], B[1], B[2], row[3:]
    is_whole = not (B1.any() or B2.any())
    x, moved = np.empty(order), np.empty(order)
    begin, end = np.zeros(order, np.int64), np.zeros(order, np.int64)  # of each row's numbers that are not zero
    for i in range(creeping, order):
        begin[i] = order
        for j in range(order):
            if A[i - creeping, j] != 0.0:
                begin[i], end[i] = min(begin[i], j), j + 1
    for c in range(n_columns):
        first = w[c, 0]
        newer, older, oldest = first, first, first
        for i in range(order):
            x[i] = rest[i] * first
        for k in range(n_samples):
            for sub in range(substeps):
                place = k * substeps + sub - lag
                oldest, older = older, newer
                newer = w[c, place] if place > 0 else first
                if sub == 0:
                    total = row[0] * newer + row[1] * older + row[2] * oldest
                    for i in range(order):
                        total += C[i] * x[i]
                    out[c, k] = total
                for i in range(creeping, order):
                    following = B0[i] * newer
                    for j in range(begin[i], end[i]):
                        following += A[i - creeping, j] * x[j]
                    moved[i] = following
                for i in range(creeping):
                    x[i] += decline[i] * x[i] + B0[i] * newer
                for i in range(creeping, order):
                    x[i] = moved[i]
                if not is_whole:
                    for i in range(order):
                        x[i] += B1[i] * older + B2[i] * oldest
