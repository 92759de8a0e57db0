"""More samples of the wanted output on a branch: the inverse ends at the same input, and the law then has this output.

The laws are those of `hostile_laws` with an output that is monotone on the stride: beside a memory the input's own
slope is 1.05 to 30 times as steep as the memory is anywhere there. What an output may be off by, over the slope there,
is what an input may be off by.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from hostile_laws import DRAWS, Rng, decades, memory, signed
from more_samples import (
    LAST_SUM,
    NEAREST,
    NOTHING,
    PEAK_PIECES,
    PEAK_ROUNDS,
    ROUNDINGS,
    UNIT,
    WELL_INSIDE,
    Array,
    Case,
    Spread,
    Verdict,
    draw_case,
    perturbed,
    pieces,
    places,
    promised,
    size,
    spread,
    spread_through_peaks,
    worst,
)

import hysim as hs

SOLVED = 64.0
"""Roundings of the terms of an output that the searches leave: 32 in `BoucWenInverse`, fewer in the others."""
NEAR = 10.0 ** np.arange(-14.0, -5.0)  # parts of the first input, or of one, at which it may turn
SEEN = 3  # of them beyond roundings
FAR = 0.125  # of its range: a memory that moves further between two samples is looked at between them
PLAYS = ("PrandtlIshlinskii", "ModifiedPrandtlIshlinskii", "GeneralizedPrandtlIshlinskii", "Preisach")
TIMED = "RateDependentPrandtlIshlinskii"
STEPPED = ("BoucWen", "PolynomialBoucWen", "Dahl", "ColemanHodgdon", "PrandtlIshlinskii")
INVERTED = (
    "BoucWen", "PolynomialBoucWen", "ZhuWangBoucWen", "GeneralizedBoucWen", "BoucWenBaberNoori", "Duhem", "Dahl",
    "ColemanHodgdon", "JilesAtherton", *PLAYS, TIMED, "Sum", "Cascade",
)  # fmt: skip


class Wanted(NamedTuple):
    """A law, the input before, the output there, wanted outputs on a branch, the places of those that all runs have."""

    law: Any
    u0: float
    y0: float
    y: Array
    kept: Array
    slope: float  # the lowest, or zero for that of the memory at each sample


def wanted_case(family: str, rng: Rng) -> Wanted:
    """A law whose output is monotone on a stride, and outputs between those at its ends."""
    while True:
        case, slope = monotone_case(family, rng)
        if case is None:
            continue
        law, u0 = case.law, float(case.before[0])
        ends = forward(law, u0, case.u[-1:])
        y0, y1 = float(forward(law, u0, case.before)[-1]), float(ends[-1])
        if not np.isfinite(y1):
            continue
        y = pieces(rng, y0, y1)
        kept = np.union1d(np.flatnonzero(rng.random(y.size) < 0.4), [y.size - 1])
        return Wanted(law, u0, y0, y, kept, slope)


def monotone_case(family: str, rng: Rng) -> tuple[Case | None, float]:
    """A case of a law with an inverse on its stride, or none; and the lowest slope, if it is known."""
    if family in ("Sum", "Cascade"):
        return of_two(family, rng)
    case = draw_case(family, rng, invertible=True) if family in (*PLAYS, TIMED) else draw_case(family, rng)
    case = case._replace(before=case.before[:1], u=pieces(rng, case.before[0], case.before[0] + stride_of(case)))
    if family in (*PLAYS, TIMED):
        return (case, lowest_slope(case.law)) if inside(case) else (None, 0.0)
    if family == "JilesAtherton":
        return case, abs(case.law.feedthrough)
    if family == "Dahl":
        law = replace(case.law, z0=0.5 * case.law.coulomb * float(rng.uniform(-1.0, 1.0)))
        length = law.coulomb / law.stiffness
        u = pieces(rng, case.before[0], case.before[0] + signed(rng, length * decades(rng, -12.0, 0.0)))
        return case._replace(law=law, u=u), 0.0
    if family == "ColemanHodgdon":
        above = abs(case.law.c) * rng.uniform(-1.0, 1.0) / 2.1
        law = replace(case.law, B=case.law.c + above, z0=memory(rng, 1.0) % 1.0 * abs(above) / case.law.alpha)
        return case._replace(law=law), 0.0
    return steepened(case, rng), 0.0


def stride_of(case: Case) -> float:
    """Length and direction of the stride."""
    return float(case.u[-1] - case.before[-1])


def inside(case: Case) -> bool:
    """Whether a Preisach law is not at an end of its levels: its output stands still beyond them."""
    if not isinstance(case.law, hs.Preisach):
        return True
    ends = np.array([case.before[0], case.u[-1]])
    return bool((ends > case.law.levels[0]).all() and (ends < case.law.levels[-1]).all())


def lowest_slope(law: Any) -> float:
    """A lower bound of |dy/du| of a law of plays or relays with weights of one sign."""
    if isinstance(law, hs.Preisach):
        return float(law.slope_bounds()[0])
    slope = law.weights[0]
    if isinstance(law, hs.ModifiedPrandtlIshlinskii):
        slope *= law.dead_zone_weights[law.dead_zones.index(0.0)]
    if isinstance(law, hs.GeneralizedPrandtlIshlinskii):
        slope *= law.left[4]
    return float(slope)


def steepened(case: Case, rng: Rng, closest: float = 0.05) -> Case | None:
    """The case with a slope of the input that outdoes the memory's on the whole stride; none if the memory escapes."""
    law = case.law
    coefficients = {"feedthrough": 0.0} if isinstance(law, hs.BoucWen | hs.Duhem) else {"input_coefficients": (0.0,)}
    if isinstance(law, hs.Duhem):
        coefficients |= {"y0": law.y0 - law.feedthrough * case.before[0]}
    plain = replace(law, **coefficients)
    even = np.linspace(case.before[0], case.u[-1], 65)
    low, high = sorted(even[[0, -1]])
    u = np.sort(np.concatenate([case.before, case.u, even, np.clip([0.0], low, high)]))
    u, path = through_peaks(plain, u if even[-1] >= even[0] else u[::-1])
    if not np.isfinite(path).all() or np.abs(path).max() > 1e100:
        return None
    states = [path[:, 0], u, *path[:, 1:].T]
    at_zero = [0.0 * u, *states[1:]]
    reach = float(np.abs(u).max())
    if isinstance(law, hs.GeneralizedBoucWen):  # whose slope at z jumps where u changes its sign
        states[1], at_zero = np.full(u.size, reach), [path[:, 0], np.full(u.size, -reach)]
    steepest = max(float(np.abs(plain.tangent(s, *at)).max()) for s in (1.0, -1.0) for at in (states, at_zero))
    if not 1e-12 < steepest < 1e12:
        return None
    least = closest if isinstance(law, hs.BoucWen | hs.PolynomialBoucWen | hs.GeneralizedBoucWen) else 1.0
    slope = signed(rng, (1.0 + decades(rng, np.log10(least), 1.5)) * (steepest or 1.0))
    if isinstance(law, hs.BoucWen | hs.Duhem):
        coefficients = {"feedthrough": slope}
        if isinstance(law, hs.Duhem):
            coefficients["y0"] = plain.y0 + slope * case.before[0]
    elif isinstance(law, hs.PolynomialBoucWen):
        bend = min(0.004, 0.1 * least) * slope * rng.uniform(-1.0, 1.0, 2)
        coefficients = {"input_coefficients": (slope, bend[0] / (reach or 1.0), bend[1] / (reach or 1.0) ** 2)}
    else:
        coefficients = {"input_coefficients": (slope,)}
    return case._replace(law=replace(law, **coefficients))


