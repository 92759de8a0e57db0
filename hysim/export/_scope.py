"""A function while it is translated: its syntax tree, the values of its names, and expressions as text in C99."""

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple, Protocol

from numba.core.dispatcher import Dispatcher

from hysim.export import _c
from hysim.export._types import Type, Vector, joined
from hysim.kernels.stepping import Addressed

CONDITIONAL, OR, AND, EQUALITY, RELATION, SUM, PRODUCT, UNARY, PRIMARY = range(9)
"""How strongly the operators of C bind."""


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


class Value(NamedTuple):
    """An expression in C: its text, its type, and how strongly its operator binds."""

    text: str
    type: Type
    binds: int = PRIMARY

    def within(self, binds: int) -> str:
        """Text as an operand of an operator that binds as strongly as this."""
        return self.text if self.binds >= binds else f"({self.text})"


class Stretch(NamedTuple):
    """An array, or a part of one: the pointer, its lengths as text once they are asked for, and where it lies."""

    text: str
    lengths: tuple[Callable[[], str], ...]
    roots: frozenset[str]
    binds: int = PRIMARY

    @property
    def type(self) -> Vector:
        """Its type."""
        return Vector(len(self.lengths))


class Called(Protocol):
    """A translated function: its name, which arguments C has, and its result."""

    @property
    def name(self) -> str: ...

    @property
    def parameters(self) -> tuple[Any, ...]: ...

    @property
    def returns(self) -> Type | None: ...


class Library(Protocol):
    """Collection of functions, tables and helpers."""

    helpers: set[str]

    def function(self, of: Callable[..., Any], types: tuple[Type, ...]) -> Called:
        """The C function of a kernel for arguments of these types."""

    def table(self, name: str, values: Any) -> str:
        """Name of a constant vector."""


class Uses(NamedTuple):
    """Everything that one pass through a function has learnt; see `Scope`."""

    types: dict[str, Type]
    roots: dict[str, frozenset[str]]
    lengths: set[tuple[str, int]]
    written: set[str]
    used: set[str]


class Scope:
    """Names of a function while it is translated, and what was learnt about them.

    Parameters
    ----------
    source, arguments : Routine and dict
        The function, and the types of its arguments.

    Attributes
    ----------
    types : dict
        Type of each local name, as far as it is known.
    lengths : set of (str, int)
        Arrays and their axes whose length is used.
    written, used : set of str
        Arrays that are written to, and names that are read.
    roots : dict
        Arrays in which a local array lies.
    before : Uses, optional
        What the last pass has learnt.
    """

    def __init__(self, source: Routine, arguments: dict[str, Type]) -> None:
        self.source = source
        self.types: dict[str, Type] = dict(arguments)
        self.roots: dict[str, frozenset[str]] = {}
        self.lengths: set[tuple[str, int]] = set()
        self.written: set[str] = set()
        self.used: set[str] = set()
        self.before: Uses | None = None

    def again(self) -> bool:
        """Begin another pass; False if the last one has learnt nothing new."""
        uses = Uses(dict(self.types), dict(self.roots), self.lengths, self.written, self.used)
        settled, self.before = uses == self.before, uses
        self.lengths, self.written, self.used = set(), set(), set()
        return not settled

    def is_used(self, name: str) -> bool:
        """Whether a name was read in the last pass."""
        return self.before is None or name in self.before.used

    def is_written(self, name: str) -> bool:
        """Whether an array was written to in the last pass."""
        return self.before is not None and bool((self.roots.get(name, frozenset()) | {name}) & self.before.written)

    def axes(self, name: str) -> tuple[int, ...]:
        """Axes of an array whose lengths were used in the last pass."""
        return () if self.before is None else tuple(sorted(axis for each, axis in self.before.lengths if each == name))

    def assign(self, name: str, type_: Type, node: ast.AST) -> None:
        """Note that a name gets a value of this type."""
        known = joined(self.types.get(name), type_)
        if known is None:
            raise self.source.refusal(node, f"{name} cannot be both {self.types[name]} and {type_}")
        self.types[name] = known

    def write(self, name: str) -> None:
        """Note that a vector is written to."""
        self.written |= {name} | self.roots.get(name, frozenset())

    def c_name(self, name: str) -> str:
        """The name in C, which is none of a function that an expression may call."""
        plain_name = name.strip("_") or "ignored"
        return (
            f"{plain_name}_"
            if plain_name in _c.RESERVED | _c.HELPERS.keys() | _c.MATHEMATICS | _c.TESTS
            else plain_name
        )
