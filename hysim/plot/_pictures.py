"""Figures in the formats that people put into a paper: the same bytes each time."""

import io
from typing import Any

from matplotlib.figure import Figure

from hysim.plot._style import house_style
from hysim.plot._svg import to_svg

_DOTS = 200  # an inch
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"Creator": None, "Producer": None, "CreationDate": None},
}

FORMATS = ("svg", *_METADATA)


def to_bytes(figure: Figure, form: str, *, name: str = "figure") -> bytes:
    """The figure as a file's content.

    Parameters
    ----------
    figure : Figure
        Any matplotlib figure.
    form : {"svg", "png", "pdf"}
        The format; PNG has 200 dots an inch.
    name : str
        As in `to_svg`.

    Returns
    -------
    bytes
        The same for the same figure, format and name.

    Raises
    ------
    ValueError
        If there is no such format.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.plot.to_bytes(hs.plot.figure(), "png")[1:4]
    b'PNG'
    """
    if form not in FORMATS:
        raise ValueError(f"form must be one of {', '.join(FORMATS)}, got {form!r}")
    if form == "svg":
        return (to_svg(figure, name=name) + "\n").encode()
    buffer = io.BytesIO()
    with house_style():
        figure.savefig(buffer, format=form, dpi=_DOTS, metadata=_METADATA[form])
    return buffer.getvalue()
