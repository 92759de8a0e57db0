"""Statements of the portable subset in C99: the body of one function."""

import ast
from collections.abc import Callable, Sequence
from typing import Any

from hysim.export import _c
from hysim.export._c import Known, Library, Routine, Scalar, Scope, Several, Type, Value, Vector, joined, reads, stored
from hysim.export._expressions import SIGNS, Expressions

_MOST_PASSES = 12


class Body:
    """Translates the statements of a function again and again, until the types of its names have settled."""

    def __init__(self, library: Library, source: Routine, arguments: dict[str, Type]) -> None:
        self.source, self.arguments, self.scope = source, list(arguments), Scope(source, arguments)
        self.of, self.refusal = Expressions(library, self.scope), source.refusal
        self._homes, self._counts = _c.homes(source.tree), stored(source.tree.body)
        self._declared: set[str] = set()  # names that the statement at hand declares
        self.returns: Type | None = None
        self._results = 0
        for loop in _c.counters_used_elsewhere(source.tree):
            raise source.refusal(loop, f"{ast.unparse(loop.target)} counts a loop and has another use: rename one")

    def settled(self) -> str:
        for _ in range(_MOST_PASSES):
            returns, self._results = self.returns, 0
            lines = _indented(self._block(self.source.tree.body))
            if not self.scope.again() and returns == self.returns:
                return "".join(f"{line}\n" for line in lines)
        raise self.refusal(self.source.tree, "the types of its names do not settle")

    # ------------------------------------------------------------------------------ blocks and declarations

    def _block(self, statements: list[ast.stmt]) -> list[str]:
        lines: list[str] = []
        for k, statement in enumerate(statements):
            fresh = self._homes.get((id(statements), k), [])
            self._declared = set()
            if isinstance(statement, ast.Assign) and not stored(statement.targets).keys() & reads(statement.value):
                self._declared = stored(statement.targets).keys() & set(fresh)
            early = [name for name in fresh if name not in self._declared]
            text = self._statement(statement)
            lines += [self._zero(name) for name in early if self._is_real(name)] + text
        return lines

    def _is_real(self, name: str) -> bool:
        return not isinstance(self.scope.types.get(name), Known | None) and self.scope.is_used(name)

    def _zero(self, name: str) -> str:
        type_, c_name = self.scope.types[name], self.scope.c_name(name)
        if isinstance(type_, Vector):
            sizes = [f" int {type_.length(c_name, axis)} = 0;" for axis in self.scope.axes(name)]
            return f"{self._constant(name)}double *{c_name} = 0;{''.join(sizes)}"
        zero = "{0}" if isinstance(type_, Several) else "0.0" if type_ is Scalar.DOUBLE else "0"
        return f"{_c_type(type_)} {c_name} = {zero};"

    def _constant(self, name: str) -> str:
        return "" if self.scope.is_written(name) else "const "

    # ------------------------------------------------------------------------------ statements

    def _statement(self, node: ast.stmt) -> list[str]:
        methods: dict[type[ast.stmt], Callable[[Any], list[str]]] = {
            ast.Assign: self._assignment, ast.AugAssign: self._augmented, ast.If: self._branch, ast.Expr: self._alone,
            ast.While: self._loop, ast.For: self._loop, ast.Return: self._return, ast.Pass: lambda _: [],
            ast.Break: lambda _: ["break;"], ast.Continue: lambda _: ["continue;"],
        }  # fmt: skip
        if type(node) not in methods:
            raise self.refusal(node, f"{type(node).__name__} is no statement of the subset")
        return methods[type(node)](node)

    def _alone(self, node: ast.Expr) -> list[str]:
        """A call for what it writes to, or a docstring."""
        if not isinstance(node.value, ast.Call | ast.Constant):
            raise self.refusal(node, "Expr is no statement of the subset")
        return [f"{self.of.any(node.value).text};"] if isinstance(node.value, ast.Call) else []

    def _branch(self, node: ast.If) -> list[str]:
        if (known := self.of.known(node.test)) is not None:
            return self._block(node.body if known else node.orelse)
        lines = [f"if ({self.of.condition(node.test).text}) {{", *_indented(self._block(node.body))]
        if len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If) and (id(node.orelse), 0) not in self._homes:
            first, *others = self._branch(node.orelse[0])
            if first.startswith("if ("):
                return [*lines, f"}} else {first}", *others]
        if node.orelse:
            lines += ["} else {", *_indented(self._block(node.orelse))]
        return [*lines, "}"]

    def _loop(self, node: ast.While | ast.For) -> list[str]:
        if node.orelse:
            raise self.refusal(node, "a loop has no else")
        if isinstance(node, ast.For):
            head = self._counted(node)
        else:
            head = "for (;;)" if self.of.known(node.test) else f"while ({self.of.condition(node.test).text})"
        return [f"{head} {{", *_indented(self._block(node.body)), "}"]

    def _counted(self, node: ast.For) -> str:
        call, target = node.iter, node.target
        if not isinstance(call, ast.Call) or ast.unparse(call.func) != "range" or not isinstance(target, ast.Name):
            raise self.refusal(node, "a for counts through a range")
        places = [self.of.index(each) for each in call.args]
        by = places[2].text if len(places) == 3 else "1"
        if not by.lstrip("-").isdigit() or int(by) == 0:
            raise self.refusal(node, "the step of a range is a number")
        begin, stop = (Value("0", Scalar.INT), places[0]) if len(places) == 1 else places[:2]
        self.scope.types[target.id] = Scalar.INT
        name, end, hoisted = self.scope.c_name(target.id), stop.within(_c.SUM), ""
        if not end.isdigit() and _changes(node, call):
            end, hoisted = f"{name}_end", f", {name}_end = {stop.text}"
        sign, move = ("<", f" += {by}") if int(by) > 0 else (">", f" -= {-int(by)}")
        move = {" += 1": "++", " -= 1": "--"}.get(move, move)
        return f"for (int {name} = {begin.text}{hoisted}; {name} {sign} {end}; {name}{move})"

    def _return(self, node: ast.Return) -> list[str]:
        if node.value is None:
            return ["return;"]
        if isinstance(node.value, ast.Tuple):
            values = [self.of.value(each) for each in node.value.elts]
            self._note(node, Several(tuple(value.type for value in values)))  # type: ignore[misc]
            return [f"return ({_c_type(self.returns)}){{{', '.join(value.text for value in values)}}};"]
        value = self.of.any(node.value)
        self._note(node, value.type)
        return [f"return {value.text};"]

    def _note(self, node: ast.AST, type_: Type) -> None:
        self.returns = joined(self.returns, type_)
        if self.returns is None or isinstance(self.returns, Vector | Known):
            raise self.refusal(node, "a function returns numbers")

    # ------------------------------------------------------------------------------ assignments

    def _augmented(self, node: ast.AugAssign) -> list[str]:
        value = self.of.value(node.value)
        if type(node.op) not in SIGNS:
            raise self.refusal(node, f"{ast.unparse(node)} has no translation")
        if isinstance(node.target, ast.Name):
            self.scope.assign(node.target.id, Scalar.DOUBLE if isinstance(node.op, ast.Div) else value.type, node)
            self.scope.used.add(node.target.id)
        return [f"{self._target(node.target)} {SIGNS[type(node.op)][0]}= {value.text};"]

    def _target(self, node: ast.expr) -> str:
        if isinstance(node, ast.Name):
            return self.scope.c_name(node.id)
        if not isinstance(node, ast.Subscript) or isinstance(node.slice, ast.Slice):
            raise self.refusal(node, "names and elements of vectors are assigned")
        array = self.of.vector(node.value)
        for root in array.roots:
            self.scope.write(root)
        return f"{array.text}{self.of.place(node, array)}"

    def _assignment(self, node: ast.Assign) -> list[str]:
        if isinstance(node.targets[0], ast.Tuple) and len(node.targets) == 1:
            return self._several(node.targets[0], node.value)
        if any(isinstance(target, ast.Tuple) for target in node.targets):
            raise self.refusal(node, "a tuple is assigned once")
        pairs = [(target, node.value) for target in node.targets]
        if len(pairs) > 1 and not isinstance(node.value, ast.Constant | ast.Name):
            *others, first = node.targets
            if not isinstance(first, ast.Name):
                raise self.refusal(node, "the value of a chain of assignments is a name or a number")
            loaded = ast.copy_location(ast.Name(first.id, ast.Load()), node)
            pairs = [(first, node.value), *((target, loaded) for target in others[::-1])]
        return [line for pair in pairs for line in self._one(*pair)]

    def _one(self, target: ast.expr, node: ast.expr) -> list[str]:
        """One assignment; a name that is not read is left out."""
        if isinstance(target, ast.Name) and not self.scope.is_used(target.id):
            return [f"(void){self.of.value(node).within(_c.UNARY)};"] if self.of.writes(node) else []
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "np.empty" and isinstance(target, ast.Name):
            return [self._room(target, node)]
        value = self.of.any(node)
        return self._named(target, value) if isinstance(value.type, Vector) else self._numbers([target], [value])

    def _numbers(self, places: Sequence[ast.expr], values: Sequence[Value]) -> list[str]:
        lines = []
        for target, value in zip(places, values, strict=True):
            prefix = ""
            if isinstance(target, ast.Name):
                self.scope.assign(target.id, value.type, target)
                type_ = self.scope.types[target.id]
                if isinstance(type_, Known) or not self.scope.is_used(target.id):
                    continue
                if target.id in self._declared:
                    prefix = f"{'const ' * (self._counts[target.id] == 1)}{_c_type(type_)} "
            lines.append(f"{prefix}{self._target(target)} = {value.text};")
        return lines

    def _named(self, target: ast.expr, value: Value) -> list[str]:
        if not isinstance(target, ast.Name) or not isinstance(value.type, Vector):
            raise self.refusal(target, "a vector is copied by a loop")
        name, c_name = target.id, self.scope.c_name(target.id)
        if value.text == c_name:  # `parameters = borrowed(parameters)`
            return []
        self.scope.assign(name, value.type, target)
        self.scope.roots[name] = self.scope.roots.get(name, frozenset()) | value.roots
        pointer, integer = (f"{self._constant(name)}double *", "const int ") if name in self._declared else ("", "")
        lengths = ((value.type.length(c_name, axis), value.lengths[axis]().text) for axis in self.scope.axes(name))
        return [f"{pointer}{c_name} = {value.text};", *(f"{integer}{left} = {right};" for left, right in lengths)]

    def _room(self, target: ast.Name, node: ast.Call) -> str:
        size = self.of.index(node.args[0]).text
        if not size.isdigit() or len(node.args) != 1 or node.keywords:
            raise self.refusal(node, "room for work has a constant size")
        self.scope.assign(target.id, Vector(), target)
        return f"double {self.scope.c_name(target.id)}[{size}];"

    def _several(self, target: ast.Tuple, node: ast.expr) -> list[str]:
        """Numbers or vectors assigned together: one after the other if no assignment reads what another has changed."""
        if isinstance(node, ast.IfExp) and isinstance(node.body, ast.Tuple) and isinstance(node.orelse, ast.Tuple):
            return self._chosen(target, node)
        if not isinstance(node, ast.Tuple):
            return self._unpacked(target.elts, node)
        if len(node.elts) != len(target.elts):
            raise self.refusal(node, "as many values as places are assigned")
        if _independent(target.elts, node.elts):
            return [line for pair in zip(target.elts, node.elts, strict=True) for line in self._one(*pair)]
        values = [self.of.value(each) for each in node.elts]
        for place, value in zip(target.elts, values, strict=True):
            if isinstance(place, ast.Name):
                self.scope.assign(place.id, value.type, place)
        kept = [value._replace(text=self._free(), binds=_c.PRIMARY) for value in values]
        lines = [f"const {_c_type(v.type)} {k.text} = {v.text};" for k, v in zip(kept, values, strict=True)]
        return lines + self._numbers(target.elts, kept)

    def _chosen(self, target: ast.Tuple, node: ast.IfExp) -> list[str]:
        """One of two tuples: each place gets its choice of two numbers."""
        name = self._free()
        self.scope.types[name] = Scalar.BOOL
        test = ast.copy_location(ast.Name(name, ast.Load()), node)
        pairs = zip(node.body.elts, node.orelse.elts, strict=True)  # type: ignore[attr-defined]
        choices: list[ast.expr] = [ast.copy_location(ast.IfExp(test, *pair), node) for pair in pairs]
        line = f"const int {name} = {self.of.condition(node.test).text};"
        return [line, *self._several(target, ast.copy_location(ast.Tuple(choices, ast.Load()), node))]

    def _unpacked(self, places: list[ast.expr], node: ast.expr) -> list[str]:
        if (shaped := self.of.shape(node)) is not None:
            return self._numbers(places, [length() for length in shaped.lengths])
        value = self.of.any(node)
        if isinstance(value.type, Vector) and len(value.lengths) == 1:
            numbers = [Value(f"{value.within(_c.PRIMARY)}[{k}]", Scalar.DOUBLE) for k in range(len(places))]
            return self._numbers(places, numbers)
        if not isinstance(value.type, Several) or len(value.type.members) != len(places):
            raise self.refusal(node, "a function that returns as many numbers is expected here")
        name = self._free()
        members = [Value(f"{name}.at{i}", member) for i, member in enumerate(value.type.members)]
        return [f"const {_c_type(value.type)} {name} = {value.text};", *self._numbers(places, members)]

    def _free(self) -> str:
        self._results += 1
        return f"result_{self._results}"


def _indented(lines: list[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _c_type(type_: Type | None) -> str:
    assert isinstance(type_, Scalar | Several)
    return type_.c_type


def _independent(places: list[ast.expr], values: list[ast.expr]) -> bool:
    """Whether each value may be computed after the places before it have been assigned."""
    changed: set[str] = set()
    writes = False
    for place, value in zip(places, values, strict=True):
        looks = any(isinstance(each, ast.Subscript | ast.Call) for each in ast.walk(value))
        if changed & reads(value) or (writes and looks):
            return False
        changed |= {place.id} if isinstance(place, ast.Name) else set()
        writes |= not isinstance(place, ast.Name)
    return not writes or not any(changed & reads(place) for place in places)


def _changes(loop: ast.For, call: ast.Call) -> bool:
    """Whether the end of a range may change while the loop runs, or costs a computation."""
    stop = call.args[0] if len(call.args) == 1 else call.args[1]
    is_simple = isinstance(stop, ast.Name | ast.Constant | ast.Attribute)
    return not is_simple or bool(reads(stop) & stored(loop.body).keys())
