"""Pictures of loops: each cycle in a colour, loop widths, and a point that moves along a loop."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from hysim._basics.frozen import FloatArray
from hysim._basics.prefixes import in_unit, label
from hysim._columns.turning import TOLERANCE, turns
from hysim.metrics import LoopMetrics, loop_metrics
from hysim.plot._records import drawable, names_of, times_of, units_of
from hysim.plot._style import GUIDE, MANY, MARKERS, MEASURED, POINTS, SEQUENTIAL, grid_of, line, one
from hysim.records import InputOutput, Record


def minor_loops(result: InputOutput, ax: Axes | None = None, *, tolerance: float = TOLERANCE) -> Axes:
    """Draw each cycle of an input whose extremes change as a loop of its own, the smaller the darker.

    A cycle is a rising branch and the falling branch after it: one nested loop of a fading or growing sine, one of the
    reversal curves. Its amplitude is half of the fall of the input. Small loops are drawn over large ones.

    `result` is a Record, a Simulation or anything with arrays `u` and `y`. Reversals of the input up to the fraction
    `tolerance` of its span are ignored; it is from 0 to below 0.5. A constant input is a ValueError.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.decaying_sine(1.0, cycles=5, samples_per_cycle=40)
    >>> sim = hs.simulate(hs.BoucWen(beta=2.0), None, u)
    >>> len(hs.plot.minor_loops(sim, hs.plot.figure().add_subplot()).lines)
    5
    """
    (result,) = drawable((result,), "minor_loops")
    cycles = _cycles_up_and_down(result.u, tolerance)
    by_size = dict(sorted(cycles.items(), key=lambda cycle: -cycle[1]))
    amplitude = in_unit("Amplitude", units_of(result).get("u", ""))
    return _coloured(result, by_size, Normalize(0.0, max(cycles.values())), amplitude, ax)


def cycles(result: InputOutput, ax: Axes | None = None, *, tolerance: float = TOLERANCE) -> Axes:
    """Draw each cycle of an input in a colour of its own, from the first, dark, to the last, light.

    It shows what changes from cycle to cycle: creep, wear, warming, a mean that drifts. Arguments, and what a cycle is,
    are those of `minor_loops`.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=40)
    >>> sim = hs.simulate(hs.BoucWen(beta=2.0), None, u)
    >>> len(hs.plot.cycles(sim, hs.plot.figure().add_subplot()).lines)
    3
    """
    (result,) = drawable((result,), "cycles")
    numbers = {place: float(k) for k, place in enumerate(_cycles_up_and_down(result.u, tolerance), 1)}
    return _coloured(result, numbers, Normalize(1.0, max(2.0, len(numbers))), "Cycle", ax)


def _coloured(
    result: InputOutput, cycles: Mapping[tuple[int, int], float], norm: Normalize, name: str, ax: Axes | None
) -> Axes:
    """The cycles by first sample and stop, in this order, each in the colour of its value."""
    units = units_of(result)
    with one(ax) as axes:
        for (first, stop), value in cycles.items():
            colour = SEQUENTIAL(norm(value))
            axes.plot(result.u[first:stop], result.y[first:stop], color=colour, linewidth=1.2, **grid_of(stop - first))
        axes.set(xlabel=label(units, "u"), ylabel=label(units, "y"))
        ticks = MaxNLocator(integer=True) if name == "Cycle" else None
        axes.figure.colorbar(ScalarMappable(norm, SEQUENTIAL), ax=axes, label=name, ticks=ticks)
    return axes


def width(*results: Any, ax: Axes | None = None) -> Axes:
    """Draw signed loop widths, unloading minus loading, against the input.

    Each of `results` is a Record, drawn as points, a Simulation, a LoopMetrics or anything with arrays `u` and `y`; or
    a model or the result of a fit, which is simulated on the input of the record before it. `hysim.loop_metrics`
    measures the last complete cycle. A ValueError is raised if there is no result, or one has no complete cycle.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> hs.plot.width(rec, hs.loop_metrics(rec.u, rec.y), ax=hs.plot.figure().add_subplot()).get_ylabel()
    'Loop width [µm]'
    """
    if not results:
        raise ValueError("there is nothing to draw: give at least one record, simulation or loop")
    results = drawable(results, "width")
    units = units_of(*results)
    records = ({"marker": marker, "linestyle": "none", "color": MEASURED} for marker in itertools.cycle(MARKERS))
    lines = map(line, itertools.count())
    with one(ax) as axes:
        axes.axhline(0.0, color=GUIDE, linewidth=0.8)
        for result, name in zip(results, names_of(results), strict=True):
            loop = result if isinstance(result, LoopMetrics) else loop_metrics(result.u, result.y)
            is_few = loop.u.size <= MANY
            points = {"markersize": 3.8, "zorder": 3} if is_few else {"marker": "", "linestyle": "solid"}
            style = next(records) | points if isinstance(result, Record) else next(lines)
            axes.plot(loop.u, loop.width, label=name, **style)
        axes.set(xlabel=label(units, "u"), ylabel=in_unit("Loop width", units.get("y", "")))
        if len(results) > 1:
            axes.legend()
    return axes


def animate(
    result: InputOutput, ax: Axes | None = None, *, frames: int = 100, interval: float = 40.0, trail: float = 0.15
) -> FuncAnimation:
    """Animate a point that moves along the loop and draws a trail, over the whole path in light grey.

    `result` is a Record, a Simulation or anything with arrays `u` and `y`. The number of `frames` is at least 2, else a
    ValueError is raised; they are evenly spaced in the result's time, if it has one, or in its samples, from the first
    to the last. `interval` is the time between two frames [ms], `trail` the length of the trail as a fraction of the
    record. Keep a reference to the animation, or it stops; ``save("loop.gif", writer="pillow")`` writes it to a file.

    Examples
    --------
    >>> import hysim as hs
    >>> canvas = hs.plot.figure(3.0, 2.0)
    >>> running = hs.plot.animate(hs.datasets.table1(), canvas.add_subplot(), frames=2)
    >>> "<script" in running.to_jshtml()
    True
    """
    if frames < 2:
        raise ValueError(f"an animation needs at least 2 frames, got {frames}")
    (result,) = drawable((result,), "animate")
    time = times_of(result)
    clock = np.arange(float(result.u.size)) if time is None else time
    moments = np.linspace(clock[0], clock[-1], frames)
    heads = np.searchsorted(clock, moments, side="right") - 1
    tails = np.searchsorted(clock, moments - trail * (clock[-1] - clock[0]))
    units = units_of(result)
    with one(ax) as axes:
        canvas = axes.figure.canvas.figure
        axes.plot(result.u, result.y, color=POINTS, linewidth=0.8)
        (behind,) = axes.plot([], [], color=line(0)["color"], linewidth=2.2)
        (point,) = axes.plot([], [], "o", color=line(1)["color"], markeredgecolor="black", markersize=7.0)
        axes.set(xlabel=label(units, "u"), ylabel=label(units, "y"))
        engine = canvas.get_layout_engine()
        if ax is None and engine is not None:
            engine.execute(canvas)
            canvas.set_layout_engine("none")  # one layout serves every frame

    def move(k: int) -> tuple[Artist, ...]:
        passed = slice(tails[k], heads[k] + 1)
        behind.set_data(result.u[passed], result.y[passed])
        point.set_data(result.u[heads[k] : heads[k] + 1], result.y[heads[k] : heads[k] + 1])
        return behind, point

    return FuncAnimation(canvas, move, frames=frames, interval=interval)


def _cycles_up_and_down(u: FloatArray, tolerance: float) -> dict[tuple[int, int], float]:
    """First sample and stop of each rising branch with the falling one after it, and half the fall of the input."""
    branches = turns(u, tolerance).branches
    if not branches:
        raise ValueError("the input is constant: there is no loop to draw")
    rises = [float(u[branch.stop - 1] - u[branch.start]) for branch in branches]
    begins = [k for k, rise in enumerate(rises) if k == 0 or (rise > 0.0 and k + 1 < len(rises))]
    cycles = {}
    for first, stop in itertools.pairwise([*begins, len(branches)]):
        falls = [-rise for rise in rises[first:stop] if rise < 0.0] or rises[first:stop]
        cycles[branches[first].start, branches[stop - 1].stop] = 0.5 * max(falls)
    return cycles
