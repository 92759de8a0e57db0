"""The Prandtl-Ishlinskii law: a weighted sum of plays, and its exact inverse.

The slope after a reversal grows through the sums s_i = w_0 + ... + w_i. Where r_0 = 0 and all s_i have one sign the
output is monotone in the input, and the inverse is of the same kind (with s_-1 = 0, and the sum for i = 0 left out)

    w'_0 = 1 / w_0,    w'_i = -w_i / (s_i s_(i-1))
    r'_i = |sum_(j<=i) w_j (r_i - r_j)|
    z'_i = sum_(j<=i) w_j z_i + sum_(j>i) w_j z_j

An offset c moves the inverse's own input: u = sum w'_i (z'_i - c), where z'_i begins c further on.
"""

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels import inverses
from hysim.laws.operators._bank import Clamps, Plays
from hysim.models.law import State
from hysim.models.model import Example, family
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits

_CONSISTENT = 1e-9  # of the largest threshold: what rounding may add to the distance of two plays


@family
class PrandtlIshlinskii(Plays, Clamps):
    """Prandtl-Ishlinskii law, ``y = offset + sum w_i z_i`` over plays of the thresholds r_i.

    ``z_i(k) = min(max(z_i(k-1), u_k - r_i), u_k + r_i)``. Positive weights give the counterclockwise loops of
    piezoelectric stacks, negative ones beside a large w_0 the clockwise ones of a force. A law without plays, the
    default, is a constant; `hysim.identify` takes it as ``PrandtlIshlinskii.structure()``. Sources: K. Kuhnen, European
    J. Control 9 (2003), for the inverse; P. Krejci and K. Kuhnen, IEE Proc. Control Theory Appl. 148 (2001).

    Parameters
    ----------
    thresholds, weights : sequence of float, length n_plays
        r_i, not negative and increasing [unit of u], and w_i, of any sign [unit of y / unit of u]. The play of
        threshold zero is the input itself.
    offset : float
        Output at rest at u = 0 [unit of y].
    z0 : float or sequence of float, length n_plays
        Positions before the first sample, which pushes them [unit of u].

    Raises
    ------
    ValueError
        If lengths differ, a number is not finite, or the thresholds are negative or do not increase.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.PrandtlIshlinskii(thresholds=(0.0, 0.5), weights=(1.0, 2.0))
    >>> law.response([0.0, 1.0, 0.5, -1.0]).tolist(), law.inverse_response([0.0, 2.0, 1.5, -2.0]).tolist()
    ([0.0, 2.0, 1.5, -2.0], [0.0, 1.0, 0.5, -1.0])
    """

    units: ClassVar = {"thresholds": "u", "weights": "y/u", "offset": "y", "z0": "u"}
    example = Example(
        {
            "thresholds": tuple(1.2 * k / 6 for k in range(21)),  # those behind the sixth are for the page, which adds
            "weights": (0.3, *[1.0 / 6.0] * 6, *[0.0] * 14),  # plays
        },
        (-2.0, 2.0),
        title="Prandtl-Ishlinskii",
        stack=True,
    )

    offset: float = 0.0
    z0: tuple[float, ...] = (0.0,)

    def is_invertible(self) -> bool:
        """Whether r_0 = 0 and the sums w_0 + ... + w_i have one sign: then there is an `inverse`."""
        return self.refusal() is None

    def refusal(self) -> str | None:
        """Why there is no `inverse`; None where there is one."""
        if not self.thresholds or self.thresholds[0] > 0.0:
            return "the law has no inverse: without a play of threshold zero its output stands still at a reversal"
        if (wrong := wrong_sum(self.weights)) is None:
            return None
        return (
            f"the law has no inverse: the sums of weights w_0 + ... + w_i must have one sign, but from "
            f"{self.weights[0]:g} for i = 0 they come to {sum(self.weights[: wrong + 1]):g} for i = {wrong}"
        )

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        law = self.after([u0])
        y0 = float(law.response([u0])[0])
        forward, inverse = law.compiled(u0), law.inverse().compiled(y0)
        return CompiledLaw(
            inverses.plays,
            read_only(np.concatenate([limits, inverse.parameters, forward.parameters]), finite=False),
            np.concatenate([[u0, y0], inverse.state, forward.state, inverse.state]),
        )

    def inverse(self) -> "PrandtlIshlinskii":
        """The law that gives the input for a wanted output, exactly; it begins as this law begins.

        Raises ValueError if the law is not invertible, or z0 holds positions that no input leads to.

        Examples
        --------
        >>> import hysim as hs
        >>> hs.PrandtlIshlinskii(thresholds=(0.0, 0.5), weights=(1.0, 1.0)).inverse()
        PrandtlIshlinskii(thresholds=(0.0, 0.5), weights=(1.0, -0.5), offset=0.0, z0=(0.0, 0.0))
        """
        if (refusal := self.refusal()) is not None:
            raise ValueError(refusal)
        r, w, z = self.elements if self.u0 is None else self.after([self.u0]).elements
        z = _consistent(r, z)
        sums = np.cumsum(w)
        weights = np.concatenate([1.0 / w[:1], -w[1:] / (sums[1:] * sums[:-1])])
        thresholds = np.abs(np.concatenate([[0.0], np.cumsum(sums[:-1] * np.diff(r))]))
        later = np.concatenate([np.cumsum((w * z)[::-1])[::-1][1:], [0.0]])
        return PrandtlIshlinskii(
            thresholds=tuple(thresholds.tolist()),
            weights=tuple(weights.tolist()),
            offset=0.0 - self.offset * float(weights.sum()),
            z0=tuple((sums * z + later + self.offset).tolist()),
        )

    def inverted(self, y: FloatArray, u0: float | None, state: State | None) -> FloatArray:
        """The response of `inverse`, exact to rounding, with the errors of `inverse`."""
        start = self.advance([u0])[1] if state is None and u0 is not None else state
        law = self if start is None else replace(self, z0=start[1:], u0=None)
        return law.inverse().response(y)


def wrong_sum(weights: npt.ArrayLike) -> int | None:
    """The first i for which the sum of the weights up to i has not the sign of the first weight, or is zero."""
    sums = np.cumsum(weights)
    wrong = np.flatnonzero(~(sums * np.sign(sums[0]) > 0.0))
    return int(wrong[0]) if wrong.size else None


def _consistent(r: FloatArray, z: FloatArray) -> FloatArray:
    """The positions with that of threshold zero, which the first sample sets anyway, within reach of the others."""
    slack = _CONSISTENT * r[-1]
    apart = np.abs(z[1:, np.newaxis] - z[1:]) - np.abs(r[1:, np.newaxis] - r[1:])
    if (apart > slack).any():
        i, j = (int(k) + 1 for k in np.argwhere(apart > slack)[0])
        raise ValueError(
            f"the law has no inverse from this z0: no input leads to the positions {z[i]:g} and {z[j]:g} of the "
            f"plays {i} and {j}, which differ by more than their thresholds {r[i]:g} and {r[j]:g}"
        )
    lowest, highest = (z - r)[1:].max(initial=-np.inf), (z + r)[1:].min(initial=np.inf)
    return np.concatenate([[min(max(float(z[0]), lowest), highest)], z[1:]])
