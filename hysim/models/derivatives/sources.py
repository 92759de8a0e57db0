"""Questions of the forward mode to a function: what it returns, and whether it writes to its arrays."""

import ast
from collections.abc import Callable, Iterator
from functools import lru_cache
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from hysim.kernels.stepping import borrowed
from hysim.models.tracing.routine import Routine, plain, routine

_WHOLE = ("int", "bool")


def body_of(source: Routine) -> list[ast.stmt]:
    """Statements of a function without its docstring."""
    statements = source.tree.body
    return statements[1:] if ast.get_docstring(source.tree) is not None else statements


def argument_names(source: Routine) -> list[str]:
    """Names of the arguments in their order."""
    return [each.arg for each in source.tree.args.args]


def returned_kinds(source: Routine) -> tuple[bool, ...]:
    """For each number that a function returns whether it is a float; empty where it returns nothing.

    A function without annotation returns one float.
    """
    returns = source.tree.returns
    if isinstance(returns, ast.Constant) and returns.value is None:
        return ()
    if isinstance(returns, ast.Subscript):
        members = returns.slice.elts if isinstance(returns.slice, ast.Tuple) else [returns.slice]
        return tuple(not _is_whole(each) for each in members)
    return (returns is None or not _is_whole(returns),)


def _is_whole(annotation: ast.expr) -> bool:
    return isinstance(annotation, ast.Name) and annotation.id in _WHOLE


def called_function(source: Routine, node: ast.expr) -> Any:
    """The plain function behind a callee by its name or as a member of a module, None where it is something else."""
    if isinstance(node, ast.Name):
        return plain(source.names[node.id]) if node.id in source.names else None
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        owner = source.names.get(node.value.id)
        return plain(vars(owner).get(node.attr)) if isinstance(owner, ModuleType) else None
    return None


def is_kernel(called: Any) -> bool:
    """Whether a callee is a function whose source is translated."""
    return isinstance(called, FunctionType) and called is not plain(borrowed)


@lru_cache(maxsize=1024)
def writes(function: Callable[..., Any]) -> bool:
    """Whether a function assigns elements of arrays, or calls one that does."""
    source = routine(function)
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
            return True
        if isinstance(node, ast.Call):
            called = called_function(source, node.func)
            if is_kernel(called) and called is not function and writes(called):
                return True
    return False


def assigned(body: list[ast.stmt]) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Targets and values of all assignments; a target that is a tuple stands beside its whole value."""
    for statement in body:
        for node in ast.walk(statement):
            if isinstance(node, ast.Assign):
                for target in node.targets:
                    yield target, node.value
            elif isinstance(node, ast.AugAssign):
                yield node.target, node.value


def root_of(node: ast.expr) -> str | None:
    """Name of the array in which an element or a part lies."""
    while isinstance(node, ast.Subscript | ast.Attribute | ast.Call):
        node = node.func if isinstance(node, ast.Call) else node.value
    return node.id if isinstance(node, ast.Name) else None


def is_table(value: Any) -> bool:
    """Whether a global is a constant array."""
    return isinstance(value, np.ndarray)
