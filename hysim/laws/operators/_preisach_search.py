"""The search for the parameters of a law of relays.

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

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, check_whole, checked
from hysim.laws.operators._clamp_search import TURN, runs_clockwise, variants_of_sign
from hysim.models.composable import Composable
from hysim.models.law import Law
from hysim.models.parameters import Coordinate, space_of, spans
from hysim.models.protocols import Identifiable, Variant
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

_STARTS = 9  # former turning points from which the search begins
_RANK = 1e-9  # of a column's length: what is left of one that others make up for


@checked
class PreisachStructure(Identifiable, Composable):
    """A bank of relays to be identified; see `Preisach.structure`."""

    law: type[Law]
    levels: tuple[float, ...] = ()
    intervals: int = 4
    one_signed: bool | None = None
    against: bool = False  # whether weights of one sign turn against the loop of the record

    def __post_init__(self) -> None:
        check_whole(self.intervals, "intervals")
        levels = np.array(self.levels)
        check_relays(levels[np.newaxis], np.zeros((1, _n_weights(levels))))

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The memory as a coordinate where it is free; the rest is linear."""
        scale = spans(record)["h"]
        levels = self._levels(record)
        places = {f"levels[{k}]": value for k, value in enumerate(levels.tolist())}
        columns = (*(f"weights[{k}]" for k in range(_n_weights(levels))), "offset")
        lowest, highest = float(levels[0]), float(levels[-1])
        defaults = {**places, **dict.fromkeys(columns, 0.0), TURN: lowest}
        if searched := [name for name in places if name in (*freedom.free, *freedom.fixed)]:
            raise ValueError(f"{searched[0]!r} is not searched: give the levels to structure(levels=...)")
        signs = self._signs(record, levels.size - 1)
        resting = {TURN: lowest} if freedom.starts_at_rest("rest") and TURN not in freedom.free else {}
        turns = freedom.fixed.get(TURN, lowest if resting else np.linspace(lowest, highest, _STARTS))
        untold = self._untold(record, {**places, TURN: turns}, signs)
        chosen = freedom.held(defaults)
        held = {**places, **resting, **{name: 0.0 for name in untold if name not in freedom.free}, **chosen}
        limits = freedom.limits(defaults, held)
        turn = Coordinate(TURN, *limits.get(TURN, (lowest, highest)), scale, physical=(True, True))
        points = [
            {TURN: value} for value in np.linspace(turn.lower, turn.upper, 1 if TURN in held else _STARTS).tolist()
        ]
        bounds = {name: pair for name, pair in {**signs, **limits}.items() if name in columns and name not in held}
        return space_of([turn], columns, defaults, held, limits, points, bounds=bounds, state=(TURN,), screened=0)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """The output of each relay of weight 1, then 1 and 0."""
        levels, z0 = _table("levels", parameters)[0], _memory(parameters)
        relays = np.eye(_n_weights(levels))
        sets = {"levels": levels, "weights": np.tile(relays, (len(z0), 1)), "z0": np.repeat(z0, len(relays), axis=0)}
        outputs = self.law.responses(sets, record.u).reshape(len(z0), len(relays), -1).transpose(0, 2, 1)
        ones = np.ones((*outputs.shape[:2], 1))
        return np.concatenate([outputs, ones, np.zeros_like(ones)], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the memory after one run through the record, which erases what was before it."""
        shape = np.broadcast_shapes(*map(np.shape, parameters.values()))
        levels = _table("levels", parameters)[0]
        extremes = self._law(levels, np.zeros(_n_weights(levels))).advance(record.u)[1][1:]
        return {**parameters} | {f"z0[{k}]": np.full(shape, value)[()] for k, value in enumerate(extremes)}

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """The law with these parameters, one number for each name."""
        levels, weights = (_table(name, parameters)[0] for name in ("levels", "weights"))
        past = [value for value in _memory(parameters)[0].tolist() if value > levels[0]]
        return self._law(levels, weights, offset=parameters["offset"], z0=tuple(past))

    def notes(self, record: Record, law: Any) -> tuple[str, ...]:
        """Number of the weights that the record does not determine."""
        places = {f"levels[{k}]": value for k, value in enumerate(law.levels)}
        columns = self.regressors({**places, TURN: law.levels[0]}, record)[0, :, :-1]
        untold = columns.shape[1] - int(np.linalg.matrix_rank(columns))
        told = f"this record does not tell {untold} of the {len(law.weights)} weights from the others"
        return (told,) if untold else ()

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """All relays down, after the cycle, or after one former turning point."""
        return "rest", "periodic", "free"

    def variants(self) -> tuple[Variant, ...]:
        """Weights of one sign, of that of the record's loop or the other, or of both."""
        return variants_of_sign(self, self.one_signed)

    def _levels(self, record: Record) -> FloatArray:
        """The structure's own, or even steps over the span of the input."""
        if self.levels:
            return np.array(self.levels)
        return np.linspace(record.u.min(), record.u.max(), self.intervals + 1)

    def _untold(
        self, record: Record, parameters: Parameters, signs: Mapping[str, tuple[float, float]]
    ) -> tuple[str, ...]:
        """The weights of which others, within these signs, do the work on this record from every memory given."""
        columns = np.concatenate([*self.regressors(parameters, record)])[:, :-1]
        _, factor = np.linalg.qr(np.column_stack([columns, np.resize(record.y, len(columns))]))
        relays, goal = np.split(factor, [columns.shape[1]], axis=1)
        rows, lower = np.tril_indices(len(_table("levels", parameters)[0]) - 1)
        nearest = np.lexsort((rows, rows - lower))
        if np.linalg.matrix_rank(relays) == relays.shape[1]:
            return ()
        used = _support(relays, goal[:, 0], [signs.get(f"weights[{k}]", (-np.inf, np.inf)) for k in range(rows.size)])
        independent = _independent(relays, [rows.size, *nearest[used[nearest]], *nearest[~used[nearest]]])
        return tuple(f"weights[{k}]" for k in range(rows.size) if k not in independent)

    def _law(self, levels: FloatArray, weights: FloatArray, **others: Any) -> Any:
        law: Any = self.law
        return law(levels=tuple(levels), weights=tuple(weights), **others)

    def _signs(self, record: Record, n: int) -> dict[str, tuple[float, float]]:
        """Bounds at zero of the weights off the diagonal."""
        if self.one_signed is False:
            return {}
        side = (-np.inf, 0.0) if runs_clockwise(record) != self.against else (0.0, np.inf)
        rows, columns = np.tril_indices(n)
        return {f"weights[{k}]": side for k in np.flatnonzero(rows > columns).tolist()}


def check_relays(levels: FloatArray, weights: FloatArray) -> None:
    """Refuse tables (n_sets, n_levels) and (n_sets, n_weights) that are no relays."""
    n = max(levels.shape[1] - 1, 0)
    if levels.shape[1] == 1 or weights.shape[1] != n * (n + 1) // 2:
        raise ValueError(
            f"levels and weights must be N + 1 and N (N + 1) / 2 numbers, got {levels.shape[1]} and {weights.shape[1]}"
        )
    if not (np.diff(levels) > 0.0).all():
        raise ValueError(f"levels must increase, got {levels[0].tolist() if len(levels) == 1 else levels}")


def _n_weights(levels: FloatArray) -> int:
    return levels.size * (levels.size - 1) // 2


def _table(what: str, parameters: Parameters) -> FloatArray:
    """The numbers of a tuple over the sets, shape (n_sets, length)."""
    count = sum(name.startswith(f"{what}[") for name in parameters)
    columns = np.broadcast_arrays(*(np.ravel(parameters[f"{what}[{k}]"]) for k in range(count)))
    return np.stack(columns, axis=1)


def _memory(parameters: Parameters) -> FloatArray:
    """Inputs before the first sample, shape (n_sets, n_past)."""
    return _table("z0", parameters) if "z0[0]" in parameters else np.reshape(parameters[TURN], (-1, 1))


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
