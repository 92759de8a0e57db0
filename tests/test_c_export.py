"""Laws, plants and controllers in C do what they do in Python; controllers on a long replay of measurements."""

import math
import re
import subprocess

import numpy as np
import pytest
from strategies import COMPILED, COMPILER, STRICT, needs_compiler, printed, printed_by_main, refused
from test_inverse_of_every_law import LAWS

import hysim as hs
from hysim._basics.frozen import read_only
from hysim.cli import main
from hysim.kernels.controllers import replay
from hysim.models.protocols import needs_time

H = 5e-5  # s
N = 15_000 if COMPILED else 200
MODE = {"natural_frequency": 2.0 * math.pi * 500.0, "damping_ratio": 0.01}
CREEP = hs.Creep.per_decade(1.5)
LAW = hs.BoucWen(beta=0.02, gamma=0.01, feedthrough=0.03, gain=-0.01)
POLYNOMIAL = hs.PolynomialBoucWen(
    beta=0.004, gamma=0.058, n=1.0, gain=-0.0076, offset=-0.11, z0=-8.8, input_coefficients=(0.028, -3.8e-5)
)
GENERAL = hs.BoucWen(beta=0.02, gamma=0.01, n=1.6, feedthrough=0.03, gain=-0.01)
PLAYS = hs.PrandtlIshlinskii(thresholds=(0.0, 2.0, 9.0), weights=(0.02, 0.006, 0.004))
SEARCHED = hs.Dahl(stiffness=0.02, coulomb=0.1) + hs.Line(slope=0.02)
STACK = hs.Actuator(hysteresis=LAW, creep=CREEP, vibration=hs.mode(**MODE), sensor=hs.Sensor(noise=1e-3, delay=H))
AMPLIFIED = hs.Actuator(
    amplifier=hs.Amplifier(gain=15.0, offset=1.0, limits=(0.0, 90.0)),
    hysteresis=POLYNOMIAL,
    vibration=hs.mode(**MODE),
    sensor=hs.Sensor(noise=1e-3, delay=0.5 * H),
)
LINEAR = hs.Actuator(hysteresis=hs.Line(offset=0.1, slope=0.02), creep=CREEP, sensor=hs.Sensor(noise=1e-3))
PID = hs.PID(
    kp=4.0, ki=800.0, kd=1e-3, derivative_filter=1e-3, limits=(5.0, 95.0), setpoint_weight=0.7, derivative_weight=0.3
)
FILTERED = {"notch": hs.Notch(**MODE), "damping": hs.DampingLoop(gain=2.0, frequency=2.0 * math.pi * 500.0)}


def learner():
    """What learns, and from which model."""
    inverse = {"feedforward": hs.InverseFeedforward.of(STACK), "mode_inverse": hs.ModeInverse(**MODE)}
    controller = hs.TrackingController(**inverse, preview=True, limits=(0.0, 60.0))
    return {"controller": controller, "model": STACK, "stroke": (0.3, 2.5)}


