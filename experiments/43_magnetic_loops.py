"""Which law fits the measured loops of a core, and does a default call find the best Jiles-Atherton law?

The loops are public, and are not part of hysim: a ferrite at three amplitudes, an electrical steel at three, and an
amorphous alloy (github.com/romanszewczyk/JAmodel), in a folder that the command names. Amplitudes of one core are
identified together, those of the steel also one by one. Every call is a default one for loops that end as they began,
``hs.identify(law, records, initial="periodic")``.

Beside hysim's Jiles-Atherton fits stand those of a hand-written law by `scipy.optimize.differential_evolution`
(`magnetic_evolution`), ten minutes of the processor for each set of records if nothing else is asked. Its integration
has 200 steps a branch, and a search may use its error: the constants are put into the exact law, too, and are the start
of one more call of hysim.

Then the amplitude in the middle of the ferrite's is left out, and predicted by every law after a decaying field has
demagnetised it. Errors are root mean squares in percent of the range of B. Seconds are those of the processor, after a
first call that compiles; for the Jiles-Atherton law also those of the clock on all cores.

    python experiments/43_magnetic_loops.py FOLDER [SECONDS]

goes on with the evolution that is stored, up to so many seconds for each set.
"""

import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from magnetic_evolution import Core, errors, evolve_until, loop_of
from measured_cores import core_loops
from results_folder import append_lines, stored_result, write_results

RESULTS = Path(__file__).parent / "results" / "magnetic_loops"
STORED = RESULTS / "evolution.jsonl"
SECONDS = 600.0  # of the evolution, for each set of records
MATERIALS = {"ferrite": "MnZn_ferrite", "steel": "M130_27s", "amorphous alloy": "amorf"}
OWN, BY_HAND = "Jiles-Atherton", "Jiles-Atherton, differential evolution"
LAWS: dict[str, Any] = {
    OWN: hs.JilesAtherton,
    "Tellinen": hs.Tellinen,
    "Chan": hs.Chan,
    "energy-based plays": hs.EnergyPlays,
    "Preisach": hs.Preisach,
    "parametric plays": hs.ParametricPrandtlIshlinskii,
    "ten plays": hs.PrandtlIshlinskii.structure(plays=10),
}
CONSTANTS = ("Ms", "a", "alpha", "k", "c")
LEFT_OUT = 1  # of the ferrite's amplitudes
FADING, HALF_CYCLES = 0.97, 200  # a demagnetising field: each half cycle of the one before
CYCLES = 30
Array = np.ndarray[Any, np.dtype[Any]]
Row = dict[str, Any]
Records = list[hs.Record]


# ---------------------------------------------------------------------------------- records


def measured(folder: Path) -> dict[str, Records]:
    """The sets of records that are identified together, by name."""
    units = {"u": "A/m", "y": "T"}
    sets = {
        name: [replace(each, name=name, units=units) for each in core_loops(folder, material)]
        for name, material in MATERIALS.items()
    }
    return sets | {f"{each.name} {each.u.max():.3g} A/m": [each] for each in sets["steel"]}


def stand_in() -> dict[str, Records]:
    """A simulated core in place of measured ones."""
    u = 60.0 * np.cos(np.linspace(0.0, 2.0 * np.pi, 25))
    truth = hs.JilesAtherton(Ms=4e5, a=50.0, alpha=2.8e-4, k=47.0, c=0.7)
    y = steady_output(truth, u) + 1e-3 * np.random.default_rng(0).normal(size=u.size)
    return {"ferrite": [hs.Record(u=u, y=np.append(y[:-1], y[0]), name="ferrite")]}


# ---------------------------------------------------------------------------------- fits


