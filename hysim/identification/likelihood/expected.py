"""Information of a record that is not measured yet: the derivatives of its output by parameters that are known.

They are those of the residual that `hysim.identify` makes small, by the same code.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from hysim._frozen import FloatArray
from hysim.identification._descent import named_slopes
from hysim.identification._problem import Problem, problem
from hysim.identification._uncertainty import output_slopes
from hysim.models.search_space import Freedom
from hysim.records import Record

_CLOSE = 1e-6  # relative distance of a parameter and what its coordinates stand for


@dataclass(frozen=True)
class Expected:
    """A model at known parameters, as `identify` would search them on a record.

    `theta` (n_theta,) are its coordinates and linear parameters, and `way_there` (n_theta, n_names) their derivatives
    by the free parameters.
    """

    problem: Problem
    theta: FloatArray
    way_there: FloatArray

    @classmethod
    def at(
        cls,
        family: Any,
        record: Record,
        freedom: Freedom,
        coordinates: Mapping[str, float],
        values: Mapping[str, float],
    ) -> Self:
        """The model with these `values` of its parameters, which lie at these coordinates by name.

        A ValueError is raised if a value lies outside the box that is searched on such a record.
        """
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
        """The free parameters."""
        return self.problem.space.names

    def jacobian(self, record: Record, *, refined: bool = False) -> FloatArray:
        """Derivatives of the output by the free parameters, (n_samples, n_names), at the input of a record.

        Refined ones are those from which `identify` computes standard errors: where the output bends within the step of
        a difference, the step is made shorter.
        """
        own = replace(self.problem, parts=(replace(self.problem.parts[0], record=record),))
        return np.asarray(output_slopes(own, self.theta, refined=refined) @ self.way_there)
