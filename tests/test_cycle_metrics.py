"""Every cycle of a protocol is measured, closed at one level of the input, and no energy is lost between them."""

import csv
import io
import math
import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from strategies import assert_refused

import hysim as hs
from hysim._columns.excursions import protocol

ROUNDING = 1e-12  # relative; sums of some hundred terms of order one
YIELDING = 0.5
GROWING = [0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 0.0]
TWICE = [0.0, 1.0, -1.0, 1.0, -1.0, 2.0, -2.0, 2.0, -2.0, 0.0]


def path(*points, n=60):
    """Straight lines of n samples each, the turning points once."""
    lines = [np.linspace(a, b, n + 1)[1:] for a, b in pairwise(points)]
    return np.concatenate([[float(points[0])], *lines])


def slip(u):
    """An elastic, perfectly plastic spring of stiffness 1, literally."""
    force, out = 0.0, []
    for step in np.diff(u, prepend=u[0]):
        force = min(max(force + step, -YIELDING), YIELDING)
        out.append(force)
    return np.array(out)


def virgin_energy(a):
    """Of 0 -> a -> -a -> 0 from rest: the first rise, and 2 a on the way down, less the springs' loading ways."""
    return (
        YIELDING**2 / 2 + YIELDING * (a - YIELDING) + YIELDING * (2 * a - 2 * YIELDING) + YIELDING * (a - 2 * YIELDING)
    )


def steady_energy(a):
    return 4 * YIELDING * (a - YIELDING)


def path_integral(u, y):
    return float(np.trapezoid(y, u))


def test_zero_max_min_zero_is_one_closed_cycle():
    u = path(0.0, 2.0, -2.0, 0.0)
    table = hs.cycle_metrics(u, slip(u))
    assert (len(table), table.start.tolist(), table.stop.tolist()) == (1, [0], [u.size])
    assert (table.amplitude[0], table.mean_input[0], table.lowest_input[0], table.highest_input[0]) == (2, 0, -2, 2)
    assert table.energy[0] == pytest.approx(virgin_energy(2.0), rel=ROUNDING)
    assert table.energy[0] == pytest.approx(path_integral(u, slip(u)), rel=ROUNDING)
    assert table.secant_stiffness[0] == pytest.approx(YIELDING / 2.0, rel=ROUNDING)
    ratio = virgin_energy(2.0) / (2 * math.pi * (YIELDING / 2.0) * 2.0**2)  # Jacobsen: E / (4 pi E_S)
    assert table.equivalent_damping[0] == pytest.approx(ratio, rel=ROUNDING)
    assert table.max_width[0] == pytest.approx(2 * YIELDING, rel=ROUNDING)
    assert table.closure_gap[0] == pytest.approx(YIELDING, rel=ROUNDING)
    assert (table.orientation, table.level, table.energy_outside) == (("clockwise",), 0.0, 0.0)


def test_two_cycles_of_each_amplitude_are_a_virgin_and_a_steady_one():
    u = path(*TWICE)
    table = hs.cycle_metrics(u, slip(u))
    assert table.amplitude.tolist() == [1.0, 1.0, 2.0, 2.0]
    assert table.energy[1::2] == pytest.approx([steady_energy(1.0), steady_energy(2.0)], rel=ROUNDING)
    assert table.energy[0] == pytest.approx(virgin_energy(1.0), rel=ROUNDING)
    chopra = [2 * (mu - 1) / (math.pi * mu) for mu in (1.0 / YIELDING, 2.0 / YIELDING)]
    assert table.equivalent_damping[1::2] == pytest.approx(chopra, rel=ROUNDING)
    assert table.cumulative_energy[-1] == pytest.approx(path_integral(u, slip(u)), rel=ROUNDING)
    assert table.energy_outside == 0.0


