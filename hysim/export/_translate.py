"""Kernels in C99: a walk over the syntax trees of the portable subset of Python.

The subset stands in `hysim/kernels/__init__.py`. Each function becomes one static C function for each combination of
argument types and of functions among its arguments: calls through function values are direct calls in C. Types of local
names follow from their values, and are sought again until nothing changes. A vector is a pointer; where its length is
used, an `int` follows it. What is never written to is `const`, and what is never used is left out.

C evaluates the operands of an expression in any order; the subset therefore allows one call in an expression that
writes to the state.
"""

import ast
from collections.abc import Callable
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

from hysim.export import _c
from hysim.export._body import Body
from hysim.export._scope import Routine, plain, routine
from hysim.export._types import Known, Scalar, Several, Type, Vector

_ANNOTATED = MappingProxyType({"float": Scalar.DOUBLE, "int": Scalar.INT, "bool": Scalar.BOOL})


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


@dataclass
class Translation:
    """C text of the functions translated so far, each behind those that it calls."""

    functions: dict[Any, Function] = field(default_factory=dict)
    helpers: set[str] = field(default_factory=set)
    _texts: list[str] = field(default_factory=list)
    _tables: dict[int, tuple[str, Any]] = field(default_factory=dict)
    _structs: set[Several] = field(default_factory=set)
    _names: set[str] = field(default_factory=set)

    def function(self, of: Callable[..., Any], types: tuple[Type, ...]) -> Function:
        """The C function of a kernel for arguments of these types; it is translated where it is not yet.

        Raises
        ------
        UntranslatableError
            If the function, or one that it calls, is outside the subset.
        """
        source = routine(plain(of))
        arguments = _arguments(source, len(types))
        annotated = tuple(_as_annotated(argument, type_) for argument, type_ in zip(arguments, types, strict=True))
        key = source.function, annotated
        if key not in self.functions:
            module = source.function.__module__.rpartition(".")[2]
            name = self._free(f"{module}_{source.function.__name__.strip('_')}".strip("_"))
            self.functions[key] = self._translated(source, name, annotated)
        return self.functions[key]

    def table(self, name: str, values: Any) -> str:
        """Name of a constant vector in C."""
        if id(values) not in self._tables:
            self._tables[id(values)] = self._free(f"table_{name.strip('_').lower()}"), values
        return self._tables[id(values)][0]

    def text(self) -> str:
        """Everything that was translated."""
        structs = [
            f"typedef struct {{ {' '.join(f'{m.c_type} at{i};' for i, m in enumerate(each.members))} }} {each.c_type};"
            for each in sorted(self._structs, key=lambda each: each.c_type)
        ]
        helpers = [text for name, text in _c.HELPERS.items() if name in self.helpers]
        tables = [_c.table(name, values) for name, values in self._tables.values()]
        parts = ["\n".join(each) for each in (structs, helpers, tables) if each]
        return "\n\n".join([*parts, *self._texts]) + "\n"

    def _free(self, wanted: str) -> str:
        """A name in C that is not taken; no public name ends with an underscore or a number behind one."""
        name, k = f"{wanted}_", 2
        while name in self._names:
            name, k = f"{wanted}_{k}", k + 1
        self._names.add(name)
        return name

    def _translated(self, source: Routine, name: str, types: tuple[Type, ...]) -> Function:
        body = Body(self, source, dict(zip((each.arg for each in source.tree.args.args), types, strict=True)))
        text = body.settled()
        scope = body.scope
        parameters = tuple(
            Parameter(each, scope.types[each], scope.is_used(each), scope.axes(each), scope.is_written(each))
            for each in body.arguments
        )
        if isinstance(body.returns, Several):
            self._structs.add(body.returns)
        result = "void" if body.returns is None else body.returns.c_type  # type: ignore[union-attr]
        arguments = [text for each in parameters for text in _declared(each, scope.c_name(each.name))]
        comment = (
            (ast.get_docstring(source.tree) or "").partition("\n\n")[0].replace("\n", "\n   ").replace("*/", "* /")
        )
        head = f"static {result} {name}({', '.join(arguments) or 'void'})"
        self._texts.append((f"/* {comment} */\n" if comment else "") + f"{head} {{\n{text}}}")
        return Function(name, parameters, body.returns)


def _declared(parameter: Parameter, name: str) -> list[str]:
    """An argument in C, and its length."""
    if isinstance(parameter.type, Vector):
        pointer = f"{'' if parameter.is_written else 'const '}double *{name}"
        lengths = [f"int {parameter.type.length(name, axis)}" for axis in parameter.axes]
        return [*[pointer] * parameter.is_used, *lengths]
    if isinstance(parameter.type, Known) or not parameter.is_used:
        return []
    return [f"{parameter.type.c_type} {name}"]


def _arguments(source: Routine, count: int) -> list[ast.arg]:
    arguments = source.tree.args
    if arguments.vararg or arguments.kwarg or arguments.kwonlyargs or arguments.defaults or arguments.posonlyargs:
        raise source.refusal(source.tree, "a function takes positional arguments without defaults")
    if len(arguments.args) != count:
        raise source.refusal(
            source.tree, f"{source.function.__name__} takes {len(arguments.args)} arguments, not {count}"
        )
    return arguments.args


def _as_annotated(argument: ast.arg, type_: Type) -> Type:
    """The type of an argument: a number is what its annotation says."""
    if isinstance(type_, Scalar) and isinstance(argument.annotation, ast.Name):
        return _ANNOTATED.get(argument.annotation.id, type_)
    return type_
