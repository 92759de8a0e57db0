"""The loop explorer in a browser: a moved slider changes the picture, the numbers and the code to those of its law."""

import base64
import importlib.util
import json
import os
import runpy
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import hysim as hs

pytest.importorskip("marimo")
from websockets.sync.client import connect  # marimo depends on it

pytestmark = pytest.mark.extra("marimo")

NOTEBOOK = Path(__file__).parent.parent / "experiments" / "loop_explorer.py"
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE = 120.0  # seconds: a first start compiles; nothing waits longer than it must
GAMMA = 2  # its place among the sliders
# marimo draws its sliders inside shadow roots, which querySelectorAll does not enter.
FIND = """
const all = (what, root = document) => [...root.querySelectorAll(what),
    ...[...root.querySelectorAll('*')].flatMap(part => part.shadowRoot ? all(what, part.shadowRoot) : [])];
"""
STATE = """
{ready: all('#picture svg').length === 1 && all('[role=slider]').length === 10,
  curves: all('#picture svg path').map(path => path.getAttribute('d')).join(),
  code: all('code').map(part => part.textContent).join('\\n'),
  rows: Object.fromEntries(all('tbody tr').map(row => all('td', row).map(cell => cell.textContent.trim()))),
  errors: all('.has-error').map(part => part.textContent)}
"""


@pytest.fixture(scope="module")
def explorer():
    spec = importlib.util.spec_from_file_location(NOTEBOOK.stem, NOTEBOOK)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def wait_for(condition):
    """What the condition gives once it is true."""
    end = time.monotonic() + PATIENCE
    while not (value := condition()):
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.05)
    return value


@contextmanager
def process(command):
    """A command that runs as long as the block."""
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
        try:
            yield running
        finally:
            running.terminate()


def answer(url):
    """The body at a local address; None while nobody answers."""
    try:
        with urllib.request.urlopen(url, timeout=PATIENCE) as response:
            return response.read()
    except OSError:
        return None


class Page:
    """A page of a browser, over the DevTools protocol."""

    def __init__(self, socket):
        self.socket = socket
        self.count = 0

    def send(self, method, **parameters):
        self.count += 1
        self.socket.send(json.dumps({"id": self.count, "method": method, "params": parameters}))
        while (message := json.loads(self.socket.recv(PATIENCE))).get("id") != self.count:
            pass
        return message["result"]

    def value(self, expression):
        wrapped = f"(() => {{ {FIND} return ({expression}); }})()"
        return self.send("Runtime.evaluate", expression=wrapped, returnByValue=True)["result"].get("value")

    def settled(self, condition):
        """The state of the page once the condition holds."""
        return wait_for(lambda: (state := self.value(STATE)) and state["ready"] and condition(state) and state)

    def press(self, slider, key):
        self.value(f"all('[role=slider]')[{slider}].focus()")
        for kind in ("keyDown", "keyUp"):
            self.send("Input.dispatchKeyEvent", type=kind, key=key, code=key)

    def pixels(self):
        """The picture as the browser paints it, PNG."""
        box = self.value(
            "(({x, y, width, height}) => ({x, y, width, height}))(all('#picture')[0].getBoundingClientRect())"
        )
        shot = self.send("Page.captureScreenshot", format="png", clip={**box, "scale": 1})
        return base64.b64decode(shot["data"])


@pytest.fixture
def page(tmp_path):
    """The explorer, served on the loopback and open in a browser of its own."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{free.getsockname()[1]}"
    serve = [
        "run",
        "--headless",
        "--no-token",
        "--show-tracebacks",
        "--host",
        "127.0.0.1",
        "--port",
        address.rpartition(":")[2],
    ]
    quiet = [
        "--headless",
        "--disable-gpu",
        "--no-first-run",
        "--disable-background-networking",
        "--window-size=1366,1100",
        "--remote-debugging-port=0",
    ]
    if os.geteuid() == 0:
        quiet.append("--no-sandbox")  # which the browser does not start for root
    port = tmp_path / "DevToolsActivePort"
    with process([sys.executable, "-m", "marimo", *serve, str(NOTEBOOK)]):
        wait_for(lambda: answer(f"{address}/health"))
        with process([BROWSER, *quiet, f"--user-data-dir={tmp_path}", address]):
            number = wait_for(lambda: port.exists() and port.read_text().split())[0]
            targets = wait_for(lambda: answer(f"http://127.0.0.1:{number}/json"))
            (target,) = [target for target in json.loads(targets) if target["type"] == "page"]
            with connect(target["webSocketDebuggerUrl"], max_size=None) as tools:
                yield Page(tools)


@pytest.mark.browser
@pytest.mark.skipif(BROWSER is None, reason="no chromium is installed")
def test_a_moved_slider_changes_picture_numbers_and_code(page, explorer):
    before = page.settled(lambda state: "gamma=0.2," in state["code"])
    painted = page.pixels()
    page.press(GAMMA, "ArrowRight")
    after = page.settled(lambda state: "gamma=0.25," in state["code"] and state["rows"] != before["rows"])
    assert after["curves"] != before["curves"]
    assert page.pixels() != painted
    u = explorer.input_of(explorer.turns_of(2.0, 0.0, 2, 4))
    for state, gamma in ((before, 0.2), (after, 0.25)):
        law = hs.BoucWen(beta=0.6, gamma=gamma, feedthrough=0.1)
        assert state["rows"] == explorer.loop_rows(u, law.response(u)) | explorer.law_rows(law)
        assert not state["errors"]
    page.press(GAMMA, "ArrowLeft")
    page.settled(lambda state: state == before)
    wait_for(lambda: page.pixels() == painted)


@pytest.mark.parametrize("family", ["Bouc-Wen", "Prandtl-Ishlinskii", "Dahl"])
def test_the_shown_code_gives_the_shown_loop(explorer, family, capsys):
    law = explorer.law_of(family, {name: start for name, (*_, start) in explorer.SLIDERS[family].items()})
    turns = explorer.turns_of(1.5, -0.5, 3, 2)
    namespace = {}
    exec(explorer.code_of(law, turns), namespace)
    assert namespace["law"] == law
    np.testing.assert_array_equal(namespace["u"], explorer.input_of(turns))
    assert (
        f"{float(capsys.readouterr().out):.4g}" == explorer.loop_rows(namespace["u"], namespace["y"])["largest width"]
    )


def test_the_input_runs_through_whole_cycles_to_smaller_ones(explorer):
    turns = explorer.turns_of(3.0, 1.0, 2, 2)
    assert turns.tolist() == [1.0, 4.0, -2.0, 4.0, -2.0, 4.0, -1.0, 3.0, 0.0, 2.0]
    u = explorer.input_of(turns)
    assert u[:: explorer.SAMPLES].tolist() == turns.tolist()


def test_it_runs_as_a_script():
    runpy.run_path(str(NOTEBOOK), run_name="__main__")
