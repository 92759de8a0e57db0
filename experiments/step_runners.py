"""Steps in C outside Python: in a shared library, under sanitizers, in WebAssembly, and in functional mock-up units.

Each runner is a function that takes the cases of one program and returns their outputs, or None where what it needs is
not installed. Compilers are those of the machine and, for WebAssembly, zig's.
"""

import ctypes
import importlib.util
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from exported_steps import SAMPLE_TIME, Array, Case

import hysim as hs
from hysim.export._packing import packing

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off", "-O2")
CHECKED = ("-std=c99", "-ffp-contract=off", "-O1", "-g", "-fsanitize=address,undefined,float-cast-overflow",
           "-fno-sanitize-recover=all")  # fmt: skip
WASM = ("-target", "wasm32-wasi", "-mexec-model=reactor", "-std=c99", "-ffp-contract=off", "-O2", "-Wl,--strip-all",
        "-Wl,--export=__heap_base")  # fmt: skip
REPEATS = 5  # of a timing, of which the least is kept
_PROGBITS, _WRITE, _ALLOC = 1, 1, 2  # of a section of an ELF file

_ARGUMENTS = "const double *parameters, int n_parameters, double *state, int n_state"
_LOOP = """
{exported[begin]}void begin({arguments}, double u0);
{exported[run]}void run({arguments}, const double *u, const double *m, double *y, int n);

void begin({arguments}, double u0) {{
    (void)parameters; (void)n_parameters; (void)state; (void)n_state; (void)u0;
    {start};
}}

void run({arguments}, const double *u, const double *m, double *y, int n) {{
    (void)n_parameters; (void)n_state; (void)m;
    for (int k = 0; k < n; k++) y[k] = step({call});
}}
"""
_MAIN = """
#include <stdio.h>
#include <stdlib.h>

static double *numbers(int n) {
    double *x = malloc(n * sizeof *x + !n);
    if (n && fread(x, sizeof *x, n, stdin) != (size_t)n) exit(3);
    return x;
}

int main(void) {
    int sizes[3];
    while (fread(sizes, sizeof sizes, 1, stdin) == 1) {
        double *parameters = numbers(sizes[0]), *state = numbers(sizes[1]), *u = numbers(sizes[2]);
        double *m = numbers(sizes[2]), *y = malloc(sizes[2] * sizeof *y);
        begin(parameters, sizes[0], state, sizes[1], u[0]);
        run(parameters, sizes[0], state, sizes[1], u, m, y, sizes[2]);
        fwrite(y, sizeof *y, sizes[2], stdout);
        free(parameters); free(state); free(u); free(m); free(y);
    }
    return 0;
}
"""


def text(case: Case, export: bool = False) -> str:
    """The C source of a case, with a loop over samples."""
    sizes = ("parameters", "n_parameters", "state", "n_state") if case.has_sizes else ("parameters", "state")
    inputs = ("u[k]", "m[k]")[: len(inputs_of(case))]
    places = {
        "exported": {name: f'__attribute__((export_name("{name}")))\n' if export else "" for name in ("begin", "run")},
        "arguments": _ARGUMENTS,
        "start": f"start({', '.join([*sizes, 'u0'])})" if case.has_start else "(void)0",
        "call": ", ".join([*sizes, *inputs]),
    }
    return f"#include <math.h>\n\n{case.source}{_LOOP.format(**places)}"


def compiled(command: Sequence[str], source: str, target: Path, *options: str) -> Path:
    """The file that a compiler makes of a source; RuntimeError with all it says if it says anything."""
    file = target.with_suffix(".c")
    file.write_text(source, encoding="utf-8")
    arguments = [*command, *options, file.name, "-o", target.name]
    done = subprocess.run(arguments, cwd=target.parent, capture_output=True, text=True, check=False)
    if done.returncode or done.stderr.strip():
        raise RuntimeError(f"{' '.join(arguments)}: {done.stderr}")
    return target


# ---------------------------------------------------------------------------------- a shared library


