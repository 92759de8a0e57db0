"""Stages of an actuator besides its law: amplifier, creep and sensor, and how linear ones are stepped.

An amplifier drives a piezoelectric stack, which is a capacitor.

Creep is measured as a percentage per decade of time, y(t) = y(t_0) (1 + g log10(t / t_0)). That law has no finite
state, and no limit at either end: a bank of elements follows it over a band of times, and is at rest outside.

**Linear stages** after a law are stepped from sub-step to sub-step.

    x' = F x + g v,    y = C x + D v

v, which is delayed, is held over a sub-step or linear along it. A dead time of d sub-steps and a part of one
cuts each sub-step in two, at which the older values give way to newer ones; both pieces are exact
(`hysim.kernels.linear`). The equations that are stepped are those of `hysim.kernels.loop`.

Stages one behind the other are one stage: the output C1 x1 + D1 v of the first is the input of the second.
The states of the creep, which comes first, do not look at each other or at those behind them.
"""

import math
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt
from scipy.linalg import matrix_balance

from hysim._basics import frozen
from hysim._basics.frozen import FloatArray, Interval, NotNegative, Positive, read_only
from hysim.models.model import family
from hysim.plants._linear_response import Transition, scaled_companion, transitions
from hysim.plants.transfer_function import Modes, StateSpace, TransferFunction, resting_states

_TIMES_PER_DECADE = 20  # at which a bank of creep is fitted


class CompiledAmplifier(NamedTuple):
    """An amplifier as loops take it; see `hysim.kernels.loop`."""

    parameters: FloatArray
    state: FloatArray


@family
class Amplifier:
    """From the command to the voltage at the actuator.

    ::

        s   = gain u + offset, within the limits        the output's target
        s'  within +-slew rate                          the output
        v'  = (s - v) / time constant                   the voltage at the stack, behind the output's resistance

    Parameters
    ----------
    gain, offset : float
        Voltage gain, and output at a command of zero [V].
    limits : (float, float), optional
        Lowest and highest output; None for none [V].
    slew_rate : float, optional
        Largest rate of the output, positive; None for no bound [V/s].
    time_constant : float
        Of the output's resistance with the actuator's capacitance, R C [s]; 0 for none.

    Raises
    ------
    ValueError
        If the limits are no interval, the slew rate is not positive, or the time constant is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> amplifier = hs.Amplifier(gain=15.0, limits=(0.0, 150.0))
    >>> amplifier.voltage([-1.0, 4.0, 12.0]).tolist()
    [0.0, 60.0, 150.0]
    """

    gain: float = 1.0
    offset: float = 0.0
    limits: Interval | None = None
    slew_rate: Positive | None = None
    time_constant: NotNegative = 0.0

    @classmethod
    def non_inverting(
        cls,
        *,
        feedback_resistance: float,
        input_resistance: float,
        limits: tuple[float, float] | None = None,
        slew_rate: float | None = None,
        output_resistance: float = 0.0,
        capacitance: float = 0.0,
    ) -> "Amplifier":
        """An operational amplifier with the gain 1 + Rf / Rin, equation (2) of the paper.

        The feedback and input resistance are Rf and Rin [ohm]; the limits are those of its supplies [V], the slew rate
        is that of the output [V/s]. The output resistance [ohm] and the actuator's capacitance [F] make the time
        constant. Raises ValueError if Rin is not positive or another of these negative, or as the constructor.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.Amplifier.non_inverting(feedback_resistance=9e3, input_resistance=1e3, slew_rate=0.5e6).gain
        10.0
        """
        frozen.check_positive(input_resistance=input_resistance)
        frozen.check_not_negative(
            feedback_resistance=feedback_resistance, output_resistance=output_resistance, capacitance=capacitance
        )
        gain, time_constant = 1.0 + feedback_resistance / input_resistance, output_resistance * capacitance
        return cls(gain=gain, limits=limits, slew_rate=slew_rate, time_constant=time_constant)

    @property
    def dynamic(self) -> bool:
        """Whether the voltage takes time."""
        return self.slew_rate is not None or self.time_constant > 0.0

    @property
    def bandwidth(self) -> float:
        """Frequency at which the load takes 3 dB, 1 / (2 pi time constant) [Hz]; infinite without one."""
        return 1.0 / (2.0 * math.pi * self.time_constant) if self.time_constant else math.inf

    def full_power_bandwidth(self, amplitude: float) -> float:
        """Highest frequency [Hz] of a sine that is not slewed, slew rate / (2 pi amplitude), equation (3) of the paper.

        The amplitude is that of the output, which slews, not of the command [V]; ValueError if it is not positive.

        Examples
        --------
        >>> import hysim as hs
        >>> ua741 = hs.Amplifier(gain=10.0, slew_rate=0.5e6)
        >>> round(ua741.full_power_bandwidth(5.0)), round(ua741.full_power_bandwidth(50.0))
        (15915, 1592)
        """
        frozen.check_positive(amplitude=amplitude)
        return math.inf if self.slew_rate is None else self.slew_rate / (2.0 * math.pi * amplitude)

    def voltage(self, u: npt.ArrayLike) -> FloatArray:
        """Voltage after a command has been held, in the shape of `u`."""
        lowest, highest = self.limits or (-math.inf, math.inf)
        return np.clip(self.gain * read_only(u, "u", finite=False) + self.offset, lowest, highest)

    def command(self, voltage: float) -> float:
        """Command whose held output is this voltage, where no limit holds [unit of the command]; 0 without a gain."""
        return (voltage - self.offset) / self.gain if self.gain else 0.0

    def compiled(self, step: float, u0: float = 0.0) -> CompiledAmplifier:
        """The amplifier as compiled loops take it, for sub-steps of this length [s], at rest at the command `u0`."""
        lowest, highest = self.limits or (-math.inf, math.inf)
        reach = math.inf if self.slew_rate is None else self.slew_rate * step
        rate = step / self.time_constant if self.time_constant else math.inf
        parameters = [reach, rate, self.gain, self.offset, lowest, highest]
        return CompiledAmplifier(read_only(parameters, finite=False), np.full(2, float(self.voltage(u0))))


