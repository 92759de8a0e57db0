"""What a new user runs first: a file to try, its columns, completion by the shell."""

import io
import json
import math
import re
import shlex
import subprocess

import numpy as np
import pytest

import hysim as hs
from hysim.cli import COMMANDS, GROUPS, main, parsers
from hysim.cli.example import DEVICES
from hysim.cli.shell.completion import bash, fish, zsh
from hysim.files import FileColumn


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run a command in an empty folder: exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def command(*arguments):
        code = main([*arguments])
        return code, *capsys.readouterr()

    return command


@pytest.mark.parametrize("name", ["piezo.csv", "piezo.npz", "piezo.mat"])
def test_the_example_is_table_1(run, name):
    assert run("example", name)[0] == 0
    assert hs.load(name) == hs.datasets.table1(dwell=1.0)


def test_what_the_example_says_to_try_runs(run):
    text = run("example", "piezo.csv")[1]
    tries = [line.split()[1:] for line in text.splitlines() if line.startswith("  hysim ")]
    assert len(tries) == 2
    assert run(*tries[0])[0] == 0
    assert COMMANDS[tries[1][0]].name == "identify"


def test_the_example_overwrites_nothing(run, tmp_path):
    (tmp_path / "piezo.csv").write_text("mine")
    code, out, err = run("example", "piezo.csv")
    assert (code, out) == (2, "")
    assert "is there already" in err
    assert (tmp_path / "piezo.csv").read_text() == "mine"


def test_the_example_goes_to_the_standard_output(run):
    out = run("example", "-")[1]
    assert hs.load(io.StringIO(out)) == hs.datasets.table1(dwell=1.0)


def test_columns_of_a_text_have_names_numbers_units_and_ranges():
    text = io.StringIO("t [s];u [V];note\n0;1,5;a\n1;;b\n2;-2,5;c\n")
    t, u, note = hs.list_columns(text)
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


def completed(folder, *words):
    """What bash offers for the last of these words."""
    script = folder / "hysim.bash"
    script.write_text(bash(parsers()[1]))
    line = " ".join(f"'{word}'" for word in words)
    text = f"source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _hysim; echo ${{COMPREPLY[@]}}"
    return subprocess.run(["bash", "-c", text], capture_output=True, text=True, check=True).stdout.split()


def test_bash_completes_commands_options_values_and_models(tmp_path):
    assert completed(tmp_path, "hysim", "id") == ["identify"]
    assert completed(tmp_path, "hysim", "identify", "--noi") == ["--noise"]
    assert completed(tmp_path, "hysim", "identify", "x.csv", "--noise", "") == ["gaussian", "quantised", "robust"]
    assert completed(tmp_path, "hysim", "identify", "--model", "prandtl") == ["prandtl-ishlinskii"]
    assert completed(tmp_path, "hysim", "completion", "z") == ["zsh"]
    assert completed(tmp_path, "hysim", "identify", "--u", "") == []  # bash goes on with the names of files


@pytest.mark.parametrize("script", [bash, zsh, fish])
def test_every_option_is_in_the_script_of_each_shell(script):
    text = script(parsers()[1])
    for name, parser in parsers()[1].items():
        assert re.search(rf"\b{name}\b", text)
        for action in parser._actions:
            for option in action.option_strings:
                assert option == "-h" or re.search(rf"(--|-l ){option.removeprefix('--')}\b", text), option


def test_the_command_prints_the_script(run):
    assert run("completion", "bash")[1] == bash(parsers()[1]) + "\n"


def test_each_device_has_an_example_whose_tries_are_commands(run, tmp_path):
    for name, device in DEVICES.items():
        assert run("example", "--device", name)[0] == 0
        record = hs.load(tmp_path / f"{name}.csv")
        assert len(record) == len(device.record())
        assert "y" in record.units
        for line in device.tries:
            parsers()[0].parse_args(line.format(f"{name}.csv").split())


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_in_each_help_are_commands(name):
    parser, of_commands = parsers()
    lines = COMMANDS[name].examples.strip().splitlines()
    assert lines
    assert of_commands[name].format_help().endswith("".join(f"  {line}\n" for line in lines))
    for line in lines:
        for command in line.split(" | "):
            words = shlex.split(command)
            assert words[0] == "hysim"
            assert parser.parse_args(words[1:]).command.name in (name, "plot")


def test_the_help_shows_every_command_in_a_group(run):
    text = parsers()[0].format_help()
    assert all(f"\n{title}:\n  " in text for title in GROUPS)
    assert all(f"\n  {name} " in text for name in COMMANDS)
    assert sum(map(len, GROUPS.values())) == len(COMMANDS)
