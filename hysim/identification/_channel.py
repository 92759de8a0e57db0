"""Laws that depend on a channel: the curve of a parameter against it, and the value of a channel on a record.

A search for that value keeps the law: the standard error is that of the noise of this record alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim._basics.printing import frozen_result, quantity, summary_text
from hysim._basics.results import model_of
from hysim._columns.channels import value_in
from hysim.identification._identify import identify
from hysim.identification._result import Identification
from hysim.models.dependent import Dependent
from hysim.models.parameters import Coordinate, space_of
from hysim.models.protocols import Subject
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.storage import Stored
from hysim.models.varying import ChannelPolynomial, power_coefficients, weights
from hysim.records import Record

_LEVEL = 0.95


@frozen_result
class ParameterCurve(Stored):
    """An identified parameter as a polynomial of its channel.

    Parameters
    ----------
    polynomial : ChannelPolynomial
        The polynomial, by its values at places of the channel.
    covariance : array, shape (n_places, n_places)
        Covariance of these values; nan where the data do not determine them.
    reach : float
        Half an interval at 95 % in standard errors, by Student's t.
    """

    json_name = "parameter curve"

    polynomial: ChannelPolynomial
    covariance: FloatArray
    reach: float

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of the powers 0, 1, ... of the channel."""
        return self.polynomial.coefficients

    @property
    def coefficients_stderr(self) -> tuple[float, ...]:
        """Their standard errors."""
        return tuple(_roots(power_coefficients(self.polynomial.at).T, self.covariance).tolist())

    def value(self, channel: npt.ArrayLike) -> FloatArray:
        """Value of the parameter at values of the channel, of the same shape."""
        return self.polynomial.value(channel)

    def stderr(self, channel: npt.ArrayLike) -> FloatArray:
        """Standard error of the parameter at values of the channel, of the same shape."""
        return _roots(weights(self.polynomial.at, channel), self.covariance)

    def band(self, channel: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Ends of the interval at 95 % at values of the channel, in their shape; it holds at each value alone."""
        middle, half = self.value(channel), self.reach * self.stderr(channel)
        return middle - half, middle + half

    def __str__(self) -> str:
        known = self.polynomial
        low, high = known.span
        return summary_text(
            [f"{known.parameter} of degree {known.degree} in {known.channel}, {quantity(low)} to {quantity(high)}"],
            {
                f"{known.channel} = {place:.6g}": f"{float(self.value(place)):.6g} +- {float(self.stderr(place)):.2g}"
                for place in known.at
            },
        )


def parameter_curve(fit: Identification, parameter: str) -> ParameterCurve:
    """The polynomial that a parameter was identified as, with its uncertainty.

    Parameters
    ----------
    fit : Identification
        A result of `hysim.identify` with `depends`.
    parameter : str
        A parameter that depends on a channel.

    Returns
    -------
    ParameterCurve
        Its values, band and coefficients; the covariance is of the linearised model, whatever the fit's intervals are.

    Raises
    ------
    TypeError
        If the model of the fit does not depend on channels.
    ValueError
        If the parameter does not.

    Examples
    --------
    >>> import hysim as hs
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    >>> recs = [hs.Record(u=u, y=T * hs.Play(threshold=0.2).response(u), channels={"T": T}) for T in (1.0, 2.0, 4.0)]
    >>> curve = hs.parameter_curve(hs.identify(hs.Play, recs, depends={"gain": ("T", 1)}), "gain")
    >>> round(float(curve.value(3.0)), 6), [round(c, 6) + 0.0 for c in curve.coefficients]
    (3.0, [0.0, 1.0])
    """
    from scipy.stats import t

    if not isinstance(fit, Identification) or not isinstance(fit.model, Dependent):
        kind = type(fit.model if isinstance(fit, Identification) else fit).__name__
        raise TypeError(f"parameter_curve takes a result of identify with depends=, got one of a {kind}")
    known = {each.parameter: each for each in fit.model.polynomials}
    if parameter not in known:
        raise ValueError(f"{parameter!r} depends on no channel; those that do are {', '.join(known)}")
    names = known[parameter].names
    places = [fit.free_names.index(name) for name in names if name in fit.free_names]
    covariance = fit.covariance[np.ix_(places, places)] if places else np.zeros((len(names), len(names)))
    reach = float(t.ppf(0.5 + 0.5 * _LEVEL, fit.residual.size - fit.n_parameters))  # nan without degrees of freedom
    return ParameterCurve(polynomial=known[parameter], covariance=covariance, reach=reach)


def _roots(rows: FloatArray, covariance: FloatArray) -> FloatArray:
    """Standard errors of the combinations `rows` (..., n_places) of the values."""
    variance = np.einsum("...i,ij,...j->...", rows, covariance, rows)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


_SCREENED = 64
_STARTS = (0.25, 0.5, 0.75)  # of the channel's range
_SAME = 1e-6  # of that range, and of a parameter: differences that are rounding


def estimate_channel(
    fit_or_model: Identification | Dependent,
    record: Record,
    channel: str,
    *,
    bounds: tuple[float, float] | None = None,
    initial: str | None = None,
    seed: int = 0,
) -> Identification:
    """Estimate one number, the constant value of a channel on a record, such as an unknown supply.

    Parameters
    ----------
    fit_or_model : Identification or Dependent
        A result of `hysim.identify` with `depends`, or its model.
    record : Record
        Input and output, and the other channels of the model, constant.
    channel : str
        The channel whose value is not known; a value in the record is ignored.
    bounds : (float, float), optional
        Lowest and highest value; by default the range in which the parameters were identified.
    initial : str, optional
        As in `hysim.identify`; by default the state at the first sample is identified too.
    seed : int
        As in `hysim.identify`.

    Returns
    -------
    Identification
        With the channel among `estimates`, `stderr` and `intervals`; its model is the ordinary law at this value. The
        interval is for the noise of this record alone, as if the law were known exactly.

    Raises
    ------
    TypeError
        If the model does not depend on channels, or the memory of its law has several numbers.
    ValueError
        If it does not depend on this one, or the record lacks another one.

    Examples
    --------
    >>> import hysim as hs
    >>> gain = hs.ChannelPolynomial(parameter="gain", channel="T", at=(20.0, 60.0), values=(2.0, 1.0))
    >>> stack = hs.Dependent(law=hs.BoucWen(beta=2.0), polynomials=(gain,))
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40)
    >>> fit = hs.estimate_channel(stack, hs.Record(u=u, y=stack.at(T=42.5).response(u)), "T")
    >>> round(fit.estimates["T"], 6)
    42.5
    """
    model = model_of(fit_or_model)
    if not isinstance(model, Dependent):
        raise TypeError(f"estimate_channel takes a law that depends on channels, got {type(model).__name__}")
    if channel not in model.channels:
        raise ValueError(f"the law depends on {', '.join(map(repr, model.channels))}, not on {channel!r}")
    if not isinstance(record, Record):
        raise TypeError(f"estimate_channel takes one Record, got {type(record).__name__}: call it for each of several")
    others = {name: value_in(record.channels, name, "the record") for name in model.channels if name != channel}
    if varying := [name for name, value in others.items() if np.ndim(value)]:
        raise ValueError(f"{varying[0]!r} varies along the record; one number can be estimated where it is constant")
    low, high = pair = model.channels[channel] if bounds is None else np.broadcast_to(bounds, 2)
    if not np.isfinite(pair).all() or not low < high:
        raise ValueError(f"bounds of {channel!r} must be finite, (lower, upper) with lower < upper, got {bounds}")
    space = model.law.search_space(record)
    if not {*space.state} <= {*model.law.scalars}:
        raise TypeError(f"estimate_channel takes a law whose memory has one number, got a {type(model.law).__name__}")
    state = tuple(name for name in space.state if name in (*space.coordinates, *space.linear))
    subject = _UnknownChannel(model, channel, others, (float(low), float(high)), space.columns, state)
    fit = identify(subject, record, initial=initial, admissible=False, seed=seed)
    if (value := fit.estimates[channel]) in (low, high):
        end = f"{channel} is at {value:g}, the end of its range; the record may lie beyond: give bounds="
        fit = replace(fit, success=False, message=end, warnings=(*fit.warnings, end))
    doubts = [model.extrapolation({**others, channel: fit.estimates[channel]})]
    for other in _alike([each for each in model.polynomials if each.channel == channel], value, low, high):
        doubts.append(f"{channel} = {other:.6g} gives the same law: the record does not decide between the two")
    return replace(fit, warnings=(*fit.warnings, *filter(None, doubts)))


def _alike(curves: Sequence[ChannelPolynomial], value: float, low: float, high: float) -> list[float]:
    """Other values of a channel, in a range, at which all its parameters are those at `value`."""
    bent = max(curves, key=lambda each: each.degree)
    roots = np.polynomial.Polynomial.fit(bent.at, np.array(bent.values) - bent.value(value), bent.degree).roots().real
    apart = roots[(roots >= low) & (roots <= high) & (np.abs(roots - value) > _SAME * (high - low))].tolist()
    return [x for x in apart if all(abs(p.value(x) - p.value(value)) <= _SAME * np.abs(p.values).max() for p in curves)]


@dataclass(frozen=True)
class _UnknownChannel(Subject):
    """A law with one unknown number, the value of a channel, and an unknown state at the first sample."""

    model: Dependent
    channel: str
    others: Mapping[str, float]
    bounds: tuple[float, float]
    columns: tuple[str, ...]  # in which the law's output is affine
    state: tuple[str, ...]  # the law's numbers that are searched beside the channel

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        law = self.model.law
        fixed = {name: value for name, value in law.scalars.items() if name not in self.state}
        own: SearchSpace = law.search_space(record, replace(freedom, fixed=fixed))
        low, high = self.bounds
        place = Coordinate(self.channel, low, high, max(abs(low), abs(high)))
        points = [{self.channel: low + share * (high - low)} for share in _STARTS]
        alone = space_of([place], (), points[0], {}, {}, points)
        starts = own.starts[:1] if own.coordinates else np.empty((1, 0))
        return replace(
            own,
            held={name: value for name, value in own.held.items() if name in self.state},
            physical={**own.physical, self.channel: (True, True)},  # where the box ends, whatever lies beyond
            coordinates=(self.channel, *own.coordinates),
            lower=np.append(alone.lower, own.lower),
            upper=np.append(alone.upper, own.upper),
            starts=np.concatenate([alone.starts, np.repeat(starts, len(alone.starts), axis=0)], axis=1),
            names=(self.channel, *own.names),
            columns=tuple(name for name in self.columns if name in self.state),
            parameters=lambda x: {
                **{name: values for name, values in own.parameters(x[:, 1:]).items() if name in self.state},
                **alone.parameters(x[:, :1]),
            },
            regions={},
            drawn=None,
            encoded=None,
            screened=_SCREENED,
        )

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        numbers = {**self.model.law.scalars, **self._numbers(parameters)}
        columns = np.asarray(self.model.law.regressors(numbers, record))
        output, own = columns[..., -1:], [k for k, name in enumerate(self.columns) if name in self.state]
        for k in {*range(len(self.columns))} - {*own}:
            output = output + np.reshape(numbers[self.columns[k]], (-1, 1, 1)) * columns[..., k : k + 1]
        return np.concatenate([np.broadcast_to(columns[..., own], (*output.shape[:-1], len(own))), output], axis=-1)

    def steady(self, parameters: Parameters, record: Record) -> dict[str, Any]:
        state = self.model.law.steady({**self.model.law.scalars, **self._numbers(parameters)}, record)
        return {**parameters, **{name: state[name] for name in self.state}}

    def _numbers(self, parameters: Parameters) -> dict[str, Any]:
        """The law's numbers that are searched, and those that depend on channels, (n_sets,) each."""
        values = dict(parameters)
        channels: dict[str, Any] = {**self.others, self.channel: np.atleast_1d(values.pop(self.channel))}
        return values | {each.parameter: each.value(channels[each.channel]) for each in self.model.polynomials}

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        law = self.model.constant({**self.others, self.channel: parameters[self.channel]})
        return law.with_scalars({name: parameters[name] for name in self.state})
