"""Whether more samples on a monotone branch of the input change anything: one stride in one piece, and cut at random.

Three runs of one law from one state go to the same input: at once, with some samples on the way, and with more of them.
They must agree at the samples that they have in common, and so must their states at the end. How far they may differ:

bits        plays, stops, relays, lines: nothing. A position that is pushed along ends where the last sample pushes it.
rounding    closed forms: what the rounding of each step comes to. A step rounds its state and its length a few times;
            the law then carries these errors on, and may let them grow. How far is measured, not guessed: the run with
            the most samples is repeated with the state after each sample, and the length of each step, off by 2^-36
            in all the same direction, the worst case for a flow on a line. Its distance from the run, scaled to one
            rounding of 2^-53, is what one rounding in each step comes to.
integrated  1e-9 of the range of the output on the branch (a law by its slope), and what the tolerance of a step comes
            to, 1e-12 of the state, measured in the same way: a law may let it grow, or move by less than 1e-3 of its
            state. Jiles-Atherton: roundings, and 1e-11 of the range.

A law that escapes is to escape in all runs, and in every form: the path kernels, batches, the compiled step. Only where
rounding decides is a difference no fault, and that is measured too: all samples are gone through again with the state
and each length off by as many roundings as are allowed above, once for each pair of signs. If some of them escape and
others do not, the escape lies within rounding of the last input, and the case counts as undecided.

A law that is too stiff is refused with an error, which is no result that could differ. As the steps between two samples
are limited, and not those of the stride, it may be refused in one piece and not in many: it counts as partly refused.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from hostile_laws import DRAWS, decades, signed

import hysim as hs

Array = np.ndarray[Any, np.dtype[Any]]
Rng = np.random.Generator

N_PIECES = 64
INTEGRATED, SERIES = 1e-9, 1e-11
ROUNDINGS = 16.0
LAST_SUM = 4.0
OFF, NEAREST = 2.0**-36, 2.0**-51
UNIT = 2.0**-53
SMALLEST = 2.0**-1022
PEAK_ROUNDS, PEAK_PIECES = 40, 8
BITS = ("Play", "Stop", "PrandtlIshlinskii", "ModifiedPrandtlIshlinskii", "MaxwellSlip",
        "ParametricPrandtlIshlinskii", "EnergyPlays", "Preisach", "PreisachRelays", "CustomLaw", "Line",
        "SingleValued")  # fmt: skip


class Case(NamedTuple):
    """A law, the inputs before the stride, those on it, and the places of those that are common to all runs."""

    law: Any
    before: Array
    u: Array
    kept: Array


def draw_case(family: str, rng: Rng, **kind: Any) -> Case:
    """A random law of a family, some turns before it, and a stride in 2 to 64 pieces."""
    law, length = DRAWS[family](rng, **kind)
    stride = signed(rng, length * (decades(rng, 0.0, 2.0) if rng.random() < 0.3 else decades(rng, -12.0, 1.0)))
    origin = float(rng.choice([0.0, -stride, -stride * rng.random(), signed(rng, length * decades(rng, -3.0, 3.0))]))
    history = rng.random() < 0.4 and family != "RateDependentPrandtlIshlinskii"  # which is to come from rest
    turns = signed(rng, length) * 10.0 ** rng.uniform(-2.0, 0.5, rng.integers(0, 3) if history else 0)
    turns *= (-1.0) ** np.arange(turns.size)
    before = np.array([origin, *(origin + turns)])
    u = pieces(rng, before[-1], before[-1] + stride)
    if family == "GeneralizedBoucWen" and before[-1] * u[-1] < 0.0:  # it has a law for each sign, and may turn between
        u = np.concatenate([u[u * before[-1] > 0.0], [0.0], u[u * before[-1] <= 0.0]])
    kept = np.flatnonzero(rng.random(u.size) < 0.4)
    return Case(law, before, u, np.union1d(kept, [u.size - 1]))


def pieces(rng: Rng, start: float, end: float) -> Array:
    """Inputs from `start`, which is not among them, to `end`, at unequal distances, some of them tiny or none."""
    count = int(2.0 ** rng.uniform(1.0, np.log2(N_PIECES + 1)))
    sizes = rng.exponential(size=count)
    tiny = rng.random(count) < 0.3
    sizes[tiny] *= 10.0 ** rng.uniform(-16.0, -1.0, int(tiny.sum()))
    inside = start + (end - start) * np.cumsum(sizes)[:-1] / sizes.sum()
    if rng.random() < 0.3:
        inside[0] = np.nextafter(start, end)
    low, high = min(start, end), max(start, end)
    ordered = np.sort(np.clip(inside, low, high))
    return np.array([*(ordered if end >= start else ordered[::-1]), end])


# ---------------------------------------------------------------------------------- how far rounding goes


class Spread(NamedTuple):
    """What one rounding in each step comes to: in outputs and in the memory at the end; ranges; who escapes."""

    y: Array
    memory: Array
    memory_range: Array
    y_range: float
    escapes: set[bool]


NOTHING = Spread(np.zeros(1), np.zeros(1), np.zeros(1), 0.0, set())
WELL_INSIDE = 0.05  # of what is allowed without the spread


def places(law: Any) -> tuple[list[int], list[int]]:
    """Where the last inputs and the memories stand in the state of the compiled step."""
    if isinstance(law, hs.Sum | hs.Cascade):
        inputs, memories, begin = [], [], 0
        for k, part in enumerate(law.members):
            own_inputs, own_memories = places(part)
            inputs += [begin + place for place in own_inputs if isinstance(law, hs.Sum) or k == 0]
            memories += [begin + place for place in own_memories]
            begin += part.compiled().state.size
        return inputs, memories
    if isinstance(law, hs.Line | hs.Preisach | hs.PreisachRelays | hs.RateDependentPrandtlIshlinskii):
        return [], []
    if isinstance(law, hs.PrandtlIshlinskii | hs.GeneralizedPrandtlIshlinskii):
        return [0], list(range(1, 1 + len(law.thresholds)))
    if isinstance(law, hs.Chan):
        return [0], [1, 2, 3]
    return [0], [1, 2] if isinstance(law, hs.BoucWenBaberNoori | hs.JilesAtherton) else [1]


def spread(case: Case, off: float = OFF) -> Spread:
    """Distances of the runs perturbed by `off` from the run with all samples, scaled to one rounding in each step."""
    if isinstance(case.law, hs.RateDependentPrandtlIshlinskii):  # its plays add up no errors
        whole = size(case.law, case.before, np.append(case.before[-1], case.u), np.zeros(1))[1:]
        return Spread(UNIT * whole, np.empty(0), np.empty(0), 0.0, {False})
    inputs, memories = places(case.law)
    y, path = perturbed(case, inputs, memories, 0.0, 0.0)
    escapes = {not np.isfinite(y[-1])}
    far_y, far_memory = np.zeros(y.size), np.zeros(len(memories))
    for state_sign, length_sign in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        other, other_path = perturbed(case, inputs, memories, state_sign * off, length_sign * off)
        escapes.add(not np.isfinite(other[-1]))
        far_y = np.fmax(far_y, np.abs(other - y))
        far_memory = np.fmax(far_memory, np.abs(other_path[-1] - path[-1]))
    share = left_out(case.law) / off
    return Spread(far_y * share, far_memory * share, np.ptp(path, axis=0), float(np.ptp(y)), escapes)


def spread_through_peaks(case: Case) -> Spread:
    """The same with samples where the memory moves most: it may rise far and fall back between two samples.

    A rounding at the peak is one beside the peak, and the range of the branch is that of all of it.
    """
    inputs, memories = places(case.law)
    if not memories:
        return NOTHING
    u = np.concatenate([case.before[-1:], case.u])
    for _ in range(PEAK_ROUNDS):
        _, path = perturbed(case._replace(u=u[1:]), inputs, memories, 0.0, 0.0)
        ranges = np.ptp(path, axis=0)
        moved = np.sum(np.abs(np.diff(path, axis=0)) / np.where(ranges > 0.0, ranges, 1.0), axis=1)
        k = int(np.argmax(np.where(np.isfinite(moved), moved, -1.0)))
        inside = np.linspace(u[k], u[k + 1], PEAK_PIECES + 1)[1:-1]
        u = np.concatenate([u[: k + 1], inside[(inside != u[k]) & (inside != u[k + 1])], u[k + 1 :]])
    at = np.array([np.flatnonzero(u == value)[-1] - 1 for value in case.u])
    found = spread(case._replace(u=u[1:]))
    return found._replace(y=found.y[at])


def perturbed(
    case: Case, inputs: list[int], memories: list[int], state_off: float, length_off: float
) -> tuple[Array, Array]:
    """Outputs on the stride, and memories from its start on, with each length and each memory off by a part of itself.

    A memory is off by a part of the largest one so far: on the way down from it a single step rounds beside that.
    """
    step, parameters, state = compiled_before(case)
    largest = np.abs(state[memories])
    state[memories] += state_off * largest
    last, y, path = case.before[-1], np.empty(case.u.size), np.empty((1 + case.u.size, len(memories)))
    path[0] = state[memories]
    for k, u in enumerate(case.u):
        if u != last:
            state[inputs] = u - (1.0 + length_off) * (u - last)
        y[k] = step(parameters, state, u)
        largest = np.maximum(largest, np.abs(state[memories]))
        state[memories] += state_off * largest
        if state_off != 0.0:
            y[k] = step(parameters, state, u)  # the input stands still: the output of the state as it is now
        path[1 + k], last = state[memories], u
    return y, path


def compiled_before(case: Case) -> tuple[Any, Array, Array]:
    """The compiled law after the inputs before the stride."""
    step, parameters, state = case.law.compiled(float(case.before[0]))
    for u in case.before:
        step(parameters, state, float(u))
    return step, parameters, state


def size(law: Any, before: Array, u: Array, y: Array) -> Array:
    """Sizes of the terms of which the last sum makes the outputs `y`."""
    if isinstance(law, hs.Sum):
        whole = np.concatenate([before, u])
        outputs = [part.response(whole)[before.size :] for part in law.parts]
        return np.sum([size(part, before, u, own) for part, own in zip(law.parts, outputs, strict=True)], axis=0)
    if isinstance(law, hs.Cascade):
        first, last = law.stages
        passed = first.response(np.concatenate([before, u]))
        return size(last, passed[: before.size], passed[before.size :], y)
    if isinstance(law, hs.Dahl | hs.ColemanHodgdon):
        law = law.bouc_wen
    if isinstance(law, hs.Preisach):
        return np.full(u.size, abs(law.offset) + float(np.abs(law.weights).sum()))
    if isinstance(law, hs.ReversalFilter):
        return np.full(u.size, float(np.abs(np.concatenate([before, u])).max()))
    if isinstance(law, hs.Line):
        return np.abs(law.offset) + np.abs(law.slope * u)
    if isinstance(law, hs.Tellinen | hs.Chan):
        return np.abs(law.offset) + abs(law.saturation) + np.abs(law.feedthrough * u)
    if isinstance(law, hs.TellinenTable):
        return np.abs(law.offset) + float(np.abs([law.lower, law.upper]).max()) + np.abs(law.feedthrough * u)
    if isinstance(law, hs.Duhem):
        return np.abs(y) + 2.0 * (abs(law.offset) + np.abs(law.feedthrough * u))
    if isinstance(law, hs.JilesAtherton):
        magnetised = abs(law.gain) * max(law.Ms, abs(law.z0))
        return np.abs(y) + 2.0 * (abs(law.offset) + np.abs(law.feedthrough * u) + magnetised)
    if isinstance(
        law, hs.BoucWen | hs.PolynomialBoucWen | hs.ZhuWangBoucWen | hs.GeneralizedBoucWen | hs.BoucWenBaberNoori
    ):
        c = (law.feedthrough,) if isinstance(law, hs.BoucWen) else law.input_coefficients
        static = abs(law.offset) + sum(abs(value) * np.abs(u) ** k for k, value in enumerate(c, 1))
        return np.abs(y) + 2.0 * static
    arms = np.abs(law.thresholds) + np.max(np.abs(law.z0)) + np.abs(np.concatenate([before, u])).max()
    if isinstance(law, hs.RateDependentPrandtlIshlinskii):
        arms = arms + law.beta * float(np.ptp(u))
    if isinstance(law, hs.GeneralizedPrandtlIshlinskii):
        arms = arms + sum(
            np.abs(side[0]) + np.abs(side[3]) + side[4] * np.abs(u).max() for side in (law.left, law.right or law.left)
        )
    return np.full(u.size, abs(law.offset) + float(np.abs(law.weights) @ arms))


def promised(law: Any) -> float:
    """Part of the range to which a law is known, zero for a closed form."""
    if isinstance(law, hs.Sum | hs.Cascade):
        return max(promised(part) for part in law.members)
    if isinstance(law, hs.BoucWenBaberNoori | hs.Duhem) or (isinstance(law, hs.ZhuWangBoucWen) and law.n != 1.0):
        return INTEGRATED
    return SERIES if isinstance(law, hs.JilesAtherton) else 0.0


def left_out(law: Any) -> float:
    """Part of the state that a step leaves out: the tolerance of an integrated law, else a rounding."""
    return hs.Law.tolerance if promised(law) == INTEGRATED else UNIT


# ---------------------------------------------------------------------------------- the runs


class Run(NamedTuple):
    """Outputs at some samples (None for a run that escapes, "refused" for one that is too stiff), and the state."""

    y: Array | str | None
    state: tuple[Any, ...]


def response_run(case: Case, chosen: Array) -> Run:
    """The path kernels, from the state after the inputs before."""
    law, u = case.law, case.u[chosen]
    try:
        if isinstance(law, hs.RateDependentPrandtlIshlinskii):
            return rate_dependent_run(case, u)
        return Run(*law.advance(u, law.advance(case.before)[1]))
    except hs.SimulationError as error:
        return Run("refused" if "stiff" in str(error) else None, ())


def rate_dependent_run(case: Case, u: Array) -> Run:
    """The same at constant speed: each piece takes its part of the stride's time."""
    y0, state = case.law.advance(case.before, sample_time=1.0)
    last, whole, y = case.before[-1], abs(u[-1] - case.before[-1]), np.empty(u.size)
    for k, value in enumerate(u):
        if abs(value - last) > whole * np.finfo(float).tiny:  # else no time passes
            y0, state = case.law.advance([value], state, sample_time=abs(value - last) / whole)
            last = value
        y[k] = y0[-1]
    return Run(y, state)


