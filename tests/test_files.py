"""Records come from files of every format and go into them to the bit; what is damaged ends in one clear line."""

import io
import struct
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from malformed_files import HAS_H5PY, MAT73_TITLE, MAT_TITLE, U, Y, corpus, corrupt, hdf5, lying, mat, npy, npz, whole
from scipy.io import loadmat
from strategies import assert_refused

import hysim as hs
from hysim.cli import main

CORPUS = corpus()
ENDINGS = [".csv", ".tsv", ".npz", ".mat", *([".h5"] if HAS_H5PY else [])]
pytestmark = pytest.mark.extra()  # more of them with h5py
PRINTED = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def records(draw) -> hs.Record:
    u, y = zip(*draw(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=2, max_size=12)), strict=True)
    times = draw(st.none() | st.lists(NUMBERS, min_size=len(u), max_size=len(u), unique=True))
    return hs.Record(
        u=u,
        y=y,
        t=None if times is None else sorted(times),
        units=draw(st.dictionaries(st.sampled_from("tuy"), st.sampled_from(["V", "um", ""]) | PRINTED)),
        resolution=draw(st.none() | st.floats(1e-300, 1e300)),
        name=draw(st.just("") | PRINTED),
    )


def bits(rec: hs.Record) -> list[bytes]:
    return [values.tobytes() for values in (rec.u, rec.y, rec.t) if values is not None]


def load(content: bytes, **options):
    return hs.load(io.BytesIO(content), **options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("files")


@pytest.mark.parametrize("ending", ENDINGS)
@settings(max_examples=30)
@given(rec=records())
def test_a_saved_record_comes_back_to_the_bit(folder, ending, rec):
    path = folder / f"loop{ending}"
    hs.save_record(rec, path)
    back = hs.load(path)
    assert back == rec  # without a name, too: that of the file is none that a record was given
    assert bits(back) == bits(rec)
    path.unlink()


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_saved_record_has_the_same_bytes_each_time(ending, tmp_path):
    first, second = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
    for path in (first, second):
        hs.save_record(hs.datasets.table1(), path)
    assert first.read_bytes() == second.read_bytes()
    assert hs.load(first) == hs.datasets.table1()


def test_what_cannot_be_saved_leaves_what_was_there(tmp_path, monkeypatch):
    rec = hs.datasets.table1()
    (tmp_path / "loop.npz").write_bytes(b"before")
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    assert_refused("No space left", hs.save_record, rec, tmp_path / "loop.npz", error=OSError)
    with pytest.raises(FileNotFoundError, match="none") as refused:
        hs.save_record(rec, tmp_path / "none" / "loop.npz")
    assert refused.value.filename == str(tmp_path / "none" / "loop.npz")  # and not that of the new file beside it
    with pytest.raises(ValueError, match=r"loop\.txt: the ending must be one of \.csv, \.tsv, .* got '\.txt'"):
        hs.save_record(rec, tmp_path / "loop.txt")
    for name in ("a\0", "\ud800"):
        with pytest.raises(ValueError, match="letters that can be written"):
            hs.save_record(hs.Record(u=[0, 1], y=[0, 1], name=name), tmp_path / "loop.csv")
    assert_refused("takes a Record, got ndarray", hs.save_record, U, tmp_path / "loop.csv", error=TypeError)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("loop.npz", b"before")]


@pytest.mark.parametrize("pack", [npz, mat], ids=["npz", "mat"])
def test_arrays_are_columns_by_name_and_by_number(pack):
    x = np.column_stack([U, Y, U + Y])
    content = pack({"x": x, "load": U, "travel": Y, "t": np.arange(5.0), "load_units": np.array("kN"), "rate": 5.0})
    by_name = load(content, u="load", y="travel")
    assert (by_name.y.tolist(), dict(by_name.units)) == (Y.tolist(), {"u": "kN"})
    assert by_name.t.tolist() == [0, 1, 2, 3, 4]  # called t
    assert load(content, u="load", y="travel", t=False).t is None
    assert load(content, u=1, y=2) == by_name
    assert load(content, u="x[0]", y="x[2]").y.tolist() == (U + Y).tolist()
    assert_refused(r"'x' has shape \(5, 3\): name one of its columns, such as 'x\[0\]'", load, content, u=0, y=1)
    assert_refused(r"it has no column \[3\]; samples run along the first axis", load, content, u="x[3]", y=1)
    assert_refused(r"no array 9, the arrays are: 0: x \(5 x 3\), 1: load", load, content, u=9, y=1)
    assert_refused("unequal numbers of samples: 'load' 5, 'rate' 1", load, content, u="load", y="rate")


