"""The compiled loop has the bits of the same equations in plain Python, and the leanest step those of its family."""

import math

import numpy as np
import pytest

import hysim as hs
from hysim.control._loop import RestingPlant
from hysim.kernels.stepping import drive
from hysim.models.compiled_step import compiled_start, compiled_step

H = 5e-5  # s
LAW = hs.BoucWen(feedthrough=0.02, gain=-0.004, beta=0.05, gamma=0.03)
PLAYS = hs.PrandtlIshlinskii(thresholds=(0.0, 2.0, 20.0), weights=(0.01, 0.003, 0.006), offset=0.1)
CREEP = hs.Creep(time_constants=(1e-3, 0.1), weights=(0.05, 0.1))
MODE = hs.mode(2.0 * math.pi * 500.0, 0.02)
LATE_MODES = hs.Modes(natural_frequencies=(3e3, 9e3), damping_ratios=(0.05, 0.05), gains=(0.9, 0.1), delay=2.3 * H)
SLEWING = hs.Amplifier(gain=10.0, offset=5.0, limits=(0.0, 60.0), slew_rate=2e5)
PLANTS = {
    "law": hs.Actuator(hysteresis=LAW),
    "creep": hs.Actuator(hysteresis=PLAYS, creep=CREEP, sensor=hs.Sensor(delay=H)),
    "mode": hs.Actuator(amplifier=hs.Amplifier(gain=10.0, limits=(0.0, 50.0)), vibration=MODE),
    "all": hs.Actuator(
        amplifier=SLEWING, hysteresis=LAW, creep=CREEP, vibration=LATE_MODES,
        sensor=hs.Sensor(delay=1.4 * H, noise=1e-3, quantum=1e-3, seed=3),
    ),
}  # fmt: skip
CONTROLLERS = {
    "PID": hs.PID(kp=0.1, ki=100.0, kd=1e-5, derivative_filter=1e-3, limits=(-1.0, 8.0)),
    "tracking": hs.TrackingController(feedforward=hs.InverseFeedforward(law=PLAYS), feedback=hs.PID(ki=50.0)),
}


def plain_loop(plant, controller, reference, u0):
    """The equations of `hysim.kernels.loop` on lists, with the amplifier that slews and has no time constant."""
    rest = RestingPlant(plant, H, u0)
    chain, start = rest.chain, rest.state
    stage, law, amplifier = chain.stage, start.law, chain.amplifier
    step, parameters, memory = controller.compiled(H, u0, rest.y0)
    decline, A, B = stage.decline.tolist(), stage.A.tolist(), stage.B.tolist()
    at_samples, within = chain.outputs.tolist()
    voltage, x = float(start.voltages[0]), start.x[: len(B[0])].tolist()
    past, waiting, seen = start.past.tolist(), start.readings[1:-1].tolist(), float(start.readings[-1])
    reach = chain.step * math.inf if amplifier.slew_rate is None else amplifier.slew_rate * chain.step
    lowest, highest = amplifier.limits or (-math.inf, math.inf)

    def output(row, newer, older, oldest):
        total = row[0] * newer + row[1] * older + row[2] * oldest
        for weight, each in zip(row[3:], x, strict=True):
            total += weight * each
        return total

    out = {name: [] for name in ("command", "drive", "v", "w", "y", "measurement")}
    for r, noise in zip(reference, chain.sensor.noise_samples(len(reference)), strict=True):
        y = output(at_samples, 0.0, past[2], past[1])
        waiting.append(y if chain.seen_in < 0 else seen)
        reading = waiting.pop(0) + noise
        if chain.sensor.quantum:
            reading = chain.sensor.quantum * math.floor(reading / chain.sensor.quantum + 0.5)
        drive = step(parameters, memory, r, reading)
        target = min(max(amplifier.gain * drive + amplifier.offset, lowest), highest)
        for sub in range(chain.substeps):
            distance = target - voltage
            voltage = voltage + math.copysign(reach, distance) if abs(distance) > reach else target
            past = [*past[1:], law.step(law.parameters, law.state, voltage)]
            oldest, older, newer = past[:3]
            if sub == chain.seen_in:
                seen = output(within, newer, older, oldest)
            following = [B[1][i] * older + B[0][i] * newer + B[2][i] * oldest for i in range(len(x))]
            for i in range(len(x)):
                if i < len(decline):
                    following[i] = x[i] + (decline[i] * x[i] + following[i])
                else:
                    for weight, each in zip(A[i - len(decline)], x, strict=True):
                        following[i] += weight * each
            x = following
            out["v"].append(voltage)
            out["w"].append(past[-1])
        for name, value in {"command": memory[0], "drive": drive, "y": y, "measurement": reading}.items():
            out[name].append(value)
    return out


