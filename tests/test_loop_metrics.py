"""Loops of known width and area are measured as what they are."""

import json
import math
import re
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import assert_refused, refused

import hysim as hs
from hysim._columns.turning import TOLERANCE, complete_cycles
from hysim.cli import main
from hysim.metrics.rows import LoopRows

ROUNDING = 1e-12  # relative; sums of some hundred terms of order one


def ellipse(cycles=1, n=400, a=2.0, b=0.5, start=np.pi, sense=1):
    """Counterclockwise for sense 1, from the leftmost point by default: area pi a b, width 2 b sqrt(1 - (u/a)^2)."""
    phase = start + sense * 2 * np.pi * (np.arange(cycles * n + 1) % n) / n
    return a * np.cos(phase), b * np.sin(phase)


def play(u, radius, y=0.0):
    """The play operator, literally: the output is pushed along by a slot of half width `radius`."""
    out = []
    for value in u:
        y = min(max(y, value - radius), value + radius)
        out.append(y)
    return np.array(out)


def widths(loop):
    return loop.max_width, loop.max_width_at, loop.mean_width, loop.mid_width, loop.area, loop.orientation


def test_table_1_has_the_published_loop():
    rec = hs.datasets.table1()
    loop = hs.loop_metrics(rec.u, rec.y)
    assert loop.max_width == pytest.approx(0.232, rel=ROUNDING)
    assert loop.max_width_at == 35.0
    assert loop.area == pytest.approx(17.59, abs=0.005)  # quoted with two decimals
    assert loop.mean_width == pytest.approx(0.1407, abs=5e-5)  # quoted with four decimals
    assert loop.relative_width == pytest.approx(0.232 / 2.671, rel=ROUNDING)
    assert (loop.stroke, loop.orientation, loop.closure_gap, loop.n_cycles) == (2.671, "counterclockwise", 0.0, 1)
    expected = [0, -3, 153, 153, 229, 229, 153, 232, 229, 229, 229, 229, 229, 153, 229, 153, 75, 76, 153, 76, 76, 76]
    nanometres = 1000 * loop.width_at(np.arange(0.0, 130.0, 5.0))
    assert nanometres.round(9).tolist() == [*expected, 76, 80, 4, 0]


@pytest.mark.parametrize(("sense", "orientation"), [(1, "counterclockwise"), (-1, "clockwise")])
def test_an_ellipse_has_area_pi_a_b_and_width_2_b(sense, orientation):
    u, y = ellipse(n=4000, sense=sense)
    loop = hs.loop_metrics(u, y)
    inscribed = 1e-6  # a polygon of n corners lacks 2 pi^2 / (3 n^2) = 4e-7 of the area
    assert loop.area == pytest.approx(np.pi * 2.0 * 0.5, rel=inscribed)
    assert loop.mean_width == pytest.approx(np.pi * 2.0 * 0.5 / 4.0, rel=inscribed)
    assert (loop.max_width, loop.mid_width) == pytest.approx((1.0, 1.0), rel=ROUNDING)
    assert loop.max_width_at == pytest.approx(0.0, abs=ROUNDING)
    assert loop.orientation == orientation
    assert loop.width_at(1.0) == pytest.approx(sense * math.sqrt(0.75), rel=1e-5)  # chord error (pi/n)^2 of the curve


def test_a_play_operator_gives_a_parallelogram_and_the_lowest_of_equal_widths():
    radius = 0.25
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=80)
    loop = hs.loop_metrics(u, play(u, radius))
    assert loop.max_width == pytest.approx(2 * radius, rel=ROUNDING)
    assert loop.max_width_at == pytest.approx(-1.0 + 2 * radius, abs=ROUNDING)
    assert loop.area == pytest.approx(2 * radius * (2.0 - 2 * radius), rel=ROUNDING)
    assert loop.stroke == pytest.approx(2.0 - 2 * radius, rel=ROUNDING)
    assert loop.orientation == "counterclockwise"


def test_a_single_valued_curve_has_no_loop():
    u = hs.signals.triangle(0.0, 1.0, cycles=1, samples_per_cycle=20)
    loop = hs.loop_metrics(u, np.exp(u))
    assert (loop.max_width, loop.max_width_at, loop.orientation) == (0.0, 0.0, "none")
    assert loop.area == pytest.approx(0.0, abs=ROUNDING)


def test_a_constant_output_has_no_relative_width():
    loop = hs.loop_metrics([0, 1, 0], [3, 3, 3])
    assert loop.stroke == 0.0
    assert math.isnan(loop.relative_width)


