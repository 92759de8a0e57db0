"""The terms of the polynomial Duhem law and their names.

A term is a monomial u^i z^j, times |z| where it is `absolute`, times u' or |u'|. Its name is `u'` or `|u'|`, then
the powers that are not zero, u before |z| before z: `u'`, `u' u`, `|u'| u z^2`, `u' |z|`, `|u'| |z| z`. Where the
memory is the output it is called y in place of z: `|u'| y^2`. The terms have one order: those of u' before those
of |u'|, each by degree, then by the power of z.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np

from hysim._frozen import FloatArray

RATES = ("u'", "|u'|")

_NAME = re.compile(
    r"(?P<rate>u'|\|u'\|)"
    r"(?P<u> u(\^(?P<i>\d+))?)?"
    r"(?P<absolute> \|(?P<barred>[yz])\|)?"
    r"(?P<power> (?P<plain>[yz])(\^(?P<j>\d+))?)?"
)


class Term(NamedTuple):
    """The monomial u^i z^j times u', or times |u'| where it is `rectified`; sorts in the one order.

    `degree` is i + j, and one more in a term with |z|, which is `absolute`.
    """

    rectified: bool
    degree: int
    j: int
    absolute: bool = False

    @classmethod
    def parse(cls, name: str) -> Self:
        """The term of a name such as ``"|u'| u y^2"`` or ``"|u'| |z| z"``; the memory is called y or z.

        Raises
        ------
        ValueError
            If the name is not in the vocabulary.
        """
        match = _NAME.fullmatch(name)
        if match is not None:
            i, j = (int(match[power] or 1) if match[part] else 0 for part, power in (("u", "i"), ("power", "j")))
            absolute = match["absolute"] is not None
            term = cls(match["rate"] == RATES[1], i + j + absolute, j, absolute)
            if term.named(match["barred"] or match["plain"] or "z") == name:  # refuses "u^1", "|y| z" and the like
                return term
        raise ValueError(
            f"unknown term {name!r}: a term is u' or |u'|, then at most one power of u, |z|, and one power of z "
            '(or y in place of z), as in "u\'", "u\' u^2", "|u\'| u y" or "|u\'| |z| z"'
        )

    @property
    def i(self) -> int:
        """Power of u."""
        return self.degree - self.j - self.absolute

    def monomial(self, letter: str = "z") -> str:
        """The powers of u and of the memory, empty for the constant."""
        factors = _power("u", self.i), f"|{letter}|" * self.absolute, _power(letter, self.j)
        return " ".join(filter(None, factors))

    def named(self, letter: str) -> str:
        """The name in the vocabulary, the memory called by this letter."""
        return f"{RATES[self.rectified]} {self.monomial(letter)}".rstrip()

    @property
    def name(self) -> str:
        """The name in the vocabulary: the memory is z in a term with ``|z|``, and else y."""
        return self.named("z" if self.absolute else "y")

    def divisors(self) -> set[Self]:
        """The terms of one degree less that divide this one: what a shift of the origin of u or z adds to it."""
        lower = {(self.i - 1, self.j), (self.i, self.j - 1)}
        return {
            type(self)(self.rectified, i + j + self.absolute, j, self.absolute) for i, j in lower if i >= 0 and j >= 0
        }


def _power(letter: str, exponent: int) -> str:
    return "" if exponent == 0 else letter if exponent == 1 else f"{letter}^{exponent}"


class Polynomials(NamedTuple):
    """The arrays of one law, (rows, columns) each, or of many, (n_sets, rows, columns)."""

    p: FloatArray
    q: FloatArray
    p_abs: FloatArray
    q_abs: FloatArray


def polynomials(terms: Sequence[Term], coefficients: FloatArray) -> Polynomials:
    """The arrays of many laws from coefficients (n_sets, n_terms)."""
    parts = []
    for absolute in (False, True):
        chosen = [(k, term) for k, term in enumerate(terms) if term.absolute == absolute]
        rows, columns = (1 + max((getattr(term, power) for _, term in chosen), default=0) for power in ("i", "j"))
        pair = np.zeros((2, len(coefficients), rows, columns))
        for k, term in chosen:
            pair[int(term.rectified), :, term.i, term.j] = coefficients[:, k]
        parts += [*pair]
    return Polynomials(*parts)


def terms_of(polynomials: Polynomials) -> dict[Term, float]:
    """The coefficients of one law that are not zero, in the one order."""
    found = {}
    for k, part in enumerate(polynomials):
        rectified, absolute = bool(k % 2), k >= 2
        for i, j in np.argwhere(part).tolist():
            found[Term(rectified, i + j + absolute, j, absolute)] = float(part[i, j])
    return {term: found[term] for term in sorted(found)}


def coefficient_units(u: FloatArray, y: FloatArray, terms: Iterable[Term]) -> FloatArray:
    """The coefficient of each term, shape (n_terms,), whose contribution over the span of `u` is the stroke of `y`."""
    span, stroke = float(np.ptp(u)), float(np.ptp(y)) or 1.0
    powers = [u**term.i * y ** (term.j + term.absolute) for term in terms]
    sizes = [float(np.sqrt(np.mean(power**2))) or 1.0 for power in powers]
    return stroke / (span * np.array(sizes))


def equation(
    coefficients: Mapping[str, float],
    letter: str,
    *,
    feedthrough: float = 0.0,
    gain: float = 1.0,
    offset: float = 0.0,
) -> str:
    """The law as text, its coefficients to 4 significant digits; where the memory is called z, with the output."""
    groups = []
    for rate in RATES:
        part = {name.removeprefix(rate): value for name, value in coefficients.items() if name.startswith(rate)}
        if part:
            polynomial = " + ".join(f"{value:.4g}{monomial}" for monomial, value in part.items())
            groups.append(f"{rate} ({polynomial.replace('+ -', '- ')})")
    law = f"{letter}' = {' + '.join(groups) or '0'}"
    if letter == "y":
        return law
    summands = [f"{offset:.4g}"] * (offset != 0.0) + [f"{feedthrough:.4g} u"] * (feedthrough != 0.0)
    summands += ["z" if gain == 1.0 else f"{gain:.4g} z"]
    return f"{law}, y = {' + '.join(summands).replace('+ -', '- ')}"


_TYPESETTING = (
    (r"([uyz])''", r"\\ddot{\1}"),
    (r"([uyz])'", r"\\dot{\1}"),
    (r"\^(-?[\d.]+(?:e[+-]\d+)?)", r"^{\1}"),
    (r"e([+-])0*(\d+)", r" \\times 10^{\1\2}"),
    (r"\{\+", "{"),
    (r"\(", r"\\left("),
    (r"\)", r"\\right)"),
    (", y", r", \\quad y"),
)


def latex(text: str) -> str:
    """What `equation` wrote, for LaTeX."""
    for pattern, replacement in _TYPESETTING:
        text = re.sub(pattern, replacement, text)
    return text
