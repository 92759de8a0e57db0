"""What does accuracy across reversals cost? A mass on a Bouc-Wen spring by hysim and by what people use.

One second of the Noel-Schoukens multisine at 750 Hz, linear between its samples. The errors are the largest
deviations of the displacement at the samples, in units of its root mean square, from a converged solution; how
far that one is from another, found by an adaptive method that is begun anew at every sample, is stated beside it.
The times are medians over repeats in one run, and their spread is half the distance between the quartiles.
"""

import csv
import ctypes
import importlib.util
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import control
import numba
import numpy as np
from scipy.integrate import solve_ivp

import hysim as hs
from hysim.plot import Figure, figure, house_style, save_svg

RESULTS = Path(__file__).parent / "results" / "oscillator"
SOURCE = Path(__file__).parent / "oscillator.c"
RATE = 750.0
MASS, DAMPING, STIFFNESS, A, BETA, GAMMA = 2.0, 10.0, 5e4, 5e4, 800.0, -1100.0
SCALES = np.array([1e-3, 0.2, 50.0])
PLANT = replace(hs.benchmarks.noel_schoukens_plant(), method="split", substeps=None)

Method = Callable[[np.ndarray], np.ndarray]
Row = dict[str, float | str]


def derivative(t: float, x: np.ndarray, u: np.ndarray) -> tuple[float, float, float]:
    """Rates of (y, y', z) under the piecewise-linear input `u`."""
    k = min(int(t * RATE), u.size - 2)
    force = u[k] + (t * RATE - k) * (u[k + 1] - u[k])
    y, v, z = x
    return v, (force - DAMPING * v - STIFFNESS * y - z) / MASS, v * A - BETA * abs(v) * z - GAMMA * v * abs(z)


compiled_derivative = numba.njit(derivative)


def adaptive(u: np.ndarray, method: str, rtol: float, rates: Callable) -> np.ndarray:
    """`solve_ivp` over the whole record."""
    t = np.arange(u.size) / RATE
    options = {"t_eval": t, "rtol": rtol, "atol": rtol * SCALES, "args": (u,)}
    return solve_ivp(rates, (0.0, t[-1]), np.zeros(3), method, **options).y[0]


def python_control(u: np.ndarray, rtol: float) -> np.ndarray:
    """python-control's simulation, which is `solve_ivp` RK45 beneath."""

    def update(t: float, x: np.ndarray, force: np.ndarray, parameters: dict) -> list[float]:
        y, v, z = x
        acceleration = (force[0] - DAMPING * v - STIFFNESS * y - z) / MASS
        return [v, acceleration, v * A - BETA * abs(v) * z - GAMMA * v * abs(z)]

    system = control.nlsys(update, lambda t, x, force, parameters: x[0], inputs=1, outputs=1, states=3)
    options = {"rtol": rtol, "atol": rtol * SCALES}
    response = control.input_output_response(system, np.arange(u.size) / RATE, u, solve_ivp_kwargs=options)
    return np.asarray(response.outputs)


def restarted(u: np.ndarray) -> np.ndarray:
    """DOP853 near its tightest, begun anew at every sample: slow, and independent of hysim."""
    x, y = np.zeros(3), [0.0]
    for k in range(u.size - 1):
        options = {"rtol": 1e-12, "atol": 1e-13 * SCALES, "args": (u[k : k + 2],)}
        x = solve_ivp(compiled_derivative, (0.0, 1.0 / RATE), x, "DOP853", **options).y[:, -1]
        y.append(x[0])
    return np.array(y)


