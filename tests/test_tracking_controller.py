"""A controller of parts is its equations: against a literal transcription, and against what each part promises."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import assert_refused, commanded, refused

import hysim as hs
from hysim.models.storage import from_json, to_json

H = 5e-5  # s
MODE = {"natural_frequency": 2.0 * math.pi * 500.0, "damping_ratio": 0.01}
LAW = hs.PolynomialBoucWen(
    beta=0.004, gamma=0.058, n=1.0, gain=-0.0076, offset=-0.11, z0=-8.8, input_coefficients=(0.028, -3.8e-5)
)
PLAYS = hs.PrandtlIshlinskii(thresholds=(0.0, 2.0, 20.0), weights=(0.01, 0.003, 0.006), offset=0.1)
CREEP = hs.Creep.per_decade(1.5)
LAWS = [
    None,
    hs.Line(offset=0.2, slope=0.02),
    hs.BoucWen(feedthrough=0.02, gain=-0.004, beta=0.05, gamma=0.03),
    LAW,
    PLAYS,
]
SHAPERS = st.sampled_from(
    [None, hs.Shaper.zv(*MODE.values()), hs.Shaper(natural_frequencies=(4e3,), damping_ratios=(0.1,), smoothing=4e-4)]
)


def literal(controller, h, u0, y0, reference, measurement):
    """The equations of `hysim.kernels.tracking`, one after the other; the law's inverse by bisection."""
    shaped = np.ones(1) if controller.shaper is None else controller.shaper.impulses(h)
    inverse = np.ones(1) if controller.mode_inverse is None else controller.mode_inverse.weights(h)
    forward = controller.feedforward
    hold = 0 if forward is None else 1 if controller.mode_inverse is None else 2
    history = np.concatenate([np.full(500, y0), reference])
    drive = np.convolve(history, np.convolve(shaped, inverse))[500 : 500 + reference.size]
    target = np.convolve(np.concatenate([np.full(hold, y0), history]), shaped)[500 : 500 + reference.size]
    lowest, highest = controller.limits or (-1e3, 1e3)
    pid = controller.feedback or hs.PID()
    rate, kept = pid.kd / (pid.derivative_filter + h), pid.derivative_filter / (pid.derivative_filter + h)
    integral = (u0 if forward is None else 0.0) - pid.kp * (pid.setpoint_weight - 1.0) * y0
    derivative, before = 0.0, (pid.derivative_weight - 1.0) * y0
    unwinding = 0.0
    if pid.ki:
        usual = math.sqrt(pid.kd / pid.ki) if pid.kd else pid.kp / pid.ki
        unwinding = h / max(h, usual if pid.tracking_time is None else pid.tracking_time)
    filters = [part and part.coefficients(h) for part in (controller.notch, controller.damping)]
    pasts = np.zeros((2, 4))  # the last two inputs and outputs of each filter

    def filtered(k, x):
        if filters[k] is None:
            return (x, 0.0)[k]
        b0, b1, b2, a1, a2 = filters[k]
        x1, x2, y1, y2 = pasts[k]
        y = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2
        pasts[k] = x, x1, y, y1
        return y

    law = (forward and forward.law) or hs.Line(slope=1.0)
    level = law.response(np.array([u0]))[0]
    stepped = law.compiled(u0)
    creep = forward.creep if forward and forward.creep else hs.Creep(time_constants=(), weights=())
    weights, tau = np.array(creep.weights), np.array(creep.time_constants)
    e, q = np.exp(-h / tau), np.full(tau.size, level)
    out = []
    for k, m in enumerate(measurement):
        seen = pid.derivative_weight * target[k] - m
        derivative = kept * derivative + rate * (seen - before)
        before = seen
        command = pid.kp * (pid.setpoint_weight * target[k] - m) + integral + derivative
        integral += pid.ki * h * (target[k] - m)
        total = filtered(0, command) + filtered(1, m - target[k])
        if forward is not None:
            v = (drive[k] - weights @ (e * q)) / (creep.instant_gain + weights @ (1.0 - e))

            def after(u):
                return stepped.step(stepped.parameters, stepped.state.copy(), u)

            low, high = lowest, highest
            for _ in range(80):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if after(middle) < v else (low, middle)
            w = stepped.step(stepped.parameters, stepped.state, 0.5 * (low + high))
            q = e * q + (1.0 - e) * w
            total += 0.5 * (low + high)
        u = min(max(total, lowest), highest)
        integral += unwinding * (u - total)
        out.append(u)
    return np.array(out)


