"""How does each parameter change a loop? Sliders for a law and its input; loop, minor loops and measures beside.

Needs the extra `notebook`. `marimo run experiments/loop_explorer.py` opens the page, `marimo edit` in place of `run`
shows the code under it, and as a plain script it works out the first picture and shows nothing.
"""

import marimo

__generated_with = "0.25.2"

app = marimo.App(width="full", app_title="Loop explorer")

with app.setup:
    import dataclasses
    import math
    import textwrap
    from types import SimpleNamespace

    import marimo as mo
    import numpy as np

    import hysim as hs

    SAMPLES = 200  # from one turn of the input to the next
    # Of each slider the lowest value, the highest, the step, and the value at the start.
    SLIDERS = {
        "Bouc-Wen": {
            "A": (0.1, 3.0, 0.1, 1.0),
            "beta": (-1.0, 3.0, 0.05, 0.6),
            "gamma": (-3.0, 3.0, 0.05, 0.2),
            "n": (0.5, 8.0, 0.1, 1.0),
            "feedthrough": (-1.0, 1.0, 0.05, 0.1),
            "gain": (-2.0, 2.0, 0.1, 1.0),
        },
        "Prandtl-Ishlinskii": {
            "plays": (1, 20, 1, 6),
            "largest threshold": (0.1, 3.0, 0.1, 1.2),
            "weight of the input": (-1.0, 2.0, 0.05, 0.3),
            "weight of all plays": (-2.0, 2.0, 0.1, 1.0),
        },
        "Dahl": {"stiffness": (0.1, 5.0, 0.1, 1.0), "coulomb": (0.1, 3.0, 0.1, 0.8)},
    }
    EQUATIONS = {
        "Bouc-Wen": r"z' = A u' - |z|^n (\gamma u' + \beta |u'| \operatorname{sign} z)",
        "Prandtl-Ishlinskii": r"y = w_0 u + \sum_i w_i \operatorname{play}_{r_i}(u)",
        "Dahl": r"F' = \mathrm{stiffness}\,(u' - |u'| F / \mathrm{coulomb})",
    }
    INPUT = {
        "amplitude": (0.1, 5.0, 0.1, 2.0),
        "offset": (-3.0, 3.0, 0.1, 0.0),
        "cycles": (1, 6, 1, 2),
        "minor loops": (0, 8, 1, 4),
    }


@app.function
def sliders(ranges):
    """One slider for each name."""
    return mo.ui.dictionary(
        {
            name: mo.ui.slider(low, high, step, value, label=name, show_value=True, full_width=True)
            for name, (low, high, step, value) in ranges.items()
        }
    )


@app.function
def law_of(family, values):
    """The law at which the sliders stand; the plays have thresholds in even steps and equal weights."""
    if family == "Bouc-Wen":
        return hs.BoucWen(**values)
    if family == "Dahl":
        return hs.Dahl(**values)
    plays = values["plays"]
    thresholds = np.linspace(0.0, values["largest threshold"], plays + 1).round(4)
    weights = np.round([values["weight of the input"], *[values["weight of all plays"] / plays] * plays], 4)
    return hs.PrandtlIshlinskii(thresholds=thresholds.tolist(), weights=weights.tolist())


@app.function
def turns_of(amplitude, offset, cycles, minor_loops):
    """Where the input turns: out from its middle, through whole cycles, then smaller ones in even steps."""
    smaller = amplitude * np.arange(minor_loops, 0, -1) / (minor_loops + 1)
    whole = [0.0, *[amplitude, -amplitude] * cycles, amplitude]
    return np.round(offset + np.append(whole, np.outer(smaller, [-1.0, 1.0])), 4)


@app.function
def input_of(turns):
    """Straight lines from turn to turn."""
    return np.interp(np.arange(SAMPLES * (len(turns) - 1) + 1) / SAMPLES, np.arange(len(turns)), turns)


