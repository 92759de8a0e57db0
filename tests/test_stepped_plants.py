"""Laws, plants, sums and cascades run sample by sample as they respond, from any first input."""

from dataclasses import replace

import numpy as np
import pytest
from strategies import assert_refused

import hysim as hs
from hysim._basics.frozen import checked
from hysim.export import program_of
from hysim.models.compiled_step import startable
from hysim.models.protocols import needs_time
from hysim.plants.actuator import as_stepwise

TIME = 0.05


def stepped(model, u, sample_time=None):
    """Outputs by the step, from the first sample of `u` on."""
    step, parameters, state = startable(model, sample_time).started(u[0])
    return np.array([step(parameters, state, value) for value in u])


def walk(seed=0, n=60, scale=1.0):
    """A random input that stands still now and then, and does not begin at zero."""
    rng = np.random.default_rng(seed)
    return np.repeat(scale * rng.normal(size=n), rng.integers(1, 3, n))[:n] + 0.3


DUHEM = hs.Duhem.from_terms({"u'": 1.0, "|u'| z": -1.0, "|u'| |z| z": -0.1}, feedthrough=0.5, offset=0.2, y0=0.7)
LAWS = {
    "line": hs.Line(offset=0.2, slope=-2.0),
    "Bouc-Wen": hs.BoucWen(feedthrough=0.3, gain=-0.7, z0=0.2),
    "Bouc-Wen, any exponent": hs.BoucWen(n=1.5, z0=-0.1),
    "Dahl": hs.Dahl(),
    "Duhem": DUHEM,
    "generalised": hs.GeneralizedBoucWen(b4=0.1, n=1.3, z0=0.1),
    "Baber-Noori": hs.BoucWenBaberNoori(delta_nu=0.2, delta_eta=0.1),
    "plays": hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(1.0, 2.0), z0=0.1),
    "relays": hs.Preisach(levels=(-1.0, 0.0, 1.0), weights=(1.0, 0.5, 1.0), z0=(0.7, -0.2)),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_law_is_its_response_to_the_bit(law):
    u = walk()
    assert stepped(law, u).tolist() == law.response(u).tolist()


@pytest.mark.parametrize(
    "model",
    [DUHEM + LAWS["relays"] + LAWS["Bouc-Wen"], LAWS["line"] >> (DUHEM + LAWS["Bouc-Wen, any exponent"])],
    ids=["sum", "sum in a cascade"],
)
def test_sums_and_cascades_start_all_their_laws(model):
    for u in (walk(1), walk(1)[:1]):
        assert stepped(model, u).tolist() == model.response(u).tolist()


def test_a_law_of_the_users_own_may_say_how_it_starts():
    @checked
    class Since(hs.Law):
        """Distance from the first input."""

        gain: float = 2.0
        initial = ()
        workspace = 1

        @staticmethod
        def step(parameters, state, u):
            state[0] = u
            return parameters[0] * (u - state[1])

        @staticmethod
        def start(parameters, state, u0):
            state[0] = state[1] = u0

    u = walk()
    assert Since().response(u).tolist() == (2.0 * (u - u[0])).tolist()
    assert stepped(Since() + hs.Line(slope=1.0), u).tolist() == (2.0 * (u - u[0]) + u).tolist()


# ---------------------------------------------------------------------------------- plants

LAW = hs.BoucWen(feedthrough=0.8, gain=-0.3, offset=0.1)
CREEP = hs.Creep(time_constants=(0.03, 4.0), weights=(0.05, 0.1))
DELAYS = {"none": 0.0, "whole": 3 * TIME, "part": 0.4 * TIME, "whole and part": 2.3 * TIME}
POLYNOMIALS = {
    "gain": ((3.0,), (2.0,)),
    "lag": ((2.0,), (1.0, 0.5)),
    "mode": ((0.3, 30.0), (1.0, 0.4, 40.0)),
    "proper": ((1.0, 2.0, 3.0), (2.0, 0.5, 4.0)),
    "integrator": ((1.0,), (1.0, 0.3, 0.0)),
    "unstable": ((1.0,), (1.0, -0.3)),
}


