"""The regression under `discover`: slopes, libraries, the path over them, and the elimination of terms."""

import inspect
import itertools
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pysindy
import pytest
from discovered import COLEMAN_HODGDON, CYCLES, DAHL, QUADRATIC, duhem, record_of, zigzag

import hysim as hs
from hysim.discovery import _slopes
from hysim.discovery._hidden_memory import TermRegression
from hysim.discovery._refinement import Structure
from hysim.discovery._search import best_subsets, is_complete, preferred, thinning
from hysim.discovery._slopes import branches, feature, signs_of, slopes, smoothed, weak_rows
from hysim.laws.differential.terms import Term, duhem_terms, memory_terms, named_terms, power_term, symmetric


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


@pytest.mark.parametrize("feedthrough", [0.0, 3.0])
@pytest.mark.parametrize("per_branch", [4, 400])
def test_the_weak_form_of_a_law_linear_in_the_input_is_exact(feedthrough, per_branch):
    """z' = u' u + |u'| / 2 has z = (u^2 + L) / 2; reversals and uneven steps change nothing."""
    u = zigzag(0.0, 2.0, -1.0, 1.5, 0.5, per_branch=per_branch)
    length = np.append(0.0, np.cumsum(np.abs(np.diff(u))))
    rows = weak_rows(u, 4.0 + feedthrough * u + 0.5 * (u**2 + length))

    def features(u, z, direction):
        return np.stack([direction * u, np.ones_like(u)], axis=1)

    errors = rows.target(feedthrough) - rows.columns(features, feedthrough, 4.0) @ [1.0, 0.5]
    assert np.abs(errors).max() < 1e-14 * 10.0  # rounding of outputs up to 10


@pytest.mark.parametrize("form", ["smoothed", "weak"])
def test_the_features_are_those_of_the_law(form):
    rows = slopes([record_of(duhem(QUADRATIC), CYCLES)], form)
    problem = rows.regression(duhem_terms(2))
    exact = np.array([QUADRATIC.get(term.named("y"), 0.0) for term in problem.terms])
    predicted = problem.features @ (exact * problem.sizes / problem.size)
    # Truncation of the branch polynomials, degree 12 at most, or of the windows' midpoint rule.
    assert np.abs(predicted - problem.target).max() < {"smoothed": 1e-4, "weak": 2e-2}[form]
    assert np.sqrt(np.mean(problem.features**2, axis=0)) == pytest.approx(1.0, rel=1e-12)
    assert rows.misfit(duhem_terms(2), 0.0, 0.0) < 1e-2 * problem.size


@pytest.mark.parametrize("terms", [duhem_terms(3), memory_terms(4)], ids=["Duhem", "Bouc-Wen"])
@pytest.mark.parametrize(("symmetry", "sign"), [("odd", -1.0), ("even", 1.0)])
def test_symmetric_terms_are_those_whose_slope_turns_as_that_of_the_response(terms, symmetry, sign):
    """Under u -> -u and z -> sign z the slope along the path, dz/dL, must be sign times itself."""
    u, z = np.array([0.7]), np.array([-0.4])
    kept = symmetric(terms, symmetry)
    for term in terms:
        mirrored = feature(term, -u, sign * z, -1.0)
        assert (mirrored == sign * feature(term, u, z, 1.0)) == (term in kept)
    assert symmetric(terms, None) == terms


def test_libraries_have_their_sizes_and_one_order():
    for degree in range(5):
        assert len(duhem_terms(degree)) == (degree + 1) * (degree + 2)
        assert len(memory_terms(degree)) == 2 * (2 * degree + 1)
        assert list(memory_terms(degree)) == sorted(memory_terms(degree))
        assert list(duhem_terms(degree)) == sorted(duhem_terms(degree))
    assert named_terms(["|u'| z", "u'"]) == named_terms(["u'", "|u'| y"])
    assert signs_of(memory_terms(1), {"u' |z|": -1}) == {Term.parse("u' |z|"): -1}


def test_every_threshold_on_the_path_changes_the_structure():
    problem = slopes([record_of(duhem(COLEMAN_HODGDON), CYCLES)], "smoothed").regression(duhem_terms(2))
    path = _slopes.sparse_path(*problem.triangle)
    structures = [terms for _, terms in problem.path()]
    assert len(set(structures)) == len(structures)
    for threshold, coefficients in path:
        assert (np.abs(coefficients[coefficients != 0.0]) >= threshold).all()
    assert not _slopes.sparse_fit(problem.features, problem.target, 1e6).any()


