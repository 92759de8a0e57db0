"""Does one law with parameters in a channel predict a supply, or a temperature, that it was not identified at?

1. A simulated magnetorheological damper, a Bouc-Wen law (n = 2, told) beside a dashpot, whose gain and damping grow in
   proportion to the supply and whose shape beta follows a parabola, at five supplies with noise of 5 N. The fourth
   supply is left out and predicted; so is it by what a user would do without a channel: one law for all supplies, the
   law of the next supply, and the mean of the parameters of both next ones. Then its supply is estimated as if it were
   unknown.
2. A stack whose gain and shape follow a temperature that drifts along one record, with noise of 1 % of the stroke.
3. With the path of a folder, the measured damper of A. N. Vargas's group (github.com/labcontrol-data/mr-damper, MIT
   licence, doi 10.5281/zenodo.4445334), at 0 V and 0.88 V: one law in the supply beside a law for each; and the unknown
   supply of the record 4.4.

    python experiments/45_channels.py [FOLDER]
"""

import dataclasses
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure, panels

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import cpu_timed, median_and_worst, write_results

RESULTS = Path(__file__).parent / "results" / "channels"
SUPPLIES, LEFT_OUT = (0.0, 0.5, 1.0, 1.5, 2.0), 1.5
N_SEEDS, N_SAMPLES, SAMPLE_TIME = 20, 200, 0.01
NOISE, NOISE_OF_STACK = 5.0, 0.01  # [N], and of the stroke
DEPENDS = {"bouc_wen.gain": ("supply", 1), "bouc_wen.beta": ("supply", 2), "dashpot.c": ("supply", 1)}
FIXED = {"bouc_wen.n": 2.0, "bouc_wen.z0": 0.0}
FIXED_OF_STACK = {"n": 1.0, "z0": 0.0}
ON_TEMPERATURE = {"gain": ("T", 1), "beta": ("T", 1)}
MEASURED = {"bouc_wen.gain": ("supply", 1), "bouc_wen.feedthrough": ("supply", 1), "dashpot.c": ("supply", 1)}
FILES = {"4.1": 0.0, "4.2": 0.88, "4.4": None}
N_MEASURED = 1500  # samples of each file: 15 s
MODELS = ("in the supply", "means of the next two laws", "the law of the next supply", "one law for all supplies")
Row = dict[str, float | str | None]


# ---------------------------------------------------------------------------------- the simulated damper


def damper(supply: float) -> Any:
    """The truth at a supply [V]: displacements in mm, forces in N."""
    beta = 0.5 - 0.2 * supply + 0.06 * supply**2
    law = hs.BoucWen(beta=beta, gamma=0.1, n=2.0, gain=40.0 + 60.0 * supply, feedthrough=2.0, offset=3.0)
    return law + hs.Dashpot(c=0.3 + 0.4 * supply)


def motion() -> np.ndarray:
    """Displacement [mm] that grows and changes its rate."""
    t = SAMPLE_TIME * np.arange(N_SAMPLES)
    return (2.0 + 4.0 * t) * np.sin(2.0 * np.pi * (0.8 + 0.3 * t) * t)


def measured(supply: float, seed: int, noise: float = NOISE) -> hs.Record:
    """A record of the damper."""
    u, rng = motion(), np.random.default_rng([seed, round(100 * supply)])
    force = damper(supply).response(u, SAMPLE_TIME)
    y = force + noise * rng.standard_normal(u.size)
    t = SAMPLE_TIME * np.arange(u.size)
    return hs.Record(u=u, y=y, t=t, channels={"supply": supply}, units={"t": "s", "u": "mm", "y": "N", "supply": "V"})


def structure() -> Any:
    """What is identified."""
    return hs.Sum.structure(hs.BoucWen, hs.Dashpot)


def error_percent(model: Any) -> float:
    """Error of a law of the left-out supply against the truth there, of its range [%]."""
    u = motion()
    truth = damper(LEFT_OUT).response(u, SAMPLE_TIME)
    return float(100.0 * np.sqrt(np.mean((model.response(u, SAMPLE_TIME) - truth) ** 2)) / np.ptp(truth))


def averaged(fits: list[hs.Identification]) -> Any:
    """The law with the means of the parameters of two fits."""
    first, second = fits
    return first.model.with_scalars(
        {name: 0.5 * (value + second.model.scalars[name]) for name, value in first.model.scalars.items()}
    )


def truths_of(fit: hs.Identification, law: Callable[[float], Any]) -> dict[str, float]:
    """True values of the free parameters of a fit, the states at the first sample left out."""
    known = {each.parameter: each for each in fit.model.polynomials}
    values = {name: value for name, value in law(0.0).scalars.items() if name not in known and "z0" not in name}
    for parameter, each in known.items():
        values |= {name: law(place).scalars[parameter] for name, place in zip(each.names, each.at, strict=True)}
    return {name: value for name, value in values.items() if name in fit.free_names}


def held(fit: hs.Identification, law: Callable[[float], Any]) -> list[bool]:
    """Whether each interval at 95 % holds the truth."""
    return [fit.intervals[name][0] <= value <= fit.intervals[name][1] for name, value in truths_of(fit, law).items()]


