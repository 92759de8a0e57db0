"""How fast is the posterior of the seven-parameter Bouc-Wen law on Table 1, and do its intervals hold the truth?

1. Effective samples in a second of the processor, for the 52 points of the paper with quantised noise and priors flat
   in the boxes of the search; beside what a user would write: emcee with its own moves, a log-likelihood by hand and a
   Python loop over the walkers, in the same run and from the same start.
2. Coverage: 400 laws are drawn from a flat region about the fit of Table 1, each with its sigma, simulated on the
   paper's voltages and rounded to pixels. The posterior has the region as its prior. Pooled over the parameters, the
   intervals at 95 % should hold the truth in 93 to 97 % of the cases, each in 90 to 99 %. An end of an interval needs
   400 effective samples: the probability beyond it then has a standard error of 0.8 % at most, which changes the mean
   coverage by far less. A draw may take 6 000 steps of its walkers. One that has fewer effective samples then counts
   all the same, and is named in the result.

Draws are stored one by one; `python experiments/48_posterior.py resume` goes on after those that are there.
"""

import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import log_ndtr

import hysim as hs
from hysim.plot import Figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import PIXEL, cpu_timed, one_panel, stored_result, write_results

RESULTS = Path(__file__).parent / "results" / "posterior"
N_DRAWS, EFFECTIVE, MOST_STEPS = 400, 400, 6000
APART = 200  # the seeds of a draw and of its posterior
PLAIN_STEPS = 2000
REGION = 0.3  # of each estimate, to both sides
SIGMA = (0.01, 0.05)  # um
NAMES = ("beta", "gamma", "n", "feedthrough", "gain", "offset", "z0")

Row = dict[str, Any]


def fitted() -> tuple[hs.Record, hs.Identification]:
    """The paper's points, and the law identified on them."""
    rec = hs.datasets.table1()
    return rec, hs.identify(hs.BoucWen, rec, noise="quantised", admissible=False)


# ---------------------------------------------------------------------------------- speed


def own_speed(rec: hs.Record, fit: hs.Identification, samples: int) -> Row:
    """Effective samples of hysim, and the processor time for them."""
    post, seconds = cpu_timed(hs.sample_posterior, fit, rec, samples=samples)
    return _speed("hysim", seconds, post.n_evaluations, min(post.effective_samples.values()),
                  max(post.rhat.values()))  # fmt: skip


def plain_speed(rec: hs.Record, fit: hs.Identification, steps: int) -> Row:
    """The same by emcee's default moves and a loop over the walkers; flat priors about the fit, open for scales."""
    import emcee

    walkers, count = 32, 0
    start = np.array([*(fit.estimates[name] for name in NAMES), math.log(fit.sigma)])

    def log_probability(theta: np.ndarray) -> float:
        nonlocal count
        count += 1
        values, sigma = dict(zip(NAMES, theta, strict=False)), math.exp(theta[-1])
        if not (0.5 <= values["n"] <= 10.0 and PIXEL / 10.0 <= sigma <= 3.0):
            return -math.inf
        try:
            residual = np.abs(rec.y - hs.BoucWen(**values).response(rec.u))
        except (ValueError, hs.SimulationError):
            return -math.inf
        near, far = log_ndtr((PIXEL / 2 - residual) / sigma), log_ndtr((-PIXEL / 2 - residual) / sigma)
        return float((near + np.log1p(-np.exp(np.minimum(far - near, -1e-16)))).sum())

    scale = np.array([*(fit.stderr[name] for name in NAMES), 0.1])
    rng = np.random.default_rng(0)
    begin = start + 1e-2 * scale * rng.standard_normal((walkers, start.size))
    sampler = emcee.EnsembleSampler(walkers, start.size, log_probability)
    _, seconds = cpu_timed(sampler.run_mcmc, begin, steps)
    tau = float(np.max(sampler.get_autocorr_time(tol=0)))
    return _speed("plain emcee, a loop over walkers", seconds, count, steps * walkers / tau, None)


def _speed(name: str, seconds: float, evaluations: int, effective: float, rhat: float | None) -> Row:
    return {
        "case": name,
        "effective_samples": effective,
        "cpu_seconds": seconds,
        "effective_per_second": effective / seconds,
        "evaluations_per_second": evaluations / seconds,
        "rhat": rhat,
    }


# ---------------------------------------------------------------------------------- coverage


def region(fit: hs.Identification) -> dict[str, tuple[float, float]]:
    """The flat region about the fit, which is the prior too."""
    ends = {name: sorted((value * (1.0 - REGION), value * (1.0 + REGION))) for name, value in fit.estimates.items()}
    return {name: (ends[name][0], ends[name][1]) for name in NAMES} | {"sigma": SIGMA}


