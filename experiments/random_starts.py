"""`scipy.optimize.least_squares` from random starts on a law of hysim: the peer that default calls are held against.

The law that it calls is hysim's own, compiled and exact, and the record is scaled for it, the input to a largest value
of 1. What it does not know is where to begin: its starts are drawn in a box, positive parameters by their logarithm.
Its seconds are those of the processor, so that other work on the machine takes no starts from it.
"""

import contextlib
import time
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

import hysim as hs
from hysim.plot import Figure, figure

N_STARTS = 20
PATIENCE = 10.0  # times as long as the default call
REACHED = 1.01  # ratio of sums of squares

FloatArray = npt.NDArray[np.float64]
Box = dict[str, tuple[float, float]]
"""Name to (lowest, highest) of a start; by the logarithm where the lowest is positive."""

OFFSET: Box = {"offset": (-3.0, 3.0)}
OUTPUT: Box = {"gain": (-5.0, 5.0), "z0": (-1.0, 1.0)} | OFFSET
MEMORY: Box = {"beta": (0.02, 50.0), "gamma": (-20.0, 20.0), "n": (0.5, 5.0)}
COLEMAN_HODGDON: Box = {"alpha": (0.05, 100.0), "c": (-5.0, 5.0), "B": (-5.0, 5.0), "z0": (-2.0, 2.0)} | OFFSET
DAHL: Box = {"stiffness": (0.1, 1000.0), "coulomb": (0.01, 10.0), "z0": (-2.0, 2.0)} | OFFSET


def coefficients(n: int) -> Box:
    """Box of the polynomial in the input."""
    return {f"input_coefficients[{k}]": (-5.0, 5.0) for k in range(n)}


RATES: Box = {"delta_nu": (1e-3, 1.0), "delta_eta": (1e-3, 1.0)} | coefficients(1)
PINCH: Box = {"zeta_s": (0.01, 0.99), "q": (-0.5, 0.5), "p": (0.01, 10.0), "psi": (0.01, 2.0)}
PLAYS_WITH_DENSITY: Box = (
    {"exponent": (-0.9, 4.0), "decay": (0.01, 10.0), "weight": (-5.0, 5.0), "weight_slope": (-5.0, 5.0)}
    | coefficients(3)
    | OFFSET
)


def reaches(fit: hs.Identification, cost: float, least: float, n_parameters: int) -> bool:
    """Whether a default call's sum of squares is as good as another's with `n_parameters`: to 1 %, or by the BIC.

    A default call may leave out a parameter that the record does not show.
    """
    samples, saved = fit.residual.size, max(0, n_parameters - fit.n_parameters)
    return bool(cost <= REACHED * least or samples * np.log(cost / least) <= saved * np.log(samples))


def share_percent(rows: Sequence[Mapping[str, Any]], name: str) -> float:
    """Share of the cases of which a column is true."""
    return 100.0 * float(np.mean([row[name] for row in rows]))


def draw_cases(rows: Sequence[Mapping[str, Any]], places: Sequence[float], names: Sequence[str], unit: str) -> Figure:
    """Cost over the best known, and the seconds of the default call, each case at its place beside the names."""
    canvas = figure(height=5.6)
    above, below = canvas.subplots(2, 1, sharex=True)
    for row, place in zip(rows, places, strict=True):
        mark = {"marker": "o", "markersize": 3.5, "color": "#0072B2" if row["reached"] else "#D55E00"}
        above.plot(place, max(row["over_best_known"] - 1.0, 1e-12), **mark)
        below.plot(place, row["seconds"], **mark)
    above.axhline(REACHED - 1.0, color="#999999", linewidth=0.8)
    above.set(yscale="log", ylabel="Sum of squares over\nthe best known, less 1")
    below.set(yscale="log", ylabel=f"Default call [{unit}]")
    below.set_xticks(range(len(names)), names, rotation=20, ha="right")
    return canvas


class Descents(NamedTuple):
    """The least sum of squares of several descents, how many there were, and their seconds."""

    cost: float
    n: int
    seconds: float


