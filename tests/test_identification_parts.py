"""Small parts of an identification: the samples that are left out together, and the words of its message."""

import numpy as np
import pytest
from strategies import assert_refused

import hysim as hs
from hysim.identification import Candidate, _descent, marquardt
from hysim.identification._diagnostics import left_out
from hysim.identification._problem import Problem, problem
from hysim.identification._searched import _phrases
from hysim.identification._uncertainty import _named, uncertainty
from hysim.models.search_space import Freedom

TRIANGLE = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=20)
RECORDS = [hs.Record(u=scale * TRIANGLE, y=TRIANGLE) for scale in (1.0, 2.0)]


def test_two_records_are_two_folds_and_one_is_refused():
    found = left_out("records", RECORDS)
    assert [fold.tolist() for fold in found] == [[*range(61)], [*range(61, 122)]]
    assert_refused("at least 2 records", left_out, "records", RECORDS[:1])


def test_cycles_of_every_record_are_folds_but_its_first():
    """From -1: the turns are at samples 10, 20, ..., and every second of them, from 20 on, begins a cycle."""
    found = left_out("cycles", RECORDS)
    assert [(fold[0], fold[-1]) for fold in found] == [(20, 39), (40, 60), (81, 100), (101, 121)]
    assert all((np.diff(fold) == 1).all() for fold in found)
    assert_refused("at least 2 cycles", left_out, "cycles", [record[:15] for record in RECORDS])


def test_only_an_input_that_never_turns_is_said_not_to():
    """Whatever the size of its steps."""
    for u, turns in ((TRIANGLE, True), (np.linspace(0.0, 1.0, 61), False), (np.linspace(5.0, -9.0, 61), False)):
        fit = hs.identify(hs.Line, hs.Record(u=u, y=2.0 * u + 0.1 * np.cos(7.0 * np.arange(61))))
        assert ("never turns back" not in fit.message) == turns


@pytest.mark.parametrize(
    ("direction", "named"),
    [([0.4, 0.04], "ab"), ([0.4, 0.01], "a"), ([0.0, 4.0], "b"), ([1.0, 1.0], "ab")],
)
def test_a_parameter_takes_part_in_a_direction_from_a_twentieth_of_the_largest_share_on(direction, named):
    assert _named(("a", "b"), np.array(direction), np.ones(2)) == tuple(named)


@pytest.mark.parametrize(
    ("n_rivals", "words"), [(1, "1 other optimum within the noise"), (2, "2 other optima within the noise")]
)
def test_other_optima_are_counted(n_rivals, words):
    whole = problem(hs.Dahl(), RECORDS[:1], Freedom({}, (), {}), None)
    theta = np.zeros(len(whole.space.coordinates) + len(whole.space.linear))
    known = uncertainty(whole, theta, np.ones(whole.y.size))
    rival = Candidate(model=hs.Dahl(), estimates={}, fit_percent=90.0, rmse=0.1)
    assert words in _phrases(True, whole, known, [rival] * n_rivals, {})


def long_record():
    """20 cycles of growing amplitude that begin between two reversals, with 0.5 % of noise."""
    phase = np.linspace(0.9, 40.0 * np.pi, 3001)
    u = np.linspace(0.5, 1.0, phase.size) * np.sin(phase)
    y = hs.BoucWen(beta=1.4, gamma=-0.6, feedthrough=0.7, gain=-0.5).response(u)
    return hs.Record(u=u, y=y + 0.005 * np.random.default_rng(3).standard_normal(u.size), t=0.01 * np.arange(u.size))


def test_a_search_on_a_thinned_record_ends_in_the_optimum_of_the_search_on_all_samples(monkeypatch):
    thinned = hs.identify(hs.BoucWen, long_record(), fixed={"n": 1.0})
    monkeypatch.setattr(Problem, "thinned", lambda *_: None)
    monkeypatch.setattr(_descent, "_MOST_AT_ONCE", 1)  # sets descend one by one, and rows are taken in pieces, as on
    monkeypatch.setattr(marquardt, "_LONG", 100)  # records of more than 100 000 samples
    whole = hs.identify(hs.BoucWen, long_record(), fixed={"n": 1.0})
    assert thinned.rmse == pytest.approx(whole.rmse, rel=1e-9)
    assert thinned.residual.size == 3001
    for name in whole.free_names:  # each descent ends where a step gains 2e-8 of the sum of squares
        assert thinned.estimates[name] == pytest.approx(whole.estimates[name], abs=0.01 * whole.stderr[name])


def test_a_thinned_record_keeps_ends_and_reversals_and_the_outputs_of_a_law():
    record = long_record()
    whole = problem(hs.BoucWen(), [record], Freedom(), None)
    short = whole.thinned(250)
    u = short.parts[0].record.u
    assert 250 <= u.size <= 250 + record.reversals(tolerance=0.01).size
    assert set(record.u[[0, -1, *record.reversals(tolerance=0.01)]]) <= set(u)
    x = 0.5 * (whole.space.lower + whole.space.upper)[np.newaxis]
    places = np.searchsorted(record.t, record.t[np.isin(record.u, u)])
    np.testing.assert_allclose(short.split(x)[0][0], whole.split(x)[0][0, places], atol=1e-12)  # rounding


def test_a_record_is_not_thinned_for_a_model_that_depends_on_time_or_where_it_would_stay_long():
    record = long_record()
    assert problem(hs.TransferFunction.structure(poles=1, zeros=0), [record], Freedom(), None).thinned(250) is None
    assert problem(hs.BoucWen(), [record[:400]], Freedom(), None).thinned(250) is None
