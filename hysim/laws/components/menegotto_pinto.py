"""The law of Menegotto and Pinto for reinforcing steel, with the isotropic hardening of Filippou.

With x = u / yield_input the force is that of a spring beside a part z that yields at 1 and does not harden,

    y = offset + hardening u + (stiffness - hardening) yield_input z

Along a stroke that begins at (x_r, z_r) and has gone the length t in the direction s, z bends from the elastic line to
its asymptote,

    z = z_r + s t / (1 + (t / D)^R)^(1 / R)
    D = shift - s z_r                                  length to where both lines meet, at x_0 = x_r + s D
    R = R0 (1 - cR1 xi / (cR2 + xi)),  xi = |x_p - x_0|        x_p = s max(1, s x of all reversals so far)
    shift = 1 + a1 ((x_max - x_min) / (2 a2))^0.8              where u falls; a3 and a4 where it rises; 1 at first

With b = hardening / stiffness and eps* = t / D this is the published

    sigma* = b eps* + (1 - b) eps* / (1 + eps*^R)^(1 / R)

whose asymptotes have the slope b. Between reversals z is a function of u alone: samples on a stroke change no bit.
"""

from typing import ClassVar, Self

from hysim._basics.frozen import FloatArray
from hysim.kernels.elementary import bent
from hysim.laws.components.bilinear import SLOPES, HardeningLaw
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.stages import Stage


