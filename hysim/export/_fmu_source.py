"""The C source of a functional mock-up unit: a program, its numbers, and the functions of FMI around it."""

import hashlib
import math
import uuid
from collections.abc import Sequence
from pathlib import Path

from hysim._release import __version__
from hysim.export._c import number, table
from hysim.export._fmu_variables import Variable, is_tunable
from hysim.export._program import Program

_FOLDER = Path(__file__).with_name("fmu")
_HEADERS = ("math.h", "stdbool.h", "stddef.h", "stdint.h", "stdlib.h", "string.h")


def token_of(*contents: str) -> str:
    """A GUID that depends on the contents alone."""
    return f"{{{uuid.uuid5(uuid.NAMESPACE_URL, chr(0).join(contents))}}}"


def source_of(program: Program, variables: Sequence[Variable], version: str, token: str) -> str:
    """The text of the one C file of a unit."""
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
    """Sizes, tables, and the calls of the program's functions."""
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
