"""The result of `design_input`."""

from collections.abc import Mapping

import numpy as np

from hysim._frozen import FloatArray, frozen
from hysim._printing import printed, summary_text
from hysim.design._limits import InputLimits


@printed
@frozen
class InputDesign:
    """An input, and what it is expected to tell of a law.

    Attributes
    ----------
    t, u : array, shape (n_samples,)
        Times [s] and input [unit of u], which begins at zero.
    levels, holds : array, shape (n_levels,)
        Turning points of the input [unit of u] and how long it is held there [s]; the last ones may lie beyond the end.
        Empty if a usual input was the best one.
    expected_stderr : mapping
        Names of the numbers to their standard errors, those of an efficient estimate [unit of each].
    covariance : array, shape (n_names, n_names)
        Their covariance, in the same order.
    efficiency : mapping
        Names of the usual inputs to what they tell, in parts of what this one does: the ratio of the criterion, which
        is proportional to the number of samples.
    beside : mapping
        Names of the usual inputs, and of those of your own, to the inputs, shape (n_samples,) each; for an actuator the
        usual ones are the best of a few speeds.
    beside_stderr : mapping
        Their names to the standard errors that are expected of them, by name.
    criterion : str
        ``"D"``, ``"A"`` or ``"E"``.
    noise : float
        Standard deviation of the output for which all this holds [unit of y].
    limits : InputLimits
        The limits that it keeps.
    remarks : tuple of str
        What no input within the limits determines, and was taken as known, and what this one determines badly.
    """

    t: FloatArray
    u: FloatArray
    levels: FloatArray
    holds: FloatArray
    expected_stderr: Mapping[str, float]
    covariance: FloatArray
    efficiency: Mapping[str, float]
    beside: Mapping[str, FloatArray]
    beside_stderr: Mapping[str, Mapping[str, float]]
    criterion: str
    noise: float
    limits: InputLimits
    remarks: tuple[str, ...] = ()

    @property
    def correlation(self) -> FloatArray:
        """Correlations of the estimates, (n_names, n_names), in the order of `expected_stderr`."""
        size = np.sqrt(self.covariance.diagonal())
        return np.asarray(self.covariance / np.outer(size, size))

    def summary(self) -> str:
        """The printed result as a text."""
        return str(self)

    def __str__(self) -> str:
        head = f"InputDesign: {self.u.size} samples to {self.t[-1]:.4g} s, {self.levels.size} turning points"
        beside = ", ".join(f"{name} {100.0 * value:.0f} %" for name, value in self.efficiency.items())
        rows = self._by_part() | {f"{self.criterion}-efficiency of": beside}
        rows["but"] = "; ".join(self.remarks)
        return summary_text([head, f"  expected standard errors for noise of {self.noise:.3g}:"], rows)

    def _by_part(self) -> dict[str, str]:
        """Expected standard errors of a law, or of each part of an actuator."""
        parts: dict[str, list[str]] = {}
        for name, value in self.expected_stderr.items():
            part, _, short = name.rpartition(".")
            parts.setdefault(part or "law", []).append(f"{short} {value:.3g}")
        return {part: ", ".join(each[:12]) for part, each in parts.items()}
