"""`hysim reproduce` writes whole files, the same bytes each time, and fails in one line."""

import contextlib
import json
import re

import pytest

from hysim._basics.parallel import _AtOnce
from hysim.cli import main
from hysim.paper.search import stored_starts

MODELS = ["eq1-printed", "tf-identified", "bouc-wen", "bouc-wen-asymmetric", "sindy", "line", "single-valued"]
FIGURES = [
    "figure3", "figure4", "figure5", "figure9", "figure10", "figure12", "figure13", "figure14",
    "loops", "widths", "residuals", "discovery", "hysteresis", "dwell", "camera", "periods", "opening", "evidence",
]  # fmt: skip


@pytest.fixture(scope="module")
def summary(reproduction) -> dict:
    return json.loads((reproduction.folder / "summary.json").read_text())


def test_every_promised_file_is_there(reproduction):
    folder = reproduction.folder
    assert {path.name for path in folder.iterdir()} == {"report.html", "summary.json", "figures", "tables"}
    assert {path.name for path in (folder / "figures").iterdir()} == {f"{name}.svg" for name in FIGURES}
    assert {path.name for path in (folder / "tables").iterdir()} == {
        "models.csv", "outputs.csv", "widths.csv", "parameters.csv", "claims.csv", "control.csv", "camera.csv",
        "periods.csv", "dwell.csv", "evidence.csv",
    }  # fmt: skip


def test_stdout_holds_the_table_and_stderr_the_progress(reproduction, again):
    _, out, err = again
    assert "largest width  0.232 um at u = 35 V" in out
    assert all(name in out for name in MODELS)
    assert re.search(r"\d+ claims: \d+ agrees, ", out)
    assert re.search(r"hysteresis-90-bouc-wen: 9\d\.\d % where the paper says 90 %, reached", out)
    assert all(re.match(r"reproduce: ([\w -]+: )?(\d of 9|compiling, once)", line) for line in err.splitlines())


def test_summary_of_the_measured_loop(summary):
    table = summary["table1"]
    assert table["n"] == 52
    assert table["stroke_um"] == 2.671
    assert table["resolution_um"] == 0.0763
    assert table["max_width_um"] == pytest.approx(0.232, abs=1e-9)
    assert table["max_width_at_V"] == 35
    assert table["mean_width_um"] == pytest.approx(0.1407, abs=5e-5)  # half of the last printed digit
    assert table["area_um_V"] == pytest.approx(17.59, abs=5e-3)


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


def test_summary_of_the_claims(summary):
    claims = summary["claims"]
    keys = {"id", "where", "printed", "recomputed", "unit", "verdict", "conditions", "note"}
    assert len(claims) >= 25
    assert len({claim["id"] for claim in claims}) == len(claims)
    assert all(keys <= claim.keys() for claim in claims)
    assert {claim["verdict"] for claim in claims} == {
        "reached", "not found", "agrees", "differs", "inconsistent in print", "not checkable",
    }  # fmt: skip
    assert all(claim["conditions"] for claim in claims)
    verdicts = {claim["id"]: claim["verdict"] for claim in claims}
    assert [name for name, verdict in verdicts.items() if verdict == "not found"] == ["hysteresis-90-eq1"]
    assert verdicts["hysteresis-90-bouc-wen"] == "reached"
    assert all(verdict == "reached" for name, verdict in verdicts.items() if name.startswith("vibration-97"))


def test_the_search_finds_the_known_controllers_or_better(summary):
    """Found elsewhere: 98.49, 99.95, 98.22 % within 16 V, 97.28, 99.21, 96.84 % within 0 to 125 V, lag 33.9 %."""
    steps = [row for row in summary["control"]["vibration"] if row["reference"] == "step -1 um"]
    measures = ("overshoot_reduction_percent", "residual_rms_reduction_percent", "settling_time_reduction_percent")
    least = {(row["plant"], str(row["limits"])): min(row[name] for name in measures) for row in steps}
    assert least["eq4", "[-16.0, 16.0]"] >= 98.22
    assert least["eq4", "[0.0, 125.0]"] >= 96.835  # 96.84 to its digits; no search has found 96.86
    assert least["eq6", "[-16.0, 16.0]"] >= 97.5
    assert (
        next(row["lag_reduction_percent"] for row in summary["control"]["hysteresis"] if row["plant"] == "eq1") >= 33.9
    )


