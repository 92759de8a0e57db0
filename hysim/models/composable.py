"""Sums and cascades by operators: ``law + law``, ``law >> plant``."""

from typing import Any

from hysim._frozen import items
from hysim.models.protocols import Responding


class Composable:
    """What can be a part of a `hysim.Sum` and a stage of a `hysim.Cascade`.

    An operand that is a structure, or holds one, makes the structure of the whole.
    """

    def __add__(self, other: "Composable") -> Any:
        """Sum of the outputs; a sum among the operands adds its own parts."""
        from hysim.models.sum import Sum, SumStructure

        return _composed(self, other, "parts", Sum, SumStructure)

    def __rshift__(self, other: "Composable") -> Any:
        """`other` behind this; a cascade among the operands adds its own stages."""
        from hysim.models.cascade import Cascade, CascadeStructure

        return _composed(self, other, "stages", Cascade, CascadeStructure)


def _composed(first: Any, second: Any, field: str, whole: type, structure: type) -> Any:
    if not isinstance(second, Composable):
        return NotImplemented
    members = [
        member
        for operand in (first, second)
        for member in (items(operand)[field] if isinstance(operand, whole | structure) else (operand,))
    ]
    simulated = all(isinstance(member, Responding) for member in members)
    return (whole if simulated else structure)(**{field: tuple(members)})
