"""The report's chapter on the paper's claims: folded by verdict, what needs attention first."""

import re
from collections import Counter
from collections.abc import Sequence

from hysim.paper import markup
from hysim.paper.claims import VERDICTS, Claim

_MICRO = re.compile(r"\bum\b")
_MEANINGS = {
    "not found": "a controller was searched for, and none reaches the printed number; the conditions say where",
    "differs": "the printed number and the recomputed one have no value in common, or a stated criterion fails",
    "inconsistent in print": "two things that the paper prints about the same quantity contradict each other",
    "not checkable": "what would be needed is not in the paper",
    "reached": "the paper prints no gains; a controller of ours reaches the printed number, under its conditions",
    "agrees": "printed and recomputed have a value in common, once rounding is propagated, or the criterion holds",
}
_OPEN = ("not found",)


def counts(claims: Sequence[Claim]) -> str:
    """The number of claims with each verdict, in words."""
    numbers = Counter(claim.verdict for claim in claims)
    plural = {"agrees": "agree", "differs": "differ"}
    return ", ".join(f"{numbers[verdict]} {plural.get(verdict, verdict)}" for verdict in reversed(VERDICTS))


def claims_chapter(claims: Sequence[Claim]) -> str:
    """Every claim under its verdict, each group folded."""
    numbers = Counter(claim.verdict for claim in claims)
    return (
        markup.paragraph(
            "What the paper prints, what comes out when it is recomputed, and a verdict that the code reaches. A "
            "printed number stands for everything that rounds to it. Each verdict opens to its claims, in the order of "
            "the paper."
        )
        + markup.table(
            ["verdict", "claims", "meaning"],
            [[verdict, str(numbers[verdict]), _MEANINGS[verdict]] for verdict in VERDICTS],
            kind="words",
        )
        + "".join(
            markup.folded(
                f"{verdict}: {numbers[verdict]}",
                "".join(_claim(claim) for claim in claims if claim.verdict == verdict),
                is_open=verdict in _OPEN,
            )
            for verdict in VERDICTS
            if numbers[verdict]
        )
        + markup.paragraph(
            "Not judged: that without a controller (1) and (4) do not track a reference (sections 2.7.1, 2.7.2). "
            "The figures feed a reference in micrometres as volts, so that the static gain alone makes them miss it. "
            "And “the vibration was reduced to 97 %” is read as “by 97 %”.",
            "source",
        )
    )


def _claim(claim: Claim) -> str:
    """One claim as a block that needs no width."""
    unit = f" {claim.unit}" if claim.unit else ""
    printed, recomputed = ("–" if x is None else _value(x) + unit for x in (claim.printed, claim.recomputed))
    facts = {"printed": printed, "recomputed": recomputed}
    method = "" if claim.recomputed is None else f"{claim.method[:1].upper()}{claim.method[1:]}."
    lines = [
        ("verdict " + claim.verdict.replace(" ", "-"), claim.verdict),
        ("where", claim.where),
        ("statement", claim.statement),
        ("facts", " · ".join(f"{name} {value}" for name, value in facts.items() if value != "–")),
        ("note", f"{method} {claim.note}".strip()),
        ("note", f"Conditions: {claim.conditions}." if claim.recomputed is not None else f"{claim.conditions}."),
    ]
    return markup.block("claim", f"claim-{claim.id}", [(kind, _MICRO.sub("µm", text)) for kind, text in lines])


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
