"""The measures of a loop, and of a magnetic one.

A cycle of the input has a loading branch, on which u rises, and an unloading branch, on which it falls. Both are linear
between their samples, y_l(u) and y_u(u).

    w(u)           = y_u(u) - y_l(u)                             signed width
    max_width      = max |w|,    mid_width = |w| at mid span
    signed area    = 1/2 sum_k (u_k y_{k+1} - u_{k+1} y_k)       along the path, closed by a straight line
    mean_width     = area / (max u - min u)
    relative_width = max_width / stroke,    stroke = max y - min y

A positive signed area is a counterclockwise loop, as of a piezoelectric actuator: unloading above loading. `area` is
its magnitude. In a loop that crosses itself (a butterfly) the signed areas of its lobes cancel in part; each lobe has
its own area and width, the integral of w and max |w| between two zeros of w. If u is a displacement and y a force, with
y+ and y- the forces at the largest and smallest displacement (mean of both branches) and D half the span of u,

    energy             = integral of y du = -signed area         dissipated in a cycle; positive is clockwise
    secant_stiffness   = (y+ - y-) / (max u - min u)
    equivalent_damping = energy / (4 pi E_S),    E_S = secant_stiffness D^2 / 2

The last is the damping ratio of the viscous oscillator that dissipates as much at its resonance. Energy and ratio are
negative for a counterclockwise loop, where y lags u. The magnitude of the ratio is the same whichever of u and y is the
force, if both have their extremes together. Sources: L. S. Jacobsen, Trans. ASME 52 (1930) 169, for the equivalence;
FEMA 356 (2000), section 2.8.4, and ASCE 41 for the secant stiffness between the extremes of displacement, not of force;
IEC 60050-121 and 60404-4 for the terms of a magnetic loop.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise
from typing import Literal, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_positive, items, vectors
from hysim._basics.prefixes import in_brackets
from hysim._basics.printing import extent, frozen_result, quantity, summary_text
from hysim._columns.excursions import measured_cycles
from hysim._columns.turning import ROUNDING, TOLERANCE, Cycle, settled, turns

COUNTERCLOCKWISE = (
    "counterclockwise, as a piezo's displacement over its voltage: the integral of y du is negative, and "
    "the damping is that of its magnitude."
)
FORCE = "Energy is the integral of y du: what a force y on a displacement u dissipates."


Orientation = Literal["counterclockwise", "clockwise", "none"]
_LARGEST = 1e150  # of inputs and outputs, and of one over the span of inputs: their products are numbers
_SMALLEST_LOBE = 0.02  # of the area of all lobes: where the branches meet at the ends they cross by less
_END = 0.1  # of the span of the field
_DEGREE = 3  # of the width there, without noise
_OPEN = 0.01  # of the width of a loop
_CLEAR = 4.0  # standard deviations by which the mean width of a lobe is above the noise of the width


class Lobe(NamedTuple):
    """A part of a loop on which one branch stays above the other.

    `low` and `high` are the inputs where it ends [unit of u], `area` what it encloses, at least 0, `max_width` its
    largest width [unit of y], and `orientation` its sense, "counterclockwise" where unloading is above loading.
    """

    low: float
    high: float
    area: float
    max_width: float
    orientation: Orientation


@frozen_result
class LoopMetrics:
    """The measures of one loop; the equations stand at the head of `hysim.metrics._loop`.

    Parameters
    ----------
    max_width, max_width_at : float
        Largest magnitude of the width [unit of y], and the input there [unit of u]; of equals the lowest.
    mean_width, mid_width : float
        Area over input span, and the width's magnitude at mid span [unit of y].
    area : float
        Enclosed area, at least 0 [unit of y times unit of u]; the difference of both senses if it has several `lobes`.
    stroke, relative_width : float
        Largest minus smallest output of the cycle [unit of y], and `max_width` over it; nan for a constant output.
    orientation : {"counterclockwise", "clockwise", "none"}
        Sense of the path in the plane of u (to the right) and y (up); "none" if the area is zero to rounding.
    closure_gap : float
        Output at the cycle's end minus output at its start, the mean over cycles [unit of y]; 0 for a steady cycle.
    n_cycles : int
        Number of averaged cycles.
    energy : float
        Integral of y du, dissipated by a force y over u; negative if counterclockwise [unit of y times unit of u].
    secant_stiffness : float
        Slope of the line through the loop's ends [unit of y / unit of u].
    equivalent_damping : float
        Damping ratio of the viscous oscillator that dissipates as much, of the energy's sign; nan for a stiffness <= 0.
    u : array, shape (m,)
        Increasing inputs: every input of either branch, over their common range [unit of u].
    loading, unloading, width : array, shape (m,)
        The branches at `u`, and unloading minus loading [unit of y].
    """

    max_width: float
    max_width_at: float
    mean_width: float
    mid_width: float
    area: float
    stroke: float
    relative_width: float
    orientation: Orientation
    closure_gap: float
    n_cycles: int
    energy: float
    secant_stiffness: float
    equivalent_damping: float
    u: FloatArray
    loading: FloatArray
    unloading: FloatArray
    width: FloatArray

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """Parts between crossings of the loop, by increasing input; one without a crossing, empty without a width.

        Parts that are no larger than the noise of the width, or 2 % of the whole, belong to their neighbours.

        Examples
        --------
        >>> import hysim as hs
        >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=400)
        >>> butterfly = hs.Play(threshold=0.2) >> hs.PolynomialBoucWen(gain=0.0, input_coefficients=(0.0, 1.0))
        >>> left, right = hs.loop_metrics(u, butterfly.response(u)).lobes
        >>> left.orientation, right.orientation, round(left.area, 3), round(right.area, 3)
        ('clockwise', 'counterclockwise', 0.251, 0.251)
        """
        return _lobes(self.u, self.width)

    @property
    def crossings(self) -> tuple[float, ...]:
        """Inputs at which the loop crosses itself [unit of u]; empty for a simple loop."""
        return tuple(lobe.high for lobe in self.lobes[:-1])

    def __str__(self) -> str:
        return self.to_text()

    def to_text(self, units: Mapping[str, str] | None = None) -> str:
        """The text of ``str``, with the units of ``"u"`` and ``"y"``."""
        u, y = ((units or {}).get(signal, "") for signal in "uy")
        product, ratio = (f"{y} {u}", f"{y}/{in_brackets(u)}") if u and y else ("", "")
        loop = "no loop" if self.orientation == "none" else f"{self.orientation} loop"
        if self.crossings:
            loop = f"loop that crosses itself at u = {', '.join(quantity(at, u) for at in self.crossings)}"
        cycles = "the last cycle" if self.n_cycles == 1 else f"the mean of {self.n_cycles} cycles"
        rows = {
            "largest width": f"{quantity(self.max_width, y)} at u = {f'{self.max_width_at:.6g} {u}'.rstrip()}"
            + (f", {100.0 * self.relative_width:.2f} % of the stroke" if self.stroke > 0.0 else ""),
            "mean width": f"{quantity(self.mean_width, y)}, at mid span {quantity(self.mid_width, y)}",
            "stroke": f"{quantity(self.stroke, y)} over u of {extent(self.u, u)}",
            "area": f"{quantity(self.area, product)}, energy {quantity(self.energy, product)}",
            "lobes": "; ".join(
                f"u of {extent((lobe.low, lobe.high), u)}: {lobe.orientation}, "
                f"area {quantity(lobe.area, product)}, width {quantity(lobe.max_width, y)}"
                for lobe in (self.lobes if self.crossings else ())
            ),
            "closure gap": quantity(self.closure_gap, y),
            "stiffness": f"{quantity(self.secant_stiffness, ratio)}, {self._damping_in_words()}",
            "sign": self.sign_convention if self.orientation == "counterclockwise" else "",
        }
        return summary_text([f"LoopMetrics: {loop}, {cycles}, largest width {quantity(self.max_width, y)}"], rows)

    def _damping_in_words(self) -> str:
        if math.isnan(self.equivalent_damping):
            return "no equivalent damping, which needs a positive stiffness"
        return f"equivalent damping {100.0 * abs(self.equivalent_damping):.2f} %"

    @property
    def sign_convention(self) -> str:
        """Meaning of the energy's sign, in a sentence."""
        return f"The loop runs {COUNTERCLOCKWISE}" if self.orientation == "counterclockwise" else FORCE

    @overload
    def width_at(self, u: float) -> float: ...
    @overload
    def width_at(self, u: Sequence[float] | FloatArray) -> FloatArray: ...
    def width_at(self, u: float | Sequence[float] | FloatArray) -> float | FloatArray:
        """Signed width, unloading minus loading, at inputs of any shape [unit of y]; nan outside the loop's range.

        Examples
        --------
        >>> import hysim as hs
        >>> loop = hs.loop_metrics([0, 1, 2, 1, 0], [0, 1, 4, 3, 0])
        >>> loop.width_at(0.5), loop.width_at([1.0, 3.0]).tolist()
        (1.0, [2.0, nan])
        """
        width = np.interp(u, self.u, self.width, left=math.nan, right=math.nan)
        return width if np.ndim(u) else float(width)


