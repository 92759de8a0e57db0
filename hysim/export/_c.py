"""C99 for the translator: functions to be read, types, expressions and tables as text, helpers that C lacks, names.

Types are numbers, vectors of doubles, functions known in advance, and tuples of numbers.

A name is declared in the innermost block that holds all its places. A block within another is taken only if it assigns
the name before anything else: otherwise the name may keep a value from one pass through a loop to the next.
"""

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import IntEnum
from functools import lru_cache
from pathlib import Path
from types import FunctionType, MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np
from numba.core.dispatcher import Dispatcher

from hysim.kernels.stepping import Addressed, sources

HELPERS = MappingProxyType(
    {
        "smaller": "static double smaller(double a, double b) { return b < a ? b : a; }",
        "larger": "static double larger(double a, double b) { return b > a ? b : a; }",
        "smaller_int": "static int smaller_int(int a, int b) { return b < a ? b : a; }",
        "larger_int": "static int larger_int(int a, int b) { return b > a ? b : a; }",
        "absolute_int": "static int absolute_int(int a) { return a < 0 ? -a : a; }",
        "below": "static int below(int a, int b) { return a % b != 0 && (a < 0) != (b < 0); }",
        "floor_quotient": "static int floor_quotient(int a, int b) { return a / b - below(a, b); }",
        "floor_rest": "static int floor_rest(int a, int b) { return a % b + below(a, b) * b; }",
        "power_2": "static double power_2(double x) { return x * x; }",
        "power_3": "static double power_3(double x) { return x * (x * x); }",
        "power_4": "static double power_4(double x) { return (x * x) * (x * x); }",
    }
)
"""Functions of Python that C lacks; `min` and `max` keep the first of two that are not ordered."""

RESERVED = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long main
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    NAN INFINITY NULL errno
    """.split()  # noqa: SIM905
)
"""Words that are no names in C."""

HEADERS = frozenset(
    """
    assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdarg stdbool stddef stdint
    stdio stdlib string tgmath time wchar wctype
    """.split()  # noqa: SIM905
)
"""Headers of C99: a file of this name could hide one."""

MATHEMATICS = frozenset(
    """
    acos acosh asin asinh atan atan2 atanh copysign cos cosh erf erfc exp expm1 fabs fmod hypot lgamma log log10 log1p
    log2 pow sin sinh sqrt tan tanh ceil floor trunc
    """.split()  # noqa: SIM905
)
"""Functions of `math` that C has; the last three are whole numbers in Python, as doubles they do not overflow."""

TESTS = frozenset(("isfinite", "isinf", "isnan"))
"""Functions of `math` with a truth value."""

CONDITIONAL, OR, AND, EQUALITY, RELATION, SUM, PRODUCT, UNARY, PRIMARY = range(9)
"""How strongly the operators of C bind."""

Place = tuple[int, int]
"""Identity of a list of statements, and the number of the statement in it."""


def number(value: float) -> str:
    """A double in C, with all its digits."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    text = repr(float(value))
    return text if "." in text or "e" in text else text + ".0"


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
    """The type that holds values of both, None where there is none."""
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
        return Vector(len(self.lengths))


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
    """Collection of functions, tables and helpers."""

    helpers: set[str]

    def function(self, of: Callable[..., Any], types: tuple[Type, ...]) -> Function:
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

    `lengths` are arrays and axes whose length is used, `written` arrays that are written to, `used` names that are
    read, `roots` the arrays in which a local one lies, and `before` what the last pass has learnt.
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


def homes(body: list[ast.stmt], arguments: Iterable[str]) -> Mapping[Place, list[str]]:
    """Names that are declared at each statement, in the order in which they appear."""
    local = assignments(body).keys() - set(arguments)
    names = {name: None for statement in body for name in _mentioned(statement) if name in local}
    placed: dict[Place, list[str]] = {}
    for name in names:
        if (home := _home(body, name)) is not None:
            placed.setdefault(home, []).append(name)
    return placed


def assignments(body: list[ast.stmt]) -> Mapping[str, int]:
    counts: dict[str, int] = {}
    for node in (node for statement in body for node in ast.walk(statement)):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            counts[node.id] = counts.get(node.id, 0) + 1
    return counts


def counters_used_elsewhere(body: list[ast.stmt]) -> list[ast.For]:
    """Loops whose counting name is assigned within them, or has another use outside such loops."""
    loops = [node for statement in body for node in ast.walk(statement) if isinstance(node, ast.For)]
    outside = {name for statement in body for name in _mentioned(statement)}
    return [
        loop
        for loop in loops
        if isinstance(loop.target, ast.Name)
        and (loop.target.id in assignments(loop.body) or loop.target.id in outside - {"_"})
    ]


def targets(statement: ast.stmt) -> list[str]:
    if not isinstance(statement, ast.Assign):
        return []
    each = [
        part for target in statement.targets for part in (target.elts if isinstance(target, ast.Tuple) else [target])
    ]
    return [target.id for target in each if isinstance(target, ast.Name)]


def reads(node: ast.AST) -> set[str]:
    """Names that are read in an expression or a statement."""
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Load)}


def _home(block: list[ast.stmt], name: str) -> Place | None:
    numbers = [k for k, statement in enumerate(block) if name in _mentioned(statement)]
    if not numbers:
        return None
    if len(numbers) == 1:
        within = [inner for inner in _blocks(block[numbers[0]]) if any(name in _mentioned(each) for each in inner)]
        if len(within) == 1 and name not in _headed(block[numbers[0]]) and _begins_with(within[0], name):
            return _home(within[0], name)
    return id(block), numbers[0]


def _begins_with(block: list[ast.stmt], name: str) -> bool:
    """Whether the first statement with the name assigns it, or holds a block that does."""
    first = next(statement for statement in block if name in _mentioned(statement))
    if name in targets(first):
        assert isinstance(first, ast.Assign)
        return name not in reads(first.value)
    within = [inner for inner in _blocks(first) if any(name in _mentioned(each) for each in inner)]
    others = sum(name in _mentioned(statement) for statement in block) > 1
    return len(within) == 1 and not others and name not in _headed(first) and _begins_with(within[0], name)


def _blocks(statement: ast.stmt) -> list[list[ast.stmt]]:
    if isinstance(statement, ast.If):
        return [statement.body, statement.orelse]
    return [statement.body] if isinstance(statement, ast.For | ast.While) else []


def _headed(statement: ast.stmt) -> set[str]:
    if isinstance(statement, ast.For):
        return set(_mentioned(statement.iter))
    return set(_mentioned(statement.test)) if isinstance(statement, ast.If | ast.While) else set()


def _mentioned(node: ast.AST) -> dict[str, None]:
    """Names in a statement in their order, without those that a `for` in it counts with."""
    if isinstance(node, ast.For):
        assert isinstance(node.target, ast.Name)
        inner = {name: None for statement in node.body for name in _mentioned(statement) if name != node.target.id}
        return {**_mentioned(node.iter), **inner}
    if isinstance(node, ast.Name):
        return {node.id: None}
    return {name: None for child in ast.iter_child_nodes(node) for name in _mentioned(child)}
