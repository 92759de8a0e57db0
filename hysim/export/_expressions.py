"""Expressions of the portable subset in C99, in Python's order of operations, with brackets only where C needs them."""

import ast
import builtins
import math
from collections.abc import Callable
from functools import partial
from types import BuiltinFunctionType, MappingProxyType, ModuleType
from typing import Any

import numpy as np

from hysim.export import _c
from hysim.export._c import (
    Known,
    Library,
    Parameter,
    Scalar,
    Scope,
    Several,
    Stretch,
    Type,
    UntranslatableError,
    Value,
    Vector,
    plain,
)
from hysim.kernels.stepping import borrowed

_OPERATORS = MappingProxyType({ast.Add: ("+", _c.SUM), ast.Sub: ("-", _c.SUM), ast.Mult: ("*", _c.PRODUCT)})
_COMPARED = MappingProxyType(
    {
        **{
            ast.Lt: ("<", _c.RELATION),
            ast.LtE: ("<=", _c.RELATION),
            ast.Gt: (">", _c.RELATION),
            ast.GtE: (">=", _c.RELATION),
        },
        **{ast.Eq: ("==", _c.EQUALITY), ast.NotEq: ("!=", _c.EQUALITY)},
    }
)


class Expressions:
    def __init__(self, library: Library, scope: Scope) -> None:
        self.library, self.scope = library, scope

    # ------------------------------------------------------------------------------ entry points

    def value(self, node: ast.expr) -> Value:
        """A number."""
        result = self.any(node)
        if not isinstance(result, Value) or not isinstance(result.type, Scalar):
            raise self._refusal(node, "a number is expected here")
        return result

    def condition(self, node: ast.expr) -> Value:
        result = self.value(node)
        if result.type is Scalar.BOOL:
            return result
        return Value(f"{result.within(_c.EQUALITY + 1)} != 0", Scalar.BOOL, _c.EQUALITY)

    def index(self, node: ast.expr) -> Value:
        """An integer."""
        result = self.value(node)
        if result.type is Scalar.DOUBLE:
            raise self._refusal(node, "an index is an integer")
        return result

    def stretch(self, node: ast.expr) -> Stretch:
        """A vector."""
        result = self.any(node)
        if not isinstance(result, Stretch):
            raise self._refusal(node, "a vector is expected here")
        return result

    def known(self, node: ast.expr) -> bool | None:
        """Truth of a condition that is decided when the program is translated; None where it is not."""
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is | ast.IsNot):
            left, right = self._type(node.left), self._type(node.comparators[0])
            return (left == right == Known(None)) == isinstance(node.ops[0], ast.Is)
        return bool(node.value) if isinstance(node, ast.Constant) and isinstance(node.value, bool) else None

    def any(self, node: ast.expr) -> Value | Stretch:
        """A number, a vector, or a function."""
        methods: dict[type[ast.expr], Callable[[Any], Value | Stretch]] = {
            ast.Constant: self._constant, ast.Name: self._name, ast.Attribute: self._attribute, ast.BinOp: self._binary,
            ast.UnaryOp: self._unary, ast.BoolOp: self._junction, ast.Compare: self._comparison,
            ast.IfExp: self._choice, ast.Subscript: self._subscript, ast.Call: self._call,
        }  # fmt: skip
        if type(node) not in methods:
            raise self._refusal(node, f"{type(node).__name__} is no expression of the subset")
        return methods[type(node)](node)

    # ------------------------------------------------------------------------------ names and constants

    def _constant(self, node: ast.Constant) -> Value:
        return self._literal(node, node.value, "")

    def _literal(self, node: ast.AST, value: Any, name: str) -> Value | Any:
        if isinstance(value, bool | np.bool_):
            return Value(str(int(value)), Scalar.BOOL)
        if isinstance(value, int | np.integer):
            return Value(str(int(value)), Scalar.INT, _c.PRIMARY if value >= 0 else _c.UNARY)
        if isinstance(value, float):
            return Value(_c.number(value), Scalar.DOUBLE, _c.UNARY if math.copysign(1.0, value) < 0.0 else _c.PRIMARY)
        if value is None or callable(plain(value)):
            return Value("", Known(None if value is None else plain(value)))
        if _c.is_table(value):
            text = self.library.table(name, value)
            return Stretch(text, (lambda: str(len(value)),), frozenset())
        raise self._refusal(
            node, f"{name} is a {type(value).__name__}: constants are numbers, vectors of doubles and kernels"
        )

    def _name(self, node: ast.Name) -> Value | Stretch:
        name, scope = node.id, self.scope
        type_ = scope.types.get(name)
        if isinstance(type_, Vector):
            scope.used.add(name)
            lengths = tuple(partial(self._length, name, type_, axis) for axis in range(type_.rank))
            return Stretch(scope.c_name(name), lengths, scope.roots.get(name, frozenset()) | {name})
        if isinstance(type_, Known):
            return Value("", type_)
        if type_ is not None:
            scope.used.add(name)
            return Value(scope.c_name(name), type_)
        if name not in scope.source.names:
            raise self._refusal(node, f"{name} is read before it has a value")
        result: Value | Stretch = self._literal(node, scope.source.names[name], name)
        return result

    def _length(self, name: str, type_: Vector, axis: int) -> str:
        self.scope.lengths.add((name, axis))
        return type_.length(self.scope.c_name(name), axis)

    def _attribute(self, node: ast.Attribute) -> Value | Stretch:
        if node.attr == "size" and isinstance(self._type(node.value), Vector):
            return Value(self._vector(node.value, quietly=True).lengths[0](), Scalar.INT, _c.SUM)
        owner = self._module(node.value)
        if owner is None or node.attr not in vars(owner):
            raise self._refusal(node, f"{ast.unparse(node)} is unknown")
        result: Value | Stretch = self._literal(node, vars(owner)[node.attr], node.attr)
        return result

    def quietly(self, node: ast.expr) -> Stretch:
        """An array of which the lengths alone are used."""
        used = set(self.scope.used)
        result = self.stretch(node)
        self.scope.used = used
        return result

    def _vector(self, node: ast.expr, *, quietly: bool = False) -> Stretch:
        result = self.quietly(node) if quietly else self.stretch(node)
        if len(result.lengths) != 1:
            raise self._refusal(node, "an array of one axis is expected here")
        return result

    def _module(self, node: ast.expr) -> ModuleType | None:
        owner = self.scope.source.names.get(node.id) if isinstance(node, ast.Name) else None
        return owner if isinstance(owner, ModuleType) else None

    # ------------------------------------------------------------------------------ operators

    def _binary(self, node: ast.BinOp) -> Value:
        left, right = self.value(node.left), self.value(node.right)
        types = left.type, right.type
        kind = max(*types, Scalar.INT)
        if type(node.op) in _OPERATORS:
            sign, binds = _OPERATORS[type(node.op)]
            return Value(f"{left.within(binds)} {sign} {right.within(binds + 1)}", kind, binds)
        if isinstance(node.op, ast.Div):
            first = left.within(_c.PRODUCT) if kind is Scalar.DOUBLE else f"(double){left.within(_c.UNARY)}"
            return Value(f"{first} / {right.within(_c.PRODUCT + 1)}", Scalar.DOUBLE, _c.PRODUCT)
        if isinstance(node.op, ast.Pow):
            return self._power(node, left, right)
        if isinstance(node.op, ast.BitAnd | ast.BitOr) and kind is Scalar.INT:
            sign = "&" if isinstance(node.op, ast.BitAnd) else "|"
            return Value(f"({left.within(_c.UNARY)} {sign} {right.within(_c.UNARY)})", max(types))
        if isinstance(node.op, ast.FloorDiv | ast.Mod) and kind is Scalar.INT:
            helper = "floor_quotient" if isinstance(node.op, ast.FloorDiv) else "floor_rest"
            return self._helped(helper, Scalar.INT, left, right)
        raise self._refusal(node, f"{ast.unparse(node)} has no translation")

    def _power(self, node: ast.BinOp, base: Value, exponent: Value) -> Value:
        constant = node.right.value if isinstance(node.right, ast.Constant) else None
        if constant in (2, 3, 4) and isinstance(constant, int):
            if constant == 2 and isinstance(node.left, ast.Name):
                return Value(f"{base.text} * {base.text}", base.type, _c.PRODUCT)
            return self._helped(f"power_{constant}", Scalar.DOUBLE, base)
        return Value(f"pow({base.text}, {exponent.text})", Scalar.DOUBLE)

    def _unary(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"!{self.condition(node.operand).within(_c.UNARY + 1)}", Scalar.BOOL, _c.UNARY)
        operand = self.value(node.operand)
        if isinstance(node.op, ast.USub):
            return Value(f"-{operand.within(_c.UNARY + 1)}", max(operand.type, Scalar.INT), _c.UNARY)
        if isinstance(node.op, ast.UAdd):
            return operand
        raise self._refusal(node, f"{ast.unparse(node)} has no translation")

    def _junction(self, node: ast.BoolOp) -> Value:
        sign, binds = ("&&", _c.AND) if isinstance(node.op, ast.And) else ("||", _c.OR)
        parts = [self.value(each) for each in node.values]
        if any(part.type is not Scalar.BOOL for part in parts):
            raise self._refusal(node, "`and` and `or` join truth values")
        return Value(f" {sign} ".join(part.within(_c.EQUALITY) for part in parts), Scalar.BOOL, binds)

    def _comparison(self, node: ast.Compare) -> Value:
        if (known := self.known(node)) is not None:
            return Value(str(int(known)), Scalar.BOOL)
        pairs = zip([node.left, *node.comparators], node.comparators, node.ops, strict=False)
        parts = [self._compared(node, *each) for each in pairs]
        if len(parts) == 1:
            return parts[0]
        return Value(" && ".join(part.within(_c.EQUALITY) for part in parts), Scalar.BOOL, _c.AND)

    def _compared(self, node: ast.AST, left: ast.expr, right: ast.expr, operator: ast.cmpop) -> Value:
        if isinstance(operator, ast.In | ast.NotIn) and isinstance(right, ast.Tuple):
            sign, join, binds = ("==", " || ", _c.OR) if isinstance(operator, ast.In) else ("!=", " && ", _c.AND)
            first = self.value(left).within(_c.SUM)
            return Value(
                join.join(f"{first} {sign} {self.value(e).within(_c.SUM)}" for e in right.elts), Scalar.BOOL, binds
            )
        if type(operator) not in _COMPARED:
            raise self._refusal(node, "this comparison has no translation")
        sign, binds = _COMPARED[type(operator)]
        return Value(f"{self.value(left).within(_c.SUM)} {sign} {self.value(right).within(_c.SUM)}", Scalar.BOOL, binds)

    def _choice(self, node: ast.IfExp) -> Value | Stretch:
        if (known := self.known(node.test)) is not None:
            return self.any(node.body if known else node.orelse)
        test, first, second = self.condition(node.test), self.value(node.body), self.value(node.orelse)
        kind = max(first.type, second.type)
        return Value(f"{test.within(_c.OR)} ? {first.within(_c.OR)} : {second.text}", kind, _c.CONDITIONAL)

    # ------------------------------------------------------------------------------ vectors

    def shape(self, node: ast.expr) -> Stretch | None:
        """The array of which an expression is the shape; None where it is something else."""
        if isinstance(node, ast.Attribute) and node.attr == "shape" and self._module(node.value) is None:
            return self.quietly(node.value)
        return None

    def _subscript(self, node: ast.Subscript) -> Value | Stretch:
        if (shaped := self.shape(node.value)) is not None:
            if not isinstance(node.slice, ast.Constant) or not isinstance(node.slice.value, int):
                raise self._refusal(node, "the axis of a shape is a number")
            return Value(shaped.lengths[node.slice.value](), Scalar.INT, _c.SUM)
        if not isinstance(node.slice, ast.Slice):
            whole = self.any(node.value)
            if isinstance(whole, Value):
                return self._member(node, whole)
            return Value(
                f"{whole.text if whole.binds == _c.PRIMARY else f'({whole.text})'}{self.place(node, whole)}",
                Scalar.DOUBLE,
            )
        whole = self.stretch(node.value)
        if node.slice.step is not None:
            raise self._refusal(node, "a slice has no stride")
        first = None if node.slice.lower is None else self.index(node.slice.lower)
        upper = node.slice.upper

        def length() -> str:
            stop = Value(whole.lengths[0](), Scalar.INT, _c.SUM) if upper is None else self.index(upper)
            return stop.text if first is None else f"{stop.within(_c.SUM)} - {first.within(_c.SUM + 1)}"

        lengths = (length, *whole.lengths[1:])
        if first is None:
            return whole._replace(lengths=lengths)
        offset = first
        for each in whole.lengths[1:]:
            row = Value(each(), Scalar.INT, _c.SUM).within(_c.PRODUCT + 1)
            offset = Value(f"{offset.within(_c.PRODUCT)} * {row}", Scalar.INT, _c.PRODUCT)
        return Stretch(f"{whole.text} + {offset.within(_c.SUM + 1)}", lengths, whole.roots, _c.SUM)

    def _member(self, node: ast.Subscript, several: Value) -> Value:
        place = node.slice.value if isinstance(node.slice, ast.Constant) else None
        if not isinstance(several.type, Several) or not isinstance(place, int):
            raise self._refusal(node, "an array, or one of the results of a function, is expected here")
        return Value(f"{several.text}.at{place}", several.type.members[place])

    def place(self, node: ast.Subscript, whole: Stretch) -> str:
        index = node.slice
        parts = index.elts if isinstance(index, ast.Tuple) else [index]
        if len(parts) != len(whole.lengths):
            raise self._refusal(node, "an element has one index for each axis")
        if isinstance(index, ast.UnaryOp) and isinstance(index.operand, ast.Constant) and index.operand.value == 1:
            return f"[{whole.lengths[0]()} - 1]"
        total = self.index(parts[0])
        for part, length in zip(parts[1:], whole.lengths[1:], strict=True):
            if total.text == "0":
                total = self.index(part)
                continue
            times = Value(length(), Scalar.INT, _c.SUM).within(_c.PRODUCT + 1)
            text = f"{total.within(_c.PRODUCT)} * {times} + {self.index(part).within(_c.SUM + 1)}"
            total = Value(text, Scalar.INT, _c.SUM)
        return f"[{total.text}]"

    # ------------------------------------------------------------------------------ calls

    def _call(self, node: ast.Call) -> Value | Stretch:
        if node.keywords:
            raise self._refusal(node, "a call has no keyword arguments")
        if (
            isinstance(node.func, ast.Attribute)
            and node.func.attr == "reshape"
            and self._module(node.func.value) is None
        ):
            return self._reshaped(node, node.func.value)
        called = self._callee(node.func)
        if called is plain(borrowed):
            return self.any(node.args[0])
        builtin = self._builtin(node, called)
        return self._translated(node, called) if builtin is None else builtin

    def _callee(self, node: ast.expr) -> Any:
        if isinstance(node, ast.Name):
            type_ = self.scope.types.get(node.id)
            if isinstance(type_, Known):
                return type_.value
            if node.id in self.scope.source.names:
                return plain(self.scope.source.names[node.id])
            return vars(builtins).get(node.id) if type_ is None else None
        if isinstance(node, ast.Attribute) and (owner := self._module(node.value)) is not None:
            return plain(vars(owner).get(node.attr))
        raise self._refusal(node, f"{ast.unparse(node)} is no function that is known beforehand")

    def _reshaped(self, node: ast.Call, of: ast.expr) -> Stretch:
        if len(node.args) != 1 or not isinstance(node.args[0], ast.Tuple):
            raise self._refusal(node, "reshape takes a tuple of lengths")
        whole, lengths = self._vector(of), node.args[0].elts
        return whole._replace(lengths=tuple(partial(self._extent, each) for each in lengths))

    def _extent(self, node: ast.expr) -> str:
        return self.index(node).text

    def _builtin(self, node: ast.Call, called: Any) -> Value | None:
        """A call of a function that C has, or that is a helper; None for another one."""
        if called is len:
            return Value(self.quietly(node.args[0]).lengths[0](), Scalar.INT, _c.SUM)
        name = called.__name__ if isinstance(called, BuiltinFunctionType) and called.__module__ == "math" else ""
        if called in (float, int, bool, abs, min, max) or name:
            values = [self.value(each) for each in node.args]
        if called in (float, int):
            kind = Scalar.DOUBLE if called is float else Scalar.INT
            (value,) = values
            return value if value.type is kind else Value(f"({kind.c_type}){value.within(_c.UNARY)}", kind, _c.UNARY)
        if called is bool:
            return self.condition(node.args[0])
        if called is abs:
            (value,) = values
            if value.type is Scalar.DOUBLE:
                return Value(f"fabs({value.text})", Scalar.DOUBLE)
            return self._helped("absolute_int", Scalar.INT, value)
        if called in (min, max):
            return self._extreme("smaller" if called is min else "larger", values)
        if name in _c.TESTS:
            return Value(f"{name}({values[0].text}) != 0", Scalar.BOOL, _c.EQUALITY)
        if name in _c.MATHEMATICS:
            return Value(f"{name}({', '.join(value.text for value in values)})", Scalar.DOUBLE)
        return None

    def _extreme(self, name: str, values: list[Value]) -> Value:
        kind = Scalar.DOUBLE if any(value.type is Scalar.DOUBLE for value in values) else Scalar.INT
        total = values[0]
        for value in values[1:]:
            total = self._helped(name if kind is Scalar.DOUBLE else f"{name}_int", kind, total, value)
        return total

    def _helped(self, helper: str, kind: Scalar, *values: Value) -> Value:
        self.library.helpers |= {helper, "below"} if helper in ("floor_quotient", "floor_rest") else {helper}
        return Value(f"{helper}({', '.join(value.text for value in values)})", kind)

    def _translated(self, node: ast.Call, called: Any) -> Value:
        types = tuple(self._type(each) for each in node.args)
        if called is None or not callable(called):
            raise self._refusal(
                node, f"{ast.unparse(node.func)} is no function that is known when the program is translated"
            )
        function = self.library.function(called, types)
        given: list[str] = []
        for each, parameter in zip(node.args, function.parameters, strict=True):
            given += self._given(each, parameter)
        returns = Scalar.INT if function.returns is None else function.returns
        return Value(f"{function.name}({', '.join(given)})", returns)

    def _given(self, node: ast.expr, parameter: Parameter) -> list[str]:
        """An argument as far as the function uses it, and its length where that is used."""
        if not isinstance(parameter.type, Vector):
            return [self.value(node).text] if parameter.is_used else []
        stretch = self.stretch(node) if parameter.is_used else self.quietly(node)
        if parameter.is_written:
            for root in stretch.roots:
                self.scope.write(root)
        return [*[stretch.text] * parameter.is_used, *(stretch.lengths[axis]() for axis in parameter.axes)]

    def writes(self, node: ast.expr) -> bool:
        return bool(self._tried(node)[1])

    def _type(self, node: ast.expr) -> Type:
        return self._tried(node)[0]

    def _tried(self, node: ast.expr) -> tuple[Type, set[str]]:
        """Type of an expression, and the arrays that it writes to, without a trace."""
        scope = self.scope
        before = scope.lengths, scope.written, scope.used
        scope.lengths, scope.written, scope.used = set(), set(), set()
        type_, written = self.any(node).type, scope.written
        scope.lengths, scope.written, scope.used = before
        return type_, written

    def _refusal(self, node: ast.AST, reason: str) -> UntranslatableError:
        return self.scope.source.refusal(node, reason)