class Peer(NamedTuple):
    """A law that is fitted to a scaled record; parameters without a box stay as they are in `law`.

    A descent may leave the box of its start by the width of the box, but not the `limits`.
    """

    law: Any
    box: Box
    u: FloatArray
    y: FloatArray
    limits: Mapping[str, tuple[float, float]] = MappingProxyType({})

    @property
    def ends(self) -> FloatArray:
        """Both ends of the box, shape (2, n_parameters), by the logarithm where the lower is positive."""
        return np.array([np.log(pair) if pair[0] > 0.0 else pair for pair in self.box.values()]).T

    @property
    def outermost(self) -> FloatArray:
        """Both limits of each parameter, shape (2, n_parameters), by the logarithm where the box is."""
        pairs = [
            self.limits.get(name, (0.0 if log else -np.inf, np.inf))
            for name, log in zip(self.box, self.logs, strict=True)
        ]
        with np.errstate(divide="ignore"):
            return np.array([np.log(pair) if log else pair for pair, log in zip(pairs, self.logs, strict=True)]).T

    @property
    def logs(self) -> npt.NDArray[np.bool_]:
        """Whether each parameter is searched by its logarithm, shape (n_parameters,)."""
        return np.array([pair[0] > 0.0 for pair in self.box.values()])

    @property
    def own(self) -> FloatArray:
        """The law's own values, shape (n_parameters,)."""
        return np.array([self.law.scalars[name] for name in self.box])

    def from_law(self, seconds: float = np.inf) -> float:
        """Least sum of squares of a descent from the law's own parameters, to its end or until the time is over.

        One that is searched by its logarithm and is zero in the law begins at its box's lower end.
        """
        own, lowest = self.own, np.array([pair[0] for pair in self.box.values()])
        sizes = np.where(self.logs & (own != 0.0), np.abs(own), np.where(self.logs, lowest, 1.0))
        x, signs = np.where(self.logs, np.log(sizes), own), np.where(own < 0.0, -1.0, 1.0)
        return self.descend(x, signs, until=time.process_time() + seconds)

    def from_random_starts(self, rng: np.random.Generator, seconds: float) -> Descents:
        """The best of `N_STARTS` descents, or of as many as `seconds` are enough for; the last one may be cut off.

        Where a parameter that is searched by its logarithm is negative in the law, every other descent has its sign.
        """
        begin, best, n = time.process_time(), np.inf, 0
        while n < N_STARTS and time.process_time() - begin < seconds:
            signs = np.where((self.own < 0.0) & (n % 2 == 0), -1.0, 1.0)
            best = min(best, self.descend(rng.uniform(*self.ends), signs, until=begin + seconds))
            n += 1
        return Descents(best, n, time.process_time() - begin)

    def descend(self, x: FloatArray, signs: FloatArray, until: float = np.inf) -> float:
        """Least sum of squares of all that a descent tried, to its end or until the time is over.

        `signs` are those of the parameters that are searched by the logarithm.
        """
        lower, upper = self.ends
        best, known = np.inf, self.law.scalars

        def residual(x: FloatArray) -> FloatArray:
            nonlocal best
            if time.process_time() > until:
                raise TimeoutError
            values = np.where(self.logs, signs * np.exp(np.where(self.logs, x, 0.0)), x)
            try:
                law = self.law.assemble({**known, **dict(zip(self.box, values.tolist(), strict=True))})
                difference = law.response(self.u) - self.y
            except (hs.SimulationError, ValueError):
                return np.full(self.y.size, 1e3)
            best = min(best, float(np.sum(difference**2)))
            return np.asarray(difference)

        wide, (lowest, highest) = np.maximum(upper - lower, 1e-9), self.outermost
        bounds = np.maximum(np.minimum(lower, x - wide), lowest), np.minimum(np.maximum(upper, x + wide), highest)
        with contextlib.suppress(TimeoutError):
            least_squares(residual, np.clip(x, *bounds), bounds=bounds, x_scale="jac")
        return best
