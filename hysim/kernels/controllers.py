"""Sampled controllers, one sample at a time: the voltage to apply from a reference and a measurement.

PID with two degrees of freedom, filtered derivative and back-calculation (K. J. Astrom and T. Hagglund,
Advanced PID Control, 2006, chapter 13), e = r - y and h the sample time:

    D  <- T_f / (T_f + h) D + kd / (T_f + h) (change of c r - y)
    v   = kp (b r - y) + I + D                  command
    u   = v within the limits                   voltage
    I  <- I + ki h e + h / T_t (u - v)

Every controller is a function `command(parameters, state, reference, measurement) -> voltage` of one type,
so that a loop is compiled once for all of them. Its state begins with the last command, before the limits.
"""

from collections.abc import Callable

from numba import float64, int64, types

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_kernel
from hysim.kernels.stepping import CONSTANTS, VECTOR

ControllerStep = Callable[[FloatArray, FloatArray, float, float], float]
CONTROLLER = types.FunctionType(float64(CONSTANTS, VECTOR, float64, float64))


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
def through(parameters: FloatArray, state: FloatArray, reference: float, measurement: float) -> float:
    """No controller: the voltage is the reference."""
    state[0] = reference
    return reference


@signed_kernel(int64(CONTROLLER, CONSTANTS, VECTOR, CONSTANTS, CONSTANTS, VECTOR, VECTOR))
def replay(
    controller: ControllerStep,
    parameters: FloatArray,
    state: FloatArray,
    reference: FloatArray,
    measurement: FloatArray,
    command: FloatArray,
    u: FloatArray,
) -> int:
    """Commands and voltages of a controller for recorded references and measurements; 0."""
    for k in range(reference.size):
        u[k] = controller(parameters, state, reference[k], measurement[k])
        command[k] = state[0]
    return 0
