"""`discover`: what it finds, what it says about it, and what it refuses."""

import inspect
import itertools
import subprocess
import sys

import numpy as np
import pysindy
import pytest

import hysim as hs
from hysim.discovery import Discovery, _refinement, cross_validated_rmse, discover, refit
from hysim.discovery._derivatives import branches, smoothed
from hysim.discovery._library import duhem_terms, regression
from hysim.discovery._pysindy import sparse_fit, sparse_path
from hysim.discovery._selection import complete_structures, is_complete, thinned

DAHL = {"u'": 1.0, "|u'| y": -1.0}
COLEMAN_HODGDON = {"u'": 0.345, "|u'| u": 3.1635, "|u'| y": -1.0}
QUADRATIC = {"u'": 1.0, "u' y^2": -0.2, "|u'| u": 0.3, "|u'| y": -0.7}


def zigzag(*corners: float, per_branch: int = 30) -> np.ndarray:
    pieces = [np.linspace(a, b, per_branch)[1:] for a, b in itertools.pairwise(corners)]
    return np.concatenate([corners[:1], *pieces])


CYCLES = zigzag(0.0, 2.0, -2.0, 1.5, -1.0, 2.0, -2.0, 1.0)


def record_of(terms: dict[str, float], u: np.ndarray = CYCLES, noise: float = 0.0) -> hs.Record:
    """The response of a law with noise of this share of its standard deviation."""
    y = hs.Duhem.from_terms(terms).response(u)
    return hs.Record(u=u, y=y + noise * y.std() * np.random.default_rng(0).standard_normal(u.size))


@pytest.fixture(scope="module")
def table1() -> hs.Record:
    return hs.datasets.table1()


@pytest.fixture(scope="module")
def on_table1(table1) -> Discovery:
    return discover(table1, cross_validate="loo")


@pytest.mark.parametrize("terms", [DAHL, COLEMAN_HODGDON, QUADRATIC])
def test_a_law_is_recovered_exactly_from_clean_cycles(terms):
    found = discover(record_of(terms))
    assert list(found.coefficients) == list(terms)
    # Refinement ends where the cost stands still to rounding: what is left is its square root.
    assert dict(found.coefficients) == pytest.approx(terms, abs=1e-7)
    assert found.model.y0 == pytest.approx(0.0, abs=1e-7)
    assert found.verdict == "cannot be told from one rate"


@pytest.mark.parametrize("terms", [DAHL, COLEMAN_HODGDON])
def test_the_structure_survives_5_percent_noise(terms):
    found = discover(record_of(terms, noise=0.05))
    assert list(found.coefficients) == list(terms)
    # Five standard errors: noise 0.05 over the root of 204 samples, for terms of the order of the stroke.
    assert dict(found.coefficients) == pytest.approx(terms, rel=5 * 0.05 / np.sqrt(204))


def test_table_1_has_a_law_of_few_terms(on_table1):
    scores = on_table1.scores
    assert scores["n_terms"] == len(on_table1.coefficients) <= 7
    assert on_table1.n_parameters == scores["n_terms"] + 1
    assert scores["fit_percent"] >= 96.45
    assert on_table1.verdict == "cannot be told from one rate"


def test_table_1_has_the_measured_loop(on_table1, table1):
    y = on_table1.model.response(table1.u)
    width = y[26:][::-1] - y[:26]
    assert width.max() == pytest.approx(0.232, rel=0.03)
    assert abs(table1.u[width.argmax()] - 35.0) <= 5.0  # one step of the staircase from the measured place
    assert np.abs(y - table1.y).max() < table1.resolution


def test_table_1_is_predicted_with_each_sample_left_out(on_table1, table1):
    left_out = on_table1.cv_rmse
    assert on_table1.scores["rmse"] < left_out <= 0.035


def test_scores_are_those_of_the_free_run(on_table1, table1):
    residual = table1.y - on_table1.model.response(table1.u)
    spread = np.linalg.norm(table1.y - table1.y.mean())
    n, d = len(table1), on_table1.n_parameters
    assert on_table1.scores["fit_percent"] == pytest.approx(100 * (1 - np.linalg.norm(residual) / spread), rel=1e-12)
    assert on_table1.scores["rmse"] == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-12)
    assert on_table1.scores["bic"] == pytest.approx(n * np.log(np.mean(residual**2)) + d * np.log(n), rel=1e-12)


def test_the_path_goes_from_dense_to_sparse(on_table1):
    assert on_table1.thresholds[0] == 0.0
    assert (np.diff(on_table1.thresholds) > 0.0).all()
    assert on_table1.path_n_terms[0] == len(duhem_terms(2))
    assert on_table1.path_n_terms[-1] < on_table1.path_n_terms[0]
    assert on_table1.path_fit_percent.shape == on_table1.path_bic.shape == on_table1.thresholds.shape
    assert on_table1.scores["bic"] <= on_table1.path_bic.min()


