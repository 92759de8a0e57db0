"""Tables of pandas, polars, Arrow and xarray are records, and results are frames whose notes hold the units."""

import datetime
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from strategies import assert_refused, refused

import hysim as hs
from hysim.interop import heading, table_in

U = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=20)
Y = hs.BoucWen(beta=2.0).response(U)
T = 0.1 * np.arange(U.size)
UNITS = {"t": "s", "u": "V", "y": "um", "current": "A"}
RECORD = hs.Record(u=U, y=Y, t=T, units=UNITS, name="stack", resolution=0.01, channels={"T": 20, "current": np.sqrt(T)})

needs_pandas = pytest.mark.extra("pandas")
needs_xarray = pytest.mark.extra("xarray")


class Column:
    """A column of polars or Arrow: values, and no index."""

    def __init__(self, values):
        self._values = values

    def to_numpy(self):
        return np.array(self._values)


class PolarsLike:
    """What hysim uses of a frame of polars."""

    def __init__(self, columns):
        self._columns = columns
        self.columns, self.shape, self.dtypes = list(columns), (len(next(iter(columns.values()))), len(columns)), []

    def __getitem__(self, label):
        return Column(self._columns[label])


class ArrowLike:
    """What hysim uses of a table of Arrow, whose `columns` are no names."""

    def __init__(self, columns):
        self._columns = columns
        self.column_names, self.shape, self.columns = list(columns), (0, 0), [Column(each) for each in columns.values()]

    def column(self, label):
        return Column(self._columns[label])


@pytest.mark.parametrize("library", [PolarsLike, ArrowLike])
def test_frames_without_an_index_are_known_by_what_they_offer(library):
    table = library({"u": U, "y [um]": Y, "t (s)": T})
    wanted = hs.Record(u=U, y=Y, t=T, units={"t": "s", "y": "um"})
    assert hs.load(table) == hs.load(table, y="y [um]", t=2) == wanted
    assert hs.load(table, t=False).t is None
    assert hs.identify(hs.Line, table).estimates == hs.identify(hs.Line, wanted).estimates
    assert hs.identify(hs.Line, [table, wanted]).n_parameters == 2
    assert [(each.name, each.unit) for each in hs.list_columns(table)] == [("u", ""), ("y", "um"), ("t", "s")]


def test_missing_values_of_any_kind_are_missing_samples():
    for gap in (None, float("nan")):
        table = PolarsLike({"u": [0, 1, gap, 3, 4], "y": [0.0, 2.0, 4.0, 6.0, 8.0]})
        assert hs.load(table, on_missing="drop").u.tolist() == [0.0, 1.0, 3.0, 4.0]
        assert [len(part) for part in hs.load(table, on_missing="split")] == [2, 2]
        assert_refused("the PolarsLike: row 2, column 'u': the value is missing", hs.load, table)
        assert_refused("u must be finite, got nan at index 2", hs.identify, hs.Line, table)


def test_dates_and_time_spans_are_seconds():
    begin, step = datetime.datetime(2026, 3, 29, 0, 30, tzinfo=datetime.UTC), datetime.timedelta(milliseconds=500)
    columns = {
        "zoned": [begin + k * step for k in range(4)],
        "plain": np.array([(begin + k * step).replace(tzinfo=None) for k in range(4)], dtype="datetime64[us]"),
        "spans": [k * step for k in range(4)],
        "gaps": [begin, None, begin + 2 * step, begin + 3 * step],
    }
    table = PolarsLike({"u": [0, 1, 2, 3], "y": [0, 1, 2, 3], **columns})
    for name in ("zoned", "plain", "spans"):
        record = hs.load(table, t=name)
        assert record.t.tolist() == [0.0, 0.5, 1.0, 1.5]
        assert record.units["t"] == "s"
    assert hs.load(table, t="gaps", on_missing="drop").t.tolist() == [0.0, 1.0, 1.5]


