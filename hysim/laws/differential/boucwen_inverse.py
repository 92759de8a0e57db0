"""The inverse of a Bouc-Wen law: the input that gives a wanted output.

    offset + P(u) + gain z(u) = y,    stroke by stroke from the last sample to the next

It exists where dy/du = P'(u) + gain dz/du keeps one sign on the way, and on the way back from each sample;
`hysim.kernels.boucwen_inverse` computes it to rounding. The state is that of the law and the last output, so that an
output that stands still leaves the input where it is, to the bit.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, frozen, read_only
from hysim._parallel import in_pieces
from hysim.errors import SimulationError
from hysim.kernels import boucwen_inverse as kernels
from hysim.kernels.stepping import drive
from hysim.models.protocols import CompiledLaw

LawState = tuple[float, ...]
InverseState = tuple[float, float, float]
"""Last input, memory and last output."""


class MonotoneLaw(Protocol):
    """Fields and methods of a law that can be inverted."""

    A: float
    beta: float
    gamma: float
    n: float
    gain: float
    offset: float
    z0: float

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """One name for each coefficient of the input."""
        ...

    @property
    def scalars(self) -> Mapping[str, float]:
        """Numbers by name."""
        ...

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The forward step."""
        ...


@frozen
class BoucWenInverse:
    """The exact inverse of a Bouc-Wen law, for a whole output or sample by sample.

    Parameters
    ----------
    law : BoucWen or PolynomialBoucWen
        The law to invert.
    increasing : bool
        Whether the output rises with the input. A polynomial that turns has one inverse on either side.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.BoucWen(A=0.35, beta=0.02, gamma=0.005, feedthrough=1.0, gain=-1.0)
    >>> inverse, state = law.inverse(), None
    >>> for y in (0.0, 10.0, 5.0):
    ...     u, state = inverse.advance(y, state)
    ...     print(round(float(u), 6))
    0.0
    14.178227
    6.003286
    """

    law: Any
    increasing: bool = True

    def response(self, y: npt.ArrayLike) -> FloatArray:
        """Input at the samples of the output `y`, shape (n,); see `advance`."""
        return self.advance(read_only(y, "y", ndim=1))[0]

    def advance(
        self, y: npt.ArrayLike, state: LawState | InverseState | None = None
    ) -> tuple[FloatArray, InverseState | None]:
        """Input at the samples of `y`, a number or (n_samples,) [unit of y], and the state after the last sample.

        It continues from `state`, input and memory at the last sample so far and its output where known, with the same
        bits as from one uncut output; by default the first sample meets the memory at z0. Raises SimulationError if the
        output is not monotone in the input or does not reach a sample, and ValueError if y is not finite or its first
        sample does not determine the first input.
        """
        outputs = read_only(y, "y")
        if outputs.ndim > 1:
            raise ValueError(f"y must be a number or have 1 axis, got shape {outputs.shape}")
        samples = outputs.reshape(-1)
        if state is None and not samples.size:
            return outputs, None
        start = self._rest(samples[0]) if state is None else state
        compiled = self._compiled(start)
        u = np.empty(samples.size)
        with np.errstate(all="ignore"):  # a bracket may reach where the memory overflows
            failed = in_pieces(
                lambda k: drive(compiled.step, compiled.parameters, compiled.state, samples[k], u[k]), u.size
            )
        if failed >= 0:
            raise SimulationError(self._failure(failed, samples[failed], *compiled.state[2:4]))
        last_u, last_y, z = compiled.state[[0, 1, kernels.N_OWN + 1]].tolist()
        return u.reshape(outputs.shape), (last_u, z, last_y)

    def compiled(
        self, y0: float | None = None, *, u0: float | None = None, limits: tuple[float, float] = (-math.inf, math.inf)
    ) -> CompiledLaw:
        """The inverse as compiled loops take it, ``u = step(parameters, state, y)``, nan where no input has the output.

        The law rests, its memory at z0, at the output `y0` or the input `u0`, by default zero. Its copy of the law
        moves between the `limits` of the input.
        """
        if y0 is not None and u0 is None:
            return self._compiled(self._rest(float(y0)), limits)
        return self._compiled((float(u0 or 0.0), self.law.z0), limits)

    def _compiled(
        self, state: LawState | InverseState, limits: tuple[float, float] = (-math.inf, math.inf)
    ) -> CompiledLaw:
        law = self.law
        u, z, *known = (float(value) for value in state)
        forward = law.compiled(u)
        forward.state[1] = z
        last_y = known[0] if known else forward.step(forward.parameters, forward.state, u)
        c = coefficients(law)
        head = [1.0 if self.increasing else -1.0, law.A, law.beta, law.gamma, law.n, law.gain, law.offset, c.size]
        return CompiledLaw(
            kernels.step,
            read_only(np.concatenate([limits, head, c, forward.parameters]), finite=False),
            np.concatenate([[u, last_y, np.nan, np.nan], forward.state]),
        )

    def _rest(self, y: float) -> InverseState:
        """State at an output with the memory at z0: the root of the polynomial on its branch through u = 0."""
        slope = coefficients(self.law)[0]
        if slope == 0.0:
            raise ValueError(
                "the first output does not tell the first input, as the law has no slope beside its memory: give u0"
            )
        static = replace(self.law, A=0.0, beta=0.0, gamma=0.0)
        compiled = BoucWenInverse(law=static, increasing=bool(slope > 0.0)).compiled(u0=0.0)
        u = compiled.step(compiled.parameters, compiled.state, y)
        if not np.isfinite(u):
            raise SimulationError(
                f"no input gives the first output {y:g} with the memory at z0: the polynomial turns at "
                f"u = {compiled.state[2]:g}; give u0 to begin on another branch"
            )
        return float(u), self.law.z0, float(y)

    def _failure(self, sample: int, y: float, u: float, slope: float) -> str:
        wanted = "positive" if self.increasing else "negative"
        if slope > 0.0 if self.increasing else slope < 0.0:
            return f"the output does not reach sample {sample} (y = {y:g}): at u = {u:g} its slope is {slope:g}"
        return (
            f"the law has no inverse at sample {sample} (y = {y:g}): at u = {u:g} its slope is {slope:g}, not {wanted}"
        )


