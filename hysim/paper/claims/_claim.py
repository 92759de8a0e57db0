"""A claim, and the ways in which its verdict is computed.

    reproduced             the printed number and the recomputed one have a value in common, once the rounding of
                           the printed inputs is propagated; or a stated criterion holds
    not reproduced         they have none, or the criterion fails
    inconsistent in print  two things that the paper prints about the same quantity have no value in common
    not checkable          what would be needed is not in the paper

A claim is made by one of four functions here, which differ in how they judge.
"""

import math
from collections.abc import Collection
from typing import Any, Literal

from hysim._frozen import frozen
from hysim.paper.claims.rounding import Spread, stands_for

Verdict = Literal["reproduced", "not reproduced", "inconsistent in print", "not checkable"]

MATERIAL = frozenset({"text", "Table 1", "Table 2", "equations"})
"""Parts of the paper with numbers. Its figures are photographs, sketches and plots."""


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
        How it was recomputed, and what decides.
    verdict : {"reproduced", "not reproduced", "inconsistent in print", "not checkable"}
        Computed, see above.
    note : str
        What is to be said beside it; for a claim that cannot be checked, why.
    """

    id: str
    where: str
    statement: str
    printed: float | str | None
    recomputed: float | str | None
    unit: str
    method: str
    verdict: Verdict
    note: str = ""


def compared(
    id: str, where: str, statement: str, *, printed: Any, computed: Spread, method: str, unit: str = "", note: str = ""
) -> Claim:
    """A printed number, or several, against what comes out."""
    agrees = computed.agrees(stands_for(printed))
    return _of_numbers(id, where, statement, printed, computed, unit, method, note, _judged(agrees, "not reproduced"))


def cross_checked(
    id: str, where: str, statement: str, *, printed: Any, computed: Spread, method: str, unit: str = "", note: str = ""
) -> Claim:
    """A printed number, or several, against what other printed numbers say about it."""
    agrees = computed.agrees(stands_for(printed))
    verdict = _judged(agrees, "inconsistent in print")
    return _of_numbers(id, where, statement, printed, computed, unit, method, note, verdict)


def decided(
    id: str,
    where: str,
    statement: str,
    *,
    holds: bool,
    method: str,
    printed: float | str | None = None,
    recomputed: float | str | None = None,
    unit: str = "",
    note: str = "",
    otherwise: Verdict = "not reproduced",
) -> Claim:
    """A statement that a criterion decides, which `method` states."""
    return Claim(
        id=id,
        where=where,
        statement=statement,
        printed=printed,
        recomputed=recomputed,
        unit=unit,
        method=method,
        verdict=_judged(holds, otherwise),
        note=note,
    )


def unseen(
    id: str,
    where: str,
    statement: str,
    *,
    needs: str,
    material: Collection[str] = MATERIAL,
    printed: float | str | None = None,
    unit: str = "",
    note: str = "",
) -> Claim:
    """A statement that needs something which the paper does not give as numbers.

    Raises
    ------
    ValueError
        If the material holds it: then it has to be computed.
    """
    if needs in material:
        raise ValueError(f"{needs} is at hand: claim {id!r} has to be computed")
    return Claim(
        id=id,
        where=where,
        statement=statement,
        printed=printed,
        recomputed=None,
        unit=unit,
        method="none",
        verdict="not checkable",
        note=" ".join(part for part in (f"It would need {needs}: the paper does not give that.", note) if part),
    )


def shown(spread: Spread) -> float | str:
    """A number, or several as text."""
    return float(spread.value) if spread.value.ndim == 0 else _text(spread.value.tolist())


def _judged(agrees: bool, otherwise: Verdict) -> Verdict:
    return "reproduced" if agrees else otherwise


def _of_numbers(
    id: str,
    where: str,
    statement: str,
    printed: Any,
    computed: Spread,
    unit: str,
    method: str,
    note: str,
    verdict: Verdict,
) -> Claim:
    return Claim(
        id=id,
        where=where,
        statement=statement,
        printed=float(printed) if isinstance(printed, str) else _text(printed),
        recomputed=shown(computed),
        unit=unit,
        method=method,
        verdict=verdict,
        note=" ".join(part for part in (note, _range(computed)) if part),
    )


def _range(computed: Spread) -> str:
    """The range that rounding leaves, of a single number."""
    if computed.value.ndim or math.isclose(computed.low, computed.high, rel_tol=1e-9):
        return ""
    return f"The rounding of the printed inputs leaves {computed.low:.5g} to {computed.high:.5g}."


def _text(values: Any) -> str:
    if isinstance(values, (list, tuple)):
        return "[" + ", ".join(_text(value) for value in values) + "]"
    return values if isinstance(values, str) else f"{values:.6g}"
