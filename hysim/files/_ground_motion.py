"""The verb `load_ground_motion`: the acceleration of the ground from a file.

A text is one of four things. It is a PEER file if a line near its top says NPTS and DT, and one of COSMOS if a line
says how many points of acceleration are below it; with a sample time from the caller it is a list of numbers in reading
order; else it is a table with a column of times.

The line of a header that states the number of values and the step has changed its spelling in the AT2 files of PEER
over the years, and COSMOS has one above each block of numbers::

    NPTS=  4000, DT= .00500 SEC        PEER Strong Motion Database, and NGA-West2
    NPTS=4000,    DT=0.0050SEC         NGA
    4000    0.0050    NPTS, DT         NGA
    4000 points of accel data equally spaced at  .005 sec, in cm/sec2. (8f10.6)

Numbers stand as many to a line as the format has, with blanks, commas or nothing between them, as programs in Fortran
write them: ``-.1234567E-02-.2345678E-02``. An exponent may be written with E, with D, or with three digits and its sign
alone. Only the last line may be shorter than the others.
"""

import math
import re
from contextlib import suppress
from io import BytesIO
from itertools import islice, takewhile
from typing import Any, Literal, NamedTuple

import numpy as np

from hysim._basics.frozen import FloatArray, check_positive_and_finite
from hysim._basics.prefixes import power_of_ten
from hysim.files._delimited import Text, delimited
from hysim.files._load import Source, opened, options_of_a_text, table_of
from hysim.files._table import COMMENTS, Column, Table, check_complete, check_increasing, listed, require, shown
from hysim.records import step_if_even
from hysim.signals import sample_times

STANDARD_GRAVITY = 9.80665
"""The g of files [m/s^2]."""

_SCALES = {
    "g": (STANDARD_GRAVITY, 1.0), "mg": (STANDARD_GRAVITY, 1000.0), "%g": (STANDARD_GRAVITY, 100.0),
    "m/s2": (1.0, 1.0), "cm/s2": (1.0, 100.0), "mm/s2": (1.0, 1000.0), "gal": (1.0, 100.0),
    "in/s2": (0.0254, 1.0), "ft/s2": (0.3048, 1.0),
}  # fmt: skip
"""Factor and divisor from each unit to m/s^2."""

_KNOWN = 'expected "m/s^2", "cm/s^2", "mm/s^2", "gal", "g", "mg", "in/s^2" or "ft/s^2"'
_PER_SECOND_SQUARED = re.compile(r"(/s/s|/\(?s2\)?|s-2|/\(?ss\)?)$")
_STATED = re.compile(r"\bunits?\b\s*(?:(?:of|are|is|in)\b|[=:])?\s*([^\s,;:=()]+)", re.IGNORECASE)
_BRACKETS = re.compile(r"[\[(]([^\[\]()]*)[\])]")
_IN = re.compile(r"\bin\s+([^\s,;:()]+)", re.IGNORECASE)
_ENDS_IN_UNIT = re.compile(r"acc[a-z]*[_ ]+(?:in[_ ]+)?(\S+)", re.IGNORECASE)
_TIME_NAME = re.compile(r"t|s|sec|seconds?|time\b.*|time_.*|zeit", re.IGNORECASE)
_MOTION_NAME = re.compile(r"u|a|a_?g|acc.*|ground.?(acc.*|motion)", re.IGNORECASE)
_FEW_LINES, _MANY_LINES = 3, 8  # 8 numbers without order increase once in 40 000 times
_SAME_DECIMAL = 1e-9  # of a step: a step with six digits that is as near is the one that was meant

TOP = 60
"""Lines from the top of a file in which NPTS and DT are looked for."""

