"""The deteriorating pinching law of Ibarra, Medina and Krawinkler.

Lengths are over yield_input, forces over stiffness yield_input. In each direction the backbone beyond the yield point
is

    B(x) = max(residual, min(F (1 + a (x - F)), R - capping_ratio x)),    F = 1, R so that both meet at the cap

An excursion begins at f = 0 and goes to the largest point so far in its direction, (X, B(X)), X >= 1 at first, and on
along B: straight, or first by

    the break point at x_b = (1 - pinch_input) (X - B(X) / K),   on the line from the begin to (X, pinch_force B(X)), if
    pinch_force < 1, K > 0, and it is beyond the begin;
    then the last peak on this side, if there is one, ahead of this and higher, lower than B(X), and the way by it is
    steeper. The peaks are the tips of excursions that have ended.

With E the energy of the excursion and S that of all so far, this one included, each mode j with Lambda_j > 0 has

    beta_j = (E / (Lambda_j - S))^c,    0 where E = 0, and 1 where E reaches Lambda_j - S

From the tip of an excursion the force falls with the slope (1 - beta_k) K, where E is what is lost if it falls to zero
with K. At zero, K := (1 - beta_k) K, and in the direction which begins, E now being what was lost,

    F := (1 - beta_s) F,    R := (1 - beta_c) R,    X := (1 + beta_a) X

Where a beta of the last three reaches 1, the capacity is exhausted and the force is zero from then on. F is not below
the residual. The slope of unloading is not below that from the begin of the excursion to its tip, nor such that the
excursion would deliver energy. An E below 1e-12 of the work up to the tip is rounding, and counts as 0: with c < 1 the
betas of elastic excursions would grow out of it.
"""

from typing import ClassVar, Self

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.kernels.components import dissipated, lengthened, lost_share
from hysim.models.law import Law, Packed
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter
from hysim.models.stages import Stage
from hysim.models.tables import Tables

_CAPACITIES = ("Lambda_s", "Lambda_c", "Lambda_k", "Lambda_a")
_OPENSEES = {
    **{f"Lambda_{name[-1].upper()}": name for name in _CAPACITIES},
    **{"c": "c", "kappaF": "pinch_force", "kappaD": "pinch_input"},
}
_SHARES = ("hardening_ratio", "residual", "pinch_force", "pinch_input")


