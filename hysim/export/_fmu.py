"""The verb `to_fmu`: a model as a functional mock-up unit, whose bytes depend on the arguments alone."""

import hashlib
import io
import math
import re
import uuid
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from string import Template
from types import MappingProxyType
from typing import Any, Literal, NamedTuple
from xml.sax.saxutils import quoteattr

from hysim._basics.atomic import write_all
from hysim._basics.frozen import check_choice
from hysim._basics.prefixes import prefixed
from hysim._basics.release import __version__
from hysim._basics.results import model_of
from hysim.errors import warn_unsafe
from hysim.export._c import number, table
from hysim.export._compilers import TARGETS, Target, compiler, shared_library, universal
from hysim.export._program import Program, program_of
from hysim.models.protocols import standing

_FOLDER = Path(__file__).with_name("fmu")
Version = Literal["2.0", "3.0"]
Platform = Literal["linux", "windows", "mac"]

VERSIONS = ("2.0", "3.0")
_FOLDERS_2 = {"linux": "linux64", "windows": "win64", "darwin": "darwin64"}
_WRITTEN = (1980, 1, 1, 0, 0, 0)  # the first time that a zip file knows
_MODE = 0o100644 << 16
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
_DELAY = (
    "Each communication step passes the input at its beginning to the model and ends with the output for it: "
    "the output is one communication step late."
)
_SAMPLED = (
    "The model is computed at multiples of its sample time with the input of that moment, and its output holds "
    "between them: it is late by one communication step."
)
_TUNED = "It may be changed during the simulation; the memory stays."


def to_fmu(
    thing: Any,
    path: str | Path,
    version: Version = "2.0",
    sample_time: float | None = None,
    *,
    name: str | None = None,
    units: Mapping[str, str] | None = None,
    platforms: Sequence[Platform] | None = None,
    u0: float | None = None,
    y0: float | None = None,
) -> Path:
    """Write a model as a functional mock-up unit (FMU) for co-simulation, with its C sources.

    A unit has an input, an output, the numbers of a law as tunable parameters, and where the model remembers its input
    a fixed parameter ``u0``, the input at which it rests before the simulation. Its state can be saved, restored and
    turned into bytes. The master sets the input at a communication point and reads the output at the next one: the
    output is one communication step late. At the start it is the output for the input at the start. A sampled model is
    computed at multiples of its sample time, whatever the communication step. Equal arguments give equal bytes.
    Standard: https://fmi-standard.org, versions 2.0.5 and 3.0.2.

    Parameters
    ----------
    thing : model, result of a fit, or controller
        A law, sum, cascade, plant or actuator, `InverseFeedforward` for the inverse of a law, or another controller.
    path : str or Path
        The file, which ends in ``.fmu``.
    version : "2.0" or "3.0"
        Version of FMI; most tools read 2.0, and some 3.0 too.
    sample_time : float, optional
        Time between two samples of a plant or a controller [s]; a law that does not depend on time has none.
    name : str, optional
        Name of the model, a name in C; by default that of its class.
    units : mapping, optional
        Labels of the units of ``"u"`` and ``"y"``, which the variables then have.
    platforms : sequence of "linux", "windows" and "mac", optional
        Systems that find a shared library in the file. By default that of this machine if it has a C compiler (gcc,
        clang, or zig of the extra `export`); an empty sequence writes the sources alone. Zig compiles for all three.
    u0, y0 : float, optional
        Input at which a law stands before the simulation, the default of the parameter ``u0``; command and displacement
        at which a controller starts [unit of u], [unit of y]. By default as of `hysim.to_c`.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    TypeError, ValueError, ImportError, OSError
        If the thing is no model that can be exported; if the version, the name, a platform or the ending of the file is
        unknown, or the sample time is missing; if a shared library is asked for and no compiler can make it; if the
        file cannot be written, or the compiler fails.

    Examples
    --------
    >>> import tempfile, zipfile, hysim as hs
    >>> law = hs.Dahl(stiffness=2.0, coulomb=0.5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = hs.to_fmu(law, f"{folder}/friction.fmu", units={"u": "mm", "y": "N"}, platforms=())
    ...     zipfile.ZipFile(path).namelist()
    ['modelDescription.xml', 'sources/Dahl.c']
    """
    warn_unsafe(thing)
    thing, path = model_of(thing), Path(path)
    check_choice("version", version, VERSIONS)
    if path.suffix.lower() != ".fmu":
        raise ValueError(f"a functional mock-up unit is a file .fmu, got {str(path)!r}")
    if isinstance(platforms, str):
        raise TypeError(f"platforms must be a sequence such as ({platforms!r},), got {platforms!r}")
    for each in platforms or ():
        check_choice("platforms", each, TARGETS)
    labels = dict(units or {})
    if not all(isinstance(text, str) for pair in labels.items() for text in pair):
        raise TypeError(f"units must be labels by the names u, y and t, got {units!r}")
    if labels.get("t", "s") != "s":
        raise ValueError(f"the time of a unit is in s, got {labels['t']}: identify the model on records in s")
    name = type(thing).__name__ if name is None else name
    if not re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", name):
        raise ValueError(f"name must be letters, digits and underscores after a letter, got {name!r}")
    program = program_of(thing, sample_time, u0=u0, y0=y0, tunable=True)
    write_all({path: archive(program, name, version, platforms, labels, standing(thing, u0))})
    return path


