"""`hysim columns`: what a file holds, and how its columns are called."""

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from hysim.cli import outputs, records
from hysim.cli.options import JSON, Command

if TYPE_CHECKING:
    from hysim.files import FileColumn


def run(options: argparse.Namespace) -> int:
    """List and print."""
    from hysim.files import list_columns

    columns = list_columns(records.source_of(options.file), **records.text_options(options))

    def document() -> dict[str, Any]:
        return {"columns": [column._asdict() for column in columns]}

    outputs.write(options, {}, lambda: "\n".join(_lines(columns)), document)
    return 0


def _lines(columns: "tuple[FileColumn, ...]") -> Iterator[str]:
    if not columns:
        yield "the file holds no columns"
    width = max((len(column.name) for column in columns), default=0)
    for column in columns:
        number = "" if column.number is None else column.number
        yield f"{number:>3}  {column.name:<{width}}  {_content(column)}"


def _content(column: "FileColumn") -> str:
    if column.problem:
        return column.problem
    span = f"{column.lowest:.6g} to {column.highest:.6g} {column.unit}" if column.n_samples else "no values"
    missing = f", {column.n_missing} missing" if column.n_missing else ""
    return f"{column.n_samples} samples{missing}, {span.rstrip()}{', increases throughout' if column.increases else ''}"


COMMAND = Command(
    "columns",
    "list what a file holds",
    "List the columns of a file, by the names and numbers that --u, --y and --t take, with units, numbers of samples "
    "and ranges.",
    f"""
{records.FILE}

text:
{records.OF_A_TEXT}

{JSON}
""",
    run,
    """
hysim columns loop.csv
hysim columns rig.mat
hysim columns export.csv --encoding latin-1
""",
)
