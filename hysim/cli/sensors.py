"""Sensors on a structure, by the names that its signals have in the columns of `hysim simulate`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hysim.records import Record

if TYPE_CHECKING:
    from hysim.plants.structures.search import StructureRecord

_OF_NODES = ("displacement", "velocity", "acceleration")
_OF_ELEMENTS = ("drift", "force")


def of_structure(structure: Any, record: Record, columns: Mapping[str, Any]) -> "StructureRecord":
    """The record of a structure, with the channels of these names as its sensors.

    A ValueError is raised if the model is no structure, a name is none of its signals, or the record has no time.
    """
    from hysim.plants.structures.search import StructureRecord
    from hysim.plants.structures.structure import Structure

    if not isinstance(structure, Structure):
        raise ValueError(f"--sensor is for structures in a file, got a {_name(structure)}: name its output by --y")
    if record.t is None:
        raise ValueError("a structure needs the times of its record: name their column by --t, or use --sample-time")
    sizes = dict.fromkeys(_OF_NODES, structure.n_nodes) | dict.fromkeys(_OF_ELEMENTS, len(structure.elements))
    signals: dict[str, Any] = {}
    for name in columns:
        signal, place = _signal(name, sizes)
        signals.setdefault(signal, np.full((len(record), sizes[signal]), np.nan))[:, place] = record.channel(name)
    return StructureRecord(t=record.t, u=record.u, name=record.name, **signals)


def _signal(name: str, sizes: Mapping[str, int]) -> tuple[str, int]:
    """Signal of a structure and place in it of a name such as drift_0; masses are counted from 1."""
    signal, _, number = name.rpartition("_")
    first = 1 if signal in _OF_NODES else 0
    if signal not in sizes or not number.isdecimal() or not 0 <= int(number) - first < sizes[signal]:
        known = ", ".join(
            f"{each}_{first} to {each}_{first + size - 1}"
            for each, size in sizes.items()
            for first in [1 if each in _OF_NODES else 0]
        )
        raise ValueError(f"the structure has no signal {name!r}: its signals are {known}")
    return signal, int(number) - first


def _name(model: Any) -> str:
    return model.__name__ if isinstance(model, type) else type(model).__name__
