"""Frames whose floors move sideways."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import read_only
from hysim.plants.structures.element import Element
from hysim.plants.structures.structure import Structure


def shear_frame(
    masses: npt.ArrayLike,
    stiffnesses: npt.ArrayLike | None = None,
    laws: Any = None,
    **options: Any,
) -> Structure:
    """A frame whose rigid floors move sideways, one storey on the other.

    Parameters
    ----------
    masses : array, shape (n,)
        Of the floors, the lowest first [kg].
    stiffnesses : array, shape (n,), optional
        Of linear columns of each storey [N/m].
    laws : law, or sequence of n laws or None, optional
        Force of each storey's columns for its drift, beside the linear ones; one law for all storeys alike.
    **options
        Other arguments of `Structure`, such as ``damping``.

    Returns
    -------
    Structure
        Element k is the storey k between nodes k and k + 1; a storey without law has none.

    Raises
    ------
    ValueError
        If lengths differ, or there are neither stiffnesses nor laws.

    Examples
    --------
    >>> import hysim as hs
    >>> frame = hs.shear_frame([2.0, 2.0], [800.0, 400.0], damping=hs.ModalDamping(ratio=0.05))
    >>> frame.stiffness_matrix.tolist()
    [[1200.0, -400.0], [-400.0, 400.0]]
    """
    floors = read_only(masses, "masses", ndim=1)
    n = floors.size
    if stiffnesses is None and laws is None:
        raise ValueError("a frame needs stiffnesses, laws, or both")
    springs = np.zeros(n) if stiffnesses is None else read_only(stiffnesses, "stiffnesses", ndim=1)
    if springs.size != n:
        raise ValueError(f"stiffnesses must hold one number for each of {n} storeys, got {springs.size}")
    several: Sequence[Any] = laws if isinstance(laws, (list, tuple)) else [laws] * n
    if len(several) != n:
        raise ValueError(f"laws must hold one for each of {n} storeys, got {len(several)}")
    rows = np.eye(n) - np.eye(n, k=-1)
    return Structure(
        mass=floors,
        stiffness=rows.T @ (springs[:, np.newaxis] * rows),
        elements=tuple(Element(law, between=(k, k + 1)) for k, law in enumerate(several) if law is not None),
        **options,
    )
