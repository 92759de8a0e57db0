"""What `tune` finds is robust as asked, better than the open loop, and the same every time."""

from dataclasses import replace

import control
import numpy as np
import pytest
from strategies import refused

import hysim as hs
from hysim.control import Tuning
from hysim.control._tune import as_template

H = 0.05
MODE = hs.TransferFunction(num=(1.0,), den=(1.0, 0.4, 1.0))
LATE = hs.TransferFunction(num=(2.0,), den=(1.0, 1.0), delay=0.12)
LAW = hs.BoucWen(beta=0.5, gamma=0.3, gain=0.5, feedthrough=1.0)
STEP, T_STEP = np.ones(200), H * np.arange(200)
RAMP = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=100)
T_RAMP = H * np.arange(RAMP.size)


def negative(plant):
    """The same plant with its sign turned."""
    if isinstance(plant, hs.Actuator):
        return replace(plant, hysteresis=negative(plant.hysteresis))
    if isinstance(plant, hs.BoucWen):
        return replace(plant, gain=-plant.gain, feedthrough=-plant.feedthrough)
    return replace(plant, num=tuple(-b for b in plant.num))


TASKS = {
    "mode": (MODE, T_STEP, STEP, "itae"),
    "late": (LATE, T_STEP, STEP, "itae"),
    "law": (LAW, T_RAMP, RAMP, "rms"),
    "chain": (hs.Actuator(hysteresis=LAW, vibration=MODE), T_RAMP, RAMP, "rms"),
}
TUNED: dict[object, Tuning] = {}


@pytest.mark.parametrize(
    "template",
    [
        hs.PID(kp=0.2, ki=3.0, limits=(-1.0, 1.0)),
        hs.TrackingController(feedback=hs.PID(ki=2.0, kd=0.01), damping=hs.DampingLoop(gain=0.3, frequency=2.0)),
        hs.TrackingController(damping=hs.DampingLoop(gain=0.3, frequency=2.0)),
    ],
    ids=["feedback", "both", "damping"],
)
def test_the_point_of_a_controller_leads_back_to_it(template):
    form = as_template(template, 1.0)
    back = form.controller(form.point((form.pid.kp, form.pid.ki, form.pid.kd)))
    gains = as_template(back, 1.0).gains
    assert gains == pytest.approx(form.gains, rel=1e-12)
    assert gains.any()


def tuned(name, turned=False, **options):
    """Each search once for all tests."""
    options = {"max_sensitivity": 2.0, **options}
    key = (name, turned, *options.items())
    if key not in TUNED:
        plant, t, reference, objective = TASKS[name]
        TUNED[key] = hs.tune(negative(plant) if turned else plant, t, reference, objective=objective, **options)
    return TUNED[key]


def law_slopes(plant, reference, gain):
    """Slopes of the law's chords over a steady cycle of the voltage, written out."""
    law = plant.hysteresis if isinstance(plant, hs.Actuator) else plant
    if not isinstance(law, hs.BoucWen):
        return [1.0]
    u = np.tile(np.append(0.0, reference) / gain, 30)
    du, dy = (np.diff(values)[-reference.size :] for values in (u, law.response(u)))
    return dy[du != 0.0] / du[du != 0.0]


def linear_part(plant):
    if isinstance(plant, hs.Actuator):
        plant = plant.vibration
    return hs.to_control(plant if isinstance(plant, hs.TransferFunction) else hs.Actuator(), H)


def loops(plant, reference, pid):
    """L at the least and the largest slope of the law, as systems of python-control."""
    law = plant.hysteresis if isinstance(plant, hs.Actuator) else plant
    gain = 1.0
    if isinstance(law, hs.BoucWen):
        for _ in range(20):  # the voltage span whose stroke is the reference's
            y = law.response(np.tile(reference / gain, 30))[-reference.size :]
            gain = np.ptp(y) / (np.ptp(reference) / gain)
    slopes = law_slopes(plant, reference, gain)
    return [float(k) * linear_part(plant) * control.ss(hs.to_control(pid, H)) for k in (min(slopes), max(slopes))]


@pytest.mark.parametrize(
    ("name", "bound"), [*((name, 2.0) for name in TASKS), ("late", 1.5), ("law", 1.5), ("mode", 1.5)]
)
def test_the_bound_on_the_sensitivity_holds(name, bound):
    plant, _, reference, _ = TASKS[name]
    found = tuned(name, max_sensitivity=bound)
    angles = np.linspace(1e-3, np.pi, 4000)
    largest = 0.0
    for loop in loops(plant, reference, found.controller):
        assert np.abs(control.feedback(loop, 1.0).poles()).max() < 1.0
        largest = max(largest, np.abs(1.0 / (1.0 + at_angles(loop, angles))).max())
    assert found.success
    assert largest == pytest.approx(found.max_sensitivity, rel=1e-3)  # of its promise
    assert largest <= 1.001 * bound


