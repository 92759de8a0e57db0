"""The paper's equations as it prints them, voltages in V, displacements in um.

    (1)     G(s) = (0.07962 s + 0.1521) / (s^4 + 2.201 s^3 + 7.816 s^2 + 8.423 s + 6.93)
    (4)     G(s) = (-0.02777 s - 0.06457) / (s^2 + 0.1157 s + 0.2176)
    (5)     G(s) = k / (s^2 + 2 xi w_n s + w_n^2)
    (6)     G(s) = -0.0722 / (s^2 + 0.1187 s + 0.243)
    (7, 8)  x' = [[-1.1577, -2.6439], [1, 0]] x + [1; 0] u,  y = [0, 0.0579] x,
            which is G(s) = 0.0579 / (s^2 + 1.1577 s + 2.6439)
    (17)    u(t) = Kp e(t) + Kp/Ti int_0^t e dt + Kp Td de/dt

(1) is the model that the paper identifies on Table 1, (4) the one on Table 2; (7) and (6) are their estimates
by a second-order model. The paper prints no unit of time. For (1) it is taken as the second and the dwell as
free (`hysim.paper.best_dwell`); for (4) it is inferred (`hysim.paper.reidentification`). The state-space forms
(7) to (16) are in `hysim.paper.state_space`, the amplifier (2), (3) in `hysim.paper.amplifier`.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, frozen
from hysim.control import to_control
from hysim.paper import printed
from hysim.paper.printed import floats
from hysim.paper.step_reading import step_reading
from hysim.plants.transfer_function import TransferFunction

EQUATION_1 = TransferFunction(num=floats(printed.NUM_1), den=floats(printed.DEN_1))
EQUATION_4 = TransferFunction(num=floats(printed.NUM_4), den=floats(printed.DEN_4))
EQUATION_6 = TransferFunction(num=floats(printed.NUM_6), den=floats(printed.DEN_6))
EQUATION_7 = TransferFunction(num=floats(printed.C_8[0][1:]), den=(1.0, *(-value for value in floats(printed.A_7[0]))))


@frozen
class Characteristics:
    """Characteristics of a transfer function.

    Parameters
    ----------
    poles, zeros : tuple of complex
        Roots of the denominator and of the numerator [rad per unit of time].
    dc_gain : float
        G(0) [unit of y / unit of u].
    natural_frequencies, damping_ratios : tuple of float
        Of each pole, in the order of `poles` [rad per unit of time, 1].
    overshoot_percent : float
        Of the step response, over its final value [%]; 0 where it has none.
    peak_time : float
        Of the step response's largest excursion towards its final value [unit of time].
    """

    poles: tuple[complex, ...]
    zeros: tuple[complex, ...]
    dc_gain: float
    natural_frequencies: tuple[float, ...]
    damping_ratios: tuple[float, ...]
    overshoot_percent: float
    peak_time: float


def characteristics(model: TransferFunction) -> Characteristics:
    """Poles, zeros, gain and damping of a stable model, by python-control.

    Parameters
    ----------
    model : TransferFunction
        With a gain at zero frequency, and without delay.

    Examples
    --------
    >>> found = characteristics(second_order(2.0, natural_frequency=2.0, damping_ratio=0.5))
    >>> found.dc_gain, round(found.natural_frequencies[0], 9), round(found.damping_ratios[0], 9)
    (0.5, 2.0, 0.5)
    >>> round(found.overshoot_percent, 1)
    16.3
    """
    import control

    system = to_control(model)
    frequencies, dampings, poles = control.damp(system, doprint=False)
    step = step_reading(system)
    return Characteristics(
        poles=tuple(complex(pole) for pole in poles),
        zeros=tuple(complex(zero) for zero in control.zeros(system)),
        dc_gain=float(control.dcgain(system)),
        natural_frequencies=tuple(float(value) for value in frequencies),
        damping_ratios=tuple(float(value) for value in dampings),
        overshoot_percent=step.overshoot_percent,
        peak_time=step.peak_time,
    )


def second_order(gain: float, natural_frequency: float, damping_ratio: float) -> TransferFunction:
    """Equation (5), k / (s^2 + 2 xi w_n s + w_n^2).

    Parameters
    ----------
    gain : float
        The numerator k as the paper prints it; the gain at zero frequency is k / w_n^2.
    natural_frequency : float
        w_n [rad per unit of time].
    damping_ratio : float
        xi.
    """
    return TransferFunction(num=(gain,), den=(1.0, 2.0 * damping_ratio * natural_frequency, natural_frequency**2))


def pid_standard(Kp: float, Ti: float, Td: float, *, derivative_filter: float = 0.0) -> Any:
    """Equation (17) as a python-control transfer function, Kp (1 + 1 / (Ti s) + Td s / (1 + derivative_filter s)).

    Parameters
    ----------
    Kp : float
        Proportional gain [unit of u / unit of error].
    Ti : float
        Integral time [unit of time]; infinite for none.
    Td : float
        Derivative time [unit of time].
    derivative_filter : float
        Time constant of the derivative's first-order filter [unit of time]; 0, as printed, for an ideal
        derivative, which is improper: its step response is not a function.

    Raises
    ------
    ValueError
        If Ti is not positive, or Td or the filter is negative.

    Examples
    --------
    >>> controller = pid_standard(2.0, Ti=4.0, Td=0.5)
    >>> [float(c) for c in controller.num[0][0]], [float(c) for c in controller.den[0][0]]
    ([4.0, 8.0, 2.0], [4.0, 0.0])
    """
    import control

    if not Ti > 0.0:
        raise ValueError(f"Ti must be positive, got {Ti}; leave the integral out by an infinite one")
    if not (Td >= 0.0 and derivative_filter >= 0.0):
        raise ValueError(f"Td and derivative_filter must not be negative, got {Td} and {derivative_filter}")
    integral = [1.0] if math.isinf(Ti) else [Ti, 0.0]
    derivative = [derivative_filter, 1.0] if derivative_filter else [1.0]
    num = np.polymul(integral, derivative)
    if not math.isinf(Ti):
        num = np.polyadd(num, derivative)
    num = np.polyadd(num, np.polymul(integral, [Td, 0.0]))
    return control.tf(Kp * num, np.polymul(integral, derivative))


def in_time_unit(model: TransferFunction, unit: float) -> TransferFunction:
    """This plant with time counted in `unit` seconds: G(s / unit)."""
    num, den = (
        tuple(c / unit**power for c, power in zip(side, range(len(side) - 1, -1, -1), strict=True))
        for side in (model.num, model.den)
    )
    return TransferFunction(num=num, den=den, delay=model.delay / unit, hold=model.hold, sample=model.sample)


def settling_window(model: TransferFunction) -> float:
    """Twice the time in which the envelope of the slowest mode falls to 2 % [unit of time], 2 ln 50 / |Re pole|."""
    return 2.0 * math.log(50.0) / float(np.min(-model.poles.real))


def step_response(model: TransferFunction, duration: float = 20.0) -> tuple[FloatArray, FloatArray]:
    """Times and response [um] to a step of one volt, at 801 even times up to `duration`, by python-control."""
    import control

    response = control.step_response(to_control(model), np.linspace(0.0, duration, 801))
    return np.asarray(response.time), np.asarray(response.outputs)


def unit_step(model: TransferFunction, time: FloatArray) -> FloatArray:
    """Displacement at even times from zero [unit of time], exact at each: a step is held from sample to sample."""
    return replace(model, hold="zoh", sample="start").response(np.ones_like(time), float(time[1]))
