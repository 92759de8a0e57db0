"""The result of `compare`, which is written as text, CSV, Markdown, LaTeX and columns from one list of columns."""

import html
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray, check_choice, items
from hysim._basics.names import among
from hysim._basics.printing import aligned, bic_in_words, csv_text, folded, frozen_result, listed, summary_text
from hysim.comparison._verdict import Contrast, contrasts
from hysim.identification.doubts import CONSTANT, SWAPPED
from hysim.interop import frame, heading
from hysim.metrics import LoopMetrics
from hysim.models.model import in_brief
from hysim.records import Record

_WIDE = 110  # letters in a line of text
_PRINTED = 5  # rows in words
_NAMED = 6  # models that a sentence names

Value = str | int | float | bool


@frozen_result
class ComparisonRow:
    """One model on the record.

    Parameters
    ----------
    name, model
        Its name, and the model itself.
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
    y, loop
        Output at the record's samples, shape (n,), and the model's loop.
    test_fit_percent, test_rmse : float
        Fit [%] and rmse [unit of y] on the test; nan without a test.
    success, message, warnings, unsafe
        Those of its `hysim.Identification`; the message is empty for a model that was not identified here.
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


@frozen_result
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
    earlier : tuple of Record
        The records before it, where there are several.
    """

    record: Record
    loop: LoopMetrics
    rows: tuple[ComparisonRow, ...]
    failed: Mapping[str, str] = field(default_factory=dict)
    test: Record | None = None
    earlier: tuple[Record, ...] = ()

    def __getitem__(self, name: str) -> ComparisonRow:
        for row in self.rows:
            if row.name == name:
                return row
        if name in self.failed:
            raise KeyError(f"{name!r} could not be compared: {self.failed[name]}")
        raise KeyError(f"no model {name!r}: there are {among(name, [row.name for row in self.rows])}")

    def ranked(self, criterion: str = "cv_rmse") -> tuple[ComparisonRow, ...]:
        """The rows by a measure, the smallest first; rows without the measure are left out.

        `criterion` is ``"cv_rmse"``, ``"bic"``, ``"aic"``, ``"fpe"``, ``"rmse"`` or ``"test_rmse"``; else ValueError.

        Examples
        --------
        >>> import hysim as hs
        >>> tab = hs.compare({"plays": hs.PrandtlIshlinskii, "one play": hs.Play}, hs.datasets.table1())
        >>> [row.name for row in tab.ranked("bic")], [row.name for row in tab.ranked("rmse")]
        (['one play', 'plays'], ['plays', 'one play'])
        """
        check_choice("criterion", criterion, ("cv_rmse", "bic", "aic", "fpe", "rmse", "test_rmse"))
        scores = [(float(vars(row)[criterion]), row) for row in self.rows]
        return tuple(row for score, row in sorted(scores, key=lambda pair: pair[0]) if score == score)

    @property
    def _y(self) -> FloatArray:
        return np.concatenate([record.y for record in (*self.earlier, self.record)])

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
        errors, rmses = {row.name: row.cv_residual for row in others}, {row.name: row.cv_rmse for row in others}
        span, fitted = float(np.ptp(self._y)), [row.name for row in others if row.n_parameters]
        return contrasts(errors, best.cv_residual, rmses, best.cv_rmse, span=span, fitted=fitted)

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
        constant = [CONSTANT] if np.ptp(self._y) == 0.0 else []
        ranked = self.ranked() or self.ranked("rmse")
        every = [(row.name, each) for row in ranked for each in row.warnings]
        of_best = [f"{name}: {each}" for name, each in every if name == ranked[0].name and each != CONSTANT]
        swapped = [f"{name}: {each}" for name, each in every if each.startswith(SWAPPED)][:1]
        unsafe = [f"{row.name}: {row.unsafe}" for row in self.rows if row.unsafe]
        return (*constant, *dict.fromkeys([*unsafe, *of_best, *swapped]))

    def to_text(self) -> str:
        """The table for a terminal, and the verdict below it."""
        lines = aligned(_short(self))
        notes = [f"not compared: {name}: {reason}" for name, reason in self.failed.items()] + [self.verdict]
        wrapped = [line for note in notes if note for line in folded(note, _WIDE, indent="  ")]
        warnings = [line for each in self.warnings for line in folded(each, _WIDE, "  ", "    ")]
        lines[1:1] = ["-" * len(lines[0])]
        return "\n".join([*lines, *wrapped, *(["Warnings"] if warnings else []), *warnings])

    def __str__(self) -> str:
        best = [row.name for row in self.ranked()]
        unknown = [row.name for row in self.rows if math.isnan(row.cv_rmse)]
        by_name = {row["name"]: row for row in rows(self)}
        names = ("name", "n_parameters", "fit_percent", "rmse", "cv_rmse", "rmse_ratio", "test_rmse", "max_width")
        selected = [column for column in columns(self) if column.name in names]
        ordered = [by_name[name] for name in best + unknown]
        table = [["", *(column.heading for column in selected[1:])]]
        table += [[_printed(row[column.name], column.digits) for column in selected] for row in ordered[:_PRINTED]]
        more, many = len(ordered) - _PRINTED, len(ordered)
        on = f"{len(self.earlier) + 1} records" if self.earlier else self.record.name or "a record"
        head = f"Comparison of {many} model{'' if many == 1 else 's'} on {on}, "
        notes = [f"  ... and {more} more"] if more > 0 else []
        sentences = [
            f"Not compared: {', '.join(self.failed)}." if self.failed else "",
            self.verdict,
            f"Warnings: {'; '.join(self.warnings)}" if self.warnings else "",
        ]
        notes += folded(" ".join(filter(None, sentences)), first="  ", indent="  ")
        return summary_text([f"{head}{self._y.size} samples", *(f"  {line}" for line in aligned(table)), *notes])

    def to_html(self) -> str:
        """The short table for a notebook, and the verdict."""
        header, *body = ([html.escape(cell) for cell in cells] for cells in _short(self))
        head = "".join(f"<th>{cell}</th>" for cell in header)
        lines = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>" for cells in body)
        listed = "".join(f"<li>{html.escape(each)}</li>" for each in self.warnings)
        warnings = f"<p>Warnings</p><ul>{listed}</ul>" if listed else ""
        verdict = f"<p>{html.escape(self.verdict)}</p>"
        return f"<table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>{verdict}{warnings}"

    def to_markdown(self) -> str:
        """The table in Markdown."""
        header, *body = _short(self)
        body += [[name, reason, *[""] * (len(header) - 2)] for name, reason in self.failed.items()]
        lines = [header, ["---", *("---:" for _ in header[1:])], *body]
        return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |" for cells in lines)

    def to_latex(self) -> str:
        """The table as a plain LaTeX tabular, which needs no package."""
        (header, *body), failed = _short(self), self.failed.items()
        spans = rf"\multicolumn{{{len(header) - 1}}}{{l}}"
        lines = [" & ".join(map(_escaped, cells)) for cells in body]
        lines += [rf"{_escaped(name)} & {spans}{{{_escaped(reason)}}}" for name, reason in failed]
        begin = rf"\begin{{tabular}}{{l{'r' * (len(header) - 1)}}}"
        first, *others = (rf"{line} \\" for line in (" & ".join(map(_escaped, header)), *lines))
        return "\n".join([begin, r"\hline", first, r"\hline", *others, r"\hline", r"\end{tabular}"])

    def to_csv(self) -> str:
        """Every measure as comma-separated values with all digits, nan as an empty cell."""
        table = self._columns()
        return csv_text([table, *(map(_exact, row) for row in zip(*table.values(), strict=True))])

    def _columns(self) -> dict[str, list[Value | None]]:
        failed = [{"name": name, "success": False, "message": reason} for name, reason in self.failed.items()]
        every = [*rows(self), *failed]
        return {column.heading: [row.get(column.name) for row in every] for column in columns(self)}

    def to_frame(self) -> Any:
        """Every measure as a `pandas.DataFrame`, one row a model; ImportError without pandas.

        ``attrs`` holds the units of the columns by their headings, the record's name and the verdict.
        """
        units = {each.heading: unit for each in columns(self) if (unit := heading(each.heading)[1])}
        return frame(self._columns(), units=units, notes={"record": self.record.name, "verdict": self.verdict})

    def _undecided_in_words(self) -> str:
        method = "(signed ranks of left-out errors, 5 % after Holm's correction)"
        smaller = tuple(each.name for each in self.contrasts if each.contradicts)
        if similar := tuple(name for name in self.undecided if name not in smaller):
            return f"{self._y.size} samples show no significant difference to {_first(similar)} {method}"
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
    return listed(names if len(names) <= _NAMED else [*names[: _NAMED - 1], f"{len(names) - _NAMED + 1} others"])


