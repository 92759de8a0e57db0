"""Bounds of the memory and of the slope of a Bouc-Wen law, whatever its input.

    dz/du = A - |z|^n (gamma + beta sign(z du))

A branch on which w = |z| grows obeys w' = a - c w^n and ends at w = (a/c)^(1/n): with A > 0 the loading
branch, a = A and c = beta + gamma; with A < 0 the unloading one, a = -A and c = beta - gamma. In the classes I
to IV of Ikhouane and Rodellar (2007) this bounds the memory, or z0 does where it is larger. With |z| <= B
the slope lies between its values at z = 0, and at B on both branches:

    A,    A - (beta + gamma) B^n,    A + (beta - gamma) B^n
"""

import math

import numpy as np

from hysim._frozen import FloatArray


def saturation(A: float, beta: float, gamma: float, n: float) -> float:
    """``|z|`` at the end of a long stroke of the input; inf where it has no limit."""
    if A == 0.0:
        return 0.0 if beta + gamma > 0.0 and beta - gamma >= 0.0 else math.inf
    c = beta + math.copysign(1.0, A) * gamma
    return _power(abs(A) / c, 1.0 / n) if c > 0.0 else math.inf


def memory_bound(A: float, beta: float, gamma: float, n: float, z0: float, stability_class: str) -> float:
    """Bound of |z| for every input that begins with z0; inf where there is none."""
    if stability_class == "none":
        return math.inf
    if stability_class in ("II", "IV"):
        unstable = abs(A) / (abs(gamma) - beta)
        if abs(z0) > _power(unstable, 1.0 / n):
            return math.inf
    return max(abs(z0), saturation(A, beta, gamma, n))


def memory_slopes(A: float, beta: float, gamma: float, n: float, bound: float) -> tuple[float, float]:
    """Lowest and highest slope dz/du for |z| <= `bound`."""
    ends = [A]
    for c in (beta + gamma, gamma - beta):
        ends.append(A - c * _power(bound, n) if c != 0.0 else A)
    return min(ends), max(ends)


def polynomial_range(coefficients: FloatArray, low: float, high: float) -> tuple[float, float]:
    """Lowest and highest value of a polynomial (ascending powers) on an interval that may be infinite."""
    trimmed = np.trim_zeros(coefficients, "b")
    if trimmed.size < 2:
        value = float(trimmed[0]) if trimmed.size else 0.0
        return value, value
    turns = np.polynomial.polynomial.polyroots(np.polynomial.polynomial.polyder(trimmed))
    real = turns[np.abs(turns.imag) <= 1e-8 * np.abs(turns)].real
    inside = [turn for turn in real.tolist() if low < turn < high]
    values = [_value(trimmed, point) for point in (low, high, *inside)]
    return min(values), max(values)


def _power(base: float, exponent: float) -> float:
    """base ** exponent for base >= 0, where Python raises an OverflowError for infinity."""
    with np.errstate(over="ignore"):
        return float(np.float64(base) ** exponent)


def _value(coefficients: FloatArray, point: float) -> float:
    if math.isinf(point):
        degree = coefficients.size - 1
        return math.copysign(math.inf, coefficients[-1] * (math.copysign(1.0, point) if degree % 2 else 1.0))
    return float(np.polynomial.polynomial.polyval(point, coefficients))
