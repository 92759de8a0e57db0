"""The terms of memory laws: their names, their libraries, and the equations that they make.

A term is u' or |u'| times u^i |z|^a z^j; u is the input, inside an oscillator the displacement. Its name is `u'` or
`|u'|`, then the powers that are not zero, u before |z| before z: `u'`, `u' u`, `|u'| u z^2`, `u' |z|`, `|u'| |z| z`,
`|u'| |z|^0.5 z`. Where the memory is the output it is called y in place of z: `|u'| y^2`. The powers of u and z are
whole numbers; that of |z| is 0 or 1 in a polynomial law, and any number in a Bouc-Wen law. One more term, RELAXATION,
is z alone: a law that has it depends on the rate.

The terms have one order: those of u' before those of |u'|, each by degree, then by the power of z.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np

from hysim._basics.frozen import FloatArray

RATES = ("u'", "|u'|")

_NAME = re.compile(
    r"(?P<rate>u'|\|u'\|)"
    r"(?P<u> u(\^(?P<i>\d+))?)?"
    r"(?P<absolute> \|(?P<barred>[yz])\|)?"
    r"(?P<power> (?P<plain>[yz])(\^(?P<j>\d+))?)?"
)


class Term(NamedTuple):
    """The product u^i |z|^absolute z^j times u', or times |u'| where it is `rectified`; sorts in the one order.

    `degree` is i + j + absolute. A `relaxing` term is z alone.
    """

    rectified: bool
    degree: float
    j: int
    absolute: float = 0
    relaxing: bool = False

    @classmethod
    def parse(cls, name: str) -> Self:
        """The term of a name such as ``"|u'| u y^2"`` or ``"|u'| |z| z"``; the memory is called y or z.

        Raises ValueError if the name is not that of a term of a polynomial law.
        """
        match = _NAME.fullmatch(name)
        if match is not None:
            i, j = (int(match[power] or 1) if match[part] else 0 for part, power in (("u", "i"), ("power", "j")))
            absolute = int(match["absolute"] is not None)
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
        return round(self.degree - self.j - self.absolute)

    @property
    def is_polynomial(self) -> bool:
        """Whether the term is u' or |u'| times a polynomial on each side of z = 0."""
        return not self.relaxing and self.absolute in (0, 1)

    @property
    def is_even_in_memory(self) -> bool:
        """Whether the term keeps its sign when z changes sign."""
        return self.j % 2 == 0

    @property
    def is_odd(self) -> bool:
        """Whether the term changes its sign when u and z do."""
        return self.relaxing or (self.i + self.j) % 2 == int(self.rectified)

    def monomial(self, letter: str = "z") -> str:
        """The powers of u and of the memory, empty for the constant."""
        factors = _power("u", self.i), _power(f"|{letter}|", self.absolute), _power(letter, self.j)
        return " ".join(filter(None, factors))

    def named(self, letter: str) -> str:
        """The name, the memory called by this letter."""
        return letter if self.relaxing else f"{RATES[self.rectified]} {self.monomial(letter)}".rstrip()

    @property
    def name(self) -> str:
        """The name: the memory is z in a term with ``|z|`` and in the relaxation, and else y."""
        return self.named("z" if self.absolute or self.relaxing else "y")

    def divisors(self) -> set[Self]:
        """The terms of one degree less that divide this one: what a shift of the origin of u or z adds to it."""
        lower = {(self.i - 1, self.j), (self.i, self.j - 1)}
        return {
            type(self)(self.rectified, i + j + self.absolute, j, self.absolute) for i, j in lower if i >= 0 and j >= 0
        }


RELAXATION = Term(False, 1, 1, relaxing=True)


def power_term(rectified: bool, power: float, *, even: bool) -> Term:
    """U' or ``|u'|`` times ``|z|^power``, with the sign of z unless it is `even`."""
    if power != int(power):
        return Term(rectified, power, int(not even), power if even else power - 1.0)
    absolute = int(even != (power % 2 == 0))
    return Term(rectified, int(power), int(power) - absolute, absolute)


def bouc_wen_terms(n: float) -> tuple[Term, Term, Term]:
    """U', ``|u'| |z|^(n-1) z`` and ``u' |z|^n``: the terms whose coefficients are A, -beta and -gamma."""
    return power_term(False, 0, even=True), power_term(True, n, even=False), power_term(False, n, even=True)


def bouc_wen_exponent(terms: Iterable[Term]) -> float | None:
    """The exponent n of the Bouc-Wen law that has these terms; None if no Bouc-Wen law has them."""
    present = set(terms)
    n = max((term.degree for term in present), default=0)
    return n if n > 0 and present <= set(bouc_wen_terms(n)) else None


