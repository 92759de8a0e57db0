"""Records from files."""

from hysim.files._load import load

__all__ = ["load"]
