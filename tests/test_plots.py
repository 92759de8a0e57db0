"""Pictures show the numbers of their results, on the Axes that they are given, in the same bytes each time."""

import dataclasses
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest

import hysim as hs
from hysim.paper import figures

LAW = hs.BoucWen(beta=0.03, gamma=0.02, gain=0.01, feedthrough=0.015)
DISCOVERY = SimpleNamespace(
    scores={"fit_percent": 96.0, "bic": -340.0, "n_terms": 3},
    path_n_terms=np.array([5.0, 4.0, 3.0, 2.0]),
    path_fit_percent=np.array([96.5, 95.0, -math.inf, 60.0]),
    path_bic=np.array([-330.0, -320.0, math.inf, -90.0]),
)


@pytest.fixture(autouse=True)
def settings_stay():
    before = dict(matplotlib.rcParams)
    yield
    assert dict(matplotlib.rcParams) == before


@pytest.fixture(scope="module")
def record():
    return hs.datasets.table1()


@pytest.fixture(scope="module")
def comparison(record):
    laws = {"narrow": LAW, "wide": hs.BoucWen(beta=0.03, gamma=0.02, gain=0.02), "third": hs.BoucWen(gain=2.0)}
    return hs.compare(laws, record)


def labelled(ax, text):
    (found,) = (line for line in ax.lines if line.get_label() == text)
    return found


def test_loop_draws_records_as_points_and_simulations_as_lines(record):
    simulation = hs.simulate(LAW, record.t, record.u)
    ax = hs.plot.loop(record, simulation)
    points, line = ax.lines
    np.testing.assert_array_equal(points.get_xydata(), np.column_stack([record.u, record.y]))
    np.testing.assert_array_equal(line.get_xydata(), np.column_stack([simulation.u, simulation.y]))
    assert points.get_marker() == "o"
    assert line.get_marker() == "None"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Voltage [V]", "Displacement [µm]")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["Table 1", "simulation"]


def test_arrows_point_along_the_last_two_branches():
    u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=400)
    ax = hs.plot.loop(hs.simulate(LAW, None, u))
    (up, down) = ax.texts
    assert up.xy[0] > up.xyann[0]
    assert down.xy[0] < down.xyann[0]
    assert np.allclose([up.xy[0], down.xy[0]], 0.5, atol=0.01)  # the samples are 0.005 apart
    assert ax.get_legend() is None
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Input", "Output")


def test_loop_asks_for_something_to_draw():
    with pytest.raises(ValueError, match="at least one result"):
        hs.plot.loop()


def test_history_draws_the_held_input_as_steps_to_the_end_of_the_last_hold(record):
    upper, lower = hs.plot.history(record)
    assert upper.get_ylabel() == "Displacement [µm]"
    assert (lower.get_xlabel(), lower.get_ylabel()) == ("Time [s]", "Voltage [V]")
    np.testing.assert_array_equal(upper.lines[0].get_xydata(), np.column_stack([record.t, record.y]))
    assert lower.lines[0].get_drawstyle() == "steps-post"
    assert lower.lines[0].get_xdata()[-1] == len(record)
    assert upper.get_shared_x_axes().joined(upper, lower)


def test_history_of_a_record_without_time_counts_samples(record):
    untimed = hs.Record(u=record.u, y=record.y)
    _, lower = hs.plot.history(untimed, hold="foh")
    assert lower.get_xlabel() == "Sample"
    assert lower.lines[0].get_drawstyle() == "default"
    with pytest.raises(ValueError, match='"zoh" or "foh"'):
        hs.plot.history(record, hold="linear")


def test_traces_have_their_names_and_units():
    t = np.linspace(0.0, 1.0, 5)
    ax = hs.plot.traces({"one": (t, t), "two": (t, 2.0 * t)}, units={"t": "ms", "y": "um/V"})
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Time [ms]", "Output [µm/V]")
    np.testing.assert_array_equal(labelled(ax, "two").get_ydata(), 2.0 * t)


def test_loops_have_one_panel_for_each_model(comparison):
    axes = hs.plot.loops(comparison)
    assert axes.shape == (3,)
    for ax, row in zip(axes, comparison.rows, strict=True):
        np.testing.assert_array_equal(labelled(ax, "measured").get_ydata(), comparison.record.y)
        np.testing.assert_array_equal(labelled(ax, "model").get_ydata(), row.y)
        name, measures = ax.get_title(loc="left").split("\n")
        assert name == row.name
        assert measures == f"fit {row.fit_percent:.1f} %, width {row.max_width:.3f} µm"


