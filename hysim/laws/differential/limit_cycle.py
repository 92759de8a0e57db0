"""The steady loop of a Bouc-Wen memory under an input between -X and X.

    dz/du = A - |z|^n (gamma + beta sign(z du)),    s = beta + gamma,  d = gamma - beta,  A > 0

The input travels T_d(z) on the way from a peak z to zero, and T_s(z) from zero to the next peak, where
T_c(z) is the integral of dw / (A - c w^n) from 0 to z. The steady peak therefore obeys

    T_d(peak) + T_s(peak) = 2 X,    coercive input = X - T_d(peak)

With w(l) the memory that is reached from zero after a length l of the slower of the two branches (c the
larger of s and d, e the smaller), and L = T_c(peak), both the coercive input and the energy are integrals
of one sign, which lose no digits when the loop is narrow or the memory saturated:

    coercive input = beta  int_0^L  w^n / (A - e w^n) dl
    energy         = 4 beta  int_0^L  w^(n+1) / (A - e w^n) dl

w(l) is exact, L is the root of w_c(L) = w_e(2 X - L), and the tanh-sinh rule takes the integrals, whose integrands are
not analytic at the ends. A law with A < 0 is the law (-A, beta, -gamma) of the input -u.
Sources: Ikhouane and Rodellar 2007, chapter 3, for the limit cycle; the integrals of one sign are ours.
"""

import math

import numpy as np
import scipy

from hysim._basics.frozen import FloatArray, check_positive_and_finite, frozen, read_only
from hysim.errors import SimulationError
from hysim.kernels import boucwen as kernels

_ROUNDING = 1e-14  # of an integral


@frozen
class LimitCycle:
    """Steady loop of the memory between the inputs -amplitude and amplitude.

    Parameters
    ----------
    amplitude : float
        Of the input [unit of u].
    peak : float
        Memory at the input `amplitude` [unit of z]; negative for A < 0.
    coercive : float
        Input at which the falling branch crosses z = 0 [unit of u]; negative for beta < 0.
    mid_width : float
        Distance between the branches at u = 0 [unit of z].
    energy : float
        Integral of z du around the loop [unit of z times unit of u]: what a force z on a displacement u
        dissipates in a cycle. The law's output has `gain` times as much.
    """

    amplitude: float
    peak: float
    coercive: float
    mid_width: float
    energy: float


def limit_cycle(A: float, beta: float, gamma: float, n: float, amplitude: float) -> LimitCycle:
    """Compute the steady loop, good to 1e-13 of each quantity where |beta| is above 1e-3 |gamma|.

    ValueError if the amplitude is not positive or A = 0 (the memory dies out); SimulationError if it diverges.
    """
    check_positive_and_finite(amplitude=amplitude)
    if A == 0.0:
        raise ValueError("a law with A = 0 has no limit cycle: its memory dies out or stays as it began")
    sign = math.copysign(1.0, A)
    slope, c = abs(A), sign * gamma + abs(beta)
    e = sign * gamma - abs(beta)
    if escape_length(slope, c, n) + escape_length(slope, e, n) <= 2.0 * amplitude:
        raise SimulationError(f"the memory diverges between -{amplitude:g} and {amplitude:g}")
    length = amplitude + _half_difference(slope, c, e, n, amplitude)

    def density(lengths: FloatArray, power: FloatArray) -> FloatArray:
        w = _from_rest(slope, c, n, lengths.ravel()).reshape(lengths.shape)
        return np.asarray(w ** (n + power) / (slope - c * w**n + 2.0 * abs(beta) * w**n))

    integrals = scipy.integrate.tanhsinh(
        density, 0.0, length, args=(np.array([0.0, 1.0]),), rtol=_ROUNDING, minlevel=5
    ).integral
    coercive = beta * float(integrals[0])
    peak, middle = _from_rest(slope, c, n, np.array([length, abs(coercive)])).tolist()
    return LimitCycle(
        amplitude=amplitude,
        peak=sign * peak,
        coercive=coercive,
        mid_width=2.0 * middle,
        energy=sign * 4.0 * beta * float(integrals[1]),
    )


def escape_length(A: float, c: float, n: float) -> float:
    """Input that takes w from 0 to infinity on w' = A - c w^n, A > 0; infinite if w stays finite."""
    if c >= 0.0 or n <= 1.0:
        return math.inf
    return float(math.pi / n / math.sin(math.pi / n) * (A / -c) ** (1.0 / n) / A)


def _half_difference(A: float, c: float, e: float, n: float, amplitude: float) -> float:
    """Half the difference between the lengths of the two branches, by which the peaks on both agree."""

    def mismatch(half: float) -> float:
        slow = float(_from_rest(A, c, n, np.array([amplitude + half]))[0])
        fast = float(_from_rest(A, e, n, np.array([amplitude - half]))[0])
        return min(slow, 1e300) - min(fast, 1e300)

    if mismatch(0.0) >= 0.0:
        return 0.0
    return float(scipy.optimize.brentq(mismatch, 0.0, amplitude, xtol=1e-16 * amplitude, rtol=1e-15, maxiter=2000))


def _from_rest(A: float, c: float, n: float, lengths: FloatArray) -> FloatArray:
    """Memory after each of the lengths on z' = A - c z^n from zero; inf where it has diverged."""
    laws = read_only(np.tile([A, c, 0.0, n, 0.0], (lengths.size, 1)))
    memory_itself = read_only(np.tile([1.0, 0.0], (lengths.size, 1)))
    u = read_only(np.stack([np.zeros(lengths.size), lengths], axis=1))
    z = np.empty(u.shape)
    with np.errstate(all="ignore"):  # a memory that diverges overflows, and uncompiled kernels would warn of it
        kernels.batch(laws, memory_itself, u, z)
    return z[:, 1]
