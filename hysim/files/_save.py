"""The verbs `save_record`, into a file of the format that its ending names, and `join_records`, of two files."""

import io
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hysim._basics.atomic import write_all
from hysim._basics.frozen import FloatArray
from hysim._basics.libraries import optional
from hysim._basics.printing import csv_text
from hysim._columns.channels import along
from hysim.files._arrays import NOTES, UNITS
from hysim.files._table import Notes
from hysim.records import Record, as_record

_VARIABLE = re.compile(r"[A-Za-z]\w{0,30}", re.ASCII)  # of MATLAB
_PLAIN_NAME = re.compile(r"[^\W\d][\w.-]*(?: [\w.-]+)*")
_PLAIN_UNIT = re.compile(r"[^\[\]()\s,;\"#%]+(?: [^\[\]()\s,;\"#%]+)*")


def save_record(record: Record, path: str | Path) -> None:
    """Save a record to a file, in the format that its ending names.

    The file holds the arrays to the last bit, channels, units, resolution and name; `hysim.load` returns an equal
    record. It is written completely or not at all, with the same bytes each time.

    - ``.csv``, ``.tsv``: a header ``t [s],u [V],y [um]``, below comments ``# name:``, ``# resolution:`` and
      ``# channels:``;
    - ``.npz``: arrays `t`, `u`, `y`, `resolution`, and texts `name`, `channels`, ``u_units`` and so on;
    - ``.mat``: the same as variables, numbers in columns, compressed; version 5, which MATLAB and Octave load;
    - ``.h5``, ``.hdf5``: datasets with an attribute `units`; `resolution`, `name` and `channels` of the file.

    A channel that varies is a column or array of its own; one that is constant stands as a number among the channels.

    Parameters
    ----------
    record : Record or table
        The record, or a table with the columns u and y, as in `hysim.identify`.
    path : str or path
        File to write, with one of these endings.

    Raises
    ------
    ValueError
        If the ending is another one, h5py is missing for HDF5, or a name or a unit cannot be written.
    TypeError
        If `record` is neither; the message says what to call for a model or a result.
    OSError
        If the folder cannot be written to.

    Examples
    --------
    >>> import tempfile
    >>> import tempfile, hysim as hs
    >>> rec = hs.datasets.table1()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "table1.npz"
    ...     hs.save_record(rec, path)
    ...     print(hs.load(path) == rec)
    True
    """
    if (own := as_record(record, "save_record")) is None:
        advice = "make one by hs.Record(u=result.u, y=result.y, t=result.t); hs.save(model, path) writes a model"
        raise TypeError(f"save_record takes a Record, got {type(record).__name__}: {advice}")
    record = own
    varying = along(record.channels)
    columns = {} if record.t is None else {"t": record.t}
    columns |= {"u": record.u, "y": record.y, **varying}
    form = _VARIABLE if Path(path).suffix.lower() == ".mat" else _PLAIN_NAME
    for name in varying:  # of which the file has no place for some, or would read them in another way
        if not form.fullmatch(name) or name in NOTES or name.endswith(UNITS):
            advice = "rename the channel, with letters, digits and _"
            raise ValueError(f"{Path(path).name}: a column cannot be called {name!r}; {advice}")
    channels = {name: name if name in varying else value for name, value in record.channels.items()}
    write_all({path: packed(columns, path, Notes(record.units, record.resolution, record.name, channels))})


def packed(columns: Mapping[str, FloatArray], path: str | Path, notes: Notes) -> bytes:
    """Columns of equal lengths as the content of a file, in the format of its ending; errors as in `save_record`."""
    write, buffer = _WRITERS[ending(path)], io.BytesIO()
    for text in (notes.name or "", *notes.units.values()):
        if "\0" in text or text.encode("utf-8", "replace").decode() != text:
            raise ValueError(f"names and units must be letters that can be written, got {text!r}")
    write(buffer, columns, notes)
    return buffer.getvalue()


def ending(path: str | Path) -> str:
    """The ending of a path, which names a format to save in; ValueError if it is unknown or its library is missing."""
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITERS:
        raise ValueError(f"{Path(path).name}: the ending must be one of {', '.join(_WRITERS)}, got {suffix!r}")
    if suffix in (".h5", ".hdf5"):
        optional("h5py", "a file of HDF5", "io", ValueError)
    return suffix


