"""Expressions of the portable subset in forward mode.

An expression with a rate is computed operation by operation into local names; one without stands as it is.
"""

import ast
import builtins
import copy
import math
from collections.abc import Callable
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any, NamedTuple, Protocol

import numpy as np

from hysim.kernels.stepping import borrowed
from hysim.models.derivatives.iterations import is_general, one_more_step, steers
from hysim.models.derivatives.sources import called_function, is_kernel, is_table, returned_kinds, root_of, writes
from hysim.models.tracing.routine import Routine, plain, routine

_WHOLE_OPERATORS = (ast.FloorDiv, ast.Mod, ast.BitAnd, ast.BitOr)
_WITHOUT_RATE = ("floor", "ceil", "trunc", "isfinite", "isinf", "isnan", "isqrt", "factorial")
_FUNCTIONS = {
    "exp": "{v} * {d}",
    "expm1": "math.exp({x}) * {d}",
    "log": "quotient({d}, {x})",
    "log1p": "quotient({d}, 1.0 + {x})",
    "log2": "quotient({d}, {x} * 0.6931471805599453)",
    "sqrt": "root_rate({v}, {d})",
    "sin": "math.cos({x}) * {d}",
    "cos": "-math.sin({x}) * {d}",
    "tan": "(1.0 + {v} * {v}) * {d}",
    "tanh": "(1.0 - {v}) * (1.0 + {v}) * {d}",
    "atan": "{d} / (1.0 + {x} * {x})",
    "atanh": "quotient({d}, (1.0 - {x}) * (1.0 + {x}))",
    "fabs": "size_rate({x}, {d})",
}


class Dual(NamedTuple):
    """Text of a value, and of its rate where it has one."""

    value: str
    rate: str | None = None


class Called(Protocol):
    """A translated function."""

    @property
    def name(self) -> str: ...

    @property
    def has_rates(self) -> bool: ...


class Library(Protocol):
    """Collection of functions and constant arrays."""

    def function(self, of: Callable[..., Any], flags: tuple[Any, ...]) -> Called:
        """The translation of a function."""

    def constant(self, source: Routine, name: str, value: Any) -> str:
        """Name of a constant array."""


