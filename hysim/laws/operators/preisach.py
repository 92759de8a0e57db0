"""The Preisach law: relays of all thresholds, weighted by a density.

    y = offset + sum over a > b of w(a, b) R_ab[u],    R_ab = 1 once u has reached a, -1 once it has reached b

Half the output's change between the turning points a > b is the Everett function, the weight of relays that switch,

    E(a, b) = integral of w over b < b' < a' < a,    y = y_0 + 2 (E(x_1, x_0) - E(x_1, x_2) + E(x_3, x_2) - ...)

along the dominant extremes x_k of the input; a larger one wipes out smaller ones. The two laws hold the same table of
weights over pairs of intervals between levels, and agree where the input stops at levels only. The inverse runs the
same recursion on the outputs: as E is monotone, the dominant extremes of the output are those of the input. Each stroke
ends on a piece on which y is linear, so that it is exact. Sources: F. Preisach, Z. Phys. 94 (1935); D. H. Everett,
Trans. Faraday Soc. 51 (1955); I. D. Mayergoyz, Mathematical Models of Hysteresis, 1991.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.blas import one_blas_thread
from hysim._basics.frozen import FloatArray, check_whole, read_only
from hysim._columns.turning import TOLERANCE
from hysim.kernels import preisach as kernels
from hysim.laws.operators._densities import Density, check_strength, relay_weights, smooth
from hysim.laws.operators._relays import ROOM, RelayLaw, everett_of, weights_of
from hysim.laws.operators.prandtl_ishlinskii import PrandtlIshlinskii
from hysim.laws.operators.reversal_curves import everett_from_curves
from hysim.models.law import State
from hysim.models.model import Example, family
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.records import Record, several


def _two_bells(up: FloatArray, down: FloatArray) -> FloatArray:
    """Weight of relays: two bells, about the diagonal and about the line where both thresholds are opposite."""
    width, middle = up - down, 0.5 * (up + down)
    return np.exp(-4.0 * middle**2) * np.exp(-((width - 0.5) ** 2) / 0.2) / math.sqrt(math.pi)


_GRID = read_only(np.linspace(-1.0, 1.0, 11))


@family
class PreisachRelays(RelayLaw):
    """Preisach law of single relays, ``y = offset + sum w_ij R_ij``: its output jumps.

    Parameters
    ----------
    levels : sequence of float, length N + 1
        L_0 < L_1 < ... [unit of u].
    weights : sequence of float, length N (N + 1) / 2
        w_ij for j <= i, row by row [unit of y]: of the relay that goes up at L_(i+1) and down at L_j.
    offset, z0
        As in `Preisach` [unit of y, unit of u].

    Raises
    ------
    ValueError
        If lengths do not fit, a number is not finite, or the levels do not increase.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.PreisachRelays(levels=(0.0, 1.0, 2.0), weights=(1.0, 0.5, 1.0))
    >>> law.response([0.0, 1.5, 2.0, 1.5, 0.5, 0.0]).tolist()
    [-2.5, -0.5, 2.5, 2.5, 0.5, -2.5]
    """

    example = Example(
        {"levels": (-1.0, -0.5, 0.0, 0.5, 1.0), "weights": (0.1, 0.1, 0.3, 0.2, 0.3, 0.1, 0.1, 0.2, 0.1, 0.1)},
        title="Preisach relays",
    )
    spread: ClassVar[bool] = False


@family
class Preisach(RelayLaw):
    """Preisach law of a density that is even between levels; its output is continuous.

    Each weight of `PreisachRelays` is spread evenly over its pair of intervals, along the diagonal over one interval
    with itself. The output is piecewise linear in the input, with the diagonal weight's slope after a reversal. A law
    without relays, the default, is a constant; `hysim.identify` takes it as ``Preisach.structure()``.

    Parameters
    ----------
    levels : sequence of float, length N + 1
        L_0 < L_1 < ... [unit of u]. Beyond them the law is saturated.
    weights : sequence of float, length N (N + 1) / 2
        w_ij for j <= i, row by row [unit of y]: that of all relays whose upper threshold is in the interval i and
        whose lower one is in the interval j. Those of w_ii switch up and down at the same input.
    offset : float
        Mean of the outputs of all relays up and of all down [unit of y].
    z0 : sequence of float
        Inputs before the first sample, the oldest first; before them all relays are down [unit of u].

    Raises
    ------
    ValueError
        If lengths do not fit, a number is not finite, or the levels do not increase.

    Examples
    --------
    >>> import hysim as hs
    >>> law = hs.Preisach(levels=(0.0, 1.0, 2.0), weights=(1.0, 0.5, 1.0))
    >>> law.response([0.0, 1.5, 2.0, 1.5, 0.5]).tolist(), law.inverse_response([-2.5, 1.0, 2.5, 1.5]).tolist()
    ([-2.5, 1.0, 2.5, 1.5, -1.0], [0.0, 1.5, 2.0, 1.5])
    """

    spread: ClassVar[bool] = True
    example = Example({"levels": tuple(_GRID.tolist()), "weights": relay_weights(_GRID, _two_bells)}, title="Preisach")

    @classmethod
    def from_everett(cls, levels: npt.ArrayLike, everett: npt.ArrayLike, *, offset: float = 0.0) -> Self:
        """The law with the Everett function [unit of y] at the pairs of levels (n_levels,) [unit of u].

        Element [m, n] of `everett` (n_levels, n_levels), m > n, is half of what the output loses from the turning point
        at level m down to level n; others are not read. ValueError if the shape does not fit, or as the constructor.
        """
        grid, table = read_only(levels, "levels", ndim=1), read_only(everett, "everett", ndim=2, finite=False)
        if table.shape != (grid.size, grid.size):
            raise ValueError(f"everett must have the shape {(grid.size, grid.size)} of the levels, got {table.shape}")
        return cls(levels=tuple(grid), weights=tuple(weights_of(table)), offset=offset)

    @classmethod
    def from_density(cls, levels: npt.ArrayLike, density: Density, *, offset: float = 0.0) -> Self:
        """The law with the weights of a density w(a, b), integrated over each pair of intervals between the levels.

        ``density(a, b)`` takes arrays of upper and lower thresholds [unit of y / unit of u^2]; the levels (n_levels,)
        are in [unit of u]. Raises ValueError if it is not finite, or as the constructor.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.Preisach.from_density((0.0, 1.0, 2.0), lambda a, b: 3.0 + 0.0 * a)
        >>> [round(weight, 12) for weight in law.weights]
        [1.5, 3.0, 1.5]
        """
        grid = read_only(levels, "levels", ndim=1)
        return cls(levels=tuple(grid), weights=relay_weights(grid, density), offset=offset)

    @classmethod
    def from_plays(cls, levels: npt.ArrayLike, law: PrandtlIshlinskii) -> Self:
        """The law with the Everett function of a Prandtl-Ishlinskii law at the pairs of levels (n_levels,) [unit of u].

        A play of threshold r is a line of relays with a - b = 2 r. Where the input stops at the levels only, the two
        laws agree once the plays have been pushed from the lowest level or below; elsewhere E is interpolated. The
        law's z0 is not read. Errors are those of the constructor.

        Examples
        --------
        >>> import hysim as hs
        >>> plays = hs.PrandtlIshlinskii(thresholds=(0.0, 0.5), weights=(1.0, 2.0))
        >>> law = hs.Preisach.from_plays((-2.0, -1.0, 0.0, 1.0, 2.0), plays)
        >>> law.response([-2.0, 2.0, -1.0, 0.0]).tolist(), plays.response([-2.0, 2.0, -1.0, 0.0]).tolist()
        ([-5.0, 5.0, -2.0, -1.0], [-5.0, 5.0, -2.0, -1.0])
        """
        grid = read_only(levels, "levels", ndim=1)
        thresholds, weights, _ = law.elements
        falls = grid[:, np.newaxis, np.newaxis] - grid[:, np.newaxis] - 2.0 * thresholds
        everett = 0.5 * np.maximum(falls, 0.0) @ weights
        lowest = law.offset + float(weights @ (grid[0] + thresholds))
        return cls.from_everett(grid, everett, offset=lowest + float(everett[-1, 0]))

    @classmethod
    def from_reversal_curves(
        cls,
        record: Record,
        *,
        levels: npt.ArrayLike | None = None,
        smoothing: float | Literal["auto"] | None = None,
        tolerance: float = TOLERANCE,
    ) -> Self:
        """The law whose Everett function is read from first-order reversal curves, ``E(a, b) = (y_a - y_ab) / 2``.

        y_a is the output where the input turns at a on its way up from the lowest one, and y_ab where it is back at b.
        Between two turning points, E is interpolated as the rise to the upper one goes.

        Parameters
        ----------
        record : Record
            Strokes from the lowest input up to rising turning points, each followed by one back down, such as
            `hysim.signals.reversal_curves` has; or curves that rise from falling turning points, such as a magnetometer
            measures after saturation. The curves' samples need no common inputs. Of curves with one turning point the
            last counts; one that ends early goes on as its neighbour.
        levels : array, shape (n_levels,), optional
            Levels of the law [unit of u]; by default the turning points and all inputs of the curves, or, if these are
            more than 100, the turning points and about 100 even steps between them.
        smoothing : float or "auto", optional
            By default the law meets the samples at its levels on the way back. With a number the curves are those of a
            local regression, and their drift is subtracted, as in `hysim.forc`; ``"auto"`` takes the number that
            predicts left-out curves best.
        tolerance : float
            Retreats of the input up to this fraction of its span are ignored: noise.

        Returns
        -------
        Preisach
            Without smoothing, noise of the standard deviation s leaves some s in each weight, of either sign.

        Raises
        ------
        ValueError
            If the input does not turn, or levels do not reach the curves' end: lowest input, or highest if they rise.

        Examples
        --------
        >>> import hysim as hs
        >>> law = hs.Preisach(levels=(0.0, 1.0, 2.0), weights=(1.0, 0.5, 1.0), offset=3.0)
        >>> u = hs.signals.reversal_curves(0.0, 2.0, curves=2, samples_per_step=5)
        >>> curves = hs.Preisach.from_reversal_curves(hs.Record(u=u, y=law.response(u)), levels=law.levels)
        >>> [round(weight, 12) for weight in curves.weights], round(curves.offset, 12)
        ([1.0, 0.5, 1.0], 3.0)
        """
        grid, everett, lowest = everett_from_curves(record, levels, tolerance, smoothing)
        return cls.from_everett(grid, everett, offset=lowest + float(everett[-1, 0]))

    @classmethod
    def smoothed(
        cls, records: Record | Sequence[Record], *, intervals: int | None = None, strength: float | None = None
    ) -> Self:
        """The law of a smooth density that fits records, as smooth as predicts best what is left out of them.

        ``hysim.identify(hysim.Preisach, ...)`` has few levels and weights of one sign; here are many levels, and
        weights of any sign whose second differences are small.

        Parameters
        ----------
        records : Record or sequence of Record
            Inputs and outputs, best at several amplitudes, or reversal curves.
        intervals : int, optional
            Number of equal intervals over the span of all inputs; by default as fine as their steps, at most 64. The
            density has at most 24 cells along each threshold, and is linear between their centres.
        strength : float, optional
            Weight of the second differences against the errors, 0 for none; by default that of 43 between 1e-10 and 1e4
            whose fits to the rest predict best what is left out: each record that the others reach, or each cycle or
            curve of a single record; and each quarter of a record.

        Returns
        -------
        Preisach
            With the inputs before the first sample, none or the record's own, that predict better.

        Raises
        ------
        ValueError, TypeError
            If the inputs are constant, `intervals` is not a positive int, or the strength is negative.

        Examples
        --------
        >>> import numpy as np, hysim as hs
        >>> law = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 21), lambda a, b: np.exp(-4.0 * (a + b) ** 2))
        >>> u = hs.signals.reversal_curves(-1.0, 1.0, curves=6, samples_per_step=6)
        >>> found = hs.Preisach.smoothed(hs.Record(u=u, y=law.response(u)))
        >>> inner = np.array([-1.0, 0.7, -0.3, 0.5, -0.1])
        >>> bool(np.abs(found.response(inner) - law.response(inner)).max() < 0.01)
        True
        """
        all_records = several(records, "Preisach.smoothed")
        if strength is not None:
            check_strength(strength)
        if intervals is not None:
            check_whole(intervals, "intervals")
        with one_blas_thread():
            law: Self = smooth(cls, all_records, intervals, strength)[0].models[0]
        return law

    def slope_bounds(self) -> tuple[float, float]:
        """Lowest and highest slope dy/du over every input between the levels.

        Where the input rises in the interval i, the relays w_ij, w_i(j+1), ..., w_ii go up, with j that of the last
        minimum; where it falls in the interval j, w_jj, w_(j+1)j, ..., w_ij go down, with i that of the last maximum.
        """
        if not self.levels:
            return 0.0, 0.0
        everett, length = everett_of(np.array([self.weights]))[0], np.diff(self.levels)
        below = np.tril_indices(length.size)
        rising = np.diff(everett, axis=0)[:, :-1] / length[:, np.newaxis]
        falling = (everett[1:, :-1] - everett[1:, 1:]) / length
        slopes = 2.0 * np.concatenate([rising[below], falling[below]])
        return float(slopes.min()), float(slopes.max())

    def is_invertible(self) -> bool:
        """Whether the slope has one sign for every input between the levels, and nowhere vanishes."""
        low, high = self.slope_bounds()
        return low * high > 0.0

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | None) -> CompiledLaw:
        past = state[1:] if state is not None else self.past if u0 is None else (*self.past, u0)
        return self.inverse_from(past, room=y.size)

    @property
    def output_bounds(self) -> tuple[float, float]:
        """Outputs where all relays are down, and where all are up."""
        bound = abs(float(self.everett[-1, 0]))
        return self.offset - bound, self.offset + bound

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        return self.inverse_from((*self.past, u0), limits, room=ROOM)

    def inverse_from(self, past: State, limits: Limits = UNLIMITED, *, room: int = 0) -> CompiledLaw:
        """The inverse after the inputs `past`, with room for more extremes; see `hysim.kernels.inverses`."""
        slowest, fastest = self.slope_bounds()
        if not slowest * fastest > 0.0:
            raise ValueError(
                f"the law has no inverse: its slope must have one sign, but it goes from {slowest:g} to {fastest:g}"
            )
        sign = math.copysign(1.0, fastest)
        rising = replace(self, weights=tuple(sign * np.array(self.weights)), offset=sign * self.offset)
        parameters, x, y, d = rising._staircase(past, 1 + room)
        x[d + 1 :] = y[d + 1 :] = 0.0
        u = past[-1] if past else float(x[d])
        return CompiledLaw(
            kernels.inverse_step,
            read_only(np.concatenate([limits, [sign], parameters]), finite=False),
            np.concatenate([[u, sign * y[d], u, d], x, y]),
        )
