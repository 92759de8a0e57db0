"""The tables hold the values that the paper prints.

The numbers below were typed from the paper independently of the files.
"""

from importlib.resources import files

import numpy as np
import pytest

import hysim as hs

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
    with pytest.raises(ValueError, match="dwell must be positive and finite"):
        hs.datasets.table1(dwell=dwell)


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
