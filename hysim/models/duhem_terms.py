"""The terms of the polynomial Duhem law and their names.

A term is a monomial u^i y^j times u' or |u'|. Its name is `u'` or `|u'|`, then the powers that are not
zero, u before y: `u'`, `u' u`, `|u'| y^2`, `|u'| u y`. The terms have one order: those of u' before those
of |u'|, each by degree, then by the power of y.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np

from hysim._frozen import FloatArray

RATES = ("u'", "|u'|")

_NAME = re.compile(r"(?P<rate>u'|\|u'\|)(?P<u> u(\^(?P<i>\d+))?)?(?P<y> y(\^(?P<j>\d+))?)?")


class Term(NamedTuple):
    """The monomial u^(degree - j) y^j times u', or times |u'| where it is `rectified`; sorts in the one order."""

    rectified: bool
    degree: int
    j: int

    @classmethod
    def parse(cls, name: str) -> Self:
        """The term of a name such as ``"|u'| u y^2"``.

        Raises
        ------
        ValueError
            If the name is not in the vocabulary.
        """
        match = _NAME.fullmatch(name)
        if match is not None:
            i, j = (int(match[power] or 1) if match[letter] else 0 for letter, power in (("u", "i"), ("y", "j")))
            term = cls(match["rate"] == RATES[1], i + j, j)
            if term.name == name:  # refuses "u^1" and the like, so that a term has one name
                return term
        raise ValueError(
            f"unknown term {name!r}: a term is u' or |u'|, then at most one power of u and one of y, "
            'as in "u\'", "u\' u^2" or "|u\'| u y"'
        )

    @property
    def i(self) -> int:
        """Power of u."""
        return self.degree - self.j

    @property
    def monomial(self) -> str:
        """The powers of u and y, empty for the constant."""
        powers = (("u", self.i), ("y", self.j))
        return " ".join(letter if power == 1 else f"{letter}^{power}" for letter, power in powers if power)

    @property
    def name(self) -> str:
        """The name in the vocabulary."""
        return f"{RATES[self.rectified]} {self.monomial}".rstrip()

    def divisors(self) -> set[Self]:
        """The terms of one degree less that divide this one: what a shift of the origin of u or y adds to it."""
        lower = {(self.i - 1, self.j), (self.i, self.j - 1)}
        return {type(self)(self.rectified, i + j, j) for i, j in lower if i >= 0 and j >= 0}


def polynomials(terms: Sequence[Term], coefficients: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The arrays p and q of many laws, both (n_sets, rows, columns), from coefficients (n_sets, n_terms)."""
    rows, columns = (1 + max((getattr(term, power) for term in terms), default=0) for power in ("i", "j"))
    parts = np.zeros((2, len(coefficients), rows, columns))
    for k, term in enumerate(terms):
        parts[int(term.rectified), :, term.i, term.j] = coefficients[:, k]
    return parts[0], parts[1]


def branches(p: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The polynomials p + q where u rises and p - q where it falls, of one shape (..., rows, columns), read-only."""
    if p.shape[-2:] != q.shape[-2:]:
        rows, columns = (max(p.shape[axis], q.shape[axis]) for axis in (-2, -1))
        p, q = _padded(p, rows, columns), _padded(q, rows, columns)
    rising, falling = p + q, p - q
    for part in (rising, falling):  # kernels are compiled anew for arrays that can be written
        part.setflags(write=False)
    return rising, falling


def _padded(part: FloatArray, rows: int, columns: int) -> FloatArray:
    padded = np.zeros((*part.shape[:-2], rows, columns))
    padded[..., : part.shape[-2], : part.shape[-1]] = part
    return padded


def coefficient_units(u: FloatArray, y: FloatArray, terms: Iterable[Term]) -> FloatArray:
    """The coefficient of each term, shape (n_terms,), whose contribution over the span of `u` is the stroke of `y`."""
    span, stroke = float(np.ptp(u)), float(np.ptp(y)) or 1.0
    sizes = [float(np.sqrt(np.mean((u**term.i * y**term.j) ** 2))) or 1.0 for term in terms]
    return stroke / (span * np.array(sizes))


def equation(coefficients: Mapping[str, float]) -> str:
    """The law as text, its coefficients to 4 significant digits."""
    groups = []
    for rectified, rate in enumerate(RATES):
        part = {
            term: value for name, value in coefficients.items() if (term := Term.parse(name)).rectified == rectified
        }
        if part:
            summands = " + ".join(f"{value:.4g} {term.monomial}".rstrip() for term, value in part.items())
            groups.append(f"{rate} ({summands.replace('+ -', '- ')})")
    return f"y' = {' + '.join(groups) or '0'}"
