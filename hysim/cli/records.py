"""The options by which every command takes a record from a file."""

import argparse
import sys
from typing import Any

from hysim.records import Record

STANDARD = "-"
"""Stands for the standard input or output."""

DETECT = "detect"
"""Stands for the resolution that the output shows."""

_DELIMITERS = {"tab": "\t", "semicolon": ";", "comma": ",", "blank": " "}


def add_to(parser: argparse.ArgumentParser, *, output: bool = True) -> None:
    """Add the options; without `output` a file needs no column of it."""
    parser.add_argument(
        "file", metavar="FILE", help="text with one sample a line, NPZ, NPY, MAT or HDF5; or - for the standard input"
    )
    group = parser.add_argument_group("record")
    group.add_argument("--u", metavar="COLUMN", help="input: name of its column, or number from 0 (default: u)")
    if output:
        group.add_argument("--y", metavar="COLUMN", help="output: name or number (default: y)")
    time = group.add_mutually_exclusive_group()
    time.add_argument("--t", metavar="COLUMN", help="time: name or number (default: t, if there is such a column)")
    time.add_argument("--no-t", action="store_true", help="take no time from the file")
    group.add_argument(
        "--sample-time",
        metavar="STEP",
        type=float,
        help="time between two samples of a file without time [unit of t]; with --t, the step of even times to which "
        "the record is brought by straight lines between its samples",
    )
    group.add_argument("--on-missing", choices=("error", "drop"), default="error", help="samples without a value")
    group.add_argument(
        "--delimiter",
        metavar="SIGN",
        help=f"between cells of a text: one sign, or {', '.join(_DELIMITERS)}; else found",
    )
    group.add_argument("--decimal", choices=(".", ","), help="sign before the decimals of a text; else found")
    group.add_argument("--encoding", metavar="NAME", help="of a text, such as latin-1; else UTF-8, -16 or -32")
    group.add_argument(
        "--resolution",
        metavar="QUANTUM",
        type=_quantum,
        help="of the output's sensor [unit of y], or detect: the step of which all outputs are multiples",
    )
    group.add_argument(
        "--unit", metavar="SIGNAL=UNIT", type=unit, action="append", default=[], help="of t, u or y: u=V"
    )


def read(options: argparse.Namespace) -> Record:
    """The record that the options describe; without a column of the output, its output is the input."""
    from dataclasses import replace

    import numpy as np

    from hysim.files import load

    source: Any = options.file
    if source == STANDARD:
        source = getattr(sys.stdin, "buffer", sys.stdin)
    u = column(options.u) if "y" in options or options.u is not None else "u"
    record: Record = load(
        source,
        u=u,
        y=column(options.y) if "y" in options else u,
        t=False if options.no_t else column(options.t),
        on_missing=options.on_missing,
        delimiter=_DELIMITERS.get(options.delimiter, options.delimiter),
        decimal=options.decimal,
        encoding=options.encoding,
        units=dict(options.unit),
        resolution=options.resolution,
        name="record" if options.file == STANDARD else None,
    )
    if options.sample_time is None:
        return record
    if not 0.0 < options.sample_time < float("inf"):
        raise ValueError(f"--sample-time must be positive, got {options.sample_time}")
    if record.t is None:
        return replace(record, t=options.sample_time * np.arange(len(record)))
    return record.resample(options.sample_time)


def unit(text: str) -> tuple[str, str]:
    """Signal and unit of ``u=V``."""
    signal, equals, label = text.partition("=")
    if not equals or signal not in ("t", "u", "y"):
        raise argparse.ArgumentTypeError(f"expected t=, u= or y= and a unit, got {text!r}")
    return signal, label


def column(text: str | None) -> str | int | None:
    """Name or number of a column."""
    return int(text) if text is not None and text.isascii() and text.isdigit() else text


def _quantum(text: str) -> float | str:
    if text == DETECT:
        return text
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number or {DETECT}, got {text!r}") from None
