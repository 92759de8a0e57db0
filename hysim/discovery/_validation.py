"""What a law is worth on samples that it has not seen: its structure kept, its numbers fitted again."""

import numpy as np
import numpy.typing as npt

from hysim._frozen import read_only
from hysim.discovery._refinement import POLISH, FreeRun, law
from hysim.identification.folds import folds as blocks
from hysim.models.duhem import Duhem
from hysim.models.duhem_terms import Term
from hysim.records import Record

_WARM = 1e-7  # relative change of the cost: a left-out sample moves the optimum by little, and the rmse is an average


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


def cross_validated_rmse(model: Duhem, record: Record, folds: str | int = "loo") -> float:
    """Rmse of a Duhem law on samples that were left out of its fit [unit of y].

    The input is kept, only the residuals of the left-out samples are not seen. The structure is kept too,
    coefficients and y0 are fitted anew: this judges the law, not the search for its structure.

    Parameters
    ----------
    model : Duhem
        The law, fitted to the whole record.
    record : Record
        The record.
    folds : "loo" or int
        Leave one sample out at a time, or one of so many blocks of samples.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If `folds` is neither "loo" nor a number from 2 to n, or the law diverges on the record.

    Examples
    --------
    >>> import hysim as hs
    >>> from hysim.discovery import cross_validated_rmse
    >>> law = hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0})
    >>> u = [0.0, 1.0, 2.0, 1.0, 0.0, -1.0, 0.0]
    >>> cross_validated_rmse(law, hs.Record(u=u, y=law.response(u))) < 1e-9
    True
    """
    n = len(record)
    errors = np.empty(n)
    for block in blocks(folds, n):
        weights = np.ones(n)
        weights[block] = 0.0
        refitted = refit(model, record, weights=weights, tolerance=_WARM)
        errors[block] = (record.y - refitted.response(record.u))[block]
    return float(np.sqrt(np.mean(errors**2)))
