"""`identify` finds the global optimum, says what the data tell, and refuses what it cannot do."""

import numpy as np
import pytest
from strategies import assert_refused, refused, with_peak_memory

import hysim as hs
from hysim.models.search_space import SearchSpace


def loop_record(law) -> hs.Record:
    u = np.concatenate([hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=60), [-0.4, 0.3, -0.2, 0.9]])
    return hs.Record(u=u, y=law.response(u))


def test_clean_data_give_the_law_back():
    law = hs.BoucWen(beta=1.4, gamma=-0.6, n=1.6, feedthrough=0.7, gain=-0.5, offset=0.2, z0=0.1)
    fit = hs.identify(hs.BoucWen, loop_record(law))
    assert fit.success
    assert fit.fit_percent > 99.9999
    for name, value in fit.estimates.items():
        assert value == pytest.approx(getattr(law, name), abs=1e-5)  # the residual is quadratic in this error


def test_a_perfect_line_is_fitted_without_a_warning():
    """Nothing left to explain: sums of squares of zero, and curvature that the data cannot tell."""
    u = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=20)
    fit = hs.identify(hs.BoucWen, hs.Record(u=u, y=3.0 * u))
    assert fit.rmse < 1e-12
    assert fit.model.response(u) == pytest.approx(3.0 * u, abs=1e-10)


def test_a_long_record_takes_little_memory():
    """8 001 samples: what is held at once is a few hundred evaluations, never a square of the samples."""
    t = np.linspace(0.0, 20.0, 8_001)
    law = hs.BoucWen(beta=0.8, gamma=-0.3, feedthrough=0.7, gain=-0.5)
    u = np.sin(2.1 * t) + 0.6 * np.sin(7.3 * t)
    record = hs.Record(u=u, y=law.response(u))
    fit, peak = with_peak_memory(lambda: hs.identify(hs.BoucWen, record, fixed={"n": 1.0}))
    assert fit.model.beta == pytest.approx(0.8, abs=1e-5)
    assert peak < 80e6


def test_polynomial_input_is_given_back():
    law = hs.PolynomialBoucWen(beta=1.5, gamma=0.4, gain=-0.6, input_coefficients=(1.3, 0.2, -0.1))
    start = hs.PolynomialBoucWen(input_coefficients=(0.0, 0.0, 0.0))
    fit = hs.identify(start, loop_record(law), fixed={"n": 1.0})
    assert fit.model.input_coefficients == pytest.approx(law.input_coefficients, abs=1e-5)
    assert fit.model.beta == pytest.approx(law.beta, abs=1e-4)


def test_table1_bouc_wen_reaches_its_global_optimum_and_lists_the_rival(table1):
    fit = hs.identify(hs.BoucWen, table1, admissible=False)
    # 95.7146 is what an exhaustive search reaches for n from 0.5 on; the best law, at n = 0.37, is beyond this bound
    assert fit.fit_percent == pytest.approx(95.7156, abs=2e-4)
    assert fit.success
    assert any(rival.fit_percent == pytest.approx(95.714, abs=1e-3) for rival in fit.rivals)
    assert fit.n_parameters == 7
    assert fit.estimates["A"] == 1.0
    assert not fit.model.admissible
    assert fit.regions["admissible"].fit_percent == pytest.approx(93.708, abs=1e-3)
    assert fit.regions["admissible"].model.beta >= abs(fit.regions["admissible"].model.gamma) * (1 - 1e-12)


def test_table1_with_a_quadratic_input(table1):
    fit = hs.identify(hs.PolynomialBoucWen, table1, fixed={"n": 1.0})
    assert fit.fit_percent == pytest.approx(96.3107, abs=1e-3)
    assert fit.n_parameters == 7
    assert np.abs(fit.residual).max() < table1.resolution


def test_the_optimum_does_not_depend_on_the_seed(table1):
    fits = [hs.identify(hs.PolynomialBoucWen, table1, fixed={"n": 1.0}, seed=seed) for seed in range(3)]
    assert [fit.rmse for fit in fits[1:]] == pytest.approx([fits[0].rmse] * 2, rel=5e-7)  # the cost within 1e-6


def test_fixed_free_and_the_redundant_pair(table1):
    held = hs.identify(hs.BoucWen, table1, fixed={"n": 1.0, "gain": -0.005})
    assert "A" in held.free_names
    assert "gain" not in held.free_names
    assert held.estimates["gain"] == -0.005
    plain = hs.identify(hs.BoucWen, table1, fixed={"n": 1.0, "A": 2.0})
    assert "gain" in plain.free_names
    assert plain.estimates["A"] == 2.0


def test_the_optimum_does_not_depend_on_the_held_slope(table1):
    one = hs.identify(hs.BoucWen, table1, fixed={"n": 1.0})
    two = hs.identify(hs.BoucWen, table1, fixed={"n": 1.0, "A": 2.0})
    assert two.rmse == pytest.approx(one.rmse, rel=1e-6)
    assert two.model.A * two.model.gain == pytest.approx(one.model.A * one.model.gain, rel=1e-3)


def test_bounds_are_kept_and_said(table1):
    bounds = {"gain": (-0.004, 0.0), "beta": (0.0, 0.02), "z0": (-5.0, 5.0)}
    fit = hs.identify(hs.BoucWen, table1, fixed={"n": 1.0}, bounds=bounds)
    for name, (lower, upper) in bounds.items():
        assert lower <= fit.estimates[name] <= upper
    assert "gain is at its given bound -0.004" in fit.message
    assert fit.success