def loop_metrics(u: npt.ArrayLike, y: npt.ArrayLike, *, cycles: int = 1, tolerance: float = TOLERANCE) -> LoopMetrics:
    """Measure the loop of the last complete cycle, or the average loop of the last few.

    A cycle is three consecutive turning points of the input, the outer two within 5 % of the input's span of one
    extreme of the record, the middle one within 5 % of the other. The record's ends count as turning points. The path
    may fail to close by those 5 %, and its energy lacks that part. If the record has too few such cycles, as in
    0 -> max -> min -> 0 and in growing protocols, they are those of `hysim.cycle_metrics` that have at least 90 % of
    the widest one's span and no minor loops; they are closed in u.

    A plateau at a turning point is divided in its middle, half to each branch. If a branch has several samples at one
    input, the last one is taken. The samples of a branch are sorted by input.

    Parameters
    ----------
    u, y : array, shape (n,)
        Input and output.
    cycles : int
        Number of last complete cycles whose branches are averaged at common inputs; all measures are of this loop.
    tolerance : float
        Reversals of the input smaller than this fraction of its span are ignored as noise.

    Returns
    -------
    LoopMetrics

    Raises
    ------
    ValueError
        If lengths differ, a value is infinite, nan or extreme, u is constant, or it has under 3 samples or few cycles.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> loop = hs.loop_metrics(rec.u, rec.y)
    >>> round(loop.max_width, 3), loop.max_width_at, round(loop.mean_width, 4), loop.orientation
    (0.232, 35.0, 0.1407, 'counterclockwise')
    """
    inputs, outputs = samples_of_a_loop(u, y)
    loops = measured_cycles(inputs, cycles, tolerance)
    return measure(loops.of(inputs), loops.of(outputs), loops.cycles)


