"""What sums and cascades share: names of their parts, parts that are stepped, and laws that are inverted."""

import functools
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.errors import SimulationError
from hysim.kernels import composed as kernels
from hysim.kernels.stepping import Step
from hysim.models.protocols import CompiledLaw, OfFamily, Responding, Steppable, needs_time

_REACH, _WIDER = 1e-6, 16.0  # how far at most the output is looked at to either side of the first input; the ratio
_SHORTEST = 2.0**-46  # of the first input, or this number
_NEXT_TO_NOTHING = 1e-150
_HIDDEN, _FARTHEST = 2.0**-44, 1e150  # part of the output by which rounding may hide a rise: it is then sought further
_LINEAR = 0.1  # part by which rises over once, twice and four times a length are no multiples of each other


def labels(parts: Sequence[Any]) -> tuple[str, ...]:
    """The parts' families in small letters, with numbers where one occurs more than once."""
    names = [_label(part) for part in parts]
    return tuple(f"{name}[{names[:k].count(name)}]" if names.count(name) > 1 else name for k, name in enumerate(names))


def _label(part: Any) -> str:
    kind = part if isinstance(part, type) else part.law if isinstance(part, OfFamily) else type(part)
    family = kind.__name__.removesuffix("Structure")
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", family).lower()


def check_parts(parts: Any, what: str) -> tuple[Any, ...]:
    """The parts as a tuple, each with a response."""
    members = checked_tuple(parts, what)
    for member in members:
        if isinstance(member, type) or not isinstance(member, Responding):
            name = member.__name__ if isinstance(member, type) else type(member).__name__
            raise TypeError(
                f"{what} must hold models with a response, got {name} (classes and structures go to `structure`)"
            )
    return members


def checked_tuple(parts: Any, what: str) -> tuple[Any, ...]:
    """The parts as a tuple that is not empty."""
    if not isinstance(parts, (tuple, list)):
        raise TypeError(f"{what} must be a tuple of models, got {type(parts).__name__}")
    if not parts:
        raise ValueError(f"{what} must hold at least one model")
    return tuple(parts)


def response_of(part: Any, u: FloatArray, sample_time: float | None) -> FloatArray:
    """Output of a part from its first sample on."""
    return np.asarray(part.response(u, given(part, sample_time)) if needs_time(part) else part.response(u))


def given(part: Any, sample_time: float | None) -> float:
    """The sample time, which a part that moves in time cannot do without."""
    if sample_time is None:
        raise ValueError(f"a {type(part).__name__} moves in time: give sample_time")
    return sample_time


def compiled_pair(join: Callable[[Step, Step], Step], first: CompiledLaw, second: CompiledLaw) -> CompiledLaw:
    """Two laws as one, joined by a function of `hysim.kernels.composed`."""
    sizes = [float(first.parameters.size), float(first.state.size)]
    return CompiledLaw(
        _joined(join, first.step, second.step),
        read_only(np.concatenate([sizes, first.parameters, second.parameters]), finite=False),
        np.concatenate([first.state, second.state]),
    )


@functools.lru_cache(maxsize=256)
def _joined(join: Callable[[Step, Step], Step], first: Step, second: Step) -> Step:
    return join(first, second)


def compiled_law(part: Any, u0: float) -> CompiledLaw:
    """A part as compiled loops take it."""
    if needs_time(part) or not isinstance(part, Steppable):
        why = "it moves in time" if needs_time(part) else "it has no compiled step"
        raise TypeError(f"a {type(part).__name__} cannot be stepped as a law: {why}")
    return CompiledLaw(*part.compiled(u0))


def inverse_response(law: Any, y: npt.ArrayLike, u0: float | None) -> FloatArray:
    """Input for the output `y` of a law with a compiled step; see `Composite.inverse_response`."""
    outputs = read_only(y, "y", ndim=1)
    if law.dynamic:
        raise ValueError("what moves in time has no inverse that depends on the output alone")
    if not outputs.size:
        return outputs
    here = _first_input(law, float(outputs[0])) if u0 is None else float(u0)
    compiled = law.compiled(here)
    trial = np.empty_like(compiled.state)

    def output(u: float) -> float:
        trial[:] = compiled.state
        return float(compiled.step(compiled.parameters, trial, u))

    u = np.empty(outputs.size)
    with np.errstate(all="ignore"):  # a bracket may reach where a memory overflows
        reached, slope = output(here), _first_slope(output, here)
        if slope == 0.0:
            raise ValueError(f"the law has no inverse: its output does not rise or fall through u = {here:g}")
        if u0 is None:
            reached = float(outputs[0])
        step, parameters, state = compiled
        lost = kernels.inverse(step, parameters, state, trial, here, reached, slope, outputs, u)
    if lost >= 0:
        raise SimulationError(
            f"the law has no inverse at sample {lost} (y = {outputs[lost]:g}): the output does not reach it, or "
            "turns on the way"
        )
    return u


def _first_slope(output: Callable[[float], float], here: float) -> float:
    """Slope of the output at the input `here`, zero where it does not rise or fall through it.

    The law has a length of its own, on which its output may turn, and rounding hides shorter rises. So the slope is
    that on the shortest length on which the output is seen to be linear on both sides.
    """
    reached, fallback, highest = output(here), 0.0, 0.0
    reach = max(_SHORTEST * abs(here), _NEXT_TO_NOTHING)
    while reach < _REACH * (1.0 + abs(here)) or (highest < _HIDDEN * abs(reached) and reach < _FARTHEST):
        lengths = reach * np.array([1.0, 2.0, 4.0])
        ends = here + np.array([lengths, -lengths])
        rises = np.array([[output(u) for u in side] for side in ends.tolist()]) - reached
        slopes = rises / (ends - here)
        if 0.0 < slopes[0, 0] * slopes[1, 0] < np.inf:
            fallback = slopes[0, 0]
            if (np.abs(slopes / slopes[:, :1] - 1.0) < _LINEAR).all():
                return float(slopes[0, 0])
        elif fallback == 0.0 and np.isfinite(slopes[:, 0]).sum() == 1:  # the memory escapes at once on the other side
            fallback = float(slopes[np.isfinite(slopes[:, 0]), 0][0])
        highest = float(np.abs(rises).max())
        reach *= _WIDER
    return float(fallback)


def _first_input(law: Any, y: float) -> float:
    """The first input whose output is `y`, found from zero."""
    from scipy.optimize import brentq

    def error(u: float) -> float:
        return float(law.response([u])[0]) - y

    if error(0.0) == 0.0:
        return 0.0
    reach = 1e-6
    while reach < 1e150:
        for end in (reach, -reach):
            if error(end) * error(0.0) <= 0.0:
                return float(brentq(error, 0.0, end, xtol=1e-300, rtol=4.0 * np.finfo(float).eps))
        reach *= 2.0
    raise ValueError("the first output does not tell the first input: give u0")


def own(parameters: Mapping[str, Any], label: str) -> dict[str, Any]:
    """The parameters of one part, under the names that it gives them."""
    return {name[len(label) + 1 :]: value for name, value in parameters.items() if name.startswith(f"{label}.")}
