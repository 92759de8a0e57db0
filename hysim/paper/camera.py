"""The camera in the loop: what remains of the two headline figures when the paper's own sensor closes it.

A camera gives one frame after the other, each read one frame late, in whole pixels, of an image that shakes:

    reading = quantum floor((y(t - 1 / frame rate) + noise) / quantum + 1/2),    noise white and normal, rms = shake

The controller runs once a frame. It is searched for every camera anew, in the loop with that noise, within a maximum
sensitivity of 2, the frame of delay included; a search begins in its stored optimum, as `hysim.paper.search` says. The
figures come from another noise than the search's, of the true displacement and of the measured one: the triangle's from
the mean width of the last `MEASURED` of ten cycles, since the width of a single noisy one is an accident; the step's is
the median over `NOISES` noises of the least of its three reductions.

Where the motion repeats, its reference can be learned from the readings of whole repetitions, each from rest: by a
controller that knows the mean slope of the law and the linear model, and nothing of the hysteresis. The step is then a
motion of 2.5 samples of Table 2, known ahead. The true displacement of the last repetition is measured, and the median
over three noises counts.

The reduction of the hysteresis also depends on the triangle's period and on the controller's sample time, so that it is
a curve and not a number: the largest closed width sits in the corner where the triangle turns, and is about the
reference's rate times the time that the loop needs. A slower triangle, or a faster loop, gives any reduction.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hysim import signals
from hysim._basics.frozen import FloatArray, frozen
from hysim.control import (
    PID,
    InverseFeedforward,
    IterativeLearning,
    RestingPlant,
    TrackingController,
    as_actuator,
    close_loop,
    open_loop,
    secant_gain,
)
from hysim.datasets import PIXEL
from hysim.laws.static import Line
from hysim.metrics import VibrationReduction, loop_metrics, reduction_percent, rmse, vibration_reduction
from hysim.paper.equations import EQUATION_4
from hysim.paper.loops import ABOUT_34_V, HIGH, PERIOD, REDUCTIONS, SAMPLE_TIME, SUPPLY, HysteresisCase, law_plant
from hysim.paper.reidentification import SAMPLE_SECONDS
from hysim.paper.search import Effort, Found, Starts, Task, confirmed, search, step_task, triangle_task
from hysim.plants.actuator import Actuator
from hysim.plants.stages import Sensor

FRAME_RATES = (10.0, 30.0, 100.0, 1000.0)
SENSORS = ((0.0, 0.0), (0.1, 0.0), (0.1, 0.03), (0.1, 0.1), (1.0, 0.0), (1.0, 0.31))
"""Quantum and rms shake of the readings [pixels], the worse the later: an ideal sensor first, the camera last."""
CYCLES, MEASURED = 10, 5
NOISES = 15  # of a step
LOW = 0.1  # of the triangle [um]
PERIODS = (13.0, 26.0, 52.0, 104.0, 260.0, 520.0)
"""Periods of the triangle in the curves [s]."""

TARGETS = {"bouc-wen+eq7": ("90 % of the hysteresis", 89.5), "eq4": ("97 % of the vibration", 96.5)}
"""The two headline figures by their plant, and what rounds to them [%]."""

_FIRST: Effort = (30, 6, 250)  # of an ideal sensor's search
_NEXT: Effort = (5, 4, 50)  # of the others', from their neighbours
_FAST: Effort = (0, 4, 30)  # of the camera of 1000 Hz, whose simulations take long
_COMPARED: Effort = (0, 4, 0)  # of the controllers of all sensors, in the end
_CHECKED: Effort = (1, 2, 0)  # beside a stored optimum
_SHORT, _SKIPPED = 0.005, 2.0  # frames that leave time for one cycle only, and its begin that does not count [s]
_Camera = tuple[float, float, float]  # frame rate, quantum and shake
_SCALES = (1.0, 0.4)  # gains of the starts over those of a neighbour
_RECORD = 160.0  # of a step [samples of Table 2]
_SEED = 10  # of the first noise that is measured; the search has those from 0 on
_AGAIN = 9  # noises behind which controllers are compared in the end
_FEW = 3  # at 1000 Hz, and behind which those of a step are searched below 100 Hz
_CURVE_CYCLES = 3  # of the curves; the last one is steady: no loop needs more than a second
_OPEN_SAMPLES = 1300  # of a cycle in open loop

TRIALS = 30
_GAIN = 0.2  # of the learning; the model is exact here, as it is in the searches of the feedbacks
_HARMONICS = 20  # of the triangle's half period, that are learned
_MOTION = 2.5  # of a step that is learned [samples of Table 2]
_CUTOFF, _LARGEST_CUTOFF = 5.0, 0.4  # for steps [1 / sample of Table 2], and at most this part of half the frame rate
_OWN: dict[str, Any] = {"quantum": SENSORS[-1][0] * PIXEL, "shake": SENSORS[-1][1], "trials": TRIALS}


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
    found : Found, optional
        The search that gave the controller; None where a reference is learned.
    trials : int
        Repetitions from which it is learned.
    true_reduction_percent, measured_reduction_percent : float
        Of the loop's relative width, or the least of the three figures of a step [%].
    tracking_rms : float
        Of the true displacement [um].
    saturated_percent : float
        Share of samples at a limit [%].
    """

    plant: str
    frame_rate: float
    quantum: float
    shake: float
    found: Found | None = None
    trials: int = 0
    true_reduction_percent: float
    measured_reduction_percent: float = math.nan
    tracking_rms: float
    saturated_percent: float


