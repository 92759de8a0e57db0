"""The polynomial Duhem law against closed forms, a literal ODE solver, and its own promises."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from strategies import assert_cut_or_stepped_it_has_the_same_bits, assert_refused, refused

import hysim as hs
from hysim.errors import SimulationError
from hysim.laws.differential.terms import Term
from hysim.models.search_space import Freedom

# Degree 2 in both variables, an inner loop, long and short moves, a rest.
GENERAL = hs.Duhem(
    p=[[0.8, 0.1, -0.2], [0.05, 0.02, 0.0], [-0.1, 0.0, 0.0]], q=[[0.1, -0.6, 0.03], [0.5, 0.0, 0.0]], y0=0.3
)
PATH = np.array([0.0, 0.1, 0.7, 2.0, 2.0, 1.1, 1.4, -0.6, -2.0, -2.0, 0.3, 1.7])


def literal(law: hs.Duhem, u: np.ndarray) -> np.ndarray:
    """dy/du = p + s q, segment by segment, by an adaptive Runge-Kutta method that never sees a reversal."""
    y = [law.y0]
    for start, end in itertools.pairwise(u):
        sign = np.sign(end - start)

        def slope(v: float, w: np.ndarray, sign: float = sign) -> np.ndarray:
            p, q = (np.polynomial.polynomial.polyval2d(v, w[0], part) for part in (law.p, law.q))
            return np.array([p + sign * q])

        y.append(
            y[-1] if sign == 0 else solve_ivp(slope, (start, end), [y[-1]], "DOP853", rtol=1e-13, atol=1e-14).y[0, -1]
        )
    return np.array(y)


def coleman_hodgdon(a: float, b: float, c: float, y0: float, u: np.ndarray) -> np.ndarray:
    """Closed form of y' = a |u'| (c u - y) + b u' on the monotone segments of u."""
    y = [y0]
    for start, end in itertools.pairwise(u):
        decay = math.exp(-a * abs(end - start))
        y.append(c * end + (y[-1] - c * start) * decay + np.sign(end - start) * (b - c) * (1.0 - decay) / a)
    return np.array(y)


@pytest.mark.parametrize(("a", "b", "c"), [(1.0, 0.345, 3.1635), (0.3, 2.0, 1.0), (30.0, 0.5, 1.0)])
def test_coleman_hodgdon_is_its_closed_form(a, b, c):
    law = hs.Duhem.from_terms({"u'": b, "|u'| u": a * c, "|u'| y": -a}, y0=0.4)
    expected = coleman_hodgdon(a, b, c, 0.4, PATH)
    # The promise of an integrated law: 1e-10 of the range, whatever the length of a move.
    assert np.abs(law.response(PATH) - expected).max() < 1e-10 * np.ptp(expected)


def test_dahl_is_bouc_wen_of_n_1_and_gamma_0():
    dahl = hs.Duhem.from_terms({"u'": 1.5, "|u'| y": -0.75})
    assert dahl.response(PATH) == pytest.approx(hs.BoucWen(A=1.5, beta=0.75, gamma=0.0).response(PATH), abs=1e-10)


def test_a_steep_law_is_its_closed_form():
    law = hs.Duhem.from_terms({"u'": 1.0, "u' y^2": 1.0})
    u = np.array([0.0, 1.0, 1.57, -1.5])  # tan reaches 1256 at the third sample: its condition number is 1971
    assert law.response(u) == pytest.approx(np.tan(u), rel=1971 * 1e-12)


def test_a_polynomial_of_the_input_alone_is_its_integral():
    law = hs.Duhem.from_terms({"u' u^5": 6.0}, y0=1.0)
    assert law.response([0.0, 2.0, -1.0, 0.0]) == pytest.approx([1.0, 65.0, 2.0, 1.0], rel=1e-14)  # rounding of 2^6


def test_literal_integration_agrees():
    expected = literal(GENERAL, PATH)
    assert np.abs(GENERAL.response(PATH) - expected).max() < 1e-11 * np.ptp(expected)  # the solver's own tolerance


def test_rests_change_nothing():
    rested = np.repeat(PATH, 3)
    assert np.array_equal(GENERAL.response(rested), np.repeat(GENERAL.response(PATH), 3))


@pytest.mark.parametrize("cut", range(PATH.size + 1))
def test_cut_or_stepped_it_has_the_same_bits(cut):
    assert_cut_or_stepped_it_has_the_same_bits(GENERAL, PATH, cut)


