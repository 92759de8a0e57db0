"""Discovery of hysteresis laws from records: sparse regression that runs free and is judged by that."""

from hysim.discovery._discover import Discovery, discover
from hysim.discovery._oscillator import FoundOscillator, oscillator
from hysim.discovery._validation import cross_validated_rmse, refit

__all__ = ["Discovery", "FoundOscillator", "cross_validated_rmse", "discover", "oscillator", "refit"]
