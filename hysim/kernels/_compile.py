"""How a kernel is compiled: one decorator, so that every kernel is compiled alike.

The compiled code is cached beside the source file, or in the user's cache folder. Where neither is
writable the function is compiled anew in each process. It releases the interpreter lock, and it
follows IEEE 754 (a division by zero is an infinity): kernels raise nothing, they return codes.
"""

import os
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core import cgutils
from numba.extending import intrinsic

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` at its first call with each combination of argument types."""
    return _compiled(function)


def inlined(function: F) -> F:
    """Copy `function` into each of its callers, where it is compiled with them, and nowhere else."""
    return _compiled(function, inline="always")


def signed_kernel(signature: Any) -> Callable[[F], F]:
    """Compile a function for one signature at once: what a typed function pointer needs."""
    return lambda function: _compiled(function, signature)


def _compiled(function: F, *signature: Any, **others: Any) -> F:
    compiler: Any = numba.njit
    options = {"nogil": True, "error_model": "numpy", **others}
    try:
        compiled: F = compiler(*signature, cache=True, **options)(function)
    except RuntimeError:  # numba found no writable folder for its cache
        compiled = compiler(*signature, **options)(function)
    return compiled


def borrowed(array: Any) -> Any:
    """Inside a kernel: `array` without its owner.

    A function that is called with an array counts the array's owners, in two atomic operations: on the way
    to a scalar function that is more time than in it. The caller of the kernel must hold the array.
    """
    return array


def _borrowed(_: Any, array: Any) -> Any:
    """Type and code of `borrowed`."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.return_type)(context, builder, value=arguments[0])
        view.meminfo = cgutils.get_null_value(view.meminfo.type)
        view.parent = cgutils.get_null_value(view.parent.type)
        return view._getvalue()

    return array(array), code


if os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0"):
    borrowed = intrinsic(_borrowed)  # type: ignore[assignment]
