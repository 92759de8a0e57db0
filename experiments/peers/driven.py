"""The driven law: the memory under two sines of incommensurate frequencies, by hysim and by what people use.

    dz/dt = du/dt (1 - |z|^n (gamma + beta sign(z du/dt))),     z = 0 at first

The input is linear between its samples, and time is counted in samples, so that no method misses a kink by
rounding. Some methods are also given the sines themselves: the smooth input turns between samples, so that its
memory is another one, and their errors are measured against that one.
"""

import ctypes
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import control
import numba
import numpy as np
from scipy.integrate import odeint, solve_ivp
from scipy.optimize import brentq

import hysim as hs
from peers.contest import Contestant, compiled_c, peer, steps

SOURCE = Path(__file__).parents[1] / "driven.c"
BETA, GAMMA = 0.6, 0.3
TONES = ((1.0, 2.1e-3), (0.6, 7.3e-3))
EXPONENTS = (1.0, 1.5, 2.0)


def two_tone(t: np.ndarray) -> np.ndarray:
    """The input at the times `t`, counted in samples."""
    return sum(size * np.sin(rate * t) for size, rate in TONES)


def law(n: float) -> hs.BoucWen:
    """The law of this problem."""
    return hs.BoucWen(beta=BETA, gamma=GAMMA, n=n)


# ---------------------------------------------------------------------------------- references


def reference(u: np.ndarray, n: float, digits: int = 30) -> np.ndarray | None:
    """Memory with so many digits by the closed form of each branch, for n = 1, 1.5 and 2."""
    if (mpmath := peer("mpmath")) is None:
        return None
    with mpmath.workdps(digits + 10):
        z = [mpmath.mpf(0)]
        for du in np.diff(u):
            z.append(_step(mpmath, z[-1], mpmath.mpf(float(du)), n, mpmath.mpf(10) ** -digits))
        return np.array([float(value) for value in z])


def _step(mp, z, du, n: float, tolerance):
    """One monotone stretch; s and d are the c of dw/dL = 1 - c w^n loading and, with L reversed, unloading."""
    s, d = mp.mpf(BETA + GAMMA), mp.mpf(GAMMA - BETA)
    direction, left = mp.sign(du), abs(du)
    along = direction * z
    if along < 0:
        to_zero = _length(mp, -along, d, n)
        if left <= to_zero:
            return -direction * _inverse(mp, to_zero - left, d, n, -along, tolerance)
        along, left = mp.mpf(0), left - to_zero
    return direction * _inverse(mp, _length(mp, along, s, n) + left, s, n, along, tolerance)


def _length(mp, w, c, n: float):
    """Length from 0 to w on dw/dL = 1 - c w^n."""
    if n == 1.0:
        return -mp.log(1 - c * w) / c
    if n == 2.0:
        root = mp.sqrt(abs(c))
        return (mp.atanh(root * w) if c > 0 else mp.atan(root * w)) / root
    scale = mp.sign(c) * mp.cbrt(abs(c))
    x, third = scale * mp.sqrt(w), mp.sqrt(3)
    arc = mp.atan((2 * x + 1) / third) - mp.atan(1 / third)
    return 2 / scale**2 * (mp.log(1 + x + x * x) / 6 - mp.log(1 - x) / 3 - arc / third)


def _inverse(mp, length, c, n: float, w, tolerance):
    """The w at which `_length` is `length`, by Newton's method from a neighbour."""
    for _ in range(60):
        change = (_length(mp, w, c, n) - length) * (1 - c * w ** mp.mpf(n))
        w = abs(w - change)
        if abs(change) < tolerance:
            break
    return w


def smooth_reference(t: np.ndarray, n: float) -> np.ndarray:
    """Memory at `t` under the sines themselves: hysim's, which is rate-independent, with the turning points put in."""
    rates = [smooth_rate(time) for time in t]
    turns = [brentq(smooth_rate, *t[k : k + 2]) for k, (a, b) in enumerate(pairwise(rates)) if a * b < 0.0]
    times = np.append(t, turns)
    order = np.argsort(times, kind="stable")
    z = np.empty(times.size)
    z[order] = law(n).memory(two_tone(times[order]))
    return z[: t.size]


# ---------------------------------------------------------------------------------- right-hand sides


def smooth_rate(t: float) -> float:
    """The derivative of the input."""
    return float(sum(size * rate * np.cos(rate * t) for size, rate in TONES))


def rates(t: float, z: np.ndarray, du: np.ndarray, n: float) -> np.ndarray:
    """dz/dt under the input of increments `du`."""
    rate = du[min(int(t), du.size - 1)]
    bend = GAMMA + BETA if z[0] * rate > 0.0 else GAMMA - BETA
    return np.array([rate * (1.0 - abs(z[0]) ** n * bend)])


