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


def flag(name: str) -> str:
    """The option for an argument, such as ``--sample-time``."""
    return f"--{OTHER_NAMES.get(name, name).rstrip('_').replace('_', '-')}"


_OF_IDENTIFY = (
    "bounds", "cross_validate", "free", "initial", "max_evaluations", "weights", "excitation", "resolution", "t",
    "admissible", "channels", "fixed",
)  # fmt: skip
OF_OTHER_COMMANDS = {name: f"hysim identify {flag(name)}" for name in _OF_IDENTIFY} | {
    "priors": "hysim posterior --prior"
}
"""Arguments that a message names to readers of a command without such an option, and the option that stands for it."""

_PHRASES = {
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
    texts = _CALL.split(message)  # every other one is a call
    texts[::2] = [
        re.sub(rf"(?<![\w.\"'-])({_any(known)})={_VALUE}", lambda match: _option(match, known[match[1]]), text)
        for text in texts[::2]
    ]
    long = _any(name for name in options if len(name) > 1)
    texts[0] = re.sub(rf"(^(?:\S+: )?)({long}){_VERB}", lambda match: match[1] + options[match[2]], texts[0])
    for k, text in enumerate(texts):
        if k % 2 == 0:  # names in a list, such as columns of a file, are no arguments
            text, are, listed = text.partition(" are: ")
            compound = _any(name for name in options if "_" in name)
            text = re.sub(rf"(?<![\w.\"'-])({compound})\b(?!=)", lambda match: options[match[1]], text)
            texts[k] = text + are + listed
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


def suggestion(word: str, known: Iterable[str]) -> str:
    """``did you mean NAME?`` for the nearest of some names, an empty text if no name is similar."""
    near = nearest(word.partition("=")[0], known)
    return "" if near is None else f"did you mean {near}?"
