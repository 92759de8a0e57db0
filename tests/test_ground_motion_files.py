"""Ground motions come from AT2 files, tables and lists of numbers, in m/s^2, or end in one line that says why not."""

import io
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from strategies import assert_refused, refused

import hysim as hs

G = 9.80665
TITLES = "PEER STRONG MOTION DATABASE RECORD\nIMPERIAL VALLEY 10/15/79 2319, STATION 6, 230\n"
IN_G = f"{TITLES}ACCELERATION TIME HISTORY IN UNITS OF G\n"
PEER = f"{IN_G}NPTS=  3, DT= .0050 SEC\n .1 .2\n .3\n"
TABLE = "time [s],acceleration [g]\n0,0.1\n0.01,0.2\n0.02,-0.3\n"


def read(text, **options):
    return hs.load_ground_motion(io.StringIO(text), **options)


def fortran(value):
    """A number as the format E14.7 prints it: no zero before the point, and no E before three digits."""
    digits, power = f"{abs(value):.6E}".split("E")
    exponent = int(power) + 1 if value else 0
    sign, letter = "-" if math.copysign(1.0, value) < 0.0 else "", "E" if abs(exponent) < 100 else ""
    return f"{sign}.{digits.replace('.', '')}{letter}{exponent:+03d}"


def peer(texts, width, line="NPTS={n:7d}, DT={step:9.5f} SEC", per_line=5, step=0.005):
    rows = ["".join(text.rjust(width) for text in texts[k : k + per_line]) for k in range(0, len(texts), per_line)]
    return "\n".join([IN_G + line.format(n=len(texts), step=step), *rows, ""])


@pytest.mark.parametrize(
    "line",
    [
        "NPTS={n:6d}, DT= .00500 SEC",
        "NPTS={n:6d}, DT= 5.000 MSEC",
        "NPTS, DT: {n}, 5 milliseconds",
        "    {n}  5.0 NPTS, DT (MSEC)",
        "NPTS=   {n}, DT=   .0050 SEC,",
        "   NPTS={n},    DT=0.0050SEC",
        "{n}    0.0050    NPTS, DT",
        "    {n}  .0050 NPTS, DT (SEC)",
        "NPTS, DT: {n}, .005",
        "DT= 5.0E-03 SEC, NPTS= {n}",
        "npts = {n} dt = 0.5D-02 sec",
        "NPTS =  {n}     DT =      .0050 SEC  ,  SCALE FACTOR =  .9094E-01",
    ],
)
def test_every_spelling_of_the_header_is_read(line):
    values = np.sin(np.arange(23.0)) / 7.0
    texts = [fortran(value) for value in values]
    t, acceleration = read(peer(texts, 15, line))
    assert t.tolist() == [k / 200 for k in range(23)]
    expected = np.array([float(text.replace("E", "e")) for text in texts]) * G
    assert acceleration.tolist() == expected.tolist()


def test_of_two_headers_the_last_one_counts():
    corrected = "TIME-DOMAIN CORRECTION\n*** OLD HEADERS FOLLOW ***\n" + IN_G + "NPTS= 16384, DT= .0100 SEC\n"
    t, acceleration = read(corrected + "*** NEW ***\nNPTS= 2, DT= .0050 SEC, SCALED\n.1 .2\n")
    assert (t[1], acceleration[1]) == (0.005, 0.2 * G)


NUMBERS = st.one_of(st.floats(-3.0, 3.0), st.sampled_from([0.0, 1e-99, -1.5e-120, 2.5e-308, -1e120]))


@given(st.lists(NUMBERS, min_size=2, max_size=40), st.integers(1, 8), st.sampled_from([13, 14, 16]))
def test_numbers_that_run_together_are_read_to_the_bit(values, per_line, width):
    """Of 13 letters a negative number fills each: nothing stands between it and the one before."""
    texts = [fortran(value) for value in values]
    acceleration = read(peer(texts, width, per_line=per_line))[1]
    plain = [text if "E" in text else f"{text[:-4]}E{text[-4:]}" for text in texts]
    assert acceleration.tolist() == [float(text) * G for text in plain]


