"""Equations (1) and (4) identified anew, and what Table 2 can tell about (4).

(1) is said to come from Table 1 and (4) from Table 2, by a tool that identifies transfer functions. The paper
prints neither the hold and sampling that it assumed, nor what it did with levels and initial states, nor the
unit of time. Here the same structures are identified under the usual choices, and the unit of (4) is inferred:
of the candidates, the one in which (4) as printed repeats Table 2 best.

Table 2 is a square wave of four samples a period. Less its mean it has one line in its spectrum, at a quarter
of the sampling rate: a gain and a phase, two numbers. A plant with two poles and a zero has four coefficients;
Table 2 cannot tell them, and whatever they say away from that line is extrapolated.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from hysim._basics.frozen import FloatArray, frozen, read_only
from hysim.control import to_control
from hysim.datasets import SQUARE_WAVE_FREQUENCY, table1, table2
from hysim.identification import Identification, identify
from hysim.metrics import fit_percent
from hysim.paper import printed
from hysim.paper.equations import EQUATION_1, EQUATION_4, in_time_unit
from hysim.paper.study import BEST_DWELLS
from hysim.plants.transfer_function import TransferFunction
from hysim.records import Record

SAMPLE_SECONDS = 1.0 / (4.0 * SQUARE_WAVE_FREQUENCY)
_PROGRAM_SECONDS = (float(printed.ON_MS) + float(printed.OFF_MS)) / 1000.0
CANDIDATES: Mapping[str, float] = {
    "sample": 1.0,
    "period of the square wave": 0.25,
    "second": SAMPLE_SECONDS,
    "second, if the period is the program's": _PROGRAM_SECONDS / 4.0,
    "millisecond": 1000.0 * SAMPLE_SECONDS,
    "minute": SAMPLE_SECONDS / 60.0,
}
"""Name to the time from one sample of Table 2 to the next, in that unit."""

_SCAN = np.geomspace(0.01, 100.0, 300)
_ALIASED_POLES = (-0.78894 + 14.37101j, -0.011337 + 6.276672j)
"""One of each pair, beyond the Nyquist rate of pi: from local searches, which find others like it [rad/s]."""
_ROUNDING = 0.0005  # half a unit of the last digit of Table 2 [um]


class PrintedFit(NamedTuple):
    """Equation (1) as printed, on Table 1.

    Parameters
    ----------
    sample : {"start", "end"}
        Where in the hold the displacement is taken.
    initial : {"rest", "free"}
        Whether the state before the first sample is rest, or fitted.
    dwell : float
        That suits it best, to 2 % [s].
    fit_percent : float
        Fit at that dwell [%].
    """

    sample: str
    initial: str
    dwell: float
    fit_percent: float


class Refit(NamedTuple):
    """A structure identified anew.

    Parameters
    ----------
    hold, sample, initial : str
        As `hysim.TransferFunction.structure` takes them.
    n_parameters : int
        Those identified, the initial state included where it is free.
    fit_percent, fpe : float
        Of the record [%, um^2].
    dc_gain : float
        Of the model [um/V].
    model : TransferFunction
        Time in samples.
    message : str
        How the search ended, and what the data cannot tell.
    """

    hold: str
    sample: str
    initial: str
    n_parameters: int
    fit_percent: float
    fpe: float
    dc_gain: float
    model: TransferFunction
    message: str


@frozen
class TimeUnit:
    """Equation (4) as printed, read in one unit of time, on Table 2 less its means.

    The voltage is held and each displacement taken at the start of its hold.

    Parameters
    ----------
    name : str
        The unit.
    sample_time : float
        From one sample to the next [that unit].
    gain : float
        Of the continuous plant at the square wave's frequency [um/V].
    sampled_gain, sampled_phase_degrees : float
        Of the plant from sample to sample under the hold [um/V, degrees]: what Table 2 compares with.
    fit_at_rest : float
        Fit from rest, nothing left free [%].
    fit_with_state : float
        Fit with the initial state free [%].
    fit_with_level : float
        Fit with the initial state and the level of the displacement free [%].
    """

    name: str
    sample_time: float
    gain: float
    sampled_gain: float
    sampled_phase_degrees: float
    fit_at_rest: float
    fit_with_state: float
    fit_with_level: float


@frozen
class Information:
    """Information in Table 2 about a plant.

    Parameters
    ----------
    n_samples : int
        Rows.
    period : int
        Of the voltage [samples].
    n_determined : int
        Real numbers of a linear plant that the voltage, less its mean, determines in steady state.
    n_coefficients : int
        Free coefficients of (4).
    gain : float
        Measured, at the square wave's frequency [um/V].
    phase_degrees : float
        Measured [degrees].
    static_fit_percent : float
        Fit of a straight line without dynamics [%].
    swing, quantum : float
        Of the displacement: its swing, and the largest step of which all are whole multiples [um].
    """

    n_samples: int
    period: int
    n_determined: int
    n_coefficients: int
    gain: float
    phase_degrees: float
    static_fit_percent: float
    swing: float
    quantum: float


@frozen
class Reidentification:
    """Result of `reidentify`.

    Parameters
    ----------
    printed : tuple of PrintedFit
        Equation (1) as printed, on Table 1, by sampling and initial state.
    hysteresis : tuple of Refit
        Four poles and a zero, on Table 1.
    vibration : tuple of Refit
        Two poles and a zero, on Table 2 less its means.
    time_units : tuple of TimeUnit
        Equation (4) as printed in each candidate unit, the best first.
    best_sample_time : float
        Time between samples in which (4) as printed fits best, its initial state and level free [its unit].
    best_fit_percent : float
        That fit [%].
    at_most_at_rest, at_most_with_state : float
        Best fit in any unit, from rest and with the initial state free, at Table 2's own mean level [%].
    information : Information
        What Table 2 can tell at all.
    """

    printed: tuple[PrintedFit, ...]
    hysteresis: tuple[Refit, ...]
    vibration: tuple[Refit, ...]
    time_units: tuple[TimeUnit, ...]
    best_sample_time: float
    best_fit_percent: float
    at_most_at_rest: float
    at_most_with_state: float
    information: Information


def reidentify(identified: Identification) -> Reidentification:
    """Identify (1) and (4) anew, and infer the unit of time of (4).

    Parameters
    ----------
    identified : Identification
        Of (1)'s structure on Table 1: held voltage, start of the hold, at rest.
    """
    first = _refit(4, table1(), "zoh", "start", "rest", identified)
    others = (("zoh", "end", "rest"), ("zoh", "start", "free"), ("foh", "start", "rest"))
    record = without_means(table2())
    scanned = printed_fits(_SCAN)
    best_sample_time, best_fit = _best_unit(scanned[:, 2])
    return Reidentification(
        printed=printed_choices(),
        hysteresis=(first, *(_refit(4, table1(), *choice) for choice in others)),
        vibration=tuple(_refit(2, record, "zoh", sample, "rest") for sample in ("start", "end")),
        time_units=time_units(),
        best_sample_time=best_sample_time,
        best_fit_percent=best_fit,
        at_most_at_rest=float(scanned[:, 0].max()),
        at_most_with_state=float(scanned[:, 1].max()),
        information=information(),
    )


def time_units() -> tuple[TimeUnit, ...]:
    """Equation (4) as printed in each of `CANDIDATES`, the one that repeats Table 2 best first."""
    units = [_time_unit(name, sample_time) for name, sample_time in CANDIDATES.items()]
    return tuple(sorted(units, key=lambda unit: -unit.fit_with_level))


def information() -> Information:
    """The information in Table 2, and the part of a plant that it determines."""
    record = table2()
    response = _line(record.y) / _line(record.u)
    period = _period(record.u)
    slope, level = np.polyfit(record.u, record.y, 1)
    return Information(
        n_samples=len(record),
        period=period,
        n_determined=int(np.sum(_spectrum(record.u[:period]) > 1e-9)),
        n_coefficients=len(EQUATION_4.num) + EQUATION_4.order,
        gain=abs(response),
        phase_degrees=math.degrees(math.atan2(response.imag, response.real)),
        static_fit_percent=fit_percent(record.y, slope * record.u + level),
        swing=float(np.ptp(record.y)),
        quantum=quantum(record.y, _ROUNDING),
    )


def printed_fits(sample_times: FloatArray) -> FloatArray:
    """Fit [%] of (4) as printed to Table 2 less its means, for times between samples in (4)'s unit.

    Returns
    -------
    array, shape (n, 3)
        From rest; with the initial state free; with the initial state and the level free.
    """
    return _fits(EQUATION_4, without_means(table2()), np.asarray(sample_times))


def printed_choices() -> tuple[PrintedFit, ...]:
    """Equation (1) as printed on Table 1 at the best dwell from 0.1 to 50 s, from rest and with its state free.

    The level is none of the choices: Table 1 begins and ends at 0 V and 0 um.
    """
    choices = []
    for sample in ("start", "end"):
        fits = _fits(EQUATION_1, table1(), BEST_DWELLS, sample)
        for initial, column in zip(("rest", "free"), fits.T, strict=False):
            k = int(column.argmax())
            choices.append(PrintedFit(sample, initial, float(BEST_DWELLS[k]), float(column[k])))
    return tuple(choices)


def aliased_fit() -> float:
    """Fit [%] to Table 1 of four poles and a zero whose poles lie beyond the Nyquist rate; from rest, start of hold.

    At the samples such poles look like slower ones, so that `identify` leaves them out.
    """
    record = table1()
    structure = TransferFunction.structure(poles=4, zeros=1, sample="start")
    den = np.poly([*_ALIASED_POLES, *np.conj(_ALIASED_POLES)]).real
    columns = structure.regressors(dict(zip(structure.denominator, den[1:, np.newaxis], strict=True)), record)[0][:, :2]
    return fit_percent(record.y, _projected(columns, record.y))


def without_means(record: Record) -> Record:
    """The record less its mean input and output, time in samples."""
    samples = np.arange(float(len(record)))
    return replace(
        record, u=record.u - record.u.mean(), y=record.y - record.y.mean(), t=samples, units={"u": "V", "y": "um"}
    )


def _fits(model: TransferFunction, record: Record, units: FloatArray, sample: Any = "start") -> FloatArray:
    """Fit [%] of a printed model under a held input, columns as in `printed_fits`; the record's time in samples."""
    order, zeros = model.order, len(model.num) - 1
    powers = units[:, np.newaxis] ** np.arange(1, order + 1)
    den, num = powers * model.den[1:], powers[:, order - 1 - zeros :] * model.num
    structure = TransferFunction.structure(poles=order, zeros=zeros, sample=sample)
    columns = structure.regressors(dict(zip(structure.denominator, den.T, strict=True)), record)
    forced = np.einsum("kij,kj->ki", columns[..., : zeros + 1], num)
    level = np.ones((len(record), 1))
    outputs = [
        (y, y + _projected(states, record.y - y), y + _projected(np.hstack([states, level]), record.y - y))
        for y, states in zip(forced, columns[..., zeros + 1 : zeros + 1 + order], strict=True)
    ]
    return np.array([[fit_percent(record.y, y) for y in row] for row in outputs])