def learned_triangles(law: Any) -> list[CameraLoop]:
    """The paper's own camera, up to 100 frames a second, where the reference is learned; laws as `loops` takes them."""
    return [_learned_triangle(law, rate) for rate in FRAME_RATES[:-1]]


def learned_steps() -> list[CameraLoop]:
    return [_learned_step(rate) for rate in FRAME_RATES[:-1]]


def _learned_triangle(law: Any, rate: float) -> CameraLoop:
    plant, h, samples = law_plant(law), 1.0 / rate, round(PERIOD * rate)
    reference = signals.triangle(LOW, HIGH, cycles=2, samples_per_cycle=samples)
    before = open_loop(plant, reference, h, samples).loop.relative_width

    def reduction(y: FloatArray) -> float:
        last = slice(-samples - 1, None)
        return reduction_percent(before, loop_metrics(reference[last], y[last]).relative_width)

    line = Line(slope=secant_gain(plant, reference[:samples]) / plant.dc_gain)
    cutoff = 2.0 * math.pi * _HARMONICS / (0.5 * PERIOD)
    controller = TrackingController(feedforward=InverseFeedforward(law=line), preview=True, limits=SUPPLY)
    figures = _learned(plant, h, controller, cutoff, reference, reduction)
    return CameraLoop(plant="bouc-wen+eq7", frame_rate=rate, **_OWN, **figures)


def _learned_step(rate: float) -> CameraLoop:
    plant, h, decay = as_actuator(EQUATION_4), 1.0 / (rate * SAMPLE_SECONDS), float(np.min(-EQUATION_4.poles.real))
    t = h * np.arange(round(_RECORD / h) + 1)
    part = np.clip(t / _MOTION, 0.0, 1.0)
    opened = RestingPlant(plant, h).driven(np.full(t.size, -1.0 / plant.dc_gain))
    controller = TrackingController(
        feedforward=InverseFeedforward(law=Line(slope=plant.dc_gain)), preview=True, limits=ABOUT_34_V
    )
    cutoff = min(_CUTOFF, _LARGEST_CUTOFF * math.pi / h)
    motion = np.sin(2.0 * math.pi * part) / (2.0 * math.pi) - part
    figures = _learned(
        plant, h, controller, cutoff, motion, lambda y: _least(vibration_reduction(t, opened, y, decay_rate=decay))
    )
    return CameraLoop(plant="eq4", frame_rate=rate, **_OWN, **figures)


