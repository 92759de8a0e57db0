"""The models in results: what a verb that takes a model does with a fit."""

from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class Result(Protocol):
    """A result of `identify` or `discover`: a model with its number of parameters."""

    @property
    def model(self) -> Any: ...
    @property
    def n_parameters(self) -> int: ...


@runtime_checkable
class Named(Protocol):
    name: Any


def model_of(thing: Any) -> Any:
    """The model of a result, or another value as it is; ValueError if a result has no model, TypeError for a class."""
    if isinstance(thing, type):
        raise TypeError(f"an instance is expected, got the class {thing.__name__}: give it its parameters first")
    return model_or_class(thing)


def model_or_class(thing: Any) -> Any:
    """As `model_of`, where a class stands for its family."""
    if not isinstance(thing, Result):
        return thing
    if thing.model is None:
        raise ValueError(f"this {type(thing).__name__} has no model: hysim has no family of its law")
    return thing.model
