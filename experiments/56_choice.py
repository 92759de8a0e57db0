"""Is the family that `hs.identify(record)` chooses as good as the best one on what it has not been told?

Devices of eight kinds are drawn at random, and measured with noise of 0.5 % of their range: eight cycles of random
amplitudes are known, six more of other amplitudes are predicted, without noise; the rate-dependent one moves at twice
the rate there. Measured records are those of experiment 36 and two loops and two sets of first-order reversal curves of
magnetometers, in a folder that the command names: records of several cycles are known up to 60 % of their samples, of
single loops every second sample is known, of reversal curves four of five, and the rest is predicted. Beside the chosen
family stand all families that can be compared without further arguments, each searched completely; for measured records
also what one would try by hand, for ten minutes in all. Errors are rms, over the range of the output that is known. All
seconds are those of the processor:

    python experiments/56_choice.py [FOLDER]
"""

import contextlib
import importlib
import statistics
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import hysim as hs
from hysim.models.model import candidates
from hysim.plot import Figure, figure
from hysim.simulation import free_run

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import stored_cases, write_results

RESULTS = Path(__file__).parent / "results" / "choice"
NOISE, SAMPLES, KNOWN = 0.005, 80, 0.6
DEVICES = 5  # of each kind
LONGEST = 600.0  # CPU s of the other searches of a case
LEVELS = np.linspace(-1.05, 1.05, 31)
Row = dict[str, Any]


class Case(NamedTuple):
    """A record, the one that it is a part of, and which samples of that are predicted."""

    kind: str
    name: str
    record: hs.Record
    whole: hs.Record
    asked: Any


