"""The measures of a step are the closed forms of a second-order system, whatever the units."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import brentq
from strategies import assert_refused

import hysim as hs
from hysim.metrics import reduction_percent, step_metrics, vibration_reduction

N = 20_001


def second_order(zeta):
    """The step response of omega_n = 1, over 30 time constants: its last tenth is at rest to exp(-27)."""
    damped = math.sqrt(1.0 - zeta**2)

    def y(t):
        return 1.0 - np.exp(-zeta * t) * (np.cos(damped * t) + zeta / damped * np.sin(damped * t))

    return y, np.linspace(0.0, 30.0 / zeta, N), damped


@given(st.floats(0.1, 0.95))
def test_second_order_systems_have_their_closed_forms(zeta):
    y, t, damped = second_order(zeta)
    dt = t[1]
    found = step_metrics(t, y(t))
    # a sample is at most dt / 2 off the peak, where y'' <= 1
    assert found.overshoot == pytest.approx(100.0 * math.exp(-math.pi * zeta / damped), abs=100.0 * dt**2 / 8 + 1e-8)
    peak = math.pi / damped

    def crossing(level):
        return brentq(lambda time: y(time) - level, 0.0, peak, xtol=1e-14)

    times = {level: crossing(level) for level in (0.1, 0.9, 0.98)}
    # the chord is off by dt^2 / 8 y'', y'' <= 1, over the slope; the latter is small where 98 % is near the peak
    slope = {level: (y(time + 1e-6) - y(time - 1e-6)) / 2e-6 for level, time in times.items()}
    off = {level: dt**2 / 4 / slope[level] + 1e-9 for level in times}
    assert found.rise_time == pytest.approx(times[0.9] - times[0.1], abs=off[0.1] + off[0.9])
    assert found.t98 == pytest.approx(times[0.98], abs=off[0.98])
    assert found.initial == 0.0
    assert found.final == pytest.approx(1.0, abs=1e-10)


@given(st.floats(0.1, 0.95))
def test_a_response_has_settled_after_its_last_extreme_beyond_two_percent(zeta):
    y, t, damped = second_order(zeta)
    heights = np.exp(-math.pi * zeta / damped * np.arange(60))
    assume(np.abs(heights - 0.02).min() > 2e-4)  # not just touching, where a sample decides
    last = int(np.flatnonzero(heights > 0.02)[-1])  # extreme number `last`, at last pi / damped, and on its far side
    begin, end = np.array([last, last + 1]) * math.pi / damped
    expected = brentq(lambda time: abs(y(time) - 1.0) - 0.02, begin, brentq(lambda s: y(s) - 1.0, begin, end))
    slope = abs(y(expected + 1e-6) - y(expected - 1e-6)) / 2e-6
    assert step_metrics(t, y(t)).settling_time == pytest.approx(expected, abs=t[1] ** 2 / 4 / slope + 1e-7)


def test_a_first_order_lag_has_no_overshoot_and_its_logarithms():
    t = np.linspace(0.0, 40.0, 40_001)
    found = step_metrics(t, 1.0 - np.exp(-t))
    assert found.overshoot == 0.0
    # a chord of 0.001 is off by dt / 8 of a time constant's dt
    assert found.rise_time == pytest.approx(math.log(9.0), abs=1e-6)
    assert found.settling_time == pytest.approx(math.log(50.0), abs=1e-6)
    assert found.t98 == pytest.approx(math.log(50.0), abs=1e-6)


responses = st.lists(st.floats(-2.0, 3.0), min_size=10, max_size=60)
scales = st.floats(0.01, 100.0) | st.floats(-100.0, -0.01)


@given(responses, scales, st.floats(-10.0, 10.0), st.floats(0.1, 10.0), st.floats(-5.0, 5.0))
def test_scale_sign_offset_and_the_origin_of_time_do_not_matter(values, scale, offset, unit, t0):
    y = np.array(values)
    # a step so small beside its wiggles or the offset, or a level so near a sample, that rounding would decide
    change = y[-(y.size // 10) :].mean() - y[0]
    assume(abs(change) > 1e-2)
    assume(np.abs(((y - y[0]) / change)[:, np.newaxis] - [0.1, 0.9, 0.98, 1.02]).min() > 1e-6)
    t = np.cumsum(0.5 + 0.1 * (np.arange(y.size) % 3))
    plain, other = step_metrics(t, y), step_metrics(t0 + unit * t, offset + scale * y)
    rounding = 1e-7  # 1e-15 (10 / 0.01) over a step of 0.01, over the distance 1e-6 between a level and a sample
    assert other.overshoot == pytest.approx(plain.overshoot, rel=rounding, abs=rounding)
    for name in ("rise_time", "settling_time", "t98"):
        expected = unit * getattr(plain, name)
        assert getattr(other, name) == pytest.approx(expected, rel=1e-6, abs=1e-5, nan_ok=True), name
    assert other.initial == pytest.approx(offset + scale * plain.initial, abs=1e-9)
    assert other.final == pytest.approx(offset + scale * plain.final, abs=1e-9)


@given(st.integers(10, 99))
def test_the_final_level_is_the_mean_of_the_last_tenth(n):
    y = np.arange(float(n)) ** 2
    assert step_metrics(np.arange(n), y).final == np.mean(y[n - n // 10 :])


def test_a_hand_drawn_response_is_measured_by_hand():
    t = np.arange(21.0)
    y = 10.0 + 2.0 * np.array([0, 0.5, 1.0, 1.3, 1.1, 0.9] + [1.0] * 15)
    found = step_metrics(t, y)
    assert (found.initial, found.final) == (10.0, 12.0)
    assert found.rise_time == pytest.approx(1.8 - 0.2)
    assert found.t98 == pytest.approx(1.96)
    assert found.overshoot == pytest.approx(30.0)
    assert found.settling_time == pytest.approx(5.8)  # 0.98, four fifths of the way from 0.9 to 1


def test_a_level_is_passed_when_it_is_first_reached():
    """A pause at exactly 10 % and at 90 %: the rise begins and ends where they begin."""
    y = np.array([0.0, 0.1, 0.1, 0.1, 0.5, 0.9] + [1.0] * 22)
    assert step_metrics(np.arange(28.0), y).rise_time == pytest.approx(5.0 - 1.0, rel=1e-12)


def test_what_does_not_exist_is_nan():
    t = np.arange(40.0)
    still = step_metrics(t, np.full(40, 3.0))
    back = step_metrics(t, np.concatenate([np.zeros(5), np.ones(10), np.zeros(25)]))
    for found in (still, back):
        assert found.initial == found.final
        for name in ("rise_time", "overshoot", "settling_time", "t98"):
            assert math.isnan(getattr(found, name)), name
    ringing = step_metrics(t, 1.0 - np.cos(t) * np.exp(-0.01 * t))
    assert math.isnan(ringing.settling_time)
    assert ringing.overshoot > 50.0
    late = np.ones(40)
    late[0], late[34] = 0.0, 1.5  # settled at a sample before the last tenth, which begins at number 36, or not
    assert step_metrics(t, late).settling_time == pytest.approx(35.0 - 0.02 / 0.5)
    late[35] = 1.1
    assert math.isnan(step_metrics(t, late).settling_time)


def test_vibration_reduction_is_the_computation_by_hand():
    dt, decay, omega = 0.01, 0.4, 4.0
    t = dt * np.arange(6001)
    shape = np.exp(-decay * t) * np.cos(omega * t)
    opened, closed = 1.0 - shape, 5.0 - 2.0 * (1.0 - 0.25 * shape - 0.75 * np.exp(-3.0 * t))
    found = vibration_reduction(t, opened, closed, decay_rate=decay)
    # overshoots: the open loop's largest sample; the closed one's likewise, its final value being 3
    excess_open, excess_closed = -shape.min(), (-0.25 * shape - 0.75 * np.exp(-3.0 * t)).max()
    assert found.overshoot_reduction_percent == pytest.approx(100 * (1 - excess_closed / excess_open), abs=1e-6)
    t98 = brentq(lambda s: np.exp(-decay * s) * np.cos(omega * s) - 0.02, 0.0, math.pi / omega)
    assert found.open.t98 == pytest.approx(t98, abs=dt**2 * omega)  # chord: omega^2 dt^2 / 8 over a slope of omega
    window = (t >= t98) & (t <= t98 + 2.0 * math.log(50.0) / decay)
    rms_open = np.sqrt(np.mean(shape[window] ** 2))
    rms_closed = np.sqrt(np.mean((0.25 * shape + 0.75 * np.exp(-3.0 * t))[window] ** 2))
    # the final values are off by the last tenth's remaining vibration, exp(-22)
    assert found.residual_rms_reduction_percent == pytest.approx(100 * (1 - rms_closed / rms_open), abs=1e-6)
    expected = 100.0 * (1.0 - found.closed.settling_time / found.open.settling_time)
    assert found.settling_time_reduction_percent == pytest.approx(expected)
    assert found.open == step_metrics(t, opened)
    assert found.closed == step_metrics(t, closed)


def test_a_loop_that_changes_nothing_reduces_nothing():
    y, t, _ = second_order(0.2)
    same = vibration_reduction(t, y(t), -3.0 * y(t), decay_rate=0.2)
    assert same.overshoot_reduction_percent == pytest.approx(0.0, abs=1e-9)
    assert same.residual_rms_reduction_percent == pytest.approx(0.0, abs=1e-9)
    assert same.settling_time_reduction_percent == pytest.approx(0.0, abs=1e-9)


def test_the_residuals_window_must_end_within_the_record():
    y, t, _ = second_order(0.2)
    opened, closed = y(t), 1.0 - np.exp(-t)
    t98 = step_metrics(t, opened).t98
    fits = 2.0 * math.log(50.0) / (t[-1] - t98)  # the decay rate whose window ends with the record
    inside, beyond = (vibration_reduction(t, opened, closed, decay_rate=fits * k) for k in (1.001, 0.999))
    assert math.isfinite(inside.residual_rms_reduction_percent)
    assert math.isnan(beyond.residual_rms_reduction_percent)
    assert beyond.overshoot_reduction_percent == pytest.approx(100.0)
    assert math.isfinite(beyond.settling_time_reduction_percent)


@pytest.mark.parametrize("decay_rate", [math.nan, 0.0, -1.0])
def test_without_a_decay_there_is_no_window(decay_rate):
    y, t, _ = second_order(0.2)
    found = vibration_reduction(t, y(t), 1.0 - np.exp(-t), decay_rate=decay_rate)
    assert math.isnan(found.residual_rms_reduction_percent)
    assert found.overshoot_reduction_percent == pytest.approx(100.0)


def test_an_open_loop_without_overshoot_has_none_to_take_away():
    y, t, _ = second_order(0.2)
    found = vibration_reduction(t, 1.0 - np.exp(-t), y(t), decay_rate=0.2)
    assert math.isnan(found.overshoot_reduction_percent)
    assert found.settling_time_reduction_percent < 0.0
    rising = t[: t.size // 2]  # and has not come to rest: the last value is above the mean of the last tenth
    found = vibration_reduction(rising, 1.0 - np.exp(-rising), y(rising), decay_rate=0.2)
    assert math.isnan(found.overshoot_reduction_percent)
    assert reduction_percent(2.0, 3.0) == -50.0
    assert math.isnan(reduction_percent(0.0, 1.0))
    assert math.isnan(reduction_percent(math.nan, 1.0))


@pytest.mark.parametrize(
    ("t", "y", "message"),
    [
        (np.arange(10.0), np.zeros(11), "t and y must have equal lengths, got 10 and 11"),
        (np.arange(9.0), np.zeros(9), "at least 10 samples, got 9"),
        (np.arange(10.0), np.full(10, np.nan), "y must be finite, got nan at index 0"),
        (np.arange(10.0), np.zeros((10, 1)), "y must have 1 axis"),
        (-np.arange(10.0), np.zeros(10), "t must increase from sample to sample, got -1 after -?0"),
    ],
)
def test_wrong_arguments_are_named(t, y, message):
    assert_refused(message, step_metrics, t, y)
    assert_refused(message, vibration_reduction, t, y, y, decay_rate=1.0)


def test_a_real_plant_is_measured_as_its_closed_form():
    zeta, omega = 0.25, 3.0
    plant = hs.TransferFunction(num=(-2.0 * omega**2,), den=(1.0, 2 * zeta * omega, omega**2))
    t = 0.002 * np.arange(20_001)
    found = step_metrics(t, plant.response(np.full(t.size, 0.7), 0.002))
    assert found.final == pytest.approx(-1.4, abs=1e-8)  # exp(-0.75 36) is left
    overshoot = 100.0 * math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))
    assert found.overshoot == pytest.approx(overshoot, abs=100.0 * (omega * 0.002) ** 2 / 8)
