"""Shared libraries and WebAssembly from C: the compiler of this machine, or zig's, which compiles for all.

A WebAssembly module for pages holds one step, for parameters and states of any size; it imports nothing and exports

    memory, __heap_base                                                               room begins behind the base
    begin(parameters, n_parameters, state, n_state, u0)                               completes a state
    run(parameters, n_parameters, state, n_state, u, y, n)                            n outputs, the state moves along

where all but the sizes and `u0` are addresses of doubles. The modules of hysim's own laws are files of the package,
compressed, and each says of which C text it was made; ``python .ci/build_pages.py`` writes them anew. A step
of the user is compiled when a page is written, which needs the extra `export`.
"""

import gzip
import hashlib
import platform
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import lru_cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from hysim._basics.libraries import optional
from hysim.export._c import plain
from hysim.export._program import entries
from hysim.models.law import Law

OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-fPIC", "-shared", "-s", "-Werror=implicit")
_WEB = "wasm32-wasi"
_WEB_OPTIONS = (
    *("-mexec-model=reactor", "-Os", "-std=c99", "-ffp-contract=off", "-Werror=implicit"),
    *("-Wl,--strip-all", "-Wl,--export=__heap_base"),
)
_PROCESSORS = MappingProxyType({"amd64": "x86_64", "arm64": "aarch64"})
_FAT_MAGIC, _FAT_ALIGNMENT = 0xCAFEBABE, 14  # of a Mach-O file for several processors, 2^14 bytes
FOLDER = "page/wasm"


class Target(NamedTuple):
    """A system and a processor: its name in FMI 3.0, zig's name for it, and the ending of its shared libraries."""

    name: str
    zig: str
    ending: str

    @property
    def is_host(self) -> bool:
        return self.name == host()


TARGETS = MappingProxyType(
    {
        "linux": (
            Target("x86_64-linux", "x86_64-linux-gnu.2.17", ".so"),
            Target("aarch64-linux", "aarch64-linux-gnu.2.17", ".so"),
        ),
        "windows": (Target("x86_64-windows", "x86_64-windows-gnu", ".dll"),),
        "mac": (Target("x86_64-darwin", "x86_64-macos", ".dylib"), Target("aarch64-darwin", "aarch64-macos", ".dylib")),
    }
)
"""Targets of each platform."""


def host() -> str:
    """The name of this machine in FMI 3.0, such as ``x86_64-linux``."""
    machine = platform.machine().lower()
    return f"{_PROCESSORS.get(machine, machine)}-{platform.system().lower()}"


def compiler(target: Target) -> tuple[str, ...] | None:
    """Beginning of a command that compiles for a target, by this machine's own compiler first; None without one."""
    own = shutil.which("gcc") or shutil.which("clang") if target.is_host else None
    if own is not None:
        return (own,)
    if find_spec("ziglang") is None:
        return None
    return sys.executable, "-m", "ziglang", "cc", "-target", target.zig


def shared_library(source: str, name: str, target: Target, command: Sequence[str]) -> bytes:
    """The shared library of a C source by a `compiler`; OSError with the compiler's first error."""
    libraries = () if target.name.endswith("windows") else ("-lm",)
    return _built(source, f"{name}{target.ending}", (*command, *OPTIONS), libraries, target.name)


def _built(source: str, result: str, command: Sequence[str], libraries: Sequence[str], target: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        name = f"{Path(result).stem}.c"
        Path(folder, name).write_text(source, encoding="utf-8")
        done = subprocess.run(
            [*command, name, "-o", result, *libraries], cwd=folder, capture_output=True, errors="replace", check=False
        )
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines() or [""]
            raise OSError(f"{' '.join(command[:4])} could not compile the source for {target}: {lines[0]}")
        return Path(folder, result).read_bytes()


def universal(libraries: Sequence[bytes]) -> bytes:
    """One Mach-O file for several processors, of 64-bit Mach-O files for one each."""
    step = 1 << _FAT_ALIGNMENT
    parts, places = b"", []
    for library in libraries:
        offset = step + len(parts)
        places.append((*struct.unpack("<II", library[4:12]), offset, len(library), _FAT_ALIGNMENT))
        parts += library + bytes(-len(library) % step)
    header = struct.pack(">II", _FAT_MAGIC, len(places)) + b"".join(struct.pack(">IIIII", *place) for place in places)
    return header.ljust(step, b"\0") + parts


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
    return Kernels(plain(law.step), plain(law.start))


def module_of(kernels: Kernels) -> bytes:
    """Compressed module of a step, from the package or compiled now; ImportError or UntranslatableError if it fails."""
    own = files("hysim.export").joinpath(f"{FOLDER}/{kernels.name}.wasm.gz")
    if kernels.step.__module__.startswith("hysim.") and own.is_file():
        return own.read_bytes()
    return compressed(compiled(c_source(kernels)))


def compressed(module: bytes) -> bytes:
    """Bytes in the format of gzip, without a date."""
    return gzip.compress(module, compresslevel=9, mtime=0)


def c_source(kernels: Kernels) -> str:
    text, has_start = entries(kernels.step, kernels.start)
    folder = files("hysim.export").joinpath("page")
    no_start, wrapper = (folder.joinpath(name).read_text(encoding="utf-8") for name in ("no_start.c", "module.c"))
    return f"#include <math.h>\n{text}{'' if has_start else no_start}\n{wrapper}"


@lru_cache(maxsize=32)
def compiled(source: str) -> bytes:
    """The module of a C99 text, which ends with its `mark`.

    Raises ImportError without ziglang, OSError with the compiler's first error.
    """
    optional("ziglang", "a page for a step that is not hysim's own", "export")
    command = (sys.executable, "-m", "ziglang", "cc", "-target", _WEB, *_WEB_OPTIONS)
    return _built(source, "step.wasm", command, ("-lm",), _WEB) + mark(source)


def mark(source: str) -> bytes:
    """Custom section of a module with a mark of the text that it was made from; a browser ignores it."""
    content = b"\x06source" + hashlib.sha256(source.encode()).digest()
    return bytes([0, len(content)]) + content
