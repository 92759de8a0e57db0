"""The bilinear law with kinematic and isotropic hardening."""

import math
from dataclasses import dataclass
from typing import ClassVar, Self

from hysim._basics.frozen import FloatArray
from hysim.models.law import Law
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, affine
from hysim.models.stages import Stage

SLOPES = affine("stiffness", "hardening", unit="y/u")


@dataclass(frozen=True, kw_only=True, eq=False)
class HardeningLaw(Law):
    """A law whose slope lies between those of the elastic line and of hardening."""

    stiffness: float = 1.0
    hardening: float = 0.05

    @property
    def known_slopes(self) -> tuple[float, float]:
        return min(self.hardening, self.stiffness), max(self.hardening, self.stiffness)


@family
class Bilinear(HardeningLaw):
    """Bilinear law with kinematic and isotropic hardening, the Hardening and Steel01 of OpenSees.

    ::

        y = offset + hardening u + (stiffness - hardening) yield_input z
        dz = dx where |z| < r;    |z| = r, dr = isotropic |dx| where it slides;    x = u / yield_input, r = 1 first

    Parameters
    ----------
    stiffness : float
        Elastic slope dy/du [unit of y / unit of u].
    hardening : float
        Slope dy/du beyond the yield point without isotropic hardening [unit of y / unit of u].
    yield_input : float
        Input of the yield point, positive [unit of u].
    isotropic : float
        Share of each plastic step by which the elastic range grows on both sides, from 0 to below 1: beyond the yield
        point the slope is ``hardening + isotropic (stiffness - hardening)``.
    offset : float
        Output of the virgin law at u = 0 [unit of y].
    z0 : float
        Place in the elastic range at the first sample, from -1 to 1.

    Raises
    ------
    ValueError
        If a number is not finite or outside its limits.

    Notes
    -----
    Its memory is z0 and the width of the elastic range, 1 at first: continue with `advance`. Every path dissipates
    where the stiffness is above the hardening. The slope lies between hardening and stiffness; where both have one sign
    there is an inverse. The output is affine in both, and in the offset.

    In the terms of plasticity, with the plastic strain p, ``|y - H_kin p| <= sigmaY + H_iso sum |dp|``:
    `from_opensees`. Source: J. C. Simo and T. J. R. Hughes, Computational Inelasticity, Springer 1998, section 1.4.

    Examples
    --------
    >>> import hysim as hs
    >>> spring = hs.Bilinear(stiffness=10.0, hardening=1.0, yield_input=0.1)
    >>> spring.response([0.0, 0.3, 0.0]).round(6).tolist()
    [0.0, 1.2, -0.9]
    """

    yield_input: float = 1.0
    isotropic: float = 0.0
    offset: float = 0.0
    z0: float = 0.0

    within: ClassVar = {"isotropic": ("below", 1.0), "z0": ("of a size of at most", 1.0)}
    positive = ("yield_input",)
    not_negative = ("isotropic",)
    further_memory = 1
    units: ClassVar = {"z0": "1"}
    example = Example({"hardening": 0.1, "isotropic": 0.03}, (-4.0, 4.0), title="Bilinear law", group="Devices")
    searched = (
        *SLOPES,
        Parameter("yield_input", 1e-3, 3.0, unit="u", log=True),
        Parameter("isotropic", 0.0, 0.99, physical=(True, True)),
        Parameter("offset", unit="y", affine=True),
        Parameter("z0", -1.0, 1.0, physical=(True, True)),
    )
    starts = tuple({"yield_input": share} for share in (0.03, 0.1, 0.3))
    stages = (Stage("isotropic hardening", ("isotropic",), {"isotropic": 0.0}),)

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`; `state` is (u, z, r - 1)."""
        z = state[1] + (u - state[0]) / parameters[2]
        excess = abs(z) - 1.0 - state[2]
        if excess > 0.0:
            state[2] += parameters[3] * excess
            z = math.copysign(1.0 + state[2], z)
        state[0], state[1] = u, z
        return float(parameters[4] + parameters[1] * u + (parameters[0] - parameters[1]) * parameters[2] * z)

    @classmethod
    def from_opensees(cls, *, sigmaY: float, E: float, H_iso: float = 0.0, H_kin: float = 0.0) -> Self:
        """The material ``uniaxialMaterial Hardening``, from a strain to a stress.

        ``Steel01 Fy E0 b`` without isotropic hardening is ``H_kin = b E0 / (1 - b)``; its isotropic hardening moves
        both lines at each reversal by the span of the strain, which is another law.
        """
        isotropic = H_iso / (E + H_iso + H_kin)
        return cls(stiffness=E, hardening=E * H_kin / (E + H_kin), yield_input=sigmaY / E, isotropic=isotropic)

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`; ValueError if the law has an offset, an initial z, or no bend."""
        if not self.hardening < self.stiffness:
            raise ValueError(
                f"Hardening needs hardening below stiffness, got {self.hardening:g} and {self.stiffness:g}"
            )
        if self.offset != 0.0 or self.z0 != 0.0:
            raise ValueError(f"Hardening has no offset and no z0, got {self.offset:g} and {self.z0:g}")
        E = self.stiffness
        H_kin = E * self.hardening / (E - self.hardening)
        H_iso = self.isotropic * (E + H_kin) / (1.0 - self.isotropic)
        return {"sigmaY": E * self.yield_input, "E": E, "H_iso": H_iso, "H_kin": H_kin}