def at_angles(system, angles):
    """C (z - A)^-1 B + D on the unit circle, of many z at once."""
    shifted = np.exp(1j * angles)[:, np.newaxis, np.newaxis] * np.eye(len(system.A)) - system.A
    states = np.linalg.solve(shifted, np.broadcast_to(system.B, (angles.size, *system.B.shape)))
    return (system.C @ states)[:, 0, 0] + system.D[0, 0]


@pytest.mark.parametrize("name", TASKS)
def test_the_margins_are_those_that_the_sensitivity_promises(name):
    found = tuned(name)
    side = 1.0 if found.gain_margin > 1.0 else -1.0  # a loop may be stable for some gains only
    assert found.gain_margin**side >= 0.99 * (found.max_sensitivity / (found.max_sensitivity - side)) ** side
    assert found.phase_margin >= 0.99 * 2.0 * np.degrees(np.arcsin(0.5 / found.max_sensitivity))


@pytest.mark.parametrize("name", ["mode", "late", "chain"])
def test_the_loop_is_unstable_beyond_the_gain_margin_only(name):
    plant, _, reference, _ = TASKS[name]
    found = tuned(name)
    side = found.gain_margin > 1.0
    critical = loops(plant, reference, found.controller)[-1 if side else 0]
    for factor, is_stable in ((0.97, side), (1.03, not side)):  # the margin is interpolated between frequencies
        poles = control.feedback(factor * found.gain_margin * critical, 1.0).poles()
        assert (np.abs(poles).max() < 1.0) == is_stable


def test_a_sampled_loop_has_a_finite_gain_margin():
    """The law alone is read one sample late: L(-1) is negative, and a large enough gain makes the loop unstable."""
    found = tuned("law")
    largest = loops(LAW, RAMP, found.controller)[-1]
    factor = -1.0 / largest(-1.0).real
    assert np.abs(control.feedback(0.99 * factor * largest, 1.0).poles()).max() < 1.0
    assert np.abs(control.feedback(1.01 * factor * largest, 1.0).poles()).max() > 1.0
    assert found.gain_margin == pytest.approx(factor, rel=0.03)


def objectives_of(error):
    weights = np.linspace(0.0, 1.0, error.size)
    return {"itae": np.mean(weights * np.abs(error)), "rms": np.sqrt(np.mean(error**2))}


@pytest.mark.parametrize("name", TASKS)
def test_it_follows_better_than_the_open_loop(name):
    plant, _, reference, objective = TASKS[name]
    found = tuned(name)
    actuator = plant if isinstance(plant, hs.Actuator) else None
    dc_gain = {"mode": 1.0, "late": 2.0}.get(name)
    if dc_gain is None:  # the best gain that a constant can be
        y = hs.Actuator(hysteresis=LAW, vibration=actuator and MODE).response(np.append(0.0, reference), H)[1:]
        error = reference - y * (y @ reference) / (y @ y)
    else:
        error = reference - plant.response(reference / dc_gain, H)
    assert found.objective < 0.5 * objectives_of(error)[objective]


@pytest.mark.parametrize("name", TASKS)
def test_the_objective_is_that_of_the_loop_it_returns(name):
    plant, t, reference, objective = TASKS[name]
    found = tuned(name)
    error = hs.close_loop(plant, found.controller, t, reference).error
    assert found.objective == pytest.approx(objectives_of(error)[objective], rel=1e-9)


def test_the_search_is_deterministic():
    assert hs.tune(MODE, T_STEP, STEP) == tuned("mode")


def test_units_of_time_and_displacement_change_nothing():
    plant = hs.TransferFunction(num=(1e3,), den=(3600.0 * MODE.den[0], 60.0 * MODE.den[1], MODE.den[2]))
    assert hs.tune(plant, 60.0 * T_STEP, 1e3 * STEP).objective == pytest.approx(tuned("mode").objective, rel=1e-6)


@pytest.mark.parametrize("name", ["mode", "chain"])
def test_a_plant_of_negative_gain_gets_the_negative_gains_and_the_same_figures(name):
    found, turned = tuned(name), tuned(name, turned=True)
    assert found.controller.kp > 0.0
    for gain in ("kp", "ki", "kd"):
        assert getattr(turned.controller, gain) == pytest.approx(-getattr(found.controller, gain), rel=1e-9), gain
    for figure in ("objective", "max_sensitivity", "gain_margin", "phase_margin"):
        assert getattr(turned, figure) == pytest.approx(getattr(found, figure), rel=1e-9), figure


