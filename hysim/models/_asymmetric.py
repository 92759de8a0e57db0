"""What the asymmetric Bouc-Wen laws share: a compiled step, on which everything else is built.

A law says how its step is called, and which parameters it takes. Paths and batches drive the step, so that they
agree to the bit, and the inverse searches on it.
"""

from abc import abstractmethod
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim._parallel import in_pieces
from hysim.errors import SimulationError
from hysim.kernels.batches import drive_each
from hysim.kernels.stepping import Step, drive
from hysim.models import _inverse_search
from hysim.models._memory_batch import Kernel
from hysim.models._memory_law import State
from hysim.models._polynomial_input import PolynomialInput
from hysim.models.model import CompiledLaw
from hysim.models.polynomial_boucwen import PolynomialBoucWen

_MEMORY_ITSELF = np.array([[1.0, 0.0]])  # gain and offset with which the output is z


class SteppedLaw(PolynomialInput):
    """A law of which path, batch and inverse are made from its step."""

    state_size: ClassVar[int]

    @property
    @abstractmethod
    def _step(self) -> Step:
        """The step as `hysim.kernels.stepping` has it; it takes a zero in the last place of its state as new."""

    @staticmethod
    @abstractmethod
    def _step_parameters(memory: FloatArray, output: FloatArray) -> FloatArray:
        """The parameters of the step, (n_sets, n_parameters), from those of `hysim.models._batch.Batch`."""

    def compiled(self, u0: float = 0.0) -> CompiledLaw:
        """The law as compiled loops take it; the state is that of a first sample at the input `u0`."""
        scalars = self.scalars
        return self._compiled(
            np.array([[scalars[name] for name in ("gain", "offset", *self.coefficient_names)]]),
            self._start(np.array([u0])),
        )

    def inverse_response(self, y: npt.ArrayLike, u0: float | None = None, state: State | None = None) -> FloatArray:
        """Input that gives the output `y`, linear between the samples.

        Parameters
        ----------
        y : array, shape (n_samples,)
            Wanted output.
        u0 : float, optional
            Input at which the law rests, its memory at z0, before it moves to the first sample. By default it
            rests at the first sample: the input that gives y[0] with the memory at z0, found from u = 0.
        state : (float, float), optional
            Input and memory to continue from, in place of u0 and z0.

        Returns
        -------
        array, shape (n_samples,)
            Its `response` is y to the rounding of its terms, and to 1e-12 of the memory's stroke where the law is
            stepped by power series. Where the law turns later, the input is the first one with the output y.

        Raises
        ------
        SimulationError
            If the output does not reach a sample, or does not rise (or fall) all the way there; it names the sample.
        ValueError
            If y is not finite or has not one axis, both u0 and state are given, its first sample does not tell
            the first input (give u0), or the slope is zero where the record begins.
        """
        if state is not None and u0 is not None:
            raise ValueError("give u0 or state, not both: the state has its own input")
        outputs = read_only(y, "y", ndim=1)
        if state is None and u0 is None and outputs.size:
            static = PolynomialBoucWen(
                A=0.0,
                beta=0.0,
                gamma=0.0,
                gain=self.gain,
                offset=self.offset,
                z0=self.z0,
                input_coefficients=self.input_coefficients,
            )
            u0 = float(static.inverse_response(outputs[:1])[0])
        start = self._start(np.array([u0 or 0.0])) if state is None else state
        return _inverse_search.inverse_response_from(self.compiled(start[0]), start, self._terms(*start[:2]), outputs)

    def _terms(self, u: float, z: float) -> float:
        """Size of the terms of the output."""
        powers = [abs(coefficient * u**k) for k, coefficient in enumerate(self.input_coefficients, 1)]
        return abs(self.offset) + sum(powers) + abs(self.gain * z)

    def _compiled(self, output: FloatArray, start: State) -> CompiledLaw:
        memory = np.array([[getattr(self, name) for name in self.memory_names]])
        state = np.zeros(self.state_size)
        state[: len(start)] = start
        return CompiledLaw(self._step, read_only(self._step_parameters(memory, output)[0], finite=False), state)

    @property
    def _batch(self) -> Kernel:
        step, size = self._step, self.state_size

        def batch(
            memory: FloatArray, output: FloatArray, u: FloatArray, out: FloatArray, start: int, stop: int
        ) -> None:
            parameters = read_only(self._step_parameters(memory[start:stop], output[start:stop]), finite=False)
            inputs = u if len(u) == 1 else u[start:stop]
            z0 = read_only(memory[start:stop, -1])
            with np.errstate(all="ignore"):  # an escape overflows, and uncompiled kernels would warn of it
                drive_each(step, parameters, z0, size, inputs, out[start:stop], 0, stop - start)

        return batch

    def _memory(self, u: FloatArray, state: State) -> tuple[FloatArray, State]:
        law = self._compiled(_MEMORY_ITSELF, state)
        z = np.empty(u.size)
        with np.errstate(all="ignore"):
            escaped = in_pieces(lambda k: drive(law.step, law.parameters, law.state, u[k], z[k]), u.size)
        if escaped >= 0:
            what = "is too stiff to be followed" if np.isnan(z[escaped]) else "escapes to infinity"
            raise SimulationError(f"the memory {what} at sample {escaped} (u = {u[escaped]:g})")
        return z, tuple(law.state[: len(state)].tolist())