pids = st.builds(
    hs.PID,
    kp=st.floats(0.0, 20.0),
    ki=st.floats(0.0, 1e4),
    kd=st.floats(0.0, 1e-2),
    derivative_filter=st.floats(1e-4, 1e-3),
    tracking_time=st.none() | st.floats(0.0, 0.1),
    setpoint_weight=st.floats(0.0, 1.0),
    derivative_weight=st.floats(0.0, 1.0),
)


@settings(max_examples=15)
@given(pids | st.none(), st.sampled_from([False, *LAWS]), SHAPERS, st.booleans(), st.booleans(), st.integers(0, 99))
def test_the_kernel_is_its_equations(pid, law, shaper, filters, inverted, seed):
    forward = None if law is False else hs.InverseFeedforward(law=law, creep=CREEP)
    controller = hs.TrackingController(
        shaper=shaper,
        mode_inverse=hs.ModeInverse(**MODE) if inverted and shaper and forward else None,
        feedforward=forward,
        feedback=pid,
        notch=hs.Notch(**MODE) if filters else None,
        damping=hs.DampingLoop(gain=5.0, frequency=1e3, damping_ratio=0.4) if filters else None,
        limits=(-20.0, 120.0),
    )
    rng = np.random.default_rng(seed)
    reference = np.repeat(rng.uniform(-1.0, 4.0, 12), 10)
    measurement = reference + 0.01 * rng.standard_normal(reference.size)
    u, _ = commanded(controller, H, reference, measurement, 30.0, 0.7)
    # rounding, of 120, in the steps of an inverse whose slope is some hundredths
    assert np.abs(u - literal(controller, H, 30.0, 0.7, reference, measurement)).max() < 1e-9


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("creep", [None, CREEP])
def test_the_inverse_of_law_and_creep_is_exact_from_the_second_sample_on(law, creep):
    plant = hs.Actuator(hysteresis=law, creep=creep)
    reference = 1.0 + 0.5 * np.sin(np.linspace(0.0, 20.0, 300))
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward.of(plant), preview=True)
    run = hs.close_loop(plant, controller, H * np.arange(300), reference, u0=40.0)
    assert np.abs(run.y - reference)[1:].max() < 1e-13  # of displacements of one
    assert run.conditions["preview"] == H


@pytest.mark.parametrize("law", [law for law in LAWS if law is not None])
@pytest.mark.parametrize("limits", [(20.0, 70.0), (30.0, 30.0)])
def test_out_of_reach_the_inverse_waits_at_the_limit_and_says_so(law, limits):
    amplifier = hs.Amplifier(gain=10.0, offset=5.0)
    plant = hs.Actuator(amplifier=amplifier, hysteresis=law, creep=CREEP)
    reference = np.repeat([1.0, 40.0, 1.0, -40.0, 1.0], 100)
    controller = hs.TrackingController(
        feedforward=hs.InverseFeedforward.of(plant), limits=tuple((u - 5.0) / 10.0 for u in limits), preview=True
    )
    run = hs.close_loop(plant, controller, H * np.arange(500), reference, u0=3.5)
    assert np.isfinite(run.command).all()
    assert run.u[150] == pytest.approx(limits[1])
    assert run.u[350] == pytest.approx(limits[0])
    assert run.conditions["limited_samples"] >= 200
    if limits[0] < limits[1]:
        assert run.conditions["limited_samples"] == 200
        back = np.r_[2:100, 202:300, 402:500]
        assert np.abs(run.y - reference)[back].max() < 1e-12  # the law's copy was limited with the law


