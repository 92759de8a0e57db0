"""Inputs far beyond saturation end, and end at the balance."""

import mpmath
import numpy as np
import pytest

import hysim as hs


@pytest.mark.parametrize("n", [0.5, 1.5, 3.0, 10.0, 20.0])
@pytest.mark.parametrize("reach", [1e3, 1e6, 1e12, 1e100, 1e300])
def test_a_huge_stretch_ends_at_saturation(n, reach):
    law = hs.BoucWen(beta=0.6, gamma=0.3, n=n)
    z = law.memory([0.0, reach, -reach, reach / 3.0])
    balance = (1.0 / 0.9) ** (1.0 / n)
    # a few roundings of w^n, whose relative error is n times that of w
    np.testing.assert_allclose(z, [0.0, balance, -balance, balance], rtol=1e-14)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("n", [0.32, 0.7, 1.0, 1.7, 2.0, 3.0])
def test_a_memory_far_above_a_tiny_balance_falls_to_it_and_not_past_it(n, sign):
    """A change of -642 rounds by 1e-13: added to the memory, it went past the balance, and past zero."""
    balance = 1e-17
    law = hs.BoucWen(A=balance**n, beta=0.6, gamma=0.4, n=n, z0=642.0 * sign)
    reach = 1e5 * max(1.0, balance ** (1.0 - n))
    end = law.memory([0.0, sign * reach])[-1]
    assert end == pytest.approx(sign * balance, rel=1e-14, abs=0.0)  # a few roundings of w^n


@pytest.mark.parametrize("n", [0.32, 0.7, 1.0, 1.7, 2.0, 3.0])
def test_one_long_fall_beside_a_growing_side_stays_on_its_own(n):
    """Below zero this law grows without bound, so that one rounding across zero would be the whole memory."""
    laws = [hs.BoucWen(A=1e-17**n, beta=-50.0, gamma=51.0, n=n, z0=z0) for z0 in (642.0, 641.9, 333.3, 77.7)]
    ends = [law.memory(np.linspace(0.0, 1e4, pieces + 1))[-1] for law in laws for pieces in (1, 2, 7)]
    assert min(ends) > 0.0
    assert max(ends) < 1.0


@pytest.mark.parametrize("above", [2.0**24, 2.0**30, 2.0**40, 2.0**60, 1e40])
def test_a_fall_from_far_above_the_balance_takes_its_length(above):
    """n = 1/2: the way from w to v is 2 (sqrt(w) - sqrt(v)) + 2 log((sqrt(w) - 1) / (sqrt(v) - 1))."""
    for share in (0.9, 0.5, 0.01):
        with mpmath.workdps(60):
            w, v = mpmath.sqrt(above), mpmath.sqrt(share * above)
            length = float(2 * (w - v) + 2 * mpmath.log((w - 1) / (v - 1)))
        z = hs.BoucWen(n=0.5, z0=above).memory([0.0, length])[-1]
        assert z == pytest.approx(share * above, rel=1e-13)  # roundings of the length and of w^n, 20-fold at the end


@pytest.mark.parametrize("n", [3.0, 10.0, 20.0])
@pytest.mark.parametrize("above", [1e10, 1e40, 1e100])
def test_a_fall_from_anywhere_far_above_the_balance_ends_together(n, above):
    """All that begin above 1e10 are within 1e-20 of the one that begins at infinity."""
    ends = [hs.BoucWen(n=n, z0=z0).memory([0.0, 0.3])[-1] for z0 in (above, 7.0 * above, 1e200)]
    assert ends == pytest.approx([ends[0]] * 3, rel=1e-14)


@pytest.mark.parametrize("n", [0.5, 0.9, 1.5, 3.0])
@pytest.mark.parametrize("z0", [0.25, 1.0, 4.0])
def test_without_forcing_the_memory_decays_as_a_power(n, z0):
    law = hs.BoucWen(A=0.0, beta=0.6, gamma=0.3, n=n, z0=z0)
    for length in (1e-3, 0.2, 0.4):
        expected = (z0 ** (1.0 - n) - (1.0 - n) * 0.9 * length) ** (1.0 / (1.0 - n))
        assert law.memory([0.0, length])[-1] == pytest.approx(expected, rel=1e-13)
    still = hs.BoucWen(A=0.0, beta=0.6, gamma=0.3, n=n)
    assert still.memory([0.0, 1.0, -2.0]).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("n", "balance"), [(100.0, 1e3), (50.0, 1e6), (50.0, 1e-6), (35.0, 4e8), (20.0, 1e15), (7.0, 1e-60)]
)
def test_a_sharp_knee_yields_in_any_unit(n, balance):
    """A / (beta + gamma) = balance^n is beyond the numbers of this size, the balance itself is not."""
    A = 10.0 ** (0.5 * n * np.log10(balance))  # the square root of the quotient; beta + gamma is its inverse
    law = hs.BoucWen(A=A, beta=0.5 / A, gamma=0.5 / A, n=n)
    u = np.array([0.0, 3.0, -3.0]) * (balance / A)
    assert law.memory(u) == pytest.approx([0.0, balance, -balance], rel=1e-12)  # n roundings of the quotient, and more
