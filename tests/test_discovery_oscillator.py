"""A hidden memory's law is found from an oscillator's input and output, and none is found where there is none."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import assert_refused, needs_compiled, refused

import hysim as hs
from hysim.discovery import _oscillator
from hysim.discovery._hidden_memory import cases
from hysim.discovery._oscillator import Search, diverges, recorded
from hysim.identification import identify
from hysim.laws.differential.terms import RELAXATION, Term, bouc_wen_terms, memory_terms

STEP = 1.0 / 750.0
TRUTH = {"u'": 5e4, "|u'| z": -800.0, "u' |z|": 300.0}
PLANT = {"mass": 2.0, "damping": 10.0, "stiffness": 5e4}


def record(noise: float = 0.0, n_samples: int = 600, **numbers: float) -> hs.Record:
    """From rest, a chirp through the resonance; noise as a share of the output's rms."""
    shape = {"A": 5e4, "beta": 800.0, "gamma": -300.0} | numbers
    plant = hs.BoucWenOscillator(**PLANT, law=hs.BoucWen(**shape), substeps=4)
    t = STEP * np.arange(n_samples)
    u = 60.0 * np.sin(2.0 * np.pi * (20.0 + 20.0 * t / t[-1]) * t)
    y = plant.response(u, STEP)
    return hs.Record(u=u, y=y + noise * y.std() * np.random.default_rng(1).standard_normal(t.size), t=t)


@pytest.fixture(scope="module")
def noisy() -> hs.OscillatorDiscovery:
    return hs.discover_oscillator([record(noise=0.01)])


@needs_compiled
def test_without_noise_the_law_comes_back_exactly_and_with_no_other_term():
    found = hs.discover_oscillator([record()])
    assert found.verdict == "rate-independent hysteresis"
    assert set(found.coefficients) == set(TRUTH)
    for name, value in TRUTH.items():
        assert found.coefficients[name] == pytest.approx(value, rel=1e-7)  # the search ends at 1e-10 of the squares
    assert found.parameters == pytest.approx(PLANT, rel=1e-7)
    assert found.model.law.beta == -found.coefficients["|u'| z"]
    assert found.model.law.gamma == -found.coefficients["u' |z|"]


@needs_compiled
def test_with_noise_the_same_terms_come_within_their_standard_errors(noisy):
    assert set(noisy.coefficients) == set(TRUTH)
    for name, value in TRUTH.items():
        assert abs(noisy.coefficients[name] - value) < 4.0 * noisy.stderr[name]  # one in 16 000 is farther off
        assert noisy.inclusion[name] >= 0.9
    assert noisy.scores["rmse"] < noisy.scores["held_out_rmse"] < 0.1 * noisy.scores["linear_rmse"]
    assert noisy.scores["linear_rmse"] < noisy.scores["linear_held_out_rmse"]  # its plant is left out too
    assert noisy.path_bic.min() == noisy.path_bic[noisy.path_n_terms == 3].min()
    assert len(noisy.inclusion) + len(noisy.left_out) == 15


@needs_compiled
def test_before_refinement_the_regression_is_off_by_no_more_than_what_noise_does_to_a_path(noisy):
    for name, value in TRUTH.items():
        assert noisy.regressed[name] == pytest.approx(value, rel=0.2)  # of 600 samples with 1 % noise on each


@needs_compiled
def test_the_same_seed_gives_the_same_bits(noisy):
    assert hs.discover_oscillator([record(noise=0.01)]) == noisy


@needs_compiled
def test_what_is_given_of_the_plant_is_kept():
    found = hs.discover_oscillator([record(noise=0.01)], **PLANT)
    assert found.parameters == PLANT
    assert set(found.stderr) == set(found.coefficients) == set(TRUTH)


@needs_compiled
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_linear_spring_has_no_memory(noise):
    found = hs.discover_oscillator([record(noise=noise, beta=0.0, gamma=0.0)])
    assert found.verdict == "no structure found"
    assert found.equation.startswith("z' = 0, ")
    assert found.coefficients == {}
    assert found.model.law.A == 0.0
    assert found.parameters["stiffness"] == pytest.approx(1e5, rel=0.01)  # of both springs; 2 % noise on 600 samples


