"""The amplifier of the vibration experiment, equations (2) and (3), in V and s.

    (2)  V_out = V_in (Rf/R2 + 1)             non-inverting
    (3)  slew rate = 2 pi f V                 steepest slope of a sine of amplitude V

The paper takes V of (3) at the amplifier's input; it is the output that slews.
"""

from hysim.plants.amplifier import Amplifier

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
