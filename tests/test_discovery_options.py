"""What `discover` is told: library, symmetry, signs, optimizer, form of the slope; and what it refuses."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from discovered import CYCLES, DAHL, LAW, TRUTH, duhem, multisine, record_of, zigzag
from strategies import assert_refused, refused

import hysim as hs
from hysim.discovery import _discover, _refinement
from hysim.discovery._refinement import FreeRun
from hysim.discovery._search import MOST_WORK, Library, Options, searched
from hysim.laws.differential.duhem_runs import free_runs
from hysim.laws.differential.terms import memory_terms

RECORD = record_of(LAW.memory, multisine(200), noise=0.01)
NAMES = list(TRUTH)


@pytest.mark.parametrize(("initial", "n_parameters"), [("auto", 3), ("rest", 3), ("free", 4)])
def test_a_memory_begins_at_rest_or_at_a_number_of_its_own(initial, n_parameters):
    found = hs.discover(RECORD, route="memory", degree=1, initial=initial)
    assert list(found.coefficients) == NAMES
    assert found.n_parameters == n_parameters
    assert (found.model.z0 == 0.0) is (initial != "free")
    assert ("held at zero" in found.message) is (initial != "free")


def test_a_memory_that_does_not_begin_at_rest_is_not_held_there():
    record = record_of(hs.BoucWen(A=1.0, beta=0.6, gamma=0.3, z0=0.3).memory, multisine(200), noise=0.01)
    found = hs.discover(record, route="memory", degree=1)
    assert found.n_parameters == len(found.coefficients) + 1
    assert found.model.z0 == pytest.approx(0.3, abs=0.02)  # the noise of a few samples


@pytest.mark.parametrize(("u0", "n_parameters"), [(0.0, 2), (0.5, 3)])
def test_a_duhem_law_begins_at_rest_only_where_its_input_is_zero(u0, n_parameters):
    """y = 0 says something about the actuator at u = 0 alone; elsewhere it is where the instrument has its zero."""
    found = hs.discover(record_of(duhem(DAHL), CYCLES + u0), library=["u'", "|u'| y", "|u'|"])
    assert list(found.coefficients) == list(DAHL)
    assert found.n_parameters == n_parameters


def test_the_search_does_not_look_at_samples_that_are_left_out():
    """Nothing about the law changes with the outputs that it has not seen."""
    seen = np.random.default_rng(3).uniform(size=len(RECORD)) > 0.1
    seen[0] = False
    library = Library(memory_terms(1), "z", rests=(False, True))
    found, spoilt = (
        searched(
            (hs.Record(u=RECORD.u, y=np.where(seen, RECORD.y, unseen)),), library, Options(), masks=(seen,)
        ).candidate
        for unseen in (RECORD.y, 1e3)
    )
    assert found.structure == spoilt.structure
    assert found.unknowns.tolist() == spoilt.unknowns.tolist()


def test_cross_validation_repeats_the_whole_search(monkeypatch):
    laws, every = [], []

    def searched_and_noted(records, library, options, *, best, masks=None):
        outcome = searched(records, library, options, best=best, masks=masks)
        laws.append(outcome.candidate)
        every.append(masks)
        return outcome

    monkeypatch.setattr(_discover, "searched", searched_and_noted)
    record, done = record_of(LAW.memory, multisine(120), noise=0.01), []
    found = hs.discover(record, library=NAMES, route="memory", cross_validate=3, progress=lambda *at: done.append(at))
    folds = np.array_split(np.arange(len(record)), 3)
    assert every[0] is None
    assert [np.flatnonzero(~seen).tolist() for (seen,) in every[1:]] == [f.tolist() for f in folds]
    free_run = FreeRun((record,))
    errors = [
        free_run.residuals(law.structure, law.unknowns[np.newaxis])[0, fold]
        for law, fold in zip(laws[1:], folds, strict=True)
    ]
    assert found.cv_rmse == pytest.approx(np.sqrt(np.mean(np.concatenate(errors) ** 2)) * np.ptp(record.y), rel=1e-12)
    assert found.cv_rmse > found.scores["rmse"]
    assert done[-4:] == [(20, 80), (40, 80), (60, 80), (80, 80)]  # the search, and each fold


OPTIMIZERS = [{"optimizer": name, "degree": 1} for name in ("SR3", "SSR", "FROLS")]


@pytest.mark.parametrize("options", [*OPTIMIZERS, {"derivative": "smoothed"}, {"derivative": "weak"}], ids=str)
def test_every_optimizer_and_both_forms_of_the_slope_lead_to_the_law(options):
    assert list(hs.discover(RECORD, route="memory", **options).coefficients) == NAMES


def test_a_library_is_a_list_of_names():
    found = hs.discover(RECORD, library=NAMES, route="memory")
    assert list(found.inclusion) == list(found.coefficients) == NAMES
    named_y = hs.discover(record_of(duhem(DAHL), CYCLES), library=["u'", "u' y", "|u'| y"])
    assert isinstance(named_y.model, hs.Duhem)
    assert dict(named_y.coefficients) == pytest.approx(DAHL, abs=1e-6)  # the root of rounding


def test_an_odd_law_is_found_in_the_odd_library():
    found = hs.discover(RECORD, symmetry="odd", route="memory")
    assert list(found.coefficients) == NAMES
    assert set(found.inclusion) == {"u'", "u' |z|", "u' z^2", "|u'| z", "|u'| |z| z"}


def test_an_even_law_is_found_in_the_even_library():
    butterfly = {"u' u": 1.0, "|u'|": 0.3, "|u'| y": -0.5}
    found = hs.discover(record_of(duhem(butterfly), CYCLES), library="duhem", symmetry="even")
    assert dict(found.coefficients) == pytest.approx(butterfly, abs=1e-6)  # the root of rounding


def test_a_wrong_sign_leaves_the_term_out_and_a_right_one_changes_nothing():
    right = hs.discover(RECORD, library=NAMES, signs={"u' |z|": -1, "|u'| z": -1}, route="memory")
    assert list(right.coefficients) == NAMES
    wrong = hs.discover(RECORD, signs={"u' |z|": 1}, route="memory")
    assert "u' |z|" not in wrong.coefficients
    assert wrong.scores["rmse"] > right.scores["rmse"]


def test_units_do_not_decide_what_is_found():
    """A threshold is a number without unit: kilovolts and nanometres give the same structure, rescaled."""
    found = hs.discover(RECORD, library=NAMES, route="memory")
    rescaled = hs.discover(hs.Record(u=1e3 * RECORD.u, y=1e-9 * RECORD.y), library=NAMES, route="memory")
    assert list(rescaled.coefficients) == NAMES
    scales = {"u'": 1e-12, "u' |z|": 1e-3, "|u'| z": 1e-3}
    for name, scale in scales.items():
        # the descent ends where a step changes the cost by 1e-12 of it: its root in the numbers
        assert rescaled.coefficients[name] == pytest.approx(scale * found.coefficients[name], rel=1e-5)


def test_terms_that_a_record_cannot_tell_apart_are_left_out_by_name():
    u = zigzag(0.0, 1.0, 0.0)
    found = hs.discover(hs.Record(u=u, y=3.0 * u), library="duhem")
    assert {"u' y", "u' u y", "u' y^2"} <= set(found.left_out)
    assert dict(found.coefficients) == pytest.approx({"u'": 3.0}, rel=1e-9)  # a line is fitted to rounding
    assert found.verdict == "no structure found"


def test_a_curve_without_a_loop_has_no_structure():
    u = zigzag(0.0, 2.0, -2.0, 2.0)
    found = hs.discover(hs.Record(u=u, y=np.tanh(u)), library="duhem")
    assert found.verdict == "no structure found"
    assert dict(found.coefficients) == pytest.approx({"u'": 1.0, "u' y^2": -1.0}, abs=1e-6)  # the root of rounding


def test_a_line_with_noise_has_no_structure():
    u = zigzag(0.0, 2.0, -2.0, 2.0)
    found = hs.discover(
        hs.Record(u=u, y=2.0 * u + 0.01 * np.random.default_rng(0).standard_normal(u.size)), route="memory"
    )
    assert found.verdict == "no structure found"
    assert found.model.response(u) == pytest.approx(2.0 * u, abs=0.01)  # far less than the loops of a law


def test_a_lag_under_one_triangle_cannot_be_told_from_hysteresis():
    u = np.tile(zigzag(0.0, 1.0, -1.0, 0.0, per_branch=12), 2)
    y = np.array(list(itertools.accumulate(u[1:], lambda last, now: last + 0.3 * (now - last), initial=0.0)))
    found = hs.discover(hs.Record(u=u, y=y), library="duhem", degree=1)
    assert found.scores["fit_percent"] > 95.0  # a fine law, and no hysteresis at all
    assert found.verdict == "cannot be told from one rate"


test_records_without_the_information_are_refused = refused(
    (np.linspace(0, 1, 30), np.linspace(0, 1, 30) ** 2, "needs a rising and a falling branch"),
    (np.ones(30), np.arange(30.0), "the input is constant"),
    (zigzag(0, 1, 0), np.ones(59), "the output is constant"),
    (zigzag(0, 1, 0), 3.0 + 1e-12 * (np.arange(59) == 5), "every law that was tried diverges"),
    (np.tile([0.0, 1.0], 20), np.tile([0.0, 1.0], 20), "at least 4 samples each"),
    (
        zigzag(0, 1, 0, per_branch=5),
        zigzag(0, 1, 0, per_branch=5),
        "10 terms and y0 cannot be estimated from 9 samples",
    ),
    call=lambda u, y: hs.discover(hs.Record(u=u, y=y), derivative="smoothed"),
)


def test_a_monotone_loading_is_refused_in_every_form():
    u = np.linspace(0.0, 1.0, 200)
    for derivative in ("auto", "smoothed", "weak"):
        with pytest.raises(ValueError, match="needs a rising and a falling branch"):
            hs.discover(hs.Record(u=u, y=np.sin(u)), derivative=derivative)


test_options_are_checked = refused(
    ({"route": "input"}, "route must be one of auto, memory, output, got 'input'"),
    ({"degree": -1}, "degree must be a whole number from 0 up, got -1"),
    ({"degree": True}, "degree must be a whole number"),
    ({"library": "fourier"}, 'library must be "bouc-wen", "duhem" or names of terms'),
    ({"library": []}, "a list of different terms"),
    ({"library": ["u'", "u'"]}, "a list of different terms"),
    ({"library": ["u' y", "|u'|  z"]}, "unknown term"),
    ({"library": "duhem", "route": "output"}, "has its feedthrough in the terms"),
    ({"symmetry": "none"}, 'symmetry must be None, "odd" or "even"'),
    ({"signs": {"u' z^9": 1}}, "'u' y\\^9' is not in the library|\"u' y\\^9\" is not in the library"),
    ({"signs": {"u'": 2}}, "must be 1 or -1, got 2"),
    ({"optimizer": "lasso"}, "optimizer must be one of STLSQ, SR3, SSR, FROLS, got 'lasso'"),
    *(
        ({"optimizer": name}, ImportError, rf"{name} needs its extra: pip install 'pysindy\[")
        for name in ("ConstrainedSR3", "MIOSR", "SBR")
    ),
    ({"derivative": "spline"}, "derivative must be one of auto, smoothed, weak, got 'spline'"),
    ({"initial": "periodic"}, "initial must be one of auto, free, rest, got 'periodic'"),
    ({"cross_validate": 1}, 'cross_validate must be "loo"'),
    ({"cross_validate": "all"}, 'cross_validate must be "loo"'),
    ({"route": "oscillator"}, "an oscillator has its own verb: hs.discover_oscillator"),
    ({"library": NAMES, "degree": 3}, "degree is not used with a library of names: leave it out"),
    call=lambda options: hs.discover(RECORD, **options),
)


def test_an_oscillators_records_are_pointed_to_their_own_verb():
    t = np.arange(100) / 250.0
    u = 60.0 * np.sin(2.0 * np.pi * (20.0 + 40.0 * t) * t)
    plant = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=hs.BoucWen(A=5e4, beta=800.0, gamma=-300.0))
    record = hs.Record(u=u, y=plant.response(u, t[1]), t=t)
    assert "use hs.discover_oscillator" in hs.discover(record, library=NAMES).warnings[-1]
    uneven = replace(record, t=t**1.1)
    assert "discover_oscillator" not in " ".join(hs.discover(uneven, library=["u'"]).warnings)


test_only_records_are_taken_and_at_least_one_is_needed = refused(
    *(
        (hs.discover, given, TypeError, "discover takes")
        for given in (CYCLES, [CYCLES], None, {"u": CYCLES, "y": CYCLES})
    ),
    *((verb, [], "no record was given") for verb in (hs.discover, hs.discover_oscillator)),
    call=lambda verb, given: verb(given),
)


def test_a_gap_is_refused_where_the_record_is_made():
    y = RECORD.y.copy()
    y[7] = np.nan
    assert_refused("y must be finite, got nan at index 7", hs.Record, u=RECORD.u, y=y)


@pytest.mark.parametrize("library", [NAMES, "duhem"])
def test_progress_counts_up_to_its_total(library):
    calls = []
    degree = {"degree": 1} if library == "duhem" else {}
    hs.discover(RECORD, library=library, **degree, progress=lambda done, total: calls.append((done, total)))
    done, totals = np.array(calls).T
    assert set(totals) == {20}
    assert (np.diff(done) > 0).all()
    assert done[0] <= 2
    assert done[-1] == 20


def test_a_search_among_stiff_laws_ends_at_its_limit_of_work(monkeypatch):
    counted = []

    def runs_and_count(*arguments, **named):
        runs, terms = free_runs(*arguments, **named)
        counted.append(terms)
        return runs, terms

    monkeypatch.setattr(_refinement, "free_runs", runs_and_count)
    u = np.cumsum(np.random.default_rng(0).standard_normal(80))
    record = hs.Record(u=u, y=hs.Play(threshold=0.005 * np.ptp(u)).response(u))
    found = hs.discover(record)
    assert "stopped at its limit of work" in found.message
    assert found.scores["fit_percent"] > 99.0
    assert sum(counted) < 2.5 * MOST_WORK * len(record)  # two libraries, and the judgement
    smooth = len(counted)
    assert "limit of work" not in hs.discover(RECORD, degree=1).message
    assert sum(counted[smooth:]) < MOST_WORK * len(RECORD)
