"""The API reference from the front door: every public name, in the order and grouping of `hysim.__all__`.

A name that is added there appears here without an edit.
"""

import inspect
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

import hysim
from hysim.models.candidates import is_identifiable
from hysim.models.law import Law
from hysim.models.model import every_family
from hysim.models.protocols import Invertible, StepwiseInvertible


def write_reference(folder: Path) -> None:
    """Write `index.rst`, from which autosummary makes a page for each name."""
    public = {name: getattr(hysim, name) for name in hysim.__all__ if not name.startswith("_")}
    modules = {name: value for name, value in public.items() if inspect.ismodule(value)}
    names = {name: value for name, value in public.items() if name not in modules}
    parts = [
        _heading("Reference", "="),
        "``import hysim as hs`` loads nothing but the standard library; each name is loaded when it is first used.\n",
        ".. currentmodule:: hysim\n",
    ]
    for home in dict.fromkeys(map(_home, names.values())):
        parts += [_heading(home.capitalize(), "-"), _summary(name for name in names if _home(names[name]) == home)]
    for name, module in modules.items():
        members = [member for member in _members(module) if getattr(module, member) not in names.values()]
        parts += [_heading(f"hysim.{name}", "-"), _first_line(module), _summary(f"{name}.{each}" for each in members)]
    folder.mkdir(exist_ok=True)
    page, text = folder / "index.rst", "\n".join(parts)
    if not page.exists() or page.read_text() != text:  # an unchanged page is not built anew
        for old in folder.glob("*.rst"):  # of names that are no more
            old.unlink()
        page.write_text(text)


def _home(value: Any) -> str:
    """Second part of the module's name: hysim.identification._identify is of the identification."""
    return str(value.__module__).split(".")[1].strip("_")


def _members(module: ModuleType) -> Iterable[str]:
    """Functions and classes of a public module that are hysim's own."""
    names = getattr(module, "__all__", [name for name in vars(module) if not name.startswith("_")])
    for name in names:
        value = getattr(module, name)
        if (inspect.isroutine(value) or inspect.isclass(value)) and value.__module__.startswith(module.__name__):
            yield name


def families() -> str:
    """Every law of the registry, and what hysim can do with it, as a table."""
    lines = ["| family | law | identified | inverse |", "|---|---|---|---|"]
    for name, family in every_family().items():
        if family.__module__.startswith("hysim.laws"):
            summary = (
                f"{inspect.getdoc(family)}".split("\n\n")[0].replace("\n", " ").replace("``", "`").replace("|", r"\|")
            )
            inverse = _inverse(family)
            identified = "yes" if is_identifiable(family) else ""
            lines.append(f"| [{name}](reference/hysim.{name}.rst) | {summary} | {identified} | {inverse} |")
    return "\n".join(lines)


def _inverse(family: type) -> str:
    """How the inverse of a law is computed."""
    if not isinstance(family, Invertible):
        return ""
    own = isinstance(family, StepwiseInvertible) and family.compiled_inverse is not Law.compiled_inverse
    return "closed form" if own else "search on the step"


def _heading(text: str, underline: str) -> str:
    return f"{text}\n{underline * len(text)}\n"


def _first_line(value: Any) -> str:
    return f"{inspect.getdoc(value)}".split("\n\n")[0].replace("\n", " ") + "\n"


def _summary(names: Iterable[str]) -> str:
    return ".. autosummary::\n   :toctree: .\n   :nosignatures:\n\n" + "".join(f"   {name}\n" for name in names)
