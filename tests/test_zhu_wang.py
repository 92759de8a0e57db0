"""The law of Zhu and Wang against Riccati's equation, for n = 2 solved by Airy functions, and at special values."""

import mpmath
import numpy as np
import pytest

import hysim as hs


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


def law(a, d, c, **others):
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
        assert after(law(a, d, 1.0, n=2.0, z0=w), length) == pytest.approx(expected, abs=1e-10 * max(w, expected))


@pytest.mark.parametrize("d", [30.0, 300.0, 1000.0, 3000.0, 1e5])
def test_the_first_way_from_zero_is_good_where_the_forcing_grows_on_it(d):
    """Stretches of a few times the length that is gone in one closed step, on which the forcing grows by an eighth."""
    for length in np.geomspace(3e-5, 3e-3, 12):
        expected = riccati(0.0, 1.0, d, 1.0, length)
        assert after(law(1.0, d, 1.0, n=2.0), length) == pytest.approx(expected, rel=1e-10, abs=0.0)


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
    assert after(law(2.0, 0.0, 1.0, n=2.0, z0=1.0), 0.7) == pytest.approx(expected, rel=1e-10, abs=0.0)
    assert after(law(1.0, 0.0, 1.0, n=2.0, z0=1.0), 0.7) == 1.0  # at its balance it does


def test_a_growth_beyond_the_largest_number_is_a_divergence_unless_the_forcing_balances_it():
    """n = 1 and w' = a + d L + w: w = L + 1 solves it for a = 0 and d = -1, and all others diverge."""
    assert after(law(0.0, -1.0, -1.0, z0=1.0), 1000.0) == 1001.0
    for a, d, z0 in ((0.1, -1.0, 1.0), (0.0, 0.3, 0.0), (0.5, -1.0, 1.0)):
        with pytest.raises(hs.SimulationError, match="diverges"):
            after(law(a, d, -1.0, z0=z0), 1000.0)


@pytest.mark.parametrize("step", [5e-324, 1e-320, 1e-310, -1e-320])
@pytest.mark.parametrize("n", [0.5, 1.0, 2.0])
def test_the_smallest_steps_of_the_input_change_nothing(n, step):
    model = hs.ZhuWangBoucWen(n=n, delta=0.3)
    z, state = model.advance([step], (0.0, 0.5))
    assert z[-1] == 0.5
    assert state == (step, 0.5)
