"""What the laws of plays and stops share.

    z_i(k) = min(max(z_i(k-1), u_k - r_i), u_k + r_i)
    y      = offset + feedthrough u + sum_i w_i z_i              plays
    y      = offset + feedthrough u + sum_i w_i (u - z_i)        stops

The positions z_i are the memory. z0 is where they stand before the first sample, which pushes them like any
other; the default, zero, is a memory at rest at u = 0. With c = feedthrough + sum w_i for stops, a stop is a
play of the negative weight beside c u, so that every law is

    y = offset + c u + sum_i v_i z_i,    v_i = w_i or -w_i
"""

from abc import ABC
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_pieces
from hysim.kernels import clamps as kernels
from hysim.models._batch import Batch, Reduction, Sets, part_of
from hysim.models.composable import Composable
from hysim.models.limit_cycle import LimitCycle
from hysim.models.model import CompiledLaw
from hysim.models.search_space import Parameters

State = tuple[float, ...]
"""Last input, and the positions of the plays."""


class Bank(Composable, ABC):
    """Plays or stops; a law says what its thresholds and weights are called, and adds its fields."""

    thresholds_name: ClassVar[str]
    weights_name: ClassVar[str]
    stops: ClassVar[bool]
    bank: ClassVar[bool]  # whether thresholds, weights and z0 are tuples
    ordered: ClassVar[bool] = False  # whether the thresholds must increase
    offset: float
    z0: Any

    def __post_init__(self) -> None:
        if self.bank and len(self.z0) == 1:
            object.__setattr__(self, "z0", self.z0 * len(getattr(self, self.thresholds_name)))
        check_elements(type(self), *(np.atleast_2d(part) for part in self.elements))

    @property
    def elements(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Thresholds, weights and initial positions, shape (n_plays,) each."""
        names = self.thresholds_name, self.weights_name, "z0"
        thresholds, weights, z0 = (read_only(np.atleast_1d(getattr(self, name)), name) for name in names)
        return thresholds, weights, z0


class ClampLaw(Bank):
    """A sum of plays or stops, and what else can be told of it."""

    @property
    def as_plays(self) -> tuple[float, FloatArray, FloatArray]:
        """Slope c beside the plays, and their thresholds and weights v in the order of the thresholds."""
        thresholds, weights, _ = self.elements
        order = np.argsort(thresholds, kind="stable")
        feedthrough = float(getattr(self, "feedthrough", 0.0))
        if self.stops:
            return feedthrough + float(weights.sum()), thresholds[order], -weights[order]
        return feedthrough, thresholds[order], weights[order]

    def memory(self, u: npt.ArrayLike) -> FloatArray:
        """Positions of the plays at the samples of an input that is monotone between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input; the first sample finds the plays at z0, and pushes them.

        Returns
        -------
        array, shape (n_samples, n_plays)
            [unit of u]; (n_samples,) for a single play or stop.

        Raises
        ------
        ValueError
            If u is not finite or has not one axis.
        """
        inputs = read_only(u, "u", ndim=1)
        thresholds, _, z0 = self.elements
        z = np.empty((inputs.size, thresholds.size))
        moving = z0.copy()

        def path(piece: slice) -> int:
            kernels.positions(thresholds, moving, inputs[piece], z[piece])
            return -1

        in_pieces(path, inputs.size)
        return z if self.bank else z[:, 0]

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output y at the samples of an input that is monotone between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input; the first sample finds the plays at z0, and pushes them.

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
            Input and positions at the last sample so far; by default ``(u[0], *z0)``.

        Returns
        -------
        y : array, shape (n_samples,)
            The same bits as from one uncut input.
        state : tuple of float
            To continue from.

        Raises
        ------
        ValueError
            As `response`, or if the state does not hold one position for each play.
        """
        inputs = read_only(u, "u", ndim=1)
        thresholds, weights, z0 = self.elements
        start = (float(inputs[0]) if inputs.size else 0.0, *z0.tolist()) if state is None else state
        z = np.array(start[1:], dtype=float)
        if z.size != thresholds.size:
            raise ValueError(f"the state must hold {1 + thresholds.size} numbers, got {len(start)}")
        y = np.empty(inputs.size)
        output, terms = self._output(), np.empty(z.size)

        def path(piece: slice) -> int:
            kernels.path(thresholds, weights, output, z, terms, inputs[piece], y[piece])
            return -1

        in_pieces(path, y.size)
        return y, (float(inputs[-1]), *z.tolist()) if y.size else start

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`."""
        thresholds, weights, z0 = self.elements
        z = np.minimum(np.maximum(z0, u0 - thresholds), u0 + thresholds)
        parameters = read_only(np.concatenate([self._output(), thresholds, weights]))
        return CompiledLaw(kernels.step, parameters, np.concatenate([[u0], z]))

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
            The constructor's names to values. A number may be an array over sets, shape (n_sets,), and a
            tuple an array of shape (n_sets, n_plays), or (n_plays,) for all sets.
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

    def tangent(self, direction: npt.ArrayLike, z: npt.ArrayLike, u: npt.ArrayLike) -> FloatArray:
        """Slope dy/du at the positions `z`, for an input at `u` that moves in `direction`.

        Parameters
        ----------
        direction : array
            Velocity u' or its sign, not zero.
        z : array, shape (..., n_plays)
            Positions as `memory` gives them; without the last axis for a single play or stop.
        u : array
            Input, broadcast against the direction.

        Returns
        -------
        array
            [unit of y / unit of u], of the shape of the direction and the input.

        Raises
        ------
        ValueError
            If a direction is zero: the slope ahead and the one behind differ.
        """
        velocity, inputs = (np.asarray(values, dtype=float)[..., np.newaxis] for values in (direction, u))
        if not np.all(velocity):
            raise ValueError("direction must not be zero: an input that stands still has two slopes")
        thresholds, weights, _ = self.elements
        memory = np.asarray(z, dtype=float) if self.bank else np.asarray(z, dtype=float)[..., np.newaxis]
        pushed = np.where(velocity > 0.0, inputs - thresholds >= memory, inputs + thresholds <= memory)
        moving = ~pushed if self.stops else pushed
        return np.asarray(getattr(self, "feedthrough", 0.0) + np.sum(weights * moving, axis=-1))

    def slope_bounds(self) -> tuple[float, float]:
        """Lowest and highest slope dy/du over every input.

        After a reversal the plays are pushed one after the other in the order of their thresholds, so that
        the slopes are c, c + v_0, c + v_0 + v_1, ...; of these, the first is never seen where a threshold is
        zero.
        """
        slope, thresholds, weights = self.as_plays
        slopes = slope + np.concatenate([[0.0], np.cumsum(weights)])
        seen = slopes[np.count_nonzero(thresholds == 0.0) :]
        return float(seen.min()), float(seen.max())

    def limit_cycle(self, amplitude: float) -> LimitCycle:
        """Steady loop between the inputs -amplitude and amplitude, about the offset.

        A play of threshold r < X goes to and fro between -(X - r) and X - r. So with the amplitude X ::

            peak      = c X + sum v (X - r)         mid_width = 2 |sum v min(r, X - r)|
            energy    = -4 sum v r (X - r)          over the plays with r < X

        Parameters
        ----------
        amplitude : float
            [unit of u].

        Returns
        -------
        LimitCycle
            Of y - offset; the energy is positive for a loop that runs clockwise.

        Raises
        ------
        ValueError
            If the amplitude is not positive and finite.

        Examples
        --------
        >>> import hysim as hs
        >>> loop = hs.Play(threshold=0.25, gain=2.0).limit_cycle(1.0)
        >>> loop.peak, loop.mid_width, loop.energy, loop.coercive
        (1.5, 1.0, -1.5, -0.25)
        """
        X = float(amplitude)
        if not 0.0 < X < np.inf:
            raise ValueError(f"amplitude must be positive and finite, got {amplitude}")
        slope, thresholds, weights = self.as_plays
        reached = thresholds < X
        r, v = thresholds[reached], weights[reached]
        corners = np.concatenate([[X], X - 2.0 * r, [-X]])
        falling = slope * corners + np.minimum(X - r, corners[:, np.newaxis] + r) @ v
        return LimitCycle(
            amplitude=X,
            peak=float(slope * X + v @ (X - r)),
            coercive=_first_zero(corners, falling),
            mid_width=float(abs(2.0 * (v @ np.minimum(r, X - r)))),
            energy=float(4.0 * (v @ (r * (r - X)))),
        )

    def _output(self) -> FloatArray:
        return read_only([float(self.stops), self.offset, getattr(self, "feedthrough", 0.0)])

    @classmethod
    def _batch(cls, parameters: Parameters, u: npt.ArrayLike) -> Batch:
        tables, inputs = sets_of(cls, parameters, u)
        thresholds, weights, z0 = (read_only(tables[name]) for name in (cls.thresholds_name, cls.weights_name, "z0"))
        n_sets = len(z0)
        output = np.zeros((n_sets, kernels.N_OUTPUT))
        output[:, 0] = cls.stops
        for column, name in ((1, "offset"), (2, "feedthrough")):
            output[:, column] = tables[name][:, 0] if name in tables else 0.0
        return _batch(thresholds, weights, read_only(output), z0, inputs)


def sets_of(cls: type[Bank], parameters: Parameters, u: npt.ArrayLike) -> tuple[dict[str, FloatArray], FloatArray]:
    """Every argument of the constructor over sets, shape (n_sets, its length), and the inputs (1 or n_sets, n_samples).

    Raises
    ------
    TypeError, ValueError
        As `ClampLaw.responses`.
    """
    defaults = {field.name: field.default for field in fields(cls)}  # type: ignore[arg-type]
    if unknown := set(parameters) - set(defaults):
        raise TypeError(f"unknown parameter {sorted(unknown)[0]!r}: {cls.__name__} has {', '.join(defaults)}")
    inputs = np.atleast_2d(read_only(u, "u"))
    if inputs.ndim != 2:
        raise ValueError(f"u must have 1 axis or 2, got shape {inputs.shape}")
    given = {**defaults, **parameters}
    tables = {name: _table(name, given[name], isinstance(default, tuple)) for name, default in defaults.items()}
    lengths = {name: len(table) for name, table in {**tables, "u": inputs}.items() if len(table) != 1}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"parameters and inputs must have one length or length 1, got {lengths}")
    if tables["z0"].shape[1] == 1:
        tables["z0"] = np.tile(tables["z0"], tables[cls.thresholds_name].shape[1])
    check_elements(cls, tables[cls.thresholds_name], tables[cls.weights_name], tables["z0"])
    n_sets = next(iter(lengths.values()), 1)
    return {name: np.broadcast_to(table, (n_sets, table.shape[1])) for name, table in tables.items()}, inputs


def _table(name: str, values: npt.ArrayLike, is_row: bool) -> FloatArray:
    """Values over sets, shape (1 or n_sets, 1 or the length of a row)."""
    array = read_only(values, name)
    if array.ndim > (2 if is_row else 1):
        raise ValueError(f"{name} has too many axes: got shape {array.shape}")
    return np.atleast_2d(array) if is_row else array.reshape(-1, 1)


def check_elements(cls: type[Bank], thresholds: FloatArray, weights: FloatArray, z0: FloatArray) -> None:
    """Refuse tables (n_sets, n_plays) that are no elements of a law of the class `cls`."""
    name = cls.thresholds_name
    if not thresholds.shape[1] == weights.shape[1] == z0.shape[1]:
        raise ValueError(
            f"{name}, {cls.weights_name} and z0 must be equally long, got {thresholds.shape[1]}, "
            f"{weights.shape[1]} and {z0.shape[1]}"
        )
    if (thresholds < 0.0).any():
        raise ValueError(f"{name} must not be negative, got {thresholds.min():g}")
    if cls.ordered and not (np.diff(thresholds) > 0.0).all():
        raise ValueError(f"{name} must increase, got {thresholds[0].tolist() if len(thresholds) == 1 else thresholds}")


def end_positions(thresholds: FloatArray, z0: FloatArray, u: FloatArray) -> FloatArray:
    """Positions (n_sets, n_plays) at the end of the input `u`, from those before its first sample.

    A play that has been carried along forgets where it stood. Else it has been pushed by the largest and by
    the smallest input, in either order, to the same place.
    """
    z = z0.copy()
    for value in _turning_values(u):
        z = np.minimum(np.maximum(z, value - thresholds), value + thresholds)
    return z


def positions(thresholds: FloatArray, z0: FloatArray, u: FloatArray) -> FloatArray:
    """Positions (n_sets, n_samples, n_plays) for thresholds and initial positions (n_sets, n_plays)."""
    z = np.empty((len(z0), u.size, z0.shape[1]))
    constant, moving = read_only(thresholds), z0.copy()
    for i in range(len(z0)):
        kernels.positions(constant[i], moving[i], u, z[i])
    return z


def _turning_values(u: FloatArray) -> FloatArray:
    """First and last input, and those between at which it turns: no other moves a play to a new place."""
    steps = np.diff(u)
    moves = np.flatnonzero(steps)
    turns = moves[1:][np.sign(steps[moves[1:]]) != np.sign(steps[moves[:-1]])]
    return np.concatenate([u[:1], u[turns], u[-1:]])


def _batch(thresholds: FloatArray, weights: FloatArray, output: FloatArray, z0: FloatArray, u: FloatArray) -> Batch:
    def compute(sets: Sets, inputs: FloatArray, y: FloatArray) -> None:
        r, w, o, z = (part_of(table, sets) for table in (thresholds, weights, output, z0))
        kernels.batch(r, w, o, z, inputs, y)

    return Batch(compute, len(z0), u)


def _first_zero(u: FloatArray, y: FloatArray) -> float:
    """Where a polyline through points of falling `u`, whose ends are opposite, crosses zero first."""
    k = int(np.argmax(np.sign(y[:-1]) * np.sign(y[1:]) <= 0.0))
    return float(u[k] - y[k] * (u[k + 1] - u[k]) / (y[k + 1] - y[k])) if y[k] else float(u[k])