class Expressions:
    """Translates the expressions of one function; `lines` are the statements so far.

    Parameters
    ----------
    library, source : Library and Routine
        Where called functions are collected, and the function.
    local : set of str
        Its local names; `known` are arguments with known values, `moving` names that have a rate.
    """

    def __init__(
        self, library: Library, source: Routine, local: set[str], known: dict[str, Any], moving: set[str]
    ) -> None:
        self.library, self.source, self.local, self._known, self.moving = library, source, local, known, moving
        self.lines: list[str] = []
        self.indent = ""
        self._count = 0
        self.arrays = _local_arrays(source)

    # ------------------------------------------------------------------------------ what has a rate

    def moves(self, node: ast.expr) -> bool:
        """Whether an expression has a rate."""
        if isinstance(node, ast.Name):
            return node.id in self.moving
        if isinstance(node, ast.BinOp):
            return not isinstance(node.op, _WHOLE_OPERATORS) and (self.moves(node.left) or self.moves(node.right))
        if isinstance(node, ast.UnaryOp):
            return not isinstance(node.op, ast.Not) and self.moves(node.operand)
        if isinstance(node, ast.IfExp):
            return self.moves(node.body) or self.moves(node.orelse)
        if isinstance(node, ast.Subscript):
            return self._part_moves(node)
        if isinstance(node, ast.Call):
            return any(self.kinds_moving(node, None))
        return isinstance(node, ast.Tuple) and any(map(self.moves, node.elts))

    def _part_moves(self, node: ast.Subscript) -> bool:
        if isinstance(node.value, ast.Call) and is_kernel(self._callee(node.value)):
            kinds = self.kinds_moving(node.value, None)
            return kinds[_place(node)]
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            return False
        return root_of(node) in self.moving

    def kinds_moving(self, node: ast.expr, count: int | None) -> list[bool]:
        """For each number of a result, of `count` numbers if it is an array, whether it has a rate."""
        if not isinstance(node, ast.Call):
            return [self.moves(node)] * (count or 1)
        called = self._callee(node)
        if not is_kernel(called):
            return [self._builtin_moves(node, called)]
        own = not steers(called) and any(map(self.moves, node.args))
        return [own and is_float for is_float in returned_kinds(routine(called))]

    def _builtin_moves(self, node: ast.Call, called: Any) -> bool:
        if (
            isinstance(node.func, ast.Attribute)
            and node.func.attr == "reshape"
            and not self._is_module(node.func.value)
        ):
            return root_of(node) in self.moving
        name = called.__name__ if isinstance(called, BuiltinFunctionType | FunctionType) else ""
        if called in (int, bool, len, range) or name in ("empty", "zeros", *_WITHOUT_RATE):
            return False
        if name == "copysign":
            return self.moves(node.args[0])
        return any(map(self.moves, node.args))

    def _is_module(self, node: ast.expr) -> bool:
        return isinstance(node, ast.Name) and isinstance(self.source.names.get(node.id), ModuleType)

    def _callee(self, node: ast.Call) -> Any:
        if isinstance(node.func, ast.Name) and node.func.id in self._known:
            return plain(self._known[node.func.id])
        called = called_function(self.source, node.func)
        if called is None and isinstance(node.func, ast.Name):
            return vars(builtins).get(node.func.id)
        return called

    def known(self, node: ast.expr) -> bool | None:
        """Truth of a condition on an argument that is known; None for other conditions."""
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is | ast.IsNot):
            name = node.left.id if isinstance(node.left, ast.Name) else ""
            if name in self._known:
                return (self._known[name] is None) == isinstance(node.ops[0], ast.Is)
        return None

    # ------------------------------------------------------------------------------ text

    def emit(self, line: str) -> None:
        """Write a statement."""
        self.lines.append(self.indent + line)

    def fresh(self) -> str:
        """A new local name."""
        self._count += 1
        return f"_v{self._count}"

    def kept(self, dual: Dual) -> Dual:
        """These values in names that nothing else changes."""
        if _is_number(dual.value) and dual.rate is None:
            return dual
        name = self.fresh()
        self.emit(f"{name} = {dual.value}")
        if dual.rate is None:
            return Dual(name)
        self.emit(f"{name}__d = {dual.rate}")
        return Dual(name, f"{name}__d")

    def plain(self, node: ast.expr) -> str:
        """The value of an expression, as it stands."""
        known = self.known(node)
        return repr(known) if known is not None else ast.unparse(_Values(self).visit(copy.deepcopy(node)))

    def element(self, node: ast.expr) -> tuple[str, str | None]:
        """An element or a part of an array, and of its rates if it has some."""
        if isinstance(node, ast.Name):
            text = self.plain(node)
            return text, f"{text}__d" if node.id in self.moving else None
        if isinstance(node, ast.Subscript):
            value, rate = self.element(node.value)
            place = self.plain(node.slice)
            return f"{value}[{place}]", None if rate is None else f"{rate}[{place}]"
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            value, rate = self.element(node.func.value)
            shape = f".reshape({', '.join(map(self.plain, node.args))})"
            return value + shape, None if rate is None else rate + shape
        if isinstance(node, ast.Call) and self._callee(node) is plain(borrowed):
            return self.element(node.args[0])
        raise self.source.refusal(node, f"{ast.unparse(node)} is no array")

    # ------------------------------------------------------------------------------ values with a rate

    def dual(self, node: ast.expr) -> Dual:
        """An expression, computed as far as it has a rate."""
        if isinstance(node, ast.Call) and is_kernel(self._callee(node)):
            results = self.results(node)
            return results[0]
        if not self.moves(node):
            return Dual(self.plain(node))
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Call) and is_kernel(self._callee(node.value)):
            return self.results(node.value)[_place(node)]
        if isinstance(node, ast.Name | ast.Subscript):
            return Dual(*self.element(node))
        if isinstance(node, ast.BinOp):
            return self._binary(node)
        if isinstance(node, ast.UnaryOp):
            operand = self._operand(node.operand)
            sign = "-" if isinstance(node.op, ast.USub) else ""
            return self.kept(Dual(f"{sign}{operand.value}", f"{sign}{operand.rate}"))
        if isinstance(node, ast.IfExp):
            return self._choice(node)
        if isinstance(node, ast.Call):
            return self._builtin(node)
        raise self.source.refusal(node, f"{type(node).__name__} is no expression of the subset")

    def _operand(self, node: ast.expr) -> Dual:
        """A number in a short text that can be repeated."""
        dual = self.dual(node)
        if dual.rate is None and not isinstance(node, ast.Name | ast.Constant):
            return self.kept(dual)
        return dual

    def _operands(self, nodes: list[ast.expr]) -> list[Dual]:
        """Numbers side by side; one is kept where a later one may change the array that it lies in."""
        duals = []
        for k, node in enumerate(nodes):
            dual = self._operand(node)
            later = any(isinstance(each, ast.Call) for other in nodes[k + 1 :] for each in ast.walk(other))
            duals.append(self.kept(dual) if later and not isinstance(node, ast.Name | ast.Constant) else dual)
        return duals

    def _binary(self, node: ast.BinOp) -> Dual:
        left, right = self._operands([node.left, node.right])
        (x, dx), (y, dy) = left, right
        if isinstance(node.op, ast.Add | ast.Sub):
            sign = "+" if isinstance(node.op, ast.Add) else "-"
            rates = [dx or "", f"{sign} {dy}" if dy else ""]
            rate = " ".join(each for each in rates if each)
            return self.kept(Dual(f"{x} {sign} {y}", rate.removeprefix("+ ")))
        if isinstance(node.op, ast.Mult):
            rates = [f"{dx} * {y}" if dx else "", f"{x} * {dy}" if dy else ""]
            return self.kept(Dual(f"{x} * {y}", " + ".join(each for each in rates if each)))
        name = self.fresh()
        if isinstance(node.op, ast.Div):
            self.emit(f"{name} = {f'quotient({x}, {y})' if dy else f'{x} / {y}'}")
            above = f"{dx or '0.0'} - {name} * {dy}" if dy else dx
            self.emit(f"{name}__d = quotient({above}, {y})")
        elif isinstance(node.op, ast.Pow):
            self.emit(f"{name} = {x} ** {y}")
            square = isinstance(node.right, ast.Constant) and node.right.value == 2
            rate = f"2.0 * {x} * {dx}" if square else f"power_rate({x}, {y}, {name}, {dx or '0.0'}, {dy or '0.0'})"
            self.emit(f"{name}__d = {rate}")
        else:
            raise self.source.refusal(node, f"{ast.unparse(node)} has no derivative")
        return Dual(name, f"{name}__d")

    def _choice(self, node: ast.IfExp) -> Dual:
        known = self.known(node.test)
        if known is not None:
            return self.dual(node.body if known else node.orelse)
        name, before = self.fresh(), self.indent
        self.emit(f"if {self.plain(node.test)}:")
        for k, branch in enumerate((node.body, node.orelse)):
            if k:
                self.emit("else:")
            self.indent = before + "    "
            dual = self.dual(branch)
            self.emit(f"{name} = {dual.value}")
            self.emit(f"{name}__d = {dual.rate or '0.0'}")
            self.indent = before
        return Dual(name, f"{name}__d")

    # ------------------------------------------------------------------------------ calls

    def _builtin(self, node: ast.Call) -> Dual:
        called = self._callee(node)
        is_part = isinstance(node.func, ast.Attribute) and node.func.attr == "reshape"
        if is_part or called is plain(borrowed):
            return Dual(*self.element(node))
        operands = self._operands(node.args)
        if called is float:
            return operands[0]
        if called in (min, max):
            return self._extreme("<" if called is min else ">", operands)
        name = self.fresh()
        if called is abs:
            self.emit(f"{name} = abs({operands[0].value})")
            self.emit(f"{name}__d = size_rate({operands[0].value}, {operands[0].rate})")
            return Dual(name, f"{name}__d")
        function = called.__name__ if isinstance(called, BuiltinFunctionType) and called.__module__ == "math" else ""
        values, rates = [each.value for each in operands], [each.rate or "0.0" for each in operands]
        self.emit(f"{name} = math.{function}({', '.join(values)})")
        if function in _FUNCTIONS:
            rate = _FUNCTIONS[function].format(v=name, x=values[0], d=rates[0])
        elif function == "hypot":
            rate = f"distance_rate({values[0]}, {values[1]}, {name}, {rates[0]}, {rates[1]})"
        elif function == "copysign":
            rate = f"signed_rate({values[0]}, {values[1]}, {rates[0]})"
        elif function == "pow":
            rate = f"power_rate({values[0]}, {values[1]}, {name}, {rates[0]}, {rates[1]})"
        else:
            raise self.source.refusal(node, f"{ast.unparse(node.func)} has no derivative here")
        self.emit(f"{name}__d = {rate}")
        return Dual(name, f"{name}__d")

    def _extreme(self, sign: str, operands: list[Dual]) -> Dual:
        """The smallest, or largest, number; of equal ones that which will be."""
        best = self.kept(Dual(operands[0].value, operands[0].rate or "0.0"))
        for each in operands[1:]:
            tie = f"{each.value} == {best.value} and {each.rate or '0.0'} {sign} {best.rate}"
            self.emit(f"if {each.value} {sign} {best.value} or ({tie}):")
            self.emit(f"    {best.value} = {each.value}")
            self.emit(f"    {best.rate} = {each.rate or '0.0'}")
        return best

    def results(self, node: ast.Call) -> list[Dual]:
        """Every number that a call returns."""
        called = self._callee(node)
        if not is_kernel(called):
            raise self.source.refusal(node, f"{ast.unparse(node.func)} is no function that is known beforehand")
        flags = self._flags(called, node)
        again = one_more_step(called) if True in flags else None
        if again is None:
            return self._called(called, flags, self._arguments(node, flags))
        still = tuple(False if flag is True else flag for flag in flags)
        roots = self._called(called, still, self._arguments(node, still))
        given = [Dual(each.value) for each in roots]
        moved = self._called(plain(again), (*[False] * len(roots), *flags), [*given, *self._arguments(node, flags)])
        return [Dual(root.value, each.rate) for root, each in zip(roots, moved, strict=True)]

    def _flags(self, called: Any, node: ast.Call) -> tuple[Any, ...]:
        passive = steers(called) or not (any(returned_kinds(routine(called))) or writes(called))
        return tuple(self._flag(each, passive) for each in node.args)

    def _flag(self, node: ast.expr, passive: bool) -> Any:
        if isinstance(node, ast.Name) and node.id in self._known:
            return (self._known[node.id],)
        if isinstance(node, ast.Constant) and node.value is None:
            return (None,)
        value = self.source.names.get(node.id) if isinstance(node, ast.Name) and node.id not in self.local else None
        if value is not None and is_kernel(plain(value)):
            return (plain(value),)
        return False if passive else self.moves(node)

    def _arguments(self, node: ast.Call, flags: tuple[Any, ...]) -> list[Dual]:
        chosen = [(each, flag) for each, flag in zip(node.args, flags, strict=True) if not isinstance(flag, tuple)]
        duals = []
        for k, (each, flag) in enumerate(chosen):
            dual = self.dual(each) if flag else Dual(self.plain(each))
            later = any(isinstance(part, ast.Call) for other, _ in chosen[k + 1 :] for part in ast.walk(other))
            number = isinstance(each, ast.Subscript) and not isinstance(each.slice, ast.Slice)
            duals.append(self.kept(dual) if later and number else dual)
        return duals

    def _called(self, called: Any, flags: tuple[Any, ...], arguments: list[Dual]) -> list[Dual]:
        function = self.library.function(called, flags)
        texts = [text for each in arguments for text in (each.value, each.rate) if text is not None]
        call, results = f"{function.name}({', '.join(texts)})", []
        for is_float in returned_kinds(routine(called)):
            name = self.fresh()
            results.append(Dual(name, f"{name}__d" if is_float and function.has_rates else None))
        names = [text for each in results for text in each if text is not None]
        self.emit(f"{', '.join(names)} = {call}" if names else call)
        return results