def _learned(
    plant: Actuator,
    h: float,
    controller: TrackingController,
    cutoff: float,
    reference: FloatArray,
    reduction: Callable[[FloatArray], float],
) -> dict[str, Any]:
    """Figures of the last repetition of a reference that is learned from the paper's camera, at a sample time."""
    (quantum, shake), figures = SENSORS[-1], []
    sensor = Sensor(quantum=quantum * PIXEL, noise=shake * PIXEL, delay=h)
    read, stroke = replace(plant, sensor=sensor), (float(reference.min()), float(reference.max()))
    learner = IterativeLearning(
        controller=controller, model=read, stroke=stroke, cutoff=cutoff, gain=_GAIN, uncertainty=0.0
    )
    for seed in range(_SEED, _SEED + _FEW):
        read = replace(plant, sensor=replace(sensor, seed=seed))
        trials = learner.learn(read, h * np.arange(reference.size), reference, trials=TRIALS)
        run = close_loop(plant, controller, trials.t, trials.reference + trials.corrections[-1])
        lead = (run.t.size - reference.size) // 3
        y = run.y[lead : lead + reference.size]
        figures.append((reduction(y), rmse(reference, y), 100.0 * float(np.mean(run.drive != run.command))))
    true, rms, limited = (_middle(column) for column in zip(*figures, strict=True))
    return {"true_reduction_percent": true, "tracking_rms": rms, "saturated_percent": limited}


def hysteresis_cameras(law: Any, starts: Starts) -> list[CameraLoop]:
    """Every camera on the hysteresis of a law before (7); laws as `loops` takes them."""
    plant = law_plant(law)
    in_a_cycle = round(PERIOD / SAMPLE_TIME)
    opened = open_loop(plant, _triangle(in_a_cycle), SAMPLE_TIME, in_a_cycle)
    open_width = _width(opened.y, in_a_cycle)

    def task(frame: float) -> Task:
        cycles, skip = (1, _SKIPPED) if frame < _SHORT else (2, 0.0)
        return triangle_task(
            plant, low=LOW, high=HIGH, period=PERIOD, limits=SUPPLY, sample_time=frame, cycles=cycles, skip=skip,
            tracking=1.0,
        )  # fmt: skip

    def measured(task: Task, pid: PID) -> dict[str, Any]:
        samples = round(PERIOD / task.sample_time)
        reference, last = _triangle(samples), slice(-MEASURED * samples, None)
        before = np.interp(task.sample_time * np.arange(reference.size), opened.t, opened.y)
        run, reading = next(_runs(task, pid, reference, before))
        return {
            "true_reduction_percent": reduction_percent(open_width, _width(run.y, samples)),
            "measured_reduction_percent": reduction_percent(_width(reading, samples), _width(run.measurement, samples)),
            "tracking_rms": rmse(reference[last], run.y[last]),
            "saturated_percent": 100.0 * float(np.mean(run.drive != run.command)),
        }

    return _cameras("bouc-wen+eq7", 1.0, 1, task, measured, starts)


def vibration_cameras(starts: Starts) -> list[CameraLoop]:
    """Every camera on the vibration of (4)."""
    plant = as_actuator(EQUATION_4)
    decay = float(np.min(-EQUATION_4.poles.real))

    def task(frame: float) -> Task:
        return step_task(plant, step=-1.0, limits=ABOUT_34_V, duration=_RECORD, sample_time=frame)

    def measured(task: Task, pid: PID) -> dict[str, Any]:
        t = task.sample_time * np.arange(round(_RECORD / task.sample_time) + 1)
        reference = np.full(t.size, -1.0)
        opened = RestingPlant(plant, task.sample_time).driven(reference / plant.dc_gain)
        figures = []
        for run, camera_open in _runs(task, pid, reference, opened):
            pairs = ((opened, run.y), (camera_open, run.measurement))
            figures.append([_least(vibration_reduction(t, *pair, decay_rate=decay)) for pair in pairs])
        true, by_camera = (_middle([row[k] for row in figures]) for k in range(2))
        return {
            "true_reduction_percent": true,
            "measured_reduction_percent": by_camera,
            "tracking_rms": rmse(reference, run.y),
            "saturated_percent": 100.0 * float(np.mean(run.drive != run.command)),
        }

    return _cameras("eq4", SAMPLE_SECONDS, _FEW, task, measured, starts)


def camera_rows(loops: Sequence[CameraLoop]) -> list[dict[str, Any]]:
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
            "max_sensitivity": math.nan if loop.found is None else loop.found.max_sensitivity,
            "trials": loop.trials,
        }
        for loop in loops
    ]