def _text(file: io.BytesIO, columns: Mapping[str, FloatArray], notes: Notes, *, delimiter: str) -> None:
    plain = {label: unit for label, unit in notes.units.items() if label in columns and _PLAIN_UNIT.fullmatch(unit)}
    comments: dict[str, Any] = {"name": notes.name, "resolution": notes.resolution}
    comments["units"] = dict(notes.units) if dict(notes.units) != plain else None
    comments["channels"] = dict(notes.channels)
    header = [f"{label} [{plain[label]}]" if label in plain else label for label in columns]
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = "".join(f"# {name}: {json.dumps(value)}\n" for name, value in comments.items() if value or value == "")
    file.write((lines + csv_text([header, *rows], delimiter=delimiter, nan="nan")).encode())


def _arrays(columns: Mapping[str, FloatArray], notes: Notes) -> dict[str, Any]:
    channels = json.dumps(dict(notes.channels)) if notes.channels else None
    others: dict[str, Any] = {f"{label}_units": unit for label, unit in notes.units.items()}
    others |= {"name": notes.name, "resolution": notes.resolution, "channels": channels}
    return {**columns, **{name: value for name, value in others.items() if value is not None}}


def _npz(file: io.BytesIO, columns: Mapping[str, FloatArray], notes: Notes) -> None:
    np.savez_compressed(file, **_arrays(columns, notes))


def _mat(file: io.BytesIO, columns: Mapping[str, FloatArray], notes: Notes) -> None:
    from scipy.io import savemat

    savemat(file, _arrays(columns, notes), do_compression=True, oned_as="column")
    file.seek(0)
    file.write(_MAT_TITLE)  # in place of one that holds the time


_MAT_TITLE = b"MATLAB 5.0 MAT-file, saved by hysim".ljust(116)


def _hdf5(file: io.BytesIO, columns: Mapping[str, FloatArray], notes: Notes) -> None:
    import h5py

    with h5py.File(file, "w") as root:
        for name, value in _arrays(columns, notes).items():
            label = name.removesuffix("_units")
            if name in columns:
                root[name] = value
            elif name != label and label in columns:
                root[label].attrs["units"] = value
            else:
                root.attrs[name] = value


_WRITERS: dict[str, Callable[[io.BytesIO, Mapping[str, FloatArray], Notes], None]] = {
    ".csv": partial(_text, delimiter=","), ".tsv": partial(_text, delimiter="\t"),
    ".npz": _npz, ".mat": _mat, ".h5": _hdf5, ".hdf5": _hdf5,
}  # fmt: skip


def join_records(u: Record, y: Record) -> Record:
    """Join the input of one record with the output of another.

    Without times, or with equal ones, the samples belong together by their numbers. If the times differ, the record has
    those of the output that lie within the input's, and the input is interpolated linearly there.

    Parameters
    ----------
    u : Record
        The record whose input is used, for instance ``hs.load("drive.csv", u="voltage", y="voltage")``.
    y : Record
        The record whose output, resolution, name and channels are used.

    Returns
    -------
    Record

    Raises
    ------
    ValueError
        If the numbers of samples differ and one of the records has no time, if fewer than two samples of the output
        are within the input's times, or the units of the times cannot be converted.

    Examples
    --------
    >>> import hysim as hs
    >>> drive = hs.Record(t=[0, 1, 2], u=[0, 10, 0], y=[0, 10, 0], units={"u": "V"})
    >>> sensor = hs.Record(t=[0.5, 1.0, 1.5], u=[0, 0, 0], y=[1, 2, 1], units={"y": "um"})
    >>> rec = hs.join_records(drive, sensor)
    >>> rec.t.tolist(), rec.u.tolist(), rec.y.tolist()
    ([0.5, 1.0, 1.5], [5.0, 10.0, 5.0], [1.0, 2.0, 1.0])
    """
    if "t" in u.units and "t" in y.units:
        y = y.convert({"t": u.units["t"]})
    units = {name: unit for name, unit in y.units.items() if name != "u"}
    units |= {name: unit for name, unit in u.units.items() if name in ("t", "u")}
    if u.t is not None and y.t is not None and not np.array_equal(u.t, y.t):
        first, last = int(np.searchsorted(y.t, u.t[0])), int(np.searchsorted(y.t, u.t[-1], side="right"))
        if last - first < 2:
            output, input_ = (f"{each[0]:g} to {each[-1]:g}" for each in (y.t, u.t))
            raise ValueError(f"the output's times, {output}, are not within the input's, {input_}")
        t = y.t[first:last]
        return replace(y[first:last], u=np.interp(t, u.t, u.u), t=t, units=units)
    if len(u) != len(y):
        sizes = f"the input has {len(u)} samples and the output {len(y)}"
        raise ValueError(f"{sizes}: without a time in both files the numbers must agree")
    return replace(y, u=u.u, t=y.t if u.t is None else u.t, units=units)
