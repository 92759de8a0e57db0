"""Controllers, the loops they close, and what these loops achieve."""

from hysim.control._assessment import (
    HysteresisAssessment,
    OpenLoop,
    SquareWaveAssessment,
    StepAssessment,
    assess_hysteresis,
    assess_square_wave,
    assess_step,
    open_loop,
)
from hysim.control._bandwidth import bandwidth
from hysim.control._c_export import CSource, to_c
from hysim.control._feedforward import InverseFeedforward
from hysim.control._filters import DampingLoop, Notch
from hysim.control._loop import ClosedLoop, as_actuator, close_loop
from hysim.control._margins import LinearLoop
from hysim.control._pid import PID
from hysim.control._shaping import ModeInverse, Shaper
from hysim.control._to_control import to_control
from hysim.control._tracking import TrackingController
from hysim.control._tune import tune
from hysim.control._tuning import Trial, Tuning

__all__ = [
    "PID",
    "CSource",
    "ClosedLoop",
    "DampingLoop",
    "HysteresisAssessment",
    "InverseFeedforward",
    "LinearLoop",
    "ModeInverse",
    "Notch",
    "OpenLoop",
    "Shaper",
    "SquareWaveAssessment",
    "StepAssessment",
    "TrackingController",
    "Trial",
    "Tuning",
    "as_actuator",
    "assess_hysteresis",
    "assess_square_wave",
    "assess_step",
    "bandwidth",
    "close_loop",
    "open_loop",
    "to_c",
    "to_control",
    "tune",
]
