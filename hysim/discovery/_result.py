"""What `discover` returns."""

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Any, Self

from hysim._frozen import FloatArray, frozen
from hysim._words import printed, words, wrapped
from hysim.discovery._judgement import Judgement
from hysim.identification import json_forms
from hysim.models.duhem_terms import latex


@printed
@frozen
class Discovery:
    """A law that was found in records.

    Parameters
    ----------
    model : BoucWen, Duhem, BoucWenOscillator, TransferFunction or None
        The law of `equation`, refined by simulation error, from the initial state of the first record. None where hysim
        has no model of this law; `warnings` says why.
    models : tuple of model
        One for each record: they differ in the state at the first sample. Empty where there is no model.
    coefficients : mapping
        Term to coefficient, for instance ``"|u'| z"``. With a feedthrough the scale of the memory is open, and a
        Bouc-Wen law has that in which ``"u'"`` has the coefficient 1.
    stderr : mapping
        Standard errors of the coefficients, and of ``"feedthrough"``, ``"gain"``, ``"offset"`` or ``"n"`` where they
        are part of the law; nan where the records cannot tell.
    equation : str
        The law as text.
    verdict : str
        ``"rate-independent hysteresis"``, ``"linear lag"``, ``"cannot be told from one rate"`` or
        ``"no structure found"``; see `discover`.
    route : {"memory", "output", "oscillator"}
        What the law takes the measured output for.
    scores : mapping
        Of the law's free run, as in `hysim.metrics`: ``"fit_percent"`` [%], ``"rmse"`` [unit of y], ``"bic"``, and
        ``"n_terms"``; of the search: ``"threshold"``, the largest one whose structure still has all terms of the law,
        ``"n_structures"`` refined, ``"condition"`` of the regression.
    n_parameters : int
        Fitted numbers: those of the law, and the initial state of each record where it is free. A state of rest, which
        is zero, is none.
    judgement : Judgement
        What the verdict rests on: the linear rival, errors of all models on data that they were not fitted to, loop
        widths at other rates, the dissipation.
    cv_rmse : float
        Cross-validated rmse [unit of y], the whole search repeated for each fold; nan if it was not asked for, and for
        an oscillator.
    left_out : tuple of str
        Terms of the library that the records cannot tell from those of lower degree.
    regressed : mapping
        The coefficients before their refinement, from the regression of slopes; empty for a scanned exponent.
    inclusion : mapping
        Term of the library to the share of an ensemble of sparse regressions that keeps it.
    thresholds, path_n_terms, path_fit_percent, path_bic : array, shape (n_thresholds,)
        The optimizer's path from dense to sparse, each structure refined: for a Pareto figure. A structure whose free
        run diverges has a fit of -inf and a BIC of inf. Long records are thinned for the path.
    message : str
        How the search ended; empty where there is nothing to add.
    warnings : tuple of str
        Reasons to doubt the law or its scores, one plain sentence each; empty where there are none.
    parameters : mapping
        Numbers of the law that are no coefficients: ``"n"`` where it was searched, ``"feedthrough"``, ``"gain"``,
        ``"offset"``; of an oscillator ``"mass"``, ``"damping"`` and ``"stiffness"``.
    initial : {"free", "rest", "periodic"}
        Where the initial states come from. ``"free"``: they were fitted. ``"rest"``: the
        memory is held at zero at the first sample, an oscillator at rest. ``"periodic"``, of an oscillator: the records
        begin in the steady motion under a periodic input. Only free ones count as parameters.
    initial_states : tuple of mapping
        The state at the first sample of each record, in the letters of `equation`: ``"z0"`` or ``"y0"``; of an
        oscillator ``"y0"``, ``"y'0"`` and ``"z0"``.
    """

    model: Any | None
    models: tuple[Any, ...]
    coefficients: Mapping[str, float]
    stderr: Mapping[str, float]
    equation: str
    verdict: str
    route: str
    scores: Mapping[str, float]
    n_parameters: int
    judgement: Judgement
    cv_rmse: float
    left_out: tuple[str, ...]
    regressed: Mapping[str, float]
    inclusion: Mapping[str, float]
    thresholds: FloatArray
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

    def __str__(self) -> str:
        scores = self.scores
        numbers = [f"{name} {value:.4g}{self._spread(name)}" for name, value in self._numbers.items()]
        return words(
            [
                f"Discovery: {self.verdict}, fit {scores['fit_percent']:.2f} %, rmse {scores['rmse']:.4g}, "
                f"{self.n_parameters} parameters",
                f"  {self.equation}",
                wrapped(numbers),
            ],
            {
                "initial state": self._initial_state("{:.4g}"),
                "route": self.route,
                "held-out rmse": ", ".join(f"{name} {value:.4g}" for name, value in self.judgement.held_out.items()),
                "cross-validated": "" if math.isnan(self.cv_rmse) else f"rmse {self.cv_rmse:.4g}",
                "warnings": " ".join(self.warnings),
                "search": self.message,
            },
        )

    def summary(self) -> str:
        """The result in a few lines."""
        scores, judged = self.scores, self.judgement
        lines = [
            f"{self.equation}",
            f"  {self.verdict}; route {self.route}, fit {scores['fit_percent']:.2f} %, rmse {scores['rmse']:.4g}, "
            f"BIC {scores['bic']:.1f}, {self.n_parameters} parameters{self._counted}",
        ]
        lines += [f"  {name} = {value:.6g}{self._spread(name)}" for name, value in self._numbers.items()]
        lines += [f"  initial state ({self.initial}): {self._initial_state('{:.6g}')}"] * bool(self.initial_states)
        errors = [f"{name} {value:.4g}" for name, value in judged.held_out.items()]
        lines.append(f"  held-out rmse: {', '.join(errors)}")
        lines += [
            f"  relative width of the {name} at {', '.join(f'{rate:g}' for rate in judged.rates)} times the rate: "
            + ", ".join(f"{100.0 * width:.2f} %" for width in widths)
            for name, widths in judged.widths.items()
        ]
        if not math.isnan(self.cv_rmse):
            lines.append(f"  cross-validated rmse {self.cv_rmse:.4g}")
        lines += [f"  {self.message}"] * bool(self.message)
        lines += ["Warnings"] * bool(self.warnings) + [f"  {warning}" for warning in self.warnings]
        return "\n".join(lines)

    @property
    def _numbers(self) -> dict[str, float]:
        return {**self.coefficients, **self.parameters}

    @property
    def _counted(self) -> str:
        """How many of the parameters are initial states."""
        if self.initial != "free" or not self.initial_states:
            return ""
        n = sum(map(len, self.initial_states))
        return f", {n} of them {'an initial state' if n == 1 else 'initial states'}"

    def _initial_state(self, form: str) -> str:
        """The initial states in words, those of several records one after the other."""
        states = self.initial_states
        if all(state == states[0] for state in states):
            states = states[:1]
        return "; ".join(
            ", ".join(f"{name} = {form.format(value)}" for name, value in state.items()) for state in states
        )

    def _spread(self, name: str) -> str:
        value = self.stderr.get(name, math.nan)
        return "" if math.isnan(value) else f" +- {value:.2g}"

    def to_json(self) -> str:
        """The whole result as JSON, with the version of hysim; `from_json` gives it back, every number to the bit."""
        return json_forms.to_text("discovery", self)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """A result that `to_json` wrote.

        Raises
        ------
        ValueError
            If the text does not hold one.
        """
        found: Self = json_forms.from_text("discovery", text, (cls, Judgement))
        return found
