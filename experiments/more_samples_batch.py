"""The same cases in batches, and three near invariants: a path that is cut, an input at rest, and odd symmetry."""

from dataclasses import replace
from typing import Any

import numpy as np
from hostile_laws import Rng, decades
from more_samples import N_PIECES, ROUNDINGS, UNIT, Array, Case, Run, Verdict, size, worst

import hysim as hs


def batch_runs(cases: list[Case], paths: list[list[Run]]) -> list[list[Run]]:
    """The three runs of each case by `responses`: where a run leaves out a sample, its input stands still.

    A batch has inf for a law that escapes, and for one that is too stiff: which of them is taken from the path kernels.
    """
    groups: dict[Any, list[int]] = {}
    for k, case in enumerate(cases):
        groups.setdefault(structure_of(case), []).append(k)
    found: list[list[Run]] = [[] for _ in cases]
    for members in groups.values():
        laws = [cases[k].law for k in members]
        parameters = {name: np.array([getattr(law, name) for law in laws]) for name in laws[0].arguments}
        for chosen in range(3):
            inputs = np.array([held(cases[k], chosen) for k in members])
            y = type(laws[0]).responses(parameters, inputs)
            for k, row in zip(members, y, strict=True):
                own = row[LONGEST : LONGEST + cases[k].u.size][places_of(cases[k], chosen)]
                lost = "refused" if isinstance(paths[k][chosen].y, str) else None
                found[k].append(Run(own if np.isfinite(row).all() else lost, ()))
    return found


LONGEST = 3
"""Inputs before a stride, at most."""


def even_verdicts(cases: list[Case], rng: Rng) -> list[Verdict]:
    """Strides of a rate-dependent law in one piece and in even ones: a batch has one time for all samples."""
    laws = [case.law for case in cases]
    parameters = {name: np.array([getattr(law, name) for law in laws]) for name in laws[0].arguments}
    count = int(decades(rng, np.log10(2.0), np.log10(N_PIECES)))
    u = np.array([np.linspace(case.before[0], case.u[-1], count + 1) for case in cases])
    coarse = hs.RateDependentPrandtlIshlinskii.responses(parameters, u[:, [0, -1]], 1.0)
    fine = hs.RateDependentPrandtlIshlinskii.responses(parameters, u, 1.0 / count)
    found = []
    for law, inputs, one, many in zip(laws, u, coarse, fine, strict=True):
        stride = abs(inputs[-1] - inputs[0]) or 1.0
        uneven = count * float(np.abs(inputs).max()) / stride  # roundings of the input in one piece
        widening = law.beta * stride * uneven * float(np.abs(law.weights).sum())
        allowed = ROUNDINGS * UNIT * (size(law, inputs[:1], inputs[1:], many[1:])[-1:] + widening)
        found.append(Verdict(worst(np.abs(one[-1:] - many[-1:]), allowed), "compared"))
    return found


def structure_of(case: Case) -> Any:
    """What the laws of one batch have in common."""
    values = case.law.arguments.values()
    two_sided = isinstance(case.law, hs.Duhem) and bool(case.law.p_abs.any() or case.law.q_abs.any())
    return type(case.law), tuple(np.shape(value) for value in values), two_sided


def places_of(case: Case, chosen: int) -> Array:
    """The samples of the run in one piece, of the one with some, and of the one with all."""
    return (np.array([case.u.size - 1]), case.kept, np.arange(case.u.size))[chosen]


def held(case: Case, chosen: int) -> Array:
    """Inputs before and on the stride, filled up at both ends; at a sample that is left out the input rests."""
    stand = np.full(case.u.size, -1)
    own = places_of(case, chosen)
    stand[own] = own
    stand = np.maximum.accumulate(stand)
    u = np.where(stand < 0, case.before[-1], case.u[stand])
    first, last = [case.before[0]] * (LONGEST - case.before.size), [u[-1]] * (N_PIECES + 2 - u.size)
    return np.concatenate([first, case.before, u, last])


def cut_keeps_bits(case: Case, rng: Rng) -> bool:
    """Whether a path that is cut at a sample and continued is the same to the bit, and so is its state."""
    whole = np.concatenate([case.before, case.u])
    cut = int(rng.integers(1, whole.size))
    try:
        y, end = case.law.advance(whole)
        head, state = case.law.advance(whole[:cut])
        tail, last = case.law.advance(whole[cut:], state)
    except hs.SimulationError:
        return True
    return bool(np.array_equal(np.concatenate([head, tail]), y)) and last == end


def standing_changes_nothing(case: Case, rng: Rng) -> bool:
    """Whether samples at which the input is at rest repeat the output to the bit, and change no other."""
    whole = np.concatenate([case.before, case.u])
    times = rng.integers(1, 4, whole.size)
    try:
        return np.array_equal(case.law.response(np.repeat(whole, times)), np.repeat(case.law.response(whole), times))
    except hs.SimulationError:
        return True


def is_odd(case: Case) -> bool:
    """Whether the mirrored law, from its state and on the mirrored input, has the mirrored output to the bit."""
    try:
        y = case.law.response(np.concatenate([case.before, case.u]))
        mirrored = mirror(case.law).response(-np.concatenate([case.before, case.u]))
    except hs.SimulationError:
        return True
    return np.array_equal(mirrored, -y)


ODD: dict[str, tuple[str, ...]] = {
    "BoucWen": ("offset", "z0"), "PolynomialBoucWen": ("offset", "z0"), "ZhuWangBoucWen": ("offset", "z0"),
    "GeneralizedBoucWen": ("offset", "z0", "b4", "b5", "b6"), "ColemanHodgdon": ("offset", "z0"),
    "Dahl": ("offset", "z0"), "JilesAtherton": ("offset", "z0"),
    "Play": ("offset", "z0"), "Stop": ("offset", "z0"), "MaxwellSlip": ("offset", "z0"),
    "PrandtlIshlinskii": ("offset", "z0"), "Line": ("offset",), "Tellinen": ("offset", "z0"),
    "EnergyPlays": ("offset", "z0"),
}  # fmt: skip
"""What changes its sign in the mirrored law."""


def mirror(law: Any) -> Any:
    """The law of the mirrored curve."""
    changed: dict[str, Any] = {}
    for name in ODD[type(law).__name__]:
        value = getattr(law, name)
        changed[name] = tuple(-z for z in value) if isinstance(value, tuple) else -value
    if isinstance(law, hs.PolynomialBoucWen | hs.ZhuWangBoucWen | hs.GeneralizedBoucWen):
        signed_powers = ((-1.0) ** k * c for k, c in enumerate(law.input_coefficients))
        changed["input_coefficients"] = tuple(signed_powers)
    return replace(law, **changed)