@pytest.mark.parametrize("optimizer", ["SR3", "SSR", "FROLS"])
def test_other_optimizers_have_paths_too(optimizer):
    problem = slopes([record_of(duhem(DAHL), CYCLES)], "smoothed").regression(duhem_terms(1))
    structures = [terms for _, terms in problem.path(optimizer)]
    assert len(set(structures)) == len(structures)
    assert tuple(Term.parse(name) for name in DAHL) in structures


def test_fewer_rows_of_the_same_least_squares():
    random = np.random.default_rng(0)
    features, slope = random.standard_normal((200, 4)), random.standard_normal(200)
    fewer, left = _slopes.compressed(features, slope)
    assert fewer.shape == (5, 4)
    exact = np.linalg.lstsq(features, slope)[0]
    assert np.linalg.lstsq(fewer, left)[0] == pytest.approx(exact, abs=1e-12)  # rounding
    assert np.sum((left - fewer @ exact) ** 2) == pytest.approx(np.sum((slope - features @ exact) ** 2), rel=1e-12)


def test_an_ensemble_is_drawn_from_its_seed_alone():
    random = np.random.default_rng(0)
    features = random.standard_normal((100, 3))
    slope = features @ [1.0, 0.1, 0.0] + 0.5 * random.standard_normal(100)
    first, again, other = (_slopes.inclusion(features, slope, 0.1, n_models=20, seed=seed) for seed in (5, 5, 6))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert first[0] == 1.0


@pytest.mark.parametrize(
    ("names", "complete"),
    [
        (["u'", "|u'|", "|u'| u"], True),
        (["u'", "|u'| u"], False),
        (["u'", "u' y", "u' y^2"], True),
        (["u'", "u' y^2"], False),
        (["u'", "u' u", "u' u y"], False),
    ],
)
def test_a_complete_structure_keeps_its_form_where_the_origin_is_shifted(names, complete):
    assert is_complete(Term.parse(name) for name in names) is complete


def test_among_laws_that_are_as_likely_the_fewest_numbers_then_the_plain_form_then_bic_decide():
    def candidate(terms, bic, cost=1e-3):
        parsed = Structure(tuple(Term.parse(name) for name in terms))
        return SimpleNamespace(structure=parsed, bic=bic, cost=cost, residual=np.zeros(100), n_parameters=len(terms))

    sparse, complete = candidate(["u'", "|u'| u"], 1.9), candidate(["u'", "|u'|", "|u'| u"], 0.0, 0.0)
    assert preferred([sparse, complete], "y") is sparse
    sparse.bic = 2.1
    assert preferred([sparse, complete], "y") is complete
    plain = candidate(["u'", "|u'|"], 1.9)
    sparse.bic = 1.5
    assert preferred([sparse, plain, complete], "y") is plain
    bouc_wen, other = candidate(["u'", "u' |z|", "|u'| z"], 1.9), candidate(["u'", "u' z^2", "|u'| z"], 0.0, 0.0)
    assert preferred([bouc_wen, other], "z") is bouc_wen
    bouc_wen.bic = 2.1
    assert preferred([bouc_wen, other], "z") is other
    smaller = candidate(["u'"], 9.0, cost=1e-7)  # less than 1e-4 strokes apart in rms
    assert preferred([other, smaller], "z") is smaller
    smaller.cost = 1e-5
    assert preferred([other, smaller], "z") is other


@pytest.mark.parametrize("width", [924, 4])
def test_the_best_subsets_are_those_of_all_least_squares(width):
    random = np.random.default_rng(0)
    jacobian, residual, x = random.standard_normal((30, 6)), random.standard_normal(30), random.standard_normal(6)
    jacobian[:, 4] = jacobian[:, 3] + 1e-2 * jacobian[:, 4]
    removable = np.array([True, True, False, True, True, True])
    target = residual - jacobian @ x
    levels = list(best_subsets(jacobian, residual, x, removable, width=width))
    assert [level.included.sum(axis=1).tolist() for level in levels] == [
        [6 - k] * len(levels[k].cost) for k in range(6)
    ]
    for level in levels:
        size = int(level.included[0].sum())
        brute = {}
        for chosen in itertools.combinations([0, 1, 3, 4, 5], size - 1):
            kept = sorted([*chosen, 2])
            solved = np.linalg.lstsq(jacobian[:, kept], -target, rcond=None)[0]
            brute[tuple(kept)] = float(np.sum((target + jacobian[:, kept] @ solved) ** 2)), solved
        assert level.cost[0] == pytest.approx(min(cost for cost, _ in brute.values()), rel=1e-9)
        for kept, cost, numbers in zip(level.included, level.cost, level.x, strict=True):
            expected, solved = brute[tuple(np.flatnonzero(kept).tolist())]
            assert cost == pytest.approx(expected, rel=1e-9)  # rounding, and a ridge of 1e-12
            assert numbers[kept] == pytest.approx(solved, rel=1e-6)  # the ridge, times the condition squared
            assert not numbers[~kept].any()
        assert len(level.cost) == min(len(brute), width)


