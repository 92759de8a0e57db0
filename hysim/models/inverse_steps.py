"""The inverse of every law as a step: closed forms where a family has one, else a search on the law's own step."""

import math
from functools import singledispatch
from typing import Any

import numpy as np

from hysim._frozen import read_only
from hysim.kernels import inverses as kernels
from hysim.models import _inverse_search, boucwen_inverse
from hysim.models._as_bouc_wen import AsBoucWen
from hysim.models._boucwen_law import BoucWenLaw
from hysim.models._inverse_search import UNLIMITED, Limits
from hysim.models.generalized_prandtl_ishlinskii import GeneralizedPrandtlIshlinskii
from hysim.models.prandtl_ishlinskii import PrandtlIshlinskii
from hysim.models.preisach import Preisach
from hysim.models.protocols import CompiledLaw
from hysim.models.rate_dependent_prandtl_ishlinskii import RateDependentPrandtlIshlinskii
from hysim.models.static import Line

_ROOM = 1000  # extremes of a Preisach law


@singledispatch
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
    return _inverse_search.inverse_step(CompiledLaw(*law.compiled(u0)), u0, limits=limits)


@inverse_step.register
def _(law: Line, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
    if not law.slope:
        raise ValueError("the law has no inverse: its slope is zero")
    parameters = read_only([*limits, law.offset, law.slope], finite=False)
    return CompiledLaw(kernels.line, parameters, np.array([u0, law.offset + law.slope * u0]))


@inverse_step.register
def _(law: BoucWenLaw, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
    return boucwen_inverse.inverse(law, u0).compiled(u0=u0, limits=limits)


@inverse_step.register
def _(law: AsBoucWen, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
    return inverse_step(law.bouc_wen, u0, limits)


@inverse_step.register
def _(law: PrandtlIshlinskii, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
    y0 = float(law.response([u0])[0])
    forward, inverse = law.compiled(u0), law.inverse().compiled(y0)
    return CompiledLaw(
        kernels.plays,
        read_only(np.concatenate([limits, inverse.parameters, forward.parameters]), finite=False),
        np.concatenate([[u0, y0], inverse.state, forward.state, inverse.state]),
    )


@inverse_step.register
def _(
    law: GeneralizedPrandtlIshlinskii, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf
) -> CompiledLaw:
    law.check_invertible()
    return law.inverse_step(law.advance([u0])[1], limits)


@inverse_step.register
def _(
    law: RateDependentPrandtlIshlinskii, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf
) -> CompiledLaw:
    law.check_invertible(sample_time)
    steps = law.at(sample_time)
    return steps.inverse_step(steps.advance([u0])[1], limits)


@inverse_step.register
def _(law: Preisach, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
    return law.inverse_step((*law.z0, u0), limits, room=_ROOM)
