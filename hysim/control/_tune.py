"""The verb `tune`: gains by simulation of the loop itself, limits, sampling, noise and memory included.

A linear rule gives the starts: for each crossover frequency and each shape (Ti and Td in units of it, or zeros on a
resonance) the gain makes |L| = 1 there, L the sampled loop with the law at its secant gain. Those that are stable on
every plant, at the least and at the largest slope of its law, are simulated; the search of J. A. Nelder and R. Mead
(1965) descends from the best of them over the logarithms of the gains. A barrier keeps the maximum sensitivity
max |1 / (1 + L)| and the voltage noise within their bounds. The objective is a number of the simulated true error e,
in units of the reference's span, the largest one where several limits are given:

    "itae"   integral of t |e| / duration^2     a step: late errors count most
    "rms"    rms of e                           a periodic reference

The loop of the controller that is returned, and of each in the trade-off, comes to rest where the reference stops:
those that are in a limit cycle, between the limits or on the steps of the sensor, are sorted out in the end.

The sensor's noise is in the simulation, always the same: it moves the memory of a law, which no linear figure shows.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from hysim._frozen import FloatArray, check_choice, read_only
from hysim.control._loop import RestingPlant, as_actuator, sample_time_of
from hysim.control._margins import LinearLoop
from hysim.control._protocols import limits_of
from hysim.control._specification import Specification
from hysim.control._stability import limit_cycle
from hysim.control._template import Limits, Tuned, as_template
from hysim.control._tuning import Trial, Tuning, front

OBJECTIVES: dict[str, Callable[[FloatArray], float]] = {
    "itae": lambda e: float(np.mean(np.linspace(0.0, 1.0, e.size) * np.abs(e))),
    "rms": lambda e: float(np.sqrt(np.mean(e**2))),
}

_SLOWEST = 1e-4  # crossover, in units of the highest
_CROSSOVERS = 12
_STARTS = 2
_EVALUATIONS = 120  # of the simulation, from each start
_BARRIER = 10.0  # growth of the cost with the part by which a bound is exceeded
_SEARCHED = {"maxfev": _EVALUATIONS, "xatol": 1e-3, "fatol": 1e-7}


def tune(
    plant: Any,
    t: npt.ArrayLike,
    reference: npt.ArrayLike,
    *,
    controller: Tuned | None = None,
    objective: str = "itae",
    limits: Limits | Sequence[Limits] = None,
    max_sensitivity: float = 2.0,
    max_voltage_noise: float | None = None,
    variations: Sequence[Any] = (),
    transient: float = 0.0,
    u0: float | None = None,
) -> Tuning:
    """Find the gains that make the simulated loop follow a reference best.

    Parameters
    ----------
    plant : Actuator, law or linear plant
        At rest at `u0` before the first sample.
    t : array, shape (n,)
        Evenly spaced times [s]; their spacing is the controller's sample time.
    reference : array, shape (n,)
        [unit of y]
    controller : PID or TrackingController, optional
        A template: the gains of its PID and damping loop that are not zero are tuned, everything else stays;
        ``hs.PID(ki=1.0)`` asks for an integral alone. By default a PID in standard form, with its setpoint weight and a
        derivative filter of a tenth of Td.
    objective : {"itae", "rms"}
        Measure of the error to minimise: for a step, for a periodic reference.
    limits : (float, float), optional
        Lowest and highest voltage; by default the template's. Several such pairs (None for no limits) ask for one
        controller that serves all of them; the one returned has the first.
    max_sensitivity : float
        Bound on max ``|1 / (1 + L)|``, above one: the smaller, the more the plant may differ from its model.
    max_voltage_noise : float, optional
        Bound on the rms of the voltage that the sensor's noise causes in the linear loop, positive [unit of u].
    variations : sequence of plants
        Other plants on which the bounds must hold too.
    transient : float
        Time at the beginning that does not count [s].
    u0 : float, optional
        Voltage before the first sample.

    Returns
    -------
    Tuning

    Raises
    ------
    TypeError, ValueError
        If a plant is not one, has no gain or cannot rest at `u0`, the reference is constant at the resting
        displacement, times are uneven, an option is unknown, no controller of the linear rule is stable, or every
        loop that was simulated is in a limit cycle.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> mode = hs.TransferFunction(num=(1.0,), den=(1.0, 0.2, 1.0))
    >>> tuning = hs.tune(mode, np.arange(0.0, 40.0, 0.05), np.ones(800), limits=(0.0, 10.0))
    >>> tuning.success, tuning.max_sensitivity <= 2.0, tuning.objective < 0.005
    (True, True, True)
    """
    check_choice("objective", objective, OBJECTIVES)
    loop = _SimulatedLoop(plant, t, reference, OBJECTIVES[objective], _each(limits, controller), transient, u0)
    plants = [loop.actuator, *map(as_actuator, variations)]
    specification = Specification(plants, loop.cycle, loop.h, max_sensitivity, max_voltage_noise)
    search = _Search(loop, specification, controller)
    for start in sorted(search.starts(), key=search.cost)[:_STARTS]:
        search.descend(start)
    return search.result()


class _SimulatedLoop:
    """Error of the loop that a controller closes around the plant, as one number."""

    def __init__(
        self,
        plant: Any,
        t: npt.ArrayLike,
        reference: npt.ArrayLike,
        objective: Callable[[FloatArray], float],
        limits: tuple[Limits, ...],
        transient: float,
        u0: float | None,
    ) -> None:
        self.actuator = as_actuator(plant)
        self.reference = read_only(reference, "reference", ndim=1)
        self.h = sample_time_of(read_only(t, "t", ndim=1), self.reference)
        self.plant = RestingPlant(self.actuator, self.h, u0)
        if not 0.0 <= transient < self.h * (self.reference.size - 1):
            raise ValueError(f"transient must lie within the record, from 0 on, got {transient}")
        self.counted = slice(math.ceil(transient / self.h), None)
        self.objective, self.limits = objective, limits
        self.cycle = np.append(self.plant.y0, self.reference)
        self.span = float(np.ptp(self.cycle))
        if self.span == 0.0:
            raise ValueError(f"the reference stays at the resting displacement {self.plant.y0:g}: nothing to follow")

    def value(self, controller: Tuned) -> float:
        largest = -math.inf
        for limits in self.limits:
            signals = self.plant.attempt(replace(controller, limits=limits), self.reference)
            if signals.lost >= 0:
                return math.inf
            largest = max(largest, self.objective((self.reference - signals.y)[self.counted] / self.span))
        return largest

    def rests(self, controller: Tuned, decay: float, gain: float) -> bool:
        """Whether the loop comes to rest where the reference stops, under each of the limits."""
        asked = self.span / abs(gain)
        return not any(
            limit_cycle(
                self.actuator,
                replace(controller, limits=limits),
                self.reference,
                self.h,
                self.plant.u0,
                decay=decay,
                asked=asked,
            )
            for limits in self.limits
        )

    def limited(self, controller: Tuned) -> int:
        signals = self.plant.attempt(controller, self.reference)
        return int(np.count_nonzero(signals.drive != signals.command))


class _Search:
    def __init__(self, loop: _SimulatedLoop, specification: Specification, controller: Tuned | None) -> None:
        self.loop, self.specification = loop, specification
        self.template = as_template(controller, math.copysign(1.0, specification.plants[0].gain))
        self.trials: list[Trial] = []

    def starts(self) -> list[FloatArray]:
        """Stable points of the linear rule, without those far beyond the bounds where there are others."""
        rule = [*self.template.own(), *self.rule()]
        stable = [(excess, x) for x in rule if (excess := self.excess(x)) < math.inf]
        if not stable:
            raise ValueError("no controller of the linear rule makes the loop stable; is the sample time short enough?")
        enough = max(1.0, min(excess for excess, _ in stable))
        return [x for excess, x in stable if excess <= enough]

    def rule(self) -> list[FloatArray]:
        """Points whose feedback has |L| = 1 at a crossover frequency."""
        plant, samples = self.specification.plants[0], self.loop.reference.size
        highest = math.pi / self.loop.h
        lowest = max(_SLOWEST * highest, 2.0 * math.pi / (samples * self.loop.h))
        points = []
        for crossover in np.geomspace(lowest, highest, _CROSSOVERS + 2)[1:-1]:
            at_crossover = LinearLoop(self.loop.actuator, self.loop.h, [crossover])
            for gains in self.template.shapes(float(crossover), plant.loop.resonances.imag / self.loop.h):
                size = abs(plant.secant * at_crossover.response(self.template.feedback(gains))[0])
                points.append(self.template.point(tuple(gain / size for gain in gains)))
        return points

    def excess(self, x: FloatArray) -> float:
        return self.specification.excess(self.specification.judge(self.template.controller(x)))

    def cost(self, x: FloatArray) -> float:
        controller = replace(self.template.controller(x), limits=self.loop.limits[0])
        judgement = self.specification.judge(controller)
        value = self.loop.value(controller) if judgement.max_sensitivity < math.inf else math.inf
        self.trials.append(Trial(controller=controller, objective=value, **judgement._asdict()))
        return value * (1.0 + _BARRIER * self.specification.excess(judgement))

    def descend(self, start: FloatArray) -> None:
        options = {**_SEARCHED, "initial_simplex": self.template.simplex(start)}
        minimize(self.cost, start, method="Nelder-Mead", options=options)

    def result(self) -> Tuning:
        """Best controller within the bounds, or the nearest to them, with its margins."""
        bounds = self.specification
        best, trade_off = self.chosen()
        gain_margin, phase_margin = bounds.margins(best.controller)
        limited, samples = self.loop.limited(best.controller), self.loop.reference.size
        return Tuning(
            controller=best.controller,
            objective=best.objective,
            max_sensitivity=best.max_sensitivity,
            gain_margin=gain_margin,
            phase_margin=phase_margin,
            voltage_noise=best.voltage_noise,
            trade_off=trade_off,
            trials=tuple(self.trials),
            success=bounds.excess(best) == 0.0,
            message=(
                f"{len(self.trials)} loops simulated; {bounds.words(best)}; "
                f"the voltage is limited at {limited} of {samples} samples"
            ),
        )

    def chosen(self) -> tuple[Trial, tuple[Trial, ...]]:
        """The best trial and the trade-off, once none of them is in a limit cycle."""
        bounds = self.specification
        resting: set[int] = set()
        while True:
            simulated = [(k, trial) for k, trial in enumerate(self.trials) if trial.objective < math.inf]
            if not simulated:
                raise ValueError(
                    "every loop that was simulated is in a limit cycle: lower max_sensitivity, or widen the limits"
                )
            best = min(simulated, key=lambda each: _rank(bounds.excess(each[1]), each[1]))
            trade_off = front(trial for _, trial in simulated if trial.voltage_noise <= bounds.max_voltage_noise)
            doubtful = [k for k, trial in simulated if k not in resting and (k == best[0] or trial in trade_off)]
            if not doubtful:
                return best[1], trade_off
            for k in doubtful:
                if self.rests(self.trials[k].controller):
                    resting.add(k)
                else:
                    self.trials[k] = replace(self.trials[k], objective=math.inf)

    def rests(self, controller: Tuned) -> bool:
        plant = self.specification.plants[0]
        return self.loop.rests(controller, plant.decay(controller), plant.gain)


def _rank(excess: float, trial: Trial) -> tuple[float, float, float]:
    return excess, trial.objective, trial.max_sensitivity


def _each(limits: Any, controller: Any) -> tuple[Limits, ...]:
    if limits is None:
        return (limits_of(controller),)
    if all(np.ndim(limit) == 0 and limit is not None for limit in limits):
        return (limits,)
    return tuple(limits)
