"""Is the verdict of `discover` right on records that are made to mislead it?

One hundred records whose truth is known: curves without memory, linear dynamics and drift, hysteresis. They are driven
by triangles, sines, sums of sines and fading sines, at one rate or at two, with 0 to 10 % of noise. A verdict is wrong

- if a curve, linear dynamics or a drift is called hysteresis,
- if hysteresis is not called that at two rates, or is called anything but "cannot be told from one rate" at one,
- if two rates are called "cannot be told from one rate".

The first set of records was looked at while the limits of the judgement were chosen. The second one has other numbers
in every record, other rates and other samplings; it was run once, after the limits were fixed.
"""

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import cpu_timed, write_results

RESULTS = Path(__file__).parent / "results" / "adversarial_records"
HYSTERESIS, LAG, ONE_RATE, NONE = (
    "rate-independent hysteresis",
    "linear lag",
    "cannot be told from one rate",
    "no structure found",
)
CYCLES = 4
WORKERS = 2
SMOKE = (24, 86)  # a curve at one rate, and a Bouc-Wen law at two
Array = np.ndarray
Plant = Callable[[Array, float], Array]  # output at the samples of an input, from the input and the sample time [s]
Row = dict[str, float | str | bool]


@dataclass(frozen=True)
class Set:
    """What differs between the records that the limits were chosen with and those that were held back."""

    name: str
    seed: int
    rates: tuple[float, float]  # [Hz]
    samples_per_cycle: int


SETS = (Set("seen", 0, (1.0, 5.0), 60), Set("held back", 5000, (0.5, 2.0), 48))


@dataclass(frozen=True)
class Case:
    """One record, or one at each rate, and what is true of it."""

    kind: str
    group: str
    waveform: str
    n_rates: int
    noise: float  # share of the output's standard deviation
    seed: int

    @property
    def right(self) -> tuple[str, ...]:
        """The verdicts that are right."""
        if self.group == "curve":
            return (NONE,)
        if self.group == "linear":
            return (NONE, LAG) if self.n_rates > 1 else (NONE, LAG, ONE_RATE)
        return (HYSTERESIS,) if self.n_rates > 1 else (ONE_RATE,)

    def records(self, chosen: Set) -> list[hs.Record]:
        """The records, a plant and an input drawn from the seed."""
        rng = np.random.default_rng((chosen.seed, self.seed))
        plant = PLANTS[self.kind](rng)
        path = WAVEFORMS[self.waveform](rng, chosen.samples_per_cycle)
        found = []
        for rate in chosen.rates[: self.n_rates]:
            t = np.arange(path.size) / (chosen.samples_per_cycle * rate)
            y = plant(path, float(t[1]))
            noisy = y + self.noise * y.std() * rng.standard_normal(y.size)
            found.append(hs.Record(u=path, y=noisy, t=t, name=f"{rate:g} Hz"))
        return found


def _curve(function: Callable[[Array], Array]) -> Callable[[np.random.Generator], Plant]:
    """A plant that shows a function of the input, shifted and scaled at random."""

    def made(rng: np.random.Generator) -> Plant:
        shift, gain = rng.uniform(-0.2, 0.2), rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 2.0)
        return lambda u, step: gain * function(u + shift)

    return made


def _delay(rng: np.random.Generator) -> Plant:
    return _linear(hs.TransferFunction(num=(1.0,), den=(1.0,), delay=rng.uniform(0.01, 0.04), hold="foh"))


def _lag(rng: np.random.Generator) -> Plant:
    tau = rng.uniform(0.02, 0.1)
    return _linear(hs.TransferFunction(num=(rng.uniform(0.0, 0.5) * tau, 1.0), den=(tau, 1.0), hold="foh"))


def _resonance(rng: np.random.Generator) -> Plant:
    omega, zeta = 2.0 * np.pi * rng.uniform(4.0, 12.0), rng.uniform(0.05, 0.5)
    return _linear(hs.TransferFunction(num=(omega**2,), den=(1.0, 2.0 * zeta * omega, omega**2), hold="foh"))


