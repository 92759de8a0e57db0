"""The box in which a Duhem law is searched: its own structure, around its own coefficients.

A coordinate is a coefficient measured by what its term contributes over the span of the input, in units
of the stroke; the feedthrough likewise; offset and y0 are measured in strokes. The box reaches 10 to both sides of the
law's own coefficients, and 1 of its y0. A parameter that the user bounds has these bounds.

A law that has neither |z| nor a feedthrough or an offset is not given one: its polynomials in u and y already hold it.
"""

from collections.abc import Mapping

import numpy as np

from hysim._frozen import FloatArray
from hysim.laws.differential.terms import Term, coefficient_units
from hysim.models.search_space import Freedom, SearchSpace
from hysim.records import Record

_REACH = 10.0
_REACH_LEVEL = 1.0
_OUTPUT = ("feedthrough", "offset", "y0")


def search_space(
    defaults: Mapping[str, float],
    record: Record,
    freedom: Freedom,
) -> SearchSpace:
    """Declare the box for the terms, feedthrough, offset and y0 in `defaults`."""
    if np.ptp(record.u) == 0.0:
        raise ValueError("the input is constant: nothing can be identified from it")
    terms = {name: Term.parse(name) for name in defaults if name not in _OUTPUT}
    held = freedom.held(
        defaults,
        redundant=() if _has_memory_of_its_own(defaults, terms) else (("feedthrough",), ("offset",)),
        at_rest=("y0",) if freedom.starts_at_rest() else (),
    )
    limits = freedom.limits(defaults, held)
    names = tuple(name for name in defaults if name not in held)
    unit = _units(terms, defaults, record)
    scale = np.array([unit[name] for name in names])
    start = np.array([defaults[name] for name in names]) / scale
    reach = np.array([_REACH_LEVEL if name in ("offset", "y0") else _REACH for name in names])
    lower, upper = start - reach, start + reach
    for k, name in enumerate(names):
        if name in limits:
            lower[k], upper[k] = np.array(limits[name]) / scale[k]

    def parameters(x: FloatArray) -> dict[str, FloatArray]:
        sets = np.atleast_2d(x) * scale
        constants = {name: np.full(len(sets), value) for name, value in held.items()}
        return constants | dict(zip(names, sets.T, strict=True))

    return SearchSpace(
        coordinates=names,
        lower=lower,
        upper=upper,
        starts=np.clip(start, lower, upper)[np.newaxis],
        names=names,
        columns=(),
        linear=(),
        held=held,
        parameters=parameters,
        state=("y0",),
    )


def _has_memory_of_its_own(defaults: Mapping[str, float], terms: Mapping[str, Term]) -> bool:
    return any(defaults[name] for name in _OUTPUT[:2]) or any(term.absolute for term in terms.values())


def _units(terms: Mapping[str, Term], defaults: Mapping[str, float], record: Record) -> dict[str, float]:
    stroke = float(np.ptp(record.y)) or 1.0
    memory = record.y - defaults["offset"] - defaults["feedthrough"] * record.u
    units = dict(zip(terms, coefficient_units(record.u, memory, terms.values()).tolist(), strict=True))
    return {**units, "feedthrough": stroke / float(np.ptp(record.u)), "offset": stroke, "y0": stroke}
