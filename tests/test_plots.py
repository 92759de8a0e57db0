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
from PIL import Image
from strategies import assert_refused, refused

import hysim as hs
from hysim.cli import look
from hysim.paper import figures

LAW = hs.BoucWen(beta=0.03, gamma=0.02, gain=0.01, feedthrough=0.015)
UNITS = {"t": "s", "u": "V", "y": "um"}
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


def test_history_draws_the_held_input_as_steps_to_the_end_of_the_last_hold(record):
    upper, lower = hs.plot.history(record)
    assert upper.get_ylabel() == "Displacement [µm]"
    assert (lower.get_xlabel(), lower.get_ylabel()) == ("Time [s]", "Voltage [V]")
    np.testing.assert_array_equal(upper.lines[0].get_xydata(), np.column_stack([record.t, record.y]))
    assert lower.lines[0].get_drawstyle() == "steps-post"
    assert lower.lines[0].get_xdata()[-1] == len(record)
    assert upper.get_shared_x_axes().joined(upper, lower)
    _, lower = hs.plot.history(hs.Record(u=record.u, y=record.y), hold="foh")  # without a time
    assert (lower.get_xlabel(), lower.lines[0].get_drawstyle()) == ("Sample", "default")


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
    assert_refused("3 Axes are needed, got 2", hs.plot.loops, comparison, hs.plot.figure().subplots(1, 2))


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


def assert_nothing_is_clipped(figure, name):
    """Neither are the labels of any Axes."""
    inside = figure.bbox.padded(0.5)
    for ax in figure.axes:
        box = ax.get_tightbbox()
        assert inside.contains(box.x0, box.y0), name
        assert inside.contains(box.x1, box.y1), name


def test_nothing_is_clipped(pictures):
    for name, figure in pictures.items():
        figure.draw_without_rendering()
        assert_nothing_is_clipped(figure, name)


def test_save_svg_names_the_picture_like_its_file(tmp_path, record):
    figure = figures.figure4(record)
    hs.plot.save_svg(figure, tmp_path / "loop.svg")
    assert (tmp_path / "loop.svg").read_text(encoding="utf-8") == hs.plot.to_svg(figure, name="loop")


