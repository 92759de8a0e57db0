"""What commands write: whole files, text on the standard output, progress on a terminal."""

import contextlib
import csv
import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from hysim._atomic import write_all
from hysim.cli.records import STANDARD

if TYPE_CHECKING:
    from hysim._frozen import FloatArray
    from hysim.plot import Figure
    from hysim.records import Record
    from hysim.simulation import Simulation

PICTURE = "written as SVG, PNG or PDF by its ending; - writes SVG to the standard output"
TABLE = "written as .csv, .tsv, .npz, .mat or .h5 by its ending; - writes comma-separated text to the standard output"
_ENDINGS = (".svg", ".png", ".pdf")


def check(
    *paths: str | None,
    inputs: Iterable[str | None],
    pictures: Iterable[str | None] = (),
    table: str | None = None,
    printed: bool = False,
) -> bool:
    """Refuse what cannot be written, before anything is computed; whether a path is the standard output.

    Raises
    ------
    ValueError
        If a folder does not exist or may not be written to, a picture or a table has another ending than those known,
        two results would go to one place, such as the standard output beside what is `printed` there, or a result
        would take the place of one of the `inputs`.
    """
    drawn = [path for path in pictures if path is not None]
    given = [path for path in (*paths, table) if path is not None] + drawn
    for path in given:
        if path == STANDARD:
            continue
        if Path(path).is_dir() or not Path(path).parent.is_dir():
            raise ValueError(f"cannot write {path}: it is a folder, or its folder does not exist")
        if not os.access(Path(path).parent, os.W_OK):
            raise ValueError(f"cannot write {path}: its folder may not be written to")
    if table not in (None, STANDARD):
        from hysim.files import ending

        ending(str(table))
    for path in drawn:
        if path != STANDARD and Path(path).suffix.lower() not in _ENDINGS:
            raise ValueError(f"pictures are SVG, PNG or PDF: call the file .svg, .png or .pdf, got {path}")
    if given.count(STANDARD) + printed > 1:
        raise ValueError("two results would go to the standard output: give one of them a file, or leave it out")
    if len({os.path.realpath(path) for path in given}) < len(given):
        raise ValueError(f"two results would go to one file, {given[0]}")
    keep(inputs, given)
    return STANDARD in given


def keep(inputs: Iterable[str | None], results: Iterable[str | None]) -> None:
    """Refuse results that would take the place of an input, by whatever path or link.

    Raises
    ------
    ValueError
        If there is one.
    """
    targets = {path: os.stat(path) for path in results if path not in (None, STANDARD) and os.path.isfile(path)}
    for source in inputs:
        for path, target in targets.items():
            if source is not None and any(os.path.samestat(target, each) for each in _files(source)):
                raise ValueError(f"{path} is an input of this command, and would be overwritten: give another file")


def _files(source: str) -> Iterator[os.stat_result]:
    """Files behind an input: itself, the files of a folder, or the file that the standard input is read from."""
    paths = [os.path.join(source, name) for name in os.listdir(source)] if os.path.isdir(source) else [source]
    for path in paths:
        with contextlib.suppress(OSError, ValueError):  # what cannot be read is said where it is read
            yield os.fstat(sys.stdin.fileno()) if path == STANDARD else os.stat(path)


def write(contents: "Mapping[str | None, str | bytes | Figure]") -> None:
    """Write each content or figure to its path, to the standard output, or nowhere: all of the files or none."""
    made = {path: _content(path, content) for path, content in contents.items() if path is not None}
    write_all({path: content for path, content in made.items() if path != STANDARD})
    if STANDARD in made:
        print(made[STANDARD].decode(), end="", flush=True)


def _content(path: str, content: "str | bytes | Figure") -> bytes:
    if isinstance(content, str | bytes):
        return content.encode() if isinstance(content, str) else content
    from hysim import plot

    return plot.to_bytes(content, "svg" if path == STANDARD else Path(path).suffix[1:].lower(), name="picture")


def to_json(document: Mapping[str, Any]) -> str:
    """JSON with null for numbers that are not finite."""
    return json.dumps(_plain(document), indent=2, allow_nan=False) + "\n"


def table(path: str, columns: Mapping[str, "FloatArray"], units: Mapping[str, str]) -> str | bytes:
    """Columns in the format that the ending of their path names; the standard output gets comma-separated text.

    Raises
    ------
    ValueError
        If the ending names none, or its format needs an extra.
    """
    if path == STANDARD:
        return to_csv(columns, units)
    from hysim.files import Notes, packed

    return packed(columns, path, Notes({name: units[name] for name in columns if name in units}))


def to_csv(columns: Mapping[str, "FloatArray"], units: Mapping[str, str]) -> str:
    """Columns under their names and units, every digit kept."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([f"{name} [{units[name]}]" if name in units else name for name in columns])
    writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
    return buffer.getvalue()


class Curve(NamedTuple):
    """What pictures take: input, output and time, with a name and units."""

    u: "FloatArray"
    y: "FloatArray"
    t: "FloatArray | None" = None
    name: str = ""
    units: Mapping[str, str] = MappingProxyType({})


def loop(*results: "Record | Simulation", model: Any = None) -> "Figure":
    """Picture of loops; the last is of a `model`, and has its family's name."""
    from hysim import plot

    *others, last = results
    run = last if model is None else Curve(last.u, last.y, last.t, type(model).__name__, last.units)
    with plot.house_style():
        canvas = plot.figure()
        plot.loop(*others, run, ax=canvas.add_subplot())
    return canvas


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
