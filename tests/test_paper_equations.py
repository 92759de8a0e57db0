"""The paper's equations as objects, against python-control and against each other."""

import ast
from pathlib import Path

import numpy as np
import pytest
from strategies import assert_refused

import hysim.paper
from hysim.control import to_control
from hysim.paper import printed
from hysim.paper.equations import (
    EQUATION_1,
    EQUATION_4,
    EQUATION_6,
    EQUATION_7,
    EQUATIONS_7_8,
    EQUATIONS_13_14,
    UA741_SUPPLY_SPAN,
    approximations,
    array,
    characteristics,
    companion,
    full_power_bandwidth,
    in_time_unit,
    matched_second_order,
    pid_standard,
    resistor_ratio,
    second_order,
    settling_window,
    step_fit,
    step_response,
    unit_step,
    voltage_gain,
)
from hysim.paper.reidentification import quantum
from hysim.plants.transfer_function import TransferFunction

MODELS = {"(1)": EQUATION_1, "(4)": EQUATION_4, "(6)": EQUATION_6, "(7)": EQUATION_7}


def coefficients(model):
    return [*model.num, *model.den]


@pytest.mark.parametrize("path", sorted(Path(hysim.paper.__file__).parent.rglob("*.py")), ids=lambda path: path.stem)
def test_python_control_is_imported_where_it_is_used(path):
    """Its import takes a second: none at the top of a module."""
    at_top = [node for node in ast.parse(path.read_text()).body if isinstance(node, (ast.Import, ast.ImportFrom))]
    names = {name.name for node in at_top for name in node.names} | {getattr(node, "module", None) for node in at_top}
    assert not any(str(name).split(".")[0] == "control" for name in names)


@pytest.mark.parametrize("name", MODELS)
def test_a_step_by_python_control_is_the_exact_one(name):
    time, response = step_response(MODELS[name], duration=20.0)
    # python-control takes matrix exponentials too: both are exact to rounding, over 800 steps
    np.testing.assert_allclose(response, unit_step(MODELS[name], time), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "frequency", "damping", "dc_gain", "overshoot"),
    [
        ("(1)", 2.3212, 0.1804, 0.02195, 30.2),
        ("(4)", 0.4665, 0.1240, -0.2967, 68.9),
        ("(6)", 0.4930, 0.1204, -0.2971, 68.3),
        ("(7)", 1.6260, 0.3560, 0.02190, 30.2),
    ],
)
def test_what_the_printed_models_are_like(name, frequency, damping, dc_gain, overshoot):
    found = characteristics(MODELS[name])
    # half a unit of the last digit written here
    assert found.natural_frequencies[0] == pytest.approx(frequency, abs=5e-5)
    assert found.damping_ratios[0] == pytest.approx(damping, abs=5e-5)
    assert found.dc_gain == pytest.approx(dc_gain, abs=5e-5)
    assert found.overshoot_percent == pytest.approx(overshoot, abs=0.05)


def test_poles_and_zeros_are_those_of_the_polynomials():
    found = characteristics(EQUATION_1)
    assert sorted(found.poles, key=lambda p: (p.real, p.imag)) == pytest.approx(
        [-0.68170 - 0.90639j, -0.68170 + 0.90639j, -0.41880 - 2.28306j, -0.41880 + 2.28306j], abs=6e-6
    )
    assert characteristics(EQUATION_4).zeros == pytest.approx([-2.325], abs=5e-4)
    assert characteristics(EQUATION_6).zeros == ()


def test_the_general_second_order_form_has_what_it_is_given():
    found = characteristics(second_order(3.0, natural_frequency=2.0, damping_ratio=0.25))
    assert found.natural_frequencies == pytest.approx((2.0, 2.0))
    assert found.damping_ratios == pytest.approx((0.25, 0.25))
    assert found.dc_gain == pytest.approx(3.0 / 4.0)
    assert found.overshoot_percent == pytest.approx(100 * np.exp(-np.pi * 0.25 / np.sqrt(1 - 0.25**2)), abs=1e-3)


def test_a_response_without_overshoot_says_so():
    creeping = characteristics(second_order(1.0, natural_frequency=1.0, damping_ratio=2.0))
    assert creeping.overshoot_percent == 0.0
    assert_refused("overshoot", matched_second_order, creeping)


def test_a_change_of_the_unit_of_time_keeps_the_plant():
    slow = in_time_unit(EQUATION_4, 5.0)
    time = np.linspace(0.0, 50.0, 101)
    np.testing.assert_allclose(unit_step(slow, time), unit_step(EQUATION_4, time * 5.0), atol=1e-12)
    assert settling_window(slow) == pytest.approx(settling_window(EQUATION_4) / 5.0)


@pytest.mark.parametrize(("name", "form"), [("(7)", EQUATIONS_7_8), ("(6)", companion(EQUATION_6))])
def test_companion_forms_realise_their_transfer_functions(name, form):
    assert coefficients(form.transfer_function) == pytest.approx(coefficients(MODELS[name]), rel=1e-9)


def test_the_companion_form_of_7_is_the_printed_one():
    form = companion(EQUATION_7)
    for name in "ABC":
        assert np.array_equal(getattr(form, name), getattr(EQUATIONS_7_8, name))


