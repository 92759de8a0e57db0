"""Pieces of the report's markup: text that is escaped, tables that scroll, figures with captions."""

import math
from collections.abc import Mapping, Sequence
from html import escape

Drawn = Mapping[str, str]
"""Name of a figure to its SVG."""


def ratio(num: Sequence[float], den: Sequence[float]) -> str:
    """A transfer function by its coefficients."""
    return f"({_polynomial(num)}) / ({_polynomial(den)})"


def _polynomial(coefficients: Sequence[float]) -> str:
    degree = len(coefficients) - 1
    text = ""
    for k, c in enumerate(coefficients):
        power = degree - k
        factor = "s" if power == 1 else f"s^{power}" if power else ""
        size = "" if abs(c) == 1.0 and factor else f"{abs(c):.4g}"
        text += (" - " if c < 0 else " + " if text else "") + " ".join(part for part in (size, factor) if part)
    return text.strip()


def complex_number(value: complex) -> str:
    """A pole."""
    if value.imag == 0.0:
        return f"{value.real:.3f}"
    return f"{value.real:.3f} {'+' if value.imag > 0 else '-'} {abs(value.imag):.3f}i"


def number(value: float, digits: int, kind: str = "f") -> str:
    """A number with some digits; a dash where there is none."""
    return "–" if math.isnan(value) else f"{value:.{digits}{kind}}"


def paragraph(text: str, kind: str = "") -> str:
    """Text in a paragraph, of a class if wanted."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def equation(text: str) -> str:
    """Preformatted mathematics."""
    return f'<div class="equation">{escape(text)}</div>'


def figure(svg: str, caption: str) -> str:
    """A drawing with a caption."""
    return f"<figure>\n{svg}\n<figcaption>{escape(caption)}</figcaption>\n</figure>"


def heading(text: str) -> str:
    """A heading inside a chapter."""
    return f"<h3>{escape(text)}</h3>"


def folded(summary: str, body: str, *, is_open: bool = False) -> str:
    """Markup that opens at a click on its summary, without a script."""
    opening = "<details open>" if is_open else "<details>"
    return f"{opening}<summary>{escape(summary)}</summary>\n{body}\n</details>\n"


def block(kind: str, anchor: str, lines: Sequence[tuple[str, str]]) -> str:
    """Lines of text, each of its own class, in one block; empty ones are left out."""
    body = "".join(f'<div class="{escape(name)}">{escape(text)}</div>' for name, text in lines if text)
    return f'<div class="{kind}" id="{escape(anchor)}">{body}</div>\n'


def table(header: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "") -> str:
    """A table in a box that scrolls, of a class if wanted; cells are text."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    opening = f'<table class="{kind}">' if kind else "<table>"
    return f'<div class="scroll">{opening}\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>'
