"""A controller without a valid sample holds the last one, counts it, and recovers: in Python, in loops and in C."""

import math

import numpy as np
import pytest
from strategies import commanded, needs_compiler
from test_c_export import AMPLIFIED, CONTROLLERS, MODE, STACK, compiled, replayed
from test_inverse_of_every_law import LAWS, reversing

import hysim as hs
from hysim.models.protocols import CompiledController

H = 5e-5  # s
LAW = hs.BoucWen(beta=0.5, gamma=0.1, feedthrough=1.5, gain=-0.7)
ADAPTIVE = hs.AdaptiveInverse(law=LAW, free=("gain", "beta"), drift=(0.05, 0.05), noise=1e-3, limits=(-4.0, 4.0))
EVERY = {name: (lambda build=build: build()[1]) for name, build in CONTROLLERS.items()} | {
    "adaptive": lambda: ADAPTIVE,
    "inverse_alone": lambda: hs.InverseFeedforward(law=LAW),
    "inverse_with_creep": lambda: hs.InverseFeedforward.of(STACK),
    "damping_alone": lambda: hs.TrackingController(damping=hs.DampingLoop(gain=2.0, frequency=3e3)),
    "model_following": lambda: hs.TrackingController(
        shaper=hs.Shaper.zvd(*MODE.values()), feedforward=hs.InverseFeedforward.of(AMPLIFIED), model=AMPLIFIED
    ),
}
every_controller = pytest.mark.parametrize("name", EVERY)
GAPS = {5: math.nan, 6: math.inf, 7: -math.inf, 20: 1e300, 33: -1.7e308}  # at which sample there is what in its place


def signals(n=60):
    k = np.arange(n)
    return 0.4 + 0.3 * np.sin(0.2 * k), 0.35 + 0.3 * np.sin(0.2 * k - 0.1)


def with_gaps(values, shift=0):
    values = values.copy()
    for k, value in GAPS.items():
        values[k + shift] = value
    return values


def filled(values):
    """The last valid value in place of each that is not."""
    valid = np.abs(values) <= 1e100
    return values[np.maximum.accumulate(np.where(valid, np.arange(values.size), 0))]


def run(controller, reference, measurement):
    """Commands, those before the limits, and the number of held samples."""
    state, commands = controller.initial(H), []
    with np.errstate(all="ignore"):
        for r, m in zip(reference.tolist(), measurement.tolist(), strict=True):
            u, state = controller.step(state, r, m)
            commands.append((state.state[0], u))
    return np.array(commands), hs.control.held_samples(state)


@every_controller
def test_a_missing_sample_is_the_last_valid_one(name):
    """To the bit; reference and measurement are missing at other samples, and both at one."""
    controller, (r, m) = EVERY[name](), signals()
    without, with_them = run(controller, r, m), run(controller, with_gaps(r, shift=1), m)
    assert without[1] == 0
    assert with_them[1] == len(GAPS)
    assert np.array_equal(with_them[0], run(controller, filled(with_gaps(r, shift=1)), m)[0])
    both = run(controller, with_gaps(r, shift=1), with_gaps(m))
    assert both[1] == len({k + shift for k in GAPS for shift in (0, 1)})
    assert np.isfinite(both[0][:, 1]).all()
    if name != "adaptive":  # it goes without the measurement, see below
        assert np.array_equal(both[0], run(controller, filled(with_gaps(r, shift=1)), filled(with_gaps(m)))[0])


@every_controller
def test_before_the_first_valid_sample_a_controller_is_at_rest(name):
    controller, (r, m) = EVERY[name](), signals()
    nothing = np.full(3, math.nan)
    commands, held = run(controller, np.append(nothing, r), np.append(nothing, m))
    assert held == 3
    rest = np.zeros(3)
    if name != "adaptive":
        assert np.array_equal(commands, run(controller, np.append(rest, r), np.append(rest, m))[0])
    assert np.isfinite(commands[:, 1]).all()


@every_controller
@pytest.mark.parametrize("size", [1e3, 1e30, 1e99, 1e300])
def test_a_spike_leaves_nothing_that_is_not_finite(name, size):
    controller, (r, m) = EVERY[name](), signals()
    at_rest = np.isfinite(controller.initial(H).state)
    for spiked in (0, 1):
        inputs = [r.copy(), m.copy()]
        inputs[spiked][[10, 30]] = size, -size
        state = controller.initial(H)
        with np.errstate(all="ignore"):
            for k in range(r.size):
                u, state = controller.step(state, inputs[0][k], inputs[1][k])
                assert math.isfinite(u)
        assert np.isfinite(state.state[1:])[at_rest[1:]].all()  # before them the command, nan beyond the reach


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_the_inverse_of_every_law_recovers_from_a_spike(law):
    """Where the spike is out of reach the command is held; the reference is met again to 1e-9 of its range."""
    reference, _ = reversing(law, 0.0)
    spiked = reference.copy()
    spiked[[50, 120]] = 1e300, math.nan
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), limits=(-9.0, 9.0))
    u, state = commanded(controller, 1.0, spiked, np.zeros(spiked.size))
    assert hs.control.held_samples(state) == 2
    timed = {"sample_time": 1.0} if isinstance(law, hs.RateDependentPrandtlIshlinskii) else {}
    y, wanted = law.response(np.append(0.0, u), **timed)[1:], reference.copy()
    wanted[[50, 120]] = reference[[49, 119]]
    assert np.abs(y - wanted).max() < 1e-9 * np.ptp(reference)


