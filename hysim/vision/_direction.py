"""From shifts in pixels to a displacement along one direction.

Directions are angles in the picture: 0 to the right, 90 down it. A straight edge shows its motion in one direction
only, across itself; what moves along another one, d, is seen there through the cosine between the two.
"""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.vision._locate import Location
from hysim.vision._result import Displacement

_AXES = {"x": 0.0, "y": 90.0}
_BESIDE_VERTICAL = 10.0  # within it, a direction that is found is positive down the picture [degree]
_LEAST_COSINE = 0.1
_SHARP = 0.8  # curvature of the correlation's peak, of the median one


def along(
    located: Sequence[Location],
    visible: FloatArray,
    angle: float | None,
    scale: float,
    unit: str,
    *,
    whole: bool,
) -> Displacement:
    """The displacements of located frames; `visible` projects on the directions in which there is structure."""
    shift = np.array([place.shift[::-1] for place in located])
    covariance = np.array([place.covariance[::-1, ::-1] for place in located])
    visible = visible[::-1, ::-1]
    if angle is None:
        angle = _best_direction(shift, covariance, visible)
        angle = 90.0 * round(angle / 90.0) if whole else angle
    unit_vector = _unit(angle)
    across = _unit(angle + 90.0)
    towards = _towards(unit_vector, visible)
    displacement, variance = shift @ towards, np.einsum("i,nij,j->n", towards, covariance, towards)
    beside = shift @ across if np.trace(visible) > 1.5 else np.full(len(shift), np.nan)
    if whole:
        shift, displacement, beside = np.rint(shift) + 0.0, np.rint(displacement) + 0.0, np.rint(beside) + 0.0
        variance = variance + 1.0 / 12.0
    return Displacement(
        y=scale * displacement,
        uncertainty=scale * np.sqrt(variance),
        shift=shift,
        across=scale * beside,
        quality=np.array([place.quality for place in located]),
        status=_statuses(located, towards / np.linalg.norm(towards)),
        scale=scale,
        direction=angle,
        resolution=scale if whole else None,
        units={"y": unit},
    )


def angle_of(direction: float | str | None, *, whole: bool) -> float | None:
    """The angle of a direction; None if it must be estimated."""
    if direction is None:
        return None
    if isinstance(direction, str) and direction in _AXES:
        return _AXES[direction]
    if isinstance(direction, (str, bool)) or not math.isfinite(direction):
        raise ValueError(f'direction must be "x", "y", an angle in degrees or None, got {direction!r}')
    if whole and direction % 90.0:
        raise ValueError(f"whole pixels are counted along rows or columns: direction must be x or y, got {direction}")
    return float(direction)


def _best_direction(shift: FloatArray, covariance: FloatArray, visible: FloatArray) -> float:
    """Direction in which the shifts spread more than their noise does; to the right where there is none."""
    if np.trace(visible) < 1.5:
        vector = np.linalg.eigh(visible)[1][:, 1]
    else:
        is_located = np.isfinite(shift[:, 0])
        if not is_located.any():
            return 0.0
        off, noise = shift[is_located] - shift[is_located].mean(axis=0), covariance[is_located].mean(axis=0)
        values, vectors = np.linalg.eigh(off.T @ off / is_located.sum() - noise)
        if values[1] <= np.trace(noise):
            return 0.0
        vector = vectors[:, 1]
    angle = math.degrees(math.atan2(vector[1], vector[0]))
    return (angle + 90.0 - _BESIDE_VERTICAL) % 180.0 - 90.0 + _BESIDE_VERTICAL


def _unit(angle: float) -> npt.NDArray[np.float64]:
    """Unit vector of an angle, without rounding where it is along an axis."""
    turned = angle % 360.0
    axes = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), 180.0: (-1.0, 0.0), 270.0: (0.0, -1.0)}
    return np.array(axes.get(turned, (math.cos(math.radians(angle)), math.sin(math.radians(angle)))))


def _towards(direction: FloatArray, visible: FloatArray) -> FloatArray:
    """The vector whose product with a shift is the displacement along the direction."""
    if np.trace(visible) > 1.5:
        return direction
    shown = visible @ direction
    cosine = float(np.linalg.norm(shown))
    if cosine < _LEAST_COSINE:
        normal = np.linalg.eigh(visible)[1][:, 1]
        raise ValueError(
            f"the picture is a straight edge, which shows no motion along {direction[0]:.2g}, {direction[1]:.2g} "
            f"(right, down), only along {normal[0]:.2g}, {normal[1]:.2g}"
        )
    return shown / cosine**2


def _statuses(located: Sequence[Location], direction: FloatArray) -> tuple[str, ...]:
    """Blurred is a frame whose correlation has a flatter peak along the motion than the median one's."""
    sharpness = np.array([direction @ place.sharpness[::-1, ::-1] @ direction for place in located])
    is_located = np.isfinite(sharpness)
    least = _SHARP * np.median(sharpness[is_located]) if is_located.any() else 0.0
    return tuple("ok" if value >= least else "blurred" if value < least else "lost" for value in sharpness)
