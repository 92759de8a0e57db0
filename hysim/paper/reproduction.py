"""`reproduce`: the report, its figures and tables, and the summary that is read from outside.

Everything is computed first and written last, each file beside its place and then renamed: a folder holds
whole files only. Same input, same bytes: no dates, no timings, one way of writing a number.
"""

import json
import math
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hysim._basics.atomic import write_all
from hysim._basics.blas import one_blas_thread
from hysim._basics.frozen import frozen
from hysim._basics.parallel import awaited, forked
from hysim._basics.printing import csv_text
from hysim._basics.progress import reports
from hysim.datasets import table2
from hysim.paper import figures
from hysim.paper.camera import camera_rows
from hysim.paper.equations import EQUATION_1, EQUATION_4, EQUATION_6, EQUATION_7, step_response
from hysim.paper.findings import Findings, find
from hysim.paper.loops import control_measures
from hysim.paper.preference import preference_measures, preference_rows, stored_evidence
from hysim.paper.report import report_page
from hysim.paper.search import as_stored
from hysim.paper.study import Progress, Study, model_measures
from hysim.plot import Figure, to_svg


@frozen
class Reproduction:
    """Result of `reproduce`.

    Parameters
    ----------
    folder : Path
        Folder of the files.
    files : tuple of str
        The files, relative to the folder.
    findings : Findings
        What was computed.
    """

    folder: Path
    files: tuple[str, ...]
    findings: Findings

    def __str__(self) -> str:
        return "\n".join([*_lines(self.findings), f"report: {self.folder / 'report.html'}"])


def _lines(findings: Findings) -> Iterator[str]:
    study, claims, comparison = findings.study, findings.claims, findings.study.comparison
    yield f"Table 1: {len(comparison.record)} points. {comparison.loop.to_text(comparison.record.units)}"
    yield comparison.to_text()
    for name, fit in study.fits.items():
        for region, best in fit.regions.items():
            yield f"{name}: the best {region} law fits {best.fit_percent:.2f} %"
    yield f"sindy: {study.discovery.equation}  ({study.discovery.verdict})"
    counts = Counter(claim.verdict for claim in claims)
    yield f"{len(claims)} claims: " + ", ".join(f"{number} {verdict}" for verdict, number in counts.most_common())
    for claim in claims:
        if claim.id.startswith(("hysteresis-90", "vibration-97")):
            yield f"{claim.id}: {claim.recomputed:.1f} % where the paper says {claim.printed:g} %, {claim.verdict}"


@reports
def reproduce(
    out: str | Path = "reproduction",
    *,
    quick: bool = False,
    page: bool = False,
    thorough: bool = False,
    progress: Progress | Literal[False] | None = None,
) -> Reproduction:
    """Reproduce the paper on its 52 points, and write the report.

    Parameters
    ----------
    out : path
        Folder to write into; it is made if it does not exist, and files of the same names are replaced.
    quick : bool
        Leave the cross-validation out.
    page : bool
        Also write ``table1.html``: the identified Bouc-Wen law with sliders over the points, for a browser.
    thorough : bool
        Search all controllers without their stored optima, and also write ``optima.json``, in which later searches
        begin.
    progress : callable or False, optional
        Called as ``progress(done, total, what)``.
        By default calls beyond 2 s report on the standard error; False turns this off.

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
    with one_blas_thread():
        computed = find(quick=quick, thorough=thorough, progress=progress or None)
        files = contents(computed) | (browser_page(computed) if page else {})
        files |= {"optima.json": as_stored(computed.searches)} if thorough else {}
    for name in files:
        (folder / name).parent.mkdir(exist_ok=True)
    write_all({folder / name: text for name, text in files.items()})
    return Reproduction(folder=folder, files=tuple(files), findings=computed)


def contents(computed: Findings) -> dict[str, str]:
    """Every file's text by its name relative to the folder."""
    with forked(1) as beside:
        of_models = beside.submit(_model_drawings, computed.study)
        drawn = _paper_drawings(computed) | awaited(of_models)
    summary = _summary(computed)
    return {
        **{f"figures/{name}.svg": svg for name, svg in drawn.items()},
        **_tables(computed, summary),
        "summary.json": json.dumps(_rounded(summary), indent=2, allow_nan=False) + "\n",
        "report.html": report_page(computed, summary, drawn),
    }


def browser_page(computed: Findings) -> dict[str, str]:
    """The page of the identified Bouc-Wen law over the points of Table 1, by its name."""
    from hysim.export import Shown, page_text  # whose kernels no other file needs

    study = computed.study
    shown = Shown(study.fits["bouc-wen"].model)
    title = "Table 1 and the identified Bouc-Wen law"
    return {"table1.html": page_text({title: shown}, study.comparison.record)}


