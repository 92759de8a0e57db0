"""The field of a core by its flux density, by the rate of it and by the temperature: a law linear in its weights.

It is fitted by ridge regression. With the terms F of all records, of size one, and the weights p of the samples,

    w = argmin sum_k p_k (y_k - F_k w)^2 + lambda sum_j w_j^2

where lambda is the one that predicts best the records that are left out. The begin of each of them then corrects its
weights, see `condition`, by the spread that predicts best its rest. We chose the constants below on simulated cores
(experiments/59_cores.py).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_one_each, check_whole, checked
from hysim._basics.results import model_of
from hysim._columns.channels import value_in
from hysim.kernels import core_losses as kernels
from hysim.laws.friction.rated_law import TimedLaw
from hysim.models.dependent import Dependent, on_record
from hysim.models.model import Example, family
from hysim.models.protocols import DirectFit
from hysim.models.tables import Tables, check_increasing
from hysim.models.varying import ChannelPolynomial, places
from hysim.models.varying import weights as weights_at
from hysim.records import Record, as_record, by_record, span_of

_STRENGTHS = np.logspace(-12.0, 0.0, 25)  # of the ridge, in rows: from rounding of the terms to a prior of noise's size
_SPREADS = np.append(0.0, np.logspace(-3.0, 0.0, 7))  # of the weights, in standard deviations of the noise
_LAGS = np.array([0.5, 4.0, 32.0])  # sample times: the first one is nearly the rate itself
_SMALLEST = 0.005  # threshold, of the largest flux density
_MOST_OF_RANGE = 0.8  # so that samples remain, whose stops near the range itself differ little
_MOST_FOLDS = 5
_AT_ONCE = 50_000  # samples, to bound the memory
Fold = npt.NDArray[np.intp]


@family
class CoreField(TimedLaw):
    """Field of a core by its flux density: stops, lags and their roots, each times powers of the flux density.

    ::

        x   = u / size
        y   = c_0 + c_1 x + c_3 x^3 + ... + c_9 x^9
              + sum_i (a_i0 + a_i1 x^2 + a_i2 b_i^2) b_i        b_i = s_i / r_i
              + sum_j (e_j0 + e_j1 x^2 + e_j2 x^4) v_j          v_j = d_j / D_j, or its root
        s_i   the stop of u with the threshold r_i:  moves with u, from -r_i to r_i
        d_j   what u is ahead of itself with a lag:  d_j' = u' - d_j / tau_j

    u is the flux density B and y the field H. Stops are the memory, lags the rate (for a slow input d_j is tau_j dB/dt,
    that of eddy currents), and the roots excess losses. Where u is linear between the samples all of them are exact, so
    that more samples on a stroke change nothing. The law is linear in its weights, which `hysim.identify` finds in one
    step, for the stops and lags of a `structure`, not of an instance; with a channel the model is a `hysim.Dependent`.
    `hysim.condition` corrects the weights by a stretch of a sequence that is known.

    Parameters
    ----------
    size : float
        Largest flux density of the records, positive [unit of u].
    spread : float
        Standard deviation of the weights from core to core over that of the noise, not negative; for `condition`.
    thresholds : sequence of float, length m
        r_i, positive and increasing [unit of u].
    lags : sequence of float, length n
        tau_j, positive and increasing [s].
    lag_sizes : sequence of float, length n
        D_j, the size that d_j had on the records, positive [unit of u].
    weights : sequence of float, length 3 (m + 2 n) + 6
        c_0, c_1, c_3, ..., c_9, then those of each stop, lag and root [unit of y].

    Raises
    ------
    ValueError
        If a number is outside its limits or a length does not fit.

    Notes
    -----
    At the first sample all stops and lags are at zero. The combination is our own, of stops (M. Krasnosel'skii and A.
    Pokrovskii, Systems with Hysteresis, 1989) and parts of the losses (G. Bertotti, IEEE Trans. Magn. 24 (1988) 621).

    Examples
    --------
    >>> import hysim as hs
    >>> core = hs.CoreField(thresholds=(0.1,), weights=(0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 10.0, 0.0, 0.0))
    >>> core.response([0.0, 0.05, 0.3, 0.2], sample_time=1.0).round(6).tolist()
    [0.0, 5.25, 11.5, 1.0]
    """

    size: float = 1.0
    spread: float = 0.0
    thresholds: tuple[float, ...] = ()
    lags: tuple[float, ...] = ()
    lag_sizes: tuple[float, ...] = ()
    weights: tuple[float, ...] = (0.0,) * kernels.N_ALONE

    initial: ClassVar[tuple[str, ...]] = ()
    positive = ("size", "thresholds", "lags", "lag_sizes")
    not_negative = ("spread",)
    example = Example(
        {
            "thresholds": (0.1, 0.4), "lags": (0.02,), "lag_sizes": (0.2,),
            "weights": (0.0, 20.0, 40.0, 0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 5.0, 2.0, 0.0, 3.0, 0.0, 0.0, 1.0, 0.0, 0.0),
        },
        title="Magnetic core: field by flux density",
        group="Magnetic cores",
        units={"u": "T", "y": "A/m"},
        kind="sine",
    )  # fmt: skip
    step = staticmethod(kernels.field)

    @classmethod
    def check(cls, tables: Tables) -> None:
        super().check(tables)
        m, n, n_weights = (tables[each].shape[1] for each in ("thresholds", "lags", "weights"))
        check_one_each("lag_sizes", tables["lag_sizes"].T, n, "lags")
        if n_weights != (wanted := kernels.N_POWERS * (m + 2 * n) + kernels.N_ALONE):
            raise ValueError(f"{m} stops and {n} lags need {wanted} weights, got {n_weights}")
        for name in ("thresholds", "lags"):
            check_increasing(name, tables[name])

    @classmethod
    def further(cls, tables: Tables) -> int:
        """The stops and what the input is ahead of its lags."""
        return int(tables["thresholds"].shape[1] + tables["lags"].shape[1])

    @classmethod
    def structure(
        cls,
        *,
        stops: int = 16,
        lags: Sequence[float] | None = None,
        channel: str | None = None,
        degree: int = 2,
        known: float = 0.1,
    ) -> "CoreFieldStructure":
        """The stops, lags and channel of a law for `hysim.identify`, which fits it by ridge regression.

        Parameters
        ----------
        stops : int
            Number of stops, with thresholds in even ratios from 0.5 % of the largest flux density up to it.
        lags : sequence of float, optional
            [s]; by default 0.5, 4 and 32 sample times of the first record.
        channel : str, optional
            Name of a channel, such as the temperature, on which all weights depend.
        degree : int
            Degree of that polynomial; less where the records have fewer values of the channel.
        known : float
            Share of each record at its begin that is known when the rest is predicted, from 0 to less than 1. It tells
            how much the weights differ from core to core, the `spread`.

        Returns
        -------
        CoreFieldStructure
            Its fit chooses the strength of the ridge by records that are left out (by blocks of a single record).

        Raises
        ------
        ValueError, TypeError
            If a number is not of its kind, or outside its limits.

        Examples
        --------
        >>> import numpy as np
        >>> import hysim as hs
        >>> B = hs.signals.triangle(-0.3, 0.3, cycles=3, samples_per_cycle=100)
        >>> core = hs.CoreField(thresholds=(0.05,), weights=(0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 20.0, 0.0, 0.0))
        >>> record = hs.Record(u=B, y=core.response(B, 1e-6), t=1e-6 * np.arange(B.size))
        >>> fit = hs.identify(hs.CoreField.structure(lags=()), record)
        >>> round(fit.fit_percent)
        100
        """
        return CoreFieldStructure(law=cls, stops=stops, lags=lags, channel=channel, degree=degree, known=known)

    @classmethod
    def fitted(cls, records: Sequence[Record], weights: FloatArray | None = None) -> DirectFit:
        return cls.structure().fitted(records, weights)

    def memory(self, u: npt.ArrayLike, sample_time: float) -> FloatArray:
        return self.at_sample_time(sample_time).remembered(u)

    def terms(self, record: Record) -> FloatArray:
        """The factors of the weights at the samples of a record, shape (n_samples, n_weights)."""
        return self._terms(record.u, self.memory(record.u, record.sample_time))

    def _terms(self, u: FloatArray, state: FloatArray) -> FloatArray:
        m, x = len(self.thresholds), u[:, np.newaxis] / self.size
        ahead = state[:, m:] / self.lag_sizes if self.lags else state[:, m:]
        stops = state[:, :m] / self.thresholds if m else state[:, :m]
        parts = np.hstack([stops, ahead, np.copysign(np.sqrt(np.abs(ahead)), ahead)])
        last = np.hstack([stops**2, np.broadcast_to(x**4, (len(x), 2 * len(self.lags)))])
        alone = x ** np.append(0.0, np.arange(1.0, 2.0 * kernels.N_ALONE - 2.0, 2.0))
        memories = np.stack([parts, parts * x**2, parts * last], axis=-1)
        return np.hstack([alone, memories.reshape(len(x), -1)])

    def conditioned(self, known: Record) -> Self:
        """The law with the weights that a known stretch makes most likely; see `hysim.condition`."""
        tells = settled(known.u, np.array(self.thresholds))
        weights = corrected(np.array(self.weights), self.terms(known)[tells], known.y[tells], self.spread)
        return replace(self, weights=tuple(weights.tolist()))


def condition(model: Any, known: Record) -> CoreField:
    """A core's law with its weights corrected by a stretch that is known, to predict what follows.

    A gain of all weights and a constant are free; each weight is then normal with a standard deviation of
    `CoreField.spread` times that of the noise, and the most likely ones are those of a Bayesian update. A stretch of
    less than a cycle cannot distinguish a gain from a constant: the prediction may then be several times worse.

    Parameters
    ----------
    model : CoreField, Dependent of it, or a result with one
        As `hysim.identify` returns it.
    known : Record
        Flux density and field of the stretch, from the first sample on; a channel must be constant.

    Returns
    -------
    CoreField
        At the channel of the known stretch. Its response to the whole sequence continues the stretch.

    Raises
    ------
    TypeError
        If the model is no such law, or the channel varies.

    Examples
    --------
    >>> import hysim as hs
    >>> B = hs.signals.triangle(-0.3, 0.3, cycles=1, samples_per_cycle=100)
    >>> core = hs.CoreField(weights=(0.0, 50.0, 0.0, 0.0, 0.0, 0.0), spread=10.0)
    >>> known = hs.Record(u=B[:60], y=60.0 * B[:60], t=[1e-6 * k for k in range(60)])
    >>> round(float(hs.condition(core, known).response([0.0, 0.1], 1e-6)[1]), 1)
    6.0
    """
    record = as_record(known, "condition")
    if record is None:
        raise TypeError(f"condition takes a Record of the known stretch, got {type(known).__name__}")
    law = on_record(model_of(model), record)
    if not isinstance(law, CoreField):
        raise TypeError(
            f"condition takes a CoreField at a constant channel, got a {type(model_of(model)).__name__} on this record"
        )
    return law.conditioned(record)


@checked
class CoreFieldStructure:
    """A core's field to be identified; see `CoreField.structure`."""

    law: Any
    stops: int = 16
    lags: Sequence[float] | None = None
    channel: str | None = None
    degree: int = 2
    known: float = 0.1

    def __post_init__(self) -> None:
        check_whole(self.stops, "stops", least=0)
        check_whole(self.degree, "degree", least=0)
        if not 0.0 <= self.known < 1.0:
            raise ValueError(f"known must be from 0 to less than 1, got {self.known}")

    def fitted(self, records: Sequence[Record], weights: FloatArray | None = None) -> DirectFit:
        """The fit to the fields of records, with a weight for each of their samples (n,).

        Raises ValueError if a record has no even time or not the channel, or the flux density is constant.
        """
        law, at = self._begun(records), self._places(records)
        n = sum(map(len, records))
        shares = by_record(np.ones(n) if weights is None else weights, records)
        if np.count_nonzero(np.concatenate(shares)) < len(law.weights):
            raise ValueError(f"{n} samples tell too little of {len(law.weights)} weights: take fewer stops")
        folds = _folds([len(record) for record in records])
        of_records = zip(records, shares, folds, strict=True)
        normal = _Normal.of(
            (rows, record.y[k], share[k], own[k])
            for record, share, own in of_records
            for k, rows in self._rows(law, at, record)
        )
        paths = [normal.solutions(fold)[0] for fold in range(len(normal.squares))]
        errors = [normal.errors(path, fold) for fold, path in enumerate(paths)]
        best = int(np.argmin(np.sum(errors, axis=0)))
        if len(records) > 1 and self.known > 0.0:
            of_rest = [path[best] for path in paths]
            every = zip(records, shares, folds, strict=True)
            costs = [self._conditioned(law, at, record, share, of_rest[own[0]]) for record, share, own in every]
            law = replace(law, spread=float(_SPREADS[np.argmin(np.sum(costs, axis=0))]))
        path, values, vectors = normal.solutions(None)
        model, damped = self._model(law, at, path[best]), values + normal.ridge(_STRENGTHS[best])
        half = vectors * np.sqrt(np.maximum(values, 0.0)) / damped
        pieces = (rows for record in records for _, rows in self._rows(law, at, record))
        spread = [np.linalg.norm(rows @ half, axis=1) for rows in pieces]
        words = f"ridge of {_STRENGTHS[best]:.2g}, spread {law.spread:.2g} of the weights over the noise"
        return DirectFit((model,) * len(records), float(np.sum(values / damped)), np.concatenate(spread), words)

    def _begun(self, records: Sequence[Record]) -> Any:
        """The law without weights: where its stops and lags stand."""
        size = max(float(np.abs(record.u).max()) for record in records)
        span_of(*records)  # which raises
        thresholds = size * np.geomspace(_SMALLEST, 1.0, self.stops)
        lags = records[0].sample_time * _LAGS if self.lags is None else np.array(self.lags)
        weights = (0.0,) * (kernels.N_POWERS * (self.stops + 2 * lags.size) + kernels.N_ALONE)
        law = self.law(size=size, thresholds=thresholds, lags=lags, lag_sizes=np.ones(lags.size), weights=weights)
        ahead = np.concatenate([law.memory(record.u, record.sample_time)[:, self.stops :] for record in records])
        return replace(law, lag_sizes=np.sqrt(np.mean(ahead**2, axis=0)))

    def _places(self, records: Sequence[Record]) -> tuple[float, ...]:
        """Places of the polynomials of the channel; a single one without a channel."""
        if self.channel is None:
            return (0.0,)
        values = np.unique(np.concatenate([np.ravel(self._channel(record)) for record in records]))
        return places(float(values[0]), float(values[-1]), min(self.degree, values.size - 1))

    def _channel(self, record: Record) -> FloatArray:
        return np.asarray(0.0 if self.channel is None else value_in(record.channels, self.channel, "the record"))

    def _rows(self, law: Any, at: tuple[float, ...], record: Record) -> Iterator[tuple[slice, FloatArray]]:
        """Some samples at a time, and their terms times the polynomials of the channel, (n, n_weights * n_places)."""
        along = np.broadcast_to(weights_at(at, self._channel(record)), (len(record), len(at)))
        state = law.memory(record.u, record.sample_time)
        for first in range(0, len(record), _AT_ONCE):
            k = slice(first, first + _AT_ONCE)
            rows = law._terms(record.u[k], state[k])[..., np.newaxis] * along[k, np.newaxis]
            yield k, rows.reshape(len(rows), -1)

    def _conditioned(
        self, law: Any, at: tuple[float, ...], record: Record, share: FloatArray, solution: FloatArray
    ) -> FloatArray:
        """Squared error of the rest of a record for each of the `_SPREADS`, by weights without it and its begin."""
        terms, values = law.terms(record), solution.reshape(-1, len(at))
        own = values @ np.mean(np.atleast_2d(weights_at(at, self._channel(record))), axis=0)
        begin = np.flatnonzero(np.arange(len(record)) < self.known * len(record))
        tells = begin[settled(record.u[begin], law.thresholds)]
        errors = [record.y - terms @ corrected(own, terms[tells], record.y[tells], spread) for spread in _SPREADS]
        return np.array(errors) ** 2 @ share

    def _model(self, law: Any, at: tuple[float, ...], solution: FloatArray) -> Any:
        values = solution.reshape(-1, len(at))
        law = replace(law, weights=tuple(values[:, 0].tolist()))
        if self.channel is None:
            return law
        named = [
            ChannelPolynomial(parameter=f"weights[{j}]", channel=self.channel, at=at, values=row)
            for j, row in enumerate(map(tuple, values.tolist()))
        ]
        return Dependent(law=law, polynomials=tuple(named))