@needs_compiled
def test_terms_that_a_law_has_not_are_left_out_and_n_is_found():
    assert set(hs.discover_oscillator([record(noise=0.01, n_samples=400, gamma=0.0)]).coefficients) == {"u'", "|u'| z"}
    squared = hs.discover_oscillator([record(noise=0.01, beta=20.0, gamma=-10.0, n=2.0)])
    assert set(squared.coefficients) == {"u'", "|u'| |z| z", "u' z^2"}
    assert squared.model.law.n == 2.0


@needs_compiled
@pytest.mark.parametrize(("n", "beta", "gamma"), [(1.0, 800.0, -300.0), (1.5, 140.0, -50.0)])
def test_the_exponent_is_freed_only_where_the_bic_is_lower(n, beta, gamma, monkeypatch):
    """The exponent with which the regression begins does not decide."""
    given = record(noise=0.01, n_samples=300, beta=beta, gamma=gamma, n=n)
    monkeypatch.setattr(Search, "_begun", lambda self, elastic: self._refined(*self._starts(2.0)))
    found = hs.discover_oscillator([given])
    held, free = (identify(hs.BoucWenOscillator.structure(), given, fixed=fixed).bic for fixed in ({"n": 1.0}, {}))
    assert (held < free) == (n == 1.0) == ("n" not in found.stderr)
    assert found.scores["bic"] == pytest.approx(min(held, free), abs=0.01)  # the floor adds 1e-6 of the variance to it
    assert found.model.law.n == n if n == 1.0 else found.model.law.n == pytest.approx(n, abs=0.2)
    # the same d counts on the path: the law is on it, with its terms as the regression leaves them
    assert found.scores["bic"] == pytest.approx(found.path_bic[found.path_n_terms == 3].min(), abs=0.5)


@needs_compiled
def test_the_law_itself_is_among_the_structures_that_are_compared(noisy):
    assert set(TRUTH) in [set(terms.split(", ")) for terms in noisy.path_terms]


@needs_compiled
def test_a_law_that_diverges_is_no_structure(monkeypatch):
    monkeypatch.setattr(_oscillator, "diverges", lambda found, y: True)
    found = hs.discover_oscillator([record(noise=0.01, n_samples=300)])
    assert found.verdict == "no structure found"
    assert found.coefficients == {}
    assert found.warnings[0].startswith("A law of lower BIC diverges")
    monkeypatch.setattr(Search, "_begun", lambda self, elastic: self._refined())
    found = hs.discover_oscillator([record(noise=0.01, n_samples=300)])
    assert (found.verdict, found.model.law.A) == ("no structure found", 0.0)
    assert "could not be refined: the oscillator nearest to the records diverges" in found.warnings[0]


def test_a_memory_without_bound_diverges_over_a_wide_range_alone():
    law = hs.BoucWen(A=1.0, beta=-0.5, gamma=-0.5, n=2.0)  # it grows without bound after a stroke of pi / 2
    plant = hs.BoucWenOscillator(mass=1.0, damping=1.0, stiffness=1.0, law=law)
    assert diverges(plant, np.array([-2.0, 2.0]))
    assert not diverges(plant, np.array([-0.1, 0.1]))
    assert diverges(hs.TransferFunction(num=(1.0,), den=(1.0, -1.0)), np.array([-0.1, 0.1]))