def test_the_same_record_gives_the_same_bits(on_table1, table1):
    assert discover(table1, cross_validate="loo") == on_table1


def test_the_seed_does_not_decide_what_is_found(on_table1, table1):
    other = discover(table1, seed=1)
    assert dict(other.coefficients) == pytest.approx(dict(on_table1.coefficients), rel=1e-6)


def test_progress_ends_at_its_total(table1):
    calls: list[tuple[int, int]] = []
    discover(table1, degree=1, progress=lambda done, total: calls.append((done, total)))
    assert [done for done, _ in calls] == list(range(1, len(calls) + 1))
    assert calls[-1][0] == calls[-1][1]


def test_units_do_not_decide_what_is_found(on_table1, table1):
    """Volts and micrometres, or millivolts and kilometres: the same structure, the coefficients rescaled."""
    rescaled = discover(hs.Record(u=1e3 * table1.u, y=1e-9 * table1.y))
    assert list(rescaled.coefficients) == list(on_table1.coefficients)
    # Every number is scaled before it is used; rounding differs, and the descent ends within 1e-6 of the optimum.
    assert rescaled.coefficients["u'"] == pytest.approx(1e-12 * on_table1.coefficients["u'"], rel=1e-6)


def test_a_line_with_noise_has_no_structure():
    u = zigzag(0.0, 2.0, -2.0, 2.0)
    found = discover(hs.Record(u=u, y=2.0 * u + 0.01 * np.random.default_rng(0).standard_normal(u.size)))
    assert found.verdict == "no structure found"
    assert list(found.coefficients) == ["u'"]


def test_a_curve_without_a_loop_has_no_structure():
    u = zigzag(0.0, 2.0, -2.0, 2.0)
    found = discover(hs.Record(u=u, y=np.tanh(u)))
    assert found.verdict == "no structure found"
    assert dict(found.coefficients) == pytest.approx({"u'": 1.0, "u' y^2": -1.0}, abs=1e-7)  # as for clean laws


def test_a_lag_under_one_triangle_cannot_be_told_from_hysteresis():
    u = np.tile(zigzag(0.0, 1.0, -1.0, 0.0, per_branch=12), 2)
    y = np.zeros(u.size)
    for k in range(1, u.size):
        y[k] = y[k - 1] + 0.3 * (u[k] - y[k - 1])
    found = discover(hs.Record(u=u, y=y))
    assert found.scores["fit_percent"] > 95.0  # a fine law, and no hysteresis at all
    assert found.verdict == "cannot be told from one rate"


def test_nothing_that_stays_finite_is_unstable(monkeypatch):
    refine = _refinement.FreeRun.refine

    def only_lines(self, terms, starts, **options):
        return refine(self, terms, starts, **options) if len(terms) == 1 and not terms[0].rectified else None

    monkeypatch.setattr(_refinement.FreeRun, "refine", only_lines)
    found = discover(record_of(COLEMAN_HODGDON), degree=1)
    assert found.verdict == "unstable"
    assert len(found.coefficients) == 1
    assert np.isneginf(found.path_fit_percent).any()


@pytest.mark.parametrize(
    ("u", "y", "message"),
    [
        (np.linspace(0, 1, 30), np.linspace(0, 1, 30) ** 2, "needs a rising and a falling branch"),
        (np.ones(30), np.arange(30.0), "the input is constant"),
        (zigzag(0, 1, 0), np.ones(59), "the output is constant"),
        (np.tile([0.0, 1.0], 20), np.tile([0.0, 1.0], 20), "at least 4 samples each"),
        (zigzag(0, 1, 0, per_branch=6), zigzag(0, 1, 0, per_branch=6), "11 samples cannot tell 12 terms"),
    ],
)
def test_records_without_the_information_are_refused(u, y, message):
    with pytest.raises(ValueError, match=message):
        discover(hs.Record(u=u, y=y))


def test_arguments_are_checked():
    with pytest.raises(TypeError, match="discover takes a Record, got ndarray"):
        discover(CYCLES)
    with pytest.raises(ValueError, match="degree must be a whole number"):
        discover(record_of(DAHL), degree=-1)
    with pytest.raises(ValueError, match="weights must be 204 numbers"):
        refit(hs.Duhem.from_terms(DAHL), record_of(DAHL), weights=[1.0])
    with pytest.raises(ValueError, match='folds must be "loo" or a number of blocks from 2 to 204, got 1'):
        cross_validated_rmse(hs.Duhem.from_terms(DAHL), record_of(DAHL), 1)


def test_terms_that_a_record_cannot_tell_apart_are_left_out_by_name():
    u = zigzag(0.0, 1.0, 0.0)
    found = discover(hs.Record(u=u, y=3.0 * u))
    assert {"u' y", "u' u y", "u' y^2"} <= set(found.left_out)
    assert dict(found.coefficients) == pytest.approx({"u'": 3.0}, rel=1e-9)  # a line is fitted to rounding