def test_the_steady_cycle_of_a_bouc_wen_law_has_the_energy_of_its_limit_cycle():
    law = hs.BoucWen(beta=0.8, gamma=0.3)
    u = path(0.0, *(sign * 2.0 for _ in range(6) for sign in (1, -1)), 0.0, n=500)
    table = hs.cycle_metrics(u, law.response(u))
    limit = law.limit_cycle(2.0)
    assert table.energy[-1] == pytest.approx(limit.energy, rel=1e-5)  # chords of 500 samples, h^2 / 12
    assert table.secant_stiffness[-1] == pytest.approx(limit.peak / 2.0, rel=1e-5)  # what 5 cycles leave


def test_a_finely_growing_protocol_is_closed_where_the_last_path_between_extremes_is_not():
    """With 4 % of the largest amplitude a cycle, the way -2.88, 3, -3 lacks 2.3 % of the closed cycle's energy."""
    law = hs.BoucWen(beta=2.0)
    u = path(0.0, *(sign * a for a in np.linspace(0.12, 3.0, 25) for sign in (1, -1)), 0.0)
    y = law.response(u)
    table, loop = hs.cycle_metrics(u, y), hs.loop_metrics(u, y)
    assert table.amplitude == pytest.approx(np.linspace(0.12, 3.0, 25), rel=ROUNDING)
    assert 0.022 < 1.0 - loop.energy / table.energy[-1] < 0.024
    assert table.energy[-1] > 0.999 * law.limit_cycle(3.0).energy / (1.0 + 0.02)  # the last half cycle grows by 4 %
    assert path_integral(u, y) == pytest.approx(table.energy.sum(), rel=1e-9)


@pytest.mark.parametrize(
    ("points", "spans"),
    [
        ([0, 5, 0, 8, 0], [(0, 5), (0, 8)]),  # one-sided
        ([0, -5, 0, -8, 0], [(-5, 0), (-8, 0)]),
        (GROWING, [(-1, 1), (-2, 2), (-3, 3)]),
        ([0, -1, 1, -2, 2, 0], [(-1, 1), (-2, 2)]),  # begins downwards
        ([0, 2, -2, 2, 0], [(-2, 2)]),  # half a cycle is left over
        ([0, 2, -2, 2, -2, 1], [(-2, 2), (-2, 2)]),
        ([0, 2, -1], []),  # does not come back
        ([0, 3, -3, -1], []),
        ([0, 5, 0, 8, 3], [(0, 5)]),  # the last branch is cut off
        ([0, 5, 0, 5, -5, 0], [(0, 5), (-5, 5)]),  # alone, then paired
        ([0, 5, -5, 0, -5, 0], [(-5, 5), (-5, 0)]),
        ([-1, 5, 0, -1], []),  # a half cycle behind a part on the other side
        ([2, 0, 2, 0, 2], [(0, 2), (0, 2)]),  # begins at an extreme
        ([0, 11, 9, 12, 8, 10], [(9, 11), (8, 12)]),  # about a mean that is reached first
        ([3, -2.5, 2, -1.5, 1, -0.5, 0.25], [(-2.5, 2), (-1.5, 1)]),  # fades, begins at an extreme
    ],
)
def test_half_cycles_are_paired_as_testers_do(points, spans):
    u = path(*points)
    if points[1] == 11:
        assert hs.cycle_metrics(u, u).level == pytest.approx(10.0, abs=0.2)
    level = 0.0 if points[:2] == [-1, 5] else None
    if not spans:
        assert_refused("found 0", hs.cycle_metrics, u, slip(u), level=level)
        return
    table = hs.cycle_metrics(u, slip(u), level=level)
    found = list(zip(table.lowest_input.tolist(), table.highest_input.tolist(), strict=True))
    assert np.array(found) == pytest.approx(np.array(spans), abs=1e-12)
    assert table.energy.sum() + table.energy_outside == pytest.approx(path_integral(u, slip(u)), rel=ROUNDING)
    assert (table.energy > 0.0).all()


