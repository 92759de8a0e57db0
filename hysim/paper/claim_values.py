"""The values of the claims, each from the evidence and the row's arguments.

The paper prints no gains. So a claim about a closed loop asks whether a controller exists, and is judged by the best of
the loops of `hysim.paper.loops`: those within voltage limits, whose maximum sensitivity is at most 2.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from inspect import isfunction
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray, frozen
from hysim.control import to_control
from hysim.metrics import LoopMetrics, fit_percent, fpe, loop_metrics
from hysim.paper import equations, printed
from hysim.paper.equations import EQUATION_1, EQUATION_4, UA741_SUPPLY_SPAN, pid_standard
from hysim.paper.loops import REDUCTIONS
from hysim.paper.reidentification import Reidentification, aliased_fit, quantum
from hysim.paper.rounding import Number, Spread, exactly, half_unit, spread, stands_for
from hysim.paper.search import MAX_SENSITIVITY
from hysim.paper.step_reading import StepReading, step_reading
from hysim.paper.study import Study
from hysim.plants.transfer_function import TransferFunction
from hysim.records import Record

QUANTUM_TOLERANCE = 0.005
"""Largest distance of Table 1's displacements from multiples of a pixel [um]: more than their last digit's rounding."""
SIMILAR_PERCENT = float(printed.FIT_1)
"""Two responses are called similar where one fits the other as well as the paper asks of a model [%]."""
SLOW_DWELL = 50.0
"""Dwell at which a lag of seconds has died out, and hysteresis has not [s]."""

_MEASURED_DIGITS = 3  # Table 1 is in 0.001 um; trailing zeros are not printed
_PER_US = 1e6

LOOP_GAIN = 0.5
"""Gain at zero frequency of the loops that show the effect of each term: (1) is stable with any one of them."""
INTEGRAL_TIME = 2.0
DERIVATIVE_TIME = 0.2
DERIVATIVE_FILTER = 0.01
TRACKS_WITHIN = 0.02
"""A reference is tracked where the steady error is at most this part of it."""
Loop = Mapping[str, Any]
"""One closed loop: its plant, controller, conditions and measures by name, as in `summary.json`."""


@frozen
class Evidence:
    """Everything that a claim may be computed from.

    Parameters
    ----------
    table1, table2 : Record
        The paper's tables.
    study : Study
        The models of Table 1.
    reidentification : Reidentification
        (1) and (4) identified anew, and what Table 2 determines of a plant.
    approximations : mapping
        Estimates of (1) and (4) by the equation's number.
    control : mapping
        "hysteresis" and "vibration" to closed loops, as `hysim.paper.loops.control_measures` writes them.
    """

    table1: Record
    table2: Record
    study: Study
    reidentification: Reidentification
    approximations: Mapping[str, equations.Approximation]
    control: Mapping[str, Sequence[Loop]]

    @property
    def loop(self) -> LoopMetrics:
        """Measures of Table 1's loop."""
        return loop_metrics(self.table1.u, self.table1.y)


class Value(NamedTuple):
    """Result of a claim's function.

    Parameters
    ----------
    value : Spread, float or str
        What comes out.
    holds : bool, optional
        Whether the criterion is met; None where the printed number decides.
    facts : mapping
        Names to what stands for them in the claim's texts.
    printed : float or str, optional
        In place of a number of `hysim.paper.printed`.
    """

    value: Spread | float | str
    holds: bool | None = None
    facts: Mapping[str, Any] = {}
    printed: float | str | None = None


# -- the introduction and Table 1


def listed(_: Evidence, name: str) -> Value:
    """A number of the list of references."""
    return Value(exactly(float(vars(printed)[name])))


def points(of: Evidence, branch: int) -> Value:
    """Number of samples that rise, or that fall after them."""
    return Value(exactly(float(_branches(of.table1.u)[branch].size)))


def voltage_range(of: Evidence) -> Value:
    """Smallest and largest voltage."""
    return Value(exactly([of.table1.u.min(), of.table1.u.max()]))