def plain_c(folder: Path) -> Callable[[np.ndarray, int], np.ndarray] | None:
    """The same scheme in C, if there is a compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        print("no C compiler: the comparison with C is left out")
        return None
    library = folder / "oscillator.so"
    command = [compiler, "-O3", "-march=native", "-shared", "-fPIC", "-o", str(library), str(SOURCE), "-lm"]
    subprocess.run(command, check=True)
    path = ctypes.CDLL(str(library)).path
    array = np.ctypeslib.ndpointer(dtype=np.float64, flags="C")
    path.argtypes, path.restype = [array, ctypes.c_int, ctypes.c_double, array, ctypes.c_long, array], None
    plant = np.array([MASS, DAMPING, STIFFNESS, A, BETA, GAMMA])

    def run(u: np.ndarray, substeps: int) -> np.ndarray:
        y = np.empty(u.size)
        path(plant, substeps, 1.0 / RATE, u, u.size, y)
        return y

    return run


def diffrax_solver(u: np.ndarray) -> Callable[[float], Method] | None:
    """Diffrax' Dopri8 with 64 bits, jitted, if it is installed."""
    if importlib.util.find_spec("diffrax") is None:
        print("no diffrax (extra bench): left out")
        return None
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    t = jnp.arange(u.size) / RATE

    def rates(time: float, x: jax.Array, force: jax.Array) -> jax.Array:
        k = jnp.clip((time * RATE).astype(int), 0, u.size - 2)
        pull = force[k] + (time * RATE - k) * (force[k + 1] - force[k])
        y, v, z = x
        acceleration = (pull - DAMPING * v - STIFFNESS * y - z) / MASS
        return jnp.stack([v, acceleration, v * A - BETA * jnp.abs(v) * z - GAMMA * v * jnp.abs(z)])

    def at(rtol: float) -> Method:
        control_of_step = diffrax.PIDController(rtol=rtol, atol=jnp.asarray(rtol * SCALES))

        @jax.jit
        def solve(force: jax.Array) -> jax.Array:
            term, saved = diffrax.ODETerm(rates), diffrax.SaveAt(ts=t)
            return diffrax.diffeqsolve(
                term, diffrax.Dopri8(), t[0], t[-1], 1e-4, jnp.zeros(3), force,
                saveat=saved, stepsize_controller=control_of_step, max_steps=10**7,
            ).ys[:, 0]  # fmt: skip

        return lambda force: np.asarray(solve(jnp.asarray(force)))

    return at


def contestants(u: np.ndarray, smoke: bool, folder: Path) -> Iterator[tuple[str, str, Method]]:
    """Name, setting and method, from coarse to fine."""

    def some(*settings: float) -> tuple:
        return settings[:1] if smoke else settings

    for method, counts in {
        "split": (1, 2, 3, 4, 8, 16),
        "strang": (1, 4, 16, 64, 256),
        "runge-kutta": (1, 4, 16, 64, 256),
        "newmark": (1, 4, 16, 64, 256),
    }.items():
        for count in some(*counts):
            plant = replace(PLANT, method=method, substeps=count)
            yield f"hysim {method}", f"{count} substeps", lambda u, plant=plant: plant.response(u, 1.0 / RATE)
    yield "hysim default", "3 substeps", lambda u: PLANT.response(u, 1.0 / RATE)
    if (run := plain_c(folder)) is not None:
        for count in some(1, 2, 3, 4, 8, 16):
            yield "split in C", f"{count} substeps", lambda u, count=count: run(u, count)
    for kind, rates in (("compiled", compiled_derivative), ("Python", derivative)):
        for method in ("RK45", "LSODA", "DOP853"):
            for rtol in some(1e-5, 1e-7, 1e-8, 1e-9):
                solve = lambda u, m=method, r=rtol, f=rates: adaptive(u, m, r, f)  # noqa: E731
                yield f"solve_ivp {method}, {kind}", f"rtol {rtol:g}", solve
    for rtol in some(1e-5, 1e-7, 1e-9):
        yield "python-control", f"rtol {rtol:g}", lambda u, r=rtol: python_control(u, r)
    if not smoke and (at := diffrax_solver(u)) is not None:
        for rtol in (1e-5, 1e-7, 1e-8, 1e-9):
            yield "diffrax Dopri8", f"rtol {rtol:g}", at(rtol)


