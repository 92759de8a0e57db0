"""The two tables of measurements in the paper.

Source: B. B. Muhammad, M. H. Rahman, M. R. Ahmad, M. Bashir, "A novel model of PZT actuator and its application
in hysteresis and vibration controls", Jurnal Teknologi, 2016. The files in `hysim/data` hold the values as
printed. The paper prints no time for either table: the times here are ours, and evenly spaced.
"""

from importlib.resources import files

import numpy as np

from hysim._basics.frozen import FloatArray, check_positive_and_finite
from hysim.records import Record

__all__ = ["PIXEL", "SQUARE_WAVE_FREQUENCY", "table1", "table2"]


def __dir__() -> list[str]:
    return __all__


PIXEL = 0.0763
"""Table 1's resolution [um]: every displacement is a whole multiple of it, to 5 nm."""

SQUARE_WAVE_FREQUENCY = 1.01626
"""Frequency of Table 2's input [Hz]; a period has four samples."""


def table1(dwell: float = 1.0) -> Record:
    """Table 1: a staircase of 52 voltages from 0 to 125 V and back, and the displacements at them.

    The record has voltage [V], displacement [um], one camera pixel as resolution, and time `dwell * k` [s]: the paper
    prints no times. A ValueError is raised if the dwell is not positive and finite.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> len(rec), rec.u[25:27].tolist(), rec.y[25:27].tolist(), rec.units["y"]
    (52, [125.0, 125.0], [2.671, 2.671], 'um')
    """
    check_positive_and_finite(dwell=dwell)
    _, _, voltage, displacement = _columns("table1.csv")
    return _record("Table 1", voltage, displacement, dwell, PIXEL)


def table2() -> Record:
    """Table 2: 10 samples of a square wave between 18 and 50 V, and the displacements at them.

    Returns
    -------
    Record
        Voltage [V], displacement [um] and time [s]: four samples a period of 1.01626 Hz. No resolution is known.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table2()
    >>> len(rec), round(rec.sample_time, 3), round(float(rec.y.max() - rec.y.min()), 3)
    (10, 0.246, 1.021)
    """
    _, _, displacement, voltage = _columns("table2.csv")
    return _record("Table 2", voltage, displacement, sample_time=1 / (4 * SQUARE_WAVE_FREQUENCY))


def _columns(file: str) -> FloatArray:
    lines = (files("hysim") / "data" / file).read_text(encoding="utf-8").splitlines()
    return np.loadtxt([line for line in lines if not line.startswith("#")][1:], delimiter=",").T


def _record(name: str, u: FloatArray, y: FloatArray, sample_time: float, resolution: float | None = None) -> Record:
    t, units = sample_time * np.arange(float(u.size)), {"t": "s", "u": "V", "y": "um"}
    return Record(u=u, y=y, t=t, units=units, resolution=resolution, name=name)