def with_own_camera(plant: str, cameras: Sequence[CameraLoop]) -> CameraLoop | None:
    """The best loop with the paper's own pixels and shake; None if no such loop settles."""
    quantum, shake = SENSORS[-1]
    own = [each for each in cameras if (each.plant, each.quantum, each.shake) == (plant, quantum * PIXEL, shake)]
    settled = [each for each in own if math.isfinite(each.true_reduction_percent)]
    return max(settled, key=lambda each: each.true_reduction_percent, default=None)


def needed(plant: str, cameras: Sequence[CameraLoop]) -> str:
    """The slowest and coarsest sensor tried that reaches a headline figure, in a sentence."""
    name, least = TARGETS[plant]
    rows = [each for each in cameras if each.plant == plant]
    enough = [each for each in rows if each.true_reduction_percent >= least]
    what = (
        f"an ideal sensor of {min(each.frame_rate for each in enough):g} Hz" if enough else "more than any sensor tried"
    )
    if real := [each for each in enough if each.quantum > 0.0]:
        worst = max(real, key=lambda each: (-each.frame_rate, each.shake, each.quantum))
        shaking = f"shakes by {worst.shake:g} pixel" if worst.shake else "does not shake"
        what = (
            f"readings in steps of {worst.quantum:.4f} µm ({worst.quantum / PIXEL:g} pixel), "
            f"{worst.frame_rate:g} times a second, of an image that {shaking}"
        )
    best = with_own_camera(plant, cameras)
    camera = "let no loop settle"
    if best is not None:
        camera = f"reach {best.true_reduction_percent:.0f} % at best, at {best.frame_rate:g} frames a second"
    return f"{name} needs {what}; the paper's own pixels and shake {camera}."


def period_rows(law: Any, fast: HysteresisCase, cameras: Sequence[CameraLoop]) -> list[dict[str, float]]:
    """Reductions over the period of the triangle, with an ideal sensor and no delay [%].

    The controllers are that of 10 ms, and those that were searched for ideal cameras of up to 100 Hz.
    """
    plant = law_plant(law)
    cycle = signals.triangle(LOW, HIGH, cycles=_CURVE_CYCLES, samples_per_cycle=_OPEN_SAMPLES)
    open_widths = [
        open_loop(plant, cycle, period / _OPEN_SAMPLES, _OPEN_SAMPLES).loop.relative_width for period in PERIODS
    ]

    def closed_width(pid: PID, sample_time: float, period: float) -> float:
        samples = 2 * round(0.5 * period / sample_time)
        reference = signals.triangle(LOW, HIGH, cycles=_CURVE_CYCLES, samples_per_cycle=samples)
        y = RestingPlant(plant, sample_time).run(pid, reference).y
        return loop_metrics(reference[-samples - 1 :], y[-samples - 1 :]).relative_width

    ideal = [each for each in cameras if each.plant == fast.plant and not (each.quantum or each.shake)]
    controllers = [
        (SAMPLE_TIME, fast.found.controller),
        *((1.0 / each.frame_rate, each.found.controller) for each in ideal if each.found and each.frame_rate <= 100.0),
    ]
    return [
        {
            "sample_time_s": sample_time,
            "period_s": period,
            "reduction_percent": reduction_percent(before, closed_width(pid, sample_time, period)),
        }
        for sample_time, pid in controllers
        for period, before in zip(PERIODS, open_widths, strict=True)
    ]


def _cameras(
    plant: str,
    unit: float,
    noises: int,
    make_task: Callable[[float], Task],
    measured: Callable[[Task, PID], dict[str, Any]],
    starts: Starts,
) -> list[CameraLoop]:
    """Every frame rate with every sensor, in a unit of time [s]."""
    ideals = {rate: replace(make_task(1.0 / (rate * unit)), with_delay=False) for rate in FRAME_RATES}
    tasks = {
        (rate, *sensor): replace(
            _behind(ideal, sensor, _FEW if rate > 100.0 else _AGAIN),
            name=f"{plant}, camera of {rate:g} Hz, steps of {sensor[0]:g} px, shake {sensor[1]:g} px",
        )
        for rate, ideal in ideals.items()
        for sensor in SENSORS
    }
    controllers: dict[_Camera, Found] = {}
    for camera, task in tasks.items():
        best = confirmed(task, starts, exact=False, check=_CHECKED)
        if best is None:
            controllers = _searched_all(ideals, tasks, noises)
            break
        controllers[camera] = best
    loops: list[CameraLoop] = []
    for (rate, quantum, shake), best in controllers.items():
        task = _behind(ideals[rate], (quantum, shake), NOISES, seed=_SEED)
        figures, step = measured(task, best.controller), quantum * PIXEL
        loops.append(CameraLoop(plant=plant, frame_rate=rate, quantum=step, shake=shake, found=best, **figures))
    return loops


