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
        """Input that gives the output `y`, linear between the samples.

        Parameters
        ----------
        y : array, shape (n_samples,)
            Wanted output.
        u0 : float, optional
            Input at which the law rests, its memory at z0, before it moves to the first sample. By default it
            rests at the first sample: the input that gives y[0] with the memory at z0, found from u = 0.
        state : tuple of float, optional
            Input and memory to continue from, in place of u0 and z0.

        Returns
        -------
        array, shape (n_samples,)
            Its `response` is y to the rounding of its terms, and to 1e-12 of the memory's stroke where the law is
            stepped by power series. Where the law turns later, the input is the first one that gives y.

        Raises
        ------
        SimulationError
            If the output does not reach a sample, or does not rise (or fall) all the way there; it names the sample.
        ValueError
            If y is not finite or has not one axis, both u0 and state are given, its first sample does not determine
            the first input (give u0), or the slope is zero where the record begins.
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
