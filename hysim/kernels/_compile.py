"""How a kernel is compiled: one decorator, so that every kernel is compiled alike.

The compiled code is cached beside the source file, or in the user's cache folder. Where neither is
writable the function is compiled anew in each process. It releases the interpreter lock, and it
follows IEEE 754 (a division by zero is an infinity): kernels raise nothing, they return codes.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` at its first call with each combination of argument types."""
    return _compiled(function)


def inlined_kernel(function: F) -> F:
    """Compile `function` into its callers: for what takes or gives long tuples inside a hot loop."""
    return _compiled(function, inline="always")


def signed_kernel(signature: Any) -> Callable[[F], F]:
    """Compile a function for one signature at once: what a typed function pointer needs."""
    return lambda function: _compiled(function, signature)


def _compiled(function: F, *signature: Any, inline: str = "never") -> F:
    compiler: Any = numba.njit
    options = {"nogil": True, "error_model": "numpy", "inline": inline}
    try:
        compiled: F = compiler(*signature, cache=True, **options)(function)
    except RuntimeError:  # numba found no writable folder for its cache
        compiled = compiler(*signature, **options)(function)
    return compiled
