"""What does accuracy cost? Bouc-Wen by hysim and by what people use, error against time, all in one run.

Driven: the memory at the samples of two sines, n = 1, 1.5 and 2 (`peers.driven`). Errors are the largest, in
units of the memory's range, against the closed form of each branch with 30 digits. Oscillator: a mass on a
Bouc-Wen spring under the Noel-Schoukens multisine (`peers.oscillator`). Errors are the largest of the
displacement, in units of its root mean square, against hysim's with 64 substeps; how far that is from 32 and
from an adaptive method begun anew at every sample is stated.

Each method is timed in turns with hysim's default; a ratio is the median, between its quartiles, of the
quotients within a turn. Peers come with the extra `bench`; those that cannot be imported are left out. How cost
grows with samples and with sets is asked in `04_batch.py`.
"""

import json
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from peers import driven, oscillator
from peers.contest import Contestant, Run, clock, in_turns, spread
from results_folder import label_grid, write_results

RESULTS = Path(__file__).parent / "results" / "work_precision"
ENOUGH = 1e-6  # the oscillator's error at which methods are compared
Row = dict[str, float | str]
Ratio = dict[str, float | str | bool]


# ---------------------------------------------------------------------------------- measuring


def measured(problem: str, contestant: Contestant, own: Run, exact: np.ndarray, unit: float, most: int) -> Row:
    """Error of one method at one setting, its time, and that in times of hysim's."""
    error = float(np.abs(contestant.run() - exact).max() / unit)
    turns = in_turns(partial(clock, contestant.run), partial(clock, own), min(3, most), most)
    row: Row = {"problem": problem, "tool": contestant.tool, "method": contestant.method}
    row |= {"setting": contestant.setting, "error": error}
    row |= spread("ns_per_sample", 1e9 * turns[:, 0] / exact.size)
    return row | spread("times_hysim", turns[:, 0] / turns[:, 1]) | {"repeats": len(turns)}


def drive(n: float, most: int, folder: Path, smoke: bool) -> tuple[list[Row], Ratio, float | None]:
    """The driven law: rows, cost in times of `np.exp`, and how far 30 digits are from 45 on the first samples."""
    t = np.arange(21.0 if smoke else 20_001.0)
    u, problem = driven.two_tone(t), f"driven, n = {n:g}"
    law = driven.law(n)
    own = lambda: law.memory(u)  # noqa: E731
    exact, smooth, sure = driven.reference(u, n), driven.smooth_reference(t, n), None
    if exact is None:
        print("without mpmath the errors are the distances from hysim")
        exact = own()
    else:
        sure = float(np.abs(driven.reference(u[:201], n, 45) - exact[:201]).max())
    rows = []
    for contestant in driven.contestants(t, n, folder, smoke):
        target = smooth if contestant.smooth else exact
        rows.append(measured(problem, contestant, own, target, float(np.ptp(exact)), most))
    turns = in_turns(partial(clock, own), partial(clock, lambda: np.exp(u)), most, 5 * most)
    asked = {"at_most": 25.0} if n in (1.0, 2.0) else {}
    return rows, {"what": f"{problem}: hysim over np.exp", **asked, **spread("median", turns[:, 0] / turns[:, 1])}, sure


def vibrate(most: int, folder: Path, smoke: bool) -> tuple[list[Row], dict[str, float]]:
    """The oscillator: rows, and how sure the reference is."""
    u = oscillator.force(31 if smoke else 751)
    own = oscillator.response(u)
    fine, finer = (oscillator.response(u, substeps=count)() for count in (32, 64))
    rms = float(finer.std())
    found = oscillator.contestants(u, folder, smoke)
    rows = [measured("oscillator", contestant, own, finer, rms, most) for contestant in found]
    facts = {"oscillator_32_to_64_substeps": float(np.abs(fine - finer).max() / rms)}
    if not smoke:
        facts["oscillator_to_independent"] = float(np.abs(oscillator.restarted(u) - finer).max() / rms)
    return rows, facts


