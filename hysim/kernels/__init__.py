"""Compiled numerics on plain floats and arrays; nothing here knows a class."""
