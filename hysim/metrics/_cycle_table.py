"""The measures of every cycle of a record, one row a cycle.

Cycles begin and end at a level of the input (see `hysim._columns.excursions`), and each is measured by the code of
`loop_metrics`. If a cycle begins and ends at exactly the same input, which is the rule,

    energy = integral of y du over the cycle = -signed area

so that the energies of all cycles and `energy_outside`, the integral over the rest of the record, add up to the
integral of y du over the whole record. A last cycle that misses the level by less than the tolerance is closed by a
straight line, whose share is counted in `energy_outside`.

    amplitude a        = (max u - min u) / 2
    secant_stiffness k = (y at max u - y at min u) / (max u - min u)
    equivalent_damping = |energy| / (4 pi E_S),    E_S = k a^2 / 2

Sources: L. S. Jacobsen, Trans. ASME 52 (1930) 169; A. K. Chopra, Dynamics of Structures, section 3.9, for the damping.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_finite
from hysim._basics.prefixes import in_brackets
from hysim._basics.printing import aligned, csv_text, extent, folded, frozen_result, quantity, summary_text
from hysim._columns.excursions import Loops, protocol
from hysim._columns.turning import ROUNDING, TOLERANCE, too_few
from hysim.metrics._loop import COUNTERCLOCKWISE, FORCE, LoopMetrics, measure, samples_of_a_loop


@dataclass(frozen=True)
class _Column:
    """A column: its field, its heading and unit in the text, and whether the text has it."""

    field: str
    heading: str
    unit: str = ""
    in_text: bool = True

    def cell(self, value: float | int) -> str:
        if isinstance(value, int):
            return f"{value}"
        if math.isnan(value):
            return "-"
        return f"{100.0 * value:.2f}" if self.unit == "%" else f"{value:.4g}"

    def unit_in(self, units: Mapping[str, str]) -> str:
        """The unit made of those of u and y; empty if one of them is unknown."""
        if not {"u", "y"} & set(self.unit) <= units.keys():
            return ""
        u, y = (units.get(name, "") for name in ("u", "y"))
        if "/" in self.unit:
            u, y = in_brackets(u), in_brackets(y)
        return self.unit.replace("y", "\0").replace("u", u).replace("\0", y)


_COLUMNS = (
    _Column("start", "start"),
    _Column("stop", "stop"),
    _Column("amplitude", "amplitude", "u"),
    _Column("mean_input", "mean", "u"),
    _Column("lowest_input", "lowest", "u", in_text=False),
    _Column("highest_input", "highest", "u", in_text=False),
    _Column("max_width", "width", "y"),
    _Column("stroke", "stroke", "y", in_text=False),
    _Column("area", "area", "y u"),
    _Column("energy", "energy", "y u"),
    _Column("secant_stiffness", "stiffness", "y/u"),
    _Column("equivalent_damping", "damping", "%"),
    _Column("closure_gap", "gap", "y"),
    _Column("orientation", "orientation", in_text=False),
)


@frozen_result
class CycleMetrics:
    """The measures of every cycle of a record; arrays have shape (n_cycles,), in the order of time.

    ``len(table)`` is the number of cycles, ``table[k]`` the `LoopMetrics` of one, with its branches.

    Parameters
    ----------
    start, stop, amplitude, mean_input, lowest_input, highest_input : array
        ``u[start:stop]`` are the fewest samples of the cycle; the input's half span, middle and extremes [unit of u].
    max_width, stroke : array
        Largest width of the loop, and largest minus smallest output [unit of y].
    area : array
        Enclosed area, at least 0 [unit of y times unit of u].
    energy : array
        Integral of y du, dissipated by a force y over u; negative if counterclockwise [unit of y times unit of u].
    secant_stiffness : array
        Slope of the line through the loop's ends [unit of y / unit of u].
    equivalent_damping : array
        Damping ratio of the viscous oscillator that dissipates as much, at least 0 [1]; nan for a stiffness <= 0.
    closure_gap : array
        Output at the cycle's end minus output at its start [unit of y].
    orientation : tuple of {"counterclockwise", "clockwise", "none"}
        Sense of each loop.
    level : float
        Input at which the cycles begin and end [unit of u].
    energy_outside : float
        Integral of y du over the samples that belong to no cycle [unit of y times unit of u].
    loops : tuple of LoopMetrics
        The loop of each cycle.
    """

    start: npt.NDArray[np.intp]
    stop: npt.NDArray[np.intp]
    amplitude: FloatArray
    mean_input: FloatArray
    lowest_input: FloatArray
    highest_input: FloatArray
    max_width: FloatArray
    stroke: FloatArray
    area: FloatArray
    energy: FloatArray
    secant_stiffness: FloatArray
    equivalent_damping: FloatArray
    closure_gap: FloatArray
    orientation: tuple[str, ...]
    level: float
    energy_outside: float
    loops: tuple[LoopMetrics, ...]

    def __post_init__(self) -> None:
        for name, samples in (("start", self.start), ("stop", self.stop)):
            integers = np.array(samples, dtype=np.intp)
            integers.setflags(write=False)
            object.__setattr__(self, name, integers)

    def __len__(self) -> int:
        return len(self.loops)

    def __getitem__(self, k: int) -> LoopMetrics:
        return self.loops[k]

    def __iter__(self) -> Iterator[LoopMetrics]:
        return iter(self.loops)

    def __str__(self) -> str:
        many = "1 cycle" if len(self) == 1 else f"{len(self)} cycles"
        known = self.equivalent_damping[~np.isnan(self.equivalent_damping)]
        lines = [f"CycleMetrics: {many} from u = {self.level:.6g}, energy {self.energy.sum():.4g} in all"]
        rows = {
            "amplitude": extent(self.amplitude),
            "largest width": extent(self.max_width),
            "energy": f"{extent(self.energy)} in a cycle, {self.energy_outside:.4g} outside of the cycles",
            "stiffness": extent(self.secant_stiffness),
            "damping": f"{extent(known)} of the critical" if known.size else "needs a positive stiffness",
            "sign": self.sign_convention,
        }
        return summary_text(lines, rows)

    @property
    def cumulative_energy(self) -> FloatArray:
        """Energy up to the end of each cycle, shape (n_cycles,) [unit of y times unit of u]."""
        return np.cumsum(self.energy)

    @property
    def sign_convention(self) -> str:
        """The meaning of the energies' signs, in a sentence."""
        against = [k for k, orientation in enumerate(self.orientation, start=1) if orientation == "counterclockwise"]
        if not against:
            return FORCE
        if len(self) == 1:
            return f"The loop runs {COUNTERCLOCKWISE}"
        numbers = ", ".join(map(str, against[:8])) + (", ..." if len(against) > 8 else "")
        which = "All loops" if len(against) == len(self) else f"The loops of some cycles ({numbers})"
        return f"{which} run {COUNTERCLOCKWISE}"

    def rows(self) -> list[dict[str, Any]]:
        """The measures of each cycle by name, with the cycle's number from 1 as ``"cycle"``."""
        columns = {column.field: np.asarray(vars(self)[column.field]).tolist() for column in _COLUMNS}
        return [{"cycle": k + 1} | {name: values[k] for name, values in columns.items()} for k in range(len(self))]

    def to_text(self, units: Mapping[str, str] | None = None) -> str:
        """The table for a terminal, one row a cycle; `units` are labels of the units of ``"u"`` and ``"y"``."""
        shown = [column for column in _COLUMNS if column.in_text]
        header = ["cycle", *(column.heading for column in shown)]
        second = ["", *(_bracketed(column.unit_in(units or {})) for column in shown)]
        rows = [[f"{row['cycle']}", *(column.cell(row[column.field]) for column in shown)] for row in self.rows()]
        lines = aligned([header, second, *rows], first=str.rjust)
        unit = _Column("", "", "y u").unit_in(units or {})
        notes = [
            f"Cycles begin and end at u = {quantity(self.level, (units or {}).get('u', ''))}.",
            f"Energy of all cycles {quantity(float(self.energy.sum()), unit)}, "
            f"outside of the cycles {quantity(self.energy_outside, unit)}.",
            self.sign_convention,
        ]
        below = [line for note in notes for line in folded(note)]
        return "\n".join([*lines[:2], "-" * len(lines[0]), *lines[2:], *below])

    def to_csv(self, units: Mapping[str, str] | None = None) -> str:
        """Every column as comma-separated values with all digits, nan as an empty cell; `units` go into the header."""
        header = [
            column.field if column.unit == "%" else f"{column.field} {_bracketed(column.unit_in(units or {}))}".rstrip()
            for column in _COLUMNS
        ]
        return csv_text([["cycle", *header], *(row.values() for row in self.rows())])


