"""The page of a result without an example shows that of the function which returns it."""

import inspect
from collections.abc import Iterator
from functools import cache
from typing import Any

from front_door import members
from numpydoc.docscrape import FunctionDoc
from sphinx.application import Sphinx

import hysim


@cache
def examples() -> dict[str, list[str]]:
    """Lines of the example of the first public function that returns a class, by the name of the class."""
    lines: dict[str, list[str]] = {}
    for name, value in _functions():
        returned = inspect.signature(value).return_annotation
        if own := FunctionDoc(value)["Examples"]:
            heading = ["Examples", "--------", f"As `hysim.{name}` returns it:", ""]
            key = getattr(returned, "__name__", str(returned))
            lines.setdefault(key, [*heading, *own])
    return lines


def _functions() -> Iterator[tuple[str, Any]]:
    """Public functions and their names, those of the front door first."""
    values = {
        name: getattr(hysim, name) for name in hysim.__all__ if not name.startswith("_")
    }
    for name, value in values.items():
        if inspect.isroutine(value):
            yield name, value
    for name, module in values.items():
        if inspect.ismodule(module):
            for each in members(module):
                if inspect.isroutine(getattr(module, each)):
                    yield f"{name}.{each}", getattr(module, each)


def _complete(
    app: Sphinx, what: str, name: str, value: Any, options: Any, lines: list[str]
) -> None:
    if what == "class" and "Examples" not in lines:
        lines += ["", *examples().get(value.__name__, [])]


def setup(app: Sphinx) -> dict[str, bool]:
    """Complete docstrings before numpydoc reads them."""
    app.connect("autodoc-process-docstring", _complete, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
