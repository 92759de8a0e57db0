"""The verb `to_control`: plants and controllers as systems of python-control.

Those with a memory become nonlinear systems:

    x[k+1] = f(x[k], u[k]),    y[k] = g(x[k])

A discrete plant is one sample of hysim's own loop: x is the state carried from sample to sample, and y the measurement
just before the new command u[k], so that no command reaches the output of its own sample. A controller's command
answers to the inputs at once. Both are functions of their arguments alone, and states are counted from rest at u = 0.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._basics.results import model_of
from hysim.control._controller import PID, SteppedController
from hysim.control._loop import is_controller
from hysim.errors import SimulationError
from hysim.laws.differential.boucwen_inverse import BoucWenInverse
from hysim.models.protocols import CompiledController, Continuable, Remembering, positive_time
from hysim.plants.actuator import Actuator, as_actuator
from hysim.plants.chain import Chain, ChainState
from hysim.plants.oscillator import BoucWenOscillator, OscillatorState
from hysim.plants.stages import Sensor, sampled
from hysim.plants.transfer_function import TransferFunction

Rule = Callable[[float, FloatArray, FloatArray, Any], FloatArray]
"""A function of python-control: time, state, input and parameters to the state's change or to the output."""


def actuator_system(actuator: Actuator, sample_time: float) -> Any:
    if isinstance(actuator.hysteresis, BoucWenInverse):
        raise TypeError("the inverse of a law is part of a controller: give it as InverseFeedforward(law=...)")
    sensor = replace(actuator.sensor or Sensor(), noise=0.0)
    chain = replace(actuator, sensor=sensor).chain(sample_time)
    rest = chain.rest(0.0)
    at_rest, names = np.concatenate(_parts(rest)), _names(chain, rest)
    carried = np.array([bool(name) for name in names])

    def state(x: FloatArray) -> ChainState:
        here = at_rest.copy()
        here[carried] += x
        return _with_parts(rest, here)

    def update(t: float, x: FloatArray, u: FloatArray, params: Any) -> FloatArray:
        signals, end = chain.driven(u, state(x))
        if signals.lost >= 0:
            raise SimulationError(f"the plant diverges after t = {t:g}, at the command {u[0]:g}")
        return np.asarray((np.concatenate(_parts(end)) - at_rest)[carried])

    def output(t: float, x: FloatArray, u: FloatArray, params: Any) -> FloatArray:
        return sensor.measure([chain.seen(state(x))])

    return _system(update, output, ["u"], "y", [name for name in names if name], sample_time)


def oscillator_system(plant: BoucWenOscillator, sample_time: float | None) -> Any:
    """Oscillator as its differential equations, or from sample to sample with its input held."""
    start: FloatArray = np.array([*(plant.initial_state or (0.0, 0.0)), plant.law.z0])
    step = sample_time or 0.0
    law, elastic_force, sampled_plant = plant.law, plant.elastic_force, replace(plant, hold="zoh")
    weight = 1.0 if plant.excitation == "force" else -plant.mass

    def slope(t: float, x: FloatArray, u: FloatArray, params: Any) -> FloatArray:
        y, velocity, z = (x + start).tolist()
        force = weight * float(u[0]) - plant.damping * velocity - (float(elastic_force(y)) + law.gain * z)
        against = law.gamma * velocity + law.beta * abs(velocity) * np.copysign(1.0, z)
        return np.array([velocity, force / plant.mass, law.A * velocity - abs(z) ** law.n * against])

    def update(t: float, x: FloatArray, u: FloatArray, params: Any) -> FloatArray:
        _, end = sampled_plant.advance(u, OscillatorState(float(u[0]), *(x + start).tolist()), sample_time=step)
        return np.array([end.y, end.velocity, end.z]) - start

    def output(t: float, x: FloatArray, u: FloatArray, params: Any) -> FloatArray:
        return (x + start)[:1]

    rule = slope if sample_time is None else update
    return _system(rule, output, ["u"], "y", ["y", "velocity", "z"], step)


