"""Versions of hysim and of what it stands on, for reports of errors."""

import platform
import sys
from importlib import metadata

from hysim import __version__

DEPENDENCIES = ("numpy", "scipy", "numba", "matplotlib", "pysindy", "control", "threadpoolctl")
EXTRAS = ("h5py", "scikit-image", "imageio", "marimo", "pandas", "xarray", "dask", "distributed")


def show_versions() -> None:
    """Print the versions of hysim, Python, the machine, and every library that hysim can use.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.show_versions()  # doctest: +ELLIPSIS
    hysim ...
    """
    found = {
        "hysim": __version__,
        "Python": f"{platform.python_version()} ({platform.python_implementation()}, {sys.byteorder} endian)",
        "platform": platform.platform(),
        **{name: _version(name) for name in DEPENDENCIES + EXTRAS},
    }
    width = max(map(len, found))
    print("\n".join(f"{name:<{width}}  {version}" for name, version in found.items()))


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
