"""What `identify` returns."""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from hysim._frozen import FloatArray, frozen


@frozen
class Candidate:
    """One optimum: a model and how well it fits.

    Parameters
    ----------
    model : model
        The identified model.
    estimates : mapping
        Every parameter by name, the held ones included.
    fit_percent : float
        100 (1 - ||residual|| / ||y - mean(y)||).
    rmse : float
        Root mean square of the residual [unit of y].
    """

    model: Any
    estimates: Mapping[str, float]
    fit_percent: float
    rmse: float


@frozen
class Identification:
    """Parameters of a model, identified on a record.

    Parameters
    ----------
    model : model
        The identified model.
    estimates : mapping
        Every parameter by name, the held ones included.
    stderr : mapping
        Standard error of each free parameter by the linearised model; nan where the data cannot tell,
        with the reason in `message`.
    covariance : array, shape (n_parameters, n_parameters)
        Of the free parameters, in the order of `free_names`.
    free_names : tuple of str
        The parameters that were identified.
    n_parameters : int
        Their number, d.
    fit_percent, rmse : float
        100 (1 - ||residual|| / ||y - mean(y)||), and the residual's root mean square [unit of y].
    fpe, aic, bic : float
        V (1 + d/N) / (1 - d/N), N ln V + 2 d, N ln V + d ln N, with V the mean squared residual.
    residual : array, shape (n,)
        Measured minus model [unit of y].
    success : bool
        Whether the search converged.
    message : str
        How it ended, and what the data cannot tell.
    rivals : tuple of Candidate
        Other optima that the data hardly tell from this one, best first: their likelihood ratio is inside
        the 95 % region of the optimum.
    regions : mapping
        Name to the best candidate inside a region that the family names (for Bouc-Wen ``"admissible"``),
        where the optimum lies outside.
    cv_rmse : float
        Cross-validated rmse [unit of y]; nan if it was not asked for.
    """

    model: Any
    estimates: Mapping[str, float]
    stderr: Mapping[str, float]
    covariance: FloatArray
    free_names: tuple[str, ...]
    n_parameters: int
    fit_percent: float
    rmse: float
    fpe: float
    aic: float
    bic: float
    residual: FloatArray
    success: bool
    message: str
    rivals: tuple[Candidate, ...] = ()
    regions: Mapping[str, Candidate] = field(default_factory=dict)
    cv_rmse: float = float("nan")

    def summary(self) -> str:
        """The result in a few lines."""
        family = type(self.model).__name__
        lines = [
            f"{family}: fit {self.fit_percent:.2f} %, rmse {self.rmse:.4g}, FPE {self.fpe:.4g}, "
            f"BIC {self.bic:.1f}, {self.n_parameters} parameters from {self.residual.size} samples"
        ]
        lines += [f"  {name} = {self.estimates[name]:.6g} +- {self.stderr[name]:.2g}" for name in self.free_names]
        held = [f"{name} = {value:g}" for name, value in self.estimates.items() if name not in self.free_names]
        lines += [f"  held: {', '.join(held)}"] if held else []
        lines += [f"  best {name}: fit {best.fit_percent:.2f} %" for name, best in self.regions.items()]
        return "\n".join([*lines, f"  {self.message}"])
