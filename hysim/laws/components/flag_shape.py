"""The flag-shaped law of self-centring devices.

No slope of the limits of z is above that of the elastic line: a rising stroke from (x_0, z_0) has z = min(z_0 + x -
x_0, U(x)), however it is sampled.
"""

from typing import ClassVar, Self

from hysim._basics.frozen import FloatArray
from hysim.laws.components.bilinear import SLOPES, HardeningLaw
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter


@family
class FlagShape(HardeningLaw):
    """Flag-shaped law: rocking walls, post-tensioned joints, shape memory alloys, ring springs.

    ::

        y = hardening u + (stiffness - hardening) activation z,    x = u / activation
        dz = dx,  -U(-x) <= z <= U(x),    U(x) = min(1, max(x, loss - 1))

    Parameters
    ----------
    stiffness : float
        Slope dy/du before activation [unit of y / unit of u].
    hardening : float
        Slope dy/du after it [unit of y / unit of u].
    activation : float
        Input of the activation, positive [unit of u].
    loss : float
        Height of the flag over ``(stiffness - hardening) activation``, from 0 to 2: 0 dissipates nothing, up to 1 the
        force returns to zero with the input, and 2 is the bilinear law.

    Raises
    ------
    ValueError
        If a number is not finite or outside its limits.

    Notes
    -----
    The law is virgin at u = 0, from where it comes to the first sample. Every path dissipates where the stiffness is
    above the hardening. The output is affine in both. A part that is squeezed or stretched to its end is not in
    it: add a `hysim.Slack` of a large yield input in parallel. Source: C. Christopoulos, R. Tremblay, H.-J. Kim and M.
    Lacerte, J. Struct. Eng. 134 (2008) 96.

    Examples
    --------
    >>> import hysim as hs
    >>> brace = hs.FlagShape(stiffness=10.0, hardening=1.0, activation=0.1, loss=0.8)
    >>> brace.response([0.0, 0.3, 0.2, 0.0]).round(6).tolist()
    [0.0, 1.2, 0.38, 0.0]
    """

    activation: float = 1.0
    loss: float = 0.8

    within: ClassVar = {"loss": ("at most", 2.0)}
    positive = ("activation",)
    not_negative = ("loss",)
    initial: ClassVar[tuple[str, ...]] = ()
    further_memory = 2
    example = Example({"hardening": 0.1}, (-4.0, 4.0), title="Flag: self-centring brace", group="Devices")
    searched = (
        *SLOPES,
        Parameter("activation", 1e-3, 3.0, unit="u", log=True),
        Parameter("loss", 0.0, 2.0, physical=(True, True)),
    )
    starts = tuple({"activation": share, "loss": 0.5} for share in (0.03, 0.1, 0.3))

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`; `state` is (u, x, z), the last two zero before the first sample."""
        x = u / parameters[2]
        z = state[2] + (x - state[1])
        z = max(z, max(-1.0, min(x, 1.0 - parameters[3])))
        z = min(z, min(1.0, max(x, parameters[3] - 1.0)))
        state[0], state[1], state[2] = u, x, z
        return float(parameters[1] * u + (parameters[0] - parameters[1]) * parameters[2] * z)

    @classmethod
    def from_opensees(cls, *, k1: float, k2: float, sigAct: float, beta: float) -> Self:
        """The material ``uniaxialMaterial SelfCentering`` without slip and bearing, from a strain to a stress."""
        return cls(stiffness=k1, hardening=k2, activation=sigAct / k1, loss=beta)

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`."""
        k1, k2 = self.stiffness, self.hardening
        return {"k1": k1, "k2": k2, "sigAct": k1 * self.activation, "beta": self.loss}
