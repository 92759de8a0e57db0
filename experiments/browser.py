"""A browser without a window, which opens pages and presses keys: for the experiment on pages, and their tests."""

import json
import os
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE = 60.0  # seconds; nothing waits longer than it must
CODES = {"ArrowRight": 39, "ArrowLeft": 37, "PageUp": 33, "Home": 36, "End": 35}
WIDE, HIGH, TELEPHONE = 1280, 900, 390  # px
QUIET = (
    "--headless",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--remote-debugging-port=0",
)


def wait_for(condition: Callable[[], Any]) -> Any:
    """The condition's value once it is true."""
    end = time.monotonic() + PATIENCE
    while not (value := condition()):
        if time.monotonic() >= end:
            raise TimeoutError(f"waited {PATIENCE:g} s for the browser")
        time.sleep(0.02)
    return value


def answer(url: str) -> bytes | None:
    """The body at a local address; None while nobody answers."""
    try:
        with urllib.request.urlopen(url, timeout=PATIENCE) as response:
            body: bytes = response.read()
            return body
    except OSError:
        return None


class Browser:
    """A page of a browser, over the DevTools protocol."""

    def __init__(self, socket: Any) -> None:
        self.socket, self.count = socket, 0
        self.events: list[dict[str, Any]] = []

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command; returns its result, and keeps the events that come before it."""
        self.count += 1
        self.socket.send(json.dumps({"id": self.count, "method": method, "params": parameters}))
        while (message := json.loads(self.socket.recv(PATIENCE))).get("id") != self.count:
            self.events.append(message)
        result: dict[str, Any] = message["result"]
        return result

    def value(self, expression: str) -> Any:
        """The value of an expression in the page."""
        result = self.send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(result)
        return result["result"].get("value")

    def size(self, width: int, height: int = HIGH) -> None:
        """Set the size of the window; a narrow one is a telephone's."""
        mobile = width < 500
        self.send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=mobile)

    def open(self, path: Path, fragment: str = "") -> None:
        """Open a page, and wait until its first picture is drawn."""
        self.events.clear()
        self.send("Page.navigate", url="about:blank")
        self.send("Page.navigate", url=path.as_uri() + fragment)
        wait_for(lambda: self.value("document.documentElement?.dataset.ready") == "yes")

    def press(self, slider: int, key: str, times: int = 1) -> dict[str, Any]:
        """Press keys on a slider; returns the state of the page once it is drawn again."""
        self.value(f"document.querySelectorAll('input[type=range]')[{slider}].focus()")
        for _ in range(times):
            for kind in ("keyDown", "keyUp"):
                self.send("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=CODES[key])
        return self.drawn()

    def choose(self, select: str, value: str) -> dict[str, Any]:
        """Choose from a list; returns the state of the page once it is drawn again."""
        self.value(
            f"(() => {{ const list = document.getElementById('{select}'); list.value = {json.dumps(value)};"
            " list.dispatchEvent(new Event('change')); })()"
        )
        return self.drawn()

    def drawn(self) -> dict[str, Any]:
        """The state of the page after the next picture."""
        state: dict[str, Any] = self.value(
            "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => {"
            " const s = window.hysim.state;"
            "done({...s, values: Array.from(s.values), u: Array.from(s.u), y: Array.from(s.y),"
            " code: document.getElementById('code').textContent, address: location.hash}); })))"
        )
        return state

    def requests(self) -> list[str]:
        """Addresses outside the page that were asked for since it was opened."""
        names = [
            event["params"]["request"]["url"] for event in self.events if event["method"] == "Network.requestWillBeSent"
        ]
        return [name for name in names if not name.startswith(("data:", "about:"))]


@contextmanager
def started(folder: Path) -> Iterator[Browser]:
    """A browser without a window, whose own files are in `folder`."""
    from websockets.sync.client import connect

    root = ["--no-sandbox"] if os.geteuid() == 0 else []  # without which the browser does not start for root
    command = [str(BROWSER), *QUIET, *root, f"--user-data-dir={folder}", "about:blank"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
        try:
            port = folder / "DevToolsActivePort"
            number = wait_for(lambda: port.exists() and port.read_text().split())[0]
            targets = wait_for(lambda: json.loads(answer(f"http://127.0.0.1:{number}/json") or b"[]"))
            (target,) = [target for target in targets if target["type"] == "page"]
            with connect(target["webSocketDebuggerUrl"], max_size=None) as tools:
                browser = Browser(tools)
                for domain in ("Page", "Network", "Runtime"):
                    browser.send(f"{domain}.enable")
                browser.size(WIDE)
                yield browser
        finally:
            running.terminate()
