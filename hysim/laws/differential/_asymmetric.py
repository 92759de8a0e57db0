"""Bouc-Wen laws without a closed-form inverse: theirs is found by Newton's method on the step."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.laws.differential import boucwen_inverse
from hysim.laws.differential._memory_law import MemoryLaw
from hysim.laws.differential.polynomial_boucwen import PolynomialBoucWen
from hysim.models import inverse_search
from hysim.models.law import State


class SteppedLaw(MemoryLaw):
    """A Bouc-Wen law whose inverse is found numerically."""

    def inverse_response(self, y: npt.ArrayLike, u0: float | None = None, state: State | None = None) -> FloatArray:
        """Input that gives the output `y`, linear between the samples; see `hysim.Law.inverse_response`.

        It is y to the rounding of its terms, and to 1e-12 of the memory's stroke for a law that is stepped by power
        series. With neither u0 nor state the law rests, its memory at z0, at the input that gives y[0], searched for
        from u = 0.
        """
        if state is not None and u0 is not None:
            raise ValueError("give u0 or state, not both: the state has its own input")
        outputs = read_only(y, "y", ndim=1)
        if state is None and u0 is None and outputs.size:
            plain = PolynomialBoucWen(A=0.0, beta=0.0, gamma=0.0, gain=self.gain, offset=self.offset, z0=self.z0)
            static = replace(plain, input_coefficients=tuple(boucwen_inverse.coefficients(self)))
            u0 = float(static.inverse_response(outputs[:1])[0])
        start = self._begun(np.array([u0 or 0.0]), None)[1] if state is None else state
        forward = self._begun(np.array([start[0]]), start)[0]
        return inverse_search.inverse_response(
            inverse_search.inverse_step(forward, start[0], terms=self._terms(*start[:2])), outputs
        )

    def _terms(self, u: float, z: float) -> float:
        """Size of the terms of the output."""
        powers = [abs(c * u**k) for k, c in enumerate(boucwen_inverse.coefficients(self).tolist(), 1)]
        return float(abs(self.offset) + sum(powers) + abs(self.gain * z))
