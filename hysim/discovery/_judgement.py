"""The verdict on records: hysteresis, a lag that looks like it, or neither.

Models of three kinds are fitted to the same records and judged on samples that were left out:

    still     a curve, or a line: no memory
    lagging   a linear plant of one or two poles, or relaxations: memory that depends on time
    turning   the law, or a superposition of plays: memory that depends on the order of the extremes only

The plays need no library: the verdict does not depend on whether it has a good law. Better means an rmse on held-out
samples below BETTER times the other's. A model explains the samples if its error is at most FACTOR times that on the
fitted samples, where records or rates are left out, else the noise; or at most UNEXPLAINED times a curve's.

1. Neither a lagging nor a turning model is better than the still ones: "no structure found".
2. One rate, or no time: "cannot be told from one rate".
3. Several rates. Of the models that explain the held-out samples: "linear lag" if a lagging one is better than all
   others, "rate-independent hysteresis" if a turning one is. Else "no structure found": hysteresis and lag, or noise.
4. If the law diverges in free run, on the records or on steady cycles over their range: "no structure found", unless
   the plays show at several rates that the records are hysteretic.

**The samples that are left out** of a fit at a time are a record, if there are several and none goes beyond the range
of the others; of one record a rate, if its cycles have several; else a cycle, if there are three; else a few blocks.
The start of each record is never left out, since it determines the initial state, and samples beyond the range of the
others do not count, unless all are. A slow trend of each record is taken out of every residual.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from hysim import metrics, signals
from hysim._basics.frozen import FloatArray, frozen
from hysim._columns.turning import TOLERANCE, complete_cycles
from hysim.discovery._competitors import FLOOR, Rival, curve, means, plays, relaxations, rival, steady_width, trend
from hysim.errors import SimulationError
from hysim.identification import errors_of_refits
from hysim.identification import folds as blocks
from hysim.metrics.criteria import rms_of_known
from hysim.models.protocols import Responding
from hysim.plants.transfer_function import TransferFunction
from hysim.records import Record, by_record

HYSTERESIS = "rate-independent hysteresis"
LAG = "linear lag"
ONE_RATE = "cannot be told from one rate"
NO_STRUCTURE = "no structure found"

LAW, RIVAL, RELAXATIONS, PLAYS, CURVE = "law", "rival", "relaxations", "plays", "curve"

RATES = (0.1, 1.0, 10.0)
BETTER = 0.9
FACTOR, UNEXPLAINED = 2.0, 0.2
LEAST = 1e-4
"""Strokes by which a memory must show: no measured input is known more exactly."""

_DOUBT = 0.05  # probability of the t test below which a difference counts
_THINNED = 1000  # samples of all records together, beyond which fewer are judged
_PER_BRANCH = 32  # samples of a typical branch that thinning leaves: a sine's extreme is then right to 1.2e-3
_FOLDS = 5
_START = 0.1  # share of each record that is never left out
_PARTS = 8  # of each record, for the t test
_INSIDE = 0.05  # spans of the input by which left-out samples may reach beyond the others
SEVERAL = 1.5
"""Rates whose ratio is smaller count as one."""

_EDGES = np.linspace(0.05, 0.95, 10)  # of the bands, in spans of the input
_ROUNDING = 1e-12  # of the outputs' range: smaller errors are those of the arithmetic
_TAILS = (0.05, 0.95)
_AMPLITUDES = (0.25, 0.5, 0.75, 1.0)
_CYCLES = 10

Samples = npt.NDArray[np.intp]

Model = Callable[[FloatArray], FloatArray]
"""Outputs (n_samples,) at all samples, fitted again where the weights (n_samples,) are not zero."""


class Scores(NamedTuple):
    """Rmse of a model on held-out samples, on the fitted ones, and in parts of the held-out ones [unit of y]."""

    error: float = math.nan
    fitted: float = math.nan
    parts: FloatArray = np.empty(0)


def scores_of(model: Model, records: Sequence[Record], y: FloatArray, left_out: Sequence[Samples]) -> Scores:
    """Fit a model again without each group of samples of the outputs `y`, and predict these."""
    fitted: list[FloatArray] = []

    def residual(weights: FloatArray) -> FloatArray:
        remaining = y - model(weights)
        fitted.extend(about_trends(np.where(weights > 0.0, remaining, math.nan), records))
        return remaining

    detrended = about_trends(errors_of_refits(residual, y.size, left_out), records)
    pieces = [piece for each in detrended for piece in np.array_split(each, _PARTS)]
    parts = [rms_of_known(piece) for piece in pieces if np.count_nonzero(~np.isnan(piece)) > 1]
    return Scores(rms_of_known(*detrended), rms_of_known(*fitted), np.array(parts))


def about_trends(residual: FloatArray, records: Sequence[Record]) -> list[FloatArray]:
    """Residual of each record about its own trend; nan where it is nan or has too few samples."""
    residuals = []
    for own, record in zip(by_record(residual, records), records, strict=True):
        counts = ~np.isnan(own)
        slow = trend(record)[counts]
        if np.count_nonzero(counts) <= slow.shape[1]:
            own, counts = np.full(own.size, math.nan), np.zeros(own.size, dtype=bool)
        elif np.isfinite(own[counts]).all():
            own[counts] -= slow @ np.linalg.lstsq(slow, own[counts])[0]
        residuals.append(own)
    return residuals


def folds(records: Sequence[Record]) -> tuple[str, list[Samples]]:
    u = np.concatenate([record.u for record in records])
    by, parts = "record", by_record(np.arange(u.size), records)
    counted = np.ones(u.size, dtype=bool)
    for samples in parts:
        counted[samples[: math.ceil(_START * samples.size)]] = False
    if len(records) == 1:
        by, parts = _folds_of(records[0])
    elif not all(_inside(u, samples, _INSIDE).all() for samples in parts):
        by, parts = "block", blocks(min(2 * _FOLDS * len(records), u.size), u.size)
    groups = [np.unique(np.concatenate(parts[k::_FOLDS])) for k in range(min(_FOLDS, len(parts)))]
    left_out = [group[counted[group]] for group in groups if counted[group].any()]
    left_out = [samples for samples in left_out if _inside(u, samples, _INSIDE).all()] or left_out
    inside = [samples[_inside(u, samples)] for samples in left_out]
    return by, [samples for samples in inside if samples.size] or left_out


def _folds_of(record: Record) -> tuple[str, list[Samples]]:
    parts = at_one_rate(record)
    if len(parts) > 1:
        return "rate", parts
    cycles = [np.arange(*cycle.path.indices(len(record))) for cycle in complete_cycles(record.u, TOLERANCE)[::-1]]
    if len(cycles) > 2 and 2 * sum(cycle.size for cycle in cycles) > len(record):  # of a fading motion few are complete
        return "cycle", cycles
    return "block", blocks(min(2 * _FOLDS, len(record)), len(record))


def _inside(u: FloatArray, samples: Samples, slack: float = 0.0) -> npt.NDArray[np.bool_]:
    """Whether each of the samples of an input is within the range of the others, or nearly so."""
    others, beyond = np.delete(u, samples), slack * float(np.ptp(u))
    return np.asarray((u[samples] >= others.min() - beyond) & (u[samples] <= others.max() + beyond))


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
    ratios = [_ratio(band) for band in shared or bands if sum(map(len, band)) > 1]
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
    bands: list[list[float]] = [[] for _ in edges[1:]]
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


def _ratio(band: Sequence[list[float]]) -> float:
    """High over low rate of a band's passes, a list for each record."""
    shares = np.concatenate([np.full(len(passes), 1.0 / max(len(passes), 1)) for passes in band])
    slow, fast = np.quantile(np.concatenate(band), _TAILS, weights=shares, method="inverted_cdf")
    return float(fast / slow)


