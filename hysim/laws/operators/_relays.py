"""Laws of relays.

A relay R_ab is up (1) once the input has reached a, and down (-1) once it has reached b < a. The relays stand on pairs
of N intervals between N + 1 levels L_0 < ... < L_N, an upper i and a lower j <= i, with weights w_ij, row by row: w_00,
w_10, w_11, w_20, ... The Everett function E(a, b), the weight of all relays between b and a, at the levels is

    E(L_m, L_n) = sum of w_ij over i < m, j >= n

All relays are down before the inputs z0, which precede the first sample. From there the input leaves a staircase in the
plane (a, b), relays below it up and above it down, with corners at its dominant extremes (`hysim.kernels.preisach`).

The search for the parameters of a law of relays.

The output is affine in the weights and the offset. The levels are given: where the user says nothing else, they
divide the span of the input evenly. One-signed weights turn the loop in one sense; those of the diagonal, which turn
none, are free. By default the record decides whether they have one sign.

With ``initial="rest"`` all relays are down before the first sample. With ``"free"`` the memory is that of a single
former turning point: all down, up to `turn`, then to the first sample. ``"periodic"`` is the memory that the cycle of
the record leaves behind. By default the record decides.

A record tells as many combinations of weights as their columns have rank: one loop between two inputs 2 N - 1 of the
N (N + 1) / 2. As many weights are free, and the others are held at zero: free are those of a best fit that has no
more weights than needed, then those that are nearest to the diagonal. Where the memory is free, a weight is held
only if no memory tells it. The user frees others by name.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_whole, checked, read_only
from hysim._basics.parallel import in_pieces
from hysim.errors import warn_beyond
from hysim.kernels import preisach as kernels
from hysim.laws.operators._bank_search import TURN, SignedStructure, named, table_of, with_offset
from hysim.laws.operators._densities import Parts, check_strength, parts_of, smooth
from hysim.models.by_structure import ByStructure
from hysim.models.law import Advanced, Law, Packed, State
from hysim.models.parameters import Coordinate, space_of, spans
from hysim.models.protocols import DirectFit
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.tables import Tables, check_increasing
from hysim.records import Record

_STARTS = 9  # former turning points from which the search begins
_INTERVALS = 4
_STIFFER = 10.0  # from one strength of the penalty to the next, as long as a law is not safe
_STIFFEST, _LEAST = 1e8, 1e-10  # strengths: beyond, a density has no shape any more, and none at all
_RANK = 1e-9  # of a column's length: what is left of one that others make up for
ROOM = 1000
"""Extremes that a compiled loop remembers."""
_FOLDS = 64  # of single samples, or of every 64th
_NOTHING = np.array([[0.0, 1.0]]), np.array([[0.0]])  # levels and weights of a law without any


@checked
class PreisachStructure(SignedStructure):
    """A bank of relays to be identified; see `Preisach.structure`."""

    levels: tuple[float, ...] = ()
    intervals: int | None = None  # four, or a smooth density where that predicts better

    def __post_init__(self) -> None:
        if self.intervals is not None:
            check_whole(self.intervals, "intervals")
        levels = np.array(self.levels)
        check_relays(levels[np.newaxis], np.zeros((1, _n_weights(levels))))

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The memory as a coordinate where it is free; the rest is linear."""
        scale, levels = spans(record)["h"], np.array(self.levels)
        if not levels.size:  # even steps over the span of the input
            levels = np.linspace(record.u.min(), record.u.max(), (self.intervals or _INTERVALS) + 1)
        places = named("levels", levels.tolist())
        columns = (*named("weights", range(_n_weights(levels))), "offset")
        lowest, highest = float(levels[0]), float(levels[-1])
        defaults = {**places, **dict.fromkeys(columns, 0.0), TURN: lowest}
        if searched := [name for name in places if name in (*freedom.free, *freedom.fixed)]:
            raise ValueError(f"{searched[0]!r} is not searched: give the levels to structure(levels=...)")
        side, (rows, lower) = self.side(record), np.tril_indices(levels.size - 1)
        signs = {f"weights[{k}]": side for k in np.flatnonzero(rows > lower).tolist() if side is not None}
        resting = {TURN: lowest} if freedom.starts_at_rest("rest") and TURN not in freedom.free else {}
        turns = freedom.fixed.get(TURN, lowest if resting else np.linspace(lowest, highest, _STARTS))
        untold = self._untold(record, {**places, TURN: turns}, signs)
        chosen = freedom.held(defaults)
        held = {**places, **resting, **{name: 0.0 for name in untold if name not in freedom.free}, **chosen}
        limits = freedom.limits(defaults, held)
        turn = Coordinate(TURN, *limits.get(TURN, (lowest, highest)), scale, physical=(True, True))
        begins = np.linspace(turn.lower, turn.upper, 1 if TURN in held else _STARTS).tolist()
        bounds = {name: pair for name, pair in {**signs, **limits}.items() if name in columns and name not in held}
        points = [{TURN: value} for value in begins]
        return space_of([turn], columns, defaults, held, limits, points, bounds=bounds, state=(TURN,), screened=0)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The output of each relay of weight 1, then 1 and 0."""
        levels, z0 = table_of("levels", parameters)[0], _memory(parameters)
        relays = np.eye(_n_weights(levels))
        sets = {"levels": levels, "weights": np.tile(relays, (len(z0), 1)), "z0": np.repeat(z0, len(relays), axis=0)}
        outputs = self.law.responses(sets, record.u).reshape(len(z0), len(relays), -1)
        return with_offset(outputs.transpose(0, 2, 1))

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the memory after one run through the record, which erases what was before it."""
        shape = np.broadcast_shapes(*map(np.shape, parameters.values()))
        levels = table_of("levels", parameters)[0]
        law: Any = self.law
        extremes = law(levels=levels, weights=np.zeros(_n_weights(levels))).advance(record.u)[1][1:]
        return {**parameters} | named("z0", (np.full(shape, value)[()] for value in extremes))

    def initial(self, parameters: Parameters) -> FloatArray:
        """Inputs before the first sample, but for those at the lowest level."""
        past = _memory(parameters)
        return past[:, past[0] > parameters["levels[0]"]]

    def notes(self, record: Record, law: Any) -> tuple[str, ...]:
        """Number of the weights that the record does not determine."""
        columns = self.regressors({**named("levels", law.levels), TURN: law.levels[0]}, record)[0, :, :-1]
        untold = columns.shape[1] - int(np.linalg.matrix_rank(columns))
        told = f"{untold} of the {len(law.weights)} weights cannot be estimated separately from this record"
        return (told,) if untold else ()

    def in_one_step(self) -> "SmoothRelays | None":
        """The smooth density, where nothing was said of levels and signs."""
        is_open = self.law.spread and self.intervals is None and self.one_signed is None and not self.levels
        return SmoothRelays(law=self.law) if is_open else None

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """All relays down, after the cycle, or after one former turning point."""
        return "rest", "periodic", "free"

    def _untold(
        self, record: Record, parameters: Parameters, signs: Mapping[str, tuple[float, float]]
    ) -> tuple[str, ...]:
        """The weights that others can replace on this record, within these signs, from every memory given."""
        columns = np.concatenate([*self.regressors(parameters, record)])[:, :-1]
        _, factor = np.linalg.qr(np.column_stack([columns, np.resize(record.y, len(columns))]))
        relays, goal = np.split(factor, [columns.shape[1]], axis=1)
        rows, lower = np.tril_indices(len(table_of("levels", parameters)[0]) - 1)
        nearest = np.lexsort((rows, rows - lower))
        if np.linalg.matrix_rank(relays) == relays.shape[1]:
            return ()
        used = _support(relays, goal[:, 0], [signs.get(f"weights[{k}]", (-np.inf, np.inf)) for k in range(rows.size)])
        independent = _independent(relays, [rows.size, *nearest[used[nearest]], *nearest[~used[nearest]]])
        return tuple(f"weights[{k}]" for k in range(rows.size) if k not in independent)