def test_an_unclosed_loop_is_closed_by_a_straight_line():
    loop = hs.loop_metrics([0, 1, 2, 1, 0], [0, 0, 1, 1, 1])
    assert loop.area == pytest.approx(1.5, rel=ROUNDING)  # the unit square below y = 1 and half of the next
    assert loop.closure_gap == 1.0
    assert loop.width_at([0.0, 1.0, 2.0]).tolist() == [1.0, 1.0, 0.0]


def test_a_viscous_damper_beside_a_spring_has_the_damping_ratio_of_its_resonance():
    k, c, omega, amplitude = 3.0, 0.4, 2.5, 0.7
    phase = np.pi + 2 * np.pi * (np.arange(4001) % 4000) / 4000
    x, v = amplitude * np.cos(phase), -amplitude * omega * np.sin(phase)
    loop = hs.loop_metrics(x, k * x + c * v)
    inscribed = 1e-6  # a polygon of n corners lacks 2 pi^2 / (3 n^2) = 4e-7 of the area
    assert loop.secant_stiffness == pytest.approx(k, rel=ROUNDING)
    assert loop.energy == pytest.approx(np.pi * c * omega * amplitude**2, rel=inscribed)
    assert loop.equivalent_damping == pytest.approx(c * omega / (2 * k), rel=inscribed)
    assert loop.orientation == "clockwise"


@pytest.mark.parametrize("ductility", [1.5, 2.0, 4.0, 8.0])
def test_an_elastoplastic_loop_has_the_textbook_damping(ductility):
    """zeta = 2 (mu - 1) / (pi mu), with mu the largest displacement over that at yield (Chopra)."""
    yielding, stiffness = 0.25, 3.0
    u = yielding * ductility * hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=480)
    loop = hs.loop_metrics(u, stiffness * hs.Stop(threshold=yielding).response(u))
    assert loop.secant_stiffness == pytest.approx(stiffness / ductility, rel=ROUNDING)
    # Its corners fall on samples: 480 is a multiple of 4 mu / (mu - 1) and of 4 mu for these ductilities.
    assert loop.equivalent_damping == pytest.approx(2 * (ductility - 1) / (np.pi * ductility), rel=ROUNDING)
    assert loop.energy == pytest.approx(4 * stiffness * yielding**2 * (ductility - 1), rel=ROUNDING)


def test_the_energy_of_a_bouc_wen_loop_is_that_of_its_limit_cycle():
    law = hs.BoucWen(beta=0.8, gamma=0.3, n=1.0)
    u = hs.signals.triangle(-2.0, 2.0, cycles=12, samples_per_cycle=4000)
    cycle = law.limit_cycle(2.0)
    loop = hs.loop_metrics(u, law.response(u))
    chords = 1e-5  # of 2000 chords a branch, h^2 / 12 of its curvature
    assert loop.energy == pytest.approx(cycle.energy, rel=chords)
    assert loop.secant_stiffness == pytest.approx(cycle.peak / 2.0, rel=1e-9)  # what 11 cycles leave of the transient
    ratio = cycle.energy / (2 * np.pi * cycle.peak * 2.0)
    assert loop.equivalent_damping == pytest.approx(ratio, rel=chords)


def test_a_counterclockwise_loop_gives_energy_away_and_no_stiffness_has_no_damping():
    u, y = ellipse()
    loop = hs.loop_metrics(u, y + u)
    assert loop.energy == -loop.area
    assert loop.equivalent_damping < 0.0
    assert loop.secant_stiffness == pytest.approx(1.0, rel=ROUNDING)
    assert math.isnan(hs.loop_metrics([0, 1, 0], [3, 3, 3]).equivalent_damping)
    assert math.copysign(1.0, hs.loop_metrics([0, 1, 0], [0, 1, 0]).energy) == 1.0


