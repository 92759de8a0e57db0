"""Pictures of records and simulations: the loop, and the signals against time; and spectra of earthquakes."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from matplotlib.axes import Axes

from hysim._basics.frozen import FloatArray, check_choice
from hysim._basics.prefixes import in_unit, label, printed
from hysim._basics.results import Named, model_of
from hysim.control import ClosedLoop
from hysim.models.protocols import Responding
from hysim.plants.structures.structure import ResponseSpectrum
from hysim.plot._style import MANY, MEASURED, POINTS, AxesArray, AxesLike, joined, line, one, several, upright
from hysim.records import InputOutput, Record, as_record
from hysim.simulation import Simulation, columns_of, free_run, has_elements

_DRAWN = {"zoh": "steps-post", "foh": "default"}
_MOST_NAMED = 8  # lines of a panel that a legend has room for
_ELEMENTS_IN_A_ROW = 3
_ARROW = 0.03  # its length along the input, of the span
_LONGEST, _STEPS = 3.0, 10.0  # arrows, or median steps of the input: a longer step is no branch
_FRACTILES = (0.16, 0.5, 0.84)
_TABLES = {
    "pseudo_acceleration": "Pseudo-acceleration", "displacement": "Peak displacement", "ductility": "Ductility",
    "reduction_factor": "Reduction factor", "elastic_acceleration": "Elastic pseudo-acceleration",
}  # fmt: skip


@runtime_checkable
class _WithUnits(Protocol):
    units: Mapping[str, str]


@runtime_checkable
class _WithTime(Protocol):
    t: FloatArray | None


@runtime_checkable
class _WithMemory(Protocol):
    z: FloatArray | None


def times_of(result: InputOutput) -> FloatArray | None:
    return result.t if isinstance(result, _WithTime) else None


def names_of(results: Sequence[Any]) -> list[str]:
    """Own names of results, or the names of their classes; the same names are numbered."""
    own = [result.name if isinstance(result, Named) else "" for result in results]
    names = [name or type(result).__name__.lower() for name, result in zip(own, results, strict=True)]
    return [name if names.count(name) == 1 else f"{name} {names[:k].count(name) + 1}" for k, name in enumerate(names)]


def drawable(results: Sequence[Any], verb: str) -> tuple[Any, ...]:
    """Records (tables too) and simulations; models and fits run on the record before them, ValueError without one."""
    drawn: list[Any] = []
    record: Record | None = None
    for each in results:
        model = model_of(each)
        if (own := as_record(each, verb)) is not None:
            record = own
        elif isinstance(model, Responding) and record is None:
            raise ValueError(
                f"plot.{verb} cannot draw a {type(model).__name__} without an input: give a record before it, or draw "
                "hs.simulate(model, t, u)"
            )
        drawn.append(own or (free_run(each, record) if record and isinstance(model, Responding) else each))
    return tuple(drawn)


def units_of(*results: Any) -> dict[str, str]:
    """The units of all results; ValueError where two have u or y in different ones."""
    units: dict[str, str] = {}
    for result in results:
        own = {name: unit for name, unit in result.units.items() if unit} if isinstance(result, _WithUnits) else {}
        for name in {"u", "y"} & own.keys() & units.keys():
            if printed(own[name]) != printed(units[name]):
                pair = f"{units[name]} and {own[name]}"
                raise ValueError(f"one axis cannot show {name} in {pair}: convert a record, as by record.convert")
        units = own | units
    return units


def loop(*results: Any, ax: Axes | None = None) -> Axes:
    """Draw outputs against inputs, over each other.

    Each of `results` is a Record, drawn as points; a Simulation or anything with arrays `u` and `y`, drawn as a line
    with an arrow on its last loading and unloading branch; or a model or the result of a fit, which is simulated on the
    input of the record before it. A record of more than 300 samples is a broad grey line under the others, with such
    arrows where there are only records. Without a result a ValueError is raised.

    Examples
    --------
    >>> import hysim as hs
    >>> rec = hs.datasets.table1()
    >>> hs.plot.loop(rec, ax=hs.plot.figure().add_subplot()).get_ylabel()
    'Displacement [µm]'
    """
    if not results:
        raise ValueError("there is nothing to draw: give at least one result with u and y")
    results = drawable(results, "loop")
    named = list(zip(results, names_of(results), strict=True))
    records = [(result, name) for result, name in named if isinstance(result, Record)]
    others = [(result, name) for result, name in named if not isinstance(result, Record)]
    with one(ax) as axes:
        for k, (record, name) in enumerate(records):
            axes.plot(record.u, record.y, label=name, **joined(len(record), k))
            if len(record) > MANY and not others:
                _arrows(axes, record, MEASURED)
        for k, (result, name) in enumerate(others):
            (drawn,) = axes.plot(result.u, result.y, label=name, **line(k))
            _arrows(axes, result, drawn.get_color())
        units = units_of(*results)
        axes.set(xlabel=label(units, "u"), ylabel=label(units, "y"))
        if len(results) > 1:
            axes.legend()
    return axes


def history(result: InputOutput, axes: AxesLike | None = None, *, hold: str = "zoh") -> AxesArray:
    """Draw output, input and, if there is one, memory against time, one over the other.

    `result` is a Record, a Simulation or anything with arrays `u` and `y`; without times they are drawn against the
    sample's number. With two `axes` the memory z is left out. Models and further records on the same `axes` differ by
    their lines. `hold` is ``"zoh"``, an input of steps, or ``"foh"``, of straight lines. The result is (2,) or (3,).

    Examples
    --------
    >>> import hysim as hs
    >>> canvas = hs.plot.figure()
    >>> [ax.get_ylabel() for ax in hs.plot.history(hs.datasets.table1(), canvas.subplots(2, sharex=True))]
    ['Displacement [µm]', 'Voltage [V]']
    """
    check_choice("hold", hold, _DRAWN)
    (result,) = drawable((result,), "history")
    time, z = times_of(result), result.z if isinstance(result, _WithMemory) else None
    t = np.arange(float(result.u.size)) if time is None else time
    end = 2.0 * t[-1] - t[-2] if t.size > 1 else t[-1]
    units = units_of(result)
    thin = {"linewidth": 1.2} if result.u.size > MANY else {}
    n = 2 if z is None or (axes is not None and np.size(np.asarray(axes)) == 2) else 3
    with several(axes, n, height=2.1 if n == 2 else 1.9) as panels:
        before = sum(drawn.get_color() != POINTS for drawn in panels[0].lines)  # on the same Axes, but the first record
        is_record, is_first = isinstance(result, Record), before == len(panels[0].lines)
        panels[0].plot(t, result.y, **(joined(result.u.size) | thin if is_record and is_first else line(before)))
        style = {"color": MEASURED, "drawstyle": _DRAWN[hold]} | (line(before) if is_record and not is_first else {})
        panels[1].plot(np.append(t, end), np.append(result.u, result.u[-1]), **style)
        if n == 3:
            panels[2].plot(t, z, **line(1))
        for ax, signal in zip(panels, "yuz", strict=False):
            upright(ax, label(units, signal))
        panels[-1].set_xlabel("Sample" if time is None else label(units, "t"))
    return panels


def signals(result: Simulation, *names: str, axes: AxesLike | None = None) -> AxesArray:
    """Draw signals of a simulation against time, one panel for each, with a line for each of its columns.

    `result` is a result of `hysim.simulate`, and `names` are names of its signals, such as ``"drift"``, else a
    ValueError; without times they are drawn against the sample's number. The result has shape (n_names,).

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.5, 1.0))
    >>> panels = hs.plot.signals(hs.simulate(law, None, [0.0, 1.0, 0.0]), "z", axes=[hs.plot.figure().add_subplot()])
    >>> panels[0].get_ylabel(), len(panels[0].lines)
    ('Memory z', 2)
    """
    unknown = [name for name in names if name not in result.signals]
    if unknown or not names:
        raise ValueError(f"give signals out of {', '.join(result.signals)}; got {', '.join(unknown) or 'no name'}")
    t = np.arange(float(result.u.size)) if result.t is None else result.t
    with several(axes, len(names), height=1.9) as panels:
        for ax, name in zip(panels, names, strict=True):
            columns = columns_of(name, result.signals[name])
            for k, (column, values) in enumerate(columns.items()):
                ax.plot(t, values, label=column, **line(k))
            upright(ax, _axis_of(name, result.units))
            if 1 < len(columns) <= _MOST_NAMED:
                ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        panels[-1].set_xlabel("Sample" if result.t is None else label(result.units, "t"))
    return panels


def _axis_of(name: str, units: Mapping[str, str]) -> str:
    own = name in ("t", "u", "y", "z")
    return label(units, name) if own else in_unit(name.replace("_", " ").capitalize(), units.get(name, ""))


def element_loops(result: Simulation, axes: AxesLike | None = None) -> AxesArray:
    """Draw the force of each element of a structure against its drift, one panel for each.

    `result` is a result of `hysim.simulate` with signals ``"drift"`` and ``"force"`` of the same shape
    (n, n_elements); otherwise a ValueError is raised. The result has shape (n_elements,).

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> u = np.sin(np.linspace(0.0, 10.0, 50))
    >>> loops = {"drift": np.stack([u, 2.0 * u], axis=1), "force": np.stack([u**3, u], axis=1)}
    >>> panels = hs.plot.element_loops(hs.Simulation(u=u, y=u, signals=loops), hs.plot.figure().subplots(2))
    >>> panels[1].get_title()
    'element 1'
    """
    if not has_elements(result):
        raise ValueError(
            f"the simulation has no drift and force of elements, it has {', '.join(result.signals)}: simulate a "
            "structure, or draw the loop of the whole"
        )
    drift, force = result.signals["drift"], result.signals["force"]
    n, units = drift.shape[1], result.units
    with several(axes, n, height=3.0, columns=min(n, _ELEMENTS_IN_A_ROW), sharex=False) as panels:
        for k, ax in enumerate(panels):
            ax.plot(drift[:, k], force[:, k], **line(0))
            ax.set_title(f"element {k}")
            ax.set(xlabel=in_unit("Drift", units.get("drift", "")), ylabel=in_unit("Force", units.get("force", "")))
    return panels


def traces(
    series: Mapping[str, tuple[FloatArray, FloatArray]],
    ax: Axes | None = None,
    *,
    units: Mapping[str, str] | None = None,
) -> Axes:
    """Draw outputs against time, over each other.

    `series` maps names to pairs of times and outputs (n,); `units` are labels of the units of ``"t"`` and ``"y"``.

    Examples
    --------
    >>> import hysim as hs
    >>> t = [0.0, 1.0, 2.0]
    >>> ax = hs.plot.traces({"lag": (t, [0.0, 0.6, 0.9])}, hs.plot.figure().add_subplot(), units={"t": "s"})
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('Time [s]', 'Output')
    """
    with one(ax) as axes:
        for k, (name, (t, y)) in enumerate(series.items()):
            axes.plot(t, y, label=name, **line(k))
        axes.set(xlabel=label(units or {}, "t"), ylabel=label(units or {}, "y"))
        if len(series) > 1:
            axes.legend()
    return axes


def response(run: ClosedLoop, ax: Axes | None = None) -> Axes:
    """Draw reference and output of a closed loop against time, and the measurement where it differs.

    `run` is a result of `hysim.close_loop`, or anything with t, reference, y, measurement, shape (n,), and units.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> lag, t = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)), np.arange(0.0, 5.0, 0.01)
    >>> run = hs.close_loop(lag, hs.PID(kp=4.0, ki=4.0), t, np.ones(t.size), units={"t": "s", "y": "um"})
    >>> hs.plot.response(run, hs.plot.figure().add_subplot()).get_ylabel()
    'Displacement [µm]'
    """
    series = {"reference": (run.t, run.reference), "output": (run.t, run.y)}
    if not np.array_equal(run.measurement, run.y):
        series["measurement"] = (run.t, run.measurement)
    return traces(series, ax, units=run.units)


def spectrum(
    result: ResponseSpectrum | Mapping[str, ResponseSpectrum],
    ax: Axes | None = None,
    *,
    quantity: str = "pseudo_acceleration",
    unit: str = "",
) -> Axes:
    """Draw a table of a response spectrum over the periods: its median, and a band from the 16 to the 84 % fractile.

    `result` is one of `hysim.response_spectrum`, or a mapping of names to some. `quantity` is the name of the table,
    such as ``"displacement"`` or ``"ductility"``, and `unit` a label of its unit. Fractiles are the smallest values
    that so many records do not exceed; a line ends where the motion of the median diverges.

    Examples
    --------
    >>> import hysim as hs
    >>> quake = hs.signals.ground_motion(3.0, duration=8.0, sample_time=0.02)
    >>> result = hs.response_spectrum(quake, 0.02, [0.2, 0.5, 1.0])
    >>> hs.plot.spectrum(result, hs.plot.figure().add_subplot(), quantity="displacement", unit="m").get_ylabel()
    'Peak displacement [m]'
    """
    check_choice("quantity", quantity, _TABLES)
    results = result if isinstance(result, Mapping) else {"median": result}
    with one(ax) as axes:
        for k, (name, each) in enumerate(results.items()):
            order = np.argsort(each.periods)
            tables = {**vars(each), "displacement": each.displacement, "reduction_factor": each.reduction_factor}
            low, median, high = np.quantile(tables[quantity][:, order], _FRACTILES, axis=0, method="inverted_cdf")
            shade = {"alpha": 0.2, "linewidth": 0.0, "color": line(k)["color"]}
            axes.fill_between(each.periods[order], low, high, where=np.isfinite(high), **shade)
            axes.plot(each.periods[order], median, label=name, **line(k))
        axes.set(xlabel="Period [s]", ylabel=in_unit(_TABLES[quantity], unit))
        axes.legend()
    return axes


def _arrows(ax: Axes, result: InputOutput, colour: Any) -> None:
    """An arrowhead where a branch last crosses the middle of the input's span upwards, and one downwards."""
    u, y = result.u, result.y
    above, short = u >= 0.5 * (u.min() + u.max()), _ARROW * np.ptp(u)
    longest = max(_LONGEST * short, _STEPS * float(np.median(np.abs(np.diff(u)))))
    style = {"arrowstyle": "-|>", "color": colour, "mutation_scale": 14, "shrinkA": 0, "shrinkB": 0}
    for sign in (1, -1):
        for head in np.flatnonzero(np.diff(above.astype(int)) == sign)[::-1] + 1:
            far = np.flatnonzero(np.abs(u[:head] - u[head]) >= short)
            tail = far[-1] if far.size else head - 1
            if 0.0 < sign * (u[head] - u[tail]) <= longest:  # neither a turn nor a jump to the next reversal curve
                ax.annotate("", xy=(u[head], y[head]), xytext=(u[tail], y[tail]), arrowprops=style)
                break
