"""The house style: thin spines, a light grid, colours of M. Okabe and K. Ito (2008) for the colour-blind, dashes.

Files of figures have the same bytes each time. Matplotlib numbers the groups of an SVG, so that two pictures have the
same ids, and gives shared shapes random ids unless they are salted. Here the salt and a prefix of every id come from
the picture's name, so that pictures can stand beside each other in one HTML page. Text stays text: it can be searched.
"""

import io
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.style
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.textpath import TextPath

from hysim._basics.atomic import write_all
from hysim._basics.frozen import check_choice

AxesArray = npt.NDArray[np.object_]
AxesLike = Sequence[Axes] | AxesArray

WIDTH = 6.0
"""Width of a figure [in]: narrow enough to be read on a phone, where it shrinks to 360 pixels."""

MEASURED = "#333333"
POINTS = "#b0b0b0"
GUIDE = "#777777"

MARKERS = "os^D"

MANY = 300
"""Samples beyond which the markers of a record would cover each other: it is drawn as a line, or as dots."""

_RASTERISED = 5000  # samples beyond which a picture holds dots of a grid in place of every point
_JOINED: dict[str, Any] = {
    "color": POINTS,
    "linewidth": 0.8,
    "markersize": 4.0,
    "markerfacecolor": "white",
    "markeredgecolor": MEASURED,
}
_SMALLEST = 1.0  # dot [pt]
_GAPS = 1.1  # a label may reach into the gaps between panels, and constrained layout makes these smaller
_BROAD = 2.6  # line of a record [pt]: that of a model is seen over it

SEQUENTIAL = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, 256)), "hysim_sequential")
"""From dark to light; its light end is still visible on white."""

DIVERGING = LinearSegmentedColormap.from_list(
    "hysim_diverging", ["#0a1f4d", "#27569a", "#888888", "#d8ad45", "#fff3b0"]
)
"""From dark blue over grey, which is zero, to light yellow: lightness rises all the way, so that it reads in grey."""

_LINES = (
    ("#0072B2", "solid"),
    ("#D55E00", (0, (4, 1.5))),
    ("#009E73", (0, (6, 1.5, 1, 1.5))),
    ("#CC79A7", (0, (1, 1))),
    ("#222222", "solid"),
    ("#56B4E9", (0, (10, 2))),
    ("#E69F00", (0, (1, 2.5))),
)


@contextmanager
def house_style() -> Iterator[None]:
    """Context, or decorator, in which figures and Axes have the house style whatever the user's settings."""
    with matplotlib.style.context(Path(__file__).with_name("house.mplstyle"), after_reset=True):
        yield


def figure(width: float = WIDTH, height: float = 4.0) -> Figure:
    """Make an empty figure of some width and height [in], without pyplot.

    Examples
    --------
    >>> import hysim as hs
    >>> with hs.plot.house_style():
    ...     canvas = hs.plot.figure()
    ...     _ = hs.plot.loop(hs.datasets.table1(), ax=canvas.add_subplot())
    >>> hs.plot.to_svg(canvas)[:4]
    '<svg'
    """
    return Figure(figsize=(width, height), layout="constrained")


def panels(canvas: Figure, n: int, *, columns: int = 1, sharex: bool = True, sharey: bool = False) -> AxesArray:
    """Add `n` Axes row by row to a figure; shared axes have labels on the outer panels only."""
    rows = math.ceil(n / columns)
    axes = np.empty(n, dtype=object)  # each is None until it is made: the first shares with no other
    for k in range(n):
        axes[k] = ax = canvas.add_subplot(
            rows, columns, k + 1, sharex=axes[0] if sharex else None, sharey=axes[0] if sharey else None
        )
        if sharex and k < (rows - 1) * columns:
            ax.tick_params(labelbottom=columns > 1)
            ax.xaxis.label.set_visible(False)
        if sharey and k % columns:
            ax.tick_params(labelleft=False)
            ax.yaxis.label.set_visible(False)
    canvas.align_ylabels(axes)
    return axes