def one_seed(seed: int, supplies: tuple[float, ...]) -> dict[str, Any]:
    """All fits to one draw of the noise."""
    records = [measured(supply, seed) for supply in supplies]
    jointly, seconds = cpu_timed(hs.identify, structure(), records, depends=DEPENDS, fixed=FIXED)
    alone = [hs.identify(structure(), each, fixed=FIXED) for each in records]
    one_law = hs.identify(structure(), records, fixed=FIXED)
    above = int(np.searchsorted(supplies, LEFT_OUT))
    unknown = dataclasses.replace(measured(LEFT_OUT, seed), channels={}, units={})
    found = hs.estimate_channel(jointly, unknown, "supply", initial="rest")
    return {
        "fit": jointly,
        "alone": alone,
        "records": records,
        "seconds": seconds,
        "in the supply": error_percent(jointly.model.at(supply=LEFT_OUT)),
        "one law for all supplies": error_percent(one_law.model),
        "the law of the next supply": error_percent(alone[above - 1].model),
        "means of the next two laws": error_percent(averaged(alone[above - 1 : above + 1])),
        "held": held(jointly, damper),
        "supply": found.estimates["supply"],
        "supply_stderr": found.stderr["supply"],
        "n_parameters": {"in the supply": jointly.n_parameters, "one law for all supplies": one_law.n_parameters},
    }


def row(
    case: str, model: str, n_parameters: int, errors: list[float], holds: float | None, seconds: float | None
) -> Row:
    """A row of the table."""
    return {
        "case": case,
        "model": model,
        "n_parameters": n_parameters,
        **median_and_worst("error_percent", errors),
        "intervals_that_hold_percent": holds,
        "seconds_per_fit": seconds,
    }


def simulated(seeds: range, supplies: tuple[float, ...]) -> tuple[list[Row], dict[str, Any], dict[str, Any]]:
    """Rows of the simulated damper, numbers beside them, and the first draw for the figure."""
    draws = [one_seed(seed, supplies) for seed in seeds]
    holds = 100.0 * float(np.mean([each["held"] for each in draws]))
    seconds = float(np.median([each["seconds"] for each in draws]))
    rows = []
    for name in MODELS:
        beside = (holds, seconds) if name == "in the supply" else (None, None)
        n_parameters, errors = draws[0]["n_parameters"].get(name), [each[name] for each in draws]
        rows.append(row("simulated damper, a supply left out", name, n_parameters, errors, *beside))
    off = [(each["supply"] - LEFT_OUT) for each in draws]
    numbers = {
        "seeds": len(draws),
        "intervals": int(np.size([each["held"] for each in draws])),
        "supply_error_rms": float(np.sqrt(np.mean(np.square(off)))),
        "supply_error_in_stderr_rms": float(
            np.sqrt(np.mean([(o / each["supply_stderr"]) ** 2 for o, each in zip(off, draws, strict=True)]))
        ),
    }
    return rows, numbers, draws[0]


# ---------------------------------------------------------------------------------- a temperature along a record


def stack(T: float) -> hs.BoucWen:
    """The truth at a temperature [degC]: inputs in V, outputs in um."""
    return hs.BoucWen(beta=0.03 - 0.0002 * T, gamma=0.005, gain=-0.05 - 0.0005 * T, feedthrough=0.15)


