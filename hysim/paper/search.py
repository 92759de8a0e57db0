"""The PIDs of the claims about control, by one global search over all gains, weights and the filter.

The paper prints no gains, so that a claim about a loop asks whether a controller exists. It is looked for by
differential evolution (R. Storn and K. Price, 1997) from a fixed seed, and then by the simplex of J. A. Nelder and
R. Mead (1965), over six numbers, in the box `BOX`:

    log10 |kp G(0)|,  log10 Ti,  log10 Td,  log10 (derivative filter / Td),  setpoint weight,  derivative weight

with Ti = kp / ki and Td = kd / kp. A controller whose loop is unstable, or exceeds the bounds on the maximum
sensitivity, is never simulated: its cost grows with its distance from the bounds alone. All others run in the sampled
loop with their limits. The bounds hold at the least and at the largest slope of a law, and with one sample more of
delay, in which a computer would work.

A search begins in the optimum that the last full one has left in `hysim/data/paper_optima.json`: a point of the box,
and its cost. The point is taken if it is proved anew: its loop keeps the bounds, its cost is the stored one to 1 %, and
neither a short differential evolution, with other random numbers, nor a simplex around it finds a cost that is less by
1 %. Otherwise the full search runs. `hysim reproduce --thorough` runs all full searches, and writes their optima as
``optima.json``, from which the stored file is copied.
"""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import differential_evolution, minimize

from hysim import signals
from hysim._basics.frozen import FloatArray, frozen
from hysim.control import PID, LinearLoop, RestingPlant, as_actuator, later, secant_gain, slopes
from hysim.datasets import PIXEL
from hysim.metrics import step_metrics
from hysim.plants.actuator import Actuator

Limits = tuple[float, float] | None
Starts = Mapping[str, Mapping[str, Any]]
"""Point and cost of a stored optimum by the name of its task."""
Effort = tuple[int, int, int]
"""Generations and population of a differential evolution, and controllers that the simplex may try."""
ComplexArray = npt.NDArray[np.complex128]

MAX_SENSITIVITY = 2.0
"""Largest maximum sensitivity of a loop that counts, as is commonly asked."""
WITH_DELAY = 1.25
"""How much larger it may be with one sample more of delay."""
BOX = ((-3.0, 3.0), (-2.0, 2.0), (-3.0, 2.0), (-4.0, 1.0), (0.0, 1.0), (0.0, 1.0))
"""Bounds of the search; times are in the plant's own unit."""
_LOW, _HIGH = np.array(BOX).T

_GENERATIONS = 24
_POPULATION = 6  # for each of the six numbers
_POLISH = 250
_SIMPLEXES = (0.03, 0.01)  # sizes, of the box
_UNSTABLE = 1e6  # cost of a loop that is not stable
_BEYOND = 1e3  # of one that exceeds a bound
_REFINED = {True: 1.0005, False: 1.01}  # margin for what lies between the frequencies of a grid, fine or not
_FINE, _SLOWEST = 1200, 1e-4  # frequencies of the fine grid, and the lowest in units of the highest
_SHARP = 2.5  # bound above which peaks may be too sharp for a grid
_AT_ONCE = 500_000  # samples of the loops that are simulated together
_CHECKED: Effort = (4, 4, 60)  # beside a stored optimum
_CHECK_SEED = 100  # of no full search
_EQUAL = 0.01  # part by which costs of one optimum may differ: 0.1 % of a loop's width, 0.02 % of a step's figures


@frozen
class Task:
    """A loop to be closed, and its cost.

    Parameters
    ----------
    plant : Actuator
    sample_time : float
        [the plant's unit of time]
    reference : array, shape (n,)
        [um]
    limits : tuple or None
        Lowest and highest voltage [V].
    cost : callable
        Of the displacement, shape (n,): the smaller, the better.
    slopes : tuple of float
        Least and largest slope of the law [um/V]; 1 without one.
    with_delay : bool
        Whether the loop has to bear one sample more of delay; a camera's frame of delay is in the plant.
    again : tuple of Actuator
        The plant behind other noises of its sensor; the cost is the mean.
    name : str
        Of its stored optimum.
    """

    plant: Actuator
    sample_time: float
    reference: FloatArray
    limits: Limits
    cost: Callable[[FloatArray], float]
    slopes: tuple[float, ...] = (1.0,)
    with_delay: bool = True
    again: tuple[Actuator, ...] = ()
    name: str = ""


