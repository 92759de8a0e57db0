"""Amplifiers that drive a piezoelectric stack, which is a capacitor."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import (
    FloatArray,
    Interval,
    NotNegative,
    Positive,
    check_not_negative,
    check_positive,
    read_only,
)
from hysim.models.model import family


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
        check_positive(input_resistance=input_resistance)
        check_not_negative(
            feedback_resistance=feedback_resistance, output_resistance=output_resistance, capacitance=capacitance
        )
        return cls(
            gain=1.0 + feedback_resistance / input_resistance,
            limits=limits,
            slew_rate=slew_rate,
            time_constant=output_resistance * capacitance,
        )

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
        check_positive(amplitude=amplitude)
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
