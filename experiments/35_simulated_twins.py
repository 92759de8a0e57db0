"""Does a default call of `identify` find the optimum, on records that look like those of real devices?

Each case is a simulated twin of a device: a random law of one family, in random units, on the device's kind of input,
disturbed and rounded as its sensor would. The record is all that the default call is told. Three sums of squares stand
beside each other, of the same family:

- that of the default call, without its restriction to safe laws,
- that of the truth, with all parameters of its law free, as a start for `scipy.optimize.least_squares`: the best that
  is known,
- the best of `scipy.optimize.least_squares` from 20 random starts in a box, as long as ten times the time that the
  default call took. The record is scaled for it, the state before the record is told to it where it is no parameter,
  and the law that it calls is hysim's own, compiled and exact.

A case is reached if no other has less than 99 % of the default's sum of squares, or if the default's law has fewer
parameters and a BIC that is no higher: a default call may leave out what the record does not show. Each case is stored
as it is done, and a run that was ended early is continued by the next one.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
import random_starts as starts
from random_starts import Box
from results_folder import median_and_worst, stored_cases, wall_timed, write_results

RESULTS = Path(__file__).parent / "results" / "simulated_twins"
N_SEEDS = 19
INTERVALS = 6  # between the levels of a density of relays
LEVELS = 4096  # of the sensor over the output's range; the noise is 1 to 100 of them

FloatArray = npt.NDArray[np.float64]
Row = dict[str, Any]


class Twin(NamedTuple):
    """What is measured, in units of SciPy: a law, its input, and the box of the starts."""

    law: Any
    u: FloatArray
    box: Box
    drift: FloatArray  # that the law does not explain, shape (n_samples,)
    subject: Any = None  # of the default call; by default the law's class


def yielding(rng: np.random.Generator) -> dict[str, float]:
    """beta, gamma and n of a memory that saturates at a fifth to the whole of the input's span of 2."""
    n = float(rng.uniform(0.8, 2.5))
    rate = float(rng.uniform(0.4, 2.0)) ** -n
    share = float(rng.uniform(-0.4, 0.8))
    return {"beta": rate / (1.0 + share), "gamma": rate * share / (1.0 + share), "n": n}


def sines(rng: np.random.Generator, n_samples: int, cycles: float) -> FloatArray:
    """Cycles of changing amplitude that begin anywhere in a cycle, largest value 1."""
    phase = 2.0 * np.pi * (rng.uniform() + cycles * np.linspace(0.0, 1.0, n_samples))
    u = np.sin(phase) * (0.75 + 0.25 * np.sin(phase / (2.0 + 2.0 * rng.uniform()) + rng.uniform(0.0, 6.0)))
    return np.asarray(u / np.abs(u).max())


def stairs(n_samples: int, n_levels: int, *, growing: bool = True) -> FloatArray:
    """Two triangles at each level, from small to large or back."""
    levels = np.linspace(1.0 / n_levels, 1.0, n_levels)[:: 1 if growing else -1]
    corners = np.concatenate([[0.0], *([level, -level, level, -level] for level in levels), [0.0]])
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    return np.asarray(np.interp(np.linspace(0.0, way[-1], n_samples), way, corners))


def piezo(rng: np.random.Generator) -> Twin:
    """A stack, 10 000 samples from the middle of a cycle on, with creep of 1 % of the stroke a decade."""
    law = hs.BoucWen(**yielding(rng), feedthrough=rng.uniform(1.0, 2.0), gain=-rng.uniform(0.3, 0.9))
    t = np.linspace(0.0, 1.0, 10_000)
    u = sines(rng, t.size, rng.uniform(5.0, 12.0))
    z0 = float(law.memory(u[::-1])[-1])
    stroke = float(np.ptp(law.response(u)))
    return Twin(
        hs.BoucWen(**{**law.scalars, "z0": z0}),
        u,
        starts.MEMORY | starts.OUTPUT | {"feedthrough": (-5.0, 5.0)},
        0.01 * stroke * np.log10(1.0 + 100.0 * t),
    )