def plant_under(measure, n=1500):
    """Tracking errors and state of the adaptive inverse; the plant's gain is a fifth lower than it believes."""
    plant, state, memory, y, errors = LAW.with_scalars({"gain": -0.56}), ADAPTIVE.initial(0.01), None, 0.0, []
    for k, r in enumerate((0.9 * np.sin(0.05 * np.arange(n))).tolist()):
        u, state = ADAPTIVE.step(state, r, measure(k, y))
        output, memory = plant.advance([u], memory if memory is not None else plant.state_at(0.0))
        y = float(output[0])
        errors.append(abs(y - r))
    return np.array(errors), state


def test_an_adaptive_inverse_learns_nothing_from_a_missing_measurement():
    """Its numbers stay while the sensor is out, and an outlier moves them little."""
    errors, state = plant_under(lambda k, y: y)
    out, after = plant_under(lambda k, y: math.nan if 700 <= k < 900 else y)
    spiked, _ = plant_under(lambda k, y: {700: 1e300, 750: 1e20, 800: -50.0}.get(k, y))
    assert errors[600:].max() < 1e-3
    assert out[600:].max() < 1e-3
    assert spiked[1000:].max() < 1e-3
    assert spiked[700:].max() < 0.05
    assert hs.control.held_samples(after) == 200
    assert hs.control.held_samples(state) == 0


class Faulty:
    """A controller of the user whose command is not a number at one sample."""

    def compiled(self, sample_time, u0, y0):
        def step(parameters, state, reference, measurement):
            state[1] += 1.0
            state[0] = math.nan if state[1] == 3.0 else 0.5 * reference
            return state[0]

        from hysim.kernels._compile import signed_kernel
        from hysim.kernels.controllers import CONTROLLER

        kernel = signed_kernel(CONTROLLER.signature)(step)
        return CompiledController(kernel, np.zeros(1), np.zeros(2))


def test_a_loop_holds_and_counts(monkeypatch):
    """A user's controller without a command stays at the last one; a sensor that drops out is the last measurement."""
    t, r = 0.01 * np.arange(6), np.arange(1.0, 7.0)
    faulty = hs.close_loop(hs.Line(slope=1.0), Faulty(), t, r)
    assert faulty.u.tolist() == [0.5, 1.0, 1.0, 2.0, 2.5, 3.0]
    assert faulty.conditions["held_samples"] == 1
    assert "held samples 1" in str(faulty)
    sensed = hs.Actuator(hysteresis=LAW, sensor=hs.Sensor(noise=1e-9))
    monkeypatch.setattr(hs.Sensor, "noise_samples", lambda sensor, n: with_gaps(np.zeros(n)))
    t, r = 0.01 * np.arange(60), signals()[0]
    for controller in (hs.PID(kp=0.1, ki=10.0), hs.TrackingController(feedback=hs.PID(ki=10.0)), ADAPTIVE):
        gone = hs.close_loop(sensed, controller, t, r)
        assert gone.conditions["held_samples"] == len(GAPS)
        assert np.isfinite(gone.u).all()
        assert np.array_equal(commanded(controller, 0.01, r, gone.measurement, y0=gone.y[0])[0], gone.drive)


def test_a_loop_around_a_structure_holds_and_counts():
    frame = hs.Structure(mass=1.0, stiffness=4.0, damping=0.5, excitation="force", output="displacement")
    run_ = hs.close_loop(frame, Faulty(), 0.01 * np.arange(6), np.arange(1.0, 7.0))
    assert run_.drive.tolist() == [0.5, 1.0, 1.0, 2.0, 2.5, 3.0]
    assert run_.conditions["held_samples"] == 1


@needs_compiler
@pytest.mark.parametrize("name", ["pid", "everything", "repetitive", "predictive", "adaptive", "inverse_alone"])
def test_c_holds_and_counts_as_python(name, tmp_path):
    """To 1e-12 of the range, as over a record without gaps; one step, `guarded`, calls every controller."""
    controller, (r, m) = EVERY[name](), signals()
    r, m = with_gaps(r, shift=1), with_gaps(m)
    source = hs.to_c(controller, H, name=name)
    held, u = replayed(compiled(source, tmp_path, other=f"{name}_held(&state)"), r, m)
    takes_both = "double measurement" in source.header
    commands, count = run(controller, r, m if takes_both else np.zeros(m.size))
    assert np.abs(u - commands[:, 1]).max() <= 1e-12 * np.ptp(commands[:, 1])
    assert held[-1] == count
    assert (np.diff(held) >= 0.0).all()