def test_exponents_of_any_form_are_read():
    text = IN_G + "NPTS= 8, DT= .01 SEC\n-.1E-02-.2E-02 .3D+01.4d-1\n5-.6E-1\n0.1234567E-020.7654321E+01\n"
    values = [-0.1e-2, -0.2e-2, 3.0, 0.04, 5.0, -0.06, 0.1234567e-2, 7.654321]
    assert_refused(r"line 6: it is not clear where the numbers end in '5-\.6E-1'", read, text)
    assert read(text.replace("5-", "5. -"))[1].tolist() == [value * G for value in values]


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("G", G), ("g's", G), ("G.", G), ("CM/S/S", 0.01), ("cm/sec2", 0.01), ("cm/sec/sec", 0.01), ("GAL", 0.01),
        ("gals", 0.01), ("m/s^2", 1.0), ("m/s²", 1.0), ("m/s**2", 1.0), ("M/SEC^2", 1.0), ("mm/s2", 1e-3),
        ("mg", G / 1000), ("in/s2", 0.0254), ("ft/s/s", 0.3048),
    ],
)  # fmt: skip
def test_units_of_any_spelling_are_converted(unit, factor):
    in_header = read(PEER.replace("OF G", f"OF {unit}"))[1]
    as_column = read(TABLE.replace("[g]", f"({unit})"))[1]
    in_title = read(f"RECORD\nvalues in ({unit})\n.1\n.2\n.3\n", sample_time=0.1)[1]
    in_words = read(f"RECORD OF GAL\nacceleration in {unit}\n.1\n.2\n.3\n", sample_time=0.1)[1]
    said = read(PEER, units=unit)[1]
    for acceleration in (in_header, as_column, in_title, in_words, said):
        assert acceleration[:2] == pytest.approx(np.array([0.1, 0.2]) * factor, rel=1e-15)  # one rounding


def test_without_a_unit_at2_is_in_g_and_all_else_in_si():
    assert read(PEER.replace(" IN UNITS OF G", ""))[1][0] == 0.1 * G
    assert read("0 .1\n1 .2\n")[1].tolist() == [0.1, 0.2]
    assert read(".1\n.2\n", sample_time=1.0)[1].tolist() == [0.1, 0.2]


@pytest.mark.parametrize(
    "text",
    [
        TABLE,
        "0 0.1\n.01 .2\n.02 -.3\n",
        "Zeit;Beschleunigung\ns;g\n0;0,1\n0,01;0,2\n0,02;-0,3\n",
        "t [ms]\tag [g]\n0\t.1\n10\t.2\n20\t-.3\n",
        "A RECORD OF 1940\nwith two more\nlines of title\ntime   acc (g)\n 0 .1\n .01 .2\n .02 -.3\n",
        "# acc, other, time\nacc [g],other,time [sec]\n.1,9,0\n.2,8,.01\n-.3,7,.02\n",
        "a [g],t\n0.1,5.00\n0.2,5.01\n-0.3,5.02\n",
    ],
)
def test_two_columns_of_any_layout_are_read(text):
    t, acceleration = read(text, units="g" if "[" not in text and "g" not in text else None)
    assert (t - t[0]).tolist() == pytest.approx([0.0, 0.01, 0.02], abs=1e-15)  # rounding at 5 s
    assert acceleration.tolist() == [0.1 * G, 0.2 * G, -0.3 * G]


def test_columns_are_chosen_by_name_or_number():
    text = "clock,x,y\n0,1,2\n1,3,4\n"
    assert read(text, t="clock", acceleration="y")[1].tolist() == [2.0, 4.0]
    assert read(text, t=0, acceleration=1)[1].tolist() == [1.0, 3.0]
    assert read(text, acceleration="x", sample_time=0.5)[0].tolist() == [0.0, 0.5]
    assert_refused("the columns are: clock, x, y; pass one as t=", read, text)
    assert_refused("pass one as acceleration=", read, text, t="clock")


