"""The error of discovered laws on samples that the search for them has not seen."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hysim._parallel import Progress
from hysim.discovery._refinement import DIVERGED, Candidate, FreeRun, Samples
from hysim.identification.folds import folds
from hysim.records import Record

Search = Callable[[tuple[Samples, ...]], Candidate[Any]]
"""The law that is found in the outputs seen, (n_samples,) for each record."""


def left_out_rmse(records: Sequence[Record], search: Search, count: str | int, progress: Progress) -> float:
    """Rmse on samples that were left out of the search [unit of y]; inf where a law diverges.

    Each fold repeats the whole search, for structure and numbers. The inputs are kept, only the outputs of the
    left-out samples are not seen. `progress` counts the folds.
    """
    free_run, edges = FreeRun(tuple(records)), np.cumsum([len(record) for record in records])
    left_out = folds(count, free_run.n_samples)
    errors = np.empty(free_run.n_samples)
    for done, samples in enumerate(left_out, 1):
        seen = np.ones(free_run.n_samples, dtype=bool)
        seen[samples] = False
        law = search(tuple(np.split(seen, edges[:-1])))
        errors[samples] = free_run.residuals(law.structure, law.unknowns[np.newaxis])[0, samples]
        progress(done, len(left_out))
    if np.abs(errors).max() >= DIVERGED:
        return float("inf")
    return float(np.sqrt(np.mean(errors**2))) * free_run.stroke
