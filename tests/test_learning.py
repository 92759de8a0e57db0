"""Learning from repetition and prediction: as the literal formulas, within their conditions, and within limits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from strategies import assert_refused, refused

import hysim as hs
from hysim.control._learning import _filters

H = 1e-3  # s
MODE = {"natural_frequency": 300.0, "damping_ratio": 0.05}
LAW = hs.BoucWen(beta=0.02, gamma=0.01, feedthrough=0.03, gain=-0.01)
STAGE = hs.Actuator(hysteresis=LAW, vibration=hs.mode(**MODE), sensor=hs.Sensor(delay=1.5 * H))
LINEAR = replace(STAGE, hysteresis=hs.Line(slope=0.02))
STROKE = (0.0, 2.0)
R = hs.signals.triangle(*STROKE, cycles=1, samples_per_cycle=400)
T = H * np.arange(R.size)


def inverse_of(plant, **others):
    """Feed-forward by the inverse of law and mode."""
    parts = {"feedforward": hs.InverseFeedforward.of(plant), "mode_inverse": hs.ModeInverse(**MODE), "preview": True}
    return hs.TrackingController(**parts, **others)


def learner(plant=STAGE, **others):
    return hs.IterativeLearning(controller=inverse_of(plant), model=plant, stroke=STROKE, **others)


def off(plant, speed, slope):
    """The plant with its mode and its law wrong by factors."""
    mode = hs.mode(**{**MODE, "natural_frequency": speed * MODE["natural_frequency"]})
    law = plant.hysteresis
    changed = {name: slope * law.scalars[name] for name in ("feedthrough", "gain", "slope") if name in law.scalars}
    return replace(plant, vibration=mode, hysteresis=replace(law, **changed))


def ahead_of_time(device):
    """Taps of a device, whose corrections are those of references ahead of their time."""
    low_pass, inverse, _ = _filters(device, H)[0]
    return np.pad(low_pass, device.ahead(H)), np.pad(inverse, (2 * device.ahead(H), 0))


def faded(n, reach):
    """Weights of the corrections of a trial."""
    fade = np.minimum(np.arange(1, n + 1), np.arange(n - reach, -reach, -1)) / (reach + 1)
    return np.clip(fade, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(fade, 0.0, 1.0))


def test_corrections_of_the_next_trial_are_the_literal_sums():
    low_pass, inverse, _ = _filters(learner(), H)[0]
    reach, rng = low_pass.size // 2, np.random.default_rng(0)
    c, e = rng.standard_normal((2, 5 * reach))
    sums = np.correlate(c, low_pass, "same") + np.correlate(e, inverse, "same")
    following = learner().following(c, e, H)
    assert np.allclose(following, faded(c.size, reach) * sums, rtol=0.0, atol=1e-12)
    assert not following[-reach:].any()
    present = np.arange(c.size) != 7
    missing = learner().following(c, np.where(present, e, math.nan), H)
    assert np.array_equal(missing, learner().following(c, np.where(present, e, 0.0), H))


@pytest.mark.parametrize("speed", [0.9, 1.0, 1.1])
@pytest.mark.parametrize("slope", [0.9, 1.1])
def test_changes_of_the_correction_shrink_by_the_rate_on_every_plant_of_the_condition(speed, slope):
    trials = learner(LINEAR).learn(off(LINEAR, speed, slope), T, R, trials=6)
    assert trials.condition.converges
    changes = np.linalg.norm(np.diff(trials.corrections, axis=0), axis=1)
    assert np.all(
        changes[1:] <= (trials.condition.rate + 1e-6) * changes[:-1]
    )  # taps reach all of the response but 1e-6
    assert trials.rms[-1] < 0.1 * trials.rms[0]
    assert np.array_equal(trials.correction, trials.corrections[np.argmin(trials.rms)])


def test_a_low_pass_above_an_uncertain_resonance_is_said_to_diverge_and_does():
    bold = learner(LINEAR, cutoff=1.5 * MODE["natural_frequency"])
    assert not bold.condition(H).converges
    assert "MAY DIVERGE" in str(bold.condition(H))
    trials = bold.learn(off(LINEAR, 0.9, 1.0), T, R, trials=8)
    assert trials.rms[-1] > 2.0 * trials.rms.min()


def test_trials_go_on_from_a_correction_and_on_a_stage_of_ones_own():
    plant = off(STAGE, 1.0, 0.9)
    first = learner().learn(plant, T, R, trials=5)
    again = learner().learn(plant, T, R, trials=3, correction=first.corrections[2])
    assert np.array_equal(again.corrections, first.corrections[2:])
    assert first.rms[-1] < 0.05 * first.rms[0]

    def stage(command):
        return hs.close_loop(plant, hs.InverseFeedforward(), H * np.arange(command.size), command).measurement

    own = learner().learn(stage, T, R, trials=5)
    assert np.allclose(own.rms, first.rms, rtol=1e-9, atol=1e-12)
    with pytest.raises(ValueError, match=r"trial must return a measurement of shape"):
        learner().learn(lambda command: command[1:], T, R, trials=1)
    with pytest.raises(ValueError, match=r"trial must return a measurement that is not nan throughout"):
        learner().learn(lambda command: np.nan * command, T, R, trials=1)


def test_a_line_in_place_of_the_law_learns_slower_and_says_so():
    line = hs.InverseFeedforward(law=hs.Line(slope=0.025))
    plain = hs.IterativeLearning(controller=line, model=LAW, stroke=STROKE)
    slopes = hs.control.slopes(
        hs.Actuator(hysteresis=LAW), hs.signals.triangle(0.0, 80.0, cycles=1, samples_per_cycle=2000)
    )
    assert np.allclose(plain.condition(H).slopes, np.array(slopes) / 0.025, rtol=0.02)  # the stroke ends at 80 V
    exact = hs.IterativeLearning(controller=hs.InverseFeedforward(law=LAW), model=LAW, stroke=STROKE)
    assert exact.condition(H).rate < plain.condition(H).rate < 1.0
    assert plain.learn(LAW, T, R).rms[-1] < 0.01 * plain.learn(LAW, T, R).rms[0]


def test_a_device_that_counts_trials_learns_as_learn_does():
    device, samples = learner(duration=1.0), round(1.0 / H)
    state, errors, rng = device.initial(H), np.zeros(samples), np.random.default_rng(1)
    for k in range(samples + 1):
        noise = rng.standard_normal()
        errors[min(k, samples - 1)] = 0.0 - noise if k < samples else errors[-1]
        _, state = device.step(state, 0.0, noise)
    low_pass, inverse = ahead_of_time(device)
    stored = state.state[2 + device.ahead(H) + 1 + 2 :][:samples]
    assert low_pass.size < samples
    expected = faded(samples, low_pass.size // 2) * np.correlate(errors, inverse, "same")
    assert np.allclose(stored, expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("samples", [60, 400])
def test_repetitive_control_is_the_literal_sum_over_the_periods_before(samples):
    control = hs.RepetitiveControl(controller=inverse_of(LINEAR), model=LINEAR, stroke=STROKE, period=H * samples)
    low_pass, inverse = ahead_of_time(control)
    reach, ahead = low_pass.size // 2, control.ahead(H)
    back = samples * (reach // samples + 1)
    n = 3 * back
    r, m = np.random.default_rng(2).standard_normal((2, n))
    earlier, later = (np.pad(r, (ahead + late, 0))[:n] for late in (1, 2))
    e = 0.5 * (earlier + later) - m  # the sensor is late by 1.5 samples, and the reference comes ahead
    c = np.zeros(n + back + reach)
    errors = np.concatenate([np.zeros(back + reach), e])
    for k in range(n):
        window = slice(k, k + 2 * reach + 1)  # of k - back - reach ... k - back + reach
        c[k + back + reach] = low_pass @ c[window] + inverse @ errors[window]
    expected = hs.control.begun(control.controller, H)
    state = control.initial(H)
    for k in range(n):
        u, state = control.step(state, r[k], m[k])
        plain, expected = control.controller.step(expected, r[k] + c[k + back + reach], m[k])
        assert u == pytest.approx(plain, rel=1e-9, abs=1e-9)


def test_repetitive_control_removes_what_the_inverse_leaves_on_a_plant_that_is_off():
    control = hs.RepetitiveControl(controller=inverse_of(STAGE), model=STAGE, stroke=STROKE, period=0.4)
    assert 0.0 < control.margin(H) == 1.0 - control.condition(H).rate
    r = hs.signals.triangle(*STROKE, cycles=12, samples_per_cycle=400)
    error = r - hs.close_loop(off(STAGE, 1.05, 0.95), control, H * np.arange(r.size), r).y
    assert np.std(error[-400:]) < 0.1 * np.std(error[:400])
    assert_refused(r"no whole number of samples", replace(control, period=0.4005).compiled, H)


def test_uncertain_frequencies_leave_the_dead_time_of_a_mode():
    mode = hs.TransferFunction(num=(9e4,), den=(1.0, 30.0, 9e4), delay=2.5 * H)
    late = replace(LINEAR, vibration=mode, sensor=None)
    read_late = replace(late, vibration=replace(mode, delay=0.0), sensor=hs.Sensor(delay=2.5 * H))
    rates = [learner(plant).condition(H).rate for plant in (late, read_late)]
    assert rates[0] == pytest.approx(rates[1], rel=0.02)


def test_a_margin_holds_for_a_reference_that_is_known_far_ahead():
    shaper = hs.Shaper(natural_frequencies=(), damping_ratios=(), smoothing=20 * H)
    far = hs.TrackingController(
        feedforward=hs.InverseFeedforward(law=hs.Line(slope=0.025)), shaper=shaper, preview=True
    )
    control = hs.RepetitiveControl(controller=far, model=LAW, stroke=STROKE, period=0.4)
    assert control.ahead(H) == 10
    assert control.margin(H) > 0.5
    r = hs.signals.triangle(*STROKE, cycles=30, samples_per_cycle=400)
    errors = (r - hs.close_loop(LAW, control, H * np.arange(r.size), r).y)[:-1].reshape(30, 400)
    assert np.std(errors[-1]) < 1.5 * np.std(errors[9]) < 0.02 * np.std(errors[0])


@pytest.mark.parametrize("gain", [0.1, 10.0])
def test_the_condition_does_not_depend_on_where_the_gain_is(gain):
    amplifier = hs.Amplifier(gain=gain)
    line = hs.InverseFeedforward(law=hs.Line(slope=0.025), amplifier=amplifier)
    plain = hs.IterativeLearning(controller=hs.InverseFeedforward(law=line.law), model=LAW, stroke=STROKE)
    for plant in (amplifier, replace(amplifier, time_constant=0.1 * H)):
        model = hs.Actuator(amplifier=plant, hysteresis=LAW)
        behind = hs.IterativeLearning(controller=line, model=model, stroke=STROKE)
        assert behind.condition(H).rate == pytest.approx(plain.condition(H).rate, rel=1e-3)
        assert behind.learn(model, T, R).rms[-1] < 0.01 * behind.learn(model, T, R, trials=1).rms[0]


def test_corrections_stop_growing_where_a_limit_holds_the_command():
    limited = inverse_of(STAGE, limits=(0.0, 65.0))
    control = hs.RepetitiveControl(controller=limited, model=STAGE, stroke=STROKE, period=0.4)
    r = hs.signals.triangle(*STROKE, cycles=12, samples_per_cycle=400)
    y = hs.close_loop(off(STAGE, 1.0, 0.95), control, H * np.arange(r.size), r).y[:-1].reshape(12, 400)
    assert np.abs(r[:400] - y[5]).max() > 0.2  # the top is out of reach
    assert np.allclose(y[-1], y[-2], rtol=0.0, atol=1e-3)
    trials = hs.IterativeLearning(controller=limited, model=STAGE, stroke=STROKE).learn(STAGE, T, R, trials=12)
    assert trials.commands.max() == 65.0
    assert np.allclose(trials.corrections[-1], trials.corrections[-2], rtol=0.0, atol=1e-3)


@pytest.mark.parametrize("filtered", [{}, {"mode_inverse": hs.ModeInverse(natural_frequency=1e3, damping_ratio=0.3)}])
def test_errors_shrink_as_without_limits_once_the_command_is_within_them(filtered):
    model = hs.Actuator(hysteresis=LAW, vibration=hs.mode(1e3, 0.3), sensor=hs.Sensor(delay=1e-4))
    r, t = hs.signals.triangle(0.5, 2.0, cycles=12, samples_per_cycle=400), 1e-4 * np.arange(4801)
    inverse = hs.InverseFeedforward(law=hs.Line(slope=0.025))
    base = hs.TrackingController(feedforward=inverse, preview=True, limits=(0.0, 150.0), **filtered)
    control = hs.RepetitiveControl(controller=base, model=model, stroke=(0.5, 2.0), period=0.04)
    run = hs.close_loop(replace(off(model, 1.0, 0.9), vibration=model.vibration), control, t, r, u0=15.0)
    assert (run.drive == 0.0).any()
    assert np.std((r - run.y)[-400:]) < 0.01 * np.std((r - run.y)[:400])


# ------------------------------------------------------------------------------------ prediction

HORIZON = 30


def first_output(plant, targets, *, effort, low=-math.inf, high=math.inf, change=math.inf):
    """First output of the law of the problem with bounds on the outputs, or on their changes, by SciPy."""
    pulse = hs.Actuator(vibration=plant.vibration).response(np.eye(1, HORIZON + 2, 1)[0], H)[2:]
    respond = np.array([[pulse[i - j] if i >= j else 0.0 for j in range(HORIZON)] for i in range(HORIZON)])
    differ = np.eye(HORIZON) - np.eye(HORIZON, k=-1)
    rows, wanted = np.vstack([respond, math.sqrt(effort) * differ]), np.concatenate([targets, np.zeros(HORIZON)])
    if math.isfinite(change):
        sums = np.tril(np.ones((HORIZON, HORIZON)))
        return lsq_linear(rows @ sums, wanted, (-change, change), tol=1e-14).x[0]
    return lsq_linear(rows, wanted, (low, high), tol=1e-14).x[0]


@pytest.mark.parametrize("bounds", [{}, {"low": -10.0, "high": 10.0}, {"change": 0.5}], ids=str)
def test_the_first_command_is_that_of_the_quadratic_program(bounds):
    plant = hs.Actuator(vibration=hs.mode(**MODE))
    limits = (bounds["low"], bounds["high"]) if "low" in bounds else None
    rate = bounds["change"] / H if "change" in bounds else None
    mpc = hs.PredictiveControl(model=plant, horizon=HORIZON * H, effort=1e-3, limits=limits, rate=rate, iterations=5000)
    state, targets = mpc.initial(H), 3.0 * np.sin(0.4 * np.arange(HORIZON))
    places = 2 + 2 * int(state.parameters[0])  # of the command, the disturbance, and both copies of the states
    state.state[places : places + HORIZON - 1] = targets[-2::-1]
    u, _ = mpc.step(state, targets[-1], 0.0)
    assert u == pytest.approx(first_output(plant, targets, effort=1e-3, **bounds), abs=2e-6)


def test_limits_and_rate_hold_exactly_whatever_is_asked_for():
    mpc = hs.PredictiveControl(model=STAGE, horizon=0.02, limits=(-5.0, 70.0), rate=8e3)
    r = np.repeat(np.random.default_rng(3).uniform(-3.0, 5.0, 40), 25)
    run = hs.close_loop(off(STAGE, 1.1, 0.9), mpc, H * np.arange(r.size), r)
    assert run.drive.min() >= -5.0
    assert run.drive.max() <= 70.0
    assert np.abs(np.diff(run.drive, prepend=0.0)).max() <= 8.0 * (1.0 + 1e-12)
    with pytest.warns(hs.HysimWarning, match="the reference is out of reach"):
        stuck = hs.close_loop(STAGE, mpc, H * np.arange(500), np.full(500, 90.0))
    assert stuck.conditions["limited_samples"] > 400


@pytest.mark.parametrize("u0", [-3.0, 75.0])
def test_a_command_outside_its_limits_returns_at_the_rate(u0):
    mpc = hs.PredictiveControl(model=STAGE, horizon=0.02, limits=(0.0, 70.0), rate=1e2)
    drive = hs.close_loop(STAGE, mpc, T, np.ones(T.size), u0=u0).drive
    inside = np.clip(u0, 0.0, 70.0)
    assert np.allclose(np.abs(np.diff(drive[:20], prepend=u0)), 0.1, rtol=1e-9)
    assert np.abs(drive[20] - inside) < np.abs(u0 - inside)


@pytest.mark.parametrize("preview", [True, False])
def test_prediction_rests_without_error_on_a_plant_that_is_off(preview):
    mpc = hs.PredictiveControl(model=STAGE, horizon=0.02, limits=(0.0, 90.0), preview=preview)
    r = np.where(np.arange(1500) < 300, 0.5, 1.5)
    run = hs.close_loop(off(STAGE, 1.1, 0.9), mpc, H * np.arange(r.size), r, u0=20.0)
    assert np.abs(run.y[[270, -1]] - r[[270, -1]]).max() < 1e-3
    still = hs.close_loop(STAGE, mpc, T, np.full(T.size, LAW.response([20.0])[0]), u0=20.0)
    assert np.abs(still.drive - 20.0).max() < 1e-9


def test_output_limits_take_the_overshoot_where_they_can():
    r = np.where(np.arange(200) < 40, 0.0, 1.0)
    settings = {"model": STAGE, "horizon": 0.03, "limits": (0.0, 60.0), "preview": False}
    free, bounded = (
        hs.close_loop(STAGE, hs.PredictiveControl(**settings, output_limits=limits), H * np.arange(200), r).y.max()
        for limits in (None, (0.0, 1.0))
    )
    assert 1.0 < bounded < free


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_prediction_does_not_depend_on_the_unit_of_the_displacement(scale):
    def run(unit):
        model, plant = (
            hs.TransferFunction(num=(k * unit * w,), den=(1.0, 4.0, w)) for k, w in ((1.0, 1e4), (1.1, 8e3))
        )
        mpc = hs.PredictiveControl(model=model, horizon=0.02, output_limits=(-0.1 * unit, 1.02 * unit))
        return hs.close_loop(plant, mpc, T, np.where(T < 0.05, 0.0, unit)).y / unit

    assert np.allclose(run(scale), run(1.0), rtol=0.0, atol=1e-6)


def test_a_law_that_is_flat_at_its_reversals_is_driven_to_its_place():
    edges = np.linspace(-10.0, 10.0, 41)
    law = hs.Preisach.from_density(edges, lambda a, b: np.exp(-((a + b) ** 2) / 200.0 - (a - b - 4.0) ** 2 / 50.0))
    r = np.where(T < 0.05, law.response([0.0])[0], 30.0)
    y = hs.close_loop(law, hs.PredictiveControl(model=law, horizon=0.02, limits=(-10.0, 10.0)), T, r).y
    assert np.abs(y[60:] - 30.0).max() < 1e-6


SLOW = replace(STAGE, amplifier=hs.Amplifier(slew_rate=100.0))
LIMITED = replace(STAGE, amplifier=hs.Amplifier(limits=(0.0, 9.0)))
INTEGRAL = hs.TransferFunction(num=(1.0,), den=(1.0, 0.0))
LATE = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0), delay=0.01)
test_what_does_not_fit_is_refused = refused(
    (lambda: hs.PredictiveControl(model=STAGE, horizon=0.3).ahead(H), "at most 200 samples, got 300"),
    (lambda: hs.PredictiveControl(model=SLOW, horizon=0.02), "the amplifier must act at once"),
    (
        lambda: hs.RepetitiveControl(controller=hs.PID(ki=1.0), model=STAGE, stroke=STROKE, period=0.1),
        TypeError,
        "controller must be an InverseFeedforward, or a TrackingController with one",
    ),
    (lambda: hs.PredictiveControl(model=INTEGRAL, horizon=0.02).compiled(H), "must come to rest"),
    (lambda: hs.PredictiveControl(model=LATE, horizon=0.005).compiled(H), "longer than the plant's dead time"),
    (lambda: learner().compiled(H), "needs their duration="),
    (lambda: learner(duration=0.05).compiled(H), r"a trial needs more than \d+ samples"),
    (lambda: learner(uncertainty=0.9).condition(H), "no low pass of 32768 samples"),
    (lambda: replace(learner(), model=INTEGRAL), "the model integrates"),
    (lambda: replace(learner(), model=LIMITED), "amplifier has limits"),
)


# ------------------------------------------------------------------------------------ norms


@pytest.mark.extra("slycot")
def test_loop_shaping_does_not_depend_on_units_and_refuses_weights_of_zero():
    pytest.importorskip("slycot", reason="the extra synthesis has it")
    shaped = [
        hs.control.loop_shaping(
            hs.TransferFunction(num=(1e4 * s,), den=(1.0, 4.0, 1e4)), H, (0.0, 2.0 * s), bandwidth=63.0
        )
        for s in (1e-6, 1.0, 1e6)
    ]
    assert np.ptp([each.max_sensitivity for each in shaped]) < 1e-6
    with pytest.raises(ValueError, match=r"effort must be positive, got 0"):
        hs.control.loop_shaping(STAGE, H, STROKE, bandwidth=20.0, effort=0.0)


@pytest.mark.extra("slycot")
def test_loop_shaping_reaches_its_sensitivity_on_modes_that_are_off():
    pytest.importorskip("slycot", reason="the extra synthesis has it")
    plants = [off(STAGE, speed, 1.0) for speed in (0.9, 1.1)]
    shaped = hs.control.loop_shaping(STAGE, H, STROKE, bandwidth=20.0, variations=plants, limits=(0.0, 90.0))
    assert 1.0 < shaped.max_sensitivity < 2.1
    r = np.where(np.arange(3000) < 300, 0.5, 1.5)
    for plant in (STAGE, *plants):
        run = hs.close_loop(plant, shaped.controller, H * np.arange(r.size), r, u0=20.0)
        assert abs(run.y[-1] - 1.5) < 0.01
    response = shaped.controller.frequency_response([1.0, 100.0], H)
    linear = shaped.controller.linear(H)
    z = np.exp(1j * np.array([1.0, 100.0]) * H)
    states = np.array([np.linalg.solve(each * np.eye(linear.B.size) - linear.A, linear.B) for each in z])
    assert np.allclose(-(states @ linear.C + linear.D), response, rtol=1e-9)


def test_loop_shaping_names_what_it_needs(monkeypatch):
    monkeypatch.setattr("control.slycot_check", lambda: False)
    with pytest.raises(ImportError, match=r"pip install 'hysim\[synthesis\]'"):
        hs.control.loop_shaping(STAGE, H, STROKE, bandwidth=20.0)
