"""Refinement under `discover`: the descent, structures on their way to models, and the kernels of a hidden memory."""

from types import SimpleNamespace

import numpy as np
import pytest
from discovered import COLEMAN_HODGDON, CYCLES, DAHL, LAW, duhem, multisine, record_of
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import least_squares

import hysim as hs
from hysim.discovery import _result
from hysim.discovery._discover import left_out_rmse
from hysim.discovery._hidden_memory import memory_arrays
from hysim.discovery._refinement import _SCHEDULE, FreeRun, Structure
from hysim.discovery._search import INDISTINCT, Library, Options, Search, pruned, searched
from hysim.identification import folds
from hysim.identification.marquardt import SumOfSquares, descend, differences
from hysim.kernels import memory_terms
from hysim.laws.differential.terms import RELAXATION, Term, bouc_wen_terms

OPEN = np.full(2, np.inf)


def rosenbrock(x):
    """Residuals of many points (n_sets, 2)."""
    x = np.atleast_2d(x)
    return np.stack([10.0 * (x[:, 1] - x[:, 0] ** 2), 1.0 - x[:, 0]], axis=1)


def descended(residuals, start, lower, upper, *, central, **options):
    """The end of a descent (n_x,), and the residual there."""

    def slopes(x, residual):
        return differences(residuals, x, residual, central=central)

    problem = SumOfSquares(residuals, slopes, lower, upper)
    reached = descend(problem, start[np.newaxis], schedule=_SCHEDULE, **options)
    return reached.x[0], reached.evaluated[0][0]


def terms(names):
    return tuple(Term.parse(name) for name in names)


@pytest.mark.parametrize("central", [True, False])
@pytest.mark.parametrize(
    ("lower", "upper"), [(-OPEN, OPEN), ((-2.0, -2.0), (0.5, 2.0)), ((-2.0, 0.5), (2.0, 0.7)), ((0.0, 1.2), (1.5, 3.0))]
)
def test_the_descent_ends_where_scipys_does(central, lower, upper):
    start, lower, upper = np.array([-1.2, 1.0]), np.array(lower, dtype=float), np.array(upper, dtype=float)
    start = np.clip(start, lower, upper)
    x, residual = descended(rosenbrock, start, lower, upper, relative=1e-14, steps=300, central=central)
    inside = np.clip(start, lower + 1e-9, upper - 1e-9)  # which SciPy's method asks for
    expected = least_squares(lambda x: rosenbrock(x)[0], inside, bounds=(lower, upper), xtol=1e-14, ftol=1e-14)
    # Both end where the cost, of the order of 1, changes by rounding; the bounds are reached to SciPy's 1e-6.
    assert residual @ residual <= 2.0 * expected.cost + 1e-9
    assert x == pytest.approx(expected.x, abs=1e-4)
    assert (x >= lower).all()
    assert (x <= upper).all()
    assert residual == pytest.approx(rosenbrock(x)[0], abs=1e-15)


def test_a_descent_that_cannot_win_is_given_up():
    """The sum of (10 (b - a^2))^2 and (1 - a)^2 falls slowly along its valley, here on a level of 5."""

    def steps_and_end(hopeless):
        calls = []

        def residuals(x):
            calls.append(len(x))
            return np.column_stack([rosenbrock(x), np.full(len(x), np.sqrt(5.0))])

        start = np.array([-1.2, 1.0])
        end = descended(residuals, start, -OPEN, OPEN, relative=1e-9, steps=40, central=False, hopeless=hopeless)[1]
        return len(calls), float(end @ end)

    most, best = steps_and_end(np.inf)
    assert best == pytest.approx(5.0, rel=1e-6)
    assert steps_and_end(5.1) == (most, best)  # it comes below that
    few, cost = steps_and_end(1.0)
    assert few < most
    assert cost > 1.0


def test_a_polished_law_does_not_lose_its_numbers_to_an_earlier_worse_optimum():
    record, library = record_of(LAW.memory, CYCLES, noise=0.01), Library(terms(["u'", "|u'| z", "u' |z|"]), "z")
    found = searched([record], library, Options(derivative="smoothed"))
    structure = found.candidate.structure
    worse = found.search.free_run.refine(structure, 1.5 * found.candidate.unknowns[np.newaxis], tolerance=np.inf)
    assert worse.cost > 1.01 * found.candidate.cost
    found.search.tried[structure] = worse
    assert found.searched.cost == found.candidate.cost


