"""The pages of the results, by the names of their classes."""

import math
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from hysim import plot
from hysim._printing import extent, quantity
from hysim.notebooks._html import figure, heading, listed, note, table
from hysim.simulation import columns_of

_MOST = 30  # rows of a table


def page(result: Any) -> str | None:
    """The page of a result; None where its class has none, and the notebook shows its text."""
    for cls in type(result).__mro__:
        if cls.__module__.startswith("hysim.") and cls.__name__ in _PAGES:
            return f"<div>{_PAGES[cls.__name__](result)}</div>"
    return None


def _record(record: Any) -> str:
    columns = {} if record.t is None else {"t": record.t}
    columns |= {"u": record.u, "y": record.y, **{name: record.channel(name) for name in record.channels}}
    resolution = "" if record.resolution is None else quantity(record.resolution, record.units.get("y", ""))
    return "".join(
        [
            heading(_first_line(record)),
            table(["", "from ... to"], [[name, _span(values, record.units, name)] for name, values in columns.items()]),
            note(f"resolution {resolution}" if resolution else ""),
            figure(lambda ax: plot.loop(record, ax=ax), "output against input"),
        ]
    )


def _simulation(run: Any) -> str:
    signals = {name: run.signals[name] for name in run.signals if not name.startswith("peak_")}
    signals = signals or {"u": run.u, "y": run.y}
    columns = {label: each for name, values in signals.items() for label, each in columns_of(name, values).items()}
    rows = [[label, _span(values, _units_of_columns(run), label)] for label, values in columns.items()]
    return "".join(
        [
            heading(_first_line(run)),
            table(["", "from ... to"], _shortened(rows)),
            figure(lambda ax: plot.loop(run, ax=ax), "output against input") if run.u.size > 1 else "",
        ]
    )


def _units_of_columns(run: Any) -> Mapping[str, str]:
    return {label: unit for name, unit in run.units.items() for label in (name, *_columns(run, name))}


def _columns(run: Any, name: str) -> list[str]:
    return [*columns_of(name, run.signals[name])] if name in run.signals else []


def _closed_loop(run: Any) -> str:
    units = {"t": run.units.get("t", "s"), "u": run.units.get("u", ""), "y": run.units.get("y", "")}
    of = {"reference": "y", "y": "y", "error": "y", "u": "u"}
    rows = [[name, extent(vars(run)[name], units[signal])] for name, signal in of.items()]
    return "".join(
        [
            heading(_first_line(run)),
            table(["", "from ... to"], rows),
            figure(lambda ax: plot.response(run, ax), "reference and displacement against time"),
        ]
    )


def _identification(fit: Any) -> str:
    rows = [
        [
            name,
            f"{value:.6g}",
            f"{fit.stderr[name]:.2g}" if name in fit.free_names else "held",
            "{:.5g} ... {:.5g}".format(*fit.intervals[name]) if name in fit.intervals else "",
        ]
        for name, value in fit.estimates.items()
    ]
    return "".join(
        [
            heading(_first_line(fit)),
            table(["", "estimate", "standard error", "95 %"], _shortened(rows)),
            note(fit.message),
            listed("Warnings", fit.warnings),
            figure(lambda ax: _draw_residual(ax, fit.residual), "residual of each sample"),
        ]
    )


def _draw_residual(ax: Any, residual: Any) -> None:
    ax.axhline(0.0, color="#777777", linewidth=0.8)
    ax.plot(np.arange(residual.size), residual, linewidth=1.0, rasterized=residual.size > 5000)
    ax.set(xlabel="Sample", ylabel="Residual")


def _comparison(comparison: Any) -> str:
    best = comparison.winner or (comparison.rows[0].name if comparison.rows else None)
    if best is None:
        return str(comparison.to_html())
    record, row = comparison.record, comparison[best]
    model = SimpleNamespace(u=record.u, y=row.y, t=record.t, name=best, units=record.units)
    return str(comparison.to_html()) + figure(
        lambda ax: plot.loop(record, model, ax=ax), f"the record, and {best} over it"
    )


def _selection(selection: Any) -> str:
    rows = [
        [
            name,
            str(fit.n_parameters),
            f"{fit.fit_percent:.2f}",
            f"{fit.rmse:.4g}",
            f"{vars(fit)[selection.criterion]:.6g}",
        ]
        for name, fit in selection.fits.items()
    ]
    header = ["candidate", "parameters", "fit [%]", "rmse", selection.criterion]
    return heading(_first_line(selection)) + table(header, rows)


def _discovery(discovery: Any) -> str:
    rows = [
        [term, f"{value:.6g}", "" if math.isnan(error := discovery.stderr.get(term, math.nan)) else f"{error:.2g}"]
        for term, value in discovery.coefficients.items()
    ]
    path = discovery.path_n_terms
    return "".join(
        [
            heading(_first_line(discovery)),
            note(discovery.equation),
            note(f"Verdict: {discovery.verdict}"),
            table(["term", "coefficient", "standard error"], rows),
            listed("Warnings", discovery.warnings),
            figure(lambda ax: _draw_path(ax, discovery), "fit against the number of terms") if path.size else "",
        ]
    )


def _draw_path(ax: Any, discovery: Any) -> None:
    shown = discovery.path_fit_percent > discovery.scores["fit_percent"] - 50.0
    ax.plot(discovery.path_n_terms[shown], discovery.path_fit_percent[shown], "o", label="path of thresholds")
    ax.plot(discovery.scores["n_terms"], discovery.scores["fit_percent"], "D", label="chosen law")
    ax.set(xlabel="Number of terms", ylabel="Fit in free run [%]")
    ax.legend()


def _sweep(study: Any) -> str:
    lines = study.summary().splitlines()
    return heading(_first_line(study)) + "".join(map(note, lines[1:]))


def _structure(structure: Any) -> str:
    masses = np.diag(structure.mass_matrix)
    is_stable = bool((np.linalg.eigvalsh(structure.initial_stiffness) >= 0.0).all())
    periods = structure.periods() if is_stable else np.full(masses.size, np.nan)
    numbers = zip(masses, periods, strict=True)
    rows = [[str(k), f"{mass:.6g}", f"{period:.6g}"] for k, (mass, period) in enumerate(numbers, 1)]
    elements = [
        [str(k), " - ".join(map(str, each.between)), type(each.law).__name__]
        for k, each in enumerate(structure.elements)
    ]
    return "".join(
        [
            heading(
                f"Structure: {len(masses)} masses, {len(elements)} elements, excited by its {structure.excitation}"
            ),
            table(["mass or mode", "mass [kg]", "period [s]"], _shortened(rows)),
            table(["element", "between", "law"], _shortened(elements)),
        ]
    )


def _first_line(result: Any) -> str:
    return str(result).partition("\n")[0]


def _span(values: Any, units: Mapping[str, str], name: str) -> str:
    return extent(values, units.get(name, ""))


def _shortened(rows: list[list[str]]) -> list[list[str]]:
    if len(rows) <= _MOST:
        return rows
    return [*rows[: _MOST - 1], [f"... and {len(rows) - _MOST + 1} more", *[""] * (len(rows[0]) - 1)]]


_PAGES: dict[str, Callable[[Any], str]] = {
    "Record": _record,
    "Simulation": _simulation,
    "ClosedLoop": _closed_loop,
    "Identification": _identification,
    "Comparison": _comparison,
    "Selection": _selection,
    "Discovery": _discovery,
    "OscillatorDiscovery": _discovery,
    "Sweep": _sweep,
    "Structure": _structure,
}