def settled(u: FloatArray, thresholds: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Whether samples tell about the law: stops up to most of the input's range have forgotten what was before it."""
    reach = np.maximum.accumulate(u) - np.minimum.accumulate(u)
    widths = 2.0 * np.asarray(thresholds)
    return np.asarray(reach >= widths[widths <= _MOST_OF_RANGE * reach[-1]].max(initial=0.0))


def corrected(own: FloatArray, terms: FloatArray, y: FloatArray, spread: float) -> FloatArray:
    """Weights (n,) near a multiple of their `own` values, by terms (n_samples, n) and the field y there.

    They are ``g own + d`` with the least ``|y - terms (g own + d)|^2 + |d / spread|^2`` over the gain g and changes d.
    The constant is free, too, since stops that the sequence does not move to their ends leave one.
    """
    rows = np.column_stack([terms @ own, terms[:, 0], spread * terms])
    ridge = np.diag(np.append([0.0, 0.0], np.ones(own.size)))
    gain, constant, *changes = np.linalg.lstsq(rows.T @ rows + ridge, rows.T @ y, rcond=None)[0]
    return np.asarray(gain * own + spread * np.array(changes) + constant * np.eye(own.size)[0])


class _Normal(NamedTuple):
    """Normal equations of the folds, F' P F (n_folds, n, n), F' P y (n_folds, n), y' P y (n_folds,); the sum of P."""

    gram: FloatArray
    right: FloatArray
    squares: FloatArray
    total: float

    @classmethod
    def of(cls, pieces: Iterable[tuple[FloatArray, FloatArray, FloatArray, Fold]]) -> "_Normal":
        """Sums over pieces of the samples: rows (n, n_weights), outputs, shares and folds (n,)."""
        sums: dict[int, Any] = {}
        for rows, y, share, own in pieces:
            for fold in np.unique(own).tolist():
                k = own == fold
                some, weighted = rows[k], rows[k] * share[k, np.newaxis]
                added = weighted.T @ some, weighted.T @ y[k], share[k] @ y[k] ** 2, share[k].sum()
                sums[fold] = [old + new for old, new in zip(sums.get(fold, (0.0,) * 4), added, strict=True)]
        gram, right, squares, total = (np.array([sums[fold][k] for fold in sorted(sums)]) for k in range(4))
        return cls(gram, right, squares, float(total.sum()))

    def ridge(self, strength: npt.ArrayLike) -> FloatArray:
        return np.asarray(np.asarray(strength) * self.total)

    def solutions(self, without: int | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The weights of each of the `_STRENGTHS` by all folds but one, and the spectrum of their matrix."""
        others = [fold for fold in range(len(self.squares)) if fold != without]
        values, vectors = np.linalg.eigh(self.gram[others].sum(axis=0))
        right = vectors.T @ self.right[others].sum(axis=0)
        return right / (values + self.ridge(_STRENGTHS)[:, np.newaxis]) @ vectors.T, values, vectors

    def errors(self, solutions: FloatArray, fold: int) -> FloatArray:
        """Squared error of a fold for each of several `solutions`."""
        fitted = np.einsum("ij,jk,ik->i", solutions, self.gram[fold], solutions)
        return np.asarray(self.squares[fold] - 2.0 * solutions @ self.right[fold] + fitted)


def _folds(sizes: Sequence[int]) -> list[Fold]:
    """The fold of each sample: of its record, or of its block in a single record."""
    if len(sizes) == 1:
        return [np.arange(sizes[0]) * _MOST_FOLDS // sizes[0]]
    return [np.full(size, k % _MOST_FOLDS) for k, size in enumerate(sizes)]