@pytest.mark.parametrize("points", [[0.0, 1.5, -1.5, 2.5, -2.5, 0.0], [0.3, 2.0, -2.0, 2.0, -2.0, 2.0]])
def test_cycles_cut_between_samples_are_those_cut_at_samples(points):
    """Without the samples near the level, where the path is straight, nothing changes."""
    fine = path(*points, n=240)
    y = slip(fine)
    kept = np.flatnonzero(np.abs(fine - points[0]) > 0.3)
    kept = np.unique([0, *kept, fine.size - 1])
    whole, sparse = hs.cycle_metrics(fine, y), hs.cycle_metrics(fine[kept], y[kept])
    assert sparse.energy == pytest.approx(whole.energy, rel=1e-9)
    assert sparse.closure_gap == pytest.approx(whole.closure_gap, abs=1e-9)
    for table, u in ((whole, fine), (sparse, fine[kept])):
        for k in range(len(table)):
            inside = u[table.start[k] : table.stop[k]]
            assert (inside[0] - table.level) * (inside[1] - table.level) <= 1e-12  # the fewest samples that hold it
            assert (inside[-1] - table.level) * (inside[-2] - table.level) <= 1e-12


def test_a_pause_changes_no_energy_and_is_cut_in_its_middle():
    u = path(0.0, 2.0, -2.0, 2.0, -2.0, 0.0)
    y = slip(u)
    table = hs.cycle_metrics(u, y)
    times = np.ones(u.size, dtype=int)
    times[[0, 60, 120, 180, 240, 240 + 60]] = 7  # at rest, at turning points, and where a cycle ends
    again = hs.cycle_metrics(np.repeat(u, times), np.repeat(y, times))
    assert again.energy.tolist() == pytest.approx(table.energy.tolist(), rel=ROUNDING)
    assert again.equivalent_damping == pytest.approx(table.equivalent_damping, rel=ROUNDING)
    middle = int(np.flatnonzero(np.repeat(u, times) == 0.0)[3])
    assert again.start[0] == middle  # the seven samples at rest: three and three around the begin


def test_noise_at_every_sample_makes_no_cycles():
    rng = np.random.default_rng(3)
    u = 2.0 * np.sin(np.linspace(0.0, 8.0 * np.pi, 4001))
    y = slip(u)
    clean = hs.cycle_metrics(u, y)
    noisy_u = u + rng.uniform(-0.009, 0.009, u.size)  # turns at every second sample; 0.45 % of the span to either side
    noisy = hs.cycle_metrics(noisy_u, y)
    assert len(clean) == len(noisy) == 4
    assert np.abs(np.diff(np.sign(np.diff(noisy_u)))).sum() / 2 > 1000
    # the noise shifts each of 4000 inputs by 0.009 / sqrt(3): a sum of random signs of 0.5 times that
    assert noisy.energy == pytest.approx(clean.energy, abs=4 * YIELDING * 0.009 * math.sqrt(2.0))
    assert noisy.amplitude == pytest.approx(clean.amplitude, abs=0.009)


def test_of_several_passages_in_one_branch_the_middle_one_is_taken():
    u = np.array([2.0, 0.01, -0.01, 0.01, -0.01, -2.0, 2.0, -2.0, 2.0])  # passes 0 at 1.5, 2.5, 3.5; 5.5; 6.5; 7.5
    table = hs.cycle_metrics(u, np.arange(9.0), level=0.0)
    assert table.closure_gap.tolist() == [pytest.approx(6.5 - 2.5, rel=ROUNDING)]
    assert (table.start.tolist(), table.stop.tolist()) == ([2], [8])


def test_many_small_branches_away_from_the_others_do_not_make_the_level():
    """A record that begins elsewhere: six branches of 0.4 about 9.7, then four of 4 about 0."""
    u = path(10.0, *[9.5, 9.9] * 3, -2.0, 2.0, -2.0, 2.0, -2.0, 0.0)
    table = hs.cycle_metrics(u, slip(u))
    assert table.level == pytest.approx(0.0, abs=1e-9)
    assert table.amplitude == pytest.approx([2.0, 2.0], rel=ROUNDING)