def controller_system(controller: Any, sample_time: float) -> Any:
    compiled = CompiledController(*controller.compiled(sample_time, 0.0, 0.0))
    at_rest = compiled.state
    carried = np.isfinite(at_rest)  # other places are written before they are read
    if isinstance(controller, SteppedController):
        carried[at_rest.size - controller.scratch(sample_time) :] = False

    def stepped(x: FloatArray, inputs: FloatArray) -> tuple[float, FloatArray]:
        state = at_rest.copy()
        state[carried] += x
        command = compiled.step(compiled.parameters, state, float(inputs[0]), float(inputs[1]))
        return command, (state - at_rest)[carried]

    def update(t: float, x: FloatArray, inputs: FloatArray, params: Any) -> FloatArray:
        return stepped(x, inputs)[1]

    def output(t: float, x: FloatArray, inputs: FloatArray, params: Any) -> FloatArray:
        return np.array([stepped(x, inputs)[0]])

    names = [f"x[{i}]" for i in range(np.count_nonzero(carried))]
    return _system(update, output, ["reference", "measurement"], "u", names, sample_time)


def _system(update: Rule, output: Rule, inputs: list[str], name: str, states: list[str], sample_time: float) -> Any:
    import control

    return control.nlsys(update, output, inputs=inputs, outputs=[name], states=states, dt=sample_time)


def _parts(state: ChainState) -> list[FloatArray]:
    return [state.voltages, state.law.state, state.x, state.past, state.readings]


def _with_parts(state: ChainState, values: FloatArray) -> ChainState:
    ends = np.cumsum([part.size for part in _parts(state)])
    voltages, memory, x, past, readings = np.split(values, ends[:-1])
    return state._replace(voltages=voltages, law=state.law._replace(state=memory), x=x, past=past, readings=readings)


def _names(chain: Chain, state: ChainState) -> list[str]:
    """Names of the elements of a chain's state, in the order of its parts; empty for scratch."""
    creeping, order, late = chain.stage.decline.size, chain.stage.rest.size, chain.samples_late
    memory = _memory_names(chain.hysteresis, state.law.state)
    return [
        *(["output", "voltage"] if chain.amplifier.dynamic else ["", ""]),
        *memory, *[""] * (state.law.state.size - len(memory)),
        *(f"creep[{i}]" for i in range(creeping)), *(f"vibration[{i}]" for i in range(order - creeping)), *[""] * order,
        "", *(f"w[-{age}]" for age in range(chain.stage.lag + 2, 0, -1)),
        "", *(f"y[-{age}]" for age in range(late, 0, -1)), "seen" if chain.seen_in >= 0 else "",
    ]  # fmt: skip


def _memory_names(law: Any, state: FloatArray) -> list[str]:
    """Names of a law's state; a memory z begins the compiled state, and the rest is scratch."""
    remembers = isinstance(law, Remembering) and isinstance(law, Continuable)
    size = len(law.advance(state[:1])[1]) if remembers else state.size
    others = ["z"] if size == 2 else [f"z[{i}]" for i in range(size - 1)]
    return ["v", *others][:size]


def to_control(plant: Any, sample_time: float | None = None) -> Any:
    """A plant or a controller as a system of python-control.

    Inputs and outputs of nonlinear systems are called u and y, and reference, measurement and u. ``Line(slope=1.0)`` as
    an actuator's law keeps the limits of one without a law. A `TrackingController` with preview takes the reference
    ``controller.ahead(sample_time)`` samples ahead of its time.

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
    TypeError, ValueError
        If the plant is none of these; if ``sample_time <= 0``, or a dead time, a law, a pure derivative or a
        `TrackingController` is to stay continuous.

    Examples
    --------
    >>> import hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> loop = hs.to_control(lag) * hs.to_control(hs.PID(kp=4.0))
    >>> round(float((loop / (1 + loop)).dcgain()), 3)
    0.8
    """
    if sample_time is not None:
        positive_time(sample_time)
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
    """The linear chain of `hysim.plants.stages`, its held values in a chain of further states."""
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
