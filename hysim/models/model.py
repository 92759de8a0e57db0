"""What every model shares: the `model` decorator, the registry of families, and the protocols.

A model is a specification. It is frozen and keyword-only, its numbers are finite floats, and it is
compared by value. Evolving state is separate: it is passed in and handed back.
"""

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import fields
from typing import Any, ClassVar, NamedTuple, Protocol, TypeGuard, TypeVar, dataclass_transform

import numpy as np

from hysim._frozen import FloatArray, checked
from hysim._words import shown, value_in_words, words, wrapped

T = TypeVar("T")

FAMILIES: dict[str, type] = {}


@dataclass_transform(kw_only_default=True, frozen_default=True)
def model(cls: type[T]) -> type[T]:
    """Make `cls` a frozen model, and enter it into the registry of families under its name."""
    specification = checked(cls)
    specification.__str__ = _in_words  # type: ignore[method-assign]
    FAMILIES[cls.__name__] = specification
    return shown(specification)


def _in_words(self: Any) -> str:
    """Parameters by name; the models among them a line each."""
    name = type(self).__name__
    plain: list[str] = []
    inside: dict[str, str] = {}
    for field in fields(self):
        value = getattr(self, field.name)
        if models := _models_in(field.name, value):
            inside |= {place: in_brief(each) for place, each in models.items()}
        elif value is not None:
            plain.append(f"{field.name} = {value_in_words(value)}")
    if inside:
        return words([name, wrapped(plain)], inside)
    return words([wrapped(plain, most=9, first=f"{name}: ") or name])


def in_brief(value: Any) -> str:
    """A model in one line: its family, and the parameters that are not as they are by default."""
    if not _is_model(value):
        return type(value).__name__
    given = {field.name: getattr(value, field.name) for field in fields(value)}
    defaults = {field.name: field.default for field in fields(value)}
    told = [
        f"{name} = {in_brief(each) if _is_model(each) else value_in_words(each)}"
        for name, each in given.items()
        if isinstance(each, np.ndarray) or each != defaults[name]
    ]
    return f"{type(value).__name__} ({', '.join(told)})" if told else type(value).__name__


def _is_model(value: Any) -> bool:
    return FAMILIES.get(type(value).__name__) is type(value)


def _models_in(name: str, value: Any) -> dict[str, Any]:
    """The models that a parameter holds, by their places."""
    members = {f"{name}[{k}]": each for k, each in enumerate(value)} if isinstance(value, tuple) else {name: value}
    return {place: each for place, each in members.items() if _is_model(each)}


def every_family() -> dict[str, type]:
    """The registry after every public module of models has entered its families."""
    from hysim import models

    for module in pkgutil.iter_modules(models.__path__):
        if not module.name.startswith("_"):
            importlib.import_module(f"{models.__name__}.{module.name}")
    return FAMILIES


class CompiledLaw(NamedTuple):
    """A law as loops take it: `y = step(parameters, state, u)`, where the state moves along in place."""

    step: Callable[[FloatArray, FloatArray, float], float]
    parameters: FloatArray
    state: FloatArray


class CompiledController(NamedTuple):
    """A controller as loops take it: `u = step(parameters, state, reference, measurement)`.

    The state begins with the last command, before the controller's limits.
    """

    step: Callable[[FloatArray, FloatArray, float, float], float]
    parameters: FloatArray
    state: FloatArray


class Dynamic(Protocol):
    """A plant whose output depends on time; it says so by `dynamic = True`."""

    dynamic: ClassVar[bool] = True

    def response(self, u: FloatArray, sample_time: float) -> FloatArray:
        """Output at the samples of `u`, shape (n,), taken every `sample_time`."""
        ...


def needs_time(plant: Any) -> TypeGuard[Dynamic]:
    """Whether a plant is `Dynamic`."""
    return bool(getattr(plant, "dynamic", False))


def law_at(law: Any, sample_time: float) -> Any:
    """A law as it is stepped at a sample time [s]: itself, or where it depends on time what its ``at`` gives."""
    at = getattr(law, "at", None)
    return law if at is None else at(sample_time)
