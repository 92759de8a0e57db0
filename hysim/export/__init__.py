"""Laws, plants and controllers outside Python: C99, functional mock-up units, pages for a browser."""

from hysim.export._c import UntranslatableError as UntranslatableError
from hysim.export._c_source import CSource as CSource
from hysim.export._c_source import to_c as to_c
from hysim.export._fmu import to_fmu as to_fmu
from hysim.export._page import Shown as Shown
from hysim.export._page import explorer as explorer
from hysim.export._page import page_text as page_text
from hysim.export._page import to_page as to_page
from hysim.export._program import Field as Field
from hysim.export._program import Program as Program
from hysim.export._program import program_of as program_of
