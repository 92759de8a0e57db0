"""A controller in C does what it does in Python: compiled with gcc, on a long replay of recorded measurements."""

import math
import os
import shutil
import subprocess

import numpy as np
import pytest

import hysim as hs

H = 5e-5  # s
COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") == "0"
N = 20_000 if COMPILED else 200
MODE = {"natural_frequency": 2.0 * math.pi * 500.0, "damping_ratio": 0.01}
CREEP = hs.Creep.per_decade(1.5)
LAW = hs.BoucWen(beta=0.02, gamma=0.01, feedthrough=0.03, gain=-0.01)
POLYNOMIAL = hs.PolynomialBoucWen(
    beta=0.004, gamma=0.058, n=1.0, gain=-0.0076, offset=-0.11, z0=-8.8, input_coefficients=(0.028, -3.8e-5)
)
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
FILTERED = {
    "notch": hs.Notch(**MODE),
    "damping": hs.DampingLoop(gain=2.0, frequency=2.0 * math.pi * 500.0),
}
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
    "line": lambda: (
        LINEAR,
        hs.TrackingController(feedforward=hs.InverseFeedforward.of(LINEAR), feedback=hs.PID(ki=500.0)),
    ),
}
STRICT = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-pedantic"]
DRIVER = """
#include <stdio.h>
#include "{name}.h"

int main(void)
{{
    static {name}_state state;
    double record[2], command[2];

    {name}_start(&state);
    while (fread(record, sizeof record, 1, stdin) == 1) {{
        command[1] = {name}_step(&state, ({name}_real)record[0], ({name}_real)record[1]);
        command[0] = state.command;
        fwrite(command, sizeof command, 1, stdout);
    }}
    return 0;
}}
"""
ARDUINO = """
enum { A0 = 14, DAC0 = 66 };
int analogRead(int pin);
void analogWrite(int pin, int count);
unsigned long micros(void);
void setup(void);
void loop(void);
"""
compiler = shutil.which("gcc") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(compiler is None, reason="there is no C compiler here")


def compiled(source, folder, *options):
    """A program that reads pairs of reference and measurement and writes pairs of command and drive."""
    source.write(folder)
    (folder / "driver.c").write_text(DRIVER.format(name=source.name))
    command = [compiler, *STRICT, *options, "driver.c", f"{source.name}.c", "-o", "driver", "-lm"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return folder / "driver"


def replayed(program, reference, measurement):
    """Commands and drives in C."""
    record = np.stack([reference, measurement], axis=1).tobytes()
    out = subprocess.run([program], input=record, capture_output=True, check=True).stdout
    return np.frombuffer(out).reshape(-1, 2).T


def stepped(controller, reference, measurement, u0=0.0, y0=0.0):
    """Commands and drives in Python."""
    state = controller.initial(H, u0, y0)
    out = np.empty((2, reference.size))
    for k, (r, m) in enumerate(zip(reference, measurement, strict=True)):
        out[1, k] = state.step(state.parameters, state.state, r, m)
        out[0, k] = state.state[0]
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
        assert not COMPILED or controller.limits is None or run.conditions["limited_samples"] > 1000
    return found


@needs_compiler
@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-12), ("float", 1e-4)])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_c_follows_python_over_a_long_record(name, precision, tolerance, records, tmp_path):
    """Of the range. The libraries' exponentials may differ in their last bit; a float has 6e-8, ten times amplified."""
    reference, measurement, y0, expected = records[name]
    source = hs.to_c(CONTROLLERS[name]()[1], H, name=name, y0=y0, precision=precision)
    given = replayed(compiled(source, tmp_path), reference, measurement)
    assert np.abs(given - expected).max() < tolerance * np.ptp(expected[1])


@needs_compiler
@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-12), ("float", 1e-4)])
def test_a_small_board_without_expm1_and_log1p_does_as_well(precision, tolerance, records, tmp_path):
    name = "inverse_of_law_and_creep"
    reference, measurement, y0, expected = records[name]
    source = hs.to_c(CONTROLLERS[name]()[1], H, y0=y0, precision=precision)
    given = replayed(compiled(source, tmp_path, "-D__AVR__"), reference, measurement)
    assert np.abs(given - expected).max() < tolerance * np.ptp(expected[1])


