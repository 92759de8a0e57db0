"""A record never changes, and never forgets what is known about it; the tables hold the values of the paper."""

import copy
import dataclasses
import math
import pickle
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import assert_refused, refused

import hysim as hs

WALKS = st.lists(st.integers(-5, 5), min_size=2, max_size=40).map(lambda u: hs.Record(u=u, y=range(len(u))))


def record(**changes):
    values = {
        "u": [0.0, 1.0, 2.0, 1.0],
        "y": [0.0, 0.5, 1.5, 1.2],
        "t": [0.0, 0.1, 0.2, 0.3],
        "units": {"t": "s", "u": "V", "y": "um"},
        "resolution": 0.1,
        "name": "loop",
    }
    return hs.Record(**values | changes)


def test_a_record_cannot_be_changed():
    rec = record()
    with pytest.raises(dataclasses.FrozenInstanceError):
        rec.name = "other"
    with pytest.raises(ValueError, match="read-only"):
        rec.u[0] = 1.0
    with pytest.raises(TypeError):
        rec.units["u"] = "kV"


def test_a_record_does_not_share_its_callers_arrays():
    u, units = np.array([0.0, 1.0]), {"u": "V"}
    rec = hs.Record(u=u, y=u, units=units)
    u[0], units["u"] = 9.0, "kV"
    assert (rec.u[0], rec.units["u"]) == (0.0, "V")


def test_a_slice_keeps_what_is_known():
    part = record()[1:3]
    assert (part.u.tolist(), part.y.tolist(), part.t.tolist()) == ([1.0, 2.0], [0.5, 1.5], [0.1, 0.2])
    assert (dict(part.units), part.resolution, part.name) == ({"t": "s", "u": "V", "y": "um"}, 0.1, "loop")
    assert hs.Record(u=[0, 1, 2], y=[0, 1, 2])[:2].t is None


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda rec: pickle.loads(pickle.dumps(rec))])
def test_a_copy_is_equal_and_as_read_only(duplicate):
    rec = record()
    other = duplicate(rec)
    assert other == rec
    assert hash(other) == hash(rec)
    assert not other.y.flags.writeable


@pytest.mark.parametrize("changes", [{"y": [0, 0, 0, 0]}, {"name": "x"}, {"units": {}}, {"t": None}])
def test_records_are_equal_by_value(changes):
    assert record() == record()
    assert record(**changes) != record()


def test_the_sample_time_is_that_of_an_even_record():
    assert record().sample_time == pytest.approx(0.1, rel=1e-12)  # a mean of rounded differences


test_what_a_record_cannot_do_is_refused = refused(
    (lambda: record()[0], TypeError, "cut by a slice, got 0"),
    (lambda: record()[:1], "at least 2 samples, got 1"),
    (lambda: record(t=[0.0, 0.1, 0.2, 0.4]).sample_time, "evenly spaced"),
    (lambda: record(t=None).sample_time, "no time"),
    (lambda: record(t=None).resample(0.1), "no time to resample"),
    (lambda: record(t=None).convert({"t": "ms"}), "no 't' with a unit"),
    (lambda: hs.datasets.table1().detrend(), "order 1 needs 2 complete cycles, the record has 1"),
    (lambda: hs.datasets.table1().detrend(0), "order must be at least 1, got 0"),
)


