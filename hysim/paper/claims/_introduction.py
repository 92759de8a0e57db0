"""Claims of the introduction and of the list of references."""

from hysim.paper import printed
from hysim.paper.claims._claim import Claim, cross_checked, unseen
from hysim.paper.claims.rounding import exactly


def introduction() -> tuple[Claim, ...]:
    """Claims about the literature that the paper cites."""
    return (
        unseen(
            "cited-vibration-33",
            "Section 1",
            "Fuzzy control of a flexible linkage with piezoelectric actuators held back about 33 % of its vibration.",
            needs="the measurements of its reference [6]",
            printed=33.0,
            unit="%",
        ),
        cross_checked(
            "last-reference",
            "Section 1 and References",
            "The highest number that the text cites is the last one of the list.",
            printed=printed.LAST_CITED,
            computed=exactly(float(printed.LAST_LISTED)),
            method="the highest number cited in the text against the last of the list",
            note="One entry of the list, after its number 12, has lost its number.",
        ),
        cross_checked(
            "bat-search-reference",
            "Section 1 and References",
            "The BAT search algorithm has the number in the list by which the text cites it.",
            printed=printed.BAT_SEARCH_CITED,
            computed=exactly(float(printed.BAT_SEARCH_LISTED)),
            method="the number cited in the text against the number in the list",
            note="From number 13 on the list is one behind the text.",
        ),
    )