def test_a_response_shows_the_measurement_where_it_differs():
    lag, t = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), np.arange(0.0, 2.0, 0.1)
    run = hs.close_loop(lag, hs.PID(kp=2.0), t, np.ones(t.size), units={"t": "s", "y": "um"})
    ax = hs.plot.response(run, hs.plot.figure().add_subplot())
    assert [line.get_label() for line in ax.get_lines()] == ["reference", "output"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Time [s]", "Displacement [µm]")
    noisy = dataclasses.replace(run, measurement=run.y + 0.1)
    lines = hs.plot.response(noisy, hs.plot.figure().add_subplot()).get_lines()
    assert [line.get_label() for line in lines] == ["reference", "output", "measurement"]
    assert np.array_equal(lines[2].get_ydata(), run.y + 0.1)


def coloured(ax):
    """Lines of an Axes with their lightness, by which they are told apart in grey."""
    weights = np.array([0.299, 0.587, 0.114])
    return [(line, float(weights @ matplotlib.colors.to_rgb(line.get_color()))) for line in ax.lines]


def test_minor_loops_are_the_cycles_of_the_result_the_smaller_the_darker():
    u = hs.signals.decaying_sine(60.0, mean=60.0, cycles=6, samples_per_cycle=40)
    simulation = hs.simulate(LAW, None, u, units=UNITS)
    ax = hs.plot.minor_loops(simulation)
    assert len(ax.lines) == 6
    lightness = [each for _, each in coloured(ax)]
    assert lightness == sorted(lightness, reverse=True)
    assert lightness[0] < 0.8  # seen on white
    drawn = np.concatenate([line.get_xydata() for line in ax.lines])
    assert {tuple(point) for point in drawn} == set(zip(simulation.u, simulation.y, strict=True))
    assert [line.get_xdata().max() for line in ax.lines] == [120.0, 110.0, 100.0, 90.0, 80.0, 70.0]
    bar = ax.figure.axes[1]
    assert (ax.get_xlabel(), bar.get_ylabel(), bar.get_ylim()) == ("Voltage [V]", "Amplitude [V]", (0.0, 60.0))


def test_each_reversal_curve_is_a_minor_loop():
    u = hs.signals.reversal_curves(0.0, 3.0, curves=3, samples_per_step=4)
    ax = hs.plot.minor_loops(hs.Record(u=u, y=LAW.response(u)), hs.plot.figure().add_subplot())
    curves = [line.get_xdata() for line in ax.lines]
    assert [(x[0], x.max(), x[-1]) for x in curves] == [(0.0, 3.0, 0.0), (0.0, 2.0, 0.0), (0.0, 1.0, 0.0)]
    growing = hs.signals.growing_sine(4.0, cycles=4, samples_per_cycle=8)[2:]  # begins with a way down
    ax = hs.plot.minor_loops(hs.Record(u=growing, y=growing), hs.plot.figure().add_subplot())
    assert [line.get_xdata().max() for line in ax.lines] == [4.0, 3.0, 2.0, 1.0]


def test_history_of_a_simulation_shows_its_memory():
    t = hs.signals.sample_times(41, 0.1)
    simulation = hs.simulate(LAW, t, hs.signals.sine(5.0, cycles=2, samples_per_cycle=20), units=UNITS)
    axes = hs.plot.history(simulation, hold="foh")
    assert [ax.get_ylabel() for ax in axes] == ["Displacement [µm]", "Voltage [V]", "Memory z"]
    assert axes[-1].get_xlabel() == "Time [s]"
    for ax, values in zip(axes, (simulation.y, None, simulation.z), strict=True):
        if values is not None:
            np.testing.assert_array_equal(ax.lines[0].get_xydata(), np.column_stack([t, values]))
            assert ax.lines[0].get_marker() == "None"
    assert len(hs.plot.history(simulation, hs.plot.figure().subplots(2))) == 2
    assert len(hs.plot.history(hs.simulate(hs.Line(slope=1.0), t, simulation.u))) == 2


def test_widths_of_records_simulations_and_loops(record):
    simulations = [hs.simulate(law, record.t, record.u) for law in (LAW, hs.BoucWen(gain=0.1))]
    measured = hs.loop_metrics(record.u, 1.1 * record.y)
    ax = hs.plot.width(record, *simulations, measured)
    names = ["Table 1", "simulation 1", "simulation 2", "loopmetrics"]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == names
    for name, result in zip(names, (record, *simulations, measured), strict=True):
        loop = result if result is measured else hs.loop_metrics(result.u, result.y)
        np.testing.assert_array_equal(labelled(ax, name).get_xydata(), np.column_stack([loop.u, loop.width]))
    assert labelled(ax, "Table 1").get_linestyle() == "None"
    assert len({str(labelled(ax, name)._unscaled_dash_pattern) for name in names[1:]}) == 3
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Voltage [V]", "Loop width [µm]")


def test_the_width_of_zero_max_min_zero_and_of_a_growing_protocol_is_drawn():
    for levels in ([0.0, 2.0, -2.0, 0.0], [0.0, 1.0, -1.0, 2.0, -2.0, 0.0]):
        u = np.interp(np.linspace(0.0, len(levels) - 1.0, 40 * (len(levels) - 1) + 1), np.arange(len(levels)), levels)
        sim = hs.simulate(hs.Play(threshold=0.25), None, u)
        drawn = hs.plot.width(sim, ax=hs.plot.figure().add_subplot()).lines[-1]
        loop = hs.loop_metrics(sim.u, sim.y)
        assert drawn.get_xdata().tolist() == loop.u.tolist()
        assert drawn.get_ydata().max() == loop.max_width == pytest.approx(0.5)


def test_a_residual_map_holds_the_mean_of_each_branch_in_each_interval():
    u = hs.signals.triangle(0.0, 8.0, cycles=3, samples_per_cycle=16)
    residual = np.arange(u.size) / 10.0
    simulated = hs.simulate(LAW, None, u)
    record = hs.Record(u=u, y=simulated.y + residual, units=UNITS)
    axes = hs.plot.residual_map(record, simulated, bins=4)
    for ax, begin in zip(axes, (0, 8), strict=True):
        cells = ax.collections[0].get_array()
        assert cells.shape == (3, 4)
        rows = [residual[begin + 16 * k : begin + 16 * k + 9] for k in range(3)]
        by_input = [row[::-1] if begin else row for row in rows]
        means = [[row[2 * j : 2 * j + 2 + (j == 3)].mean() for j in range(4)] for row in by_input]
        assert np.asarray(cells) == pytest.approx(np.array(means), abs=1e-14)  # rounding of the sum
        largest = residual[47:49].mean()  # where the last way down ends
        assert ax.collections[0].get_clim() == pytest.approx((-largest, largest))
    assert [ax.get_title(loc="left") for ax in axes] == ["loading", "unloading"]
    assert axes[0].figure.axes[2].get_ylabel() == "Residual [µm]"


def test_a_residual_map_takes_what_can_be_simulated(record):
    fit = hs.identify(hs.Line, record)
    maps = [hs.plot.residual_map(record, model) for model in (fit, fit.model, hs.simulate(fit.model, None, record.u))]
    loading = [np.asarray(axes[0].collections[0].get_array()) for axes in maps]
    assert np.array_equal(loading[0], loading[1])
    assert np.array_equal(loading[0], loading[2])
    assert loading[0].shape == (1, 13)
    assert maps[0][0].figure.axes[2].get_ylabel() == "Residual [quanta]"
    perfect = hs.Record(u=record.u, y=fit.model.response(record.u))
    assert hs.plot.residual_map(perfect, fit.model)[0].collections[0].get_clim() == (-1.0, 1.0)


CONSTANT = hs.Record(u=[1.0, 1.0], y=[0.0, 0.0])


test_what_cannot_be_drawn_is_refused = refused(
    (lambda rec: hs.plot.loop(), "at least one result"),
    (lambda rec: hs.plot.history(rec, hold="linear"), "hold must be one of zoh, foh"),
    (lambda rec: hs.plot.to_svg(figures.figure4(rec), name="4 loops"), "a letter followed by"),
    (lambda rec: hs.plot.width(), "nothing to draw"),
    (lambda rec: hs.plot.minor_loops(CONSTANT), "is constant"),
    (lambda rec: hs.plot.cycles(CONSTANT), "constant"),
    (lambda rec: hs.plot.residual_map(rec, hs.simulate(LAW, None, rec.u[1:])), "52 samples, got 51"),
    (lambda rec: hs.plot.residual_map(rec, LAW, bins=0), "bins must be at least 1, got 0"),
    (lambda rec: hs.plot.residual_map(CONSTANT, LAW), "is constant"),
    (lambda rec: hs.plot.forc(hs.Preisach()), "the law has no relays"),
    (lambda rec: hs.plot.forc(rec, coordinates="polar"), '"thresholds" or "centre"'),
    (lambda rec: hs.plot.animate(rec, frames=1), "at least 2 frames"),
    call=lambda draw: draw(hs.datasets.table1()),
)


def test_the_density_of_relays_is_weight_over_area():
    law = hs.Preisach(levels=(0.0, 1.0, 3.0), weights=(1.0, 6.0, -4.0))
    ax = hs.plot.forc(law, units={"u": "V", "y": "um"})
    cells = ax.collections[0]
    assert np.ma.filled(cells.get_array(), np.nan) == pytest.approx(np.array([[2.0, np.nan], [3.0, -2.0]]), nan_ok=True)
    assert cells.get_clim() == (-3.0, 3.0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Lower threshold b [V]", "Upper threshold a [V]")
    assert ax.figure.axes[1].get_ylabel() == "Density of relays [µm/V²]"


def test_a_density_is_read_from_reversal_curves_and_drawn_about_the_middle():
    law = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 6), lambda a, b: 1.0 + a * b)
    u = hs.signals.reversal_curves(-1.0, 1.0, curves=5, samples_per_step=3)
    record = hs.Record(u=u, y=law.response(u), units=UNITS)
    drawn = [hs.plot.forc(source, coordinates="centre") for source in (law, record)]
    known, read = (ax.collections[0].get_array() for ax in drawn)
    assert np.ma.filled(read, 0.0) == pytest.approx(np.ma.filled(known, 0.0), abs=1e-12)  # differences over 0.16
    assert drawn[1].get_xlabel() == "Half the distance (a - b)/2 [V]"
    assert (drawn[0].get_xlim(), drawn[0].get_ylim()) == ((0.0, 1.0), (-1.0, 1.0))


