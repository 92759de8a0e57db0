"""Warnings for users of a result, and whether the input and the output of a record were swapped.

**By the columns.** The output is a generator's waveform, a triangle of equal steps or one sine, and the input is none.

**By a family.** An actuator's loop runs counterclockwise, and clockwise where the columns were swapped; but so does a
force that follows from a displacement. A clockwise record is doubted only where the same family fits well from y to u
and clearly better than from u to y, in a short fit on at most 500 samples whose error is an upper bound.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim._columns.input_noise import noise_level
from hysim.errors import SimulationError
from hysim.identification._problem import Problem, Setting, problems, samples_of_sensor
from hysim.identification._search import brief_optimum
from hysim.laws.static import Line
from hysim.models.law import Law
from hysim.models.parts import labels
from hysim.models.protocols import Identifiable, needs_time
from hysim.records import Record

CONSTANT = "the output is constant: the fit in percent is not defined, and the output shows no effect of the input"
SWAPPED = "the input and the output may be swapped"
_CORRELATED = 1e-3  # probability of white residuals
_RESTING = 1e-6  # of the output's standard deviation: smaller residuals are the end of a descent
_ROUNDING = 1e-12  # of the output's size
_ALONE = 0.5  # of the rms residual, in one sample or in the mean; by hand
_FEW = 20  # samples, too few to say so
_SHARE_OF_NOISE = 0.3  # of the residuals: below it noise of the input adds less than 5 % to them
_FEWEST = 20  # samples in which a waveform can be recognised
_SAME = 1e-6  # of a step: steps of a generator are equal but for rounding
_MOSTLY = 0.9  # of the steps are equal in a triangle; its turns may be samples of their own
_SMOOTH = 1e-3  # of the second differences: a sine's follow from its samples, noise adds to them
_MOST_SAMPLES = 500
_BETTER = 0.8  # of the forward error: a reverse fit that is better by chance, or by a parameter, is not
_GOOD = 0.1  # of the standard deviation: a reverse model that is worse describes nothing
_NOTABLE = 0.05  # of the standard deviation: a smaller error hides no offset that a user would miss
_PERFECT = 1e-3  # forward errors below this leave nothing to suspect


def sentences(
    *, spread: float, exact: bool, whiteness: float, stderr: Mapping[str, float], reasons: Sequence[str], success: bool
) -> tuple[str, ...]:
    """Warnings; `spread` is the output's standard deviation, `exact` says that the residual is rounding."""
    warnings = [] if success else ["the search did not converge: better parameters may exist"]
    if spread == 0.0:
        warnings.append(CONSTANT)
    if unknown := [name for name, value in stderr.items() if np.isnan(value)]:
        why = f": {'; '.join(reasons)}" if reasons else ""
        warnings.append(f"no standard error for {', '.join(unknown)}{why}")
    if stderr and whiteness < _CORRELATED and not exact:
        warnings.append("residuals are correlated (p < 0.001): the intervals are too narrow")
    return tuple(warnings)


def is_exact(problem: Problem, rmse: float) -> bool:
    return rmse <= max(_RESTING * float(np.std(problem.y)), _ROUNDING * problem.scale)


def odd_residuals(problem: Problem, residual: FloatArray, *, is_robust: bool) -> list[str]:
    """Sentences on a sample that carries a fit, and on a record or sensor whose residual is mostly its mean."""
    counted, n = np.sqrt(problem.weights) * residual, np.count_nonzero(problem.weights)
    rms, k, several = float(np.sqrt(counted @ counted / n)), int(np.argmax(np.abs(counted))), len(problem.parts) > 1
    if is_exact(problem, rms):
        return []
    told = [f'sample {k} alone makes most of the residual: leave it out by weights=, or take noise="robust"']
    told = told if n > _FEW and not is_robust and abs(counted[k]) > _ALONE * math.sqrt(n) * rms else []
    held = ", or holds within bounds" if "offset" in problem.space.bounds else ""
    for place, (record, own) in enumerate(problem.pieces):
        n_sensors = len(record) // samples_of_sensor(record)
        for sensor, part in enumerate(np.split(counted[own], n_sensors)):
            if part.size > _FEW and abs(part.mean()) > _ALONE * max(float(np.sqrt(np.mean(part**2))), rms):
                of = f" of sensor {sensor}" * (n_sensors > 1) + f" of record {place}" * several
                told.append(
                    f"the residual{of} is mostly its mean {part.mean():.3g}: an offset that the model lacks{held}"
                )
    return told


