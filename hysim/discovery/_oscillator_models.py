"""Models of a discovered oscillator, where hysim has one.

z' = A y' - beta |y'| |z|^(n-1) z - gamma y' |z|^n    BoucWenOscillator
z' = A y' - r z                                       TransferFunction, since all of it is linear:

Y / U = (s + r) / ((m s^2 + c s + k) (s + r) + A s)
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray
from hysim.discovery._judgement import HYSTERESIS, LAG, NO_STRUCTURE, signed_area
from hysim.errors import SimulationError
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.terms import RELAXATION, Term, bouc_wen_exponent, bouc_wen_terms
from hysim.plants.oscillator import BoucWenOscillator
from hysim.plants.oscillator_structure import OscillatorStructure
from hysim.plants.transfer_function import TransferFunction

RATE_DEPENDENT = "rate-dependent hysteresis"

Model = BoucWenOscillator | TransferFunction

SPRING = bouc_wen_terms(1.0)[0]
_CYCLES = 10
_SAMPLES = 65  # of a branch


class State(NamedTuple):
    y: float
    velocity: float
    z: float


def verdict(terms: Iterable[Term]) -> str:
    present = set(terms)
    if RELAXATION in present:
        return LAG if present <= {SPRING, RELAXATION} else RATE_DEPENDENT
    return HYSTERESIS if present - {SPRING} else NO_STRUCTURE


def model(
    plant: Mapping[str, float], law: Mapping[Term, float], structure: OscillatorStructure, state: State
) -> Model | None:
    """Model of an oscillator that begins in a state; None where hysim has none."""
    kind, n = verdict(law), bouc_wen_exponent(law)
    if kind == LAG:
        return _lag(plant, law[RELAXATION], law.get(SPRING, 0.0), structure.hold, state)
    if n is None and kind != NO_STRUCTURE:
        return None
    A, dissipative, conservative = (law.get(term, 0.0) for term in bouc_wen_terms(n or 1.0))
    shape = {"A": A, "beta": -dissipative, "gamma": -conservative, "n": n or 1.0}
    oscillator: BoucWenOscillator = structure.assemble({**plant, **shape})
    if not any(state):
        return oscillator
    return replace(oscillator, initial_state=state[:2], law=replace(oscillator.law, z0=state.z))


def diverges(oscillator: Model | None, y: FloatArray) -> bool:
    """Whether a model's memory diverges on cycles over the range of the displacements `y`, or a lag is unstable."""
    if isinstance(oscillator, TransferFunction):
        return bool((oscillator.poles.real > 0.0).any())
    try:
        steady_loop(oscillator, y)
    except SimulationError:
        return True
    return False


def steady_loop(oscillator: Model | None, y: FloatArray) -> tuple[float, float]:
    """Relative width and signed area of the memory's loop over the range of `y`; nan if it is no Bouc-Wen law."""
    law = oscillator.law if isinstance(oscillator, BoucWenOscillator) else None
    if not isinstance(law, BoucWen):
        return np.nan, np.nan
    path = np.linspace(0.0, 1.0, _SAMPLES)
    one = np.concatenate([path, path[-2::-1]])
    u = y.min() + np.ptp(y) * np.concatenate([one, *[one[1:]] * (_CYCLES - 1)])
    loop = metrics.loop_metrics(u, law.gain * law.memory(u))
    return loop.relative_width, signed_area(loop)


def _lag(plant: Mapping[str, float], relaxation: float, A: float, hold: str, state: State) -> TransferFunction:
    m, c, k = plant["mass"], plant["damping"], plant["stiffness"]
    without_memory = np.polymul([m, c, k], [1.0, -relaxation])
    force = -c * state.velocity - k * state.y - state.z  # of the free response, which no input pushes
    return TransferFunction(
        num=(1.0, -relaxation),
        den=tuple(np.polyadd(without_memory, [A, 0.0]).tolist()),
        hold="zoh" if hold == "zoh" else "foh",
        initial_state=(state.y, state.velocity, force / m) if any(state) else (),
    )
