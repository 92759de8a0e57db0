"""The values of claims about tables and equations, each from the evidence and the row's arguments."""

from collections.abc import Callable, Mapping

import numpy as np

from hysim._frozen import FloatArray
from hysim.metrics import fit_percent, fpe, loop_metrics
from hysim.paper import printed
from hysim.paper.amplifier import UA741_SUPPLY_SPAN, full_power_bandwidth, resistor_ratio, voltage_gain
from hysim.paper.claims._evidence import Evidence
from hysim.paper.claims._judge import Value
from hysim.paper.claims.rounding import Number, Spread, exactly, half_unit, spread, stands_for
from hysim.paper.equations import EQUATION_1, EQUATION_4
from hysim.paper.reidentification import aliased_fit
from hysim.paper.resolution import quantum
from hysim.paper.state_space import EQUATIONS_7_8, EQUATIONS_13_14, StateSpace
from hysim.plants.transfer_function import TransferFunction

QUANTUM_TOLERANCE = 0.005
"""Largest distance of Table 1's displacements from multiples of a pixel [um]: more than their last digit's rounding."""
SIMILAR_PERCENT = float(printed.FIT_1)
"""Two responses are called similar where one fits the other as well as the paper asks of a model [%]."""
SLOW_DWELL = 50.0
"""Dwell at which a lag of seconds has died out, and hysteresis has not [s]."""

_MEASURED_DIGITS = 3  # Table 1 is in 0.001 um; trailing zeros are not printed
_PER_US = 1e6


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
    return Value(round(width, 9), width > of.pixel, {"dwell": SLOW_DWELL})


def similar(of: Evidence, name: str) -> Value:
    """Fit of an estimate's step response to that of the model that it stands for."""
    pair = of.approximations[name]
    facts = {"least": SIMILAR_PERCENT, "simpler": pair.simpler, "full": pair.full}
    return Value(pair.fit_percent, pair.fit_percent >= SIMILAR_PERCENT, facts)


# -- the experiment of section 2.4, and Table 2


def ratio_needed(_: Evidence) -> Value:
    """Rf/R2 by equation (2)."""
    return Value(exactly(resistor_ratio(float(printed.OUTPUT_V), float(printed.INPUT_V))))


def output_of_ratio(_: Evidence) -> Value:
    """Output by equation (2) with the printed ratio."""
    return Value(exactly(float(printed.INPUT_V) * voltage_gain(float(printed.RATIO))))


def gain_of_voltages(_: Evidence) -> Value:
    """Output over input."""
    return Value(exactly(float(printed.OUTPUT_V) / float(printed.INPUT_V)))


def resistors(_: Evidence) -> Value:
    """Names of the resistors in the text and in Figure 8."""
    text, caption = printed.RESISTORS_IN_TEXT, printed.RESISTORS_IN_FIGURE_8
    return Value(", ".join(text), text == caption, printed=", ".join(caption))


def supply(_: Evidence) -> Value:
    """Largest supply of the amplifier, against the output."""
    needed = float(printed.OUTPUT_V)
    return Value(UA741_SUPPLY_SPAN, needed <= UA741_SUPPLY_SPAN)


def power_bandwidth(_: Evidence, side: str) -> Value:
    """Full-power bandwidth by equation (3), in kHz."""
    amplitude = float(vars(printed)[side])
    return Value(
        spread(lambda x: full_power_bandwidth(x[0] * _PER_US, amplitude) / 1e3, [printed.SLEW_RATE_V_PER_US]),
        facts={"amplitude": amplitude},
    )


def program_frequency(_: Evidence) -> Value:
    """Frequency of the program's on and off times."""
    return Value(
        spread(lambda ms: 1000.0 / (ms[0] + ms[1]), [printed.ON_MS, printed.OFF_MS]),
        facts={"period": 1000.0 / float(printed.FREQUENCY_HZ)},
    )


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
    """Largest step of which Table 2's displacements are multiples, against the unit of the last digit."""
    step, swing = of.reidentification.information.quantum, of.reidentification.information.swing
    return Value(step, step <= 2.0 * half_unit(printed.LAST_DIGIT_UM), {"swing": swing, "steps": swing / step})


# -- equations (4) and (6)


def repeats_table2(of: Evidence, name: str) -> Value:
    """Fit of (4) to Table 2, read in a unit of time, with the initial state and the level free."""
    unit = of.time_unit(name)
    return Value(unit.fit_with_level, unit.fit_with_level >= SIMILAR_PERCENT, {"unit": unit, "least": SIMILAR_PERCENT})


def static_swing(of: Evidence) -> Value:
    """Displacement of (4) for a lasting swing of the voltage, against Table 2's."""
    swing, gain = float(printed.HIGH_V) - float(printed.LOW_V), of.reidentification.information.gain
    facts = {"gain": EQUATION_4.dc_gain, "measured": gain, "swing": swing}
    return Value(
        EQUATION_4.dc_gain * swing,
        EQUATION_4.dc_gain * gain > 0.0,
        facts,
        round(of.reidentification.information.swing, 3),
    )


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
    A, C, B = {
        "(7), (8)": (printed.A_7, printed.C_8, EQUATIONS_7_8.B),
        "(13), (14)": (printed.A_13, printed.C_14, EQUATIONS_13_14.B),
    }[model]

    def matrix(x: FloatArray) -> FloatArray:
        form = StateSpace(A=[x[:2], [1.0, 0.0]], B=B, C=[[0.0, x[2]]])  # type: ignore[arg-type]
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


FUNCTIONS: Mapping[str, Callable[..., Value]] = {
    function.__name__: function
    for function in (
        listed, points, voltage_range, same_voltages, smallest_step, full_length, rest_error, resolution, loop_width,
        bend, poles, printed_fit, identified_fit, prediction_error, prediction_error_of_fit, beats_single_valued,
        settled_width, similar, ratio_needed, output_of_ratio, gain_of_voltages, resistors, supply, power_bandwidth,
        program_frequency, square_wave, proportional, resolution_of_table2, repeats_table2, static_swing,
        numbers_determined, static_gain_of_6, damping_of_6, entry_of_6, structural_matrix, structural_rank,
    )
}  # fmt: skip
"""Every function by the name that the table gives it."""