def test_times_with_few_digits_are_made_even():
    exact = np.arange(400) / 60.0
    t, acceleration = read("\n".join(f"{time:.4f} {float(np.sin(time))!r}" for time in exact))
    assert t == pytest.approx(exact, abs=1e-6)  # a least-squares line through 400 times rounded to 1e-4
    assert np.ptp(np.diff(t)) < 1e-14
    assert acceleration.tolist() == np.sin(exact).tolist()


@pytest.mark.parametrize(("begin", "step"), [(0.0, 0.005), (1000.1, 0.02), (0.0, 1 / 3), (1.0, 0.0123456789)])
def test_the_step_is_the_decimal_that_was_meant_or_that_of_the_times(begin, step):
    rows = "".join(f"{begin + step * k!r},0.5\n" for k in range(400))
    t, _ = read(f"t,a\n{rows}")
    assert t[0] == begin
    assert np.abs(t - (begin + step * np.arange(400))).max() < 1e-12 * max(1.0, begin)
    if step in (0.005, 0.02):  # without the rounding of the times
        assert t.tolist() == (begin + hs.signals.sample_times(400, step)).tolist()


@pytest.mark.parametrize("ending", [".npz", ".mat"])
def test_arrays_with_names_are_read(tmp_path, ending):
    path = tmp_path / f"motion{ending}"
    a = np.array([0.5, -1.5, 2.5])
    if ending == ".npz":
        np.savez(path, time=[0.0, 0.1, 0.2], acceleration=a, acceleration_units="cm/s^2")
    else:
        from scipy.io import savemat

        savemat(path, {"time": [0.0, 0.1, 0.2], "acceleration": a, "acceleration_units": "cm/s^2"})
    t, acceleration = hs.load_ground_motion(path)
    assert t.tolist() == [0.0, 0.1, 0.2]
    assert acceleration.tolist() == (a / 100.0).tolist()
    assert_refused("skip is for text", hs.load_ground_motion, path, skip=1)
    with pytest.raises(ValueError, match="there is a column of times, 'time': leave out sample_time"):
        hs.load_ground_motion(path, sample_time=0.1)


@given(st.lists(st.floats(-1e3, 1e3), min_size=2), st.integers(1, 9), st.sampled_from([" ", ", ", ";", "\t"]))
def test_a_list_in_reading_order_is_read_to_the_bit(values, per_line, sign):
    rows = [sign.join(map(repr, values[k : k + per_line])) for k in range(0, len(values), per_line)]
    widths = [len(row.split(sign)) for row in rows]
    first = np.diff(values[::per_line])
    assume(len(set(widths)) > 1 or per_line == 1 or len(rows) < 3 or not (first > 0.0).all())  # they could be times
    t, acceleration = read("A TITLE\nand more of it\n" + "\n".join(rows), sample_time=0.02)
    assert acceleration.tolist() == values
    assert t.tolist() == hs.signals.sample_times(len(values), 0.02).tolist()


COSMOS = """Corrected accelerogram    Station 24278
 1940    5   18
 1.5 2.5
    10 points of accel data equally spaced at  .005 sec, in cm/sec2. (8f9.6)
  .000001 -.000002-1.234567100.00001 1.000000-2.000000 3.000000 4.000000
 5.000000-6.000000
    10 points of veloc data equally spaced at  .005 sec, in cm/sec.  (8f9.6)
 9.000000 9.000000
/&  ---------- End of data for channel  1 ----------
"""


def test_the_accelerations_of_a_cosmos_file_are_read_without_its_velocities():
    assert_refused("line 5: it is not clear where the numbers end", read, COSMOS)
    t, acceleration = read(COSMOS.replace("-1.234567100.00001", "-1.234567 10.00001"))
    values = [1e-6, -2e-6, -1.234567, 10.00001, 1.0, -2.0, 3.0, 4.0, 5.0, -6.0]
    assert acceleration.tolist() == [value / 100.0 for value in values]
    assert t[:3].tolist() == [0.0, 0.005, 0.01]
    assert_refused("line 4 states no unit", read, COSMOS.replace(", in cm/sec2.", ""))
    both = COSMOS + COSMOS.replace("-1.234567100.00001", "-1.234567 10.00001")
    assert_refused(r"holds 2 accelerations, in lines 4, 13: .* as skip=", read, both)
    assert read(both, skip=9)[1].tolist() == acceleration.tolist()
    with pytest.raises(ValueError, match="line 4 states 10 values, but 8 follow"):
        read(COSMOS.replace("-1.234567100.00001", "-1.234567 10.00001").replace(" 5.000000-6.000000\n", ""))