@pytest.mark.parametrize("below", [[], [-2, 0]], ids=["above zero", "about a level"])
@pytest.mark.parametrize("n_peak", [1, 2, 3, 4, 7])
def test_a_plateau_at_the_peak_is_divided_in_its_middle(n_peak, below):
    creep = np.linspace(2.0, 3.0, n_peak) if n_peak > 1 else np.array([2.0])
    u = np.concatenate([[0, 1], np.full(n_peak, 2), [1, 0], below])
    loop = hs.loop_metrics(u, np.concatenate([[0, 1], creep, [2.5, 0], below]))
    assert loop.loading[-1] == creep[(n_peak - 1) // 2]
    assert loop.unloading[-1] == creep[-1]


def test_what_is_not_defined_is_not_printed_as_a_number():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    for y in (-u, np.ones(u.size), play(-u, 0.2)):
        for text in (str(hs.loop_metrics(u, y)), str(hs.cycle_metrics(u, y)), hs.cycle_metrics(u, y).to_text()):
            assert "nan" not in text
            assert "none loop" not in text
    assert "no equivalent damping, which needs a positive stiffness" in str(hs.loop_metrics(u, -u))


def test_of_several_samples_at_one_input_the_last_is_taken():
    u = hs.signals.staircase(0.0, 2.0, 1.0, samples_per_step=3)
    loop = hs.loop_metrics(u, np.arange(18.0))
    assert (loop.loading.tolist(), loop.unloading.tolist()) == ([2.0, 5.0, 8.0], [17.0, 14.0, 11.0])


@pytest.mark.parametrize("start", [0.0, np.pi / 2, np.pi, 1.234])
def test_a_sine_that_begins_anywhere_is_cut_at_its_extremes(start):
    u, y = ellipse(cycles=3, start=start)
    loop = hs.loop_metrics(u, y)
    assert loop.max_width == pytest.approx(1.0, rel=1e-4)  # chord error of 400 samples, (pi/n)^2
    assert loop.area == pytest.approx(np.pi, rel=2e-4)  # inscribed polygon, 2 pi^2 / (3 n^2), and a cut between samples
    assert loop.orientation == "counterclockwise"


def test_the_last_cycle_counts():
    u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=8)
    y = np.cumsum(np.arange(u.size))
    assert hs.loop_metrics(u, y) == hs.loop_metrics(u[16:], y[16:])


def test_minor_loops_and_an_unfinished_cycle_after_the_last_complete_one_are_left_out():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=80)
    longer = np.concatenate([u, [-0.4, 0.3, -0.2, 0.8]])
    assert hs.loop_metrics(longer, play(longer, 0.25)) == hs.loop_metrics(u, play(u, 0.25))


def test_glitches_below_the_tolerance_make_no_branches():
    u = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=200)
    clean = hs.loop_metrics(u, play(u, 0.1))
    glitches = u.copy()
    glitches[[37, 237, 333]] += [-0.004, 0.009, -0.009]
    loop = hs.loop_metrics(glitches, play(u, 0.1))
    height = 0.009
    assert loop.max_width == pytest.approx(clean.max_width, abs=height + ROUNDING)  # on branches of slope one
    assert loop.mid_width == pytest.approx(clean.mid_width, rel=ROUNDING)
    assert loop.area == pytest.approx(clean.area, abs=2 * height * 0.01)  # each dent spans two steps of 0.01


def test_a_noisy_input_above_the_tolerance_is_refused_and_a_larger_tolerance_mends_it():
    u = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=200)
    noisy = u + 0.02 * np.sin(1.7 * np.arange(u.size) ** 2)
    assert_refused(r"loop_metrics\(tolerance=\.\.\.\) ignores small turns", hs.loop_metrics, noisy, play(u, 0.1))
    assert hs.loop_metrics(noisy, play(u, 0.1), tolerance=0.05).mid_width == pytest.approx(0.2, abs=0.05)  # 0.02 twice


def test_averaged_cycles_measure_the_loop_under_the_noise():
    cycles, sigma = 64, 0.05
    u = hs.signals.triangle(-1.0, 1.0, cycles=cycles + 1, samples_per_cycle=80)
    noisy = play(u, 0.25) + np.random.default_rng(7).normal(0.0, sigma, u.size)
    one, many = (hs.loop_metrics(u, noisy, cycles=k) for k in (1, cycles))
    # A width is the difference of two means: 4 standard deviations, for the largest of 40.
    assert many.max_width == pytest.approx(0.5, abs=4 * sigma * math.sqrt(2 / cycles))
    assert abs(many.max_width - 0.5) < abs(one.max_width - 0.5)
    assert (one.n_cycles, many.n_cycles, many.orientation) == (1, cycles, "counterclockwise")


def test_the_average_of_equal_cycles_is_any_of_them():
    u = hs.signals.triangle(-1.0, 1.0, cycles=4, samples_per_cycle=80)
    y = play(u, 0.25, y=-0.75)
    one, three = (hs.loop_metrics(u, y, cycles=k) for k in (1, 3))
    assert three.width == pytest.approx(one.width, abs=ROUNDING)
    assert (three.area, three.stroke) == pytest.approx((one.area, one.stroke), rel=ROUNDING)


