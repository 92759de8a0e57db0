"""Banks of plays and stops: what their families share.

    z_i(k) = min(max(z_i(k-1), u_k - r_i), u_k + r_i)
    y      = offset + feedthrough u + sum_i w_i z_i              plays
    y      = offset + feedthrough u + sum_i w_i (u - z_i)        stops

The positions z_i are the memory; z0 is where they stand before the first sample, which pushes them like any other. A
stop is a play of the negative weight beside a line, so with c = feedthrough + sum w_i for stops every law is

    y = offset + c u + sum_i v_i z_i,    v_i = w_i or -w_i
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_positive_and_finite, items, own_items, read_only
from hysim.kernels import clamps as kernels
from hysim.laws.differential.limit_cycle import LimitCycle
from hysim.laws.operators._bank_search import Axis, BankStructure, check_elements
from hysim.models.by_structure import ByStructure
from hysim.models.law import Law, Packed, moving
from hysim.models.protocols import CompiledLaw
from hysim.models.search_space import Parameters
from hysim.models.tables import Tables, check_signs, table_of_one
from hysim.records import Record


class Elements:
    """One play or stop, or several; a family says what its thresholds and weights are called."""

    thresholds_name: ClassVar[str] = "threshold"
    weights_name: ClassVar[str] = "gain"
    stops: ClassVar[bool] = False

    @property
    def elements(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Thresholds, weights and initial positions, shape (n_plays,) each."""
        own, names = items(self), (self.thresholds_name, self.weights_name, "z0")
        thresholds, weights, z0 = (read_only(np.atleast_1d(own[name]), name) for name in names)
        return thresholds, weights, z0


