"""What every law with a memory z beside a polynomial of the input shares.

    dz/du = f(u, z, sign(du))
    y = offset + c1 u + c2 u^2 + ... + gain z

u is the input, z the memory, y the output; time has no part in it. A law says how its memory moves, one at
a time and many at once, and how it is searched; the rest follows here.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.models import boucwen_inverse
from hysim.models._batch import Reduction
from hysim.models._memory_batch import Kernel, batch
from hysim.models.composable import Composable
from hysim.models.model import CompiledLaw
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

State = tuple[float, ...]
"""Last input and memory, and whatever else a law remembers."""

_PASSES = 40


class MemoryLaw(Composable, ABC):
    """The memory, and an output that is a polynomial of u plus gain z.

    A law adds its fields, and says how its input coefficients are called. `memory_names` are the parameters
    of its memory, A, beta, gamma, n first and z0 last; `others_at_start` is what else it remembers at the first
    sample.
    """

    memory_names: ClassVar[tuple[str, ...]]
    others_at_start: ClassVar[tuple[float, ...]] = ()

    A: float
    beta: float
    gamma: float
    n: float
    gain: float
    offset: float
    z0: float

    @property
    @abstractmethod
    def coefficient_names(self) -> tuple[str, ...]:
        """One name for each coefficient of the input."""

    def __post_init__(self) -> None:
        if self.n <= 0.0:
            raise ValueError(f"n must be positive, got {self.n}")
        if not self.coefficient_names:
            raise ValueError("input_coefficients must hold at least one coefficient")

    @classmethod
    def _from_scalars(cls, scalars: Mapping[str, float]) -> Self:
        """The law from one number for each name."""
        return cls(**scalars)

    @classmethod
    def _to_scalars(cls, parameters: Parameters) -> dict[str, npt.ArrayLike]:
        """The constructor's arguments, each possibly an array over sets, under one name for each number."""
        return dict(parameters)

    @property
    def scalars(self) -> dict[str, float]:
        """One number for each name that `identify` uses, in the order of the constructor."""
        arguments = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {name: float(np.ravel(value)[0]) for name, value in self._to_scalars(arguments).items()}

    @property
    def columns(self) -> tuple[str, ...]:
        """The names in which the output is affine."""
        return (*self.coefficient_names, "gain", "offset")

    def tangent(
        self, direction: npt.ArrayLike, z: npt.ArrayLike, u: npt.ArrayLike = 0.0, *others: npt.ArrayLike
    ) -> FloatArray:
        """Slope dy/du of the output at the memory `z`, for an input at `u` that moves in `direction`.

        Parameters
        ----------
        direction : array
            Velocity u' or its sign, not zero.
        z, u : array
            Memory and input, broadcast against the direction; only a polynomial's slope depends on u.
        *others : array
            What else a law remembers, in the order of its state.

        Returns
        -------
        array
            [unit of y / unit of u].

        Raises
        ------
        ValueError
            If a direction is zero: the slope ahead and the one behind differ.
        """
        velocity, memory = np.asarray(direction, dtype=float), np.asarray(z, dtype=float)
        if not np.all(velocity):
            raise ValueError("direction must not be zero: an input that stands still has two slopes")
        inputs = np.asarray(u, dtype=float)
        static = np.polynomial.polynomial.polyval(inputs, boucwen_inverse.derivative(self))
        further = (np.asarray(other, dtype=float) for other in others)
        return np.asarray(static + self.gain * self._memory_slope(np.sign(velocity), memory, inputs, *further))

    def memory(self, u: npt.ArrayLike) -> FloatArray:
        """Memory z at the samples of an input that is linear between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input; the first sample finds the memory at z0.

        Returns
        -------
        array, shape (n_samples,)

        Raises
        ------
        SimulationError
            If the memory escapes to infinity; it names the sample.
        ValueError
            If u is not finite or has not one axis.
        """
        inputs = read_only(u, "u", ndim=1)
        return self._memory(inputs, self._start(inputs))[0]

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output y at the samples of an input that is linear between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input; the first sample finds the memory at z0.

        Returns
        -------
        array, shape (n_samples,)

        Raises
        ------
        SimulationError, ValueError
            As `memory`.
        """
        return self.advance(u)[0]

    def advance(self, u: npt.ArrayLike, state: State | None = None) -> tuple[FloatArray, State]:
        """Output at the samples of `u`, continued from `state`, and the state after the last sample.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input, linear between its samples and from the state's input to the first of them.
        state : tuple of float, optional
            Input and memory at the last sample so far; by default ``(u[0], z0)``.

        Returns
        -------
        y : array, shape (n_samples,)
            The same bits as from one uncut input.
        state : tuple of float
            To continue from.

        Raises
        ------
        SimulationError, ValueError
            As `memory`.
        """
        inputs = read_only(u, "u", ndim=1)
        start = self._start(inputs) if state is None else state
        z, end = self._memory(inputs, start)
        scalars = self.scalars
        y = _output([scalars[name] for name in self.coefficient_names], self.gain, self.offset, inputs, z)
        return y, end

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
            The constructor's names to one value for each set, shape (n_sets,), or to one for all.
        u : array, shape (n_samples,) or (n_sets, n_samples)
            One input for all sets, or one for each.
        reduce : {"sse", "max_width", "area", "final"}, optional
            Keep of each output only the sum of its squared differences from `target`, the measure of this
            name of `loop_metrics` (last complete cycle), or the last sample. The outputs are never held
            together: a million sets need no million rows.
        target : array, shape (n_samples,)
            With ``reduce="sse"`` what the outputs are compared with [unit of y].
        workers : int, optional
            Number of threads; by default one for each core. The result does not depend on it.

        Returns
        -------
        array, shape (n_sets, n_samples), or (n_sets,) with `reduce`
            Each row the same bits as `response`. A law whose memory escapes is a row of inf, or inf.

        Raises
        ------
        TypeError
            If a name is not one of the constructor's.
        ValueError
            If lengths do not fit, a value is not one that the constructor takes, or the input has no
            complete cycle to measure.

        Examples
        --------
        >>> import hysim as hs
        >>> u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
        >>> hs.BoucWen.responses({"beta": [0.3, 0.5, 0.7]}, u, reduce="area").round(3).tolist()
        [0.41, 0.595, 0.746]
        """
        sets = cls._to_scalars(parameters)
        template = cls._from_scalars({name: float(read_only(values, name).ravel()[0]) for name, values in sets.items()})
        columns, inputs = template._columns(sets, u)
        output = np.stack([columns[name] for name in ("gain", "offset", *template.coefficient_names)], axis=1)
        laws = batch(template._table(columns), read_only(output), inputs, template._batch)
        return laws.rows(workers) if reduce is None else laws.reduced(reduce, target, workers)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns u, u^2, ..., z, 1, 0 of the output, shape (n_sets, n_samples, n_columns + 1)."""
        columns, inputs = self._columns(parameters, record.u)
        table = self._table(columns)
        z = batch(table, read_only(np.tile([1.0, 0.0], (len(table), 1))), inputs, self._batch).rows(None)
        powers = [np.broadcast_to(inputs**k, z.shape) for k in range(1, len(self.coefficient_names) + 1)]
        return np.stack([*powers, z, np.ones_like(z), np.zeros_like(z)], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, FloatArray]:
        """Memory z0, (n_sets,), with which a record that repeats itself ends as it began; nan where it escapes.

        One pass through the record contracts the memory, the more the more beta dissipates; its fixed point is
        found by the secant method.
        """
        columns, inputs = self._columns({**parameters, "z0": 0.0}, np.append(record.u, record.u[0]))
        memory = self._table(columns).copy()
        only_memory = read_only(np.tile([1.0, 0.0], (len(memory), 1)))

        def passed(z0: FloatArray) -> FloatArray:
            memory[:, self.memory_names.index("z0")] = z0
            return batch(read_only(memory), only_memory, inputs, self._batch).reduced("final", None, None)

        before, z0 = np.zeros(len(memory)), passed(np.zeros(len(memory)))
        drift_before = z0 - before
        for _ in range(_PASSES):
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                drift = np.where(np.isfinite(z0), passed(np.nan_to_num(z0, posinf=0.0, neginf=0.0)) - z0, np.nan)
                if not (np.abs(drift) > 1e-15 * np.abs(z0)).any():
                    break
                secant = z0 - drift * (z0 - before) / (drift - drift_before)
            before, drift_before, z0 = z0, drift, np.where(np.isfinite(secant), secant, z0 + drift)
        return {"z0": np.where(np.isfinite(z0), z0, np.nan)}

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The law with these parameters, one number for each name."""
        return self._from_scalars(parameters)

    @abstractmethod
    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`."""

    @abstractmethod
    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box that `identify` searches; see `hysim.models._boucwen_search`."""

    @property
    @abstractmethod
    def _batch(self) -> Kernel:
        """What computes many laws of this structure."""

    @abstractmethod
    def _memory(self, u: FloatArray, state: State) -> tuple[FloatArray, State]:
        """Memory at the samples of `u`, continued from `state`, and the state after them."""

    @abstractmethod
    def _memory_slope(self, direction: FloatArray, z: FloatArray, u: FloatArray, *others: FloatArray) -> FloatArray:
        """Slope dz/du for an input at `u` that moves in `direction`, 1 or -1."""

    def _start(self, u: FloatArray) -> State:
        return (float(u[0]) if u.size else 0.0), self.z0, *self.others_at_start

    def _columns(self, sets: Parameters, u: npt.ArrayLike) -> tuple[dict[str, FloatArray], FloatArray]:
        """Every scalar over the sets, shape (n_sets,) each (those not given are the law's own), and the inputs."""
        defaults = self.scalars
        if unknown := set(sets) - set(defaults):
            raise TypeError(
                f"unknown parameter {sorted(unknown)[0]!r}: {type(self).__name__} has {', '.join(defaults)}"
            )
        inputs = np.atleast_2d(read_only(u, "u"))
        given = {name: read_only(np.atleast_1d(values), name, ndim=1) for name, values in sets.items()}
        lengths = {name: values.size for name, values in given.items() if values.size != 1}
        if inputs.shape[0] != 1:
            lengths["u"] = inputs.shape[0]
        if len(set(lengths.values())) > 1:
            raise ValueError(f"parameters and inputs must have one length or length 1, got {lengths}")
        n_sets = next(iter(lengths.values()), 1)
        if "n" in given and not (given["n"] > 0.0).all():
            raise ValueError(f"n must be positive, got {given['n'].min()}")
        columns = {name: np.full(n_sets, value) for name, value in defaults.items()}
        columns |= {name: np.broadcast_to(values, n_sets) for name, values in given.items()}
        return columns, inputs

    def _table(self, columns: Mapping[str, FloatArray]) -> FloatArray:
        return read_only(np.stack([columns[name] for name in self.memory_names], axis=1))


def _output(
    coefficients: Sequence[float | FloatArray],
    gain: float | FloatArray,
    offset: float | FloatArray,
    u: FloatArray,
    z: FloatArray,
) -> FloatArray:
    """offset + c1 u + c2 u^2 + ... + gain z, in the order of `kernels.step`."""
    total: float | FloatArray = 0.0
    for coefficient in reversed(coefficients):
        total = (total + coefficient) * u
    return np.asarray(offset + total + gain * z)