CONTROLLERS = {  # functions: a controller compiles its law, which no collection of tests should wait for
    "pid": lambda: (STACK, PID),
    "filters": lambda: (STACK, hs.TrackingController(feedback=hs.PID(ki=800.0), limits=(0.0, 60.0), **FILTERED)),
    "inverse": lambda: (
        hs.Actuator(hysteresis=POLYNOMIAL),
        hs.TrackingController(feedforward=hs.InverseFeedforward(law=POLYNOMIAL), limits=(0.0, 90.0)),
    ),
    "inverse_of_law_and_creep": lambda: (
        STACK,
        hs.TrackingController(
            feedforward=hs.InverseFeedforward.of(STACK), feedback=hs.PID(ki=500.0), limits=(0.0, 95.0), **FILTERED
        ),
    ),
    "everything": lambda: (
        STACK,
        hs.TrackingController(
            shaper=hs.Shaper(smoothing=0.6e-3),
            mode_inverse=hs.ModeInverse(**MODE),
            feedforward=hs.InverseFeedforward.of(STACK),
            feedback=hs.PID(ki=1000.0),
            model=STACK,
            preview=True,
            limits=(0.0, 110.0),
        ),
    ),
    "amplifier_and_late_model": lambda: (
        AMPLIFIED,
        hs.TrackingController(
            shaper=hs.Shaper.zvd(*MODE.values()),
            feedforward=hs.InverseFeedforward.of(AMPLIFIED),
            feedback=hs.PID(kp=0.1, ki=30.0),
            model=AMPLIFIED,
            limits=(0.0, 6.0),
        ),
    ),
    "general_exponent": lambda: (
        hs.Actuator(hysteresis=GENERAL),
        hs.TrackingController(feedforward=hs.InverseFeedforward(law=GENERAL), limits=(0.0, 90.0)),
    ),
    "plays": lambda: (
        hs.Actuator(hysteresis=PLAYS),
        hs.TrackingController(feedforward=hs.InverseFeedforward(law=PLAYS), limits=(-20.0, 90.0)),
    ),
    "searched": lambda: (
        hs.Actuator(hysteresis=SEARCHED),
        hs.TrackingController(feedforward=hs.InverseFeedforward(law=SEARCHED), limits=(0.0, 90.0)),
    ),
    "line": lambda: (
        LINEAR,
        hs.TrackingController(feedforward=hs.InverseFeedforward.of(LINEAR), feedback=hs.PID(ki=500.0)),
    ),
    "repetitive": lambda: (STACK, hs.RepetitiveControl(period=0.1, **learner())),
    "iterative": lambda: (STACK, hs.IterativeLearning(duration=0.1, **learner())),
    "predictive": lambda: (STACK, hs.PredictiveControl(model=STACK, horizon=1e-3, limits=(0.0, 60.0), rate=2e4)),
    "predictive_within_soft_limits": lambda: (
        AMPLIFIED,
        hs.PredictiveControl(model=AMPLIFIED, horizon=1e-3, limits=(0.0, 3.0), output_limits=(0.0, 2.0), preview=False),
    ),
    "linear": lambda: (
        STACK,
        hs.control.LinearController(
            system=hs.StateSpace(A=[[-1.0, 0.0], [1.0, -900.0]], B=[2.0, 1.0], C=[3000.0, 5.0], D=0.2),
            limits=(0.0, 60.0),
        ),
    ),
}
DRIVER = """
#include <stdio.h>
#include "{name}.h"

int main(void)
{{
    static {name}_state state;
    double record[2], out[2];

    {name}_init(&state);
    while (fread(record, sizeof record, 1, stdin) == 1) {{
        out[1] = {name}_step(&state, record[0]{measurement});
        out[0] = {other};
        fwrite(out, sizeof out, 1, stdout);
    }}
    return 0;
}}
"""


def compiled(source, folder, other="state.x[0]"):
    """A program that reads pairs of reference and measurement and writes pairs of another number and the drive."""
    source.write(folder)
    measurement = ", record[1]" if "measurement)" in source.header else ""
    (folder / "driver.c").write_text(DRIVER.format(name=source.name, measurement=measurement, other=other))
    command = [COMPILER, *STRICT, "driver.c", f"{source.name}.c", "-o", "driver", "-lm"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return folder / "driver"


def replayed(program, reference, measurement):
    """Commands, or another number, and drives in C."""
    record = np.stack([reference, measurement], axis=1).tobytes()
    out = subprocess.run([program], input=record, capture_output=True, check=True).stdout
    return np.frombuffer(out).reshape(-1, 2).T


def stepped(controller, reference, measurement, u0=0.0, y0=0.0):
    """Commands and drives in Python."""
    step, parameters, state = controller.initial(H, u0, y0)
    out = np.empty((2, reference.size))
    with np.errstate(all="ignore"):
        replay(step, parameters, state, read_only(reference), read_only(measurement), out[:1], out[1])
    return out


@pytest.fixture(scope="module")
def records():
    """Loops with noise, turning points and phases at the limits: what each controller gets, and what it gives."""
    t = H * np.arange(N)
    r = 1.4 + 1.1 * np.sin(2.0 * math.pi * 7.0 * t) + 0.3 * np.sign(np.sin(2.0 * math.pi * 3.0 * t))
    found = {}
    for name, build in CONTROLLERS.items():
        plant, controller = build()
        run = hs.close_loop(plant, controller, t, r)
        ahead = controller.ahead(H)
        given = np.append(r[ahead:], np.full(ahead, r[-1]))
        found[name] = given, run.measurement, run.y[0], stepped(controller, given, run.measurement, y0=run.y[0])
        within = controller.limits is None or name.startswith("predictive")  # which asks for no more than the limits
        assert not COMPILED or within or run.conditions["limited_samples"] > N // 20
    return found


@needs_compiler
@pytest.mark.parametrize("name", CONTROLLERS)
def test_c_follows_python_over_a_long_record(name, records, tmp_path):
    """To 1e-12 of the range: the libraries' exponentials may differ in their last bit."""
    reference, measurement, y0, expected = records[name]
    source = hs.to_c(CONTROLLERS[name]()[1], H, name=name, y0=y0)
    given = replayed(compiled(source, tmp_path), reference, measurement)
    assert np.abs(given - expected).max() < 1e-12 * np.ptp(expected[1])


@needs_compiler
def test_a_feedforward_alone_takes_the_reference_alone(records, tmp_path):
    """The inverse of a law as a program of its own; nothing else stands in its way."""
    reference, measurement, y0, _ = records["plays"]
    source = hs.to_c(hs.InverseFeedforward(law=PLAYS), H, name="inverse", y0=y0)
    assert "double inverse_step(inverse_state *state, double reference);" in source.header
    given = replayed(compiled(source, tmp_path), reference, measurement)
    assert np.abs(PLAYS.response(given[1]) - reference).max() < 1e-12 * np.ptp(reference)


@needs_compiler
def test_an_output_beyond_saturation_is_asked_for_as_in_python(tmp_path):
    """A law that saturates, from a command other than zero, and to both of its limits."""
    law = hs.BoucWen(gain=2.0, z0=0.1)
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), limits=(-3.0, 4.0))
    reference, nothing = 2.5 * np.sin(0.01 * np.arange(2000)), np.zeros(2000)
    expected = stepped(controller, reference, nothing, u0=0.3, y0=0.2)
    given = replayed(compiled(hs.to_c(controller, H, u0=0.3, y0=0.2), tmp_path), reference, nothing)
    assert {-3.0, 4.0} <= set(given[1])
    assert np.abs(given - expected).max() < 1e-11  # where the law is flat the input is less sharp