def measure(inputs: FloatArray, outputs: FloatArray, cycles: list[Cycle]) -> LoopMetrics:
    loadings = [_curve(inputs[cycle.loading], outputs[cycle.loading]) for cycle in cycles]
    unloadings = [_curve(inputs[cycle.unloading], outputs[cycle.unloading]) for cycle in cycles]
    grid = common_inputs([x for x, _ in loadings + unloadings])
    loading, unloading = _mean_curve(grid, loadings), _mean_curve(grid, unloadings)
    path_u, path_y = np.append(grid, grid[::-1]), np.append(loading, unloading[::-1])
    if len(cycles) == 1:
        path_u, path_y = inputs[cycles[0].path], outputs[cycles[0].path]
    width = unloading - loading
    magnitude = np.abs(width)
    span, stroke = float(np.ptp(path_u)), float(np.ptp(path_y))
    area = float(signed_area(path_u, path_y))
    max_width = float(magnitude.max())
    stiffness = float(np.mean([loading[-1] - loading[0], unloading[-1] - unloading[0]]) / np.ptp(grid))
    stored = math.pi * stiffness * span**2
    return LoopMetrics(
        max_width=max_width,
        max_width_at=float(grid[np.argmax(magnitude >= max_width - ROUNDING * stroke)]),
        mean_width=abs(area) / span,
        mid_width=abs(float(np.interp(path_u.min() + span / 2, grid, width))),
        area=abs(area),
        stroke=stroke,
        relative_width=max_width / stroke if stroke > 0 else math.nan,
        orientation=_orientation(area, ROUNDING * span * stroke),
        closure_gap=float(np.mean([outputs[cycle.path][-1] - outputs[cycle.path][0] for cycle in cycles])),
        n_cycles=len(cycles),
        energy=0.0 - area,
        secant_stiffness=stiffness,
        equivalent_damping=(0.0 - area) * 2.0 / stored if stored > 0.0 else math.nan,
        u=grid,
        loading=loading,
        unloading=unloading,
        width=width,
    )


