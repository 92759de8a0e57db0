"""How far is each model of Table 1 off at a point that nothing about it was chosen with?

A left-out error is honest only if every choice is made again without the point: the structure of a discovered law, the
starts and the optimum of an identified one. Here each of the 50 points between the first and the last is taken out of
the record in turn, the whole search runs on the other 51, and the law that it returns predicts the point along the
full input. The output of a rate-independent law does not depend on a sample that is left out between two others of its
branch, and each reversal has two samples, so that the input stays what it was. Both ends stay in: nothing comes before
the first, and the paper's loop closes at the last. The linear plant needs even times, and is fitted again from its
best optima with the point's weight at zero.

Where it applies, memories that begin at a value of their own stand beside those that begin at rest, which are one
parameter fewer. "Duhem, 5 terms" keeps the terms that were found on all points: the discovered law's left-out error
less this one's is the price of choosing the terms. How far a model is behind the best of the others is said in
standard errors of the mean difference of their squared errors, point by point.

Rows are stored one by one, and beside the other results in `hysim/data/table1_nested.csv`, which `hysim reproduce`
quotes; `python experiments/33_nested_table1.py resume` goes on after those that are stored.
"""

import csv
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.patches import Patch

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import name_rows, one_panel, stored_result, write_results

RESULTS = Path(__file__).parent / "results" / "nested_table1"
STORED = Path(hs.__file__).parent / "data" / "table1_nested.csv"
COLUMNS = (
    "model", "start", "n_parameters", "fit_percent", "left_out_rmse_um", "behind_in_stderr", "same_structure", "folds",
    "terms_kept",
)  # fmt: skip
RECORD = hs.datasets.table1(dwell=1.0)
POINTS = range(1, len(RECORD) - 1)
KEPT = "Duhem, 5 terms"
FIVE_TERMS = {"u'": 0.024, "u' y^2": -0.0013, "|u'|": -0.007, "|u'| u": 0.00024, "|u'| y^2": -0.003}
STARTS = ("auto", "free", "rest")
PLANT = hs.TransferFunction.structure(poles=4, zeros=1, hold="zoh", sample="start", initial="rest")

Row = dict[str, Any]
Result = hs.Discovery | hs.Identification
Find = Callable[[hs.Record], Result]


class Rival(NamedTuple):
    """A model, how its memory begins, and what finds it in a record."""

    name: str
    start: str
    find: Find


def identified(family: Any, start: str | None = None, **fixed: float) -> Find:
    """What identifies a family, with some parameters fixed."""
    return lambda record: hs.identify(family, record, initial=start, fixed=fixed, admissible=False)


def rivals() -> list[Rival]:
    """Every model, the quicker ones first."""
    simple = [
        Rival("line", "", identified(hs.Line)),
        Rival("single-valued curve", "", identified(hs.SingleValued)),
        Rival("Prandtl-Ishlinskii", "rest", identified(hs.PrandtlIshlinskii)),
        Rival("Play", "free", identified(hs.Play)),
    ]
    families = {
        "Dahl": (hs.Dahl, {}),
        "Coleman-Hodgdon": (hs.ColemanHodgdon, {}),
        KEPT: (hs.Duhem.from_terms(FIVE_TERMS), {}),
        "Bouc-Wen, quadratic input, n = 1": (hs.PolynomialBoucWen, {"n": 1.0}),
        "Bouc-Wen, quadratic input": (hs.PolynomialBoucWen, {}),
        "Bouc-Wen": (hs.BoucWen, {}),
        "Zhu-Wang": (hs.ZhuWangBoucWen, {}),
    }
    law = [Rival("discovered", start, lambda record, s=start: hs.discover(record, initial=s)) for start in STARTS]
    both = [
        Rival(name, start, identified(family, start, **fixed))
        for name, (family, fixed) in families.items()
        for start in STARTS[1:]
    ]
    return [*simple, *both[:8], *law, *both[8:]]


def without(point: int) -> hs.Record:
    """Table 1 without one of its points."""
    kept = np.arange(len(RECORD)) != point
    return hs.Record(u=RECORD.u[kept], y=RECORD.y[kept], t=RECORD.t[kept], resolution=RECORD.resolution)


def nested(rival: Rival, points: range) -> Row:
    """One line of the table: the model on all points, and its errors where it was searched without the point."""
    began = time.process_time()
    whole = rival.find(RECORD)
    laws = [rival.find(without(point)) for point in points]
    errors = [RECORD.y[k] - law.model.response(RECORD.u)[k] for k, law in zip(points, laws, strict=True)]
    return row(rival, whole, errors, laws, time.process_time() - began)


def linear_plant(points: range) -> Row:
    """The line of the linear plant."""
    began = time.process_time()
    fit = hs.identify(PLANT, RECORD, cross_validate="loo")
    errors = [float(fit.cv_residual[k]) for k in points]
    return row(Rival("linear plant, 4 poles", "rest", identified(PLANT)), fit, errors, [], time.process_time() - began)


