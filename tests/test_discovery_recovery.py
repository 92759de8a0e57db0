"""`discover` finds the law that made a record, and a law of few terms for the measured loop of Table 1."""

import math

import numpy as np
import pytest
from discovered import COLEMAN_HODGDON, CYCLES, DAHL, LAW, QUADRATIC, TRUTH, duhem, multisine, record_of

import hysim as hs
from hysim.discovery import _search
from hysim.discovery._refinement import FreeRun, Structure
from hysim.laws.differential.terms import Term

# Clean records: a descent ends where the cost stands still to rounding, and the error is its square root.
EXACT = 1e-6
SIGMAS = 5.0


def close(found, truth):
    """Within five standard errors."""
    return all(abs(found.coefficients[term] - truth[term]) <= SIGMAS * found.stderr[term] for term in truth)


def test_a_measured_memory_has_its_law_exactly():
    found = hs.discover(record_of(LAW.memory), route="memory")
    assert dict(found.coefficients) == pytest.approx(TRUTH, abs=EXACT)
    assert isinstance(found.model, hs.BoucWen)
    assert (found.model.n, found.model.feedthrough, found.model.offset, found.model.gain) == (1.0, 0.0, 0.0, 1.0)
    assert found.route == "memory"
    assert found.verdict == "cannot be told from one rate"


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_a_measured_memory_has_its_law_under_noise(noise):
    found = hs.discover(record_of(LAW.memory, noise=noise), route="memory")
    assert list(found.coefficients) == list(TRUTH)
    assert close(found, TRUTH)
    assert found.coefficients["|u'| z"] == pytest.approx(-0.6, rel=noise)  # less than the noise of one sample


def test_where_noise_hides_the_shape_the_law_of_bouc_and_wen_is_taken():
    """At z = 0.4 and 5 % of noise u' z^2 in place of u' |z| is as likely, and by a chance of the noise likelier."""
    phase, turns = np.arange(240) / 240.0, np.random.default_rng(1).uniform(0.0, 1.0, 6)
    tones = sum(np.sin(2.0 * np.pi * (k * phase + turn)) for k, turn in zip((1, 2, 3, 5, 7, 9), turns, strict=True))
    u = np.tile(0.5 * tones / np.abs(tones).max(), 2)
    record = record_of(LAW.memory, u - u[0], noise=0.05, seed=101)
    found = hs.discover(record, route="memory")
    assert list(found.coefficients) == list(TRUTH)
    other = hs.discover(record, route="memory", library=["u'", "u' z^2", "|u'| z"])
    assert other.scores["bic"] < found.scores["bic"] < other.scores["bic"] + 2.0


def test_at_a_small_amplitude_clean_terms_are_still_told_apart():
    """At z = 0.1 the three terms differ by a tenth."""
    found = hs.discover(record_of(LAW.memory, multisine(amplitude=0.1)), route="memory")
    assert dict(found.coefficients) == pytest.approx(TRUTH, abs=10.0 * EXACT)


@pytest.mark.parametrize("offset", [7.0, -7e3])  # the second is 100 times the distance that the output moves, or so
def test_a_memory_behind_an_output_is_found(offset):
    found = hs.discover(record_of(lambda u: offset + 40.0 * u + 60.0 * LAW.memory(u), noise=0.01), route="output")
    assert list(found.coefficients) == list(TRUTH)
    assert close(found, TRUTH)
    assert found.coefficients["u'"] == 1.0  # the scale of the memory is open: a convention, with no error
    assert found.stderr["u'"] == 0.0
    model = found.model
    assert abs(model.feedthrough - 40.0) <= SIGMAS * found.stderr["feedthrough"]
    assert abs(model.gain - 60.0) <= SIGMAS * found.stderr["gain"]
    assert abs(model.offset - offset) <= SIGMAS * found.stderr["offset"]
    assert found.route == "output"


@pytest.mark.parametrize("slope", [40.0, -40.0])
def test_an_output_may_rise_or_fall_and_its_memory_oppose_it(slope):
    law = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3, n=2.0)
    clean = record_of(lambda u: 5.0 + slope * u - 0.5 * slope * law.memory(u))
    found = hs.discover(clean, route="output", symmetry="odd")
    numbers = [getattr(found.model, name) for name in ("A", "beta", "gamma", "n", "feedthrough", "gain", "offset")]
    truth = [1.0, 0.6, 0.3, 2.0, slope, -0.5 * slope, 5.0]
    assert numbers == pytest.approx(truth, abs=1e3 * EXACT)  # 1e-6 of the stroke


def test_a_cubic_exponent_is_in_a_library_of_degree_3():
    law = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3, n=3.0)
    found = hs.discover(record_of(law.memory, noise=0.01), route="memory", degree=3)
    assert list(found.coefficients) == ["u'", "u' |z| z^2", "|u'| z^3"]
    assert found.model.n == 3.0
    assert close(found, {"u'": 1.0, "u' |z| z^2": -0.3, "|u'| z^3": -0.6})


def test_an_exponent_that_is_no_whole_number_is_found():
    law = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3, n=1.5)
    found = hs.discover(record_of(law.memory), route="memory")
    assert isinstance(found.model, hs.BoucWen)
    assert [getattr(found.model, name) for name in ("A", "beta", "gamma", "n")] == pytest.approx(
        [1.0, 0.6, 0.3, 1.5], abs=EXACT
    )
    assert set(found.coefficients) == {"u'", "|u'| |z|^0.5 z", "u' |z|^1.5"}
    assert found.stderr["n"] < EXACT


