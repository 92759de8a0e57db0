"""The name of a family of laws stands in its own file and in few others, and its example makes a law."""

import ast
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import hysim as hs
from hysim.models.model import every_family, short_names

PACKAGE = Path(hs.__file__).parent

ALLOWED: dict[tuple[str, ...], tuple[str, ...]] = {
    # A law is built on a simpler one, contains it, or is converted to it.
    ("laws/",): ("PolynomialBoucWen", "PrandtlIshlinskii", "Duhem"),
    # What these parts are about: the paper's laws, the benchmark's, the rig's, and those that discovery returns.
    ("paper/",): ("BoucWen", "PolynomialBoucWen", "Line", "SingleValued"),
    ("benchmarks.py", "discovery/_oscillator.py", "discovery/_refinement.py"): ("BoucWen",),
    ("discovery/_result.py",): ("BoucWen", "Duhem"),
    ("rig/_rig.py",): ("PolynomialBoucWen",),
    # A discovered law is compared with the best sum of plays and the best curve.
    ("discovery/_competitors.py",): ("PrandtlIshlinskii", "SingleValued"),
    # A mass on a Bouc-Wen spring.
    ("plants/oscillator.py",): ("BoucWen", "PolynomialBoucWen"),
    ("plants/oscillator_structure.py",): ("BoucWen",),
    # What is linear, or is linearised, has a line in place of a law, and a viscous part is moved exactly.
    ("control/", "plants/chain.py", "plants/multi_input_actuator.py", "plants/structures/structure.py"): ("Line",),
    ("plants/structures/parts.py",): ("Dashpot", "Line"),
    # The filter of small reversals is what a fit of a noisy input has in front of any law.
    ("identification/_assumptions.py", "identification/_identify.py"): ("ReversalFilter",),
    # An offset that a law lacks is a line beside it.
    ("identification/doubts.py",): ("Line",),
    # The diagram of reversal curves is that of a density of relays.
    ("plot/_sweeps.py",): ("Preisach", "PreisachRelays"),
    # A page computes a curve of knots, which has no step, in the browser.
    ("export/_page_model.py",): ("SingleValued",),
    # Devices are sums of laws, or laws with the numbers of a material.
    ("export/_page.py",): ("BoucWen", "Dahl", "Dashpot", "ExcessLoss", "JilesAtherton", "Line", "MaxwellSlip"),
    # Messages and examples name a law that a user may take.
    ("cli/",): ("BoucWen", "Preisach", "PrandtlIshlinskii"),
    ("control/_tracking.py", "design/", "plants/actuator.py"): ("BoucWen",),
    ("tracking/_track.py",): ("BoucWen",),
    ("plants/actuator_structure.py",): ("BoucWen", "Line"),
    ("identification/_admissible.py", "discovery/_judgement.py"): ("PrandtlIshlinskii", "Preisach"),
}  # fmt: skip
"""Files and folders that may name families beside a family's own file, and which."""


def names_in(text: str) -> set[str]:
    """Families that a string names: by its whole, as ``hs.Name``, or by a word with capitals inside."""
    words = {word for word in re.findall(r"\w+", text) if re.search("[a-z][A-Z]", word)}
    return {text, *words, *re.findall(r"\bhs\.(\w+)", text)}