def test_the_area_of_an_averaged_loop_is_that_of_one_on_any_grid():
    """The inputs crowd near 0, so that a branch that is read in the wrong order has another area."""
    up = np.linspace(0.0, 1.0, 21) ** 2
    u = np.concatenate([[0.0], *([up[1:], up[-2::-1]] * 4)])
    y = play(u, 0.15, y=0.0) + u**3
    one, three = (hs.loop_metrics(u, y, cycles=k) for k in (1, 3))
    assert three.area == pytest.approx(one.area, rel=ROUNDING)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_the_relative_width_has_no_unit(scale):
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    y = play(u, 0.25)
    assert hs.loop_metrics(u, scale * y).relative_width == pytest.approx(hs.loop_metrics(u, y).relative_width)


@pytest.mark.parametrize("n_branch", [2, 3, 5])
def test_the_widths_of_many_loops_are_those_of_each(n_branch):
    """Few samples and outputs at random: the largest width is in each interval, the first and the last among them."""
    up = np.sort(np.random.default_rng(n_branch).uniform(-1.0, 1.0, n_branch))
    u = np.concatenate([[-1.0], up, [1.0], up[::-1] + 1e-3 * (1.0 - up[::-1] ** 2), [-1.0], up, [1.0]])
    y = np.random.default_rng(0).standard_normal((200, u.size))
    rows, loops = LoopRows(u), [hs.loop_metrics(u, each) for each in y]
    assert rows.max_width(y) == pytest.approx([loop.max_width for loop in loops], rel=ROUNDING)
    assert rows.area(y) == pytest.approx([loop.area for loop in loops], rel=1e-10, abs=ROUNDING)


def test_a_drift_is_averaged_over_the_cycles():
    u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=10)
    assert hs.loop_metrics(u, u + 0.1 * np.arange(u.size), cycles=3).closure_gap == pytest.approx(1.0, rel=ROUNDING)


def test_the_width_is_signed_inside_and_nan_outside():
    loop = hs.loop_metrics([0, 1, 2, 1, 0], [0, 3, 4, 1, 0])
    assert isinstance(loop.width_at(0.5), float)
    assert loop.width_at(0.5) == -1.0
    assert np.isnan(loop.width_at([-0.1, 2.1])).all()
    assert loop.width_at(np.zeros((2, 3))).shape == (2, 3)


def test_the_width_error_is_the_rms_difference_of_signed_widths():
    up, down = (hs.loop_metrics([0, 1, 2, 1, 0], [0, 1, 2, top, 0]) for top in (2.0, 0.0))
    assert hs.metrics.width_rmse(up, down) == pytest.approx(2.0 / math.sqrt(3), rel=ROUNDING)
    assert hs.metrics.width_rmse(up, up) == 0.0
    far = hs.loop_metrics([5, 6, 5], [0, 1, 0])
    assert_refused("share no input", hs.metrics.width_rmse, up, far)


NO_LOOPS = (
    ([0, 1, 0], [0, 1], "equal lengths, got 3 and 2"),
    ([0, 1], [0, 1], "at least 3 samples, got 2"),
    ([2, 2, 2], [0, 1, 0], "constant at 2"),
    ([0, 1e300, 0], [0, 1, 0], "y must be below 1e.150, and u move by 1e-150: convert the units"),
    ([0, 1e-300, 0], [0, 1, 0], "y must be below 1e.150, and u move by 1e-150: convert the units"),
    ([0, math.nan, 0], [0, 1, 0], "u must be finite, got nan at index 1"),
    ([0, 1, 0], [0, 1, math.inf], "y must be finite, got inf at index 2"),
)
test_what_is_no_loop_is_refused = refused(
    *((verb, *case) for verb in (hs.loop_metrics, hs.cycle_metrics, hs.magnetic_metrics) for case in NO_LOOPS),
    (hs.loop_metrics, [0, 1, 2, 3], [0, 1, 2, 3], "found 0: it turns at 0, 3"),
    (hs.loop_metrics, [0, 1, 0.5], [0, 1, 0], "found 0: it turns at 0, 1, 0.5"),
    (hs.loop_metrics, [0, 3, -3, -1], [0, 1, -1, 0], "to one extreme or to both and back to the level, such as 0, max"),
    (hs.cycle_metrics, [0, 1, 2, 3], [0, 1, 2, 3], "or from a level to one extreme or to both and back to the level"),
    call=lambda verb, u, y: verb(u, y),
)


