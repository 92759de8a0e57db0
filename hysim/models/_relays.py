"""What the laws of relays share.

A relay R_ab is up (1) once the input has reached a, and down (-1) once it has reached b < a. The relays stand on
the pairs of N intervals between N + 1 levels L_0 < ... < L_N, an upper one i and a lower one j <= i, with the weights
w_ij, row by row: w_00, w_10, w_11, w_20, ... The Everett function E(a, b), the weight of all relays between b and a,
at the levels is

    E(L_m, L_n) = sum of w_ij over i < m, j >= n

All relays are down before the inputs z0, which come before the first sample. From there on the input leaves a
staircase in the plane of the pairs (a, b), relays below it up and above it down, whose corners are its dominant
extremes; see `hysim.kernels.preisach`.
"""

import math
from abc import ABC
from dataclasses import fields
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_pieces
from hysim.kernels import preisach as kernels
from hysim.models._batch import Batch, Reduction, Sets, part_of
from hysim.models.composable import Composable
from hysim.models.model import CompiledLaw
from hysim.models.search_space import Parameters

State = tuple[float, ...]
"""Last input, and the dominant extremes so far, the oldest first."""

_ROOM = 1000  # extremes that a compiled loop remembers
_NOTHING = np.array([[0.0, 1.0]]), np.array([[0.0]])  # levels and weights of a law without any


class RelayLaw(Composable, ABC):
    """A bank of weighted relays; a law says whether they are spread over their intervals, and adds its fields."""

    spread: ClassVar[bool]
    levels: tuple[float, ...]
    weights: tuple[float, ...]
    offset: float
    z0: tuple[float, ...]

    def __post_init__(self) -> None:
        check_relays(np.atleast_2d(self.levels), np.atleast_2d(self.weights))

    @property
    def everett(self) -> FloatArray:
        """E at the pairs of levels (upper, lower), shape (n_levels, n_levels) [unit of y]; zero above the diagonal."""
        return read_only(everett_of(np.array([self.weights]))[0])

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output y at the samples of an input that is monotone between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input; the first sample finds the relays as z0 left them. Beyond the levels the law is saturated.

        Returns
        -------
        array, shape (n_samples,)

        Raises
        ------
        ValueError
            If u is not finite or has not one axis.
        """
        return self.advance(u)[0]

    def advance(self, u: npt.ArrayLike, state: State | None = None) -> tuple[FloatArray, State]:
        """Output at the samples of `u`, continued from `state`, and the state after the last sample.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input, monotone between its samples and from the state's input to the first of them.
        state : tuple of float, optional
            Last input so far, and the dominant extremes, the oldest first; by default what z0 leaves.

        Returns
        -------
        y : array, shape (n_samples,)
            The same bits as from one uncut input.
        state : tuple of float
            To continue from; as long as the staircase has corners.

        Raises
        ------
        ValueError
            As `response`.
        """
        inputs = read_only(u, "u", ndim=1)
        past = self.z0 if state is None else state[1:]
        parameters, x, outputs, d = self._begun(past, inputs.size)
        y = np.empty(inputs.size)
        before = float(x[d]) if state is None else state[0]

        def path(piece: slice) -> int:
            nonlocal d
            d = kernels.path(parameters, x, outputs, d, inputs[piece], y[piece])
            return -1

        in_pieces(path, y.size)
        return y, (float(inputs[-1]) if y.size else before, *x[1 : d + 1].tolist())

    def staircase(self, u: npt.ArrayLike) -> FloatArray:
        """The line in the plane of the relays' thresholds that the input leaves: those below it are up.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input.

        Returns
        -------
        array, shape (n_corners, 2)
            Corners (a, b) [unit of u], from the largest input on the edge b = L_0 to the last one on the diagonal.

        Raises
        ------
        ValueError
            If u is not finite or has not one axis.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.Preisach(levels=(0.0, 1.0, 2.0), weights=(1.0, 0.5, 1.0))
        >>> law.staircase([0.0, 1.5, 0.25, 1.0]).tolist()
        [[1.5, 0.0], [1.5, 0.25], [1.0, 0.25], [1.0, 1.0]]
        """
        extremes = [*self.levels[:1], *self.advance(u)[1][1:]]
        corners = [(max(pair), min(pair)) for pair in zip(extremes[1:], extremes, strict=False)]
        return np.array([*corners, (extremes[-1], extremes[-1])])

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`.

        It has room for 1000 extremes. Of more, two neighbours are forgotten that change the staircase least.
        """
        state = np.zeros(2 + 2 * _ROOM)
        parameters, x, y, d = self._begun((*self.z0, u0), 0)
        kept = min(d + 1, _ROOM)
        state[0], state[1] = u0, kept - 1
        state[2 : 2 + kept], state[2 + _ROOM : 2 + _ROOM + kept] = x[:kept], y[:kept]
        return CompiledLaw(kernels.step, parameters, state)

    @classmethod
    def responses(
        cls,
        parameters: Parameters,
        u: npt.ArrayLike,
        *,
        reduce: Reduction | None = None,
        target: npt.ArrayLike | None = None,
        workers: int | None = None,
    ) -> FloatArray:
        """Outputs of many laws at once, on all cores, or one number of each.

        Parameters
        ----------
        parameters : mapping
            The constructor's names to values: the offset one number or an array over sets, shape (n_sets,); a tuple
            an array of shape (n_sets, length), or (length,) for all sets.
        u : array, shape (n_samples,) or (n_sets, n_samples)
            One input for all sets, or one for each.
        reduce : {"sse", "max_width", "area", "final"}, optional
            Keep of each output only the sum of its squared differences from `target`, the measure of this
            name of `loop_metrics` (last complete cycle), or the last sample.
        target : array, shape (n_samples,)
            With ``reduce="sse"`` what the outputs are compared with [unit of y].
        workers : int, optional
            Number of threads; by default one for each core. The result does not depend on it.

        Returns
        -------
        array, shape (n_sets, n_samples), or (n_sets,) with `reduce`
            Each row the same bits as `response`.

        Raises
        ------
        TypeError
            If a name is not one of the constructor's.
        ValueError
            If lengths do not fit, a value is not one that the constructor takes, or the input has no
            complete cycle to measure.
        """
        laws = cls._batch(parameters, u)
        return laws.rows(workers) if reduce is None else laws.reduced(reduce, target, workers)

    def _begun(self, past: State, n_samples: int) -> tuple[FloatArray, FloatArray, FloatArray, int]:
        """Parameters, extremes and outputs as kernels take them after the inputs `past`, and the last place."""
        parameters = read_only(self._rows(*(np.array([part]) for part in (self.levels, self.weights, self.offset)))[0])
        x, y = np.empty(1 + len(past) + n_samples), np.empty(1 + len(past) + n_samples)
        x[0], y[0] = parameters[kernels.HEAD], parameters[1]
        return parameters, x, y, kernels.path(parameters, x, y, 0, read_only(past), np.empty(len(past)))

    @classmethod
    def _rows(cls, levels: FloatArray, weights: FloatArray, offset: FloatArray) -> FloatArray:
        """The kernels' parameters (n_sets, n_parameters) of laws with one row each, or of the same row."""
        if not levels.size:
            levels, weights = _NOTHING
        everett = everett_of(weights)
        n_sets, n = max(len(levels), len(weights), len(offset)), levels.shape[1]
        rows = np.empty((n_sets, kernels.HEAD + n + n * n))
        rows[:, 0], rows[:, 2] = cls.spread, n
        rows[:, 1] = offset - everett[:, -1, 0]
        rows[:, kernels.HEAD : kernels.HEAD + n] = levels
        rows[:, kernels.HEAD + n :] = (everett - everett.transpose(0, 2, 1)).reshape(len(everett), n * n)
        return rows

    @classmethod
    def _batch(cls, parameters: Parameters, u: npt.ArrayLike) -> Batch:
        defaults = {field.name: field.default for field in fields(cls)}  # type: ignore[arg-type]
        if unknown := set(parameters) - set(defaults):
            raise TypeError(f"unknown parameter {sorted(unknown)[0]!r}: {cls.__name__} has {', '.join(defaults)}")
        tables = {name: _table(name, value) for name, value in {**defaults, **parameters, "u": u}.items()}
        lengths = {name: len(table) for name, table in tables.items() if len(table) != 1}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"parameters and inputs must have one length or length 1, got {lengths}")
        n_sets = next(iter(lengths.values()), 1)
        inputs = tables.pop("u")
        levels, weights, offset, z0 = (
            read_only(np.broadcast_to(tables[name], (n_sets, tables[name].shape[1])))
            for name in ("levels", "weights", "offset", "z0")
        )
        check_relays(levels, weights)

        def compute(sets: Sets, inputs: FloatArray, y: FloatArray) -> None:
            rows = cls._rows(part_of(levels, sets), part_of(weights, sets), part_of(offset, sets)[:, 0])
            kernels.batch(read_only(rows), part_of(z0, sets), inputs, y)

        return Batch(compute, n_sets, inputs)