def test_summary_of_control(summary):
    hysteresis, vibration = summary["control"]["hysteresis"], summary["control"]["vibration"]
    head = {"plant", "reference", "controller", "conditions"}
    assert all(head <= row.keys() for row in (*hysteresis, *vibration))
    limited = [row for row in hysteresis if row["plant"] == "bouc-wen+eq7" and row["limits"] != "unlimited"]
    assert all(row["hysteresis_reduction_percent"] >= 90.0 for row in limited)
    assert all(row["lag_reduction_percent"] is None for row in limited)
    assert all(row["hysteresis_reduction_percent"] is None for row in hysteresis if row["plant"] == "eq1")
    for plant in ("eq4", "eq6"):
        steps = [row for row in vibration if row["plant"] == plant and row["reference"].startswith("step")]
        assert {str(row["limits"]) for row in steps} == {"[0.0, 125.0]", "[-16.0, 16.0]", "unlimited"}
        assert len({row["controller"] for row in steps}) == 2  # a PID for each pair of limits
        within = [row for row in steps if row["limits"] != "unlimited"]  # under which the search ran
        assert all(row["overshoot_reduction_percent"] >= 95.0 for row in within)
        assert all(row["residual_rms_reduction_percent"] >= 97.0 for row in steps)
        assert all(row["settling_time_reduction_percent"] >= 85.0 for row in steps)
        assert all(low <= row["conditions"]["lowest_u_V"] and row["conditions"]["highest_u_V"] <= high
                   for row in steps if row["limits"] != "unlimited" for low, high in [row["limits"]])  # fmt: skip
        waves = [row for row in vibration if row["plant"] == plant and row["reference"].startswith("square")]
        assert len(waves) == 3
        # the search weighs overshoot, residual and settling time of a step from rest alike; a wave begins elsewhere
        assert all(row["peak_excess_percent"] < 7.0 for row in waves)
        slow = max(waves, key=lambda row: row["period"])
        assert slow["peak_excess_percent"] < 0.1 * slow["peak_excess_open_percent"]
    for row in (*hysteresis, *vibration):
        assert 1.0 <= row["max_sensitivity"] <= 2.002
        assert row["max_sensitivity_with_delay"] <= 2.502  # to which it is known
        assert 0.0 <= row["saturated_percent"] <= 100.0
        assert row["volts_per_pixel"] > 0.0
        assert row["tracking_rms_um"] > 0.0


def test_summary_of_the_camera(summary):
    rows = summary["control"]["camera"]
    keys = {
        "frame_rate_hz", "delay_frames", "quantum_um", "shake_px", "true_reduction_percent",
        "measured_reduction_percent", "tracking_rms_um", "saturated_percent", "max_sensitivity",
    }  # fmt: skip
    assert all(keys <= row.keys() for row in rows)
    assert {row["frame_rate_hz"] for row in rows} == {10.0, 30.0, 100.0, 1000.0}
    assert {row["delay_frames"] for row in rows} == {1}
    learned = [row for row in rows if row["trials"]]
    rows = [row for row in rows if not row["trials"]]
    assert all(1.0 <= row["max_sensitivity"] <= 2.002 for row in rows)  # to which it is known
    of_law = [row for row in rows if row["plant"] == "bouc-wen+eq7"]
    best = {(row["quantum_um"], row["shake_px"]): row["true_reduction_percent"] for row in of_law}  # of 1000 Hz
    assert max(best, key=best.__getitem__) == (0.0, 0.0)
    own = [row for row in of_law if row["quantum_um"] == 0.0763 and row["shake_px"] == 0.31]
    assert all(row["true_reduction_percent"] < 80.0 for row in own)
    assert any(row["true_reduction_percent"] >= 89.5 for row in of_law if 0.0 < row["quantum_um"] < 0.0763)
    assert {(row["quantum_um"], row["shake_px"], row["max_sensitivity"]) for row in learned} == {(0.0763, 0.31, None)}
    reduced = {(row["plant"], row["frame_rate_hz"]): row["true_reduction_percent"] for row in learned}
    assert all(reduced[row["plant"], row["frame_rate_hz"]] > row["true_reduction_percent"] for row in own[:3])
    assert reduced["bouc-wen+eq7", 100.0] > 89.5
    assert reduced["eq4", 100.0] > 95.0


