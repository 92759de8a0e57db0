"""A transfer function whose gain at rest is one, beside a stage that carries the gain.

    G(s) = exp(-delay s) den_n (1 + q_(m-1) s/w + ... + q_0 (s/w)^m) / (s^n + den_1 s^(n-1) + ... + den_n)

w = den_n^(1/n) is the mean of the poles' frequencies. The q are searched as asinh(q), which is of order one for zeros
of any size and sign.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.plants._linear_response import LinearPlants, affine_columns
from hysim.records import Record

_WIDEST = float(np.arcsinh(1e4))
_NEAR = 0.05  # of the box: how far random points are from starts that regressions have found


@dataclass(frozen=True)
class UnitGain:
    """A structure whose numerator ends with ``den[n]``."""

    structure: Any  # of a transfer function, which makes this

    @property
    def shape(self) -> tuple[str, ...]:
        """Names of the coefficients that say where the zeros are."""
        return tuple(f"num[{k}]" for k in range(self.structure.zeros))

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The denominator, the delay where it is free, and the numerator's shape; linear in the initial state."""
        for name in (*freedom.fixed, *freedom.bounds):
            if name.startswith("num["):
                raise ValueError(
                    f"{name!r} cannot be fixed or bounded: the numerator is searched with the gain one at rest"
                )
        own: SearchSpace = self.structure.search_space(record, freedom)
        numerator = self.structure.columns[: self.structure.zeros + 1]
        n_shape, n_own = self.structure.zeros, len(own.coordinates)
        lower, upper = (np.append(side, np.full(n_shape, end)) for side, end in
                        ((own.lower, -_WIDEST), (own.upper, _WIDEST)))  # fmt: skip
        starts = np.array([np.append(x, self._shape(x, own, record)) for x in own.starts]).reshape(-1, lower.size)

        def parameters(x: FloatArray) -> dict[str, FloatArray]:
            sets = np.atleast_2d(x)
            return self._parameters(own.parameters(sets[:, :n_own]), sets[:, n_own:])

        searched = tuple(name for name in own.names if name not in own.linear)
        return replace(
            own,
            coordinates=(*own.coordinates, *self.shape),
            lower=lower,
            upper=upper,
            starts=starts,
            names=(*searched, *self.shape, *(name for name in own.linear if name not in numerator)),
            columns=tuple(name for name in own.columns if name not in numerator),
            linear=tuple(name for name in own.linear if name not in numerator),
            parameters=parameters,
            drawn=_near(starts, lower, upper) if len(starts) else None,
        )

    def filtered_sets(self, parameters: Parameters, signals: FloatArray, sample_time: float) -> FloatArray:
        """Outputs (n_sets, n_signals, n_samples) for the inputs `signals` of this shape, or (1, ...)."""
        monic = self._monic(parameters)
        numerators = np.zeros((len(monic), monic.shape[1] + 1))
        for name in (*self.shape, f"num[{self.structure.zeros}]"):
            place = monic.shape[1] - self.structure.zeros + int(name[4:-1])
            numerators[:, place] = parameters[name]
        plants = LinearPlants.of(monic, numerators, self._delays(parameters, len(monic)), sample_time)
        return plants.filtered(signals, hold=self.structure.hold, sample=self.structure.sample)

    def free_responses(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns of the initial state, (n_sets, n_samples, n)."""
        monic = self._monic(parameters)
        hold, sample = self.structure.hold, self.structure.sample
        return affine_columns(monic, record.u, record.sample_time, zeros=0, hold=hold, sample=sample)[..., 1:-1]

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The transfer function with these parameters."""
        return self.structure.assemble(parameters)

    def _monic(self, parameters: Parameters) -> FloatArray:
        return np.stack([np.atleast_1d(parameters[name]) for name in self.structure.denominator], axis=1)

    def _delays(self, parameters: Parameters, n_sets: int) -> FloatArray:
        delay = parameters["delay"] if self.structure.delay is None else self.structure.delay
        return np.broadcast_to(np.asarray(delay, dtype=float), n_sets)

    def _parameters(self, found: dict[str, FloatArray], shape: FloatArray) -> dict[str, FloatArray]:
        """With the numerator; it is den_n in front of the last power."""
        m = self.structure.zeros
        end = found[self.structure.denominator[-1]]
        mean = end ** (1.0 / self.structure.poles)
        numerator = {f"num[{k}]": end * np.sinh(shape[:, k]) / mean ** (m - k) for k in range(m)}
        return found | numerator | {f"num[{m}]": end}

    def _shape(self, x: FloatArray, own: SearchSpace, record: Record) -> FloatArray:
        """Coordinates of the numerator that is best in front of the record, of one denominator."""
        found = own.parameters(x[np.newaxis])
        columns = self.structure.regressors(found, record)[0, :, :-1]
        m, n = self.structure.zeros, self.structure.poles
        columns = np.column_stack([columns[:, : m + 1], np.ones(len(record))])
        scale = np.linalg.norm(columns, axis=0)
        numerator = np.linalg.lstsq(columns / np.where(scale > 0.0, scale, 1.0), record.y, rcond=None)[0] / scale
        mean = float(found[self.structure.denominator[-1]][0]) ** (1.0 / n)
        ratios = numerator[:m] / (numerator[m] or 1.0) * mean ** np.arange(m, 0.0, -1.0)
        return np.asarray(np.clip(np.arcsinh(ratios), -_WIDEST, _WIDEST))


def _near(starts: FloatArray, lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The part of the box about the starts."""
    reach = _NEAR * (upper - lower)
    return np.maximum(starts.min(axis=0) - reach, lower), np.minimum(starts.max(axis=0) + reach, upper)
