"""The verb `tune`: gains by simulation of the loop itself; and `loop_shaping`: a feedback by norms.

**Tuning** simulates the loop with its limits, sampling, noise and memory. A linear rule gives the starts: for each
crossover frequency and each shape (Ti and Td in units of it, or zeros on a resonance) the gain makes |L| = 1 there, L
the sampled loop with the law at its secant gain. Those that are stable on every plant, at the least and at the largest
slope of its law, are simulated; the search of J. A. Nelder and R. Mead (1965) descends from the best of them over the
logarithms of the gains. A barrier keeps the maximum sensitivity max |1 / (1 + L)| and the voltage noise within their
bounds. The objective is a number of the simulated true error e, in units of the reference's span, the largest one where
several limits are given:

    "itae"   integral of t |e| / duration^2     a step: late errors count most
    "rms"    rms of e                           a periodic reference

The loop of the controller that is returned, and of each in the trade-off, comes to rest where the reference stops:
those that are in a limit cycle, between the limits or on the steps of the sensor, are sorted out in the end.

The sensor's noise is in the simulation, always the same: it moves the memory of a law, which no linear figure shows.

**Feedback by norms** is python-control's H-infinity synthesis for the line that stands for a law, checked on a family.
In the plane of w = 2 (z - 1) / (h (z + 1)), which keeps norms, the controller minimises that from the reference r and
a disturbance d of the command to W e and effort u, with e = r - G (u + d) and W = (w / M + b) / (w + b / 1000). Without
d it would cancel the resonance. Source: K. Zhou and J. C. Doyle, Essentials of Robust Control (1998), chapter 9.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy
from scipy.linalg import schur
from threadpoolctl import threadpool_limits

from hysim._basics.frozen import FloatArray, Interval, check_choice, check_positive, frozen, read_only
from hysim._basics.printing import frozen_result, summary_text
from hysim.control._controller import PID, Feedback, SampledController, limits_of
from hysim.control._loop import RestingPlant, inverted, sampled, secant_gain, slopes
from hysim.control._stability import LinearLoop, closing_slopes, limit_cycle, nearest_to_one, slowest_decay
from hysim.control._tracking import TrackingController
from hysim.kernels import controllers as kernels
from hysim.models.model import family, in_brief
from hysim.models.protocols import CompiledController, positive_time
from hysim.plants.actuator import Actuator, as_actuator
from hysim.plants.transfer_function import StateSpace
from hysim.signals import triangle

Limits = tuple[float, ...] | None
Gains = tuple[float, float, float]
"""kp, ki and kd."""

Tuned = PID | TrackingController

_SHAPES = tuple(product((0.1, 1.0, 3.0, 10.0), (0.05, 0.3, 1.0)))  # Ti and Td in units of 1 / crossover
_ZEROS = (0.03, 0.3)  # damping ratio of zeros that a PID puts on a resonance
_SCALES = (1.0, 0.3, 0.1, 0.03)  # of a template's own gains
_FILTER = 0.1
_LARGEST_WEIGHT = 1.0
_LARGEST_LOG = 100.0
_STEP = 0.2  # of the first simplex, along the logarithm of a gain and down from the setpoint weight


class StandardForm:
    """PIDs as points (log |Kp|, log Ti, log Td, setpoint weight); the gains have the sign of the plant's gain.

    The derivative's filter is a tenth of Td, and of sqrt(Ti Td), one over the frequency of its zeros, if shorter.
    """

    def __init__(self, sign: float) -> None:
        self.sign = sign

    def controller(self, x: FloatArray) -> PID:
        Kp, Ti, Td = _gains(x[:3])
        weight = float(np.clip(x[3], 0.0, _LARGEST_WEIGHT))
        shorter = _FILTER * min(Td, math.sqrt(Ti * Td))
        return PID.standard(math.copysign(Kp, self.sign), Ti, Td, derivative_filter=shorter, setpoint_weight=weight)

    def point(self, gains: Gains) -> FloatArray:
        kp, ki, kd = gains
        return np.append(np.log([kp, kp / ki, kd / kp]), 1.0)

    def shapes(self, crossover: float, resonances: FloatArray) -> Iterator[Gains]:
        """Gains up to a factor, for a crossover frequency and a plant with these resonances [rad/s]."""
        yield from _shapes(crossover, resonances)

    def own(self) -> list[FloatArray]:
        return []

    def simplex(self, x: FloatArray) -> FloatArray:
        """Corners from which a search around a point begins, each a factor away: the unit of a gain plays no part."""
        return np.vstack([x, x + _STEP * np.diag([1.0, 1.0, 1.0, -1.0])])


class FreeGains:
    """Controllers as points: logarithms of the gains of a template's feedback and damping loop that are not zero."""

    def __init__(self, template: Tuned, sign: float) -> None:
        self.template, self.sign = template, sign
        self.pid = template if isinstance(template, PID) else template.feedback or PID()
        self.damping = None if isinstance(template, PID) else template.damping
        damping_gain = 0.0 if self.damping is None else self.damping.gain
        self.gains = np.array([self.pid.kp, self.pid.ki, self.pid.kd, damping_gain])
        self.free = self.gains != 0.0
        if not self.free.any():
            raise ValueError("the controller has nothing to tune: the gains that are not zero are the free ones")

    def controller(self, x: FloatArray) -> Tuned:
        gains = np.zeros(4)
        gains[self.free] = self.sign * _gains(x)
        kp, ki, kd, damping = gains.tolist()
        pid = replace(self.pid, kp=kp, ki=ki, kd=kd)
        if isinstance(self.template, PID):
            return pid
        damped = self.damping if self.damping is None else replace(self.damping, gain=damping)
        return replace(self.template, feedback=self.template.feedback and pid, damping=damped)

    def point(self, gains: Gains) -> FloatArray:
        return np.asarray(np.log(np.abs(np.array([*gains, self.gains[3]])[self.free])))

    def shapes(self, crossover: float, resonances: FloatArray) -> Iterator[Gains]:
        free = self.free[:3]
        shapes = _shapes(crossover, resonances) if free.any() else ()
        yield from dict.fromkeys(tuple(np.where(free, gains, 0.0).tolist()) for gains in shapes)

    def own(self) -> list[FloatArray]:
        own = np.log(np.abs(self.gains[self.free]))
        return [own + math.log(scale) for scale in _SCALES]

    def simplex(self, x: FloatArray) -> FloatArray:
        return np.vstack([x, x + _STEP * np.eye(x.size)])


