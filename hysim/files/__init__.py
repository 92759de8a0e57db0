"""Records from files and into files."""

from hysim.files._load import load
from hysim.files._save import ending, packed, save_record
from hysim.files._table import Notes

__all__ = ["Notes", "ending", "load", "packed", "save_record"]
