"""The paper's claims: what each verdict rests on, and that each can change."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

import hysim as hs
from hysim.paper import printed
from hysim.paper.approximations import approximations
from hysim.paper.claims import (
    VERDICTS,
    Claim,
    claims,
    controller_claims,
    experiment_claims,
    headline_claims,
    hysteresis_claims,
    introduction,
    state_space_claims,
    table1_claims,
    vibration_claims,
)
from hysim.paper.claims import _controller as controller
from hysim.paper.claims import _experiment as experiment
from hysim.paper.claims._claim import MATERIAL, compared, cross_checked, decided, unseen
from hysim.paper.claims.rounding import Spread, exactly, half_unit, spread, stands_for
from hysim.paper.reidentification import information, time_units

YES, NO, CONTRADICTION, UNKNOWN = VERDICTS

EXPECTED = {
    "cited-vibration-33": UNKNOWN,
    "last-reference": CONTRADICTION,
    "bat-search-reference": CONTRADICTION,
    "table1-points-loading": YES,
    "table1-points-unloading": YES,
    "table1-voltage-range": YES,
    "table1-same-voltages": YES,
    "table1-extends-with-voltage": YES,
    "table1-full-length": YES,
    "table1-returns-to-rest": YES,
    "table1-resolution": NO,
    "figure4-hysteresis": YES,
    "figure4-nonlinear": YES,
    "figure1-setup": UNKNOWN,
    "figure2-image-processing": UNKNOWN,
    "figure3-time": UNKNOWN,
    "creep": UNKNOWN,
    "eq1-poles-fast": YES,
    "eq1-poles-slow": YES,
    "eq1-fit-printed": NO,
    "eq1-fit-identified": YES,
    "eq1-fpe": NO,
    "eq1-fpe-first-order": YES,
    "eq1-fpe-and-fit": YES,
    "eq1-represents-the-actuator": NO,
    "eq1-has-hysteresis": NO,
    "eq7-similar-to-eq1": NO,
    "amplifier-ratio": YES,
    "amplifier-output": YES,
    "amplifier-gain": CONTRADICTION,
    "amplifier-resistors": CONTRADICTION,
    "amplifier-supply": NO,
    "bandwidth-input": YES,
    "bandwidth-output": NO,
    "program-frequency": CONTRADICTION,
    "table2-frequency": UNKNOWN,
    "square-wave-low-level": UNKNOWN,
    "table2-square-wave": YES,
    "table2-proportional": CONTRADICTION,
    "table2-resolution": NO,
    "figure6-program": UNKNOWN,
    "figure7-video": UNKNOWN,
    "figure8-circuit": UNKNOWN,
    "eq4-per-sample": YES,
    "eq4-per-second": NO,
    "eq4-static-gain": NO,
    "eq4-identifiable": NO,
    "eq6-similar-to-eq4": NO,
    "eq6-static-gain-of-eq4": YES,
    "eq6-vibrates": YES,
    "desired-frequency": UNKNOWN,
    "eq10-controllability-matrix": YES,
    "eq10-controllable": YES,
    "eq12-observability-matrix": YES,
    "eq12-observable": YES,
    "eq13-stiffness": CONTRADICTION,
    "eq13-damping": YES,
    "eq13-gain": YES,
    "eq15-controllability-matrix": YES,
    "eq15-controllable": YES,
    "eq16-observability-matrix": YES,
    "eq16-observable": YES,
    "eq17-three-terms": YES,
    "proportional-rise-time": YES,
    "proportional-error": YES,
    "integral-error": YES,
    "derivative-overshoot": YES,
    "open-loop-does-not-track-eq1": YES,
    "open-loop-does-not-track-eq4": YES,
    "figure12-tracks": UNKNOWN,
    "figure13-tracks": UNKNOWN,
    "figure14-tracks": UNKNOWN,
    "simulation-validates-experiment": UNKNOWN,
}


@pytest.fixture(scope="module")
def found(paper_study):
    return {claim.id: claim for claim in claims(paper_study)}


def test_every_verdict_is_the_one_that_was_checked_by_hand(found):
    assert {name: claim.verdict for name, claim in found.items()} == EXPECTED
    assert set(Counter(EXPECTED.values())) == set(VERDICTS)


def test_claims_are_complete_and_told_apart_by_their_ids(paper_study, found):
    listed = claims(paper_study)
    assert len({claim.id for claim in listed}) == len(listed) >= 30
    for claim in listed:
        assert claim.where
        assert claim.statement
        assert claim.method
        assert claim.verdict in VERDICTS
        assert all(isinstance(value, (float, str, type(None))) for value in (claim.printed, claim.recomputed))
        assert (claim.recomputed is None) == (claim.verdict == UNKNOWN)
        assert claim.note or claim.verdict != UNKNOWN
    assert claims(paper_study) == listed


@pytest.mark.parametrize(
    ("name", "recomputed", "tolerance"),
    [  # tolerances: half a unit of the last digit written here
        ("table1-resolution", 0.0763, 5e-5),
        ("figure4-hysteresis", 0.232, 5e-7),
        ("table1-full-length", 2.671, 5e-7),
        ("eq1-fit-printed", 89.96, 5e-3),
        ("eq1-fit-identified", 91.54, 5e-3),
        ("eq1-fpe", 0.0060, 5e-5),
        ("eq1-fpe-first-order", 0.00586, 5e-6),
        ("eq1-represents-the-actuator", 89.96, 5e-3),
        ("eq1-has-hysteresis", 0.0, 1e-6),
        ("eq7-similar-to-eq1", 61.6, 0.1),
        ("amplifier-ratio", 9.0, 0.0),
        ("amplifier-gain", 10.0, 0.0),
        ("bandwidth-input", 15.915, 5e-4),
        ("bandwidth-output", 1.592, 5e-4),
        ("program-frequency", 0.1, 1e-12),
        ("table2-resolution", 1.0204, 5e-5),
        ("eq4-per-sample", 96.6, 0.05),
        ("eq4-per-second", 22.4, 0.05),
        ("eq4-static-gain", -9.496, 5e-4),
        ("eq4-identifiable", 2.0, 0.0),
        ("eq6-similar-to-eq4", 78.2, 0.1),
        ("eq6-static-gain-of-eq4", -0.2971, 5e-5),
        ("eq6-vibrates", 0.1204, 5e-5),
        ("eq13-stiffness", -0.243, 1e-12),
        ("proportional-error", 100 * 2 / 3, 1e-9),
        ("integral-error", 0.0, 1e-9),
        ("open-loop-does-not-track-eq1", 0.02195, 5e-6),
        ("open-loop-does-not-track-eq4", -0.2967, 5e-5),
    ],
)
def test_what_comes_out(found, name, recomputed, tolerance):
    assert found[name].recomputed == pytest.approx(recomputed, abs=tolerance)


def test_the_printed_poles_are_inside_the_rounding_of_the_coefficients_and_not_at_their_centre(found):
    """-0.4185 would round from -0.41855 to -0.41845; the coefficients as printed give -0.41880."""
    fast = found["eq1-poles-fast"]
    assert fast.printed == "[-0.4185, 2.2833]"
    assert fast.recomputed == "[-0.418805, 2.28306]"
    assert "-0.41921 to -0.41840" in fast.note


# -- rounding ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "half"),
    [("0.07962", 5e-6), ("-2.430", 5e-4), ("9", 0.5), ("91.5", 0.05), ("1e3", 500.0), ("0.00586989", 5e-9)],
)
def test_half_a_unit_of_the_last_digit(text, half):
    assert half_unit(text) == half


@pytest.mark.parametrize("text", ["nine", "", "nan", "inf", "1,5"])
def test_what_is_no_printed_number(text):
    with pytest.raises(ValueError, match="printed number"):
        half_unit(text)


def test_a_spread_is_the_range_over_the_corners():
    area = spread(lambda x: x[0] * x[1], ["2.0", "-3.0"])
    assert (area.value, area.low, area.high) == pytest.approx((-6.0, -2.05 * 3.05, -1.95 * 2.95))


def test_exact_inputs_do_not_spread():
    sure = spread(lambda x: x[0] * x[1], [2.0, 3.0])
    assert (sure.value, sure.low, sure.high) == (6.0, 6.0, 6.0)
    one = spread(lambda x: x[0] * x[1], [2.0, "3"])
    assert (one.low, one.high) == (5.0, 7.0)


def test_many_inputs_add_their_effects():
    texts = ["1.0"] * 20
    total = spread(lambda x: x.sum(), texts)
    # linear: the sum of single effects is exact, to rounding
    assert (total.low, total.high) == pytest.approx((19.0, 21.0))
    few = spread(lambda x: x.sum(), texts[:5])
    assert (few.low, few.high) == pytest.approx((4.75, 5.25))


def test_arrays_spread_elementwise():
    both = spread(lambda x: [[x[0], -x[0]]], ["1.5"])
    assert both.low.tolist() == [[1.45, -1.55]]
    assert both.high.tolist() == [[1.55, -1.45]]


@pytest.mark.parametrize(
    ("found", "agrees"),
    [
        (exactly(1.5), True),
        (exactly(1.549), True),
        (exactly(1.55), True),  # the end belongs to what rounds to 1.5
        (exactly(1.551), False),
        (exactly(1.449), False),
        (Spread(value=2.0, low=1.54, high=2.4), True),
        (Spread(value=2.0, low=1.56, high=2.4), False),
        (exactly(np.nan), False),
    ],
)
def test_agreement_is_having_a_number_in_common(found, agrees):
    assert found.agrees(stands_for("1.5")) is agrees
    assert stands_for("1.5").agrees(found) is agrees


def test_arrays_agree_where_every_element_does():
    printed_pair = stands_for(["1.5", "2"])
    assert exactly([1.52, 2.4]).agrees(printed_pair)
    assert not exactly([1.52, 2.6]).agrees(printed_pair)


# -- verdicts on invented cases ---------------------------------------------------------------------------------


def invented(make, text, inputs):
    """The claim that the first input over the second is `text`."""
    found = spread(lambda x: x[0] / x[1], inputs)
    return make("ratio", "nowhere", "A ratio.", printed=text, computed=found, method="division").verdict


@pytest.mark.parametrize(("make", "otherwise"), [(compared, NO), (cross_checked, CONTRADICTION)])
@pytest.mark.parametrize(
    ("text", "inputs", "agrees"),
    [
        ("0.33", [1.0, 3.0], True),
        ("0.34", [1.0, 3.0], False),
        ("0.34", ["1.0", "3.0"], True),  # the same, explained by the inputs' rounding: 0.311 to 0.356
        ("0.340", ["1.00", "3.00"], False),
        ("0.36", ["1.0", "3.0"], True),  # touches: 0.3559 rounds to 0.36
        ("0.37", ["1.0", "3.0"], False),
    ],
)
def test_a_verdict_on_numbers_follows_the_digits(make, otherwise, text, inputs, agrees):
    assert invented(make, text, inputs) == (YES if agrees else otherwise)


def test_a_verdict_on_a_criterion_follows_it():
    def verdict(holds, **kwargs):
        return decided("id", "where", "what", holds=holds, method="how", **kwargs).verdict

    assert verdict(True) == YES
    assert verdict(False) == NO
    assert verdict(False, otherwise=CONTRADICTION) == CONTRADICTION


def test_what_is_at_hand_cannot_be_called_unchecked():
    claim = unseen("id", "where", "what", needs="the photographs")
    assert claim.verdict == UNKNOWN
    assert "the photographs" in claim.note
    with pytest.raises(ValueError, match="has to be computed"):
        unseen("id", "where", "what", needs="Table 1")
    with pytest.raises(ValueError, match="has to be computed"):
        unseen("id", "where", "what", needs="the photographs", material={*MATERIAL, "the photographs"})


def test_claims_are_values():
    def claim(note=""):
        return Claim(
            id="a", where="b", statement="c", printed=1, recomputed="1", unit="", method="d", verdict=YES, note=note
        )

    assert claim() == claim() != claim("e")
    with pytest.raises(AttributeError):
        claim().verdict = NO


# -- each verdict changes when the paper does -------------------------------------------------------------------


def by_id(listed):
    return {claim.id: claim.verdict for claim in listed}


def experiment_verdicts():
    return by_id(experiment_claims(hs.datasets.table2(), information()))


def vibration_verdicts():
    return by_id(vibration_claims(approximations()[1], {unit.name: unit for unit in time_units()}, information()))


def state_space_verdicts():
    return by_id(state_space_claims())


@pytest.mark.parametrize(
    ("section", "name", "text", "claim", "verdict"),
    [
        (lambda: by_id(introduction()), "LAST_CITED", "30", "last-reference", YES),
        (lambda: by_id(introduction()), "BAT_SEARCH_CITED", "13", "bat-search-reference", YES),
        (experiment_verdicts, "RATIO", "10", "amplifier-ratio", NO),
        (experiment_verdicts, "RATIO", "10", "amplifier-gain", YES),
        (experiment_verdicts, "RATIO", "8", "amplifier-output", CONTRADICTION),
        (experiment_verdicts, "RESISTORS_IN_TEXT", ("R_1", "R_2"), "amplifier-resistors", YES),
        (experiment_verdicts, "BANDWIDTH_KHZ", "1.59", "bandwidth-output", YES),
        (experiment_verdicts, "BANDWIDTH_KHZ", "1.59", "bandwidth-input", NO),
        (experiment_verdicts, "SLEW_RATE_V_PER_US", "0.500", "bandwidth-input", YES),
        (experiment_verdicts, "SLEW_RATE_V_PER_US", "0.5000", "bandwidth-input", YES),
        (experiment_verdicts, "SLEW_RATE_V_PER_US", "0.50000", "bandwidth-input", NO),  # 15.91 is cut off, not rounded
        (experiment_verdicts, "LOW_V", "20", "table2-square-wave", NO),
        (experiment_verdicts, "LAST_DIGIT_UM", "1.0", "table2-resolution", NO),
        (experiment_verdicts, "LAST_DIGIT_UM", "1e1", "table2-resolution", YES),
        (vibration_verdicts, "NUM_6", ("-0.0700",), "eq6-static-gain-of-eq4", NO),
        (vibration_verdicts, "DEN_6", ("1", "1.187", "0.243"), "eq6-vibrates", NO),
        (state_space_verdicts, "A_13", (("-0.1187", "-0.2430"), ("1", "0")), "eq13-stiffness", YES),
        (state_space_verdicts, "A_13", (("-0.1178", "-2.430"), ("1", "0")), "eq13-damping", CONTRADICTION),
        (
            state_space_verdicts, "A_13", (("-0.1178", "-2.430"), ("1", "0")),
            "eq15-controllability-matrix", CONTRADICTION,
        ),
        (state_space_verdicts, "C_14", (("0", "-0.0772"),), "eq13-gain", CONTRADICTION),
        (state_space_verdicts, "C_14", (("0", "-0.0772"),), "eq16-observability-matrix", CONTRADICTION),
        (state_space_verdicts, "C_14", (("0", "-0.0000"),), "eq16-observable", NO),
        (state_space_verdicts, "C_8", (("0", "0.0"),), "eq12-observable", NO),
        (state_space_verdicts, "RANK", "1", "eq10-controllable", NO),
        (state_space_verdicts, "RANK", "1", "eq15-controllable", NO),
        (
            state_space_verdicts, "CONTROLLABILITY_10", (("1", "-1.1577"), ("1", "0")),
            "eq10-controllability-matrix", CONTRADICTION,
        ),
        (
            state_space_verdicts, "OBSERVABILITY_12", (("0", "0.0579"), ("0.0597", "0")),
            "eq12-observability-matrix", CONTRADICTION,
        ),
    ],
)  # fmt: skip
def test_another_print_is_judged_otherwise(monkeypatch, section, name, text, claim, verdict):
    monkeypatch.setattr(printed, name, text)
    assert section()[claim] == verdict


@pytest.mark.parametrize(
    ("name", "text", "changed"),
    [
        ("DEN_1", ("1", "2.211", "7.816", "8.423", "6.93"), {"eq1-poles-fast": CONTRADICTION}),
        ("POLES_1", (("-0.4185", "2.2833"), ("-0.6817", "0.9036")), {"eq1-poles-slow": CONTRADICTION}),
        ("FIT_1", "90.0", {"eq1-fit-printed": YES, "eq1-fit-identified": NO, "eq1-fpe-and-fit": CONTRADICTION}),
        ("FPE_1", "0.00600", {"eq1-fpe": YES, "eq1-fpe-first-order": NO, "eq1-fpe-and-fit": CONTRADICTION}),
    ],
)
def test_another_model_of_table_1_is_judged_otherwise(monkeypatch, paper_study, name, text, changed):
    monkeypatch.setattr(printed, name, text)
    verdicts = by_id(hysteresis_claims(paper_study, approximations()[0]))
    assert {claim: verdicts[claim] for claim in changed} == changed


def test_a_model_with_memory_would_be_one_of_hysteresis(monkeypatch, paper_study):
    from hysim.paper.claims import _hysteresis

    slow = hs.TransferFunction(num=(0.022 / 500.0,), den=(1.0, 1.0 / 500.0))
    monkeypatch.setattr(_hysteresis, "EQUATION_1", slow)
    assert by_id(hysteresis_claims(paper_study, approximations()[0]))["eq1-has-hysteresis"] == YES


def test_a_better_estimate_would_be_similar(monkeypatch, paper_study):
    better = [replace(pair, fit_percent=91.6) for pair in approximations()]
    assert by_id(hysteresis_claims(paper_study, better[0]))["eq7-similar-to-eq1"] == YES
    units = {unit.name: unit for unit in time_units()}
    assert by_id(vibration_claims(better[1], units, information()))["eq6-similar-to-eq4"] == YES


def test_a_richer_table_2_would_identify_more():
    enough = replace(information(), n_determined=4, gain=-0.03)
    exchanged = {unit.name: unit for unit in time_units()}
    exchanged = {"sample": exchanged["second"], "second": exchanged["sample"]}
    verdicts = by_id(vibration_claims(approximations()[1], exchanged, enough))
    assert verdicts["eq4-identifiable"] == YES
    assert verdicts["eq4-static-gain"] == YES
    assert verdicts["eq4-per-sample"] == NO
    assert verdicts["eq4-per-second"] == YES


def test_a_linear_model_that_beats_every_curve_would_represent_the_actuator(paper_study):
    rows = tuple(
        replace(row, fit_percent=90.5) if row.name == "eq1-printed" else row for row in paper_study.comparison.rows
    )
    better = replace(paper_study, comparison=replace(paper_study.comparison, rows=rows))
    assert by_id(hysteresis_claims(better, approximations()[0]))["eq1-represents-the-actuator"] == YES


def altered(**columns):
    record = hs.datasets.table1()
    arrays = {"u": record.u.copy(), "y": record.y.copy()}
    for name, (samples, values) in columns.items():
        arrays[name][samples] = values
    return replace(record, **arrays)


@pytest.mark.parametrize(
    ("record", "changed"),
    [
        (altered(y=(-1, 0.076)), {"table1-returns-to-rest": NO}),
        (altered(y=(26, 2.6)), {"table1-full-length": NO}),
        (altered(y=(10, 0.9)), {"table1-extends-with-voltage": NO}),
        (altered(u=(30, 106.0)), {"table1-same-voltages": NO}),
        (altered(u=([25, 26], 126.0)), {"table1-voltage-range": NO}),
        (hs.datasets.table1()[1:], {"table1-points-loading": NO}),
        (hs.datasets.table1()[:-1], {"table1-points-unloading": NO}),
        (altered(y=(slice(26, 52), hs.datasets.table1().y[25::-1])), {"figure4-hysteresis": NO}),
        (altered(y=(slice(None), 0.02 * hs.datasets.table1().u)), {"figure4-nonlinear": NO}),
    ],
)
def test_another_table_1_is_judged_otherwise(record, changed):
    verdicts = by_id(table1_claims(record, hs.loop_metrics(record.u, record.y)))
    assert {claim: verdicts[claim] for claim in changed} == changed


def test_a_finer_camera_would_give_the_digits(monkeypatch):
    monkeypatch.setattr(printed, "LAST_DIGIT_UM", "0.1")
    record = hs.datasets.table1()
    assert by_id(table1_claims(record, hs.loop_metrics(record.u, record.y)))["table1-resolution"] == YES


def test_proportional_displacements_would_agree():
    record = hs.datasets.table2()
    proportional = replace(record, y=0.1 * record.u)
    assert by_id(experiment_claims(proportional, information()))["table2-proportional"] == YES


def test_a_program_of_table_2_s_period_would_agree(monkeypatch):
    """1.01626 Hz is the reciprocal of 984 ms, to its last digit."""
    monkeypatch.setattr(printed, "ON_MS", "492.000")
    monkeypatch.setattr(printed, "OFF_MS", "492.000")
    assert experiment_verdicts()["program-frequency"] == YES


def test_a_part_for_50_v_would_deliver_them(monkeypatch):
    monkeypatch.setattr(experiment, "UA741_SUPPLY_SPAN", 60.0)
    assert experiment_verdicts()["amplifier-supply"] == YES


@pytest.mark.parametrize(
    ("name", "value", "changed"),
    [
        ("DERIVATIVE_TIME", 0.5, {"derivative-overshoot": NO}),
        ("INTEGRAL_TIME", np.inf, {"integral-error": NO}),
        ("TRACKS_WITHIN", 0.9, {"proportional-error": NO, "open-loop-does-not-track-eq1": YES}),
        ("TRACKS_WITHIN", 1.1, {"open-loop-does-not-track-eq1": NO, "open-loop-does-not-track-eq4": YES}),
        ("TRACKS_WITHIN", 1.5, {"open-loop-does-not-track-eq4": NO}),
    ],
)
def test_other_loops_are_judged_otherwise(monkeypatch, name, value, changed):
    monkeypatch.setattr(controller, name, value)
    verdicts = by_id(controller_claims())
    assert {claim: verdicts[claim] for claim in changed} == changed


def test_a_loop_that_is_slower_than_the_plant_is_said_to_be(monkeypatch):
    faster = replace(controller._open_step(), rise_time=0.1)
    monkeypatch.setattr(controller, "_open_step", lambda: faster)
    assert by_id(controller_claims())["proportional-rise-time"] == NO


def test_a_controller_with_another_integral_is_not_17(monkeypatch):
    from hysim.paper.equations import pid_standard

    monkeypatch.setattr(controller, "pid_standard", lambda Kp, Ti, Td, **rest: pid_standard(Kp, 2.0 * Ti, Td, **rest))
    assert by_id(controller_claims())["eq17-three-terms"] == NO


# -- the headline claims ----------------------------------------------------------------------------------------


def loops(hysteresis=91.0, lag=88.0, **vibration):
    figures = {"overshoot": 97.1, "residual_rms": 97.8, "settling_time": 88.6, **vibration}
    measures = {f"{name}_reduction_percent": value for name, value in figures.items()}
    return {
        "hysteresis": [
            {"plant": "bouc-wen+eq7", "controller": "PID", "hysteresis_reduction_percent": hysteresis},
            {"plant": "eq1", "controller": "PID", "lag_reduction_percent": lag},
        ],
        "vibration": [
            {"plant": plant, "reference": "step", "limits": [0.0, 125.0], **measures} for plant in ("eq4", "eq6")
        ],
    }


def headline(control):
    return {claim.id: claim for claim in headline_claims(control)}


def test_each_definition_of_the_headline_has_its_own_verdict(paper_study):
    found = headline(loops())
    assert claims(paper_study, loops())[-len(found) :] == tuple(found.values())
    assert {name: claim.verdict for name, claim in found.items()} == {
        "hysteresis-90-bouc-wen": YES,
        "hysteresis-90-eq1": NO,
        "vibration-97-overshoot-eq4": YES,
        "vibration-97-residual-rms-eq4": YES,
        "vibration-97-settling-time-eq4": NO,
        "vibration-97-all-three-eq4": NO,
        "vibration-97-overshoot-eq6": YES,
        "vibration-97-residual-rms-eq6": YES,
        "vibration-97-settling-time-eq6": NO,
        "vibration-97-all-three-eq6": NO,
        "vibration-97-as-worded": NO,
    }
    assert found["vibration-97-all-three-eq4"].recomputed == 88.6
    assert "settling time 88.6 %" in found["vibration-97-overshoot-eq4"].note
    assert "limits: 0 to 125" in found["vibration-97-overshoot-eq4"].note


@pytest.mark.parametrize(
    ("control", "name", "verdict"),
    [
        (loops(hysteresis=89.5), "hysteresis-90-bouc-wen", YES),  # rounds to the printed 90
        (loops(hysteresis=89.4), "hysteresis-90-bouc-wen", NO),
        (loops(lag=95.0), "hysteresis-90-eq1", YES),
        (loops(settling_time=97.0), "vibration-97-all-three-eq6", YES),
        (loops(overshoot=96.4), "vibration-97-overshoot-eq4", NO),
        (loops(overshoot=3.2), "vibration-97-as-worded", YES),
    ],
)
def test_headline_verdicts_follow_the_loops(control, name, verdict):
    assert headline(control)[name].verdict == verdict


def test_the_three_figures_come_from_one_loop_within_limits():
    control = loops()
    better = {**control["vibration"][0], "limits": None}
    worse = {**control["vibration"][0], "overshoot_reduction_percent": 99.0, "settling_time_reduction_percent": 50.0}
    unknown = {**control["vibration"][0], "overshoot_reduction_percent": float("nan")}
    better |= {key: 99.0 for key in better if key.endswith("percent")}
    control["vibration"] = [better, worse, unknown, *control["vibration"]]
    found = headline(control)
    assert found["vibration-97-overshoot-eq4"].recomputed == 97.1
    assert found["vibration-97-settling-time-eq4"].recomputed == 88.6


def test_loops_that_are_missing_make_no_claim():
    assert headline_claims({}) == ()
    assert headline_claims({"hysteresis": [{"plant": "eq1", "lag_reduction_percent": None}]}) == ()


def test_a_fragile_loop_does_not_count_but_is_told():
    fragile = {**loops()["hysteresis"][0], "plant": "eq1", "lag_reduction_percent": 95.0}
    control = loops()
    control["hysteresis"] = [*control["hysteresis"], fragile | {"conditions": {"max_sensitivity": 17.6}}]
    claim = headline(control)["hysteresis-90-eq1"]
    assert claim.verdict == NO
    assert "maximum sensitivity of 18 reaches 95.0 %" in claim.note
    control["hysteresis"][-1] = fragile | {"conditions": {"max_sensitivity": 2.0}}
    assert headline(control)["hysteresis-90-eq1"].verdict == YES
