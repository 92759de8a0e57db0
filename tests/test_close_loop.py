"""A closed loop is its difference equations, sample by sample, for every law, plant and dead time."""

from dataclasses import replace
from types import SimpleNamespace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import float64
from scipy.linalg import expm
from strategies import assert_refused, bounded_laws, refused

import hysim as hs
from hysim.kernels._compile import signed_kernel
from hysim.kernels.stepping import CONSTANTS, VECTOR
from hysim.models.protocols import CompiledLaw

EXACT = 1e-12  # expm against expm, and a few hundred steps of a stable loop with signals of order one
H = 0.05
LAG = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
MODE = hs.TransferFunction(num=(1.5,), den=(1.0, 0.6, 1.5))
PROPER = hs.TransferFunction(num=(0.2, 0.3, 1.0), den=(1.0, 0.8, 1.0))
THIRD = hs.TransferFunction(num=(-0.1, 2.0), den=(0.5, 1.5, 2.5, 2.0))
GAIN = hs.TransferFunction(num=(0.8,), den=(1.0,))
LAWS = [
    None,
    hs.Line(offset=0.2, slope=0.7),
    hs.BoucWen(beta=0.6, gamma=0.3, n=1.6, feedthrough=0.5, gain=0.4, offset=-0.1, z0=0.2),
    hs.PolynomialBoucWen(beta=0.4, gamma=0.4, gain=0.3, input_coefficients=(0.6, 0.1, -0.02)),
    hs.Duhem.from_terms({"u'": 0.9, "|u'| y": -0.3, "|u'| u": 0.2}, y0=0.1),
]
FULL = hs.PID(
    kp=0.4, ki=0.9, kd=0.05, derivative_filter=0.03, limits=(-0.7, 0.6), setpoint_weight=0.6, derivative_weight=0.3
)


