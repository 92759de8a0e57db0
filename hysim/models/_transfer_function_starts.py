"""Starts for a transfer function's search, from the record by regression.

Filtered by 1 / F(s), with F of the plant's order, input and output obey the plant's equation in the filtered
derivatives, which are known without differentiation:

    s^n/F y = -den_1 s^(n-1)/F y - ... - den_n 1/F y + num_0 s^m/F u + ... + num_m 1/F u

Least squares with F = (s + cutoff)^n are a first guess, biased by the noise in the filtered outputs. The
refined instrumental variable takes F from the guess before, and in place of the noisy outputs those that the
guess simulates as instruments (P. C. Young and A. Jakeman, Int. J. Control 31, 1980). Unstable poles are
reflected. Several cutoffs serve plants of which no one knows the band.
"""

import numpy as np

from hysim._frozen import FloatArray
from hysim.models._linear_response import affine_columns
from hysim.records import Record

_CUTOFFS = np.geomspace(0.01, 1.0, 5)  # rad per sample
_ROUNDS = 8


def refined_denominators(
    record: Record, poles: int, zeros: int, *, hold: str, sample: str, at_rest: bool
) -> list[FloatArray]:
    """Poles (n,) [rad/s] of a stable plant for each cutoff from which the regressions stay finite."""
    h = record.sample_time
    found = []
    for cutoff in _CUTOFFS / h:
        roots = np.full(poles, -cutoff, dtype=complex)
        numerator = None
        for _ in range(_ROUNDS):
            monic = np.real(np.poly(roots))[np.newaxis, 1:]
            forced = affine_columns(monic, record.u, h, zeros=zeros, hold=hold, sample=sample)[0]
            measured = affine_columns(monic, record.y, h, hold="foh")[0, :, : poles + 1]
            known = forced[:, : zeros + 1 if at_rest else -1]
            simulated = measured
            if numerator is not None:
                simulated = affine_columns(monic, known @ numerator, h, hold="foh")[0, :, : poles + 1]
            theta = _instrumental(
                np.column_stack([-simulated[:, 1:], known]), np.column_stack([-measured[:, 1:], known]), measured[:, 0]
            )
            if not np.isfinite(theta).all():
                break
            roots = np.roots(np.append(1.0, theta[:poles])).astype(complex)
            roots = -np.abs(roots.real) + 1j * roots.imag
            numerator = theta[poles:]
        else:
            found.append(roots)
    return found


def _instrumental(instruments: FloatArray, regressors: FloatArray, target: FloatArray) -> FloatArray:
    """Solution of instruments^T (target - regressors theta) = 0; nan where there is none that is finite."""
    with np.errstate(all="ignore"):
        left, right = (np.linalg.norm(columns, axis=0) for columns in (instruments, regressors))
        left[left == 0.0], right[right == 0.0] = 1.0, 1.0
        normal = (instruments / left).T @ (regressors / right)
        goal = (instruments / left).T @ target
        if not (np.isfinite(normal).all() and np.isfinite(goal).all()):
            return np.full(len(normal), np.nan)
        return np.asarray(np.linalg.lstsq(normal, goal, rcond=1e-13)[0] / right)


def sections(roots: FloatArray, sample_time: float) -> FloatArray:
    """Coordinates of the sections with these stable poles: log frequency and damping of pairs, log rate of one."""
    upper = sorted(roots[roots.imag > 0.0], key=abs)
    real = np.sort(np.abs(roots[roots.imag == 0.0].real)) * sample_time
    tiny = np.finfo(float).tiny
    pairs = [(abs(root) * sample_time, -root.real / abs(root)) for root in upper]
    for slow, fast in zip(real[: len(real) - 1 : 2], real[1::2], strict=True):
        frequency = np.sqrt(max(slow * fast, tiny))
        pairs.append((frequency, 0.5 * (slow + fast) / frequency))
    rate = real[-1:] if len(real) % 2 else real[:0]
    return np.log(np.maximum([*np.ravel(pairs), *rate], tiny))