_REAL = r"((?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+)?)"
_NPTS = re.compile(r"\bNPTS?\s*[=:]?\s*(\d+)", re.IGNORECASE)
_MILLI = r"\W*(m(?:illi)?s(?:ec\w*)?\b)?"
_DT = re.compile(rf"\bDT\s*[=:]?\s*{_REAL}{_MILLI}", re.IGNORECASE)
_IN_ORDER = re.compile(
    rf"^\s*(\d+)[\s,]+{_REAL}[\s,]*NPTS\W+DT\b{_MILLI}|\bNPTS\s*,?\s*DT\s*[=:]?\s*(\d+)[\s,]+{_REAL}{_MILLI}",
    re.IGNORECASE,
)
_BLOCK = re.compile(
    rf"[ \t]*(\d+)\s+points\s+of\s+acc\w*\s+data\s+equally\s+spaced\s+at\s+{_REAL}\s*sec", re.IGNORECASE
)
_NUMBERS_ONLY = re.compile(r"[\d\s.,;+\-eEdD]*")

_EXPONENT = r"[EeDd][+-]?(?:\d{1,3}(?![\d.])|\d{2}(?=[\d.]))"  # two digits where the next number follows at once
_NUMBER = re.compile(
    rf"(?P<mantissa>[+-]?(?:\d+\.\d*|\.\d+))(?:(?P<exponent>{_EXPONENT})|(?P<bare>[+-]\d{{3}})(?![\d.]))?"
    rf"|(?P<whole>[+-]?\d+(?:{_EXPONENT})?)"
)
_BETWEEN = re.compile(r"\s*[,;]\s*|\s+")
_WITH_COMMA = re.compile(r"[+-]?\d*,\d+(?:[EeDd][+-]?\d{1,3})?")
_BEGIN = "+-.0123456789"  # of a number
_LOOKED_AT = 1000  # lines for the decimal sign
_LONGEST = 60  # letters of a line in a message


class StatedValues(NamedTuple):
    """A line that states the number of values and the step, by its number from 1."""

    line: int
    n_values: int
    step: float


class NumberList(NamedTuple):
    """The numbers, the text above them, and how many stand in which lines."""

    values: FloatArray
    header: str
    widths: list[int]
    lines: list[int]

    def check_widths(self) -> None:
        """Raise a ValueError unless every line but the last has as many numbers as the first."""
        first = self.widths[0]
        for width, line in zip(self.widths, self.lines, strict=True):
            is_sound = width == first or (width < first and line == self.lines[-1])
            numbers = f"expected {first} numbers as in line {self.lines[0]}, got {width}"
            advice = f"if the lines above belong to the header, pass skip={line - 1}"
            require(is_sound, f"line {line}: {numbers}; {advice}")


class _Choice(NamedTuple):
    """Arguments of `load_ground_motion` that say what in the file is what."""

    t: str | int | None
    acceleration: str | int | None
    sample_time: float | None
    units: str | None


