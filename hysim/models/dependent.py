"""A law whose parameters are polynomials of channels; where these vary, the parameters change sample by sample."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim._columns.channels import Channels, checked_channels, steady, taken, value_in
from hysim.models.dependent_structure import DependentStructure
from hysim.models.model import family, not_offered
from hysim.models.parts import response_of
from hysim.models.protocols import Numbered, Responding, first_input, input_range, needs_time, placed
from hysim.models.varying import ChannelPolynomial, response_along, weights
from hysim.records import Record

_ROUNDING = 1e-9  # of a sample's number


@family
class Dependent:
    """A law, some of whose parameters are polynomials of channels.

    Parameters
    ----------
    law : model
        A law, or a sum of laws and dashpots, with the other parameters; dependent ones have any valid value.
    polynomials : tuple of ChannelPolynomial
        One for each parameter that depends on a channel.

    Raises
    ------
    TypeError, ValueError
        If the law has no named numbers and response; if a parameter is unknown or has two polynomials, or a value at a
        place makes no law.

    Examples
    --------
    >>> import hysim as hs
    >>> gain = hs.ChannelPolynomial(parameter="gain", channel="T", at=(20.0, 60.0), values=(2.0, 1.0))
    >>> stack = hs.Dependent(law=hs.BoucWen(), polynomials=(gain,))
    >>> stack.at(T=30.0).gain
    1.75
    >>> stack.response([0.0, 1.0, 0.5], channels={"T": [20.0, 30.0, 40.0]}).round(6).tolist()
    [0.0, 1.106211, 0.198181]
    """

    law: Any
    polynomials: tuple[ChannelPolynomial, ...]

    def __post_init__(self) -> None:
        law = self.law
        if isinstance(law, type) or not isinstance(law, Numbered) or not isinstance(law, Responding):
            raise TypeError(f"law must be a model with named numbers and a response, got {law!r}")
        if not isinstance(self.polynomials, tuple | list):
            raise TypeError(f"polynomials must be a tuple of ChannelPolynomial, got {self.polynomials!r}")
        object.__setattr__(self, "polynomials", tuple(self.polynomials))
        for each in self.polynomials:
            if not isinstance(each, ChannelPolynomial):
                raise TypeError(f"polynomials must hold ChannelPolynomial, got {each!r}")
            if each.parameter not in law.scalars:
                known = ", ".join(law.scalars)
                raise ValueError(f"the law has no parameter {each.parameter!r}; its parameters are {known}")
            for value in each.values:
                law.with_scalars({each.parameter: value})
        named = [each.parameter for each in self.polynomials]
        if twice := [name for name in named if named.count(name) > 1]:
            raise ValueError(f"{twice[0]!r} has two polynomials; it depends on one channel only")

    candidates = not_offered  # what depends on which channel is the user's to say

    @classmethod
    def structure(cls, law: Any, depends: Mapping[str, tuple[str, int]]) -> DependentStructure:
        """A law and what depends on which channel, for `hysim.select` and `hysim.compare`.

        Parameters
        ----------
        law : model, class or structure
            As `hysim.identify` takes it, which has the same by its argument `depends`.
        depends : mapping
            Parameter to (channel, degree).

        Examples
        --------
        >>> import hysim as hs
        >>> u = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40)
        >>> recs = [hs.Record(u=u, y=T * hs.Play(threshold=0.2).response(u), channels={"T": T}) for T in (1.0, 2.0)]
        >>> fit = hs.identify(hs.Dependent.structure(hs.Play, {"gain": ("T", 1)}), recs)
        >>> round(fit.model.at(T=1.5).gain, 6)
        1.5
        """
        return DependentStructure(law=law() if isinstance(law, type) else law, depends=depends, model=cls)

    @property
    def dynamic(self) -> bool:
        """Whether the law depends on time."""
        return needs_time(self.law)

    @property
    def channels(self) -> dict[str, tuple[float, float]]:
        """Channels by name, and the range in which all polynomials of each are known."""
        ranges: dict[str, tuple[float, float]] = {}
        for each in self.polynomials:
            low, high = ranges.get(each.channel, (-np.inf, np.inf))
            ranges[each.channel] = (max(low, each.span[0]), min(high, each.span[1]))
        return ranges

    @property
    def u0(self) -> float | None:
        """Input at which the initial memory holds; None for the first sample of any input."""
        return first_input(self.law)

    @property
    def u_range(self) -> tuple[float, ...] | None:
        """Lowest and highest input of the record that the law was identified on; None if unknown."""
        return input_range(self.law)

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> "Dependent":
        """This model with the memory of its law at the input `u0`."""
        return replace(self, law=placed(self.law, u0, u_range))

    @property
    def scalars(self) -> dict[str, float]:
        """The law's constant numbers, and the values of the polynomials, by name."""
        dependent = {each.parameter for each in self.polynomials}
        numbers = {name: value for name, value in self.law.scalars.items() if name not in dependent}
        return numbers | {
            name: value for each in self.polynomials for name, value in zip(each.names, each.values, strict=True)
        }

    def at(self, **channels: float) -> Any:
        """The ordinary law at one value of each channel.

        A value outside the identified range of a channel is an extrapolation, and warned of. Raises ValueError if a
        channel is missing or unknown, or the polynomials there make no law.

        Examples
        --------
        >>> import hysim as hs
        >>> gain = hs.ChannelPolynomial(parameter="gain", channel="T", at=(20.0, 60.0), values=(2.0, 1.0))
        >>> hs.Dependent(law=hs.Play(), polynomials=(gain,)).at(T=60.0)
        Play(threshold=1.0, gain=1.0, offset=0.0, z0=0.0)
        """
        if unknown := set(channels) - set(self.channels):
            known = ", ".join(map(repr, self.channels)) or "no channel"
            raise ValueError(f"the law depends on {known}, got {sorted(unknown)[0]!r}")
        for name, value in channels.items():
            if np.ndim(value):
                raise ValueError(f"{name} must be one number, got {np.size(value)}: use response(u, channels=...)")
        values = checked_channels(channels, 0)
        self._warn(values)
        return self.constant(values)

    def response(
        self, u: npt.ArrayLike, sample_time: float | None = None, *, channels: Channels | None = None
    ) -> FloatArray:
        """Output (n,) [unit of y] at the samples of an input `u` (n,); `sample_time` [s] where the law depends on time.

        `channels` are names to one number, or to values (n,); further ones are ignored. Where a channel varies, each
        branch between two samples has the parameters of the sample at its end, and the memory is kept. Raises
        ValueError if a channel is missing, not finite or of another length, or the polynomials make no law there;
        TypeError if a parameter that depends on a varying channel cannot change from sample to sample.
        """
        inputs = read_only(u, "u", ndim=1)
        values = self._needed(checked_channels(channels or {}, inputs.size))
        if not inputs.size:
            return inputs
        self._warn(values)
        if not any(isinstance(value, np.ndarray) for value in values.values()):
            return response_of(self.constant(values), inputs, sample_time)
        return self._along(inputs, sample_time, values)

    def on(self, record: Record) -> Any:
        """The law on the channels of a record, an `AlongRecord` where they vary; ValueError if the record lacks one."""
        values = {name: value_in(record.channels, name, "the record") for name in self.channels}
        if not any(isinstance(value, np.ndarray) for value in values.values()):
            return self.at(**values)
        return AlongRecord(self, record)

    def constant(self, channels: Mapping[str, float]) -> Any:
        """As `at`, without a warning; ValueError if a channel is missing."""
        values = self._needed(channels)
        numbers = {each.parameter: float(each.value(values[each.channel])) for each in self.polynomials}
        return self.law.with_scalars(numbers)

    def extrapolation(self, channels: Channels) -> str:
        """A sentence where a value of some channels is outside the identified range; else the empty text."""
        for each in self.polynomials:
            if each.channel in channels and not each.is_known_at(channels[each.channel]):
                (low, high), reached = each.span, np.ravel(channels[each.channel])
                worst = float(reached.max() if reached.max() > high else reached.min())
                return (
                    f"{each.channel} = {worst:g} is outside the range {low:g} to {high:g} in which {each.parameter} "
                    "was identified: the law is an extrapolation"
                )
        return ""

    def _needed(self, channels: Channels) -> dict[str, Any]:
        """The channels that matter; ValueError if one is missing."""
        for name in self.channels:
            if name not in channels:
                raise ValueError(
                    f"the law depends on the channel {name!r}: give response(u, channels={{{name!r}: ...}}), or take "
                    f"the law at one value, at({name}=...)"
                )
        return {name: steady(channels[name]) for name in self.channels}

    def _warn(self, channels: Channels) -> None:
        if doubt := self.extrapolation(channels):
            warnings.warn(doubt, stacklevel=3)

    def _along(self, u: FloatArray, sample_time: float | None, values: Mapping[str, Any]) -> FloatArray:
        kinds = {(each.at, each.channel) for each in self.polynomials}  # parameters have most of them in common
        shares = {(at, channel): weights(at, values[channel]) for at, channel in kinds}
        series = {each.parameter: shares[each.at, each.channel] @ np.array(each.values) for each in self.polynomials}
        for name, each in series.items():
            for value in (float(each.min()), float(each.max())):
                self.law.with_scalars({name: value})  # which refuses what makes no law
        constant = self.law.with_scalars({name: float(each) for name, each in series.items() if not each.ndim})
        return response_along(constant, {name: each for name, each in series.items() if each.ndim}, u, sample_time)


@runtime_checkable
class _OnChannels(Protocol):
    def on(self, record: Record) -> Any: ...


def on_record(model: Any, record: Record) -> Any:
    return model.on(record) if isinstance(model, _OnChannels) else model


@dataclass(frozen=True)
class AlongRecord:
    """A law, or an actuator of several inputs, on varying channels; each branch takes the parameters at its end."""

    model: Any
    record: Record

    @property
    def dynamic(self) -> bool:
        return bool(self.model.dynamic)

    def response(self, u: npt.ArrayLike, sample_time: float | None = None) -> FloatArray:
        """Output at the samples of an input over the branches of the record, equally many for each."""
        inputs = read_only(u, "u", ndim=1)
        ends = np.ceil(np.linspace(0, len(self.record) - 1, inputs.size) - _ROUNDING).astype(np.intp)
        return np.asarray(self.model.response(inputs, sample_time, channels=taken(self.record.channels, ends)))
