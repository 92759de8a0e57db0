"""Laws, actuators, oscillators and controllers inside python-control move as they do in hysim's own loops.

A system's state is counted from rest. Where rest is all zeros the numbers are the same bits; elsewhere the sum of a
state and its rest rounds once a sample, which is what the tolerances are for.
"""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from strategies import Passes, commanded, refused

import hysim as hs

H = 0.05
ROUNDING = 1e-12  # of signals of order one, over some hundred samples
T = H * np.arange(150)
MODE = hs.TransferFunction(num=(1.5,), den=(1.0, 0.6, 1.5))


def slipping(parameters, state, u):
    gain, r = parameters
    state[1] = max(u - r, min(u + r, state[1]))
    state[0] = u
    return gain * state[1]


AT_ZERO = [
    hs.Line(slope=0.7),
    hs.BoucWen(beta=0.6, gamma=0.3, feedthrough=0.5, gain=0.4),
    hs.BoucWen(beta=0.6, gamma=0.3, n=1.6, feedthrough=0.5, gain=0.4),
    hs.PolynomialBoucWen(beta=0.4, gamma=0.4, gain=0.3, n=2.0, input_coefficients=(0.6, 0.1, -0.02)),
    hs.ZhuWangBoucWen(),
    hs.GeneralizedBoucWen(),
    hs.Duhem.from_terms({"u'": 0.9, "|u'| y": -0.3, "|u'| u": 0.2}),
    hs.Duhem.from_terms({"u'": 1.0, "u' |z|": -0.3, "|u'| z": -0.6}, feedthrough=2.0),
    hs.Dahl(stiffness=2.0, coulomb=0.5),
    hs.Play(threshold=0.2),
    hs.Stop(threshold=0.2),
    hs.PrandtlIshlinskii(thresholds=(0.0, 0.1, 0.4), weights=(1.0, 0.5, 0.3)),
    hs.MaxwellSlip(stiffness=(1.0, 0.5), slips=(0.1, 0.4)),
    hs.Tellinen(coercivity=0.3),
    hs.EnergyPlays(thresholds=(0.0, 0.2), weights=(1.0, 0.5), field=0.3),
    hs.ParametricPrandtlIshlinskii(exponent=-0.5, decay=0.3, weight=0.4, weight_slope=0.1, reach=2.0),
    hs.ModifiedPrandtlIshlinskii(
        thresholds=(0.0, 0.2), weights=(1.0, 0.5), dead_zones=(0.0, 0.3), dead_zone_weights=(1.0, 0.4)
    ),
    hs.GeneralizedPrandtlIshlinskii(thresholds=(0.0, 0.2), weights=(1.0, 0.5), left=(1.0, 1.0, 0.0, 0.0, 0.5)),
    hs.ColemanHodgdon(alpha=0.8, c=1.0, B=0.5),
    hs.BoucWenBaberNoori(delta_nu=0.2, delta_eta=0.1),
    hs.JilesAtherton(Ms=1.0, a=0.4, alpha=0.5, k=0.3, gain=1.0, feedthrough=0.2),
    hs.Dahl() + hs.Line(slope=0.5) + hs.Play(threshold=0.1),
    hs.Play(threshold=0.1) >> hs.Dahl(),
    hs.CustomLaw(step=slipping, parameters={"gain": 2.0, "r": 0.25}, state={"z": 0.0}),
]
ELSEWHERE = [
    hs.Line(offset=0.2, slope=0.7),
    hs.BoucWen(beta=0.6, gamma=0.3, n=1.6, feedthrough=0.5, gain=0.4, offset=-0.1, z0=0.2),
    hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(1.0, 0.5), offset=0.1, z0=0.2),
    hs.Duhem.from_terms({"u'": 0.9, "|u'| y": -0.3}, y0=0.1),
    hs.Preisach(levels=(-2.0, -0.5, 1.0, 3.0), weights=(1.0, 0.5, 1.0, 0.2, 0.3, 0.4)),
    hs.PreisachRelays(levels=(-1.0, 0.5, 1.0), weights=(1.0, 0.5, 1.0)),
    hs.Chan(coercivity=0.3, gap=0.1),
]