def same_voltages(of: Evidence) -> Value:
    """Whether the falling voltages are the rising ones in reverse order."""
    rising, falling = _branches(of.table1.u)
    return Value(f"steps of {np.unique(np.abs(np.diff(rising)))[0]:g} V", np.array_equal(rising, falling[::-1]))


def smallest_step(of: Evidence) -> Value:
    """Smallest step of the displacement while the voltage rises."""
    steps = np.diff(of.table1.y[: _branches(of.table1.u)[0].size])
    return Value(float(steps.min()), bool((steps > 0.0).all()))


def full_length(of: Evidence) -> Value:
    """Largest displacement, and whether it is that at the largest voltage."""
    record = of.table1
    return Value(float(record.y.max()), bool((record.y[record.u == record.u.max()] == record.y.max()).all()))


def rest_error(of: Evidence) -> Value:
    """Last displacement less the first."""
    y = of.table1.y
    return Value(float(y[-1] - y[0]), bool(y[-1] == y[0]))


def resolution(of: Evidence) -> Value:
    """One pixel of Table 1, against the unit of its last digit."""
    step = quantum(of.table1.y, QUANTUM_TOLERANCE)
    return Value(step, step <= 2.0 * half_unit(printed.LAST_DIGIT_UM))


def loop_width(of: Evidence) -> Value:
    """Largest width of Table 1's loop, against a pixel."""
    loop = of.loop
    facts = {"at": loop.max_width_at, "share": 100.0 * loop.relative_width}
    return Value(loop.max_width, loop.max_width > quantum(of.table1.y, QUANTUM_TOLERANCE), facts)


def bend(of: Evidence) -> Value:
    """Largest distance of the loop's middle line from its best straight line, against half a pixel."""
    middle = (of.loop.loading + of.loop.unloading) / 2.0
    distance = float(np.abs(middle - np.polyval(np.polyfit(of.loop.u, middle, 1), of.loop.u)).max())
    return Value(distance, distance > quantum(of.table1.y, QUANTUM_TOLERANCE) / 2.0)


# -- equation (1)


def poles(_: Evidence, pair: int) -> Value:
    """Real and imaginary part of a pair of poles of (1)."""

    def roots(coefficients: FloatArray) -> FloatArray:
        upper = [pole for pole in np.roots([1.0, *coefficients]) if pole.imag > 0.0]
        return np.array([[pole.real, pole.imag] for pole in sorted(upper, key=lambda pole: -pole.imag)])

    both = spread(roots, printed.DEN_1[1:])
    low, high = both.low[pair], both.high[pair]
    return Value(Spread(value=both.value[pair], low=low, high=high), facts={"low": low, "high": high})


def printed_fit(of: Evidence) -> Value:
    """Fit of (1) as printed, at its best dwell."""
    dwell = of.study.printed.dwell
    measured = _texts(of.table1.y)

    def fit(x: FloatArray) -> float:
        model = TransferFunction(num=tuple(x[:2]), den=(1.0, *x[2:6]))
        return fit_percent(x[6:], model.response(of.table1.u, dwell))

    most = max(choice.fit_percent for choice in of.reidentification.printed)
    inputs = [*printed.NUM_1, *printed.DEN_1[1:], *measured]
    return Value(spread(fit, inputs), facts={"dwell": dwell, "most": most})


def identified_fit(of: Evidence) -> Value:
    """Fit of four poles and a zero identified anew."""
    identified = of.study.comparison["tf-identified"]
    refits = {(fit.hold, fit.sample, fit.initial): fit.fit_percent for fit in of.reidentification.hysteresis}
    facts = {"aliased": aliased_fit(), "end": refits["zoh", "end", "rest"]}
    return Value(spread(lambda y: fit_percent(y, identified.y), _texts(of.table1.y)), facts=facts)


