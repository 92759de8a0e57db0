"""Frames in earthquakes, by hysim, by OpenSees, by SciPy, and by plain loops of Newmark and Verlet.

The frames and their reference are those of `structure_cases`: storeys of Bouc-Wen springs, which OpenSees has as
`uniaxialMaterial BoucWen`, or bilinear ones, which it has as `Steel01`, each in a `zeroLength` element. Every method is
given the acceleration of the ground at the samples, linear between them, and is judged by its drifts at the samples.

OpenSees runs a whole earthquake in one call, `analyze(n, dt)`. Its drifts come from a recorder of every step's
displacements with 16 digits (its `-dT` is one step off); what is timed is this one call, without a recorder, without
building the model and without reading a file.
"""

import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
from scipy.integrate import odeint, solve_ivp
from structure_cases import Case

from peers import contest
from peers.contest import peer

Array = np.ndarray
Options = dict[str, Any]


@dataclass(frozen=True)
class Entry:
    """A method at one setting: its drifts (n, E), and the seconds of a run, measured by itself."""

    tool: str
    method: str
    setting: str
    drift: Callable[[], Array]
    seconds: Callable[[], float]


def clock(run: Callable[[], Any]) -> float:
    """Processor time of a call [s], which others on the machine lengthen less."""
    return contest.clock(run, time.process_time)


def timed(tool: str, method: str, setting: str, run: Callable[[], Array]) -> Entry:
    """A method whose run is timed whole."""
    return Entry(tool, method, setting, run, lambda: clock(run))


def substeps(count: int) -> str:
    """The setting of a method of fixed steps."""
    return f"{count} substep{'s' if count > 1 else ''}"


# ---------------------------------------------------------------------------------- hysim


OPTIONS: dict[str, Options] = {substeps(n): {"substeps": n} for n in (1, 2, 4, 8, 16)} | {
    f"tolerance {tolerance:g}": {"tolerance": tolerance} for tolerance in (1e-4, 1e-6, 1e-8, 1e-10)
}
"""Fixed substeps, and adaptive ones by their tolerance, of which 1e-8 is the default."""


def hysim(case: Case, smoke: bool) -> Iterator[Entry]:
    """Timed is `response`, one call for the whole record."""
    for setting, options in OPTIONS.items():
        if smoke and setting not in ("1 substep", "tolerance 1e-08"):
            continue
        plant = case.structure(**options)
        method = "hysim, fixed" if "substeps" in options else "hysim, adaptive"

        def drift(plant: Any = plant) -> Array:
            return np.asarray(plant.signals(case.ground, case.sample_time)["drift"])

        def run(plant: Any = plant) -> Array:
            return np.asarray(plant.response(case.ground, case.sample_time))

        yield Entry("hysim", method, setting, drift, lambda run=run: clock(run))


# ---------------------------------------------------------------------------------- OpenSees

OPENSEES: dict[str, Options] = {
    "Newmark, Newton": {
        "integrator": ("Newmark", 0.5, 0.25),
        "algorithm": "Newton",
        "test": ("NormDispIncr", 1e-6, 50),
    },
    "central difference": {"integrator": ("CentralDifference",), "algorithm": "Linear", "test": None},
}
EXACT: Options = {**OPENSEES["Newmark, Newton"], "test": ("NormDispIncr", 1e-14, 50)}
DIGITS = 16


def opensees_notes() -> dict[str, str]:
    """How OpenSees is run, in words."""
    ops = peer("openseespy.opensees")
    return {} if ops is None else {
        "version": str(ops.version()),
        "model": "ndm 1, ndf 1, zeroLength elements with -doRayleigh 1, Rayleigh damping of mass and initial stiffness",
        "solver": "constraints Plain, numberer Plain, system ProfileSPD",
        "settings": "; ".join(f"{name}: {options}" for name, options in OPENSEES.items()),
        "timed": "one analyze(n, dt) for the whole record, without recorder, model building and reading of files",
        "drifts": f"a Node recorder of every step with {DIGITS} digits, then every substeps-th row",
    }  # fmt: skip


