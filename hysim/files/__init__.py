"""Records from files and into files."""

from hysim.files._ground_motion import column_names as column_names
from hysim.files._ground_motion import is_at2 as is_at2
from hysim.files._ground_motion import load_ground_motion as load_ground_motion
from hysim.files._load import FileColumn as FileColumn
from hysim.files._load import list_columns as list_columns
from hysim.files._load import load as load
from hysim.files._save import ending as ending
from hysim.files._save import join_records as join_records
from hysim.files._save import packed as packed
from hysim.files._save import save_record as save_record
from hysim.files._table import Notes as Notes
