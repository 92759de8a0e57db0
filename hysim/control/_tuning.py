"""Result of `tune`: the controller, its margins, and the trade-off from which it was chosen."""

import math
from collections.abc import Iterable
from typing import Any

from hysim._frozen import frozen
from hysim._printing import printed, summary_text
from hysim.models.model import in_brief


@frozen
class Trial:
    """A controller that `tune` tried, and its figures.

    Parameters
    ----------
    controller : PID or TrackingController
        With the limits.
    max_sensitivity, voltage_noise : float
        Largest ``|1 / (1 + L)|`` of all plants, at either slope of the law, and largest rms of the voltage noise in the
        linear loops [unit of u]; infinite if a loop is unstable.
    objective : float
        Objective of the simulated loop, in units of the reference's span; infinite if a loop is unstable.
    """

    controller: Any
    max_sensitivity: float
    voltage_noise: float
    objective: float


@printed
@frozen
class Tuning:
    """Result of `tune`.

    Parameters
    ----------
    controller, objective, max_sensitivity
        As in the best `Trial`.
    gain_margin, phase_margin : float
        Factor and angle [degrees] by which the loop may change before it is unstable: the smallest of all plants.
    voltage_noise : float
        As in the best `Trial`. The noise also moves the memory of a law, which `close_loop` has in its conditions.
    trade_off : tuple of Trial
        Trials within the bound on the noise that no other beats in both objective and sensitivity, most robust first.
    trials : tuple of Trial
        Every controller that was simulated.
    success : bool
        Whether a controller within the bounds was found.
    message : str
        Extent of the search, distance to the bounds, and number of samples with limited voltage.
    """

    controller: Any
    objective: float
    max_sensitivity: float
    gain_margin: float
    phase_margin: float
    voltage_noise: float
    trade_off: tuple[Trial, ...]
    trials: tuple[Trial, ...]
    success: bool
    message: str

    def __str__(self) -> str:
        bounds = "within" if self.success else "NOT within"
        return summary_text(
            [
                f"Tuning: {type(self.controller).__name__} {bounds} its bounds, objective {self.objective:.4g} of the "
                "reference's span"
            ],
            {
                "controller": in_brief(self.controller),
                "sensitivity": f"at most {self.max_sensitivity:.4g}",
                "margins": f"gain {self.gain_margin:.4g}, phase {self.phase_margin:.4g} degrees",
                "noise": f"{self.voltage_noise:.4g} rms of voltage" if self.voltage_noise else "",
                "search": self.message,
            },
        )


def front(trials: Iterable[Trial]) -> tuple[Trial, ...]:
    best: list[Trial] = []
    for trial in sorted(trials, key=lambda trial: (trial.max_sensitivity, trial.objective)):
        if trial.objective < (best[-1].objective if best else math.inf):
            best.append(trial)
    return tuple(best)
