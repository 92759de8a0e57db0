"""Studies: one function over many parameters, from one core to a cluster, resumable."""

from hysim.sweeps._chunks import Sample
from hysim.sweeps._loss_map import LossMap, loss_map
from hysim.sweeps._result import Fragility, SobolIndices, Sweep, fragility, load_sweep, sobol_indices
from hysim.sweeps._sweep import sweep
from hysim.sweeps._tasks import response_task, structure_task

__all__ = ["Fragility", "Sample", "SobolIndices", "Sweep", "fragility", "load_sweep", "response_task", "sobol_indices"]
__all__ += ["LossMap", "loss_map", "structure_task", "sweep"]
