"""The roles that a model can play, one protocol each; `isinstance` tells whether it plays one.

A verb asks for a role, never for a class: a user's own class that has the methods takes part. A class that inherits a
method and does not offer it sets it to None, which `isinstance` sees.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol, TypeGuard, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_positive_and_finite
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.stages import Simpler, Stage
from hysim.records import Record

Limits = tuple[float, float]
"""Lowest and highest input."""

UNLIMITED: Limits = (-math.inf, math.inf)


class CompiledLaw(NamedTuple):
    """A law, or its inverse, as loops take it: `y = step(parameters, state, u)`, which moves the state in place."""

    step: Callable[[FloatArray, FloatArray, float], float]
    parameters: FloatArray
    state: FloatArray


class Startable(NamedTuple):
    """A model that runs sample by sample from any first input, as exported programs take it.

    ``start(parameters, state, u0)`` completes `state` once; then ``y = step(parameters, state, u)`` has the outputs of
    the model's `response` at the samples of an input that begins with `u0`. Both are kernels of the subset in
    `hysim.kernels`, or functions that close over such.
    """

    step: Callable[[FloatArray, FloatArray, float], float]
    parameters: FloatArray
    state: FloatArray
    start: Callable[[FloatArray, FloatArray, float], None]

    @property
    def law(self) -> CompiledLaw:
        """Step, parameters and state."""
        return CompiledLaw(self.step, self.parameters, self.state)

    def started(self, u0: float) -> CompiledLaw:
        """The step before a first sample at the input `u0`, with a state of its own."""
        state = self.state.copy()
        with np.errstate(all="ignore"):
            self.start(self.parameters, state, float(u0))
        return CompiledLaw(self.step, self.parameters, state)


class CompiledController(NamedTuple):
    """A controller as loops take it: `u = step(parameters, state, reference, measurement)`.

    The state begins with the last command, before the controller's limits.
    """

    step: Callable[[FloatArray, FloatArray, float, float], float]
    parameters: FloatArray
    state: FloatArray


@runtime_checkable
class Responding(Protocol):
    """A model with an output for each input."""

    @property
    def response(self) -> Callable[..., FloatArray]:
        """``response(u)``, or ``response(u, sample_time)`` of a `Dynamic` model."""


@runtime_checkable
class Dynamic(Protocol):
    """A plant whose output depends on time; it says so by `dynamic = True`."""

    dynamic: ClassVar[bool] = True

    def response(self, u: FloatArray, sample_time: float) -> FloatArray:
        """Output at the samples of `u`, shape (n,), taken every `sample_time` [s]."""


@runtime_checkable
class Continuable(Protocol):
    """A model whose response can be continued from a state."""

    @property
    def advance(self) -> Callable[..., tuple[Any, Any]]:
        """``advance(u, state=None)`` returns output and state; a `Dynamic` model also takes ``sample_time=``."""


@runtime_checkable
class Steppable(Protocol):
    """A law that compiled loops take."""

    @property
    def compiled(self) -> Callable[..., CompiledLaw]:
        """``compiled(u0)`` returns the step, its parameters, and the state after a first sample at the input `u0`.

        A `Dynamic` model is at rest at `u0`, and has ``compiled(u0, sample_time=...)``.
        """


@runtime_checkable
class Stepwise(Protocol):
    """A model that runs sample by sample from any first input."""

    def startable(self, sample_time: float | None = None) -> Startable:
        """The step, and the start that its state needs; only what depends on time needs the `sample_time` [s]."""


@runtime_checkable
class Numbered(Protocol):
    """A model whose numbers have names."""

    @property
    def scalars(self) -> Mapping[str, float]:
        """Every number by name."""

    def with_scalars(self, scalars: Mapping[str, float]) -> Any:
        """The model with other numbers, by some of these names; ValueError if the constructor refuses them."""


@runtime_checkable
class Stretched(Protocol):
    """A `Steppable` law that says where in its state the memory is, and between which bounds slope and output lie."""

    @property
    def memory_places(self) -> tuple[tuple[int, int], ...]:
        """First place and length of each stretch of the state that is memory; the rest is room for work."""

    @property
    def known_slopes(self) -> tuple[float, float]:
        """Lowest and highest slope dy/du over every input, infinite where they are not known."""

    @property
    def output_bounds(self) -> tuple[float, float]:
        """Lowest and highest output that inputs lead to, infinite where there is no limit or it is not known."""


@runtime_checkable
class Placeable(Protocol):
    """A model whose initial memory holds at an input, and that knows the range of inputs of its record."""

    @property
    def u0(self) -> float | None:
        """Input at which the initial memory holds; None for the first sample of any input."""

    @property
    def u_range(self) -> tuple[float, ...] | None:
        """Lowest and highest input that the model was identified on; None if unknown."""

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> Any:
        """The model with the memory at the input `u0`, and this range."""


@runtime_checkable
class Containing(Protocol):
    """A plant around a law, of several that of the input ``"u"``, for which it multiplies this by `input_gain`."""

    @property
    def input_gain(self) -> float: ...
    def with_law(self, changed: Callable[[Any], Any]) -> Any: ...


def with_law(model: Any, changed: Callable[[Any], Any]) -> Any:
    return model.with_law(changed) if isinstance(model, Containing) else changed(model)


@runtime_checkable
class Standing(Protocol):
    """A model, or a controller around one, that begins at a command of its own."""

    @property
    def u0(self) -> float | None:
        """The command; None for any."""


def standing(thing: Any, u0: float | None = None) -> float:
    """The command at which something begins: `u0` if it is given, else its own, else zero."""
    own = thing.u0 if u0 is None and isinstance(thing, Standing) else u0
    return 0.0 if own is None else own


def first_input(model: Any) -> float | None:
    """Input at which the memory of a model holds; None for the first sample of any input, or without such a memory."""
    return model.u0 if isinstance(model, Placeable) else None


def input_range(model: Any) -> tuple[float, ...] | None:
    """Lowest and highest input of the record that a model was identified on; None if unknown."""
    return model.u_range if isinstance(model, Placeable) else None


def placed(model: Any, u0: float | None, u_range: tuple[float, ...] | None = None) -> Any:
    """A model with its memory at the input `u0`; itself where it has no such input."""
    return model.placed(u0, u_range) if isinstance(model, Placeable) and not isinstance(model, type) else model


@runtime_checkable
class Sampled(Protocol):
    """A law that depends on the sample time, and is a `Steppable` law at each."""

    def at(self, sample_time: float) -> Steppable:
        """The law at one sample time [s]."""


@runtime_checkable
class Timed(Protocol):
    """A model that depends on time, and is a law of a step at each sample time."""

    def at_sample_time(self, sample_time: float) -> Any:
        """The law for one sample time [s]; ValueError if that is not positive."""


@runtime_checkable
class Remembering(Protocol):
    """A law whose memory is a number, or a tuple of them, at each sample."""

    def memory(self, u: FloatArray) -> FloatArray:
        """Memory at the samples of `u`, shape (n,) or (n, n_memory)."""


@runtime_checkable
class Invertible(Protocol):
    """A law whose input can be computed from its output."""

    @property
    def inverse_response(self) -> Callable[..., FloatArray]:
        """``inverse_response(y, u0=None)``, the input that gives the output `y`."""


@runtime_checkable
class StepwiseInvertible(Protocol):
    """A law whose inverse runs sample by sample."""

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        """The inverse of the law at rest at `u0`; see `hysim.models.inverse_search`."""


@runtime_checkable
class OfFamily(Protocol):
    """A structure whose `law` is the family that it makes models of."""

    law: type


@runtime_checkable
class Structured(Protocol):
    """A class whose models may be identified by a structure."""

    structure: Any


@runtime_checkable
class Offering(Protocol):
    """A family that says what `hysim.compare` tries of it."""

    @classmethod
    def candidates(cls) -> Mapping[str, Any]:
        """Names to classes, models or structures; empty by default. The last stands for a class without defaults."""


class Variant(NamedTuple):
    """A choice that a family leaves to the record: the family with it, and the choice in words.

    One that is not `offered` is searched only as the start of those behind it, which contain it.
    """

    family: Any
    words: str
    offered: bool = True


@runtime_checkable
class Identifiable(Protocol):
    """A subject of `identify`: a model class, a model as the start, or a structure."""

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """Declare the box for `record`."""

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns in which the output is affine, shape (n_sets, n_samples, n_columns + 1).

        Output = columns[..., :-1] @ (the parameters named by `SearchSpace.columns`) + columns[..., -1].
        A set that leaves the finite numbers has columns that are not finite.
        """

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        """Build the model from the user's parameters."""

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """The state at the first sample of a record that repeats itself, by name.

        Raises ValueError if it cannot be computed.
        """
        raise ValueError(f'a {type(self).__name__} has no steady cycle that could be computed: use initial="free"')

    def notes(self, record: Record, model: Any) -> tuple[str, ...]:
        """Remarks on the identified model, as phrases."""
        return ()


