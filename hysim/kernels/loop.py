"""A sampled controller and a continuous actuator: an amplifier, a law, a linear stage and a sensor.

The controller reads the displacement just before its new command, which is held until the next sample. A
sample has one sub-step or more. At the begin of each, a static amplifier puts the law at its new voltage,
w_j = law(v_j) being held over the sub-step; a dynamic one moves the voltage to v_j over the sub-step, along
which w is then taken as linear, from w_(j-1) to w_j. Either way the linear stage is stepped exactly:

    x_(j+1)  = A x_j + B_2 w_(j-2-d) + B_1 w_(j-1-d) + B_0 w_(j-d)
    y_j      = C x_j + D_2 w_(j-2-d) + D_1 w_(j-1-d)

d is the number of whole sub-steps in the dead time; its remainder divides a sub-step between older and newer values,
which the B hold. The first states do not look at the others, x_(j+1) = x_j + decline x_j + ...: they are the creep.

The sensor sees y some samples ago and a part of one. The part makes a second output, like y but taken
within the sub-step in which that time lies:

    reading        = quantum floor((y seen + noise) / quantum + 1/2)

The controller and the law are steps, passed as function pointers with their parameters and their state. All other
stages are one block of numbers, `plant`, with one state. Its parts follow each other without gaps:

    amplifier    slew per sub-step, sub-step / time constant, gain, offset, lowest and highest voltage
    head         number of creep elements, order (states of the linear stage), d, whole samples of the sensor's delay,
                 sub-steps of a sample, sub-step in which the part of a sample ends or -1 without one, quantum
    linear       decline, A without the creep's rows, B_0, B_1, B_2, and two rows for `output`, the first one for y
                 at a sample, the second one for y at the end of the part of a sample, within its sub-step

    state        two of the amplifier; x twice, the second time as room for the next one; the ring of the law's last
                 d + 3 outputs; the ring of displacements that the sensor has still to show, and the last one that
                 was taken within a sub-step

The amplifier's voltage s slews towards its target and charges the load, voltage v, through a resistance:

    s' = +-slew until s is the target,        v' = (s - v) / tau

With e = 1 - exp(-t / tau) both pieces of s have closed forms:

    ramp from s0 to s1 in the time t     v + (s0 - v) e + (s1 - s0) (1 - tau e / t)
    constant s1                          v + (s1 - v) e

Without a controller the chain is a step from command to displacement (`chain_step`, `chain_start` at rest). It has

    parameters   length of the law's state, 1 for an output at the end of the sample, quantum, the amplifier's six,
                 number of creep elements, order, d, sub-steps of a sample, the row for `output`, decline, A, B_0, B_1,
                 B_2 as above, x at rest under a constant input of one, and the parameters of the law

    state        last command, place of the law's last output in its ring, two of the amplifier, the law's own, x twice,
                 and the ring of the law's last d + 3 outputs
"""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from numba import float64, int64, types, void

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import borrowed, by_address, inlined, signed_closure, signed_kernel
from hysim.kernels.controllers import CONTROLLER, LARGEST, SIGNALS, ControllerStep, guarded
from hysim.kernels.stepping import CONSTANTS, START, STEP, VECTOR, Start, Step

INPUTS = types.Array(float64, 2, "C", readonly=True)
CONSTANT_ROWS = INPUTS
LOST = types.Array(int64, 1, "C")

_LARGEST_FRACTION = 2.0**52  # larger numbers are whole

N_AMPLIFIER = 6
N_HEAD = N_AMPLIFIER + 7


@inlined
def charge(parameters: FloatArray, voltages: FloatArray, target: float) -> float:
    """The voltage v at the end of a sub-step; `voltages` is (s, v) and moves along.

    `parameters` begins with (slew per sub-step, sub-step / tau); infinite ones act at once.
    """
    reach, rate = parameters[0], parameters[1]
    begin, v = voltages[0], voltages[1]
    way = target - begin
    if abs(way) > reach:
        end, ramp = begin + math.copysign(reach, way), 1.0
    else:
        end, ramp = target, abs(way) / reach
    voltages[0] = end
    if rate == math.inf:
        v = end
    else:
        if ramp * rate > 0.0:
            decayed = -math.expm1(-ramp * rate)
            v += (begin - v) * decayed + (end - begin) * (1.0 - decayed / (ramp * rate))
        v += (end - v) * -math.expm1(-(1.0 - ramp) * rate)
    voltages[1] = v
    return float(v)


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
    """The linear stage over one sub-step.

    `x` is twice as long as the state. `A` has the rows after the creep's, `B` is (B_0, B_1, B_2), both row by row.
    """
    creeping, order = decline.size, x.size // 2
    for i in range(order):
        following = B[order + i] * older + B[i] * newer + B[2 * order + i] * oldest
        if i < creeping:
            following = x[i] + (decline[i] * x[i] + following)
        else:
            row = A[(i - creeping) * order :]
            for j in range(order):
                following += row[j] * x[j]
        x[order + i] = following
    for i in range(order):
        x[i] = x[order + i]


