"""Formulas as docstrings write them, such as ``y = offset + sum w_i z_i``, in the notation of TeX."""

import re

_SIGNS = r"sum|alpha|beta|gamma|delta|sigma|tau|rho|theta|omega"
_FUNCTIONS = r"sign|sgn|exp|min|max|law"
_FORMULA = re.compile(
    r"(?:`([^`]*[^\w`][^`]*)`|(?<![\w`])([a-z]_[a-z])(?![\w`]))([.,:;]?)"
)
_RULES = (
    (r"\bsqrt\(([^()]*)\)", r"\\sqrt{\1}"),
    (r"_\(([^()]*)\)|_(\w+)", lambda of: f"_{{{of[1] or of[2]}}}"),
    (r"\^(\w+)", lambda of: f"^{{{of[1] if len(of[1]) == 1 else _word(of[1])}}}"),
    (r"(?<=[\w)}|']) (?=[\w(|])", r"\\,"),  # a product
    (r"(?<![\\{a-zA-Z])([a-zA-Z]{3,})(?![a-zA-Z])", lambda word: _word(word[1])),
    (r"\bd(?=[a-z]\b)", r"\\mathrm{d}"),
    (r"~", r"\\sim "),
    (r"^([+-]) ", r"\1\\;"),
)


def as_tex(text: str) -> str:
    """The text with each formula between dollars, in parts between which a line may end."""
    return _FORMULA.sub(lambda of: _in_parts(of[1] or of[2], of[3]), text)


def _in_parts(formula: str, stop: str) -> str:
    """The parts, the last one with the mark that follows it: else it might begin the next line.

    A part begins with a relation, which has its own room, or with a sum, or follows a comma.
    """
    sides = re.split(r" (?=[=~] )", formula)
    parts = [re.split(r" (?=[+-] )|(?<=,) ", side) for side in sides]
    parts[-1][-1] += stop and rf"\text{{{stop}}}"
    return "<wbr>".join(" ".join(f"${_tex(part)}$" for part in side) for side in parts)


def _tex(part: str) -> str:
    for pattern, replacement in _RULES:
        part = re.sub(pattern, replacement, part)
    return part.strip()


def _word(word: str) -> str:
    if re.fullmatch(_SIGNS, word):
        return f"\\{word} "
    kind = "operatorname" if re.fullmatch(_FUNCTIONS, word) else "mathrm"
    return rf"\{kind}{{{word}}}"
