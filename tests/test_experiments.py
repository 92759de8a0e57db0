"""Every experiment runs in its smoke mode, and the committed results are those that the README quotes."""

import importlib.util
import json
from pathlib import Path

import pytest

EXPERIMENTS = sorted((Path(__file__).parent.parent / "experiments").glob("[0-9]*.py"))
NEEDS = dict.fromkeys(("29_registration", "30_virtual_rig"), pytest.mark.extra("skimage"))
README = " ".join((EXPERIMENTS[0].parent.parent / "README.md").read_text().split())


@pytest.mark.parametrize(
    "path", [pytest.param(path, id=path.stem, marks=NEEDS.get(path.stem, ())) for path in EXPERIMENTS]
)
def test_smoke(path, monkeypatch, tmp_path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "RESULTS", tmp_path)
    rows = module.main(smoke=True)
    assert rows
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("path", EXPERIMENTS, ids=lambda path: path.stem)
def test_results_are_committed_whole(path):
    folder = path.parent / "results" / path.stem.split("_", 1)[1]
    assert {file.name for file in folder.iterdir()} == {"table.csv", "figure.svg", "result.json"}
    json.loads((folder / "result.json").read_text())


def test_the_readme_quotes_the_lag_that_a_pid_can_take_away():
    folder = EXPERIMENTS[0].parent
    rows = json.loads((folder / "results" / "lag_of_equation_1" / "result.json").read_text())["rows"]
    percent = {row["bound"]: f"{row['lag_reduction_percent']:.0f} %" for row in rows}
    readme = " ".join((folder.parent / "README.md").read_text().split())
    assert f"the maximum sensitivity, 2, takes {percent[2.0]} of it away" in readme
    assert f"(maximum sensitivity 10: {percent[10.0]}, 20: {percent[20.0]})" in readme


def test_the_readme_quotes_the_exact_step():
    folder = EXPERIMENTS[0].parent
    rows = json.loads((folder / "results" / "exact_step" / "result.json").read_text())["rows"]
    readme = (folder.parent / "README.md").read_text().replace("\n ", "")
    own = [row["error"] for row in rows if row["method"] == "hysim"]
    lsoda = [row for row in rows if "LSODA" in row["method"]]
    least, most = (f"{round(pick(row['time_ratio'] for row in lsoda), -2):,.0f}" for pick in (min, max))
    assert len(own) == len(lsoda) == 3
    assert max(own) < 1e-15
    assert all(0.5e-4 < row["error"] < 2e-4 for row in lsoda)
    assert f"{least} to {most} times as long".replace(",", " ") in readme


def test_the_readme_quotes_the_batch_and_the_first_call():
    folder = EXPERIMENTS[0].parent
    batch, start = (
        json.loads((folder / "results" / name / "result.json").read_text())["rows"] for name in ("batch", "cold_start")
    )
    speed = {row["n"]: row["million_samples_per_second"] for row in batch if row["kind"] == "rows"}
    readme = " ".join((folder.parent / "README.md").read_text().split())
    assert f"run at {speed['1']:.0f} million samples a second for n = 1, {speed['64 values']:.0f} million" in readme
    assert f"{speed['all differ']:.1f} million where all differ" in readme
    assert f"compiles for up to {max(row['empty'] for row in start):.0f} s" in readme
    assert f"it takes at most {max(row['full'] for row in start):.1f} s" in readme


def test_the_readme_quotes_the_work_and_the_precision():
    folder = EXPERIMENTS[0].parent
    rows = json.loads((folder / "results" / "work_precision" / "result.json").read_text())["ratios"]
    readme = " ".join((folder.parent / "README.md").read_text().split())

    def ratio(*words):
        (found,) = [row["median"] for row in rows if all(word in row["what"] for word in words)]
        return found

    assert f"the law is {round(ratio('n = 1:', 'LSODA, compiled, rtol'), -1):.0f} times as fast" in readme
    assert f"and {ratio('n = 1:', 'OpenSees'):.0f} times as fast as OpenSees" in readme
    assert f"`odeint` takes {ratio('oscillator', 'odeint'):.0f} times as long" in readme
    assert f"and diffrax {ratio('oscillator', 'diffrax'):.0f} times" in readme


def test_transfer_functions_come_as_near_as_the_noise_allows():
    folder = EXPERIMENTS[0].parent
    clean, *noisy = json.loads((folder / "results" / "transfer_functions" / "result.json").read_text())["rows"]
    assert clean["median_fit"] > clean["asked_fit"]
    for row in noisy:
        assert abs(row["median_fit"] - row["bound_median_fit"]) < 0.25 * (100.0 - row["bound_median_fit"])
        # four sampling errors of a standard deviation from 200 draws
        assert 0.8 < row["lowest_spread_over_stderr"] <= row["highest_spread_over_stderr"] < 1.2


