"""A record never changes, and never forgets what is known about it."""

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest

import hysim as hs


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


def test_only_slices_cut_a_record():
    with pytest.raises(TypeError, match="cut by a slice, got 0"):
        record()[0]
    with pytest.raises(ValueError, match="at least 2 samples, got 1"):
        record()[:1]


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
    with pytest.raises(ValueError, match="evenly spaced"):
        _ = record(t=[0.0, 0.1, 0.2, 0.4]).sample_time
    with pytest.raises(ValueError, match="no time"):
        _ = record(t=None).sample_time


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"u": [0, 1, math.nan, 1]}, ValueError, "u must be finite, got nan at index 2"),
        ({"y": [0, 1, 2, math.inf]}, ValueError, "y must be finite, got inf at index 3"),
        ({"y": [0, 1, 2]}, ValueError, "u and y must have equal lengths, got 4 and 3"),
        ({"t": [0, 1, 2]}, ValueError, "u and t must have equal lengths, got 4 and 3"),
        ({"t": [0, 1, 1, 2]}, ValueError, "got 1.0 after 1.0 at sample 2"),
        ({"t": [0, 1, 2, 1.5]}, ValueError, "got 1.5 after 2.0 at sample 3"),
        ({"u": [[0, 1, 2, 1]]}, ValueError, "one axis, got shape"),
        ({"u": ["a", "b", "c", "d"]}, TypeError, "u must be numbers"),
        ({"u": [0, 1j, 0, 0]}, TypeError, "u must be real"),
        ({"units": {"z": "m"}}, ValueError, "units are labels"),
        ({"units": ["V"]}, TypeError, "units must be a mapping"),
        ({"resolution": 0.0}, ValueError, "resolution must be positive"),
    ],
)
def test_what_is_no_record_is_refused_with_its_place(changes, error, message):
    with pytest.raises(error, match=message):
        record(**changes)