def _searched_all(ideals: Mapping[float, Task], tasks: Mapping[_Camera, Task], noises: int) -> dict[_Camera, Found]:
    """The best controller of each camera; it is searched near its neighbours', with a few noises if they are slow.

    In the end the best of all that were found is taken, by its task behind several noises.
    """
    controllers: dict[_Camera, Found] = {}
    slower: list[PID] = []  # controllers of the camera of a smaller rate
    for rate, ideal in ideals.items():
        pids: list[PID] = []
        for k, sensor in enumerate(SENSORS):
            neighbours = [*pids[:1], *pids[-1:], *slower[k : k + 1], *slower[:1]]
            starts = [
                replace(pid, kp=part * pid.kp, ki=part * pid.ki, kd=part * pid.kd)
                for part in _SCALES
                for pid in neighbours
            ]
            effort = _FAST if rate > 100.0 else _NEXT if pids else _FIRST
            pids.append(_searched(_behind(ideal, sensor, 1 if rate >= 100.0 else noises), starts, effort).controller)
        best = {
            (rate, *sensor): _searched(tasks[rate, *sensor], [*pids, *slower[k : k + 1]], _COMPARED)
            for k, sensor in enumerate(SENSORS)
        }
        controllers |= best
        slower = [  # next the derivative as smooth, at many times the rate
            replace(each.controller, derivative_filter=each.controller.derivative_filter + 0.7 * ideal.sample_time)
            for each in best.values()
        ]
    return controllers


def _behind(task: Task, sensor: tuple[float, float], noises: int, seed: int = 0) -> Task:
    """A task that is measured by a camera, with several noises if it shakes."""
    quantum, shake = sensor
    first, *others = (
        replace(
            task.plant,
            sensor=Sensor(quantum=quantum * PIXEL, noise=shake * PIXEL, delay=task.sample_time, seed=seed + k),
        )
        for k in range(noises if shake else 1)
    )
    return replace(task, plant=first, again=tuple(others))


def _searched(task: Task, starts: Sequence[PID], effort: Effort) -> Found:
    generations, population, polish = effort
    return search(task, starts=starts, exact=False, generations=generations, population=population, polish=polish)


def _runs(task: Task, pid: PID, reference: FloatArray, opened: FloatArray) -> Iterator[tuple[Any, FloatArray]]:
    """The loop with each noise of a task, and what its camera measures in open loop."""
    for plant in (task.plant, *task.again):
        run = RestingPlant(plant, task.sample_time).run(pid, reference)
        yield run, replace(plant.sensor or Sensor(), delay=0.0).measure(np.append(opened[:1], opened[:-1]))


def _triangle(samples: int) -> FloatArray:
    return signals.triangle(LOW, HIGH, cycles=CYCLES, samples_per_cycle=samples)


def _width(y: FloatArray, samples: int) -> float:
    """Mean relative width of the last cycles of a symmetric triangle."""
    half, cycles = samples // 2, y[-MEASURED * samples - 1 : -1].reshape(MEASURED, samples)
    rising, falling = cycles[:, : half + 1], np.column_stack([cycles[:, half:], np.append(cycles[1:, 0], y[-1])])
    widths = np.abs(rising - falling[:, ::-1]).max(axis=1)
    return float(np.mean(widths / np.ptp(cycles, axis=1)))


def _middle(figures: Sequence[float]) -> float:
    """The median, a loop that does not settle counted as the worst; nan if the median is one of these."""
    middle = float(np.median([-math.inf if math.isnan(figure) else figure for figure in figures]))
    return middle if math.isfinite(middle) else math.nan


def _least(reduction: VibrationReduction) -> float:
    """The least of the three figures; nan where the loop does not settle within 2 %."""
    return float(np.min([vars(reduction)[name] for name in REDUCTIONS]))