class Library:
    """A program as a shared library."""

    def __init__(self, compiler: str, case: Case, target: Path) -> None:
        own = compiled([compiler], text(case), target.with_suffix(".so"), *STRICT, "-fPIC", "-shared", "-lm")
        library = vars(ctypes)["CDLL"](str(own))
        self.begin, self.run = library.begin, library.run
        vector, size = ctypes.c_void_p, ctypes.c_int
        self.begin.argtypes = [vector, size, vector, size, ctypes.c_double]
        self.run.argtypes = [vector, size, vector, size, vector, vector, vector, size]
        self.begin.restype = self.run.restype = None

    def outputs(self, case: Case) -> tuple[Array, float]:
        """The outputs, and the seconds that they take."""
        u, m = np.ascontiguousarray(case.inputs[0]), np.ascontiguousarray(case.inputs[-1])
        parameters, y = np.ascontiguousarray(case.parameters), np.empty(u.size)
        least = np.inf
        for _ in range(REPEATS if case.kind == "random" else 1):
            state = np.array(case.state)
            vectors = parameters.ctypes.data, parameters.size, state.ctypes.data, state.size
            self.begin(*vectors, u[0])
            began = time.perf_counter()
            self.run(*vectors, u.ctypes.data, m.ctypes.data, y.ctypes.data, u.size)
            least = min(least, time.perf_counter() - began)
        return y, least


def least_seconds(call: Callable[[], Any]) -> float:
    """The least of some times of a call."""
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


def inputs_of(case: Case) -> Array:
    """What the step reads, (n_inputs, n_samples): an inverse has no measurement."""
    return case.inputs[:1] if isinstance(case.thing, hs.InverseFeedforward) else case.inputs