def load_ground_motion(
    path: Source,
    *,
    sample_time: float | None = None,
    units: str | None = None,
    t: str | int | None = None,
    acceleration: str | int | None = None,
    skip: int = 0,
    delimiter: str | None = None,
    decimal: Literal[".", ","] | None = None,
    encoding: str | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Load the acceleration of the ground in an earthquake, in m/s^2.

    Four kinds of text are read, and what a file is follows from its content, not from its ending:

    - the AT2 files of PEER, whose header states NPTS and DT, in any of its spellings: ``NPTS=  4000, DT= .0050 SEC``,
      ``NPTS=4000,    DT=0.0050SEC``, ``4000    0.0050    NPTS, DT``. In g unless the header states another unit;
    - a column of times and one of accelerations, in any layout that `hysim.load` reads, with or without a header. Of
      several columns those called t or time, and acceleration, acc, a, ag or u are taken. So are two arrays of these
      names in an NPZ, MAT or HDF5 file;
    - a file of COSMOS with one block of accelerations, whose header line states their number, step and unit;
    - with `sample_time`, a list of accelerations in reading order below a text header of any length, one or more to a
      line, as Fortran writes them; numbers may run together (``-.1234E-02-.2345E-02``).

    The unit is read from the header: in brackets behind a column's name, or as ``UNITS OF G`` or ``cm/sec2`` in a text.
    1 g is 9.80665 m/s^2. A file that states no unit is taken to be in m/s^2, an AT2 file in g.

    Times must be evenly spaced; those that are even but for the rounding of their digits are replaced by even ones.

    Parameters
    ----------
    path : str, path or open file
        An open file of text or of bytes is read from its current position.
    sample_time : float, optional
        Time between two samples of a file that has neither times nor DT [s].
    units : str, optional
        Unit of the file's accelerations, in place of the one that it states: ``"g"``, ``"m/s^2"``, ``"cm/s^2"``,
        ``"gal"``, ``"mm/s^2"``, ``"mg"``, ``"in/s^2"`` or ``"ft/s^2"``.
    t, acceleration : str or int, optional
        Columns of time and acceleration, by name or by number from 0. With `sample_time`, `acceleration` alone.
    skip : int
        Number of lines at the top of a text that belong to its header: for headers that hold lines of numbers.
    delimiter, decimal, encoding : str, optional
        As in `hysim.load`.

    Returns
    -------
    t : array, shape (n,) [s]
        Evenly spaced times, which begin at the file's first one, or at 0.
    acceleration : array, shape (n,) [m/s^2]

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    TypeError
        If `path` is neither a path nor an open file.
    ValueError
        If the number of values is not the stated one, a line holds anything but numbers, times are not even, a value is
        missing, a unit is unknown, or the file is damaged. The message names file, line and what to do.

    Examples
    --------
    >>> import io, hysim as hs
    >>> header = "RECORD\\nSITE, 180\\nACCELERATION TIME SERIES IN UNITS OF G\\nNPTS=  3, DT= .0050 SEC\\n"
    >>> t, acceleration = hs.load_ground_motion(io.StringIO(header + " 0. .1E+00-.2E+00\\n"))
    >>> t.tolist(), acceleration.round(6).tolist()
    ([0.0, 0.005, 0.01], [0.0, 0.980665, -1.96133])
    """
    if units is not None and not isinstance(units, str):
        raise TypeError(f'units is that of the accelerations, such as "g", got {units!r}')
    if units is not None and _name(units) is None:
        raise ValueError(f"units must be a unit of acceleration: {_KNOWN}, got {units!r}")
    check_positive_and_finite(sample_time=sample_time)
    require(sample_time is None or t is None, "give either sample_time or the column t, not both")
    for_text = options_of_a_text(delimiter, decimal, None, skip, encoding)
    choice = _Choice(t, acceleration, sample_time, units)
    with opened(path) as source:
        if source.format == "text":
            lines = Text(source.content, source.name, source.encoding or encoding).whole()
            step, values = _of_text(lines, choice, skip, delimiter, decimal)
        else:
            require(not skip, f"skip is for text, this is a file of the format {source.format}: leave it out")
            with table_of(source, for_text) as table:
                step, values = _of_table(table, choice)
        begin, sample_time = step
        return begin + sample_times(values.size, sample_time), values


def is_at2(path: Source, encoding: str | None = None) -> bool:
    """Whether a file is a text whose header states NPTS and DT; errors as `hysim.load` has them."""
    with opened(path) as source:
        if source.format != "text":
            return False
        lines = Text(source.content, source.name, source.encoding or encoding).lines()
        return peer_header([*islice((line for each in lines for line in each.texts), TOP)]) is not None


def column_names(path: Source, **for_text: Any) -> tuple[str, ...]:
    for_text = {**dict.fromkeys(("delimiter", "decimal", "encoding")), **for_text, "skip": for_text.get("skip") or None}
    with opened(path) as source, table_of(source, for_text) as table:
        return tuple(table.labels)


_Motion = tuple[tuple[float, float], FloatArray]
"""First time and step, and the accelerations in m/s^2."""


def _of_text(lines: list[str], choice: _Choice, skip: int, delimiter: str | None, decimal: str | None) -> _Motion:
    by_column = choice.t is not None or choice.acceleration is not None
    if not by_column and (header := peer_header(lines[: max(TOP, skip)])):
        return _of_stated(lines, header, choice, max(skip, header.line), decimal, "g")
    if not by_column and (blocks := cosmos_blocks(lines, skip)):
        block, line = blocks[0], blocks[0].line
        numbers = ", ".join(str(each.line) for each in blocks)
        advice = "save each to a file, or pass the number of lines above the last one as skip="
        require(len(blocks) == 1, f"the file holds {len(blocks)} accelerations, in lines {numbers}: {advice}")
        unit = choice.units or stated_unit(lines[line - 1])
        require(unit is not None, f"line {line} states no unit of its accelerations: pass units=")
        below = lines[:line] + list(takewhile(_NUMBERS_ONLY.fullmatch, lines[line:]))
        return _of_stated(below, block, choice._replace(units=unit), line, decimal, "")
    if not by_column and choice.sample_time is not None:
        require(delimiter is None, "delimiter is for columns: a list of numbers needs none")
        list_of_numbers = number_list(lines, decimal, skip)
        list_of_numbers.check_widths()
        values = _in_stated_unit(list_of_numbers, choice, "m/s^2")
        _check_no_times(list_of_numbers)
        return (0.0, choice.sample_time), values
    try:
        table = _table_below_titles([""] * min(skip, len(lines)) + lines[skip:], delimiter, decimal)
        require(by_column or len(table.labels) > 1, "there is no column of times beside the accelerations")
    except ValueError as error:
        if not by_column and (count := _count_in_list(lines, decimal, skip)):
            advice = f"if these are {count} accelerations in reading order, pass their sample_time="
            raise ValueError(f"{error}; {advice}") from None
        raise
    return _of_table(table, choice)


def _table_below_titles(lines: list[str], delimiter: str | None, decimal: str | None) -> Table:
    """The table below some titles; names and units are in all, in the last two or one, or in no line above it."""
    samples = (k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(COMMENTS))
    titles = [*takewhile(lambda place: not re.match(r"\s*\"?[+-]?[.,]?\d", lines[place]), samples)]
    errors = list[ValueError]()
    for kept in (len(titles), 2, 1, 0):
        dropped = titles[: max(0, len(titles) - kept)]
        below = "\n".join("" if k in dropped else line for k, line in enumerate(lines))
        try:
            return delimited(Text(BytesIO(below.encode(errors="replace"))), delimiter, decimal)
        except ValueError as error:
            errors.append(error)
    raise errors[0]


def _count_in_list(lines: list[str], decimal: str | None, skip: int) -> int:
    try:
        return number_list(lines, decimal, skip).values.size
    except ValueError:
        return 0


def _of_stated(
    lines: list[str], header: StatedValues, choice: _Choice, skip: int, decimal: str | None, unit: str
) -> _Motion:
    """The values below a line that states their number and step, in this unit if the file states no other."""
    where, n, step = f"line {header.line}", header.n_values, header.step
    require(0.0 < step < np.inf, f"{where}: the step must be positive, got {step:g}; correct the line")
    is_same = choice.sample_time in (None, step)
    require(is_same, f"{where} states a step of {step:g} s: leave out sample_time, or correct the line")
    numbers = number_list(lines, decimal, skip)
    size, advice = numbers.values.size, "the file is incomplete, or the line is to be corrected"
    require(size == n, f"{where} states {n} values, but {size} follow: {advice}")
    return (0.0, step), _in_stated_unit(numbers, choice, unit)


def _in_stated_unit(numbers: NumberList, choice: _Choice, unit: str) -> FloatArray:
    words = {word.upper() for word in re.findall(r"[A-Za-z]+", numbers.header)}
    other = next((word for word in ("VELOCITY", "DISPLACEMENT") if word in words), None)
    is_acceleration = other is None or any(word.startswith("ACC") for word in words)
    require(is_acceleration, f"the header says {other}: load the file of the acceleration, which PEER calls .AT2")
    return in_si(numbers.values, choice.units or stated_unit(numbers.header) or unit)


def _check_no_times(numbers: NumberList) -> None:
    """Refuse lines whose first numbers increase evenly, or in many lines at all: they are times."""
    width, n_lines = numbers.widths[0], len(numbers.widths)
    if width == 1 or numbers.widths[-1] != width or n_lines < _FEW_LINES:
        return
    first = numbers.values[::width]
    is_time = bool((np.diff(first) > 0.0).all()) and (n_lines >= _MANY_LINES or step_if_even(first))
    advice = "leave out sample_time, or name the column of the acceleration"
    require(not is_time, f"the first of {width} columns increases from line to line, as times do: {advice}")


def _of_table(table: Table, choice: _Choice) -> _Motion:
    time = _time_column(table, choice)
    motion = _motion_column(table, choice, time)
    columns = [motion] if time is None else [motion, time]
    values, units = table.values(columns), table.notes.units
    check_complete(table, columns, values, "fill it in, or delete the lines from there on")
    unit = choice.units or unit_of_column(motion.label, units.get(motion.label, motion.unit))
    accelerations = in_si(values[0], unit)
    if time is None:
        return (0.0, choice.sample_time or 0.0), accelerations
    return _even(table, _in_seconds(values[1], units.get(time.label, time.unit))), accelerations


def _signals(table: Table) -> list[str]:
    """Names of columns that are not the unit of another."""
    return [name for name in table.labels if not name.endswith("_units")]


def _time_column(table: Table, choice: _Choice) -> Column | None:
    """The column of times, None where the caller gives the step instead."""
    if choice.t is not None:
        return table.column(choice.t)
    names, is_named = [name for name in _signals(table) if _TIME_NAME.fullmatch(name)], choice.acceleration is not None
    if choice.sample_time is not None:
        advice = "leave out sample_time, or name the column of the acceleration"
        require(is_named or not names, f"there is a column of times, {shown(''.join(names[:1]))}: {advice}")
        return None
    require(len(names) < 2, f"several columns may be the time: pass one of {listed(names)} as t=")
    columns, advice = f"the columns are: {listed(table.labels)}", "pass one as t=, or sample_time= if there is none"
    is_clear = names or (len(_signals(table)) == 2 and not is_named)
    require(is_clear, f"no column is called t or time, {columns}; {advice}")
    return table.column(names[0] if names else 0)


def _motion_column(table: Table, choice: _Choice, time: Column | None) -> Column:
    if choice.acceleration is not None:
        return table.column(choice.acceleration)
    others = [name for name in _signals(table) if time is None or name != time.label]
    called = [name for name in others if _MOTION_NAME.fullmatch(name)]
    names, which = called or others, "several columns are" if called else "no column is"
    columns = f"the columns are: {listed(table.labels)}"
    require(len(names) == 1, f"{which} called acceleration, {columns}; pass one as acceleration=")
    return table.column(names[0])


def _in_seconds(times: FloatArray, unit: str) -> FloatArray:
    plain = re.sub(r"^(m|n|u|µ)?(sec(ond)?s?)$", r"\1s", unit.strip().lower()) or "s"
    try:
        power = power_of_ten(plain, "s")
    except ValueError:
        raise ValueError(f"the time must be in s or ms, got the unit {shown(unit)}: correct the header") from None
    return times * 10.0**power if power >= 0 else times / 10.0**-power


def _even(table: Table, times: FloatArray) -> tuple[float, float]:
    """First time and step of evenly spaced times; a ValueError names the place where they are not."""
    by_step = "name the column of the acceleration and pass sample_time="
    advice = f"sort the samples and remove repeated ones, or {by_step}"
    check_increasing(table, times, np.arange(times.size), advice)
    step = step_if_even(times)
    if step is None:
        steps = np.diff(times)
        usual = float(np.median(steps))
        k = int(np.argmax(np.abs(steps - usual))) + 1
        sizes = f"got a step of {steps[k - 1]:.6g} s where most are {usual:.6g} s"
        advice = f"interpolate it by hs.load(...).resample({usual:.4g}), or if only the times are wrong, {by_step}"
        raise ValueError(f"{table.place(k)}: the time must be evenly spaced, {sizes}; {advice}")
    decimal = float(f"{step:.6g}")
    return float(times[0]), decimal if abs(decimal - step) <= _SAME_DECIMAL * step else step


def in_si(values: FloatArray, unit: str) -> FloatArray:
    """Accelerations in m/s^2, from those in a unit; ValueError if it is unknown, or they are too few or too large."""
    name = _name(unit)
    if name is None:
        raise ValueError(f"{shown(unit)} is no known unit of acceleration: {_KNOWN}; pass the file's unit as units=")
    factor, divisor = _SCALES[name]
    with np.errstate(over="ignore"):
        accelerations = np.asarray(values * factor / divisor)
    require(accelerations.size >= 2, f"a ground motion needs at least 2 samples, there are {accelerations.size}")
    require(np.isfinite(accelerations).all(), "the accelerations are too large for their unit: correct it by units=")
    return accelerations


def stated_unit(header: str) -> str | None:
    """The unit that the text above some numbers states, None without one; ValueError if it is not understood.

    First the word behind "unit", then what is in brackets or behind "in", then words such as cm/sec2.
    """
    behind = [match.strip(".") for match in _STATED.findall(header)]
    words = [word.strip("().:") for word in re.split(r"[\s,;]+", header)]
    lone = [word for word in words if (name := _name(word)) and "/s2" in name]
    after_in = [word.strip(".") for word in _IN.findall(header)]
    for candidate in (*behind, *_BRACKETS.findall(header), *after_in, *lone):
        if _name(candidate):
            return str(candidate)
    if behind:
        raise ValueError(f"the header states the unit {shown(behind[0])}, which is unknown: pass units=, {_KNOWN}")
    return None


def unit_of_column(label: str, unit: str) -> str:
    """The unit of a column, m/s^2 by default; ValueError if the name may end in a unit."""
    if unit:
        return unit
    end = _ENDS_IN_UNIT.fullmatch(label.strip())
    if end and (name := _name(end[1])) and name != "m/s2":
        raise ValueError(f'column {shown(label)} may be in {end[1]}: pass units="{end[1]}", or units="m/s^2"')
    return "m/s^2"


def _name(unit: str) -> str | None:
    """The key of a unit in the table of scales, whatever its spelling."""
    text = unit.strip().lower().replace("²", "2").replace("**", "").replace("^", "").replace("'", "")
    text = re.sub(r"sec(ond)?s?", "s", re.sub(r"[\s*·.]+", "", text))
    text = {"gs": "g", "gals": "gal"}.get(text, text)
    text = _PER_SECOND_SQUARED.sub("/s2", text)
    return text if text in _SCALES else None


def peer_header(lines: list[str]) -> StatedValues | None:
    """The last of some lines that states NPTS and DT, because a corrected record may have its old header above."""
    for number in range(len(lines), 0, -1):
        line = lines[number - 1]
        if (n_values := _NPTS.search(line)) and (step := _DT.search(line)):
            return StatedValues(number, int(n_values[1]), _seconds(*step.groups()))
        if both := _IN_ORDER.search(line):
            n, length, milli = both.groups()[:3] if both[1] else both.groups()[3:]
            return StatedValues(number, int(n), _seconds(length, milli))
    return None


def _seconds(text: str, milli: str | None) -> float:
    return _real(text) / (1000.0 if milli else 1.0)


def cosmos_blocks(lines: list[str], skip: int) -> list[StatedValues]:
    """Every line below the first `skip` ones above a block of accelerations, as files of COSMOS have it."""
    numbered = [(number, _BLOCK.match(line)) for number, line in enumerate(lines, 1) if number > skip]
    return [StatedValues(number, int(block[1]), _real(block[2])) for number, block in numbered if block]


def number_list(lines: list[str], decimal: str | None, skip: int = 0) -> NumberList:
    """All numbers of a text after `skip` lines, or from the first line of numbers on; ValueError for anything else."""
    if (decimal or _decimal_sign(lines[skip:])) == ",":
        lines = [line.replace(",", ".") for line in lines]
    samples = [k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(COMMENTS)]
    places = [k for k in samples if k >= skip] if skip else _from_numbers_on(lines, samples)
    require(places, "there are no numbers" + (f" below line {skip}" if skip else ""))
    rows = [_numbers(lines[k], k + 1) for k in places]
    values = np.array([value for row in rows for value in row])
    return NumberList(values, "\n".join(lines[: places[0]]), [*map(len, rows)], [k + 1 for k in places])


def _from_numbers_on(lines: list[str], samples: list[int]) -> list[int]:
    """The samples from the first line of numbers on; a line above that looks like one with a fault in it is refused."""
    above = ""
    for at, place in enumerate(samples):
        try:
            width = len(_numbers(lines[place], place + 1))
        except ValueError:
            above = lines[place].strip()
            continue
        cells = [cell for cell in _BETWEEN.split(above) if cell]
        n_plain = sum(_NUMBER.fullmatch(cell) is not None for cell in cells)
        is_header = width == 1 or len(cells) != width or 2 * n_plain <= width
        got = f"expected {width} numbers or a header, got {shown(above, _LONGEST)}"
        require(is_header, f"line {place}: {got}; correct the number, or begin the line with #")
        return samples[at:]
    return []


def _decimal_sign(lines: list[str]) -> str:
    """The comma where blanks or semicolons divide numbers with one comma each and no point."""
    rows = [re.split(r"[\s;]+", line.strip()) for line in lines[:_LOOKED_AT] if line.strip()]
    rows = [row for row in rows if all(re.fullmatch(r"[\d+\-.,EeDd]+", cell) for cell in row)]
    cells = [cell for row in rows for cell in row if "," in cell]
    if not cells or any("." in cell for row in rows for cell in row) or not all(map(_WITH_COMMA.fullmatch, cells)):
        return "."
    is_clear = max(map(len, rows)) > 1
    advice = 'pass decimal="," for one number, decimal="." for two'
    require(is_clear, f"{shown(cells[0])} may be one number or two: {advice}")
    return ","


def _numbers(line: str, number: int) -> list[float]:
    """The numbers of a line; a ValueError if it holds something else."""
    text, values, place = line.strip(), list[float](), 0
    with suppress(ValueError):  # numbers that blanks divide, which are most
        values = [float(cell) for cell in text.split()]
        if "_" not in text and all(map(math.isfinite, values)):
            return values
        values = []
    while place < len(text):
        match = _NUMBER.match(text, place)
        values.append(math.nan if match is None else _value(match))
        if match is None or not math.isfinite(values[-1]):
            advice = f"correct the line, or if it belongs to the header, pass skip={number}"
            raise ValueError(f"line {number}: expected finite numbers, got {shown(text, _LONGEST)}; {advice}")
        between = _BETWEEN.match(text, match.end())
        place = between.end() if between else match.end()
        is_joined = between is None and text[place : place + 1] in (*_BEGIN,)
        is_clear = not match["whole"] and (match["exponent"] or match["bare"] or text[place : place + 1] in ("+", "-"))
        where = f"line {number}: it is not clear where the numbers end in {shown(text, _LONGEST)}"
        require(is_clear or not is_joined, f"{where}: put blanks between them")
    return values


def _value(match: re.Match[str]) -> float:
    return float(f"{match['mantissa']}E{match['bare']}") if match["bare"] else _real(match[0])


def _real(text: str) -> float:
    return float(text.upper().replace("D", "E"))
