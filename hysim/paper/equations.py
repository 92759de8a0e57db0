"""The paper's equations as it prints them, voltages in V, displacements in um, times in s.

    (1)     G(s) = (0.07962 s + 0.1521) / (s^4 + 2.201 s^3 + 7.816 s^2 + 8.423 s + 6.93)
    (7, 8)  x' = [[-1.1577, -2.6439], [1, 0]] x + [1; 0] u,  y = [0, 0.0579] x,
            which is G(s) = 0.0579 / (s^2 + 1.1577 s + 2.6439)

(1) is the model that the paper identifies on Table 1; (7) and (8) are its estimate by a second-order
model. No dwell time is printed, so (1) is judged at the dwell that suits it best.
"""

import numpy as np

from hysim._frozen import FloatArray, frozen
from hysim.datasets import table1
from hysim.metrics import rmse
from hysim.models.transfer_function import TransferFunction

EQUATION_1 = TransferFunction(num=(0.07962, 0.1521), den=(1.0, 2.201, 7.816, 8.423, 6.93))
EQUATION_7 = TransferFunction(num=(0.0579,), den=(1.0, 1.1577, 2.6439))

_DWELLS = np.geomspace(0.1, 50.0, 400)


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
    residuals = np.array([record.y - EQUATION_1.response(record.u, dwell) for dwell in _DWELLS])
    best = int(np.argmin(np.sum(residuals**2, axis=1)))
    without = np.sum(residuals**2, axis=1, keepdims=True) - residuals**2
    left_out = residuals[without.argmin(axis=0), np.arange(len(record))]
    dwell = float(_DWELLS[best])
    return PrintedModel(
        model=in_time_unit(EQUATION_1, dwell), dwell=dwell, cv_rmse=rmse(left_out, np.zeros_like(left_out))
    )


def in_time_unit(model: TransferFunction, unit: float) -> TransferFunction:
    """The same plant with time counted in `unit` seconds: G(s / unit)."""
    num, den = (
        tuple(c / unit**power for c, power in zip(side, range(len(side) - 1, -1, -1), strict=True))
        for side in (model.num, model.den)
    )
    return TransferFunction(num=num, den=den, delay=model.delay / unit, hold=model.hold, sample=model.sample)


def step_response(model: TransferFunction, duration: float = 20.0) -> tuple[FloatArray, FloatArray]:
    """Times [s] and response [um] to a step of one volt, by python-control."""
    import control

    response = control.step_response(control.tf(model.num, model.den), np.linspace(0.0, duration, 801))
    return np.asarray(response.time), np.asarray(response.outputs)