def _table(name: str, values: npt.ArrayLike) -> FloatArray:
    """Values over sets, shape (1 or n_sets, length)."""
    array = read_only(values, name)
    if array.ndim > (1 if name == "offset" else 2):
        raise ValueError(f"{name} has too many axes: got shape {array.shape}")
    return array.reshape(-1, 1) if name == "offset" else np.atleast_2d(array)


def check_relays(levels: FloatArray, weights: FloatArray) -> None:
    """Refuse tables (n_sets, n_levels) and (n_sets, n_weights) that are no relays."""
    n = max(levels.shape[1] - 1, 0)
    if levels.shape[1] == 1 or weights.shape[1] != n * (n + 1) // 2:
        raise ValueError(
            f"levels and weights must be N + 1 and N (N + 1) / 2 numbers, got {levels.shape[1]} and {weights.shape[1]}"
        )
    if not (np.diff(levels) > 0.0).all():
        raise ValueError(f"levels must increase, got {levels[0].tolist() if len(levels) == 1 else levels}")


def everett_of(weights: FloatArray) -> FloatArray:
    """E at the pairs of levels, shape (n_sets, N + 1, N + 1), zero above the diagonal, for (n_sets, N (N + 1) / 2)."""
    n = (math.isqrt(1 + 8 * weights.shape[1]) - 1) // 2
    everett = np.zeros((len(weights), n + 1, n + 1))
    rows, columns = np.tril_indices(n)
    everett[:, rows + 1, columns] = weights
    everett[:, :, :-1] = np.cumsum(everett[:, :, -2::-1], axis=2)[:, :, ::-1]
    return np.cumsum(everett, axis=1)


def weights_of(everett: FloatArray) -> FloatArray:
    """The weights (N (N + 1) / 2,) for E at the pairs of levels, shape (N + 1, N + 1), zero above the diagonal."""
    mixed = -np.diff(np.diff(np.tril(everett, -1), axis=0), axis=1)
    return np.asarray(mixed[np.tril_indices(len(mixed))])
