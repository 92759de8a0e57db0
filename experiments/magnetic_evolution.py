"""Fits of a hand-written Jiles-Atherton law by SciPy's differential evolution: what hysim's fits are held against.

The law is its differential equation in H (`magnetic_reference`), integrated by the classical Runge-Kutta rule with at
least 200 steps a branch; nothing of it is hysim's. A measured cycle is run until it ends as it began, and the offset of
the flux meter is a mean. The coordinates are log(Ms / M), log(a / H), alpha M / H, log(k / H) and c, with M and H the
largest magnetisation and field that were measured.

Differential evolution has SciPy's own settings, apart from a narrower tolerance, and is begun anew with another seed
whenever it has converged, until the time is spent. Each run is stored as it ends, so that a search that was stopped
goes on with the next seed.
"""

import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from magnetic_reference import Core, runge_kutta_step, susceptibility
from numba import njit
from results_folder import append_lines, stored_lines
from scipy.optimize import OptimizeResult, differential_evolution

MU0 = 4e-7 * math.pi
STEPS = 200  # a branch, at least
MOST_CYCLES = 20
CONTRACTING = 0.99  # of the change of the cycle before
CLOSED = 1e-7  # of Ms: how close a cycle ends to where it began
BOX = ((math.log(0.9), math.log(30.0)), (math.log(1e-3), math.log(100.0)), (-1.0, 10.0),
       (math.log(1e-3), math.log(30.0)), (0.0, 0.99))  # fmt: skip
TOLERANCE = 1e-6
Array = np.ndarray[Any, np.dtype[Any]]


class Loop(NamedTuple):
    """One measured cycle, and the steps between two of its samples."""

    H: Array
    B: Array
    steps: int


def loop_of(H: Array, B: Array) -> Loop:
    """A cycle of two branches."""
    return Loop(H, B, math.ceil(2 * STEPS / (H.size - 1)))


@njit
def moved(core: Core, start: float, end: float, M: float, steps: int) -> float:
    """M after a stroke, by the classical Runge-Kutta rule."""
    if end == start:
        return M
    h = (end - start) / steps
    for k in range(steps):
        M = runge_kutta_step(susceptibility, core, start + k * h, M, h)
    return M


@njit
def steady_cycle(core: Core, H: Array, steps: int) -> Array:
    """M along a cycle that ends as it began, from a demagnetised core on; nan where it comes to none.

    The end of a cycle is nearly a straight line in its beginning: every second cycle begins where this line is met.
    """
    cycle = np.empty(H.size)
    M, change = moved(core, 0.0, H[0], 0.0, STEPS), math.nan
    for _ in range(MOST_CYCLES):
        cycle[0] = M
        for k in range(1, H.size):
            M = moved(core, H[k - 1], H[k], M, steps)
            cycle[k] = M
        if H[-1] != H[0]:
            M = moved(core, H[-1], H[0], M, steps)
        before, change = change, M - cycle[0]
        if not abs(change) > CLOSED * core.Ms:
            return cycle
        if abs(change) < CONTRACTING * abs(before):
            M, change = M + change * change / (before - change), math.nan
    return np.full(H.size, math.nan)


def errors(core: Core, loops: Sequence[Loop]) -> list[Array]:
    """Measured B less the law's, with the offset that fits best."""
    apart = [loop.B - MU0 * (loop.H + steady_cycle(core, loop.H, loop.steps)) for loop in loops]
    offset = float(np.concatenate(apart).mean())
    return [each - offset for each in apart]


def sum_of_squares(core: Core, loops: Sequence[Loop]) -> float:
    """Sum of squares [T^2], infinite for a law that this scheme cannot integrate."""
    with np.errstate(all="ignore"):
        total = sum(float(each @ each) for each in errors(core, loops))
    return total if math.isfinite(total) else math.inf


def core_at(x: Array, H: float, M: float) -> Core:
    """The law at a point of the box."""
    return Core(M * math.exp(x[0]), H * math.exp(x[1]), float(x[2]) * H / M, H * math.exp(x[3]), float(x[4]))


def evolve(loops: Sequence[Loop], seed: int, seconds: float) -> dict[str, Any]:
    """One run, until it has converged or its seconds of the processor are spent."""
    H = max(float(np.abs(loop.H).max()) for loop in loops)
    M = max(float(np.abs(loop.B).max()) for loop in loops) / MU0
    sum_of_squares(core_at(np.zeros(5), H, M), loops)  # which compiles what the clock is not for
    begin = time.process_time()
    course: list[tuple[float, float]] = []
    best: list[Any] = [math.inf, None]

    def spent() -> float:
        return time.process_time() - begin

    def cost(x: Array) -> float:
        value = sum_of_squares(core_at(x, H, M), loops)
        if value < best[0]:
            best[:] = value, core_at(x, H, M)
            course.append((spent(), value))
        return value

    def is_over(intermediate_result: OptimizeResult) -> bool:
        return spent() > seconds

    run = differential_evolution(
        cost, BOX, rng=seed, tol=TOLERANCE, maxiter=100_000, callback=is_over, polish=True, init="sobol"
    )
    return {
        "seed": seed, "seconds": spent(), "evaluations": int(run.nfev), "converged": spent() <= seconds,
        "cost": best[0], "core": best[1]._asdict(), "course": thinned(course),
    }  # fmt: skip


def thinned(course: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The improvements after which a hundredth of the time or of the sum of squares has gone, and the last."""
    kept = course[:1]
    for point in course[1:]:
        if point[1] < 0.99 * kept[-1][1]:
            kept.append(point)
    return kept if kept[-1] == course[-1] else [*kept, course[-1]]


def evolve_until(path: Path | None, name: str, loops: Sequence[Loop], seconds: float) -> list[dict[str, Any]]:
    """Runs on a set of records, until they have taken `seconds` of the processor together; stored in `path`, if any."""
    stored = [row for row in stored_lines(path) if row["set"] == name]
    runs = [{key: value for key, value in row.items() if key != "set"} for row in stored]
    while (rest := seconds - sum(run["seconds"] for run in runs)) > 0.0:
        runs.append(evolve(loops, len(runs), rest))
        append_lines(path, {"set": name, **runs[-1]})
    return runs