@family
class IbarraMedinaKrawinkler(Law):
    """Ibarra-Medina-Krawinkler law: a backbone with a cap, pinching, and deterioration by dissipated energy.

    The force is loaded to the largest point so far in its direction, with a break on the way where it pinches. The
    backbone rises to a cap, and then falls to a residual strength. Four modes of deterioration follow from the energy
    of each excursion, which is what happens between two zeros of the force.

    Parameters
    ----------
    stiffness : float
        Elastic slope dy/du [unit of y / unit of u].
    yield_input : float
        Input of the yield point on both sides, positive [unit of u].
    hardening_ratio : float
        Slope beyond the yield point over the stiffness, from 0 to 1.
    cap_input : float
        Input of the cap; if it is below yield_input, and the capping_ratio positive, the law yields there [unit of u].
    capping_ratio : float
        Slope beyond the cap, downwards, over the stiffness, not negative; 0 if there is no cap.
    residual : float
        Strength that stays, over the yield strength, from 0 to 1.
    pinch_force, pinch_input : float
        Break point: height over that of the peak, and share of the residual input by which it comes earlier, from 0 to
        1. With a height of 1 there is no pinching.
    Lambda_s, Lambda_c, Lambda_k, Lambda_a : float
        Capacities of the modes: energy over the yield strength after which the strength, the cap, the unloading
        stiffness and the peaks are lost, not negative [unit of u]; 0 for a mode that is absent.
    c : float
        Exponent of the rate of deterioration, positive.

    Raises
    ------
    ValueError
        If a number is not finite or outside its limits.

    Notes
    -----
    The law is virgin at u = 0, from where it comes to the first sample. No excursion delivers energy. The output is
    proportional to the stiffness. A small interruption is forgotten: the force comes back on the line on which it left,
    and counts as one unloading.

    *The capacity* has three definitions in print. Here and in OpenSees it is ``E_t = Lambda F_y``. Ibarra's is
    ``E_t = gamma F_y u_y``, so that ``Lambda = gamma yield_input``; that of Lignos and Krawinkler ``E_t = lambda
    theta_p M_y``, so that ``Lambda = lambda theta_p``.

    Sources: L. F. Ibarra, R. A. Medina and H. Krawinkler, Earthquake Eng. Struct. Dyn. 34 (2005) 1489; D. G. Lignos and
    H. Krawinkler, J. Struct. Eng. 137 (2011) 1291.

    Examples
    --------
    >>> import hysim as hs
    >>> joint = hs.IbarraMedinaKrawinkler(stiffness=10.0, yield_input=0.1, cap_input=0.4, Lambda_s=2.0)
    >>> joint.response([0.0, 0.3, -0.3, 0.3, -0.3, 0.3]).round(3).tolist()
    [0.0, 1.06, -0.945, 0.925, -0.898, 0.878]
    """

    stiffness: float = 1.0
    yield_input: float = 1.0
    hardening_ratio: float = 0.03
    cap_input: float = 6.0
    capping_ratio: float = 0.05
    residual: float = 0.2
    pinch_force: float = 0.3
    pinch_input: float = 0.3
    Lambda_s: float = 0.0
    Lambda_c: float = 0.0
    Lambda_k: float = 0.0
    Lambda_a: float = 0.0
    c: float = 1.0

    within: ClassVar = dict.fromkeys(_SHARES, ("at most", 1.0))
    positive = ("yield_input", "c")
    not_negative = ("capping_ratio", *_SHARES, *_CAPACITIES)
    units: ClassVar = dict.fromkeys(("capping_ratio", *_SHARES, "c"), "1")
    initial: ClassVar[tuple[str, ...]] = ()
    further_memory = 18
    workspace = 3
    example = Example(
        dict.fromkeys(_CAPACITIES, 60.0) | {"cap_input": 2.0, "capping_ratio": 0.4, "residual": 0.4},
        (-4.0, 4.0),
        title="Ibarra-Medina-Krawinkler: pinched joint",
        group="Devices",
    )
    searched = (
        Parameter("stiffness", unit="y/u", affine=True),
        Parameter("yield_input", 1e-2, 2.0, unit="h", log=True),
        Parameter("hardening_ratio", 0.0, 0.9, physical=(True, True)),
        Parameter("cap_input", 1e-2, 3.0, unit="h", log=True),
        Parameter("capping_ratio", 1e-3, 2.0, log=True),
        *(Parameter(name, 0.0, 1.0, physical=(True, True)) for name in ("residual", "pinch_force", "pinch_input")),
        *(Parameter(name, 0.1, 1e3, unit="h", log=True) for name in _CAPACITIES),
        Parameter("c", 0.5, 2.0, log=True),
    )
    starts = tuple({"yield_input": share, "cap_input": 1.0} for share in (0.05, 0.15, 0.4))
    stages = (
        Stage("strength that falls", ("Lambda_s",), {"Lambda_s": 0.0}, optional=("c",)),
        Stage("stiffness that falls", ("Lambda_k", "Lambda_a"), {"Lambda_k": 0.0, "Lambda_a": 0.0}),
        Stage("cap that falls", ("Lambda_c",), {"Lambda_c": 0.0}),
    )

    @staticmethod
    def step(parameters: FloatArray, state: FloatArray, u: float) -> float:
        """Output at the next input `u`.

        `state` is (u, direction of the excursion, its begin, its tip (x, f), the energy up to there, S before it, loss
        of K, whether the capacity is exhausted), then for each direction X - 1, the last tip, and the losses of F and
        R, and the workspace of `lengthened`.
        """
        s = 1.0 if state[1] == 0.0 else state[1]
        v, k, tip, f, exponent = s * u / parameters[1], 9 if s > 0.0 else 14, state[3], state[4], parameters[12]
        if v < tip:
            high, area, stiffness = f, state[5], 1.0 - state[7]
            energy = dissipated(area, high, stiffness)
            stiffness *= 1.0 - lost_share(energy, state[6] + energy, parameters[10], exponent)
            slope = max(stiffness, high / (tip - state[2]), 0.5 * high * high / area) if high > 0.0 else 1.0
            f = high - slope * (tip - v)
            if f < 0.0:
                state[k], state[k + 1], state[k + 2] = max(state[k], tip - 1.0), tip, high
                energy = dissipated(area, high, slope)
                state[6], state[7] = state[6] + energy, 1.0 - stiffness
                s, v, tip, k, f = -s, -v, high / slope - tip, 23 - k, 0.0
                state[2], state[3], state[4], state[5] = tip, tip, 0.0, 0.0
                strength = lost_share(energy, state[6], parameters[8], exponent)
                cap = lost_share(energy, state[6], parameters[9], exponent)
                peak = lost_share(energy, state[6], parameters[11], exponent)
                state[k] += (1.0 + state[k]) * peak
                state[k + 3] += (1.0 - state[k + 3]) * strength
                state[k + 4] += (1.0 - state[k + 4]) * cap
                if max(strength, cap, peak) >= 1.0:
                    state[8] = 1.0
        if v >= tip:
            begin, peak, falling, least = state[2], 1.0 + state[k], parameters[4], parameters[5]
            strength, cap = max(least, 1.0 - state[k + 3]), parameters[3] * (1.0 - state[k + 4])
            hardening = parameters[2] * strength
            rest = strength - hardening * strength
            top = max(least, min(rest + hardening * peak, cap - falling * peak))
            at, low, pinch = begin, 0.0, begin
            if state[7] < 1.0:
                pinch = (1.0 - parameters[7]) * (peak - top / (1.0 - state[7]))
            state[19], state[20], state[21] = begin, 0.0, 0.0
            if begin < pinch and parameters[6] < 1.0:
                at = pinch
                low = parameters[6] * top * (at - begin) / (peak - begin)
                lengthened(state, 19, v, at, low)
            last, force = state[k + 1], state[k + 2]
            if at < last and low < force < top and (force - low) * (peak - at) > (top - low) * (last - at):
                lengthened(state, 19, v, last, force)
            lengthened(state, 19, v, peak, top)
            if falling > 0.0:
                corner = (cap - rest) / (hardening + falling)
                lengthened(state, 19, v, corner, max(least, cap - falling * corner))
                lengthened(state, 19, v, (cap - least) / falling, least)
            lengthened(state, 19, v, v, max(least, min(rest + hardening * v, cap - falling * v)))
            f = state[20]
            state[3], state[4], state[5] = v, f, state[21]
        state[0], state[1] = u, s
        return float(parameters[0] * parameters[1] * (s * f)) if state[8] == 0.0 else 0.0

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """The fields, with R of the virgin backbone for cap_input, and capacities over yield_input."""
        a, falling, cap = tables["hardening_ratio"], tables["capping_ratio"], tables["cap_input"]
        unit = np.minimum(tables["yield_input"], np.where(falling > 0.0, cap, np.inf))
        cap = np.where(falling > 0.0, 1.0 + a * (cap / unit - 1.0) + falling * (cap / unit), np.inf)
        scaled = {name: tables[name] / unit for name in _CAPACITIES}
        return super().pack({**tables, "yield_input": unit, "cap_input": cap, **scaled})

    @classmethod
    def from_opensees(
        cls, *, Ke: float, Up: float, Upc: float, Fy: float, FmaxFy: float, ResF: float, Lambda_S: float = 0.0,
        Lambda_C: float = 0.0, Lambda_K: float = 0.0, Lambda_A: float = 0.0, c: float = 1.0, kappaF: float = 1.0,
        kappaD: float = 0.0,
    ) -> Self:  # fmt: skip
        """The material ``IMKPinching`` with the same numbers in both directions; ``IMKPeakOriented`` for kappaF = 1.

        Its ultimate displacement, after which the force is zero, is not taken over.
        """
        shares = {"hardening_ratio": (FmaxFy - 1.0) * Fy / (Up * Ke), "residual": ResF}
        cap = {"cap_input": Fy / Ke + Up, "capping_ratio": FmaxFy * Fy / (Upc * Ke)}
        numbers = Lambda_S, Lambda_C, Lambda_K, Lambda_A, c, kappaF, kappaD
        further = dict(zip(_OPENSEES.values(), numbers, strict=True))
        return cls(stiffness=Ke, yield_input=Fy / Ke, **shares, **cap, **further)

    def to_opensees(self) -> dict[str, float]:
        """The arguments of `from_opensees`; ValueError for a law without a cap."""
        Ke, Fy, Up = self.stiffness, self.stiffness * self.yield_input, self.cap_input - self.yield_input
        if self.capping_ratio == 0.0 or Up <= 0.0:
            raise ValueError("IMKPinching has a cap beyond the yield point")
        ratio, own = 1.0 + self.hardening_ratio * Ke * Up / Fy, self.scalars
        cap = {"Up": Up, "Upc": ratio * Fy / (self.capping_ratio * Ke), "FmaxFy": ratio, "ResF": self.residual}
        return {"Ke": Ke, "Fy": Fy, **cap, **{name: own[field] for name, field in _OPENSEES.items()}}
