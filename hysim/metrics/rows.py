"""Measures of many loops that share their input, by the definitions and the arithmetic of `hysim.metrics._loop`."""

from dataclasses import dataclass

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._columns.excursions import measured_cycles
from hysim._columns.turning import TOLERANCE, settled
from hysim.metrics._loop import common_inputs, signed_area


@dataclass(frozen=True)
class LoopRows:
    """Loops over the last complete cycle of the input `u`, shape (n_samples,); outputs are (n_sets, n_samples)."""

    u: FloatArray

    def max_width(self, y: FloatArray) -> FloatArray:
        """Largest magnitude of the width of each row, shape (n_sets,)."""
        return np.asarray(np.abs(self._widths(y)).max(axis=1))

    def max_width_slopes(self, y: FloatArray, slopes: FloatArray) -> FloatArray:
        """Derivatives (n,) of the largest width of `y` (n_samples,): those of the width where it is largest."""
        widths = self._widths(np.concatenate([y[np.newaxis], slopes]))
        largest = int(np.argmax(np.abs(widths[0])))
        return np.asarray(np.sign(widths[0, largest]) * widths[1:, largest])

    def _widths(self, y: FloatArray) -> FloatArray:
        """Width of each row at common inputs, (n_sets, n_inputs)."""
        loops = measured_cycles(self.u, 1, TOLERANCE)
        u, rows = loops.of(self.u), loops.of(y)
        branches = [(part, settled(u[part])) for part in (loops.cycles[0].unloading, loops.cycles[0].loading)]
        grid = common_inputs([u[part][order] for part, order in branches])
        unloading, loading = (_interpolated(grid, u[part][order], rows[:, part][:, order]) for part, order in branches)
        return np.asarray(unloading - loading)

    def area(self, y: FloatArray) -> FloatArray:
        """Enclosed area of each row, shape (n_sets,)."""
        loops = measured_cycles(self.u, 1, TOLERANCE)
        path = loops.cycles[0].path
        return np.abs(signed_area(loops.of(self.u)[path], np.ascontiguousarray(loops.of(y)[:, path])))


def max_widths(u: FloatArray, y: FloatArray) -> FloatArray:
    """As `LoopRows.max_width`; empty where the input has no complete cycle."""
    try:
        return LoopRows(u).max_width(y) if len(y) else np.empty(0)
    except ValueError:
        return np.empty(0)


def _interpolated(grid: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    below = np.clip(np.searchsorted(x, grid, side="right") - 1, 0, x.size - 1)
    above = np.minimum(below + 1, x.size - 1)
    spans = np.where(above > below, x[above] - x[below], 1.0)
    return np.asarray((y[:, above] - y[:, below]) / spans * (grid - x[below]) + y[:, below])
