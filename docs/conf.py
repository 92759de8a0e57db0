"""Sphinx settings: everything is read from the package and from committed results; nothing is fetched."""

import json
import sys
from functools import partial
from pathlib import Path

from jinja2 import FileSystemBytecodeCache
from jinja2.sandbox import SandboxedEnvironment
from numpydoc import docscrape_sphinx
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

import hysim
from hysim.export import explorer

HERE = Path(__file__).parent
RESULTS = HERE.parent / "experiments" / "results"
sys.path[:0] = [str(HERE), str(HERE.parent / "experiments")]

from findings import lag_of_equation_1, learning, preisach, reversal_curves  # noqa: E402  from experiments
from front_door import families, write_reference  # noqa: E402  from beside this file
from gallery import (  # noqa: E402
    EXPLORER,
    LOOP_FOLDER,
    draw_families,
    family_cards,
    frames,
    picture_cards,
    plant_cards,
)
from table import stored  # noqa: E402  from experiments
from teaching.slides import slides  # noqa: E402  from beside this file

project = "hysim"
version = release = hysim.__version__
SEARCHED = (
    "earthquake",
    "creep",
    "backlash",
    "S-function",
    "friction",
    "posterior",
    "drift",
    "piezo actuator",
    "magnetorheological damper",
)
"""Words that the search must find; the glossary explains them."""

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "mathml",
    "breaks",
    "examples",
    "navigation",
    "notebook_cells",
]
html_math_renderer = "mathml"
exclude_patterns = ["_build"]
templates_path = ["_templates"]  # numpydoc's too: the example follows the first sentence
default_role = "py:obj"
smartquotes = False  # u' is a derivative

html_theme = "furo"
html_title = f"hysim {version}"
html_logo = html_favicon = "_static/logo.svg"
html_copy_source = False
html_show_copyright = False
html_static_path = ["_static"]
html_css_files = ["page.css"]

autodoc_typehints = "none"  # the docstrings say types with shapes and units
# numpydoc would compile its template anew for each docstring.
docscrape_sphinx.SandboxedEnvironment = partial(
    SandboxedEnvironment, bytecode_cache=FileSystemBytecodeCache()
)
numpydoc_show_class_members = False  # the class template lists them, inherited ones too
numpydoc_xref_param_type = False
# Every check of a docstring but those for sections that only some names need, and for layout that is ours:
# "[V]" alone may describe a parameter, and "As in the constructor." several without their types.
_LEFT_OUT = (
    "ES01",
    "EX01",
    "GL01",
    "GL02",
    "GL08",
    "PR04",
    "PR08",
    "PR09",
    "RT03",
    "SA01",
    "SS05",
    "YD01",
)
numpydoc_validation_checks = {"all", *_LEFT_OUT}
# Without a Parameters section a docstring says in its sentences what goes in and comes out; with one it says all.
numpydoc_validation_overrides = {
    check: [r"\A(?![\s\S]*Parameters\n *---)"] for check in ("PR01", "RT01")
}

myst_enable_extensions = ["substitution", "deflist", "dollarmath", "colon_fence"]
myst_heading_anchors = 3


def shown(experiments: dict[str, str]) -> str:
    """The figure of the first of these experiments that has committed one, above what it shows."""
    for name, caption in experiments.items():
        if (RESULTS / name / "figure.svg").exists():
            return (
                f"![{caption}](../experiments/results/{name}/figure.svg)\n\n*{caption}*"
            )
    raise FileNotFoundError(f"no figure of {', '.join(experiments)} in {RESULTS}")


def ratios() -> str:
    """The ratios that `work_precision` judges, as a table."""
    rows = json.loads((RESULTS / "work_precision" / "result.json").read_text())["ratios"]
    lines = [
        f"| {row['what']} | {format(row['error'], '.0e') if 'error' in row else ''} | {row['median']:.3g} "
        f"({row['median_q1']:.3g} to {row['median_q3']:.3g}) |"
        for row in rows
    ]
    return "\n".join(["| | error | ratio |", "|---|---|---|", *lines])


def benchmark() -> str:
    """Test errors of the published methods and of hysim, from `benchmark_bouc_wen`, as a table."""
    result = json.loads((RESULTS / "benchmark_bouc_wen" / "result.json").read_text())
    lines = [
        f"| {row['method']} | {row['multisine']:.2e} | {format(row['sweep'], '.2e') if 'sweep' in row else ''} | "
        f"{format(row['seconds'], '.1f') if 'seconds' in row else ''} |"
        for row in [*result["published"], *result["summary"]]
    ]
    return "\n".join(
        ["| | multisine [m] | sweep [m] | time [s] |", "|---|---|---|---|", *lines]
    )


