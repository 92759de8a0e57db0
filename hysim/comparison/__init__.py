"""Models side by side: `compare`, and the table with its verdict."""

from hysim.comparison._compare import compare
from hysim.comparison._result import Comparison, ComparisonRow
from hysim.comparison._verdict import Contrast

__all__ = ["Comparison", "ComparisonRow", "Contrast", "compare"]
