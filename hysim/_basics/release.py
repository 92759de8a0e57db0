"""Version of hysim."""

__version__ = "0.2.0"
