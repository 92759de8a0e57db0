"""The results of `discover` and `discover_oscillator`.

The numbers of a structure become models: a Bouc-Wen law where the terms are one, else a Duhem law. With y = feedthrough
u + gain z only the products of gain with the numbers of the memory are determined: with a feedthrough A is 1, otherwise
the memory is the output and the gain is 1.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray, frozen
from hysim._basics.printing import frozen_result, summary_text, wrapped
from hysim.discovery._judgement import Judgement
from hysim.discovery._refinement import Candidate, Structure
from hysim.interop import frame
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.duhem import Duhem
from hysim.laws.differential.terms import bouc_wen_exponent, bouc_wen_terms, equation, latex
from hysim.models.storage import Stored
from hysim.plants.transfer_function import TransferFunction
from hysim.records import Record

_STEP = 1e-6
_A = "u'"

OTHERS = ("n", "feedthrough", "offset", "gain")
"""Numbers of a law that are no coefficients."""


class ModelledLaw(NamedTuple):
    """A model for each record, coefficients, other `parameters`, standard errors, first memories, and the text."""

    models: tuple[Any, ...]
    coefficients: dict[str, float]
    parameters: dict[str, float]
    initial_states: tuple[dict[str, float], ...]
    stderr: dict[str, float]
    equation: str


def law_from(candidate: Candidate, records: Sequence[Record], letter: str) -> ModelledLaw:
    structure, unknowns = candidate.structure, candidate.unknowns
    numbers = partial(_numbers, structure, letter)
    values = numbers(unknowns[: structure.size])
    starts = unknowns[structure.size :].tolist()
    models = tuple(_model(structure, values, letter, y0, float(r.u[0])) for y0, r in zip(starts, records, strict=True))
    terms = _coefficients(values)
    parameters = {name: value for name, value in values.items() if name in OTHERS}
    shifts = {name: value for name, value in parameters.items() if name != "n"}
    states = tuple({f"{letter}0": float(m.memory(r.u[:1])[0])} for m, r in zip(models, records, strict=True))
    text = equation(terms, letter, **shifts)
    return ModelledLaw(models, terms, parameters, states, _stderr(candidate, numbers), text)


def coefficients(structure: Structure, unknowns: FloatArray, letter: str) -> dict[str, float]:
    return _coefficients(_numbers(structure, letter, unknowns[: structure.size]))


def _numbers(structure: Structure, letter: str, unknowns: FloatArray) -> dict[str, float]:
    """The numbers that a user reads (size,): a Bouc-Wen law with a feedthrough has A = 1."""
    shifts = ["feedthrough"] * structure.feedthrough + ["offset"] * structure.offset
    if structure.any_exponent:
        A, dissipative, conservative, n, *others = unknowns.tolist()
        _, rectified, plain = bouc_wen_terms(n)
        terms = {_A: A, plain.named("z"): conservative, rectified.named("z"): dissipative}
        values = terms | dict(zip(["n", *shifts], [n, *others], strict=True))
    else:
        n = bouc_wen_exponent(structure.terms)
        names = [*(term.named(letter) for term in structure.terms), *shifts]
        values = dict(zip(names, unknowns.tolist(), strict=True))
    gain = values.get(_A, 0.0)
    if n is None or not structure.feedthrough or gain == 0.0:
        return values
    odd = abs(gain) ** (n - 1.0)
    even = math.copysign(odd, gain)
    scaled = {name: value * (odd if name.startswith("|u'|") else even) for name, value in _coefficients(values).items()}
    return values | scaled | {_A: 1.0, "gain": gain}


def _coefficients(values: dict[str, float]) -> dict[str, float]:
    return {name: value for name, value in values.items() if name not in OTHERS}


def _stderr(candidate: Candidate, numbers: Callable[[FloatArray], dict[str, float]]) -> dict[str, float]:
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
    n = values["n"] if structure.any_exponent else bouc_wen_exponent(structure.terms)
    if not structure.any_exponent and (letter == "y" or n is None):
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


@frozen
class _Discovered(Stored, ABC):
    json_name = "discovery"
    json_parts = (Judgement,)

    model: Any | None
    models: tuple[Any, ...]
    coefficients: Mapping[str, float]
    stderr: Mapping[str, float]
    equation: str
    verdict: str
    scores: Mapping[str, float]
    n_parameters: int
    left_out: tuple[str, ...]
    regressed: Mapping[str, float]
    inclusion: Mapping[str, float]
    path_n_terms: FloatArray
    path_fit_percent: FloatArray
    path_bic: FloatArray
    message: str = ""
    warnings: tuple[str, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    initial: str = "free"
    initial_states: tuple[Mapping[str, float], ...] = ()

    @property
    def latex(self) -> str:
        """The law for LaTeX, without dollar signs."""
        return latex(self.equation)

    @abstractmethod
    def _rows(self, *, full: bool) -> dict[str, str]:
        """Rows of this result alone, for `summary` in full and for `str` in short."""

    def __str__(self) -> str:
        numbers = [f"{name} {value:.4g}{self._spread(name)}" for name, value in self._numbers.items()]
        head = f"{type(self).__name__}: {self.verdict}, {self._fit}, {self.n_parameters} parameters"
        rows = {"initial state": self._initial_state("{:.4g}"), **self._rows(full=False)}
        rows |= {"warnings": " ".join(self.warnings), "search": self.message}
        return summary_text([head, f"  {self.equation}", wrapped(numbers)], rows)

    def summary(self) -> str:
        """The result in a few lines."""
        parameters = f"{self.n_parameters} parameters{self._counted}"
        lines = [self.equation, f"  {self.verdict}; {self._fit}, BIC {self.scores['bic']:.1f}, {parameters}"]
        lines += [f"  {name} = {value:.6g}{self._spread(name)}" for name, value in self._numbers.items()]
        lines += [f"  initial state ({self.initial}): {self._initial_state('{:.6g}')}"] * bool(self.initial_states)
        lines += [f"  {name}: {text}" for name, text in self._rows(full=True).items() if text]
        lines += [f"  {self.message}"] * bool(self.message)
        lines += ["Warnings"] * bool(self.warnings) + [f"  {warning}" for warning in self.warnings]
        return "\n".join(lines)

    @property
    def _fit(self) -> str:
        return f"fit {self.scores['fit_percent']:.2f} %, rmse {self.scores['rmse']:.4g}"

    @property
    def _numbers(self) -> dict[str, float]:
        return {**self.coefficients, **self.parameters}

    @property
    def _counted(self) -> str:
        if self.initial != "free" or not self.initial_states:
            return ""
        n = sum(map(len, self.initial_states))
        return f", {n} of them {'an initial state' if n == 1 else 'initial states'}"

    def _initial_state(self, form: str) -> str:
        states = self.initial_states
        if all(state == states[0] for state in states):
            states = states[:1]
        return "; ".join(
            ", ".join(f"{name} = {form.format(value)}" for name, value in state.items()) for state in states
        )

    def to_frame(self) -> Any:
        """The terms as a `pandas.DataFrame`, one row each, by their names; ImportError without pandas.

        The columns are coefficient and stderr, nan where it is unknown. ``attrs`` has the equation and the verdict.
        """
        stderr = [float(self.stderr.get(name, math.nan)) for name in self.coefficients]
        columns = {"coefficient": [*map(float, self.coefficients.values())], "stderr": stderr}
        notes = {"equation": self.equation, "verdict": self.verdict}
        return frame(columns, index=("term", [*self.coefficients]), notes=notes)

    def _spread(self, name: str) -> str:
        value = self.stderr.get(name, math.nan)
        return "" if math.isnan(value) else f" +- {value:.2g}"


@frozen_result
class Discovery(_Discovered):
    """A law that was discovered in records.

    Parameters
    ----------
    model, models
        BoucWen or Duhem law of `equation`, refined by simulation error, from the initial state of the first record; and
        one for each record.
    coefficients : mapping
        Term to coefficient, as ``"|u'| z"``. With a feedthrough a Bouc-Wen law is scaled to ``"u'"`` with coefficient
        1.
    stderr : mapping
        Standard errors of the coefficients and of `parameters`; nan where the records do not determine them.
    equation : str
        The law as text.
    verdict : str
        ``"rate-independent hysteresis"``, ``"linear lag"``, ``"cannot be told from one rate"`` or
        ``"no structure found"``; see `discover`.
    scores : mapping
        ``"fit_percent"`` [%], ``"rmse"`` [unit of y], ``"bic"`` and ``"n_terms"`` of the free run; ``"threshold"``, the
        largest that keeps all the law's terms, ``"n_structures"`` refined, ``"condition"`` of the regression.
    n_parameters : int
        Number of fitted parameters, free initial states included.
    left_out : tuple of str
        Terms of the library that are combinations of those of lower degree on these records.
    regressed : mapping
        Coefficients before their refinement, from the regression of slopes; empty for a scanned exponent.
    inclusion : mapping
        Term of the library to the share of an ensemble of sparse regressions that keeps it.
    path_n_terms, path_fit_percent, path_bic : array, shape (n_thresholds,)
        The optimizer's path from dense to sparse, each refined on thinned records; fit -inf, BIC inf if it diverges.
    message : str
        How the search ended.
    warnings : tuple of str
        Reasons to doubt the law or its scores, one sentence each.
    parameters : mapping
        Other numbers of the law: ``"n"`` where it was searched, ``"feedthrough"``, ``"gain"``, ``"offset"``.
    initial : {"free", "rest"}
        Whether the initial states were fitted, or the memory is zero at the first sample.
    initial_states : tuple of mapping
        State at the first sample of each record, in the letters of `equation`: ``"z0"`` or ``"y0"``.
    route : {"memory", "output"}
        What the law takes the measured output for.
    judgement : Judgement
        The errors and loops on which the verdict rests.
    cv_rmse : float
        Cross-validated rmse [unit of y], the whole search repeated for each fold; nan if it was not asked for.
    thresholds : array, shape (n_thresholds,)
        Thresholds of the optimizer's path.
    """

    route: str
    judgement: Judgement
    cv_rmse: float
    thresholds: FloatArray

    def _rows(self, *, full: bool) -> dict[str, str]:
        judged, rates = self.judgement, ", ".join(f"{rate:g}" for rate in self.judgement.rates)
        errors = (f"{name} {value:.4g}" for name, value in judged.held_out.items() if not math.isnan(value))
        rows = {
            "route": self.route,
            "held-out rmse": ", ".join(errors),
            "cross-validated rmse": "" if math.isnan(self.cv_rmse) else f"{self.cv_rmse:.4g}",
        }
        for name, widths in judged.widths.items() if full else ():
            if not all(map(math.isnan, widths)):
                percent = ", ".join(f"{100.0 * width:.2f} %" for width in widths)
                rows[f"relative width of the {name} at {rates} times the rate"] = percent
        return rows


@frozen_result
class OscillatorDiscovery(_Discovered):
    """A plant and the law of its memory, discovered from the oscillator's input and output.

    Parameters
    ----------
    model, models
        BoucWenOscillator, or TransferFunction of a lag, from the initial state of the first record; and one for each
        record. Without a memory A = 0; None and empty where hysim has no model of the law, as `warnings` says.
    coefficients, stderr, equation
        As in `Discovery`; `stderr` has the free parts of the plant and ``"n"`` too, where they were free. Of a Bouc-Wen
        law with n = 1 A is the coefficient of ``"u'"``, -beta that of ``"|u'| z"`` and -gamma that of ``"u' |z|"``.
    verdict : str
        ``"rate-independent hysteresis"``, ``"rate-dependent hysteresis"``, ``"linear lag"`` or
        ``"no structure found"``.
    scores : mapping
        ``"fit_percent"`` [%], ``"rmse"`` [unit of y] and ``"bic"`` of the free run; ``"held_out_rmse"`` [unit of y], on
        each period (or quarter) with plant and coefficients of the others; ``"linear_rmse"``,
        ``"linear_held_out_rmse"`` and ``"linear_bic"`` of the rival without memory; ``"n_terms"``; ``"n_structures"``
        compared; ``"condition"`` of the regression on all terms.
    n_parameters : int
        Number of fitted parameters of the plant and the law.
    left_out, regressed, inclusion
        As in `Discovery`; `regressed` is the Bouc-Wen law with which the search began, empty for a linear relaxation.
    path_n_terms, path_fit_percent, path_bic : array, shape (n_structures,)
        Sizes of the compared structures, their fit on held-out samples [%], and BIC: for a Pareto figure.
    message, warnings
        As in `Discovery`.
    parameters : mapping
        ``"mass"``, ``"damping"``, ``"stiffness"``, ``"n"`` where free. Without a memory stiffness is of all springs.
    initial : {"rest", "periodic"}
        Whether the records begin at rest, or in the steady motion under a periodic input.
    initial_states : tuple of mapping
        Displacement, velocity and memory at the first sample of each record: ``"y0"``, ``"y'0"`` and ``"z0"``.
    rival : TransferFunction
        The same mass on a linear spring, fitted to the records.
    path_terms : tuple of str
        The compared structures, from dense to sparse, each as its terms joined by commas.
    relative_width, dissipation : float
        Relative width and signed area [unit of y times unit of u] of the memory's steady loop over the range of the
        displacements; nan where the memory is no Bouc-Wen law.
    """

    rival: TransferFunction
    path_terms: tuple[str, ...]
    relative_width: float
    dissipation: float

    def _rows(self, *, full: bool) -> dict[str, str]:
        scores, width = self.scores, self.relative_width
        return {
            "held-out rmse": f"law {scores['held_out_rmse']:.4g}, rival {scores['linear_held_out_rmse']:.4g}",
            "relative width of the memory": "" if math.isnan(width) else f"{100.0 * width:.2f} %",
        }