def archive(
    program: Program, name: str, version: str, platforms: Sequence[str] | None, units: Mapping[str, str], u0: float
) -> bytes:
    """Bytes of a unit with a token that depends on its texts alone."""
    variables = variables_of(program, units, u0)
    blank = _description(program, variables, name, version, ""), _source(program, variables, version, "")
    token = f"{{{uuid.uuid5(uuid.NAMESPACE_URL, chr(0).join(blank))}}}"
    source = _source(program, variables, version, token)
    description = _description(program, variables, name, version, token)
    texts = {"modelDescription.xml": description, f"sources/{name}.c": source}
    if version == "3.0":
        texts["sources/buildDescription.xml"] = _template("build.xml").substitute(name=name)
    files = {place: text.encode() for place, text in texts.items()} | _libraries(source, name, version, platforms)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as unit:
        for place, content in sorted(files.items()):
            entry = zipfile.ZipInfo(place, _WRITTEN)
            entry.create_system, entry.external_attr, entry.compress_type = 3, _MODE, zipfile.ZIP_DEFLATED
            unit.writestr(entry, content)
    return stream.getvalue()


def _template(name: str) -> Template:
    return Template((_FOLDER / name).read_text(encoding="utf-8"))


# ---------------------------------------------------------------------------------- sources and libraries


def _source(program: Program, variables: Sequence["Variable"], version: str, token: str) -> str:
    n_inputs, n_fields = len(program.inputs), len(program.fields)
    inputs, fields = variables[:n_inputs], variables[len(variables) - n_fields :]
    tables = {
        "INPUT_VALUES": [each.start or 0.0 for each in inputs],
        "PARAMETER_VALUES": program.parameters.tolist(),
        "STATE_VALUES": program.state.tolist(),
        "FIELD_VALUES": [each.start or 0.0 for each in fields],
    }
    digest, sampled = hashlib.sha256(token.encode()).digest(), math.isfinite(program.sample_time)
    names = {"output": program.output, "hysim": __version__, "step": program.step, "token": token}
    sizes = {"n_inputs": n_inputs, "n_fields": n_fields, "n_parameters": program.parameters.size}
    sizes |= {"n_state": program.state.size, "memory": program.memory}
    return _template("source.c").substitute(
        {**names, **sizes},
        inputs=", ".join(program.inputs),
        functions=program.source.strip(),
        is_tunable=int(bool(program.fields and program.memory)),
        values=", ".join(f"(x)[{k}]" for k in range(n_inputs)),
        pack=f"{program.pack}((f), (p), (s))" if program.pack else "((void)0)",
        begin=f"{program.start}((p), (s), (u0))" if program.start else "((void)0)",
        numbers=", ".join(number(float(int.from_bytes(digest[k : k + 6], "big"))) for k in (0, 6)),
        start=number(inputs[0].start or 0.0),
        more="#define FMU_HAS_START 1\n" * bool(program.start)
        + "#define FMU_RESTS 1\n" * bool(program.start and program.rests)
        + f"#define FMU_SAMPLE_TIME {number(program.sample_time)}\n" * sampled,
        tables="\n".join(table(f"FMU_{name}", numbers) for name, numbers in tables.items()),
        model=(_FOLDER / "model.c").read_text(encoding="utf-8").strip(),
        interface=(_FOLDER / f"fmi{version[0]}.c").read_text(encoding="utf-8").strip(),
    )


def _libraries(source: str, name: str, version: str, platforms: Sequence[str] | None) -> dict[str, bytes]:
    """Shared libraries by their places in the unit; ImportError if no compiler serves a platform asked for by name."""
    places: dict[str, list[bytes]] = {}
    for each, command in _commands(platforms, version).items():
        folder = each.name if version == "3.0" else _FOLDERS_2[each.name.partition("-")[2]]
        library = shared_library(source, name, each, command)
        places.setdefault(f"binaries/{folder}/{name}{each.ending}", []).append(library)
    return {place: data[0] if len(data) == 1 else universal(data) for place, data in places.items()}


def _commands(platforms: Sequence[str] | None, version: str) -> dict[Target, Sequence[str]]:
    """Targets, each with its compiler; FMI 2.0 has one place for Linux, which is that of x86-64."""
    if platforms is None:
        own = (each for targets in TARGETS.values() for each in targets if each.is_host)
        return {each: command for each in own if (command := compiler(each)) is not None}
    commands: dict[Target, Sequence[str]] = {}
    for name in dict.fromkeys(platforms):
        targets = TARGETS[name][:1] if version == "2.0" and name == "linux" else TARGETS[name]
        available = {each: command for each in targets if (command := compiler(each)) is not None}
        if not available:
            advice = f"pip install 'hysim[export]', or leave {name!r} out of the platforms"
            raise ImportError(f"a shared library for {name} needs a compiler: {advice}")
        commands |= available
    return commands


