"""`reproduce`: the report, its figures and tables, and the summary that is read from outside.

Everything is computed first and written last, each file beside its place and then renamed: a folder holds
whole files only. Same input, same bytes: no dates, no timings, one way of writing a number.
"""

import csv
import io
import json
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hysim._atomic import write_text
from hysim._frozen import frozen
from hysim.paper import figures
from hysim.paper.equations import EQUATION_1, EQUATION_7, step_response
from hysim.paper.report import report_page
from hysim.paper.study import Progress, Study, model_measures, study
from hysim.plot import to_svg


@frozen
class Reproduction:
    """What `reproduce` wrote.

    Parameters
    ----------
    folder : Path
        Where it wrote.
    files : tuple of str
        The files, relative to the folder.
    study : Study
        What was computed.
    """

    folder: Path
    files: tuple[str, ...]
    study: Study


def reproduce(
    out: str | Path = "reproduction", *, quick: bool = False, progress: Progress | None = None
) -> Reproduction:
    """Reproduce the paper on its 52 points, and write the report.

    Parameters
    ----------
    out : path
        Folder to write into; it is made if it does not exist, and files of the same names are replaced.
    quick : bool
        Leave the cross-validation out.
    progress : callable, optional
        Called as ``progress(done, total, what)``.

    Returns
    -------
    Reproduction

    Raises
    ------
    OSError
        If the folder cannot be made or written to; this is tried before anything is computed.
    """
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass
    computed = study(quick=quick, progress=progress)
    files = contents(computed)
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        write_text(path, text)
    return Reproduction(folder=folder, files=tuple(files), study=computed)


def contents(computed: Study) -> dict[str, str]:
    """Every file's text by its name relative to the folder."""
    drawn = {name: to_svg(figure, name=name) for name, figure in _figures(computed).items()}
    summary = _summary(computed)
    return {
        **{f"figures/{name}.svg": svg for name, svg in drawn.items()},
        **_tables(computed),
        "summary.json": json.dumps(_rounded(summary), indent=2, allow_nan=False) + "\n",
        "report.html": report_page(computed, drawn),
    }


def _figures(computed: Study) -> dict[str, Any]:
    comparison = computed.comparison
    steps = {"Eq. (1)": step_response(EQUATION_1), "Eqs. (7), (8)": step_response(EQUATION_7)}
    return {
        "figure3": figures.figure3(comparison.record),
        "figure4": figures.figure4(comparison.record),
        "figure5": figures.figure5(steps),
        "loops": figures.model_loops(comparison),
        "widths": figures.model_widths(comparison),
        "residuals": figures.model_residuals(comparison),
        "discovery": figures.discovery_path(computed.discovery),
    }


def _summary(computed: Study) -> dict[str, Any]:
    record, loop = computed.comparison.record, computed.comparison.loop
    return {
        "table1": {
            "n": len(record),
            "stroke_um": loop.stroke,
            "resolution_um": record.resolution,
            "max_width_um": loop.max_width,
            "max_width_at_V": loop.max_width_at,
            "mean_width_um": loop.mean_width,
            "area_um_V": loop.area,
        },
        "models": model_measures(computed),
        "claims": [],
        "control": {},
        "dwell": [],
    }


def _tables(computed: Study) -> dict[str, str]:
    comparison = computed.comparison
    record, rows = comparison.record, comparison.rows
    header = ["voltage [V]", "measured [um]", *(f"{row.name} [um]" for row in rows)]
    outputs = [header, *np.column_stack([record.u, record.y, *(row.y for row in rows)]).tolist()]
    levels = comparison.loop.u
    modelled = [row.loop.width_at(levels) for row in rows]
    widths = [header, *np.column_stack([levels, comparison.loop.width, *modelled]).tolist()]
    measures = model_measures(computed)
    keys = list(dict.fromkeys(key for row in measures.values() for key in row))
    models = [["model", *keys], *([name, *(row.get(key) for key in keys)] for name, row in measures.items())]
    parameters: list[list[Any]] = [["model", "parameter", "value", "standard error"]]
    for name, fit in computed.fits.items():
        parameters += [[name, key, value, fit.stderr.get(key)] for key, value in fit.estimates.items()]
    found = {**computed.discovery.coefficients, "y0": computed.discovery.model.y0}
    parameters += [["sindy", term, value, None] for term, value in found.items()]
    named = {"models": models, "outputs": outputs, "widths": widths, "parameters": parameters}
    return {f"tables/{name}.csv": _csv(table) for name, table in named.items()}


def _csv(table: Sequence[Sequence[Any]]) -> str:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows([[_cell(value) for value in row] for row in table])
    return buffer.getvalue()


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return value if isinstance(value, str) else str(_rounded(value))


def _rounded(value: Any) -> Any:
    """Floats to 9 significant digits, beyond which rounding in other libraries begins to show; nan to None."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    if isinstance(value, float):
        return None if math.isnan(value) else float(f"{value:.9g}") + 0.0
    return value
