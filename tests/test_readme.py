"""The README is short, its commands have the agreed form, its Python block runs, and its links lead somewhere."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("heading", ["Run", "Test"])
def test_a_heading_has_one_command_of_one_line(heading):
    section = re.search(rf"^## {heading}\n(.*?)(?=^## |\Z)", README, flags=re.MULTILINE | re.DOTALL)[1]
    commands = re.findall(r"^```\n(.*?)^```", section, flags=re.MULTILINE | re.DOTALL)
    assert len(commands) == 1
    assert len(commands[0].splitlines()) == 1
    assert "-m venv" in commands[0]


def test_it_is_read_in_a_few_minutes():
    assert len(README.splitlines()) <= 90
    assert len(README.split()) <= 700
    (block,) = blocks("python")
    assert len([line for line in block.splitlines() if line.strip()]) <= 12


def test_its_python_block_prints_what_stands_below_it(capsys):
    namespace = {}
    (block,), (shown,) = blocks("python"), blocks("text")
    exec(compile(block, "README.md", "exec"), namespace)
    assert capsys.readouterr().out == shown
    (low, high), run = (namespace["rec"].u.min(), namespace["rec"].u.max()), namespace["run"]
    assert namespace["stage"].amplifier.limits == (low, high)
    assert low <= run.u.min() <= run.u.max() <= high
    assert run.conditions["limited_samples"] == 0
    # the loop is late by one sample, in which the triangle moves by 7.5 nm; most of the rest are the sensor's 76 nm
    late = run.y[401:] - namespace["wanted"][400:-1]
    assert abs(late).max() < 0.06


def test_its_shell_commands_run(tmp_path, monkeypatch, shell):
    monkeypatch.chdir(tmp_path)
    commands = [line.split() for text in blocks("shell") for line in text.splitlines()]
    assert [(program, shell(*words)[0]) for program, *words in commands] == 3 * [("hysim", 0)]
    assert {path.name for path in tmp_path.iterdir()} >= {"loop.csv", "law.json", "fit.svg", "inverse.c"}


def test_every_link_leads_to_a_file():
    links = re.findall(r"\]\(([^)]+)\)", README)
    assert len(links) > 12
    assert [link for link in links if not (ROOT / link).exists()] == []
