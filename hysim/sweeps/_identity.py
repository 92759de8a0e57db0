"""By what two studies are known to be the same: the source of the task, the tasks, the seed, the version."""

import dataclasses
import hashlib
import inspect
import pickle
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from types import CodeType, FunctionType
from typing import Any

import numpy as np

import hysim
from hysim.sweeps._space import Space


def identity(task: Callable[..., Any], space: Space, seed: int) -> dict[str, str]:
    """What must not change between two calls that share a store, as short texts that are compared."""
    names = ", ".join(space.columns)
    return {
        "task": _digest(inspect.unwrap(task)),
        "space": f"{space.n_tasks} tasks of {names} ({_digest(dict(space.columns))})",
        "seed": str(seed),
        "hysim": hysim.__version__,
    }


def _digest(value: Any) -> str:
    seal = hashlib.sha256()
    for part in _parts(value):
        seal.update(len(part).to_bytes(8, "little") + part)
    return seal.hexdigest()[:16]


def _parts(value: Any) -> Iterable[bytes]:
    """What a value is, in bytes that are the same in every process."""
    if isinstance(value, FunctionType):
        yield from _function_parts(value)
    elif isinstance(value, CodeType):
        yield value.co_code
        yield from _parts([value.co_names, value.co_varnames, value.co_consts])
    elif isinstance(value, partial):
        yield from _parts([value.func, value.args, value.keywords])
    elif isinstance(value, np.ndarray):
        yield from (str(value.dtype).encode(), str(value.shape).encode(), np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Mapping):
        yield from _parts([each for name in sorted(value, key=repr) for each in (name, value[name])])
    elif isinstance(value, (list, tuple)):
        yield str(len(value)).encode()
        for each in value:
            yield from _parts(each)
    elif isinstance(value, type):
        yield f"{value.__module__}.{value.__qualname__}".encode()
    elif isinstance(value, (str, bytes, int, float, complex, type(None), type(...), frozenset, np.generic)):
        yield repr(sorted(value, key=repr) if isinstance(value, frozenset) else value).encode()
    elif dataclasses.is_dataclass(value):
        yield from _parts([type(value), *(getattr(value, field.name) for field in dataclasses.fields(value))])
    else:
        yield from _parts([type(value), pickle.dumps(value)])


def _function_parts(function: FunctionType) -> Iterable[bytes]:
    """Source, or compiled code where no file holds it, with what is bound to the function."""
    try:
        yield inspect.getsource(function).encode()
    except (OSError, TypeError):
        yield from _parts(function.__code__)
    bound = [cell.cell_contents for cell in function.__closure__ or ()]
    yield from _parts([function.__defaults__, function.__kwdefaults__, bound])
    yield from _parts(getattr(function, "batch", None))
