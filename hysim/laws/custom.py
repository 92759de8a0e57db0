"""A law of one's own: a scalar function ``y = step(parameters, state, u)``, compiled once, for every verb and loop."""

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, checked, read_only
from hysim.models.batch import Reduction
from hysim.models.compiled_step import compiled_start, compiled_step
from hysim.models.law import Law, Packed, run_each
from hysim.models.parameters import Parameter, declared_space
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.tables import Tables
from hysim.records import Record


@checked
class CustomLaw(Law):
    """A law by a scalar function of one's own.

    Parameters
    ----------
    step : callable
        ``step(parameters, state, u) -> y``, a plain function or one that numba has compiled; it is compiled anew for
        the loops' own types: scalars and `math`, no allocation, no exceptions; nan says that the law has diverged.
        ``state[0]`` is the last input, which the function must move to `u`; the initial values of `state` follow. At
        the first sample the last input is that sample itself.
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
    TypeError, ValueError
        If `step` takes other arguments or does not compile to one number; if a name is given twice or is unknown, or a
        number is not finite.

    Examples
    --------
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

    step: Callable[[Any, Any, float], float]  # type: ignore[misc]
    parameters: Mapping[str, float] = field(default_factory=dict)
    state: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    linear: tuple[str, ...] = ()
    scratch: int = 0

    def __post_init__(self) -> None:
        for what, named in (("parameters", self.parameters), ("state", self.state)):
            values = {name: float(read_only(value, f"{what}[{name!r}]", ndim=0)) for name, value in named.items()}
            object.__setattr__(self, what, MappingProxyType(values))
        if not self.parameters:
            raise ValueError("parameters must name at least one parameter")
        if both := set(self.parameters) & set(self.state):
            raise ValueError(f"{sorted(both)[0]!r} names a parameter and an initial value")
        object.__setattr__(self, "linear", tuple(self.linear))
        for what, names, known in (("linear", self.linear, self.parameters), ("bounds", self.bounds, self.arguments)):
            if unknown := [name for name in names if name not in known]:
                raise ValueError(f"{what} names {unknown[0]!r}; expected one of {', '.join(known)}")
        compiled_step(self.step)

    @property
    def arguments(self) -> dict[str, Any]:
        """Parameters and initial values by name."""
        return {**self.parameters, **self.state}

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """Empty: its numbers have no defaults."""
        return {}

    @property
    def columns(self) -> tuple[str, ...]:
        return self.linear

    @property
    def initial(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the initial memory."""
        return tuple(self.state)

    def pack(self, tables: Tables) -> Packed:  # type: ignore[override]
        """The parameters in their order, and the memory followed by the scratch."""
        constants = np.concatenate([tables[name] for name in self.parameters], axis=1)
        scratch = np.zeros((len(constants), self.scratch))
        memory = [np.zeros((len(constants), 1)), *(tables[name] for name in self.state), scratch]
        return Packed(constants, np.concatenate(memory, axis=1))

    def rows(self, tables: Tables, u: FloatArray, y: FloatArray) -> None:  # type: ignore[override]
        run_each(compiled_step(self.step), compiled_start(self.start), self.pack(tables), 0, u, y)

    def responses(  # type: ignore[override]
        self,
        parameters: Parameters,
        u: npt.ArrayLike,
        *,
        reduce: Reduction | None = None,
        target: npt.ArrayLike | None = None,
        workers: int | None = None,
    ) -> FloatArray:
        """As `Law.responses`, of laws that are this one where `parameters` does not say otherwise."""
        return self.outputs_of(parameters, u).result(reduce, target, workers)

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        boxes = {**self.bounds, **freedom.bounds}
        searched = [
            Parameter(name, *boxes[name], log=boxes[name][0] > 0.0, physical=(True, True))
            for name in boxes
            if name not in self.linear
        ]
        searched += [Parameter(name, affine=True) for name in self.linear]
        return declared_space(self, record, freedom, searched=searched)

    def with_scalars(self, scalars: Mapping[str, float]) -> "CustomLaw":
        return replace(
            self,
            parameters={name: scalars.get(name, value) for name, value in self.parameters.items()},
            state={name: scalars.get(name, value) for name, value in self.state.items()},
        )
