"""Do more samples on a monotone branch of the input change anything?

They must not, whatever the law: its output at a sample depends on the order of the turning points alone. Random hostile
laws of each family (`hostile_laws`) go along one stride from a random state in one piece, in some, and in up to 64, by
the path kernels, in batches, by the compiled step, and backwards by the inverse. `more_samples` says what may differ:
nothing for plays and relays, roundings for closed forms, and 1e-9 of the range besides for laws by their slope. Beside
them: a path that is cut and continued, an input that stands still, and the mirrored law, each to the bit.

A `BoucWenOscillator` and all else that depends on time is left out: its samples say when the input is what it is, and
between them it is held, or goes on a line, so that more of them are another input.

Cases are worked on in chunks on all cores; finished chunks are kept in the folder ``--chunks``, if one is given, where
a second call finds them. 10 000 cases of each family take about an hour of one core.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from hostile_laws import DRAWS
from more_samples import BITS, Case, Verdict, compiled_run, draw_case, judged, judged_beside, response_run, runs, spread
from more_samples_batch import (
    ODD,
    batch_runs,
    cut_keeps_bits,
    even_verdicts,
    is_odd,
    standing_changes_nothing,
)
from more_samples_inverse import INVERTED, STEPPED, inputs_for, inverse_verdict, stepped_inputs_for, wanted_case
from results_folder import one_panel, write_results

from hysim.plot import Figure

RESULTS = Path(__file__).parent / "results" / "more_samples"
N_CASES, N_SMOKE, BATCH = 10_000, 1, 100
LARGEST = 1e300  # a number that every JSON reader knows, in place of inf
TIMED = "RateDependentPrandtlIshlinskii"
NOT_IN_BATCHES = ("CustomLaw", "Line", "SingleValued", "Sum", "Cascade")
NOT_STEPPED = ("SingleValued", TIMED)

Row = dict[str, float | str]
Found = Iterator[tuple[str, Verdict, Any]]


def forward_verdicts(family: str, seeds: range) -> Found:
    """Path, verdict and seed of each case."""
    cases, errors, paths = [], [], []
    for seed in seeds:
        rng = generator(family, seed)
        case = draw_case(family, rng)
        cases.append(case)
        errors.append(None if family in BITS else remembered(case))
        paths.append(runs(case, response_run))
        yield "response", judged(case, paths[-1], errors[-1]), seed
        if family not in NOT_STEPPED:
            yield "compiled step", judged_beside(case, runs(case, compiled_run), paths[-1], errors[-1]), seed
        if family != TIMED:
            yield "cut and continued", to_the_bit(cut_keeps_bits(case, rng)), seed
            yield "input at rest", to_the_bit(standing_changes_nothing(case, rng)), seed
        if family in ODD:
            yield "mirrored", to_the_bit(is_odd(case)), seed
    if family == TIMED:
        for seed, verdict in zip(seeds, even_verdicts(cases, generator(family, seeds[0])), strict=True):
            yield "batch", verdict, seed
    elif family not in NOT_IN_BATCHES:
        for seed, case, found, path, error in zip(seeds, cases, batch_runs(cases, paths), paths, errors, strict=True):
            yield "batch", judged_beside(case, found, path, error), seed


def inverse_verdicts(family: str, seeds: range) -> Found:
    """As `forward_verdicts`, of the inverses."""
    for seed in seeds:
        wanted = wanted_case(family, generator(family, seed))
        yield "inverse", inverse_verdict(wanted, inputs_for), seed
        if family in STEPPED:
            yield "inverse step", inverse_verdict(wanted, stepped_inputs_for), seed


def generator(family: str, seed: int) -> np.random.Generator:
    """The generator of a case."""
    return np.random.default_rng([seed, *family.encode()])


def remembered(case: Case) -> Callable[[], Any]:
    """The spread of a case, worked out once."""
    return cache(partial(spread, case))


def to_the_bit(same: bool) -> Verdict:
    """A verdict without a tolerance."""
    return Verdict(0.0 if same else np.inf, "compared")


def all_verdicts(family: str, seeds: range) -> Found:
    """Forwards and backwards."""
    with np.errstate(all="ignore"):  # laws that escape overflow
        yield from forward_verdicts(family, seeds)
        if family in INVERTED:
            yield from inverse_verdicts(family, seeds)


def chunk(family: str, first: int, count: int, folder: str | None = None) -> dict[str, Any]:
    """Ratios and ends of some cases by path, and the seeds of violations; from the folder, if they are there."""
    file = Path(folder, f"{family}_{first}_{count}.json") if folder else None
    if file is not None and file.exists():
        return dict(json.loads(file.read_text()))
    ratios: dict[str, list[float]] = {}
    ends: dict[str, Counter[str]] = {}
    wrong = []
    for path, verdict, seed in all_verdicts(family, range(first, first + count)):
        ratios.setdefault(path, []).append(min(verdict.ratio, LARGEST))
        ends.setdefault(path, Counter())[verdict.end] += 1
        if verdict.ratio > 1.0:
            wrong.append([path, seed, min(verdict.ratio, LARGEST)])
    found = {"ratios": ratios, "ends": ends, "wrong": wrong}
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(found))
    return found


def family_rows(family: str, chunks: list[dict[str, Any]]) -> list[Row]:
    """A row for each path."""
    for path, seed, ratio in (each for found in chunks for each in found["wrong"]):
        print(f"{family}, {path}: seed {seed} is off by {ratio:.3g} of what is allowed")
    rows: list[Row] = []
    for path in chunks[0]["ratios"]:
        values = np.concatenate([found["ratios"][path] for found in chunks])
        ends = sum((Counter(found["ends"][path]) for found in chunks), Counter())
        rows.append(
            {
                "family": family,
                "path": path,
                "cases": values.size,
                "violations": int(np.sum(values > 1.0)),
                "worst": float(np.max(values)),
                "median": float(np.median(values)),
                "escaped": ends["escaped"],
                "undecided": ends["edge"],
                "refused": ends["refused"],
                "partly_refused": ends["partly refused"],
            }
        )
    return rows


def main(smoke: bool = False, n_cases: int = N_CASES, folder: str | None = None) -> list[Row]:
    """Count, print and write table, figure and result."""
    if smoke:
        rows = [row for family in DRAWS for row in family_rows(family, [chunk(family, 0, N_SMOKE)])]
    else:
        sizes = [min(BATCH, n_cases - first) for first in range(0, n_cases, BATCH)]
        tasks = [(family, BATCH * k, size, folder) for family in DRAWS for k, size in enumerate(sizes)]
        with ProcessPoolExecutor() as pool:
            found = list(pool.map(chunk, *zip(*tasks, strict=True)))
        rows = []
        for k, family in enumerate(DRAWS):
            rows += family_rows(family, found[k * len(sizes) : (k + 1) * len(sizes)])
    for row in rows:
        print(
            "  ".join(f"{name} {value:.2g}" if isinstance(value, float) else f"{value}" for name, value in row.items())
        )
    numbers = {name: sum(int(row[name]) for row in rows) for name in ("cases", "violations")}
    return write_results(RESULTS, rows, draw, {"cases_per_family": n_cases, **numbers}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """The worst distance of each family and path, over what is allowed."""
    paths = {"response": "o", "batch": "s", "compiled step": "x", "inverse": "^", "inverse step": "v"}
    families = list(DRAWS)[::-1]
    canvas, ax = one_panel(5.4)
    for path, marker in paths.items():
        own = [row for row in rows if row["path"] == path]
        worst = [min(max(float(row["worst"]), 1e-4), 1e2) for row in own]
        ax.plot(worst, [families.index(str(row["family"])) for row in own], marker, label=path, fillstyle="none")
    ax.axvline(1.0, color="#888888", linewidth=0.8)
    ax.set(xlim=(5e-5, 2e2), xscale="log", xlabel="Difference / allowed (drawn from 1e-4 to 100)")
    ax.set_yticks(range(len(families)), families)
    ax.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.3, 1.0))
    return canvas


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", type=int, default=N_CASES)
    parser.add_argument("--chunks")
    given = parser.parse_args()
    main(n_cases=given.cases, folder=given.chunks)
