"""Left-out errors on Table 1 of searches that were repeated without the point.

`hysim reproduce` does not repeat fifty searches: `experiments/33_nested_table1.py` does, and stores the errors in
`hysim/data/table1_nested.csv`. The 50 points between the first and the last are taken out of the record in turn, and
everything about a model is chosen again without the point: the terms of a discovered law, the starts and the optimum
of an identified one.
"""

import csv
from functools import cache
from importlib.resources import files

from hysim._frozen import frozen

FILE = "table1_nested.csv"


@frozen
class NestedError:
    """The left-out error of one model.

    Parameters
    ----------
    model : str
    start : str
        How the memory begins: ``"free"``, ``"rest"``, ``"auto"`` where the search chooses, or nothing.
    n_parameters : int
        On all points.
    fit_percent : float
        On all points, in free run [%].
    left_out_rmse : float
        Root mean square error at the points left out [um].
    behind : float
        Distance of the mean squared error from that of the best model whose terms are not kept, in standard errors of
        the paired difference.
    same_structure : int or None
        Folds in which a discovered law has the terms that it has on all points.
    folds : int
        Number of points that were left out.
    terms_kept : bool
        Whether the terms are those that were found on all points.
    """

    model: str
    start: str
    n_parameters: int
    fit_percent: float
    left_out_rmse: float
    behind: float
    same_structure: int | None
    folds: int
    terms_kept: bool


@cache
def nested_errors() -> tuple[NestedError, ...]:
    """The stored errors, the least first."""
    text = (files("hysim") / "data" / FILE).read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    return tuple(
        NestedError(
            model=row["model"],
            start=row["start"],
            n_parameters=int(row["n_parameters"]),
            fit_percent=float(row["fit_percent"]),
            left_out_rmse=float(row["left_out_rmse_um"]),
            behind=float(row["behind_in_stderr"]),
            same_structure=int(row["same_structure"]) if row["same_structure"] else None,
            folds=int(row["folds"]),
            terms_kept=row["terms_kept"] == "True",
        )
        for row in rows
    )


def of_discovered() -> NestedError:
    """The error of the law that `discover` finds with its defaults."""
    return next(each for each in nested_errors() if (each.model, each.start) == ("discovered", "auto"))
