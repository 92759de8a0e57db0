"""The actuator as a chain of stages:  u -> hysteresis -> vibration -> y.

The hysteresis is a rate-independent law, y = law(u); the vibration is linear, G(s). A voltage that is held
between samples moves the law at once to a level that is held too, so that the chain is exact. A stage that
is left out passes its input on.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.models.model import CompiledLaw, model, needs_time
from hysim.models.sampled import THROUGH, SampledStage, sampled
from hysim.models.static import Line
from hysim.models.transfer_function import TransferFunction


def is_law(value: Any) -> bool:
    """Whether a value answers to an input and can be stepped in a loop."""
    return all(callable(getattr(value, name, None)) for name in ("response", "compiled")) and not needs_time(value)


@model
class Actuator:
    """A hysteretic actuator with its dynamics.

    Parameters
    ----------
    hysteresis : law, optional
        Rate-independent law from voltage to displacement, such as `BoucWen`.
    vibration : TransferFunction, optional
        Linear dynamics behind the law; alone, from voltage to displacement. With ``hold="zoh"`` and no
        initial state: an actuator begins at rest. Where its output is taken, ``sample``, is the actuator's.

    Raises
    ------
    TypeError
        If a stage is not of its kind.
    ValueError
        If the vibration holds an initial state or is not held.

    Examples
    --------
    >>> import hysim as hs
    >>> mode = hs.TransferFunction(num=(1.0,), den=(1.0, 0.2, 1.0), sample="end")
    >>> actuator = hs.Actuator(hysteresis=hs.BoucWen(), vibration=mode)
    >>> actuator.response([0.0, 1.0, 1.0], sample_time=1.0).round(6).tolist()
    [0.0, 0.272462, 0.795252]
    """

    hysteresis: Any = None
    vibration: TransferFunction | None = None

    def __post_init__(self) -> None:
        if self.hysteresis is not None and not is_law(self.hysteresis):
            raise TypeError(
                f"hysteresis must be a law that a loop can step, such as BoucWen, got {type(self.hysteresis).__name__}"
            )
        if self.vibration is None:
            return
        if not isinstance(self.vibration, TransferFunction):
            raise TypeError(f"vibration must be a TransferFunction, got {type(self.vibration).__name__}")
        if self.vibration.hold != "zoh":
            raise ValueError('the vibration\'s input is held: its hold must be "zoh"')
        if self.vibration.initial_state:
            raise ValueError("an actuator begins at rest: its vibration must not hold an initial state")

    @property
    def dynamic(self) -> bool:
        """Whether the displacement depends on time: whether there is a vibration."""
        return self.vibration is not None

    def response(self, u: npt.ArrayLike, sample_time: float | None = None) -> FloatArray:
        """Displacement at the samples of a voltage that is held between them.

        Parameters
        ----------
        u : array, shape (n,)
            Voltage. The first sample finds the law at its initial memory and the dynamics settled.
        sample_time : float, optional
            Time between two samples [s]; an actuator without vibration needs none.

        Returns
        -------
        array, shape (n,)

        Raises
        ------
        SimulationError
            If a stage leaves the finite numbers.
        ValueError
            If `u` is not finite or has not one axis, the vibration is given no time, or it cannot rest at the
            first sample because it integrates.
        """
        inputs = read_only(u, "u", ndim=1)
        level = inputs if self.hysteresis is None else np.asarray(self.hysteresis.response(inputs))
        if self.vibration is None or not level.size:
            return np.array(level)
        if sample_time is None:
            raise ValueError("an actuator with a vibration needs sample_time")
        first = level[0]
        if first != 0.0 and not np.isfinite(self.vibration.dc_gain):
            raise ValueError(f"the vibration integrates: it cannot rest at the law's first output {first:g}")
        settled = self.vibration.dc_gain * first if first else 0.0
        return settled + self.vibration.response(level - first, sample_time)

    def memory(self, u: npt.ArrayLike) -> FloatArray | None:
        """Memory of the law at the samples of `u`, shape (n,); None for a law without one."""
        memory = getattr(self.hysteresis, "memory", None)
        return memory(u) if callable(memory) else None

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it, at rest at the voltage `u0`."""
        law = Line(slope=1.0) if self.hysteresis is None else self.hysteresis
        return CompiledLaw(*law.compiled(u0))

    def sampled(self, sample_time: float) -> SampledStage:
        """The linear stage from sample to sample, exact under the hold."""
        return THROUGH if self.vibration is None else sampled(self.vibration, sample_time)
