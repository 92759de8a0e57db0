"""Claims of section 2.3: equation (1), its fit to Table 1, and its estimate (7)."""

import numpy as np

from hysim._frozen import FloatArray
from hysim.metrics import fit_percent, fpe, loop_metrics
from hysim.paper import printed
from hysim.paper.approximations import Approximation
from hysim.paper.claims._claim import Claim, compared, cross_checked, decided
from hysim.paper.claims.rounding import Number, Spread, half_unit, spread
from hysim.paper.equations import EQUATION_1
from hysim.paper.reidentification import printed_choices
from hysim.paper.study import Study
from hysim.plants.transfer_function import TransferFunction

SIMILAR_PERCENT = float(printed.FIT_1)
"""Two responses are called similar where one fits the other as well as the paper asks of a model [%]."""

SLOW_DWELL = 50.0
"""Dwell at which a lag of seconds has died out, and hysteresis has not [s]."""

_MEASURED_DIGITS = 3  # Table 1 is in 0.001 um; trailing zeros are not printed


def hysteresis_claims(study: Study, eq7: Approximation) -> tuple[Claim, ...]:
    """Claims of section 2.3 about (1) and its estimate."""
    return (*_poles(), *_fit(study), *_fpe(study), *_memory(study), similar("eq7-similar-to-eq1", "Figure 5", eq7))


def similar(id: str, where: str, pair: Approximation) -> Claim:
    """That an estimated model is like the one that it stands for."""
    return decided(
        id,
        where,
        f"Equation {pair.name} has characteristics similar to those of {pair.of}.",
        holds=pair.fit_percent >= SIMILAR_PERCENT,
        method=f"fit of the step responses until both have settled, at least {SIMILAR_PERCENT:g} %, "
        "which is what the paper says of a model that fits",
        recomputed=pair.fit_percent,
        unit="%",
        note=f"Static gain {pair.simpler.dc_gain:.5f} against {pair.full.dc_gain:.5f} um/V, overshoot "
        f"{pair.simpler.overshoot_percent:.1f} against {pair.full.overshoot_percent:.1f} %, first peak at "
        f"{pair.simpler.peak_time:.2f} against {pair.full.peak_time:.2f}.",
    )


def _poles() -> tuple[Claim, ...]:
    def roots(coefficients: FloatArray) -> FloatArray:
        upper = [pole for pole in np.roots([1.0, *coefficients]) if pole.imag > 0.0]
        return np.array([[pole.real, pole.imag] for pole in sorted(upper, key=lambda pole: -pole.imag)])

    computed = spread(roots, printed.DEN_1[1:])
    return tuple(
        cross_checked(
            f"eq1-poles-{name}",
            "Section 2.3",
            f"The {name} pair of poles of (1), real and imaginary part.",
            printed=pair,
            computed=Spread(value=computed.value[k], low=computed.low[k], high=computed.high[k]),
            method="roots of the printed denominator over the corners of its rounding",
            unit="rad/s",
            note=f"The rounding of the coefficients leaves {computed.low[k, 0]:.5f} to {computed.high[k, 0]:.5f} and "
            f"{computed.low[k, 1]:.5f} to {computed.high[k, 1]:.5f}.",
        )
        for k, (name, pair) in enumerate(zip(("fast", "slow"), printed.POLES_1, strict=True))
    )