@pytest.mark.parametrize("delay", DELAYS.values(), ids=DELAYS)
@pytest.mark.parametrize(("num", "den"), POLYNOMIALS.values(), ids=POLYNOMIALS)
def test_a_transfer_function_is_its_response_to_the_bit(num, den, delay):
    u = walk(2)
    for hold, sample in (("zoh", "start"), ("zoh", "end"), ("foh", "start")):
        plant = hs.TransferFunction(num=num, den=den, delay=delay, hold=hold, sample=sample)
        moving = replace(plant, initial_state=tuple(np.arange(1.0, plant.order + 1)))
        for each in (plant, moving):
            assert stepped(each, u, TIME).tolist() == each.response(u, TIME).tolist()


@pytest.mark.parametrize("delay", DELAYS.values(), ids=DELAYS)
@pytest.mark.parametrize(("hold", "sample"), [("zoh", "start"), ("zoh", "end"), ("foh", "start")])
def test_a_transfer_function_rests_at_any_input(delay, hold, sample):
    for num, den in POLYNOMIALS.values():
        plant = hs.TransferFunction(num=num, den=den, delay=delay, hold=hold, sample=sample)
        if not den[-1]:
            assert_refused(r"it cannot rest at u = 0\.7", plant.compiled, 0.7, sample_time=TIME)
            continue
        u, (step, parameters, state) = 0.7 + walk(3) - walk(3)[0], plant.compiled(0.7, sample_time=TIME)
        y = [step(parameters, state, value) for value in u]
        expected = plant.dc_gain * 0.7 + plant.response(u - 0.7, TIME)
        assert y == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())  # it is linear, to rounding


MODE = hs.TransferFunction(num=(0.3, 30.0), den=(1.0, 0.4, 40.0))
FAST = hs.Amplifier(gain=2.0, offset=0.1, limits=(-3.0, 3.0))
SLOW = hs.Amplifier(gain=2.0, offset=0.1, limits=(-3.0, 3.0), slew_rate=60.0, time_constant=0.4 * TIME)
VIBRATIONS = {
    "none": None,
    "mode": MODE,
    "late": replace(MODE, delay=2.3 * TIME),
    "late end": replace(MODE, delay=2.3 * TIME, sample="end"),
    "jumps": hs.TransferFunction(num=(1.0, 2.0, 3.0), den=(2.0, 0.5, 4.0), delay=2 * TIME),
    "jumps late": hs.TransferFunction(num=(1.0, 2.0, 3.0), den=(2.0, 0.5, 4.0), delay=0.3 * TIME),
    "state space": hs.StateSpace(A=[[-2.0, 1.0], [0.0, -3.0]], B=[1.0, 0.5], C=[3.0, 1.0], D=0.2, delay=0.6 * TIME),
    "modes": hs.Modes(natural_frequencies=(3.0, 20.0), damping_ratios=(0.01, 0.02), gains=(0.9, 0.1)),
}


@pytest.mark.parametrize("amplifier", [None, FAST, SLOW], ids=["no amplifier", "fast", "slow"])
@pytest.mark.parametrize("vibration", VIBRATIONS.values(), ids=VIBRATIONS)
def test_an_actuator_is_its_response(amplifier, vibration):
    u = walk(5)
    for creep in (None, CREEP):
        plant = hs.Actuator(amplifier=amplifier, hysteresis=LAW, creep=creep, vibration=vibration)
        expected = plant.response(u, TIME)
        # the output behind a jump is summed in another order
        assert stepped(plant, u, TIME) == pytest.approx(expected, abs=1e-13 * np.abs(expected).max())
        finer = startable_with(plant, u, substeps=7)
        assert finer == pytest.approx(plant.response(u, TIME, substeps=7), abs=1e-13 * np.abs(expected).max())


def startable_with(plant, u, substeps):
    """Outputs of an actuator by steps of so many sub-steps."""
    step, parameters, state = plant.startable(TIME, substeps=substeps).started(u[0])
    return np.array([step(parameters, state, value) for value in u])


