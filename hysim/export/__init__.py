"""Laws, plants and controllers outside Python: C99, functional mock-up units, pages for a browser."""
