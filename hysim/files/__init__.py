"""Records from files and into files."""

from hysim.files._ground_motion import column_names, is_at2, load_ground_motion
from hysim.files._load import FileColumn, list_columns, load
from hysim.files._save import ending, join_records, packed, save_record
from hysim.files._table import Notes

__all__ = ["FileColumn", "Notes", "list_columns", "load", "load_ground_motion"]
__all__ += ["column_names", "ending", "is_at2", "join_records", "packed", "save_record"]
