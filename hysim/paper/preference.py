"""Which model the points of Table 1 prefer, from stored evidences and stored left-out errors.

`hysim reproduce` samples no posterior: `experiments/49_evidence.py` does, and stores ln Z of each model in
`hysim/data/table1_evidence.csv`, with the boxes of the priors halved, as they are, and doubled. Noise is the rounding
to pixels and a normal part, and every memory is free at the first point.

Nor does it repeat fifty searches: `experiments/33_nested_table1.py` does, and stores the left-out errors in
`hysim/data/table1_nested.csv`. The 50 points between the first and the last are taken out of the record in turn, and
everything about a model is chosen again without the point: the terms of a discovered law, the starts and the optimum
of an identified one.
"""

import csv
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from hysim.posterior import FACTORS, Evidence, EvidenceRow


class NestedError(NamedTuple):
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
    return tuple(map(_nested_error, _stored("table1_nested.csv")))


def of_discovered() -> NestedError:
    """The error of the law that `discover` finds with its defaults."""
    return next(each for each in nested_errors() if (each.model, each.start) == ("discovered", "auto"))


_APART = 2.0  # standard errors of a difference that counts


@cache
def stored_evidence() -> Evidence:
    """The stored evidences by bridge sampling, in falling order of those with unchanged boxes."""
    return Evidence(rows=tuple(map(_row, _lines())), factors=FACTORS, noise="quantised", method="bridge")


@cache
def by_nested_sampling() -> Mapping[str, tuple[float, float]]:
    """ln Z by nested sampling, and its standard error, of the models that have it, with unchanged boxes."""
    return {
        line["model"]: (float(line["nested_ln_evidence"]), float(line["nested_error"]))
        for line in _lines()
        if line["nested_ln_evidence"]
    }


def left_out(name: str) -> NestedError | None:
    """The error of a model at points that its search has not seen, its memory free at the first point."""
    return next((each for each in nested_errors() if each.model == name and each.start in ("free", "")), None)


def preference() -> str:
    """Which model the points prefer, and how surely; one sentence."""
    evidence = stored_evidence()
    boxes = "the boxes of their priors halved, as they are and doubled"
    return f"Of {len(evidence.rows)} models, {evidence.sentence} ({boxes})."


def beside_nested() -> str:
    """How the most probable model stands in nested cross-validation, in two sentences."""
    first = stored_evidence().names[0]
    error = left_out(first)
    if error is None:
        return f'Nested cross-validation was not run for "{first}".'
    kept = ", its terms chosen with the point," if error.terms_kept else ""
    agrees = "does not contradict" if error.behind < _APART else "contradicts"
    return (
        "Nested cross-validation asks how far a model is off at a point that is left out of its search. There "
        f'"{first}", the most probable one with the boxes as they are,{kept} errs by {error.left_out_rmse:.4f} µm; '
        f"that is {max(error.behind, 0.0):.1f} standard errors behind the best of those searched without the point, "
        f"which {agrees} the evidence."
    )


def preference_measures() -> dict[str, Any]:
    """The evidences as the summary has them."""
    evidence = stored_evidence()
    return {
        "sentence": preference(),
        "noise": evidence.noise,
        "boxes": list(evidence.factors),
        "undecided": list(evidence.undecided),
        "best": list(evidence.best),
        "models": {name: _measures(evidence, name) for name in evidence.names},
    }


def preference_rows() -> list[dict[str, Any]]:
    """One line for each model: ln Z and its standard error for each size of the boxes, and by nested sampling."""
    rows = []
    for each in stored_evidence().rows:
        row: dict[str, Any] = {"model": each.name, "parameters": each.n_parameters}
        for factor, value, error in zip(FACTORS, each.log_evidence, each.error, strict=True):
            row |= {f"ln_evidence_x{factor:g}": value, f"error_x{factor:g}": error}
        nested = by_nested_sampling().get(each.name, (None, None))
        rows.append(row | dict(zip(("nested_ln_evidence", "nested_error"), nested, strict=True)))
    return rows


def _measures(evidence: Evidence, name: str) -> dict[str, Any]:
    row, error = evidence[name], left_out(name)
    return {
        "n_parameters": row.n_parameters,
        "log_evidence": list(row.log_evidence),
        "error": list(row.error),
        "probability": [evidence.probabilities(factor)[name] for factor in evidence.factors],
        "nested_sampling": list(by_nested_sampling().get(name, ())) or None,
        "left_out_rmse_um": None if error is None else error.left_out_rmse,
    }


@cache
def _lines() -> tuple[dict[str, str], ...]:
    return _stored("table1_evidence.csv")


def _stored(name: str) -> tuple[dict[str, str], ...]:
    text = (files("hysim") / "data" / name).read_text(encoding="utf-8")
    return tuple(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


def _nested_error(row: Mapping[str, str]) -> NestedError:
    fit, rmse, behind = (float(row[name]) for name in ("fit_percent", "left_out_rmse_um", "behind_in_stderr"))
    same, n_parameters = row["same_structure"], int(row["n_parameters"])
    folds = (int(same) if same else None, int(row["folds"]), row["terms_kept"] == "True")
    return NestedError(row["model"], row["start"], n_parameters, fit, rmse, behind, *folds)


def _row(line: Mapping[str, str]) -> EvidenceRow:
    return EvidenceRow(
        name=line["model"],
        n_parameters=int(line["n_parameters"]),
        fit_percent=float(line["fit_percent"]),
        log_evidence=tuple(float(line[f"ln_evidence_x{factor:g}"]) for factor in FACTORS),
        error=tuple(float(line[f"error_x{factor:g}"]) for factor in FACTORS),
        n_evaluations=int(line["n_evaluations"]),
    )