@checked
class SmoothRelays:
    """Spread relays with a smooth density, which are fitted in one step; see `Preisach.structure`."""

    law: Any
    smoothness: float | None = None
    is_given: bool = False

    def fitted(self, records: Sequence[Record], weights: FloatArray | None = None) -> DirectFit:
        """The law of the given smoothness, or of that which predicts left-out parts best."""
        fit, strength = smooth(self.law, records, strength=self.smoothness, weights=weights)
        if self.is_given or strength > _STIFFEST:
            return fit
        return fit._replace(smoother_family=replace(self, smoothness=_STIFFER * max(strength, _LEAST)))

    def parts(self, records: Sequence[Record]) -> list[Parts]:
        """Samples by which such a law is compared with others.

        Of one loop, whose quarters are not predicted from each other without assumptions, these are all samples.
        """
        kinds, n = parts_of(records), sum(len(record) for record in records)
        return kinds if len(kinds) > 1 else [[np.arange(k, n, _FOLDS) for k in range(min(n, _FOLDS))]]


def check_relays(levels: FloatArray, weights: FloatArray) -> None:
    """Refuse tables (n_sets, n_levels) and (n_sets, n_weights) that are no relays."""
    n = max(levels.shape[1] - 1, 0)
    if levels.shape[1] == 1 or weights.shape[1] != n * (n + 1) // 2:
        raise ValueError(
            f"levels and weights must be N + 1 and N (N + 1) / 2 numbers, got {levels.shape[1]} and {weights.shape[1]}"
        )
    check_increasing("levels", levels)


