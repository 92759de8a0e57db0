"""The paper's equations as it prints them, and what follows from them; voltages in V, displacements in um.

    (1)     G(s) = (0.07962 s + 0.1521) / (s^4 + 2.201 s^3 + 7.816 s^2 + 8.423 s + 6.93)
    (2)     V_out = V_in (Rf/R2 + 1)             non-inverting amplifier
    (3)     slew rate = 2 pi f V                 steepest slope of a sine of amplitude V
    (4)     G(s) = (-0.02777 s - 0.06457) / (s^2 + 0.1157 s + 0.2176)
    (5)     G(s) = k / (s^2 + 2 xi w_n s + w_n^2)
    (6)     G(s) = -0.0722 / (s^2 + 0.1187 s + 0.243)
    (7, 8)  x' = [[-1.1577, -2.6439], [1, 0]] x + [1; 0] u,  y = [0, 0.0579] x,
            which is G(s) = 0.0579 / (s^2 + 1.1577 s + 2.6439)
    (9, 11) Gc = [B, A B],   Go = [C; C A]
    (13, 14) x' = [[-0.1187, -2.430], [1, 0]] x + [1; 0] u,    y = [0, -0.0722] x
    (17)    u(t) = Kp e(t) + Kp/Ti int_0^t e dt + Kp Td de/dt

(1) is the model that the paper identifies on Table 1, (4) the one on Table 2; (7) and (6) are their estimates
by a second-order model. The paper prints no unit of time. For (1) it is taken as the second and the dwell as
free (`hysim.paper.study.printed_model`); for (4) it is inferred (`hysim.paper.reidentification`).

The state-space forms are companion forms: k / (s^2 + a_1 s + a_0) becomes A = [[-a_1, -a_0], [1, 0]], B = [1; 0],
C = [0, k]. The paper takes V of (3) at the amplifier's input; it is the output that slews.

The paper derives (7) from (1), and (6) from (4), by (5), and calls each pair similar. Here a pair is compared by the
step response over the time in which both have settled (`settling_window`), and (5) is also matched anew to the
response's final value, overshoot and peak time:

    xi = L / sqrt(pi^2 + L^2),  L = -ln(overshoot),    w_n = pi / (t_peak sqrt(1 - xi^2)),    k = G(0) w_n^2
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray, checked, frozen
from hysim.control import to_control
from hysim.metrics import fit_percent
from hysim.paper import printed
from hysim.paper.printed import Matrix, floats
from hysim.paper.step_reading import step_reading
from hysim.plants.stages import Amplifier
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


_ROUNDING = 1e-12  # leading coefficients of this size, relative to the largest, are what is left of zeros


@checked
class StateSpace:
    """x' = A x + B u, y = C x, time in the model's own unit.

    Parameters
    ----------
    A : array, shape (n, n)
    B : array, shape (n, 1)
    C : array, shape (1, n)
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray

    @property
    def controllability(self) -> FloatArray:
        """[B, A B, ...], equation (9), by python-control."""
        import control

        return np.asarray(control.ctrb(self.A, self.B))

    @property
    def observability(self) -> FloatArray:
        """[C; C A; ...], equation (11), by python-control."""
        import control

        return np.asarray(control.obsv(self.A, self.C))

    @property
    def transfer_function(self) -> TransferFunction:
        """C (s I - A)^-1 B."""
        import control

        system = control.ss2tf(self.A, self.B, self.C, 0.0)
        num, den = system.num_array[0, 0], system.den_array[0, 0]
        num = np.where(np.abs(num) > _ROUNDING * np.abs(num).max(), num, 0.0)
        return TransferFunction(num=tuple(np.trim_zeros(num, "f")), den=tuple(den))


def companion(model: TransferFunction) -> StateSpace:
    """The companion form in which the paper writes (7), (8), (13), (14), of a strictly proper model.

    Raises
    ------
    ValueError
        If the numerator's degree is the denominator's.

    Examples
    --------
    >>> form = companion(TransferFunction(num=(3.0,), den=(1.0, 2.0, 5.0)))
    >>> form.A.tolist(), form.C.tolist()
    ([[-2.0, -5.0], [1.0, 0.0]], [[0.0, 3.0]])
    """
    if len(model.num) > model.order:
        raise ValueError("a companion form without feedthrough needs a strictly proper model")
    den = np.array(model.den) / model.den[0]
    A = np.vstack([-den[1:], np.eye(model.order - 1, model.order)])
    C = np.concatenate([np.zeros(model.order - len(model.num)), np.array(model.num) / model.den[0]])
    return StateSpace(A=A, B=np.eye(model.order, 1), C=C[np.newaxis])