def test_a_header_with_numbers_is_skipped_by_its_length():
    text = "2 CORRECTED\nSITE\n 1 2 3 4\n 5.0 6.0\n| units = cm/s2\n 1. 2. 3.\n 4.\n"
    assert read(text, sample_time=0.1, skip=5)[1].tolist() == [0.01, 0.02, 0.03, 0.04]
    assert_refused(r"line 5: expected finite numbers, .* pass skip=5", read, text, sample_time=0.1)


def test_a_decimal_comma_is_seen_where_it_can_be_nothing_else():
    assert read("0,5 0,25\n1,5 2\n", sample_time=1.0)[1].tolist() == [0.5, 0.25, 1.5, 2.0]
    assert read("0,5\n0,25\n", sample_time=1.0, decimal=",")[1].tolist() == [0.5, 0.25]
    assert_refused("'0,5' may be one number or two: pass decimal", read, "0,5\n0,25\n", sample_time=1.0)


SQUARES = "time,x,y\n" + "".join(f"{k**2},5,6\n" for k in range(8))


test_what_is_no_ground_motion_is_refused_in_one_line = refused(
    (PEER.replace("3,", "4,"), {}, "line 4 states 4 values, but 3 follow"),
    (PEER + ".4\n", {}, "line 4 states 3 values, but 4 follow"),
    (PEER.replace(".3", "*****"), {}, r"line 6: expected finite numbers, got '\*\*\*\*\*'"),
    (PEER.replace(".3", "nan"), {}, "line 6: expected finite numbers, got 'nan'"),
    (PEER.replace(".3", ".3E999"), {}, "line 6: expected finite numbers, got '.3E999'"),
    (PEER.replace(".3", "1_0"), {}, "line 6: expected finite numbers, got '1_0'"),
    (PEER.replace(" .1 .2", ".1234.5678"), {}, "line 5: it is not clear where the numbers end in '.1234.5678'"),
    (PEER + "END OF DATA\n", {}, "line 7: expected finite numbers, got 'END OF DATA'"),
    (PEER.replace(".0050", "0.0"), {}, "line 4: the step must be positive, got 0"),
    (PEER.replace("ACCELERATION", "VELOCITY"), {}, "the header says VELOCITY"),
    (PEER.replace("OF G", "OF CM/S"), {}, "the header states the unit 'CM/S', which is unknown: pass units="),
    (PEER, {"sample_time": 0.01}, "line 4 states a step of 0.005 s: leave out sample_time"),
    (IN_G + "NPTS= 3, DT= .0050 SEC\n", {}, "there are no numbers below line 4"),
    (IN_G + "NPTS= 1, DT= .0050 SEC\n.1\n", {}, "needs at least 2 samples, there are 1"),
    (PEER.replace(".3", "1.5E308"), {}, "too large for their unit"),
    ("0 1\n0.01 2\n0.05 3\n0.06 4\n", {}, "line 3: the time must be evenly spaced, got a step of 0.04 s"),
    ("0 1\n0.01 2\n0.01 3\n", {}, "line 3: time must increase, got 0.01 after 0.01"),
    (TABLE.replace("0.2\n", "\n"), {}, "line 3, column 'acceleration': the value is missing"),
    (TABLE.replace("0.2\n", "O.2\n"), {}, "line 3, column 'acceleration': expected a finite number, got 'O.2'"),
    (TABLE.replace("[g]", "[V]"), {}, "'V' is no known unit of acceleration"),
    (TABLE.replace("[s]", "[h]"), {}, "the time must be in s or ms, got the unit 'h'"),
    (TABLE.replace("acceleration [g]", "acc_g"), {}, "column 'acc_g' may be in g: pass units="),
    (TABLE, {"sample_time": 0.01}, "the first of 2 columns increases from line to line"),
    ("0 1\n0.01 2\n0.02 3\n", {"sample_time": 0.01}, "the first of 2 columns increases from line to line"),
    (SQUARES, {"sample_time": 1.0}, "the first of 3 columns increases from line to line, as times do"),
    ("t,acc,accel\n0,1,2\n1,2,3\n", {}, "t, acc, accel; pass one as acceleration="),
    ("t,time,a\n0,1,2\n1,2,3\n", {}, "several columns may be the time: pass one of t, time as t="),
    (".1\n.2\n", {}, "if these are 2 accelerations in reading order, pass their sample_time="),
    ("TITLE\n.1 .2 .3\n.4 .5\n", {}, "if these are 5 accelerations in reading order, pass their sample_time="),
    ("1 2\n.1 .2 .3\n.4 .5 .6\n", {"sample_time": 1.0}, "line 2: expected 2 numbers as in line 1, got 3"),
    (".1 .2\n.3 O.4\n.5 .6\n", {"sample_time": 1.0}, "line 2: expected finite numbers, got '.3 O.4'"),
    (".1 .2 O.3\n.3 .4 .5\n", {"sample_time": 1.0}, "line 1: expected 3 numbers or a header"),
    ("", {}, "the file is empty"),
    ("TITLE\n", {"sample_time": 1.0}, "there are no numbers"),
    (PEER, {"units": "V"}, "units must be a unit of acceleration: expected"),
    (PEER, {"sample_time": 0.0}, "sample_time must be positive and finite, got 0"),
    (PEER, {"sample_time": 1.0, "t": 0}, "either sample_time or the column t"),
    (PEER, {"skip": -1}, "skip must be a number of lines, got -1"),
    (PEER, {"delimiter": ", "}, "delimiter must be one character"),
    (PEER, {"decimal": "'"}, "decimal must be"),
    (".1;.2\n", {"sample_time": 1.0, "delimiter": ";"}, "a list of numbers needs none"),
    call=lambda text, options: read(text, **options),
)