@pytest.mark.parametrize("flip", [1.0, -1.0])
@pytest.mark.parametrize(
    ("levels", "path"),
    [
        ([0, 100, 0, 95, 0], (2, 5)),  # the middle at exactly 5 %
        ([0, 100, 0, 94.9, 0], (0, 3)),
        ([0, 100, 5, 100, 5], (2, 5)),  # the outer ones
        ([0, 100, 5.1, 100, 5.1, 100], None),
        ([0, 100, 0, 100, 5.1], (1, 4)),
        ([50, 100, 5, 97, 0], (2, 5)),
    ],
)
def test_a_cycle_turns_within_five_percent_of_the_extremes(levels, path, flip):
    u = flip * np.array(levels, dtype=float)
    found = complete_cycles(u, TOLERANCE)
    assert (found[0].path if found else None) == (None if path is None else slice(*path))
    y = np.arange(u.size, dtype=float) ** 2
    if path is not None:
        inside = y[slice(*path)]
        assert hs.loop_metrics(u, y).closure_gap == inside[-1] - inside[0]
        assert hs.loop_metrics(u, y).stroke == np.ptp(inside)


def test_measures_are_over_the_span_of_the_cycle_and_not_of_the_record():
    """A cycle from 0 to 96, after one to 100; and one from 0 by 100 to 4, whose branches share 4 to 100."""
    u = np.array([0.0, 100.0, 0.0, 48.0, 96.0, 48.0, 0.0])
    loop = hs.loop_metrics(u, np.array([0.0, 50.0, 0.0, 3.0, 9.0, 7.0, 0.0]))
    assert loop.area == pytest.approx(96.0 * 4.0 / 2.0, rel=ROUNDING)
    assert loop.mean_width == pytest.approx(loop.area / 96.0, rel=ROUNDING)
    assert (loop.mid_width, loop.stroke) == (4.0, 9.0)
    assert loop.secant_stiffness == pytest.approx(9.0 / 96.0, rel=ROUNDING)
    assert loop.equivalent_damping == pytest.approx(-192.0 * 2.0 / (math.pi * 9.0 / 96.0 * 96.0**2), rel=ROUNDING)
    open_ended = hs.loop_metrics([0.0, 50.0, 100.0, 52.0, 4.0], [0.0, 1.0, 4.0, 5.0, 2.0])
    assert open_ended.u[[0, -1]].tolist() == [4.0, 100.0]
    assert open_ended.mean_width == pytest.approx(open_ended.area / 100.0, rel=ROUNDING)
    assert open_ended.mid_width == pytest.approx(2.0 + 3.0 * 46.0 / 48.0 - 1.0, rel=ROUNDING)  # at 50
    assert open_ended.secant_stiffness == pytest.approx(((4.0 - 0.08) + (4.0 - 2.0)) / 2.0 / 96.0, rel=ROUNDING)
    ratio = open_ended.energy * 2.0 / (math.pi * open_ended.secant_stiffness * 100.0**2)
    assert open_ended.equivalent_damping == pytest.approx(ratio, rel=ROUNDING)


@pytest.mark.parametrize(("retreat", "counts"), [(0.99, False), (1.0, False), (1.01, True)])
def test_a_reversal_counts_above_one_percent_of_the_span(retreat, counts):
    u = np.array([0.0, 50.0, 50.0 - retreat, 100.0, 0.0])
    assert (len(complete_cycles(u, TOLERANCE)) == 0) == counts
    assert len(hs.Record(u=u, y=u).reversals(tolerance=TOLERANCE)) == (3 if counts else 1)


@pytest.mark.parametrize(
    "levels",
    [
        [0, 2, -2, 0],
        [0, -2, 2, 0],
        [0, 1, -1, 2, -2, 0],
        [0, 1, -1, 1.75, -1.75, 2, -2, 0],
        [2, -1.5, 1, -0.5],  # fades
        [1, 4, -1, 1.5],
    ],
)
def test_a_protocol_that_begins_and_ends_at_a_level_has_its_last_cycle_of_full_amplitude(levels):
    lines = [np.linspace(a, b, 41)[1:] for a, b in pairwise(levels)]
    u = np.concatenate([[float(levels[0])], *lines])
    y = play(u, 0.25)
    assert complete_cycles(u, TOLERANCE) == []
    loop, table = hs.loop_metrics(u, y), hs.cycle_metrics(u, y)
    assert loop == table[int(np.argmax(table.amplitude))]
    (*_, last) = hs.Record(u=u, y=y).cycles()
    k = int(np.argmax(table.amplitude))
    assert (last.u[0], len(last)) == (u[table.start[k]], table.stop[k] - table.start[k])
    assert loop.mid_width == pytest.approx(0.5, rel=1e-9)  # twice the play's radius
    for rows, value in (
        (LoopRows(u).max_width(y[np.newaxis]), loop.max_width),
        (LoopRows(u).area(y[np.newaxis]), loop.area),
    ):
        assert rows.tolist() == [pytest.approx(value, rel=ROUNDING)]


