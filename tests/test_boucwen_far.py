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
