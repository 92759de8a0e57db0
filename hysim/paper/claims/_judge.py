"""The table of claims, and the rules that turn a value into a verdict.

    rule              verdict, if it holds   otherwise               decided by
    agree             agrees                 differs                 printed and computed have a value in common
    consistent        agrees                 inconsistent in print   the same, of two printed numbers
    hold              agrees                 differs                 a criterion
    hold in print     agrees                 inconsistent in print   a criterion on printed things alone
    reach             reached                not found               a controller that we look for
    missing           not checkable                                  nothing: what it needs is not in the paper

A printed number stands for everything that rounds to it, and the rounding of the printed inputs is propagated.
"""

import math
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal, NamedTuple

from hysim._frozen import frozen
from hysim.paper import printed
from hysim.paper.claims._evidence import Evidence
from hysim.paper.claims.rounding import Spread, stands_for

Verdict = Literal["not found", "differs", "inconsistent in print", "not checkable", "reached", "agrees"]
VERDICTS: tuple[Verdict, ...] = (
    "not found", "differs", "inconsistent in print", "not checkable", "reached", "agrees",
)  # fmt: skip
"""In the order of the report: what needs attention first."""

RULES: Mapping[str, tuple[Verdict, Verdict]] = {
    "agree": ("agrees", "differs"),
    "consistent": ("agrees", "inconsistent in print"),
    "hold": ("agrees", "differs"),
    "hold in print": ("agrees", "inconsistent in print"),
    "reach": ("reached", "not found"),
}
_CONDITIONS = "the printed numbers and their rounding"


@frozen
class Claim:
    """One statement of the paper, recomputed.

    Parameters
    ----------
    id : str
        Short name.
    where : str
        Section, table, equation or figure that prints it.
    statement : str
        What is claimed, in our words.
    printed, recomputed : float, str or None
        The number, or a few words or numbers; None where there is none.
    unit : str
        Of both; empty for none.
    method : str
        What is computed, and what decides.
    verdict : {"not found", "differs", "inconsistent in print", "not checkable", "reached", "agrees"}
        Computed by the claim's rule.
    conditions : str
        Under which the verdict holds: choices of ours, a controller and its loop, or what was searched.
    note : str
        A remark.
    """

    id: str
    where: str
    statement: str
    printed: float | str | None
    recomputed: float | str | None
    unit: str
    method: str
    verdict: Verdict
    conditions: str
    note: str = ""


class Value(NamedTuple):
    """Result of a claim's function.

    Parameters
    ----------
    value : Spread, float or str
        What comes out.
    holds : bool, optional
        Whether the criterion is met; None where the printed number decides.
    facts : mapping
        Names to what stands for them in the claim's texts.
    printed : float or str, optional
        In place of a number of `hysim.paper.printed`.
    """

    value: Spread | float | str
    holds: bool | None = None
    facts: Mapping[str, Any] = {}
    printed: float | str | None = None


class Entry(NamedTuple):
    """A row of the table."""

    id: str
    where: str
    statement: str
    rule: str
    value: tuple[Any, ...] = ()
    printed: str = ""
    unit: str = ""
    method: str = ""
    needs: str = ""
    conditions: str = ""
    note: str = ""


@cache
def table() -> Mapping[str, Entry]:
    """Every row of `claims.toml` by its id, in the order of the paper."""
    rows = tomllib.loads(files("hysim.paper.claims").joinpath("claims.toml").read_text(encoding="utf-8"))
    return {id: Entry(id, **{**row, "value": tuple(row.get("value", ()))}) for id, row in rows.items()}


def judged(entry: Entry, functions: Mapping[str, Callable[..., Value | None]], evidence: Evidence) -> Claim | None:
    """A row's claim; None if the evidence holds nothing about it."""
    text = _printed(entry.printed) if entry.printed else None
    if entry.rule == "missing":
        return _claim(entry, text, None, "not checkable", {}, f"needs {entry.needs}: the paper does not give that")
    name, *arguments = entry.value
    result = functions[name](evidence, *arguments)
    if result is None:
        return None
    text = text if result.printed is None else result.printed
    holds = result.holds
    if holds is None:
        computed = result.value if isinstance(result.value, Spread) else stands_for(result.value)
        holds = computed.agrees(stands_for(_exact_units(text)))
    return _claim(entry, text, result, RULES[entry.rule][not holds], result.facts, _CONDITIONS)


def _claim(
    entry: Entry, text: Any, result: Value | None, verdict: Verdict, facts: Mapping[str, Any], conditions: str
) -> Claim:
    value = None if result is None else result.value
    notes = [entry.note.format_map(facts), _range(value) if isinstance(value, Spread) else ""]
    return Claim(
        id=entry.id,
        where=entry.where,
        statement=entry.statement,
        printed=None if text is None else _shown(text),
        recomputed=None if value is None else _shown(value),
        unit=entry.unit,
        method=entry.method.format_map(facts) or "nothing",
        verdict=verdict,
        conditions=entry.conditions.format_map(facts) or conditions,
        note=" ".join(note for note in notes if note),
    )


def _printed(path: str) -> Any:
    """A printed text by its name in `hysim.paper.printed`, followed by the places in its rows: ``"A_13.0.1"``."""
    name, *places = path.split(".")
    text = vars(printed)[name]
    for place in places:
        text = text[int(place)]
    return text


def _exact_units(text: Any) -> Any:
    """Zeros and ones in a matrix are its structure, not rounded numbers."""
    if isinstance(text, (list, tuple)):
        return [float(item) if item in ("0", "1") else _exact_units(item) for item in text]
    return text


def _shown(value: Any) -> float | str:
    """A number, or several as text."""
    if isinstance(value, Spread):
        value = value.value.tolist()
    if isinstance(value, str):
        return float(value) if _is_number(value) else value
    return _text(value) if isinstance(value, (list, tuple)) else float(value)


def _text(values: Any) -> str:
    if isinstance(values, (list, tuple)):
        return "[" + ", ".join(_text(value) for value in values) + "]"
    return values if isinstance(values, str) else f"{values:.6g}"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _range(computed: Spread) -> str:
    """The range that rounding leaves, of a single number."""
    if computed.value.ndim or math.isclose(computed.low, computed.high, rel_tol=1e-9):
        return ""
    return f"The rounding of the printed inputs leaves {computed.low:.5g} to {computed.high:.5g}."
