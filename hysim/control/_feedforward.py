"""Feed-forward by the inverse of an actuator, in one compiled step; its equations stand in `hysim.kernels.tracking`."""

import math
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.control._sampled import Feedback, SampledController, check_kind, with_inverse
from hysim.kernels import tracking as kernels
from hysim.kernels.stepping import Step
from hysim.laws.static import Line
from hysim.models.inverse_search import inverse_step
from hysim.models.model import family
from hysim.models.protocols import CompiledController, needs_time
from hysim.plants.actuator import Actuator, as_actuator, is_law
from hysim.plants.amplifier import Amplifier
from hysim.plants.creep import Creep


class FeedforwardBlock(NamedTuple):
    """A feed-forward as `hysim.kernels.tracking.feed_forward` takes it."""

    inverse: Step
    parameters: FloatArray
    state: FloatArray


@family
class InverseFeedforward(SampledController):
    """Command that takes a model of an actuator to a wanted displacement, one sample later.

    It closes a loop by itself, or as a part of a `TrackingController`.

    Parameters
    ----------
    law : law, optional
        Any law with an inverse, sums and cascades among them; by default a line of slope one.
    creep : Creep, optional
        Creep to invert: creep and law together meet the wanted displacement at the end of each sample.
    amplifier : Amplifier, optional
        Its gain and offset are inverted, its limits are kept.

    Raises
    ------
    TypeError
        If the law cannot be stepped.
    ValueError
        If the amplifier takes time or has no gain, or the law has no inverse at u = 0.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> law = hs.Dahl() + hs.Line(slope=1.0)
    >>> t = 0.01 * np.arange(200)
    >>> run = hs.close_loop(law, hs.InverseFeedforward(law=law), t, np.sin(t))
    >>> bool(np.abs(run.y[1:] - np.sin(t[:-1])).max() < 1e-12)
    True
    """

    law: Any = None
    creep: Creep | None = None
    amplifier: Amplifier | None = None

    def __post_init__(self) -> None:
        check_kind("creep", self.creep, Creep)
        check_kind("amplifier", self.amplifier, Amplifier)
        if self.amplifier is not None and (self.amplifier.dynamic or not self.amplifier.gain):
            raise ValueError(
                "the amplifier must answer at once and have a gain: its slewing and its lag have no inverse"
            )
        if self.law is None:
            return
        if not is_law(self.law):
            raise TypeError(f"law must be a law that a loop can step, such as BoucWen, got {type(self.law).__name__}")
        if not needs_time(self.law):
            inverse_step(self.law, 0.0)

    @property
    def u0(self) -> float | None:
        """Command at which the memory of its law holds; None for the first one."""
        return self.plant.u0

    @property
    def plant(self) -> Actuator:
        """The actuator that it inverts."""
        return Actuator(amplifier=self.amplifier, hysteresis=self.law, creep=self.creep)

    @property
    def dynamic(self) -> bool:
        """Whether it depends on time: by its creep, or by its law."""
        return self.creep is not None or needs_time(self.law)

    @classmethod
    def of(cls, plant: Any) -> Self:
        """Inverse of the amplifier, law and creep of an actuator, a law or a fit; it raises as the constructor does."""
        actuator = as_actuator(plant)
        return cls(law=actuator.hysteresis, creep=actuator.creep, amplifier=actuator.amplifier)

    def frequency_response(self, frequency: npt.ArrayLike, sample_time: float) -> npt.NDArray[np.complex128]:
        """Zeros: the measurement is not used."""
        return np.zeros(np.shape(frequency), dtype=complex)

    def linear(self, sample_time: float) -> Feedback:
        """No feedback: the measurement is not used."""
        return Feedback(np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0.0)

    def compiled(self, sample_time: float, u0: float = 0.0, y0: float = 0.0) -> CompiledController:
        inverse, parameters, state = self.block(sample_time, u0)
        step = with_inverse(kernels.invert, inverse)
        return CompiledController(step, read_only(parameters, finite=False), np.append(u0, state))

    def block(
        self, sample_time: float, u0: float, commands: tuple[float, float] = (-math.inf, math.inf)
    ) -> FeedforwardBlock:
        """Compiled inverse at rest at the command `u0`, for commands within these limits."""
        amplifier, law = self.amplifier or Amplifier(), Line(slope=1.0) if self.law is None else self.law
        lowest, highest = sorted(amplifier.voltage(commands).tolist())
        inverse = inverse_step(law, float(amplifier.voltage(u0)), (lowest, highest), sample_time)
        creep = self.creep or Creep(time_constants=(), weights=())
        declines, weights = np.expm1(-sample_time / np.array(creep.time_constants)), np.array(creep.weights)
        scale = 1.0 / (creep.instant_gain - float(weights @ declines))
        head = [amplifier.gain, amplifier.offset, weights.size, scale]
        return FeedforwardBlock(
            inverse.step,
            np.concatenate([head, weights, declines, inverse.parameters]),
            np.concatenate([np.full(weights.size, inverse.state[1]), inverse.state]),
        )