def test_a_law_that_turns_is_taken_to_the_limit():
    """Where no voltage gives the displacement the inverse has no answer, and the limit is the nearest."""
    law = hs.PolynomialBoucWen(input_coefficients=(1.0, -0.01), gain=0.1)  # rises up to 50
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), limits=(0.0, 45.0))
    reference = np.repeat([1.0, 100.0, 2.0], 10)
    run = hs.close_loop(law, controller, np.arange(30.0), reference)
    assert run.conditions["limited_samples"] == 10
    assert run.u[15] == 45.0
    assert abs(run.y[-1] - 2.0) < 1e-12


@given(pids, st.floats(0.0, 20.0))
def test_a_pid_among_parts_has_the_bits_of_a_pid_alone(pid, u0):
    plant = hs.Actuator(hysteresis=LAW, creep=CREEP, vibration=hs.mode(**MODE), sensor=hs.Sensor(delay=H, noise=1e-3))
    t, reference = H * np.arange(100), np.repeat([0.5, 3.0], 50)
    alone = hs.close_loop(plant, dataclasses.replace(pid, limits=(0.0, 60.0)), t, reference, u0=u0)
    among = hs.close_loop(plant, hs.TrackingController(feedback=pid, limits=(0.0, 60.0)), t, reference, u0=u0)
    for name in ("command", "drive", "y", "measurement"):
        assert np.array_equal(getattr(alone, name), getattr(among, name))


@pytest.mark.parametrize("delays", [(0.0, 0.0), (0.0, 1.0), (2.0, 3.0), (1.3, 1.4), (0.0, 0.7)])
@pytest.mark.parametrize("law", [None, LAW, PLAYS])
def test_a_feedback_that_follows_the_model_is_silent_where_the_model_is_right(law, delays):
    modes = hs.Modes(natural_frequencies=(3e3, 9e3), damping_ratios=(0.05, 0.05), gains=(0.9, 0.1), delay=delays[0] * H)
    plant = hs.Actuator(hysteresis=law, creep=CREEP, vibration=modes, sensor=hs.Sensor(delay=delays[1] * H))
    silent = hs.TrackingController(
        feedforward=hs.InverseFeedforward.of(plant), shaper=hs.Shaper(smoothing=1e-3), limits=(0.0, 60.0)
    )
    feedback = hs.PID(kp=0.1, ki=10.0, kd=1e-5, derivative_filter=1e-3, derivative_weight=1.0)
    heard = dataclasses.replace(silent, feedback=feedback, model=plant)
    reference = np.repeat([0.5, 1.2, 9.0, 0.9], 40)
    runs = [hs.close_loop(plant, each, H * np.arange(160), reference, u0=20.0) for each in (silent, heard)]
    assert np.abs(runs[0].drive - runs[1].drive).max() < 1e-10  # roundings of displacements of one, added up


def test_a_feedback_that_follows_the_model_takes_away_what_the_model_does_not_know():
    plant = hs.Actuator(hysteresis=LAW, creep=CREEP, sensor=hs.Sensor(delay=H))
    model = dataclasses.replace(plant, creep=hs.Creep.per_decade(0.5))
    without = hs.TrackingController(feedforward=hs.InverseFeedforward.of(model), preview=True)
    following = dataclasses.replace(without, feedback=hs.PID(ki=5e4), model=model)
    t, reference = H * np.arange(1000), 1.0 + 0.5 * np.sin(np.linspace(0.0, 9.0, 1000))
    errors = [
        np.abs(hs.close_loop(plant, each, t, reference, u0=40.0).y - reference)[200:].max()
        for each in (without, following)
    ]
    assert errors[1] < 0.1 * errors[0]


