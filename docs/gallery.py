"""The gallery: a loop of every family of laws, and the pages' figures of every plant and of every picture.

Nothing is listed here. The families are those of the registry, each as its `example` has it; the figures of the others
are what the first block of a page that calls them has drawn.
"""

import inspect
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np
from formulas import as_tex
from front_door import GROUPS, heading_of
from numpy.typing import NDArray

import hysim as hs
from hysim.export._page import presets
from hysim.models.model import every_family

HERE = Path(__file__).parent
LOOP_FOLDER = "gallery_figures"  # beside this file, not kept
EXPLORER = "explorer.html"  # beside the built pages, of which it needs nothing

_PERIOD = 1.0  # s, where a law asks for a sample time
_PART = re.compile(
    r"^```python\n(.*?)^```|!\[[^\]]*\]\((figures/[\w-]+\.(?:svg|gif))\)",
    re.MULTILINE | re.DOTALL,
)


def plants() -> dict[str, type]:
    """What moves in time, by its public name: the plants of the registry that respond to an input."""
    registered = every_family().items()
    return {
        name: each
        for name, each in registered
        if each.__module__.startswith("hysim.plants") and hasattr(each, "response")
    }


def pictures() -> dict[str, Any]:
    """Functions of `hs.plot` that draw a result, by their names: those with an argument `ax` or `axes`."""
    public = {name: getattr(hs.plot, name) for name in hs.plot.__all__}
    return {
        name: each
        for name, each in public.items()
        if inspect.isfunction(each)
        and {"ax", "axes"} & inspect.signature(each).parameters.keys()
    }


def draw_families(folder: Path) -> None:
    """Draw a loop of every family, a file for each."""
    folder.mkdir(exist_ok=True)
    for name, family in hs.families().items():
        example = family.example
        u, y = loop(family(**example.fields), example.between)
        with hs.plot.house_style():
            canvas = hs.plot.figure(3.2, 2.4)
            hs.plot.loop(
                hs.Simulation(u=u, y=y, units=example.units), ax=canvas.add_subplot()
            )
        hs.plot.save_svg(canvas, folder / f"{name}.svg")


def family_cards() -> str:
    """A card for each family, under the headings of the reference: its loop, its name and what it is."""
    headings = {name: heading_of(each) for name, each in hs.families().items()}
    order = dict.fromkeys([*GROUPS, *headings.values()])
    groups = [heading for heading in order if heading in headings.values()]
    return "\n\n".join(
        f"**{group}**\n\n"
        + _cards(
            (f"{LOOP_FOLDER}/{name}.svg", f"hysim.{name}", name, each, _sliders(name))
            for name, each in hs.families().items()
            if headings[name] == group
        )
        for group in groups
    )


def plant_cards() -> str:
    """A card for each plant that a page has drawn."""
    return _cards(
        (figure_of(f"hs.{name}"), f"hysim.{name}", name, each, "")
        for name, each in plants().items()
    )


def picture_cards() -> str:
    """A card for each picture."""
    return _cards(
        (figure_of(f"hs.plot.{name}"), f"hysim.plot.{name}", name, each, "")
        for name, each in pictures().items()
    )


def _cards(entries: Iterable[tuple[str, str, str, Any, str]]) -> str:
    cards = [
        f":::{{container}} card\n[![{name}]({figure})](reference/{page}.rst)\n\n"
        f"[{name}](reference/{page}.rst): {_first_sentence(value)}{more}\n:::"
        for figure, page, name, value, more in entries
    ]
    return "\n".join(["::::{container} gallery", *cards, "::::"])


@cache
def frames() -> dict[str, str]:
    """Addresses of the explorer with each family, in the model of fewest parts, by the families' full names."""
    addresses: dict[str, str] = {}
    models = presets().items()
    for preset, each in sorted(models, key=lambda named: len(_parts(named[1].model))):
        for part in _parts(each.model):
            address = f"{EXPLORER}#{urlencode({'model': preset})}"
            addresses.setdefault(f"hysim.{type(part).__name__}", address)
    return addresses


def _parts(model: Any) -> tuple[Any, ...]:
    return model.parts if isinstance(model, hs.Sum) else (model,)


def _sliders(name: str) -> str:
    """A link to the sliders on the page of this family, if it has some."""
    return (
        f' <a href="reference/hysim.{name}.html#sliders">Sliders.</a>'
        if f"hysim.{name}" in frames()
        else ""
    )


def _first_sentence(value: Any) -> str:
    first = f"{inspect.getdoc(value)}".split("\n\n")[0].replace("\n", " ")
    return as_tex(first.replace("``", "`")) if inspect.isclass(value) else first


def figure_of(call: str) -> str:
    """The first figure that a page has drawn with this call; LookupError where there is none."""
    for code, figure in figures_by_code():
        if re.search(rf"{re.escape(call)}\b", code):
            return figure
    raise LookupError(
        f"no page of docs/ has a figure of {call}: draw one, in plots.md for instance"
    )


@cache
def figures_by_code() -> list[tuple[str, str]]:
    """For each figure of a page, the code since the figure before it; the page on plots comes first."""
    figures = []
    for page in sorted(HERE.glob("*.md"), key=lambda page: (page.stem != "plots", page)):
        code = ""
        for block, figure in _PART.findall(page.read_text()):
            code += block
            if figure:
                figures.append((code, figure))
                code = ""
    return figures


def loop(
    law: Any, between: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A fading input, and what a law makes of it."""
    low, high = between
    half, mean = 0.5 * (high - low), 0.5 * (low + high)
    u = hs.signals.decaying_sine(half, mean=mean, cycles=4, samples_per_cycle=100)
    return u, _response(law, u)


def _response(law: Any, u: NDArray[np.float64]) -> NDArray[np.float64]:
    if "sample_time" in inspect.signature(law.response).parameters:
        return np.asarray(law.response(u, _PERIOD / 100.0))
    return np.asarray(law.response(u))
