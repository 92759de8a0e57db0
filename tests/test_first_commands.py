"""What a new user runs first: a file to try, its columns, completion by the shell."""

import io
import json
import math
import os
import shlex
import subprocess
import sys

import click
import numpy as np
import pytest

import hysim as hs
from hysim.cli import COMMANDS, GROUPS, HYSIM, Command, learn, main
from hysim.cli.learn import DEVICES
from hysim.files import FileColumn


@pytest.mark.parametrize("name", ["piezo.csv", "piezo.npz", "piezo.mat"])
def test_the_example_is_table_1(run, name):
    assert run("example", name)[0] == 0
    assert hs.load(name) == hs.datasets.table1(dwell=1.0)


@pytest.mark.parametrize("name", ["piezo.csv", "a b's.csv"])
def test_what_the_example_says_to_try_runs(run, name):
    text = run("example", name)[1]
    tries = [shlex.split(line)[1:] for line in text.splitlines() if line.startswith("  hysim ")]
    assert len(tries) == 2
    assert run(*tries[0])[0] == 0
    assert tries[1][0] == "identify"


def test_the_example_overwrites_nothing(run, tmp_path):
    (tmp_path / "piezo.csv").write_text("mine")
    code, out, err = run("example", "piezo.csv")
    assert (code, out) == (2, "")
    assert "is there already" in err
    assert (tmp_path / "piezo.csv").read_text() == "mine"


def test_the_example_goes_to_the_standard_output(run):
    assert hs.load(io.StringIO(run("example", "-")[1])) == hs.datasets.table1(dwell=1.0)


def test_columns_of_a_text_have_names_numbers_units_and_ranges():
    t, u, note = hs.list_columns(io.StringIO("t [s];u [V];note\n0;1,5;a\n1;;b\n2;-2,5;c\n"))
    assert t == FileColumn("t", 0, "s", 3, 0, 0.0, 2.0, True)
    assert u == FileColumn("u", 1, "V", 2, 1, -2.5, 1.5, False)
    assert (note.name, note.number, note.n_samples, math.isnan(note.lowest)) == ("note", 2, 0, True)
    assert "line 2" in note.problem


def test_each_name_and_number_of_an_array_is_one_that_load_takes(tmp_path):
    rng = np.random.default_rng(0)
    arrays = {"one": rng.normal(size=9), "table": rng.normal(size=(9, 2)), "cube": rng.normal(size=(9, 2, 2))}
    np.savez(tmp_path / "all.npz", **arrays, words=np.array(["a"]))
    columns = hs.list_columns(tmp_path / "all.npz")
    assert [each.name for each in columns if each.problem] == ["words"]
    known = [each for each in columns if not each.problem]
    assert [each.name for each in known][:3] == ["one", "table[0]", "table[1]"]
    assert len(known) == 1 + 2 + 4
    for each in known:
        loaded = hs.load(tmp_path / "all.npz", u="one", y=each.name)
        assert (loaded.y.min(), loaded.y.max()) == (each.lowest, each.highest)
    np.save(tmp_path / "table.npy", arrays["table"])
    for each in hs.list_columns(tmp_path / "table.npy"):
        assert hs.load(tmp_path / "table.npy", u=0, y=each.number).y.max() == each.highest


def test_hysim_columns_prints_what_u_and_y_take(run, tmp_path):
    (tmp_path / "loop.csv").write_text("time [ms],voltage [V]\n0,1\n1,3\n")
    assert run("columns", "loop.csv")[1].splitlines() == [
        "  0  time     2 samples, 0 to 1 ms, increases throughout",
        "  1  voltage  2 samples, 1 to 3 V, increases throughout",
    ]
    document = json.loads(run("columns", "loop.csv", "--json")[1])
    assert [column["unit"] for column in document["columns"]] == ["ms", "V"]
    assert run("columns", "none.csv")[0] == 2


def completed(monkeypatch, capsys, *words):
    """What the script of bash is told to offer for the last of these words, with the kind of each."""
    monkeypatch.setenv("_HYSIM_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", shlex.join(words))
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    assert main([]) == 0
    return capsys.readouterr().out.split()