def _best_unit(fits: FloatArray) -> tuple[float, float]:
    """The best time between samples near the best of the scan, and its fit."""
    k = int(np.clip(fits.argmax(), 1, fits.size - 2))
    optimum = minimize_scalar(
        lambda x: -printed_fits(np.array([x]))[0, 2], bounds=(_SCAN[k - 1], _SCAN[k + 1]), method="bounded"
    )
    return float(optimum.x), float(-optimum.fun)


def _projected(columns: FloatArray, target: FloatArray) -> FloatArray:
    return np.asarray(columns @ np.linalg.lstsq(columns, target, rcond=None)[0])


def _time_unit(name: str, sample_time: float) -> TimeUnit:
    import control

    plant = to_control(in_time_unit(EQUATION_4, sample_time))
    quarter = 0.5j * math.pi
    through, sampled = complex(plant(quarter)), complex(control.sample_system(plant, 1.0, "zoh")(np.exp(quarter)))
    at_rest, with_state, with_level = printed_fits(np.array([sample_time]))[0]
    return TimeUnit(
        name=name,
        sample_time=sample_time,
        gain=abs(through),
        sampled_gain=abs(sampled),
        sampled_phase_degrees=float(np.angle(sampled, deg=True)),
        fit_at_rest=float(at_rest),
        fit_with_state=float(with_state),
        fit_with_level=float(with_level),
    )