def test_summary_of_the_dwell(summary):
    rows = summary["dwell"]
    assert [row["dwell_s"] for row in rows] == [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0]
    widths = [row["bouc_wen_max_width_um"] for row in rows]
    assert max(widths) - min(widths) <= 1e-12 * summary["table1"]["stroke_um"]
    assert all(row["eq1_max_width_um"] < 0.01 for row in rows if row["dwell_s"] >= 10.0)
    # at the start of the hold the loop tends to two steps of 5 V times the static gain
    assert rows[-1]["eq1_at_start_max_width_um"] == pytest.approx(10.0 * 0.1521 / 6.93, abs=1e-4)


def test_the_report_is_self_contained(reproduction):
    page = (reproduction.folder / "report.html").read_text()
    assert "<script" not in page
    assert not re.findall(r"""(?:src|href)=["'](?!#)""", page)  # links inside the page only
    assert "url(http" not in page
    assert page.count("<svg") == len(FIGURES)
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))


def test_another_process_writes_the_same_bytes(reproduction, again):
    folders = (reproduction.folder, again[0])
    first, second = ({path.relative_to(top): path.read_bytes() for path in top.rglob("*.*")} for top in folders)
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


def test_full_searches_come_to_the_same_verdicts(reproduction, summary, tmp_path, monkeypatch, capsys):
    """What does not depend on the searches is taken as it was computed; for a camera any controller will do here."""
    of = reproduction.findings
    computed = {
        "findings.study": lambda **_: of.study,
        "findings.bouc_wen": lambda name, _: of.study.fits[name],
        "findings.reidentify": lambda _: of.reidentification,
        "findings.learned_triangles": lambda _: of.learned[:3],
        "findings.forked": lambda _: contextlib.nullcontext(_AtOnce()),
        **dict.fromkeys(("camera._FIRST", "camera._NEXT", "camera._FAST"), (1, 1, 0)),
        **dict.fromkeys(("camera._AGAIN", "camera._FEW", "camera.NOISES"), 1),
    }
    for name, known in computed.items():
        monkeypatch.setattr(f"hysim.paper.{name}", known)
    monkeypatch.setattr("hysim.paper.reproduction._as_svg", lambda drawings: dict.fromkeys(drawings, "<svg></svg>"))
    assert main(["reproduce", "--thorough", "--quick", "--json", "--out", str(tmp_path)]) == 0
    thorough = json.loads(capsys.readouterr().out)
    verdicts, stored = ([(each["id"], each["verdict"]) for each in of["claims"]] for of in (thorough, summary))
    assert verdicts == stored
    loops, stored = ([row for rows in of["control"].values() for row in rows] for of in (thorough, summary))
    assert {row.get("searched", "a full")[:6] for row in loops} == {"a full"}
    assert {row.get("searched", "the stored")[:10] for row in stored} == {"the stored"}
    optima = json.loads((tmp_path / "optima.json").read_text())["optima"]
    assert optima.keys() == stored_starts().keys()
    for name, start in stored_starts().items():
        # on the machine that stored them they are equal; the rounding of another one leads the searches elsewhere
        assert "camera" in name or optima[name]["cost"] == pytest.approx(start["cost"], rel=0.02)


@pytest.mark.parametrize("name", ["file/in/the/way", "file"])
def test_a_folder_that_cannot_be_written_is_one_line_and_exit_2(tmp_path, capsys, name):
    (tmp_path / "file").write_text("")
    assert main(["reproduce", "--out", str(tmp_path / name)]) == 2
    err = capsys.readouterr().err
    assert err.startswith("hysim: error: ")
    assert err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]


def test_an_unknown_command_exits_with_2():
    assert main(["reproduec"]) == 2


def test_version(capsys):
    assert main(["--version"]) == 0
    assert re.fullmatch(r"hysim \d+\.\d+\.\d+\n", capsys.readouterr().out)


def test_an_interruption_exits_with_130(tmp_path, monkeypatch, capsys):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("hysim.paper.reproduction.find", interrupted)
    assert main(["reproduce", "--out", str(tmp_path / "out")]) == 130
    assert not list((tmp_path / "out").iterdir())


def test_a_read_only_folder_is_refused_before_anything_is_computed(tmp_path, monkeypatch, capsys):
    def refused(*_, **__):
        raise PermissionError(13, "Permission denied", str(tmp_path))

    monkeypatch.setattr("hysim.paper.reproduction.tempfile.TemporaryFile", refused)
    monkeypatch.setattr("hysim.paper.reproduction.find", lambda **_: pytest.fail("computed all the same"))
    assert main(["reproduce", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"hysim: error: {tmp_path}: Permission denied\n"
    assert not list(tmp_path.iterdir())
