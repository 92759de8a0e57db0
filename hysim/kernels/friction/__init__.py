"""Friction and backlash: what depends on the velocity of the input as well as on its path."""