def as_template(template: Tuned | None, sign: float) -> StandardForm | FreeGains:
    if template is None:
        return StandardForm(sign)
    if not isinstance(template, PID | TrackingController):
        raise TypeError(f"controller must be a PID or a TrackingController, got {type(template).__name__}")
    return FreeGains(template, sign)


def _gains(logarithms: FloatArray) -> FloatArray:
    return np.exp(np.clip(logarithms, -_LARGEST_LOG, _LARGEST_LOG))


def _shapes(crossover: float, resonances: FloatArray) -> Iterator[Gains]:
    """PIDs up to a factor: by their times, and with zeros on the resonances."""
    yield from ((1.0, crossover / Ti, Td / crossover) for Ti, Td in _SHAPES)
    yield from ((2.0 * ratio / w, 1.0, 1.0 / w**2) for w in resonances for ratio in _ZEROS)


@frozen
class Trial:
    """A controller that `tune` tried, and its figures.

    Parameters
    ----------
    controller : PID or TrackingController
        With the limits.
    max_sensitivity, voltage_noise : float
        Largest ``|1 / (1 + L)|`` of all plants, at either slope of the law, and largest rms of the voltage noise in the
        linear loops [unit of u]; infinite if a loop is unstable.
    objective : float
        Objective of the simulated loop, in units of the reference's span; infinite if a loop is unstable.
    """

    controller: Any
    max_sensitivity: float
    voltage_noise: float
    objective: float