def compiled_run(case: Case, chosen: Array) -> Run:
    """The compiled step, as closed loops take it."""
    step, parameters, state = compiled_before(case)
    y = np.array([step(parameters, state, float(u)) for u in case.u[chosen]])
    if not np.isfinite(y[-1]):
        return Run("refused" if np.isnan(y[~np.isfinite(y)][0]) else None, ())
    inputs, memories = places(case.law)
    return Run(y, (*state[inputs].tolist(), *state[memories].tolist()))


def runs(case: Case, run: Callable[[Case, Array], Run]) -> list[Run]:
    """The run in one piece, the one with some samples, and the one with all."""
    everything = np.arange(case.u.size)
    return [run(case, chosen) for chosen in (everything[-1:], case.kept, everything)]


class Verdict(NamedTuple):
    """How a case ended: its worst distance over what is allowed; or why there is none."""

    ratio: float
    end: str  # "compared", "escaped", "refused", "partly refused", "edge" (rounding decides whether it escapes)


def judged(case: Case, found: list[Run], errors: Callable[[], Spread] | None) -> Verdict:
    """Compare three runs; without errors they must agree to the bit. The spread is asked for where it can matter."""
    refused = [isinstance(run.y, str) for run in found]
    if any(refused):
        return Verdict(0.0, "refused" if all(refused) else "partly refused")
    escaped = [run.y is None for run in found]
    if any(escaped):
        return Verdict(0.0, "escaped") if all(escaped) else apart_in_escape(case, errors is not None)
    if errors is None:
        return Verdict(to_the_bit(case, found), "compared")
    ratio = compared(case, found, NOTHING)
    if ratio > WELL_INSIDE:
        ratio = compared(case, found, errors())
    if ratio > 1.0:  # close to an unstable balance, at less than 2^-36 of it, only roundings themselves go the same way
        ratio = min(ratio, compared(case, found, spread(case, max(NEAREST, left_out(case.law)))))
    if ratio > 1.0:
        ratio = min(ratio, compared(case, found, spread_through_peaks(case)))
    return Verdict(ratio, "compared")


