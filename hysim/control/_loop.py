"""The verb `close_loop`: a sampled controller around a continuous actuator, or around a structure.

The open loop that it is compared with has the voltage reference / secant gain. The secant gain of a steady cycle is its
stroke over its voltage's span, which depends on the span: the gain g at which the cycle driven by ``cycle / g`` has the
gain f(g) = g. It is found by Brent's rule in the logarithms, between gains with a longer and with a shorter stroke.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cache
from typing import Any, TypeGuard

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only, vectors
from hysim._basics.printing import extent, frozen_result, quantity, summary_text
from hysim._basics.progress import Reports, along, reports
from hysim._basics.results import model_of
from hysim.control._controller import PID, Controller, SteppedController, begun, held_samples, limits_of, preview
from hysim.errors import SimulationError, warn_beyond, warn_limited
from hysim.laws.static import Line
from hysim.models.model import in_brief
from hysim.models.protocols import Remembering, Responding, standing
from hysim.plants.actuator import Actuator, as_actuator
from hysim.plants.chain import Signals
from hysim.plants.oscillator import BoucWenOscillator
from hysim.plants.stages import Amplifier
from hysim.plants.structures.assembly import ControlledStructure
from hysim.plants.structures.structure import Structure
from hysim.records import even_step
from hysim.simulation import columns_of, dataset_of_signals, frame_of_signals

_OF_REFERENCE = ("reference", "error", "y", "measurement")
_OF_COMMAND = ("command", "drive", "u")
_SHOWN = ("sample_time", "delay", "preview", "noise", "sensor_quantum", "voltage_noise_rms", "held_samples")


@frozen_result
class ClosedLoop:
    """Signals of a closed loop, each of shape (n,), and its conditions.

    Parameters
    ----------
    t : array
        Times of the samples [s].
    reference, error : array
        Reference, and reference minus measurement [unit of y].
    command, drive : array
        Command before and after the controller's limits, held until the next sample [unit of u].
    u : array
        Voltage at the law just after each new command, within the amplifier's limits [unit of u].
    z : array, or None
        Memory of the law just before each new command; None for a law without one.
    y, measurement : array
        True displacement just before each new command, and its measurement [unit of y].
    conditions : mapping
        plant, controller, sample_time [s], substeps, delay (of vibration and sensor) [s], preview [s], limits (of the
        controller), amplifier_limits, sensor_quantum, noise (rms), seed, u0, lowest_u, highest_u, limited_samples (at a
        limit of controller or amplifier), held_samples (at which the controller had no valid input, or no command, and
        held the last one), voltage_noise_rms and voltage_noise_peak (difference to the same loop without noise).
    units : mapping
        Labels of the units of ``"t"``, ``"u"`` and ``"y"``.
    signals : mapping
        Signals of a structure, just before each new command, by the names of `Structure.signals`; empty for others. Of
        a structure u is the force, and conditions and z of stages that it has not are zero or None.
    """

    t: FloatArray
    reference: FloatArray
    error: FloatArray
    command: FloatArray
    drive: FloatArray
    u: FloatArray
    z: FloatArray | None
    y: FloatArray
    measurement: FloatArray
    conditions: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    signals: Mapping[str, FloatArray] = field(default_factory=dict)

    def __str__(self) -> str:
        t, u, y = (self.units.get(signal, unit) for signal, unit in (("t", "s"), ("u", ""), ("y", "")))
        rms = float(np.sqrt(np.mean((self.reference - self.y) ** 2)))
        conditions = self.conditions
        lines = [f"ClosedLoop: {self.t.size} samples to {quantity(self.t[-1], t)}, tracking rms {quantity(rms, y)}"]
        rows = {
            "reference": extent(self.reference, y),
            "output": extent(self.y, y),
            "input": f"{extent(self.u, u)}, limited at {conditions.get('limited_samples', 'unknown')} samples",
            "plant": in_brief(conditions["plant"]) if "plant" in conditions else "",
            "controller": in_brief(conditions["controller"]) if "controller" in conditions else "",
            "conditions": ", ".join(
                f"{name.replace('_', ' ')} {conditions[name]:.4g}" for name in _SHOWN if conditions.get(name)
            ).replace("voltage", "input"),
        }
        return summary_text(lines, rows)

    @property
    def columns(self) -> dict[str, FloatArray]:
        """Signals as the columns of a table, each of shape (n,), t first; as in `Simulation.columns`."""
        named = (columns_of(name, values) for name, values in self._arrays.items())
        return {label: column for columns in named for label, column in columns.items()}

    def to_frame(self) -> Any:
        """The `columns` as a `pandas.DataFrame` over time, with ``attrs["units"]``; ImportError without pandas."""
        return frame_of_signals(self.columns, self._signal_units)

    def to_xarray(self) -> Any:
        """The signals as an `xarray.Dataset` along t, as in `Simulation.to_xarray`; ImportError without xarray."""
        return dataset_of_signals(self._arrays, self._signal_units)

    @property
    def _arrays(self) -> dict[str, FloatArray]:
        own = {name: vars(self)[name] for name in (*_OF_REFERENCE, *_OF_COMMAND, "z")}
        every = {"t": self.t, **own, **self.signals}
        return {name: values for name, values in every.items() if values is not None}

    @property
    def _signal_units(self) -> dict[str, str]:
        like = {**dict.fromkeys(_OF_REFERENCE, "y"), **dict.fromkeys(_OF_COMMAND, "u")}
        return {name: self.units[signal] for name, signal in like.items() if signal in self.units} | dict(self.units)


@reports
def close_loop(
    plant: Any,
    controller: Controller,
    t: npt.ArrayLike,
    reference: npt.ArrayLike,
    *,
    u0: float | None = None,
    substeps: int | None = None,
    ground_acceleration: npt.ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
    progress: Reports = None,
) -> ClosedLoop:
    """Run a sampled controller around an actuator or a structure.

    At every sample the controller reads the sensor and sends a command, which is held until the next. A controller
    without a valid input or a finite command holds the last one, as on a device; ``conditions["held_samples"]`` counts
    these samples. The plant between the samples is exact; behind an amplifier that takes time it is second order in the
    sub-step. Model a controller that needs a sample to compute by ``hs.Sensor(delay=sample_time)``.

    Parameters
    ----------
    plant : Actuator, law, linear plant, creep, amplifier, cascade of laws that ends with a TransferFunction, Structure
        Or a BoucWenOscillator, or the result of a fit. At rest at `u0` before the first sample, creep included. A
        structure with ``excitation="force"`` begins at its initial state; the controller acts by `influence` and reads
        `output`. An oscillator is a structure of one mass.
    controller : PID, TrackingController, InverseFeedforward, or anything with their ``compiled``
        At rest too. With a method ``ahead`` it gets the reference so many samples ahead, and at the end its last value.
    t, reference : array, shape (n,)
        Evenly spaced times, whose spacing is the controller's sample time [s], and the reference [unit of y].
    u0 : float, optional
        Command before the first sample [unit of u]. By default the one at which the memory of the plant's law holds,
        which of an identified law is the first input of its record; 0 for a plant without one.
    substeps : int, optional
        Per sample, behind an amplifier that takes time; by default as in `Actuator.response`. A structure has its own.
    ground_acceleration : array, shape (n,), optional
        Acceleration of the ground under a structure, linear between samples; all masses move with it [m/s^2].
    units : mapping, optional
        Labels of the units.
    progress : callable or False, optional
        Called as ``progress(done, total)`` with numbers of samples, in long runs; see `hysim.simulate`.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    SimulationError, TypeError, ValueError
        If the loop diverges, or passes 1e100, with the time; if the plant is not one, times are uneven, lengths differ,
        the plant cannot rest at `u0`, or options of an actuator are given for a structure or the other way round.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> run = hs.close_loop(lag, hs.PID(kp=4.0, ki=4.0), np.arange(0.0, 5.0, 0.01), np.ones(500))
    >>> round(float(run.y[-1]), 3), run.conditions["sample_time"]
    (1.0, 0.01)
    """
    times, r, h = sampled(t, reference)
    plant = model_of(plant)
    if isinstance(plant, BoucWenOscillator):
        plant = plant.to_structure()
    if isinstance(plant, Structure):
        if u0 or substeps is not None:
            raise ValueError("such a plant has its own initial_state and substeps: leave out u0 and substeps")
        quake = None if ground_acceleration is None else vectors(ground_acceleration=ground_acceleration, t=times)[0]
        resting = RestingPlant(plant, h, chain=ControlledStructure(plant, h, quake))
        return around(resting, controller, times, r, units, progress)
    actuator = as_actuator(plant)
    if ground_acceleration is not None:
        raise ValueError(f"only a Structure stands on the ground, got {type(plant).__name__} and ground_acceleration")
    run = around(RestingPlant(actuator, h, u0, substeps), controller, times, r, units, progress)
    warn_beyond(actuator.u_range, run.u, type(actuator.hysteresis).__name__)
    span = float(np.ptp(run.drive)) or np.inf
    jumps = int(np.count_nonzero(np.abs(np.diff(run.drive)) >= span))
    limited = run.conditions["limited_samples"]
    warn_limited(limited, run.u.size, may_invert=not isinstance(controller, PID), jumps=jumps)
    return run


def around(
    resting: "RestingPlant",
    controller: Controller,
    times: FloatArray,
    r: FloatArray,
    units: Mapping[str, str] | None = None,
    progress: Reports = None,
) -> ClosedLoop:
    """The loop around a plant, without the warnings of `close_loop`: measures of loops print what these say."""
    if not is_controller(model_of(controller)):
        raise TypeError(f"controller must be a PID or the like, got {type(controller).__name__}")
    chain, h = resting.chain, resting.sample_time
    signals = resting.run(controller, r, progress, float(times[0]))
    sensor, amplifier = chain.sensor, chain.amplifier
    within = amplifier.voltage(signals.command) == amplifier.gain * signals.command + amplifier.offset
    keeps = isinstance(controller, SteppedController) and controller.keeps_limits
    low, high = (limits_of(controller) if keeps else None) or (-math.inf, math.inf)
    at_end = ((signals.drive <= low) | (signals.drive >= high)) & (signals.drive != resting.u0)
    noise = np.zeros(1)
    if sensor.noise:
        silent = resting.quiet().attempt(controller, r)
        noise = signals.u - silent.u if silent.lost < 0 else np.array([math.nan])
    conditions = {
        "plant": resting.plant,
        "controller": controller,
        "sample_time": h,
        "substeps": chain.substeps,
        "delay": chain.delay + sensor.delay,
        "preview": preview(controller, h) * h,
        "limits": limits_of(controller),
        "amplifier_limits": amplifier.limits,
        "sensor_quantum": sensor.quantum,
        "noise": sensor.noise,
        "seed": sensor.seed if sensor.noise else None,
        "u0": resting.u0,
        "lowest_u": float(signals.u.min()),
        "highest_u": float(signals.u.max()),
        "limited_samples": int(np.count_nonzero((signals.drive != signals.command) | at_end | ~within)),
        "held_samples": signals.held,
        "voltage_noise_rms": float(np.sqrt(np.mean(noise**2))),
        "voltage_noise_peak": float(np.abs(noise).max()),
    }
    return ClosedLoop(
        t=times,
        reference=r,
        error=r - signals.measurement,
        z=resting.memory(signals),
        **{name: each for name, each in signals._asdict().items() if name in (*_OF_COMMAND, "y", "measurement")},
        conditions=conditions,
        units=units or {},
        signals=signals.others,
    )


class RestingPlant:
    """A sampled actuator, law or structure, at rest at the command `u0`, from which every loop starts."""

    def __init__(
        self, plant: Any, sample_time: float, u0: float | None = None, substeps: int | None = None, chain: Any = None
    ) -> None:
        self.plant: Any = plant if chain is not None else as_actuator(plant)
        self.sample_time, self.u0 = sample_time, standing(self.plant, u0)
        self.chain = self.plant.chain(sample_time, substeps) if chain is None else chain
        self.state = self.chain.rest(self.u0)
        self.y0 = self.chain.displacement(self.state)

    def quiet(self) -> "RestingPlant":
        """The plant whose sensor has no noise."""
        if self.plant.sensor is None:
            return self
        plant = replace(self.plant, sensor=replace(self.plant.sensor, noise=0.0))
        return RestingPlant(plant, self.sample_time, self.u0, self.chain.substeps)

    def run(
        self, controller: Controller, reference: FloatArray, progress: Reports = None, begin: float = 0.0
    ) -> Signals:
        """Signals of the loop that a controller closes from the time `begin` [s]; a SimulationError if it diverges."""
        signals = self.attempt(controller, reference, progress)
        if signals.lost >= 0:
            time = begin + signals.lost * self.sample_time
            raise SimulationError(f"the loop diverges at t = {time:g}: it is unstable")
        return signals

    def attempt(self, controller: Controller, reference: FloatArray, progress: Reports = None) -> Signals:
        """As `run`; where the loop diverges, the signals name the sample."""
        compiled = begun(controller, self.sample_time, self.u0, self.y0)
        ahead = known_ahead(controller, reference, self.sample_time)
        with along(progress or False):
            signals: Signals = self.chain.run(compiled, self.state, ahead)[0]
        return signals._replace(held=held_samples(compiled))

    def attempt_each(
        self, controllers: Sequence[Controller], reference: FloatArray
    ) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """Displacements (m, n) of the loops of controllers of one class, and the first sample that diverges, or -1."""
        compiled = [begun(each, self.sample_time, self.u0, self.y0) for each in controllers]
        displacements: tuple[FloatArray, npt.NDArray[np.int64]] = self.chain.run_each(compiled, self.state, reference)
        return displacements

    def memory(self, signals: Signals) -> FloatArray | None:
        """Memory of the law just before each new command; None for a law without one."""
        law = self.chain.hysteresis
        if not isinstance(law, Remembering):
            return None
        return law.memory(np.append(self.state.voltages[1], signals.v))[: -1 : self.chain.substeps]

    def driven(self, u: FloatArray) -> FloatArray:
        """Displacement under the commands `u`, without a controller."""
        return np.asarray(self.chain.driven(u, self.state)[0].y)


def sampled(t: npt.ArrayLike, reference: npt.ArrayLike) -> tuple[FloatArray, FloatArray, float]:
    """Times, reference and sample time; ValueError unless the times are even and as many."""
    r, times = vectors(reference=reference, t=t)
    return times, r, even_step(times)


def known_ahead(controller: object, reference: FloatArray, sample_time: float) -> FloatArray:
    samples = min(preview(controller, sample_time), reference.size)
    return read_only(np.append(reference[samples:], np.full(samples, reference[-1])))


def is_controller(value: Any) -> TypeGuard[Controller]:
    return isinstance(value, Controller) and not isinstance(value, Responding)


_CONVERGED = 1e-13  # of the gain
_ACCEPTED = 1e-9  # of the span, an error of the stroke: a law that jumps has no stroke between two others
_NO_STROKE = 1e-300  # of the span
_LONGEST_STEP = 16.0  # in the logarithm of the gain
_PROBED = [(0.0, 1e3**k) for k in range(4)]  # inputs of the first gain: a play does not move along the short ones
_CHORDS, _MOST_CHORDS = 50, 100_000  # of a stroke and of a cycle, of which slopes are taken: those of a step, too
_PERIODS = 96  # at most, until a driven cycle is steady
_STEADY = 1e-12  # of the stroke


def secant_gain(
    actuator: Actuator, cycle: FloatArray, sample_time: float | None = None, periods: int | None = None
) -> float:
    """Stroke over span of the steady cycle that the command `inverted` drives; limits of an amplifier do not count.

    `cycle` is one period of a reference. Without a sample time it is quasi-static: the law's, times the vibration's DC
    gain. With a number of periods the last of them stands for the steady cycle, which creep approaches slowly. A
    ValueError if the plant has no gain, or there is no such voltage.
    """
    from scipy.optimize import brentq  # imported where it is needed

    span = float(np.ptp(cycle))
    if actuator.hysteresis is None and sample_time is None:
        return _usable(actuator.dc_gain)
    if span == 0.0:
        raise ValueError("the reference stands still: a law has a secant gain along a stroke only")
    actuator = _unlimited(actuator)
    ranges = [actuator.u_range] if actuator.u_range else _PROBED
    chords = (np.diff(replace(actuator, amplifier=None).level(ends))[0] / np.ptp(ends) for ends in ranges)
    gain = _usable(actuator.dc_gain * float(next(filter(None, chords), 0.0)))

    @cache
    def excess(x: float) -> float:
        """Logarithm of the stroke over the span. It falls with the gain exp(x), which shortens the command."""
        y = steady_cycle(actuator, inverted(actuator, cycle, math.copysign(math.exp(x), gain)), sample_time, periods)
        return math.log(max(float(np.ptp(y)) / span, _NO_STROKE))

    near = math.log(abs(gain))
    step = math.copysign(min(abs(excess(near)), 1.0), excess(near))
    far = near + step
    while excess(near) * excess(far) > 0.0 and abs(step) < _LONGEST_STEP:
        step *= 2.0
        near, far = far, far + step
    best = brentq(excess, near, far, xtol=_CONVERGED) if excess(near) * excess(far) <= 0.0 else far
    if abs(excess(best)) > _ACCEPTED:
        raise ValueError(f"no command drives the plant along the reference: no steady cycle has its span, {span:g}")
    return math.copysign(math.exp(best), gain)


def inverted(actuator: Actuator, y: FloatArray, gain: float) -> FloatArray:
    """Commands for displacements `y` by a line of this gain: ``y / gain`` where the plant rests near zero at zero.

    Where it rests farther from there than the span of `y`, or zero is outside the range on which the law is known, the
    line goes through the displacement at the nearest command in this range.
    """
    actuator = _unlimited(actuator)
    volts, amplifier = float(actuator.voltage(0.0)), actuator.amplifier or Amplifier()
    known = volts if actuator.u_range is None else min(max(volts, actuator.u_range[0]), actuator.u_range[1])
    u0 = 0.0 if known == volts else amplifier.command(known)
    y0 = float(_driven(actuator, np.array([u0]), None)[0])
    return y / gain if u0 == 0.0 and abs(y0) <= np.ptp(y) else u0 + (y - y0) / gain


def _unlimited(actuator: Actuator) -> Actuator:
    amplifier = actuator.amplifier
    return actuator if amplifier is None else replace(actuator, amplifier=replace(amplifier, limits=None))


def steady_cycle(
    actuator: Actuator, u: FloatArray, sample_time: float | None, periods: int | None = None
) -> FloatArray:
    """Displacement over a period of the voltage `u` once it repeats, or over the last of some periods."""
    if periods is not None:
        return _driven(actuator, np.tile(u, periods), sample_time)[-u.size :]
    periods = 3
    while True:
        y = _driven(actuator, np.tile(u, periods), sample_time)
        last, before = y[-u.size :], y[-2 * u.size : -u.size]
        if periods >= _PERIODS or np.abs(last - before).max() <= _STEADY * max(float(np.ptp(last)), 1e-300):
            return last
        periods *= 2


def without_memory(actuator: Actuator, u: FloatArray) -> Actuator:
    """Actuator with its law replaced by a line of its secant gain over the steady cycle of `u`."""
    if actuator.hysteresis is None:
        return actuator
    voltage, level = _steady(actuator, u)
    slope = math.copysign(float(np.ptp(level) / np.ptp(voltage)), float(np.diff(level) @ np.diff(voltage)))
    offset = 0.5 * float(level.max() + level.min()) - slope * 0.5 * float(voltage.max() + voltage.min())
    return replace(actuator, hysteresis=Line(offset=offset, slope=slope))


def slopes(actuator: Actuator, u: FloatArray) -> tuple[float, float]:
    """Least and largest slope of the law along the steady cycle of `u`, jumps as ramps; one without a law."""
    if actuator.hysteresis is None:
        return 1.0, 1.0
    jumps = np.abs(np.diff(u, append=u[0]))
    chord = max(float(np.ptp(u)) / _CHORDS, float(jumps.sum()) / _MOST_CHORDS)
    places = np.cumsum(np.append(0.0, np.ceil(jumps / chord - 1e-9)))
    voltage, level = _steady(actuator, np.interp(np.arange(places[-1]), places, np.append(u, u[0])))
    steps = np.diff(voltage, append=voltage[0])
    local = np.diff(level, append=level[0])[steps != 0.0] / steps[steps != 0.0]
    return float(local.min()), float(local.max())


def _driven(actuator: Actuator, u: FloatArray, sample_time: float | None) -> FloatArray:
    if sample_time is not None:
        return actuator.response(u, sample_time)
    return np.asarray(replace(actuator, amplifier=None).dc_gain * actuator.level(u))


def _steady(actuator: Actuator, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Voltage and output of the law along the steady cycle of `u`; without the limits if all of it is beyond one."""
    voltage = actuator.voltage(u) if np.ptp(actuator.voltage(u)) else _unlimited(actuator).voltage(u)
    return voltage, steady_cycle(Actuator(hysteresis=actuator.hysteresis), voltage, None)


def _usable(gain: float) -> float:
    if not (math.isfinite(gain) and gain != 0.0):
        raise ValueError(
            f"the plant's gain is {gain}: no input drives it along the reference, as where it integrates; if its law "
            "is unsafe on smaller cycles, identify it with admissible=True, or take a sum of plays"
        )
    return gain
