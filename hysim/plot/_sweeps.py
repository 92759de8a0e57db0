"""Pictures of studies, and maps of residuals over inputs and cycles and of relays over their thresholds."""

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from hysim._basics.frozen import FloatArray
from hysim._basics.prefixes import in_brackets, in_unit, label
from hysim._columns.turning import TOLERANCE, turns
from hysim.laws.operators.preisach import Preisach, PreisachRelays
from hysim.laws.operators.reversal_curves import FEWEST, Forc
from hysim.laws.operators.reversal_curves import forc as measured_density
from hysim.plot._style import DIVERGING, GUIDE, MEASURED, POINTS, AxesArray, AxesLike, line, one, several
from hysim.records import Record
from hysim.simulation import Simulation, free_run
from hysim.sweeps import SobolIndices, Sweep

_BANDS = ((0.05, 0.95), (0.25, 0.75))
_FRACTILES = (0.16, 0.5, 0.84)  # a normal distribution's mean and one standard deviation to each side
_COLOURS = "viridis"


def sensitivities(indices: SobolIndices, output: str, ax: Axes | None = None) -> Axes:
    """Draw the first-order and total Sobol indices of an output, with their intervals.

    `indices` is a result of `hysim.sobol_indices`, and `output` the name of one of its outputs.

    Examples
    --------
    >>> import hysim as hs
    >>> sample = hs.Sample(distributions={"a": (0.0, 1.0), "b": (0.0, 1.0)}, n=64, method="saltelli")
    >>> indices = hs.sobol_indices(hs.sweep(lambda a, b: {"y": a + 2.0 * b}, sample))
    >>> hs.plot.sensitivities(indices, "y", ax=hs.plot.figure().add_subplot()).get_ylabel()
    'Share of the variance of y'
    """
    kinds = {
        "first order": (indices.first_order, indices.first_order_interval, POINTS),
        "total": (indices.total_order, indices.total_order_interval, MEASURED),
    }
    with one(ax) as axes:
        for k, (label, (values, intervals, colour)) in enumerate(kinds.items()):
            places = np.arange(len(indices.parameters)) + 0.3 * (k - 0.5)
            spread = np.abs(np.asarray(intervals[output]) - values[output])
            axes.errorbar(places, values[output], yerr=spread, fmt="o", color=colour, capsize=3.0, label=label)
        axes.set_xticks(range(len(indices.parameters)), indices.parameters)
        axes.set(ylabel=f"Share of the variance of {output}")
        axes.axhline(0.0, color="#999999", linewidth=0.6)
        axes.legend()
    return axes


