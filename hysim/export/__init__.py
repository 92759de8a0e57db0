"""Laws, plants and controllers outside Python: C99, functional mock-up units, pages for a browser."""

from hysim.export._c import UntranslatableError
from hysim.export._c_source import CSource, to_c
from hysim.export._fmu import to_fmu
from hysim.export._page import Shown, explorer, page_text, to_page
from hysim.export._program import Field, Program, program_of

__all__ = [
    "CSource", "Field", "Program", "Shown", "UntranslatableError", "explorer", "page_text", "program_of", "to_c",
    "to_fmu", "to_page",
]  # fmt: skip