def test_batch_is_the_path_to_the_bit():
    factors = np.linspace(0.5, 1.5, 200)
    sets = {"p": factors[:, None, None] * GENERAL.p, "q": GENERAL.q, "y0": factors}
    together = hs.Duhem.responses(sets, PATH)
    alone = [hs.Duhem(p=sets["p"][k], q=GENERAL.q, y0=factors[k]).response(PATH) for k in (0, 77, 199)]
    assert np.array_equal(together[[0, 77, 199]], alone)
    assert np.array_equal(together, hs.Duhem.responses(sets, np.tile(PATH, (200, 1)), workers=1))
    opposite = {"p": [[[1.0]], [[-1.0]]], "q": [[0.0]]}  # the first one ends as the second one begins
    assert np.array_equal(*np.abs(hs.Duhem.responses(opposite, [0.0, 1.0, -1.0, 0.0], workers=1)))


def test_the_memory_is_the_output():
    assert np.array_equal(GENERAL.memory(PATH), GENERAL.response(PATH))


def test_without_rectified_terms_the_way_back_is_the_way_there():
    u = np.linspace(0.0, 1.5, 30)
    there, back = np.split(hs.Duhem(p=GENERAL.p, q=[[0.0]]).response(np.concatenate([u, u[::-1]])), 2)
    assert np.abs(there - back[::-1]).max() < 1e-10 * np.ptp(there)  # an integrated law's promise


def test_an_escape_names_its_sample_and_spares_the_rest_of_a_batch():
    law = hs.Duhem.from_terms({"u' y^2": 1.0}, y0=1.0)  # y = 1 / (1 - u)
    assert_refused(r"diverges at sample 2 \(u = 2\)", law.response, [0.0, 0.5, 2.0, 0.5], error=SimulationError)
    batch = hs.Duhem.responses({"p": law.p, "q": law.q, "y0": [1.0, 0.25]}, [0.0, 0.5, 2.0])
    assert np.isposinf(batch[0]).all()
    assert batch[1] == pytest.approx([0.25, 0.25 / 0.875, 0.5], rel=1e-14)  # a few roundings


def test_a_law_too_stiff_to_follow_says_so():
    law = hs.Duhem.from_terms({"|u'| u^2": 1e9, "|u'| y": -1e9})
    assert_refused(r"law is too stiff.*\) at sample 1", law.response, [0.0, 1.0], error=SimulationError)


def test_terms_and_arrays_are_one_law():
    again = hs.Duhem.from_terms(GENERAL.terms, y0=GENERAL.y0)
    assert again.terms == GENERAL.terms
    assert np.array_equal(again.response(PATH), GENERAL.response(PATH))
    assert list(GENERAL.terms) == [
        *("u'", "u' u", "u' y", "u' u^2", "u' u y", "u' y^2"),
        *("|u'|", "|u'| u", "|u'| y", "|u'| y^2"),
    ]
    assert GENERAL.terms["u' u y"] == GENERAL.p[1, 1]


def test_the_slopes_of_the_two_branches_are_one_law():
    rising, falling = np.array([[0.9, -0.5], [0.55, 0.0]]), np.array([[0.7, 0.7, -0.1]])
    law = hs.Duhem.from_branches(ascending=rising, descending=falling, y0=0.3)
    for direction, slope in ((1.0, rising), (-1.0, falling)):
        at = np.polynomial.polynomial.polyval2d(0.4, -0.2, slope)
        assert law.tangent(direction, -0.2, 0.4) == pytest.approx(at, rel=1e-15)
    p, q = (np.pad(part, ((0, 0), (0, 0))) for part in (GENERAL.p, np.pad(GENERAL.q, ((0, 1), (0, 0)))))
    again = hs.Duhem.from_branches(ascending=p + q, descending=p - q, y0=GENERAL.y0)
    # Halves of sums: one rounding of a coefficient, and an integrated law's promise.
    assert np.abs(again.response(PATH) - GENERAL.response(PATH)).max() < 1e-10


def test_a_structure_begins_at_a_regression_and_finds_the_law():
    walk = np.cumsum(np.random.default_rng(1).uniform(-0.4, 0.4, 200))
    record = hs.Record(u=walk - walk.mean(), y=GENERAL.response(walk - walk.mean()))
    fit = hs.identify(hs.Duhem.structure(degree=2), record)
    assert fit.n_parameters == 13
    found = fit.model.terms
    for name, value in GENERAL.terms.items():
        # The descent ends where the residual has lost nine digits.
        assert found[name] == pytest.approx(value, abs=1e-6), name
    assert fit.fit_percent > 99.99999
    few = hs.Duhem.structure(terms=["u'", "|u'| u", "|u'| y"])
    assert few.search_space(record).names == ("u'", "|u'| u", "|u'| y", "y0")


