"""Pictures of loops in themselves: the nested ones of an input that fades, their width, and a point that runs round."""

import itertools

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from hysim._cycles import TOLERANCE, turns
from hysim._frozen import FloatArray
from hysim.metrics import LoopMetrics, loop_metrics
from hysim.plot._results import InputOutput, names_of, units_of
from hysim.plot._style import GUIDE, MARKERS, MEASURED, POINTS, SEQUENTIAL, in_unit, label, line, one
from hysim.records import Record


def minor_loops(result: InputOutput, ax: Axes | None = None, *, tolerance: float = TOLERANCE) -> Axes:
    """Draw each cycle of an input whose extremes change as a loop of its own, the smaller the darker.

    A cycle is a way up and the way down after it: of a sine that fades or grows a nested loop, of reversal curves one
    of them. Its amplitude is half of what the input falls by. Small loops lie over large ones.

    Parameters
    ----------
    result : Record, Simulation or anything with `u` and `y`
        Whose cycles are drawn.
    ax : Axes, optional
        Where to draw.
    tolerance : float
        Retreats of the input up to this fraction of its span are no turning points.

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        If the input stands still, or the tolerance is not from 0 to below 0.5.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.decaying_sine(1.0, cycles=5, samples_per_cycle=40)
    >>> sim = hs.simulate(hs.BoucWen(beta=2.0), None, u)
    >>> len(hs.plot.minor_loops(sim, hs.plot.figure().add_subplot()).lines)
    5
    """
    cycles = _cycles_up_and_down(result.u, tolerance)
    if not cycles:
        raise ValueError("the input stands still: there is no loop to draw")
    norm = Normalize(0.0, max(cycles.values()))
    units = units_of([result])
    with one(ax) as axes:
        for (first, stop), amplitude in sorted(cycles.items(), key=lambda cycle: -cycle[1]):
            axes.plot(result.u[first:stop], result.y[first:stop], color=SEQUENTIAL(norm(amplitude)), linewidth=1.2)
        axes.set(xlabel=label(units, "u"), ylabel=label(units, "y"))
        amplitudes = in_unit("Amplitude", units.get("u", ""))
        axes.figure.colorbar(ScalarMappable(norm, SEQUENTIAL), ax=axes, label=amplitudes)
    return axes


def width(*results: InputOutput | LoopMetrics, ax: Axes | None = None) -> Axes:
    """Draw signed loop widths, unloading minus loading, against the input.

    Parameters
    ----------
    *results : Record, Simulation, LoopMetrics or anything with `u` and `y`
        Of a record or simulation the last complete cycle is measured, by `hysim.loop_metrics`; that of a protocol
        such as 0 -> max -> min -> 0 begins and ends at a level. A record is drawn as points, anything else as a line.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Raises
    ------
    ValueError
        If no result is given, or one has no complete cycle.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> hs.plot.width(rec, hs.loop_metrics(rec.u, rec.y), ax=hs.plot.figure().add_subplot()).get_ylabel()
    'Loop width [µm]'
    """
    if not results:
        raise ValueError("there is nothing to draw: give at least one record, simulation or loop")
    units = units_of(results)
    n_records = n_others = 0
    with one(ax) as axes:
        axes.axhline(0.0, color=GUIDE, linewidth=0.8)
        for result, name in zip(results, names_of(results), strict=True):
            loop = result if isinstance(result, LoopMetrics) else loop_metrics(result.u, result.y)
            if isinstance(result, Record):
                marker = MARKERS[n_records % len(MARKERS)]
                axes.plot(loop.u, loop.width, marker, label=name, color=MEASURED, markersize=3.8, zorder=3)
                n_records += 1
            else:
                axes.plot(loop.u, loop.width, label=name, **line(n_others))
                n_others += 1
        axes.set(xlabel=label(units, "u"), ylabel=in_unit("Loop width", units.get("y", "")))
        if len(results) > 1:
            axes.legend()
    return axes


def animate(
    result: InputOutput, ax: Axes | None = None, *, frames: int = 100, interval: float = 40.0, trail: float = 0.15
) -> FuncAnimation:
    """Let a point run round the loop, with a trail behind it.

    The whole path is drawn in light grey underneath. Where the result has a time, frames are evenly spaced in it, else
    in the samples; the first one shows the first sample and the last one the last.

    Parameters
    ----------
    result : Record, Simulation or anything with `u` and `y`
        Whose path the point takes.
    ax : Axes, optional
        Where to draw; they are the animation's to move in until it is saved or shown.
    frames : int
        Number of pictures, at least 2.
    interval : float
        From one to the next [ms].
    trail : float
        Length of the trail, as a fraction of the record.

    Returns
    -------
    matplotlib.animation.FuncAnimation
        Keep it: it stops when nobody holds it. ``save("loop.gif", writer="pillow")`` writes it to a file.

    Raises
    ------
    ValueError
        If there are fewer than 2 frames.

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
    time = getattr(result, "t", None)
    clock = np.arange(float(result.u.size)) if time is None else time
    moments = np.linspace(clock[0], clock[-1], frames)
    heads = np.searchsorted(clock, moments, side="right") - 1
    tails = np.searchsorted(clock, moments - trail * (clock[-1] - clock[0]))
    units = units_of([result])
    with one(ax) as axes:
        canvas = axes.figure.canvas.figure
        axes.plot(result.u, result.y, color=POINTS, linewidth=0.8)
        (behind,) = axes.plot([], [], color=line(0)["color"], linewidth=2.2)
        (point,) = axes.plot([], [], "o", color=line(1)["color"], markeredgecolor="black", markersize=7.0)
        axes.set(xlabel=label(units, "u"), ylabel=label(units, "y"))
        engine = canvas.get_layout_engine()
        if ax is None and engine is not None:
            engine.execute(canvas)
            canvas.set_layout_engine("none")  # what is laid out once need not be for every frame

    def move(k: int) -> tuple[Artist, ...]:
        passed = slice(tails[k], heads[k] + 1)
        behind.set_data(result.u[passed], result.y[passed])
        point.set_data(result.u[heads[k] : heads[k] + 1], result.y[heads[k] : heads[k] + 1])
        return behind, point

    return FuncAnimation(canvas, move, frames=frames, interval=interval)


def _cycles_up_and_down(u: FloatArray, tolerance: float) -> dict[tuple[int, int], float]:
    """First sample and stop of each way up with the way down after it, and half of what the input falls by.

    What is left at either end is a cycle of its own at the beginning, and belongs to the last one at the end.
    """
    branches = turns(u, tolerance).branches
    rises = [float(u[branch.stop - 1] - u[branch.start]) for branch in branches]
    begins = [k for k, rise in enumerate(rises) if k == 0 or (rise > 0.0 and k + 1 < len(rises))]
    cycles = {}
    for first, stop in itertools.pairwise([*begins, len(branches)]):
        falls = [-rise for rise in rises[first:stop] if rise < 0.0] or rises[first:stop]
        cycles[branches[first].start, branches[stop - 1].stop] = 0.5 * max(falls)
    return cycles