MODELS = {
    "sum": lambda: hs.BoucWen(beta=0.7) + hs.Play(threshold=0.2) + hs.Line(slope=2.0),
    "cascade": lambda: hs.Line(slope=2.0) >> hs.BoucWen(n=1.5) >> hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0}),
    "plant": lambda: hs.TransferFunction(num=(3.0,), den=(1e-3, 1.0), delay=1.5 * H),
    "law_and_mode": lambda: hs.BoucWen(beta=0.7) >> hs.mode(**MODE),
    "actuator": lambda: STACK,
    "oscillator_split": lambda: oscillator(hs.BoucWen(n=1.5, beta=0.7, offset=0.1)),
    "oscillator_strang": lambda: oscillator(hs.PolynomialBoucWen(input_coefficients=(0.2, 0.0, 0.1)), method="strang"),
    "oscillator_newmark": lambda: oscillator(hs.BoucWen(), method="newmark", excitation="base"),
    "oscillator_runge_kutta": lambda: oscillator(hs.BoucWen(n=2.0), method="runge-kutta", hold="zoh"),
}


def oscillator(law, **options):
    plant = {"mass": 2e-6, "damping": 1e-4, "stiffness": 1.0, "initial_state": (0.2, 30.0)}
    return hs.BoucWenOscillator(**plant, law=law, **options)


@needs_compiler
@pytest.mark.parametrize("name", MODELS)
def test_the_worked_main_prints_the_response(name, tmp_path):
    """From a first input other than zero."""
    model = MODELS[name]()
    u = 0.3 + np.sin(0.05 * np.arange(200)) * np.linspace(0.5, 2.0, 200)
    timed = needs_time(model)
    in_c = printed_by_main(hs.to_c(model, H if timed else None, name=name), tmp_path, u)
    law = model.startable(H).started(u[0]) if timed else None
    y = model.response(u) if law is None else np.array([law.step(law.parameters, law.state, v) for v in u])
    assert np.abs(in_c - y).max() <= 1e-12 * np.ptp(y)


@needs_compiler
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_law_and_its_inverse_are_c_and_the_user_s_name_meets_none_of_ours(law, tmp_path):
    """Public names are name_init, name_step, name_state and name_held; the natural one is that of our own step."""
    ours = re.findall(r"^static .*?(\w+)(?:\(|\[)", hs.to_c(law, H).source, re.MULTILINE)
    assert not [each for each in ours if each.endswith(("_init", "_step", "_state", "_held"))]
    *_, name = type(law).__name__.lower(), *(each[: -len("_step_")] for each in ours if each.endswith("_step_"))
    for thing in (law, hs.InverseFeedforward(law=law)):
        hs.to_c(thing, 1.0, name=name).write(tmp_path)
        subprocess.run([COMPILER, *STRICT, "-fsyntax-only", f"{name}.c"], cwd=tmp_path, check=True)


def test_an_inverse_that_ends_within_the_identified_range_says_so():
    law = hs.BoucWen(beta=0.02, gamma=0.01, feedthrough=0.03, gain=-0.04, u0=0.0, u_range=(0.0, 150.0))
    with pytest.warns(hs.HysimWarning, match="the last command is held"):
        code = hs.to_c(hs.InverseFeedforward(law=law))
    assert "WARNING: on a cycle from 0 to 150" in code.header