def skewed_stack(rng: np.random.Generator) -> Twin:
    """A stack whose loop is not symmetric, under fading triangles."""
    law = hs.PolynomialBoucWen(
        **yielding(rng), gain=-rng.uniform(0.3, 0.9), input_coefficients=(rng.uniform(1.0, 2.0), rng.uniform(-0.3, 0.3))
    )
    u = stairs(1500, 5, growing=False)
    return Twin(law, u, starts.MEMORY | starts.OUTPUT | starts.coefficients(2), np.zeros(u.size))


def skewed_damper(rng: np.random.Generator) -> Twin:
    """A damper of the generalised law, whose branches differ in the six sectors of (z, u)."""
    others = {f"b{k}": float(rng.uniform(-0.1, 0.1)) for k in range(2, 7)}
    law = hs.GeneralizedBoucWen(
        **yielding(rng), **others, gain=rng.uniform(0.5, 2.0), input_coefficients=(rng.uniform(0.0, 0.5),)
    )
    u = stairs(800, 4)
    sectors: Box = dict.fromkeys(others, (-0.5, 0.5))
    return Twin(law, u, starts.MEMORY | starts.OUTPUT | sectors | starts.coefficients(1), np.zeros(u.size))


def ferroelectric(rng: np.random.Generator) -> Twin:
    """A loop of Zhu and Wang's law, whose memory has one sign more."""
    law = hs.ZhuWangBoucWen(
        **yielding(rng),
        delta=float(rng.uniform(-0.3, 0.3)),
        gain=-rng.uniform(0.3, 0.9),
        input_coefficients=(rng.uniform(1.0, 2.0),),
    )
    u = stairs(600, 3)
    box = starts.MEMORY | starts.OUTPUT | starts.coefficients(1) | {"delta": (-2.0, 2.0)}
    return Twin(law, u, box, np.zeros(u.size))


def steel_sheet(rng: np.random.Generator) -> Twin:
    """A magnet of Coleman and Hodgdon's law that begins in the middle of a cycle."""
    law = hs.ColemanHodgdon(alpha=rng.uniform(0.5, 20.0), c=rng.uniform(0.5, 2.0), B=rng.uniform(0.0, 0.4))
    u = sines(rng, 2000, rng.uniform(3.0, 8.0))
    law = hs.ColemanHodgdon(**{**law.scalars, "z0": float(law.memory(u[::-1])[-1])})
    return Twin(law, u, starts.COLEMAN_HODGDON, np.zeros(u.size))


def bearing(rng: np.random.Generator) -> Twin:
    """Friction of Dahl's law under a motion in sines."""
    law = hs.Dahl(stiffness=float(10.0 ** rng.uniform(0.0, 2.0)), coulomb=rng.uniform(0.5, 2.0))
    u = sines(rng, 2000, rng.uniform(3.0, 8.0))
    return Twin(law, u, starts.DAHL, np.zeros(u.size))


def stack_of_plays(rng: np.random.Generator) -> Twin:
    """Twenty plays that are measured from the middle of a cycle on."""
    return _plays(rng, -rng.exponential(np.exp(-np.arange(20) / rng.uniform(2.0, 10.0))))


def plays_of_both_signs(rng: np.random.Generator) -> Twin:
    """Twenty plays whose weights change their sign: the loop of its outer cycle crosses itself."""
    weights = rng.exponential(np.exp(-np.arange(20) / 10.0))
    weights[rng.integers(3, 10) :] *= -1.0
    return _plays(rng, weights)


def _plays(rng: np.random.Generator, weights: FloatArray) -> Twin:
    u = sines(rng, 2000, rng.uniform(3.0, 8.0))
    thresholds = 0.5 * float(np.ptp(u)) * np.arange(20) / 20.0
    weights[0] = float(np.abs(weights).sum()) * rng.uniform(1.0, 2.0)
    law = hs.PrandtlIshlinskii(thresholds=tuple(thresholds), weights=tuple(weights))
    z0 = law.memory(u[::-1])[-1]
    box: Box = {f"weights[{k}]": (-5.0, 5.0) for k in range(20)}
    law = hs.PrandtlIshlinskii(thresholds=tuple(thresholds), weights=tuple(weights), z0=tuple(z0))
    return Twin(law, u, box | starts.OFFSET, np.zeros(u.size), hs.PrandtlIshlinskii.structure(plays=20))