def duhem_terms(degree: int) -> tuple[Term, ...]:
    """All terms u' u^i y^j and ``|u'| u^i y^j`` with i + j <= degree, in the one order.

    Raises ValueError if `degree` is no whole number from 0 up.
    """
    powers = [(total, j) for total in range(_whole(degree) + 1) for j in range(total + 1)]
    return tuple(Term(rectified, total, j) for rectified in (False, True) for total, j in powers)


def memory_terms(degree: int) -> tuple[Term, ...]:
    """All terms u' and ``|u'|`` times z^j, or ``|z|`` z^(j-1), with j <= degree, in the one order.

    Raises ValueError if `degree` is no whole number from 0 up.
    """
    powers = [(0, True)] + [(power, even) for power in range(1, _whole(degree) + 1) for even in (False, True)]
    return tuple(sorted(power_term(rate, power, even=even) for rate in (False, True) for power, even in powers))


def named_terms(names: Iterable[str]) -> tuple[Term, ...]:
    """The terms of these names, in the one order.

    Raises ValueError if there is none, or one is unknown or given twice.
    """
    listed = [names] if isinstance(names, str) else list(names)
    terms = tuple(sorted({Term.parse(name) for name in listed}))
    if len(terms) < len(listed) or not terms:
        raise ValueError(f"a library is a list of different terms, got {listed}")
    return terms


def symmetric(terms: Iterable[Term], symmetry: str | None) -> tuple[Term, ...]:
    """The terms of an odd law, whose response to -u is -y, or of an even one, whose response to -u is y.

    With u and z, u' changes its sign and ``|u'|`` does not: an odd law has of u' the monomials that are even in (u, z)
    and of ``|u'|`` those that are odd; an even one of u' those odd in u and of ``|u'|`` those that are even.

    Raises ValueError if `symmetry` is not None, "odd" or "even".
    """
    if symmetry is None:
        return tuple(terms)
    if symmetry == "odd":
        return tuple(term for term in terms if term.is_odd)
    if symmetry == "even":
        return tuple(term for term in terms if term.i % 2 != int(term.rectified))
    raise ValueError(f'symmetry must be None, "odd" or "even", got {symmetry!r}')


def _whole(degree: int) -> int:
    if not isinstance(degree, int) or isinstance(degree, bool) or degree < 0:
        raise ValueError(f"degree must be a whole number from 0 up, got {degree!r}")
    return degree


def _power(letter: str, exponent: float) -> str:
    return "" if exponent == 0 else letter if exponent == 1 else f"{letter}^{exponent:.4g}"


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
        rows = 1 + max((term.i for _, term in chosen), default=0)
        columns = 1 + max((term.j for _, term in chosen), default=0)
        pair = np.zeros((2, len(coefficients), rows, columns))
        for k, term in chosen:
            pair[int(term.rectified), :, term.i, term.j] = coefficients[:, k]
        parts += [*pair]
    return Polynomials(*parts)


def terms_of(polynomials: Polynomials) -> dict[Term, float]:
    """The coefficients of one law that are not zero, in the one order."""
    coefficients = {}
    for k, part in enumerate(polynomials):
        rectified, absolute = bool(k % 2), k >= 2
        for i, j in np.argwhere(part).tolist():
            coefficients[Term(rectified, i + j + absolute, j, absolute)] = float(part[i, j])
    return {term: coefficients[term] for term in sorted(coefficients)}


def coefficient_units(u: FloatArray, y: FloatArray, terms: Iterable[Term]) -> FloatArray:
    """The coefficient of each term, shape (n_terms,), whose contribution over the span of `u` is the stroke of `y`."""
    span, stroke = float(np.ptp(u)), float(np.ptp(y)) or 1.0
    powers = [u**term.i * y ** (term.j + term.absolute) for term in terms]
    sizes = [float(np.sqrt(np.mean(power**2))) or 1.0 for power in powers]
    return stroke / (span * np.array(sizes))


def law_text(coefficients: Mapping[str, float], letter: str) -> str:
    """The law of a memory as text, its coefficients by the names of the terms, to 4 significant digits."""
    groups = []
    for rate in RATES:
        part = {name.removeprefix(rate): value for name, value in coefficients.items() if name.startswith(rate)}
        if part:
            polynomial = " + ".join(f"{value:.4g}{monomial}" for monomial, value in part.items())
            groups.append(f"{rate} ({polynomial.replace('+ -', '- ')})")
    groups += [f"{value:.4g} {name}" for name, value in coefficients.items() if name == RELAXATION.name]
    return f"{letter}' = {' + '.join(groups) or '0'}".replace("+ -", "- ")


def equation(
    coefficients: Mapping[str, float], letter: str, *, feedthrough: float = 0.0, gain: float = 1.0, offset: float = 0.0
) -> str:
    """The law as text; where the memory is called z, with the output."""
    law = law_text(coefficients, letter)
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
    """The text of `equation` for LaTeX."""
    for pattern, replacement in _TYPESETTING:
        text = re.sub(pattern, replacement, text)
    return text
