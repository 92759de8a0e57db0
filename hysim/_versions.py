"""Versions of hysim and its dependencies, for bug reports."""

import platform
import sys
from importlib import metadata

from hysim._release import __version__

DEPENDENCIES = ("numpy", "scipy", "numba", "matplotlib", "pysindy", "control", "threadpoolctl")
EXTRAS = ("h5py", "scikit-image", "imageio", "marimo", "pandas", "xarray", "dask", "distributed")


def show_versions() -> None:
    """Print the versions of hysim, Python, the platform, and every library that hysim can use.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.show_versions()  # doctest: +ELLIPSIS
    hysim ...
    """
    versions = {
        "hysim": __version__,
        "Python": f"{platform.python_version()} ({platform.python_implementation()}, {sys.byteorder} endian)",
        "platform": platform.platform(),
        **{name: _version(name) for name in DEPENDENCIES + EXTRAS},
    }
    width = max(map(len, versions))
    print("\n".join(f"{name:<{width}}  {version}" for name, version in versions.items()))


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