@family
class Creep:
    """A bank of Kelvin-Voigt elements in series with a spring.

    ::

        y = g_0 v + sum w_i q_i,    tau_i q_i' = v - q_i
        G(s) = g_0 + sum w_i / (tau_i s + 1)        step response    g_0 + sum w_i (1 - exp(-t / tau_i))

    Source: D. Croft, G. Shed and S. Devasia, J. Dyn. Sys. Meas. Control 123 (2001).

    Parameters
    ----------
    time_constants, weights : sequence of float
        Of the elements, positive [s], and their gains [unit of the output / unit of the input].
    instant_gain : float
        g_0, of what follows at once.

    Raises
    ------
    ValueError
        If lengths differ or a time constant is not positive.

    Examples
    --------
    >>> import hysim as hs
    >>> creep = hs.Creep(time_constants=(1.0,), weights=(0.1,))
    >>> creep.dc_gain, creep.step_response([0.0, 1.0]).round(6).tolist()
    (1.1, [1.0, 1.063212])
    """

    time_constants: tuple[float, ...]
    weights: tuple[float, ...]
    instant_gain: float = 1.0

    def __post_init__(self) -> None:
        frozen.check_lengths(time_constants=self.time_constants, weights=self.weights)
        frozen.check_positive(time_constants=min(self.time_constants, default=1.0))

    @classmethod
    def per_decade(
        cls,
        percent: float,
        band: tuple[float, float] = (1e-3, 1e3),
        *,
        per_decade_elements: int = 3,
        reference_time: float = 0.1,
    ) -> "Creep":
        """The bank whose step response grows by a percentage in each decade of time.

        Parameters
        ----------
        percent, band : float, and (float, float)
            Growth in a decade of the value at the reference time [%], and shortest and longest time of validity [s].
        per_decade_elements : int
            Number of log-spaced elements in a decade.
        reference_time : float
            At which the step response is one [s].

        Returns
        -------
        Creep
            The weights of one sign that fit best at log-spaced times of the band.

        Raises
        ------
        ValueError
            If the band does not rise from a positive time, or another number is not positive.

        Examples
        --------
        >>> import hysim as hs
        >>> creep = hs.Creep.per_decade(1.5)
        >>> len(creep.weights), creep.step_response([0.01, 0.1, 10.0]).round(3).tolist()
        (19, [0.985, 1.0, 1.03])
        """
        from scipy.optimize import nnls

        low, high = (float(end) for end in band)
        if not 0.0 < low < high < math.inf:
            raise ValueError(f"band must rise from a positive time [s], got {band}")
        frozen.check_positive_and_finite(reference_time=reference_time)
        frozen.check_count("per_decade_elements", per_decade_elements)
        decades = math.log10(high / low)
        time_constants = np.geomspace(low, high, 1 + math.ceil(decades * per_decade_elements - 1e-9))
        times = np.geomspace(low, high, 1 + math.ceil(decades * _TIMES_PER_DECADE))
        at_reference = -np.expm1(-reference_time / time_constants)
        growth = -np.expm1(-times[:, np.newaxis] / time_constants) - at_reference
        of_one, _ = nnls(growth, np.log10(times / reference_time))
        weights = percent / 100.0 * of_one
        instant = 1.0 - float(weights @ at_reference)
        return cls(time_constants=tuple(time_constants.tolist()), weights=tuple(weights.tolist()), instant_gain=instant)

    @property
    def dc_gain(self) -> float:
        """Limit of the step response."""
        return self.instant_gain + math.fsum(self.weights)

    @property
    def state_space(self) -> StateSpace:
        """The elements' positions q as states: A is diagonal."""
        rates = 1.0 / np.array(self.time_constants)
        return StateSpace(A=-np.diag(rates), B=rates, C=np.array(self.weights), D=self.instant_gain)

    def step_response(self, t: npt.ArrayLike) -> FloatArray:
        """Output at the times `t` [s] after a step of one, in the shape of `t`."""
        times = np.asarray(t, dtype=float)[..., np.newaxis]
        return np.asarray(self.instant_gain - np.expm1(-times / np.array(self.time_constants)) @ np.array(self.weights))


