"""The inverse of a Bouc-Wen law: the input that gives a wanted output.

    offset + P(u) + gain z(u) = y,    stroke by stroke from the last sample to the next

It exists where dy/du = P'(u) + gain dz/du keeps one sign on the way, and on the way back from each sample;
`hysim.kernels.boucwen_inverse` computes it to rounding. The state is that of the law and the last output, so that an
output that stands still leaves the input where it is, to the bit.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, frozen, read_only
from hysim.errors import SimulationError
from hysim.kernels import boucwen
from hysim.kernels import boucwen_inverse as kernels
from hysim.kernels.charts import N_WORK
from hysim.kernels.inverses import N_LIMITS
from hysim.models.inverse_search import inverse_response
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits

LawState = tuple[float, ...]
InverseState = tuple[float, float, float]
"""Last input, memory and last output."""


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
        compiled = self.begun(at_rest(self.law, samples[0]) if state is None else state)
        u = inverse_response(compiled, samples, unreached)
        last_u, last_y, z = compiled.state[[0, 1, kernels.N_OWN + 1]].tolist()
        return u.reshape(outputs.shape), (last_u, z, last_y)

    def compiled(self, y0: float | None = None, *, u0: float | None = None, limits: Limits = UNLIMITED) -> CompiledLaw:
        """The inverse as compiled loops take it, ``u = step(parameters, state, y)``, nan where no input has the output.

        The law rests, memory at z0, at output `y0` or input `u0`, by default zero; its copy moves within `limits`.
        """
        if y0 is not None and u0 is None:
            return self.begun(at_rest(self.law, float(y0)), limits)
        return self.begun(self.law.state_at(float(u0 or 0.0))[:2], limits)

    def begun(self, state: LawState | InverseState, limits: Limits = UNLIMITED) -> CompiledLaw:
        """The inverse in a state, as compiled loops take it."""
        law = self.law
        u, z, *known = (float(value) for value in state)
        forward = law.compiled(u)
        forward.state[1] = z
        last_y = known[0] if known else forward.step(forward.parameters, forward.state, u)
        shape = [law.A, law.beta, law.gamma, law.n, law.gain, law.offset]
        return _stepped(self.increasing, shape, law.input_polynomial, forward, [u, last_y], limits)


def inverse(law: Any, u: float = 0.0) -> BoucWenInverse:
    """The inverse with the direction that the law has at the input `u` and z = 0; ValueError if its slope is zero."""
    slope = float(np.polynomial.polynomial.polyval(u, law.input_slope)) + law.gain * law.A
    if slope == 0.0:
        raise ValueError(f"the law has no inverse: its slope is zero at u = {u:g}, z = 0")
    return BoucWenInverse(law=law, increasing=slope > 0.0)


def at_rest(law: Any, y: float) -> InverseState:
    """State at an output with the memory at z0: the root of the polynomial on its branch through u = 0."""
    c = law.input_polynomial
    if c[0] == 0.0:
        raise ValueError(
            "the first input cannot be computed from the first output, since the law has no slope: give u0"
        )
    # a memory that stands still, with the kernel that the law's own inverse takes
    step, n, room = (
        (boucwen.step, law.n, N_WORK) if law.stepping.step is boucwen.step else (boucwen.linear_step, 1.0, 2)
    )
    shape = [0.0, 0.0, 0.0, n, law.gain, law.offset]
    forward = CompiledLaw(step, read_only([*shape, *c]), np.append([0.0, law.z0], np.zeros(room - 2)))
    last_y = forward.step(forward.parameters, forward.state, 0.0)
    static = _stepped(bool(c[0] > 0.0), shape, c, forward, [0.0, last_y], UNLIMITED)
    u = static.step(static.parameters, static.state, y)
    if not np.isfinite(u):
        raise SimulationError(
            f"no input gives the first output {y:g} with the memory at z0: the polynomial turns at "
            f"u = {static.state[2]:g}; give u0 to begin on another branch"
        )
    return float(u), law.z0, float(y)


def unreached(sample: int, y: float, inverse: CompiledLaw) -> str:
    """Message for an output that has no input, with the slope where the search ended."""
    direction, (u, slope) = inverse.parameters[N_LIMITS], inverse.state[2:4]
    if direction * slope > 0.0:
        return f"the output does not reach sample {sample} (y = {y:g}): at u = {u:g} its slope is {slope:g}"
    wanted = "positive" if direction > 0.0 else "negative"
    return f"the law has no inverse at sample {sample} (y = {y:g}): at u = {u:g} its slope is {slope:g}, not {wanted}"


def _stepped(
    increasing: bool, shape: list[float], c: FloatArray, forward: CompiledLaw, place: list[float], limits: Limits
) -> CompiledLaw:
    head = [1.0 if increasing else -1.0, *shape, c.size]
    return CompiledLaw(
        kernels.step if forward.step is boucwen.step else kernels.elementary_step,
        read_only(np.concatenate([limits, head, c, forward.parameters]), finite=False),
        np.concatenate([[*place, np.nan, np.nan], forward.state]),
    )
