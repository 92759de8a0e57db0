"""The Maxwell-slip law: parallel springs, each with its own elongation at which it slips."""

from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import check_lengths, read_only
from hysim.laws.operators._bank import Bank, Clamps
from hysim.laws.operators._bank_search import BankStructure
from hysim.laws.operators.prandtl_ishlinskii import PrandtlIshlinskii
from hysim.models.model import Example, family


@family
class MaxwellSlip(Bank, Clamps):
    """Maxwell-slip law: parallel springs, each with its own elongation at which it slips.

    ::

        F = offset + feedthrough u + sum_i k_i (u - z_i),    z_i = min(max(z_i, u - d_i), u + d_i)

    u is the displacement, z_i the block to which spring i is fixed, F the force. An element holds at most the force k_i
    d_i. The law is a sum of stops; the loop of a positive stiffness runs clockwise. A law without elements, the
    default, is a line; `hysim.identify` takes it as ``MaxwellSlip.structure()``. Sources: M. Goldfarb and N. Celanovic,
    IEEE Control Systems 17 (1997); W. D. Iwan, J. Appl. Mech. 33 (1966).

    Parameters
    ----------
    stiffness : sequence of float, length n_elements
        k_i, of any sign [unit of y / unit of u].
    slips : sequence of float, length n_elements
        Elongation d_i at which each element slips, not negative [unit of u].
    feedthrough, offset : float
        Stiffness of a spring beside them that does not slip [unit of y / unit of u], and output at rest at u = 0 [unit
        of y].
    z0 : float or sequence of float, length n_elements
        Positions of the blocks before the first sample, which may pull them along [unit of u].

    Raises
    ------
    ValueError
        If lengths differ, a number is not finite, or an elongation is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.MaxwellSlip.from_limits(stiffness=(4.0, 2.0), limits=(1.0, 2.0))
    >>> law.slips, law.response([0.0, 0.25, 2.0, 1.5, -2.0]).tolist()
    ((0.25, 1.0), [0.0, 1.5, 3.0, 0.0, -3.0])
    """

    units: ClassVar = {"stiffness": "y/u", "slips": "u", "feedthrough": "y/u", "offset": "y", "z0": "u"}
    example = Example({"stiffness": (1.0, 1.0, 1.0), "slips": (0.2, 0.5, 0.9)}, (-1.5, 1.5), title="Maxwell slip")
    thresholds_name: ClassVar[str] = "slips"
    weights_name: ClassVar[str] = "stiffness"
    stops: ClassVar[bool] = True
    ordered: ClassVar[bool] = False

    stiffness: tuple[float, ...] = ()
    slips: tuple[float, ...] = ()
    feedthrough: float = 0.0
    offset: float = 0.0
    z0: tuple[float, ...] = (0.0,)

    @classmethod
    def from_limits(
        cls, *, stiffness: npt.ArrayLike, limits: npt.ArrayLike, feedthrough: float = 0.0, offset: float = 0.0
    ) -> Self:
        """The law by the force at which each element slips, f_i = k_i d_i, with blocks that begin at zero.

        `stiffness` k_i, not zero [unit of y / unit of u], and `limits` f_i, of the sign of k_i [unit of y], have the
        length n_elements, else ValueError; feedthrough and offset are those of the constructor.
        """
        k, f = (read_only(values, name, ndim=1) for values, name in ((stiffness, "stiffness"), (limits, "limits")))
        check_lengths(stiffness=k, limits=f)
        if not k.all() or (f * k < 0.0).any():
            raise ValueError(f"a stiffness must not be zero, and its limit has its sign, got {k} and {f}")
        return cls(stiffness=tuple(k.tolist()), slips=tuple((f / k).tolist()), feedthrough=feedthrough, offset=offset)

    @classmethod
    def structure(  # type: ignore[override]  # its elements are no plays
        cls, *, elements: int = 10, slips: npt.ArrayLike = (), one_signed: bool | None = None
    ) -> BankStructure:
        """Elements for `hysim.identify`: their number, slipping in even steps up to half the input's span, or `slips`.

        With `one_signed` every stiffness has the sign of the record's loop, positive if clockwise; by default the BIC
        decides. ValueError or TypeError if the number is not a positive int, or an elongation [unit of u] not finite.
        """
        return super().structure(plays=elements, thresholds=slips, one_signed=one_signed)

    @property
    def limits(self) -> tuple[float, ...]:
        """Largest force of each element, f_i = k_i d_i [unit of y]."""
        return tuple(k * d for k, d in zip(self.stiffness, self.slips, strict=True))

    @property
    def saturation(self) -> float:
        """Limit of the force of the elements on a long rising stroke, the sum of their limits [unit of y]."""
        return sum(self.limits)

    def to_prandtl_ishlinskii(self) -> PrandtlIshlinskii:
        """This law as a sum of plays: weights -k_i, and their sum at the threshold zero.

        Raises ValueError if elements that slip at one elongation begin at different positions: no play stands at both.
        """
        slope, slips, weights = self.as_plays
        thresholds, element = np.unique(np.concatenate([[0.0], slips]), return_inverse=True)
        positions = np.zeros(thresholds.size)
        z0 = self.elements[2][np.argsort(self.slips, kind="stable")]
        positions[element[1:]] = z0
        if not np.array_equal(positions[element[1:]], z0):
            raise ValueError("elements of equal slips must have equal z0 to be one play")
        return PrandtlIshlinskii(
            thresholds=tuple(thresholds.tolist()),
            weights=tuple(np.bincount(element, np.concatenate([[slope], weights])).tolist()),
            offset=self.offset,
            z0=tuple(positions.tolist()),
        )
