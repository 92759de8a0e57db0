"""Version of hysim."""

__version__ = "0.1.0"
