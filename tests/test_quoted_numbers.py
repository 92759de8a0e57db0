"""Every number that is quoted comes from a stored result, and the results hold what is claimed of them."""

import json
import re
from pathlib import Path

import pytest
import table
from strategies import assert_refused

ROOT = Path(__file__).parent.parent
EXPERIMENTS = ROOT / "experiments"

FINDINGS = [finding for group in table.GROUPS.values() for finding in group]


def result_of(name):
    return json.loads((EXPERIMENTS / "results" / name / "result.json").read_text(encoding="utf-8"))


def rows_of(name, **wanted):
    """The rows with these values, at least one."""
    rows = [row for row in result_of(name)["rows"] if all(row[key] == value for key, value in wanted.items())]
    assert rows
    return rows


def the(name, **wanted):
    """The one row with these values."""
    (row,) = rows_of(name, **wanted)
    return row


KEYS = {"n", "snr", "frequency_hz", "max_sensitivity", "noise_in_quanta", "step_um", "rate_hz"}  # name a row


def scaled(value, factor, kinds):
    """The same result with every number of these kinds multiplied, but for those that name a row."""
    if type(value) in kinds:
        return value * factor
    if isinstance(value, dict):
        return {key: each if key in KEYS else scaled(each, factor, kinds) for key, each in value.items()}
    return [scaled(each, factor, kinds) for each in value] if isinstance(value, list) else value


# What is quoted


def test_every_quoted_number_agrees_with_its_result():
    assert table.check() == []


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda finding: finding.__name__)
def test_a_finding_is_a_few_sentences_that_follow_the_numbers(finding):
    result = result_of(finding.__name__)
    sentences = finding(result)
    paragraphs = [each for each in sentences if not each.startswith("\n|")]
    assert 1 <= len(paragraphs) <= 3  # and tables
    number = r"(?<!\w)\d+(?: \d{3})*(?:\.\d+)?(?:e-?\d+)?"
    said = re.split(r"(?<=[.?])\s", " ".join(paragraphs))
    assert [each for each in said if len(re.findall(number, each)) > 3] == []
    kinds = {int} if finding.__name__ == "fuzz" else {float}  # it counts
    if finding.__name__ in (
        "exact_step",
        "batch",
        "transfer_functions",
        "magnetic_loops",
        "first_contact",
    ):  # twice their numbers are no longer true
        assert_refused("no longer supports", finding, scaled(result, 2, kinds))
    else:
        assert finding(scaled(result, 2, kinds)) != sentences


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("sindy_table1", lambda result: result["rows"][0].update(bic=0.0)),
        ("table1_models", lambda result: result["rows"][-1].update(bic=-1e3)),
        ("transfer_functions", lambda result: result["rows"][1].update(median_fit=90.0)),
        ("sindy_lag_trap", lambda result: result["rows"][0].update(verdict="linear lag")),
        ("pixel_sensor", lambda result: result["rows"][0].update(stable=True)),
        ("pixel_sensor", lambda result: result["rows"][3].update(hysteresis_reduction_percent=99.0)),
        ("shards", lambda result: result["rows"][0].update(kills=0)),
        ("lag_of_equation_1", lambda result: result["rows"][1].update(lag_reduction_percent=95.0)),
    ],
)
def test_a_claim_that_its_result_no_longer_supports_is_refused(name, change):
    result = result_of(name)
    (finding,) = (each for each in FINDINGS if each.__name__ == name)
    change(result)
    assert_refused("no longer supports", finding, result)


def test_a_difference_is_named_with_its_experiment():
    computed = table.page()
    written = computed.replace("in 173 of 180", "in 180 of 180")
    lines = list(table.differences("experiments/README.md", written, computed))
    assert len(lines) == 2
    assert all(line.startswith("experiments/README.md, 10_sindy_recovery: ") for line in lines)
    assert "180 of 180" in lines[0]
    assert "173 of 180" in lines[1]


def test_every_link_of_the_page_leads_to_a_file():
    links = re.findall(r"\]\(([^)]+)\)", table.PAGE.read_text(encoding="utf-8"))
    assert len(links) == 4 * len(FINDINGS)  # twice the script, figure and table
    assert [link for link in links if not (EXPERIMENTS / link).exists()] == []


def test_a_changed_page_is_an_exit_code(monkeypatch, tmp_path, capsys):
    assert table.main(["--check"]) == 0
    assert table.main(["--help-me"]) == 2
    monkeypatch.setattr(table, "page", lambda: "another\n")
    capsys.readouterr()
    assert table.main(["--check"]) == 1
    assert "computed: another" in capsys.readouterr().out


