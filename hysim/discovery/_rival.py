"""The linear rival of a law: a plant without hysteresis, but with dynamics, fitted to the same records.

    y = offset + G(s) u + free response,    G of the orders in ORDERS, or a line

The input is linear between its samples. Each record has its own initial state, all share G and the offset.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hysim import metrics
from hysim._frozen import FloatArray, checked
from hysim.errors import SimulationError
from hysim.identification import identify
from hysim.metrics.criteria import information
from hysim.models.protocols import Identifiable
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.plants.transfer_function import FREQUENCY, TransferFunction, TransferFunctionStructure
from hysim.records import Record

ORDERS = ((1, 0), (1, 1), (2, 0), (2, 1))  # poles, zeros
FLOOR = 1e-6  # strokes: smaller residuals are no evidence
_FREQUENCIES, _DAMPINGS = 16, (0.03, 0.3, 1.0, 3.0)  # of the points that are tried
_DESCENDING = 3  # of them, the best
_PER_PARAMETER = 3  # samples


@checked
class WeightedRecord(Record):
    """A record whose samples are left out by `shares` (n,) of 0, which multiply its output and its regressors."""

    shares: FloatArray


@dataclass(frozen=True)
class Rival:
    """A linear plant with an offset, fitted to records; `plants` differ in the initial state alone."""

    plants: tuple[TransferFunction, ...]
    offset: float
    bic: float

    @property
    def is_line(self) -> bool:
        return self.plants[0].order == 0

    def outputs(self, records: Sequence[Record]) -> list[FloatArray]:
        pairs = zip(self.plants, records, strict=True)
        return [self.offset + plant.response(record.u, record.sample_time) for plant, record in pairs]

    def refitted(self, records: Sequence[Record], weights: Sequence[FloatArray]) -> "Rival":
        """Fit of the same orders to the samples whose weights are not zero, which begins here."""
        plant = self.plants[0]
        if self.is_line:
            return _line(records, weights)
        return _identified(records, weights, plant.order, len(plant.num) - 1, plant)


def rival(records: Sequence[Record]) -> Rival:
    everything = [np.ones(len(record)) for record in records]
    most = sum(len(record) for record in records) // _PER_PARAMETER
    orders = [(poles, zeros) for poles, zeros in ORDERS if poles * (1 + len(records)) + zeros + 2 <= most]
    plants = [_identified(records, everything, poles, zeros) for poles, zeros in orders]
    return min([_line(records, everything), *plants], key=lambda plant: plant.bic)


def steady_width(plant: TransferFunction, cycle: Record, rate: float) -> float:
    """Relative width of the plant's steady loop where the cycle runs at `rate` times its rate; nan where it has none.

    The coefficients of prod (x - exp(p T)), p the poles, take the free response out of as many periods and one more.
    """
    step, u = cycle.sample_time / rate, cycle.u[:-1]
    taken = np.atleast_1d(np.poly(np.exp(plant.poles * step * u.size))).real[::-1]
    try:
        periods = plant.response(np.tile(u - u.mean(), plant.order + 1), step).reshape(-1, u.size)
    except SimulationError:
        return float("nan")
    y = taken @ periods / taken.sum()
    return metrics.loop_metrics(np.append(u, u[0]), np.append(y, y[0])).relative_width


@dataclass(frozen=True)
class _Affine(Identifiable):
    """A transfer function with an offset, as `identify` takes it; the search begins at `start`, if given."""

    structure: TransferFunctionStructure
    records: Sequence[Record]
    start: TransferFunction | None = None

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        finest = min(self.records, key=lambda each: each.sample_time)
        longest = max(len(each) * each.sample_time for each in self.records)
        own = self.structure.search_space(finest, freedom)
        slowest = np.log(FREQUENCY[0] * finest.sample_time / longest)
        lower = np.where([name.startswith("log damping") for name in own.coordinates], own.lower, slowest)
        own = replace(own, lower=lower)
        starts = self._scanned(own) if self.start is None else _coordinates(self.start, finest.sample_time)
        return replace(
            own,
            starts=np.clip(starts, lower, own.upper),
            screened=0,
            names=(*own.names, "offset"),
            columns=(*own.columns, "offset"),
            linear=(*own.linear, "offset"),
        )

    def regressors(self, parameters: Parameters, record: Record) -> FloatArray:
        columns = np.insert(self.structure.regressors(parameters, record), -1, 1.0, axis=-1)
        return columns * record.shares[:, np.newaxis] if isinstance(record, WeightedRecord) else columns

    def assemble(self, parameters: Mapping[str, float]) -> TransferFunction:
        return self.structure.assemble(parameters)

    def _scanned(self, own: SearchSpace) -> FloatArray:
        """The best points (n, n_x) of a grid over the box, each record with a numerator and an offset of its own."""
        axes = [np.linspace(own.lower[0], own.upper[0], _FREQUENCIES), np.log(_DAMPINGS)][: own.lower.size]
        points = np.stack([axis.ravel() for axis in np.meshgrid(*axes)], axis=1)
        costs = np.zeros(len(points))
        for record in self.records:
            basis = np.linalg.qr(self.regressors(own.parameters(points), record)[..., :-1])[0]
            costs += np.sum((record.y - (basis @ (record.y @ basis)[..., np.newaxis])[..., 0]) ** 2, axis=1)
        return points[np.argsort(costs, kind="stable")[:_DESCENDING]]


def _coordinates(plant: TransferFunction, sample_time: float) -> FloatArray:
    sizes = np.array(plant.den[1:]) * sample_time ** np.arange(1, len(plant.den))
    frequency = np.sqrt(sizes[-1])
    place = sizes if sizes.size == 1 else [frequency, sizes[0] / (2.0 * frequency)]
    return np.asarray(np.log(place))[np.newaxis]


def _identified(
    records: Sequence[Record],
    weights: Sequence[FloatArray],
    poles: int,
    zeros: int,
    start: TransferFunction | None = None,
) -> Rival:
    structure = TransferFunction.structure(poles=poles, zeros=zeros, hold="foh", initial="free")
    weighted = [
        WeightedRecord(u=record.u, y=record.y * shares, t=record.t, shares=shares)
        for record, shares in zip(records, weights, strict=True)
    ]
    fit = identify(_Affine(structure, records, start), weighted)
    return Rival(fit.models, fit.estimates["offset"], _information(records, fit.residual, fit.n_parameters))


def _line(records: Sequence[Record], weights: Sequence[FloatArray]) -> Rival:
    u = np.concatenate([record.u for record in records])
    y = np.concatenate([record.y for record in records])
    shares = np.concatenate(weights)
    mean = float(shares @ u / shares.sum())  # so that the columns are orthogonal
    columns = np.stack([u - mean, np.ones(u.size)], axis=1)
    slope, level = np.linalg.lstsq(columns * shares[:, np.newaxis], y * shares)[0].tolist()
    plants = (TransferFunction(num=(slope,), den=(1.0,), hold="foh"),) * len(records)
    return Rival(plants, level - slope * mean, _information(records, y - columns @ [slope, level], 2))


def _information(records: Sequence[Record], residual: FloatArray, n_parameters: int) -> float:
    stroke = max(float(np.ptp(record.y)) for record in records)
    return information(float(np.mean(residual**2)), residual.size, n_parameters, floor=FLOOR * stroke)
