"""What pytest leaves out: the examples of modules that need an extra which is not installed."""

from importlib.util import find_spec

_NEEDS = {
    "hysim/vision/_displacement.py": ("skimage",),
    "hysim/posterior/_sample.py": ("emcee",),
    "hysim/posterior/_evidence.py": ("emcee", "dynesty"),
    "hysim/plot/_posterior.py": ("emcee",),
}
collect_ignore = [path for path, packages in _NEEDS.items() if not all(map(find_spec, packages))]
