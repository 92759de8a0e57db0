"""Small parts of an identification: the samples that are left out together, and the words of its message."""

import numpy as np
import pytest

import hysim as hs
from hysim.identification import Candidate
from hysim.identification._problem import problem
from hysim.identification._searched import _phrases
from hysim.identification._uncertainty import _named, uncertainty
from hysim.identification.folds import left_out
from hysim.models.search_space import Freedom

TRIANGLE = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=20)
RECORDS = [hs.Record(u=scale * TRIANGLE, y=TRIANGLE) for scale in (1.0, 2.0)]


def test_two_records_are_two_folds_and_one_is_refused():
    found = left_out("records", RECORDS)
    assert [fold.tolist() for fold in found] == [[*range(61)], [*range(61, 122)]]
    with pytest.raises(ValueError, match="at least 2 records"):
        left_out("records", RECORDS[:1])


def test_cycles_of_every_record_are_folds_but_its_first():
    """From -1: the turns are at samples 10, 20, ..., and every second of them, from 20 on, begins a cycle."""
    found = left_out("cycles", RECORDS)
    assert [(fold[0], fold[-1]) for fold in found] == [(20, 39), (40, 60), (81, 100), (101, 121)]
    assert all((np.diff(fold) == 1).all() for fold in found)
    with pytest.raises(ValueError, match="at least 2 cycles"):
        left_out("cycles", [record[:15] for record in RECORDS])


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