def test_records_share_the_law_and_each_has_a_memory_of_its_own():
    other = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3, z0=0.4)
    records = [record_of(LAW.memory, noise=0.01), record_of(other.memory, CYCLES, noise=0.01, seed=1)]
    found = hs.discover(records, route="memory")
    assert list(found.coefficients) == list(TRUTH)
    assert close(found, TRUTH)
    first, second = found.models
    assert found.model == first
    assert second.z0 == pytest.approx(0.4, abs=0.01)  # the noise of one sample
    assert first.z0 == pytest.approx(0.0, abs=0.01)
    assert second == hs.BoucWen(A=first.A, beta=first.beta, gamma=first.gamma, z0=second.z0)
    assert found.n_parameters == len(TRUTH) + 2


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_dahl_law_is_a_bouc_wen_law_without_its_second_term(noise):
    found = hs.discover(record_of(duhem(DAHL), CYCLES, noise=noise), route="memory")
    assert list(found.coefficients) == ["u'", "|u'| z"]
    assert isinstance(found.model, hs.BoucWen)
    tolerance = SIGMAS * noise / math.sqrt(CYCLES.size) + EXACT  # for terms of the order of the stroke
    assert list(found.coefficients.values()) == pytest.approx([1.0, -1.0], abs=tolerance)


def test_a_coleman_hodgdon_law_is_a_dahl_law_beside_a_feedthrough():
    """With y = c u + z the law y' = b u' + a |u'| (c u - y) is z' = (b - c) u' - a |u'| z."""
    found = hs.discover(record_of(duhem(COLEMAN_HODGDON), CYCLES), route="output")
    assert list(found.coefficients) == ["u'", "|u'| z"]
    numbers = found.coefficients["|u'| z"], found.model.feedthrough, found.model.gain
    assert numbers == pytest.approx((-1.0, 3.1635, 0.345 - 3.1635), abs=10.0 * EXACT)


@pytest.mark.parametrize("terms", [COLEMAN_HODGDON, QUADRATIC], ids=["Coleman-Hodgdon", "quadratic"])
def test_the_duhem_library_holds_laws_in_input_and_output(terms):
    found = hs.discover(record_of(duhem(terms), CYCLES), library="duhem")
    assert list(found.coefficients) == list(terms)
    assert dict(found.coefficients) == pytest.approx(terms, abs=EXACT)
    assert isinstance(found.model, hs.Duhem)
    assert found.model.y0 == pytest.approx(0.0, abs=EXACT)


def test_standard_errors_cover_the_truth(monkeypatch):
    """Of 3 coefficients and 8 draws, scores have unit variance: their mean square is 1 within 4 sqrt(2 / 24)."""
    monkeypatch.setattr(_search, "_ENSEMBLE", 1)  # which has no part in it
    scores = []
    for seed in range(8):
        found = hs.discover(
            record_of(LAW.memory, multisine(150), noise=0.02, seed=seed), library=list(TRUTH), derivative="weak"
        )
        scores += [(found.coefficients[term] - TRUTH[term]) / found.stderr[term] for term in TRUTH]
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / len(scores)))


def test_the_true_law_is_searched_for_where_the_descent_of_the_largest_one_ends_far_above_it():
    """The largest laws end near the error of a linear model; the true one has no error."""
    phase = np.arange(240) / 240
    one = np.exp(-3.0 * phase) * np.sin(2.0 * np.pi * (8.0 * phase + 0.6369616873214543))
    u = np.tile(one, 2)
    u = 2.0 * (u - u[0]) / np.abs(u - u[0]).max()
    record = hs.Record(u=u, y=LAW.memory(u), t=np.concatenate([phase, 1.0 + phase / 5.0]))
    found = hs.discover(record, route="memory")
    assert dict(found.coefficients) == pytest.approx(TRUTH, abs=EXACT)


# ---------------------------------------------------------------------------------- Table 1


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
    structure = Structure(tuple(Term.parse(name) for name in names), rest=True)
    start = np.array([[2.2053e-2, 9.2044e-4, -3.1229e-2, -5.3016e-3, -7.6017e-3, 7.1662e-5, 0.0]])
    drifting = FreeRun((table1,)).refine(structure, start, tolerance=1e-12)
    model = hs.Duhem.from_terms(dict(zip(names, drifting.unknowns.tolist(), strict=False)))
    residual = table1.y - model.response(table1.u)
    assert hs.metrics.bic(residual, 6) == pytest.approx(-347.23, abs=0.01)
    assert hs.metrics.bic(residual, 6) < found.scores["bic"]
    assert not drifting.settles()
    lows = model.response(np.concatenate([table1.u, np.tile([125.0, 0.0], 20)]))[-39::2]
    assert lows[-1] < lows[0] - 0.5 * np.ptp(table1.y)  # and each cycle by more than the last
    lows = found.model.response(np.concatenate([table1.u, np.tile([125.0, 0.0], 20)]))[-39::2]
    assert np.ptp(lows) < 0.1  # where the law that is taken comes to rest
