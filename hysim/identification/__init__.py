"""Parameters from records: `identify` and its result, and `select` among several candidates; no family is named."""

from hysim.identification._channel import ParameterCurve, estimate_channel, parameter_curve
from hysim.identification._identify import identify
from hysim.identification._result import Candidate, Identification, Profile, Width
from hysim.identification._search import sharing
from hysim.identification._select import Selection, select
from hysim.identification._uncertainty import errors_of_refits, folds

__all__ = ["Candidate", "Identification", "ParameterCurve", "Profile", "Selection", "Width", "errors_of_refits"]
__all__ += ["estimate_channel", "folds", "identify", "parameter_curve", "select", "sharing"]