N_STEP = 3  # parameters of a chain without controller before those of its amplifier
N_STAGES = N_STEP + N_AMPLIFIER + 4
N_PLACE = 2  # places of its state before those of its amplifier


_CHAIN = float64(STEP, CONSTANTS, VECTOR, float64)
_CHAIN_START = void(STEP, START, CONSTANTS, VECTOR, float64)


def chain_step(law: Step) -> Step:
    """The step of an amplifier, a law, a linear stage and a quantum in series."""
    chain_by, law_by = by_address(chain, _CHAIN), by_address(law, STEP.signature)

    @signed_closure(STEP.signature)
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        return chain_by(law_by, parameters, state, u)

    return step


def chain_start(law: Step, law_start: Start) -> Start:
    """The start of the chain at rest at a command; one that integrates rests at zero only, else it is not finite."""
    rest_by, law_by = by_address(chain_at_rest, _CHAIN_START), by_address(law, STEP.signature)
    start_by = by_address(law_start, START.signature)

    @signed_closure(START.signature)
    def start(parameters: FloatArray, state: FloatArray, u0: float) -> None:
        rest_by(law_by, start_by, parameters, state, u0)

    return start


@inlined
def rounded(y: float, quantum: float) -> float:
    """The nearest whole number of quanta; a quantum of zero means no rounding."""
    quanta = y / quantum + 0.5 if quantum > 0.0 else math.inf
    return quantum * math.floor(quanta) if abs(quanta) < _LARGEST_FRACTION else y


@signed_kernel(_CHAIN)
def chain(law: Step, parameters: FloatArray, state: FloatArray, u: float) -> float:
    """The displacement at the next command `u`; see `chain_step`."""
    parameters, state = borrowed(parameters), borrowed(state)
    at_end, quantum, amplifier = parameters[1] != 0.0, parameters[2], parameters[N_STEP:N_STAGES]
    creeping, order, lag = int(amplifier[6]), int(amplifier[7]), int(amplifier[8])
    substeps, ring = int(amplifier[9]), lag + 3
    row, a = parameters[N_STAGES : N_STAGES + order + 3], N_STAGES + order + 3
    decline, b = parameters[a : a + creeping], a + creeping
    A, c = parameters[b : b + (order - creeping) * order], b + (order - creeping) * order
    B, own = parameters[c : c + 3 * order], parameters[c + 4 * order :]
    voltages, begin = state[N_PLACE : N_PLACE + 2], N_PLACE + 2
    memory, end = state[begin : begin + int(parameters[0])], begin + int(parameters[0])
    x, past = state[end : end + 2 * order], state[end + 2 * order :]
    target = min(max(amplifier[2] * u + amplifier[3], amplifier[4]), amplifier[5])
    place, y = int(state[1]), 0.0
    for sub in range(substeps):
        v = charge(amplifier, voltages, target)
        w = law(own, memory, v)
        place = (place + 1) % ring
        past[place] = w
        oldest, older, newer = past[(place + 1) % ring], past[(place + 2) % ring], past[(place + 3) % ring]
        if sub == 0 and not at_end:
            y = output(row, x, oldest, older, newer)
        advance(decline, A, B, x, oldest, older, newer)
    if at_end:
        y = output(row, x, past[(place + 2) % ring], past[(place + 3) % ring], 0.0)
    state[0], state[1] = u, place
    return float(rounded(y, quantum))


@signed_kernel(_CHAIN_START)
def chain_at_rest(law: Step, law_start: Start, parameters: FloatArray, state: FloatArray, u0: float) -> None:
    """The state at rest at the command `u0`; see `chain_start`."""
    amplifier = parameters[N_STEP:N_STAGES]
    creeping, order = int(amplifier[6]), int(amplifier[7])
    rest_at = N_STAGES + order + 3 + creeping + (order - creeping) * order + 3 * order
    own, begin, size = parameters[rest_at + order :], N_PLACE + 2, int(parameters[0])
    memory, x = state[begin : begin + size], state[begin + size : begin + size + order]
    past = state[begin + size + 2 * order :]
    voltage = min(max(amplifier[2] * u0 + amplifier[3], amplifier[4]), amplifier[5])
    law_start(own, memory, voltage)
    level = law(own, memory, voltage)
    state[0], state[N_PLACE], state[N_PLACE + 1] = u0, voltage, voltage
    for i in range(order):
        x[i] = parameters[rest_at + i] * level if level != 0.0 else 0.0
    for i in range(past.size):
        past[i] = level


