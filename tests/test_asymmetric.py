"""The asymmetric Bouc-Wen laws against the equations written out, the law that they extend, and their own promises."""

import itertools

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from strategies import assert_cut_or_stepped_it_has_the_same_bits, assert_refused

import hysim as hs
from hysim.errors import SimulationError

# Reversals, a rest, moves through u = 0 and along one side of it, zeros of z.
PATH = np.array([0.0, 0.3, 0.9, 0.9, 0.2, -0.5, -1.0, -0.1, 0.4, 0.1, 0.6, -0.7, 0.05])
COMMON = {
    "A": 1.1,
    "beta": 0.7,
    "gamma": 0.25,
    "gain": -0.5,
    "offset": 0.2,
    "z0": 0.1,
    "input_coefficients": (1.5, 0.1),
}
OWN = {
    hs.ZhuWangBoucWen: {"delta": 0.4},
    hs.GeneralizedBoucWen: {"b2": 0.2, "b3": -0.15, "b4": 0.1, "b5": 0.05, "b6": -0.1},
}
FAMILIES = list(OWN)
EXPONENTS = [0.5, 1.0, 1.3, 2.0, 3.0]


def law(family, n=1.0, **others):
    return family(**COMMON | OWN[family] | {"n": n} | others)


def slope(model, direction: float, u: float, z: float) -> float:
    """dz/du as the sources print it, per u'."""
    if isinstance(model, hs.ZhuWangBoucWen):
        bend = model.gamma + model.beta * np.sign(z * direction)
        return model.A - abs(z) ** model.n * bend + model.delta * u * direction
    psi = model.gamma + model.beta * np.sign(direction * z) + model.b2 * np.sign(direction * u)
    psi += model.b3 * np.sign(z * u) + model.b4 * direction + model.b5 * np.sign(z) + model.b6 * np.sign(u)
    return model.A - abs(z) ** model.n * psi


def literal(model, u: np.ndarray) -> np.ndarray:
    """The memory by an adaptive Runge-Kutta method that is stopped at every u = 0, and cut at every z = 0."""
    z = [model.z0]
    for start, end in itertools.pairwise(u):
        direction, value = np.sign(end - start), z[-1]
        stops = [start, 0.0, end] if start * end < 0.0 else [start, end]
        for a, b in itertools.pairwise(stops):
            sector = np.sign(0.5 * (a + b))

            def rate(v, w, direction=direction, sector=sector):
                inside = v if v * sector > 0.0 else sector * 1e-300
                return [slope(model, direction, inside, w[0])]

            at = a
            while at != b:
                crossing = lambda v, w: w[0]  # noqa: E731
                crossing.terminal = True
                begin = np.array([value])
                if value == 0.0:  # one short explicit step away from the kink
                    ahead = at + np.clip(b - at, -1e-9, 1e-9)
                    value, at = float(begin[0] + (ahead - at) * rate(at, begin)[0]), ahead
                    continue
                run = solve_ivp(rate, (at, b), begin, "DOP853", rtol=1e-13, atol=1e-15, events=crossing)
                at = run.t[-1]
                value = 0.0 if run.status == 1 else run.y[0, -1]
        z.append(value)
    return np.array(z)


@pytest.mark.parametrize("n", EXPONENTS)
@pytest.mark.parametrize("family", FAMILIES)
def test_the_memory_is_that_of_the_equation(family, n):
    model = law(family, n)
    expected = literal(model, PATH)
    # 1e-10 of the range is the laws' promise; the explicit steps away from z = 0 leave (1e-9)^(1 + n) each.
    tolerance = 1e-10 * np.ptp(expected) + 10.0 * 1e-9 ** (1.0 + n)
    assert np.abs(model.memory(PATH) - expected).max() < tolerance


@pytest.mark.parametrize("n", [1.0, 1.7, 2.0])
@pytest.mark.parametrize("family", FAMILIES)
def test_without_its_own_terms_it_is_the_bouc_wen_law(family, n):
    bouc_wen = hs.PolynomialBoucWen(**COMMON, n=n).response(PATH)
    same = family(**COMMON, n=n).response(PATH)
    if family is hs.GeneralizedBoucWen:
        assert np.array_equal(same, bouc_wen)
    else:  # other formulas: a few roundings for n = 1, an integrated law's promise otherwise
        assert np.abs(same - bouc_wen).max() < (1e-15 if n == 1.0 else 1e-10) * np.ptp(bouc_wen)