test_tables_that_hold_no_record_are_refused_with_the_column = refused(
    ({"u": ["a", "b"], "y": [0, 1]}, r"column 'u' must hold numbers, got .*'a'.*: convert it first"),
    ({"u": [0, 1], "v": [0, 1]}, "no column 'y', the columns are: u, v; pass the column of the output as y="),
    ({"u": [0, 1], "y": [[0, 1], [2, 3]]}, r"column 'y' must have one axis, got shape \(2, 2\)"),
    ({"u": [0, 1], "u [V]": [0, 1], "y": [0, 1]}, "2 columns are called 'u'"),
    call=lambda columns: hs.load(PolarsLike(columns)),
)


def test_verbs_name_the_columns_that_a_table_lacks():
    table = PolarsLike({"voltage": U, "y": Y})
    lacking = "got a PolarsLike without u, with voltage and y: name the columns by hs.load"
    assert_refused(lacking, hs.identify, hs.Line, table)
    excess = "delimiter is for text, this is the PolarsLike: leave it out"
    assert_refused(excess, hs.load, table, u="voltage", delimiter=",")
    assert_refused("load takes a path, an open file or a DataFrame, got int", hs.load, 3, error=TypeError)


@pytest.mark.parametrize(
    ("label", "parts"),
    [
        *[(" u [V] ", ("u", "V")), ("a (b) (mm)", ("a (b)", "mm")), ("H/(A/m)", ("H", "A/m")), ("F / N", ("F", "N"))],
        *[(label, tuple(label.split("/", 1))) for label in ("Ewe/V", "<I>/mA", "v/mm/s", "F/kN")],
        *[
            (name, (name, ""))
            for name in ("u", "[V]", "dy/dt", "dQ/dV", "y/u", "a/b", "N/m", "1/s", "eta/%", "E/VReal")
        ],
    ],
)
def test_a_heading_is_a_name_and_a_unit(label, parts):
    assert heading(label) == parts


def test_hysims_own_values_and_classes_are_no_tables():
    sweep = hs.sweep(lambda a: a, {"a": [1.0, 2.0]}, executor="threads")
    for value in (
        RECORD,
        hs.simulate(hs.Line(slope=1.0), None, U),
        sweep,
        U,
        [U],
        hs.BoucWen,
        {"u": U},
        "u",
        PolarsLike,
    ):
        assert table_in(value) is None


def test_an_arrow_stream_is_read_by_pyarrow(monkeypatch):
    class Stream:
        def __arrow_c_stream__(self, requested_schema=None):
            raise AssertionError

    monkeypatch.setitem(sys.modules, "pyarrow", SimpleNamespace(table=lambda _: ArrowLike({"u": U, "y": Y})))
    assert hs.load(Stream()) == hs.Record(u=U, y=Y)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(TypeError, match="a Stream is an Arrow stream, which pyarrow reads: pip install pyarrow"):
        hs.load(Stream())


@needs_pandas
@pytest.mark.parametrize("record", [RECORD, RECORD[:2], hs.Record(u=U, y=Y), hs.datasets.table1()], ids=range(4))
def test_a_record_comes_back_from_its_frame_to_the_bit(record):
    assert hs.load(record.to_frame()) == record
    if record.t is not None:
        assert record.to_frame().index.name == "t"


@needs_pandas
def test_the_notes_of_every_frame_can_be_written():
    """Parquet and others write them as JSON."""
    import json

    run = hs.close_loop(hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), hs.PID(ki=2.0), T, np.ones(T.size))
    for result in (RECORD, run, hs.identify(hs.Line, RECORD), hs.compare({"a": hs.Line, "b": hs.SingleValued}, RECORD)):
        notes = result.to_frame().attrs
        assert json.loads(json.dumps(notes)) == notes