def test_minor_loops_inside_a_half_cycle_belong_to_it():
    u = path(0.0, 3.0, 1.0, 3.0, -3.0, 0.0)
    table = hs.cycle_metrics(u, slip(u))
    assert len(table) == 1
    assert table.energy[0] == pytest.approx(virgin_energy(3.0) + 2 * YIELDING * (2.0 - 2 * YIELDING), rel=ROUNDING)
    assert_refused(r"hysim\.cycle_metrics measures cycles with minor loops", hs.loop_metrics, u, slip(u))


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_branches_are_those_between_the_extremes_whichever_comes_first(sense):
    u = path(0.0, sense * 2.0, sense * -2.0, 0.0)
    (loop,) = hs.cycle_metrics(u, slip(u))
    assert loop.width_at([-1.0, 1.0]).tolist() == pytest.approx([-2 * YIELDING] * 2, rel=ROUNDING)  # clockwise
    assert (loop.loading[-1], loop.unloading[0]) == pytest.approx((YIELDING, -YIELDING), rel=ROUNDING)


def test_branches_end_at_the_largest_input_of_a_half_cycle_with_minor_loops():
    u = path(0.0, 3.0, 1.0, 2.5, -3.0, -1.0, -2.0, 0.0)
    (loop,) = hs.cycle_metrics(u, u + 0.01 * np.arange(u.size))
    assert (loop.u[0], loop.u[-1]) == (-3.0, 3.0)
    assert loop.loading[-1] == loop.unloading[-1] == 3.0 + 0.01 * 60
    assert loop.loading[0] == loop.unloading[0] == -3.0 + 0.01 * 240


def test_the_level_can_be_given():
    u = path(0.0, 2.0, -2.0, 2.0, -2.0, 0.0)
    table = hs.cycle_metrics(u, slip(u), level=1.0)
    assert table.level == 1.0
    assert len(table) == 1
    assert (u[table.start[0]], u[table.stop[0] - 1]) == (1.0, 1.0)
    assert table.energy[0] == pytest.approx(steady_energy(2.0), rel=ROUNDING)
    assert table.energy.sum() + table.energy_outside == pytest.approx(path_integral(u, slip(u)), rel=ROUNDING)
    for level in (math.nan, math.inf):
        assert_refused("level must be finite", hs.cycle_metrics, u, u, level=level)
    assert_refused("found 0", hs.cycle_metrics, u, u, level=5.0)


@pytest.mark.parametrize(("end", "is_cycle"), [(0.039, True), (0.041, False)])
def test_a_cycle_may_miss_the_level_by_the_tolerance(end, is_cycle):
    """1 % of a span of 4; closed by a straight line, so that an offset of the output changes no cycle's energy."""
    u = path(0.0, 2.0, -2.0, -end)
    if not is_cycle:
        assert_refused("found 0", hs.cycle_metrics, u, u)
        return
    tables = [hs.cycle_metrics(u, slip(u) + offset) for offset in (0.0, 100.0)]
    assert tables[1].energy == pytest.approx(tables[0].energy, rel=1e-10)
    for table, offset in zip(tables, (0.0, 100.0), strict=True):
        assert table.energy_outside != 0.0
        assert table.energy[0] + table.energy_outside == pytest.approx(path_integral(u, slip(u) + offset), rel=1e-10)


