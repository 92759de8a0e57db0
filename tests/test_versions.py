"""What the package asks for has been tested, the changelog names what there is, and old files are read as meant."""

import functools
import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

import hysim as hs
from hysim.cli import COMMANDS, Command

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


def test_the_part_that_is_run_is_there():
    part = re.search(r"part=\(([^)]+)\)", (ROOT / ".ci/versions").read_text())[1].split()
    assert len(part) > 10
    assert all((ROOT / f"tests/test_{name}.py").is_file() for name in part)


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


# ---------------------------------------------------------------------------------- the changelog


CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
REMOVED = re.compile(r"^### Removed\n.*?(?=^##)", re.MULTILINE | re.DOTALL)
OLD_NAMES = re.compile(r"^\|[^|]*\|", re.MULTILINE)
NOW = OLD_NAMES.sub("|", REMOVED.sub("", CHANGELOG))
QUOTED = re.findall(r"`([^`]+)`", NOW)


@pytest.mark.parametrize("name", sorted({name for text in QUOTED for name in re.findall(r"\bhs\.(\w[\w.]*\w)", text)}))
def test_every_name_of_the_changelog_exists(name):
    assert functools.reduce(getattr, name.split("."), hs) is not None


def test_every_command_and_option_of_the_changelog_exists():
    known = {option for name in COMMANDS for each in Command(name).params for option in each.opts}
    options = {option for text in QUOTED for option in re.findall(r"(?<!\S)--[a-z][\w-]*", text)}
    assert options
    assert options <= known
    assert {text.split()[1] for text in QUOTED if text.startswith("hysim ")} <= COMMANDS.keys()


def test_the_newest_version_is_the_one_that_is_installed_and_cited():
    (version, date), *_ = re.findall(r"^## (\S+) - (\d{4}-\d\d-\d\d)$", CHANGELOG, flags=re.MULTILINE)
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert hs.__version__ == version
    assert f"\nversion: {version}\n" in cited
    assert f"\ndate-released: {date}\n" in cited


# -------------------------------------------------- files of version 0.1; tests/data/version_0_1/generate.py wrote them


FOLDER = Path(__file__).parent / "data" / "version_0_1"
STORED = json.loads((FOLDER / "models.json").read_text())
U = np.array(STORED["u"])


@pytest.mark.parametrize("stored", STORED["models"], ids=lambda stored: json.loads(stored["text"])["family"])
def test_a_stored_model_loads_and_responds_as_it_did(stored, tmp_path):
    path = tmp_path / "model.json"
    path.write_text(stored["text"])
    model = hs.load_model(path)
    hs.save(model, path, units={"u": "V", "y": "um"})
    assert json.loads(path.read_text())["parameters"] == json.loads(stored["text"])["parameters"]
    if stored["y"] is not None:
        y = hs.simulate(model, 1e-3 * np.arange(U.size), U).y
        assert y == pytest.approx(stored["y"], rel=0.0, abs=1e-10 * np.ptp(stored["y"]))  # an integrated law's promise


def test_a_stored_identification_comes_back():
    fit = hs.Identification.from_json((FOLDER / "identification.json").read_text())
    assert fit.model == hs.BoucWen(**fit.estimates)
    assert fit.estimates["beta"] == pytest.approx(0.7, rel=0.01)
    stored = json.loads((FOLDER / "identification.json").read_text())
    since = json.loads(fit.to_json())["identification"]["fields"]  # what 0.1 did not know
    stored["identification"]["fields"] |= {name: since[name] for name in ("unsafe", "choice", "weights", "bounds")}
    assert (fit.unsafe, fit.choice, fit.weights.size, fit.bounds) == ("", None, 0, {})
    assert json.loads(fit.to_json()) == stored | {"hysim": hs.__version__}


def test_a_stored_study_is_read(tmp_path):
    study = hs.load_sweep(shutil.copy(FOLDER / "study.sqlite", tmp_path))
    assert study["height"].ravel() == pytest.approx(np.outer([1.0, 2.0], np.exp([-0.0, -0.25, -1.0])).ravel())
