"""Does a default call of `identify` find the optimum on records that were measured?

The records are public, and are not part of hysim: a mirror on piezo stacks, a magnetorheological damper, loops of
magnets, and steel coupons under cyclic strain, in a folder that the command names. Each is identified by the families
that suit it. Sums of squares stand beside each other, of the same family:

- that of the default call, without its restriction to safe laws,
- that of a second call with another seed, on the record in other units,
- that of `scipy.optimize.least_squares` from the end of this second call, the best start that is known,
- the best of `scipy.optimize.least_squares` from 20 random starts in a box, as long as ten times the time that the
  default call took, and at most `LONGEST` seconds. The record is scaled for it, the state before the record and the
  thresholds that the second call decided are told to it, and the law that it calls is hysim's own, compiled and exact.
  It has hysim's bounds of exponents.

No truth is known. Whether a case is reached is judged as in experiment 35: no other method has less than 99 % of the
default's sum of squares, or the default's law has fewer parameters and a BIC that is no higher. All seconds are those
of the processor. Each case is stored as it is done, and a run that was ended early is continued by the next one:

    python experiments/36_measured_records.py FOLDER
"""

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
import random_starts as starts
from measured_cores import AMPLITUDES, column, core_loops
from random_starts import Box
from results_folder import cpu_timed, median_and_worst, stored_cases, write_results

RESULTS = Path(__file__).parent / "results" / "measured_records"
LONGEST = 10.0  # seconds of the random starts of a case
SHORTEST = 0.5
PLAYS = 10
LIMITS: Box = {"n": (0.5, 10.0), "exponent": (-0.95, 4.0)}  # of hysim's searches: beyond is another problem
WIDE: Box = starts.MEMORY | starts.OUTPUT | {"gain": (-20.0, 20.0), "feedthrough": (-5.0, 5.0)} | starts.coefficients(5)
FAMILIES: dict[str, tuple[Any, Box]] = {
    "Bouc-Wen": (hs.BoucWen, WIDE),
    "polynomial Bouc-Wen": (hs.PolynomialBoucWen, WIDE),
    "Zhu-Wang": (hs.ZhuWangBoucWen, WIDE | {"delta": (-2.0, 2.0)}),
    "generalised Bouc-Wen": (hs.GeneralizedBoucWen, WIDE | {f"b{k}": (-0.5, 0.5) for k in range(2, 7)}),
    "Baber-Noori": (hs.BoucWenBaberNoori, WIDE | starts.RATES | starts.PINCH),
    "Dahl": (hs.Dahl, starts.DAHL | {"feedthrough": (-5.0, 5.0)}),
    "Coleman-Hodgdon": (hs.ColemanHodgdon, starts.COLEMAN_HODGDON),
    "parametric plays": (hs.ParametricPrandtlIshlinskii, starts.PLAYS_WITH_DENSITY),
    "ten plays": (
        hs.PrandtlIshlinskii.structure(plays=PLAYS),
        {f"weights[{k}]": (-5.0, 5.0) for k in range(PLAYS)} | {"offset": (-3.0, 3.0)},
    ),
}
MAGNET = ("Bouc-Wen", "Coleman-Hodgdon", "parametric plays", "ten plays")
DAMPER = ("Bouc-Wen", "polynomial Bouc-Wen", "Dahl", "ten plays")
STEEL = ("Bouc-Wen", "generalised Bouc-Wen", "Zhu-Wang", "Baber-Noori")
MIRROR = ("Bouc-Wen", "Zhu-Wang", "ten plays")

Row = dict[str, Any]


class Measured(NamedTuple):
    """A record and the families by which it is identified."""

    device: str
    record: hs.Record
    families: tuple[str, ...]


def measured(folder: Path) -> Iterator[Measured]:
    """The records of a folder, those of few samples first."""
    for material in AMPLITUDES:
        for loop in core_loops(folder, material):
            yield Measured("magnet", loop, MAGNET)
    for k in (1, 2, 3):
        path = folder / "steel_resspylab" / f"example_{k}.csv"
        record = hs.load(path, u="e_true", y="Sigma_true", name=f"coupon {k}")
        yield Measured("steel", record, STEEL)
    for k in (1, 2, 4):
        path = folder / "mr_damper_labcontrol" / f"data_simulation_4.{k}_MRdamper.mat"
        motion, velocity, force = (column(path, f"x_F[{place}]") for place in range(3))
        yield Measured("damper", hs.Record(u=motion, y=force, name=f"4.{k} over displacement"), DAMPER)
        yield Measured("damper", hs.Record(u=velocity, y=force, name=f"4.{k} over velocity"), ("Bouc-Wen",))
    for level in (100, 300):
        path, place = folder / "fsm_cubespec" / "fsm_subset.npz", f"{level}mV_train[0,0,0]"
        record = hs.load(path, u=f"u_{place}", y=f"y_{place}", t=False, name=f"{level} mV")
        yield Measured("mirror", record, MIRROR)


def stand_in() -> Measured:
    """A simulated record in place of measured ones."""
    u = hs.signals.triangle(-3.0, 3.0, cycles=2, samples_per_cycle=60)
    y = 5.0 * hs.Dahl(stiffness=4.0, coulomb=1.5).response(u) + 0.1 * np.sin(40.0 * u)
    return Measured("stand-in", hs.Record(u=u, y=y, name="triangle"), ("Dahl",))