@frozen
class Judgement:
    """The verdict on records, and the errors and loops on which it rests.

    Parameters
    ----------
    verdict : str
        ``"rate-independent hysteresis"``, ``"linear lag"``, ``"cannot be told from one rate"`` or
        ``"no structure found"``.
    rival : TransferFunction or None
        Linear plant fitted to the same records, with the initial state of the longest one; of degree 0 where a line
        does as well, None where a record has no time.
    rival_offset : float
        Offset of its output [unit of y].
    held_out : mapping
        Rmse on samples that were left out of the fit, about a slow trend of each record [unit of y]: ``"law"``;
        ``"rival"``, the linear plant; ``"relaxations"``, linear creep; ``"curve"``, a function of the input alone;
        ``"plays"``, a superposition of functions of plays. Without time nan for the linear ones.
    held_out_by : str
        What was left out at a time: ``"record"``, ``"rate"``, ``"cycle"`` or ``"block"``.
    rates : array, shape (3,)
        Multiples of the rate of the longest record.
    widths : mapping
        ``"law"`` and ``"rival"`` to the relative widths of their loops at these rates, along that record's last and
        first complete cycle; nan where it has none.
    dissipation : float
        Signed area of the law's steady loop over the range of the input [unit of y times unit of u], positive where
        it runs counterclockwise, as a piezoelectric actuator's does.
    one_sign : bool
        Whether no smaller loop (a quarter, a half, three quarters of that range) has an area of the other sign.
    rate_spread : float
        How much the rate of the input differs between passes at the same input, from 1; nan without time.
    stable : bool
        Whether the law's free run stays finite, on the records and on steady cycles over their range.
    explained_by : tuple of str
        Names of the models in `held_out` that predict the held-out samples nearly as well as the fitted ones.
    """

    verdict: str
    rival: TransferFunction | None
    rival_offset: float
    held_out: Mapping[str, float]
    held_out_by: str
    rates: FloatArray
    widths: Mapping[str, tuple[float, ...]]
    dissipation: float
    one_sign: bool
    rate_spread: float
    stable: bool = True
    explained_by: tuple[str, ...] = ()


