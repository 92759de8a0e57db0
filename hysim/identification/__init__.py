"""Parameters from records: `identify` and its result, and `select` among several candidates; no family is named."""

from hysim.identification._channel import ParameterCurve as ParameterCurve
from hysim.identification._channel import estimate_channel as estimate_channel
from hysim.identification._channel import parameter_curve as parameter_curve
from hysim.identification._identify import identify as identify
from hysim.identification._result import Candidate as Candidate
from hysim.identification._result import Identification as Identification
from hysim.identification._result import Profile as Profile
from hysim.identification._result import Width as Width
from hysim.identification._search import sharing as sharing
from hysim.identification._select import Selection as Selection
from hysim.identification._select import select as select
from hysim.identification._uncertainty import errors_of_refits as errors_of_refits
from hysim.identification._uncertainty import folds as folds
