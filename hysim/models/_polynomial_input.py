"""A law whose input coefficients are one parameter, ``input_coefficients = (c1, c2, ...)``."""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hysim.models._memory_law import MemoryLaw
from hysim.models.search_space import Parameters


class PolynomialInput(MemoryLaw):
    """Names c1, c2, ... ``input_coefficients[0]``, ``input_coefficients[1]``, ..., for `identify` and batches."""

    input_coefficients: tuple[float, ...]

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """One name for each input coefficient."""
        return tuple(f"input_coefficients[{k}]" for k in range(len(self.input_coefficients)))

    @classmethod
    def _from_scalars(cls, scalars: Mapping[str, float]) -> Self:
        plain: dict[str, Any] = {k: v for k, v in scalars.items() if not k.startswith("input_coefficients[")}
        degree = len(scalars) - len(plain)
        return cls(**plain | {"input_coefficients": [scalars[f"input_coefficients[{k}]"] for k in range(degree)]})

    @classmethod
    def _to_scalars(cls, parameters: Parameters) -> dict[str, npt.ArrayLike]:
        scalars = dict(parameters)
        coefficients = np.atleast_2d(np.asarray(scalars.pop("input_coefficients", cls.input_coefficients), float))
        return scalars | {f"input_coefficients[{k}]": column for k, column in enumerate(coefficients.T)}
