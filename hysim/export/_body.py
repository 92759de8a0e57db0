"""Statements of the portable subset in C99: the body of one function."""

import ast
from typing import Any

from hysim.export import _c
from hysim.export._c import (
    Known,
    Library,
    Routine,
    Scalar,
    Scope,
    Several,
    Stretch,
    Type,
    Value,
    Vector,
    assignments,
    counters_used_elsewhere,
    homes,
    joined,
    reads,
    targets,
)
from hysim.export._expressions import Expressions

_STEP = "    "
_MOST_PASSES = 12
_SIGNS = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*=", ast.Div: "/="}


class Body:
    """Translates the statements of a function again and again, until the types of its names have settled."""

    def __init__(self, library: Library, source: Routine, arguments: dict[str, Type]) -> None:
        self.source, self.arguments = source, list(arguments)
        self.scope = Scope(source, arguments)
        self.of = Expressions(library, self.scope)
        statements = source.tree.body
        self._statements = statements[1:] if ast.get_docstring(source.tree) is not None else statements
        self._homes, self._counts = homes(self._statements, arguments), assignments(self._statements)
        self.returns: Type | None = None
        self._results = 0
        for loop in counters_used_elsewhere(self._statements):
            raise source.refusal(loop, f"{ast.unparse(loop.target)} counts a loop and has another use: rename one")

    def settled(self) -> str:
        for _ in range(_MOST_PASSES):
            returns, self._results = self.returns, 0
            lines = self._block(self._statements, _STEP)
            if not self.scope.again() and returns == self.returns:
                return "".join(f"{line}\n" for line in lines)
        raise self.source.refusal(self.source.tree, "the types of its names do not settle")

    # ------------------------------------------------------------------------------ blocks and declarations

    def _block(self, statements: list[ast.stmt], indent: str) -> list[str]:
        lines: list[str] = []
        for k, statement in enumerate(statements):
            fresh = [name for name in self._homes.get((id(statements), k), []) if name not in self.arguments]
            with_it = targets(statement) if self._declares(statement) else []
            early = [name for name in fresh if name not in with_it]
            text = self._statement(statement, indent, set(fresh) & set(with_it))
            lines += [indent + self._zero(name) for name in early if self._is_real(name)] + text
        return lines

    def _declares(self, statement: ast.stmt) -> bool:
        return isinstance(statement, ast.Assign) and not set(targets(statement)) & reads(statement.value)

    def _is_real(self, name: str) -> bool:
        known = self.scope.types.get(name)
        return known is not None and not isinstance(known, Known) and self.scope.is_used(name)

    def _zero(self, name: str) -> str:
        type_, c_name = self.scope.types[name], self.scope.c_name(name)
        if isinstance(type_, Vector):
            sizes = [f" int {type_.length(c_name, axis)} = 0;" for axis in self.scope.axes(name)]
            return f"{self._constant(name)}double *{c_name} = 0;{''.join(sizes)}"
        assert isinstance(type_, Scalar)
        return f"{type_.c_type} {c_name} = {'0.0' if type_ is Scalar.DOUBLE else '0'};"

    def _constant(self, name: str) -> str:
        return "" if self.scope.is_written(name) else "const "

    # ------------------------------------------------------------------------------ statements

    def _statement(self, node: ast.stmt, indent: str, declared: set[str]) -> list[str]:
        if isinstance(node, ast.Assign):
            return self._assignment(node, indent, declared)
        if isinstance(node, ast.AugAssign):
            return [indent + self._augmented(node)]
        if isinstance(node, ast.If):
            return self._branch(node, indent)
        if isinstance(node, ast.While | ast.For):
            return self._loop(node, indent)
        if isinstance(node, ast.Return):
            return [indent + self._return(node)]
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            return [f"{indent}{self.of.any(node.value).text};"]
        if isinstance(node, ast.Break | ast.Continue):
            return [f"{indent}{'break' if isinstance(node, ast.Break) else 'continue'};"]
        if isinstance(node, ast.Pass):
            return []
        raise self.source.refusal(node, f"{type(node).__name__} is no statement of the subset")

    def _branch(self, node: ast.If, indent: str) -> list[str]:
        known = self.of.known(node.test)
        if known is not None:
            return self._block(node.body if known else node.orelse, indent)
        lines = [f"{indent}if ({self.of.condition(node.test).text}) {{", *self._block(node.body, indent + _STEP)]
        if len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If) and (id(node.orelse), 0) not in self._homes:
            first, *others = self._branch(node.orelse[0], indent)
            if first.startswith(f"{indent}if ("):
                return [*lines, f"{indent}}} else {first.strip()}", *others]
        if node.orelse:
            lines += [f"{indent}}} else {{", *self._block(node.orelse, indent + _STEP)]
        return [*lines, f"{indent}}}"]

    def _loop(self, node: ast.While | ast.For, indent: str) -> list[str]:
        if node.orelse:
            raise self.source.refusal(node, "a loop has no else")
        head = self._counted(node) if isinstance(node, ast.For) else self._while(node)
        return [f"{indent}{head} {{", *self._block(node.body, indent + _STEP), f"{indent}}}"]

    def _while(self, node: ast.While) -> str:
        return "for (;;)" if self.of.known(node.test) else f"while ({self.of.condition(node.test).text})"

    def _counted(self, node: ast.For) -> str:
        call = node.iter
        is_range = isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"
        if not is_range or not isinstance(node.target, ast.Name):
            raise self.source.refusal(node, "a for counts through a range")
        assert isinstance(call, ast.Call)
        places = [self.of.index(each) for each in call.args]
        by = places[2].text if len(places) == 3 else "1"
        if not by.lstrip("-").isdigit() or int(by) == 0:
            raise self.source.refusal(node, "the step of a range is a number")
        begin, stop = (Value("0", Scalar.INT), places[0]) if len(places) == 1 else places[:2]
        self.scope.types[node.target.id] = Scalar.INT
        name = self.scope.c_name(node.target.id)
        end = stop.within(_c.SUM)
        hoisted = ""
        if not end.isdigit() and _changes(node, call):
            end, hoisted = f"{name}_end", f", {name}_end = {stop.text}"
        sign, move = ("<", f" += {by}") if int(by) > 0 else (">", f" -= {-int(by)}")
        move = {" += 1": "++", " -= 1": "--"}.get(move, move)
        return f"for (int {name} = {begin.text}{hoisted}; {name} {sign} {end}; {name}{move})"

    def _return(self, node: ast.Return) -> str:
        if node.value is None:
            return "return;"
        if isinstance(node.value, ast.Tuple):
            values = [self.of.value(each) for each in node.value.elts]
            self._note(node, Several(tuple(value.type for value in values)))  # type: ignore[misc]
            assert isinstance(self.returns, Several)
            return f"return ({self.returns.c_type}){{{', '.join(value.text for value in values)}}};"
        value = self.of.any(node.value)
        self._note(node, value.type)
        return f"return {value.text};"

    def _note(self, node: ast.AST, type_: Type) -> None:
        self.returns = joined(self.returns, type_)
        if self.returns is None or isinstance(self.returns, Vector | Known):
            raise self.source.refusal(node, "a function returns numbers")

    # ------------------------------------------------------------------------------ assignments

    def _augmented(self, node: ast.AugAssign) -> str:
        value = self.of.value(node.value)
        sign = _SIGNS.get(type(node.op))
        if sign is None:
            raise self.source.refusal(node, f"{ast.unparse(node)} has no translation")
        if isinstance(node.target, ast.Name):
            type_ = Scalar.DOUBLE if sign == "/=" else value.type
            self.scope.assign(node.target.id, type_, node)
            self.scope.used.add(node.target.id)
        return f"{self._target(node.target, Scalar.DOUBLE)} {sign} {value.text};"

    def _target(self, node: ast.expr, type_: Type) -> str:
        if isinstance(node, ast.Name):
            return self.scope.c_name(node.id)
        if not isinstance(node, ast.Subscript) or isinstance(node.slice, ast.Slice):
            raise self.source.refusal(node, "names and elements of vectors are assigned")
        whole = self.of.stretch(node.value)
        for root in whole.roots:
            self.scope.write(root)
        return f"{whole.text}{self.of.place(node, whole)}"

    def _assignment(self, node: ast.Assign, indent: str, declared: set[str]) -> list[str]:
        if len(node.targets) == 1 and isinstance(node.targets[0], ast.Tuple):
            return self._several(node.targets[0], node.value, indent, declared)
        if any(isinstance(target, ast.Tuple) for target in node.targets):
            raise self.source.refusal(node, "a tuple is assigned once")
        lines, value = [], node.value
        if len(node.targets) > 1 and not isinstance(value, ast.Constant | ast.Name):
            first, *others = node.targets[::-1]
            if not isinstance(first, ast.Name):
                raise self.source.refusal(node, "the value of a chain of assignments is a name or a number")
            lines = self._one(first, value, indent, declared)
            return lines + [
                line for target in others for line in self._one(target, first, indent, declared, loaded=True)
            ]
        return [line for target in node.targets for line in self._one(target, value, indent, declared)]

    def _one(
        self, target: ast.expr, node: ast.expr, indent: str, declared: set[str], *, loaded: bool = False
    ) -> list[str]:
        """One assignment; a name that is not read is left out."""
        if isinstance(target, ast.Name) and not self.scope.is_used(target.id):
            return [f"{indent}(void){self.of.value(node).within(_c.UNARY)};"] if self.of.writes(node) else []
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "np.empty" and isinstance(target, ast.Name):
            return [indent + self._room(target, node)]
        value = self.of.any(ast.Name(node.id, ast.Load()) if loaded and isinstance(node, ast.Name) else node)
        if isinstance(value, Stretch):
            return self._named(target, value, indent, declared)
        return [indent + line for line in self._numbers([(target, value)], declared)]

    def _numbers(self, pairs: list[tuple[ast.expr, Value]], declared: set[str]) -> list[str]:
        lines = []
        for target, value in pairs:
            prefix = ""
            if isinstance(target, ast.Name):
                self.scope.assign(target.id, value.type, target)
                type_ = self.scope.types[target.id]
                if isinstance(type_, Known) or not self.scope.is_used(target.id):
                    continue
                assert isinstance(type_, Scalar)
                if target.id in declared:
                    prefix = f"{'const ' * (self._counts[target.id] == 1)}{type_.c_type} "
            lines.append(f"{prefix}{self._target(target, value.type)} = {value.text};")
        return lines

    def _named(self, target: ast.expr, value: Stretch, indent: str, declared: set[str]) -> list[str]:
        if not isinstance(target, ast.Name):
            raise self.source.refusal(target, "a vector is copied by a loop")
        name, c_name = target.id, self.scope.c_name(target.id)
        if value.text == c_name:  # `parameters = borrowed(parameters)`
            return []
        self.scope.assign(name, value.type, target)
        self.scope.roots[name] = self.scope.roots.get(name, frozenset()) | value.roots
        own = name in declared
        lines = [f"{indent}{f'{self._constant(name)}double *' if own else ''}{c_name} = {value.text};"]
        for axis in self.scope.axes(name):
            lines.append(
                f"{indent}{'const int ' if own else ''}{value.type.length(c_name, axis)} = {value.lengths[axis]()};"
            )
        return lines

    def _room(self, target: ast.Name, node: ast.Call) -> str:
        size = self.of.index(node.args[0]).text
        if not size.isdigit() or len(node.args) != 1 or node.keywords:
            raise self.source.refusal(node, "room for work has a constant size")
        self.scope.assign(target.id, Vector(), target)
        return f"double {self.scope.c_name(target.id)}[{size}];"

    def _several(self, target: ast.Tuple, node: ast.expr, indent: str, declared: set[str]) -> list[str]:
        """Numbers or vectors assigned together: one after the other where none reads what another has changed."""
        if isinstance(node, ast.IfExp) and isinstance(node.body, ast.Tuple) and isinstance(node.orelse, ast.Tuple):
            return self._chosen(target, node, indent, declared)
        if not isinstance(node, ast.Tuple):
            return [indent + line for line in self._unpacked(target, node, declared)]
        if len(node.elts) != len(target.elts):
            raise self.source.refusal(node, "as many values as places are assigned")
        if _independent(target.elts, node.elts):
            pairs = zip(target.elts, node.elts, strict=True)
            return [line for place, value in pairs for line in self._one(place, value, indent, declared)]
        values = [self.of.value(each) for each in node.elts]
        for place, value in zip(target.elts, values, strict=True):
            if isinstance(place, ast.Name):
                self.scope.assign(place.id, value.type, place)
        names = [self._free() for _ in values]
        lines = [
            f"{indent}const {value.type.c_type} {name} = {value.text};"  # type: ignore[union-attr]
            for name, value in zip(names, values, strict=True)
        ]
        kept = [(t, Value(n, v.type)) for t, n, v in zip(target.elts, names, values, strict=True)]
        return lines + [indent + line for line in self._numbers(kept, declared)]

    def _chosen(self, target: ast.Tuple, node: ast.IfExp, indent: str, declared: set[str]) -> list[str]:
        """One of two tuples: each place gets its choice of two numbers."""
        name = self._free()
        self.scope.types[name] = Scalar.BOOL
        test = ast.copy_location(ast.Name(name, ast.Load()), node)
        pairs = zip(node.body.elts, node.orelse.elts, strict=True)  # type: ignore[attr-defined]
        choices = [ast.copy_location(ast.IfExp(test, first, second), node) for first, second in pairs]
        line = f"{indent}const int {name} = {self.of.condition(node.test).text};"
        together = ast.copy_location(ast.Tuple(list[ast.expr](choices), ast.Load()), node)
        return [line, *self._several(target, together, indent, declared)]

    def _unpacked(self, target: ast.Tuple, node: ast.expr, declared: set[str]) -> list[str]:
        if (shaped := self.of.shape(node)) is not None:
            lengths = [Value(length(), Scalar.INT, _c.SUM) for length in shaped.lengths]
            return self._numbers(list(zip(target.elts, lengths, strict=True)), declared)
        value: Any = self.of.any(node)
        if isinstance(value, Stretch) and len(value.lengths) == 1:
            numbers = [
                Value(f"{value.text if value.binds == _c.PRIMARY else f'({value.text})'}[{k}]", Scalar.DOUBLE)
                for k in range(len(target.elts))
            ]
            return self._numbers(list(zip(target.elts, numbers, strict=True)), declared)
        if not isinstance(value.type, Several) or len(value.type.members) != len(target.elts):
            raise self.source.refusal(node, "a function that returns as many numbers is expected here")
        name = self._free()
        pairs = [
            (place, Value(f"{name}.at{i}", member))
            for i, (place, member) in enumerate(zip(target.elts, value.type.members, strict=True))
            if not (isinstance(place, ast.Name) and place.id == "_")
        ]
        return [f"const {value.type.c_type} {name} = {value.text};", *self._numbers(pairs, declared)]

    def _free(self) -> str:
        self._results += 1
        return f"result_{self._results}"


def _independent(places: list[ast.expr], values: list[ast.expr]) -> bool:
    """Whether each value may be computed after the places before it have been assigned."""
    changed: set[str] = set()
    writes = False
    for place, value in zip(places, values, strict=True):
        if changed & reads(value) or (writes and _looks(value)):
            return False
        if isinstance(place, ast.Name):
            changed.add(place.id)
        else:
            writes = True
    return not writes or not any(changed & reads(place) for place in places)


def _looks(node: ast.expr) -> bool:
    return any(isinstance(each, ast.Subscript | ast.Call) for each in ast.walk(node))


def _changes(loop: ast.For, call: ast.Call) -> bool:
    """Whether the end of a range may change while the loop runs, or costs a computation."""
    stop = call.args[0] if len(call.args) == 1 else call.args[1]
    assigned = assignments(loop.body)
    return not isinstance(stop, ast.Name | ast.Constant | ast.Attribute) or bool(reads(stop) & assigned.keys())
