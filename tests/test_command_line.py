"""`hysim reproduce` writes whole files, the same bytes each time, and fails in one line."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hysim.cli import main

MODELS = ["eq1-printed", "tf-identified", "bouc-wen", "bouc-wen-asymmetric", "sindy", "line", "single-valued"]


@pytest.fixture(scope="module")
def reproduction(tmp_path_factory) -> tuple[Path, str, str]:
    """One full run in a process of its own: folder, stdout, stderr."""
    folder = tmp_path_factory.mktemp("reproduction") / "out"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "hysim", "reproduce", "--out", str(folder)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return folder, done.stdout, done.stderr


@pytest.fixture(scope="module")
def summary(reproduction) -> dict:
    return json.loads((reproduction[0] / "summary.json").read_text())


def test_every_promised_file_is_there(reproduction):
    folder = reproduction[0]
    assert {path.name for path in folder.iterdir()} == {"report.html", "summary.json", "figures", "tables"}
    assert {"figure3.svg", "figure4.svg", "figure5.svg", "loops.svg", "widths.svg", "residuals.svg"} <= {
        path.name for path in (folder / "figures").iterdir()
    }
    assert {path.name for path in (folder / "tables").iterdir()} == {
        "models.csv", "outputs.csv", "widths.csv", "parameters.csv",
    }  # fmt: skip


def test_stdout_holds_the_table_and_stderr_the_progress(reproduction):
    _, out, err = reproduction
    assert "0.232 um wide at 35 V" in out
    assert all(name in out for name in MODELS)
    assert err.count("\n") == len(MODELS) + 1


def test_summary_of_the_measured_loop(summary):
    table = summary["table1"]
    assert table["n"] == 52
    assert table["stroke_um"] == 2.671
    assert table["resolution_um"] == 0.0763
    assert table["max_width_um"] == pytest.approx(0.232, abs=1e-9)
    assert table["max_width_at_V"] == 35
    assert table["mean_width_um"] == pytest.approx(0.1407, abs=5e-5)  # half of the last printed digit
    assert table["area_um_V"] == pytest.approx(17.59, abs=5e-3)
    assert (summary["claims"], summary["control"], summary["dwell"]) == ([], {}, [])


def test_summary_of_the_models(summary):
    models = summary["models"]
    assert list(models) == MODELS
    keys = {
        "n_parameters", "fit_percent", "rmse_um", "cv_rmse_um", "max_residual_px", "max_width_um", "max_width_at_V",
        "area_um_V", "width_rmse_um",
    }  # fmt: skip
    assert all(keys <= set(row) for row in models.values())
    assert all(isinstance(row["cv_rmse_um"], float) for row in models.values())
    assert models["bouc-wen"]["fit_percent"] >= 95.6
    assert models["bouc-wen-asymmetric"]["fit_percent"] >= 96.2
    assert models["bouc-wen-asymmetric"]["n_parameters"] <= 8
    assert models["sindy"]["fit_percent"] >= 96.3
    assert models["tf-identified"]["fit_percent"] >= 91.5
    assert models["tf-identified"]["fpe"] <= 0.0061
    assert models["eq1-printed"]["fit_percent"] <= 90.1
    assert models["single-valued"]["fit_percent"] == pytest.approx(90.27, abs=5e-3)
    assert models["line"]["max_width_um"] == pytest.approx(0.0, abs=1e-12)


def test_the_report_is_self_contained(reproduction):
    page = (reproduction[0] / "report.html").read_text()
    assert "<script" not in page
    assert not re.findall(r"""(?:src|href)=["'](?!#)""", page)  # links inside the page only
    assert "url(http" not in page
    assert page.count("<svg") == 7
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))


def test_the_same_input_gives_the_same_bytes(reproduction, tmp_path):
    assert main(["reproduce", "--out", str(tmp_path / "again")]) == 0
    first = {path.relative_to(reproduction[0]): path.read_bytes() for path in reproduction[0].rglob("*.*")}
    second = {path.relative_to(tmp_path / "again"): path.read_bytes() for path in (tmp_path / "again").rglob("*.*")}
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


@pytest.mark.parametrize("name", ["file/in/the/way", "file"])
def test_a_folder_that_cannot_be_written_is_one_line_and_exit_2(tmp_path, capsys, name):
    (tmp_path / "file").write_text("")
    assert main(["reproduce", "--out", str(tmp_path / name)]) == 2
    err = capsys.readouterr().err
    assert err.startswith("hysim: error: ")
    assert err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]


def test_an_unknown_command_exits_with_2():
    with pytest.raises(SystemExit) as exit_:
        main(["reproduec"])
    assert exit_.value.code == 2


def test_version(capsys):
    with pytest.raises(SystemExit):
        main(["--version"])
    assert re.fullmatch(r"hysim \d+\.\d+\.\d+\n", capsys.readouterr().out)


def test_an_interruption_exits_with_130(tmp_path, monkeypatch, capsys):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("hysim.paper.reproduction.study", interrupted)
    assert main(["reproduce", "--out", str(tmp_path / "out")]) == 130
    assert not list((tmp_path / "out").iterdir())


def test_a_read_only_folder_is_refused_before_anything_is_computed(tmp_path, monkeypatch, capsys):
    def refused(*_, **__):
        raise PermissionError(13, "Permission denied", str(tmp_path))

    monkeypatch.setattr("hysim.paper.reproduction.tempfile.TemporaryFile", refused)
    monkeypatch.setattr("hysim.paper.reproduction.study", lambda **_: pytest.fail("computed all the same"))
    assert main(["reproduce", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"hysim: error: {tmp_path}: Permission denied\n"
    assert not list(tmp_path.iterdir())