Refit = Callable[[Sequence[Record], Sequence[FloatArray]], Sequence[Responding]]
"""Laws, one for each record, fitted again where the weights (n_samples,) are not zero."""


@dataclass(frozen=True)
class Trial:
    """Records, the linear plant nearest to them, and the scores of models on samples that were left out.

    `spread` is the `rate_spread`, `left_out` are the samples of each fold `by` which they are left out, and `together`
    is the rmse of plays fitted to all samples.
    """

    records: Sequence[Record]
    linear: Rival | None
    spread: float
    by: str
    left_out: Sequence[Samples]
    scores: Mapping[str, Scores]
    together: float

    @property
    def errors(self) -> dict[str, float]:
        return {name: scores.error for name, scores in self.scores.items()}

    @cached_property
    def floor(self) -> float:
        return FLOOR * float(np.ptp(np.concatenate([record.y for record in self.records])))

    def explains(self, name: str) -> bool:
        """Whether a model predicts held-out samples nearly as well as fitted ones; plays may also be fitted to all."""
        own, curve = self.scores[name], self.scores[CURVE]
        # third differences show white noise: those of smooth outputs are small
        noise = rms_of_known(*(np.diff(record.y, 3) for record in self.records)) / math.sqrt(20.0)
        usual = own.fitted if self.by in ("record", "rate") else noise
        error = min(own.error, self.together) if name == PLAYS else own.error
        return error <= max(FACTOR * usual, UNEXPLAINED * curve.error) + self.floor

    def consistent(self, name: str, other: str) -> bool:
        """Whether a model is better than another in most parts: a t test of the logarithms of their rmse."""
        gains = np.log((self.scores[other].parts + self.floor) / (self.scores[name].parts + self.floor))
        if gains.size < 2:
            return True
        student = float(special.stdtrit(gains.size - 1, 1.0 - _DOUBT))
        return float(np.mean(gains)) * math.sqrt(gains.size) > student * float(np.std(gains, ddof=1))

    def least(self, names: Sequence[str]) -> float:
        errors = (self.errors[name] + self.floor for name in names)
        return min((error for error in errors if not math.isnan(error)), default=math.inf)

    @property
    def lagging(self) -> list[str]:
        return [RELAXATIONS, *[RIVAL] * (self.linear is None or not self.linear.is_line)]

    def still(self, single_valued: bool = False) -> float:
        """Error of the best model without memory; the law is one if it is `single_valued`."""
        straight = self.linear is not None and self.linear.is_line
        return self.least([CURVE, *[RIVAL] * straight, *[LAW] * single_valued])

    def verdict(self, single_valued: bool = False) -> str:
        still, turning = self.still(single_valued), [PLAYS, *[LAW] * (not single_valued)]
        moving = min([*self.lagging, *turning], key=lambda name: self.least([name]))
        if still <= LEAST / FLOOR * self.floor or self.least([moving]) >= BETTER * still:
            return NO_STRUCTURE
        if not self.consistent(moving, CURVE):
            return NO_STRUCTURE
        if not self.spread >= SEVERAL:
            return ONE_RATE
        lag, turn = self.least(self.lagging), self.least(turning)
        if self.least([name for name in self.lagging if self.explains(name)]) < BETTER * min(turn, still):
            return LAG
        explained = self.least([name for name in turning if self.explains(name)])
        return HYSTERESIS if explained < BETTER * min(lag, still) else NO_STRUCTURE

    @property
    def enough(self) -> float:
        """Rmse below which a law could change the verdict [unit of y]; inf if any law could."""
        least = {NO_STRUCTURE: BETTER * self.still(), LAG: self.least(self.lagging) / BETTER}
        return least.get(self.verdict(), math.inf)