@needs_compiled
def test_a_relaxation_is_no_hysteresis():
    u = record().u
    m, c, k = PLANT.values()
    y, v, z = np.zeros(u.size), 0.0, 0.0
    fine = np.interp(np.arange((u.size - 1) * 200) / 200.0, np.arange(u.size), u)
    at, h = 0.0, STEP / 200.0
    for i, force in enumerate(fine):  # semi-implicit Euler: off by 0.1 %, far less than the relaxation does
        v += h * (force - c * v - k * at - z) / m
        at += h * v
        z += h * (5e4 * v - 100.0 * z)
        if (i + 1) % 200 == 0:
            y[(i + 1) // 200] = at
    y += 0.01 * y.std() * np.random.default_rng(0).standard_normal(y.size)
    found = hs.discover_oscillator([hs.Record(u=u, y=y, t=STEP * np.arange(u.size))])
    assert found.verdict == "linear lag"
    assert found.coefficients["z"] == pytest.approx(-100.0, rel=0.05)
    y_of_model = found.model.response(u, STEP)
    assert np.sqrt(np.mean((y_of_model - y) ** 2)) == pytest.approx(found.scores["rmse"], rel=1e-3)  # its own steps


@needs_compiled
def test_a_short_record_ends_in_a_result_and_in_no_warning_of_another_library():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = hs.discover_oscillator(record(n_samples=200)[:40])
    assert found.summary()
    assert hs.OscillatorDiscovery.from_json(found.to_json()) == found


def test_how_a_record_was_made_is_seen():
    assert recorded(record()).initial == "rest"
    phases = np.random.default_rng(0).random(6)
    t = STEP * np.arange(128)
    u = sum(np.sin(2.0 * np.pi * ((k + 3) / t.size * np.arange(t.size) + phase)) for k, phase in enumerate(phases))
    steady = hs.Record(u=np.tile(u, 3), y=np.tile(np.roll(u, 3), 3), t=STEP * np.arange(384))
    assert recorded(steady).period == 128
    fading = replace(steady, y=steady.y + np.exp(-np.arange(384) / 40.0))
    assert recorded(fading).initial == "rest"


def at_times(t):
    return lambda _: hs.Record(u=np.sin(np.arange(99.0)), y=np.sin(np.arange(99.0)), t=t)


test_a_record_that_cannot_do_is_refused = refused(
    (at_times(None), "no time"),
    (at_times(np.arange(99.0) ** 1.1), "evenly spaced"),
    (lambda rec: rec[:20], "more than 30 samples"),
    (lambda rec: replace(rec, u=np.ones(600)), "input is constant"),
    (lambda rec: replace(rec, y=np.ones(600)), "output is constant"),
    (lambda rec: replace(rec, y=-rec.y), "sign of u and y"),
    call=lambda changed: hs.discover_oscillator([changed(record())]),
)


test_an_option_that_cannot_do_is_refused = refused(
    ({"degree": 4}, "degree must be one of 1, 2, 3"),
    ({"symmetry": "even"}, 'symmetry must be None or "odd"'),
    ({"mass": -1.0}, "mass must be positive"),
    ({"damping": float("nan")}, "damping must be finite"),
    ({"mass": "3"}, TypeError, "mass must be a number, got '3'"),
    ({"stiffness": True}, TypeError, "stiffness must be a number, got True"),
    ({"structure": hs.BoucWenOscillator.structure(excitation="base")}, "must be a force"),
    ({"structure": "newmark"}, TypeError, "structure comes from"),
    call=lambda options: hs.discover_oscillator([record()], **options),
)


@pytest.mark.parametrize("given", [[1.0], None, {"u": 1.0}])
def test_only_records_are_taken(given):
    assert_refused("discover_oscillator takes a Record or several", hs.discover_oscillator, given, error=TypeError)


def test_the_library_has_names_of_its_own():
    names = [term.named("z") for term in (*memory_terms(3), RELAXATION)]
    assert len(set(names)) == len(names) == 15
    assert {*TRUTH, "|u'| |z| z", "u' z^2", "|u'| z^3", "u' |z| z^2", "z"} <= set(names)
    assert sum(term.is_odd for term in (*memory_terms(3), RELAXATION)) == 8
    assert [term.name for term in bouc_wen_terms(1.5)] == ["u'", "|u'| |z|^0.5 z", "u' |z|^1.5"]


@given(st.sampled_from(memory_terms(3)), st.sampled_from([-1.0, 1.0]), st.floats(-2.0, 2.0))
def test_the_cases_of_a_term_are_its_name_read_literally(term: Term, rate: float, z: float):
    words = {"u'": rate, "|u'|": abs(rate), "z": z, "|z|": abs(z), "z^2": z**2, "z^3": z**3}
    literal = np.prod([words[word] for word in term.named("z").split()])
    case = cases(term, 3)[int(rate > 0.0), int(z > 0.0)]
    assert np.polyval(case[::-1], z) == pytest.approx(literal, abs=1e-14)  # rounding of z^3 to 8
