"""Bouc-Wen laws without a closed-form inverse: theirs is found by Newton's method on the step."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.models import _numeric_inverse, boucwen_inverse
from hysim.models._memory_law import MemoryLaw
from hysim.models.law import State
from hysim.models.polynomial_boucwen import PolynomialBoucWen


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
            If the slope dy/du does not keep its sign up to a sample, or the output does not reach it; the message
            names the sample, the input and the slope.
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
        return _numeric_inverse.inverse_response(self, outputs, start, self._terms)

    def _terms(self, u: float, z: float) -> tuple[float, float]:
        """Sizes of the terms of the output that the input contributes, with the offset, and that the memory does."""
        total = 0.0
        for coefficient in reversed(boucwen_inverse.coefficients(self)):
            total = (total + abs(coefficient)) * abs(u)
        return abs(self.offset) + total, abs(self.gain * z)
