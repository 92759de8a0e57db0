"""The step of a law that is given by its slope: written out for its family, and compiled and translated as any other.

A family says ``slope(p, z, u, s)``, with the parameters as attributes of `p`. In what is compiled `p` is the vector of
the parameters, and ``p.beta`` one of its places.
"""

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping
from typing import Any

from hysim._basics.frozen import FloatArray
from hysim._names import meant
from hysim.kernels.stepping import sources, unstored

_TEXT = """\
def rates(p: FloatArray, x: FloatArray, u: float, s: float, out: FloatArray) -> None:
    {slopes} = slope(p, {states}, u, s)

def room(p: FloatArray, x: FloatArray, slope: float, s: float) -> float:
    return {longest}

def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    {move}
    return output(parameters, {memory}, u)
"""
_MOVE = "follow({n}, parameters, state, u, parameters[0], True, LARGEST, MAX_STEPS)"
_FLOW = """\
if flows(parameters):
        if u != state[0] and math.isfinite(state[1]):  # a memory that has diverged remains so
            state[1] = flow(parameters, state[1], state[0], u)
        state[0] = u
    else:
        """


def constants_of(cls: Any) -> dict[str, bool]:
    """The parameters of the step, and whether they are tuples: a tolerance, and the fields but the initial memory."""
    return {"tolerance": False} | {
        name: annotation == tuple[float, ...]
        for name, annotation in inspect.get_annotations(cls).items()
        if not str(annotation).startswith("typing.ClassVar") and name not in cls.initial
    }


def states_of(slope: Callable[..., Any]) -> int:
    """Number of hidden states of ``slope(p, z, ..., u, s)``."""
    return len(inspect.signature(slope).parameters) - 3


def step_of(cls: Any) -> tuple[Callable[[FloatArray, FloatArray, float], float], int]:
    """The step of a family by its `slope` and `output`, or its `flow` where `flows` says so, and the room it needs."""
    # SciPy's integrators take a quarter of a second to load
    from hysim.kernels.branch import LARGEST, MAX_STEPS, follower, workspace

    n = cls.hidden
    names: dict[str, Any] = {"FloatArray": FloatArray, "math": math, "LARGEST": LARGEST, "MAX_STEPS": MAX_STEPS}
    said = {"slope": cls.slope, "output": cls.output, "longest": cls.longest, "flows": cls.flows, "flow": cls.flow}
    for name, function in said.items():
        if function is not None:
            try:
                tree = _parsed(inspect.getsource(function))
            except OSError:
                raise TypeError(
                    f"the source of the {name} of {cls.__name__} cannot be read: define it in a file or a notebook"
                ) from None
            _Places(cls.__name__, tree.args.args[0].arg, constants_of(cls)).visit(tree)
            names[name] = unstored(_defined(tree, function, f"{cls.__qualname__}.{name}", {**function.__globals__}))
    states = ", ".join(f"x[{i}]" for i in range(n))
    text = _TEXT.format(
        slopes=", ".join(f"out[{i}]" for i in range(n)),
        states=states,
        longest="math.inf" if cls.longest is None else f"longest(p, {states}, slope, s)",
        move=(_FLOW if cls.flow is not None else "") + _MOVE.format(n=n),
        memory=", ".join(f"state[{1 + i}]" for i in range(len(inspect.signature(cls.output).parameters) - 2)),
    )
    *parts, step = map(_parsed, text.split("\n\n"))
    rates, room = (unstored(_defined(part, cls.slope, f"{cls.__qualname__}.{part.name}", names)) for part in parts)
    names["follow"] = follower(rates, room)
    return _defined(step, cls.slope, f"{cls.__qualname__}.step", names), workspace(n)


class _Places(ast.NodeTransformer):
    """Writes places of a vector for the attributes of the parameters; a tuple is the rest of the vector."""

    def __init__(self, family: str, vector: str, constants: Mapping[str, bool]) -> None:
        self.family, self.vector, self.is_tuple, self.names = family, vector, constants, list(constants)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        if not (isinstance(node.value, ast.Name) and node.value.id == self.vector):
            return node
        if node.attr not in self.names:
            raise TypeError(f"{self.family} has no parameter {node.attr!r}{meant(node.attr, self.names)}")
        place: ast.expr = ast.Constant(self.names.index(node.attr))
        return ast.Subscript(node.value, ast.Slice(place) if self.is_tuple[node.attr] else place, ast.Load())


def _parsed(text: str) -> ast.FunctionDef:
    (tree,) = ast.parse(textwrap.dedent(text)).body
    assert isinstance(tree, ast.FunctionDef)
    tree.decorator_list = []
    return tree


def _defined(tree: ast.FunctionDef, beside: Any, name: str, names: dict[str, Any]) -> Any:
    """The function of a syntax tree, as if it stood in the file of another one, where numba keeps what it compiles."""
    ast.increment_lineno(ast.fix_missing_locations(tree), beside.__code__.co_firstlineno - tree.lineno)
    exec(compile(ast.Module([tree], []), beside.__code__.co_filename, "exec"), names)
    function = names[tree.name]
    function.__qualname__, function.__module__ = name, beside.__module__
    sources[function] = ast.unparse(tree)
    return function
