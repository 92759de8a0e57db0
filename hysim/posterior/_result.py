"""The result of `sample_posterior`."""

import warnings
from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, frozen, read_only
from hysim._printing import aligned, csv_text, printed, summary_text, wrapped
from hysim._versions import optional
from hysim.posterior._prediction import Prediction, predicted

LARGEST_RHAT = 1.05
"""R-hat above which the chains do not agree: `Posterior.warnings` says so."""


@printed
@frozen
class Posterior:
    """Draws of all free parameters of a model from their distribution given the records.

    Parameters
    ----------
    model : model
        The identified model, whose parameters were sampled.
    samples : mapping
        Name to draws, shape (n_draws * n_walkers,), draw by draw: every free parameter, the linear ones included, and
        ``"sigma"``, the scale of the noise [unit of y].
    log_density : array, shape (n_draws * n_walkers,)
        Logarithm of likelihood times prior, in the coordinates of the sampler, up to a constant.
    n_walkers : int
        Number of walkers of the ensemble.
    effective_samples : mapping
        Name to the number of independent draws whose mean would be as sure.
    rhat : mapping
        Name to R-hat, the spread of all halves of the walkers' paths over the spread within them: near 1 where the
        paths agree.
    noise : {"gaussian", "quantised", "robust"}
    resolution : float or None
        Quantum of the sensor [unit of y].
    priors : mapping
        Name of each coordinate to its prior in words.
    states : mapping
        Name to draws of a state at the first sample that follows from the parameters, where the record is periodic.
    acceptance : float
        Share of the proposed moves that were accepted.
    n_evaluations : int
        Number of parameter sets that were simulated.
    seed : int
        Seed of the draws.
    warnings : tuple of str
        Sentences on chains that do not agree or are too short.
    """

    model: Any
    samples: Mapping[str, FloatArray]
    log_density: FloatArray
    n_walkers: int
    effective_samples: Mapping[str, float]
    rhat: Mapping[str, float]
    noise: str
    resolution: float | None
    priors: Mapping[str, str] = field(default_factory=dict)
    states: Mapping[str, FloatArray] = field(default_factory=dict)
    acceptance: float
    n_evaluations: int
    seed: int
    warnings: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The sampled parameters, and sigma."""
        return tuple(self.samples)

    @property
    def table(self) -> FloatArray:
        """All draws, shape (n_draws * n_walkers, n_names)."""
        return np.column_stack([self.samples[name] for name in self.names])

    @property
    def mean(self) -> dict[str, float]:
        """Mean of each parameter."""
        return {name: float(draws.mean()) for name, draws in self.samples.items()}

    @property
    def median(self) -> dict[str, float]:
        """Median of each parameter."""
        return {name: float(np.median(draws)) for name, draws in self.samples.items()}

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters, shape (n_names, n_names), in the order of `names`."""
        return np.atleast_2d(np.cov(self.table, rowvar=False))

    def chains(self, name: str) -> FloatArray:
        """Draws of one parameter, shape (n_draws, n_walkers)."""
        return self.samples[name].reshape(-1, self.n_walkers)

    def interval(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Name to the central interval that holds a parameter with the probability `level`; both tails are equal.

        A ValueError is raised unless `level` is between 0 and 1.
        """
        tails = _tails(level)
        ends = {name: np.quantile(draws, tails).tolist() for name, draws in self.samples.items()}
        return {name: (low, high) for name, (low, high) in ends.items()}

    def predict(
        self,
        u: npt.ArrayLike,
        *,
        t: npt.ArrayLike | None = None,
        n: int = 400,
        level: float = 0.95,
        seed: int = 0,
    ) -> Prediction:
        """Bands of the output, and of the loop width, for an input.

        Parameters
        ----------
        u : array, shape (n_samples,) [unit of u]
            The model starts from the state that each draw has at the first sample of the first record.
        t : array, shape (n_samples,), optional [s]
            Times, for models that depend on them.
        n : int
            Number of draws, at most as many as there are.
        level : float
            Probability of the bands.
        seed : int
            Seed of the choice of the draws, and of the noise.

        Returns
        -------
        Prediction
        """
        return predicted(self, read_only(u, "u", ndim=1), t, n, _tails(level), seed)

    def to_csv(self) -> str:
        """All draws with every digit, one in a line, below the names."""
        return csv_text([self.names, *self.table.tolist()])

    def to_arviz(self) -> Any:
        """The draws as the installed arviz holds them: a DataTree, or InferenceData before arviz 1.0.

        Chains are the walkers. The group ``posterior`` has the parameters, ``sample_stats`` has ``lp``. An ImportError
        is raised without arviz.
        """
        posterior = {name: self.chains(name).T for name in self.names}
        stats = {"lp": self.log_density.reshape(-1, self.n_walkers).T}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # arviz 0.23 announces its successor once a day
            warnings.filterwarnings("ignore", "More chains")  # than draws: an ensemble may have many walkers
            arviz = optional("arviz", "a container of arviz", "bayes")
            if int(arviz.__version__.partition(".")[0]) < 1:
                return arviz.from_dict(posterior=posterior, sample_stats=stats)
            return arviz.from_dict({"posterior": posterior, "sample_stats": stats})

    def summary(self) -> str:
        """All parameters with median, interval, mean, standard deviation, effective samples and R-hat."""
        ends, median = self.interval(), self.median
        table = [["parameter", "median", "interval at 95 %", "mean", "deviation", "effective", "R-hat"]]
        for name, draws in self.samples.items():
            low, high = ends[name]
            values = f"{median[name]:.5g}", f"{low:.5g} to {high:.5g}", f"{draws.mean():.5g}"
            trust = f"{draws.std(ddof=1):.2g}", f"{self.effective_samples[name]:.0f}", f"{self.rhat[name]:.3f}"
            table.append([name, *values, *trust])
        lines = [self._head(), *aligned(table), *(f"  prior of {name}: {words}" for name, words in self.priors.items())]
        return "\n".join([*lines, *(["Warnings"] if self.warnings else []), *(f"  {each}" for each in self.warnings)])

    def __str__(self) -> str:
        ends = self.interval()
        values = [f"{name} {self.mean[name]:.4g} [{ends[name][0]:.4g}, {ends[name][1]:.4g}]" for name in self.names]
        return summary_text(
            [self._head(), wrapped(values, most=5)],
            {
                "chains": f"{self.n_walkers} walkers, R-hat at most {max(self.rhat.values()):.3f}, "
                f"{100.0 * self.acceptance:.0f} % of the moves accepted",
                "warnings": "; ".join(self.warnings),
            },
        )

    def _head(self) -> str:
        fewest = min(self.effective_samples.values())
        return (
            f"Posterior of {type(self.model).__name__}: {self.log_density.size} draws, {fewest:.0f} effective ones at "
            f"least, {self.noise} noise"
        )


def _tails(level: float) -> tuple[float, float]:
    if not 0.0 < level < 1.0:
        raise ValueError(f"level must be between 0 and 1, got {level}")
    return 0.5 * (1.0 - level), 0.5 * (1.0 + level)
