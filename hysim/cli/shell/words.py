"""Messages of the library in the words of the shell: ``--encoding latin-1`` for ``encoding="latin-1"``.

A message names an argument of a verb by ``name=``, with or without a value, or begins with its name. The option of a
command that stands for it has the same name, or one in `OTHER_NAMES`; for an argument that the command lacks it is the
option of another command, one `OF_OTHER_COMMANDS`. What no option stands for is left as it is, and so are the calls in
a message, such as ``BoucWen(n=1.0)``.
"""

import re
import shlex
from collections.abc import Iterable, Mapping

from hysim._names import nearest

OTHER_NAMES = {
    "acceleration": "u", "channels": "channel", "elements": "plays", "fixed": "fix", "priors": "prior",
    "units": "unit",
}  # fmt: skip
"""Arguments whose option has another name, and that name."""

OF_OTHER_COMMANDS = {
    name: f"hysim identify {option}"
    for name, option in {
        "admissible": "--admissible", "bounds": "--bounds", "channels": "--channel",
        "cross_validate": "--cross-validate", "fixed": "--fix",
        "free": "--free", "initial": "--initial", "max_evaluations": "--max-evaluations", "weights": "--weights",
        "excitation": "--excitation", "resolution": "--resolution", "t": "--t",
    }.items()
} | {"priors": "hysim posterior --prior"}  # fmt: skip
"""Arguments that a message names to readers of a command without such an option, and the option that stands for it."""

_PHRASES = (
    (', on_missing="split" cuts the record there', ""),
    ("hysim.loop_metrics(tolerance=...)", "hysim metrics --tolerance"),
    ("hysim.cycle_metrics", "hysim metrics --cycles"),
    (": read it with hs.load_model", ", which hysim simulate, control, page and c take, and hysim compare --model"),
    ("; if it is a record: read it with hs.load", "; hysim identify --out makes a model of a record"),
    ("Record(resolution=...)", "resolution="),
    ("BoucWenOscillator.structure(initial=...)", "initial="),
    ('structure(excitation="force")', 'excitation="force"'),
    ("structure(levels=...)", "a model in a file"),
    ("hs.discover_oscillator(record)", "hysim discover --route oscillator"),
    ("hs.discover_oscillator", "hysim discover --route oscillator"),
    ("hs.PrandtlIshlinskii or hs.Preisach", "prandtl-ishlinskii or preisach"),
    ("Take hs.PrandtlIshlinskii", "Take prandtl-ishlinskii"),
    ("hysim.to_c and hysim.to_fmu", "hysim c and hysim fmu"),
    (", names as in Structure.scalars", ""),
)
_BOUNDS = re.compile(r"bounds of '([^']+)' must be \(lower, upper\) with lower < upper, got \(([^,]+), ([^)]+)\)")
_RESAMPLED = re.compile(r"hs\.load\(\.\.\.\)\.resample\(([^)]*)\)")
_CALL = re.compile(r"\b[A-Za-z_]\w*\((?:[^()]|\([^()]*\))*\)")
_VALUE = r"""(?:("[^"]*"|'[^']*'|\[[^\]]*\]|\{[^}]*\}|False|True|-?\d(?:[\w.+-]*\w)?)|(?!\w))"""
_SAID = {"True": "yes", "False": "no"}
_ITEM = re.compile(r"""['"]([^'"]+)['"]""")
_PAIR = re.compile(r"""['"]?([\w.\[\]*]+)['"]?\s*:\s*(\([^)]*\)|[^,}]+)""")
_BEGIN = r"(?P<before>^(?:\S+: )?)(?P<name>{})(?= (?:must|is|are|has|takes|names|needs|cannot)\b)"


def in_shell_words(message: str, flags: Mapping[str, str]) -> str:
    """The message with options in place of arguments; `flags` are the options of a command by the names of values."""
    message = _RESAMPLED.sub(r"--t, --u and --sample-time \1", message)
    message = _BOUNDS.sub(r"--bounds \1=LOW:HIGH needs LOW below HIGH, got \2:\3", message)
    for phrase, words in _PHRASES:
        message = message.replace(phrase, words)
    options = {**flags, **{name: flags[other] for name, other in OTHER_NAMES.items() if other in flags}}
    parts = enumerate(_split(message))
    return "".join(part if _CALL.fullmatch(part) else _translated(part, options, k == 0) for k, part in parts)


def _split(message: str) -> list[str]:
    """The message in parts, each a call or what is between two of them."""
    ends = [place for call in _CALL.finditer(message) for place in call.span()]
    return [message[a:b] for a, b in zip([0, *ends], [*ends, len(message)], strict=True)]


def _translated(text: str, options: Mapping[str, str], is_first: bool) -> str:
    names = "|".join(sorted(map(re.escape, options), key=len, reverse=True))
    if not names:
        return text
    known = {**OF_OTHER_COMMANDS, **options}
    assigned = re.compile(rf"(?<![\w.\"'-])({'|'.join(sorted(map(re.escape, known), key=len, reverse=True))})={_VALUE}")
    text = assigned.sub(lambda match: _option(match, known[match[1]]), text)
    if is_first:
        long = "|".join(name for name in options if len(name) > 1) or "-"
        text = re.sub(_BEGIN.format(long), lambda match: match["before"] + options[match["name"]], text)
    compound = "|".join(name for name in options if "_" in name)
    text, are, listed = text.partition(" are: ")  # names in a list, such as columns of a file, are no arguments
    if compound:
        text = re.sub(rf"(?<![\w.\"'-])({compound})\b(?!=)", lambda match: options[match[1]], text)
    return text + are + listed


def _option(argument: re.Match[str], flag: str) -> str:
    """The option with its value, as it is typed; a signal with a value is no argument, but as in ``--unit u=V``."""
    name, value = argument.groups()
    if len(name) == 1 and value is not None:
        return flag.replace("--t", "--no-t") if (name, value) == ("t", "False") else argument[0]
    prefix = {"units": "u=", "channels": "CHANNEL="}.get(name, "")
    if value is None:
        return f"{flag} {prefix}{'UNIT' if name == 'units' else 'COLUMN'}" if prefix else flag
    if value.startswith("["):
        return " ".join(f"{flag} {_typed(item)}" for item in _ITEM.findall(value)) + " ..." * ("..." in value)
    if value.startswith("{"):
        pairs = [f"{key}={_bounds(content)}" for key, content in _PAIR.findall(value)]
        return " ".join(f"{flag} {_typed(pair)}" for pair in pairs)
    value = _SAID.get(value, value)
    return f"{flag} {_typed(prefix + value.strip(chr(34) + chr(39)))}"


def _bounds(content: str) -> str:
    """``low:high`` for a pair in parentheses, and the content itself for any other; dots are a column's name."""
    content = content.strip()
    if content.startswith("("):
        return ":".join(part.strip().upper() for part in content[1:-1].split(","))
    return "COLUMN" if content == "..." else content


def _typed(word: str) -> str:
    """The word with quotes where a shell needs them."""
    return word if re.fullmatch(r"[\w@%+=:,./*\[\]^-]+", word) else shlex.quote(word)


def suggestion(word: str, known: Iterable[str]) -> str:
    """``did you mean NAME?`` for the nearest of some names, an empty text if none is near."""
    near = nearest(word.partition("=")[0], known)
    return "" if near is None else f"did you mean {near}?"
