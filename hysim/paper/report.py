"""The report: one self-contained page, figures inline, no script, nothing loaded from elsewhere.

The text is `report.html`, the columns of the tables are `tables.toml`; the fields of both are filled from the summary
and from what was computed. A line of the text that is indented continues the one before.
"""

import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Formatter
from typing import Any

from hysim.datasets import PIXEL
from hysim.identification import Identification
from hysim.metrics import loop_metrics
from hysim.paper.camera import PERIODS, TARGETS, TRIALS, CameraLoop, needed, with_own_camera
from hysim.paper.claims import RULES, VERDICTS, Claim, as_text
from hysim.paper.equations import EQUATION_1, EQUATION_4, EQUATION_6, EQUATION_7, Characteristics
from hysim.paper.findings import Findings
from hysim.paper.loops import ABOUT_34_V, GAINS, SAMPLE_TIME, SUPPLY, Case
from hysim.paper.preference import beside_nested, nested_errors, of_discovered
from hysim.plants.transfer_function import TransferFunction

_PLANTS = {"bouc-wen+eq7": "Bouc-Wen and (7)", "eq1": "(1)", "eq4": "(4)", "eq6": "(6)"}
_PLURAL = {"agrees": "agree", "differs": "differ"}
_NOT_HELD = {"foh": {"input": "linear", "taken": "the sample"}}
_MICRO = re.compile(r"\bum\b")

Row = Mapping[str, Any]


class Markup(str):
    """Text that is markup already."""


class _Fields(Formatter):
    """Fills the fields of a text: texts are escaped, and a dash stands for a number that does not exist."""

    def format_field(self, value: Any, spec: str) -> str:
        if isinstance(value, str):
            return value if isinstance(value, Markup) else escape(value)
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return "–"
        return escape(format(value, spec))

    def filled(self, text: str, fields: Row) -> Markup:
        return Markup(self.vformat(text, (), fields))


def report_page(findings: Findings, summary: Mapping[str, Any], drawn: Mapping[str, str]) -> str:
    """The whole page, from the findings, the contents of `summary.json`, and drawings by their names."""
    study, loop, discovery = findings.study, findings.study.comparison.loop, findings.study.discovery
    numbers = Counter(claim.verdict for claim in findings.claims)
    reductions = [row["reduction_percent"] for row in findings.periods if row["sample_time_s"] == SAMPLE_TIME]
    starts = discovery.initial_states[0] or {"y": 0.0}
    fields = {
        **vars(findings),
        **summary,
        "style": Markup(_file("report.css")),
        "figures": {name: Markup(svg) for name, svg in drawn.items()},
        "tables": _tables(findings, summary),
        "n_claims": len(findings.claims),
        "claimed": {claim.id: {"here": claim.recomputed, "badge": _badge(claim.verdict)} for claim in findings.claims},
        "with_camera": {plant: _with_camera(plant, findings.cameras) for plant in TARGETS},
        "verdicts": {name: _badge(name, f"{numbers[name]} {_PLURAL.get(name, name)}") for name in VERDICTS},
        "learned": {plant: _with_camera(plant, findings.learned) for plant in TARGETS},
        "n_trials": TRIALS,
        "needed": {plant: needed(plant, findings.cameras) for plant in TARGETS},
        "lag_loop": next(row for row in summary["control"]["hysteresis"] if row["plant"] == "eq1"),
        "periods": PERIODS,
        "least_reduction": min(reductions),
        "largest_reduction": max(reductions),
        "loop_of_stroke_percent": 100 * loop.relative_width,
        "pixel_of_loop_percent": 100 * (study.comparison.record.resolution or math.nan) / loop.max_width,
        "equation1": _ratio(EQUATION_1),
        "equation7": _ratio(EQUATION_7),
        "identified": _ratio(study.fits["tf-identified"].model),
        "identified_poles": ", ".join(map(_complex, study.fits["tf-identified"].model.poles)),
        "period4": _period(EQUATION_4),
        "period6": _period(EQUATION_6),
        "safety": {name: _safety(fit) for name, fit in study.fits.items()},
        "rivals": _rivals(study.fits["bouc-wen"], study.comparison.record.u),
        "n_terms": len(discovery.coefficients),
        "discovered": "\n".join(
            [discovery.equation, *(f"{name}(0) = {value:.6g} µm" for name, value in starts.items())]
        ),
        "left_out": of_discovered(),
        "n_near": sum(each.behind < 2.0 for each in nested_errors() if not each.terms_kept),
        "beside_nested": beside_nested(),
    }
    return _Fields().filled(re.sub(r"\n +", " ", _file("report.html")), fields)


