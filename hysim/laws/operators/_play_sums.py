"""The parts that the extended Prandtl-Ishlinskii laws share: numbers as `hysim.kernels.play_sums` takes them."""

import math
from abc import abstractmethod
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels import play_sums as kernels
from hysim.laws.operators._clamps import Bank
from hysim.laws.operators.prandtl_ishlinskii import PrandtlIshlinskii
from hysim.models.by_structure import ByStructure
from hysim.models.law import State
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.models.tables import Tables

_WIDTH = 3  # place of the width behind the limits and the offset
IDENTITY = (0.0, 0.0, 0.0, 0.0, 1.0)
"""The envelope gamma(u) = u."""


class ExtendedPlays(ByStructure, Bank):
    """A sum of plays behind envelopes, with wider thresholds or in front of dead zones."""

    step = staticmethod(kernels.step)
    ordered: ClassVar[bool] = True

    thresholds: tuple[float, ...]
    weights: tuple[float, ...]

    @property
    def plays(self) -> PrandtlIshlinskii:
        """The sum of plays without the extension and the offset."""
        return PrandtlIshlinskii(thresholds=self.thresholds, weights=self.weights, z0=self.z0)

    @abstractmethod
    def refusal(self) -> str | None:
        """Why the law has no inverse; None where it has one."""

    def is_invertible(self) -> bool:
        """Whether the law has an inverse for every output that it reaches."""
        return self.refusal() is None

    def check_invertible(self) -> None:
        """Raise a ValueError if the law is not invertible, or z0 holds positions that no input leads to."""
        if (refusal := self.refusal()) is not None:
            raise ValueError(refusal)
        if self.plays.refusal() is None:
            self.plays.inverse()  # refuses these positions

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | None) -> CompiledLaw:
        """In closed form, from the first sample or from rest."""
        self.check_invertible()
        first = self._first_input(float(y[0])) if u0 is None and state is None else u0
        return self.inverse_from(self.advance([first or 0.0])[1] if state is None else state)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        self.check_invertible()
        return self.inverse_from(self.advance([u0])[1], limits)

    def unreached(self, sample: int, y: float, inverse: CompiledLaw) -> str:
        """Message for an output that no input gives."""
        return f"no input gives the output at sample {sample} (y = {y:g})"

    def _first_input(self, y: float) -> float:
        """The first input that finds the plays at z0 and gives `y`, whatever its speed would be."""
        inverse = self.inverse_from((0.0, *self.z0))
        still = inverse.parameters.copy()
        still[_WIDTH] = 0.0
        u = inverse.step(read_only(still, finite=False), inverse.state, y)
        return u if math.isfinite(u) else 0.0

    def inverse_from(self, state: State, limits: Limits = UNLIMITED) -> CompiledLaw:
        """The inverse of the law in this state, as `hysim.kernels.inverses` has it."""
        law, _ = self._begun(state[0], state)
        y = kernels.step(law.parameters, law.state.copy(), state[0])
        parameters = read_only(np.concatenate([limits, law.parameters]), finite=False)
        return CompiledLaw(kernels.inverse_step, parameters, np.concatenate([[state[0], y], law.state]))


def kernel_rows(
    tables: Tables,
    *,
    width: npt.ArrayLike = 0.0,
    left: FloatArray | None = None,
    right: FloatArray | None = None,
    behind: tuple[FloatArray, ...] = (),
) -> FloatArray:
    """Rows as the kernels take them: offset, width, envelopes, thresholds, weights, and the dead zones behind."""
    n_sets = len(tables["offset"])
    same = np.tile(IDENTITY, (n_sets, 1))
    widths = np.broadcast_to(np.reshape(width, (-1, 1)), (n_sets, 1))
    envelopes = same if left is None else left, same if right is None else right
    return np.concatenate(
        [tables["offset"], widths, *envelopes, tables["thresholds"], tables["weights"], *behind], axis=1
    )


def positions_of(
    thresholds: FloatArray,
    z0: FloatArray,
    u: FloatArray,
    *,
    width: npt.ArrayLike = 0.0,
    left: FloatArray | None = None,
    right: FloatArray | None = None,
) -> FloatArray:
    """Positions (n_sets, n_samples, n_plays) of plays (n_sets, n_plays), pushed as `kernel_rows` says."""
    from hysim.kernels.memories import drive_memory  # compiled where it is needed

    tables = {"offset": np.zeros((len(z0), 1)), "thresholds": thresholds, "weights": np.zeros_like(z0)}
    rows = kernel_rows(tables, width=width, left=left, right=right)
    z = np.empty((len(z0), u.size, z0.shape[1]))
    for row, start, positions in zip(rows, z0, z, strict=True):
        drive_memory(kernels.step, read_only(row), np.append(u[:1], start), u, positions)
    return z


def dead_zone(x: FloatArray, d: float | FloatArray) -> FloatArray:
    """One-sided dead zone of the threshold `d`; the input itself where that is zero."""
    return np.where(np.equal(d, 0.0), x, np.where(np.greater(d, 0.0), np.maximum(x - d, 0.0), np.minimum(x - d, 0.0)))


def check_dead_zones(thresholds: FloatArray, weights: FloatArray) -> None:
    """Refuse tables (n_sets, n_zones) that are no dead zones."""
    if thresholds.shape[1] != weights.shape[1] or not thresholds.shape[1]:
        raise ValueError(
            f"dead_zones and dead_zone_weights must be equally long and not empty, got {thresholds.shape[1]} "
            f"and {weights.shape[1]}"
        )
    if not (np.diff(thresholds) > 0.0).all():
        raise ValueError(f"dead_zones must increase, got {thresholds[0].tolist()}")