@pytest.mark.parametrize(("smaller", "is_full"), [(1.63, True), (1.62, False)])
def test_cycles_of_full_amplitude_have_nine_tenths_of_the_widest_span(smaller, is_full):
    """Between 3.38 and 3.37 of 3.75, and none within 5 % of both extremes of the record."""
    u = np.array([0.0, 2.0, -1.75, 0.0, smaller, 0.0, -1.75, 0.0])
    y = np.array([0.0, 2.0, -1.0, 0.0, 3.0, 1.0, -1.0, 0.0])
    assert complete_cycles(u, TOLERANCE) == []
    table = hs.cycle_metrics(u, y)
    assert hs.loop_metrics(u, y) == table[1 if is_full else 0]
    assert len(hs.Record(u=u, y=y).cycles()) == (2 if is_full else 1)
    if is_full:
        mean = hs.loop_metrics(u, y, cycles=2)
        assert mean.n_cycles == 2
        assert mean.closure_gap == pytest.approx(table.closure_gap.mean(), abs=ROUNDING)
    else:
        assert_refused(r"asked for 2 .* found 1", hs.loop_metrics, u, y, cycles=2)


TWO_CYCLES = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=8)
test_wrong_options_are_refused = refused(
    ({"cycles": 3}, "asked for 3 .* found 2"),
    ({"cycles": 0}, "at least 1"),
    ({"tolerance": -0.1}, "fraction"),
    call=lambda options: hs.loop_metrics(TWO_CYCLES, TWO_CYCLES, **options),
)


@st.composite
def loops(draw):
    """A closed cycle between 0 and 1 with its own inputs and outputs on each branch."""
    inner = st.lists(st.integers(1, 999), max_size=8, unique=True)
    up, down = sorted(draw(inner)), sorted(draw(inner), reverse=True)
    u = np.array([0, *up, 1000, *down, 0]) / 1000
    values = st.integers(-1000, 1000)
    y = np.array(draw(st.lists(values, min_size=u.size - 1, max_size=u.size - 1))) / 1000
    return u, np.append(y, y[0])


OPPOSITE = {"counterclockwise": "clockwise", "clockwise": "counterclockwise", "none": "none"}


@given(loops())
def test_reversing_the_path_turns_the_loop_round_and_keeps_its_widths(loop):
    u, y = loop
    forth, back = hs.loop_metrics(u, y), hs.loop_metrics(u[::-1], y[::-1])
    assert back.width == pytest.approx(-forth.width, abs=ROUNDING)
    assert widths(back)[:5] == pytest.approx(widths(forth)[:5], abs=ROUNDING)
    assert back.orientation == OPPOSITE[forth.orientation]


@given(loops(), st.floats(0.1, 10.0), st.floats(-10.0, 10.0).filter(lambda factor: abs(factor) > 0.1))
def test_scaling_scales_the_widths_with_y_and_the_area_with_both(loop, a, b):
    u, y = loop
    one, scaled = hs.loop_metrics(u, y), hs.loop_metrics(a * u, b * y)
    assert scaled.max_width == pytest.approx(abs(b) * one.max_width, abs=10 * ROUNDING)  # factors up to 10
    assert scaled.mean_width == pytest.approx(abs(b) * one.mean_width, abs=10 * ROUNDING)
    assert scaled.area == pytest.approx(abs(a * b) * one.area, abs=100 * ROUNDING)


@given(loops(), st.integers(-5, 5), st.integers(-5, 5))
def test_shifting_changes_the_place_only(loop, du, dy):
    u, y = loop
    one, shifted = hs.loop_metrics(u, y), hs.loop_metrics(u + du, y + dy)
    assert shifted.width_at(one.u + du) == pytest.approx(one.width, abs=ROUNDING, nan_ok=True)
    assert (shifted.area, shifted.max_width) == pytest.approx((one.area, one.max_width), abs=ROUNDING)


@given(st.floats(0.01, 10.0), st.floats(0.1, 10.0), st.floats(0.1, 5.0), st.floats(-2.0, 2.0))
def test_the_describing_function_of_a_play_is_the_closed_form(radius, excess, gain, mean):
    """Its kinks lie between two samples of 2000: an error of (2 pi / 2000)^2 / 12 of the slope at most."""
    a = radius + excess
    s = 1.0 - 2.0 * radius / a
    closed = (math.pi / 2 + math.asin(s) + s * math.sqrt(1 - s * s)) / math.pi - 4j * radius * excess / (
        math.pi * a * a
    )
    law = hs.Play(threshold=radius, gain=gain, offset=3.0)
    (found,) = hs.metrics.describing_function(law, [a], mean=mean)
    assert abs(found - gain * closed) < 1e-6 * gain
    (stop,) = hs.metrics.describing_function(hs.Stop(threshold=radius, gain=gain), [a], mean=mean)
    assert abs(stop - gain * (1.0 - closed)) < 1e-6 * gain


