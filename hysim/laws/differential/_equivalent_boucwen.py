"""Laws that are Bouc-Wen laws with n = 1 and gamma = 0 under other names: everything is evaluated as such a law."""

import math
from abc import abstractmethod
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.kernels import boucwen as kernels
from hysim.kernels import stepping
from hysim.laws.differential._boucwen_law import BoucWenStep
from hysim.laws.differential.boucwen import BoucWen
from hysim.laws.differential.boucwen_inverse import BoucWenInverse, InverseState
from hysim.laws.differential.limit_cycle import LimitCycle
from hysim.models.law import Packed, State
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.models.tables import Tables


class EquivalentBoucWen(BoucWenStep):
    """A law that says which Bouc-Wen law it is."""

    step = staticmethod(kernels.linear_step)
    start = staticmethod(stepping.start)
    workspace: ClassVar[int] = 0

    @classmethod
    @abstractmethod
    def equivalent(cls, tables: Tables) -> dict[str, FloatArray]:
        """Parameters of the Bouc-Wen law over sets, those that differ from its defaults."""

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """The constants and the memory of the Bouc-Wen law."""
        parameters = cls.equivalent(tables)
        plain = {name: np.full_like(parameters["A"], value) for name, value in BoucWen.defaults().items()}
        return BoucWen.pack({**plain, **parameters})

    @property
    def bouc_wen(self) -> BoucWen:
        """The `BoucWen` law with the same output."""
        numbers = {name: float(table[0, 0]) for name, table in self.equivalent(self.tables).items()}
        return BoucWen(**numbers, u0=self.u0, u_range=self.u_range)

    @property
    def known_slopes(self) -> tuple[float, float]:
        """Those of the Bouc-Wen law."""
        return self.bouc_wen.known_slopes

    def tangent(self, direction: npt.ArrayLike, z: npt.ArrayLike) -> FloatArray:
        """Slope dy/du at the memory `z` in a `direction` that is not zero; see `hysim.BoucWen.tangent`."""
        return self.bouc_wen.tangent(direction, z)

    def limit_cycle(self, amplitude: float) -> LimitCycle:
        """Steady loop of the memory between the inputs -amplitude and amplitude; see `hysim.BoucWen.limit_cycle`."""
        return self.bouc_wen.limit_cycle(amplitude)

    def inverse(self) -> BoucWenInverse:
        """The law's inverse as an object, where its slope keeps its sign; see `hysim.BoucWen.inverse`."""
        return self.bouc_wen.inverse()

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | InverseState | None) -> CompiledLaw:
        """The inverse of the Bouc-Wen law."""
        return self.bouc_wen.inverse_begun(y, u0, state)

    def unreached(self, sample: int, y: float, inverse: CompiledLaw) -> str:
        """Message with the input and the slope there."""
        return self.bouc_wen.unreached(sample, y, inverse)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        """The closed form of the inverse, stepped; see `hysim.models.inverse_search`."""
        return self.bouc_wen.compiled_inverse(u0, limits)
