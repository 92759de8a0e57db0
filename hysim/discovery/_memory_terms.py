"""The terms of a memory law and their names.

    z' = sum of coefficients times u', |u'|, u' z, |u'| |z| z, ... and times z

u is the law's own input, inside an oscillator the displacement. A name is u' or |u'|, then |z| where the power of z
is folded at zero, then the power of z that is left. The last term, z alone, is a relaxation in time: a law that has
it depends on the rate. The power counts z and |z| together and is 1.5 in a name such as ``"|u'| |z|^0.5 z"``.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray

SYMMETRIES = ("none", "odd")


class MemoryTerm(NamedTuple):
    """u', or |u'| where it is `rectified`, times |z|^power, which has the sign of z unless it is `even`.

    A `relaxing` term is z itself.
    """

    rectified: bool
    power: float
    even: bool
    relaxing: bool = False

    @property
    def odd(self) -> bool:
        """Whether the term changes its sign when u and z do."""
        return self.relaxing or self.rectified != self.even

    @property
    def name(self) -> str:
        """The name in the vocabulary."""
        if self.relaxing:
            return "z"
        rate = "|u'|" if self.rectified else "u'"
        if self.power == int(self.power):
            folded = int(self.even != (self.power % 2 == 0))
            powers = _power("|z|", folded) + _power("z", self.power - folded)
        else:
            powers = _power("|z|", self.power) if self.even else _power("|z|", self.power - 1.0) + " z"
        return rate + powers

    @property
    def whole(self) -> bool:
        """Whether the term is one of u' or |u'| and a polynomial on each side of z = 0."""
        return not self.relaxing and self.power == int(self.power)

    @property
    def signs(self) -> FloatArray:
        """Factors of |z|^power, shape (2, 2), by direction and side of z = 0."""
        direction = np.array([1.0, 1.0] if self.rectified else [-1.0, 1.0])
        side = np.array([1.0, 1.0] if self.even else [-1.0, 1.0])
        return np.asarray(direction[:, np.newaxis] * side)


RELAXATION = MemoryTerm(False, 1.0, False, relaxing=True)


class Law(NamedTuple):
    """A law as `hysim.kernels.hidden` takes it."""

    polynomial: FloatArray
    extra: FloatArray
    power: float
    relaxation: float


def law(coefficients: Mapping[MemoryTerm, float], degree: int) -> Law:
    """The law with these coefficients; its powers that are not whole must be one."""
    polynomial, extra, power = np.zeros((2, 2, degree + 1)), np.zeros((2, 2)), 1.0
    for term, value in coefficients.items():
        if term.whole:
            polynomial += value * cases(term, degree)
        elif not term.relaxing:
            extra, power = extra + value * term.signs, term.power
    return Law(polynomial, extra, power, coefficients.get(RELAXATION, 0.0))


def cases(term: MemoryTerm, degree: int) -> FloatArray:
    """Polynomials in z of a whole term, shape (2, 2, degree + 1), by direction and side of z = 0."""
    found = np.zeros((2, 2, degree + 1))
    found[..., int(term.power)] = term.signs
    if term.power % 2:
        found[:, 0] *= -1.0  # z^power = -|z|^power there
    return found


def memory_terms(degree: int, symmetry: str = "none") -> tuple[MemoryTerm, ...]:
    """All terms of degree 0 to `degree` in z and |z| and the relaxation, or the odd ones of them, in the one order."""
    powers = [(0, True)] + [(power, even) for power in range(1, degree + 1) for even in (False, True)]
    terms = [MemoryTerm(rectified, float(power), even) for power, even in powers for rectified in (False, True)]
    return tuple(term for term in (*terms, RELAXATION) if symmetry == "none" or term.odd)


def bouc_wen_terms(n: float) -> tuple[MemoryTerm, MemoryTerm, MemoryTerm]:
    """The terms whose coefficients are A, -beta and -gamma."""
    return MemoryTerm(False, 0.0, True), MemoryTerm(True, n, False), MemoryTerm(False, n, True)


def equation(coefficients: Mapping[str, float]) -> str:
    """The law as text."""
    parts = [f"{'-' if value < 0.0 else '+'} {abs(value):.6g} {name}" for name, value in coefficients.items()]
    return "z' = " + (" ".join(parts).removeprefix("+ ") or "0")


def _power(letter: str, power: float) -> str:
    if power == 0:
        return ""
    return f" {letter}" if power == 1 else f" {letter}^{power:g}"
