"""Wheels with compiled code: `HATCH_BUILD_HOOK_ENABLE_CUSTOM=true python -m build`. All others need no hook.

The code is that of `hysim warm-up` for any processor of x86-64-v3, where `hysim/kernels/_compile.py` looks for it. It
serves the version of Python that builds, and of numba that the build installs.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

COMPILED = "hysim/kernels/compiled"
SETTINGS = {
    "NUMBA_CPU_NAME": "x86-64-v3",
    "NUMBA_CPU_FEATURES": "",  # those of the name, and none of this machine
    "NUMBA_DISABLE_INTEL_SVML": "1",  # a library that others may lack
    "NUMBA_CACHE_LOCATOR_CLASSES": "hysim.kernels._compile.Shipped",
    "NUMBA_DEBUG_CACHE": "1",
    "PYTHONUNBUFFERED": "1",  # searches run in further processes, whose lines would be lost
}


def copy_with_code(package: Path, parent: Path) -> Path:
    """Copy the package into the folder `parent`, and compile there; the folder of the code.

    A second run loads what the first has compiled. What it does not ask for is part of other functions, and is removed.
    """
    shutil.copytree(package, parent / "hysim", ignore=shutil.ignore_patterns("__pycache__", "compiled"))
    folder, used = parent.resolve() / COMPILED, set[Path]()
    folder.mkdir()
    for action in ("saved to", "loaded from"):
        command = [sys.executable, "-m", "hysim", "warm-up", "--quiet"]
        environment = os.environ | SETTINGS | {"PYTHONPATH": os.pathsep.join(sys.path)}
        place = folder.parent.parent.parent
        run = subprocess.run(command, cwd=place, env=environment, stdout=subprocess.PIPE, text=True, check=True)
        used = {Path(path) for path in re.findall(rf"\[cache\] data {action} '(.*)'", run.stdout)}
        if not used:
            raise RuntimeError(f"nothing was {action} {folder}: are numba's messages others?")
    used |= {file.with_suffix("").with_suffix(".nbi") for file in used}
    for file in folder.rglob("*.nb?"):
        if file not in used:
            file.unlink()
    return folder


class Hook(BuildHookInterface):
    """Adds the code to a wheel, which is then one of a platform."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        if platform.machine().lower() not in ("x86_64", "amd64"):
            raise RuntimeError(f"compiled code is for x86-64, and this is {platform.machine()}")
        self.parent = tempfile.TemporaryDirectory()
        folder = copy_with_code(Path(self.root) / "hysim", Path(self.parent.name))
        build_data["force_include"][str(folder)] = COMPILED
        build_data["pure_python"] = False
        if sys.platform == "linux":  # it is linked by numba when it is loaded, and needs no library of this machine
            python = f"cp{sys.version_info.major}{sys.version_info.minor}"
            build_data["tag"] = f"{python}-{python}-manylinux_2_17_x86_64"
        else:
            build_data["infer_tag"] = True
