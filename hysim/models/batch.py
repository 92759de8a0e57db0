"""Many laws at once, each with its row of outputs, or one number of it.

The laws are computed in blocks that stay in the cache, each on one thread. A reduction sees a block and
forgets it, so that a million sets need no million rows.

    sse               sum (y - target)^2
    max_width, area   of the last complete cycle, as `hysim.metrics.loop_metrics` has them
    final             the last output
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim._basics.names import meant
from hysim._basics.parallel import in_chunks
from hysim.metrics.rows import LoopRows

Reduction = Literal["sse", "max_width", "area", "final"]
REDUCTIONS = ("sse", "max_width", "area", "final")

Sets = slice | npt.NDArray[np.intp]
"""Which of the sets: a stretch of them, or their places."""

_SETS_A_THREAD = 64
_BLOCK = 32_768  # samples: a quarter of a megabyte


class Batch(NamedTuple):
    """Laws by what computes them, and their inputs (1 or n_sets, n_samples).

    `compute(sets, u, y)` fills `y` (n, n_samples) for inputs `u` (1 or n, n_samples); a law that diverges is a row of
    inf. `order` (n_sets,), None for that of the sets, lets neighbours share work; `samples_a_thread` as in `hysim.Law`.
    """

    compute: Callable[[Sets, FloatArray, FloatArray], None]
    n_sets: int
    u: FloatArray
    order: npt.NDArray[np.intp] | None = None
    samples_a_thread: int | None = None

    def result(self, reduce: Reduction | None, target: npt.ArrayLike | None, workers: int | None) -> FloatArray:
        return self.rows(workers) if reduce is None else self.reduced(reduce, target, workers)

    def rows(self, workers: int | None) -> FloatArray:
        """Outputs, shape (n_sets, n_samples); inf where a law diverges."""
        y = np.empty((self.n_sets, self.u.shape[1]))

        def work(start: int, stop: int) -> None:
            self.compute(slice(start, stop), self._inputs(slice(start, stop)), y[start:stop])

        if self.order is None:
            self._in_chunks(work, workers)
        else:
            self._in_blocks(y.__setitem__, workers)
        return y

    def reduced(self, reduce: Reduction, target: npt.ArrayLike | None, workers: int | None) -> FloatArray:
        """One number for each set, shape (n_sets,); inf where a law diverges."""
        measure = self._measure(reduce, target)
        result = np.empty(self.n_sets)

        def keep(sets: Sets, y: FloatArray) -> None:
            with np.errstate(invalid="ignore", over="ignore"):  # a row of inf has a measure of nan
                values = measure(sets, y)
            result[sets] = np.where(np.isposinf(y).all(axis=1), np.inf, values)

        self._in_blocks(keep, workers)
        return result

    def _measure(self, reduce: Reduction, target: npt.ArrayLike | None) -> Callable[[Sets, FloatArray], FloatArray]:
        if reduce not in REDUCTIONS:
            raise ValueError(
                f"reduce must be one of {', '.join(REDUCTIONS)} or None, got {reduce!r}{meant(reduce, REDUCTIONS)}"
            )
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
            [of_loop(LoopRows(u), row[np.newaxis]) for u, row in zip(self.u[sets], y, strict=True)]
        )

    def _in_blocks(self, keep: Callable[[Sets, FloatArray], None], workers: int | None) -> None:
        n_samples = self.u.shape[1]
        size = max(1, _BLOCK // max(1, n_samples))

        def work(start: int, stop: int) -> None:
            y = np.empty((min(size, stop - start), n_samples))
            for first in range(start, stop, size):
                block = slice(first, min(first + size, stop))
                sets = block if self.order is None else self.order[block]
                part = y[: block.stop - block.start]
                self.compute(sets, self._inputs(sets), part)
                keep(sets, part)

        self._in_chunks(work, workers)

    def _in_chunks(self, work: Callable[[int, int], None], workers: int | None) -> None:
        n_samples = self.u.shape[1]
        few = _SETS_A_THREAD
        if self.samples_a_thread is not None:
            few = max(1, min(few, self.samples_a_thread // max(1, n_samples)))
        in_chunks(work, self.n_sets, workers=workers, minimum=few, n_samples=n_samples)

    def _inputs(self, sets: Sets) -> FloatArray:
        if len(self.u) == 1:
            return self.u
        rows = self.u[sets]
        rows.setflags(write=False)  # as kernels take them
        return rows
