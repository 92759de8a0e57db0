"""A notebook shows a table and a small figure of a result, with every name escaped, and the text as it was."""

import base64
import re
import sys
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import hysim as hs

NAME = '<b>"loop" & more</b>'
U = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=20)
T = 0.1 * np.arange(U.size)
UNITS = {"t": "s", "u": "V", "y": "<m>"}
RECORD = hs.Record(t=T, u=U, y=U + 0.1 * np.sin(T), units=UNITS, name=NAME, resolution=0.01, channels={"T": 20.0})
LAG = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
STRUCTURE = hs.Structure(mass=2.0, stiffness=8.0, elements=[hs.Element(hs.Line(slope=10.0), between=(0, 1))])

RESULTS = {
    "record": lambda: RECORD,
    "record without time": lambda: hs.Record(u=U, y=U),
    "simulation": lambda: hs.simulate(hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.5, 1.0)), T, U, units=UNITS),
    "loop": lambda: hs.close_loop(LAG, hs.PID(ki=2.0), T, U, units=UNITS),
    "fit": lambda: replace(hs.identify(hs.Line, RECORD, fixed={"offset": 0.0}), warnings=(NAME,)),
    "comparison": lambda: hs.compare({NAME: hs.Line, "curve": hs.SingleValued}, RECORD),
    "selection": lambda: hs.select({NAME: hs.Line, "curve": hs.SingleValued}, RECORD),
    "study": lambda: hs.sweep(lambda a: a, {"a": [1.0, 2.0]}, executor="threads"),
    "structure": lambda: STRUCTURE,
}
WITHOUT_FIGURE = ("selection", "study", "structure")


def parsed(page):
    """The page as a tree: it must be well formed, and hold no script and nothing from elsewhere."""
    assert "<script" not in page
    assert "http" not in re.sub(r'src="data:[^"]*"', "", page)
    return ElementTree.fromstring(re.sub(r"(<img [^>]*[^/])>", r"\1/>", page))


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_a_table_and_a_figure(name):
    result = RESULTS[name]()
    tree = parsed(result._repr_html_())
    assert NAME not in result._repr_html_()
    images = list(tree.iter("img"))
    assert len(images) == (0 if name in WITHOUT_FIGURE else 1)
    for image in images:
        kind, _, code = image.get("src").partition(",")
        assert kind == "data:image/svg+xml;base64"
        assert base64.b64decode(code).startswith(b"<svg")
        assert image.get("alt")
        assert "background:#fff" in image.get("style")
    assert list(tree.iter("td"))
    assert result._repr_mimebundle_() == {"text/plain": str(result)}


def test_tables_hold_the_lines_of_the_printed_text():
    for name, result in ((name, make()) for name, make in RESULTS.items() if name != "comparison"):
        title, *lines = (line for line in str(result).splitlines() if line.strip("-"))
        tree = parsed(result._repr_html_())
        assert tree.find("div/strong").text == title
        rows = [[cell.text for cell in row] for row in tree.iter("tr")]
        assert [" ".join(row).split() for row in rows] == [line.split() for line in lines], name
    cells = [cell.text for cell in parsed(RECORD._repr_html_()).iter("td")]
    assert cells[:2] == ["t", "0 to 4 s, every 0.1 s"]
    assert cells[-2:] == ["T", "20"]


def test_large_records_stay_small_pages():
    n = 100_000
    t = np.linspace(0.0, 100.0, n)
    assert len(hs.Record(u=np.sin(t), y=np.cos(t), t=t)._repr_html_()) < 400_000


def test_a_law_has_its_text_only_and_no_pyplot_is_left():
    assert hs.BoucWen()._repr_html_() is None
    before = "matplotlib.pyplot" in sys.modules and sys.modules["matplotlib.pyplot"].get_fignums()
    RECORD._repr_html_()
    assert before == ("matplotlib.pyplot" in sys.modules and sys.modules["matplotlib.pyplot"].get_fignums())
