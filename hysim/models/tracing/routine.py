"""Python functions as the translator reads them: their syntax tree, and the values of the names in it."""

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

from numba.core.dispatcher import Dispatcher

from hysim.kernels.stepping import Addressed


class UntranslatableError(ValueError):
    """A step uses Python that has no translation; the message names the file and the line."""


class Routine(NamedTuple):
    """A function: its syntax tree, the values of its global and enclosed names, and the file that it stands in."""

    function: FunctionType
    tree: ast.FunctionDef
    names: Mapping[str, Any]
    file: str

    def refusal(self, node: ast.AST, reason: str) -> UntranslatableError:
        """The error for a place in the function."""
        first = node.lineno if isinstance(node, ast.stmt | ast.expr) else 1
        line = self.function.__code__.co_firstlineno + first - 1
        return UntranslatableError(f"{self.file}:{line}: {reason}; hysim/kernels/__init__.py says what is translated")


def plain(function: Any) -> Any:
    """The Python function behind a kernel, or the value itself where it is none."""
    while True:
        if isinstance(function, Addressed):
            function = function.function
        elif isinstance(function, Dispatcher):
            function = function.py_func
        else:
            return function


@lru_cache(maxsize=1024)
def routine(function: Callable[..., Any]) -> Routine:
    """Read a function.

    Raises
    ------
    UntranslatableError
        If it is no Python function whose source can be read.
    """
    if not isinstance(function, FunctionType):
        raise UntranslatableError(f"a step must be a Python function or a kernel, got {function!r}")
    try:
        text = textwrap.dedent(inspect.getsource(function))
        file = inspect.getsourcefile(function) or "<unknown>"
    except (OSError, TypeError):
        name = function.__qualname__
        raise UntranslatableError(f"the source of {name} cannot be read: define it in a file") from None
    tree = next((node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)), None)
    if tree is None:
        raise UntranslatableError(f"{function.__qualname__} is not defined by def: a lambda is not translated")
    cells = function.__closure__ or ()
    enclosed = {name: cell.cell_contents for name, cell in zip(function.__code__.co_freevars, cells, strict=True)}
    return Routine(function, tree, {**function.__globals__, **enclosed}, "/".join(Path(file).parts[-3:]))