def _creep(rng: np.random.Generator) -> Plant:
    times = np.geomspace(0.01, 100.0, 9)
    weights = rng.uniform(0.02, 0.08) * np.ones(9)
    parts = [
        hs.TransferFunction(num=(float(weight),), den=(float(tau), 1.0), hold="foh")
        for tau, weight in zip(times, weights, strict=True)
    ]
    return lambda u, step: u + sum(part.response(u - u[0], step) for part in parts)


def _drift(rng: np.random.Generator) -> Plant:
    """A line or a curve, and a trend that is straight, bends, or wanders."""
    size, bend, kind = rng.uniform(0.1, 0.4), rng.uniform(0.0, 1.5), rng.integers(3)
    wander = np.random.default_rng(rng.integers(1 << 30))

    def plant(u: Array, step: float) -> Array:
        part = np.linspace(0.0, 1.0, u.size)
        steps = np.cumsum(wander.standard_normal(u.size)) / np.sqrt(u.size)
        return np.tanh(bend * u) / bend + size * (part, 1.0 - np.exp(-3.0 * part), 0.5 * steps)[kind]

    return plant


def _linear(transfer: hs.TransferFunction) -> Plant:
    return lambda u, step: transfer.response(u - u[0], step)


def _of(law: hs.Play | hs.PrandtlIshlinskii | hs.Preisach | hs.BoucWen) -> Plant:
    return lambda u, step: law.response(u)


def _backlash(rng: np.random.Generator) -> Plant:
    return _of(hs.Play(threshold=rng.uniform(0.05, 0.4), gain=rng.uniform(0.5, 2.0)))


def _prandtl_ishlinskii(rng: np.random.Generator) -> Plant:
    thresholds = tuple(np.linspace(0.0, 0.8, 6).tolist())
    return _of(hs.PrandtlIshlinskii(thresholds=thresholds, weights=(0.6, *rng.uniform(0.02, 0.25, 5).tolist())))


def _preisach(rng: np.random.Generator) -> Plant:
    levels = np.linspace(-1.0, 1.0, 9)
    near = np.array([1.0 / (1 + i - j) for i in range(8) for j in range(i + 1)])
    weights = near * rng.uniform(0.0, 1.0, near.size)
    return _of(hs.Preisach(levels=tuple(levels.tolist()), weights=tuple(weights.tolist()), z0=(-1.0, 0.0)))


def _bouc_wen(rng: np.random.Generator) -> Plant:
    return _of(_a_bouc_wen(rng))


def _a_bouc_wen(rng: np.random.Generator) -> hs.BoucWen:
    return hs.BoucWen(
        beta=rng.uniform(0.8, 2.5),
        gamma=rng.uniform(-0.5, 0.5),
        n=float(rng.choice([1.0, 1.5, 2.0])),
        feedthrough=rng.uniform(0.5, 1.0),
        gain=rng.uniform(-0.5, -0.2),
    )


def _two_laws(rng: np.random.Generator) -> Plant:
    first, second = _a_bouc_wen(rng), hs.Play(threshold=rng.uniform(0.1, 0.5), gain=rng.uniform(0.2, 0.6))
    return lambda u, step: first.response(u) + second.response(u)


CURVES: dict[str, Callable[[Array], Array]] = {
    "relu": lambda u: np.maximum(u, 0.0),
    "dead zone": lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.3, 0.0),
    "saturation": lambda u: np.clip(u, -0.5, 0.5),
    "tanh": lambda u: np.tanh(3.0 * u),
    "cubic": lambda u: u**3 + 0.2 * u,
    "absolute value": np.abs,
    "parabola": lambda u: u**2 + 0.5 * u,
    "staircase": lambda u: np.round(4.0 * u) / 4.0,
    "exponential": lambda u: np.exp(1.5 * u),
    "wave": lambda u: u + 0.3 * np.sin(6.0 * u),
}
LINEAR = {"delay": _delay, "lag": _lag, "resonance": _resonance, "creep": _creep, "drift": _drift}
HYSTERETIC = {
    "backlash": _backlash,
    "Prandtl-Ishlinskii": _prandtl_ishlinskii,
    "Preisach": _preisach,
    "Bouc-Wen": _bouc_wen,
    "two laws in parallel": _two_laws,
}
PLANTS = {kind: _curve(function) for kind, function in CURVES.items()} | LINEAR | HYSTERETIC


