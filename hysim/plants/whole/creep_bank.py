"""The creep of an actuator as few numbers to be identified: its growth in a decade, its slope, or free weights.

    per decade      the bank of `hysim.Creep.per_decade`: w_i in proportion to the growth in percent a decade
    N elements      w_i = percent / 100 D (tau_i / t_0)^slope, tau_i log-spaced over the times that the records show,
                    D decades from one to the next, t_0 = 0.1 s or the nearest time to it
    time constants  w_i free, beside an instant gain of one

Of the first two the step response is one at t_0, so that the law keeps the gain.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, read_only
from hysim.models.parameters import Coordinate
from hysim.plants.creep import Creep

_REFERENCE = 0.1  # [s]
_BAND = (1e-3, 1e3)  # [s]
_PERCENT = Coordinate("percent", -10.0, 40.0)
_SLOPE = Coordinate("slope", -1.0, 1.0)
_START = 1.0  # percent a decade
_START_OF_WEIGHTS = 0.01
_BEYOND = 3.0  # times the longest record, from which on an element cannot be told from a drift


@dataclass(frozen=True)
class CreepBank:
    """Elements at these time constants; `unit` are their weights for a growth of 1 % a decade, None if each is free."""

    time_constants: tuple[float, ...]
    unit: tuple[float, ...] | None
    reference: float = _REFERENCE
    sloped: bool = False
    idle: tuple[int, ...] = ()  # elements that the records cannot show

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Coordinates that are searched."""
        if self.unit is None:
            return tuple(Coordinate(f"weights[{k}]", -1.0, 4.0) for k in range(len(self.time_constants)))
        return (_PERCENT, _SLOPE) if self.sloped else (_PERCENT,)

    @property
    def defaults(self) -> dict[str, float]:
        """Starts of the search."""
        if self.unit is None:
            idle = {f"weights[{k}]": 0.0 for k in self.idle}
            return {each.name: _START_OF_WEIGHTS for each in self.coordinates} | idle
        return {each.name: value for each, value in zip(self.coordinates, (_START, 0.0), strict=False)}

    def made(self, values: Mapping[str, float]) -> Creep:
        """The creep with these values."""
        taus = np.array(self.time_constants)
        if self.unit is None:
            weights = np.array([values[each.name] for each in self.coordinates])
            return Creep(time_constants=self.time_constants, weights=tuple(weights.tolist()))
        weights = values["percent"] * np.array(self.unit) * (taus / self.reference) ** values.get("slope", 0.0)
        at_reference = -np.expm1(-self.reference / taus)
        return Creep(
            time_constants=self.time_constants,
            weights=tuple(weights.tolist()),
            instant_gain=1.0 - float(weights @ at_reference),
        )

    @property
    def remark(self) -> str:
        """A phrase on the elements that the records cannot show; else the empty text."""
        if not self.idle:
            return ""
        times = ", ".join(f"{self.time_constants[k]:g}" for k in self.idle)
        return f"the records are too short or too coarse for creep at {times} s: its weights are held at 0"


def creep_bank(creep: Any, shortest: float, longest: float) -> CreepBank | Creep | None:
    """The bank for records with a `shortest` sample time and a `longest` duration [s], or a creep that is known."""
    if creep is False or creep is None or isinstance(creep, Creep):
        return creep or None
    if creep is True:
        whole = Creep.per_decade(1.0, band=(_BAND[0], max(_BAND[1], longest)))
        return CreepBank(whole.time_constants, whole.weights)
    if isinstance(creep, int):
        return _even_bank(creep, shortest, longest)
    slow = [k for k, tau in enumerate(creep) if tau > _BEYOND * longest or tau < shortest / _BEYOND]
    return CreepBank(tuple(creep), None, idle=tuple(slow))


def _even_bank(n: int, shortest: float, longest: float) -> CreepBank:
    taus = np.geomspace(shortest, longest, n + 2)[1:-1]
    decades = math.log10(longest / shortest) / (n + 1)
    reference = float(np.clip(_REFERENCE, taus[0], taus[-1]))
    return CreepBank(tuple(taus.tolist()), (0.01 * decades,) * n, reference, sloped=n > 1)


def checked_creep(creep: Any) -> Any:
    """The argument `creep` of a structure; TypeError or ValueError if it is none."""
    if creep is None or isinstance(creep, bool | Creep):
        return creep
    if isinstance(creep, int):
        if creep < 1:
            raise ValueError(f"creep must be at least one element, got {creep}; False is for none")
        return creep
    times: FloatArray = read_only(creep, "creep", ndim=1)
    if not times.size or times.min() <= 0.0 or (np.diff(times) <= 0.0).any():
        raise ValueError(f"creep must hold time constants [s] that are positive and increase, got {times.tolist()}")
    return tuple(times.tolist())
