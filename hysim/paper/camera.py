"""The camera in the loop: what remains of the two headline figures when the paper's own sensor closes it.

A camera gives one frame after the other, each read one frame late, in whole pixels, of an image that shakes:

    reading = quantum floor((y(t - 1 / frame rate) + noise) / quantum + 1/2),    noise white and normal, rms = shake

The controller runs once a frame. It is searched for every camera anew, in the loop with that noise, within a maximum
sensitivity of 2, the frame of delay included. The figures come from another noise than the search's, of the true
displacement and of the measured one: the triangle's from the mean width of the last `MEASURED` of ten cycles, since the
width of a single noisy one is an accident; the step's is the median over `NOISES` noises of the least of its three
reductions.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hysim import signals
from hysim._frozen import FloatArray, frozen
from hysim.control import PID, RestingPlant, as_actuator, open_loop
from hysim.datasets import PIXEL
from hysim.metrics import VibrationReduction, reduction_percent, rmse, vibration_reduction
from hysim.paper.equations import EQUATION_4
from hysim.paper.loops import ABOUT_34_V, HIGH, PERIOD, SAMPLE_TIME, SUPPLY, law_plant
from hysim.paper.reidentification import SAMPLE_SECONDS
from hysim.paper.search import Found, Task, search, step_task, triangle_task
from hysim.plants.actuator import Actuator
from hysim.plants.sensor import Sensor

FRAME_RATES = (10.0, 30.0, 100.0, 1000.0)
SENSORS = ((0.0, 0.0), (0.1, 0.0), (0.1, 0.03), (0.1, 0.1), (1.0, 0.0), (1.0, 0.31))
"""Quantum and rms shake of the readings [pixels], the worse the later: an ideal sensor first, the camera last."""
CYCLES, MEASURED = 10, 5
NOISES = 15  # of a step
LOW = 0.1  # of the triangle [um]

_Effort = tuple[int, int, int]
_FIRST: _Effort = (30, 6, 250)  # generations, population and polish of an ideal sensor's search
_NEXT: _Effort = (5, 4, 50)  # of the others', from their neighbours
_FAST: _Effort = (0, 4, 30)  # of the camera of 1000 Hz, whose simulations take long
_COMPARED: _Effort = (0, 4, 0)  # of the controllers of all sensors, in the end
_SHORT, _SKIPPED = 0.005, 2.0  # frames that leave time for one cycle only, and its begin that does not count [s]
_SCALES = (1.0, 0.4)  # gains of the starts over those of a neighbour
_RECORD = 160.0  # of a step [samples of Table 2]
_SEED = 10  # of the first noise that is measured; the search has those from 0 on
_AGAIN = 9  # noises behind which controllers are compared in the end
_FEW = 3  # at 1000 Hz, and behind which those of a step are searched below 100 Hz


@frozen
class CameraLoop:
    """One camera in one loop.

    Parameters
    ----------
    plant : str
    frame_rate : float
        [Hz]
    quantum, shake : float
        Step of the readings [um], and rms noise [pixels].
    found : Found
        The search that gave the controller.
    true_reduction_percent, measured_reduction_percent : float
        Of the loop's relative width, or the least of the three figures of a step [%].
    tracking_rms : float
        Of the true displacement [um].
    saturated_percent : float
        Share of samples at a limit [%].
    reference, y : array, shape (n,)
        The last cycle or the step, and the true displacement [um].
    """

    plant: str
    frame_rate: float
    quantum: float
    shake: float
    found: Found
    true_reduction_percent: float
    measured_reduction_percent: float
    tracking_rms: float
    saturated_percent: float
    reference: FloatArray
    y: FloatArray


def hysteresis_cameras(law: Any) -> list[CameraLoop]:
    """Every camera on the hysteresis of a law before (7); laws as `loops` takes them."""
    return _Triangle(law).loops()


def vibration_cameras() -> list[CameraLoop]:
    """Every camera on the vibration of (4)."""
    return _Step().loops()


def camera_measures(loops: Sequence[CameraLoop]) -> list[dict[str, Any]]:
    """The rows under "camera" in `summary.json`."""
    return [
        {
            "plant": loop.plant,
            "measure": "width of the loop" if loop.plant != "eq4" else "least of overshoot, residual and settling time",
            "frame_rate_hz": loop.frame_rate,
            "delay_frames": 1,
            "quantum_um": loop.quantum,
            "shake_px": loop.shake,
            "true_reduction_percent": loop.true_reduction_percent,
            "measured_reduction_percent": loop.measured_reduction_percent,
            "tracking_rms_um": loop.tracking_rms,
            "saturated_percent": loop.saturated_percent,
            "max_sensitivity": loop.found.max_sensitivity,
        }
        for loop in loops
    ]


class _Cameras:
    """Base of both references: a controller for every camera, searched near those of its neighbours."""

    name: str
    unit: float  # of time [s]
    task: Callable[[Actuator, float], Task]
    judged: Callable[[float, float, float, Found, Any], CameraLoop]
    plant: Actuator
    searched = 1  # noises behind which a controller is searched

    def loops(self) -> list[CameraLoop]:
        """Every frame rate with every sensor."""
        rows: list[CameraLoop] = []
        slower: list[PID] = []
        for rate in FRAME_RATES:
            found = self.found(rate, slower)
            slower = [self.kept(each.controller, rate) for each in found]
            rows += [
                self.judged(rate, *sensor, best, self.with_camera(rate, *sensor, _SEED))
                for sensor, best in zip(SENSORS, found, strict=True)
            ]
        return rows

    def found(self, rate: float, slower: Sequence[PID]) -> list[Found]:
        """A search for every sensor, and then the best of all that were found, behind several noises.

        `slower` are the controllers of a camera of a smaller rate.
        """
        ideal, is_fast = self.task(self.plant, self.frame(rate)), rate > 100.0
        pids: list[PID] = []
        for k, sensor in enumerate(SENSORS):
            starts = _scaled([*pids[:1], *pids[-1:], *slower[k : k + 1], *slower[:1]])
            effort = _FAST if is_fast else _NEXT if pids else _FIRST
            task = self.seen(ideal, rate, *sensor, 1 if rate >= 100.0 else self.searched)
            pids.append(_searched(task, starts, effort).controller)
        tasks = [self.seen(ideal, rate, *sensor, _FEW if is_fast else _AGAIN) for sensor in SENSORS]
        return [_searched(task, [*pids, *slower[k : k + 1]], _COMPARED) for k, task in enumerate(tasks)]

    def seen(self, task: Task, rate: float, quantum: float, shake: float, noises: int) -> Task:
        """A task behind a camera, with several noises if it shakes."""
        plants = [self.with_camera(rate, quantum, shake, seed) for seed in range(noises if shake else 1)]
        return replace(task, plant=plants[0], again=tuple(plants[1:]))

    def kept(self, pid: PID, rate: float) -> PID:
        """The controller for a camera of many times the rate, its derivative as smooth as before."""
        return replace(pid, derivative_filter=pid.derivative_filter + 0.7 * self.frame(rate))

    def frame(self, rate: float) -> float:
        """Time from frame to frame [the plant's unit]."""
        return 1.0 / (rate * self.unit)

    def with_camera(self, rate: float, quantum: float, shake: float, seed: int) -> Actuator:
        """The plant behind this camera."""
        sensor = Sensor(quantum=quantum * PIXEL, noise=shake * PIXEL, delay=self.frame(rate), seed=seed)
        return replace(self.plant, sensor=sensor)


def _searched(task: Task, starts: Sequence[PID], effort: _Effort) -> Found:
    generations, population, polish = effort
    return search(task, starts=starts, exact=False, generations=generations, population=population, polish=polish)


def _scaled(neighbours: Sequence[PID]) -> list[PID]:
    """Controllers to start from: of the ideal sensor, of the sensor before, and of the slower camera's sensors."""
    return [
        replace(pid, kp=part * pid.kp, ki=part * pid.ki, kd=part * pid.kd) for part in _SCALES for pid in neighbours
    ]


class _Triangle(_Cameras):
    def __init__(self, law: Any) -> None:
        self.name, self.unit, self.plant = "bouc-wen+eq7", 1.0, law_plant(law)
        samples = round(PERIOD / SAMPLE_TIME)
        reference = signals.triangle(LOW, HIGH, cycles=CYCLES, samples_per_cycle=samples)
        opened = open_loop(self.plant, reference, SAMPLE_TIME, samples)
        self.open_t, self.open_y = opened.t, opened.y
        self.open_width = _width(self.open_y, samples)

    def task(self, plant: Actuator, frame: float) -> Task:
        cycles, skip = (1, _SKIPPED) if frame < _SHORT else (2, 0.0)
        task = triangle_task(
            plant, low=LOW, high=HIGH, period=PERIOD, limits=SUPPLY, sample_time=frame, cycles=cycles, skip=skip,
            tracking=1.0,
        )  # fmt: skip
        return replace(task, with_delay=False)

    def judged(self, rate: float, quantum: float, shake: float, found: Found, plant: Actuator) -> CameraLoop:
        frame = self.frame(rate)
        samples = round(PERIOD / frame)
        reference = signals.triangle(LOW, HIGH, cycles=CYCLES, samples_per_cycle=samples)
        run = RestingPlant(plant, frame).run(found.controller, reference)
        opened = np.interp(frame * np.arange(reference.size), self.open_t, self.open_y)
        seen = replace(plant.sensor or Sensor(), delay=0.0).measure(np.append(opened[:1], opened[:-1]))
        last = slice(-samples - 1, None)
        return CameraLoop(
            plant=self.name,
            frame_rate=rate,
            quantum=quantum * PIXEL,
            shake=shake,
            found=found,
            true_reduction_percent=reduction_percent(self.open_width, _width(run.y, samples)),
            measured_reduction_percent=reduction_percent(_width(seen, samples), _width(run.measurement, samples)),
            tracking_rms=rmse(reference[-MEASURED * samples :], run.y[-MEASURED * samples :]),
            saturated_percent=100.0 * float(np.mean(run.drive != run.command)),
            reference=reference[last],
            y=run.y[last],
        )


def _width(y: FloatArray, samples: int) -> float:
    """Mean relative width of the last cycles of a symmetric triangle."""
    half, cycles = samples // 2, y[-MEASURED * samples - 1 : -1].reshape(MEASURED, samples)
    rising, falling = cycles[:, : half + 1], np.column_stack([cycles[:, half:], np.append(cycles[1:, 0], y[-1])])
    widths = np.abs(rising - falling[:, ::-1]).max(axis=1)
    return float(np.mean(widths / np.ptp(cycles, axis=1)))


class _Step(_Cameras):
    searched = _FEW

    def __init__(self) -> None:
        self.name, self.unit, self.plant = "eq4", SAMPLE_SECONDS, as_actuator(EQUATION_4)
        self.decay = float(np.min(-EQUATION_4.poles.real))

    def task(self, plant: Actuator, frame: float) -> Task:
        task = step_task(plant, step=-1.0, limits=ABOUT_34_V, duration=_RECORD, sample_time=frame)
        return replace(task, with_delay=False)

    def judged(self, rate: float, quantum: float, shake: float, found: Found, plant: Actuator) -> CameraLoop:
        frame = self.frame(rate)
        t = frame * np.arange(round(_RECORD / frame) + 1)
        reference = np.full(t.size, -1.0)
        opened = RestingPlant(self.plant, frame).driven(reference / self.plant.dc_gain)
        figures = []
        for noise in range(NOISES if shake else 1):
            sensor = replace(plant.sensor or Sensor(), seed=_SEED + noise)
            run = RestingPlant(replace(plant, sensor=sensor), frame).run(found.controller, reference)
            seen = replace(sensor, delay=0.0).measure(np.append(opened[:1], opened[:-1]))
            pairs = ((opened, run.y), (seen, run.measurement))
            figures.append([_least(vibration_reduction(t, *pair, decay_rate=self.decay)) for pair in pairs])
        true, measured = (_middle([row[k] for row in figures]) for k in range(2))
        return CameraLoop(
            plant=self.name,
            frame_rate=rate,
            quantum=quantum * PIXEL,
            shake=shake,
            found=found,
            true_reduction_percent=true,
            measured_reduction_percent=measured,
            tracking_rms=rmse(reference, run.y),
            saturated_percent=100.0 * float(np.mean(run.drive != run.command)),
            reference=reference,
            y=run.y,
        )


def _middle(figures: Sequence[float]) -> float:
    """The median, a loop that does not settle counted as the worst; nan if the median is one of these."""
    middle = float(np.median([-math.inf if math.isnan(figure) else figure for figure in figures]))
    return middle if math.isfinite(middle) else math.nan


def _least(reduction: VibrationReduction) -> float:
    """The least of the three figures; nan where the loop does not settle within 2 %."""
    return float(
        np.min(
            [
                reduction.overshoot_reduction_percent,
                reduction.residual_rms_reduction_percent,
                reduction.settling_time_reduction_percent,
            ]
        )
    )
