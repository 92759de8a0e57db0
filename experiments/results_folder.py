"""What every experiment leaves: its rows as a table, its figure, and the numbers that are quoted."""

import csv
import json
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes

import hysim as hs
from hysim.plot import Figure, figure, house_style, save_svg

PIXEL = hs.datasets.PIXEL  # um, of the paper's camera
CASES = "cases.jsonl"

Row = TypeVar("Row", bound=Mapping[str, Any])
T = TypeVar("T")


def cpu_timed(work: Callable[..., T], *arguments: Any, **options: Any) -> tuple[T, float]:
    """What a call returns, and its processor time [s]."""
    begin = time.process_time()
    return work(*arguments, **options), time.process_time() - begin


def wall_timed(work: Callable[..., T], *arguments: Any, **options: Any) -> tuple[T, float]:
    """What a call returns, and the time that went by [s]."""
    begin = time.perf_counter()
    return work(*arguments, **options), time.perf_counter() - begin


def write_results(
    folder: Path,
    rows: list[Row],
    draw: Callable[[list[Row]], Figure],
    numbers: Mapping[str, Any],
    *,
    smoke: bool = False,
) -> list[Row]:
    """Print `numbers`, and write table.csv, figure.svg, and result.json with them before the rows, into `folder`.

    Cells of the table are empty where a row lacks a column. Nothing is done in a smoke run. Returns the rows.
    """
    if smoke:
        return rows
    for name, value in numbers.items():
        print(name, value)
    write_files(folder, rows, draw, numbers)
    (folder / CASES).unlink(missing_ok=True)
    return rows


def write_files(folder: Path, rows: list[Row], draw: Callable[[list[Row]], Figure], numbers: Mapping[str, Any]) -> None:
    """Write the three files alone."""
    folder.mkdir(parents=True, exist_ok=True)
    columns = dict.fromkeys(name for row in rows for name in row)
    with (folder / "table.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, columns, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    document = json.dumps({**numbers, "rows": rows}, indent=2, allow_nan=False)
    (folder / "result.json").write_text(document + "\n", encoding="utf-8")
    with house_style():
        save_svg(draw(rows), folder / "figure.svg", name=folder.name)


def stored_result(folder: Path) -> dict[str, Any]:
    """What result.json of an earlier run holds; nothing if there was none."""
    file = folder / "result.json"
    return dict(json.loads(file.read_text(encoding="utf-8"))) if file.exists() else {}


def stored_lines(file: Path | None) -> list[dict[str, Any]]:
    """Rows of a file with a row of JSON on each line; none if there is no file."""
    if file is None or not file.exists():
        return []
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def append_lines(file: Path | None, *rows: Mapping[str, Any]) -> None:
    """Add rows to such a file, if there is to be one."""
    if file is not None:
        with file.open("a", encoding="utf-8") as lines:
            lines.writelines(json.dumps(row, allow_nan=False) + "\n" for row in rows)


def stored_cases(
    folder: Path,
    columns: tuple[str, ...],
    cases: Mapping[tuple[Any, ...], Any],
    measure: Callable[[Any], dict[str, Any]],
    line_of: Callable[[dict[str, Any]], Any] = str,
    mapped: Callable[..., Iterable[Any]] = map,
) -> list[dict[str, Any]]:
    """The row of each case, printed and stored as soon as it is measured; its key is what the row has in `columns`.

    A run that is ended early is continued by the next one: `write_results` removes what is stored.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows = {tuple(row[name] for name in columns): row for row in stored_lines(folder / CASES)}
    missing = [key for key in cases if key not in rows]
    for key, row in zip(missing, mapped(measure, [cases[key] for key in missing]), strict=True):
        print(line_of(row), flush=True)
        append_lines(folder / CASES, row)
        rows[key] = row
    return [rows[key] for key in cases]


def median_and_worst(name: str, values: Iterable[float]) -> dict[str, float]:
    """The columns of a summary of some values of `name`."""
    collected = np.array(list(values), dtype=float)
    return {f"median_{name}": float(np.median(collected)), f"worst_{name}": float(collected.max())}


def one_panel(height: float) -> tuple[Figure, Axes]:
    """A figure of this height [in], and its Axes."""
    canvas = figure(height=height)
    return canvas, canvas.add_subplot()


def name_rows(ax: Axes, names: Iterable[str]) -> None:
    """Write names beside the rows of a panel, the first one at its top."""
    ax.set_yticks(*zip(*enumerate(names), strict=True))
    ax.invert_yaxis()


def label_grid(canvas: Figure, axes: np.ndarray, xlabel: str, ylabel: str, names: Iterable[str]) -> None:
    """Label a grid of panels at its lower and left side, with one legend of these names, where they are drawn."""
    for ax in axes[-1]:
        ax.set_xlabel(xlabel)
    for ax in axes[:, 0]:
        ax.set_ylabel(ylabel)
    handles = {label: handle for ax in axes.flat for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    shown = [name for name in names if name in handles]
    canvas.legend([handles[name] for name in shown], shown, loc="outside lower center", ncols=3)


def draw_models(
    canvas: Figure, rows: list[Row], filled: list[bool], panels: Iterable[tuple[str, float, str]]
) -> np.ndarray:
    """A dot for each model and panel, filled or not; a panel is a column, its scale and its label."""
    axes = canvas.subplots(1, 2, sharey=True)
    for ax, (column, scale, label) in zip(axes, panels, strict=True):
        for place, (row, full) in enumerate(zip(rows, filled, strict=True)):
            ax.plot(scale * row[column], place, "o", color="#0072B2", markerfacecolor="#0072B2" if full else "white")
        ax.set_xlabel(label)
    name_rows(axes[0], [row["model"] for row in rows])
    return axes


def loop_columns(loop: hs.control.LoopAssessment) -> dict[str, float | bool | None]:
    """What stands beside a reduction in the table of every control experiment; a pixel is the paper's camera's."""
    columns = loop.row(PIXEL)
    return {
        "stable": columns["stable"],
        "period_s": columns["period"],
        "tracking_rms_um": columns["tracking_rms"],
        "limited_percent": columns["limited_percent"],
        "max_sensitivity_with_delay": columns["max_sensitivity_with_delay"],
        "volts_per_pixel": columns["volts_per_quantum"],
    }


def open_loop_columns(period: float, tracking_rms: float) -> dict[str, float | bool | None]:
    """The same of an open loop, which nothing makes unstable."""
    return {
        "stable": True,
        "period_s": period,
        "tracking_rms_um": tracking_rms,
        "limited_percent": 0.0,
        "max_sensitivity_with_delay": 1.0,
        "volts_per_pixel": 0.0,
    }


def words(row: Mapping[str, Any]) -> str:
    """These columns of a row in words, for printing."""
    sensitivity = row["max_sensitivity_with_delay"]
    return (
        f"{'stable' if row['stable'] else 'NOT STABLE'}, at a limit {row['limited_percent']:.1f} %, sensitivity with "
        f"a sample more of delay {'infinite' if sensitivity is None else format(sensitivity, '.2f')}, "
        f"{row['volts_per_pixel']:.3g} V a pixel"
    )