def inverse(law: MonotoneLaw, u: float = 0.0) -> BoucWenInverse:
    """The inverse with the direction that the law has at the input `u` and z = 0.

    Raises ValueError if its slope is zero there.
    """
    slope = float(np.polynomial.polynomial.polyval(u, derivative(law))) + law.gain * law.A
    if slope == 0.0:
        raise ValueError(f"the law has no inverse: its slope is zero at u = {u:g}, z = 0")
    return BoucWenInverse(law=law, increasing=slope > 0.0)


def inverse_response(
    law: MonotoneLaw, y: npt.ArrayLike, u0: float | None, state: LawState | InverseState | None
) -> FloatArray:
    """Inputs for the outputs `y`; see `BoucWen.inverse_response`."""
    outputs = read_only(y, "y", ndim=1)
    if state is not None and u0 is not None:
        raise ValueError("give u0 or state, not both: the state has its own input")
    if not outputs.size:
        return outputs
    if state is None:
        state = BoucWenInverse(law=law)._rest(float(outputs[0])) if u0 is None else (float(u0), law.z0)
    return inverse(law, float(state[0])).advance(outputs, state)[0]


def coefficients(law: MonotoneLaw) -> FloatArray:
    """(c1, c2, ...) of the input's polynomial."""
    scalars = law.scalars
    return np.array([scalars[name] for name in law.coefficient_names])


def derivative(law: MonotoneLaw) -> FloatArray:
    """Coefficients of P' in ascending powers."""
    c = coefficients(law)
    return np.asarray(c * np.arange(1.0, c.size + 1.0))
