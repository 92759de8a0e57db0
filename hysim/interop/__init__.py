"""Tables of other libraries: pandas, polars, Arrow and xarray, read and made without depending on any of them."""

from hysim.interop._making import dataset, frame
from hysim.interop._reading import ForeignTable, channels_of, table_in, unit_in
from hysim.interop._series import told_by
from hysim.interop._values import heading

__all__ = ["ForeignTable", "channels_of", "dataset", "frame", "heading", "table_in", "told_by", "unit_in"]
