"""Methods of `Comparison` that write it as text, CSV, Markdown, LaTeX and columns, from one list of columns."""

import html
import math
import re
from typing import Any, NamedTuple

from hysim._frozen import items
from hysim._printing import aligned, csv_text, folded, summary_text
from hysim.interop import frame, heading

Value = str | int | float | bool
_WIDE = 110  # letters in a line of text
_PRINTED = 5  # rows in words


class Column(NamedTuple):
    """A column: its heading, the value in a row by name, the decimals in print, and whether short tables have it."""

    heading: str
    name: str
    digits: int = 0
    short: bool = True


def columns(comparison: Any) -> list[Column]:
    """The columns that this comparison can fill."""
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


def rows(comparison: Any) -> list[dict[str, Any]]:
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


def to_text(comparison: Any) -> str:
    """The table for a terminal, and the verdict below it."""
    lines = aligned(_short(comparison))
    notes = [f"not compared: {name}: {reason}" for name, reason in comparison.failed.items()] + [comparison.verdict]
    wrapped = [line for note in notes if note for line in folded(note, _WIDE, indent="  ")]
    warnings = [line for each in comparison.warnings for line in folded(each, _WIDE, "  ", "    ")]
    return "\n".join(
        [lines[0], "-" * len(lines[0]), *lines[1:], *wrapped, *(["Warnings"] if warnings else []), *warnings]
    )


def to_words(comparison: Any) -> str:
    """The rows that predict best, and the verdict."""
    best = [row.name for row in comparison.ranked()]
    unknown = [row.name for row in comparison.rows if math.isnan(row.cv_rmse)]
    by_name = {row["name"]: row for row in rows(comparison)}
    names = ("name", "n_parameters", "fit_percent", "rmse", "cv_rmse", "rmse_ratio", "max_width")
    selected = [column for column in columns(comparison) if column.name in names]
    ordered = [by_name[name] for name in best + unknown]
    table = [["", *(column.heading for column in selected[1:])]]
    table += [[_printed(row[column.name], column.digits) for column in selected] for row in ordered[:_PRINTED]]
    more, many = len(ordered) - _PRINTED, len(ordered)
    head = f"Comparison of {many} model{'' if many == 1 else 's'} on {comparison.record.name or 'a record'}, "
    notes = [f"  ... and {more} more"] if more > 0 else []
    sentences = [
        f"Not compared: {', '.join(comparison.failed)}." if comparison.failed else "",
        comparison.verdict,
        f"Warnings: {'; '.join(comparison.warnings)}" if comparison.warnings else "",
    ]
    notes += folded(" ".join(filter(None, sentences)), first="  ", indent="  ")
    return summary_text([f"{head}{len(comparison.record)} samples", *(f"  {line}" for line in aligned(table)), *notes])


def to_html(comparison: Any) -> str:
    """The short table for a notebook, and the verdict."""
    header, *body = ([html.escape(cell) for cell in cells] for cells in _short(comparison))
    head = "".join(f"<th>{cell}</th>" for cell in header)
    lines = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>" for cells in body)
    listed = "".join(f"<li>{html.escape(each)}</li>" for each in comparison.warnings)
    warnings = f"<p>Warnings</p><ul>{listed}</ul>" if listed else ""
    verdict = f"<p>{html.escape(comparison.verdict)}</p>"
    return f"<table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>{verdict}{warnings}"


def to_markdown(comparison: Any) -> str:
    """The table in Markdown."""
    header, *body = _short(comparison)
    body += [[name, reason, *[""] * (len(header) - 2)] for name, reason in comparison.failed.items()]
    lines = [header, ["---", *("---:" for _ in header[1:])], *body]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |" for cells in lines)


def to_latex(comparison: Any) -> str:
    """The table as a plain LaTeX tabular, which needs no package."""
    (header, *body), failed = _short(comparison), comparison.failed.items()
    spans = rf"\multicolumn{{{len(header) - 1}}}{{l}}"
    lines = [" & ".join(map(_escaped, cells)) for cells in body]
    lines += [rf"{_escaped(name)} & {spans}{{{_escaped(reason)}}}" for name, reason in failed]
    head = [rf"\begin{{tabular}}{{l{'r' * (len(header) - 1)}}}", r"\hline", " & ".join(map(_escaped, header)) + r" \\"]
    return "\n".join([*head, r"\hline", *(rf"{line} \\" for line in lines), r"\hline", r"\end{tabular}"])


def to_csv(comparison: Any) -> str:
    """Every measure as comma-separated values with all digits, nan as an empty cell."""
    table = to_columns(comparison)
    return csv_text([table, *(map(_exact, row) for row in zip(*table.values(), strict=True))])


def to_columns(comparison: Any) -> dict[str, list[Value | None]]:
    """Heading to values; a model that could not be compared has its name and message only."""
    failed = [{"name": name, "success": False, "message": reason} for name, reason in comparison.failed.items()]
    every = [*rows(comparison), *failed]
    return {column.heading: [row.get(column.name) for row in every] for column in columns(comparison)}


def to_frame(comparison: Any) -> Any:
    """Every measure as a `pandas.DataFrame`, one row a model; ImportError without pandas.

    ``attrs`` holds the units of the columns by their headings, the record's name and the verdict.
    """
    units = {each.heading: unit for each in columns(comparison) if (unit := heading(each.heading)[1])}
    notes = {"record": comparison.record.name, "verdict": comparison.verdict}
    return frame(to_columns(comparison), units=units, notes=notes)


def _short(comparison: Any) -> list[list[str]]:
    """Headings and printed cells of the short columns, one row a model."""
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
