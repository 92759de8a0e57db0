"""The records of the Bouc-Wen benchmark of Noel and Schoukens that the experiments on it share."""

from typing import Any

import numpy as np

import hysim as hs

NOISE = 8e-6  # m
PERIOD = 8192  # samples
TEST_SEED = 1000  # of the multisine of the test


def recipe(period: int, told: bool = True) -> Any:
    """How the benchmark's multisine records are made; if that is not told, only that their input is a multisine."""
    known: dict[str, Any] = {"initial": "periodic", "period": period, "hold": "band-limited"}
    made = {"method": "newmark", "oversampling": 20, "decimation": (2, 2, 5)} if told else {}
    return hs.BoucWenOscillator.structure(**known, **made)


def sweep(t: np.ndarray) -> np.ndarray:
    """The benchmark's sine sweep at these times [s]."""
    return 40.0 * np.sin(2.0 * np.pi * (18.0 * t + t**2 / 12.0))


def errors_on_tests(plant: hs.BoucWenOscillator, multisine: np.ndarray, swept: np.ndarray) -> dict[str, float]:
    """Root mean square error of a plant on the inputs of both tests [m]."""
    official = hs.benchmarks.simulate_official
    return {
        kind: float(np.sqrt(np.mean((official(u, kind=kind, plant=plant) - official(u, kind=kind)) ** 2)))
        for kind, u in {"multisine": multisine, "sweep": swept}.items()
    }