def test_the_readme_quotes_the_identifications():
    folder = EXPERIMENTS[0].parent
    results = {
        name: json.loads((folder / "results" / name / "result.json").read_text())
        for name in ("benchmark_bouc_wen", "transfer_functions", "table1_models", "recovery")
    }
    readme = " ".join((folder.parent / "README.md").read_text().split())
    known = results["benchmark_bouc_wen"]["summary"][0]
    assert f"the test error is at most {known['multisine']:.1e} m on the multisine and {known['sweep']:.1e} m" in readme
    assert f"in {known['parameters_reached']:.0f} of 5 seeds" in readme
    _, ten, one = results["transfer_functions"]["rows"]
    assert f"is {ten['median_fit']:.2f} % at SNR 10 and {one['median_fit']:.2f} % at SNR 1" in readme
    assert f"allows {ten['bound_median_fit']:.2f} % and {one['bound_median_fit']:.2f} %" in readme
    best = results["table1_models"]["rows"][0]
    assert f"fits {best['fit_percent']:.2f} % with {best['parameters']} parameters" in readme
    assert f"leave-one-out rmse of {1e3 * best['loo_rmse']:.0f} nm" in readme
    profile = [
        row["coverage_percent"]
        for row in results["recovery"]["rows"]
        if (row["kind"], row["records"]) == ("profile", 400) and row["noise_in_quanta"] > 0.0
    ]
    assert f"hold the truth in {min(profile):.0f} to {max(profile):.0f} % of 400 records" in readme


def test_the_readme_quotes_the_discoveries():
    folder = EXPERIMENTS[0].parent
    results = {
        name: json.loads((folder / "results" / name / "result.json").read_text())
        for name in ("sindy_recovery", "sindy_table1", "nested_table1", "sindy_benchmark", "sindy_lag_trap")
    }
    readme = " ".join((folder.parent / "README.md").read_text().split())
    own, plain = (
        {row["condition"]: row for row in results["sindy_recovery"]["rows"] if row["method"] == method}
        for method in ("hysim", "PySINDy")
    )
    noisy = [own[f"noise {percent}%"] for percent in (0, 1, 5, 10)]
    exact, worst = ([row[name] for row in noisy] for name in ("exact", "worst_error_percent"))
    assert f"exact in {exact[0]}, {exact[1]}, {exact[2]} and {exact[3]} of them at 0, 1, 5 and 10 % noise" in readme
    assert f"than {worst[0]:.2g}, {worst[1]:.2g}, {worst[2]:.2g} and {worst[3]:.2g} % off" in readme
    assert f"the true velocity reaches {plain['noise 10%']['exact']} at 10 %" in readme
    hidden = "y = 40 u + 60 z"
    assert f"it is exact in {own['amplitude / 20']['exact']}, with the memory hidden" in readme
    assert f"in {own[hidden]['exact']} (PySINDy: {plain[hidden]['exact']})" in readme
    assert f"to a period in {own['100 Hz']['exact']}:" in readme
    short = [(own[name], plain[name]) for name in own if ", noise" in name]
    noisy = [pair for pair in short if not pair[0]["condition"].endswith("noise 0%")]
    assert (len(short), len(noisy)) == (12, 9)
    assert all(law["exact"] == 20 for law, _ in short if law["condition"].endswith("noise 0%"))
    assert all(law["exact"] >= peer["exact"] for law, peer in short)
    counts = [sum(pair[k]["exact"] for pair in noisy) for k in (0, 1)]
    assert f"the structure is exact in {counts[0]} of {20 * len(noisy)} (PySINDy: {counts[1]})" in readme
    missed = sum(20 - law["exact"] for law, _ in noisy)
    unlikely = sum(20 - law["as_likely"] for law, _ in noisy)
    assert f"in {unlikely} of the {missed} others the truth's BIC is more than 2 above" in readme
    law = results["sindy_table1"]["rows"][0]
    equal = "parameters, with y held at 0 at the first point"
    assert f"A law of {law['n_parameters']} terms and as many {equal}, fits {law['fit_percent']:.2f} %" in readme
    shares = [results["sindy_table1"]["found_again"][term] for term in results["sindy_table1"]["terms"]]
    *often, seldom = sorted(shares, reverse=True)
    words = (
        f"give back {len(often)} of its terms in at least {100 * min(often):.0f} % of the draws, and the last one in"
    )
    assert f"{words} {100 * seldom:.0f} %" in readme
    nested = {(row["model"], row["start"]): row for row in results["nested_table1"]["rows"]}
    found, asymmetric = nested["discovered", "auto"], nested["Bouc-Wen, quadratic input, n = 1", "free"]
    errors = [1e3 * row["left_out_rmse_um"] for row in (found, asymmetric, nested["Bouc-Wen", "free"])]
    again = f"has the same terms in {found['same_structure']} of {found['folds']} searches"
    assert f"The discovered law {again} and is off by {errors[0]:.0f} nm" in readme
    assert f"the asymmetric Bouc-Wen law by {errors[1]:.0f} nm and Bouc and Wen's by {errors[2]:.0f} nm" in readme
    near = [row for row in nested.values() if not row["terms_kept"] and row["behind_in_stderr"] < 1.0]
    assert f"{len(near)} rows" in readme
    assert {row["model"].split(",")[0] for row in near} == {"discovered", "Bouc-Wen", "Zhu-Wang"}
    rows = results["sindy_benchmark"]["rows"]
    told = [row for row in rows if row["case"] == "benchmark"]
    regressed = [row["worst_percent"] for row in rows if row["case"] == "plain PySINDy, m, c, k given"]
    assert all(row["right_terms"] for row in told)
    assert f"each coefficient within {max(row['worst_percent'] for row in told):.2g} %" in readme
    assert f"at most {max(max(row['multisine'], row['sweep']) for row in told):.1e} m; sparse" in readme
    assert f"is {min(regressed):.1f} to {max(regressed):.1f} % off" in readme
    verdicts = {(row["plant"], row["frequencies_hz"]): row["verdict"] for row in results["sindy_lag_trap"]["rows"]}
    assert verdicts["published lag", "1"] == "cannot be told from one rate"
    assert verdicts["published lag", "1 10"] == "linear lag"


