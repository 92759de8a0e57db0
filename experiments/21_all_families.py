"""Which family of models predicts the 52 points of the paper's first table best, and what can they not decide?

Every family that can be identified without being told more is fitted to the same points, one sample left out at a
time. The winner has the least leave-one-out rmse; a family whose absolute errors on the samples left out do not differ
from the winner's, by signed ranks at 5 % after Holm's correction, is not told from it. Times are those of a second
call, when everything is compiled.
"""

import sys
import time
from pathlib import Path
from typing import Any

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import draw_models, write_results

RESULTS = Path(__file__).parent / "results" / "all_families"
RECORD = hs.datasets.table1(dwell=1.0)
MOST = 20.0  # seconds that the comparison is to take once compiled
Row = dict[str, Any]


def rows_of(table: hs.Comparison) -> list[Row]:
    """The figures of each family, the best first, with the probability that it predicts as well as the winner."""
    typical = {each.name: each.typical_ratio for each in table.contrasts}
    return [
        {
            "model": row.name,
            "parameters": row.n_parameters,
            "fit_percent": row.fit_percent,
            "rmse": row.rmse,
            "loo_rmse": row.cv_rmse,
            "largest_residual_pixels": row.max_residual / RECORD.resolution,
            "width_error_percent": row.width_error_percent,
            "area_error_percent": row.area_error_percent,
            "bic": row.bic,
            "rate_independent": row.is_rate_independent,
            "typical_ratio": typical.get(row.name, 1.0),
            "probability": table.probabilities.get(row.name),
        }
        for row in table.ranked()
    ]


def main(smoke: bool = False) -> list[Row]:
    """Compare all families, print the table and write it."""
    models = {"Line": hs.Line, "Play": hs.Play} if smoke else "all"
    table = hs.compare(models, RECORD)
    begin, processor = time.perf_counter(), time.process_time()
    if not smoke:
        table = hs.compare(models, RECORD)
    numbers = {
        "winner": table.winner,
        "undecided": list(table.undecided),
        "preferred_by_bic": table.ranked("bic")[0].name,
        "failed": dict(table.failed),
        "seconds": time.perf_counter() - begin,
        "processor_seconds": time.process_time() - processor,
        "in_time": time.perf_counter() - begin < MOST,
    }
    print(table.to_text())
    return write_results(RESULTS, rows_of(table), draw, numbers, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """Leave-one-out rmse and width error of each family; filled where it is not told from the winner."""
    canvas = figure(height=0.32 * len(rows) + 1.2)
    near = [line["probability"] is None or line["probability"] >= 0.05 for line in rows]
    panels = ("loo_rmse", 1e3, "Leave-one-out rmse [nm]"), ("width_error_percent", 1.0, "Width error [%]")
    left, right = draw_models(canvas, rows, near, panels)
    left.set_xscale("log")
    left.set_xticks([30, 100, 300], ["30", "100", "300"])
    left.minorticks_off()
    right.axvline(0.0, color="#777777", linewidth=0.8)
    return canvas


if __name__ == "__main__":
    main()
