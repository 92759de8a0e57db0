"""Studies: one function over many parameters, from one core to a cluster, resumable."""

from hysim.sweeps._response_task import response_task
from hysim.sweeps._result import Sweep, load_sweep
from hysim.sweeps._sensitivity import SobolIndices, sobol_indices
from hysim.sweeps._space import Sample
from hysim.sweeps._structure_task import structure_task
from hysim.sweeps._sweep import sweep

__all__ = ["Sample", "SobolIndices", "Sweep", "load_sweep", "response_task", "sobol_indices", "structure_task", "sweep"]
