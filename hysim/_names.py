"""The public names in reading order, and the modules that hold them, as the stub of the front door lists them."""

from pathlib import Path

_LINES = Path(__file__).with_name("__init__.pyi").read_text(encoding="utf-8").splitlines()
_WORDS = [line.split() for line in _LINES]  # "from hysim.records import Record as Record"

MODULE_OF = {words[3]: words[1] for words in _WORDS if words[:1] == ["from"]}
"""Public name to the module that holds it; ``hysim`` for a module of that name."""