def test_residuals_are_counted_in_quanta_on_two_branches(comparison):
    record = comparison.record
    for ax, row in zip(hs.plot.residuals(comparison, quanta="pixels"), comparison.rows, strict=True):
        loading, unloading = labelled(ax, "loading"), labelled(ax, "unloading")
        quanta = (record.y - row.y) / record.resolution
        np.testing.assert_array_equal(loading.get_xydata(), np.column_stack([record.u, quanta])[:26])
        np.testing.assert_array_equal(unloading.get_xydata(), np.column_stack([record.u, quanta])[26:])
        assert loading.get_markerfacecolor() != unloading.get_markerfacecolor()
        levels = {line.get_ydata()[0] for line in ax.lines if len(line.get_xdata()) == 2}
        assert levels == {-1.0, -0.5, 0.0, 0.5, 1.0}
        assert ax.get_ylabel() == "Residual [pixels]"


def test_residuals_without_a_resolution_are_in_the_unit_of_y(record):
    unquantised = hs.Record(u=record.u, y=record.y, units=record.units)
    (ax,) = hs.plot.residuals(hs.compare({"law": LAW}, unquantised))
    np.testing.assert_array_equal(labelled(ax, "loading").get_ydata(), (record.y - LAW.response(record.u))[:26])
    assert ax.get_ylabel() == "Residual [µm]"
    assert len(ax.lines) == 3


def test_widths_are_those_of_the_loops(comparison):
    ax = hs.plot.widths(comparison)
    assert len(ax.lines) == 4
    np.testing.assert_array_equal(labelled(ax, "measured").get_ydata(), comparison.loop.width)
    np.testing.assert_array_equal(labelled(ax, "wide").get_ydata(), comparison["wide"].loop.width)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Voltage [V]", "Loop width [µm]")


def test_selection_puts_what_is_hopeless_or_diverged_on_the_edge():
    upper, lower = hs.plot.selection(DISCOVERY)
    assert labelled(upper, "path of thresholds").get_ydata().tolist() == [96.5, 95.0]
    assert labelled(lower, "path of thresholds").get_ydata().tolist() == [-330.0, -320.0]
    assert labelled(upper, "chosen law").get_ydata().tolist() == [96.0]
    for ax, edge in ((upper, 0.0), (lower, 1.0)):
        assert labelled(ax, "off the scale").get_xydata().tolist() == [[3.0, edge], [2.0, edge]]
    assert lower.get_xlabel() == "Number of terms"


def test_a_trade_off_shows_the_front_and_the_chosen_one():
    lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0), delay=0.2)
    found = hs.tune(lag, 0.1 * np.arange(100), np.ones(100))
    ax = hs.plot.trade_off(found)
    expected = [(trial.max_sensitivity, trial.objective) for trial in found.trade_off]
    front = labelled(ax, "best so robust").get_xydata()
    assert {tuple(point) for point in front.tolist()} <= set(expected)
    assert 2 < len(front) <= len(expected)
    assert labelled(ax, "chosen").get_xydata().tolist() == [[found.max_sensitivity, found.objective]]
    assert [found.max_sensitivity, found.objective] in front.tolist()
    assert len(labelled(ax, "simulated").get_xydata()) >= len(front)
    assert (ax.get_xlabel(), ax.get_yscale()) == ("Maximum sensitivity", "log")


def test_selection_of_a_real_discovery():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=80)
    found = hs.discover(hs.Record(u=u, y=hs.BoucWen(beta=2.0).response(u)), degree=1)
    upper, _ = hs.plot.selection(found)
    assert labelled(upper, "chosen law").get_xydata().tolist() == [
        [found.scores["n_terms"], found.scores["fit_percent"]]
    ]


def test_too_few_axes_are_refused(comparison):
    with pytest.raises(ValueError, match="3 Axes are needed, got 2"):
        hs.plot.loops(comparison, hs.plot.figure().subplots(1, 2))


def test_given_axes_are_used_and_keep_their_look(comparison):
    ax = hs.plot.figure().add_subplot()
    assert hs.plot.widths(comparison, ax) is ax
    assert ax.spines["top"].get_visible()
    assert not hs.plot.widths(comparison).spines["top"].get_visible()


