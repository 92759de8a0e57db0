"""Rods with slack that grows by their plastic elongation."""

from typing import ClassVar, Self

from hysim._basics.frozen import FloatArray
from hysim.models.law import Law
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, affine


@family
class Slack(Law):
    """Rods in tension with slack: braces of rod, anchor bolts, cables; one for each direction.

    ::

        y = stiffness F(u) - opposite_stiffness F(-u)
        F(u) = max(0, u - slack - p)
        p = max(0, largest (1 - hardening_ratio) (u - slack - yield_input) so far)

    A rod takes force beyond the slack, yields, and is loose afterwards by its plastic elongation p as well.

    Parameters
    ----------
    stiffness : float
        Elastic slope of the rod that takes a positive input [unit of y / unit of u].
    opposite_stiffness : float
        That of an equal rod which takes a negative input; 0 if there is none.
    slack : float
        Input from which a rod takes force; below zero where it is prestressed [unit of u].
    yield_input : float
        Further input at which it yields, positive [unit of u].
    hardening_ratio : float
        Slope after yielding over the elastic one, from 0 to below 1.

    Raises
    ------
    ValueError
        If a number is not finite or outside its limits.

    Notes
    -----
    The law is virgin at u = 0, from where it comes to the first sample. Every path dissipates where the slack is not
    negative; a prestressed rod returns what it stores at u = 0. The output is affine in both stiffnesses. With no
    slack and both rods it is the brace that is effective in tension alone.

    Examples
    --------
    >>> import hysim as hs
    >>> brace = hs.Slack(stiffness=100.0, opposite_stiffness=100.0, slack=0.1, yield_input=0.2)
    >>> brace.response([0.0, 0.4, 0.25, -0.4, 0.25]).round(6).tolist()
    [0.0, 20.2, 5.2, -20.2, 5.2]
    """

    stiffness: float = 1.0
    opposite_stiffness: float = 0.0
    slack: float = 0.0
    yield_input: float = 1.0
    hardening_ratio: float = 0.02

    within: ClassVar = {"hardening_ratio": ("below", 1.0)}
    positive = ("yield_input",)
    not_negative = ("hardening_ratio",)
    initial: ClassVar[tuple[str, ...]] = ()
    further_memory = 2
    units: ClassVar = {"hardening_ratio": "1"}
    example = Example(
        {"opposite_stiffness": 1.0, "slack": 0.3, "hardening_ratio": 0.1},
        (-4.0, 4.0),
        title="Slack: braces of rod",
        group="Devices",
    )
    searched = (
        *affine("stiffness", "opposite_stiffness", unit="y/u"),
        Parameter("slack", -1.0, 1.0, unit="u"),
        Parameter("yield_input", 1e-3, 3.0, unit="u", log=True),
        Parameter("hardening_ratio", 0.0, 0.99, physical=(True, True)),
    )
    starts = tuple({"yield_input": share, "slack": 0.0} for share in (0.03, 0.1, 0.3))

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`; `state` is (u, p of both rods)."""
        unit, b = parameters[3], parameters[4]
        v, w = u - parameters[2], -u - parameters[2]
        state[0] = u
        state[1] = max(state[1], (1.0 - b) * (max(u, 0.0) - parameters[2] - unit))
        state[2] = max(state[2], (1.0 - b) * (max(-u, 0.0) - parameters[2] - unit))
        return float(parameters[0] * max(0.0, v - state[1]) - parameters[1] * max(0.0, w - state[2]))

    @property
    def known_slopes(self) -> tuple[float, float]:
        slopes = 0.0, self.stiffness, self.opposite_stiffness, self.stiffness + self.opposite_stiffness
        return min(slopes), max(slopes)

    @classmethod
    def from_opensees(cls, *, E: float, Fy: float, gap: float, eta: float = 0.0) -> Self:
        """The material ``uniaxialMaterial ElasticPPGap`` in tension, with the option ``damage``."""
        return cls(stiffness=E, slack=gap, yield_input=Fy / E, hardening_ratio=eta)

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`; ValueError if there is a rod in the other direction."""
        if self.opposite_stiffness != 0.0:
            raise ValueError("ElasticPPGap acts in one direction: put a second one with the opposite signs in parallel")
        E = self.stiffness
        return {"E": E, "Fy": E * self.yield_input, "gap": self.slack, "eta": self.hardening_ratio}
