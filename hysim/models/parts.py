"""Names and compiled steps of the parts of sums and cascades."""

import functools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels.stepping import Start, Step, complete, paired, self_starting, started_both
from hysim.models.protocols import CompiledLaw, OfFamily, Responding, Startable, Steppable, needed_time, needs_time
from hysim.models.search_space import Freedom


def labels(parts: Sequence[Any]) -> tuple[str, ...]:
    """The parts' families in small letters, with numbers where one occurs more than once."""
    names = [_label(part) for part in parts]
    return tuple(f"{name}[{names[:k].count(name)}]" if names.count(name) > 1 else name for k, name in enumerate(names))


def labelled(parts: Sequence[Any]) -> dict[str, Any]:
    """The parts by their `labels`."""
    return dict(zip(labels(parts), parts, strict=True))


def exchanged(parts: Sequence[Any], others: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(others.get(label, part) for label, part in labelled(parts).items())


def _label(part: Any) -> str:
    kind = part if isinstance(part, type) else part.law if isinstance(part, OfFamily) else type(part)
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind.__name__.removesuffix("Structure")).lower()


def check_parts(parts: Any, what: str) -> tuple[Any, ...]:
    members = checked_tuple(parts, what)
    for member in members:
        if isinstance(member, type) or not isinstance(member, Responding):
            name = member.__name__ if isinstance(member, type) else type(member).__name__
            raise TypeError(
                f"{what} must hold models with a response, got {name} (classes and structures go to `structure`)"
            )
    return members


def checked_tuple(parts: Any, what: str) -> tuple[Any, ...]:
    if not isinstance(parts, (tuple, list)):
        raise TypeError(f"{what} must be a tuple of models, got {type(parts).__name__}")
    if not parts:
        raise ValueError(f"{what} must hold at least one model")
    return tuple(parts)


def response_of(part: Any, u: FloatArray, sample_time: float | None) -> FloatArray:
    return np.asarray(part.response(u, needed_time(part, sample_time)) if needs_time(part) else part.response(u))


def compiled_pair(join: Callable[..., float], first: CompiledLaw, second: CompiledLaw) -> CompiledLaw:
    sizes = [float(first.parameters.size), float(first.state.size)]
    return CompiledLaw(
        _paired(join, first.step, second.step),
        read_only(np.concatenate([sizes, first.parameters, second.parameters]), finite=False),
        np.concatenate([first.state, second.state]),
    )


def startable_pair(join: Callable[..., float], first: Startable, second: Startable) -> Startable:
    """As `compiled_pair`, of laws that start at the same input."""
    return Startable(*compiled_pair(join, first.law, second.law), _joined(started_both, first.start, second.start))


def self_started(law: Startable) -> Startable:
    """The law as one that learns its first input by its first step."""
    if law.start is complete:
        return law
    return law._replace(
        step=_joined(self_starting, law.step, law.start), state=np.append(law.state, 0.0), start=complete
    )


_Kernel = TypeVar("_Kernel", Step, Start)
_paired = functools.lru_cache(maxsize=256)(paired)


@functools.lru_cache(maxsize=256)
def _joined(join: Callable[[Any, Any], _Kernel], first: Step | Start, second: Step | Start) -> _Kernel:
    return join(first, second)


def compiled_law(part: Any, u0: float, sample_time: float | None) -> CompiledLaw:
    if not isinstance(part, Steppable):
        raise TypeError(f"a {type(part).__name__} cannot be stepped as a law: it has no compiled step")
    time = {"sample_time": needed_time(part, sample_time)} if needs_time(part) else {}
    return CompiledLaw(*part.compiled(u0, **time))


def own(parameters: Mapping[str, Any], label: str) -> dict[str, Any]:
    return {name[len(label) + 1 :]: value for name, value in parameters.items() if name.startswith(f"{label}.")}


def share_of(freedom: Freedom, label: str) -> Freedom:
    """The user's wishes about the parameters of one part."""
    free = tuple(own(dict.fromkeys(freedom.free), label))
    return replace(freedom, fixed=own(freedom.fixed, label), free=free, bounds=own(freedom.bounds, label))
