"""The buildings of the experiment on a portfolio, and what each does in every earthquake, for workers to import.

Four classes of one-storey buildings: masses on Bouc-Wen springs (n = 2) whose period and yield acceleration vary by
lognormal factors about the class' own, and whose stiffness after yielding is uniform. The numbers were chosen by hand,
in the range of the classes of HAZUS; they stand for no real town.
"""

import sys
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import stats

import hysim as hs

Array = np.ndarray

SAMPLE_TIME, DURATION, N_MOTIONS, DAMPING = 0.01, 40.0, 25, 0.05
TOLERANCE = 1e-4
PEAKS = np.geomspace(0.05, 1.2, N_MOTIONS) * 9.81  # m/s^2


class Kind(NamedTuple):
    """Medians of period [s] and yield acceleration [g], and the ductilities at which four states of damage begin."""

    period: float
    strength: float
    limits: tuple[float, float, float, float]


KINDS = {
    "timber": Kind(0.35, 0.35, (1.0, 2.5, 6.0, 12.0)),
    "masonry": Kind(0.25, 0.25, (1.0, 1.5, 2.5, 4.0)),
    "concrete": Kind(0.60, 0.20, (1.0, 2.0, 4.0, 7.0)),
    "steel": Kind(0.80, 0.22, (1.0, 2.0, 5.0, 10.0)),
}
SHARES = np.array([0.02, 0.10, 0.50, 1.00])  # of a building's value that each state of damage costs


def buildings(n: int) -> hs.Sample:
    """The portfolio; any 2^k buildings in a row cover it evenly."""
    factors = {"period": stats.lognorm(0.25), "strength": stats.lognorm(0.30)}
    return hs.Sample(distributions={"kind": (0.0, 4.0), **factors, "hardening": (0.02, 0.10)}, n=n)


@cache
def motions(n_samples: int | None = None) -> list[Array]:
    """Accelerations of the ground, from weak to strong [m/s^2]."""
    options = {"duration": DURATION, "sample_time": SAMPLE_TIME}
    return [hs.signals.ground_motion(peak, seed=k, **options)[:n_samples] for k, peak in enumerate(PEAKS)]


def springs(kind: Array, period: Array, strength: Array, hardening: Array) -> tuple[dict[str, Array], Array]:
    """The springs of buildings of unit mass, by the names of their parameters, and their yield drifts [m]."""
    medians = np.array([each[:2] for each in KINDS.values()])[np.asarray(kind).astype(int)]
    stiffness = (2.0 * np.pi / (medians[:, 0] * period)) ** 2
    yields = 9.81 * medians[:, 1] * strength / stiffness
    bend = 0.5 / yields**2
    fields = {"beta": bend, "gamma": bend, "gain": (1.0 - hardening) * stiffness, "feedthrough": hardening * stiffness}
    return {f"elements.0.{name}": values for name, values in fields.items()}, yields


def drifts(columns: dict[str, Array], tolerance: float = TOLERANCE, n_samples: int | None = None) -> Array:
    """Largest drift of each building in each motion [m], shape (n, 25), on one thread."""
    damping = hs.ModalDamping(ratio=DAMPING)
    frame = hs.shear_frame([1.0], laws=hs.BoucWen(n=2.0), damping=damping, tolerance=tolerance)
    options = {"sample_time": SAMPLE_TIME, "workers": 1}
    return np.column_stack([frame.responses(columns, a, **options)[:, 0] for a in motions(n_samples)])


def ductility(kind: Array, period: Array, strength: Array, hardening: Array) -> dict[str, Array]:
    """Largest drift over yield drift of a building in each motion, shape (25,), or of n buildings, shape (n, 25)."""
    columns, yields = springs(np.atleast_1d(kind), period, strength, hardening)
    found = drifts(columns) / yields[:, np.newaxis]
    return {"ductility": found if np.ndim(kind) else found[0]}


ductility.batch = ductility  # type: ignore[attr-defined]

if __name__ == "__main__":  # portfolio_tasks.py BUILDINGS SHARDS K STORE
    n, n_shards, k = map(int, sys.argv[1:4])
    hs.sweep(ductility, buildings(n), shard=(k, n_shards), store=sys.argv[4], workers=1, progress=False)