def build(ops: Any, case: Case, options: Options, file: Path | None) -> None:
    """The frame in OpenSees, ready to be analysed."""
    n_nodes = len(case.masses)
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    for node in range(n_nodes + 1):
        ops.node(node, 0.0)
    ops.fix(0, 1)
    for node, mass in enumerate(case.masses, 1):
        ops.mass(node, mass)
    for tag, ((a, b), law) in enumerate(case.elements, 1):
        material(ops, tag, law)
        ops.element("zeroLength", tag, a, b, "-mat", tag, "-dir", 1, "-doRayleigh", 1)
    of_mass, of_stiffness = case.rayleigh
    ops.rayleigh(of_mass, 0.0, of_stiffness, 0.0)
    ops.timeSeries("Path", 1, "-dt", case.sample_time, "-values", *case.ground.tolist())
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("ProfileSPD")
    if options["test"]:
        ops.test(*options["test"])
    ops.algorithm(options["algorithm"])
    ops.integrator(*options["integrator"])
    ops.analysis("Transient")
    if file is not None:
        nodes = range(1, n_nodes + 1)
        ops.recorder("Node", "-file", str(file), "-precision", DIGITS, "-node", *nodes, "-dof", 1, "disp")


def material(ops: Any, tag: int, law: Any) -> None:
    """A law as OpenSees has it: Bouc-Wen with gamma before beta, or a bilinear spring."""
    fields = vars(law)
    if "gain" in fields:
        k = law.gain + law.feedthrough
        ops.uniaxialMaterial("BoucWen", tag, law.feedthrough / k, k, law.n, law.gamma, law.beta, law.A, 0.0, 0.0, 0.0)
    else:
        k = law.stiffness[0] + law.feedthrough
        ops.uniaxialMaterial("Steel01", tag, k * law.slips[0], k, law.feedthrough / k)


def analysed(ops: Any, case: Case, count: int) -> float:
    """Seconds of the analysis; RuntimeError if it does not converge."""
    begin = time.process_time()
    failed = ops.analyze((case.ground.size - 1) * count, case.sample_time / count)
    seconds = time.process_time() - begin
    if failed:
        raise RuntimeError(f"OpenSees' analysis ended with {failed}")
    return seconds


