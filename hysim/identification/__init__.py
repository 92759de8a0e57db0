"""Parameters from records: `identify` and its result, and `select` among several candidates.

The model is simulated in free run, and the sum of squared output residuals is minimised over the box that
the model's family declares (`SearchSpace`). Nothing here knows a family.
"""

from hysim.identification._identify import identify
from hysim.identification._profile import Profile
from hysim.identification._result import Candidate, Identification, Width
from hysim.identification._select import Selection, select
from hysim.identification.channels.curve import ParameterCurve, parameter_curve
from hysim.identification.channels.unknown import estimate_channel

__all__ = [
    "Candidate",
    "Identification",
    "ParameterCurve",
    "Profile",
    "Selection",
    "Width",
    "estimate_channel",
    "identify",
    "parameter_curve",
    "select",
]
