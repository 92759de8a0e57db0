"""Arrays to numbers: the measures of loops, of fits and of responses to a step, each defined once."""

from hysim.metrics._cycle_table import CycleMetrics as CycleMetrics
from hysim.metrics._cycle_table import cycle_metrics as cycle_metrics
from hysim.metrics._loop import LoopMetrics as LoopMetrics
from hysim.metrics._loop import MagneticMetrics as MagneticMetrics
from hysim.metrics._loop import loop_metrics as loop_metrics
from hysim.metrics._loop import magnetic_metrics as magnetic_metrics
from hysim.metrics._loop import width_rmse as width_rmse
from hysim.metrics._responses import StepMetrics as StepMetrics
from hysim.metrics._responses import VibrationReduction as VibrationReduction
from hysim.metrics._responses import describing_function as describing_function
from hysim.metrics._responses import reduction_percent as reduction_percent
from hysim.metrics._responses import step_metrics as step_metrics
from hysim.metrics._responses import vibration_reduction as vibration_reduction
from hysim.metrics.criteria import aic as aic
from hysim.metrics.criteria import bic as bic
from hysim.metrics.criteria import fit_percent as fit_percent
from hysim.metrics.criteria import fpe as fpe
from hysim.metrics.criteria import nrmse as nrmse
from hysim.metrics.criteria import rmse as rmse
