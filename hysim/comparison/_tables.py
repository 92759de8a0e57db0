"""A comparison as text, CSV, Markdown, LaTeX and columns: one list of columns, and how each form writes them."""

import csv
import html
import io
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hysim._words import LETTERS, words

if TYPE_CHECKING:
    from hysim.comparison._result import Comparison, ComparisonRow
    from hysim.comparison._verdict import Contrast

Value = str | int | float | bool
_WIDE = 110  # letters in a line of text
_PRINTED = 5  # rows in words


@dataclass(frozen=True)
class Column:
    """A column: its heading, the value in a row, the decimals in print, and whether short tables have it."""

    heading: str
    value: "Callable[[ComparisonRow], Value]"
    digits: int = 0
    short: bool = True


def columns(comparison: "Comparison", *, timings: bool) -> list[Column]:
    """The columns that this comparison can fill."""
    units, quantum = comparison.record.units, comparison.record.resolution
    u, y = (f" [{units[name]}]" if name in units else "" for name in ("u", "y"))
    area = f" [{units['y']} {units['u']}]" if {"u", "y"} <= units.keys() else ""
    test = [
        Column(f"test rmse{y}", lambda row: row.test_rmse, 4),
        Column("test fit [%]", lambda row: row.test_fit_percent, 2),
    ]
    contrasts = {each.name: each for each in comparison.contrasts}
    effect = [
        Column("cv rmse / best", lambda row: _of(contrasts, row, "rmse_ratio"), 2),
        Column("typical error / best", lambda row: _of(contrasts, row, "typical_ratio"), 2, short=False),
        Column("p", lambda row: _of(contrasts, row, "probability"), 3),
        Column("diverged", lambda row: row.name in contrasts and contrasts[row.name].diverged, short=False),
    ]
    return [
        Column("model", lambda row: row.name),
        Column("parameters", lambda row: row.n_parameters),
        Column("fit [%]", lambda row: row.fit_percent, 2),
        Column(f"rmse{y}", lambda row: row.rmse, 4),
        Column(f"cv rmse{y}", lambda row: row.cv_rmse, 4),
        *(effect if contrasts else []),
        *(test if comparison.test else []),
        *([Column("max residual [quanta]", lambda row: row.max_residual / quantum, 2)] if quantum else []),
        Column(f"max width{y}", lambda row: row.max_width, 3),
        Column(f"at{u}", lambda row: row.max_width_at, 1, short=False),
        Column(f"area{area}", lambda row: row.area, 2, short=False),
        Column(f"width rmse{y}", lambda row: row.width_rmse, 4, short=False),
        Column("width error [%]", lambda row: row.width_error_percent, 1),
        Column("area error [%]", lambda row: row.area_error_percent, 1),
        Column("BIC", lambda row: _defined(row.bic), 1),
        Column("AIC", lambda row: _defined(row.aic), 1, short=False),
        Column("FPE", lambda row: row.fpe, 6, short=False),
        Column("rate independent", lambda row: row.is_rate_independent),
        Column("rate deviation", lambda row: row.rate_deviation, 9, short=False),
        *([Column("time [s]", lambda row: row.seconds, 1)] if timings else []),
        Column("converged", lambda row: row.success, short=False),
        Column("message", lambda row: row.message, short=False),
        Column("warnings", lambda row: "; ".join(row.warnings), short=False),
    ]


def to_text(comparison: "Comparison", *, timings: bool) -> str:
    """The short table for a terminal, what could not be compared, and the verdict."""
    lines = _aligned(_short(comparison, timings))
    notes = [f"not compared: {name}: {reason}" for name, reason in comparison.failed.items()] + [comparison.verdict]
    folded = textwrap.TextWrapper(_WIDE, subsequent_indent="  ", break_on_hyphens=False)
    wrapped = [line for note in notes if note for line in folded.wrap(note)]
    inside = textwrap.TextWrapper(_WIDE, initial_indent="  ", subsequent_indent="    ", break_on_hyphens=False)
    warned = [line for each in comparison.warnings for line in inside.wrap(each)]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:], *wrapped, *(["Warnings"] if warned else []), *warned])


def to_words(comparison: "Comparison") -> str:
    """The rows that predict best, and the verdict."""
    best = [*comparison.ranked(), *(row for row in comparison.rows if row.cv_rmse != row.cv_rmse)]
    wanted = ("model", "parameters", "fit [%]", "rmse", "cv rmse", "max width")
    chosen = [column for column in columns(comparison, timings=False) if column.heading.startswith(wanted)]
    table = [["", *(column.heading for column in chosen[1:])]]
    table += [[_printed(column.value(row), column.digits) for column in chosen] for row in best[:_PRINTED]]
    more, many = len(best) - _PRINTED, len(comparison.rows)
    head = f"Comparison of {many} model{'' if many == 1 else 's'} on {comparison.record.name or 'a record'}, "
    notes = [f"  ... and {more} more"] if more > 0 else []
    told = [
        f"Not compared: {', '.join(comparison.failed)}." if comparison.failed else "",
        comparison.verdict,
        f"Warnings: {'; '.join(comparison.warnings)}" if comparison.warnings else "",
    ]
    notes += textwrap.wrap(
        " ".join(filter(None, told)), LETTERS, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False
    )
    return words([f"{head}{len(comparison.record)} samples", *(f"  {line}" for line in _aligned(table)), *notes])