def test_the_describing_function_of_a_relay_is_the_closed_form():
    """Its jump lies between two samples of 2000: an error of 4 / 2000 of the gain at most."""
    a = np.array([1.1, 2.0, 10.0])
    relay = hs.PreisachRelays(levels=(-1.0, 1.0), weights=(2.0,))
    closed = 8.0 / (math.pi * a) * np.exp(-1j * np.arcsin(1.0 / a))
    assert hs.metrics.describing_function(relay, a) == pytest.approx(closed, rel=2e-3)


@given(st.floats(0.05, 2.0), st.floats(-0.9, 1.0), st.floats(0.3, 10.0), st.integers(10, 100))
def test_the_imaginary_part_is_the_area_of_the_loop(beta, gamma_ratio, a, quarter):
    law = hs.BoucWen(beta=beta, gamma=gamma_ratio * beta, feedthrough=0.3)
    n = 4 * quarter
    cycle = hs.signals.sine(a, cycles=2, samples_per_cycle=n)[3 * quarter :][: n + 1]
    _, steady = law.advance([a, -a] * 2000)
    loop = hs.loop_metrics(cycle, law.advance(cycle, steady)[0])
    (found,) = hs.metrics.describing_function(law, [a], samples_per_cycle=n)
    polygon = math.sin(2 * math.pi / n) / (2 * math.pi / n)
    assert found.imag * polygon == pytest.approx(loop.energy / (math.pi * a**2), abs=1e-11)  # how steady it is


def test_a_line_has_its_slope_and_no_phase():
    found = hs.metrics.describing_function(hs.Line(offset=1.0, slope=2.0), [0.5, 1.0], mean=3.0)
    assert found == pytest.approx([2.0, 2.0], abs=1e-13)  # rounding of outputs up to 9


def test_a_memory_that_decays_slowly_is_run_until_it_repeats():
    """Where z is nearly u the width is beta (a^2 - u^2): an area of 4 beta a^3 / 3."""
    a, beta = 1e-3, 0.5
    (found,) = hs.metrics.describing_function(hs.BoucWen(beta=beta, gamma=0.0), [a])
    assert found.imag == pytest.approx(4.0 * beta * a / (3.0 * math.pi), rel=1e-3)  # first order in beta a


test_what_has_no_describing_function_is_refused = refused(
    ((hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), [1.0]), {}, TypeError, "without time, got TransferFunction"),
    ((3.0, [1.0]), {}, TypeError, "without time, got float"),
    ((hs.Play(), [0.0]), {}, r"must be positive, and the mean finite, got \[0.0\]"),
    ((hs.Play(), [1.0]), {"mean": math.inf}, "mean finite"),
    ((hs.Play(), [1.0]), {"samples_per_cycle": 7}, "even, and at least 4, got 7"),
    call=lambda arguments, options: hs.metrics.describing_function(*arguments, **options),
)


class Counting:
    """A law whose output at the two extremes of the input is a function of the number of the cycle."""

    def __init__(self, highest, lowest):
        self.ends = highest, lowest

    def advance(self, u, state=0):
        if len(u) % 2:  # the way to the first cycle
            return np.zeros(len(u)), state
        cycles = state + np.arange(len(u) // 2)
        return np.stack([end(cycles) for end in self.ends], axis=1).ravel(), state + len(u) // 2


def late(cycles):
    """1 up to cycle 10, 2 from cycle 20 on."""
    return np.interp(cycles, [10.0, 20.0], [1.0, 2.0])


def still(cycles):
    return np.zeros(len(cycles))


@pytest.mark.parametrize("ends", [(late, still), (still, late)])
def test_a_cycle_repeats_only_when_both_of_its_ends_do_at_the_end_of_a_batch(ends):
    runs = []

    class Watched(Counting):
        def advance(self, u, state=0):
            runs.append(len(u))
            return super().advance(u, state)

    hs.metrics.describing_function(Watched(*ends), [1.0], samples_per_cycle=4)
    assert runs == [1, 32, 64, 4]  # cycles 1 to 16 still move, 17 to 48 do not in their second half


def test_a_law_that_never_repeats_has_no_describing_function():
    class Drift:
        def advance(self, u, state=0.0):
            y = state + np.cumsum(np.ones(len(u)))
            return y, y[-1]

    with pytest.raises(hs.SimulationError, match="does not repeat after 262128 cycles of amplitude 2"):
        hs.metrics.describing_function(Drift(), [2.0])


SWEEP = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=400)
EVEN = hs.PolynomialBoucWen(gain=0.0, input_coefficients=(0.0, 1.0))
BUTTERFLY = hs.Play(threshold=0.2) >> EVEN
"""Its unloading branch is (u + r)^2, after a constant while the play stands still; the loading one (u - r)^2."""


