"""What does exactness cost? The Bouc-Wen law by hysim and by what scripts use, each with its error and time.

One two-tone input, linear between its samples, n = 1, 1.5 and 2. The errors are against a 30-digit evaluation
of the closed forms (mpmath), in units of the memory's range; the times are those of the processor, medians over
repeats in one run. All integrators call the same right-hand side, in Python's own floats: NumPy's powers differ in
their last bit from one processor to another, and this is enough to change the error of LSODA, which is large after some
reversals of the input and not after others. How much is left to such chance is measured from starts that differ by less
than 1e-11.
"""

import statistics
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from peers.driven import BETA, EXPONENTS, GAMMA, law, reference
from results_folder import cpu_timed, one_panel, write_results

RESULTS = Path(__file__).parent / "results" / "exact_step"
STARTS = tuple(k * 1e-13 for k in range(-12, 13))  # of the memory, whose range is about 1


def two_tone(n_samples: int) -> np.ndarray:
    """Two sines of incommensurate frequencies, so that minor loops of every size occur."""
    t = np.linspace(0.0, 20.0, n_samples)
    return np.sin(2.1 * t) + 0.6 * np.sin(7.3 * t)


def slope(z: float, du: float, n: float) -> float:
    """dz/du."""
    return 1.0 - abs(z) ** n * (GAMMA + BETA * np.sign(z * du))


def euler(u: np.ndarray, n: float) -> np.ndarray:
    """Forward Euler, one step a sample: the usual script."""
    z = np.zeros(u.size)
    for k, du in enumerate(np.diff(u)):
        z[k + 1] = z[k] + slope(z[k], du, n) * du
    return z


def runge_kutta(u: np.ndarray, n: float) -> np.ndarray:
    """Classical Runge-Kutta, one step a sample."""
    z = np.zeros(u.size)
    for k, du in enumerate(np.diff(u)):
        a = slope(z[k], du, n)
        b = slope(z[k] + 0.5 * du * a, du, n)
        c = slope(z[k] + 0.5 * du * b, du, n)
        z[k + 1] = z[k] + du / 6.0 * (a + 2 * b + 2 * c + slope(z[k] + du * c, du, n))
    return z


def adaptive(u: np.ndarray, n: float, method: str, rtol: float, z0: float = 0.0) -> np.ndarray:
    """`solve_ivp` over the whole record, the velocity constant between samples."""
    rates = [*np.diff(u).tolist(), 0.0]

    def right_hand_side(t: float, z: np.ndarray) -> float:
        v = rates[int(t)]
        return v * slope(float(z[0]), v, n)

    return solve_ivp(right_hand_side, (0, u.size - 1), [z0], method, t_eval=np.arange(u.size), rtol=rtol, atol=rtol).y[
        0
    ]


METHODS: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "hysim": lambda u, n: law(n).memory(u),
    "forward Euler": euler,
    "Runge-Kutta 4": runge_kutta,
    "solve_ivp RK45, 1e-3": lambda u, n: adaptive(u, n, "RK45", 1e-3),
    "solve_ivp RK45, 1e-6": lambda u, n: adaptive(u, n, "RK45", 1e-6),
    "solve_ivp LSODA, 1e-6": lambda u, n: adaptive(u, n, "LSODA", 1e-6),
}


def timed(method: Callable[[], np.ndarray], repeats: int) -> tuple[np.ndarray, float]:
    """Result and median processor time [s], the first call not counted."""
    result = method()
    return result, statistics.median(cpu_timed(method)[1] for _ in range(repeats))


def main(smoke: bool = False) -> list[dict[str, float | str]]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    n_samples, repeats = (31, 1) if smoke else (5001, 5)
    u = two_tone(n_samples)
    rows: list[dict[str, float | str]] = []
    lsoda: list[dict[str, float]] = []
    for n in EXPONENTS:
        exact = reference(u, n)
        for name, method in METHODS.items():
            z, seconds = timed(lambda method=method, n=n: method(u, n), repeats)
            error = float(np.abs(z - exact).max() / np.ptp(exact))
            rows.append({"n": n, "method": name, "error": error, "ns_per_sample": 1e9 * seconds / n_samples})
        own = rows[-len(METHODS)]["ns_per_sample"]
        for row in rows[-len(METHODS) :]:
            row["time_ratio"] = row["ns_per_sample"] / own
        lsoda.append(spread(u, n, exact, STARTS[:1] if smoke else STARTS))
    numbers = {"samples": n_samples, "beta": BETA, "gamma": GAMMA, "lsoda_from_near_starts": lsoda}
    return write_results(RESULTS, rows, draw, numbers, smoke=smoke)


def spread(u: np.ndarray, n: float, exact: np.ndarray, starts: Sequence[float]) -> dict[str, float]:
    """Errors of LSODA from starts that differ by less than anything that it resolves."""
    errors = [np.abs(adaptive(u, n, "LSODA", 1e-6, z0) - exact).max() / np.ptp(exact) for z0 in starts]
    return {
        "n": n,
        "starts": len(starts),
        "least": float(min(errors)),
        "median": float(np.median(errors)),
        "most": float(max(errors)),
    }


def draw(rows: list[dict[str, float | str]]) -> Figure:
    """Error against time, log-log."""
    canvas, ax = one_panel(4.4)
    for name, marker in zip(METHODS, "*osv^D", strict=True):
        points = [(row["ns_per_sample"], row["error"]) for row in rows if row["method"] == name]
        ax.loglog(*zip(*points, strict=True), marker, label=name, markersize=11 if name == "hysim" else 6)
    ax.set(xlabel="Time a sample [ns]", ylabel="Largest error [share of the range]")
    ax.set_title("Each method at n = 1, 1.5 and 2")
    ax.legend(loc="lower right")
    return canvas


if __name__ == "__main__":
    for line in main():
        print(f"n = {line['n']:<4} {line['method']:24} {line['error']:.1e} {line['ns_per_sample']:10.0f} ns a sample")