class Found(NamedTuple):
    """The best controller of a search.

    Parameters
    ----------
    controller : PID
    max_sensitivity, with_delay : float
        The largest ``|1 / (1 + L)|``, and that with one sample more of delay.
    bound : float
        Bound on the first.
    controllers, simulations : int
        Number of controllers judged, and of those simulated.
    name : str
        Of the task.
    point : tuple of float
        The controller as a point of the box.
    cost : float
    is_stored : bool
        Whether the search began in the stored optimum, and found none that is better.
    """

    controller: PID
    max_sensitivity: float
    with_delay: float
    bound: float
    controllers: int
    simulations: int
    name: str
    point: tuple[float, ...]
    cost: float
    is_stored: bool = False

    @property
    def searched(self) -> str:
        """Extent of the search, in words."""
        where = "the stored optimum of a full search, and beside it" if self.is_stored else "a full search of"
        return f"{where} {self.controllers} PIDs"

    @property
    def box(self) -> str:
        """Controllers among which was searched, in words."""
        return (
            f"PIDs of kp G(0) 0.001 to 1000, Ti 0.01 to 100, Td 0.001 to 100, filter 0.0001 to 10 Td, both weights 0 "
            f"to 1, maximum sensitivity at most {self.bound:g}, and {WITH_DELAY * self.bound:g} with one sample more "
            "of delay."
        )


@frozen
class Gains:
    """Numbers of several PIDs, each of shape (m, 1)."""

    kp: FloatArray
    ki: FloatArray
    kd: FloatArray
    derivative_filter: FloatArray

    def response(self, z: ComplexArray, sample_time: float) -> ComplexArray:
        """As `PID.frequency_response`, shape (m, n)."""
        lag = self.derivative_filter + sample_time
        derivative = (self.kd / lag) * ((z - 1.0) / (z - self.derivative_filter / lag))
        return np.asarray(self.kp + self.ki * (sample_time / (z - 1.0)) + derivative)


class Robustness:
    """Largest sensitivities of a plant's loops, without and with one sample more of delay, unless that is no matter."""

    def __init__(
        self, plant: Any, sample_time: float, slopes: tuple[float, ...] = (1.0,), *, with_delay: bool = True
    ) -> None:
        actuator = as_actuator(plant)
        self.h, self.slopes = sample_time, slopes
        self.loops = [
            LinearLoop(each, sample_time) for each in (actuator, later(actuator, sample_time))[: 1 + with_delay]
        ]
        self.grids = [_grid(loop, loop.frequencies) for loop in self.loops]

    @cached_property
    def fine_grids(self) -> list[tuple[ComplexArray, ComplexArray]]:
        """Grids so fine that nothing lies between their frequencies, unless a pole is very lightly damped."""
        highest = math.pi / self.h
        between = np.geomspace(_SLOWEST * highest, highest, _FINE)
        return [_grid(loop, np.union1d(loop.frequencies, between)) for loop in self.loops]

    def of(self, controller: PID) -> tuple[float, float]:
        """Both, within 0.1 %; infinite if a loop is unstable."""
        each = [max(loop.max_sensitivity(controller, slope) for slope in self.slopes) for loop in self.loops]
        return each[0], each[-1]

    def excess(self, controller: PID, bound: float) -> float:
        """Part by which a bound is exceeded; 0 within the bounds."""
        first, second = self.of(controller)
        spare = WITH_DELAY if len(self.loops) > 1 else 1.0
        return max(0.0, min(max(first, second / spare) / bound - 1.0, _UNSTABLE))

    def over_bound(self, gains: Gains, bound: float, *, fine: bool = False) -> FloatArray:
        """Largest ratio of a sensitivity on a grid of frequencies to its bound, of many controllers at once.

        Whether the loops are stable is not looked at.
        """
        worst = np.zeros(gains.kp.size)
        grids = self.fine_grids if fine else self.grids
        for (z, plant), most in zip(grids, (bound, WITH_DELAY * bound), strict=False):
            response = plant * gains.response(z, self.h)
            for slope in self.slopes:
                worst = np.maximum(worst, 1.0 / (most * np.abs(1.0 + slope * response).min(axis=1)))
        return worst

    def are_stable(self, controllers: Sequence[PID]) -> npt.NDArray[np.bool_]:
        """Whether all loops of each controller are stable."""
        feedbacks = [controller.linear(self.h) for controller in controllers]
        each = [loop.are_stable(feedbacks, slope) for loop in self.loops for slope in self.slopes]
        return np.asarray(np.all(each, axis=0))


