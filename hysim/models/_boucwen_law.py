"""What all Bouc-Wen laws share: the memory and what follows from it.

    dz/du = A - |z|^n (gamma + beta sign(z du))
    y = offset + c1 u + c2 u^2 + ... + gain z

u is the input, z the memory, y the output. The memory is evaluated exactly at the samples of an input
that is linear between them (`hysim.kernels.boucwen`); it does not depend on time. `A` and `gain` enter
only as a product. With A > 0 and beta > 0 the loop of y runs clockwise for a positive gain (a restoring
force) and counterclockwise for a negative one (a piezoelectric displacement).

Sources: R. Bouc 1967; Y. K. Wen, J. Eng. Mech. Div. 102 (1976); the classes after Ikhouane and Rodellar 2007.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.errors import SimulationError
from hysim.kernels import boucwen as kernels
from hysim.kernels.charts import N_WORK
from hysim.models import _boucwen_facts, _boucwen_search, boucwen_inverse, limit_cycle
from hysim.models._batch import Reduction
from hysim.models._boucwen_batch import batch
from hysim.models.boucwen_inverse import BoucWenInverse, InverseState
from hysim.models.limit_cycle import LimitCycle
from hysim.models.model import CompiledLaw
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

State = tuple[float, float]
"""Last input and memory."""

MEMORY = ("A", "beta", "gamma", "n", "z0")

_PASSES = 40


class BoucWenLaw(ABC):
    """The memory, and an output that is a polynomial of u plus gain z.

    A law adds its fields, and says how its input coefficients are called.
    """

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

    @property
    def admissible(self) -> bool:
        """Whether ``-beta <= gamma <= beta``: the law then creates no energy, whatever the input."""
        return -self.beta <= self.gamma <= self.beta

    @property
    def stability_class(self) -> str:
        """Class ``"I"`` to ``"V"`` in which the memory is bounded for every input, or ``"none"``.

        Classes II and IV are bounded only from a range of initial memories (Ikhouane and Rodellar 2007).
        """
        loading, unloading = self.beta + self.gamma, self.beta - self.gamma
        if self.A > 0.0 and loading > 0.0:
            return "I" if unloading >= 0.0 else "II" if self.beta >= 0.0 else "none"
        if self.A < 0.0 and unloading > 0.0:
            return "III" if loading >= 0.0 else "IV" if self.beta >= 0.0 else "none"
        return "V" if self.A == 0.0 and loading > 0.0 and unloading >= 0.0 else "none"

    @property
    def passive(self) -> bool:
        """Whether the memory is a passive map from the velocity u' to z that is bounded for every input.

        This is class I: A > 0, beta + gamma > 0 and beta >= gamma, that is, sigma >= 1/2 in normalised form.
        """
        return self.stability_class == "I"

    @property
    def saturation(self) -> float:
        """What ``|z|`` tends to on a long way of the input, (A / (beta + gamma))^(1/n) for A > 0; inf if nothing."""
        return _boucwen_facts.saturation(self.A, self.beta, self.gamma, self.n)

    @property
    def memory_bound(self) -> float:
        """Bound of ``|z|`` for every input that begins with z0; inf if there is none."""
        return _boucwen_facts.memory_bound(self.A, self.beta, self.gamma, self.n, self.z0, self.stability_class)

    def limit_cycle(self, amplitude: float) -> LimitCycle:
        """Steady loop of the memory between the inputs -amplitude and amplitude.

        Parameters
        ----------
        amplitude : float
            [unit of u].

        Returns
        -------
        LimitCycle
            Peak, coercive input, width at u = 0 and energy, to rounding; a law with beta > 0 approaches it
            from every memory inside its bound.

        Raises
        ------
        ValueError
            If the amplitude is not positive, or A = 0.
        SimulationError
            If the memory escapes to infinity within one stroke.

        Examples
        --------
        >>> import hysim as hs
        >>> loop = hs.BoucWen(beta=0.5, gamma=0.5).limit_cycle(1.0)
        >>> round(loop.peak, 12), round(loop.coercive, 12), round(loop.energy, 12)
        (0.721535457239, 0.278464542761, 0.593244754991)
        """
        return limit_cycle.limit_cycle(self.A, self.beta, self.gamma, self.n, float(amplitude))

    def tangent(self, direction: npt.ArrayLike, z: npt.ArrayLike, u: npt.ArrayLike = 0.0) -> FloatArray:
        """Slope dy/du of the output at the memory `z`, for an input at `u` that moves in `direction`.

        Parameters
        ----------
        direction : array
            Velocity u' or its sign, not zero.
        z, u : array
            Memory and input, broadcast against the direction; only a polynomial's slope depends on u.

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
        dz = self.A - np.abs(memory) ** self.n * (self.gamma + self.beta * np.sign(memory * np.sign(velocity)))
        static = np.polynomial.polynomial.polyval(np.asarray(u, dtype=float), boucwen_inverse.derivative(self))
        return np.asarray(static + self.gain * dz)

    def slope_bounds(self, low: float = -np.inf, high: float = np.inf) -> tuple[float, float]:
        """Bounds of the slope dy/du over every input between `low` and `high` that begins with z0.

        Parameters
        ----------
        low, high : float
            Range of the input [unit of u]; a law without polynomial does not depend on it.

        Returns
        -------
        (float, float)
            Infinite where the memory is not bounded and the slope neither. They are approached by inputs
            that saturate the memory, so that they are sharp for a law without polynomial.

        Examples
        --------
        A piezoelectric stack by Low and Guo: 1 - 0.56 is left of the slope just after a reversal.

        >>> import hysim as hs
        >>> law = hs.BoucWen(A=0.35, beta=0.02, gamma=0.005, feedthrough=1.0, gain=-1.0)
        >>> [round(bound, 12) for bound in law.slope_bounds()]
        [0.44, 1.0]
        """
        if not low <= high:
            raise ValueError(f"low must not be above high, got {low} and {high}")
        memory = _boucwen_facts.memory_slopes(self.A, self.beta, self.gamma, self.n, self.memory_bound)
        scaled = sorted(self.gain * slope if self.gain else 0.0 for slope in memory)
        static = _boucwen_facts.polynomial_range(boucwen_inverse.derivative(self), low, high)
        with np.errstate(invalid="ignore"):
            total = np.add(static, scaled)
        lowest, highest = np.where(np.isnan(total), [-np.inf, np.inf], total).tolist()
        return lowest, highest

    def is_invertible(self, low: float = -np.inf, high: float = np.inf) -> bool:
        """Whether the slope keeps its sign for every input between `low` and `high`: its bounds have one sign.

        This is sufficient for an inverse, not necessary: on one record a law may do without, and
        `inverse_response` looks at the record. For a piezoelectric stack by Low and Guo it reads
        alpha max(1, 2 beta / (beta + gamma)) < 1. A bound of zero to rounding counts as zero.
        """
        bounds = self.slope_bounds(low, high)
        rounding = 1e-14 * (abs(self.gain * self.A) + float(np.abs(boucwen_inverse.coefficients(self)).max()))
        return bounds[0] > rounding or bounds[1] < -rounding

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
            If the memory escapes to infinity, which takes beta + gamma < 0, or beta - gamma < 0 and a memory
            beyond its bound; it names the sample.
        ValueError
            If u is not finite or has not one axis.
        """
        inputs = read_only(u, "u", ndim=1)
        return self._memory(inputs, self._start(inputs))

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
        state : (float, float), optional
            Input and memory at the last sample so far; by default ``(u[0], z0)``.

        Returns
        -------
        y : array, shape (n_samples,)
            The same bits as from one uncut input.
        state : (float, float)
            To continue from.

        Raises
        ------
        SimulationError, ValueError
            As `memory`.
        """
        inputs = read_only(u, "u", ndim=1)
        start = self._start(inputs) if state is None else state
        z = self._memory(inputs, start)
        scalars = self.scalars
        y = _output([scalars[name] for name in self.coefficient_names], self.gain, self.offset, inputs, z)
        return y, (float(inputs[-1]), float(z[-1])) if z.size else start

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`."""
        scalars = self.scalars
        law = self.A, self.beta, self.gamma, self.n
        parameters = np.array([*law, self.gain, self.offset, *(scalars[name] for name in self.coefficient_names)])
        state = np.zeros(N_WORK)
        kernels.prepare(*law, 0.0, state)
        state[:2] = u0, self.z0
        return CompiledLaw(kernels.step, read_only(parameters, finite=False), state)

    def inverse(self) -> BoucWenInverse:
        """The law's inverse as an object, for loops that run sample by sample.

        Returns
        -------
        BoucWenInverse
            In the direction that the output has at u = 0, z = 0.

        Raises
        ------
        ValueError
            If the slope is zero there.
        """
        return boucwen_inverse.inverse(self)

    def inverse_response(
        self, y: npt.ArrayLike, u0: float | None = None, state: State | InverseState | None = None
    ) -> FloatArray:
        """Input that gives the output `y`, linear between the samples.

        Parameters
        ----------
        y : array, shape (n_samples,)
            Wanted output.
        u0 : float, optional
            Input at which the law rests, its memory at z0, before it moves to the first sample. By default
            it rests at the first sample: the input that gives y[0] with the memory at z0, found from u = 0.
        state : tuple of float, optional
            Input and memory (and output) to continue from, in place of u0 and z0.

        Returns
        -------
        array, shape (n_samples,)
            Its `response` is y to rounding.

        Raises
        ------
        SimulationError
            If the slope dy/du does not keep its sign on the way, or the output does not reach a sample; the
            message names the sample, the input and the slope there.
        ValueError
            If y is not finite or has not one axis, its first sample does not tell the first input (give u0),
            or the slope is zero where the record begins.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.BoucWen(A=0.35, beta=0.02, gamma=0.005, feedthrough=1.0, gain=-1.0)
        >>> law.inverse_response(law.response([0.0, 30.0, 10.0])).round(9).tolist()
        [0.0, 30.0, 10.0]
        """
        return boucwen_inverse.inverse_response(self, y, u0, state)

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
        template = cls._from_scalars({name: float(np.ravel(values)[0]) for name, values in sets.items()})
        columns, inputs = template._columns(sets, u)
        output = np.stack([columns[name] for name in ("gain", "offset", *template.coefficient_names)], axis=1)
        laws = batch(template._table(columns), read_only(output), inputs)
        return laws.rows(workers) if reduce is None else laws.reduced(reduce, target, workers)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box that `identify` searches; see `hysim.models._boucwen_search`."""
        return _boucwen_search.search_space(self.scalars, self.columns, record, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns u, u^2, ..., z, 1, 0 of the output, shape (n_sets, n_samples, n_columns + 1)."""
        columns, inputs = self._columns(parameters, record.u)
        table = self._table(columns)
        z = batch(table, read_only(np.tile([1.0, 0.0], (len(table), 1))), inputs).rows(None)
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
            memory[:, MEMORY.index("z0")] = z0
            return batch(read_only(memory), only_memory, inputs).reduced("final", None, None)

        before, z0 = np.zeros(len(memory)), passed(np.zeros(len(memory)))
        drift_before = z0 - before
        for _ in range(_PASSES):
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                drift = np.where(np.isfinite(z0), passed(np.nan_to_num(z0, posinf=0.0, neginf=0.0)) - z0, np.nan)
                if not (np.abs(drift) > 1e-15 * np.abs(z0)).any():
                    break
                secant = z0 - drift * (z0 - before) / (drift - drift_before)
            before, drift_before, z0 = z0, drift, np.where(np.isfinite(secant), secant, z0 + drift)
        return {"z0": z0}

    def notes(self, record: Record, model: "BoucWenLaw") -> tuple[str, ...]:
        """What the identified law promises for other inputs."""
        if model.admissible and model.stability_class == "I":
            return ("the law is of stability class I and passive",)
        kind = model.stability_class
        bounded = f"of stability class {kind}" if kind != "none" else "of no stability class: other inputs may escape"
        return (f"the law is {bounded}" + ("" if model.admissible else ", and may create energy"),)

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The law with these parameters, one number for each name."""
        return self._from_scalars(parameters)

    def _start(self, u: FloatArray) -> State:
        return (float(u[0]) if u.size else 0.0), self.z0

    def _memory(self, u: FloatArray, state: State) -> FloatArray:
        z = np.empty(u.size)
        law = self.A, self.beta, self.gamma
        start = float(state[0]), float(state[1])
        if self.n == 1.0:
            escaped = kernels.linear_path(*law, *start, u, z)
        elif self.n == 2.0:
            escaped = kernels.quadratic_path(*law, *start, u, z)
        else:
            work = np.empty(N_WORK)
            kernels.prepare(*law, self.n, 0.0, work)
            escaped = kernels.power_path(*law, self.n, *start, u, work, z)
        if escaped >= 0:
            raise SimulationError(
                f"the memory escapes to infinity at sample {escaped} (u = {u[escaped]:g}): with beta + gamma = "
                f"{self.beta + self.gamma:g} and beta - gamma = {self.beta - self.gamma:g} only a shorter input "
                "bounds it"
            )
        return z

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

    @staticmethod
    def _table(columns: Mapping[str, FloatArray]) -> FloatArray:
        return read_only(np.stack([columns[name] for name in MEMORY], axis=1))


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