test_what_is_no_record_is_refused_with_its_place = refused(
    ({"u": [0, 1, math.nan, 1]}, "u must be finite, got nan at index 2"),
    ({"y": [0, 1, 2, math.inf]}, "y must be finite, got inf at index 3"),
    ({"u": [0, 1, math.inf, 1]}, "u must be finite, got inf at index 2"),
    ({"y": [0, math.nan, 2, 1]}, "y must be finite, got nan at index 1"),
    ({"y": [0, 1, 2]}, "u and y must have equal lengths, got 4 and 3"),
    ({"t": [0, 1, 2]}, "u and t must have equal lengths, got 4 and 3"),
    ({"t": [0, 1, 1, 2]}, "got 1.0 after 1.0 at sample 2"),
    ({"t": [0, 1, 2, 1.5]}, "got 1.5 after 2.0 at sample 3"),
    ({"u": [[0, 1, 2, 1]]}, r"u must have 1 axis, got shape \(1, 4\): np\.ravel makes it flat"),
    ({"u": [[0, 1], [2, 1]]}, r"u must have 1 axis, got shape \(2, 2\): take one column, u\[:, 0\]"),
    ({"u": ["a", "b", "c", "d"]}, TypeError, "u must be numbers"),
    ({"u": [0, 1j, 0, 0]}, TypeError, "u must be real"),
    ({"units": {"z": "m"}}, "units are labels"),
    ({"units": ["V"]}, TypeError, "units must be a mapping"),
    ({"resolution": 0.0}, "resolution must be positive"),
    call=lambda changes: record(**changes),
)


@given(WALKS)
def test_branches_are_monotone_and_cover_the_record(rec):
    branches = rec.branches()
    for branch in branches:
        steps = np.diff(branch.u)
        assert (steps >= 0).all() or (steps <= 0).all()
    seen = sorted({int(k) for branch in branches for k in branch.y})
    assert seen == (list(range(len(rec))) if np.ptp(rec.u) else [])
    assert len(rec.reversals()) == max(0, len(branches) - 1)


@given(WALKS)
def test_reversals_are_where_the_slope_changes_its_sign(rec):
    slopes = [step for step in np.sign(np.diff(rec.u)) if step]
    turning = [k for k in range(1, len(slopes)) if slopes[k] != slopes[k - 1]]
    assert len(rec.reversals()) == len(turning)
    for k in rec.reversals():
        left, right = rec.u[:k][rec.u[:k] != rec.u[k]], rec.u[k:][rec.u[k:] != rec.u[k]]
        assert (left[-1] - rec.u[k]) * (right[0] - rec.u[k]) > 0


@pytest.mark.parametrize(
    ("u", "places"),
    [
        ([0, 1, 0], [1]),
        ([0, 1, 1, 0], [1]),
        ([0, 1, 1, 1, 0], [2]),
        ([0, 0, 1, 2, 2], []),
        ([3, 3, 3], []),
        ([0, 1, 0.99, 1, 2, 0], [1, 2, 4]),
    ],
)
def test_a_plateau_turns_at_its_middle(u, places):
    assert hs.Record(u=u, y=u).reversals().tolist() == places


def test_wiggles_below_the_tolerance_are_no_reversals():
    u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=40)
    noisy = hs.Record(u=u + 0.03 * (-1.0) ** np.arange(u.size), y=u)
    assert len(noisy.reversals()) > 10
    assert len(noisy.reversals(tolerance=0.1)) == 5
    assert len(noisy.branches(tolerance=0.1)) == 6
    assert_refused(r"tolerance .* got 0\.5", noisy.reversals, tolerance=0.5)


def test_cycles_are_those_that_loop_metrics_measures():
    u = hs.signals.triangle(0.0, 1.0, cycles=4, samples_per_cycle=40)[7:]
    rec = hs.Record(u=u, y=hs.BoucWen(beta=2.0).response(u), units={"u": "V"}, name="loop")
    cycles = rec.cycles()
    assert [len(cycle) for cycle in cycles] == [41, 41, 41]
    assert {(cycle.name, cycle.units["u"]) for cycle in cycles} == {("loop", "V")}
    assert hs.loop_metrics(cycles[-1].u, cycles[-1].y) == hs.loop_metrics(rec.u, rec.y)
    assert hs.Record(u=[0, 1, 2], y=[0, 1, 2]).cycles() == hs.Record(u=[1, 1], y=[0, 1]).cycles() == ()


