"""An actuator is its law, then its linear dynamics, exact under the hold; it begins at rest."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import assert_refused, bounded_laws, refused, short_inputs

import hysim as hs
from hysim.kernels.stepping import drive
from hysim.plants.stages import sampled, vibration_stage

MODE = hs.TransferFunction(num=(0.3, 1.0), den=(1.0, 0.4, 2.0), delay=0.13)
LAW = hs.BoucWen(n=1.5, gain=0.5, feedthrough=1.0, offset=0.2)
EXACT = 1e-12  # two hundred steps of a stable plant with outputs of order one


@given(bounded_laws(), short_inputs())
def test_an_actuator_without_dynamics_is_its_law(law, u):
    assert np.array_equal(hs.Actuator(hysteresis=law).response(u), law.response(u))
    assert np.array_equal(hs.Actuator(hysteresis=law).memory(u), law.memory(u))


@given(short_inputs())
def test_an_actuator_without_a_law_is_its_dynamics_about_the_first_voltage(u):
    y = hs.Actuator(vibration=MODE).response(u, 0.1)
    expected = MODE.dc_gain * u[0] + MODE.response(u - u[0], 0.1)
    assert y == pytest.approx(expected, abs=EXACT)
    assert hs.Actuator(vibration=MODE).memory(u) is None


@given(bounded_laws(), short_inputs())
def test_the_chain_is_the_law_held_into_the_dynamics(law, u):
    """A long rest at the law's first output leaves nothing of a start from zero."""
    level = law.response(u)
    rest = 400  # decays as exp(-0.2 0.25 400) = 2e-9
    long = MODE.response(np.concatenate([np.full(rest, level[0]), level]), 0.25)[rest:]
    chain = hs.Actuator(hysteresis=law, vibration=MODE).response(u, 0.25)
    assert chain == pytest.approx(long, abs=1e-8 * (1.0 + abs(level[0])))


@given(bounded_laws(), st.floats(-0.4, 0.4), st.sampled_from(["start", "end"]))
def test_a_constant_voltage_finds_the_actuator_at_rest(law, u0, sample):
    plant = dataclasses.replace(MODE, sample=sample)
    y = hs.Actuator(hysteresis=law, vibration=plant).response(np.full(30, u0), 0.1)
    assert y == pytest.approx(np.full(30, MODE.dc_gain * law.response([u0])[0]), abs=EXACT)


@pytest.mark.parametrize("delay", [0.0, 0.04, 0.1, 0.27])
@pytest.mark.parametrize(
    ("num", "den"),
    [((2.0,), (1.0, 0.5)), ((0.3, 1.0), (1.0, 0.4, 2.0)), ((1.0, 2.0, 3.0), (2.0, 0.5, 4.0)), ((3.0,), (2.0,))],
)
def test_the_sampled_stage_is_the_response_just_before_each_sample(num, den, delay):
    plant = hs.TransferFunction(num=num, den=den, delay=delay, sample="end")
    continuous = vibration_stage(plant, 0.1)
    stage = sampled(continuous, 0.1, delay)
    v = np.random.default_rng(0).standard_normal(200)
    x, y = np.zeros(len(den) - 1), np.empty(201)
    past = np.concatenate([np.zeros(stage.lag + 1), v])  # past[k + lag + 1] is v_k
    for k in range(201):
        older = past[k]
        y[k] = stage.output @ [0.0, older, 0.0, *x]
        if k < 200:
            x = stage.A @ x + stage.B[1] * older + stage.B[0] * past[k + 1]
    assert y[1:] == pytest.approx(plant.response(v, 0.1), abs=EXACT * 10)  # outputs up to 10
    assert y[0] == 0.0
    if len(den) > 1:
        assert stage.A @ stage.rest + stage.B.sum(axis=0) == pytest.approx(stage.rest, abs=EXACT)
        assert continuous.dc_gain == pytest.approx(plant.dc_gain, rel=EXACT)


def test_an_actuator_without_dynamics_needs_no_time():
    assert hs.Actuator().response([1.0, -2.0]).tolist() == [1.0, -2.0]
    assert hs.Actuator(vibration=MODE).response([], 0.1).size == 0
    assert not hs.Actuator(hysteresis=LAW).dynamic
    assert hs.Actuator(vibration=MODE).dynamic


def test_an_integrator_has_no_state_of_rest():
    integrator = hs.TransferFunction(num=(1.0,), den=(1.0, 0.0))
    assert np.isinf(vibration_stage(integrator, 0.1).rest).any()
    assert hs.Actuator(vibration=integrator).response([0.0, 1.0, 1.0], 0.5).tolist() == [0.0, 0.0, 0.5]
    with pytest.raises(ValueError, match="integrates: it cannot rest at the law's output 1"):
        hs.Actuator(vibration=integrator).response([1.0, 1.0], 0.5)


