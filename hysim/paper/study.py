"""Every model on the 52 points of Table 1, for `reproduce`, and loop width against dwell.

Equation (1) is taken at the dwell that suits it best: the paper prints none. The bound of all models without memory is
the mean displacement at each voltage: no curve that gives one displacement for each voltage has a smaller sum of
squares. It is the bound, not a model that one would fit: `hysim.identify` fits a smooth curve instead, which stays
below it.

What is lag closes with the dwell, what is hysteresis stays. Table 1's staircase is run at several dwells, and the
displacement is taken at the end of each, as one reads an instrument that has settled. Taken at its start instead, each
displacement belongs to the voltage before: the loop of a plant without any memory is then as wide as two steps of the
staircase, however long the dwell.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray, frozen
from hysim.comparison import Comparison, compare
from hysim.datasets import table1
from hysim.discovery import Discovery, discover
from hysim.identification import Identification, identify
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.polynomial_boucwen import PolynomialBoucWen
from hysim.laws.static import Line, SingleValued
from hysim.metrics import loop_metrics, rmse
from hysim.paper.equations import EQUATION_1, in_time_unit
from hysim.paper.preference import of_discovered
from hysim.plants.actuator import Actuator
from hysim.plants.transfer_function import TransferFunction
from hysim.records import Record

Progress = Callable[[int, int, str], None]

BEST_DWELLS = np.geomspace(0.1, 50.0, 400)
"""Dwells that are tried [s], to 2 %."""


@frozen
class PaperModel:
    """A model of Table 1 that no verb identified, as `hysim.compare` takes a result.

    Parameters
    ----------
    model : TransferFunction or SingleValued
        Time in samples.
    n_parameters : int
        Numbers that were chosen on the record.
    cv_rmse : float
        Leave-one-out rmse [um]; nan if it was not asked for.
    dwell : float
        Time for which each voltage is held [s].
    """

    model: TransferFunction | SingleValued
    n_parameters: int
    cv_rmse: float
    dwell: float = math.nan


def printed_model() -> PaperModel:
    """Equation (1) at the dwell that fits Table 1 best: zero-order hold, output at its start, from rest.

    Its cross-validated rmse chooses the dwell anew without each sample; the dwell is searched between 0.1
    and 50 s to 2 %.
    """
    record = table1()
    residuals = np.array([record.y - EQUATION_1.response(record.u, dwell) for dwell in BEST_DWELLS])
    best = int(np.argmin(np.sum(residuals**2, axis=1)))
    without = np.sum(residuals**2, axis=1, keepdims=True) - residuals**2
    left_out = residuals[without.argmin(axis=0), np.arange(len(record))]
    dwell = float(BEST_DWELLS[best])
    cv_rmse = rmse(left_out, np.zeros_like(left_out))
    return PaperModel(model=in_time_unit(EQUATION_1, dwell), n_parameters=1, cv_rmse=cv_rmse, dwell=dwell)


def level_means(record: Record, *, leave_one_out: bool) -> PaperModel:
    """The means of a record, and how well each predicts the sample that is left out of it."""
    curve = SingleValued.through_means(record)
    level = np.abs(record.u[:, np.newaxis] - curve.u).argmin(axis=1)
    count = np.bincount(level)[level]
    residual = record.y - curve.y[level]
    known = (residual * count / np.maximum(count - 1, 1))[count > 1] if leave_one_out else np.empty(0)
    cv_rmse = float(np.sqrt(np.mean(known**2))) if known.size else math.nan
    return PaperModel(model=curve, n_parameters=curve.u.size, cv_rmse=cv_rmse)


@frozen
class Study:
    """The models of Table 1, and how they compare.

    Parameters
    ----------
    comparison : Comparison
        All models at the samples of Table 1.
    printed : PaperModel
        Equation (1) at its best dwell.
    fits : mapping
        Name to the identification of each model that was identified.
    discovery : Discovery
        Law that SINDy discovered.
    """

    comparison: Comparison
    printed: PaperModel
    fits: Mapping[str, Identification]
    discovery: Discovery


def bouc_wen(name: str, quick: bool) -> Identification:
    """The Bouc-Wen law on Table 1, or the asymmetric one with n = 1 and a quadratic input."""
    family, fixed = (PolynomialBoucWen, {"n": 1.0}) if name == "bouc-wen-asymmetric" else (BoucWen, {})
    return identify(family, table1(), fixed=fixed, cross_validate=None if quick else "loo", admissible=False)


def study(
    *,
    quick: bool = False,
    progress: Progress = lambda done, total, what: None,
    law: Callable[[str, bool], Identification] = bouc_wen,
) -> Study:
    """Identify, discover and compare on Table 1.

    Parameters
    ----------
    quick : bool
        Leave the cross-validation out. That of the discovered law is stored in any case (`hysim.paper.preference`).
    progress : callable
        Called as ``progress(done, total, what)`` before each step.
    law : callable
        Gives the Bouc-Wen laws as `bouc_wen`, perhaps from where they have been computed meanwhile.
    """
    record = table1()
    folds = None if quick else "loo"
    structure = TransferFunction.structure(poles=4, zeros=1, hold="zoh", sample="start", initial="rest")
    subjects: dict[str, Callable[[], Any]] = {
        "eq1-printed": printed_model,
        "tf-identified": lambda: identify(structure, record, cross_validate=folds),
        **{name: partial(law, name, quick) for name in ("bouc-wen", "bouc-wen-asymmetric")},
        "sindy": lambda: discover(record, library="duhem"),
        "line": lambda: identify(Line, record, cross_validate=folds),
        "single-valued": lambda: level_means(record, leave_one_out=not quick),
    }
    results: dict[str, Any] = dict.fromkeys(subjects)
    in_order = sorted(subjects, key=lambda name: name.startswith("bouc-wen"))  # these may take longest
    for done, name in enumerate(in_order):
        progress(done, len(subjects), name)
        results[name] = subjects[name]()
    progress(len(subjects), len(subjects), "comparison")
    return Study(
        comparison=compare(results, record),
        printed=results["eq1-printed"],
        fits={name: result for name, result in results.items() if isinstance(result, Identification)},
        discovery=results["sindy"],
    )


def model_measures(study: Study) -> dict[str, dict[str, Any]]:
    """The measures of each model by its name, with units in their keys; nan where one does not apply.

    The cross-validated error of the discovered law is that of `hysim.paper.preference`.
    """
    quantum = study.comparison.record.resolution or math.nan
    return {
        row.name: {
            "n_parameters": row.n_parameters,
            "fit_percent": row.fit_percent,
            "rmse_um": row.rmse,
            "cv_rmse_um": of_discovered().left_out_rmse if row.name == "sindy" else row.cv_rmse,
            "max_residual_px": row.max_residual / quantum,
            "max_width_um": row.max_width,
            "max_width_at_V": row.max_width_at,
            "area_um_V": row.area,
            "width_rmse_um": row.width_rmse,
        }
        | ({} if row.name == "eq1-printed" else {"fpe": row.fpe})
        | (_safety(study.fits[row.name]) if row.name in study.fits else {})
        for row in study.comparison.rows
    }


def _safety(fit: Identification) -> dict[str, Any]:
    """Whether the law runs away on smaller cycles, and the fit of the best admissible one where that is another."""
    other = fit.regions.get("admissible")
    return {"unsafe": bool(fit.unsafe)} | ({} if other is None else {"admissible_fit_percent": other.fit_percent})


DWELLS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_SAMPLES_PER_SECOND = 10


def dwell_rows(law: Any, law_and_dynamics: Actuator) -> list[dict[str, float]]:
    """Largest loop widths of Table 1's staircase at every dwell, ten samples a second [um].

    Those of equation (1), with the displacement taken at the end and at the start of each dwell, of a law, and of this
    law with dynamics behind it.
    """
    u = table1().u

    def width(y: FloatArray) -> float:
        return loop_metrics(u, y[: u.size]).max_width

    return [
        {
            "dwell_s": dwell,
            "eq1_max_width_um": width(_settled(Actuator(vibration=EQUATION_1), u, dwell)),
            "eq1_at_start_max_width_um": width(EQUATION_1.response(u, dwell)),
            "bouc_wen_max_width_um": width(_settled(Actuator(hysteresis=law), u, dwell)),
            "bouc_wen_and_eq7_max_width_um": width(_settled(law_and_dynamics, u, dwell)),
        }
        for dwell in DWELLS
    ]


def _settled(plant: Actuator, u: FloatArray, dwell: float) -> FloatArray:
    """The displacements at the end of each dwell."""
    held = round(dwell * _SAMPLES_PER_SECOND)
    voltage = np.append(np.repeat(u, held), u[-1])
    y = plant.response(voltage, 1.0 / _SAMPLES_PER_SECOND)
    return y[held::held] if plant.dynamic else y[held - 1 :: held]