class Column(NamedTuple):
    """A column: its heading, the value in a row by name, the decimals in print, and whether short tables have it."""

    heading: str
    name: str
    digits: int = 0
    short: bool = True


def columns(comparison: Comparison) -> list[Column]:
    units = comparison.record.units
    u, y = (f" [{units[name]}]" if name in units else "" for name in ("u", "y"))
    area = f" [{units['y']} {units['u']}]" if {"u", "y"} <= units.keys() else ""
    contrasts = [
        Column("cv rmse / best", "rmse_ratio", 2),
        Column("typical error / best", "typical_ratio", 2, short=False),
        Column("p", "probability", 3),
        Column("diverged", "diverged", short=False),
    ]
    test = [Column(f"test rmse{y}", "test_rmse", 4), Column("test fit [%]", "test_fit_percent", 2)]
    return [
        Column("model", "name"),
        Column("parameters", "n_parameters"),
        Column("fit [%]", "fit_percent", 2),
        Column(f"rmse{y}", "rmse", 4),
        Column(f"cv rmse{y}", "cv_rmse", 4),
        *(contrasts if comparison.contrasts else []),
        *(test if comparison.test else []),
        *([Column("max residual [quanta]", "residual_quanta", 2)] if comparison.record.resolution else []),
        Column(f"max width{y}", "max_width", 3),
        Column(f"at{u}", "max_width_at", 1, short=False),
        Column(f"area{area}", "area", 2, short=False),
        Column(f"width rmse{y}", "width_rmse", 4, short=False),
        Column("width error [%]", "width_error_percent", 1),
        Column("area error [%]", "area_error_percent", 1),
        Column("BIC", "bic", 1),
        Column("AIC", "aic", 1, short=False),
        Column("FPE", "fpe", 6, short=False),
        Column("rate independent", "is_rate_independent"),
        Column("rate deviation", "rate_deviation", 9, short=False),
        Column("converged", "success", short=False),
        Column("message", "message", short=False),
        Column("warnings", "warnings", short=False),
    ]


