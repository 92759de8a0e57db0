"""Expressions of the portable subset in C99, in Python's order of operations, with brackets only where C needs them."""

import ast
import builtins
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial, reduce
from types import BuiltinFunctionType, FunctionType, MappingProxyType, ModuleType
from typing import Any

import numpy as np

from hysim.export import _c
from hysim.export._c import Known, Library, Parameter, Scalar, Scope, Several, Type, Value, Vector, plain
from hysim.kernels.stepping import borrowed

SIGNS = MappingProxyType(
    {
        ast.Add: ("+", _c.SUM), ast.Sub: ("-", _c.SUM), ast.Mult: ("*", _c.PRODUCT), ast.Div: ("/", _c.PRODUCT),
        ast.Lt: ("<", _c.RELATION), ast.LtE: ("<=", _c.RELATION), ast.Gt: (">", _c.RELATION),
        ast.GtE: (">=", _c.RELATION), ast.Eq: ("==", _c.EQUALITY), ast.NotEq: ("!=", _c.EQUALITY),
        ast.And: ("&&", _c.AND), ast.Or: ("||", _c.OR),
    }
)  # fmt: skip
"""Operators that C has, and how strongly they bind."""

_OF_INTEGERS = MappingProxyType(
    {ast.FloorDiv: "floor_quotient", ast.Mod: "floor_rest", ast.BitAnd: "&", ast.BitOr: "|"}
)


