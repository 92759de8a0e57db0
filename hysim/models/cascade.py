"""Models one behind the other,  u -> stage 1 -> stage 2 -> ... -> y."""

import math
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.kernels.stepping import one_behind_the_other
from hysim.models._cascade_search import CascadeStructure
from hysim.models._composite import Composite, State, continued, known_slopes
from hysim.models.compiled_step import startable
from hysim.models.inverse_search import searched_inverse
from hysim.models.model import family
from hysim.models.parts import (
    check_parts,
    compiled_law,
    compiled_pair,
    labels,
    response_of,
    self_started,
    startable_pair,
)
from hysim.models.protocols import (
    UNLIMITED,
    CompiledLaw,
    InputFilter,
    Limits,
    Placeable,
    Startable,
    StepwiseInvertible,
    needs_time,
    placed,
)

__all__ = ["Cascade", "CascadeStructure"]


@family
class Cascade(Composite):
    """Models one behind the other; ``first >> second`` is short for it.

    A law in front of linear dynamics is Hammerstein's structure, linear dynamics in front of a law are Wiener's. The
    input of a stage at the samples is the output of the stage before, and each stage takes it between them as it takes
    any input.

    Parameters
    ----------
    stages : tuple of models
        Laws, such as `PrandtlIshlinskii`, and plants that depend on time, such as `TransferFunction`, in their order.

    Raises
    ------
    TypeError
        If a stage is not a model with a response.
    ValueError
        If the cascade is empty.

    Examples
    --------
    >>> import hysim as hs
    >>> stack = hs.BoucWen(feedthrough=1.0, gain=-0.3) >> hs.mode(2.0, 0.1)
    >>> stack.response([0.0, 1.0, 1.0], sample_time=0.5).round(6).tolist()
    [0.0, 0.0, 0.34929]
    """

    stages: tuple[Any, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "stages", check_parts(self.stages, "stages"))

    @classmethod
    def candidates(cls) -> dict[str, Any]:
        """None for `hysim.compare`: a cascade has the stages that it is given."""
        return {}

    @classmethod
    def structure(cls, *stages: Any) -> CascadeStructure:
        """Stages in their order for `hysim.identify` and `hysim.compare`: classes, structures, and models as starts.

        The last stage that is not a transfer function carries the gain; see `hysim.models._cascade_search` for which
        others are identified.

        Examples
        --------
        >>> import numpy as np, hysim as hs
        >>> u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
        >>> true = hs.Play(threshold=0.3, gain=2.0) >> hs.TransferFunction(num=(3.0,), den=(1.0, 3.0))
        >>> rec = hs.Record(u=u, y=true.response(u, 0.1), t=0.1 * np.arange(u.size))
        >>> fit = hs.identify(hs.Cascade.structure(hs.Play, hs.TransferFunction.structure(poles=1, zeros=0)), rec)
        >>> round(fit.estimates["play.gain"], 6), round(fit.estimates["transfer_function.den[1]"], 6)
        (2.0, 3.0)
        """
        return CascadeStructure(stages=stages)

    @property
    def behind_filter(self) -> Any:
        """The cascade without the filters of a noisy input at its front, which inverses leave out."""
        first, *others = self.stages
        if not isinstance(first, InputFilter) or not others:
            return self
        return others[0] if len(others) == 1 else Cascade(stages=tuple(others)).behind_filter

    def inverse_response(self, y: npt.ArrayLike, u0: float | None = None) -> FloatArray:
        """Input that gives the output `y`; see `hysim.Law.inverse_response`. A filter at the front is left out."""
        model = self.behind_filter
        return np.asarray(model.inverse_response(y, u0)) if model is not self else super().inverse_response(y, u0)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        """The inverse at rest at `u0`, stepped; see `hysim.Law.compiled_inverse`."""
        model = self.behind_filter
        if isinstance(model, StepwiseInvertible) and model is not self:
            return model.compiled_inverse(u0, limits, sample_time)
        return searched_inverse(model, CompiledLaw(*model.compiled(u0)), limits=limits)

    @property
    def members(self) -> tuple[Any, ...]:
        """The stages."""
        return self.stages

    def with_members(self, members: tuple[Any, ...]) -> "Cascade":
        return Cascade(stages=members)

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> "Cascade":
        stages, level = [], u0
        for stage in self.stages:
            stages.append(placed(stage, level, u_range))
            known = level is not None and isinstance(stage, Placeable) and not needs_time(stage)
            level = float(stages[-1].response([level])[0]) if known else None
            u_range = u_range if isinstance(stage, InputFilter) else None  # what passes a filter keeps its range
        return Cascade(stages=tuple(stages))

    def response(self, u: npt.ArrayLike, sample_time: float | None = None) -> FloatArray:
        return reduce(lambda v, stage: response_of(stage, v, sample_time), self.stages, read_only(u, "u", ndim=1))

    def advance(
        self, u: npt.ArrayLike, state: State | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, State]:
        signal, ends = read_only(u, "u", ndim=1), []
        states: State = (None,) * len(self.stages) if state is None else state
        if not signal.size:
            return signal, states
        for stage, begin in zip(self.stages, states, strict=True):
            signal, end = continued(stage, signal, sample_time, begin)
            ends.append(end)
        return signal, tuple(ends)

    def signals(self, u: npt.ArrayLike, sample_time: float | None = None) -> dict[str, FloatArray]:
        """Output ``"y"`` and those of the stages by name, such as ``"bouc_wen"``; see `response`."""
        signal, signals = read_only(u, "u", ndim=1), {}
        for label, stage in zip(labels(self.stages), self.stages, strict=True):
            signal = signals[label] = response_of(stage, signal, sample_time)
        return {"y": signal, **signals}

    def compiled(self, u0: float = 0.0, *, sample_time: float | None = None) -> CompiledLaw:
        laws, level = [], u0
        for stage in self.stages:
            laws.append(compiled_law(stage, level, sample_time))
            step, parameters, state = laws[-1]
            level = step(parameters, state.copy(), level)  # at rest it stays
        return reduce(lambda first, second: compiled_pair(one_behind_the_other, first, second), laws)

    def startable(self, sample_time: float | None = None) -> Startable:
        first, *others = (startable(stage, sample_time) for stage in self.stages)
        behind = [self_started(stage) for stage in others]
        return reduce(lambda first, second: startable_pair(one_behind_the_other, first, second), behind, first)

    @property
    def known_slopes(self) -> tuple[float, float]:
        return reduce(_products, known_slopes(self.stages))

    def as_structure(self) -> CascadeStructure:
        """The structure of the same members, those that can be identified as starts."""
        return CascadeStructure(stages=self.stages)


def _products(first: tuple[float, float], second: tuple[float, float]) -> tuple[float, float]:
    """Bounds of the products of numbers between bounds."""
    if not all(map(math.isfinite, (*first, *second))):
        return -math.inf, math.inf
    products = [a * b for a in first for b in second]
    return min(products), max(products)
