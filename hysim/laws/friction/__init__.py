"""Friction and backlash, whose force depends on the velocity as well as on the path."""
