"""Does a default call of `identify` find the optimum on measured records that nobody tuned it to?

    python experiments/36_measured_records.py FOLDER

takes the folder of the public records below, which are not part of this project, and fits several laws to each. Beside
the default call stands `scipy.optimize.least_squares` on the same law from 20 random starts, in ten times the default
call's time (`random_starts`); both see the record scaled. A memory before the record that is no parameter is told to
SciPy as the default call found it. The default call is beaten if SciPy, or a descent from the default's own end with
every parameter free, has less than 99 % of its sum of squares, and a lower BIC.

- `fsm_cubespec/fsm_subset.npz`: fast steering mirror on piezo actuators under a sixteenth of a multisine, first
  input to first output (M. Floren et al., ISMA 2024, CC BY 4.0)
- `mr_damper_labcontrol/data_simulation_4.*_MRdamper.mat`: magnetorheological damper at three coil supplies,
  displacement to force (LabControl UTFPR, doi 10.5281/zenodo.4445334, MIT)
- `magnetic_jamodel/[HB]_*.mat`: loops of magnetic materials, field to flux density, each column a record (R. Szewczyk,
  github.com/romanszewczyk/JAmodel, MIT)
- `steel_resspylab/*.csv`: coupons of steel under growing cycles, strain to stress (A. de Castro e Sousa,
  github.com/AlbanoCastroSousa/RESSPyLab, MIT)
"""

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.io import loadmat

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from random_starts import (
    COLEMAN_HODGDON,
    DAHL,
    MEMORY,
    OFFSET,
    OUTPUT,
    PATIENCE,
    REACHED,
    Box,
    Peer,
    coefficients,
    reaches,
)
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "measured_records"
PLAYS = 10

FloatArray = npt.NDArray[np.float64]
Row = dict[str, Any]

SUBJECTS: dict[str, tuple[Any, Box]] = {
    "Bouc-Wen": (hs.BoucWen, MEMORY | OUTPUT | {"feedthrough": (-5.0, 5.0)}),
    "polynomial": (hs.PolynomialBoucWen, MEMORY | OUTPUT | coefficients(2)),
    "Zhu-Wang": (hs.ZhuWangBoucWen, MEMORY | OUTPUT | coefficients(1) | {"delta": (-2.0, 2.0)}),
    "Coleman-Hodgdon": (hs.ColemanHodgdon, COLEMAN_HODGDON),
    "Dahl": (hs.Dahl, DAHL),
    "ten plays": (
        hs.PrandtlIshlinskii.structure(plays=PLAYS),
        {f"weights[{k}]": (-5.0, 5.0) for k in range(PLAYS)} | OFFSET,
    ),
}


def records(folder: Path) -> Iterator[tuple[str, FloatArray, FloatArray]]:
    """Name, input and output of every record under the folder."""
    mirror = np.load(folder / "fsm_cubespec" / "fsm_subset.npz")
    for level in ("100mV", "300mV"):
        u, y = (np.asarray(mirror[f"{name}_{level}_train"][:512, 0, 0, 0], dtype=float) for name in "uy")
        yield f"mirror {level}", u, y
    for file in sorted((folder / "mr_damper_labcontrol").glob("data_simulation_4.*_MRdamper.mat")):
        columns = loadmat(file)["x_F"]
        yield f"damper {file.stem.split('_')[2]}", columns[:, 0], columns[:, 2]
    for file in sorted((folder / "magnetic_jamodel").glob("H_*.mat")):
        fields = loadmat(file)["HmeasT"]
        fluxes = loadmat(file.with_name("B" + file.name[1:]))["BmeasT"]
        for k, (u, y) in enumerate(zip(np.atleast_2d(fields.T), np.atleast_2d(fluxes.T), strict=True), 1):
            seen = np.isfinite(u) & np.isfinite(y)
            yield f"magnet {file.stem[2:]} {k}", u[seen], y[seen]
    for file in sorted((folder / "steel_resspylab").glob("*.csv")):
        columns = np.genfromtxt(file, delimiter=",", names=True)
        yield f"steel {file.stem}", columns["e_true"], columns["Sigma_true"]


