"""The describing function of a law: what its steady cycle under a sine has in common with a linear system's.

    u = mean + a sin(phi)
    y = y_0 + a (Re N sin(phi) + Im N cos(phi)) + harmonics
    N(a) = 1 / (pi a) times the integral of y (sin(phi) + i cos(phi)) d phi over a cycle

|N| is the gain of the first harmonic and arg N its phase, negative where y lags. As du = a cos(phi) d phi, the
imaginary part is the loop's area and nothing else:

    Im N = -(signed area) / (pi a^2),    negative for a counterclockwise loop

A rate-independent law needs the extremes of the input alone to come to its steady cycle, two samples a cycle, and gives
the samples of the cycle itself without an error that depends on their number. The mean over n samples that takes the
place of the integral errs by the order of 1 / n where the loop jumps between two of them, 1 / n^2 where it has a kink,
and less where it is smooth. Its imaginary part is the area of the polygon through the samples, which `loop_metrics`
measures, times (2 pi / n) / sin(2 pi / n).

Source: A. Gelb and W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._cycles import ROUNDING
from hysim._frozen import FloatArray, read_only
from hysim.errors import SimulationError

_BATCHES = tuple(2**k for k in range(4, 18))  # cycles that are run in one go, one after the other
_SLOW = 1e-6  # of the output's span, by which it may still move in half of the last batch


def describing_function(
    law: Any, amplitudes: npt.ArrayLike, *, mean: float = 0.0, samples_per_cycle: int = 2000
) -> npt.NDArray[np.complex128]:
    """First harmonic of a law's steady cycle under a sine, over the sine.

    ::

        N(a) = 1 / (pi a) times the integral of y (sin(phi) + i cos(phi)) d phi,    u = mean + a sin(phi)

    The law begins with its own memory at the input `mean`, and is taken to and fro until its output repeats, to 1e-12
    of its span or after 262 128 cycles to 1e-6. The gain is ``abs(N)``, the phase ``np.angle(N)`` [rad], negative where
    the output lags.

    Parameters
    ----------
    law : model
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
        If the output does not come to repeat, or leaves the finite numbers.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.metrics.describing_function(hs.Play(threshold=1.0), [1.0, 2.0, 1e3]).round(3).tolist()
    [0j, (0.5-0.318j), (1-0.001j)]
    """
    if not callable(getattr(law, "advance", None)) or getattr(law, "dynamic", False):
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
    found = [2.0 * np.mean(_steady_cycle(law, mean + a * rise, float(a), mean) * harmonic) / a for a in swings]
    return np.array(found, dtype=complex)


def _steady_cycle(law: Any, u: FloatArray, amplitude: float, mean: float) -> FloatArray:
    """The law's output at the inputs of a cycle from the lowest one on, once it repeats."""
    extremes = [mean + amplitude, mean - amplitude]
    _, state = law.advance([mean])
    for cycles in _BATCHES:
        y, state = law.advance(extremes * cycles, state)
        ends = np.reshape(y, (cycles, 2))
        moved, span = np.abs(ends[-1] - ends[cycles // 2]).max(), abs(ends[-1, 0] - ends[-1, 1])
        if moved <= ROUNDING * span + 4.0 * np.spacing(np.abs(ends[-1]).max()):
            break
    else:
        if moved > _SLOW * span:
            raise SimulationError(f"the output does not repeat after {sum(_BATCHES)} cycles of amplitude {amplitude:g}")
    return np.asarray(law.advance(u, state)[0])