def test_refit_leaves_out_what_has_no_weight():
    record = record_of(COLEMAN_HODGDON)
    spoilt = record.y.copy()
    spoilt[100] += 5.0
    weights = np.ones(len(record))
    weights[100] = 0.0
    start = hs.Duhem.from_terms({name: 0.9 * value for name, value in COLEMAN_HODGDON.items()})
    found = refit(start, hs.Record(u=record.u, y=spoilt), weights=weights)
    assert found.terms == pytest.approx(COLEMAN_HODGDON, abs=1e-7)  # as for clean laws


def test_samples_that_are_left_out_cost_little_where_there_are_many():
    law, record = hs.Duhem.from_terms(DAHL), record_of(DAHL, noise=0.05)
    noise = np.sqrt(np.mean((record.y - law.response(record.u)) ** 2))
    one_by_one = cross_validated_rmse(law, record)
    # Theory for 3 numbers from 204 samples: 1 + 3/204 of the noise; this draw may differ by as much again.
    assert one_by_one == pytest.approx(noise, rel=0.03)
    assert cross_validated_rmse(law, record, len(record)) == one_by_one


def test_slopes_are_never_taken_across_a_reversal():
    u = np.concatenate([zigzag(0.0, 1.0), [1.0, 1.0], zigzag(1.0, -1.0)])
    found = branches(u, np.abs(1.0 - u) ** 3)
    assert [branch.direction for branch in found] == [1.0, -1.0]
    for branch in found:
        exact = -branch.direction * 3.0 * (1.0 - branch.u) ** 2
        assert np.abs(branch.slope - exact).max() < 1e-10  # a cubic is in the basis: rounding of a fit


def test_smoothing_takes_noise_away_and_leaves_the_slope():
    u = np.linspace(0.0, 3.0, 200)
    branch = smoothed(u, np.sin(u) + 0.01 * np.random.default_rng(0).standard_normal(u.size))
    inside = slice(20, -20)
    # A polynomial of degree m has slope errors of about noise * m^1.5 / (span/2) / sqrt(n), here 0.006 at m = 5.
    assert np.abs(branch.slope - np.cos(u))[inside].max() < 0.02


def test_the_features_are_those_of_the_law():
    problem = regression(record_of(QUADRATIC), duhem_terms(2))
    exact = np.array([QUADRATIC.get(term.name, 0.0) for term in problem.terms])
    predicted = problem.features @ (exact * problem.sizes / problem.slope_size)
    assert np.abs(predicted - problem.slope).max() < 1e-4  # truncation of the branch polynomials, degree 12 at most
    assert np.sqrt(np.mean(problem.features**2, axis=0)) == pytest.approx(1.0, rel=1e-12)


def test_every_threshold_on_the_path_changes_the_structure():
    problem = regression(record_of(COLEMAN_HODGDON, noise=0.01), duhem_terms(2))
    path = sparse_path(problem)
    structures = [problem.kept(coefficients) for _, coefficients in path]
    assert len(set(structures)) == len(structures)
    for threshold, coefficients in path:
        assert (np.abs(coefficients[coefficients != 0.0]) >= threshold).all()
    assert not sparse_fit(problem, 1e6).any()


def test_complete_structures_are_those_that_a_shift_of_the_origin_keeps():
    terms = duhem_terms(2)
    listed = complete_structures(terms, 10_000)
    brute = [chosen for size in range(1, 13) for chosen in itertools.combinations(terms, size) if is_complete(chosen)]
    assert listed == brute
    assert complete_structures(terms, 5) == brute[:5]


def test_thinning_keeps_reversals_and_the_law():
    record = record_of(DAHL)
    thin = thinned(record, 40)
    assert 40 <= len(thin) <= 60
    assert set(thin.u) >= {2.0, -2.0, 1.5, -1.0}
    # The series is good to 1e-12 of the range on both.
    assert hs.Duhem.from_terms(DAHL).response(thin.u) == pytest.approx(thin.y, abs=1e-11)
    assert len(thinned(record, 1000)) == len(record)


def test_pysindy_is_what_the_adapter_expects():
    stlsq = inspect.signature(pysindy.STLSQ).parameters
    assert {"threshold", "alpha", "max_iter", "unbias"} <= set(stlsq)
    assert list(inspect.signature(pysindy.SINDy.fit).parameters)[:6] == [
        "self",
        "x",
        "t",
        "x_dot",
        "u",
        "feature_names",
    ]
    assert {"optimizer", "feature_library"} <= set(inspect.signature(pysindy.SINDy).parameters)
    library = inspect.signature(pysindy.CustomLibrary).parameters
    assert {"library_functions", "function_names", "interaction_only"} <= set(library)
    assert library["interaction_only"].default is True
    assert library["include_bias"].default is False


def test_importing_discovery_does_not_import_pysindy():
    code = "import sys, hysim.discovery; sys.exit('pysindy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
