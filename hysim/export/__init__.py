"""Laws, plants and controllers outside Python: C99, functional mock-up units, pages for a browser."""

from hysim.export._page import to_page as to_page
from hysim.export._page_presets import explorer as explorer
