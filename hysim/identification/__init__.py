"""Parameters from records: `identify` and its result, and `select` among several candidates; no family is named."""

from hysim.identification._channel import ParameterCurve, estimate_channel, parameter_curve
from hysim.identification._diagnostics import folds
from hysim.identification._identify import identify
from hysim.identification._profile import Profile
from hysim.identification._result import Candidate, Identification, Width
from hysim.identification._select import Selection, select

__all__ = [
    "Candidate",
    "Identification",
    "ParameterCurve",
    "Profile",
    "Selection",
    "Width",
    "estimate_channel",
    "folds",
    "identify",
    "parameter_curve",
    "select",
]
