"""The libraries that hysim uses: their versions, for bug reports, and those that are optional."""

import importlib.util
import platform
import sys
from typing import Any

from hysim._basics.release import __version__

DEPENDENCIES = ("numpy", "scipy", "numba", "matplotlib", "pysindy", "control", "threadpoolctl", "click", "joblib")
EXTRAS = (
    *("h5py", "scikit-image", "imageio", "pandas", "xarray", "dask", "distributed", "ziglang"),
    *("emcee", "dynesty", "arviz"),
)


def show_versions() -> None:
    """Print the versions of hysim, Python, the platform, and every library that hysim can use.

    Examples
    --------
    >>> import hysim as hs
    >>> hs.show_versions()  # doctest: +ELLIPSIS
    hysim ...
    """
    python = f"{platform.python_version()} ({platform.python_implementation()}, {sys.byteorder} endian)"
    versions = {"hysim": __version__, "Python": python, "platform": platform.platform()}
    versions |= {name: _version(name) for name in DEPENDENCIES + EXTRAS}
    width = max(map(len, versions))
    print("\n".join(f"{name:<{width}}  {version}" for name, version in versions.items()))


def optional(library: str, purpose: str, extra: str, error: type[Exception] = ImportError) -> Any:
    """Import a library of an extra; without it, raise an error that says what to install."""
    try:
        return importlib.import_module(library)
    except ImportError:
        raise error(f"{purpose} needs {library.partition('.')[0]}: pip install 'hysim[{extra}]'") from None


def is_installed(library: str) -> bool:
    return importlib.util.find_spec(library) is not None


def _version(name: str) -> str:
    from importlib import metadata  # which takes as long to import as the front door of hysim

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
