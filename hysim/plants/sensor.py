"""Displacement sensors of a sampled controller."""

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, NotNegative, check_whole, read_only
from hysim.models.model import family


@family
class Sensor:
    """From the true displacement to the measured one.

    ``measurement_k = quantum floor((y(t_k - delay) + noise_k) / quantum + 1/2)``; the noise is gaussian and white from
    sample to sample, a function of the seed and the sample alone.

    Parameters
    ----------
    quantum, noise : float
        Step of the readings, of a converter or a camera's pixel, and rms of the noise before it; 0 for none [unit of
        y].
    delay : float
        Age of what is read [s]; it need not be a whole number of samples.
    seed : int
        Of the noise: the same seed gives the same noise.

    Raises
    ------
    TypeError, ValueError
        If a number is negative, or the seed is no integer.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.Sensor(quantum=0.5).measure([0.2, 0.3, 0.8]).tolist()
    [0.0, 0.5, 1.0]
    """

    quantum: NotNegative = 0.0
    noise: NotNegative = 0.0
    delay: NotNegative = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        check_whole(self.seed, "seed", least=0)

    def noise_samples(self, n: int) -> FloatArray:
        """The noise of the first `n` samples; more samples begin with the same."""
        if not self.noise:
            return np.zeros(n)
        return self.noise * np.random.default_rng(self.seed).standard_normal(n)

    def measure(self, y: npt.ArrayLike) -> FloatArray:
        """Readings of displacements that are as old as the delay has them, shape (n,)."""
        displacement = read_only(y, "y", finite=False)
        noisy = displacement + self.noise_samples(displacement.size)
        return self.quantum * np.floor(noisy / self.quantum + 0.5) if self.quantum else noisy
