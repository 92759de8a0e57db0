"""How exact is LuGre friction with stiff bristles, what does it cost, and does it chatter?

First the law alone, along a given motion of long and short strokes in both directions, with bristles of 1e5 to 1e9 N/m;
each stroke is cut into eight samples. SciPy's solvers begin anew at each sample, as they must where the velocity jumps,
with tolerances of 1e-10; DOP853 is left out where a record would take it minutes. Beside them stands the classical
Runge-Kutta method with 100 steps a sample in a compiled loop, as simulators with a fixed step have it. The exact force
is the closed form with 40 digits. Chatter is counted as turns of the force inside strokes, along each of which the
exact force is monotone, by more than a millionth of the breakaway force; a run that is no longer finite has lost the
motion.

Then a mass that a spring pulls over a floor, as in C. Canudas de Wit, H. Olsson, K. J. Astrom and P. Lischinsky (IEEE
Trans. Automatic Control 40, 1995), as an `hs.Structure`, against the same solvers on the equations of the mass and the
bristles. The reference is LSODA at a tolerance of 1e-12; how far Radau at 1e-11 is from it is stated.

Times are processor times of whole calls, each in turns with hysim's.
"""

import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from mpmath import mp, mpf
from numba import njit
from scipy.integrate import solve_ivp

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "friction"
STIFFNESSES = (1e5, 1e6, 1e7, 1e8, 1e9)  # [N/m]
SOLVERS = ("DOP853", "Radau", "LSODA")
STIFFEST_EXPLICIT = 1e6  # [N/m], for DOP853: beyond, a record takes minutes
H = 1e-3  # [s], of a sample
PARTS = 8  # samples a stroke
TOLERANCE = 1e-10
FIXED_STEPS = 100  # a sample, of the Runge-Kutta method
CHATTER = 1e-6  # of the breakaway force
DIGITS = 40
PULL, SPRING, DURATION, PULLED_H = 0.1, 2.0, 20.0, 0.01  # [m/s], [N/m], [s], [s]
TOLERANCES = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11)  # of the structure
ACCURACIES = (1e-6, 1e-9)  # of the solvers
Array = np.ndarray
Row = dict[str, Any]


def law(sigma0: float) -> hs.LuGre:
    """The friction of the article, with bristles of another stiffness and the damping that goes with it."""
    return hs.LuGre(
        sigma0=sigma0, sigma1=float(np.sqrt(sigma0)), sigma2=0.4, coulomb=1.0, breakaway=1.5, stribeck_velocity=0.001
    )


def motion(friction: hs.LuGre, n_strokes: int) -> Array:
    """Strokes of a tenth of the bristles' deflection to a millimetre, of random direction."""
    rng = np.random.default_rng(0)
    deflection = friction.breakaway / friction.sigma0
    lengths = 10.0 ** rng.uniform(np.log10(0.1 * deflection), -3.0, n_strokes) * rng.choice([-1.0, 1.0], n_strokes)
    corners = np.concatenate([[0.0], np.cumsum(lengths)])
    return np.interp(np.arange(PARTS * n_strokes + 1) / PARTS, np.arange(n_strokes + 1), corners)


def exact(friction: hs.LuGre, u: Array) -> Array:
    """Force at the samples, in closed form with many digits."""
    with mp.workdps(DIGITS):
        sigma0, sigma1, sigma2 = (mpf(x) for x in (friction.sigma0, friction.sigma1, friction.sigma2))
        z, force = mpf(0), [0.0]
        for before, now in pairwise(u.tolist()):
            v = (mpf(now) - mpf(before)) / mpf(H)
            g = 1 + mpf(0.5) * mp.exp(-((v / mpf(0.001)) ** 2))
            steady = mp.sign(v) * g / sigma0
            z = steady + (z - steady) * mp.exp(-sigma0 * abs(v) * mpf(H) / g)
            force.append(float(sigma0 * z + sigma1 * (v - sigma0 * abs(v) * z / g) + sigma2 * v))
    return np.array(force)


def by_solver(method: str, friction: hs.LuGre, u: Array) -> Array:
    """Force by a solver of SciPy that begins anew at each sample."""
    sigma0, z, force = friction.sigma0, 0.0, [0.0]
    for v in (np.diff(u) / H).tolist():
        decay = sigma0 * abs(v) / float(friction.friction(v))
        run = solve_ivp(
            lambda _, z, v=v, decay=decay: v - decay * z, (0.0, H), [z], method=method, rtol=TOLERANCE,
            atol=TOLERANCE * friction.breakaway / sigma0,
        )  # fmt: skip
        z = float(run.y[0, -1])
        force.append(sigma0 * z + friction.sigma1 * (v - decay * z) + friction.sigma2 * v)
    return np.array(force)