@app.function
def picture(u, y, cycles):
    """The loop, and under it the input against the number of turns, as one SVG."""
    end = SAMPLES * (2 * cycles + 1)
    stretches = {"whole cycles": slice(0, end + 1), "minor loops": slice(end, None)}
    drawn = {name: stretch for name, stretch in stretches.items() if u[stretch].size > 1}
    turns = np.arange(u.size) / SAMPLES
    with hs.plot.house_style():
        canvas = hs.plot.figure(height=5.4)
        upper, lower = canvas.subplots(2, height_ratios=[5, 1])
        hs.plot.loop(*[SimpleNamespace(u=u[of], y=y[of], name=name) for name, of in drawn.items()], ax=upper)
        hs.plot.traces({name: (turns[of], u[of]) for name, of in drawn.items()}, lower)
        if lower.get_legend():
            lower.get_legend().remove()
        lower.set(xlabel="Turns", ylabel="Input", xticks=range(0, len(turns) // SAMPLES + 1, 2))
        return hs.plot.to_svg(canvas, name="explorer")


@app.function
def loop_rows(u, y):
    """Measures of the last whole cycle."""
    loop = hs.loop_metrics(u, y)
    return {
        "largest width": f"{loop.max_width:.4g}",
        "at the input": f"{loop.max_width_at:.4g}",
        "relative width": f"{100 * loop.relative_width:.3g} %",
        "area": f"{loop.area:.4g}",
        "stroke": f"{loop.stroke:.4g}",
        "orientation": loop.orientation,
        "closure gap": f"{loop.closure_gap:.2g}",
    }


@app.function
def law_rows(law):
    """What is known of the law whatever its input."""
    if isinstance(law, hs.PrandtlIshlinskii):
        return {"saturation": "none", "has an inverse": "yes" if law.is_invertible() else "no"}
    saturation = f"{law.saturation:.4g}" if math.isfinite(law.saturation) else "none"
    if isinstance(law, hs.Dahl):
        return {"saturation of the force": saturation}
    return {
        "stability class": law.stability_class,
        "passive": "yes" if law.passive else "no",
        "saturation of z": saturation,
    }


@app.function
def table(heading, rows):
    """Names and values in two columns."""
    lines = [f"| {heading} | |", "|:--|--:|", *[f"| {name} | {value} |" for name, value in rows.items()]]
    return mo.md("\n".join(lines))


@app.function
def code_of(law, turns):
    """Python that gives the same loop; every law here starts at rest."""
    changed = {
        field.name: getattr(law, field.name)
        for field in dataclasses.fields(law)
        if field.name != "z0" and getattr(law, field.name) != field.default
    }
    arguments = ", ".join(f"{name}={value!r}" for name, value in changed.items())
    return "\n".join(
        [
            "import numpy as np",
            "import hysim as hs",
            "",
            *textwrap.wrap(f"law = hs.{type(law).__name__}({arguments})", 80, subsequent_indent="    "),
            *textwrap.wrap(f"turns = {turns.tolist()}", 80, subsequent_indent="    "),
            f"steps = np.arange({SAMPLES} * (len(turns) - 1) + 1) / {SAMPLES}",
            "u = np.interp(steps, range(len(turns)), turns)",
            "y = law.response(u)",
            "print(hs.loop_metrics(u, y).max_width)",
        ]
    )


@app.cell
def _():
    family = mo.ui.dropdown(list(SLIDERS), value="Bouc-Wen", label="Law", allow_select_none=False)
    drive = sliders(INPUT)
    return drive, family


@app.cell
def _(family):
    parameters = sliders(SLIDERS[family.value])
    return (parameters,)


@app.cell
def _(drive, family, parameters):
    law = law_of(family.value, parameters.value)
    turns = turns_of(*drive.value.values())
    u = input_of(turns)
    try:
        y, refusal = law.response(u), ""
    except hs.SimulationError as escape:
        y, refusal = None, str(escape)
    return law, refusal, turns, u, y


@app.cell
def _(drive, law, refusal, u, y):
    if refusal:
        drawn = mo.callout(mo.md(f"**No loop.** {refusal}"), kind="warn")
    else:
        drawn = mo.Html(f"<div id='picture'>{picture(u, y, drive.value['cycles'])}</div>")
    measures = [] if refusal else [table("Loop", loop_rows(u, y))]
    numbers = mo.vstack([*measures, table("Law", law_rows(law))], gap=1.5)
    return drawn, numbers


@app.cell
def _(drawn, drive, family, law, numbers, parameters, turns):
    controls = mo.vstack(
        [
            family,
            mo.md(f"${EQUATIONS[family.value]}$"),
            *parameters.elements.values(),
            mo.md("**Input**"),
            *drive.elements.values(),
        ]
    )
    code = mo.md(f"```python\n{code_of(law, turns)}\n```")
    page = mo.hstack([controls, mo.vstack([drawn, code]), numbers], widths=[4, 9, 3], gap=2.0, align="start")
    mo.vstack([mo.md("# Loop explorer"), page])
    return


if __name__ == "__main__":
    app.run()
