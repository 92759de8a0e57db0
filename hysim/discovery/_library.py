"""Libraries of terms, and the regression of a record's slope on them.

Two libraries, both closed under a change of units of u and y:

    Duhem       u' u^i y^j and |u'| u^i y^j                        the output is the memory
    Bouc-Wen    u' and |u'| times z^j or |z| z^j                   y = offset + feedthrough u + z

Each column is scaled to unit rms over the rows, and so is the slope: a threshold is then a number without unit,
the share of a term in the slope.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hysim._frozen import FloatArray
from hysim.discovery._derivatives import MIN_SAMPLES, Feature, Rows, smoothed_rows, weak_rows
from hysim.models.terms import Term
from hysim.records import Record

DEPENDENT = 1e-6  # share of a column that those before it do not explain, below which it is left out
FORMS = {"smoothed": smoothed_rows, "weak": weak_rows}


def signs_of(terms: Sequence[Term], signs: Mapping[str, int] | None) -> dict[Term, int]:
    """The signs that coefficients must have, by term."""
    wanted = {Term.parse(name): sign for name, sign in (signs or {}).items()}
    for term, sign in wanted.items():
        if term not in terms:
            raise ValueError(f"signs: {term.name!r} is not in the library")
        if sign not in (-1, 1):
            raise ValueError(f"signs: the sign of {term.name!r} must be 1 or -1, got {sign!r}")
    return wanted


@dataclass(frozen=True)
class Regression:
    """slope = features @ coefficients, in scaled units.

    `sizes` (n_terms,) are the rms values of the columns, `slope_size` that of the slope. `dependent` are the terms
    left out since their columns are combinations of those of lower degree on these records.
    """

    terms: tuple[Term, ...]
    dependent: tuple[Term, ...]
    features: FloatArray
    slope: FloatArray
    sizes: FloatArray
    slope_size: float

    @property
    def condition(self) -> float:
        """Condition number of the scaled features."""
        return float(np.linalg.cond(self.features))

    def kept(self, coefficients: FloatArray) -> tuple[Term, ...]:
        """The terms whose coefficients (n_terms,) are not zero."""
        return tuple(term for term, value in zip(self.terms, coefficients, strict=True) if value != 0.0)

    def ridge(self, terms: Sequence[Term], weight: float) -> FloatArray:
        """Coefficients (n_terms,) of a law with these terms alone, by ridge regression."""
        kept = [self.terms.index(term) for term in terms]
        columns = self.features[:, kept]
        normal = columns.T @ columns / len(columns) + weight * np.eye(len(kept))
        scaled = np.linalg.solve(normal, columns.T @ self.slope / len(columns))
        return np.asarray(scaled * self.slope_size / self.sizes[kept])


@dataclass(frozen=True)
class Slopes:
    """The rows of several records in one form."""

    rows: tuple[Rows, ...]

    def equations(
        self, features: Feature, feedthrough: float = 0.0, offset: float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """Right sides (n_rows, n_terms) and left side (n_rows,) for z = y - feedthrough u - offset."""
        columns = np.concatenate([rows.columns(features, feedthrough, offset) for rows in self.rows])
        return columns, np.concatenate([rows.left(feedthrough) for rows in self.rows])

    def misfit(self, terms: Sequence[Term], feedthrough: float, offset: float) -> float:
        """Rms of the slope that all terms together leave over."""
        columns, slope = self.equations(_features(terms), feedthrough, offset)
        triangle = np.asarray(np.linalg.qr(np.column_stack([columns, slope]), mode="r"))
        return abs(float(triangle[-1, -1])) / math.sqrt(len(slope))

    def regression(self, terms: Sequence[Term], feedthrough: float = 0.0, offset: float = 0.0) -> Regression:
        """The regression on those of the terms that the records can tell apart, for z = y - feedthrough u - offset."""
        raw, slope = self.equations(_features(terms), feedthrough, offset)
        sizes, slope_size = np.sqrt(np.mean(raw**2, axis=0)), float(np.sqrt(np.mean(slope**2))) or 1.0
        scaled = raw / np.where(sizes > 0.0, sizes, 1.0)
        kept = sorted(_independent(scaled, sorted(range(len(terms)), key=lambda k: (terms[k].degree, k))))
        return Regression(
            terms=tuple(terms[k] for k in kept),
            dependent=tuple(term for k, term in enumerate(terms) if k not in kept),
            features=scaled[:, kept],
            slope=slope / slope_size,
            sizes=sizes[kept],
            slope_size=slope_size,
        )


def slopes(records: Sequence[Record], form: str) -> Slopes:
    """The rows of records in the "smoothed" or the "weak" form.

    Raises
    ------
    ValueError
        If the records cannot tell u' from |u'|: their input never reverses, or their branches are too short.
    """
    found = tuple(rows for record in records if (rows := FORMS[form](record.u, record.y)) is not None)
    directions = {sign for rows in found for sign in np.unique(rows.direction).tolist()}
    if len(directions) < 2:
        raise ValueError(
            f"a memory law needs a rising and a falling branch of at least {MIN_SAMPLES} samples each: with one of "
            "them alone u' and |u'| are the same thing. Give a record whose input reverses, sampled more finely"
        )
    return Slopes(found)


def _features(terms: Sequence[Term]) -> Feature:
    def features(u: FloatArray, z: FloatArray, direction: FloatArray) -> FloatArray:
        return np.stack([feature(term, u, z, direction) for term in terms], axis=1)

    return features


def feature(term: Term, u: FloatArray, z: FloatArray, direction: FloatArray | float) -> FloatArray:
    """The column of a term in dz/dL."""
    column = u**term.i * z**term.j
    if term.absolute:
        column = column * np.abs(z)
    return column if term.rectified else direction * column


def _independent(columns: FloatArray, order: list[int]) -> list[int]:
    """The columns that, taken in `order`, are not linear combinations of those before them."""
    basis = np.empty((len(columns), 0))
    kept = []
    for k in order:
        left = columns[:, k] / np.sqrt(len(columns))
        for _ in range(2):  # twice is enough for orthogonality to rounding
            left = left - basis @ (basis.T @ left)
        size = float(np.linalg.norm(left))
        if size > DEPENDENT:
            kept.append(k)
            basis = np.column_stack([basis, left / size])
    return kept
