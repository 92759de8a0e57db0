"""What pictures ask of a result: input and output, and a name and units if it has them."""

from collections.abc import Sequence
from typing import Any, Protocol

from hysim._frozen import FloatArray


class InputOutput(Protocol):
    """What can be drawn as a loop: a Record, a Simulation or the like, with `units` and `name` if it has them."""

    @property
    def u(self) -> FloatArray: ...
    @property
    def y(self) -> FloatArray: ...


def names_of(results: Sequence[Any]) -> list[str]:
    """What results are called: by their own name or their kind, and numbered where several would be called alike."""
    names = [getattr(result, "name", "") or type(result).__name__.lower() for result in results]
    return [name if names.count(name) == 1 else f"{name} {names[:k].count(name) + 1}" for k, name in enumerate(names)]


def units_of(results: Sequence[Any]) -> dict[str, str]:
    """The units of all results, those of the first one that has them."""
    units: dict[str, str] = {}
    for result in results:
        units = dict(getattr(result, "units", {})) | units
    return units
