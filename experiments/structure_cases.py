"""Structures in earthquakes that the experiment on structures and the tests share.

In t, kN, m and s. The quakes are seeded: white noise through the ground filter of Kanai and Tajimi and a high-pass,
under an envelope. A scale is chosen so that a case has its ductility.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eigh
from scipy.signal import butter, lfilter
from structure_reference import Reference, reference

import hysim as hs

Array = np.ndarray


@dataclass(frozen=True)
class Case:
    """A structure and the acceleration of its ground.

    `masses` (N,), `stiffness` (N, N) of the linear springs, `elements` a law with the two nodes that it is between,
    0 being the ground; Rayleigh damping of ratio 0.02 at the modes `damped` of the initial stiffness.
    """

    name: str
    masses: tuple[float, ...]
    springs: tuple[float, ...]
    elements: tuple[tuple[tuple[int, int], Any], ...]
    slopes: tuple[float, ...]
    ground: Array
    sample_time: float
    ratio: float = 0.02
    damped: tuple[int, int] = (0, 2)

    @property
    def times(self) -> Array:
        """Times of the samples [s]."""
        return np.arange(self.ground.size) * self.sample_time

    @property
    def n_terms(self) -> int:
        """Samples times elements, in which times are counted."""
        return self.ground.size * len(self.elements)

    @cached_property
    def mass(self) -> Array:
        """Mass matrix (N, N) [t]."""
        return np.diag(self.masses)

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness matrix (N, N) of the linear springs, of which spring k stands below mass k [kN/m]."""
        below = np.eye(len(self.masses)) - np.eye(len(self.masses), k=-1)
        return below.T @ np.diag(self.springs) @ below

    @cached_property
    def directions(self) -> Array:
        """b_e, one a row (E, N)."""
        nodes = np.vstack([np.zeros(len(self.masses)), np.eye(len(self.masses))])
        return np.array([nodes[b] - nodes[a] for (a, b), _ in self.elements])

    @cached_property
    def rayleigh(self) -> tuple[float, float]:
        """Factors of mass [1/s] and initial stiffness [s] in the damping."""
        initial = self.stiffness + self.directions.T @ np.diag(self.slopes) @ self.directions
        omega = np.sqrt(eigh(initial, self.mass, eigvals_only=True))
        if omega.size == 1:
            return 2.0 * self.ratio * float(omega[0]), 0.0
        a, b = omega[list(self.damped)]
        return 2.0 * self.ratio * float(a * b / (a + b)), 2.0 * self.ratio / float(a + b)

    @cached_property
    def damping(self) -> Array:
        """Damping matrix (N, N) [kN s/m]."""
        of_mass, of_stiffness = self.rayleigh
        initial = self.stiffness + self.directions.T @ np.diag(self.slopes) @ self.directions
        return of_mass * self.mass + of_stiffness * initial

    def reference(self, tolerance: float = 1e-12) -> Reference:
        """The motion by DOP853 with events."""
        loads = -self.ground[:, None] * np.array(self.masses)
        laws = [law for _, law in self.elements]
        parts = self.mass, self.damping, self.stiffness, self.directions, laws
        return reference(*parts, loads, self.sample_time, tolerance)

    def structure(self, **options: Any) -> Any:
        """As hysim has it."""
        elements = tuple(hs.Element(law, between=nodes) for nodes, law in self.elements)
        return hs.Structure(
            mass=self.mass, damping=self.damping, stiffness=self.stiffness, elements=elements, **options
        )

    def window(self, begin: int, end: int) -> "Case":
        """A stretch of the earthquake only, which begins suddenly."""
        return replace(self, ground=self.ground[begin:end])


def quake(n_samples: int, sample_time: float, seed: int, duration: float) -> Array:
    """Acceleration of the ground with a largest value of 1 m/s^2, zero at first."""
    rng, h = np.random.default_rng(seed), sample_time
    omega, ratio = 15.0, 0.6  # of the ground
    c = 2.0 / h  # bilinear
    numerator = np.array([2 * ratio * omega * c + omega**2, 2 * omega**2, omega**2 - 2 * ratio * omega * c])
    middle = 2.0 * (omega**2 - c * c)
    denominator = np.array([c * c + 2 * ratio * omega * c + omega**2, middle, c * c - 2 * ratio * omega * c + omega**2])
    shaken = lfilter(numerator, denominator, rng.normal(size=n_samples))
    shaken = lfilter(*butter(2, 2.0 * h * 0.3, "highpass"), shaken)
    t = np.arange(n_samples) * h / duration
    envelope = np.minimum(1.0, t / 0.15) ** 2 * np.exp(-np.maximum(0.0, t - 0.5) * 5.0)
    return shaken * envelope / np.abs(shaken * envelope).max()


def softening(k: float, yielding: float, n: float, ratio: float = 0.05) -> hs.BoucWen:
    """A storey of elastic stiffness k that yields at a drift, and keeps a share of its stiffness."""
    bend = 0.5 / yielding**n
    return hs.BoucWen(A=1.0, beta=bend, gamma=bend, n=n, feedthrough=ratio * k, gain=(1.0 - ratio) * k)


