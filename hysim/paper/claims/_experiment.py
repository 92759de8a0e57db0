"""Claims of section 2.4: the vibration experiment, its amplifier, Table 2."""

import numpy as np

from hysim.paper import printed
from hysim.paper.amplifier import UA741_SUPPLY_SPAN, full_power_bandwidth, resistor_ratio, voltage_gain
from hysim.paper.claims._claim import Claim, compared, cross_checked, decided, unseen
from hysim.paper.claims.rounding import exactly, half_unit, spread
from hysim.paper.reidentification import Information
from hysim.records import Record

INPUT, OUTPUT = float(printed.INPUT_V), float(printed.OUTPUT_V)
"""Set points of the amplifier [V]: exact, other than what was measured."""

_PER_US = 1e6


def experiment_claims(record: Record, information: Information) -> tuple[Claim, ...]:
    """Claims of section 2.4 about the experiment, the amplifier and Table 2."""
    return (*_amplifier(), *_bandwidth(), *_program(), *_table2(record, information), *_unseen())


def _amplifier() -> tuple[Claim, ...]:
    ratio = float(printed.RATIO)
    return (
        compared(
            "amplifier-ratio",
            "Section 2.4.1, equation (2)",
            "Rf/R2 that makes 50 V of 5 V.",
            printed=printed.RATIO,
            computed=exactly(resistor_ratio(OUTPUT, INPUT)),
            method="equation (2) solved for Rf/R2",
        ),
        cross_checked(
            "amplifier-output",
            "Section 2.4.1, equation (2)",
            "With that ratio, 5 V become 50 V.",
            printed=printed.OUTPUT_V,
            computed=exactly(INPUT * voltage_gain(ratio)),
            method="equation (2) with the printed ratio",
            unit="V",
        ),
        cross_checked(
            "amplifier-gain",
            "Section 2.4.1",
            "Rf/R2 is the gain of the amplifier.",
            printed=printed.RATIO,
            computed=exactly(OUTPUT / INPUT),
            method="V_out / V_in of the same section",
            note="The gain of a non-inverting amplifier is Rf/R2 + 1, as equation (2) says.",
        ),
        decided(
            "amplifier-resistors",
            "Figure 8 and section 2.4.1",
            "The resistors of the amplifier.",
            holds=printed.RESISTORS_IN_TEXT == printed.RESISTORS_IN_FIGURE_8,
            method="names in the text and in equation (2) against those in the caption of Figure 8",
            printed=", ".join(printed.RESISTORS_IN_FIGURE_8),
            recomputed=", ".join(printed.RESISTORS_IN_TEXT),
            otherwise="inconsistent in print",
        ),
        decided(
            "amplifier-supply",
            "Figure 6",
            "A uA741 delivers the square wave from 18 V to 50 V.",
            holds=UA741_SUPPLY_SPAN >= OUTPUT,
            method="the highest output against the span of the largest supplies that the part's data sheets allow",
            printed=OUTPUT,
            recomputed=UA741_SUPPLY_SPAN,
            unit="V",
            note="Another part, or a stage behind it, must have made the 50 V.",
        ),
    )


def _bandwidth() -> tuple[Claim, ...]:
    def kilohertz(amplitude: float) -> Claim:
        side = "input" if amplitude == INPUT else "output"
        return compared(
            f"bandwidth-{side}",
            "Section 2.4.1, equation (3)",
            f"Full-power bandwidth, for the amplitude of the amplifier's {side}.",
            printed=printed.BANDWIDTH_KHZ,
            computed=spread(
                lambda x: full_power_bandwidth(x[0] * _PER_US, amplitude) / 1e3, [printed.SLEW_RATE_V_PER_US]
            ),
            method=f"equation (3) at {amplitude:g} V with the printed slew rate, in V/us",
            unit="kHz",
            note="The value at the printed numbers would round to 15.92: the print cuts it off."
            if side == "input"
            else "It is the output that slews, so that this one is the amplifier's.",
        )

    return kilohertz(INPUT), kilohertz(OUTPUT)


def _program() -> tuple[Claim, ...]:
    return (
        cross_checked(
            "program-frequency",
            "Figure 6 and Table 2",
            "Frequency of the square wave, which is on for 5000 ms and off for 5000 ms.",
            printed=printed.FREQUENCY_HZ,
            computed=spread(lambda ms: 1000.0 / (ms[0] + ms[1]), [printed.ON_MS, printed.OFF_MS]),
            method="the reciprocal of the printed on and off times against Table 2",
            unit="Hz",
            note=f"Table 2's frequency belongs to a period of {1000.0 / float(printed.FREQUENCY_HZ):.0f} ms.",
        ),
        unseen(
            "table2-frequency",
            "Table 2",
            "Frequency of the recorded vibration.",
            needs="the times of Table 2's rows",
            printed=float(printed.FREQUENCY_HZ),
            unit="Hz",
        ),
        unseen(
            "square-wave-low-level",
            "Figure 6",
            "Lower level of the amplified square wave.",
            needs="the lower level of the microcontroller's output",
            printed=float(printed.LOW_V),
            unit="V",
            note=f"By (2), 18 V need {float(printed.LOW_V) / voltage_gain(float(printed.RATIO)):g} V.",
        ),
    )


def _table2(record: Record, information: Information) -> tuple[Claim, ...]:
    low, high = np.unique(record.u)[[0, -1]]
    lower, upper = (f"{record.y[record.u == level].mean():.3f}" for level in (low, high))
    halves = [len(list(run)) for run in np.split(record.u, np.flatnonzero(np.diff(record.u)) + 1)]
    return (
        decided(
            "table2-square-wave",
            "Figures 6 and 9",
            "The voltage is a square wave from 18 V to 50 V.",
            holds=set(np.unique(record.u)) == {float(printed.LOW_V), float(printed.HIGH_V)} and len(set(halves)) == 1,
            method="two levels, and equally many samples in each half period",
            printed=f"{printed.LOW_V}, {printed.HIGH_V}",
            recomputed=f"{low:g}, {high:g}",
            unit="V",
            note=f"{halves[0]} samples in each half period.",
        ),
        cross_checked(
            "table2-proportional",
            "Section 2.4 and Table 2",
            "The displacement is proportional to the voltage: that at 50 V from that at 18 V.",
            printed=upper,
            computed=spread(lambda x: x[0] * high / low, [lower]),
            method="Table 2's displacement at 18 V, times 50/18",
            unit="um",
            note="The zero of displacement is not that of voltage.",
        ),
        decided(
            "table2-resolution",
            "Table 2",
            "The vibration is measured to 0.001 um.",
            holds=information.quantum <= 2.0 * half_unit(printed.LAST_DIGIT_UM),
            method="the largest step of which both displacements are whole multiples within their rounding",
            printed=float(printed.LAST_DIGIT_UM),
            recomputed=information.quantum,
            unit="um",
            note=f"The whole swing, {information.swing:.3f} um, is {information.swing / information.quantum:.2f} such "
            "steps: if the step is a pixel, the vibration's amplitude is known to one pixel in one.",
        ),
    )


def _unseen() -> tuple[Claim, ...]:
    return (
        unseen(
            "figure6-program", "Figure 6", "A program on a microcontroller makes the square wave.",
            needs="the program, and the wiring",
        ),
        unseen(
            "figure7-video", "Figure 7", "Software turns the video into the displacements of Table 2.",
            needs="the video, its frame rate and its scale",
        ),
        unseen("figure8-circuit", "Figure 8", "The circuit of the amplifier.", needs="the values of the resistors"),
    )  # fmt: skip
