"""How much hysteresis does a PID take away, and how much of what it leaves is lag?

For each bound on the maximum sensitivity the PID with the largest integral gain within it, at both extreme slopes of
Table 1's law (the design rule of Astrom, Panagopoulos and Hagglund, Automatica 34, 1998), follows the compensation
matrix's triangle at several frequencies: on the law alone, with creep, and with creep and the mode. `lag_share_percent`
is the width of the same loop with the law replaced by a line, over the closed loop's width: what is lag of all that is
left. The sensor's delay is there throughout, its noise is not.
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import loop_columns, words, write_results
from table1_actuator import FREQUENCY, HIGH, LIMITS, LOW, H, extreme_slopes, reference_plant

RESULTS = Path(__file__).parent / "results" / "pid_hysteresis"
BOUNDS = (1.2, 1.5, 2.0, 3.0, 5.0)
RATES = (1.0, 10.0, 50.0)  # Hz
STARTS = ((0.1, 1e-5), (0.1, 1e-3), (2.0, 1e-3), (2.0, 2e-2))  # kp, kd
HALVINGS = 24  # of 20 in log ki: to 1e-6, well below the tolerance of the search
FILTER = 2.0 * H  # of the derivative [s]

Row = dict[str, float | str | bool | None]


def plants() -> dict[str, hs.Actuator]:
    """The actuator, its stages added one by one."""
    whole = replace(reference_plant(), sensor=hs.Sensor(delay=H))
    creeping = replace(whole, vibration=None)
    return {"law": replace(creeping, creep=None), "law, creep": creeping, "law, creep, mode": whole}


def largest_integral(
    loop: hs.control.LinearLoop, slopes: tuple[float, float], bound: float, evaluations: int
) -> tuple[hs.PID, bool]:
    """The PID of the largest ki within the bound on the maximum sensitivity, and whether the search for it ended."""

    def within(pid: hs.PID) -> bool:
        return all(loop.max_sensitivity(pid, slope) <= bound for slope in slopes)

    def fastest(gains: np.ndarray) -> hs.PID:
        kp, kd = np.abs(gains)
        low, high = 0.0, 20.0  # log ki
        if not within(hs.PID(kp=kp, ki=1.0, kd=kd, derivative_filter=FILTER)):
            return hs.PID(kp=kp, kd=kd, derivative_filter=FILTER)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            pid = hs.PID(kp=kp, ki=float(np.exp(middle)), kd=kd, derivative_filter=FILTER)
            low, high = (middle, high) if within(pid) else (low, middle)
        return hs.PID(kp=kp, ki=float(np.exp(low)), kd=kd, derivative_filter=FILTER)

    options = {"maxfev": evaluations, "xatol": 1e-6, "fatol": 1e-4}  # of kp and kd, of log ki
    optima = [
        minimize(lambda gains: -np.log1p(fastest(gains).ki), start, method="Nelder-Mead", options=options)
        for start in STARTS
    ]
    best = min(optima, key=lambda each: each.fun)
    return fastest(best.x), bool(best.success)


def as_number(value: float | str | None) -> float:
    """A cell of the table, nan where it is empty."""
    return math.nan if value is None else float(value)


def main(smoke: bool = False) -> list[Row]:
    """Design, measure, print and write table, figure and result."""
    slopes = extreme_slopes(reference_plant())
    frequencies = np.union1d(np.geomspace(1.0, np.pi / H, 150), FREQUENCY * np.linspace(0.9, 1.1, 41))
    bounds, rates, cycles, evaluations = ((2.0,), (50.0,), 2, 3) if smoke else (BOUNDS, RATES, 10, 400)
    chosen = dict(list(plants().items())[:1]) if smoke else plants()
    rows: list[Row] = []
    for name, plant in chosen.items():
        loop = hs.control.LinearLoop(plant, H, frequencies)
        for bound in bounds:
            found, finished = largest_integral(loop, slopes, bound, evaluations)
            pid = replace(found, limits=LIMITS)
            for rate in rates:
                wave = {"low": LOW, "high": HIGH, "period": 1.0 / rate, "sample_time": H, "cycles": cycles}
                loops = hs.control.assess_hysteresis(plant, pid, **wave)
                reduction = loops.hysteresis_reduction_percent if loops.loop.stable else None
                rows.append(
                    {
                        "plant": name,
                        "max_sensitivity": bound,
                        "frequency_hz": rate,
                        "hysteresis_reduction_percent": reduction,
                        "lag_share_percent": 100.0 * loops.lag_width / loops.closed_width,
                        "open_width_um": loops.open_width,
                        "closed_width_um": loops.closed_width,
                        "lag_width_um": loops.lag_width,
                        **loop_columns(loops.loop),
                        "kp": pid.kp,
                        "ki": pid.ki,
                        "kd": pid.kd,
                        "search_finished": finished,
                    }
                )
    for row in rows:
        print(
            f"{row['plant']:<17} sensitivity {row['max_sensitivity']:3.1f}, {row['frequency_hz']:4.0f} Hz: "
            f"{as_number(row['hysteresis_reduction_percent']):7.2f} %, of the rest {row['lag_share_percent']:5.1f} % "
            f"lag; kp {row['kp']:.3g}, ki {row['ki']:.3g}, kd {row['kd']:.3g}; {words(row)}"
        )
    return write_results(RESULTS, rows, draw, {"derivative_filter_s": FILTER}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """Width that is left against the maximum sensitivity, a panel for each plant."""
    canvas = figure(height=3.2)
    names = list(dict.fromkeys(row["plant"] for row in rows))
    for ax, name in zip(canvas.subplots(1, len(names), sharey=True), names, strict=True):
        for k, rate in enumerate(RATES):
            line = [row for row in rows if (row["plant"], row["frequency_hz"]) == (name, rate)]
            bounds = [row["max_sensitivity"] for row in line]
            left = [100.0 - as_number(row["hysteresis_reduction_percent"]) for row in line]
            lag = [value * float(row["lag_share_percent"]) / 100.0 for value, row in zip(left, line, strict=True)]
            ax.plot(bounds, left, "o-", color=f"C{k}", markersize=4, label=f"{rate:g} Hz")
            ax.plot(bounds, lag, ":", color=f"C{k}", label="of it lag" if k == 0 else None)
        ax.set(yscale="log", title=name, xlabel="Maximum sensitivity")
    canvas.axes[0].set_ylabel("Width left [%]")
    canvas.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return canvas


if __name__ == "__main__":
    main()
