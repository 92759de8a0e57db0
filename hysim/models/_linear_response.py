"""The response of a rational transfer function, as columns in which it is affine.

With den monic the plant's states are x_j = s^j / den(s) u, j = 0 ... n - 1, in a time unit that makes the
coefficients of den at most one. The steps between samples are exact (`hysim.kernels.linear`).
"""

import numpy as np

from hysim._frozen import FloatArray
from hysim.kernels import linear as kernels


def affine_columns(
    monic: FloatArray, u: FloatArray, sample_time: float, delay: float, hold: str, sample: str
) -> FloatArray:
    """What the output is affine in: b_0 ... b_n of the numerator, then the initial state, (n_sets, N, 2 n + 1).

    `monic` (n_sets, n) holds the denominators without their leading one, in seconds.
    """
    n_sets, n = monic.shape
    late = min(delay / sample_time, float(u.size))
    begin, end, lengths = _pieces(u, late, hold)
    with np.errstate(all="ignore"):
        F, rate, scaled = scaled_companion(monic, sample_time)
        A, B0, B1 = transitions(F, rate * sample_time * lengths)
        forced, free = np.empty((2, n_sets, u.size + 1, n))
        kernels.states(A, B0, B1, begin, end, np.zeros((n_sets, n)), forced)
        kernels.free_responses(A[:, 0] if lengths.size == 1 else A[:, 1] @ A[:, 0], free)
        at = slice(1, None) if sample == "end" else slice(0, -1)
        x = forced[:, at, ::-1]
        through = end[:, -1] if sample == "end" else begin[:, 0]
        feedthrough = through - (x @ scaled[..., np.newaxis])[..., 0]
        back = rate[:, np.newaxis] ** -np.arange(1, n + 1)
        from_state = free[:, at] * back * rate[..., np.newaxis]
        return np.concatenate([feedthrough[..., np.newaxis], x * back, from_state], axis=-1)


def scaled_companion(monic: FloatArray, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Companion matrices F, the rates that scale time (n_sets, 1), and the scaled coefficients (n_sets, n)."""
    n_sets, n = monic.shape
    degrees = np.arange(1, n + 1)
    rate = np.max(np.abs(monic) ** (1.0 / degrees), axis=1, initial=1.0 / sample_time)[:, np.newaxis]
    scaled = monic / rate**degrees
    F = np.zeros((n_sets, n, n))
    F[:, np.arange(n - 1), np.arange(1, n)] = 1.0
    F[:, n - 1 :, :] = -scaled[:, np.newaxis, ::-1]
    return F, rate, scaled


def transitions(F: FloatArray, spans: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A, B0 and B1 of x' = F x + (0, ..., 0, v) over each of the spans (n_sets, n_pieces); see `kernels.linear`."""
    n = F.shape[-1]
    generators = np.zeros((*spans.shape, n + 2, n + 2))
    generators[..., :n, :n] = F[:, np.newaxis] * spans[..., np.newaxis, np.newaxis]
    generators[..., n - 1 : n, n] = spans[..., np.newaxis]
    generators[..., n, n + 1] = 1.0
    exponentials = np.empty_like(generators)
    kernels.exponentials(generators.reshape(-1, n + 2, n + 2), exponentials.reshape(-1, n + 2, n + 2))
    held, rising = exponentials[..., :n, n], exponentials[..., :n, n + 1]
    return np.ascontiguousarray(exponentials[..., :n, :n]), held - rising, np.ascontiguousarray(rising)


def _pieces(u: FloatArray, late: float, hold: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The input `late` samples later, by pieces: at their begin and end, (n_steps, n_pieces), and their lengths.

    A step holds the end of one of the input's stretches between samples, and the begin of the next.
    """
    whole, part = divmod(late, 1.0)
    before = np.zeros(int(whole) + 1)
    level = np.concatenate([before, u])
    rise = np.concatenate([before, np.diff(u, append=u[-1:]) if hold == "foh" else np.zeros_like(u)])
    ends = [(0, 1.0 - part, 1.0), (1, 0.0, 1.0 - part)] if part > 0.0 else [(1, 0.0, 1.0)]
    stretches = [(level[k : k + u.size], rise[k : k + u.size], start, stop) for k, start, stop in ends]
    begin = np.stack([value + start * slope for value, slope, start, _ in stretches], axis=1)
    end = np.stack([value + stop * slope for value, slope, _, stop in stretches], axis=1)
    return begin, end, np.array([stop - start for _, start, stop in ends])
