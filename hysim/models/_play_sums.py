"""What the extended Prandtl-Ishlinskii laws share: the rows of numbers that `hysim.kernels.play_sums` takes."""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_pieces
from hysim.errors import SimulationError
from hysim.kernels import play_sums as kernels
from hysim.kernels.custom import drive_sets
from hysim.kernels.stepping import drive
from hysim.models._batch import Batch, Reduction, Sets, part_of
from hysim.models._clamps import Bank, State, sets_of
from hysim.models.model import CompiledLaw
from hysim.models.prandtl_ishlinskii import PrandtlIshlinskii
from hysim.models.search_space import ALL_FREE, Freedom, Identifiable, Parameters, SearchSpace
from hysim.records import Record

IDENTITY = (0.0, 0.0, 0.0, 0.0, 1.0)
"""The envelope gamma(u) = u."""


class PlaySteps(NamedTuple):
    """A sum of plays as it is stepped: the kernel's parameters, and the positions before the first sample."""

    parameters: FloatArray
    z0: FloatArray

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output at the samples of `u`, shape (n_samples,)."""
        return self.advance(u)[0]

    def advance(self, u: npt.ArrayLike, state: State | None = None) -> tuple[FloatArray, State]:
        """Output continued from `state`, (last u, positions), and the state after the last sample."""
        inputs = read_only(u, "u", ndim=1)
        start = (float(inputs[0]) if inputs.size else 0.0, *self.z0.tolist()) if state is None else state
        moving = self._moving(start)
        y = np.empty(inputs.size)
        in_pieces(lambda k: drive(kernels.step, self.parameters, moving, inputs[k], y[k]), y.size)
        return y, tuple(moving.tolist()) if y.size else start

    def widened(self, u: npt.ArrayLike, widening: FloatArray) -> FloatArray:
        """Output at the samples of `u` of plays whose thresholds are wider by `widening`, shape (n_samples,)."""
        inputs = read_only(u, "u", ndim=1)
        y = np.empty(inputs.size)
        kernels.widened(self.parameters, self._moving((0.0, *self.z0.tolist())), inputs, read_only(widening), y)
        return y

    def memory(self, u: npt.ArrayLike) -> FloatArray:
        """Positions at the samples of `u`, shape (n_samples, n_plays)."""
        inputs = read_only(u, "u", ndim=1)
        z = np.empty((inputs.size, self.z0.size))
        if z.size:
            kernels.positions(self.parameters, self._moving((inputs[0], *self.z0.tolist())), inputs, z)
        return z

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`."""
        return CompiledLaw(kernels.step, self.parameters, np.array(self.advance([u0])[1]))

    def inverse_response(self, y: npt.ArrayLike, u0: float | None, state: State | None) -> FloatArray:
        """Input that gives the output `y` of a law whose output is monotone in the input.

        Raises
        ------
        SimulationError
            If an output is not reached; it names the sample.
        ValueError
            If y is not finite or has not one axis, or both u0 and state are given.
        """
        wanted = read_only(y, "y", ndim=1)
        if state is None:
            begin = self._at_rest(float(wanted[0])) if u0 is None and wanted.size else u0
            start = self.advance([begin or 0.0])[1]
        elif u0 is not None:
            raise ValueError("give u0 or state, not both: the state has its own input")
        else:
            start = state
        u, inverse = np.empty(wanted.size), self.inverse_step(start)
        lost = in_pieces(lambda k: drive(inverse.step, inverse.parameters, inverse.state, wanted[k], u[k]), u.size)
        if lost >= 0:
            raise SimulationError(f"no input gives the output at sample {lost} (y = {wanted[lost]:g})")
        return u

    def inverse_step(self, state: State, limits: tuple[float, float] = (-math.inf, math.inf)) -> CompiledLaw:
        """The inverse of the law in this state, as `hysim.kernels.inverses` has it."""
        moving = self._moving(state)
        y = kernels.step(self.parameters, moving.copy(), moving[0])
        parameters = read_only(np.concatenate([limits, self.parameters]), finite=False)
        return CompiledLaw(kernels.inverse_step, parameters, np.concatenate([[moving[0], y], moving]))

    def _at_rest(self, y: float) -> float:
        """The first input that finds the plays at z0 and gives `y`, whatever its rate would be."""
        still = self.parameters.copy()
        still[1] = 0.0
        inverse = PlaySteps(read_only(still), self.z0).inverse_step((0.0, *self.z0.tolist()))
        u = inverse.step(inverse.parameters, inverse.state, y)
        return u if math.isfinite(u) else 0.0

    def _moving(self, state: State) -> FloatArray:
        if len(state) != 1 + self.z0.size:
            raise ValueError(f"the state must hold {1 + self.z0.size} numbers, got {len(state)}")
        return np.array(state, dtype=float)


