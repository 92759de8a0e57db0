"""Options of the commands, written as their help shows them, and the readers of their values.

    file FILE                  an argument by its place: its name, its value, two spaces and the text
    --limits LOW,HIGH          an option; the text may go on
                               in indented lines
    --unit SIGNAL=UNIT...      an option that may be used more than once, or an argument for any number of files
    --cycles [N]               an option or argument whose value may be left out
    --hold zoh|foh             an option that takes one of some words
    --json                     an option without a value
    either --t COLUMN          two options that exclude each other
    or --no-t
    --seed NUMBER              a default value [default: 0]
    --out PATH                 an option that must be used [required]

    plant: description         a title for the options that follow, as far as the next empty line

The name of a value decides how it is read (`READERS`) and which role the file has that it names (`role`).
"""

import argparse
import re
from collections.abc import Callable
from typing import Any, NamedTuple

INPUT, RESULT, PRINTED, PICTURE, TABLE, MODEL = "input", "result", "printed result", "picture", "table", "model"
"""Roles of files: read, written, written with what is printed too, drawn, written as columns, written as a model."""

_ROLES = {"PATH": RESULT, "COPY": PRINTED, "OUT": TABLE}
_ROLES |= dict.fromkeys(("FILE", "FILE_OF_Y", "MODEL", "FRAMES", "DATABASE", "STUDY.toml", "triangle|step|FILE"), INPUT)
_FORMS = {
    PICTURE: "; written as SVG, PNG or PDF by its ending; - writes SVG to the standard output",
    TABLE: "; written as .csv, .tsv, .npz, .mat or .h5 by its ending; - writes CSV to the standard output",
}
_OPTION = re.compile(r"(either |or |)(-{0,2}[a-z][\w-]*)(?: (\S+))?  +(.*?)(?: \[default: (\S+)\]| (\[required\]))?")
_TITLE = re.compile(r"([a-z ]+):(?: (.*))?")

OWN = "module:name of your own, which executes ./module.py or an installed module"
MODEL_IN = f"model MODEL  model file as identify writes it, - for the standard input, or {OWN}"
MODEL_OUT = "--out MODEL.json  write the model; - writes it to the standard output"
SEED = "--seed NUMBER  seed of the random starts [default: 0]"
JSON = "--json  print the result as JSON"


class Command(NamedTuple):
    """A command of the command line; `run` takes the values of the options, and returns the exit code.

    `examples` are lines as they are typed, which stand at the end of the help.
    """

    name: str
    help: str
    description: str
    options: str
    run: Callable[[argparse.Namespace], int]
    examples: str = ""

    def add_to(self, commands: Any) -> Any:
        """Add the command to those of a parser."""
        parser = commands.add_parser(self.name, description=self.description)
        roles = dict(_declare(parser, self.options))
        parser.add_argument("--quiet", action="store_true", help="report no progress of long calls on standard error")
        flags = {action.dest: action.option_strings[0] for action in parser._actions if action.option_strings}
        parser.set_defaults(command=self, roles=roles, flags=flags)
        return parser


def _declare(parser: Any, options: str) -> Any:
    """Add options to a parser of `argparse`; yields the name of each value and the role of the file that it names."""
    group = either = parser
    for line in re.sub(r"\n +", " ", options.strip()).splitlines():
        if not line:
            group = parser
        elif title := _TITLE.fullmatch(line):
            group = parser.add_argument_group(*title.groups())
        elif option := _OPTION.fullmatch(line):
            alternative, name, value, text, default, required = option.groups()
            if alternative == "either ":
                either = group.add_mutually_exclusive_group()
            settings = _settings(name, value, default, bool(required))
            role = _role(settings.get("metavar", ""))
            settings["help"] = text.replace("%", "%%") + _FORMS.get(role, "") + settings.pop("help")
            (either if alternative else group).add_argument(name, **settings)
            yield name.lstrip("-").replace("-", "_"), role
        else:
            raise ValueError(f"expected an option, its value, two spaces and a text, got {line!r}")


def _settings(name: str, value: str | None, default: str | None, is_required: bool) -> dict[str, Any]:
    """Settings of `argparse` for an option; the help says the default only."""
    if value is None:
        return {"action": "store_true", "help": ""}
    plain = value.removesuffix("...").strip("[]")
    settings: dict[str, Any] = {"default": default, "help": "" if default is None else " (default: %(default)s)"}
    if "|" in plain and plain == plain.lower():
        settings["choices"] = plain.split("|")
    else:
        settings |= {"metavar": plain, "type": READERS.get(plain)}
    if value != plain and name.startswith("-") and not value.startswith("["):
        settings |= {"action": "append", "default": []}
    elif value != plain:
        settings["nargs"] = "?" if value.startswith("[") else "*"
    return settings | ({"required": True} if is_required else {})


def _role(value: str) -> str:
    if value.endswith(".svg"):
        return PICTURE
    if value.endswith(".json"):
        return MODEL
    return RESULT if value.endswith((".csv", ".c", ".fmu", ".html", ".sqlite")) else _ROLES.get(value, "")


def word_or_number(
    expected: str, *words: str, number: Callable[[str], float] = int, least: float = -float("inf")
) -> Callable[[str], Any]:
    """A reader of one of some words, or of a number that is not below `least`."""

    def read(text: str) -> Any:
        if text in words:
            return text
        try:
            value = number(text)
        except ValueError:
            value = None
        if value is None or value < least:  # nan is a number here, and refused where it is used
            raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")
        return value

    return read


