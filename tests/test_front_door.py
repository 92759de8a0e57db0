"""`import hysim` is light, and every public name is there."""

import importlib
import json
import pkgutil
import subprocess
import sys
import types
from pathlib import Path

import pytest

import hysim

STUB = [line for line in Path(hysim.__file__).with_suffix(".pyi").read_text().splitlines() if line.startswith("from")]


def fresh(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_the_bare_import_loads_the_standard_library_only():
    loaded = json.loads(fresh("import sys, json, hysim; print(json.dumps(sorted(sys.modules)))"))
    foreign = {name.split(".")[0] for name in loaded} - sys.stdlib_module_names - {"hysim", "__main__"}
    site = {name for name in foreign if not name.startswith(("_", "sitecustomize", "usercustomize"))}
    assert site == set()
    assert [name for name in loaded if name.startswith("hysim")] == ["hysim", "hysim._names", "hysim._release"]


@pytest.mark.parametrize("name", [name for name in hysim.__all__ if not name.startswith("__")])
def test_every_public_name_can_be_had(name):
    value = getattr(hysim, name)
    if not isinstance(value, types.ModuleType):
        assert value.__doc__
        assert value.__name__ == name
    assert name in dir(hysim)


def test_no_submodule_takes_the_place_of_a_public_name():
    """A module named like a function would overwrite it when it is imported."""
    for module in pkgutil.walk_packages(hysim.__path__, "hysim."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for line in STUB:
        _, module, _, name, *_ = line.split()
        value = getattr(hysim, name)
        assert isinstance(value, types.ModuleType) == (module == "hysim"), name
        assert (value.__name__ if module == "hysim" else value.__module__).startswith("hysim.")


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'boucwen'"):
        _ = hysim.boucwen


@pytest.mark.parametrize("name", ["datasets", "benchmarks", "metrics", "signals", "plot", "rig", "vision"])
def test_public_modules_show_their_own_names_only(name):
    module = getattr(hysim, name)
    shown = [each for each in dir(module) if not each.startswith("_")]
    modules = [value for each in shown if isinstance(value := getattr(module, each), types.ModuleType)]
    assert not [value for value in modules if not value.__name__.startswith("hysim.")]
    assert set(module.__all__) <= set(dir(module))