def test_a_structure_of_degree_1_fits_the_measured_loop():
    fit = hs.identify(hs.Duhem.structure(degree=1), hs.datasets.table1(dwell=1.0))
    assert fit.n_parameters == 7
    assert fit.fit_percent == pytest.approx(96.09, abs=0.01)  # as printed


def test_the_class_stands_for_the_second_degree():
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    record = hs.Record(u=u, y=hs.Duhem.from_terms({"u'": 0.3, "|u'| u": 1.0, "|u'| y": -1.0}).response(u))
    by_class, by_degree = (hs.identify(each, record) for each in (hs.Duhem, hs.Duhem.structure(degree=2)))
    assert by_class.estimates == by_degree.estimates


test_a_structure_is_checked = refused(
    ({}, "give degree or terms"),
    ({"degree": 1, "terms": ["u'"]}, "give degree or terms"),
    ({"degree": -1}, "must not be negative"),
    ({"degree": 1.5}, TypeError, "must be a whole number"),
    ({"terms": []}, "at least one term"),
    ({"terms": ["u' |z|"]}, "memory of its own"),
    ({"terms": ["u"]}, "unknown term"),
    call=lambda arguments: hs.Duhem.structure(**arguments),
)


@pytest.mark.parametrize(
    "name",
    ["u", "u' |z| y", "u' |y|^2", "u' z |z|", "u' |z| u", "u' y u", "u' u^1", "u' u^0", "|u'|y", "u' u u", "", "2 u'"],
)
def test_names_outside_the_vocabulary_are_refused(name):
    assert_refused("unknown term", hs.Duhem.from_terms, {name: 1.0})


def test_every_term_has_one_name():
    terms = [Term(rectified, n, j) for rectified in (False, True) for n in range(4) for j in range(n + 1)]
    assert [Term.parse(term.name) for term in terms] == terms == sorted(terms)


def test_the_equation_reads_to_four_digits():
    law = hs.Duhem.from_terms({"u'": 0.0123456, "u' u": 4.5e-5, "|u'|": -1.0, "|u'| u y^2": -2.0})
    assert law.equation == "y' = u' (0.01235 + 4.5e-05 u) + |u'| (-1 - 2 u y^2)"
    assert hs.Duhem(p=[[0.0]], q=[[0.0]]).equation == "y' = 0"


ONE = {"p": [[1.0]], "q": [[1.0]]}
test_arguments_are_checked = refused(
    (lambda: hs.Duhem(p=[1.0], q=[[1.0]]), "p must have two axes"),
    (lambda: hs.Duhem(p=[[1.0]], q=[[math.nan]]), "q must be finite"),
    (lambda: GENERAL.response([0.0, math.nan]), "u must be finite, got nan at index 1"),
    (lambda: hs.Duhem.responses({**ONE, "z0": 0.0}, PATH), TypeError, "unknown parameter 'z0': Duhem has p, q, p_abs"),
    (lambda: hs.Duhem.responses({**ONE, "y0": [0.0, 1.0]}, np.zeros((3, 4))), "one length or length 1"),
)


def test_the_search_space_begins_at_the_law_and_goes_back_to_it():
    record = hs.Record(u=PATH, y=GENERAL.response(PATH))
    space = GENERAL.search_space(record, Freedom(fixed={"u'": 0.8}, bounds={"|u'|": (0.0, 0.5)}))
    assert space.names == (*list(GENERAL.terms)[1:], "y0")
    values = space.parameters(space.starts)
    everything = {**GENERAL.terms, "feedthrough": 0.0, "offset": 0.0, "y0": 0.3}
    assert {name: value[0] for name, value in values.items()} == pytest.approx(everything, rel=1e-14)
    assert space.parameters(space.lower)["|u'|"][0] == 0.0
    assert space.parameters(space.upper)["|u'|"][0] == pytest.approx(0.5, rel=1e-15)
    assert GENERAL.regressors(values, record)[0, :, 0] == pytest.approx(record.y, abs=1e-14)  # rounding of the scaling
    again = GENERAL.assemble({name: value[0] for name, value in values.items()})
    assert again.terms == pytest.approx(GENERAL.terms, rel=1e-14)


def test_at_rest_the_law_starts_at_zero():
    record = hs.Record(u=PATH, y=GENERAL.response(PATH))
    held = {"feedthrough": 0.0, "offset": 0.0, "y0": 0.0}
    assert GENERAL.search_space(record, Freedom(initial="rest")).held == held
    with pytest.raises(ValueError, match='initial must be "free", "rest", "still" or "periodic"'):
        GENERAL.search_space(record, Freedom(initial="warm"))
    assert_refused("no steady cycle", hs.identify, GENERAL, record, initial="periodic")