def prediction_error(of: Evidence, formula: str) -> Value:
    """Final prediction error of the structure identified anew, by the formula or its first order."""
    identified, d = of.study.comparison["tf-identified"], of.study.fits["tf-identified"].n_parameters
    n = len(of.table1)

    def error(y: FloatArray) -> float:
        if formula == "full":
            return fpe(y - identified.y, d)
        return float(np.mean((y - identified.y) ** 2)) * (1.0 + 2.0 * d / n)

    return Value(spread(error, _texts(of.table1.y)), facts={"d": d, "n": n})


def prediction_error_of_fit(of: Evidence) -> Value:
    """Final prediction error, first order, that belongs to the printed fit."""
    d, n = of.study.fits["tf-identified"].n_parameters, len(of.table1)

    def error(x: FloatArray) -> float:
        return float(np.var(x[1:]) * (1.0 - x[0] / 100.0) ** 2 * (1.0 + 2.0 * d / n))

    return Value(spread(error, [printed.FIT_1, *_texts(of.table1.y)]), facts={"d": d, "n": n})


def beats_single_valued(of: Evidence) -> Value:
    """Fit of (1) as printed, against the best single-valued curve."""
    rows = of.study.comparison
    fit, curve = rows["eq1-printed"].fit_percent, rows["single-valued"].fit_percent
    return Value(fit, fit > curve, {"curve": curve, "identified": rows["tf-identified"].fit_percent})


def settled_width(of: Evidence) -> Value:
    """Width of the loop of (1) when every voltage waits, against a pixel."""
    model = TransferFunction(num=EQUATION_1.num, den=EQUATION_1.den, sample="end")
    width = loop_metrics(of.table1.u, model.response(of.table1.u, SLOW_DWELL)).max_width
    return Value(round(width, 9), width > (of.table1.resolution or 0.0), {"dwell": SLOW_DWELL})


def similar(of: Evidence, name: str) -> Value:
    """Fit of an estimate's step response to that of the model that it stands for."""
    pair = of.approximations[name]
    facts = {"least": SIMILAR_PERCENT, "simpler": pair.simpler, "full": pair.full}
    return Value(pair.fit_percent, pair.fit_percent >= SIMILAR_PERCENT, facts)


# -- the experiment of section 2.4, and Table 2


def ratio_needed(_: Evidence) -> Value:
    """Rf/R2 by equation (2)."""
    return Value(exactly(equations.resistor_ratio(float(printed.OUTPUT_V), float(printed.INPUT_V))))


def output_of_ratio(_: Evidence) -> Value:
    """Output by equation (2) with the printed ratio."""
    return Value(exactly(float(printed.INPUT_V) * equations.voltage_gain(float(printed.RATIO))))


def gain_of_voltages(_: Evidence) -> Value:
    """Output over input."""
    return Value(exactly(float(printed.OUTPUT_V) / float(printed.INPUT_V)))


def resistors(_: Evidence) -> Value:
    """Names of the resistors in the text and in Figure 8."""
    text, caption = printed.RESISTORS_IN_TEXT, printed.RESISTORS_IN_FIGURE_8
    return Value(", ".join(text), text == caption, printed=", ".join(caption))


def supply(_: Evidence) -> Value:
    """Largest supply of the amplifier, against the output."""
    return Value(UA741_SUPPLY_SPAN, float(printed.OUTPUT_V) <= UA741_SUPPLY_SPAN)


def power_bandwidth(_: Evidence, side: str) -> Value:
    """Full-power bandwidth by equation (3), in kHz."""
    amplitude = float(vars(printed)[side])
    bandwidth = spread(
        lambda x: equations.full_power_bandwidth(x[0] * _PER_US, amplitude) / 1e3, [printed.SLEW_RATE_V_PER_US]
    )
    return Value(bandwidth, facts={"amplitude": amplitude})


def program_frequency(_: Evidence) -> Value:
    """Frequency of the program's on and off times."""
    frequency = spread(lambda ms: 1000.0 / (ms[0] + ms[1]), [printed.ON_MS, printed.OFF_MS])
    return Value(frequency, facts={"period": 1000.0 / float(printed.FREQUENCY_HZ)})


