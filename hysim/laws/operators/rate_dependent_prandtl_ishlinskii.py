"""The rate-dependent Prandtl-Ishlinskii law: plays whose thresholds grow with the speed of the input.

Where the speed is known beforehand, the thresholds are functions of time, and the inverse is a law of the same kind at
the same speed, with the weights and thresholds of the plain law's inverse and beta' = |w_0| beta, because the distances
of the thresholds past the first do not change in time. Where the speed is that of the unknown input, each sample is one
equation for it. With b = beta / sample_time and the sums s_i = w_0 + ... + w_i it has one solution, and its error does
not grow from sample to sample, where all

    s_i - 2 b |s_i - s_0|    (times the sign of s_0)

are positive: samples must be further apart than about 2 beta. The condition on samples is ours.
"""

import math
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_positive, items, read_only
from hysim.kernels import play_sums as kernels
from hysim.laws.friction.rated_law import TimedLaw, kind_at_sample_time
from hysim.laws.operators._bank import Plays
from hysim.laws.operators._bank_search import Axis
from hysim.laws.operators._play_sums import EXAMPLE, ExtendedPlays, PlaySum
from hysim.models.law import State
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.models.tables import check_signs


class WideningPlays(PlaySum):
    """Plays at one sample time, with thresholds ``r_i + width |u_k - u_(k-1)|``."""

    beta: float
    sample_time: float

    @property
    def width(self) -> float:
        """Growth of the thresholds with the step of the input."""
        return self.beta / self.sample_time

    def refusal(self) -> str | None:
        if (refusal := self.plays.refusal()) is not None:
            return refusal
        sums = np.cumsum(self.weights)
        with np.errstate(divide="ignore"):
            limits = np.abs(sums) / (2.0 * np.abs(sums - sums[0]))
        i = int(np.argmin(limits))
        if self.width < limits[i]:
            return None
        return (
            f"the law has no stable inverse at this sample time: beta / sample_time is {self.width:g}, but the sums of "
            f"weights s_i = w_0 + ... + w_i ask for less than |s_i| / (2 |s_i - s_0|), {limits[i]:g} for i = {i}; "
            "give the speed, or take longer samples"
        )

    def response_at(self, u: npt.ArrayLike, widening: FloatArray) -> FloatArray:
        """Output at the samples of `u` of plays whose thresholds are wider by `widening`, shape (n_samples,)."""
        inputs = read_only(u, "u", ndim=1)
        if self.u0 is not None:
            longer = np.append(self.u0, inputs), np.append(widening[:1], widening)
            return np.asarray(self.placed(None).response_at(*longer)[1:])
        y = np.empty(inputs.size)
        parameters, memory = self.packed
        kernels.widened(parameters, memory.copy(), inputs, read_only(widening), y)
        return y


