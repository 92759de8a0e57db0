"""The memory with which a cycle ends as it began is one that a repetition of the input ends in."""

import numpy as np
import pytest

from hysim.models.steady_cycle import fixed_point


def memory_after(one_pass, start):
    """The fixed point of the same pass for all sets, from `start` (n_sets,)."""
    return fixed_point(lambda sets: one_pass, np.array(start)[:, np.newaxis])[:, 0]


def test_a_cycle_that_leads_away_is_not_found():
    """The pass, which saturates as a memory does, has fixed points at 0 and at the ends of z = 1.5 tanh z."""
    ends = memory_after(lambda z: 1.5 * np.tanh(z), [0.3, -0.3, 2.0])
    assert ends == pytest.approx([1.28783945, -1.28783945, 1.28783945], abs=2e-3)  # after eight passes


@pytest.mark.parametrize("factor", [0.95, 0.0, -0.9])
def test_a_cycle_that_attracts_is_found_to_rounding(factor):
    assert memory_after(lambda z: 2.0 + factor * (z - 2.0), [-5.0, 1e3]) == pytest.approx(2.0, abs=1e-9)


def test_a_pass_that_overshoots_by_more_than_it_was_off_has_no_steady_cycle():
    assert np.abs(memory_after(lambda z: -1.5 * z, [1.0])[0]) > 1.0