def square_wave(of: Evidence) -> Value:
    """Levels of Table 2's voltage, and whether every half period has as many samples."""
    u = of.table2.u
    halves = [len(run) for run in np.split(u, np.flatnonzero(np.diff(u)) + 1)]
    holds = set(np.unique(u)) == {float(printed.LOW_V), float(printed.HIGH_V)} and len(set(halves)) == 1
    levels = f"{printed.LOW_V}, {printed.HIGH_V}"
    return Value(f"{u.min():g}, {u.max():g}", holds, {"half": halves[0]}, printed=levels)


def proportional(of: Evidence) -> Value:
    """Table 2's displacement at the high voltage, if it were proportional to the voltage."""
    u, y = of.table2.u, of.table2.y
    lower, upper = (f"{y[u == level].mean():.{_MEASURED_DIGITS}f}" for level in (u.min(), u.max()))
    return Value(spread(lambda x: x[0] * u.max() / u.min(), [lower]), printed=upper)


def resolution_of_table2(of: Evidence) -> Value:
    """Largest step that divides all displacements of Table 2, against the unit of the last digit."""
    step, swing = of.reidentification.information.quantum, of.reidentification.information.swing
    return Value(step, step <= 2.0 * half_unit(printed.LAST_DIGIT_UM), {"swing": swing, "steps": swing / step})


# -- equations (4) and (6)


def repeats_table2(of: Evidence, name: str) -> Value:
    """Fit of (4) to Table 2, read in a unit of time, with the initial state and the level free."""
    unit = next(unit for unit in of.reidentification.time_units if unit.name == name)
    return Value(unit.fit_with_level, unit.fit_with_level >= SIMILAR_PERCENT, {"unit": unit, "least": SIMILAR_PERCENT})


def static_swing(of: Evidence) -> Value:
    """Displacement of (4) for a lasting swing of the voltage, against Table 2's."""
    swing, gain = float(printed.HIGH_V) - float(printed.LOW_V), of.reidentification.information.gain
    facts = {"gain": EQUATION_4.dc_gain, "measured": gain, "swing": swing}
    measured = round(of.reidentification.information.swing, 3)
    return Value(EQUATION_4.dc_gain * swing, EQUATION_4.dc_gain * gain > 0.0, facts, measured)


def numbers_determined(of: Evidence) -> Value:
    """Number of numbers that Table 2 determines, against (4)'s coefficients."""
    known = of.reidentification.information
    facts = {"coefficients": known.n_coefficients, "line": known.static_fit_percent}
    return Value(float(known.n_determined), known.n_determined >= known.n_coefficients, facts)


def static_gain_of_6(_: Evidence) -> Value:
    """Static gain of (6), against that of (4)."""
    of_6, of_4 = (
        spread(lambda x: x[0] / x[1], [num[-1], den[-1]])
        for num, den in ((printed.NUM_6, printed.DEN_6), (printed.NUM_4, printed.DEN_4))
    )
    return Value(float(of_6.value), of_6.agrees(of_4), {"of_4": of_4.value})


def damping_of_6(of: Evidence) -> Value:
    """Damping ratio of (6), against 0 and 1."""
    damping = spread(lambda x: x[0] / (2.0 * x[1] ** 0.5), printed.DEN_6[1:])
    holds = bool(damping.low > 0.0 and damping.high < 1.0)
    return Value(float(damping.value), holds, {"frequency": of.approximations["(6)"].simpler.natural_frequencies[0]})


# -- the state-space forms


def entry_of_6(_: Evidence, name: str, place: int, sign: float) -> Value:
    """The entry that the companion form of (6) would have."""
    numbers = stands_for(vars(printed)[name][place])
    low, high = sorted((sign * float(numbers.low), sign * float(numbers.high)))
    return Value(Spread(value=sign * numbers.value, low=low, high=high))  # type: ignore[arg-type]


