"""Up to which rate does compensation hold?

The compensation matrix's actuator follows a sine from 0.1 to 2.5 um: a triangle has no meaning beyond a fraction of the
resonance, whose corners no controller follows. At least ten cycles and half a second, of which the last cycle is
measured. The open loop's width grows with the rate, since its lag opens the loop too; what is left in closed loop is
told by the rms error, too. Below the resonance's tenth the widths are hysteresis and creep, above it they are lag.
"""

import math
import sys
from pathlib import Path

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import loop_columns, open_loop_columns, words, write_results
from table1_actuator import HIGH, LOW, H, controllers, reference_plant

RESULTS = Path(__file__).parent / "results" / "rate_sweep"
FREQUENCIES = (0.1, 0.5, 1.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 250.0, 400.0, 500.0)  # Hz
SHOWN = ("PID", "inverse + creep inverse", "... + PID", "... + PID + mode-inverse + preview", "model-following")

Row = dict[str, float | str | bool | None]


def rows_at(frequency: float, chosen: dict[str, hs.TrackingController], lasting: float) -> list[Row]:
    """The measures of the open loop and of every controller at one frequency."""
    plant, samples = reference_plant(), round(1.0 / (frequency * H))
    cycles = max(10, math.ceil(lasting * frequency))
    phase = 2.0 * math.pi * np.arange(cycles * samples + 1) / samples
    reference = 0.5 * (LOW + HIGH) - 0.5 * (HIGH - LOW) * np.cos(phase)
    opened = hs.control.open_loop(plant, reference, H, samples)
    rms = float(hs.metrics.rmse(opened.cycle, opened.last(opened.y)))
    beside = open_loop_columns(samples * H, rms)
    rows = [row("open loop", frequency, 0.0, opened.last(opened.u), beside)]
    for name, controller in chosen.items():
        loop = hs.control.assess_loop(plant, controller, opened.t, reference, period=samples * H)
        reduction = opened.reduction_percent(loop.closed.y) if loop.stable else None
        rows.append(row(name, frequency, reduction, opened.last(loop.closed.u), loop_columns(loop)))
    return rows


def row(name: str, frequency: float, reduction: float | None, u: np.ndarray, columns: Row) -> Row:
    """One loop at one frequency."""
    return {
        "controller": name,
        "frequency_hz": frequency,
        "hysteresis_reduction_percent": reduction,
        **columns,
        "peak_voltage": float(u.max()),
    }


def shown(row: Row) -> str:
    """The reduction as it is printed."""
    reduction = row["hysteresis_reduction_percent"]
    return "no" if reduction is None else f"{float(reduction):.2f}"


def main(smoke: bool = False) -> list[Row]:
    """Sweep, print and write table, figure and result."""
    known = controllers(reference_plant())
    chosen = {name: known[name] for name in (SHOWN[-1:] if smoke else SHOWN)}
    frequencies, lasting = ((100.0, 500.0), 0.1) if smoke else (FREQUENCIES, 0.5)
    rows = [each for frequency in frequencies for each in rows_at(frequency, chosen, lasting)]
    for each in rows:
        print(
            f"{each['frequency_hz']:6.1f} Hz {each['controller']:<36} {shown(each):>8} %, "
            f"rms {1e3 * float(each['tracking_rms_um']):8.2f} nm, {each['peak_voltage']:6.1f} V; {words(each)}"
        )
    return write_results(RESULTS, rows, draw, {"low_um": LOW, "high_um": HIGH}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """What is left of the loop's width, rms error and peak voltage, against the frequency."""
    canvas = figure(height=6.5)
    for ax, key, label in zip(
        canvas.subplots(3, 1, sharex=True),
        ("hysteresis_reduction_percent", "tracking_rms_um", "peak_voltage"),
        ("Width left [%]", "Rms error [um]", "Peak voltage [V]"),
        strict=True,
    ):
        for name in ("open loop", *SHOWN):
            line = [each for each in rows if each["controller"] == name]
            known = [math.nan if each[key] is None else float(each[key]) for each in line]
            values = [100.0 - value if "percent" in key else value for value in known]
            ax.plot([each["frequency_hz"] for each in line], values, "o-", markersize=3, label=name)
        ax.set(xscale="log", yscale="linear" if key == "peak_voltage" else "log", ylabel=label)
    ax.set_xlabel("Frequency of the reference [Hz]")
    canvas.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return canvas


if __name__ == "__main__":
    main()
