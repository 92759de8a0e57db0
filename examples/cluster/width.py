"""The task of the recipes in this folder: the width of a loop."""

import hysim as hs


def width(beta: float, n: float) -> dict[str, float]:
    """Largest width of the loop of one law."""
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=200)
    return {"width": hs.loop_metrics(u, hs.BoucWen(beta=beta, n=n).response(u)).max_width}
