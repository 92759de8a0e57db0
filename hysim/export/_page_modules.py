"""Steps as WebAssembly modules for pages in the browser.

A module holds one step, for parameters and states of any size; it imports nothing and exports

    memory, __heap_base                                                               room begins behind the base
    begin(parameters, n_parameters, state, n_state, u0)                               completes a state
    run(parameters, n_parameters, state, n_state, u, y, n)                            n outputs, the state moves along

where all but the sizes and `u0` are addresses of doubles. The modules of hysim's own laws are files of the package,
compressed; ``python -m hysim.export.build_pages`` writes them anew. A step of the user is compiled when a page is
written, which needs the extra `export`.
"""

import gzip
import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from hysim.export._routine import plain
from hysim.export._translate import Function, Translation
from hysim.export._types import Known, Scalar, Vector
from hysim.models.law import Law

FOLDER = "page/wasm"
_TARGET = "wasm32-wasi"
_FLAGS = ("-mexec-model=reactor", "-Os", "-std=c99", "-ffp-contract=off", "-Wl,--strip-all", "-Wl,--export=__heap_base")
_WRAPPER = """
__attribute__((export_name("begin")))
void begin(const double *parameters, int n_parameters, double *state, int n_state, double u0) {{
    (void)parameters; (void)n_parameters; (void)state; (void)n_state; (void)u0;
    {begin};
}}

__attribute__((export_name("run")))
void run(const double *parameters, int n_parameters, double *state, int n_state, const double *u, double *y, int n) {{
    (void)parameters; (void)n_parameters; (void)state; (void)n_state;
    for (int k = 0; k < n; k++) y[k] = {step};
}}
"""


class Kernels(NamedTuple):
    """A step, and the start that completes its state for the first sample."""

    step: Callable[..., float]
    start: Callable[..., None]

    @property
    def name(self) -> str:
        """Name of the module: ``clamps_step`` for the function `step` of `hysim.kernels.clamps`."""
        function = self.step
        return f"{function.__module__.rpartition('.')[2]}_{function.__name__}".replace("__", "_").strip("_")


def kernels_of(law: Law) -> Kernels:
    """The step of a law, and how it starts."""
    return Kernels(plain(law.step), plain(law.start))


def module_of(kernels: Kernels) -> bytes:
    """The module of a step, compressed: from the package, or for another step than hysim's compiled now.

    Parameters
    ----------
    kernels : Kernels
        The step.

    Returns
    -------
    bytes
        In the format of gzip.

    Raises
    ------
    ImportError
        If the module must be compiled and the extra `export` is missing.
    UntranslatableError
        If the step is not in the portable subset of Python.
    """
    own = files("hysim.export").joinpath(f"{FOLDER}/{kernels.name}.wasm.gz")
    if kernels.step.__module__.startswith("hysim.") and own.is_file():
        return own.read_bytes()
    return compressed(compiled(c_source(kernels)))


def compressed(module: bytes) -> bytes:
    """Bytes in the format of gzip, without a date."""
    return gzip.compress(module, compresslevel=9, mtime=0)


def c_source(kernels: Kernels) -> str:
    """C99 text of a module."""
    translation = Translation()
    types = Vector(), Vector(), Scalar.DOUBLE
    step, begin = (translation.function(kernel, types) for kernel in kernels)
    wrapper = _WRAPPER.format(step=_call(step, "u[k]"), begin=_call(begin, "u0"))
    return f"#include <math.h>\n{translation.text()}{wrapper}"


@lru_cache(maxsize=32)
def compiled(source: str) -> bytes:
    """A WebAssembly module of C99 text.

    Raises
    ------
    ImportError
        If ziglang is not installed.
    RuntimeError
        If the compiler refuses the text.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise ImportError(
            "a page for a step that is not hysim's own needs a compiler: pip install 'hysim[export]' (ziglang)"
        )
    with tempfile.TemporaryDirectory() as folder:
        text, module = Path(folder, "step.c"), Path(folder, "step.wasm")
        text.write_text(source, encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "ziglang",
            "cc",
            "-target",
            _TARGET,
            *_FLAGS,
            "-o",
            module.name,
            text.name,
            "-lm",
        ]
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
        if done.returncode:
            raise RuntimeError(f"ziglang could not compile the step: {done.stderr.strip()}")
        return module.read_bytes()


def _call(function: Function, u: str) -> str:
    """A call of a translated function with the arguments of the wrapper."""
    values = dict(zip((each.name for each in function.parameters), ("parameters", "state", u), strict=True))
    arguments: list[str] = []
    for each in function.parameters:
        if isinstance(each.type, Known):
            continue
        arguments += [values[each.name]] * each.is_used
        arguments += [f"n_{values[each.name]}" for _ in each.axes]
    return f"{function.name}({', '.join(arguments)})"