def through_peaks(law: Any, u: Array) -> tuple[Array, Array]:
    """Inputs on a stride, more of them where a memory moves far between two, and the memories there.

    A memory may rise far and fall back between two samples; the energy that a law has taken shows it.
    """
    for k in range(PEAK_ROUNDS + 1):
        _, path = perturbed(Case(law, u[:1], u[1:], np.empty(0, int)), *places(law), 0.0, 0.0)
        if not np.isfinite(path).all() or k == PEAK_ROUNDS:
            break
        ranges = np.ptp(path, axis=0)
        moved = np.abs(np.diff(path, axis=0)) / np.where(ranges > 0.0, ranges, 1.0)
        far = np.flatnonzero(moved.max(axis=1) > FAR)
        inside = [np.linspace(u[i], u[i + 1], PEAK_PIECES + 1)[1:-1] for i in far]
        finer = np.unique(np.concatenate([u, *inside]))
        if np.isin(finer, u).all():
            break
        u = finer if u[-1] >= u[0] else finer[::-1]
    return u, path


def of_two(family: str, rng: Rng) -> tuple[Case | None, float]:
    """A sum of a Bouc-Wen law and plays, or one behind the other, both rising."""
    case = draw_case("BoucWen", rng)
    u = pieces(rng, case.before[0], case.before[0] + stride_of(case))
    steep = steepened(case._replace(before=case.before[:1], u=u), rng)
    if steep is None:
        return None, 0.0
    case = steep
    law, plays = case.law, DRAWS["PrandtlIshlinskii"](rng, invertible=True).law
    sign = float(np.sign(law.feedthrough))
    weights = tuple(sign * abs(law.feedthrough) * w / sum(plays.weights) for w in plays.weights)
    plays = replace(plays, weights=weights, offset=0.0)  # an offset of another size would hide the output
    joined = hs.Sum(parts=(law, plays)) if family == "Sum" else hs.Cascade(stages=(law, plays))
    slope = abs(law.feedthrough) / 50.0  # at least the part of it that the memory leaves, 0.05 / 1.05 of it
    return case._replace(law=joined), slope if family == "Sum" else slope * abs(plays.weights[0])


