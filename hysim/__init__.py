"""hysim: simulate, identify, discover, compensate and compare hysteretic actuators; ``__init__.pyi`` has the names."""

import importlib
from typing import Any

from hysim._basics.names import MODULE_OF, meant
from hysim._basics.release import __version__ as __version__

__all__ = ["__version__", *MODULE_OF]


def __getattr__(name: str) -> Any:
    if name not in MODULE_OF:
        near = "" if name.startswith("__") else meant(name, __all__)  # tools ask for many names of Python's own
        words = f"module 'hysim' has no attribute {name!r}{near}"
        raise AttributeError(words, name=name, obj=None)  # without the object: Python would guess once more
    is_module = MODULE_OF[name] == __name__
    value: Any = importlib.import_module(f"hysim.{name}" if is_module else MODULE_OF[name])
    globals()[name] = value = value if is_module else vars(value)[name]
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
