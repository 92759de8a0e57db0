"""How exact is the Jiles-Atherton law, forwards and driven by B, and how does its cost compare with explicit schemes?

Five questions, one run:

30 digits   Laws with an effective field H + alpha M, three strokes each, against an integration of dM/dH over H to
            30 digits (`magnetic_reference`), which shares nothing with hysim's step. Errors in units of the range.
invariant   More samples on a branch change nothing: hostile laws (`hostile_laws`), anisotropic ones and those that
            jump among them, and their inverses, by the tests of `more_samples`: roundings, and 1e-11 of the range.
round trip  Laws driven by B: the field is found for given outputs, and the law's response to it compared with them.
spellings   Laws by the constants of circuit simulators and of JAmodel, against the equations of these programs by the
            classical Runge-Kutta rule over H with 20 000 steps a stroke.
cost        Nanoseconds a sample of hysim, of Euler's rule and of the classical Runge-Kutta rule, as circuit codes
            integrate over H, all compiled by numba, with 200 and 2 000 steps a stroke. Times are processor times in
            turns with hysim's on the same samples. Errors are against hysim with these samples, which the first two
            questions check; that of hysim is its distance at the turning points from itself with one step a stroke.

30 digits take some seconds a law; the laws are spread over the cores.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import magnetic_reference as reference
from magnetic_reference import Circuit, Core, JAmodel, of_circuit, of_jamodel
from more_samples import draw_case, judged, response_run, runs, spread
from more_samples_inverse import inputs_for, inverse_verdict, wanted_case
from results_folder import cpu_timed, write_results

import hysim as hs
from hysim.plot import Figure, figure

RESULTS = Path(__file__).parent / "results" / "jiles_atherton"
N_DIGITS, N_INVARIANT, N_ROUND = 200, 10_000, 1_000
CHUNK = 250
STEPS = (20, 200, 2_000, 20_000)
TURNS = 5.0 * np.array([0.0, 1.0, -1.0, 0.6, -0.3, 1.0])  # in units of a
N_TIMED = 40_000  # samples of a timed run, at least
CORES = {
    "steel of 1986": Core(Ms=1.6e6, a=1100.0, alpha=1.6e-3, k=400.0, c=0.2),
    "ferrite": Core(Ms=4e5, a=50.0, alpha=2.8e-4, k=47.0, c=0.7),
    "upright": Core(Ms=1.3e6, a=60.0, alpha=1.3e-4, k=40.0, c=0.1),
}
SPELLINGS = {
    "circuit simulators": (of_circuit, Circuit(MS=4e5, A=25.0, K=20.0, C=0.25), hs.JilesAtherton.from_circuit),
    "JAmodel": (of_jamodel, JAmodel(60.0, 20.0, 0.2, 1e6, 1e-5, 0.0, 0.0), hs.JilesAtherton.from_jamodel),
    "JAmodel, anisotropic": (
        of_jamodel,
        JAmodel(60.0, 20.0, 0.2, 1e6, 1e-5, 300.0, 0.4),
        hs.JilesAtherton.from_jamodel,
    ),
}
SCHEMES = {"Euler": reference.euler, "Runge-Kutta 4": reference.runge_kutta}
Array = np.ndarray[Any, np.dtype[Any]]
Row = dict[str, Any]


def law_of(core: Core) -> hs.JilesAtherton:
    """The law with M as its output."""
    return hs.JilesAtherton(**core._asdict(), gain=1.0, feedthrough=0.0)


# ---------------------------------------------------------------------------------- 30 digits


def random_core(rng: np.random.Generator) -> Core:
    """A material in units of a and Ms that does not jump: alpha Ms / 3 a up to 0.9, or negative, or zero."""
    coupling = 3.0 * float(rng.choice([0.0, rng.uniform(-1.0, 0.0), rng.uniform(0.0, 0.9)], p=[0.2, 0.2, 0.6]))
    c = float(rng.choice([0.0, rng.uniform(0.0, 0.9)], p=[0.2, 0.8]))
    return Core(1.0, 1.0, coupling, float(10.0 ** rng.uniform(-1.0, 1.0)), c)


def digits_error(seed: int) -> float:
    """Largest error of one law at the ends of three strokes, in units of the range there."""
    rng = np.random.default_rng([42, seed])
    core, reach = random_core(rng), 10.0 ** rng.uniform(-0.7, 0.7)
    turns = reach * np.array([0.0, 1.0, -rng.uniform(0.2, 1.0), rng.uniform(-0.2, 1.0)])
    exact = np.array([float(M) for M in reference.Exact(core).magnetisation(turns)])
    return float(np.abs(law_of(core).response(turns) - exact).max() / np.ptp(exact))


# ---------------------------------------------------------------------------------- invariant, round trip


def invariant(first: int, count: int) -> list[tuple[str, float, str]]:
    """Way, ratio of the difference to what is allowed, and how each case ended."""
    found = []
    with np.errstate(all="ignore"):
        for seed in range(first, first + count):
            rng = np.random.default_rng([seed, 42])
            case = draw_case("JilesAtherton", rng)
            verdict = judged(case, runs(case, response_run), lambda case=case: spread(case))
            found.append(("forwards", verdict.ratio, verdict.end))
            back = inverse_verdict(wanted_case("JilesAtherton", rng), inputs_for)
            found.append(("inverse", back.ratio, back.end))
    return found


def round_trip(count: int) -> Array:
    """Largest distances of the outputs from those wanted, in units of the range, (count,)."""
    errors = np.empty(count)
    for seed in range(count):
        rng = np.random.default_rng([seed, 43])
        core = random_core(rng)
        law = hs.JilesAtherton(**core._asdict(), gain=1.0, feedthrough=float(10.0 ** rng.uniform(-6.0, 0.0)))
        y = law.response(10.0 ** rng.uniform(-1.0, 1.5) * np.append(0.0, rng.uniform(-1.0, 1.0, 100)))
        errors[seed] = np.abs(law.response(law.inverse_response(y)) - y).max() / np.ptp(y)
    return errors


# ---------------------------------------------------------------------------------- spellings


def spelling_errors(steps: int) -> dict[str, float]:
    """Largest distance of hysim's M from that of the other program's equation, in units of the range."""
    errors = {}
    for name, (slope, core, law_from) in SPELLINGS.items():
        fields = reference.strokes((core.A if isinstance(core, Circuit) else core.a) * TURNS, steps)
        M = law_from(**core._asdict()).magnetisation(fields)
        errors[name] = float(np.abs(reference.spelled(slope, core, fields) - M).max() / np.ptp(M))
    return errors


# ---------------------------------------------------------------------------------- cost


def cost_rows(smoke: bool) -> list[Row]:
    """Errors and times of each method, core and number of steps a stroke."""
    rows = []
    for name, core in list(CORES.items())[: 1 if smoke else None]:
        law = law_of(core)
        turns = core.a * TURNS
        for steps in STEPS[:1] if smoke else STEPS:
            fields = reference.strokes(turns, steps)
            exact, ends = law.response(fields), law.response(turns)
            inputs = np.tile(fields, max(1, (2_000 if smoke else N_TIMED) // fields.size))
            for method, scheme in {"hysim": None, **SCHEMES}.items():
                own = law.response if scheme is None else lambda u, scheme=scheme, core=core: scheme(core, u, 0.0)
                errors = own(fields) - exact if scheme is not None else exact[::steps] - ends
                turn = [(seconds(own, inputs), seconds(law.response, inputs)) for _ in range(1 if smoke else 7)]
                times = np.array(turn) / inputs.size
                rows.append({
                    "core": name, "method": method, "steps": steps,
                    "error": float(np.abs(errors).max() / np.ptp(exact)),
                    "ns_per_sample": float(np.median(1e9 * times[:, 0])),
                    "times_hysim": float(np.median(times[:, 0] / times[:, 1])),
                })  # fmt: skip
    return rows


def seconds(run: Any, inputs: Array) -> float:
    """Processor time of a call that is not the first."""
    run(inputs[:10])
    return cpu_timed(run, inputs)[1]


# ---------------------------------------------------------------------------------- results


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    rows = cost_rows(smoke)
    if smoke:
        digits, cases, trips = [digits_error(3)], invariant(0, 2), round_trip(2)
        spelling_errors(2)
    else:
        with ProcessPoolExecutor() as pool:
            digits = list(pool.map(digits_error, range(N_DIGITS)))
            chunks = pool.map(invariant, range(0, N_INVARIANT, CHUNK), [CHUNK] * (N_INVARIANT // CHUNK))
            cases = [each for chunk in chunks for each in chunk]
        trips = round_trip(N_ROUND)
    if not smoke:
        numbers = {
            "digits": {"laws": len(digits), "median": float(np.median(digits)), "worst": max(digits)},
            "digits_errors": sorted(digits),
            "invariant": {way: summary([each for each in cases if each[0] == way]) for way in ("forwards", "inverse")},
            "spellings": {"steps": STEPS[-1], "errors": spelling_errors(STEPS[-1])},
            "round_trip": {"laws": trips.size, "median": float(np.median(trips)), "worst": float(trips.max())},
        }
        write_results(RESULTS, rows, lambda rows: draw(rows, digits), numbers)
    return rows


def summary(cases: list[tuple[str, float, str]]) -> dict[str, float]:
    """Number of cases, of those that jump, of violations, and the largest part of what is allowed."""
    ratios = [ratio for _, ratio, _ in cases]
    return {
        "cases": len(cases),
        "jumping": sum(end == "escaped" for *_, end in cases),
        "undecided": sum(end == "edge" for *_, end in cases),
        "violations": sum(not ratio <= 1.0 for ratio in ratios),
        "worst_share": min(max(ratios), 1e300),
    }


LOOKS = {"Euler": ("s", "--", "#D55E00"), "Runge-Kutta 4": ("o", ":", "#222222")}
OWN = "#0072B2"
FLOOR = 1e-17  # where an error of zero is drawn


def draw(rows: list[Row], digits: list[float]) -> Figure:
    """Errors of the schemes by their number of steps; errors of hysim against 30 digits."""
    canvas = figure(height=3.4)
    schemes, sure = canvas.subplots(1, 2)
    for method, (marker, dashes, colour) in LOOKS.items():
        for core in CORES:
            own = [row for row in rows if row["method"] == method and row["core"] == core]
            steps, errors = ([row[name] for row in own] for name in ("steps", "error"))
            label = method if core == next(iter(CORES)) else None
            schemes.loglog(steps, errors, marker=marker, ls=dashes, color=colour, ms=4, lw=1.0, label=label)
    schemes.axhline(max(digits), color=OWN, label="hysim, any number")
    schemes.set(xlabel="Steps a stroke", ylabel="Error of M [range]", ylim=(FLOOR, 100.0))
    schemes.legend(loc="lower left", bbox_to_anchor=(0.0, 0.12))
    share = np.arange(1, len(digits) + 1) / len(digits)
    sure.step(np.maximum(sorted(digits), FLOOR), share, where="post", color=OWN)
    sure.set(xscale="log", xlabel="Error against 30 digits [range]", ylabel="Share of the laws", ylim=(0.0, 1.02))
    return canvas


if __name__ == "__main__":
    for row in main():
        print(
            f"{row['core']:14} {row['method']:14} {row['steps']:6} steps: error {row['error']:.1e}, "
            f"{row['ns_per_sample']:7.1f} ns a sample, {row['times_hysim']:.3f} times hysim's"
        )
