"""Writing of results: whole files, and text on the standard output; messages in the words of the shell.

A message names an argument of a verb by ``name=``, with or without a value, or begins with its name. The option of a
command that stands for it has the same name, or one in `OTHER_NAMES`; for an argument that the command lacks it is the
option of another command, one `OF_OTHER_COMMANDS`. What no option stands for is left as it is, and so are the calls in
a message, such as ``BoucWen(n=1.0)``.
"""

import contextlib
import json
import math
import os
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import Any

import click

import hysim as hs
from hysim._basics.atomic import write_all
from hysim.cli.options import INPUT, MODEL, OTHER_NAMES, PICTURE, PRINTED, SOURCE, STANDARD, TABLE, Files, flag

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
    inputs = [path for path, role in files if role == INPUT]
    if inputs.count(STANDARD) > 1:
        raise ValueError("the standard input holds one record or one model, not both: give files for the others")
    paths = [path for path, _ in results]
    if paths.count(STANDARD) + (prints and (STANDARD, PRINTED) not in results) > 1:
        raise ValueError("two results would go to the standard output: write one of them to a file, or leave it out")
    if len({*map(os.path.realpath, paths)}) < len(paths):
        raise ValueError(f"two results would go to one file, {paths[0]}")
    sources = [Path(path).with_suffix("") for path, role in results if role == SOURCE]
    beside = [f"{source}{end}" for source in sources for end in _BESIDE_SOURCE]
    keep(inputs, [*paths, *beside])
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
    sources = [each for source in inputs if source is not None for each in _behind(source)]
    for path, target in targets.items():
        if any(os.path.samestat(target, each) for each in sources):
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
    finite = json.loads(json.dumps(document, default=dict), parse_constant=lambda _: None)
    return json.dumps(finite, indent=2) + "\n"


_OF_IDENTIFY = (
    "bounds", "cross_validate", "free", "initial", "max_evaluations", "weights", "excitation", "resolution", "t",
    "admissible", "channels", "fixed", "noise",
)  # fmt: skip
OF_OTHER_COMMANDS = {name: f"hysim identify {flag(name)}" for name in _OF_IDENTIFY} | {
    "priors": "hysim posterior --prior"
}
"""Arguments that a message names to readers of a command without such an option, and the option that stands for it."""

_PHRASES = {
    "as u_times and frame_times": "as --t and --frame-rate",
    r"hs\.load\(\.\.\.\)\.resample\(([^)]*)\)": r"--t, --u and --sample-time \1",
    r', on_missing="split" cuts the record there': "",
    r"hysim\.loop_metrics\(tolerance=\.\.\.\)": "hysim metrics --tolerance",
    r"hysim\.cycle_metrics": "hysim metrics --cycles",
    r": read it with hs\.load_model": ", which hysim simulate, control, page and c take, and hysim compare --model",
    r"; if it is a record: read it with hs\.load": "; hysim identify --out makes a model of a record",
    r"Record\(resolution=\.\.\.\)": "resolution=",
    r"BoucWenOscillator\.structure\(initial=\.\.\.\)": "initial=",
    r'structure\(excitation="force"\)': 'excitation="force"',
    r"structure\(levels=\.\.\.\)": "a model in a file",
    r"hs\.discover_oscillator(\(record\))?": "hysim discover --route oscillator",
    r"hs\.PrandtlIshlinskii or hs\.Preisach": "prandtl-ishlinskii or preisach",
    r"Take hs\.PrandtlIshlinskii": "Take prandtl-ishlinskii",
    r"hysim\.to_c and hysim\.to_fmu": "hysim c and hysim fmu",
    "must be None or": "must be left out or",
    ", names as in Structure.scalars": "",
    r", or identify the law \+ hs\.Line\(\)": "",
}  # fmt: skip
_CALL = re.compile(r"(\b[A-Za-z_]\w*\((?:[^()]|\([^()]*\))*\))")
_VALUE = r"""(?:("[^"]*"|'[^']*'|\[[^\]]*\]|\{[^}]*\}|False|True|-?\d(?:[\w.+-]*\w)?)|(?!\w))"""
_VERB = r"(?= (?:must|is|are|has|takes|names|needs|cannot)\b)"
_ITEM = re.compile(r"""['"]([^'"]+)['"](?:\s*:\s*(?:\(([^)]*)\)|([^,}]+)))?""")