def test_a_controller_at_rest_begins_without_a_bump():
    plant = hs.Actuator(hysteresis=LAW, creep=CREEP, vibration=hs.mode(**MODE), sensor=hs.Sensor(delay=H))
    u0 = 30.0
    y0 = CREEP.dc_gain * LAW.response([u0])[0]
    feedback = hs.PID(kp=2.0, ki=100.0, kd=1e-3, setpoint_weight=0.3)
    forward = hs.InverseFeedforward.of(plant)
    for controller in (
        hs.TrackingController(feedback=feedback),
        hs.TrackingController(
            feedback=feedback, feedforward=forward, shaper=hs.Shaper.zvd(*MODE.values()), preview=True
        ),
        hs.TrackingController(feedback=feedback, feedforward=forward, model=plant, notch=hs.Notch(**MODE)),
    ):
        run = hs.close_loop(plant, controller, H * np.arange(100), np.full(100, y0), u0=u0)
        assert np.abs(run.u - u0).max() < 1e-9


def test_nothing_kicks_nothing_winds_up_and_nothing_is_nan():
    plant = hs.Actuator(hysteresis=LAW, vibration=hs.mode(600.0, 0.7))
    h = 0.01
    pid = hs.PID(kp=5.0, ki=500.0, kd=0.01, derivative_filter=0.01, setpoint_weight=0.5)
    forward = hs.InverseFeedforward.of(plant)
    for controller in (
        hs.TrackingController(feedback=pid, limits=(0.0, 60.0)),
        hs.TrackingController(feedback=pid, feedforward=forward, limits=(0.0, 60.0)),
    ):
        after = []
        for saturated in (100, 1000):
            reference = np.repeat([5.0, 0.5], [saturated, 100])
            run = hs.close_loop(plant, controller, h * np.arange(reference.size), reference)
            assert run.u[saturated - 1] == 60.0
            after.append(run.y[saturated:])
        assert abs(after[0][-1] - 0.5) < 1e-3
        assert np.abs(after[1] - after[0]).max() < 1e-9  # ten seconds at the limit leave no more than one
        first = hs.close_loop(plant, dataclasses.replace(controller, feedforward=None), h * np.arange(2), [1.0, 1.0])
        plain = hs.close_loop(plant, hs.PID(kp=5.0, setpoint_weight=0.5), h * np.arange(2), [1.0, 1.0])
        assert first.command[0] == plain.command[0]  # of the step the derivative sees nothing
    for still in (
        hs.TrackingController(),
        hs.TrackingController(feedback=hs.PID()),
        hs.TrackingController(limits=(7.0, 7.0)),
    ):
        run = hs.close_loop(plant, still, h * np.arange(50), np.full(50, 1e6), u0=7.0)
        assert (run.u == 7.0).all()
        assert np.ptp(run.y) < 1e-12


@settings(max_examples=10)
@given(pids, st.booleans(), st.booleans(), st.integers(0, 99))
def test_the_linear_feedback_is_what_the_kernel_does_to_the_measurement(pid, notch, damping, seed):
    controller = hs.TrackingController(
        feedback=pid,
        notch=hs.Notch(**MODE) if notch else None,
        damping=hs.DampingLoop(gain=5.0, frequency=1e3, damping_ratio=0.4) if damping else None,
    )
    measurement = np.random.default_rng(seed).standard_normal(60)
    A, B, C, D = controller.linear(H)
    x, u = np.zeros(B.size), []
    for m in measurement:
        u.append(C @ x + D * m)
        x = A @ x + B * m
    assert np.abs(commanded(controller, H, np.zeros(60), measurement)[0] - u).max() < 1e-9
    transfer = C @ np.linalg.solve(np.exp(1j * 700.0 * H) * np.eye(B.size) - A, B) + D
    assert controller.frequency_response(700.0, H) == pytest.approx(-transfer, abs=1e-9)


