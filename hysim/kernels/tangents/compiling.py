"""How numba compiles a translated step."""

from hysim.kernels._compile import closure as closure
from hysim.kernels._compile import inner as inner
from hysim.kernels._compile import kernel as kernel
