"""The generalised Bouc-Wen law of Song and Der Kiureghian along a monotone input, exactly.

    dz/du = A - |z|^n psi
    psi = gamma + beta sgn(u' z) + b2 sgn(u' u) + b3 sgn(z u) + b4 sgn(u') + b5 sgn(z) + b6 sgn(u)

While s = sgn(u') and e = sgn(u) stay the same, psi is that of a Bouc-Wen law whose

    gamma' = gamma + s e b2 + s b4 + e b6,    beta' = beta + s e b3 + s b5

so the law is four Bouc-Wen laws, one for each pair (s, e), and a stretch of the input is cut where it
passes u = 0. Each part is one `hysim.kernels.boucwen.step`, which cuts it at z = 0. A stretch on which
both laws are the same is not cut: a Bouc-Wen law in this form gives the bits of the law itself.
"""

import math

from hysim._basics.frozen import FloatArray
from hysim.kernels import boucwen
from hysim.kernels._compile import inner, kernel, pasted
from hysim.kernels.charts import N_WORK

N_LAWS = 4  # falling at u < 0 and u > 0, rising at u < 0 and u > 0
_SIDES = 2  # where a Bouc-Wen law's own constants begin in its workspace
_N_SIDES = 6
_EXPONENT = N_WORK  # the n that the charts are made for
_STORE = N_WORK + 1
_CURRENT = _STORE + N_LAWS * _N_SIDES  # 1 + the law whose constants are in place, 0 before the first step
N_STATE = _CURRENT + 1


@kernel
def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """Output at the next input `u`; `state`, shape (N_STATE,), has the last u and z in front, and moves along.

    `parameters` are those of the four laws, each as `boucwen.step` has them, one after the other.
    """
    if state[_CURRENT] == 0.0:
        prepare(parameters, state)
    return moved(parameters, state, u, 1)


@kernel
def elementary_step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    """As `step` for n = 1 and 2, without a workspace: `state` is (last u, z)."""
    return moved(parameters, state, u, None)


@pasted
def moved(parameters: FloatArray, state: FloatArray, u: float, charts: int | None) -> float:
    """`step` or `elementary_step`, cut where u changes its sign."""
    size, last = parameters.size // N_LAWS, state[0]
    direction = 2 if u > last else 0
    if (last < 0.0 and u > 0.0) or (last > 0.0 and u < 0.0):
        below, above = direction * size, (direction + 1) * size
        if parameters[below + 1] != parameters[above + 1] or parameters[below + 2] != parameters[above + 2]:
            y = part(parameters, state, 0.0, direction + (1 if last > 0.0 else 0), charts)
            if not math.isfinite(state[1]):  # a memory that has diverged remains so
                return y
            last = 0.0
    return part(parameters, state, u, direction + (1 if last + u > 0.0 else 0), charts)


@pasted
def part(parameters: FloatArray, state: FloatArray, u: float, law: int, charts: int | None) -> float:
    """As `moved` on a stretch where one of the four laws holds."""
    if charts is not None:
        return along(parameters, state, u, law)
    return elementary_along(parameters, state, u, law)


@inner
def elementary_along(parameters: FloatArray, state: FloatArray, u: float, law: int) -> float:
    """As `along`, for n = 1 and 2."""
    size = parameters.size // N_LAWS
    own = parameters[law * size : (law + 1) * size]
    return boucwen.linear_step(own, state, u) if own[3] == 1.0 else boucwen.quadratic_step(own, state, u)


@kernel
def along(parameters: FloatArray, state: FloatArray, u: float, law: int) -> float:
    """As `step` on a stretch where one of the four laws holds."""
    if state[_CURRENT] != law + 1.0:
        for k in range(_N_SIDES):
            state[_SIDES + k] = state[_STORE + law * _N_SIDES + k]
        state[_CURRENT] = law + 1.0
    size = parameters.size // N_LAWS
    return boucwen.step(parameters[law * size : (law + 1) * size], state, u)


@kernel
def prepare(parameters: FloatArray, state: FloatArray) -> None:
    """Store the constants of the four laws; the charts are kept if they are for this n."""
    size = parameters.size // N_LAWS
    for law in range(N_LAWS):
        A, beta, gamma, n = parameters[law * size : law * size + 4]
        boucwen.prepare(A, beta, gamma, n, state[_EXPONENT], state)
        state[_EXPONENT] = n
        for k in range(_N_SIDES):
            state[_STORE + law * _N_SIDES + k] = state[_SIDES + k]
    state[_CURRENT] = N_LAWS
