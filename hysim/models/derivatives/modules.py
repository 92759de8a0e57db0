"""Modules of translated steps: run as they are, or compiled and kept where numba finds them again."""

import hashlib
import importlib.util
import os
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np

from hysim._atomic import write_text
from hysim.models.derivatives.forward import Program, module_text

_HEAD = '"""Steps in forward mode; hysim writes this file and reads it again."""\n\nimport math\n\nimport numpy as np\n'
_COMPILED = "\nfrom hysim.kernels.tangents.compiling import inner, kernel\n"

Along = Callable[..., int]


@lru_cache(maxsize=256)
def interpreted(step: Any, start: Any) -> Along:
    """``along`` of a step and its start, run by Python: for few samples, since nothing is compiled."""
    text, program = module_text(step, start)
    names: dict[str, Any] = {**program.constants, "inner": _unchanged, "kernel": _unchanged}
    exec(compile(f"{_HEAD}\n\n{text}", "<derivative>", "exec"), names)  # text of our own translation
    along: Along = names["along"]
    return along


@lru_cache(maxsize=64)
def compiled(step: Any, start: Any) -> Along:
    """As `interpreted`, compiled; the module is a file beside numba's cache where its constants can be imported."""
    text, program = module_text(step, start)
    module = None
    if len(program.imports) == len(program.constants):
        module = _from_file("\n".join([_HEAD + _COMPILED, *program.imports.values(), "\n", text]))
    along: Along = _in_memory(text, program) if module is None else module.along
    return along


def _unchanged(function: Any) -> Any:
    return function


def _in_memory(text: str, program: Program) -> Along:
    from hysim.kernels.tangents.compiling import closure

    names: dict[str, Any] = {**program.constants, "inner": closure, "kernel": closure}
    exec(compile(f"{_HEAD}\n\n{text}", "<derivative>", "exec"), names)
    along: Along = names["along"]
    return along


def _from_file(text: str) -> ModuleType | None:
    """The module with this text from its file, which is written where it is missing; None if no folder is writable."""
    name = f"hysim_derivative_{hashlib.sha256(text.encode()).hexdigest()[:20]}"
    if name in sys.modules:
        return sys.modules[name]
    path = _folder() / f"{name}.py"
    try:
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, text)
        specification = importlib.util.spec_from_file_location(name, path)
        assert specification is not None
        assert specification.loader is not None
        module = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(module)
    except OSError:
        return None
    sys.modules[name] = module
    return module


def _folder() -> Path:
    """The folder of numba's cache if one is set, or that of the user's caches."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(numba.config.CACHE_DIR or home) / "hysim"  # type: ignore[attr-defined]


def rates_along(
    along: Along, parameters: Any, rates: Any, state: Any, state_rates: Any, u: Any
) -> tuple[Any, Any, int]:
    """Outputs, their rates, and the first sample that is not finite, or -1; the state moves along."""
    y, moved = np.empty(u.size), np.zeros(u.size)
    with np.errstate(all="ignore"):
        lost = along(parameters, rates, state, state_rates, u, y, moved)
    return y, moved, int(lost)
