"""The API reference from the front door: every public name, grouped by what it is for.

A name that is added there appears here without an edit.
"""

import inspect
import re
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

from formulas import as_tex

import hysim
from hysim.models.law import Law
from hysim.models.model import is_identifiable
from hysim.models.protocols import Invertible, StepwiseInvertible

GROUPS = {
    "Records and files": ("records", "files"),
    "Simulation and measures": (
        "simulation",
        "metrics",
        "laws.operators.reversal_curves",
    ),
    "Identification": ("identification",),
    "Comparison": ("comparison",),
    "Discovery": ("discovery",),
    "Bouc-Wen, Duhem and other differential laws": ("laws.differential",),
    "Plays, stops and relays": ("laws.operators",),
    "Friction, backlash and dashpots": ("laws.friction", "laws.dashpot"),
    "Magnetic cores": ("laws.magnetic", "laws.operators.energy_plays"),
    "Laws without memory": ("laws.static",),
    "Laws of your own": (
        "laws.custom",
        "models.law",
        "models.model",
        "models.parameters",
    ),
    "Sums, cascades and channels": ("models",),
    "Actuators and linear plants": ("plants",),
    "Structures": ("plants.structures",),
    "Control": ("control",),
    "Files of models, C, FMU and pages": ("models.storage", "export"),
    "Studies": ("sweeps",),
    "Errors and versions": ("errors", "_versions"),
}
"""Headings of the reference, and the parts of hysim that hold what stands under them; the longest part decides."""


def write_reference(folder: Path) -> list[str]:
    """Write `index.rst` and a page for each group; return these, from which autosummary makes a page for each name."""
    pages = {
        _file_of(heading): _page(heading, text) for heading, text in groups().items()
    }
    listed = "".join(f"   {name}\n" for name in pages)
    head = "``import hysim as hs`` loads nothing but the standard library; each name is loaded when it is first used.\n"
    pages["index"] = _page(
        "Reference", f"{head}\n.. toctree::\n   :maxdepth: 2\n\n{listed}"
    )
    folder.mkdir(exist_ok=True)
    files = {folder / f"{name}.rst": text for name, text in pages.items()}
    written = {file: file.read_text() for file in files if file.exists()}
    if written != files:  # else nothing is built anew
        for old in folder.glob("*.rst"):  # of names that are no more
            old.unlink()
        for file, text in files.items():
            file.write_text(text)
    return [f"{folder.name}/{file.name}" for file in files]


def groups() -> dict[str, str]:
    """What stands under each heading; public modules have one of their own, for what the front door does not have."""
    public = {
        name: getattr(hysim, name) for name in hysim.__all__ if not name.startswith("_")
    }
    modules = {name: value for name, value in public.items() if inspect.ismodule(value)}
    names = {name: value for name, value in public.items() if name not in modules}
    headings = {name: heading_of(value) for name, value in names.items()}
    order = [
        heading
        for heading in dict.fromkeys([*GROUPS, *headings.values()])
        if heading in headings.values()
    ]
    texts = {
        heading: _summary(name for name in names if headings[name] == heading)
        for heading in order
    }
    for name, module in modules.items():
        own = [
            each
            for each in members(module)
            if getattr(module, each) not in names.values()
        ]
        texts[f"hysim.{name}"] = (
            f"{_first_line(module)}\n{_summary(f'{name}.{each}' for each in own)}"
        )
    return texts


def heading_of(value: Any) -> str:
    """The heading of the longest part of hysim that holds a value; for a part that is not listed, its name."""
    home = str(value.__module__).removeprefix("hysim.")
    listed = {part: heading for heading, parts in GROUPS.items() for part in parts}
    holding = [part for part in listed if f"{home}.".startswith(f"{part}.")]
    return (
        listed[max(holding, key=len)]
        if holding
        else home.split(".")[0].strip("_").capitalize()
    )


def _file_of(heading: str) -> str:
    return "group-" + re.sub(r"\W+", "-", heading.lower())


def _page(heading: str, text: str) -> str:
    return f"{_heading(heading, '=')}\n.. currentmodule:: hysim\n\n{text}"


def members(module: ModuleType) -> Iterable[str]:
    """Functions and classes of a public module that are hysim's own."""
    names = getattr(
        module, "__all__", [name for name in vars(module) if not name.startswith("_")]
    )
    for name in names:
        value = getattr(module, name)
        if (
            inspect.isroutine(value) or inspect.isclass(value)
        ) and value.__module__.startswith(module.__name__):
            yield name


def families() -> str:
    """Every law of the registry, and what hysim can do with it, as a table."""
    lines = ["| family | law | identified | inverse |", "|---|---|---|---|"]
    for name, family in hysim.families().items():
        first = f"{inspect.getdoc(family)}".split("\n\n")[0].replace("\n", " ")
        summary = as_tex(first.replace("``", "`")).replace("|", r"\|")
        inverse = _inverse(family)
        identified = "yes" if is_identifiable(family) else ""
        lines.append(
            f"| [{name}](reference/hysim.{name}.rst) | {summary} | {identified} | {inverse} |"
        )
    return "\n".join(lines)


def _inverse(family: type) -> str:
    """How the inverse of a law is computed."""
    if not isinstance(family, Invertible):
        return ""
    own = (
        isinstance(family, StepwiseInvertible)
        and family.compiled_inverse is not Law.compiled_inverse
    )
    return "closed form" if own else "search on the step"


def _heading(text: str, underline: str) -> str:
    return f"{text}\n{underline * len(text)}\n"


def _first_line(value: Any) -> str:
    return f"{inspect.getdoc(value)}".split("\n\n")[0].replace("\n", " ") + "\n"


def _summary(names: Iterable[str]) -> str:
    return ".. autosummary::\n   :toctree: .\n   :nosignatures:\n\n" + "".join(
        f"   {name}\n" for name in names
    )