def test_colours_of_signed_quantities_grow_lighter_all_the_way():
    weights = np.array([0.299, 0.587, 0.114])
    for colours in (hs.plot.DIVERGING, hs.plot.SEQUENTIAL):
        lightness = colours(np.linspace(0.0, 1.0, 256))[:, :3] @ weights
        assert (np.diff(lightness) >= 0.0).all()
        assert lightness[0] < 0.15 < 0.7 < lightness[-1]
    low, middle, high = (hs.plot.DIVERGING(np.array([0.0, 0.5, 1.0]))[:, :3]) @ weights
    assert min(middle - low, high - middle) > 0.35


def test_gain_and_phase_are_those_of_the_describing_function():
    amplitudes = [0.5, 1.0, 2.0, 5.0]
    laws = {"play": hs.Play(threshold=1.0), "law": LAW}
    upper, lower = hs.plot.describing_function(laws, amplitudes, units=UNITS | {"u": "A/m"})
    for name, law in laws.items():
        found = hs.metrics.describing_function(law, amplitudes)
        assert np.array_equal(labelled(upper, name).get_xydata(), np.column_stack([amplitudes, np.abs(found)]))
        phase = labelled(lower, name).get_ydata()
        assert np.array_equal(np.isnan(phase), found == 0.0)
        assert np.array_equal(phase[found != 0.0], np.degrees(np.angle(found[found != 0.0])))
    assert (upper.get_ylabel(), lower.get_xlabel()) == ("Gain [µm/(A/m)]", "Amplitude [A/m]")
    (alone,) = hs.plot.describing_function(LAW, amplitudes)[0].lines
    assert alone.get_label() == "BoucWen"