@njit(error_model="numpy")
def runge_kutta(rates: Array, decays: Array, h: float, steps: int, z: Array) -> None:
    """Deflections z by the classical Runge-Kutta method with equal steps."""
    h = h / steps
    for k in range(rates.size):
        now, v, decay = z[k], rates[k], decays[k]
        for _ in range(steps):
            a = v - decay * now
            b = v - decay * (now + 0.5 * h * a)
            c = v - decay * (now + 0.5 * h * b)
            d = v - decay * (now + h * c)
            now += h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        z[k + 1] = now


def by_fixed_steps(friction: hs.LuGre, u: Array) -> Array:
    """Force by the Runge-Kutta method."""
    v, z = np.diff(u) / H, np.zeros(u.size)
    decays = friction.sigma0 * np.abs(v) / friction.friction(v)
    with np.errstate(all="ignore"):
        runge_kutta(v, decays, H, FIXED_STEPS, z)
        force = friction.sigma0 * z[1:] + friction.sigma1 * (v - decays * z[1:]) + friction.sigma2 * v
    return np.concatenate([[0.0], force])


def turns(force: Array) -> int:
    """Turns of the force inside strokes, between the first sample of each and its end."""
    inside = force[1:].reshape(-1, PARTS)
    rises = np.diff(inside, axis=1)
    large = np.abs(rises) > CHATTER * 1.5
    return int(np.count_nonzero((rises[:, 1:] * rises[:, :-1] < 0.0) & large[:, 1:] & large[:, :-1]))


def seconds(run: Callable[[], Any], repeats: int) -> float:
    """Processor time of a call, from as many calls in a row."""
    begin = time.process_time()
    for _ in range(repeats):
        run()
    return (time.process_time() - begin) / repeats


def in_turns(run: Callable[[], Any], own: Callable[[], Any], most: int, repeats: int = 200) -> tuple[float, float]:
    """Medians of the time of a call, and of its ratio to that of hysim's."""
    own()
    pairs = np.array([(seconds(run, 1), seconds(own, repeats)) for _ in range(most)])
    return float(np.median(pairs[:, 0])), float(np.median(pairs[:, 0] / pairs[:, 1]))


def long_record() -> float:
    """Processor time of a sample by hysim, the law alone, where a call has many [ns]."""
    friction = law(1e5)
    u = np.tile(motion(friction, 40), 500)
    friction.response(u, H)
    return 1e9 * seconds(lambda: friction.response(u, H), 20) / u.size


def row(problem: str, method: str, **others: Any) -> Row:
    """A row of the table."""
    blank = {"sigma0": None, "setting": None, "error": None, "turns": None, "ns_per_sample": None, "times_hysim": None}
    return {"problem": problem, "method": method, **blank, **others}


def alone(sigma0: float, n_strokes: int, most: int) -> list[Row]:
    """The law alone, by every method."""
    friction = law(sigma0)
    u = motion(friction, n_strokes)
    expected = exact(friction, u)

    def own() -> Array:
        return friction.response(u, H)

    methods = {
        "hysim": own,
        **{
            name: lambda name=name: by_solver(name, friction, u)
            for name in SOLVERS
            if name != "DOP853" or sigma0 <= STIFFEST_EXPLICIT
        },
        f"Runge-Kutta, {FIXED_STEPS} steps": lambda: by_fixed_steps(friction, u),
    }
    rows = []
    for method, run in methods.items():
        force = run()
        error = float(np.abs(force - expected).max() / friction.breakaway) if np.isfinite(force).all() else None
        taken, ratio = (seconds(own, 200), 1.0) if method == "hysim" else in_turns(run, own, most)
        rows.append(
            row("law alone", method, sigma0=sigma0, error=error, turns=turns(force) if error is not None else None,
                ns_per_sample=1e9 * taken / u.size, times_hysim=ratio)
        )  # fmt: skip
    return rows


# ---------------------------------------------------------------------------------- a mass that is pulled


def equations(t: float, s: Array) -> list[float]:
    """Rates of displacement, velocity and deflection of the mass of the article."""
    x, v, z = s
    g = 1.0 + 0.5 * np.exp(-((v / 0.001) ** 2))
    bristles = v - 1e5 * abs(v) * z / g
    return [v, SPRING * (PULL * t - x) - (1e5 * z + np.sqrt(1e5) * bristles + 0.4 * v), bristles]


def pulled_by_solver(method: str, tolerance: float, t: Array) -> Array:
    """Displacement at the samples by a solver of SciPy, the force being smooth."""
    allowed = tolerance * np.array([1.0, 1.0, 1e-5])
    run = solve_ivp(equations, (0.0, t[-1]), np.zeros(3), method=method, t_eval=t, rtol=tolerance, atol=allowed)
    return np.asarray(run.y[0])


