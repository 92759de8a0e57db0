"""Results in notebooks: the printed text as a table, and a small figure as an image with its own ids and styles."""

import base64
import html
import re
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from hysim import plot

_SIZE = (4.2, 2.9)  # inches
_STYLE = "max-width:100%;height:auto;background:#fff;border-radius:4px"
_WITHOUT_FIGURE = ("Selection", "Sweep", "Structure")


def page(result: Any) -> str | None:
    """The page of a result; None if its class has no page, so that the notebook shows its text."""
    names = [cls.__name__ for cls in type(result).__mro__ if cls.__module__.startswith("hysim.")]
    name = next((name for name in names if name in _FIGURES or name in _WITHOUT_FIGURE), None)
    if name is None:
        return None
    table = str(result.to_html()) if name == "Comparison" else _table(str(result))
    return f"<div>{table}{_figure(result, *_FIGURES[name]) if name in _FIGURES else ''}</div>"


def _table(text: str) -> str:
    first, *lines = text.splitlines()
    rows = [re.split(r" {2,}", html.escape(line.strip())) for line in lines if line.strip("-")]
    cells = (
        "".join(f"<td>{cell}</td>" for cell in row) if len(row) > 1 else f'<td colspan="9">{row[0]}</td>'
        for row in rows
    )
    body = "".join(f'<tr style="text-align:left">{row}</tr>' for row in cells)
    return f"<div><strong>{html.escape(first)}</strong></div><table><tbody>{body}</tbody></table>"


def _figure(result: Any, alternative: str, draw: Callable[[Any, Any], object]) -> str:
    with plot.house_style():
        canvas = plot.figure(*_SIZE)
        axes = canvas.add_subplot()
        draw(axes, result)
        if not axes.has_data():
            return ""
        picture = base64.b64encode(plot.to_svg(canvas).encode()).decode()
    return f'<img alt="{alternative}" style="{_STYLE}" src="data:image/svg+xml;base64,{picture}">'


def _residual(ax: Any, fit: Any) -> None:
    ax.axhline(0.0, color="#777777", linewidth=0.8)
    ax.plot(np.arange(fit.residual.size), fit.residual, linewidth=1.0, rasterized=fit.residual.size > 5000)
    ax.set(xlabel="Sample", ylabel="Residual")


def _best_loop(ax: Any, comparison: Any) -> None:
    best = comparison.winner or next((row.name for row in comparison.rows), None)
    if best is not None:
        record = comparison.record
        model = SimpleNamespace(u=record.u, y=comparison[best].y, t=record.t, name=best, units=record.units)
        plot.loop(record, model, ax=ax)


def _fits(ax: Any, discovery: Any) -> None:
    plot.selection(discovery, [ax, plot.figure().add_subplot()])
    ax.set_xlabel("Number of terms")


_FIGURES: dict[str, tuple[str, Callable[[Any, Any], object]]] = {
    "Record": ("output against input", lambda ax, record: plot.loop(record, ax=ax)),
    "Simulation": ("output against input", lambda ax, run: run.u.size > 1 and plot.loop(run, ax=ax)),
    "ClosedLoop": ("reference and output against time", lambda ax, run: plot.response(run, ax)),
    "Identification": ("residual of each sample", _residual),
    "Comparison": ("the record, and the best model over it", _best_loop),
    "Discovery": ("fit against the number of terms", _fits),
    "OscillatorDiscovery": ("fit against the number of terms", _fits),
}