def test_13_is_not_a_realisation_of_6():
    """2.430 for 0.243: the natural frequency and the gain are others."""
    found = characteristics(EQUATIONS_13_14.transfer_function)
    assert found.natural_frequencies[0] == pytest.approx(1.559, abs=5e-4)
    assert found.dc_gain == pytest.approx(-0.0297, abs=5e-5)
    needed = companion(EQUATION_6)
    assert np.argwhere(EQUATIONS_13_14.A != needed.A).tolist() == [[0, 1]]


@pytest.mark.parametrize(
    ("form", "controllability", "observability"),
    [
        (EQUATIONS_7_8, printed.CONTROLLABILITY_10, printed.OBSERVABILITY_12),
        (EQUATIONS_13_14, printed.CONTROLLABILITY_15, printed.OBSERVABILITY_16),
    ],
)
def test_controllability_and_observability_by_their_definitions(form, controllability, observability):
    assert np.array_equal(form.controllability, np.hstack([form.B, form.A @ form.B]))
    assert np.array_equal(form.observability, np.vstack([form.C, form.C @ form.A]))
    assert np.array_equal(form.controllability, array(controllability))
    assert np.array_equal(form.observability, array(observability))
    assert np.linalg.matrix_rank(form.controllability) == np.linalg.matrix_rank(form.observability) == 2


def test_a_feedthrough_has_no_such_form():
    assert_refused("strictly proper", companion, TransferFunction(num=(1.0, 2.0), den=(1.0, 3.0)))


def test_the_amplifier():
    assert resistor_ratio(50.0, 5.0) == 9.0
    assert voltage_gain(9.0) == 10.0
    # 0.5 V/us: 15.9 kHz at the 5 V of the input, a tenth of it at the 50 V of the output
    assert full_power_bandwidth(0.5e6, 5.0) == pytest.approx(15.9e3, rel=2e-3)
    assert full_power_bandwidth(0.5e6, 50.0) == pytest.approx(1.59e3, rel=2e-3)
    assert UA741_SUPPLY_SPAN < 50.0
    assert_refused("positive", full_power_bandwidth, 0.5e6, 0.0)


def test_the_bandwidth_is_where_a_sine_reaches_the_slew_rate():
    frequency = full_power_bandwidth(2.0, 3.0)
    t = np.linspace(0.0, 1.0 / frequency, 100_001)
    # steepest slope by differences, whose error is quadratic in the step
    assert np.max(np.abs(np.gradient(3.0 * np.sin(2 * np.pi * frequency * t), t))) == pytest.approx(2.0, rel=1e-6)


def test_the_standard_form_is_the_sum_of_its_terms():
    at = 1j * np.geomspace(0.01, 100.0, 9)
    ideal, filtered = pid_standard(2.0, 4.0, 0.5), pid_standard(2.0, 4.0, 0.5, derivative_filter=0.1)
    np.testing.assert_allclose(ideal(at), 2.0 + 0.5 / at + at, rtol=1e-12)
    np.testing.assert_allclose(filtered(at), 2.0 + 0.5 / at + at / (1 + 0.1 * at), rtol=1e-12)
    np.testing.assert_allclose(pid_standard(2.0, np.inf, 0.0)(at), 2.0, rtol=1e-12)


@pytest.mark.parametrize("wrong", [{"Ti": 0.0}, {"Ti": np.nan}, {"Td": -1.0}, {"derivative_filter": -0.1}])
def test_the_standard_form_refuses_times_that_are_none(wrong):
    assert_refused("must", pid_standard, 1.0, **{"Ti": 1.0, "Td": 0.0, **wrong})


def test_an_integral_needs_no_steady_error():
    import control

    loop = control.feedback(pid_standard(0.5 / EQUATION_1.dc_gain, 2.0, 0.0) * to_control(EQUATION_1))
    assert control.dcgain(loop) == pytest.approx(1.0, abs=1e-9)


def test_which_second_order_model_stands_for_which():
    first, second = approximations()
    assert (first.name, first.of) == ("(7)", "(1)")
    assert (second.name, second.of) == ("(6)", "(4)")
    # over the time in which both settle; other windows move these by about a percent
    assert first.fit_percent == pytest.approx(62, abs=1)
    assert second.fit_percent == pytest.approx(78.5, abs=1)
    # (7) has (1)'s overshoot but not its peak time, which costs the fit
    assert first.simpler.overshoot_percent == pytest.approx(first.full.overshoot_percent, abs=0.1)
    assert first.full.peak_time / first.simpler.peak_time > 1.1
    assert first.matched_fit_percent > first.fit_percent


def test_a_matched_second_order_model_finds_itself():
    again = matched_second_order(characteristics(EQUATION_6))
    # the peak is read between 8000 samples by a parabola, whose error is of third order in their step
    assert coefficients(again) == pytest.approx(coefficients(EQUATION_6), rel=1e-5)
    assert step_fit(EQUATION_6, again) > 99.5
    assert step_fit(EQUATION_6, EQUATION_6) == pytest.approx(100.0)


def test_a_quantum_is_the_largest_step():
    assert quantum([0.0, 1.5, 4.5], 0.001) == pytest.approx(1.5)
    assert quantum([1.0, 1.0005], 0.001) == pytest.approx(1.0, abs=0.001)
    awkward = np.array([1.0, np.pi, np.e])
    step = quantum(awkward, 0.05)
    assert np.abs(awkward - step * np.round(awkward / step)).max() <= 0.05
    for values, tolerance in (([0.0, 0.0], 0.1), ([1.0], 0.0)):
        assert_refused("quantum", quantum, values, tolerance)