SENSED = hs.Actuator(
    amplifier=SLOW, hysteresis=LAW, creep=CREEP, vibration=VIBRATIONS["late"], sensor=hs.Sensor(delay=1.3 * TIME)
)


@pytest.mark.parametrize("delay", DELAYS.values(), ids=DELAYS)
def test_an_actuator_with_a_sensor_is_what_it_measures(delay):
    u = walk(6)
    for quantum in (0.0, 0.01):
        sensor = hs.Sensor(quantum=quantum, delay=delay)
        for plant in (hs.Actuator(hysteresis=LAW, sensor=sensor), replace(SENSED, sensor=sensor)):
            expected = plant.measured(u, TIME)
            assert stepped(plant, u, TIME) == pytest.approx(expected, abs=1e-13 * np.abs(expected).max())
            noisy = replace(plant, sensor=replace(sensor, noise=0.1))
            assert stepped(noisy, u, TIME).tolist() == stepped(plant, u, TIME).tolist()


@pytest.mark.parametrize(
    "law",
    [
        None,
        LAWS["relays"],
        LAWS["Bouc-Wen, any exponent"],
        DUHEM + LAWS["line"],
        hs.RateDependentPrandtlIshlinskii(thresholds=(0.0, 0.25), weights=(1.0, 1.0), beta=0.01),
    ],
    ids=["none", "relays", "any exponent", "sum", "rate dependent"],
)
def test_an_actuator_starts_its_law(law):
    u, plant = walk(7), hs.Actuator(amplifier=FAST, hysteresis=law, vibration=MODE)
    expected = plant.response(u, TIME)
    assert stepped(plant, u, TIME) == pytest.approx(expected, abs=1e-13 * np.abs(expected).max())
    still = hs.Actuator(amplifier=FAST, hysteresis=law)
    time = TIME if still.dynamic else None
    assert stepped(still, u, time) == pytest.approx(still.response(u, time), abs=1e-13)
    step, parameters, state = plant.compiled(0.4, sample_time=TIME)
    rest = [step(parameters, state, 0.4) for _ in range(30)]
    assert rest == pytest.approx([plant.response([0.4], TIME)[0]] * 30, abs=1e-13)


DYNAMIC = {
    "law and plant": LAW >> MODE,
    "plants in between": LAWS["line"] >> replace(MODE, num=(30.0,), delay=0.3 * TIME) >> DUHEM >> hs.Dashpot(c=0.1),
    "everything": (LAW + hs.Dashpot(c=0.1)) >> (MODE + DUHEM) >> LAWS["relays"],
    "actuator": hs.Cascade(stages=(hs.Actuator(hysteresis=LAW, vibration=MODE), LAWS["plays"])),
    "rate": hs.RateDependentPrandtlIshlinskii(thresholds=(0.0, 0.25), weights=(1.0, 1.0), beta=0.01) + MODE,
}


@pytest.mark.parametrize("model", DYNAMIC.values(), ids=DYNAMIC)
def test_sums_and_cascades_with_plants_are_their_response(model):
    u = walk(8)
    assert stepped(model, u, TIME).tolist() == model.response(u, TIME).tolist()
    assert_refused(r"moves in time.* sample_time", startable, model)


@pytest.mark.parametrize("model", DYNAMIC.values(), ids=DYNAMIC)
def test_sums_and_cascades_with_plants_rest_at_any_input(model):
    step, parameters, state = model.compiled(0.4, sample_time=TIME)
    rest = [step(parameters, state, 0.4) for _ in range(50)]
    assert rest == pytest.approx([rest[0]] * 50, abs=1e-12)  # the mode's rest to rounding
    long = model.response(np.full(4000, 0.4), TIME)[-1]  # the mode decays by exp(-0.2 0.05 4000) = 4e-18
    with_duhem = [DYNAMIC["everything"], DYNAMIC["plants in between"]]  # whose output is y0 at its first input
    assert model in with_duhem or rest[0] == pytest.approx(long, abs=1e-12)
    assert_refused(r"moves in time.* sample_time", model.compiled, 0.4)