def in_shell_words(message: str, flags: Mapping[str, str]) -> str:
    """The message with options in place of arguments; `flags` are the options of a command by the names of values."""
    for phrase, words in _PHRASES.items():
        message = re.sub(phrase, words, message)
    if not flags:
        return message
    options = {**flags, **{name: flag(name) for name in OTHER_NAMES if flag(name) in flags.values()}}
    known = {**OF_OTHER_COMMANDS, **options}
    long = _any(name for name in options if len(name) > 1)
    compound = _any(name for name in options if "_" in name)

    def translated(text: str) -> str:
        text = re.sub(rf"(?<![\w.\"'-])({_any(known)})={_VALUE}", lambda match: _option(match, known[match[1]]), text)
        text, are, listed = text.partition(" are: ")  # names in a list, such as columns of a file, are no arguments
        return re.sub(rf"(?<![\w.\"'-])({compound})\b(?!=)", lambda match: options[match[1]], text) + are + listed

    texts = _CALL.split(message)  # every other one is a call
    texts[::2] = map(translated, texts[::2])
    texts[0] = re.sub(rf"(^(?:\S+: )?)({long}){_VERB}", lambda match: match[1] + options[match[2]], texts[0])
    return "".join(texts)


def _any(names: Iterable[str]) -> str:
    """A pattern of any of some names, the longer before the shorter; without names it matches nothing."""
    return "|".join(sorted(map(re.escape, names), key=len, reverse=True)) or r"(?!)"


def _option(argument: re.Match[str], flag: str) -> str:
    """The option with its value, as it is typed; a signal with a value is no argument, but as in ``--unit u=V``."""
    name, value = argument.groups()
    if len(name) == 1 and value is not None:
        return flag.replace("--t", "--no-t") if (name, value) == ("t", "False") else argument[0]
    prefix = {"units": "u=", "channels": "CHANNEL="}.get(name, "")
    if value is None:
        return f"{flag} {prefix}{'UNIT' if name == 'units' else 'COLUMN'}" if prefix else flag
    if value[0] in "[{":
        more = " ..." * (value[0] == "[" and "..." in value)
        return " ".join(f"{flag} {_typed(_pair(*item))}" for item in _ITEM.findall(value)) + more
    value = {"True": "yes", "False": "no"}.get(value, value)
    return f"{flag} {_typed(prefix + value.strip(chr(34) + chr(39)))}"


def _pair(name: str, ends: str, content: str) -> str:
    """A name with its value if it has one: ``low:high`` for a pair in parentheses; dots are the name of a column."""
    value = ":".join(part.strip().upper() for part in ends.split(",")) if ends else content.strip()
    return f"{name}={'COLUMN' if value == '...' else value}" if value else name


def _typed(word: str) -> str:
    return word if re.fullmatch(r"[\w@%+=:,./*\[\]^-]+", word) else shlex.quote(word)


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


def on_axes(draw: Callable[..., object], *results: Any, **settings: Any) -> Any:
    return drawn(lambda canvas: draw(*results, ax=canvas.add_subplot(), **settings))


def in_panels(n: int, draw: Callable[[Any], object]) -> Any:
    """A picture of some panels in rows, which `draw` fills."""
    columns, rows = min(n, _LOOPS_IN_A_ROW), math.ceil(n / _LOOPS_IN_A_ROW)
    return drawn(
        lambda canvas: draw(hs.plot.panels(canvas, n, columns=columns, sharex=False)), 3.0 * columns + 1.0, 3.0 * rows
    )


def picture_of(run: "hs.Simulation") -> Any:
    """Picture of a simulation: the loops of a structure's elements, or the loop of output against input."""
    from hysim.simulation import has_elements

    if not has_elements(run):
        return on_axes(hs.plot.loop, run)
    return in_panels(run.signals["drift"].shape[1], lambda panels: hs.plot.element_loops(run, panels))