# ---------------------------------------------------------------------------------- what was asked


ASKED: tuple[tuple[str, str, str, dict[str, float]], ...] = (
    ("driven, n = 1", "solve_ivp LSODA, compiled", "rtol 1e-06", {"at_least": 3000.0}),
    ("driven, n = 1", "solve_ivp LSODA, compiled, smooth input", "rtol 1e-06", {}),
    ("driven, n = 1", "OpenSees BoucWen", "1 step a sample", {"at_least": 50.0}),
    ("driven, n = 1", "exact step in C", "", {}),
    ("driven, n = 1.5", "solve_ivp LSODA, compiled", "rtol 1e-06", {"at_least": 1000.0}),
    ("driven, n = 1.5", "solve_ivp LSODA, compiled, smooth input", "rtol 1e-06", {}),
    ("driven, n = 1.5", "OpenSees BoucWen", "1 step a sample", {"at_least": 15.0}),
    ("driven, n = 2", "solve_ivp LSODA, compiled", "rtol 1e-06", {}),
    ("driven, n = 2", "solve_ivp LSODA, compiled, smooth input", "rtol 1e-06", {}),
    ("driven, n = 2", "OpenSees BoucWen", "1 step a sample", {}),
    ("driven, n = 2", "exact step in C", "", {}),
)
ASKED_AT_ENOUGH = {
    "SciPy": {"at_least": 300.0},
    "solve_ivp": {},
    "diffrax": {"at_least": 50.0},
    "CVODE": {},
    "python-control": {},
}


def ratios(rows: list[Row]) -> Iterator[Ratio]:
    """The quotients with a target, and their neighbours, of those peers that are here."""
    found = {(row["problem"], row["method"], row["setting"]): row for row in rows}
    for *key, asked in ASKED:
        if tuple(key) in found:
            yield quotient(found[tuple(key)], **asked)
    able = [row for row in rows if row["problem"] == "oscillator" and float(row["error"]) <= ENOUGH]
    for name, asked in ASKED_AT_ENOUGH.items():
        peers = [row for row in able if name in f"{row['tool']} {row['method']}"]
        if peers:
            yield quotient(min(peers, key=lambda row: row["times_hysim"]), **asked)
    if (row := found.get(("oscillator", "split in C", "3 substeps"))) is not None:
        names = {"median": "times_hysim", "median_q1": "times_hysim_q3", "median_q3": "times_hysim_q1"}
        inverse = {name: 1.0 / float(row[of]) for name, of in names.items()}
        yield {"what": "oscillator: hysim over the same scheme in C", "at_most": 1.5, **inverse}


def quotient(row: Row, **asked: float) -> Ratio:
    """What one row says in times of hysim."""
    setting = f", {row['setting']}" if row["setting"] else ""
    what = f"{row['problem']}: {row['method']}{setting} over hysim"
    numbers = {name.replace("times_hysim", "median"): row[name] for name in row if name.startswith("times_hysim")}
    return {"what": what, "error": row["error"], **asked, **numbers}


def judged(ratio: Ratio) -> Ratio:
    """The ratio with its verdict, where something was asked."""
    if "at_least" in ratio:
        return ratio | {"reached": ratio["median"] >= ratio["at_least"]}
    return ratio | {"reached": ratio["median"] <= ratio["at_most"]} if "at_most" in ratio else ratio


# ---------------------------------------------------------------------------------- results


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    most = 1 if smoke else 21
    rows: list[Row] = []
    exponentials, reference = [], {}
    with tempfile.TemporaryDirectory() as name:
        for n in driven.EXPONENTS[: 1 if smoke else 3]:
            found, exponential, sure = drive(n, most, Path(name), smoke)
            rows += found
            exponentials.append(exponential)
            reference[f"driven_n={n:g}_30_to_45_digits"] = sure
        found, facts = vibrate(most, Path(name), smoke)
    rows += found
    if not smoke:
        write(rows, [judged(ratio) for ratio in (*ratios(rows), *exponentials)], reference | facts)
    return rows