@pytest.mark.parametrize("delta", [-2.0, -0.5, 0.5, 2.0])
@pytest.mark.parametrize(("beta", "gamma"), [(0.7, 0.25), (0.3, -0.9), (1e-9, 1e-9), (0.0, 0.0), (30.0, 5.0)])
def test_the_closed_form_of_zhu_and_wang_solves_the_equation(delta, beta, gamma):
    """Also where z crosses zero twice on one way, where it turns, and where the decay vanishes."""
    model = hs.ZhuWangBoucWen(A=0.2, beta=beta, gamma=gamma, delta=delta, z0=0.05)
    u = np.array([-0.6, 0.8, -0.9, 0.1, -1.0, 1.0])
    expected = literal(model, u)
    assert np.abs(model.memory(u) - expected).max() < 1e-10 * np.ptp(expected) + 1e-16


@pytest.mark.parametrize("family", FAMILIES)
@given(
    u=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12),
    n=st.sampled_from([0.5, 1.0, 1.3, 2.0, 3.0]),
    cut=st.integers(0, 12),
)
def test_cut_stepped_or_in_batch_it_is_the_same_bits(family, u, n, cut):
    model = law(family, n)
    y = model.response(u)
    assert_cut_or_stepped_it_has_the_same_bits(model, u, cut)
    sets = {**COMMON, **OWN[family], "n": [1.7, n, n, 1.0], "beta": [0.5, 0.7, 0.9, 0.7]}
    assert np.array_equal(family.responses(sets, u)[1], y)
    assert np.array_equal(family.responses(sets, np.tile(u, (4, 1)), workers=1)[1], y)


@given(u=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=12), n=st.sampled_from([1.0, 1.3, 2.0]))
def test_the_odd_terms_give_an_odd_law(u, n):
    """delta u sgn(du), b2 and b3 are reflected into themselves."""
    for odd in (hs.GeneralizedBoucWen(n=n, b2=0.2, b3=-0.3), hs.ZhuWangBoucWen(n=n, delta=0.4)):
        assert np.array_equal(odd.memory(np.negative(u)), -odd.memory(u))


@pytest.mark.parametrize("term", ["b4", "b5", "b6"])
def test_the_other_terms_break_the_symmetry(term):
    u = hs.signals.triangle(-1.0, 1.0, cycles=4, samples_per_cycle=40)
    z = hs.GeneralizedBoucWen(**{term: 0.3}).memory(u)[-41:]
    assert abs(z.max() + z.min()) > 0.01


def test_a_loop_of_zhu_and_wang_beside_u_0_is_not_symmetric():
    """The way up, turned about the loop's centre, is the way down of a symmetric law, and not of this one."""
    u = hs.signals.triangle(0.0, 1.0, cycles=6, samples_per_cycle=80)

    def asymmetry(delta):
        z = hs.ZhuWangBoucWen(beta=2.0, delta=delta).memory(u)[-81:]
        return np.abs(z[:41] + z[40:] - z[0] - z[40]).max() / np.ptp(z)

    assert asymmetry(0.0) < 1e-5  # what six cycles leave of the way in
    assert asymmetry(1.0) > 0.05


@pytest.mark.parametrize("n", [1.0, 1.3])
@pytest.mark.parametrize("family", FAMILIES)
def test_the_inverse_undoes_the_response(family, n):
    model = law(family, n)
    y = model.response(PATH)
    back = model.inverse_response(y)
    # where the search ends: a few roundings of an output of 2, or what an integrated law is known to
    room = 1e-14 if family is hs.GeneralizedBoucWen or n == 1.0 else 1e-10
    assert np.abs(model.response(back) - y).max() < room
    assert np.abs(back - PATH).max() < 10.0 * room  # that over the lowest slope, 0.4, and its sum over the path
    u, z = PATH[4], model.memory(PATH)[4]
    assert model.inverse_response(y[5:], state=(u, z)) == pytest.approx(PATH[5:], abs=1e-10)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_slope_is_what_the_response_does(family):
    model = law(family, 1.3)
    for direction, u, z in itertools.product([-1.0, 1.0], [-0.5, 0.5], [-0.4, 0.4]):
        ends, _ = model.advance([u, u + 1e-6 * direction], (u, z))
        # One-sided difference: 1e-6 of the second derivative, which is below 4.
        assert model.tangent(direction, z, u) == pytest.approx((ends[1] - ends[0]) / (1e-6 * direction), abs=4e-6)


@pytest.mark.parametrize("family", FAMILIES)
def test_an_output_without_an_inverse_is_refused(family):
    model = law(family, gain=-1.3)  # its slope is negative behind some of the reversals
    with pytest.raises(SimulationError, match=r"has no inverse at sample \d .* turns on the way"):
        model.inverse_response(model.response(PATH))
    assert_refused("u0 or state, not both", model.inverse_response, [0.0], u0=0.0, state=(0.0, 0.0))