# ---------------------------------------------------------------------------------- runs and verdicts


def forward(law: Any, u0: float, u: Array) -> Array:
    """Outputs of the law that has begun at `u0`."""
    if isinstance(law, hs.RateDependentPrandtlIshlinskii):
        return law.response(np.array([u0, *u]), 1.0, speed=np.ones(1 + u.size))[1:]
    try:
        return law.advance(u, law.advance([u0])[1])[0]
    except hs.SimulationError:
        return np.full(u.size, np.inf)


def inputs_for(wanted: Wanted, y: Array) -> Array:
    """The inverse as a function of a whole output."""
    law = wanted.law
    if isinstance(law, hs.RateDependentPrandtlIshlinskii):
        return law.inverse_response(np.array([wanted.y0, *y]), 1.0, speed=np.ones(1 + y.size))[1:]
    if isinstance(law, hs.Sum | hs.Cascade):
        return law.inverse_response(y, u0=wanted.u0)
    return law.inverse_response(y, state=law.advance([wanted.u0])[1])


def stepped_inputs_for(wanted: Wanted, y: Array) -> Array:
    """The inverse as compiled loops take it."""
    law = wanted.law
    if isinstance(law, hs.PrandtlIshlinskii):
        step, parameters, state = replace(law, z0=law.advance([wanted.u0])[1][1:]).inverse().compiled(wanted.y0)
    else:
        step, parameters, state = law.inverse().compiled(u0=wanted.u0)
    return np.array([step(parameters, state, float(value)) for value in y])


def inverse_verdict(wanted: Wanted, inverse: Callable[[Wanted, Array], Array]) -> Verdict:
    """Compare the inputs for the last output alone, for some, and for all.

    A law that refuses where all wanted outputs are that of the beginning, to the bit, is undecided; one whose output
    turns at the beginning, and goes the same way to both sides, may refuse, and so may one that is too stiff.
    """
    try:
        coarse, some, fine = (inverse(wanted, y) for y in (wanted.y[-1:], wanted.y[wanted.kept], wanted.y))
    except (hs.SimulationError, ValueError):
        if (wanted.y == wanted.y0).all():  # beside its offset a memory may move by less than a rounding
            return Verdict(0.0, "edge")
        return Verdict(0.0 if turns(wanted) or is_stiff(wanted) else np.inf, "refused")
    if not all(np.isfinite(u).all() for u in (coarse, some, fine)):
        return Verdict(np.inf, "refused")
    ratio = distance(wanted, (coarse, some, fine), allowed(wanted, fine, NOTHING))
    case = Case(wanted.law, np.array([wanted.u0]), fine, wanted.kept)
    for errors, enough in ((spread, WELL_INSIDE), (nearest_spread, 1.0), (spread_through_peaks, 1.0)):  # as `judged`
        if ratio > enough:
            ratio = min(ratio, distance(wanted, (coarse, some, fine), allowed(wanted, fine, errors(case))))
    return Verdict(ratio, "compared")


def turns(wanted: Wanted) -> bool:
    """Whether the output goes the same way to both sides of the first input, however short the way is."""
    lengths = NEAR * (1.0 + abs(wanted.u0))
    ahead, back = (
        np.array(
            [float(forward(wanted.law, wanted.u0, np.array([wanted.u0 + side * length]))[0]) for length in lengths]
        )
        - wanted.y0
        for side in (1.0, -1.0)
    )
    seen = np.minimum(np.abs(ahead), np.abs(back)) > SOLVED * UNIT * abs(wanted.y0)
    return bool(np.sum(seen) >= SEEN and (ahead[seen] * back[seen] > 0.0).all())


