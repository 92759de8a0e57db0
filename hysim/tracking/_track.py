"""The verb `track_parameters`."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, check_choice
from hysim._results import model_of
from hysim.models.law import Law
from hysim.records import Record
from hysim.tracking._coordinates import Coordinates, Copies, coordinates_of
from hysim.tracking._drift import most_likely
from hysim.tracking._filters import Filtered, Walk, particles, sigma_points
from hysim.tracking._result import _BAND, ParameterTrack

_DRIFT, _JUMP = 0.1, 0.2  # of the value, or of one where that is zero
_MOST_MEMORIES = 40  # of a filter by sigma points
_NORMAL = 1.4826  # standard deviations of the median of the sizes


def track_parameters(
    law: Any,
    record: Record,
    free: Sequence[str],
    *,
    drift: Mapping[str, float] | None = None,
    jump: Mapping[str, float] | None = None,
    noise: float | None = None,
    method: Literal["sigma-point", "particle"] = "sigma-point",
    particles_count: int = 500,
    seed: int = 0,
) -> ParameterTrack:
    """Follow numbers of a law that drift along a record.

    The numbers walk at random, and the law's memory follows from them by its exact step. A number that the law refuses
    where it is negative is tracked by its logarithm.

    Parameters
    ----------
    law : Law or result of a fit
        A law with the numbers at the first sample, for instance the model of a fit to earlier data.
    record : Record
        Input and measured output.
    free : sequence of str
        Names of the numbers that drift, as in ``law.scalars``.
    drift : mapping, optional
        Names to the change that is expected over the whole record, as the standard deviation of a random walk [unit of
        each]. By default the size for which the errors of predictions one sample ahead are most likely, which takes
        some twenty passes of the filter for each name; the number at the first sample is then known to a tenth.
    jump : mapping, optional
        Names to the size of a sudden change; by default a fifth of the value. Zero for none.
    noise : float, optional
        Standard deviation of the measurement; by default from the third differences of the output [unit of y].
    method : {"sigma-point", "particle"}
        Sigma points are quick, and made for a memory of a few numbers that change evenly. Particles take any law.
    particles_count, seed : int
        Number of the particles, and of their draws.

    Returns
    -------
    ParameterTrack

    Raises
    ------
    TypeError
        If the law is none, or depends on the rate of its input.
    ValueError
        If a name is unknown, the noise is not positive, the method is unknown, or every copy of the law diverges.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> u = hs.signals.triangle(-1.0, 1.0, cycles=10, samples_per_cycle=40)
    >>> law = hs.BoucWen(n=1.0, feedthrough=0.5)
    >>> fades = np.linspace(1.0, 0.8, u.size)
    >>> y = 0.5 * u + fades * law.memory(u) + 0.005 * np.random.default_rng(0).standard_normal(u.size)
    >>> track = hs.track_parameters(law, hs.Record(u=u, y=y), ["gain"], drift={"gain": 0.2}, noise=0.005)
    >>> bool(abs(track["gain"][-1] - 0.8) < 0.02)
    True
    """
    law = model_of(law)
    if not isinstance(law, Law):
        raise TypeError(f"law must be a law that a step describes, such as BoucWen, got {type(law).__name__}")
    coordinates, spread = coordinates_of(law, free), _noise_of(record) if noise is None else float(noise)
    if not spread > 0.0:
        raise ValueError("noise must be positive: give the standard deviation of the measurement")
    check_choice("method", method, ("sigma-point", "particle"))
    copies, x = Copies(law, coordinates), coordinates.encode(coordinates.values)
    if method == "sigma-point" and copies.memory.size > _MOST_MEMORIES:
        raise ValueError(f'this law remembers {copies.memory.size} numbers: use method="particle"')
    drifts, jumps = (
        _sizes(coordinates, given, share, what)
        for given, share, what in ((drift, _DRIFT, "drift"), (jump, _JUMP, "jump"))
    )
    first = coordinates.spread(drifts)

    def filtered(sizes: FloatArray, by: str) -> Filtered:
        walk = Walk(first, coordinates.spread(sizes) / np.sqrt(len(record)), coordinates.spread(jumps))
        if by == "particle":
            return particles(copies, x, walk, spread, record.u, record.y, particles_count, seed)
        return sigma_points(copies, x, walk, spread, record.u, record.y)

    searched = np.array([name not in (drift or {}) for name in coordinates.names])
    by = "particle" if copies.memory.size > _MOST_MEMORIES else "sigma-point"
    drifts = most_likely(lambda sizes: filtered(sizes, by).log_likelihood, drifts, searched)
    found = filtered(drifts, method)
    return _result(law, coordinates, found, record, method, spread, drifts, searched)


def _result(
    law: Law,
    coordinates: Coordinates,
    found: Filtered,
    record: Record,
    method: str,
    noise: float,
    drifts: FloatArray,
    searched: npt.NDArray[np.bool_],
) -> ParameterTrack:
    values = coordinates.decode(found.mean)
    last: dict[str, float] = dict(zip(coordinates.names, values[-1].tolist(), strict=True))
    return ParameterTrack(
        names=coordinates.names,
        values=values,
        lower=coordinates.decode(found.mean - _BAND * found.deviation),
        upper=coordinates.decode(found.mean + _BAND * found.deviation),
        predicted=found.predicted,
        residual=record.y - found.predicted,
        expected_error=found.expected_error,
        jumps=found.jumps,
        method=method,
        noise=noise,
        drift=dict(zip(coordinates.names, drifts.tolist(), strict=True)),
        searched=tuple(np.array(coordinates.names)[searched].tolist()),
        log_likelihood=found.log_likelihood,
        model=law.with_scalars(last),
    )


def _sizes(coordinates: Coordinates, given: Mapping[str, Any] | None, share: float, what: str) -> FloatArray:
    """Sizes of changes (n_names,), those that are not given in parts of the values."""
    given = {} if given is None else given
    if unknown := [name for name in given if name not in coordinates.names]:
        raise ValueError(f"{what} has {unknown[0]!r}, which is not free")
    usual = share * np.where(coordinates.values == 0.0, 1.0, np.abs(coordinates.values))
    sizes = np.array([float(given.get(name, own)) for name, own in zip(coordinates.names, usual, strict=True)])
    if not (sizes >= 0.0).all():
        raise ValueError(f"{what} must not be negative, got {dict(given)}")
    return sizes


def _noise_of(record: Record) -> float:
    """Standard deviation of white noise by the third differences of the output, which a smooth output does not have."""
    third = np.diff(record.y, 3)
    return float(_NORMAL * np.median(np.abs(third)) / np.sqrt(20.0)) if third.size else 0.0
