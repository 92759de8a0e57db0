"""A step in C99 with its numbers: what a C source, a functional mock-up unit and a page are made of.

Kernels are translated by a walk over the syntax trees of the portable subset of Python, which stands in
`hysim/kernels/__init__.py`. Each function becomes one static C function for each combination of argument types and of
functions among its arguments: calls through function values are direct calls in C. Types of local names follow from
their values, and are sought again until nothing changes. A vector is a pointer; where its length is used, an `int`
follows it. What is never written to is `const`, and what is never used is left out.

C evaluates operands in any order; so the subset allows one call in an expression that writes to the state.
"""

import ast
import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, NamedTuple

from hysim._basics.frozen import FloatArray, check_finite, frozen
from hysim.control import Controller, InverseFeedforward, RestingPlant, TrackingController, begun, preview
from hysim.errors import HysimWarning, SimulationError
from hysim.export import _c
from hysim.export._body import Body
from hysim.export._c import Function, Known, Parameter, Routine, Scalar, Several, Type, Vector, plain, routine
from hysim.export._packing import Packing, packing
from hysim.kernels.controllers import guarded
from hysim.kernels.stepping import Start, Step, complete
from hysim.models.law import Law
from hysim.models.protocols import Remembering, Startable, Stepwise, input_range, needs_time, positive_time, standing
from hysim.plants.actuator import as_stepwise
from hysim.plants.stages import Amplifier, Creep, Vibration
from hysim.signals import triangle

_ANNOTATED = MappingProxyType({"float": Scalar.DOUBLE, "int": Scalar.INT, "bool": Scalar.BOOL})
_VECTORS = Vector(), Vector()
_LAW, _CONTROLLER, _FEEDFORWARD = ("u",), ("reference", "measurement"), ("reference",)


@dataclass
class Translation:
    """C text of the functions translated so far, each after those that it calls."""

    functions: dict[Any, Function] = field(default_factory=dict)
    helpers: set[str] = field(default_factory=set)
    structs: set[Several] = field(default_factory=set)
    _texts: list[str] = field(default_factory=list)
    _tables: dict[int, tuple[str, Any]] = field(default_factory=dict)
    _names: set[str] = field(default_factory=set)

    def function(self, of: Callable[..., Any], types: tuple[Type, ...]) -> Function:
        """C function of a kernel for these argument types, translated once; UntranslatableError outside the subset."""
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
        if id(values) not in self._tables:
            self._tables[id(values)] = self._free(f"table_{name.strip('_').lower()}"), values
        return self._tables[id(values)][0]

    def text(self) -> str:
        structs = [
            f"typedef struct {{ {' '.join(f'{m.c_type} at{i};' for i, m in enumerate(each.members))} }} {each.c_type};"
            for each in sorted(self.structs, key=lambda each: each.c_type)
        ]
        helpers = [text for name, text in _c.HELPERS.items() if name in self.helpers]
        used = set(re.findall(r"table_\w+", "".join(self._texts)))  # a table may stand in a branch that was left out
        tables = [_c.table(name, values) for name, values in self._tables.values() if name in used]
        parts = ["\n".join(each) for each in (structs, helpers, tables) if each]
        return "\n\n".join([*parts, *self._texts]) + "\n"

    def _free(self, wanted: str) -> str:
        """A name in C that is not taken; no public name ends with an underscore, or with an underscore and a number."""
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
            self.structs.add(body.returns)
        result = "void" if body.returns is None else body.returns.c_type  # type: ignore[union-attr]
        arguments = [text for each in parameters for text in _declared(each, scope.c_name(each.name))]
        summary = (ast.get_docstring(source.tree) or "").partition("\n\n")[0]
        comment = summary.replace("\n", "\n   ").replace("*/", "* /")
        head = f"static {result} {name}({', '.join(arguments) or 'void'})"
        self._texts.append((f"/* {comment} */\n" if comment else "") + f"{head} {{\n{text}}}")
        return Function(name, parameters, body.returns)


def _declared(parameter: Parameter, name: str) -> list[str]:
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
        numbers = f"{len(arguments.args)} arguments, not {count}"
        raise source.refusal(source.tree, f"{source.function.__name__} takes {numbers}")
    return arguments.args


def _as_annotated(argument: ast.arg, type_: Type) -> Type:
    """The type of an argument: a number is what its annotation says."""
    if isinstance(type_, Scalar) and isinstance(argument.annotation, ast.Name):
        return _ANNOTATED.get(argument.annotation.id, type_)
    return type_


class Field(NamedTuple):
    """A number that may be changed where the program runs."""

    name: str
    value: float
    unit: str = ""


