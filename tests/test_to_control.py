"""What python-control gets is what hysim simulates: plants under their hold, and the PID as it is sampled."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import assert_refused, refused

import hysim as hs

H = 0.1
EXACT = 1e-12
PLANTS = [
    hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)),
    hs.TransferFunction(num=(0.5, 2.0), den=(1.0, 0.8, 2.0)),
    hs.TransferFunction(num=(1.0, 0.5, 2.0), den=(2.0, 0.8, 2.0)),
    hs.TransferFunction(num=(3.0,), den=(2.0,)),
]
DELAYS = [0.0, 0.03, 0.1, 0.27]


def late(plant, delay, sample="end"):
    return hs.TransferFunction(num=plant.num, den=plant.den, delay=delay, sample=sample)


def before(plant, v):
    """The displacement just before each sample of an input that begins at the first."""
    return plant.response(np.append(0.0, v), H)[:-1]


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("plant", PLANTS, ids=["lag", "mode", "proper", "gain"])
def test_the_discrete_form_responds_as_the_plant_just_before_each_sample(plant, delay):
    plant = late(plant, delay)
    system = hs.to_control(plant, H)
    assert system.dt == H
    for v in (np.ones(80), np.random.default_rng(0).standard_normal(80)):
        y = control.forced_response(system, H * np.arange(80), v).outputs
        assert y == pytest.approx(before(plant, v), abs=EXACT * 10)  # outputs up to 5


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("plant", PLANTS, ids=["lag", "mode", "proper", "gain"])
def test_the_discrete_form_has_the_frequency_response_of_the_sampled_plant(plant, delay):
    """sum of y_k z^-k of the exact impulse response, which has decayed to exp(-0.2 150) = 1e-13 at its end."""
    plant = late(plant, delay)
    impulse = np.zeros(1500)
    impulse[0] = 1.0
    y = before(plant, impulse)
    omega = np.array([0.1, 1.0, 3.0, 20.0, np.pi / H])
    expected = (y * np.exp(-1j * omega[:, np.newaxis] * H * np.arange(1500))).sum(axis=1)
    assert hs.to_control(plant, H)(np.exp(1j * omega * H)) == pytest.approx(expected, abs=1e-10)


def test_a_short_sample_time_gives_the_continuous_plant_half_a_sample_late():
    plant, h, omega = late(PLANTS[1], 0.25), 0.002, np.array([0.3, 1.4, 5.0])
    s = 1j * omega
    # the hold is half a sample late and sinc(omega h / 2) small: (omega h)^2 / 12 is 1e-5
    expected = (0.5 * s + 2.0) / (s**2 + 0.8 * s + 2.0) * np.exp(-s * (0.25 + h / 2))
    assert hs.to_control(plant, h)(np.exp(s * h)) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("sample", ["start", "end"])
def test_where_the_output_is_taken_does_not_change_the_system(sample):
    system, other = hs.to_control(late(PLANTS[2], 0.13, sample), H), hs.to_control(late(PLANTS[2], 0.13), H)
    for name in "ABCD":
        assert np.array_equal(getattr(system, name), getattr(other, name))


def test_an_actuator_without_a_law_is_its_vibration():
    plant = PLANTS[1]
    inside = hs.Actuator(vibration=plant)
    assert np.array_equal(hs.to_control(inside, H).A, hs.to_control(plant, H).A)
    assert hs.to_control(inside)(1j) == hs.to_control(plant)(1j)
    through = hs.to_control(hs.Actuator(), H)
    assert through(1j) == pytest.approx(1.0 / 1j)  # y_k = u_(k-1)
    assert hs.to_control(hs.Actuator())(1j) == pytest.approx(1.0)


def test_the_continuous_form_is_the_transfer_function():
    s = 1j * np.array([0.1, 1.0, 10.0])
    for plant in PLANTS:
        expected = np.polyval(plant.num, s) / np.polyval(plant.den, s)
        assert hs.to_control(plant)(s) == pytest.approx(expected, rel=EXACT)


gains = st.integers(-80, 80).map(lambda k: k / 8)  # none so small beside the others that it vanishes in sums


@given(gains, gains, gains, st.floats(0.0, 1.0))
def test_the_discrete_pid_has_the_impulse_response_of_its_error(kp, ki, kd, T_f):
    pid = hs.PID(kp=kp, ki=ki, kd=kd, derivative_filter=T_f, derivative_weight=1.0)
    impulse = np.zeros(30)
    impulse[0] = 1.0
    u, _ = pid.advance(impulse, np.zeros(30), H)
    system = hs.to_control(pid, H)
    assert system.dt == H
    y = control.forced_response(system, H * np.arange(30), impulse).outputs
    # the sum over a common denominator cancels: its coefficients are up to kd / h of 100, powers of 1 / (z - 1)
    assert y == pytest.approx(u, abs=1e-9 * (1.0 + abs(kp) + abs(ki) + abs(kd) / H))


@given(gains, gains, gains, st.floats(0.01, 1.0))
def test_the_continuous_pid_is_its_formula(kp, ki, kd, T_f):
    s = 1j * np.array([0.1, 1.0, 10.0])
    expected = kp + ki / s + kd * s / (1.0 + T_f * s)
    system = hs.to_control(hs.PID(kp=kp, ki=ki, kd=kd, derivative_filter=T_f))
    scale = abs(kp) + 10 * abs(ki) + 10 * abs(kd)
    assert system(s) == pytest.approx(expected, abs=1e-13 * scale + 1e-300)


def test_limits_and_weights_are_left_out():
    plain = hs.PID(kp=1.0, ki=2.0, kd=0.1)
    other = hs.PID(kp=1.0, ki=2.0, kd=0.1, limits=(0.0, 1.0), setpoint_weight=0.3, derivative_weight=0.7)
    z = np.exp(0.3j)
    assert hs.to_control(plain, H)(z) == hs.to_control(other, H)(z)


def test_the_closed_loops_poles_tell_whether_the_loop_is_stable():
    """Bisected over kp: python-control's poles and the simulated loop leave the circle at the same gain."""
    plant = hs.Actuator(vibration=late(PLANTS[0], 0.15))
    edge = [0.0, 100.0]
    for _ in range(40):
        kp = sum(edge) / 2
        loop = control.feedback(hs.to_control(plant, H) * hs.to_control(hs.PID(kp=kp), H), 1.0)
        edge[int(np.abs(loop.poles()).max() > 1.0)] = kp
    t = H * np.arange(3000)
    stable = hs.close_loop(plant, hs.PID(kp=0.99 * edge[0]), t, np.ones(3000)).error
    unstable = hs.close_loop(plant, hs.PID(kp=1.01 * edge[0]), t, np.ones(3000)).error
    assert np.ptp(stable[-100:]) < 1e-2 * np.ptp(stable[:100])
    assert np.ptp(unstable[-100:]) > 10 * np.ptp(unstable[:100])


test_what_has_no_linear_system_is_refused = refused(
    (lambda: hs.to_control(3.0), TypeError, "Actuator, a law or a linear plant, got float"),
    (lambda: hs.to_control(late(PLANTS[0], 0.1)), "dead time .* give a sample_time"),
    (lambda: hs.to_control(hs.PID(kd=1.0)), "not proper; give a derivative_filter or a sample_time"),
)


@pytest.mark.parametrize("sample_time", [0.0, -0.1, np.nan, np.inf])
@pytest.mark.parametrize("plant", [PLANTS[0], hs.PID(kp=1.0, ki=1.0)], ids=["plant", "pid"])
def test_a_sample_time_that_is_none_is_named(plant, sample_time):
    assert_refused(f"sample_time must be positive and finite, got {sample_time}", hs.to_control, plant, sample_time)