class _Values(ast.NodeTransformer):
    """An expression with the values of global names, and with translated functions."""

    def __init__(self, of: Expressions) -> None:
        self.of = of

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self.of.local or node.id not in self.of.source.names:
            return node
        return self._global(node, node.id, self.of.source.names[node.id])

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        owner = self.of.source.names.get(node.value.id) if isinstance(node.value, ast.Name) else None
        if isinstance(owner, ModuleType) and owner not in (math, np):
            return self._global(node, node.attr, vars(owner)[node.attr])
        if owner in (math, np):
            return ast.Attribute(ast.Name("math" if owner is math else "np", ast.Load()), node.attr, ast.Load())
        node.value = self.visit(node.value)
        return node

    def _global(self, node: ast.expr, name: str, value: Any) -> ast.expr:
        if is_table(value):
            return ast.Name(self.of.library.constant(self.of.source, name, value), ast.Load())
        if isinstance(value, bool | int | float) or value is None:
            if isinstance(value, float) and not math.isfinite(value):
                return ast.parse(f"math.{'nan' if math.isnan(value) else 'inf'}", mode="eval").body
            return ast.Constant(value)
        raise self.of.source.refusal(node, f"{name} is a {type(value).__name__}")

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        pair = node.left, node.comparators[0]
        equality = len(node.ops) == 1 and isinstance(node.ops[0], ast.Eq | ast.NotEq)
        if (
            equality
            and is_general(self.of.source.function, *pair)
            and any(map(self.of.moves, pair))
            and all(map(_is_atom, pair))
        ):
            rates = [self.of.element(each)[1] if self.of.moves(each) else "0.0" for each in pair]
            sign, join = ("==", "and") if isinstance(node.ops[0], ast.Eq) else ("!=", "or")
            first, second = (ast.unparse(self.visit(each)) for each in pair)
            return ast.parse(f"({first} {sign} {second} {join} {rates[0]} {sign} {rates[1]})", mode="eval").body
        return self.generic_visit(node)  # type: ignore[return-value]

    def visit_Call(self, node: ast.Call) -> ast.expr:
        called = self.of._callee(node)
        if called is plain(borrowed):
            return self.visit(node.args[0])  # type: ignore[no-any-return]
        if not is_kernel(called):
            node.args = [self.visit(each) for each in node.args]
            if isinstance(node.func, ast.Attribute):
                node.func = self.visit(node.func)
            return node
        flags = self.of._flags(called, node)
        if True in flags and writes(called):
            return ast.Name(self.of.results(node)[0].value, ast.Load())
        still = tuple(False if flag is True else flag for flag in flags)
        function = self.of.library.function(called, still)
        kept = [each for each, flag in zip(node.args, flags, strict=True) if not isinstance(flag, tuple)]
        return ast.Call(ast.Name(function.name, ast.Load()), [self.visit(each) for each in kept], [])


def _place(node: ast.Subscript) -> int:
    """Which of the results of a call is taken."""
    return int(ast.literal_eval(node.slice))


def _is_atom(node: ast.expr) -> bool:
    if isinstance(node, ast.UnaryOp):
        node = node.operand
        return isinstance(node, ast.Constant)
    return isinstance(node, ast.Name | ast.Constant | ast.Subscript)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _local_arrays(source: Routine) -> set[str]:
    """Local names of arrays that the function makes."""
    names = set()
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call) and len(node.targets) == 1:
            called = ast.unparse(node.value.func)
            if called.startswith("np.") and isinstance(node.targets[0], ast.Name):
                names.add(node.targets[0].id)
    return names
