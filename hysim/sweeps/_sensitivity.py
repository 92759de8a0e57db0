"""Sobol indices: the shares of the variance of an output that are due to each parameter.

Two independent samples A and B of n sets, and for each parameter i the sample AB_i, which is A with the column of
parameter i from B, give from n (d + 2) tasks

    first order   S_i = Var(E(f | x_i)) / Var(f)              share of parameter i alone
    total         T_i = 1 - Var(E(f | all but x_i)) / Var(f)  share of parameter i and its interactions

by the estimators of Saltelli (2010), as `scipy.stats.sobol_indices` has them.
"""

from collections.abc import Mapping

import numpy as np

from hysim._frozen import FloatArray, frozen
from hysim._printing import printed, summary_text
from hysim.sweeps._result import Sweep

_RESAMPLES = 200


@printed
@frozen
class SobolIndices:
    """Sobol indices of the outputs of a study.

    Parameters
    ----------
    parameters : tuple of str
        Names of the d parameters.
    first_order, total_order : mapping
        Name of an output to the indices of the parameters, shape (d,).
    first_order_interval, total_order_interval : mapping
        Name of an output to the limits of the intervals at 95 %, shape (2, d), by the bootstrap.
    """

    parameters: tuple[str, ...]
    first_order: Mapping[str, FloatArray]
    total_order: Mapping[str, FloatArray]
    first_order_interval: Mapping[str, FloatArray]
    total_order_interval: Mapping[str, FloatArray]

    def __str__(self) -> str:
        size = f"{len(self.first_order)} outputs by {len(self.parameters)} parameters"
        return summary_text([f"SobolIndices: {size}", self.summary()])

    def summary(self) -> str:
        """The indices as a table."""
        width = max(len(name) for name in (*self.parameters, *self.first_order)) + 2
        lines = ["output".ljust(width) + "parameter".ljust(width + 6) + "first order   total"]
        for output, first in self.first_order.items():
            for k, name in enumerate(self.parameters):
                total = self.total_order[output][k]
                lines.append(f"{output.ljust(width)}{name.ljust(width + 6)}{first[k]:11.3f} {total:7.3f}")
        return "\n".join(lines)


def sobol_indices(result: Sweep, *, seed: int = 0) -> SobolIndices:
    """Sobol indices of every output of a study of a ``Sample(..., method="saltelli")``.

    Parameters
    ----------
    result : Sweep
        Result with every task of the sample.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    SobolIndices

    Raises
    ------
    ValueError
        If the sample is another one, a task is missing or failed, or an output is not finite or constant.

    Examples
    --------
    >>> import hysim as hs
    >>> def plane(a, b):
    ...     return {"y": 3.0 * a + 4.0 * b}
    >>> sample = hs.Sample(distributions={"a": (0.0, 1.0), "b": (0.0, 1.0)}, n=1024, method="saltelli")
    >>> indices = hs.sobol_indices(hs.sweep(plane, sample))
    >>> indices.parameters, indices.first_order["y"].round(2).tolist()
    (('a', 'b'), [0.36, 0.64])
    """
    d = len(result.parameters)
    n = result.n_tasks // (d + 2)
    _check(result, n)
    estimates, intervals = {}, {}
    rng = np.random.default_rng(seed)
    for name, values in result.outputs.items():
        if not np.isfinite(values).all() or np.ptp(values) == 0.0:
            raise ValueError(f"the output {name} must be finite and vary to have Sobol indices")
        parts = values.reshape(d + 2, n)
        estimates[name] = _estimates(parts)
        again = [_estimates(parts[:, rng.integers(n, size=n)]) for _ in range(_RESAMPLES)]
        intervals[name] = np.quantile(again, [0.025, 0.975], axis=0)
    return SobolIndices(
        parameters=tuple(result.parameters),
        first_order={name: indices[0] for name, indices in estimates.items()},
        total_order={name: indices[1] for name, indices in estimates.items()},
        first_order_interval={name: limits[:, 0] for name, limits in intervals.items()},
        total_order_interval={name: limits[:, 1] for name, limits in intervals.items()},
    )


def _check(result: Sweep, n: int) -> None:
    if len(result) < result.n_tasks or result.errors:
        raise ValueError(
            f"Sobol indices need every task: {len(result)} of {result.n_tasks} are done, {len(result.errors)} failed"
        )
    d = len(result.parameters)
    for k, values in enumerate(result.parameters.values()):
        a, b = values[:n], values[n : 2 * n]
        expected = np.concatenate([a, b, *(b if i == k else a for i in range(d))])
        if n == 0 or not np.array_equal(values, expected):
            raise ValueError('Sobol indices need the sample hs.Sample(..., method="saltelli")')


def _estimates(parts: FloatArray) -> FloatArray:
    """First order and total, shape (2, d), from the outputs of A, B and AB, shape (d + 2, n)."""
    from scipy import stats

    f_a, f_b, *f_ab = parts[:, np.newaxis]
    with_idle_one = np.array([*f_ab, f_a])  # scipy needs at least two parameters
    indices = stats.sobol_indices(func={"f_A": f_a, "f_B": f_b, "f_AB": with_idle_one}, n=parts.shape[1])
    return np.array([indices.first_order, indices.total_order])[:, :-1]