def test_an_uneven_record_is_resampled_along_straight_lines():
    rec = record(t=[0.0, 0.1, 0.2, 0.5])
    even = rec.resample(0.1)
    assert even.sample_time == pytest.approx(0.1, rel=1e-12)  # a mean of rounded differences
    assert even.u == pytest.approx([0, 1, 2, 5 / 3, 4 / 3, 1], abs=1e-15)  # rounding of the times
    assert (even.units, even.resolution, even.name) == (rec.units, rec.resolution, rec.name)
    assert record().resample(record().sample_time).u == pytest.approx(record().u, abs=1e-14)
    assert rec.resample(0.2).t.tolist() == [0.0, 0.2, 0.4]  # what lies after the last whole step is left out


@pytest.mark.parametrize("step", [0.0, -1.0, 0.31, 1e-12, math.nan, math.inf])
def test_a_step_that_does_not_fit_the_record_is_refused(step):
    assert_refused("sample_time must be from", record().resample, step)


@given(st.floats(-0.01, 0.01), st.floats(-1e-5, 1e-5), st.booleans())
def test_a_drift_is_taken_off_and_the_loop_stays(slope, curvature, has_time):
    u = np.sin(np.linspace(0.0, 10.0 * np.pi, 251) - np.pi / 2)
    loop = u + 0.3 * np.cos(np.linspace(0.0, 10.0 * np.pi, 251) - np.pi / 2)
    k = np.arange(251.0)
    drifting = hs.Record(u=u, y=loop + slope * k + curvature * k**2, t=0.1 * k if has_time else None, units={"y": "um"})
    flat = drifting.detrend(2)
    assert np.ptp(flat.y - loop) < 1e-9  # rounding of the fit: the periods are the same to the last digits only
    assert flat.y.mean() == pytest.approx(drifting.y.mean(), abs=1e-9)  # all samples are in complete cycles
    assert (flat.u.tolist(), dict(flat.units)) == (drifting.u.tolist(), {"y": "um"})


def test_a_record_is_split_at_samples_and_fractions():
    rec = hs.Record(u=range(10), y=range(10), units={"u": "V"}, name="loop")
    assert [part.u.tolist() for part in rec.split(3, 0.8)] == [[0, 1, 2], [3, 4, 5, 6, 7], [8, 9]]
    assert {(part.name, part.units["u"]) for part in rec.split(np.int64(3), np.float64(0.8))} == {("loop", "V")}
    for places, message in (((), "needs a place"), ((9,), r"got \[9, 1\]"), ((5, 4), r"got \[5, -1, 6\]")):
        assert_refused(message, rec.split, *places)
    for place in (True, 1.0, "half", math.nan):
        assert_refused("a place must be a sample's number or a fraction", rec.split, place, error=TypeError)


def test_units_change_by_their_prefix():
    rec = hs.datasets.table1()
    other = rec.convert({"y": "nm", "u": "kV", "t": "ms"})
    assert (other.y[1], other.u[1], other.t[1], other.resolution) == (79.0, 0.005, 1000.0, 0.0763 * 1000)
    assert dict(other.units) == {"t": "ms", "u": "kV", "y": "nm"}
    assert rec.convert({"y": "\u00b5m"}).y.tolist() == rec.convert({"y": "\u03bcm"}).y.tolist() == rec.y.tolist()
    assert hs.Record(u=[0, 1], y=[0, 3], units={"y": "mm"}).convert({"y": "m"}).y[1] == 0.003


test_units_that_are_others_are_refused = refused(
    ({"y": "V"}, "'um' cannot become 'V': only the prefix of a unit can change"),
    ({"y": "px"}, "'px' is not a known unit with an SI prefix"),
    ({"y": ""}, "'' is not a known unit"),
    ({"z": "m"}, "the record has no 'z' with a unit to convert"),
    call=lambda units: hs.datasets.table1().convert(units),
)


@settings(max_examples=6)  # two Fourier transforms each
@given(st.sampled_from([0.1, 0.0763, 5.0, 1e-3, 2.0**-10, 3e7]), st.integers(0, 9), st.floats(-1.0, 1.0))
def test_the_quantum_of_a_sensor_is_found(quantum, seed, shift):
    levels = np.unique(np.random.default_rng(seed).integers(-200, 200, 60))
    if math.gcd(*np.diff(levels).tolist()) == 1:
        rec = hs.Record(u=levels, y=quantum * (levels + shift))
        assert rec.detect_resolution() == pytest.approx(quantum, rel=1e-12)  # rounding of the products
        off = 0.05 * np.sin(levels)  # steps
        crooked = hs.Record(u=levels, y=quantum * (levels + shift + off)).detect_resolution()
        assert crooked == pytest.approx(quantum, rel=0.05 / levels.size**0.5)  # of a mean of so many


