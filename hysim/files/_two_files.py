"""The verb `join_records`: a record of an input and an output that were written to different files."""

from dataclasses import replace

import numpy as np

from hysim._frozen import FloatArray
from hysim.records import Record


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
        return _at_times_of_the_output(u.t, u.u, y.t, y, units)
    if len(u) != len(y):
        raise ValueError(
            f"the input has {len(u)} samples and the output {len(y)}: without a time in both files the numbers must "
            "agree"
        )
    return _record(u.u, y.t if u.t is None else u.t, y, units)


def _at_times_of_the_output(t_u: FloatArray, u: FloatArray, t: FloatArray, y: Record, units: dict[str, str]) -> Record:
    first, last = int(np.searchsorted(t, t_u[0])), int(np.searchsorted(t, t_u[-1], side="right"))
    if last - first < 2:
        raise ValueError(
            f"the output's times, {t[0]:g} to {t[-1]:g}, are not within the input's, {t_u[0]:g} to {t_u[-1]:g}"
        )
    part = y[first:last]
    return _record(np.interp(t[first:last], t_u, u), t[first:last], part, units)


def _record(u: FloatArray, t: FloatArray | None, y: Record, units: dict[str, str]) -> Record:
    return replace(y, u=u, t=t, units=units)