def _file(name: str) -> str:
    return files("hysim.paper").joinpath(name).read_text(encoding="utf-8")


def _tables(findings: Findings, summary: Mapping[str, Any]) -> dict[str, Markup]:
    """Every table by its name in the text."""
    columns = tomllib.loads(_file("tables.toml"))
    columns |= dict.fromkeys(VERDICTS, columns["claims"])
    loops, control, study = findings.loops, summary["control"], findings.study
    measured = {key: summary["table1"][key] for key in ("max_width_um", "max_width_at_V", "area_um_V")}
    models = [{"model": name, **row} for name, row in summary["models"].items()]
    rows: dict[str, Iterable[Row]] = {
        "triangles": [_loop_row(row) for row in control["hysteresis"]],
        "steps": [_loop_row(row) for row in control["vibration"] if row["reference"].startswith("step")],
        "squares": [_loop_row(row) for row in control["vibration"] if row["reference"].startswith("square")],
        "cameras": [
            {**row, "plant": _PLANTS[row["plant"]], "quantum_px": row["quantum_um"] / PIXEL}
            for row in control["camera"]
        ],
        "models": [dict.fromkeys(models[0], "") | {"model": "measured", **measured}, *models],
        "equations": [_equation_row(name, facts) for name, facts in findings.equations.items()],
        "refits": [
            {**fit._asdict(), **_NOT_HELD.get(fit.hold, {"input": "held", "taken": f"{fit.sample} of the hold"})}
            for fit in findings.reidentification.hysteresis
        ],
        "printed_choices": [fit._asdict() for fit in findings.reidentification.printed],
        "time_units": map(vars, findings.reidentification.time_units),
        "terms": [{"name": name, "value": value} for name, value in study.discovery.coefficients.items()],
        "nested": [{**each._asdict(), "start": each.start or None} for each in nested_errors()],
        "evidence": [_evidence_row(name, row) for name, row in summary["evidence"]["models"].items()],
        "dwell": findings.dwell,
        **{verdict: [_claim_row(each) for each in findings.claims if each.verdict == verdict] for verdict in VERDICTS},
    }
    return {name: _table(columns[name], each) for name, each in rows.items()} | {
        "hysteresis_gains": _table(columns["gains"], _gains(loops.hysteresis)),
        "step_gains": _table(columns["gains"], _gains(loops.steps)),
        **{name: _table(columns["parameters"], _parameters(fit)) for name, fit in study.fits.items()},
    }


def _table(columns: Mapping[str, str], rows: Iterable[Row]) -> Markup:
    """A table in a box that scrolls."""
    head = "".join(f"<th>{escape(heading)}</th>" for heading in columns)
    cells = "".join(f"<td>{cell}</td>" for cell in columns.values())
    body = "\n".join(_Fields().filled(f"<tr>{cells}</tr>", row) for row in rows)
    opening = '<div class="scroll"><table>'
    return Markup(f"{opening}\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>")


def _loop_row(row: Row) -> Row:
    """A closed loop of the summary with texts for its table."""
    size = row["reference"].split(",")[0].removeprefix("triangle ").removeprefix("step ").removesuffix(" um")
    is_lag = row["plant"] == "eq1"
    reduction = row.get("lag_reduction_percent" if is_lag else "hysteresis_reduction_percent", math.nan)
    return {
        **row,
        "plant": _PLANTS[row["plant"]],
        "limits": _volts(row["limits"]),
        "size": size,
        "reduction": f"{reduction:.1f}{' (lag)' if is_lag else ''}",
    }


def _gains(cases: Sequence[Case[Any]]) -> list[Row]:
    """The controllers, one for each search."""
    found = {case.found.controller: case for case in cases}
    return [
        {
            "plant": _PLANTS[case.plant],
            "limits": _volts(pid.limits or ()),
            **{name: vars(pid)[name] for name in GAINS},
            "search": "from its stored optimum" if case.found.is_stored else "full",
            "controllers": case.found.controllers,
            "simulations": case.found.simulations,
        }
        for pid, case in found.items()
    ]


