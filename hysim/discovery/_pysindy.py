"""The only place that touches PySINDy (2.1): sparse regression of dy/dL on a library of terms.

PySINDy's STLSQ alternates least squares and the removal of coefficients below a threshold. It sees one
trajectory for each branch, with the slope given, so that it never differentiates across a reversal.
"""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from hysim._frozen import FloatArray
from hysim.discovery._library import Regression, feature
from hysim.models.duhem_terms import Term

RIDGE = 1e-12  # of the mean square of the columns: keeps the normal equations solvable and changes nothing else
_MAX_ITERATIONS = 50


def sparse_path(regression: Regression) -> list[tuple[float, FloatArray]]:
    """Thresholds from zero up, and the scaled coefficients (n_terms,) that STLSQ finds at each.

    The next threshold is just above the smallest coefficient of the last result, so that every threshold
    changes the result and none that matters is missed. The path ends with the last term.
    """
    path: list[tuple[float, FloatArray]] = []
    threshold = 0.0
    while True:
        coefficients = sparse_fit(regression, threshold)
        kept = np.abs(coefficients[coefficients != 0.0])
        if not kept.size:
            return path
        path.append((threshold, coefficients))
        threshold = float(kept.min()) * (1.0 + 1e-9)


def sparse_fit(regression: Regression, threshold: float) -> FloatArray:
    """Scaled coefficients (n_terms,) of STLSQ at one threshold, zero where it removed the term."""
    import pysindy

    samples = len(regression.features)
    library = pysindy.CustomLibrary(
        library_functions=[_column(term, size) for term, size in zip(regression.terms, regression.sizes, strict=True)],
        function_names=[_named(term) for term in regression.terms],
    )
    optimizer = pysindy.STLSQ(threshold=threshold, alpha=RIDGE * samples, max_iter=_MAX_ITERATIONS, unbias=False)
    model = pysindy.SINDy(optimizer=optimizer, feature_library=library)
    branches = regression.branches
    with _quiet():
        model.fit(
            [branch.y[:, np.newaxis] for branch in branches],
            t=[branch.length for branch in branches],
            x_dot=[branch.slope[:, np.newaxis] / regression.slope_size for branch in branches],
            u=[np.stack([branch.u, np.full(branch.u.size, branch.direction)], axis=1) for branch in branches],
            feature_names=["y", "u", "s"],
        )
    return np.array(model.coefficients()[0])


def matrix_path(features: FloatArray, target: FloatArray) -> list[FloatArray]:
    """Coefficients (n_terms,) of STLSQ at the thresholds of `sparse_path`, for any features and target (n_samples,)."""
    import pysindy

    ridge = RIDGE * float(np.sum(features**2)) / max(features.shape[1], 1)
    path: list[FloatArray] = []
    threshold = 0.0
    while features.shape[1]:
        optimizer = pysindy.STLSQ(threshold=threshold, alpha=ridge, max_iter=_MAX_ITERATIONS, unbias=False)
        with _quiet():
            coefficients = np.array(optimizer.fit(features, target[:, np.newaxis]).coef_[0])
        kept = np.abs(coefficients[coefficients != 0.0])
        if not kept.size:
            break
        path.append(coefficients)
        threshold = float(kept.min()) * (1.0 + 1e-9)
    return path


@contextmanager
def _quiet() -> Iterator[None]:
    """An empty law is the end of a path, and the last iterate of an unfinished one is still a structure."""
    from sklearn.exceptions import ConvergenceWarning

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sparsity parameter is too big")
        warnings.filterwarnings("ignore", category=ConvergenceWarning)
        yield


def _column(term: Term, size: float) -> Callable[[FloatArray, FloatArray, FloatArray], FloatArray]:
    def scaled(y: FloatArray, u: FloatArray, s: FloatArray) -> FloatArray:
        return feature(term, u, y, s) / size

    return scaled


def _named(term: Term) -> Callable[..., str]:
    def name(*_inputs: str) -> str:
        return term.name

    return name
