"""Options and arguments of the commands, which follow from signatures, annotations and docstrings.

    def simulate(model: ModelIn, file: RecordIn, *, options: InputOptions, out: Table | None = None) -> None:
        '''Drive a model with the input in a file.

        Parameters
        ----------
        out : the columns (default: the standard output)

        Examples
        --------
        hysim simulate law.json drive.csv
        '''

A parameter before the star is an argument by its place, and one behind it an option: a `bool` without a value, a tuple
or a dict one that may be used more than once, a `Literal` one that takes some words. A dataclass stands for its fields,
with its own docstring. Any other section of a docstring is a group of options with this title.
"""

import dataclasses
import inspect
import math
import re
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import click
from click.shell_completion import CompletionItem

from hysim._basics.names import nearest

T = TypeVar("T")
Files = Mapping[str | None, Callable[[], Any]]
"""Functions of the contents of files, which are texts, bytes or figures, by the paths; None stands for no file."""


class Result(NamedTuple):
    """Files of a command with ``--json``, the text and the JSON that it prints, and whether a search converged.

    Where it has to be called again, `unfinished` says what remains.
    """

    files: Files
    text: Callable[[], str]
    document: Callable[[], Mapping[str, Any]]
    reached: bool = True
    unfinished: str = ""


Command = Callable[..., Result | bool | None]
"""A function behind a command: false if a result was not reached."""

INPUT, RESULT, PRINTED, PICTURE = "input", "result", "printed result", "picture"
TABLE, MODEL, SOURCE = "table", "model", "source"
"""Roles of files: read, written, written with what is printed too, drawn; columns, models and C code as written."""

STANDARD = "-"
"""Stands for the standard input or output."""

_FORMS = {
    PICTURE: "; written as SVG, PNG or PDF by its ending; - writes SVG to the standard output",
    TABLE: "; written as .csv, .tsv, .npz, .mat or .h5 by its ending; - writes CSV to the standard output",
}
OWN = "module:name of your own, which executes ./module.py or an installed module"
_HELP = {
    "json": "print the result as JSON",
    "seed": "seed of the random starts",
    "quiet": "report no progress of long calls on standard error",
}
"""Help of options whose docstring says nothing about them."""


OTHER_NAMES = {
    "acceleration": "u", "channels": "channel", "elements": "plays", "fixed": "fix", "priors": "prior",
    "units": "unit",
}  # fmt: skip
"""Arguments whose option has another name, and that name."""


def flag(name: str) -> str:
    """The option for an argument, such as ``--sample-time``."""
    return f"--{OTHER_NAMES.get(name, name).rstrip('_').replace('_', '-')}"


def suggestion(word: str, known: Iterable[str]) -> str:
    """``did you mean NAME?`` for the nearest of some names, an empty text if no name is similar."""
    near = nearest(word.partition("=")[0], known)
    return "" if near is None else f"did you mean {near}?"


@dataclass(frozen=True)
class Value:
    """The value of an option: its name, how it is read, what is expected, and the role of a file that it names.

    `words` are taken as they are, and `bare` is the text if the value is left out. `offers` are what a shell completes
    beside files, `models` are named at the end of the help, and `help` stands for a docstring that says nothing.
    """

    name: str
    read: Callable[[str], Any] | None = str
    expected: str = ""
    role: str = ""
    _: KW_ONLY
    words: tuple[str, ...] = ()
    bare: str | None = None
    offers: Callable[[], Iterable[str]] = tuple
    models: Callable[[], Iterable[str]] | None = None
    help: str = ""

    def convert(self, text: Any) -> Any:
        """The value that a text stands for, or a default as it is."""
        if not isinstance(text, str) or text in self.words:
            return text
        with suppress(ValueError):
            if self.read is not None:
                return self.read(text)
        near = suggestion(text, self.words)
        raise click.BadParameter(f"expected {self.expected}, got {text!r}{near and f': {near}'}")

    def complete(self, _context: click.Context, _parameter: click.Parameter, begin: str) -> list[CompletionItem]:
        words = [CompletionItem(word) for word in (*self.words, *self.offers()) if word.startswith(begin)]
        return words if self.read is None else [CompletionItem(begin, type="file"), *words]