def test_commands_options_values_and_models_are_completed(monkeypatch, capsys):
    def of(*words):
        return completed(monkeypatch, capsys, "hysim", *words)

    assert of("id") == ["plain,identify"]
    assert of("identify", "--noi") == ["plain,--noise"]
    assert of("identify", "x.csv", "--noise", "") == ["plain,gaussian", "plain,quantised", "plain,robust"]
    assert of("identify", "--model", "prandtl") == ["file,prandtl", "plain,prandtl-ishlinskii"]
    assert of("completion", "z") == ["plain,zsh"]
    assert of("identify", "--u", "v") == ["file,v"]  # the shell goes on with the names of files
    assert of("metrics", "lo") == ["file,lo"]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_completed(monkeypatch, capsys, name):
    offered = completed(monkeypatch, capsys, "hysim", name, "--")
    assert {f"plain,{each.opts[0]}" for each in Command(name).params if each.opts[0].startswith("--")} <= {*offered}


def test_bash_offers_what_its_script_is_told(run, tmp_path):
    (tmp_path / "hysim").write_text(f'#!/bin/sh\nexec {sys.executable} -m hysim "$@"\n')
    (tmp_path / "hysim").chmod(0o755)
    (tmp_path / "hysim.bash").write_text(run("completion", "bash")[1])
    words = "COMP_WORDS=(hysim identify --intervals pro); COMP_CWORD=3"
    text = f"source ./hysim.bash; {words}; _hysim_completion ./hysim; echo ${{COMPREPLY[@]}}"
    environment = {**os.environ, "PYTHONPATH": os.path.dirname(os.path.dirname(__file__))}
    done = subprocess.run(["bash", "-c", text], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout == "profile\n"


@pytest.mark.parametrize("name", ["bash", "zsh", "fish"])
def test_a_script_for_each_shell_is_printed(run, name):
    code, out, err = run("completion", name)
    assert (code, err) == (0, "")
    assert f"_HYSIM_COMPLETE={name}_complete" in out


def test_warm_up_makes_every_call(run, monkeypatch):
    every = learn.calls()
    assert {*hs.families(), "responses", "frame", "closed loop"} <= every.keys()
    few = ("Play", "Dashpot", "PolynomialBoucWen", "oscillator, split", "identify Line")
    monkeypatch.setattr(learn, "calls", lambda: {name: every[name] for name in few})
    assert run("warm-up") == (0, "5 calls have been compiled\n", "")


def test_each_device_has_an_example_whose_tries_are_commands(run, tmp_path):
    for name, device in DEVICES.items():
        assert run("example", "--device", name)[0] == 0
        record = hs.load(tmp_path / f"{name}.csv")
        assert len(record) == len(device.record())
        assert "y" in record.units
        for line in device.tries:
            parsed(line.format(f"{name}.csv").split())


def parsed(words):
    """Name of the command in these words, whose arguments and options it takes."""
    Command(words[0]).make_context(words[0], words[1:])
    return words[0]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_in_each_help_are_commands(name):
    command = Command(name)
    lines = command.sections["Examples"].splitlines()
    assert lines
    assert command.get_help(click.Context(command)).endswith("\n".join(f"  {line}" for line in lines))
    for line in lines:
        for each in line.split(" | "):
            words = shlex.split(each)
            assert words[0] == "hysim"
            assert parsed(words[1:]) in (name, "plot")


def test_the_help_shows_every_command_in_a_group():
    text = HYSIM.get_help(click.Context(HYSIM))
    assert all(f"\n{title}:\n  " in text for title in GROUPS)
    assert all(f"\n  {name} " in text for name in COMMANDS)
    assert sum(map(len, GROUPS.values())) == len(COMMANDS)


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["metrics", "--help"], []])
def test_help_loads_no_numpy(arguments):
    code = f"import sys; from hysim.cli import main; main({arguments}); sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0