def _n_weights(levels: FloatArray) -> int:
    return levels.size * (levels.size - 1) // 2


def _memory(parameters: Parameters) -> FloatArray:
    """Inputs before the first sample, shape (n_sets, n_past)."""
    return table_of("z0", parameters) if "z0[0]" in parameters else np.reshape(parameters[TURN], (-1, 1))


def _support(columns: FloatArray, goal: FloatArray, bounds: list[tuple[float, float]]) -> npt.NDArray[np.bool_]:
    """Which of the bounded coefficients a best fit with few of them uses; the last column has no bounds."""
    from scipy.optimize import nnls

    sides = [(k, sign) for k, (low, high) in enumerate(bounds) for sign, end in ((1.0, high), (-1.0, low)) if end]
    sides += [(len(bounds), 1.0), (len(bounds), -1.0)]
    places, signs = np.array([k for k, _ in sides]), np.array([sign for _, sign in sides])
    size = np.linalg.norm(columns, axis=0)[places]
    unit = np.linalg.norm(goal) or 1.0  # the tolerance of the solver is an absolute one
    solution, _ = nnls(signs * columns[:, places] / np.where(size > 0.0, size, 1.0), goal / unit)
    return np.isin(np.arange(len(bounds)), places[solution > 0.0])


def _independent(columns: FloatArray, order: list[int]) -> set[int]:
    """The columns that are no combination of those before them in the order."""
    basis = np.empty((len(columns), 0))
    independent: set[int] = set()
    for k in order:
        rest = columns[:, k] - basis @ (basis.T @ columns[:, k])
        rest -= basis @ (basis.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > _RANK * float(np.linalg.norm(columns[:, k])):
            basis, independent = np.column_stack([basis, rest / size]), independent | {int(k)}
    return independent


@dataclass(frozen=True, kw_only=True, eq=False)
class RelayLaw(ByStructure, Law):
    """A bank of weighted relays; a law says whether they are spread over their intervals."""

    spread: ClassVar[bool]
    units: ClassVar[Mapping[str, str]] = {"levels": "u", "weights": "y", "offset": "y", "z0": "u"}
    levels: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()
    offset: float = 0.0
    z0: tuple[float, ...] = ()

    step = staticmethod(kernels.step)

    @classmethod
    def check(cls, tables: Tables) -> None:
        check_relays(tables["levels"], tables["weights"])

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters and state as `hysim.kernels.preisach.step` takes them, after the inputs z0."""
        parameters = cls._rows(tables)
        lowest, low = parameters[:, kernels.HEAD : kernels.HEAD + 1], parameters[:, 1:2]
        rest = np.zeros((len(parameters), ROOM - 1))
        memory = np.concatenate([rest[:, :2], lowest, rest, low, rest], axis=1)
        if tables["z0"].shape[1]:
            memory = np.asarray(memory, dtype=float)
            for state, row, past in zip(memory, read_only(parameters), tables["z0"], strict=True):
                for u in past:
                    kernels.step(row, state, float(u))
        return Packed(parameters, memory)

    @property
    def everett(self) -> FloatArray:
        """E at the pairs of levels (upper, lower), shape (n_levels, n_levels) [unit of y]; zero above the diagonal."""
        return read_only(everett_of(np.array([self.weights]))[0])

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output (n_samples,) as of `Law.response`; a `hysim.HysimWarning` where the input leaves `u_range`.

        Relays that the record did not switch have no weights to go by: beyond the levels the output stands still.
        """
        y = super().response(u)
        warn_beyond(self.u_range, np.asarray(u, dtype=float), type(self).__name__, stacklevel=3)
        return y

    def advance(self, u: npt.ArrayLike, state: State | None = None, *, sample_time: float | None = None) -> Advanced:
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
        kernels.batch(read_only(cls._rows(tables)), read_only(tables["z0"]), u, y)

    def as_structure(self) -> PreisachStructure:
        """The structure with the levels of this law."""
        return PreisachStructure(law=type(self), levels=self.levels)

    @classmethod
    def structure(
        cls,
        *,
        intervals: int | None = None,
        levels: npt.ArrayLike = (),
        one_signed: bool | None = None,
        smoothness: float | str | None = None,
    ) -> "PreisachStructure | SmoothRelays":
        """Levels for `hysim.identify`: equal `intervals` of the span of the input, or the `levels` [unit of u].

        Where none of these options is given, four intervals are compared with a smooth density, and what predicts
        left-out parts better is returned: the density if its error is less than nine tenths of the grid's. With
        `smoothness` it is the density, of that penalty or, for ``"auto"``, the best (`Preisach.smoothed`).

        N intervals have N (N + 1) / 2 weights; one loop between two inputs determines 2 N - 1 combinations of them.
        With `one_signed` all weights off the diagonal have the sign of the record's loop, positive for a
        counterclockwise one; else they are free, and may be of alternating signs on noisy records. By default the BIC
        decides. Raises ValueError or TypeError for a number that is not a positive int, or levels that do not increase.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.identify(hs.Preisach.structure(intervals=3), hs.datasets.table1()).n_parameters
        6
        """
        places = tuple(read_only(levels, "levels", ndim=1).tolist())
        if smoothness is not None:
            if not cls.spread or intervals is not None or places or one_signed is not None:
                raise ValueError("a smooth density has levels and signs of its own: give smoothness alone, to Preisach")
            if smoothness == "auto":
                return SmoothRelays(law=cls)
            return SmoothRelays(law=cls, smoothness=check_strength(smoothness), is_given=True)
        return PreisachStructure(law=cls, levels=places, intervals=intervals, one_signed=one_signed)

    def _staircase(self, past: State, n_samples: int) -> tuple[FloatArray, FloatArray, FloatArray, int]:
        """Parameters, extremes and outputs as kernels take them after the inputs `past`, and the last place."""
        parameters = read_only(self._rows(self.tables)[0])
        x, y = np.empty(1 + len(past) + n_samples), np.empty(1 + len(past) + n_samples)
        x[0], y[0] = parameters[kernels.HEAD], parameters[1]
        return parameters, x, y, kernels.path(parameters, x, y, 0, read_only(past), np.empty(len(past)))

    @classmethod
    def _rows(cls, tables: Tables) -> FloatArray:
        """The kernels' parameters (n_sets, n_parameters)."""
        levels, weights = (tables["levels"], tables["weights"]) if tables["levels"].size else _NOTHING
        offset, everett, n = tables["offset"], everett_of(weights), levels.shape[1]
        signed = (everett - everett.transpose(0, 2, 1)).reshape(len(everett), n * n)
        parts = np.array([[float(cls.spread)]]), offset - everett[:, -1, :1], np.array([[float(n)]]), levels, signed
        return np.concatenate([np.broadcast_to(part, (len(offset), part.shape[1])) for part in parts], axis=1)


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