@needs_pandas
def test_an_index_is_time_if_it_looks_like_one_and_not_else():
    import pandas as pd

    dates = pd.date_range("2026-03-29", periods=U.size, freq="100ms", tz="Europe/Berlin")
    frame = pd.DataFrame({"u": U, "y": Y})
    for index in (
        dates,
        dates - dates[0],
        pd.Index(T),
        pd.Index(T, name="Time [s]"),
        pd.Index(np.arange(U.size), name="t"),
    ):
        indexed = frame.set_index(index)
        wanted = np.arange(U.size) if index.name == "t" else T
        for record in (
            hs.load(indexed),
            hs.Record(u=indexed["u"], y=indexed["y"]),
            hs.Record(u=indexed["u"], y=Y),
            hs.Record(u=U, y=indexed["y"]),
        ):
            np.testing.assert_allclose(record.t, wanted, atol=1e-9)  # dates are counted in nanoseconds
            if index.dtype.kind in "mM" or index.name == "Time [s]":
                assert record.units == {"t": "s"}
    for index in (
        pd.RangeIndex(U.size),
        pd.Index(np.arange(U.size)[::-1]),
        pd.Index(T, name="voltage"),
        pd.Index(list("ab") * 20 + ["a"]),
    ):
        indexed = frame.set_index(index)
        assert hs.load(indexed).t is None
        assert hs.Record(u=indexed["u"], y=indexed["y"]).t is None
    assert hs.Record(u=frame["u"].set_axis(dates), y=Y, t=2.0 * T).t.tolist() == (2.0 * T).tolist()
    assert hs.load(frame.assign(t=2.0 * T).set_index(dates)).t.tolist() == (2.0 * T).tolist()


@needs_pandas
def test_two_series_whose_times_differ_are_refused():
    import pandas as pd

    u, y = pd.Series(U, index=T), pd.Series(Y, index=T + 0.05)
    assert_refused("u and y must have the same times, got two indexes that differ: align them", hs.Record, u=u, y=y)


@needs_pandas
def test_units_come_from_the_notes_of_a_frame_and_of_a_series():
    import pandas as pd

    frame = pd.DataFrame({"u": U, "out": Y})
    frame.attrs["units"] = {"u": "V", "out": "um"}
    assert hs.load(frame, y="out").units == {"u": "V", "y": "um"}
    assert hs.Record(u=frame["u"], y=frame["out"]).units == {"u": "V", "y": "um"}
    assert hs.Record(u=frame["u"], y=frame["out"], units={"u": "kV"}).units == {"u": "kV", "y": "um"}
    alone = pd.Series(Y)
    alone.attrs["units"] = "nm"
    assert hs.Record(u=U, y=alone).units == {"y": "nm"}


@needs_pandas
def test_nullable_and_repeated_columns():
    import pandas as pd

    nullable = pd.DataFrame({"u": [0, None, 2, 3], "y": [0, 1, 2, 3]}, dtype="Float64")
    assert hs.load(nullable, on_missing="drop").u.tolist() == [0.0, 2.0, 3.0]
    twice = pd.DataFrame([[0, 1, 2], [3, 4, 5]], columns=["u", "u", "y"])
    assert_refused("2 columns are called 'u'", hs.load, twice)
    assert_refused("2 columns are called 'u': rename them", hs.load, twice, u=1)


@needs_pandas
def test_signals_are_the_columns_of_a_frame():
    law = hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.5, 1.0))
    run = hs.simulate(law, T, U, units={"u": "V", "y": "N", "z": "V"})
    frame = run.to_frame()
    assert frame.index.name == "t"
    assert frame.attrs["units"] == {"u": "V", "y": "N", "z_0": "V", "z_1": "V"}
    for name in frame:
        assert frame[name].tolist() == run.columns[name].tolist()
    loop = hs.close_loop(
        hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), hs.PID(ki=2.0), T, U, units={"t": "s", "u": "V", "y": "um"}
    )
    frame = loop.to_frame()
    assert list(frame) == ["reference", "error", "y", "measurement", "command", "drive", "u"]
    assert [frame.attrs["units"][name] for name in frame] == ["um"] * 4 + ["V"] * 3
    assert frame["error"].tolist() == loop.error.tolist()
    assert hs.load(frame) == hs.Record(u=loop.u, y=loop.y, t=T, units={"t": "s", "u": "V", "y": "um"})


