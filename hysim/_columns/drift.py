"""The drift of an output, apart from its loop.

An output that repeats itself from cycle to cycle, plus a polynomial p of time, is

    y_c(b, u) = g(b, u) + p(t_c(b, u))

where cycle c passes the input u on branch b at time t_c. The loop g cancels in the differences between the cycles, to
which p is fitted: a loop of any shape is neither tilted nor narrowed.
"""

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim._columns.turning import Cycle, settled

_NODES = 64  # inputs on each branch at which the cycles are compared


def drift(cycles: list[Cycle], u: FloatArray, y: FloatArray, times: FloatArray, order: int) -> FloatArray:
    """The polynomial at every sample, shape (n,), less its mean over the cycles."""
    centre, half = (times[0] + times[-1]) / 2, (times[-1] - times[0]) / 2
    powers = np.polynomial.legendre.legvander((times - centre) / half, order)[:, 1:]
    compared = np.column_stack([y, powers])
    rows = []
    for branches in ([cycle.loading for cycle in cycles], [cycle.unloading for cycle in cycles]):
        passages = [np.arange(u.size)[branch][settled(u[branch])] for branch in branches]
        low, high = max(u[samples[0]] for samples in passages), min(u[samples[-1]] for samples in passages)
        nodes = np.linspace(low, high, _NODES)
        values = np.array([_at(nodes, u[samples], compared[samples]) for samples in passages])
        rows.append((values - values.mean(axis=0)).reshape(-1, compared.shape[1]))
    differences = np.concatenate(rows)
    coefficients = np.linalg.lstsq(differences[:, 1:], differences[:, 0])[0]
    inside = np.unique(np.concatenate([np.arange(u.size)[cycle.path] for cycle in cycles]))
    polynomial: FloatArray = (powers - powers[inside].mean(axis=0)) @ coefficients
    return polynomial


def _at(nodes: FloatArray, u: FloatArray, columns: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(nodes, u, column) for column in columns.T])
