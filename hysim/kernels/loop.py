"""A sampled controller and a continuous actuator: an amplifier, a law, a linear stage and a sensor.

The controller reads the displacement just before its new command, which is held until the next sample. A
sample has one sub-step or more. At the begin of each, a static amplifier puts the law at its new voltage,
w_j = law(v_j) being held over the sub-step; a dynamic one moves the voltage to v_j over the sub-step, along
which w is then taken as linear, from w_(j-1) to w_j. Either way the linear stage is stepped exactly:

    x_(j+1)  = A x_j + B_2 w_(j-2-d) + B_1 w_(j-1-d) + B_0 w_(j-d)
    y_j      = C x_j + D_2 w_(j-2-d) + D_1 w_(j-1-d)

d is the number of whole sub-steps in the dead time; its remainder divides a sub-step between older and newer
values, which the B hold. The first states do not look at the others, x_(j+1) = x_j + decline x_j + ...: they
are the creep.

The sensor sees y some samples ago and a part of one. The part makes a second output, like y but taken
within the sub-step in which that time lies:

    reading        = quantum floor((y seen + noise) / quantum + 1/2)
"""

import math

from numba import float64, int64, types

from hysim._frozen import FloatArray
from hysim.kernels._compile import inlined, signed_kernel
from hysim.kernels.amplifier import charge
from hysim.kernels.controllers import CONTROLLER
from hysim.kernels.stepping import CONSTANTS, STEP, VECTOR, Step

MATRIX = types.Array(float64, 2, "C", readonly=True)


@inlined
def output(row: FloatArray, x: FloatArray, oldest: float, older: float, newer: float) -> float:
    """C x and what passes through; `row` holds the weights of the newer, the older and the oldest input, then C."""
    total = row[0] * newer + row[1] * older + row[2] * oldest
    for i in range(row.size - 3):
        total += row[3 + i] * x[i]
    return float(total)


@inlined
def advance(
    decline: FloatArray, A: FloatArray, B: FloatArray, x: FloatArray, oldest: float, older: float, newer: float
) -> None:
    """The linear stage over one sub-step; `x` is twice as long as the state, `A` has the rows after the creep's."""
    creeping, order = decline.size, B.shape[1]
    for i in range(order):
        following = B[1, i] * older + B[0, i] * newer + B[2, i] * oldest
        if i < creeping:
            following = x[i] + (decline[i] * x[i] + following)
        else:
            for j in range(order):
                following += A[i - creeping, j] * x[j]
        x[order + i] = following
    for i in range(order):
        x[i] = x[order + i]


@signed_kernel(
    int64(
        CONTROLLER, CONSTANTS, VECTOR, CONSTANTS, VECTOR, STEP, CONSTANTS, VECTOR,
        CONSTANTS, MATRIX, MATRIX, MATRIX, VECTOR, VECTOR, CONSTANTS, VECTOR,
        CONSTANTS, CONSTANTS, int64, int64, int64, int64,
        VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR,
    )
)  # fmt: skip
def close(
    controller: object,
    controller_parameters: FloatArray,
    controller_state: FloatArray,
    amplifier: FloatArray,
    voltages: FloatArray,
    law: Step,
    law_parameters: FloatArray,
    law_state: FloatArray,
    decline: FloatArray,
    A: FloatArray,
    B: FloatArray,
    outputs: FloatArray,
    x: FloatArray,
    past: FloatArray,
    noise: FloatArray,
    readings: FloatArray,
    sensor: FloatArray,
    reference: FloatArray,
    start: int,
    stop: int,
    substeps: int,
    seen_in: int,
    command: FloatArray,
    drive: FloatArray,
    v: FloatArray,
    w: FloatArray,
    y: FloatArray,
    measurement: FloatArray,
) -> int:
    """Run the samples `start` to `stop - 1`: the first one that is not finite, or -1.

    `amplifier` is (slew per sub-step, sub-step / time constant, gain, offset, lowest, highest), `voltages` its
    state, `sensor` is (quantum,). `past` is a ring of the law's last d + 3 outputs, `readings` one of the
    displacements that the sensor has still to give, and then the one taken in the sub-step `seen_in` of the
    sample before, which is negative where the displacement at the sample itself is taken. They, the states
    and `x` (twice the order: the state, then room for the next) are carried from chunk to chunk. `v` and `w`
    hold all sub-steps.
    """
    ring, waiting = past.size, readings.size - 1
    for k in range(start, stop):
        j = k * substeps
        y[k] = output(outputs[0], x, past[(j + 1) % ring], past[(j + 2) % ring], 0.0)
        readings[k % waiting] = y[k] if seen_in < 0 else readings[waiting]
        measurement[k] = readings[(k + 1) % waiting] + noise[k]
        if sensor[0] > 0.0:
            measurement[k] = sensor[0] * ((measurement[k] / sensor[0] + 0.5) // 1.0)
        drive[k] = controller(controller_parameters, controller_state, reference[k], measurement[k])  # type: ignore[operator]
        command[k] = controller_state[0]
        if not (math.isfinite(y[k]) and math.isfinite(drive[k])):
            return k
        target = min(max(amplifier[2] * drive[k] + amplifier[3], amplifier[4]), amplifier[5])
        for sub in range(substeps):
            j = k * substeps + sub
            v[j] = charge(amplifier, voltages, target)
            w[j] = law(law_parameters, law_state, v[j])
            if not (math.isfinite(v[j]) and math.isfinite(w[j])):
                return k
            past[j % ring] = w[j]
            oldest, older, newer = past[(j + 1) % ring], past[(j + 2) % ring], past[(j + 3) % ring]
            if sub == seen_in:
                readings[waiting] = output(outputs[1], x, oldest, older, newer)
            advance(decline, A, B, x, oldest, older, newer)
    return -1