def heat_map(result: Sweep, x: str, y: str, output: str, ax: Axes | None = None) -> Axes:
    """Draw an output of a study over two parameters of its grid, as the median over all others.

    `x`, `y` and `output` are the names of the parameters and of the output. A ValueError is raised if the study
    `result` is not of a grid with these parameters.

    Examples
    --------
    >>> import hysim as hs
    >>> result = hs.sweep(lambda a, b: {"y": a * b}, {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0]})
    >>> hs.plot.heat_map(result, "a", "b", "y", ax=hs.plot.figure().add_subplot()).get_xlabel()
    'a'
    """
    if result.axes is None or not {x, y} <= result.axes.keys() or x == y:
        raise ValueError(f"a heat map needs a grid with the parameters {x} and {y}")
    columns, rows = result.axes[x], result.axes[y]
    medians = [_median(result[output][(result[x] == across) & (result[y] == up)]) for up in rows for across in columns]
    table = np.reshape(medians, (len(rows), len(columns)))
    with one(ax) as axes:
        picture = axes.pcolormesh(range(table.shape[1]), range(table.shape[0]), table, cmap=_COLOURS, shading="nearest")
        for axis, name in ((axes.xaxis, x), (axes.yaxis, y)):
            values = result.axes[name]
            shown = range(0, len(values), max(1, len(values) // 6))
            axis.set_ticks(list(shown), [_short(values[k]) for k in shown])
        axes.set(xlabel=x, ylabel=y)
        axes.figure.colorbar(picture, ax=axes, label=output)
    return axes


def quantile_bands(result: Sweep, parameter: str, output: str, ax: Axes | None = None, *, slices: int = 20) -> Axes:
    """Draw the median of an output against a parameter, and the bands that hold half and nine tenths of the tasks.

    `parameter` and `output` are names in the study `result`. If the parameter has more values than `slices`, it is cut
    into as many slices with equally many tasks.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> result = hs.sweep(lambda a, b: {"y": a + b}, {"a": np.linspace(0.0, 1.0, 9), "b": np.linspace(0.0, 0.1, 20)})
    >>> hs.plot.quantile_bands(result, "a", "y", ax=hs.plot.figure().add_subplot()).get_ylabel()
    'y'
    """
    finite = np.isfinite(result[output])
    if not finite.any():
        raise ValueError(f"there is no finite value of {output!r} to draw")
    x, y = np.asarray(result[parameter], dtype=float)[finite], result[output][finite]
    distinct = np.unique(x)
    if distinct.size <= slices:
        parts = [np.flatnonzero(x == value) for value in distinct]
    else:
        parts = np.array_split(np.argsort(x, kind="stable"), slices)
    middles = [float(np.median(x[part])) for part in parts]
    with one(ax) as axes:
        for low, high in _BANDS:
            limits = [np.quantile(y[part], [low, high]) for part in parts]
            axes.fill_between(middles, *np.transpose(limits), alpha=0.25, linewidth=0.0, color=line(0)["color"])
        axes.plot(middles, [np.median(y[part]) for part in parts], label="median", **line(0))
        axes.set(xlabel=parameter, ylabel=output)
    return axes


def ida(
    result: Sweep, output: str, ax: Axes | None = None, *, intensity: str = "scale", limit: float | None = None
) -> Axes:
    """Draw an incremental dynamic analysis: the intensity over a response, a line for each record, and its fractiles.

    `result` is a study of a grid such as one of `hysim.structure_task`, `output` the name of a response, `intensity`
    that of a parameter; each set of the others has a line. A response that is infinite is a collapse, at which its line
    ends. The 16, 50 and 84 % fractiles are the smallest responses that so many records do not exceed. A `limit` is a
    dashed line. Raises ValueError if the study is not of such a grid, or a task failed or is missing.

    Examples
    --------
    >>> import hysim as hs
    >>> study = hs.sweep(lambda record, scale: {"drift": scale * (1 + record)}, {"record": [0, 1], "scale": [1.0, 2.0]})
    >>> len(hs.plot.ida(study, "drift", ax=hs.plot.figure().add_subplot()).lines)
    5
    """
    if result.axes is None or intensity not in result.axes:
        raise ValueError(f"an incremental dynamic analysis needs a grid with the parameter {intensity}")
    if len(result) < result.n_tasks or np.isnan(result[output]).any():
        raise ValueError("an incremental dynamic analysis needs every task, and some failed or are missing")
    place, scales = [*result.axes].index(intensity), np.asarray(result.axes[intensity], dtype=float)
    table = np.moveaxis(result[output].reshape([len(each) for each in result.axes.values()]), place, -1)
    order = np.argsort(scales)
    curves, scales = table.reshape(-1, scales.size)[:, order], scales[order]
    with one(ax) as axes:
        for curve in curves:
            axes.plot(curve, scales, color=POINTS, linewidth=0.8)
        for k, fractile in enumerate(_FRACTILES):
            values = np.quantile(curves, fractile, axis=0, method="inverted_cdf")  # of infinite responses, too
            axes.plot(values, scales, label=f"{fractile:.0%}", linewidth=2.0, **line(k))
        if limit is not None:
            axes.axvline(limit, color=GUIDE, linestyle="dashed", label="limit")
        axes.set(xlabel=output, ylabel=intensity)
        axes.legend()
    return axes


def parallel_coordinates(result: Sweep, output: str, ax: Axes | None = None) -> Axes:
    """Draw one line for each task of a study across its parameters, scaled to their ranges, coloured by an output.

    `result` is a study, and `output` the name of one of its outputs.

    Examples
    --------
    >>> import hysim as hs
    >>> result = hs.sweep(lambda a, b: {"y": a * b}, {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0]})
    >>> len(hs.plot.parallel_coordinates(result, "y", ax=hs.plot.figure().add_subplot()).lines)
    6
    """
    finite = np.flatnonzero(np.isfinite(result[output]))
    order = finite[np.argsort(result[output][finite], kind="stable")]
    names = [*result.parameters]
    heights = np.transpose([_scaled(result[name]) for name in names])
    colours = colormaps[_COLOURS](_scaled(result[output][order]))
    with one(ax) as axes:
        for task, colour in zip(order, colours, strict=True):
            axes.plot(range(len(names)), heights[task], color=colour, linewidth=0.6)
        axes.set_xticks(range(len(names)), names)
        axes.set(ylabel="Fraction of the range", title=f"from dark to light: {output}")
    return axes


def _median(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")


def _scaled(values: FloatArray) -> FloatArray:
    """Fractions of the range of numbers, or of the order of strings."""
    numbers = np.unique(values, return_inverse=True)[1] if values.dtype.kind == "U" else np.asarray(values, dtype=float)
    return np.asarray((numbers - numbers.min()) / (np.ptp(numbers) or 1.0))


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


_MOST_BINS = 40
_SEAMLESS: dict[str, Any] = {"edgecolors": "face", "linewidth": 0.7, "antialiased": True}
_Place = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
_COORDINATES: dict[str, tuple[_Place, tuple[str, str]]] = {
    "thresholds": (lambda a, b: (b, a), ("Lower threshold b", "Upper threshold a")),
    "centre": (lambda a, b: (0.5 * (a - b), 0.5 * (a + b)), ("Half the distance (a - b)/2", "Middle (a + b)/2")),
}
_FEWEST_CURVES = 3  # below it the map has no shape


def residual_map(
    record: Record,
    model: Any,
    axes: AxesLike | None = None,
    *,
    bins: int | None = None,
    tolerance: float = TOLERANCE,
    quanta: str = "quanta",
) -> AxesArray:
    """Draw the residual, measured minus model, over the input and the cycles, for loading and for unloading.

    A change from left to right is an error of the loop's shape, a change of sign between the panels one of its width,
    and a change from bottom to top is drift. A cell is the mean over the samples of one branch in one interval of the
    input; grey is zero, lighter is more, darker is less, and white has no samples.

    `model` is a model, a fit, or a Simulation of the record's input. `bins` is the number of intervals, by default half
    as many as a branch has samples, at most 40. Reversals up to the fraction `tolerance` of the input's span end no
    branch. `quanta` names the sensor's quanta, the unit if the record has a resolution. The result has shape (2,).

    Raises
    ------
    ValueError
        If the simulation and the record differ in length, the input is constant, or `bins` is below 1.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(0.0, 1.0, cycles=3, samples_per_cycle=40)
    >>> law = hs.BoucWen(beta=2.0)
    >>> axes = hs.plot.figure().subplots(1, 2)
    >>> [ax.get_title(loc="left") for ax in hs.plot.residual_map(hs.Record(u=u, y=law.response(u)), law, axes)]
    ['loading', 'unloading']
    """
    if bins is not None and bins < 1:
        raise ValueError(f"bins must be at least 1, got {bins}")
    quantum, unit = (record.resolution, quanta) if record.resolution else (1.0, record.units.get("y", ""))
    y = model.y if isinstance(model, Simulation) else free_run(model, record).y
    if y.shape != record.y.shape:
        raise ValueError(f"the model's output must be as long as the record, {len(record)} samples, got {y.size}")
    branches = turns(record.u, tolerance).branches
    if not branches:
        raise ValueError("the input is constant: there is no branch to draw")
    typical = int(np.median([branch.stop - branch.start for branch in branches]))
    n_bins = bins or max(1, min(_MOST_BINS, typical // 2))
    edges = np.linspace(record.u.min(), record.u.max(), n_bins + 1)
    residual, tables = (record.y - y) / quantum, []
    for sign in (1.0, -1.0):
        same_way = [part for part in branches if sign * (record.u[part.stop - 1] - record.u[part.start]) > 0.0]
        rows = [_means(record.u[part], residual[part], edges) for part in same_way]
        tables.append(np.array(rows).reshape(-1, n_bins))
    reach = max(float(np.nanmax(np.abs(table))) for table in tables if table.size) or 1.0
    scale: dict[str, Any] = {"cmap": DIVERGING, "norm": Normalize(-reach, reach)}
    with several(axes, 2, height=3.4, columns=2, sharey=True) as panels:
        for ax, table, name in zip(panels, tables, ("loading", "unloading"), strict=True):
            ax.grid(visible=False)
            ax.pcolormesh(edges, np.arange(len(table) + 1) + 0.5, table, **scale, **_SEAMLESS)
            ax.set_title(name, loc="left")
            ax.set_xlabel(label(record.units, "u"))
            ax.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        panels[0].set_ylabel("Cycle")
        panels[0].figure.colorbar(ScalarMappable(**scale), ax=list(panels), label=in_unit("Residual", unit))
    return panels


def forc(
    source: PreisachRelays | Preisach | Record | Forc,
    ax: Axes | None = None,
    *,
    coordinates: Literal["thresholds", "centre"] = "thresholds",
    smoothing: float | Literal["auto"] | None = "auto",
    units: Mapping[str, str] | None = None,
    tolerance: float = TOLERANCE,
) -> Axes:
    """Draw the density of relays over their thresholds: the diagram of first-order reversal curves.

    Grey is zero, lighter is more, darker is less. Of a law the density is the weight of the relays in a cell over its
    area; the cells along the diagonal, whose relays switch at one input, are triangles. Of a record of curves it is
    that of `hysim.forc`, with its ridge, the largest density at each half distance, and the central line, middle 0.
    Without smoothing, or of fewer than ten curves, it is `hysim.Preisach.from_reversal_curves` on the turning points.

    `source` is a Preisach, a PreisachRelays, the result of `hysim.forc`, or a Record of curves such as
    `hysim.signals.reversal_curves`, whose reversals up to the fraction `tolerance` of its span are ignored; `smoothing`
    is that of `hysim.forc`, or None. `coordinates` are ``"thresholds"``, the upper one a over the lower one b; or
    ``"centre"``, the middle (a + b) / 2, known as bias or interaction field, over half the distance (a - b) / 2, known
    as coercivity. `units` are labels of the units of ``"u"`` and ``"y"``.

    Raises
    ------
    ValueError
        If the law has no relays, the record does not consist of reversal curves, or `coordinates` is another word.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 21), lambda a, b: np.exp(b - a))
    >>> hs.plot.forc(law, hs.plot.figure().add_subplot()).get_xlabel()
    'Lower threshold b'
    """
    if coordinates not in _COORDINATES:
        raise ValueError(f'coordinates must be "thresholds" or "centre", got {coordinates!r}')
    labels: Mapping[str, str] = source.units if units is None and isinstance(source, Record) else units or {}
    law = _measured(source, smoothing, tolerance) if isinstance(source, Record) else source
    place, names = _COORDINATES[coordinates]
    if isinstance(law, Forc):
        step = float(law.levels[1] - law.levels[0])
        levels, density = np.append(law.levels - step / 2.0, law.levels[-1] + step / 2.0), law.density
    elif not law.levels:
        raise ValueError("the law has no relays: give it levels and weights, or a record of reversal curves")
    else:
        levels = np.array(law.levels)
        density = _density(levels, np.array(law.weights))
    reach = float(np.nanmax(np.abs(density))) or 1.0
    with one(ax, height=4.8) as axes:
        axes.grid(visible=False)
        b, a = np.meshgrid(levels, levels)
        cells = axes.pcolormesh(*place(a, b), density, cmap=DIVERGING, norm=Normalize(-reach, reach), **_SEAMLESS)
        corners = np.column_stack(place(levels[[0, -1, -1]], levels[[0, 0, -1]]))
        half = axes.add_patch(Polygon(corners, fill=False, edgecolor=GUIDE, linewidth=0.8))
        cells.set_clip_path(half)
        if isinstance(law, Forc):
            _draw_ridge(axes, law, place)
        axes.set(**{f"{axis}label": in_unit(name, labels.get("u", "")) for axis, name in zip("xy", names, strict=True)})
        axes.set(xlim=(corners[:, 0].min(), corners[:, 0].max()), ylim=(corners[:, 1].min(), corners[:, 1].max()))
        unit = f"{labels['y']}/{in_brackets(labels['u'])}²" if {"u", "y"} <= labels.keys() else ""
        axes.figure.colorbar(cells, ax=axes, label=in_unit("Density of relays", unit))
    return axes


def _measured(record: Record, smoothing: float | Literal["auto"] | None, tolerance: float) -> Forc | Preisach:
    """The smoothed density of a record's curves, or a law between few of them."""
    falls = [branch.u[0] for branch in record.branches(tolerance) if branch.u[-1] < branch.u[0]]
    levels = np.unique([record.u.min(), *falls])
    if levels.size <= _FEWEST_CURVES:
        raise ValueError(
            f"a density needs at least {_FEWEST_CURVES} reversal curves from different levels, the record has "
            f"{levels.size - 1}: measure along hysim.signals.reversal_curves"
        )
    if smoothing is None or (smoothing == "auto" and levels.size <= FEWEST):
        return Preisach.from_reversal_curves(record, levels=levels, tolerance=tolerance)
    return measured_density(record, smoothing=smoothing, tolerance=tolerance)


def _draw_ridge(axes: Axes, diagram: Forc, place: Callable[..., tuple[Any, Any]]) -> None:
    distance, middle = diagram.ridge[:, :2].T
    end = min(diagram.levels[-1], -diagram.levels[0])
    axes.plot(*place(middle + distance, middle - distance), ".", color=MEASURED, markersize=2.0, label="ridge")
    if end > 0.0:
        ends = np.array([0.0, end])
        axes.plot(*place(ends, -ends), color=GUIDE, linewidth=0.8, linestyle="--", label="central line")
    axes.legend(loc="best")


def _means(u: FloatArray, values: FloatArray, edges: FloatArray) -> FloatArray:
    """Mean of the values whose input is between two edges, nan without values."""
    place = np.clip(np.searchsorted(edges, u, side="right") - 1, 0, edges.size - 2)
    count, total = (np.bincount(place, weights, edges.size - 1) for weights in (None, values))
    return np.asarray(np.divide(total, count, out=np.full(count.size, np.nan), where=count > 0))


def _density(levels: FloatArray, weights: FloatArray) -> FloatArray:
    """Weight over area (n_levels - 1, n_levels - 1), upper thresholds along axis 0; nan above the diagonal."""
    n = levels.size - 1
    density = np.full((n, n), np.nan)
    length = np.diff(levels)
    density[np.tril_indices(n)] = weights
    return np.asarray(density / np.outer(length, length) * np.where(np.eye(n, dtype=bool), 2.0, 1.0))
