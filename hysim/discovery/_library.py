"""The library of a Duhem law on a record: its terms, their sizes, and which of them the record can tell apart.

Along the loading length L, with s = sgn(du), the law is linear in its coefficients:

    dy/dL = sum p_ij s u^i y^j + sum q_ij u^i y^j

Each column is scaled to unit rms over the samples, and so is dy/dL: a threshold is then a number without
unit, the share of a term in the slope.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hysim._frozen import FloatArray
from hysim.discovery._derivatives import MIN_SAMPLES, Branch, branches
from hysim.models.duhem_terms import Term
from hysim.records import Record

DEPENDENT = 1e-6  # share of a column that those before it do not explain, below which it is left out


def duhem_terms(degree: int) -> tuple[Term, ...]:
    """All terms u' u^i y^j and |u'| u^i y^j with i + j <= degree, in the one order."""
    if not isinstance(degree, int) or isinstance(degree, bool) or degree < 0:
        raise ValueError(f"degree must be a whole number from 0 up, got {degree!r}")
    powers = [(total, j) for total in range(degree + 1) for j in range(total + 1)]
    return tuple(Term(rectified, total, j) for rectified in (False, True) for total, j in powers)


@dataclass(frozen=True)
class Regression:
    """dy/dL = features @ coefficients on the branches of a record, in scaled units.

    `sizes` (n_terms,) are the rms values of the columns, `slope_size` that of dy/dL. `dependent` are the
    terms left out since their columns are combinations of those of lower degree on this record.
    """

    terms: tuple[Term, ...]
    dependent: tuple[Term, ...]
    branches: list[Branch]
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


def feature(term: Term, u: FloatArray, y: FloatArray, direction: FloatArray | float) -> FloatArray:
    """The column of a term in dy/dL."""
    column = u**term.i * y**term.j
    return column if term.rectified else direction * column


def regression(record: Record, terms: tuple[Term, ...]) -> Regression:
    """Set up the regression on a record, with those of the terms that it can tell apart.

    Raises
    ------
    ValueError
        If the record cannot tell u' from |u'|: its input or output is constant, its input never reverses,
        or its branches are too short; or if it has no more samples than there are terms.
    """
    for name, values in (("input", record.u), ("output", record.y)):
        if np.ptp(values) == 0.0:
            raise ValueError(f"the {name} is constant: give a record on which it moves")
    found = branches(record.u, record.y)
    if len({branch.direction for branch in found}) < 2:
        raise ValueError(
            f"a Duhem law needs a rising and a falling branch of at least {MIN_SAMPLES} samples each: with one of "
            "them alone u' and |u'| are the same thing. Give a record whose input reverses, sampled more finely"
        )
    if len(record) <= len(terms):
        raise ValueError(f"{len(record)} samples cannot tell {len(terms)} terms and y0: lower the degree")
    raw = np.concatenate([np.stack([feature(t, b.u, b.y, b.direction) for t in terms], axis=1) for b in found])
    slope = np.concatenate([branch.slope for branch in found])
    sizes, slope_size = np.sqrt(np.mean(raw**2, axis=0)), float(np.sqrt(np.mean(slope**2)))
    scaled = raw / np.where(sizes > 0.0, sizes, 1.0)
    kept = sorted(_independent(scaled, sorted(range(len(terms)), key=lambda k: (terms[k].degree, k))))
    return Regression(
        terms=tuple(terms[k] for k in kept),
        dependent=tuple(term for k, term in enumerate(terms) if k not in kept),
        branches=found,
        features=scaled[:, kept],
        slope=slope / slope_size,
        sizes=sizes[kept],
        slope_size=slope_size,
    )


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
