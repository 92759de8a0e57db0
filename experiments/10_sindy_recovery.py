"""How often does sparse regression find the law that made the data? `hs.discover` beside PySINDy as it comes.

A Bouc-Wen law, A = 1, beta = 0.6, gamma = 0.3, n = 1, under a random multisine of 0.25 to 5 Hz whose velocity has an
rms of 6.85; the truth is evaluated at 10 kHz and then sampled. What is measured is the memory z, or only
y = 40 u + 60 z, with normal noise in percent of its rms. "Exact" is the structure u', |u'| z, u' |z| and nothing else,
chosen from ten terms. PySINDy has the same ten terms, its default differentiation, optimizer and threshold, and what
`discover` does not get: the true velocity. Where y is measured it takes y for the memory, as published work does.
Errors are relative to the coefficients, over the seeds with the exact structure.

A second set of records is short and comes at two rates, 240 samples each, one five times as fast: six tones of random
phases, random reversals, and a fading sine, all of peak 2. There the input is straight from sample to sample, as the
law takes it, and PySINDy's velocity is the central difference. "As likely" counts the records in which the true
structure's BIC, refined from the truth, is within 2 of that of the law that `discover` chose: no more can be asked of
any choice that only the records decide. `discover` takes the fewest numbers of what is as likely.

`python experiments/10_sindy_recovery.py resume` measures the conditions that are not stored yet.
"""

import sys
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pysindy

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import name_rows, one_panel, stored_result, wall_timed, write_results

RESULTS = Path(__file__).parent / "results" / "sindy_recovery"
SEEDS = 20
TRUTH = {"u'": 1.0, "u' |z|": -0.3, "|u'| z": -0.6}
FEEDTHROUGH, GAIN = 40.0, 60.0
FREQUENCIES = np.linspace(0.25, 5.0, 20)  # Hz
VELOCITY = 6.85
FINE = 10_000  # Hz, where the truth is evaluated

Row = dict[str, float | str | None]


class Condition(NamedTuple):
    """How one record is made."""

    name: str
    noise: float = 0.01
    amplitude: float = 1.0
    rate: int = 1000
    duration: float = 20.0
    hidden: bool = False
    shape: str = "multisine"


CONDITIONS = (
    *(Condition(f"noise {noise:.0%}", noise) for noise in (0.0, 0.01, 0.05, 0.10)),
    Condition("amplitude / 20", amplitude=0.05),
    Condition("100 Hz", rate=100),
    Condition("2 s", duration=2.0),
    Condition("y = 40 u + 60 z", hidden=True),
)
SHAPES = ("six tones", "random reversals", "fading sine")
SHORT = tuple(
    Condition(f"{shape}, noise {noise:.0%}", noise, shape=shape)
    for shape in SHAPES
    for noise in (0.0, 0.02, 0.05, 0.10)
)
SMOKE = (Condition("noise 1%", rate=100, duration=2.0), SHORT[1])
PER_RATE, FASTER, PEAK = 240, 5.0, 2.0


def short(condition: Condition, seed: int) -> tuple[hs.Record, np.ndarray]:
    """A record at two rates, and the velocity of its input."""
    rng = np.random.default_rng(seed)
    phase = np.arange(PER_RATE) / PER_RATE
    if condition.shape == "six tones":
        turns = rng.uniform(0.0, 1.0, 6)
        one = sum(np.sin(2.0 * np.pi * (k * phase + turn)) for k, turn in zip((1, 2, 3, 5, 7, 9), turns, strict=True))
    elif condition.shape == "random reversals":
        corners = np.append(0.0, rng.uniform(0.3, 1.0, 20) * np.resize([1.0, -1.0], 20))
        one = np.interp(phase, np.linspace(0.0, 1.0, 21), corners)
    else:
        one = np.exp(-3.0 * phase) * np.sin(2.0 * np.pi * (8.0 * phase + rng.uniform()))
    u = np.concatenate([one, one])
    u = PEAK * (u - u[0]) / np.abs(u - u[0]).max()
    t = np.concatenate([phase, 1.0 + phase / FASTER])
    z = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3).memory(u)
    y = z + condition.noise * z.std() * rng.standard_normal(z.size)
    return hs.Record(u=u, y=y, t=t), np.gradient(u, t)