@family
class Sensor:
    """From the true displacement to the measured one.

    ``measurement_k = quantum floor((y(t_k - delay) + noise_k) / quantum + 1/2)``; the noise is gaussian and white from
    sample to sample, a function of the seed and the sample alone.

    Parameters
    ----------
    quantum, noise : float
        Step of the readings, of a converter or a camera's pixel, and rms of the noise before it; 0 for none [unit of
        y].
    delay : float
        Age of what is read [s]; it need not be a whole number of samples.
    seed : int
        Of the noise: the same seed gives the same noise.

    Raises
    ------
    TypeError, ValueError
        If a number is negative, or the seed is no integer.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Sensor(quantum=0.5).measure([0.2, 0.3, 0.8]).tolist()
    [0.0, 0.5, 1.0]
    """

    quantum: NotNegative = 0.0
    noise: NotNegative = 0.0
    delay: NotNegative = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        frozen.check_whole(self.seed, "seed", least=0)

    def noise_samples(self, n: int) -> FloatArray:
        """The noise of the first `n` samples; more samples begin with the same."""
        if not self.noise:
            return np.zeros(n)
        return self.noise * np.random.default_rng(self.seed).standard_normal(n)

    def measure(self, y: npt.ArrayLike) -> FloatArray:
        """Readings of displacements that are as old as the delay has them, shape (n,)."""
        displacement = read_only(y, "y", finite=False)
        noisy = displacement + self.noise_samples(displacement.size)
        return self.quantum * np.floor(noisy / self.quantum + 0.5) if self.quantum else noisy


_WHOLE = 1e-6  # of a sub-step: a delay this close to a whole number of them is one


Vibration = TransferFunction | StateSpace | Modes
"""Linear dynamics behind the law."""


class Stage(NamedTuple):
    """x' = rate (F x + g v), y = C x + D v; `rest` is x under a constant input of one."""

    F: FloatArray
    g: FloatArray
    C: FloatArray
    D: float
    rest: FloatArray
    rate: float = 1.0

    @property
    def dc_gain(self) -> float:
        return float(self.C @ self.rest) + self.D

    def then(self, other: Self) -> "Stage":
        """This stage and another after it, in the time unit of the other."""
        n, m = self.g.size, other.g.size
        slower = self.rate / other.rate
        F = np.zeros((n + m, n + m))
        F[:n, :n], F[n:, :n], F[n:, n:] = slower * self.F, np.outer(other.g, self.C), other.F
        with np.errstate(invalid="ignore"):
            rest = np.concatenate([self.rest, other.rest * self.dc_gain])
        g, C = np.concatenate([slower * self.g, other.g * self.D]), np.concatenate([other.D * self.C, other.C])
        return Stage(F, g, C, other.D * self.D, rest, other.rate)


class SampledStage(NamedTuple):
    """The matrices of `hysim.kernels.loop` for one sub-step; `rest` is the state under a constant input of one."""

    decline: FloatArray
    A: FloatArray
    B: FloatArray
    output: FloatArray
    lag: int
    rest: FloatArray


def gain(value: float) -> Stage:
    """A stage without states."""
    nothing = np.zeros(0)
    return Stage(np.zeros((0, 0)), nothing, nothing, value, nothing)


def low_pass(time_constant: float) -> Stage:
    """1 / (time_constant s + 1)."""
    one = np.ones(1)
    return Stage(np.array([[-1.0 / time_constant]]), one / time_constant, one, 0.0, one)


def creep_stage(creep: Creep) -> Stage:
    """The elements side by side, each the response of its spring and damper to a force of one."""
    rates = 1.0 / np.array(creep.time_constants)
    return Stage(-np.diag(rates), rates, np.array(creep.weights), creep.instant_gain, np.ones(rates.size))


