"""The result of `compare`."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, check_choice, frozen
from hysim._names import among
from hysim._printing import bic_in_words, listed, printed, summary_text
from hysim.comparison import _tables
from hysim.comparison._verdict import Contrast, contrasts
from hysim.identification.sentences import CONSTANT, SWAPPED
from hysim.metrics import LoopMetrics
from hysim.models.model import in_brief
from hysim.records import Record

_NAMED = 6  # models that a sentence names


@printed
@frozen
class ComparisonRow:
    """One model on the record.

    Parameters
    ----------
    name : str
        Name of the model.
    model : model
        The model itself.
    n_parameters : int
        Number of its parameters that were fitted to this record.
    fit_percent, rmse : float
        Fit [%] and rmse [unit of y] of the free-run output.
    cv_rmse : float
        Cross-validated rmse, nan if unknown [unit of y]; the rmse of a model that was not fitted.
    cv_residual : array, shape (n,)
        Measured minus model at left-out samples, nan elsewhere; empty if unknown [unit of y].
    max_residual : float
        Largest residual [unit of y].
    max_width, max_width_at, area, width_rmse : float
        Measures of the model's loop, as in `hysim.loop_metrics`, and the rms difference from the measured width.
    width_error_percent, area_error_percent : float
        Excess of the model's largest width and area over the measured ones [%]; about -200 if its loop has the other
        orientation, nan if the measured loop is not open.
    fpe, aic, bic : float
        Final prediction error and the two criteria; nan for a model that was not fitted.
    is_rate_independent : bool
        Whether the output stays the same, to 1e-6 of its range, if the input follows the same path at half the rate.
    rate_deviation : float
        The largest change of the output in that test, as a fraction of its range.
    y : array, shape (n,)
        Output at the record's samples.
    loop : LoopMetrics
        The model's loop.
    test_fit_percent, test_rmse : float
        Fit [%] and rmse [unit of y] on the test; nan without a test.
    success : bool
        Whether its identification converged.
    message : str
        Message of the identification; empty for a model that was not identified here.
    warnings : tuple of str
        Warnings of the identification.
    unsafe : str
        Sentence where the identified law is not safe on smaller cycles; see `hysim.Identification`.
    """

    name: str
    model: Any
    n_parameters: int
    fit_percent: float
    rmse: float
    cv_rmse: float
    cv_residual: FloatArray
    max_residual: float
    max_width: float
    max_width_at: float
    area: float
    width_rmse: float
    width_error_percent: float
    area_error_percent: float
    fpe: float
    aic: float
    bic: float
    is_rate_independent: bool
    rate_deviation: float
    y: FloatArray
    loop: LoopMetrics
    test_fit_percent: float = float("nan")
    test_rmse: float = float("nan")
    success: bool = True
    message: str = ""
    warnings: tuple[str, ...] = ()
    unsafe: str = ""

    def __str__(self) -> str:
        fit = "fit not defined" if math.isnan(self.fit_percent) else f"fit {self.fit_percent:.2f} %"
        excess = "" if math.isnan(self.width_error_percent) else f", {self.width_error_percent:+.1f} %"
        return summary_text(
            [f"ComparisonRow {self.name}: {fit}, rmse {self.rmse:.4g}"],
            {
                "left out": "" if math.isnan(self.cv_rmse) else f"rmse {self.cv_rmse:.4g}",
                "largest width": f"{self.max_width:.4g} at {self.max_width_at:.6g}{excess}",
                "parameters": f"{self.n_parameters}, {bic_in_words(self.bic)}",
                "model": in_brief(self.model),
                "search": self.message,
                "warnings": "; ".join(filter(None, (self.unsafe, *self.warnings))),
            },
        )


@printed
@frozen
class Comparison:
    """Models side by side.

    Parameters
    ----------
    record : Record
        The record of the comparison.
    loop : LoopMetrics
        The measured loop.
    rows : tuple of ComparisonRow
        One for each model, in the order of the argument of `compare`.
    failed : mapping
        Name to the reason, for models that could not be identified or simulated on the record.
    test : Record or None
        The samples of the test.
    """

    record: Record
    loop: LoopMetrics
    rows: tuple[ComparisonRow, ...]
    failed: Mapping[str, str] = field(default_factory=dict)
    test: Record | None = None

    __str__ = _tables.to_words
    to_html = _tables.to_html
    to_text = _tables.to_text
    to_markdown = _tables.to_markdown
    to_latex = _tables.to_latex
    to_csv = _tables.to_csv
    to_frame = _tables.to_frame

    def __getitem__(self, name: str) -> ComparisonRow:
        for row in self.rows:
            if row.name == name:
                return row
        if name in self.failed:
            raise KeyError(f"{name!r} could not be compared: {self.failed[name]}")
        raise KeyError(f"no model {name!r}: there are {among(name, [row.name for row in self.rows])}")

    def ranked(self, criterion: str = "cv_rmse") -> tuple[ComparisonRow, ...]:
        """The rows by a measure, the smallest first; rows without the measure are left out.

        `criterion` is one of ``"cv_rmse"``, ``"bic"``, ``"aic"``, ``"fpe"``, ``"rmse"`` and ``"test_rmse"``; any
        other word is a ValueError.

        Examples
        --------
        >>> import hysim as hs
        >>> tab = hs.compare({"plays": hs.PrandtlIshlinskii, "one play": hs.Play}, hs.datasets.table1())
        >>> [row.name for row in tab.ranked("bic")], [row.name for row in tab.ranked("rmse")]
        (['one play', 'plays'], ['plays', 'one play'])
        """
        criteria = ("cv_rmse", "bic", "aic", "fpe", "rmse", "test_rmse")
        check_choice("criterion", criterion, criteria)
        scores = [(float(vars(row)[criterion]), row) for row in self.rows]
        return tuple(row for score, row in sorted(scores, key=lambda pair: pair[0]) if score == score)

    @property
    def winner(self) -> str | None:
        """The model with the smallest cross-validated rmse; None unless at least two models have one."""
        best = self.ranked()
        return best[0].name if len(best) > 1 else None

    @property
    def contrasts(self) -> tuple[Contrast, ...]:
        """Each other model compared with the winner by their errors on left-out samples, the nearest first."""
        if self.winner is None:
            return ()
        best, *others = self.ranked()
        return contrasts(
            {row.name: row.cv_residual for row in others},
            best.cv_residual,
            {row.name: row.cv_rmse for row in others},
            best.cv_rmse,
            span=float(np.ptp(self.record.y)),
            fitted=[row.name for row in others if row.n_parameters],
        )

    @property
    def probabilities(self) -> dict[str, float]:
        """Name of each other model to the `probability` of its `Contrast` with the winner."""
        return {each.name: each.probability for each in self.contrasts}

    @property
    def undecided(self) -> tuple[str, ...]:
        """Models that are not significantly worse than the winner at 5 %, the nearest first."""
        return tuple(each.name for each in self.contrasts if not (each.is_worse or math.isnan(each.probability)))

    @property
    def verdict(self) -> str:
        """The winner, models that are not significantly worse, and models that diverged, in words."""
        by_bic = self.ranked("bic")
        sentences = [f"The BIC prefers {by_bic[0].name}."] if len(by_bic) > 1 and by_bic[0].bic > -math.inf else []
        if self.winner is not None:
            unit = f" {self.record.units['y']}" if "y" in self.record.units else ""
            rmse = f"cross-validated rmse {self[self.winner].cv_rmse:.4g}{unit}"
            sentences.insert(0, f"{self.winner} predicts samples left out best, {rmse}; {self._undecided_in_words()}.")
            sentences[1:1] = self._exceptions_in_words()
        return " ".join(sentences)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings, one sentence each: a constant output, unsafe laws, those of the best model, and swapped columns."""
        constant = [CONSTANT] if np.ptp(self.record.y) == 0.0 else []
        ranked = self.ranked() or self.ranked("rmse")
        every = [(row.name, each) for row in ranked for each in row.warnings]
        of_best = [f"{name}: {each}" for name, each in every if name == ranked[0].name and each != CONSTANT]
        swapped = [f"{name}: {each}" for name, each in every if each.startswith(SWAPPED)][:1]
        unsafe = [f"{row.name}: {row.unsafe}" for row in self.rows if row.unsafe]
        return (*constant, *dict.fromkeys([*unsafe, *of_best, *swapped]))

    def _undecided_in_words(self) -> str:
        method = "(signed ranks of left-out errors, 5 % after Holm's correction)"
        smaller = tuple(each.name for each in self.contrasts if each.contradicts)
        if similar := tuple(name for name in self.undecided if name not in smaller):
            return f"{len(self.record)} samples show no significant difference to {_first(similar)} {method}"
        if any(math.isnan(each.probability) and not each.diverged for each in self.contrasts):
            return "the errors that would show a difference to the others are not all known"
        if smaller:
            return f"all others but {_first(smaller)} are significantly worse {method}"
        nearest = self.contrasts[0]
        if nearest.diverged:
            return "all others diverged or are significantly worse"
        p = "p < 0.001" if nearest.probability < 1e-3 else f"p = {nearest.probability:.2g}"
        nearest_in_words = f"{nearest.name}, rmse {nearest.rmse_ratio:.3g} times and typical error "
        nearest_in_words += f"{nearest.typical_ratio:.3g} times as large, {p}"
        return f"all others are significantly worse, the nearest {nearest_in_words} {method}"

    def _exceptions_in_words(self) -> list[str]:
        """Models that diverged, and those whose ranks and rmse disagree."""
        diverged = tuple(each.name for each in self.contrasts if each.diverged)
        smaller = tuple(each.name for each in self.contrasts if each.contradicts)
        sentences = [f"{_first(diverged)} diverged on samples left out."] if diverged else []
        if smaller:
            has = "has" if len(smaller) == 1 else "have"
            sentences.append(
                f"{_first(smaller)} {has} significantly smaller typical errors than {self.winner} but a larger rmse: "
                "a few large errors decide the ranking."
            )
        return sentences


def _first(names: Sequence[str]) -> str:
    """The names in a sentence; of many the first ones, and the number of the others."""
    return listed(names if len(names) <= _NAMED else [*names[: _NAMED - 1], f"{len(names) - _NAMED + 1} others"])