def test_the_trials_are_what_it_chose_from():
    found = tuned("mode")
    chosen = hs.control.Trial(
        controller=found.controller,
        max_sensitivity=found.max_sensitivity,
        voltage_noise=found.voltage_noise,
        objective=found.objective,
    )
    assert chosen in found.trials
    assert found.objective == min(trial.objective for trial in found.trials if trial.max_sensitivity <= 2.0)
    assert f"{len(found.trials)} loops simulated" in found.message


def test_the_trade_off_is_the_front_of_the_trials():
    found = tuned("mode")
    trials = {(trial.max_sensitivity, trial.objective) for trial in found.trials if np.isfinite(trial.objective)}
    best = {
        (robust, value)
        for robust, value in trials
        if not any(r <= robust and v <= value and (r, v) != (robust, value) for r, v in trials)
    }
    assert [(trial.max_sensitivity, trial.objective) for trial in found.trade_off] == sorted(best)
    assert found.controller in [trial.controller for trial in found.trade_off]


def test_the_gains_that_are_zero_in_a_template_stay_so():
    template = hs.PID(ki=1.0, kd=5.0, derivative_filter=0.03, setpoint_weight=0.5, limits=(0.0, 10.0))
    found = hs.tune(MODE, T_STEP, STEP, controller=template)
    assert found.success
    assert found.controller == replace(template, ki=found.controller.ki, kd=found.controller.kd)
    assert found.controller.ki > 0.0
    assert found.controller.kd > 0.0
    assert found.controller.kp == 0.0
    alone = hs.tune(MODE, T_STEP, STEP, controller=hs.PID(ki=1.0))
    assert found.objective < alone.objective
    assert hs.tune(negative(MODE), T_STEP, STEP, controller=hs.PID(ki=1.0)).controller.ki == pytest.approx(
        -alone.controller.ki, rel=1e-9
    )


SHARP = hs.Actuator(
    hysteresis=LAW,
    vibration=hs.mode(1.0, 0.02),
    sensor=hs.Sensor(noise=1e-3, delay=H),
    amplifier=hs.Amplifier(gain=2.0),
)
OFF = [replace(SHARP, vibration=hs.mode(w, 0.02)) for w in (0.9, 1.1)]
PARTS = hs.TrackingController(
    feedforward=hs.InverseFeedforward(law=LAW, amplifier=SHARP.amplifier),
    feedback=hs.PID(ki=0.02),
    notch=hs.Notch(natural_frequency=1.0, damping_ratio=0.02),
    damping=hs.DampingLoop(gain=0.1, frequency=0.3),
    limits=(-5.0, 5.0),
)


def test_a_controller_of_parts_keeps_its_parts_and_gets_its_gains():
    found = hs.tune(SHARP, T_RAMP, RAMP, controller=PARTS, objective="rms", variations=OFF[:1])
    pid, damping = found.controller.feedback, found.controller.damping
    assert found.success
    assert found.controller == replace(PARTS, feedback=pid, damping=damping)
    assert pid == hs.PID(ki=pid.ki)
    assert damping == replace(PARTS.damping, gain=damping.gain)
    assert min(pid.ki, damping.gain) > 0.0
    given = hs.close_loop(SHARP, PARTS, T_RAMP, RAMP)
    assert found.objective < np.sqrt(np.mean((RAMP - given.y) ** 2))
    only = replace(PARTS, feedback=None, notch=None)
    damped = hs.tune(SHARP, T_RAMP, RAMP, controller=only, objective="rms")
    assert damped.controller == replace(only, damping=damped.controller.damping)


def test_where_a_law_is_flat_for_a_moment_no_loop_is_closed():
    play = hs.Actuator(hysteresis=hs.Play(threshold=0.2), vibration=LATE)
    assert hs.tune(play, T_RAMP, RAMP, controller=hs.PID(ki=1.0), objective="rms").success