class Parameter(NamedTuple):
    """A parameter of click, with its value, its help, and the title of the group that shows it."""

    click: click.Parameter
    value: Value
    help: str
    title: str


def parameters(function: Command) -> Iterator[Parameter]:
    """Arguments and options of a command, in the order of its docstrings."""
    yield from _declared(function, documented(function))
    has_json = typing.get_type_hints(function).get("return") is Result
    for name in ("json", "quiet") if has_json else ("quiet",):
        own = inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=bool)
        yield _parameter(own, "Options", "")


def call(function: Command, values: Mapping[str, Any]) -> Result | bool | None:
    arguments = {name: values.get(name) for name in inspect.signature(function).parameters}
    for name, hint in typing.get_type_hints(function).items():
        if dataclasses.is_dataclass(hint):
            build: Any = hint
            arguments[name] = build(**{field.name: values[field.name] for field in dataclasses.fields(hint)})
    return function(**arguments)


def taken(verb: Callable[..., Any], settings: Any) -> dict[str, Any]:
    """Values of the fields of a dataclass that have the name of an argument of a function."""
    arguments = inspect.signature(verb).parameters
    return {name: value for name, value in vars(settings).items() if name in arguments}


def sections(subject: Any) -> dict[str, str]:
    """Sections of a docstring by their titles; what stands before the first is the section without a title."""
    first, *others = re.split(r"^(.+)\n---+\n", inspect.cleandoc(subject.__doc__ or ""), flags=re.MULTILINE)
    return {"": first.strip(), **{title: text.strip() for title, text in zip(others[::2], others[1::2], strict=True)}}


def documented(subject: Any) -> dict[str, tuple[str, str]]:
    """Title and help of the parameters in a docstring, and of fields that a dataclass inherits."""
    entries = {}
    for title, text in sections(subject).items():
        for line in re.sub(r"\n +", " ", text).splitlines() if title not in ("", "Examples") else ():
            name, _, help_ = line.partition(" :")
            entries[name] = ("Options" if title == "Parameters" else title, help_.strip())
    for base in subject.__bases__ if isinstance(subject, type) else ():
        entries |= {name: text for name, text in documented(base).items() if name not in entries}
    return entries


def _declared(subject: Any, texts: Mapping[str, tuple[str, str]]) -> Iterator[Parameter]:
    hints, signature = (typing.get_type_hints(subject, include_extras=True), inspect.signature(subject))
    for name in texts if isinstance(subject, type) else signature.parameters:
        own, hint = signature.parameters[name], hints[name]
        if dataclasses.is_dataclass(hint):
            yield from _declared(hint, documented(hint))
        else:
            yield _parameter(own.replace(annotation=hint), *texts.get(name, ("Options", "")))


def _parameter(own: inspect.Parameter, title: str, text: str) -> Parameter:
    hint, several = _of_one(own.annotation)
    value, is_multiple, is_needed = _value(hint), several is not None, own.default is own.empty
    text = (text or value.help or _HELP.get(own.name, "")) + _FORMS.get(value.role, "")
    settings: dict[str, Any] = {"type": value.convert, "shell_complete": value.complete, "required": is_needed}
    if own.default not in (own.empty, None, ()):
        settings["default"] = own.default
    if own.kind is not own.KEYWORD_ONLY:
        form = value.name if is_needed else f"[{value.name}]{'...' * is_multiple}"
        argument = click.Argument([own.name], metavar=form, nargs=-1 if is_multiple else 1, **settings)
        return Parameter(argument, value, text, "Arguments")
    settings |= {"metavar": value.name, "show_default": "default" in settings}
    if hint is bool:
        settings = {"is_flag": True}
    elif value.bare is not None:
        settings |= {"is_flag": False, "flag_value": value.bare, "metavar": f"[{value.name}]"}
    if several is dict:
        settings["callback"] = lambda _context, _parameter, pairs: dict(pairs) or None
    option = click.Option([flag(own.name), own.name], help=text, multiple=is_multiple, **settings)
    return Parameter(option, value, text, title)


