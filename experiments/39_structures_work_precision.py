"""What does accuracy cost in structures? Frames in earthquakes by hysim and by what engineers use, all in one run.

One mass and three storeys of Bouc-Wen springs (ductility 3.5 and 5) against OpenSees, SciPy and plain compiled loops
(`peers.structures`, which says how each is run); three storeys of Baber and Noori and twenty storeys on isolators, with
Dahl friction, plays and Maxwell slip, by hysim alone. Errors are the largest of all drifts at the samples, in units
of the largest drift, against DOP853 at a tolerance of 1e-12 with an event wherever something is not smooth
(`structure_reference`); how far that is from 1e-10 is stated. Peak errors are those of the continuous peaks of
the drifts, each in units of itself. Times are processor times of one call for the whole record, per
sample and element; every method runs in one thread.

Whether OpenSees is given the same model is asked apart: with a bilinear spring in each storey (its `Steel01`) and
the same Newmark method its drifts are compared with those of a plain loop around hysim's law.

Each method is timed in turns with hysim's default. Peers come with the extra `bench`; those that cannot be
imported are left out.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
import structure_cases as cases
from peers import structures as peers
from peers.contest import in_turns, peer, spread
from results_folder import label_grid, write_results

RESULTS = Path(__file__).parent / "results" / "structures_work_precision"
PEAK = 1e-6  # of a peak drift: what the default is asked to reach
ENGINEERING = 1e-3  # of a drift: from here on errors of OpenSees are compared with hysim's
Array = np.ndarray
Row = dict[str, Any]
CONTESTS = (cases.one_mass, cases.three_storeys)
ALONE = (cases.pinching, cases.isolated_tower)


# ---------------------------------------------------------------------------------- measuring


def measured(case: cases.Case, entry: peers.Entry, own: peers.Entry, exact: Any, most: int) -> Row:
    """Error of one method at one setting, its time, and that in times of hysim's default."""
    error = float(np.abs(entry.drift() - exact.drift).max() / exact.peak_drift.max())
    turns = in_turns(entry.seconds, own.seconds, min(3, most), most, 2.0)
    row: Row = {"problem": case.name, "tool": entry.tool, "method": entry.method, "setting": entry.setting}
    row |= {"error": error, "peak_error": None, "imbalance": None}
    row |= spread("ns_per_term", 1e9 * turns[:, 0] / case.n_terms)
    return row | spread("times_hysim", turns[:, 0] / turns[:, 1]) | {"repeats": len(turns)}


def contest(case: cases.Case, entries: list[peers.Entry], most: int) -> tuple[list[Row], dict[str, float]]:
    """Rows of one structure, and how sure its reference is; of hysim the peaks and energies too."""
    exact, coarser = case.reference(), case.reference(1e-10)
    (own,) = (entry for entry in entries if entry.setting == "tolerance 1e-08")
    rows = []
    for entry in entries:
        row = measured(case, entry, own, exact, most)
        if entry.tool == "hysim":
            row |= peaks_and_energies(case, entry, exact)
        rows.append(row)
    sure = {
        "drift": float(np.abs(coarser.drift - exact.drift).max() / exact.peak_drift.max()),
        "peak": float(np.abs(coarser.peak_drift / exact.peak_drift - 1.0).max()),
        "peak_missed_by_samples": float((1.0 - np.abs(exact.drift).max(axis=0) / exact.peak_drift).max()),
        "pieces": float(exact.n_pieces),
    }
    return rows, sure


def peaks_and_energies(case: cases.Case, entry: peers.Entry, exact: Any) -> dict[str, float]:
    """The worst error of a continuous peak drift, and the largest imbalance of energies over the largest input."""
    signals = case.structure(**peers.OPTIONS[entry.setting]).signals(case.ground, case.sample_time)
    peak = float(np.abs(signals["peak_drift"][-1] / exact.peak_drift - 1.0).max())
    return {"peak_error": peak, "imbalance": float(np.abs(signals["imbalance"]).max() / signals["input_work"].max())}


def peak_runs(case: cases.Case, exact: Any, most: int) -> list[Row]:
    """Continuous peak drifts of three storeys by `simulate`, with all its signals and energies, from coarse to fine."""
    rows = []
    for setting, options in peers.OPTIONS.items():
        plant = case.structure(**options)

        def run(plant: Any = plant) -> Array:
            return np.asarray(hs.simulate(plant, case.times, case.ground).peaks["drift"])

        error = float(np.abs(run() / exact.peak_drift - 1.0).max())
        seconds = float(np.median([peers.clock(run) for _ in range(most)]))
        rows.append({"setting": setting, "peak_error": error, "ns_per_term": 1e9 * seconds / case.n_terms})
    return rows