def test_the_readme_quotes_the_compensation():
    folder = EXPERIMENTS[0].parent
    result = json.loads((folder / "results" / "compensation_matrix" / "result.json").read_text())
    readme = " ".join((folder.parent / "README.md").read_text().split())
    rows = {row["controller"]: row for row in result["rows"]}
    widths = {name: row["hysteresis_reduction_percent"] for name, row in rows.items()}
    assert f"A PID takes {widths['PID']:.1f} % of the hysteresis away" in readme
    assert f"creep {widths['inverse + creep inverse']:.1f} %, with mode inverse" in readme
    follow, damped = rows["model-following"], rows["model-following, damped"]
    assert f"model-following {follow['hysteresis_reduction_percent']:.1f} %; after a step" in readme
    assert f"{follow['residual_rms_reduction_percent']:.1f} % of the residual vibration goes" in readme
    assert f"{follow['worst_residual_rms_reduction_percent']:.0f} % where the mode is 10 % off" in readme
    assert f"and {damped['worst_residual_rms_reduction_percent']:.0f} % with a damping loop" in readme
    held, with_n, normalised = (draws["median"] for draws in result["parameters_within_5_percent"])
    assert f"keeps {held:.1f} % in the median; with n drawn too {with_n:.1f} %, or {normalised:.1f} %" in readme


def test_a_closed_loop_is_300_times_as_fast_as_in_python_control():
    folder = EXPERIMENTS[0].parent
    rows = json.loads((folder / "results" / "closed_loop_speed" / "result.json").read_text())["rows"]
    _, *peers = [row for row in rows if row["kind"] == "loop"]
    for row in peers:
        assert row["times_hysim_q1"] > 300.0
        assert row["largest_difference_um"] < 1e-11


def result_of(name):
    return json.loads((EXPERIMENTS[0].parent / "results" / name / "result.json").read_text())


def rows_of(name):
    return result_of(name)["rows"]


def the(rows, **wanted):
    """The one row with these values."""
    (row,) = [row for row in rows if all(row[key] == value for key, value in wanted.items())]
    return row


