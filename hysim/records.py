"""Measured or simulated records: input, output and times; slices keep units, resolution and name."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Any, Protocol, Self, TypeVar, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, Positive, checked, vectors, wrong_axes
from hysim._basics.prefixes import power_of_ten
from hysim._basics.printing import extent, listed, printed, quantity, summary_text
from hysim._columns.channels import Channels, along, checked_channels, taken, value_in
from hysim._columns.excursions import full_amplitude, protocol
from hysim._columns.resolution import output_quantum
from hysim._columns.turning import TOLERANCE, complete_cycles, drift, turns
from hysim.interop import channels_of, frame, table_in, told_by

T = TypeVar("T", float, FloatArray)
V = TypeVar("V", bound=np.generic)

_MOST_SAMPLES = 100_000_000  # of a resampled record: 2.4 GB
_ROUNDING = 1e-9  # of a number of steps
_SAME_STEP = 1e-6  # of a step
_EVEN = 1e-4  # of a step: largest error of an even time
_COARSEST = 0.1  # of a step: largest last digit of times that may have been rounded
_ROUNDED = 0.75  # of the last digit: half of it, and as much of the line's own
_MOST_DIGITS = 8  # of a time that was written down
_LEAST_NOISE = 1e-6  # of the size of a signal: its residual is not taken for smaller, however exact the fit
_LARGEST = 1e40  # of a record to identify: the squares of quotients of such numbers, and of their inverses, are numbers


@printed
@checked
class Record:
    """An input-output record.

    Parameters
    ----------
    u, y : array, shape (n,)
        Input and output, for instance a voltage and a displacement [``units["u"]``, ``units["y"]``].
    t : array, shape (n,), optional
        Strictly increasing times of the samples [``units["t"]``]; rate-independent laws need none. By default those in
        the index of `u` and `y`, where these are a Series of pandas or a DataArray of xarray: dates, time spans, an
        index called t or time, or floats without a name. Whole numbers without a name number the rows.
    units : mapping, optional
        Units of ``"t"``, ``"u"``, ``"y"``, channels, not checked; by default a Series' or DataArray's
        ``attrs["units"]``.
    resolution : float, optional
        Quantum of the output's sensor [unit of y].
    name : str, optional
        Name of the record in tables and figures.
    channels : mapping, optional
        Names of further measured quantities, such as a temperature, to one number for the record or to an array of
        shape (n,) [``units[name]``]. `hysim.identify` takes parameters that depend on them.

    Raises
    ------
    ValueError, TypeError
        If lengths differ, a value is not finite or no number, the time does not increase, or the times in the indexes
        of `u` and `y` differ; the message names the sample.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.Record(u=[0.0, 1.0, 0.0], y=[0.0, 0.9, 0.2], units={"u": "V", "y": "um"})
    >>> len(rec), rec[1:].u.tolist(), rec[1:].units["y"]
    (3, [1.0, 0.0], 'um')
    """

    u: FloatArray
    y: FloatArray
    t: FloatArray | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    resolution: Positive | None = None
    name: str = ""
    channels: Channels = field(default_factory=dict)

    def _prepare(self) -> None:
        if not type(self.u) is type(self.y) is np.ndarray and isinstance(self.units, Mapping):
            t, units = told_by(self.u, self.y, self.t, self.units)
            object.__setattr__(self, "t", t)
            object.__setattr__(self, "units", units)

    def __post_init__(self) -> None:
        for name, values in self._signals().items():
            if values.ndim != 1:
                raise ValueError(wrong_axes(name, values))
            if values.size != self.u.size:
                raise ValueError(f"u and {name} must have equal lengths, got {self.u.size} and {values.size}")
        if self.u.size < 2:
            raise ValueError(f"a record needs at least 2 samples, got {self.u.size}")
        if self.t is not None:
            check_increasing(self.t)
        object.__setattr__(self, "channels", MappingProxyType(checked_channels(self.channels, self.u.size)))
        if unknown := set(self.units) - {"t", "u", "y", *self.channels}:
            labels = ", ".join(f'"{name}"' for name in ("t", "u", "y", *self.channels))
            raise ValueError(f"units are labels of {labels}, got {sorted(unknown)}")

    def _signals(self) -> dict[str, FloatArray]:
        return {"u": self.u, "y": self.y} | ({} if self.t is None else {"t": self.t})

    def __str__(self) -> str:
        t, u, y = (self.units.get(signal, "") for signal in ("t", "u", "y"))
        n = self.reversals().size
        turned = f"{n} reversal{'' if n == 1 else 's'}"
        resolution = "" if self.resolution is None else f", resolution {quantity(self.resolution, y)}"
        time = "" if self.t is None else f"{extent(self.t, t)}, {self._step_in_words(t)}"
        title = f"Record {self.name}".rstrip() + f": {self.u.size} samples{', no time' * (self.t is None)}"
        signals = {"u": f"{extent(self.u, u)}, {turned}", "y": extent(self.y, y) + resolution}
        channels = {name: extent(value, self.units.get(name, "")) for name, value in self.channels.items()}
        return summary_text([title], {"t": time, **signals, **channels})

    def _step_in_words(self, unit: str) -> str:
        try:
            return f"every {quantity(self.sample_time, unit)}"
        except ValueError:
            return f"steps of {extent(np.diff(np.asarray(self.t)), unit)}"

    def __len__(self) -> int:
        return self.u.size

    def __getitem__(self, samples: slice) -> Self:
        if not isinstance(samples, slice):
            raise TypeError(f"a record is cut by a slice, got {samples!r}; take single values from its arrays")
        cut: dict[str, Any] = {name: values[samples] for name, values in self._signals().items()}
        return dataclasses.replace(self, **cut, channels=taken(self.channels, samples))

    def channel(self, name: str) -> float | FloatArray:
        """A channel by name: its number, or its values (n,) where they vary; ValueError for an unknown name."""
        owner = f"the record {self.name!r}" if self.name else "the record"
        value: float | FloatArray = value_in(self.channels, name, owner)
        return value

    @property
    def sample_time(self) -> float:
        """Constant step of the time [``units["t"]``]; ValueError if the record has no time, or uneven steps.

        Time stamps that are even but for the rounding of their digits are even.
        """
        if self.t is None:
            raise ValueError("the record has no time: give t, or use a rate-independent law")
        return even_step(self.t)

    def reversals(self, tolerance: float = 0.0) -> npt.NDArray[np.intp]:
        """Samples (n_reversals,) at which the input turns, the middle one of a plateau, without the record's ends.

        Reversals up to the fraction `tolerance` of the input's span are ignored; ValueError unless in [0, 0.5).

        Examples
        --------
        >>> import hysim as hs
        >>> rec = hs.Record(u=[0, 2, 2, 2, 1.9, 2, 0, 1], y=[0, 0, 0, 0, 0, 0, 0, 0])
        >>> rec.reversals().tolist(), rec.reversals(tolerance=0.1).tolist()
        ([2, 4, 5, 6], [3, 6])
        """
        middles = [(first + last) // 2 for first, last in turns(self.u, tolerance).plateaus[1:-1]]
        return np.array(middles, dtype=np.intp)

    def branches(self, tolerance: float = 0.0) -> tuple[Self, ...]:
        """Branches on which the input rises or falls, in the order of time; empty if the input is constant.

        A plateau between branches is divided in its middle; its middle sample, and a reversal without a plateau, belong
        to both. Reversals within the `tolerance`, as in `reversals`, end no branch, and are left out at the ends.

        Examples
        --------
        >>> import hysim as hs
        >>> [branch.u.tolist() for branch in hs.Record(u=[0, 1, 2, 2, 0], y=[0, 1, 2, 2, 1]).branches()]
        [[0.0, 1.0, 2.0], [2.0, 0.0]]
        """
        return tuple(self[samples] for samples in turns(self.u, tolerance).branches)

    def cycles(self, tolerance: float = TOLERANCE) -> tuple[Self, ...]:
        """Complete cycles of the input, in the order of time; empty without a complete cycle.

        A cycle goes from one extreme of the record to the other and back, each within 5 % of the input's span. Cycles
        are counted from the end and share no branch: the initial rise of a record is left out. If there are none, as in
        0 -> max -> min -> 0 and in growing protocols, they are the cycles of full amplitude about a level;
        `hysim.cycle_metrics` has the smaller ones too: cycle k of its table is ``rec[table.start[k]:table.stop[k]]``.

        Parameters
        ----------
        tolerance : float
            As in `reversals`.

        Returns
        -------
        tuple of Record

        Examples
        --------
        >>> import hysim as hs
        >>> u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=4)
        >>> [cycle.u.tolist() for cycle in hs.Record(u=u, y=u).cycles()][0]
        [0.0, 0.5, 1.0, 0.5, 0.0]
        """
        if between_extremes := complete_cycles(self.u, tolerance):
            return tuple(self[cycle.path] for cycle in reversed(between_extremes))
        about_level = protocol(self.u, tolerance)
        return tuple(self[about_level.slices[k]] for k in full_amplitude(self.u, about_level))

    def resample(self, sample_time: float) -> Self:
        """Interpolate the record and its channels linearly at even times, from the first time on.

        An extreme of the input between two new samples is lost: choose a `sample_time` [``units["t"]``] well below the
        time between reversals. ValueError without a time, or for a step that gives no or more than 1e8 samples.

        Examples
        --------
        >>> import hysim as hs
        >>> rec = hs.Record(t=[0, 1, 3], u=[0, 1, 3], y=[0, 2, 0])
        >>> rec.resample(1.0).y.tolist()
        [0.0, 2.0, 1.0, 0.0]
        """
        if self.t is None:
            raise ValueError("the record has no time to resample: give t")
        span = float(self.t[-1] - self.t[0])
        if not span / _MOST_SAMPLES <= sample_time <= span * (1 + _ROUNDING):
            raise ValueError(f"sample_time must be from {span / _MOST_SAMPLES:g} to {span:g}, got {sample_time}")
        t = self.t[0] + sample_time * np.arange(int(span / sample_time * (1 + _ROUNDING)) + 1)
        u, y = (np.interp(t, self.t, values) for values in (self.u, self.y))
        varying = {name: np.interp(t, self.t, values) for name, values in along(self.channels).items()}
        return dataclasses.replace(self, t=t, u=u, y=y, channels={**self.channels, **varying})

    def detrend(self, order: int = 1, *, tolerance: float = TOLERANCE) -> Self:
        """Remove the drift of the output, and leave the loop as it is.

        A polynomial of the time, or of the sample's number, is fitted to the differences between complete cycles at
        equal inputs of the same branch, so that the loop's slope and width have no influence, unlike in
        `scipy.signal.detrend`; its mean over these cycles is kept. A first cycle that follows another curve than the
        others looks like drift: cut it off before.

        Parameters
        ----------
        order, tolerance : int, and float
            Degree of the polynomial, and what is ignored as in `reversals`.

        Returns
        -------
        Record

        Raises
        ------
        ValueError
            If the order is below 1, or there are fewer than ``order + 1`` complete cycles.

        Examples
        --------
        >>> import numpy as np, hysim as hs
        >>> u = hs.signals.triangle(0.0, 1.0, cycles=4, samples_per_cycle=40)
        >>> drifting = hs.BoucWen(beta=2.0).response(u) + 0.001 * np.arange(u.size)
        >>> rec = hs.Record(u=u, y=drifting)[80:]
        >>> gaps = [hs.loop_metrics(part.u, part.y).closure_gap for part in (rec, rec.detrend())]
        >>> [round(abs(gap), 3) for gap in gaps]
        [0.04, 0.0]
        """
        if order < 1:
            raise ValueError(f"order must be at least 1, got {order}")
        cycles = complete_cycles(self.u, tolerance)
        if len(cycles) <= order:
            needed = f"a drift of order {order} needs {order + 1} complete cycles"
            raise ValueError(f"{needed}, the record has {len(cycles)}")
        times = np.arange(float(len(self))) if self.t is None else self.t
        return dataclasses.replace(self, y=self.y - drift(cycles, self.u, self.y, times, order))

    def split(self, *places: float) -> tuple[Self, ...]:
        """Cut the record in two or more parts without common samples, such as one to identify from and one to test on.

        The `places` increase: each is the number of the next part's first sample, or a fraction of the samples between
        0 and 1; anything else is a TypeError. ValueError without a place, or if a part has fewer than 2 samples.

        Examples
        --------
        >>> import hysim as hs
        >>> train, test = hs.Record(u=range(10), y=range(10)).split(0.7)
        >>> len(train), test.u.tolist()
        (7, [7.0, 8.0, 9.0])
        """
        if not places:
            raise ValueError("split needs a place: a fraction such as 0.7, or a sample's number")
        cuts = [0, *(self._sample_at(place) for place in places), len(self)]
        if min(np.diff(cuts)) < 2:
            raise ValueError(f"each part needs at least 2 samples, got {np.diff(cuts).tolist()} of them")
        return tuple(self[start:stop] for start, stop in pairwise(cuts))

    def convert(self, units: Mapping[str, str]) -> Self:
        """Convert the record to units that differ from its own by an SI prefix.

        `units` are the new ones of ``"t"``, ``"u"``, ``"y"`` or channels: ``{"y": "nm"}`` for an output in um. Values,
        and with the output also the resolution, are multiplied by a power of ten. A ValueError is raised if a signal
        has no unit or no values, or its unit and the new one differ by more than a prefix.

        Examples
        --------
        >>> import hysim as hs
        >>> rec = hs.Record(u=[0.0, 1.0], y=[0.0, 0.079], units={"y": "um"}, resolution=0.001)
        >>> rec.convert({"y": "nm"}).y.tolist(), rec.convert({"y": "nm"}).resolution
        ([0.0, 79.0], 1.0)
        """
        signals, changes = {**self._signals(), **self.channels}, dict[str, Any](units={**self.units, **units})
        channels = dict(self.channels)
        for signal, unit in units.items():
            if signal not in signals or signal not in self.units:
                raise ValueError(f"the record has no {signal!r} with a unit to convert: give it units first")
            power = power_of_ten(self.units[signal], unit)
            (channels if signal in channels else changes)[signal] = _scaled(signals[signal], power)
            if signal == "y" and self.resolution is not None:
                changes["resolution"] = _scaled(self.resolution, power)
        return dataclasses.replace(self, **changes, channels=channels)

    def detect_resolution(self) -> float | None:
        """Estimate the quantum of the output from its values [unit of y].

        It is the greatest step of which all outputs are whole multiples, up to a constant and to a tenth of the step,
        if values without a quantum would hardly fit as well. Values printed with three decimals have at least the step
        0.001, and evenly spaced ones, such as a noise-free triangle, have a step that is not a resolution.

        Returns
        -------
        float or None
            None if there is no step down to 1/65536 of the outputs' span, or there are too few values.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.datasets.table1().detect_resolution()
        0.0763
        """
        return output_quantum(self.y)

    def to_frame(self) -> Any:
        """The record as a `pandas.DataFrame`, with the time as index; ImportError without pandas.

        Columns are u, y and the channels that vary. Units, name, resolution and the other channels are its
        ``attrs``, from which `hysim.load` makes an equal record.
        """
        varying = along(self.channels)
        channels = {name: name if name in varying else value for name, value in self.channels.items()}
        notes = {"name": self.name, "resolution": self.resolution, "channels": channels}
        index = None if self.t is None else ("t", self.t)
        return frame({"u": self.u, "y": self.y, **varying}, index=index, units=self.units, notes=notes)

    def _sample_at(self, place: float) -> int:
        if isinstance(place, (int, np.integer)) and not isinstance(place, bool):
            return int(place)
        if isinstance(place, (float, np.floating)) and 0.0 < place < 1.0:
            return round(place * len(self))
        raise TypeError(f"a place must be a sample's number or a fraction between 0 and 1, got {place!r}")


@checked
class SensorRecord(Record):
    """Outputs of several sensors one after the other, each divided by its scale; the input as often."""

    sensors: Any = ()
    scales: tuple[float, ...] = ()
    sizes: tuple[float, ...] = field(default_factory=tuple)  # rms of each output

    @property
    def input(self) -> FloatArray:
        """The input once, which all of them share."""
        return self.u[: self.u.size // len(self.sensors)]

    def noise(self, residual: FloatArray) -> FloatArray:
        """Size of this residual (n,) at each sensor in its present units, shape (n_sensors,)."""
        errors = np.sqrt(np.mean(residual.reshape(len(self.sensors), -1) ** 2, axis=1))
        return np.asarray(np.maximum(errors, _LEAST_NOISE * np.array(self.sizes) / np.array(self.scales)))

    def rescaled(self, residual: FloatArray) -> "SensorRecord":
        """The record in units of the noise that this residual (n,) shows of each sensor."""
        ratios = self.noise(residual)
        scales = tuple((np.array(self.scales) * ratios).tolist())
        return replace(self, y=self.y / np.repeat(ratios, self.input.size), scales=scales)


@runtime_checkable
class InputOutput(Protocol):
    """A Record, a Simulation or anything with `u` and `y`, and perhaps `units`, `name`, times `t` and memory `z`."""

    @property
    def u(self) -> FloatArray: ...
    @property
    def y(self) -> FloatArray: ...


def signed_charge(capacity: npt.ArrayLike, current: npt.ArrayLike) -> FloatArray:
    """Charge that went into a cell, from a cycler's capacity that begins at zero again in each half cycle.

    Parameters
    ----------
    capacity : array, shape (n,)
        Charge that has gone in or out since the last beginning, not negative [any unit of charge].
    current : array, shape (n,)
        Positive where the cell is charged: its sign alone counts.

    Returns
    -------
    array, shape (n,)
        Zero at the first sample [unit of capacity].

    Raises
    ------
    ValueError
        If the lengths differ, or the capacity is negative or falls to something else than a new beginning.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.signed_charge([0.0, 1.0, 2.0, 0.0, 0.5], [3.0, 3.0, 3.0, -3.0, -3.0]).tolist()
    [0.0, 1.0, 2.0, 2.0, 1.5]
    """
    q, i = vectors(capacity=capacity, current=current)
    steps = np.diff(q)
    again = steps < 0.0
    steps[again] = q[1:][again]
    usual = float(np.abs(steps[~again]).max(initial=0.0))  # by hand: a half cycle begins below half of the last value
    if (q < 0.0).any() or (steps[again] > np.minimum(usual, 0.5 * q[:-1][again])).any():
        raise ValueError("capacity must count up from zero in each half cycle; a charge with a sign needs no more")
    return np.append(0.0, np.cumsum(np.sign(i[1:]) * steps))


def by_record(values: npt.NDArray[V], records: Sequence[Record]) -> list[npt.NDArray[V]]:
    """The parts of values (n_samples,) of records that follow each other, one for each record."""
    return np.split(values, np.cumsum([len(record) for record in records])[:-1])


def few_places(record: Record, most: int) -> npt.NDArray[np.intp]:
    """Places of at most so many even samples of a record, and of its reversals beyond noise."""
    evenly = np.linspace(0, len(record) - 1, min(most, len(record))).round().astype(np.intp)
    return np.union1d(evenly, record.reversals(TOLERANCE))


def several(records: Any, verb: str) -> tuple[Record, ...]:
    """One record or a sequence of them as a tuple; other arguments are errors that name the `verb`.

    Tables of other libraries with columns u and y are records, too. ValueError if squares or quotients would overflow.
    """
    if (single := as_record(records, verb)) is not None:
        return (_of_ordinary_size(single, verb),)
    members = [as_record(each, verb) for each in records] if isinstance(records, Sequence) else [None]
    if any(each is None for each in members):
        raise TypeError(f"{verb} takes a Record or several of them, got {type(records).__name__}: hs.Record(u=u, y=y)")
    if not members:
        raise ValueError(f"{verb} takes a Record or several of them: no record was given")
    for name in dict.fromkeys(name for each in members if each is not None for name in each.units):
        if len(units := {each.units.get(name, "") for each in members if each is not None} - {""}) > 1:
            raise ValueError(f"{verb} takes records in the same units, got {name} in {' and '.join(sorted(units))}")
    return tuple(_of_ordinary_size(each, verb) for each in members if each is not None)


def _of_ordinary_size(record: Record, verb: str) -> Record:
    for name, values in (("input u", record.u), ("output y", record.y)):
        size = float(np.abs(values).max())
        if size and not 1.0 / _LARGEST <= size <= _LARGEST:
            limits = f"between {1.0 / _LARGEST:g} and {_LARGEST:g} in size"
            raise ValueError(f"{verb} takes records {limits}, got an {name} of {size:.3g}: convert it to another unit")
    return record


def as_record(value: Any, verb: str) -> Record | None:
    """A record, as it is or in a table of another library with the columns u and y; None for what is neither."""
    if isinstance(value, Record):
        return value
    table = table_in(value)
    if table is None:
        return None
    if missing := [name for name in ("u", "y") if name not in table.labels]:
        got = f"got a {table.kind} without {listed(missing)}, with {listed(table.labels)}"
        advice = "name the columns by hs.load(table, u=..., y=...)"
        raise ValueError(f"{verb} takes a table with the columns u and y, {got}: {advice}")
    signals = {name: table.read(table.labels.index(name)) for name in ("u", "y", "t") if name in table.labels}
    channels = channels_of(table)
    units = dict(table.units) | {name: unit for name, (_, unit) in signals.items() if unit}
    units = {name: unit for name, unit in units.items() if name in ("t", "u", "y", *channels)}
    arrays: dict[str, Any] = {name: values for name, (values, _) in signals.items()}
    notes = {note: table.notes[note] for note in ("resolution", "name") if note in table.notes}
    return Record(**arrays, **notes, units=units, channels=channels)


def span_of(*records: Record) -> float:
    """Widest span of the inputs [unit of u]; ValueError where no input moves."""
    span = max(float(np.ptp(record.u)) for record in records)
    if span == 0.0:
        raise ValueError("the input is constant: nothing can be identified from it")
    return span


def check_increasing(t: FloatArray) -> None:
    if not (np.diff(t) > 0).all():
        k = int(np.argmax(np.diff(t) <= 0)) + 1
        raise ValueError(f"time must increase from sample to sample, got {t[k]} after {t[k - 1]} at sample {k}")


def even_step(t: FloatArray) -> float:
    """The constant step of increasing times (n_samples,); ValueError unless there are 2 or more, which increase evenly.

    Times are even if they lie within 1e-4 of a step from multiples of one, or as near to them as the rounding of their
    digits allows, where the last digit is at most a tenth of a step.
    """
    if t.size < 2:
        raise ValueError(f"t must hold at least 2 samples, got {t.size}")
    check_increasing(t)
    step = step_if_even(t)
    if step is not None:
        return step
    steps = np.diff(t)
    usual = f"{float(np.median(steps)):.4g}"
    mend = f"pass record.resample({usual}), or t = {usual} * np.arange(n) if only the time stamps are wrong"
    got = f"got steps from {steps.min()} to {steps.max()}"
    raise ValueError(f"the time must be evenly spaced, {got}: {mend}; on the command line --sample-time {usual}")


def step_if_even(t: FloatArray) -> float | None:
    """The constant step of at least 2 increasing times, None if they are not even in the sense of `even_step`."""
    steps = np.diff(t)
    mean = float(steps.mean())
    if np.ptp(steps) <= _SAME_STEP * mean:
        return mean
    number = np.arange(t.size) - 0.5 * (t.size - 1)
    step = float(number @ t) / float(number @ number)
    error = np.abs(t - t.mean() - step * number)
    digit = last_digit(t)
    if (error <= _EVEN * step).all() or (digit <= _COARSEST * step and (error <= _ROUNDED * digit).all()):
        return step
    return None


def last_digit(values: FloatArray) -> float:
    """The place of the last digit of numbers that were written down, such as 0.001; 0 if it is not visible."""
    size = float(np.abs(values).max())
    for place in range(_MOST_DIGITS):
        digit = 10.0 ** (math.floor(math.log10(size)) - place) if size else 0.0
        if digit and np.abs(values / digit - np.round(values / digit)).max() <= _SAME_STEP:
            return digit
    return 0.0


def _scaled(values: T, power: int) -> T:
    scaled: T = values * 10.0**power if power >= 0 else values / 10.0**-power
    return scaled
