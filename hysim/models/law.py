"""The abstract law: all that follows from one step.

    y_k = step(parameters, state, u_k)

`state` is the last input and what the law remembers, and moves along; at the first sample the last input is that
sample itself. A family declares its fields, its step, and where its search box lies; path, batch, loops, inverse,
identification, printing and files follow from these. `hysim.laws.differential.dahl` is a short example.
"""

import inspect
import math
from abc import ABC
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, fields
from functools import cached_property, lru_cache
from types import FunctionType
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, items, last_names, read_only
from hysim._basics.parallel import in_pieces
from hysim._columns.turning import TOLERANCE
from hysim.errors import SimulationError, warn_beyond
from hysim.kernels import stepping
from hysim.kernels.stepping import START, Start, Step, drive
from hysim.models.batch import Batch, Reduction, Sets
from hysim.models.compiled_step import compiled_start, compiled_step, pointer
from hysim.models.composable import Placed
from hysim.models.inverse_search import check_reached, inverse_at_rest, inverse_response, not_reached, searched_inverse
from hysim.models.parameters import Parameter, declared_space
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits, Startable, Subject
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.slope import HOOKS, states_of, step_of
from hysim.models.stages import Simpler, Stage, Subset
from hysim.models.steady_cycle import Pass, PassOf, fixed_point
from hysim.models.tables import Tables, table_of_one, tables_of
from hysim.records import Record

if TYPE_CHECKING:
    from hysim.models.jacobian import Jacobian

State = tuple[float, ...]
"""Last input, and what the law remembers."""
Advanced = tuple[FloatArray, State]
"""Outputs, and the state after them."""
Outputs = Callable[[Parameters, FloatArray], FloatArray]
"""Outputs (n_sets, n_samples) for parameters and an input."""

_AHEAD = 4  # runs through the turning points before the search for a steady memory
_EXACT = 1e-12  # of the range: what a step along a branch leaves out,
_FINEST = 1e-14  # and in differences
_ROUNDED = 1e-13  # of the largest input, a column that is nothing but rounding
_FEW = 0.5  # of the samples: more turning points are those of noise


class Packed(NamedTuple):
    """Laws as their step takes them, one a row.

    `parameters` are the constants, (n_sets, n_parameters); `memory` is the front of the state before the first
    sample, (n_sets, n_memory), whose first column holds the place of the last input.
    """

    parameters: FloatArray
    memory: FloatArray


# A field of such a name would be taken for the method by which hysim knows another kind of model.
_ASKED_FOR = ("as_records", "at", "at_sample_time", "candidates", "dynamic", "fitted", "law", "with_unit_gain")


