"""Figures that every assessment of a loop has: its stability, robustness, use of the voltage, and error."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, frozen, read_only
from hysim._printing import printed, quantity, summary_text
from hysim.control._loop import ClosedLoop, RestingPlant, around_actuator, as_actuator
from hysim.control._open_loop import secant_gain
from hysim.control._protocols import Controller
from hysim.control._stability import closing_slopes, limit_cycle, linear_figures
from hysim.metrics import rmse
from hysim.plants.actuator import Actuator


@printed
@frozen
class LoopAssessment:
    """Stability, robustness and error of a closed loop.

    Parameters
    ----------
    stable : bool
        Whether the linear loop is stable at the least and at the largest slope of the law, and the loop itself comes
        to rest where the reference stops.
    message : str
        Why it is not stable; empty if it is.
    period : float
        Period of the reference [s]; nan if it has none.
    tracking_rms : float
        Rms of reference minus true displacement, over the last period if there is one [unit of y].
    limited_percent : float
        Share of the samples at a limit of controller or amplifier [%].
    max_sensitivity, max_sensitivity_with_delay : float
        Largest ``|1 / (1 + L)|`` of the linear loop at either slope, and that with one sample more of delay; infinite
        if it is unstable, nan for a controller whose linear part is unknown.
    command_jump : float
        Jump of the command when the measurement moves by one; nan if unknown [unit of u / unit of y].
    closed
        The closed loop.
    """

    stable: bool
    message: str
    period: float
    tracking_rms: float
    limited_percent: float
    max_sensitivity: float
    max_sensitivity_with_delay: float
    command_jump: float
    closed: ClosedLoop

    def __str__(self) -> str:
        return summary_text(
            [f"LoopAssessment: {'stable' if self.stable else self.message}, tracking rms {self.tracking_rms:.4g}"],
            {
                "maximum sensitivity": f"{self.max_sensitivity:.4g}, with one sample more of delay "
                f"{self.max_sensitivity_with_delay:.4g}",
                "at a limit": f"{self.limited_percent:.3g} % of the samples",
                "command": f"moves by {self.command_jump:.4g} when the measurement moves by one",
                "period": "" if math.isnan(self.period) else quantity(self.period, "s"),
            },
        )

    def row(self, quantum: float | None = None) -> dict[str, float | bool | None]:
        """The columns beside a reduction in a table: numbers, None where one is infinite or unknown.

        Parameters
        ----------
        quantum : float, optional
            Step of the readings for ``"volts_per_quantum"`` [unit of y]; by default the sensor's own.

        Returns
        -------
        dict
            ``"stable"``, ``"period"``, ``"tracking_rms"``, ``"limited_percent"``, ``"max_sensitivity"``,
            ``"max_sensitivity_with_delay"`` and ``"volts_per_quantum"``.
        """
        step = self.closed.conditions["sensor_quantum"] if quantum is None else quantum
        numbers = {
            "period": self.period,
            "tracking_rms": self.tracking_rms,
            "limited_percent": self.limited_percent,
            "max_sensitivity": self.max_sensitivity,
            "max_sensitivity_with_delay": self.max_sensitivity_with_delay,
            "volts_per_quantum": self.command_jump * step,
        }
        return {"stable": self.stable} | {key: each if math.isfinite(each) else None for key, each in numbers.items()}


def assess_loop(
    plant: Any,
    controller: Controller,
    t: npt.ArrayLike,
    reference: npt.ArrayLike,
    *,
    u0: float | None = None,
    period: float = math.nan,
) -> LoopAssessment:
    """Close a loop, and judge its stability, robustness and error.

    A loop whose linear poles lie outside the unit circle may still run along between the limits of its voltage, and a
    loop that is stable in linear theory may swing there, or on the steps of its sensor. Both are not stable: the
    figures of such a run say nothing of the controller.

    Parameters
    ----------
    plant, controller, t, reference, u0
        As in `hysim.close_loop`.
    period : float
        Period of the reference, of which the last one is measured [s]; nan for a reference that has none.

    Returns
    -------
    LoopAssessment

    Raises
    ------
    SimulationError, ValueError
        If the loop diverges; if the plant has no gain, or the period is longer than the reference.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> lag, t = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), 0.1 * np.arange(200)
    >>> found = [hs.control.assess_loop(lag, hs.PID(kp=kp, limits=(0.0, 2.0)), t, np.ones(200)) for kp in (5.0, 50.0)]
    >>> [each.stable for each in found], found[1].message
    ([True, False], 'the loop is unstable: a pole of the linear loop lies outside the unit circle')
    """
    actuator, r = as_actuator(plant), read_only(reference, "reference", ndim=1)
    closed = around_actuator(actuator, controller, read_only(t, "t", ndim=1), r, u0)
    h = closed.conditions["sample_time"]
    samples = r.size if math.isnan(period) else round(period / h)
    if not 0 < samples <= r.size:
        raise ValueError(f"period must be at least a sample and no longer than the reference, got {period} s")
    cycle = r if math.isnan(period) else r[-samples:]
    y0 = RestingPlant(actuator, h, u0).y0
    cycle = np.append(y0, cycle) if np.ptp(cycle) == 0.0 else cycle
    return judged(actuator, controller, closed, cycle, secant_gain(actuator, cycle), slice(-samples, None), period)


def judged(
    plant: Actuator,
    controller: Controller,
    closed: ClosedLoop,
    cycle: FloatArray,
    gain: float,
    counted: slice,
    period: float = math.nan,
) -> LoopAssessment:
    """Judgement of a loop that has run; `gain` is the secant gain along `cycle`, and `counted` what the error is of."""
    conditions = closed.conditions
    h, u0 = conditions["sample_time"], conditions["u0"]
    linear = linear_figures(plant, controller, h, closing_slopes(plant, cycle, gain))
    message = "the loop is unstable: a pole of the linear loop lies outside the unit circle"
    if linear.is_stable:
        asked = float(np.ptp(cycle)) / abs(gain)
        moves = limit_cycle(plant, controller, closed.reference, h, u0, decay=linear.decay, asked=asked)
        message = f"the loop {moves} where the reference stops" if moves else ""
    return LoopAssessment(
        stable=not message,
        message=message,
        period=period,
        tracking_rms=rmse(closed.reference[counted], closed.y[counted]),
        limited_percent=100.0 * float(conditions["limited_samples"]) / float(closed.t.size),
        max_sensitivity=linear.max_sensitivity,
        max_sensitivity_with_delay=linear.max_sensitivity_with_delay,
        command_jump=linear.command_jump,
        closed=closed,
    )
