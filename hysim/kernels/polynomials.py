"""Polynomials of sixteen terms, summed so that a processor can do half of it at once.

    c_0 + c_1 x + ... + c_15 x^15

Horner's rule is a chain of 30 dependent operations; the tree below is one of 9.
"""

from collections.abc import Sequence

from hysim._frozen import FloatArray
from hysim.kernels._compile import kernel

N_TERMS = 16


@kernel
def sum16(c: FloatArray | Sequence[float], first: int, x: float) -> float:
    """The polynomial with the coefficients ``c[first : first + 16]``."""
    x2 = x * x
    x4 = x2 * x2
    low = sum4(c, first, x, x2) + sum4(c, first + 4, x, x2) * x4
    high = sum4(c, first + 8, x, x2) + sum4(c, first + 12, x, x2) * x4
    return low + high * (x4 * x4)


@kernel
def sum4(c: FloatArray | Sequence[float], first: int, x: float, x2: float) -> float:
    """The four terms from ``c[first]`` on."""
    return (c[first] + c[first + 1] * x) + (c[first + 2] + c[first + 3] * x) * x2
