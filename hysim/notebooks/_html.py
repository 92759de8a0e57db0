"""Parts of a page in HTML: escaped text, tables in the colours of the notebook, figures on white paper.

A figure is an image of its own, so that neither its styles nor its ids meet those of other cells; its white ground
makes it readable on a dark page, too.
"""

import base64
import html
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from hysim import plot

_SIZE = (4.2, 2.9)  # inches


def heading(text: str) -> str:
    """A line in bold."""
    return f"<div><strong>{html.escape(text)}</strong></div>"


def note(text: str) -> str:
    """A line of text; nothing where there is none."""
    return f"<div>{html.escape(text)}</div>" if text else ""


def listed(title: str, texts: Iterable[str]) -> str:
    """Texts below a title; nothing where there are none."""
    lines = "".join(f"<li>{html.escape(text)}</li>" for text in texts)
    return f"<div>{html.escape(title)}</div><ul>{lines}</ul>" if lines else ""


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table whose first column is aligned to the left."""
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    body = "".join(f"<tr>{_cells(cells)}</tr>" for cells in rows)
    return f"<table>{f'<thead><tr>{head}</tr></thead>' if head else ''}<tbody>{body}</tbody></table>"


def _cells(cells: Sequence[str]) -> str:
    first, *others = map(html.escape, cells)
    aligned = [f'<td style="text-align:left">{first}</td>', *(f"<td>{cell}</td>" for cell in others)]
    return "".join(aligned)


def figure(draw: Callable[[Any], object], alternative: str) -> str:
    """Picture that a function draws on new Axes, with a text in its place for those who cannot see it."""
    with plot.house_style():
        canvas = plot.figure(*_SIZE)
        draw(canvas.add_subplot())
        picture = base64.b64encode(plot.to_svg(canvas).encode()).decode()
    style = "max-width:100%;height:auto;background:#fff;border-radius:4px"
    source = f"data:image/svg+xml;base64,{picture}"
    return f'<img alt="{html.escape(alternative, quote=True)}" style="{style}" src="{source}">'
