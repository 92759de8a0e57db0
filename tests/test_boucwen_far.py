"""Inputs far beyond saturation end, and end at the balance."""

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
