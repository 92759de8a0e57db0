"""The search for a transfer function: starts by regression, a numerator without gain, and warnings about the result.

Filtered by 1 / F(s), with F of the plant's order, input and output obey the plant's equation in the filtered
derivatives, which are known without differentiation:

    s^n/F y = -den_1 s^(n-1)/F y - ... - den_n 1/F y + num_0 s^m/F u + ... + num_m 1/F u

Least squares with F = (s + cutoff)^n are a first guess, biased by the noise in the filtered outputs. The
refined instrumental variable takes F from the guess before, and in place of the noisy outputs those that the
guess simulates as instruments (P. C. Young and A. Jakeman, Int. J. Control 31, 1980). Unstable poles are
reflected. Several cutoffs serve plants of which no one knows the band.

An unknown delay cannot be later than the peak of the impulse response. The regressions are done for delays of which
the distance to it doubles, as does the time in which such a response can have risen.

Beside a stage that carries the gain, the gain at rest is one:

    G(s) = exp(-delay s) den_n (1 + q_(m-1) s/w + ... + q_0 (s/w)^m) / (s^n + den_1 s^(n-1) + ... + den_n)

w = den_n^(1/n) is the poles' mean frequency. The q are searched as asinh(q), of order one for any zeros.

The lag of a transfer function that was fitted to a record may be hysteresis:

* A curve y = f(u) without memory fits as well. The curve is a polynomial with as many coefficients as the plant,
  on a record whose input levels repeat. It fits as well if the mean difference of both squared residuals is below
  1.96 of its standard errors, in which neighbouring samples may be correlated (Q. H. Vuong, Econometrica 57, 1989;
  W. K. Newey and K. D. West, Econometrica 55, 1987), and the plant leaves at least four fifths of the curve's rms.
  The second holds off a record of few short transients, whose mean is that of a few samples.
* The input runs at one rate. The loop of a lag widens with the rate, that of hysteresis does not; with one rate no
  one can see it. The rates are those of the branches between two reversals, in the mean, and they are one if they
  differ by less than a tenth. An input that stands still between reversals shows a lag at any rate.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from hysim import metrics
from hysim._basics.frozen import FloatArray
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.plants._linear_response import LinearPlants, affine_columns
from hysim.records import Record

_CUTOFFS = np.geomspace(0.01, 1.0, 5)  # rad per sample
_ROUNDS = 8


_MOST = 5
_WIDEST = float(np.arcsinh(1e4))
_NEAR = 0.05  # of the box: how far random points are from starts that regressions have found
_SURE = 1.96
_LEAST = 0.8
_ONE_RATE = 1.1
_STILL = 2  # samples with one input: a staircase has its extremes twice in a row
_NOISE = 0.01  # of the input's span


class Guess(NamedTuple):
    """Poles (n,) [rad/s] of a stable plant, its delay [s], and the sum of squares that they leave."""

    poles: FloatArray
    delay: float
    cost: float


def guesses(structure: Any, record: Record, delays: Iterable[float], *, at_rest: bool) -> list[Guess]:
    """The plants from which the regressions stay finite: of one delay all, of several the best of each, best first."""
    results = []
    for delay in delays:
        refined = [_refined(structure, record, delay, w, at_rest=at_rest) for w in _CUTOFFS / record.sample_time]
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


def _refined(structure: Any, record: Record, delay: float, cutoff: float, *, at_rest: bool) -> Guess | None:
    """The guess after all rounds from one cutoff [rad/s]; None where they diverge."""
    h, poles, zeros = record.sample_time, structure.poles, structure.zeros
    roots = np.full(poles, -cutoff, dtype=complex)
    numerator, cost = None, np.inf
    for _ in range(_ROUNDS):
        monic = np.real(np.poly(roots))[np.newaxis, 1:]
        forced = affine_columns(monic, record.u, h, delay, zeros=zeros, **structure.sampling)[0]
        measured = affine_columns(monic, record.y, h, hold="foh")[0, :, : poles + 1]
        known = forced[:, : zeros + 1 if at_rest else -1]
        simulated = measured
        if numerator is not None:
            output = known @ numerator
            cost = float(np.sum((record.y - output) ** 2))
            simulated = affine_columns(monic, output, h, hold="foh")[0, :, : poles + 1]
        instruments, regressors = (np.column_stack([-each[:, 1:], known]) for each in (simulated, measured))
        theta = _instrumental(instruments, regressors, measured[:, 0])
        if not np.isfinite(theta).all():
            return None
        roots = np.roots(np.append(1.0, theta[:poles])).astype(complex)
        roots = -np.abs(roots.real) + 1j * roots.imag
        numerator = theta[poles:]
    return Guess(roots, delay, cost)


def _instrumental(instruments: FloatArray, regressors: FloatArray, target: FloatArray) -> FloatArray:
    """Solution of instruments^T (target - regressors theta) = 0; nan if no finite solution exists."""
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
    product = np.zeros((len(polynomials), polynomials.shape[1] + len(factor) - 1))
    for k, coefficient in enumerate(factor):
        product[:, k : k + polynomials.shape[1]] += coefficient[:, np.newaxis] * polynomials
    return product


@dataclass(frozen=True)
class UnitGain:
    """A structure whose numerator ends with ``den[n]``."""

    structure: Any  # of a transfer function, which makes this
    initial_state: ClassVar[tuple[float, ...]] = ()

    @property
    def shape(self) -> tuple[str, ...]:
        return tuple(f"num[{k}]" for k in range(self.structure.zeros))

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        """The denominator, the delay where it is free, and the numerator's shape; linear in the initial state."""
        for name in (*freedom.fixed, *freedom.bounds):
            if name.startswith("num["):
                raise ValueError(
                    f"{name!r} cannot be fixed or bounded: the numerator is searched with the gain one at rest"
                )
        own: SearchSpace = self.structure.search_space(record, freedom)
        numerator = self.structure.columns[: self.structure.zeros + 1]
        n_shape, n_own = self.structure.zeros, len(own.coordinates)
        lower, upper = (np.append(side, np.full(n_shape, end)) for side, end in
                        ((own.lower, -_WIDEST), (own.upper, _WIDEST)))  # fmt: skip
        starts = np.array([np.append(x, self._shape(x, own, record)) for x in own.starts]).reshape(-1, lower.size)

        def parameters(x: FloatArray) -> dict[str, FloatArray]:
            sets = np.atleast_2d(x)
            return self._parameters(own.parameters(sets[:, :n_own]), sets[:, n_own:])

        searched = tuple(name for name in own.names if name not in own.linear)
        return replace(
            own,
            coordinates=(*own.coordinates, *self.shape),
            lower=lower,
            upper=upper,
            starts=starts,
            names=(*searched, *self.shape, *(name for name in own.linear if name not in numerator)),
            columns=tuple(name for name in own.columns if name not in numerator),
            linear=tuple(name for name in own.linear if name not in numerator),
            parameters=parameters,
            drawn=_box_about_starts(starts, lower, upper) if len(starts) else None,
        )

    def filtered_sets(self, parameters: Parameters, signals: FloatArray, sample_time: float) -> FloatArray:
        """Outputs (n_sets, n_signals, n_samples) for the inputs `signals` of this shape, or (1, ...)."""
        monic = self.structure.monic(parameters)
        numerators = np.zeros((len(monic), monic.shape[1] + 1))
        for name in (*self.shape, f"num[{self.structure.zeros}]"):
            place = monic.shape[1] - self.structure.zeros + int(name[4:-1])
            numerators[:, place] = parameters[name]
        delay = parameters["delay"] if self.structure.delay is None else self.structure.delay
        delays = np.broadcast_to(np.asarray(delay, dtype=float), len(monic))
        plants = LinearPlants.of(monic, numerators, delays, sample_time)
        return plants.filtered(signals, **self.structure.sampling)

    def free_responses(self, parameters: Parameters, record: Record) -> FloatArray:
        """Columns of the initial state, (n_sets, n_samples, n)."""
        monic = self.structure.monic(parameters)
        return affine_columns(monic, record.u, record.sample_time, zeros=0, **self.structure.sampling)[..., 1:-1]

    def assemble(self, parameters: Mapping[str, float]) -> Any:
        return self.structure.assemble(parameters)

    def _parameters(self, values: dict[str, FloatArray], shape: FloatArray) -> dict[str, FloatArray]:
        """With the numerator; it is den_n in front of the last power."""
        m = self.structure.zeros
        end = values[self.structure.denominator[-1]]
        mean = end ** (1.0 / self.structure.poles)
        numerator = {f"num[{k}]": end * np.sinh(shape[:, k]) / mean ** (m - k) for k in range(m)}
        return values | numerator | {f"num[{m}]": end}

    def _shape(self, x: FloatArray, own: SearchSpace, record: Record) -> FloatArray:
        """Coordinates of the numerator that is best in front of the record, of one denominator."""
        values = own.parameters(x[np.newaxis])
        columns = self.structure.regressors(values, record)[0, :, :-1]
        m, n = self.structure.zeros, self.structure.poles
        columns = np.column_stack([columns[:, : m + 1], np.ones(len(record))])
        scale = np.linalg.norm(columns, axis=0)
        numerator = np.linalg.lstsq(columns / np.where(scale > 0.0, scale, 1.0), record.y, rcond=None)[0] / scale
        mean = float(values[self.structure.denominator[-1]][0]) ** (1.0 / n)
        ratios = numerator[:m] / (numerator[m] or 1.0) * mean ** np.arange(m, 0.0, -1.0)
        return np.asarray(np.clip(np.arcsinh(ratios), -_WIDEST, _WIDEST))