def measured(condition: Condition, seed: int) -> tuple[hs.Record, np.ndarray]:
    """A record, and the true velocity of its input."""
    if condition.shape in SHAPES:
        return short(condition, seed)
    rng = np.random.default_rng(seed)
    t = np.arange(round(condition.duration * FINE)) / FINE
    phases = rng.uniform(0.0, 2.0 * np.pi, FREQUENCIES.size)
    scale = condition.amplitude * VELOCITY / np.sqrt(FREQUENCIES.size / 2.0)
    u, velocity = np.zeros(t.size), np.zeros(t.size)
    for frequency, phase in zip(2.0 * np.pi * FREQUENCIES, phases, strict=True):
        u += scale * np.sin(frequency * t + phase) / frequency
        velocity += scale * np.cos(frequency * t + phase)
    u -= u[0]
    z = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3).memory(u)
    y = FEEDTHROUGH * u + GAIN * z if condition.hidden else z
    kept = slice(None, None, FINE // condition.rate)
    y = y[kept] + condition.noise * y.std() * rng.standard_normal(y[kept].size)
    return hs.Record(u=u[kept], y=y, t=t[kept]), velocity[kept]


def ours(record: hs.Record, condition: Condition) -> Row:
    """What `discover` finds."""
    found, seconds = wall_timed(hs.discover, record, route="output" if condition.hidden else "memory")
    row: Row = {"seconds": seconds, "wrong": float(len(set(found.coefficients) ^ set(TRUTH)))}
    if condition.shape in SHAPES:
        told = found if row["wrong"] == 0.0 else hs.discover(record, route="memory", library=list(TRUTH))
        row["as_likely"] = float(
            set(told.coefficients) == set(TRUTH) and told.scores["bic"] < found.scores["bic"] + 2.0
        )
    if row["wrong"] == 0.0:
        errors = {name: abs(found.coefficients[name] / value - 1.0) for name, value in TRUTH.items()}
        spread = {name: found.stderr[name] / abs(value) for name, value in TRUTH.items()}
        if condition.hidden:
            errors |= {"feedthrough": abs(found.model.feedthrough / FEEDTHROUGH - 1.0)}
            errors |= {"u'": abs(found.model.gain / GAIN - 1.0)}
            spread |= {"feedthrough": found.stderr["feedthrough"] / FEEDTHROUGH, "u'": found.stderr["gain"] / GAIN}
        worst = max(errors, key=lambda name: errors[name])
        row |= {"error": errors[worst], "in_stderr": errors[worst] / spread[worst] if spread[worst] else None}
    return row


TERMS: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "u'": lambda z, v: v,
    "u' |z|": lambda z, v: v * np.abs(z),
    "u' z": lambda z, v: v * z,
    "u' |z| z": lambda z, v: v * np.abs(z) * z,
    "u' z^2": lambda z, v: v * z**2,
    "|u'|": lambda z, v: np.abs(v),
    "|u'| |z|": lambda z, v: np.abs(v) * np.abs(z),
    "|u'| z": lambda z, v: np.abs(v) * z,
    "|u'| |z| z": lambda z, v: np.abs(v) * np.abs(z) * z,
    "|u'| z^2": lambda z, v: np.abs(v) * z**2,
}


def plain(record: hs.Record, velocity: np.ndarray) -> Row:
    """What PySINDy finds with its defaults."""
    library = pysindy.CustomLibrary(list(TERMS.values()), [lambda z, v, name=name: name for name in TERMS])
    model = pysindy.SINDy(feature_library=library)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(record.y[:, np.newaxis], t=record.t, u=velocity[:, np.newaxis])
    found = dict(zip(TERMS, model.coefficients()[0], strict=True))
    kept = {name for name, value in found.items() if value != 0.0}
    row: Row = {"wrong": float(len(kept ^ set(TRUTH)))}
    if row["wrong"] == 0.0:
        row["error"] = max(abs(found[name] / value - 1.0) for name, value in TRUTH.items())
    return row