def test_the_camera_of_table_1_is_found_below_its_decimals():
    table1 = hs.datasets.table1()
    assert table1.detect_resolution() == table1.resolution == 0.0763
    assert hs.Record(u=table1.u, y=table1.u).detect_resolution() == 5.0
    noise = np.random.default_rng(0).normal(size=500)
    assert hs.Record(u=noise, y=np.round(noise, 3)).detect_resolution() == 0.001  # nothing but the decimals


@pytest.mark.parametrize("n", [2, 3, 5, 50, 5000])
def test_values_without_a_quantum_have_none(n):
    noise = np.random.default_rng(n).normal(size=n)
    for y in (noise, np.full(n, 2.0), 1e300 * noise, 1e-310 * noise, noise.astype("f4"), 1e9 + 1e-6 * noise):
        assert hs.Record(u=noise, y=y).detect_resolution() is None


@pytest.mark.extra("pandas")
def test_pandas_columns_with_any_index_are_arrays():
    import pandas as pd

    frame = pd.DataFrame({"u": [0.0, 1.0, 0.5, 0.0], "y": [0.0, 0.9, 0.6, 0.1]}, index=[7, 3, 3, -1])
    u, y = frame["u"].to_numpy(), frame["y"].to_numpy()
    law = hs.BoucWen(feedthrough=1.0)
    for kind in ("float64", "Float64", object):
        columns = frame.astype(kind)
        assert hs.Record(u=columns["u"], y=columns["y"]) == hs.Record(u=u, y=y)
        assert hs.loop_metrics(columns["u"], columns["y"]) == hs.loop_metrics(u, y)
        assert hs.simulate(hs.Line(slope=1.0), None, columns["u"]).y.tolist() == u.tolist()
        assert law.inverse_response(columns["y"]).tolist() == law.inverse_response(y).tolist()
        assert hs.metrics.rmse(columns["y"], columns["u"]) == hs.metrics.rmse(y, u)
    missing = pd.Series([0.0, None, 1.0], dtype="Float64")
    with pytest.raises((ValueError, TypeError), match=r"y must be finite, got nan at index 1|y must be numbers"):
        hs.Record(u=[0, 1, 2], y=missing)
    dates = pd.Series(pd.to_datetime(["2020-01-01", "2020-01-02"]))
    for times in (dates, dates.to_numpy(), dates.diff()):
        with pytest.raises(TypeError, match="t must be numbers, got dates or times: give seconds"):
            hs.Record(u=[0, 1], y=[0, 1], t=times)


@pytest.mark.parametrize(
    ("step", "decimals"), [(1.0 / 3.0, 4), (1.0 / 3.0, 2), (1.0 / 750.0, 4), (1.0 / 6400.0, 6), (0.7, 1)], ids=str
)
@pytest.mark.parametrize("begin", [0.0, 12.345])
def test_times_rounded_to_their_digits_are_even(step, decimals, begin):
    t = np.round(begin + step * np.arange(600), decimals)
    assert hs.Record(u=t, y=t, t=t).sample_time == pytest.approx(step, rel=1e-4)


def test_times_with_a_small_jitter_are_even():
    t = 0.01 * (np.arange(300) + 5e-5 * np.random.default_rng(0).uniform(-1.0, 1.0, 300))
    assert hs.Record(u=t, y=t, t=t).sample_time == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize(
    "t",
    [
        np.round(np.arange(40) / 3.0, 0).cumsum() + np.arange(40.0),
        np.append(np.arange(20.0), 20.02 + np.arange(20.0)),
        np.round(0.01 * (np.arange(300) + 0.2 * np.sin(np.arange(300))), 4),
    ],
    ids=["growing steps", "a gap", "jitter beyond the digits"],
)
def test_times_that_are_not_even_say_what_to_pass(t):
    with pytest.raises(ValueError, match=r"evenly spaced, .*: pass record.resample\(.*--sample-time"):
        _ = hs.Record(u=t, y=t, t=t).sample_time


