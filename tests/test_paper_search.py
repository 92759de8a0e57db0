"""The search for controllers: its bounds hold, its costs are the library's measures, its sentences follow the rows."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hysim as hs
from hysim.paper.camera import _width, needed, vibration_cameras
from hysim.paper.equations import EQUATION_1, EQUATION_4
from hysim.paper.loops import law_plant
from hysim.paper.preference import nested_errors, of_discovered
from hysim.paper.search import (
    Gains,
    Robustness,
    _Tried,
    confirmed,
    optimum,
    search,
    slopes_along,
    step_task,
    stored_starts,
    triangle_task,
    volts_per_pixel,
)

KNOWN = hs.PID(
    kp=-327.968, ki=-851.54, kd=-22.132, derivative_filter=0.0336, setpoint_weight=0.2455, derivative_weight=0.8569,
    limits=(-16.0, 16.0),
)  # fmt: skip
NAME = "eq4, step within 16 V"


@pytest.fixture(scope="module")
def step():
    task = step_task(EQUATION_4, step=-1.0, limits=(-16.0, 16.0), duration=200.0, sample_time=0.025)
    return replace(task, name=NAME)


def test_the_cost_of_a_step_is_the_least_of_the_three_reductions(step):
    """The record is half as long here: 0.01 % of a figure for what still moves in it."""
    run = hs.close_loop(EQUATION_4, KNOWN, 0.025 * np.arange(step.reference.size), step.reference)
    assert 100.0 - step.cost(run.y) == pytest.approx(98.22, abs=0.01)


def test_the_cost_of_a_triangle_is_the_relative_width():
    task = triangle_task(EQUATION_1, low=0.0, high=2.5, period=52.0, limits=None, sample_time=0.01, cycles=3)
    pid = hs.PID(kp=10.0, ki=20.0, kd=5.0, derivative_filter=0.1)
    run = hs.close_loop(EQUATION_1, pid, 0.01 * np.arange(task.reference.size), task.reference)
    last = slice(-5201, None)
    expected = hs.loop_metrics(task.reference[last], run.y[last]).relative_width
    assert task.cost(run.y) == pytest.approx(expected, rel=1e-6)  # and the gap of the last cycle
    assert _width(np.tile(run.y[-5201:-1], 6)[:26001], 5200) == pytest.approx(expected, rel=1e-4)


def test_a_known_controller_is_a_point_of_the_box(step):
    tried = _Tried(step, 2.0, exact=True)
    again = tried.controller(tried.point(KNOWN))
    for name in ("kp", "ki", "kd", "derivative_filter", "setpoint_weight", "derivative_weight"):
        assert vars(again)[name] == pytest.approx(vars(KNOWN)[name], rel=1e-12)


def test_a_search_is_no_worse_than_where_it_starts(step):
    found = search(step, generations=0, polish=20, starts=[KNOWN])
    run = hs.close_loop(EQUATION_4, found.controller, 0.025 * np.arange(step.reference.size), step.reference)
    assert step.cost(run.y) <= 100.0 - 98.21
    assert found.max_sensitivity <= 2.0
    assert found.with_delay <= 2.5
    assert search(step, generations=0, polish=20, starts=[KNOWN]) == found


def test_an_unstable_loop_is_not_simulated(step):
    tried = _Tried(step, 2.0, exact=True)
    assert tried.cost(tried.point(replace(KNOWN, kp=-5000.0, ki=-50000.0))) >= 1e3
    assert tried.simulations == 0


def test_a_search_without_generations_needs_a_start(step):
    with pytest.raises(ValueError, match="controllers to start from"):
        search(step, generations=0)


def test_a_stored_optimum_is_proved_by_its_own_loop(step):
    found = optimum(step, stored_starts(), generations=0)  # a full search like this would fail
    run = hs.close_loop(EQUATION_4, found.controller, 0.025 * np.arange(step.reference.size), step.reference)
    assert step.cost(run.y) == found.cost
    assert found.max_sensitivity <= 2.0
    assert found.with_delay <= 2.5
    assert found.searched == f"the stored optimum of a full search, and beside it {found.controllers} PIDs"


@pytest.mark.parametrize("wrong", ["a weaker controller", "another cost", "an unstable loop", "another task"])
def test_a_start_that_is_no_optimum_ends_in_the_full_search(step, wrong):
    start = stored_starts()[NAME]
    shift = {"a weaker controller": -0.1, "an unstable loop": 2.0}.get(wrong, 0.0)  # of log10 |kp G(0)|
    tried, point = _Tried(step, 2.0, exact=True), start["point"] + shift * np.eye(6)[0]
    tried.is_polished = True
    cost = tried.cost(point) * (1.02 if wrong == "another cost" else 1.0)  # else the one that it has
    assert (cost < 1e3) == (wrong != "an unstable loop")
    starts = {"" if wrong == "another task" else NAME: {"point": point.tolist(), "cost": cost}}
    assert confirmed(step, starts) is None
    effort = {"generations": 1, "population": 1, "polish": 4}
    assert optimum(step, starts, **effort) == search(step, **effort)
    assert search(step, **effort).searched.startswith("a full search of")


@pytest.mark.parametrize(("name", "value"), [("MAX_SENSITIVITY", 3.0), ("BOX", ((-3.0, 4.0),)), ("WITH_DELAY", 2.0)])
def test_starts_of_another_search_are_not_used(monkeypatch, name, value):
    monkeypatch.setattr(f"hysim.paper.search.{name}", value)
    assert stored_starts() == {}


def test_one_camera_without_an_optimum_has_all_searched_anew(monkeypatch):
    monkeypatch.setattr("hysim.paper.camera.FRAME_RATES", (10.0,))
    monkeypatch.setattr("hysim.paper.camera.SENSORS", ((0.0, 0.0), (0.1, 0.0)))
    starts = dict(stored_starts())
    stored = vibration_cameras(starts)
    assert all(each.found.is_stored for each in stored)
    name = stored[1].found.name
    starts[name] = {**starts[name], "cost": 1.02 * starts[name]["cost"]}
    anew = vibration_cameras(starts)
    assert not any(each.found.is_stored for each in anew)
    assert anew[0].found.controller == stored[0].found.controller


def test_the_bounds_hold_at_the_laws_own_slopes():
    """Along the cycle that the loop really makes: 0.1 to 2.5 um, both branches."""
    law = hs.BoucWen(gain=0.01, feedthrough=0.02, beta=0.05, gamma=0.05)
    task = triangle_task(law_plant(law), low=0.1, high=2.5, period=52.0, limits=None, sample_time=0.1, cycles=1)
    u = hs.signals.triangle(0.0, 100.0, cycles=3, samples_per_cycle=4000)
    y = law.response(u)[-4001:]
    scale = 2.4 / np.ptp(y)
    y = law.response(u * scale)[-4001:]
    local = np.diff(y) / np.diff(u[-4001:] * scale)
    assert task.slopes == pytest.approx((local.min(), local.max()), rel=0.05)
    assert slopes_along(law_plant(law), task.reference[-521:]) == task.slopes


def test_one_sample_more_of_delay_costs_sensitivity():
    first, second = Robustness(EQUATION_4, 0.025).of(KNOWN)
    assert first == pytest.approx(1.383, abs=5e-4)
    assert second == pytest.approx(1.964, abs=5e-4)


def test_volts_per_pixel():
    assert volts_per_pixel(hs.PID(kp=-2.0, kd=1.0, derivative_filter=0.3), 0.2) == pytest.approx(0.0763 * 4.0)


def test_the_sentence_follows_the_rows(reproduction):
    rows = reproduction.findings.cameras
    assert "needs readings in steps of 0.0076 µm (0.1 pixel)" in needed("bouc-wen+eq7", rows)
    fast = [replace(each, true_reduction_percent=99.0) if each.frame_rate == 10.0 else each for each in rows]
    assert "(1 pixel), 10 times a second, of an image that shakes by 0.31 pixel" in needed("bouc-wen+eq7", fast)
    none = [replace(each, true_reduction_percent=float("nan")) for each in rows]
    assert needed("eq4", none).endswith(
        "more than any sensor tried; the paper's own pixels and shake let no loop settle."
    )


def test_many_controllers_at_once_are_judged_as_one_by_one(step):
    """The same bits of the loops; the sensitivities on a grid, which at 1.4 shows them within 0.1 %."""
    pids = [KNOWN, replace(KNOWN, kp=-50.0, ki=-20.0), replace(KNOWN, kp=-5000.0, ki=-50000.0)]
    tried = _Tried(step, 2.0, exact=True)
    displacements, lost = tried.resting[0].attempt_each(pids, step.reference)
    for pid, y, sample in zip(pids, displacements, lost, strict=True):
        alone = tried.resting[0].attempt(pid, step.reference)
        assert (sample, y.tobytes()) == (alone.lost, alone.y.tobytes())
    robustness = tried.robustness
    stable = [all(loop.is_stable(pid) for loop in robustness.loops) for pid in pids]
    assert robustness.are_stable(pids).tolist() == stable == [True, True, False]
    gains = Gains(**{
        name: np.array([[vars(pid)[name]] for pid in pids[:2]]) for name in ("kp", "ki", "kd", "derivative_filter")
    })  # fmt: skip
    expected = [max(first / 2.0, second / 2.5) for first, second in map(robustness.of, pids[:2])]
    assert robustness.over_bound(gains, 2.0, fine=True) == pytest.approx(expected, rel=1e-3)


# ----------------------------------------------------------------------------- the stored errors of repeated searches


RESULT = Path(__file__).parent.parent / "experiments" / "results" / "nested_table1" / "result.json"


def test_the_stored_errors_are_those_of_the_experiment():
    rows = json.loads(RESULT.read_text(encoding="utf-8"))["rows"]
    stored = nested_errors()
    assert [(each.model, each.start) for each in stored] == [(row["model"], row["start"]) for row in rows]
    for each, row in zip(stored, rows, strict=True):
        assert (each.left_out_rmse, each.behind) == (row["left_out_rmse_um"], row["behind_in_stderr"])
        for name in ("n_parameters", "folds", "same_structure", "terms_kept"):
            assert each._asdict()[name] == row[name]


def test_rows_stand_in_the_order_of_their_errors_and_the_best_that_was_searched_again_is_behind_none():
    stored = nested_errors()
    assert [each.left_out_rmse for each in stored] == sorted(each.left_out_rmse for each in stored)
    assert next(each for each in stored if not each.terms_kept).behind == 0.0
    assert all(each.behind >= 0.0 for each in stored if not each.terms_kept)
    assert all(each.folds == 50 for each in stored)


def test_the_report_quotes_the_nested_error_of_the_law_that_it_shows(reproduction, paper_study):
    page = (reproduction.folder / "report.html").read_text(encoding="utf-8")
    nested = of_discovered()
    assert f"errs by {nested.left_out_rmse:.4f} µm at the point left out" in page
    assert f"has the terms above in {nested.same_structure} of 50 searches" in page
    assert "predicts best" not in page
    assert nested.n_parameters == paper_study.discovery.n_parameters
    assert nested.fit_percent == pytest.approx(paper_study.discovery.scores["fit_percent"], abs=1e-4)  # one law
    models = json.loads((reproduction.folder / "summary.json").read_text(encoding="utf-8"))["models"]
    assert models["sindy"]["cv_rmse_um"] == pytest.approx(nested.left_out_rmse, rel=1e-8)  # nine digits are written
