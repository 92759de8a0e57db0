"""The polynomial Duhem law with terms in |z| and a feedthrough: against Bouc-Wen's, a literal ODE solver, itself."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from strategies import assert_cut_or_stepped_it_has_the_same_bits, assert_refused

import hysim as hs
from hysim.errors import SimulationError
from hysim.laws.differential.duhem_runs import free_runs
from hysim.laws.differential.terms import Term
from hysim.models.search_space import Freedom

polyval2d = np.polynomial.polynomial.polyval2d

BOUC_WEN = {1: ("|u'| z", "u' |z|"), 2: ("|u'| |z| z", "u' z^2"), 3: ("|u'| z^3", "u' |z| z^2")}

# Both rates, |z| in both, u in the slope at z = 0: the memory may dip through zero and back on one way.
MIXED = hs.Duhem(
    p=[[0.5, -0.3], [0.9, 0.0]], q=[[0.1, -0.5]], p_abs=[[-0.4], [0.3]], q_abs=[[0.2, -0.3]], feedthrough=1.5, y0=-0.2
)
WITH_OFFSET = hs.Duhem.from_terms({"u'": 1.0, "|u'| z": -0.6, "u' |z|": -0.3}, feedthrough=2.0, offset=7.0, y0=7.25)
CYCLE = np.concatenate([np.linspace(0.0, 2.0, 40), np.linspace(2.0, -2.0, 80), np.linspace(-2.0, 2.0, 80)])
PATH = np.array([0.0, 0.3, -1.4, 1.1, 1.1, -0.2, 0.4, -1.0, 1.5, -1.5])

TIGHT = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15, "max_step": 0.05}  # an event is seen between steps only

turns = st.lists(st.floats(-3.0, 3.0) | st.floats(-1e-3, 1e-3), min_size=1, max_size=12)


def bouc_wen_and_duhem(n, A, beta, gamma, feedthrough, u0=0.0):
    """The same law twice, its memory at zero at the input u0."""
    rectified, plain = BOUC_WEN[n]
    return (
        hs.BoucWen(A=A, beta=beta, gamma=gamma, n=n, feedthrough=feedthrough),
        hs.Duhem.from_terms({"u'": A, rectified: -beta, plain: -gamma}, feedthrough=feedthrough, y0=feedthrough * u0),
    )


def literal(law: hs.Duhem, u: np.ndarray) -> np.ndarray:
    """The output, from one reversal and from one zero of z to the next by an adaptive Runge-Kutta method."""
    z = [law.y0 - law.feedthrough * u[0]]
    for start, end in itertools.pairwise(u):
        here, now, sign = start, z[-1], np.sign(end - start)

        def slope(v, w, side, sign=sign):
            p, q, p_abs, q_abs = (polyval2d(v, w[0], part) for part in (law.p, law.q, law.p_abs, law.q_abs))
            return [p + sign * q + side * w[0] * (p_abs + sign * q_abs)]

        def crossing(v, w, side):
            return side * w[0] + 1e-15  # just beyond zero, so that a way that begins at zero does not end there

        crossing.terminal, crossing.direction = True, -1.0
        while here != end:
            side = np.sign(now) or np.sign(sign * slope(here, [0.0], 0.0)[0])
            way = solve_ivp(slope, (here, end), [now], events=crossing, args=(side,), **TIGHT)
            here, now = way.t[-1], 0.0 if way.status == 1 else way.y[0, -1]
        z.append(now)
    return law.feedthrough * u + np.array(z)


@pytest.mark.parametrize("n", BOUC_WEN)
@given(
    A=st.floats(0.2, 3.0),
    beta=st.floats(0.1, 2.0),
    share=st.floats(-1.0, 1.0),
    feedthrough=st.sampled_from([0.0, -1.0, 40.0]),
    u=turns,
)
def test_bouc_wen_of_whole_n_is_a_duhem_law(n, A, beta, share, feedthrough, u):
    bouc_wen, law = bouc_wen_and_duhem(n, A, beta, share * beta, feedthrough, u[0])
    expected = bouc_wen.response(u)
    # The promise of an integrated law: 1e-10 of the range; on tiny moves the feedthrough leaves rounding of z0 besides.
    room = 1e-10 * np.ptp(expected) + 1e-15 * (1.0 + abs(feedthrough * u[0]))
    assert np.abs(law.response(u) - expected).max() <= room


@pytest.mark.parametrize("n", BOUC_WEN)
def test_a_long_record_that_crosses_zero_at_every_turn_stays_with_bouc_wen(n):
    u = np.cumsum(np.random.default_rng(5).normal(size=2000))
    bouc_wen, law = bouc_wen_and_duhem(n, 1.0, 0.6, -0.3, 2.0, u[0])
    expected = bouc_wen.response(u)
    assert np.abs(law.response(u) - expected).max() < 1e-10 * np.ptp(expected)  # an integrated law's promise


def test_literal_integration_agrees():
    expected = literal(MIXED, PATH)
    fine = np.interp(np.arange(0.0, PATH.size - 1.0, 0.01), np.arange(PATH.size), PATH)
    assert (np.diff(np.sign(MIXED.memory(fine))) != 0).sum() > 6  # z does cross zero
    assert np.abs(MIXED.response(PATH) - expected).max() < 1e-11 * np.ptp(expected)  # the solver's own tolerance


@pytest.mark.parametrize("depth", [0.0, 1e-4, 1e-8, 1e-12, 1e-15, -1e-15, -1e-8])
def test_a_dip_below_zero_and_back_is_not_stepped_over(depth):
    law = hs.Duhem.from_terms({"u' u": 1.0, "u' |z|": 1.4})  # where u rises: z' = u + 1.4 |z|
    # z = (exp(1.4 u) - 1) / 1.96 - u / 1.4 >= 0 touches zero at u = 0; begun lower by `depth` it passes through.
    touching = (np.exp(-1.4) - 1.0) / 1.96 + 1.0 / 1.4
    law = hs.Duhem(p=law.p, q=law.q, p_abs=law.p_abs, y0=touching - depth * np.exp(-1.4))
    u = np.linspace(-1.0, 1.0, 2001)
    assert law.response(u[[0, -1]])[1] == pytest.approx(law.response(u)[-1], rel=1e-10)


def test_a_slope_that_begins_with_a_high_power_of_the_input_is_not_taken_for_none():
    """dz/du = u^30 from zero on: no term that is computed is other than zero."""
    law = hs.Duhem(p=[*[[0.0]] * 30, [1.0]], q=[[0.0]])
    for end in (0.3, 1.0, 2.0, -1.0):
        assert law.response([0.0, end])[-1] == pytest.approx(end**31 / 31.0, rel=1e-10)


@pytest.mark.parametrize("unit", [1e-200, 1e-100, 1e-12, 1e100])
def test_the_unit_of_the_memory_does_not_matter(unit):
    u = np.array([0.0, 1.0, -2.0, 0.5])
    z = hs.Duhem(p=[[unit]], q=[[0.0, -0.7]]).response(u)
    assert z / unit == pytest.approx(hs.BoucWen(beta=0.7, gamma=0.0).memory(u), rel=1e-10)


def test_a_law_at_rest_at_zero_where_its_slope_is_zero_finds_its_side():
    law = hs.Duhem.from_terms({"|u'| u": 2.0, "|u'| |z|": -1.0})  # from u = 0 on z grows as u^2, or falls as -u^2
    up, down = law.response([0.0, 1.0])[1], law.response([0.0, -1.0])[1]
    assert up == pytest.approx(2.0 * np.exp(-1.0), rel=1e-14)  # closed forms, to a few roundings
    assert down == pytest.approx(-2.0 * (np.e - 2.0), rel=1e-14)
    assert hs.Duhem.from_terms({"u' |z|": 1.0}).response([0.0, 1.0, -1.0]).tolist() == [0.0, 0.0, 0.0]


@given(u=turns)
def test_an_odd_law_is_odd_to_the_bit(u):
    terms = {"u'": 1.0, "|u'| z": -0.6, "u' |z|": -0.3, "u' u^2": 0.2, "|u'| u |z|": 0.1}
    law, mirrored = (hs.Duhem.from_terms(terms, feedthrough=0.5, y0=sign * 0.1) for sign in (1.0, -1.0))
    assert np.array_equal(mirrored.response(-np.array(u)), -law.response(u))


@pytest.mark.parametrize("law", [MIXED, WITH_OFFSET], ids=["mixed", "offset"])
@pytest.mark.parametrize("cut", range(PATH.size + 1))
def test_cut_or_stepped_it_has_the_same_bits(law, cut):
    assert_cut_or_stepped_it_has_the_same_bits(law, PATH, cut)


def test_batches_are_the_path_to_the_bit():
    factors = np.linspace(0.5, 1.5, 5)
    sets = {"p": MIXED.p, "q": MIXED.q, "p_abs": factors[:, None, None] * MIXED.p_abs, "q_abs": MIXED.q_abs}
    together = hs.Duhem.responses(sets | {"feedthrough": factors, "y0": 0.2}, PATH)
    runs, _ = free_runs(
        [Term.parse(name) for name in MIXED.terms],
        np.tile(list(MIXED.terms.values()), (5, 1)),
        factors,
        0.2,
        hs.Record(u=PATH, y=PATH).u[np.newaxis],
        1e3,
        workers=1,
    )
    for k, factor in enumerate(factors):
        parts = {"p": MIXED.p, "q": MIXED.q, "q_abs": MIXED.q_abs, "feedthrough": factor, "y0": 0.2}
        assert np.array_equal(together[k], hs.Duhem(p_abs=factor * MIXED.p_abs, **parts).response(PATH))
        assert np.array_equal(runs[k], hs.Duhem(p_abs=MIXED.p_abs, **parts).response(PATH))


def test_a_law_without_bars_among_others_is_the_same_to_rounding():
    both = hs.Duhem.responses({"p": [[1.0]], "q": [[0.0, -0.6]], "p_abs": [[[0.0]], [[-0.3]]]}, PATH)
    alone = hs.Duhem(p=[[1.0]], q=[[0.0, -0.6]]).response(PATH)
    assert np.abs(both[0] - alone).max() < 1e-14 * np.ptp(alone)  # a few roundings


def test_a_run_that_escapes_is_a_row_of_inf():
    terms = [Term.parse("u'"), Term.parse("u' |z|")]
    u = hs.Record(u=[0.0, 1.0, 10.0], y=[0.0, 0.0, 0.0]).u[np.newaxis]
    runs, _ = free_runs(terms, np.array([[1.0, 1.0], [1.0, -1.0]]), 2.0, 0.0, u, 100.0)
    assert np.isposinf(runs[0]).all()
    assert runs[1] == pytest.approx(2.0 * u[0] + 1.0 - np.exp(-u[0]), rel=1e-14)  # a few roundings
    with pytest.raises(SimulationError, match=r"diverges at sample 1 .*: z' = u' \(1 \|z\| z \+ 1 z\^2\), y = z"):
        hs.Duhem.from_terms({"u' z^2": 1.0, "u' |z| z": 1.0}, y0=1.0).response([0.0, 1.0])


def test_a_run_that_needs_more_steps_than_allowed_is_a_row_of_inf():
    u = hs.Record(u=[0.0, 1.0, -1.0, 1.0], y=np.zeros(4)).u[np.newaxis]
    laws = np.array([[1.0, -2.0], [1.0, -2e3]])  # the second one turns within a 2000th of a stroke
    terms = [Term.parse("u'"), Term.parse("|u'| z")]
    few, many = (free_runs(terms, laws, 0.0, 0.0, u, 100.0, most_steps=most)[0] for most in (100, 20_000))
    assert np.isposinf(few[1]).all()
    assert np.isfinite(many).all()
    assert np.array_equal(few[0], many[0])


def test_the_slopes_count_the_work_of_each_law(monkeypatch):
    monkeypatch.setattr("hysim.laws.differential.duhem_runs.SAMPLES_A_THREAD", 30)  # so that two threads share them
    u = hs.Record(u=np.tile([1.0, -1.0], 15), y=np.zeros(30)).u[np.newaxis]
    laws = np.repeat([[1.0, -1.0], [1.0, -2e3]], 4, axis=0)  # the second one turns within a 2000th of a stroke
    terms = [Term.parse("u'"), Term.parse("|u'| z")]
    smooth, stiff = (free_runs(terms, sets, 0.0, 0.0, u, 100.0)[1] for sets in np.split(laws, 2))
    assert 4 * 29 <= smooth < 0.5 * stiff
    assert free_runs(terms, laws, 0.0, 0.0, u, 100.0, workers=2)[1] == smooth + stiff


def test_without_bars_and_feedthrough_the_memory_is_the_output_and_is_called_so():
    terms = {"u'": 1.0, "|u'| u y^2": -1.0}
    assert hs.Duhem.from_terms(terms).terms == terms
    assert hs.Duhem.from_terms({"u'": 1.0, "|u'| u z^2": -1.0}) == hs.Duhem.from_terms(terms)
    assert list(hs.Duhem.from_terms(terms, feedthrough=1.0).terms) == ["u'", "|u'| u z^2"]
    assert MIXED.memory(PATH) == pytest.approx(MIXED.response(PATH) - 1.5 * PATH, abs=1e-15)  # one rounding


def test_terms_and_arrays_are_one_law():
    again = hs.Duhem.from_terms(MIXED.terms, feedthrough=1.5, y0=MIXED.y0)
    assert again.terms == MIXED.terms
    assert np.array_equal(again.response(PATH), MIXED.response(PATH))
    assert list(MIXED.terms) == ["u'", "u' u", "u' |z|", "u' z", "u' u |z|", "|u'|", "|u'| |z|", "|u'| z", "|u'| |z| z"]


def test_every_term_has_one_name_for_each_letter():
    terms = [
        Term(rectified, i + j + absolute, j, absolute)
        for rectified, i, j, absolute in itertools.product((False, True), range(3), range(3), (False, True))
    ]
    for letter in "yz":
        names = [term.named(letter) for term in terms]
        assert len(set(names)) == len(terms)
        assert [Term.parse(name) for name in names] == terms
    assert [Term.parse(term.name) for term in terms] == terms
    assert Term.parse("|u'| u |z| z^2") == Term(True, 4, 2, True)
    assert Term.parse("|u'| u |z| z^2").name == "|u'| u |z| z^2"
    assert Term.parse("u' z").name == "u' y"


def test_one_term_under_two_names_is_refused():
    assert_refused("given twice", hs.Duhem.from_terms, {"u' y": 1.0, "u' z": 1.0})


def test_the_equation_reads_as_text_and_in_latex():
    law = hs.Duhem.from_terms({"u'": 1.23456e-5, "u' |z|": -0.3, "|u'| u z^12": 2e6}, feedthrough=40.0)
    assert law.equation == "z' = u' (1.235e-05 - 0.3 |z|) + |u'| (2e+06 u z^12), y = 40 u + z"
    assert law.latex == (
        r"\dot{z} = \dot{u} \left(1.235 \times 10^{-5} - 0.3 |z|\right) "
        r"+ |\dot{u}| \left(2 \times 10^{6} u z^{12}\right), \quad y = 40 u + z"
    )
    assert hs.Duhem.from_terms({"|u'| |z|": -1.0}).equation == "z' = |u'| (-1 |z|), y = z"
    assert hs.Duhem.from_terms({"u' y^2": 1.0}).latex == r"\dot{y} = \dot{u} \left(1 y^{2}\right)"


def test_the_tangent_is_the_slope_of_the_response():
    u, z, step = 0.7, -0.4, 1e-6
    for direction in (-1.0, 1.0):
        ahead, _ = MIXED.advance([u + direction * step], (u, z))
        slope = (ahead[0] - (MIXED.feedthrough * u + z)) / (direction * step)
        assert MIXED.tangent(direction, z, u) == pytest.approx(slope, abs=1e-5)  # the curvature times the step
    assert_refused("direction must not be zero", MIXED.tangent, 0.0, 0.0)


@pytest.mark.parametrize("n", BOUC_WEN)
def test_the_inverse_undoes_the_response(n):
    _, law = bouc_wen_and_duhem(n, -0.4, 0.3, -0.1, 2.0, PATH[0])
    y = law.response(PATH)
    assert np.abs(law.inverse_response(y) - PATH).max() < 1e-10 * np.ptp(PATH)  # an integrated law's promise
    _, state = law.advance(PATH[:4])
    assert law.inverse_response(y[4:], state=state) == pytest.approx(PATH[4:], abs=1e-10)


def test_a_law_that_turns_has_no_inverse_and_says_where():
    law = hs.Duhem.from_terms({"u'": 1.0, "|u'| |z|": -1.0, "u' u": -1.0})  # the slope is zero near u = 1
    assert_refused(r"no inverse at sample 2 \(y = 5\)", law.inverse_response, [0.0, 0.1, 5.0], error=SimulationError)
    assert_refused("u0 or state, not both", law.inverse_response, [0.0], u0=0.0, state=(0.0, 0.0))


def test_the_feedthrough_is_searched_where_the_polynomials_do_not_hold_it():
    _, law = bouc_wen_and_duhem(1, 1.0, 0.6, 0.3, 3.0)
    record = hs.Record(u=CYCLE, y=law.response(CYCLE))
    assert MIXED.search_space(record).names == (*MIXED.terms, "feedthrough", "offset", "y0")
    start = hs.Duhem.from_terms({"u'": 0.8, "|u'| z": -0.4, "u' |z|": -0.4}, feedthrough=2.5)
    fit = hs.identify(start, record, fixed={"offset": 0.0})
    truth = {**law.terms, "feedthrough": 3.0, "offset": 0.0, "y0": 0.0}
    assert fit.estimates == pytest.approx(truth, abs=1e-6)  # the search's xtol
    plain = hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0})
    assert plain.search_space(record).held == {"feedthrough": 0.0, "offset": 0.0}
    assert "feedthrough" in plain.search_space(record, Freedom(free=("feedthrough",))).names


# ---------------------------------------------------------------------------------- the offset shifts the output alone


@given(offset=st.floats(-100.0, 100.0))
def test_an_offset_shifts_the_output_and_leaves_the_memory(offset):
    plain = replace(WITH_OFFSET, offset=0.0, y0=0.25)
    shifted = replace(WITH_OFFSET, offset=offset, y0=0.25 + offset)
    room = 1e-14 * (1.0 + abs(offset))  # y0 less the offset is rounded
    assert shifted.memory(PATH) == pytest.approx(plain.memory(PATH), abs=room)
    assert shifted.response(PATH) == pytest.approx(offset + plain.response(PATH), abs=room)


def test_the_output_begins_at_y0():
    assert WITH_OFFSET.response(PATH)[0] == 7.25
    assert WITH_OFFSET.memory(PATH)[0] == 0.25


def test_bouc_wen_with_an_offset_is_a_duhem_law():
    bouc_wen = hs.BoucWen(A=1.0, beta=0.6, gamma=0.3, feedthrough=2.0, offset=7.0, z0=0.25)
    expected = bouc_wen.response(PATH)
    assert np.abs(WITH_OFFSET.response(PATH) - expected).max() < 1e-10 * np.ptp(expected)  # an integrated law's promise


def test_batches_of_offsets_are_the_path_to_the_bit():
    offsets = np.array([0.0, 7.0, -1.0 / 3.0])
    arrays = {name: getattr(WITH_OFFSET, name) for name in ("p", "q", "p_abs", "q_abs")}
    together = hs.Duhem.responses({**arrays, "feedthrough": 2.0, "offset": offsets, "y0": 7.25}, PATH)
    for row, offset in zip(together, offsets.tolist(), strict=True):
        assert np.array_equal(row, replace(WITH_OFFSET, offset=offset).response(PATH))


def test_the_inverse_takes_the_offset_away():
    back = WITH_OFFSET.inverse_response(WITH_OFFSET.response(PATH))
    assert back == pytest.approx(PATH, abs=1e-9)  # 1e-10 of the output's range


def test_an_offset_makes_the_memory_another_thing_than_the_output():
    law = hs.Duhem.from_terms({"u'": 1.0, "|u'| z": -1.0}, offset=-2.0)
    assert list(law.terms) == ["u'", "|u'| z"]
    assert law.equation == "z' = u' (1) + |u'| (-1 z), y = -2 + z"
    assert WITH_OFFSET.equation == "z' = u' (1 - 0.3 |z|) + |u'| (-0.6 z), y = 7 + 2 u + z"
    assert WITH_OFFSET.latex.endswith(r", \quad y = 7 + 2 u + z")


def test_an_offset_is_identified():
    record = hs.Record(u=CYCLE, y=WITH_OFFSET.response(CYCLE))
    start = hs.Duhem.from_terms({"u'": 0.9, "|u'| z": -0.5, "u' |z|": -0.4}, feedthrough=2.1, offset=7.1, y0=7.2)
    fit = hs.identify(start, record)
    truth = {**WITH_OFFSET.terms, "feedthrough": 2.0, "offset": 7.0, "y0": 7.25}
    assert fit.estimates == pytest.approx(truth, abs=1e-6)  # the search's xtol
    assert fit.model.response(CYCLE) == pytest.approx(record.y, abs=1e-6)


def test_an_offset_is_searched_where_there_is_one_or_it_is_asked_for():
    record = hs.Record(u=PATH, y=WITH_OFFSET.response(PATH))
    plain = hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -1.0})
    assert "offset" in replace(plain, offset=1.0).search_space(record).names
    assert "offset" not in plain.search_space(record).names
    assert "offset" in plain.search_space(record, Freedom(free=("offset",))).names