def same_model(smoke: bool) -> dict[str, Any] | None:
    """Drifts by OpenSees' Steel01 and by the plain Newmark loop around hysim's law, at equal steps."""
    if (ops := peer("openseespy.opensees")) is None:
        return None
    case = cases.yielding_frame(31 if smoke else 1501)
    found: dict[str, Any] = {"method": "Newmark, average acceleration, Newton to 1e-14; Steel01 and hysim.MaxwellSlip"}
    for count in (1, 4):
        theirs = peers.opensees_drift(ops, case, peers.EXACT, count)
        ours = peers.plain(case, peers.newmark, count, 1e-15, smoke)
        found[f"difference_{count}"] = float(np.abs(theirs - ours).max() / np.abs(ours).max())
    return found


# ---------------------------------------------------------------------------------- what was asked


def fastest(rows: list[Row], error: float) -> Row | None:
    """Of these rows the fastest with at most this error."""
    able = [row for row in rows if row["error"] <= error]
    return min(able, key=lambda row: row["ns_per_term"], default=None)


def most_exact(rows: list[Row], ns: float) -> Row | None:
    """Of these rows the most exact that takes at most this time."""
    able = [row for row in rows if row["ns_per_term"] <= ns]
    return min(able, key=lambda row: row["error"], default=None)


def beside_opensees(rows: list[Row]) -> Iterator[Row]:
    """For each run of OpenSees: hysim's fastest that is as exact, and hysim's most exact that is as fast."""
    for problem in dict.fromkeys(row["problem"] for row in rows):
        own = [row for row in rows if row["problem"] == problem and row["tool"] == "hysim"]
        for row in rows:
            if row["problem"] != problem or row["tool"] != "OpenSees":
                continue
            equal_error, equal_cost = fastest(own, row["error"]), most_exact(own, row["ns_per_term"])
            if equal_error is None or equal_cost is None:
                continue
            yield {
                "problem": problem, "opensees": f"{row['method']}, {row['setting']}",
                "error": row["error"], "ns_per_term": row["ns_per_term"],
                "hysim_as_exact": equal_error["setting"],
                "times_faster": row["ns_per_term"] / equal_error["ns_per_term"],
                "hysim_as_fast": equal_cost["setting"],
                "times_more_exact": row["error"] / equal_cost["error"],
            }  # fmt: skip


def verdicts(rows: list[Row], pairs: list[Row], peak_rows: list[Row], same: Row | None) -> Iterator[Row]:
    """What was asked of structures, each with the figure that decides."""
    if same is not None:
        worst = max(same["difference_1"], same["difference_4"])
        yield asked("Steel01, same Newmark: difference of drifts", worst, at_most=1e-10)
    if pairs:
        exact = [row for row in pairs if row["error"] <= ENGINEERING * 2.0]
        least = min(row["times_faster"] for row in exact)
        yield asked("times faster than OpenSees at the error of its finest steps", least, at_least=50.0)
        least = min(row["times_more_exact"] for row in pairs)
        yield asked("times more exact than OpenSees at its cost", least, at_least=100.0)
    able = [row for row in peak_rows if row["peak_error"] <= PEAK]
    best = min((row["ns_per_term"] for row in able), default=float("inf"))
    yield asked("three storeys, peak drifts to 1e-6: ns a sample and element", best, at_most=1500.0)
    for problem in dict.fromkeys(row["problem"] for row in rows):
        (default,) = (r for r in rows if r["problem"] == problem and r["setting"] == "tolerance 1e-08")
        yield asked(f"{problem}: imbalance over input at the default", default["imbalance"], at_most=1e-8)


def asked(what: str, value: float, **limit: float) -> Row:
    """A figure with its limit, and whether it keeps it."""
    ((kind, bound),) = limit.items()
    return {
        "what": what,
        "value": value,
        kind: bound,
        "reached": value <= bound if kind == "at_most" else value >= bound,
    }