def pulled_mass(tolerance: float) -> hs.Structure:
    """The mass of the article."""
    element = hs.Element(law(1e5), between=(0, 1))
    return hs.Structure(mass=1.0, stiffness=SPRING, elements=element, excitation="force", tolerance=tolerance)


def pulled(duration: float, most: int) -> tuple[list[Row], float, Array, Array]:
    """The pulled mass by every method; how sure the reference is, times and displacements."""
    t = PULLED_H * np.arange(round(duration / PULLED_H) + 1)
    force = SPRING * PULL * t
    expected = pulled_by_solver("LSODA", 1e-12, t)
    sure = float(np.abs(pulled_by_solver("Radau", 1e-11, t) - expected).max() / expected.max())

    def own() -> Array:
        return pulled_mass(1e-10).response(force, PULLED_H)

    def judged(method: str, setting: float, run: Callable[[], Array]) -> Row:
        error = float(np.abs(run() - expected).max() / expected.max())
        taken, ratio = in_turns(run, own, most, repeats=5)
        numbers = {"error": error, "ns_per_sample": 1e9 * taken / t.size, "times_hysim": ratio}
        return row("pulled mass", method, sigma0=1e5, setting=setting, **numbers)

    rows = [judged("hysim", tol, lambda tol=tol: pulled_mass(tol).response(force, PULLED_H)) for tol in TOLERANCES]
    rows += [
        judged(name, tol, lambda name=name, tol=tol: pulled_by_solver(name, tol, t))
        for name in SOLVERS
        for tol in ACCURACIES
    ]
    return rows, sure, t, expected


def main(smoke: bool = False) -> list[Row]:
    """Compare, print, and unless it is a smoke run write table, figure and JSON."""
    stiffnesses, n_strokes = ((1e5,), 2) if smoke else (STIFFNESSES, 40)
    rows = [each for sigma0 in stiffnesses for each in alone(sigma0, n_strokes, 1 if smoke else 3)]
    if smoke:
        return rows
    more, sure, t, x = pulled(DURATION, 3)
    rows += more
    report(rows)
    numbers = {
        "n_samples": PARTS * n_strokes, "tolerance": TOLERANCE, "chatter": CHATTER, "reference_sure_to": sure,
        "own_tolerance_of_times": 1e-10, "ns_per_sample_of_long_records": long_record(),
    }  # fmt: skip
    write_results(RESULTS, rows, lambda rows: draw(rows, t, x), numbers)
    print(f"{numbers['ns_per_sample_of_long_records']:.3g} ns a sample of long records; reference sure to {sure:.1e}")
    return rows


def report(rows: list[Row]) -> None:
    """Print the rows."""
    for each in rows:
        error = "lost" if each["error"] is None else f"{each['error']:.1e}"
        print(
            f"{each['problem']:>12} {each['sigma0']:.0e} {each['method']:>22} {each['setting'] or '':>6} "
            f"error {error}, "
            f"turns {each['turns']}, {each['ns_per_sample']:.3g} ns a sample, {each['times_hysim']:.3g} times hysim"
        )


COLOURS = {"hysim": "#D55E00", "DOP853": "#0072B2", "Radau": "#009E73", "LSODA": "#E69F00"}


def draw(rows: list[Row], t: Array, x: Array) -> Figure:
    """Cost by stiffness of the bristles; the pulled mass, and error by cost."""
    canvas = figure(height=3.4, width=9.0)
    cost, slip, both = canvas.subplots(1, 3)
    for method in dict.fromkeys(row["method"] for row in rows):
        colour = COLOURS.get(method, "#777777")
        own = [row for row in rows if row["method"] == method and row["problem"] == "law alone"]
        cost.loglog([r["sigma0"] for r in own], [r["ns_per_sample"] for r in own], "o-", color=colour, label=method)
        own = [row for row in rows if row["method"] == method and row["problem"] == "pulled mass"]
        if own:
            both.loglog([r["ns_per_sample"] for r in own], [r["error"] for r in own], "o-", color=colour)
    cost.set(xlabel="Stiffness of the bristles [N/m]", ylabel="Time of a sample [ns]", title="Law alone")
    slip.plot(t, PULL * t, color="#777777", label="end of the spring")
    slip.plot(t, x, color="#0072B2", label="mass")
    slip.set(xlabel="Time [s]", ylabel="Displacement [m]", title="Pulled mass")
    slip.legend(frameon=False)
    both.set(xlabel="Time of a sample [ns]", ylabel="Error of the displacement", title="Pulled mass")
    canvas.legend(*cost.get_legend_handles_labels(), loc="outside upper center", ncols=5, frameon=False)
    return canvas


if __name__ == "__main__":
    main()
