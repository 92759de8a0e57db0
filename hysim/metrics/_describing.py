"""The describing function of a law: the first harmonic of its steady cycle under a sine.

    u = mean + a sin(phi)
    y = y_0 + a (Re N sin(phi) + Im N cos(phi)) + harmonics
    N(a) = 1 / (pi a) times the integral of y (sin(phi) + i cos(phi)) d phi over a cycle
    Im N = -(signed area) / (pi a^2),    negative for a counterclockwise loop

A rate-independent law needs only the extremes of the input, two samples a cycle, to come to its steady cycle. The
integral is a mean over n samples: its error is of the order 1 / n where the loop jumps between two of them, 1 / n^2
where it has a kink, and smaller where it is smooth. The area is that of the polygon through the samples, which
`loop_metrics` measures, times (2 pi / n) / sin(2 pi / n).

Source: A. Gelb and W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968.
"""

import math
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._cycles import ROUNDING
from hysim._frozen import FloatArray, read_only
from hysim._results import model_of
from hysim.errors import SimulationError

_BATCHES = tuple(2**k for k in range(4, 18))  # cycles of each of the successive runs
_SLOW = 1e-6  # of the output's span: largest change during half of the last run


@runtime_checkable
class _Stepped(Protocol):
    """A law that can be cut and continued."""

    def advance(self, u: Any, state: Any = None) -> Any: ...


@runtime_checkable
class _Dynamic(Protocol):
    dynamic: bool


def describing_function(
    law: Any, amplitudes: npt.ArrayLike, *, mean: float = 0.0, samples_per_cycle: int = 2000
) -> npt.NDArray[np.complex128]:
    """First harmonic of a law's steady cycle under ``u = mean + a sin(phi)``, over the sine.

    It is N(a), 1 / (pi a) times the integral of y (sin(phi) + i cos(phi)) d phi: the gain is ``abs(N)``, the phase
    ``np.angle(N)`` [rad], negative where the output lags. The law begins with its own memory at the input `mean`, and
    cycles until its output repeats, to 1e-12 of its span or, after 262 128 cycles, to 1e-6.

    Parameters
    ----------
    law : model or result of a fit
        A rate-independent law, such as `hysim.BoucWen`.
    amplitudes : array, shape (n,)
        Positive amplitudes a of the input [unit of u].
    mean : float
        Input in the middle of the cycle [unit of u].
    samples_per_cycle : int
        Even number of samples of the cycle.

    Returns
    -------
    array of complex, shape (n,) [unit of y / unit of u]

    Raises
    ------
    TypeError
        If the law has no `advance`, or depends on time.
    ValueError
        If an amplitude is not positive, a number is not finite, or `samples_per_cycle` is odd or below 4.
    SimulationError
        If the output does not repeat, or diverges.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.metrics.describing_function(hs.Play(threshold=1.0), [1.0, 2.0, 1e3]).round(3).tolist()
    [0j, (0.5-0.318j), (1-0.001j)]
    """
    law = model_of(law)
    if not isinstance(law, _Stepped) or (isinstance(law, _Dynamic) and law.dynamic):
        raise TypeError(
            f"a describing function of the amplitude alone needs a law without time, got {type(law).__name__}; "
            "for a transfer function see hysim.to_control"
        )
    swings = read_only(amplitudes, "amplitudes", ndim=1)
    if not (swings > 0.0).all() or not math.isfinite(mean):
        raise ValueError(f"amplitudes must be positive, and the mean finite, got {swings.tolist()} and {mean}")
    if samples_per_cycle < 4 or samples_per_cycle % 2:
        raise ValueError(f"samples_per_cycle must be even, and at least 4, got {samples_per_cycle}")
    turn = np.exp(1j * np.pi * np.arange(samples_per_cycle // 2 + 1) / (samples_per_cycle // 2))
    turn = np.append(turn, turn[-2:0:-1].conj())  # from the lowest input, phi = -pi / 2, up and back
    rise = -turn.real
    harmonic = rise + 1j * turn.imag
    values = [2.0 * np.mean(_steady_cycle(law, mean + a * rise, float(a), mean) * harmonic) / a for a in swings]
    return np.array(values, dtype=complex)


def _steady_cycle(law: Any, u: FloatArray, amplitude: float, mean: float) -> FloatArray:
    """The law's output at the inputs of a cycle from the lowest one on, once it repeats."""
    extremes = [mean + amplitude, mean - amplitude]
    _, state = law.advance([mean])
    for cycles in _BATCHES:
        y, state = law.advance(extremes * cycles, state)
        ends = np.reshape(y, (cycles, 2))
        change, span = np.abs(ends[-1] - ends[cycles // 2]).max(), abs(ends[-1, 0] - ends[-1, 1])
        if change <= ROUNDING * span + 4.0 * np.spacing(np.abs(ends[-1]).max()):
            break
    else:
        if change > _SLOW * span:
            raise SimulationError(f"the output does not repeat after {sum(_BATCHES)} cycles of amplitude {amplitude:g}")
    return np.asarray(law.advance(u, state)[0])