# ---------------------------------------------------------------------------------- results


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    most = 1 if smoke else 7
    rows: list[Row] = []
    sure, peak_rows = {}, []
    for make in (CONTESTS[1], ALONE[1]) if smoke else (*CONTESTS, *ALONE):
        case = make(n_samples=31) if smoke else make()
        entries = list((peers.contestants if make in CONTESTS else peers.hysim)(case, smoke))
        found, sure[case.name] = contest(case, entries, most)
        rows += found
        if make is cases.three_storeys and not smoke:
            peak_rows = peak_runs(case, case.reference(), most)
    same, pairs = same_model(smoke), list(beside_opensees(rows))
    if not smoke:
        numbers = {
            "opensees": peers.opensees_notes(),
            "reference": sure,
            "same_model": same,
            "peaks": peak_rows,
            "beside_opensees": pairs,
            "asked": list(verdicts(rows, pairs, peak_rows, same)),
        }
        write_results(RESULTS, rows, draw, numbers)
    return rows


LOOKS = {  # method's beginning: label, marker, fill, line, colour; each told apart without its colour
    "hysim, fixed": ("hysim, fixed substeps", "*", "full", "-", "#0072B2"),
    "hysim, adaptive": ("hysim, by tolerance", "*", "none", "--", "#0072B2"),
    "OpenSees BoucWen, Newmark": ("OpenSees, Newmark", "X", "full", "-", "#CC79A7"),
    "OpenSees BoucWen, central": ("OpenSees, central", "X", "none", ":", "#CC79A7"),
    "Newmark": ("Newmark loop", "s", "full", "--", "#222222"),
    "Verlet": ("Verlet loop", "s", "none", ":", "#222222"),
    "solve_ivp DOP853": ("SciPy DOP853", "o", "full", "-", "#D55E00"),
    "odeint": ("SciPy odeint", "o", "none", "-.", "#D55E00"),
}


def draw(rows: list[Row]) -> Figure:
    """Error against time, log-log: a line for each method."""
    canvas = figure(height=7.4)
    axes = canvas.subplots(2, 2, sharex=True, sharey=True)
    for ax, problem in zip(axes.flat, dict.fromkeys(row["problem"] for row in rows), strict=True):
        for method, (label, marker, fill, dashes, colour) in LOOKS.items():
            own = [r for r in rows if r["problem"] == problem and r["method"].startswith(method)]
            if own:
                look = {"marker": marker, "fillstyle": fill, "color": colour, "ms": 9 if marker == "*" else 5}
                points = sorted((r["ns_per_term"], r["error"]) for r in own)
                ax.loglog(*zip(*points, strict=True), ls=dashes, lw=1.1, mew=0.8, label=label, **look)
        ax.set_title(f"{str(problem).capitalize()}")
    labels = [label for label, *_ in LOOKS.values()]
    label_grid(canvas, axes, "Time a sample and element [ns]", "Error of the drifts [largest drift]", labels)
    return canvas


def told(row: Row) -> str:
    """One line on what was asked."""
    sign, bound = ("<=", row["at_most"]) if "at_most" in row else (">=", row["at_least"])
    verdict = "reached" if row["reached"] else "NOT reached"
    return f"{row['what']}: {row['value']:.4g}, asked {sign} {bound:g}: {verdict}"


if __name__ == "__main__":
    for row in main():
        extra = "" if row["peak_error"] is None else f" peak {row['peak_error']:.1e} imbalance {row['imbalance']:.1e}"
        print(
            f"{row['problem']:28} {row['method']:36} {row['setting']:16} {row['error']:.1e}"
            f" {row['ns_per_term']:10.1f} ns {row['times_hysim']:9.2f} times hysim's{extra}"
        )
    result = json.loads((RESULTS / "result.json").read_text())
    for name, note in result["opensees"].items():
        print(f"OpenSees, {name}: {note}")
    for row in result["beside_opensees"]:
        print(
            f"{row['problem']}, {row['opensees']}: error {row['error']:.1e} at {row['ns_per_term']:.0f} ns; hysim is"
            f" {row['times_faster']:.1f} times faster ({row['hysim_as_exact']}) and {row['times_more_exact']:.0f} times"
            f" more exact at its cost ({row['hysim_as_fast']})"
        )
    for row in result["peaks"]:
        print(f"peaks by simulate, {row['setting']}: {row['peak_error']:.1e} at {row['ns_per_term']:.0f} ns")
    for row in result["asked"]:
        print(told(row))
