"""The problem that `identify` has solved, put together again from its result, and that of a record not yet measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from hysim._basics.frozen import FloatArray
from hysim.identification._descent import named_slopes
from hysim.identification._identify import without_filter
from hysim.identification._noise import Noise, density
from hysim.identification._problem import Initial, Numbers, Problem, problem
from hysim.identification._result import Identification
from hysim.identification._uncertainty import output_slopes
from hysim.models.protocols import Identifiable
from hysim.models.search_space import Freedom
from hysim.records import Record

__all__ = ["Expected", "Noise", "Problem", "again", "density", "optima"]

_SAME = 1e-3  # of the residual's rms: largest difference between the residuals of a fit and of its problem
_ROUNDING = 1e-9  # of the output's size

Bounds = Mapping[str, tuple[float, float]]


def again(fit: Identification, records: Sequence[Record], bounds: Bounds, initial: Initial) -> Problem:
    """The problem that `fit` solves, beginning at its model, with `bounds`, of linear parameters only to one side.

    States at the first sample are those of `initial`; by default they are free if they were, else held at their values.
    A ValueError is raised if the model has no search box, or does not have the residual of the fit on these records.
    """
    model, paths = without_filter(fit.model, records)
    if not isinstance(model, Identifiable):
        raise ValueError(f"a {type(model).__name__} has no search box of its own: its parameters cannot be sampled")
    freedom, initial = _freedom(fit, model, paths, initial)
    plain = problem(model, paths, freedom, initial)
    models = [without_filter(each, [])[0] for each in fit.models] if len(fit.models) == len(records) else [model]
    _check_same(fit, plain, [problem(each, paths, freedom, initial).own.starts[0] for each in models])
    inner = _inner(bounds, plain)
    within = problem(model, paths, replace(freedom, bounds=inner), initial) if inner else plain
    return within.weighted(np.split(fit.weights, plain.cuts[1:-1])) if fit.weights.size else within


def optima(fit: Identification, known: Problem, bounds: Bounds, initial: Initial) -> FloatArray:
    """Coordinates (n_optima, n_x) of the fit and its rivals, best first, in the problem of `again`."""
    paths = [part.record for part in known.parts]
    freedom, initial = _freedom(fit, known.family, paths, initial)
    freedom = replace(freedom, bounds=_inner(bounds, known))
    models = [without_filter(each, [])[0] for each in (fit.model, *(rival.model for rival in fit.rivals))]
    return np.array([problem(model, paths, freedom, initial).space.starts[0] for model in models])


def _inner(bounds: Bounds, known: Problem) -> dict[str, tuple[float, float]]:
    """The bounds that are no priors: of parameters that are not linear, and of others to one side."""
    own = known.own.columns
    return {name: pair for name, pair in bounds.items() if name not in own or not np.isfinite(pair).all()}


def _freedom(
    fit: Identification, model: Identifiable, records: Sequence[Record], initial: Initial
) -> tuple[Freedom, Initial]:
    own = problem(model, records, Freedom(), None).own
    names = {*own.names, *own.held}
    free = tuple(dict.fromkeys(name if name in names else name.rpartition("[")[0] for name in fit.free_names))
    states = () if initial is None else own.state
    fixed = {name: value for name, value in fit.estimates.items() if name in names and name not in (*free, *states)}
    if initial is None and set(own.state) & set(free):
        initial = "free"
    return Freedom(fixed, tuple(name for name in free if name not in states), {}), initial


def _check_same(fit: Identification, problem: Problem, starts: Sequence[FloatArray]) -> None:
    """A ValueError unless the problem has the residual of the fit; `starts` are the coordinates of each record."""
    x = np.zeros(problem.n_x)
    for part, own in zip(problem.parts, starts, strict=True):
        present = part.coordinates >= 0
        x[part.coordinates[present]] = own[present]
    linear = [fit.estimates[name] for name in problem.space.linear]
    residual = problem.y - problem.model(np.concatenate([x, linear])[np.newaxis])[0]
    size = _SAME * fit.rmse + _ROUNDING * problem.scale
    if residual.shape != fit.residual.shape or not np.abs(residual - fit.residual).max() <= size:
        raise ValueError(
            "the fit has other residuals on these records: pass the records that it was identified from, and initial= "
            "as it was passed to identify"
        )


_CLOSE = 1e-6  # relative distance of a parameter and what its coordinates stand for


@dataclass(frozen=True)
class Expected:
    """A model at known parameters, as `identify` would search them on a record.

    `theta` (n_theta,) are its coordinates and linear parameters, `way_there` (n_theta, n_names) their derivatives.
    """

    problem: Problem
    theta: FloatArray
    way_there: FloatArray

    @classmethod
    def at(cls, family: Any, record: Record, freedom: Freedom, coordinates: Numbers, values: Numbers) -> Self:
        """The model with these `values`, at these coordinates by name; ValueError for a value outside the box."""
        attempt = problem(family, [record], freedom, None)
        x = [coordinates[name] for name in attempt.space.coordinates]
        theta = np.array([*x, *(values[name] for name in attempt.space.linear)], dtype=float)
        for name, value in zip(attempt.space.names, attempt.named(theta[np.newaxis])[0].tolist(), strict=True):
            if abs(value - values[name]) > _CLOSE * max(abs(value), abs(values[name])):
                raise ValueError(
                    f"{name} = {values[name]:g} is outside the range that identify searches on records within these "
                    f"limits, which ends at {value:g}"
                )
        slopes = named_slopes(attempt, theta[np.newaxis])[0]
        return cls(attempt, theta, np.linalg.pinv(slopes))

    @property
    def names(self) -> tuple[str, ...]:
        return self.problem.space.names

    def jacobian(self, record: Record, *, refined: bool = False) -> FloatArray:
        """dy/d(free parameters) (n_samples, n_names) on a record; `refined` as for standard errors of `identify`."""
        own = replace(self.problem, parts=(replace(self.problem.parts[0], record=record),))
        return np.asarray(output_slopes(own, self.theta, refined=refined) @ self.way_there)
