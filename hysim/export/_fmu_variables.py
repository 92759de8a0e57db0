"""Variables of a functional mock-up unit, their units, and the description in XML, of FMI 2.0 and 3.0."""

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from hysim._basics.prefixes import prefixed
from hysim._release import __version__
from hysim.export._program import Program

BASE_UNITS = ("kg", "m", "s", "A", "K", "rad")
_EXPONENTS = MappingProxyType(
    {
        "m": (0, 1), "g": (1,), "s": (0, 0, 1), "A": (0, 0, 0, 1), "K": (0, 0, 0, 0, 1), "rad": (0, 0, 0, 0, 0, 1),
        "N": (1, 1, -2), "Pa": (1, -1, -2), "Hz": (0, 0, -1), "W": (1, 2, -3), "J": (1, 2, -2), "L": (0, 3),
        "V": (1, 2, -3, -1), "C": (0, 0, 1, 1), "F": (-1, -2, 4, 2), "T": (1, 0, -2, -1), "H": (1, 2, -2, -2),
        "Wb": (1, 2, -2, -1), "ohm": (1, 2, -3, -2), "\u03a9": (1, 2, -3, -2),
    }
)  # fmt: skip
_POWERS = MappingProxyType({"g": -3, "L": -3})  # of ten, in base units
_SIGNALS = MappingProxyType({"reference": "y", "measurement": "y", "command": "u", "h": "u"})
DELAY = (
    "Each communication step passes the input at its beginning to the model and ends with the output for it: "
    "the output is one communication step late."
)
SAMPLED = (
    "The model is computed at multiples of its sample time with the input of that moment, and its output holds "
    "between them: it is late by one communication step."
)
_TUNED = "It may be changed during the simulation; the memory stays."


class BaseUnit(NamedTuple):
    """Exponents of `BASE_UNITS`, and the power of ten with which a value becomes one in them."""

    exponents: tuple[int, ...]
    power: int


def label(unit: str, units: Mapping[str, str]) -> str:
    """The label of a unit such as ``"y/u"`` for the labels of u, y and t; empty where one of them is unknown.

    ``"1"`` and ``"s"`` stand for themselves, ``"h"`` for half the span of an input.

    >>> label("y/u", {"u": "V", "y": "um"}), label("y", {}), label("1/u", {"u": "m/s"})
    ('um/V', '', '1/(m/s)')
    """
    parts = unit.split("/")
    names = [part if part in ("1", "s") else units.get(_SIGNALS.get(part, part), "") for part in parts]
    if not all(names):
        return ""
    return "/".join([names[0], *(f"({name})" if "/" in name else name for name in names[1:])])


def base_unit(unit: str) -> BaseUnit | None:
    """A label such as ``um/V`` in base units, None where it is not understood.

    >>> base_unit("um/V")
    BaseUnit(exponents=(-1, -1, 3, 1, 0, 0), power=-6)
    >>> base_unit("px") is None
    True
    """
    exponents, power = [0] * len(BASE_UNITS), 0
    for k, part in enumerate(unit.split("/")):
        if part == "1":
            continue
        try:
            prefix, base = prefixed(part)
        except ValueError:
            return None
        sign = -1 if k else 1
        power += sign * (prefix + _POWERS.get(base, 0))
        for place, exponent in enumerate(_EXPONENTS[base]):
            exponents[place] += sign * exponent
    return BaseUnit(tuple(exponents), power)


class Variable(NamedTuple):
    """A real variable: its name and value reference, its role in FMI, and its unit, start value and limits."""

    name: str
    reference: int
    causality: str
    variability: str
    initial: str = ""
    unit: str = ""
    start: float | None = None
    lower: float = -math.inf
    upper: float = math.inf
    description: str = ""

    def attributes(self) -> dict[str, str]:
        """Those that stand in the XML of both versions beside each other."""
        named = {
            "name": self.name,
            "valueReference": str(self.reference),
            "causality": self.causality,
            "variability": self.variability,
            "initial": self.initial,
            "description": self.description,
        }
        return {name: value for name, value in named.items() if value}

    def numbers(self) -> dict[str, str]:
        limits = {"min": self.lower, "max": self.upper}
        finite = {name: repr(value) for name, value in limits.items() if math.isfinite(value)}
        start = {} if self.start is None else {"start": repr(self.start)}
        return ({"unit": self.unit} if self.unit else {}) | finite | start


def is_tunable(program: Program) -> bool:
    """Whether the program's numbers can be changed in the course of a simulation: its memory is known apart."""
    return bool(program.fields) and program.memory > 0


def start_name(program: Program) -> str:
    return f"{program.inputs[0]}0"