class Expressions:
    def __init__(self, library: Library, scope: Scope) -> None:
        self.library, self.scope, self.refusal = library, scope, scope.source.refusal

    # ------------------------------------------------------------------------------ entry points

    def value(self, node: ast.expr) -> Value:
        """A number."""
        result = self.any(node)
        if not isinstance(result.type, Scalar):
            raise self.refusal(node, "a number is expected here")
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
            raise self.refusal(node, "an index is an integer")
        return result

    def vector(self, node: ast.expr) -> Value:
        result = self.any(node)
        if not isinstance(result.type, Vector):
            raise self.refusal(node, "a vector is expected here")
        return result

    def quietly(self, node: ast.expr) -> Value:
        """An array; only its lengths are used."""
        used = set(self.scope.used)
        result = self.vector(node)
        self.scope.used = used
        return result

    def known(self, node: ast.expr) -> bool | None:
        """Truth of a condition that is decided when the program is translated; None where it is not."""
        if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is | ast.IsNot):
            left, right = self._type(node.left), self._type(node.comparators[0])
            return (left == right == Known(None)) == isinstance(node.ops[0], ast.Is)
        return bool(node.value) if isinstance(node, ast.Constant) and isinstance(node.value, bool) else None

    def any(self, node: ast.expr) -> Value:
        """A number, a vector, or a function."""
        methods: dict[type[ast.expr], Callable[[Any], Value]] = {
            ast.Constant: lambda constant: self._literal(constant, constant.value), ast.Name: self._name,
            ast.Attribute: self._attribute, ast.BinOp: self._binary, ast.UnaryOp: self._unary,
            ast.BoolOp: self._junction, ast.Compare: self._comparison, ast.IfExp: self._choice,
            ast.Subscript: self._subscript, ast.Call: self._call, ast.Tuple: self._tuple,
        }  # fmt: skip
        if type(node) not in methods:
            raise self.refusal(node, f"{type(node).__name__} is no expression of the subset")
        return methods[type(node)](node)

    def _tuple(self, node: ast.Tuple) -> Value:
        values = [self.value(each) for each in node.elts]
        kind = Several(tuple(value.type for value in values))  # type: ignore[misc]
        self.library.structs.add(kind)
        return Value(f"({kind.c_type}){{{', '.join(value.text for value in values)}}}", kind)

    # ------------------------------------------------------------------------------ names and constants

    def _literal(self, node: ast.AST, value: Any, name: str = "") -> Value:
        if isinstance(value, bool | np.bool_ | int | np.integer | float):
            text = _c.number(value) if isinstance(value, float) else str(int(value))
            is_bool, is_double = isinstance(value, bool | np.bool_), isinstance(value, float)
            kind = Scalar.BOOL if is_bool else Scalar.DOUBLE if is_double else Scalar.INT
            return Value(text, kind, _c.UNARY if text.startswith("-") else _c.PRIMARY)
        if value is None or callable(plain(value)):
            return Value("", Known(None if value is None else plain(value)))
        if _c.is_table(value):
            return Value(self.library.table(name, value), Vector(), lengths=(lambda: _length(str(len(value))),))
        what = f"{name} is a {type(value).__name__}"
        raise self.refusal(node, f"{what}: constants are numbers, vectors of doubles and kernels")

    def _name(self, node: ast.Name) -> Value:
        name, scope = node.id, self.scope
        type_ = scope.types.get(name)
        if type_ is None:
            if name not in scope.source.names:
                raise self.refusal(node, f"{name} is read before it has a value")
            return self._literal(node, scope.source.names[name], name)
        if isinstance(type_, Known):
            return Value("", type_)
        scope.used.add(name)
        if not isinstance(type_, Vector):
            return Value(scope.c_name(name), type_)
        lengths = tuple(partial(self._length_of, name, type_, axis) for axis in range(type_.rank))
        roots = scope.roots.get(name, frozenset()) | {name}
        return Value(scope.c_name(name), type_, lengths=lengths, roots=roots)

    def _length_of(self, name: str, type_: Vector, axis: int) -> Value:
        self.scope.lengths.add((name, axis))
        return _length(type_.length(self.scope.c_name(name), axis))

    def _attribute(self, node: ast.Attribute) -> Value:
        if node.attr == "size" and isinstance(self._type(node.value), Vector):
            return self._of_one_axis(node, self.quietly(node.value)).lengths[0]()
        owner = self._module(node.value)
        if owner is None or node.attr not in vars(owner):
            raise self.refusal(node, f"{ast.unparse(node)} is unknown")
        return self._literal(node, vars(owner)[node.attr], node.attr)

    def _of_one_axis(self, node: ast.expr, array: Value) -> Value:
        if len(array.lengths) != 1:
            raise self.refusal(node, "an array of one axis is expected here")
        return array

    def _module(self, node: ast.expr) -> ModuleType | None:
        owner = self.scope.source.names.get(node.id) if isinstance(node, ast.Name) else None
        return owner if isinstance(owner, ModuleType) else None

    # ------------------------------------------------------------------------------ operators

    def _binary(self, node: ast.BinOp) -> Value:
        left, right = self.value(node.left), self.value(node.right)
        kind = max(left.type, right.type, Scalar.INT)
        if isinstance(node.op, ast.Pow):
            return self._power(node, left, right)
        if type(node.op) in SIGNS:
            sign, binds = SIGNS[type(node.op)]
            first, is_division = left.within(binds), isinstance(node.op, ast.Div)
            if is_division and kind is Scalar.INT:
                first = f"(double){left.within(_c.UNARY)}"
            return Value(f"{first} {sign} {right.within(binds + 1)}", Scalar.DOUBLE if is_division else kind, binds)
        if type(node.op) not in _OF_INTEGERS or kind is not Scalar.INT:
            raise self.refusal(node, f"{ast.unparse(node)} has no translation")
        word = _OF_INTEGERS[type(node.op)]
        if word in ("&", "|"):
            return Value(f"({left.within(_c.UNARY)} {word} {right.within(_c.UNARY)})", max(left.type, right.type))
        self.library.helpers.add("below")
        return self._helped(word, Scalar.INT, left, right)

    def _power(self, node: ast.BinOp, base: Value, exponent: Value) -> Value:
        constant = node.right.value if isinstance(node.right, ast.Constant) else None
        if not isinstance(constant, int) or constant not in (2, 3, 4):
            return Value(f"pow({base.text}, {exponent.text})", Scalar.DOUBLE)
        if constant == 2 and isinstance(node.left, ast.Name):
            return Value(f"{base.text} * {base.text}", base.type, _c.PRODUCT)
        return self._helped(f"power_{constant}", Scalar.DOUBLE, base)

    def _unary(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"!{self.condition(node.operand).within(_c.UNARY + 1)}", Scalar.BOOL, _c.UNARY)
        operand = self.value(node.operand)
        if isinstance(node.op, ast.USub):
            return Value(f"-{operand.within(_c.UNARY + 1)}", max(operand.type, Scalar.INT), _c.UNARY)
        if isinstance(node.op, ast.UAdd):
            return operand
        raise self.refusal(node, f"{ast.unparse(node)} has no translation")

    def _junction(self, node: ast.BoolOp) -> Value:
        parts = [self.value(each) for each in node.values]
        if any(part.type is not Scalar.BOOL for part in parts):
            raise self.refusal(node, "`and` and `or` join truth values")
        return _joined(type(node.op), parts)

    def _comparison(self, node: ast.Compare) -> Value:
        if (known := self.known(node)) is not None:
            return Value(str(int(known)), Scalar.BOOL)
        pairs = zip([node.left, *node.comparators], node.comparators, node.ops, strict=False)
        parts = [self._compared(node, left, right, type(operator)) for left, right, operator in pairs]
        return parts[0] if len(parts) == 1 else _joined(ast.And, parts)

    def _compared(self, node: ast.AST, left: ast.expr, right: ast.expr, operator: type[ast.cmpop]) -> Value:
        if operator in (ast.In, ast.NotIn) and isinstance(right, ast.Tuple):
            one, all_ = (ast.Eq, ast.Or) if operator is ast.In else (ast.NotEq, ast.And)
            return _joined(all_, [self._compared(node, left, each, one) for each in right.elts])
        if operator not in SIGNS:
            raise self.refusal(node, "this comparison has no translation")
        sign, binds = SIGNS[operator]
        return Value(f"{self.value(left).within(_c.SUM)} {sign} {self.value(right).within(_c.SUM)}", Scalar.BOOL, binds)

    def _choice(self, node: ast.IfExp) -> Value:
        if (known := self.known(node.test)) is not None:
            return self.any(node.body if known else node.orelse)
        test, first, second = self.condition(node.test), self.value(node.body), self.value(node.orelse)
        text = f"{test.within(_c.OR)} ? {first.within(_c.OR)} : {second.text}"
        return Value(text, max(first.type, second.type), _c.CONDITIONAL)

    # ------------------------------------------------------------------------------ vectors

    def shape(self, node: ast.expr) -> Value | None:
        """The array whose shape is this expression; None if the expression is something else."""
        if isinstance(node, ast.Attribute) and node.attr == "shape" and self._module(node.value) is None:
            return self.quietly(node.value)
        return None

    def _subscript(self, node: ast.Subscript) -> Value:
        place = node.slice.value if isinstance(node.slice, ast.Constant) else None
        if (shaped := self.shape(node.value)) is not None:
            if not isinstance(place, int):
                raise self.refusal(node, "the axis of a shape is a number")
            return shaped.lengths[place]()
        if isinstance(node.slice, ast.Slice):
            return self._part(self.vector(node.value), node.slice)
        array = self.any(node.value)
        if isinstance(array.type, Vector):
            return Value(f"{array.within(_c.PRIMARY)}{self.place(node, array)}", Scalar.DOUBLE)
        if not isinstance(array.type, Several) or not isinstance(place, int):
            raise self.refusal(node, "an array, or one of the results of a function, is expected here")
        return Value(f"{array.text}.at{place}", array.type.members[place])

    def _part(self, array: Value, part: ast.Slice) -> Value:
        if part.step is not None:
            raise self.refusal(part.step, "a slice has no stride")
        first, upper = None if part.lower is None else self.index(part.lower), part.upper

        def length() -> Value:
            stop = array.lengths[0]() if upper is None else self.index(upper)
            return _length(stop.text if first is None else f"{stop.within(_c.SUM)} - {first.within(_c.SUM + 1)}")

        lengths = (length, *array.lengths[1:])
        if first is None:
            return array._replace(lengths=lengths)
        offset = first
        for each in array.lengths[1:]:
            row = each().within(_c.PRODUCT + 1)
            offset = Value(f"{offset.within(_c.PRODUCT)} * {row}", Scalar.INT, _c.PRODUCT)
        return array._replace(text=f"{array.text} + {offset.within(_c.SUM + 1)}", lengths=lengths, binds=_c.SUM)

    def place(self, node: ast.Subscript, array: Value) -> str:
        index = node.slice
        parts = index.elts if isinstance(index, ast.Tuple) else [index]
        if len(parts) != len(array.lengths):
            raise self.refusal(node, "an element has one index for each axis")
        if isinstance(index, ast.UnaryOp) and isinstance(index.operand, ast.Constant) and index.operand.value == 1:
            return f"[{array.lengths[0]().text} - 1]"
        total = self.index(parts[0])
        for part, length in zip(parts[1:], array.lengths[1:], strict=True):
            next_ = self.index(part)
            if total.text == "0":
                total = next_
                continue
            row = f"{total.within(_c.PRODUCT)} * {length().within(_c.PRODUCT + 1)}"
            total = Value(f"{row} + {next_.within(_c.SUM + 1)}", Scalar.INT, _c.SUM)
        return f"[{total.text}]"

    # ------------------------------------------------------------------------------ calls

    def _call(self, node: ast.Call) -> Value:
        if node.keywords:
            raise self.refusal(node, "a call has no keyword arguments")
        method = node.func
        if isinstance(method, ast.Attribute) and method.attr == "reshape" and self._module(method.value) is None:
            return self._reshaped(node, method.value)
        called = self._callee(method)
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
        raise self.refusal(node, f"{ast.unparse(node)} is no function that is known beforehand")

    def _reshaped(self, node: ast.Call, of: ast.expr) -> Value:
        if len(node.args) != 1 or not isinstance(node.args[0], ast.Tuple):
            raise self.refusal(node, "reshape takes a tuple of lengths")
        array, lengths = self._of_one_axis(of, self.vector(of)), node.args[0].elts
        extents = tuple(lambda node=each: _length(self.index(node).text) for each in lengths)
        return array._replace(type=Vector(len(lengths)), lengths=extents)

    def _builtin(self, node: ast.Call, called: Any) -> Value | None:
        """A call of a function that C has, or that is a helper; None for another one."""
        if called is len:
            return self.quietly(node.args[0]).lengths[0]()
        if called is bool:
            return self.condition(node.args[0])
        name = called.__name__ if isinstance(called, BuiltinFunctionType) and called.__module__ == "math" else ""
        if called not in (float, int, abs, min, max) and name not in _c.TESTS | _c.MATHEMATICS:
            return None
        first, *_ = values = [self.value(each) for each in node.args]
        if called in (float, int):
            kind = Scalar.DOUBLE if called is float else Scalar.INT
            return first if first.type is kind else Value(f"({kind.c_type}){first.within(_c.UNARY)}", kind, _c.UNARY)
        if called in (min, max):
            kind = Scalar.DOUBLE if any(value.type is Scalar.DOUBLE for value in values) else Scalar.INT
            helper = f"{'smaller' if called is min else 'larger'}{'_int' * (kind is Scalar.INT)}"
            return reduce(partial(self._helped, helper, kind), values)
        if called is abs and first.type is not Scalar.DOUBLE:
            return self._helped("absolute_int", Scalar.INT, first)
        if name in _c.TESTS:
            return Value(f"{name}({first.text}) != 0", Scalar.BOOL, _c.EQUALITY)
        return Value(f"{name or 'fabs'}({', '.join(value.text for value in values)})", Scalar.DOUBLE)

    def _helped(self, helper: str, kind: Scalar, *values: Value) -> Value:
        self.library.helpers.add(helper)
        return Value(f"{helper}({', '.join(value.text for value in values)})", kind)

    def _translated(self, node: ast.Call, called: Any) -> Value:
        types = tuple(self._type(each) for each in node.args)
        if not isinstance(called, FunctionType):
            raise self.refusal(node, f"{ast.unparse(node.func)} is neither of the module math nor a function in Python")
        function = self.library.function(called, types)
        pairs = zip(node.args, function.parameters, strict=True)
        arguments = ", ".join(text for each, parameter in pairs for text in self._given(each, parameter))
        return Value(f"{function.name}({arguments})", Scalar.INT if function.returns is None else function.returns)

    def _given(self, node: ast.expr, parameter: Parameter) -> list[str]:
        """An argument as far as the function uses it, and its length where that is used."""
        if not isinstance(parameter.type, Vector):
            return [self.any(node).text] if parameter.is_used else []
        array = self.vector(node) if parameter.is_used else self.quietly(node)
        for root in array.roots if parameter.is_written else ():
            self.scope.write(root)
        return [*[array.text] * parameter.is_used, *(array.lengths[axis]().text for axis in parameter.axes)]

    def writes(self, node: ast.expr) -> bool:
        return bool(self._tried(node)[1])

    def _type(self, node: ast.expr) -> Type:
        return self._tried(node)[0]

    def _tried(self, node: ast.expr) -> tuple[Type, set[str]]:
        """Type of an expression, and the arrays that it writes to, without a trace."""
        apart = replace(self.scope, lengths=set(), written=set(), used=set())
        return Expressions(self.library, apart).any(node).type, apart.written


def _length(text: str) -> Value:
    return Value(text, Scalar.INT, _c.SUM)


def _joined(operator: type[ast.boolop], parts: Sequence[Value]) -> Value:
    sign, binds = SIGNS[operator]
    return Value(f" {sign} ".join(part.within(_c.EQUALITY) for part in parts), Scalar.BOOL, binds)