def structural_matrix(_: Evidence, model: str, kind: str) -> Value:
    """Controllability or observability matrix of a printed state-space form."""
    return Value(_structural(model, kind))


def structural_rank(_: Evidence, model: str, kind: str) -> Value:
    """Rank of that matrix, and whether rounding can bring its determinant to zero."""
    matrix = _structural(model, kind)
    rank = int(np.linalg.matrix_rank(matrix.value))
    determinant = matrix.value[0, 0] * matrix.value[1, 1] - matrix.value[0, 1] * matrix.value[1, 0]
    return Value(float(rank), rank == int(printed.RANK) and _regular(matrix), {"determinant": determinant})


def _structural(model: str, kind: str) -> Spread:
    A, C = (printed.A_7, printed.C_8) if model == "(7), (8)" else (printed.A_13, printed.C_14)

    def matrix(x: FloatArray) -> FloatArray:
        form = equations.state_space(np.array([x[:2], [1.0, 0.0]]), np.array([[0.0, x[2]]]))
        return form.controllability if kind == "controllability" else form.observability

    return spread(matrix, [*A[0], C[0][1]])


def _regular(matrix: Spread) -> bool:
    """Whether the determinant keeps its sign for every choice of entries in their ranges."""
    a, b, c, d = ([matrix.low[i, j], matrix.high[i, j]] for i in range(2) for j in range(2))
    values = [w * z - x * y for w in a for x in b for y in c for z in d]
    return bool(min(values) > 0.0 or max(values) < 0.0)


