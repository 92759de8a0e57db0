"""A table of another library, such as a DataFrame, as a table to load from."""

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hysim._frozen import FloatArray
from hysim.files._table import Column, Notes, listed, nearest, number_of, positive
from hysim.interop import ForeignTable, unit_in


@dataclass(frozen=True)
class Frame:
    """Columns of a DataFrame or the like."""

    table: ForeignTable

    @property
    def notes(self) -> Notes:
        """Units, resolution, name and channels in the notes of the frame."""
        stated = self.table.notes
        resolution, name, channels = (stated.get(note) for note in ("resolution", "name", "channels"))
        return Notes(
            units=self.table.units,
            resolution=positive(resolution) if isinstance(resolution, float) else None,
            name=name if isinstance(name, str) else None,
            channels=_places(channels) if isinstance(channels, Mapping) else {},
        )

    @property
    def labels(self) -> Sequence[str]:
        """Names of the columns; the last one is the index, where it holds times."""
        return self.table.labels

    def column(self, key: str | int) -> Column:
        """The column of this name, with or without its unit, or of this number from 0."""
        labels, units = self.table.labels, self.table.units
        if isinstance(key, str):
            number = number_of(key, "columns", labels, [f"{label} [{units.get(label)}]" for label in labels])
            if number is None:
                raise ValueError(f"no column {key!r}, the columns are: {listed(labels)}{nearest(key, labels)}")
        elif not 0 <= (number := operator.index(key)) < len(labels):
            raise ValueError(f"no column {key}, there are columns 0 to {len(labels) - 1}")
        return Column(number, labels[number], unit_in(self.table, number))

    def values(self, columns: list[Column]) -> FloatArray:
        """The numbers of the columns, shape (n_columns, n_samples), nan where one is missing."""
        return np.stack([self.table.read(column.place) for column in columns])

    def place(self, sample: int) -> str:
        """The sample's row, counted from 0 whatever the index holds."""
        return f"row {sample}"


def _places(channels: Mapping[Any, Any]) -> dict[str, str | float]:
    return {str(name): each if isinstance(each, str) else float(each) for name, each in channels.items()}