def competitors(records: Sequence[Record]) -> Trial:
    """The trial of the models that need no law; errors of a law, and without time of linear plants, are nan."""
    timed, spread = all(record.t is not None for record in records), rate_spread(records)
    records = _thinned([_even(record) for record in records] if timed else records)
    u, y = np.concatenate([record.u for record in records]), np.concatenate([record.y for record in records])
    linear = rival(records) if timed else None
    by_plays = partial(plays(records).outputs, y)
    models: dict[str, Model] = {CURVE: partial(curve(records).outputs, y), PLAYS: by_plays}
    if linear is not None:
        models[RELAXATIONS] = partial(relaxations(records).outputs, y)
        models[RIVAL] = lambda weights: np.concatenate(
            linear.refitted(records, by_record(weights, records)).outputs(records)
        )
    by, left_out = folds(records)
    scores = dict.fromkeys((LAW, RIVAL, RELAXATIONS, PLAYS, CURVE), Scores())
    scores |= {name: scores_of(model, records, y, left_out) for name, model in models.items()}
    steps = scores_of(partial(means, u, y), records, y, left_out)  # another curve; the better one counts
    scores[CURVE] = min(scores[CURVE], steps, key=lambda each: each.error)
    together = rms_of_known(*about_trends(y - by_plays(np.ones(y.size)), records))
    return Trial(records, linear, spread, by, left_out, scores, together)


def judge(others: Trial, laws: Sequence[Responding], refit: Refit) -> Judgement:
    """Judge laws, one for each record; `refit(records, weights)` fits where the weights (n_samples,) are not zero."""
    records, linear = others.records, others.linear
    y = np.concatenate([record.y for record in records])

    def fitted(weights: FloatArray) -> FloatArray:
        try:
            again = refit(records, by_record(weights, records))
            return np.concatenate([law.response(record.u) for law, record in zip(again, records, strict=True)])
        except (SimulationError, ValueError):
            return np.full(y.size, math.inf)

    trial = replace(others, scores={**others.scores, LAW: scores_of(fitted, records, y, others.left_out)})
    longest = max(range(len(records)), key=lambda k: len(records[k]))
    law, record = laws[longest], records[longest]
    loops, outputs = _loops(law, record.u), [_response(law, r.u) for law, r in zip(laws, records, strict=True)]
    areas = np.array([math.nan if loop is None else signed_area(loop) for loop in loops])
    stable = all(output is not None for output in outputs) and loops[-1] is not None
    verdict = trial.verdict(all(loop is not None and loop.relative_width < LEAST for loop in loops))
    own, width, of_rival = outputs[longest], math.nan, (math.nan,) * len(RATES)
    cycles = complete_cycles(record.u, TOLERANCE)  # between the extremes: one about a level is no steady cycle
    if cycles and own is not None:
        width = metrics.loop_metrics(record.u, own).relative_width
    if cycles and linear is not None:
        of_rival = tuple(steady_width(linear.plants[longest], record[cycles[0].path], rate) for rate in RATES)
    return Judgement(
        verdict=verdict if stable or verdict == HYSTERESIS else NO_STRUCTURE,
        rival=None if linear is None else linear.plants[longest],
        rival_offset=math.nan if linear is None else linear.offset,
        held_out={name: 0.0 if error < _ROUNDING * np.ptp(y) else error for name, error in trial.errors.items()},
        held_out_by=trial.by,
        rates=np.array(RATES),
        widths={"law": (width,) * len(RATES), "rival": of_rival},
        dissipation=float(areas[-1]),
        one_sign=bool((areas * areas[-1] >= 0.0).all()),
        rate_spread=trial.spread,
        stable=stable,
        explained_by=tuple(name for name in trial.errors if trial.explains(name)),
    )


