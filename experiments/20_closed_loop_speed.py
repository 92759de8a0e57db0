"""How fast is a closed loop, and how fast is the same loop inside python-control?

The plant is that of the compensation matrix, a law of Table 1, creep, a mode of 500 Hz and one sample of delay, at
20 kHz, without noise, and so all-discrete: python-control refuses a sampled controller on a continuous plant. The
controller is a PI, a state space for python-control. It runs the loop in two forms: with the plant as `hs.to_control`
gives it, and as one writes it with python-control alone, where the law is a Python function with the exact step of
n = 1, and creep, mode and delay are one discretised state space. How much of that time is spent on joining blocks is
shown by the same loop written by hand as one function: compiled by numba inside a single block of python-control, as a
plain Python loop, and compiled by numba as a whole. The peers in Python run a shorter record; the times are for a
sample, medians of repeats in turns, and the outputs are compared. Beside them stands `close_loop` for 10 s with the
controllers of the matrix and its noisy sensor, as a user calls it: every loop is run twice, for what the noise does.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import control
import numba
import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from peers.contest import spread
from results_folder import wall_timed, write_results
from table1_actuator import H, controllers, reference_plant, resting_voltage

RESULTS = Path(__file__).parent / "results" / "closed_loop_speed"
PI = hs.PID(kp=0.3, ki=1000.0)
PEERS = (
    "python-control, plant by to_control",
    "python-control alone",
    "python-control, one compiled block",
    "plain Python loop",
    "loop compiled by numba",
)

Row = dict[str, float | str | None]


@numba.extending.register_jitable  # a plain function in Python, inlined where numba compiles its caller
def memory_after(A: float, beta: float, gamma: float, z: float, du: float) -> float:
    """The memory of n = 1 after a step du: with s = z sign(du), ds/d|u| = A - |s| (gamma + beta sign(s))."""
    direction, left = math.copysign(1.0, du), abs(du)
    s, slower, faster = direction * z, gamma - beta, gamma + beta
    if s < 0.0:
        crossing = -math.log1p(slower * s / A) / slower if A + slower * s > 0.0 else math.inf
        if left <= crossing:
            return direction * (s * math.exp(slower * left) + A * math.expm1(slower * left) / slower)
        s, left = 0.0, left - crossing
    return direction * (s * math.exp(-faster * left) - A * math.expm1(-faster * left) / faster)


def law_block(law: hs.PolynomialBoucWen) -> control.NonlinearIOSystem:
    """The law with its last input and its memory as states; the output follows the input at once."""
    (first, second), shape = law.input_coefficients, (law.A, law.beta, law.gamma)

    def update(t, x, u, params):
        return np.array([u[0], memory_after(*shape, x[1], u[0] - x[0])])

    def output(t, x, u, params):
        z = memory_after(*shape, x[1], u[0] - x[0])
        return np.array([law.offset + (first + second * u[0]) * u[0] + law.gain * z])

    return control.nlsys(update, output, inputs="u", outputs="w", states=["v", "z"], dt=H, name="law")


def linear_block(plant: hs.Actuator) -> control.StateSpace:
    """Creep, mode and one sample of delay."""
    rates = 1.0 / np.array(plant.creep.time_constants)
    creep = control.ss(-np.diag(rates), rates[:, np.newaxis], [plant.creep.weights], plant.creep.instant_gain)
    mode = control.ss(control.tf(plant.vibration.num, plant.vibration.den))
    sampled = control.sample_system(mode * creep, H, method="zoh")
    n = sampled.nstates
    A = np.block([[sampled.A, np.zeros((n, 1))], [sampled.C, 0.0]])
    B, C = np.append(sampled.B, [[0.0]], axis=0), np.eye(1, n + 1, n)
    return control.ss(A, B, C, 0.0, H, inputs="w", outputs="y", name="linear")


def by_hand(r, start, shape, gains, coefficients, A, B, C, controller):
    """Outputs along a reference and the state after it: the plant's, then u and z of the law, then the controller's."""
    n = B.size
    x, v, z, w = start[:n], start[n], start[n + 1], start[n + 2]
    y = np.empty(len(r))
    for k in range(len(r)):
        y[k] = C @ x
        error = r[k] - float(y[k])
        u = controller[0] * error + controller[1] * w
        z = memory_after(shape[0], shape[1], shape[2], z, u - v)
        v, w = u, w + error
        x = A @ x + B * (gains[0] + (coefficients[0] + coefficients[1] * u) * u + gains[1] * z)
    after = np.empty(n + 3)
    after[:n] = x
    after[n], after[n + 1], after[n + 2] = v, z, w
    return y, after


compiled = numba.njit(by_hand, cache=True)


def constants_by_hand(plant: hs.Actuator) -> tuple[np.ndarray, tuple]:
    """Where the loop that is written by hand rests, and its constants."""
    law, linear = plant.hysteresis, linear_block(plant)
    A, B, C = (np.ascontiguousarray(part) for part in (linear.A, linear.B[:, 0], linear.C[0]))
    resting = np.linalg.solve(np.eye(B.size) - A, B * law.response([0.0])[0])
    shape, gains = (law.A, law.beta, law.gamma), (law.offset, law.gain)
    controller = (PI.kp, PI.ki * H)
    start = np.concatenate([resting, [0.0, law.z0, 0.0]])
    return start, (shape, gains, tuple(law.input_coefficients), A, B, C, controller)


def one_block(plant: hs.Actuator) -> tuple[control.NonlinearIOSystem, np.ndarray]:
    """The whole loop as a single block of python-control, and where it rests."""
    start, constants = constants_by_hand(plant)
    n, C = start.size - 3, constants[5]
    block = control.nlsys(
        lambda t, x, u, params: compiled(u, x, *constants)[1],
        lambda t, x, u, params: np.array([C @ x[:n]]),
        inputs="r",
        outputs="y",
        states=start.size,
        dt=H,
    )
    return block, start


def written_alone(plant: hs.Actuator) -> tuple[control.InterconnectedSystem, np.ndarray]:
    """The loop as python-control's own blocks, and where it rests."""
    law, linear = law_block(plant.hysteresis), linear_block(plant)
    level = plant.hysteresis.response([0.0])
    resting = np.linalg.solve(np.eye(linear.nstates) - linear.A, linear.B @ level)
    return joined(law, linear), np.concatenate([[0.0, plant.hysteresis.z0], resting, [0.0]])


