"""The paper's claims: a table of what it prints, and functions that compute what comes out.

`claims.toml` holds a row for each claim: section, printed number by its name in `hysim.paper.printed`, the function
that computes its value, and the rule that judges it (`hysim.paper.claims._judge`).
"""

from collections.abc import Collection

from hysim.paper.claims._evidence import Evidence as Evidence
from hysim.paper.claims._evidence import evidence as evidence
from hysim.paper.claims._judge import RULES as RULES
from hysim.paper.claims._judge import VERDICTS as VERDICTS
from hysim.paper.claims._judge import Claim as Claim
from hysim.paper.claims._judge import Verdict as Verdict
from hysim.paper.claims._judge import judged, table
from hysim.paper.claims._loops import FUNCTIONS as _OF_LOOPS
from hysim.paper.claims._values import FUNCTIONS as _OF_TABLES

_FUNCTIONS = {**_OF_TABLES, **_OF_LOOPS}


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
    rows = (judged(entry, _FUNCTIONS, of) for id, entry in table().items() if only is None or id in only)
    return tuple(claim for claim in rows if claim is not None)
