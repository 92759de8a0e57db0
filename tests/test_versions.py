"""What the package asks for is what has been tested: pyproject.toml agrees with the table of docs/versions.md."""

import re
import tomllib
from pathlib import Path

import hysim as hs

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
NAMES = {"NumPy": "numpy", "SciPy": "scipy", "PySINDy": "pysindy"}


def rows():
    """The table, a row a mapping from heading to cell."""
    lines = [line.strip("| ") for line in (ROOT / "docs" / "versions.md").read_text().splitlines() if line[:1] == "|"]
    heading, _, *body = [re.split(r"\s*\|\s*", line) for line in lines]
    return [dict(zip(heading, cells, strict=True)) for cells in body]


def minor(version):
    """(3, 11) of "3.11.7"."""
    return tuple(map(int, version.split(".")[:2]))


def test_the_conda_recipe_has_the_version_and_requirements_of_the_package():
    recipe = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    run = recipe.partition("\n  run:\n")[2].partition("\n\n")[0]
    required = dict(re.match(r"([\w-]+)(.*)", each).groups() for each in PROJECT["dependencies"])
    required = {"python": ">=${{ python_min }}", "matplotlib-base": required.pop("matplotlib"), **required}
    assert dict(re.findall(r"^    - (\S+) (.+)$", run, flags=re.MULTILINE)) == required
    assert f'version: "{hs.__version__}"\n  python_min: "{PROJECT["requires-python"][2:]}"\n' in recipe


def test_every_run_passed():
    assert all(re.fullmatch(r"\d+ passed(, \d+ skipped)?", row["tests"]) for row in rows())


def test_the_classifiers_name_the_interpreters_that_passed():
    named = {minor(entry.split(" :: ")[-1]) for entry in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", entry)}
    assert named == {minor(row["Python"]) for row in rows()}
    assert PROJECT["requires-python"] == ">={}.{}".format(*min(named))


def test_the_lower_bounds_are_those_that_passed_on_the_oldest_interpreter():
    (oldest,) = [row for row in rows() if row["dependencies"] == "oldest"]
    assert minor(oldest["Python"]) == min(minor(row["Python"]) for row in rows())
    bounds = dict(re.match(r"([\w-]+)>=([\d.]+)", requirement).groups() for requirement in PROJECT["dependencies"])
    tested = {NAMES.get(name, name): cell for name, cell in oldest.items()}
    for name, bound in bounds.items():
        assert re.fullmatch(rf"{re.escape(bound)}(\.0)*", tested[name])