# ---------------------------------------------------------------------------------- variables and their units


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


def base_unit(unit: str) -> dict[str, str] | None:
    """Exponents of base units, and the factor to them, of a label such as ``um/V``; None where it is not understood.

    >>> base_unit("um/V")
    {'kg': '-1', 'm': '-1', 's': '3', 'A': '1', 'factor': '1e-06'}
    >>> base_unit("px") is None
    True
    """
    exponents, power = dict.fromkeys(BASE_UNITS, 0), 0
    for k, part in enumerate(unit.split("/")):
        if part == "1":
            continue
        try:
            prefix, base = prefixed(part)
        except ValueError:
            return None
        sign = -1 if k else 1
        power += sign * (prefix + _POWERS.get(base, 0))
        for name, exponent in zip(BASE_UNITS, _EXPONENTS[base], strict=False):
            exponents[name] += sign * exponent
    factor = {"factor": repr(10.0**power)} if power else {}
    return {name: str(exponent) for name, exponent in exponents.items() if exponent} | factor


_ATTRIBUTES = ("name", "valueReference", "causality", "variability", "initial", "description")


class Variable(NamedTuple):
    """A real variable: its name and value reference, its role in FMI, and its unit and start value."""

    name: str
    reference: int
    causality: str
    variability: str
    initial: str = ""
    unit: str = ""
    start: float | None = None
    description: str = ""

    def attributes(self) -> dict[str, str]:
        """Attributes that the XML of both versions contains."""
        values = {**self._asdict(), "valueReference": str(self.reference)}
        return {name: values[name] for name in _ATTRIBUTES if values[name]}

    def numbers(self) -> dict[str, str]:
        start = {} if self.start is None else {"start": repr(self.start)}
        return ({"unit": self.unit} if self.unit else {}) | start


def variables_of(program: Program, units: Mapping[str, str], u0: float) -> list[Variable]:
    """Variables in the order of their value references; ValueError if two have one name."""
    first, output = program.inputs[0], 1 + len(program.inputs)
    variables = [
        Variable(name, k, "input", "continuous", unit=label(name, units), start=u0 if k == 1 else 0.0)
        for k, name in enumerate(program.inputs, 1)
    ]
    unit = label(program.output, units)
    variables.append(Variable(program.output, output, "output", "continuous", "calculated", unit))
    if program.start:
        text, role = "Input at which the model rests before the simulation.", ("parameter", "fixed", "exact")
        variables.append(Variable(f"{first}0", output + 1, *role, label(first, units), u0, description=text))
    if math.isfinite(program.sample_time):
        time, text = program.sample_time, "Time between two samples of the model."
        variables.append(Variable("sample_time", output + 2, "local", "constant", "exact", "s", time, description=text))
    kind, text = ("tunable", _TUNED) if program.memory else ("fixed", "")
    for k, each in enumerate(program.fields, output + 3):
        variables.append(Variable(each.name, k, "parameter", kind, "exact", label(each.unit, units), each.value, text))
    names = [*(each.name for each in variables), "time"]
    if double := next((name for name in names if names.count(name) > 1), None):
        raise ValueError(f"two variables of the unit would be called {double!r}: rename the parameter of the law")
    return variables


def _description(program: Program, variables: Sequence[Variable], name: str, version: str, token: str) -> str:
    step, experiment, words = "", "", _DELAY
    if math.isfinite(program.sample_time):
        step = f' fixedInternalStepSize="{program.sample_time!r}"'
        experiment = f'  <DefaultExperiment startTime="0.0" stepSize="{program.sample_time!r}" />\n'
        ahead = f" The reference is that of {program.ahead} samples later." if program.ahead else ""
        words = _SAMPLED + ahead
    in_2, in_3 = "    <ScalarVariable{}>\n      <Real{} />\n    </ScalarVariable>\n", "    <Float64{}{} />\n"
    form = in_2 if version == "2.0" else in_3
    elements = "".join(form.format(_written(each.attributes()), _written(each.numbers())) for each in variables)
    texts = {"name": name, "token": token, "description": words, "hysim": __version__, "step": step}
    texts |= {"units": _units(variables), "experiment": experiment, "variables": elements}
    return _template(f"fmi{version[0]}.xml").substitute(texts, output=1 + len(program.inputs))


def _units(variables: Iterable[Variable]) -> str:
    text = ""
    for each in dict.fromkeys(variable.unit for variable in variables if variable.unit):
        if (base := base_unit(each)) is None:
            text += f"    <Unit name={quoteattr(each)} />\n"
            continue
        text += f"    <Unit name={quoteattr(each)}>\n      <BaseUnit{_written(base)} />\n    </Unit>\n"
    return f"  <UnitDefinitions>\n{text}  </UnitDefinitions>\n" if text else ""


def _written(attributes: Mapping[str, str]) -> str:
    return "".join(f" {name}={quoteattr(value)}" for name, value in attributes.items())
