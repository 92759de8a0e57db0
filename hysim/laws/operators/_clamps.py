"""Laws of plays and stops.

    z_i(k) = min(max(z_i(k-1), u_k - r_i), u_k + r_i)
    y      = offset + feedthrough u + sum_i w_i z_i              plays
    y      = offset + feedthrough u + sum_i w_i (u - z_i)        stops

The positions z_i are the memory; z0 is where they stand before the first sample, which pushes them like any other. A
stop is a play of the negative weight beside a line, so that with c = feedthrough + sum w_i for stops every law is

    y = offset + c u + sum_i v_i z_i,    v_i = w_i or -w_i
"""

from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, items, read_only
from hysim.kernels import clamps as kernels
from hysim.laws.differential.limit_cycle import LimitCycle
from hysim.models.law import Law, Packed
from hysim.models.protocols import CompiledLaw
from hysim.models.tables import Tables


class Bank(Law):
    """Plays or stops; a law says what its thresholds and weights are called, and adds its fields."""

    thresholds_name: ClassVar[str] = "thresholds"
    weights_name: ClassVar[str] = "weights"
    stops: ClassVar[bool] = False
    bank: ClassVar[bool] = True  # whether thresholds, weights and z0 are tuples
    ordered: ClassVar[bool] = False  # whether the thresholds must increase
    offset: float
    z0: Any

    def __post_init__(self) -> None:
        if self.bank and len(self.z0) == 1:
            object.__setattr__(self, "z0", self.z0 * len(items(self)[self.thresholds_name]))
        super().__post_init__()

    @classmethod
    def completed(cls, tables: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """The tables with one initial position for each play, where one is given for all."""
        if tables["z0"].shape[1] == 1:
            tables["z0"] = np.tile(tables["z0"], tables[cls.thresholds_name].shape[1])
        return tables

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse elements that are no plays or stops of this law."""
        super().check(tables)
        check_elements(cls, *(tables[name] for name in (cls.thresholds_name, cls.weights_name, "z0")))

    @property
    def elements(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Thresholds, weights and initial positions, shape (n_plays,) each."""
        names = self.thresholds_name, self.weights_name, "z0"
        thresholds, weights, z0 = (read_only(self.tables[name][0], name) for name in names)
        return thresholds, weights, z0


class ClampLaw(Bank):
    """A sum of plays or stops beside a line."""

    step = staticmethod(kernels.step)
    feedthrough = 0.0

    @property
    def as_plays(self) -> tuple[float, FloatArray, FloatArray]:
        """Slope c beside the plays, and their thresholds and weights v in the order of the thresholds."""
        thresholds, weights, _ = self.elements
        order = np.argsort(thresholds, kind="stable")
        feedthrough = self.feedthrough
        if self.stops:
            return feedthrough + float(weights.sum()), thresholds[order], -weights[order]
        return feedthrough, thresholds[order], weights[order]

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters (stops, offset, feedthrough, thresholds, weights) and memory (u, positions)."""
        offset = tables["offset"]
        head = [np.full_like(offset, cls.stops), offset, tables.get("feedthrough", np.zeros_like(offset))]
        elements = [tables[name] for name in (cls.thresholds_name, cls.weights_name)]
        return Packed(np.concatenate([*head, *elements], axis=1), cls.initial_memory(tables))

    @classmethod
    def path(cls, law: CompiledLaw, u: FloatArray, y: FloatArray) -> int:
        output, elements = np.split(law.parameters, [kernels.N_OUTPUT])
        thresholds, weights = np.split(elements, 2)
        kernels.path(thresholds, weights, output, law.state[1:], np.empty(weights.size), u, y)
        law.state[0] = u[-1]
        return -1

    @classmethod
    def rows(cls, tables: Tables, u: FloatArray, y: FloatArray) -> None:
        output = cls.pack(tables).parameters[:, : kernels.N_OUTPUT]
        thresholds, weights = (read_only(tables[name]) for name in (cls.thresholds_name, cls.weights_name))
        kernels.batch(thresholds, weights, read_only(output), read_only(tables["z0"]), u, y)

    def tangent(self, direction: npt.ArrayLike, z: npt.ArrayLike, u: npt.ArrayLike) -> FloatArray:
        """Slope dy/du [unit of y / unit of u] at the positions `z`, for an input at `u` that moves in `direction`.

        The direction is the velocity u' or its sign, ValueError if zero; u is broadcast against it. z has the shape
        (..., n_plays) of `memory`, without the last axis for a single play or stop.
        """
        velocity, inputs = (np.asarray(values, dtype=float)[..., np.newaxis] for values in (direction, u))
        if not np.all(velocity):
            raise ValueError("direction must not be zero: an input that stands still has two slopes")
        thresholds, weights, _ = self.elements
        memory = np.asarray(z, dtype=float) if self.bank else np.asarray(z, dtype=float)[..., np.newaxis]
        pushed = np.where(velocity > 0.0, inputs - thresholds >= memory, inputs + thresholds <= memory)
        moving = ~pushed if self.stops else pushed
        return np.asarray(self.feedthrough + np.sum(weights * moving, axis=-1))

    @property
    def known_slopes(self) -> tuple[float, float]:
        """Those of `slope_bounds`."""
        return self.slope_bounds()

    def slope_bounds(self) -> tuple[float, float]:
        """Lowest and highest slope dy/du over every input.

        After a reversal the plays are pushed one after the other in the order of their thresholds: the slopes are c, c
        + v_0, c + v_0 + v_1, ..., the first of them only where no threshold is zero.
        """
        slope, thresholds, weights = self.as_plays
        slopes = slope + np.concatenate([[0.0], np.cumsum(weights)])
        reached = slopes[np.count_nonzero(thresholds == 0.0) :]
        return float(reached.min()), float(reached.max())

    def limit_cycle(self, amplitude: float) -> LimitCycle:
        """Steady loop of y - offset between the inputs -X and X, the `amplitude` [unit of u].

        ::

            peak      = c X + sum v (X - r)         mid_width = 2 |sum v min(r, X - r)|
            energy    = -4 sum v r (X - r)          over the plays with r < X

        The energy is positive for a loop that runs clockwise. Raises ValueError if the amplitude is not positive and
        finite.

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
    """Positions (n_sets, n_plays) at the end of the input `u`, from those before its first sample."""
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


def _first_zero(u: FloatArray, y: FloatArray) -> float:
    """First zero of a polyline through points of falling `u`, whose ends are opposite."""
    k = int(np.argmax(np.sign(y[:-1]) * np.sign(y[1:]) <= 0.0))
    return float(u[k] - y[k] * (u[k + 1] - u[k]) / (y[k + 1] - y[k])) if y[k] else float(u[k])
