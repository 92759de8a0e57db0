"""Errors of a law and its competitors on samples that were left out of the fit, and the rates of the input.

Left out at a time is a record, if there are several and none goes beyond the range of the others; of one record a
rate, if its cycles have several; else a cycle, if there are three; else a few blocks. The start of each record is
never left out, since it determines the initial state, and samples beyond the range of the others do not count, unless
all are. A slow trend of each record is taken out of every residual.

A model explains the samples if its error is at most FACTOR times that on the fitted samples, where records or rates
are left out, or else times the noise; or at most UNEXPLAINED times the error of a curve.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from scipy import special

from hysim._basics.frozen import FloatArray
from hysim._columns.turning import TOLERANCE, complete_cycles
from hysim.discovery._competitors import FLOOR, Rival, curve, means, plays, relaxations, trend
from hysim.errors import SimulationError
from hysim.identification import folds as blocks
from hysim.records import Record

LAW, RIVAL, RELAXATIONS, PLAYS, CURVE = "law", "rival", "relaxations", "plays", "curve"
_MEANS = "means"  # another curve; the better one counts
FACTOR = 2.0
UNEXPLAINED = 0.2

_FOLDS = 5
_START = 0.1  # share of each record that is never left out
_PARTS = 8  # of each record, for the t test
_DOUBT = 0.05  # probability of the t test below which a difference counts
_INSIDE = 0.05  # spans of the input by which left-out samples may reach beyond the others
SEVERAL = 1.5
"""Rates whose ratio is smaller count as one."""

_EDGES = np.linspace(0.05, 0.95, 10)  # of the bands, in spans of the input
_TAILS = (0.05, 0.95)

Samples = npt.NDArray[np.intp]


class Law(Protocol):
    """A model that is judged: an output at the samples of an input, without time."""

    def response(self, u: npt.ArrayLike, /) -> FloatArray: ...


Refit = Callable[[Sequence[Record], Sequence[FloatArray]], Sequence[Law]]
"""Laws, one for each record, fitted again where the weights (n_samples,) are not zero."""


Model = Callable[[FloatArray], FloatArray]
"""Outputs (n_samples,) at all samples, fitted again where the weights (n_samples,) are not zero."""


class Scores(NamedTuple):
    """Rmse of a model on held-out samples, on the fitted ones, and in parts of the held-out ones [unit of y]."""

    error: float = math.nan
    fitted: float = math.nan
    parts: FloatArray = np.empty(0)


@dataclass(frozen=True)
class Trial:
    """Scores of the law and its competitors by name, and what was left out at a time.

    `together` is the rmse of plays fitted to all samples, `noise` that of white noise, `stroke` the outputs' range.
    """

    scores: Mapping[str, Scores]
    together: float
    by: str
    noise: float
    stroke: float

    @property
    def errors(self) -> dict[str, float]:
        return {name: scores.error for name, scores in self.scores.items()}

    def explains(self, name: str) -> bool:
        """Whether a model predicts held-out samples nearly as well as fitted ones; plays may also be fitted to all."""
        own, curve = self.scores[name], self.scores[CURVE]
        usual = own.fitted if self.by in ("record", "rate") else self.noise
        error = min(own.error, self.together) if name == PLAYS else own.error
        return error <= max(FACTOR * usual, UNEXPLAINED * curve.error) + FLOOR * self.stroke

    def consistent(self, name: str, other: str) -> bool:
        """Whether a model is better than another in most parts: a t test of the logarithms of their rmse."""
        floor = FLOOR * self.stroke
        gains = np.log((self.scores[other].parts + floor) / (self.scores[name].parts + floor))
        if gains.size < 2:
            return True
        student = float(special.stdtrit(gains.size - 1, 1.0 - _DOUBT))
        return float(np.mean(gains)) * math.sqrt(gains.size) > student * float(np.std(gains, ddof=1))


def competitors_held_out(records: Sequence[Record], linear: Rival | None) -> Trial:
    """Fit the competitors again without some of the samples, and predict these; unknown errors are nan."""
    y = np.concatenate([record.y for record in records])
    by, left_out = _folds(records)
    models = _models(records, y, linear)
    scores = {name: _scores(model, records, left_out) for name, model in models.items()}
    other = scores.pop(_MEANS)
    if other.error < scores[CURVE].error:
        scores[CURVE] = other
    together = about_trends(y - models[PLAYS](np.ones(y.size)), records)
    ordered = dict.fromkeys((LAW, RIVAL, RELAXATIONS, PLAYS, CURVE), Scores()) | scores
    return Trial(ordered, rms(together), by, _noise(records), float(np.ptp(y)))


def law_held_out(trial: Trial, records: Sequence[Record], refit: Refit) -> Trial:
    """The trial with a law beside the competitors, fitted again without the same samples."""
    n_samples = sum(len(record) for record in records)

    def law(weights: FloatArray) -> FloatArray:
        try:
            laws = refit(records, _of_each(weights, records))
            return np.concatenate([law.response(record.u) for law, record in zip(laws, records, strict=True)])
        except (SimulationError, ValueError):
            return np.full(n_samples, math.inf)

    return replace(trial, scores={**trial.scores, LAW: _scores(law, records, _folds(records)[1])})


def _scores(model: Model, records: Sequence[Record], left_out: Sequence[Samples]) -> Scores:
    y = np.concatenate([record.y for record in records])
    residual, fitted = np.full(y.size, math.nan), []
    for samples in left_out:
        weights = np.ones(y.size)
        weights[samples] = 0.0
        remaining = y - model(weights)
        residual[samples] = remaining[samples]
        fitted.extend(about_trends(np.where(weights > 0.0, remaining, math.nan), records))
    detrended = about_trends(residual, records)
    parts = np.array([rms([part]) for part in _in_parts(detrended, records)])
    return Scores(rms(detrended), rms(fitted), parts)


def _models(records: Sequence[Record], y: FloatArray, linear: Rival | None) -> dict[str, Model]:
    u = np.concatenate([record.u for record in records])
    models: dict[str, Model] = {_MEANS: partial(means, u, y)}
    needed = {CURVE: curve, PLAYS: plays}
    if linear is not None:
        models[RIVAL] = lambda weights: np.concatenate(
            linear.refitted(records, _of_each(weights, records)).outputs(records)
        )
        needed[RELAXATIONS] = relaxations
    for name, made in needed.items():
        models[name] = partial(made(records).outputs, y)
    return models


def about_trends(residual: FloatArray, records: Sequence[Record]) -> list[FloatArray]:
    """Residual of each record about its own trend; nan where it is nan or has too few samples."""
    residuals = []
    for own, record in zip(_of_each(residual, records), records, strict=True):
        counts = ~np.isnan(own)
        slow = trend(record)[counts]
        if np.count_nonzero(counts) <= slow.shape[1]:
            own, counts = np.full(own.size, math.nan), np.zeros(own.size, dtype=bool)
        elif np.isfinite(own[counts]).all():
            own[counts] -= slow @ np.linalg.lstsq(slow, own[counts])[0]
        residuals.append(own)
    return residuals


def _in_parts(detrended: Sequence[FloatArray], records: Sequence[Record]) -> list[FloatArray]:
    pieces = [piece for residual in detrended for piece in np.array_split(residual, _PARTS)]
    return [piece[~np.isnan(piece)] for piece in pieces if np.count_nonzero(~np.isnan(piece)) > 1]


def _of_each(values: FloatArray, records: Sequence[Record]) -> list[FloatArray]:
    return np.split(values, np.cumsum([len(record) for record in records])[:-1])


def _folds(records: Sequence[Record]) -> tuple[str, list[Samples]]:
    lengths = [len(record) for record in records]
    begins = np.cumsum([0, *lengths])[:-1]
    counted = np.ones(sum(lengths), dtype=bool)
    for begin, length in zip(begins, lengths, strict=True):
        counted[begin : begin + math.ceil(_START * length)] = False
    by, parts = "record", [begin + np.arange(length) for begin, length in zip(begins, lengths, strict=True)]
    u = np.concatenate([record.u for record in records])
    if len(records) == 1:
        by, parts = _folds_of(records[0])
    elif not all(_covers(np.delete(u, samples), u[samples]) for samples in parts):
        by, parts = "block", blocks(min(2 * _FOLDS * len(records), u.size), u.size)
    groups = [np.unique(np.concatenate(parts[k::_FOLDS])) for k in range(min(_FOLDS, len(parts)))]
    left_out = [group[counted[group]] for group in groups if counted[group].any()]
    left_out = [samples for samples in left_out if _covers(np.delete(u, samples), u[samples])] or left_out
    inside = [samples[_is_inside(np.delete(u, samples), u[samples])] for samples in left_out]
    return by, [samples for samples in inside if samples.size] or left_out


def _folds_of(record: Record) -> tuple[str, list[Samples]]:
    parts = at_one_rate(record)
    if len(parts) > 1:
        return "rate", parts
    cycles = [np.arange(*cycle.path.indices(len(record))) for cycle in complete_cycles(record.u, TOLERANCE)[::-1]]
    return ("cycle", cycles) if len(cycles) > 2 else ("block", blocks(min(2 * _FOLDS, len(record)), len(record)))


def _covers(training: FloatArray, other: FloatArray) -> bool:
    beyond = _INSIDE * float(np.ptp(np.append(training, other)))
    return bool(other.min() >= training.min() - beyond and other.max() <= training.max() + beyond)


def _is_inside(training: FloatArray, other: FloatArray) -> npt.NDArray[np.bool_]:
    return np.asarray((other >= training.min()) & (other <= training.max()))


def _noise(records: Sequence[Record]) -> float:
    """Rms of white noise, from the third differences of the outputs: those of smooth outputs are small."""
    return rms([np.diff(record.y, 3) for record in records]) / math.sqrt(20.0)


def rms(parts: Sequence[FloatArray]) -> float:
    values = np.concatenate(parts) if parts else np.empty(0)
    counts = values[~np.isnan(values)]
    return float(np.sqrt(np.mean(counts**2))) if counts.size else math.nan


def rate_spread(records: Sequence[Record]) -> float:
    """How much the input's rate differs between passes at the same input; 1 for one rate, nan without time.

    The input's range has nine equal bands between 5 and 95 % of it. A branch that crosses one has there the rate band
    over time of crossing. In each band the 95th percentile of the rates is divided by the 5th, all records having the
    same weight; the median over the bands that two records cross, or else all, is taken.
    """
    if any(record.t is None for record in records):
        return math.nan
    low, high = min(record.u.min() for record in records), max(record.u.max() for record in records)
    crossed = [_crossings(record, low + (high - low) * _EDGES) for record in records]
    bands = list(zip(*crossed, strict=True))
    shared = [band for band in bands if sum(map(bool, band)) > 1]
    ratios = [ratio for band in shared or bands if (ratio := _ratio(band)) is not None]
    return float(np.median(ratios)) if ratios else math.nan


def at_one_rate(record: Record) -> list[Samples]:
    """Samples of the consecutive parts of a record whose cycles have one rate."""
    everything = np.arange(len(record))
    if record.t is None:
        return [everything]
    begins, rate = [], 0.0
    for cycle in reversed(complete_cycles(record.u, TOLERANCE)):
        here = 1.0 / float(np.ptp(record.t[cycle.path]))
        if rate == 0.0 or not 1.0 / SEVERAL < here / rate < SEVERAL:
            begins.append(cycle.path.start)
            rate = here
    return np.split(everything, begins[1:])


def _crossings(record: Record, edges: FloatArray) -> list[list[float]]:
    bands: list[list[float]] = [[] for _ in itertools.pairwise(edges)]
    for branch in record.branches(TOLERANCE):
        sign = 1.0 if branch.u[-1] > branch.u[0] else -1.0
        reached, first, count = np.unique(np.maximum.accumulate(sign * branch.u), return_index=True, return_counts=True)
        t = np.asarray(branch.t, dtype=float)
        times = 0.5 * (t[first] + t[first + count - 1])
        at_edges = np.interp(sign * edges, reached, times, left=math.nan, right=math.nan)
        for rates, height, duration in zip(bands, np.diff(edges), np.abs(np.diff(at_edges)), strict=True):
            if duration > 0.0:
                rates.append(float(height / duration))
    return bands


def _ratio(band: Sequence[list[float]]) -> float | None:
    """High over low rate of a band's passes, a list for each record; None for fewer than two passes."""
    rates = np.concatenate(band)
    if rates.size < 2:
        return None
    shares = np.concatenate([np.full(len(passes), 1.0 / max(len(passes), 1)) for passes in band])
    slow, fast = np.quantile(rates, _TAILS, weights=shares, method="inverted_cdf")
    return float(fast / slow)
