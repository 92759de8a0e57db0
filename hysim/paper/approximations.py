"""Second-order approximations of models of higher order, and their errors.

The paper derives (7) from (1), and (6) from (4), by the general form (5), and calls each pair similar. Here a
pair is compared by the step response over the time in which both have settled (`settling_window`), and (5) is
also matched anew to the response's final value, overshoot and peak time:

    xi = L / sqrt(pi^2 + L^2),  L = -ln(overshoot),    w_n = pi / (t_peak sqrt(1 - xi^2)),    k = G(0) w_n^2
"""

import math

import numpy as np

from hysim._frozen import frozen
from hysim.metrics import fit_percent
from hysim.paper.equations import (
    EQUATION_1,
    EQUATION_4,
    EQUATION_6,
    EQUATION_7,
    Characteristics,
    characteristics,
    second_order,
    settling_window,
    unit_step,
)
from hysim.plants.transfer_function import TransferFunction

_INTERVALS = 4000


@frozen
class Approximation:
    """A simpler model beside the one that it stands for.

    Parameters
    ----------
    name, of : str
        The equations.
    simpler, full : Characteristics
        Of either.
    fit_percent : float
        Fit of the simpler model's step response to the other's [%].
    matched : TransferFunction
        Equation (5) with the full model's final value, overshoot and peak time.
    matched_fit_percent : float
        Fit of that one's step response [%].
    """

    name: str
    of: str
    simpler: Characteristics
    full: Characteristics
    fit_percent: float
    matched: TransferFunction
    matched_fit_percent: float


def approximations() -> tuple[Approximation, ...]:
    """(7) as an estimate of (1), and (6) of (4)."""
    return approximation("(7)", EQUATION_7, "(1)", EQUATION_1), approximation("(6)", EQUATION_6, "(4)", EQUATION_4)


def approximation(name: str, simpler: TransferFunction, of: str, full: TransferFunction) -> Approximation:
    """The errors of one model as an approximation of another, both stable and in the same unit of time."""
    exact = characteristics(full)
    matched = matched_second_order(exact)
    return Approximation(
        name=name,
        of=of,
        simpler=characteristics(simpler),
        full=exact,
        fit_percent=step_fit(full, simpler),
        matched=matched,
        matched_fit_percent=step_fit(full, matched),
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
