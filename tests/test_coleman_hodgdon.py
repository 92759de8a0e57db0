"""The backlash-like Duhem law against its closed form, the polynomial Duhem law, and its own promises."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import lambertw
from strategies import assert_cut_or_stepped_it_has_the_same_bits, refused, short_inputs

import hysim as hs

SU = hs.ColemanHodgdon(alpha=1.0, c=3.1635, B=0.345)
PATH = np.array([0.0, 0.1, 0.7, 2.0, 2.0, 1.1, 1.4, -0.6, -2.0, -2.0, 0.3, 1.7])


@st.composite
def laws(draw) -> hs.ColemanHodgdon:
    number = st.floats(-3.0, 3.0)
    return hs.ColemanHodgdon(
        alpha=draw(st.floats(0.01, 20.0)), c=draw(number), B=draw(number), offset=draw(number), z0=draw(number)
    )


def closed_form(law: hs.ColemanHodgdon, u: np.ndarray) -> np.ndarray:
    """y on each monotone segment of u, as printed, with the offset."""
    line = law.offset + law.c * u
    y = [line[0] + law.z0]
    for k, (start, end) in enumerate(itertools.pairwise(u)):
        decay = math.exp(-law.alpha * abs(end - start))
        beside = np.sign(end - start) * (law.B - law.c) * (1.0 - decay) / law.alpha
        y.append(line[k + 1] + (y[-1] - line[k]) * decay + beside)
    return np.array(y)


@given(laws(), short_inputs(2.0))
def test_it_is_the_closed_form(law, u):
    expected = closed_form(law, u)
    # A few roundings of the line's height, and of (1 - exp(-x)) / x as it is written here, at each of 90 samples.
    assert np.abs(law.response(u) - expected).max() < 1e-13 * max(1.0, np.abs(expected).max())


@given(laws(), short_inputs(2.0))
def test_it_is_the_polynomial_duhem_law(law, u):
    terms = {"u'": law.B, "|u'|": law.alpha * law.offset, "|u'| u": law.alpha * law.c, "|u'| y": -law.alpha}
    duhem = hs.Duhem.from_terms(terms, y0=law.response(u)[0])
    y = law.response(u)
    assert np.abs(duhem.response(u) - y).max() < 1e-10 * max(1.0, np.abs(y).max())  # an integrated law's promise


@given(laws(), short_inputs(), st.data())
def test_cut_stepped_or_in_batch_it_is_the_same_bits(law, u, data):
    assert_cut_or_stepped_it_has_the_same_bits(law, u, data.draw(st.integers(1, u.size)))
    sets = {name: [1.0, getattr(law, name)] for name in ("alpha", "c", "B", "offset", "z0")}
    assert np.array_equal(hs.ColemanHodgdon.responses(sets, u)[1], law.response(u))


@given(st.floats(0.05, 10.0), st.floats(0.5, 3.0), st.floats(0.55, 0.99), short_inputs(2.0))
def test_the_inverse_undoes_the_response(alpha, c, steepness, u):
    """B between c / 2 and c: the slope right after a reversal, 2 B - c at the least, is positive."""
    law = hs.ColemanHodgdon(alpha=alpha, c=c, B=steepness * c)
    y = law.response(u)
    back = law.inverse_response(y, u0=u[0])
    assert np.abs(law.response(back) - y).max() < 1e-11 * max(1.0, np.ptp(y))
    assert np.array_equal(back[1:][np.diff(u) == 0.0], back[:-1][np.diff(u) == 0.0])


@pytest.mark.parametrize("du", [0.3, -0.7])
def test_the_inverse_of_one_stretch_is_lamberts(du):
    """c L + s z + (1 - e^(-alpha L)) ((B - c)/alpha - s z) = s dy in L, which W solves."""
    law = hs.ColemanHodgdon(alpha=2.0, c=1.0, B=0.8, z0=0.05)
    sign = math.copysign(1.0, du)
    gap = float(np.diff(law.response([0.0, du]))[0]) * sign
    K = (law.B - law.c) / law.alpha - sign * law.z0
    q = gap - K
    W = lambertw(law.alpha * K / law.c * math.exp(-law.alpha * q / law.c)).real
    length = q / law.c + W / law.alpha
    assert length == pytest.approx(abs(du), rel=1e-14)  # a few roundings
    assert law.inverse_response(law.response([0.0, du]), u0=0.0)[1] == pytest.approx(sign * length, rel=1e-14)


def test_an_output_without_an_inverse_is_refused():
    """B below c / 2: right after a reversal from saturation the output goes back."""
    with pytest.raises(hs.SimulationError, match="has no inverse at sample"):
        SU.inverse_response(SU.response([0.0, 5.0, -5.0]), u0=0.0)


def test_the_loop_of_a_long_way_is_as_wide_as_its_saturation():
    """Both branches run at |B - c| / alpha beside the line."""
    u = hs.signals.triangle(-40.0, 40.0, cycles=2, samples_per_cycle=80)
    loop = hs.loop_metrics(u, SU.response(u))
    assert loop.mid_width == pytest.approx(2.0 * SU.saturation, rel=1e-14)  # e^-40 is below rounding
    assert loop.orientation == "counterclockwise"


def test_identify_recovers_it_by_a_search_in_one_coordinate():
    truth = hs.ColemanHodgdon(alpha=1.7, c=0.9, B=0.6, offset=0.3, z0=-0.1)
    record = hs.Record(u=PATH, y=truth.response(PATH))
    fit = hs.identify(hs.ColemanHodgdon, record)
    assert fit.free_names == ("alpha", "c", "B", "offset", "z0")
    assert fit.estimates == pytest.approx({name: getattr(truth, name) for name in fit.free_names}, rel=1e-7)
    assert truth.search_space(record).coordinates == ("alpha",)
    rest = hs.identify(hs.ColemanHodgdon, record, fixed={"alpha": 1.7, "z0": -0.1})
    assert rest.estimates["B"] == pytest.approx(0.6, rel=1e-12)


def test_the_steady_force_of_dahl_is_used_in_the_fit():
    """A force known from the cycle is part of the fit, where no linear parameter moves it."""
    u = hs.signals.triangle(-1.0, 1.0, cycles=30, samples_per_cycle=40)
    friction = hs.Dahl(stiffness=3.0, coulomb=2.0, offset=0.4)
    record = hs.Record(u=u[-40:], y=friction.response(u)[-40:])
    fit = hs.identify(hs.Dahl, record, initial="periodic")
    assert fit.estimates["coulomb"] == pytest.approx(2.0, rel=1e-7)
    with pytest.raises(ValueError, match="no steady cycle that could be computed, since c or B or offset moves"):
        hs.identify(hs.ColemanHodgdon, record, initial="periodic")


test_wrong_arguments_are_named = refused(
    (lambda: hs.ColemanHodgdon(alpha=0.0), "alpha must be positive, got 0"),
    (lambda: hs.ColemanHodgdon.responses({"alpha": [1.0, -1.0]}, PATH), "alpha must be positive"),
    (lambda: hs.ColemanHodgdon.responses({"b": 1.0}, PATH), TypeError, "unknown parameter 'b'"),
    (lambda: SU.search_space(hs.Record(u=[1.0, 1.0], y=[0.0, 0.0])), "input is constant"),
    (
        lambda: hs.identify(SU, hs.Record(u=PATH, y=PATH), bounds={"alpha": (0.0, 1.0)}),
        "bounds of 'alpha' must be positive",
    ),
)
