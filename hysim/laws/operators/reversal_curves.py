"""First-order reversal curves: their Everett function, and their density by local regression.

A curve turns at an input a on its way up from the lowest one and falls: y(a, b) is its output at b. Curves that rise
are those of a record turned by 180 degrees.

**The Everett function** of curves that turn at a_m, at each of their samples b, is

    E(a_m, b) = (y(a_m, a_m) - y(a_m, b)) / 2

Between two curves, with t = (a - a_m) / (a_(m+1) - a_m),

    E(a, b) = (1 - t) E(a_m, b) + t E(a_(m+1), b) + r(a) c(b)     for b up to a_m
    E(a, b) = t E(a_(m+1), b') + r(a) c(b')                       for b from a_m to a, b' stretched to end at a_(m+1)

r(a) is half of what the output on the rise to a_(m+1) is above a straight line from a_m. The relays between the curves
have it in proportion to their weights' sizes: c(b) is the total variation of E(a_(m+1), .) - E(a_m, .) above b over
that above the lowest input. So the rise is met as well as the curves, and a law whose density is even between the
turning points is returned exactly, whatever the levels.

**The density** of relays is half the mixed derivative of y. Around (a, b) the outputs are a polynomial of the second
degree in both, by least squares with weights (1 - |x|^3)^3 in the distances x in units of a reach

    (s + 1 + g (a - b) / 2 d) d                 d: distance of neighbouring curves, s: smoothing, g: its growth

so that the far, weak part of a diagram may be smoother than its ridge. s and g are the smoothest of a table whose error
at left-out curves, every fifth in turn, is the least within its standard error. Standard errors are of local residuals.

Outputs at the lowest input, where each rise begins, show a drift: where they move more than their differences from
curve to curve say (J. von Neumann, Ann. Math. Statist. 12, 1941), their running mean is subtracted. Sources: R. J.
Harrison, J. M. Feinberg, Geochem. Geophys. Geosyst. 9, Q05016 (2008), for local regression on curves; R. Egli, Glob.
Planet. Change 110 (2013), for a smoothing that grows.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray, check_positive, read_only
from hysim._basics.printing import extent, frozen_result, quantity, summary_text
from hysim._columns.turning import TOLERANCE
from hysim.records import Record

FEWEST = 10
"""Curves for a choice of the smoothing."""
_MOST_LEVELS = 100  # beside turning points
_MOST_SMOOTH = 240  # levels of smooth curves
_CLOSEST = 1e-3  # distance of levels, as a fraction of the span
_TOO_FEW = "the curves are too few or too short for a local regression over the distance of neighbours"
_EVERY = 5  # curves, of which one is left out
_TARGETS = 200  # samples of left-out curves at most, of each fifth
_SMOOTHINGS = [(s, g) for g in (0.0, 0.1) for s in (1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0)]
_NODES = 120  # of a diagram along each threshold, at most
_JUMP = 3.0  # distances of curves, by which the last sample of a curve is the next calibration point
_RUNNING = 5  # curves, over which a drift is the mean
_MOVES = 2.0  # times the variance of noise: that of outputs at the lowest input which drift
_TERMS = 6
_SINGULAR = 1e-6  # of the largest diagonal element of R: a regression that the samples around do not determine
_OF_PEAK = 0.1  # least density of the ridge
_CLEAR = 3.0  # standard errors, above which a density is not noise
_ROUNDING = 100.0 * np.finfo(float).eps  # of the stroke over a squared step, the least density: below is rounding


@frozen_result
class Forc:
    """The density of relays that first-order reversal curves measure; nan where they do not reach.

    Parameters
    ----------
    levels : array, shape (n,)
        Thresholds, in even steps [unit of u].
    density, stderr : array, shape (n, n)
        Weight of relays over area, and its standard error, at upper thresholds along axis 0 and lower ones along axis
        1, both at `levels` [unit of y / unit of u^2]. The standard error leaves out the bias of the smoothing, which
        flattens peaks.
    smoothing, growth : float
        Reach of the regression beyond the first curve, and its gain per curve from the diagonal [curve distances].
    left_out : float
        Rms error of the outputs at curves left out, every fifth in turn [unit of y]; nan for a given smoothing.
    stroke, n_curves : float, and int
        Largest less smallest output of all curves [unit of y], and their number.
    drift, noise : float
        Span of the drift of the outputs where the curves begin, and their standard deviation from curve to curve [unit
        of y]; nan where fewer than three curves begin at an extreme of the record.
    """

    levels: FloatArray
    density: FloatArray
    stderr: FloatArray
    smoothing: float
    growth: float
    left_out: float
    stroke: float
    n_curves: int
    drift: float
    noise: float

    @property
    def peak(self) -> tuple[float, float]:
        """Upper and lower threshold of the largest density less three standard errors [unit of u]."""
        least = self.density - _CLEAR * self.stderr
        a, b = np.unravel_index(int(np.nanargmax(least)), least.shape)
        return float(self.levels[a]), float(self.levels[b])

    @property
    def ridge(self) -> FloatArray:
        """Half distances, middles, densities and standard errors (m, 4) of the largest densities at each distance.

        A distance has a row if a density is above three standard errors, a tenth of the peak's and rounding there.
        """
        rounding = _ROUNDING * self.stroke / (self.levels[1] - self.levels[0]) ** 2
        rows, least = [], max(_OF_PEAK * float(np.nanmax(self.density - _CLEAR * self.stderr)), rounding)
        for k in range(self.levels.size):
            density, stderr = np.diagonal(self.density, -k), np.diagonal(self.stderr, -k)
            clear = np.where(density > np.maximum(_CLEAR * stderr, least), density, -np.inf)
            j = int(clear.argmax())
            if np.isfinite(clear[j]):
                a, b = self.levels[j + k], self.levels[j]
                rows.append(((a - b) / 2.0, (a + b) / 2.0, density[j], stderr[j]))
        return np.reshape(rows, (-1, 4))

    def __str__(self) -> str:
        return self.to_text()

    def to_text(self, units: Mapping[str, str] | None = None) -> str:
        """The text of ``str``, with the units of ``"u"`` and ``"y"``."""
        u, y = ((units or {}).get(signal, "") for signal in "uy")
        a, b = self.peak
        place = f"half distance {quantity((a - b) / 2.0, u)}, middle {quantity((a + b) / 2.0, u)}"
        peak = f"at thresholds {quantity(a, u)} and {quantity(b, u)}: {place}"
        smooth = f"{self.smoothing:g}, growing by {self.growth:g}" if self.growth else f"{self.smoothing:g}"
        share = f", {100.0 * self.left_out / self.stroke:.2g} % of the stroke" if self.left_out > 0.0 else ""
        return summary_text(
            [f"Forc: {self.n_curves} reversal curves, u of {extent(self.levels, u)}"],
            {
                "stroke": quantity(self.stroke, y),
                "largest density": peak if self.ridge.size else "none above three standard errors",
                "smoothing": smooth,
                "error": f"{quantity(self.left_out, y)} at curves left out{share}" if share else "",
                "drift": self._drift_in_words(y),
            },
        )

    def _drift_in_words(self, unit: str) -> str:
        if math.isnan(self.drift):
            return "unknown: fewer than three curves begin at an extreme of the input"
        noise = f"the noise from curve to curve, {quantity(self.noise, unit)}"
        return f"{quantity(self.drift, unit)} is subtracted; {noise}" if self.drift else f"none above {noise}"


def forc(record: Record, *, smoothing: float | Literal["auto"] = "auto", tolerance: float = TOLERANCE) -> Forc:
    """The density of relays from first-order reversal curves: half the mixed derivative, by local regression.

    A drift, shown by outputs at the extreme where curves begin (a magnetometer's calibration points), is subtracted.

    Parameters
    ----------
    record : Record
        Curves as `hysim.Preisach.from_reversal_curves` takes them.
    smoothing : float or "auto"
        Reach of the regression in distances of neighbouring curves, beyond the first one, the smoothing factor of the
        field; ``"auto"`` takes the smoothest whose error at left-out curves is the least within its standard error, and
        lets it grow away from the diagonal where that is as good.
    tolerance : float
        Retreats of the input up to this fraction of its span are ignored: noise.

    Returns
    -------
    Forc

    Raises
    ------
    ValueError
        If the input never falls, there are fewer than 10 curves for its choice, or `smoothing` is not positive.

    Examples
    --------
    >>> import numpy as np, hysim as hs
    >>> ridge = lambda a, b: np.exp(-4.0 * (a - b - 0.8) ** 2 - (a + b) ** 2)
    >>> law = hs.Preisach.from_density(np.linspace(-1.0, 1.0, 41), ridge)
    >>> u = hs.signals.reversal_curves(-1.0, 1.0, curves=20, samples_per_step=2)
    >>> diagram = hs.forc(hs.Record(u=u, y=law.response(u)))
    >>> [round(each, 6) for each in diagram.peak]
    [0.4, -0.4]
    """
    rises = _begins_at_the_top(record, tolerance)
    path = _turned(record) if rises else record
    low, curves = float(path.u.min()), _curves_of(path, tolerance)
    points = _Points.of(curves, low)
    if smoothing == "auto" and len(curves) < FEWEST:
        raise ValueError(
            f'smoothing="auto" needs at least {FEWEST} reversal curves, the record has {len(curves)}: give it as a '
            "number, or measure along hysim.signals.reversal_curves"
        )
    s, g, left_out = points.setting(smoothing)
    last = np.flatnonzero(np.diff(points.curve, append=-1))
    lowest, highest = float(points.b.min()), float(points.a[-1])
    levels = _even(lowest, highest, max(points.spacing, (highest - lowest) / _NODES))
    reaches = np.interp(levels, points.a[last], points.b[last], left=np.inf)
    slack = 0.5 * points.spacing
    rows, columns = np.nonzero(np.tril(levels >= reaches[:, np.newaxis] - slack))
    tables = np.full((2, levels.size, levels.size), np.nan)
    tables[:, rows, columns] = points.local(levels[rows], levels[columns], s, g)[:, 1:].T
    if not np.isfinite(tables[0]).any():
        raise ValueError(_TOO_FEW)
    if rises:
        levels, tables = -levels[::-1], tables[:, ::-1, ::-1].transpose(0, 2, 1)
    return Forc(
        levels=levels,
        density=tables[0],
        stderr=tables[1],
        smoothing=float(s),
        growth=g,
        left_out=left_out,
        stroke=float(np.ptp(points.y)),
        n_curves=len(curves),
        drift=points.drift,
        noise=points.noise,
    )


class ReversalCurve(NamedTuple):
    """A way down, and the rise before it; None if the record begins at the turning point."""

    fall: Record
    rise: Record | None

    @property
    def turn(self) -> float:
        """Input at which the curve turns."""
        return float(self.fall.u[0])

    def everett(self, b: FloatArray) -> FloatArray:
        """E(turn, b) at inputs from the lowest to the turning point."""
        return np.asarray(0.5 * (self.fall.y[0] - _at(b, self.fall)))

    def above_line(self, turn: float, levels: FloatArray, reached: FloatArray) -> FloatArray:
        """Half of what the rise to the curve is above a straight line from the turning point before."""
        if self.rise is None:
            return np.zeros(levels.size)
        start, end = _at(np.array([turn, self.turn]), self.rise)
        return np.asarray(0.5 * (_at(levels, self.rise) - start - reached * (end - start)))


def everett_from_curves(
    record: Record, levels: npt.ArrayLike | None, tolerance: float, smoothing: float | Literal["auto"] | None = None
) -> tuple[FloatArray, FloatArray, float]:
    """Levels, E at the pairs of them (upper, lower), and the output at the lowest input.

    E is zero above the diagonal, beyond curves as at their ends; for a record turned by 180 degrees it is E(-b, -a).
    """
    if _begins_at_the_top(record, tolerance):
        own = None if levels is None else -read_only(levels, "levels", ndim=1)[::-1]
        grid, table, lowest = everett_from_curves(_turned(record), own, tolerance, smoothing)
        return np.asarray(-grid[::-1]), table[::-1, ::-1].T, -lowest - 2.0 * float(table[-1, 0])
    low, slack, curves = float(record.u.min()), tolerance * float(np.ptp(record.u)), _curves_of(record, tolerance)
    if smoothing is not None:
        points = _Points.of(curves, low)
        step = max(0.5 * points.spacing, (float(points.a[-1]) - low) / _MOST_SMOOTH)
        curves = _smooth_curves(points, low, step, smoothing)
        levels = _even(low, curves[-1].turn, step) if levels is None else levels
    grid = _levels_of(low, curves) if levels is None else read_only(levels, "levels", ndim=1)
    if not grid.size or grid[0] > low + slack:
        raise ValueError(f"levels must begin at the lowest input {low:g} or below, got {grid[:1].tolist()}")
    table = np.zeros((grid.size, grid.size))
    turn, below = low, np.zeros(grid.size)
    for curve in curves:
        above = np.where(grid < curve.turn, curve.everett(grid), 0.0)
        end = float(curve.fall.u[-1])
        if end > low + slack:  # beyond its end it runs as the curve below it
            above += np.where(grid < end, below - np.interp(end, grid, below), 0.0)
        between = np.flatnonzero((grid > turn) & (grid <= curve.turn))
        reached = (grid[between] - turn) / (curve.turn - turn)
        # total variation above each level
        share = np.append(np.cumsum(np.abs(np.diff(above - below))[::-1])[::-1], 0.0)
        share = share / (share[0] or 1.0)
        for k, t, r in zip(between, reached, curve.above_line(turn, grid[between], reached), strict=True):
            table[k] = np.where(grid <= turn, (1.0 - t) * below + t * above + r * share, 0.0)
            inner = (grid > turn) & (grid < grid[k])
            stretched = turn + (grid[inner] - turn) / t
            table[k, inner] = t * curve.everett(stretched) + r * np.interp(stretched, grid, share)
        turn, below = curve.turn, above
    table[grid > turn] = below
    ends = [float(curve.fall.y[-1]) for curve in curves if curve.fall.u[-1] <= low + slack]
    return grid, table, float(np.mean(ends or record.y[record.u.argmin()]))


def _begins_at_the_top(record: Record, tolerance: float) -> bool:
    """Whether more ways down begin at the highest input than ways up at the lowest one."""
    slack = tolerance * float(np.ptp(record.u))
    begins = [(branch.u[0], branch.u[-1]) for branch in record.branches(tolerance)]
    falls = sum(first > last and first >= record.u.max() - slack for first, last in begins)
    rises = sum(first < last and first <= record.u.min() + slack for first, last in begins)
    return bool(falls > rises)


def _curves_of(record: Record, tolerance: float) -> list[ReversalCurve]:
    """The curves of a record by their turning points, of equal ones the last; a ValueError without a curve."""
    branches = record.branches(tolerance)
    pairs = zip((None, *branches), branches, strict=False)
    every = [ReversalCurve(fall, rise) for rise, fall in pairs if fall.u[-1] < fall.u[0]]
    if not every:
        raise ValueError("the input never falls: a reversal curve is a way up and the way down after it")
    curves = {each.turn: each for each in every}
    return [curves[turn] for turn in sorted(curves)]


def _levels_of(low: float, curves: list[ReversalCurve]) -> FloatArray:
    """The turning points and all inputs of the curves; even steps between turning points if these are too many."""
    turns = np.array([low, *(curve.turn for curve in curves)])
    span = float(turns[-1] - low)
    every = np.unique(np.concatenate([turns, *(curve.fall.u for curve in curves)]))
    every = every[(every >= low) & (every <= turns[-1])]
    if every.size <= _MOST_LEVELS and np.diff(every).min() >= _CLOSEST * span:
        return np.asarray(every)
    parts = np.maximum(np.round(np.diff(turns) * _MOST_LEVELS / span), 1).astype(int)
    steps = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(turns[:-1], turns[1:], parts, strict=True)]
    return np.append(np.concatenate(steps), turns[-1])


def _at(inputs: FloatArray, branch: Record) -> FloatArray:
    """Outputs of a branch where its input passes the inputs."""
    order = np.argsort(branch.u, kind="stable")
    return np.interp(inputs, branch.u[order], branch.y[order])


def _turned(record: Record) -> Record:
    return Record(u=-record.u, y=-record.y)


class _Points(NamedTuple):
    """Samples of all curves without a drift: turning points, inputs, outputs, and the numbers of the curves.

    `spacing` is the distance of neighbouring curves. Where three rises or more begin at the lowest input, `base` is the
    mean output there, `drift` the span of what is subtracted, and `noise` the standard deviation about it; else nan.
    """

    a: FloatArray
    b: FloatArray
    y: FloatArray
    curve: npt.NDArray[np.intp]
    spacing: float
    base: float
    drift: float
    noise: float

    @classmethod
    def of(cls, curves: Sequence[ReversalCurve], low: float) -> "_Points":
        turns = np.array([curve.turn for curve in curves])
        steps = [abs(float(np.median(np.diff(curve.fall.u)))) for curve in curves if len(curve.fall) > 1]
        spacing = max(float(np.median(np.diff(turns))) if turns.size > 1 else 0.0, float(np.median(steps)))
        starts = np.array(
            [math.nan if each.rise is None or each.rise.u[0] > low + spacing else each.rise.y[0] for each in curves]
        )
        known = np.isfinite(starts)
        offsets, base, drift, noise = np.zeros(len(curves)), math.nan, math.nan, math.nan
        if known.sum() > 2:
            y, base, drift = starts[known], float(starts[known].mean()), 0.0
            noise = float(np.sqrt(np.mean(np.diff(y) ** 2) / 2.0))
            if np.var(y) > _MOVES * noise**2 + np.spacing(np.abs(y).max()) ** 2:
                ones = np.ones(min(_RUNNING, y.size))
                running = np.convolve(y, ones, "same") / np.convolve(np.ones(y.size), ones, "same")
                offsets = np.interp(np.arange(len(curves)), np.flatnonzero(known), running - running.mean())
                drift = float(np.ptp(running))
        falls = [curve.fall for curve in curves]
        stops = [len(each) - (len(each) > 1 and each.u[-2] - each.u[-1] > _JUMP * spacing) for each in falls]
        return cls(
            np.repeat(turns, stops),
            np.concatenate([fall.u[:stop] for fall, stop in zip(falls, stops, strict=True)]),
            np.concatenate([fall.y[:stop] - o for fall, stop, o in zip(falls, stops, offsets, strict=True)]),
            np.repeat(np.arange(len(curves)), stops),
            spacing,
            base,
            drift,
            noise,
        )

    def local(self, a: FloatArray, b: FloatArray, smoothing: float, growth: float) -> FloatArray:
        """Outputs, densities and their standard errors (n, 3) at thresholds (n,); nan where samples are too few."""
        reaches = (smoothing + 1.0 + growth * (a - b) / (2.0 * self.spacing)) * self.spacing
        rows = [self._around(*each) for each in zip(a.tolist(), b.tolist(), reaches.tolist(), strict=True)]
        return np.reshape(rows, (len(rows), 3))

    def _around(self, a: float, b: float, reach: float) -> tuple[float, float, float]:
        """As `local`, at one point; with a larger reach where the samples around do not determine the regression."""
        for wider in (reach, 1.5 * reach, 2.25 * reach):
            first, last = np.searchsorted(self.a, [a - wider, a + wider])
            q = (self.b[first:last] - b) / wider
            near = np.flatnonzero(np.abs(q) < 1.0)
            p, q = (self.a[first:last][near] - a) / wider, q[near]
            weights = (np.maximum(1.0 - np.abs(p) ** 3, 0.0) * (1.0 - np.abs(q) ** 3)) ** 3
            root = np.sqrt(weights)
            columns = np.stack([np.ones(p.size), p, q, p * p, p * q, q * q], axis=1) * root[:, np.newaxis]
            basis, upper = np.linalg.qr(columns)
            sizes = np.abs(np.diag(upper))
            if p.size > _TERMS and sizes.min() > _SINGULAR * sizes.max():
                break
        else:
            return math.nan, math.nan, math.nan
        outputs = root * self.y[first:last][near]
        inverse, means = np.linalg.inv(upper), basis.T @ outputs
        rest = float(np.sum((outputs - basis @ means) ** 2))
        freedom = float(weights.sum()) - float(np.sum(weights[:, np.newaxis] * basis**2))
        row = (basis * root[:, np.newaxis]) @ inverse[4]
        error = math.sqrt(rest / freedom * float(row @ row)) if freedom > 0.0 else math.nan
        scale = 0.5 / wider**2
        return float(inverse[0] @ means), scale * float(inverse[4] @ means), scale * error

    def _without(self, k: int) -> tuple["_Points", "_Points"]:
        """The others, and every fifth curve from `k` on, at samples as many as are looked at."""
        is_left = self.curve % _EVERY == k
        inner = np.flatnonzero(is_left & (self.curve > 0) & (self.curve < self.curve[-1]))
        return self._at(~is_left), self._at(inner[:: 1 + inner.size // _TARGETS])

    def _at(self, places: npt.NDArray[Any]) -> "_Points":
        return self._replace(a=self.a[places], b=self.b[places], y=self.y[places], curve=self.curve[places])

    def setting(self, smoothing: float | Literal["auto"]) -> tuple[float, float, float]:
        """Smoothing, growth, and the rms error at curves left out; nan where it was not asked for."""
        if smoothing == "auto":
            return self._chosen()
        try:
            check_positive(smoothing=smoothing)
        except TypeError:
            raise ValueError(f'smoothing must be a number or "auto", got {smoothing!r}') from None
        return smoothing, 0.0, math.nan

    def _chosen(self) -> tuple[float, float, float]:
        errors, curve = [], []
        for k in range(_EVERY):
            known, asked = self._without(k)
            errors.append([known.local(asked.a, asked.b, *each)[:, 0] - asked.y for each in _SMOOTHINGS])
            curve.append(asked.curve)
        squares, which = np.concatenate(errors, axis=1) ** 2, np.concatenate(curve)
        known = np.isfinite(squares).all(axis=0)
        if not known.any():
            raise ValueError("the curves are too few or too short to choose a smoothing: give it as a number")
        counts = np.bincount(which[known])
        sums = np.array([np.bincount(which[known], each) for each in squares[:, known]])[:, counts > 0]
        means = sums / counts[counts > 0]  # of each curve
        logs = np.log(means + max(np.spacing(np.ptp(self.y)) ** 2, np.finfo(float).tiny))
        more = logs - logs[logs.mean(axis=1).argmin()]
        is_close = more.mean(axis=1) <= more.std(axis=1) / math.sqrt(means.shape[1])
        best = max(np.flatnonzero(is_close), key=lambda k: (_SMOOTHINGS[k][0], _SMOOTHINGS[k][1]))
        return *_SMOOTHINGS[best], float(np.sqrt(means[best].mean()))


def _smooth_curves(points: _Points, low: float, step: float, smoothing: float | Literal["auto"]) -> list[ReversalCurve]:
    """Curves of local regression, so far apart and with such steps, which reach as far as the measured ones."""
    s, g, _ = points.setting(smoothing)
    last, curves = np.flatnonzero(np.diff(points.curve, append=-1)), []
    for turn in _even(float(points.a[0]), float(points.a[-1]), step).tolist():
        lowest = float(np.interp(turn, points.a[last], points.b[last]))
        u = _even(min(lowest, turn), turn, step)[::-1]
        y = points.local(np.full(u.size, turn), u, s, g)[:, 0]
        known = np.isfinite(y)
        if known.sum() > 1 and known[0]:
            has_end = math.isnan(points.base) or u[known][-1] < low + points.spacing
            u, y = np.append(u[known], [] if has_end else low), np.append(y[known], [] if has_end else points.base)
            curves.append(ReversalCurve(Record(u=u, y=y), None))
    if not curves:
        raise ValueError(_TOO_FEW)
    return curves


def _even(low: float, high: float, step: float) -> FloatArray:
    return np.linspace(low, high, max(2, 1 + round((high - low) / step)))
