"""A mass on a Bouc-Wen spring, driven by one second of the Noel-Schoukens multisine at 750 Hz.

    m y'' + c y' + k y + z = u,     z' = A y' - beta |y'| z - gamma y' |z|

The force is linear between its samples. The tolerances of the adaptive methods are absolute in units of what
each state reaches.
"""

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import control
import numba
import numpy as np
from scipy.integrate import odeint, solve_ivp

import hysim as hs
from peers.contest import Contestant, Run, compiled_c, peer

SOURCE = Path(__file__).parents[1] / "oscillator.c"
RATE = 750.0
MASS, DAMPING, STIFFNESS, A, BETA, GAMMA = 2.0, 10.0, 5e4, 5e4, 800.0, -1100.0
SCALES = np.array([1e-3, 0.2, 50.0])
PLANT = replace(hs.benchmarks.noel_schoukens_plant(), method="split", substeps=None)
DEFAULT_SUBSTEPS = 3


def force(n_samples: int) -> np.ndarray:
    """The input."""
    return hs.benchmarks.noel_schoukens(seed=1, periods=1).u[:n_samples].copy()


def response(u: np.ndarray, method: str = "split", substeps: int | None = None) -> Run:
    """hysim's displacement; by default, as anyone gets it."""
    plant = replace(PLANT, method=method, substeps=substeps)
    return lambda: plant.response(u, 1.0 / RATE)


