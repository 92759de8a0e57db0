"""A sampled controller and a continuous actuator: a law, then a linear stage.

The controller reads the displacement y_k just before its new voltage u_k, which is held until the next
sample. The law answers with w_k at once, the linear stage is stepped exactly:

    y_k      = C x_k + D w_(k-1-d)
    x_(k+1)  = A x_k + B_old w_(k-1-d) + B_new w_(k-d)

d is the number of whole samples in the stage's dead time; its remainder divides a step between the older
and the newer of two held values, which B_old and B_new hold.
"""

import math

from numba import float64, int64, types

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.controllers import CONTROLLER
from hysim.kernels.stepping import CONSTANTS, STEP, VECTOR, Step

MATRIX = types.Array(float64, 2, "C", readonly=True)


@signed_kernel(
    int64(
        CONTROLLER, CONSTANTS, VECTOR, STEP, CONSTANTS, VECTOR,
        MATRIX, CONSTANTS, CONSTANTS, CONSTANTS, float64, VECTOR, VECTOR,
        CONSTANTS, int64, int64, VECTOR, VECTOR, VECTOR, VECTOR,
    )
)  # fmt: skip
def close(
    controller: object,
    controller_parameters: FloatArray,
    controller_state: FloatArray,
    law: Step,
    law_parameters: FloatArray,
    law_state: FloatArray,
    A: FloatArray,
    B_old: FloatArray,
    B_new: FloatArray,
    C: FloatArray,
    D: float,
    x: FloatArray,
    past: FloatArray,
    reference: FloatArray,
    start: int,
    stop: int,
    command: FloatArray,
    u: FloatArray,
    w: FloatArray,
    y: FloatArray,
) -> int:
    """Run the samples `start` to `stop - 1`: the first one that is not finite, or -1.

    `past` is a ring of the law's last d + 2 outputs; it, the states and `x` (twice the order: the state, then
    room for the next) are carried from chunk to chunk.
    """
    order, ring = B_new.size, past.size
    for k in range(start, stop):
        older = past[(k + 1) % ring]
        total = D * older
        for i in range(order):
            total += C[i] * x[i]
        y[k] = total
        u[k] = controller(controller_parameters, controller_state, reference[k], total)  # type: ignore[operator]
        command[k] = controller_state[0]
        w[k] = law(law_parameters, law_state, u[k])
        if not (math.isfinite(total) and math.isfinite(u[k]) and math.isfinite(w[k])):
            return k
        past[k % ring] = w[k]
        newer = past[(k + 2) % ring]
        for i in range(order):
            following = B_old[i] * older + B_new[i] * newer
            for j in range(order):
                following += A[i, j] * x[j]
            x[order + i] = following
        for i in range(order):
            x[i] = x[order + i]
    return -1
