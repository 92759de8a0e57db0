"""The verb `track_parameters`.

A drift's size is the one that makes the errors of one-sample predictions most likely. Too large a walk follows the
noise, too small a one comes late: both make these errors larger or smaller than the filter expects. Their
log-likelihood (the prediction-error decomposition; A. C. Harvey, Forecasting, Structural Time Series Models and the
Kalman Filter, 1989, section 3.4) is maximised over the logarithms of the sizes, one at a time.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_choice
from hysim._basics.printing import frozen_result, summary_text
from hysim._basics.results import model_of
from hysim.models.law import Law
from hysim.records import Record
from hysim.tracking._filters import Coordinates, Copies, Filtered, Walk, coordinates_of, particles, sigma_points

_BAND = 1.959963984540054  # standard deviations of a band at 95 %


@frozen_result
class ParameterTrack:
    """Numbers of a law along a record, as far as the samples up to each one tell them.

    Attributes
    ----------
    names : tuple of str
        The numbers that are free to drift.
    values, lower, upper : array, shape (n_samples, n_names)
        Estimates and their bands at 95 % [unit of each number].
    predicted, residual, expected_error : array, shape (n_samples,)
        Output predicted one sample ahead, measured minus predicted, and its expected standard deviation [unit of y].
    jumps : tuple of int
        Samples at which the errors had become too large for a drift; none for particles, of which some always jump.
    method : str
        ``"sigma-point"`` or ``"particle"``.
    noise : float
        Standard deviation of the measurement [unit of y].
    drift : mapping
        Names to the standard deviation of the walk over the whole record [unit of each].
    searched : tuple of str
        Names whose drift was not given: it is the most likely one.
    log_likelihood : float
        Logarithm of the likelihood of the errors.
    model : law
        The law with the last estimates.
    """

    names: tuple[str, ...]
    values: FloatArray
    lower: FloatArray
    upper: FloatArray
    predicted: FloatArray
    residual: FloatArray
    expected_error: FloatArray
    jumps: tuple[int, ...]
    method: str
    noise: float
    drift: Mapping[str, float]
    searched: tuple[str, ...]
    log_likelihood: float
    model: Any

    def __getitem__(self, name: str) -> FloatArray:
        """The path of one number, shape (n_samples,); KeyError if it is not free."""
        return self.values[:, self._place(name)]

    def band(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end of the band of a number, (n_samples,) each; KeyError if it is not free."""
        place = self._place(name)
        return self.lower[:, place], self.upper[:, place]

    @property
    def consistency(self) -> float:
        """Mean square of the errors over the expected ones: near one if noise and drift are what was said."""
        return float(np.mean((self.residual / self.expected_error) ** 2))

    def _place(self, name: str) -> int:
        if name not in self.names:
            raise KeyError(f"{name!r} is not tracked: {', '.join(self.names)}")
        return self.names.index(name)

    def summary(self) -> str:
        """The printed result as a text."""
        return str(self)

    def __str__(self) -> str:
        rms = float(np.sqrt(np.mean(self.residual**2)))
        head = f"ParameterTrack by {self.method}s: {len(self.values)} samples, one-step error rms {rms:.4g}"
        rows = {
            name: f"{self.values[0, k]:.4g} to {self.values[-1, k]:.4g}, at the end within "
            f"[{self.lower[-1, k]:.4g}, {self.upper[-1, k]:.4g}] at 95 %"
            for k, name in enumerate(self.names[:6])
        }
        sizes = ", ".join(
            f"{name} {size:.3g}{' (most likely)' if name in self.searched else ''}"
            for name, size in list(self.drift.items())[:6]
        )
        notes = {
            "drift over the record": sizes,
            "consistency": f"{self.consistency:.3g} (near 1 if noise and drift are what was said)",
            "jumps": f"at samples {', '.join(map(str, self.jumps[:8]))}" if self.jumps else "",
        }
        return summary_text([head], rows | notes)


_STEPS = (1.0, 0.5, 0.25)  # decades
_LEAST, _MOST = -4.0, 1.0  # decades beside the first sizes


def most_likely(
    log_likelihood: Callable[[FloatArray], float], sizes: FloatArray, searched: npt.NDArray[np.bool_]
) -> FloatArray:
    """The most likely sizes (n_names,); only some are searched."""
    if not searched.any():
        return sizes
    exponents, best = np.zeros(sizes.size), log_likelihood(sizes)
    for step in _STEPS:
        improved = True
        while improved:
            improved = False
            for k in np.flatnonzero(searched):
                for direction in (-step, step):
                    trial = exponents.copy()
                    trial[k] = min(max(trial[k] + direction, _LEAST), _MOST)
                    value = best if trial[k] == exponents[k] else log_likelihood(sizes * 10.0**trial)
                    if value > best:
                        exponents, best, improved = trial, value, True
    return np.asarray(sizes * 10.0**exponents)


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
    TypeError, ValueError
        If the law is none, or depends on the rate of its input; if a name or the method is unknown, the noise is not
        positive, or every copy of the law diverges.

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
    drifts = _sizes(coordinates, drift or {}, _DRIFT, "drift")
    jumps = _sizes(coordinates, jump or {}, _JUMP, "jump")
    first = coordinates.spread(drifts)

    def filtered(sizes: FloatArray, by: str) -> Filtered:
        walk = Walk(first, coordinates.spread(sizes) / np.sqrt(len(record)), coordinates.spread(jumps))
        if by == "particle":
            return particles(copies, x, walk, spread, record.u, record.y, particles_count, seed)
        return sigma_points(copies, x, walk, spread, record.u, record.y)

    searched = np.array([name not in (drift or {}) for name in coordinates.names])
    by = "particle" if copies.memory.size > _MOST_MEMORIES else "sigma-point"
    drifts = most_likely(lambda sizes: filtered(sizes, by).log_likelihood, drifts, searched)
    estimates = filtered(drifts, method)
    values = coordinates.decode(estimates.mean)
    last: dict[str, float] = dict(zip(coordinates.names, values[-1].tolist(), strict=True))
    return ParameterTrack(
        names=coordinates.names,
        values=values,
        lower=coordinates.decode(estimates.mean - _BAND * estimates.deviation),
        upper=coordinates.decode(estimates.mean + _BAND * estimates.deviation),
        predicted=estimates.predicted,
        residual=record.y - estimates.predicted,
        expected_error=estimates.expected_error,
        jumps=estimates.jumps,
        method=method,
        noise=spread,
        drift=dict(zip(coordinates.names, drifts.tolist(), strict=True)),
        searched=tuple(np.array(coordinates.names)[searched].tolist()),
        log_likelihood=estimates.log_likelihood,
        model=law.with_scalars(last),
    )


def _sizes(coordinates: Coordinates, user: Mapping[str, Any], share: float, what: str) -> FloatArray:
    """Sizes of changes (n_names,), those that are not given in parts of the values."""
    if unknown := [name for name in user if name not in coordinates.names]:
        raise ValueError(f"{what} has {unknown[0]!r}, which is not free")
    usual = share * np.where(coordinates.values == 0.0, 1.0, np.abs(coordinates.values))
    sizes = np.array([float(user.get(name, own)) for name, own in zip(coordinates.names, usual, strict=True)])
    if not (sizes >= 0.0).all():
        raise ValueError(f"{what} must not be negative, got {dict(user)}")
    return sizes


def _noise_of(record: Record) -> float:
    """Standard deviation of white noise by the third differences of the output, which a smooth output does not have."""
    third = np.diff(record.y, 3)
    return float(_NORMAL * np.median(np.abs(third)) / np.sqrt(20.0)) if third.size else 0.0
