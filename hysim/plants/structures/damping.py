"""Viscous damping of a structure by two numbers, or by the ratio of each mode."""

from typing import Any, Self

import numpy as np

from hysim._frozen import FloatArray, check_not_negative, check_positive, read_only
from hysim.models.model import family


@family
class Rayleigh:
    """Damping ``C = mass M + stiffness K``, with the stiffness K of small motions at the start.

    Parameters
    ----------
    mass : float
        Factor of the mass matrix [1/s].
    stiffness : float
        Factor of the stiffness matrix [s].

    Examples
    --------
    >>> import hysim as hs
    >>> damping = hs.Rayleigh.at(0.05, periods=(1.0, 0.2))
    >>> round(damping.mass, 6), round(damping.stiffness, 6)
    (0.523599, 0.002653)
    """

    mass: float = 0.0
    stiffness: float = 0.0

    @classmethod
    def at(cls, ratio: float, periods: tuple[float, float]) -> Self:
        """Damping with a given ratio of modes at two periods.

        Parameters
        ----------
        ratio : float
            Share of the critical damping at both periods.
        periods : (float, float)
            [s]

        Returns
        -------
        Rayleigh

        Raises
        ------
        ValueError
            If the ratio is negative, or the periods are not two positive and different ones.
        """
        check_not_negative(ratio=ratio)
        if len(periods) != 2 or periods[0] == periods[1]:
            raise ValueError(f"periods must be two different ones, got {periods}")
        check_positive(**{"the first period": periods[0], "the second period": periods[1]})
        first, second = (2.0 * np.pi / period for period in periods)
        factor = 2.0 * ratio / (first + second)
        return cls(mass=float(factor * first * second), stiffness=float(factor))

    def matrix(self, mass: FloatArray, stiffness: FloatArray) -> FloatArray:
        """The damping matrix, shape (n_nodes, n_nodes)."""
        return self.mass * mass + self.stiffness * stiffness


@family
class ModalDamping:
    """Damping by the ratio of each mode of small motions at the start.

    Parameters
    ----------
    ratio : float, or tuple of float
        Share of the critical damping: one for all modes, or one for each, that of the longest period first.

    Examples
    --------
    >>> import hysim as hs
    >>> frame = hs.Structure(mass=2.0, stiffness=8.0, damping=hs.ModalDamping(ratio=0.05))
    >>> frame.damping_matrix.round(12).tolist()
    [[0.4]]
    """

    ratio: Any = 0.0

    def __post_init__(self) -> None:
        ratios = read_only(self.ratio, "ratio")
        if ratios.ndim > 1:
            raise ValueError(f"ratio must be a number or have one axis, got shape {ratios.shape}")
        if (ratios < 0.0).any():
            raise ValueError(f"ratio must not be negative, got {ratios.min():g}")
        object.__setattr__(self, "ratio", tuple(ratios.tolist()) if ratios.ndim else float(ratios))

    def matrix(self, mass: FloatArray, stiffness: FloatArray) -> FloatArray:
        """The damping matrix, shape (n_nodes, n_nodes), or many of them for stacks of matrices.

        Raises ValueError if the number of ratios is not that of the modes, or the stiffness is negative.
        """
        if np.ndim(self.ratio) and len(self.ratio) != mass.shape[-1]:
            raise ValueError(f"ratio must hold one number for each of {mass.shape[-1]} modes, got {len(self.ratio)}")
        return modal_damping(np.asarray(self.ratio), mass, stiffness)


def modal_damping(ratios: FloatArray, mass: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Damping matrices (..., n, n) with the ratios (..., n) of their modes, or one ratio for all."""
    root = np.linalg.cholesky(mass)
    half = np.linalg.solve(root, stiffness)
    squares, shapes = np.linalg.eigh(np.linalg.solve(root, np.swapaxes(half, -1, -2)))
    if (squares[..., 0] < -1e-9 * np.abs(squares[..., -1])).any():
        raise ValueError("the stiffness at the start is negative: modal damping needs modes that swing")
    scaled = root @ shapes
    weights = 2.0 * ratios * np.sqrt(np.maximum(squares, 0.0))
    return np.asarray((scaled * weights[..., np.newaxis, :]) @ np.swapaxes(scaled, -1, -2))
