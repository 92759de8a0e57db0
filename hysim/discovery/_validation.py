"""What a law is worth on samples that it has not seen: its structure kept, its numbers fitted again."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hysim.discovery._refinement import Candidate, FreeRun
from hysim.identification.folds import folds
from hysim.records import Record

_WARM = 1e-7  # relative change of the cost: a left-out sample moves the optimum by little, and the rmse is an average


def left_out_rmse(records: Sequence[Record], candidate: Candidate[Any], count: str | int) -> float:
    """Rmse on samples that were left out of the fit [unit of y]; inf where the law diverges.

    The inputs are kept, only the residuals of the left-out samples are not seen. This judges the law, not the search
    for its structure.
    """
    structure, edges = candidate.structure, np.cumsum([len(record) for record in records])
    whole = FreeRun(tuple(records))
    errors = np.empty(whole.n_samples)
    for left_out in folds(count, whole.n_samples):
        weights = np.ones(whole.n_samples)
        weights[left_out] = 0.0
        seen = FreeRun(tuple(records), tuple(np.split(weights, edges[:-1])))
        refined = seen.refine(structure, candidate.unknowns[np.newaxis], tolerance=_WARM)
        if refined is None:
            return float("inf")
        errors[left_out] = whole.residuals(structure, refined.unknowns[np.newaxis])[0, left_out]
    return float(np.sqrt(np.mean(errors**2))) * whole.stroke
