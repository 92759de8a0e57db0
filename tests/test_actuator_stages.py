"""Each stage of an actuator alone: its closed form, its literal transcription, and what it refuses."""

import functools
import math

import control
import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from strategies import refused

import hysim as hs

EXACT = 1e-12  # closed forms of numbers of order one, and a few hundred steps
H = 0.1


def amplified(u, amplifier, substeps=1, sample_time=H):
    return hs.Actuator(amplifier=amplifier).response(u, sample_time, substeps=substeps)


def test_a_static_amplifier_limits_its_gain():
    amplifier = hs.Amplifier(gain=2.0, offset=1.0, limits=(0.0, 4.0))
    u = [-3.0, -0.5, 0.25, 1.0, 9.0]
    assert hs.Actuator(amplifier=amplifier).response(u).tolist() == [0.0, 0.0, 1.5, 3.0, 4.0]
    assert not hs.Actuator(amplifier=amplifier).dynamic
    assert amplifier.bandwidth == math.inf
    assert amplifier.full_power_bandwidth(1.0) == math.inf


def test_the_papers_amplifier_has_its_gain_and_two_bandwidths():
    amplifier = hs.Amplifier.non_inverting(
        feedback_resistance=9e3, input_resistance=1e3, slew_rate=0.5e6, output_resistance=50.0, capacitance=2e-6
    )
    assert amplifier.gain == 10.0
    assert amplifier.time_constant == pytest.approx(1e-4, rel=1e-15)
    assert amplifier.bandwidth == pytest.approx(1591.549, abs=1e-3)
    assert amplifier.full_power_bandwidth(5.0) == pytest.approx(15915.494, abs=1e-3)
    assert amplifier.full_power_bandwidth(50.0) == pytest.approx(1591.549, abs=1e-3)


def test_a_voltage_slews_to_its_target_and_stays():
    y = amplified([0.0, 1.0, 1.0, 1.0, -1.0, -1.0], hs.Amplifier(slew_rate=4.0))
    assert y == pytest.approx([0.0, 0.0, 0.4, 0.8, 1.0, 0.6], abs=EXACT)


def test_a_sine_up_to_the_full_power_bandwidth_is_not_slewed():
    amplifier = hs.Amplifier(gain=10.0, slew_rate=0.5e6)
    for factor, slewed in ((0.99, False), (1.2, True)):
        frequency = factor * amplifier.full_power_bandwidth(50.0)
        t = np.arange(4000) / (1000.0 * frequency)
        y = amplified(5.0 * np.sin(2 * np.pi * frequency * t), amplifier, sample_time=t[1])
        late = np.abs(y[1:] - 50.0 * np.sin(2 * np.pi * frequency * t[:-1])).max()
        assert bool(late > 1.0) is slewed


def test_a_capacitance_charges_exponentially():
    y = amplified(np.ones(30) * np.append(0.0, np.ones(29)), hs.Amplifier(time_constant=0.4), substeps=3)
    assert y[1:] == pytest.approx(-np.expm1(-np.arange(29) * H / 0.4), abs=EXACT)


voltages = st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=6)


@given(voltages, st.floats(0.5, 40.0), st.floats(0.01, 1.0), st.integers(1, 5))
@settings(max_examples=20)
def test_slew_and_charge_are_exact_whatever_the_sub_steps(u, slew_rate, time_constant, substeps):
    amplifier = hs.Amplifier(slew_rate=slew_rate, time_constant=time_constant)
    one = amplified(u, amplifier)
    assert amplified(u, amplifier, substeps) == pytest.approx(one, abs=EXACT)
    s, v = u[0], u[0]
    for k, target in enumerate(u[:-1]):
        turn = min(abs(target - s) / slew_rate, H)
        begin, way = s, math.copysign(slew_rate, target - s)
        for start, stop, slope in ((0.0, turn, way), (turn, H, 0.0)):
            if stop > start:
                found = solve_ivp(
                    lambda t, v, s0=begin, r=slope, t0=start: (s0 + r * (t - t0) - v) / time_constant,
                    (start, stop), [v], rtol=1e-9, atol=1e-11,
                )  # fmt: skip
                v, begin = found.y[0, -1], begin + slope * (stop - start)
        s = target if turn < H else begin
        assert one[k + 1] == pytest.approx(v, abs=1e-7)  # ten times the tolerance of the solver