@given(short_inputs(), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-1.0, 1.0))
def test_a_line_steps_as_it_responds(u, offset, slope, u0):
    line = hs.Line(offset=offset, slope=slope)
    step, parameters, state = line.compiled(u0)
    y = np.empty(u.size)
    assert drive(step, parameters, state, u, y) == -1
    assert np.array_equal(y, line.response(u))


def test_simulate_takes_an_actuator():
    actuator = hs.Actuator(hysteresis=LAW, vibration=MODE)
    u = np.sin(np.arange(20.0))
    sim = hs.simulate(actuator, 0.1 * np.arange(20), u)
    assert sim.y == pytest.approx(actuator.response(u, 0.1), abs=EXACT)
    assert np.array_equal(sim.z, LAW.memory(u))
    assert_refused("time", hs.simulate, actuator, None, u)


test_wrong_arguments_are_named = refused(
    (lambda: hs.Actuator(hysteresis=3.0), TypeError, "hysteresis must be a law .* got float"),
    (lambda: hs.Actuator(hysteresis=hs.PID(kp=1.0)), TypeError, "hysteresis must be a law"),
    (lambda: hs.Actuator(hysteresis=MODE), TypeError, "hysteresis must be a law .* got TransferFunction"),
    (lambda: hs.Actuator(vibration=LAW), TypeError, "vibration must be a TransferFunction, a .*, got BoucWen"),
    (lambda: hs.Actuator(vibration=dataclasses.replace(MODE, hold="foh")), 'hold must be "zoh"'),
    (
        lambda: hs.Actuator(vibration=dataclasses.replace(MODE, initial_state=(0.0, 1.0))),
        "must not hold an initial state",
    ),
    (lambda: hs.Actuator(LAW), TypeError, "positional"),
    (lambda: hs.Actuator(creep=LAW), TypeError, "creep must be of Creep, got BoucWen"),
    (lambda: hs.Actuator(amplifier=2.0), TypeError, "amplifier must be of Amplifier, got float"),
    (lambda: hs.Actuator(sensor=LAW), TypeError, "sensor must be of Sensor, got BoucWen"),
    (lambda: hs.Actuator(vibration=MODE).response([0.0, 1.0]), "needs sample_time"),
    (lambda: hs.Actuator(vibration=MODE).response([0.0, 1.0], 0.0), "sample_time must be positive"),
    (lambda: hs.Actuator().response([0.0, np.nan]), "u must be finite, got nan at index 1"),
    (lambda: hs.Actuator().response([[0.0]]), "u must have 1 axis"),
)


# ---------------------------------------------------------------------------------- of a fit


def test_an_actuator_of_a_fit_stays_within_its_record():
    u = hs.signals.triangle(-1.0, 3.0, cycles=2, samples_per_cycle=60)
    rec = hs.Record(u=u, y=np.round((0.5 * u + hs.BoucWen(beta=1.0).response(u)) / 0.01) * 0.01, resolution=0.01)
    fit = hs.identify(hs.BoucWen, rec, fixed={"n": 1.0})
    stack = hs.Actuator.of(fit, rec)
    assert (stack.amplifier.limits, stack.sensor.quantum, stack.u_range) == ((-1.0, 3.0), 0.01, (-1.0, 3.0))
    assert np.array_equal(stack.response(u), fit.model.response(u))
    t = 0.01 * np.arange(200)
    with pytest.warns(hs.HysimWarning, match="at a limit of the controller .* is out of reach there$"):
        run = hs.close_loop(stack, hs.PID(ki=50.0), t, np.full(t.size, 2.0 * rec.y.max()))
    assert run.u.max() == 3.0
    assert run.u.min() >= -1.0
    assert hs.InverseFeedforward.of(stack).amplifier == stack.amplifier


def test_an_actuator_of_a_model_takes_the_range_that_this_was_identified_on():
    law = hs.BoucWen(u0=-2.0, u_range=(-2.0, 4.0))
    assert hs.Actuator.of(law) == hs.Actuator(hysteresis=law, amplifier=hs.Amplifier(limits=(-2.0, 4.0)))
    own = hs.Actuator(hysteresis=law, amplifier=hs.Amplifier(gain=2.0, limits=(0, 1)), sensor=hs.Sensor(quantum=0.5))
    assert hs.Actuator.of(own) == own
    assert_refused(r"are not known: give Actuator.of\(fit, record\)", hs.Actuator.of, hs.BoucWen())


def test_the_range_of_commands_becomes_one_of_voltages():
    rec = hs.Record(u=[0.0, 5.0, 1.0], y=[0.0, 1.0, 0.5])
    inverting = hs.Actuator(amplifier=hs.Amplifier(gain=-2.0, offset=1.0), hysteresis=hs.BoucWen())
    stack = hs.Actuator.of(inverting, rec)
    assert stack.amplifier.limits == stack.u_range == (-9.0, 1.0)
    assert stack.u0 == 0.0
