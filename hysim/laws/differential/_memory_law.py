"""Laws with one memory z and a polynomial of the input.

    dz/du = f(u, z, sign(du))
    y = offset + c1 u + c2 u^2 + ... + gain z

u is the input, z the memory, y the output; time has no part in it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hysim._basics.frozen import FloatArray
from hysim.kernels.boucwen import polynomial
from hysim.laws.differential import _boucwen_search, boucwen_inverse
from hysim.models.law import Law, State, moving, of_sets
from hysim.models.protocols import CompiledLaw
from hysim.models.search_space import ALL_FREE, Freedom, Parameters, SearchSpace
from hysim.models.steady_cycle import Pass, PassOf
from hysim.models.tables import Tables
from hysim.records import Record


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapedLaw(Law):
    """A law with the parameters of a Bouc-Wen memory in front of those of its family."""

    A: float = 1.0
    beta: float = 0.5
    gamma: float = 0.5
    n: float = 1.0


class MemoryLaw(ShapedLaw):
    """A law with one memory z, and an output that is a polynomial of u plus gain z.

    Its inverse is exact to the rounding of the output's terms, or to 1e-10 of the range for a law by its slope.

    `polynomial` names the field of the coefficients c1, c2, ..., a tuple or a single number.
    """

    polynomial: ClassVar[str] = "input_coefficients"
    elementary: ClassVar[tuple[float, ...]] = ()  # exponents for which the step is another one
    positive = ("n",)
    units: ClassVar[Mapping[str, str]] = {"n": "1", "offset": "y"}

    slope: ClassVar[Any]
    gain: float
    offset: float
    z0: float

    @staticmethod
    def output(p: Any, z: float, u: float) -> float:
        """Output y = offset + c1 u + c2 u^2 + ... + gain z."""
        return float(p.offset + polynomial(u, p.input_coefficients, 0) + p.gain * z)

    @classmethod
    def check(cls, tables: Tables) -> None:
        super().check(tables)
        if not tables[cls.polynomial].size:
            raise ValueError(f"{cls.polynomial} must hold at least one coefficient")

    @classmethod
    def order(cls, tables: Tables) -> npt.NDArray[np.intp] | None:
        """Order that groups laws of equal n, which share their charts (`hysim.kernels.charts`)."""
        n = tables["n"][:, 0]
        return None if (np.diff(n) >= 0.0).all() else np.argsort(n, kind="stable")

    @property
    def structural(self) -> tuple[str, ...]:
        """The exponent where it has a step of its own."""
        return ("n",) if self.n in self.elementary else ()

    @property
    def input_polynomial(self) -> FloatArray:
        """(c1, c2, ...)."""
        return self.tables[self.polynomial].flatten()

    @property
    def input_slope(self) -> FloatArray:
        """Slope of the polynomial of the input, coefficients in ascending powers."""
        c = self.input_polynomial
        return np.asarray(c * np.arange(1.0, c.size + 1.0))

    @cached_property
    def powers(self) -> Mapping[str, int | None]:  # type: ignore[override]
        coefficients = (name for name in self.scalars if name.partition("[")[0] == self.polynomial)
        return {**{name: k for k, name in enumerate(coefficients, 1)}, "gain": None, "offset": 0}

    @cached_property
    def columns(self) -> tuple[str, ...]:
        return tuple(self.powers)

    def tangent(
        self, direction: npt.ArrayLike, z: npt.ArrayLike, u: npt.ArrayLike = 0.0, *others: npt.ArrayLike
    ) -> FloatArray:
        """Slope dy/du [unit of y / unit of u] at the memory `z`, for an input at `u` that moves in `direction`.

        The direction is the velocity u' or its sign; one that is zero has two slopes, and raises ValueError. z, u and
        the further elements of the law's state, `others` in their order, are broadcast against it.
        """
        velocity, memory, inputs = moving(direction), np.asarray(z, dtype=float), np.asarray(u, dtype=float)
        static = np.polynomial.polynomial.polyval(inputs, self.input_slope)
        further = (np.asarray(other, dtype=float) for other in others)
        return np.asarray(static + self.gain * self._memory_slope(np.sign(velocity), memory, inputs, *further))

    def _memory_slope(self, direction: FloatArray, z: FloatArray, u: FloatArray, *others: FloatArray) -> FloatArray:
        """Slope dz/du for an input at `u` that moves in `direction`, 1 or -1."""
        hidden = self.packed[1].size - 2
        further = (*others, *(np.zeros(()) for _ in range(hidden - len(others))))
        slope = np.vectorize(lambda s, *x: np.ravel(self.slope(self, *x, s))[0], otypes=[float])
        return np.asarray(slope(direction, z, *further, u))

    def search_space(self, record: Record, freedom: Freedom = ALL_FREE) -> SearchSpace:
        return _boucwen_search.search_space(self, record, freedom)

    def alike(self, record: Record, freedom: Freedom) -> tuple[tuple[str, ...], ...]:
        """Groups of parameters; one parameter of each group is held on this record."""
        return ()

    def inverse_begun(self, y: FloatArray, u0: float | None, state: State | None) -> CompiledLaw:
        """By a search on the step, from the input that gives the first output with the memory at z0."""
        if state is None:
            first = boucwen_inverse.at_rest(self, float(y[0]))[0] if u0 is None else float(u0)
            state = self.state_at(first)
        u, z, *_ = state
        powers = [abs(c * u**k) for k, c in enumerate(self.input_polynomial.tolist(), 1)]
        terms = float(abs(self.offset) + sum(powers) + abs(self.gain * z))
        if self.hidden_states:  # an integrated memory is known to a tolerance of its range
            terms += self.tolerance / np.finfo(float).eps * float(np.abs(y).max())
        return self.search_inverse(state, terms=terms)

    def _passes(self, parameters: Parameters, u: FloatArray) -> PassOf:
        def of(sets: npt.NDArray[np.intp]) -> Pass:
            own = {**of_sets(parameters, sets), **self.memory_only}

            def passed(z: FloatArray) -> FloatArray:
                begun = {**own, "z0": np.nan_to_num(z[:, 0], posinf=0.0, neginf=0.0)}
                end = self.outputs_of(begun, u).reduced("final", None, None)[:, np.newaxis]
                return np.where(np.isfinite(z) & np.isfinite(end), end, np.nan)

            return passed

        return of
