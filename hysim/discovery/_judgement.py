"""The verdict on records: hysteresis, a lag that looks like it, or neither.

Models of three kinds are fitted to the same records and judged on samples that were left out (`_held_out`):

    still     a curve, or a line: no memory
    lagging   a linear plant of one or two poles, or relaxations: memory that depends on time
    turning   the law, or a superposition of plays: memory that depends on the order of the extremes only

The plays need no library: the verdict does not depend on whether the library has a good law. Better means an rmse on
held-out samples below BETTER times the other's.

1. Neither a lagging nor a turning model is better than the still ones: "no structure found".
2. One rate, or no time: "cannot be told from one rate".
3. Several rates. Of the models that explain the held-out samples: "linear lag" if a lagging one is better than all
   others, "rate-independent hysteresis" if a turning one is. Else "no structure found": hysteresis followed by a lag,
   or noise.
4. If the law diverges in free run, on the records or on steady cycles over their range: "no structure found", unless
   the plays show at several rates that the records are hysteretic.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hysim import metrics, signals
from hysim._basics.frozen import FloatArray, frozen
from hysim._columns.turning import TOLERANCE, complete_cycles
from hysim.discovery import _held_out as held_out
from hysim.discovery._competitors import FLOOR, Rival, rival, steady_width
from hysim.discovery._held_out import CURVE, LAW, PLAYS, RELAXATIONS, RIVAL, SEVERAL, Law, Refit, Trial
from hysim.errors import SimulationError
from hysim.plants.transfer_function import TransferFunction
from hysim.records import Record

HYSTERESIS = "rate-independent hysteresis"
LAG = "linear lag"
ONE_RATE = "cannot be told from one rate"
NO_STRUCTURE = "no structure found"

RATES = (0.1, 1.0, 10.0)
BETTER = 0.9
LEAST = 1e-4
"""Strokes by which a memory must show: no measured input is known more exactly."""

_THINNED = 1000  # samples of all records together, beyond which fewer are judged
_PER_BRANCH = 32  # samples of a typical branch that thinning leaves: a sine's extreme is then right to 1.2e-3
_AMPLITUDES = (0.25, 0.5, 0.75, 1.0)
_CYCLES = 10


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


@dataclass(frozen=True)
class Competitors:
    """Models that need no law, fitted to records with even times; `spread` is their `rate_spread`."""

    records: Sequence[Record]
    linear: Rival | None
    trial: Trial
    spread: float

    @property
    def enough(self) -> float:
        """Rmse below which a law could change the verdict [unit of y]; inf if any law could."""
        verdict = _verdict(self.trial, self.linear, single_valued=False, spread=self.spread)
        if verdict == NO_STRUCTURE:
            return BETTER * _still(self.trial, self.linear)
        if verdict == LAG:
            return _least(self.trial, _lagging(self.linear)) / BETTER
        return math.inf


def competitors(records: Sequence[Record]) -> Competitors:
    timed = all(record.t is not None for record in records)
    spread = held_out.rate_spread(records)
    records = _thinned([_even(record) for record in records] if timed else records)
    linear = rival(records) if timed else None
    return Competitors(records, linear, held_out.competitors_held_out(records, linear), spread)


def judge(records: Sequence[Record], laws: Sequence[Law], refit: Refit, others: Competitors | None = None) -> Judgement:
    """Judge laws fitted to records, one for each; `refit(records, weights)` fits where the weights are not zero."""
    others = others or competitors(records)
    records, linear, spread = others.records, others.linear, others.spread
    trial = held_out.law_held_out(others.trial, records, refit)
    longest = max(range(len(records)), key=lambda k: len(records[k]))
    loops = _loops(laws[longest], records[longest].u)
    areas = np.array([math.nan if loop is None else signed_area(loop) for loop in loops])
    stable = all(_response(law, record.u) is not None for law, record in zip(laws, records, strict=True))
    stable = stable and loops[-1] is not None
    single_valued = all(loop is not None and loop.relative_width < LEAST for loop in loops)
    verdict = _verdict(trial, linear, single_valued, spread)
    return Judgement(
        verdict=verdict if stable or verdict == HYSTERESIS else NO_STRUCTURE,
        rival=None if linear is None else linear.plants[longest],
        rival_offset=math.nan if linear is None else linear.offset,
        held_out=trial.errors,
        held_out_by=trial.by,
        rates=np.array(RATES),
        widths={
            "law": (_width(laws[longest], records[longest]),) * len(RATES),
            "rival": _rival_widths(linear, longest, records[longest]),
        },
        dissipation=float(areas[-1]),
        one_sign=bool((areas * areas[-1] >= 0.0).all()),
        rate_spread=spread,
        stable=stable,
        explained_by=tuple(name for name in trial.errors if trial.explains(name)),
    )


def _verdict(trial: Trial, linear: Rival | None, single_valued: bool, spread: float) -> str:
    still, lagging = _still(trial, linear, single_valued), _lagging(linear)
    turning = [PLAYS, *[LAW] * (not single_valued)]
    moving = min([*lagging, *turning], key=lambda name: _least(trial, [name]))
    if still <= LEAST * trial.stroke or _least(trial, [moving]) >= BETTER * still:
        return NO_STRUCTURE
    if not trial.consistent(moving, CURVE):
        return NO_STRUCTURE
    if not spread >= SEVERAL:
        return ONE_RATE
    lag, turn = _least(trial, lagging), _least(trial, turning)
    if _least(trial, [name for name in lagging if trial.explains(name)]) < BETTER * min(turn, still):
        return LAG
    explained = _least(trial, [name for name in turning if trial.explains(name)])
    return HYSTERESIS if explained < BETTER * min(lag, still) else NO_STRUCTURE


def _still(trial: Trial, linear: Rival | None, single_valued: bool = False) -> float:
    """Error of the best model without memory; the law is one if it is `single_valued`."""
    straight = linear is not None and linear.is_line
    return _least(trial, [CURVE, *[RIVAL] * straight, *[LAW] * single_valued])


def _lagging(linear: Rival | None) -> list[str]:
    straight = linear is not None and linear.is_line
    return [RELAXATIONS, *[RIVAL] * (not straight)]


def _least(trial: Trial, names: Sequence[str]) -> float:
    errors = (trial.errors[name] + FLOOR * trial.stroke for name in names)
    return min((error for error in errors if not math.isnan(error)), default=math.inf)


def _response(law: Law, u: FloatArray) -> FloatArray | None:
    try:
        return law.response(u)
    except SimulationError:
        return None


def _width(law: Law, record: Record) -> float:
    y = _response(law, record.u)
    if y is None or not complete_cycles(record.u, TOLERANCE):
        return math.nan
    return metrics.loop_metrics(record.u, y).relative_width


def _rival_widths(linear: Rival | None, k: int, record: Record) -> tuple[float, ...]:
    cycles = complete_cycles(record.u, TOLERANCE)  # between the extremes: one about a level is no steady cycle
    if linear is None or not cycles:
        return (math.nan,) * len(RATES)
    return tuple(steady_width(linear.plants[k], record[cycles[0].path], rate) for rate in RATES)


def _loops(law: Law, u: FloatArray) -> list[metrics.LoopMetrics | None]:
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
        sentences.append(
            f"A linear dynamic model predicts held-out samples better than the law (rmse {linear:.3g} against "
            f"{law:.3g})."
        )
    if judgement.verdict == HYSTERESIS and plays < BETTER * law:
        sentences.append(
            f"The law describes the hysteresis only in part: its rmse on held-out samples is {law:.3g}, that of a "
            f"superposition of plays {plays:.3g}. Identify hs.PrandtlIshlinskii or hs.Preisach too."
        )
    if judgement.verdict == NO_STRUCTURE and judgement.stable:
        sentences.append(_no_structure(judgement, min(law, plays), linear, curve))
    return tuple(sentences)


def _no_structure(judgement: Judgement, turning: float, linear: float, curve: float) -> str:
    alike = min(turning, linear) >= BETTER * curve or (linear >= BETTER * curve and CURVE in judgement.explained_by)
    if alike or not judgement.rate_spread >= SEVERAL:
        return (
            f"A single-valued curve of the input predicts held-out samples as well as a model with memory (rmse "
            f"{curve:.3g} against {min(turning, linear):.3g}): the records show no loop that is wider than their noise."
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
