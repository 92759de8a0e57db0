"""The only place that touches PySINDy (2.1): its optimizers, from dense to sparse, and its ensembles.

Features and slopes are scaled arrays: PySINDy never differentiates, so that nothing is taken across a reversal. Its
ensembles draw from NumPy's global generator, which is seeded around the call and restored.
"""

import contextlib
import importlib.util
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from hysim._frozen import FloatArray

RIDGE = 1e-12  # of the squared columns: keeps the normal equations solvable and changes nothing else
STEP = 1.1
_MAX_ITERATIONS = 50
_EXTRAS = {
    "ConstrainedSR3": "cvxpy",
    "StableLinearSR3": "cvxpy",
    "TrappingSR3": "cvxpy",
    "MIOSR": "miosr",
    "SBR": "sbr",
}

OPTIMIZERS = ("STLSQ", "SR3", "SSR", "FROLS")
"""PySINDy's optimizers that a path is made with."""


def sparse_path(features: FloatArray, slope: FloatArray, optimizer: str = "STLSQ") -> list[tuple[float, FloatArray]]:
    """Thresholds from zero up, and the coefficients (n_terms,) that the optimizer finds at each.

    The next threshold is just above the smallest coefficient of the last result, so that none that matters is missed;
    SR3, whose coefficients may be smaller than its threshold, goes on in steps of STEP. SSR and FROLS have no
    threshold: their own sequence of structures is the path, each with its smallest coefficient.
    """
    features, slope = compressed(features, slope)
    if optimizer in ("SSR", "FROLS"):
        return _greedy_path(features, slope, optimizer)
    path: list[tuple[float, FloatArray]] = []
    threshold = 0.0
    while (coefficients := sparse_fit(features, slope, threshold, optimizer)).any():
        if not path or not np.array_equal(coefficients != 0.0, path[-1][1] != 0.0):
            path.append((threshold, coefficients))
        smallest = float(np.abs(coefficients[coefficients != 0.0]).min())
        threshold = smallest * (1.0 + 1e-9) if smallest > threshold else STEP * threshold
    return path


def compressed(features: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A regression with as many rows as terms, and one more, with the least squares of all rows."""
    triangle = np.asarray(np.linalg.qr(np.column_stack([features, slope]), mode="r"))
    return triangle[:, :-1], triangle[:, -1]


def sparse_fit(features: FloatArray, slope: FloatArray, threshold: float, optimizer: str = "STLSQ") -> FloatArray:
    """Coefficients (n_terms,) at one threshold, zero where the optimizer removed the term."""
    fitted = _thresholding(optimizer, threshold, features)
    with _quiet():
        fitted.fit(features, slope[:, np.newaxis])
    return np.array(fitted.coef_[0])


def inclusion(features: FloatArray, slope: FloatArray, threshold: float, *, n_models: int, seed: int) -> FloatArray:
    """Share of fits (n_terms,) by STLSQ that keep each term when the rows are drawn anew (PySINDy's bagging)."""
    import pysindy

    ensemble = pysindy.EnsembleOptimizer(_thresholding("STLSQ", threshold, features), bagging=True, n_models=n_models)
    with _quiet(), _seeded(seed):
        ensemble.fit(features, slope[:, np.newaxis])
    return np.asarray(np.mean([coefficients[0] != 0.0 for coefficients in ensemble.coef_list], axis=0))


def check(optimizer: str) -> None:
    """A ValueError for an unknown optimizer; an ImportError if its extra is not installed."""
    if optimizer in OPTIMIZERS:
        return
    extra = _EXTRAS.get(optimizer)
    if extra is not None and importlib.util.find_spec(extra) is None:
        raise ImportError(f"PySINDy's {optimizer} needs its extra: pip install 'pysindy[{extra}]'")
    raise ValueError(f"optimizer must be one of {', '.join(OPTIMIZERS)}, got {optimizer!r}")


def _thresholding(optimizer: str, threshold: float, features: FloatArray) -> Any:
    import pysindy

    if optimizer == "SR3":
        return pysindy.SR3(
            reg_weight_lam=0.5 * threshold**2, regularizer="L0", relax_coeff_nu=1.0, max_iter=1000, unbias=True
        )
    return pysindy.STLSQ(threshold=threshold, alpha=_ridge(features), max_iter=_MAX_ITERATIONS, unbias=False)


def _ridge(features: FloatArray) -> float:
    return RIDGE * float(np.mean(np.sum(features**2, axis=0)))


def _greedy_path(features: FloatArray, slope: FloatArray, optimizer: str) -> list[tuple[float, FloatArray]]:
    import pysindy

    kinds = {"SSR": pysindy.SSR, "FROLS": pysindy.FROLS}
    fitted = kinds[optimizer](alpha=_ridge(features), max_iter=features.shape[1], unbias=False)
    with _quiet():
        fitted.fit(features, slope[:, np.newaxis])
    structures: dict[tuple[bool, ...], FloatArray] = {}
    for coefficients in (np.ravel(each) for each in fitted.history_):
        if coefficients.any():
            structures.setdefault(tuple(coefficients != 0.0), np.array(coefficients))
    ordered = sorted(structures.values(), key=np.count_nonzero, reverse=True)
    return [(float(np.abs(each[each != 0.0]).min()), each) for each in ordered]


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """An empty law is the end of a path, and the last iterate of an unfinished one is still a structure."""
    from sklearn.exceptions import ConvergenceWarning

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sparsity parameter is too big")
        warnings.filterwarnings("ignore", category=ConvergenceWarning)
        yield


@contextlib.contextmanager
def _seeded(seed: int) -> Iterator[None]:
    before = np.random.get_state()  # noqa: NPY002  PySINDy takes no generator
    np.random.seed(seed)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(before)  # noqa: NPY002
