"""The step of a law that is given by its slope: written out for its family, and compiled and translated as any other.

A family says ``slope(p, z, u, s)``, with the parameters as attributes of `p`. In what is compiled `p` is the vector of
the parameters, and ``p.beta`` one of its places.
"""

import ast
import hashlib
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping
from types import CodeType, FunctionType
from typing import Any

from hysim._basics.frozen import FloatArray, last_names
from hysim._basics.names import meant
from hysim.kernels.stepping import sources, unstored

_TEXT = """\
def rates(p: FloatArray, x: FloatArray, u: float, s: float, side: float, out: FloatArray) -> None:
    z = x[0]
    if z == 0.0 and side != 0.0:  # where a slope may jump: that of this side
        z = math.copysign(TINY, side)
    {slopes} = slope(p, {others}, u, s)

def room(p: FloatArray, x: FloatArray, slope: float, s: float) -> float:
    return {longest}

def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
    {move}
    return output(parameters, {memory}, u) if math.isfinite(state[1]) else state[1]
"""
_MOVE = "follow({n}, parameters, state, u, parameters[0], True, LARGEST, MAX_STEPS)"
_FLOW = """\
if flows(parameters):
        if u != state[0] and math.isfinite(state[1]):  # a memory that has diverged remains so
            state[1] = flow(parameters, state[1], state[0], u)
        state[0] = u
    else:
        """


HOOKS = ("slope", "output", "longest", "flows", "flow")


def constants_of(cls: Any) -> dict[str, bool]:
    """The parameters of the step, and whether they are tuples: a tolerance, and the fields but the initial memory.

    Raises TypeError if a field has a name that a law keeps to itself, or a tuple is not the last field.
    """
    families = [base for base in reversed(cls.__mro__) if "__dataclass_params__" in vars(base)]
    kept = {*cls.initial, *(name for base in families for name in last_names(base))}
    told = [inspect.get_annotations(base) for base in (*families, cls)]
    fields = {
        name: "tuple" in str(kind).lower()
        for annotations in told
        for name, kind in annotations.items()
        if "ClassVar" not in str(kind) and name not in kept
    }
    if "slope" in fields:
        raise TypeError(f"{cls.__name__} has a field 'slope', which is the name of its function: take another one")
    if early := [name for name in [*fields][:-1] if fields[name]]:
        raise TypeError(
            f"{early[0]!r} of {cls.__name__} is a tuple: it must be the last field apart from the initial memory"
        )
    return {"tolerance": False} | fields


def states_of(cls: Any) -> int:
    """Number of hidden states of ``slope(p, z, ..., u, s)``; TypeError if a function of the family is none of a law."""
    said = functions_of(cls)
    n = len(inspect.signature(said["slope"]).parameters) - 3
    takes = {"slope": (n + 3,), "output": range(3, n + 3), "longest": (n + 3,), "flows": (1,), "flow": (4,)}
    for name, function in said.items():
        taken = inspect.signature(function).parameters.values()
        plain = all(each.kind is each.POSITIONAL_OR_KEYWORD and each.default is each.empty for each in taken)
        if n < 1 or not plain or len(taken) not in takes[name]:
            raise TypeError(f"the {name} of {cls.__name__} takes other arguments: see hysim.Law")
    if ("flow" in said) != ("flows" in said):
        raise TypeError(f"{cls.__name__} must define both flow and flows, or neither")
    return n


def functions_of(cls: Any) -> dict[str, FunctionType]:
    """The functions of a family from which its step follows, by their names."""
    said = {"slope": cls.slope, "output": cls.output, "longest": cls.longest, "flows": cls.flows, "flow": cls.flow}
    said = {name: function for name, function in said.items() if function is not None}
    for name, function in said.items():
        if not isinstance(function, FunctionType) or function.__name__ == "<lambda>":
            raise TypeError(f"the {name} of {cls.__name__} must be a plain function, under staticmethod and def")
        if function.__code__.co_freevars:
            outside = ", ".join(function.__code__.co_freevars)
            raise TypeError(f"the {name} of {cls.__name__} takes {outside} from a function around it: make it a field")
    return said


