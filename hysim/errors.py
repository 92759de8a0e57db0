"""The one error class of hysim; wrong arguments raise the built-in `ValueError` or `TypeError`."""


class SimulationError(RuntimeError):
    """A simulation diverged; the message names the sample or the time."""
