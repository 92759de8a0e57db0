"""The polynomial Duhem law: one slope where the input rises, another where it falls.

Duhem laws of given terms, as `identify` takes them: the search begins at a regression on the record.

Along the measured loop the law's integral is linear in its coefficients c_k of the monomials m_k,

    y(t) - y(0) = sum c_k integral m_k(u, y) r_k,    r_k = du or |du|

and least squares over all samples give them, with the integrals by the trapezoidal rule. Noise in y biases them a
little, so they are only where the search in free run begins. So do the coefficients of each lower degree; those that
run closest to the record are the middle of the box.

The box in which a Duhem law is searched: its own structure, around its own coefficients.

A coordinate is a coefficient measured by what its term contributes over the span of the input, in units
of the stroke; the feedthrough likewise; offset and y0 are measured in strokes. The box reaches 10 to both sides of the
law's own coefficients, and 1 of its y0. A parameter that the user bounds has these bounds.

A law that has neither |z| nor a feedthrough or an offset is not given one: its polynomials in u and y already hold it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_whole, read_only
from hysim.kernels import duhem as kernels
from hysim.kernels.branch import TOLERANCE
from hysim.laws.differential.duhem_runs import SAMPLES_A_THREAD, branches, free_runs, packed
from hysim.laws.differential.terms import (
    Polynomials,
    Term,
    coefficient_units,
    duhem_terms,
    equation,
    latex,
    polynomials,
    terms_of,
)
from hysim.models.composable import Composable
from hysim.models.law import Law, Packed, State, moving
from hysim.models.model import Example, family
from hysim.models.parameters import Coordinate, space_of
from hysim.models.protocols import CompiledLaw, Identifiable, Subject
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.tables import Tables
from hysim.records import Record, span_of

_REACH = 10.0
_REACH_LEVEL = 1.0
_RANK = 1e-6  # singular values of the normalised columns below this are taken as zero
_BOUND = 1e3
_OUTPUT = ("feedthrough", "offset", "y0")


def search_space(
    defaults: Mapping[str, float],
    record: Record,
    freedom: Freedom,
    points: Sequence[Mapping[str, float]] = ({},),
    screened: int | None = None,
) -> SearchSpace:
    """Declare the box for the terms, feedthrough, offset and y0 in `defaults`, with starts at `points`."""
    span_of(record)  # which raises
    terms = {name: Term.parse(name) for name in defaults if name not in _OUTPUT}
    has_own_memory = any(defaults[name] for name in _OUTPUT[:2]) or any(term.absolute for term in terms.values())
    held = freedom.held(
        defaults,
        redundant=() if has_own_memory else (("feedthrough",), ("offset",)),
        at_rest=("y0",) if freedom.starts_at_rest() else (),
    )
    units, box = _units(terms, defaults, record), []
    for name, value in defaults.items():
        reach = (_REACH_LEVEL if name in ("offset", "y0") else _REACH) * units[name]
        box.append(Coordinate(name, value - reach, value + reach, units[name]))
    limits = freedom.limits(defaults, held)
    return space_of(box, (), defaults, held, limits, points, state=("y0",), screened=screened)


def _units(terms: Mapping[str, Term], defaults: Mapping[str, float], record: Record) -> dict[str, float]:
    stroke = float(np.ptp(record.y)) or 1.0
    memory = record.y - defaults["offset"] - defaults["feedthrough"] * record.u
    units = dict(zip(terms, coefficient_units(record.u, memory, terms.values()).tolist(), strict=True))
    return {**units, "feedthrough": stroke / float(np.ptp(record.u)), "offset": stroke, "y0": stroke}


@dataclass(frozen=True, kw_only=True)
class DuhemStructure(Subject, Composable):
    """The terms of a Duhem law without their coefficients; see `Duhem.structure`. `family` is any law of the family."""

    family: Identifiable
    terms: tuple[Term, ...]

    def __post_init__(self) -> None:
        if not self.terms:
            raise ValueError("terms must name at least one term")
        if barred := [term.name for term in self.terms if term.absolute]:
            raise ValueError(f"{barred[0]!r} needs a memory of its own: begin the search from a law, Duhem.from_terms")

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        names = [term.name for term in self.terms]
        degrees = sorted({term.degree for term in self.terms}, reverse=True)
        level = {"feedthrough": 0.0, "offset": 0.0, "y0": float(record.y[0]) if len(record) else 0.0}
        candidates = [{**dict.fromkeys(names, 0.0), **self._regression(record, degree), **level} for degree in degrees]
        candidates.sort(key=lambda values: self._distance(values, record))
        return search_space(candidates[0], record, freedom, candidates, screened=0)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        return self.family.regressors(parameters, record)

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        return self.family.assemble(parameters)

    def _distance(self, values: Mapping[str, float], record: Record) -> float:
        """Sum of squared residuals in free run, inf where the law diverges."""
        y = self.family.regressors(values, record)[0, :, 0]
        with np.errstate(over="ignore"):
            return float(np.sum((record.y - y) ** 2))

    def _regression(self, record: Record, degree: float) -> dict[str, float]:
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


def _none() -> FloatArray:
    return np.zeros((1, 1))


@family
class Duhem(Law):
    """Polynomial Duhem law, ``y = offset + feedthrough u + z`` with ``z' = u' p(u, z) + |u'| q(u, z)``.

    ::

        p = sum (p_ij + p_abs_ij |z|) u^i z^j,    q = sum (q_ij + q_abs_ij |z|) u^i z^j
        Coleman-Hodgdon    p = b,                q = a (c u - y)
        Dahl               p = r,                q = -(r / F) y
        Bouc-Wen, n = 1    p = A - gamma |z|,    q = -beta z
        Bouc-Wen, n = 2    p = A - gamma z^2,    q = -beta |z| z

    dz/du is p + q where u rises and p - q where it falls: the law has hysteresis exactly if q is not zero. Without
    feedthrough and offset the memory z is the output. It is integrated to 1e-10 of the range (`hysim.kernels.branch`).
    Without u0 and state the `inverse_response` begins at rest at u = 0, the output at y0: the law that comes from there
    has the wanted output to 1e-12 of its range, and so has its `response` if that begins at y0. Sources: P. Duhem 1897;
    B. D. Coleman and M. L. Hodgdon, Int. J. Eng. Sci. 24 (1986).

    Parameters
    ----------
    p, q : array, shape (rows, columns)
        Element [i, j] multiplies ``u^i z^j`` [unit of y^(1-j) / unit of u^(i+1)]. The shapes may differ.
    p_abs, q_abs : array, shape (rows, columns)
        Element [i, j] multiplies ``|z| u^i z^j`` in p and in q [unit of y^(-j) / unit of u^(i+1)].
    feedthrough : float
        Slope of the output beside the memory [unit of y / unit of u].
    offset : float
        Output where u and the memory are zero [unit of y].
    y0 : float
        Output at the first sample [unit of y], whatever the input there.

    Raises
    ------
    ValueError
        If an array is empty, has not two axes, or a number is not finite.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0})  # Dahl's
    >>> law.equation
    "y' = u' (1) + |u'| (-1 y)"
    >>> law.response([0.0, 1.0, -1.0]).round(6).tolist()
    [0.0, 0.632121, -0.779117]
    """

    p: FloatArray
    q: FloatArray
    p_abs: FloatArray = field(default_factory=_none)
    q_abs: FloatArray = field(default_factory=_none)
    feedthrough: float = 0.0
    offset: float = 0.0
    y0: float = 0.0

    units: ClassVar = {"feedthrough": "y/u", "offset": "y", "y0": "y"}
    example = Example({"p": ((1.0, -0.5),), "q": ((0.3, -0.2),)}, (-2.0, 2.0), title="Duhem")
    step = staticmethod(kernels.step)
    workspace: ClassVar[int] = kernels.N_STATE - 2
    start = staticmethod(kernels.start)
    samples_a_thread = SAMPLES_A_THREAD
    initial: ClassVar[tuple[str, ...]] = ("y0",)

    def __post_init__(self) -> None:
        for name, part in self._parts._asdict().items():
            shape = part.shape
            if len(shape) != 2 or 0 in shape:
                raise ValueError(f"{name} must have two axes and at least one element, got shape {shape}")

    @classmethod
    def from_terms(
        cls, terms: Mapping[str, float], *, feedthrough: float = 0.0, offset: float = 0.0, y0: float = 0.0
    ) -> Self:
        """The law with these coefficients, by names such as ``"u'"``, ``"u' u^2"``, ``"|u'| u y"`` or ``"|u'| |z| z"``.

        The memory is called y or z; feedthrough, offset and y0 are those of the constructor. Raises ValueError if a
        name is not in the vocabulary, or two name the same term.
        """
        parsed = [Term.parse(name) for name in terms]
        for term, name in zip(parsed, terms, strict=True):
            if parsed.count(term) > 1:
                raise ValueError(f"the term {name!r} is given twice, once with y and once with z")
        parts = polynomials(parsed, np.array([list(terms.values())], dtype=float))
        arrays = {name: part[0] for name, part in parts._asdict().items()}
        return cls(**arrays, feedthrough=feedthrough, offset=offset, y0=y0)

    @classmethod
    def from_branches(
        cls,
        *,
        ascending: npt.ArrayLike,
        descending: npt.ArrayLike,
        feedthrough: float = 0.0,
        offset: float = 0.0,
        y0: float = 0.0,
    ) -> Self:
        """The law by its two slopes, ``z' = f1(u, z) u'`` where u rises and ``z' = f2(u, z) u'`` where it falls.

        Element [i, j] of `ascending` (f1) and `descending` (f2) multiplies ``u^i z^j`` [unit of y^(1-j) / unit of
        u^(i+1)]; the shapes may differ. Then p = (f1 + f2) / 2 and q = (f1 - f2) / 2. Errors as in the constructor.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.Duhem.from_branches(ascending=[[1.0, -1.0]], descending=[[1.0, 1.0]]).equation
        "y' = u' (1) + |u'| (-1 y)"
        """
        f1, f2 = (
            read_only(slope, name, ndim=2) for name, slope in (("ascending", ascending), ("descending", descending))
        )
        half = np.zeros((2, max(len(f1), len(f2)), max(f1.shape[1], f2.shape[1])))
        for k, slope in enumerate((f1, f2)):
            half[k, : slope.shape[0], : slope.shape[1]] = 0.5 * slope
        return cls(p=half[0] + half[1], q=half[0] - half[1], feedthrough=feedthrough, offset=offset, y0=y0)

    @classmethod
    def candidates(cls) -> dict[str, DuhemStructure]:
        """Polynomials of the first and of the second degree, for `hysim.compare`."""
        return {f"Duhem of degree {degree}": cls.structure(degree=degree) for degree in (1, 2)}

    @classmethod
    def structure(cls, *, degree: int | None = None, terms: Sequence[str] | None = None) -> DuhemStructure:
        """Terms of a law between u and y for `hysim.identify`, whose search begins at a regression on the record.

        ``hysim.identify(hysim.Duhem, ...)`` takes degree 2. Give either `degree`, for every monomial of u and y up to
        it, with u' and with ``|u'|``, (degree + 1)(degree + 2) terms; or `terms`, names as in `from_terms` without
        ``|z|``. Raises ValueError or TypeError if not one of the two is given, the degree is not a whole number of at
        least zero, or a name is not in the vocabulary.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.Duhem.from_terms({"u'": 0.345, "|u'| u": 3.1635, "|u'| y": -1.0})
        >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60)
        >>> fit = hs.identify(hs.Duhem.structure(terms=["u'", "|u'| u", "|u'| y"]), hs.Record(u=u, y=law.response(u)))
        >>> round(fit.estimates["|u'| u"], 6)
        3.1635
        """
        if degree is not None and terms is None:
            check_whole(degree, "degree", least=0)
            return DuhemStructure(family=cls(p=_none(), q=_none()), terms=duhem_terms(degree))
        if terms is not None and degree is None:
            return DuhemStructure(family=cls(p=_none(), q=_none()), terms=tuple(sorted(set(map(Term.parse, terms)))))
        raise ValueError("give degree or terms, one of the two")

    @property
    def terms(self) -> dict[str, float]:
        """Coefficients that are not zero by term, all of ``u'`` before those of ``|u'|``, each by degree.

        The memory is called y where it is the output: without feedthrough, offset and terms with ``|z|``; else z.
        """
        return {term.named(self._letter): value for term, value in terms_of(self._parts).items()}

    @property
    def equation(self) -> str:
        """The law as text, coefficients to 4 significant digits."""
        return equation(self.terms, self._letter, feedthrough=self.feedthrough, offset=self.offset)

    @property
    def latex(self) -> str:
        """The equation for LaTeX, without dollar signs."""
        return latex(self.equation)

    def tangent(self, direction: npt.ArrayLike, z: npt.ArrayLike, u: npt.ArrayLike = 0.0) -> FloatArray:
        """Slope dy/du at the memory `z`, for an input at `u` that moves in `direction`; see `hysim.BoucWen.tangent`."""
        velocity = moving(direction)
        inputs, memory = np.broadcast_arrays(np.asarray(u, dtype=float), np.asarray(z, dtype=float))
        p, q, p_abs, q_abs = (np.polynomial.polynomial.polyval2d(inputs, memory, part) for part in self._parts)
        size = np.abs(memory)
        return np.asarray(self.feedthrough + (p + size * p_abs) + np.sign(velocity) * (q + size * q_abs))

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | None) -> CompiledLaw:
        """By a search on the step; by default from rest at u = 0, the output at y0."""
        begin = state or self.state_at(float(u0 or 0.0))
        terms = abs(self.offset) + abs(self.feedthrough * begin[0]) + abs(begin[1])
        terms += TOLERANCE / np.finfo(float).eps * float(np.abs(y).max())  # the memory is known to so much of its range
        return self.search_inverse(begin, terms=terms)

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        return {"p": _none(), "q": _none(), **super().defaults()}

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters (offset, feedthrough, shape and numbers of the slopes by direction), memory (u, y0 - offset)."""
        laws = branches(Polynomials(*(tables[name] for name in Polynomials._fields)))
        first = np.broadcast_to(tables["y0"] - tables["offset"], (len(laws), 1))
        return Packed(
            packed(laws, tables["offset"], tables["feedthrough"]),
            np.concatenate([np.zeros((len(laws), 1)), first], axis=1),
        )

    def exchanged(self, columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        tables = super().exchanged({name: columns[name] for name in columns if name in _OUTPUT})
        for name, column in columns.items():
            if name not in _OUTPUT:
                term = Term.parse(name)
                field = Polynomials._fields[2 * int(term.absolute) + int(term.rectified)]
                chosen = np.zeros(tables[field].shape[1:], dtype=bool)
                chosen[term.i, term.j] = True
                tables[field] = np.where(chosen, column[:, np.newaxis], tables[field])
        return tables

    def divergence(self, sample: int, u: float, y: float) -> str:
        return f"{super().divergence(sample, u, y)}: {self.equation}"

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        return search_space(self.scalars, record, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The output itself, shape (n_sets, n_samples, 1): it is affine in none of the parameters."""
        values = {**self.scalars, **parameters}
        names = [name for name in values if name not in _OUTPUT]
        columns = np.broadcast_arrays(*(np.atleast_1d(values[name]) for name in (*names, *_OUTPUT)))
        *coefficients, feedthrough, offset, y0 = columns
        sets = np.stack(coefficients, axis=1) if coefficients else np.empty((len(y0), 0))
        bound = _BOUND * (float(np.abs(record.y).max()) or 1.0)
        terms = [Term.parse(name) for name in names]
        y, _ = free_runs(terms, sets, feedthrough, y0 - offset, record.u[np.newaxis], bound)
        return np.asarray(y + offset[:, np.newaxis])[..., np.newaxis]

    def steady(self, parameters: Parameters, record: Record) -> dict[str, FloatArray]:
        """Not computed: raises a ValueError."""
        raise ValueError('a Duhem law has no steady cycle that could be computed: use initial="free"')

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        terms = {name: value for name, value in parameters.items() if name not in _OUTPUT}
        others = {name: parameters.get(name, self.scalars[name]) for name in _OUTPUT}
        return self.from_terms(terms, **others)

    @property
    def _parts(self) -> Polynomials:
        return Polynomials(self.p, self.q, self.p_abs, self.q_abs)

    @property
    def _letter(self) -> str:
        return "z" if self.feedthrough or self.offset or self.p_abs.any() or self.q_abs.any() else "y"

    def with_scalars(self, scalars: Mapping[str, float]) -> Self:
        return self.assemble({**self.scalars, **scalars})

    @property
    def scalars(self) -> dict[str, float]:
        return {**self.terms, "feedthrough": self.feedthrough, "offset": self.offset, "y0": self.y0}