def test_the_bounds_hold_on_the_variations_too():
    options = {"controller": hs.PID(kp=1.0, ki=1.0, kd=1.0), "objective": "rms"}
    found = hs.tune(SHARP, T_RAMP, RAMP, variations=OFF, **options)
    gain = {}
    for plant in (SHARP, *OFF):
        slopes = law_slopes(plant, RAMP, 2.0)
        loop = hs.control.LinearLoop(plant, H)
        gain[plant] = [loop.max_sensitivity(found.controller, slope) for slope in (min(slopes), max(slopes))]
    assert found.success
    # the slopes are those of a voltage of another secant gain
    assert max(map(max, gain.values())) == pytest.approx(found.max_sensitivity, rel=0.03)
    quiet = hs.tune(SHARP, T_RAMP, RAMP, variations=OFF, max_voltage_noise=0.3 * found.voltage_noise, **options)
    assert quiet.success
    assert 0.0 < quiet.voltage_noise <= 0.3 * found.voltage_noise
    assert all(trial.voltage_noise <= 0.3 * found.voltage_noise for trial in quiet.trade_off)
    assert "noise of the command" in quiet.message


def test_a_resonance_at_which_nobody_crosses_over_gets_a_pid_with_its_zeros_there():
    """Better than the largest ki that was found by hand on the actuator of `experiments/14_compensation_matrix.py`."""
    h, w = 5e-5, 2.0 * np.pi * 500.0
    law = hs.PolynomialBoucWen(
        beta=0.00388, gamma=0.0585, gain=-0.00765, offset=-0.113, z0=-8.84, input_coefficients=(0.0281, -3.83e-5)
    )
    plant = hs.Actuator(hysteresis=law, vibration=hs.mode(w, 0.01), sensor=hs.Sensor(noise=1e-3, delay=h))
    off = [replace(plant, vibration=hs.mode(factor * w, 0.01)) for factor in (0.9, 1.1)]
    r = hs.signals.triangle(0.1, 2.5, cycles=1, samples_per_cycle=5000)
    t = h * np.arange(r.size)
    by_hand = hs.PID(kp=1.68, ki=1.74e5, kd=0.0214, limits=(0.0, 150.0))
    found = hs.tune(
        plant,
        t,
        r,
        controller=hs.PID(kp=1.0, ki=1.0, kd=1.0, limits=(0.0, 150.0)),
        objective="rms",
        variations=off,
        transient=0.05,
        max_sensitivity=2.033,  # that of the one by hand
    )
    error = (r - hs.close_loop(plant, by_hand, t, r).y)[1000:]
    assert (found.success, found.controller.limits) == (True, (0.0, 150.0))
    assert found.objective < np.sqrt(np.mean(error**2)) / r.max()


@pytest.mark.parametrize("template", [None, hs.PID(ki=1.0), hs.TrackingController(feedback=hs.PID(kp=1.0, ki=1.0))])
@pytest.mark.parametrize("limits", [(0.0, 0.5), (0.0, 0.0)])
def test_a_reference_out_of_reach_is_said_to_be(template, limits):
    found = hs.tune(MODE, T_STEP, STEP, controller=template, limits=limits)
    run = hs.close_loop(MODE, found.controller, T_STEP, STEP)
    limited = np.count_nonzero(run.drive != run.command)
    assert limited > 100
    assert f"limited at {limited} of 200 samples" in found.message
    assert 1.0 >= found.objective > 0.1
    assert np.isfinite(run.command).all()


def test_the_integral_of_a_lightly_damped_mode_may_be_slower_than_the_record():
    plant = hs.Actuator(
        hysteresis=hs.Dahl(stiffness=8.0, coulomb=0.3) + hs.Line(slope=1.0), vibration=hs.mode(0.4, 0.01)
    )
    found = hs.tune(plant, T_STEP, STEP, controller=hs.PID(ki=0.2))
    assert (found.success, found.controller.ki < 3e-4) == (True, True)


def test_of_several_limits_the_worst_counts_and_the_first_is_returned():
    tight, free = (0.0, 1.3), None
    both = tuned("mode", limits=(tight, free))
    assert both.controller.limits == tight
    assert hs.tune(MODE, T_STEP, STEP, limits=[free, tight]).controller.limits is None
    errors = [hs.close_loop(MODE, replace(both.controller, limits=each), T_STEP, STEP).error for each in (tight, free)]
    weights = np.linspace(0.0, 1.0, STEP.size)
    assert both.objective == pytest.approx(max(np.mean(weights * np.abs(e)) for e in errors), rel=1e-9)
    one = tuned("mode", limits=tight)
    assert one.controller.limits == tight
    run = hs.close_loop(MODE, one.controller, T_STEP, STEP)
    assert (run.u.min() >= 0.0, run.u.max()) == (True, 1.3)


def test_a_transient_is_left_out_of_the_objective():
    found = hs.tune(LAW, T_RAMP, RAMP, objective="rms", transient=2.5)
    error = hs.close_loop(LAW, found.controller, T_RAMP, RAMP).error[50:]
    assert found.objective == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)


