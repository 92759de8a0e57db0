"""Laws about that of Table 1, and what a sensor reads, for the simulated stages of experiments 46 and 51."""

from dataclasses import replace
from functools import cache

import numpy as np

import hysim as hs

STRUCTURE = hs.PolynomialBoucWen(input_coefficients=(1.0, 0.1))
RANGE = 3.0  # um, of a sensor of 12 bits


@cache
def law_of_table1() -> hs.PolynomialBoucWen:
    """The quadratic Bouc-Wen law of the paper's points, whose memory holds at the first sample of each input."""
    return hs.identify(STRUCTURE, hs.datasets.table1(), fixed={"n": 1.0}).model.placed(None)


def drawn_law(rng: np.random.Generator) -> hs.PolynomialBoucWen:
    """This law, its beta, gamma and gain drawn about their values."""
    law = law_of_table1()
    return replace(
        law,
        beta=law.beta * rng.uniform(0.7, 1.4),
        gamma=law.beta * rng.uniform(-0.5, 0.5),
        gain=law.gain * rng.uniform(0.6, 1.4),
    )


def record(truth: hs.Actuator, u: np.ndarray, step: float) -> hs.Record:
    """What the sensor of a stage reads under a command [V]."""
    return hs.Record(u=u, y=truth.measured(u, step), t=step * np.arange(u.size), units={"t": "s", "u": "V", "y": "um"})


def noise_of(sensor: hs.Sensor) -> float:
    """The rms value of a sensor's noise with that of its rounding [um]."""
    return float(np.hypot(sensor.noise, sensor.quantum / np.sqrt(12.0)))
