"""The errors of hysim; wrong arguments raise the built-in `ValueError` or `TypeError`."""

from typing import Any


class SimulationError(RuntimeError):
    """A simulation diverged; the message names the sample or the time."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C after a part of the work was done; `finished` is the result of that part."""

    def __init__(self, message: str, finished: Any) -> None:
        super().__init__(message)
        self.finished = finished