def _model_drawings(study: Study) -> dict[str, str]:
    comparison = study.comparison
    return _as_svg(
        {
            "figure3": figures.input_and_output(comparison.record),
            "figure4": figures.figure4(comparison.record),
            "opening": figures.opening(comparison),
            "loops": figures.model_loops(comparison),
            "widths": figures.model_widths(comparison),
            "residuals": figures.model_residuals(comparison),
            "discovery": figures.discovery_path(study.discovery),
        }
    )


def _paper_drawings(computed: Findings) -> dict[str, str]:
    loops = computed.loops
    steps = {"Eq. (1)": step_response(EQUATION_1), "Eqs. (7), (8)": step_response(EQUATION_7)}
    vibrations = {"Eq. (4)": step_response(EQUATION_4, 80.0), "Eq. (6)": step_response(EQUATION_6, 80.0)}
    step_on = {case.plant: case for case in reversed(loops.steps)}
    return _as_svg(
        {
            "figure5": figures.step_responses(steps, "s"),
            "figure9": figures.input_and_output(table2()),
            "figure10": figures.step_responses(vibrations, "samples"),
            "figure12": figures.step_figure(step_on["eq1"], 15.0, seconds=True),
            "figure13": figures.figure13([case for case in loops.squares if case.plant == "eq4"]),
            "figure14": figures.step_figure(step_on["eq4"], 60.0, seconds=False),
            "hysteresis": figures.hysteresis_figure(loops.hysteresis[0]),
            "dwell": figures.dwell_figure(computed.dwell),
            "camera": figures.camera_figure(computed.cameras),
            "periods": figures.periods_figure(computed.periods),
            "evidence": figures.evidence_figure(stored_evidence()),
        }
    )


def _as_svg(drawings: Mapping[str, Figure]) -> dict[str, str]:
    return {name: to_svg(figure, name=name) for name, figure in drawings.items()}


def _summary(computed: Findings) -> dict[str, Any]:
    record, loop = computed.study.comparison.record, computed.study.comparison.loop
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
        "models": model_measures(computed.study),
        "claims": [dict(vars(claim)) for claim in computed.claims],
        "control": {**control_measures(computed.loops), "camera": camera_rows([*computed.cameras, *computed.learned])},
        "dwell": computed.dwell,
        "evidence": preference_measures(),
    }


def _tables(computed: Findings, summary: dict[str, Any]) -> dict[str, str]:
    study, comparison = computed.study, computed.study.comparison
    record, rows = comparison.record, comparison.rows
    header = ["voltage [V]", "measured [um]", *(f"{row.name} [um]" for row in rows)]
    outputs = [header, *np.column_stack([record.u, record.y, *(row.y for row in rows)]).tolist()]
    levels = comparison.loop.u
    modelled = [row.loop.width_at(levels) for row in rows]
    widths = [header, *np.column_stack([levels, comparison.loop.width, *modelled]).tolist()]
    parameters: list[list[Any]] = [["model", "parameter", "value", "standard error"]]
    for name, fit in study.fits.items():
        parameters += [[name, key, value, fit.stderr.get(key)] for key, value in fit.estimates.items()]
    terms = {**study.discovery.coefficients, **study.discovery.initial_states[0]}
    parameters += [["sindy", term, value, None] for term, value in terms.items()]
    control = [row for name in ("hysteresis", "vibration") for row in summary["control"][name]]
    named = {
        "models": _by_columns([{"model": name, **row} for name, row in summary["models"].items()]),
        "outputs": outputs,
        "widths": widths,
        "parameters": parameters,
        "claims": _by_columns(summary["claims"]),
        "control": _by_columns([{key: value for key, value in row.items() if key != "conditions"} for row in control]),
        "camera": _by_columns(summary["control"]["camera"]),
        "periods": _by_columns(computed.periods),
        "dwell": _by_columns(summary["dwell"]),
        "evidence": _by_columns(preference_rows()),
    }
    return {
        f"tables/{name}.csv": csv_text([_cell(_rounded(value)) for value in row] for row in table)
        for name, table in named.items()
    }


def _by_columns(rows: Sequence[dict[str, Any]]) -> list[list[Any]]:
    """A header of every key, and the rows under it."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    return [keys, *([row.get(key) for key in keys] for row in rows)]


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return " to ".join(_cell(item) for item in value)
    return "" if value is None else str(value)


def _rounded(value: Any) -> Any:
    """Floats to 9 significant digits, beyond which rounding in other libraries begins to show; nan to None."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    if isinstance(value, float):
        return None if math.isnan(value) else float(f"{value:.9g}") + 0.0
    return value
