"""Subjects of a design: numbers, and the information that an input would give on them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.law import Law

_DIFFERENCE = 1e-4  # of a number, or of one where that is smaller: both errors of a central difference are near 1e-8


class Subject(Protocol):
    """Numbers for which an input is designed."""

    @property
    def names(self) -> tuple[str, ...]:
        """The free numbers."""

    @property
    def values(self) -> FloatArray:
        """Their values, (n_names,)."""

    @property
    def noise(self) -> float:
        """Standard deviation of the measured output [unit of y]."""

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Largest standard errors with which numbers count as determined, by name; others may not be left out."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on numbers that are left out from the beginning."""

    def information(self, u: FloatArray) -> FloatArray:
        """Fisher information on the numbers in units of their sizes, (n_names, n_names); zeros if it diverges."""

    def covariance(self, u: FloatArray) -> FloatArray:
        """Expected covariance of the numbers (n_names, n_names), by refined derivatives."""

    def without(self, name: str) -> "Subject":
        """With a number that is known."""


def sizes_of(values: FloatArray) -> FloatArray:
    """Units in which numbers are judged: their sizes, one for zeros."""
    return np.where(values == 0.0, 1.0, np.abs(values))


def squared(slopes: FloatArray) -> FloatArray:
    """Information of derivatives (n_samples, n_names) in units of the noise; zeros if they are not finite."""
    return np.asarray(slopes.T @ slopes) if np.isfinite(slopes).all() else np.zeros((slopes.shape[1],) * 2)


@dataclass(frozen=True)
class LawAlone:
    """A law at rest before the first sample."""

    law: Law
    names: tuple[str, ...]
    noise: float
    tolerances: Mapping[str, float]
    remarks: tuple[str, ...] = ()

    @property
    def values(self) -> FloatArray:
        return np.array([self.law.scalars[name] for name in self.names])

    def information(self, u: FloatArray) -> FloatArray:
        """By central differences."""
        names, steps = self.names, _DIFFERENCE * sizes_of(self.values)
        sets: dict[str, Any] = {name: np.full(2 * len(names), self.law.scalars[name]) for name in names}
        for k, name in enumerate(names):
            sets[name][2 * k] += steps[k]
            sets[name][2 * k + 1] -= steps[k]
        outputs = self.law.outputs(sets, u)
        with np.errstate(invalid="ignore"):
            slopes = (outputs[0::2] - outputs[1::2]) / (2.0 * _DIFFERENCE * self.noise)
        return squared(slopes.T)

    def covariance(self, u: FloatArray) -> FloatArray:
        """By extrapolated differences."""
        return np.asarray(np.linalg.inv(self.law.response_jacobian(u, self.names).information(self.noise)))

    def without(self, name: str) -> "LawAlone":
        return replace(self, names=tuple(each for each in self.names if each != name))