@pytest.mark.parametrize("family", FAMILIES)
def test_an_escape_names_its_sample_and_spares_the_rest_of_a_batch(family):
    escaping = family(beta=-1.0, gamma=-1.0, n=3.0)
    assert_refused(r"diverges at sample 2 \(u = 9\)", escaping.memory, [0.0, 0.1, 9.0], error=SimulationError)
    rows = family.responses({"beta": [-1.0, 0.5], "gamma": [-1.0, 0.5], "n": 3.0}, [0.0, 0.1, 9.0])
    assert np.isposinf(rows[0]).all()
    assert np.isfinite(rows[1]).all()


@pytest.mark.parametrize("family", FAMILIES)
def test_a_reduction_is_the_measure_of_the_row(family):
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    sets = {**COMMON, **OWN[family], "beta": [0.5, 0.7]}
    expected = [hs.loop_metrics(u, law(family, beta=beta).response(u)).area for beta in (0.5, 0.7)]
    assert family.responses(sets, u, reduce="area") == pytest.approx(expected, rel=1e-13)  # sums in another order


@pytest.mark.parametrize("family", FAMILIES)
def test_identify_finds_the_law_of_clean_data(family):
    walk = np.cumsum(np.random.default_rng(1).uniform(-0.4, 0.4, 120))
    u = walk - 0.5 * (walk.max() + walk.min())
    fixed = {"A": 1.1, "n": 1.0} | ({"b2": 0.2, "b3": -0.15, "b6": -0.1} if family is hs.GeneralizedBoucWen else {})
    truth = law(family)
    fit = hs.identify(family(input_coefficients=(1.0, 0.0)), hs.Record(u=u, y=truth.response(u)), fixed=fixed)
    for name in fit.free_names:
        # The descent ends where the residual has lost nine digits.
        assert fit.estimates[name] == pytest.approx(truth.scalars[name], abs=1e-6), name


def test_on_a_one_sided_input_the_terms_that_are_alike_are_held():
    u = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=40)
    rec = hs.Record(u=u, y=hs.GeneralizedBoucWen(b4=0.2).response(u))
    names = hs.GeneralizedBoucWen().search_space(rec).names
    assert {"gamma", "b4", "b5"} <= set(names)
    assert not {"b2", "b3", "b6"} & set(names)
    assert "b6" in hs.GeneralizedBoucWen().search_space(hs.Record(u=u - 0.5, y=rec.y)).names


@pytest.mark.parametrize("n", [0.6, 1.0, 2.5])
@pytest.mark.parametrize("first", [5e-324, 1e-308, -1e-305])
def test_a_memory_that_is_hardly_a_number_is_as_good_as_none(n, first):
    law = hs.ZhuWangBoucWen(beta=0.3, gamma=0.1, n=n, delta=-0.01)
    for end in (3.0, -3.0):
        np.testing.assert_allclose(law.response([0.0, first, end])[-1], law.response([0.0, end])[-1], rtol=1e-10)


# --------------------------------------- the law of Zhu and Wang against the equation of Riccati, and at special values


def riccati(w, a, d, c, length):
    """Value after `length` on w' = a + d L - c w^2: y'' = c (a + d L) y for y'/y = c w, solved by Airy functions."""
    with mpmath.workdps(40):
        w, a, d, c, length = (mpmath.mpf(value) for value in (w, a, d, c, length))
        k = mpmath.cbrt(c * d)
        begin, end = c * a / k**2, k * length + c * a / k**2
        ai, bi, ai_slope, bi_slope = _airy(begin)
        p, q = bi_slope * k - c * w * bi, c * w * ai - ai_slope * k  # y = p Ai + q Bi has y'/y = c w at the beginning
        ai, bi, ai_slope, bi_slope = _airy(end)
        return float(k * (p * ai_slope + q * bi_slope) / (c * (p * ai + q * bi)))


def _airy(x):
    return (mpmath.airyai(x), mpmath.airybi(x), mpmath.airyai(x, derivative=1), mpmath.airybi(x, derivative=1))


def rising(a, d, c, **others):
    """The law with w' = a + d L - c w^n on the way up from u = 0, on the side z > 0."""
    return hs.ZhuWangBoucWen(A=a, beta=0.75 * c, gamma=0.25 * c, delta=d, **others)


def after(model, length):
    """Memory after the input has risen from 0 by `length` in one step."""
    return float(model.memory([0.0, length])[-1])


