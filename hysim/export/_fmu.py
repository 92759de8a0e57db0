"""The verb `to_fmu`: a model as a functional mock-up unit, whose bytes depend on the arguments alone."""

import hashlib
import io
import math
import re
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

from hysim._basics.atomic import write_all
from hysim._basics.frozen import check_choice
from hysim._basics.results import model_of
from hysim._release import __version__
from hysim.errors import warn_unsafe
from hysim.export._c import number, table
from hysim.export._compilers import TARGETS, Target, compiler, host, shared_library, universal
from hysim.export._fmu_variables import Variable, build_description, description, is_tunable, variables_of
from hysim.export._packing import packing
from hysim.export._program import Program, program_of
from hysim.models.law import Law
from hysim.models.protocols import standing

_FOLDER = Path(__file__).with_name("fmu")
_HEADERS = ("math.h", "stdbool.h", "stddef.h", "stdint.h", "stdlib.h", "string.h")
Version = Literal["2.0", "3.0"]
Platform = Literal["linux", "windows", "mac"]

VERSIONS = ("2.0", "3.0")
_FOLDERS_2 = {"linux": "linux64", "windows": "win64", "darwin": "darwin64"}
_WRITTEN = (1980, 1, 1, 0, 0, 0)  # the first time that a zip file knows
_MODE = 0o100644 << 16


def token_of(*contents: str) -> str:
    """A GUID that depends on the contents alone."""
    return f"{{{uuid.uuid5(uuid.NAMESPACE_URL, chr(0).join(contents))}}}"


def source_of(program: Program, variables: Sequence[Variable], version: str, token: str) -> str:
    parts = [
        f"/* {', '.join(program.inputs)} to {program.output}; written by hysim {__version__}. */",
        "\n".join(f"#include <{header}>" for header in _HEADERS),
        program.source.strip(),
        _numbers(program, variables, token),
        (_FOLDER / "model.c").read_text(encoding="utf-8").strip(),
        (_FOLDER / f"fmi{version[0]}.c").read_text(encoding="utf-8").strip(),
    ]
    return "\n\n".join(parts) + "\n"


def _numbers(program: Program, variables: Sequence[Variable], token: str) -> str:
    inputs = [each for each in variables if each.causality == "input"]
    fields = list(variables[len(variables) - len(program.fields) :]) if program.fields else []
    sizes = {
        "INPUTS": len(inputs),
        "FIELDS": len(fields),
        "PARAMETERS": program.parameters.size,
        "STATE": program.state.size,
        "MEMORY": program.memory,
        "IS_TUNABLE": int(is_tunable(program)),
    }
    values = ", ".join(f"(x)[{k}]" for k in range(len(inputs)))
    calls = {
        "STEP(p, s, x)": f"{program.step}((p), (s), {values})",
        "PACK(f, p, s)": f"{program.pack}((f), (p), (s))" if program.pack else "((void)0)",
        "BEGIN(p, s, u0)": f"{program.start}((p), (s), (u0))" if program.start else "((void)0)",
        "AT_LEAST_1(n)": "((n) > 0 ? (n) : 1)",
    }
    digest = hashlib.sha256(token.encode()).digest()
    halves = ", ".join(number(float(int.from_bytes(digest[k : k + 6], "big"))) for k in (0, 6))
    others = {"TOKEN": f'"{token}"', "TOKEN_NUMBERS": f"{{{halves}}}", "START_VALUE": number(inputs[0].start or 0.0)}
    if program.start:
        others["HAS_START"] = "1"
    if math.isfinite(program.sample_time):
        others["SAMPLE_TIME"] = number(program.sample_time)
    tables = {
        "INPUT_VALUES": [each.start or 0.0 for each in inputs],
        "PARAMETER_VALUES": program.parameters.tolist(),
        "STATE_VALUES": program.state.tolist(),
        "FIELD_VALUES": [each.start or 0.0 for each in fields],
    }
    if fields:
        tables |= {"FIELD_MINIMA": [each.lower for each in fields], "FIELD_MAXIMA": [each.upper for each in fields]}
    defined = [f"#define FMU_{name} {value}" for name, value in (sizes | calls | others).items()]
    return "\n".join([*defined, "", *(table(f"FMU_{name}", numbers) for name, numbers in tables.items())])


