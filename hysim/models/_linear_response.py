"""The response of a rational transfer function, as columns in which it is affine.

With den monic the plant's states are x_j = s^j / den(s) u, j = 0 ... n - 1, in a time unit that makes the
coefficients of den at most one. The steps between samples are exact (`hysim.kernels.linear`).
"""

import numpy as np

from hysim._frozen import FloatArray
from hysim._parallel import in_chunks
from hysim.kernels import linear as kernels

_SAMPLES_PER_THREAD = 20_000  # a millisecond: fewer are not worth a thread


def affine_columns(
    monic: FloatArray,
    u: FloatArray,
    sample_time: float,
    delay: float | FloatArray = 0.0,
    *,
    zeros: int | None = None,
    hold: str = "zoh",
    sample: str = "start",
) -> FloatArray:
    """What the output is affine in: the numerator, highest power first, the initial state, and zero.

    `monic` (n_sets, n) holds the denominators without their leading one, in seconds; a numerator of the degree
    `zeros` (by default n) makes (n_sets, n_samples, zeros + n + 2). The delay is one number, or one for each set.
    """
    n_sets, n = monic.shape
    out = np.empty((n_sets, u.size, n + 2 + (n if zeros is None else zeros)))
    with np.errstate(all="ignore"):
        F, rate, scaled = scaled_companion(monic, sample_time)
        late = np.minimum(np.broadcast_to(delay, n_sets) / sample_time, float(u.size))
        lags, parts = np.floor(late).astype(np.int64), late % 1.0
        A, B0, B1 = transitions(F, rate * sample_time * np.stack([parts, 1.0 - parts], axis=1))
        back = rate ** -np.arange(n + 1.0)
    level = np.append(0.0, u)
    rise = np.append(0.0, np.diff(u, append=u[-1:])) if hold == "foh" else np.zeros_like(level)

    def work(start: int, stop: int) -> None:
        each = slice(start, stop)
        kernels.columns(
            *(A[each], B0[each], B1[each], level, rise, lags[each], parts[each], scaled[each], back[each]),
            sample == "end",
            out[each],
        )

    in_chunks(work, n_sets, minimum=1 + _SAMPLES_PER_THREAD // u.size)
    return out


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


def transitions(
    F: FloatArray, spans: FloatArray, g: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A, B0 and B1 of x' = F x + g v over each of the spans (n_sets, n_pieces); see `kernels.linear`.

    By default g is (0, ..., 0, 1), that of a companion matrix.
    """
    n = F.shape[-1]
    entry = np.eye(n, 1, 1 - n)[:, 0] if g is None else g
    generators = np.zeros((*spans.shape, n + 2, n + 2))
    generators[..., :n, :n] = F[:, np.newaxis] * spans[..., np.newaxis, np.newaxis]
    generators[..., :n, n] = entry * spans[..., np.newaxis]
    generators[..., n, n + 1] = 1.0
    exponentials = np.empty_like(generators)
    kernels.exponentials(generators.reshape(-1, n + 2, n + 2), exponentials.reshape(-1, n + 2, n + 2))
    held, rising = exponentials[..., :n, n], exponentials[..., :n, n + 1]
    return np.ascontiguousarray(exponentials[..., :n, :n]), held - rising, np.ascontiguousarray(rising)