def test_creep_grows_by_its_percentage_in_each_decade_of_the_band():
    creep = hs.Creep.per_decade(1.5)
    t = np.geomspace(1e-3, 1e3, 601)
    law = 1.0 + 0.015 * np.log10(t / 0.1)
    assert np.abs(creep.step_response(t) - law).max() < 0.004 * 0.015  # of a decade's growth; 3 elements a decade
    assert creep.step_response(0.1) == pytest.approx(1.0, abs=1e-14)
    assert len(creep.time_constants) == 19
    assert creep.dc_gain == pytest.approx(1.0 + 4.41 * 0.015, abs=1e-3)  # at rest after the last decade
    assert min(creep.weights) >= 0.0
    assert creep.instant_gain == pytest.approx(0.96133, abs=1e-5)  # frozen


@given(st.floats(-5.0, 20.0), st.integers(1, 5), st.floats(1e-2, 10.0))
def test_a_bank_fits_any_percentage_alike(percent, elements, reference_time):
    bank = hs.Creep.per_decade(percent, (1e-2, 1e2), per_decade_elements=elements, reference_time=reference_time)
    t = np.geomspace(1e-2, 1e2, 101)
    law = 1.0 + percent / 100.0 * np.log10(t / reference_time)
    worst = 0.05 if elements == 1 else 0.01
    assert np.abs(bank.step_response(t) - law).max() <= worst * abs(percent) / 100.0 + 1e-14
    assert len(bank.weights) == 4 * elements + 1


@pytest.mark.parametrize("h", [5e-5, 0.01, 3.0])
def test_creep_alone_is_its_step_response_and_its_exact_update(h):
    creep = hs.Creep.per_decade(10.0)
    actuator = hs.Actuator(creep=creep)
    step = actuator.response(np.append(0.0, np.ones(400)), h)[1:]
    assert step == pytest.approx(creep.step_response(h * np.arange(400)), abs=EXACT)
    u = np.random.default_rng(0).normal(size=200)
    tau, w = np.array(creep.time_constants), np.array(creep.weights)
    q, expected = np.full(tau.size, u[0]), []
    for value in u:
        expected.append(creep.instant_gain * value + w @ q)
        q += -np.expm1(-h / tau) * (value - q)
    assert actuator.response(u, h) == pytest.approx(expected, abs=EXACT)


def test_a_constant_voltage_finds_the_creep_at_its_end():
    creep = hs.Creep.per_decade(5.0)
    y = hs.Actuator(creep=creep).response(np.full(1000, 3.0), 5e-5)
    assert y == pytest.approx(np.full(1000, 3.0 * creep.dc_gain), abs=EXACT)


def test_modes_side_by_side_are_their_sum():
    u = np.random.default_rng(1).normal(size=150)
    rows = [(3.0, 0.02, 0.8), (11.0, 0.3, -0.1), (5.0, 1.4, 0.5)]
    single = [hs.mode(*row, delay=0.04) for row in rows]
    frequencies, ratios, gains = zip(*rows, strict=True)
    pair = hs.Modes(natural_frequencies=frequencies, damping_ratios=ratios, gains=gains, delay=0.04)
    total = sum(hs.Actuator(vibration=mode).response(u, H) for mode in single)
    assert hs.Actuator(vibration=pair).response(u, H) == pytest.approx(total, abs=EXACT)
    poles = np.concatenate([mode.poles for mode in single])
    assert sorted(pair.poles, key=abs) == pytest.approx(sorted(poles, key=abs), abs=EXACT)
    assert pair.dc_gain == pytest.approx(sum(mode.dc_gain for mode in single), abs=EXACT)


