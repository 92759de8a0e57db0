"""Loop width against dwell: what is lag closes with time, what is hysteresis stays.

Table 1's staircase is run at several dwells. The displacement is taken at the end of each dwell, as one reads
an instrument that has settled. Taken at its start instead, each displacement belongs to the voltage before:
the loop of a plant without any memory is then as wide as two steps of the staircase, however long the dwell.
"""

import numpy as np

from hysim._frozen import FloatArray, frozen
from hysim.metrics import loop_metrics
from hysim.plants.actuator import Actuator
from hysim.plants.transfer_function import TransferFunction

DWELLS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
_SAMPLES_PER_SECOND = 10


@frozen
class DwellWidth:
    """Largest loop widths at one dwell [um].

    Parameters
    ----------
    dwell : float
        Time for which each voltage is held [s].
    linear, linear_at_start : float
        Of the linear model, its displacement taken at the end and at the start of each dwell.
    law : float
        Of the law, at the end.
    law_and_dynamics : float
        Of the law followed by linear dynamics, at the end.
    """

    dwell: float
    linear: float
    linear_at_start: float
    law: float
    law_and_dynamics: float


def dwell_widths(
    u: FloatArray, linear: TransferFunction, law: Actuator, law_and_dynamics: Actuator
) -> tuple[DwellWidth, ...]:
    """Simulate a staircase at every dwell, ten samples a second, and measure the loops.

    Parameters
    ----------
    u : array, shape (n,)
        The staircase, one sample a step [V].
    linear : TransferFunction
        At rest before the first step.
    law, law_and_dynamics : Actuator
        The law alone, and with dynamics behind it.
    """
    return tuple(
        DwellWidth(
            dwell=dwell,
            linear=_width(u, _settled(Actuator(vibration=linear), u, dwell)),
            linear_at_start=_width(u, linear.response(u, dwell)),
            law=_width(u, _settled(law, u, dwell)),
            law_and_dynamics=_width(u, _settled(law_and_dynamics, u, dwell)),
        )
        for dwell in DWELLS
    )


def dwell_measures(width: DwellWidth) -> dict[str, float]:
    """The entry of one dwell in `summary.json`."""
    return {
        "dwell_s": width.dwell,
        "eq1_max_width_um": width.linear,
        "eq1_at_start_max_width_um": width.linear_at_start,
        "bouc_wen_max_width_um": width.law,
        "bouc_wen_and_eq7_max_width_um": width.law_and_dynamics,
    }


def _settled(plant: Actuator, u: FloatArray, dwell: float) -> FloatArray:
    """The displacements at the end of each dwell."""
    held = round(dwell * _SAMPLES_PER_SECOND)
    voltage = np.append(np.repeat(u, held), u[-1])
    y = plant.response(voltage, 1.0 / _SAMPLES_PER_SECOND)
    return y[held::held] if plant.dynamic else y[held - 1 :: held]


def _width(u: FloatArray, y: FloatArray) -> float:
    return loop_metrics(u, y[: u.size]).max_width
