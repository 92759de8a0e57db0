"""Equation (1) at the dwell that suits it best: the paper prints none."""

import numpy as np

from hysim._frozen import frozen
from hysim.datasets import table1
from hysim.metrics import rmse
from hysim.paper.equations import EQUATION_1, in_time_unit
from hysim.plants.transfer_function import TransferFunction

DWELLS = np.geomspace(0.1, 50.0, 400)
"""Dwells that are tried [s], to 2 %."""


@frozen
class PrintedModel:
    """A printed model, of which only the dwell time was chosen on the record.

    Parameters
    ----------
    model : TransferFunction
        In a time of one unit for each sample.
    dwell : float
        Time for which each voltage is held [s].
    cv_rmse : float
        Leave-one-out rmse, the dwell chosen anew each time [um].
    n_parameters : int
        One, the dwell.
    """

    model: TransferFunction
    dwell: float
    cv_rmse: float
    n_parameters: int = 1


def printed_model() -> PrintedModel:
    """Equation (1) at the dwell that fits Table 1 best: zero-order hold, output at its start, from rest.

    Its cross-validated rmse chooses the dwell anew without each sample; the dwell is searched between 0.1
    and 50 s to 2 %.
    """
    record = table1()
    residuals = np.array([record.y - EQUATION_1.response(record.u, dwell) for dwell in DWELLS])
    best = int(np.argmin(np.sum(residuals**2, axis=1)))
    without = np.sum(residuals**2, axis=1, keepdims=True) - residuals**2
    left_out = residuals[without.argmin(axis=0), np.arange(len(record))]
    dwell = float(DWELLS[best])
    return PrintedModel(
        model=in_time_unit(EQUATION_1, dwell), dwell=dwell, cv_rmse=rmse(left_out, np.zeros_like(left_out))
    )
