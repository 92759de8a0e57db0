"""The measures of a magnetic loop, B over H.

    energy                  integral of H dB around the cycle, positive for a core that dissipates
    coercivity              half the distance of the two fields at B = 0
    remanence               half the distance of the two flux densities at H = 0
    amplitude_permeability  peak_induction / (mu_0 peak_field), half the spans between the loop's ends
    largest_permeability    largest slope dB/dH of either branch / mu_0, between neighbouring samples

and of the initial curve, where the record begins demagnetised at H = B = 0:

    initial_permeability    B / (mu_0 H) at its first sample with a field
    maximum_permeability    largest B / (mu_0 H) of its samples

The branches are those of `hysim.loop_metrics`, linear between their samples. Source: IEC 60050-121 and 60404-4 for the
terms.
"""

import math

import numpy as np
import numpy.typing as npt

from hysim._cycles import TOLERANCE, turns
from hysim._frozen import FloatArray, check_positive, frozen, items
from hysim._printing import printed, summary_text
from hysim.metrics._loop import loop_metrics, samples_of_a_loop

_VACUUM = 1.25663706212e-6
_DEMAGNETISED = 1e-3  # of the spans of H and B


@printed
@frozen
class MagneticMetrics:
    """The measures of one magnetic loop; the equations stand at the head of `hysim.metrics._magnetic`.

    Parameters
    ----------
    energy : float
        Energy per cycle and volume [J/m^3]; negative for a loop that runs clockwise.
    coercivity : float
        [A/m]; nan if a branch does not cross B = 0.
    remanence : float
        [T]; nan if the loop does not cross H = 0.
    peak_field, peak_induction : float
        Half the distance of the loop's ends [A/m], [T].
    amplitude_permeability, largest_permeability : float
        Relative permeability from end to end, and where a branch is steepest [1]. The latter takes all noise of B.
    initial_permeability, maximum_permeability : float
        Relative permeabilities of the initial curve [1]; nan if the record does not begin demagnetised.
    n_cycles : int
        Number of averaged cycles.
    """

    energy: float
    coercivity: float
    remanence: float
    peak_field: float
    peak_induction: float
    amplitude_permeability: float
    largest_permeability: float
    initial_permeability: float
    maximum_permeability: float
    n_cycles: int

    def __str__(self) -> str:
        begins = not math.isnan(self.initial_permeability)
        return summary_text(
            [f"MagneticMetrics: {self.energy:.4g} J/m^3 a cycle at {self.peak_induction:.4g} T"],
            {
                "coercivity": f"{self.coercivity:.4g} A/m",
                "remanence": f"{self.remanence:.4g} T",
                "peak": f"{self.peak_field:.4g} A/m",
                "permeability": f"amplitude {self.amplitude_permeability:.4g}, largest {self.largest_permeability:.4g}",
                "initial curve": f"from {self.initial_permeability:.4g}, at most {self.maximum_permeability:.4g}"
                if begins
                else "",
            },
        )

    def to_dict(self) -> dict[str, float]:
        """The measures by name, as numbers."""
        return items(self)


def magnetic_metrics(
    H: npt.ArrayLike, B: npt.ArrayLike, *, cycles: int = 1, tolerance: float = TOLERANCE, mu0: float = _VACUUM
) -> MagneticMetrics:
    """Measure the magnetic loop of the last complete cycle, or the average loop of the last few.

    Parameters
    ----------
    H : array, shape (n,)
        Field [A/m].
    B : array, shape (n,)
        Flux density, or magnetisation in the same unit [T].
    cycles, tolerance
        As of `hysim.loop_metrics`, which says what a complete cycle is.
    mu0 : float
        Permeability that counts as one, positive [T m / A]; another one for other units.

    Returns
    -------
    MagneticMetrics

    Raises
    ------
    ValueError
        If lengths differ, a value is not finite, there are fewer than 3 samples, H is constant or has fewer cycles
        than asked for, or mu0 is not positive.

    Examples
    --------
    >>> import hysim as hs
    >>> core = hs.Tellinen(saturation=1.8, coercivity=120.0, squareness=0.5)
    >>> H = hs.signals.triangle(-3000.0, 3000.0, cycles=2, samples_per_cycle=2000)
    >>> loop = hs.magnetic_metrics(H, core.response(H))
    >>> round(loop.energy), round(loop.coercivity, 1), round(loop.remanence, 4)
    (864, 120.0, 0.9)
    """
    check_positive(mu0=mu0)
    field, induction = samples_of_a_loop(H, B)
    loop = loop_metrics(field, induction, cycles=cycles, tolerance=tolerance)
    peak_field = 0.5 * float(np.ptp(loop.u))
    initial, maximum = _initial_curve(field, induction, tolerance)
    slopes = np.diff([loop.loading, loop.unloading], axis=1) / np.diff(loop.u)
    return MagneticMetrics(
        energy=0.0 - loop.energy,
        coercivity=0.5 * (_zero(loop.u, loop.loading) - _zero(loop.u, loop.unloading)),
        remanence=0.5 * loop.width_at(0.0),
        peak_field=peak_field,
        peak_induction=loop.secant_stiffness * peak_field,
        amplitude_permeability=loop.secant_stiffness / mu0,
        largest_permeability=float(slopes.max()) / mu0,
        initial_permeability=initial / mu0,
        maximum_permeability=maximum / mu0,
        n_cycles=loop.n_cycles,
    )


def _zero(u: FloatArray, y: FloatArray) -> float:
    """First zero of a polyline; nan if it has none."""
    crossed = np.flatnonzero(np.sign(y[:-1]) * np.sign(y[1:]) <= 0.0)
    if not crossed.size:
        return math.nan
    k = crossed[0]
    return float(u[k] - y[k] * (u[k + 1] - u[k]) / (y[k + 1] - y[k])) if y[k] else float(u[k])


def _initial_curve(H: FloatArray, B: FloatArray, tolerance: float) -> tuple[float, float]:
    """First and largest B / H of the first stroke; nan if it does not begin demagnetised."""
    if abs(H[0]) > _DEMAGNETISED * np.ptp(H) or abs(B[0]) > _DEMAGNETISED * np.ptp(B):
        return math.nan, math.nan
    first = turns(H, tolerance).branches[0]
    field, induction = H[first] - H[0], B[first] - B[0]
    moved = field != 0.0
    ratios = induction[moved] / field[moved]
    return float(ratios[0]), float(ratios.max())