def opensees_drift(ops: Any, case: Case, options: Options, count: int) -> Array:
    """Drifts at the samples, from the recorder."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "displacements"
        build(ops, case, options, file)
        analysed(ops, case, count)
        ops.wipe()  # which ends the file
        rows = np.loadtxt(file, ndmin=2)[count - 1 :: count]
    x = np.vstack([np.zeros(rows.shape[1]), rows])
    return np.asarray(x[: case.ground.size] @ case.directions.T)


def opensees_seconds(ops: Any, case: Case, options: Options, count: int) -> float:
    """Seconds of one analysis, as its users get it fastest."""
    build(ops, case, options, None)
    return analysed(ops, case, count)


def opensees(case: Case, smoke: bool) -> Iterator[Entry]:
    """Two ways to run it, with more and more steps between two samples."""
    if (ops := peer("openseespy.opensees")) is None:
        return
    for name, options in OPENSEES.items():
        for count in (1, 4) if smoke else (1, 4, 16, 64):
            arguments = ops, case, options, count
            yield Entry(
                "OpenSees", f"OpenSees BoucWen, {name}", substeps(count),
                lambda a=arguments: opensees_drift(*a), lambda a=arguments: opensees_seconds(*a),
            )  # fmt: skip


# ---------------------------------------------------------------------------------- SciPy


def rates(
    t: float, y: Array, h: float, ground: Array, directions: Array, inverse: Array, C: Array, loads: Array, laws: Array
) -> Array:
    """Rates of displacements, velocities and memories of Bouc-Wen storeys; a row of `laws` is one of them."""
    n_masses, n_elements = inverse.shape[0], directions.shape[0]
    k = min(int(t / h), ground.size - 2)
    shake = ground[k] + (t / h - k) * (ground[k + 1] - ground[k])
    out = np.empty_like(y)
    force = -loads * shake
    for i in range(n_masses):
        out[i] = y[n_masses + i]
        for j in range(n_masses):
            force[i] -= C[i, j] * y[n_masses + j]
    for e in range(n_elements):
        d = v = 0.0
        for i in range(n_masses):
            d += directions[e, i] * y[i]
            v += directions[e, i] * y[n_masses + i]
        A, beta, gamma, n, feedthrough, gain = laws[e]
        z = y[2 * n_masses + e]
        power = abs(z) if n == 1.0 else z * z if n == 2.0 else abs(z) ** n
        out[2 * n_masses + e] = v * (A - power * (gamma + (beta if z * v > 0.0 else -beta)))
        f = feedthrough * d + gain * z
        for i in range(n_masses):
            force[i] -= directions[e, i] * f
    for i in range(n_masses):
        out[n_masses + i] = 0.0
        for j in range(n_masses):
            out[n_masses + i] += inverse[i, j] * force[j]
    return out


compiled_rates = numba.njit(rates)


def scipy(case: Case, smoke: bool) -> Iterator[Entry]:
    """DOP853 and LSODA over the whole record, the right side compiled; atol is rtol of what each state reaches."""
    fields = ("A", "beta", "gamma", "n", "feedthrough", "gain")
    laws = np.array([[vars(law)[name] for name in fields] for _, law in case.elements])
    n = len(case.masses)
    reach = 0.05
    sizes = np.concatenate([np.full(n, reach), np.full(n, 10.0 * reach), np.full(len(laws), 0.01)])
    parts = case.directions, np.linalg.inv(case.mass), case.damping, np.array(case.masses), laws
    arguments = case.sample_time, case.ground, *parts
    right_side = rates if smoke else compiled_rates

    def solve(method: str, rtol: float) -> Array:
        options = {"t_eval": case.times, "rtol": rtol, "atol": rtol * sizes, "args": arguments}
        y = solve_ivp(right_side, (0.0, case.times[-1]), np.zeros(sizes.size), method, **options).y
        return np.asarray(y[:n].T @ case.directions.T)

    def lsoda(rtol: float) -> Array:
        options = {"rtol": rtol, "atol": rtol * sizes, "tfirst": True, "mxstep": 10_000}
        y = odeint(right_side, np.zeros(sizes.size), case.times, arguments, **options)
        return np.asarray(y[:, :n] @ case.directions.T)

    for rtol in (1e-4,) if smoke else (1e-4, 1e-6, 1e-8):
        yield timed("SciPy", "solve_ivp DOP853, compiled", f"rtol {rtol:g}", lambda r=rtol: solve("DOP853", r))
        yield timed("SciPy", "odeint, compiled", f"rtol {rtol:g}", lambda r=rtol: lsoda(r))


# ---------------------------------------------------------------------------------- plain loops


@numba.njit(error_model="numpy")
def times(matrix: Array, x: Array, out: Array) -> None:
    """A product with a small matrix, for which a call of BLAS takes longer."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * x[j]
        out[i] = total


@numba.njit(error_model="numpy")
def newmark(
    step: Any, parameters: Array, states: Array, matrices: Array, B: Array, loads: Array, ground: Array,
    h: float, count: int, tolerance: float, out: Array,
) -> None:  # fmt: skip
    """Constant average acceleration; each step is iterated with the initial stiffness until nothing moves.

    `matrices` are those of x, x' and x'' on the right side, of x on the left side without the elements, and the inverse
    of the latter with their initial slopes; h is that of a substep. `loads` are those of a ground acceleration of one.
    """
    of_x, of_v, of_a, left, inverse = matrices[0], matrices[1], matrices[2], matrices[3], matrices[4]
    n, n_elements, trial = loads.size, B.shape[0], states.copy()
    x, v, new, f, d = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n_elements), np.zeros(n_elements)
    first, second, third, change = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    a = -np.ones(n) * ground[0]
    for k in range(1, ground.size):
        for part in range(1, count + 1):
            shake = ground[k - 1] + (ground[k] - ground[k - 1]) * (part / count)
            times(of_x, x, first)
            times(of_v, v, second)
            times(of_a, a, third)
            for i in range(n):
                first[i] += second[i] + third[i] + loads[i] * shake
                new[i] = x[i]
            for _ in range(200):
                trial[:] = states
                times(B, new, d)
                times(left, new, second)
                for i in range(n):
                    third[i] = first[i] - second[i]
                for e in range(n_elements):
                    f[e] = step(parameters[e], trial[e], d[e])
                    for i in range(n):
                        third[i] -= B[e, i] * f[e]
                times(inverse, third, change)
                moved = size = 0.0
                for i in range(n):
                    new[i] += change[i]
                    moved, size = max(moved, abs(change[i])), max(size, abs(new[i]))
                if moved <= tolerance * size:
                    break
            times(B, new, d)
            for e in range(n_elements):
                step(parameters[e], states[e], d[e])
            for i in range(n):
                move = new[i] - x[i]
                a[i] = 4.0 / h**2 * move - 4.0 / h * v[i] - a[i]
                v[i] = 2.0 / h * move - v[i]
                x[i] = new[i]
        times(B, x, out[k])


