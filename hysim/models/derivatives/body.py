"""Statements of the portable subset in forward mode: the body of one function."""

import ast
from collections.abc import Iterator
from typing import Any

from hysim.models.derivatives.expressions import Dual, Expressions, Library
from hysim.models.derivatives.sources import (
    assigned,
    body_of,
    called_function,
    is_kernel,
    returned_kinds,
    root_of,
    writes,
)
from hysim.models.tracing.routine import Routine

_STEP = "    "


class Body:
    """Translates one function for arguments with rates, without, or known.

    Parameters
    ----------
    library : Library
        Where the functions that it calls are collected.
    source : Routine
        The function.
    flags : dict
        For each argument True if it has a rate, False if not, or the value of one that is known, in a tuple.
    has_rates : bool
        Whether the function returns rates.
    """

    def __init__(self, library: Library, source: Routine, flags: dict[str, Any], has_rates: bool) -> None:
        self.source, self.flags, self.has_rates = source, flags, has_rates
        self.statements = body_of(source)
        local = {
            node.id for node in ast.walk(source.tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        }
        known = {name: flag[0] for name, flag in flags.items() if isinstance(flag, tuple)}
        moving = {name for name, flag in flags.items() if flag is True}
        self.of = Expressions(library, source, {*local, *flags} - known.keys(), known, moving)
        self._settle_activity()

    def arguments(self) -> list[str]:
        """Names of the arguments of the translation."""
        texts = [[name, f"{name}__d"] if flag is True else [name] for name, flag in self.flags.items()
                 if not isinstance(flag, tuple)]  # fmt: skip
        return [name for names in texts for name in names]

    def translated(self) -> list[str]:
        """Lines of the body."""
        self.of.indent = _STEP
        begun = [name for name, flag in self.flags.items() if flag is False and name in self.of.moving]
        self.of.lines += [f"{_STEP}{name}__d = 0.0" for name in begun]
        self._block(self.statements)
        return self.of.lines or [f"{_STEP}pass"]

    # ------------------------------------------------------------------------------ which names have a rate

    def _settle_activity(self) -> None:
        """Find the names that have a rate: those that are assigned from others that have one."""
        moving = self.of.moving
        while True:
            before = len(moving)
            for target, value in assigned(self.statements):
                for name, is_moving in self._targets(target, value):
                    if is_moving:
                        moving.add(name)
            self._mark_filled()
            if len(moving) == before:
                return

    def _targets(self, target: ast.expr, value: ast.expr) -> Iterator[tuple[str, bool]]:
        """Names of a target, and whether the value has a rate."""
        if not isinstance(target, ast.Tuple):
            name = root_of(target)
            if name is not None:
                yield name, self.of.moves(value)
            return
        if isinstance(value, ast.Tuple):
            for each, part in zip(target.elts, value.elts, strict=True):
                yield from self._targets(each, part)
        elif isinstance(value, ast.IfExp):
            yield from self._targets(target, value.body)
            yield from self._targets(target, value.orelse)
        else:
            kinds = self.of.kinds_moving(value, len(target.elts))
            for each, is_moving in zip(target.elts, kinds, strict=True):
                name = root_of(each)
                if name is not None:
                    yield name, is_moving

    def _mark_filled(self) -> None:
        """Local arrays that a function fills from numbers with a rate have one."""
        for node in ast.walk(self.source.tree):
            if isinstance(node, ast.Call):
                called = called_function(self.source, node.func)
                if is_kernel(called) and writes(called) and any(map(self.of.moves, node.args)):
                    roots = {root_of(each) for each in node.args}
                    self.of.moving |= {name for name in roots if name in self.of.arrays and name not in self.flags}

    # ------------------------------------------------------------------------------ statements

    def _block(self, statements: list[ast.stmt]) -> None:
        for statement in statements:
            self._statement(statement)

    def _statement(self, node: ast.stmt) -> None:
        if isinstance(node, ast.Assign):
            self._assign(node)
        elif isinstance(node, ast.AugAssign):
            value = ast.copy_location(ast.BinOp(_read(node.target), node.op, node.value), node)
            self._put(node.target, self.of.dual(value))
        elif isinstance(node, ast.If):
            self._branch(node)
        elif isinstance(node, ast.For):
            self._loop(f"for {ast.unparse(node.target)} in {self.of.plain(node.iter)}:", node.body)
        elif isinstance(node, ast.While):
            self._while(node)
        elif isinstance(node, ast.Return):
            self._return(node)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            self.of.results(node.value)
        elif isinstance(node, ast.Break | ast.Continue | ast.Pass):
            self.of.emit(
                "break" if isinstance(node, ast.Break) else "continue" if isinstance(node, ast.Continue) else "pass"
            )
        else:
            raise self.source.refusal(node, f"{type(node).__name__} is no statement of the subset")

    def _indented(self, head: str, body: list[ast.stmt]) -> None:
        self.of.emit(head)
        before, self.of.indent = self.of.indent, self.of.indent + _STEP
        count = len(self.of.lines)
        self._block(body)
        if len(self.of.lines) == count:
            self.of.emit("pass")
        self.of.indent = before

    def _loop(self, head: str, body: list[ast.stmt]) -> None:
        self._indented(head, body)

    def _while(self, node: ast.While) -> None:
        count = len(self.of.lines)
        test = self.of.plain(node.test)
        if len(self.of.lines) != count:
            raise self.source.refusal(node, "the condition of a loop calls nothing that writes to the state")
        self._loop(f"while {test}:", node.body)

    def _branch(self, node: ast.If) -> None:
        known = self.of.known(node.test)
        if known is not None:
            self._block(node.body if known else node.orelse)
            return
        self._indented(f"if {self.of.plain(node.test)}:", node.body)
        if node.orelse:
            self._indented("else:", node.orelse)

    def _assign(self, node: ast.Assign) -> None:
        first, *others = node.targets[::-1]
        self._put_value(first, node.value)
        for target in others:
            self._put_value(target, _read(first))

    def _put_value(self, target: ast.expr, value: ast.expr) -> None:
        if not isinstance(target, ast.Tuple):
            self._put(target, self.of.dual(value))
            return
        count = len(target.elts)
        if isinstance(value, ast.IfExp):
            self.of.emit(f"if {self.of.plain(value.test)}:")
            for k, part in enumerate((value.body, value.orelse)):
                if k:
                    self.of.emit("else:")
                self.of.indent += _STEP
                self._put_value(target, part)
                self.of.indent = self.of.indent[: -len(_STEP)]
            return
        if isinstance(value, ast.Tuple):
            results = [self.of.kept(self.of.dual(each)) for each in value.elts]
        elif isinstance(value, ast.Call):
            results = self.of.results(value)
        else:
            results = [self.of.dual(ast.Subscript(value, ast.Constant(k), ast.Load())) for k in range(count)]
        for each, result in zip(target.elts, results, strict=True):
            self._put(each, result)

    def _put(self, target: ast.expr, dual: Dual) -> None:
        if isinstance(target, ast.Name):
            self.of.emit(f"{target.id} = {dual.value}")
            if target.id in self.of.moving:
                rate = dual.value.replace("np.empty", "np.zeros") if dual.value.startswith("np.empty") else dual.rate
                self.of.emit(f"{target.id}__d = {rate or '0.0'}")
            return
        assert isinstance(target, ast.Subscript)
        value, rate = self.of.element(target)
        self.of.emit(f"{value} = {dual.value}")
        if rate is not None:
            self.of.emit(f"{rate} = {dual.rate or '0.0'}")
        elif dual.rate is not None:
            raise self.source.refusal(target, f"{ast.unparse(target)} lies in an array without rates")

    def _return(self, node: ast.Return) -> None:
        if node.value is None:
            self.of.emit("return")
            return
        kinds = returned_kinds(self.source)
        if isinstance(node.value, ast.Tuple):
            results = [self.of.dual(each) for each in node.value.elts]
        elif isinstance(node.value, ast.Call) and len(kinds) > 1:
            results = self.of.results(node.value)
        else:
            results = [self.of.dual(node.value)]
        texts: list[str] = []
        for result, is_float in zip(results, kinds, strict=True):
            texts += [result.value, result.rate or "0.0"] if is_float and self.has_rates else [result.value]
        self.of.emit(f"return {', '.join(texts)}")


def _read(target: ast.expr) -> ast.expr:
    """A target as a value."""
    copy = ast.parse(ast.unparse(target), mode="eval").body
    return ast.copy_location(copy, target)
