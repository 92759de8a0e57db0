"""What the assessments say is what can be counted from the two loops they hold."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import assert_refused, refused

import hysim as hs
from hysim.control import assess_hysteresis, assess_square_wave, assess_step
from hysim.control._loop import secant_gain, slopes, steady_cycle, without_memory
from hysim.metrics import vibration_reduction

LAG = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
MODE = hs.TransferFunction(num=(2.0,), den=(1.0, 0.4, 1.0))
PROPER = hs.TransferFunction(num=(0.5, 1.0), den=(1.0, 1.0))
LAW = hs.BoucWen(beta=0.5, gamma=0.3, gain=0.5, feedthrough=1.0)
NEGATIVE = replace(LAW, gain=-0.5, feedthrough=-1.0)
TRIANGLE = {"low": 0.0, "high": 1.0, "period": 10.0, "sample_time": 0.05}
WAVE = {"low": 0.0, "high": 1.0, "period": 60.0, "sample_time": 0.05, "periods": 3}


@given(st.floats(0.2, 3.0), st.floats(0.0, 1.5), st.floats(-0.5, 0.5), st.floats(0.1, 5.0), st.booleans())
def test_the_secant_gain_is_a_fixed_point(A, beta, gamma, span, turned):
    """The steady cycle of the voltage reference / gain has the stroke of the reference: its span."""
    sign = -1.0 if turned else 1.0
    law = hs.BoucWen(A=A, beta=beta, gamma=gamma * beta, gain=0.5 * sign, feedthrough=sign)
    cycle = hs.signals.triangle(0.0, span, cycles=1, samples_per_cycle=40)
    actuator = hs.Actuator(hysteresis=law)
    gain = secant_gain(actuator, cycle, 0.1)
    assert math.copysign(1.0, gain) == sign
    assert np.ptp(steady_cycle(actuator, cycle / gain, 0.1)) == pytest.approx(span, rel=1e-11)  # the gain is to 1e-13
    quasi_static = secant_gain(hs.Actuator(hysteresis=law, vibration=MODE), cycle)
    scaled = secant_gain(hs.Actuator(hysteresis=law), cycle / MODE.dc_gain)
    assert quasi_static == pytest.approx(MODE.dc_gain * scaled, rel=1e-11)


def test_a_stroke_that_grows_faster_than_its_command_has_a_secant_gain():
    backlash, cycle = hs.Play(threshold=20.0, u_range=(-99.0, 99.0)), 9.0 * np.sin(np.pi / 20.0 * np.arange(40))
    for law in (backlash, hs.PolynomialBoucWen(gain=0.0, input_coefficients=(0.01, 0.0, 1e-4))):
        u = np.tile(cycle / secant_gain(hs.Actuator(hysteresis=law), cycle), 3)
        assert np.ptp(law.response(u)[80:]) == pytest.approx(18.0)


def test_the_secant_gain_of_a_line_is_its_slope_and_of_a_plant_its_dc_gain():
    cycle = hs.signals.triangle(0.0, 2.0, cycles=1, samples_per_cycle=40)
    assert secant_gain(hs.Actuator(vibration=replace(MODE, num=(-2.0,))), cycle) == -2.0
    assert secant_gain(hs.Actuator(vibration=MODE), cycle, 100.0) == pytest.approx(2.0)  # so slow that it is static
    plays = hs.PrandtlIshlinskii(thresholds=(0.0, 0.2, 0.5), weights=(0.2, 0.6, 0.8))
    up = 2.0 / 1.9  # 0.2 u + 0.6 (u - 0.4) + 0.8 (u - 1) is 2 at u = 1.9
    for law, gain in ((hs.Line(offset=3.0, slope=-0.7), -0.7), (plays, up), (hs.Play(threshold=5.0), 2.0 / 12.0)):
        assert secant_gain(hs.Actuator(hysteresis=law), cycle, 0.1) == pytest.approx(gain)


def test_slopes_bracket_the_secant_gain():
    cycle = hs.signals.triangle(0.0, 1.0, cycles=1, samples_per_cycle=200)
    low, high = slopes(hs.Actuator(hysteresis=LAW), cycle)
    # feedthrough + gain times what is left of A = 1 at most
    assert 1.0 < low < secant_gain(hs.Actuator(hysteresis=LAW), cycle) < high <= 1.5 + 0.5
    assert slopes(hs.Actuator(vibration=MODE), cycle) == (1.0, 1.0)
    stopped = hs.Actuator(amplifier=hs.Amplifier(limits=(1.0, 2.0)), hysteresis=LAW)
    for plant in (hs.Actuator(hysteresis=LAW), stopped):
        assert slopes(plant, np.array([0.0, 1.0])) == pytest.approx((low, high), rel=0.02)  # along a step, too


@pytest.mark.parametrize(("law", "ends"), [(LAW, (np.min, np.max)), (NEGATIVE, (np.max, np.min))], ids=["up", "down"])
def test_the_line_without_memory_passes_through_the_ends_of_the_loop(law, ends):
    u = hs.signals.triangle(-1.0, 2.0, cycles=1, samples_per_cycle=60)
    line = without_memory(hs.Actuator(hysteresis=law, vibration=MODE), u)
    y = steady_cycle(hs.Actuator(hysteresis=law), u, None)
    assert line.hysteresis.response([-1.0, 2.0]) == pytest.approx([end(y) for end in ends], abs=1e-12)
    assert line.vibration == MODE


def test_a_law_of_negative_gain_is_assessed_as_its_mirror_image():
    plain = assess_hysteresis(LAW, hs.PID(ki=4.0), **TRIANGLE)
    turned = assess_hysteresis(NEGATIVE, hs.PID(ki=-4.0), **TRIANGLE)
    for name in ("hysteresis_reduction_percent", "lag_width", "open_lag_width", "closed_width", "tracking_rms"):
        assert getattr(turned, name) == pytest.approx(getattr(plain, name), rel=1e-9), name


def width(reference, y):
    """Largest difference of the two branches of one cycle from its lowest point, at the same reference."""
    half = reference.size // 2
    return float(np.abs(y[half:][::-1] - y[: half + 1]).max())


@pytest.mark.parametrize("plant", [LAW, hs.Actuator(hysteresis=LAW, vibration=MODE)], ids=["law", "chain"])
def test_a_hysteresis_assessment_is_counted_by_hand(plant):
    pid = hs.PID(ki=0.05)  # stable on the chain at the law's largest slope
    found = assess_hysteresis(plant, pid, **TRIANGLE)
    reference = hs.signals.triangle(0.0, 1.0, cycles=10, samples_per_cycle=200)
    t = 0.05 * np.arange(2001)
    run = hs.close_loop(plant, pid, t, reference)
    assert found.closed.y.tolist() == run.y.tolist()
    open_y = hs.close_loop(plant, applied(1.0 / found.secant_gain), t, reference).y
    assert found.open_y == pytest.approx(open_y, abs=1e-12)
    assert np.array_equal(found.open_u, reference / found.secant_gain)
    last = slice(-201, None)
    before, after = open_y[last], run.y[last]
    widths = [width(reference[last], y) for y in (before, after)]
    assert [found.open_width, found.closed_width] == pytest.approx(widths)
    relative = (found.closed_width / np.ptp(after)) / (found.open_width / np.ptp(before))
    assert found.hysteresis_reduction_percent == pytest.approx(100.0 * (1.0 - relative))
    assert math.isnan(found.lag_reduction_percent)
    assert found.tracking_rms == pytest.approx(np.sqrt(np.mean((reference[last] - after) ** 2)))
    assert found.closure_gap == pytest.approx(after[-1] - after[0], abs=1e-15)
    line = without_memory(hs.Actuator(hysteresis=LAW), reference[last] / found.secant_gain).hysteresis
    straight = hs.Actuator(hysteresis=line, vibration=getattr(plant, "vibration", None))
    lagging = hs.close_loop(straight, pid, t, reference).y[last]
    assert found.lag_width == pytest.approx(width(reference[last], lagging))


def applied(gain):
    """Controller of gain times reference, whatever is measured: 2^-900 of y is nothing compared with it."""
    return hs.PID(kp=2.0**-900, setpoint_weight=gain * 2.0**900)


def test_the_open_loop_has_the_stroke_of_the_reference():
    found = assess_hysteresis(LAW, hs.PID(ki=0.3), **TRIANGLE)
    assert np.ptp(found.open_y[-201:]) == pytest.approx(1.0, rel=1e-3)  # ten cycles are nearly steady
    assert np.ptp(found.open_u) == pytest.approx(1.0 / found.secant_gain)


@pytest.mark.parametrize("plant", [LAG, MODE, hs.Actuator(vibration=MODE)], ids=["lag", "mode", "actuator"])
def test_the_loop_of_a_linear_plant_is_lag(plant):
    found = assess_hysteresis(plant, hs.PID(kp=0.2, ki=0.1), **TRIANGLE)
    assert (found.lag_width, found.open_lag_width) == (found.closed_width, found.open_width)
    assert math.isnan(found.hysteresis_reduction_percent)
    assert math.isfinite(found.lag_reduction_percent)


def test_a_larger_integral_gain_leaves_less_hysteresis():
    slow = TRIANGLE | {"period": 1000.0, "sample_time": 0.5}  # so that the lag, 0.003 / ki, is below the hysteresis
    found = [assess_hysteresis(LAW, hs.PID(ki=ki), **slow) for ki in (0.25, 0.5, 1.0)]
    for weaker, stronger in itertools.pairwise(found):
        assert stronger.hysteresis_reduction_percent > weaker.hysteresis_reduction_percent
        assert stronger.tracking_rms < weaker.tracking_rms
        assert stronger.lag_width < weaker.lag_width
        assert stronger.open_width == weaker.open_width
    assert found[-1].hysteresis_reduction_percent > 0.0


def test_a_step_assessment_is_the_reduction_of_its_two_loops():
    chain = hs.Actuator(hysteresis=LAW, vibration=MODE)
    pid = hs.PID(kp=0.1, ki=0.05)
    found = assess_step(chain, pid, step=0.5, duration=80.0, sample_time=0.05, u0=0.2)
    rest = MODE.dc_gain * LAW.response([0.2])[0]
    run = hs.close_loop(chain, pid, 0.05 * np.arange(1601), np.full(1601, rest + 0.5), u0=0.2)
    assert found.closed.y.tolist() == run.y.tolist()
    assert [found.closed.y[0], found.open_y[0]] == pytest.approx([rest, rest], abs=1e-12)
    gain = secant_gain(chain, np.array([rest, rest + 0.5]))
    voltage = (found.open_y[-1] / MODE.dc_gain, LAW.response([0.2, 0.2 + 0.5 / gain])[-1])
    assert voltage[0] == pytest.approx(voltage[1], abs=1e-5)  # exp(-0.2 80) of the step is left
    # damping ratio 0.2 times frequency 1
    again = vibration_reduction(0.05 * np.arange(1601), found.open_y, run.y, decay_rate=0.2)
    assert found.reduction.open == again.open
    assert found.reduction.overshoot_reduction_percent == again.overshoot_reduction_percent
    residuals = (found.reduction.residual_rms_reduction_percent, again.residual_rms_reduction_percent)
    assert residuals[0] == pytest.approx(residuals[1], abs=0.1)  # a sample at the window's end may come or go


def test_what_a_step_does_not_have_is_nan():
    law = assess_step(LAW, hs.PID(ki=2.0), step=0.5, duration=10.0, sample_time=0.05).reduction
    assert np.isnan([law.overshoot_reduction_percent, law.residual_rms_reduction_percent]).all()
    assert math.isfinite(law.settling_time_reduction_percent)
    lag = assess_step(LAG, hs.PID(ki=0.2), step=0.5, duration=50.0, sample_time=0.05).reduction
    assert np.isnan([lag.overshoot_reduction_percent, lag.residual_rms_reduction_percent]).all()  # no vibration
    short = assess_step(MODE, hs.PID(ki=0.02), step=0.5, duration=30.0, sample_time=0.05).reduction
    assert math.isnan(short.residual_rms_reduction_percent)  # 2 ln(50) / 0.2 is 39 s
    still = assess_step(MODE, hs.PID(ki=0.02), step=0.0, duration=30.0, sample_time=0.05).reduction
    assert np.isnan([still.overshoot_reduction_percent, still.open.t98]).all()


def test_the_sign_of_the_plant_and_of_the_step_do_not_matter():
    steps = {"duration": 60.0, "sample_time": 0.05}
    plain = assess_step(MODE, hs.PID(kp=0.1, ki=0.1), step=1.0, **steps)
    turned = assess_step(replace(MODE, num=(-2.0,)), hs.PID(kp=-0.1, ki=-0.1), step=1.0, **steps)
    down = assess_step(MODE, hs.PID(kp=0.1, ki=0.1), step=-1.0, **steps)
    for other in (turned, down):
        for name in ("overshoot", "residual_rms", "settling_time"):
            figure = f"{name}_reduction_percent"
            assert getattr(other.reduction, figure) == pytest.approx(getattr(plain.reduction, figure), rel=1e-9), name


def test_a_square_wave_is_measured_over_its_last_period():
    pid = hs.PID(kp=0.05, ki=0.1)
    found = assess_square_wave(MODE, pid, **WAVE)
    reference = np.tile(np.repeat([0.0, 1.0], 600), 3)
    t = 0.05 * np.arange(3600)
    closed = hs.close_loop(MODE, pid, t, reference).y
    opened = hs.close_loop(MODE, applied(0.5), t, reference).y
    assert found.closed.y.tolist() == closed.tolist()
    assert found.open_y == pytest.approx(opened, abs=1e-12)
    for rms, excess, y in (
        (found.open_tracking_rms, found.open_peak_excess_percent, opened),
        (found.tracking_rms, found.peak_excess_percent, closed),
    ):
        assert rms == pytest.approx(np.sqrt(np.mean((reference - y)[-1200:] ** 2)), abs=1e-12)
        assert excess == pytest.approx(100.0 * max(y[-1200:].max() - 1.0, -y[-1200:].min(), 0.0), abs=1e-9)
    # zeta = 0.2: what is left after 30 s is exp(-6) at most, on either side of the step
    overshoot = 100.0 * math.exp(-math.pi * 0.2 / math.sqrt(1.0 - 0.04))
    assert found.open_peak_excess_percent == pytest.approx(overshoot, abs=100.0 * math.exp(-6.0))
    assert found.reduction is None  # a half period of 30 s is shorter than t98 and five periods of 6.4 s


def test_a_square_waves_steps_are_judged_where_its_half_periods_are_long_enough():
    pid, period = hs.PID(kp=0.05, ki=0.1), 2.0 * math.pi / math.sqrt(1.0 - 0.04)
    found = assess_square_wave(MODE, pid, **WAVE | {"period": 120.0})
    assert found.reduction.open.t98 + 5.0 * period < 60.0
    half = slice(-1200, None)
    again = vibration_reduction(found.closed.t[half], found.open_y[half], found.closed.y[half], decay_rate=0.2)
    assert found.reduction.overshoot_reduction_percent == again.overshoot_reduction_percent
    assert found.reduction.closed == again.closed
    t98 = found.reduction.open.t98
    border = 2.0 * (t98 + 5.0 * period)  # the rule, from both sides, where t98 moves by less than a sample
    edges = [0.1 * round((border + shift) / 0.1) for shift in (-0.5, 0.5)]
    rules = [assess_square_wave(MODE, pid, **WAVE | {"period": edge}).reduction for edge in edges]
    assert [rule is None for rule in rules] == [True, False]


def test_a_plant_without_vibration_has_no_period_to_wait_for():
    found = assess_square_wave(LAG, hs.PID(kp=3.0, ki=3.0), **WAVE)
    assert math.isnan(found.reduction.residual_rms_reduction_percent)
    assert found.reduction.settling_time_reduction_percent > 0.0
    assert found.open_peak_excess_percent == 0.0
    assert found.peak_excess_percent < 1.0  # the sampled controller's zero cancels the pole but for the sample time
    assert found.tracking_rms < found.open_tracking_rms


def test_a_half_period_in_which_the_open_loop_does_not_arrive_or_of_a_few_samples_has_no_step():
    slow = hs.TransferFunction(num=(1.0,), den=(1.0, 0.02, 1.0))
    for plant, period in ((slow, 6.0), (LAG, 0.5)):
        assert assess_square_wave(plant, hs.PID(ki=0.01), **WAVE | {"period": period}).reduction is None


@pytest.mark.parametrize(
    "assess",
    [
        lambda plant: assess_hysteresis(plant, applied(1.0), **TRIANGLE),
        lambda plant: assess_step(plant, applied(1.0), step=1.0, duration=10.0, sample_time=0.05),
        lambda plant: assess_square_wave(plant, applied(1.0), **WAVE),
    ],
    ids=["hysteresis", "step", "square wave"],
)
@pytest.mark.parametrize("sample", ["end", "start"])
def test_the_open_loop_is_read_when_the_closed_one_is(assess, sample):
    """A controller that does not look at the plant, of the secant gain one: its loop is the open loop."""
    found = assess(replace(PROPER, sample=sample))
    closed = found.closed
    if "secant_gain" in dir(found):
        closed = hs.close_loop(PROPER, applied(1.0 / found.secant_gain), closed.t, closed.reference)
    assert found.open_y == pytest.approx(closed.y, abs=1e-12)


ONE_STEP = {"step": 1.0, "duration": 9.0, "sample_time": 0.1}
INTEGRATOR = hs.TransferFunction(num=(1.0,), den=(1.0, 0.0))
test_wrong_arguments_are_named = refused(
    (assess_hysteresis, 3, TRIANGLE, TypeError, "got int"),
    (assess_hysteresis, LAW, TRIANGLE | {"high": -1.0}, "high must be above low, .* got low 0.0 and high -1.0"),
    (assess_hysteresis, LAW, TRIANGLE | {"sample_time": 0.4}, "samples_per_cycle must be even, .* got 25"),
    (assess_hysteresis, LAW, TRIANGLE | {"cycles": 0}, "at least 1, got 0"),
    (assess_hysteresis, hs.Line(slope=0.0), TRIANGLE, "gain is 0.0: no input drives it"),
    (assess_hysteresis, hs.Stop(threshold=0.1), TRIANGLE, "no steady cycle has its span"),
    (assess_step, INTEGRATOR, ONE_STEP, "gain is inf"),
    (assess_step, LAW, ONE_STEP | {"step": 0.0}, "the reference stands still"),
    (assess_square_wave, LAG, WAVE | {"period": 1.03}, "whole number of samples"),
    (assess_square_wave, LAG, WAVE | {"high": 0.0}, "high (must be )?above low"),
    (assess_square_wave, LAG, WAVE | {"low": 1.0, "high": 0.0}, r"high must be above low.* got .*1.* and .*0"),
    (assess_hysteresis, LAG, TRIANGLE | {"period": 10.02}, "period"),
    call=lambda assess, plant, task: assess(plant, hs.PID(), **task),
)


test_an_unstable_loop_is_an_error_in_every_assessment = refused(
    (assess_hysteresis, LAW, TRIANGLE, hs.SimulationError, "t = "),
    (assess_step, LAG, ONE_STEP | {"duration": 300.0}, hs.SimulationError, "t = "),
    (assess_square_wave, LAG, WAVE, hs.SimulationError, "t = "),
    call=lambda assess, plant, task: assess(plant, hs.PID(kp=-40.0), **task),
)


def test_a_creeping_plant_is_judged_over_the_cycles_that_it_is_driven():
    """Its cycle never becomes steady: the secant gain is that of the last one, which the open loop then has."""
    law = hs.BoucWen(beta=0.5, gamma=0.3, gain=-0.5, feedthrough=1.0)
    plant = hs.Actuator(hysteresis=law, creep=hs.Creep.per_decade(1.5))
    inverse = hs.TrackingController(feedforward=hs.InverseFeedforward.of(plant), preview=True)
    found = hs.control.assess_hysteresis(plant, inverse, low=0.5, high=2.0, period=1.0, sample_time=0.01)
    # a rounding of the width against a loop of some tenths
    assert found.hysteresis_reduction_percent > 100.0 - 1e-9
    # the hold is a sample late, so that the last cycle of both is one sample of a hundred apart
    assert found.secant_gain == pytest.approx(np.ptp(found.open_y[-100:]) / np.ptp(found.open_u[-100:]), rel=0.02)


def test_the_open_loop_by_itself_is_that_of_the_assessment():
    pid, reference = hs.PID(ki=4.0), hs.signals.triangle(0.0, 1.0, cycles=10, samples_per_cycle=200)
    found, opened = assess_hysteresis(LAW, pid, **TRIANGLE), hs.control.open_loop(LAW, reference, 0.05, 200)
    assert np.array_equal([opened.y, opened.u], [found.open_y, found.open_u])
    assert opened.reduction_percent(found.closed.y) == found.hysteresis_reduction_percent
    assert opened.loop.max_width == found.open_width


@pytest.mark.parametrize("samples", [0, 150])
def test_a_reference_of_no_whole_cycles_is_refused(samples):
    assert_refused("whole cycles", hs.control.open_loop, LAW, np.ones(samples + 1), 0.05, 200)


SHAPED = hs.TrackingController(feedforward=hs.InverseFeedforward(), shaper=hs.Shaper(smoothing=2.0), preview=True)
STEP = {"step": 1.0, "duration": 60.0, "sample_time": 0.05}


def test_a_controller_that_is_right_holds_without_moving():
    mode = hs.mode(2.0, 0.1)
    at_once, held = (assess_step(mode, SHAPED, hold=hold, **STEP) for hold in (0.0, 5.0))
    assert held.closed.y.size == at_once.closed.y.size + 100
    assert np.abs(held.closed.y[100:] - at_once.closed.y).max() < 1e-12
    assert np.array_equal(held.open_y, at_once.open_y)


def test_a_controller_that_is_wrong_comes_to_rest_before_the_step():
    """Its inverse takes the law at 1 V to be elsewhere, which a hold lets the integral put right."""
    wrong = hs.TrackingController(
        feedforward=hs.InverseFeedforward(law=replace(LAW, offset=0.3)), feedback=hs.PID(ki=2)
    )
    before = assess_step(LAW, wrong, u0=1.0, hold=30.0, **STEP).closed.y[:600]
    assert np.abs(before - before[0]).max() > 0.1
    assert np.abs(before[-10:] - before[0]).max() < 1e-6


def test_a_step_that_is_known_ahead_comes_to_the_open_loop_when_it_comes_to_the_reference():
    mode, ahead = hs.mode(2.0, 0.1), SHAPED.ahead(0.05)
    told, known = (assess_step(mode, SHAPED, known_ahead=known, **STEP) for known in (False, True))
    assert np.array_equal(told.closed.y, known.closed.y)
    assert np.argmax(known.closed.reference > 0.5) == ahead > 0
    assert np.array_equal(known.open_y[ahead:], told.open_y[:-ahead])