def family(law):
    return type(law).__name__


def walk(seed, n=150):
    return np.cumsum(np.random.default_rng(seed).normal(0.0, 0.2, n))


def just_before(law, u):
    """The law's output before each new command of an input that begins at rest at zero."""
    return law.response(np.append(0.0, u))[:-1]


def response(system, u):
    return control.input_output_response(system, T[: np.shape(u)[-1]], u).outputs


@pytest.mark.parametrize("law", AT_ZERO, ids=family)
def test_a_law_gives_the_same_bits(law):
    u = walk(1)
    assert_array_equal(response(hs.to_control(law, H), u), just_before(law, u))


@pytest.mark.parametrize("law", ELSEWHERE, ids=family)
def test_a_law_that_does_not_rest_at_zero_agrees_to_rounding(law):
    u = walk(2)
    assert response(hs.to_control(law, H), u) == pytest.approx(just_before(law, u), abs=ROUNDING)


def test_simulate_gives_the_same_a_sample_later():
    law, u = AT_ZERO[1], np.append(0.0, walk(3, 149))
    assert_array_equal(response(hs.to_control(law, H), u)[1:], hs.simulate(law, T, u).y[:-1])


amplifiers = st.sampled_from(
    [
        None,
        hs.Amplifier(gain=2.0, offset=0.1, limits=(-1.0, 1.2)),
        hs.Amplifier(limits=(-1.0, 1.2), slew_rate=8.0, time_constant=0.03),
    ]
)
creeps = st.sampled_from([None, hs.Creep(time_constants=(0.2, 3.0), weights=(0.1, 0.05))])
vibrations = st.sampled_from([None, MODE, replace(MODE, delay=0.13), hs.TransferFunction(num=(0.8,), den=(1.0,))])
sensors = st.sampled_from([None, hs.Sensor(delay=H), hs.Sensor(delay=0.07), hs.Sensor(quantum=0.01, delay=0.12)])


@settings(max_examples=30)
@given(st.sampled_from(AT_ZERO[:2] + ELSEWHERE), amplifiers, creeps, vibrations, sensors, st.integers(0, 99))
def test_an_actuator_gives_what_a_loop_measures(law, amplifier, creep, vibration, sensor, seed):
    plant = hs.Actuator(amplifier=amplifier, hysteresis=law, creep=creep, vibration=vibration, sensor=sensor)
    u = walk(seed, 60)
    own = hs.close_loop(plant, Passes(), T[:60], u).measurement
    quantum = 0.0 if sensor is None else sensor.quantum
    away = np.abs(response(hs.to_control(plant, H), u) - own)
    assert away.max() < ROUNDING + quantum
    assert np.mean(away > ROUNDING) < 0.1  # rounding may take a reading to the next step, but seldom


def looped(plant, pid, sample_time=H):
    """Plant and controller joined by python-control."""
    blocks = [
        hs.to_control(plant, sample_time),
        control.tf(hs.to_control(pid, sample_time), inputs="e", outputs="u", name="controller"),
        control.summing_junction(["r", "-y"], "e"),
    ]
    return control.interconnect(blocks, inputs="r", outputs=["y", "u"])


PLANTS = [
    AT_ZERO[2],
    AT_ZERO[11],
    hs.Actuator(hysteresis=AT_ZERO[1], vibration=MODE, sensor=hs.Sensor(delay=H)),
    hs.Actuator(
        amplifier=hs.Amplifier(limits=(-0.5, 0.8), time_constant=0.02),
        hysteresis=ELSEWHERE[1],
        creep=hs.Creep.per_decade(1.5),
        vibration=MODE,
        sensor=hs.Sensor(delay=0.07),
    ),
]


@pytest.mark.parametrize("plant", PLANTS, ids=["power", "plays", "mode", "whole"])
def test_a_loop_of_blocks_is_the_loop_of_close_loop(plant):
    pid, r = hs.PID(kp=0.1, ki=0.8), np.sin(T) + 0.3 * (T > 3.0)
    y, u = response(looped(plant, pid), r)
    own = hs.close_loop(plant, pid, T, r)
    assert y == pytest.approx(own.measurement, abs=10 * ROUNDING)  # the transfer function's realisation cancels
    assert u == pytest.approx(own.command, abs=10 * ROUNDING)


