"""From the numbers of a structure to models: a Bouc-Wen law where the terms are one, else a Duhem law.

    z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n

With y = feedthrough u + gain z only the products of gain with the others are determined: with a feedthrough A is 1,
otherwise the memory is the output and the gain is 1.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.discovery._refinement import Candidate
from hysim.discovery._structures import AnyExponent, Structure, Terms
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.duhem import Duhem
from hysim.laws.differential.terms import bouc_wen_exponent, bouc_wen_terms, equation
from hysim.records import Record

_STEP = 1e-6
_A = "u'"

OTHERS = ("n", "feedthrough", "offset", "gain")
"""Numbers of a law that are no coefficients."""


class ModelledLaw(NamedTuple):
    """A model for each record, numbers and standard errors by name, and the law as text.

    `parameters` are the numbers that are no coefficients, `initial_states` the memory at the first samples.
    """

    models: tuple[Any, ...]
    coefficients: dict[str, float]
    parameters: dict[str, float]
    initial_states: tuple[dict[str, float], ...]
    stderr: dict[str, float]
    equation: str


def law_from(candidate: Candidate[Any], records: Sequence[Record], letter: str) -> ModelledLaw:
    """The law of a structure refined on `records`, its memory called `letter`."""
    structure, unknowns = candidate.structure, candidate.unknowns
    numbers = _numbers(structure, letter)
    values = numbers(unknowns[: structure.size])
    models = tuple(
        _model(structure, values, letter, float(y0), float(record.u[0]))
        for y0, record in zip(unknowns[structure.size :], records, strict=True)
    )
    terms = _coefficients(values)
    parameters = {name: value for name, value in values.items() if name in OTHERS}
    shifts = {name: value for name, value in parameters.items() if name != "n"}
    states = tuple({f"{letter}0": float(m.memory(r.u[:1])[0])} for m, r in zip(models, records, strict=True))
    return ModelledLaw(
        models, terms, parameters, states, _stderr(candidate, numbers), equation(terms, letter, **shifts)
    )


def coefficients(structure: Terms, unknowns: FloatArray, letter: str) -> dict[str, float]:
    return _coefficients(_numbers(structure, letter)(unknowns[: structure.size]))


def _numbers(structure: Structure, letter: str) -> Callable[[FloatArray], dict[str, float]]:
    """From a structure's unknowns to the numbers that a user reads: a Bouc-Wen law with a feedthrough has A = 1."""
    shifts = ["feedthrough"] * structure.feedthrough + ["offset"] * structure.offset

    if isinstance(structure, AnyExponent):
        return lambda unknowns: _of_any_exponent(unknowns, shifts)
    names = [*(term.named(letter) for term in structure.terms), *shifts]
    n = bouc_wen_exponent(structure.terms)

    def numbers(unknowns: FloatArray) -> dict[str, float]:
        values = dict(zip(names, unknowns.tolist(), strict=True))
        return values if n is None or not structure.feedthrough else _normalised(values, float(n))

    return numbers


def _of_any_exponent(unknowns: FloatArray, shifts: Sequence[str]) -> dict[str, float]:
    n = float(unknowns[3])
    A, dissipative, conservative, *others = unknowns.tolist()
    _, rectified, plain = bouc_wen_terms(n)
    terms = {_A: A, plain.named("z"): conservative, rectified.named("z"): dissipative}
    values = terms | dict(zip(["n", *shifts], others, strict=True))
    return _normalised(values, n) if "feedthrough" in shifts else values


def _normalised(values: dict[str, float], n: float) -> dict[str, float]:
    gain = values.get(_A, 0.0)
    if gain == 0.0:
        return values
    odd = abs(gain) ** (n - 1.0)
    even = math.copysign(odd, gain)
    scaled = {name: value * (odd if name.startswith("|u'|") else even) for name, value in _coefficients(values).items()}
    return values | scaled | {_A: 1.0, "gain": gain}


def _coefficients(values: dict[str, float]) -> dict[str, float]:
    return {name: value for name, value in values.items() if name not in OTHERS}


def _stderr(candidate: Candidate[Any], numbers: Callable[[FloatArray], dict[str, float]]) -> dict[str, float]:
    size = candidate.structure.size
    unknowns, covariance = candidate.unknowns[:size], candidate.covariance[:size, :size]
    steps = _STEP * np.diag(np.where(unknowns == 0.0, 1.0, unknowns))
    ahead = np.array([list(numbers(unknowns + step).values()) for step in steps])
    behind = np.array([list(numbers(unknowns - step).values()) for step in steps])
    slopes = (ahead - behind) / (2.0 * np.diag(steps)[:, np.newaxis])
    spread = np.sqrt(np.einsum("ik,ij,jk->k", slopes, covariance, slopes))
    return dict(zip(numbers(unknowns), spread.tolist(), strict=True))


def _model(structure: Structure, values: dict[str, float], letter: str, y0: float, u0: float) -> Any:
    feedthrough, offset, gain = values.get("feedthrough", 0.0), values.get("offset", 0.0), values.get("gain", 1.0)
    n = values["n"] if isinstance(structure, AnyExponent) else bouc_wen_exponent(structure.terms)
    if isinstance(structure, Terms) and (letter == "y" or n is None):
        return Duhem.from_terms(_coefficients(values), feedthrough=feedthrough, offset=offset, y0=y0)
    terms = {name: value for name, value in _coefficients(values).items() if name != _A}
    return BoucWen(
        A=values.get(_A, 0.0),
        beta=-sum(value for name, value in terms.items() if name.startswith("|u'|")),
        gamma=-sum(value for name, value in terms.items() if name.startswith("u'")),
        n=float(n or 1),
        feedthrough=feedthrough,
        gain=gain,
        offset=offset,
        z0=(y0 - offset - feedthrough * u0) / gain,
    )
