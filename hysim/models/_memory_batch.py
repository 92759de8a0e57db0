"""Many memory laws at once, in the order of n: neighbours of equal n share their charts (`hysim.kernels.charts`)."""

from collections.abc import Callable

import numpy as np

from hysim._frozen import FloatArray
from hysim.models._batch import Batch, Sets, part_of

Kernel = Callable[[FloatArray, FloatArray, FloatArray, FloatArray, int, int], None]
"""Outputs of laws: called with memory, output, u as `batch` takes them, where the outputs go, start and stop."""


def batch(memory: FloatArray, output: FloatArray, u: FloatArray, kernel: Kernel) -> Batch:
    """The laws with the inputs `u`, shape (1 or n_sets, n_samples); all arrays are read-only.

    `memory`, shape (n_sets, n_memory), is A, beta, gamma, n, ..., z0; `output`, (n_sets, 2 + degree), is gain,
    offset, c1, c2, ...
    """

    def compute(sets: Sets, inputs: FloatArray, y: FloatArray) -> None:
        kernel(part_of(memory, sets), part_of(output, sets), inputs, y, 0, len(y))

    n = memory[:, 3]
    return Batch(compute, len(memory), u, None if (np.diff(n) >= 0.0).all() else np.argsort(n, kind="stable"))