def _refit(
    poles: int, record: Record, hold: Any, sample: Any, initial: Any, fit: Identification | None = None
) -> Refit:
    """Some poles and a zero on a record, identified unless that has been done."""
    structure = TransferFunction.structure(poles=poles, zeros=1, hold=hold, sample=sample, initial=initial)
    fit = identify(structure, record) if fit is None else fit
    model = fit.model
    return Refit(hold, sample, initial, fit.n_parameters, fit.fit_percent, fit.fpe, model.dc_gain, model, fit.message)


def _period(u: FloatArray) -> int:
    """The shortest period of the samples; their number if they do not repeat."""
    return next((p for p in range(1, u.size) if np.array_equal(u[p:], u[:-p])), u.size)


def _spectrum(u: FloatArray) -> FloatArray:
    """Magnitudes of the lines of one period less its mean, relative to the largest; each is one real number."""
    lines = np.abs(np.fft.fft(u - u.mean()))
    return np.asarray(lines / max(lines.max(), 1e-300))


def _line(values: FloatArray) -> complex:
    """Amplitude at a quarter of the sampling rate, over the last whole periods."""
    periodic = values[values.size % 4 :]
    return complex(np.mean(periodic * (-1j) ** np.arange(periodic.size)))


def quantum(values: npt.ArrayLike, tolerance: float) -> float:
    """The largest step that divides every value, to `tolerance` [unit of the values].

    Each number of steps in the largest value is tried in turn, with the step that suits all values best.

    Parameters
    ----------
    values : array, shape (n,)
        At least one not zero.
    tolerance : float
        Largest distance from a whole multiple: half a unit of the last digit, if the values were rounded once.

    Raises
    ------
    ValueError
        If all values are zero, or the tolerance is not positive.

    Examples
    --------
    >>> round(quantum([0.33, 0.67, 1.33], tolerance=0.01), 3)
    0.333
    """
    sizes = np.abs(read_only(values, "values", ndim=1))
    largest = float(sizes.max())
    if not (largest > 0.0 and tolerance > 0.0):
        raise ValueError("a quantum needs a value that is not zero, and a positive tolerance")
    for steps in range(1, int(largest / tolerance) + 1):
        counts = np.round(sizes * (steps / largest))
        step = float(counts @ sizes / (counts @ counts))
        if np.abs(sizes - step * counts).max() <= tolerance:
            return step
    return tolerance