def _of_one(hint: Any) -> tuple[Any, type | None]:
    """A type without None, that of each item of a tuple or dict, and the type of several values."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        (hint,) = (each for each in typing.get_args(hint) if each is not types.NoneType)
    several = typing.get_origin(hint)
    if several not in (tuple, dict):
        return hint, None
    return typing.get_args(hint)[several is dict], several


def _value(hint: Any) -> Value:
    if typing.get_origin(hint) is Annotated:
        value: Value = hint.__metadata__[0]
        return value
    return one_of(dict.fromkeys(typing.get_args(hint), "")) if typing.get_origin(hint) is Literal else _PLAIN[hint]


def one_of(words: Mapping[str, str]) -> Value:
    text = "; ".join(f"{word}: {meaning}" for word, meaning in words.items())
    return Value(f"[{'|'.join(words)}]", None, ", ".join(words), words=(*words,), help=text)


def either(form: str, read: Callable[[str], Any], expected: str) -> Value:
    """One of the words with small letters in a form such as x|y|DEGREES, or another value."""
    return Value(form, read, expected, words=tuple(word for word in form.split("|") if word.islower()))


def at_least(least: int) -> Callable[[str], Any]:
    """A reader of whole numbers that are not below a least one."""
    return lambda text: _checked(int(text), text, holds=int(text) >= least)


def between(low: float, high: float) -> Callable[[str], Any]:
    """A reader of numbers above one and below another."""
    return lambda text: _checked(float(text), text, holds=low < float(text) < high)


def _checked(value: T, text: str, *, holds: bool) -> T:
    if not holds:
        raise ValueError(text)
    return value


def parts(form: str, *readers: Callable[[str], Any], expected: str = "") -> Value:
    """A value of several parts, each with its reader, and LOW below HIGH; of NAME=LOW:HIGH a name and its value."""
    pattern = re.sub("[A-Z]+", "(.*)", form).replace("(.*)", "(.+?)", 1)  # the first sign parts a name from its value
    is_range = form.endswith("HIGH")

    def read(text: str) -> tuple[Any, ...]:
        match = re.fullmatch(pattern, text, re.DOTALL)
        values = tuple(each(part) for each, part in zip(readers, match.groups() if match else (), strict=True))
        _checked(values, text, holds=not is_range or values[-2] < values[-1])
        return (values[0], values[1] if len(values) == 2 else values[1:]) if "=" in form else values

    numbers = " with numbers" * (float in readers) + ", LOW below HIGH" * is_range
    return Value(form, read, expected or form + numbers)


def _signal(text: str) -> str:
    return _checked(text, text, holds=text in ("t", "u", "y"))


def _sensor(text: str) -> Any:
    return _CHANNEL.convert(text if "=" in text else f"{text}={text}")


def exclusive(**values: Any) -> None:
    used = [flag(name) for name, value in values.items() if value not in (None, False)]
    if len(used) > 1:
        raise ValueError(f"{' and '.join(used)} exclude each other: leave one of them out")


def column(text: str) -> str | int:
    return int(text) if text.isascii() and text.isdigit() else text


Place = tuple[float, str]
"""A place in a record: the number of a sample from 0 if there is no unit, else a time and its unit."""


def _place(text: str) -> Place:
    unit = next((each for each in ("ms", "us", "ns", "s") if text.endswith(each)), "")
    number = text.removesuffix(unit)
    return (float(number) if unit else at_least(0)(number)), unit


def _terms(text: str) -> str | list[str]:
    names = [name.strip() for name in text.split(",")]
    return names if len(names) > 1 or "'" in text else text


_PLAIN = {
    str: Value("TEXT"),
    bool: Value(""),
    int: Value("N", int, "a whole number"),
    float: Value("NUMBER", float, "a number without a unit"),
}
_CYCLES = "a number of cycles, at least 1; the table needs the file before --cycles"
_MODEL = f"model file as identify writes it, - for the standard input, or {OWN}"
_RECORD = "text with one sample a line, NPZ, NPY, MAT or HDF5; or - for the standard input"
_PLACE = "the number of a sample from 0, or a time with its unit such as 2.5s or 300ms"

_DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "blank": " "}
Delimiter = Annotated[str, Value("TEXT", lambda text: _DELIMITERS.get(text, text))]
Column = Annotated[str | int, Value("COLUMN", column)]
Count = Annotated[int, Value("COUNT", at_least(1), "a number from 1 on")]
Positive = Annotated[float, Value("NUMBER", between(0.0, math.inf), "a positive number without a unit")]
Percent = Annotated[float, Value("NUMBER", between(0.0, 100.0), "a number above 0 and below 100")]
Pair = Annotated[tuple[float, float], parts("LOW,HIGH", float, float)]
Mode = Annotated[tuple[float, float], parts("FREQUENCY,DAMPING", float, float)]
Region = Annotated[tuple[int, int, int, int], parts("T,B,L,R", int, int, int, int)]
Fixed = dict[str, Annotated[float, parts("NAME=VALUE", str, float)]]
Ranges = dict[str, Annotated[tuple[float, float], parts("NAME=LOW:HIGH", str, float, float)]]
PlaceIn = Annotated[Place, Value("PLACE", _place, _PLACE)]
Units = dict[str, Annotated[str, parts("SIGNAL=UNIT", _signal, str, expected="t=, u= or y= and a unit")]]
_CHANNEL = parts("CHANNEL=COLUMN", str, column)
Channels = dict[str, Annotated[str | int, _CHANNEL]]
Depends = dict[str, Annotated[tuple[str, int], parts("NAME=CHANNEL:DEGREE", str, str, int)]]
_SENSOR = "SENSOR=COLUMN, or the name of both"
Sensors = dict[str, Annotated[str | int, Value("SENSOR=COLUMN", _sensor, _SENSOR)]]
Quantum = Annotated[float | str, Value("QUANTUM", float, "a number or detect", words=("detect",))]
Smoothness = Annotated[float | str, Value("STRENGTH", float, "a number or auto", words=("auto",))]
Cycles = Annotated[int, Value("CYCLES", lambda text: 0 if text == "all" else at_least(1)(text), _CYCLES, bare="all")]
Folds = Annotated[str | int, either("loo|cycles|K", at_least(0), "loo, cycles or a number of blocks")]
Blocks = Annotated[str | int, either("loo|K", at_least(2), "loo or a number of blocks from 2 on")]
Angle = Annotated[float | Literal["x", "y"], either("x|y|DEGREES", float, "x, y or an angle in degrees")]
Frame = Annotated[Any, either("first|running|N", at_least(0), "first, running or a number")]
YesNo = Annotated[bool, Value("[yes|no]", ("no", "yes").index, "yes or no", offers=lambda: ("yes", "no"))]
Terms = Annotated[str | list[str], Value("NAME|TERMS", _terms)]
RecordIn = Annotated[str, Value("FILE", role=INPUT, help=_RECORD)]
ModelIn = Annotated[str, Value("MODEL", role=INPUT, help=_MODEL)]
ResultFile = Annotated[str, Value("FILE", role=RESULT)]
Copy = Annotated[str, Value("FILE", role=PRINTED)]
Picture = Annotated[str, Value("PICTURE.svg", role=PICTURE)]
Table = Annotated[str, Value("TABLE.csv", role=TABLE)]
ModelOut = Annotated[str, Value("MODEL.json", role=MODEL)]
Page = Annotated[str, Value("PAGE.html", role=RESULT)]
Source = Annotated[str, Value("MODEL.c", role=SOURCE)]