def one(condition: Condition, seed: int) -> tuple[Row, Row]:
    """Both on one record."""
    record, velocity = measured(condition, seed)
    return ours(record, condition), plain(record, velocity)


def summary(condition: Condition, method: str, rows: list[Row]) -> Row:
    """One line of the table."""
    exact = [row for row in rows if row["wrong"] == 0.0]
    errors = [float(row["error"]) for row in exact]
    in_stderr = [float(row["in_stderr"]) for row in exact if row.get("in_stderr") is not None]
    times = [float(row["seconds"]) for row in rows if "seconds" in row]
    return {
        "condition": condition.name,
        "method": method,
        "seeds": len(rows),
        "exact": len(exact),
        "as_likely": int(sum(row["as_likely"] for row in rows)) if "as_likely" in rows[0] else None,
        "median_wrong_terms": float(np.median([row["wrong"] for row in rows])),
        "median_error_percent": 100.0 * float(np.median(errors)) if errors else None,
        "worst_error_percent": 100.0 * max(errors) if errors else None,
        "worst_in_stderr": max(in_stderr) if in_stderr else None,
        "median_seconds": float(np.median(times)) if times else None,
    }


def main(smoke: bool = False, resume: bool = False) -> list[Row]:
    """Measure, print and write table, figure and result."""
    if smoke:
        return [row for condition in SMOKE for row in both_rows(condition, [one(condition, 0)])]
    stored: list[Row] = stored_result(RESULTS).get("rows", []) if resume else []
    rows = [{"as_likely": None} | row for row in stored]
    for condition in (*CONDITIONS, *SHORT):
        if any(row["condition"] == condition.name for row in rows):
            continue
        with ProcessPoolExecutor(2) as pool:
            measured_rows = both_rows(condition, list(pool.map(one, repeat(condition), range(SEEDS))))
        rows += measured_rows
        for row in measured_rows:
            print(_line(row), flush=True)
        columns = list(measured_rows[0])
        write_results(RESULTS, [{name: row[name] for name in columns} for row in rows], draw, {"seeds": SEEDS})
    return rows


def both_rows(condition: Condition, results: list[tuple[Row, Row]]) -> list[Row]:
    """The lines of both methods."""
    return [summary(condition, method, [each[k] for each in results]) for k, method in enumerate(("hysim", "PySINDy"))]


def _line(row: Row) -> str:
    line = f"{row['condition']:<16} {row['method']:<8} exact {row['exact']:>2} of {row['seeds']}"
    if row["as_likely"] is not None:
        line += f", the truth as likely in {row['as_likely']}"
    if row["worst_error_percent"] is not None:
        line += f", error {row['median_error_percent']:.3f} % median, {row['worst_error_percent']:.3f} % worst"
    if row["worst_in_stderr"] is not None:
        line += f" ({row['worst_in_stderr']:.1f} standard errors)"
    if row["median_seconds"] is not None:
        line += f", {row['median_seconds']:.1f} s"
    return line


def draw(rows: list[Row]) -> Figure:
    """Shares of exact structures, by condition."""
    names = list(dict.fromkeys(row["condition"] for row in rows))
    canvas, ax = one_panel(1.2 + 0.25 * len(names))
    for k, (method, colour) in enumerate((("hysim", "C0"), ("PySINDy", "0.7"))):
        shares = [100.0 * row["exact"] / row["seeds"] for row in rows if row["method"] == method]
        ax.barh(np.arange(len(names)) + 0.2 * (2 * k - 1), shares, height=0.36, color=colour, label=method)
    name_rows(ax, names)
    ax.set(xlabel="Exact structure found [% of seeds]", xlim=(0.0, 100.0))
    canvas.legend(loc="outside lower center", ncols=2)
    return canvas


if __name__ == "__main__":
    main(resume="resume" in sys.argv[1:])
