"""Duhem laws of given terms, as `identify` takes them: the search begins at a regression on the record.

Along the measured loop the law's integral is linear in its coefficients c_k of the monomials m_k,

    y(t) - y(0) = sum c_k integral m_k(u, y) r_k,    r_k = du or |du|

and least squares over all samples give them, with the integrals by the trapezoidal rule. Noise in y biases them a
little, so they are only where the search in free run begins. So do the coefficients of each lower degree; those that
run closest to the record are the middle of the box.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.laws.differential import _duhem_search
from hysim.laws.differential.terms import Term
from hysim.models.composable import Composable
from hysim.models.protocols import Identifiable
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

_RANK = 1e-6  # singular values of the normalised columns below this are taken as zero


@dataclass(frozen=True, kw_only=True)
class DuhemStructure(Identifiable, Composable):
    """The terms of a Duhem law without their coefficients; see `Duhem.structure`. `family` is any law of the family."""

    family: Identifiable
    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        if not self.terms:
            raise ValueError("terms must name at least one term")
        if barred := [term.name for term in self.terms if term.absolute]:
            raise ValueError(f"{barred[0]!r} needs a memory of its own: begin the search from a law, Duhem.from_terms")

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box of `Duhem.search_space` around the regression on this record."""
        names = [term.name for term in self.terms]
        degrees = sorted({term.degree for term in self.terms}, reverse=True)
        level = {"feedthrough": 0.0, "offset": 0.0, "y0": float(record.y[0]) if len(record) else 0.0}
        candidates = [{**dict.fromkeys(names, 0.0), **self._regression(record, degree), **level} for degree in degrees]
        candidates.sort(key=lambda values: self._distance(values, record))
        space = _duhem_search.search_space(candidates[0], record, freedom)
        unit = {name: values[0] for name, values in space.parameters(np.ones(space.lower.size)).items()}
        starts = np.array([[values[name] / unit[name] for name in space.coordinates] for values in candidates])
        return replace(space, starts=np.clip(starts, space.lower, space.upper), screened=0)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """As `Duhem.regressors`."""
        return self.family.regressors(parameters, record)

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The law with these parameters, one number for each name."""
        return self.family.assemble(parameters)

    def _distance(self, values: Mapping[str, float], record: Record) -> float:
        """Sum of squared residuals in free run, inf where the law diverges."""
        y = self.family.regressors(values, record)[0, :, 0]
        with np.errstate(over="ignore"):
            return float(np.sum((record.y - y) ** 2))

    def _regression(self, record: Record, degree: float) -> dict[str, float]:
        """The coefficients of the terms up to this degree."""
        terms = [term for term in self.terms if term.degree <= degree]
        du = np.diff(record.u)
        columns = []
        for term in terms:
            values = record.u**term.i * record.y**term.j
            way = np.abs(du) if term.rectified else du
            columns.append(np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * way)]))
        table = np.column_stack([*columns, np.ones(len(record))])
        norms = np.linalg.norm(table, axis=0)
        norms[norms == 0.0] = 1.0
        solution = np.linalg.lstsq(table / norms, record.y, rcond=_RANK)[0] / norms
        return {term.name: float(value) for term, value in zip(terms, solution, strict=False)}