def _branches(u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The rising samples from the first on, and the falling ones after them."""
    falls = np.diff(u) <= 0.0
    turn = int(falls.argmax()) + 1 if falls.any() else u.size
    after = np.diff(u[turn:]) >= 0.0
    return u[:turn], u[turn : turn + int(after.argmax()) + 1 if after.any() else None]


def _texts(displacements: FloatArray) -> list[Number]:
    return [f"{y:.{_MEASURED_DIGITS}f}" for y in displacements]


# -- the terms of the controller


def sum_of_terms(_: Evidence) -> Value:
    """Largest relative distance of (17) from the sum of its three terms."""
    gain, integral, derivative = 2.0, 3.0, 0.5
    at = 1j * np.geomspace(0.01, 100.0, 25)
    terms = gain + gain / (integral * at) + gain * derivative * at
    apart = float(np.max(np.abs(pid_standard(gain, integral, derivative)(at) / terms - 1.0)))
    return Value(round(apart, 12) + 0.0, apart < 1e-12)


def proportional_rise(_: Evidence) -> Value:
    """Rise time with proportional action, against that without."""
    none, alone = _open_step(), _loop_step(math.inf, 0.0)
    return Value(alone.rise_time, alone.rise_time < none.rise_time, {"open": none.rise_time, "gain": LOOP_GAIN})


def proportional_error(_: Evidence) -> Value:
    """Steady error with proportional action."""
    error = 1.0 - _loop_step(math.inf, 0.0).final
    return Value(100.0 * error, abs(error) > TRACKS_WITHIN, {"gain": LOOP_GAIN, "least": 100.0 * TRACKS_WITHIN})


def integral_error(_: Evidence) -> Value:
    """Steady error with integral action."""
    loop = _loop_step(INTEGRAL_TIME, 0.0)
    facts = {"gain": LOOP_GAIN, "integral": INTEGRAL_TIME, "rise": loop.rise_time}
    return Value(100.0 * round(1.0 - loop.final, 12) + 0.0, abs(1.0 - loop.final) < 1e-9, facts)


def derivative_overshoot(_: Evidence) -> Value:
    """Overshoot with derivative action, against that without; the settling time has to fall too."""
    without, loop = _loop_step(math.inf, 0.0), _loop_step(math.inf, DERIVATIVE_TIME)
    better = loop.overshoot_percent < without.overshoot_percent and loop.settling_time < without.settling_time
    facts = {"gain": LOOP_GAIN, "derivative": DERIVATIVE_TIME, "without": without, "loop": loop}
    return Value(loop.overshoot_percent, better, facts)


def _open_step() -> StepReading:
    return step_reading(to_control(EQUATION_1))


def _loop_step(integral_time: float, derivative_time: float) -> StepReading:
    import control

    gain, smoothing = LOOP_GAIN / EQUATION_1.dc_gain, DERIVATIVE_FILTER if derivative_time else 0.0
    controller = pid_standard(gain, integral_time, derivative_time, derivative_filter=smoothing)
    return step_reading(control.feedback(controller * to_control(EQUATION_1)))


# -- the best loops


def tracks(of: Evidence, plant: str, reference: str) -> Value | None:
    """Steady error of the best loop on a plant for a reference, in percent of the step."""
    rows = [row for row in _loops(of, "vibration", plant) if row["reference"].startswith(reference)]
    if not rows:
        return None
    row = min(rows, key=lambda row: row["steady_error_percent"])
    error, least = float(row["steady_error_percent"]), 100.0 * TRACKS_WITHIN
    return Value(error, error <= least, {"least": least, "loop": _conditions(row)})


def loop_reduction(of: Evidence, plant: str, key: str) -> Value | None:
    """Reduction of the loop's relative width, of the best loop on a plant."""
    return _reached(printed.HYSTERESIS_REDUCTION, _best(_loops(of, "hysteresis", plant), [key]), key)


def vibration(of: Evidence, plant: str, measure: str) -> Value | None:
    """A measure of the best loop on a plant, or the least of its three; one is never shown without the others."""
    best = _best(_loops(of, "vibration", plant), REDUCTIONS)
    return _reached(printed.VIBRATION_REDUCTION, best, f"{measure.replace(' ', '_')}_reduction_percent")


def _reached(text: str, best: tuple[Mapping[str, float], Loop] | None, key: str) -> Value | None:
    if best is None:
        return None
    figures, row = best
    value = figures.get(key, min(figures.values()))
    enough = value >= float(text) - half_unit(text)
    said = _conditions(row) if enough else f"Searched: {row['conditions']['box']} Best: {_conditions(row)}"
    names = {name: name.removesuffix("_reduction_percent").replace("_", " ") for name in figures}
    together = ", ".join(f"{names[name]} {figure:.1f} %" for name, figure in figures.items())
    return Value(value, enough, {"loop": said, "together": together})


def _best(loops: Sequence[Loop], keys: Sequence[str]) -> tuple[Mapping[str, float], Loop] | None:
    """The loop whose least figure is the greatest, after its figures."""
    each = [({key: math.nan if row.get(key) is None else float(row[key]) for key in keys}, row) for row in loops]
    known = [pair for pair in each if not any(map(math.isnan, pair[0].values()))]
    return max(known, key=lambda pair: min(pair[0].values()), default=None)


def _loops(of: Evidence, kind: str, plant: str) -> list[Loop]:
    """Loops on a plant that count: within voltage limits, and robust."""
    return [
        row
        for row in of.control.get(kind, ())
        if row["plant"] == plant
        and row["limits"] != "unlimited"
        and row["max_sensitivity"] <= 1.001 * MAX_SENSITIVITY  # to which the sensitivity is known
    ]


def _conditions(row: Loop) -> str:
    """The controller of a loop, and the conditions under which it ran, in words."""
    low, high = row["limits"]
    under = row["conditions"]
    return (
        f"{row['controller']}; {row['reference']}; {low:g} to {high:g} V; sampled every {under['sample_time']:g} "
        f"{under['time_unit']}; maximum sensitivity {row['max_sensitivity']:.2f}"
    )


FUNCTIONS: Mapping[str, Callable[..., Value | None]] = {
    name: value
    for name, value in vars().items()
    if isfunction(value) and value.__module__ == __name__ and not name.startswith("_")
}
"""Every public function of this module by the name that the table gives it."""