@cache
def named(path: Path) -> set[str]:
    """Names that a file imports from the laws, takes from the front door, or has in a string that is no docstring."""
    tree = ast.parse(path.read_text())
    with_docstrings = (ast.Module, ast.ClassDef, ast.FunctionDef)
    texts = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, with_docstrings) and ast.get_docstring(node)
    }
    texts |= {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # docstrings of constants
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith("hysim.laws."):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("hs", "hysim"):
            found.add(node.attr)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in texts:
            found |= names_in(node.value)
    return found


FILES = {str(path.relative_to(PACKAGE)): path for path in sorted(PACKAGE.rglob("*.py"))}


def allowed(file: str) -> set[str]:
    return {name for places, names in ALLOWED.items() if file.startswith(places) for name in names}


@pytest.mark.parametrize("name", hs.families())
def test_the_name_of_a_family_stands_in_its_own_file_only(name):
    own = f"{hs.families()[name].__module__.removeprefix('hysim.').replace('.', '/')}.py"
    others = [file for file, path in FILES.items() if file != own and name in named(path) - allowed(file)]
    assert not others, f"{name} is named in {others}: ask for what the family is or has, not for its name"


def test_no_place_may_name_a_family_that_it_does_not_name():
    for places, names in ALLOWED.items():
        used = {name for file, path in FILES.items() if file.startswith(places) for name in named(path)}
        assert set(names) <= used, (places, set(names) - used)


@pytest.mark.parametrize("name", hs.families())
def test_every_family_has_an_example_in_its_own_class(name):
    family = hs.families()[name]
    assert family.__name__ == name
    assert family.example is vars(family)["example"], "an example stands in the family's own class"
    low, high = family.example.between
    assert -np.inf < low < high < np.inf


@pytest.mark.parametrize("name", [name for name, each in hs.families().items() if hasattr(each, "searched")])
def test_parameters_are_declared_affine_if_the_output_is_affine_in_them(name):
    """Those are solved for, and not searched; a memory in which the output begins affine may grow into another one."""
    family = hs.families()[name]
    law, (low, high) = family(**family.example.fields), family.example.between
    u = low + (high - low) * (0.5 + 0.5 * np.linspace(0.2, 1.0, 200) * np.sin(np.linspace(0.0, 12.0, 200)))
    names = [each.name for each in law.searched if each.name != "z0"]
    values = {name: value for name in names if isinstance(value := getattr(law, name), float)}
    affine = set()
    for parameter, value in values.items():
        step = 0.1 * abs(value) or 0.05
        laws = [replace(law, **{parameter: value + sign * step}) for sign in (-1.0, 0.0, 1.0)]
        below, there, above = (hs.simulate(other, 0.01 * np.arange(u.size), u).y for other in laws)
        if np.abs(below - 2.0 * there + above).max() <= 1e-9 * np.abs(above - below).max():
            affine.add(parameter)
    assert affine == {each.name for each in law.searched if each.affine and each.name in values}


@pytest.mark.parametrize("name", [name for name, each in hs.families().items() if getattr(each, "starts", ())])
def test_the_output_is_affine_in_all_these_together(name):
    """A product of two of them, as of a damping and the memory that it damps, would be no law that was searched."""
    family = hs.families()[name]
    law, (low, high) = family(**family.example.fields), family.example.between
    u = low + (high - low) * (0.5 + 0.5 * np.linspace(0.2, 1.0, 200) * np.sin(np.linspace(0.0, 12.0, 200)))
    record = hs.Record(u=u, y=u, t=0.01 * np.arange(u.size))
    columns = law.search_space(record).columns
    numbers = dict(zip(columns, np.random.default_rng(1).uniform(0.5, 1.5, len(columns)), strict=True))
    other = law.with_scalars(law.scalars | numbers)
    *parts, rest = law.regressors({key: np.array([value]) for key, value in law.scalars.items()}, record)[0].T
    np.testing.assert_allclose(
        rest + sum(numbers[key] * part for key, part in zip(columns, parts, strict=True)),
        hs.simulate(other, record.t, u).y,
        rtol=1e-9,
        atol=1e-9 * max(np.abs(part).max() for part in [*parts, rest]),
    )


def test_the_families_are_the_laws_of_the_registry_in_the_order_of_the_public_names():
    laws = {name for name, each in every_family().items() if each.__module__.startswith("hysim.laws.")}
    assert set(hs.families()) == laws
    assert list(hs.families()) == [name for name in hs.__all__ if name in laws]


def test_short_names_are_each_that_of_one_family():
    assert short_names() == {
        "zhu-wang": "ZhuWangBoucWen",
        "baber-noori": "BoucWenBaberNoori",
        "lugre": "LuGre",
        "oscillator": "BoucWenOscillator",
    }
