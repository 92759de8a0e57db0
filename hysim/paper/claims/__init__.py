"""The paper's claims, each with what it prints, what comes out, and a verdict that the code reaches.

Printed numbers are kept as text, so that half a unit of their last digit is known; that rounding is propagated
through what is recomputed from them (`hysim.paper.claims.rounding`). One file a section of the paper.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from hysim.datasets import table2
from hysim.paper.approximations import approximations
from hysim.paper.claims._claim import Claim, Verdict
from hysim.paper.claims._controller import controller_claims
from hysim.paper.claims._experiment import experiment_claims
from hysim.paper.claims._headline import MAX_SENSITIVITY, headline_claims
from hysim.paper.claims._hysteresis import hysteresis_claims
from hysim.paper.claims._introduction import introduction
from hysim.paper.claims._state_space import state_space_claims
from hysim.paper.claims._table1 import table1_claims
from hysim.paper.claims._vibration import vibration_claims
from hysim.paper.reidentification import information, time_units
from hysim.paper.study import Study

__all__ = ["MAX_SENSITIVITY", "VERDICTS", "Claim", "Verdict", "claims"]

VERDICTS: tuple[Verdict, ...] = ("reproduced", "not reproduced", "inconsistent in print", "not checkable")


def claims(study: Study, control: Mapping[str, Sequence[Mapping[str, Any]]] | None = None) -> tuple[Claim, ...]:
    """Every claim in the order of the paper.

    Parameters
    ----------
    study : Study
        The models of Table 1.
    control : mapping, optional
        "hysteresis" and "vibration" to closed loops, each a mapping with "plant" ("bouc-wen+eq7" or "eq1"; "eq4"
        or "eq6") and its measures ("hysteresis_reduction_percent" or "lag_reduction_percent";
        "overshoot_reduction_percent", "residual_rms_reduction_percent", "settling_time_reduction_percent") [%].
        Without it the headline claims are left out.

    Returns
    -------
    tuple of Claim
        With different ids.
    """
    eq7, eq6 = approximations()
    table2_information = information()
    return (
        *introduction(),
        *table1_claims(study.comparison.record, study.comparison.loop),
        *hysteresis_claims(study, eq7),
        *experiment_claims(table2(), table2_information),
        *vibration_claims(eq6, {unit.name: unit for unit in time_units()}, table2_information),
        *state_space_claims(),
        *controller_claims(),
        *(headline_claims(control) if control is not None else ()),
    )
