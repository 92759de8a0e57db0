"""The report: one self-contained page, figures inline, no script, nothing loaded from elsewhere."""

import math
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import NamedTuple

from hysim.identification import Identification
from hysim.metrics import loop_metrics
from hysim.paper.chapters.camera import needed
from hysim.paper.chapters.claims import claims_chapter, counts
from hysim.paper.chapters.control import control_chapter, definitions
from hysim.paper.chapters.linear import dwell_chapter, identification_section
from hysim.paper.chapters.preference import preference_chapter
from hysim.paper.equations import EQUATION_1, EQUATION_7
from hysim.paper.findings import Findings
from hysim.paper.markup import Drawn, complex_number, equation, figure, folded, heading, number, paragraph, ratio, table
from hysim.paper.nested import nested_errors, of_discovered
from hysim.paper.preference import preference
from hysim.paper.study import Study, cross_validated

_OPEN = ("claims", "control", "measured")
TITLE = "A piezo stack's 52 points, reproduced"


class Chapter(NamedTuple):
    """A heading and the markup under it."""

    anchor: str
    title: str
    body: str


def report_page(findings: Findings, drawn: Drawn) -> str:
    """The whole page."""
    study = findings.study
    chapters = [
        Chapter("claims", "The paper's claims", claims_chapter(findings.claims)),
        Chapter("control", "Control", control_chapter(findings.loops, findings.cameras, findings.periods, drawn)),
        Chapter("measured", "What was measured", _measured(study, drawn)),
        Chapter("models", "All models side by side", _models(study, drawn)),
        Chapter("linear", "The paper's linear models", _linear(findings, drawn)),
        Chapter("bouc-wen", "The Bouc-Wen models", _bouc_wen(study)),
        Chapter("discovered", "The discovered law", _discovered(study, drawn)),
        Chapter("preferred", "Which model the points prefer", preference_chapter(drawn)),
        Chapter("dwell", "Loop width against dwell", dwell_chapter(findings.dwell, drawn)),
        Chapter("definitions", "How the numbers are defined", _definitions()),
    ]
    template = Template(files("hysim.paper").joinpath("report.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=TITLE,
        lead=_lead(findings, drawn),
        chapters="\n".join(f'<li><a href="#{c.anchor}">{escape(c.title)}</a></li>' for c in chapters),
        body="\n".join(
            f'<section id="{c.anchor}">\n<h2>{k}. {escape(c.title)}</h2>\n{_shown(c)}\n</section>'
            for k, c in enumerate(chapters, 1)
        ),
    )


def _shown(chapter: Chapter) -> str:
    """A chapter's body; that of a chapter of details is folded."""
    return chapter.body if chapter.anchor in _OPEN else folded("Show", chapter.body)


def _lead(findings: Findings, drawn: Drawn) -> str:
    comparison, loop = findings.study.comparison, findings.study.comparison.loop
    linear, single = comparison["eq1-printed"], comparison["single-valued"]
    law, sindy = comparison["bouc-wen-asymmetric"], comparison["sindy"]
    return (
        paragraph(
            "Table 1 of B. B. Muhammad, M. H. Rahman, M. R. Ahmad and M. Bashir, “A novel model of PZT actuator and "
            "its application in hysteresis and vibration controls”, Jurnal Teknologi (2016), recomputed by hysim.",
            "source",
        )
        + figure(
            drawn["opening"],
            f"Table 1, the linear model that the paper prints, and a Bouc-Wen law with {law.n_parameters} parameters.",
        )
        + paragraph(_answers(findings))
        + paragraph(f"The paper's {len(findings.claims)} claims: {counts(findings.claims)}.")
        + paragraph(
            f"The measured loop is {loop.max_width:.3f} µm wide at {loop.max_width_at:g} V. The linear model that the "
            f"paper prints fits the points to {linear.fit_percent:.2f} %, and no curve that gives one displacement for "
            f"each voltage can do better than {single.fit_percent:.2f} %: what is missing is memory. With it, a "
            f"Bouc-Wen law with {law.n_parameters} parameters fits to {law.fit_percent:.2f} % and opens "
            f"{law.max_width:.3f} µm; a law that SINDy discovers fits to {sindy.fit_percent:.2f} % and opens "
            f"{sindy.max_width:.3f} µm. {preference()}"
        )
    )


def _answers(findings: Findings) -> str:
    """90 % and 97 %, in a sentence each."""
    value = {claim.id: claim.recomputed for claim in findings.claims}
    lag = value["hysteresis-90-eq1"]
    return (
        f"Hysteresis reduced by 90 %: a PID reaches {value['hysteresis-90-bouc-wen']:.1f} % on a law that has memory, "
        f"with an ideal sensor and a triangle of 52 s, and {lag:.1f} % on the paper's own model, which has only lag; "
        f"{needed('bouc-wen+eq7', findings.cameras)} "
        f"Vibration reduced to 97 %: a PID takes at least {value['vibration-97-all-three-eq4']:.1f} % of overshoot, "
        f"residual and settling time on (4), with an ideal sensor; {needed('eq4', findings.cameras)}"
    )


def _measured(study: Study, drawn: Drawn) -> str:
    record, loop = study.comparison.record, study.comparison.loop
    quantum = record.resolution or math.nan
    rows = [
        ["points", str(len(record))],
        ["stroke", f"{loop.stroke:.3f} µm"],
        ["resolution, one camera pixel", f"{quantum:.4f} µm"],
        ["largest loop width", f"{loop.max_width:.3f} µm at {loop.max_width_at:g} V"],
        ["the same, of the stroke", f"{100 * loop.relative_width:.1f} %"],
        ["mean loop width", f"{loop.mean_width:.4f} µm"],
        ["loop area", f"{loop.area:.2f} µm V"],
        ["orientation", loop.orientation],
    ]
    return (
        table(["measure of Table 1", "value"], rows)
        + figure(
            drawn["figure3"],
            "The paper's Figure 3, regenerated: in words, output and input of the experiment against time. Ours shows "
            "Table 1 with one second for each voltage; the paper prints no time, and no rate-independent result "
            "depends on it.",
        )
        + figure(
            drawn["figure4"],
            "The paper's Figure 4, regenerated: in words, the actuator's hysteresis and its nonlinearity. Ours shows "
            "both, and that every displacement is a whole number of pixels; one pixel is "
            f"{100 * quantum / loop.max_width:.0f} % of the loop's width.",
        )
    )


def _models(study: Study, drawn: Drawn) -> str:
    quantum = study.comparison.record.resolution or math.nan
    header = [
        "model", "parameters", "fit [%]", "rmse [µm]", "leave-one-out rmse [µm]", "largest residual [pixels]",
        "largest width [µm]", "at [V]", "area [µm V]", "rms error of the width [µm]",
    ]  # fmt: skip
    rows = [
        [
            row.name, str(row.n_parameters), f"{row.fit_percent:.2f}", f"{row.rmse:.4f}",
            number(cross_validated(row), 4), f"{row.max_residual / quantum:.2f}", f"{row.max_width:.3f}",
            f"{row.max_width_at:g}", f"{row.area:.2f}", f"{row.width_rmse:.4f}",
        ]
        for row in study.comparison.rows
    ]  # fmt: skip
    measured = study.comparison.loop
    best = [
        "measured", *[""] * 5, f"{measured.max_width:.3f}", f"{measured.max_width_at:g}", f"{measured.area:.2f}", "",
    ]  # fmt: skip
    return (
        paragraph(
            "Every model is simulated in free run over the 52 voltages and judged by the same measures. "
            "“Single-valued” is the best possible curve that gives one displacement for each voltage: a model that "
            "does not beat it has learnt nothing about hysteresis. The printed model has one parameter "
            "fitted here, the dwell."
        )
        + table(header, [best, *rows])
        + figure(drawn["loops"], "Each model's loop over the measured points.")
        + figure(drawn["widths"], "Loop width, unloading minus loading at the same voltage, measured and modelled.")
        + figure(
            drawn["residuals"],
            "Residuals, measured minus model, in camera pixels. Rounding to whole pixels alone leaves half a pixel "
            "either way.",
        )
    )


def _linear(findings: Findings, drawn: Drawn) -> str:
    study = findings.study
    printed, fit = study.comparison["eq1-printed"], study.fits["tf-identified"]
    poles = ", ".join(complex_number(pole) for pole in fit.model.poles)
    return (
        paragraph("Equation (1) as printed, in seconds:")
        + equation(f"G(s) = {ratio(EQUATION_1.num, EQUATION_1.den)}")
        + paragraph(
            f"With the voltage held for each dwell, the displacement taken at its start and the plant at rest before, "
            f"the best dwell is {study.printed.dwell:.2f} s and the fit {printed.fit_percent:.2f} %; the paper states "
            f"91.5 %. A model of the same structure identified anew, at one second for each voltage, reaches "
            f"{fit.fit_percent:.2f} % with a final prediction error of {fit.fpe:.6f} (the paper states 0.00587):"
        )
        + equation(f"G(s) = {ratio(fit.model.num, fit.model.den)}\npoles {poles} rad/s")
        + paragraph(
            "So the paper's figures are about what a four-pole model identified on Table 1 reaches; the coefficients "
            "it prints do not reach them at any dwell. Either loop is phase lag, not memory: read at the end of each "
            "dwell, it closes when the dwell is long."
        )
        + figure(
            drawn["figure5"],
            "The paper's Figure 5, regenerated: response to a step of one volt of Equation (1) and of the second-order "
            f"model (7), (8), G(s) = {ratio(EQUATION_7.num, EQUATION_7.den)}. In words, the paper's shows an actual "
            "and an estimated response, called similar; these two overshoot alike and fit each other to "
            f"{findings.approximations[0].fit_percent:.0f} %.",
        )
        + _equations(findings)
        + identification_section(findings.reidentification, drawn)
    )


def _equations(findings: Findings) -> str:
    header = [
        "equation", "poles", "zeros", "static gain [µm/V]", "natural frequencies", "damping ratios", "overshoot [%]",
    ]  # fmt: skip
    rows = [
        [
            name, _roots(facts.poles), _roots(facts.zeros), f"{facts.dc_gain:.5f}",
            _distinct(facts.natural_frequencies), _distinct(facts.damping_ratios), f"{facts.overshoot_percent:.1f}",
        ]
        for name, facts in findings.equations.items()
    ]  # fmt: skip
    pairs = [
        f"{pair.name} fits the step response of {pair.of} to {pair.fit_percent:.0f} %; a second-order model with the "
        f"final value, the overshoot and the peak time of {pair.of} would fit it to {pair.matched_fit_percent:.0f} %."
        for pair in findings.approximations
    ]
    return (
        heading("The transfer functions")
        + paragraph("As printed, in the paper's own units of time; of each pair of conjugate poles one is shown.")
        + table(header, rows)
        + paragraph(f"{' '.join(pairs)} (13) prints 2.430 where (6) has 0.243, and so is another plant.")
    )


def _roots(values: Sequence[complex]) -> str:
    return ", ".join(complex_number(value) for value in values if value.imag >= 0.0) or "–"


def _distinct(values: Sequence[float]) -> str:
    return ", ".join(dict.fromkeys(f"{value:.4g}" for value in values))


def _bouc_wen(study: Study) -> str:
    plain, asymmetric = study.fits["bouc-wen"], study.fits["bouc-wen-asymmetric"]
    u = study.comparison.record.u
    rivals = "".join(
        f" Another optimum, {rival.fit_percent:.2f} %, is within the noise: n = {rival.estimates['n']:.3g}, "
        f"β = {rival.estimates['beta']:.3g}, γ = {rival.estimates['gamma']:.3g}, with a loop of "
        f"{loop_metrics(u, rival.model.response(u)).max_width:.3f} µm."
        for rival in plain.rivals
    )
    return (
        equation(
            "dz/du = A - |z|^n (gamma + beta sign(z du))\n"
            "bouc-wen:             y = offset + feedthrough u + gain z\n"
            "bouc-wen-asymmetric:  y = offset + c1 u + c2 u^2 + gain z,  n = 1"
        )
        + paragraph(
            f"Symmetric: {plain.fit_percent:.2f} % with {plain.n_parameters} parameters.{_admissible(plain)}{rivals}"
        )
        + _parameters(plain)
        + paragraph(
            f"With a quadratic input: {asymmetric.fit_percent:.2f} % with {asymmetric.n_parameters} parameters. "
            "The measured loop is wider at low voltage than at high; the quadratic term lets the model follow that."
            f"{_admissible(asymmetric)}"
        )
        + _parameters(asymmetric)
    )


def _admissible(fit: Identification) -> str:
    """Whether a law is safe on smaller cycles, and the fit of the best admissible one where that is another."""
    other = fit.regions.get("admissible")
    unsafe = " It follows this loop, and runs away on smaller ones." if fit.unsafe else ""
    inside = " The best law with −β ≤ γ ≤ β, which creates no energy whatever the input, fits to "
    return unsafe + ("" if other is None else f"{inside}{other.fit_percent:.2f} %.")


def _discovered(study: Study, drawn: Drawn) -> str:
    law, row = study.discovery, study.comparison["sindy"]
    starts = law.initial_states[0] or {"y": 0.0}
    return (
        paragraph(
            "PySINDy regresses the slope of each branch on terms u′ uⁱ yʲ and |u′| uⁱ yʲ; the structures along its "
            "path of thresholds are refitted by their error in free run, and so are those of the whole library that "
            "the free run, linearised about the best of them, predicts to be best, with y held at 0 at the first point "
            "and with it free. Of those that the BIC cannot tell from the best, the one of fewest numbers is kept: "
            f"{len(law.coefficients)} terms and {law.n_parameters} parameters, {row.fit_percent:.2f} % in free run."
        )
        + equation("\n".join([law.equation, *(f"{name}(0) = {value:.6g} µm" for name, value in starts.items())]))
        + table(["term", "coefficient"], [[term, f"{value:.6g}"] for term, value in law.coefficients.items()])
        + paragraph(
            f"Verdict: {law.verdict}. On a record at one rate a lag and a hysteresis can give the same loop; only a "
            "second rate could tell them apart."
        )
        + figure(drawn["discovery"], "The path of thresholds: number of terms against the quality in free run.")
        + _nested()
    )


def _nested() -> str:
    discovered, rows = of_discovered(), nested_errors()
    honest = [each for each in rows if not each.terms_kept]
    near = sum(each.behind < 2.0 for each in honest)
    header = ["model", "memory begins", "parameters", "fit [%]", "left-out rmse [µm]", "standard errors behind"]
    return (
        heading("With the search inside the loop")
        + paragraph(
            "A left-out error is honest where nothing was chosen with the point. So each of the "
            f"{discovered.folds} points between the first and the last is taken out in turn, and the whole search or "
            f"identification runs on the others. The discovered law then errs by {discovered.left_out_rmse:.4f} µm at "
            f"the point left out, and has the terms above in {discovered.same_structure} of {discovered.folds} "
            "searches. "
            f"{near} rows lie within two standard errors of the least error: the points do not tell which of them "
            "predicts better. “Duhem, 5 terms” keeps the terms above, which the points left out have helped to choose, "
            "and stands outside that order. These figures are stored, from experiments/33_nested_table1.py."
        )
        + table(
            header,
            [
                [
                    each.model, each.start or "–", str(each.n_parameters), f"{each.fit_percent:.2f}",
                    f"{each.left_out_rmse:.4f}", f"{each.behind:.1f}",
                ]
                for each in rows
            ],
        )
    )  # fmt: skip


def _definitions() -> str:
    items = [
        "fit = 100 (1 − ‖y − ŷ‖ / ‖y − mean(y)‖) %, ŷ in free run from the voltage alone.",
        "loop width w(u) = displacement when unloading minus displacement when loading, at the same voltage; its "
        "largest magnitude, and the voltage of that (the lowest, if several).",
        "area by the shoelace formula along the cycle; mean width = area / span of the voltage.",
        "leave-one-out rmse: each displacement in turn is kept from the fit, all voltages are kept, and the errors at "
        "the points left out are collected. For the discovered law the whole search is repeated without the "
        "point, for each of the 50 between the first and the last; this figure is stored.",
        "FPE = V (1 + d/N) / (1 − d/N), V the mean squared residual, N points, d parameters.",
        *definitions(),
    ]
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>"


def _parameters(fit: Identification) -> str:
    rows = [
        [name, f"{value:.6g}", number(fit.stderr.get(name, math.nan), 2, "g") if name in fit.stderr else "held"]
        for name, value in fit.estimates.items()
    ]
    return table(["parameter", "value", "standard error"], rows) + paragraph(f"Search: {fit.message}.", "source")