def width_rmse(a: LoopMetrics, b: LoopMetrics) -> float:
    """Root mean square difference of the signed widths of two loops [unit of y].

    It is taken at the inputs of `a` that `b` reaches; loops without a common input are a ValueError.

    Examples
    --------
    >>> import hysim as hs
    >>> narrow, wide = (hs.loop_metrics([0, 1, 2, 1, 0], [0, 1, 4, top, 0]) for top in (3, 6))
    >>> hs.metrics.width_rmse(narrow, wide) == (9 / 3) ** 0.5
    True
    """
    other = b.width_at(a.u)
    common = ~np.isnan(other)
    if not common.any():
        ranges = f"one runs from {a.u[0]} to {a.u[-1]}, the other from {b.u[0]} to {b.u[-1]}"
        raise ValueError(f"the loops share no input: {ranges}")
    return math.sqrt(np.mean((a.width[common] - other[common]) ** 2))


def _lobes(u: FloatArray, width: FloatArray) -> tuple[Lobe, ...]:
    """Lobes of a signed width, those that are too small joined to their neighbours."""
    turn = np.flatnonzero(width[:-1] * width[1:] < 0.0)
    zeros = u[turn] + np.diff(u)[turn] * width[turn] / (width[turn] - width[turn + 1])
    x, w = np.insert(u, turn + 1, zeros), np.insert(width, turn + 1, 0.0)
    areas = 0.5 * (w[1:] + w[:-1]) * np.diff(x)
    joints = np.concatenate([[0], np.flatnonzero(w[1:-1] == 0.0) + 1, [x.size - 1]]).astype(int)
    parts = [(int(a), int(b), float(areas[a:b].sum())) for a, b in pairwise(joints) if b > a]
    total, noise = sum(abs(area) for *_, area in parts), _noise(u, width)
    clear = [
        (a, b, area)
        for a, b, area in parts
        if abs(area) > max(_SMALLEST_LOBE * total, _CLEAR * noise * (x[b] - x[a]) / math.sqrt(b - a))
    ]
    runs = [list(run) for _, run in groupby(clear, key=lambda part: part[2] > 0.0)]
    crossed = [(before[-1][1] + after[0][0]) // 2 for before, after in pairwise(runs)]
    lobes = []
    for run, (a, b) in zip(runs, pairwise([0, *crossed, x.size - 1] if runs else []), strict=True):
        highest = max(float(np.abs(w[first : last + 1]).max()) for first, last, _ in run)
        sense = _orientation(run[0][2])
        lobes.append(Lobe(float(x[a]), float(x[b]), abs(float(areas[a:b].sum())), highest, sense))
    return tuple(lobes)


def _noise(u: FloatArray, width: FloatArray) -> float:
    """Standard deviation of the noise of a width, by its distances from the lines through its neighbours."""
    if u.size < 3:
        return 0.0
    part = (u[1:-1] - u[:-2]) / (u[2:] - u[:-2])
    distance = width[1:-1] - (1.0 - part) * width[:-2] - part * width[2:]
    return 1.4826 * float(np.median(np.abs(distance) / np.sqrt(1.0 + part**2 + (1.0 - part) ** 2)))


def _curve(u: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    samples = settled(u)
    return u[samples], y[samples]


def common_inputs(inputs: list[FloatArray]) -> FloatArray:
    """Every input of any branch, over their common range."""
    union = np.unique(np.concatenate(inputs))
    low, high = max(x[0] for x in inputs), min(x[-1] for x in inputs)
    return np.asarray(union[(union >= low) & (union <= high)])


def _mean_curve(grid: FloatArray, curves: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
    return np.asarray(np.mean([np.interp(grid, x, y) for x, y in curves], axis=0))


def signed_area(u: FloatArray, y: FloatArray) -> FloatArray:
    """Signed area by the shoelace formula, for outputs of shape (n,) or (n_sets, n)."""
    x, v = u - u.mean(), y - y.mean(axis=-1, keepdims=True)
    return np.asarray(np.sum(x * np.roll(v, -1, axis=-1) - np.roll(x, -1) * v, axis=-1) / 2)


def _orientation(area: float, rounding: float = 0.0) -> Orientation:
    return "none" if abs(area) <= rounding else "counterclockwise" if area > 0 else "clockwise"


def samples_of_a_loop(u: npt.ArrayLike, y: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Input and output as arrays; ValueError unless they have equal lengths and could hold a loop."""
    inputs, outputs = vectors(u=u, y=y)
    if inputs.size < 3:
        raise ValueError(f"a loop needs at least 3 samples, got {inputs.size}")
    if max(np.abs(inputs).max(), np.abs(outputs).max()) > _LARGEST or 0.0 < np.ptp(inputs) < 1.0 / _LARGEST:
        raise ValueError(f"u and y must be below {_LARGEST:g}, and u move by {1.0 / _LARGEST:g}: convert the units")
    if np.ptp(inputs) == 0:
        raise ValueError(f"the input is constant at {inputs[0]}: a loop needs an input that rises and falls")
    return inputs, outputs


_VACUUM = 1.25663706212e-6
_DEMAGNETISED = 1e-3  # of the spans of H and B


@frozen_result
class MagneticMetrics:
    """The measures of one magnetic loop, B over H.

    Parameters
    ----------
    energy : float
        Integral of H dB around the cycle [J/m^3]; negative for a loop that runs clockwise.
    coercivity, remanence : float
        Half the distances of the fields at B = 0 [A/m], and of the flux densities at H = 0 [T]; nan without both zeros.
    peak_field, peak_induction : float
        Half the spans between the loop's ends [A/m], [T].
    amplitude_permeability, largest_permeability : float
        ``peak_induction / (mu_0 peak_field)``, and the largest slope dB/dH between neighbouring samples / mu_0, which
        takes all noise of B [1].
    initial_permeability, maximum_permeability : float
        First and largest ``B / (mu_0 H)`` of the initial curve [1]; nan if the record does not begin at H = B = 0.
    saturated_slope : float
        Mean slope of the branches in the outer tenths of the span of the field [T m / A]. Where the loop is saturated,
        ``B - saturated_slope * H`` is without what the sample's holder, or a para- or diamagnetic part, adds.
    end_width : float
        Mean width in the outer tenth where it is smaller [T]: zero where the loop is saturated.
    closure_gap : float
        Flux density at the end of the cycle less that at its beginning [T].
    noise : float
        Standard deviation of one flux density, from the width in the outer tenths about a cubic [T]; 0 if few samples.
    n_cycles : int
        Number of averaged cycles.
    """

    energy: float
    coercivity: float
    remanence: float
    peak_field: float
    peak_induction: float
    amplitude_permeability: float
    largest_permeability: float
    initial_permeability: float
    maximum_permeability: float
    saturated_slope: float
    end_width: float
    closure_gap: float
    noise: float
    n_cycles: int

    @property
    def closure(self) -> Literal["closed", "drift", "open"]:
        """Whether the loop is open, since the field does not saturate it, or does not end where it began.

        Neither is said of widths and gaps within four times the noise, or 1 % of the width of the loop.
        """
        least = max(_CLEAR * self.noise, _OPEN * 2.0 * abs(self.remanence))
        if abs(self.end_width) > least:
            return "open"
        return "drift" if abs(self.closure_gap) > least else "closed"

    def __str__(self) -> str:
        return self.to_text()

    def to_text(self, units: Mapping[str, str] | None = None) -> str:
        """The text of ``str``, with the units of ``"u"`` and ``"y"``, A/m and T unless given."""
        u, y = ((units or {}).get(signal, own) for signal, own in (("u", "A/m"), ("y", "T")))
        is_si, initial, largest = (u, y) == ("A/m", "T"), self.initial_permeability, self.maximum_permeability
        density = "J/m^3" if is_si else f"{y} {u}"
        lines = [f"MagneticMetrics: {self.energy:.4g} {density} a cycle at {self.peak_induction:.4g} {y}"]
        permeability = f"amplitude {self.amplitude_permeability:.4g}, largest {self.largest_permeability:.4g}"
        ends = f"{self.end_width:.2g} {y} wide near the ends, gap {self.closure_gap:.2g} {y}"
        rows = {
            "coercivity": f"{self.coercivity:.4g} {u}",
            "remanence": f"{self.remanence:.4g} {y}",
            "peak": f"{self.peak_field:.4g} {u}",
            "permeability": permeability if is_si else "",
            "initial curve": f"from {initial:.4g}, at most {largest:.4g}" if is_si and not math.isnan(initial) else "",
            "slope": f"{self.saturated_slope:.4g} {y}/{f'({u})' if '/' in u else u} near the ends",
            "closure": f"{self.closure}: {ends}, noise {self.noise:.2g} {y}",
        }
        return summary_text(lines, rows)

    def to_dict(self) -> dict[str, float]:
        """The measures by name, as numbers."""
        return items(self)


def magnetic_metrics(
    H: npt.ArrayLike, B: npt.ArrayLike, *, cycles: int = 1, tolerance: float = TOLERANCE, mu0: float = _VACUUM
) -> MagneticMetrics:
    """Measure the magnetic loop of the last complete cycle, or the average loop of the last few.

    Parameters
    ----------
    H : array, shape (n,)
        Field [A/m].
    B : array, shape (n,)
        Flux density, or magnetisation in the same unit [T].
    cycles, tolerance
        As of `hysim.loop_metrics`, which says what a complete cycle is.
    mu0 : float
        Permeability that counts as one, positive [T m / A]; another one for other units.

    Returns
    -------
    MagneticMetrics

    Raises
    ------
    ValueError
        As `hysim.loop_metrics`, or if mu0 is not positive.

    Examples
    --------
    >>> import hysim as hs
    >>> core = hs.Tellinen(saturation=1.8, coercivity=120.0, squareness=0.5)
    >>> H = hs.signals.triangle(-3000.0, 3000.0, cycles=2, samples_per_cycle=2000)
    >>> loop = hs.magnetic_metrics(H, core.response(H))
    >>> round(loop.energy), round(loop.coercivity, 1), round(loop.remanence, 4)
    (864, 120.0, 0.9)
    """
    check_positive(mu0=mu0)
    field, induction = samples_of_a_loop(H, B)
    loop = loop_metrics(field, induction, cycles=cycles, tolerance=tolerance)
    peak_field = 0.5 * float(np.ptp(loop.u))
    initial, maximum = _initial_curve(field, induction, tolerance)
    slopes = np.diff([loop.loading, loop.unloading], axis=1) / np.diff(loop.u)
    return MagneticMetrics(
        energy=0.0 - loop.energy,
        coercivity=0.5 * (_zero(loop.u, loop.loading) - _zero(loop.u, loop.unloading)),
        remanence=0.5 * loop.width_at(0.0),
        peak_field=peak_field,
        peak_induction=loop.secant_stiffness * peak_field,
        amplitude_permeability=loop.secant_stiffness / mu0,
        largest_permeability=float(slopes.max()) / mu0,
        initial_permeability=initial / mu0,
        maximum_permeability=maximum / mu0,
        **_ends(loop),
        closure_gap=loop.closure_gap,
        n_cycles=loop.n_cycles,
    )


def _ends(loop: LoopMetrics) -> dict[str, float]:
    """Slope, least width and noise of the branches in the outer tenths of the span."""
    place = (loop.u - loop.u[0]) / np.ptp(loop.u)
    mean = 0.5 * (loop.loading + loop.unloading)
    slopes, widths, squares, freedom = [], [], 0.0, 0
    first, last = (max(2, int(end.sum())) for end in (place < _END, place > 1.0 - _END))
    for end in (slice(first), slice(-last, None)):
        u, width = loop.u[end], loop.width[end]
        slopes.append(np.polynomial.Polynomial.fit(u, mean[end], 1).convert().coef[-1])
        widths.append(float(np.mean(width)))
        degree = min(_DEGREE, u.size - 1)
        smooth = np.polynomial.Polynomial.fit(u, width, degree)
        squares += float(np.sum((width - smooth(u)) ** 2)) / 2.0  # of the difference of two values
        freedom += u.size - 1 - degree
    return {
        "saturated_slope": float(np.mean(slopes)),
        "end_width": min(widths, key=abs),
        "noise": math.sqrt(squares / freedom) if freedom else 0.0,
    }


def _zero(u: FloatArray, y: FloatArray) -> float:
    """First zero of a polyline; nan without a zero."""
    crossed = np.flatnonzero(np.sign(y[:-1]) * np.sign(y[1:]) <= 0.0)
    if not crossed.size:
        return math.nan
    k = crossed[0]
    return float(u[k] - y[k] * (u[k + 1] - u[k]) / (y[k + 1] - y[k])) if y[k] else float(u[k])


def _initial_curve(H: FloatArray, B: FloatArray, tolerance: float) -> tuple[float, float]:
    """First and largest B / H of the first stroke; nan if it does not begin demagnetised."""
    if abs(H[0]) > _DEMAGNETISED * np.ptp(H) or abs(B[0]) > _DEMAGNETISED * np.ptp(B):
        return math.nan, math.nan
    first = turns(H, tolerance).branches[0]
    field, induction = H[first] - H[0], B[first] - B[0]
    nonzero = field != 0.0
    ratios = induction[nonzero] / field[nonzero]
    return float(ratios[0]), float(ratios.max())
