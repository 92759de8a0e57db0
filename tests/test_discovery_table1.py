"""`discover` on Table 1: a law of few terms that runs free through the measured loop."""

import numpy as np
import pytest

import hysim as hs
from hysim.discovery._refinement import FreeRun, Terms
from hysim.laws.differential.terms import Term


@pytest.fixture(scope="module")
def found(discovered_table1):
    return discovered_table1


def test_the_law_has_few_terms_and_begins_at_rest(found):
    """The lowest BIC that any law of up to 6 terms and a steady loop has is -347.2 (all of them were refined once)."""
    assert found.scores["n_terms"] == len(found.coefficients) == found.n_parameters <= 6
    assert found.model.y0 == 0.0
    assert "held at zero" in found.message
    assert found.scores["bic"] <= -346.0
    assert found.scores["fit_percent"] >= 96.35
    assert isinstance(found.model, hs.Duhem)  # no law of a hidden memory explains the record as well
    assert found.verdict == "cannot be told from one rate"


def test_the_law_has_the_measured_loop(found, table1):
    y = found.model.response(table1.u)
    width = y[26:][::-1] - y[:26]
    assert width.max() == pytest.approx(0.232, rel=0.03)
    assert abs(table1.u[width.argmax()] - 35.0) <= 5.0  # one step of the staircase from the measured place
    assert np.abs(y - table1.y).max() < table1.resolution


def test_every_number_is_told_from_zero(found):
    assert all(abs(value) > 2.0 * found.stderr[term] for term, value in found.coefficients.items())


def test_scores_are_those_of_the_free_run(found, table1):
    residual = table1.y - found.model.response(table1.u)
    spread = np.linalg.norm(table1.y - table1.y.mean())
    n, d = len(table1), found.n_parameters
    assert found.scores["fit_percent"] == pytest.approx(100 * (1 - np.linalg.norm(residual) / spread), rel=1e-12)
    assert found.scores["rmse"] == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-12)
    assert found.scores["bic"] == pytest.approx(n * np.log(np.mean(residual**2)) + d * np.log(n), rel=1e-12)


def test_the_path_goes_from_dense_to_sparse(found):
    assert found.thresholds[0] == 0.0
    assert (np.diff(found.thresholds) > 0.0).all()
    assert found.path_n_terms[0] == 12.0  # all terms of the Duhem library
    assert found.path_n_terms[-1] == found.path_n_terms.min() < 12.0
    assert found.path_fit_percent.shape == found.path_bic.shape == found.thresholds.shape
    assert found.scores["bic"] <= found.path_bic.min()


def test_neither_units_nor_the_seed_decide_what_is_found(found, table1):
    """Volts and micrometres, or millivolts and kilometres: the same structure, the coefficients rescaled."""
    rescaled = hs.discover(hs.Record(u=1e3 * table1.u, y=1e-9 * table1.y), seed=1)
    assert list(rescaled.coefficients) == list(found.coefficients)
    # Every number is scaled before it is used; rounding differs, and the descent ends within 1e-6 of the optimum.
    assert rescaled.coefficients["u'"] == pytest.approx(1e-12 * found.coefficients["u'"], rel=1e-6)
    assert np.isnan(rescaled.cv_rmse)


def test_it_is_printed_with_its_equation_and_its_verdict(found):
    text = str(found)
    for word in (found.verdict, found.equation[:60], "held-out rmse", f"{found.scores['fit_percent']:.2f} %"):
        assert word in text
    assert text.count("\n") < 10
    assert max(map(len, text.splitlines())) <= 100


def test_a_likelier_law_that_comes_to_no_steady_loop_is_not_taken(table1, found):
    """Six complete terms have a BIC of -347.2 on these points; on further cycles that law drifts away without end."""
    names = ("u'", "u' u", "u' y", "u' y^2", "|u'|", "|u'| u")
    structure = Terms(tuple(Term.parse(name) for name in names), rest=True)
    start = np.array([[2.2053e-2, 9.2044e-4, -3.1229e-2, -5.3016e-3, -7.6017e-3, 7.1662e-5, 0.0]])
    drifting = FreeRun((table1,)).refine(structure, start, tolerance=1e-12)
    model = hs.Duhem.from_terms(dict(zip(names, drifting.unknowns.tolist(), strict=False)))
    residual = table1.y - model.response(table1.u)
    assert hs.metrics.bic(residual, 6) == pytest.approx(-347.23, abs=0.01)
    assert hs.metrics.bic(residual, 6) < found.scores["bic"]
    assert not drifting.settles
    lows = model.response(np.concatenate([table1.u, np.tile([125.0, 0.0], 20)]))[-39::2]
    assert lows[-1] < lows[0] - 0.5 * np.ptp(table1.y)  # and each cycle by more than the last
    lows = found.model.response(np.concatenate([table1.u, np.tile([125.0, 0.0], 20)]))[-39::2]
    assert np.ptp(lows) < 0.1  # where the law that is taken comes to rest
