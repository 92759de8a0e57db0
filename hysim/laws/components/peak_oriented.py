"""The peak-oriented law of Clough, with the unloading of Takeda.

With x = u / yield_input, f = y / (stiffness yield_input) and a = hardening_ratio, loading begins an excursion at f = 0
and goes to the largest point so far in this direction, (X, B(X)), and on along

    B(x) = min(x, 1 + a (x - 1)),    X >= 1 at first

If there is a last peak on this side, ahead and below the largest one, and the way by it is steeper, it goes by that.
The peaks are the tips of excursions that have ended. From the tip of an excursion the force falls with the slope

    K = max(X^-unloading, B(X) / X)

with the largest X including this tip, to zero, where an excursion in the other direction begins, and comes back on the
same line if the input does. K is not below the slope from the peak to the origin, so that the line meets f = 0 between
the peaks of both sides, and no path delivers energy.
"""

from typing import ClassVar, Self

from hysim._basics.frozen import FloatArray
from hysim.kernels.components import oriented
from hysim.models.law import Law
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.stages import Stage


@family
class PeakOriented(Law):
    """Peak-oriented law of Clough and Takeda: columns and walls of concrete whose reloading degrades.

    The force is loaded to the largest point so far in its direction, and beyond it along a bilinear curve. It is
    unloaded with the elastic stiffness, or with one that degrades by ``(yield_input / largest input)^unloading``.

    Parameters
    ----------
    stiffness : float
        Elastic slope dy/du [unit of y / unit of u].
    hardening_ratio : float
        Slope beyond the yield point over the stiffness, from 0 to below 1.
    yield_input : float
        Input of the yield point on both sides, positive [unit of u].
    unloading : float
        Exponent of the unloading stiffness, from 0, the law of Clough, to 1; Takeda's is 0.4.

    Raises
    ------
    ValueError
        If a number is not finite or outside its limits.

    Notes
    -----
    The law is virgin at u = 0, from where it comes to the first sample. Every path dissipates. The output is
    proportional to the stiffness. A small interruption is forgotten: the force comes back on the line on which it
    left. For pinching and a strength that falls see `IbarraMedinaKrawinkler`.

    Sources: R. W. Clough, report SESM 66-16, Berkeley 1966; T. Takeda, M. A. Sozen and N. N. Nielsen, J. Struct. Div.
    96 (1970) 2557; the inner peaks of S. A. Mahin and V. V. Bertero, report EERC 75-5, Berkeley 1975.

    Examples
    --------
    >>> import hysim as hs
    >>> column = hs.PeakOriented(stiffness=10.0, hardening_ratio=0.0, yield_input=0.1, unloading=0.0)
    >>> column.response([0.0, 0.3, 0.25, 0.05, -0.1, 0.1, 0.3]).round(6).tolist()
    [0.0, 1.0, 0.5, -0.5, -1.0, 0.333333, 1.0]
    """

    stiffness: float = 1.0
    hardening_ratio: float = 0.05
    yield_input: float = 1.0
    unloading: float = 0.4

    within: ClassVar = {"hardening_ratio": ("below", 1.0), "unloading": ("at most", 1.0)}
    positive = ("yield_input",)
    not_negative = ("hardening_ratio", "unloading")
    units: ClassVar = {"hardening_ratio": "1", "unloading": "1"}
    initial: ClassVar[tuple[str, ...]] = ()
    further_memory = 10
    example = Example({}, (-4.0, 4.0), title="Peak-oriented: concrete column", group="Devices")
    searched = (
        Parameter("stiffness", unit="y/u", affine=True),
        Parameter("hardening_ratio", 0.0, 0.9, physical=(True, True)),
        Parameter("yield_input", 1e-3, 3.0, unit="u", log=True),
        Parameter("unloading", 0.0, 1.0, physical=(True, True)),
    )
    starts = tuple({"yield_input": share} for share in (0.03, 0.1, 0.3))
    stages = (Stage("unloading", ("unloading",), {"unloading": 0.0}),)

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`.

        `state` is (u, direction of the excursion, its begin, its tip (x, f), then for each direction X - 1 and the last
        tip), lengths in the direction of the excursion.
        """
        a, unit, exponent = parameters[1], parameters[2], parameters[3]
        s = 1.0 if state[1] == 0.0 else state[1]
        v, tip, high = s * u / unit, state[3], state[4]
        k = 5 if s > 0.0 else 8
        f = high
        if v < tip:
            peak = max(1.0 + state[k], tip)
            stiffness = max(peak**-exponent, (1.0 + a * (peak - 1.0)) / peak)
            f = high - stiffness * (tip - v)
            if f < 0.0:
                state[k], state[k + 1], state[k + 2] = peak - 1.0, tip, high
                s, v, tip, k, f = -s, -v, high / stiffness - tip, 13 - k, 0.0
                state[2], state[3], state[4] = tip, tip, 0.0
        if v >= tip:
            peak = 1.0 + state[k]
            top = 1.0 + a * (max(peak, v) - 1.0)
            f = top if v >= peak else oriented(v, state[2], peak, top, state[k + 1], state[k + 2])
            state[3], state[4] = v, f
        state[0], state[1] = u, s
        return float(parameters[0] * unit * (s * f))

    @property
    def known_slopes(self) -> tuple[float, float]:
        return min(0.0, self.stiffness), max(0.0, self.stiffness)

    @classmethod
    def from_opensees(cls, *, Ke: float, Fy: float, Kp: float, unloading: float = 0.0) -> Self:
        """An ``IMKPeakOriented`` without deterioration, whose slope after yielding is Kp.

        ``uniaxialMaterial Hysteretic`` with pinchX = pinchY = 1 and beta = unloading has no inner peaks.
        """
        return cls(stiffness=Ke, hardening_ratio=Kp / Ke, yield_input=Fy / Ke, unloading=unloading)

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`."""
        Ke = self.stiffness
        Fy, Kp = Ke * self.yield_input, Ke * self.hardening_ratio
        return {"Ke": Ke, "Fy": Fy, "Kp": Kp, "unloading": self.unloading}