def row(rival: Rival, whole: Result, errors: list[float], laws: list[Result], seconds: float) -> Row:
    """One line of the table."""
    scores = whole.scores if isinstance(whole, hs.Discovery) else vars(whole)
    structures = [tuple(law.coefficients) for law in laws if isinstance(law, hs.Discovery)]
    same = [terms == tuple(whole.coefficients) for terms in structures] if isinstance(whole, hs.Discovery) else []
    return {
        "model": rival.name,
        "start": rival.start,
        "n_parameters": whole.n_parameters,
        "fit_percent": float(scores["fit_percent"]),
        "bic": float(scores["bic"]),
        "left_out_rmse_um": float(np.sqrt(np.mean(np.square(errors)))),
        "largest_left_out_um": float(np.abs(errors).max()),
        "folds": len(errors),
        "same_structure": sum(same) if same else None,
        "structures": len(set(structures)) if structures else None,
        "searched_again": bool(laws),
        "terms_kept": rival.name == KEPT,
        "cpu_seconds": seconds,
        "errors_um": [float(error) for error in errors],
    }


def behind(rows: list[Row]) -> list[Row]:
    """The rows, best first, each with its distance to the best whose terms were not kept from all points."""
    ordered = sorted(rows, key=lambda row: row["left_out_rmse_um"])
    best = np.square(next(row["errors_um"] for row in ordered if not row["terms_kept"]))
    for each in ordered:
        difference = np.square(each["errors_um"]) - best
        spread = float(difference.std(ddof=1)) / np.sqrt(difference.size)
        each["behind_in_stderr"] = float(difference.mean() / spread) if spread > 0.0 else 0.0
    return ordered


def main(smoke: bool = False, resume: bool = False) -> list[Row]:
    """Measure, print and write table, figure and result."""
    if smoke:
        quick = [each for each in rivals() if each.name in ("line", "Play")]
        return behind([nested(each, POINTS[:2]) for each in quick])
    rows = _stored() if resume else []
    done = {(row["model"], row["start"]) for row in rows}
    tasks: dict[tuple[str, str], Callable[[], Row]] = {("linear plant, 4 poles", "rest"): lambda: linear_plant(POINTS)}
    tasks |= {(each.name, each.start): lambda each=each: nested(each, POINTS) for each in rivals()}
    for name, measure in tasks.items():
        if name not in done:
            rows = _written([*rows, measure()])
            print(_line(next(row for row in rows if (row["model"], row["start"]) == name)), flush=True)
    return _written(rows)


def _stored() -> list[Row]:
    before = {"rows": [], "errors_um": []} | stored_result(RESULTS)
    return [row | {"errors_um": errors} for row, errors in zip(before["rows"], before["errors_um"], strict=True)]


def _written(rows: list[Row]) -> list[Row]:
    rows = behind(rows)
    table = [{name: value for name, value in row.items() if name != "errors_um"} for row in rows]
    write_results(RESULTS, table, draw, {"points": len(POINTS), "errors_um": [row["errors_um"] for row in rows]})
    store(table)
    return rows


def store(table: list[Row]) -> None:
    """Write the figures that the report quotes."""
    with STORED.open("w", newline="", encoding="utf-8") as file:
        file.write(
            "# Table 1: errors at points that the whole search has not seen, from experiments/33_nested_table1.py\n"
        )
        writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)


def _line(row: Row) -> str:
    line = (
        f"{row['model']:<34} {row['start']:<5} {row['n_parameters']:>2} parameters, fit {row['fit_percent']:.2f} %, "
        f"BIC {row['bic']:.1f}, left out {row['left_out_rmse_um']:.4f} um, {row['behind_in_stderr']:.1f} stderr behind"
    )
    return line if row["same_structure"] is None else f"{line}, {row['same_structure']} of {row['folds']} as on all"


def draw(rows: list[Row]) -> Figure:
    """Left-out errors, the least on top."""
    canvas, axes = one_panel(0.7 + 0.24 * len(rows))
    places = np.arange(len(rows))
    colours = ["C0" if row["model"] == "discovered" else "0.85" if row["terms_kept"] else "0.6" for row in rows]
    axes.barh(places, [1e3 * row["left_out_rmse_um"] for row in rows], color=colours)
    name_rows(axes, [", ".join(filter(None, (row["model"], row["start"]))) for row in rows])
    axes.set(xlabel="Left-out rmse [nm]")
    meanings = {"C0": "terms searched anew", "0.85": "terms kept", "0.6": "family fixed"}
    axes.legend(handles=[Patch(color=colour, label=words) for colour, words in meanings.items()], loc="upper right")
    return canvas


if __name__ == "__main__":
    main(resume="resume" in sys.argv[1:])
