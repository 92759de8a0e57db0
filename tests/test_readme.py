"""The README's commands have the agreed form, and its Python blocks run."""

import re
from pathlib import Path

import pytest

README = (Path(__file__).parent.parent / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("heading", ["Run", "Test"])
def test_a_heading_has_one_command_of_one_line(heading):
    section = re.search(rf"^## {heading}\n(.*?)(?=^## )", README, flags=re.MULTILINE | re.DOTALL)[1]
    commands = re.findall(r"^```\n(.*?)^```", section, flags=re.MULTILINE | re.DOTALL)
    assert len(commands) == 1
    assert len(commands[0].splitlines()) == 1
    assert "-m venv" in commands[0]


def test_python_blocks_run_in_order(tmp_path, monkeypatch, capsys):
    table = (Path(__file__).parent.parent / "hysim" / "data" / "table1.csv").read_text()
    header = "voltage [V],displacement [um]"
    rows = [",".join(line.split(",")[-2:]) for line in table.splitlines() if re.match(r"^\d", line)]
    (tmp_path / "loop.csv").write_text("\n".join([header, *rows]))
    monkeypatch.chdir(tmp_path)
    namespace = {}
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), namespace)
    assert (tmp_path / "law.json").exists()
    assert "counterclockwise" in capsys.readouterr().out
