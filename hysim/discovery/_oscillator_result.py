"""Result of the oscillator route, and its conversion to a `Discovery`."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from hysim._frozen import FloatArray, frozen
from hysim.discovery._judgement import HYSTERESIS, NO_STRUCTURE, RATES, Judgement
from hysim.discovery._oscillator_models import OTHER, RATE_DEPENDENT, Model, State, steady_loop
from hysim.discovery._result import Discovery
from hysim.models.boucwen import BoucWen
from hysim.models.oscillator import BoucWenOscillator
from hysim.models.transfer_function import TransferFunction
from hysim.records import Record

_VERDICTS = {OTHER: HYSTERESIS, RATE_DEPENDENT: NO_STRUCTURE}


@frozen
class FoundOscillator:
    """An oscillator and the law of its memory, found from input and output.

    Parameters
    ----------
    model : BoucWenOscillator, TransferFunction or None
        The law of `equation` in its plant, from the initial state of the first record. Without structure a linear
        oscillator whose law has A = 0; with a lag a transfer function; None where hysim has no model of the law.
    models : tuple of model
        One for each record, each from its initial state; empty where there is no model.
    coefficients, stderr : mapping
        Term to coefficient and to its standard error; `stderr` also has those of the plant that were not given.
        Of a law that `model` has, A is that of ``"u'"``, -beta of ``"|u'| z"`` and -gamma of ``"u' |z|"``.
    equation : str
        The law as text.
    verdict : str
        ``"rate-independent hysteresis"``, the same with ``", not of Bouc and Wen"``, ``"rate-dependent hysteresis"``,
        ``"linear lag"`` or ``"no structure found"``.
    mass, damping, stiffness : float
        Of the plant; without structure the stiffness is that of all springs.
    initial : {"rest", "periodic"}
        Whether the records begin at rest, or in the steady motion under a periodic input.
    initial_states : tuple of State
        Displacement, velocity and memory at the first sample of each record.
    rival : TransferFunction
        The same mass on a linear spring, fitted to the records without a memory.
    regressed : mapping
        Coefficients before the refinement, from the regression along the measured motion.
    inclusion : mapping
        Term to the share of fits to resampled data that keep it, for every term of the library that is not `left_out`.
    left_out : tuple of str
        Terms whose effects on these records are linear combinations of those of the plant and of terms of lower degree.
    scores : mapping
        ``"fit_percent"`` [%], ``"rmse"`` [unit of y], ``"bic"`` of the free run; ``"held_out_rmse"`` [unit of y], on
        each period (or quarter) with plant and coefficients of the others; ``"linear_rmse"``,
        ``"linear_held_out_rmse"`` and ``"linear_bic"`` of the rival without memory; ``"condition"`` of the regression
        on all terms.
    path_terms : tuple of str
        The structures that were compared, from dense to sparse, each as its terms joined by commas.
    path_n_terms, path_bic, path_held_out_rmse : array, shape (n_structures,)
        Their sizes, BIC, and rmse on what is held out [unit of y]: for a Pareto figure.
    message : str
        How the search ended.
    warnings : tuple of str
        Reasons to doubt the law, one sentence each.
    """

    model: Model | None
    models: tuple[Model, ...]
    coefficients: Mapping[str, float]
    stderr: Mapping[str, float]
    equation: str
    verdict: str
    mass: float
    damping: float
    stiffness: float
    initial: str
    initial_states: tuple[State, ...]
    rival: TransferFunction
    regressed: Mapping[str, float]
    inclusion: Mapping[str, float]
    left_out: tuple[str, ...]
    scores: Mapping[str, float]
    path_n_terms: FloatArray
    path_bic: FloatArray
    path_held_out_rmse: FloatArray
    path_terms: tuple[str, ...]
    message: str
    warnings: tuple[str, ...]


def discovery(found: FoundOscillator, records: Sequence[Record]) -> Discovery:
    """The result as a `Discovery`, the type that all routes return."""
    spread = float(np.std(np.concatenate([record.y for record in records])))
    n_terms = float(len(found.coefficients))
    return Discovery(
        model=found.model,
        models=found.models,
        coefficients=found.coefficients,
        stderr=found.stderr,
        equation=f"{found.equation}, {_motion(found)}",
        verdict=_VERDICTS.get(found.verdict, found.verdict),
        route="oscillator",
        scores={
            **{name: found.scores[name] for name in ("fit_percent", "rmse", "bic", "condition")},
            "n_terms": n_terms,
            "threshold": math.nan,
            "n_structures": len(found.path_bic),
        },
        n_parameters=len(found.stderr),
        parameters=_parameters(found),
        initial=found.initial,
        initial_states=tuple(dict(zip(("y0", "y'0", "z0"), state, strict=True)) for state in found.initial_states),
        judgement=_judgement(found, records),
        cv_rmse=math.nan,
        left_out=found.left_out,
        regressed=found.regressed,
        inclusion=found.inclusion,
        thresholds=np.full(len(found.path_bic), math.nan),
        path_n_terms=found.path_n_terms,
        path_fit_percent=100.0 * (1.0 - found.path_held_out_rmse / spread),
        path_bic=found.path_bic,
        message=found.message,
        warnings=found.warnings,
    )


def _motion(found: FoundOscillator) -> str:
    text = f"{found.mass:.6g} y'' + {found.damping:.6g} y' + {found.stiffness:.6g} y + z = u"
    return text.replace("+ -", "- ")


def _parameters(found: FoundOscillator) -> dict[str, float]:
    """The numbers of the plant, and n where it was free."""
    plant = {"mass": found.mass, "damping": found.damping, "stiffness": found.stiffness}
    if "n" in found.stderr and isinstance(found.model, BoucWenOscillator) and isinstance(found.model.law, BoucWen):
        return {**plant, "n": found.model.law.n}
    return plant


def _judgement(found: FoundOscillator, records: Sequence[Record]) -> Judgement:
    """The judgement, whose rival is a mass on a linear spring and whose loop is memory over displacement."""
    law = found.model.law if isinstance(found.model, BoucWenOscillator) else None
    widest = max((record.y for record in records), key=lambda y: float(np.ptp(y)))
    loop = steady_loop(law, widest) if isinstance(law, BoucWen) and found.coefficients else None
    width = math.nan if loop is None else loop.relative_width
    sign = {"counterclockwise": 1.0, "clockwise": -1.0}.get("none" if loop is None else loop.orientation, 0.0)
    return Judgement(
        verdict=_VERDICTS.get(found.verdict, found.verdict),
        rival=found.rival,
        rival_offset=0.0,
        held_out={"law": found.scores["held_out_rmse"], "rival": found.scores["linear_held_out_rmse"]},
        held_out_by="block",
        rates=np.array(RATES),
        widths={"law": (width,) * len(RATES), "rival": (math.nan,) * len(RATES)},
        dissipation=math.nan if loop is None else sign * loop.area,
        one_sign=loop is not None and sign != 0.0,
        rate_spread=math.nan,
    )