def vibration_stage(plant: Vibration, sample_time: float) -> Stage:
    """The states of a plant, in a time unit or in units of the states in which no entry is large."""
    if isinstance(plant, TransferFunction):
        return _companion(plant, sample_time)
    system = plant.state_space if isinstance(plant, Modes) else plant
    if not system.B.size:
        return gain(system.D)
    F, (units, _) = matrix_balance(system.A, permute=False, separate=True)
    g, C = system.B / units, system.C * units
    return Stage(F, g, C, system.D, resting_states(F, g))


def _companion(plant: TransferFunction, sample_time: float) -> Stage:
    """The controllability form x_j = s^j / den(s) v, in a time unit that makes den's coefficients at most one."""
    n = plant.order
    numerator = np.concatenate([np.zeros(n + 1 - len(plant.num)), plant.num]) / plant.den[0]
    monic = np.array(plant.den[1:]) / plant.den[0]
    F, rate, scaled = scaled_companion(monic[np.newaxis], sample_time)
    if not np.isfinite(F).all():
        raise ValueError(
            f"the rates of a plant sampled at {sample_time:g} s cannot be computed: check the time and den"
        )
    back = rate[0] ** -np.arange(1.0, n + 1)
    with np.errstate(divide="ignore"):
        rest = np.concatenate([1.0 / scaled[0, -1:], np.zeros(max(n - 1, 0))])[:n]
    C = ((numerator[1:] - numerator[0] * monic) * back)[::-1]
    return Stage(F[0], np.eye(n, 1, 1 - n)[:, 0], C, float(numerator[0]), rest, float(rate[0, 0]))


def sampled(stage: Stage, step: float, delay: float = 0.0, *, creeping: int = 0, linear: bool = False) -> SampledStage:
    """The exact discrete form of a stage for sub-steps of the length `step` [s]; its rest may be infinite or nan.

    The input has a dead time `delay` [s], and is held over a sub-step or `linear` along it. The first `creeping` states
    do not depend on others.
    """
    lag, part = whole_and_part(delay / step)
    with np.errstate(all="ignore"):
        carried, B, through = _transition(stage, step, part, 1.0, linear)
    if not (np.isfinite(carried).all() and np.isfinite(B).all()):
        raise ValueError(
            f"the motion of the plant within {step:g} s is beyond the largest number: check the sample time"
        )
    return SampledStage(
        decline=read_only(np.expm1(np.diag(stage.F)[:creeping] * (stage.rate * step))),
        A=read_only(carried[creeping:]),
        B=read_only(B),
        output=read_only([0.0, stage.D * through[0], stage.D * through[1], *stage.C]),
        lag=lag,
        rest=stage.rest,
    )


def seen_within(stage: Stage, step: float, delay: float, at: float, *, linear: bool = False) -> FloatArray:
    """As `SampledStage.output`, of the displacement at the part `at` of a sub-step, from the states at its begin."""
    _, part = whole_and_part(delay / step)
    carried, B, through = _transition(stage, step, part, at, linear)
    return read_only([*(stage.C @ B.T + stage.D * through), *(stage.C @ carried)])


def whole_and_part(ratio: float) -> tuple[int, float]:
    """A number as a whole one and a part of one, the part zero where only rounding keeps it from zero."""
    nearest = round(ratio)
    if abs(ratio - nearest) <= _WHOLE:
        return nearest, 0.0
    return math.floor(ratio), ratio % 1.0


def _transition(stage: Stage, step: float, part: float, at: float, linear: bool) -> Transition:
    """The states at the part `at` of a sub-step, as matrices of those at its begin and of the three inputs."""
    early, late = min(at, part), max(at - part, 0.0)
    spans = stage.rate * step * np.array([[early, late]])
    (first, second), begins, ends = (stack[0] for stack in transitions(stage.F[np.newaxis], spans, stage.g))
    pieces = _linear_pieces(part, early, late) if linear else _HELD
    B = np.zeros((3, stage.g.size))
    for row, (begin, middle, turn, end) in enumerate(zip(*pieces, strict=True)):
        if begin or middle:
            B[row] = second @ (begin * begins[0] + middle * ends[0])
        B[row] += turn * begins[1] + end * ends[1]
    return second @ first, B, np.array(pieces[3 if late else 1])


_HELD = ((0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def _linear_pieces(part: float, early: float, late: float) -> tuple[tuple[float, float, float], ...]:
    """Input at the begin and the end of both pieces, as weights of the newer, the older and the oldest value."""
    return (
        (0.0, 1.0 - part, part),
        (0.0, 1.0 - part + early, part - early),
        (0.0, 1.0, 0.0),
        (late, 1.0 - late, 0.0),
    )