def bell(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Weight of relays, of one sign."""
    return (1.0 + 0.5 * (a + b)) * np.exp(-0.75 * (a + b) ** 2 - 1.25 * (a - b - 0.6) ** 2)


def two_signs(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Weight of relays, as the strain of a ferroelectric has it."""
    return (a + b) * bell(a, b)


KINDS: dict[str, Callable[[np.random.Generator], Any]] = {
    "Bouc-Wen": lambda rng: hs.BoucWen(
        beta=rng.uniform(1, 4), gamma=rng.uniform(-0.5, 0.8), n=rng.uniform(1, 2.5), feedthrough=rng.uniform(0.2, 1)
    ),
    "plays": lambda rng: hs.PrandtlIshlinskii(
        thresholds=tuple(np.linspace(0, 0.9, 15)),
        weights=tuple(rng.uniform(0, 1, 15) * np.exp(-np.arange(15) / rng.uniform(2, 10))),
    ),
    "relays": lambda rng: hs.Preisach.from_density(LEVELS, bell),
    "butterfly": lambda rng: hs.Preisach.from_density(LEVELS, two_signs),
    "Coleman-Hodgdon": lambda rng: hs.ColemanHodgdon(
        alpha=rng.uniform(1, 5), c=rng.uniform(0.5, 2), B=rng.uniform(0.1, 0.4)
    ),
    "wear": lambda rng: hs.BoucWenBaberNoori(
        beta=rng.uniform(1, 3), gamma=rng.uniform(0, 1), n=1.0, delta_nu=rng.uniform(0.02, 0.1),
        delta_eta=rng.uniform(0.02, 0.1),
    ),
    "asymmetric": lambda rng: hs.ZhuWangBoucWen(
        beta=rng.uniform(1, 3), gamma=rng.uniform(0, 1), n=1.0, delta=rng.uniform(0.2, 0.6)
    ),
    "rate-dependent": lambda rng: hs.RateDependentPrandtlIshlinskii(
        thresholds=tuple(np.linspace(0, 0.6, 8)), weights=tuple(rng.uniform(0.1, 1, 8)), beta=rng.uniform(0.002, 0.02)
    ),
}  # fmt: skip


def simulated(kind: str, seed: int) -> Case:
    """A random device of a kind: eight cycles that are known, and six more."""
    rng = np.random.default_rng([*KINDS].index(kind) + 100 * seed)
    law, cycle = KINDS[kind](rng), np.sin(np.arange(SAMPLES) * 2.0 * np.pi / SAMPLES)
    sizes = np.append(rng.uniform(0.3, 1.0, 7), 1.0)
    rng.shuffle(sizes)
    later = cycle[:: 2 if kind == "rate-dependent" else 1]
    known = np.outer(sizes, cycle).ravel()
    u = np.concatenate([known, np.outer(rng.uniform(0.2, 1.0, 6), later).ravel()])
    t = 0.01 * np.arange(u.size)
    y = free_run(law, hs.Record(t=t, u=u, y=u)).y
    noise = NOISE * np.ptp(y[: known.size]) * rng.standard_normal(known.size)
    n = known.size
    noisy = hs.Record(t=t[:n], u=known, y=y[:n] + noise)
    return Case(kind, f"{kind} {seed}", noisy, hs.Record(t=t, u=u, y=y), slice(n, None))


def measured(folder: Path) -> Iterator[Case]:
    """Parts of measured records."""
    for device, record, _ in importlib.import_module("36_measured_records").measured(folder):
        n = round(KNOWN * len(record))
        if device == "magnet":
            yield Case(device, record.name, record[::2], record, slice(1, None, 2))
        else:
            yield Case(device, record.name, record[:n], record, slice(n, None))
    for path in sorted((folder / "vsm_loops").iterdir()):
        record = hs.load(path)
        yield Case("loop", path.stem, record[::2], record, slice(1, None, 2))
    for path in sorted((folder / "forc").iterdir()):
        record = hs.load(path)
        curve = np.cumsum(np.diff(record.u, prepend=record.u[0]) < -0.1 * np.ptp(record.u))
        asked = curve % 5 == 3
        yield Case("curves", path.stem, hs.Record(u=record.u[~asked], y=record.y[~asked]), record, asked)


def by_hand(which: Case) -> dict[str, Callable[[hs.Record], Any]]:
    """Searches that the default call has not among its families."""
    structures = {f"Preisach with {k} intervals": hs.Preisach.structure(intervals=k) for k in (8, 16)}
    structures["Preisach, smooth"] = hs.Preisach.structure(smoothness="auto")
    structures["40 plays"] = hs.PrandtlIshlinskii.structure(plays=40)
    tries = {name: lambda record, one=one: searched(one, record) for name, one in structures.items()}
    return tries | ({"reversal curves": hs.Preisach.from_reversal_curves} if which.kind == "curves" else {})


def searched(subject: Any, record: hs.Record) -> Any:
    return hs.identify(subject, record, progress=False).model


def case(which: Case, seconds: float = 30.0, families: dict[str, Any] | None = None) -> Row:
    """Errors on what is asked of the chosen family, and of every one."""
    warnings.simplefilter("ignore", hs.HysimWarning)
    size = float(np.ptp(which.record.y))

    def error(model: Any) -> float:
        return float(np.sqrt(np.mean((free_run(model, which.whole).y - which.whole.y)[which.asked] ** 2))) / size

    begin = time.process_time()
    fit = hs.identify(which.record, progress=False, seconds=seconds)
    took, errors = time.process_time() - begin, dict[str, float]()
    tries: dict[str, Callable[[hs.Record], Any]] = {} if which.kind in KINDS else by_hand(which)
    for name, family in (families or candidates()).items():
        tries[name] = lambda record, family=family: searched(family, record)
    begin = time.process_time()
    for name, attempt in tries.items():
        if time.process_time() - begin < LONGEST:
            with contextlib.suppress(TypeError, ValueError, hs.SimulationError):
                errors[name] = error(attempt(which.record))
    best, own = min(errors, key=lambda name: errors[name]), error(fit.model)
    return {
        "kind": which.kind,
        "record": which.name,
        "chosen": fit.choice.family,
        "undecided": len(fit.choice.undecided),
        "untried": len(fit.choice.untried),
        "error": own,
        "best": best,
        "best_error": errors[best],
        "ratio": own / errors[best],
        "error_on_its_record": float(fit.rmse) / size,
        "seconds": took,
        "tried": len(errors),
        "seconds_by_hand": time.process_time() - begin,
    }


def main(smoke: bool = False, folder: Path | None = None) -> list[Row]:
    """All devices and records; unless it is a smoke run, write table, figure and result."""
    if smoke:
        return [case(simulated("plays", 0), 0.1, {"plays": hs.PrandtlIshlinskii})]
    cases = [] if folder is None else list(measured(folder))
    cases += [simulated(kind, seed) for kind in KINDS for seed in range(DEVICES)]
    with ProcessPoolExecutor(2) as pool:
        by_name = {(each.kind, each.name): each for each in cases}
        rows = stored_cases(RESULTS, ("kind", "record"), by_name, case, mapped=pool.map)
    numbers = {name: summary([row for row in rows if (row["kind"] in KINDS) is told]) for name, told in PARTS.items()}
    return write_results(RESULTS, rows, draw, numbers)


PARTS = {"simulated": True, "measured": False}


def summary(rows: list[Row]) -> Row:
    """Shares of ratios, and seconds."""
    ratios, seconds = [row["ratio"] for row in rows], [row["seconds"] for row in rows]
    if not rows:
        return {}
    return {
        "records": len(rows),
        "within_1.1": sum(ratio <= 1.1 for ratio in ratios) / len(rows),
        "within_1.3": sum(ratio <= 1.3 for ratio in ratios) / len(rows),
        "within_2": sum(ratio <= 2.0 for ratio in ratios) / len(rows),
        "worst_ratio": max(ratios),
        "diverged": sum(not row["error_on_its_record"] < 1.0 for row in rows),
        "median_seconds": statistics.median(seconds),
        "longest_seconds": max(seconds),
    }


def draw(rows: list[Row]) -> Figure:
    """Error of the chosen family against that of the best."""
    canvas = figure(height=4.4)
    ax = canvas.add_subplot()
    for name, told in PARTS.items():
        chosen = [row for row in rows if (row["kind"] in KINDS) is told]
        ax.loglog([row["best_error"] for row in chosen], [row["error"] for row in chosen], "o", label=name)
    ends = np.array([min(row["best_error"] for row in rows), max(row["error"] for row in rows)])
    ax.loglog(ends, ends, "-", lw=0.8)
    ax.set(xlabel="Error of the best family", ylabel="Error of the chosen family")
    ax.legend()
    return canvas


if __name__ == "__main__":
    main(folder=Path(sys.argv[1]) if len(sys.argv) > 1 else None)
