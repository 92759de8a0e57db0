"""Writing of results: whole files, and text on the standard output."""

import contextlib
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import Any

import click

import hysim as hs
from hysim._basics.atomic import write_all
from hysim.cli.options import INPUT, MODEL, PICTURE, PRINTED, SOURCE, TABLE, Files
from hysim.cli.records import STANDARD
from hysim.cli.words import in_shell_words

_FORMS = {  # by role: what is said of a wrong ending, and the right ones
    PICTURE: ("pictures are SVG, PNG or PDF: call the file .svg, .png or .pdf", (".svg", ".png", ".pdf")),
    MODEL: ("models are JSON: call the file .json", (".json",)),
    SOURCE: ("C code is a file with its header beside it: call the file .c", (".c",)),
}

_BESIDE_SOURCE = (".h", "_main.c")
_LOOPS_IN_A_ROW = 3


def check(files: Sequence[tuple[str, str]], *, prints: bool) -> None:
    """Raise a ValueError for results that cannot be written, before anything is computed.

    `files` are paths and their roles, no two of which may be equal; `prints` is whether a document is printed.
    """
    results = [(path, role) for path, role in files if role != INPUT]
    paths = [path for path, _ in results]
    if paths.count(STANDARD) + (prints and (STANDARD, PRINTED) not in results) > 1:
        raise ValueError("two results would go to the standard output: write one of them to a file, or leave it out")
    if len({*map(os.path.realpath, paths)}) < len(paths):
        raise ValueError(f"two results would go to one file, {paths[0]}")
    sources = [Path(path).with_suffix("") for path, role in results if role == SOURCE]
    beside = [f"{source}{end}" for source in sources for end in _BESIDE_SOURCE]
    keep([path for path, role in files if role == INPUT], [*paths, *beside])
    for path, role in results:
        if path != STANDARD or role == SOURCE:
            _check_path(Path(path), role)


def _check_path(path: Path, role: str) -> None:
    if path.is_dir() or not path.parent.is_dir():
        raise ValueError(f"cannot write {path}: it is a folder, or its folder does not exist")
    if not os.access(path.parent, os.W_OK):
        raise ValueError(f"cannot write {path}: its folder may not be written to")
    if role == TABLE:
        from hysim.files import ending

        ending(str(path))
    own = path.suffix.lower() if role == PICTURE else path.suffix
    if role in _FORMS and own not in _FORMS[role][1]:
        raise ValueError(f"{_FORMS[role][0]}, got {path}")


def keep(inputs: Iterable[str | None], results: Iterable[str | None]) -> None:
    """Raise a ValueError if a result would overwrite an input, by whatever path or link."""
    targets = {path: os.stat(path) for path in results if path not in (None, STANDARD) and os.path.isfile(path)}
    for source in inputs:
        for path, target in targets.items():
            if source is not None and any(os.path.samestat(target, each) for each in _behind(source)):
                raise ValueError(f"{path} is an input of this command, and would be overwritten: give another file")


def _behind(source: str) -> Iterator[os.stat_result]:
    """Files that an input is read from: itself, the files of a folder, or the file of the standard input."""
    paths = [os.path.join(source, name) for name in os.listdir(source)] if os.path.isdir(source) else [source]
    for path in paths:
        with contextlib.suppress(OSError, ValueError):  # a file that cannot be read is an error where it is read
            yield os.fstat(sys.stdin.fileno()) if path == STANDARD else os.stat(path)


def write(
    files: Files, text: Callable[[], str] | None = None, document: Callable[[], Mapping[str, Any]] | None = None
) -> None:
    """Write all files or no file; print `text`, or `document` with ``--json``, unless a path is standard output."""
    contents: dict[Any, bytes] = {path: _encoded(path, make()) for path, make in files.items() if path is not None}
    if text is not None and STANDARD not in contents:
        contents[STANDARD] = printed(text, document).encode()
    standard = contents.pop(STANDARD, None)
    if contents:
        write_all(contents)
    if standard is not None:
        print(standard.decode(), end="", flush=True)


def _encoded(path: str, content: Any) -> bytes:
    if isinstance(content, str):
        return content.encode()
    form = "svg" if path == STANDARD else Path(path).suffix[1:].lower()
    return content if isinstance(content, bytes) else hs.plot.to_bytes(content, form, name="picture")


def model(subject: Any, units: Mapping[str, str]) -> str:
    from hysim.models.storage import to_json as model_to_json

    return model_to_json(subject, units=units)


def printed(text: Callable[[], str], document: Callable[[], Mapping[str, Any]] | None) -> str:
    """The result as a text in the words of the shell, or with ``--json`` as a document if there is one."""
    context = click.get_current_context()
    if document is not None and context.params["json"]:
        return to_json(document())
    return in_shell_words(text(), flags(context.command)).rstrip("\n") + "\n"


def flags(command: click.Command) -> dict[str, str]:
    options = [each for each in command.params if isinstance(each, click.Option)]
    return {(each.name or "").rstrip("_"): each.opts[0] for each in options}


def to_json(document: Mapping[str, Any]) -> str:
    """JSON with null for numbers that are not finite."""
    return json.dumps(_jsonable(document), indent=2, allow_nan=False) + "\n"


def _jsonable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _jsonable(item) for name, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_jsonable(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def scalars(result: Any) -> dict[str, Any]:
    return {name: value for name, value in vars(result).items() if isinstance(value, (str, int, float))}


def fields_of(result: Any, names: Iterable[str]) -> dict[str, Any]:
    return {name: attrgetter(name)(result) for name in names}


def table(path: str, columns: Mapping[str, Any], units: Mapping[str, str], **notes: Any) -> bytes:
    """Columns in the format of the path's ending, CSV on standard output; ValueError if it is unknown."""
    from hysim.files import Notes, packed

    known = {name: units[name] for name in columns if name in units}
    return packed(columns, "output.csv" if path == STANDARD else path, Notes(known, **notes))


def drawn(draw: Callable[[Any], object], width: float = 6.0, height: float = 4.0) -> Any:
    with hs.plot.house_style():
        canvas = hs.plot.figure(width, height)
        draw(canvas)
    return canvas


def loop(*results: Any) -> Any:
    """Picture of loops over each other: of records, simulations, and models and fits on the record before them."""
    return drawn(lambda canvas: hs.plot.loop(*results, ax=canvas.add_subplot()))


def picture_of(run: "hs.Simulation") -> Any:
    """Picture of a simulation: the loops of a structure's elements, or the loop of output against input."""
    from hysim.simulation import has_elements

    if not has_elements(run):
        return loop(run)
    n = run.signals["drift"].shape[1]
    columns, rows = min(n, _LOOPS_IN_A_ROW), math.ceil(n / _LOOPS_IN_A_ROW)

    def draw(canvas: Any) -> None:
        hs.plot.element_loops(run, hs.plot.panels(canvas, n, columns=columns, sharex=False))

    return drawn(draw, 3.0 * columns + 1.0, 3.0 * rows)
