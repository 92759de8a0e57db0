"""The parts that the extended Prandtl-Ishlinskii laws share: numbers as `hysim.kernels.play_sums` takes them."""

import math
from abc import abstractmethod

import numpy as np

from hysim._basics.frozen import FloatArray, read_only
from hysim.kernels import play_sums as kernels
from hysim.laws.operators._bank_search import rows_of
from hysim.laws.operators.prandtl_ishlinskii import PrandtlIshlinskii
from hysim.models.law import Law, Packed, State
from hysim.models.protocols import UNLIMITED, CompiledLaw, Limits
from hysim.models.tables import Tables

_WIDTH = 3  # place of the width behind the limits and the offset
EXAMPLE = {"thresholds": (0.0, 0.1, 0.2, 0.35, 0.5, 0.7), "weights": (0.4, 0.3, 0.2, 0.2, 0.1, 0.1)}
"""Plays of the laws that stand for the families."""


class ExtendedPlays:
    """A law of plays and something in addition."""

    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    z0: tuple[float, ...]

    @property
    def plays(self) -> PrandtlIshlinskii:
        """The sum of plays without the extension and the offset."""
        return PrandtlIshlinskii(thresholds=self.thresholds, weights=self.weights, z0=self.z0)


class PlaySum(ExtendedPlays, Law):
    """A sum of plays after envelopes, with wider thresholds or in front of dead zones: a bank of one of these."""

    step = staticmethod(kernels.step)

    @classmethod
    def pack(cls, tables: Tables) -> Packed:
        """Rows with the parameters that the family has in addition to plays."""
        return Packed(rows_of(tables), cls.initial_memory(tables))

    @abstractmethod
    def refusal(self) -> str | None:
        """Why the law has no inverse; None where it has one."""

    def is_invertible(self) -> bool:
        """Whether the law has an inverse for every output that it reaches."""
        return self.refusal() is None

    def check_invertible(self) -> None:
        """Raise a ValueError if the law is not invertible, or z0 holds positions that no input leads to."""
        if (refusal := self.refusal()) is not None:
            raise ValueError(refusal)
        if self.plays.refusal() is None:
            self.plays.inverse()  # refuses these positions

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | None) -> CompiledLaw:
        """In closed form, from the first sample or from rest: the first input finds the plays at z0, at any speed."""
        self.check_invertible()
        if state is None and u0 is None:
            still = self.inverse_from((0.0, *self.z0))
            parameters = still.parameters.copy()
            parameters[_WIDTH] = 0.0
            u = still.step(read_only(parameters, finite=False), still.state, float(y[0]))
            u0 = u if math.isfinite(u) else 0.0
        return self.inverse_from(self.advance([u0 or 0.0])[1] if state is None else state)

    def compiled_inverse(self, u0: float, limits: Limits = UNLIMITED, sample_time: float = math.inf) -> CompiledLaw:
        self.check_invertible()
        return self.inverse_from(self.advance([u0])[1], limits)

    def unreached(self, sample: int, y: float, inverse: CompiledLaw) -> str:
        return f"no input gives the output at sample {sample} (y = {y:g})"

    def inverse_from(self, state: State, limits: Limits = UNLIMITED) -> CompiledLaw:
        """The inverse of the law in this state, as `hysim.kernels.inverses` has it."""
        law, _ = self._begun(state[0], state)
        y = kernels.step(law.parameters, law.state.copy(), state[0])
        parameters = read_only(np.concatenate([limits, law.parameters]), finite=False)
        return CompiledLaw(kernels.inverse_step, parameters, np.concatenate([[state[0], y], law.state]))
