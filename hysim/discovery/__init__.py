"""Discovery of hysteresis laws from records: sparse regression that runs free and is judged by that."""

from hysim.discovery._discover import discover
from hysim.discovery._judgement import Judgement
from hysim.discovery._result import Discovery

__all__ = ["Discovery", "Judgement", "discover"]