def one_mass(n: float = 2.0, n_samples: int = 1001) -> Case:
    """One mass of a period of 0.5 s on a Bouc-Wen spring; ductility 3.5."""
    mass = 100.0
    k = mass * (2.0 * np.pi / 0.5) ** 2
    law = softening(k, 0.01, n)
    ground = 2.1058 * quake(1001, 0.02, 1, 20.0)[:n_samples]
    return Case(f"one mass, n = {n:g}", (mass,), (0.0,), (((0, 1), law),), (k,), ground, 0.02)


THREE = (1.2e5, 1.0e5, 0.8e5)  # kN/m
YIELDS = (0.010, 0.009, 0.008)  # m


def three_storeys(n: float = 2.0, n_samples: int = 1501, scale: float = 7.67) -> Case:
    """Three Bouc-Wen storeys, first period 0.4 s; ductility 5."""
    elements = tuple(((e, e + 1), softening(k, d, n)) for e, (k, d) in enumerate(zip(THREE, YIELDS, strict=True)))
    ground = scale * quake(1501, 0.01, 3, 15.0)[:n_samples]
    return Case(f"three storeys, n = {n:g}", (100.0, 100.0, 80.0), (0.0,) * 3, elements, THREE, ground, 0.01)


def pinching(n_samples: int = 1501) -> Case:
    """Three storeys of Baber and Noori, which lose strength and stiffness, and pinch; ductility 5."""

    def storey(k: float, d: float) -> hs.BoucWenBaberNoori:
        bend, energy = 0.5 / d**2, d * d
        return hs.BoucWenBaberNoori(
            A=1.0, beta=bend, gamma=bend, n=2.0, delta_nu=0.01 / energy, delta_eta=0.02 / energy, zeta_s=0.8, q=0.1,
            p=0.5 / energy, psi=0.15 * d, delta_psi=0.002 / d, lambda_=0.5,
            gain=0.95 * k, input_coefficients=(0.05 * k,),
        )  # fmt: skip

    elements = tuple(((e, e + 1), storey(k, d)) for e, (k, d) in enumerate(zip(THREE, YIELDS, strict=True)))
    ground = 6.86 * quake(1501, 0.01, 3, 15.0)[:n_samples]
    return Case("three storeys, pinching", (100.0, 100.0, 80.0), (0.0,) * 3, elements, THREE, ground, 0.01)


def yielding_frame(n_samples: int = 1501) -> Case:
    """Three bilinear storeys, of a linear spring and a Maxwell-slip element each, which OpenSees has as Steel01."""
    elements = tuple(
        ((e, e + 1), hs.MaxwellSlip(stiffness=(0.9 * k,), slips=(d,), feedthrough=0.1 * k))
        for e, (k, d) in enumerate(zip(THREE, YIELDS, strict=True))
    )
    ground = 5.0 * quake(1501, 0.01, 3, 15.0)[:n_samples]
    return Case("three storeys, bilinear", (100.0, 100.0, 80.0), (0.0,) * 3, elements, THREE, ground, 0.01)


def isolated_tower(n_samples: int = 2001) -> Case:
    """Twenty storeys on isolators: lead-rubber and sliding bearings, above Dahl friction, plays and Maxwell slip."""
    lead = softening(1.1e5, 0.0125, 2.0, 0.1)
    sliding = hs.MaxwellSlip(stiffness=(4e5,), slips=(0.002,))
    elements: list[tuple[tuple[int, int], Any]] = [((0, 1), lead), ((0, 1), sliding)]
    slopes = [1.1e5, 4e5]
    springs = [0.0, *np.linspace(8e5, 3e5, 19).tolist()]
    kinds: tuple[Callable[[float], Any], ...] = (_friction, _plays, _slip)
    for storey in range(1, 20):
        k = 0.15 * springs[storey]
        elements.append(((storey, storey + 1), kinds[storey % 3](k)))
        slopes.append(k)
    ground = 3.5 * quake(2001, 0.01, 5, 20.0)[:n_samples]
    return Case(
        "twenty storeys on isolators", (300.0, *(200.0,) * 19), tuple(springs), tuple(elements), tuple(slopes),
        ground, 0.01, damped=(0, 5),
    )  # fmt: skip


def _friction(k: float) -> hs.Dahl:
    return hs.Dahl(stiffness=k, coulomb=0.0015 * k)


def _plays(k: float) -> hs.PrandtlIshlinskii:
    return hs.PrandtlIshlinskii(thresholds=(0.0, 0.0005, 0.001, 0.002), weights=(k, -0.25 * k, -0.25 * k, -0.25 * k))


def _slip(k: float) -> hs.MaxwellSlip:
    return hs.MaxwellSlip(stiffness=(0.3 * k, 0.3 * k, 0.3 * k), slips=(0.0004, 0.001, 0.0025), feedthrough=0.1 * k)
