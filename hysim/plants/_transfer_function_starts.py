"""Starts for a transfer function's search, from the record by regression.

Filtered by 1 / F(s), with F of the plant's order, input and output obey the plant's equation in the filtered
derivatives, which are known without differentiation:

    s^n/F y = -den_1 s^(n-1)/F y - ... - den_n 1/F y + num_0 s^m/F u + ... + num_m 1/F u

Least squares with F = (s + cutoff)^n are a first guess, biased by the noise in the filtered outputs. The
refined instrumental variable takes F from the guess before, and in place of the noisy outputs those that the
guess simulates as instruments (P. C. Young and A. Jakeman, Int. J. Control 31, 1980). Unstable poles are
reflected. Several cutoffs serve plants of which no one knows the band.

An unknown delay cannot be later than the peak of the impulse response. The regressions are done for delays of which
the distance to it doubles, as does the time in which such a response can have risen.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from hysim._frozen import FloatArray
from hysim.plants._linear_response import affine_columns
from hysim.records import Record

_CUTOFFS = np.geomspace(0.01, 1.0, 5)  # rad per sample
_ROUNDS = 8


_MOST = 5


class Guess(NamedTuple):
    """Poles (n,) [rad/s] of a stable plant, its delay [s], and the sum of squares that they leave."""

    poles: FloatArray
    delay: float
    cost: float


def guesses(
    record: Record, poles: int, zeros: int, delays: Iterable[float], *, hold: str, sample: str, at_rest: bool
) -> list[Guess]:
    """The plants from which the regressions stay finite: of one delay all, of several the best of each, best first."""
    results = []
    for delay in delays:
        refined = (
            _refined(record, poles, zeros, delay, cutoff, hold=hold, sample=sample, at_rest=at_rest)
            for cutoff in _CUTOFFS / record.sample_time
        )
        results.append([guess for guess in refined if guess is not None])
    if len(results) == 1:
        return results[0]
    best = [min(refined, key=_cost) for refined in results if refined]
    return sorted(best, key=_cost)[:_MOST]


def _cost(guess: Guess) -> float:
    return guess.cost


def likely_delays(record: Record, earliest: float, latest: float) -> list[float]:
    """Delays [s] at doubling distances before the peak of the impulse response, and the earliest one."""
    n, h = len(record), record.sample_time
    first = int(np.ceil(earliest / h))
    U, Y = (np.fft.rfft(values, 2 * n) for values in (record.u, record.y - record.y.mean()))
    power = np.abs(U) ** 2
    impulse = np.fft.irfft(Y * np.conj(U) / (power + power.mean()), 2 * n)[first : max(first, int(latest / h)) + 1]
    peak = first + int(np.argmax(np.abs(impulse)))
    distances = np.append(0, 2 ** np.arange(n.bit_length()))
    return [earliest, *(h * (peak - distances[peak - distances > earliest / h])).tolist()]


def _refined(
    record: Record, poles: int, zeros: int, delay: float, cutoff: float, *, hold: str, sample: str, at_rest: bool
) -> Guess | None:
    """The guess after all rounds from one cutoff [rad/s]; None where they diverge."""
    h = record.sample_time
    roots = np.full(poles, -cutoff, dtype=complex)
    numerator, cost = None, np.inf
    for _ in range(_ROUNDS):
        monic = np.real(np.poly(roots))[np.newaxis, 1:]
        forced = affine_columns(monic, record.u, h, delay, zeros=zeros, hold=hold, sample=sample)[0]
        measured = affine_columns(monic, record.y, h, hold="foh")[0, :, : poles + 1]
        known = forced[:, : zeros + 1 if at_rest else -1]
        simulated = measured
        if numerator is not None:
            output = known @ numerator
            cost = float(np.sum((record.y - output) ** 2))
            simulated = affine_columns(monic, output, h, hold="foh")[0, :, : poles + 1]
        theta = _instrumental(
            np.column_stack([-simulated[:, 1:], known]), np.column_stack([-measured[:, 1:], known]), measured[:, 0]
        )
        if not np.isfinite(theta).all():
            return None
        roots = np.roots(np.append(1.0, theta[:poles])).astype(complex)
        roots = -np.abs(roots.real) + 1j * roots.imag
        numerator = theta[poles:]
    return Guess(roots, delay, cost)


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


def denominators(x: FloatArray, poles: int) -> FloatArray:
    """Monic denominators (n_sets, poles + 1) of sections with these coordinates, in samples."""
    one, product = np.ones(len(x)), np.ones((len(x), 1))
    for k in range(poles // 2):
        frequency, damping = np.exp(x[:, 2 * k]), np.exp(x[:, 2 * k + 1])
        product = _times(product, [one, 2.0 * damping * frequency, frequency**2])
    return _times(product, [one, np.exp(x[:, poles - 1])]) if poles % 2 else product


def _times(polynomials: FloatArray, factor: list[FloatArray]) -> FloatArray:
    """Products of rows of polynomials with one factor for each row."""
    product = np.zeros((len(polynomials), polynomials.shape[1] + len(factor) - 1))
    for k, coefficient in enumerate(factor):
        product[:, k : k + polynomials.shape[1]] += coefficient[:, np.newaxis] * polynomials
    return product