class Options(NamedTuple):
    name: str
    version: str
    platforms: tuple[str, ...] | None
    units: Mapping[str, str]
    u0: float


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
    TypeError
        If the thing is no model that can be exported.
    ValueError
        If the version, the name, a platform or the ending of the file is unknown, or the sample time is missing.
    ImportError
        If a shared library is asked for and no compiler can make it.
    OSError
        If the file cannot be written, or the compiler fails.

    Notes
    -----
    A unit has an input, an output, the numbers of a law as tunable parameters, and where the model remembers its input
    a fixed parameter ``u0``, the input at which it rests before the simulation. Its state can be saved, restored and
    turned into bytes.

    The master sets the input at a communication point and reads the output at the next one: the output is one
    communication step late. At the start it is the output for the input at the start. A sampled model is computed at
    multiples of its sample time, whatever the communication step.

    Equal arguments give equal bytes. Standard: https://fmi-standard.org, versions 2.0.5 and 3.0.2.

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
    thing = model_of(thing)
    target = _checked(Path(path), version, platforms)
    labels = dict(units or {})
    if not all(isinstance(text, str) for pair in labels.items() for text in pair):
        raise TypeError(f"units must be labels by the names u, y and t, got {units!r}")
    chosen = _checked_name(type(thing).__name__ if name is None else name)
    program = program_of(thing, sample_time, u0=u0, y0=y0, tunable=_is_tunable(thing))
    u0 = standing(thing, u0)
    program = _with_units(program, thing)
    systems = None if platforms is None else tuple(platforms)
    write_all({target: archive(program, Options(chosen, version, systems, labels, u0))})
    return target


def _is_tunable(thing: Any) -> bool:
    """Whether the parameters of the step follow from a law's numbers by arithmetic; else the numbers are constants."""
    if not isinstance(thing, Law):
        return False
    try:
        packing(thing)
    except ValueError:
        return False
    return True


def _with_units(program: Program, thing: Any) -> Program:
    if not isinstance(thing, Law):
        return program
    return replace(program, fields=tuple(each._replace(unit=field_unit(thing, each.name)) for each in program.fields))


def field_unit(law: Law, name: str) -> str:
    """Unit of one number of a law, as in ``"y/u"``; empty where it is not known."""
    searched = {each.name: each.unit for each in law.searched if each.unit != "1"}
    return {**searched, **law.units}.get(name.partition("[")[0], "")


def _checked(path: Path, version: str, platforms: Sequence[str] | None) -> Path:
    check_choice("version", version, VERSIONS)
    if path.suffix.lower() != ".fmu":
        raise ValueError(f"a functional mock-up unit is a file .fmu, got {str(path)!r}")
    if isinstance(platforms, str):
        raise TypeError(f"platforms must be a sequence such as ({platforms!r},), got {platforms!r}")
    for each in platforms or ():
        check_choice("platforms", each, TARGETS)
    return path


def _checked_name(name: str) -> str:
    if not re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", name):
        raise ValueError(f"name must be letters, digits and underscores after a letter, got {name!r}")
    return name


def archive(program: Program, options: Options) -> bytes:
    version, name = options.version, options.name
    variables = variables_of(program, options.units, options.u0)
    blank = description(program, variables, name, version, ""), source_of(program, variables, version, "")
    token = token_of(*blank)
    source = source_of(program, variables, version, token)
    files: dict[str, bytes] = {
        "modelDescription.xml": description(program, variables, name, version, token).encode(),
        f"sources/{name}.c": source.encode(),
    }
    if version == "3.0":
        files["sources/buildDescription.xml"] = build_description(name).encode()
    return _zipped(files | libraries(source, options))


def libraries(source: str, options: Options) -> dict[str, bytes]:
    """Shared libraries by their places in the unit; ImportError if no compiler serves a platform asked for by name."""
    compiled = {
        target: shared_library(source, options.name, target, command)
        for target, command in _commands(options.platforms, options.version).items()
    }
    if options.version == "3.0":
        return {f"binaries/{each.name}/{options.name}{each.ending}": data for each, data in compiled.items()}
    places: dict[str, list[bytes]] = {}
    for each, data in compiled.items():
        folder = _FOLDERS_2[each.name.partition("-")[2]]
        places.setdefault(f"binaries/{folder}/{options.name}{each.ending}", []).append(data)
    return {place: data[0] if len(data) == 1 else universal(data) for place, data in places.items()}


def _commands(platforms: tuple[str, ...] | None, version: str) -> dict[Target, Sequence[str]]:
    """Targets, each with its compiler; FMI 2.0 has one place for Linux, which is that of x86-64."""
    if platforms is None:
        own = [(each, compiler(each)) for targets in TARGETS.values() for each in targets if each.name == host()]
        return {each: command for each, command in own if command is not None}
    commands: dict[Target, Sequence[str]] = {}
    for name in dict.fromkeys(platforms):
        targets = TARGETS[name][:1] if version == "2.0" and name == "linux" else TARGETS[name]
        found = {each: command for each in targets if (command := compiler(each)) is not None}
        if not found:
            raise ImportError(
                f"a shared library for {name} needs a compiler: pip install 'hysim[export]', or leave {name!r} out of "
                "the platforms"
            )
        commands |= found
    return commands


def _zipped(files: Mapping[str, bytes]) -> bytes:
    """A zip file whose bytes depend on its contents alone."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as unit:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, _WRITTEN)
            entry.create_system, entry.external_attr, entry.compress_type = 3, _MODE, zipfile.ZIP_DEFLATED
            unit.writestr(entry, content)
    return stream.getvalue()