@frozen
class Program:
    """C99 functions of a step, and the numbers that they take.

    Parameters
    ----------
    source : str
        C99 text that needs the C library's `math.h` alone: static functions and tables.
    step : str
        Name of the function ``double step(const double *parameters, double *state, double u)``; a controller has
        ``reference`` and ``measurement`` in place of `u`. The state moves along.
    inputs : tuple of str
        Names of the inputs, ``("u",)`` or ``("reference", "measurement")``.
    output : str
        Name of the output.
    parameters : array, shape (n_parameters,)
        Constants of the step.
    state : array, shape (n_state,)
        State before the first sample.
    start : str
        Name of the function ``void start(const double *parameters, double *state, double u0)`` that completes `state`
        for a first input `u0`; empty where `state` is complete.
    fields : tuple of Field
        Numbers that may be changed before a start.
    pack : str
        Name of the function ``void pack(const double *fields, double *parameters, double *state)`` that writes
        `parameters` and the front of `state` from the fields; empty where there are none.
    memory : int
        Places at the front of the state that are the input and the memory; the rest is room for work. 0 where the
        memory would not hold for other fields.
    sample_time : float
        Time between two samples [s]; nan for a law that does not depend on time.
    rests : bool
        Whether a first step at `u0` leaves the model at rest; linear plants in a sum or a cascade begin at zero.
    ahead : int
        Samples by which a controller gets the reference ahead of its time.
    """

    source: str
    step: str = "step"
    inputs: tuple[str, ...]
    output: str
    parameters: FloatArray
    state: FloatArray
    start: str = ""
    fields: tuple[Field, ...] = ()
    pack: str = ""
    memory: int = 0
    sample_time: float = math.nan
    rests: bool = False
    ahead: int = 0


def lacks_inverse(thing: Any) -> str:
    """Text and warning of the first place without an inverse on cycles over the law's identified range; else ""."""
    if not isinstance(thing, InverseFeedforward) or thing.dynamic or (span := input_range(thing.law)) is None:
        return ""
    try:
        thing.law.inverse_response(thing.law.response(triangle(*span, cycles=2, samples_per_cycle=200)))
        return ""
    except SimulationError as error:
        lacks = f"on a cycle from {span[0]:g} to {span[1]:g} {error}; there the last command is held"
        warnings.warn(lacks, HysimWarning, stacklevel=3)
        return lacks


def program_of(
    thing: Any,
    sample_time: float | None = None,
    *,
    u0: float | None = None,
    y0: float | None = None,
    tunable: bool = False,
) -> Program:
    """The step of a law, a plant or a controller in C99.

    A law that does not depend on time needs no `sample_time` [s]. A controller starts at rest at `u0` and `y0`, by
    default those of `start_of`. If `tunable`, the numbers of a law may still be changed in the program, where its
    parameters follow from them by arithmetic. TypeError if the thing cannot be stepped, ValueError if a sample time is
    missing or a start is not finite, UntranslatableError if a step is outside the translated subset of Python.
    """
    if sample_time is not None:
        positive_time(sample_time)
    check_finite(u0=u0, y0=y0)
    if isinstance(thing, type):
        raise TypeError(f"an instance is expected, got the class {thing.__name__}: give it its parameters first")
    if isinstance(thing, Creep | Amplifier | Vibration):
        thing = as_stepwise(thing)
    if isinstance(thing, Stepwise):
        step = sample_time if sample_time is not None and needs_time(thing) else math.nan
        law = thing if tunable and isinstance(thing, Law) else None
        free = None if law is None else _packing_of(law)
        if law is None or free is None:
            return _of_model(thing.startable(sample_time), step)
        # placed: its state is completed where the program runs, from its numbers there
        program = _of_model(law.placed(None).startable(sample_time), step)
        source = f"{program.source}\n{free.to_c('pack')}"
        fields = tuple(Field(name, law.scalars[name], unit=field_unit(law, name)) for name in free.fields)
        # the state of relays has outputs at turning points too, which would be those of the numbers before
        memory = (n := len(free.memory)) * (n == 1 or isinstance(law, Remembering))
        return replace(program, source=source, fields=fields, pack="pack", memory=memory)
    if isinstance(thing, Controller):
        if isinstance(thing, InverseFeedforward) and not thing.dynamic:
            return replace(_of_controller(thing, math.inf, u0, y0), sample_time=math.nan)
        if sample_time is None:
            raise ValueError(f"a {type(thing).__name__} is sampled: give sample_time")
        return _of_controller(thing, sample_time, u0, y0)
    kinds = "a law, a plant or a controller that can be stepped"
    raise TypeError(f"{kinds} is expected, got {type(thing).__name__}; one with channels is exported as .at(T=...)")


