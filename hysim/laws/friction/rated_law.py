"""The abstract law of a force that depends on the rate of its input.

A family declares its fields and two steps: one for a sample time, along whose samples the input moves evenly, and one
for the strokes of a structure's element; see `hysim.kernels.friction_rates`. At one sample time it is a `hysim.Law`
with one field more, from which all else is derived.
"""

import functools
from abc import ABC
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, checked, items, last_names, read_only
from hysim.kernels import stepping
from hysim.kernels.friction_rates import N_RATED
from hysim.models.batch import Reduction
from hysim.models.composable import Placed
from hysim.models.law import Advanced, Law, State
from hysim.models.model import not_offered
from hysim.models.parameters import Parameter, declared_space, rate_spans
from hysim.models.protocols import CompiledLaw, Startable, Subject, needed_time, positive_time
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.tables import Tables
from hysim.records import Record

if TYPE_CHECKING:
    from hysim.models.jacobian import Jacobian


@dataclass(frozen=True, kw_only=True, eq=False)
class TimedLaw(Subject, Placed, ABC):
    """A law that depends on the rate of its input, and so on time.

    A family is a subclass under the decorator `hysim.family`.

    Attributes
    ----------
    step : kernel
        ``step(parameters, state, u) -> y`` after an even stroke of one sample, the first parameter; the others are the
        fields but for the initial memory, in their order. The state is the last input and the memory.
    initial, searched, starts, screened
        As of `hysim.Law`; parameters may have the units ``"v"``, the highest speed of the record, and ``"r"``, the
        speed of an output that follows the input.
    at_one_time : type of Law, optional
        What the law at one sample time has beyond its step, such as an inverse.
    """

    step: ClassVar[Any]
    initial: ClassVar[tuple[str, ...]] = ("z0",)
    searched: ClassVar[tuple[Parameter, ...]] = ()
    starts: ClassVar[tuple[Mapping[str, float], ...]] = ()
    screened: ClassVar[int | None] = None
    at_one_time: ClassVar[type[Law] | None] = None
    dynamic: ClassVar[bool] = True

    # ------------------------------------------------------------------------------ what a family may say more

    @classmethod
    def further(cls, tables: Tables) -> int:
        """Numbers of the memory that begin at zero, after those that are fields."""
        return 0

    candidates = not_offered  # friction is no model of an actuator

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """Values of the fields that have one by default, and a sample time."""
        return kind_at_sample_time(cls).defaults()

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> Self:
        """The law with its memory at `u0`; one without an initial memory begins at the first sample of any input."""
        return super().placed(u0 if self.initial else None, u_range)

    # ------------------------------------------------------------------------------ simulation

    def __post_init__(self) -> None:
        self.at_sample_time(1.0)  # which checks the numbers

    def at_sample_time(self, sample_time: float) -> Law:
        """The law for one sample time [s]; ValueError if that is not positive."""
        positive_time(sample_time)
        kind: Any = kind_at_sample_time(type(self))
        law: Law = kind(sample_time=sample_time, **items(self))
        return law

    def response(self, u: npt.ArrayLike, sample_time: float) -> FloatArray:
        """Output y at the samples of an input that moves evenly between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input, which rests before the first sample [unit of u].
        sample_time : float
            Time between two samples [s].

        Returns
        -------
        array, shape (n_samples,)
            [unit of y]. Where the velocity jumps, at each sample, it is that of the stroke which ends there.

        Raises
        ------
        SimulationError, ValueError
            If the output diverges, with the sample; if u is not finite or has not one axis, or sample_time <= 0.
        """
        return self.at_sample_time(sample_time).response(u)

    def advance(self, u: npt.ArrayLike, state: State | None = None, *, sample_time: float | None = None) -> Advanced:
        """Output continued from `state`, last input and memory, and the state after the last sample.

        The bits are those of one uncut input; arguments and errors are those of `response`.
        """
        return self.at_sample_time(needed_time(self, sample_time)).advance(u, state)

    def response_jacobian(self, u: npt.ArrayLike, sample_time: float, names: Iterable[str] | None = None) -> "Jacobian":
        """Derivatives of the response by the numbers of the law; see `hysim.Law.response_jacobian`."""
        return self.at_sample_time(sample_time).response_jacobian(u, tuple(self.scalars) if names is None else names)

    def memory(self, u: npt.ArrayLike, sample_time: float) -> FloatArray:
        """Memory at the samples of `u`, shape (n_samples,), or (n_samples, n_memory) of a tuple; see `response`.

        The first number of a memory that is no field.
        """
        law = self.at_sample_time(sample_time)
        z = law.remembered(u)[:, : max(1, len(law.initial_names))]
        return z if any(isinstance(items(self)[name], tuple) for name in self.initial) else z[:, 0]

    def signals(self, u: npt.ArrayLike, sample_time: float) -> dict[str, FloatArray]:
        """Output ``"y"``, and the memory ``"z"`` of a law that has one, at the samples of `u`; see `response`."""
        remembers = self.at_sample_time(sample_time).packed[1].size > 1
        z = {"z": self.memory(u, sample_time)} if remembers else {}
        return {"y": self.response(u, sample_time), **z}

    def startable(self, sample_time: float | None = None) -> Startable:
        """The law at a sample time [s] as a step that runs from any first input, for exports."""
        return self.at_sample_time(needed_time(self, sample_time)).startable()

    def compiled(self, u0: float = 0.0, *, sample_time: float | None = None) -> CompiledLaw:
        """The law as compiled loops take it, at rest at the input `u0`; ValueError without a sample time [s]."""
        return self.at_sample_time(needed_time(self, sample_time)).compiled(u0)

    @classmethod
    def responses(
        cls,
        parameters: Parameters,
        u: npt.ArrayLike,
        sample_time: float,
        *,
        reduce: Reduction | None = None,
        target: npt.ArrayLike | None = None,
        workers: int | None = None,
    ) -> FloatArray:
        """Outputs of many laws at one sample time [s]; else as `hysim.Law.responses`."""
        positive_time(sample_time)
        sets = {**parameters, "sample_time": sample_time}
        return kind_at_sample_time(cls).responses(sets, u, reduce=reduce, target=target, workers=workers)

    # ------------------------------------------------------------------------------ identification

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box that `hysim.identify` searches; ValueError also if the record has no even time."""
        return declared_space(self, record, freedom, units=rate_spans(record))

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        return self.at_sample_time(record.sample_time).regressors(parameters, record)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        """Initial memory with which a periodic record ends as it began."""
        return dict(self.at_sample_time(record.sample_time).steady(parameters, record))

    def assemble(self, parameters: Mapping[str, float]) -> Self:
        return self.with_scalars(parameters)


@dataclass(frozen=True, kw_only=True, eq=False)
class RatedLaw(TimedLaw):
    """A law that depends on the rate of its input, and may be an element of a structure.

    Attributes
    ----------
    rated_step : kernel
        As `TimedLaw.step`, the stroke being described in the state; see `hysim.kernels.friction_rates`.
    """

    rated_step: ClassVar[Any]

    @property
    def viscosity(self) -> float:
        """Coefficient of the dashpot that the rated step leaves out."""
        return 0.0

    def rated(self) -> Startable:
        """The law as an element of a structure takes it, without the dashpot of `viscosity`.

        Before the first stroke its duration is infinite: the law is at rest, at zero where it has a `u0`.
        """
        law = self.at_sample_time(1.0)
        parameters, memory = law.packed[0], np.array(law.packed[1] if self.u0 is None else law.state_at(0.0))
        state = np.concatenate([memory[:1], np.zeros(N_RATED - 1), memory[1:]])
        state[1] = np.inf
        return Startable(type(self).rated_step, parameters, state, stepping.start)


class AtSampleTime(Law):
    """A rate-dependent law at one sample time; `family` says what it is."""

    family: ClassVar[type[TimedLaw]]

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The box of the family for samples that are the law's sample time apart."""
        times = np.asarray(self.scalars["sample_time"] * np.arange(len(record)), dtype=np.float64)
        return declared_space(self, record, freedom, units=rate_spans(replace(record, t=times)))

    @classmethod
    def initial_memory(cls, tables: Tables, *, further: int = 0) -> FloatArray:
        return super().initial_memory(tables, further=further + cls.family.further(tables))