def rows(comparison: Comparison) -> list[dict[str, Any]]:
    """The values of each model by name; the best model compares with itself as 1."""
    contrasts = {each.name: items(each) for each in comparison.contrasts}
    quantum, values = comparison.record.resolution, []
    for row in comparison.rows:
        same = math.nan if math.isnan(row.cv_rmse) else 1.0
        best = {"rmse_ratio": same, "typical_ratio": same, "probability": math.nan, "diverged": False}
        criteria = {name: math.nan if vars(row)[name] == -math.inf else vars(row)[name] for name in ("bic", "aic")}
        derived = {"residual_quanta": row.max_residual / quantum if quantum else math.nan}
        text = {"warnings": "; ".join(filter(None, (row.unsafe, *row.warnings)))}
        values.append(contrasts.get(row.name, best) | items(row) | criteria | derived | text)
    return values


def _short(comparison: Comparison) -> list[list[str]]:
    selected = [column for column in columns(comparison) if column.short]
    body = [[_printed(row[column.name], column.digits) for column in selected] for row in rows(comparison)]
    for cells, row in zip(body, comparison.rows, strict=True):
        cells[0] += " (UNSAFE)" if row.unsafe else "" if row.success else " (partial)"
    return [[column.heading for column in selected], *body]


def _printed(value: Value, digits: int) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{digits}f}" if math.isfinite(value) else "-" if math.isnan(value) else str(value)
    return str(value)


def _exact(value: Value | None) -> str:
    if value is None or value != value:
        return ""
    return repr(float(value)) if isinstance(value, float) else _printed(value, 0)


def _escaped(text: str) -> str:
    return re.sub(r"([%&_#$])", r"\\\1", text)
