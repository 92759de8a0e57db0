"""`import hysim` is light, and every public name is there; a misspelt name is answered with the one that was meant."""

import importlib
import json
import pkgutil
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest
from strategies import refused

import hysim
import hysim as hs
from hysim._basics.names import MODULE_OF, meant, nearest
from hysim.models.model import candidates, candidates_named, every_family, family_named

RECORD = hs.datasets.table1()


@pytest.mark.parametrize("form", [str, str.lower, str.upper, lambda name: "_".join(name), lambda name: "-".join(name)])
def test_every_family_is_known_by_its_name_in_any_form(form):
    for name, family in every_family().items():
        if name in MODULE_OF:
            assert family_named(form(name)) is family


def test_every_candidate_of_the_registry_comes_by_the_name_of_its_family():
    every = candidates()
    by_name = {}
    for family in dict.fromkeys(name.split()[0] for name in every):
        by_name |= candidates_named(family)
    assert by_name == every


def test_no_two_families_share_a_name_that_people_write():
    plain = [name.lower() for name in every_family()]
    assert len(set(plain)) == len(plain)


@pytest.mark.parametrize("name", ["bouc-wen", "BoucWen", "boucwen", "Bouc_Wen"])
def test_verbs_take_the_name_of_a_family(name):
    fixed = {"n": 1.0, "feedthrough": 0.0, "offset": 0.0, "z0": 0.0}
    assert hs.identify(name, RECORD, fixed=fixed) == hs.identify(hs.BoucWen, RECORD, fixed=fixed)


def test_compare_and_select_take_names():
    wanted = hs.compare({"Line": hs.Line, "SingleValued": hs.SingleValued}, RECORD)
    for models in (["line", "single-valued"], [hs.Line, "SingleValued"]):
        assert [row.name for row in hs.compare(models, RECORD).rows] == ["Line", "SingleValued"]
    assert hs.compare({"Line": "line", "SingleValued": "singlevalued"}, RECORD) == wanted
    assert [row.name for row in hs.compare("line", RECORD).rows] == ["Line"]
    assert list(hs.select(["line", "single-valued"], RECORD).fits) == ["single-valued", "line"]
    rows = {name: [*candidates_named(name)] for name in ("duhem", "lugre")}
    assert rows == {"duhem": ["Duhem of degree 1", "Duhem of degree 2"], "lugre": ["LuGre"]}


test_a_misspelt_name_is_answered_with_the_one_that_was_meant = refused(
    (lambda: hs.BoucWenn, AttributeError, r"no attribute 'BoucWenn'; did you mean 'BoucWen'\?"),
    (lambda: hs.indentify, AttributeError, r"did you mean 'identify'\?"),
    (lambda: hs.BoucWen(betta=1.0), TypeError, r"BoucWen has no parameter 'betta'; .*; did you mean 'beta'\?"),
    (lambda: hs.PID(kpp=1.0), TypeError, r"PID has no parameter 'kpp'; .*; did you mean 'kp'\?"),
    (lambda: hs.BoucWen(1.0), TypeError, "no positional argument; by name it takes A, beta"),
    (lambda: hs.identify("bouc-wn", RECORD), r"no family 'bouc-wn'; did you mean 'BoucWen'\?"),
    (lambda: hs.compare(["dahll"], RECORD), r"no family 'dahll'; did you mean 'Dahl'\?"),
    (lambda: hs.compare({"a": "duhem"}, RECORD), "stands for several models"),
    (lambda: hs.compare([hs.Line()], RECORD), TypeError, "a list of families or their names"),
    (lambda: hs.compare(["modes"], RECORD), "Modes needs more than its name"),
    (lambda: hs.identify("boucweninverse", RECORD), "there is no family 'boucweninverse'"),
    (lambda: hs.identify(hs.TransferFunction, RECORD), TypeError, r"hs.TransferFunction.structure\(...\)"),
    (lambda: hs.identify(hs.BoucWen, RECORD, fixed={"betta": 1}), r"did you mean 'beta'\?"),
    (lambda: hs.identify(hs.BoucWen, RECORD, free=["gama"]), r"did you mean 'gamma'\?"),
    (lambda: hs.identify(hs.BoucWen, RECORD, bounds={"ofset": (0, 1)}), r"did you mean 'offset'\?"),
    (lambda: hs.identify(hs.BoucWen, RECORD, initial="perodic"), r"did you mean 'periodic'\?"),
    (lambda: hs.identify(hs.BoucWen, RECORD, noise="gausian"), r"did you mean 'gaussian'\?"),
    (lambda: hs.identify(hs.BoucWen, RECORD, intervals="profiles"), r"did you mean 'profile'\?"),
    (lambda: hs.select([hs.Line], RECORD, criterion="bicc"), r"did you mean 'bic'\?"),
    (lambda: hs.BoucWen.responses({"betta": [1.0]}, [0.0]), TypeError, r"did you mean 'beta'\?"),
    (lambda: hs.BoucWen.responses({}, [0.0], reduce="pek"), "reduce must be one of"),
    (lambda: hs.compare({"line": hs.Line}, RECORD)["lin"], KeyError, r"did you mean 'line'\?"),
    (lambda: hs.discover(RECORD, route="memry"), r"did you mean 'memory'\?"),
)


def test_nothing_is_guessed_where_nothing_is_near():
    assert nearest("stiffness", ["beta", "gamma"]) is None
    assert meant("stiffness", ["beta", "gamma"]) == ""
    assert meant(3, ["beta"]) == ""
    with pytest.raises(AttributeError, match=r"no attribute 'something_else'$"):
        _ = hs.something_else


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("idntify",), "did you mean identify?"),
        (("identify", "loop.csv", "--model", "dahl", "--bonds", "c=0:1"), "did you mean --bounds?"),
        (("identify", "loop.csv", "--model", "dahll"), "did you mean dahl?"),
        (("identify", "loop.csv", "--model", "dahl", "--fix", "coulom=1"), "did you mean 'coulomb'?"),
        (("identify", "loop.csv", "--model", "dahl", "--u", "voltag"), "did you mean 'voltage'?"),
    ],
)
def test_the_command_line_guesses_too(arguments, said, tmp_path, run):
    (tmp_path / "loop.csv").write_text("u,y,voltage\n0,0,0\n1,1,1\n0,0.1,0\n1,1,1\n0,0.1,0\n")
    code, out, err = run(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said in err


# ---------------------------------------------------------------------------------- the front door


STUB = [line for line in Path(hysim.__file__).with_suffix(".pyi").read_text().splitlines() if line.startswith("from")]


def fresh(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_the_bare_import_loads_the_standard_library_only():
    loaded = json.loads(fresh("import sys, json, hysim; print(json.dumps(sorted(sys.modules)))"))
    foreign = {name.split(".")[0] for name in loaded} - sys.stdlib_module_names - {"hysim", "__main__"}
    site = {name for name in foreign if not name.startswith(("_", "sitecustomize", "usercustomize"))}
    assert site == set()
    own = [name for name in loaded if name.startswith("hysim.")]
    assert own == ["hysim._basics", "hysim._basics.names", "hysim._basics.release"]


@pytest.mark.parametrize("name", [name for name in hysim.__all__ if not name.startswith("__")])
def test_every_public_name_can_be_had(name):
    value = getattr(hysim, name)
    if not isinstance(value, types.ModuleType):
        assert value.__doc__
        assert set(re.findall(r"`hysim\.([A-Z]\w+)", value.__doc__)) <= set(dir(hysim))
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
