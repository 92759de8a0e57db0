"""What would a reader of a wide or of a narrow screen miss? Opens pages in Chromium at 1280 and 390 px.

    python .ci/narrow_pages.py site reproduction/report.html reproduction/table1.html

opens each page named, and each in a folder named, with all that folds open. Exit status 1 where it finds one of these:

    beyond     an element reaches beyond the screen, and nothing around it scrolls
    cut        an element is wider than what holds it, which does not scroll
    no cue     an element scrolls sideways, and no shadow shows that it does
    broken     a word continues on the next line without a hyphen
    error      the console has an error, or a file of the page is missing

It needs chromium and the package websockets.
"""

import argparse
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "experiments"))
from browser import BROWSER, TELEPHONE, WIDE, Browser, started, wait_for  # noqa: E402

MEASURE = (HERE / "narrow_pages.js").read_text(encoding="utf-8")
PRINTED = 4  # hits of a kind in one page


def listed(places: list[Path]) -> Iterator[Path]:
    """Every page of these files and folders."""
    for place in places:
        yield from sorted(place.rglob("*.html")) if place.is_dir() else [place]


def opened(browser: Browser, page: Path) -> None:
    """Open a page, and wait until it is drawn."""
    address = json.dumps(page.resolve().as_uri())
    browser.send("Page.navigate", url="about:blank")
    browser.events.clear()
    browser.send("Page.navigate", url=page.resolve().as_uri())
    wait_for(lambda: browser.value(f"location.href.split('#')[0] === {address} && document.readyState === 'complete'"))
    browser.value("document.fonts.ready.then(() => new Promise(done => requestAnimationFrame(() => done(0))))")


def errors(browser: Browser) -> Iterator[str]:
    """What the console says, and the files that are missing."""
    for event in browser.events:
        said: dict[str, Any] = event.get("params", {})
        if event["method"] == "Runtime.exceptionThrown":
            yield said["exceptionDetails"].get("exception", {}).get("description", said["exceptionDetails"]["text"])
        elif event["method"] == "Runtime.consoleAPICalled" and said["type"] == "error":
            yield " ".join(str(each.get("value", each.get("description"))) for each in said["args"])
        elif event["method"] == "Log.entryAdded" and said["entry"]["level"] == "error":
            yield f"{said['entry']['text']} {said['entry'].get('url', '')}"


def hits(browser: Browser, page: Path) -> Iterator[tuple[int, str, str]]:
    """Width, kind and text of everything that a page lacks."""
    for width in (WIDE, TELEPHONE):
        browser.size(width)
        opened(browser, page)
        for kind, text in browser.value(f"{MEASURE.strip()}({width})"):
            yield width, kind, text
        for text in errors(browser):
            yield width, "error", text


def main() -> int:
    """Measure every page, and print what they lack and how often."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("places", nargs="+", type=Path, metavar="PAGE_OR_FOLDER")
    pages = list(listed(parser.parse_args().places))
    if BROWSER is None:
        parser.error("no chromium is installed")
    total: Counter[tuple[int, str]] = Counter()
    with tempfile.TemporaryDirectory() as folder, started(Path(folder)) as browser:
        browser.send("Log.enable")
        for page in pages:
            numbers: Counter[tuple[int, str]] = Counter()
            for width, kind, text in hits(browser, page):
                numbers[width, kind] += 1
                if numbers[width, kind] <= PRINTED:
                    print(f"{page}: {width} px: {kind}: {text}")
            total += numbers
    print(f"{len(pages)} pages")
    for (width, kind), number in sorted(total.items()):
        print(f"{width:5d} px  {kind:7s} {number}")
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
