"""Hysteresis laws, and curves and dashpots beside them: one family a file, its equation on top."""