def test_thinning_keeps_reversals_and_the_law():
    record = record_of(duhem(DAHL), CYCLES)
    samples = thinning(record, 40)
    thin = hs.Record(u=record.u[samples], y=record.y[samples])
    assert 40 <= len(thin) <= 60
    assert set(thin.u) >= {2.0, -2.0, 1.5, -1.0}
    # The series is good to 1e-12 of the range on both.
    assert hs.Duhem.from_terms(DAHL).response(thin.u) == pytest.approx(thin.y, abs=1e-11)
    assert len(thinning(record, 1000)) == len(record)


def test_pysindy_is_what_the_adapter_expects():
    def parameters(function):
        return set(inspect.signature(function).parameters)

    assert {"threshold", "alpha", "max_iter", "unbias"} <= parameters(pysindy.STLSQ)
    assert {"reg_weight_lam", "regularizer", "relax_coeff_nu", "max_iter", "unbias"} <= parameters(pysindy.SR3)
    for greedy in (pysindy.SSR, pysindy.FROLS):
        assert {"alpha", "max_iter", "unbias"} <= parameters(greedy)
    assert {"opt", "bagging", "n_models"} <= parameters(pysindy.EnsembleOptimizer)
    x = np.random.default_rng(0).standard_normal((50, 3))
    y = x @ np.ones((3, 1))
    for optimizer in (pysindy.STLSQ(), pysindy.SR3(), pysindy.SSR(max_iter=3), pysindy.FROLS(max_iter=3)):
        optimizer.fit(x, y)
        assert optimizer.coef_.shape == (1, 3)
        assert all(np.size(each) == 3 for each in optimizer.history_)
    ensemble = pysindy.EnsembleOptimizer(pysindy.STLSQ(threshold=0.0), bagging=True, n_models=4)
    ensemble.fit(x, y)
    assert [coefficients.shape for coefficients in ensemble.coef_list] == [(1, 3)] * 4


def test_importing_discovery_does_not_import_pysindy():
    """Nor `scipy.signal`, which would take much of the time; control and plots leave it out, too."""
    code = "import sys, hysim.discovery, hysim.control, hysim.plot; sys.exit(not {*sys.argv}.isdisjoint(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code, "pysindy", "scipy.signal"], check=False).returncode == 0


# -------------------------------------------------------------- the elimination of terms is that of plain regressions


TERMS = tuple(power_term(False, power, even=False) for power in range(4))


def regression(features, target):
    return TermRegression(TERMS, (), features, target, np.ones(len(TERMS)), 1.0, 1e-9, 0, [np.arange(len(target))])


def losses(features, target, kept):
    """Sum of squares without each of the columns."""
    found = []
    for k in range(len(kept)):
        rest = features[:, kept[:k] + kept[k + 1 :]]
        found.append(np.sum((target - rest @ np.linalg.lstsq(rest, target, rcond=None)[0]) ** 2))
    return found


def test_each_step_leaves_out_the_term_that_costs_least():
    rng = np.random.default_rng(0)
    features = rng.standard_normal((60, 4)) * [1.0, 1e-6, 1e6, 1.0]
    target = features @ [1.0, 3e6, 1e-7, 0.0] + 0.1 * rng.standard_normal(60)
    kept, path = list(range(4)), []
    while kept:
        path.append(tuple(TERMS[k] for k in kept))
        kept.pop(int(np.argmin(losses(features, target, kept))))
    assert regression(features, target).eliminated() == path


def test_terms_that_depend_on_each_other_or_vanish_go_first():
    features = np.random.default_rng(1).standard_normal((60, 4))
    features[:, 1], features[:, 3] = 2.0 * features[:, 0], 0.0
    path = regression(features, features[:, 0] + features[:, 2]).eliminated()
    assert [len(each) for each in path] == [4, 3, 2, 1]
    assert TERMS[3] not in path[2]
    assert not {TERMS[0], TERMS[1]} <= set(path[2])
    assert TERMS[2] in path[2]
