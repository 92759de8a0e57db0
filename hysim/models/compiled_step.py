"""Steps and starts as loops and exports take them: a kernel as it is, a plain function compiled once in a process."""

import functools
import inspect
import re
from collections.abc import Callable
from typing import Any, TypeVar

from numba.core.dispatcher import Dispatcher

from hysim.kernels.stepping import START, STEP, Start, Step, by_address, compile_as, sources
from hysim.models.protocols import Startable, Stepwise

_Kernel = TypeVar("_Kernel", Step, Start)


def startable(thing: Any, sample_time: float | None = None) -> Startable:
    """A law or a plant as a `Startable`; TypeError if it cannot be stepped, ValueError without a needed time [s]."""
    if not isinstance(thing, Stepwise):
        raise TypeError(f"a {type(thing).__name__} cannot be stepped: it has no compiled step")
    return thing.startable(sample_time)


def compiled_step(function: Callable[[Any, Any, float], float]) -> Step:
    """The step of a family, compiled by numba if it is no kernel; TypeError unless it returns one number."""
    return function if _is_kernel(function) else _compiled(function, STEP, "step(parameters, state, u) -> y")


def compiled_start(function: Callable[[Any, Any, float], None]) -> Start:
    """The start of a family, as `compiled_step`; TypeError if it is no function of (parameters, state, u0)."""
    return function if _is_kernel(function) else _compiled(function, START, "start(parameters, state, u0)")


@functools.lru_cache(maxsize=256)
def pointer(kernel: _Kernel, kind: Any = STEP) -> _Kernel:
    """A step, or a `START`, as kernels are given it again and again: numba would look up its address in each call."""
    return by_address(kernel, kind.signature)


def _is_kernel(function: Any) -> bool:
    return isinstance(function, Dispatcher) and function.py_func.__module__.startswith("hysim.kernels.")


@functools.lru_cache(maxsize=256)
def _compiled(function: Any, type_: Any, kind: str) -> Any:
    plain, name = (function.py_func if isinstance(function, Dispatcher) else function), kind.partition("(")[0]
    if not inspect.isfunction(plain):
        raise TypeError(f"{name} must be a function {kind}, got {type(function).__name__}")
    wanted, taken = kind[len(name) :].partition(")")[0] + ")", inspect.signature(plain).parameters
    if len(taken) != 3:
        raise TypeError(f"{name} must take {wanted}, but {plain.__name__} takes ({', '.join(taken)})")
    try:
        return compile_as(type_, plain)
    except Exception as error:  # numba's errors share no class
        reason = re.sub(r"Failed in \w+ mode pipeline \(step: [^)]*\) ", "", " ".join(str(error).split()))
        reason = reason.partition(" During: ")[0]  # a list of callers
        who = f"the slope of {plain.__qualname__.rpartition('_')[0]}" if plain in sources else plain.__name__
        hint = "; put @numba.njit above it" if "of <class 'function'>" in reason else ""
        raise TypeError(f"{who} does not compile as {kind}: {reason}{hint}") from None
