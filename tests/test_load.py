"""Text files become records, and what cannot is refused with its line."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import assert_refused, refused, with_peak_memory

import hysim as hs
from hysim._basics.printing import csv_text
from hysim.files import FileColumn, _delimited

LOOP = "time [s],voltage [V],displacement (um),note\n0,0,0.0,up\n1,5,0.079,\n2,10,0.152,top\n"


def load(text, **options):
    return hs.load(io.StringIO(text), **{"u": "u", "y": "y"} | options)


def write(tmp_path, content):
    path = tmp_path / "loop.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_a_file_becomes_a_record_with_the_units_of_its_header(tmp_path):
    rec = hs.load(write(tmp_path, LOOP), u="voltage", y="displacement", t="time", resolution=0.0763)
    assert rec == hs.Record(
        u=[0, 5, 10],
        y=[0, 0.079, 0.152],
        t=[0, 1, 2],
        units={"t": "s", "u": "V", "y": "um"},
        resolution=0.0763,
        name="loop",
    )


def test_what_the_caller_says_goes_before_what_the_file_says():
    rec = load(LOOP, u="voltage", y="displacement", units={"y": "micrometre"}, name="mine")
    assert (dict(rec.units), rec.name) == ({"u": "V", "y": "micrometre"}, "mine")


@pytest.mark.parametrize("u", ["voltage", "voltage [V]", "voltage (V)", "voltage / V", 1])
def test_a_column_is_chosen_by_name_or_number(u):
    assert load(LOOP, u=u, y=2).u.tolist() == [0, 5, 10]
    assert load("0,1\n2,3\n", u=0, y=1).u.tolist() == [0, 2]  # without a header


@pytest.mark.parametrize(
    "text",
    [
        "u,y\n0,1\n2,3\n",
        "u;y\n0;1\n2;3\n",
        "u\ty\n0\t1\n2\t3\n",
        "  u   y\n  0   1\n  2   3\n",
        "u,y\r\n0,1\r\n2,3\r\n",
        "u,y\n0,1\n2,3",
        "\ufeffu,y\n0,1\n2,3\n",
        "# made by hand\n\nu, y\n# more\n0, 1\n\n  2, 3\n",
        '"u","y"\n"0","1"\n"2","3e0"\n',
    ],
    ids=["comma", "semicolon", "tab", "blanks", "windows", "no last newline", "byte order mark", "comments", "quotes"],
)
def test_the_layout_is_found(text, tmp_path):
    expected = hs.Record(u=[0, 2], y=[1, 3], name="loop")
    assert hs.load(write(tmp_path, text), u="u", y="y") == expected
    assert load(text, name="loop") == expected


def test_a_delimiter_can_be_said():
    assert load("u|y,z\n0|1\n2|3\n", y="y,z", delimiter="|").y.tolist() == [1, 3]
    assert load("u y;z\n0 1\n2 3\n", y="y;z", delimiter=" ").y.tolist() == [1, 3]


GAPS = "u,y\n0,0\n1,1\n2,\n3,3\n4,nan\n5,5\n6,6\nNA,7\n"


def test_samples_with_missing_values_can_be_dropped():
    rec = load(GAPS, on_missing="drop")
    assert (rec.u.tolist(), rec.y.tolist()) == ([0, 1, 3, 5, 6], [0, 1, 3, 5, 6])


def test_a_record_can_be_split_at_missing_values():
    pieces = load(GAPS, on_missing="split", units={"u": "V"}, name="run")
    assert [piece.u.tolist() for piece in pieces] == [[0, 1], [5, 6]]  # the lone sample at 3 is no record
    assert {(piece.name, piece.units["u"]) for piece in pieces} == {("run", "V")}
    assert [piece.u.tolist() for piece in load("u,y\n0,0\n1,1\n", on_missing="split")] == [[0, 1]]


def test_time_may_begin_again_after_a_gap():
    text = "t,u,y\n0,0,0\n1,1,1\n,,\n0,2,2\n1,3,3\n"
    assert [piece.t.tolist() for piece in load(text, t="t", on_missing="split")] == [[0, 1], [0, 1]]
    assert_refused("line 5: time must increase", load, text, t="t", on_missing="drop")


@pytest.mark.parametrize("mark", [".", "'", "\u2019", " ", "\u00a0", "\u202f"])
def test_thousands_are_read_where_they_can_mean_nothing_else(mark):
    rec = load(f"u;y\n-1{mark}000,5;1\n999,5;2\n12{mark}345{mark}678;3\n")
    assert rec.u.tolist() == [-1000.5, 999.5, 12345678.0]
    assert load('u,y\n"1,000.5",1\n2.5,3\n').u.tolist() == [1000.5, 2.5]


def test_a_header_above_the_names_is_skipped_and_the_lines_keep_their_numbers():
    text = "LabVIEW Measurement\nSeparator\tTab\n\nt\tu\ty\n0\t1\t2\n1\t2\t{}\n"
    assert load(text.format(4), skip=3).y.tolist() == [2.0, 4.0]
    assert_refused("line 6, column 'y': expected a finite number, got 'O'", load, text.format("O"), skip=3)
    assert_refused(r"line 1 names 1 columns, .* pass its number of lines as skip=", load, text.format(4))
    assert load("sep=;\nu;y\n0,5;1\n1,5;2\n").u.tolist() == [0.5, 1.5]


def test_other_signs_for_minus_are_read_and_times_of_day_are_refused():
    assert load("u,y\n\u22121.5,1\n2,3\n").u.tolist() == [-1.5, 2.0]
    with pytest.raises(ValueError, match=r"got '12:00:01' \(a time of day: write it in seconds, or load without time"):
        load("t,u,y\n12:00:01,1,2\n12:00:02,2,3\n")


@pytest.mark.parametrize(("sign", "decimal"), [(".", ","), (",", ".")])
def test_one_sign_is_between_thousands_only_if_it_is_said_to_be(sign, decimal):
    text = f"u;y\n1{sign}000;1\n2{sign}500{decimal}5;2\n12;3\n"
    assert load(text, thousands=sign).u.tolist() == [1000.0, 2500.5, 12.0]
    assert load(f"u;y\n1{sign}000;1\n2{sign}500;2\n").u.tolist() == [1.0, 2.5]
    with pytest.raises(ValueError, match="thousands must be a point, a comma, an apostrophe or a space that is not"):
        load(text, thousands=sign, decimal=sign)
    assert_refused("got '_'", load, text, thousands="_")


test_what_is_no_record_is_refused = refused(
    ("", "the file is empty"),
    ("\n# nothing\n", "the file is empty"),
    ("u,y\n", "no sample"),
    ("u,z\n0,1\n", "no column 'y', the columns are: u, z"),
    ("u,y,y\n0,1,2\n", "2 columns are called 'y': choose one of the numbers 1, 2"),
    ("u,y\n0,1\n2,high\n", "line 3, column 'y': expected a finite number, got 'high'"),
    ("u;y\n0.5;1\n2;3,5\n", r"line 3, column 'y': .* got '3,5' \(pass decimal=\",\""),
    ("u;y\n0,5;1\n2,5;1.234\n", r"line 3, column 'y': .* got '1.234' \(pass decimal=\"\.\" .*, thousands=\"\.\""),
    ("u;y\n0,5;1\n2,5;1.23,5\n", r"line 3, column 'y': expected a finite number, got '1.23,5'$"),
    ("u;y\n0.5;1\n2.5;12'34\n", r"line 3, column 'y': expected a finite number, got \"12'34\"$"),
    ("u,y\n0,1\nx,2\n3,4\n", "line 3, column 'u': expected a finite number, got 'x'"),
    ("0,x\n1,2\n3,4\n", "line 1 is half a header: column 0 holds the number '0', column 1 the text 'x'"),
    ("u,v\n1,2,3\n4,5,6\n", "line 1 names 2 columns, most lines below have 3 cells"),
    ("0,1\n2;3\n4,5\n", r"line 2: expected 2 cells, got 1 \(separated by comma\); correct the line"),
    ('u,y\n"0,1\n2,3\n', "line 2: a quoted cell is not closed"),
    ("u,y\n0,1\n1_0,3\n", "line 3, column 'u': expected a finite number, got '1_0'"),
    ("u,y\n0,1\n# note\n-inf,3\n", "line 4, column 'u': expected a finite number, got '-inf'"),
    ("u,y\n0,1\n2,3,4\n", "line 3: expected 2 cells, got 3"),
    ("u,y\n0,1\n2\n", "line 3: expected 2 cells, got 1"),
    ("u,y\n0,1\n", "at least 2 samples, there are 1"),
    ("u,y\n0\0,1\n", "not a text file"),
    (GAPS, r"line 4, column 'y': the value is missing; on_missing=\"drop\""),
    call=load,
)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32"])
def test_a_byte_order_mark_says_the_encoding(tmp_path, encoding):
    path = write(tmp_path, "u [\u00b5m],y\r\n0,1\r\n2,3\r\n".encode(encoding))
    rec = hs.load(path, u="u", y="y")
    assert (rec.y.tolist(), rec.units["u"]) == ([1, 3], "\u00b5m")
    with path.open("rb") as stream:
        assert hs.load(stream, u="u", y="y") == rec


def test_an_encoding_can_be_said(tmp_path):
    path = write(tmp_path, "u [\u00b5m],y\n0,1\n2,3\n".encode("latin-1"))
    assert hs.load(path, u="u", y="y", encoding="latin-1").units["u"] == "\u00b5m"
    assert_refused(r'loop\.csv is not a UTF-8 text file: .* encoding="latin-1"', hs.load, path, u="u", y="y")
    with pytest.raises(ValueError, match=r"loop\.csv: encoding must be one that Python knows, got 'latin-99'"):
        hs.load(path, u="u", y="y", encoding="latin-99")


@pytest.mark.parametrize("content", [b"\x89PNG\r\n\x1a\n\xff", b"\xff\xfe0"], ids=["image", "half a character"])
def test_a_file_that_is_no_text_is_refused_by_name(tmp_path, content):
    assert_refused(r"loop\.csv is not a UTF-\d+ text file", hs.load, write(tmp_path, content), u="u", y="y")


@pytest.mark.parametrize(
    "text",
    [
        "u;y\n0;1\n0,5;2\n1e1;-,25\n",
        "u\ty\n0,0\t1,0\n0,5\t2,0\n10,0\t-0,25\n",
        "u y\n0,0 1,0\n0,5 2,0\n10,0 -0,25\n",
        'u,y\n"0,0","1,0"\n"0,5","2,0"\n"10,0","-0,25"\n',
        "u, y\n0, 1\n0.5, 2\n10, -.25\n",
        "u; y; at\n0; 1; 9:00, up\n0.5; 2; 9:01, up\n10; -.25; 9:02, down\n",
        "at,u,y\n2020-01-01 10:00:00,0,1\n2020-01-01 10:00:01,0.5,2\n2020-01-01 10:00:02,10,-0.25\n",
    ],
    ids=["semicolon", "tab", "blank", "quoted", "comma and blank", "commas in a text", "dates"],
)
def test_delimiter_and_decimal_sign_are_those_that_give_numbers(text):
    rec = load(text)
    assert (rec.u.tolist(), rec.y.tolist()) == ([0, 0.5, 10], [1, 2, -0.25])


def test_a_decimal_comma_far_down_the_file_is_seen_or_can_be_said():
    far = "u;y\n" + "".join(f"{k};{k}\n" for k in range(1000)) + "1000;0,5\n"
    assert load(far, decimal=",").y[-1] == 0.5
    assert_refused(r"line 1002, column 'y': .* \(pass decimal=\",\"", load, far, decimal=".")
    often = "u;y\n" + "".join(f"{k};{k}\n" for k in range(500)) + "".join(f"{k};0,5\n" for k in range(500, 1000))
    assert load(often).y[-1] == 0.5


@pytest.mark.parametrize(
    "text",
    [
        "u,y,note\n[V],(um),\n0,1,up\n2,3,\n",
        "u;y\nV;um\n0,5;1\n2;3\n",
        "u [V],y\nkV,um\n0,1\n2,3\n",
        "# made by hand\n# u [V], y [um]\n0,1\n2,3\n",
        "% u [V] y [um]\n0 1\n2 3\n",
        '"u (V)","y (um)"\n0,1\n2,3\n',
        "u/V\ty / (um)\n0\t1\n2\t3\n",
        "u / V   y/um\n0 1\n2 3\n",
        "u [V]  y (um)\n0 1\n2 3\n",
    ],
    ids=[
        "line of units",
        "two rows",
        "header before units",
        "savetxt",
        "matlab",
        "quoted",
        "quotient",
        "blanks",
        "brackets",
    ],
)
def test_units_are_found_in_the_header_below_it_or_in_a_comment(text):
    assert dict(load(text).units) == {"u": "V", "y": "um"}


def test_a_text_beside_the_numbers_does_not_make_the_first_sample_a_header():
    assert load("0,1,up\n2,3,up\n1,2,down\n", u=0, y=1).u.tolist() == [0, 2, 1]


def test_a_line_end_is_that_of_any_machine():
    assert load("u,y\r0,1\r2,3\r").u.tolist() == load("u,y\r\n0,1\n2,3").u.tolist() == [0, 2]


CELLS = st.sampled_from(
    ["0", "1.5", "-2", "3,5", "nan", "", "inf", "x", '"', '"4"', "#", "1_0", "1e999", "u", " ", "\u00b2"]
)
SIGNS = st.sampled_from([",", ";", "\t", " ", ", "])
LINES = st.builds(lambda sign, cells: sign.join(cells), SIGNS, st.lists(CELLS, max_size=4))
TEXTS = st.one_of(
    st.builds("\n".join, st.lists(LINES, max_size=8)),
    st.builds(lambda sign, rows: "\n".join(map(sign.join, rows)), SIGNS, st.lists(st.tuples(CELLS, CELLS), max_size=8)),
    st.text(max_size=60),
)


@given(TEXTS, st.sampled_from(["error", "drop", "split"]), st.sampled_from([0, 1, "u"]))
def test_any_text_is_a_record_or_one_line_of_error(text, on_missing, y):
    try:
        loaded = load(text, u=0, y=y, on_missing=on_missing)
    except ValueError as error:
        message = str(error)
    else:
        message = "stream"
        assert all(isinstance(rec, hs.Record) for rec in (loaded if on_missing == "split" else [loaded]))
    assert message.startswith("stream")
    assert "\n" not in message


@given(st.lists(st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), min_size=2), SIGNS, st.sampled_from(".,"))
def test_what_is_written_is_read_to_the_bit(samples, sign, point):
    delimiter = ";" if sign.strip() == point else sign
    rows = [delimiter.join(repr(value).replace(".", point) for value in sample) for sample in samples]
    rec = load("\n".join(["u" + delimiter + "y", *rows]), decimal=point)
    assert list(zip(rec.u.tolist(), rec.y.tolist(), strict=True)) == samples


def test_errors_name_the_file(tmp_path):
    assert_refused(r"loop\.csv: line 2: expected 2 cells", hs.load, write(tmp_path, "u,y\n0\n"), u="u", y="y")
    assert_refused("none", hs.load, tmp_path / "none.csv", error=FileNotFoundError, u="u", y="y")


test_wrong_arguments_are_refused = refused(
    ("0,1\n2,3\n", {"y": 1}, "no column 'u', the columns are: 0, 1"),
    ("0,1\n2,3\n", {"u": 2, "y": 1}, "no column 2, there are columns 0 to 1"),
    ("0,1\n2,3\n", {"u": -1, "y": 1}, "no column -1, there are columns 0 to 1"),
    ("u,y\n0,1\n2,3\n", {"skip": -1}, "skip must be a number of lines, got -1"),
    ("u,y\n0,1\n2,3\n", {"delimiter": ",", "decimal": ","}, "must differ, both are ','"),
    (LOOP, {"on_missing": "skip"}, "one of error, drop, split, got 'skip'"),
    (LOOP, {"delimiter": ", "}, "one character, got ', '"),
    (LOOP, {"decimal": "'"}, r'decimal must be "\." or ",", got "\'"'),
    call=lambda text, options: load(text, **options),
)


def test_a_stream_is_read_from_where_it_stands(tmp_path):
    with write(tmp_path, "title\nu,y\n0,1\n2,3\n").open(encoding="utf-8") as stream:
        stream.readline()
        assert hs.load(stream, u="u", y="y").name == "loop"


FORMULAS = ("=1+1", "+a", "@a", "-a", "=A1+B1", "'=b", "''@b", "'c", "--d")


@pytest.mark.parametrize("delimiter", [",", "\t"])
def test_no_text_of_a_csv_file_is_a_formula_and_all_of_them_come_back(delimiter):
    text = csv_text([FORMULAS, [-1.5] * len(FORMULAS), ["-2"] * len(FORMULAS)], delimiter=delimiter)
    first, *others = text.splitlines()
    assert not [cell for cell in first.split(delimiter) if cell[0] in "=+@-"]
    assert others == [delimiter.join(["-1.5"] * len(FORMULAS)), delimiter.join(["-2"] * len(FORMULAS))]
    assert [column.name for column in hs.list_columns(io.StringIO(text), delimiter=delimiter)] == [*FORMULAS]
    assert hs.load(io.StringIO(text), u="=1+1", y="'=b").u.tolist() == [-1.5, -2.0]


def test_a_name_that_is_a_formula_is_none_in_the_tables_of_results():
    rec = hs.Record(u=[0, 1, 2, 1, 0], y=[0, 1, 2, 1, 0])
    assert "\n'=cmd()," in hs.compare({"=cmd()": hs.Line}, rec, cross_validate=2).to_csv()
    assert hs.sweep(lambda **named: len(named), {"@a": [0, 1]}).to_csv().startswith("task,'@a,")


def test_a_model_is_no_record_and_a_record_no_model(tmp_path):
    hs.save(hs.Line(slope=0.1), tmp_path / "law.json", units={"u": "V"})
    for read in (hs.load, hs.list_columns, hs.load_ground_motion):
        assert_refused(r"^law\.json is a model: read it with hs\.load_model$", read, tmp_path / "law.json")
    for stream in (io.StringIO('{"family": "Line"}'), io.BytesIO(b'\n{"hysim": "1", "family" : "Line"}')):
        assert_refused(r"^stream is a model: read it with hs\.load_model$", hs.load, stream)
    rec = hs.Record(u=[0, 1], y=[0, 1], name="family")
    for ending in (".csv", ".npz", ".mat"):
        hs.save_record(rec, tmp_path / f"loop{ending}")
        with pytest.raises(
            ValueError, match=rf"loop\{ending} does not hold a model .*; if it is a record: read it with"
        ):
            hs.load_model(tmp_path / f"loop{ending}")


def test_columns_are_listed_without_reading_the_text_for_each_of_them(monkeypatch):
    parsed, parse = [], _delimited.plain_numbers
    monkeypatch.setattr(_delimited, "plain_numbers", lambda *given: parsed.append(given[1]) or parse(*given))
    text = ",".join([f"c{k}" for k in range(500)]) + "\n" + 3 * (",".join(["1"] * 500) + "\n")
    assert [column.highest for column in hs.list_columns(io.StringIO(text))] == [1.0] * 500
    assert len(parsed) == 1
    noted = text.replace("c137", "note").replace("\n1,", "\na,")
    columns = hs.list_columns(io.StringIO(noted))
    assert [k for k, column in enumerate(columns) if column.problem] == [0]
    assert len(parsed) < 30  # the text is halved nine times to find the column that holds none


def test_a_column_is_listed_with_all_that_is_in_it():
    text = io.StringIO("t [s],u [V],y [um],note\n0,3,nan,a\n1,,-2,b\n2,5,,c\n3,4,-1,d\n")
    t, u, y, note = hs.list_columns(text)
    assert t == FileColumn("t", 0, "s", n_samples=4, n_missing=0, lowest=0.0, highest=3.0, increases=True)
    assert u == FileColumn("u", 1, "V", n_samples=3, n_missing=1, lowest=3.0, highest=5.0, increases=False)
    assert y == FileColumn("y", 2, "um", n_samples=2, n_missing=2, lowest=-2.0, highest=-1.0, increases=True)
    assert (note[:5], note.increases) == (("note", 3, "", 0, 0), False)
    assert note.problem == "line 2, column 'note': expected a finite number, got 'a'"


def test_notes_stand_in_the_comments_at_the_top_alone():
    top = '# made by a rig\n# name: "hot"\n%resolution: 0.5\n# units: {"u": "V"}\n# channels: {"T": 40}\n'
    rec = hs.load(io.StringIO(f"{top}u,y\n# name: cold\n0,1\n1,2\n"))
    assert rec == hs.Record(u=[0, 1], y=[1, 2], units={"u": "V"}, resolution=0.5, name="hot", channels={"T": 40.0})
    for above in ("\n", "0,0\n"):
        assert hs.load(io.StringIO(f"{above}{top}0,1\n1,2\n"), u=0, y=1).name == "stream"
    assert hs.load(io.StringIO("# name: a plain one \n0,1\n1,2\n"), u=0, y=1).name == "a plain one"


def test_a_long_text_takes_little_more_memory_than_its_numbers(tmp_path):
    n = 60_000
    path = write(
        tmp_path, "t,u,y\n" + "".join(f"{k},{k % 7}.123456789012345,{k % 9}.123456789012345\n" for k in range(n))
    )
    rec, peak = with_peak_memory(lambda: hs.load(path))
    assert (len(rec), rec.y[-1]) == (n, (n - 1) % 9 + 0.123456789012345)
    assert peak < 150 * n + 5_000_000  # bytes: a record has 24 a sample, and 5 million samples may take a gigabyte


def test_lines_far_down_a_long_text_are_counted(tmp_path):
    lines = [f"{k} {k}" for k in range(100_000)]
    lines[70_000:70_000] = ["# a comment", "", "  "]
    lines[90_000] = "1 x"
    with pytest.raises(ValueError, match="line 90001, column '1': expected a finite number, got 'x'"):
        hs.load(write(tmp_path, "\n".join(lines)), u=0, y=1)
    lines[90_000] = "1 nan"
    assert_refused("line 90001, column '1': the value is missing", hs.load, write(tmp_path, "\n".join(lines)), u=0, y=1)
    assert hs.load(write(tmp_path, "\n".join(lines)), u=0, y=1, on_missing="drop").u[-1] == 99_999
    with pytest.raises(ValueError, match="line 95002: expected 2 cells, got 3"):
        hs.load(write(tmp_path, "\n".join([*lines[:95_001], "1 2 3", *lines[95_001:]])), u=0, y=1)