def drawn(record, comparison):
    t = np.linspace(0.0, 20.0, 50)
    return {
        "figure3": figures.input_and_output(record),
        "figure4": figures.figure4(record),
        "figure5": figures.step_responses({"Eq. (1)": (t, np.tanh(t)), "Eqs. (7), (8)": (t, np.sin(t))}, "s"),
        "loops": figures.model_loops(comparison),
        "residuals": figures.model_residuals(comparison),
        "widths": figures.model_widths(comparison),
        "discovery": figures.discovery_path(DISCOVERY),
    }


@pytest.fixture(scope="module")
def pictures(record, comparison):
    return drawn(record, comparison)


@pytest.fixture(scope="module")
def pages(pictures):
    return {name: hs.plot.to_svg(figure, name=name) for name, figure in pictures.items()}


def test_figures_are_the_same_bytes_however_often_they_are_drawn(record, comparison, pictures, pages):
    for name in ("figure5", "widths"):
        assert hs.plot.to_svg(pictures[name], name=name) == pages[name]
    for name, figure in (("figure3", figures.input_and_output(record)), ("widths", figures.model_widths(comparison))):
        assert hs.plot.to_svg(figure, name=name) == pages[name]


def test_figures_are_the_same_bytes_in_a_process_of_other_settings_which_needs_no_pyplot(pages):
    code = """
import sys, matplotlib
matplotlib.rcParams.update({"font.size": 23, "lines.linewidth": 7, "svg.fonttype": "path"})
import hysim as hs
from hysim.paper.figures import figure4
sys.stdout.reconfigure(encoding="utf-8")
print(hs.plot.to_svg(figure4(hs.datasets.table1()), name="figure4"), end="")
print("matplotlib.pyplot" in sys.modules, end="", file=sys.stderr)
"""
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=True)
    assert done.stdout == pages["figure4"]
    assert done.stderr == "False"


def test_pictures_on_one_page_share_no_id_and_find_their_own_shapes(pages):
    seen = set()
    for name, svg in pages.items():
        ids = re.findall(r'\bid="([^"]*)"', svg)
        used = set(re.findall(r'(?:href="#|url\(#)([^")]*)', svg))
        assert len(ids) == len(set(ids))
        assert used
        assert used <= set(ids)
        assert seen.isdisjoint(ids)
        assert f"#{name}-figure_1 *{{stroke" in svg  # its style sheet does not reach out into the page
        seen.update(ids)


def test_svg_is_one_element_with_text_that_can_be_read(record):
    svg = hs.plot.to_svg(figures.figure4(record))
    root = ET.fromstring(svg)
    texts = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
    assert {"Voltage [V]", "Displacement [µm]", "widest: 0.232 µm at 35 V"} <= set(texts)
    assert "date" not in svg.lower()


def test_nothing_is_clipped(pictures):
    for name, figure in pictures.items():
        figure.draw_without_rendering()
        inside = figure.bbox.padded(0.5)
        for ax in figure.axes:
            box = ax.get_tightbbox()
            assert inside.contains(box.x0, box.y0), name
            assert inside.contains(box.x1, box.y1), name


def test_save_svg_names_the_picture_like_its_file(tmp_path, record):
    figure = figures.figure4(record)
    hs.plot.save_svg(figure, tmp_path / "loop.svg")
    assert (tmp_path / "loop.svg").read_text(encoding="utf-8") == hs.plot.to_svg(figure, name="loop")
    with pytest.raises(ValueError, match="a letter followed by"):
        hs.plot.to_svg(figure, name="4 loops")


def test_a_response_shows_the_measurement_where_it_differs():
    lag, t = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), np.arange(0.0, 2.0, 0.1)
    run = hs.close_loop(lag, hs.PID(kp=2.0), t, np.ones(t.size), units={"t": "s", "y": "um"})
    ax = hs.plot.response(run, hs.plot.figure().add_subplot())
    assert [line.get_label() for line in ax.get_lines()] == ["reference", "displacement"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Time [s]", "Displacement [µm]")
    noisy = dataclasses.replace(run, measurement=run.y + 0.1)
    lines = hs.plot.response(noisy, hs.plot.figure().add_subplot()).get_lines()
    assert [line.get_label() for line in lines] == ["reference", "displacement", "measurement"]
    assert np.array_equal(lines[2].get_ydata(), run.y + 0.1)
