"""The paper's claims: a table of what it prints, and one judge of what comes out.

`claims.toml` holds a row for each claim: section, statement, printed number by its name in `hysim.paper.printed`, the
function of `hysim.paper.claim_values` that computes ours, conditions, and the rule of the verdict:

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
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any, Literal, NamedTuple, get_args

from hysim._basics.frozen import frozen
from hysim.datasets import table1, table2
from hysim.paper import printed
from hysim.paper.claim_values import FUNCTIONS, Evidence, Loop, Value
from hysim.paper.equations import approximations
from hysim.paper.reidentification import Reidentification
from hysim.paper.rounding import Spread, stands_for
from hysim.paper.study import Study

Verdict = Literal["not found", "differs", "inconsistent in print", "not checkable", "reached", "agrees"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
"""In the order of the report: what needs attention first."""

RULES: Mapping[str, tuple[Verdict, Verdict]] = {
    "agree": ("agrees", "differs"),
    "consistent": ("agrees", "inconsistent in print"),
    "hold": ("agrees", "differs"),
    "hold in print": ("agrees", "inconsistent in print"),
    "reach": ("reached", "not found"),
}


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
    verdict : {"not found", "differs", "inconsistent in print", "not checkable", "reached", "agrees"}
        Computed by the claim's rule.
    method : str
        What is computed, and what decides.
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
    verdict: Verdict
    method: str
    conditions: str
    note: str = ""


class Entry(NamedTuple):
    """A row of the table."""

    id: str
    where: str
    statement: str
    rule: str
    value: Sequence[Any] = ()
    printed: str = ""
    unit: str = ""
    method: str = "nothing"
    needs: str = ""
    conditions: str = "the printed numbers and their rounding"
    note: str = ""


def evidence(
    study: Study, reidentification: Reidentification, control: Mapping[str, Sequence[Loop]] | None = None
) -> Evidence:
    """The evidence of a study of Table 1; without closed loops, claims about them are not judged."""
    return Evidence(
        table1=table1(),
        table2=table2(),
        study=study,
        reidentification=reidentification,
        approximations={pair.name: pair for pair in approximations()},
        control=control or {},
    )


def claims(of: Evidence, only: Collection[str] | None = None) -> tuple[Claim, ...]:
    """Every claim in the order of the paper.

    Parameters
    ----------
    of : Evidence
        From `evidence`. Claims about loops that it does not hold are left out.
    only : collection of str, optional
        Ids of the claims wanted.

    Returns
    -------
    tuple of Claim
        With different ids.
    """
    rows = (judged(entry, FUNCTIONS, of) for id, entry in table().items() if only is None or id in only)
    return tuple(claim for claim in rows if claim is not None)


@cache
def table() -> Mapping[str, Entry]:
    """Every row of `claims.toml` by its id, in the order of the paper."""
    rows = tomllib.loads(files("hysim.paper").joinpath("claims.toml").read_text(encoding="utf-8"))
    return {id: Entry(id, **row) for id, row in rows.items()}


def judged(entry: Entry, functions: Mapping[str, Callable[..., Value | None]], evidence: Evidence) -> Claim | None:
    """A row's claim with its verdict; None if the evidence holds nothing about it."""
    text, verdict = _printed(entry.printed), RULES.get(entry.rule)
    result: Value | None = None
    if verdict is not None:
        name, *arguments = entry.value
        result = functions[name](evidence, *arguments)
        if result is None:
            return None
        text = text if result.printed is None else result.printed
        holds = result.holds
        if holds is None:
            computed = result.value if isinstance(result.value, Spread) else stands_for(result.value)
            holds = computed.agrees(stands_for(_exact_units(text)))
    facts = {} if result is None else result.facts
    needs = f"needs {entry.needs}: the paper does not give that"
    notes = [entry.note.format_map(facts), "" if result is None else _range(result.value)]
    return Claim(
        id=entry.id,
        where=entry.where,
        statement=entry.statement,
        printed=_shown(text),
        recomputed=None if result is None else _shown(result.value),
        unit=entry.unit,
        method=entry.method.format_map(facts),
        verdict="not checkable" if verdict is None else verdict[not holds],
        conditions=needs if result is None else entry.conditions.format_map(facts),
        note=" ".join(note for note in notes if note),
    )


def _printed(path: str) -> Any:
    """A printed text by its name in `hysim.paper.printed`, followed by the places in its rows: ``"A_13.0.1"``."""
    if not path:
        return None
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


def _shown(value: Any) -> float | str | None:
    """A number, or several as text."""
    if isinstance(value, Spread):
        value = value.value.tolist()
    if isinstance(value, (list, tuple)):
        return as_text(value)
    try:
        return None if value is None else float(value)
    except ValueError:
        return str(value)


def as_text(values: Any) -> str:
    """A value, or nested ones, in six digits."""
    if isinstance(values, (list, tuple)):
        return "[" + ", ".join(as_text(value) for value in values) + "]"
    return values if isinstance(values, str) else f"{values:.6g}"


def _range(computed: Any) -> str:
    """The range that rounding leaves, of a single number."""
    if isinstance(computed, Spread) and not computed.value.ndim:
        low, high = float(computed.low), float(computed.high)
        if not math.isclose(low, high, rel_tol=1e-9):
            return f"The rounding of the printed inputs leaves {low:.5g} to {high:.5g}."
    return ""