@needs_pandas
def test_estimates_are_a_frame():
    fit = hs.identify(hs.BoucWen, RECORD, fixed={"n": 1.0, "feedthrough": 0.0})
    frame = fit.to_frame()
    assert frame.index.tolist() == list(fit.estimates)
    assert frame["estimate"].to_dict() == dict(fit.estimates)
    assert frame.loc[list(fit.free_names), "stderr"].to_dict() == dict(fit.stderr)
    assert tuple(frame.loc["beta", ["lower", "upper"]]) == tuple(fit.intervals["beta"])
    assert not frame.loc["n", "free"]
    assert np.isnan(frame.loc["n", "stderr"])
    assert frame.attrs["family"] == "BoucWen"
    selection = hs.select([hs.SingleValued, hs.Line], RECORD)
    candidates = selection.to_frame()
    assert candidates.index[0] == selection.name
    assert candidates["bic"].is_monotonic_increasing
    table = hs.compare({"line": hs.Line}, RECORD).to_frame()
    assert table.attrs["units"]["rmse [um]"] == "um"
    assert table.attrs["record"] == "stack"


@needs_xarray
def test_signals_are_a_dataset_with_named_axes():
    law = hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.5, 1.0))
    data = hs.simulate(law, T, U, units={"t": "s", "z": "V"}).to_xarray()
    assert dict(data["z"].sizes) == {"t": U.size, "z_0": 2}
    assert (data["z"].attrs["units"], data["t"].attrs["units"]) == ("V", "s")
    assert hs.load(data) == hs.Record(u=U, y=law.response(U), t=T, units={"t": "s"})
    assert hs.Record(u=data["u"], y=data["y"]) == hs.load(data)
    assert list(hs.simulate(law, None, U).to_xarray().dims) == ["sample", "z_0"]


@needs_pandas
def test_axes_of_structures_are_nodes_and_elements():
    from hysim.simulation import Simulation

    signals = {"t": T, "u": U, "y": Y, "displacement": np.ones((U.size, 3)), "peak_drift": np.ones((U.size, 2))}
    run = Simulation(u=U, y=Y, t=T, signals=signals, units={"displacement": "m"})
    assert run.to_frame().attrs["units"] == {f"displacement_{node}": "m" for node in (1, 2, 3)}
    pytest.importorskip("xarray")
    data = run.to_xarray()
    assert data["node"].values.tolist() == [1, 2, 3]
    assert data["peak_drift"].dims == ("t", "element")


@pytest.mark.extra("polars")
def test_frames_of_polars():
    import polars as pl

    begin = datetime.datetime(2026, 1, 1)
    table = pl.DataFrame(
        {
            "u": [0.0, None, 2.0, 3.0],
            "y [um]": [0, 1, 2, 3],
            "when": [begin + datetime.timedelta(seconds=k) for k in range(4)],
        }
    )
    record = hs.load(table, t="when", on_missing="drop")
    assert (record.t.tolist(), record.u.tolist()) == ([0.0, 2.0, 3.0], [0.0, 2.0, 3.0])
    assert record.units == {"t": "s", "y": "um"}


@pytest.mark.extra("pyarrow")
def test_tables_of_arrow():
    import pyarrow as pa

    table = pa.table({"u": [0.0, None, 2.0, 3.0], "y": [0, 1, 2, 3]})
    assert hs.load(table, on_missing="drop").u.tolist() == [0.0, 2.0, 3.0]


def test_without_pandas_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert_refused(r"to_frame needs pandas: pip install 'hysim\[tables\]'", RECORD.to_frame, error=ImportError)


@pytest.mark.parametrize(
    ("verb", "value", "message"),
    [
        (hs.save, RECORD, r"save takes a model of hysim, got Record: hs.save_record\(record, path\) writes a record"),
        (hs.save_record, hs.Line(), r"save_record takes a Record, got Line: .* hs.save\(model, path\) writes a model"),
        (
            hs.save_record,
            hs.simulate(hs.Line(), None, U),
            r"make one by hs.Record\(u=result.u, y=result.y, t=result.t\)",
        ),
        (hs.save_record, 3, r"save_record takes a Record, got int: make one by hs.Record\(u="),
    ],
)
def test_save_and_save_record_say_which_is_which(verb, value, message, tmp_path):
    assert_refused(message, verb, value, tmp_path / "file.csv", error=TypeError)
