"""What pytest leaves out: the examples of modules that need an extra which is not installed."""

from importlib.util import find_spec

collect_ignore = [] if find_spec("skimage") else ["hysim/vision/_displacement.py"]