def _packing_of(law: Law) -> Packing | None:
    """Parameters of the step as expressions of a law's numbers; None where they do not follow by arithmetic."""
    try:
        return packing(law)
    except ValueError:
        return None


def field_unit(law: Law, name: str) -> str:
    """Unit of one number of a law, as in ``"y/u"``; empty where it is not known."""
    searched = {each.name: each.unit for each in law.searched if each.unit != "1"}
    return {**searched, **law.units}.get(name.partition("[")[0], "")


def start_of(thing: Any, sample_time: float, u0: float | None, y0: float | None) -> tuple[float, float]:
    """Command and displacement of a controller at its start, by default at rest as in `hysim.close_loop`, else 0."""
    command = standing(thing, u0)
    if y0 is not None or u0 is not None or not isinstance(thing, InverseFeedforward | TrackingController):
        return command, y0 or 0.0
    if thing.plant is None or thing.u0 is None:
        return command, 0.0
    return command, RestingPlant(thing.plant, min(sample_time, 1.0), command).y0


def _of_model(model: Startable, sample_time: float) -> Program:
    source, has_start = entries(model.step, model.start, (model.parameters.size, model.state.size))
    numbers: dict[str, Any] = {"parameters": model.parameters, "state": model.state, "memory": model.state.size}
    numbers |= {"start": "start" if has_start else "", "rests": math.isnan(sample_time) or _rests(model)}
    return Program(source=source, inputs=_LAW, output="y", sample_time=sample_time, **numbers)


def _rests(model: Startable) -> bool:
    """Whether the state stays in a second step at the first input."""
    law = model.started(1.0)
    once, again = ((law.step(law.parameters, law.state, 1.0), *law.state) for _ in range(2))
    return once == again


def _of_controller(controller: Controller, sample_time: float, u0: float | None, y0: float | None) -> Program:
    step, parameters, state = begun(controller, sample_time, *start_of(controller, sample_time, u0, y0))
    translation = Translation()
    function = translation.function(guarded, (Known(plain(step)), *_VECTORS, Scalar.DOUBLE, Scalar.DOUBLE))
    function = function._replace(parameters=function.parameters[1:])
    inputs = _FEEDFORWARD if isinstance(controller, InverseFeedforward) else _CONTROLLER
    entry = _entry("step", function, inputs, (parameters.size, state.size), _CONTROLLER)
    numbers: dict[str, Any] = {"parameters": parameters, "state": state, "memory": state.size}
    times: dict[str, Any] = {"sample_time": sample_time, "ahead": preview(controller, sample_time)}
    return Program(source=f"{translation.text()}\n{entry}", inputs=inputs, output="command", **numbers, **times)


def entries(step: Step, start: Start, sizes: tuple[int, int] | None = None) -> tuple[str, bool]:
    """C99 text with the functions `step` and `start` of a model, and whether there is a `start`.

    `sizes` are the numbers of parameters and of the state, by default arguments of both functions, so that one program
    serves every law of a family. An UntranslatableError is raised for Python outside the subset.
    """
    translation, types = Translation(), (*_VECTORS, Scalar.DOUBLE)
    kernels = {"step": (step, _LAW)} | ({} if start is complete else {"start": (start, ("u0",))})
    made = {name: (translation.function(kernel, types), inputs) for name, (kernel, inputs) in kernels.items()}
    texts = [_entry(name, function, inputs, sizes, inputs) for name, (function, inputs) in made.items()]
    return "\n".join([translation.text(), *texts]), "start" in kernels


def _entry(
    name: str, function: Function, inputs: tuple[str, ...], sizes: tuple[int, int] | None, every: tuple[str, ...]
) -> str:
    """A C function of parameters, state and inputs (`every`; it uses `inputs`) around a translated one."""
    lengths = ("n_parameters", "n_state") if sizes is None else tuple(map(str, sizes))
    values: list[str] = []
    names = ("parameters", "state", *every)
    for parameter, argument, length in zip(function.parameters, names, (*lengths, *every), strict=True):
        values += [argument if argument in ("parameters", "state", *inputs) else "0.0"] * parameter.is_used
        values += [length] * len(parameter.axes)
    vectors = ["const double *parameters", "double *state"]
    if sizes is None:
        vectors = [vectors[0], "int n_parameters", vectors[1], "int n_state"]
    taken = ("parameters", "state", *inputs, *lengths * (sizes is None))
    unused = "".join(f"    (void){each};\n" for each in taken if each not in values)
    result, call = ("void", "") if function.returns is None else ("double", "return ")
    arguments = ", ".join([*vectors, *(f"double {each}" for each in inputs)])
    return f"static {result} {name}({arguments}) {{\n{unused}    {call}{function.name}({', '.join(values)});\n}}\n"
