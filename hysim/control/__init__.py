"""Controllers, the loops they close, and measures of these loops."""

from hysim.control._assessment import (
    HysteresisAssessment,
    LoopAssessment,
    OpenLoop,
    SquareWaveAssessment,
    StepAssessment,
    assess_hysteresis,
    assess_loop,
    assess_square_wave,
    assess_step,
    driven_by,
    open_loop,
)
from hysim.control._controller import PID, Controller, begun, held_samples, preview
from hysim.control._filters import DampingLoop, ModeInverse, Notch, Shaper
from hysim.control._learning import IterativeLearning, LearnedTrials, RepetitiveControl
from hysim.control._loop import ClosedLoop, RestingPlant, close_loop, secant_gain, slopes
from hysim.control._stability import LinearLoop, bandwidth, later
from hysim.control._to_control import to_control
from hysim.control._tracking import AdaptiveInverse, InverseFeedforward, PredictiveControl, TrackingController
from hysim.control._tune import LinearController, Trial, Tuning, loop_shaping, tune
from hysim.plants.actuator import as_actuator

__all__ = [
    "PID", "AdaptiveInverse", "ClosedLoop", "Controller", "DampingLoop", "HysteresisAssessment",
    "InverseFeedforward", "IterativeLearning", "LearnedTrials", "LinearController", "LinearLoop", "LoopAssessment",
    "ModeInverse", "Notch", "OpenLoop", "PredictiveControl", "RepetitiveControl", "RestingPlant", "Shaper",
    "SquareWaveAssessment", "StepAssessment", "TrackingController", "Trial", "Tuning", "as_actuator",
    "assess_hysteresis", "assess_loop", "assess_square_wave", "assess_step", "bandwidth", "begun", "close_loop",
    "driven_by", "held_samples", "later", "loop_shaping", "open_loop", "preview", "secant_gain", "slopes",
    "to_control", "tune",
]  # fmt: skip
