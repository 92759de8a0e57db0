"""Many laws at once, and what is kept of each: its row, or one number of it.

The laws are computed in blocks that stay in the cache, each on one thread, in the order of n, because
neighbours of equal n share their charts (`hysim.kernels.charts`). A reduction sees a block and forgets it,
so that a million sets need no million rows.

    sse               sum (y - target)^2
    max_width, area   of the last complete cycle, as `hysim.metrics.loop_metrics` has them
    final             the last output
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_chunks
from hysim.metrics.rows import LoopRows

Reduction = Literal["sse", "max_width", "area", "final"]
REDUCTIONS = ("sse", "max_width", "area", "final")

Kernel = Callable[[FloatArray, FloatArray, FloatArray, FloatArray, int, int], None]
"""Outputs of laws: called with memory, output, u as `Batch` holds them, where the outputs go, start and stop."""

_BLOCK = 32_768  # samples: a quarter of a megabyte


class Batch(NamedTuple):
    """Laws and their inputs (1 or n_sets, n_samples).

    `memory`, shape (n_sets, n_memory), is A, beta, gamma, n, ..., z0; `output`, (n_sets, 2 + degree), is gain,
    offset, c1, c2, ...
    """

    memory: FloatArray
    output: FloatArray
    u: FloatArray
    kernel: Kernel

    def rows(self, workers: int | None) -> FloatArray:
        """Outputs, shape (n_sets, n_samples); inf where a law escapes."""
        y = np.empty((len(self.memory), self.u.shape[1]))
        if (np.diff(self.memory[:, 3]) >= 0.0).all():
            in_chunks(lambda start, stop: self.kernel(*self[:3], y, start, stop), len(y), workers=workers)
        else:
            self._in_blocks(y.__setitem__, workers)
        return y

    def reduced(self, reduce: Reduction, target: npt.ArrayLike | None, workers: int | None) -> FloatArray:
        """One number for each set, shape (n_sets,); inf where a law escapes."""
        measure = self._measure(reduce, target)
        result = np.empty(len(self.memory))

        def keep(sets: npt.NDArray[np.intp], y: FloatArray) -> None:
            with np.errstate(invalid="ignore", over="ignore"):  # a row of inf has a measure of nan
                values = measure(sets, y)
            result[sets] = np.where(np.isposinf(y).all(axis=1), np.inf, values)

        self._in_blocks(keep, workers)
        return result

    def _measure(
        self, reduce: Reduction, target: npt.ArrayLike | None
    ) -> Callable[[npt.NDArray[np.intp], FloatArray], FloatArray]:
        if reduce not in REDUCTIONS:
            raise ValueError(f"reduce must be one of {', '.join(REDUCTIONS)} or None, got {reduce!r}")
        if (reduce == "sse") != (target is not None):
            raise ValueError('reduce="sse" takes a target, and nothing else does')
        if target is not None:
            measured = read_only(target, "target", ndim=1)
            if measured.size != self.u.shape[1]:
                raise ValueError(f"target must have {self.u.shape[1]} samples as u has, got {measured.size}")
            return lambda _, y: np.sum((y - measured) ** 2, axis=1)
        if reduce == "final":
            return lambda _, y: y[:, -1]
        of_loop: Callable[[LoopRows, FloatArray], FloatArray] = (
            LoopRows.max_width if reduce == "max_width" else LoopRows.area
        )
        if len(self.u) == 1:
            shared = LoopRows(self.u[0])
            return lambda _, y: of_loop(shared, y)
        return lambda sets, y: np.concatenate(
            [of_loop(LoopRows(self.u[k]), row[np.newaxis]) for k, row in zip(sets, y, strict=True)]
        )

    def _in_blocks(self, keep: Callable[[npt.NDArray[np.intp], FloatArray], None], workers: int | None) -> None:
        """Call `keep(sets, y)` for blocks of sets of neighbouring n."""
        order = np.argsort(self.memory[:, 3], kind="stable")
        n_samples = self.u.shape[1]
        size = max(1, _BLOCK // max(1, n_samples))

        def work(start: int, stop: int) -> None:
            y = np.empty((min(size, stop - start), n_samples))
            for first in range(start, stop, size):
                sets = order[first : min(first + size, stop)]
                u = self.u if len(self.u) == 1 else self.u[sets]
                part = y[: sets.size]
                self.kernel(
                    read_only(self.memory[sets]), read_only(self.output[sets]), read_only(u), part, 0, sets.size
                )
                keep(sets, part)

        in_chunks(work, order.size, workers=workers)
