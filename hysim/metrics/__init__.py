"""Arrays to numbers: the measures of loops, of fits and of responses to a step, each defined once."""

from hysim.metrics._core_loss import Steinmetz, normalised_energy_error, sequence_relative_error
from hysim.metrics._cycle_table import CycleMetrics, cycle_metrics
from hysim.metrics._loop import LoopMetrics, MagneticMetrics, loop_metrics, magnetic_metrics, width_rmse
from hysim.metrics._responses import (
    StepMetrics,
    VibrationReduction,
    describing_function,
    reduction_percent,
    step_metrics,
    vibration_reduction,
)
from hysim.metrics.criteria import aic, bic, fit_percent, fpe, nrmse, rmse

__all__ = [
    "CycleMetrics", "LoopMetrics", "MagneticMetrics", "Steinmetz", "StepMetrics", "VibrationReduction", "aic",
    "bic", "cycle_metrics", "describing_function", "fit_percent", "fpe", "loop_metrics", "magnetic_metrics",
    "normalised_energy_error", "nrmse", "reduction_percent", "rmse", "sequence_relative_error", "step_metrics",
    "vibration_reduction", "width_rmse",
]  # fmt: skip
