"""The whole chain: exact where the voltage is held, second order behind an amplifier that takes time."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from strategies import COMPILED, Passes

import hysim as hs

FINEST, ROUGH = (2048, 0.02) if COMPILED else (64, 0.1)  # sub-steps of the reference, and what it leaves of the order
EXACT = 1e-12  # expm against expm, and a few hundred steps of signals of order one
H = 5e-5  # of a controller at 20 kHz [s]
# hs.identify(hs.BoucWen, hs.datasets.table1(dwell=1.0)).model, voltage in V, displacement in um
TABLE1 = hs.BoucWen(
    A=1.0, beta=-0.007000839745153635, gamma=0.06754989560329633, n=0.5, feedthrough=0.003921307747310447,
    gain=0.025441742014318747, offset=0.7667982220779459, z0=-31.463495592150412,
)  # fmt: skip
MODE = hs.mode(2.0 * np.pi * 500.0, 0.01)
CREEP = hs.Creep.per_decade(1.5)
REFERENCE_CASE = hs.Actuator(
    amplifier=hs.Amplifier(limits=(0.0, 150.0)),
    hysteresis=TABLE1,
    creep=CREEP,
    vibration=MODE,
    sensor=hs.Sensor(noise=1e-3, delay=H),
)
SLOW = hs.Amplifier(gain=15.0, offset=3.0, limits=(0.0, 150.0), slew_rate=4e5, time_constant=4e-5)
PROPER = hs.StateSpace(A=[[0.0, 3000.0], [-3000.0, -90.0]], B=[20.0, 3000.0], C=[0.9, 0.02], D=0.1)
INTEGRAL = hs.PID(ki=1000.0, limits=(0.0, 150.0))


def commands(n, seed=0, scale=60.0):
    """Levels that jump now and then, beside a sine."""
    levels = np.random.default_rng(seed).uniform(0.0, scale, n // 15 + 1)
    return np.repeat(levels, 15)[:n] + 0.2 * scale * np.sin(0.1 * np.arange(n))


def continuous(creep, vibration):
    """Creep and vibration as one continuous system, in the states in which they are written."""
    if isinstance(vibration, hs.TransferFunction):
        (b,), (_, c, k) = vibration.num, vibration.den
        A, B, C, D = np.array([[0.0, 1.0], [-k, -c]]), np.array([0.0, b]), np.array([1.0, 0.0]), 0.0
    else:
        A, B, C, D = vibration.A, vibration.B, vibration.C, vibration.D
    rates, w = 1.0 / np.array(creep.time_constants), np.array(creep.weights)
    n, m = rates.size, B.size
    F = np.zeros((n + m, n + m))
    F[:n, :n], F[n:, :n], F[n:, n:] = -np.diag(rates), np.outer(B, w), A
    g, c = np.append(rates, B * creep.instant_gain), np.append(D * w, C)
    return F, g, c, D * creep.instant_gain


def literal_response(system, w, delay, h, times):
    """Outputs at `times`, just before any jump, of a system at rest whose input holds w[k] from k h + delay on."""
    F, g, c, D = system
    x, value, now, k, y = -np.linalg.solve(F, g) * w[0], w[0], 0.0, 0, []
    for time in times:
        while k < w.size and k * h + delay < time - 1e-9 * h:
            x, now = moved(F, g, x, value, k * h + delay - now), k * h + delay
            value, k = w[k], k + 1
        x, now = moved(F, g, x, value, time - now), time
        y.append(c @ x + D * value)
    return np.array(y)


def moved(F, g, x, value, span):
    """x after a held input, by one exponential."""
    n = g.size
    generator = np.zeros((n + 1, n + 1))
    generator[:n, :n], generator[:n, n] = F * span, g * span
    transition = expm(generator)
    return transition[:n, :n] @ x + transition[:n, n] * value


@pytest.mark.parametrize("delay", [0.0, 0.3 * H, H, 2.6 * H])
@pytest.mark.parametrize("vibration", [MODE, PROPER], ids=["mode", "proper"])
def test_creep_and_vibration_together_are_exact_under_the_hold(vibration, delay):
    late = replace(vibration, delay=delay)
    u = commands(40)
    w = TABLE1.response(u)
    plant = hs.control.close_loop(
        hs.Actuator(hysteresis=TABLE1, creep=CREEP, vibration=late), Passes(), H * np.arange(40), u, u0=u[0]
    )
    expected = literal_response(continuous(CREEP, vibration), w, delay, H, H * np.arange(40))
    assert plant.y == pytest.approx(expected, abs=EXACT)


@pytest.mark.parametrize("delay", [0.0, 0.25 * H, 0.5 * H, H, 1.75 * H, 3.0 * H])
@pytest.mark.parametrize("dead_time", [0.0, 0.5 * H])
@pytest.mark.parametrize("amplifier", [None, SLOW], ids=["held", "slow"])
def test_the_sensor_sees_the_displacement_of_its_delay_ago(amplifier, dead_time, delay):
    plant = hs.Actuator(
        amplifier=amplifier, hysteresis=TABLE1, creep=CREEP, vibration=replace(PROPER, delay=dead_time),
        sensor=hs.Sensor(delay=delay),
    )  # fmt: skip
    u = np.append(1.0, commands(60, scale=8.0 if amplifier else 60.0))
    run = hs.close_loop(plant, Passes(), H * np.arange(61), u, u0=u[0], substeps=8)
    # four times the samples: each is then a delay of whole ones; half a sample late is read before the voltage jumps
    fine = hs.close_loop(
        replace(plant, sensor=None), Passes(), H / 4 * np.arange(244), np.repeat(u, 4), u0=u[0], substeps=2
    )
    padded = np.append(np.full(round(4 * delay / H), fine.y[0]), fine.y)[: fine.y.size]
    assert run.measurement == pytest.approx(padded[::4], abs=EXACT)
    assert run.y == pytest.approx(fine.y[::4], abs=EXACT)


def test_what_is_measured_in_open_loop_is_the_late_response():
    plant = replace(REFERENCE_CASE, sensor=hs.Sensor(quantum=0.01, noise=2e-3, delay=2 * H, seed=5))
    u = commands(100)
    y = plant.response(u, H)
    seen = np.append(np.full(2, y[0]), y)[:100]
    # a step of the quantum where rounding decides: none of these is that near
    assert plant.measured(u, H) == pytest.approx(plant.sensor.measure(seen), abs=EXACT)
    assert np.array_equal(replace(plant, sensor=None).measured(u, H), y)
    law = hs.Actuator(hysteresis=TABLE1, sensor=hs.Sensor(quantum=0.5))
    assert np.array_equal(law.measured(u), law.sensor.measure(TABLE1.response(u)))


AMPLIFIERS = [
    hs.Amplifier(time_constant=3e-5),
    hs.Amplifier(slew_rate=3e5),
    hs.Amplifier(slew_rate=3e5, time_constant=3e-5, limits=(5.0, 55.0)),
]


@pytest.mark.parametrize("dead_time", [0.0, 0.3 * H])
@pytest.mark.parametrize("amplifier", AMPLIFIERS, ids=["charge", "slew", "both"])
def test_behind_a_slow_amplifier_the_chain_is_second_order_in_the_sub_step(amplifier, dead_time):
    plant = hs.Actuator(amplifier=amplifier, hysteresis=TABLE1, creep=CREEP, vibration=replace(MODE, delay=dead_time))
    u = commands(120)
    finest, counts = plant.response(u, H, substeps=FINEST), 4 * 2 ** np.arange(6 if COMPILED else 3)
    errors = [np.sqrt(np.mean((plant.response(u, H, substeps=int(count)) - finest) ** 2)) for count in counts]
    if amplifier.slew_rate is None:
        assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(np.full(counts.size - 1, 2.0), abs=ROUGH)
    # where a ramp ends within its sub-step scatters single errors, below a bound of second order
    assert (errors <= 0.06 / counts**2).all()
    assert errors[0] > 0.1 * counts[-1] ** 2 / counts[0] ** 2 * errors[-1]


def test_an_amplifier_too_fast_to_see_is_a_static_one():
    fast = hs.Amplifier(gain=15.0, limits=(0.0, 150.0), slew_rate=1e13, time_constant=1e-13)
    static = replace(fast, slew_rate=None, time_constant=0.0)
    u = commands(100, scale=5.0)
    slow, held = (
        hs.Actuator(amplifier=amplifier, hysteresis=TABLE1, creep=CREEP, vibration=MODE).response(u, H)
        for amplifier in (fast, static)
    )
    # the law's output is then linear along the first of 64 sub-steps, as if it came half of one late
    assert slow == pytest.approx(held, abs=np.ptp(held) * 0.5 / 64 * 2 * np.pi * 500 * H * 2)


WHOLE = replace(
    REFERENCE_CASE,
    amplifier=SLOW,
    vibration=replace(PROPER, delay=1.3 * H),
    sensor=hs.Sensor(quantum=1e-3, noise=1e-3, delay=1.6 * H, seed=2),
)


@given(st.lists(st.integers(0, 40), max_size=4), st.sampled_from([WHOLE, REFERENCE_CASE]), st.integers(1, 3))
@settings(max_examples=15 if COMPILED else 2)
def test_cut_and_continue_gives_the_same_bits(pieces, plant, substeps):
    u, state, parts = commands(60, scale=8.0), None, []
    for piece in np.split(u, np.minimum(np.cumsum([1, *pieces]), 60)):
        y, state = plant.advance(piece, state, sample_time=H, substeps=substeps)
        parts.append(y)
    assert np.array_equal(np.concatenate(parts), plant.response(u, H, substeps=substeps))
    assert state.samples == 60


def test_an_output_at_the_end_of_the_hold_is_the_next_ones_begin():
    ends = replace(REFERENCE_CASE, vibration=replace(MODE, sample="end"))
    u = commands(50)
    y, state = ends.advance(u[:20], sample_time=H)
    assert np.array_equal(np.append(y, ends.advance(u[20:], state, sample_time=H)[0]), ends.response(u, H))
    assert np.array_equal(ends.response(u, H)[:-1], REFERENCE_CASE.response(u, H)[1:])


@pytest.mark.parametrize("chunk", [1, 7])
@pytest.mark.parametrize("plant", [WHOLE, REFERENCE_CASE], ids=["slow", "held"])
def test_a_loop_in_chunks_gives_the_same_bits(monkeypatch, plant, chunk):
    t, r = H * np.arange(60), np.linspace(0.0, 0.5, 60)
    whole = hs.close_loop(plant, INTEGRAL, t, r)
    monkeypatch.setattr("hysim._basics.parallel._STRETCH", chunk)
    assert hs.close_loop(plant, INTEGRAL, t, r) == whole


def literal_amplifier(amplifier, voltages, target, span):
    """s slews and v charges, in a thousand small steps, each exact for a constant s."""
    s, v = voltages
    step = span / 1000
    for _ in range(1000):
        before = s
        s += min(max(target - s, -amplifier.slew_rate * step), amplifier.slew_rate * step)
        v += (0.5 * (before + s) - v) * -np.expm1(-step / amplifier.time_constant)
    return s, v


def test_a_loop_around_the_whole_chain_is_its_literal_transcription():
    n, substeps = 25, 5
    plant = replace(WHOLE, vibration=replace(PROPER, delay=0.0), sensor=replace(WHOLE.sensor, delay=H))
    r = np.repeat([0.2, 1.0, 0.6, 1.5, 0.1], 5)
    pid = hs.PID(kp=1.0, ki=2000.0, limits=(-0.1, 10.0))
    run = hs.close_loop(plant, pid, H * np.arange(n), r, u0=0.2, substeps=substeps)
    F, g, c, D = continuous(CREEP, PROPER)
    m = g.size
    ramp = np.zeros((m + 2, m + 2))  # of the input from its begin to its end
    ramp[:m, :m], ramp[:m, m], ramp[m, m + 1] = F * H / substeps, g * H / substeps, 1.0
    ramp = expm(ramp)
    noise = 1e-3 * np.random.default_rng(2).standard_normal(n)
    voltages = (6.0, 6.0)  # 15 0.2 + 3
    level, state = TABLE1.advance([6.0])
    level = level[0]
    x, integral = -np.linalg.solve(F, g) * level, None
    truth, u = [], []
    for k in range(n):
        truth.append(c @ x + D * level)
        measurement = 1e-3 * np.floor((truth[max(k - 1, 0)] + noise[k]) / 1e-3 + 0.5)
        integral = 0.2 if integral is None else integral
        command = 1.0 * (r[k] - measurement) + integral
        if k == 0:
            start = run.command[0] - (r[0] - measurement)
            assert start == pytest.approx(0.2, abs=EXACT)
        drive = min(max(command, -0.1), 10.0)
        integral += 2000.0 * H * (r[k] - measurement) + H / max(H, 1.0 / 2000.0) * (drive - command)
        u.append(voltages[1])
        for _ in range(substeps):
            voltages = literal_amplifier(SLOW, voltages, min(max(15.0 * drive + 3.0, 0.0), 150.0), H / substeps)
            (following,), state = TABLE1.advance([voltages[1]], state)
            x = ramp[:m, :m] @ x + ramp[:m, m] * level + ramp[:m, m + 1] * (following - level)
            level = following
    # the literal amplifier's steps are second order, 1e-6 of a tenth of its range in each; a reading that lies that
    # near a step of the quantum would show here as 1e-3
    assert run.u == pytest.approx(u, abs=1e-4)
    assert run.y == pytest.approx(truth, abs=1e-5)
    assert np.ptp(run.y) > 0.5


def test_the_reference_case_runs_and_says_under_what():
    t = H * np.arange(4000)
    r = 0.1 + 2.4 * np.abs(2.0 * np.mod(5.0 * t - 0.5, 1.0) - 1.0)[::-1]
    run = hs.close_loop(REFERENCE_CASE, INTEGRAL, t, r)
    said = run.conditions
    assert (said["delay"], said["noise"], said["seed"], said["sensor_quantum"]) == (H, 1e-3, 0, 0.0)
    assert (said["limits"], said["amplifier_limits"]) == ((0.0, 150.0), (0.0, 150.0))
    assert said["plant"] is REFERENCE_CASE
    assert np.array_equal(run.u, np.clip(run.drive, 0.0, 150.0))
    assert np.array_equal(run.error, r - run.measurement)
    late = np.append(run.y[0], run.y)[:-1]
    assert np.array_equal(run.measurement, late + REFERENCE_CASE.sensor.noise_samples(4000))
    quiet = hs.close_loop(replace(REFERENCE_CASE, sensor=hs.Sensor(delay=H)), INTEGRAL, t, r)
    assert said["voltage_noise_rms"] == pytest.approx(np.sqrt(np.mean((run.u - quiet.u) ** 2)), rel=EXACT)
    assert said["voltage_noise_peak"] == np.abs(run.u - quiet.u).max()
    assert quiet.conditions["voltage_noise_rms"] == 0.0
    assert hs.close_loop(REFERENCE_CASE, INTEGRAL, t, r) == run  # the same seed, the same bits
    assert run.z == pytest.approx(TABLE1.memory(np.append(0.0, run.u))[:-1], abs=EXACT)
    # frozen: of a law, creep, mode, delay and noise that nobody has touched
    assert run.y[[1000, 2000, 3999]] == pytest.approx(FROZEN, abs=1e-9)


FROZEN = [0.4972962972396909, 1.5665767748158175, 0.9550882540405073]


def test_the_open_loop_of_the_commands_is_the_loops_displacement():
    for plant in (REFERENCE_CASE, WHOLE):
        t, r = H * np.arange(300), np.linspace(0.0, 1.0, 300)
        run = hs.close_loop(plant, replace(INTEGRAL, limits=(0.0, 9.0)), t, r)
        u = np.append(0.0, run.drive)
        found = plant.signals(u, H)
        before = slice(0, -1) if plant is REFERENCE_CASE else slice(1, None)
        assert np.array_equal(plant.voltage(u)[1:] if plant is REFERENCE_CASE else run.u, run.u)
        late = replace(plant, vibration=replace(MODE, sample="end")) if plant is REFERENCE_CASE else plant
        assert late.response(u, H)[before] == pytest.approx(run.y, abs=EXACT)
        assert found["z"][before] == pytest.approx(run.z, abs=EXACT)


def test_signals_are_named_after_the_stages():
    u = commands(60, scale=8.0)
    sim = hs.simulate(WHOLE, H * np.arange(60), u)
    assert set(sim.signals) == {"t", "u", "z", "y", "creep", "hysteresis", "amplifier", "measurement"}
    assert sim.y == pytest.approx(WHOLE.response(u, H), abs=EXACT)  # the mean step of the times is rounded
    assert sim.signals["amplifier"] == pytest.approx(hs.Actuator(amplifier=SLOW).response(u, H), rel=EXACT)
    assert sim.z == pytest.approx(WHOLE.memory(u, H), abs=EXACT)
    held = hs.simulate(REFERENCE_CASE, H * np.arange(60), u)
    assert np.array_equal(held.signals["hysteresis"], TABLE1.response(np.maximum(u, 0.0)))
    assert np.array_equal(held.z, TABLE1.memory(np.maximum(u, 0.0)))
    static = hs.simulate(hs.Actuator(amplifier=hs.Amplifier(gain=2.0), hysteresis=TABLE1), None, u)
    assert set(static.signals) == {"u", "z", "y", "hysteresis", "amplifier"}
    assert np.array_equal(static.y, TABLE1.response(2.0 * u))


def test_an_amplifier_of_no_width_or_a_huge_command_gives_no_nan():
    for limits in ((30.0, 30.0), (0.0, 150.0)):
        for amplifier in (hs.Amplifier(limits=limits), replace(SLOW, limits=limits)):
            plant = replace(REFERENCE_CASE, amplifier=amplifier)
            run = hs.close_loop(plant, hs.PID(kp=1e200), H * np.arange(100), np.full(100, 1.0))
            for signal in (run.u, run.y, run.z, run.measurement):
                assert np.isfinite(signal).all()
            assert limits[0] <= run.u.min()
            assert run.u.max() <= limits[1]


def test_an_unstable_loop_ends_at_the_time_it_happened():
    plant = replace(REFERENCE_CASE, amplifier=None)
    with pytest.raises(hs.SimulationError, match=r"at t = 0\.\d+: it is unstable"):
        hs.close_loop(plant, hs.PID(ki=1e6), H * np.arange(200_000), np.ones(200_000))
    with pytest.raises(hs.SimulationError, match="actuator leaves the finite numbers at sample"):
        hs.Actuator(vibration=hs.StateSpace(A=[[1e5]], B=[1.0], C=[1.0])).response(np.arange(10_000.0), H)


def test_the_linear_chain_of_python_control_is_the_chain_with_a_line():
    amplifier = hs.Amplifier(gain=15.0, time_constant=4e-5)
    plant = hs.Actuator(amplifier=amplifier, creep=CREEP, vibration=PROPER, sensor=hs.Sensor(delay=1.6 * H))
    u = np.append(0.0, commands(100, scale=5.0))
    system = hs.to_control(plant, H)
    y = np.asarray(control.forced_response(system, H * np.arange(101), u).outputs)
    run = hs.close_loop(plant, Passes(), H * np.arange(101), u, substeps=400)
    assert run.measurement == pytest.approx(y, abs=1e-5 * np.ptp(y))  # second order in 400 sub-steps
    s = 1j * np.array([1.0, 300.0, 3000.0])
    still = hs.to_control(replace(plant, sensor=None))
    expected = 15.0 / (4e-5 * s + 1.0) * through(CREEP.state_space, s) * through(PROPER, s)
    assert still(s) == pytest.approx(expected, rel=1e-9)


def through(system, s):
    """Its transfer function."""
    identity = np.eye(system.B.size)
    return np.array([system.C @ np.linalg.solve(value * identity - system.A, system.B) + system.D for value in s])