def test_a_lag_takes_part_in_a_comparison_with_rounded_times():
    t = np.round(np.arange(150) / 3.0, 4)
    u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=50)[:150]
    y = hs.TransferFunction(num=(1.0,), den=(2.0, 1.0)).response(u, 1.0 / 3.0)
    table = hs.compare(
        {"lag": hs.TransferFunction.structure(poles=1, zeros=0)}, hs.Record(t=t, u=u, y=y), cross_validate=None
    )
    assert table["lag"].fit_percent > 99.99


# ---------------------------------------------------- the tables of the paper, typed from it independently of the files


TABLE_1_NANOMETRES = (35024, 38542)  # sums of the displacements of part 1 and part 2
TABLE_1_PRINTED = [  # row, volts and nanometres of part 1, volts and nanometres of part 2
    (1, 0, 0, 125, 2671),
    (2, 5, 79, 120, 2599),
    (7, 30, 610, 95, 2137),
    (8, 35, 687, 90, 2137),
    (13, 60, 1297, 65, 1603),
    (17, 80, 1829, 45, 1221),
    (19, 90, 1984, 35, 919),
    (24, 115, 2439, 10, 305),
    (26, 125, 2671, 0, 0),
]


def nanometres(rec):
    return np.rint(1000 * rec.y).astype(int)


def test_table_1_is_the_printed_one():
    rec = hs.datasets.table1()
    assert len(rec) == 52
    assert (nanometres(rec)[:26].sum(), nanometres(rec)[26:].sum()) == TABLE_1_NANOMETRES
    for row, *printed in TABLE_1_PRINTED:
        k, m = row - 1, row + 25
        assert [rec.u[k], nanometres(rec)[k], rec.u[m], nanometres(rec)[m]] == printed


def test_table_1_lies_on_whole_pixels():
    rec = hs.datasets.table1()
    assert rec.resolution == 0.0763
    pixels = np.rint(rec.y / rec.resolution)
    assert np.abs(rec.y - pixels * rec.resolution).max() < 0.005  # as the file says


def test_table_1_takes_the_dwell_as_its_step():
    rec = hs.datasets.table1(dwell=0.7)
    assert rec.sample_time == pytest.approx(0.7, rel=1e-12)  # a mean of 51 rounded steps
    assert (rec.t[0], dict(rec.units), rec.name) == (0.0, {"t": "s", "u": "V", "y": "um"}, "Table 1")


@pytest.mark.parametrize("dwell", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_dwell_is_refused(dwell):
    assert_refused("dwell must be positive and finite", hs.datasets.table1, dwell=dwell)


def test_table_2_is_the_printed_one():
    rec = hs.datasets.table2()
    assert rec.u.tolist() == [18, 18, 50, 50, 18, 18, 50, 50, 18, 18]
    assert nanometres(rec).tolist() == [11224, 11224, 12245, 12245, 11224, 11224, 12245, 12245, 11224, 11224]
    assert rec.t[4] == pytest.approx(1 / 1.01626, rel=1e-15)  # one rounding
    assert rec.resolution is None


@pytest.mark.parametrize("name", ["table1", "table2"])
def test_the_files_name_their_source_and_can_be_loaded(name):
    path = files("hysim") / "data" / f"{name}.csv"
    assert "Jurnal Teknologi, 2016" in path.read_text(encoding="utf-8")
    rec = getattr(hs.datasets, name)()
    loaded = hs.load(path, u="voltage", y="displacement")
    assert np.array_equal(loaded.u, rec.u)
    assert np.array_equal(loaded.y, rec.y)
    assert dict(loaded.units) == {"u": "V", "y": "um"}
