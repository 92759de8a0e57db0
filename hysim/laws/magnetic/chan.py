"""Chan's law of magnetic cores, which LTspice has."""

from typing import ClassVar, Self

import numpy as np

from hysim._basics.frozen import check_not_negative, check_positive
from hysim.kernels import chan as kernels
from hysim.laws.magnetic.tellinen import VACUUM, BranchLaw
from hysim.models.law import Packed
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter, declared_space
from hysim.models.search_space import ALL_FREE, Freedom, SearchSpace
from hysim.models.tables import Tables
from hysim.records import Record

_BEHIND_A_GAP = {
    "saturation": Parameter("saturation", 1e-2, 1e2, unit="y", log=True),
    "feedthrough": Parameter("feedthrough", 0.0, 10.0, unit="y/u", physical=(True, False)),
}
"""Parameters in which the output is affine without a gap alone."""
_SAME = 1e-9  # relative difference of numbers that are the same


@family
class Chan(BranchLaw):
    """Chan's law of magnetic cores, that of LTspice's inductors: hyperbolic branches, translated vertically.

    ::

        y        = offset + feedthrough h + saturation m,    h = u - gap (y - offset)
        rising   m = min(lower + r, upper),    falling  m = max(upper - r, lower)
        upper    = (h + coercivity) / (|h + coercivity| + knee),    lower = (h - coercivity) / (|h - coercivity| + knee)

    with ``knee = coercivity (1 / squareness - 1)``; r is the distance from the branch where the input last turned, at
    most that of the branches. Before its first turn a field that moves away from zero keeps its place between the
    branches: from the demagnetised state it goes along the initial curve, the mean of both. u is the field H and y the
    flux density B, or current and flux linkage; h is the field in the core. A stroke solves a quadratic equation.

    The branches, the initial curve as their mean, and symmetric loops by translated branches are documented for LTspice
    and in the paper. The bound of a translated branch by the limiting loop is ours. LTspice closes loops that are not
    symmetric by another construction (US patent 7 502 723); here they creep from cycle to cycle until they touch the
    limiting loop, and one that lies far on one side of h = 0 then has no area. `hysim.identify` holds the gap, and the
    offset: a translated loop is the same one wherever it lies. Sources: J. H. Chan and others, IEEE Trans. CAD 10
    (1991) 476; LTspice help, "L. Inductor".

    Parameters
    ----------
    saturation : float
        Magnetisation to which both branches tend [unit of y].
    coercivity : float
        Half the width of the limiting loop at m = 0, positive [unit of u].
    squareness : float
        Remanence over saturation of the limiting loop, between 0 and 1.
    feedthrough : float
        Slope dy/dh at saturation [unit of y / unit of u]: the magnetic constant where y is a flux density.
    gap : float
        Field that a unit of flux drops in an air gap, not negative [unit of u / unit of y].
    offset : float
        Output of the demagnetised law at u = 0 [unit of y].
    z0 : float
        Place between the branches at the first sample, from -1 (lower) to 1 (upper); 0 is demagnetised at u = 0.

    Raises
    ------
    ValueError
        If a number is not finite, coercivity is not positive, squareness is not between 0 and 1, z0 not between -1 and
        1, the gap is negative, or saturation or feedthrough are negative beside a gap.

    Examples
    --------
    >>> import hysim as hs
    >>> core = hs.Chan(saturation=0.44, coercivity=16.0, squareness=0.25)
    >>> core.response([0.0, 100.0, 0.0, -100.0, 0.0]).round(6).tolist()
    [0.0, 0.29561, 0.09439, -0.29561, -0.09439]
    """

    gap: float = 0.0
    offset: float = 0.0
    z0: float = 0.0

    units: ClassVar = {**BranchLaw.units, "offset": "y", "gap": "u/y"}
    not_negative = ("gap",)
    example = Example({"coercivity": 0.4, "squareness": 0.5}, (-2.0, 2.0), title="Magnetic core: Chan")
    step = staticmethod(kernels.step)
    states = ("rest", "free")
    searched = tuple(each for each in BranchLaw.searched if each.name != "offset")

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Refuse what is no pair of branches, no place between them, or no gap."""
        super().check(tables)
        for name in ("saturation", "feedthrough"):
            if ((tables["gap"] > 0.0) & (tables[name] < 0.0)).any():
                raise ValueError(f"{name} must not be negative with a gap, got {tables[name].min()}")

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Parameters as `hysim.kernels.chan` has them, and the memory (u, z, excess, turn, h)."""
        head = [tables[name] for name in ("offset", "saturation", "feedthrough", "gap", "coercivity")]
        knee = tables["coercivity"] * (1.0 / tables["squareness"] - 1.0)
        return Packed(np.concatenate([*head, knee], axis=1), cls.initial_memory(tables, further=3))

    @property
    def bend(self) -> float:
        """Knee of the branches, ``coercivity (1 / squareness - 1)`` [unit of u]."""
        return self.coercivity * (1.0 / self.squareness - 1.0)

    @property
    def known_slopes(self) -> tuple[float, float]:
        """Slopes of the core in series with the gap."""
        low, high = super().known_slopes
        return low / (1.0 + self.gap * low), high / (1.0 + self.gap * high)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of searched parameters in which the output is affine: empty with a gap."""
        return super().columns if self.gap == 0.0 else ()

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """Search box; the gap is that of the law, ValueError if it is to be free."""
        if "gap" in {*freedom.free, *freedom.bounds}:
            raise ValueError("the gap of a Chan cannot be searched: give its value")
        if self.gap == 0.0:
            return super().search_space(record, freedom)
        searched = tuple(_BEHIND_A_GAP.get(each.name, each) for each in self.searched)
        starts = tuple({**start, "saturation": 1.0, "feedthrough": 0.0} for start in self.starts)
        return declared_space(self, record, freedom, searched=searched, starts=starts)

    @classmethod
    def from_ltspice(
        cls, *, Hc: float, Bs: float, Br: float, A: float = 1.0, Lm: float = 1.0, Lg: float = 0.0, N: float = 1.0
    ) -> Self:
        """The law of an inductor of LTspice with a hysteretic core, demagnetised.

        Parameters
        ----------
        Hc : float
            Coercive force [A/m].
        Bs, Br : float
            Saturation and remnant flux density, 0 < Br < Bs [T].
        A, Lm, Lg, N : float
            Cross section [m^2], magnetic length without the gap and length of the gap [m], and number of turns. By
            default one each, and no gap: the law is then B(H), from A/m to T.

        Returns
        -------
        Chan
            From the current [A] to the flux linkage N A B [V s].

        Raises
        ------
        ValueError
            If the numbers are no core.

        Examples
        --------
        >>> import hysim as hs
        >>> coil = hs.Chan.from_ltspice(Hc=16.0, Bs=0.44, Br=0.1, A=25.1e-6, Lm=19.8e-3, Lg=0.6858e-3, N=1000)
        >>> (1e3 * coil.response([0.0, 0.1, 0.2, 0.4])).round(3).tolist()
        [0.0, 4.562, 8.983, 11.217]
        """
        check_positive(A=A, Lm=Lm, N=N)
        check_not_negative(Lg=Lg)
        return cls(
            saturation=N * A * Bs,
            coercivity=Hc * Lm / N,
            squareness=Br / Bs,
            feedthrough=VACUUM * N**2 * A / Lm,
            gap=Lg / (VACUUM * N**2 * A),
        )

    def to_ltspice(self, *, A: float = 1.0, Lm: float = 1.0, N: float = 1.0) -> dict[str, float]:
        """The parameters Hc, Bs, Br, A, Lm, Lg and N of LTspice for a core of this size; the inverse of `from_ltspice`.

        Raises ValueError if the law has an offset, is not demagnetised at first, or has another slope at saturation
        than vacuum, which LTspice's core cannot have.
        """
        slope = VACUUM * N**2 * A / Lm
        if self.offset != 0.0 or self.z0 != 0.0:
            raise ValueError(f"LTspice's core has no offset and no z0, got {self.offset:g} and {self.z0:g}")
        if abs(self.feedthrough - slope) > _SAME * slope:
            raise ValueError(
                f"LTspice's core has the slope of vacuum at saturation, {slope:g} for this size, got feedthrough = "
                f"{self.feedthrough:g}: identify with fixed={{'feedthrough': {slope:g}}}"
            )
        core = {"Hc": self.coercivity * N / Lm, "Bs": self.saturation / (N * A), "Br": self.remanence / (N * A)}
        return core | {"A": A, "Lm": Lm, "Lg": self.gap * VACUUM * N**2 * A, "N": N}