@pytest.mark.parametrize("w", [0.0, 1e-9, 0.2, 1.0, 3.0])
@pytest.mark.parametrize(("a", "d"), [(0.0, 1.0), (1e-7, 1.0), (1.0, 1e-3), (1.0, 0.5), (0.1, 8.0)])
def test_for_n_2_a_rising_branch_is_riccatis(a, d, w):
    """a = c w^2 is among them, where the memory stands still for a moment and then rises with the forcing."""
    for length in (1e-3, 0.3, 5.0):
        expected = riccati(w, a, d, 1.0, length)
        assert after(rising(a, d, 1.0, n=2.0, z0=w), length) == pytest.approx(expected, abs=1e-10 * max(w, expected))


@pytest.mark.parametrize("d", [30.0, 300.0, 1000.0, 3000.0, 1e5])
def test_the_first_way_from_zero_is_good_where_the_forcing_grows_on_it(d):
    """Stretches of a few times the length that is gone in one closed step, on which the forcing grows by an eighth."""
    for length in np.geomspace(3e-5, 3e-3, 12):
        expected = riccati(0.0, 1.0, d, 1.0, length)
        assert after(rising(1.0, d, 1.0, n=2.0), length) == pytest.approx(expected, rel=1e-10, abs=0.0)


@pytest.mark.parametrize("n", [0.3, 2.0, 3.5])
@pytest.mark.parametrize(("of_u", "of_z"), [(40, 0), (-40, 0), (30, -60), (-30, 60), (-80, -80)])
def test_the_units_do_not_matter(n, of_u, of_z):
    """Powers of two, so that only A, beta, gamma and delta are rounded."""
    U, Z = 2.0**of_u, 2.0**of_z
    u = np.array([0.0, 1.5, -1.0, 2.0, -2.5, -0.5, 0.0, 3.0])
    for A, delta in ((0.0, 1.0), (1.0, 0.4)):
        if A == 0.0 and n < 1.0:
            continue  # too stiff near zero: w follows (delta L / c)^(1/n), to which it falls at an infinite rate there
        plain = hs.ZhuWangBoucWen(A=A, beta=0.6, gamma=0.3, delta=delta, n=n).memory(u)
        decay = 1.0 / (Z ** (n - 1.0) * U)
        other = hs.ZhuWangBoucWen(A=A * Z / U, beta=0.6 * decay, gamma=0.3 * decay, delta=delta * Z / U / U, n=n)
        assert np.abs(other.memory(U * u) / Z - plain).max() < 1e-10 * np.ptp(plain)


@pytest.mark.parametrize("n", [1.0, 2.0])
def test_from_nothing_a_forcing_that_begins_with_zero_decides_the_side(n):
    for delta in (0.5, -0.5):
        side = np.sign(delta)
        model = hs.ZhuWangBoucWen(A=0.0, beta=0.7, gamma=0.2, delta=delta, n=n)
        c, length = 0.7 + 0.2 * side, 2.0
        linear = (length + np.expm1(-c * length) / c) / c
        expected = 0.5 * linear if n == 1.0 else riccati(0.0, 0.0, 0.5, c, length)
        assert after(model, length) == pytest.approx(side * expected, rel=1e-10)


def test_without_its_term_a_memory_of_slope_one_does_not_rest():
    expected = np.sqrt(2.0) * np.tanh(np.sqrt(2.0) * 0.7 + np.arctanh(np.sqrt(0.5)))
    assert after(rising(2.0, 0.0, 1.0, n=2.0, z0=1.0), 0.7) == pytest.approx(expected, rel=1e-10, abs=0.0)
    assert after(rising(1.0, 0.0, 1.0, n=2.0, z0=1.0), 0.7) == 1.0  # at its balance it does


def test_a_growth_beyond_the_largest_number_is_a_divergence_unless_the_forcing_balances_it():
    """n = 1 and w' = a + d L + w: w = L + 1 solves it for a = 0 and d = -1, and all others diverge."""
    assert after(rising(0.0, -1.0, -1.0, z0=1.0), 1000.0) == 1001.0
    for a, d, z0 in ((0.1, -1.0, 1.0), (0.0, 0.3, 0.0), (0.5, -1.0, 1.0)):
        assert_refused("diverges", after, rising(a, d, -1.0, z0=z0), 1000.0, error=hs.SimulationError)


@pytest.mark.parametrize("step", [5e-324, 1e-320, 1e-310, -1e-320])
@pytest.mark.parametrize("n", [0.5, 1.0, 2.0])
def test_the_smallest_steps_of_the_input_change_nothing(n, step):
    z, state = hs.ZhuWangBoucWen(n=n, delta=0.3).advance([step], (0.0, 0.5))
    assert z[-1] == 0.5
    assert state == (step, 0.5)