def test_preview_gives_the_reference_in_its_own_time():
    plant = hs.Actuator(hysteresis=LAW, vibration=hs.mode(**MODE))
    t = H * np.arange(4000)
    reference = 1.0 - 0.5 * np.cos(2.0 * np.pi * 10.0 * t)
    late = hs.TrackingController(
        feedforward=hs.InverseFeedforward.of(plant),
        shaper=hs.Shaper(smoothing=1e-3),
        mode_inverse=hs.ModeInverse(**MODE),
    )
    ahead = dataclasses.replace(late, preview=True)
    samples = ahead.ahead(H)
    runs = [hs.close_loop(plant, each, t, reference, u0=20.0) for each in (late, ahead)]
    assert late.ahead(H) == 0
    assert samples == 2 + 9  # of the inverse, and half of the twenty samples' averages
    assert np.abs(runs[0].y[1000:] - runs[1].y[1000 - samples : -samples]).max() < 1e-9
    # what averages of half a millisecond, rms 0.2 ms, make of 10 Hz
    assert np.abs(runs[1].y - reference)[1000:].max() < 0.5 * (2.0 * np.pi * 10.0 * 0.25e-3) ** 2


def test_steps_from_python_are_those_of_the_loop_and_leave_their_state():
    plant = hs.Actuator(hysteresis=LAW, creep=CREEP, vibration=hs.mode(**MODE), sensor=hs.Sensor(delay=H, noise=1e-3))
    controller = hs.TrackingController(
        feedforward=hs.InverseFeedforward.of(plant), shaper=hs.Shaper.zv(*MODE.values()), model=plant,
        feedback=hs.PID(ki=1000.0), damping=hs.DampingLoop(gain=8.0, frequency=1000.0), preview=True,
        limits=(0.0, 150.0),
    )  # fmt: skip
    reference = np.linspace(0.0, 1.0, 100)
    run = hs.close_loop(plant, controller, H * np.arange(100), reference)
    ahead = np.append(reference, np.full(50, 1.0))[controller.ahead(H) :][:100]
    assert np.array_equal(commanded(controller, H, ahead, run.measurement, y0=run.y[0])[0], run.drive)
    state = controller.initial(H)
    assert controller.step(state, 1.0, 0.0)[0] == controller.step(state, 1.0, 0.0)[0]


def test_every_part_goes_to_json_and_back():
    controller = hs.TrackingController(
        shaper=hs.Shaper(natural_frequencies=(3e3,), damping_ratios=(0.01,), repeats=2, smoothing=1e-3),
        mode_inverse=hs.ModeInverse(**MODE),
        feedforward=hs.InverseFeedforward(law=LAW, creep=CREEP),
        feedback=hs.PID(ki=3.0),
        notch=hs.Notch(**MODE),
        damping=hs.DampingLoop(gain=1.0, frequency=2.0),
        model=hs.Actuator(hysteresis=LAW, creep=CREEP, vibration=hs.mode(**MODE), sensor=hs.Sensor(delay=H)),
        preview=True,
        limits=(0.0, 150.0),
    )
    again = from_json(to_json(controller), "here")[0]
    assert again == controller
    assert np.array_equal(again.compiled(H).parameters, controller.compiled(H).parameters)


test_parts_that_do_not_fit_are_refused = refused(
    ({"feedback": hs.Line()}, TypeError, "feedback must be of PID"),
    ({"limits": (1.0, 0.0)}, "limits must be"),
    ({"feedback": hs.PID(limits=(0.0, 1.0))}, "limited together"),
    ({"mode_inverse": hs.ModeInverse(**MODE)}, "need a feedforward"),
    ({"feedforward": hs.InverseFeedforward(), "model": hs.Actuator(hysteresis=LAW)}, "law and amplifier"),
    call=lambda parts: hs.TrackingController(**parts),
)


test_what_has_no_inverse_is_refused = refused(
    ({"law": hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))}, TypeError, "law that a loop can step"),
    ({"law": hs.Line()}, "slope is zero"),
    ({"creep": hs.Line()}, TypeError, "creep must be of Creep"),
    ({"amplifier": hs.Amplifier(slew_rate=1.0)}, "answer at once"),
    ({"amplifier": hs.Amplifier(gain=0.0)}, "have a gain"),
    call=lambda parts: hs.InverseFeedforward(**parts),
)


@pytest.mark.parametrize("h", [0.0, math.nan, math.inf])
def test_a_sample_time_must_be_one(h):
    assert_refused("sample_time must be positive", hs.TrackingController().initial, h)