def _fit(study: Study) -> tuple[Claim, ...]:
    record, dwell = study.comparison.record, study.printed.dwell
    measured = _texts(record.y)

    def of_printed(x: FloatArray) -> float:
        model = TransferFunction(num=tuple(x[:2]), den=(1.0, *x[2:6]))
        return fit_percent(x[6:], model.response(record.u, dwell))

    identified = study.comparison["tf-identified"]
    most = max(choice.fit_percent for choice in printed_choices())
    return (
        compared(
            "eq1-fit-printed",
            "Section 2.3",
            "Equation (1) fits Table 1.",
            printed=printed.FIT_1,
            computed=spread(of_printed, [*printed.NUM_1, *printed.DEN_1[1:], *measured]),
            method="fit of (1) as printed: held voltage, displacement at the start of the hold, at rest before, "
            f"at the dwell that suits it best, {dwell:.2f} s",
            unit="%",
            note=f"With the initial state free, at the start or the end of the hold, at most {most:.2f} %.",
        ),
        compared(
            "eq1-fit-identified",
            "Section 2.3",
            "A transfer function of four poles and one zero, identified on Table 1, fits it.",
            printed=printed.FIT_1,
            computed=spread(lambda y: fit_percent(y, identified.y), measured),
            method="the same structure identified anew under the same hold and sampling",
            unit="%",
        ),
    )


def _fpe(study: Study) -> tuple[Claim, ...]:
    identified, d = study.comparison["tf-identified"], study.fits["tf-identified"].n_parameters
    measured = _texts(study.comparison.record.y)
    n = len(measured)

    def by_fit(x: FloatArray) -> float:
        return float(np.var(x[1:]) * (1.0 - x[0] / 100.0) ** 2 * (1.0 + 2.0 * d / n))

    return (
        compared(
            "eq1-fpe",
            "Section 2.3",
            "Final prediction error of the identified transfer function.",
            printed=printed.FPE_1,
            computed=spread(lambda y: fpe(y - identified.y, d), measured),
            method=f"V (1 + d/N) / (1 - d/N) of the structure identified anew, d = {d}, N = {n}",
            unit="um^2",
        ),
        compared(
            "eq1-fpe-first-order",
            "Section 2.3",
            "The same by the formula's first order.",
            printed=printed.FPE_1,
            computed=spread(lambda y: float(np.mean((y - identified.y) ** 2)) * (1.0 + 2.0 * d / n), measured),
            method=f"V (1 + 2 d/N) of the structure identified anew, d = {d}, N = {n}",
            unit="um^2",
        ),
        cross_checked(
            "eq1-fpe-and-fit",
            "Section 2.3",
            "Fit and final prediction error belong to one model.",
            printed=printed.FPE_1,
            computed=spread(by_fit, [printed.FIT_1, *measured]),
            method="V (1 + 2 d/N) with V from the printed fit and the variance of Table 1",
            unit="um^2",
        ),
    )


def _memory(study: Study) -> tuple[Claim, ...]:
    linear, static = study.comparison["eq1-printed"], study.comparison["single-valued"]
    record = study.comparison.record
    settled = TransferFunction(num=EQUATION_1.num, den=EQUATION_1.den, sample="end").response(record.u, SLOW_DWELL)
    width = loop_metrics(record.u, settled).max_width
    pixel = record.resolution or half_unit(printed.LAST_DIGIT_UM)
    return (
        decided(
            "eq1-represents-the-actuator",
            "Abstract",
            "The single transfer function represents the actuator's characteristics.",
            holds=linear.fit_percent > static.fit_percent,
            method="fit of (1) as printed, which has to exceed that of the best curve "
            "that gives one displacement for each voltage",
            recomputed=linear.fit_percent,
            unit="%",
            note=f"The best single-valued curve reaches {static.fit_percent:.2f} %, and the structure of (1) "
            f"identified anew {study.comparison['tf-identified'].fit_percent:.2f} %.",
        ),
        decided(
            "eq1-has-hysteresis",
            "Sections 2.3 and 2.7.1",
            "Equation (1) is a model of the hysteresis.",
            holds=width > pixel,
            method=f"largest width of its loop with {SLOW_DWELL:g} s for each voltage, read at the end of the dwell, "
            "which has to exceed one pixel: hysteresis does not depend on the dwell",
            recomputed=round(width, 9),
            unit="um",
            note="Its loop is lag: it closes when the voltage waits.",
        ),
    )


def _texts(displacements: FloatArray) -> list[Number]:
    return [f"{y:.{_MEASURED_DIGITS}f}" for y in displacements]