def step_of(cls: Any) -> tuple[Callable[[FloatArray, FloatArray, float], float], int]:
    """The step of a family by its `slope` and `output`, or its `flow` where `flows` says so, and the room it needs."""
    # SciPy's integrators take a quarter of a second to load
    from hysim.kernels.branch import LARGEST, MAX_STEPS, TINY, follower, workspace

    n, said, constants = cls.hidden_states, functions_of(cls), constants_of(cls)
    trees = {name: _tree(cls, name, function, constants) for name, function in said.items()}
    # numba links functions of one name across files: the name holds what is compiled.
    text = "".join(map(ast.unparse, trees.values()))
    family = f"{cls.__qualname__}_{hashlib.sha256(text.encode()).hexdigest()[:12]}"
    names: dict[str, Any] = {"FloatArray": FloatArray, "math": math, "TINY": TINY}
    names |= {"LARGEST": LARGEST, "MAX_STEPS": MAX_STEPS}
    for name, function in said.items():
        names[name] = unstored(_defined(trees[name], function, family, function.__globals__))
    states = ", ".join(f"x[{i}]" for i in range(n))
    written = _TEXT.format(
        slopes=", ".join(f"out[{i}]" for i in range(n)),
        states=states,
        others=", ".join(["z", *(f"x[{i}]" for i in range(1, n))]),
        longest="math.inf" if "longest" not in said else f"longest(p, {states}, slope, s)",
        move=(_FLOW if "flow" in said else "") + _MOVE.format(n=n),
        memory=", ".join(f"state[{1 + i}]" for i in range(len(inspect.signature(cls.output).parameters) - 2)),
    )
    *parts, step = map(_parsed, written.split("\n\n"))
    rates, room = (unstored(_defined(part, cls.slope, family, names)) for part in parts)
    names["rates"], names["room"], names["follow"] = rates, room, follower(rates, room)
    return _defined(step, cls.slope, family, names), workspace(n)


class _Places(ast.NodeTransformer):
    """Writes places of a vector for the attributes of the parameters; a tuple is the rest of the vector."""

    def __init__(self, family: str, vector: str, constants: Mapping[str, bool]) -> None:
        self.family, self.vector, self.is_tuple, self.names = family, vector, constants, list(constants)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        if not (isinstance(node.value, ast.Name) and node.value.id == self.vector):
            return node
        if node.attr not in self.names:
            raise TypeError(f"{self.family} has no parameter {node.attr!r}{meant(node.attr, self.names)}")
        if not isinstance(node.ctx, ast.Load):
            raise TypeError(f"{self.family} sets its parameter {node.attr!r}: a law keeps its parameters")
        place: ast.expr = ast.Constant(self.names.index(node.attr))
        return ast.Subscript(node.value, ast.Slice(place) if self.is_tuple[node.attr] else place, ast.Load())


def _tree(cls: Any, name: str, function: FunctionType, constants: Mapping[str, bool]) -> ast.FunctionDef:
    """A function of a family as it is compiled: of a vector of parameters, and without annotations."""
    try:
        tree = _parsed(inspect.getsource(function))
        if tree.name != function.__code__.co_name:
            raise OSError("another text has the name of what exec has compiled")
    except (OSError, SyntaxError):
        raise TypeError(
            f"the source of the {name} of {cls.__name__} cannot be read: define it in a file or a notebook"
        ) from None
    tree.returns = None
    for argument in tree.args.args:
        argument.annotation = None
    _Places(cls.__name__, tree.args.args[0].arg, constants).visit(tree)
    return tree


def _parsed(text: str) -> ast.FunctionDef:
    """The one function of a text, which may be indented; a SyntaxError if it begins with something else."""
    (block,) = ast.parse(f"if True:\n{text}" if text[:1].isspace() else f"if True:\n{textwrap.indent(text, ' ')}").body
    assert isinstance(block, ast.If)
    tree = block.body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise SyntaxError("the text begins with no function")
    tree.decorator_list = []
    return tree


def _defined(tree: ast.FunctionDef, beside: Any, family: str, names: dict[str, Any]) -> Any:
    """The function of a syntax tree, as if it stood in the file of another one, where numba keeps what it compiles."""
    ast.increment_lineno(ast.fix_missing_locations(tree), beside.__code__.co_firstlineno - tree.lineno)
    (code,) = [
        each
        for each in compile(ast.Module([tree], []), beside.__code__.co_filename, "exec").co_consts
        if isinstance(each, CodeType)
    ]
    function = FunctionType(code, names, tree.name)
    function.__qualname__, function.__module__ = f"{family}.{tree.name}", beside.__module__
    sources[function] = ast.unparse(tree)
    return function
