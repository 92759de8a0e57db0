"""Imports point down only: to a lower rank, or inside one's own package."""

import ast
import graphlib
from functools import cache
from pathlib import Path

import pytest

import hysim

PACKAGE = Path(hysim.__file__).parent

RANKS = (
    ("_names", "_release", "_results"),
    ("_frozen", "_atomic", "_blas", "_printing", "_progress", "_versions", "errors"),  # they know nothing of hysteresis
    (
        "_channels",
        "_cycles",
        "_resolution",
        "_prefixes",
        "interop",
    ),  # the turning points of an input, the quantum of a sensor, units, tables of other libraries
    (
        "_drift",
        "_excursions",
        "_input_noise",
    ),  # drift between cycles, cycles about a level, the noise of an input
    ("_repeats",),  # cycles that are repeated
    ("signals", "records", "metrics", "kernels", "_parallel"),
    ("datasets", "files", "models", "vision"),
    ("laws",),
    ("plants",),
    ("simulation", "benchmarks"),
    ("identification",),
    ("discovery", "control", "tracking", "design"),
    ("comparison", "posterior", "sweeps", "rig", "export"),
    ("plot",),
    ("notebooks",),
    ("paper",),
    ("cli",),
    ("__main__",),
)
RANK = {name: rank for rank, names in enumerate(RANKS) for name in names}
ONLY_IMPORTED_IN = {"pysindy": ("discovery/_slopes.py",), "matplotlib": ("plot/",), "control": ("control/", "paper/")}
MODULES = sorted(PACKAGE.rglob("*.py"))


@cache
def nodes(path: Path) -> list[ast.AST]:
    """All of a file's syntax tree that some test looks at."""
    kinds = (ast.Import, ast.ImportFrom, ast.ClassDef, ast.Call)
    return [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, kinds)]


@cache
def imported(path: Path) -> list[str]:
    """Every module that a file imports, at its top or inside a function."""
    names = []
    for node in nodes(path):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def part(module: str) -> str:
    """`records` for hysim.records.Record, `models` for hysim.laws.differential.boucwen."""
    return module.split(".")[1]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_down(path):
    relative = path.relative_to(PACKAGE)
    own = relative.parts[0].removesuffix(".py")
    if own in ("__init__", "data"):
        return  # the front door re-exports from every rank; the data folder holds no code
    assert own in RANK, f"{relative} has no rank"
    for module in imported(path):
        if module.startswith("hysim.") and part(module) != "__version__" and part(module) != own:
            assert RANK[part(module)] < RANK[own], f"{relative} imports {module}"


@pytest.mark.parametrize("library", ONLY_IMPORTED_IN)
def test_a_library_is_imported_in_its_own_place_only(library):
    users = {
        str(path.relative_to(PACKAGE)) for path in MODULES for name in imported(path) if name.split(".")[0] == library
    }
    assert all(user.startswith(ONLY_IMPORTED_IN[library]) for user in users), users


def test_kernels_know_no_class():
    for path in (PACKAGE / "kernels").glob("*.py"):
        if path.name != "_compile.py":  # which says how numba compiles them
            assert not any(isinstance(node, ast.ClassDef) for node in nodes(path)), path
        own = [name for name in imported(path) if name.startswith("hysim.")]
        assert all(part(name) in ("kernels", "_frozen") for name in own), path


def test_nobody_walks_past_the_public_names_of_a_package():
    """Private modules are imported inside their own package only."""
    for path in MODULES:
        own = ("hysim", *path.relative_to(PACKAGE).parts[:-1])
        for name in imported(path):
            parts = tuple(name.split("."))[:-1]
            private = next((k for k, part in enumerate(parts) if k > 1 and part.startswith("_")), None)
            if parts[:1] == ("hysim",) and private:
                assert parts[:private] == own[:private], (path, name)


def test_a_room_is_not_crowded():
    rooms = {path.parent for path in MODULES}
    crowded = {str(room.relative_to(PACKAGE)): n for room in rooms if (n := len(list(room.glob("*.py")))) > 25}
    assert not crowded, crowded


def imported_modules(path: Path) -> set[str]:
    """Modules of hysim that a file imports anywhere, for types only too; a bare `import hysim` is the front door."""
    names = {".".join(("hysim", *module.relative_to(PACKAGE).with_suffix("").parts)) for module in MODULES}
    found = set()
    for name in imported(path):
        if name.split(".")[0] == "hysim":
            longest = name if name in names or name == "hysim" else name.rpartition(".")[0]
            found.add(f"{longest}.__init__" if f"{longest}.__init__" in names else longest)
    return found


def test_no_module_imports_itself_by_way_of_others():
    """The front door, which loads names when they are first used, imports nothing that it names."""
    graph = {
        ".".join(("hysim", *path.relative_to(PACKAGE).with_suffix("").parts)): imported_modules(path)
        for path in MODULES
    }
    assert graph["hysim.__init__"] <= {"hysim._names", "hysim._release"}
    graphlib.TopologicalSorter(graph).prepare()  # raises a CycleError


def test_abilities_are_asked_for_by_protocols_and_not_by_names():
    """What is left looks at systems and dataclasses of others, which share no class."""
    calls = [
        str(path.relative_to(PACKAGE))
        for path in MODULES
        for node in nodes(path)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("getattr", "hasattr")
    ]
    assert sorted(set(calls)) == ["_frozen.py", "plants/state_space.py", "sweeps/_sweep.py"]
    assert len(calls) <= 20