@signed_kernel(
    int64(
        CONTROLLER, CONSTANTS, VECTOR, STEP, CONSTANTS, VECTOR, CONSTANTS, VECTOR,
        INPUTS, int64, int64, SIGNALS, SIGNALS,
    )
)  # fmt: skip
def close(
    controller: ControllerStep,
    controller_parameters: FloatArray,
    controller_state: FloatArray,
    law: Step,
    law_parameters: FloatArray,
    law_state: FloatArray,
    plant: FloatArray,
    plant_state: FloatArray,
    inputs: FloatArray,
    start: int,
    stop: int,
    samples: FloatArray,
    path: FloatArray,
) -> int:
    """Run the samples `start` to `stop - 1`: the first one that is not finite, or -1.

    Parameters
    ----------
    controller, law
        Steps, each followed by its parameters and its state; the states move along, from call to call too.
    plant, plant_state : array
        The other stages; the module's docstring says what stands where.
    inputs : array, shape (2, n)
        Reference and noise of the sensor, of the whole run.
    samples : array, shape (4, n)
        For the results at the samples: command, drive, displacement and measurement.
    path : array, shape (2, n substeps)
        For the results at the sub-steps: voltage at the law, and its output.
    """
    plant, plant_state = borrowed(plant), borrowed(plant_state)
    p = N_AMPLIFIER
    creeping, order, lag, late = int(plant[p]), int(plant[p + 1]), int(plant[p + 2]), int(plant[p + 3])
    substeps, seen_in, quantum = int(plant[p + 4]), int(plant[p + 5]), plant[p + 6]
    p, others = N_HEAD, (order - creeping) * order
    decline, p = plant[p : p + creeping], p + creeping
    A, p = plant[p : p + others], p + others
    B, p = plant[p : p + 3 * order], p + 3 * order
    at_samples, within = plant[p : p + order + 3], plant[p + order + 3 :]
    ring, waiting = lag + 3, late + 1
    s = 2 + 2 * order
    x, past, readings = plant_state[2:s], plant_state[s:], plant_state[s + ring :]
    largest = LARGEST if controller_state.size > 1 else math.inf  # `through` alone passes on what is finite
    for k in range(start, stop):
        j = k * substeps
        y = output(at_samples, x, past[(j + 1) % ring], past[(j + 2) % ring], 0.0)
        readings[k % waiting] = y if seen_in < 0 else readings[waiting]
        measurement = readings[(k + 1) % waiting] + inputs[1, k]
        if quantum > 0.0:
            measurement = quantum * ((measurement / quantum + 0.5) // 1.0)
        drive = guarded(controller, controller_parameters, controller_state, inputs[0, k], measurement)
        samples[0, k], samples[1, k], samples[2, k], samples[3, k] = controller_state[0], drive, y, measurement
        if not (abs(y) < largest and math.isfinite(drive)):  # a drive beyond all limits is one at a limit
            return k
        target = min(max(plant[2] * drive + plant[3], plant[4]), plant[5])
        for sub in range(substeps):
            j = k * substeps + sub
            v = charge(plant, plant_state, target)
            w = law(law_parameters, law_state, v)
            path[0, j], path[1, j] = v, w
            if not (math.isfinite(v) and math.isfinite(w)):
                return k
            past[j % ring] = w
            oldest, older, newer = past[(j + 1) % ring], past[(j + 2) % ring], past[(j + 3) % ring]
            if sub == seen_in:
                readings[waiting] = output(within, x, oldest, older, newer)
            advance(decline, A, B, x, oldest, older, newer)
    return -1


@signed_kernel(
    int64(
        CONTROLLER, CONSTANT_ROWS, SIGNALS, STEP, CONSTANTS, CONSTANTS, CONSTANTS, CONSTANTS,
        INPUTS, SIGNALS, LOST,
    )
)  # fmt: skip
def close_each(
    controller: Callable[..., float],
    parameters: FloatArray,
    states: FloatArray,
    law: Step,
    law_parameters: FloatArray,
    law_rest: FloatArray,
    plant: FloatArray,
    plant_rest: FloatArray,
    inputs: FloatArray,
    displacements: FloatArray,
    lost: npt.NDArray[np.int64],
) -> int:
    """Close a loop from rest with each of several controllers of one kind; 0.

    Parameters
    ----------
    parameters, states : array, shape (m, p) and (m, q)
        Of the controllers; the states move along.
    law_rest, plant_rest : array
        States at rest, as `close` takes them.
    inputs : array, shape (2, n)
        As `close` takes them.
    displacements : array, shape (m, n)
        For the displacements at the samples.
    lost : array, shape (m,)
        For the results of `close`.
    """
    n, substeps = inputs.shape[1], int(plant[N_AMPLIFIER + 4])
    samples, path = np.empty((4, n)), np.empty((2, n * substeps))
    for i in range(lost.size):
        law_state, plant_state = law_rest.copy(), plant_rest.copy()
        lost[i] = close(
            controller, parameters[i], states[i], law, law_parameters, law_state, plant, plant_state, inputs, 0, n,
            samples, path,
        )  # fmt: skip
        for k in range(n):  # a slice would compile two seconds longer, for the text of an error
            displacements[i, k] = samples[2, k]
    return 0