FOREIGN = [
    control.tf([0.3, 1.0], [1.0, 0.4, 2.0]),
    control.ss(control.tf([1.0, 0.3, 1.0], [1.0, 0.4, 2.0])),
    control.tf([2.0], [4.0]),
    control.ss([], [], [], [[0.7]]),
    scipy.signal.TransferFunction([1.0], [1.0, 0.5]),
    scipy.signal.StateSpace([[-1.0, 3.0], [-3.0, -1.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.2]]),
]


@pytest.mark.parametrize("system", FOREIGN, ids=lambda system: type(system).__name__)
def test_a_system_of_another_package_is_a_vibration(system):
    actuator = hs.Actuator(vibration=system)
    u = np.append(0.0, np.random.default_rng(2).normal(size=60))
    by_matrices = hasattr(system, "A")
    plant = control.ss(system.A, system.B, system.C, system.D) if by_matrices else control.tf(system.num, system.den)
    held = control.sample_system(plant, H)
    expected = control.forced_response(held, H * np.arange(61), u).outputs
    assert actuator.response(u, H) == pytest.approx(expected, abs=1e-10)  # a transfer function loses digits there
    assert hs.close_loop(system, hs.PID(), [0.0, 1.0], [0.0, 0.0]).conditions["plant"] == actuator


def test_any_coordinates_of_a_state_space_respond_alike():
    plain = hs.Modes(natural_frequencies=(3000.0, 9000.0), damping_ratios=(0.01, 0.02), gains=(1.0, 0.2))
    A, B, C = plain.state_space.A, plain.state_space.B, plain.state_space.C
    units = np.array([1.0, 1e6, 1e-3, 1e4])
    scaled = hs.StateSpace(A=A * units / units[:, np.newaxis], B=B / units, C=C * units)
    u = np.sin(np.arange(300.0))
    expected = hs.Actuator(vibration=plain).response(u, 1e-4)
    assert hs.Actuator(vibration=scaled).response(u, 1e-4) == pytest.approx(expected, abs=1e-11)  # of peaks of ten
    assert scaled.dc_gain == pytest.approx(1.2, rel=EXACT)
    assert hs.StateSpace(A=[[0.0]], B=[1.0], C=[1.0]).dc_gain == math.inf


def test_readings_are_steps_of_noisy_displacements():
    y = np.linspace(-1.0, 1.0, 500)
    sensor = hs.Sensor(quantum=0.3, noise=0.1, seed=7)
    noise = 0.1 * np.random.default_rng(7).standard_normal(500)
    assert np.array_equal(sensor.measure(y), 0.3 * np.floor((y + noise) / 0.3 + 0.5))
    assert np.array_equal(sensor.noise_samples(20), noise[:20])
    assert np.array_equal(hs.Sensor().measure(y), y)


non_inverting = functools.partial(hs.Amplifier.non_inverting, feedback_resistance=1.0)


def one_mode(**changed):
    return hs.Modes(**{"natural_frequencies": (1.0,), "damping_ratios": (0.1,), "gains": (1.0,), **changed})