def test_a_butterfly_crosses_itself_and_has_two_lobes_of_known_areas():
    r = 0.2
    loop = hs.loop_metrics(SWEEP, BUTTERFLY.response(SWEEP))
    left, right = loop.lobes
    assert loop.crossings == (left.high,) == (right.low,) == pytest.approx((0.0,), abs=1e-12)
    assert (left.low, right.high) == (-1.0, 1.0)
    assert (left.orientation, right.orientation) == ("clockwise", "counterclockwise")
    # the integral of the width: 4 r u up to 1 - 2 r, and (1 - r)^2 - (u - r)^2 from there to 1
    expected = 2.0 * r * (1.0 - 2.0 * r) ** 2 + 2.0 * r * (1.0 - r) ** 2 - ((1.0 - r) ** 3 - (1.0 - 3.0 * r) ** 3) / 3.0
    assert left.area == pytest.approx(expected, abs=1e-5)  # a parabola by chords of 0.01: 0.4 * 0.01^2 / 6
    assert left.area == pytest.approx(right.area, rel=1e-12)
    assert left.max_width == pytest.approx(0.48, abs=1e-12)  # (1 - r)^2 - (1 - 3 r)^2, where the play moves again
    assert loop.area < 1e-12
    assert "crosses itself at u = " in str(loop)
    assert "clockwise, area 0.25" in str(loop)


@pytest.mark.parametrize("noise", [1e-3, 0.01, 0.03, 0.1])
def test_noise_makes_no_lobes_and_hides_none(noise):
    rng, plain = np.random.default_rng(5), hs.BoucWen().response(SWEEP)
    for _ in range(10):
        added = noise * rng.standard_normal(SWEEP.size)
        crossed = hs.loop_metrics(SWEEP, BUTTERFLY.response(SWEEP) + 0.64 * added).crossings
        assert crossed == pytest.approx((0.0,), abs=3.4 * noise + 0.005)  # 3 deviations of the width over its slope
        assert hs.loop_metrics(SWEEP, plain + np.ptp(plain) * added).crossings == ()


def test_a_curve_without_a_loop_has_no_lobe():
    assert hs.loop_metrics(SWEEP, SWEEP**3).lobes == ()


@pytest.mark.parametrize(
    "law",
    [hs.BoucWen(), hs.PolynomialBoucWen(input_coefficients=(1.0, 0.5, 0.3)), hs.BoucWenBaberNoori(zeta_s=0.9, psi=0.3),
     hs.GeneralizedBoucWen(), hs.ZhuWangBoucWen(delta=2.0), hs.Dahl(), hs.Play(threshold=0.3), hs.Tellinen(),
     hs.JilesAtherton(Ms=1.0, a=0.4, alpha=0.5, k=0.3), hs.EnergyPlays(thresholds=(0.0, 0.2), weights=(2.0, 3.0)),
     hs.MaxwellSlip(stiffness=(1.0, 0.5), slips=(0.3, 0.4))],
    ids=lambda law: type(law).__name__,
)  # fmt: skip
def test_a_simple_law_draws_a_butterfly_only_before_an_even_curve(law):
    assert hs.loop_metrics(SWEEP, law.response(SWEEP)).crossings == ()
    assert len(hs.loop_metrics(SWEEP, (law >> EVEN).response(SWEEP)).crossings) == 1


def test_the_command_prints_and_stores_the_lobes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    record = hs.Record(u=SWEEP, y=BUTTERFLY.response(SWEEP), units={"u": "V", "y": "um"})
    hs.save_record(record, "butterfly.csv")
    assert main(["metrics", "butterfly.csv"]) == 0
    printed = capsys.readouterr().out
    assert re.match(r"LoopMetrics: loop that crosses itself at u = .* V, ", printed)
    assert re.search(r"; u of .* to 1 V:\s+counterclockwise, area 0.25\d* um V, width 0.48 um", printed)
    assert main(["metrics", "butterfly.csv", "--json"]) == 0
    lobes = json.loads(capsys.readouterr().out)["lobes"]
    assert [lobe["orientation"] for lobe in lobes] == ["clockwise", "counterclockwise"]