@needs_compiler
@pytest.mark.parametrize(("law", "name"), [(hs.BoucWen(n=1.5), "boucwen"), (PLAYS, "clamps"), (hs.Play(), "play")])
def test_a_law_of_its_natural_name_is_built(law, name, tmp_path):
    u = np.array([0.5, -0.2])
    assert printed_by_main(hs.to_c(law, name=name), tmp_path, u) == pytest.approx(law.response(u), abs=1e-14)


def test_equal_settings_have_equal_texts():
    controller = CONTROLLERS["everything"]()[1]
    assert hs.to_c(controller, H) == hs.to_c(controller, H)
    assert hs.to_c(controller, H) != hs.to_c(controller, 2.0 * H)
    assert f"#define MODEL_AHEAD {controller.ahead(H)} " in hs.to_c(controller, H).header


def test_the_state_of_a_lean_law_is_small():
    assert hs.to_c(hs.BoucWen()).state_size == 2
    assert hs.to_c(hs.PrandtlIshlinskii(thresholds=(0.0, 1.0, 2.0), weights=(1.0, 1.0, 1.0))).state_size == 4


test_a_thing_without_a_program_is_refused = refused(
    (PID, {"sample_time": H, "name": "2axes"}, "name must be letters"),
    (PID, {"sample_time": H, "name": ""}, "it has another character"),
    (PID, {"sample_time": H, "name": "double"}, "got 'double': it is a word of the language C"),
    (PID, {"sample_time": H, "name": "sin"}, "got 'sin': it is a function of the C library"),
    (PID, {"sample_time": H, "name": "Math"}, "got 'Math': Math.h is a header of the C library"),
    (PID, {"sample_time": H, "u0": math.nan}, "u0 must be finite, got nan"),
    (PID, {}, "give sample_time"),
    (PID, {"sample_time": 0.0}, "sample_time must be positive"),
    (hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), {}, "give sample_time"),
    (hs.BoucWen, {}, TypeError, "got the class BoucWen: give it its parameters"),
    ("law.json", {}, TypeError, "can be stepped is expected, got str"),
    call=lambda thing, arguments: hs.to_c(thing, **arguments),
)


@needs_compiler
def test_an_inverse_from_a_file_by_the_command_line_alone(tmp_path, monkeypatch):
    """Identified plays, their inverse in C, and its commands through the identified law."""
    true = hs.PrandtlIshlinskii(thresholds=(0.0, 1.0, 3.0), weights=(0.5, 0.3, 0.2))
    u = np.concatenate([hs.signals.triangle(0.0, high, cycles=1, samples_per_cycle=80) for high in (10.0, 6.0)])
    lines = [f"{v!r},{w!r}" for v, w in zip(u.tolist(), true.response(u).tolist(), strict=True)]
    (tmp_path / "loop.csv").write_text("\n".join(["voltage,displacement", *lines]) + "\n")
    monkeypatch.chdir(tmp_path)
    columns = ["--u", "voltage", "--y", "displacement", "--model", "prandtl-ishlinskii"]
    assert main(["identify", "loop.csv", *columns, "--out", "law.json"]) == 0
    assert main(["c", "law.json", "--inverse", "--out", "inverse.c"]) == 0
    command = [COMPILER, *STRICT, "inverse.c", "inverse_main.c", "-o", "inverse", "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    law, wanted = hs.load_model(tmp_path / "law.json"), 2.5 + 2.4 * np.sin(0.1 * np.arange(300))
    voltages = printed(tmp_path / "inverse", wanted)
    assert np.abs(law.response(np.append(0.0, voltages))[1:] - wanted).max() < 1e-12 * np.ptp(wanted)
    in_python = law.compiled_inverse(0.0)
    expected = [in_python.step(in_python.parameters, in_python.state, y) for y in wanted]
    assert np.abs(voltages - expected).max() < 1e-12 * np.ptp(voltages)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["law.json", "--out", "law.h"], "call the file .c"),
        (["law.json", "--out", "2.c"], "name must be letters"),
        (["play.json", "--inverse", "--out", "a.c"], "has no inverse"),
        (["none.json", "--out", "a.c"], "none.json"),
    ],
)
def test_wrong_input_of_the_command_is_refused_in_one_line(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    hs.save(hs.Line(slope=1.0), "law.json")
    hs.save(hs.Play(threshold=1.0), "play.json")
    assert main(["c", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not list(tmp_path.glob("*.c"))
