"""The inverse of every law as a step: the closed form of its family, or else a search on the law's own step."""

import math
from typing import Any

from hysim.models.inverse_search import searched_inverse
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits, StepwiseInvertible


def inverse_step(law: Any, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
    """The inverse of a law at rest at `u0`, as a step; see `hysim.Law.compiled_inverse`.

    Raises TypeError if the law cannot be stepped, and ValueError if it has no inverse.

    Examples
    --------
    >>> import hysim as hs
    >>> from hysim.models.inverse_steps import inverse_step
    >>> law = hs.Dahl() + hs.Line(slope=1.0)
    >>> step, parameters, state = inverse_step(law, 0.0)
    >>> [round(step(parameters, state, y), 9) for y in law.response([0.0, 0.5, 0.2]).tolist()]
    [0.0, 0.5, 0.2]
    """
    if isinstance(law, StepwiseInvertible):
        return law.compiled_inverse(u0, limits, sample_time)
    return searched_inverse(law, CompiledLaw(*law.compiled(u0)), limits=limits)
