"""The verb `compare`: models side by side on one record.

Every model is simulated in free run on the record and judged by the same measures, those of
`hysim.metrics`: how well its output fits, and how wide its loop is.
"""

import csv
import io
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray, frozen
from hysim.identification import identify
from hysim.metrics import LoopMetrics, loop_metrics
from hysim.records import Record
from hysim.simulation import simulate

_SHORT = 200  # samples; leaving one out at a time costs as many fits as there are samples
_BLOCKS = 10


@frozen
class ComparisonRow:
    """One model on the record.

    Parameters
    ----------
    name : str
        What the model is called.
    model : model
        The model itself.
    n_parameters : int
        How many of its parameters were fitted to this record.
    fit_percent, rmse : float
        Of the free-run output [unit of y].
    cv_rmse : float
        Cross-validated rmse, nan if unknown [unit of y]. A model that was not fitted has its rmse.
    max_residual : float
        Largest residual [unit of y].
    max_width, max_width_at, area, width_rmse : float
        Of the model's loop, as in `hysim.loop_metrics`; `width_rmse` is the rms difference from the
        measured width over the measured inputs.
    fpe : float
        Final prediction error, nan where nothing was fitted.
    y : array, shape (n,)
        Output at the record's samples.
    loop : LoopMetrics
        The model's loop.
    """

    name: str
    model: Any
    n_parameters: int
    fit_percent: float
    rmse: float
    cv_rmse: float
    max_residual: float
    max_width: float
    max_width_at: float
    area: float
    width_rmse: float
    fpe: float
    y: FloatArray
    loop: LoopMetrics


@frozen
class Comparison:
    """Models side by side.

    Parameters
    ----------
    record : Record
        What they were compared on.
    loop : LoopMetrics
        Its loop.
    rows : tuple of ComparisonRow
        One for each model, in the order given.
    """

    record: Record
    loop: LoopMetrics
    rows: tuple[ComparisonRow, ...]

    def __getitem__(self, name: str) -> ComparisonRow:
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(f"no model {name!r}: there are {', '.join(row.name for row in self.rows)}")

    def to_text(self) -> str:
        """The table for a terminal."""
        table = [self._header(), *self._cells(_rounded)]
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = [
            "  ".join([cells[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(cells[1:], widths[1:], strict=True))])
            for cells in table
        ]
        return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])

    def to_markdown(self) -> str:
        """The table in Markdown."""
        header = self._header()
        rule = ["---", *("---:" for _ in header[1:])]
        return "\n".join("| " + " | ".join(cells) + " |" for cells in [header, rule, *self._cells(_rounded)])

    def to_csv(self) -> str:
        """The table as comma-separated values, every digit kept."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerows([self._header(), *self._cells(_exact)])
        return buffer.getvalue()

    def _header(self) -> list[str]:
        unit = self.record.units
        labels = {name: f" [{unit[name]}]" if name in unit else "" for name in ("u", "y")}
        quanta = ["max residual [quanta]"] if self.record.resolution else []
        area = f" [{unit['y']} {unit['u']}]" if {"u", "y"} <= unit.keys() else ""
        y = labels["y"]
        return [
            "model", "parameters", "fit [%]", f"rmse{y}", f"cv rmse{y}", *quanta, f"max width{y}",
            f"at{labels['u']}", f"area{area}", f"width rmse{y}",
        ]  # fmt: skip

    def _cells(self, write: Callable[[float, int], str]) -> list[list[str]]:
        quantum = self.record.resolution
        return [
            [
                row.name,
                str(row.n_parameters),
                write(row.fit_percent, 2),
                write(row.rmse, 4),
                write(row.cv_rmse, 4),
                *([write(row.max_residual / quantum, 2)] if quantum else []),
                write(row.max_width, 3),
                write(row.max_width_at, 1),
                write(row.area, 2),
                write(row.width_rmse, 4),
            ]
            for row in self.rows
        ]


def compare(subjects: Mapping[str, Any], record: Record, *, cross_validate: str | int | None = "auto") -> Comparison:
    """Compare models on a record.

    Parameters
    ----------
    subjects : mapping
        Name to what is to be compared: a model, which is taken as it is; a result of `identify` or
        `discover`; or a class or structure, which is identified on the record.
    record : Record
        With at least one complete cycle of the input.
    cross_validate : {"auto", "loo", None} or int
        How the classes and structures are cross-validated; see `identify`. ``"auto"`` leaves one sample out at
        a time on records of up to 200 samples, and one of 10 blocks on longer ones.

    Returns
    -------
    Comparison

    Raises
    ------
    ValueError
        If there is nothing to compare, or the record has no complete cycle.
    SimulationError
        If a model leaves the finite numbers on the record.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(0.0, 1.0, cycles=1, samples_per_cycle=40)
    >>> rec = hs.Record(u=u, y=hs.BoucWen(beta=2.0, gamma=0.5).response(u))
    >>> tab = hs.compare({"line": hs.Line, "truth": hs.BoucWen(beta=2.0, gamma=0.5)}, rec)
    >>> [row.name for row in tab.rows], round(tab["truth"].fit_percent, 3)
    (['line', 'truth'], 100.0)
    """
    if not isinstance(record, Record):
        raise TypeError(f"compare takes a Record, got {type(record).__name__}: hs.Record(u=u, y=y)")
    if not subjects:
        raise ValueError("there is nothing to compare: give at least one model by name")
    if cross_validate == "auto":
        cross_validate = "loo" if len(record) <= _SHORT else _BLOCKS
    measured = loop_metrics(record.u, record.y)
    rows = [_row(name, subject, record, measured, cross_validate) for name, subject in subjects.items()]
    return Comparison(record=record, loop=measured, rows=tuple(rows))


def _row(
    name: str, subject: Any, record: Record, measured: LoopMetrics, cross_validate: str | int | None
) -> ComparisonRow:
    fitted = identify(subject, record, cross_validate=cross_validate) if _is_family(subject) else subject
    model = getattr(fitted, "model", fitted)
    y = simulate(model, record.t, record.u).y
    loop = loop_metrics(record.u, y)
    residual = record.y - y
    rmse = metrics.rmse(record.y, y)
    is_fitted = fitted is not model
    n_parameters = int(fitted.n_parameters) if is_fitted else 0
    return ComparisonRow(
        name=name,
        model=model,
        n_parameters=n_parameters,
        fit_percent=metrics.fit_percent(record.y, y),
        rmse=rmse,
        cv_rmse=float(fitted.cv_rmse) if is_fitted else rmse,
        max_residual=float(np.abs(residual).max()),
        max_width=loop.max_width,
        max_width_at=loop.max_width_at,
        area=loop.area,
        width_rmse=metrics.width_rmse(measured, loop),
        fpe=metrics.fpe(residual, n_parameters) if is_fitted else math.nan,
        y=y,
        loop=loop,
    )


def _is_family(subject: Any) -> bool:
    """Whether the subject is a class or a structure, and still to be identified."""
    return isinstance(subject, type) or not (hasattr(subject, "response") or hasattr(subject, "model"))


def _rounded(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def _exact(value: float, digits: int) -> str:
    return "" if math.isnan(value) else repr(float(value))
