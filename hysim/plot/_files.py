"""Figures as files of the formats that papers need: the same bytes each time.

Matplotlib numbers the groups of an SVG, so that two pictures have the same ids, and gives shared shapes random ids
unless they are salted. Here the salt and a prefix of every id come from the picture's name, so that pictures can stand
beside each other in one HTML page. Text stays text: it can be searched and read aloud.
"""

import io
import re
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from hysim._basics.atomic import write_text
from hysim._basics.frozen import check_choice
from hysim.plot._style import house_style

_DOTS = 200  # per inch
_METADATA: dict[str, dict[str, Any]] = {
    "svg": dict.fromkeys(("Date", "Creator", "Format", "Type")),
    "png": {"Software": None},
    "pdf": {"Creator": None, "Producer": None, "CreationDate": None},
}
FORMATS = tuple(_METADATA)

_REFERENCE = re.compile(r'(\bid="|href="#|url\(#)')
_TAG = re.compile(r"<[^>]+>")
_NAME = re.compile(r"[A-Za-z][\w-]*", re.ASCII)


def to_svg(figure: Figure, *, name: str = "figure") -> str:
    """Write a figure as one ``<svg>`` element, good as a file and inside an HTML page.

    `name` is the prefix of all ids: pictures on one page need different names, each a letter followed by letters,
    digits, `_` and `-`, else a ValueError is raised. The same figure and name give the same bytes, in any process.
    """
    if not _NAME.fullmatch(name):
        raise ValueError(f"name must be a letter followed by letters, digits, _ and -, got {name!r}")
    _forget_layout(figure)
    buffer = io.StringIO()
    with house_style(), matplotlib.rc_context({"svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata=_METADATA["svg"])
    document = buffer.getvalue()
    element = document[document.index("<svg") :]
    own = _TAG.sub(lambda tag: _REFERENCE.sub(rf"\1{name}-", tag[0]), element)
    return own.replace("*{stroke", f"#{name}-figure_1 *{{stroke", 1)


def _forget_layout(figure: Figure) -> None:
    """Put the Axes where they were before any drawing, since the layout starts from where they are."""
    if figure.get_layout_engine() is not None:
        for ax in figure.axes:
            place = ax.get_subplotspec()
            if place is not None and ax.get_in_layout():
                ax.set_subplotspec(place)


def save_svg(figure: Figure, path: str | Path, *, name: str | None = None) -> None:
    """Write `to_svg` of a figure to a file; `name` is by default the name of the file."""
    path = Path(path)
    write_text(path, to_svg(figure, name=path.stem if name is None else name))


def to_bytes(figure: Figure, form: str, *, name: str = "figure") -> bytes:
    """Write a figure as the content of a file, the same bytes each time.

    `form` is ``"svg"``, ``"png"``, with 200 dots per inch, or ``"pdf"``; else a ValueError. `name` is as in `to_svg`.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.plot.to_bytes(hs.plot.figure(), "png")[1:4]
    b'PNG'
    """
    check_choice("form", form, FORMATS)
    if form == "svg":
        return (to_svg(figure, name=name) + "\n").encode()
    buffer = io.BytesIO()
    with house_style():
        figure.savefig(buffer, format=form, dpi=_DOTS, metadata=_METADATA[form])
    return buffer.getvalue()