STACK = hs.Actuator(
    hysteresis=hs.BoucWen(beta=0.6, gamma=0.3, feedthrough=1.0, gain=-0.3),
    creep=hs.Creep(time_constants=(0.5,), weights=(0.05,)),
    vibration=hs.mode(20.0, 0.05),
    sensor=hs.Sensor(delay=H),
)
CONTROLLERS = {
    "feedback": hs.TrackingController(feedback=hs.PID(kp=0.1, ki=0.8, kd=0.001), limits=(-0.4, 0.5)),
    "inverse": hs.TrackingController(feedforward=hs.InverseFeedforward.of(STACK), preview=True),
    "plays": hs.TrackingController(feedforward=hs.InverseFeedforward(law=AT_ZERO[11]), feedback=hs.PID(ki=0.2)),
    "power": hs.TrackingController(
        feedforward=hs.InverseFeedforward(law=replace(ELSEWHERE[1], feedthrough=1.0)), limits=(-1.0, 1.0)
    ),
    "model": hs.TrackingController(
        shaper=hs.Shaper.zv(20.0, 0.05),
        mode_inverse=hs.ModeInverse(natural_frequency=20.0, damping_ratio=0.05),
        feedforward=hs.InverseFeedforward.of(STACK),
        feedback=hs.PID(ki=0.5),
        notch=hs.Notch(natural_frequency=20.0, damping_ratio=0.05),
        damping=hs.DampingLoop(gain=0.1, frequency=6.0),
        model=STACK,
        limits=(-1.0, 1.0),
    ),
}


@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
def test_a_controller_of_parts_gives_what_it_gives_in_a_loop(controller):
    rng = np.random.default_rng(4)
    r, m = 0.5 * np.sin(T), 0.4 * np.sin(T) + 0.05 * rng.standard_normal(T.size)
    expected, _ = commanded(controller, H, r, m)
    assert response(hs.to_control(controller, H), [r, m])[0] == pytest.approx(expected, abs=ROUNDING)


@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
def test_a_whole_loop_inside_python_control_is_the_loop_of_close_loop(controller):
    ahead, r = controller.ahead(H), 0.5 * np.sin(T) ** 2
    plant, block = hs.to_control(STACK, H), hs.to_control(controller, H)
    loop = control.interconnect(
        [plant, block], connections=[[(0, 0), (1, 0)], [(1, 1), (0, 0)]], inplist=[(1, 0)], outlist=[(0, 0), (1, 0)]
    )
    given_ahead = np.append(r[ahead:], np.full(ahead, r[-1]))
    own = hs.close_loop(STACK, controller, T, r)
    y, u = response(loop, given_ahead)
    assert y == pytest.approx(own.measurement, abs=10 * ROUNDING)
    assert u == pytest.approx(own.drive, abs=10 * ROUNDING)


OSCILLATOR = hs.BoucWenOscillator(mass=2.0, damping=1.0, stiffness=5.0, law=hs.BoucWen(A=4.0, beta=1.5, gamma=0.6))
OSCILLATORS = {
    "plain": OSCILLATOR,
    "base": replace(OSCILLATOR, excitation="base"),
    "power": replace(OSCILLATOR, law=hs.BoucWen(A=4.0, beta=1.5, gamma=-0.6, n=1.5, feedthrough=0.3, gain=1.2)),
    "moving": replace(OSCILLATOR, initial_state=(0.1, -0.2), law=replace(OSCILLATOR.law, z0=0.3, offset=0.1)),
    "polynomial": replace(OSCILLATOR, law=hs.PolynomialBoucWen(A=2.0, input_coefficients=(0.5, 0.0, 0.4))),
}