@frozen_result
class Tuning:
    """Result of `tune`.

    Parameters
    ----------
    controller, objective, max_sensitivity
        As in the best `Trial`.
    gain_margin, phase_margin : float
        Factor and angle [degrees] by which the loop may change before it is unstable: the least changes of all plants.
    voltage_noise : float
        As in the best `Trial`. The noise also moves the memory of a law, which `close_loop` has in its conditions.
    trade_off : tuple of Trial
        Trials within the bound on the noise that no other beats in both objective and sensitivity, most robust first.
    trials : tuple of Trial
        Every controller that was simulated.
    success, message : bool, and str
        Whether a controller within the bounds was found; extent of the search, distance to the bounds, limited samples.
    """

    controller: Any
    objective: float
    max_sensitivity: float
    gain_margin: float
    phase_margin: float
    voltage_noise: float
    trade_off: tuple[Trial, ...]
    trials: tuple[Trial, ...]
    success: bool
    message: str

    def __str__(self) -> str:
        bounds = "within" if self.success else "NOT within"
        lines = [
            f"Tuning: {type(self.controller).__name__} {bounds} its bounds, objective {self.objective:.4g} of the "
            "reference's span"
        ]
        rows = {
            "controller": in_brief(self.controller),
            "sensitivity": f"at most {self.max_sensitivity:.4g}",
            "margins": f"gain {self.gain_margin:.4g}, phase {self.phase_margin:.4g} degrees",
            "noise": f"{self.voltage_noise:.4g} rms of the command" if self.voltage_noise else "",
            "search": self.message,
        }
        return summary_text(lines, rows)


def front(trials: Iterable[Trial]) -> tuple[Trial, ...]:
    best: list[Trial] = []
    for trial in sorted(trials, key=lambda trial: (trial.max_sensitivity, trial.objective)):
        if trial.objective < (best[-1].objective if best else math.inf):
            best.append(trial)
    return tuple(best)


class _PlantLoops:
    """One plant along the reference's cycle: its gain, the extreme slopes of its law, and its linear part."""

    def __init__(self, plant: Actuator, cycle: FloatArray, sample_time: float) -> None:
        self.gain = secant_gain(plant, cycle)
        self.secant = self.gain / plant.dc_gain
        self.slopes = closing_slopes(plant, cycle, self.gain)
        self.loop = LinearLoop(plant, sample_time)
        self.noise = 0.0 if plant.sensor is None else plant.sensor.noise
        self.volts = 1.0 if plant.amplifier is None else abs(plant.amplifier.gain)

    def voltage_noise(self, controller: SampledController) -> float:
        if not self.noise:
            return 0.0
        return self.volts * self.noise * max(self.loop.noise_gain(controller, slope) for slope in self.slopes)


OBJECTIVES: dict[str, Callable[[FloatArray], float]] = {
    "itae": lambda e: float(np.mean(np.linspace(0.0, 1.0, e.size) * np.abs(e))),
    "rms": lambda e: float(np.sqrt(np.mean(e**2))),
}

