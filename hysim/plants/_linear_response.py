"""The response of a rational transfer function, as columns in which it is affine.

With den monic the plant's states are x_j = s^j / den(s) u, j = 0 ... n - 1, in a time unit that makes the
coefficients of den at most one. The steps between samples are exact (`hysim.kernels.linear`).
"""

from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, read_only
from hysim._basics.parallel import in_chunks
from hysim.kernels import linear as kernels
from hysim.kernels.stepping import complete
from hysim.models.protocols import Startable

Indices = npt.NDArray[np.int64]
Transition = tuple[FloatArray, FloatArray, FloatArray]
_Stepped = tuple[FloatArray, FloatArray, FloatArray, Indices, FloatArray]

_NEVER = 2.0**53  # samples
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
    """Columns in which the output is affine, (n_sets, n_samples, zeros + n + 2): numerator, initial state, and zero.

    `monic` (n_sets, n) holds the denominators without their leading one, in seconds; the numerators have the degree
    `zeros`, by default n, highest power first.
    """
    n_sets, n = monic.shape
    out = np.empty((n_sets, u.size, n + 2 + (n if zeros is None else zeros)))
    with np.errstate(all="ignore"):
        late = np.minimum(np.broadcast_to(delay, n_sets) / sample_time, float(u.size))
        (A, B0, B1, lags, parts), rate, scaled = _stepped(monic, late, sample_time)
        back = rate ** -np.arange(n + 1.0)
    level, rise = np.append(0.0, u), np.zeros(u.size + 1)
    rise[1:-1] = np.diff(u) if hold == "foh" else 0.0

    def work(start: int, stop: int) -> None:
        each = slice(start, stop)
        plants = A[each], B0[each], B1[each], level, rise, lags[each], parts[each], scaled[each], back[each]
        kernels.columns(*plants, sample == "end", out[each])

    in_chunks(work, n_sets, minimum=1 + _SAMPLES_PER_THREAD // u.size)
    return out


class LinearState(NamedTuple):
    """States (n_inputs, n) at the last sample, inputs (n_inputs, m) that still act, up to that sample's."""

    x: FloatArray
    past: FloatArray
    sample_time: float = 0.0


class LinearPlants(NamedTuple):
    """Plants in the form that is stepped at one sample time; see `kernels.outputs` and `scaled_companion`."""

    A: FloatArray
    B0: FloatArray
    B1: FloatArray
    lags: Indices
    parts: FloatArray
    C: FloatArray
    D: FloatArray
    rate: FloatArray

    @classmethod
    def of(cls, monic: FloatArray, numerators: FloatArray, delays: FloatArray, sample_time: float) -> Self:
        """From denominators (n_sets, n), numerators (n_sets, n + 1) and dead times (n_sets,), in seconds."""
        n = monic.shape[1]
        with np.errstate(all="ignore"):
            stepped, rate, _ = _stepped(monic, np.minimum(delays / sample_time, _NEVER), sample_time)
            D = numerators[:, 0]
            C = (numerators[:, 1:] - D[:, np.newaxis] * monic)[:, ::-1] * rate ** -np.arange(n, 0.0, -1.0)
        return cls(*stepped, C, D, rate)

    def filtered(self, u: FloatArray, *, hold: str, sample: str) -> FloatArray:
        """Outputs (n_sets, n_inputs, n_samples) from rest for the inputs `u` of this shape, or (1, ...)."""
        n_sets, n = self.C.shape
        out = np.empty((n_sets, *u.shape[1:]))
        rest = LinearState(np.zeros((u.shape[1], n)), np.empty((u.shape[1], 0)))

        def work(start: int, stop: int) -> None:
            for k in range(start, stop):
                out[k] = self.continued(u[k % len(u)], rest, k, hold=hold, sample=sample)[0]

        in_chunks(work, n_sets, minimum=1 + _SAMPLES_PER_THREAD // max(1, u[0].size))
        return out

    def continued(
        self, u: FloatArray, state: LinearState, k: int = 0, *, hold: str, sample: str, free: bool = False
    ) -> tuple[FloatArray, LinearState]:
        """Outputs of the plant `k` for (n_inputs, n_samples), the last a free response with `free`; and the state."""
        before = state.past.shape[1]
        level = np.concatenate([np.zeros((len(u), 1)), state.past, u], axis=1)
        rise = np.zeros_like(level)
        if hold == "foh":
            rise[:, 1:-1] = np.diff(level[:, 1:])
        C, D = np.tile(self.C[k], (len(u), 1)), np.full(len(u), self.D[k])
        if free:
            C[-1], D[-1] = np.eye(1, C.shape[1])[0], 0.0
        repeated = min(before, 1)  # the last sample so far, which has not acted yet
        out, x = np.empty((len(u), u.shape[1] + repeated)), state.x.copy()
        kernels.outputs(
            self.A[k], self.B0[k], self.B1[k], level, rise, max(before, 1), int(self.lags[k]), float(self.parts[k]),
            C, D, sample == "end", x, out,
        )  # fmt: skip
        return out[:, repeated:], LinearState(x, level[:, 1:][:, -int(self.lags[k]) - 2 :])

    def startable(self, initial_state: tuple[float, ...] = (), *, hold: str, sample: str) -> Startable:
        """The first plant as a step, `kernels.step`; `initial_state` as of a `TransferFunction`."""
        n, lag, part, rate = self.C.shape[1], int(self.lags[0]), float(self.parts[0]), self.rate[0]
        head = [n, lag, part, sample == "end", hold == "foh", bool(initial_state), self.D[0]]
        pieces = [self.A[0, 1].ravel(), self.B0[0, 1], self.B1[0, 1]]
        pieces += [self.A[0, 0].ravel(), self.B0[0, 0], self.B1[0, 0]] if part else []
        free = np.array(initial_state) * rate ** -np.arange(float(len(initial_state)))
        state = [np.zeros(kernels.N_BEFORE + 2 * n), free, np.zeros(lag + kernels.N_RING)]
        parameters = read_only(np.concatenate([head, self.C[0], *pieces]), finite=False)
        return Startable(kernels.step, parameters, np.concatenate(state), complete)

    def rest_at(self, u0: float, level: float, state: FloatArray) -> None:
        """Put the first plant, as `startable` has it, to rest at the input `u0`; `level` is u0 / den(0), den monic."""
        n, ring = self.C.shape[1], int(self.lags[0]) + kernels.N_RING
        state[0], state[2], state[state.size - ring :] = u0, ring, u0
        if n:
            state[kernels.N_BEFORE] = level * self.rate[0, 0] ** n


def _stepped(monic: FloatArray, late: FloatArray, sample_time: float) -> tuple[_Stepped, FloatArray, FloatArray]:
    """A, B0, B1, lags and parts of plants that are `late` (n_sets,) [samples]; rates and scaled coefficients."""
    F, rate, scaled = scaled_companion(monic, sample_time)
    parts = late % 1.0
    matrices = transitions(F, rate * sample_time * np.stack([parts, 1.0 - parts], axis=1))
    return (*matrices, np.floor(late).astype(np.int64), parts), rate, scaled


def scaled_companion(monic: FloatArray, sample_time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Companion matrices F, the rates that scale time (n_sets, 1), and the scaled coefficients (n_sets, n)."""
    n_sets, n = monic.shape
    degrees = np.arange(1, n + 1)
    rate = np.max(np.abs(monic) ** (1.0 / degrees), axis=1, initial=1.0 / sample_time)[:, np.newaxis]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        scaled = monic / rate**degrees
    F = np.zeros((n_sets, n, n))
    F[:, np.arange(n - 1), np.arange(1, n)] = 1.0
    F[:, n - 1 :, :] = -scaled[:, np.newaxis, ::-1]
    return F, rate, scaled


def transitions(F: FloatArray, spans: FloatArray, g: FloatArray | None = None) -> Transition:
    """A, B0 and B1 of x' = F x + g v over each of the spans (n_sets, n_pieces); see `kernels.linear`."""
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
