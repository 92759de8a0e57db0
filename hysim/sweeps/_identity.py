"""By what two studies are known to be the same: the source of the task, the tasks, the seed, the version."""

import dataclasses
import hashlib
import inspect
import pickle
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from hysim._release import __version__
from hysim.sweeps._space import Space

_PLAIN = (str, bytes, int, float, complex, type(None), type(...), np.generic)


def identity(task: Callable[..., Any], space: Space, seed: int) -> dict[str, str]:
    """What must not change between two calls that share a store, as short texts that are compared."""
    names = ", ".join(space.columns)
    return {
        "task": _digest(inspect.unwrap(task)),
        "space": f"{space.n_tasks} tasks of {names} ({_digest(dict(space.columns))})",
        "seed": str(seed),
        "hysim": __version__,
    }


def _digest(value: Any) -> str:
    seal = hashlib.sha256()
    for part in _parts(value, ()):
        seal.update(len(part).to_bytes(8, "little") + part)
    return seal.hexdigest()[:16]


def _parts(value: Any, above: tuple[Any, ...]) -> Iterator[bytes]:
    """What a value is, in bytes that are the same in every process; `above` are the functions that it is bound to."""
    if isinstance(value, (FunctionType, CodeType)) and any(value is one for one in above):
        yield b"itself"
    elif isinstance(value, FunctionType):
        yield from _function_parts(value, (*above, value))
    elif isinstance(value, np.ndarray) and value.dtype != object:
        yield from (str(value.dtype).encode(), str(value.shape).encode(), np.ascontiguousarray(value).tobytes())
    elif isinstance(value, _PLAIN):
        yield repr(value).encode()
    elif isinstance(value, (type, ModuleType)):
        yield f"{getattr(value, '__module__', '')}.{value.__name__}".encode()
    elif (members := _members(value)) is not None:
        yield str(len(members)).encode()
        for member in members:
            yield from _parts(member, above)
    else:
        yield from (repr(type(value)).encode(), _pickled(value))


def _members(value: Any) -> list[Any] | None:
    """Of what a value consists, in an order of its own; None if it does not say."""
    if isinstance(value, (list, tuple)):
        return [*value]
    if isinstance(value, Mapping):
        return [each for name in sorted(value, key=repr) for each in (name, value[name])]
    if isinstance(value, (set, frozenset)):
        return sorted(value, key=repr)
    if isinstance(value, np.ndarray):
        return [value.shape, *value.ravel().tolist()]
    if isinstance(value, partial):
        return [value.func, value.args, value.keywords]
    if isinstance(value, MethodType):
        return [value.__func__, value.__self__]
    if isinstance(value, CodeType):
        return [value.co_code, value.co_names, value.co_varnames, value.co_consts]
    if dataclasses.is_dataclass(value):
        return [type(value), *(getattr(value, field.name) for field in dataclasses.fields(value))]
    return None


def _function_parts(function: FunctionType, above: tuple[Any, ...]) -> Iterator[bytes]:
    """Source, or compiled code where no file holds it, with what is bound to the function."""
    try:
        yield inspect.getsource(function).encode()
    except (OSError, TypeError):
        yield from _parts(function.__code__, above)
    bound = inspect.getclosurevars(function).nonlocals
    yield from _parts([function.__defaults__, function.__kwdefaults__, bound, getattr(function, "batch", None)], above)


def _pickled(value: Any) -> bytes:
    try:
        return pickle.dumps(value)
    except Exception as error:
        raise TypeError(f"with a store a task is a function, or something that can be pickled: {error}") from error
