"""Subjects of `hysim.identify` that are searched part by part before all parts are searched at once."""
