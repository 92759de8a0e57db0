"""Imports point down only: to a lower rank, or inside one's own package."""

import ast
import graphlib
import itertools
import re
import runpy
import tomllib
from functools import cache
from pathlib import Path

import pytest

import conftest
import hysim

PACKAGE = Path(hysim.__file__).parent

RANKS = (
    ("_basics", "errors"),  # they know nothing of hysteresis
    ("_columns", "interop"),  # turning points, cycles, the quantum of a sensor; tables of other libraries
    ("signals", "records", "metrics", "kernels"),
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
    """Named tuples of arrays are data, which numba takes."""
    for path in (PACKAGE / "kernels").rglob("*.py"):
        classes = [node for node in nodes(path) if isinstance(node, ast.ClassDef)]
        if path.name != "_compile.py":  # which says how numba compiles them
            assert all([ast.unparse(base) for base in node.bases] == ["NamedTuple"] for node in classes), path
        own = [name for name in imported(path) if name.startswith("hysim.")]
        assert all(name.startswith(("hysim.kernels.", "hysim._basics.frozen.")) for name in own), path


def test_nobody_walks_past_the_public_names_of_a_package():
    """Private modules are imported inside their own package only."""
    for path in MODULES:
        own = ("hysim", *path.relative_to(PACKAGE).parts[:-1])
        for name in imported(path):
            parts = tuple(name.split("."))[:-1]
            private = next((k for k, part in enumerate(parts) if k > 1 and part.startswith("_")), None)
            if parts[:1] == ("hysim",) and private:
                assert parts[:private] == own[:private], (path, name)


def imported_modules(path: Path) -> set[str]:
    """Modules of hysim that a file imports anywhere, for types only too; a bare `import hysim` is the front door."""
    names = {".".join(("hysim", *module.relative_to(PACKAGE).with_suffix("").parts)) for module in MODULES}
    found = set()
    for name in imported(path):
        if name.split(".")[0] == "hysim":
            longest = name if name in names or name == "hysim" else name.rpartition(".")[0]
            found.add(f"{longest}.__init__" if f"{longest}.__init__" in names else longest)
    return found


FOLDERS = {
    "data", "laws/components", "laws/differential", "laws/friction", "laws/magnetic", "laws/operators",
    "plants/structures",
}  # fmt: skip
LEAST = 300  # lines of code, below which a module is not divided


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_gives_a_name_once(path):
    """A second constant of a name, as after a merge of modules, would change what the first one decides."""
    targets = [
        each for node in ast.parse(path.read_text()).body if isinstance(node, ast.Assign) for each in node.targets
    ]
    names = [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
    assert [name for name in names if names.count(name) > 1] == []


def test_rooms_have_no_rooms_inside():
    """But laws of five kinds, and structures among the plants."""
    nested = {str(path.parent.relative_to(PACKAGE)) for path in MODULES}
    assert {folder for folder in nested if "/" in folder} == {folder for folder in FOLDERS if "/" in folder}


def test_a_topic_has_one_room():
    names = [path.parent.name for path in MODULES if path.name == "__init__.py"]
    assert len(names) == len(set(names)), names
    assert not {name for name in names if f"{name}s" in names}, names  # magnetic/ beside magnetics/


def test_a_module_with_one_importer_in_its_room_is_merged_into_it():
    count = runpy.run_path(str(PACKAGE.parent / ".ci" / "count_lines.py"))["count"]
    importers: dict[str, set[Path]] = {}
    for path in MODULES:
        for name in imported_modules(path):
            importers.setdefault(name, set()).add(path)
    public = (PACKAGE / "__init__.pyi").read_text()
    small = {}
    for path in MODULES:
        name = ".".join(("hysim", *path.relative_to(PACKAGE).with_suffix("").parts))
        users = importers.get(name, set())
        if path.name == "__init__.py" or len(users) != 1 or f"from {name} import" in public:
            continue
        (user,) = users
        if user.parent == path.parent and user.name != "__init__.py":
            lines = count(path)[0] + count(user)[0]
            if lines < LEAST:
                small[name] = f"{user.relative_to(PACKAGE)}, {lines} lines"
    assert not small, small


def test_the_size_has_limits_which_nothing_raises():
    sizes = runpy.run_path(str(PACKAGE.parent / ".ci" / "count_lines.py"))
    most, budget = sizes["limits"]((PACKAGE.parent / ".ci" / "limits.toml").read_text())
    assert not sizes["excess"](most)
    for name, limit in most.items():
        one_more = {**most, name: limit + 1 + budget.get(name, 0)}
        assert len(sizes["excess"](one_more)) == 1, name


def test_every_room_of_mutants_names_the_tests_of_its_modules():
    script = runpy.run_path(str(PACKAGE.parent / ".ci" / "mutants.py"), run_name="mutants")
    modules = {
        path.relative_to(PACKAGE).as_posix() for room in script["SHARES"] for path in (PACKAGE / room).glob("*.py")
    }
    assert {name for name in modules if "__init__" not in name} == {*script["MAPPED"], *script["NOT_MUTATED"]}


def test_no_module_imports_itself_by_way_of_others():
    """The front door, which loads names when they are first used, imports nothing that it names."""
    graph = {
        ".".join(("hysim", *path.relative_to(PACKAGE).with_suffix("").parts)): imported_modules(path)
        for path in MODULES
    }
    assert graph["hysim.__init__"] <= {"hysim._basics.names", "hysim._basics.release"}
    graphlib.TopologicalSorter(graph).prepare()  # raises a CycleError


def test_abilities_are_asked_for_by_protocols_and_not_by_names():
    """What is left looks at systems and dataclasses of others, which share no class."""
    calls = [
        str(path.relative_to(PACKAGE))
        for path in MODULES
        for node in nodes(path)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("getattr", "hasattr")
    ]
    assert sorted(set(calls)) == ["_basics/frozen.py", "plants/transfer_function.py"]
    assert len(calls) <= 20


def test_the_second_circle_names_tests():
    tests = Path(__file__).parent
    for name in itertools.chain(*tomllib.loads((tests / "circles.toml").read_text()).values()):
        path, _, test = name.partition("::")
        folder = tests.parent if path.startswith("hysim/") else tests
        assert re.search(rf"(def|class) {test.rpartition('.')[2]}\(", (folder / path).read_text()), name


def test_every_test_that_a_draw_may_leave_out_is_in_some_other_draw():
    circles = tomllib.loads((Path(__file__).parent / "circles.toml").read_text())
    in_draws = {
        name: sum(conftest.is_drawn(f"draw {k}", f"tests/{name}[case]") for k in range(60))
        for name in itertools.chain(*circles.values())
    }
    always = circles["smoke"]
    assert {in_draws[name] for name in always} == {60}
    assert all(5 <= in_draws[name] <= 40 for name in in_draws.keys() - set(always) if not name.startswith("hysim/"))
    assert conftest.is_drawn("draw", "tests/test_architecture.py::test_the_second_circle_names_tests")