@given(seed=st.integers(0, 2**31))
@settings(max_examples=30)
def test_a_linear_problem_is_solved(seed):
    random = np.random.default_rng(seed)
    matrix, left = random.standard_normal((8, 3)), random.standard_normal(8)
    lower, upper = -0.3 * np.ones(3), 0.3 * np.ones(3)

    def residuals(x):
        return left - x @ matrix.T

    x, residual = descended(residuals, np.zeros(3), lower, upper, relative=1e-14, steps=300, central=True)
    best = least_squares(lambda x: left - matrix @ x, np.zeros(3), bounds=(lower, upper)).cost
    assert 0.5 * residual @ residual <= best * (1.0 + 1e-5)  # what SciPy leaves at its bounds
    assert differences(residuals, x, residual, central=True) == pytest.approx(-matrix, abs=1e-8)  # its rounding


def test_an_infinite_or_flat_direction_stops_nothing():
    def residuals(x):
        return np.stack([x[:, 0] - 1.0, 0.0 * x[:, 0]], axis=1)

    x, _ = descended(residuals, np.array([5.0, 3.0]), -OPEN, OPEN, relative=1e-12, steps=50, central=True)
    assert x == pytest.approx([1.0, 3.0], abs=1e-9)  # the second coordinate has no say, and stays


def law_and_free_run(structure, numbers, record):
    """The law that a candidate of these numbers becomes, and the response of its structure, from y0 = 0.4."""
    candidate = SimpleNamespace(
        structure=structure, unknowns=np.append(numbers, 0.4), covariance=np.eye(numbers.size + 1)
    )
    found = _result.law_from(candidate, [record], "z")
    return found, structure.run(record.u, numbers[np.newaxis], np.array([0.4]), 1e6)[0][0]


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("A", [1.0, 0.7, -2.5])
@pytest.mark.parametrize("offset", [0.0, 3.0])
def test_the_scale_of_a_memory_is_a_convention(n, A, offset):
    """With a feedthrough the law is written with A = 1 and a gain: the response is the same."""
    names = bouc_wen_terms(n)
    numbers = np.array([A, -0.3, -0.2, 5.0, offset])[[0, 1, 2, 3] + [4] * bool(offset)]
    structure = Structure(tuple(sorted(names)), True, bool(offset))
    numbers[:3] = numbers[:3][[names.index(term) for term in structure.terms]]
    record = record_of(lambda u: u)
    found, expected = law_and_free_run(structure, numbers, record)
    model = found.models[0]
    assert isinstance(model, hs.BoucWen)
    assert (model.A, model.gain, model.n) == (1.0, A, float(n))
    assert found.coefficients["u'"] == 1.0
    assert model.response(record.u) == pytest.approx(expected, abs=1e-10 * np.ptp(expected))  # its promise


@pytest.mark.parametrize("n", [0.5, 1.7])
@pytest.mark.parametrize("shifts", [(False, False), (True, False), (True, True)])
def test_a_law_of_any_exponent_is_the_model_that_it_becomes(n, shifts):
    structure = Structure(bouc_wen_terms(1.0), *shifts, any_exponent=True)
    numbers = np.array([-1.5, -0.3, -0.1, n, 5.0, 2.0])[: structure.size]
    record = record_of(lambda u: u)
    found, expected = law_and_free_run(structure, numbers, record)
    assert found.models[0].response(record.u) == pytest.approx(expected, abs=1e-9 * np.ptp(expected))  # its kernel's
    assert found.models[0].n == n
    assert set(found.stderr) >= {*found.coefficients, "n"}


def test_standard_errors_are_carried_to_the_gain():
    """gain = A, and beta n = 1 stays: errors of numbers under A = 1 are those of a ratio."""
    structure = Structure(terms(["u'", "u' |z|", "|u'| z"]), True)
    covariance = np.diag([0.01, 0.04, 0.09, 0.25, 1.0])
    candidate = SimpleNamespace(
        structure=structure, unknowns=np.array([-2.0, -0.3, -0.6, 5.0, 0.0]), covariance=covariance
    )
    spread = _result.law_from(candidate, [record_of(lambda u: u)], "z").stderr
    # differences of step 1e-6; for n = 1 only the term u' |z| takes the sign of the gain, none its size
    assert spread == pytest.approx({"u'": 0.0, "u' |z|": 0.2, "|u'| z": 0.3, "feedthrough": 0.5, "gain": 0.1}, rel=1e-6)


