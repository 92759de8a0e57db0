"""Which model do the paper's 52 points prefer, and how surely?

The evidence of a model is the mean of its likelihood over its priors: the probability that it gives to the points
before it has seen them. The points are rounded to pixels of the camera, and so is the likelihood (noise "quantised").
Priors are flat in the box of the search, and linear parameters flat within three spans of the output of what they add
to it. Evidences depend on these boxes. Each is therefore computed with all boxes halved, as they are, and doubled, and
a preference counts only where the three agree.

ln Z comes from bridge sampling, and with the boxes of the search from nested sampling too, by dynesty, which shares
nothing with it but the likelihood. Both are measured in one run, in processor time. "Duhem, 5 terms" keeps the terms
that `hysim.discover` found on all points, and its box stands about the coefficients that it found: the evidence does
not count that search. The memory of every model is free at the first point.

Each evidence is stored when it is there; `python experiments/49_evidence.py resume` goes on after those. Models that
have all of them stand in `hysim/data/table1_evidence.csv`, which `hysim reproduce` quotes.
"""

import csv
import json
import math
import sys
from pathlib import Path
from typing import Any

import hysim as hs
from hysim.plot import Figure, figure
from hysim.posterior import FACTORS, Evidence, EvidenceRow, log_evidence

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import cpu_timed, stored_result, write_results

RESULTS = Path(__file__).parent / "results" / "evidence"
FIVE_TERMS = {"u'": 0.024, "u' y^2": -0.0013, "|u'|": -0.007, "|u'| u": 0.00024, "|u'| y^2": -0.003}
LIVE_POINTS = 250
STORED = Path(hs.__file__).parent / "data" / "table1_evidence.csv"
NESTED = "nested_ln_evidence", "nested_error"

Row = dict[str, Any]


def models() -> dict[str, tuple[Any, dict[str, float]]]:
    """Models, the quicker ones first, and what is held of them."""
    return {
        "line": (hs.Line, {}),
        "Play": (hs.Play, {}),
        "Dahl": (hs.Dahl, {}),
        "Coleman-Hodgdon": (hs.ColemanHodgdon, {}),
        "Bouc-Wen, n = 1": (hs.BoucWen, {"n": 1.0}),
        "Bouc-Wen, quadratic input, n = 1": (hs.PolynomialBoucWen, {"n": 1.0}),
        "Bouc-Wen": (hs.BoucWen, {}),
        "Duhem, 5 terms": (hs.Duhem.from_terms(FIVE_TERMS), {}),
    }


def measured(name: str, factor: float, method: str, live_points: int = LIVE_POINTS, **fixed: float) -> Row:
    """One evidence, with further parameters held."""
    rec = hs.datasets.table1()
    family, held = models()[name]
    fit = hs.identify(family, rec, fixed=held | fixed, admissible=False)
    options = {"factor": factor, "method": method, "live_points": live_points}
    found, seconds = cpu_timed(log_evidence, fit, rec, noise="quantised", **options)
    return {
        "model": name,
        "n_parameters": fit.n_parameters,
        "fit_percent": fit.fit_percent,
        "factor": factor,
        "method": method,
        "log_evidence": found.value,
        "error": found.error if math.isfinite(found.error) else None,
        "evaluations": found.evaluations,
        "cpu_seconds": seconds,
    }


def tasks() -> list[tuple[str, float, str]]:
    """Every evidence, those of bridge sampling first."""
    bridge = [(name, factor, "bridge") for name in models() for factor in FACTORS]
    return [*bridge, *((name, 1.0, "nested") for name in models())]


def as_evidence(rows: list[Row]) -> Evidence:
    """The evidences by bridge sampling of models in which all three were found."""
    by_model: dict[str, dict[float, Row]] = {}
    for row in rows:
        if row["method"] == "bridge" and row["error"] is not None:
            by_model.setdefault(row["model"], {})[row["factor"]] = row
    complete = [
        EvidenceRow(
            name=name,
            n_parameters=each[1.0]["n_parameters"],
            fit_percent=each[1.0]["fit_percent"],
            log_evidence=tuple(each[factor]["log_evidence"] for factor in FACTORS),
            error=tuple(each[factor]["error"] for factor in FACTORS),
            n_evaluations=sum(row["evaluations"] for row in each.values()),
        )
        for name, each in by_model.items()
        if len(each) == len(FACTORS)
    ]
    ordered = sorted(complete, key=lambda row: -row.log_evidence[FACTORS.index(1.0)])
    return Evidence(rows=tuple(ordered), noise="quantised", method="bridge")


def main(smoke: bool = False, resume: bool = False) -> list[Row]:
    """Measure, print and write table, figure and result."""
    if smoke:
        return [measured("line", 1.0, method, live_points=6, offset=0.0) for method in ("bridge", "nested")]
    rows = stored_result(RESULTS).get("rows", []) if resume else []
    done = {(row["model"], row["factor"], row["method"]) for row in rows}
    for task in tasks():
        if task not in done:
            rows.append(measured(*task))
            print(
                {key: rows[-1][key] for key in ("model", "factor", "method", "log_evidence", "error", "cpu_seconds")},
                flush=True,
            )
            _write(rows)
    return rows


def _write(rows: list[Row]) -> None:
    found = as_evidence(rows)
    if not found.rows:
        RESULTS.mkdir(parents=True, exist_ok=True)
        (RESULTS / "result.json").write_text(json.dumps({"rows": rows}, indent=2) + "\n", encoding="utf-8")
        return
    numbers = {
        "sentence": found.sentence,
        "undecided": list(found.undecided),
        "probabilities": {str(factor): found.probabilities(factor) for factor in FACTORS},
        "largest_error": max(max(row.error) for row in found.rows),
        "largest_difference_of_methods": _largest_difference(rows),
    }
    write_results(RESULTS, rows, lambda _: draw(found), numbers)
    store(found, rows)


def store(found: Evidence, rows: list[Row]) -> None:
    """Write the figures that the report quotes."""
    nested = {row["model"]: (row["log_evidence"], row["error"]) for row in rows if row["method"] == "nested"}
    columns = [f"{name}_x{factor:g}" for factor in FACTORS for name in ("ln_evidence", "error")]
    with STORED.open("w", newline="", encoding="utf-8") as file:
        file.write("# Table 1: ln of the evidence of each model, from experiments/49_evidence.py\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["model", "n_parameters", "fit_percent", "n_evaluations", *columns, *NESTED])
        for row in found.rows:
            values = [each for pair in zip(row.log_evidence, row.error, strict=True) for each in pair]
            own = nested.get(row.name, ("", ""))
            writer.writerow([row.name, row.n_parameters, row.fit_percent, row.n_evaluations, *values, *own])


def _largest_difference(rows: list[Row]) -> float | None:
    """Largest difference of ln Z by nested sampling and by bridge sampling, in their standard errors together."""
    values = {(row["model"], row["factor"], row["method"]): row for row in rows}
    pairs = [(row, values[row["model"], 1.0, "bridge"]) for row in rows if row["method"] == "nested"]
    sizes = [abs(a["log_evidence"] - b["log_evidence"]) / (a["error"] ** 2 + b["error"] ** 2) ** 0.5 for a, b in pairs]
    return max(sizes, default=None)


def draw(found: Evidence) -> Figure:
    """ln Z below that of the best model."""
    canvas = figure(height=1.3 + 0.34 * len(found.rows))
    hs.plot.evidence(found, canvas.add_subplot())
    return canvas


if __name__ == "__main__":
    main(resume="resume" in sys.argv[1:])