def benchmark_errors() -> str:
    """Errors of the parameters in percent, beside those of the published white-box fit, as a table."""
    result = json.loads((RESULTS / "benchmark_bouc_wen" / "result.json").read_text())
    asked, published = (
        result["asked"]["error_percent"],
        result["white_box"]["error_percent"],
    )
    lines = []
    for name in asked:
        own = [
            f"{row[f'{name}_error_percent']:.3f} ({row[f'{name}_stderr_percent']:.3f})"
            for row in result["summary"]
        ]
        lines.append(f"| {name} | {' | '.join(own)} | {published[name]:g} |")
    heads = [row["method"] for row in result["summary"]]
    first = f"| error (standard error) [%] | {' | '.join(heads)} | {result['white_box']['method']} |"
    return "\n".join([first, "|---" * (len(heads) + 2) + "|", *lines])


def table1_models() -> str:
    """The variants on Table 1, from `table1_models`, as a table."""
    rows = json.loads((RESULTS / "table1_models" / "result.json").read_text())["rows"]
    lines = [
        f"| {row['model']} | {row['parameters']} | {row['fit_percent']:.2f} | "
        f"{'' if row['loo_rmse'] is None else format(row['loo_rmse'], '.4f')} | {row['largest_residual_pixels']:.2f} | "
        f"{row['max_width']:.3f} | {row['max_width_at']:g} | {row['bic']:.1f} | {'yes' if row['as_asked'] else ''} |"
        for row in rows
    ]
    head = "| model | parameters | fit [%] | leave-one-out rmse | largest residual | width | at [V] | BIC | as asked |"
    return "\n".join([head, "|---" * 9 + "|", *lines])


myst_substitutions = {
    "explorer": f'<a href="{EXPLORER}">Open the explorer.</a>',
    "families": families(),
    "gallery_families": family_cards(),
    "gallery_plants": plant_cards(),
    "gallery_pictures": picture_cards(),
    "table1_models": table1_models(),
    "recovery_figure": shown(
        {
            "recovery": "Share of the 95 % intervals that hold the truth, over random laws "
            "(`experiments/results/recovery`)."
        }
    ),
    "ratios": ratios(),
    "benchmark": benchmark(),
    "benchmark_errors": benchmark_errors(),
    "found_in_lag_of_equation_1": "\n".join(stored(lag_of_equation_1)),
    "found_in_learning": "\n".join(stored(learning)),
    "found_in_preisach": "\n".join(stored(preisach)),
    "found_in_reversal_curves": "\n".join(stored(reversal_curves)),
    "benchmark_figure": shown(
        {
            "benchmark_bouc_wen": "Root mean square error on the clean test data "
            "(`experiments/results/benchmark_bouc_wen`)."
        }
    ),
    "accuracy_against_cost": shown(
        {
            "work_precision": "Error against time, of hysim and of the tools that people use, measured in one run "
            "(`experiments/results/work_precision`).",
            "exact_step": "Error of the memory against time a sample, of hysim and of the integrators that scripts "
            "use (`experiments/results/exact_step`).",
        }
    ),
}

autosummary_context = {"frames": frames()}
autosummary_generate = write_reference(HERE / "reference")
draw_families(HERE / LOOP_FOLDER)


def setup(app: Sphinx) -> None:
    """Beside the pages: the explorer, the slides, and a look at what the search finds."""
    app.connect("build-finished", _finish)


def _finish(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.name == "html":
        explorer(Path(app.outdir) / EXPLORER)
        (Path(app.outdir) / "teaching" / "slides.html").write_text(slides(), "utf-8")
        if missing := [
            word for word in SEARCHED if not found_by_search(Path(app.outdir), word)
        ]:
            raise ExtensionError(
                f"the search finds no {', '.join(missing)}: add it to glossary.md, or build anew with -E"
            )


def found_by_search(folder: Path, word: str) -> bool:
    """Whether the search of built pages leads to a word: as an entry of the index, of which the glossary makes one."""
    text = (folder / "searchindex.js").read_text()
    entries = json.loads(text[text.index("(") + 1 : text.rindex(")")])["indexentries"]
    return word.lower() in entries