@needs_compiler
def test_what_nothing_reaches_is_asked_for_as_in_python(tmp_path):
    """Of a law that saturates, from a command other than zero, and to both of its limits."""
    law = hs.BoucWen(gain=2.0, z0=0.1)
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(law=law), limits=(-3.0, 4.0))
    reference, nothing = 2.5 * np.sin(0.01 * np.arange(2000)), np.zeros(2000)
    expected = stepped(controller, reference, nothing, u0=0.3, y0=0.2)
    given = replayed(compiled(hs.to_c(controller, H, u0=0.3, y0=0.2), tmp_path), reference, nothing)
    assert {-3.0, 4.0} <= set(given[1])
    assert np.abs(given - expected).max() < 1e-11  # where the law is flat the input is less sharp


@needs_compiler
def test_slow_creep_moves_in_single_precision_too(tmp_path):
    """A sample moves the element by 5e-8 of its position, less than half the distance to the next float."""
    creep = hs.Creep(time_constants=(1e3,), weights=(1.0,))
    controller = hs.TrackingController(feedforward=hs.InverseFeedforward(creep=creep))
    reference = np.full(200_000, 3.0)
    double, single = (
        replayed(
            compiled(hs.to_c(controller, H, u0=1.0, y0=2.0, precision=precision), tmp_path / precision),
            reference,
            reference,
        )[1]
        for precision in ("double", "float")
    )
    assert double[0] - double[-1] > 9e-3
    assert np.abs(single - double).max() < 1e-6


@needs_compiler
@pytest.mark.parametrize("precision", ["double", "float"])
def test_the_sketch_compiles_with_the_functions_of_an_arduino(precision, tmp_path):
    folder = tmp_path / "stage"
    hs.to_c(PID, H, name="axis", precision=precision).write(folder)
    assert sorted(path.name for path in folder.iterdir()) == ["axis.c", "axis.h", "stage.ino"]
    (folder / "arduino.h").write_text(ARDUINO)
    command = [compiler, *STRICT, "-include", "arduino.h", "-x", "c", "-c", "stage.ino", "-o", "stage.o"]
    subprocess.run(command, cwd=folder, check=True)


def test_the_same_settings_give_the_same_text():
    controller = CONTROLLERS["everything"]()[1]
    assert hs.to_c(controller, H) == hs.to_c(controller, H)
    assert hs.to_c(controller, H) != hs.to_c(controller, 2.0 * H)
    assert f"#define CONTROLLER_AHEAD {controller.ahead(H)}\n" in hs.to_c(controller, H).header


def test_a_feedforward_alone_is_a_controller_of_one_part():
    alone = CONTROLLERS["inverse"]()[1].feedforward
    assert hs.to_c(alone, H) == hs.to_c(hs.TrackingController(feedforward=alone), H)


PLAYS = hs.PrandtlIshlinskii(thresholds=(0.0, 2.0), weights=(0.01, 0.003))


@pytest.mark.parametrize(
    ("controller", "options", "message"),
    [
        (hs.InverseFeedforward(law=PLAYS), {}, "Bouc-Wen law with n = 1, or a line"),
        (hs.InverseFeedforward(law=hs.BoucWen(n=2.0, feedthrough=1.0)), {}, "n must be 1, got 2"),
        (PID, {"name": "2axes"}, "name must be letters"),
        (PID, {"precision": "half"}, "precision must be"),
        (PID, {"u0": math.nan}, "u0 and y0 must be finite"),
        (hs.PID(kp=1e40), {"precision": "float"}, "does not fit into a float"),
    ],
)
def test_what_there_is_no_c_for_is_refused(controller, options, message):
    with pytest.raises(ValueError, match=message):
        hs.to_c(controller, H, **options)


def test_what_is_no_controller_is_refused():
    with pytest.raises(TypeError, match="or an InverseFeedforward, got BoucWen"):
        hs.to_c(hs.BoucWen(), H)
