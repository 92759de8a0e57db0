"""hysim: simulate, identify, discover, compensate and compare hysteretic actuators.

The public names are listed in ``__init__.pyi``, which type checkers read too. Each is imported when it is first used:
the bare import costs the standard library only.
"""

import importlib
import os
from typing import Any

__version__ = "0.1.0"

with open(os.path.join(os.path.dirname(__file__), "__init__.pyi"), encoding="utf-8") as stub:
    _WORDS = [line.split() for line in stub]  # "from hysim.records import Record as Record"
_MODULE_OF = {words[3]: words[1] for words in _WORDS if words[:1] == ["from"]}
__all__ = ["__version__", *_MODULE_OF]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'hysim' has no attribute {name!r}")
    is_module = _MODULE_OF[name] == __name__
    value: Any = importlib.import_module(f"hysim.{name}" if is_module else _MODULE_OF[name])
    globals()[name] = value = value if is_module else vars(value)[name]
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