def test_refinement_does_not_look_at_samples_that_are_not_seen():
    record = record_of(duhem(COLEMAN_HODGDON), CYCLES)
    seen = np.ones(len(record), dtype=bool)
    seen[[0, 100]] = False
    start = 0.9 * np.array([[*COLEMAN_HODGDON.values(), 0.0]])
    free_run = FreeRun((hs.Record(u=record.u, y=np.where(seen, record.y, 1e3)),), (seen,))
    found = free_run.refine(Structure(terms(COLEMAN_HODGDON)), start, tolerance=1e-12)
    assert found.unknowns == pytest.approx([*COLEMAN_HODGDON.values(), 0.0], abs=1e-7)  # the root of rounding
    assert found.residual.size == free_run.n_samples == len(record) - 2
    assert free_run.stroke == pytest.approx(np.ptp(record.y))


def test_a_memory_at_rest_is_one_number_less_and_begins_at_zero():
    law = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3)
    record = record_of(lambda u: 7.0 + 40.0 * u + 60.0 * law.memory(u), multisine() + 3.0, noise=0.01)
    free = Structure(terms(["u'", "u' |z|", "|u'| z"]), feedthrough=True, offset=True)
    rest, start = free._replace(rest=True), np.array([[60.0, -0.3, -0.6, 40.0, 7.0, record.y[0]]])
    free_run = FreeRun((record,))
    of_free, of_rest = (free_run.refine(structure, start, tolerance=1e-12) for structure in (free, rest))
    assert (of_free.n_parameters, of_rest.n_parameters) == (6, 5)
    assert of_rest.unknowns[-1] == pytest.approx(of_rest.unknowns[4] + record.u[0] * of_rest.unknowns[3], rel=1e-15)
    assert of_free.cost <= of_rest.cost < 1.1 * of_free.cost
    assert of_rest.bic == free_run.bic_of(of_rest.cost, 5) < of_free.bic
    spread = np.sqrt(np.diag(of_rest.covariance))
    assert spread[-1] == 0.0
    assert (spread[:-1] > 0.0).all()
    assert abs(of_rest.unknowns[4] - 7.0) < 5.0 * spread[4]
    assert _result.law_from(of_rest, [record], "z").models[0].z0 == pytest.approx(0.0, abs=1e-12)


def test_the_left_out_error_is_that_of_laws_that_have_not_seen_the_sample():
    record = record_of(duhem(DAHL), CYCLES, noise=0.05)
    start, unseen = np.array([[1.0, -1.0, 0.0]]), []

    def search(seen):
        unseen.append(np.flatnonzero(~seen[0]).tolist())
        return FreeRun((record,), seen).refine(Structure(terms(DAHL)), start, tolerance=1e-12)

    candidate = search((np.ones(len(record), dtype=bool),))
    noise = np.sqrt(candidate.cost / len(record)) * np.ptp(record.y)
    counted = []
    error = left_out_rmse([record], search, folds(10, len(record)), lambda done, total: counted.append((done, total)))
    # Theory for 3 numbers from 204 samples: 1 + 3/204 of the noise; this draw may differ by as much again.
    assert error == pytest.approx(noise, rel=0.05)
    assert sorted(np.concatenate(unseen[1:]).tolist()) == list(range(len(record)))
    assert counted == [(k, 10) for k in range(1, 11)]
    assert (
        left_out_rmse(
            [record],
            lambda seen: SimpleNamespace(structure=Structure(terms(["|u'| y"])), unknowns=np.array([50.0, 1.0])),
            folds(2, len(record)),
            lambda done, total: None,
        )
        == np.inf
    )


NAMES = ["u'", "u' z", "u' |z|", "|u'| z"]


def searched_about_the_truth(record, names, **options):
    search = Search(FreeRun((record,), **options), (), rests=(False, True))
    whole = Structure(terms(names))
    truth = {"u'": 1.0, "u' |z|": -0.3, "|u'| z": -0.6}
    search.tried[whole] = search.free_run.refine(
        whole, np.array([[*(truth.get(name, 0.0) for name in names), 0.0]]), tolerance=1e-12
    )
    return search, whole


def test_the_linearised_free_run_predicts_what_smaller_structures_reach():
    record = record_of(LAW.memory, multisine(150), noise=0.05)
    search, whole = searched_about_the_truth(record, NAMES)
    predicted = search.predicted(search.tried[whole], whole)
    assert [each.structure for each in predicted[:2]] == [
        Structure(terms(["u'", "u' |z|", "|u'| z"]), rest=True),
        Structure(terms(NAMES), rest=True),
    ]
    for each in predicted[:4]:
        refined = search.free_run.refine(each.structure, each.unknowns[np.newaxis], tolerance=1e-12)
        assert each.bic == pytest.approx(refined.bic, abs=0.2)  # terms that say nothing: linear to their squares


