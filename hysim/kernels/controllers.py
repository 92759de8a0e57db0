"""Sampled controllers, one sample at a time: the voltage to apply from a reference and a measurement.

PID with two degrees of freedom, filtered derivative and back-calculation (K. J. Astrom and T. Hagglund,
Advanced PID Control, 2006, chapter 13), e = r - y and h the sample time:

    D  <- T_f / (T_f + h) D + kd / (T_f + h) (change of c r - y)
    v   = kp (b r - y) + I + D                  command
    u   = v within the limits                   voltage
    I  <- I + ki h e + h / T_t (u - v)

Every controller is a function `command(parameters, state, reference, measurement) -> voltage` of one type,
so that a loop is compiled once for all of them. Its state begins with the last command, before the limits.

Loops, C and `SampledController.step` take every sample through `guarded`. A reference or measurement that is not
finite, or beyond `LARGEST`, is replaced by the last valid one; where a step gives no finite voltage, the last one is
held. Both are counted. Behind the controller's own state stand the last valid reference and measurement, the last
voltage, and the count. A last valid measurement of nan stays so: the controller itself then goes without it.
"""

import math
from collections.abc import Callable

from numba import float64, int64, types

from hysim._basics.frozen import FloatArray
from hysim.kernels._compile import borrowed, signed_kernel
from hysim.kernels.stepping import CONSTANTS, VECTOR

ControllerStep = Callable[[FloatArray, FloatArray, float, float], float]
SIGNALS = types.Array(float64, 2, "C")
CONTROLLER = types.FunctionType(float64(CONSTANTS, VECTOR, float64, float64))

LARGEST = 1e100  # of a signal: its cube is finite, and so is its product with any sensible gain
N_HELD = 4


@signed_kernel(float64(CONSTANTS, VECTOR, float64, float64))
def pid(parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
    """The PID's voltage; `state` is (v, I, D, c r - y) and moves along.

    `parameters` is (kp, ki h, kd / (T_f + h), T_f / (T_f + h), b, c, lowest u, highest u, h / T_t).
    """
    weighted = parameters[5] * reference - measurement
    derivative = parameters[3] * state[2] + parameters[2] * (weighted - state[3])
    command = parameters[0] * (parameters[4] * reference - measurement) + state[1] + derivative
    u = min(max(command, parameters[6]), parameters[7])
    state[0], state[2], state[3] = command, derivative, weighted
    state[1] += parameters[1] * (reference - measurement)
    if u != command:
        state[1] += parameters[8] * (u - command)
    return float(u)


@signed_kernel(float64(CONSTANTS, VECTOR, float64, float64))
def linear(parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
    """The command bias + C x + D e within the limits, then x' = A x + B e, with e = reference - measurement.

    `parameters` are (bias, lowest and highest command, D, C, B, A); `state` is (command, x, room for it).
    """
    n, error, command = (state.size - 1) // 2, reference - measurement, parameters[0]
    command += parameters[3] * error
    for i in range(n):
        command += parameters[4 + i] * state[1 + i]
        total = parameters[4 + n + i] * error
        for j in range(n):
            total += parameters[4 + (2 + i) * n + j] * state[1 + j]
        state[1 + n + i] = total
    for i in range(n):
        state[1 + i] = state[1 + n + i]
    state[0] = command
    return float(min(max(command, parameters[1]), parameters[2]))


@signed_kernel(float64(CONSTANTS, VECTOR, float64, float64))
def through(parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
    """No controller: the voltage is the reference."""
    state[0] = reference
    return reference


@signed_kernel(float64(CONTROLLER, CONSTANTS, VECTOR, float64, float64))
def guarded(
    controller: ControllerStep, parameters: FloatArray, state: FloatArray, reference: float, measurement: float
) -> float:
    """The voltage of a controller that holds at samples that are not finite; the state 0 of `through` has no room."""
    if state.size <= N_HELD:
        return controller(parameters, state, reference, measurement)
    state = borrowed(state)
    own, held, is_valid = state[: state.size - N_HELD], state[state.size - N_HELD :], True
    if abs(reference) <= LARGEST:
        held[0] = reference
    else:
        reference, is_valid = held[0], False
    if not abs(measurement) <= LARGEST:
        measurement, is_valid = held[1], False
    elif not math.isnan(held[1]):
        held[1] = measurement
    u = controller(parameters, own, reference, measurement)
    if math.isfinite(u):
        held[2] = u
    if not (is_valid and math.isfinite(u)):
        held[3] += 1.0
    return float(held[2])


@signed_kernel(int64(CONTROLLER, CONSTANTS, VECTOR, CONSTANTS, CONSTANTS, SIGNALS, VECTOR))
def replay(
    controller: ControllerStep,
    parameters: FloatArray,
    state: FloatArray,
    reference: FloatArray,
    measurement: FloatArray,
    places: FloatArray,
    u: FloatArray,
) -> int:
    """Voltages of a controller for recorded references and measurements, and the first places of its state; 0.

    `places` are one row for each place, the first of which is the command.
    """
    for k in range(reference.size):
        u[k] = guarded(controller, parameters, state, reference[k], measurement[k])
        for i in range(len(places)):
            places[i, k] = state[i]
    return 0