def test_an_animation_runs_from_the_first_sample_to_the_last(record, tmp_path):
    running = hs.plot.animate(record, frames=4, trail=0.5)
    ax = running._fig.axes[0]
    path, behind, point = ax.lines
    running.save(tmp_path / "loop.gif", writer="pillow", dpi=40)
    with Image.open(tmp_path / "loop.gif") as film:
        assert film.n_frames == 4
        assert film.info["duration"] == 40
    np.testing.assert_array_equal(path.get_xydata(), np.column_stack([record.u, record.y]))
    running._draw_frame(0)
    assert point.get_xydata().tolist() == [[record.u[0], record.y[0]]]
    assert behind.get_xdata().tolist() == [record.u[0]]
    running._draw_frame(3)
    assert point.get_xydata().tolist() == [[record.u[-1], record.y[-1]]]
    assert len(behind.get_xdata()) == 26  # half of 51 s: from sample 25.5 on
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Voltage [V]", "Displacement [µm]")


@hs.plot.house_style()
def more_drawn(record):
    axes = {name: hs.plot.figure(height=5.7) for name in ("minor", "history", "width", "map", "gain", "forc")}
    u = hs.signals.decaying_sine(5.0, cycles=3, samples_per_cycle=20)
    simulation = hs.simulate(LAW, None, u, units=UNITS)
    hs.plot.minor_loops(simulation, axes["minor"].add_subplot())
    hs.plot.history(simulation, hs.plot.panels(axes["history"], 3))
    hs.plot.width(record, hs.simulate(LAW, None, record.u), ax=axes["width"].add_subplot())
    hs.plot.residual_map(record, LAW, axes["map"].subplots(1, 2))
    hs.plot.describing_function({"law": LAW, "play": hs.Play()}, [0.5, 2.0, 4.0], hs.plot.panels(axes["gain"], 2))
    hs.plot.forc(hs.Preisach(levels=(0.0, 1.0, 2.0), weights=(1.0, 2.0, 3.0)), axes["forc"].add_subplot())
    return axes


def test_pictures_of_loops_are_the_same_bytes_and_nothing_is_clipped(record):
    once, again = more_drawn(record), more_drawn(record)
    for name, figure in once.items():
        svg = hs.plot.to_svg(figure, name=name)
        if name in ("minor", "map", "forc"):  # those with colours
            assert svg == hs.plot.to_svg(again[name], name=name)
        assert_nothing_is_clipped(figure, name)


def noisy(n):
    rng = np.random.default_rng(0)
    u = 2.0 * np.sin(np.linspace(0.0, 6.0 * np.pi, n))
    return hs.Record(u=u, y=LAW.response(u) + 0.01 * rng.standard_normal(n))


@pytest.mark.parametrize("n", [300, 301, 20_000])
def test_a_long_record_is_a_line_under_its_model(n):
    record = noisy(n)
    ax = hs.plot.loop(record, hs.simulate(LAW, None, record.u), ax=hs.plot.figure().add_subplot())
    measured, model = ax.lines
    assert np.array_equal(measured.get_ydata(), record.y)
    assert (measured.get_marker() == "None") == (n > 300)
    assert (measured.get_linewidth() > model.get_linewidth()) == (n > 300)
    assert bool(measured.get_rasterized()) == (n > 5000)


