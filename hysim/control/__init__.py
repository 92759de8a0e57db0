"""Controllers, the loops they close, and measures of these loops."""

from hysim.control._assessment import HysteresisAssessment as HysteresisAssessment
from hysim.control._assessment import OpenLoop as OpenLoop
from hysim.control._assessment import SquareWaveAssessment as SquareWaveAssessment
from hysim.control._assessment import StepAssessment as StepAssessment
from hysim.control._assessment import assess_hysteresis as assess_hysteresis
from hysim.control._assessment import assess_square_wave as assess_square_wave
from hysim.control._assessment import assess_step as assess_step
from hysim.control._assessment import open_loop as open_loop
from hysim.control._bandwidth import bandwidth as bandwidth
from hysim.control._c_export import CSource as CSource
from hysim.control._c_export import to_c as to_c
from hysim.control._feedforward import InverseFeedforward as InverseFeedforward
from hysim.control._filters import DampingLoop as DampingLoop
from hysim.control._filters import Notch as Notch
from hysim.control._loop import ClosedLoop as ClosedLoop
from hysim.control._loop import as_actuator as as_actuator
from hysim.control._loop import close_loop as close_loop
from hysim.control._margins import LinearLoop as LinearLoop
from hysim.control._pid import PID as PID
from hysim.control._shaping import ModeInverse as ModeInverse
from hysim.control._shaping import Shaper as Shaper
from hysim.control._to_control import to_control as to_control
from hysim.control._tracking import TrackingController as TrackingController
from hysim.control._tune import tune as tune
from hysim.control._tuning import Trial as Trial
from hysim.control._tuning import Tuning as Tuning