class Bank(Elements, ByStructure):
    """Several plays or stops, whose fields are tuples.

    A family with another output than `Clamps` has `outputs_of_one`.
    """

    thresholds_name: ClassVar[str] = "thresholds"
    weights_name: ClassVar[str] = "weights"
    ordered: ClassVar[bool] = True  # whether the thresholds must increase
    by_input: ClassVar[bool] = True  # whether the input itself pushes
    is_curved: ClassVar[bool] = False  # whether an element's output is a curve of its position
    axes: ClassVar[tuple[Axis, ...]] = ()  # fields that are searched beside the thresholds
    positive: ClassVar[tuple[str, ...]] = ()
    not_negative: ClassVar[tuple[str, ...]] = ()
    z0: tuple[float, ...]

    def __post_init__(self) -> None:
        tables = self.completed({name: table_of_one(value) for name, value in own_items(self).items()})
        object.__setattr__(self, "z0", tuple(tables["z0"][0].tolist()))
        self.check(tables)

    @classmethod
    def completed(cls, tables: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """The tables with one initial position for each play, where one is given for all."""
        if tables["z0"].shape[1] == 1:
            tables["z0"] = np.tile(tables["z0"], tables[cls.thresholds_name].shape[1])
        return tables

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse elements that are no plays or stops of this law."""
        check_signs(tables, cls.positive, cls.not_negative)
        check_elements(cls, *(tables[name] for name in (cls.thresholds_name, cls.weights_name, "z0")))

    @classmethod
    def outputs_of_one(cls, z: FloatArray, parameters: Parameters, record: Record) -> FloatArray:
        """Outputs of plays or stops of the weight one at positions `z`, (n_sets, n_samples, n_plays)."""
        return record.u[:, np.newaxis] - z if cls.stops else z

    @classmethod
    def derived(cls, parameters: Parameters, record: Record) -> dict[str, FloatArray]:
        """Parameters of the law in place of coordinates of the search, by name, (n_sets,) each."""
        return {}

    @classmethod
    def structure(
        cls, *, plays: int = 10, thresholds: npt.ArrayLike = (), one_signed: bool | None = None
    ) -> BankStructure:
        """Plays for `hysim.identify`: how many, or where.

        Parameters
        ----------
        plays : int
            Their number, with thresholds from zero in even steps over half the span of the input.
        thresholds : sequence of float, optional
            The thresholds themselves [unit of u].
        one_signed : bool, optional
            Whether all weights past the threshold zero have the sign of the record's loop (positive for a
            counterclockwise one). Else they are free, and may be of alternating signs on noisy records. By default
            the one with the lower BIC on the record.

        Returns
        -------
        BankStructure

        Raises
        ------
        ValueError, TypeError
            If the number is not a positive int, or a threshold is not a finite number.

        Examples
        --------
        >>> import hysim as hs
        >>> fit = hs.identify(hs.PrandtlIshlinskii.structure(plays=4), hs.datasets.table1())
        >>> fit.n_parameters, round(fit.fit_percent, 1)
        (5, 94.6)
        """
        places = tuple(read_only(thresholds, cls.thresholds_name, ndim=1).tolist())
        return BankStructure(law=cls, thresholds=places, plays=plays, one_signed=one_signed, axes=cls.axes)

    def is_one_signed(self) -> bool:
        """Whether all weights past the threshold zero have one sign."""
        thresholds, weights, _ = self.elements
        lagging = weights[thresholds > 0.0]
        return bool((lagging >= 0.0).all() or (lagging <= 0.0).all())

    def as_structure(self) -> BankStructure:
        """The structure with the thresholds of this law, or with the default thresholds."""
        thresholds, own = tuple(self.elements[0].tolist()), items(self)
        one_signed = None if self.is_one_signed() else False
        axes = {each.parameter.name: own[each.parameter.name] for each in self.axes}
        return replace(self.structure(), thresholds=thresholds, one_signed=one_signed, own=axes)


@dataclass(frozen=True, kw_only=True, eq=False)
class Plays(Bank):
    """Several plays, whose thresholds and weights stand in front of the other fields of their family."""

    thresholds: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()


class Clamps(Elements, Law):
    """A sum of plays or stops and a line."""

    step = staticmethod(kernels.step)
    feedthrough = 0.0

    @property
    def as_plays(self) -> tuple[float, FloatArray, FloatArray]:
        """Slope c of the line, and thresholds and weights v of the plays in the order of the thresholds."""
        thresholds, weights, _ = self.elements
        order = np.argsort(thresholds, kind="stable")
        if self.stops:
            return self.feedthrough + float(weights.sum()), thresholds[order], -weights[order]
        return self.feedthrough, thresholds[order], weights[order]

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters (stops, offset, feedthrough, thresholds, weights) and memory (u, positions)."""
        offset = tables["offset"]
        head = [np.full_like(offset, cls.stops), offset, tables.get("feedthrough", np.zeros_like(offset))]
        elements = [tables[name] for name in (cls.thresholds_name, cls.weights_name)]
        return Packed(np.concatenate([*head, *elements], axis=1), cls.initial_memory(tables))

    @classmethod
    def path(cls, law: CompiledLaw, u: FloatArray, y: FloatArray) -> int:
        kernels.batch(law.parameters[np.newaxis], law.state[np.newaxis], u[np.newaxis], y[np.newaxis])
        law.state[0] = u[-1]
        return -1

    @classmethod
    def rows(cls, tables: Tables, u: FloatArray, y: FloatArray) -> None:
        parameters, memory = cls.pack(tables)
        kernels.batch(read_only(parameters), memory, u, y)

    def tangent(self, direction: npt.ArrayLike, z: npt.ArrayLike, u: npt.ArrayLike) -> FloatArray:
        """Slope dy/du [unit of y / unit of u] at the positions `z`, for an input at `u` that moves in `direction`.

        The direction is the velocity u' or its sign, ValueError if zero; u is broadcast against it. z has the shape
        (..., n_plays) of `memory`, without the last axis for a single play or stop.
        """
        velocity, inputs = moving(direction)[..., np.newaxis], np.asarray(u, dtype=float)[..., np.newaxis]
        thresholds, weights, _ = self.elements
        memory = np.asarray(z, dtype=float)
        memory = memory if isinstance(self, Bank) else memory[..., np.newaxis]
        pushed = np.where(velocity > 0.0, inputs - thresholds >= memory, inputs + thresholds <= memory)
        return np.asarray(self.feedthrough + np.sum(weights * (~pushed if self.stops else pushed), axis=-1))

    @property
    def known_slopes(self) -> tuple[float, float]:
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

        Energy is positive for a clockwise loop. ValueError if the amplitude is not positive and finite.

        Examples
        --------
        >>> import hysim as hs
        >>> loop = hs.Play(threshold=0.25, gain=2.0).limit_cycle(1.0)
        >>> loop.peak, loop.mid_width, loop.energy, loop.coercive
        (1.5, 1.0, -1.5, -0.25)
        """
        X = float(amplitude)
        check_positive_and_finite(amplitude=X)
        slope, thresholds, weights = self.as_plays
        reached = thresholds < X
        r, v = thresholds[reached], weights[reached]
        corners = np.concatenate([[X], X - 2.0 * r, [-X]])
        falling = slope * corners + np.minimum(X - r, corners[:, np.newaxis] + r) @ v
        k = int(np.argmax(np.sign(falling[:-1]) * np.sign(falling[1:]) <= 0.0))
        beyond = falling[k] * (corners[k + 1] - corners[k]) / (falling[k + 1] - falling[k]) if falling[k] else 0.0
        return LimitCycle(
            amplitude=X,
            peak=float(slope * X + v @ (X - r)),
            coercive=float(corners[k] - beyond),
            mid_width=float(abs(2.0 * (v @ np.minimum(r, X - r)))),
            energy=float(4.0 * (v @ (r * (r - X)))),
        )
