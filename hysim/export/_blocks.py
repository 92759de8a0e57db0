"""Blocks of a function in which its local names are declared in C.

A name is declared in the innermost block that holds all its places. A block within another is taken only if it assigns
the name before anything else: otherwise the name may keep a value from one pass through a loop to the next.
"""

import ast
from collections.abc import Iterable, Mapping

Place = tuple[int, int]
"""Identity of a list of statements, and the number of the statement in it."""


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
    """The number of statements that assign each name."""
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
    """Names that a statement assigns, if it is a plain assignment."""
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
    """Names in the head of a compound statement."""
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
