"""The Python blocks of a page run in order; what they print and draw is what the page shows.

A figure is the file that a block has written under its name, or else what pyplot has drawn last when it is shown.

    python docs/page_runs.py tutorial

runs a page, and writes the text under its blocks and its figures anew. The tests run every page and compare.
"""

import contextlib
import io
import os
import re
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import hysim as hs

HERE = Path(__file__).parent

_BLOCK = re.compile(
    r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", flags=re.MULTILINE | re.DOTALL
)
_FIGURE = re.compile(r"!\[[^\]]*\]\(((?:\.\./)?figures/([\w-]+\.(?:svg|gif)))\)")
_PART = re.compile(f"{_BLOCK.pattern}|{_FIGURE.pattern}", flags=re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
_TEXT = re.compile(r"<text\b[^>]*>([^<]*)</text>")


def printed_by(page: Path) -> list[tuple[str, str | None]]:
    """What each block of a page prints, run in the current folder, and the text that the page shows under it."""
    namespace: dict[str, object] = {}
    found = []
    for part in _PART.finditer(page.read_text()):
        block, shown, _, figure = part.groups()
        if figure is not None and not Path(figure).exists():
            hs.plot.save_svg(plt.gcf(), figure)
            plt.close("all")
        if block is not None:
            above = "\n" * part.string.count(
                "\n", 0, part.start(1)
            )  # a slope is read from its page
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                exec(compile(above + block, str(page), "exec"), namespace)
            found.append((printed.getvalue(), shown))
    return found


def figures_of(page: Path) -> dict[str, Path]:
    """Names of the files that a page's blocks have to draw, and where the page's figures lie."""
    return {name: page.parent / path for path, name in _FIGURE.findall(page.read_text())}


def words_and_numbers(text: str) -> tuple[list[str], list[float]]:
    """A text without its numbers and the width of its gaps, and the numbers."""
    words = _NUMBER.sub("#", re.sub(r"-{3,}", "---", text)).split()
    return words, [float(number) for number in _NUMBER.findall(text)]


def labels(drawing: Path) -> list[str]:
    """What is written in a figure, but for numbers; of a GIF nothing."""
    if drawing.suffix == ".gif":
        return []
    texts = [
        " ".join(words_and_numbers(text)[0])
        for text in _TEXT.findall(drawing.read_text())
    ]
    return [text for text in texts if text != "#"]


def refresh(page: Path) -> None:
    """Write what the blocks of a page print and draw into the page and its figures."""
    figures = figures_of(page)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        printed = iter([text for text, _ in printed_by(page)])
        for name, path in figures.items():
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(Path(name).read_bytes())

    def renewed(block: re.Match[str]) -> str:
        text = next(printed)
        shown = "" if block[2] is None else f"\n```text\n{text}```\n"
        return f"```python\n{block[1]}```\n{shown}"

    page.write_text(_BLOCK.sub(renewed, page.read_text()))


if __name__ == "__main__":
    os.environ.setdefault("MPLBACKEND", "agg")
    for name in sys.argv[1:]:
        refresh(HERE / f"{name}.md")
