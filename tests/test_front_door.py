"""`import hysim` is light, and every public name is there."""

import ast
import importlib
import json
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import hysim
from hysim._names import HOME, MODULES

SOURCE = ast.parse(Path(hysim.__file__).read_text())


def fresh(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_the_bare_import_loads_the_standard_library_only():
    loaded = json.loads(fresh("import sys, json, hysim; print(json.dumps(sorted(sys.modules)))"))
    foreign = {name.split(".")[0] for name in loaded} - sys.stdlib_module_names - {"hysim", "__main__"}
    site = {name for name in foreign if not name.startswith(("_", "sitecustomize", "usercustomize"))}
    assert site == set()
    assert [name for name in loaded if name.startswith("hysim")] == ["hysim"]


def test_lazy_names_are_the_ones_that_type_checkers_see():
    guard = next(node for node in SOURCE.body if isinstance(node, ast.If))
    seen = {alias.asname for node in guard.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert seen == set(HOME) | set(MODULES)


@pytest.mark.parametrize("name", [name for name in hysim.__all__ if not name.startswith("__")])
def test_every_public_name_can_be_had(name):
    value = getattr(hysim, name)
    if name in HOME:
        assert value.__doc__
        assert value.__name__ == name
    assert name in dir(hysim)


def test_no_submodule_takes_the_place_of_a_public_name():
    """A module named like a function would overwrite it when it is imported."""
    for module in pkgutil.walk_packages(hysim.__path__, "hysim."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for name in HOME:
        assert getattr(hysim, name).__module__.startswith("hysim")
        assert not isinstance(getattr(hysim, name), type(sys)), name


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'boucwen'"):
        _ = hysim.boucwen