def write(rows: list[Row], asked: list[Ratio], reference: dict[str, float | None]) -> None:
    """Table, figure and JSON."""
    problem = {"driven_samples": 20_001, "beta": driven.BETA, "gamma": driven.GAMMA, "oscillator_samples": 751}
    write_results(RESULTS, rows, draw, {**problem, "reference": reference, "ratios": asked})


LOOKS = {  # tool: marker, fill, line, colour; each told apart without its colour
    "hysim": ("*", "full", "-", "#0072B2"),
    "hysim, other schemes": ("*", "none", ":", "#0072B2"),
    "C": ("P", "full", "--", "#222222"),
    "C, Runge-Kutta 4": ("P", "none", ":", "#222222"),
    "OpenSees": ("X", "full", "-", "#CC79A7"),
    "diffrax": ("D", "full", "-", "#009E73"),
    "CVODE": ("^", "full", "--", "#E69F00"),
    "SciPy, compiled": ("o", "full", "-", "#D55E00"),
    "SciPy, Python": ("o", "none", ":", "#D55E00"),
    "SciPy, smooth input": ("o", "left", "-.", "#D55E00"),
    "python-control": ("s", "none", "--", "#777777"),
}


def draw(rows: list[Row]) -> Figure:
    """Error against time, log-log: a point for each setting, and a line through the best of each tool."""
    canvas = figure(height=7.4)
    axes = canvas.subplots(2, 2, sharex=True, sharey=True)
    problems = dict.fromkeys(row["problem"] for row in rows)
    for ax, problem in zip(axes.flat, problems, strict=True):
        for tool, (marker, fill, dashes, colour) in reversed(LOOKS.items()):
            own = [row for row in rows if (row["problem"], row["tool"]) == (problem, tool)]
            points = [(float(row["ns_per_sample"]), float(row["error"])) for row in own]
            if points:
                look = {"marker": marker, "fillstyle": fill, "color": colour, "ms": 10 if tool == "hysim" else 5}
                ax.loglog(*zip(*points, strict=True), ls="none", mew=0.8, **look | {"ms": 0.6 * look["ms"]})
                ax.loglog(*zip(*best(points), strict=True), ls=dashes, lw=1.1, mew=0.8, label=tool, **look)
        unit = "rms of y" if problem == "oscillator" else "range of z"
        ax.set_title(f"{str(problem).capitalize()} [{unit}]")
    axes[0, 0].set_ylim(1e-17, 10.0)
    label_grid(canvas, axes, "Time a sample [ns]", "Largest error", LOOKS)
    return canvas


def best(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Those of the points (time, error) that no faster one beats, in the order of time."""
    front: list[tuple[float, float]] = []
    for point in sorted(points):
        if not front or point[1] < front[-1][1]:
            front.append(point)
    return front


def told(ratio: Ratio) -> str:
    """One line on a ratio, what was asked of it, and whether it was reached."""
    line = f"{ratio['what']}: {ratio['median']:.4g} ({ratio['median_q1']:.4g} to {ratio['median_q3']:.4g})"
    for name, sign in (("at_least", ">="), ("at_most", "<=")):
        if name in ratio:
            line += f", asked {sign} {ratio[name]:g}: {'reached' if ratio['reached'] else 'NOT reached'}"
    return line


if __name__ == "__main__":
    for row in main():
        print(
            f"{row['problem']:16} {row['method']:40} {row['setting']:18} {row['error']:.1e}"
            f" {row['ns_per_sample']:12.1f} ns a sample {row['times_hysim']:10.2f} times hysim's"
        )
    for ratio in json.loads((RESULTS / "result.json").read_text())["ratios"]:
        print(told(ratio))
