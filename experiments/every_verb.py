"""What each verb of hysim says of one fit: the fit of the returned model to the record as it was measured [%]."""

import contextlib
import csv
import io
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable

import numpy as np

import hysim as hs
from hysim.metrics import fit_percent
from hysim.plot import figure

Shell = Callable[..., tuple[int, str]]

PRINTED = 0.005
"""Half of the last digit of a fit in a summary [%]."""


def in_a_process(*words: str) -> tuple[int, str]:
    """Exit code and standard output of the command line."""
    done = subprocess.run([sys.executable, "-m", "hysim", *words], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


def numbers_of_every_verb(
    fit: hs.Identification, rec: hs.Record, shell: Shell | None = in_a_process
) -> dict[str, float]:
    """The fit that each verb reports or draws, by its name; all are equal to rounding.

    The fit is one of a single record, in which every sample has a weight. An actuator's run is the reading of its
    sensor, if it has one. Those whose names end with "printed" have two decimals. Without a `shell` the command line is
    left out; commands that refuse the model, as ``hysim control`` refuses one without an inverse, are missing.
    """
    spread = float(np.linalg.norm(rec.y - rec.y.mean()))

    def of_rms(rms: float) -> float:
        return 100.0 * (1.0 - rms * np.sqrt(len(rec)) / spread)

    numbers = {
        "identify, fit_percent": fit.fit_percent,
        "identify, rmse": of_rms(fit.rmse),
        "identify, residual": 100.0 * (1.0 - float(np.linalg.norm(fit.residual)) / spread),
        "identify, summary, printed": _printed(fit.summary()),
        "identify, str, printed": _printed(str(fit)),
        "simulate": fit_percent(rec.y, _read(hs.simulate(fit, rec.t, rec.u))),
        "simulate, model": fit_percent(rec.y, _read(hs.simulate(fit.model, rec.t, rec.u))),
        "plot.identification": fit_percent(rec.y, _drawn(lambda axes: hs.plot.identification(fit, rec, axes)[0], 3)),
        "plot.identification, residuals": _of_residuals(fit, rec, spread),
        "plot.loop": fit_percent(rec.y, _drawn(lambda axes: hs.plot.loop(rec, fit, ax=axes[0]))),
        "plot.loop, model": fit_percent(rec.y, _drawn(lambda axes: hs.plot.loop(rec, fit.model, ax=axes[0]))),
    }
    with contextlib.suppress(ValueError):  # of a record without a complete cycle
        table = hs.compare({"fit": fit, "model": fit.model}, rec)
        numbers |= {f"compare, {row.name}": row.fit_percent for row in table.rows}
        numbers |= {f"compare, {row.name}, rmse": of_rms(row.rmse) for row in table.rows}
    with tempfile.TemporaryDirectory() as folder:
        law, data = f"{folder}/law.json", f"{folder}/record.npz"
        hs.save(fit, law, units=rec.units)
        hs.save_record(rec, data)
        numbers["load_model"] = fit_percent(rec.y, _read(hs.simulate(hs.load_model(law), rec.t, rec.u)))
        return numbers | ({} if shell is None else _of_the_shell(rec, law, data, shell))


def _of_the_shell(rec: hs.Record, law: str, data: str, shell: Shell) -> dict[str, float]:
    numbers = {}
    code, text = shell("simulate", law, data, "--out", "-")
    if code == 0:
        rows = list(csv.reader(io.StringIO(text)))
        place = next(k for k, name in enumerate(rows[0]) if name.split(" ")[0] == "y")
        numbers["hysim simulate"] = fit_percent(rec.y, [float(row[place]) for row in rows[1:]])
    code, text = shell("compare", data, "--model", law, "--json")
    if code == 0:
        numbers["hysim compare"] = json.loads(text)["rows"][0]["fit_percent"]
    code, text = shell("control", law, "--record", data, "--sample-time", "1e-3", "--controller", "inverse", "--json")
    if code == 0:
        numbers["hysim control --record"] = json.loads(text)["record_fit_percent"]
    return numbers


def _read(run: hs.Simulation) -> np.ndarray:
    return run.signals.get("measurement", run.y)


def _drawn(draw: Callable[[np.ndarray], object], n: int = 1) -> np.ndarray:
    """Heights of the last line of the first of `n` Axes."""
    axes = np.atleast_1d(figure().subplots(1, n))
    draw(axes)
    return np.asarray(axes[0].lines[-1].get_ydata())


def _of_residuals(fit: hs.Identification, rec: hs.Record, spread: float) -> float:
    panel = hs.plot.identification(fit, rec, figure().subplots(1, 3))[1]
    residual = max((np.asarray(line.get_ydata()) for line in panel.lines), key=len)
    return float(100.0 * (1.0 - np.linalg.norm(residual * (fit.resolution or 1.0)) / spread))


def _printed(text: str) -> float:
    return float(re.search(r"fit ([-+.\de]+) %, rmse", text)[1])


def largest_difference(numbers: dict[str, float]) -> float:
    """The largest difference of two of these numbers [%], beyond the digits that are printed."""
    values = [each for name, each in numbers.items() if not name.endswith("printed")]
    beyond = [abs(each - values[0]) - PRINTED for name, each in numbers.items() if name.endswith("printed")]
    return max(max(values) - min(values), *beyond, 0.0)