def test_the_readme_quotes_how_far_controllers_can_be_trusted():
    best = the(rows_of("robustness"), controller="robust, EI", exponent="held")
    assert best["draws"] >= 1000
    assert min(best["hysteresis_reduction_percent_p5"], best["residual_rms_reduction_percent_known_ahead_p5"]) >= 95.0
    told = (
        f"keeps {best['hysteresis_reduction_percent_p5']:.1f} % of hysteresis reduction and, for a step known ahead, "
    )
    told += (
        f"{best['residual_rms_reduction_percent_known_ahead_p5']:.1f} % of residual reduction in the 5th percentile "
    )
    told += f"of {best['draws']} draws, {best['residual_rms_reduction_percent_p5']:.1f} % for one that is not; "
    assert told + f"{best['unstable']} are unstable" in README
    pixels = rows_of("pixel_sensor")
    camera, pid = the(pixels, controller="inverse + creep inverse"), the(pixels, controller="PID")
    assert f"takes {camera['hysteresis_reduction_percent']:.1f} % of the true hysteresis away" in README
    assert f"and the camera shows {camera['measured_hysteresis_reduction_percent']:.1f} %" in README
    assert pid["hysteresis_reduction_percent"] < 0.0
    fast = [row for row in rows_of("rate_sweep") if row["frequency_hz"] == 100.0]
    followed = the(fast, controller="model-following")["hysteresis_reduction_percent"]
    assert f"At 100 Hz model-following still takes {followed:.1f} % away" in README
    assert the(fast, controller="PID")["hysteresis_reduction_percent"] < 0.0


def test_the_readme_quotes_what_a_pid_leaves_and_what_a_step_does():
    rows = [row for row in rows_of("pid_hysteresis") if row["max_sensitivity"] == 2.0]
    slow, faster = (the(rows, plant="law, creep, mode", frequency_hz=hertz) for hertz in (1.0, 10.0))
    assert f"takes {slow['hysteresis_reduction_percent']:.1f} % away at 1 Hz" in README
    assert f"and {faster['hysteresis_reduction_percent']:.1f} % at 10 Hz" in README
    assert min(row["lag_share_percent"] for row in rows) > 95.0
    steps = [row for row in rows_of("vibration") if row["controller"] == "model-following"]
    one, large = (the(steps, step_um=size)["residual_rms_reduction_percent"] for size in (1.0, 1.5))
    assert f"takes {one:.1f} % of the residual away after 1 um, {large:.1f} % after 1.5 um" in README


def test_the_readme_quotes_the_speed_of_a_loop():
    rows = rows_of("closed_loop_speed")
    peer = the(rows, name="python-control alone")
    slowest = 0.2 * max(row["microseconds_per_sample"] for row in rows if row["kind"] == "controller")
    assert f"takes {peer['times_hysim']:.0f} times as long" in README
    assert f"10 s at 20 kHz with the slowest controller take {slowest:.1f} s here" in README


def test_the_readme_quotes_the_comparison_of_all_families():
    result = json.loads((EXPERIMENTS[0].parent / "results" / "all_families" / "result.json").read_text())
    best = the(result["rows"], model=result["winner"])
    assert f"{result['winner']} predicts left-out points best, to {1e3 * best['loo_rmse']:.1f} nm" in README
    assert f"{len(result['undecided'])} others cannot be told from it" in README


def test_the_readme_quotes_the_classical_families():
    read = the(rows_of("preisach"), curves=12)
    assert f"12 curves leave {read['read_error_percent']:.2f} % where the table is read" in README
    assert f"{read['fitted_error_percent']:.2f} % where it is fitted" in README
    worn = [row for row in rows_of("wear_and_pinching") if row["law"] == "worn and pinched"]
    coarse, fine = (the(worn, steps=steps)["backward_euler_percent"] for steps in (40, 1000))
    assert f"is {coarse:.1f} % wrong at 40 steps a cycle and {fine:.2f} % at 1000" in README
    rows = rows_of("dashpot")
    whole, alone = (
        max(row["error_percent"] for row in rows if row["model"] == model)
        for model in ("law, dashpot and spring", "the law alone")
    )
    assert f"the sum is at most {whole:.2f} % off, the law alone {alone:.0f} %" in README


def test_the_readme_quotes_the_studies():
    rows = rows_of("sweep_study")
    for measure in ("width", "area"):
        strongest = max(
            (row for row in rows if row["measure"] == measure), key=lambda row: abs(row["rank_correlation"])
        )
        assert strongest["parameter"] == "beta"
    killed = json.loads((EXPERIMENTS[0].parent / "results" / "kill_and_resume" / "result.json").read_text())
    assert all(row["in_time"] for row in killed["rows"])
    told = f"a study of {killed['n_tasks']} tasks is killed at {len(killed['rows'])} random moments and resumed. "
    assert told + f"{killed['columns_that_differ']} columns of its table differ" in README


