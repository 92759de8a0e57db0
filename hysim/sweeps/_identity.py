"""Identity of a study: the source of the task, the parameters of the tasks, the seed, and the version of hysim."""

import dataclasses
import hashlib
import inspect
import pickle
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from hysim._frozen import last_names
from hysim._release import __version__
from hysim.sweeps._space import Space

_PLAIN = (str, bytes, int, float, complex, type(None), type(...), np.generic)


def identity(task: Callable[..., Any], space: Space, seed: int) -> dict[str, str]:
    """The facts that must not change between two calls that share a store, as short texts."""
    names = ", ".join(space.columns)
    return {
        "task": _digest(inspect.unwrap(task)),
        "space": f"{space.n_tasks} tasks of {names} ({_digest(dict(space.columns))})",
        "seed": str(seed),
        "hysim": __version__,
    }


def _digest(value: Any) -> str:
    digest = hashlib.sha256()
    for part in _parts(value, ()):
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()[:16]


def _parts(value: Any, above: tuple[Any, ...]) -> Iterator[bytes]:
    """The content of a value in bytes that are the same in every process; `above` are the functions that hold it."""
    if isinstance(value, (FunctionType, CodeType)) and any(value is one for one in above):
        yield b"itself"
    elif isinstance(value, FunctionType):
        yield from _function_parts(value, (*above, value))
    elif isinstance(value, np.ndarray) and value.dtype != object:
        yield from (str(value.dtype).encode(), str(value.shape).encode(), np.ascontiguousarray(value).tobytes())
    elif isinstance(value, _PLAIN):
        yield repr(value).encode()
    elif isinstance(value, (type, ModuleType)):
        yield f"{value.__module__ if isinstance(value, type) else ''}.{value.__name__}".encode()
    elif (members := _members(value)) is not None:
        yield str(len(members)).encode()
        for member in members:
            yield from _parts(member, above)
    else:
        yield from (repr(type(value)).encode(), _pickled(value))


def _members(value: Any) -> list[Any] | None:
    """The parts of a value in a fixed order; None if it is of a type without known parts."""
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
        # a user's dataclass may have slots, so that `vars` would fail
        values = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        last = last_names(type(value))
        return [type(value), *(each for name, each in values.items() if each is not None or name not in last)]
    return None


def _function_parts(function: FunctionType, above: tuple[Any, ...]) -> Iterator[bytes]:
    """The source, or the compiled code where no file holds it, and the values bound to the function."""
    try:
        yield inspect.getsource(function).encode()
    except (OSError, TypeError):
        yield from _parts(function.__code__, above)
    bound = inspect.getclosurevars(function).nonlocals
    batch = vars(function).get("batch")
    yield from _parts([function.__defaults__, function.__kwdefaults__, bound, batch], above)


def _pickled(value: Any) -> bytes:
    try:
        return pickle.dumps(value)
    except Exception as error:
        raise TypeError(f"with a store a task is a function, or something that can be pickled: {error}") from error
