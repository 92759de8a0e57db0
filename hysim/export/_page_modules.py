"""Steps as WebAssembly modules for pages in the browser.

A module holds one step, for parameters and states of any size; it imports nothing and exports

    memory, __heap_base                                                               room begins behind the base
    begin(parameters, n_parameters, state, n_state, u0)                               completes a state
    run(parameters, n_parameters, state, n_state, u, y, n)                            n outputs, the state moves along

where all but the sizes and `u0` are addresses of doubles. The modules of hysim's own laws are files of the package,
compressed, and each says of which C text it was made; ``python -m hysim.export.build_pages`` writes them anew. A step
of the user is compiled when a page is written, which needs the extra `export`.
"""

import gzip
import hashlib
from collections.abc import Callable
from functools import lru_cache
from importlib.resources import files
from typing import NamedTuple

from hysim.export._compilers import web_module
from hysim.export._program import entries
from hysim.export._scope import plain
from hysim.models.law import Law

FOLDER = "page/wasm"
_WRAPPER = """
__attribute__((export_name("begin")))
void begin(const double *parameters, int n_parameters, double *state, int n_state, double u0) {
    start(parameters, n_parameters, state, n_state, u0);
}

__attribute__((export_name("run")))
void run(const double *parameters, int n_parameters, double *state, int n_state, const double *u, double *y, int n) {
    for (int k = 0; k < n; k++) y[k] = step(parameters, n_parameters, state, n_state, u[k]);
}
"""
_NO_START = """
static void start(const double *parameters, int n_parameters, double *state, int n_state, double u0) {
    (void)parameters, (void)n_parameters, (void)state, (void)n_state, (void)u0;
}
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
    text, has_start = entries(kernels.step, kernels.start)
    return f"#include <math.h>\n{text}{'' if has_start else _NO_START}{_WRAPPER}"


@lru_cache(maxsize=32)
def compiled(source: str) -> bytes:
    """The module of a C99 text, which ends with its `mark`; errors as of `hysim.export._compilers.web_module`."""
    return web_module(source) + mark(source)


def mark(source: str) -> bytes:
    """Section of a module that tells of which text it was made: a custom one, that a browser passes over."""
    content = b"\x06source" + hashlib.sha256(source.encode()).digest()
    return bytes([0, len(content)]) + content