def numbers(form: str, number: Callable[[str], float] = float) -> Callable[[str], Any]:
    """A reader of numbers with the signs between them that a form has, such as ``LOW,HIGH`` or ``NAME=LOW:HIGH``."""
    names, equals, values = form.rpartition("=")
    separator = ":" if ":" in values else ","

    def read(text: str) -> Any:
        name, _, rest = text.partition("=") if equals else ("", "", text)
        try:
            parts = tuple(map(number, rest.split(separator)))
        except ValueError:
            parts = ()
        if len(parts) != len(values.split(separator)):
            raise argparse.ArgumentTypeError(f"expected {form} with numbers, got {text!r}")
        content = parts[0] if len(parts) == 1 else parts
        return (name, content) if names else content

    return read


def positive(option: str, value: float) -> float:
    """The value of an option; ValueError unless it is positive and finite."""
    if not 0.0 < value < float("inf"):
        raise ValueError(f"{option} must be positive, got {value:g}")
    return value


def column(text: str) -> str | int:
    """A column by its name, or by its number from 0."""
    return int(text) if text.isascii() and text.isdigit() else text


def unit(text: str) -> tuple[str, str]:
    """Signal and unit, as in ``u=V``."""
    signal, equals, label = text.partition("=")
    if not equals or signal not in ("t", "u", "y"):
        raise argparse.ArgumentTypeError(f"expected t=, u= or y= and a unit, got {text!r}")
    return signal, label


class Place(NamedTuple):
    """A place in a record: the number of a sample from 0 if there is no unit, else a time."""

    value: float
    unit: str


def place(text: str) -> Place:
    """A place in a record, such as ``100`` or ``2.5s``."""
    number, unit = re.fullmatch(r"(.*?)([a-z]*)", text, re.DOTALL).groups()  # type: ignore[union-attr]
    try:
        if unit in _TIMES:
            return Place(float(number), unit)
        if not unit and int(number) >= 0:
            return Place(int(number), "")
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(
        f"expected the number of a sample from 0, or a time with its unit such as 2.5s or 300ms, got {text!r}"
    )


_TIMES = ("s", "ms", "us", "ns")


def named(form: str, read: Callable[[str], Any]) -> Callable[[str], tuple[str, Any]]:
    """A reader of a name and a value of some other reader, in a form such as ``NAME=COLUMN``."""

    def read_both(text: str) -> tuple[str, Any]:
        name, equals, value = text.partition("=")
        try:
            return name, read(value if equals and name else "")
        except ValueError:
            raise argparse.ArgumentTypeError(f"expected {form}, got {text!r}") from None

    return read_both


def _some_column(text: str) -> str | int:
    if not text:
        raise ValueError("no column")
    return column(text)


def sensor(text: str) -> tuple[str, str | int]:
    """A signal of a structure and its column, of the same name unless another one is given."""
    name, equals, key = text.partition("=")
    if not name or (equals and not key):
        raise argparse.ArgumentTypeError(f"expected SENSOR=COLUMN, or the name of both, got {text!r}")
    return name, column(key) if equals else name


def _channel_and_degree(text: str) -> tuple[str, int]:
    channel, _, degree = text.rpartition(":")
    if not channel:
        raise ValueError("no channel")
    return channel, int(degree)


def library(text: str) -> str | list[str]:
    """The name of a library, or its terms."""
    names = [name.strip() for name in text.split(",")]
    return names if len(names) > 1 or "'" in text else text


def platforms(text: str) -> tuple[str, ...]:
    """Names of platforms with commas between them, or the word none for no platform."""
    return () if text == "none" else tuple(name.strip() for name in text.split(","))


REAL = ("STEP", "TIME", "RMS", "PERCENT", "BOUND", "HERTZ", "HEIGHT", "VALUE", "SHARE", "LENGTH")
READERS: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(("N", "NUMBER", "DEGREE"), word_or_number("a whole number")),
    **dict.fromkeys(REAL, word_or_number("a number without a unit", number=float)),
    **{form: numbers(form) for form in ("LOW,HIGH", "FREQUENCY,DAMPING", "NAME=VALUE", "NAME=LOW:HIGH")},
    "PLACE": place,
    "COUNT": word_or_number("a number from 1 on", least=1),
    "SENSOR=COLUMN": sensor,
    "T,B,L,R": numbers("T,B,L,R", int),
    "PLATFORMS": platforms,
    "COLUMN": column,
    "CHANNEL=COLUMN": named("CHANNEL=COLUMN", _some_column),
    "NAME=CHANNEL:DEGREE": named("NAME=CHANNEL:DEGREE, such as gain=T:1", _channel_and_degree),
    "SIGNAL=UNIT": unit,
    "NAME|TERMS": library,
    "QUANTUM": word_or_number("a number or detect", "detect", number=float),
    "CYCLES": word_or_number("a number of cycles, at least 1; the table needs the file before --cycles", least=1),
    "loo|cycles|K": word_or_number("loo, cycles or a number of blocks", "loo", "cycles", least=0),
    "loo|K": word_or_number("loo or a number of blocks from 2 on", "loo", least=2),
    "x|y|DEGREES": word_or_number("x, y or an angle in degrees", "x", "y", number=float),
    "first|running|NUMBER": word_or_number("first, running or the number of a frame", "first", "running", least=0),
}
"""Readers of values by their names; other values are texts."""