@contextmanager
def one(ax: Axes | None, height: float = 4.0) -> Iterator[Axes]:
    """The Axes `ax`; without them new ones, and the house style while they are drawn on."""
    with several(None if ax is None else [ax], 1, height) as axes:
        yield axes[0]


@contextmanager
def several(
    axes: AxesLike | None, n: int, height: float, *, columns: int = 1, sharex: bool = True, sharey: bool = False
) -> Iterator[AxesArray]:
    """The first `n` of `axes`; without them new ones in rows of `height` [in], and the house style meanwhile."""
    if axes is not None:
        existing = np.ravel(np.asarray(axes, dtype=object))
        if existing.size < n:
            raise ValueError(f"{n} Axes are needed, got {existing.size}")
        yield existing[:n]
        return
    import matplotlib.pyplot as plt

    with house_style():
        canvas = plt.figure(figsize=(WIDTH, height * math.ceil(n / columns)), layout="constrained")
        yield panels(canvas, n, columns=columns, sharex=sharex, sharey=sharey)


def upright(ax: Axes, text: str) -> None:
    """Set the label of the vertical axis; its unit stands in a second line where the panel is too low for one line."""
    height = _GAPS * 72.0 * ax.get_position().height * ax.get_figure(root=True).get_figheight()  # type: ignore[union-attr]
    font = ax.yaxis.label.get_fontproperties()
    is_long = TextPath((0.0, 0.0), text, size=font.get_size_in_points(), prop=font).get_extents().width > height
    ax.set_ylabel(text.replace(" [", "\n[") if is_long else text)


def line(k: int) -> dict[str, Any]:
    colour, dashes = _LINES[k % len(_LINES)]
    return {"color": colour, "linestyle": dashes}


def grid_of(n: int) -> dict[str, Any]:
    """How a line of `n` samples is kept: as dots of a grid where there are many, else point by point."""
    return {"rasterized": n > _RASTERISED}


def joined(n: int, k: int = 0) -> dict[str, Any]:
    """Style of `n` measured samples joined by a line: the record with the number `k`."""
    if n <= MANY:
        return {"marker": MARKERS[k % len(MARKERS)], **_JOINED}
    return {"color": POINTS, "linewidth": _BROAD, **grid_of(n)}


def scattered(n: int, **style: Any) -> dict[str, Any]:
    """Style of `n` measured samples that are not joined: markers of a `style`, the smaller the more there are."""
    if n <= MANY:
        return {"linestyle": "none", "marker": "o", "markersize": 3.8, **style}
    size = max(_SMALLEST, 3.8 * math.sqrt(MANY / n))
    return {"linestyle": "none", "marker": ".", "markersize": size, "markeredgewidth": 0.0, **grid_of(n)}


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
    if figure.get_layout_engine() is not None:
        for ax in figure.axes:  # back where they were before any drawing: the layout starts from where they are
            place = ax.get_subplotspec()
            if place is not None and ax.get_in_layout():
                ax.set_subplotspec(place)
    buffer = io.StringIO()
    with house_style(), matplotlib.rc_context({"svg.hashsalt": name}), ExitStack() as after:
        after.callback(figure.set, canvas=figure.canvas, dpi=figure.dpi)
        # `savefig` would draw twice, the first time for the layout alone.
        FigureCanvasSVG(figure).print_svg(buffer, metadata=_METADATA["svg"])
    document = buffer.getvalue()
    element = document[document.index("<svg") :]
    own = _TAG.sub(lambda tag: _REFERENCE.sub(rf"\1{name}-", tag[0]), element)
    return own.replace("*{stroke", f"#{name}-figure_1 *{{stroke", 1)


def save_svg(figure: Figure, path: str | Path, *, name: str | None = None) -> None:
    """Write `to_svg` of a figure to a file; `name` is by default the name of the file."""
    path = Path(path)
    write_all({path: to_svg(figure, name=path.stem if name is None else name)})


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
