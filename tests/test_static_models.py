"""The yardsticks: a line, and the best function of the input alone."""

import numpy as np
import pytest

import hysim as hs


def test_no_function_of_the_voltage_beats_the_single_valued_yardstick():
    rec = hs.datasets.table1()
    fit = hs.identify(hs.SingleValued, rec)
    assert fit.fit_percent == pytest.approx(90.2745, abs=1e-4)
    assert fit.n_parameters == 26
    pairs = [rec.y[rec.u == level] for level in np.unique(rec.u)]
    assert fit.model.y == pytest.approx([pair.mean() for pair in pairs])
    assert np.sum(fit.residual**2) == pytest.approx(sum(np.var(pair) * pair.size for pair in pairs))


def test_leaving_one_of_two_points_out_predicts_it_by_the_other():
    rec = hs.datasets.table1()
    fit = hs.identify(hs.SingleValued, rec, cross_validate="loo")
    gaps = [np.ptp(rec.y[rec.u == level]) for level in np.unique(rec.u)]
    assert fit.cv_rmse == pytest.approx(np.sqrt(np.mean(np.square(gaps))))


def test_the_line_is_the_regression():
    rec = hs.datasets.table1()
    fit = hs.identify(hs.Line, rec)
    slope, offset = np.polyfit(rec.u, rec.y, 1)
    assert (fit.model.offset, fit.model.slope) == pytest.approx((offset, slope))
    assert fit.fit_percent == pytest.approx(88.17, abs=5e-3)
    through_zero = hs.identify(hs.Line, rec, fixed={"offset": 0.0})
    assert through_zero.fit_percent == pytest.approx(87.5, abs=0.05)


def test_standard_errors_of_the_line_are_the_textbook_ones():
    rec = hs.datasets.table1()
    fit = hs.identify(hs.Line, rec)
    covariance = np.polyfit(rec.u, rec.y, 1, cov=True)[1]
    assert fit.stderr["slope"] == pytest.approx(np.sqrt(covariance[0, 0]))
    assert fit.stderr["offset"] == pytest.approx(np.sqrt(covariance[1, 1]))


def test_a_static_curve_is_constant_outside_its_knots():
    curve = hs.SingleValued(u=[0.0, 1.0], y=[1.0, 3.0])
    assert curve.response([-1.0, 0.25, 2.0]).tolist() == [1.0, 1.5, 3.0]


@pytest.mark.parametrize(
    ("u", "y"), [([0.0, 0.0], [1.0, 2.0]), ([1.0, 0.0], [1.0, 2.0]), ([0.0], [1.0, 2.0]), ([], [])]
)
def test_knots_that_make_no_function_are_refused(u, y):
    with pytest.raises(ValueError, match="u"):
        hs.SingleValued(u=u, y=y)


def test_the_levels_are_named_after_the_input():
    record = hs.Record(u=[0.0, 2.5, 0.1, -0.0], y=[1.0, 2.0, 3.0, 5.0])
    fit = hs.identify(hs.SingleValued, record, fixed={"y(2.5)": 7.0})
    assert fit.free_names == ("y(0)", "y(0.1)")
    assert fit.model.u.tolist() == [0.0, 0.1, 2.5]
    assert fit.model.y == pytest.approx([3.0, 3.0, 7.0])


def test_the_yardsticks_have_no_memory():
    u = np.array([0.0, 1.0, 0.5, 1.0, 0.0, 0.5])
    for model in (hs.Line(offset=0.3, slope=2.0), hs.SingleValued(u=[0.0, 1.0], y=[0.3, -1.0])):
        assert model.response(u).tolist() == [float(model.response([value])[0]) for value in u]


def test_a_line_through_a_constant_input_is_refused():
    with pytest.raises(ValueError, match="constant"):
        hs.identify(hs.Line, hs.Record(u=np.ones(5), y=np.arange(5.0)))