class Searched:
    """The choices in a search that a subject of `identify` may leave open; by default nothing is open.

    Attributes
    ----------
    runs_as_searched : bool
        Whether a record is all that its model needs; a structure may know more, such as filters of the output.
    may_depend : bool
        Whether its parameters may depend on channels.
    is_parted : bool
        Whether it has a law, and parts before and after it that move in time and are searched in turn; what such a
        search asks of it is said by `hysim.plants.actuator_structure`.
    """

    runs_as_searched: ClassVar[bool] = True
    may_depend: ClassVar[bool] = True
    is_parted: ClassVar[bool] = False

    def as_records(self, records: Any) -> Any:
        """Records of a kind of its own as records of one output; other objects are returned unchanged."""
        return records

    def standing(self, model: Any, record: Record) -> Any:
        """An identified model as it stands at the first sample of a record; by default as it is."""
        return model

    def freed_in_turn(self) -> tuple[Stage, ...]:
        """Parameters that a search frees in turn; see `hysim.models.stages`."""
        return ()

    def simpler(self) -> Simpler | None:
        """The simpler family whose optimum starts the search."""
        return None

    def known_to(self, tolerance: float) -> Any:
        """A subject with the same search box and the same outputs to a share of the range, if that is cheaper."""
        return self

    def assumed_states(self, record: Record) -> tuple[str, ...]:
        """Values of `initial` among which the record decides, the simplest first; by default it decides nothing."""
        return ()

    def variants(self) -> tuple[Variant, ...]:
        """Further choices that it decides, the simplest first; the last one contains all others."""
        return ()

    def in_one_step(self) -> Any | None:
        """A fit in one step (`Direct`) that may predict better than a search; it has `parts` to be left out."""
        return None

    def longer_past(self) -> Any | None:
        """The family whose free state at the first sample has one number more, if it has one."""
        return None

    def forgotten(self, record: Record, space: SearchSpace) -> int:
        """The first sample from which on neither a coordinate of `space` nor a state or variant has an effect.

        It is the number of samples where there is none.
        """
        return len(record)


