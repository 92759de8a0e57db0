"""The verb `tune`: PID gains by simulation of the loop itself, limits, sampling and memory included.

A linear rule gives the starts: for each crossover frequency and each shape (Ti, Td in units of it), Kp makes
|L| = 1 there, L the sampled loop with the law at its secant gain. Those that are stable at the least and at
the largest slope of the law are simulated, and the search of J. A. Nelder and R. Mead (1965) descends from
the best of them over log Kp, log Ti, log Td and the setpoint weight; a barrier keeps the maximum sensitivity
max |1 / (1 + L)|, at either slope, within its bound. What is made small is one number of the simulated error
e, in units of the reference's span, the larger one where several limits are given:

    "itae"   integral of t |e| / duration^2     a step: what lasts counts most
    "rms"    rms of e                           a periodic reference
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from hysim._frozen import FloatArray, frozen, read_only
from hysim.control._drive import secant_gain, slopes
from hysim.control._loop import RestingPlant, as_actuator
from hysim.control._margins import LinearLoop
from hysim.control._pid import PID
from hysim.records import Record

Limits = tuple[float, float] | None

OBJECTIVES: dict[str, Callable[[FloatArray], float]] = {
    "itae": lambda e: float(np.mean(np.linspace(0.0, 1.0, e.size) * np.abs(e))),
    "rms": lambda e: float(np.sqrt(np.mean(e**2))),
}

_FILTER = 0.1  # derivative filter in units of Td
_SHAPES = tuple(product((0.1, 1.0, 3.0, 10.0), (0.05, 0.3, 1.0)))  # Ti and Td in units of 1 / crossover
_CROSSOVERS = 12
_STARTS = 2
_EVALUATIONS = 120  # of the simulation, from each start
_BARRIER = 10.0  # growth of the cost with the sensitivity beyond its bound
_LARGEST_WEIGHT = 1.0


@frozen
class Tuning:
    """What `tune` found.

    Parameters
    ----------
    controller : PID
        The gains, with the limits.
    objective : float
        Its value, in units of the reference's span.
    max_sensitivity : float
        Largest ``|1 / (1 + L)|`` at either slope of the law.
    gain_margin, phase_margin : float
        Factor and angle [degrees] by which the loop at its largest slope may change before it is unstable.
    trials : array, shape (n, 6)
        The trade-off it chose from, a row for each simulated PID: kp, ki, kd, setpoint weight, maximum
        sensitivity, objective (inf where the loop is unstable).
    success : bool
        Whether a PID within the bound on the sensitivity was found.
    message : str
        What was searched.
    """

    controller: PID
    objective: float
    max_sensitivity: float
    gain_margin: float
    phase_margin: float
    trials: FloatArray
    success: bool
    message: str


def tune(
    plant: Any,
    t: npt.ArrayLike,
    reference: npt.ArrayLike,
    *,
    objective: str = "itae",
    limits: Limits | Sequence[Limits] = None,
    max_sensitivity: float = 2.0,
    transient: float = 0.0,
    u0: float = 0.0,
) -> Tuning:
    """Find the PID that makes the simulated loop follow a reference best.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        At rest at `u0` before the first sample.
    t : array, shape (n,)
        Evenly spaced times [s]; their spacing is the controller's sample time.
    reference : array, shape (n,)
        What the loop shall follow [unit of y].
    objective : {"itae", "rms"}
        What is made small: for a step, for a periodic reference.
    limits : (float, float), optional
        Lowest and highest voltage. Of a list of such pairs, or None for no limits, the loop is simulated
        within each, so that one PID serves all; the one returned has the first.
    max_sensitivity : float
        Bound on max ``|1 / (1 + L)|``, above one: the smaller, the more the plant may differ from its model.
    transient : float
        Time at the begin that does not count [s]: what a periodic reference needs to become steady.
    u0 : float
        Voltage before the first sample.

    Returns
    -------
    Tuning

    Raises
    ------
    TypeError, ValueError
        If the plant is not one, has no gain or cannot rest at `u0`, the reference is constant at the resting
        displacement, times are uneven, or an option is unknown.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> mode = hs.TransferFunction(num=(1.0,), den=(1.0, 0.2, 1.0))
    >>> found = hs.tune(mode, np.arange(0.0, 40.0, 0.05), np.ones(800), limits=(0.0, 10.0))
    >>> found.success, found.max_sensitivity <= 2.0, found.objective < 0.005
    (True, True, True)
    """
    if objective not in OBJECTIVES:
        raise ValueError(f"objective must be one of {', '.join(OBJECTIVES)}, got {objective!r}")
    if not max_sensitivity > 1.0:
        raise ValueError(f"max_sensitivity must be above one, got {max_sensitivity}")
    search = _Search(plant, t, reference, OBJECTIVES[objective], limits, max_sensitivity, transient, u0)
    starts = sorted(search.starts(), key=search.cost)[:_STARTS]
    for start in starts:
        minimize(search.cost, start, method="Nelder-Mead", options=_SEARCHED)
    return search.result()


_SEARCHED = {"maxfev": _EVALUATIONS, "xatol": 1e-3, "fatol": 1e-7}


class _Search:
    """The loop as a function of (log |Kp|, log Ti, log Td, setpoint weight)."""

    def __init__(
        self,
        plant: Any,
        t: npt.ArrayLike,
        reference: npt.ArrayLike,
        objective: Callable[[FloatArray], float],
        limits: Limits | Sequence[Limits],
        max_sensitivity: float,
        transient: float,
        u0: float,
    ) -> None:
        actuator = as_actuator(plant)
        self.reference = read_only(reference, "reference", ndim=1)
        self.h = Record(u=self.reference, y=self.reference, t=read_only(t, "t")).sample_time
        self.plant = RestingPlant(actuator, self.h, u0)
        if not 0.0 <= transient < self.h * (self.reference.size - 1):
            raise ValueError(f"transient must lie within the record, from 0 on, got {transient}")
        self.counted = slice(math.ceil(transient / self.h), None)
        self.objective, self.bound = objective, max_sensitivity
        self.limits = _each(limits)
        cycle = np.append(self.plant.y0, self.reference)
        self.span = float(np.ptp(cycle))
        if self.span == 0.0:
            raise ValueError(f"the reference stays at the resting displacement {self.plant.y0:g}: nothing to follow")
        self.gain = secant_gain(actuator, cycle)
        low, high = slopes(actuator, cycle / self.gain)
        self.slopes = sorted({low, high})
        self.secant = self.gain / actuator.dc_gain
        self.linear = LinearLoop(actuator, self.h)
        self.trials: list[Trial] = []

    def starts(self) -> list[FloatArray]:
        """The linear rule's PIDs that are stable, those far beyond the bound left out where there are others."""
        above = np.searchsorted(self.linear.frequencies, 2.0 * math.pi / (self.reference.size * self.h))
        places = np.linspace(above, self.linear.frequencies.size - 1, _CROSSOVERS + 2)[1:-1].astype(int)
        rule = [self.at_crossover(int(k), Ti, Td) for k in places for Ti, Td in _SHAPES]
        stable = [(found, x) for x in rule if (found := self.sensitivity(self.pid(x))) < math.inf]
        if not stable:
            raise ValueError("no PID of the linear rule makes the loop stable; is the sample time short enough?")
        enough = max(2.0 * self.bound, min(found for found, _ in stable))
        return [x for found, x in stable if found <= enough]

    def at_crossover(self, k: int, Ti: float, Td: float) -> FloatArray:
        """The PID whose |L| is one at the k-th frequency, Ti and Td in units of its inverse."""
        x = np.array([0.0, *np.log(np.array([Ti, Td]) / self.linear.frequencies[k]), 1.0])
        x[0] = -math.log(abs(self.secant * self.linear.response(self.pid(x))[k]))
        return x

    def pid(self, x: FloatArray) -> PID:
        """The controller at a point of the search."""
        (Kp, Ti, Td), weight = np.exp(np.clip(x[:3], -100.0, 100.0)), float(np.clip(x[3], 0.0, _LARGEST_WEIGHT))
        return PID.standard(
            math.copysign(Kp, self.gain),
            Ti,
            Td,
            derivative_filter=_FILTER * Td,
            limits=self.limits[0],
            setpoint_weight=weight,
        )

    def sensitivity(self, pid: PID) -> float:
        """Largest ``|1 / (1 + L)|`` at either slope of the law; infinite if the loop is unstable there."""
        return max(self.linear.max_sensitivity(pid, slope) for slope in self.slopes)

    def cost(self, x: FloatArray) -> float:
        """The objective, and a barrier beyond the bound on the sensitivity."""
        pid = self.pid(x)
        trial = Trial(pid, self.sensitivity(pid), self.value(pid))
        self.trials.append(trial)
        return trial.value * (1.0 + _BARRIER * max(0.0, trial.sensitivity / self.bound - 1.0))

    def value(self, pid: PID) -> float:
        """The objective of the simulated loop within the limits where it is larger; infinite if it is lost."""
        runs = [self.plant.run(replace(pid, limits=limits), self.reference) for limits in self.limits]
        if any(signals.lost >= 0 for signals in runs):
            return math.inf
        return max(self.objective((self.reference - signals.y)[self.counted] / self.span) for signals in runs)

    def result(self) -> Tuning:
        """The best PID within the bound, or the most robust one if there is none, with its margins."""
        within = [trial for trial in self.trials if trial.sensitivity <= self.bound]
        least = min(trial.sensitivity for trial in self.trials)
        choice = within or [trial for trial in self.trials if trial.sensitivity == least]
        best = min(choice, key=lambda trial: trial.value)
        gain_margin, phase_margin = self.margins(best.pid)
        return Tuning(
            controller=best.pid,
            objective=best.value,
            max_sensitivity=best.sensitivity,
            gain_margin=gain_margin,
            phase_margin=phase_margin,
            trials=np.array([trial.row() for trial in self.trials]),
            success=bool(within) and math.isfinite(best.value),
            message=f"{len(self.trials)} loops simulated; sensitivity {best.sensitivity:.2f} of {self.bound:g} allowed",
        )

    def margins(self, pid: PID) -> tuple[float, float]:
        """Gain and phase margin at the steepest slope, by python-control; it does not look at z = -1 itself."""
        import control

        loop = max(self.slopes, key=abs) * self.linear.response(pid)
        gain_margin, phase_margin = control.margin(control.frd(loop, self.linear.frequencies))[:2]
        at_nyquist = -1.0 / loop[-1].real if loop[-1].real < 0.0 else math.inf
        return min(float(gain_margin), at_nyquist), float(phase_margin)


class Trial(NamedTuple):
    """One simulated loop."""

    pid: PID
    sensitivity: float
    value: float

    def row(self) -> list[float]:
        """As `Tuning.trials` holds it."""
        return [self.pid.kp, self.pid.ki, self.pid.kd, self.pid.setpoint_weight, self.sensitivity, self.value]


def _each(limits: Any) -> tuple[Limits, ...]:
    """The limits of each simulation, from one pair or from several."""
    if limits is None or all(np.ndim(limit) == 0 and limit is not None for limit in limits):
        return (limits,)
    return tuple(limits)