def _volts(limits: Iterable[Any]) -> str:
    return {SUPPLY: "0 to 125", ABOUT_34_V: "±16 about 34"}.get(tuple(limits), "unlimited")


def _parameters(fit: Identification) -> list[Row]:
    return [
        {"name": name, "value": value, "stderr": fit.stderr.get(name, "held")} for name, value in fit.estimates.items()
    ]


def _equation_row(name: str, facts: Characteristics) -> Row:
    """One root of each conjugate pair, without repetitions."""
    roots = {
        key: ", ".join(_complex(root) for root in values if root.imag >= 0.0) or None
        for key, values in (("poles", facts.poles), ("zeros", facts.zeros))
    }
    numbers = {
        key: ", ".join(dict.fromkeys(f"{value:.4g}" for value in vars(facts)[key]))
        for key in ("natural_frequencies", "damping_ratios")
    }
    return {**vars(facts), "name": name, **roots, **numbers}


def _evidence_row(name: str, row: Row) -> Row:
    nested = row["nested_sampling"]
    return {**row, "model": name, "nested": f"{nested[0]:.2f} ± {nested[1]:.2f}" if nested else None}


def _claim_row(claim: Claim) -> Row:
    """A claim with texts for its table."""
    here = f"{claim.recomputed:.5g}" if isinstance(claim.recomputed, float) else claim.recomputed
    values = {"paper": claim.printed, "here": here}
    unit = f" {claim.unit}" if claim.unit else ""
    method = "" if claim.recomputed is None else f"{claim.method[:1].upper()}{claim.method[1:]}."
    texts = {
        **vars(claim),
        **{name: "–" if value is None else f"{as_text(value)}{unit}" for name, value in values.items()},
        "how": f"{method} {claim.note}".strip(),
    }
    plain = {name: _MICRO.sub("µm", str(text)).replace("^2", "²") for name, text in texts.items()}
    return plain | {"badge": _badge(claim.verdict)}


def _badge(verdict: str, text: str = "") -> Markup:
    return Markup(f'<span class="verdict {verdict.replace(" ", "-")}">{text or verdict}</span>')


def _with_camera(plant: str, cameras: Sequence[CameraLoop]) -> Row:
    """The best reduction with the paper's own camera [%], and whether it reaches the paper's figure."""
    best = with_own_camera(plant, cameras)
    reduction = math.nan if best is None else best.true_reduction_percent
    return {"here": reduction, "badge": _badge(RULES["reach"][not reduction >= TARGETS[plant][1]])}


def _rivals(fit: Identification, u: Any) -> str:
    """The optima that the noise does not part from the best."""
    return "".join(
        f" Another optimum, {rival.fit_percent:.2f} %, is within the noise: n = {rival.estimates['n']:.3g}, "
        f"β = {rival.estimates['beta']:.3g}, γ = {rival.estimates['gamma']:.3g}, with a loop of "
        f"{loop_metrics(u, rival.model.response(u)).max_width:.3f} µm."
        for rival in fit.rivals
    )


def _safety(fit: Identification) -> str:
    """Whether a law is safe on smaller cycles, and the fit of the best admissible one where that is another."""
    other = fit.regions.get("admissible")
    unsafe = " It follows this loop, and runs away on smaller ones." if fit.unsafe else ""
    inside = " The best law with −β ≤ γ ≤ β, which creates no energy whatever the input, fits to "
    return unsafe + ("" if other is None else f"{inside}{other.fit_percent:.2f} %.")


def _period(model: TransferFunction) -> float:
    """Period of the oscillation [unit of time]."""
    return 2.0 * math.pi / float(model.poles.imag.max())


def _ratio(model: TransferFunction) -> str:
    return f"({_polynomial(model.num)}) / ({_polynomial(model.den)})"


def _polynomial(coefficients: Sequence[float]) -> str:
    text = ""
    for power, c in zip(range(len(coefficients) - 1, -1, -1), coefficients, strict=True):
        factor = "s" if power == 1 else f"s^{power}" if power else ""
        size = "" if abs(c) == 1.0 and factor else f"{abs(c):.4g}"
        text += (" - " if c < 0 else " + " if text else "") + " ".join(part for part in (size, factor) if part)
    return text.strip()


def _complex(value: complex) -> str:
    if value.imag == 0.0:
        return f"{value.real:.3f}"
    return f"{value.real:.3f} {'+' if value.imag > 0 else '-'} {abs(value.imag):.3f}i"