def reference(n: int, seed: int = 0) -> np.ndarray:
    """A level that jumps now and then, beside a sine."""
    levels = np.random.default_rng(seed).uniform(-1.0, 1.0, n // 20 + 1)
    return np.repeat(levels, 20)[:n] + 0.3 * np.sin(0.2 * np.arange(n))


def level_and_follower(law, u0):
    """The law's output at rest, and the function that moves it to the next voltage."""
    if law is None:
        return u0, lambda u: u
    if isinstance(law, hs.Line):
        return law.offset + law.slope * u0, lambda u: law.offset + law.slope * u
    first, state = law.advance([u0])

    def follow(u):
        nonlocal state
        y, state = law.advance([u], state)
        return float(y[0])

    return float(first[0]), follow


def companion(plant):
    """x' = F x + g v, y = C x + D v, in controllable canonical form, without any scaling."""
    n = plant.order
    den = np.array(plant.den) / plant.den[0]
    num = np.concatenate([np.zeros(n + 1 - len(plant.num)), plant.num]) / plant.den[0]
    F = np.eye(n, k=1)
    F[n - 1 :] = -den[:0:-1]
    return F, np.eye(n)[:, n - 1 :].sum(axis=1), (num[1:] - num[0] * den[1:])[::-1], num[0]


def literal_loop(law, plant, pid, h, r, u0):
    """The equations of `hysim.kernels.controllers` and of a dead time, as they are written, one by one."""
    level, follow = level_and_follower(law, u0)
    F, g, C, D = companion(plant)
    n, whole, part = len(g), int(plant.delay // h), plant.delay % h
    pieces = []
    for age, span in ((whole + 1, part), (whole, h - part)):
        generator = np.zeros((n + 1, n + 1))
        generator[:n, :n], generator[:n, n] = F, g
        pieces.append((age, expm(generator * span)))
    w = []
    x = -np.linalg.solve(F, g) * level
    y0 = C @ x + D * level
    lowest, highest = pid.limits or (-np.inf, np.inf)
    lag, tracking = pid.derivative_filter + h, pid.tracking_time
    if tracking is None and pid.ki:
        tracking = np.sqrt(pid.kd / pid.ki) if pid.kd else pid.kp / pid.ki
    integral = u0 - pid.kp * (pid.setpoint_weight - 1.0) * y0
    derivative, seen = 0.0, (pid.derivative_weight - 1.0) * y0
    out = SimpleNamespace(y=[], u=[], command=[])

    def held(k):
        return w[k] if k >= 0 else level

    for k, target in enumerate(r):
        y = C @ x + D * held(k - 1 - whole)
        now = pid.derivative_weight * target - y
        derivative = pid.derivative_filter / lag * derivative + pid.kd / lag * (now - seen)
        seen = now
        command = pid.kp * (pid.setpoint_weight * target - y) + integral + derivative
        u = min(max(command, lowest), highest)
        integral += pid.ki * h * (target - y) + (h / max(tracking, h) * (u - command) if pid.ki else 0.0)
        w.append(follow(u))
        for age, transition in pieces:
            x = transition[:n, :n] @ x + transition[:n, n] * held(k - age)
        out.y.append(y)
        out.u.append(u)
        out.command.append(command)
    return out


def assert_same(run, literal):
    for name in ("y", "u", "command"):
        assert getattr(run, name) == pytest.approx(getattr(literal, name), abs=EXACT), name


def closed(law, plant, pid, r, u0=0.0, h=H):
    return hs.close_loop(hs.Actuator(hysteresis=law, vibration=plant), pid, h * np.arange(len(r)), r, u0=u0)


@pytest.mark.parametrize("delay", [0.0, 0.037, 3 * H, 0.123])
@pytest.mark.parametrize("plant", [LAG, MODE, PROPER, THIRD, GAIN], ids=["lag", "mode", "proper", "third", "gain"])
def test_a_loop_is_its_literal_transcription(plant, delay):
    late = replace(plant, delay=delay)
    for k, law in enumerate(LAWS):
        r = reference(80, k)
        assert_same(closed(law, late, FULL, r, 0.3), literal_loop(law, late, FULL, H, r, 0.3))


@given(st.sampled_from(LAWS), st.floats(0.0, 0.4), st.floats(-1.0, 1.0), st.floats(0.01, 0.1), st.integers(0, 1000))
@settings(max_examples=25)
def test_a_loop_is_its_transcription_for_any_dead_time_rest_and_sample_time(law, delay, u0, h, seed):
    r, late = reference(60, seed), replace(MODE, delay=delay)
    assert_same(closed(law, late, FULL, r, u0, h), literal_loop(law, late, FULL, h, r, u0))


@pytest.mark.parametrize("law", LAWS[1:], ids=lambda law: type(law).__name__)
def test_a_law_alone_is_read_one_sample_after_its_voltage(law):
    r, pid = reference(100), hs.PID(kp=0.2, ki=6.0, limits=(-1.5, 1.5))
    run = hs.close_loop(law, pid, H * np.arange(100), r, u0=0.3)
    assert_same(run, literal_loop(law, hs.TransferFunction(num=(1.0,), den=(1.0,)), pid, H, r, 0.3))
    assert np.array_equal(run.y, law.response(np.append(0.3, run.u))[:-1])


def test_signals_are_taken_just_before_the_new_voltage():
    law = LAWS[2]
    run = closed(law, MODE, FULL, reference(120), 0.3)
    assert np.array_equal(run.z, law.memory(np.append(0.3, run.u))[:-1])
    assert run.z[0] == law.z0
    assert run.y[0] == pytest.approx(MODE.dc_gain * law.response([0.3])[0], abs=EXACT)
    assert np.array_equal(run.measurement, run.y)
    assert np.array_equal(run.error, run.reference - run.measurement)
    assert np.array_equal(run.u, np.clip(run.command, *FULL.limits))
    assert (run.u != run.command).any()  # the limits did act
    assert closed(None, MODE, FULL, reference(20)).z is None
    assert closed(LAWS[1], None, FULL, reference(20)).z is None


@given(bounded_laws(), st.floats(-0.4, 0.4), st.sampled_from([0.0, 0.02, 0.11]), st.booleans())
def test_the_open_loop_of_the_voltages_applied_is_the_loops_displacement(law, u0, delay, through):
    plant = replace(PROPER if through else MODE, delay=delay, sample="end")
    actuator = hs.Actuator(hysteresis=law, vibration=plant)
    pid = hs.PID(kp=0.1, ki=0.2, limits=(-0.4, 0.4))
    run = hs.close_loop(actuator, pid, H * np.arange(80), reference(80), u0=u0)
    assert run.y == pytest.approx(actuator.response(np.append(u0, run.u), H)[:-1], abs=EXACT)


def test_the_sampled_loop_converges_to_the_continuous_one_at_first_order():
    plant = hs.TransferFunction(num=(2.0,), den=(1.0, 2.0, 2.0))
    pid = hs.PID(kp=2.0, ki=1.5, kd=0.4, derivative_filter=0.3, derivative_weight=1.0)
    continuous = control.feedback(hs.to_control(plant) * hs.to_control(pid), 1.0)
    y = control.forced_response(continuous, np.linspace(0.0, 8.0, 101), np.ones(101)).outputs
    errors = []
    for split in (4, 8, 16, 32):
        t = np.linspace(0.0, 8.0, 100 * split + 1)
        errors.append(np.abs(hs.close_loop(plant, pid, t, np.ones(t.size)).y[::split] - y).max())
    ratios = np.array(errors[:-1]) / errors[1:]
    assert ratios == pytest.approx(2.0, rel=0.1)  # halving the step; the next order is a few per cent at these
    assert ratios[-1] == pytest.approx(2.0, rel=0.02)
    assert errors[-1] < 0.01


@pytest.mark.parametrize("chunk", [1, 7, 64])
def test_a_run_in_chunks_gives_the_same_bits_and_calls_back(monkeypatch, chunk):
    plant, r = replace(PROPER, delay=0.12), reference(100)
    whole = closed(LAWS[2], plant, FULL, r, 0.3)
    monkeypatch.setattr("hysim._basics.parallel._STRETCH", chunk)
    calls = []
    actuator = hs.Actuator(hysteresis=LAWS[2], vibration=plant)
    parts = hs.close_loop(actuator, FULL, whole.t, r, u0=0.3, progress=lambda *done: calls.append(done))
    assert parts == whole
    assert calls == [(min(k + chunk, 100), 100) for k in range(0, 100, chunk)]


def test_an_interrupting_callback_stops_the_loop(monkeypatch):
    monkeypatch.setattr("hysim._basics.parallel._STRETCH", 10)

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hs.close_loop(LAG, FULL, H * np.arange(100), np.ones(100), progress=stop)


@signed_kernel(float64(CONSTANTS, VECTOR, float64))
def play_step(parameters, state, u):
    state[0] = min(max(state[0], u - parameters[0]), u + parameters[0])
    return float(state[0])


class Play:
    """A user's law: a backlash of half width `half`."""

    def __init__(self, half):
        self.half = half

    def response(self, u):
        y, out = 0.0, []
        for v in u:
            y = min(max(y, v - self.half), v + self.half)
            out.append(y)
        return np.array(out)

    def compiled(self, u0=0.0):
        return CompiledLaw(play_step, np.array([self.half]), self.response([u0]))


@signed_kernel(float64(CONSTANTS, VECTOR, float64, float64))
def feedforward_step(parameters, state, reference, measurement):
    state[0] = parameters[0] * reference
    return float(state[0])


class Feedforward:
    """A user's controller that does not look at the plant."""

    def __init__(self, gain):
        self.gain = gain

    def compiled(self, sample_time, u0, y0):
        return feedforward_step, np.array([self.gain]), np.array([u0])


def test_a_users_law_and_controller_go_through_the_same_loop():
    r = reference(80)
    run = hs.close_loop(Play(0.1), Feedforward(2.0), H * np.arange(80), r, u0=0.5)
    assert np.array_equal(run.u, 2.0 * r)
    assert np.array_equal(run.y, Play(0.1).response(np.append(0.5, 2.0 * r))[:-1])
    assert run.z is None
    assert run.conditions["limits"] is None
    inside = hs.close_loop(hs.Actuator(hysteresis=Play(0.1), vibration=GAIN), FULL, H * np.arange(80), r)
    assert inside.y == pytest.approx(0.8 * Play(0.1).response(np.append(0.0, inside.u))[:-1], abs=EXACT)


def test_conditions_say_under_what_the_loop_ran():
    plant = replace(MODE, delay=0.12)
    run = closed(LAWS[2], plant, FULL, reference(50), 0.3)
    assert dict(run.conditions) == {
        "plant": hs.Actuator(hysteresis=LAWS[2], vibration=plant),
        "controller": FULL,
        "preview": 0.0,
        "limited_samples": int(np.count_nonzero(run.command != run.drive)),
        "held_samples": 0,
        "sample_time": pytest.approx(H),
        "substeps": 1,
        "delay": 0.12,
        "limits": (-0.7, 0.6),
        "amplifier_limits": None,
        "sensor_quantum": 0.0,
        "noise": 0.0,
        "seed": None,
        "u0": 0.3,
        "lowest_u": run.u.min(),
        "highest_u": run.u.max(),
        "voltage_noise_rms": 0.0,
        "voltage_noise_peak": 0.0,
    }
    labelled = hs.close_loop(LAG, FULL, [0.0, 1.0], [0.0, 1.0], units={"u": "V"})
    assert labelled.units["u"] == "V"
    assert labelled.conditions["plant"] == hs.Actuator(vibration=LAG)


def test_time_may_start_anywhere():
    r = reference(60)
    early, late = (hs.close_loop(LAG, FULL, t0 + H * np.arange(60), r) for t0 in (0.0, 64.0))
    assert late.y == pytest.approx(early.y, abs=EXACT)  # the mean step of the later times is rounded
    assert late.t[0] == 64.0


GAINS = st.floats(-0.05, 0.05)


@given(bounded_laws(), st.floats(-0.4, 0.4), GAINS, GAINS, st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.booleans())
def test_a_loop_starts_without_a_bump_and_stays_at_rest(law, u0, kp, ki, b, c, dynamic):
    """Loop gains are below one half, so that the rounding of the first sample is not amplified."""
    pid = hs.PID(kp=kp, ki=ki, kd=0.1 * kp, derivative_filter=H, setpoint_weight=b, derivative_weight=c)
    actuator = hs.Actuator(hysteresis=law, vibration=MODE if dynamic else None)
    rest = law.response([u0])[0] * (MODE.dc_gain if dynamic else 1.0)
    run = hs.close_loop(actuator, pid, H * np.arange(40), np.full(40, rest), u0=u0)
    assert run.u == pytest.approx(np.full(40, u0), abs=EXACT)
    assert run.y == pytest.approx(np.full(40, rest), abs=EXACT)


@given(st.floats(0.0, 50.0), st.floats(0.0, 2.0), st.floats(0.0, 1.0), st.floats(-1.0, 1.0))
def test_a_step_of_the_reference_kicks_the_derivative_by_its_weight_only(kd, b, c, u0):
    pid = hs.PID(kp=0.3, ki=0.2, kd=kd, derivative_filter=0.1, setpoint_weight=b)
    kick = kd / (0.1 + H)
    for weight, expected in ((0.0, 0.0), (c, c * kick)):
        weighted = replace(pid, derivative_weight=weight)
        run = hs.close_loop(MODE, weighted, H * np.arange(2), np.full(2, u0 + 1.0), u0=u0)
        # at rest y = u0, MODE's gain being one; the roundings are those of kick times u0
        assert run.u[0] - u0 == pytest.approx(0.3 * b + expected, abs=1e-15 * (10 + 10 * kick))


@given(st.floats(-1.0, 1.0), st.floats(0.0, 1.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-1.0, 1.0))
def test_limits_are_respected_whatever_the_gains(lowest, width, kp, ki, kd):
    limits = (lowest, lowest + width)
    pid = hs.PID(kp=kp, ki=ki, kd=kd, limits=limits)
    run = closed(LAWS[2], MODE, pid, 5.0 * reference(80))
    assert limits[0] <= run.u.min()
    assert run.u.max() <= limits[1]
    assert np.array_equal(run.u, np.clip(run.command, *limits))
    assert np.isfinite(run.command).all()
    assert (run.conditions["lowest_u"], run.conditions["highest_u"]) == (run.u.min(), run.u.max())


def test_limits_of_no_width_hold_the_voltage():
    for pid in (FULL, hs.PID(kp=3.0), hs.PID(ki=3.0), hs.PID(kd=1.0), hs.PID(ki=2.0, tracking_time=0.0)):
        run = closed(LAWS[2], MODE, replace(pid, limits=(0.3, 0.3)), 1e6 * reference(200))
        assert (run.u == 0.3).all()
        assert np.isfinite(run.command).all()
        assert np.isfinite(run.y).all()


def test_a_controller_without_gains_holds_the_resting_voltage():
    run = closed(LAWS[2], MODE, hs.PID(), reference(100), 0.3)
    assert (run.u == 0.3).all()
    assert run.y == pytest.approx(np.full(100, run.y[0]), abs=EXACT)


def recovery(run, after, target):
    """Samples from `after` until the displacement stays within 2 % of the target."""
    outside = np.flatnonzero(np.abs(run.y[after:] - target) > 0.02 * target)
    return int(outside[-1]) + 1


def conditional_integration(kp, ki, limits, r):
    """The lag's loop whose integral stands still while the voltage is limited and the error drives it on."""
    decay, x, integral, y = np.exp(-H), 0.0, 0.0, []
    for target in r:
        y.append(x)
        command = kp * (target - x) + integral
        u = min(max(command, limits[0]), limits[1])
        if u == command or (command - u) * (target - x) < 0.0:
            integral += ki * H * (target - x)
        x = decay * x + (1.0 - decay) * u
    return SimpleNamespace(y=np.array(y))


@pytest.mark.parametrize(("kp", "ki"), [(2.0, 2.0), (1.0, 3.0), (4.0, 2.0)])
def test_long_saturation_does_not_wind_up(kp, ki):
    pid = hs.PID(kp=kp, ki=ki, limits=(0.0, 1.0))
    times = {}
    for n in (400, 4000):
        r = np.concatenate([np.full(n, 5.0), np.full(4 * n, 0.5)])
        times[n] = recovery(hs.close_loop(LAG, pid, H * np.arange(r.size), r), n, 0.5)
        winding = replace(pid, tracking_time=1e9)
        assert recovery(hs.close_loop(LAG, winding, H * np.arange(r.size), r), n, 0.5) > n / 4  # it does matter
    assert times[400] == times[4000]  # how long the voltage was limited is forgotten
    expected = recovery(conditional_integration(kp, ki, pid.limits, r), 4000, 0.5)
    assert times[4000] <= 2 * expected + 20  # 20 samples are the lag's time constant


def test_an_unreachable_reference_asks_for_a_bounded_command():
    for law in LAWS:
        run = closed(law, MODE, FULL, np.full(20_000, 100.0))
        assert run.u[-1] == FULL.limits[1]
        # the integral rests where h / T_t (v - u) = ki h e, so that v - u = ki T_t e
        tracking = np.sqrt(FULL.kd / FULL.ki)
        assert run.command[-1] - run.u[-1] == pytest.approx(FULL.ki * tracking * run.error[-1], rel=1e-9)


def test_an_unstable_loop_is_an_error_that_names_the_time():
    """u_k = 2 u_(k-1) - 2 is -2^(k+2) + 2, beyond 1e100 from sample 331 on (2^332); the output is one sample later."""
    t = 3.0 + 0.5 * np.arange(3000)
    with pytest.raises(hs.SimulationError, match=r"at t = 169: it is unstable"):
        hs.close_loop(hs.Actuator(), hs.PID(kp=-2.0), t, np.ones(3000))
    assert np.isfinite(hs.close_loop(hs.Actuator(), hs.PID(kp=-2.0), t[:331], np.ones(331)).u).all()


def test_a_law_that_escapes_is_an_error_that_names_the_time():
    law = hs.BoucWen(beta=-3.0, gamma=0.0, n=2.0)
    with pytest.raises(hs.SimulationError, match=r"at t = 0.2"):
        hs.close_loop(law, Feedforward(1.0), [0.0, 0.1, 0.2, 0.3], [0.0, 0.1, 5.0, 0.0])


def test_a_vibration_that_integrates_rests_at_zero_only():
    integrator = hs.TransferFunction(num=(1.0,), den=(1.0, 0.0))
    run = hs.close_loop(integrator, hs.PID(kp=2.0), H * np.arange(200), np.ones(200))
    # u is held: e_(k+1) = (1 - kp h) e_k
    assert run.error == pytest.approx((1.0 - 2.0 * H) ** np.arange(200), abs=EXACT)
    for plant, u0 in ((integrator, 0.1), (hs.Actuator(hysteresis=hs.Line(offset=1.0), vibration=integrator), 0.0)):
        with pytest.raises(ValueError, match="integrates: it cannot rest at the law's output"):
            hs.close_loop(plant, hs.PID(), [0.0, 1.0], [0.0, 0.0], u0=u0)


T4, R4 = np.arange(4.0), np.zeros(4)


test_wrong_arguments_are_named = refused(
    (lambda: hs.close_loop(3, FULL, T4, R4), TypeError, "Actuator, a law or a linear plant, got int"),
    (lambda: hs.close_loop(FULL, FULL, T4, R4), TypeError, "got PID"),
    (lambda: hs.close_loop(LAG, None, T4, R4), TypeError, "controller must be"),
    (lambda: hs.close_loop(LAG, hs.BoucWen(), T4, R4), TypeError, "controller must be"),
    (lambda: hs.close_loop(hs.LuGre(), FULL, T4, R4), TypeError, "got LuGre, which moves in time"),
    (lambda: hs.close_loop(LAG, FULL, T4, R4[:3]), "equal lengths, got 3 and 4"),
    (lambda: hs.close_loop(LAG, FULL, T4**2, R4), "evenly spaced, got steps from 1.0 to 5.0"),
    (lambda: hs.close_loop(LAG, FULL, -T4, R4), "increas"),
    (lambda: hs.close_loop(LAG, FULL, T4, R4 * np.nan), "reference must be finite, got nan at index 0"),
    (lambda: hs.close_loop(LAG, FULL, T4 + np.inf, R4), "t must be finite"),
    (lambda: hs.close_loop(LAG, FULL, T4, [R4]), r"reference must have 1 axis, got shape \(1, 4\)"),
    (lambda: hs.close_loop(LAG, FULL, T4[:1], R4[:1]), "at least 2 samples, got 1"),
    (lambda: hs.close_loop(LAG, FULL, [], []), "at least 2 samples, got 0"),
    (lambda: hs.close_loop(replace(LAG, hold="foh"), FULL, T4, R4), 'hold must be "zoh"'),
    (lambda: hs.close_loop(replace(LAG, initial_state=(1.0,)), FULL, T4, R4), "begins at rest"),
    (lambda: hs.close_loop(hs.BoucWen(), FULL, T4, R4, u0=np.nan), "u0 must be finite, got nan"),
    (lambda: FULL.compiled(0.0), "sample_time must be positive and finite, got 0.0"),
)


@pytest.mark.parametrize("u0", [np.nan, np.inf])
@pytest.mark.parametrize("plant", [LAG, hs.Actuator()], ids=["lag", "through"])
def test_a_resting_voltage_that_is_not_finite_is_named(plant, u0):
    assert_refused(r"u0? must be finite, got (nan|inf)", hs.close_loop, plant, FULL, T4, R4, u0=u0)
