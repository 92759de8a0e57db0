"""What does the model of a damper lose without its dashpot, where it has to run faster or slower than it was fitted?

The truth is a magnetorheological damper as structural engineers write it: Bouc-Wen's law, a dashpot and a spring side
by side. It is driven to and fro at 1 Hz, and its force is measured with noise of 1 % of the range. The law alone, the
dashpot with the spring, and all of them are identified from that record, and asked for the force at other rates.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "dashpot"
TRUTH = hs.BoucWen(beta=0.6, gamma=0.2, gain=60.0) + hs.Dashpot(c=0.8) + hs.Line(offset=-5.0, slope=1.5)
AMPLITUDE = 12.0  # [mm]
NOISE = 0.01  # of the range
FITTED_AT = 1.0  # [Hz]
RATES = (0.25, 0.5, 1.0, 2.0, 4.0)  # [Hz]
SAMPLES, CYCLES = 100, 3
MODELS = {
    "the law alone": hs.BoucWen,
    "dashpot and spring": hs.Sum.structure(hs.Dashpot, hs.Line),
    "law, dashpot and spring": hs.Sum.structure(hs.BoucWen, hs.Dashpot, hs.Line),
}
Row = dict[str, Any]


def motion(rate: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times [s] and a sine [mm] at a rate [Hz]."""
    phase = np.arange(CYCLES * SAMPLES) / SAMPLES
    return phase / rate, AMPLITUDE * np.sin(2.0 * np.pi * phase)


def measured() -> hs.Record:
    """The record to fit."""
    t, u = motion(FITTED_AT)
    y = hs.simulate(TRUTH, t, u).y
    noise = NOISE * np.ptp(y) * np.random.default_rng(0).standard_normal(u.size)
    return hs.Record(u=u, y=y + noise, t=t, units={"u": "mm", "y": "N", "t": "s"}, name="measured")


def fits(record: hs.Record) -> dict[str, hs.Identification]:
    """The models on the record, with n = 1 as is usual for dampers."""
    fixed = {"the law alone": {"n": 1.0}, "law, dashpot and spring": {"bouc_wen.n": 1.0}}
    return {name: hs.identify(model, record, fixed=fixed.get(name, {})) for name, model in MODELS.items()}


def row(name: str, fit: hs.Identification, rate: float) -> Row:
    """Root mean square error of the force in percent of its range, without noise."""
    t, u = motion(rate)
    wanted = hs.simulate(TRUTH, t, u).y
    error = hs.simulate(fit.model, t, u).y - wanted
    return {
        "model": name,
        "parameters": fit.n_parameters,
        "rate_hz": rate,
        "error_percent": float(100.0 * np.sqrt(np.mean(error**2)) / np.ptp(wanted)),
    }


def main(smoke: bool = False) -> list[Row]:
    """Fit at one rate and predict at the others; print the table and write it."""
    record = measured()
    found = fits(record)
    rows = [row(name, fit, rate) for name, fit in found.items() for rate in (RATES[:1] if smoke else RATES)]
    for line in rows:
        print(f"{line['model']:>24} at {line['rate_hz']:g} Hz: {line['error_percent']:.2f} % of the range")
    return write_results(
        RESULTS, rows, lambda _: draw(record, found), {"noise": NOISE, "fitted_at_hz": FITTED_AT}, smoke=smoke
    )


def draw(record: hs.Record, found: dict[str, hs.Identification]) -> Figure:
    """The force against displacement and velocity, as measured and by each model."""
    canvas = figure(height=3.6)
    left, right = canvas.subplots(1, 2, sharey=True)
    last = slice(-SAMPLES, None)
    velocity = hs.Dashpot(c=1.0).response(record.u, record.sample_time)
    for x, ax, name in ((record.u, left, "Displacement [mm]"), (velocity, right, "Velocity [mm/s]")):
        ax.plot(x[last], record.y[last], ".", color="#777777", markersize=4, label="measured")
        for model, colour, style in zip(found, ("#E69F00", "#0072B2", "#D55E00"), ("--", ":", "-"), strict=True):
            y = hs.simulate(found[model].model, record.t, record.u).y
            ax.plot(x[last], y[last], style, color=colour, label=model)
        ax.set(xlabel=name)
    left.set(ylabel="Force [N]")
    canvas.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)
    return canvas


if __name__ == "__main__":
    main()