def test_a_step_is_cut_and_continued_by_its_state():
    u = walk(9)
    for model in (DYNAMIC["everything"], SENSED):
        step, parameters, state = startable(model, TIME).started(u[0])
        whole = stepped(model, u, TIME)
        head = [step(parameters, state, value) for value in u[:25]]
        kept = state.copy()
        tail = [step(parameters, state, value) for value in u[25:]]
        assert head + tail == whole.tolist()
        assert [step(parameters, kept, value) for value in u[25:]] == tail


@pytest.mark.parametrize("u0", [0.0, -0.0, 5e-324, 1e-300, -1e18, 1e100, 1e300])
def test_a_start_far_away_is_the_response(u0):
    u = np.array([u0, u0, -u0, 0.0, 1.0, u0])
    for model in (LAWS["plays"], LAWS["relays"], DYNAMIC["law and plant"], SENSED):
        time = (TIME,) if needs_time(model) else ()
        with np.errstate(all="ignore"):
            expected = (model.measured if isinstance(model, hs.Actuator) else model.response)(u, *time)
        assert stepped(model, u, *time) == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_a_plant_that_integrates_rests_at_zero_only():
    plant = hs.Actuator(vibration=hs.TransferFunction(num=(1.0,), den=(1.0, 0.0)))
    assert stepped(plant, np.array([0.0, 1.0, 1.0, 1.0]), TIME) == pytest.approx([0.0, 0.0, TIME, 2.0 * TIME])
    assert not np.isfinite(stepped(plant, np.array([1.0, 1.0]), TIME)).any()
    assert_refused("the vibration integrates", plant.compiled, 1.0, sample_time=TIME)


def test_what_has_no_step_says_so():
    with pytest.raises(TypeError, match="a SingleValued cannot be stepped"):
        startable(hs.SingleValued(u=[0.0, 1.0], y=[0.0, 2.0]))
    for plant in (MODE, hs.Dashpot(), hs.Actuator(vibration=MODE)):
        assert_refused("sample_time", startable, plant)
        assert_refused("sample_time must be positive and finite, got -1", startable, plant, -1.0)


def test_stages_without_a_response_are_steps_of_an_actuator():
    u = walk(10)
    for part, actuator in (
        (CREEP, hs.Actuator(creep=CREEP)),
        (SLOW, hs.Actuator(amplifier=SLOW)),
        (VIBRATIONS["state space"], hs.Actuator(vibration=VIBRATIONS["state space"])),
        (VIBRATIONS["modes"], hs.Actuator(vibration=VIBRATIONS["modes"])),
    ):
        assert hs.control.as_actuator(part) == actuator
        expected = actuator.response(u, TIME)
        assert stepped(as_stepwise(part), u, TIME) == pytest.approx(expected, abs=1e-13 * np.abs(expected).max())
        program = program_of(part, TIME)
        assert program.state.tolist() == actuator.startable(TIME).state.tolist()
        assert program.sample_time == TIME
    assert as_stepwise(LAW) is LAW
    assert_refused("plant must be an Actuator", as_stepwise, 3.0, error=TypeError)


def test_a_loop_takes_laws_in_front_of_a_transfer_function():
    plant = hs.Actuator(hysteresis=LAW, vibration=MODE)
    assert hs.control.as_actuator(LAW >> MODE) == plant
    assert hs.control.as_actuator(LAW >> DUHEM >> MODE) == replace(plant, hysteresis=LAW >> DUHEM)
    t = TIME * np.arange(40)
    run, expected = (hs.close_loop(each, hs.PID(ki=0.5), t, np.sin(t), u0=0.3) for each in (LAW >> MODE, plant))
    assert run.y.tolist() == expected.y.tolist()
    assert_refused("law that a loop can step", hs.close_loop, MODE >> MODE, hs.PID(ki=0.5), t, t, error=TypeError)


@pytest.mark.parametrize("model", [*DYNAMIC.values(), MODE, SENSED], ids=[*DYNAMIC, "plant", "sensed"])
def test_every_step_is_translated(model):
    program = program_of(model, TIME)
    assert program.step in program.source
    assert program.start == ("" if model is MODE else "start")  # the input of a plant is zero before its first sample
