"""SVG that is the same bytes each time, and can be inlined beside others in one HTML page.

matplotlib numbers its groups, so that two pictures have the same ids, and gives shared shapes ids that are
random unless salted. Here both the salt and a prefix of every id come from the picture's name. Text stays
text: it can be searched and read aloud, and the page's reader has one of the common fonts that it asks for.
"""

import io
import re
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from hysim._atomic import write_text
from hysim.plot._style import house_style

_METADATA = dict.fromkeys(("Date", "Creator", "Format", "Type"))
_REFERENCE = re.compile(r'(\bid="|href="#|url\(#)')
_TAG = re.compile(r"<[^>]+>")
_NAME = re.compile(r"[A-Za-z][\w-]*", re.ASCII)


def to_svg(figure: Figure, *, name: str = "figure") -> str:
    """The figure as one ``<svg>`` element, good as a file and inside an HTML page.

    Parameters
    ----------
    figure : Figure
        Any matplotlib figure.
    name : str
        Prefix of all ids: pictures of one page need different names.

    Returns
    -------
    str
        The same for the same figure and name, in any process.

    Raises
    ------
    ValueError
        If the name is not a letter followed by letters, digits, `_` and `-`.
    """
    if not _NAME.fullmatch(name):
        raise ValueError(f"name must be a letter followed by letters, digits, _ and -, got {name!r}")
    _forget_layout(figure)
    buffer = io.StringIO()
    with house_style(), matplotlib.rc_context({"svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata=_METADATA)
    document = buffer.getvalue()
    element = document[document.index("<svg") :]
    own = _TAG.sub(lambda tag: _REFERENCE.sub(rf"\1{name}-", tag[0]), element)
    return own.replace("*{stroke", f"#{name}-figure_1 *{{stroke", 1)


def _forget_layout(figure: Figure) -> None:
    """Put the Axes where they were before any drawing: the layout starts from where they are, and moves them."""
    if figure.get_layout_engine() is not None:
        for ax in figure.axes:
            place = ax.get_subplotspec()
            if place is not None and ax.get_in_layout():
                ax.set_subplotspec(place)


def save_svg(figure: Figure, path: str | Path, *, name: str | None = None) -> None:
    """Write `to_svg` of the figure; the name is that of the file unless it is given."""
    path = Path(path)
    write_text(path, to_svg(figure, name=path.stem if name is None else name))
