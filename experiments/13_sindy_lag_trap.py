"""Is a law found at one rate hysteresis? The loops of a published lag, and of a Bouc-Wen law, at other rates.

A published sparse model of a piezoelectric loop, identified at 1 Hz, is a linear lag: its loop is 15.2 % of the stroke
wide at 1 Hz, 10.0 % at 0.1 Hz and 2.7 % at 10 Hz. Under a sine a plant of one pole and one zero has a loop that is

    sin(atan(omega tau_1) - atan(omega tau_2))

wide; the first two widths give both times, and the third is then 1.8 %. Both this plant and a Bouc-Wen law of the same
width at 1 Hz are measured with 1 % noise, under a sine or a triangle of 1 Hz alone, and under sines of 1 Hz and 10 Hz.
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "sindy_lag_trap"
PUBLISHED = {0.1: 0.100, 1.0: 0.152, 10.0: 0.027}  # relative width by frequency [Hz]
CASES = (("sine", (1.0,)), ("triangle", (1.0,)), ("sine", (1.0, 10.0)))  # waveform, and frequency of each record [Hz]
CYCLES, SAMPLES_PER_CYCLE, NOISE = 4, 100, 0.01
Row = dict[str, float | str | None]


def published_lag() -> hs.TransferFunction:
    """The plant of one pole and one zero that has the published widths at 0.1 and 1 Hz.

    tan(phase) = omega d / (1 + omega^2 p), with d = tau_1 - tau_2 and p = tau_1 tau_2, is linear in both.
    """
    omega = 2.0 * np.pi * np.array([0.1, 1.0])
    tangents = np.tan(np.arcsin([PUBLISHED[0.1], PUBLISHED[1.0]]))
    difference, product = np.linalg.solve(np.stack([omega, -tangents * omega**2], axis=1), tangents)
    slower = 0.5 * difference + math.sqrt(0.25 * difference**2 + product)
    return hs.TransferFunction(num=(slower - difference, 1.0), den=(slower, 1.0), hold="foh")


def law_of_width(width: float) -> hs.BoucWen:
    """A Bouc-Wen law with a loop of this relative width between -1 and 1."""

    def wide(gain: float) -> hs.BoucWen:
        return hs.BoucWen(beta=1.5, gamma=0.4, feedthrough=1.0, gain=-gain)

    u = hs.signals.sine(1.0, cycles=4, samples_per_cycle=400)
    gain = brentq(lambda g: hs.loop_metrics(u, wide(g).response(u)).relative_width - width, 0.0, 0.9)
    return wide(gain)


def records(plant: hs.TransferFunction | hs.BoucWen, waveform: str, frequencies: Sequence[float]) -> list[hs.Record]:
    """What is measured of the plant under a sine or a triangle of each frequency."""
    shape = {"cycles": CYCLES, "samples_per_cycle": SAMPLES_PER_CYCLE}
    u = hs.signals.sine(1.0, **shape) if waveform == "sine" else hs.signals.triangle(-1.0, 1.0, **shape)
    found = []
    for seed, frequency in enumerate(frequencies):
        t = np.arange(u.size) / (SAMPLES_PER_CYCLE * frequency)
        y = response(plant, u, float(t[1]))
        noise = NOISE * y.std() * np.random.default_rng(seed).standard_normal(u.size)
        found.append(hs.Record(t=t, u=u, y=y + noise, name=f"{frequency:g} Hz"))
    return found


def response(plant: hs.TransferFunction | hs.BoucWen, u: np.ndarray, sample_time: float) -> np.ndarray:
    """The plant's output."""
    return plant.response(u) if isinstance(plant, hs.BoucWen) else plant.response(u, sample_time)


def main(smoke: bool = False) -> list[Row]:
    """Discover both plants at one rate and at two, and unless it is a smoke run write table, figure and result."""
    lag = published_lag()
    plants = {"published lag": lag, "Bouc-Wen": law_of_width(PUBLISHED[1.0])}
    rows: list[Row] = []
    for name, plant in list(plants.items())[: 1 if smoke else 2]:
        for waveform, frequencies in CASES[:1] if smoke else CASES:
            found = hs.discover(records(plant, waveform, frequencies), degree=1 if smoke else None)
            rows.append(row(name, waveform, frequencies, found))
            held_out = found.judgement.held_out
            print(
                f"{name:14} {waveform:8} {' and '.join(f'{f:g}' for f in frequencies):9} Hz  {found.verdict:30} "
                f"held out: law {held_out['law']:.4f}, rival {held_out['rival']:.4f}; widths at 0.1, 1, 10 Hz: law "
                f"{_percent(found, 'law')}, rival {_percent(found, 'rival')} %; {found.equation}"
            )
    numbers = {
        "zero_time": lag.num[0],
        "pole_time": lag.den[0],
        "published_widths": list(PUBLISHED.values()),
        "lag_widths": [width(lag, frequency) for frequency in PUBLISHED],
        "bouc_wen_widths": [width(plants["Bouc-Wen"], frequency) for frequency in PUBLISHED],
    }
    return write_results(RESULTS, rows, draw, numbers, smoke=smoke)