def test_no_structure_is_predicted_whose_number_has_a_sign_that_it_must_not_have():
    record = record_of(LAW.memory, multisine(150), noise=0.05)
    wanted = Term.parse("u' |z|")
    search, whole = searched_about_the_truth(record, NAMES, signs={wanted: 1})
    assert search.tried[whole].unknowns[2] == 0.0
    predicted = search.predicted(search.tried[whole], whole)
    assert predicted
    for each in predicted:
        if wanted in each.structure.terms:
            assert each.unknowns[each.structure.terms.index(wanted)] >= 0.0


def test_a_number_within_two_standard_errors_of_zero_is_taken_out():
    free_run = FreeRun((record_of(LAW.memory, multisine(150), noise=0.05),))
    names = ["u'", "u' z", "u' |z|", "|u'|", "|u'| z"]
    whole = free_run.refine(Structure(terms(names), rest=True), np.array([[1.0, 0.0, -0.3, 0.0, -0.6, 0.0]]))
    assert (np.sort(whole.significance)[:2] < 2.0).all()
    small = pruned(free_run, whole, frozenset())
    assert small.structure.terms == terms(["u'", "u' |z|", "|u'| z"])
    assert (small.significance >= 2.0).all()
    assert pruned(free_run, small, frozenset()) is small


@pytest.mark.parametrize(("rests", "starts"), [((False,), 2), ((False, True), 0)])
def test_a_structure_could_win_if_its_bic_with_the_starts_of_all_records_may_be_the_best(rests, starts):
    """At rest the records have no starts to fit."""
    records = record_of(LAW.memory, CYCLES, noise=0.05), record_of(LAW.memory, multisine(150), noise=0.05)
    search = Search(FreeRun(records), (), rests=rests)
    found = search.refine(Structure(terms(["u'", "|u'| z", "u' |z|"])), np.array([1.0, -0.6, -0.3, 0.0, 0.0]))
    bound = search.free_run.bic_of(found.cost, 2 + starts)
    assert bound < found.bic
    assert search.could_win(2, bound - INDISTINCT + 1e-6)
    assert not search.could_win(2, bound - INDISTINCT - 1e-6)


# ------------------------------------------------------------------------ the kernels of a memory under an oscillator


PLANT = {"mass": 2.0, "damping": 0.4, "stiffness": 3.0}


def motion(coefficients, force, h, degree=1):
    """Displacement from rest, and the last state."""
    polynomial, extra, power, relaxation = memory_arrays(coefficients, degree)
    plant = np.array([*PLANT.values(), relaxation, power])
    state, y = np.zeros(3), np.zeros(force.size)
    assert memory_terms.motion(plant, polynomial, extra, force, h, state, y[1:])
    return y, state


@pytest.mark.parametrize("n", [1.0, 1.5])
def test_the_motion_is_that_of_the_oscillator(n):
    t = np.linspace(0.0, 20.0, 4001)
    force = 3.0 * np.sin(1.1 * t) * np.exp(-0.05 * t)
    numbers = [1.3, -0.6, -0.2]
    y, state = motion(dict(zip(bouc_wen_terms(n), numbers, strict=True)), force, t[1])
    spring = hs.BoucWen(A=1.3, beta=0.6, gamma=0.2, n=n)
    exact = hs.simulate(hs.BoucWenOscillator(**PLANT, law=spring), t, force)
    # steps that go over a reversal or a zero of z leave the square of 5e-3
    assert np.abs(y - exact.y).max() < 1e-5 * np.ptp(exact.y)
    assert state[2] == pytest.approx(exact.signals["z"][-1], abs=1e-4)


def test_a_linear_memory_that_relaxes_moves_as_its_matrix_says_to_fourth_order():
    """m y'' + c y' + k y + z = F, z' = 1.3 y' - 0.8 z, under a force that rises by 1 a second."""
    m, c, k = PLANT.values()
    linear = {bouc_wen_terms(1.0)[0]: 1.3, RELAXATION: -0.8}
    flow = np.zeros((5, 5))  # of y, y', z, F, dF/dt
    flow[0, 1] = flow[3, 4] = 1.0
    flow[1, :4] = [-k / m, -c / m, -1.0 / m, 1.0 / m]
    flow[2, 1:3] = [1.3, -0.8]
    exact = (expm(4.0 * flow) @ [0.0, 0.0, 0.0, 0.5, 1.0])[:3]
    errors = [np.abs(motion(linear, np.linspace(0.5, 4.5, 1 + n), 4.0 / n)[1] - exact).max() for n in (40, 80)]
    assert errors[0] < 1e-5
    assert errors[1] < errors[0] / 14.0  # 16 for the fourth order
