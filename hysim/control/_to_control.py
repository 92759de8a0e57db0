"""The verb `to_control`: plants and controllers as systems of python-control."""

import math
from typing import Any

import numpy as np

from hysim._results import model_of
from hysim.control._io_systems import actuator_system, controller_system, oscillator_system
from hysim.control._loop import as_actuator, is_controller
from hysim.control._pid import PID
from hysim.plants.actuator import Actuator
from hysim.plants.oscillator import BoucWenOscillator
from hysim.plants.sampled import sampled
from hysim.plants.transfer_function import TransferFunction


def to_control(plant: Any, sample_time: float | None = None) -> Any:
    """A plant or a controller as a system of python-control.

    Parameters
    ----------
    plant : TransferFunction, StateSpace, Modes, Actuator, law, BoucWenOscillator, PID, TrackingController or fit
        A plant without a law becomes a linear system, without the actuator's limits and slewing but with the sensor's
        delay; a PID too, from its error to its command without limits, the derivative acting on the error (this keeps
        the loop's poles). All others become nonlinear systems, memory in the state: an actuator with its limits
        and its sensor but without noise, a `TrackingController` from reference and measurement to the command.
    sample_time : float, optional
        Sample time of the discrete form, that of `close_loop` [s]. By default the system stays continuous, which laws,
        actuators with a law and a `TrackingController` cannot.

    Returns
    -------
    control.TransferFunction, control.StateSpace or control.NonlinearIOSystem
        The state zero is rest at u = 0 (of a controller also at the displacement zero), or the start of an oscillator's
        own simulations. The output of a discrete plant is the measurement just before each new command.

    Raises
    ------
    TypeError
        If the plant is none of these.
    ValueError
        If a plant with a dead time, with a law, a pure derivative or a `TrackingController` is to stay continuous,
        or the sample time is not positive.

    Notes
    -----
    Inputs and outputs of nonlinear systems are called u and y, and reference, measurement and u. ``Line(slope=1.0)``
    as an actuator's law keeps the limits of one without a law. A `TrackingController` with preview takes the
    reference ``controller.ahead(sample_time)`` samples ahead of its time.

    Examples
    --------
    >>> import control, numpy as np, hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> loop = hs.to_control(lag) * hs.to_control(hs.PID(kp=4.0))
    >>> round(float((loop / (1 + loop)).dcgain()), 3)
    0.8
    >>> play = hs.to_control(hs.Play(threshold=0.25, gain=2.0), sample_time=0.1)
    >>> control.input_output_response(play, 0.1 * np.arange(5), [0.0, 1.0, 0.75, 0.0, 0.0]).outputs.tolist()
    [0.0, 0.0, 1.5, 1.5, 0.5]
    """
    if sample_time is not None and not 0.0 < sample_time < math.inf:
        raise ValueError(f"sample_time must be positive and finite, got {sample_time}")
    plant = model_of(plant)
    if isinstance(plant, PID):
        return _pid(plant, sample_time)
    if isinstance(plant, BoucWenOscillator):
        return oscillator_system(plant, sample_time)
    if is_controller(plant):
        return controller_system(plant, _required(sample_time, plant))
    actuator = as_actuator(plant)
    if actuator.hysteresis is not None:
        return actuator_system(actuator, _required(sample_time, actuator.hysteresis))
    return _continuous(actuator) if sample_time is None else _discrete(actuator, sample_time)


def _required(sample_time: float | None, stepped: Any) -> float:
    if sample_time is None:
        raise ValueError(f"{type(stepped).__name__} moves from sample to sample: give a sample_time")
    return sample_time


def _continuous(actuator: Actuator) -> Any:
    import control

    stage, delay = actuator.linear(1.0)
    if delay:
        raise ValueError("a dead time has no continuous transfer function; give a sample_time")
    if actuator == Actuator(vibration=actuator.vibration) and isinstance(actuator.vibration, TransferFunction):
        return control.tf(actuator.vibration.num, actuator.vibration.den)
    if not stage.g.size:
        return control.tf([stage.D], [1.0])
    return control.ss(stage.rate * stage.F, stage.rate * stage.g[:, np.newaxis], stage.C[np.newaxis], stage.D)


def _discrete(actuator: Actuator, sample_time: float) -> Any:
    """The linear chain of `hysim.plants.sampled`, its held values in a chain of further states."""
    import control

    linear, delay = actuator.linear(sample_time)
    stage = sampled(linear, sample_time, delay)
    n, n_inputs = linear.g.size, stage.lag + 1
    A = np.zeros((n + n_inputs, n + n_inputs))
    A[:n, :n] = stage.A
    A[:n, -1] = stage.B[1]  # the last of the chain is v_(k-1-lag)
    A[n + 1 :, n:-1] = np.eye(n_inputs - 1)
    B = np.zeros((n + n_inputs, 1))
    B[n] = 1.0
    if stage.lag:
        A[:n, -2] = stage.B[0]
    else:
        B[:n, 0] = stage.B[0]
    C = np.concatenate([linear.C, np.zeros(n_inputs - 1), [linear.D]])
    return control.ss(A, B, C[np.newaxis], 0.0, sample_time)


def _pid(pid: PID, sample_time: float | None) -> Any:
    import control

    if sample_time is None:
        if pid.kd and not pid.derivative_filter:
            raise ValueError("a derivative without a filter is not proper; give a derivative_filter or a sample_time")
        integral, derivative = control.tf([pid.ki], [1.0, 0.0]), control.tf([pid.kd, 0.0], [pid.derivative_filter, 1.0])
        return control.tf([pid.kp], [1.0]) + (integral if pid.ki else 0.0) + (derivative if pid.kd else 0.0)
    z = control.tf("z")
    z.dt = sample_time
    lag = pid.derivative_filter + sample_time
    total = control.tf([pid.kp], [1.0], sample_time)
    if pid.ki:
        total = total + pid.ki * sample_time / (z - 1.0)
    if pid.kd:
        total = total + pid.kd / lag * (z - 1.0) / (z - pid.derivative_filter / lag)
    return total