def drifting(seed: int, n: int) -> hs.Record:
    """Triangles during which the stack warms up from 20 to 60 degC, and cools down by half of it."""
    u = hs.signals.triangle(0.0, 100.0, cycles=6, samples_per_cycle=n // 6)
    share = np.linspace(0.0, 1.0, u.size)
    T = 20.0 + 40.0 * np.interp(share, [0.0, 0.7, 1.0], [0.0, 1.0, 0.5])
    ends = (20.0, 60.0)
    polynomials = tuple(
        hs.ChannelPolynomial(parameter=name, channel="T", at=ends, values=[stack(T).scalars[name] for T in ends])
        for name in ON_TEMPERATURE
    )
    truth = hs.Dependent(law=stack(ends[0]), polynomials=polynomials)
    y = truth.response(u, channels={"T": T})
    noise = NOISE_OF_STACK * np.ptp(y) * np.random.default_rng(seed).standard_normal(u.size)
    return hs.Record(u=u, y=y + noise, channels={"T": T}, units={"u": "V", "y": "um", "T": "degC"})


def along(seeds: range, n: int) -> list[Row]:
    """Rows of the drifting temperature: errors at 40 degC against the truth there."""
    u = hs.signals.triangle(0.0, 100.0, cycles=2, samples_per_cycle=40)
    truth = stack(40.0).response(u)
    errors: dict[str, list[float]] = {"in the temperature": [], "one law for the record": []}
    holds, seconds, n_parameters = [], [], {}
    for seed in seeds:
        rec = drifting(seed, n)
        fit, cost = cpu_timed(hs.identify, hs.BoucWen, rec, depends=ON_TEMPERATURE, fixed=FIXED_OF_STACK)
        plain = hs.identify(hs.BoucWen, rec, fixed=FIXED_OF_STACK)
        holds.append(held(fit, stack))
        seconds.append(cost)
        for name, model in (("in the temperature", fit.model.at(T=40.0)), ("one law for the record", plain.model)):
            errors[name].append(100.0 * float(np.sqrt(np.mean((model.response(u) - truth) ** 2)) / np.ptp(truth)))
        n_parameters = {"in the temperature": fit.n_parameters, "one law for the record": plain.n_parameters}
    own = 100.0 * float(np.mean(holds)), float(np.median(seconds))
    return [
        row("temperature along a record", name, n_parameters[name], each, *beside)
        for (name, each), beside in zip(errors.items(), (own, (None, None)), strict=True)
    ]


# ---------------------------------------------------------------------------------- the measured damper


def recorded(folder: Path, name: str) -> hs.Record:
    """A file of the measured damper: displacement in mm, velocity, force in N, every 10 ms."""
    path = folder / f"data_simulation_{name}_MRdamper.mat"
    rec = hs.load(path, u="x_F[0]", y="x_F[2]", t=False, units={"u": "mm", "y": "N"}, name=name)[:N_MEASURED]
    supply = FILES[name]
    channels = {} if supply is None else {"supply": supply}
    return dataclasses.replace(rec, t=0.01 * np.arange(float(len(rec))), channels=channels)


def of_folder(folder: Path) -> tuple[list[Row], dict[str, Any]]:
    """Rows of the measured damper: errors of the range of the force, median and worst of both records."""
    records = [recorded(folder, name) for name in ("4.1", "4.2")]
    alone, seconds = cpu_timed(lambda: [hs.identify(structure(), each) for each in records])
    jointly, joint_seconds = cpu_timed(hs.identify, structure(), records, depends=MEASURED)
    residuals = np.split(jointly.residual, [len(records[0])])
    rms = {
        "in the supply": [float(np.sqrt(np.mean(each**2))) for each in residuals],
        "a law for each supply": [each.rmse for each in alone],
    }
    spans = [float(np.ptp(each.y)) for each in records]
    costs = (jointly.n_parameters, joint_seconds), (sum(each.n_parameters for each in alone), seconds)
    rows = []
    for (name, values), (n_parameters, taken) in zip(rms.items(), costs, strict=True):
        percent = [100.0 * value / span for value, span in zip(values, spans, strict=True)]
        rows.append(row("measured damper, 0 V and 0.88 V", name, n_parameters, percent, None, taken))
    unknown = recorded(folder, "4.4")
    found = hs.estimate_channel(jointly, unknown, "supply", bounds=(0.0, 2.0))
    own = hs.identify(structure(), unknown)
    total = [float(np.sqrt(np.mean(np.square(values)))) for values in rms.values()]
    numbers = {
        "rmse_in_the_supply": rms["in the supply"],
        "rmse_of_a_law_each": rms["a law for each supply"],
        "ratio_of_errors": total[0] / total[1],
        "ratio_by_record": [a / b for a, b in zip(*rms.values(), strict=True)],
        "supply_of_4_4": found.estimates["supply"],
        "supply_of_4_4_stderr": found.stderr["supply"],
        "rmse_of_4_4": found.rmse,
        "rmse_of_4_4_by_its_own_law": own.rmse,
    }
    return rows, numbers


# ---------------------------------------------------------------------------------- results


def main(smoke: bool = False, folder: Path | None = None) -> list[Row]:
    """Measure, and unless it is a smoke run write table, figure and JSON."""
    if smoke:
        return along(range(1), 36)
    rows, numbers, first = simulated(range(N_SEEDS), tuple(s for s in SUPPLIES if s != LEFT_OUT))
    rows += along(range(N_SEEDS), 360)
    numbers = {"simulated": numbers}
    if folder is not None:
        further, numbers["measured"] = of_folder(folder)
        rows += further
    write_results(RESULTS, rows, lambda _: draw(first), numbers)
    for row in rows:
        print(row)
    return rows


def draw(first: dict[str, Any]) -> Figure:
    """The gain and the shape against the supply, with the fits one by one and the truth."""
    canvas = figure(height=4.4)
    upper, lower = panels(canvas, 2)
    for ax, name, unit in ((upper, "bouc_wen.gain", "N/mm"), (lower, "bouc_wen.beta", "1/mm^2")):
        hs.plot.parameter(first["fit"], name, ax, one_by_one=first["alone"], records=first["records"], unit=unit)
        supplies = np.linspace(SUPPLIES[0], SUPPLIES[-1], 41)
        truth = [damper(supply).scalars[name] for supply in supplies.tolist()]
        ax.plot(supplies, truth, color="#D55E00", linestyle="dashed", label="truth")
        ax.axvline(LEFT_OUT, color="#777777", linewidth=0.8, linestyle="dotted")
    upper.legend()
    if legend := lower.get_legend():
        legend.remove()
    return canvas


if __name__ == "__main__":
    main(folder=Path(sys.argv[1]) if len(sys.argv) > 1 else None)