def test_the_readme_measures_nothing_outside_of_what_is_generated():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    before, _, rest = text.partition(table.BEGIN)
    text = before + rest.partition(table.END)[2]
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"\]\([^)]*\)|`[^`]*`", "", text)
    assert set(re.findall(r"\d+(?:\.\d+)?", text)) <= {"52", "2016"}  # points of the table and the year of its paper


# What the results hold


def test_the_exact_step_is_at_rounding_and_lsoda_at_its_tolerance():
    own = rows_of("exact_step", method="hysim")
    lsoda = rows_of("exact_step", method="solve_ivp LSODA, 1e-6")
    assert len(own) == len(lsoda) == 3
    assert max(row["error"] for row in own) < 1e-15
    assert all(0.5e-4 < row["error"] < 2e-4 for row in lsoda)


def test_transfer_functions_come_as_near_as_the_noise_allows():
    clean, *noisy = rows_of("transfer_functions")
    assert clean["median_fit"] > clean["asked_fit"]
    for row in noisy:
        assert abs(row["median_fit"] - row["bound_median_fit"]) < 0.25 * (100.0 - row["bound_median_fit"])
        # four sampling errors of a standard deviation from 200 draws
        assert 0.8 < row["lowest_spread_over_stderr"] <= row["highest_spread_over_stderr"] < 1.2


def test_profile_intervals_hold_the_truth_as_often_as_they_say():
    cells = rows_of("recovery", kind="profile", records=400)
    noisy = [row["coverage_percent"] for row in cells if row["noise_in_quanta"] > 0.0]
    # three standard errors of a share of 95 % in 400
    assert 95.0 - 3.3 < min(noisy) <= max(noisy) < 95.0 + 3.3


def test_discover_finds_short_laws_at_least_as_often_as_pysindy():
    own, plain = (
        {row["condition"]: row for row in rows_of("sindy_recovery", method=method)} for method in ("hysim", "PySINDy")
    )
    short = [(own[name], plain[name]) for name in own if ", noise" in name]
    noisy = [pair for pair in short if not pair[0]["condition"].endswith("noise 0%")]
    assert (len(short), len(noisy)) == (12, 9)
    assert all(law["exact"] == 20 for law, _ in short if law["condition"].endswith("noise 0%"))
    assert all(law["exact"] >= peer["exact"] for law, peer in short)


def test_three_kinds_of_law_are_as_good_on_points_left_out():
    near = [row for row in rows_of("nested_table1", terms_kept=False) if row["behind_in_stderr"] < 1.0]
    assert {row["model"].split(",")[0] for row in near} == {"discovered", "Bouc-Wen", "Zhu-Wang"}


def test_the_benchmark_has_the_right_terms_told_and_not_told():
    for case in ("benchmark", "benchmark, recipe not told"):
        assert all(row["right_terms"] for row in rows_of("sindy_benchmark", case=case))


def test_a_lag_is_told_from_hysteresis_by_two_rates_only():
    lags = {row["frequencies_hz"]: row["verdict"] for row in rows_of("sindy_lag_trap", plant="published lag")}
    assert lags == {"1": "cannot be told from one rate", "1 10": "linear lag"}


def test_no_verdict_of_an_adversarial_record_is_wrong():
    for counts in result_of("adversarial_records")["sets"].values():
        assert counts["called hysteresis"] == counts["hysteresis lost"] == counts["cannot tell at two rates"] == 0
        assert counts["right"] == counts["records"] == 100


def test_a_closed_loop_is_300_times_as_fast_as_from_blocks_of_python_control():
    joined = [row for row in rows_of("closed_loop_speed", kind="loop") if row["name"].startswith("python-control")]
    blocks = [row for row in joined if "one compiled block" not in row["name"]]
    assert len(blocks) == 2
    for row in blocks:
        assert row["times_hysim_q1"] > 300.0
    assert all(row["largest_difference_um"] < 1e-11 for row in rows_of("closed_loop_speed", kind="loop"))


def test_the_robust_controller_keeps_95_percent_in_the_fifth_percentile():
    best = the("robustness", controller="robust, EI", exponent="held")
    assert best["draws"] >= 1000
    assert min(best["hysteresis_reduction_percent_p5"], best["residual_rms_reduction_percent_known_ahead_p5"]) >= 95.0


