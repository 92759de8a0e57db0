"""Parameters that drift: their path along a record, by filters whose transition is the law's exact step."""

from hysim.tracking._track import ParameterTrack as ParameterTrack
from hysim.tracking._track import track_parameters as track_parameters