def test_one_array_has_its_columns_by_number():
    for content in (npy(np.column_stack([U, Y])), npz({"x": np.column_stack([U, Y])})):
        assert load(content, u=0, y=1) == hs.Record(u=U, y=Y, name="stream")
    cube = npz({"x": np.stack([np.column_stack([U, Y])] * 2, axis=2)})
    assert load(cube, u="x[0,1]", y="x[1, 1]").y.tolist() == Y.tolist()


@pytest.mark.parametrize("dtype", ["<f4", ">f8", "i1", "u2", "<i8", ">i4", "?", "f2"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_numbers_of_any_type_and_order_are_read(dtype, order):
    values = np.asarray([[0, 1], [1, 0], [1, 1]], dtype=dtype, order=order)
    contents = [npz({"x": values}), npy(values)]
    if dtype != "f2":  # which MATLAB does not have
        contents += [mat({"x": values}), mat({"x": values}, do_compression=True)]
    for content in contents:
        assert load(content, u=0, y=1) == hs.Record(u=[0, 1, 1], y=[1, 0, 1], name="stream")


def test_numbers_of_npz_that_have_changed_are_refused_by_their_checksum():
    content = npz({"u": U, "y": Y})
    for values in (U, Y):  # their last byte
        at = content.index(values.tobytes()) + values.nbytes - 1
        with pytest.raises(ValueError, match="the NPZ file is damaged: BadZipFile Bad CRC-32"):
            load(content[:at] + b"\x7f" + content[at + 1 :])


def test_encrypted_npz_is_refused():
    content = npz({"u": U, "y": Y})
    at = content.index(b"PK\x01\x02") + 8  # the flags of the first entry in the directory
    assert_refused("array 'u' is encrypted or packed in another way", load, content[:at] + b"\1" + content[at + 1 :])


def test_headers_of_python_2_are_read_without_a_warning():
    content = npz({"u": lying(5, U.tobytes(), "5L"), "y": Y})
    assert load(content) == hs.Record(u=U, y=Y, name="stream")


def test_the_first_of_several_arrays_in_one_npy_file_is_read():
    assert load(npy(np.column_stack([U, Y])) + npy(Y), u=0, y=1).y.tolist() == Y.tolist()


@pytest.mark.parametrize(
    "shape",
    ["-5", "-5,-1", "5 if 5 else 4", "True and 5", "5 .real", "9" * 5000, "-" * 9000 + "5", "(" * 5000 + "5"],
    ids=lambda shape: shape[:12],
)
def test_a_shape_that_is_none_is_one_clear_line(shape):
    with pytest.raises(ValueError, match=r"(array 'u'|the NPZ file) is damaged") as refused:
        load(npz({"u": lying(0, U.tobytes(), shape), "y": Y}))
    assert len(str(refused.value)) < 300


@settings(max_examples=20)
@given(st.lists(st.sampled_from(["f8", "f4", "i2", "u1", "?"]), min_size=1, max_size=4), st.booleans())
def test_matlab_variables_are_read_as_scipy_reads_them(dtypes, is_compressed):
    rng = np.random.default_rng(len(dtypes))
    variables = {f"x{k}": rng.integers(0, 2, (3, 2)).astype(dtype) for k, dtype in enumerate(dtypes)}
    content = mat({**variables, "rec": variables, "cells": np.array([1, "a"], object)}, do_compression=is_compressed)
    for name, expected in loadmat(io.BytesIO(content)).items():
        if name in variables:
            for prefix in ("", "rec."):
                rec = load(content, u=f"{prefix}{name}[0]", y=f"{prefix}{name}[1]")
                assert np.column_stack([rec.u, rec.y]).tolist() == expected.astype(float).tolist()


def test_fields_of_structs_are_reached_by_a_point_or_a_slash():
    content = mat({"rec": {"u": U, "inner": {"y": Y}, "note": "by hand", "none": np.empty(0)}}, do_compression=True)
    assert load(content, u="rec.u", y="rec/inner/y").y.tolist() == Y.tolist()
    listed = (
        r"no array 'u', the arrays are: 0: rec.u \(5 x 1\), 1: rec.inner.y \(5 x 1\), 2: rec.note \(text\), 3: rec.none"
    )
    assert_refused(listed, load, content)


def test_cells_in_cells_in_a_struct_are_not_entered():
    levels = 50_000  # of which `scipy.io.loadmat` overflows the stack
    cells = b"".join(
        struct.pack("<IIIIIIIIiiHHI", 14, 48 * (levels - k) - 8, 6, 8, 1, 0, 5, 8, 1, 1, 1, 1, ord("c"))
        for k in range(levels)
    )
    fields = mat({"u": U})[128:] + mat({"y": Y})[128:] + cells
    inner = struct.pack("<IIIIIIiiHH4s", 6, 8, 2, 0, 5, 8, 1, 1, 1, 3, b"rec")
    inner += struct.pack("<HHIII8s8s8s", 5, 4, 8, 1, 24, b"u", b"y", b"cells") + fields
    content = MAT_TITLE + bytes(8) + struct.pack("<HHII", 0x0100, 0x4D49, 14, len(inner)) + inner
    assert load(content, u="rec.u", y="rec.y") == hs.Record(u=U, y=Y, name="stream")
    assert_refused(r"array 'rec\.cells' holds cells", load, content, u="rec.u", y="rec.cells")


def test_structs_in_structs_are_entered_to_a_limit():
    structs = {"y": Y}
    for _ in range(40):
        structs = {"s": structs, "u": U}
    content = mat({"rec": structs, "u": U, "y": Y})
    assert load(content, u="rec.s.s.s.u", y="y") == hs.Record(u=U, y=Y, name="stream")
    assert_refused(r"'rec(\.s){17}' holds several structs", load, content, u="rec" + 17 * ".s")


def test_a_file_from_a_machine_of_the_other_byte_order_is_read():
    numbers = struct.pack(">3d", 0.0, 1.0, 4.0)
    inner = struct.pack(">IIII", 6, 8, 6, 0) + struct.pack(">IIii", 5, 8, 3, 1) + struct.pack(">HHcxxx", 1, 1, b"u")
    inner += struct.pack(">II", 9, 24) + numbers
    content = b"MATLAB 5.0 MAT-file".ljust(124) + b"\1\0MI" + struct.pack(">II", 14, len(inner)) + inner
    assert load(content, u="u", y="u").u.tolist() == [0.0, 1.0, 4.0]


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize(
    ("type_", "code"),
    [(1, "b"), (2, "B"), (3, "h"), (4, "H"), (5, "i"), (6, "I"), (7, "f"), (9, "d"), (12, "q"), (13, "Q")],
)
def test_numbers_in_mat_files_are_of_their_type_and_byte_order(order, type_, code):
    values = [1, 2, -3 if code.islower() else 1 << (8 * struct.calcsize(code) - 1)]  # the largest power without a sign
    numbers = struct.pack(f"{order}3{code}", *values)

    def matrix(name):
        inner = struct.pack(f"{order}IIII", 6, 8, 6, 0) + struct.pack(f"{order}IIii", 5, 8, 3, 1)
        inner += struct.pack(f"{order}II", 1, 1) + name + bytes(7)
        inner += struct.pack(f"{order}II", type_, len(numbers)) + numbers + bytes(-len(numbers) % 8)
        return struct.pack(f"{order}II", 14, len(inner)) + inner

    title = b"MATLAB 5.0 MAT-file".ljust(124) + (b"\0\1IM" if order == "<" else b"\1\0MI")
    rec = load(title + matrix(b"u") + matrix(b"y"))
    assert rec.u.tolist() == rec.y.tolist() == values


def test_missing_values_are_treated_alike_in_every_format():
    u, y = np.arange(6.0), np.array([0.0, 1.0, np.nan, 3.0, 4.0, 5.0])
    text = "u,y\n" + "".join(f"{a},{b}\n" for a, b in zip(u, y, strict=True))
    for content, place in (
        (text.encode(), "line 4"),
        (npz({"u": u, "y": y}), "sample 2"),
        (mat({"u": u, "y": y}), "sample 2"),
    ):
        assert_refused(f"stream: {place}, column 'y': the value is missing; on_missing=\"drop\"", load, content)
        assert load(content, on_missing="drop").u.tolist() == [0, 1, 3, 4, 5]
        assert [part.u.tolist() for part in load(content, on_missing="split")] == [[0, 1], [3, 4, 5]]
    with pytest.raises(ValueError, match=r"sample 3: time must increase, got 1\.0 after 2\.0; .* t=False"):
        load(npz({"t": np.array([0.0, 1.0, 2.0, 1.0]), "u": u[:4], "y": u[:4]}))


def test_what_is_said_goes_before_what_the_file_says():
    content = npz({"u": U, "y": Y, "y_units": np.array("um"), "resolution": np.array(0.25), "name": np.array("mine")})
    rec = load(content, units={"u": "V"}, resolution=0.5, name="loop")
    assert (dict(rec.units), rec.resolution, rec.name) == ({"u": "V", "y": "um"}, 0.5, "loop")
    assert load(content, u="y", y="u").resolution is None  # it is that of y
    assert load(content).name == "mine"
    odd = npz({"u": U, "y": Y, "name": U, "resolution": np.array(-1.0), "u_units": U})
    assert load(odd) == hs.Record(u=U, y=Y, name="stream")


@pytest.mark.parametrize("argument", [{"delimiter": ","}, {"decimal": "."}, {"encoding": "utf-8"}])
def test_what_is_for_text_is_refused_with_another_format(argument):
    message = f"stream: {next(iter(argument))} is for text, this is a file of the format npz"
    assert_refused(message, load, npz({"u": U, "y": Y}), **argument)


def test_the_resolution_can_be_that_of_the_values():
    steps = np.round(Y / 0.0763) * 0.0763
    assert load(npz({"u": U, "y": steps}), resolution="detect").resolution == 0.0763
    assert load(npz({"u": U, "y": np.sqrt(2.0 + U + Y)}), resolution="detect").resolution is None
    with pytest.raises(ValueError, match="resolution must be a number or \"detect\", got 'guess'"):
        load(npz({"u": U, "y": Y}), resolution="guess")


@pytest.mark.parametrize("name", CORPUS)
def test_a_malformed_file_is_one_clear_line(name, tmp_path):
    content, message = CORPUS[name]
    path = tmp_path / name
    path.write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=message) as refused:
            hs.load(path)
        assert_refused(message, hs.load, io.BytesIO(content))
        assert tracemalloc.get_traced_memory()[1] < 2e7  # far below the gigabytes that some say they have
    finally:
        tracemalloc.stop()
    assert str(refused.value).startswith(name)
    assert len(str(refused.value).splitlines()) == 1
    assert list(tmp_path.iterdir()) == [path]


def test_a_text_that_is_too_large_is_refused_unread(tmp_path):
    with (tmp_path / "loop.csv").open("wb") as file:
        file.truncate(10**12)  # takes no space
    message = r"loop\.csv is too large: a text .* may have 500,000,000 bytes, got 1000000000000"
    assert_refused(message, hs.load, tmp_path / "loop.csv")
    assert_refused(r"stream is too large", hs.load, _Endless())
    assert_refused("load takes a path, an open file or a DataFrame, got int", hs.load, 5, error=TypeError)


class _Endless:
    """A device that never ends."""

    def read(self, size: int) -> memoryview:
        return memoryview(ZEROS)[:size]


ZEROS = bytes(2**20)


@settings(max_examples=300)
@given(seed=st.integers(0, 2**32 - 1))
def test_whatever_is_in_a_file_is_a_record_or_one_clear_line(folder, seed):
    name, content = corrupt(seed)
    path = folder / name
    path.write_bytes(content)
    for options in ({}, {"u": 0, "y": 1, "on_missing": "split"}):
        try:
            hs.load(path, **options)
        except ValueError as error:
            message = str(error)
        else:
            message = name
        assert message.startswith(name)
        assert len(message.splitlines()) == 1
    path.unlink()
    assert not list(folder.iterdir())


def test_whole_files_of_the_fuzz_are_read():
    for form, content in whole().items():
        if not form.endswith("-inside"):
            columns = {"mat-7.3": {"y": "rec.y"}, "h5": {"y": "group/y"}, "npy": {"u": 0, "y": 1}}.get(form, {})
            assert len(load(content, on_missing="drop", **columns)) in (2, 3, 4, 5), form


@pytest.mark.extra("h5py")
def test_a_file_of_matlab_7_3_h5_has_its_axes_in_matlabs_order():
    def fill(file):
        file["x"] = np.stack([U, Y, U, Y, U])  # 5 x 5, as MATLAB writes the columns u, y, u, y, u
        file["rec/u"] = U[None]
        file["note"] = np.array([[104], [105]], dtype="u2")
        file["note"].attrs["MATLAB_class"] = np.bytes_("char")
        file["empty"] = np.array([0, 0], dtype="u8")
        file["empty"].attrs["MATLAB_empty"] = np.uint8(1)
        file["u_units"] = np.array([[0xB5], [86]], dtype="u2")
        file["u_units"].attrs["MATLAB_class"] = np.bytes_("char")
        file["u"] = U[None]
        file["#refs#/a"] = U

    content = hdf5(fill, MAT73_TITLE)
    rec = load(content, y="x[1]")
    assert (rec.u.tolist(), rec.y.tolist(), dict(rec.units)) == (U.tolist(), Y.tolist(), {"u": "\u00b5V"})
    assert load(content, u="rec.u", y="rec/u").u.tolist() == U.tolist()
    assert_refused(r"0: empty \(0\), 1: note \(text\), 2: rec.u \(5 x 1\), 3: u \(5 x 1\), 4: u_units", load, content)


@pytest.mark.extra("h5py")
def test_compressed_chunks_of_h5_are_read(tmp_path):
    import h5py

    u = np.arange(1000.0)
    for options in (
        {"compression": "gzip"},
        {"compression": "lzf"},
        {"compression": "gzip", "shuffle": True, "fletcher32": True},
        {},
    ):
        with h5py.File(tmp_path / "loop.h5", "w") as file:
            file.create_dataset("u", data=u, chunks=(64,), **options)
            file.create_dataset("deep/er/y", data=2 * u, chunks=(64,), **options)
            file["u"].attrs["units"] = np.bytes_("V")
            file["loop"] = file["deep"]  # a group in two places, and one in itself
            file["deep/deep"] = file["deep"]
        rec = hs.load(tmp_path / "loop.h5", y="deep/er/y")
        assert (rec.y.tolist(), dict(rec.units)) == ((2 * u).tolist(), {"u": "V"})


@pytest.mark.extra("h5py")
@pytest.mark.parametrize("length", [8, 10_000])
@pytest.mark.parametrize("options", [{"shuffle": True}, {"fletcher32": True}, {"compression": "gzip"}], ids=str)
def test_chunks_of_h5_of_another_length_are_refused(options, length):
    def fill(file):
        file.create_dataset("u", data=U, chunks=(5,), **options)
        packed = zlib.compress(bytes(length)) if "compression" in options else bytes(length)
        file["u"].id.write_direct_chunk((0,), packed)
        file["y"] = Y

    assert_refused("the file is damaged: a chunk does not have the 40 bytes it says", load, hdf5(fill))


@pytest.mark.extra("h5py")
def test_heaps_in_heaps_of_h5_end_soon():
    n = 10_000  # heaps, each up to the end of the file: walking through each of them takes minutes
    heaps = b"".join(
        struct.pack("<HHIQ", 1, 0, 0, 16) + b"GCOL\1\0\0\0" + struct.pack("<Q", 32 * (n - k) - 16) for k in range(n)
    )
    assert_refused("the HDF5 file is damaged: its heaps overlap", load, whole()["h5"] + heaps, y="group/y")


def test_h5_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    assert_refused(r"needs h5py: pip install 'hysim\[io\]'", load, b"\x89HDF\r\n\x1a\n" + bytes(600))
    assert_refused(r"needs h5py: pip install 'hysim\[io\]'", hs.save_record, hs.datasets.table1(), tmp_path / "loop.h5")
    assert not list(tmp_path.iterdir())


def test_the_shell_asks_for_the_library_of_h5_before_it_computes(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    arguments = ["simulate", str(tmp_path / "no.json"), str(tmp_path / "no.csv"), "--out", str(tmp_path / "out.h5")]
    assert main(arguments) == 2  # and not that there is no such model
    assert "a file of HDF5 needs h5py: pip install 'hysim[io]'" in capsys.readouterr().err


def test_the_command_line_takes_and_writes_every_format(tmp_path, capsys):
    law = hs.Line(slope=0.0312, offset=0.5)
    u = hs.signals.triangle(0.0, 100.0, cycles=2, samples_per_cycle=40)
    rec = hs.Record(u=u, y=np.round(np.sqrt(1.0 + u), 2), units={"u": "V", "y": "um"})
    hs.save(law, tmp_path / "law.json", units=rec.units)
    for ending in ENDINGS:
        loop, out = tmp_path / f"loop{ending}", tmp_path / f"out{ending}"
        hs.save_record(rec, loop)
        assert main(["metrics", str(loop)]) == 0
        assert "the output has steps of 0.01 um: --resolution detect takes them" in capsys.readouterr().out
        assert main(["metrics", str(loop), "--resolution", "detect"]) == 0
        assert "steps" not in capsys.readouterr().out
        assert main(["simulate", str(tmp_path / "law.json"), str(loop), "--out", str(out)]) == 0
        assert hs.load(out) == hs.Record(u=u, y=law.response(u), units=rec.units, name="out")
    assert main(["simulate", str(tmp_path / "law.json"), str(loop), "--out", str(tmp_path / "out.xyz")]) == 2
    assert "the ending must be one of" in capsys.readouterr().err
    assert main(["metrics", str(tmp_path / "loop.npz"), "--y", "z"]) == 2
    assert "no array 'z', the arrays are: 0: u (81), 1: y (81), 2: u_units (text)" in capsys.readouterr().err


MICROMAG = """MicroMag 2900/3900 Data File (Series 0015)
First-order reversal curves
Configuration   :  VSM
Units of measure:  Hybrid SI
NCrv            = 2

+2.000000E-01,+9.000000E-05

+1.000000E-01,+5.000000E-05
+2.000000E-01,+8.000000E-05

+2.000000E-01,+9.000000E-05

-1.000000E-01,-5.000000E-05

MicroMag 2900/3900 Data File ends
"""


def micromag(tmp_path, text=MICROMAG, name="curves.forc"):
    path = tmp_path / name
    path.write_text(text, encoding="latin-1")
    return path


def test_field_and_moment_of_a_magnetometer_are_a_path(tmp_path):
    record = hs.load(micromag(tmp_path))
    assert record.u.tolist() == [0.2, 0.1, 0.2, 0.2, -0.1]
    assert record.y.tolist() == [9e-5, 5e-5, 8e-5, 9e-5, -5e-5]
    assert record.units == {"u": "T", "y": "A m^2"}
    in_cgs = hs.load(micromag(tmp_path, MICROMAG.replace("Hybrid SI", "cgs")))
    assert in_cgs.units == {"u": "Oe", "y": "emu"}
    assert hs.load(micromag(tmp_path, MICROMAG.replace("Hybrid SI", "odd"))).units == {}


def test_what_the_magnetometer_adjusted_is_in_further_columns(tmp_path):
    adjusted = "\n".join(f"{line},+1.5,-2.5e-06" if line[:1] in "+-" else line for line in MICROMAG.split("\n"))
    path = micromag(tmp_path, adjusted.replace("Data File ends", "Data File \xb0 ends"), "loop.hys")
    assert [each.name for each in hs.list_columns(path)] == ["u", "y", "adjusted_u", "adjusted_y"]
    assert hs.load(path, y="adjusted_y").y[0] == -2.5e-06
    assert hs.list_columns(path)[3].unit == "A m^2"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("MicroMag 2900/3900 Data File ends", "", "the file is cut"),
        ("-1.000000E-01,", "-1.000000E-01,+1.0,+1.0,", "the same 2 to 4 numbers"),
        ("-1.000000E-01,", "-1.0000.0E-01,", "is damaged"),
    ],
)
def test_a_damaged_magnetometer_file_is_one_line(tmp_path, old, new, message):
    assert_refused(message, hs.load, micromag(tmp_path, MICROMAG.replace(old, new)))