def _sum_of_sines(rng: np.random.Generator, samples: int) -> Array:
    phase = 2.0 * np.pi * np.arange(CYCLES * samples + 1) / samples
    parts = [
        np.sin(factor * phase + shift) for factor, shift in zip((0.5, 1.0, 1.75), rng.uniform(0, 6, 3), strict=True)
    ]
    u = np.sum(parts, axis=0)
    return u / np.abs(u).max()


def _fading_triangle(rng: np.random.Generator, samples: int) -> Array:
    """A triangle of falling amplitude at one rate."""
    levels = [1.0, -0.9, 0.8, -0.7, 0.6, -0.5, 0.4]
    return hs.signals.extremes([0.0, *levels], max_step=4.0 / samples)


WAVEFORMS: dict[str, Callable[[np.random.Generator, int], Array]] = {
    "triangle": lambda rng, n: hs.signals.triangle(-1.0, 1.0, cycles=CYCLES, samples_per_cycle=n),
    "sine": lambda rng, n: hs.signals.sine(1.0, cycles=CYCLES, samples_per_cycle=n),
    "sum of sines": _sum_of_sines,
    "fading sine": lambda rng, n: hs.signals.decaying_sine(1.0, cycles=CYCLES + 2, samples_per_cycle=n),
    "fading triangle": _fading_triangle,
}
PLANS = {  # waveform, number of rates and noise of the records of each kind
    "curve": (("triangle", 1, 0.02), ("sine", 2, 0.0), ("sum of sines", 2, 0.1)),
    "linear": (
        ("sine", 1, 0.01),
        ("fading triangle", 1, 0.0),
        ("triangle", 2, 0.0),
        ("sine", 2, 0.02),
        ("sum of sines", 2, 0.05),
        ("fading sine", 2, 0.1),
    ),
    "hysteretic": (
        ("triangle", 1, 0.0),
        ("sine", 1, 0.05),
        ("triangle", 2, 0.0),
        ("sine", 2, 0.01),
        ("sum of sines", 2, 0.03),
        ("fading sine", 2, 0.05),
        ("triangle", 2, 0.1),
        ("sum of sines", 2, 0.1),
    ),
}


def cases() -> list[Case]:
    """The hundred records; the waveforms of the curves differ from kind to kind."""
    groups: dict[str, list[str]] = {"curve": list(CURVES), "linear": list(LINEAR), "hysteretic": list(HYSTERETIC)}
    found: list[Case] = []
    turned = {"triangle": "sine", "sine": "fading sine", "sum of sines": "triangle"}
    for group, kinds in groups.items():
        for k, kind in enumerate(kinds):
            for waveform, n_rates, noise in PLANS[group]:
                odd = group == "curve" and k % 2 == 1
                found.append(Case(kind, group, turned[waveform] if odd else waveform, n_rates, noise, len(found)))
    return found


def row(case: Case, chosen: Set, degree: int | None = None) -> Row:
    """One line of the table."""
    records = case.records(chosen)
    found, seconds = cpu_timed(hs.discover, records, degree=degree)  # of this process, whatever else the machine does
    return {
        "set": chosen.name,
        "kind": case.kind,
        "group": case.group,
        "waveform": case.waveform,
        "rates": case.n_rates,
        "noise_percent": 100.0 * case.noise,
        "verdict": found.verdict,
        "right": " or ".join(case.right),
        "is_right": found.verdict in case.right,
        "route": found.route,
        "fit_percent": found.scores["fit_percent"],
        "warnings": " ".join(found.warnings),
        "cpu_seconds": seconds,
    }


