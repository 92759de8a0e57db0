"""A file of one's own goes from record to model and picture by command line alone, or ends in one line."""

import dataclasses
import io
import json
import re
import sys
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import document_of, refused_in_one_line

import hysim as hs
from hysim.cli import main, models
from hysim.models.model import is_identifiable

LAW = hs.BoucWen(beta=0.03, gamma=0.02, gain=0.01, feedthrough=0.015)
COLUMNS = ["--u", "voltage", "--y", "displacement"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A record that the project has not seen, with decimal commas, and the law behind it."""
    folder = tmp_path_factory.mktemp("own")
    u = hs.signals.triangle(0.0, 100.0, cycles=2, samples_per_cycle=40)
    samples = zip(u.tolist(), LAW.response(u).tolist(), strict=True)
    rows = [f"{k / 10};{a};{b!r}".replace(".", ",") for k, (a, b) in enumerate(samples)]
    (folder / "loop.csv").write_text("\n".join(["time;voltage;displacement", "s;V;um", *rows]))
    hs.save(LAW, folder / "law.json", units={"y": "um"})
    hs.save(hs.PID(kp=1.0), folder / "pid.json")
    return folder


def test_a_record_goes_from_file_to_model_to_simulation_to_picture(run, folder, tmp_path):
    model, loop = tmp_path / "fit.json", tmp_path / "fit.svg"
    code, out, err = run(
        "identify", "loop.csv", *COLUMNS, "--model", "bouc-wen", "--fix", "n=1", "--bounds", "beta=0:2",
        "--initial", "rest", "--out", model, "--plot", loop,
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert out.startswith("BoucWen: fit 100.00 %")
    fitted = hs.load_model(model)
    assert fitted.beta == pytest.approx(LAW.beta, rel=1e-4)  # the search stops at a relative cost
    assert json.loads(model.read_text())["units"] == {"u": "V", "y": "um"}

    code, out, _ = run("simulate", model, "loop.csv", "--u", "voltage", "--t", "time", "--plot", tmp_path / "sim.svg")
    assert (code, out.splitlines()[0]) == (0, "t [s],u [V],y [um],z")
    again = hs.load(io.StringIO(out), u="u", y="y", t="t")
    assert np.array_equal(again.y, fitted.response(again.u))

    code, out, _ = run("plot", "loop.csv", *COLUMNS, "--model", model, "--out", tmp_path / "both.svg")
    assert (code, out) == (0, "")
    assert (tmp_path / "both.svg").read_bytes() == loop.read_bytes()
    text = "".join(ET.parse(loop).getroot().itertext())
    assert "Voltage [V]" in text
    assert "Displacement [µm]" in text
    assert {path.name for path in tmp_path.iterdir()} == {"fit.json", "fit.svg", "sim.svg", "both.svg"}


def test_metrics_have_units_and_are_those_of_loop_metrics(run, folder):
    code, out, _ = run("metrics", "loop.csv", *COLUMNS)
    loop = hs.loop_metrics(*(getattr(hs.load(folder / "loop.csv", u=1, y=2), name) for name in "uy"))
    assert code == 0
    assert f"largest width  {loop.max_width:.4g} um at u = {loop.max_width_at:.6g} V" in out
    assert f"area           {loop.area:.4g} um V" in out
    document = document_of(run, "metrics", "loop.csv", *COLUMNS, "--unit", "y=nm")
    assert document["area"] == loop.area
    assert document["units"] == {"u": "V", "y": "nm"}


def growing(law=None):
    """Text of a record 0, 1, -1, 2, -2, 0."""
    u = np.concatenate([np.linspace(a, b, 10, endpoint=False) for a, b in pairwise([0, 1, -1, 2, -2, 0])] + [[0.0]])
    y = u if law is None else law.response(u)
    return "".join(["u [mm],y [kN]\n", *(f"{a!r},{b!r}\n" for a, b in zip(u.tolist(), y.tolist(), strict=True))])


def test_every_cycle_has_a_row_in_text_csv_and_json(run, tmp_path):
    text = growing(hs.Stop(threshold=0.5))
    (tmp_path / "growing.csv").write_text(text)
    rec = hs.load(tmp_path / "growing.csv")
    table = hs.cycle_metrics(rec.u, rec.y)
    command = ("metrics", "-", "--u", "u", "--y", "y", "--cycles")
    code, out, err = run(*command, "--csv", tmp_path / "cycles.csv", "--out", tmp_path / "cycles.txt", stdin=text)
    assert (code, err) == (0, "")
    assert out.startswith(table.to_text(rec.units))
    assert max(map(len, out.splitlines())) <= 100
    assert (tmp_path / "cycles.txt").read_text() == out
    assert (tmp_path / "cycles.csv").read_text() == table.to_csv(rec.units)
    assert run(*command, "--csv", "-", stdin=text)[1] == table.to_csv(rec.units)
    document = document_of(run, *command, stdin=text)
    assert [row["energy"] for row in document["cycles"]] == table.energy.tolist()
    assert (document["level"], document["units"]) == (0.0, {"u": "mm", "y": "kN"})
    assert document["sign_convention"] == table.sign_convention
    assert document_of(run, *command[:-1], stdin=text)["energy"] == table.energy[-1]
    assert len(run(*command, "--tolerance", "0.3", stdin=text)[1].splitlines()) == len(out.splitlines()) - 1


test_options_of_cycles_that_make_no_sense_are_refused = refused_in_one_line(
    (("--csv", "x.csv"), "--csv writes the table of every cycle: give --cycles without a number too"),
    (("--cycles", "0"), "expected a number of cycles, at least 1; the table needs the file before --cycles, got '0'"),
    (("--cycles", "loop.csv"), "the table needs the file before --cycles"),
    (("--cycles", "3"), "asked for 3 complete cycle(s) of the input, found 1"),
    (("--json", "--cycles", "--csv", "-"), "two results would go to the standard output"),
    (("--cycles", "--csv", "-", "--out", "-"), "two results would go to the standard output"),
    call=lambda run, options: run("metrics", "-", "--u", "u", "--y", "y", *options, stdin=growing()),
)


def test_a_piezos_damping_is_printed_without_a_sign_and_the_sign_is_explained(run):
    code, out, _ = run("metrics", "-", "--u", "u", "--y", "y", stdin=growing(hs.Play(threshold=0.25)))
    assert code == 0
    assert re.search(r"equivalent damping \d", out)
    assert "The loop runs counterclockwise, as a piezo's displacement over its voltage" in out
    assert max(map(len, out.splitlines())) <= 100
    clockwise = run("metrics", "-", "--u", "u", "--y", "y", stdin=growing(hs.Stop(threshold=0.5)))[1]
    assert "piezo" not in clockwise


def test_numbers_that_do_not_exist_are_null(run):
    constant = "u,y\n0,1\n1,1\n0,1\n"
    assert document_of(run, "metrics", "-", "--u", "u", "--y", "y", stdin=constant)["relative_width"] is None
    line = document_of(run, "identify", "loop.csv", *COLUMNS, "--model", "line")
    assert (line["cv_rmse"], line["family"]) == (None, "Line")


def test_standard_streams_join_the_commands(run, folder):
    _, model, _ = run("identify", "loop.csv", *COLUMNS, "--model", "line", "--out", "-")
    assert json.loads(model)["family"] == "Line"
    _, table, _ = run("simulate", "-", "loop.csv", "--u", "voltage", stdin=model)
    assert table.startswith("u [V],y [um]\n")
    code, picture, _ = run("plot", "-", "--u", "u", "--y", "y", "--model", "law.json", "--out", "-", stdin=table)
    assert (code, picture.startswith("<svg")) == (0, True)
    assert picture == run("plot", "-", "--u", "u", "--y", "y", "--model", "law.json", "--out", "-", stdin=table)[1]


def test_time_can_be_a_step_a_column_or_brought_to_even_steps(run, tmp_path):
    lag = tmp_path / "lag.json"
    hs.save(hs.TransferFunction(num=(2.0,), den=(1.0, 1.0), hold="foh"), lag)
    numbers = ("simulate", lag, "-", "--u", "u")
    code, out, _ = run(*numbers, "--sample-time", 0.5, stdin="u\n1\n1\n1\n")
    assert (code, out.splitlines()[0], len(out.splitlines())) == (0, "t,u,y", 4)
    uneven = "t,u\n0,1\n1,1\n3,1\n"
    code, _, err = run(*numbers, "--t", "t", stdin=uneven)
    assert code == 2
    assert "evenly spaced" in err
    assert len(run(*numbers, "--t", "t", "--sample-time", 0.5, stdin=uneven)[1].splitlines()) == 8
    assert run(*numbers, "--sample-time", 0, stdin="u\n1\n1\n")[0] == 2


def test_a_structure_takes_its_own_options_and_no_other_family_does(run):
    structure = ["--model", "transfer-function", "--poles", 1, "--zeros", 0, "--hold", "foh"]
    code, out, _ = run("identify", "loop.csv", *COLUMNS, "--t", "time", *structure)
    assert (code, out.startswith("TransferFunction: fit")) == (0, True)
    code, _, err = run("identify", "loop.csv", *COLUMNS, "--model", "line", "--poles", 1)
    assert (code, err) == (2, "hysim: error: --poles is no option of the model line, but of transfer-function\n")
    code, _, err = run("identify", "loop.csv", *COLUMNS, "--model", "transfer-function", "--poles", 1)
    assert (code, err) == (2, "hysim: error: the model transfer-function needs --zeros\n")


def test_an_oscillator_is_identified_from_rest_and_from_a_period(run):
    law = hs.BoucWen(A=5e4, beta=800.0, gamma=-300.0)
    plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law)
    t = np.arange(200) / 750.0
    u = 60.0 * np.sin(2.0 * np.pi * (20.0 + 40.0 * t) * t)
    table = "\n".join(
        [
            "t,u,y",
            *(
                f"{a!r},{b!r},{c!r}"
                for a, b, c in zip(*map(np.ndarray.tolist, (t, u, plant.response(u, t[1]))), strict=True)
            ),
        ]
    )
    oscillator = ("identify", "-", "--u", "u", "--y", "y", "--model", "bouc-wen-oscillator", "--fix", "n=1")
    code, out, _ = run(*oscillator, "--initial", "rest", "--hold", "band-limited", "--oversampling", 4, stdin=table)
    assert (code, out.startswith("BoucWenOscillator: fit 99.")) == (0, True)
    code, _, err = run(*oscillator, "--initial", "periodic", stdin=table)
    assert code == 2
    assert "takes a period in samples" in err


def test_every_name_of_a_model_stands_for_something_that_can_be_identified(run):
    names = models.names_to_identify()
    assert {*models.names(), "bouc-wen", "zhu-wang", "baber-noori", "duhem", "line", "lugre"} <= set(names)
    for name in names:
        family = models.family(name)
        assert is_identifiable(family) or family in (hs.TransferFunction, hs.BoucWenOscillator, hs.Actuator)
    text = run("identify", "--help")[1].partition("Names of models: ")[2].partition("\n\n")[0]
    listed = "".join(text.split()).partition(".")[0]  # lines may be broken at hyphens
    assert listed == ",".join(names)


def test_models_are_compared_side_by_side_and_the_tables_written(run, tmp_path):
    names = ["--model", "line", "--model", "dahl", "--model", "law.json"]
    table, latex, picture = tmp_path / "models.csv", tmp_path / "models.tex", tmp_path / "models.svg"
    code, out, err = run(
        "compare", "loop.csv", *COLUMNS, *names, "--cross-validate", 4, "--test-cycles", 1,
        "--csv", table, "--latex", latex, "--plot", picture,
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert "test rmse [um]" in out
    assert "law predicts samples left out best" in " ".join(out.split())
    assert "seconds" not in out
    assert "time [" not in out
    assert [line.split(",")[0] for line in table.read_text().splitlines()] == ["model", "line", "dahl", "law"]
    assert latex.read_text().startswith(r"\begin{tabular}")
    assert picture.read_text().startswith("<svg")
    code, out, _ = run("compare", "loop.csv", *COLUMNS, "--model", "line", "--test", "loop.csv", "--markdown", "-")
    assert (code, out.startswith("| model | parameters |")) == (0, True)
    code, out, _ = run(
        "compare", "loop.csv", *COLUMNS, "--model", "bouc-wen", "--max-evaluations", 100, "--markdown", "-"
    )
    assert (code, "bouc-wen (partial)" in out) == (0, True)
    code, _, err = run("compare", "loop.csv", *COLUMNS, "--model", "parabola")
    assert code == 2
    assert err.startswith("hysim: error: there is no model 'parabola'")


def test_without_models_all_families_are_compared(run, monkeypatch):
    few = dict.fromkeys(("first", "second"), hs.Line)
    monkeypatch.setattr("hysim.comparison._compare.candidates", lambda: few)
    code, out, _ = run("compare", "loop.csv", *COLUMNS)
    assert (code, [line.split()[0] for line in out.splitlines()[2:4]]) == (0, ["first", "second"])


def test_a_search_that_does_not_converge_exits_with_1(run, monkeypatch):
    fit = hs.identify(hs.Line, hs.datasets.table1())
    unfinished = dataclasses.replace(fit, success=False)
    monkeypatch.setattr("hysim.identify", lambda *_, **__: unfinished)
    assert run("identify", "loop.csv", *COLUMNS, "--model", "line")[0] == 1


CORPUS = {
    "empty": (b"", "the file is empty"),
    "binary": (bytes(range(256)), "not a UTF-8 text file"),
    "zero bytes": (b"u,y\n0,\0\n", "not a text file"),
    "truncated": (b"u,y\n0,1\n1,2\n2", "line 4: expected 2 cells, got 1"),
    "mixed delimiters": (b"u,y\n0,1\n1;2\n2,3\n", "line 3: expected 2 cells, got 1"),
    "nan": (b"u,y\n0,1\n1,nan\n2,3\n", "line 3, column 'y': the value is missing"),
    "infinite": (b"u,y\n0,1\n1,inf\n2,3\n", "line 3, column 'y': expected a finite number, got 'inf'"),
    "text": (b"u,y\n0,1\n1,high\n2,3\n", "line 3, column 'y': expected a finite number, got 'high'"),
    "duplicate columns": (b"u,y,y\n0,1,1\n1,2,2\n", "2 columns are called 'y'"),
    "unknown column": (b"u,x\n0,1\n1,2\n", "no column 'y', the columns are: u, x"),
    "one row": (b"u,y\n0,1\n", "at least 2 samples, there are 1"),
    "wrong encoding": ("u,y [µm]\n0,1\n".encode("latin-1"), "pass its encoding, for instance --encoding latin-1"),
    "constant input": (b"u,y\n1,0\n1,1\n1,2\n1,3\n", "the input is constant"),
}


@pytest.mark.parametrize("name", CORPUS)
@pytest.mark.parametrize("command", ["identify", "metrics"])
def test_a_bad_file_is_one_line_and_exit_2_and_nothing_is_written(run, tmp_path, name, command):
    content, message = CORPUS[name]
    (tmp_path / "bad.csv").write_bytes(content)
    more = ["--model", "line", "--out", tmp_path / "out.json"] if command == "identify" else []
    code, out, err = run(command, tmp_path / "bad.csv", "--u", "u", "--y", "y", *more)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("hysim: error: ")
    assert message in err
    assert [path.name for path in tmp_path.iterdir()] == ["bad.csv"]


test_a_wrong_argument_is_one_line_and_exit_2 = refused_in_one_line(
    (["identify", "loop.csv", *COLUMNS, "--model", "lin"], "there is no model 'lin'"),
    (["identify", "loop.csv", *COLUMNS, "--model", "line", "--fix", "n"], "expected NAME=VALUE with numbers"),
    (["identify", "loop.csv", *COLUMNS, "--model", "line", "--bounds", "n=1"], "expected NAME=LOW:HIGH"),
    (["identify", "loop.csv", *COLUMNS, "--model", "line", "--fix", "n=1"], "names 'n'; the parameters are"),
    (["identify", "loop.csv", *COLUMNS, "--model", "line", "--cross-validate", "x"], "expected loo, cycles or"),
    (["identify", "loop.csv", *COLUMNS, "--model", "line", "--json", "--out", "-"], "two results would go to the"),
    (["identify", "loop.csv", *COLUMNS, "--model", "line", "--out", "a.svg", "--plot", "a.svg"], "to one file"),
    (["metrics", "none.csv", *COLUMNS], "none.csv: No such file"),
    (["metrics", ".", *COLUMNS], "Is a directory"),
    (["metrics", "loop.csv", *COLUMNS, "--unit", "x=V"], "expected t=, u= or y="),
    (["plot", "loop.csv", *COLUMNS, "--out", "loop.gif"], "call the file .svg, .png or .pdf, got loop.gif"),
    (["plot", "loop.csv", *COLUMNS, "--out", "none/loop.svg"], "its folder does not exist"),
    (["plot", "-", *COLUMNS, "--model", "-", "--out", "-"], "not both"),
    (["simulate", "-", "-", "--u", "u"], "not both"),
    (["simulate", "loop.csv", "loop.csv", "--u", "voltage"], "loop.csv does not hold a model of hysim"),
    (["simulate", "pid.json", "loop.csv", "--u", "voltage"], "a PID has no response"),
)


@pytest.mark.parametrize("command", ["identify", "metrics", "simulate", "plot"])
def test_help_names_every_option_of_a_record(run, command):
    code, out, _ = run(command, "--help")
    assert code == 0
    for option in ("--u", "--t", "--sample-time", "--delimiter", "--decimal", "--on-missing", "--resolution", "--unit"):
        assert option in out


WORDS = st.sampled_from(["0", "1", "2", "-1", "nan", "u", "x", "1e999", "", '"'])


@given(st.lists(st.lists(WORDS, min_size=2, max_size=2).map(",".join), max_size=8).map("\n".join), st.booleans())
def test_any_file_ends_in_an_exit_code_and_at_most_one_line_of_error(text, has_model):
    arguments = ["identify", "--model", "line"] if has_model else ["metrics"]
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        for name, stream in (("stdin", io.StringIO(text)), ("stdout", out), ("stderr", err)):
            patch.setattr(f"sys.{name}", stream)
        code = main([*arguments, "-", "--u", "0", "--y", "1"])
    assert code in (0, 1, 2)
    assert (err.getvalue().count("\n"), bool(out.getvalue())) == ((1, False) if code == 2 else (0, True))


def test_the_commands_of_the_documentation_run_in_order(run, folder, monkeypatch):
    page = (Path(__file__).parent.parent / "docs" / "command_line.md").read_text()
    (folder / "my_laws.py").write_text("import hysim as hs\nMyLaw = hs.Line\nmy_law = hs.Line(slope=0.02)\n")
    monkeypatch.syspath_prepend(folder)
    for block in re.findall(r"^```shell\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL):
        for line in block.replace("\\\n", "").splitlines():
            piped = None
            for command in line.split(" | "):
                code, piped, err = run(*command.split()[1:], stdin=piped)
                assert (code, err) == (0, ""), command
    del sys.modules["my_laws"]
    assert {"law.json", "fit.svg", "simulated.csv", "both.svg"} <= {path.name for path in folder.iterdir()}