def fitted(law: Any, records: Records, most: int | None) -> tuple[hs.Identification, float, float]:
    """A call for steady loops, seconds of the processor and of the clock; `most` evaluations, None for a default call.

    What it compiles is compiled before.
    """
    few = [each[:: max(1, len(each) // 64)] for each in records]
    hs.identify(law, few, initial="periodic", max_evaluations=100)
    begin = time.process_time(), time.perf_counter()
    fit = hs.identify(law, records, initial="periodic", max_evaluations=most)
    return fit, time.process_time() - begin[0], time.perf_counter() - begin[1]


def squares(fit: hs.Identification) -> float:
    """Sum of squares [T^2]."""
    return float(np.sum(fit.residual**2))


def parts_of(values: Array, records: Records) -> list[Array]:
    """An array of all samples as one for each record."""
    return np.split(values, np.cumsum([len(each) for each in records])[:-1])


def error_percent(residual: Array, record: hs.Record) -> float:
    """Root mean square in percent of the range."""
    return 100.0 * float(np.sqrt(np.mean(residual**2)) / np.ptp(record.y))


def worst_percent(residual: Array, records: Records) -> float:
    """The largest error of a record."""
    each = zip(parts_of(residual, records), records, strict=True)
    return max(error_percent(part, record) for part, record in each)


def row_of(name: str, law: str, records: Records, **columns: Any) -> Row:
    """A row of the table; what is not known is None."""
    known = ("parameters", "sum_of_squares", "worst_error_percent", "cpu_seconds", "clock_seconds", "left_out_percent")
    sizes = {"records": len(records), "samples": sum(len(each) for each in records)}
    return {"set": name, "law": law, **sizes, **dict.fromkeys(known), **columns}


def fit_row(name: str, law: str, records: Records, most: int | None) -> tuple[Row, hs.Identification]:
    """A law on a set of records."""
    fit, cpu, clock = fitted(LAWS[law], records, most)
    numbers = {"parameters": fit.n_parameters, "sum_of_squares": squares(fit), "cpu_seconds": cpu}
    worst = worst_percent(fit.residual, records)
    return row_of(name, law, records, **numbers, worst_error_percent=worst, clock_seconds=clock), fit


def evolved(
    name: str, records: Records, fit: hs.Identification, seconds: float, most: int | None
) -> tuple[Row, dict[str, Any]]:
    """The evolution of the hand-written law on a set, beside the fit of hysim's."""
    loops = [loop_of(each.u, each.y) for each in records]
    runs = evolve_until(STORED if seconds >= 1.0 else None, name, loops, seconds)
    best = min(runs, key=lambda run: run["cost"])
    start = hs.JilesAtherton(**best["core"])
    exact = squares(hs.identify(start, records, initial="periodic", fixed=best["core"]))
    refined = squares(hs.identify(start, records, initial="periodic", max_evaluations=most))
    worst = worst_percent(np.concatenate(errors(Core(**best["core"]), loops)), records)
    row = row_of(
        name,
        BY_HAND,
        records,
        parameters=fit.n_parameters,
        sum_of_squares=best["cost"],
        worst_error_percent=worst,
        cpu_seconds=sum(run["seconds"] for run in runs),
    )
    return row, {
        "default_over_evolution": squares(fit) / best["cost"],
        "default_over_evolution_exactly": squares(fit) / exact,
        "default_over_refined": squares(fit) / refined,
        "runs": runs,
    }


def identified(fit: hs.Identification) -> dict[str, Any]:
    """Constants, standard errors and intervals of a Jiles-Atherton fit."""
    return {
        name: {
            "estimate": fit.estimates[name],
            "stderr": finite(fit.stderr[name]),
            "interval": [finite(end) for end in fit.intervals[name]],
        }
        for name in CONSTANTS
    } | {"message": fit.message}


def finite(value: float) -> float | None:
    """The number, or None in place of nan."""
    return float(value) if np.isfinite(value) else None


# ---------------------------------------------------------------------------------- steady loops


def steady_output(law: Any, u: Array, reach: float | None = None) -> Array:
    """Output in the cycle `u`, after a field that decays from `reach` has demagnetised the core."""
    fading = (reach or float(np.abs(u).max())) * (-FADING) ** np.arange(HALF_CYCLES)
    return law.response(np.concatenate([[0.0], fading, np.tile(u, CYCLES)]))[-u.size :]


def predicted(law: str, records: Records) -> tuple[Array, float]:
    """Output on the record that is left out, by a fit of the others, and its error in percent."""
    others = [each for k, each in enumerate(records) if k != LEFT_OUT]
    model = hs.identify(LAWS[law], others, initial="periodic").model
    wanted = records[LEFT_OUT]
    y = steady_output(model, wanted.u, max(float(np.abs(each.u).max()) for each in records))
    return y, error_percent(wanted.y - y, wanted)


# ---------------------------------------------------------------------------------- results


def main(smoke: bool = False, folder: Path | None = None, seconds: float = SECONDS) -> list[Row]:
    """Fit, predict, print, and unless it is a smoke run write table, figure and JSON."""
    if smoke or folder is None:
        sets, laws, seconds, most = stand_in(), (OWN,), 0.1, 60
    else:
        sets, laws, most = measured(folder), tuple(LAWS), None
        restored()
    rows, numbers, models = [], {}, {}
    for name, records in sets.items():
        for law in laws if name in MATERIALS else (OWN,):
            row, fit = fit_row(name, law, records, most)
            if len(records) > LEFT_OUT and name == "ferrite":
                row["left_out_percent"] = predicted(law, records)[1]
            rows.append(row)
            models[name, law] = fit
            print(line_of(row), flush=True)
        row, beside = evolved(name, records, models[name, OWN], seconds, most)
        rows.append(row)
        numbers[name] = {"constants": identified(models[name, OWN]), **beside}
        print(line_of(row), flush=True)
    if not smoke and folder is not None:
        write_results(RESULTS, rows, lambda rows: draw(rows, sets, models, numbers), {"sets": numbers})
        STORED.unlink()
    return rows


def restored() -> None:
    """Write the runs of the evolution that the last result has to the file of the present ones."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    if not STORED.exists():
        sets = stored_result(RESULTS).get("sets", {})
        append_lines(STORED, *({"set": name, **run} for name, each in sets.items() for run in each["runs"]))


def line_of(row: Row) -> str:
    """A row as it is printed."""
    left_out = row["left_out_percent"]
    return (
        f"{row['set']:16} {row['law']:38} {row['parameters']:3} parameters {row['sum_of_squares']:.6e} T^2, worst "
        f"{row['worst_error_percent']:.3f} %, {row['cpu_seconds']:.2f} CPU s"
        + ("" if left_out is None else f", left out {left_out:.3f} %")
    )


SHOWN = (OWN, "energy-based plays", "Tellinen")
FITTED = {"color": "#0072B2", "lw": 0.9}


def draw(rows: list[Row], sets: dict[str, Records], models: Mapping[Any, Any], numbers: Mapping[str, Any]) -> Figure:
    """Fitted loops of three laws, with the largest error of an amplitude; how the evolution falls."""
    canvas = figure(height=8.0)
    grid = canvas.add_gridspec(4, 3)
    for line, law in enumerate(SHOWN):
        for place, name in enumerate(MATERIALS):
            axes = canvas.add_subplot(grid[line, place])
            residuals = parts_of(models[name, law].residual, sets[name])
            for record, residual in zip(sets[name], residuals, strict=True):
                axes.plot(record.u, record.y - residual, **FITTED)
            (row,) = (each for each in rows if each["set"] == name and each["law"] == law)
            axes.text(0.05, 0.93, f"{row['worst_error_percent']:.2g} %", transform=axes.transAxes, va="top", fontsize=8)
            axes.set_title(name if line == 0 else "", fontsize=9)
            axes.set(xlabel="H [A/m]" if law == SHOWN[-1] else "", ylabel=f"{law}\nB [T]" if place == 0 else "")
    course = canvas.add_subplot(grid[3, :])
    for name, beside in numbers.items():
        own = next(row for row in rows if row["set"] == name and row["law"] == OWN)
        seconds, costs = np.array(course_of(beside["runs"])).T
        (line,) = course.step(seconds, costs / own["sum_of_squares"], where="post", lw=1.0, label=name)
        course.plot(own["cpu_seconds"], 1.0, "o", color=line.get_color(), ms=4)
    course.set(xscale="log", yscale="log", xlim=(0.1, None), ylim=(0.7, 1e3))
    course.set(xlabel="CPU time of the evolution [s] (dots: hysim)", ylabel="Sum of squares\nover hysim's")
    course.legend(fontsize=7, ncols=2)
    return canvas


def course_of(runs: list[dict[str, Any]]) -> list[tuple[float, float]]:
    """Time and the best sum of squares so far, over all runs."""
    course, begun, best = [], 0.0, np.inf
    for run in runs:
        for seconds, cost in run["course"]:
            if cost < best:
                best = cost
                course.append((begun + seconds, best))
        begun += run["seconds"]
    return [*course, (begun, best)]


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit("usage: python experiments/43_magnetic_loops.py FOLDER [SECONDS]")
    main(folder=Path(sys.argv[1]), seconds=float(sys.argv[2]) if len(sys.argv) > 2 else SECONDS)
