"""Every model on the 52 points of Table 1, for `reproduce`."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from hysim._frozen import frozen
from hysim.comparison import Comparison, ComparisonRow, compare
from hysim.datasets import table1
from hysim.discovery import Discovery, discover
from hysim.identification import Identification, identify
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.polynomial_boucwen import PolynomialBoucWen
from hysim.laws.static import Line
from hysim.paper.best_dwell import PrintedModel, printed_model
from hysim.paper.level_means import level_means
from hysim.paper.nested import of_discovered
from hysim.plants.transfer_function import TransferFunction

Progress = Callable[[int, int, str], None]


@frozen
class Study:
    """The models of Table 1, and how they compare.

    Parameters
    ----------
    comparison : Comparison
        All models at the samples of Table 1.
    printed : PrintedModel
        Equation (1) at its best dwell.
    fits : mapping
        Name to the identification of each model that was identified.
    discovery : Discovery
        Law that SINDy discovered.
    """

    comparison: Comparison
    printed: PrintedModel
    fits: Mapping[str, Identification]
    discovery: Discovery


def asymmetric_law(quick: bool) -> Identification:
    """The Bouc-Wen law with n = 1 and a quadratic input on Table 1."""
    folds = None if quick else "loo"
    return identify(PolynomialBoucWen, table1(), fixed={"n": 1.0}, cross_validate=folds, admissible=False)


def study(
    *,
    quick: bool = False,
    progress: Progress | None = None,
    finished: Callable[[str, Any], None] = lambda name, result: None,
    asymmetric: Callable[[bool], Identification] = asymmetric_law,
) -> Study:
    """Identify, discover and compare on Table 1.

    Parameters
    ----------
    quick : bool
        Leave the cross-validation out. That of the discovered law is stored in any case (`hysim.paper.nested`).
    progress : callable, optional
        Called as ``progress(done, total, what)`` before each step.
    finished : callable
        Called as ``finished(name, result)`` after each.
    asymmetric : callable
        Gives the asymmetric law, perhaps from where it has been computed meanwhile.
    """
    record = table1()
    folds = None if quick else "loo"
    structure = TransferFunction.structure(poles=4, zeros=1, hold="zoh", sample="start", initial="rest")
    subjects: dict[str, Callable[[], Any]] = {
        "eq1-printed": printed_model,
        "tf-identified": lambda: identify(structure, record, cross_validate=folds),
        "bouc-wen": lambda: identify(BoucWen, record, cross_validate=folds, admissible=False),
        "bouc-wen-asymmetric": lambda: asymmetric(quick),
        "sindy": lambda: discover(record, library="duhem"),
        "line": lambda: identify(Line, record, cross_validate=folds),
        "single-valued": lambda: level_means(record, leave_one_out=not quick),
    }
    results = {}
    for done, (name, make) in enumerate(subjects.items()):
        if progress is not None:
            progress(done, len(subjects), name)
        results[name] = make()
        finished(name, results[name])
    if progress is not None:
        progress(len(subjects), len(subjects), "comparison")
    return Study(
        comparison=compare(results, record),
        printed=results["eq1-printed"],
        fits={name: result for name, result in results.items() if isinstance(result, Identification)},
        discovery=results["sindy"],
    )


def cross_validated(row: ComparisonRow) -> float:
    """Left-out error of a model [um]; of the discovered law that of repeated searches, which is stored."""
    return of_discovered().left_out_rmse if row.name == "sindy" else row.cv_rmse


def model_measures(study: Study) -> dict[str, dict[str, Any]]:
    """The measures of each model by its name, with units in their keys; None where one does not apply.

    The cross-validated error of the discovered law is that of `hysim.paper.nested`.
    """
    quantum = study.comparison.record.resolution or math.nan
    return {
        row.name: {
            "n_parameters": row.n_parameters,
            "fit_percent": row.fit_percent,
            "rmse_um": row.rmse,
            "cv_rmse_um": _or_none(cross_validated(row)),
            "max_residual_px": row.max_residual / quantum,
            "max_width_um": row.max_width,
            "max_width_at_V": row.max_width_at,
            "area_um_V": row.area,
            "width_rmse_um": row.width_rmse,
        }
        | ({} if row.name == "eq1-printed" else {"fpe": _or_none(row.fpe)})
        | (_safety(study.fits[row.name]) if row.name in study.fits else {})
        for row in study.comparison.rows
    }


def _safety(fit: Identification) -> dict[str, Any]:
    """Whether the law runs away on smaller cycles, and the fit of the best admissible one where that is another."""
    other = fit.regions.get("admissible")
    return {"unsafe": bool(fit.unsafe)} | ({} if other is None else {"admissible_fit_percent": other.fit_percent})


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value