def joined(*plant: control.InputOutputSystem) -> control.InterconnectedSystem:
    """The plant's blocks with the controller."""
    controller = control.ss(1.0, 1.0, PI.ki * H, PI.kp, H, inputs="e", outputs="u", name="controller")
    error = control.summing_junction(["r", "-y"], "e", name="error")
    return control.interconnect([*plant, controller, error], inputs="r", outputs="y")


def reference(samples: int) -> np.ndarray:
    """A triangle of 20 Hz from 0.1 to 2.5 um."""
    period = round(0.05 / H)
    wave = hs.signals.triangle(0.1, 2.5, cycles=-(-samples // period), samples_per_cycle=period)
    return wave[:samples]


def in_turns(works: list[Callable[[], object]], repeats: int) -> np.ndarray:
    """Times [s], shape (repeats, n_works), the first turn not counted."""
    return np.array([[wall_timed(work)[1] for work in works] for _ in range(repeats + 1)])[1:]


def loops(plant: hs.Actuator, samples: int, fewer: int, repeats: int) -> list[Row]:
    """One loop by hysim on a long record, and by the peers on a shorter one."""
    whole, part = reference(samples), reference(fewer)
    systems = [(joined(hs.to_control(plant, H)), 0.0), written_alone(plant), one_block(plant)]
    start, constants = constants_by_hand(plant)
    numbers = part.tolist()  # floats of Python, on which a plain loop is fastest
    own = hs.close_loop(plant, PI, H * np.arange(fewer), part).measurement

    def inside(system: control.InterconnectedSystem, start: np.ndarray | float) -> np.ndarray:
        return control.input_output_response(system, H * np.arange(fewer), part, start).outputs

    outputs = [own, *(inside(*system) for system in systems)]
    outputs += [by_hand(numbers, start, *constants)[0], compiled(part, start, *constants)[0]]
    errors = [float(np.abs(output - own).max()) for output in outputs]
    works = [lambda: hs.close_loop(plant, PI, H * np.arange(samples), whole)]
    works += [lambda system=system: inside(*system) for system in systems]
    works += [lambda: by_hand(numbers, start, *constants), lambda: compiled(whole, start, *constants)]
    lengths = [samples, *[fewer] * (len(PEERS) - 1), samples]
    each = 1e6 * in_turns(works, repeats) / lengths
    return [
        {
            "kind": "loop",
            "name": name,
            "samples": n,
            **spread("microseconds_per_sample", each[:, k]),
            **spread("times_hysim", each[:, k] / each[:, 0]),
            "largest_difference_um": error,
        }
        for k, (name, n, error) in enumerate(zip(("hysim", *PEERS), lengths, errors, strict=True))
    ]


def ten_seconds(plant: hs.Actuator, samples: int, repeats: int) -> list[Row]:
    """`close_loop` with each controller of the matrix, noise included, as a user calls it."""
    r, t = hs.signals.triangle(0.1, 2.5, cycles=10, samples_per_cycle=samples // 10)[:samples], H * np.arange(samples)
    u0 = resting_voltage(plant, 0.1)
    rows = []
    for name, controller in controllers(plant).items():
        times = in_turns([lambda each=controller: hs.close_loop(plant, each, t, r, u0=u0)], repeats)[:, 0]
        rows.append(
            {
                "kind": "controller",
                "name": name,
                "samples": samples,
                **spread("microseconds_per_sample", 1e6 * times / samples),
                **dict.fromkeys(("times_hysim", "times_hysim_q1", "times_hysim_q3", "largest_difference_um")),
            }
        )
    return rows


def main(smoke: bool = False) -> list[Row]:
    """Measure, print, and unless it is a smoke run write table, figure and result."""
    plant = reference_plant()
    quiet = replace(plant, sensor=replace(plant.sensor, noise=0.0))
    rows = loops(quiet, 400, 40, 2) if smoke else loops(quiet, 200_000, 1000, 9)
    rows += ten_seconds(plant, 400, 2) if smoke else ten_seconds(plant, 200_000, 5)
    slowest = max((row for row in rows if row["kind"] == "controller"), key=lambda row: row["microseconds_per_sample"])
    for row in rows:
        print(f"{row['name']:<36} {row['microseconds_per_sample']:10.3f} us a sample", end="")
        if row["times_hysim"] is not None:
            print(f", {row['times_hysim']:8.1f} times hysim, {row['largest_difference_um']:.1e} um apart", end="")
        print()
    seconds = {"controller": slowest["name"], "seconds": 0.2 * float(slowest["microseconds_per_sample"])}
    print("10 s at 20 kHz, the slowest:", seconds)
    return write_results(RESULTS, rows, draw, {"at_least_times": 300, "slowest_10_s": seconds}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """Time of a sample by tool, and of 10 s by controller."""
    canvas = figure(height=5.0)
    shown = [row for row in rows if row["kind"] == "loop"], [row for row in rows if row["kind"] == "controller"]
    axes = canvas.subplots(2, 1, height_ratios=[len(part) for part in shown])
    scales = (1.0, "Time of one sample, the same loop [us]"), (0.2, "Time of close_loop for 10 s at 20 kHz [s]")
    for ax, part, (scale, label) in zip(axes, shown, scales, strict=True):
        names = ("microseconds_per_sample", "microseconds_per_sample_q1", "microseconds_per_sample_q3")
        middle, low, high = (scale * np.array([float(row[name]) for row in part]) for name in names)
        places = np.arange(len(part))
        ax.errorbar(middle, places, xerr=[middle - low, high - middle], fmt="o", markersize=5)
        ax.set_yticks(places, [str(row["name"]) for row in part])
        ax.set(ylim=(len(part) - 0.5, -0.5), xlabel=label)
    axes[0].set_xscale("log")
    axes[1].set_xlim(left=0.0)
    return canvas


if __name__ == "__main__":
    main()
