"""Does the same step give the same numbers in C, WebAssembly and functional mock-up units, and what does it cost?

Every family of laws, its inverse where it has one, sums, cascades, plants and controllers: 20 random things on 2 000
samples, and 60 hostile inputs each (see `exported_steps`). Each program is compiled once, by gcc and clang without a
warning, by zig to WebAssembly, and as a unit of FMI 2.0 and 3.0 that FMPy validates and runs; laws of one program are
set there as tunable parameters. At most three units are made of a program, or two where nothing is tunable, so that
units see a part of the cases; the columns `compared` count them.
Every program also runs under the sanitizers of addresses and of undefined behaviour, which stop at the first report.

A difference from the compiled step in Python is a part of the range of the outputs. Hostile outputs may stand still, or
diverge: their differences are parts of the largest output so far, or of the range so far where that is more. A unit
ends at the first output that is not finite, which has to be that of the step. References of inverses that search on a
series are within ten times the law's scale: one far away takes seconds.

What is not installed is not run, and its columns are empty: clang, ziglang and wasmtime, fmpy.
"""

import shutil
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.kernels.controllers import replay
from hysim.kernels.stepping import drive
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
import step_runners as runners
from exported_steps import SAMPLE_TIME, THINGS, Array, Case, cases
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "one_law_everywhere"
PROMISED = 1e-12
SMOKE = ("Dahl", "PrandtlIshlinskii", "PID")
PEERS = ("gcc", "clang", "wasm", "FMI 2.0", "FMI 3.0")
UNITS_OF_ONE_THING, UNITS_OF_A_FAMILY = 2, 3
NO_UNWINDING = ("-fno-asynchronous-unwind-tables", "-fno-unwind-tables")
GENERAL = "inverse of BoucWen, general exponent"

Row = dict[str, Any]


def peers() -> tuple[str, ...]:
    """What can be run here."""
    there = {
        "gcc": shutil.which("gcc"),
        "clang": shutil.which("clang"),
        "wasm": runners.has_wasm(),
        "FMI 2.0": runners.has_fmpy(),
        "FMI 3.0": runners.has_fmpy(),
    }
    return tuple(name for name in PEERS if there[name])


def difference(y: Array, case: Case) -> float:
    """The largest difference from Python's step; inf where one is finite and the other is not, or not the same inf."""
    same = (y == case.y) | (np.isnan(y) & np.isnan(case.y))
    finite = np.isfinite(y) & np.isfinite(case.y)
    if not (same | finite).all():
        return np.inf
    if same.all():
        return 0.0
    known = case.y[np.isfinite(case.y)]
    if case.kind == "random" and known.size == case.y.size:
        half = np.full(y.size, 0.5 * np.ptp(known))
    else:
        lowest = np.minimum.accumulate(np.where(np.isfinite(case.y), case.y, np.inf))
        highest = np.maximum.accumulate(np.where(np.isfinite(case.y), case.y, -np.inf))
        half = 0.5 * np.maximum(np.abs(lowest), np.abs(highest))  # a range may be too large for a double, not its half
        half = np.maximum(half, 0.5 * highest - 0.5 * lowest)
    with np.errstate(all="ignore"):
        return float(np.max(np.where(same, 0.0, np.abs(0.5 * y - 0.5 * case.y)) / half, where=~same, initial=0.0))


def ended(y: Array, case: Case) -> float:
    """As `difference`, of a unit: its outputs end where it reports an error, which has to be where the step ends."""
    end = int(np.argmax(np.isnan(y))) if np.isnan(y).any() else y.size
    if end < y.size and np.isfinite(case.y[end]):
        return np.inf
    return difference(y[:end], case._replace(y=case.y[:end])) if end else 0.0


