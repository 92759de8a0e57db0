"""Bounds that a tuned loop must keep on every plant: linear figures, at both extreme slopes of the law."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray, check_positive
from hysim.control._margins import LinearLoop
from hysim.control._open_loop import secant_gain, slopes
from hysim.control._sampled import SampledController
from hysim.control._stability import slowest_decay
from hysim.control._tuning import Trial
from hysim.plants.actuator import Actuator


class Judgement(NamedTuple):
    max_sensitivity: float
    voltage_noise: float


class Specification:
    """Bounds on the maximum sensitivity and on the voltage noise; the linear rule uses the first plant."""

    def __init__(
        self,
        plants: Sequence[Actuator],
        cycle: FloatArray,
        sample_time: float,
        max_sensitivity: float,
        max_voltage_noise: float | None,
    ) -> None:
        if not max_sensitivity > 1.0:
            raise ValueError(f"max_sensitivity must be above one, got {max_sensitivity}")
        check_positive(max_voltage_noise=max_voltage_noise)
        self.max_sensitivity = max_sensitivity
        self.max_voltage_noise = math.inf if max_voltage_noise is None else max_voltage_noise
        self.plants = [_PlantLoops(plant, cycle, sample_time) for plant in plants]

    def judge(self, controller: SampledController) -> Judgement:
        sensitivity = 0.0
        for loop, slope in self._loops():
            sensitivity = max(sensitivity, loop.max_sensitivity(controller, slope))
            if sensitivity == math.inf:
                return Judgement(math.inf, math.inf)
        return Judgement(sensitivity, max(plant.voltage_noise(controller) for plant in self.plants))

    def excess(self, figures: Judgement | Trial) -> float:
        """Sum of the parts by which the bounds are exceeded; 0 within."""
        if figures.max_sensitivity == math.inf:
            return math.inf
        parts = figures.max_sensitivity / self.max_sensitivity, figures.voltage_noise / self.max_voltage_noise
        return sum(max(0.0, part - 1.0) for part in parts)

    def words(self, trial: Trial) -> str:
        sensitivity = f"sensitivity {trial.max_sensitivity:.2f} of {self.max_sensitivity:g} allowed"
        if self.max_voltage_noise == math.inf:
            return sensitivity
        return f"{sensitivity}, voltage noise {trial.voltage_noise:.2g} of {self.max_voltage_noise:g}"

    def margins(self, controller: SampledController) -> tuple[float, float]:
        gains, phases = np.array([loop.margins(controller, slope) for loop, slope in self._loops()]).T
        return float(gains.min()), float(phases.min())

    def _loops(self) -> Iterator[tuple[LinearLoop, float]]:
        return ((plant.loop, slope) for plant in self.plants for slope in plant.slopes)


class _PlantLoops:
    """One plant along the reference's cycle: its gain, the extreme slopes of its law, and its linear part."""

    def __init__(self, plant: Actuator, cycle: FloatArray, sample_time: float) -> None:
        self.gain = secant_gain(plant, cycle)
        self.secant = self.gain / plant.dc_gain
        self.slopes = sorted(set(slopes(plant, cycle / self.gain)))
        self.loop = LinearLoop(plant, sample_time)
        self.noise = 0.0 if plant.sensor is None else plant.sensor.noise
        self.volts = 1.0 if plant.amplifier is None else abs(plant.amplifier.gain)

    def decay(self, controller: SampledController) -> float:
        """Decay of the slowest oscillation of the stable loops, per sample."""
        return slowest_decay(self.loop, controller, self.slopes)

    def voltage_noise(self, controller: SampledController) -> float:
        if not self.noise:
            return 0.0
        return self.volts * self.noise * max(self.loop.noise_gain(controller, slope) for slope in self.slopes)
