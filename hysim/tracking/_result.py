"""The result of `track_parameters`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hysim._frozen import FloatArray, frozen
from hysim._printing import printed, summary_text

_BAND = 1.959963984540054  # standard deviations of a band at 95 %


@printed
@frozen
class ParameterTrack:
    """Numbers of a law along a record, as far as the samples up to each one tell them.

    Attributes
    ----------
    names : tuple of str
        The numbers that are free to drift.
    values, lower, upper : array, shape (n_samples, n_names)
        Estimates and their bands at 95 % [unit of each number].
    predicted, residual, expected_error : array, shape (n_samples,)
        Output predicted one sample ahead, measured minus predicted, and the standard deviation that the filter
        expected of it [unit of y].
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
        notes = {"drift over the record": sizes}
        notes |= {"consistency": f"{self.consistency:.3g} (near 1 if noise and drift are what was said)"}
        if self.jumps:
            notes["jumps"] = f"at samples {', '.join(map(str, self.jumps[:8]))}"
        return summary_text([head], rows | notes)
