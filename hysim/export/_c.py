"""C99 for the translator: functions to be read, types, expressions and tables as text, helpers that C lacks, names.

Types are numbers, vectors of doubles, functions known in advance, and tuples of numbers.

A name is declared in the innermost block that holds all its places. A block within another is taken only if it assigns
the name before anything else: otherwise the name may keep a value from one pass through a loop to the next.
"""

import ast
import inspect
import textwrap
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cache, lru_cache
from pathlib import Path
from types import FunctionType, MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np
from numba.core.dispatcher import Dispatcher

from hysim.kernels.stepping import Addressed, sources

_FOLDER = Path(__file__).with_name("c")
_HELPERS = _FOLDER.joinpath("helpers.c").read_text(encoding="utf-8").splitlines()
HELPERS = MappingProxyType({line.partition("(")[0].split()[-1]: line for line in _HELPERS})
"""Functions of Python that C lacks; `min` and `max` keep the first of two that are not ordered."""

_WORDS = tomllib.loads(_FOLDER.joinpath("words.toml").read_text(encoding="utf-8"))
RESERVED, HEADERS, MATHEMATICS, TESTS = (
    frozenset(_WORDS[kind].split()) for kind in ("reserved", "headers", "mathematics", "tests")
)

CONDITIONAL, OR, AND, EQUALITY, RELATION, SUM, PRODUCT, UNARY, PRIMARY = range(9)
"""How strongly the operators of C bind."""

Place = tuple[int, int]
"""Identity of a list of statements, and the number of the statement in it."""


def number(value: float) -> str:
    """A double in C, with all its digits."""
    text = repr(float(value))
    return {"nan": "NAN", "inf": "INFINITY", "-inf": "-INFINITY"}.get(text, text)


def table(name: str, values: Sequence[float]) -> str:
    """A vector of constants in C; a vector without numbers has one, since C has no empty arrays."""
    numbers = [number(value) for value in values] or ["0.0"]
    rows = [", ".join(numbers[i : i + 4]) for i in range(0, len(numbers), 4)]
    return f"static const double {name}[{len(numbers)}] = {{\n    " + ",\n    ".join(rows) + "\n};"


