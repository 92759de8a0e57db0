"""Ranges of samples by `--from`, `--to` and `--every`."""

import argparse
from typing import Any

import numpy as np

from hysim._prefixes import power_of_ten
from hysim.cli.options import Place
from hysim.records import Record

_ROUNDING = 1e-9  # of the record's time: 0.3 s is found among times that were added up


def cut(record: Record, options: argparse.Namespace) -> Record:
    """The part of the record that the options name; a ValueError if fewer than two samples are in it."""
    first, last, step = (vars(options)[name] for name in ("from", "to", "every"))
    if first is last is step is None:
        return record
    part = slice(_sample(record, first, "--from"), _sample(record, last, "--to"), step)
    n = len(range(*part.indices(len(record))))
    if n < 2:
        names = " and ".join(f"--{name}" for name in ("from", "to", "every") if vars(options)[name] is not None)
        raise ValueError(f"{n} of {len(record)} samples{_extent(record)} remain by {names}: a record needs at least 2")
    return record[part]


def _sample(record: Record, place: Place | None, option: str) -> int | None:
    """The number of the first sample at or after a place."""
    if place is None:
        return None
    if not place.unit:
        return int(place.value)
    if record.t is None:
        raise ValueError(f"{option} {place.value:g}{place.unit} needs a time: name its column by --t, or give a number")
    seconds: Any = 10.0 ** power_of_ten(place.unit, record.units.get("t", "s"))
    tolerance = _ROUNDING * float(record.t[-1] - record.t[0])
    return int(np.searchsorted(record.t, place.value * seconds - tolerance))


def _extent(record: Record) -> str:
    if record.t is None:
        return ""
    return f" between {record.t[0]:g} and {record.t[-1]:g} {record.units.get('t', '')}".rstrip()
