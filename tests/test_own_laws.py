"""A law of the user's own, a function or an object by its import path, is a law like the others."""

import json
import math
import pickle
import sys

import numba
import numpy as np
import pytest
from strategies import (
    COMPILED,
    assert_cut_or_stepped_it_has_the_same_bits,
    assert_refused,
    refused,
    refused_in_one_line,
)

import hysim as hs
from hysim.cli import main, models


def dahl(parameters, state, u):
    """Dahl's friction, dz/du = rate (1 - sign(du) z / limit): Bouc-Wen with n = 1, gamma = 0."""
    rate, limit = parameters[0], parameters[1]
    du = u - state[0]
    end = math.copysign(limit, du)
    state[1] = end + (state[1] - end) * math.exp(-rate * abs(du) / limit)
    state[0] = u
    return state[1]


def play(parameters, state, u):
    """Backlash of half width r, beside a line."""
    gain, r, slope = parameters
    state[1] = max(u - r, min(u + r, state[1]))
    state[0] = u
    return gain * state[1] + slope * u


def logarithm(parameters, state, u):
    """Lost for u < 0."""
    state[0] = u
    return math.log(u) * parameters[0]


DAHL = hs.CustomLaw(
    step=dahl,
    parameters={"rate": 1.5, "limit": 0.8},
    state={"z0": 0.1},
    bounds={"rate": (0.1, 10.0), "limit": (0.1, 10.0)},
)
PLAY = hs.CustomLaw(
    step=play,
    parameters={"gain": 2.0, "r": 0.25, "slope": 0.5},
    state={"w0": 0.0},
    bounds={"r": (0.0, 1.0)},
    linear=("gain", "slope"),
)
TWIN = hs.BoucWen(A=1.5, beta=1.5 / 0.8, gamma=0.0, z0=0.1)
U = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60) * np.linspace(1.0, 0.4, 121)


def test_dahls_law_is_the_built_in_one():
    assert DAHL.response(U) == pytest.approx(TWIN.response(U), abs=1e-14)  # rounding of numbers of order one
    assert np.array_equal(hs.simulate(DAHL, None, U).y, DAHL.response(U))


def test_a_compiled_function_and_a_plain_one_are_the_same_law():
    jitted = hs.CustomLaw(step=numba.njit(dahl), parameters=DAHL.parameters, state=DAHL.state)
    assert np.array_equal(jitted.response(U), DAHL.response(U))


@pytest.mark.parametrize("law", [DAHL, PLAY], ids=["dahl", "play"])
def test_cut_or_stepped_it_has_the_same_bits(law):
    assert_cut_or_stepped_it_has_the_same_bits(law, U, 50)
    assert DAHL.advance(U)[1] == (U[-1], DAHL.response(U)[-1])


def test_a_closed_loop_around_it_is_that_around_the_built_in_one():
    mode = hs.TransferFunction(num=(1.0,), den=(1.0, 0.4, 1.0))
    t = np.arange(200) / 20.0
    own, built_in = (
        hs.close_loop(hs.Actuator(hysteresis=law, vibration=mode), hs.PID(ki=0.4), t, 0.5 * np.sin(t))
        for law in (DAHL, TWIN)
    )
    assert np.ptp(own.u) > 0.1
    assert own.y == pytest.approx(built_in.y, rel=1e-12, abs=1e-14)
    assert own.u == pytest.approx(built_in.u, rel=1e-12, abs=1e-14)


def test_identify_recovers_dahls_parameters():
    rec = hs.Record(u=U, y=TWIN.response(U))
    start = hs.CustomLaw(step=dahl, parameters={"rate": 5.0, "limit": 3.0}, state={"z0": 0.1}, bounds=DAHL.bounds)
    fit = hs.identify(start, rec)
    assert fit.free_names == ("rate", "limit")
    assert fit.estimates == pytest.approx({"rate": 1.5, "limit": 0.8, "z0": 0.1}, rel=1e-7)
    assert fit.model.response(U) == pytest.approx(rec.y, abs=1e-7)


def test_linear_parameters_are_solved_for_and_initial_values_can_be_free():
    rec = hs.Record(u=U, y=PLAY.response(U))
    fit = hs.identify(PLAY, rec, bounds={"w0": (-1.0, 1.0)})
    assert fit.free_names == ("gain", "r", "slope", "w0")
    assert {name: fit.estimates[name] for name in ("gain", "r", "slope")} == pytest.approx(
        {"gain": 2.0, "r": 0.25, "slope": 0.5}, rel=1e-6
    )
    assert fit.fit_percent > 99.999
    rest = hs.identify(PLAY, rec, fixed={"r": 0.25}, initial="rest")
    assert rest.free_names == ("gain", "slope")
    assert rest.estimates["gain"] == pytest.approx(2.0, rel=1e-12)


def test_it_is_compared_with_the_others():
    u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=60)
    table = hs.compare({"own": DAHL, "line": hs.Line}, hs.Record(u=u, y=TWIN.response(u)))
    assert "own" in table.to_text()


def test_it_is_a_value():
    assert pickle.loads(pickle.dumps(DAHL)) == DAHL
    assert hash(DAHL) == hash(pickle.loads(pickle.dumps(DAHL)))
    assert PLAY.assemble({"r": 0.25}) == PLAY
    assert PLAY.assemble({"r": 0.5}) != PLAY


def test_a_lost_law_names_the_sample():
    law = hs.CustomLaw(step=logarithm, parameters={"gain": 1.0})
    if not COMPILED:  # Python's own logarithm raises instead of nan
        return
    assert_refused(r"sample 1 \(u = -1\)", law.response, [1.0, -1.0], error=hs.SimulationError)


test_wrong_arguments_are_named = refused(
    (lambda: hs.CustomLaw(step=lambda u: u, parameters={"a": 1.0}), TypeError, r"takes \(u\)"),
    (lambda: hs.CustomLaw(step="dahl", parameters={"a": 1.0}), TypeError, "must be a function"),
    (lambda: hs.CustomLaw(step=dahl), "at least one parameter"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": np.nan}), "a'] must be finite"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": "b"}), TypeError, "a'] must be numbers"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": 1.0}, state={"a": 1.0}), "'a' names a parameter and"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": 1.0}, linear=("b",)), "linear names 'b'"),
    (lambda: hs.CustomLaw(step=dahl, parameters={"a": 1.0}, bounds={"b": (0, 1)}), "bounds names 'b'"),
    (lambda: DAHL.advance([0.0], (0.0,)), "must hold 2 numbers, got 1"),
    (lambda: hs.identify(DAHL, hs.Record(u=U, y=U), free=("z0",)), "'z0' is free, but has no bounds"),
    (lambda: hs.identify(DAHL, hs.Record(u=U, y=U), bounds={"rate": (1.0, np.inf)}), "must be positive and finite"),
)


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize(
    "step", [lambda parameters, state, u: "text", lambda parameters, state, u: sorted(u), lambda p, s, u: s.missing]
)
def test_what_does_not_compile_is_refused_with_the_reason(step):
    assert_refused("does not compile as step", hs.CustomLaw, error=TypeError, step=step, parameters={"a": 1.0})


# ---------------------------------------------------------------------------------- by import path on the command line


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