def smooth_rates(t: float, z: np.ndarray, n: float) -> np.ndarray:
    """dz/dt under the sines."""
    rate = 2.1e-3 * np.cos(2.1e-3 * t) + 0.6 * 7.3e-3 * np.cos(7.3e-3 * t)
    bend = GAMMA + BETA if z[0] * rate > 0.0 else GAMMA - BETA
    return np.array([rate * (1.0 - abs(z[0]) ** n * bend)])


compiled_rates = numba.njit(rates)
compiled_smooth_rates = numba.njit(smooth_rates)


# ---------------------------------------------------------------------------------- contestants


def contestants(t: np.ndarray, n: float, folder: Path, smoke: bool) -> Iterator[Contestant]:
    """Every method at every setting, from coarse to fine, hysim first."""
    u = two_tone(t)
    own = law(n)
    yield Contestant("hysim", "hysim memory", "", lambda: own.memory(u))
    yield Contestant("hysim", "hysim response", "", lambda: own.response(u))
    groups = [plain_c(u, n, folder), scipy(t, u, n, smoke), python_control(t, n, smoke), opensees(u, n, smoke)]
    groups += [sundials(t, u, n, smoke)] + ([] if smoke else [diffrax(t, u, n)])
    for group in groups:
        yield from group


def plain_c(u: np.ndarray, n: float, folder: Path) -> Iterator[Contestant]:
    """The exact step, where it is elementary, and Runge-Kutta 4, `-O3 -march=native`."""
    if (library := compiled_c(SOURCE, folder)) is None:
        return
    array = np.ctypeslib.ndpointer(dtype=np.float64, flags="C")
    parameters, z = np.array([1.0, BETA, GAMMA, n]), np.empty(u.size)

    def prepared(name: str, *between: int) -> Callable[[], np.ndarray]:
        function = library[name]
        function.argtypes = [array, *[ctypes.c_int for _ in between], array, ctypes.c_long, array]
        function.restype = None

        def run() -> np.ndarray:
            function(parameters, *between, u, u.size, z)
            return z

        return run

    if n in (1.0, 2.0):
        yield Contestant("C", "exact step in C", "", prepared(f"exact_{n:.0f}"))
    for count in (1, 4, 16, 64):
        yield Contestant("C, Runge-Kutta 4", "Runge-Kutta 4 in C", steps(count), prepared("runge_kutta", count))


def scipy(t: np.ndarray, u: np.ndarray, n: float, smoke: bool) -> Iterator[Contestant]:
    """`solve_ivp` and, with less between it and the same LSODA, `odeint`."""
    du = np.diff(u)
    for kind, function in (("compiled", compiled_rates), ("Python", rates)):
        settings = {
            "RK45": (1e-3, 1e-5, 1e-6, 1e-7),
            "LSODA": (1e-3, 1e-5, 1e-6, 1e-8),
            "DOP853": (1e-3, 1e-6),
        }
        for method, tolerances in settings.items():
            for rtol in tolerances[:1] if smoke else tolerances if kind == "compiled" else tolerances[::2]:
                run = lambda m=method, r=rtol, f=function: _solve(f, t, m, r, (du, n))  # noqa: E731
                yield Contestant(f"SciPy, {kind}", f"solve_ivp {method}, {kind}", f"rtol {rtol:g}", run)
    for rtol in (1e-3, 1e-6, 1e-8)[: 1 if smoke else 3]:
        run = lambda r=rtol: odeint(compiled_rates, [0.0], t, (du, n), rtol=r, atol=r, tfirst=True)[:, 0]  # noqa: E731
        yield Contestant("SciPy, compiled", "odeint, compiled", f"rtol {rtol:g}", run)
    for rtol in (1e-3, 1e-6, 1e-9, 1e-11)[: 1 if smoke else 4]:
        run = lambda r=rtol: _solve(compiled_smooth_rates, t, "LSODA", r, (n,))  # noqa: E731
        method = "solve_ivp LSODA, compiled, smooth input"
        yield Contestant("SciPy, smooth input", method, f"rtol {rtol:g}", run, smooth=True)


def _solve(function: Callable, t: np.ndarray, method: str, rtol: float, arguments: tuple) -> np.ndarray:
    options = {"t_eval": t, "rtol": rtol, "atol": rtol, "args": arguments}
    return solve_ivp(function, (t[0], t[-1]), [0.0], method, **options).y[0]