def test_a_fast_pid_is_in_a_limit_cycle_on_pixels_and_makes_the_loop_wider_at_100_hz():
    on_pixels = the("pixel_sensor", controller="PID")
    assert not on_pixels["stable"]
    assert on_pixels["hysteresis_reduction_percent"] is None
    assert the("rate_sweep", frequency_hz=100.0, controller="PID")["hysteresis_reduction_percent"] < 0.0


def test_what_a_pid_leaves_is_lag():
    assert min(row["lag_share_percent"] for row in rows_of("pid_hysteresis", max_sensitivity=2.0)) > 95.0


def test_a_study_in_shards_that_were_killed_is_the_same():
    assert result_of("shards")["columns_that_differ"] == 0
    assert sum(row["tasks"] for row in rows_of("shards")) == result_of("shards")["n_tasks"]


def test_two_workers_share_kernels_on_threads_and_fits_on_processes():
    shared = {"workers": 2}
    kernels = the("scaling", kind="10 ms in a kernel", executor="threads", **shared)
    fits = the("scaling", kind="fit", executor="processes", **shared)
    assert min(kernels["efficiency_percent"], fits["efficiency_percent"]) >= 90.0
    assert max(the("scaling", kind=f"laws on Table 1, n = {n}")["seconds"] for n in ("1", "1.5")) < 3.0


def test_registration_is_within_hundredths_of_a_pixel_in_constant_memory():
    own = rows_of("registration", method="hysim")
    fine, coarse = (max(row["rms_px"] for row in own if row["snr_db"] == snr) for snr in (30, 20))
    assert fine <= 0.02
    assert coarse <= 0.05
    assert max(row["largest_bias_px"] for row in own if row["snr_db"] >= 20) <= 0.01
    speed = result_of("registration")["speed_and_memory"]
    assert max(row["peak_mib"] for row in speed) < 1.02 * min(row["peak_mib"] for row in speed)


def test_parts_of_a_pixel_show_the_loop_and_whole_ones_scatter_as_table_1():
    result = result_of("virtual_rig")
    fine, dim, whole, shaken, paper = result["summary"]
    for line in (fine, dim):
        assert max(abs(line["width_error_percent"][end]) for end in ("least", "most")) < 1.0
        assert line["width_covers"] >= 17  # of 20 intervals at 95 %: fewer in 1.6 % of such counts
    assert whole["width_covers"] == shaken["width_covers"] == 20
    for key in ("fit_percent", "residual_rms_pixels", "fpe", "linear_fit_percent", "linear_fpe", "width_um"):
        assert shaken[key]["least"] <= paper[key]["median"] <= shaken[key]["most"], key
    # an inverse is as good as the law it comes from
    assert whole["hysteresis_reduction_percent"]["median"] + 5.0 < result["true_law_reduction_percent"]
    assert abs(fine["hysteresis_reduction_percent"]["least"] - result["true_law_reduction_percent"]) < 0.1


def test_ten_thousand_damaged_inputs_end_in_an_exit_code_and_at_most_one_line():
    result = result_of("fuzz")
    assert result["inputs"] == 10_000 == sum(result[end] for end in ("exit 0", "exit 1", "exit 2"))
    assert result["broken"] == 0
    assert {row["damaged"] for row in result["rows"]} == {"record", "model", "study", "options"}
    assert sum(row["exit 0"] for row in result["rows"]) > 1000


def test_more_samples_on_a_branch_change_nothing():
    result = result_of("more_samples")
    assert result["violations"] == 0
    assert max(row["worst"] for row in result["rows"]) <= 1.0


def test_a_default_call_finds_the_best_law_of_each_measured_core():
    sets = result_of("magnetic_loops")["sets"]
    assert len(sets) == 6
    assert max(each["default_over_evolution_exactly"] for each in sets.values()) <= 1.001
    assert max(each["default_over_refined"] for each in sets.values()) <= 1.01


def test_other_programs_have_the_same_loops():
    assert max(result_of("jiles_atherton")["spellings"]["errors"].values()) < 1e-6


def test_a_step_has_the_same_numbers_everywhere():
    result = result_of("one_law_everywhere")
    assert result["run"] == ["gcc", "clang", "wasm", "FMI 2.0", "FMI 3.0"]
    assert all(row[f"worst_{name}"] <= 1e-12 for row in result["rows"] for name in result["run"])
    assert all(row[f"compared_{name}"] >= 80 for row in result["rows"] for name in ("gcc", "clang", "wasm"))
    assert all(row[f"compared_FMI {version}"] >= 3 for row in result["rows"] for version in ("2.0", "3.0"))
    assert result["general_inverse_ns_most"] <= 1000.0
