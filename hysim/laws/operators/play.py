"""The play and the stop, from which the other rate-independent operators are built.

Sources: M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis, 1989.
"""

from dataclasses import dataclass
from typing import ClassVar

from hysim.laws.operators._bank import Clamps
from hysim.models.model import Example, family
from hysim.models.parameters import Parameter


@dataclass(frozen=True, kw_only=True, eq=False)
class Element(Clamps):
    """A single play or stop."""

    threshold: float = 1.0
    gain: float = 1.0
    offset: float = 0.0
    z0: float = 0.0

    not_negative = ("threshold",)
    searched = (
        Parameter("threshold", 1e-3, 1.5, unit="h", physical=(True, False)),
        Parameter("z0", -1.0, 1.0, unit="h", from_first=True),
        Parameter("gain", unit="y/u", affine=True),
        Parameter("offset", unit="y", affine=True),
    )
    powers: ClassVar = {"gain": None, "offset": 0}
    starts = tuple({"threshold": share, "z0": 0.0} for share in (0.1, 0.3, 0.6))
    screened = 256


@family
class Play(Element):
    """Play (backlash) of half width r, ``y = offset + gain z`` with ``z_k = min(max(z_(k-1), u_k - r), u_k + r)``.

    Exact at the samples of an input that is monotone between them. The loop runs counterclockwise.

    Parameters
    ----------
    threshold : float
        Half width r, not negative [unit of u].
    gain, offset : float
        [unit of y / unit of u], and output at z = 0 [unit of y].
    z0 : float
        Position before the first sample, which pushes it [unit of u].

    Raises
    ------
    ValueError
        If a number is not finite, or the threshold is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Play(threshold=0.25, gain=2.0).response([0.0, 1.0, 0.75, 0.0]).tolist()
    [0.0, 1.5, 1.5, 0.5]
    """

    example = Example({"threshold": 0.25}, title="Play")


@family
class Stop(Element):
    """Stop (elastic-perfectly plastic element), ``y = offset + gain (u - z)`` with the z of `Play`.

    A spring, fixed at z, that slips at the elongation r. The loop runs clockwise.

    Parameters
    ----------
    threshold : float
        Elongation r at which it slips, not negative [unit of u].
    gain, offset : float
        Stiffness [unit of y / unit of u], and output of the relaxed element [unit of y].
    z0 : float
        Where it is fixed before the first sample, which may pull it along [unit of u].

    Raises
    ------
    ValueError
        If a number is not finite, or the threshold is negative.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Stop(threshold=0.25, gain=2.0).response([0.0, 1.0, 0.75, 0.0]).tolist()
    [0.0, 0.5, 0.0, -0.5]
    """

    example = Example({"threshold": 0.4}, title="Stop")
    stops: ClassVar[bool] = True

    @property
    def saturation(self) -> float:
        """Limit of y - offset on a long rising stroke, gain r; its negative where the input falls."""
        return self.gain * self.threshold