@family
class MenegottoPinto(HardeningLaw):
    """Menegotto-Pinto law of steel with Filippou's isotropic hardening, the Steel02 of OpenSees.

    ::

        y = offset + hardening u + (stiffness - hardening) yield_input z,    x = u / yield_input
        z = z_r + (x - x_r) / (1 + |(x - x_r) / (x_0 - x_r)|^R)^(1 / R)

    After a reversal at x_r the output starts with the elastic stiffness and bends to an asymptote of the slope
    hardening; both lines meet at x_0. The sharpness of the bend, ``R = R0 (1 - cR1 xi / (cR2 + xi))``, falls with the
    distance xi of x_0 from the largest excursion on that side. The asymptotes move outwards with the span of the
    excursions, by ``a1 (span / (2 a2))^0.8`` where u falls, a3 and a4 where it rises.

    Parameters
    ----------
    stiffness : float
        Elastic slope dy/du [unit of y / unit of u]: E0.
    hardening : float
        Slope of the asymptotes [unit of y / unit of u]: b E0.
    yield_input : float
        Input at which the elastic line meets the asymptote, positive [unit of u]: Fy / E0.
    R0, cR1, cR2 : float
        Sharpness of the first bend, positive; its loss, from 0 to below 1; and the distance over yield_input at which
        half of the loss has come, positive.
    a1, a2, a3, a4 : float
        Isotropic hardening: a1 and a3 not negative, a2 and a4 positive. By default there is none.
    least_reversal : float
        Way back, over yield_input, that does not start a new branch yet, not negative; 0 for Steel02 to rounding.
    offset : float
        Output of the virgin law at u = 0 [unit of y].
    z0 : float
        Place between the asymptotes at the first sample, -1 on the lower and 1 on the upper one.

    Raises
    ------
    ValueError
        If a number is not finite or outside its limits.

    Notes
    -----
    The law is virgin at its first sample, whose input counts as strain: for a record that begins elsewhere than at
    zero, place it by ``u0=0.0``. The memory is more than z0: continue with `advance`.

    Each reversal starts a new curve and forgets the one that it left, however small it is, as in OpenSees's Steel02:
    after a small interruption the output runs above the curve without interruption. The rounding of a solver would so
    keep a frame from yielding. Therefore a way back of less than `least_reversal` stays on the old curve, and the new
    one begins at its end. For an input with more noise put a `ReversalFilter` before the law; for
    a structure whose tolerance is above its default 1e-8 let it be 100 times the tolerance. With least_reversal=0
    the outputs are those of Steel02, but for a z0 beyond the asymptote, from where they run parallel to it.

    The slope dy/du lies between hardening and stiffness; where both have one sign there is an inverse. The output is
    affine in both, and in the offset. `identify` holds a2 and a4, which only scale a1 and a3, and keeps these where
    they lower the BIC. It searches R0 up to 25, a little beyond the 10 to 20 that OpenSees recommends: coupons seldom
    determine R0, cR1 and cR2 together, and fit as well with any larger R0.

    Sources: M. Menegotto and P. E. Pinto, IABSE Symposium, Lisbon 1973; F. C. Filippou, E. P. Popov and V. V. Bertero,
    report EERC 83-19, Berkeley 1983.

    Examples
    --------
    >>> import hysim as hs
    >>> bar = hs.MenegottoPinto.from_opensees(Fy=420.0, E0=200e3, b=0.01)
    >>> bar.response([0.0, 0.01, 0.0, -0.01]).round(3).tolist()
    [0.0, 435.8, -315.438, -400.144]
    """

    hardening: float = 0.02
    yield_input: float = 1.0
    R0: float = 20.0
    cR1: float = 0.925  # noqa: N815
    cR2: float = 0.15  # noqa: N815
    a1: float = 0.0
    a2: float = 1.0
    a3: float = 0.0
    a4: float = 1.0
    least_reversal: float = 1e-6
    offset: float = 0.0
    z0: float = 0.0

    within: ClassVar = {"cR1": ("below", 1.0)}
    positive = ("yield_input", "R0", "cR2", "a2", "a4")
    not_negative = ("cR1", "a1", "a3", "least_reversal")
    further_memory = 8
    units: ClassVar = {"z0": "1", "least_reversal": "1"}
    example = Example(
        {"hardening": 0.03, "cR1": 0.9, "a1": 0.03, "a3": 0.03},
        (-4.0, 4.0),
        title="Menegotto-Pinto: steel",
        group="Devices",
    )
    searched = (
        *SLOPES,
        Parameter("yield_input", 1e-3, 3.0, unit="u", log=True),
        Parameter("R0", 1.0, 25.0, log=True, physical=(False, True)),  # beyond, a bend is as good as sharp
        Parameter("cR1", 0.0, 0.999, physical=(True, True)),
        Parameter("cR2", 1e-2, 10.0, log=True),
        *(Parameter(name, 0.0, 0.5, physical=(True, False)) for name in ("a1", "a3")),
        Parameter("offset", unit="y", affine=True),
        Parameter("z0", -1.0, 1.0),
    )
    starts = tuple({"yield_input": share} for share in (0.03, 0.1, 0.3))
    stages = (Stage("isotropic hardening", ("a1", "a3"), {"a1": 0.0, "a3": 0.0}),)

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`.

        `state` is (u, z, s, u_r, z_r, D, R, excess of x_max over 1, of -x_min over 1, furthest u of the branch).
        """
        unit, s, least = parameters[2], state[2], parameters[10] * parameters[2]
        furthest = state[9] if s != 0.0 else state[0]
        if s * (furthest - u) > least or (s == 0.0 and u != furthest):
            begin, z, shift, rises = furthest - s * least, state[1], 1.0, s < 0.0 or (s == 0.0 and u > furthest)
            ahead, behind, k = (7, 8, 8) if rises else (8, 7, 6)
            x = begin / unit
            if s != 0.0:
                z = state[4] + s * bent(s * (begin - state[3]) / unit, state[5], state[6])
                state[behind] = max(state[behind], s * x - 1.0)
                shift += parameters[k] * ((1.0 + 0.5 * (state[7] + state[8])) / parameters[k + 1]) ** 0.8
            s = 1.0 if rises else -1.0
            length = max(shift - s * z, 0.0)
            xi = abs(s * (1.0 + state[ahead]) - (x + s * length))
            state[2], state[3], state[4], state[5] = s, begin, z, length
            state[6] = parameters[3] * (1.0 - parameters[4] * xi / (parameters[5] + xi))
            furthest = begin
        if u != state[0]:
            state[1] = state[4] + s * bent(s * (u - state[3]) / unit, state[5], state[6])
            state[9] = max(furthest, u) if s > 0.0 else min(furthest, u)
        state[0] = u
        return float(parameters[11] + parameters[1] * u + (parameters[0] - parameters[1]) * unit * state[1])

    @classmethod
    def from_opensees(
        cls,
        *,
        Fy: float,
        E0: float,
        b: float,
        R0: float = 15.0,
        cR1: float = 0.925,
        cR2: float = 0.15,
        a1: float = 0.0,
        a2: float = 1.0,
        a3: float = 0.0,
        a4: float = 1.0,
        least_reversal: float = 1e-6,
    ) -> Self:
        """The material ``uniaxialMaterial Steel02`` without initial stress, from a strain to a stress.

        ``least_reversal=0.0`` also takes over what it does with the smallest reversals.
        """
        shape = {"R0": R0, "cR1": cR1, "cR2": cR2, "a1": a1, "a2": a2, "a3": a3, "a4": a4}
        return cls(least_reversal=least_reversal, stiffness=E0, hardening=b * E0, yield_input=Fy / E0, **shape)

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`; ValueError if the law has an offset or an initial z."""
        if self.offset != 0.0 or self.z0 != 0.0:
            raise ValueError(f"Steel02 has no offset and no z0, got {self.offset:g} and {self.z0:g}")
        shape = {name: value for name, value in self.scalars.items() if name[0] in "Rca"}
        E0 = self.stiffness
        return {"Fy": E0 * self.yield_input, "E0": E0, "b": self.hardening / E0, **shape}
