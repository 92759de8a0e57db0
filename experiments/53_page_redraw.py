"""How long does a page take from a moved slider to the new picture?

Each law of the explorer, in a browser without a window, with a triangle of about 2 000 samples: its first slider is
moved by 40 keys. The page measures each of its own redraws: law, measures of the loop, plays or relays, and the calls
that draw; what the browser does with these calls afterwards is not in it. Keys that come within one frame are drawn
once. Beside it what a slider in a notebook would do: the law's response in Python, `hysim.loop_metrics`, and the figure
drawn anew by Matplotlib.

It needs chromium, and websockets, which the extra `dev` installs.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg

import hysim as hs
from hysim.export import explorer
from hysim.export._page import presets
from hysim.models.parts import response_of
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from browser import Browser, started
from results_folder import one_panel, write_results

RESULTS = Path(__file__).parent / "results" / "page_redraw"
KEYS, SMOKE_KEYS, NOTEBOOK_DRAWS = 40, 2, 10
SAMPLE_TIME = 0.01  # s
PROMISED = 8.0  # ms, half of a frame

Row = dict[str, Any]


def page_times(browser: Browser, place: int, keys: int) -> tuple[list[float], np.ndarray]:
    """Milliseconds of each redraw of the model at this place of the list, and its input."""
    browser.choose("model", str(place))
    state = browser.choose("kind", "triangle")
    browser.value("window.hysim.times.length = 0")
    browser.press(0, "ArrowRight", times=keys)
    return browser.value("window.hysim.times"), np.array(state["u"])


def notebook_times(model: Any, u: np.ndarray, draws: int) -> list[float]:
    """Milliseconds of response, measures and figure in Python."""
    canvas = figure()
    axes = canvas.add_subplot()
    (line,) = axes.plot(u, response_of(model, u, SAMPLE_TIME))
    agg, found = FigureCanvasAgg(canvas), []
    for _ in range(draws):
        began = time.perf_counter()
        y = response_of(model, u, SAMPLE_TIME)
        hs.loop_metrics(u, y)
        line.set_data(u, y)
        agg.draw()
        found.append(1e3 * (time.perf_counter() - began))
    return found


def measured(keys: int, draws: int, models: int | None) -> list[Row]:
    """One row for each model of the explorer."""
    rows = []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, started(Path(folder)) as browser:
        browser.open(explorer(Path(folder) / "explorer.html"))
        for place, (name, shown) in enumerate(list(presets().items())[:models]):
            times, u = page_times(browser, place, keys)
            peers = notebook_times(shown.model, u, draws)
            rows.append(
                {
                    "model": name,
                    "samples": u.size,
                    "redraws": len(times),
                    "median_ms": float(np.median(times)),
                    "worst_ms": max(times),
                    "notebook_median_ms": float(np.median(peers)),
                    "notebook_worst_ms": max(peers),
                }
            )
    return rows


def main(smoke: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    if smoke:
        return measured(SMOKE_KEYS, 1, 1)
    rows = measured(KEYS, NOTEBOOK_DRAWS, None)
    return write_results(RESULTS, rows, draw, {"keys": KEYS, "promised_ms": PROMISED})


def draw(rows: list[Row]) -> Figure:
    """Median and slowest redraw of each model in the page, and the median in Python."""
    canvas, axes = one_panel(0.19 * len(rows) + 0.9)
    ordered = sorted(rows, key=lambda row: -row["median_ms"])
    places = np.arange(len(ordered))
    medians, worst, peers = ([row[key] for row in ordered] for key in ("median_ms", "worst_ms", "notebook_median_ms"))
    axes.hlines(places, medians, worst, color="#0072B2", linewidth=0.8)
    axes.plot(medians, places, color="#0072B2", marker="o", linestyle="none", label="Page: median to slowest")
    axes.plot(peers, places, color="#D55E00", marker="s", linestyle="none", label="Python and Matplotlib")
    axes.axvline(PROMISED, color="#777777", linewidth=0.8, linestyle="dashed")
    axes.set_yticks(places, [row["model"].removeprefix("Magnetic core: ") for row in ordered])
    axes.set(xscale="log", xlabel="Time of a redraw [ms]", xlim=(1.5, 150.0))
    axes.set_xticks([2.0, 5.0, 10.0, 20.0, 50.0, 100.0], ["2", "5", "10", "20", "50", "100"])
    axes.minorticks_off()
    axes.legend(loc="lower right", bbox_to_anchor=(1.02, 1.0))
    return canvas


if __name__ == "__main__":
    for row in main():
        print(row)
