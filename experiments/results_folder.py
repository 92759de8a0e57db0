"""What every experiment leaves: its rows as a table, its figure, and the numbers that are quoted."""

import csv
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from hysim.plot import Figure, house_style, save_svg

Row = TypeVar("Row", bound=Mapping[str, Any])


def write_results(
    folder: Path, rows: list[Row], draw: Callable[[list[Row]], Figure], numbers: Mapping[str, Any]
) -> None:
    """Write table.csv, figure.svg, and result.json with `numbers` before the rows, into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "table.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, rows[0], lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    document = json.dumps({**numbers, "rows": rows}, indent=2, allow_nan=False)
    (folder / "result.json").write_text(document + "\n", encoding="utf-8")
    with house_style():
        save_svg(draw(rows), folder / "figure.svg", name=folder.name)
