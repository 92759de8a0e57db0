"""Steps that a kernel calls by their address, so that one kernel takes any number of laws in one structure.

`path.follow`, which takes long to compile, is called so, too: it is not compiled into its callers once more.
"""

import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numba import boolean, float64, int64, types
from numba.core import cgutils
from numba.experimental.function_type import _get_wrapper_address
from numba.extending import intrinsic

from hysim.kernels.controllers import CONTROLLER, ControllerStep
from hysim.kernels.stepping import CONSTANTS, START, STEP, VECTOR, Start, Step
from hysim.kernels.structure_layout import Elements, Flows, Motion, Plant, Room, Steps, Tracks

_PLACES, _PAIRS = types.Array(int64, 1, "C"), types.Array(int64, 2, "C")
_ROWS, _TABLES, _TRUTHS = types.Array(float64, 2, "C"), types.Array(float64, 3, "C"), types.Array(types.bool_, 1, "C")


def _typed(kind: Any, *members: Any) -> Any:
    return types.BaseTuple.from_types(members, kind)


FOLLOW = types.FunctionType(
    int64(
        _typed(
            Elements, _PLACES, CONSTANTS, _PLACES, CONSTANTS, CONSTANTS, _PLACES, VECTOR, CONSTANTS, _PLACES, _PLACES,
            _PAIRS, _PLACES,
        ),
        _typed(Flows, *[_TABLES] * 4),
        _typed(Plant, *[_ROWS] * 4, VECTOR),
        _typed(Steps, float64, float64, int64, int64, float64),
        boolean,
        types.Array(float64, 2, "C", readonly=True),
        _typed(Motion, VECTOR, VECTOR, _ROWS, *[VECTOR] * 4),
        _typed(Room, *[VECTOR] * 11, _TRUTHS, *[VECTOR] * 2, _ROWS, *[VECTOR] * 5, _ROWS, _ROWS),
        _typed(Tracks, _ROWS, _TABLES, *[_ROWS] * 3),
    )
)  # fmt: skip
"""Type of `path.follow`."""


_IS_COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")


def _function_at(kind: Any) -> Any:
    """Inside a kernel: the function of a kind at an address, which the caller of the kernel must hold.

    Where nothing is compiled, a function is its own address.
    """

    def typed(_: Any, __: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            pointer = context.get_value_type(types.voidptr)
            function = cgutils.create_struct_proxy(kind)(context, builder)
            function.c_addr = builder.inttoptr(arguments[0], pointer)
            function.py_addr = function.jit_addr = cgutils.get_null_value(pointer)
            return function._getvalue()

        return kind(int64), code

    return intrinsic(typed) if _IS_COMPILED else lambda function: function


step_at: Callable[[Any], Step] = _function_at(STEP)
start_at: Callable[[Any], Start] = _function_at(START)
controller_at: Callable[[Any], ControllerStep] = _function_at(CONTROLLER)
follow_at: Callable[[Any], Callable[..., int]] = _function_at(FOLLOW)


def addresses(functions: Sequence[Any], kind: Any = STEP) -> Any:
    """Functions of a kind, such as `START`, as `step_at` and its like take them, shape (n,)."""
    if not _IS_COMPILED:
        return tuple(functions)
    return np.array([_get_wrapper_address(each, kind.signature) for each in functions], dtype=np.int64)