CELLS = st.sampled_from(
    ["0", "1.5", "-.2E-03", "1e999", "nan", "", "x", "time", "acc [g]", "NPTS=", "DT=", "NPTS, DT", "3", ".01", "*"]
)
LINES = st.builds(lambda sign, cells: sign.join(cells), st.sampled_from([",", " ", ";"]), st.lists(CELLS, max_size=4))
TEXTS = st.one_of(
    st.builds("\n".join, st.lists(LINES, max_size=8)),
    st.builds(lambda lines: IN_G + "NPTS= 3, DT= .01 SEC\n" + "\n".join(lines), st.lists(LINES, max_size=4)),
    st.text(max_size=60),
)


@given(TEXTS, st.sampled_from([None, 0.01]), st.integers(0, 3))
def test_any_text_is_a_ground_motion_or_one_line_of_error(text, sample_time, skip):
    try:
        t, acceleration = read(text, sample_time=sample_time, skip=skip)
    except ValueError as error:
        message = str(error)
    else:
        message = "stream"
        assert t.shape == acceleration.shape
        assert t.size >= 2
        assert np.isfinite(acceleration).all()
        assert (np.diff(t) > 0.0).all()
    assert message.startswith("stream")
    assert "\n" not in message


def test_files_and_streams_are_named_in_errors(tmp_path):
    path = tmp_path / "quake.AT2"
    path.write_bytes(PEER.replace("\n", "\r\n").encode("utf-16"))
    assert hs.load_ground_motion(path)[1].tolist() == [0.1 * G, 0.2 * G, 0.3 * G]
    path.write_bytes(b"\x00\xff")
    assert_refused(r"^quake\.AT2 is not a UTF-8 text", hs.load_ground_motion, path)
    with pytest.raises(FileNotFoundError):
        hs.load_ground_motion(tmp_path / "none.AT2")
    assert_refused("takes a path, an open file or a DataFrame", hs.load_ground_motion, 3, error=TypeError)