@functools.cache
def kind_at_sample_time(family: type[TimedLaw]) -> type[Law]:
    """The laws of a family at one sample time: ``sample_time``, then the fields of the family."""
    named = [each for each in fields(cast(Any, family)) if each.name not in last_names(family)]
    defaults = {each.name: each.default for each in named if each.default is not MISSING}
    body = {
        "__module__": family.__module__,
        "__annotations__": {"sample_time": float, **{each.name: each.type for each in named}},
        "__doc__": f"{family.__name__} at one sample time.",
        "sample_time": 1.0,
        **defaults,
        "family": family,
        "step": staticmethod(family.step),
        "initial": family.initial,
        "check": family.check,
        "completed": family.completed,
        "searched": family.searched,
    }
    bases = (AtSampleTime,) if family.at_one_time is None else (family.at_one_time, AtSampleTime)
    return checked(type(f"{family.__name__}AtSampleTime", bases, body))


def curve(speed: npt.ArrayLike, coulomb: float, breakaway: float, velocity: float, exponent: float) -> FloatArray:
    """Friction at steady speeds, Stribeck's curve without a viscous part."""
    ratio = np.abs(read_only(speed, "velocity")) / velocity
    with np.errstate(over="ignore", under="ignore"):
        return np.asarray(coulomb + (breakaway - coulomb) * np.exp(-(ratio**exponent)))
