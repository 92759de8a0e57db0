"""The model of a discovered oscillator: what hysim simulates of its law.

    z' = A y' - beta |y'| |z|^(n-1) z - gamma y' |z|^n    BoucWenOscillator
    z' = A y' - r z                                       TransferFunction, since all of it is linear:

    Y / U = (s + r) / ((m s^2 + c s + k) (s + r) + A s)

Any other law has no model.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray
from hysim.discovery._judgement import HYSTERESIS, LAG, NO_STRUCTURE
from hysim.discovery._memory_terms import RELAXATION, MemoryTerm, bouc_wen_terms
from hysim.errors import SimulationError
from hysim.models.boucwen import BoucWen
from hysim.models.oscillator import BoucWenOscillator
from hysim.models.oscillator_structure import OscillatorStructure
from hysim.models.transfer_function import TransferFunction

RATE_DEPENDENT = "rate-dependent hysteresis"
OTHER = "rate-independent hysteresis, not of Bouc and Wen"

Model = BoucWenOscillator | TransferFunction

SPRING = bouc_wen_terms(1.0)[0]
_CYCLES = 10
_SAMPLES = 65  # of a branch


class State(NamedTuple):
    """Displacement, velocity and memory at the first sample."""

    y: float
    velocity: float
    z: float


def exponent(terms: Iterable[MemoryTerm]) -> float | None:
    """The n of the Bouc-Wen law that has these terms; None if there is none."""
    present = set(terms)
    n = max((term.power for term in present - {RELAXATION}), default=0.0)
    return n if n > 0.0 and present <= set(bouc_wen_terms(n)) else None


def verdict(terms: Iterable[MemoryTerm]) -> str:
    """The kind of law that has these terms."""
    present = set(terms)
    if exponent(present) is not None:
        return HYSTERESIS
    if RELAXATION in present:
        return LAG if present <= {SPRING, RELAXATION} else RATE_DEPENDENT
    return OTHER if present - {SPRING} else NO_STRUCTURE


def model(
    plant: Mapping[str, float], law: Mapping[MemoryTerm, float], structure: OscillatorStructure, state: State
) -> Model | None:
    """The model of an oscillator that begins in a state; None where hysim has none."""
    kind = verdict(law)
    if kind == LAG:
        return _lag(plant, law[RELAXATION], law.get(SPRING, 0.0), structure.hold, state)
    if kind not in (HYSTERESIS, NO_STRUCTURE):
        return None
    n = exponent(law) or 1.0
    A, dissipative, conservative = (law.get(term, 0.0) for term in bouc_wen_terms(n))
    oscillator: BoucWenOscillator = structure.assemble({**plant, "A": A, "beta": -dissipative, "gamma": -conservative, "n": n})
    if not any(state):
        return oscillator
    return replace(oscillator, initial_state=state[:2], law=replace(oscillator.law, z0=state.z))


def diverges(found: Model | None, y: FloatArray) -> bool:
    """Whether a model's memory diverges on cycles over the range of the displacements `y`, or a lag is unstable."""
    if isinstance(found, TransferFunction):
        return bool((found.poles.real > 0.0).any())
    if found is None or not isinstance(found.law, BoucWen):
        return False
    try:
        steady_loop(found.law, y)
    except SimulationError:
        return True
    return False


def steady_loop(law: BoucWen, y: FloatArray) -> metrics.LoopMetrics:
    """The steady loop of the memory over the range of the displacements `y`.

    Raises
    ------
    SimulationError
        If the memory diverges.
    """
    path = np.linspace(0.0, 1.0, _SAMPLES)
    one = np.concatenate([path, path[-2::-1]])
    u = y.min() + np.ptp(y) * np.concatenate([one, *[one[1:]] * (_CYCLES - 1)])
    return metrics.loop_metrics(u, law.gain * law.memory(u))


def _lag(plant: Mapping[str, float], relaxation: float, A: float, hold: str, state: State) -> TransferFunction:
    m, c, k = plant["mass"], plant["damping"], plant["stiffness"]
    alone = np.polymul([m, c, k], [1.0, -relaxation])
    force = -c * state.velocity - k * state.y - state.z  # of the free response, which no input pushes
    return TransferFunction(
        num=(1.0, -relaxation),
        den=tuple(np.polyadd(alone, [A, 0.0]).tolist()),
        hold="zoh" if hold == "zoh" else "foh",
        initial_state=(state.y, state.velocity, force / m) if any(state) else (),
    )
