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
    table = (ROOT / "hysim" / "data" / "table1.csv").read_text()
    header = "voltage [V],displacement [um]"
    rows = [",".join(line.split(",")[-2:]) for line in table.splitlines() if re.match(r"^\d", line)]
    (tmp_path / "loop.csv").write_text("\n".join([header, *rows]))
    monkeypatch.chdir(tmp_path)
    namespace = {}
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), namespace)
    assert (tmp_path / "law.json").exists()
    assert "loop width" in capsys.readouterr().out
    # of one sample the triangle moves by 7.5 nm, which the loop is late; noise of 1 nm and 4 % of the stroke are more
    late = namespace["run"].y[401:] - namespace["wanted"][400:-1]
    assert abs(late).max() < 0.06


def test_every_link_leads_to_a_file():
    links = re.findall(r"\]\(([^)]+)\)", README)
    assert len(links) > 20
    assert [link for link in links if not (ROOT / link).exists()] == []