test_wrong_arguments_are_named = refused(
    (lambda: hs.Amplifier(limits=(1.0, 0.0)), r"limits must be \(lowest, highest\)"),
    (lambda: hs.Amplifier(slew_rate=0.0), "slew_rate must be positive"),
    (lambda: hs.Amplifier(time_constant=-1.0), "time_constant must not be negative"),
    (lambda: hs.Amplifier().full_power_bandwidth(0.0), "amplitude must be positive"),
    (lambda: non_inverting(input_resistance=0.0), "input_resistance must be positive"),
    (lambda: non_inverting(input_resistance=1.0, capacitance=-1.0), "capacitance must not be negative"),
    (lambda: hs.Creep(time_constants=(1.0,), weights=()), "equally long, got 1 and 0"),
    (lambda: hs.Creep(time_constants=(0.0,), weights=(1.0,)), "time_constants must be positive"),
    (lambda: hs.Creep.per_decade(1.0, (1.0, 0.1)), "band must rise"),
    (lambda: hs.Creep.per_decade(1.0, reference_time=0.0), "reference_time must be positive"),
    (lambda: hs.Creep.per_decade(1.0, per_decade_elements=0), "per_decade_elements must be"),
    (lambda: hs.mode(0.0, 0.1), "natural_frequency must be positive"),
    (lambda: hs.mode(1.0, -0.1), "damping_ratio must not be negative"),
    (lambda: one_mode(natural_frequencies=(1.0, 2.0), gains=(1.0, 1.0)), "equally long"),
    (lambda: one_mode(natural_frequencies=(-1.0,)), "natural_frequencies must be positive"),
    (lambda: one_mode(damping_ratios=(-0.1,)), "damping_ratios must not be negative"),
    (lambda: one_mode(delay=-1.0), "delay must not be negative"),
    (lambda: hs.StateSpace(A=[[1.0]], B=[1.0, 2.0], C=[1.0]), "A, B and C must have the shapes"),
    (lambda: hs.StateSpace(A=[[1.0]], B=[1.0], C=[1.0], delay=-1.0), "delay must not be negative"),
    (lambda: hs.Sensor(noise=-1.0), "noise must not be negative"),
    (lambda: hs.Sensor(seed=-1), "seed must not be negative"),
    (lambda: hs.Sensor(seed=0.5), TypeError, "seed must be a whole number"),
    (lambda: hs.Actuator(vibration=control.tf([1.0], [1.0, 0.5], 0.1)), "continuous time, got .* dt = 0.1"),
    (lambda: hs.Actuator(vibration=control.ss(np.eye(2), np.eye(2), np.eye(2), 0.0)), "one input and one"),
    (
        lambda: hs.Actuator(vibration=control.tf([[[1.0], [2.0]]], [[[1.0, 1.0], [1.0, 2.0]]])),
        "one input and one output, got a matrix",
    ),
    (lambda: hs.Actuator(creep=hs.Creep.per_decade(1.0)).response([0.0, 1.0]), "needs sample_time"),
    (
        lambda: hs.Actuator(amplifier=hs.Amplifier(slew_rate=1.0)).response([0.0], 0.1, substeps=0),
        "substeps must be an integer of at least 1, got 0",
    ),
    (lambda: hs.Actuator().advance([], sample_time=0.1), "u must hold a sample"),
)


HALVES = [-2.5, -1.5, -0.5, 0.5, 1.5, 2.5]


def test_a_displacement_halfway_between_two_readings_gives_the_upper_one():
    """The quantum is a power of two: halves of it are exact, and no rounding decides."""
    y = 0.25 * np.array(HALVES)
    upper = 0.25 * np.array([-2.0, -1.0, 0.0, 1.0, 2.0, 3.0])
    assert hs.Sensor(quantum=0.25).measure(y).tolist() == upper.tolist()
    assert hs.Sensor(quantum=0.25).measure(y - 1e-12).tolist() == (upper - 0.25).tolist()


@pytest.mark.parametrize("half", HALVES)
def test_the_loop_reads_the_same_steps_as_the_sensor(half):
    plant = hs.Actuator(hysteresis=hs.Line(slope=1.0), sensor=hs.Sensor(quantum=0.25))
    for u0 in (0.25 * half, 0.25 * half - 1e-12, 0.25 * half + 0.1):
        run = hs.close_loop(plant, hs.PID(kp=0.5), np.arange(4.0), np.zeros(4), u0=u0)
        assert run.y[0] == u0
        assert run.measurement[0] == hs.Sensor(quantum=0.25).measure([u0])[0]
        assert np.array_equal(run.measurement, plant.sensor.measure(run.y))
