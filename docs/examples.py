"""A name of the reference without an example shows one that makes or uses it.

These are the places in the order in which they are tried: a public function or method that returns a class, a public
class with such an attribute, an example of another name that uses the name, and a block of a page.
"""

import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from front_door import members
from numpydoc.docscrape import NumpyDocString
from sphinx.application import Sphinx
from sphinx.util import logging

import hysim

_BLOCK = re.compile(r"^```python\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)


def example(name: str, value: Any) -> list[str]:
    """Section Examples for a public name without one: empty, or with the place that the example is from."""
    if inspect.isclass(value) and (made := _maker(value.__name__)):
        return _section(f"As in `hysim.{made[0]}`:", made[1])
    calls = [rf"\bhs\.{re.escape(name)}\b"]
    if inspect.isclass(value):
        calls += [rf"\.{method}\(" for method in _returning(value)]
    used = re.compile("|".join(calls))
    for other, shown, _ in _examples():
        if any(used.search(line) for line in shown):
            return _section(f"As in `hysim.{other}`:", shown)
    blocks = [each for each in _blocks() if used.search(each[0])]
    if not blocks:
        return []
    block, title, page = min(blocks, key=lambda each: len(each[0]))
    lines = [f"   {line}" for line in block.splitlines()]
    place = f"As in the page `{title} <../{page}.html>`__:"
    return _section(place, [".. code-block:: python", "", *lines])


def _maker(name: str) -> tuple[str, list[str]] | None:
    """Name and example of what returns a class, or returns another that has it as an attribute."""
    wanted = re.compile(rf"\b{name}\b")
    for other, shown, returned in _examples():
        if wanted.search(returned):
            return other, shown
    for owner, value in _public():
        if inspect.isclass(value) and value.__name__ != name:
            attributes = " ".join(map(str, inspect.get_annotations(value).values()))
            own = NumpyDocString(inspect.getdoc(value) or "")["Examples"]
            if wanted.search(attributes):
                return (owner, own) if own else _maker(value.__name__)
    return None


def _returning(cls: type) -> Iterator[str]:
    """Names of the public methods that return a class."""
    for _, owner in _public():
        methods = (
            inspect.getmembers(owner, inspect.isroutine) if inspect.isclass(owner) else []
        )
        for name, method in methods:
            annotations = getattr(method, "__annotations__", {})
            if not name.startswith("_") and annotations.get("return") in (
                cls,
                cls.__name__,
            ):
                yield name


@cache
def _blocks() -> list[tuple[str, str, str]]:
    """Blocks of Python in pages, with the title and the name of their page."""
    texts = {
        page.stem: page.read_text() for page in sorted(Path(__file__).parent.glob("*.md"))
    }
    return [
        (block, text.partition("\n")[0].lstrip("# "), page)
        for page, text in texts.items()
        for block in _BLOCK.findall(text)
    ]


def _section(place: str, lines: list[str]) -> list[str]:
    return ["", "Examples", "--------", place, "", *lines]


@cache
def _examples() -> list[tuple[str, list[str], str]]:
    """Names, lines and returned types of public functions, methods and classes with examples, functions first."""
    rows = []
    for name, value in _public():
        if shown := NumpyDocString(inspect.getdoc(value) or "")["Examples"]:
            returned = (
                ""
                if inspect.isclass(value)
                else str(inspect.signature(value).return_annotation)
            )
            rows.append((name, shown, returned))
    return sorted(rows, key=lambda row: (not row[2], row[0].count(".")))


def _public() -> Iterator[tuple[str, Any]]:
    """Public functions, classes and methods, and their names."""
    names = {
        name: getattr(hysim, name) for name in hysim.__all__ if not name.startswith("_")
    }
    modules = [
        (name, module) for name, module in names.items() if inspect.ismodule(module)
    ]
    for name, module in modules:
        names |= {f"{name}.{each}": getattr(module, each) for each in members(module)}
    for name, value in names.items():
        if inspect.isroutine(value) or inspect.isclass(value):
            yield name, value
        if inspect.isclass(value):
            for each, method in inspect.getmembers(value, inspect.isroutine):
                if not each.startswith("_") and "Examples\n" in (method.__doc__ or ""):
                    yield f"{name}.{each}", method


def _complete(
    app: Sphinx, what: str, name: str, value: Any, options: Any, lines: list[str]
) -> None:
    if what in ("class", "function", "exception") and "Examples" not in lines:
        shown = example(name.removeprefix("hysim."), value)
        if not shown:
            logging.getLogger(__name__).warning(
                "%s has no example, and no page uses it", name
            )
        lines += shown


def setup(app: Sphinx) -> dict[str, bool]:
    """Complete docstrings before numpydoc reads them."""
    app.connect("autodoc-process-docstring", _complete, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
