"""The report's chapter on the paper's claims, one after the other."""

import re
from collections import Counter
from collections.abc import Sequence

from hysim.paper import markup
from hysim.paper.claims import VERDICTS, Claim

_MICRO = re.compile(r"\bum\b")


def claims_chapter(claims: Sequence[Claim]) -> str:
    """Every claim in the order of the paper, and how many have each verdict."""
    counts = Counter(claim.verdict for claim in claims)
    meanings = {
        "reproduced": "the printed number and the recomputed one have a value in common, once the rounding of the "
        "printed inputs is propagated, or the stated criterion holds",
        "not reproduced": "they have none, or it fails",
        "inconsistent in print": "two things that the paper prints about the same quantity contradict each other",
        "not checkable": "what would be needed is not in the paper",
    }
    return (
        markup.paragraph(
            "Line by line in the order of the paper: what it prints, what comes out when it is recomputed, and a "
            "verdict that the code reaches. A printed number stands for everything that rounds to it."
        )
        + markup.table(
            ["verdict", "claims", "meaning"],
            [[verdict, str(counts[verdict]), meanings[verdict]] for verdict in VERDICTS],
            kind="words",
        )
        + "".join(_claim(claim) for claim in claims)
    )


def _claim(claim: Claim) -> str:
    """One claim as a block that needs no width."""
    unit = f" {claim.unit}" if claim.unit else ""
    printed, recomputed = ("–" if x is None else _value(x) + unit for x in (claim.printed, claim.recomputed))
    method = "" if claim.method == "none" else f"{claim.method[:1].upper()}{claim.method[1:]}."
    facts = {"printed": printed, "recomputed": recomputed}
    lines = [
        ("verdict " + claim.verdict.replace(" ", "-"), claim.verdict),
        ("where", claim.where),
        ("statement", claim.statement),
        ("facts", " · ".join(f"{name} {value}" for name, value in facts.items() if value != "–")),
        ("note", f"{method} {claim.note}".strip()),
    ]
    return markup.block("claim", f"claim-{claim.id}", [(kind, _MICRO.sub("µm", text)) for kind, text in lines])


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