def _response(law: Responding, u: FloatArray) -> FloatArray | None:
    try:
        return law.response(u)
    except SimulationError:
        return None


def _loops(law: Responding, u: FloatArray) -> list[metrics.LoopMetrics | None]:
    middle, reach = 0.5 * (u.max() + u.min()), 0.5 * float(np.ptp(u))
    loops: list[metrics.LoopMetrics | None] = []
    for share in _AMPLITUDES:
        cycles = signals.triangle(middle - share * reach, middle + share * reach, cycles=_CYCLES, samples_per_cycle=64)
        y = _response(law, np.append(u[0], cycles))
        loops.append(None if y is None else metrics.loop_metrics(cycles, y[1:]))
    return loops


def signed_area(loop: metrics.LoopMetrics) -> float:
    """Area of a loop, negative where it runs clockwise."""
    return {"counterclockwise": loop.area, "clockwise": -loop.area, "none": 0.0}[loop.orientation]


def _even(record: Record) -> Record:
    steps = np.diff(np.asarray(record.t, dtype=float))
    return record if np.ptp(steps) <= 1e-6 * steps.mean() else record.resample(float(steps.mean()))


def _thinned(records: Sequence[Record]) -> list[Record]:
    branches = np.concatenate([[len(branch) for branch in record.branches(TOLERANCE)] for record in records])
    total = sum(len(record) for record in records)
    stride = max(1, min(total // _THINNED, int(np.median(branches)) // _PER_BRANCH if branches.size else 1))
    return [record[::stride] for record in records]


def doubts(judgement: Judgement) -> tuple[str, ...]:
    errors = judgement.held_out
    law, plays, curve = errors[LAW], errors[PLAYS], errors[CURVE]
    linear = min((errors[name] for name in (RIVAL, RELAXATIONS) if not math.isnan(errors[name])), default=math.inf)
    sentences = []
    if not judgement.stable:
        sentences.append(
            "The law diverges in free run, on the records or on steady cycles over their range: do not simulate "
            "with it."
        )
    if linear < BETTER * law:
        rmse = f"rmse {linear:.3g} against {law:.3g}"
        sentences.append(f"A linear dynamic model predicts held-out samples better than the law ({rmse}).")
    if judgement.verdict == HYSTERESIS and plays < BETTER * law:
        sentences.append(
            f"The law describes the hysteresis only in part: its rmse on held-out samples is {law:.3g}, that of a "
            f"superposition of plays {plays:.3g}. Identify hs.PrandtlIshlinskii or hs.Preisach too."
        )
    if judgement.verdict == NO_STRUCTURE and judgement.stable:
        sentences.append(_no_structure(judgement, min(law, plays), linear, curve))
    return tuple(sentences)


def _no_structure(judgement: Judgement, turning: float, linear: float, curve: float) -> str:
    alike = min(turning, linear) >= BETTER * curve
    if alike or (linear >= BETTER * curve and CURVE in judgement.explained_by) or not judgement.rate_spread >= SEVERAL:
        how, then = ("as well as", ":") if alike else ("less well than", ", but")
        return (
            f"A single-valued curve of the input predicts held-out samples {how} a model with memory (rmse "
            f"{curve:.3g} against {min(turning, linear):.3g}){then} the records show no loop that is wider than their "
            "noise, or too few cycles to predict one that is left out."
        )
    if set(judgement.explained_by) <= {CURVE}:
        return (
            "No model predicts held-out samples well: the memory may be hysteresis followed by a lag, or a lag "
            "behind a curve. Identify the law and the dynamics together, for instance as hs.Actuator."
        )
    return (
        f"Models that depend on time and models that do not predict held-out samples about equally well (rmse "
        f"{linear:.3g} and {turning:.3g}): noise hides the effect of the rate. Record more cycles, or rates further "
        "apart, with less noise."
    )