def shape_memory(rng: np.random.Generator) -> Twin:
    """A density of relays under first-order reversal curves."""
    levels = np.linspace(-1.0, 1.0, INTERVALS + 1)
    weights = rng.exponential(0.1, INTERVALS * (INTERVALS + 1) // 2)
    law = hs.Preisach(levels=tuple(levels), weights=tuple(weights), z0=(-1.0,))
    u = hs.signals.reversal_curves(-1.0, 1.0, curves=10, samples_per_step=20)
    box: Box = {f"weights[{k}]": (0.0, 1.0) for k in range(weights.size)}
    return Twin(law, u, box | starts.OFFSET, np.zeros(u.size), hs.Preisach.structure(intervals=INTERVALS))


def pinching_column(rng: np.random.Generator) -> Twin:
    """A column of concrete whose cycles grow: its law loses strength and stiffness, and pinches."""
    law = hs.BoucWenBaberNoori(
        **yielding(rng),
        delta_nu=rng.uniform(0.005, 0.05),
        delta_eta=rng.uniform(0.005, 0.05),
        zeta_s=rng.uniform(0.5, 0.95),
        q=rng.uniform(0.0, 0.3),
        p=rng.uniform(0.1, 1.0),
        psi=rng.uniform(0.05, 0.3),
        lambda_=0.3,
        gain=rng.uniform(0.5, 2.0),
        input_coefficients=(rng.uniform(0.0, 0.2),),
    )
    u = stairs(1000, 5)
    return Twin(law, u, starts.MEMORY | starts.OUTPUT | starts.RATES | starts.PINCH, np.zeros(u.size))


def worn_damper(rng: np.random.Generator) -> Twin:
    """A damper of steel whose cycles grow: its law loses strength and stiffness."""
    law = hs.BoucWenBaberNoori(
        **yielding(rng),
        delta_nu=rng.uniform(0.005, 0.05),
        delta_eta=rng.uniform(0.005, 0.05),
        gain=rng.uniform(0.5, 2.0),
        input_coefficients=(rng.uniform(0.0, 0.2),),
    )
    u = stairs(600, 4)
    return Twin(law, u, starts.MEMORY | starts.OUTPUT | starts.RATES, np.zeros(u.size))


def magnet(rng: np.random.Generator) -> Twin:
    """An accelerator's magnet: its outer cycle, and stairs that fade inside it."""
    law = hs.ParametricPrandtlIshlinskii(
        exponent=rng.uniform(-0.7, 1.0),
        decay=rng.uniform(0.05, 0.6),
        weight=rng.uniform(0.2, 0.8),
        weight_slope=rng.uniform(-0.1, 0.1),
        input_coefficients=(rng.uniform(1.0, 2.0), rng.uniform(-0.1, 0.1), rng.uniform(-0.2, 0.2)),
        reach=2.0,
        z0=(1.0, -1.0),
    )
    u = np.concatenate([np.linspace(-1.0, 1.0, 60), np.linspace(1.0, -1.0, 60)[1:], -stairs(200, 5, growing=False)])
    return Twin(law, u, starts.PLAYS_WITH_DENSITY, np.zeros(u.size))


DEVICES: dict[str, Callable[[np.random.Generator], Twin]] = {
    each.__name__.replace("_", " "): each
    for each in (
        piezo, skewed_stack, skewed_damper, ferroelectric, steel_sheet, bearing, stack_of_plays, plays_of_both_signs,
        pinching_column, worn_damper, magnet, shape_memory,
    )
}  # fmt: skip


def case(device: str, seed: int) -> Row:
    """One twin: costs in units of the sensor's noise, and seconds."""
    rng = np.random.default_rng([list(DEVICES).index(device), seed])
    twin = DEVICES[device](rng)
    y = twin.law.response(twin.u) + twin.drift
    quantum, quanta = float(np.ptp(y)) / LEVELS, float(10.0 ** rng.uniform(0.0, 2.0))
    measured = quantum * np.round(y / quantum + quanta * rng.standard_normal(y.size))
    unit_u, unit_y = 10.0 ** rng.uniform(-3.0, 3.0, size=2)
    record = hs.Record(u=unit_u * twin.u, y=unit_y * measured)

    few = slice(None, None, max(1, y.size // 60))
    subject = twin.subject or type(twin.law)
    hs.identify(subject, hs.Record(u=record.u[few], y=record.y[few]))  # which compiles what the clock is not for
    fit, seconds = wall_timed(hs.identify, subject, record, admissible=False)
    cost = float(np.sum((fit.residual / unit_y) ** 2))

    peer = starts.Peer(twin.law, twin.box, twin.u, measured)
    truth, scipy = peer.from_law(), peer.from_random_starts(rng, starts.PATIENCE * seconds)
    least = min(truth, scipy.cost)
    return {
        "device": device,
        "seed": seed,
        "noise_in_quanta": quanta,
        "samples": y.size,
        "parameters": len(twin.box),
        "kept": fit.n_parameters,
        "seconds": seconds,
        "error_percent": 100.0 - fit.fit_percent,
        "over_best_known": cost / least,
        "over_truth": cost / truth,
        "over_scipy": cost / scipy.cost if np.isfinite(scipy.cost) else None,
        "scipy_starts": scipy.n,
        "scipy_seconds": scipy.seconds,
        "reached": starts.reaches(fit, cost, least, len(twin.box)),
        "beaten_by_scipy": not starts.reaches(fit, cost, scipy.cost, len(twin.box)),
    }


def main(smoke: bool = False) -> list[Row]:
    """Run all cases, store each as it is done, print, and write table, figure and result."""
    if smoke:
        return [case("bearing", 0)]
    keys = {(device, seed): (device, seed) for seed in range(N_SEEDS) for device in DEVICES}
    rows = stored_cases(RESULTS, ("device", "seed"), keys, lambda key: case(*key), line_of)
    return write_results(RESULTS, rows, draw, summary(rows))


def line_of(row: Row) -> str:
    """A case as it is printed."""
    scipy = "-" if row["over_scipy"] is None else f"{row['over_scipy']:.6f}"
    return (
        f"{row['device']:<14} {row['seed']:>3} {row['noise_in_quanta']:6.1f} quanta {row['seconds']:7.2f} s "
        f"{row['error_percent']:8.4f} %  over truth {row['over_truth']:.6f}, over SciPy {scipy} "
        f"({row['scipy_starts']} starts){'' if row['reached'] else ', NOT reached'}"
    )


def summary(rows: list[Row]) -> dict[str, Any]:
    """The numbers that are quoted."""
    devices = {name: [row for row in rows if row["device"] == name] for name in DEVICES}
    return {
        "cases": len(rows),
        "reached_percent": starts.share_percent(rows, "reached"),
        "beaten_by_scipy_percent": starts.share_percent(rows, "beaten_by_scipy"),
        "worst_over_best_known": max(row["over_best_known"] for row in rows),
        **median_and_worst("seconds", (row["seconds"] for row in rows)),
        "total_seconds": float(sum(row["seconds"] + row["scipy_seconds"] for row in rows)),
        "devices": {
            name: {
                "reached_percent": starts.share_percent(own, "reached"),
                "worst_over_best_known": max(row["over_best_known"] for row in own),
                **median_and_worst("seconds", (row["seconds"] for row in own)),
            }
            for name, own in devices.items()
        },
    }


def draw(rows: list[Row]) -> Figure:
    """Cost over the best known, and seconds, by device."""
    names = list(dict.fromkeys(row["device"] for row in rows))
    places = [names.index(row["device"]) + 0.5 * (row["seed"] / N_SEEDS - 0.5) for row in rows]
    return starts.draw_cases(rows, places, names, "s")


if __name__ == "__main__":
    main()