class Subject(Searched, Identifiable):
    """Base class of what is made for `identify`: it has the methods that have a body."""


@runtime_checkable
class LinearStage(Protocol):
    """A linear plant through which many inputs pass at once: one that is known, or one whose gain at rest is one."""

    initial_state: tuple[float, ...]

    def filtered_sets(self, parameters: Parameters, signals: FloatArray, sample_time: float) -> FloatArray:
        """Outputs (n_sets, n_signals, n_samples) from rest for inputs of this shape, or (1, n_signals, n_samples)."""

    def free_responses(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns of the initial state, shape (n_sets, n_samples, n_states)."""


@runtime_checkable
class LinearStructure(Identifiable, Protocol):
    """A linear plant to be identified, whose gain another stage of a cascade may carry."""

    def with_unit_gain(self) -> Any:
        """The structure with the gain at rest one, as a `LinearStage` with a `search_space`."""


class Smoother(NamedTuple):
    """Outputs at the `samples` that a fit takes (n,), linear in the measured ones: R R' W y.

    `rows` R are (n, k), the `weights` W (n,).
    """

    samples: npt.NDArray[np.intp]
    rows: FloatArray
    weights: FloatArray

    @property
    def degrees_of_freedom(self) -> float:
        """Trace of R R' W."""
        return float(np.sum(self.weights[:, np.newaxis] * self.rows**2))

    @property
    def gram(self) -> FloatArray:
        """R' W R; for noise of standard deviation 1 the outputs have the covariance R (R' W R) R'."""
        return np.asarray(self.rows.T @ (self.weights[:, np.newaxis] * self.rows))

    def spread(self, n_samples: int) -> FloatArray:
        """Standard errors of the outputs for noise of standard deviation 1, linear between the fitted samples."""
        own = np.sqrt(np.maximum(np.sum((self.rows @ self.gram) * self.rows, axis=1), 0.0))
        return np.asarray(np.interp(np.arange(n_samples), self.samples, own))

    def left_out(self, residual: FloatArray, folds: Sequence[npt.NDArray[np.intp]]) -> FloatArray:
        """Errors (n_samples,) of predictions by fits of the same smoothness without each fold; nan elsewhere.

        `residual` (n_samples,) is the fit's; the errors of a fold are (I - H)^-1 times it, H the fold's part of R R' W.
        """
        errors, root = np.full(residual.size, np.nan), np.sqrt(self.weights)
        for fold in folds:
            own = np.flatnonzero(np.isin(self.samples, fold) & (root > 0.0))
            rows = root[own, np.newaxis] * self.rows[own]
            rest = np.linalg.solve(np.eye(own.size) - rows @ rows.T, root[own] * residual[self.samples[own]])
            errors[self.samples[own]] = rest / root[own]
        return errors


class DirectFit(NamedTuple):
    """A model that was fitted in one step.

    The `models`, one for each record; their effective number of parameters, `degrees_of_freedom`; at each sample the
    standard error of the output for noise of standard deviation 1, `spread` (n,); what was fitted, in `words`; the
    `smoother`, if the fit is linear in the outputs and chooses nothing anew where samples are left out; and the family
    of the next smoother fit, if the smoothness may be chosen.
    """

    models: tuple[Any, ...]
    degrees_of_freedom: float
    spread: FloatArray
    words: str = ""
    smoother: Smoother | None = None
    smoother_family: "Direct | None" = None


@runtime_checkable
class Direct(Protocol):
    """A family that is fitted in one step, not searched for: `identify` takes it too."""

    def fitted(self, records: Sequence[Record], weights: FloatArray | None = None) -> DirectFit:
        """The fit to the outputs of records, with a weight for each of their samples (n,)."""


def needs_time(plant: Any) -> TypeGuard[Dynamic]:
    """Whether the output of a plant depends on time."""
    return isinstance(plant, Dynamic) and plant.dynamic


def needed_time(plant: Any, sample_time: float | None) -> float:
    """The sample time [s], which a plant that moves in time cannot do without; ValueError if it is not given."""
    if sample_time is None:
        raise ValueError(f"a {type(plant).__name__} moves in time: give sample_time")
    return sample_time


def check_continued(step: float, state_step: float) -> None:
    """Refuse a state whose numbers are of other steps [s]: their units and dead times depend on them."""
    if not math.isclose(step, state_step):  # those of two pieces of a record differ by rounding
        raise ValueError(f"the state is of steps of {state_step:g} s, which it must be continued with, got {step:g} s")


def positive_time(sample_time: float) -> float:
    """A sample time [s]; ValueError if it is not positive and finite, TypeError if it is not one number."""
    if np.ndim(sample_time):
        raise TypeError(f"sample_time must be one number [s], got an array of shape {np.shape(sample_time)}")
    check_positive_and_finite(sample_time=sample_time)
    return sample_time


def law_at(law: Any, sample_time: float) -> Any:
    """A law as it is stepped at a sample time [s]: what its ``at`` returns, or the law itself without ``at``."""
    return law.at(sample_time) if isinstance(law, Sampled) else law


class Doubt(NamedTuple):
    """A parameter that records may not determine, and what is to be done then.

    It is not determined if its standard error is above `largest` or unknown; the plant is then searched `without` it.
    """

    name: str
    largest: float
    without: Any
