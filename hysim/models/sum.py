"""Models side by side under one input, such as a law with a dashpot beside it."""

from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from hysim._frozen import FloatArray, read_only
from hysim.kernels.stepping import side_by_side
from hysim.models._composite import Composite, State, continued, known_slopes
from hysim.models._sum_search import SumStructure
from hysim.models.compiled_step import startable
from hysim.models.model import family
from hysim.models.parts import check_parts, compiled_law, compiled_pair, labels, response_of, startable_pair
from hysim.models.protocols import CompiledLaw, Startable, placed

__all__ = ["Sum", "SumStructure"]


@family
class Sum(Composite):
    """Models side by side, whose outputs are added; ``first + second`` is short for it.

    Magnetorheological dampers are a Bouc-Wen law, a dashpot and a spring (B. F. Spencer et al., J. Eng. Mech. 123,
    1997).

    Parameters
    ----------
    parts : tuple of models
        Laws, such as `BoucWen` or `Line`, and plants that depend on time, such as `Dashpot` or `TransferFunction`.

    Raises
    ------
    TypeError
        If a part is not a model with a response.
    ValueError
        If the sum is empty.

    Examples
    --------
    >>> import hysim as hs
    >>> damper = hs.BoucWen() + hs.Dashpot(c=2.0)
    >>> damper.response([0.0, 1.0, 1.0], sample_time=0.5).round(6).tolist()
    [0.0, 4.632121, 0.632121]
    >>> twice = hs.Play(threshold=0.25) + hs.Line(slope=1.0)
    >>> twice.inverse_response(twice.response([0.0, 1.0, 0.75, 0.0])).round(9).tolist()
    [0.0, 1.0, 0.75, 0.0]
    """

    parts: tuple[Any, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", check_parts(self.parts, "parts"))

    @classmethod
    def candidates(cls) -> dict[str, Any]:
        """None for `hysim.compare`: a sum has the parts that it is given."""
        return {}

    @classmethod
    def structure(cls, *parts: Any) -> SumStructure:
        """Parts for `hysim.identify` and `hysim.compare`: classes, structures, and models as starts.

        A model that cannot be identified is taken as it is.

        Examples
        --------
        >>> import hysim as hs
        >>> fit = hs.identify(hs.Sum.structure(hs.Play, hs.Line), hs.datasets.table1())
        >>> fit.free_names
        ('play.threshold', 'play.gain', 'play.z0', 'line.offset', 'line.slope')
        """
        return SumStructure(parts=parts)

    @property
    def members(self) -> tuple[Any, ...]:
        """The parts."""
        return self.parts

    def with_members(self, members: tuple[Any, ...]) -> "Sum":
        return Sum(parts=members)

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> "Sum":
        return Sum(parts=tuple(placed(part, u0, u_range) for part in self.parts))

    def response(self, u: npt.ArrayLike, sample_time: float | None = None) -> FloatArray:
        inputs = read_only(u, "u", ndim=1)
        return _total([response_of(part, inputs, sample_time) for part in self.parts])

    def advance(
        self, u: npt.ArrayLike, state: State | None = None, *, sample_time: float | None = None
    ) -> tuple[FloatArray, State]:
        inputs = read_only(u, "u", ndim=1)
        states: State = (None,) * len(self.parts) if state is None else state
        if not inputs.size:
            return inputs, states
        pairs = [continued(part, inputs, sample_time, each) for part, each in zip(self.parts, states, strict=True)]
        return _total([y for y, _ in pairs]), tuple(end for _, end in pairs)

    def signals(self, u: npt.ArrayLike, sample_time: float | None = None) -> dict[str, FloatArray]:
        """Output ``"y"`` and those of the parts by name, such as ``"dashpot"``; see `response`."""
        inputs = read_only(u, "u", ndim=1)
        own = [response_of(part, inputs, sample_time) for part in self.parts]
        return {"y": _total(own), **dict(zip(labels(self.parts), own, strict=True))}

    def compiled(self, u0: float = 0.0, *, sample_time: float | None = None) -> CompiledLaw:
        laws = [compiled_law(part, u0, sample_time) for part in self.parts]
        return reduce(lambda first, second: compiled_pair(side_by_side, first, second), laws)

    def startable(self, sample_time: float | None = None) -> Startable:
        parts = [startable(part, sample_time) for part in self.parts]
        return reduce(lambda first, second: startable_pair(side_by_side, first, second), parts)

    @property
    def known_slopes(self) -> tuple[float, float]:
        lowest, highest = map(sum, zip(*known_slopes(self.parts), strict=True))
        return lowest, highest

    def as_structure(self) -> SumStructure:
        """The structure of the same members, those that can be identified as starts."""
        return SumStructure(parts=self.parts)


def _total(outputs: list[FloatArray]) -> FloatArray:
    return np.asarray(reduce(np.add, outputs))