def printed_characteristics() -> dict[str, Characteristics]:
    """Characteristics of the printed models by the numbers of their equations."""
    models = {
        "(1)": EQUATION_1,
        "(7), (8)": EQUATIONS_7_8.transfer_function,
        "(4)": EQUATION_4,
        "(6)": EQUATION_6,
        "(13), (14)": EQUATIONS_13_14.transfer_function,
    }
    return {name: characteristics(model) for name, model in models.items()}


def array(matrix: Matrix) -> FloatArray:
    """A printed matrix as numbers."""
    return np.array([floats(row) for row in matrix])


def state_space(A: FloatArray, C: FloatArray) -> StateSpace:
    """A form with the B that the paper prints for both."""
    return StateSpace(A=A, B=array(printed.B), C=C)


EQUATIONS_7_8 = state_space(array(printed.A_7), array(printed.C_8))
EQUATIONS_13_14 = state_space(array(printed.A_13), array(printed.C_14))

_INTERVALS = 4000


@frozen
class Approximation:
    """A simpler model and the one that it approximates.

    Parameters
    ----------
    name, of : str
        The equations.
    simpler, full : Characteristics
        Of either.
    fit_percent : float
        Fit of the simpler model's step response to the other's [%].
    matched_fit_percent : float
        Fit of the step response of equation (5) with the full model's final value, overshoot and peak time [%].
    """

    name: str
    of: str
    simpler: Characteristics
    full: Characteristics
    fit_percent: float
    matched_fit_percent: float


def approximations() -> tuple[Approximation, ...]:
    """(7) as an estimate of (1), and (6) of (4)."""
    return _approximation("(7)", EQUATION_7, "(1)", EQUATION_1), _approximation("(6)", EQUATION_6, "(4)", EQUATION_4)


def _approximation(name: str, simpler: TransferFunction, of: str, full: TransferFunction) -> Approximation:
    exact = characteristics(full)
    return Approximation(
        name=name,
        of=of,
        simpler=characteristics(simpler),
        full=exact,
        fit_percent=step_fit(full, simpler),
        matched_fit_percent=step_fit(full, matched_second_order(exact)),
    )


def step_fit(full: TransferFunction, simpler: TransferFunction) -> float:
    """Fit [%] of the simpler model's step response to the other's, until both have settled.

    Means over the middles of 4000 even intervals stand for means over time; finer ones change it by less than 0.001.
    """
    time = np.linspace(0.0, max(settling_window(full), settling_window(simpler)), 2 * _INTERVALS + 1)
    return fit_percent(unit_step(full, time)[1::2], unit_step(simpler, time)[1::2])


def matched_second_order(full: Characteristics) -> TransferFunction:
    """Equation (5) with this final value, overshoot and peak time.

    Raises
    ------
    ValueError
        If there is no overshoot to match.

    Examples
    --------
    >>> import pytest
    >>> original = second_order(2.0, natural_frequency=3.0, damping_ratio=0.2)
    >>> matched_second_order(characteristics(original)).den[1:] == pytest.approx(original.den[1:], rel=1e-3)
    True
    """
    if full.overshoot_percent <= 0.0:
        raise ValueError("a response without overshoot has no peak to match")
    decay = -math.log(full.overshoot_percent / 100.0)
    damping_ratio = decay / math.hypot(math.pi, decay)
    natural_frequency = math.pi / (full.peak_time * math.sqrt(1.0 - damping_ratio**2))
    return second_order(full.dc_gain * natural_frequency**2, natural_frequency, damping_ratio)


UA741_SUPPLY_SPAN = 44.0
"""Most that a uA741 may have between its supplies, 22 V each side [V]; the absolute maximum rating in the part's
data sheets. Its output stays between its supplies."""


def resistor_ratio(output: float, input: float) -> float:
    """Rf/R2 that equation (2) needs to make `output` of `input` [V].

    Examples
    --------
    >>> resistor_ratio(50.0, 5.0)
    9.0
    """
    return output / input - 1.0


def voltage_gain(ratio: float) -> float:
    """V_out / V_in of equation (2) with Rf/R2 = `ratio`."""
    return ratio + 1.0


def full_power_bandwidth(slew_rate: float, amplitude: float) -> float:
    """Highest frequency [Hz] at which a sine of this amplitude is not slewed, by equation (3).

    Parameters
    ----------
    slew_rate : float
        Of the amplifier's output [V/s].
    amplitude : float
        Of the sine [V]. It is the output that slews: the output's amplitude belongs here.

    Raises
    ------
    ValueError
        If either is not positive.

    Examples
    --------
    >>> round(full_power_bandwidth(0.5e6, 5.0)), round(full_power_bandwidth(0.5e6, 50.0))
    (15915, 1592)
    """
    return Amplifier(slew_rate=slew_rate).full_power_bandwidth(amplitude)
