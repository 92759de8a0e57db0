"""A transfer function behind a hold, stepped from sample to sample.

    y_k      = C x_k + D v_(k-1-d)                      just before the sample
    x_(k+1)  = A x_k + B_old v_(k-1-d) + B_new v_(k-d)

v_k is the input held from sample k on, d the number of whole samples in the dead time. The states are those
of the controllability form, x_j = s^j / den(s) v, in a time unit that makes den's coefficients at most one.
"""

from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray, read_only
from hysim.models._linear_response import scaled_companion, transitions
from hysim.models.transfer_function import TransferFunction


class SampledStage(NamedTuple):
    """The matrices of one stage at one sample time; `rest` is its state under a constant input of one."""

    A: FloatArray
    B_old: FloatArray
    B_new: FloatArray
    C: FloatArray
    D: float
    lag: int
    rest: FloatArray


_NOTHING = read_only(np.zeros(0))
THROUGH = SampledStage(read_only(np.zeros((0, 0))), _NOTHING, _NOTHING, _NOTHING, 1.0, 0, _NOTHING)
"""No stage at all: y_k = v_(k-1)."""


def sampled(plant: TransferFunction, sample_time: float) -> SampledStage:
    """The exact discrete form of a plant whose input is held.

    Parameters
    ----------
    plant : TransferFunction
        Its initial state is not looked at.
    sample_time : float
        [s]

    Returns
    -------
    SampledStage
        `rest` is infinite or nan for a plant with a pole at zero.
    """
    n = plant.order
    numerator = np.concatenate([np.zeros(n + 1 - len(plant.num)), plant.num]) / plant.den[0]
    monic = np.array(plant.den[1:]) / plant.den[0]
    F, rate, scaled = scaled_companion(monic[np.newaxis], sample_time)
    lag, part = divmod(plant.delay / sample_time, 1.0)
    spans = rate * sample_time * np.array([part, 1.0 - part])
    (early, late), from_begin, from_end = (stack[0] for stack in transitions(F, spans))
    held = from_begin + from_end
    back = rate[0] ** -np.arange(1.0, n + 1)
    with np.errstate(divide="ignore"):
        rest = np.concatenate([1.0 / scaled[0, -1:], np.zeros(max(n - 1, 0))])[:n]
    return SampledStage(
        A=read_only(late @ early),
        B_old=read_only(late @ held[0]),
        B_new=read_only(held[1]),
        C=read_only(((numerator[1:] - numerator[0] * monic) * back)[::-1]),
        D=float(numerator[0]),
        lag=int(lag),
        rest=rest,
    )