_SLOWEST = 1e-4  # crossover, in units of the highest; again below that
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
    plant, t, reference
        As in `hysim.close_loop`; the plant is a law, a transfer function or an actuator.
    controller : PID or TrackingController, optional
        A template: nonzero gains of its PID and damping loop are tuned, the rest stays; ``hs.PID(ki=1.0)`` asks for an
        integral alone. By default a standard-form PID with its setpoint weight and a derivative filter of Td / 10.
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
        As `hysim.close_loop`, or if a plant has no gain, the reference rests at the resting displacement, an option is
        unknown, no controller of the linear rule is stable, or every loop that was simulated is in a limit cycle.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> mode = hs.TransferFunction(num=(1.0,), den=(1.0, 0.2, 1.0))
    >>> tuning = hs.tune(mode, np.arange(0.0, 40.0, 0.05), np.ones(800), limits=(0.0, 10.0))
    >>> tuning.success, tuning.max_sensitivity <= 2.0, tuning.objective < 0.005
    (True, True, True)
    """
    check_choice("objective", objective, OBJECTIVES)
    actuator, (_, r, h) = as_actuator(plant), sampled(t, reference)
    resting = RestingPlant(actuator, h, u0)
    if not 0.0 <= transient < h * (r.size - 1):
        raise ValueError(f"transient must lie within the record, from 0 on, got {transient}")
    cycle = np.append(resting.y0, r)
    if np.ptp(cycle) == 0.0:
        raise ValueError(f"the reference stays at the output at rest {resting.y0:g}: nothing to follow")
    if not max_sensitivity > 1.0:
        raise ValueError(f"max_sensitivity must be above one, got {max_sensitivity}")
    check_positive(max_voltage_noise=max_voltage_noise)
    plants = [_PlantLoops(each, cycle, h) for each in (actuator, *map(as_actuator, variations))]
    search = _Search(
        resting=resting,
        reference=r,
        counted=slice(math.ceil(transient / h), None),
        span=float(np.ptp(cycle)),
        objective=OBJECTIVES[objective],
        limits=_each(limits, controller),
        plants=plants,
        max_sensitivity=max_sensitivity,
        max_voltage_noise=math.inf if max_voltage_noise is None else max_voltage_noise,
        template=as_template(controller, math.copysign(1.0, plants[0].gain)),
    )
    for start in sorted(search.starts(), key=search.cost)[:_STARTS]:
        options = {**_SEARCHED, "initial_simplex": search.template.simplex(start)}
        scipy.optimize.minimize(search.cost, start, method="Nelder-Mead", options=options)
    return search.result()


@dataclass(kw_only=True)
class _Search:
    """Loops that are simulated around a plant, and bounds on the linear loops around it and its variations."""

    resting: RestingPlant
    reference: FloatArray
    counted: slice
    span: float
    objective: Callable[[FloatArray], float]
    limits: tuple[Limits, ...]
    plants: list[_PlantLoops]
    max_sensitivity: float
    max_voltage_noise: float
    template: StandardForm | FreeGains
    trials: list[Trial] = field(default_factory=list)

    def starts(self) -> list[FloatArray]:
        """Stable points of the linear rule, without those far beyond the bounds where there are others.

        Crossovers slower than the record are tried where no other is stable, as with a lightly damped mode.
        """
        h = self.resting.sample_time
        highest = math.pi / h
        lowest = max(_SLOWEST * highest, 2.0 * math.pi / (self.reference.size * h))
        for low, high in ((lowest, highest), (_SLOWEST * lowest, lowest)):
            rule = [*self.template.own(), *self.rule(low, high)]
            each = [self.excess(*self.judge(self.template.controller(x))) for x in rule]
            if (least := min(each, default=math.inf)) < math.inf:
                return [x for excess, x in zip(each, rule, strict=True) if excess <= max(1.0, least)]
        raise ValueError("no controller of the linear rule makes the loop stable; is the sample time short enough?")

    def rule(self, lowest: float, highest: float) -> list[FloatArray]:
        """Points whose feedback has |L| = 1 at a crossover frequency between two [rad/s]."""
        plant, h, points = self.plants[0], self.resting.sample_time, []
        for crossover in np.geomspace(lowest, highest, _CROSSOVERS + 2)[1:-1]:
            at_crossover = LinearLoop(self.resting.plant, h, [crossover])
            for gains in self.template.shapes(float(crossover), plant.loop.resonances.imag / h):
                feedback = self.template.controller(self.template.point(gains))
                if isinstance(feedback, TrackingController):
                    feedback = replace(feedback, damping=None)  # it is not proportional to the gains
                size = abs(plant.secant * at_crossover.response(feedback)[0])
                points.append(self.template.point(tuple(gain / size for gain in gains)))
        return points

    def loops(self) -> Iterator[tuple[LinearLoop, float]]:
        return ((plant.loop, slope) for plant in self.plants for slope in plant.slopes)

    def judge(self, controller: SampledController) -> tuple[float, float]:
        sensitivity = 0.0
        for loop, slope in self.loops():
            sensitivity = max(sensitivity, loop.max_sensitivity(controller, slope))
            if sensitivity == math.inf:
                return math.inf, math.inf
        return sensitivity, max(plant.voltage_noise(controller) for plant in self.plants)

    def excess(self, sensitivity: float, noise: float) -> float:
        """Sum of the parts by which the bounds are exceeded; 0 within."""
        if sensitivity == math.inf:
            return math.inf
        parts = sensitivity / self.max_sensitivity, noise / self.max_voltage_noise
        return sum(max(0.0, part - 1.0) for part in parts)

    def value(self, controller: Tuned) -> float:
        """Objective of the simulated loop under the worst of the limits; infinite if it diverges."""
        loops = [self.resting.attempt(replace(controller, limits=limits), self.reference) for limits in self.limits]
        if any(signals.lost >= 0 for signals in loops):
            return math.inf
        return max(self.objective((self.reference - signals.y)[self.counted] / self.span) for signals in loops)

    def cost(self, x: FloatArray) -> float:
        controller = replace(self.template.controller(x), limits=self.limits[0])
        sensitivity, noise = self.judge(controller)
        value = self.value(controller) if sensitivity < math.inf else math.inf
        trial = Trial(controller=controller, max_sensitivity=sensitivity, voltage_noise=noise, objective=value)
        self.trials.append(trial)
        return value * (1.0 + _BARRIER * self.excess(sensitivity, noise))

    def result(self) -> Tuning:
        best, trade_off = self.chosen()
        gains, phases = np.array([loop.margins(best.controller, slope) for loop, slope in self.loops()]).T
        signals = self.resting.attempt(best.controller, self.reference)
        limited = np.count_nonzero(signals.drive != signals.command)
        noise = f", noise of the command {best.voltage_noise:.2g} of {self.max_voltage_noise:g}"
        return Tuning(
            **vars(best),
            gain_margin=nearest_to_one(gains),
            phase_margin=float(phases[np.abs(phases).argmin()]),
            trade_off=trade_off,
            trials=tuple(self.trials),
            success=self.excess(best.max_sensitivity, best.voltage_noise) == 0.0,
            message=(
                f"{len(self.trials)} loops simulated; sensitivity {best.max_sensitivity:.2f} of "
                f"{self.max_sensitivity:g} allowed{noise if self.max_voltage_noise < math.inf else ''}; "
                f"the command is limited at {limited} of {self.reference.size} samples"
            ),
        )

    def chosen(self) -> tuple[Trial, tuple[Trial, ...]]:
        """The best trial and the trade-off, once none of them is in a limit cycle."""
        resting: set[int] = set()
        while True:
            simulated = [(k, trial) for k, trial in enumerate(self.trials) if trial.objective < math.inf]
            if not simulated:
                raise ValueError(
                    "every loop that was simulated is in a limit cycle: lower max_sensitivity, or widen the limits"
                )
            best = min(simulated, key=lambda each: self.rank(each[1]))
            trade_off = front(trial for _, trial in simulated if trial.voltage_noise <= self.max_voltage_noise)
            chosen = {id(trial) for trial in (best[1], *trade_off)}
            doubtful = [k for k, trial in simulated if k not in resting and id(trial) in chosen]
            if not doubtful:
                return best[1], trade_off
            for k in doubtful:
                if self.rests(self.trials[k].controller):
                    resting.add(k)
                else:
                    self.trials[k] = replace(self.trials[k], objective=math.inf)

    def rank(self, trial: Trial) -> tuple[float, float, float]:
        return self.excess(trial.max_sensitivity, trial.voltage_noise), trial.objective, trial.max_sensitivity

    def rests(self, controller: Tuned) -> bool:
        """Whether the loop comes to rest where the reference stops, under each of the limits."""
        plant = self.plants[0]
        decay, asked = slowest_decay(plant.loop, controller, plant.slopes), self.span / abs(plant.gain)
        each = (replace(controller, limits=limits) for limits in self.limits)
        return not any(limit_cycle(self.resting, limited, self.reference, decay, asked) for limited in each)


def _each(limits: Any, controller: Any) -> tuple[Limits, ...]:
    if limits is None:
        return (limits_of(controller),)
    if all(np.ndim(limit) == 0 and limit is not None for limit in limits):
        return (limits,)
    return tuple(limits)


_FAST = 50.0  # of 1 / sample_time: poles of the controller beyond have settled
_SLOW = 1e-3  # error at rest, in units of the reference
_CYCLE = 2000  # samples of the stroke along which slopes are taken


@family
class LinearController(SampledController):
    """Linear controller of the error, sampled by the bilinear transform; a limit does not stop its states.

    Parameters
    ----------
    system : StateSpace
        From the error to the command, continuous; ValueError if it has a dead time.
    limits : (float, float), optional
        Lowest and highest command; None for none [unit of u].

    Examples
    --------
    >>> import hysim as hs
    >>> integral = hs.control.LinearController(system=hs.StateSpace(A=[[0.0]], B=[1.0], C=[4.0]))
    >>> u, state = integral.step(integral.initial(sample_time=0.5), reference=1.0, measurement=0.0)
    >>> u, integral.step(state, 1.0, 0.0)[0]
    (1.0, 3.0)
    """

    system: StateSpace
    limits: Interval | None = None

    def __post_init__(self) -> None:
        if self.system.delay:
            raise ValueError("system must have no dead time: model it in the sensor of the plant")

    def _discrete(self, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        system = self.system
        parts = system.A, system.B[:, np.newaxis], system.C[np.newaxis], [[system.D]]
        A, B, C, D, _ = scipy.signal.cont2discrete(parts, positive_time(sample_time), method="bilinear")
        return A, B[:, 0], C[0], float(D[0, 0])

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        A, B, C, D = self._discrete(sample_time)
        head = [u0, *(self.limits or (-math.inf, math.inf)), D]
        parameters = read_only(np.concatenate([head, C, B, A.ravel()]), finite=False)
        return CompiledController(kernels.linear, parameters, np.append(u0, np.zeros(2 * B.size)))

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        w = np.asarray(2j / sample_time * np.tan(0.5 * np.asarray(frequency, dtype=float) * sample_time))
        system = self.system
        states = np.linalg.solve(w[..., None, None] * np.eye(system.B.size) - system.A, system.B[:, np.newaxis])
        return np.asarray((system.C @ states)[..., 0] + system.D)

    def linear(self, sample_time: float) -> Feedback:
        A, B, C, D = self._discrete(sample_time)
        return Feedback(A, -B, C, -D)


class LoopShaping(NamedTuple):
    """A controller, the norm that it reaches, and its largest sensitivity over slopes and plants."""

    controller: LinearController
    norm: float
    max_sensitivity: float


def loop_shaping(
    plant: Any,
    sample_time: float,
    stroke: tuple[float, float],
    *,
    bandwidth: float,
    max_sensitivity: float = 2.0,
    effort: float = 0.05,
    disturbance: float = 1.0,
    variations: Sequence[Any] = (),
    limits: tuple[float, float] | None = None,
) -> LoopShaping:
    """Design a feedback by python-control's `hinfsyn`, for a law's mean slope; ImportError without slycot.

    Parameters
    ----------
    plant, sample_time : Actuator, law, linear plant or fit, and float
        What it controls, and its sample time [s].
    stroke : (float, float)
        Lowest and highest reference, along which slopes are taken [unit of y].
    bandwidth, max_sensitivity : float
        Up to which errors are to be small [rad/s], and M, the sensitivity that is accepted beyond.
    effort, disturbance : float
        Weight of the command, times the plant's gain, against that of errors, and part of the plant's output range that
        a disturbance of the command causes.
    variations : sequence of plants
        On which the controller is checked too.
    limits : (float, float), optional
        Lowest and highest command [unit of u].

    Returns
    -------
    LoopShaping
        Its largest sensitivity is infinite where a slope or a plant is unstable: ask for less bandwidth.
    """
    import control

    check_positive(bandwidth=bandwidth, max_sensitivity=max_sensitivity, effort=effort, disturbance=disturbance)
    if not control.slycot_check():
        raise ImportError("loop_shaping needs slycot: pip install 'hysim[synthesis]'")
    cycle, actuator = triangle(*stroke, cycles=1, samples_per_cycle=_CYCLE), as_actuator(plant)
    gain = secant_gain(actuator, cycle)
    along = slopes(actuator, inverted(actuator, cycle, gain))
    loops = [LinearLoop(each, positive_time(sample_time)) for each in (plant, *variations)]
    A, B, C, D = _in_w(loops[0].system, 1.0 / actuator.dc_gain, sample_time)
    n, b = B.size, bandwidth
    # inputs are the reference, the disturbance and the command; outputs the weighted error, the effort and the error
    through = np.array([1.0, -disturbance * D, -D])
    inputs = np.vstack([np.outer(B, [0.0, disturbance, 1.0]), through])
    error, lag = np.append(-C, 0.0), b * _SLOW * np.eye(1, n + 1, n)
    states = np.vstack([np.pad(A, ((0, 0), (0, 1))), error - lag])
    weighted = error / max_sensitivity + (b - b * _SLOW / max_sensitivity) * np.eye(1, n + 1, n)[0]
    outputs = np.stack([weighted, np.zeros(n + 1), error])
    direct = np.stack([through / max_sensitivity, [0.0, 0.0, effort], through])
    with threadpool_limits(limits=1, user_api="blas"):  # of slycot's own BLAS, too: several wait for each other
        K, _, norm, _ = control.hinfsyn(control.ss(states, inputs, outputs, direct), 1, 1)
    controller = LinearController(system=_without_fast_states(K, 1.0 / gain, _FAST / sample_time), limits=limits)
    worst = max(loop.max_sensitivity(controller, each) for loop, each in product(loops, along))
    return LoopShaping(controller, float(norm), worst)


def _without_fast_states(system: Any, scale: float, fastest: float) -> StateSpace:
    """A scaled system whose poles beyond a rate have settled: the synthesis has such near its best norm."""
    A, basis, n = schur(system.A, sort=lambda re, im: math.hypot(re, im) < fastest)
    B, C = scale * basis.T @ system.B[:, 0], system.C[0] @ basis
    settled = -np.linalg.solve(A[n:, n:], B[n:])
    D = float(scale * system.D[0, 0] + C[n:] @ settled)
    return StateSpace(A=A[:n, :n], B=B[:n] + A[:n, n:] @ settled, C=C[:n], D=D)


def _in_w(system: Any, gain: float, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """A sampled plant times a gain in the plane of w."""
    n, root = len(system.A), 2.0 / math.sqrt(sample_time)
    back = np.linalg.inv(system.A + np.eye(n))
    B, C = root * back @ system.B[:, 0], root * system.C[0] @ back
    D = -float(system.C[0] @ back @ system.B[:, 0])
    return 2.0 / sample_time * back @ (system.A - np.eye(n)), B, gain * C, gain * D
