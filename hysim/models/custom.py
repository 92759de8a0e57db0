"""A law of one's own: a scalar function, compiled once, that every verb and every loop takes.

    y = step(parameters, state, u)

The function gets the parameters in the order in which they were named, the state, whose first element is the
last input, and the next input. It changes the state in place (the last input among it) and returns the
output. It is compiled by numba to the one type that compiled loops take (`hysim.kernels.stepping`): scalars
and `math`, no allocation, no exceptions; nan says that the law is lost.
"""

import functools
import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, checked, read_only
from hysim._parallel import in_chunks, in_pieces
from hysim.errors import SimulationError
from hysim.kernels.custom import compile_step, drive_sets
from hysim.kernels.stepping import Step, drive
from hysim.models.composable import Composable
from hysim.models.model import CompiledLaw
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.records import Record

State = tuple[float, ...]
"""Last input, and the law's own memory."""


@checked
class CustomLaw(Composable):
    """A law by a scalar function of one's own.

    Parameters
    ----------
    step : callable
        ``step(parameters, state, u) -> y``, a plain function or one that numba has compiled; it is compiled
        anew for the loops' own types. ``state[0]`` is the last input, which the function must move to `u`;
        the initial values of `state` follow. At the first sample the last input is that sample itself.
    parameters : mapping
        Names to numbers, in the order in which `step` reads them.
    state : mapping
        Names to the initial values of the memory, in the order in which `step` reads them after the last
        input. They can be identified as the parameters can.
    bounds : mapping
        Name to (lower, upper): the box in which `hysim.identify` searches, on a log scale where it is
        positive. What has no bounds and is not linear is held.
    linear : tuple of str
        Parameters in which the output is affine, and by which the state does not move: they are solved for.
    scratch : int
        Further elements at the end of the state, zero at first.

    Raises
    ------
    TypeError
        If `step` takes other arguments, or does not compile to one number.
    ValueError
        If a name is given twice or is unknown, or a number is not finite.

    Examples
    --------
    Play of half width r, in the form that every loop takes:

    >>> import hysim as hs
    >>> def play(parameters, state, u):
    ...     gain, r = parameters
    ...     state[1] = max(u - r, min(u + r, state[1]))
    ...     state[0] = u
    ...     return gain * state[1]
    >>> law = hs.CustomLaw(
    ...     step=play,
    ...     parameters={"gain": 2.0, "r": 0.25},
    ...     state={"w0": 0.0},
    ...     bounds={"r": (0.0, 1.0)},
    ...     linear=("gain",),
    ... )
    >>> law.response([0.0, 1.0, 0.75, 0.0]).tolist()
    [0.0, 1.5, 1.5, 0.5]
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    >>> fit = hs.identify(law, hs.Record(u=u, y=3.0 * law.response(u)))
    >>> round(fit.estimates["gain"], 6), round(fit.estimates["r"], 6)
    (6.0, 0.25)
    """

    step: Callable[[Any, Any, float], float]
    parameters: Mapping[str, float] = field(default_factory=dict)
    state: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    linear: tuple[str, ...] = ()
    scratch: int = 0

    def __post_init__(self) -> None:
        for what in ("parameters", "state"):
            values = {name: _number(value, f"{what}[{name!r}]") for name, value in getattr(self, what).items()}
            object.__setattr__(self, what, MappingProxyType(values))
        if not self.parameters:
            raise ValueError("parameters must name at least one parameter")
        if both := set(self.parameters) & set(self.state):
            raise ValueError(f"{sorted(both)[0]!r} names a parameter and an initial value")
        object.__setattr__(self, "linear", tuple(self.linear))
        for what, names, known in (("linear", self.linear, self.parameters), ("bounds", self.bounds, self.scalars)):
            if unknown := [name for name in names if name not in known]:
                raise ValueError(f"{what} names {unknown[0]!r}; there are {', '.join(known)}")
        compiled_step(self.step)

    @property
    def scalars(self) -> dict[str, float]:
        """Parameters and initial values by name."""
        return {**self.parameters, **self.state}

    @property
    def columns(self) -> tuple[str, ...]:
        """The names in which the output is affine."""
        return self.linear

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output at the samples of `u`, shape (n,).

        Raises
        ------
        SimulationError
            If the output leaves the finite numbers; it names the sample.
        ValueError
            If u is not finite or has not one axis.
        """
        return self.advance(u)[0]

    def advance(self, u: npt.ArrayLike, state: State | None = None) -> tuple[FloatArray, State]:
        """Output at the samples of `u`, continued from `state`, and the state after the last sample.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input.
        state : tuple of float, optional
            What an earlier call returned; by default the initial values, at the first sample.

        Returns
        -------
        y : array, shape (n_samples,)
            The same bits as from one uncut input.
        state : tuple of float
            To continue from.

        Raises
        ------
        SimulationError, ValueError
            As `response`.
        """
        inputs = read_only(u, "u", ndim=1)
        compiled = self.compiled(float(inputs[0]) if inputs.size else 0.0)
        memory = compiled.state if state is None else np.array(state, dtype=float)
        if memory.shape != compiled.state.shape:
            raise ValueError(f"the state must hold {compiled.state.size} numbers, got {memory.size}")
        y = np.empty(inputs.size)
        with np.errstate(all="ignore"):
            lost = in_pieces(lambda k: drive(compiled.step, compiled.parameters, memory, inputs[k], y[k]), y.size)
        if lost >= 0:
            raise SimulationError(f"the output leaves the finite numbers at sample {lost} (u = {inputs[lost]:g})")
        return y, tuple(memory.tolist())

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`."""
        state = np.array([u0, *self.state.values(), *[0.0] * self.scratch])
        return CompiledLaw(compiled_step(self.step), read_only(list(self.parameters.values()), ndim=1), state)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box of the bounded parameters.

        Raises
        ------
        ValueError
            If the input is constant, `initial` is unknown, a name does not fit, or bounds are missing or not
            finite.
        """
        if np.ptp(record.u) == 0.0:
            raise ValueError("the input is constant: nothing can be identified from it")
        defaults = self.scalars
        boxes = {**self.bounds, **freedom.bounds}
        resting = tuple(self.state) if freedom.starts_at_rest() else ()
        kept = [name for name in defaults if name in resting or (name not in boxes and name not in self.linear)]
        if unbounded := [name for name in kept if name in freedom.free and name not in boxes]:
            raise ValueError(
                f"{unbounded[0]!r} is to be free, but has no bounds: give bounds={{{unbounded[0]!r}: ...}}"
            )
        held = {name: defaults[name] for name in kept if name not in freedom.free} | freedom.held(defaults)
        names = tuple(name for name in defaults if name not in held)
        searched = tuple(name for name in names if name not in self.linear)
        limits = freedom.limits(defaults, held)
        chart = [_Coordinate(name, *boxes[name]) for name in searched]
        lower, upper = (np.array([axis.encode(axis.box[side]) for axis in chart]) for side in (0, 1))
        start = np.clip([axis.encode(defaults[axis.name]) for axis in chart], lower, upper)

        def decode(x: FloatArray) -> dict[str, FloatArray]:
            sets = np.atleast_2d(x)
            constants = {name: np.full(len(sets), held[name]) for name in held if name not in self.linear}
            return constants | {axis.name: axis.decode(column) for axis, column in zip(chart, sets.T, strict=True)}

        return SearchSpace(
            coordinates=searched,
            lower=lower,
            upper=upper,
            starts=start[np.newaxis] if chart else np.empty((0, 0)),
            names=names,
            columns=self.linear,
            linear=tuple(name for name in self.linear if name not in held),
            held=held,
            parameters=decode,
            bounds={name: pair for name, pair in limits.items() if name in self.linear},
            state=tuple(self.state),
        )

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """What each linear parameter adds to the output, and the output without, (n_sets, n_samples, n_linear + 1)."""
        values = {name: np.atleast_1d(parameters.get(name, value)) for name, value in self.scalars.items()}
        n_sets = max(column.size for column in values.values())
        sets = {name: np.broadcast_to(column, n_sets) for name, column in values.items()}
        sets |= {name: np.zeros(n_sets) for name in self.linear}
        without = self._outputs(sets, record.u)
        with np.errstate(invalid="ignore"):
            added = [self._outputs(sets | {name: np.ones(n_sets)}, record.u) - without for name in self.linear]
        return np.stack([*added, without], axis=-1)

    def assemble(self, parameters: Mapping[str, float]) -> "CustomLaw":
        """The law with these parameters and initial values."""
        return replace(
            self,
            parameters={name: parameters.get(name, value) for name, value in self.parameters.items()},
            state={name: parameters.get(name, value) for name, value in self.state.items()},
        )

    def _outputs(self, sets: Mapping[str, FloatArray], u: FloatArray) -> FloatArray:
        """Outputs (n_sets, n_samples); a set that leaves the finite numbers is a row of inf."""
        n_sets = next(iter(sets.values())).size
        table = read_only(np.stack([sets[name] for name in self.parameters], axis=1), finite=False)
        state = np.zeros((n_sets, 1 + len(self.state) + self.scratch))
        state[:, 0] = u[0]
        for k, name in enumerate(self.state, 1):
            state[:, k] = sets[name]
        out = np.empty((n_sets, u.size))
        step = compiled_step(self.step)

        def work(start: int, stop: int) -> None:
            with np.errstate(all="ignore"):
                drive_sets(step, table, state, u, out, start, stop)

        in_chunks(work, n_sets, n_samples=u.size)
        return out


class _Coordinate:
    """A parameter between its bounds, on a log scale where both are positive."""

    def __init__(self, name: str, lower: float, upper: float) -> None:
        if not (math.isfinite(lower) and math.isfinite(upper) and lower < upper):
            raise ValueError(f"bounds of {name!r} must be finite with lower < upper, got {(lower, upper)}")
        self.name, self.box, self.scale = name, (lower, upper), max(abs(lower), abs(upper))

    def encode(self, value: float) -> float:
        """Coordinate of a value."""
        if self.box[0] > 0.0:
            return math.log(max(value, self.box[0]))
        return value / self.scale

    def decode(self, x: FloatArray) -> FloatArray:
        """Values of a coordinate."""
        return np.exp(x) if self.box[0] > 0.0 else x * self.scale


@functools.lru_cache(maxsize=256)
def compiled_step(function: Callable[[Any, Any, float], float]) -> Step:
    """Compile a step for the loops' own types, once in a process.

    Raises
    ------
    TypeError
        If it takes other arguments, or does not compile to one number.
    """
    plain = getattr(function, "py_func", function)
    if not callable(plain):
        raise TypeError(f"step must be a function step(parameters, state, u) -> y, got {type(function).__name__}")
    name = getattr(plain, "__name__", "step")
    taken = inspect.signature(plain).parameters
    if len(taken) != 3:
        raise TypeError(f"step must take (parameters, state, u), but {name} takes ({', '.join(taken)})")
    try:
        return compile_step(plain)
    except Exception as error:  # numba raises its own, and now and then what its parts raise
        reason = " ".join(str(error).split())
        raise TypeError(f"{name} does not compile as step(parameters, state, u) -> y: {reason}") from None


def _number(value: Any, name: str) -> float:
    return float(read_only(value, name, ndim=0))