def draw_of(seed: int, rec: hs.Record, fit: hs.Identification, samples: int) -> dict[str, Any]:
    """Whether the interval of each parameter holds the truth of one draw, and the seconds of the processor.

    The identification begins at the truth to save time; the posterior does not depend on where it ends. The seed of
    the posterior is not that of the draw, whose first numbers are the truth.
    """
    rng, box = np.random.default_rng(seed), region(fit)
    law, sigma, y = drawn_law(rng, rec, fit, box)
    noisy = PIXEL * np.round((y + sigma * rng.standard_normal(y.size)) / PIXEL)
    drawn = hs.Record(u=rec.u, y=noisy, resolution=PIXEL)
    truth = law.scalars | {"sigma": sigma}
    began = time.process_time()
    begun = hs.identify(law, drawn, noise="quantised", max_evaluations=200, admissible=False)
    post = hs.sample_posterior(begun, drawn, priors=box, samples=samples, most_steps=MOST_STEPS, seed=APART + seed)
    held = {name: low <= truth[name] <= high for name, (low, high) in post.interval(0.95).items()}
    return {
        "held": held,
        "span": float(np.ptp(y)),
        "cpu_seconds": time.process_time() - began,
        "effective_samples": min(post.effective_samples.values()),
        "rhat": max(post.rhat.values()),
    }


def drawn_law(
    rng: np.random.Generator, rec: hs.Record, fit: hs.Identification, box: dict[str, tuple[float, float]]
) -> tuple[Any, float, np.ndarray]:
    """A law from the region, its sigma, and its output; laws that diverge have no probability."""
    while True:
        truth = {name: _drawn(name, ends, rng) for name, ends in box.items()}
        law = fit.model.with_scalars({name: truth[name] for name in NAMES})
        try:
            return law, truth["sigma"], law.response(rec.u)
        except hs.SimulationError:
            continue


def _drawn(name: str, ends: tuple[float, float], rng: np.random.Generator) -> float:
    """Uniform between the ends, in the logarithm where the search has it."""
    if name in ("n", "sigma"):
        return math.exp(rng.uniform(*np.log(ends)))
    return float(rng.uniform(*ends))


# ---------------------------------------------------------------------------------- results


def main(smoke: bool = False, resume: bool = False) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    rec = hs.datasets.table1()
    if smoke:
        line = hs.identify(hs.Line, rec, noise="quantised")
        return [own_speed(rec, line, samples=50)]
    rec, fit = fitted()
    before = stored_result(RESULTS) if resume else {}
    speeds = before.get("speeds") or [own_speed(rec, fit, 10_000), plain_speed(rec, fit, PLAIN_STEPS)]
    draws: list[dict[str, Any]] = before.get("draws", [])
    rows = _write(speeds, draws) if draws else []
    for seed in range(len(draws), N_DRAWS):
        draws.append(draw_of(seed, rec, fit, EFFECTIVE))
        rows = _write(speeds, draws)
        print(seed, draws[-1], flush=True)
    return rows


def _write(speeds: list[Row], draws: list[dict[str, Any]]) -> list[Row]:
    held = [each["held"] for each in draws]
    rows: list[Row] = [
        {
            "parameter": name,
            "draws": len(held),
            "intervals_that_hold_percent": 100.0 * float(np.mean([each[name] for each in held])),
        }
        for name in held[0]
    ]
    halves = draws[: len(draws) // 2], draws[len(draws) // 2 :]
    shares = [float(np.mean(list(each.values()))) for each in held]
    document = {
        "speeds": speeds,
        "draws": draws,
        "asked_effective": EFFECTIVE,
        "most_steps": MOST_STEPS,
        "pooled_percent": _pooled(draws),
        "standard_error_percent": 100.0 * float(np.std(shares)) / math.sqrt(len(shares)),
        "pooled_percent_of_halves": [_pooled(half) for half in halves if half],
        "pooled_percent_of_mixed": _pooled([each for each in draws if each["effective_samples"] >= EFFECTIVE]),
        "seeds_not_mixed": [k for k, each in enumerate(draws) if each["effective_samples"] < EFFECTIVE],
        "least_percent": min(row["intervals_that_hold_percent"] for row in rows),
        "most_percent": max(row["intervals_that_hold_percent"] for row in rows),
        "median_cpu_seconds": float(np.median([each["cpu_seconds"] for each in draws])),
        "cpu_minutes": sum(each["cpu_seconds"] for each in draws) / 60.0,
        "fewest_effective_samples": min(each["effective_samples"] for each in draws),
        "largest_rhat": max(each["rhat"] for each in draws),
    }
    return write_results(RESULTS, rows, draw, document)


def _pooled(draws: list[dict[str, Any]]) -> float:
    """Share of all intervals of these draws that hold the truth [%]."""
    return 100.0 * float(np.mean([list(each["held"].values()) for each in draws]))


def draw(rows: list[Row]) -> Figure:
    """Coverage of each parameter beside 95 %, with two standard errors of a coverage of 95 %."""
    canvas, axes = one_panel(2.6)
    places = np.arange(len(rows))
    shares = [row["intervals_that_hold_percent"] for row in rows]
    reach = 2.0 * math.sqrt(95.0 * 5.0 / rows[0]["draws"])
    axes.axhspan(95.0 - reach, min(95.0 + reach, 100.0), color="#DDDDDD", linewidth=0.0)
    axes.axhline(95.0, color="#777777", linewidth=0.8, linestyle="dashed")
    axes.plot(places, shares, color="#0072B2", marker="o", linestyle="none")
    axes.set_xticks(places, [row["parameter"] for row in rows])
    axes.set(ylabel="Intervals that hold\nthe truth [%]", ylim=(min(80.0, *shares) - 3.0, 102.0))
    return canvas


if __name__ == "__main__":
    main(resume="resume" in sys.argv[1:])