def row(family: str, run: Sequence[str], folder: Path, n_laws: int = 20, n_hostile: int = 5) -> Row:
    """One line of the table; `run` are the peers."""
    own = list(cases(family, 37, n_laws, n_hostile))
    programs: dict[str, list[Case]] = defaultdict(list)
    for each in own:
        programs[runners.text(each)].append(each)
    found: dict[str, list[float]] = {name: [] for name in run}
    seconds: list[tuple[float, float]] = []
    for k, group in enumerate(programs.values()):
        place = folder / f"{''.join(filter(str.isalpha, family))}{k}"
        for compiler in (name for name in ("gcc", "clang") if name in run):
            library = runners.Library(compiler, group[0], place.with_name(f"{place.name}_{compiler}"))
            for each in group:
                y, taken = library.outputs(each)
                found[compiler].append(difference(y, each))
                if each.kind == "random" and compiler == "gcc" and np.isfinite(each.y).all():
                    seconds.append((taken / y.size, in_python(each) / y.size))
        for each, y in zip(group, runners.checked("gcc", group, place), strict=True):
            found["gcc"].append(difference(y, each))
        if "wasm" in run:
            module = runners.Module(group[0], place)
            found["wasm"] += [difference(module.outputs(each), each) for each in group]
        for version in (name for name in run if name.startswith("FMI")):
            found[version] += in_units(group, version.partition(" ")[2], place)
    first = [group[0] for group in programs.values()]
    sources = [hs.to_c(each.thing, SAMPLE_TIME, name="law") for each in first]
    for each, source in zip(first, sources, strict=True):
        found["gcc"].append(difference(runners.program_output("gcc", source, runners.inputs_of(each), folder), each))
    return {
        "family": family,
        "programs": len(programs),
        "cases": len(own),
        "lines": max(source.source.count("\n") for source in sources),
        "code_bytes": max(
            runners.code_bytes(["gcc"], source, folder / "law", *runners.STRICT, *NO_UNWINDING) for source in sources
        ),
        "ram_bytes": max(8 * (each.parameters.size + each.state.size) for each in own),
        "ns_c": 1e9 * float(np.median([a for a, _ in seconds])),
        "ns_c_most": 1e9 * max(a for a, _ in seconds),
        "ns_numba": 1e9 * float(np.median([b for _, b in seconds])),
        "diverging": sum(not np.isfinite(each.y).all() for each in own),
        "same_bits_percent": 100.0 * float(np.mean([value == 0.0 for value in found["gcc"]])),
        **{f"worst_{name}": max(found[name], default=0.0) if name in run else None for name in PEERS},
        **{f"compared_{name}": len(found[name]) if name in run else None for name in PEERS},
        "above": sum(value > PROMISED for values in found.values() for value in values),
    }


def in_units(group: Sequence[Case], version: str, place: Path) -> list[float]:
    """Differences of the cases of a program in units: of a law, in one unit for each number of parameters."""
    units: dict[Any, runners.Unit] = {}
    found = []
    for each in group:
        is_law = isinstance(each.thing, hs.Law)
        sizes = each.parameters.size, each.state.size
        key = (tuple(runners.fields_of(each)), runners.fixed_of(each), sizes) if is_law else id(each.thing)
        if key not in units:
            most = UNITS_OF_A_FAMILY if is_law else UNITS_OF_ONE_THING
            if len(units) == most or (not is_law and units and each.kind == "random"):  # the second one: hostile inputs
                continue
            units[key] = runners.Unit(each, version, place.with_name(f"{place.name}_{version[0]}_{len(units)}"))
        found.append(ended(units[key].outputs(each), each))
    return found


def in_python(case: Case) -> float:
    """Seconds of the compiled step, called by its pointer."""
    if len(case.inputs) == 2:
        command, u = np.empty((1, case.y.size)), np.empty(case.y.size)
        step, parameters, state = case.thing.initial(SAMPLE_TIME)
        return runners.least_seconds(lambda: replay(step, parameters, state.copy(), *case.inputs, command, u))
    law, y = case.thing.startable(SAMPLE_TIME).started(float(case.inputs[0, 0])), np.empty(case.y.size)
    return runners.least_seconds(lambda: drive(law.step, law.parameters, law.state.copy(), case.inputs[0], y))