def test_a_sign_is_a_bound_too(table1):
    bounds = {"beta": (0.0, np.inf), "gamma": (-np.inf, 0.0), "gain": (-np.inf, 0.0), "n": (0.0, np.inf)}
    fit = hs.identify(hs.BoucWen, table1, bounds=bounds)
    assert fit.estimates["beta"] >= 0.0
    assert fit.estimates["gamma"] <= 0.0
    assert fit.estimates["gain"] <= 0.0
    assert 0.5 <= fit.estimates["n"] <= 10.0
    assert fit.fit_percent > 90.0
    assert_refused("from zero to infinity", hs.identify, hs.BoucWen, table1, bounds={"beta": (1.0, np.inf)})
    for pair in ((0.0, 2.0), (-np.inf, 0.0), (-1.0, 3.0)):
        assert_refused("bounds of 'n' must be positive", hs.identify, hs.BoucWen, table1, bounds={"n": pair})


def test_rest_holds_the_memory_at_zero(table1):
    fit = hs.identify(hs.BoucWen, table1, initial="rest", fixed={"n": 1.0})
    assert fit.model.z0 == 0.0
    assert "z0" not in fit.free_names


@pytest.mark.parametrize("factor", [1e-6, 1e-20])
def test_units_do_not_matter(table1, factor):
    """The same loop in millivolts and metres, or a still longer unit, has the same optimum."""
    scaled = hs.Record(u=table1.u * 1e3, y=table1.y * factor)
    fit = hs.identify(hs.PolynomialBoucWen, scaled, fixed={"n": 1.0})
    assert fit.fit_percent == pytest.approx(96.3107, abs=1e-3)


def test_cross_validation_is_leave_one_out(table1):
    line = hs.identify(hs.Line, table1, cross_validate="loo")
    design = np.column_stack([np.ones(52), table1.u])
    leverage = np.einsum("nk,kn->n", design, np.linalg.pinv(design))
    closed_form = np.sqrt(np.mean((line.residual / (1 - leverage)) ** 2))
    assert line.cv_rmse == pytest.approx(closed_form, rel=1e-12)
    assert np.isnan(hs.identify(hs.Line, table1).cv_rmse)


def test_transfer_function_reaches_the_best_below_nyquist(table1):
    structure = hs.TransferFunction.structure(poles=4, zeros=1, hold="zoh", sample="start", initial="rest")
    fit = hs.identify(structure, table1)
    # what an exhaustive search of the box reaches; resonances beyond Nyquist would reach more by aliasing
    assert fit.fit_percent == pytest.approx(91.5414, abs=1e-3)
    assert fit.n_parameters == 6
    assert fit.fpe == pytest.approx(0.006004, abs=2e-6)
    assert (fit.model.poles.real < 0.0).all()


def test_transfer_function_is_given_back():
    true = hs.TransferFunction(num=(1.0, 3.0), den=(1.0, 0.8, 4.0), initial_state=(0.2, -0.1))
    rng = np.random.default_rng(0)
    u = np.repeat(rng.standard_normal(40), 5)
    t = 0.1 * np.arange(u.size)
    record = hs.Record(u=u, y=true.response(u, 0.1), t=t)
    fit = hs.identify(hs.TransferFunction.structure(poles=2, zeros=1, initial="free"), record)
    assert fit.model.den == pytest.approx(true.den, rel=1e-6)
    assert fit.model.num == pytest.approx(true.num, rel=1e-6)
    assert fit.model.initial_state == pytest.approx(true.initial_state, abs=1e-6)


def test_a_constant_output_parameter_that_cannot_be_told_is_nan():
    """Without curvature the memory is the input: feedthrough and gain cannot be told apart."""
    u = np.linspace(0.0, 1.0, 30)
    fit = hs.identify(hs.BoucWen, hs.Record(u=u, y=2 * u), fixed={"beta": 0.0, "gamma": 0.0, "n": 1.0, "z0": 0.0})
    assert np.isnan(fit.stderr["gain"])
    assert np.isnan(fit.stderr["feedthrough"])
    assert "do not determine" in fit.message


test_wrong_arguments_are_named = refused(
    ({"fixed": {"bta": 1.0}}, "fixed names 'bta'; the parameters are A, beta"),
    ({"free": ("alpha",)}, "free names 'alpha'"),
    ({"bounds": {"beta": (1.0, 0.0)}}, "lower < upper"),
    ({"bounds": {"A": (0.0, 1.0)}}, "not free"),
    ({"initial": "warm"}, '"free", "rest", "still" or "periodic"'),
    ({"cross_validate": "lots"}, "loo"),
    ({"cross_validate": 1}, "from 2 to 52"),
    ({"fixed": {"n": 1.0}, "free": ("n",)}, "both fixed and free"),
    call=lambda arguments: hs.identify(hs.BoucWen, hs.datasets.table1(), **arguments),
)


test_records_that_say_nothing_are_refused = refused(
    (1.0, hs.datasets.table1(), "takes a model"),
    (hs.BoucWen, hs.datasets.table1().y, "takes a Record"),
    (hs.Sum, hs.datasets.table1(), "no defaults for parts"),
    call=hs.identify,
    error=TypeError,
)


def test_a_search_space_is_data(table1):
    space = hs.BoucWen(beta=0.01, gamma=-0.004).search_space(table1)
    assert isinstance(space, SearchSpace)
    assert space.redundant == (("A", "gain"),)
    assert space.linear == ("feedthrough", "gain", "offset")
    back = space.parameters(space.starts)
    assert back["beta"][0] == pytest.approx(0.01)
    assert back["gamma"][0] == pytest.approx(-0.004)
    assert back["n"][0] == pytest.approx(1.0)
