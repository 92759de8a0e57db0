"""Laws of relays.

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
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_pieces
from hysim.kernels import preisach as kernels
from hysim.laws.operators._preisach_search import PreisachStructure, check_relays
from hysim.models.by_structure import ByStructure
from hysim.models.law import Law, Packed, State
from hysim.models.tables import Tables

_ROOM = 1000  # extremes that a compiled loop remembers
_NOTHING = np.array([[0.0, 1.0]]), np.array([[0.0]])  # levels and weights of a law without any


class RelayLaw(ByStructure, Law):
    """A bank of weighted relays; a law says whether they are spread over their intervals, and adds its fields."""

    spread: ClassVar[bool]
    units: ClassVar[Mapping[str, str]] = {"levels": "u", "weights": "y", "offset": "y", "z0": "u"}
    levels: tuple[float, ...]
    weights: tuple[float, ...]
    offset: float
    z0: tuple[float, ...]

    step = staticmethod(kernels.step)

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse levels and weights that are no relays."""
        check_relays(tables["levels"], tables["weights"])

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters and state as `hysim.kernels.preisach.step` takes them, after the inputs z0."""
        parameters = cls._rows(tables["levels"], tables["weights"], tables["offset"][:, 0])
        n_sets, n_past = len(parameters), tables["z0"].shape[1]
        if not n_past:
            lowest, low = parameters[:, kernels.HEAD : kernels.HEAD + 1], parameters[:, 1:2]
            rest = np.zeros((n_sets, _ROOM - 1))
            return Packed(parameters, np.concatenate([np.zeros((n_sets, 2)), lowest, rest, low, rest], axis=1))
        memory = np.zeros((n_sets, 2 + 2 * _ROOM))
        numbers, past = (np.asarray(table, dtype=float) for table in (parameters, tables["z0"]))
        for state, row, inputs in zip(memory, numbers, past, strict=True):
            state[2], state[2 + _ROOM] = row[kernels.HEAD], row[1]
            for u in inputs.tolist():
                kernels.step(read_only(row), state, u)
        return Packed(parameters, memory)

    @property
    def everett(self) -> FloatArray:
        """E at the pairs of levels (upper, lower), shape (n_levels, n_levels) [unit of y]; zero above the diagonal."""
        return read_only(everett_of(np.array([self.weights]))[0])

    def advance(
        self, u: npt.ArrayLike, state: State | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, State]:
        """Output and state as of `Law.advance`: the last input and the dominant extremes, the oldest first."""
        inputs = read_only(u, "u", ndim=1)
        past = self.past if state is None else state[1:]
        parameters, x, outputs, d = self._staircase(past, inputs.size)
        y = np.empty(inputs.size)
        before = float(x[d]) if state is None else state[0]

        def path(piece: slice) -> int:
            nonlocal d
            d = kernels.path(parameters, x, outputs, d, inputs[piece], y[piece])
            return -1

        in_pieces(path, y.size)
        return y, (float(inputs[-1]) if y.size else before, *x[1 : d + 1].tolist())

    def remembering(self, u0: float, memory: State) -> Any:
        """The law after these extremes."""
        return type(self)(**{**self.arguments, "z0": memory}, u0=u0)

    @property
    def past(self) -> State:
        """The inputs before the first sample."""
        return self.z0 if self.u0 is None else (*self.z0, self.u0)

    def staircase(self, u: npt.ArrayLike) -> FloatArray:
        """The line in the plane of the relays' thresholds that an input (n_samples,) leaves; those below it are up.

        The result (n_corners, 2) holds its corners (a, b) [unit of u], from the largest input on the edge b = L_0 to
        the last one on the diagonal. Raises ValueError if u is not finite or has not one axis.

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

    memory = remembered = None  # type: ignore[assignment]  # a staircase of any length, see `staircase`

    @classmethod
    def rows(cls, tables: Tables, u: FloatArray, y: FloatArray) -> None:
        parameters = cls._rows(tables["levels"], tables["weights"], tables["offset"][:, 0])
        kernels.batch(read_only(parameters), read_only(tables["z0"]), u, y)

    def as_structure(self) -> PreisachStructure:
        """The structure with the levels of this law."""
        return PreisachStructure(law=type(self), levels=self.levels)

    @classmethod
    def structure(
        cls, *, intervals: int = 4, levels: npt.ArrayLike = (), one_signed: bool | None = None
    ) -> PreisachStructure:
        """Levels for `hysim.identify`: equal `intervals` of the span of the input, or the `levels` [unit of u].

        N intervals have N (N + 1) / 2 weights; one loop between two inputs determines 2 N - 1 combinations of them.
        With `one_signed` all weights off the diagonal have the sign of the record's loop, positive for a
        counterclockwise one; else they are free, and may be of alternating signs on noisy records. By default the BIC
        decides. Raises ValueError or TypeError if the number is not a positive int, or the levels are not finite or do
        not increase.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.identify(hs.Preisach.structure(intervals=3), hs.datasets.table1()).n_parameters
        6
        """
        places = tuple(read_only(levels, "levels", ndim=1).tolist())
        return PreisachStructure(law=cls, levels=places, intervals=intervals, one_signed=one_signed)

    def _staircase(self, past: State, n_samples: int) -> tuple[FloatArray, FloatArray, FloatArray, int]:
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
        signed = (everett - everett.transpose(0, 2, 1)).reshape(len(everett), n * n)
        lowest = (offset - everett[:, -1, 0])[:, np.newaxis]
        parts = np.array([[float(cls.spread)]]), lowest, np.array([[float(n)]]), levels, signed
        return np.concatenate([np.broadcast_to(part, (n_sets, part.shape[1])) for part in parts], axis=1)


def everett_of(weights: FloatArray) -> FloatArray:
    """E at the pairs of levels, shape (n_sets, N + 1, N + 1), zero above the diagonal, for (n_sets, N (N + 1) / 2)."""
    n = (math.isqrt(1 + 8 * weights.shape[1]) - 1) // 2
    place = np.full((n + 1, n), -1)
    place[1:][np.tril_indices(n)] = np.arange(weights.shape[1])
    single = np.where(place < 0, 0.0, weights[:, place])
    summed = np.cumsum(single[:, :, ::-1], axis=2)[:, :, ::-1]
    return np.cumsum(np.concatenate([summed, np.zeros((len(weights), n + 1, 1))], axis=2), axis=1)


def weights_of(everett: FloatArray) -> FloatArray:
    """The weights (N (N + 1) / 2,) for E at the pairs of levels, shape (N + 1, N + 1), zero above the diagonal."""
    mixed = -np.diff(np.diff(np.tril(everett, -1), axis=0), axis=1)
    return np.asarray(mixed[np.tril_indices(len(mixed))])
