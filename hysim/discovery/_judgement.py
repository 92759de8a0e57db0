"""Is a discovered law hysteresis, or a lag that looks like it?

Hysteresis is the part of memory that does not know time. A law without time and a linear plant with dynamics are fitted
to the same records and judged on samples that both have not seen; under several rates one of them fails. Under one
rate both may run well, and nothing can be said: a lag under a triangle is there a function of u, y and direction.

The verdict, where better means an rmse on held-out samples below BETTER times the other's:

1. "unstable": the law's free run leaves the finite numbers, on the records or on steady cycles over their range.
2. One rate, or no time: "cannot be told from one rate" if the law has memory or a plant with dynamics is better than
   it, else "no structure found".
3. Several rates. "no structure found" if neither predicts well enough what it has not seen (`_held_out`). This is
   memory that is neither, such as hysteresis followed by a lag. Else "linear lag" if the rival is better and has
   dynamics; "no structure found" if a single-valued law or a line does as well as the law; "rate-independent
   hysteresis" if the law is better than the rival. Where they do equally well, noise hides what the rates could
   tell: "cannot be told from one rate".
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from hysim import metrics, signals
from hysim._cycles import TOLERANCE, complete_cycles
from hysim._frozen import FloatArray, frozen
from hysim.discovery._held_out import Law, Refit, Trial, held_out
from hysim.discovery._rates import SEVERAL, rate_spread
from hysim.discovery._rival import Rival, rival, steady_width
from hysim.errors import SimulationError
from hysim.models.transfer_function import TransferFunction
from hysim.records import Record

HYSTERESIS = "rate-independent hysteresis"
LAG = "linear lag"
ONE_RATE = "cannot be told from one rate"
UNSTABLE = "unstable"
NO_STRUCTURE = "no structure found"

RATES = (0.1, 1.0, 10.0)
BETTER = 0.9

_THINNED = 1000  # samples of all records together, beyond which fewer are judged
_PER_BRANCH = 32  # samples of a typical branch that thinning leaves: a sine's extreme is then right to 1.2e-3
_AMPLITUDES = (0.25, 0.5, 0.75, 1.0)
_CYCLES = 10


@frozen
class Judgement:
    """What a law is, beside a linear plant.

    Parameters
    ----------
    verdict : str
        ``"rate-independent hysteresis"``, ``"linear lag"``, ``"cannot be told from one rate"``, ``"unstable"`` or
        ``"no structure found"``.
    rival : TransferFunction or None
        The linear plant fitted to the same records, with the initial state of the longest one; of degree 0 where a
        line does as well. None where a record has no time.
    rival_offset : float
        What is added to its output [unit of y].
    held_out : mapping
        ``"law"`` and ``"rival"`` to the rmse on samples that were left out of the fit [unit of y].
    held_out_by : str
        What was left out at a time: ``"record"``, ``"rate"``, ``"cycle"`` or ``"block"``.
    rates : array, shape (3,)
        Multiples of the rate of the longest record, the one with most samples; of equals the first.
    widths : mapping
        ``"law"`` and ``"rival"`` to the relative widths of the loop at these rates: the last complete cycle of the
        law's free run along that record, the steady loop of the rival. nan where the record has no complete cycle.
    dissipation : float
        Signed area of the law's steady loop over the range of the input [unit of y times unit of u]: positive
        counterclockwise, as a piezoelectric actuator's is, negative for a plain spring force.
    one_sign : bool
        Whether loops of a quarter, a half and three quarters of that range have areas of that sign too, or none.
    rate_spread : float
        How much the rate of the input differs between passes at the same input, from 1; nan without time.
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