@family
class RateDependentPrandtlIshlinskii(Plays, ExtendedPlays, TimedLaw):
    """Rate-dependent Prandtl-Ishlinskii law, ``y = offset + sum w_i z_i``, thresholds ``r_i + beta |u'|``.

    ::

        rho_i(k) = r_i + beta |u'_k| for r_i > 0,  0 for r_0 = 0        u'_k = (u_k - u_(k-1)) / sample_time
        z_i(k)   = max(u_k - rho_i(k), min(u_k + rho_i(k), z_i(k-1)))

    The input moves evenly from one sample to the next; at the first sample it stands still. `hysim.identify` searches
    for beta, and takes a structure as of `PrandtlIshlinskii.structure`. Sources: M. Al Janaideh and P. Krejci,
    IEEE/ASME Trans. Mechatronics 18 (2013), for the law and the analytic inverse; M. Al Janaideh, P. Krejci and G. A.
    Monteiro, Applications of Mathematics (2023).

    Parameters
    ----------
    thresholds : sequence of float, length n_plays
        r_i at rest, not negative and increasing [unit of u]. The play of threshold zero is the input at every speed.
    weights : sequence of float, length n_plays
        w_i, of any sign [unit of y / unit of u].
    beta : float
        Growth of the thresholds with the speed of the input, not negative [s].
    offset, z0
        As in `PrandtlIshlinskii` [unit of y, unit of u].

    Raises
    ------
    ValueError
        If lengths differ, a number is not finite, beta or a threshold is negative, or the thresholds do not increase.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.RateDependentPrandtlIshlinskii(thresholds=(0.0, 0.25), weights=(1.0, 1.0), beta=0.25)
    >>> [law.response([0.0, 1.0, 0.0], sample_time=h).tolist() for h in (1.0, 2.0)]
    [[0.0, 1.5, 0.5], [0.0, 1.625, 0.375]]
    >>> law.inverse_response([0.0, 1.5, 0.5], sample_time=1.0).tolist()
    [0.0, 1.0, 0.0]
    """

    beta: float = 0.0
    offset: float = 0.0
    z0: tuple[float, ...] = (0.0,)

    example = Example({**EXAMPLE, "beta": 0.005}, title="Prandtl-Ishlinskii: with the rate")
    step = staticmethod(kernels.step)
    at_one_time = WideningPlays
    by_input: ClassVar[bool] = False
    # up to half a span at the highest speed
    axes = (Axis(Parameter("beta", 0.0, 1.0, unit="h/v", physical=(True, False)), (0.0, 0.1, 0.3)),)
    not_negative = ("beta",)

    @classmethod
    def candidates(cls) -> dict[str, Any]:
        """The class itself, which `hysim.compare` tries as it does other plays."""
        return {cls.__name__: cls}

    def at(self, sample_time: float) -> WideningPlays:
        """The law at one sample time [s], as loops step it. Raises ValueError if the sample time is not positive."""
        check_positive(sample_time=sample_time)
        if math.isinf(sample_time):
            return replace(self, beta=0.0).at(1.0)
        kind: Any = kind_at_sample_time(type(self))
        law: WideningPlays = kind(sample_time=sample_time, **items(self))
        return law

    at_sample_time = at

    def response(self, u: npt.ArrayLike, sample_time: float, *, speed: npt.ArrayLike | None = None) -> FloatArray:
        """Output y at the samples of an input that moves evenly between them.

        Parameters
        ----------
        u : array, shape (n_samples,)
            Input; the first sample finds the plays at z0, and pushes them.
        sample_time : float
            Time between two samples [s].
        speed : array, shape (n_samples,), optional
            ``|u'|`` by which the thresholds grow, in place of the input's own [unit of u / s].

        Returns
        -------
        array, shape (n_samples,)

        Raises
        ------
        ValueError
            If u is not finite or has not one axis, sample time is not positive, or speed negative or of another length.
        """
        law = self.at(sample_time)
        if speed is None:
            return law.response(u)
        speeds = read_only(speed, "speed", ndim=1)
        if speeds.size != np.size(u):
            raise ValueError(f"speed must have {np.size(u)} samples as the signal has, got {speeds.size}")
        check_signs({"speed": speeds}, (), ("speed",))
        return law.response_at(u, self.beta * speeds)

    def is_invertible(self, sample_time: float | None = None) -> bool:
        """Whether there is an `inverse`, for a known speed; with a sample time, an `inverse_response` without one."""
        return self.plays.is_invertible() and (sample_time is None or self.at(sample_time).is_invertible())

    def inverse(self) -> Self:
        """The law that gives the input for a wanted output, exactly, at the same speed of the input.

        Use it as ``inverse.response(y, sample_time, speed=...)``. Errors are those of `PrandtlIshlinskii.inverse`.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.RateDependentPrandtlIshlinskii(thresholds=(0.0, 0.25), weights=(2.0, 2.0), beta=0.25)
        >>> law.inverse().beta, law.inverse().thresholds, law.inverse().weights
        (0.5, (0.0, 0.5), (0.5, -0.25))
        """
        plain = self.plays.inverse()
        offset, z0 = 0.0 - self.offset * sum(plain.weights), tuple(z + self.offset for z in plain.z0)
        beta = abs(self.weights[0]) * self.beta
        return type(self)(thresholds=plain.thresholds, weights=plain.weights, beta=beta, offset=offset, z0=z0)

    def inverse_response(
        self,
        y: npt.ArrayLike,
        sample_time: float,
        u0: float | None = None,
        state: State | None = None,
        *,
        speed: npt.ArrayLike | None = None,
    ) -> FloatArray:
        """Input that gives the output `y` every `sample_time` [s], to rounding; see `hysim.Law.inverse_response`.

        With ``speed``, ``|u'|`` of the input (n_samples,) where it is known beforehand, it is the analytic inverse.
        Raises ValueError if the law is not invertible, the sample time is too short for it, z0 holds positions that no
        input leads to, a speed is given beside u0 or state, or an array does not fit.
        """
        if speed is not None:
            if u0 is not None or state is not None:
                raise ValueError("a speed goes with the z0 of the law: replace that in place of u0 or state")
            return self.inverse().response(y, sample_time, speed=speed)
        return self.at(sample_time).inverse_response(y, u0, state)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        """The inverse at a sample time [s], stepped; see `hysim.Law.compiled_inverse`."""
        return self.at(sample_time).compiled_inverse(u0, limits)