def test_a_loop_starts_from_its_resting_voltage():
    found = hs.tune(MODE, T_STEP, STEP + 2.0, u0=2.0)
    assert found.objective == pytest.approx(tuned("mode").objective, rel=1e-6)
    assert found.controller.kp == pytest.approx(tuned("mode").controller.kp, rel=1e-3)  # xatol


test_wrong_arguments_are_named = refused(
    ((MODE, T_STEP, 0.0 * STEP), {}, "output at rest 0: nothing to follow"),
    ((MODE, T_STEP, STEP), {"u0": 1.0}, "output at rest 1: nothing to follow"),
    ((MODE, T_STEP, STEP), {"objective": "ise"}, "objective must be one of itae, rms, got 'ise'"),
    ((MODE, T_STEP, STEP), {"max_sensitivity": 1.0}, "max_sensitivity must be above one, got 1.0"),
    ((MODE, T_STEP, STEP), {"max_sensitivity": np.nan}, "max_sensitivity must be above one, got nan"),
    ((MODE, T_STEP, STEP), {"limits": (1.0, 0.0)}, r"\(lowest, highest\), got \(1.0, 0.0\)"),
    ((MODE, T_STEP, STEP), {"limits": []}, r"\(lowest, highest\), got \(\)"),
    ((MODE, T_STEP, STEP), {"max_voltage_noise": 0.0}, "max_voltage_noise must be positive, got 0.0"),
    ((MODE, T_STEP, STEP), {"controller": hs.PID()}, "nothing to tune"),
    ((MODE, T_STEP, STEP), {"controller": hs.TrackingController()}, "nothing to tune"),
    ((MODE, T_STEP, STEP), {"variations": [negative(MODE)]}, "no controller of the linear rule"),
    ((MODE, T_STEP, STEP[1:]), {}, "equal lengths, got 199 and 200"),
    ((MODE, T_STEP**2, STEP), {}, "evenly spaced"),
    ((MODE, T_STEP, STEP * np.inf), {}, "reference must be finite, got inf"),
    ((hs.BoucWen(gain=0.0), T_STEP, STEP), {}, "gain is 0.0"),
    ((hs.TransferFunction(num=(1.0,), den=(1.0, 0.0)), T_STEP, STEP), {}, "gain is inf"),
    ((MODE, T_STEP, STEP), {"transient": -1.0}, "transient"),
    ((MODE, T_STEP, STEP), {"transient": 100.0}, "transient"),
    (("plant", T_STEP, STEP), {}, TypeError, "got str"),
    ((MODE, T_STEP, STEP), {"variations": ["plant"]}, TypeError, "got str"),
    ((MODE, T_STEP, STEP), {"controller": hs.BoucWen()}, TypeError, "PID or a TrackingController, got BoucWen"),
    call=lambda arguments, options: hs.tune(*arguments, **options),
)


@pytest.mark.parametrize(
    ("zero", "limits"), [(3.0, (0.0, 100.0)), (-3.0, (0.0, 100.0)), (0.0, (0.0, 50.0)), (3.0, (5.0, 50.0))]
)
def test_neither_the_zero_of_a_sensor_nor_limits_beyond_the_cycle_keep_a_stage_from_being_tuned(zero, limits):
    law = hs.BoucWen(beta=0.02, gamma=0.005, feedthrough=0.03, gain=-0.012, u0=0.0, u_range=(0.0, 100.0))
    cycle, plain = np.array([0.0, 1.0]), hs.Actuator(hysteresis=law)
    stage = hs.Actuator(hysteresis=replace(law, offset=zero), amplifier=hs.Amplifier(limits=limits))
    gain = hs.control.secant_gain(plain, cycle)
    assert hs.control.secant_gain(stage, zero + cycle) == pytest.approx(gain, rel=1e-9)
    assert hs.tune(stage, 1e-3 * np.arange(200), zero + np.ones(200)).success


def test_a_stage_in_the_middle_of_its_range_has_the_gain_along_it():
    """Neither an input nor an output near zero is known."""
    law = hs.BoucWen(beta=0.02, gamma=0.005, feedthrough=0.03, gain=-0.02, offset=7.0, u0=60.0, u_range=(60.0, 100.0))
    y = law.response(hs.signals.triangle(60.0, 100.0, cycles=8, samples_per_cycle=100))[-100:]
    gain = hs.control.secant_gain(hs.Actuator(hysteresis=law), y)
    assert gain == pytest.approx(np.ptp(y) / 40.0, rel=0.02)