def rates(t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Rates of (y, y', z)."""
    k = min(int(t * RATE), u.size - 2)
    force = u[k] + (t * RATE - k) * (u[k + 1] - u[k])
    y, v, z = x
    acceleration = (force - DAMPING * v - STIFFNESS * y - z) / MASS
    return np.array([v, acceleration, v * A - BETA * abs(v) * z - GAMMA * v * abs(z)])


compiled_rates = numba.njit(rates)


def restarted(u: np.ndarray) -> np.ndarray:
    """DOP853 near its tightest, begun anew at every sample: slow, and independent of hysim."""
    x, y = np.zeros(3), [0.0]
    for k in range(u.size - 1):
        options = {"rtol": 1e-12, "atol": 1e-13 * SCALES, "args": (u[k : k + 2],)}
        x = solve_ivp(compiled_rates, (0.0, 1.0 / RATE), x, "DOP853", **options).y[:, -1]
        y.append(x[0])
    return np.array(y)


# ---------------------------------------------------------------------------------- contestants


def contestants(u: np.ndarray, folder: Path, smoke: bool) -> Iterator[Contestant]:
    """Every method at every setting, from coarse to fine, hysim's default first."""
    yield Contestant("hysim", "hysim default", f"{DEFAULT_SUBSTEPS} substeps", response(u))
    groups = [schemes(u, smoke), plain_c(u, folder, smoke), scipy(u, smoke), python_control(u, smoke)]
    groups += [sundials(u, smoke)] + ([] if smoke else [diffrax(u)])
    for group in groups:
        yield from group


def schemes(u: np.ndarray, smoke: bool) -> Iterator[Contestant]:
    """hysim's four methods."""
    for method in ("split", "strang", "runge-kutta", "newmark"):
        counts = (1, 2, 3, 4, 8, 16) if method == "split" else (1, 4, 16, 64, 256)
        for count in counts[:1] if smoke else counts:
            tool = "hysim" if method == "split" else "hysim, other schemes"
            yield Contestant(tool, f"hysim {method}", f"{count} substeps", response(u, method, count))


def plain_c(u: np.ndarray, folder: Path, smoke: bool) -> Iterator[Contestant]:
    """The method "split" in C."""
    if (library := compiled_c(SOURCE, folder)) is None:
        return
    array = np.ctypeslib.ndpointer(dtype=np.float64, flags="C")
    path, plant, y = library.path, np.array([MASS, DAMPING, STIFFNESS, A, BETA, GAMMA]), np.empty(u.size)
    path.argtypes, path.restype = [array, ctypes.c_int, ctypes.c_double, array, ctypes.c_long, array], None

    def run(substeps: int) -> np.ndarray:
        path(plant, substeps, 1.0 / RATE, u, u.size, y)
        return y

    for count in (1, 2, 3, 4, 8, 16)[: 1 if smoke else 6]:
        yield Contestant("C", "split in C", f"{count} substeps", lambda c=count: run(c))


def scipy(u: np.ndarray, smoke: bool) -> Iterator[Contestant]:
    """`solve_ivp` over the whole record and, with less between it and the same LSODA, `odeint`."""
    t = np.arange(u.size) / RATE

    def solve(function: Callable, method: str, rtol: float) -> np.ndarray:
        options = {"t_eval": t, "rtol": rtol, "atol": rtol * SCALES, "args": (u,)}
        return solve_ivp(function, (0.0, t[-1]), np.zeros(3), method, **options).y[0]

    def lsoda(rtol: float) -> np.ndarray:
        return odeint(compiled_rates, np.zeros(3), t, (u,), rtol=rtol, atol=rtol * SCALES, tfirst=True)[:, 0]

    settings = (1e-5,) if smoke else (1e-5, 1e-7, 1e-8, 1e-9)
    for kind, function in (("compiled", compiled_rates), ("Python", rates)):
        for method in ("RK45", "LSODA", "DOP853"):
            for rtol in settings:
                run = lambda f=function, m=method, r=rtol: solve(f, m, r)  # noqa: E731
                yield Contestant(f"SciPy, {kind}", f"solve_ivp {method}, {kind}", f"rtol {rtol:g}", run)
    for rtol in settings:
        yield Contestant("SciPy, compiled", "odeint, compiled", f"rtol {rtol:g}", lambda r=rtol: lsoda(r))


def python_control(u: np.ndarray, smoke: bool) -> Iterator[Contestant]:
    """`input_output_response`, which is `solve_ivp` RK45 beneath."""

    def update(t: float, x: np.ndarray, force: np.ndarray, parameters: dict) -> list[float]:
        y, v, z = x
        acceleration = (force[0] - DAMPING * v - STIFFNESS * y - z) / MASS
        return [v, acceleration, v * A - BETA * abs(v) * z - GAMMA * v * abs(z)]

    system = control.nlsys(update, lambda t, x, force, parameters: x[0], inputs=1, outputs=1, states=3)
    t = np.arange(u.size) / RATE

    def run(rtol: float) -> np.ndarray:
        options = {"rtol": rtol, "atol": rtol * SCALES}
        return np.asarray(control.input_output_response(system, t, u, solve_ivp_kwargs=options).outputs)

    for rtol in (1e-5, 1e-7, 1e-9)[: 1 if smoke else 3]:
        yield Contestant("python-control", "python-control", f"rtol {rtol:g}", lambda r=rtol: run(r))


def sundials(u: np.ndarray, smoke: bool) -> Iterator[Contestant]:
    """CVODE by scikit-sundae, with a compiled right-hand side."""
    if (cvode := peer("sksundae.cvode")) is None:
        return
    t = np.arange(u.size) / RATE

    def into(t: float, x: np.ndarray, out: np.ndarray) -> None:
        out[:] = compiled_rates(t, x, u)

    def run(method: str, rtol: float) -> np.ndarray:
        solver = cvode.CVODE(into, method=method, rtol=rtol, atol=rtol * SCALES, max_num_steps=10**7)
        return np.asarray(solver.solve(t, np.zeros(3)).y)[:, 0]

    for method in ("Adams", "BDF"):
        for rtol in (1e-5, 1e-7, 1e-8, 1e-9)[: 1 if smoke else 4]:
            solve = lambda m=method, r=rtol: run(m, r)  # noqa: E731
            yield Contestant("CVODE", f"CVODE {method}, compiled", f"rtol {rtol:g}", solve)


def diffrax(u: np.ndarray) -> Iterator[Contestant]:
    """Tsit5 and Dopri8, 64 bits, jitted."""
    if (dfx := peer("diffrax")) is None:
        return
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    t, pull = jnp.arange(u.size) / RATE, jnp.asarray(u)

    def rates(time: jax.Array, x: jax.Array, u: jax.Array) -> jax.Array:
        k = jnp.clip((time * RATE).astype(int), 0, u.size - 2)
        force = u[k] + (time * RATE - k) * (u[k + 1] - u[k])
        y, v, z = x
        acceleration = (force - DAMPING * v - STIFFNESS * y - z) / MASS
        return jnp.stack([v, acceleration, v * A - BETA * jnp.abs(v) * z - GAMMA * v * jnp.abs(z)])

    def solver(method: object, rtol: float) -> Run:
        controller = dfx.PIDController(rtol=rtol, atol=jnp.asarray(rtol * SCALES))

        @jax.jit
        def solve(force: jax.Array) -> jax.Array:
            term, saved = dfx.ODETerm(rates), dfx.SaveAt(ts=t)
            return dfx.diffeqsolve(
                term, method, t[0], t[-1], 1e-4, jnp.zeros(3), force,
                saveat=saved, stepsize_controller=controller, max_steps=10**7,
            ).ys[:, 0]  # fmt: skip

        return lambda: np.asarray(solve(pull))

    for method in (dfx.Tsit5(), dfx.Dopri8()):
        for rtol in (1e-5, 1e-7, 1e-8, 1e-9, 1e-10):
            name = f"diffrax {type(method).__name__}"
            yield Contestant("diffrax", name, f"rtol {rtol:g}", solver(method, rtol))