def cycle_metrics(
    u: npt.ArrayLike, y: npt.ArrayLike, *, level: float | None = None, tolerance: float = TOLERANCE
) -> CycleMetrics:
    """Measure every cycle of a record: 0 -> max -> min -> 0, growing and one-sided protocols, steady cycles.

    A cycle leaves a level of the input to one side, returns to it, leaves it to the other side and returns again: two
    half cycles, as ATC-24 and FEMA 461 pair them. A half cycle whose neighbours lie on its own side, as in
    0 -> 5 -> 0 -> 8 -> 0, is a cycle of its own. Samples outside of the cycles, such as a last half cycle, are in no
    row; `energy_outside` counts them. A cycle that begins between two samples is cut there, with linear interpolation,
    so that each cycle is closed in u. `loop_metrics` measures the last cycle between the extremes of the record.

    Parameters
    ----------
    u, y : array, shape (n,)
        Input and output.
    level : float, optional
        Input at which cycles begin and end [unit of u]; by default the first input, or the middle of the levels that
        most of the branches' length reaches: whichever gives cycles of the larger total span.
    tolerance : float
        Reversals of the input smaller than this fraction of its span are ignored as noise, and a turning point this
        near to the level counts as at the level. Larger reversals inside a half cycle do not divide it: the energy is
        that of the whole path, but the width depends on the minor loops.

    Returns
    -------
    CycleMetrics

    Raises
    ------
    ValueError
        As `hysim.loop_metrics`, or if the level is not finite, or there is no cycle about it.

    Examples
    --------
    >>> import hysim as hs
    >>> u = [0, 1, 0, -1, 0, 2, 0, -2, 0]
    >>> table = hs.cycle_metrics(u, hs.Stop(threshold=0.5).response(u))
    >>> table.amplitude.tolist(), table.energy.tolist(), table.stop.tolist()
    ([1.0, 2.0], [0.75, 2.0], [5, 9])
    """
    inputs, outputs = samples_of_a_loop(u, y)
    check_finite(level=level)
    cut = protocol(inputs, tolerance, None if level is None else float(level))
    if not cut.spans:
        raise ValueError(too_few(inputs, tolerance, 1, 0))
    at_u, at_y = cut.loops.of(inputs), cut.loops.of(outputs)
    loops = tuple(measure(at_u, at_y, [cycle]) for cycle in cut.loops.cycles)
    low, high = (np.array([end(at_u[cycle.path]) for cycle in cut.loops.cycles]) for end in (np.min, np.max))
    same = ("max_width", "stroke", "area", "energy", "secant_stiffness", "closure_gap")
    return CycleMetrics(
        start=np.array([part.start for part in cut.slices]),
        stop=np.array([part.stop for part in cut.slices]),
        amplitude=(high - low) / 2,
        mean_input=(high + low) / 2,
        lowest_input=low,
        highest_input=high,
        equivalent_damping=np.abs([loop.equivalent_damping for loop in loops]),
        orientation=tuple(loop.orientation for loop in loops),
        **{name: np.array([vars(loop)[name] for loop in loops]) for name in same},
        level=cut.level,
        energy_outside=_outside(at_u, at_y, cut.loops),
        loops=loops,
    )


def _outside(u: FloatArray, y: FloatArray, loops: Loops) -> float:
    """Integral of y du over the parts between cycles, less that over the lines that close cycles."""
    begins = np.array([cycle.path.start for cycle in loops.cycles])
    ends = np.array([cycle.path.stop - 1 for cycle in loops.cycles])
    between = zip([0, *ends], [*begins, u.size - 1], strict=True)
    parts = [np.trapezoid(y[begin : end + 1], u[begin : end + 1]) for begin, end in between]
    closing = (y[begins] + y[ends]) / 2 * (u[ends] - u[begins])
    total = math.fsum([*parts, *closing])
    return total if abs(total) > ROUNDING * float(np.ptp(u) * np.abs(y).max()) else 0.0


def _bracketed(unit: str) -> str:
    return f"[{unit}]" if unit else ""