def on_a_board(folder: Path) -> int | None:
    """Bytes of a Bouc-Wen law with n = 1 on a Cortex-M7, without the C library; None without zig."""
    if not runners.has_wasm():
        return None
    law = hs.to_c(hs.BoucWen(beta=0.4, gamma=0.2), name="law")
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", "thumb-linux-musleabihf", "-mcpu=cortex_m7"]
    options = ("-std=c99", "-Os", "-ffp-contract=off", "-fno-sanitize=all", *NO_UNWINDING)
    return runners.code_bytes(zig, law, folder / "law", *options)


def main(smoke: bool = False) -> list[Row]:
    """Compare all families, print and write; a smoke run is of three families, and gcc alone."""
    if smoke and shutil.which("gcc") is None:
        return [{"family": name, "not run": "gcc is not here"} for name in SMOKE]
    run = ("gcc",) if smoke else peers()
    sizes = (3, 1) if smoke else ()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for family in SMOKE if smoke else THINGS:
            rows.append(row(family, run, Path(folder), *sizes))
            print(words(rows[-1]), flush=True)
        if not smoke:
            finish(rows, run, on_a_board(Path(folder)))
    if smoke and any(each["above"] for each in rows):
        raise AssertionError(f"numbers in C differ by more than {PROMISED:g} of the range")
    return rows


def words(line: Row) -> str:
    """A row in words."""
    worst = ", ".join(f"{name} {line[f'worst_{name}']:.1e}" for name in PEERS if line[f"worst_{name}"] is not None)
    return (
        f"{line['family']}: {line['lines']} lines, {line['code_bytes']} B of code, {line['ram_bytes']} B of RAM, "
        f"{line['ns_c']:.1f} ns in C, {line['ns_numba']:.1f} ns by numba's pointer; {worst}; {line['above']} above"
    )


def finish(rows: list[Row], run: Sequence[str], board: int | None) -> None:
    """Write table, figure and result."""
    general = [line for line in rows if line["family"] == GENERAL]
    numbers = {
        "promised": PROMISED,
        "run": list(run),
        "not_run": [name for name in PEERS if name not in run],
        "compared": sum(line[f"compared_{name}"] for line in rows for name in run),
        "cortex_m7_bytes": board,
        "cortex_m7_ram_bytes": 16 if board is not None else None,
        "general_inverse_ns": general[0]["ns_c"],
        "general_inverse_ns_most": general[0]["ns_c_most"],
        "general_inverse_ns_numba": general[0]["ns_numba"],
    }
    write_results(RESULTS, rows, draw, numbers)


def draw(rows: list[Row]) -> Figure:
    """Differences of each family, and its times."""
    canvas = figure(width=7.2, height=0.17 * len(rows) + 1.4)
    left, right = canvas.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    places, lowest = np.arange(len(rows)), 1e-18
    colours = "#0072B2", "#56B4E9", "#E69F00", "#009E73", "#D55E00"
    for name, marker, colour in zip(PEERS, "os^+x", colours, strict=True):
        values = [line[f"worst_{name}"] for line in rows]
        at = [max(value, lowest) if value is not None else np.nan for value in values]
        left.plot(at, places, marker, color=colour, label=name, markersize=4, fillstyle="none")
    left.axvline(PROMISED, color="black", linewidth=0.8)
    left.set(xscale="log", xlabel="Worst difference, part of the range (left: same bits)", xlim=(0.5 * lowest, 1e-9))
    left.set(yticks=places, yticklabels=[line["family"] for line in rows], ylim=(len(rows) - 0.4, -0.6))
    right.barh(places - 0.2, [line["ns_c"] for line in rows], 0.4, color="#0072B2", label="C, gcc")
    right.barh(places + 0.2, [line["ns_numba"] for line in rows], 0.4, color="#BBBBBB", label="numba's pointer")
    right.set(xscale="log", xlabel="Time of a sample [ns]")
    left.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, fontsize=6)
    right.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=6)
    left.tick_params(axis="y", labelsize=6)
    return canvas


if __name__ == "__main__":
    main()
