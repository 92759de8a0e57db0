"""Bands of what a model with uncertain parameters does."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, check_count, frozen, read_only
from hysim._printing import printed, quantity, summary_text
from hysim.errors import SimulationError
from hysim.identification import Width
from hysim.identification.likelihood.densities import density
from hysim.metrics.rows import LoopRows
from hysim.models.protocols import needs_time
from hysim.records import even_step


class Draws(Protocol):
    """Draws of the parameters of a model."""

    @property
    def model(self) -> Any:
        """The model of which some numbers are exchanged."""

    @property
    def samples(self) -> Mapping[str, FloatArray]:
        """Name to draws."""

    @property
    def states(self) -> Mapping[str, FloatArray]:
        """Name to draws of a state that follows."""

    @property
    def noise(self) -> str:
        """Name of the noise."""

    @property
    def resolution(self) -> float | None:
        """Quantum of the sensor."""


@printed
@frozen
class Prediction:
    """Outputs of draws of the parameters for one input.

    Parameters
    ----------
    u : array, shape (n_samples,) [unit of u]
        Input.
    outputs : array, shape (n, n_samples) [unit of y]
        One output for each draw; a draw whose output diverges is left out.
    measured : array, shape (n, n_samples) [unit of y]
        The same with noise, as the sensor would measure it.
    level : float
        Probability of the bands.
    loop_width : Width or None
        Median and band of the largest width of the loop [unit of y]; None without a complete cycle.
    widths : array, shape (n,) or (0,)
        Largest width of each draw [unit of y].
    """

    u: FloatArray
    outputs: FloatArray
    measured: FloatArray
    level: float
    loop_width: Width | None
    widths: FloatArray

    @property
    def y(self) -> FloatArray:
        """Median output at each sample, shape (n_samples,)."""
        return np.asarray(np.median(self.outputs, axis=0))

    @property
    def band(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper side of the band of the output, shape (n_samples,) each."""
        return _band(self.outputs, self.level)

    @property
    def measured_band(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper side of the band of the next measurement, shape (n_samples,) each."""
        return _band(self.measured, self.level)

    def __str__(self) -> str:
        low, high = self.band
        width = self.loop_width
        return summary_text(
            [f"Prediction of {len(self.outputs)} draws at {self.u.size} samples, bands at {100.0 * self.level:g} %"],
            {
                "output": f"band {quantity(float((high - low).mean()))} wide on average",
                "loop width": f"{width.value:.4g}, from {width.lower:.4g} to {width.upper:.4g}" if width else "",
            },
        )


def predicted(
    draws: Draws, u: FloatArray, t: npt.ArrayLike | None, n: int, tails: tuple[float, float], seed: int
) -> Prediction:
    """Outputs, bands and loop widths of `n` draws."""
    check_count("n", n)
    rng = np.random.default_rng(seed)
    total = len(draws.samples["sigma"])
    chosen = rng.choice(total, min(n, total), replace=False)
    outputs, kept = _outputs(draws, u, t, chosen)
    noise = density(draws.noise, draws.resolution)
    widths = _widths(u, outputs)
    return Prediction(
        u=u,
        outputs=outputs,
        measured=noise.draw(outputs, draws.samples["sigma"][kept], rng),
        level=tails[1] - tails[0],
        loop_width=_interval(widths, tails),
        widths=widths,
    )


def _outputs(draws: Draws, u: FloatArray, t: npt.ArrayLike | None, chosen: Any) -> tuple[FloatArray, Any]:
    """Outputs of the chosen draws that stay finite, and which these are."""
    timed = needs_time(draws.model)
    if timed and t is None:
        raise ValueError(f"a {type(draws.model).__name__} depends on time: pass t=")
    further = (even_step(read_only(t, "t", ndim=1)),) if timed and t is not None else ()
    columns = {_own(name, draws.model): values for name, values in draws.samples.items() if name != "sigma"}
    columns |= dict(draws.states)
    rows, kept = [], []
    for k in chosen.tolist():
        law = draws.model.with_scalars({name: float(values[k]) for name, values in columns.items() if name})
        try:
            rows.append(law.response(u, *further))
        except SimulationError:
            continue
        kept.append(k)
    return np.array(rows).reshape(-1, u.size), kept


def _own(name: str, model: Any) -> str:
    """The model's name of a parameter; of a state of one record that of the first one, and none for the others."""
    if name in model.scalars:
        return name
    base, _, record = name.rpartition("[")
    return base if record == "0]" else ""


def _widths(u: FloatArray, outputs: FloatArray) -> FloatArray:
    try:
        return LoopRows(u).max_width(outputs) if len(outputs) else np.empty(0)
    except ValueError:  # no complete cycle
        return np.empty(0)


def _interval(widths: FloatArray, tails: tuple[float, float]) -> Width | None:
    if not widths.size:
        return None
    low, middle, high = np.quantile(widths, [tails[0], 0.5, tails[1]]).tolist()
    return Width(value=middle, lower=low, upper=high)


def _band(rows: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    low, high = np.quantile(rows, [0.5 * (1.0 - level), 0.5 * (1.0 + level)], axis=0)
    return low, high