class Structure(Identifiable, Protocol):
    """What is identified of such a law."""

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the positions of the steady cycle of which `record` is one period or more."""
        ...


class ExtendedPlays(Bank):
    """A sum of plays with an extension, of which it says what the kernel's rows are."""

    thresholds_name: ClassVar[str] = "thresholds"
    weights_name: ClassVar[str] = "weights"
    stops: ClassVar[bool] = False
    bank: ClassVar[bool] = True
    ordered: ClassVar[bool] = True

    thresholds: tuple[float, ...]
    weights: tuple[float, ...]

    @classmethod
    @abstractmethod
    def _rows(cls, tables: Mapping[str, FloatArray]) -> FloatArray:
        """Parameters of the kernel, shape (n_sets, n_parameters), from the arguments (n_sets, length of each)."""

    @abstractmethod
    def _structure(self) -> Structure:
        """What is searched beginning with this law."""

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """What is searched, and what is linear; see the structure of the class."""
        return self._structure().search_space(record, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns in which the output is affine, and what is left of it, shape (n_sets, n_samples, n_columns + 1)."""
        return self._structure().regressors(parameters, record)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The parameters with the positions of the steady cycle of which `record` is one period or more."""
        return self._structure().steady(parameters, record)

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The law with these parameters, one number for each name."""
        return self._structure().assemble(parameters)  # type: ignore[no-any-return]

    @property
    def plays(self) -> PrandtlIshlinskii:
        """The sum of plays without the extension and the offset."""
        return PrandtlIshlinskii(thresholds=self.thresholds, weights=self.weights, z0=self.z0)

    @property
    def steps(self) -> PlaySteps:
        """The law as it is stepped."""
        arguments = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        tables = {name: np.atleast_2d(value) for name, value in arguments.items()}
        return PlaySteps(read_only(self._rows(tables)[0]), read_only(self.z0))


class RateIndependentPlays(ExtendedPlays):
    """One whose output does not depend on time."""

    def memory(self, u: npt.ArrayLike) -> FloatArray:
        """Positions of the plays at the samples of an input that is monotone between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input; the first sample finds the plays at z0, and pushes them.

        Returns
        -------
        array, shape (n_samples, n_plays)

        Raises
        ------
        ValueError
            If u is not finite or has not one axis.
        """
        return self.steps.memory(u)

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
        return self.steps.response(u)

    def advance(self, u: npt.ArrayLike, state: State | None = None) -> tuple[FloatArray, State]:
        """Output continued from `state`, and the state after the last sample; see `PrandtlIshlinskii.advance`.

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
        return self.steps.advance(u, state)

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`."""
        return self.steps.compiled(u0)

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
            tuple an array of shape (n_sets, length), or (length,) for all sets.
        u, reduce, target, workers
            As of `PrandtlIshlinskii.responses`.

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
        tables, inputs = sets_of(cls, parameters, u)
        laws = batch_of(cls._rows(tables), tables["z0"], inputs)
        return laws.rows(workers) if reduce is None else laws.reduced(reduce, target, workers)


def kernel_rows(
    tables: Mapping[str, FloatArray],
    *,
    width: npt.ArrayLike = 0.0,
    left: FloatArray | None = None,
    right: FloatArray | None = None,
    behind: tuple[FloatArray, ...] = (),
) -> FloatArray:
    """Rows as the kernels take them: offset, width, envelopes, thresholds, weights, and the dead zones behind."""
    n_sets = len(tables["offset"])
    same = np.tile(IDENTITY, (n_sets, 1))
    widths = np.broadcast_to(np.reshape(width, (-1, 1)), (n_sets, 1))
    envelopes = same if left is None else left, same if right is None else right
    return np.concatenate(
        [tables["offset"], widths, *envelopes, tables["thresholds"], tables["weights"], *behind], axis=1
    )


def batch_of(rows: FloatArray, z0: FloatArray, u: FloatArray) -> Batch:
    """The laws of these rows, with the inputs `u`, shape (1 or n_sets, n_samples)."""
    parameters = read_only(rows)

    def compute(sets: Sets, inputs: FloatArray, y: FloatArray) -> None:
        own = part_of(parameters, sets)
        state = np.empty((len(own), 1 + z0.shape[1]))
        state[:, 0], state[:, 1:] = inputs[:, 0], z0[sets]
        if len(inputs) == 1:
            drive_sets(kernels.step, own, state, inputs[0], y, 0, len(y))
        else:
            for k in range(len(y)):
                drive(kernels.step, own[k], state[k], inputs[k], y[k])

    return Batch(compute, len(rows), u)


def positions_of(
    thresholds: FloatArray,
    z0: FloatArray,
    u: FloatArray,
    *,
    width: npt.ArrayLike = 0.0,
    left: FloatArray | None = None,
    right: FloatArray | None = None,
) -> FloatArray:
    """Positions (n_sets, n_samples, n_plays) of plays (n_sets, n_plays), pushed as `kernel_rows` says."""
    tables = {"offset": np.zeros((len(z0), 1)), "thresholds": thresholds, "weights": np.zeros_like(z0)}
    rows = kernel_rows(tables, width=width, left=left, right=right)
    return np.array([PlaySteps(read_only(row), start).memory(u) for row, start in zip(rows, z0, strict=True)])


def dead_zone(x: FloatArray, d: float | FloatArray) -> FloatArray:
    """One-sided dead zone of the threshold `d`; the input itself where that is zero."""
    return np.where(np.equal(d, 0.0), x, np.where(np.greater(d, 0.0), np.maximum(x - d, 0.0), np.minimum(x - d, 0.0)))


def check_dead_zones(thresholds: FloatArray, weights: FloatArray) -> None:
    """Refuse tables (n_sets, n_zones) that are no dead zones."""
    if thresholds.shape[1] != weights.shape[1] or not thresholds.shape[1]:
        raise ValueError(
            f"dead_zones and dead_zone_weights must be equally long and not empty, got {thresholds.shape[1]} "
            f"and {weights.shape[1]}"
        )
    if not (np.diff(thresholds) > 0.0).all():
        raise ValueError(f"dead_zones must increase, got {thresholds[0].tolist()}")
