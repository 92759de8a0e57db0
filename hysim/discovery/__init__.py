"""Discovery of hysteresis laws from records: sparse regression that runs free and is judged by that."""

from hysim.discovery._discover import Discovery, discover
from hysim.discovery._validation import leave_one_out, refit

__all__ = ["Discovery", "discover", "leave_one_out", "refit"]
