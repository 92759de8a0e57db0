"""A PID is its difference equations: started without a bump, cut where one likes, the same bits as in a loop."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import refused

import hysim as hs

gains = st.integers(-160, 160).map(lambda k: k / 8)
times = st.floats(0.0, 2.0)


@st.composite
def pids(draw):
    limits = draw(st.none() | st.tuples(st.floats(-2.0, 0.0), st.floats(0.0, 2.0)))
    return hs.PID(
        kp=draw(gains),
        ki=draw(gains),
        kd=draw(gains),
        derivative_filter=draw(times),
        limits=limits,
        tracking_time=draw(st.none() | times),
        setpoint_weight=draw(st.floats(0.0, 1.0)),
        derivative_weight=draw(st.floats(0.0, 1.0)),
    )


signals = st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=30)


@given(gains, st.floats(0.01, 100.0), times, times, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_standard_form_is_the_constructors(Kp, Ti, Td, T_f, b, c):
    further = {"derivative_filter": T_f, "limits": (-1.0, 2.0), "tracking_time": 0.3}
    weights = {"setpoint_weight": b, "derivative_weight": c}
    standard = hs.PID.standard(Kp, Ti, Td, **further, **weights)
    assert standard == hs.PID(kp=Kp, ki=Kp / Ti, kd=Kp * Td, **further, **weights)


def test_the_standard_form_leaves_out_what_is_not_given():
    assert hs.PID.standard(3.0) == hs.PID(kp=3.0)
    assert hs.PID.standard(3.0, Td=0.5) == hs.PID(kp=3.0, kd=1.5)


@given(pids(), signals, st.floats(0.001, 1.0), st.data())
def test_cut_and_continue_gives_the_same_bits(pid, samples, h, data):
    r, y = np.array(samples).T
    cut = data.draw(st.integers(0, r.size))
    whole, end = pid.advance(r, y, h)
    head, state = pid.advance(r[:cut], y[:cut], h) if cut else (np.empty(0), None)
    tail, last = pid.advance(r[cut:], y[cut:], h, state)
    assert np.array_equal(np.concatenate([head, tail]), whole)
    assert last == end


@given(pids(), signals, st.floats(0.001, 1.0))
def test_advance_is_the_recursion_as_written(pid, samples, h):
    r, y = np.array(samples).T
    u, state = pid.advance(r, y, h)
    lag, (lowest, highest) = pid.derivative_filter + h, pid.limits or (-math.inf, math.inf)
    tracking = pid.tracking_time
    if tracking is None and pid.ki:
        tracking = math.sqrt(abs(pid.kd / pid.ki)) if pid.kd else abs(pid.kp / pid.ki)
    integral, derivative = -pid.kp * (pid.setpoint_weight - 1.0) * y[0], 0.0
    seen, expected, command = (pid.derivative_weight - 1.0) * y[0], [], 0.0
    for target, measured in zip(r, y, strict=True):
        now = pid.derivative_weight * target - measured
        derivative = pid.derivative_filter / lag * derivative + pid.kd / lag * (now - seen)
        command = pid.kp * (pid.setpoint_weight * target - measured) + integral + derivative
        expected.append(min(max(command, lowest), highest))
        integral += pid.ki * h * (target - measured)
        if pid.ki:
            integral += h / max(tracking, h) * (expected[-1] - command)
        seen = now
    scale = 1.0 + abs(pid.kp) + abs(pid.ki) + abs(pid.kd) / lag
    tolerance = 1e-13 * scale  # 30 samples of a few roundings each, of terms of this size
    assert u == pytest.approx(expected, abs=tolerance)
    assert state == pytest.approx((command, integral, derivative, seen), abs=tolerance)


@given(pids(), st.floats(-1.0, 1.0))
def test_advance_gives_the_same_bits_as_a_loop(pid, u0):
    actuator = hs.Actuator(
        hysteresis=hs.BoucWen(gain=0.3, feedthrough=0.5), vibration=hs.TransferFunction(num=(1.0,), den=(1.0, 0.4, 1.0))
    )
    r = np.sin(0.3 * np.arange(30))
    run = hs.close_loop(actuator, pid, 0.25 * np.arange(30), r, u0=u0)
    # the loop starts at the displacement of rest, which is what it then measures up to rounding: start from it
    from hysim.control._loop import RestingPlant

    begin = pid.start(u0, RestingPlant(actuator, 0.25, u0).y0)
    assert np.array_equal(pid.advance(r, run.measurement, 0.25, begin)[0], run.u)


@given(pids(), st.floats(-2.0, 2.0), st.floats(-1.0, 1.0))
def test_a_controller_that_starts_at_rest_stays_there(pid, u0, y0):
    free = dataclasses.replace(pid, limits=None)
    u, _ = free.advance(np.full(10, y0), np.full(10, y0), 0.1, free.start(u0, y0))
    # 0.3 roundings of kp y and kd / h y, ten times over
    assert u == pytest.approx(np.full(10, u0), abs=1e-14 * (1 + abs(free.kp) + 10 * abs(free.kd)))


@pytest.mark.parametrize(
    ("pid", "expected"),
    [
        (hs.PID.standard(3.0, Ti=4.0, Td=1.0), 2.0),  # sqrt(Ti Td)
        (hs.PID.standard(-3.0, Ti=4.0, Td=1.0), 2.0),
        (hs.PID.standard(3.0, Ti=4.0), 4.0),  # Ti
        (hs.PID(ki=2.0), 0.1),  # a pure integral: a sample time
        (hs.PID.standard(3.0, Ti=1e-3), 0.1),
        (hs.PID.standard(3.0, Ti=4.0, tracking_time=7.0), 7.0),
        (hs.PID.standard(3.0, Ti=4.0, tracking_time=0.0), 0.1),
        (hs.PID(kp=3.0, kd=1.0), math.inf),  # nothing to track
    ],
)
def test_the_integral_gives_way_in_the_tracking_time(pid, expected):
    """Far beyond its limits with no error the excess v - u decays as (1 - h / T_t)^k."""
    limited = dataclasses.replace(pid, limits=(-1.0, 1.0))
    _, state = limited.advance(np.zeros(3), np.zeros(3), 0.1, (0.0, 101.0, 0.0, 0.0))
    assert state[1] - 1.0 == pytest.approx(100.0 * (1.0 - 0.1 / expected) ** 3, abs=1e-12)


def test_a_very_slow_integral_has_a_tracking_time():
    assert hs.PID.standard(1.0, Ti=1e160).advance([1.0], [0.0], 0.1)[0].tolist() == [1.0]


def test_a_pid_is_a_value():
    pid = hs.PID(kp=1.0, limits=[0, 5], tracking_time=2)
    assert pid.limits == (0.0, 5.0)
    assert isinstance(pid.tracking_time, float)
    assert pid == hs.PID(kp=1.0, limits=(0.0, 5.0), tracking_time=2.0)
    assert pid != hs.PID(kp=1.0, limits=(0.0, 5.0))
    assert pid != hs.PID(kp=1.0, tracking_time=2.0)
    assert {pid: 1}[hs.PID(kp=1.0, limits=np.array([0.0, 5.0]), tracking_time=2.0)] == 1


def test_a_run_leaves_the_controller_as_it_was():
    pid = hs.PID(kp=0.5, ki=1.0)
    compiled = pid.compiled(0.1, 1.0, 2.0)
    first = pid.advance([1.0, 2.0], [0.0, 0.0], 0.1)
    assert pid.advance([1.0, 2.0], [0.0, 0.0], 0.1)[0].tolist() == first[0].tolist()
    assert not compiled.parameters.flags.writeable
    assert np.array_equal(pid.compiled(0.1, 1.0, 2.0).state, compiled.state)


test_wrong_arguments_are_named = refused(
    (lambda: hs.PID(kp=math.nan), "kp must be finite, got nan"),
    (lambda: hs.PID(ki=math.inf), "ki must be finite, got inf"),
    (lambda: hs.PID(kd="much"), TypeError, "kd must be a number, got 'much'"),
    (lambda: hs.PID(1.0), TypeError, "positional"),
    (lambda: hs.PID(kP=1.0), TypeError, "kP"),
    (lambda: hs.PID(derivative_filter=-0.1), "derivative_filter must not be negative, got -0.1"),
    (lambda: hs.PID(tracking_time=-1.0), "tracking_time must not be negative, got -1.0"),
    (lambda: hs.PID(tracking_time=math.nan), "tracking_time must be finite, got nan"),
    (lambda: hs.PID(limits=(1.0, 0.0)), r"\(lowest, highest\), got \(1.0, 0.0\)"),
    (lambda: hs.PID(limits=(1.0,)), r"\(lowest, highest\), got \(1.0,\)"),
    (lambda: hs.PID(limits=3.0), r"\(lowest, highest\), got \(3.0,\)"),
    (lambda: hs.PID(limits=(0.0, math.inf)), "limits must be finite, got inf at index 1"),
    (lambda: hs.PID(limits="ab"), TypeError, "limits must be numbers"),
    (lambda: hs.PID.standard(1.0, Ti=0.0), "Ti must be positive, got 0.0"),
    (lambda: hs.PID.standard(1.0, Ti=math.nan), "Ti must be positive, got nan"),
    (lambda: hs.PID().advance([1.0], [0.0, 1.0], 1.0), "equal lengths, got 1 and 2"),
    (lambda: hs.PID().advance([1.0], [math.nan], 1.0), "measurement must be finite, got nan"),
    (lambda: hs.PID().advance([[1.0]], [1.0], 1.0), "reference must have 1 axis"),
    (lambda: hs.PID().advance([1.0], [1.0], 0.0), "sample_time must be positive and finite, got 0.0"),
    (lambda: hs.PID().advance([1.0], [1.0], math.nan), "sample_time must be positive and finite"),
)
