"""Results as notebooks show them: a table, and a small figure."""

from hysim.notebooks._pages import page

__all__ = ["page"]
