"""A law of the user's own is taken by import path wherever the command line takes the name of a family."""

import json
import sys

import pytest
from strategies import refused_in_one_line

import hysim as hs
from hysim.cli import main, models

COLUMNS = ("--u", "voltage", "--y", "displacement")
MODULE = """
import hysim as hs

Slope = hs.Line
law = hs.BoucWen(beta=0.03, gamma=0.02, gain=-0.01, feedthrough=0.03)
controller = hs.PID(kp=1.0)
number = 3
"""


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run a command in a folder with a record and laws: exit code, standard output, standard error."""
    law = hs.BoucWen(beta=0.03, gamma=0.02, gain=-0.01, feedthrough=0.03)
    u = hs.signals.triangle(0.0, 100.0, cycles=2, samples_per_cycle=40)
    rows = (f"{a},{b}" for a, b in zip(u.tolist(), law.response(u).tolist(), strict=True))
    (tmp_path / "loop.csv").write_text("\n".join(["voltage,displacement", *rows]))
    (tmp_path / "my_laws.py").write_text(MODULE)
    (tmp_path / "broken_laws.py").write_text("import a_module_that_nobody_has\n")
    hs.save(law, tmp_path / "law.json")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield lambda *arguments: (main([*map(str, arguments)]), *capsys.readouterr())
    for name in ("my_laws", "broken_laws"):
        sys.modules.pop(name, None)


def test_a_law_by_import_path_does_what_its_file_does(run, tmp_path):
    simulate = ("loop.csv", "--u", "voltage")
    assert run("simulate", "my_laws:law", *simulate) == run("simulate", "law.json", *simulate)
    plot = ("plot", "loop.csv", *COLUMNS, "--out")
    assert run(*plot, "one.svg", "--model", "my_laws:law") == (0, "", "")
    assert run(*plot, "two.svg", "--model", "law.json") == (0, "", "")
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()
    design = ("--sample-time", "0.1", "--range", "0.5,1", "--controller", "inverse", "--json")
    own, stored = (json.loads(run("control", model, *design)[1]) for model in ("my_laws:law", "law.json"))
    assert own == stored


def test_a_class_by_import_path_is_identified_as_its_family_is(run):
    own, named = (run("identify", "loop.csv", *COLUMNS, "--model", name) for name in ("my_laws:Slope", "line"))
    assert own == named
    assert own[0] == 0
    code, out, _ = run("simulate", "my_laws:Slope", "loop.csv", "--u", "voltage")
    assert (code, out.splitlines()[:3]) == (0, ["u,y", "0.0,0.0", "5.0,0.0"])


def test_laws_by_import_path_are_compared_with_families(run):
    arguments = ("--model", "line", "--model", "my_laws:Slope", "--model", "my_laws:law", "--json")
    document = json.loads(run("compare", "loop.csv", *COLUMNS, *arguments)[1])
    assert [row["name"] for row in document["rows"]] == ["line", "Slope", "law"]
    assert document["rows"][0]["rmse"] == document["rows"][1]["rmse"]
    assert document["rows"][2]["fit_percent"] == pytest.approx(100.0)


def test_a_study_of_data_executes_no_code(run, tmp_path):
    response = 'record = "loop.csv"\nu = "voltage"\ny = "displacement"\n[grid]\nbeta = [0.02, 0.03]\n'
    (tmp_path / "study.toml").write_text(f'[response]\nlaw = "my_laws:law"\n{response}')
    code, out, err = run("sweep", "study.toml", "--out", "rows.sqlite")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "law takes a family or a file, got 'my_laws:law': a law of your own is code, which a task can use" in err
    assert "my_laws" not in sys.modules


test_an_import_path_that_leads_to_no_law_is_refused_in_one_line = refused_in_one_line(
    ("nowhere:law", "nowhere:law is not there: No module named 'nowhere'"),
    ("my_laws:lore", "module 'my_laws' has no attribute 'lore'"),
    ("my_laws:number", "my_laws:number is no law: expected a model, or a class of models, with a response; got 3"),
    ("my_laws:controller", "my_laws:controller is no law"),
    ("broken_laws:law", "No module named 'a_module_that_nobody_has'"),
    ("my_laws", "there is no model 'my_laws': give one of bouc-wen, "),
    ("record", "there is no model 'record'"),
    call=lambda run, model: run("identify", "loop.csv", *COLUMNS, "--model", model),
)


def test_a_class_without_default_values_is_no_model_to_simulate(run):
    code, _, err = run("simulate", "hysim:Duhem", "loop.csv", "--u", "voltage")
    assert code == 2
    assert "hysim:Duhem needs values for its parameters" in err


def test_an_existing_file_is_read_although_its_name_looks_like_an_import_path(run, tmp_path):
    (tmp_path / "law.json").rename(tmp_path / "my:law")
    assert not models.is_import_path("my:law")
    assert run("simulate", "my:law", "loop.csv", "--u", "voltage")[0] == 0