def program_output(compiler: str, source: hs.CSource, inputs: Array, folder: Path) -> Array:
    """Outputs of the program that `hysim.to_c` makes, which reads `inputs` (n_inputs, n_samples) and prints text."""
    source.write(folder)
    files = [f"{source.name}.c", f"{source.name}_main.c"]
    command = [compiler, *STRICT, *files, "-o", f"{source.name}_main", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode or done.stderr:
        raise RuntimeError(f"{source.name}: {done.stderr}")
    lines = "\n".join(" ".join(map(repr, values)) for values in inputs.T.tolist())
    main = folder / f"{source.name}_main"
    printed = subprocess.run([main], input=lines, capture_output=True, text=True, check=True).stdout
    return np.array([float(word) for word in printed.split()])


# ---------------------------------------------------------------------------------- under sanitizers


def checked(compiler: str, cases: Sequence[Case], target: Path) -> list[Array]:
    """Outputs of a program that stops at the first report of a sanitizer; RuntimeError with the report."""
    program = compiled([compiler], text(cases[0]) + _MAIN, target, *CHECKED, "-lm")
    parts = []
    for case in cases:
        u, m = case.inputs[0], case.inputs[-1]
        sizes = np.array([case.parameters.size, case.state.size, u.size], dtype=np.int32)
        parts += [
            sizes.tobytes(),
            *(np.ascontiguousarray(each).tobytes() for each in (case.parameters, case.state, u, m)),
        ]
    done = subprocess.run([program], input=b"".join(parts), capture_output=True, check=False)
    if done.returncode or done.stderr:
        raise RuntimeError(f"{cases[0].family}: {done.stderr.decode(errors='replace')[:2000]}")
    y = np.frombuffer(done.stdout)
    ends = np.cumsum([case.y.size for case in cases])
    return np.split(y, ends[:-1])


# ---------------------------------------------------------------------------------- WebAssembly


def has_wasm() -> bool:
    """Whether WebAssembly can be compiled and run."""
    return all(importlib.util.find_spec(name) is not None for name in ("ziglang", "wasmtime"))


class Module:
    """A program as a WebAssembly module in wasmtime."""

    def __init__(self, case: Case, target: Path) -> None:
        import wasmtime

        zig = [sys.executable, "-m", "ziglang", "cc"]
        path = compiled(zig, text(case, export=True), target.with_suffix(".wasm"), *WASM, "-lm")
        self.size = path.stat().st_size
        self.store = wasmtime.Store()
        module = wasmtime.Module.from_file(self.store.engine, str(path))
        if module.imports:
            raise RuntimeError(f"the module of a {case.family} imports {[each.name for each in module.imports]}")
        exports: Any = wasmtime.Instance(self.store, module, []).exports(self.store)
        self.memory, self.begin, self.run = exports["memory"], exports["begin"], exports["run"]
        self.base = (exports["__heap_base"].value(self.store) + 7) // 8 * 8

    def outputs(self, case: Case) -> Array:
        """The outputs."""
        n, vectors = case.inputs.shape[1], [case.parameters, case.state, case.inputs[0], case.inputs[-1], case.y]
        ends = self.base + 8 * np.cumsum([0, *(each.size for each in vectors)])
        missing = int(ends[-1]) - self.memory.data_len(self.store)
        if missing > 0:
            self.memory.grow(self.store, missing // 65536 + 1)
        places = [int(each) for each in ends]
        for place, each in zip(places, vectors[:-1], strict=False):
            self.memory.write(self.store, np.ascontiguousarray(each).tobytes(), place)
        front = places[0], case.parameters.size, places[1], case.state.size
        self.begin(self.store, *front, float(case.inputs[0, 0]))
        self.run(self.store, *front, places[2], places[3], places[4], n)
        return np.frombuffer(bytes(self.memory.read(self.store, places[4], places[5])))


# ---------------------------------------------------------------------------------- functional mock-up units


def has_fmpy() -> bool:
    """Whether a functional mock-up unit can be run."""
    return importlib.util.find_spec("fmpy") is not None


class Unit:
    """A program as a functional mock-up unit in FMPy, validated; laws of one shape are set by its parameters."""

    def __init__(self, case: Case, version: Literal["2.0", "3.0"], target: Path) -> None:
        import fmpy
        from fmpy.validation import validate_fmu

        path = target.with_suffix(".fmu")
        hs.to_fmu(case.thing, path, version, SAMPLE_TIME)
        problems = validate_fmu(str(path))
        if problems:
            raise RuntimeError(f"{case.family}, FMI {version}: {problems}")
        self.description = fmpy.read_model_description(str(path))
        variables = self.description.modelVariables
        self.version = version
        self.inputs = [each.name for each in variables if each.causality == "input"]
        (self.output,) = (each.name for each in variables if each.causality == "output")
        self.folder = fmpy.extract(str(path), str(target))
        self.references = {each.name: each.valueReference for each in variables}

    def outputs(self, case: Case) -> Array:
        """The outputs up to the first one at which the unit reports an error; nan behind it."""
        from fmpy.fmi1 import FMICallException
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        is_2, y = self.version == "2.0", np.full(case.y.size, np.nan)
        unit: Any = (FMU2Slave if is_2 else FMU3Slave)(
            guid=self.description.guid, unzipDirectory=self.folder, instanceName="x",
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )  # fmt: skip
        set_, get = (unit.setReal, unit.getReal) if is_2 else (unit.setFloat64, unit.getFloat64)
        inputs, output = [self.references[name] for name in self.inputs], [self.references[self.output]]
        unit.instantiate()
        try:
            fields = fields_of(case)
            u0 = {"u0": float(case.inputs[0, 0])} if "u0" in self.references else {}
            values = {**fields, **u0}
            set_([self.references[name] for name in values], [float(each) for each in values.values()])
            set_(inputs, case.inputs[: len(inputs), 0].tolist())
            if is_2:
                unit.setupExperiment(startTime=0.0)
            unit.enterInitializationMode()
            unit.exitInitializationMode()
            for k, row in enumerate(case.inputs[: len(inputs)].T.tolist()):
                set_(inputs, row)
                unit.doStep(currentCommunicationPoint=k * SAMPLE_TIME, communicationStepSize=SAMPLE_TIME)
                y[k] = get(output)[0]
        except FMICallException:
            return y
        finally:
            unit.freeInstance()
        return y


def fields_of(case: Case) -> dict[str, float]:
    """Tunable parameters of a law; a sum, an inverse or a plant has none, nor have relays with a past."""
    law = case.thing
    try:
        return {name: law.scalars[name] for name in packing(law).fields} if isinstance(law, hs.Law) else {}
    except ValueError:
        return {}


def fixed_of(case: Case) -> tuple[float, ...]:
    """Parameters of a law that cannot be set in a unit."""
    law, fields = case.thing, fields_of(case)
    return tuple(v for k, v in law.scalars.items() if k not in fields) if isinstance(law, hs.Law) else ()


# ---------------------------------------------------------------------------------- sizes


def code_bytes(command: Sequence[str], source: hs.CSource, target: Path, *options: str) -> int:
    """Bytes of code and constants of a source that `hysim.to_c` made, without those of the C library."""
    (target.parent / f"{source.name}.h").write_text(source.header, encoding="utf-8")
    data = compiled(command, source.source, target.with_suffix(".o"), *options, "-c").read_bytes()
    wide = data[4] == 2  # ELF of 64 bits
    table, count = _at("<Q", data, 0x28) if wide else _at("<I", data, 0x20), _at("<H", data, 0x3C if wide else 0x30)
    total = 0
    for k in range(count):
        place = table + (64 if wide else 40) * k
        kind, flags = _at("<I", data, place + 4), _at("<Q" if wide else "<I", data, place + 8)
        if kind == _PROGBITS and flags & (_WRITE | _ALLOC) == _ALLOC:
            total += _at("<Q", data, place + 32) if wide else _at("<I", data, place + 20)
    return total


def _at(kind: str, data: bytes, place: int) -> int:
    return int(struct.unpack_from(kind, data, place)[0])