def timed(method: Method, u: np.ndarray, smoke: bool) -> tuple[np.ndarray, np.ndarray]:
    """Result and times [s], the first call not counted."""
    result, times = method(u), []
    while not times or (not smoke and len(times) < 101 and (sum(times) < 1.0 or len(times) < 3)):
        begin = time.perf_counter()
        method(u)
        times.append(time.perf_counter() - begin)
    return result, np.array(times)


def paired(first: Method, second: Method, u: np.ndarray) -> list[float]:
    """Quartiles of the first one's time over the second's, run in turns: close rivals on a machine that is shared."""
    quotients = []
    for _ in range(201):
        times = []
        for method in (first, second):
            begin = time.perf_counter()
            method(u)
            times.append(time.perf_counter() - begin)
        quotients.append(times[0] / times[1])
    return np.quantile(quotients, [0.25, 0.5, 0.75]).tolist()


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    u = hs.benchmarks.noel_schoukens(seed=1, periods=1).u[: 31 if smoke else 751].copy()
    fine, finer = (replace(PLANT, substeps=count).response(u, 1.0 / RATE) for count in (32, 64))
    rms = float(finer.std())
    rows: list[Row] = []
    facts: dict[str, float | list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, setting, method in contestants(u, smoke, Path(folder)):
            y, times = timed(method, u, smoke)
            low, median, high = np.quantile(times, [0.25, 0.5, 0.75])
            row: Row = {"method": name, "setting": setting, "error": float(np.abs(y - finer).max() / rms)}
            rows.append(
                row | {"ms": 1e3 * float(median), "spread_ms": 500.0 * float(high - low), "repeats": times.size}
            )
        if not smoke and (run := plain_c(Path(folder))) is not None:
            own = lambda u: PLANT.response(u, 1.0 / RATE)  # noqa: E731
            facts["default_over_c_quartiles"] = paired(own, lambda u: run(u, 3), u)
    if not smoke:
        self_difference = float(np.abs(fine - finer).max() / rms)
        independent = float(np.abs(restarted(u) - finer).max() / rms)
        facts |= {"reference_32_to_64": self_difference, "reference_to_independent": independent}
        write(rows, summary(rows) | facts)
    return rows


def summary(rows: list[Row]) -> dict[str, float]:
    """What the others cost at an error of 1e-6 or better, in times of the default."""
    own = next(row for row in rows if row["method"] == "hysim default")
    good = [row for row in rows if row["error"] <= 1e-6]
    peers = {"scipy": "solve_ivp", "diffrax": "diffrax", "control": "python-control"}
    fastest = {peer: [row["ms"] for row in good if row["method"].startswith(start)] for peer, start in peers.items()}
    ratios = {f"{peer}_over_default": min(times) / own["ms"] for peer, times in fastest.items() if times}
    return {"default_error": own["error"], "default_ms": own["ms"], **ratios}


def write(rows: list[Row], facts: dict[str, float | list[float]]) -> None:
    """Table, figure and JSON."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    with (RESULTS / "table.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    result = {"samples": 751, "seed": 1, **facts, "rows": rows}
    (RESULTS / "result.json").write_text(json.dumps(result, indent=2) + "\n")
    with house_style():
        save_svg(draw(rows), RESULTS / "figure.svg", name="oscillator")


def draw(rows: list[Row]) -> Figure:
    """Error against time, log-log, one line for each method."""
    canvas = figure(height=5.6)
    ax = canvas.add_subplot()
    names = [name for name in dict.fromkeys(row["method"] for row in rows) if name != "hysim default"]
    for k, name in enumerate(names):
        points = [(row["ms"], row["error"]) for row in rows if row["method"] == name]
        ax.loglog(*zip(*points, strict=True), color=f"C{k % 7}", marker="o^svDPX*<>hp"[k % 12], ms=4, lw=1, label=name)
    ax.set(xlabel="Time of one second of motion [ms]", ylabel="Largest error [rms of the displacement]")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, fontsize=8)
    return canvas


if __name__ == "__main__":
    for line in main():
        print(f"{line['method']:28} {line['setting']:12} {line['error']:.1e} {line['ms']:10.2f} ms")
