"""A Bouc-Wen law whose exponent is no whole number: its terms are in no finite library.

    z' = A u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n

The exponent is scanned: at each one the slope is regressed on the three terms, and from the best of these the free
run is refined, n with the other numbers. The law takes the place of one from the library where its BIC is lower by
more than INDISTINCT.
"""

import math

import numpy as np

from hysim._frozen import FloatArray
from hysim.discovery._derivatives import Feature
from hysim.discovery._refinement import POLISH, Candidate, FreeRun, bic_of
from hysim.discovery._search import Library, Outcome
from hysim.discovery._selection import ALIKE, INDISTINCT, gap
from hysim.discovery._structures import AnyExponent, Terms

_EXPONENTS = np.geomspace(0.4, 6.0, 16)
_RIDGES = (1e-9, 1e-4, 1e-2)


def or_any_exponent(free_run: FreeRun, hidden: Outcome, chosen: Outcome) -> Candidate[Terms] | Candidate[AnyExponent]:
    """The chosen law, or the Bouc-Wen law of any exponent where that explains the records of `free_run` better.

    `hidden` is the outcome of the library of z, from which the scan takes its slopes and shifts.
    """
    thin, best = hidden.search.free_run, chosen.searched
    if chosen.candidate.cost < free_run.n_samples * ALIKE**2:
        return chosen.candidate
    found = [_refined(thin, hidden, structure) for structure in _structures(hidden.library)[:1]]
    least = min((c.cost for c in found if c is not None), default=math.inf)
    fewest = _structures(hidden.library)[-1].size + (0 if True in hidden.library.rests else len(thin.records))
    if not bic_of(least, thin.n_samples, fewest) < best.bic - INDISTINCT:
        return chosen.candidate
    found += [_refined(thin, hidden, structure) for structure in _structures(hidden.library)[1:]]
    sound = [candidate for candidate in found if candidate is not None and candidate.settles]
    lowest = min(sound, key=lambda candidate: candidate.bic, default=None)
    if lowest is None or lowest.bic >= best.bic - INDISTINCT or gap(best, lowest) < ALIKE:
        return chosen.candidate
    return free_run.refine(lowest.structure, lowest.unknowns[np.newaxis], tolerance=POLISH) or chosen.candidate


def _structures(library: Library) -> list[AnyExponent]:
    """With all shifts first, with as few as the route allows last."""
    feedthroughs = {"no": (False,), "may": (True, False), "must": (True,)}[library.feedthrough]
    offsets = (True, False) if library.offset else (False,)
    return [
        AnyExponent(feedthrough, offset, rest)
        for feedthrough in feedthroughs
        for offset in offsets
        for rest in library.rests
    ]


def _refined(free_run: FreeRun, hidden: Outcome, structure: AnyExponent) -> Candidate[AnyExponent] | None:
    starts = []
    for start in hidden.search.starts:
        for n in _EXPONENTS.tolist():
            columns, left = hidden.slopes.equations(_features(n), start.feedthrough, start.offset)
            shift = [start.feedthrough] * structure.feedthrough + [start.offset] * structure.offset
            ends = [n, *shift, *free_run.measured_starts]
            starts += [[*_ridge(columns, left, weight), *ends] for weight in _RIDGES]
    return free_run.refine(structure, np.array(starts))


def _features(n: float) -> Feature:
    def features(u: FloatArray, z: FloatArray, direction: FloatArray) -> FloatArray:
        power = np.abs(z) ** n
        return np.stack([direction, np.copysign(power, z), direction * power], axis=1)

    return features


def _ridge(columns: FloatArray, left: FloatArray, weight: float) -> list[float]:
    sizes = np.sqrt(np.mean(columns**2, axis=0))
    sizes[sizes == 0.0] = 1.0
    scaled = columns / sizes
    normal = scaled.T @ scaled / len(left) + weight * np.eye(3)
    solution = np.linalg.solve(normal, scaled.T @ left / len(left)) / sizes
    return [float(value) for value in solution]
