"""The parts that the extended Prandtl-Ishlinskii laws share: numbers as `hysim.kernels.play_sums` takes them."""

import math
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_pieces
from hysim.errors import SimulationError
from hysim.kernels import play_sums as kernels
from hysim.kernels.stepping import drive
from hysim.laws.operators._clamps import Bank
from hysim.laws.operators.prandtl_ishlinskii import PrandtlIshlinskii
from hysim.models.by_structure import ByStructure
from hysim.models.law import State, Tables
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits

_WIDTH = 3  # place of the width behind the limits and the offset
IDENTITY = (0.0, 0.0, 0.0, 0.0, 1.0)
"""The envelope gamma(u) = u."""


class ExtendedPlays(ByStructure, Bank):
    """A sum of plays behind envelopes, with wider thresholds or in front of dead zones."""

    step = staticmethod(kernels.step)
    thresholds_name: ClassVar[str] = "thresholds"
    weights_name: ClassVar[str] = "weights"
    stops: ClassVar[bool] = False
    bank: ClassVar[bool] = True
    ordered: ClassVar[bool] = True

    thresholds: tuple[float, ...]
    weights: tuple[float, ...]

    @property
    def plays(self) -> PrandtlIshlinskii:
        """The sum of plays without the extension and the offset."""
        return PrandtlIshlinskii(thresholds=self.thresholds, weights=self.weights, z0=self.z0)

    def input_of(self, y: npt.ArrayLike, u0: float | None, state: State | None) -> FloatArray:
        """Input that gives the output `y`, (n_samples,), of a law without dead zones that is monotone in the input."""
        wanted = read_only(y, "y", ndim=1)
        if state is not None and u0 is not None:
            raise ValueError("give u0 or state, not both: the state has its own input")
        if state is None:
            first = self._first_input(float(wanted[0])) if u0 is None and wanted.size else u0
            state = self.advance([first or 0.0])[1]
        u, inverse = np.empty(wanted.size), self.inverse_from(state)
        lost = in_pieces(lambda k: drive(inverse.step, inverse.parameters, inverse.state, wanted[k], u[k]), u.size)
        if lost >= 0:
            raise SimulationError(f"no input gives the output at sample {lost} (y = {wanted[lost]:g})")
        return u

    def _first_input(self, y: float) -> float:
        """The first input that finds the plays at z0 and gives `y`, whatever its speed would be."""
        inverse = self.inverse_from((0.0, *self.z0))
        still = inverse.parameters.copy()
        still[_WIDTH] = 0.0
        u = inverse.step(read_only(still, finite=False), inverse.state, y)
        return u if math.isfinite(u) else 0.0

    def inverse_from(self, state: State, limits: Limits = UNLIMITED) -> CompiledLaw:
        """The inverse of the law in this state, as `hysim.kernels.inverses` has it."""
        law, _ = self._begun(np.array([state[0]]), state)
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
