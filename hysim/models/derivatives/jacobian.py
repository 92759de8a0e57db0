"""Derivatives of a law's response by its numbers, along its own step.

The step in forward mode (`hysim.models.derivatives.forward`) carries for each number the rate of the memory beside the
memory: this is the variational equation along the exact step. At a kink, where a play is just being pushed or a
relay just switches, the derivative is one-sided.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, frozen, read_only
from hysim.errors import SimulationError
from hysim.models.derivatives import modules
from hysim.models.derivatives.packing import PackedRates, packed_rates

FEW = 4_000  # samples times numbers up to which Python runs the step: a second, which a compilation takes too


@frozen
class Jacobian:
    """Derivatives of a response by the numbers of a law.

    Attributes
    ----------
    names : tuple of str
        The numbers, by their names in ``law.scalars``.
    matrix : array, shape (n_samples, n_names)
        dy/d(number) [unit of y / unit of the number].
    response : array, shape (n_samples,)
        The output itself [unit of y].
    """

    names: tuple[str, ...]
    matrix: FloatArray
    response: FloatArray

    def __getitem__(self, name: str) -> FloatArray:
        """The derivative by one number, shape (n_samples,); KeyError if it is not among `names`."""
        if name not in self.names:
            raise KeyError(f"no derivative by {name!r}: there are those by {', '.join(self.names)}")
        return self.matrix[:, self.names.index(name)]

    def information(self, sigma: float = 1.0) -> FloatArray:
        """Fisher information of the numbers for white noise of standard deviation `sigma`, (n_names, n_names)."""
        return np.asarray(self.matrix.T @ self.matrix / sigma**2)

    def summary(self) -> str:
        """A line for each number: the root mean square and the largest size of its derivative.

        Examples
        --------
        >>> import hysim as hs
        >>> u = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=20)
        >>> print(hs.Dahl(stiffness=2.0, coulomb=0.5).response_jacobian(u).summary())
        derivative of the response, 21 samples
        stiffness  rms 0.0674  largest 0.179
        coulomb    rms 0.797   largest 0.997
        offset     rms 1       largest 1
        z0         rms 0.244   largest 1
        """
        width = max(map(len, self.names), default=0)
        lines = [f"derivative of the response, {len(self.matrix)} samples"]
        for name, column in zip(self.names, self.matrix.T, strict=True):
            rms, largest = float(np.sqrt(np.mean(column**2))), float(np.abs(column).max())
            lines.append(f"{name:<{width}}  rms {rms:<6.3g}  largest {largest:.3g}".rstrip())
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.summary()


def response_jacobian(law: Any, u: Any, names: Iterable[str] | None = None) -> Jacobian:
    """See `hysim.Law.response_jacobian`."""
    samples = read_only(u, "u", ndim=1)
    first = 0 if law.u0 is None else 1  # rows of the input at which the memory holds
    inputs = samples if law.u0 is None else read_only(np.append(law.u0, samples))
    if isinstance(names, str):
        raise TypeError(f"names must be a sequence of names, got the string {names!r}")
    asked, rates = _differentiable(law) if names is None else _chosen(law, tuple(names))
    if not asked or not samples.size:
        return Jacobian(names=asked, matrix=np.zeros((samples.size, len(asked))), response=law.response(samples))
    build = modules.interpreted if inputs.size * len(asked) <= FEW else modules.compiled
    columns, y = [], np.empty(0)
    for name, of_parameters, of_memory in zip(asked, rates.parameter_rates, rates.memory_rates, strict=True):
        step, start, workspace = _stepping(law, name)
        state, moved = (np.concatenate([front, np.zeros(workspace)]) for front in (rates.memory, of_memory))
        parameters, slopes = (read_only(each, finite=False) for each in (rates.parameters, of_parameters))
        y, column, lost = modules.rates_along(build(step, start), parameters, slopes, state, moved, inputs)
        if lost >= 0:
            raise SimulationError(law.divergence(lost - first, inputs[lost], y[lost]))
        columns.append(column)
    return Jacobian(names=asked, matrix=np.column_stack(columns)[first:], response=y[first:])


def _stepping(law: Any, name: str) -> tuple[Any, Any, int]:
    """Step, start and workspace: the leanest ones, but for a number that decides which step is lean."""
    if name in law.structural:
        return law.step, law.start, law.workspace
    step, start, workspace = law.stepping
    return step, start, workspace


def _chosen(law: Any, names: tuple[str, ...]) -> tuple[tuple[str, ...], PackedRates]:
    if unknown := [name for name in names if name not in law.scalars]:
        raise ValueError(f"names has {unknown[0]!r}: a {type(law).__name__} has {', '.join(law.scalars)}")
    return names, packed_rates(law, names)


def _differentiable(law: Any) -> tuple[tuple[str, ...], PackedRates]:
    """Every number by which the parameters of the step have a derivative."""
    names = []
    for name in law.scalars:
        try:
            packed_rates(law, (name,))
        except ValueError:
            continue
        names.append(name)
    return tuple(names), packed_rates(law, names)
