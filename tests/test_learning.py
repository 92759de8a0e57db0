"""Learning from repetition and prediction: as the literal formulas, within their conditions, and within limits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

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


def test_corrections_of_the_next_trial_are_the_literal_sums():
    low_pass, inverse, _ = _filters(learner(), H)
    reach, rng = low_pass.size // 2, np.random.default_rng(0)
    c, e = rng.standard_normal((2, 5 * reach))
    fade = np.clip(np.minimum(np.arange(1, c.size + 1), np.arange(c.size - reach, -reach, -1)) / (reach + 1), 0.0, 1.0)
    sums = np.correlate(c, low_pass, "same") + np.correlate(e, inverse, "same")
    following = learner().following(c, e, H)
    assert np.allclose(following, fade**2 * (3.0 - 2.0 * fade) * sums, rtol=0.0, atol=1e-12)
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
    device, samples = learner(duration=H * R.size), R.size
    state, errors, rng = device.initial(H), np.zeros(R.size), np.random.default_rng(1)
    for k in range(samples + 1):
        noise = rng.standard_normal()
        errors[min(k, samples - 1)] = 0.0 - noise if k < samples else errors[-1]
        _, state = device.step(state, 0.0, noise)
    low_pass = _filters(device, H).low_pass
    stored = state.state[3 + device.ahead(H) + 1 + 2 :][:samples]
    assert low_pass.size < samples
    assert np.allclose(stored, device.following(np.zeros(samples), errors, H), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("samples", [60, 400])
def test_repetitive_control_is_the_literal_sum_over_the_periods_before(samples):
    control = hs.RepetitiveControl(controller=inverse_of(LINEAR), model=LINEAR, stroke=STROKE, period=H * samples)
    low_pass, inverse, _ = _filters(control, H)
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
    plant = off(STAGE, 1.05, 0.95)
    error = r - hs.close_loop(plant, control, H * np.arange(r.size), r).y
    assert np.std(error[-400:]) < 0.1 * np.std(error[:400])
    with pytest.raises(ValueError, match=r"no whole number of samples"):
        replace(control, period=0.4005).compiled(H)


def test_corrections_stop_growing_where_a_limit_holds_the_command():
    limited = inverse_of(STAGE, limits=(0.0, 65.0))
    control = hs.RepetitiveControl(controller=limited, model=STAGE, stroke=STROKE, period=0.4)
    r = hs.signals.triangle(*STROKE, cycles=60, samples_per_cycle=400)
    errors = (r - hs.close_loop(off(STAGE, 1.0, 0.95), control, H * np.arange(r.size), r).y)[:-1].reshape(60, 400)
    largest = np.abs(errors).max(axis=1)
    assert largest[5] > 0.2  # the top is out of reach
    assert largest[-1] < 1.02 * largest[5]
    trials = hs.IterativeLearning(controller=limited, model=STAGE, stroke=STROKE).learn(STAGE, T, R, trials=40)
    assert trials.commands.max() == 65.0
    assert np.abs(trials.corrections[-1]).max() < 0.2 * largest[5]  # without that, 40 times as large


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
    rng = np.random.default_rng(3)
    r = np.repeat(rng.uniform(-3.0, 5.0, 40), 25)
    run = hs.close_loop(off(STAGE, 1.1, 0.9), mpc, H * np.arange(r.size), r)
    assert run.drive.min() >= -5.0
    assert run.drive.max() <= 70.0
    assert np.abs(np.diff(run.drive, prepend=0.0)).max() <= 8.0 * (1.0 + 1e-12)


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


def test_a_horizon_and_an_amplifier_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"at most 200 samples, got 300"):
        hs.PredictiveControl(model=STAGE, horizon=0.3).ahead(H)
    slow = replace(STAGE, amplifier=hs.Amplifier(slew_rate=100.0))
    with pytest.raises(ValueError, match=r"the amplifier must act at once"):
        hs.PredictiveControl(model=slow, horizon=0.02)
    with pytest.raises(TypeError, match=r"controller must be an InverseFeedforward, or a TrackingController with one"):
        hs.RepetitiveControl(controller=hs.PID(ki=1.0), model=STAGE, stroke=STROKE, period=0.1)
    with pytest.raises(ValueError, match=r"needs their duration="):
        learner().compiled(H)


# ------------------------------------------------------------------------------------ norms


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
