"""Response spectra of earthquakes: peaks of elastic oscillators, and of oscillators of one ductility or strength.

    u'' + 2 zeta omega u' + omega^2 f(u) / k0 = -scale a(t),    k0 = f'(0)

has the ductility max |u| / yield_input of an oscillator under a(t) itself whose force is divided by the scale. The
yield strength of that one is its mass times omega^2 yield_input / scale. A search for a strength varies the scale only.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import elementwise

from hysim._basics.frozen import FloatArray, check_positive, read_only
from hysim._basics.parallel import map_on_threads
from hysim._basics.printing import aligned, frozen_result, summary_text
from hysim._basics.results import model_of
from hysim.laws.static import Line
from hysim.models.protocols import positive_time
from hysim.plants.structures.structure import Structure, shear_frame

_PHASE = 0.18  # of an elastic oscillator in a step: peaks between its ends then err by less than 1e-10
_TOLERANCE = 1e-8  # ductilities err by less than 1e-6; coarser steps make small reversals, after which steel is elastic
_AT_REST, _EQUAL = 1e-8, 1e-3  # stroke by yield_input; difference of the slopes to both sides
_STEP, _MOST = math.log(1.2), math.log(1e8)  # of a scale; half the step was tried, and misses as many crossings
_CLOSE, _NARROW = 1e-6, 1e-10  # in ln(ductility); in ln(scale) where the ductility jumps
_DIVERGED = 1e6  # times the elastic displacement; down to periods of 1 ms the weakest oscillators follow the ground


@frozen_result
class ResponseSpectrum:
    """Result of `hysim.response_spectrum`; tables have the shape (n_records, n_periods).

    Parameters
    ----------
    periods, damping : array, shape (n_periods,), and float
        Periods of small motions [s], and share of their critical damping.
    elastic_acceleration, pseudo_acceleration : array
        Elastic pseudo-acceleration, and yield strength over mass, or without a law the first again [unit of the input].
    ductility : array
        Peak displacement over that at yield; 1 without a law, inf where the motion diverges.
    """

    periods: FloatArray
    damping: float
    elastic_acceleration: FloatArray
    pseudo_acceleration: FloatArray
    ductility: FloatArray

    @property
    def displacement(self) -> FloatArray:
        """Peak displacement relative to the ground [unit of the ground acceleration times s^2]."""
        return np.asarray(self.ductility * self.pseudo_acceleration * (self.periods / (2.0 * math.pi)) ** 2)

    @property
    def reduction_factor(self) -> FloatArray:
        """Elastic demand over the yield strength."""
        return np.asarray(self.elastic_acceleration / self.pseudo_acceleration)

    def __str__(self) -> str:
        tables = (self.displacement, self.pseudo_acceleration, self.ductility, self.reduction_factor)
        medians = np.array([self.periods, *(np.median(table, axis=0) for table in tables)])
        shown = medians[:, np.unique(np.linspace(0, self.periods.size - 1, 7).astype(int))]
        names = ["  period", "displacement", "pseudo-acceleration", "ductility", "reduction factor"]
        lines = aligned([names, *([f"  {row[0]:.3g}", *(f"{each:.4g}" for each in row[1:])] for row in shown.T)])
        size = f"medians of {len(self.ductility)} records, {self.periods.size} periods, damping {self.damping:g}"
        return summary_text([f"ResponseSpectrum: {size}", *lines])


def response_spectrum(
    ground_accelerations: npt.ArrayLike | Sequence[npt.ArrayLike],
    sample_time: float,
    periods: npt.ArrayLike,
    *,
    law: Any = None,
    yield_input: float = 1.0,
    damping: float = 0.05,
    ductility: float | None = None,
    strength: npt.ArrayLike | None = None,
    workers: int | None = None,
) -> ResponseSpectrum:
    """Peaks of oscillators in earthquakes: elastic ones, or ones of a law with one ductility or one strength.

    Parameters
    ----------
    ground_accelerations : array, shape (n_samples,) or (n_records, n_samples), or sequence of arrays
        Records, linear between samples. Each is continued by zeros for the longest period.
    sample_time, periods : float, and array, shape (n_periods,)
        Time between two samples of all records, and periods of small motions [s].
    law, yield_input : law, or result of a fit of one, and float, optional
        Shape of the restoring force, in any units, and the input at which its ductility is 1.
    damping : float
        Share of the critical damping of small motions, from 0 to below 1.
    ductility : float, optional
        At least 1: the largest strength with this ductility is searched for, downwards from the elastic demand in steps
        of 1.2. Where the ductility jumps over this value, it is the strength before the jump.
    strength : float, or array, shape (n_periods,) or (n_records, n_periods), optional
        Yield strength over mass [unit of the ground acceleration]; its ductility is computed.
    workers : int, optional
        Number of threads; by default one for each core. The result does not depend on it.

    Returns
    -------
    ResponseSpectrum

    Raises
    ------
    TypeError, ValueError
        If the law cannot be an `Element`, or has no positive stiffness at rest; if a number is out of its range, a law
        comes without ductility and strength or with both, or no strength has the ductility.

    Examples
    --------
    >>> import hysim as hs
    >>> quake = hs.signals.ground_motion(3.0, duration=20.0, sample_time=0.01, seed=1)
    >>> spectrum = hs.response_spectrum(quake, 0.01, [0.2, 1.0], law=hs.MenegottoPinto(), ductility=4.0)
    >>> spectrum.reduction_factor.round(3).tolist()
    [[2.176, 2.441]]
    """
    h, T = positive_time(sample_time), read_only(periods, "periods", ndim=1)
    records = ground_records(ground_accelerations, math.ceil(T.max(initial=0.0) / h))
    strengths = np.broadcast_to(read_only(1.0 if strength is None else strength, "strength"), (len(records), T.size))
    check_positive(periods=min(T, default=0.0), yield_input=yield_input, strength=strengths.min(initial=1.0))
    if not 0.0 <= damping < 1.0 <= (1.0 if ductility is None else ductility) < math.inf:
        raise ValueError(f"damping must be from 0 to below 1, ductility at least 1, got {damping} and {ductility}")
    if (ductility is not None) + (strength is not None) != (law is not None):
        raise ValueError("a law needs either ductility= or strength=; elastic oscillators have no law and neither")
    omega, spring = 2.0 * math.pi / T, Line(slope=1.0) if law is None else model_of(law)
    oscillator = shear_frame([1.0], laws=spring, damping=1.0, tolerance=_TOLERANCE)
    parts = [(w, math.ceil(w * h / _PHASE)) for w in omega.tolist()]
    linear = [shear_frame([1.0], laws=Line(slope=w * w), damping=2.0 * damping * w, substeps=n) for w, n in parts]
    at_yield, mass = omega**2 * yield_input, _slope(oscillator, yield_input) / omega**2

    def work(k: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        run: dict[str, Any] = {"ground_accelerations": records[k], "sample_time": h, "workers": 1}
        demand = omega**2 * np.array([each.responses([1.0], **run)[0, 0] for each in linear])
        if not demand.all():
            raise ValueError(f"record {k} of ground_accelerations is zero or empty")
        if law is None:
            return demand, demand, np.ones(T.size)

        def peaks(scales: FloatArray, places: Any) -> FloatArray:
            numbers = {"mass": mass[places], "damping": (2.0 * damping * omega * mass)[places], "scale": scales}
            values = oscillator.responses(numbers, **run)[:, 0] / yield_input
            return np.where(values < _DIVERGED * scales * (demand / at_yield)[places], values, np.inf)

        if ductility is None:
            return demand, strengths[k], peaks(at_yield / strengths[k], slice(None))
        scales, ductilities = _first_crossing(peaks, ductility, at_yield / demand)
        return demand, at_yield / scales, ductilities

    tables = np.swapaxes(map_on_threads(work, len(records), workers=workers), 0, 1)
    names = ("elastic_acceleration", "pseudo_acceleration", "ductility")
    return ResponseSpectrum(periods=T, damping=damping, **dict(zip(names, tables, strict=True)))


def ground_records(values: Any, n_zeros: int = 0) -> list[FloatArray]:
    """One record, the rows of a table, or a sequence of records, each continued by zeros."""
    are_several = isinstance(values, list | tuple) and any(np.ndim(row) for row in values[:1])
    rows = values if are_several else np.atleast_2d(read_only(values, "ground_accelerations"))
    return [np.append(read_only(row, "ground_accelerations", ndim=1), np.zeros(n_zeros)) for row in rows]


def _slope(oscillator: Structure, yield_input: float) -> float:
    law, stroke = oscillator.laws.steppers[0], _AT_REST * yield_input
    members = ((law.started(0.0), u) for u in (stroke, -stroke))
    up, down = (each.step(each.parameters, each.state, u) / u for each, u in members)
    if not (min(up, down) > 0.0 and abs(up - down) <= _EQUAL * max(up, down)):
        words = f"at inputs of +-{_AT_REST:g} yield_input output over input is {up:g} and {down:g}"
        raise ValueError(f"the law needs no force at rest and one positive stiffness on both sides: {words}")
    return float(0.5 * (up + down))


def _first_crossing(peaks: Any, ductility: float, elastic: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smallest scales with a ductility, or those before it jumps, and the ductilities; trials begin at `elastic`."""

    def excess(x: FloatArray, places: Any) -> FloatArray:
        return np.asarray(np.log(peaks(np.exp(x), places) / ductility).clip(max=5.0))  # of infinite ones, too

    start, every = np.log(elastic), np.arange(elastic.size)
    x, remaining, is_above = start.copy(), every, excess(start, every) >= 0.0
    while remaining.size:
        x[remaining] += np.where(is_above[remaining], -_STEP, _STEP)  # smooth laws yield before their yield_input
        if np.abs(x - start).max() > _MOST:
            raise ValueError("no strength has this ductility: is yield_input the input at which the law yields?")
        remaining = remaining[(excess(x[remaining], remaining) >= 0.0) == is_above[remaining]]
    low, tolerances = np.where(is_above, x, x - _STEP), {"xatol": _NARROW, "xrtol": 0.0, "fatol": _CLOSE, "frtol": 0.0}
    root = elementwise.find_root(excess, (low, low + _STEP), args=(every,), tolerances=tolerances)
    x, value = np.where(np.abs(root.f_x) <= _CLOSE, (root.x, root.f_x), (root.bracket[0], root.f_bracket[0]))
    return np.exp(x), ductility * np.exp(value)