def main(smoke: bool = False) -> list[Row]:
    """Discover from every record of both sets, and unless it is a smoke run write table, figure and result.

    A smoke run is of a few records, whose verdicts must be right.
    """
    chosen = [case for case in cases() if not smoke or case.seed in SMOKE]
    jobs = [(case, each) for each in ([replace(SETS[0], samples_per_cycle=12)] if smoke else SETS) for case in chosen]
    if smoke:
        rows = [row(*job, degree=1) for job in jobs]
    else:
        with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
            rows = list(pool.map(row, *zip(*jobs, strict=True)))
    wrong = [line for line in rows if not line["is_right"]]
    for line in wrong:
        print(f"wrong: {line['set']}, {line['kind']}, {line['waveform']}, {line['rates']} rates: {line['verdict']}")
    numbers = summary(rows)
    if smoke and wrong:
        raise AssertionError(f"{len(wrong)} of {len(rows)} verdicts are wrong")
    return write_results(RESULTS, rows, draw, {"sets": numbers}, smoke=smoke)


def summary(rows: Sequence[Row]) -> dict[str, dict[str, float]]:
    """For each set: records, right verdicts, each kind of wrong one, and the time of the processor for one record."""
    found = {}
    for name in dict.fromkeys(str(line["set"]) for line in rows):
        own = [line for line in rows if line["set"] == name]
        hysteretic = [line for line in own if line["group"] == "hysteretic"]
        seconds = [float(line["cpu_seconds"]) for line in own]
        found[name] = {
            "records": len(own),
            "right": sum(bool(line["is_right"]) for line in own),
            "called hysteresis": sum(line["verdict"] == HYSTERESIS for line in own if line not in hysteretic),
            "hysteresis lost": sum(not line["is_right"] for line in hysteretic),
            "cannot tell at two rates": sum(line["verdict"] == ONE_RATE and line["rates"] == 2 for line in own),
            "median_cpu_seconds": float(np.median(seconds)),
            "largest_cpu_seconds": max(seconds),
        }
    return found


def draw(rows: list[Row]) -> Figure:
    """Each record as a cell in the colour of its verdict; wrong ones are crossed out."""
    canvas = figure(width=7.2, height=5.4)
    colours = {HYSTERESIS: "#E69F00", LAG: "#56B4E9", ONE_RATE: "#CCCCCC", NONE: "#F0E442"}
    kinds, names = list(PLANTS), list(dict.fromkeys(line["set"] for line in rows))
    for axes, name in zip(np.ravel(canvas.subplots(1, len(names), sharey=True)), names, strict=True):
        own = [line for line in rows if line["set"] == name]
        for place, kind in enumerate(kinds):
            for k, line in enumerate(line for line in own if line["kind"] == kind):
                axes.add_patch(Rectangle((k + 0.04, place - 0.46), 0.92, 0.92, color=colours[str(line["verdict"])]))
                label = f"{line['noise_percent']:g} %" + ("\n2 rates" if line["rates"] == 2 else "\n1 rate")
                axes.text(k + 0.5, place, label, ha="center", va="center", fontsize=4.5, linespacing=0.9)
                if not line["is_right"]:
                    axes.plot([k + 0.1, k + 0.9], [place - 0.4, place + 0.4], color="#D00000", linewidth=2.0)
                    axes.plot([k + 0.1, k + 0.9], [place + 0.4, place - 0.4], color="#D00000", linewidth=2.0)
        right = sum(bool(line["is_right"]) for line in own)
        axes.set(title=f"{name}: {right} of {len(own)} right", xlim=(0, 8), ylim=(-0.6, len(kinds) - 0.4), xticks=[])
        axes.set(yticks=range(len(kinds)), yticklabels=kinds)
        axes.tick_params(length=0)
        axes.grid(visible=False)
        axes.spines[:].set_visible(False)
        for border in (len(CURVES), len(CURVES) + len(LINEAR)):
            axes.axhline(border - 0.5, color="black", linewidth=0.8)
    axes.invert_yaxis()
    handles: list[Artist] = [Patch(color=colour, label=verdict) for verdict, colour in colours.items()]
    handles.append(Line2D([], [], color="#D00000", marker="x", linestyle="", label="wrong verdict"))
    canvas.legend(handles=handles, loc="outside lower center", ncols=3)
    return canvas


if __name__ == "__main__":
    main()
