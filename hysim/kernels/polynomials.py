"""Polynomials of sixteen terms, summed so that a processor can do half of it at once.

    c_0 + c_1 x + ... + c_15 x^15

Horner's rule is a chain of 30 dependent operations; the tree below is one of 9.
"""

from numba import float64, int64, types

from hysim._frozen import FloatArray
from hysim.kernels._compile import signed_inlined

N_TERMS = 16
_COEFFICIENTS = types.Array(float64, 1, "C", readonly=True)
_NOT_NEGATIVE = 0xFFFF  # says to the compiler that no index counts from the end: a third of the time otherwise


@signed_inlined(float64(_COEFFICIENTS, int64, float64))
def sum16(c: FloatArray, first: int, x: float) -> float:
    """The polynomial with the coefficients ``c[first : first + 16]``."""
    k = first & _NOT_NEGATIVE
    x2 = x * x
    x4 = x2 * x2
    a = (c[k] + c[k + 1] * x) + (c[k + 2] + c[k + 3] * x) * x2
    b = (c[k + 4] + c[k + 5] * x) + (c[k + 6] + c[k + 7] * x) * x2
    d = (c[k + 8] + c[k + 9] * x) + (c[k + 10] + c[k + 11] * x) * x2
    e = (c[k + 12] + c[k + 13] * x) + (c[k + 14] + c[k + 15] * x) * x2
    return float((a + b * x4) + (d + e * x4) * (x4 * x4))


@signed_inlined(float64(_COEFFICIENTS, int64, float64))
def sum8(c: FloatArray, first: int, x: float) -> float:
    """The polynomial of eight terms with the coefficients ``c[first : first + 8]``."""
    k = first & _NOT_NEGATIVE
    x2 = x * x
    a = (c[k] + c[k + 1] * x) + (c[k + 2] + c[k + 3] * x) * x2
    b = (c[k + 4] + c[k + 5] * x) + (c[k + 6] + c[k + 7] * x) * x2
    return float(a + b * (x2 * x2))
