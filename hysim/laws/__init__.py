"""Hysteresis laws, curves and dashpots: one family a file, its equation on top."""
