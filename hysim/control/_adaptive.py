"""Feed-forward by the inverse of a law whose numbers drift; `hysim.kernels.adaptive_inverse` has its equations."""

import functools
import math
from typing import Any

import numpy as np

from hysim._basics.frozen import FloatArray, Interval, read_only
from hysim.control._controller import WithoutFeedback, compiled_of
from hysim.kernels import stepping
from hysim.kernels.adaptive_inverse import adaptive
from hysim.models.compiled_step import compiled_step
from hysim.models.inverse_search import searched_inverse
from hysim.models.law import Law
from hysim.models.model import family
from hysim.models.protocols import CompiledController, positive_time

_DIFFERENCE = 1e-4  # of a number: how far its copy of the law is from the law
_AFFINE = 1e-9  # of the parameters of a step: what of them may not be affine in the numbers
_PROBE = 0.1  # of a number, where that is looked at

_bound = functools.lru_cache(maxsize=64)(adaptive)


@family
class AdaptiveInverse(WithoutFeedback):
    """Command by the inverse of a law whose numbers are estimated again at every sample.

    The measurement is compared with the output of the law at the last command, and the numbers that are free move
    towards those that predict it (a Kalman filter of a random walk). A sensor that is late, or a stage that takes time
    between the law and the sensor, is not modelled, and is taken for a drift.

    Parameters
    ----------
    law : law
        A law with an inverse, and with the numbers at the beginning.
    free : sequence of str
        Numbers that drift, as in ``law.scalars``; the parameters of the law's step must be affine in them.
    drift : sequence of float
        For each the change that is expected within one second [unit of each].
    noise : float
        Standard deviation of the measurement [unit of y].
    limits : (float, float), optional
        Lowest and highest command [unit of u].

    Raises
    ------
    TypeError, ValueError
        If the law is none that a step describes; if a name is unknown, lengths differ, a drift or the noise is not
        positive, or the law has no inverse.

    Examples
    --------
    The gain of the plant is 20 % lower than that of the law; the fixed inverse does not see it.

    >>> import numpy as np, hysim as hs
    >>> law, plant = (hs.BoucWen(feedthrough=1.0, gain=gain) for gain in (-0.5, -0.4))
    >>> t = 0.01 * np.arange(2000)
    >>> r = 0.5 * np.sin(2.0 * t)
    >>> adaptive = hs.AdaptiveInverse(law=law, free=("gain",), drift=(0.1,), noise=1e-3)
    >>> run, fixed = (hs.close_loop(plant, each, t, r) for each in (adaptive, hs.InverseFeedforward(law=law)))
    >>> errors = [np.abs(each.y[1001:] - r[1000:-1]).max() for each in (run, fixed)]
    >>> bool(errors[0] < 0.02 * errors[1])
    True
    """

    law: Any
    free: tuple[str, ...]
    drift: tuple[float, ...]
    noise: float
    limits: Interval | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.law, Law):
            raise TypeError(f"law must be a law that a step describes, such as BoucWen, got {type(self.law).__name__}")
        if not self.free or len(self.free) != len(self.drift):
            raise ValueError(f"free and drift must name as many numbers, got {len(self.free)} and {len(self.drift)}")
        if unknown := [name for name in self.free if name not in self.law.scalars]:
            raise ValueError(f"free has {unknown[0]!r}: a {type(self.law).__name__} has {', '.join(self.law.scalars)}")
        if not (min(self.drift) > 0.0 and self.noise > 0.0):
            raise ValueError("drift and noise must be positive")
        if self.law.workspace and self.law.resume is None:
            raise ValueError(f"the workspace of a {type(self.law).__name__} cannot follow numbers that change")
        self._rates()

    @property
    def substitute(self) -> float:
        """Stand-in for a missing measurement: nan, since one of an earlier command would be taken for a drift."""
        return math.nan

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        positive_time(sample_time)
        law, count = self.law, len(self.free)
        parameters, rates = self._rates()
        sizes = self._sizes()
        law0 = law.compiled(u0)._replace(step=compiled_step(law.step))
        own = self._begun(law0.parameters, u0)[1]
        lowest, highest = self.limits or (-math.inf, math.inf)
        inverse = searched_inverse(law, law0._replace(state=own), limits=(lowest, highest))
        search = inverse.parameters.copy()
        search[2] = 0.0  # what is known of the slopes holds for the numbers at the beginning
        places = search.size - parameters.size
        copies = [self._begun(parameters + size * rate, u0) for size, rate in zip(sizes, rates, strict=True)]
        drift = np.square(self.drift) * sample_time
        head = [count, parameters.size, own.size, places, self.noise**2]
        constants: list[Any] = [head, drift, sizes, parameters, rates.ravel()]
        outputs = [output for output, _ in copies]
        covariance = np.diag(np.square(self.drift))
        state: list[Any] = [
            [u0], np.zeros(count), covariance.ravel(), outputs, parameters, parameters, parameters,
            *(each for _, each in copies), search, inverse.state, np.zeros(2 * count),
        ]  # fmt: skip
        step = _bound(compiled_step(law.step), stepping.unchanged if law.resume is None else law.resume)
        return compiled_of(step, constants, state)

    def _sizes(self) -> FloatArray:
        """Differences of the numbers by which the derivatives of the output are computed."""
        values = np.array([self.law.scalars[name] for name in self.free])
        return _DIFFERENCE * np.where(values == 0.0, 1.0, np.abs(values))

    def _rates(self) -> tuple[FloatArray, FloatArray]:
        """Parameters of the law's step, and their derivatives by the free numbers; ValueError if these are not all."""
        law, (here, memory), rates = self.law, self.law.packed, []
        for name in self.free:
            refusal = f"the step of a {type(law).__name__} does not take {name} as it is: it cannot be free"
            if name in law.structural:
                raise ValueError(refusal)
            change = _PROBE * (abs(law.scalars[name]) or 1.0)
            values = law.scalars[name] + np.array([change, -change])
            (ahead, there), (behind, _) = (self._packed(name, value) for value in values)
            if not np.array_equal(memory, there):
                raise ValueError("the memory at the first sample does not drift: leave it out of free")
            bend = np.where(ahead == behind, 0.0, 0.5 * (ahead + behind) - here)
            if not np.abs(bend).max() <= _AFFINE * np.nanmax(np.abs(here)):
                raise ValueError(refusal)
            rates.append(np.where(ahead == behind, 0.0, (ahead - behind) / (values[0] - values[1])))
        return here, np.array(rates)

    def _packed(self, name: str, value: float) -> tuple[FloatArray, FloatArray]:
        law = self.law
        parameters, memory = law.pack(law.completed(law.exchanged({name: np.array([[value]])})))
        return parameters[0], memory[0]

    def _begun(self, parameters: FloatArray, u0: float) -> tuple[float, FloatArray]:
        front = self.law.packed[1]
        state = np.concatenate([front, np.zeros(self.law.workspace)])
        constants = read_only(parameters, finite=False)
        self.law.start(constants, state, u0 if self.law.u0 is None else self.law.u0)
        if self.law.u0 is not None:
            self.law.step(constants, state, self.law.u0)
        return float(self.law.step(constants, state, u0)), state
