"""How wrong is a spring that wears off and pinches in a finite-element code, for how many steps a cycle?

OpenSees solves the laws of Baber and Noori by one backward Euler step for each increment of the displacement; that step
is repeated here, solved to rounding. The input is ten cycles about zero. The error is the largest over them, in percent
of the range of the memory, against the law itself, integrated to 1e-10, whose largest difference from itself with half
the steps stands beside it. The figure shows the loops, and what two Duhem laws make of Table 1.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "wear_and_pinching"
WEAR = {"delta_nu": 0.06, "delta_eta": 0.04}
PINCHING = {"zeta_s": 0.85, "q": 0.1, "p": 0.2, "psi": 0.15, "delta_psi": 0.005, "lambda_": 0.4}
LAWS = {
    "new": hs.BoucWenBaberNoori(beta=0.6, gamma=0.4),
    "worn": hs.BoucWenBaberNoori(beta=0.6, gamma=0.4, **WEAR),
    "worn and pinched": hs.BoucWenBaberNoori(beta=0.6, gamma=0.4, **WEAR, **PINCHING),
}
COLORS = ("#b0b0b0", "#0072B2", "#D55E00")
STEPS = (40, 100, 400, 1000)
AMPLITUDE, CYCLES = 2.5, 10
Row = dict[str, Any]


def backward_euler(law: hs.BoucWenBaberNoori, u: np.ndarray) -> np.ndarray:
    """The memory, one implicit step for each increment: z = z0 + du f(z, e), e = e0 + du z."""
    z, e, memory = 0.0, 0.0, [0.0]
    for end, du in zip(u[1:].tolist(), np.diff(u).tolist(), strict=True):

        def excess(new: float, z: float = z, e: float = e, end: float = end, du: float = du) -> float:
            slope = float(law.tangent(du, new, end, e + du * new))
            return new - z - du * slope

        reach = 2.0 * abs(du)
        z = brentq(excess, z - reach, z + reach, xtol=1e-14)
        e += du * z
        memory.append(z)
    return np.array(memory)


def cycles(steps: int) -> np.ndarray:
    """The input with `steps` increments a cycle."""
    return hs.signals.triangle(-AMPLITUDE, AMPLITUDE, cycles=CYCLES, samples_per_cycle=steps)


def row(name: str, steps: int) -> Row:
    """Errors of one law with so many steps a cycle."""
    law, u = LAWS[name], cycles(steps)
    z = law.memory(u)
    scale = float(np.ptp(z))
    return {
        "law": name,
        "steps": steps,
        "backward_euler_percent": 100.0 * float(np.abs(backward_euler(law, u) - z).max()) / scale,
        "law_percent": 100.0 * float(np.abs(law.memory(u[::2]) - z[::2]).max()) / scale,
    }


def main(smoke: bool = False) -> list[Row]:
    """Measure; print the table and write it."""
    rows = [row(name, steps) for name in LAWS for steps in (STEPS[:1] if smoke else STEPS)]
    for line in rows:
        print(
            f"{line['law']:>16}, {line['steps']:>4} steps a cycle: backward Euler "
            f"{line['backward_euler_percent']:.2g} %, the law {line['law_percent']:.1g} %"
        )
    return write_results(RESULTS, rows, draw, {"amplitude": AMPLITUDE, "cycles": CYCLES}, smoke=smoke)


def draw(rows: list[Row]) -> Figure:
    """Two Duhem laws on Table 1, the error of a step, and the loops of a spring as it wears off."""
    canvas = figure(height=6.0)
    (measured, errors), below = canvas.subplots(2, 2)
    record = hs.datasets.table1(dwell=1.0)
    measured.plot(record.u, record.y, "o", color="#b0b0b0", markersize=3.8, label="Table 1")
    duhem = {"Coleman-Hodgdon": hs.ColemanHodgdon, "degree 1": hs.Duhem.structure(degree=1)}
    for (name, family), color in zip(duhem.items(), COLORS[1:], strict=True):
        measured.plot(record.u, hs.identify(family, record).model.response(record.u), color=color, label=name)
    measured.set(xlabel="Voltage [V]", ylabel="Displacement [µm]")
    measured.legend()
    for name, color in zip(LAWS, COLORS, strict=True):
        own = [line for line in rows if line["law"] == name]
        error = [line["backward_euler_percent"] for line in own]
        errors.loglog([line["steps"] for line in own], error, "o-", color=color, markersize=4, label=name)
    errors.set(xlabel="Steps a cycle", ylabel="Error of a step [%]")
    errors.legend()
    u = cycles(400)
    for ax, (name, law), color in zip(below, list(LAWS.items())[1:], COLORS[1:], strict=True):
        ax.plot(u[:1201], LAWS["new"].memory(u[:1201]), color=COLORS[0], label="new")
        ax.plot(u, law.memory(u), color=color, linewidth=0.7, label=name)
        ax.set(xlabel="Displacement u", ylabel="Memory z", ylim=(-1.1, 1.5))
        ax.legend(loc="upper left")
    return canvas


if __name__ == "__main__":
    main()
