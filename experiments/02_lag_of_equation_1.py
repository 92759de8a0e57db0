"""How much of equation (1)'s lag can a PID take away, and what does it cost in robustness?

The paper says that its PID on equation (1) reduces the hysteresis by 90 %. (1) has none: its loop on a
triangle is lag. For each bound on the maximum sensitivity max |1 / (1 + L)| a global search over Kp, Ti, Td,
the derivative's filter and weight and the setpoint weight looks for the PID that leaves the narrowest loop,
within 0 to 125 V, sampled every 10 ms. Commonly at most 2 is allowed. Unstable loops are left out: between
the limits of the voltage some of them run along the triangle in a limit cycle, 89 % narrower.
"""

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution

import hysim as hs
from hysim.paper.equations import EQUATION_1
from hysim.plot import Figure, figure, house_style, save_svg

RESULTS = Path(__file__).parent / "results" / "lag_of_equation_1"
SAMPLE_TIME, PERIOD = 0.01, 52.0
SAMPLES = round(PERIOD / SAMPLE_TIME)
REFERENCE = hs.signals.triangle(0.0, 2.5, cycles=2, samples_per_cycle=SAMPLES)
TIME = SAMPLE_TIME * np.arange(REFERENCE.size)
LAST = slice(-SAMPLES - 1, None)
BOX = ((-4.0, 12.0), (-5.0, 5.0), (-5.0, 5.0), (-9.0, -1.0), (0.0, 1.0), (0.0, 1.0))
LOOP = hs.control.LinearLoop(EQUATION_1, SAMPLE_TIME)


def pid(x: np.ndarray) -> hs.PID:
    """The controller at a point of the box: logarithms of Kp, Ti, Td and filter / Td, then two weights."""
    Kp, Ti, Td, ratio = np.exp(x[:4])
    return hs.PID.standard(
        Kp,
        Ti,
        Td,
        derivative_filter=ratio * Td,
        limits=(0.0, 125.0),
        setpoint_weight=x[4],
        derivative_weight=x[5],
    )


def relative_width(controller: hs.PID | None) -> float:
    """Of the last cycle, in closed loop or with the reference over the static gain as voltage; inf if it is lost."""
    try:
        if controller is None:
            y = EQUATION_1.response(REFERENCE / EQUATION_1.dc_gain, SAMPLE_TIME)
        else:
            y = hs.close_loop(EQUATION_1, controller, TIME, REFERENCE).y
    except hs.SimulationError:
        return math.inf
    return hs.loop_metrics(REFERENCE[LAST], y[LAST]).relative_width


def search(bound: float, *, rounds: int, population: int) -> hs.PID:
    """The PID within the bound whose loop is narrowest."""

    def cost(x: np.ndarray) -> float:
        controller = pid(x)
        excess = max(0.0, LOOP.max_sensitivity(controller) / bound - 1.0)
        if excess > 1.0:
            return 1e3
        return min(relative_width(controller), 1e2) * (1.0 + 10.0 * excess) + excess

    found = differential_evolution(cost, BOX, maxiter=rounds, popsize=population, seed=1, polish=False)
    return pid(found.x)


def main(smoke: bool = False) -> list[dict[str, Any]]:
    """Search for every bound; print the table and write it, the figure and the numbers."""
    bounds = (2.0, 50.0) if smoke else (1.4, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0)
    effort = {"rounds": 1, "population": 2} if smoke else {"rounds": 100, "population": 15}
    open_width = relative_width(None)
    rows = [row(bound, open_width, search(bound, **effort)) for bound in bounds]
    for line in rows:
        print(
            f"sensitivity at most {line['bound']:4.1f}: lag reduced by {line['lag_reduction_percent']:6.1f} %   "
            f"(Kp {line['Kp']:.3g}, Ti {line['Ti']:.3g}, Td {line['Td']:.3g}, filter {line['derivative_filter']:.2g})"
        )
    if not smoke:
        write(rows)
    return rows


def row(bound: float, open_width: float, best: hs.PID) -> dict[str, Any]:
    """One line of the table."""
    return {
        "bound": bound,
        "max_sensitivity": LOOP.max_sensitivity(best),
        "lag_reduction_percent": 100.0 * (1.0 - relative_width(best) / open_width),
        "Kp": best.kp,
        "Ti": best.kp / best.ki,
        "Td": best.kd / best.kp,
        "derivative_filter": best.derivative_filter,
        "setpoint_weight": best.setpoint_weight,
        "derivative_weight": best.derivative_weight,
    }


@house_style()
def draw(rows: list[dict[str, Any]]) -> Figure:
    """Reduction against the bound."""
    canvas = figure(height=3.6)
    ax = canvas.add_subplot()
    ax.plot([r["max_sensitivity"] for r in rows], [r["lag_reduction_percent"] for r in rows], "o-", color="#0072B2")
    ax.axhline(90.0, color="#777777", linestyle="--")
    ax.annotate("the paper's 90 %", xy=(rows[0]["bound"], 90.0), xytext=(0, 4), textcoords="offset points")
    ax.axvspan(1.0, 2.0, color="#e8f2ea", zorder=0)
    ax.annotate("usual", xy=(1.07, 4.0))
    ax.set(xscale="log", xlim=(1.0, 60.0), ylim=(0.0, 100.0), xlabel="Maximum sensitivity", ylabel="Lag reduction [%]")
    ax.set_xticks([1, 2, 5, 10, 20, 50], ["1", "2", "5", "10", "20", "50"])
    ax.minorticks_off()
    return canvas


def write(rows: list[dict[str, Any]]) -> None:
    """The table, the figure and the numbers into the results' folder."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    with (RESULTS / "table.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, rows[0], lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    save_svg(draw(rows), RESULTS / "figure.svg", name="lag_of_equation_1")
    (RESULTS / "result.json").write_text(json.dumps({"rows": rows}, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