def test_the_readme_quotes_the_scaling():
    rows = [row for row in rows_of("scaling") if row["workers"] == 2]
    kernels = the(rows, kind="10 ms in a kernel", executor="threads")["efficiency_percent"]
    fits = the(rows, kind="fit", executor="processes")["efficiency_percent"]
    assert min(kernels, fits) >= 90.0
    assert (
        f"Two threads are {kernels:.0f} % efficient on tasks of 10 ms in kernels, two processes {fits:.0f} %" in README
    )
    short = the(rows, kind="microsecond", executor="threads", tasks=100_000)["overhead_microseconds"]
    one, other = (the(rows, kind=f"laws on Table 1, n = {n}")["seconds"] for n in ("1", "1.5"))
    assert max(one, other) < 3.0
    assert (
        f"costs {short:.0f} us, a million laws on the paper's points {one:.1f} s with n = 1 and {other:.1f} s" in README
    )


def test_the_readme_quotes_the_registration():
    result = json.loads((EXPERIMENTS[0].parent / "results" / "registration" / "result.json").read_text())
    own = [row for row in result["rows"] if row["method"] == "hysim"]
    fine, coarse = (max(row["rms_px"] for row in own if row["snr_db"] == snr) for snr in (30, 20))
    bias = max(row["largest_bias_px"] for row in own if row["snr_db"] >= 20)
    assert fine <= 0.02
    assert coarse <= 0.05
    assert bias <= 0.01
    assert f"at most {fine:.2g} pixels rms at 30 dB and {coarse:.2g} at 20 dB, no bias above 0.008" in README
    assert 0.007 < bias < 0.008
    speed = result["speed_and_memory"]
    assert f"at {min(row['frames_per_second'] for row in speed):.0f} frames a second of one core" in README
    assert max(row["peak_mib"] for row in speed) < 1.02 * min(row["peak_mib"] for row in speed)


def test_parts_of_a_pixel_tell_the_loop_and_whole_ones_scatter_as_table_1():
    result = json.loads((EXPERIMENTS[0].parent / "results" / "virtual_rig" / "result.json").read_text())
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
    off = max(abs(line["width_error_percent"][end]) for line in (fine, dim) for end in ("least", "most"))
    assert f"the loop's width comes back within {off:.2f} %" in README
    assert f"takes {fine['hysteresis_reduction_percent']['median']:.1f} % of the true hysteresis away" in README
    ends = f"{whole['width_lower_um']['median']:.3f} to {whole['width_upper_um']['median']:.3f} um"
    reached = f"from whole pixels {whole['hysteresis_reduction_percent']['median']:.1f} %, with a width of {ends}"
    assert f"{reached} about the true {result['true_width_um']:.3f}" in README


def test_ten_thousand_damaged_inputs_end_in_an_exit_code_and_at_most_one_line():
    result = json.loads((EXPERIMENTS[0].parent / "results" / "fuzz" / "result.json").read_text())
    assert result["inputs"] == 10_000 == sum(result[end] for end in ("exit 0", "exit 1", "exit 2"))
    assert result["broken"] == 0
    assert {row["damaged"] for row in result["rows"]} == {"record", "model", "study", "options"}
    assert sum(row["exit 0"] for row in result["rows"]) > 1000
    assert f"each handed to a command. {result['broken']} of them end in a traceback" in README


def test_the_readme_quotes_the_invariant():
    found = result_of("more_samples")
    families = len({row["family"] for row in found["rows"]})
    said = f"In {found['cases_per_family']:_} random hostile cases of each of {families} families".replace("_", " ")
    assert said in README
    assert f"{found['cases']:_} comparisons, {found['violations']} violate the invariant".replace("_", " ") in README
    left_out = ("escaped", "undecided", "refused", "partly_refused")
    share = max(sum(row[end] for end in left_out) / row["cases"] for row in found["rows"])
    assert f"At worst {100 * share:.1f} % of a family's cases" in README


def test_the_readme_quotes_the_adversarial_records():
    seen, held_back = (result_of("adversarial_records")["sets"][name] for name in ("seen", "held back"))
    assert f"Of {seen['records']} that were looked at while its limits were chosen {seen['right']} are right" in README
    assert f"of {held_back['records']} that were held back {held_back['right']}: no curve" in README
    for counts in (seen, held_back):
        assert counts["called hysteresis"] == counts["hysteresis lost"] == counts["cannot tell at two rates"] == 0
    seconds = max(counts["median_cpu_seconds"] for counts in (seen, held_back))
    slowest = max(counts["largest_cpu_seconds"] for counts in (seen, held_back))
    assert f"The median record takes {seconds:.1f} s of CPU time, the slowest {slowest:.1f} s" in README
