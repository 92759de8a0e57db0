"""Sums and cascades by operators: ``law + law``, ``law >> plant``."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Self

from hysim._basics.frozen import LAST, FloatArray, items, own_items
from hysim._basics.results import model_or_class
from hysim.models.model import Example
from hysim.models.protocols import Responding
from hysim.models.tables import Tables, arguments_of, check_signs, check_within, scalars_of


class _Kind(NamedTuple):
    """A way to compose models: the model made, the structure made, and the field of both that holds the members."""

    model: type
    structure: type
    field: str


_KINDS: dict[str, _Kind] = {}


def register(operator: str, model: type, structure: type, field: str) -> None:
    """Say what the operator ``"+"`` or ``">>"`` makes; `hysim.models` registers both."""
    _KINDS[operator] = _Kind(model, structure, field)


class Composable:
    """Base class of what can be a part of a `hysim.Sum` and a stage of a `hysim.Cascade`.

    An operand that is a structure, or holds one, makes a structure. A result of a fit stands for its model.

    Attributes
    ----------
    example : Example, optional
        The law that stands for a family of hysim.
    short : str
        Another name of the family, which the command line prefers; empty if there is none.
    units : mapping
        Units of fields in those of u and y, such as ``"y/u"``, beside those of parameters that are searched; ``"1"``
        is dimensionless. A number whose unit depends on a choice is not listed.
    filters_input : bool
        Whether it is a stage in front of a law for noisy inputs; a command has no noise, so that inverses leave it out.
    """

    example: ClassVar[Example | None] = None
    short: ClassVar[str] = ""
    units: ClassVar[Mapping[str, str]] = MappingProxyType({})
    filters_input: ClassVar[bool] = False

    def __add__(self, other: "Composable") -> Any:
        return _joined(self, other, _KINDS["+"])

    def __radd__(self, other: Any) -> Any:
        return _joined(other, self, _KINDS["+"])

    def __rshift__(self, other: "Composable") -> Any:
        return _joined(self, other, _KINDS[">>"])

    def __rrshift__(self, other: Any) -> Any:
        return _joined(other, self, _KINDS[">>"])


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed(Composable):
    """Base class of laws: where the initial memory holds, and where the law was identified.

    A family lists fields whose numbers must be `positive`, or `not_negative`, or `within` other limits, such as
    ``{"z0": ("of a size of at most", 1.0)}``.

    Parameters
    ----------
    u0 : float, optional
        Input at which the initial memory holds [unit of u]. The law first moves from there to the first sample of any
        input. By default it is that first sample itself.
    u_range : (float, float), optional
        Lowest and highest input of the record that the law was identified on [unit of u]; inverses and loops warn
        beyond it. It does not count in comparisons.
    """

    u0: float | None = field(default=None, metadata=LAST)
    positive: ClassVar[tuple[str, ...]] = ()
    not_negative: ClassVar[tuple[str, ...]] = ()
    within: ClassVar[Mapping[str, tuple[str, float]]] = {}
    # Any, so that type checkers take BoucWen(**parameters) with a dict of floats
    u_range: Any = field(default=None, compare=False, metadata={**LAST, "kind": tuple[float, ...] | None})

    @classmethod
    def completed(cls, tables: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """The tables with what the constructor would add."""
        return tables

    @classmethod
    def check(cls, tables: Tables) -> None:
        """Raise a ValueError where the tables, every field over sets, hold parameters that are no law."""
        check_signs(tables, cls.positive, cls.not_negative)
        check_within(tables, cls.within)

    @property
    def arguments(self) -> dict[str, Any]:
        return own_items(self)

    @property
    def scalars(self) -> dict[str, float]:
        """Every number by the name that `hysim.identify` has for it, ``name`` or ``name[k]``."""
        return scalars_of(self.arguments)

    def with_scalars(self, scalars: Mapping[str, float]) -> Self:
        """The law with other numbers, by their names in `scalars`; ValueError if the constructor refuses them."""
        return type(self)(**{**items(self), **arguments_of({**self.scalars, **scalars})})

    def placed(self, u0: float | None, u_range: tuple[float, ...] | None = None) -> Self:
        """This law with its memory at the input `u0`, and the range of the identified input."""
        return replace(self, u0=u0, u_range=u_range)


def _joined(first: Any, second: Any, kind: _Kind) -> Any:
    first, second = model_or_class(first), model_or_class(second)
    if not (isinstance(first, Composable) and isinstance(second, Composable)):
        return NotImplemented
    kinds = kind.model, kind.structure
    members = [
        member
        for operand in (first, second)
        for member in (items(operand)[kind.field] if isinstance(operand, kinds) else (operand,))
    ]
    simulated = all(isinstance(member, Responding) for member in members)
    return (kind.model if simulated else kind.structure)(**{kind.field: tuple(members)})
