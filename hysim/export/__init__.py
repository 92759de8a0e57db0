"""Laws, plants and controllers outside Python: C99, functional mock-up units, pages for a browser."""

from hysim.export._fmu import to_fmu as to_fmu
