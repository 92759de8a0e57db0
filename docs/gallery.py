"""The pictures of a page, drawn by the page's own blocks of Python.

An SVG that the page links is the figure that the blocks before the link have drawn last; another picture is a file
that they have written.
"""

import contextlib
import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt

import hysim as hs

_PARTS = re.compile(r"^```python\n(?P<block>.*?)^```|^!\[[^]]*\]\((?P<picture>\S+)\)", flags=re.MULTILINE | re.DOTALL)


def draw_pictures(page: Path, folder: Path) -> None:
    """Run the page's blocks in `folder`, and write there the figures that it links."""
    matplotlib.use("agg")
    folder.mkdir(exist_ok=True)
    namespace: dict[str, object] = {}
    with contextlib.chdir(folder), contextlib.redirect_stdout(None):
        for part in _PARTS.finditer(page.read_text()):
            if part["block"] is not None:
                exec(compile(part["block"], page.name, "exec"), namespace)
            elif part["picture"].endswith(".svg"):
                hs.plot.save_svg(plt.gcf(), Path(part["picture"]).name)
                plt.close("all")
