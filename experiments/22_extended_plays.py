"""What do dead zones, envelopes and thresholds that grow with the speed do to the loop of one and the same plays?

Every law has the plays of Al Janaideh's example (2022). Each extension changes one property of the plain law: that its
loop is odd about its middle (dead zones, two envelopes), that it does not saturate (an envelope), that it is the same
at every speed. The rows say by how much a major loop departs from each, and how well its inverse undoes it.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

import hysim as hs
from hysim.plot import Figure, figure

sys.path.insert(0, str(Path(__file__).parent))
from results_folder import write_results

RESULTS = Path(__file__).parent / "results" / "extended_plays"
PLAYS: dict[str, tuple[float, ...]] = {
    "thresholds": tuple(0.45 * k for k in range(7)),
    "weights": (0.72, 0.6, 0.48, 0.36, 0.24, 0.12, 0.012),
}
LAWS = {
    "plain": hs.PrandtlIshlinskii(**PLAYS),
    "dead zones": hs.ModifiedPrandtlIshlinskii(
        **PLAYS, dead_zones=(-3.0, 0.0, 3.0), dead_zone_weights=(-0.5, 1.0, 0.6)
    ),
    "one envelope": hs.GeneralizedPrandtlIshlinskii(**PLAYS, left=(5.0, 0.4, 0.0, 0.0, 0.0)),
    "two envelopes": hs.GeneralizedPrandtlIshlinskii(
        **PLAYS, left=(4.4, 0.4, -0.4, 1.2, 0.0), right=(4.4, 0.4, 0.2, 0.6, 0.0)
    ),
    "speed 0.1": hs.RateDependentPrandtlIshlinskii(**PLAYS, beta=10.0),
    "speed 0.05": hs.RateDependentPrandtlIshlinskii(**PLAYS, beta=10.0),
}
SAMPLE_TIMES = {"speed 0.1": 1.0, "speed 0.05": 2.0}
HALF = 80  # samples from one turn to the next
Row = dict[str, Any]


def response(name: str, u: np.ndarray) -> np.ndarray:
    """Output of a law at its sample time."""
    return np.asarray(LAWS[name].response(u, *([SAMPLE_TIMES[name]] if name in SAMPLE_TIMES else [])))


def undone(name: str, u: np.ndarray) -> float:
    """How far the law's response to its inverse of an output is from that output, of the range."""
    y = response(name, u)
    law: Any = LAWS[name]
    if name in SAMPLE_TIMES:  # samples are closer than 2 beta: the analytic inverse, at the known speed
        known = {"sample_time": SAMPLE_TIMES[name], "speed": np.abs(np.diff(u, prepend=u[0])) / SAMPLE_TIMES[name]}
        again = law.response(law.inverse_response(y, **known), **known)
    else:
        again = law.response(law.inverse_response(y))
    return float(np.abs(again - y).max() / np.ptp(y))


def main(smoke: bool = False) -> list[Row]:
    """Drive every law, print the table and write it."""
    u = hs.signals.triangle(-4.0, 4.0, cycles=2, samples_per_cycle=2 * HALF)
    rows = []
    for name in LAWS:
        y = response(name, u)
        rising, falling = y[-2 * HALF - 1 : -HALF], y[-HALF - 1 :]
        loop = hs.loop_metrics(u, y)
        middle = 0.5 * (rising[-1] + rising[0])
        rows.append(
            {
                "law": name,
                "stroke": float(np.ptp(rising)),
                "mid_width": loop.mid_width,
                "odd_within": float(np.abs((rising - middle) + (falling - middle)).max() / np.ptp(rising)),
                "inverse_error": undone(name, u),
                "u": u[-2 * HALF - 1 :].tolist(),
                "y": y[-2 * HALF - 1 :].tolist(),
            }
        )
    for line in rows:
        print(
            f"{line['law']:<14} stroke {line['stroke']:6.3f}, width at the middle {line['mid_width']:.3f}, odd within "
            f"{100.0 * line['odd_within']:4.1f} % of it, undone by its inverse to {line['inverse_error']:.0e}"
        )
    loops = {line["law"]: (line.pop("u"), line.pop("y")) for line in rows}
    return write_results(RESULTS, rows, lambda _: draw(loops), {"half_period_samples": HALF}, smoke=smoke)


def draw(loops: dict[str, tuple[list[float], list[float]]]) -> Figure:
    """The loops of each extension over that of the plain law."""
    canvas = figure(height=3.6)
    panels = canvas.subplots(1, 3, sharex=True, sharey=True)
    groups = {"dead zones": ["dead zones"], "envelopes": ["one envelope", "two envelopes"], "speed": [*SAMPLE_TIMES]}
    for ax, (title, names) in zip(panels, groups.items(), strict=True):
        for name, color, dash in zip(names, ("#0072B2", "#D55E00"), ("solid", (0, (4, 1.5))), strict=False):
            ax.plot(*loops[name], color=color, linestyle=dash, label=name)
        ax.plot(*loops["plain"], color="0.6", linestyle="solid", label="plain")
        ax.set(title=title, xlabel="u")
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2))
    panels[0].set_ylabel("y")
    return canvas


if __name__ == "__main__":
    main()
