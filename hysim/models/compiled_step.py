"""A step as loops take it: a kernel as it is, a plain function compiled once in a process."""

import functools
import inspect
from collections.abc import Callable
from typing import Any

from numba.core.dispatcher import Dispatcher

from hysim.kernels.stepping import Step, compile_step


def compiled_step(function: Callable[[Any, Any, float], float]) -> Step:
    """The step of a family: a kernel of hysim, or a function that numba compiles for the loops' own types.

    Raises TypeError if it is no function of (parameters, state, u), or does not compile to one number.
    """
    if isinstance(function, Dispatcher) and function.py_func.__module__.startswith("hysim.kernels."):
        return function
    return _compiled(function)


@functools.lru_cache(maxsize=256)
def _compiled(function: Callable[[Any, Any, float], float]) -> Step:
    plain = function.py_func if isinstance(function, Dispatcher) else function
    if not inspect.isfunction(plain):
        raise TypeError(f"step must be a function step(parameters, state, u) -> y, got {type(function).__name__}")
    taken = inspect.signature(plain).parameters
    if len(taken) != 3:
        raise TypeError(f"step must take (parameters, state, u), but {plain.__name__} takes ({', '.join(taken)})")
    try:
        return compile_step(plain)
    except Exception as error:  # numba's errors share no class
        reason = " ".join(str(error).split())
        raise TypeError(f"{plain.__name__} does not compile as step(parameters, state, u) -> y: {reason}") from None
