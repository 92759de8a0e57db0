"""What a law is worth on samples that it has not seen: its structure kept, its numbers fitted again."""

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.discovery._refinement import POLISH, FreeRun, law
from hysim.models.duhem_terms import Term
from hysim.models.duhem import Duhem
from hysim.records import Record

_WARM = 1e-7  # relative change of the cost: a left-out sample moves the optimum by little, and all are averaged


def refit(model: Duhem, record: Record, *, weights: npt.ArrayLike | None = None, tolerance: float = POLISH) -> Duhem:
    """Fit the coefficients and y0 of a Duhem law to a record by simulation error; its structure is kept.

    Parameters
    ----------
    model : Duhem
        The structure, and the values to start from.
    record : Record
        What to fit.
    weights : array, shape (n_samples,), optional
        Weight of each squared residual; 0 leaves a sample out. The input is kept all the same.
    tolerance : float
        Relative change of the sum of squares at which the descent ends.

    Returns
    -------
    Duhem

    Raises
    ------
    ValueError
        If the weights are negative or not one for each sample, or the law diverges on the record.

    Examples
    --------
    >>> import hysim as hs
    >>> from hysim.discovery import refit
    >>> u = [0.0, 1.0, 2.0, 1.0, 0.0, -1.0, 0.0]
    >>> rec = hs.Record(u=u, y=hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0}).response(u))
    >>> refit(hs.Duhem.from_terms({"u'": 0.9, "|u'| y": -0.8}), rec).equation
    "y' = u' (1) + |u'| (-1 y)"
    """
    shares = read_only(np.ones(len(record)) if weights is None else weights, "weights", ndim=1)
    if shares.size != len(record) or shares.min() < 0.0:
        raise ValueError(f"weights must be {len(record)} numbers from 0 up, got {shares.size} from {shares.min()}")
    coefficients = model.terms
    start = np.array([[*coefficients.values(), model.y0]])
    found = FreeRun(record, shares).refine(tuple(map(Term.parse, coefficients)), start, tolerance=tolerance)
    if found is None:
        raise ValueError("the law diverges on this record: start from other coefficients")
    return law(found)


def leave_one_out(model: Duhem, record: Record) -> float:
    """Rmse of a Duhem law on samples left out of its fit, one at a time [unit of y].

    The input is kept; only the residual of the sample is left out. The structure is kept, coefficients and
    y0 are fitted anew, so that this judges the law, not the search for its structure.

    Parameters
    ----------
    model : Duhem
        The law, fitted to the whole record.
    record : Record
        The record.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the law diverges on the record.

    Examples
    --------
    >>> import hysim as hs
    >>> from hysim.discovery import leave_one_out
    >>> law = hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0})
    >>> u = [0.0, 1.0, 2.0, 1.0, 0.0, -1.0, 0.0]
    >>> leave_one_out(law, hs.Record(u=u, y=law.response(u))) < 1e-9
    True
    """
    return float(np.sqrt(np.mean(_left_out_errors(model, record) ** 2)))


def _left_out_errors(model: Duhem, record: Record) -> FloatArray:
    errors = np.empty(len(record))
    for k in range(len(record)):
        weights = np.ones(len(record))
        weights[k] = 0.0
        errors[k] = record.y[k] - refit(model, record, weights=weights, tolerance=_WARM).response(record.u)[k]
    return errors
