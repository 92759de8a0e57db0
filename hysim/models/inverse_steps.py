"""The inverse of every law as a step: the closed form of its family, or else a search on the law's own step."""

import math
from typing import Any

from hysim.models import inverse_search
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits, StepwiseInvertible


def inverse_step(law: Any, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
    """The inverse of a law at rest, as `hysim.kernels.inverses` has it.

    Parameters
    ----------
    law : law
        Any law that can be stepped, such as `BoucWen`, a `Sum` or a `Cascade`.
    u0 : float
        Input at which it rests [unit of u].
    limits : (float, float)
        Lowest and highest input to which the inverse's copy of the law moves [unit of u].
    sample_time : float
        Of a law that depends on the rate of its input [s].

    Returns
    -------
    CompiledLaw
        ``u = step(parameters, state, y)``, nan where no input has the output y.

    Raises
    ------
    TypeError
        If the law cannot be stepped.
    ValueError
        If the law has no inverse.

    Examples
    --------
    >>> import hysim as hs
    >>> from hysim.models.inverse_steps import inverse_step
    >>> step, parameters, state = inverse_step(hs.Dahl() + hs.Line(slope=1.0), 0.0)
    >>> y = (hs.Dahl() + hs.Line(slope=1.0)).response([0.0, 0.5, 0.2])
    >>> [round(step(parameters, state, value), 9) for value in y.tolist()]
    [0.0, 0.5, 0.2]
    """
    if isinstance(law, StepwiseInvertible):
        return law.compiled_inverse(u0, limits, sample_time)
    return inverse_search.inverse_step(CompiledLaw(*law.compiled(u0)), u0, limits=limits)
