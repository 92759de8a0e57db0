"""What commands write: whole files, text on the standard output, progress on a terminal."""

import csv
import io
import json
import math
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hysim._atomic import write_text
from hysim.cli.records import STANDARD

if TYPE_CHECKING:
    from hysim._frozen import FloatArray
    from hysim.records import Record
    from hysim.simulation import Simulation


def check(*paths: str | None, pictures: Iterable[str | None] = (), printed: bool = False) -> bool:
    """Refuse what cannot be written, before anything is computed; whether a path is the standard output.

    Raises
    ------
    ValueError
        If a folder does not exist, a picture is not called .svg, or two results would go to one place, such as
        the standard output beside what is `printed` there.
    """
    drawn = [path for path in pictures if path is not None]
    given = [path for path in paths if path is not None] + drawn
    for path in given:
        if path != STANDARD and (Path(path).is_dir() or not Path(path).parent.is_dir()):
            raise ValueError(f"cannot write {path}: it is a folder, or its folder does not exist")
    for path in drawn:
        if path != STANDARD and Path(path).suffix.lower() != ".svg":
            raise ValueError(f"pictures are SVG: call the file .svg, got {path}")
    if given.count(STANDARD) + printed > 1:
        raise ValueError("two results would go to the standard output: give one of them a file, or leave it out")
    if len(set(given)) < len(given):
        raise ValueError(f"two results would go to one file, {given[0]}")
    return STANDARD in given


def write(texts: Mapping[str | None, str]) -> None:
    """Write each text to its path, to the standard output, or nowhere."""
    for path, text in texts.items():
        if path == STANDARD:
            sys.stdout.write(text)
            sys.stdout.flush()
        elif path is not None:
            write_text(path, text)


def to_json(document: Mapping[str, Any]) -> str:
    """JSON with null for numbers that are not finite."""
    return json.dumps(_plain(document), indent=2, allow_nan=False) + "\n"


def to_csv(columns: Mapping[str, "FloatArray"], units: Mapping[str, str]) -> str:
    """Columns under their names and units, every digit kept."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([f"{name} [{units[name]}]" if name in units else name for name in columns])
    writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
    return buffer.getvalue()


def loop_svg(*results: "Record | Simulation") -> str:
    """Picture of loops, the same bytes each time."""
    from hysim import plot

    with plot.house_style():
        canvas = plot.figure()
        plot.loop(*results, ax=canvas.add_subplot())
    return plot.to_svg(canvas, name="loop") + "\n"


def progress() -> Callable[[int, int], None] | None:
    """A counter on the standard error, if that is a terminal; a total of 0 is one that is not known."""
    if not sys.stderr.isatty():
        return None

    def show(done: int, total: int) -> None:
        text = f"{done}/{total}" if total else f"{done}"
        print(f"\r{text}", end="\n" if 0 < total <= done else "", file=sys.stderr, flush=True)

    return show


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
