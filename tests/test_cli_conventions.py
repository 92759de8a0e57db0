"""What holds for every command: help with units, exit codes, JSON, pictures, and files that are whole or not there."""

import dataclasses
import io
import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated, Literal

import click
import numpy as np
import pytest
from strategies import assert_refused, document_of, refused_in_one_line

import hysim as hs
from hysim._basics.atomic import write_all
from hysim.cli import COMMANDS, Command, designs, models, options, outputs
from hysim.cli.look import KINDS

LAW = hs.BoucWen(beta=0.03, gamma=0.02, gain=-0.01, feedthrough=0.03)
COLUMNS = ("--u", "voltage", "--y", "displacement")
PARSERS = {name: Command(name) for name in COMMANDS}
QUANTITIES = ("NUMBER", "LOW,HIGH", "FREQUENCY,DAMPING", "NAME=VALUE", "NAME=LOW:HIGH", "QUANTUM")
OPTIONS = {f"{name} {each.click.name}": each for name, command in PARSERS.items() for each in command.declared}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A record of a sine that fades, and models."""
    folder = tmp_path_factory.mktemp("conventions")
    u = 50.0 + np.linspace(50.0, 48.0, 241) * np.sin(np.linspace(0.0, 12.0 * np.pi, 241))
    rows = [f"{k / 10},{a!r},{b!r}" for k, (a, b) in enumerate(zip(u.tolist(), LAW.response(u).tolist(), strict=True))]
    (folder / "loop.csv").write_text("\n".join(["t [s],voltage [V],displacement [um]", *rows]))
    hs.save(LAW, folder / "law.json", units={"u": "V", "y": "um"})
    hs.save(hs.TransferFunction(num=(2.0,), den=(1.0, 1.0)), folder / "lag.json")
    hs.save(dataclasses.replace(LAW, n=1.5), folder / "other.json")
    (folder / "width.py").write_text("def width(beta, n):\n    return {'width': beta * n}\n")
    (folder / "study.toml").write_text('task = "width.py:width"\n[grid]\nbeta = [0.1, 0.2]\nn = [1.0, 2.0]\n')
    return folder


def test_the_commands_are_those_of_the_design():
    wanted = {"simulate", "identify", "discover", "compare", "metrics", "control", "plot", "sweep", "reproduce"}
    assert wanted <= PARSERS.keys()
    assert len(PARSERS) == len(COMMANDS)


@pytest.mark.parametrize("name", OPTIONS)
def test_every_option_has_help_and_every_quantity_a_unit(name):
    option = OPTIONS[name]
    assert option.help, name
    if option.value.name in QUANTITIES:
        assert re.search(r"\[(1|s|Hz|%|units? of .+)\]", option.help), (name, option.help)


@pytest.mark.parametrize("name", ["identify", "compare", "simulate", "plot", "control", "page", "c", "fmu"])
def test_the_help_says_that_a_model_of_ones_own_is_code_that_is_executed(name):
    assert "module:name of your own, which executes ./module.py" in " ".join(help_of(name).split())


def help_of(name):
    return PARSERS[name].get_help(click.Context(PARSERS[name]))


@dataclass(kw_only=True)
class Group:
    """Some options.

    some numbers
    ------------
    limits : a text that goes on
        in another line, 100 %
    hold : one of two words
    """

    limits: options.Pair | None = None
    hold: Literal["zoh", "foh"] = "zoh"


def declared(
    file: options.RecordIn,
    others: tuple[options.RecordIn, ...] = (),
    *,
    group: Group,
    units: options.Units | None = None,
    no_t: bool = False,
    cycles: Annotated[int, options.Value("CYCLES", lambda text: 0 if text == "all" else int(text), bare="all")] = 1,
    plot: options.Picture | None = None,
    scale: float,
):
    """A command.

    Parameters
    ----------
    file : an argument
    others : more of them
    units : more than once
    no_t : without a value
    cycles : with or without a number
    plot : a picture
    scale : a number
    """
    return file, others, group, units, no_t, cycles, plot, scale


def test_options_follow_from_signature_annotations_and_docstring():
    parameters = {each.click.name: each for each in options.parameters(declared)}
    command = click.Command("try", params=[each.click for each in parameters.values()])

    def called(*arguments):
        return options.call(declared, command.make_context("try", ["a", "--scale", "3", *arguments]).params)

    used = ("b", "c", "--limits", "-1,2", "--unit", "u=V", "--unit", "y=m", "--no-t", "--cycles", "--plot", "x.svg")
    units = {"u": "V", "y": "m"}
    assert called(*used) == ("a", ("b", "c"), Group(limits=(-1.0, 2.0)), units, True, 0, "x.svg", 3.0)
    assert called() == ("a", (), Group(), None, False, 1, None, 3.0)
    roles = {name: each.value.role for name, each in parameters.items() if each.value.role}
    assert roles == {"file": "input", "others": "input", "plot": "picture"}
    assert {each.title for each in parameters.values()} == {"Arguments", "some numbers", "Options"}
    help_ = " ".join(command.get_help(click.Context(command)).split())
    assert "a text that goes on in another line, 100 %" in help_
    assert "a picture; written as SVG, PNG or PDF by its ending" in help_
    assert "one of two words [default: zoh]" in help_
    assert "a number [required]" in help_
    for wrong in (["--limits", "1"], ["--hold", "hold"], ["--unit", "x=m"], ["--scale", "3um"]):
        assert_refused(f"expected .*, got '{wrong[1]}'", called, *wrong, error=click.BadParameter)


def test_without_a_command_help_is_printed_and_nothing_done(run):
    code, out, err = run()
    assert (code, out) == (2, "")
    assert err.startswith("Usage: hysim")
    assert all(name in err for name in PARSERS)


@pytest.mark.parametrize(("wrong", "near"), [("reproduec", "reproduce"), ("identfy", "identify"), ("plto", "plot")])
def test_an_unknown_command_is_answered_with_the_nearest(run, wrong, near):
    code, out, err = run(wrong, "loop.csv")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"there is no command {wrong!r}: did you mean {near}?" in err
    assert "there are example" in run("xyz")[2]


def test_nobody_has_to_read_all_of_the_output(folder):
    command = f"{sys.executable} -W error -m hysim metrics loop.csv {' '.join(COLUMNS)}"
    pipe = f"{command} | true; test ${{PIPESTATUS[0]}} = 0 && {command} > /dev/full; test $? = 2"
    done = subprocess.run(["bash", "-c", pipe], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0
    assert done.stderr == "hysim: error: No space left on device\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ("metrics", "loop.csv", *COLUMNS),
        ("control", "law.json", "--sample-time", "0.1", "--range", "0.5,1", "--controller", "inverse"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_machines_get_json_and_the_units(run, arguments):
    assert document_of(run, *arguments).get("units", {"y": "um"})["y"] == "um"


def test_a_comparison_is_whole_in_json_and_its_best_model_is_written(run, tmp_path):
    models = ("--model", "line", "--model", "law.json")
    arguments = ("compare", "loop.csv", *COLUMNS, *models, "--cross-validate", "4", "--out", tmp_path / "best.json")
    document = document_of(run, *arguments)
    assert document["winner"] == "law"
    assert [row["name"] for row in document["rows"]] == ["line", "law"]
    assert document["rows"][1]["fit_percent"] == pytest.approx(100.0)
    assert document["rows"][1]["bic"] is None
    assert "seconds" not in document["rows"][0]
    assert hs.load_model(tmp_path / "best.json") == LAW


@pytest.mark.extra("emcee")
def test_a_posterior_is_printed_and_a_folder_of_files_written(run, tmp_path):
    sampled = ("posterior", "loop.csv", *COLUMNS, "--model", "line", "--samples", "200", "--prior", "slope=0:1")
    code, out, err = run(*sampled, "--out", tmp_path / "new" / "folder", "--json")
    folder = tmp_path / "new" / "folder"
    assert (code, err) == (0, "")
    assert out == (folder / "posterior.json").read_text()
    document = json.loads(out)
    assert [each["name"] for each in document["parameters"]] == ["offset", "slope", "sigma"]
    assert document["priors"]["slope"] == "flat from 0 to 1"
    assert {path.name for path in folder.iterdir()} == {"parameters.csv", "samples.csv", "corner.svg", "posterior.json"}
    draws = np.loadtxt(folder / "samples.csv", delimiter=",", skiprows=1)
    medians = np.genfromtxt(folder / "parameters.csv", delimiter=",", skip_header=1, usecols=1)
    np.testing.assert_array_equal(np.median(draws, axis=0), medians)
    assert [each["median"] for each in document["parameters"]] == medians.tolist()


def test_a_study_is_told_as_json_and_drawn(run, tmp_path):
    picture = tmp_path / "study.svg"
    document = document_of(run, "sweep", "study.toml", "--out", tmp_path / "rows.sqlite", "--plot", picture)
    assert document["outputs"]["width"] == {
        "lowest": 0.1, "median": pytest.approx(0.2), "highest": 0.4, "not_finite": 0,
    }  # fmt: skip
    assert (document["n_tasks"], document["n_done"], document["parameters"]) == (4, 4, ["beta", "n"])
    assert "from dark to light: width" in picture.read_text()
    code, _, err = run("sweep", "--show", tmp_path / "rows.sqlite", "--plot", tmp_path / "other.svg", "--of", "height")
    assert (code, err) == (2, "hysim: error: no output 'height' to draw: there are width\n")


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_reproduction_is_told_as_json(run, tmp_path, monkeypatch):
    def reproduce(out, *, quick, page, thorough):
        fits = {"model": SimpleNamespace(success=True)}
        return SimpleNamespace(folder=tmp_path, findings=SimpleNamespace(study=SimpleNamespace(fits=fits)))

    (tmp_path / "summary.json").write_text("{}\n")
    monkeypatch.setattr("hysim.paper.reproduce", reproduce)
    assert run("reproduce", "--json") == (0, "{}\n", "")


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_picture_is_drawn_from_files(run, tmp_path, kind):
    models = ["--model", "law.json"] if kind in ("loop", "residual-map", "describing-function") else []
    models = ["--model", "law.json", "--model", "other.json"] if kind == "history" else models
    files = ["loop.csv", "loop.csv"] if kind in ("loop", "width") else ["loop.csv"]
    if kind == "forc":
        u = hs.signals.reversal_curves(-1.0, 1.0, curves=4)
        hs_rows = [f"{a},{b}" for a, b in zip(u.tolist(), hs.Play(threshold=0.3).response(u).tolist(), strict=True)]
        files = [tmp_path / "curves.csv"]
        files[0].write_text("\n".join(["voltage,displacement", *hs_rows]))
    out = tmp_path / "picture.svg"
    assert run("plot", *files, *COLUMNS, "--kind", kind, *models, "--out", out) == (0, "", "")
    text = out.read_text()
    assert text.startswith("<svg")
    assert ("BoucWen" in text) == (kind == "loop")  # one model by its family, several by their files
    assert all((f">{name}<" in text) == (kind == "history") for name in ("law", "other"))


test_a_picture_needs_its_files_and_models = refused_in_one_line(
    (("--kind", "residual-map"), "--kind residual-map takes 1 --model, got 0"),
    (("--kind", "describing-function"), "takes at least 1 --model, got 0"),
    (("loop.csv", "--kind", "forc"), "--kind forc takes 1 file, got 2"),
    call=lambda run, words: run("plot", "loop.csv", *words, *COLUMNS, "--out", "x.svg"),
)


@pytest.mark.parametrize(("form", "begin"), [("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_a_picture_in_another_form_is_the_same_bytes_each_time(run, tmp_path, form, begin):
    assert run("plot", "loop.csv", *COLUMNS, "--out", tmp_path / f"loop.{form}")[0] == 0
    assert (tmp_path / f"loop.{form}").read_bytes().startswith(begin)
    empty = hs.plot.figure(width=1.0, height=1.0)
    assert hs.plot.to_bytes(empty, form) == hs.plot.to_bytes(empty, form)


def test_another_form_of_a_picture_is_refused():
    assert_refused("form must be one of svg, png, pdf, got 'gif'", hs.plot.to_bytes, hs.plot.figure(), "gif")


def test_nothing_is_written_if_one_of_the_files_cannot_be(tmp_path):
    (tmp_path / "kept").write_text("before")
    with pytest.raises(OSError, match="No such file"):
        write_all({tmp_path / "kept": "after", tmp_path / "new": b"new", tmp_path / "none" / "file": "x"})
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"kept": "before"}


def test_a_link_is_followed_and_a_pipe_is_written_to(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "target")
    write_all({tmp_path / "link": "text", "/dev/null": "gone"})
    assert (tmp_path / "target").read_text() == "text"
    assert (tmp_path / "link").is_symlink()
    assert not os.path.isfile("/dev/null")


def test_a_folder_that_may_not_be_written_to_is_refused_before_anything_is_computed(run, monkeypatch):
    monkeypatch.setattr(outputs.os, "access", lambda *_: False)
    monkeypatch.setattr("hysim.identify", lambda *_, **__: pytest.fail("computed all the same"))
    code, _, err = run("identify", "loop.csv", *COLUMNS, "--model", "line", "--out", "model.json")
    assert (code, err) == (2, "hysim: error: cannot write model.json: its folder may not be written to\n")


def test_too_little_memory_and_missing_libraries_are_one_line(run, monkeypatch):
    for error, line in ((MemoryError(), "there is not enough memory for this"), (ImportError("needs x"), "needs x")):

        def fails(*_, error=error, **__):
            raise error

        monkeypatch.setattr("hysim.loop_metrics", fails)
        assert run("metrics", "loop.csv", *COLUMNS) == (2, "", f"hysim: error: {line}\n")


def test_a_line_of_progress_is_overwritten_by_the_error(run, monkeypatch):
    monkeypatch.setattr("sys.stderr", terminal := Terminal())
    assert run("metrics", "none.csv", *COLUMNS)[0] == 2
    assert terminal.getvalue() == "\r\x1b[Khysim: error: none.csv: No such file or directory\n"


DESIGN = ("--sample-time", "0.01", "--limits", "0,100")


def test_a_controller_goes_from_model_to_files_and_does_what_is_printed(run, tmp_path):
    files = [tmp_path / name for name in ("c.json", "stage.c", "loop.svg")]
    where = [word for option, path in zip(("--out", "--c", "--plot"), files, strict=True) for word in (option, path)]
    mode = ("--mode", "5,0.05", "--controller", "model-following", "--record", "loop.csv", *COLUMNS)
    code, out, err = run("control", "law.json", *DESIGN, *mode, *where)
    assert (code, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 100
    controller = hs.load_model(files[0])
    assert controller.limits == (0.0, 100.0)
    assert {path.name for path in tmp_path.iterdir()} == {"c.json", "stage.c", "stage.h", "loop.svg"}
    assert "Reference [µm]" in files[2].read_text()
    assert "record     the model fits the displacement [µm] by 100.00 %" in out
    plant = hs.Actuator(hysteresis=LAW, vibration=hs.mode(10.0 * np.pi, 0.05))
    assert controller.model == plant
    low, high, hertz = map(float, re.search(r"triangle +([\d.]+) to ([\d.]+) um, ([\d.]+) Hz", out).groups())
    assert hertz == pytest.approx(5.0 / 200.0)  # 200 periods of the mode in a cycle
    reachable = LAW.response(hs.signals.triangle(0.0, 100.0, cycles=2, samples_per_cycle=2000))[2000:]
    assert [low, high] == pytest.approx(reachable.min() + np.ptp(reachable) * np.array([0.1, 0.9]), rel=1e-3)
    triangle = {"low": low, "high": high, "period": 40.0, "sample_time": 0.01}
    again = hs.control.assess_hysteresis(plant, controller, **triangle)
    told = float(re.search(r"hysteresis reduction +([\d.]+) %", out)[1])
    assert told == pytest.approx(again.hysteresis_reduction_percent, abs=0.1)  # low and high have four digits
    assert re.search(r"VibrationReduction: overshoot [\d.]+ %, residual rms [\d.]+ %, settling time [\d.]+ %", out)


def test_gains_are_tuned_within_the_bounds(run):
    plant = ("--mode", "2,0.3", "--noise", "1e-3", "--quantum", "1e-3", "--delay", "0.02", "--creep", "1")
    document = document_of(
        run, "control", "law.json", "--sample-time", "0.02", "--range", "0.5,2", *plant, "--frequency", "0.2",
        "--duration", "5", "--controller", "tracking", "--max-sensitivity", "1.5", "--max-voltage-noise", "1",
    )  # fmt: skip
    assert document["tuning"]["max_sensitivity"] <= 1.5
    assert document["tuning"]["voltage_noise"] <= 1.0
    assert document["triangle"]["hysteresis_reduction_percent"] is not None
    assert document["conditions"]["noise"] == 1e-3
    assert document["conditions"]["sensor_quantum"] == 1e-3
    assert document["plant"]["parameters"]["creep"] is not None
    assert document["controller"]["parameters"]["feedback"]["parameters"]["ki"] > 0.0


def test_control_of_a_law_that_runs_away_says_which_option_makes_it_safe(run, tmp_path):
    hs.save(hs.BoucWen(beta=-0.02, gamma=0.01, feedthrough=0.03, gain=-0.01), tmp_path / "law.json")
    code, _, error = run("control", tmp_path / "law.json", "--limits", "0,125", "--sample-time", "1e-3")
    assert (code, "identify it with hysim identify --admissible yes" in error) == (2, True)


def test_control_names_the_quantities_that_drive_and_takes_them_in_the_units_of_the_model(run, tmp_path):
    u = hs.signals.triangle(0.0, 100.0, cycles=2, samples_per_cycle=100)
    law = hs.BoucWen(n=1.0, beta=0.02, gamma=0.01, gain=0.01, feedthrough=0.02)
    hs.save(law, tmp_path / "stack.json", units={"u": "V", "y": "um"})
    hs.save_record(hs.Record(u=u / 1e3, y=law.response(u), units={"u": "kV", "y": "um"}), tmp_path / "cycle.csv")
    (tmp_path / "way.csv").write_text("t [s],r [mm]\n0,0.0005\n0.1,0.001\n0.2,0.0005\n")
    design = ("control", tmp_path / "stack.json", "--record", tmp_path / "cycle.csv", "--sample-time", "1e-3")
    code, out, _ = run(*design, "--controller", "inverse", "--reference", tmp_path / "way.csv")
    assert (code, "record     the model fits the displacement [µm] by 100.00 %\n" in out) == (0, True)
    assert "reference  displacement [µm]: way.csv, second column, tracking rms 0." in out
    assert "command    voltage [V]: 0 to 100 V, the extremes of cycle.csv\n" in out
    assert "  100.00  " in run("compare", tmp_path / "cycle.csv", "--model", tmp_path / "stack.json")[1]
    names, *lines = run("simulate", tmp_path / "stack.json", tmp_path / "cycle.csv")[1].splitlines()
    assert names == "u [V],y [um],z"
    assert np.loadtxt(lines, delimiter=",")[:, 1] == pytest.approx(law.response(u), abs=1e-12)
    for name, unit in (("way.csv", "V"), ("cycle.csv", "N")):
        path = tmp_path / name
        path.write_text(path.read_text().replace("[mm]", f"[{unit}]").replace("[kV]", f"[{unit}]"))
        code, _, err = run(*design, "--controller", "inverse", "--reference", tmp_path / "way.csv")
        assert (code, f"{name} is not in the units of the model: '{unit}' cannot become" in err) == (2, True)
    assert run("plot", path, "--model", tmp_path / "stack.json", "--out", tmp_path / "loop.svg")[0] == 2


def test_a_model_takes_times_in_its_own_unit(run, tmp_path):
    lag, u, t = hs.TransferFunction(num=(1.0,), den=(5.0, 1.0)), np.sin(np.arange(50.0)), np.arange(50.0)
    hs.save(lag, tmp_path / "ms.json", units={"t": "ms"})
    hs.save_record(hs.Record(u=u, y=u, t=1e-3 * t, units={"t": "s"}), tmp_path / "s.csv")
    _, *lines = run("simulate", tmp_path / "ms.json", tmp_path / "s.csv")[1].splitlines()
    assert np.loadtxt(lines, delimiter=",")[:, 2] == pytest.approx(lag.response(u, 1.0), abs=1e-12)
    hs.save(lag, tmp_path / "unlabelled.json")  # which counts in s
    hs.save_record(hs.Record(u=u, y=u, t=1e3 * t, units={"t": "ms"}), tmp_path / "ms.csv")
    _, *lines = run("simulate", tmp_path / "unlabelled.json", tmp_path / "ms.csv")[1].splitlines()
    assert np.loadtxt(lines, delimiter=",")[:, 2] == pytest.approx(lag.response(u, 1.0), abs=1e-12)
    for words in (
        ("control", "--range", "0,1"),
        ("c", "--out", tmp_path / "m.c"),
        ("fmu", "--out", tmp_path / "m.fmu"),
    ):
        code, _, err = run(words[0], tmp_path / "ms.json", "--sample-time", "1e-3", *words[1:])
        assert (code, "ms.json counts time in ms, and the sample time is in s" in err) == (2, True)


def test_a_reference_is_a_step_or_a_file_and_the_loop_of_a_linear_plant_is_lag(run, tmp_path):
    (tmp_path / "way.csv").write_text("t [ms],r\n0,0\n1000,1\n2000,0.5\n")
    slow = ("--range", "0,1", "--frequency", "0.1", "--duration", "5", "--controller", "integral")
    design = ("control", "lag.json", "--sample-time", "0.02", *slow)
    code, out, _ = run(*design, "--reference", tmp_path / "way.csv")
    assert code == 0
    assert float(re.search(r"reference .* tracking rms ([\d.]+)", out)[1]) < 0.5
    assert "lag reduction" in out
    assert "without the memory" not in out
    step = document_of(run, *design, "--reference", "step", "--step", "-0.25")
    assert step["reference_tracking_rms"] is None
    assert step["step"]["height"] == -0.25
    assert step["step"]["u0"] == pytest.approx(0.375)  # three quarters of the range, over the gain of 2


def test_bounds_that_cannot_be_kept_exit_with_1(run):
    tight = ("--controller", "notch", "--mode", "2,0.01", "--vary-mode", "5", "--max-sensitivity", "1.0000001")
    short = ("--sample-time", "0.02", "--range", "0.5,2", "--frequency", "0.5", "--duration", "5")
    code, out, _ = run("control", "law.json", *short, *tight)
    assert code == 1
    assert "NOT within its bounds" in out


test_a_design_that_makes_no_sense_is_refused_in_one_line = refused_in_one_line(
    (("law.json", "--sample-time", "0.01"), "give --range LOW,HIGH, or --limits LOW,HIGH, or --record FILE"),
    (("law.json", *DESIGN, "--sample-time", "0"), "'--sample-time': expected a positive number"),
    (("law.json", *DESIGN, "--frequency", "-1"), "'--frequency': expected a positive number"),
    (("law.json", *DESIGN, "--duration", "nan"), "'--duration': expected a positive number"),
    (("law.json", *DESIGN, "--step", "0"), "--step must be a number that is not zero"),
    (("law.json", *DESIGN, "--range", "2,1"), "LOW below HIGH, got '2,1'"),
    (("law.json", "--sample-time", "1", "--limits", "1,0"), "'--limits': expected LOW,HIGH"),
    (("law.json", *DESIGN, "--limits", "1"), "expected LOW,HIGH with numbers"),
    (("law.json", *DESIGN, "--controller", "notch"), "needs a plant with one mode, this one has 0"),
    (("law.json", *DESIGN, "--vary-mode", "10"), "needs a plant with one mode"),
    (("law.json", *DESIGN, "--mode", "1,0.1", "--vary-mode", "100"), "expected a number above 0 and below 100"),
    (("law.json", *DESIGN, "--preview"), "--preview is for inverse, tracking, model-following"),
    (("law.json", *DESIGN, "--c", "x.h"), "call the file .c"),
    (("lag.json", "--sample-time", "1e-6", "--range", "0,1"), "the plant is too slow for the sample time"),
    (("loop.csv", *DESIGN), "does not hold a model"),
    call=lambda run, words: run("control", *words),
)


def test_the_kinds_of_controllers_are_the_same_in_help_and_in_designs():
    made = hs.Actuator(hysteresis=LAW, vibration=hs.mode(10.0, 0.1))
    for kind in models.CONTROLLERS:
        tuned = designs.feedback(made, kind, None) or hs.PID(kp=1.0)
        controller = designs.controller(made, kind, None, tuned, preview=False)
        assert (getattr(controller, "feedforward", None) is not None) == (kind in designs.INVERTING)


def test_a_plant_without_a_resting_voltage_steps_from_none():
    options = SimpleNamespace(
        sample_time=0.1, range=(10.0, 20.0), frequency=None, duration=None, step=None, limits=(0.0, 1.0)
    )
    asked = designs.task(hs.Actuator(hysteresis=hs.Line(slope=1.0)), options, (0.0, 1.0))
    assert asked.u0 == 0.0
    assert asked.samples_per_cycle == 1000
