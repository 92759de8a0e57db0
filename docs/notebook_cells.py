"""The notebooks of `docs/notebooks` as pages, whose code cells run when the documentation is built.

The committed notebooks hold no outputs. Sphinx runs the cells of each in order, in one namespace and in its own
process: no kernel is started, and no package of Jupyter is needed. A page shows what a notebook would show below a
cell: printed text, the page or the text of a last expression, and figures of pyplot. A cell that fails ends the build.
The notebook with its outputs can be downloaded from its page.
"""

import ast
import base64
import contextlib
import functools
import html
import io
import json
import os
import re
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
from docutils import nodes
from docutils.parsers.rst import Directive
from myst_parser.parsers.sphinx_ import MystParser

import hysim as hs


class Outputs(NamedTuple):
    """What a cell shows."""

    printed: str = ""
    text: str = ""
    page: str = ""
    figures: tuple[str, ...] = ()


def cells(document: str) -> list[tuple[str, str]]:
    """Kind, ``"markdown"`` or ``"code"``, and source of each cell of a notebook."""
    return [
        (cell["cell_type"], "".join(cell["source"]))
        for cell in json.loads(document)["cells"]
    ]


def run(source: str, namespace: dict[str, Any]) -> Outputs:
    """Run a cell, and return what a notebook would show below it; a last line that ends with ; shows no value."""
    tree = ast.parse(source)
    is_shown = (
        tree.body
        and isinstance(tree.body[-1], ast.Expr)
        and not source.rstrip().endswith(";")
    )
    last = ast.Expression(tree.body.pop().value) if is_shown else None
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(tree, "cell", "exec"), namespace)
        value = None if last is None else eval(compile(last, "cell", "eval"), namespace)
    text, page = _shown(value)
    figures = tuple(hs.plot.to_svg(plt.figure(number)) for number in plt.get_fignums())
    plt.close("all")
    return Outputs(printed.getvalue(), text, page, figures)


def _shown(value: Any) -> tuple[str, str]:
    """Text and page of a value, as a notebook asks for them."""
    if value is None:
        return "", ""
    ask_page, ask_text = (
        getattr(value, name, None) for name in ("_repr_html_", "_repr_mimebundle_")
    )
    return (ask_text()["text/plain"] if ask_text else repr(value)), (
        ask_page and ask_page()
    ) or ""


@functools.cache
def executed(page: Path) -> tuple[Outputs, ...]:
    """The outputs of each code cell of a page, run in an empty folder."""
    namespace: dict[str, Any] = {}
    sources = [source for kind, source in cells(page.read_text()) if kind == "code"]
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        return tuple(run(source, namespace) for source in sources)


def notebook(page: Path) -> str:
    """The notebook with its outputs."""
    document = json.loads(page.read_text())
    code = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
    for cell, outputs in zip(code, executed(page), strict=True):
        cell["outputs"] = _stored(outputs)
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _stored(outputs: Outputs) -> list[dict[str, Any]]:
    stored: list[dict[str, Any]] = []
    if outputs.printed:
        stored.append(
            {"output_type": "stream", "name": "stdout", "text": outputs.printed}
        )
    if outputs.text:
        data = {"text/plain": outputs.text} | (
            {"text/html": outputs.page} if outputs.page else {}
        )
        stored.append({"output_type": "display_data", "data": data, "metadata": {}})
    images = ({"image/svg+xml": figure} for figure in outputs.figures)
    return stored + [
        {"output_type": "display_data", "data": data, "metadata": {}} for data in images
    ]


class NotebookParser(MystParser):
    """A notebook as a page: its cells in order, and a link to the file below the heading."""

    supported = ("ipynb",)

    def parse(self, inputstring: str, document: nodes.document) -> None:
        """Parse the cells as text of MyST."""
        (_, first), *others = cells(inputstring)
        heading, _, text = first.partition("\n")
        file = Path(document["source"]).name
        link = f'<a href="{file}" download>Download this notebook</a>, or write it with `hysim example {file}`.'
        parts = [f"{heading}\n\n{link}\n{text}"]
        parts += [
            text if kind == "markdown" else f"```{{code-cell}}\n{text}\n```"
            for kind, text in others
        ]
        super().parse("\n\n".join(parts), document)


class CodeCell(Directive):
    """A cell and what it shows."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        environment = self.state.document.settings.env
        place = environment.temp_data.get("code cells", 0)
        environment.temp_data["code cells"] = place + 1
        source = "\n".join(self.content)
        outputs = executed(Path(environment.doc2path(environment.docname)))[place]
        shown: list[nodes.Node] = [nodes.literal_block(source, source, language="python")]
        for text in (outputs.printed, "" if outputs.page else outputs.text):
            if text:
                shown.append(nodes.literal_block(text, text, language="text"))
        pages = [outputs.page] if outputs.page else []
        pages += [_image(figure) for figure in outputs.figures]
        return shown + [
            nodes.raw("", f'<div class="cell-output">{each}</div>', format="html")
            for each in pages
        ]


def _image(figure: str) -> str:
    code = base64.b64encode(figure.encode()).decode()
    labels = " ".join(re.findall(r"<text\b[^>]*>([^<]*[A-Za-z][^<]*)</text>", figure))
    source = f"data:image/svg+xml;base64,{code}"
    alternative = html.escape(labels, quote=True)
    return f'<img alt="{alternative}" style="background:#fff" src="{source}">'


def _write_notebooks(app: Any, error: Exception | None) -> None:
    """Lay the notebooks beside the pages."""
    for page in (
        sorted(Path(app.srcdir, "notebooks").glob("*.ipynb")) if error is None else ()
    ):
        Path(app.outdir, "notebooks", page.name).write_text(notebook(page))


def setup(app: Any) -> dict[str, bool]:
    """Add the directive, and the notebooks to download."""
    os.environ.setdefault("MPLBACKEND", "agg")
    app.add_source_suffix(".ipynb", "ipynb")
    app.add_source_parser(NotebookParser)
    app.add_directive("code-cell", CodeCell)
    app.connect("build-finished", _write_notebooks)
    return {"parallel_read_safe": False}