def apart_in_escape(case: Case, may_round: bool) -> Verdict:
    """The verdict where one run escapes and another does not: a violation, unless rounding decides."""
    decided = not may_round or len(spread(case, ROUNDINGS * left_out(case.law)).escapes) == 1
    return Verdict(np.inf, "escaped") if decided else Verdict(0.0, "edge")


def judged_beside(case: Case, found: list[Run], path: list[Run], errors: Callable[[], Spread] | None) -> Verdict:
    """As `judged`, of another form of the law, which is to escape where the path kernels do."""
    if any((run.y is None) != (other.y is None) for run, other in zip(found, path, strict=True)):
        return apart_in_escape(case, errors is not None)
    return judged(case, found, errors)


def to_the_bit(case: Case, found: list[Run]) -> float:
    """0 where all runs agree in outputs and state, else infinite."""
    coarse, some, fine = (run.y for run in found)
    same = np.array_equal(some, fine[case.kept]) and coarse[-1] == fine[-1]
    return 0.0 if same and found[0].state == found[1].state == found[2].state else np.inf


def compared(case: Case, found: list[Run], errors: Spread) -> float:
    """The largest distance of two runs over what is allowed."""
    coarse, some, fine = (run.y for run in found)
    where = np.append(case.kept, case.u.size - 1)
    apart = np.abs(np.concatenate([some - fine[case.kept], coarse - fine[-1:]]))
    allowed = ROUNDINGS * errors.y + LAST_SUM * UNIT * size(case.law, case.before, case.u, fine)
    ratio = worst(apart, allowed[where] + promised(case.law) * max(float(np.ptp(fine)), errors.y_range))
    if found[0].state and not isinstance(case.law, hs.Sum | hs.Cascade | hs.RateDependentPrandtlIshlinskii):
        n_memories = len(places(case.law)[1])  # of a magnetic core the rest of a place is no memory of its own
        states = np.array([run.state[1 : 1 + n_memories] for run in found])
        apart = np.abs(states[:2] - states[2]).max(axis=0)
        allowed = ROUNDINGS * errors.memory + promised(case.law) * errors.memory_range
        if errors is NOTHING and promised(case.law):  # no more than what a law goes through, without its way there
            allowed = promised(case.law) * np.abs(states[2] - case.law.advance(case.before)[1][1 : 1 + n_memories])
        ratio = max(ratio, worst(apart, allowed))
    return ratio


def worst(apart: Array, allowed: Array) -> float:
    """The largest ratio; below the smallest normal number there are no roundings to count."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(apart <= SMALLEST, 0.0, apart / allowed)
    return float(np.nan_to_num(ratios, nan=np.inf).max())
