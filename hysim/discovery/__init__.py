"""Discovery of hysteresis laws from records: sparse regression that runs free and is judged by that."""

from hysim.discovery._discover import discover
from hysim.discovery._judgement import Judgement
from hysim.discovery._oscillator import discover_oscillator
from hysim.discovery._result import Discovery, OscillatorDiscovery

__all__ = ["Discovery", "Judgement", "OscillatorDiscovery", "discover", "discover_oscillator"]