def test_a_piezos_sign_is_said_and_its_damping_is_not_negative():
    rec = hs.datasets.table1()
    table, loop = hs.cycle_metrics(rec.u, rec.y), hs.loop_metrics(rec.u, rec.y)
    assert table.energy.tolist() == [loop.energy] == [-loop.area]
    assert table.equivalent_damping.tolist() == [-loop.equivalent_damping]
    swapped = hs.loop_metrics([0, 1, 3, 2, 0], [0, 2, 3, 1, 0])  # the loop (0,0) (2,1) (3,3) (1,2) with u for y
    direct = hs.cycle_metrics([0, 2, 3, 1, 0], [0, 1, 3, 2, 0])
    assert direct.equivalent_damping[0] == pytest.approx(swapped.equivalent_damping, rel=ROUNDING)
    for text in (table.to_text(), str(loop), table.sign_convention, loop.sign_convention):
        assert "counterclockwise" in text
        assert "negative" in text
    assert "damping -" not in str(loop)
    force = hs.cycle_metrics(rec.u, -rec.y)
    assert "counterclockwise" not in force.to_text() + str(force)
    assert "what a force y on a displacement u dissipates" in force.to_text()


def test_loops_that_run_against_the_others_are_named():
    u = path(0.0, 1.0, -1.0, 1.0, -1.0, 0.0)
    y = slip(u)
    y[u.size // 2 :] *= -1.0
    table = hs.cycle_metrics(u, y)
    assert table.orientation == ("clockwise", "counterclockwise")
    assert "The loops of some cycles (2) run counterclockwise" in table.sign_convention


@pytest.mark.parametrize(("n_against", "named"), [(8, "2, 4, 6, 8, 10, 12, 14, 16)"), (9, "14, 16, ...)")])
def test_at_most_eight_loops_are_named(n_against, named):
    u = path(0.0, *([1.0, -1.0] * 2 * n_against), 0.0, n=4)
    y = slip(u)
    for k in range(n_against):
        y[16 * k + 8 : 16 * k + 16] *= -1.0
    assert named in hs.cycle_metrics(u, y).sign_convention


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_energy_outside_of_the_cycles_is_zero_only_to_rounding(scale):
    u = path(0.0, 0.7, -0.7, 0.0, 0.3, 0.0)  # an elastic way to and fro at the end
    assert hs.cycle_metrics(scale * u, scale * (3.0 * slip(u))).energy_outside == 0.0
    longer = path(0.0, 0.7, -0.7, 0.7, 0.0)
    left = hs.cycle_metrics(scale * longer, scale * slip(longer), level=0.0)
    half = path_integral(longer, slip(longer)) - left.energy.sum() / scale**2
    assert left.energy_outside == pytest.approx(scale**2 * half, rel=1e-9)
    assert half > 0.1


def test_rows_are_the_loops_of_their_cycles():
    u = path(*GROWING)
    table = hs.cycle_metrics(u, slip(u))
    assert [loop.energy for loop in table] == table.energy.tolist()
    assert table[-1].max_width == table.max_width[-1] == hs.loop_metrics(u, slip(u)).max_width
    assert table[0].u[0] == -1.0
    assert pickle.loads(pickle.dumps(table)) == table
    assert hash(table) == hash(hs.cycle_metrics(u, slip(u)))
    for values in (table.start, table.energy):
        assert_refused("read-only", values.__setitem__, 0, 1)


def test_the_table_is_text_and_csv_with_units():
    u = path(*GROWING)
    table = hs.cycle_metrics(u, slip(u))
    lines = table.to_text({"u": "mm", "y": "kN"}).splitlines()
    assert lines[0].split() == [
        "cycle", "start", "stop", "amplitude", "mean", "width", "area", "energy", "stiffness", "damping", "gap",
    ]  # fmt: skip
    assert lines[1].split() == ["[mm]", "[mm]", "[kN]", "[kN", "mm]", "[kN", "mm]", "[kN/mm]", "[%]", "[kN]"]
    assert lines[2] == "-" * len(lines[0])
    assert [line.split()[0] for line in lines[3:6]] == ["1", "2", "3"]
    about = hs.cycle_metrics(path(0.0, 11.0, 9.0, 12.0, 8.0, 10.0), np.zeros(301))
    assert about.mean_input == pytest.approx((about.lowest_input + about.highest_input) / 2, rel=ROUNDING)
    assert about.mean_input.min() > 9.0
    assert float(lines[5].split()[7]) == pytest.approx(table.energy[2], rel=1e-3)
    assert float(lines[5].split()[9]) == pytest.approx(100.0 * table.equivalent_damping[2], abs=0.005)
    assert max(map(len, lines)) <= 100
    assert "Energy of all cycles" in lines[7]
    assert table.to_text().splitlines()[1].split() == ["[%]"]
    header, *rows = csv.reader(io.StringIO(table.to_csv({"u": "mm", "y": "kN"})))
    assert header[:4] == ["cycle", "start", "stop", "amplitude [mm]"]
    assert [float(row[header.index("energy [kN mm]")]) for row in rows] == table.energy.tolist()
    flat = hs.cycle_metrics([0, 1, 0, -1, 0], [1, 1, 1, 1, 1])
    assert next(csv.DictReader(io.StringIO(flat.to_csv())))["equivalent_damping"] == ""  # no stiffness, no ratio
    assert repr(table).startswith("<CycleMetrics: 3 cycles from u = 0")


def test_a_wrong_tolerance_is_refused():
    assert_refused("fraction of the input's span", hs.cycle_metrics, [0, 1, 0], [0, 1, 0], tolerance=0.5)


WALK = st.lists(st.integers(-4, 4), min_size=3, max_size=30).filter(lambda u: len(set(u)) > 1)


def has_cycles(u, tolerance):
    return len(protocol(np.array(u, dtype=float), tolerance).spans) > 0


@given(WALK, st.integers(0, 2**31), st.sampled_from([0.0, 0.01, 0.2]))
def test_no_energy_is_lost_on_any_path(u, seed, tolerance):
    u = np.array(u, dtype=float)
    assume(has_cycles(u, tolerance))
    y = np.random.default_rng(seed).normal(size=u.size)
    table = hs.cycle_metrics(u, y, tolerance=tolerance)
    assert table.energy.sum() + table.energy_outside == pytest.approx(path_integral(u, y), abs=1e-10)  # 30 terms of 8
    assert (table.stop > table.start).all()
    assert (table.start[1:] >= table.stop[:-1] - 2).all()  # they share the samples around a cut, and nothing else
    assert (table.amplitude > 0.0).all()


@given(WALK, st.integers(0, 2**31), st.floats(0.1, 10.0), st.floats(-10.0, 10.0), st.floats(-5.0, 5.0))
def test_scaling_and_shifting_scale_the_energies(u, seed, scale, offset_u, offset_y):
    u = np.array(u, dtype=float)
    assume(has_cycles(u, 0.07))  # of steps of 1/8 of the span at least
    y = np.random.default_rng(seed).normal(size=u.size)
    table = hs.cycle_metrics(u, y, tolerance=0.07)
    other = hs.cycle_metrics(scale * u + offset_u, 2.0 * y + offset_y, tolerance=0.07)
    assert other.energy == pytest.approx(2.0 * scale * table.energy, abs=1e-9)
    assert other.start.size == table.start.size


@pytest.mark.parametrize("beyond", [0.008, 0.04])
@pytest.mark.parametrize("first", [-0.006, 0.0, 0.006])
def test_a_record_that_ends_a_little_beyond_its_level_keeps_its_last_cycle(first, beyond):
    u = np.interp(np.arange(300) / 299, [0.0, 1 / 3, 2 / 3, 1.0], [first, 1.0, -1.0, first + beyond])
    one_sided = np.interp(np.arange(200) / 199, [0.0, 0.5, 1.0], [first, 1.0, first - beyond])
    assert len(hs.cycle_metrics(u, u**3)) == 1
    assert len(hs.cycle_metrics(one_sided, one_sided**2)) == 1


def test_units_that_are_quotients_stand_in_brackets():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    for measured in (hs.cycle_metrics(u, hs.BoucWen().response(u)), hs.loop_metrics(u, hs.BoucWen().response(u))):
        text = measured.to_text({"u": "mm/s", "y": "kN"})
        assert ("kN/(mm/s)" in text, "kN/mm/s" in text) == (True, False)
