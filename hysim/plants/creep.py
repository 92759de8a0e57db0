"""Creep of a piezoelectric actuator: a spring in series with Kelvin-Voigt elements.

Creep is measured as a percentage per decade of time, y(t) = y(t_0) (1 + g log10(t / t_0)). That law has no finite
state, and no limit at either end: a bank of elements follows it over a band of times, and is at rest outside.
"""

import math

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_count, check_positive
from hysim.models.model import family
from hysim.plants.state_space import StateSpace

_TIMES_PER_DECADE = 20  # at which the bank is fitted


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
        if len(self.time_constants) != len(self.weights):
            raise ValueError(
                f"time_constants and weights must be equally long, got {len(self.time_constants)} and "
                f"{len(self.weights)}"
            )
        check_positive(time_constants=min(self.time_constants, default=1.0))

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
        if not 0.0 < reference_time < math.inf:
            raise ValueError(f"reference_time must be positive, got {reference_time}")
        check_count("per_decade_elements", per_decade_elements)
        decades = math.log10(high / low)
        time_constants = np.geomspace(low, high, 1 + math.ceil(decades * per_decade_elements - 1e-9))
        times = np.geomspace(low, high, 1 + math.ceil(decades * _TIMES_PER_DECADE))
        at_reference = -np.expm1(-reference_time / time_constants)
        growth = -np.expm1(-times[:, np.newaxis] / time_constants) - at_reference
        of_one, _ = nnls(growth, np.log10(times / reference_time))
        weights = percent / 100.0 * of_one
        return cls(
            time_constants=tuple(time_constants.tolist()),
            weights=tuple(weights.tolist()),
            instant_gain=1.0 - float(weights @ at_reference),
        )

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
