"""Pictures of discoveries, tunings, camera measurements, describing functions, fragility and parameters that change."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from hysim._basics.prefixes import in_brackets, in_unit, label
from hysim._basics.results import model_of
from hysim._columns.channels import steady
from hysim.control import Tuning
from hysim.discovery import Discovery, OscillatorDiscovery
from hysim.identification import Identification, ParameterCurve, parameter_curve
from hysim.metrics import describing_function as describing_function_of
from hysim.plot._style import MEASURED, POINTS, AxesArray, AxesLike, line, one, scattered, several
from hysim.records import Record
from hysim.sweeps import Fragility
from hysim.tracking import ParameterTrack
from hysim.vision import Displacement

_WORST_FIT = 5.0  # below the best fit [%]: worse structures would hide the differences that matter
_WORST_OBJECTIVE = 30.0  # over the chosen objective
_BAND = 2.0  # standard errors


def selection(discovery: Discovery | OscillatorDiscovery, axes: AxesLike | None = None) -> AxesArray:
    """Draw the fit and the BIC of the free run of a discovery against the number of terms, on two Axes.

    `discovery` is a result of `hysim.discover` or `hysim.discover_oscillator`. Circles are the structures on the path
    of thresholds. The chosen law is a diamond; it may be off the path, as the search removes further terms. A cross on
    the edge fits 5 % worse than the best, or its free run diverges. The result has shape (2,).
    """
    n_terms, fits, scores = discovery.path_n_terms, discovery.path_fit_percent, discovery.scores
    shown = fits >= fits.max(initial=scores["fit_percent"]) - _WORST_FIT
    with several(axes, 2, height=2.2) as (upper, lower):
        for ax, path, measure, edge in ((upper, fits, "fit_percent", 0.0), (lower, discovery.path_bic, "bic", 1.0)):
            circles: dict[str, Any] = {"color": MEASURED, "markerfacecolor": "white", "label": "path of thresholds"}
            ax.plot(n_terms[shown], path[shown], "o", **circles)
            ax.plot(scores["n_terms"], scores[measure], "D", color=line(0)["color"], markersize=7, label="chosen law")
            if not shown.all():
                edges = np.full(np.count_nonzero(~shown), edge)
                on_edge = {"transform": ax.get_xaxis_transform(), "clip_on": False, "label": "off the scale"}
                ax.plot(n_terms[~shown], edges, "x", color=MEASURED, **on_edge)
            ax.margins(y=0.15)
        upper.set_ylabel("Fit in free run [%]")
        lower.set(xlabel="Number of terms", ylabel="BIC")
        lower.xaxis.get_major_locator().set_params(integer=True)
        upper.legend()
    return np.array([upper, lower])


def fragility(curve: Fragility, ax: Axes | None = None) -> Axes:
    """Draw a `curve` of `hysim.fragility` with its confidence band, and the observed shares above the limit.

    Examples
    --------
    >>> import hysim as hs
    >>> curve = hs.fragility([0.2, 0.4, 0.6, 0.8, 1.0], [0, 4, 11, 15, 19], 20)
    >>> hs.plot.fragility(curve, ax=hs.plot.figure().add_subplot()).get_xlabel()
    'Intensity'
    """
    x = np.geomspace(curve.intensities.min(), curve.intensities.max(), 200)
    with one(ax) as axes:
        axes.fill_between(x, *curve.band(x), alpha=0.25, linewidth=0.0, color=line(0)["color"])
        axes.plot(x, curve.probability(x), label="lognormal curve", **line(0))
        shares = curve.n_exceeding / curve.n_records
        axes.plot(curve.intensities, shares, color=MEASURED, label="observed", **scattered(shares.size))
        axes.set(xlabel="Intensity", ylabel="Share above the limit")
        axes.legend()
    return axes


def trade_off(tuning: Tuning, ax: Axes | None = None) -> Axes:
    """Draw the objective of a tuning against the maximum sensitivity: all trials, the best of them, and the chosen one.

    `tuning` is a result of `hysim.tune`. Trials 30 times worse than the chosen one, or twice as sensitive, are omitted.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> lag = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    >>> tuning = hs.tune(lag, 0.1 * np.arange(100), np.ones(100))
    >>> hs.plot.trade_off(tuning, ax=hs.plot.figure().add_subplot()).get_xlabel()
    'Maximum sensitivity'
    """
    chosen = tuning.max_sensitivity, tuning.objective
    worst = 2.0 * tuning.max_sensitivity, _WORST_OBJECTIVE * tuning.objective
    simulated: dict[str, Any] = {"linestyle": "none", "color": POINTS, "markersize": 3.0, "label": "simulated"}
    best: dict[str, Any] = {"markersize": 4.0, "drawstyle": "steps-post", "label": "best so robust", **line(0)}
    with one(ax) as axes:
        for trials, style in ((tuning.trials, simulated), (tuning.trade_off, best)):
            points = np.array([(trial.max_sensitivity, trial.objective) for trial in trials])
            axes.plot(*points[(points <= worst).all(axis=1)].T, marker="o", **style)
        axes.plot(*chosen, "D", color=MEASURED, markersize=7, label="chosen")
        axes.set(xlabel="Maximum sensitivity", ylabel="Objective [of the reference's span]", yscale="log")
        axes.legend()
    return axes


def displacement(result: Displacement, ax: Axes | None = None) -> Axes:
    """Draw the displacement of each frame with a band of two standard errors; lost frames are marked below.

    `result` is a result of `hysim.vision.displacement`.

    Examples
    --------
    >>> import hysim as hs
    >>> motion = hs.vision.Displacement(
    ...     y=[0.0, 0.1, 0.3], uncertainty=[0.0, 0.01, 0.01], shift=[[0, 0], [1, 0], [3, 0]], across=[0, 0, 0],
    ...     quality=[1, 0.99, 0.99], status=("ok", "ok", "ok"), scale=0.1, direction=0.0,
    ... )
    >>> hs.plot.displacement(motion, hs.plot.figure().add_subplot()).get_ylabel()
    'Displacement [µm]'
    """
    frames, half, colour = np.arange(len(result)), _BAND * result.uncertainty, line(0)["color"]
    is_blurred, is_lost = (np.array([status == word for status in result.status]) for word in ("blurred", "lost"))
    with one(ax) as axes:
        shade = {"color": colour, "alpha": 0.25, "linewidth": 0.0, "label": "± 2 standard errors"}
        axes.fill_between(frames, result.y - half, result.y + half, **shade)
        axes.plot(frames, result.y, marker=".", markersize=4.0, linewidth=0.8, color=colour)
        if is_blurred.any():
            rings = {"mfc": "none", "color": line(1)["color"], "label": "blurred"}
            axes.plot(frames[is_blurred], result.y[is_blurred], "o", **rings)
        if is_lost.any():
            at = np.full(is_lost.sum(), 0.03)
            axes.plot(frames[is_lost], at, "x", color=MEASURED, transform=axes.get_xaxis_transform(), label="lost")
        axes.set(xlabel="Frame", ylabel=label(result.units, "y"))
        axes.legend()
    return axes


def describing_function(
    law: Any,
    amplitudes: npt.ArrayLike,
    axes: AxesLike | None = None,
    *,
    mean: float = 0.0,
    units: Mapping[str, str] | None = None,
) -> AxesArray:
    """Draw gain and phase of a law's first harmonic against the amplitude of a sine, on two Axes.

    `law` is a rate-independent law, or a mapping of names to laws; `amplitudes`, shape (n,), increase [unit of u];
    `mean` is the input in the middle of the cycle [unit of u]; `units` are labels of the units of ``"u"`` and ``"y"``.
    A phase is left out where the gain is zero. Errors are those of `hysim.metrics.describing_function`.

    Examples
    --------
    >>> import hysim as hs
    >>> laws = {"play": hs.Play(threshold=1.0), "stop": hs.Stop(threshold=1.0)}
    >>> gain, phase = hs.plot.describing_function(laws, [1.5, 2.0, 4.0], hs.plot.figure().subplots(2))
    >>> gain.get_ylabel(), phase.get_ylabel()
    ('Gain', 'Phase [degrees]')
    """
    labels = units or {}
    law = model_of(law)
    laws = law if isinstance(law, Mapping) else {type(law).__name__: law}
    with several(axes, 2, height=2.4) as (upper, lower):
        for k, (name, each) in enumerate(laws.items()):
            harmonic = describing_function_of(each, amplitudes, mean=mean)
            phase = np.where(harmonic == 0.0, np.nan, np.degrees(np.angle(harmonic)))
            upper.plot(amplitudes, np.abs(harmonic), label=name, **line(k))
            lower.plot(amplitudes, phase, label=name, **line(k))
        gain = f"{labels['y']}/{in_brackets(labels['u'])}" if {"u", "y"} <= labels.keys() else ""
        upper.set_ylabel(in_unit("Gain", gain))
        lower.set(xlabel=in_unit("Amplitude", labels.get("u", "")), ylabel="Phase [degrees]")
        if len(laws) > 1:
            upper.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4)
    return np.array([upper, lower])


_POINTS = 101  # of a curve
_BESIDE = 0.05  # of the range, shown on either side


def parameter(
    fit: Identification | ParameterCurve,
    name: str | None = None,
    ax: Axes | None = None,
    *,
    one_by_one: Sequence[Identification] = (),
    records: Sequence[Record] = (),
    unit: str = "",
) -> Axes:
    """Draw a parameter against its channel, with its band at 95 %.

    `fit` is a result of `hysim.identify` with `depends`, with the `name` of the parameter, or one of
    `hysim.parameter_curve`. `one_by_one` are fits of the law without a dependence to `records` of one value of the
    channel each, drawn with their intervals. `unit` is that of the parameter on the axis; that of the channel is the
    first record's. A ValueError is raised if the parameter depends on no channel, the fits are not as many as the
    records, or a channel varies along one.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    >>> recs = [hs.Record(u=u, y=T * hs.Play(threshold=0.2).response(u), channels={"T": T}) for T in (1.0, 2.0)]
    >>> fit = hs.identify(hs.Play, recs, depends={"gain": ("T", 1)})
    >>> hs.plot.parameter(fit, "gain", ax=hs.plot.figure().add_subplot()).get_xlabel()
    'T'
    """
    curve = fit if isinstance(fit, ParameterCurve) else parameter_curve(fit, name or "")
    if len(one_by_one) != len(records):
        raise ValueError(f"give one record for each fit, got {len(one_by_one)} fits and {len(records)} records")
    known = curve.polynomial
    low, high = known.span
    margin = _BESIDE * (high - low)
    channel = np.linspace(low - margin, high + margin, _POINTS)
    units = records[0].units if records else {}
    style: dict[str, Any] = line(0)
    with one(ax, height=3.0) as axes:
        axes.fill_between(channel, *curve.band(channel), color=style["color"], alpha=0.25, linewidth=0.0)
        axes.plot(channel, curve.value(channel), label="jointly", **style)
        for k, (each, record) in enumerate(zip(one_by_one, records, strict=True)):
            place: Any = steady(record.channel(known.channel))
            if np.ndim(place):
                raise ValueError("a channel varies along a record of these fits: a fit stands at one value of it")
            value = each.estimates[known.parameter]
            low, high = each.intervals.get(known.parameter, (np.nan, np.nan))
            points: dict[str, Any] = {"color": MEASURED, "fmt": "o", "markersize": 4, "capsize": 2}
            points["label"] = None if k else "one by one"
            axes.errorbar([place], [value], yerr=[[value - low], [high - value]], **points)
        axes.set(xlabel=in_unit(known.channel, units.get(known.channel, "")), ylabel=in_unit(known.parameter, unit))
        if one_by_one:
            axes.legend()
    return axes


def track(
    result: ParameterTrack,
    name: str | None = None,
    ax: Axes | None = None,
    *,
    t: Sequence[float] | npt.NDArray[Any] | None = None,
    truth: npt.ArrayLike | None = None,
    units: Mapping[str, str] | None = None,
) -> Axes:
    """Draw the path of a number of a law with its band at 95 %.

    `result` is one of `hysim.track_parameters`, and `name` that of the number, by default the first one that is free;
    another one is a KeyError. `t` (n_samples,) are times of the samples, by default their numbers [s], `truth`
    (n_samples,) is what is known of the number otherwise, and `units` has a label of its unit by its name.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.BoucWen(feedthrough=0.5)
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=20)
    >>> result = hs.track_parameters(law, hs.Record(u=u, y=law.response(u)), ["gain"], noise=0.01)
    >>> hs.plot.track(result, "gain").get_ylabel()
    'gain'
    """
    name = result.names[0] if name is None else name
    path, (lower, upper) = result[name], result.band(name)
    x = np.arange(path.size) if t is None else np.asarray(t)
    with one(ax, height=3.0) as axes:
        axes.fill_between(x, lower, upper, alpha=0.25, linewidth=0.0, label="95 %", color=line(0)["color"])
        axes.plot(x, path, label=f"by {result.method}s", **line(0))
        if truth is not None:
            axes.plot(x, np.asarray(truth), label="truth", **line(1))
        axes.set_xlabel("sample" if t is None else "t [s]")
        axes.set_ylabel(in_unit(name, (units or {}).get(name, "")))
        axes.legend()
    return axes
