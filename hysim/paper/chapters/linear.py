"""The report's sections on equations (1) and (4) identified anew, and on loop width against dwell."""

import math
from collections.abc import Sequence

from hysim.paper import markup
from hysim.paper.dwell import DwellWidth
from hysim.paper.equations import EQUATION_4, EQUATION_6
from hysim.paper.reidentification import Reidentification
from hysim.plants.transfer_function import TransferFunction


def identification_section(found: Reidentification, drawn: markup.Drawn) -> str:
    """(1) and (4) identified anew, and the unit of time of (4)."""
    best, information = found.time_units[0], found.information
    return (
        markup.heading("Identified anew")
        + markup.paragraph(
            "The paper prints neither the hold nor the sampling that its tool assumed. Four poles and one zero on "
            "Table 1, one second for each voltage, under the usual choices:"
        )
        + _refits(found)
        + markup.paragraph("The printed Equation (1) at the dwell that suits it best under each:")
        + markup.table(
            ["output taken at", "initial state", "best dwell [s]", "fit [%]"],
            [
                [f"{fit.sample} of the hold", fit.initial, f"{fit.dwell:.2f}", f"{fit.fit_percent:.2f}"]
                for fit in found.printed
            ],
        )
        + markup.paragraph(
            f"Equation (4) comes from Table 2, {information.n_samples} rows of a square wave with a period of "
            f"{information.period} samples. Read with different units of time it repeats the table, its initial "
            "state and level free, to:"
        )
        + _time_units(found)
        + markup.paragraph(
            f"The unit is the {best.name}: there its gain at the square wave's frequency is {best.sampled_gain:.4f} "
            f"µm/V, and the measured one {information.gain:.4f}. So its natural frequency is a number per sample of "
            f"0.246 s, and its static gain, with the other sign, is an extrapolation: the table holds "
            f"{information.n_determined} numbers about a plant, (4) has {information.n_coefficients} coefficients. "
            f"All displacements are whole multiples of {information.quantum:.4f} µm, and the whole swing, "
            f"{information.swing:.3f} µm, is one of them."
        )
        + markup.figure(
            drawn["figure9"],
            "The paper's Figure 9, regenerated: in words, the square wave and the vibration that it excites, against "
            "time. Ours shows the ten rows of Table 2, four samples a period: each displacement follows its voltage "
            "within the row, and nothing rings.",
        )
        + markup.figure(
            drawn["figure10"],
            "The paper's Figure 10, regenerated: in words, the step responses of (4) and of its estimate (6), called "
            "similar. Ours shows the responses to a step of one volt: both go downwards, against Table 2, and their "
            f"periods, {_period(EQUATION_4):.1f} and {_period(EQUATION_6):.1f} samples, drift apart.",
        )
    )


def dwell_chapter(widths: Sequence[DwellWidth], drawn: markup.Drawn) -> str:
    """Lag closes, hysteresis stays."""
    slowest = widths[-1]
    return (
        markup.paragraph(
            "Table 1's staircase at different dwells, each displacement read at the end of its dwell. The width of "
            "(1) is lag: it closes when the voltage waits. The width of the Bouc-Wen law is memory: it does not know "
            "the dwell. With the dynamics of (7) behind it, the law's loop differs from the law alone only as long "
            "as the dynamics have not settled."
        )
        + markup.table(
            ["dwell [s]", "(1) [µm]", "(1), read at the start [µm]", "Bouc-Wen [µm]", "Bouc-Wen and (7) [µm]"],
            [
                [
                    f"{width.dwell:g}",
                    f"{width.linear:.4f}",
                    f"{width.linear_at_start:.4f}",
                    f"{width.law:.4f}",
                    f"{width.law_and_dynamics:.4f}",
                ]
                for width in widths
            ],
        )
        + markup.figure(drawn["dwell"], "Largest loop width against dwell, of the simulations in the table.")
        + markup.paragraph(
            "Read at the start of each dwell, as identification tools take it, every displacement belongs to the "
            f"voltage before. The loop of (1) then tends to {slowest.linear_at_start:.4f} µm, two steps of the "
            "staircase times the static gain, however long one waits: an artefact of the reading, and what lets a "
            "linear model fit Table 1 at all."
        )
    )


def _period(model: TransferFunction) -> float:
    """Period of the oscillation [unit of time]."""
    return 2.0 * math.pi / float(model.poles.imag.max())


def _refits(found: Reidentification) -> str:
    holds = {"zoh": "held", "foh": "linear"}
    rows = [
        [
            holds[fit.hold], f"{fit.sample} of the hold" if fit.hold == "zoh" else "the sample", fit.initial,
            str(fit.n_parameters), f"{fit.fit_percent:.2f}", f"{fit.fpe:.6f}",
        ]
        for fit in found.hysteresis
    ]  # fmt: skip
    header = ["input between samples", "output taken at", "initial state", "parameters", "fit [%]", "FPE [µm²]"]
    return markup.table(header, rows)


def _time_units(found: Reidentification) -> str:
    rows = [
        [
            unit.name, f"{unit.sample_time:.4g}", f"{unit.fit_with_level:.1f}", f"{unit.fit_at_rest:.1f}",
            f"{unit.sampled_gain:.4f}", f"{unit.sampled_phase_degrees:.1f}",
        ]
        for unit in found.time_units
    ]  # fmt: skip
    header = [
        "unit of time", "a sample is", "fit, state and level free [%]", "fit from rest [%]",
        "gain from sample to sample [µm/V]", "phase [°]",
    ]  # fmt: skip
    return markup.table(header, rows)