def is_stiff(wanted: Wanted) -> bool:
    """Whether the law is refused on a stroke that a search may try: twice as long as the one sought, in one piece."""
    try:
        u = inputs_for(wanted, wanted.y)[-1]
        wanted.law.response([wanted.u0, 2.0 * u - wanted.u0])
    except hs.SimulationError as error:
        return "stiff" in str(error)
    return False


def nearest_spread(case: Case) -> Spread:
    """The spread of roundings themselves: close to an unstable balance only these go the same way."""
    return spread(case, NEAREST)


def distance(wanted: Wanted, found: tuple[Array, Array, Array], limits: tuple[Array, Array]) -> float:
    """The largest distance over what is allowed: of inputs from each other, of the outputs there from those wanted."""
    (coarse, some, fine), (at_y, at_u) = found, limits
    last = wanted.y.size - 1
    ratio = worst(np.abs(some - fine[wanted.kept]), 2.0 * at_u[wanted.kept])
    ratio = max(ratio, worst(np.abs(coarse - fine[-1:]), 2.0 * at_u[-1:]))
    for u, samples in ((coarse, [last]), (some, wanted.kept), (fine, np.arange(last + 1))):
        ratio = max(ratio, worst(np.abs(forward(wanted.law, wanted.u0, u) - wanted.y[samples]), at_y[samples]))
    return ratio


def allowed(wanted: Wanted, u: Array, errors: Spread) -> tuple[Array, Array]:
    """What the outputs and the inputs may be off by."""
    law, case = wanted.law, Case(wanted.law, np.array([wanted.u0]), u, wanted.kept)
    before = np.array([wanted.y0])
    own = size(law, case.before, u, wanted.y) + np.abs(wanted.y) + abs(wanted.y0)
    if isinstance(law, hs.JilesAtherton):  # the field is what is left of the effective field without alpha M, and
        most = law.Ms + abs(law.z0)  # a rounding of it moves M by up to most / k
        field = np.maximum(np.abs(u), abs(wanted.u0)) + abs(law.alpha) * most
        own = own + abs(law.feedthrough * law.alpha) * most + abs(law.gain) * most * field / law.k / SOLVED
    at_y = (SOLVED + LAST_SUM) * UNIT * own
    rounded_u = LAST_SUM * UNIT * np.maximum(np.abs(u), abs(wanted.u0))
    if isinstance(law, hs.PrandtlIshlinskii | hs.ModifiedPrandtlIshlinskii | hs.RateDependentPrandtlIshlinskii):
        # the inverse is a sum of plays, of terms that are larger than the input
        inverse = (law.plays if isinstance(law, hs.ModifiedPrandtlIshlinskii) else law).inverse()
        x = law.plays.advance(u)[0] if isinstance(law, hs.ModifiedPrandtlIshlinskii) else wanted.y
        rounded_u = rounded_u + LAST_SUM * UNIT * size(inverse, before, x, u)
        zones = 1.0
        if isinstance(law, hs.ModifiedPrandtlIshlinskii):  # and so is the inverse of the dead zones, whose weights
            zones = np.abs(law.dead_zone_weights).sum()  # telescope to less than 2 / c_0, those of the plays to 2 / w_0
            least = law.dead_zone_weights[law.dead_zones.index(0.0)] * law.weights[0]
            rounded_u = rounded_u + LAST_SUM * UNIT * (np.abs(wanted.y) + abs(law.offset)) * 4.0 / least
        return at_y + float(np.abs(law.weights).sum() * zones) * rounded_u, at_y / wanted.slope + rounded_u
    at_y = at_y + ROUNDINGS * errors.y
    at_y += promised(law) * float(np.ptp(np.append(wanted.y, wanted.y0)))
    slope: Any = wanted.slope
    if not slope:
        _, path = perturbed(case, *places(law), 0.0, 0.0)
        states = [path[1:, 0], *([] if isinstance(law, hs.Dahl | hs.ColemanHodgdon) else [u]), *path[1:, 1:].T]
        slope = np.abs(law.tangent(np.sign(u[-1] - wanted.u0) or 1.0, *states))
        at_y = at_y + slope * rounded_u
    return at_y, at_y / slope + rounded_u