def _box_about_starts(starts: FloatArray, lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    reach = _NEAR * (upper - lower)
    return np.maximum(starts.min(axis=0) - reach, lower), np.minimum(starts.max(axis=0) + reach, upper)


def notes(record: Record, y: FloatArray, n_parameters: int) -> tuple[str, ...]:
    """Phrases on a plant with this output on the record, and so many coefficients."""
    phrases = []
    if np.unique(record.u).size <= len(record) // 2:
        low, high = record.u.min(), record.u.max()
        scaled = (2.0 * record.u - low - high) / ((high - low) or 1.0)
        columns = chebyshev.chebvander(scaled, min(n_parameters, np.unique(scaled).size) - 1)
        curve = columns @ np.linalg.lstsq(columns, record.y)[0]
        of_curve, of_plant = (record.y - curve) ** 2, (record.y - y) ** 2
        worse, is_clear = of_curve - of_plant, of_plant.mean() < _LEAST**2 * of_curve.mean()
        if not is_clear and worse.mean() <= _SURE * _stderr_of_mean(worse):
            fit = metrics.fit_percent(record.y, curve)
            phrases.append(f"a single-valued curve of u fits {fit:.1f} %: as well as this model within the noise")
    if _one_rate(record):
        phrases.append("the record holds one rate only: lag and hysteresis cannot be told apart")
    return tuple(phrases)


def _stderr_of_mean(values: FloatArray) -> float:
    n, off = values.size, values - values.mean()
    reach = int(np.cbrt(n))
    shares = 1.0 - np.arange(reach + 1) / (reach + 1)
    covariances = np.array([off[lag:] @ off[: n - lag] for lag in range(reach + 1)]) / n
    return float(np.sqrt(max(2.0 * shares @ covariances - covariances[0], 0.0) / n))


def _one_rate(record: Record) -> bool:
    branches = record.branches(_NOISE)
    changes = np.flatnonzero(np.append(True, np.diff(record.u) != 0.0))
    if len(branches) < 2 or np.diff(np.append(changes, len(record))).max() > _STILL:
        return False
    rates = [np.ptp(branch.u) / (len(branch) - 1) for branch in branches]
    return bool(max(rates) < _ONE_RATE * min(rates))
