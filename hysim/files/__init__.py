"""Records from files and into files."""

from hysim.files._load import load
from hysim.files._save import columns_as, ending, save_columns, save_record
from hysim.files._table import Notes

__all__ = ["Notes", "columns_as", "ending", "load", "save_columns", "save_record"]