def _percent(found: hs.Discovery, who: str) -> str:
    return " ".join(f"{100.0 * width:.1f}" for width in found.judgement.widths[who])


def row(name: str, waveform: str, frequencies: Sequence[float], found: hs.Discovery) -> Row:
    """A line of the table; the widths are at 0.1, 1 and 10 times 1 Hz, the rate of the first record."""
    judged = found.judgement
    widths = {
        f"{who}_width_at_{rate:g}": float(width)
        for who in ("law", "rival")
        for rate, width in zip(judged.rates, judged.widths[who], strict=True)
    }
    return {
        "plant": name,
        "waveform": waveform,
        "frequencies_hz": " ".join(f"{frequency:g}" for frequency in frequencies),
        "verdict": found.verdict,
        "equation": found.equation,
        "rate_spread": judged.rate_spread,
        "law_held_out": judged.held_out["law"],
        "rival_held_out": judged.held_out["rival"],
        "rival_poles": judged.rival.order if judged.rival is not None else None,
        **widths,
    }


def loop(plant: hs.TransferFunction | hs.BoucWen, frequency: float) -> hs.LoopMetrics:
    """The steady loop under a sine."""
    u = hs.signals.sine(1.0, cycles=60, samples_per_cycle=400)
    return hs.loop_metrics(u, response(plant, u, 1.0 / (400 * frequency)))


def width(plant: hs.TransferFunction | hs.BoucWen, frequency: float) -> float:
    """Relative width of the steady loop."""
    return loop(plant, frequency).relative_width


def draw(rows: list[Row]) -> Figure:
    """Above, the departure of the loops from their chord at three rates; below, the widths over the rate."""
    canvas = figure(height=5.4)
    plants = {"published lag": published_lag(), "Bouc-Wen": law_of_width(PUBLISHED[1.0])}
    colours = {0.1: "#56B4E9", 1.0: "#222222", 10.0: "#D55E00"}
    dashes = {0.1: "-", 1.0: (0, (5, 1.5)), 10.0: (0, (1.5, 1.5))}
    axes = canvas.subplots(2, 2)
    for top, (name, plant) in zip(axes[0], plants.items(), strict=True):
        for frequency in PUBLISHED:
            found = loop(plant, frequency)
            style = {"color": colours[frequency], "linestyle": dashes[frequency]}
            middle = 0.5 * (found.loading + found.unloading)
            path_u = np.append(found.u, found.u[::-1])
            path_y = np.append(found.loading - middle, (found.unloading - middle)[::-1]) / found.stroke
            top.plot(path_u, 100.0 * path_y, label=f"{frequency:g} Hz", **style)
        top.set(title=name, xlabel="Input", ylim=(-12.0, 9.5))
    axes[0, 0].set_ylabel("Branch less mean [% of stroke]")
    axes[0, 0].legend(ncols=3, loc="lower center", columnspacing=0.8, handlelength=1.6)
    grid = np.geomspace(0.05, 20.0, 41)
    for bottom, (name, plant) in zip(axes[1], plants.items(), strict=True):
        bottom.semilogx(grid, [100.0 * width(plant, f) for f in grid], color="#999999", label="truth")
        two = next(r for r in rows if r["plant"] == name and " " in str(r["frequencies_hz"]))
        for who, mark, colour in (("law", "o", "#0072B2"), ("rival", "D", "#E69F00")):
            values = [100.0 * float(two[f"{who}_width_at_{f:g}"] or 0.0) for f in PUBLISHED]
            bottom.semilogx(
                list(PUBLISHED), values, mark, color=colour, label="law" if who == "law" else "linear rival"
            )
        if name == "published lag":
            bottom.semilogx(*zip(*[(f, 100.0 * w) for f, w in PUBLISHED.items()], strict=True), "x", color="#222222",
                            label="published")  # fmt: skip
        bottom.set(title=f'"{two["verdict"]}"', xlabel="Frequency [Hz]", ylim=(0.0, None))
    axes[1, 0].set_ylabel("Relative loop width [%]")
    canvas.legend(*axes[1, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return canvas


if __name__ == "__main__":
    main()