@pytest.mark.parametrize("plant", OSCILLATORS.values(), ids=OSCILLATORS)
def test_a_continuous_oscillator_agrees_within_the_tolerance_of_the_solver(plant):
    u = 2.0 * np.sin(1.3 * T)  # both take it as linear between the samples
    system = hs.to_control(plant)
    assert system.isctime()
    found = control.input_output_response(system, T, u, solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-11, "max_step": H})
    own = hs.simulate(plant, T, u)
    # the solver steps across the kinks of memory and input, at each of which it is good to the square of a step or so
    assert found.outputs == pytest.approx(own.y, abs=1e-6)
    start = np.array([*(plant.initial_state or (0.0, 0.0)), plant.law.z0])[:, np.newaxis]
    states = np.stack([own.signals[name] for name in ("y", "velocity", "z")])
    assert found.states + start == pytest.approx(states, abs=3e-6)


@pytest.mark.parametrize("plant", OSCILLATORS.values(), ids=OSCILLATORS)
def test_a_discrete_oscillator_is_the_one_under_a_held_input(plant):
    u = walk(5)
    own = hs.simulate(replace(plant, hold="zoh"), T, u).y
    assert response(hs.to_control(plant, H), u) == pytest.approx(own, abs=ROUNDING)


def test_evaluating_a_system_leaves_no_trace():
    system = hs.to_control(PLANTS[3], H)
    x, u = 0.1 * np.random.default_rng(6).standard_normal(system.nstates), np.array([0.3])
    before = system.dynamics(0.0, x, u), system.output(0.0, x, u)
    system.dynamics(0.0, -x, -u)
    assert_array_equal(system.dynamics(0.0, x, u), before[0])
    assert_array_equal(system.output(0.0, x, u), before[1])


@pytest.mark.parametrize("plant", [*PLANTS, OSCILLATOR], ids=["power", "plays", "mode", "whole", "oscillator"])
def test_no_command_reaches_the_output_of_its_own_sample(plant):
    system = hs.to_control(plant, H)
    x = np.zeros(system.nstates)
    assert_array_equal(system.output(0.0, x, np.array([0.7])), system.output(0.0, x, np.array([-0.7])))


def test_a_linear_law_keeps_the_limits_of_an_actuator():
    plant = hs.Actuator(amplifier=hs.Amplifier(limits=(0.0, 1.0)), hysteresis=hs.Line(slope=1.0), vibration=MODE)
    u = 3.0 * np.ones(400)
    y = control.input_output_response(hs.to_control(plant, H), H * np.arange(400), u).outputs
    assert y[-1] == pytest.approx(1.0, abs=0.05)
    assert isinstance(hs.to_control(replace(plant, hysteresis=None), H), control.StateSpace)


def test_the_states_are_named():
    assert hs.to_control(AT_ZERO[1], H).state_labels == ["v", "z", "w[-2]", "w[-1]"]
    named = hs.to_control(replace(STACK, sensor=hs.Sensor(delay=1.4 * H)), H).state_labels
    assert named == ["v", "z", "creep[0]", "vibration[0]", "vibration[1]", "w[-2]", "w[-1]", "y[-1]", "seen"]
    assert hs.to_control(OSCILLATOR).state_labels == ["y", "velocity", "z"]


def test_the_noise_is_left_out():
    quiet, noisy = (replace(STACK, sensor=hs.Sensor(noise=noise)) for noise in (0.0, 0.1))
    u = walk(7, 50)
    assert_array_equal(response(hs.to_control(noisy, H), u), response(hs.to_control(quiet, H), u))


SAMPLED = (*AT_ZERO, STACK, replace(STACK, hysteresis=hs.Line()), CONTROLLERS["feedback"])
test_what_makes_no_system_is_refused = refused(
    *((each, (), "moves from sample to sample: give a sample_time") for each in SAMPLED),
    *(
        (each, (-0.1,), r"sample_time must be positive and finite, got -0.1")
        for each in (AT_ZERO[0], STACK, CONTROLLERS["feedback"], OSCILLATOR)
    ),
    (hs.BoucWen(feedthrough=1.0).inverse(), (H,), TypeError, "part of a controller: give it as InverseFeedforward"),
    call=lambda part, time: hs.to_control(part, *time),
)


def test_a_plant_that_is_lost_says_when():
    growing = hs.BoucWen(beta=-1.0, gamma=-1.0, n=2.0)
    with pytest.raises(hs.SimulationError, match=r"diverges after t = 0\.05, at the command 9"):
        response(hs.to_control(growing, H), np.array([0.5, 9.0, 9.0]))
