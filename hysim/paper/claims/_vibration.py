"""Claims of section 2.5: equation (4), its relation to Table 2, and its estimate (6)."""

from collections.abc import Mapping

from hysim.paper import printed
from hysim.paper.approximations import Approximation
from hysim.paper.claims._claim import Claim, decided, unseen
from hysim.paper.claims._hysteresis import SIMILAR_PERCENT, similar
from hysim.paper.claims.rounding import spread
from hysim.paper.equations import EQUATION_4
from hysim.paper.reidentification import Information, TimeUnit


def vibration_claims(eq6: Approximation, units: Mapping[str, TimeUnit], information: Information) -> tuple[Claim, ...]:
    """Claims of section 2.5 about (4) and (6); the units of time by their names."""
    return (
        _repeats_table2("eq4-per-sample", "sample", units),
        _repeats_table2("eq4-per-second", "second", units),
        *_beyond_table2(information),
        similar("eq6-similar-to-eq4", "Figure 10", eq6),
        *_estimate(eq6),
        unseen(
            "desired-frequency",
            "Abstract",
            "The dynamic model can vibrate at a desired frequency.",
            needs="which frequency was desired, and what was reached",
        ),
    )


def _repeats_table2(id: str, name: str, units: Mapping[str, TimeUnit]) -> Claim:
    unit = units[name]
    return decided(
        id,
        "Section 2.5, equation (4)",
        f"Equation (4), with time counted in one {name}, comes from Table 2.",
        holds=unit.fit_with_level >= SIMILAR_PERCENT,
        method="fit of (4) as printed to Table 2, initial state and level free, at least "
        f"{SIMILAR_PERCENT:g} %, which is what the paper says of a model that fits",
        recomputed=unit.fit_with_level,
        unit="%",
        note=f"From row to row its gain is {unit.sampled_gain:.4f} um/V at {unit.sampled_phase_degrees:.1f} degrees. "
        f"At Table 2's own mean level it fits {unit.fit_with_state:.0f} %, and from rest {unit.fit_at_rest:.0f} %.",
    )


def _beyond_table2(information: Information) -> tuple[Claim, ...]:
    swing = float(printed.HIGH_V) - float(printed.LOW_V)
    return (
        decided(
            "eq4-static-gain",
            "Section 2.5, equation (4)",
            "Equation (4) moves the way Table 2 does when the voltage stays.",
            holds=EQUATION_4.dc_gain * information.gain > 0.0,
            method=f"its displacement for a lasting {swing:g} V, which has to have the sign of Table 2's swing",
            printed=round(information.swing, 3),
            recomputed=EQUATION_4.dc_gain * swing,
            unit="um",
            note=f"Static gain {EQUATION_4.dc_gain:.4f} um/V; Table 2 has {information.gain:.4f} um/V, at one "
            "frequency only.",
        ),
        decided(
            "eq4-identifiable",
            "Section 2.5, equation (4)",
            "The coefficients of (4) follow from Table 2.",
            holds=information.n_determined >= information.n_coefficients,
            method="numbers that the voltage's spectrum determines, which have to be as many as the coefficients",
            recomputed=float(information.n_determined),
            note=f"Equation (4) has {information.n_coefficients} coefficients. A straight line without dynamics "
            f"fits Table 2 to {information.static_fit_percent:.2f} %.",
        ),
    )


def _estimate(eq6: Approximation) -> tuple[Claim, ...]:
    gains = (
        spread(lambda x: x[0] / x[1], [side[0][-1], side[1][-1]])
        for side in ((printed.NUM_6, printed.DEN_6), (printed.NUM_4, printed.DEN_4))
    )
    of_6, of_4 = gains
    damping = spread(lambda x: x[0] / (2.0 * x[1] ** 0.5), printed.DEN_6[1:])
    return (
        decided(
            "eq6-static-gain-of-eq4",
            "Section 2.5, equation (6)",
            "Equation (6) keeps the static gain of (4).",
            holds=of_6.agrees(of_4),
            method="ratio of the last coefficients of either, over the corners of their rounding",
            recomputed=float(of_6.value),
            unit="um/V",
            note=f"Equation (4) has {of_4.value:.5f} um/V.",
        ),
        decided(
            "eq6-vibrates",
            "Section 2.5, equations (5) and (6)",
            "Equation (6) is of the form (5), and vibrates.",
            holds=bool(damping.low > 0.0 and damping.high < 1.0),
            method="its damping ratio xi, which has to lie between 0 and 1",
            recomputed=float(damping.value),
            note=f"Natural frequency {eq6.simpler.natural_frequencies[0]:.4f} rad per unit of time.",
        ),
    )
