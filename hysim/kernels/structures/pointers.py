"""Steps that a kernel calls by their address, so that one kernel takes any number of laws in one structure."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import int64, types
from numba.core import cgutils
from numba.experimental.function_type import _get_wrapper_address
from numba.extending import intrinsic

from hysim.kernels.stepping import STEP, Step


def step_at(step: Any) -> Step:
    """Inside a kernel: the step at an address. The caller of the kernel must hold the step's function."""
    return step  # type: ignore[no-any-return]  # where nothing is compiled, a step is its own address


def _step_at(_: Any, __: Any) -> Any:
    """Type and code of `step_at`."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = context.get_value_type(types.voidptr)
        step = cgutils.create_struct_proxy(STEP)(context, builder)
        step.c_addr = builder.inttoptr(arguments[0], pointer)
        step.py_addr = step.jit_addr = cgutils.get_null_value(pointer)
        return step._getvalue()

    return STEP(int64), code


def addresses(steps: Sequence[Step]) -> Any:
    """The steps as `step_at` takes them, shape (n,)."""
    if not _IS_COMPILED:
        return tuple(steps)
    return np.array([_get_wrapper_address(step, STEP.signature) for step in steps], dtype=np.int64)


_IS_COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
if _IS_COMPILED:
    step_at = intrinsic(_step_at)  # type: ignore[assignment]
