"""The Bouc-Wen law, symmetric and with a polynomial input.

    dz/du = A - |z|^n (gamma + beta sign(z du))
    y = offset + feedthrough u + gain z                      BoucWen
    y = offset + c1 u + c2 u^2 + ... + gain z                PolynomialBoucWen

u is the input, z the memory, y the output. The memory is evaluated exactly at the samples of an input
that is linear between them (`hysim.kernels.boucwen`); it does not depend on time. `A` and `gain` enter
only as a product. With A > 0 and beta > 0 the loop of y runs clockwise for a positive gain (a restoring
force) and counterclockwise for a negative one (a piezoelectric displacement).

Sources: R. Bouc 1967; Y. K. Wen, J. Eng. Mech. Div. 102 (1976); the polynomial input for asymmetric
piezoelectric loops after Wang, Chen and Bai 2015; the classes after Ikhouane and Rodellar 2007.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_chunks
from hysim.errors import SimulationError
from hysim.kernels import boucwen as kernels
from hysim.models import _boucwen_search
from hysim.models.model import CompiledLaw, model
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

State = tuple[float, float]
"""Last input and memory."""

MEMORY = ("A", "beta", "gamma", "n", "z0")


class _BoucWenLaw(ABC):
    """What both laws share: the memory, and an output that is a polynomial of u plus gain z.

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
        constants = np.empty(kernels.N_CONSTANTS)
        kernels.prepare(self.A, self.beta, self.gamma, self.n, constants)
        head = [self.A, self.beta, self.gamma, self.n, self.gain, self.offset]
        parameters = np.concatenate([head, constants, [scalars[name] for name in self.coefficient_names]])
        state = np.concatenate([[u0, self.z0], np.zeros(kernels.N_SCRATCH)])
        return CompiledLaw(kernels.step, read_only(parameters, finite=False), state)

    @classmethod
    def responses(cls, parameters: Parameters, u: npt.ArrayLike, *, workers: int | None = None) -> FloatArray:
        """Outputs of many laws at once, on all cores.

        Parameters
        ----------
        parameters : mapping
            The constructor's names to one value for each set, shape (n_sets,), or to one for all.
        u : array, shape (n_samples,) or (n_sets, n_samples)
            One input for all sets, or one for each.
        workers : int, optional
            Number of threads; by default one for each core. The result does not depend on it.

        Returns
        -------
        array, shape (n_sets, n_samples)
            Each row the same bits as `response`. A law whose memory escapes is a row of inf.

        Raises
        ------
        TypeError
            If a name is not one of the constructor's.
        ValueError
            If lengths do not fit, or a value is not one that the constructor takes.
        """
        sets = cls._to_scalars(parameters)
        template = cls._from_scalars({name: float(np.ravel(values)[0]) for name, values in sets.items()})
        scalars, z, inputs = template._memories(sets, u, workers)
        y = _output(
            [scalars[name] for name in template.coefficient_names], scalars["gain"], scalars["offset"], inputs, z
        )
        y[~np.isfinite(z[:, -1])] = np.inf
        return y

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box that `identify` searches; see `hysim.models._boucwen_search`."""
        return _boucwen_search.search_space(self.scalars, self.columns, record, freedom)

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns u, u^2, ..., z, 1, 0 of the output, shape (n_sets, n_samples, n_columns + 1)."""
        z, inputs = self._memories(parameters, record.u, None)[1:]
        powers = [np.broadcast_to(inputs**k, z.shape) for k in range(1, len(self.coefficient_names) + 1)]
        return np.stack([*powers, z, np.ones_like(z), np.zeros_like(z)], axis=-1)

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The law with these parameters, one number for each name."""
        return self._from_scalars(parameters)

    def _start(self, u: FloatArray) -> State:
        return (float(u[0]) if u.size else 0.0), self.z0

    def _memory(self, u: FloatArray, state: State) -> FloatArray:
        z = np.empty(u.size)
        last_u, z0 = state
        escaped = kernels.path(self.A, self.beta, self.gamma, self.n, float(last_u), float(z0), u, z)
        if escaped >= 0:
            raise SimulationError(
                f"the memory escapes to infinity at sample {escaped} (u = {u[escaped]:g}): with beta + gamma = "
                f"{self.beta + self.gamma:g} and beta - gamma = {self.beta - self.gamma:g} only a shorter input "
                "bounds it"
            )
        return z

    def _memories(
        self, sets: Parameters, u: npt.ArrayLike, workers: int | None
    ) -> tuple[dict[str, FloatArray], FloatArray, FloatArray]:
        """Every scalar as a column over the sets (those not given are the law's own), memories, inputs."""
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
        table = np.stack([columns[name] for name in MEMORY], axis=1)
        z = np.empty((n_sets, inputs.shape[1]))
        in_chunks(lambda start, stop: kernels.batch(table, inputs, z, start, stop), n_sets, workers=workers)
        return {name: values[:, np.newaxis] for name, values in columns.items()}, z, inputs


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


@model
class BoucWen(_BoucWenLaw):
    """Symmetric Bouc-Wen law, ``y = offset + feedthrough u + gain z``.

    Parameters
    ----------
    A : float
        Slope dz/du at z = 0 [unit of z / unit of u].
    beta, gamma : float
        Shape of the branches: ``beta + gamma`` bends the loading ones (z du > 0), ``beta - gamma`` the
        unloading ones. Any sign [unit of z^(1-n) / unit of u].
    n : float
        Sharpness of the knee, positive. Also called eta or nu.
    feedthrough : float
        Gain of the input past the memory [unit of y / unit of u].
    gain : float
        Gain of the memory [unit of y / unit of z].
    offset : float
        Output at u = 0, z = 0 [unit of y].
    z0 : float
        Memory at the first sample [unit of z].

    Raises
    ------
    ValueError
        If a parameter is not finite, or n is not positive.

    Notes
    -----
    beta + gamma < 0 is legal (the field's benchmark has it): z then has no bound that is independent
    of the input, and for n > 1 a long enough stretch of the input takes it to infinity.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.BoucWen(beta=0.5, gamma=0.5)
    >>> law.response([0.0, 1.0, -1.0, 1.0]).round(6).tolist()
    [0.0, 0.632121, -0.745354, 0.714823]
    """

    A: float = 1.0
    beta: float = 0.5
    gamma: float = 0.5
    n: float = 1.0
    feedthrough: float = 0.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """One name, of the feedthrough."""
        return ("feedthrough",)


@model
class PolynomialBoucWen(_BoucWenLaw):
    """Bouc-Wen law beside a polynomial of the input, ``y = offset + sum c_k u^k + gain z``.

    Parameters
    ----------
    A, beta, gamma, n, gain, offset, z0 : float
        As in `BoucWen`; z is driven by u itself.
    input_coefficients : sequence of float
        (c1, c2, ...) [unit of y / (unit of u)^k]; c1 is the feedthrough. Their number is the degree
        that `identify` fits.

    Raises
    ------
    ValueError
        If a parameter is not finite, n is not positive, or there is no coefficient.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.PolynomialBoucWen(beta=0.5, gamma=0.5, gain=-1.0, input_coefficients=(2.0, 0.1))
    >>> law.response([0.0, 1.0, 0.0]).round(6).tolist()
    [0.0, 1.467879, 0.307799]
    """

    A: float = 1.0
    beta: float = 0.5
    gamma: float = 0.5
    n: float = 1.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0
    input_coefficients: tuple[float, ...] = (0.0, 0.0)

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """One name for each input coefficient."""
        return tuple(f"input_coefficients[{k}]" for k in range(len(self.input_coefficients)))

    @classmethod
    def _from_scalars(cls, scalars: Mapping[str, float]) -> Self:
        plain = {name: value for name, value in scalars.items() if not name.startswith("input_coefficients[")}
        degree = len(scalars) - len(plain)
        return cls(**plain, input_coefficients=tuple(scalars[f"input_coefficients[{k}]"] for k in range(degree)))

    @classmethod
    def _to_scalars(cls, parameters: Parameters) -> dict[str, npt.ArrayLike]:
        scalars = dict(parameters)
        coefficients = np.atleast_2d(np.asarray(scalars.pop("input_coefficients", cls.input_coefficients), float))
        return scalars | {f"input_coefficients[{k}]": column for k, column in enumerate(coefficients.T)}