def variables_of(program: Program, units: Mapping[str, str], u0: float) -> list[Variable]:
    """Variables in the order of their value references; ValueError if two have one name."""
    output = 1 + len(program.inputs)
    first = label(program.inputs[0], units)
    variables = [
        *(
            Variable(name, k, "input", "continuous", unit=label(name, units), start=u0 if k == 1 else 0.0)
            for k, name in enumerate(program.inputs, 1)
        ),
        Variable(program.output, output, "output", "continuous", "calculated", label(program.output, units)),
    ]
    if program.start:
        text = "Input at which the model rests before the simulation."
        parameter = ("parameter", "fixed", "exact", first, u0)
        variables.append(Variable(start_name(program), output + 1, *parameter, description=text))
    if math.isfinite(program.sample_time):
        time, text = program.sample_time, "Time between two samples of the model."
        variables.append(Variable("sample_time", output + 2, "local", "constant", "exact", "s", time, description=text))
    kind, text = ("tunable", _TUNED) if is_tunable(program) else ("fixed", "")
    for k, each in enumerate(program.fields):
        role = ("parameter", kind, "exact", label(each.unit, units), each.value)
        limits = min(each.lower, each.value), max(each.upper, each.value)
        variables.append(Variable(each.name, output + 3 + k, *role, *limits, text))
    names = [each.name for each in variables]
    if double := next((name for name in [*names, "time"] if [*names, "time"].count(name) > 1), None):
        raise ValueError(f"two variables of the unit would be called {double!r}: rename the parameter of the law")
    return variables


def description(program: Program, variables: list[Variable], name: str, version: str, token: str) -> str:
    sampled, is_2 = math.isfinite(program.sample_time), version == "2.0"
    step = repr(program.sample_time)
    common = {"modelIdentifier": name, "canHandleVariableCommunicationStepSize": "true"}
    saves = {f"can{what}FMU{'s' if is_2 else 'S'}tate": "true" for what in ("GetAndSet", "Serialize")}
    others = (
        {"canNotUseMemoryManagementFunctions": "true"} if is_2 else {"fixedInternalStepSize": step} if sampled else {}
    )
    files = [_element("SourceFiles", {}, _element("File", {"name": f"{name}.c"}))] if is_2 else []
    experiment = [_element("DefaultExperiment", {"startTime": "0.0", "stepSize": step})] if sampled else []
    category = _element("Category", {"name": "logStatusError", "description": "Reasons of errors."})
    attributes = {
        "fmiVersion": version,
        "modelName": name,
        "guid" if is_2 else "instantiationToken": token,
        "description": _sentences(program),
        "generationTool": f"hysim {__version__}",
        "variableNamingConvention": "flat",
    }
    parts = [
        _element("CoSimulation", common | saves | others, *files),
        *_units(variables),
        _element("LogCategories", {}, category),
        *experiment,
        _element("ModelVariables", {}, *_variables(variables, is_2)),
        _element("ModelStructure", {}, *_structure(variables, is_2)),
    ]
    return _text(_element("fmiModelDescription", attributes, *parts))


def _sentences(program: Program) -> str:
    if math.isnan(program.sample_time):
        return DELAY
    ahead = f" The reference is that of {program.ahead} samples later." if program.ahead else ""
    return SAMPLED + ahead


def build_description(name: str) -> str:
    """The text of ``buildDescription.xml``, which FMI 3.0 asks for beside sources."""
    sources = _element("SourceFileSet", {"language": "C99"}, _element("SourceFile", {"name": f"{name}.c"}))
    build = _element("BuildConfiguration", {"modelIdentifier": name}, sources)
    return _text(_element("fmiBuildDescription", {"fmiVersion": "3.0"}, build))


def _units(variables: Iterable[Variable]) -> list[Element]:
    units = []
    for each in dict.fromkeys(variable.unit for variable in variables if variable.unit):
        units.append(unit := _element("Unit", {"name": each}))
        if (base := base_unit(each)) is not None:
            exponents = {name: str(n) for name, n in zip(BASE_UNITS, base.exponents, strict=True) if n}
            factor = {"factor": repr(10.0**base.power)} if base.power else {}
            unit.append(_element("BaseUnit", exponents | factor))
    return [_element("UnitDefinitions", {}, *units)] if units else []


def _variables(variables: Iterable[Variable], is_2: bool) -> list[Element]:
    if is_2:
        return [_element("ScalarVariable", v.attributes(), _element("Real", v.numbers())) for v in variables]
    time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    return [_element("Float64", time), *(_element("Float64", v.attributes() | v.numbers()) for v in variables)]


def _structure(variables: list[Variable], is_2: bool) -> list[Element]:
    """The output, which follows from earlier inputs only, and at the start from the input at once."""
    index, output = next((k, each) for k, each in enumerate(variables, 1) if each.causality == "output")
    place = {"index": str(index)} if is_2 else {"valueReference": str(output.reference)}
    later = place | {"dependencies": ""}
    if is_2:
        unknowns = {"Outputs": later, "InitialUnknowns": place}
        return [_element(name, {}, _element("Unknown", each)) for name, each in unknowns.items()]
    return [_element("Output", later), _element("InitialUnknown", place)]


def _element(tag: str, attributes: dict[str, str], *children: Element) -> Element:
    element = Element(tag, attributes)
    element.extend(children)
    return element


def _text(root: Element) -> str:
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