def python_control(t: np.ndarray, n: float, smoke: bool) -> Iterator[Contestant]:
    """`input_output_response`, whose input is the derivative, linear between its samples."""

    def update(t: float, z: np.ndarray, rate: np.ndarray, parameters: dict) -> list[float]:
        bend = GAMMA + BETA if z[0] * rate[0] > 0.0 else GAMMA - BETA
        return [rate[0] * (1.0 - abs(z[0]) ** n * bend)]

    system = control.nlsys(update, lambda t, z, rate, parameters: z[0], inputs=1, outputs=1, states=1)
    rate = np.array([smooth_rate(time) for time in t])

    def run(rtol: float) -> np.ndarray:
        options = {"rtol": rtol, "atol": rtol}
        return np.asarray(control.input_output_response(system, t, rate, solve_ivp_kwargs=options).outputs)

    for rtol in (1e-3, 1e-6)[: 1 if smoke else 2]:
        yield Contestant("python-control", "python-control", f"rtol {rtol:g}", lambda r=rtol: run(r), smooth=True)


def opensees(u: np.ndarray, n: float, smoke: bool) -> Iterator[Contestant]:
    """`uniaxialMaterial BoucWen` in OpenSees' tester of materials: backward Euler, solved by Newton's method.

    Its stress is alpha k0 u + (1 - alpha) k0 z: with alpha = 0, k0 = 1, A0 = 1, no degradation and gamma before
    beta in the list it is z.
    """
    if (ops := peer("openseespy.opensees")) is None:
        return

    def run(count: int) -> np.ndarray:
        ops.wipe()
        ops.model("basic", "-ndm", 1, "-ndf", 1)
        ops.uniaxialMaterial("BoucWen", 1, 0.0, 1.0, n, GAMMA, BETA, 1.0, 0.0, 0.0, 0.0)
        ops.testUniaxialMaterial(1)
        fine = np.interp(np.arange((u.size - 1) * count + 1) / count, np.arange(u.size), u)
        stress = []
        for k, strain in enumerate(fine.tolist()):
            ops.setStrain(strain)
            if k % count == 0:
                stress.append(ops.getStress())
        return np.array(stress)

    for count in (1, 4, 16)[: 1 if smoke else 3]:
        yield Contestant("OpenSees", "OpenSees BoucWen", steps(count), lambda c=count: run(c))


def sundials(t: np.ndarray, u: np.ndarray, n: float, smoke: bool) -> Iterator[Contestant]:
    """CVODE by scikit-sundae, with a compiled right-hand side."""
    if (cvode := peer("sksundae.cvode")) is None:
        return
    du = np.diff(u)

    def into(t: float, z: np.ndarray, out: np.ndarray) -> None:
        out[:] = compiled_rates(t, z, du, n)

    def run(method: str, rtol: float) -> np.ndarray:
        solver = cvode.CVODE(into, method=method, rtol=rtol, atol=rtol, max_num_steps=10**7)
        return np.asarray(solver.solve(t, np.zeros(1)).y)[:, 0]

    for method in ("Adams", "BDF"):
        for rtol in (1e-3, 1e-6, 1e-7)[: 1 if smoke else 3]:
            solve = lambda m=method, r=rtol: run(m, r)  # noqa: E731
            yield Contestant("CVODE", f"CVODE {method}, compiled", f"rtol {rtol:g}", solve)


def diffrax(t: np.ndarray, u: np.ndarray, n: float) -> Iterator[Contestant]:
    """Tsit5 and Dopri8, 64 bits, jitted: adaptive, and a step a sample.

    The slope of the input is looked up by its index: twice as fast here as `LinearInterpolation.derivative`.
    """
    if (dfx := peer("diffrax")) is None:
        return
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    times, increments = jnp.asarray(t), jnp.asarray(np.diff(u))

    def rates(time: jax.Array, z: jax.Array, du: jax.Array) -> jax.Array:
        rate = du[jnp.minimum(time.astype(int), du.size - 1)]
        size = jnp.abs(z) if n == 1.0 else z * z if n == 2.0 else jnp.abs(z) ** n
        return rate * (1.0 - size * (GAMMA + BETA * jnp.sign(z * rate)))

    def solver(method: object, controller: object, first: float | None) -> Callable[[], np.ndarray]:
        @jax.jit
        def solve(du: jax.Array) -> jax.Array:
            term, saved = dfx.ODETerm(rates), dfx.SaveAt(ts=times)
            return dfx.diffeqsolve(
                term, method, times[0], times[-1], first, jnp.zeros(()), du,
                saveat=saved, stepsize_controller=controller, max_steps=10**8,
            ).ys  # fmt: skip

        return lambda: np.asarray(solve(increments))

    for method in (dfx.Tsit5(), dfx.Dopri8()):
        name = f"diffrax {type(method).__name__}"
        for rtol in (1e-3, 1e-6, 1e-8):
            run = solver(method, dfx.PIDController(rtol=rtol, atol=rtol), 1.0)
            yield Contestant("diffrax", name, f"rtol {rtol:g}", run)
        yield Contestant("diffrax", f"{name}, StepTo", steps(1), solver(method, dfx.StepTo(ts=times), None))