class Stepping(NamedTuple):
    """A step, the start of its state, and the places at the end of the state that it works in."""

    step: Any
    start: Any
    workspace: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Law(Placed, Subject, ABC):
    """A rate-independent law that is defined by its step, or by its slope, from which the step follows.

    A family is a subclass under the decorator `hysim.family`: its fields, and the class attributes below. A field is
    a float or a tuple of floats.

    Attributes
    ----------
    step : staticmethod
        ``step(parameters, state, u) -> y``, a plain function that numba can compile, or a kernel.
    slope : staticmethod
        ``slope(p, z, ..., u, s)`` in place of a step: the slopes dz/du of the hidden states, one number or a tuple, for
        an input at u that moves in the direction s, 1 or -1; ``p.name`` is the parameter of this name. It is integrated
        to 1e-10 of the range (`hysim.kernels.branch`). The first states are those of `initial`, the others begin at
        zero. The first one may have a corner at zero.
    output : staticmethod
        ``output(p, z, ..., u) -> y``, of some or all hidden states; by default the first one.
    flows, flow : staticmethod, optional
        ``flow(p, z, last, u)``, the first state after a stroke in closed form, where ``flows(p)`` is true.
    longest : staticmethod, optional
        ``longest(p, z, ..., slope, s)``, the longest step of the integrator [unit of u], for what is narrow; `slope` is
        that of the first state.
    start : staticmethod
        ``start(parameters, state, u0)``, likewise, which completes for a first input the state that `pack` has and the
        workspace behind it, whatever is there; by default the last input is the first one. A steady cycle is computed
        without it.
    initial : tuple of str
        Fields that are the initial memory; they stand in the state behind the last input. By default ``("z0",)``.
    step_fields : tuple of str
        Fields in the order in which the step takes them; by default all but the initial memory, as they are declared.
    further_memory : int
        Further numbers of the memory, which stand in the state behind the initial ones and are zero at first.
    searched : tuple of Parameter
        The box in which `hysim.identify` searches, and the fields in which the output is affine.
    starts : tuple of mappings
        Points from which a search begins beside the law's own, in the units of `searched`.
    screened : int, optional
        Random points that a search tries at first; by default `hysim.identify` chooses.
    samples_a_thread : int, optional
        Fewest samples for which many laws at once begin another thread; by default those of 64 sets. It is for steps
        that take much longer than those of most laws.
    powers : mapping, optional
        Fields of an output that is a polynomial of the input beside one number times the memory: the power of the input
        that each multiplies, and None for the memory. One run then gives all columns of a search.
    contains : Subset, optional
        A simpler family that this one contains, whose optimum starts the search.
    stages : tuple of Stage
        Parameters that a search frees in turn; the Bayesian information criterion says which of them stay.
    workspace : int
        Further places at the end of the state, zero at first, for what the memory and the parameters determine: work,
        and numbers that are kept since they take long. Trials of an inverse share them; their memory they do not.
    exact_strokes : bool
        Whether one step along a monotone stroke leaves the memory of many, to rounding: a steady cycle is then sought
        at its turning points alone, from the memory after a stroke from the input zero.
    resume : staticmethod, optional
        A kernel ``resume(parameters, before, state)`` that makes the state ready for other parameters than those
        `before`; by default a workspace is made anew by the start.
    """

    step: ClassVar[Any] = None
    longest: ClassVar[Any] = None
    flow: ClassVar[Any] = None
    flows: ClassVar[Any] = None
    hidden_states: ClassVar[int] = 0
    tolerance: ClassVar[float] = _EXACT
    start: ClassVar[Any] = staticmethod(stepping.start)
    initial: ClassVar[tuple[str, ...]] = ("z0",)
    step_fields: ClassVar[tuple[str, ...]] = ()
    further_memory: ClassVar[int] = 0
    searched: ClassVar[tuple[Parameter, ...]] = ()
    starts: ClassVar[tuple[Mapping[str, float], ...]] = ()
    screened: ClassVar[int | None] = None
    samples_a_thread: ClassVar[int | None] = None
    powers: ClassVar[Mapping[str, int | None]] = {}
    contains: ClassVar[Subset | None] = None
    stages: ClassVar[tuple[Stage, ...]] = ()
    workspace: ClassVar[int] = 0
    exact_strokes: ClassVar[bool] = False
    resume: ClassVar[Any] = None

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        own = {name for name, kind in inspect.get_annotations(cls).items() if "ClassVar" not in str(kind)}
        taken = sorted(name for name in own if name in _ASKED_FOR or name in dir(Law))
        if taken and cls.__module__.partition(".")[0] != "hysim":
            raise TypeError(f"{cls.__name__} has a field {taken[0]!r}, a name that hysim uses itself: take another one")
        if isinstance(vars(cls).get("slope"), FunctionType):
            raise TypeError(f"the slope of {cls.__name__} must be a plain function, under staticmethod and def")
        if isinstance(cls.searched, Parameter):
            raise TypeError(f"searched of {cls.__name__} must be a tuple of Parameters: one alone ends with a comma")
        says = cls.hidden_states > 0 or isinstance(vars(cls).get("slope"), staticmethod)  # and no number of this name
        if says and (inspect.get_annotations(cls) or not vars(cls).keys().isdisjoint(HOOKS)):
            cls.hidden_states = states_of(cls)
            step, cls.workspace = step_of(cls)
            cls.step = staticmethod(step)

    # ------------------------------------------------------------------------------ what a family may say more

    @staticmethod
    def output(p: Any, x: float, u: float) -> float:
        """Output of a law that says its slope: by default its first hidden state."""
        return x

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Laws as the step takes them: by default the fields one after the other, and the initial memory."""
        if missing := [name for name in cls.initial if name not in tables]:
            raise TypeError(f"{cls.__name__} has no field {missing[0]!r}: declare it, with @hs.family above the class")
        own = sum(tables[name].shape[1] for name in cls.initial)
        memory = cls.initial_memory(tables, further=max(cls.further_memory, cls.hidden_states - own))
        constants = [tables[name] for name in cls.step_fields or tables if name not in cls.initial]
        if cls.hidden_states:
            constants.insert(0, np.full((len(memory), 1), cls.tolerance))
        return Packed(np.concatenate([memory[:, :0], *constants], axis=1), memory)

    @classmethod
    def initial_memory(cls, tables: Tables, *, further: int = 0) -> FloatArray:
        """The last input, the initial memory and `further` numbers that begin at zero, (n_sets, n_memory)."""
        n_sets = len(next(iter(tables.values())))
        memory = [np.zeros((n_sets, 1)), *(tables[name] for name in cls.initial), np.zeros((n_sets, further))]
        return np.concatenate(memory, axis=1)

    @classmethod
    def path(cls, law: CompiledLaw, u: FloatArray, y: FloatArray) -> int:
        """Outputs at `u` into `y`; the first sample that is not finite, or -1. A family may register a faster one."""
        return int(drive(pointer(law.step), law.parameters, law.state, u, y))

    @classmethod
    def rows(cls, tables: Tables, u: FloatArray, y: FloatArray) -> None:
        """Outputs of many laws into `y`, (n_sets, n_samples), inf where one diverges; a family may have a faster one.

        `u` is (1, n_samples) or (n_sets, n_samples).
        """
        run_each(compiled_step(cls.step), compiled_start(cls.start), cls.pack(tables), cls.workspace, u, y)

    @classmethod
    def order(cls, tables: Tables) -> npt.NDArray[np.intp] | None:
        """Order in which laws that share what their step keeps are neighbours; None for the order of the sets."""
        return None

    def divergence(self, sample: int, u: float, y: float) -> str:
        """Message for an output that is not finite at a sample."""
        what = "cannot be computed (the law is too stiff, or its slope is no number)" if np.isnan(y) else "diverges"
        unsafe = "as of laws that are unsafe on smaller cycles (identify it with admissible=True)"
        return f"the output {what} at sample {sample} (u = {u:g}), {unsafe}"

    # ------------------------------------------------------------------------------ simulation

    def __post_init__(self) -> None:
        self.check(self.tables)

    @cached_property
    def tables(self) -> dict[str, FloatArray]:
        """Every field as a table of one set."""
        return {name: table_of_one(value) for name, value in self.arguments.items()}

    @cached_property
    def packed(self) -> tuple[FloatArray, FloatArray]:
        """Parameters of the step and memory before the first sample, as `pack` has them of this law."""
        parameters, memory = self.pack(self.tables)
        return read_only(parameters[0], finite=False), read_only(memory[0], finite=False)

    @property
    def stepping(self) -> Stepping:
        """The leanest step of this law: one for its own numbers, where the family has several.

        It has the bits of the family's `step`, and is that by default.
        """
        return Stepping(self.step, self.start, self.workspace)

    @property
    def memory_places(self) -> tuple[tuple[int, int], ...]:
        """First place and length of each stretch of the state that is memory: the front of it."""
        return ((0, self.packed[1].size),)

    @property
    def known_slopes(self) -> tuple[float, float]:
        """Lowest and highest slope dy/du over every input that begins with the initial memory, infinite if unknown."""
        return -math.inf, math.inf

    @property
    def output_bounds(self) -> tuple[float, float]:
        """Lowest and highest output that inputs lead to, infinite where there is no limit or it is not known."""
        return -math.inf, math.inf

    @property
    def structural(self) -> tuple[str, ...]:
        """Names in `scalars` of the numbers that decide which step the law has, and how many parameters this takes."""
        return ()

    def exchanged(self, columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """The `tables`, with columns (1, 1) in place of some numbers, by their names in `scalars`."""
        tables = dict(self.tables)
        for name, column in columns.items():
            field, bracket, place = name.partition("[")
            chosen = np.arange(tables[field].shape[1]) == (int(place[:-1]) if bracket else 0)
            tables[field] = np.where(chosen, column, tables[field])
        return tables

    @cached_property
    def initial_names(self) -> tuple[str, ...]:
        """Names of the numbers of the initial memory."""
        return tuple(name for name in self.scalars if name.partition("[")[0] in self.initial)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names in which the output is affine."""
        affine = {parameter.name for parameter in self.searched if parameter.affine}
        return tuple(name for name in self.scalars if name.partition("[")[0] in affine)

    @cached_property
    def memory_only(self) -> dict[str, float]:
        """Parameters for which the output of a law with `powers` is the memory itself."""
        return {name: float(power is None) for name, power in self.powers.items()}

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output y at the samples of an input that is monotone between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input [unit of u]; a law of an ODE takes it as linear between the samples.

        Returns
        -------
        array, shape (n_samples,)
            [unit of y].

        Raises
        ------
        SimulationError, ValueError
            If the output diverges, with the sample; if u is not finite or has not one axis.
        """
        return self.advance(u)[0]

    def advance(self, u: npt.ArrayLike, state: State | None = None, *, sample_time: float | None = None) -> Advanced:
        """Output at the samples of `u`, continued from `state`, and the state after the last sample.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input.
        state : tuple of float, optional
            Last input and memory, as an earlier call returned them; by default those of a first sample.
        sample_time : float, optional
            Time between two samples [s], which the output does not depend on.

        Returns
        -------
        y : array, shape (n_samples,)
            The same bits as from one uncut input.
        state : tuple of float
            To continue from.

        Raises
        ------
        SimulationError, ValueError
            As `response`; also if the state has another length.
        """
        inputs = read_only(u, "u", ndim=1)
        law, start = self._begun(_first(inputs), state)
        y = np.empty(inputs.size)
        with np.errstate(all="ignore"):
            lost = in_pieces(lambda k: self.path(law, inputs[k], y[k]), inputs.size)
        if lost >= 0:
            raise SimulationError(self.divergence(lost, inputs[lost], y[lost]))
        return y, tuple(law.state[: len(start)].tolist()) if y.size else start

    def response_jacobian(self, u: npt.ArrayLike, names: Iterable[str] | None = None) -> "Jacobian":
        """Derivatives of the response by the numbers of the law, to 1e-8 of the largest value of each.

        They are extrapolated differences of responses, of 14 laws beside this one for each number, and cannot be finer
        than the rounding of the output. Each sample takes the steps that suit it, so that a kink, such as a play that
        is just being pushed, does no harm unless it lies within a millionth of the longest step: then the derivative
        lies between those of both sides. At the boundary of what the constructor takes the differences are one-sided.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input [unit of u].
        names : iterable of str, optional
            Numbers by their names in `scalars`; by default all by which the response has a derivative.

        Returns
        -------
        Jacobian
            ``.matrix``, shape (n_samples, n_names), and ``jacobian["name"]``.

        Raises
        ------
        SimulationError, ValueError
            If the output diverges; if a name is unknown or has no derivative, or u is not finite or has not one axis.

        Examples
        --------
        >>> import hysim as hs
        >>> jacobian = hs.BoucWen(n=1.5).response_jacobian([0.0, 1.0, 0.5], ("A", "n"))
        >>> jacobian["n"].round(6).tolist()
        [0.0, 0.123057, 0.123057]
        """
        from hysim.models.jacobian import response_jacobian  # loaded where it is needed

        return response_jacobian(self, u, names, self.known_to(_FINEST))

    def memory(self, u: npt.ArrayLike) -> FloatArray:
        """Memory at the samples of `u`; parameters and errors as in `response`.

        Returns
        -------
        array, shape (n_samples,), or (n_samples, n_memory) where a law remembers a tuple of numbers
        """
        z = self.remembered(u)[:, : len(self.initial_names)]
        single = len(self.initial) == 1 and self.scalars.keys() >= set(self.initial)
        return z[:, 0] if single else z

    def remembered(self, u: npt.ArrayLike) -> FloatArray:
        """The state without the last input at the samples of `u`, shape (n_samples, n_memory)."""
        from hysim.kernels.batches import drive_memory  # compiled where it is needed

        inputs = read_only(u, "u", ndim=1)
        law, start = self._begun(_first(inputs), None)
        z = np.empty((inputs.size, len(start) - 1))
        with np.errstate(all="ignore"):
            lost = in_pieces(lambda k: drive_memory(*law, inputs[k], z[k]), inputs.size)
        if lost >= 0:
            raise SimulationError(self.divergence(lost, inputs[lost], z[lost, 0]))
        return z

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that after a first sample at the input `u0`."""
        return _after_first(self.startable(), u0)

    def startable(self, sample_time: float | None = None) -> Startable:
        """The law as a step that runs from any first input; it has no use for the sample time.

        This is the one place where a law begins: with `u0` the state is that at this input.
        """
        parameters, memory = self.packed
        step, start, workspace = self.stepping
        state = np.zeros(memory.size + workspace)
        state[: memory.size] = memory
        model = Startable(compiled_step(step), parameters, state, compiled_start(start))
        if self.u0 is None:
            return model
        # no other first input completes this state
        return Startable(*_after_first(model, self.u0), stepping.complete)

    def state_at(self, u: float) -> State:
        """Input and memory at the input `u`, to which the law moves from its own `u0` if it has one."""
        return self._begun(u, None)[1] if self.u0 is None else self.advance([u])[1]

    def after(self, history: npt.ArrayLike) -> Self:
        """The law as it stands after an input history: the last input is its `u0`, the memory that of this input.

        Parameters
        ----------
        history : array, shape (n_samples,)
            Input [unit of u], such as some cycles, or a decaying sine that demagnetises.

        Returns
        -------
        law
            Its responses continue those of this law; a law at rest is ``law.placed(0.0)`` with the memory at rest.

        Raises
        ------
        SimulationError, ValueError
            As `response`.
        TypeError
            If the memory is more than the fields of the family say, such as the energy of a law that wears.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.Dahl(stiffness=2.0, coulomb=0.5)
        >>> pressed = law.after([0.0, 1.0])
        >>> pressed.u0, pressed.response([0.5]) == law.response([0.0, 1.0, 0.5])[-1:]
        (1.0, array([ True]))
        """
        state = self.advance(history)[1]
        law = self.remembering(state[0], state[1:])
        if not np.allclose(law.state_at(state[0]), state, rtol=1e-12, atol=0.0):
            raise TypeError(
                f"{type(self).__name__} remembers more of an input than its fields can hold: continue with "
                "advance(u, state)"
            )
        return law

    def remembering(self, u0: float, memory: State) -> Self:
        """The law with this memory, the state without the last input, at the input `u0`."""
        law = self.with_scalars(dict(zip(self.initial_names, memory, strict=False)))
        return law.placed(u0, self.u_range)

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
            Names of the constructor to one value for all sets or to one for each, in front of the axes that the value
            has; those not given have their defaults.
        u : array, shape (n_samples,) or (n_sets, n_samples)
            One input for all sets, or one for each.
        reduce : {"sse", "max_width", "area", "final"}, optional
            Keep of each output only the sum of its squared differences from `target`, the measure of this name of
            `loop_metrics` (last complete cycle), or the last sample.
        target : array, shape (n_samples,)
            With ``reduce="sse"`` what the outputs are compared with [unit of y].
        workers : int, optional
            Number of threads; by default one for each core. The result does not depend on it.

        Returns
        -------
        array, shape (n_sets, n_samples), or (n_sets,) with `reduce`
            Each row the same bits as `response`; inf for a law that diverges.

        Raises
        ------
        TypeError, ValueError
            If a name is not one of the constructor's; if lengths do not fit, the constructor would refuse a value, or
            the input has no complete cycle to measure.

        Examples
        --------
        >>> import hysim as hs
        >>> u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
        >>> hs.BoucWen.responses({"beta": [0.3, 0.5, 0.7]}, u, reduce="area").round(3).tolist()
        [0.41, 0.595, 0.746]
        """
        return _batch(cls, parameters, u).result(reduce, target, workers)

    def inverse_response(self, y: npt.ArrayLike, u0: float | None = None, state: State | None = None) -> FloatArray:
        """Input that gives the output `y`, monotone between the samples.

        Parameters
        ----------
        y : array, shape (n_samples,)
            Wanted output [unit of y].
        u0 : float, optional
            Input at which the law stands before it moves to the first sample. By default that is the law's own `u0`;
            a law without one begins at the first sample: at the input with the first output, found from u = 0.
        state : tuple of float, optional
            State to continue from, in place of u0.

        Returns
        -------
        array, shape (n_samples,)
            Its `response` is y to the rounding of u; where the law turns later, the first input with the output.

        Raises
        ------
        SimulationError, ValueError
            If the output does not reach a sample, which is named, or does not rise (or fall) all the way there; if y is
            not finite or has not one axis, u0 and state are given, or y does not determine where the input begins.
        """
        outputs = read_only(y, "y", ndim=1)
        if state is not None and u0 is not None:
            raise ValueError("give u0 or state, not both: the state has its own input")
        if not outputs.size:
            return outputs
        if self.u0 is not None and state is None:
            u0, state = None, self.advance([] if u0 is None else [u0])[1]
        u = self.inverted(outputs, u0, state)
        warn_beyond(self.u_range, u, type(self).__name__, stacklevel=3)
        return u

    def inverted(self, y: FloatArray, u0: float | None, state: State | None) -> FloatArray:
        """Input for outputs `y` that are not empty; `u0` and `state` as of `inverse_response`."""
        check_reached(y, self.output_bounds)
        return inverse_response(self.inverse_begun(y, u0, state), y, self.unreached)

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | None) -> CompiledLaw:
        """The inverse before it moves to the outputs `y`, stepped; `u0` and `state` as of `inverse_response`."""
        return inverse_at_rest(self, float(y[0]), u0) if state is None else self.search_inverse(state)

    def search_inverse(self, state: State, *, terms: float = 0.0) -> CompiledLaw:
        """The inverse of the law in this state by a search on its step; see `hysim.models.inverse_search`."""
        memory = dict(zip(self.initial_names, state[1:], strict=False))
        law = self.with_scalars(memory)  # whose slopes are those from here
        return searched_inverse(law, self._begun(state[0], state)[0], terms=terms)

    def unreached(self, sample: int, y: float, inverse: CompiledLaw) -> str:
        """Message for an output that has no input."""
        return not_reached(sample, y, inverse)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        """The inverse, stepped: in the closed form of its family, or by a search on the law's own step.

        Parameters
        ----------
        u0 : float
            Input at which the law rests [unit of u]; ValueError if the output does not rise or fall through it.
        limits : (float, float)
            Lowest and highest input to which the inverse's copy of the law moves [unit of u].
        sample_time : float
            Time between two samples, for a law that depends on the rate of its input [s].

        Returns
        -------
        CompiledLaw
            ``u = step(parameters, state, y)``, nan where no input has the output y.
        """
        return searched_inverse(self, self.compiled(u0), limits=limits)

    # ------------------------------------------------------------------------------ identification

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box that `hysim.identify` searches, by the declarations in `searched`."""
        return declared_space(self, record, freedom)

    def freed_in_turn(self) -> tuple[Stage, ...]:
        """The `stages` of the family."""
        return self.stages

    def simpler(self) -> Simpler | None:
        """The law that this one `contains`, with the values that both have."""
        return None if self.contains is None else self.contains.of(self.scalars)

    def known_to(self, tolerance: float) -> "Law":
        """The law by its slope, integrated to this share of the range; itself where its step is exact."""
        known = not self.hidden_states or self.tolerance == tolerance
        return self if known else _with_tolerance(type(self), tolerance)(**items(self))

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns in which the output is affine, and the rest of it, shape (n_sets, n_samples, n_columns + 1)."""
        return self.columns_by(self.outputs, parameters, record.u)

    def columns_by(self, outputs: Outputs, parameters: Parameters, u: FloatArray) -> FloatArray:
        """As `regressors`, by a function from parameters and an input to outputs (n_sets, n_samples)."""
        if self.powers and self.columns:
            z, places = outputs({**parameters, **self.memory_only}, u), {name: k for k, name in enumerate(self.columns)}
            columns = np.zeros((*z.shape, len(places) + 1))
            for name, power in self.powers.items():
                column = z if power is None else u**power
                if name in places:
                    columns[..., places[name]] = column
                else:
                    columns[..., -1] += np.reshape({**self.scalars, **parameters}[name], (-1, 1)) * column
            return columns
        zero = {**parameters, **dict.fromkeys(self.columns, 0.0)}
        rest = outputs(zero, u)
        size = _sizes(rest, u)
        with np.errstate(invalid="ignore", over="ignore"):
            added = [(outputs({**zero, name: size}, u) - rest) / size[:, np.newaxis] for name in self.columns]
        slopes = [each.name for each in self.searched if each.affine and each.unit == "y/u"]
        for name in {*slopes} & {*self.columns}:  # a slope that no sample shows has rounding for its column
            column, least = added[self.columns.index(name)], _ROUNDED * float(np.abs(u).max())
            column[np.abs(column).max(axis=1) <= least] = 0.0
        return np.stack([*added, rest], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, FloatArray]:
        """Initial memory with which a periodic record ends as it began, (n_sets,) by name; nan where it diverges.

        One pass through the record contracts the memory; the fixed point is computed by the secant method. Raises
        ValueError if an affine parameter moves the memory: it is not known yet where the others are searched; or if
        the law remembers more than its initial memory.
        """
        if self.further_memory:
            raise ValueError('the memory of this law is more than its initial force: use initial="free" or "rest"')
        names, u = self.initial_names, np.append(record.u, record.u[0])
        turns = record.reversals()
        turns = turns if turns.size < _FEW * len(record) else record.reversals(TOLERANCE)
        corners = u[[0, *turns.tolist(), len(record)]]
        self._check_memory_is_its_own(parameters, corners)

        def through(path: FloatArray) -> PassOf:
            return self._passes(parameters, path)

        n_sets = max(map(np.size, parameters.values()), default=1)
        few, before = 2 * corners.size < u.size, np.zeros((n_sets, len(names)))
        if self.exact_strokes:
            before = np.nan_to_num(through(np.append(0.0, corners))(np.arange(n_sets))(before))
            return dict(zip(names, fixed_point(through(corners), before).T, strict=True))
        if few:
            before = np.nan_to_num(through(np.tile(corners, _AHEAD))(np.arange(n_sets))(before))
        steady = fixed_point(through(u), before, through(corners) if few else None)
        return dict(zip(names, steady.T, strict=True))

    def _check_memory_is_its_own(self, parameters: Parameters, u: FloatArray) -> None:
        """Raise a ValueError if an affine parameter moves the memory along the input `u`."""
        if self.powers:
            return
        others = [name for name in self.columns if name not in self.initial_names]
        affine = {name: self.scalars[name] + k for k, name in enumerate(others, 1)}
        before = np.zeros((1, len(self.initial_names)))
        first, one = of_sets(parameters, np.array([0])), np.array([0])
        if affine and not np.array_equal(
            self._passes(first, u)(one)(before), self._passes({**first, **affine}, u)(one)(before), equal_nan=True
        ):
            raise ValueError(
                f"a {type(self).__name__} has no steady cycle that could be computed, since {' or '.join(affine)} "
                'moves its memory: use initial="free"'
            )

    def _passes(self, parameters: Parameters, u: FloatArray) -> PassOf:
        """Functions from the memory before the input `u` to that after it, (n_sets, n_memory)."""
        tables, inputs = tables_of(type(self).__name__, self.arguments, parameters, u)
        constants, memory = self.pack(self.completed(tables))
        place, step, y = slice(1, 1 + len(self.initial_names)), compiled_step(self.step), np.empty((1, u.size))

        def of(sets: npt.NDArray[np.intp]) -> Pass:
            laws = Packed(constants[sets], memory[sets])

            def passed(z: FloatArray) -> FloatArray:
                laws.memory[:, place] = np.nan_to_num(z, posinf=0.0, neginf=0.0)
                ends = run_each(step, stepping.complete, laws, self.workspace, inputs, y)
                return np.where(np.isfinite(z), ends[:, place], np.nan)

            return passed

        return of

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        """The law with these parameters, one number for each name; the others are its own."""
        return self.with_scalars(parameters)

    # ------------------------------------------------------------------------------ how it is derived

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """Values of the fields that have one by default."""
        named: list[Field[Any]] = [each for each in fields(cls) if each.name not in last_names(cls)]
        values = {each.name: each.default for each in named if each.default is not MISSING}
        made = {each.name: each.default_factory() for each in named if each.default_factory is not MISSING}
        return {each.name: {**values, **made}[each.name] for each in named if each.name in {**values, **made}}

    def outputs(self, parameters: Parameters, u: npt.ArrayLike) -> FloatArray:
        """Outputs (n_sets, n_samples) of laws that are this one where `parameters` does not say otherwise."""
        return self.outputs_of(parameters, u).rows(None)

    def outputs_of(self, parameters: Parameters, u: npt.ArrayLike) -> Batch:
        """As `outputs`, not computed yet; parameters that the constructor would refuse are not refused."""
        return _batch(self, parameters, u)

    def _begun(self, u0: float, state: State | None) -> tuple[CompiledLaw, State]:
        """The law before a first sample at `u0`, or in a state; and the front of its state."""
        size = self.packed[1].size
        if state is not None and len(state) != size:
            raise ValueError(f"the state must hold {size} numbers, got {len(state)}")
        law = self.startable().started(u0)
        if state is not None:
            law.state[:size] = state
        return law, tuple(law.state[:size].tolist())


@lru_cache(maxsize=256)
def _with_tolerance(family: type[Law], tolerance: float) -> type[Law]:
    return type(family.__name__, (family,), {"tolerance": tolerance})


def _first(u: FloatArray) -> float:
    return float(u[0]) if u.size else 0.0


def moving(direction: npt.ArrayLike) -> FloatArray:
    """The direction of an input, its velocity or the sign of it, as an array; ValueError where it is zero."""
    velocity = np.asarray(direction, dtype=float)
    if not velocity.all():
        raise ValueError("direction must not be zero: an input that stands still has two slopes")
    return velocity


def of_sets(parameters: Parameters, sets: npt.NDArray[np.intp]) -> dict[str, Any]:
    """The parameters of some sets; a single value is that of all."""
    return {name: value if np.size(value) == 1 else np.asarray(value)[sets] for name, value in parameters.items()}


def _sizes(rest: FloatArray, u: FloatArray) -> FloatArray:
    """Powers of two (n_sets,), so large that what they add to the outputs `rest` is not lost in their rounding."""
    reach = float(np.abs(u).max()) or 1.0
    output = np.nan_to_num(np.abs(rest).max(axis=1), posinf=0.0)
    least = np.where(output > 0.0, np.maximum(output, 1.0) * max(reach, 1.0 / reach), 0.5)
    return np.asarray(np.exp2(np.frexp(least)[1]))


def _after_first(model: Startable, u0: float) -> CompiledLaw:
    law = model.started(u0)
    with np.errstate(all="ignore"):
        law.step(law.parameters, law.state, u0)
    return law


def _batch(law: Law | type[Law], parameters: Parameters, u: npt.ArrayLike) -> Batch:
    """Laws by their parameters, and their inputs.

    Numbers that are not given are those of the law, at whose input the memories hold, or the defaults of a family,
    which checks all numbers.
    """
    family, defaults, u0 = (law, law.defaults(), None) if isinstance(law, type) else (type(law), law.arguments, law.u0)
    numbers = {name: value for name, value in parameters.items() if name != "u_range"}
    place = {} if numbers.get("u0", u0) is None else {"u0": u0 or 0.0}
    tables, inputs = tables_of(family.__name__, {**defaults, **place}, numbers, u)
    begin = tables.pop("u0", None)
    tables = law.completed(tables)
    if isinstance(law, type):
        law.check(tables)

    def compute(sets: Sets, u: FloatArray, y: FloatArray) -> None:
        own = {name: table[sets] for name, table in tables.items()}
        if begin is None:
            law.rows(own, u, y)
            return
        outputs = np.empty((len(y), y.shape[1] + 1))
        walked = [begin[sets], np.broadcast_to(u, y.shape)]
        law.rows(own, read_only(np.concatenate(walked, axis=1)), outputs)
        y[:] = outputs[:, 1:]

    return Batch(compute, len(next(iter(tables.values()))), inputs, law.order(tables), law.samples_a_thread)


def run_each(step: Step, start: Start, laws: Packed, workspace: int, u: FloatArray, y: FloatArray) -> FloatArray:
    """Outputs of many laws into `y`; returns their memories after the input. See `hysim.kernels.batches`."""
    from hysim.kernels.batches import drive_each  # compiled where it is needed

    parameters, memory = read_only(laws.parameters, finite=False), np.array(laws.memory, dtype=float, order="C")
    with np.errstate(all="ignore"):
        drive_each(pointer(step), pointer(start, START), parameters, memory, workspace, u, y)
    return memory
