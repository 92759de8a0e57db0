"""A step in C99 with its numbers: what a C source, a functional mock-up unit and a page are made of."""

import math
from dataclasses import replace
from typing import Any, NamedTuple

from hysim._frozen import FloatArray, frozen, read_only
from hysim.control import Controller, InverseFeedforward, RestingPlant, TrackingController, begun, preview
from hysim.export._packing import packing
from hysim.export._scope import plain
from hysim.export._translate import Function, Translation
from hysim.export._types import Known, Scalar, Vector
from hysim.kernels.controllers import guarded
from hysim.kernels.stepping import Start, Step, complete
from hysim.models.law import Law
from hysim.models.protocols import Startable, Stepwise, needs_time, standing
from hysim.plants.actuator import as_stepwise
from hysim.plants.amplifier import Amplifier
from hysim.plants.creep import Creep
from hysim.plants.sampled import Vibration

_VECTORS = Vector(), Vector()
_LAW, _CONTROLLER, _FEEDFORWARD = ("u",), ("reference", "measurement"), ("reference",)


class Field(NamedTuple):
    """A number of a model that may still be changed where the program runs.

    `lower` and `upper` are the box of a slider or of a tunable parameter; `log` says that its scale is logarithmic.
    """

    name: str
    value: float
    lower: float = -math.inf
    upper: float = math.inf
    log: bool = False
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
        Places at the front of the state that are the input and the memory; the rest is room for work.
    sample_time : float
        Time between two samples [s]; nan for a law that does not depend on time.
    ahead : int
        Samples by which a controller gets the reference ahead of its time.
    """

    source: str
    step: str
    inputs: tuple[str, ...]
    output: str
    parameters: FloatArray
    state: FloatArray
    start: str = ""
    fields: tuple[Field, ...] = ()
    pack: str = ""
    memory: int = 0
    sample_time: float = math.nan
    ahead: int = 0


def program_of(
    thing: Any,
    sample_time: float | None = None,
    *,
    u0: float | None = None,
    y0: float | None = None,
    tunable: bool = False,
) -> Program:
    """The step of a law, a plant or a controller in C99.

    Parameters
    ----------
    thing : model or controller
        A law, plant, sum or cascade that can be stepped, or a sampled controller.
    sample_time : float, optional
        Time between two samples [s]; a law that does not depend on time needs none.
    u0, y0 : float, optional
        Command and displacement at which a controller starts, at rest; by default as `start_of` has them.
    tunable : bool
        Whether the numbers of a law may still be changed in the program.

    Returns
    -------
    Program

    Raises
    ------
    TypeError
        If the thing cannot be stepped.
    ValueError
        If no sample time is given where one is needed, or `u0` or `y0` is not finite.
    UntranslatableError
        If a step is outside the subset of Python that is translated.

    Examples
    --------
    >>> import hysim as hs
    >>> from hysim.export import program_of
    >>> program = program_of(hs.Play(threshold=0.5))
    >>> program.inputs, program.parameters.tolist()
    (('u',), [0.0, 0.0, 0.0, 0.5, 1.0])
    """
    if sample_time is not None and not 0.0 < sample_time < math.inf:
        raise ValueError(f"sample_time must be positive and finite, got {sample_time}")
    for name, value in (("u0", u0), ("y0", y0)):
        if value is not None and not math.isfinite(value):
            raise ValueError(f"{name} must be finite, got {value}")
    if isinstance(thing, type):
        raise TypeError(f"an instance is expected, got the class {thing.__name__}: give it its parameters first")
    if isinstance(thing, Creep | Amplifier | Vibration):
        thing = as_stepwise(thing)
    if isinstance(thing, Stepwise):
        if tunable and isinstance(thing, Law):
            thing = thing.placed(None)  # whose state is completed where the program runs, from its numbers there
        model = thing.startable(sample_time)
        timed = sample_time if needs_time(thing) else None
        if not (tunable and isinstance(thing, Law)):
            return _of_model(model, timed)
        free = packing(thing)
        program = _of_model(model, timed)
        return replace(
            program,
            source=program.source + "\n" + free.to_c("pack"),
            fields=tuple(Field(name, thing.scalars[name]) for name in free.fields),
            pack="pack",
            memory=len(free.memory),
        )
    if isinstance(thing, Controller):
        if isinstance(thing, InverseFeedforward) and not thing.dynamic:
            begin = start_of(thing, math.inf, u0, y0)
            return replace(_of_controller(thing, math.inf, *begin), sample_time=math.nan)
        if sample_time is None:
            raise ValueError(f"a {type(thing).__name__} is sampled: give sample_time")
        return _of_controller(thing, sample_time, *start_of(thing, sample_time, u0, y0))
    raise TypeError(f"a law, a plant or a controller that can be stepped is expected, got {type(thing).__name__}")


def start_of(thing: Any, sample_time: float, u0: float | None, y0: float | None) -> tuple[float, float]:
    """Command and displacement at which a controller starts, as in `hysim.close_loop`.

    By default they are the command at which the memory of its law holds and the displacement of its model there; 0 for
    a law that has no such command.
    """
    command = standing(thing, u0)
    if y0 is not None or u0 is not None or not isinstance(thing, InverseFeedforward | TrackingController):
        return command, y0 or 0.0
    if thing.plant is None or thing.u0 is None:
        return command, 0.0
    return command, RestingPlant(thing.plant, min(sample_time, 1.0), command).y0


def _of_model(model: Startable, sample_time: float | None) -> Program:
    sizes = model.parameters.size, model.state.size
    source, has_start = entries(model.step, model.start, sizes)
    return Program(
        source=source,
        step="step",
        inputs=_LAW,
        output="y",
        parameters=read_only(model.parameters, finite=False),
        state=read_only(model.state, finite=False),
        start="start" if has_start else "",
        memory=model.state.size,
        sample_time=math.nan if sample_time is None else sample_time,
    )


def _of_controller(controller: Controller, sample_time: float, u0: float, y0: float) -> Program:
    step, parameters, state = begun(controller, sample_time, u0, y0)
    translation = Translation()
    function = translation.function(guarded, (Known(plain(step)), *_VECTORS, Scalar.DOUBLE, Scalar.DOUBLE))
    function = function._replace(parameters=function.parameters[1:])
    inputs = _FEEDFORWARD if isinstance(controller, InverseFeedforward) else _CONTROLLER
    return Program(
        source=translation.text() + "\n" + _entry("step", function, inputs, (parameters.size, state.size), _CONTROLLER),
        step="step",
        inputs=inputs,
        output="command",
        parameters=read_only(parameters, finite=False),
        state=read_only(state, finite=False),
        memory=state.size,
        sample_time=sample_time,
        ahead=preview(controller, sample_time),
    )


def entries(step: Step, start: Start, sizes: tuple[int, int] | None = None) -> tuple[str, bool]:
    """C99 text with the functions `step` and `start` of a model, and whether there is a `start`.

    Parameters
    ----------
    step, start : function
        Kernels, or functions in their subset of Python.
    sizes : (int, int), optional
        Numbers of the parameters and of the state. By default they are arguments of both functions, ``step(parameters,
        n_parameters, state, n_state, u)``, so that one program serves every law of a family.

    Returns
    -------
    text : str
    has_start : bool
        Whether the state depends on the first input.

    Raises
    ------
    UntranslatableError
        If a function is outside the subset of Python that is translated.
    """
    translation, types = Translation(), (*_VECTORS, Scalar.DOUBLE)
    function = translation.function(step, types)
    has_start = start is not complete
    begun = translation.function(start, types) if has_start else None
    texts = [translation.text(), _entry("step", function, _LAW, sizes, _LAW)]
    if begun is not None:
        texts.append(_entry("start", begun, ("u0",), sizes, ("u0",)))
    return "\n".join(texts), has_start


def _entry(
    name: str, function: Function, inputs: tuple[str, ...], sizes: tuple[int, int] | None, every: tuple[str, ...]
) -> str:
    """A function of parameters, state and inputs that calls a translated one with what this uses.

    `every` are the names of its own inputs, of which `inputs` are taken.
    """
    lengths = ("n_parameters", "n_state") if sizes is None else tuple(map(str, sizes))
    given: list[str] = []
    names = ("parameters", "state", *every)
    for parameter, argument, length in zip(function.parameters, names, (*lengths, *every), strict=True):
        given += [argument if argument in ("parameters", "state", *inputs) else "0.0"] * parameter.is_used
        given += [length] * len(parameter.axes)
    vectors = ["const double *parameters", "double *state"]
    if sizes is None:
        vectors = [vectors[0], "int n_parameters", vectors[1], "int n_state"]
    taken = ("parameters", "state", *inputs, *lengths * (sizes is None))
    unused = "".join(f"    (void){each};\n" for each in taken if each not in given)
    result, call = ("void", "") if function.returns is None else ("double", "return ")
    arguments = ", ".join([*vectors, *(f"double {each}" for each in inputs)])
    return f"static {result} {name}({arguments}) {{\n{unused}    {call}{function.name}({', '.join(given)});\n}}\n"
