"""The origin-oriented law."""

import math
from typing import ClassVar, Self

from hysim._basics.frozen import FloatArray
from hysim.laws.components.bilinear import SLOPES, HardeningLaw
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter


@family
class OriginOriented(HardeningLaw):
    """Origin-oriented law: below the largest input so far, the force goes on the line from there to the origin.

    ::

        y = hardening u + (stiffness - hardening) yield_input z,    x = u / yield_input
        z = x / max(1, largest x so far) where u > 0, and likewise where u < 0

    The stiffness degrades, and the origin is kept: shear walls of concrete and masonry, and bounds of what damage
    without plastic deformation does.

    Parameters
    ----------
    stiffness : float
        Slope dy/du before the yield point [unit of y / unit of u].
    hardening : float
        Slope of the curve beyond it [unit of y / unit of u].
    yield_input : float
        Input of the yield point on both sides, positive [unit of u].

    Raises
    ------
    ValueError
        If a number is not finite or outside its limits.

    Notes
    -----
    The law is virgin at u = 0, from where it comes to the first sample. Where the stiffness is above the hardening,
    every path dissipates, but only where it reaches a new largest input. The output is affine in both slopes.

    Examples
    --------
    >>> import hysim as hs
    >>> wall = hs.OriginOriented(stiffness=10.0, hardening=1.0, yield_input=0.1)
    >>> wall.response([0.0, 0.3, 0.15, -0.1]).round(6).tolist()
    [0.0, 1.2, 0.6, -1.0]
    """

    yield_input: float = 1.0

    positive = ("yield_input",)
    initial: ClassVar[tuple[str, ...]] = ()
    further_memory = 2
    example = Example({"hardening": 0.1}, (-4.0, 4.0), title="Origin-oriented: shear wall", group="Devices")
    searched = (*SLOPES, Parameter("yield_input", 1e-3, 3.0, unit="u", log=True))
    starts = tuple({"yield_input": share} for share in (0.03, 0.1, 0.3))

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`; `state` is (u, excess of the largest x over 1, of the lowest below -1)."""
        x, k = u / parameters[2], 1 if u > 0.0 else 2
        state[0], state[k] = u, max(state[k], abs(x) - 1.0)
        return float(parameters[1] * u + (parameters[0] - parameters[1]) * parameters[2] * x / (1.0 + state[k]))

    @classmethod
    def from_opensees(
        cls, *, f1: float, e1: float, f2: float, e2: float, f3: float | None = None, e3: float | None = None
    ) -> Self:
        """The material ``uniaxialMaterial OriginCentered``, whose third point lies on the line through both others."""
        hardening = (f2 - f1) / (e2 - e1)
        if f3 is not None and e3 is not None and not math.isclose(f3, f2 + hardening * (e3 - e2), rel_tol=1e-9):
            raise ValueError(
                f"the third point must lie on the line through both others, got f3 = {f3:g} at e3 = {e3:g}"
            )
        return cls(stiffness=f1 / e1, hardening=hardening, yield_input=e1)

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`, and a third point far out on the same line, after which it is flat."""
        e1, points = self.yield_input, dict[str, float]()
        for k, e in enumerate((e1, 2.0 * e1, 1e6 * e1), 1):
            points |= {f"f{k}": self.stiffness * e1 + self.hardening * (e - e1), f"e{k}": e}
        return points