def test_a_long_record_alone_has_arrows():
    ax = hs.plot.loop(noisy(1000), ax=hs.plot.figure().add_subplot())
    assert len(ax.texts) == 2
    assert not hs.plot.loop(noisy(100), ax=hs.plot.figure().add_subplot()).texts
    curves = np.concatenate([np.linspace(low, 1.0, 100) for low in (0.2, -0.2, -0.6, -1.0)])
    turn = np.interp(np.arange(600), [0, 200, 400, 560, 599], [-1.0, 1.0, -1.0, 0.001, -0.02])
    for u, signs in ((curves, [1]), (turn, [1, -1])):  # no arrow along a jump, nor from a branch to the next
        texts = hs.plot.loop(hs.Record(u=u, y=u**3), ax=hs.plot.figure().add_subplot()).texts
        assert [np.sign(each.xy[0] - each.xyann[0]) for each in texts] == signs


def test_a_picture_of_many_samples_is_small_and_keeps_its_texts():
    record = noisy(40_000)
    canvas = hs.plot.figure()
    hs.plot.identification(hs.identify(hs.Line, record), record, canvas.subplots(1, 2))
    svg = hs.plot.to_svg(canvas)
    assert len(svg) < 300_000  # 30 bytes a sample would be 2.4 MB
    assert "Residual" in svg
    assert svg == hs.plot.to_svg(canvas)


def test_the_band_about_a_model_is_within_its_axes():
    record = hs.Record(u=[0.0, 1.0, 2.0, 3.0], y=[0.0, 1.5, 1.5, 3.0])  # two standard errors reach beyond the data
    (ax, _) = hs.plot.identification(hs.identify(hs.Line, record), record, hs.plot.figure().subplots(1, 2))
    (band,) = ax.patches
    low, high = ax.get_ylim()
    assert band.get_xy()[:, 1].min() < 0.0
    assert band.get_xy()[:, 1].max() > 3.0
    assert low < band.get_xy()[:, 1].min()
    assert high > band.get_xy()[:, 1].max()


def test_residuals_of_many_samples_are_dots_of_two_colours_with_a_legend_that_is_seen(comparison):
    record = noisy(1000)
    (ax,) = hs.plot.residuals(hs.compare({"line": hs.Line}, record), [hs.plot.figure().add_subplot()])
    handles, names = ax.get_legend_handles_labels()
    assert names == ["loading", "unloading"]
    assert handles[0].get_color() != handles[1].get_color()
    assert min(handle.get_markersize() for handle in handles) > 3.0
    dots = [each for each in ax.lines if each.get_marker() == "."]
    assert sum(each.get_xdata().size for each in dots) == 1000


def test_cycles_are_coloured_by_their_number():
    u = hs.signals.triangle(0.0, 1.0, cycles=4, samples_per_cycle=20)
    ax = hs.plot.cycles(hs.Record(u=u, y=LAW.response(u)), hs.plot.figure().add_subplot())
    lightness = [np.dot(matplotlib.colors.to_rgb(each.get_color()), (0.2, 0.7, 0.1)) for each in ax.lines]
    assert len(lightness) == 4
    assert (np.diff(lightness) > 0.0).all()


def test_a_label_that_is_longer_than_its_panel_has_its_unit_in_a_second_line():
    record = hs.Record(u=[0.0, 1.0, 0.0], y=[0.0, 1.0, 0.5], units={"u": "V", "y": "um"})
    low, high = (hs.plot.figure(3.4, height).subplots(2) for height in (2.5, 6.0))
    assert [ax.get_ylabel() for ax in hs.plot.history(record, low)] == ["Displacement\n[µm]", "Voltage [V]"]
    assert [ax.get_ylabel() for ax in hs.plot.history(record, high)] == ["Displacement [µm]", "Voltage [V]"]


def test_histories_on_the_same_axes_differ_by_their_lines_and_have_their_legend_above():
    record, canvas = hs.datasets.table1(), hs.plot.figure()
    results = (record, *(hs.simulate(law, None, record.u) for law in (hs.Line(slope=0.02), LAW)), record[:20])
    look._history(canvas, results, {})
    lines = canvas.axes[0].lines
    assert len({each.get_color() for each in lines}) == 4
    assert lines[1].get_linestyle() != lines[2].get_linestyle()
    assert canvas.axes[1].lines[3].get_color() == lines[3].get_color()
    canvas.draw_without_rendering()
    assert canvas.legends[0].get_window_extent().y0 > canvas.axes[0].get_window_extent().y1