def is_table(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim == 1 and value.dtype == np.float64
    return isinstance(value, tuple) and bool(value) and all(isinstance(each, float) for each in value)


class Scalar(IntEnum):
    """A number; of two types that meet, the later one holds both."""

    BOOL = 0
    INT = 1
    DOUBLE = 2

    @property
    def c_type(self) -> str:
        return "double" if self is Scalar.DOUBLE else "int"


class Vector(NamedTuple):
    """A contiguous array of doubles with this number of axes."""

    rank: int = 1

    def length(self, name: str, axis: int) -> str:
        return f"{name}_size" if self.rank == 1 else f"{name}_shape{axis}"


class Known(NamedTuple):
    """A value that is known when the program is translated: a function, or None."""

    value: Callable[..., Any] | None


class Several(NamedTuple):
    """Numbers that a function returns together."""

    members: tuple[Scalar, ...]

    @property
    def c_type(self) -> str:
        return "several_" + "".join("d" if member is Scalar.DOUBLE else "i" for member in self.members)


Type = Scalar | Vector | Known | Several


def joined(first: Type | None, second: Type) -> Type | None:
    """The type that holds values of both, None if they have no common type."""
    if first is None or first == second:
        return second
    if isinstance(first, Scalar) and isinstance(second, Scalar):
        return max(first, second)
    if isinstance(first, Several) and isinstance(second, Several) and len(first.members) == len(second.members):
        return Several(tuple(max(pair) for pair in zip(first.members, second.members, strict=True)))
    return None


class UntranslatableError(ValueError):
    """A step uses Python that has no translation; the message names the file and the line."""


class Routine(NamedTuple):
    """A function: its syntax tree, the values of its global and enclosed names, and the file that it stands in."""

    function: FunctionType
    tree: ast.FunctionDef
    names: Mapping[str, Any]
    file: str

    def refusal(self, node: ast.AST, reason: str) -> UntranslatableError:
        first = node.lineno if isinstance(node, ast.stmt | ast.expr) else 1
        line = self.function.__code__.co_firstlineno + first - 1
        return UntranslatableError(f"{self.file}:{line}: {reason}; hysim/kernels/__init__.py says what is translated")


def plain(function: Any) -> Any:
    """The Python function of a kernel; any other value is returned unchanged."""
    if isinstance(function, Addressed):
        return plain(function.function)
    return plain(function.py_func) if isinstance(function, Dispatcher) else function


@lru_cache(maxsize=1024)
def routine(function: Callable[..., Any]) -> Routine:
    """Read a function; UntranslatableError if it is no Python function whose source can be read."""
    if not isinstance(function, FunctionType):
        raise UntranslatableError(f"a step must be a Python function or a kernel, got {function!r}")
    try:
        text = sources.get(function) or textwrap.dedent(inspect.getsource(function))
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
    """An expression in C: its text, its type, and how strongly its operator binds.

    A vector has its lengths, which count as used once they are asked for, and the arrays in which it lies.
    """

    text: str
    type: Type
    binds: int = PRIMARY
    lengths: tuple[Callable[[], "Value"], ...] = ()
    roots: frozenset[str] = frozenset()

    def within(self, binds: int) -> str:
        """Text as an operand of an operator that binds as strongly as this."""
        return self.text if self.binds >= binds else f"({self.text})"


class Parameter(NamedTuple):
    """An argument of a C function: its name and type, whether C has it, its lengths, and whether it is written to."""

    name: str
    type: Type
    is_used: bool
    axes: tuple[int, ...]
    is_written: bool


class Function(NamedTuple):
    """A translated function: its name in C, its arguments, and its result."""

    name: str
    parameters: tuple[Parameter, ...]
    returns: Type | None


class Library(Protocol):
    """Collection of functions, tables, helpers and structs."""

    helpers: set[str]
    structs: set[Several]

    def function(self, of: Callable[..., Any], types: tuple[Type, ...]) -> Function:
        """The C function of a kernel for arguments of these types."""

    def table(self, name: str, values: Any) -> str:
        """Name of a constant vector."""


@dataclass
class Scope:
    """Names of a function while it is translated, and what was learnt about them.

    `lengths` are arrays and axes whose length is used, `written` arrays that are written to, `used` names that are
    read, `roots` the arrays in which a local one lies, and `before` what the last pass has learnt.
    """

    source: Routine
    types: dict[str, Type]
    roots: dict[str, frozenset[str]] = field(default_factory=dict)
    lengths: set[tuple[str, int]] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    used: set[str] = field(default_factory=set)
    before: "Scope | None" = None

    def again(self) -> bool:
        """Begin another pass; False if the last one has learnt nothing new."""
        learnt = replace(self, types=dict(self.types), roots=dict(self.roots), before=None)
        settled, self.before = learnt == self.before, learnt
        self.lengths, self.written, self.used = set(), set(), set()
        return not settled

    def is_used(self, name: str) -> bool:
        return self.before is None or name in self.before.used

    def is_written(self, name: str) -> bool:
        return self.before is not None and bool((self.roots.get(name, frozenset()) | {name}) & self.before.written)

    def axes(self, name: str) -> tuple[int, ...]:
        return () if self.before is None else tuple(sorted(axis for each, axis in self.before.lengths if each == name))

    def assign(self, name: str, type_: Type, node: ast.AST) -> None:
        known = joined(self.types.get(name), type_)
        if known is None:
            raise self.source.refusal(node, f"{name} cannot be both {self.types[name]} and {type_}")
        self.types[name] = known

    def write(self, name: str) -> None:
        self.written |= {name} | self.roots.get(name, frozenset())

    def c_name(self, name: str) -> str:
        """Name in C, different from those of the functions that an expression may call."""
        plain_name = name.strip("_") or "ignored"
        return f"{plain_name}_" if plain_name in RESERVED | HELPERS.keys() | MATHEMATICS | TESTS else plain_name


@lru_cache(maxsize=1024)
def homes(tree: ast.FunctionDef) -> Mapping[Place, list[str]]:
    """Names that are declared at each statement of a function, in the order in which they appear."""
    local = stored(tree.body).keys() - {each.arg for each in tree.args.args}
    names = {name: None for statement in tree.body for name in _mentioned(statement) if name in local}
    placed: dict[Place, list[str]] = {}
    for name in names:
        placed.setdefault(_home(tree.body, name), []).append(name)
    return placed


def stored(nodes: Iterable[ast.AST]) -> Counter[str]:
    """Names that are assigned, and how often."""
    each = (node for root in nodes for node in ast.walk(root) if isinstance(node, ast.Name))
    return Counter(node.id for node in each if isinstance(node.ctx, ast.Store))


@lru_cache(maxsize=1024)
def counters_used_elsewhere(tree: ast.FunctionDef) -> list[ast.For]:
    """Loops of a function whose counting name is assigned within them, or has another use outside such loops."""
    loops = [node for statement in tree.body for node in ast.walk(statement) if isinstance(node, ast.For)]
    outside = {name for statement in tree.body for name in _mentioned(statement)}
    _mentioned.cache_clear()
    counters = [(loop, loop.target.id) for loop in loops if isinstance(loop.target, ast.Name)]
    return [loop for loop, name in counters if name in outside - {"_"} or name in stored(loop.body)]


def reads(node: ast.AST) -> set[str]:
    """Names that are read in an expression or a statement."""
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Load)}


def _home(block: list[ast.stmt], name: str) -> Place:
    numbers = [k for k, statement in enumerate(block) if name in _mentioned(statement)]
    if len(numbers) == 1 and (inner := _only_block(block[numbers[0]], name)) and _begins_with(inner, name):
        return _home(inner, name)
    return id(block), numbers[0]


def _begins_with(block: list[ast.stmt], name: str) -> bool:
    """Whether the first statement with the name assigns it, or is the only one and holds a block that does."""
    first, *others = (statement for statement in block if name in _mentioned(statement))
    if isinstance(first, ast.Assign) and name in stored(first.targets):
        return name not in reads(first.value)
    inner = _only_block(first, name)
    return inner is not None and not others and _begins_with(inner, name)


def _only_block(statement: ast.stmt, name: str) -> list[ast.stmt] | None:
    """The block of a branch or a loop that alone has a name, which the head has not; else None."""
    if not isinstance(statement, ast.If | ast.For | ast.While):
        return None
    head = statement.iter if isinstance(statement, ast.For) else statement.test
    blocks = (statement.body, statement.orelse)
    within = [block for block in blocks if any(name in _mentioned(each) for each in block)]
    return within[0] if len(within) == 1 and name not in _mentioned(head) else None


@cache
def _mentioned(node: ast.AST) -> Mapping[str, None]:
    """Names in a statement in their order, without those that a `for` in it counts with; kept while a tree stays."""
    if isinstance(node, ast.For):
        assert isinstance(node.target, ast.Name)
        inner = {name: None for statement in node.body for name in _mentioned(statement) if name != node.target.id}
        return {**_mentioned(node.iter), **inner}
    if isinstance(node, ast.Name):
        return {node.id: None}
    return {name: None for child in ast.iter_child_nodes(node) for name in _mentioned(child)}
