"""Claims of sections 2.1 and 2.2: the staircase of Table 1."""

import numpy as np

from hysim.metrics import LoopMetrics
from hysim.paper import printed
from hysim.paper.claims._claim import Claim, compared, decided, unseen
from hysim.paper.claims.rounding import exactly, half_unit
from hysim.paper.resolution import quantum
from hysim.records import Record

QUANTUM_TOLERANCE = 0.005
"""Largest distance of Table 1's displacements from multiples of a pixel [um]: more than their last digit's rounding."""

_PHOTOGRAPHS = "the photographs of the setup as data"
_TIMES = "the times at which the staircase was read"


def table1_claims(record: Record, loop: LoopMetrics) -> tuple[Claim, ...]:
    """Claims of the text and the figures about Table 1."""
    return (*_staircase(record), *_displacements(record), *_loop(record, loop), *_unseen())


def _staircase(record: Record) -> tuple[Claim, ...]:
    rising, falling = _branches(record.u)
    return (
        compared(
            "table1-points-loading",
            "Table 1, part 1",
            "Part 1 holds the points of increasing voltage.",
            printed=printed.POINTS_LOADING,
            computed=exactly(float(rising.size)),
            method="count of the samples up to the first that does not rise",
        ),
        compared(
            "table1-points-unloading",
            "Table 1, part 2",
            "Part 2 holds the points of decreasing voltage.",
            printed=printed.POINTS_UNLOADING,
            computed=exactly(float(falling.size)),
            method="count of the samples from there on, all falling",
        ),
        compared(
            "table1-voltage-range",
            "Section 2.1",
            "The voltage rises from 0 V to 125 V, and falls back to 0 V.",
            printed=printed.RANGE_V,
            computed=exactly([record.u.min(), record.u.max()]),
            method="smallest and largest voltage of Table 1",
            unit="V",
        ),
        decided(
            "table1-same-voltages",
            "Table 1",
            "The way back passes the voltages of the way up.",
            holds=np.array_equal(rising, falling[::-1]),
            method="the voltages of part 2 in reverse order are those of part 1",
            recomputed=f"steps of {np.unique(np.abs(np.diff(rising)))[0]:g} V",
        ),
    )


def _displacements(record: Record) -> tuple[Claim, ...]:
    top = np.flatnonzero(record.u == record.u.max())
    loading = record.y[: _branches(record.u)[0].size]
    step = quantum(record.y, QUANTUM_TOLERANCE)
    return (
        decided(
            "table1-extends-with-voltage",
            "Section 2.1",
            "The actuator extends whenever the voltage is increased.",
            holds=bool((np.diff(loading) > 0.0).all()),
            method="smallest step of the displacement in part 1, which has to be positive",
            recomputed=float(np.diff(loading).min()),
            unit="um",
        ),
        decided(
            "table1-full-length",
            "Section 2.1",
            "It reaches its full length at the maximum voltage, where the way back begins.",
            holds=bool((record.y[top] == record.y.max()).all()),
            method="both displacements at 125 V are the largest of Table 1",
            recomputed=float(record.y.max()),
            unit="um",
        ),
        decided(
            "table1-returns-to-rest",
            "Section 2.1",
            "It returns to the state of rest at the minimum voltage.",
            holds=bool(record.y[-1] == record.y[0]),
            method="last displacement less the first, both at 0 V",
            recomputed=float(record.y[-1] - record.y[0]),
            unit="um",
        ),
        decided(
            "table1-resolution",
            "Section 2.1, Table 1",
            "A high resolution microscope gives displacements to 0.001 um.",
            holds=step <= 2.0 * half_unit(printed.LAST_DIGIT_UM),
            method="the largest step of which all displacements are whole multiples, to 0.005 um",
            printed=float(printed.LAST_DIGIT_UM),
            recomputed=step,
            unit="um",
            note="The step is one pixel of the camera; the digits beyond it say nothing.",
        ),
    )


def _loop(record: Record, loop: LoopMetrics) -> tuple[Claim, ...]:
    step = quantum(record.y, QUANTUM_TOLERANCE)
    middle = (loop.loading + loop.unloading) / 2.0
    bend = float(np.abs(middle - np.polyval(np.polyfit(loop.u, middle, 1), loop.u)).max())
    return (
        decided(
            "figure4-hysteresis",
            "Figure 4",
            "The displacement depends on whether the voltage rises or falls.",
            holds=loop.max_width > step,
            method="largest width of the loop, which has to exceed one pixel: that much, rounding can open",
            recomputed=loop.max_width,
            unit="um",
            note=f"At {loop.max_width_at:g} V, {100.0 * loop.relative_width:.1f} % of the stroke.",
        ),
        decided(
            "figure4-nonlinear",
            "Figure 4",
            "The hysteresis is nonlinear: beyond the loop, its middle line is not straight.",
            holds=bend > step / 2.0,
            method="largest distance of the loop's middle line from its best straight line, "
            "which has to exceed half a pixel",
            recomputed=bend,
            unit="um",
        ),
    )


def _unseen() -> tuple[Claim, ...]:
    return (
        unseen(
            "figure1-setup", "Figure 1", "The actuator under the microscope follows the supply's voltage.",
            needs=_PHOTOGRAPHS,
        ),
        unseen(
            "figure2-image-processing", "Figure 2", "Software turns camera images into the displacements of Table 1.",
            needs="the images, and their scale",
        ),
        unseen("figure3-time", "Figure 3", "Input and output of the staircase against time.", needs=_TIMES),
        unseen("creep", "Abstract", "The displacement shifts by creep, besides hysteresis.", needs=_TIMES),
    )  # fmt: skip


def _branches(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rising samples from the first on, and the falling ones after them."""
    falls = np.diff(u) <= 0.0
    turn = int(falls.argmax()) + 1 if falls.any() else u.size
    after = np.diff(u[turn:]) >= 0.0
    return u[:turn], u[turn : turn + int(after.argmax()) + 1 if after.any() else None]
