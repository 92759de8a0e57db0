"""The rows of a study that are done.

The first task that succeeds, in the order of the study and not of time, sets the names and shapes of a row. A task that
returns others has failed.
"""

from collections.abc import Iterable

import numpy as np

from hysim._frozen import FloatArray
from hysim.sweeps._chunks import Group, Layout, Outcome
from hysim.sweeps._space import OWN_NAMES


class Table:
    """Values of the tasks that are done, nan elsewhere, one column for each output, shape (n_tasks, *shape)."""

    def __init__(self, n_tasks: int, parameters: Iterable[str]) -> None:
        self.layout: Layout | None = None
        self.values: dict[str, FloatArray] = {}
        self.errors: dict[int, str] = {}
        self.seconds = np.full(n_tasks, np.nan)
        self.done = np.zeros(n_tasks, dtype=bool)
        self._other_names = (*OWN_NAMES, *parameters)

    def judge(self, outcome: Outcome) -> Outcome:
        """The outcome with the values of the study's layout, and an error for every task that returned another.

        Until a task has succeeded, outcomes must be passed in the order of their places.
        """
        if self.layout is None and outcome.groups:
            self.begin(min(outcome.groups, key=lambda group: int(group.places.min())).layout)
        errors, groups = dict(outcome.errors), []
        for group in outcome.groups:
            if dict(group.layout) == dict(self.layout or ()):
                groups.append(self._in_order(group))
            else:
                errors |= dict.fromkeys(group.places.tolist(), self._mismatch(group.layout))
        return outcome._replace(groups=tuple(groups), errors=errors)

    def begin(self, layout: Layout) -> None:
        """Set the layout of the study; ValueError if an output has the name of another column."""
        for name, shape in layout:
            if name in self._other_names:
                raise ValueError(f"the task returned {name}, which is the name of another column: rename the output")
            self.values[name] = np.full((self.done.size, *shape), np.nan)
        self.layout = layout

    def restore(self, layout: Layout | None, outcome: Outcome) -> None:
        """Enter the rows of a store."""
        if layout:
            self.begin(layout)
        self.enter(outcome)

    def enter(self, outcome: Outcome) -> None:
        """Enter an outcome of `judge`."""
        for group in outcome.groups:
            for (name, _), column in zip(group.layout, group.columns, strict=True):
                self.values[name][group.places] = column
        self.errors |= outcome.errors
        self.seconds[outcome.places] = outcome.seconds
        self.done[outcome.places] = True

    def _in_order(self, group: Group) -> Group:
        layout = self.layout or ()
        columns = dict(zip(dict(group.layout), group.columns, strict=True))
        return Group(layout, group.places, tuple(columns[name] for name, _ in layout))

    def _mismatch(self, layout: Layout) -> str:
        first = _shown(self.layout or ())
        return f"ValueError: the task returned {_shown(layout)}, where the first that succeeded returned {first}"


def _shown(layout: Layout) -> str:
    return ", ".join(f"{name} of shape {shape}" if shape else f"the number {name}" for name, shape in layout)
