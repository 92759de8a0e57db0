"""Laws that are Bouc-Wen's with n = 1 and gamma = 0 under other names: everything is evaluated as that law.

    z' = A u' - rate |u'| z

On every way of the length L what is left of a memory of one is exp(-rate L), whatever else happens, so that the
memory is affine in A and in its initial value: a search has the rate alone to find.
"""

from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray
from hysim.models._memory_law import State
from hysim.models.boucwen import BoucWen
from hysim.models.boucwen_inverse import BoucWenInverse, InverseState
from hysim.models.composable import Composable
from hysim.models.limit_cycle import LimitCycle
from hysim.models.model import CompiledLaw


class AsBoucWen(Composable, ABC):
    """What a law has from the Bouc-Wen law that it is."""

    @property
    @abstractmethod
    def bouc_wen(self) -> BoucWen:
        """The same law as Bouc-Wen's."""

    def memory(self, u: npt.ArrayLike) -> FloatArray:
        """Memory at the samples of `u`, shape (n_samples,); see `hysim.BoucWen.memory`."""
        return self.bouc_wen.memory(u)

    def response(self, u: npt.ArrayLike) -> FloatArray:
        """Output at the samples of an input that is linear between them; see `hysim.BoucWen.response`."""
        return self.bouc_wen.response(u)

    def advance(self, u: npt.ArrayLike, state: State | None = None) -> tuple[FloatArray, State]:
        """Output continued from `state`, (last u, memory), and the state after it; see `hysim.BoucWen.advance`."""
        return self.bouc_wen.advance(u, state)

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`."""
        return self.bouc_wen.compiled(u0)

    def tangent(self, direction: npt.ArrayLike, z: npt.ArrayLike) -> FloatArray:
        """Slope dy/du at the memory `z` in a `direction` that is not zero; see `hysim.BoucWen.tangent`."""
        return self.bouc_wen.tangent(direction, z)

    def limit_cycle(self, amplitude: float) -> LimitCycle:
        """Steady loop of the memory between the inputs -amplitude and amplitude; see `hysim.BoucWen.limit_cycle`."""
        return self.bouc_wen.limit_cycle(amplitude)

    def inverse(self) -> BoucWenInverse:
        """The law's inverse as an object, where its slope keeps its sign; see `hysim.BoucWen.inverse`."""
        return self.bouc_wen.inverse()

    def inverse_response(
        self, y: npt.ArrayLike, u0: float | None = None, state: State | InverseState | None = None
    ) -> FloatArray:
        """Input that gives the output `y` from the input `u0`; see `hysim.BoucWen.inverse_response`."""
        return self.bouc_wen.inverse_response(y, u0, state)


def left_and_driven(A: FloatArray, rate: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What is left of a memory of one, and the memory from zero, shape (n_sets, n_samples) each."""
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(u)))])
    left = np.exp(-rate[:, np.newaxis] * travelled)
    return left, BoucWen.responses({"A": A, "beta": rate, "gamma": 0.0}, u)