def _grid(loop: LinearLoop, frequencies: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Points of the unit circle at some frequencies, and the plant's response there."""
    return np.exp(1j * frequencies * loop.sample_time), loop.plant_at(frequencies)


def stored_starts() -> Starts:
    """The stored optima; empty if they belong to another box or another bound."""
    stored = json.loads((files("hysim") / "data" / "paper_optima.json").read_text(encoding="utf-8"))
    optima: Starts = stored.pop("optima")
    return optima if stored == _limits_of_search() else {}


def as_stored(every: Iterable[Found]) -> str:
    """The optima of full searches in the form in which they are stored."""
    optima = {each.name: {"point": each.point, "cost": each.cost} for each in every}
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(start)}" for name, start in optima.items())
    return f'{json.dumps(_limits_of_search())[:-1]}, "optima": {{\n{lines}\n}}}}\n'


def _limits_of_search() -> dict[str, Any]:
    return {"box": [list(side) for side in BOX], "max_sensitivity": MAX_SENSITIVITY, "with_delay": WITH_DELAY}


def optimum(task: Task, starts: Starts, **effort: Any) -> Found:
    """The stored optimum of a task if it still is one, else that of a full search with some effort."""
    return confirmed(task, starts) or search(task, **effort)


def confirmed(task: Task, starts: Starts, *, exact: bool = True, check: Effort = _CHECKED) -> Found | None:
    """The stored optimum of a task if it still is one; otherwise None, also without one."""
    if task.name not in starts:
        return None
    tried, stored = _Tried(task, MAX_SENSITIVITY, exact), starts[task.name]
    tried.is_polished = True
    point, (generations, population, polish) = np.array(stored["point"]), check
    cost = tried.cost(point)
    if not (cost < _BEYOND and math.isclose(cost, stored["cost"], rel_tol=_EQUAL)):
        return None
    others = [tried.evolved(point, generations, population, _CHECK_SEED).fun]
    others += [tried.descended(point, polish)[1]] if polish else []
    return tried.found(point, cost)._replace(is_stored=True) if min(others) >= (1.0 - _EQUAL) * cost else None


def search(
    task: Task,
    *,
    bound: float = MAX_SENSITIVITY,
    generations: int = _GENERATIONS,
    population: int = _POPULATION,
    polish: int = _POLISH,
    starts: Sequence[PID] = (),
    exact: bool = True,
    seed: int = 1,
) -> Found:
    """The controller of the least cost.

    Parameters
    ----------
    task : Task
        From `step_task` or `triangle_task`.
    bound : float
        On the maximum sensitivity.
    generations, population, polish : int
        Of the differential evolution, 0 to leave it out; its members for each of six numbers; and controllers that
        the simplex may try.
    starts : sequence of PID
        Controllers of which the best begins the search.
    exact : bool
        Whether the simplex goes to the bound itself, or keeps 1 % below it, which is faster.
    seed : int
        Of the random numbers.
    """
    tried = _Tried(task, bound, exact)
    start = None
    if starts:
        points = np.stack([tried.point(pid) for pid in starts], axis=1)
        start = points[:, int(np.argmin(tried.costs(points)))]
    if generations:
        start = tried.evolved(start, generations, population, seed).x
    if start is None:
        raise ValueError("a search without generations needs controllers to start from")
    tried.is_polished = True
    return tried.found(*tried.descended(start, polish))


