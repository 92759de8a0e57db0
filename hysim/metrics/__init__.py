"""Arrays to numbers: the measures of loops and of fits, each defined once."""

from hysim.metrics._fit import aic, bic, fit_percent, fpe, nrmse, rmse
from hysim.metrics._loop import LoopMetrics, loop_metrics, width_rmse

__all__ = ["LoopMetrics", "aic", "bic", "fit_percent", "fpe", "loop_metrics", "nrmse", "rmse", "width_rmse"]