@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_the_compiled_loop_has_the_bits_of_the_plain_one(plant, controller):
    reference = np.repeat([0.5, 1.2, 9.0, 0.9], 15) + 0.1 * np.sin(np.arange(60))
    signals = RestingPlant(plant, H, 3.0).run(controller, reference)
    assert signals.lost == -1
    for name, values in plain_loop(plant, controller, reference, 3.0).items():
        assert np.array_equal(getattr(signals, name), values), name


# ------------------------------------------------------------------ the leanest step of a law, in fewer places of state


U = np.concatenate([2.0 * np.sin(np.linspace(0.0, 12.0, 120)), np.random.default_rng(5).normal(size=80), [0.0, 3.0]])
PLACES = {
    hs.BoucWen(beta=0.5, gamma=0.2): 2,
    hs.BoucWen(n=2.0): 2,
    hs.BoucWen(n=1.5): 4998,
    hs.PolynomialBoucWen(n=1.0, z0=0.1): 2,
    hs.GeneralizedBoucWen(n=1.0, b2=0.1, b4=-0.1, b6=0.2): 2,
    hs.GeneralizedBoucWen(n=2.0, b3=0.1, b5=-0.1): 2,
    hs.GeneralizedBoucWen(n=1.5, b3=0.1): 5024,
    hs.ZhuWangBoucWen(n=1.0, delta=0.1): 21,
    hs.ZhuWangBoucWen(n=1.5, delta=0.1): 21,
    hs.BoucWenBaberNoori(n=1.0): 38,
    hs.BoucWenBaberNoori(n=1.5, delta_nu=0.1): 38,
    hs.BoucWenBaberNoori(n=1.5): 38,
    hs.Dahl(): 2,
    hs.JilesAtherton(): 4,
    hs.ColemanHodgdon(): 2,
    hs.Play(): 2,
    hs.Line(): 1,
}


@pytest.mark.parametrize("law", PLACES, ids=lambda law: f"{type(law).__name__} {law.scalars.get('n', '')}".strip())
def test_the_leanest_step_has_the_bits_of_the_family(law):
    lean = law.compiled(0.0)
    assert lean.state.size == PLACES[law]
    family = compiled_step(type(law).step)
    state = np.zeros(law.packed[1].size + type(law).workspace)
    state[: law.packed[1].size] = law.packed[1]
    compiled_start(type(law).start)(law.packed[0], state, 0.0)
    family(law.packed[0], state, 0.0)
    ours, theirs = np.empty(U.size), np.empty(U.size)
    assert drive(lean.step, lean.parameters, lean.state, U, ours) == -1
    assert drive(family, law.packed[0], state, U, theirs) == -1
    np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(lean.state[: law.packed[1].size], state[: law.packed[1].size])


@pytest.mark.parametrize(
    ("model", "places"),
    [
        (hs.BoucWen(n=1.5) + hs.Line(slope=1.0), ((0, 2), (4998, 1))),
        (hs.BoucWen() + hs.Dahl() + hs.Line(), ((0, 5),)),
        (hs.Line(slope=1.0) >> hs.GeneralizedBoucWen(n=1.5) >> hs.Play(), ((0, 3), (5025, 2))),
        ((hs.Line() + hs.BoucWen(n=1.5)) >> hs.BoucWenBaberNoori(), ((0, 3), (4999, 3))),
    ],
)
def test_the_memory_is_where_a_model_says(model, places):
    assert model.memory_places == places
    law = model.compiled(0.1)
    filled = law.state.copy()
    ends = [first + count for first, count in places]
    for end, begin in zip(ends, [*(first for first, _ in places[1:]), filled.size], strict=True):
        assert end <= begin
    other = model.compiled(0.1)
    for u in U:  # another workspace, the same memory
        y = law.step(law.parameters, law.state, u)
        for first, count in places:
            other.state[first : first + count] = filled[first : first + count]
        assert other.step(other.parameters, other.state, u) == y
        filled = law.state.copy()
