"""The slides of the class: one HTML page that needs no other file, from slides.txt and from what sheet.md shows.

    python docs/teaching/slides.py slides.html

A slide of slides.txt begins with a line of # and ends before the next one. `{printed 3}` is what the third block of
the sheet prints, so that no number is written twice; `![words](name.svg)` is a figure of docs/figures.
"""

import base64
import html
import re
import sys
from pathlib import Path

from markdown_it import MarkdownIt

HERE = Path(__file__).parent
_PRINTED = re.compile(r"^```text\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
_FIGURE = re.compile(r'src="([\w-]+\.svg)"')

_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<title>%(title)s</title>
<style>
:root { font: clamp(15px, 1.9vw, 27px)/1.4 system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; color: #1a1a1a; }
body { margin: 0; background: white; }
section { display: none; box-sizing: border-box; min-height: 100vh; padding: 1.2rem 1.6rem 3rem; flex-direction: column;
 max-width: 48rem; margin: 0 auto; }
section.shown { display: flex; }
h1 { font-size: 1.5rem; line-height: 1.2; margin: 0 0 0.7rem; color: #0072b2; }
section:first-of-type h1 { font-size: 2.1rem; margin-top: 15vh; }
p, ul, ol, table { margin: 0 0 0.7rem; }
li { margin-bottom: 0.3rem; }
p:has(> img) { flex: 1 1 12rem; min-height: 0; margin: 0; text-align: center; }
img { max-width: 100%%; max-height: 76vh; }
pre { background: #f3f4f6; padding: 0.6rem 0.8rem; margin: 0 0 0.7rem; font-size: 0.8rem; line-height: 1.35;
 overflow-x: auto; border-radius: 0.3rem; }
code { font-family: ui-monospace, "Cascadia Mono", Consolas, "DejaVu Sans Mono", monospace; }
:not(pre) > code { background: #f3f4f6; font-size: 0.85em; padding: 0 0.2em; }
@media (min-width: 900px), print { /* the figure stands next to the text */
 section.shown:has(img):has(pre) { display: grid; grid-template-columns: minmax(0, 9fr) minmax(0, 11fr);
  column-gap: 1.2rem; align-content: start; }
 section:has(img):has(pre) > * { grid-column: 1; }
 section:has(img):has(pre) > h1 { grid-column: span 2; }
 section:has(img):has(pre) > p:has(> img) { grid-area: 2 / 2 / span 9; }
 section:has(img) > pre { font-size: 0.7rem; }
 img { width: 100%%; }
}
blockquote { margin: 0 0 0.7rem; padding: 0.1rem 0 0.1rem 1rem; border-left: 0.25rem solid #d55e00; }
blockquote p { margin: 0; }
nav { position: fixed; bottom: 0; right: 0; padding: 0.4rem 0.8rem; font-size: 0.8rem; background: #fffd; color: #555; }
nav button { font: inherit; color: inherit; background: none; border: 1px solid #bbb; border-radius: 0.3rem;
 min-width: 2.6rem; min-height: 2.2rem; cursor: pointer; }
@page { size: 254mm 143mm; margin: 8mm 12mm; }
@media print {
 :root { font-size: 17px; }
 nav { display: none; }
 section { display: flex; }
 section:has(img):has(pre), section.shown:has(img):has(pre) { display: grid; align-content: start; column-gap: 1.2rem;
  grid-template-columns: minmax(0, 9fr) minmax(0, 11fr); }
 section, section.shown { min-height: 0; height: 126mm; padding: 0; break-after: page; max-width: none; }
 section:last-of-type { break-after: auto; }
 section:first-of-type h1 { margin-top: 30mm; }
 img { max-height: 78mm; }
}
</style>
%(slides)s
<nav><button id="back" aria-label="back">&larr;</button> <span id="place"></span>
<button id="on" aria-label="forward">&rarr;</button></nav>
<script>
const slides = [...document.querySelectorAll("section")];
let shown = 0;
function show(k) {
  shown = Math.max(0, Math.min(slides.length - 1, k));
  slides.forEach((slide, i) => slide.classList.toggle("shown", i === shown));
  document.getElementById("place").textContent = `${shown + 1} / ${slides.length}`;
  history.replaceState(null, "", `#${shown + 1}`);
  scrollTo(0, 0);
}
const on = ["ArrowRight", "ArrowDown", "PageDown", " "], back = ["ArrowLeft", "ArrowUp", "PageUp"];
addEventListener("keydown", event => {
  const step = on.includes(event.key) - back.includes(event.key);
  const end = { Home: 0, End: slides.length - 1 }[event.key];
  if (step || end !== undefined) { event.preventDefault(); show(end ?? shown + step); }
});
addEventListener("hashchange", () => show(parseInt(location.hash.slice(1)) - 1 || 0));
document.getElementById("on").onclick = () => show(shown + 1);
document.getElementById("back").onclick = () => show(shown - 1);
show(parseInt(location.hash.slice(1)) - 1 || 0);
</script>
</html>
"""


def slides() -> str:
    """The page; an IndexError or a FileNotFoundError where the sheet or a figure has not what a slide names."""
    printed = _PRINTED.findall((HERE / "sheet.md").read_text(encoding="utf-8"))
    text = (HERE / "slides.txt").read_text(encoding="utf-8")
    text = re.sub(
        r"^\{printed (\d+)\}$",
        lambda match: f"```\n{printed[int(match[1]) - 1]}```",
        text,
        flags=re.MULTILINE,
    )
    parts = re.split(r"^(?=# )", text, flags=re.MULTILINE)[1:]
    body = "\n".join(
        f"<section>\n{MarkdownIt().render(part)}</section>" for part in parts
    )
    title = html.escape(parts[0].splitlines()[0].removeprefix("# "))
    return _PAGE % {"title": title, "slides": _FIGURE.sub(_embedded, body)}


def _embedded(figure: re.Match[str]) -> str:
    drawing = (HERE.parent / "figures" / figure[1]).read_bytes()
    return f'src="data:image/svg+xml;base64,{base64.b64encode(drawing).decode("ascii")}"'


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(slides(), encoding="utf-8")
