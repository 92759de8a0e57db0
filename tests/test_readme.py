"""The README is short, its commands have the agreed form, its Python block runs, and its links lead somewhere."""

import re
from pathlib import Path

import pytest

from hysim.cli import main

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("heading", ["Run", "Test"])
def test_a_heading_has_one_command_of_one_line(heading):
    section = re.search(rf"^## {heading}\n(.*?)(?=^## )", README, flags=re.MULTILINE | re.DOTALL)[1]
    commands = re.findall(r"^```\n(.*?)^```", section, flags=re.MULTILINE | re.DOTALL)
    assert len(commands) == 1
    assert len(commands[0].splitlines()) == 1
    assert "-m venv" in commands[0]


def test_it_is_read_in_a_few_minutes():
    assert len(README.splitlines()) <= 130
    (block,) = blocks("python")
    assert len([line for line in block.splitlines() if line.strip()]) <= 15


def test_its_python_block_fits_draws_and_compensates_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert "`hysim example loop.csv`" in README
    assert main(["example", "loop.csv"]) == 0
    namespace = {}
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), namespace)
    assert (tmp_path / "law.json").exists()
    printed = capsys.readouterr().out
    assert "loop width" in printed
    assert f"# {printed.splitlines()[-1]}, " in README
    low, high = namespace["rec"].u.min(), namespace["rec"].u.max()
    assert low <= namespace["voltage"].min() <= namespace["voltage"].max() <= high
    assert namespace["stage"].amplifier.limits == (low, high)
    assert namespace["run"].conditions["limited_samples"] == 0
    # the loop is late by one sample, in which the triangle moves by 7.5 nm; most of the rest are the sensor's 76 nm
    late = namespace["run"].y[401:] - namespace["wanted"][400:-1]
    assert abs(late).max() < 0.06


def test_every_link_leads_to_a_file():
    links = re.findall(r"\]\(([^)]+)\)", README)
    assert len(links) > 20
    assert [link for link in links if not (ROOT / link).exists()] == []