def rate_noise_warning(models: Sequence[Any], records: Sequence[Record]) -> str:
    """A sentence where noise of the input explains residuals of models that depend on time; else the empty text.

    Noise is added to each input once more: what the output changes by, the input's own noise has done to the residuals.
    """
    rng = np.random.default_rng(0)
    for model, record in zip(models, records, strict=True):
        noise = noise_level(record.u)
        if not (noise and needs_time(model) and record.sample_time):
            continue
        try:
            inputs = record.u, record.u + noise * rng.standard_normal(len(record))
            outputs = [np.asarray(model.response(u, record.sample_time)) for u in inputs]
        except SimulationError:
            continue
        share = metrics.rmse(*outputs) / max(metrics.rmse(record.y, outputs[0]), float(np.finfo(float).tiny))
        if share > _SHARE_OF_NOISE:
            return (
                f"the input has noise of about {noise:.2g} rms, {100.0 * noise / np.ptp(record.u):.2g} % of its span, "
                f"and the model depends on its rate: noise of this size changes the output by {100.0 * share:.0f} % of "
                "the residuals, and biases damping, breakaway and other parameters of the velocity. Smooth the "
                "input and identify again, such as with scipy.signal.savgol_filter over a small part of a cycle"
            )
    return ""


def swapped_columns(records: Sequence[Record]) -> str:
    """A sentence if each record's output is a generator's waveform and its input is not; else the empty text."""
    if not all(_is_generated(record.y) and _moves(record.u) and not _is_generated(record.u) for record in records):
        return ""
    return (
        f"{SWAPPED}: y is a regular waveform, as a generator makes it, and u is not; check the columns, unless u was "
        "computed so that y is regular"
    )


def _moves(signal: FloatArray) -> bool:
    return bool(np.mean(np.diff(signal) != 0.0) >= _MOSTLY)


def _is_generated(signal: FloatArray) -> bool:
    steps = np.diff(signal)
    if signal.size < _FEWEST or not np.any(steps):
        return False
    length = float(np.median(np.abs(steps)))
    if np.mean(np.abs(np.abs(steps) - length) <= _SAME * length) >= _MOSTLY and length > 0.0:
        return True
    bends = np.diff(steps)  # of a sine: an affine function of the sample in the middle
    middle = np.stack([signal[1:-1], np.ones(bends.size)], axis=1)
    rest = bends - middle @ np.linalg.lstsq(middle, bends, rcond=None)[0]
    return bool(np.std(rest) <= _SMOOTH * np.std(bends) > 0.0)


def swapped_for(family: Identifiable, setting: Setting, error: float) -> str:
    """A sentence if the family fits the first record better from y to u; `error` is relative to the spread of y."""
    record = setting.records[0]
    if len(setting.records) > 1 or not error > _PERFECT or not _is_clockwise(record):
        return ""
    reverse = replace(record, u=record.y, y=record.u, resolution=None, units={})
    other = _error_in_short(family, reverse, setting)
    if not other < min(_BETTER * error, _GOOD):
        return ""
    return (
        f"{SWAPPED}: from y to u the same family leaves an error of {100.0 * other:.2g} % instead of "
        f"{100.0 * error:.2g} %, and the loop runs counterclockwise as an actuator's does; check the columns"
    )


def offset_for(family: Identifiable, free: Sequence[str], setting: Setting, error: float) -> str:
    """A sentence if a law that has no free offset fits the first record clearly better with a constant."""
    record, freedom = setting.records[0], setting.freedom
    if not isinstance(family, Law) or not error > _NOTABLE or "offset" in (*free, *freedom.fixed):
        return ""
    both = family + Line(slope=0.0)
    label, line = labels(both.members)
    fixed = {f"{label}.{name}": value for name, value in freedom.fixed.items()} | {f"{line}.slope": 0.0}
    bounds = {f"{label}.{name}": pair for name, pair in freedom.bounds.items()}
    own = replace(freedom, fixed=fixed, free=tuple(f"{label}.{name}" for name in freedom.free), bounds=bounds)
    before = _error_in_short(family, record, setting)
    other = _error_in_short(both, record, replace(setting, freedom=own))
    if not other < _BETTER * before:
        return ""
    return (
        "the output may have an offset, which this law does not have: a short fit with a constant added leaves an "
        f"error of {100.0 * other:.2g} % instead of {100.0 * before:.2g} %; subtract the offset, or identify the "
        "law + hs.Line()"
    )


def _error_in_short(family: Identifiable, record: Record, setting: Setting) -> float:
    """Error of a short fit to part of a record, relative to the spread of its output; inf if it cannot be fitted."""
    record = record[:: -(-len(record) // _MOST_SAMPLES)]
    try:
        attempt = problems(family, [record], setting.freedom, setting.initial)[0]
        if len(attempt.space.names) >= len(record) or not np.ptp(record.y):
            return math.inf
        while attempt.stage is not None and attempt.simpler is not None:
            attempt = attempt.simpler
        cost = brief_optimum(attempt)[1]
    except (ValueError, TypeError, ArithmeticError, SimulationError):
        return math.inf
    return float(np.sqrt(cost / len(record)) / np.std(record.y))


def _is_clockwise(record: Record) -> bool:
    try:
        return metrics.loop_metrics(record.u, record.y).orientation == "clockwise"
    except ValueError:  # there is no complete cycle
        return False