def to_html(comparison: "Comparison") -> str:
    """The short table for a notebook, and the verdict."""
    header, *rows = ([html.escape(cell) for cell in cells] for cells in _short(comparison, timings=False))
    head = "".join(f"<th>{cell}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>" for cells in rows)
    listed = "".join(f"<li>{html.escape(each)}</li>" for each in comparison.warnings)
    warned = f"<p>Warnings</p><ul>{listed}</ul>" if listed else ""
    verdict = f"<p>{html.escape(comparison.verdict)}</p>"
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{verdict}{warned}"


def to_markdown(comparison: "Comparison", *, timings: bool) -> str:
    """The short table in Markdown, with a row for what could not be compared."""
    header, *rows = _short(comparison, timings)
    rows += [[name, reason, *[""] * (len(header) - 2)] for name, reason in comparison.failed.items()]
    lines = [header, ["---", *("---:" for _ in header[1:])], *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |" for cells in lines)


def to_latex(comparison: "Comparison", *, timings: bool) -> str:
    """The short table as a plain tabular, which needs no package."""
    header, *rows = _short(comparison, timings)
    body = [" & ".join(map(_escaped, cells)) for cells in rows]
    body += [
        rf"{_escaped(name)} & \multicolumn{{{len(header) - 1}}}{{l}}{{{_escaped(reason)}}}"
        for name, reason in comparison.failed.items()
    ]
    lines = [rf"\begin{{tabular}}{{l{'r' * (len(header) - 1)}}}", r"\hline", " & ".join(map(_escaped, header)) + r" \\"]
    return "\n".join([*lines, r"\hline", *(rf"{line} \\" for line in body), r"\hline", r"\end{tabular}"])


def to_csv(comparison: "Comparison", *, timings: bool) -> str:
    """Every column, every digit kept; an unknown number is an empty cell."""
    buffer = io.StringIO()
    table = to_columns(comparison, timings=timings)
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(table)
    writer.writerows([map(_exact, row) for row in zip(*table.values(), strict=True)])
    return buffer.getvalue()


def to_columns(comparison: "Comparison", *, timings: bool) -> dict[str, list[Value | None]]:
    """Heading to values, a failed candidate with its name and message alone."""
    chosen = columns(comparison, timings=timings)
    failed: Iterable[Mapping[str, Value]] = (
        {"model": name, "converged": False, "message": reason} for name, reason in comparison.failed.items()
    )
    rows: Sequence[Mapping[str, Value]] = [
        *({column.heading: column.value(row) for column in chosen} for row in comparison.rows),
        *failed,
    ]
    return {column.heading: [row.get(column.heading) for row in rows] for column in chosen}


def to_frame(comparison: "Comparison", *, timings: bool) -> Any:
    """The columns as a DataFrame."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError(
            "to_frame needs pandas, which hysim does not install by itself: install hysim with the extra 'tables', "
            "or take to_csv"
        ) from error
    return pandas.DataFrame(to_columns(comparison, timings=timings))


def _aligned(table: Sequence[Sequence[str]]) -> list[str]:
    """Lines of cells, the first column to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join([cells[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(cells[1:], widths[1:], strict=True))])
        for cells in table
    ]


def _short(comparison: "Comparison", timings: bool) -> list[list[str]]:
    """Headings and printed cells of the short columns, one row a model."""
    chosen = [column for column in columns(comparison, timings=timings) if column.short]
    rows = [[_printed(column.value(row), column.digits) for column in chosen] for row in comparison.rows]
    return [[column.heading for column in chosen], *rows]


def _of(contrasts: "Mapping[str, Contrast]", row: "ComparisonRow", name: str) -> float:
    """How a model compares with the best one, which compares with itself as 1."""
    if row.name in contrasts:
        return float(getattr(contrasts[row.name], name))
    return 1.0 if name != "probability" and row.cv_rmse == row.cv_rmse else math.nan


def _printed(value: Value, digits: int) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{digits}f}" if math.isfinite(value) else "-" if math.isnan(value) else str(value)
    return str(value)


def _exact(value: Value | None) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return repr(float(value)) if isinstance(value, float) else _printed(value, 0)


def _escaped(text: str) -> str:
    return re.sub(r"([%&_#$])", r"\\\1", text)


def _defined(criterion: float) -> float:
    """An information criterion; nan where it is minus infinity, since every residual is zero."""
    return math.nan if criterion == -math.inf else criterion