def row(name: str, u: FloatArray, y: FloatArray, law: str) -> Row:
    """Both fits of one law to one record."""
    subject, box = SUBJECTS[law]
    u, y = (x / np.abs(x).max() for x in (u, y))
    record = hs.Record(u=u, y=y)
    few = slice(None, None, max(1, y.size // 60))
    hs.identify(subject, hs.Record(u=u[few], y=y[few]))  # which compiles what the clock is not for
    begin = time.perf_counter()
    fit = hs.identify(subject, record)
    seconds = time.perf_counter() - begin
    cost = float(np.sum(fit.residual**2))
    peer = Peer(fit.model, box, u, y)
    rng = np.random.default_rng(0)
    ended, scipy = peer.from_law(), peer.from_random_starts(rng, PATIENCE * seconds)
    return {
        "record": name,
        "law": law,
        "samples": y.size,
        "seconds": seconds,
        "error_percent": 100.0 - fit.fit_percent,
        "over_scipy": cost / scipy.cost if np.isfinite(scipy.cost) else None,
        "over_its_own_end": cost / ended,
        "scipy_starts": scipy.n,
        "scipy_seconds": scipy.seconds,
        "beaten": not reaches(fit, cost, min(scipy.cost, ended), len(box)),
        "better": bool(scipy.cost > REACHED * cost),
    }


def main(smoke: bool = False, folder: Path | None = None) -> list[Row]:
    """Fit every law to every record of the folder, print, and write table, figure and result."""
    if smoke:
        u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
        return [row("simulated", u, hs.BoucWen(beta=2.0, gamma=0.5).response(u), "Dahl")]
    if folder is None:
        raise SystemExit(__doc__)
    rows = []
    for name, u, y in records(folder):
        for law in SUBJECTS:
            rows.append(row(name, u, y, law))
            print(line_of(rows[-1]), flush=True)
    numbers = summary(rows)
    for key, value in numbers.items():
        print(key, value)
    write_results(RESULTS, rows, draw, numbers)
    return rows


def line_of(row: Row) -> str:
    """A row as it is printed."""
    scipy = "-" if row["over_scipy"] is None else f"{row['over_scipy']:.4f}"
    return (
        f"{row['record']:<24} {row['law']:<16} {row['samples']:6d} samples {row['seconds']:7.2f} s "
        f"{row['error_percent']:8.3f} %  over SciPy {scipy} ({row['scipy_starts']} starts), "
        f"over its own end {row['over_its_own_end']:.4f}{', BEATEN' if row['beaten'] else ''}"
    )


def summary(rows: list[Row]) -> dict[str, Any]:
    """The numbers that are quoted."""
    seconds = np.array([row["seconds"] for row in rows])
    worst = max(rows, key=lambda row: row["over_scipy"] or 0.0)
    return {
        "records": len({row["record"] for row in rows}),
        "laws": len(SUBJECTS),
        "fits": len(rows),
        "beaten_by_scipy": sum(row["beaten"] for row in rows),
        "better_than_scipy": sum(row["better"] for row in rows),
        "worst_over_scipy": worst["over_scipy"],
        "worst": f"{worst['law']} on {worst['record']}",
        "median_seconds": float(np.median(seconds)),
        "worst_seconds": float(seconds.max()),
        "total_seconds": float(sum(row["seconds"] + row["scipy_seconds"] for row in rows)),
    }


def draw(rows: list[Row]) -> Figure:
    """Sum of squares over SciPy's, by law."""
    canvas = figure()
    ax = canvas.subplots()
    for k, law in enumerate(SUBJECTS):
        ratios = np.array([row["over_scipy"] for row in rows if row["law"] == law], dtype=float)
        ax.plot(k + np.linspace(-0.25, 0.25, ratios.size), ratios, marker="o", markersize=3.5, linestyle="none")
    ax.axhline(1.0, color="#999999", linewidth=0.8)
    ax.set(yscale="log", ylabel="Sum of squares of the default call over SciPy's")
    ax.set_xticks(range(len(SUBJECTS)), SUBJECTS, rotation=20, ha="right")
    return canvas


if __name__ == "__main__":
    main(folder=Path(sys.argv[1]) if sys.argv[1:] else None)
