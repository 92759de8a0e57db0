"""The law of Folz and Filiatrault for nailed timber, by Stewart and Foschi, known as SAWS.

All over the stiffness. On each side, in the direction of loading, the envelope is

    E(v) = (knee_input + r_1 v) (1 - exp(-v / knee_input))                  up to peak_input
    E(v) = max(0, E(peak_input) + r_2 (v - peak_input))                     beyond

Up to D, where it meets the pinched line, E(D) = pinch_input + r_4 D, or has its peak if that comes first, a virgin law
is elastic along it. An excursion then goes to the envelope at D, and along it, by the path

    P(v) = min(E(D), max(pinch_input + r_4 v, E(D) - min(1, (knee_input / D)^alpha) (D - v)))       before D

where D = beta times the largest v from which this envelope was left: the largest tip beyond D of an excursion that has
ended. On a side without one the path is min(E(D), pinch_input + r_4 v) up to the D of the virgin law. From the tip of
an excursion the force falls with the slope r_3 until it meets the path of the excursion in the other direction, and
comes back on the same line if the input does.
"""

from typing import ClassVar, Self

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels.components import envelope, on_envelope
from hysim.models.law import Law, Packed
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.tables import Tables

_HALVINGS = 60  # of the interval up to the peak: all digits


@family
class FolzFiliatrault(Law):
    """Folz-Filiatrault law of fasteners and timber walls: an envelope with a peak, pinching, and fading stiffness.

    ::

        y = (F_0 + r_1 S_0 u) (1 - exp(-S_0 u / F_0)),    S_0 = stiffness, F_0 = S_0 knee_input

    is its envelope up to the peak, from where it falls with the slope r_2 S_0. It is unloaded with r_3 S_0, pinched on
    a line of the slope r_4 S_0 through F_I = S_0 pinch_input, and loaded again to the envelope with a slope that fades.

    Parameters
    ----------
    stiffness : float
        Initial slope S_0 [unit of y / unit of u].
    knee_input : float
        Input F_0 / S_0, positive: where the initial line reaches the height of the second one [unit of u].
    pinch_input : float
        Input F_I / S_0, not negative: height of the pinched line at u = 0 over the stiffness [unit of u].
    peak_input : float
        Input Delta_u of the peak, positive [unit of u].
    r_1, r_2, r_3, r_4 : float
        Slopes over the stiffness: of the envelope before the peak, from 0 to 0.5, above which it would be steeper than
        the stiffness, and after it, negative; of unloading, at least 1; and of the pinched line, from 0 to below 1.
    alpha : float
        Exponent with which the slope of reloading fades, not negative.
    beta : float
        Input at which a repeated cycle comes back to the envelope, over the largest one so far; at least 1.

    Raises
    ------
    ValueError
        If a number is not finite or outside its limits.

    Notes
    -----
    The law is virgin at u = 0, from where it comes to the first sample. The output is proportional to the stiffness.
    The pinched lines store energy: what is said of no path delivering energy holds for closed cycles alone, and for
    these up to inputs u where the envelope at beta u has not fallen below r_4 u - pinch_input.

    Source: B. Folz and A. Filiatrault, J. Struct. Eng. 127 (2001) 361; the envelope is that of R. O. Foschi.

    Examples
    --------
    >>> import hysim as hs
    >>> nail = hs.FolzFiliatrault.from_opensees(
    ...     F0=2.0, FI=0.4, DU=30.0, S0=1.0, R1=0.05, R2=-0.05, R3=1.4, R4=0.01, alpha=0.7, beta=1.1
    ... )
    >>> nail.response([0.0, 10.0, 0.0, 10.0]).round(3).tolist()
    [0.0, 2.483, -0.4, 2.236]
    """

    stiffness: float = 1.0
    knee_input: float = 1.0
    pinch_input: float = 0.2
    peak_input: float = 10.0
    r_1: float = 0.05
    r_2: float = -0.05
    r_3: float = 1.3
    r_4: float = 0.02
    alpha: float = 0.7
    beta: float = 1.1

    within: ClassVar = {
        "r_1": ("at most", 0.5),
        "r_2": ("below", 0.0),
        "r_3": ("at least", 1.0),
        "r_4": ("below", 1.0),
        "beta": ("at least", 1.0),
    }
    positive = ("knee_input", "peak_input")
    not_negative = ("pinch_input", "r_1", "r_4", "alpha")
    units: ClassVar = dict.fromkeys(("r_1", "r_2", "r_3", "r_4", "alpha", "beta"), "1")
    initial: ClassVar[tuple[str, ...]] = ()
    further_memory = 5
    example = Example(
        {"peak_input": 5.0, "r_2": -0.1, "r_4": 0.03, "beta": 1.2},
        (-8.0, 8.0),
        title="Folz-Filiatrault: nailed timber",
        group="Devices",
    )
    searched = (
        Parameter("stiffness", unit="y/u", affine=True),
        Parameter("knee_input", 1e-3, 2.0, unit="h", log=True),
        Parameter("pinch_input", 1e-4, 1.0, unit="h", log=True),
        Parameter("peak_input", 1e-2, 3.0, unit="h", log=True),
        Parameter("r_1", 0.0, 0.5, physical=(True, True)),
        Parameter("r_2", -1.0, -1e-3, physical=(False, True)),
        Parameter("r_3", 1.0, 5.0, physical=(True, False)),
        Parameter("r_4", 0.0, 0.9, physical=(True, True)),
        Parameter("alpha", 0.0, 3.0, physical=(True, False)),
        Parameter("beta", 1.0, 2.0, physical=(True, False)),
    )
    starts = tuple({"knee_input": share, "peak_input": 1.0, "pinch_input": 0.2 * share} for share in (0.03, 0.1, 0.3))

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`.

        `state` is (u, direction of the excursion, its tip (u, force), largest u on the envelope of both directions).
        """
        s, state[0] = state[1], u
        if s == 0.0:
            s = 1.0 if u >= 0.0 else -1.0
            if s * u <= parameters[10]:
                return float(parameters[0] * s * envelope(parameters, s * u))
            state[2], state[3] = parameters[10], envelope(parameters, parameters[10])
        v, k, tip = s * u, 4 if s > 0.0 else 5, state[2]
        f = state[3] - parameters[6] * (tip - v)
        if v < tip:
            other = on_envelope(parameters, -v, state[9 - k])
            if f < -other:
                begins = parameters[10] if state[k] == 0.0 else parameters[9] * state[k]
                if tip > begins:
                    state[k] = tip
                s, v, f = -s, -v, other
                state[2], state[3] = v, f
        else:
            f = on_envelope(parameters, v, state[k])
            state[2], state[3] = v, f
        state[1] = s
        return float(parameters[0] * s * f)

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """The fields, and the input at which the envelope meets the pinched line, or has its peak."""
        packed = super().pack(tables)
        low, high = np.zeros_like(tables["beta"]), tables["peak_input"]
        knee, height, r_1, r_4 = (tables[name] for name in ("knee_input", "pinch_input", "r_1", "r_4"))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            below = (knee + r_1 * middle) * -np.expm1(-middle / knee) < height + r_4 * middle
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return packed._replace(parameters=np.concatenate([packed.parameters, high], axis=1))

    @classmethod
    def from_opensees(
        cls, *, F0: float, FI: float, DU: float, S0: float, R1: float, R2: float, R3: float, R4: float, alpha: float,
        beta: float,
    ) -> Self:  # fmt: skip
        """The material ``uniaxialMaterial SAWS``."""
        slopes = {"r_1": R1, "r_2": R2, "r_3": R3, "r_4": R4, "alpha": alpha, "beta": beta}
        return cls(stiffness=S0, knee_input=F0 / S0, pinch_input=FI / S0, peak_input=DU, **slopes)

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`."""
        S0, slopes = self.stiffness, {f"R{k}": self.scalars[f"r_{k}"] for k in (1, 2, 3, 4)}
        inputs = {"F0": S0 * self.knee_input, "FI": S0 * self.pinch_input, "DU": self.peak_input, "S0": S0}
        return {**inputs, **slopes, "alpha": self.alpha, "beta": self.beta}