@numba.njit(error_model="numpy")
def verlet(
    step: Any, parameters: Array, states: Array, matrices: Array, B: Array, loads: Array, ground: Array,
    h: float, count: int, tolerance: float, out: Array,
) -> None:  # fmt: skip
    """Central differences; `matrices` are what the next x has of x, of the x before, and of the forces."""
    of_x, of_before, of_force = matrices[0], matrices[1], matrices[2]
    n, n_elements = loads.size, B.shape[0]
    x, after, d = np.zeros(n), np.empty(n), np.empty(n_elements)
    force, first, second, third = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    before = -0.5 * h * h * np.ones(n) * ground[0]
    for k in range(1, ground.size):
        for part in range(count):
            shake = ground[k - 1] + (ground[k] - ground[k - 1]) * (part / count)
            times(B, x, d)
            for i in range(n):
                force[i] = loads[i] * shake
            for e in range(n_elements):
                f = step(parameters[e], states[e], d[e])
                for i in range(n):
                    force[i] -= B[e, i] * f
            times(of_x, x, first)
            times(of_before, before, second)
            times(of_force, force, third)
            for i in range(n):
                after[i] = first[i] + second[i] + third[i]
            before, x, after = x, after, before
        times(B, x, out[k])


def plain(case: Case, loop: Any, count: int, tolerance: float = 1e-10, smoke: bool = False) -> Array:
    """Drifts at the samples by one of the two loops, with hysim's own step for each law; not compiled in smoke mode."""
    laws = [law.compiled() for _, law in case.elements]
    h = case.sample_time / count
    M, C, K, B = case.mass, case.damping, case.stiffness, case.directions
    if loop is newmark:
        left = 4.0 / h**2 * M + 2.0 / h * C + K
        inverse = np.linalg.inv(left + B.T @ np.diag(case.slopes) @ B)
        matrices = [4.0 / h**2 * M + 2.0 / h * C, 4.0 / h * M + C, M, left, inverse]
    else:
        inverse = np.linalg.inv(M + 0.5 * h * C)
        matrices = [inverse @ (2.0 * M - h * h * K), -inverse @ (M - 0.5 * h * C), h * h * inverse]
    parameters, states = (np.array([law[k] for law in laws]) for k in (1, 2))
    out = np.zeros((case.ground.size, len(laws)))
    shaken = parameters, states, np.array(matrices), B, -np.array(case.masses), case.ground
    (loop.py_func if smoke else loop)(laws[0].step, *shaken, h, count, tolerance, out)
    return out


def loops(case: Case, smoke: bool) -> Iterator[Entry]:
    """What one would write oneself: compiled, with the exact step of the law."""
    for name, loop in (("Newmark", newmark), ("Verlet", verlet)):
        for count in (1,) if smoke else (1, 4, 16, 64):
            run = lambda loop=loop, n=count: plain(case, loop, n, smoke=smoke)  # noqa: E731
            yield timed("plain loop", f"{name}, compiled", substeps(count), run)


def contestants(case: Case, smoke: bool) -> Iterator[Entry]:
    """Every method at every setting."""
    for group in (hysim, opensees, scipy, loops):
        yield from group(case, smoke)