class _Tried:
    """The cost of a point of the box, and how many were tried."""

    def __init__(self, task: Task, bound: float, exact: bool) -> None:
        self.task, self.bound = task, bound
        self.resting = [RestingPlant(plant, task.sample_time) for plant in (task.plant, *task.again)]
        self.robustness = Robustness(task.plant, task.sample_time, task.slopes, with_delay=task.with_delay)
        law = task.plant.hysteresis
        self.gain = task.plant.dc_gain * (1.0 if law is None else float(np.mean(task.slopes)))
        self.controllers = self.simulations = 0
        self.exact, self.is_polished = exact, False

    def controller(self, x: FloatArray) -> PID:
        size, Ti, Td, ratio = map(float, 10.0 ** x[:4])
        pid = PID.standard(size / self.gain, Ti=Ti, Td=Td, derivative_filter=ratio * Td, limits=self.task.limits)
        return replace(pid, setpoint_weight=float(x[4]), derivative_weight=float(x[5]))

    def point(self, pid: PID) -> FloatArray:
        """The point of a controller, or the nearest to it in the box."""
        kp = pid.kp or math.copysign(1e-9, self.gain)
        times = (kp / pid.ki if pid.ki else math.inf, pid.kd / kp, pid.derivative_filter / max(pid.kd / kp, 1e-9))
        x = [*np.log10(np.maximum([kp * self.gain, *times], 1e-9)), pid.setpoint_weight, pid.derivative_weight]
        return np.asarray(np.clip(x, _LOW, _HIGH))

    def evolved(self, start: FloatArray | None, generations: int, population: int, seed: int) -> Any:
        """The result of differential evolution, which begins in a point and in random ones."""
        return differential_evolution(
            self.costs,
            BOX,
            maxiter=generations,
            popsize=population,
            x0=start,
            seed=seed,
            tol=0.0,
            polish=False,
            vectorized=True,
            updating="deferred",
        )

    def found(self, point: FloatArray, cost: float) -> Found:
        controller = self.controller(point)
        tried = (self.controllers, self.simulations)
        sensitivities = self.robustness.of(controller)
        return Found(controller, *sensitivities, self.bound, *tried, self.task.name, tuple(point.tolist()), cost)

    def descended(self, start: FloatArray, polish: int) -> tuple[FloatArray, float]:
        """The best point that the simplex finds from another, and its cost; it begins anew once, on a smaller scale."""
        best, least = start, self.cost(start)
        for scale in _SIMPLEXES if polish else ():
            step = scale * (_HIGH - _LOW) * np.where(best > 0.5 * (_LOW + _HIGH), -1.0, 1.0)
            simplex = np.clip(best + np.vstack([np.zeros(len(BOX)), np.diag(step)]), _LOW, _HIGH)
            options = {"maxfev": polish // 2, "xatol": 1e-5, "fatol": 1e-9, "initial_simplex": simplex}
            end = minimize(self.cost, best, method="Nelder-Mead", bounds=BOX, options=options)
            if end.fun < least:
                best, least = end.x, float(end.fun)
        return best, least

    def cost(self, x: FloatArray) -> float:
        return float(self.costs(x[:, np.newaxis])[0])

    def costs(self, points: FloatArray) -> FloatArray:
        """Costs of many points, shape (6, m), at once."""
        self.controllers += points.shape[1]
        size, Ti, Td, ratio = 10.0 ** points[:4, :, np.newaxis]
        kp = size / self.gain
        gains = Gains(kp=kp, ki=kp / Ti, kd=kp * Td, derivative_filter=ratio * Td)
        fine = self.is_polished and self.exact
        over = _REFINED[fine] * self.robustness.over_bound(gains, self.bound, fine=fine)
        costs = _BEYOND + np.minimum(over - 1.0, _UNSTABLE)
        near = np.flatnonzero(over <= 1.0).tolist()
        pids = [self.controller(points[:, k]) for k in near]
        costs[near] = _BEYOND + _UNSTABLE
        stable = self.robustness.are_stable(pids) if pids else np.empty(0, dtype=bool)
        within = [(k, pid) for k, pid, is_stable in zip(near, pids, stable, strict=True) if is_stable]
        if fine and self.bound > _SHARP:
            for k, pid in within:
                costs[k] = _BEYOND + self.robustness.excess(pid, self.bound)
            within = [(k, pid) for k, pid in within if costs[k] == _BEYOND]
        block = max(1, _AT_ONCE // self.task.reference.size)
        for start in range(0, len(within), block):
            part = within[start : start + block]
            simulated = np.mean([self.simulated(resting, [pid for _, pid in part]) for resting in self.resting], axis=0)
            costs[[k for k, _ in part]] = simulated
        self.simulations += len(within)
        return costs

    def simulated(self, resting: RestingPlant, pids: Sequence[PID]) -> list[float]:
        """Costs of stable controllers with one noise."""
        displacements, lost = resting.attempt_each(pids, self.task.reference)
        return [self.task.cost(y) if sample < 0 else _UNSTABLE for y, sample in zip(displacements, lost, strict=True)]


def step_task(plant: Any, *, step: float, limits: Limits, duration: float, sample_time: float) -> Task:
    """A step from rest; its cost is the largest of three ratios of closed to open loop, in percent.

    They are those of `hysim.metrics.vibration_reduction`: overshoot, rms of the residual and settling time.
    """
    actuator = as_actuator(plant)
    n = round(duration / sample_time) + 1
    t = sample_time * np.arange(n)
    opened = RestingPlant(actuator, sample_time).driven(np.full(n, step / actuator.dc_gain))
    before = step_metrics(t, opened)
    slowest = float(np.min(np.abs(actuator.vibration.poles.real)))  # type: ignore[union-attr]
    begin = round(before.t98 / sample_time) + 1
    window = slice(begin, begin + round(2.0 * math.log(50.0) / slowest / sample_time))
    tail, settled = slice(n - n // 10, None), 0.02

    def ratios(y: FloatArray) -> tuple[float, float, float]:
        error = y / y[tail].mean() - 1.0
        outside = np.flatnonzero(np.abs(error) > settled)
        last = min(int(outside[-1]), n - 2) if outside.size else 0
        change = abs(error[last + 1] - error[last])
        settling = sample_time * (last + (abs(error[last]) - settled) / max(change, 1e-300))
        return max(0.0, float(error.max())), float(np.sqrt(np.mean(error[window] ** 2))), settling

    open_ratios = ratios(opened)

    def cost(y: FloatArray) -> float:
        off = abs(float(y[tail].mean()) / step - 1.0)
        if not off < settled:
            return 200.0 + min(100.0 * off, 500.0)
        return 100.0 * max(closed / max(own, 1e-12) for closed, own in zip(ratios(y), open_ratios, strict=True))

    return Task(plant=actuator, sample_time=sample_time, reference=np.full(n, step), limits=limits, cost=cost)


def triangle_task(
    plant: Any,
    *,
    low: float,
    high: float,
    period: float,
    limits: Limits,
    sample_time: float,
    cycles: int,
    skip: float = 0.0,
    tracking: float = 0.0,
) -> Task:
    """A triangle; its cost is the width of the last cycle's loop over its stroke, and how far it is from closed.

    `skip` is a time after the start of the cycle, and before its end, that does not count; `tracking` is the weight of
    the rms error.
    """
    actuator = as_actuator(plant)
    samples = round(period / sample_time)
    reference = signals.triangle(low, high, cycles=cycles, samples_per_cycle=samples)
    half, begin = samples // 2, round(skip / sample_time)

    def cost(y: FloatArray) -> float:
        last = y[-samples - 1 :]
        apart = np.abs(last[: half + 1] - last[half:][::-1])[begin:]
        error = tracking * float(np.sqrt(np.mean((reference[-samples - 1 :] - last)[begin:] ** 2))) if tracking else 0.0
        return float(apart.max() + apart[0] + error) / max(float(np.ptp(last)), 1e-12)

    along = slopes_along(actuator, reference[-samples - 1 :])
    return Task(plant=actuator, sample_time=sample_time, reference=reference, limits=limits, cost=cost, slopes=along)


def slopes_along(actuator: Actuator, cycle: FloatArray) -> tuple[float, ...]:
    """Least and largest slope of the law along a cycle of the reference [um/V]; 1 without a law."""
    if actuator.hysteresis is None:
        return (1.0,)
    return tuple(sorted(slopes(actuator, cycle / secant_gain(actuator, cycle))))


def volts_per_pixel(controller: PID, sample_time: float) -> float:
    """Jump of the command when the measurement moves by one pixel of the camera [V]."""
    return PIXEL * (abs(controller.kp) + abs(controller.kd) / (controller.derivative_filter + sample_time))
