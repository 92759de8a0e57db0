"""Warnings about a discovered law that follow from its judgement."""

import math

from hysim.discovery._held_out import CURVE, LAW, PLAYS, RELAXATIONS, RIVAL
from hysim.discovery._judgement import BETTER, HYSTERESIS, NO_STRUCTURE, Judgement
from hysim.discovery._rates import SEVERAL


def doubts(judgement: Judgement) -> tuple[str, ...]:
    """Reasons to doubt a law, one sentence each, for `Discovery.warnings`."""
    errors = judgement.held_out
    law, plays, curve = errors[LAW], errors[PLAYS], errors[CURVE]
    linear = min((errors[name] for name in (RIVAL, RELAXATIONS) if not math.isnan(errors[name])), default=math.inf)
    found = []
    if not judgement.stable:
        found.append(
            "The law diverges in free run, on the records or on steady cycles over their range: do not simulate "
            "with it."
        )
    if linear < BETTER * law:
        found.append(
            f"A linear dynamic model predicts held-out samples better than the law (rmse {linear:.3g} against "
            f"{law:.3g})."
        )
    if judgement.verdict == HYSTERESIS and plays < BETTER * law:
        found.append(
            f"The law describes the hysteresis only in part: its rmse on held-out samples is {law:.3g}, that of a "
            f"superposition of plays {plays:.3g}. Identify hs.PrandtlIshlinskii or hs.Preisach too."
        )
    if judgement.verdict == NO_STRUCTURE and judgement.stable:
        found.append(_no_structure(judgement, min(law, plays), linear, curve))
    return tuple(found)


def _no_structure(judgement: Judgement, turning: float, linear: float, curve: float) -> str:
    alike = min(turning, linear) >= BETTER * curve or (linear >= BETTER * curve and CURVE in judgement.explained_by)
    if alike or not judgement.rate_spread >= SEVERAL:
        return (
            f"A single-valued curve of the input predicts held-out samples as well as a model with memory (rmse "
            f"{curve:.3g} against {min(turning, linear):.3g}): the records show no loop that is wider than their noise."
        )
    if set(judgement.explained_by) <= {CURVE}:
        return (
            "No model predicts held-out samples well: the memory may be hysteresis followed by a lag, or a lag "
            "behind a curve. Identify the law and the dynamics together, for instance as hs.Actuator."
        )
    return (
        f"Models that know time and models that do not predict held-out samples about equally well (rmse {linear:.3g} "
        f"and {turning:.3g}): noise hides what the rates could tell. Record more cycles, or rates further "
        "apart, with less noise."
    )
