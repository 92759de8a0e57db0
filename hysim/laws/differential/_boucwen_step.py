"""Laws whose memory is Bouc and Wen's, stepped and driven by its exact kernels."""

from typing import ClassVar

import numpy as np

from hysim._frozen import FloatArray, read_only
from hysim.kernels import boucwen as kernels
from hysim.kernels.charts import N_WORK
from hysim.models.law import Law, Tables
from hysim.models.protocols import CompiledLaw


class BoucWenStep(Law):
    """A law that packs the parameters (A, beta, gamma, n, gain, offset, c1, c2, ...) and the memory (u, z)."""

    step = staticmethod(kernels.step)
    workspace: ClassVar[int] = N_WORK - 2

    @classmethod
    def prepare(cls, parameters: FloatArray, state: FloatArray) -> None:
        """Fill in the charts of the exponent."""
        A, beta, gamma, n = parameters[:4].tolist()
        if n not in (1.0, 2.0):
            kernels.prepare(A, beta, gamma, n, 0.0, state)

    @classmethod
    def path(cls, law: CompiledLaw, u: FloatArray, y: FloatArray) -> int:
        A, beta, gamma, n = map(float, law.parameters[:4])
        last_u, z = map(float, law.state[:2])
        if n == 1.0:
            lost = kernels.linear_path(A, beta, gamma, last_u, z, u, y)
        elif n == 2.0:
            lost = kernels.quadratic_path(A, beta, gamma, last_u, z, u, y)
        else:
            lost = kernels.power_path(A, beta, gamma, n, last_u, z, u, law.state, y)
        if lost < 0:
            law.state[:2] = u[-1], y[-1]
            kernels.to_output(law.parameters, 4, u, y)
        return int(lost)

    @classmethod
    def rows(cls, tables: Tables, u: FloatArray, y: FloatArray) -> None:
        parameters, memory = cls.pack(tables)
        laws = read_only(np.concatenate([parameters[:, :4], memory[:, 1:]], axis=1), finite=False)
        with np.errstate(all="ignore"):  # a memory that diverges overflows, and uncompiled kernels would warn of it
            kernels.batch(laws, read_only(parameters[:, 4:], finite=False), u, y, 0, len(y))