def judge(records: Sequence[Record], laws: Sequence[Law], refit: Refit, *, single_valued: bool) -> Judgement:
    """Judge a law that was fitted to records beside a linear plant.

    Parameters
    ----------
    records : sequence of Record
        What the law was fitted to. Of long ones fewer samples are judged. Uneven times are made even by straight
        lines.
    laws : sequence of Law
        The law, once for each record: all is shared but the memory at the first sample.
    refit : callable
        ``refit(records, weights)`` gives such laws, fitted to the samples whose weights are not zero.
    single_valued : bool
        Whether the law is a curve without memory.

    Returns
    -------
    Judgement

    Examples
    --------
    >>> import hysim as hs
    >>> from hysim.discovery._judgement import judge
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    >>> law = hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0})
    >>> rec = hs.Record(u=u, y=law.response(u))
    >>> judge([rec], [law], lambda recs, weights: [law], single_valued=False).verdict
    'cannot be told from one rate'
    """
    timed = all(record.t is not None for record in records)
    spread = rate_spread(records)
    records = _thinned([_even(record) for record in records] if timed else records)
    linear = rival(records) if timed else None
    trial = held_out(records, refit, linear)
    longest = max(range(len(records)), key=lambda k: len(records[k]))
    areas = _areas(laws[longest], records[longest].u)
    stable = all(_response(law, record) is not None for law, record in zip(laws, records, strict=True))
    return Judgement(
        verdict=_verdict(trial, linear, single_valued, spread) if stable and math.isfinite(areas[-1]) else UNSTABLE,
        rival=None if linear is None else linear.plants[longest],
        rival_offset=math.nan if linear is None else linear.offset,
        held_out={"law": trial.law, "rival": trial.rival},
        held_out_by=trial.by,
        rates=np.array(RATES),
        widths={
            "law": (_width(laws[longest], records[longest]),) * len(RATES),
            "rival": _rival_widths(linear, longest, records[longest]),
        },
        dissipation=float(areas[-1]),
        one_sign=bool((areas * areas[-1] >= 0.0).all()),
        rate_spread=spread,
    )


def _verdict(trial: Trial, linear: Rival | None, single_valued: bool, spread: float) -> str:
    law, other = trial.law + trial.floor, trial.rival + trial.floor
    lagging = linear is not None and not linear.is_line and other < BETTER * law
    if not spread >= SEVERAL:
        return ONE_RATE if lagging or not single_valued else NO_STRUCTURE
    if min(law, other) > trial.enough:
        return NO_STRUCTURE
    if lagging:
        return LAG
    if single_valued or other < BETTER * law:
        return NO_STRUCTURE
    return HYSTERESIS if law < BETTER * other else ONE_RATE


def _response(law: Law, record: Record) -> FloatArray | None:
    try:
        return law.response(record.u)
    except SimulationError:
        return None


def _width(law: Law, record: Record) -> float:
    """Relative width of the last complete cycle; nan where there is none."""
    y = _response(law, record)
    if y is None or not complete_cycles(record.u, TOLERANCE):
        return math.nan
    return metrics.loop_metrics(record.u, y).relative_width


def _rival_widths(linear: Rival | None, k: int, record: Record) -> tuple[float, ...]:
    cycles = complete_cycles(record.u, TOLERANCE)  # between the extremes: one about a level is no steady cycle
    if linear is None or not cycles:
        return (math.nan,) * len(RATES)
    return tuple(steady_width(linear.plants[k], record[cycles[0].path], rate) for rate in RATES)


def _areas(law: Law, u: FloatArray) -> FloatArray:
    """Signed areas of steady loops of a quarter of the input's range to all of it, around its middle."""
    middle, reach = 0.5 * (u.max() + u.min()), 0.5 * float(np.ptp(u))
    areas = np.full(len(_AMPLITUDES), math.nan)
    for k, share in enumerate(_AMPLITUDES):
        cycles = signals.triangle(middle - share * reach, middle + share * reach, cycles=_CYCLES, samples_per_cycle=64)
        path = np.append(u[0], cycles)
        try:
            y = law.response(path)[1:]
        except SimulationError:
            continue
        loop = metrics.loop_metrics(cycles, y)
        areas[k] = {"counterclockwise": loop.area, "clockwise": -loop.area, "none": 0.0}[loop.orientation]
    return areas


def _even(record: Record) -> Record:
    """The record at even times, as many as it has."""
    steps = np.diff(np.asarray(record.t, dtype=float))
    return record if np.ptp(steps) <= 1e-6 * steps.mean() else record.resample(float(steps.mean()))


def _thinned(records: Sequence[Record]) -> list[Record]:
    """Every m-th sample of each record, where all together have many and the branches stay well sampled."""
    branches = np.concatenate([[len(branch) for branch in record.branches(TOLERANCE)] for record in records])
    total = sum(len(record) for record in records)
    stride = max(1, min(total // _THINNED, int(np.median(branches)) // _PER_BRANCH if branches.size else 1))
    return [record[::stride] for record in records]
