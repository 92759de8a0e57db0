"""An oscillator with a discovered memory as a `Discovery`."""

import math
from collections.abc import Sequence

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray
from hysim.discovery._judgement import HYSTERESIS, LAG, NO_STRUCTURE, RATES, Judgement
from hysim.discovery._oscillator import OTHER, RATE_DEPENDENT, FoundOscillator
from hysim.discovery._result import Discovery
from hysim.models.boucwen import BoucWen
from hysim.models.transfer_function import TransferFunction
from hysim.records import Record

_VERDICTS = {OTHER: HYSTERESIS, RATE_DEPENDENT: NO_STRUCTURE}


def discovery(found: FoundOscillator, records: Sequence[Record]) -> Discovery:
    """The same result in the words of the other routes."""
    spread = float(np.std(np.concatenate([record.y for record in records])))
    n_terms = float(len(found.coefficients))
    return Discovery(
        model=found.model,
        models=(found.model,) * len(records),
        coefficients=found.coefficients,
        stderr=found.stderr,
        equation=f"{found.equation}, {found.mass:.6g} y'' + {found.damping:.6g} y' + {found.stiffness:.6g} y + z = u",
        verdict=_VERDICTS.get(found.verdict, found.verdict),
        route="oscillator",
        scores={
            **{name: found.scores[name] for name in ("fit_percent", "rmse", "bic", "condition")},
            "n_terms": n_terms,
            "threshold": math.nan,
            "n_structures": len(found.path_bic),
        },
        n_parameters=len(found.stderr),
        judgement=_judgement(found, records),
        cv_rmse=math.nan,
        left_out=found.left_out,
        regressed=found.regressed,
        inclusion=found.inclusion,
        thresholds=np.full(len(found.path_bic), math.nan),
        path_n_terms=found.path_n_terms,
        path_fit_percent=100.0 * (1.0 - found.path_held_out_rmse / spread),
        path_bic=found.path_bic,
        message=found.message
        if found.verdict != RATE_DEPENDENT
        else f"the memory depends on the rate; {found.message}",
    )


def _judgement(found: FoundOscillator, records: Sequence[Record]) -> Judgement:
    """The rival is a mass on a linear spring; the loop is that of the memory, driven by the displacement."""
    law = found.model.law
    widest = max((record.y for record in records), key=lambda y: float(np.ptp(y)))
    loop = _loop(law, widest) if isinstance(law, BoucWen) and found.coefficients else None
    width = math.nan if loop is None else loop.relative_width
    sign = {"counterclockwise": 1.0, "clockwise": -1.0}.get("none" if loop is None else loop.orientation, 0.0)
    springs = found.stiffness + found.coefficients.get("u'", 0.0)
    return Judgement(
        verdict=_VERDICTS.get(found.verdict, found.verdict),
        rival=TransferFunction(num=(1.0,), den=(found.mass, found.damping, springs), hold="foh"),
        rival_offset=0.0,
        held_out={"law": found.scores["held_out_rmse"], "rival": found.scores["linear_rmse"]},
        held_out_by="block",
        rates=np.array(RATES),
        widths={"law": (math.nan if found.verdict == LAG else width,) * len(RATES), "rival": (math.nan,) * len(RATES)},
        dissipation=math.nan if loop is None else sign * loop.area,
        one_sign=loop is not None and sign != 0.0,
        rate_spread=math.nan,
    )


def _loop(law: BoucWen, y: FloatArray) -> metrics.LoopMetrics:
    """The steady loop of the memory over the range of the displacement."""
    path = np.linspace(0.0, 1.0, 65)
    one = np.concatenate([path, path[-2::-1]])
    u = y.min() + np.ptp(y) * np.concatenate([one, *[one[1:]] * 9])
    return metrics.loop_metrics(u, law.gain * law.memory(u))
