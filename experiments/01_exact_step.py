"""What does exactness cost? The Bouc-Wen law by hysim and by what scripts use, each with its error and time.

One two-tone input, linear between its samples, n = 1, 1.5 and 2. The errors are against a 30-digit evaluation
of the closed forms (mpmath), in units of the memory's range; the times are medians over repeats in one run.
"""

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import mpmath
import numpy as np
from scipy.integrate import solve_ivp

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "exact_step"
BETA, GAMMA = 0.6, 0.3


def two_tone(n_samples: int) -> np.ndarray:
    """Two sines of incommensurate frequencies, so that minor loops of every size occur."""
    t = np.linspace(0.0, 20.0, n_samples)
    return np.sin(2.1 * t) + 0.6 * np.sin(7.3 * t)


def reference(u: np.ndarray, n: float) -> np.ndarray:
    """Memory by the closed form of each branch, solved by Newton's method with 30 digits."""
    z = [mpmath.mpf(0)]
    with mpmath.workdps(30):
        for du in np.diff(u):
            z.append(_step(z[-1], mpmath.mpf(float(du)), mpmath.mpf(n)))
    return np.array([float(value) for value in z])


def _step(z: mpmath.mpf, du: mpmath.mpf, n: mpmath.mpf) -> mpmath.mpf:
    """One monotone stretch: T_c(w) is the length from 0 to w on dw/dL = 1 - c w^n."""

    def length_to(w: mpmath.mpf, c: mpmath.mpf) -> mpmath.mpf:
        return w * mpmath.hyp2f1(1, 1 / n, 1 + 1 / n, c * w**n)

    s, d = mpmath.mpf(BETA + GAMMA), mpmath.mpf(GAMMA - BETA)
    direction, left = mpmath.sign(du), abs(du)
    along = direction * z
    if along < 0:
        to_zero = length_to(-along, d)
        if left <= to_zero:
            return -direction * _inverse(lambda w: length_to(w, d), d, n, to_zero - left, -along)
        along, left = mpmath.mpf(0), left - to_zero
    return direction * _inverse(lambda w: length_to(w, s), s, n, length_to(along, s) + left, along)


def _inverse(length_to: Callable, c: mpmath.mpf, n: mpmath.mpf, length: mpmath.mpf, w: mpmath.mpf) -> mpmath.mpf:
    for _ in range(60):
        change = (length_to(w) - length) * (1 - c * w**n)
        w = abs(w - change)
        if abs(change) < mpmath.mpf(10) ** -28:
            break
    return w


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


def adaptive(u: np.ndarray, n: float, method: str, rtol: float) -> np.ndarray:
    """`solve_ivp` over the whole record, the velocity constant between samples."""
    rates = np.append(np.diff(u), 0.0)

    def right_hand_side(t: float, z: np.ndarray) -> np.ndarray:
        v = rates[int(t)]
        return v - np.abs(z) ** n * (GAMMA * v + BETA * v * np.sign(z * v))

    return solve_ivp(right_hand_side, (0, u.size - 1), [0.0], method, t_eval=np.arange(u.size), rtol=rtol, atol=rtol).y[
        0
    ]


METHODS: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "hysim": lambda u, n: hs.BoucWen(beta=BETA, gamma=GAMMA, n=n).memory(u),
    "forward Euler": euler,
    "Runge-Kutta 4": runge_kutta,
    "solve_ivp RK45, 1e-3": lambda u, n: adaptive(u, n, "RK45", 1e-3),
    "solve_ivp RK45, 1e-6": lambda u, n: adaptive(u, n, "RK45", 1e-6),
    "solve_ivp LSODA, 1e-6": lambda u, n: adaptive(u, n, "LSODA", 1e-6),
}


def timed(method: Callable[[], np.ndarray], repeats: int) -> tuple[np.ndarray, float]:
    """Result and median time [s], the first call not counted."""
    result, times = method(), []
    for _ in range(repeats):
        begin = time.perf_counter()
        method()
        times.append(time.perf_counter() - begin)
    return result, statistics.median(times)


def main(smoke: bool = False) -> list[dict[str, float | str]]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    n_samples, repeats = (31, 1) if smoke else (5001, 5)
    u = two_tone(n_samples)
    rows: list[dict[str, float | str]] = []
    for n in (1.0, 1.5, 2.0):
        exact = reference(u, n)
        for name, method in METHODS.items():
            z, seconds = timed(lambda method=method, n=n: method(u, n), repeats)
            error = float(np.abs(z - exact).max() / np.ptp(exact))
            rows.append({"n": n, "method": name, "error": error, "ns_per_sample": 1e9 * seconds / n_samples})
        own = rows[-len(METHODS)]["ns_per_sample"]
        for row in rows[-len(METHODS) :]:
            row["time_ratio"] = row["ns_per_sample"] / own
    if not smoke:
        write(rows, n_samples)
    return rows


def write(rows: list[dict[str, float | str]], n_samples: int) -> None:
    """Table, figure and JSON."""
    write_results(RESULTS, rows, draw, {"samples": n_samples, "beta": BETA, "gamma": GAMMA})


def draw(rows: list[dict[str, float | str]]) -> Figure:
    """Error against time, log-log."""
    canvas = figure(height=4.4)
    ax = canvas.add_subplot()
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