def case(device: str, record: hs.Record, family: str, seed: int = 0) -> Row:
    """One record and family: sums of squares over each other, and seconds of the processor."""
    subject, ranges = FAMILIES[family]
    few = slice(None, None, max(1, len(record) // 60))
    hs.identify(subject, hs.Record(u=record.u[few], y=record.y[few]))  # which compiles what the clock is not for
    begin = time.process_time()
    fit = hs.identify(subject, record, admissible=False)
    seconds = time.process_time() - begin
    unit = float(np.abs(record.y).max())
    cost = float(np.sum((fit.residual / unit) ** 2))

    scaled = hs.Record(u=record.u / np.abs(record.u).max(), y=record.y / unit)
    again = hs.identify(subject, scaled, admissible=False, seed=seed + 1)
    box = {name: pair for name, pair in ranges.items() if name in again.model.scalars}
    patience = max(SHORTEST, starts.PATIENCE * seconds)
    peer = starts.Peer(again.model, box, scaled.u, scaled.y, LIMITS)
    second = float(np.sum(again.residual**2))
    start = min(second, peer.from_law(min(patience, LONGEST)))
    scipy = peer.from_random_starts(np.random.default_rng(seed), min(patience, LONGEST))
    least = min(start, scipy.cost)
    return {
        "device": device,
        "record": record.name,
        "family": family,
        "samples": len(record),
        "parameters": len(box),
        "kept": fit.n_parameters,
        "seconds": seconds,
        "error_percent": 100.0 - fit.fit_percent,
        "success": fit.success,
        "at_bound": "search bound" in fit.message,
        "over_best_known": cost / min(cost, least),
        "over_second_call": cost / second,
        "over_best_start": cost / start,
        "over_scipy": cost / scipy.cost if np.isfinite(scipy.cost) else None,
        "scipy_starts": scipy.n,
        "scipy_seconds": scipy.seconds,
        "scipy_is_shortened": patience > LONGEST and scipy.seconds >= LONGEST,
        "reached": starts.reaches(fit, cost, least, len(box)),
        "beaten_by_scipy": not starts.reaches(fit, cost, scipy.cost, len(box)),
    }


def main(smoke: bool = False, folder: Path | None = None) -> list[Row]:
    """Run all cases, store each as it is done, print, and write table, figure and result."""
    if smoke or folder is None:
        device, record, families = stand_in()
        return [case(device, record, families[0])]
    cases = {
        (device, record.name, family): (device, record, family)
        for device, record, families in measured(folder)
        for family in families
    }
    rows = stored_cases(RESULTS, ("device", "record", "family"), cases, timed_case, line_of)
    return write_results(RESULTS, rows, draw, summary(rows))


def timed_case(arguments: tuple[str, hs.Record, str]) -> Row:
    row, seconds = cpu_timed(case, *arguments)
    return {**row, "total_seconds": seconds}


def line_of(row: Row) -> str:
    """A case as it is printed."""
    scipy = "-" if row["over_scipy"] is None else f"{row['over_scipy']:.4f}"
    return (
        f"{row['device']:<7} {row['record']:<22} {row['family']:<20} {row['seconds']:6.2f} s "
        f"{row['error_percent']:8.4f} %  over best known {row['over_best_known']:.6f}, over SciPy {scipy} "
        f"({row['scipy_starts']} starts){'' if row['reached'] else ', NOT reached'}"
    )


def summary(rows: list[Row]) -> dict[str, Any]:
    """The numbers that are quoted."""
    return {
        "cases": len(rows),
        "records": len({(row["device"], row["record"]) for row in rows}),
        "reached_percent": starts.share_percent(rows, "reached"),
        "beaten_by_scipy_percent": starts.share_percent(rows, "beaten_by_scipy"),
        "shortened_scipy_percent": starts.share_percent(rows, "scipy_is_shortened"),
        "longest_scipy_seconds": LONGEST,
        "not_converged": sum(not row["success"] for row in rows),
        "worst_over_best_known": max(row["over_best_known"] for row in rows),
        "total_seconds": sum(row["total_seconds"] for row in rows),
        **median_and_worst("seconds", (row["seconds"] for row in rows)),
        "lost": [
            {name: row[name] for name in ("device", "record", "family", "over_best_known", "over_scipy", "at_bound")}
            for row in rows
            if not row["reached"]
        ],
        "families": {
            family: {
                "cases": len(own),
                "reached_percent": starts.share_percent(own, "reached"),
                "worst_over_best_known": max(row["over_best_known"] for row in own),
                **median_and_worst("seconds", (row["seconds"] for row in own)),
            }
            for family, own in _by_family(rows).items()
        },
    }


def _by_family(rows: list[Row]) -> dict[str, list[Row]]:
    groups = {family: [row for row in rows if row["family"] == family] for family in FAMILIES}
    return {family: own for family, own in groups.items() if own}


def draw(rows: list[Row]) -> Figure:
    """Cost over the best known, and seconds, by family."""
    groups = _by_family(rows)
    ordered = [row for own in groups.values() for row in own]
    places = [x + 0.6 * ((k + 0.5) / len(own) - 0.5) for x, own in enumerate(groups.values()) for k in range(len(own))]
    return starts.draw_cases(ordered, places, list(groups), "CPU s")


if __name__ == "__main__":
    main(folder=Path(sys.argv[1]))
