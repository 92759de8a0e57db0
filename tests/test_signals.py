"""Signals hit their extremes exactly, and every cycle has the same bits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hysim as hs

CYCLES = st.integers(1, 4)
LEVEL = st.floats(-100.0, 100.0)


def test_a_staircase_is_the_input_of_table_1():
    assert np.array_equal(hs.signals.staircase(0, 125, 5), hs.datasets.table1().u)


def test_a_staircase_dwells_at_each_level():
    once = hs.signals.staircase(-1.0, 1.0, 0.1, cycles=2)
    assert once.size == 2 * 2 * 21
    assert np.array_equal(hs.signals.staircase(-1.0, 1.0, 0.1, cycles=2, samples_per_step=3), np.repeat(once, 3))


@given(LEVEL, st.floats(0.01, 10.0), st.integers(1, 50), CYCLES)
def test_a_staircase_goes_down_the_levels_that_it_came_up(low, step, n_steps, cycles):
    high = low + n_steps * step
    u = hs.signals.staircase(low, high, (high - low) / n_steps, cycles=cycles)
    cycle = u[: u.size // cycles]
    assert np.array_equal(cycle, cycle[::-1])
    assert np.array_equal(u, np.tile(cycle, cycles))
    assert (cycle.min(), cycle.max(), cycle[0], cycle[n_steps]) == (low, high, low, high)


@given(LEVEL, st.floats(0.01, 10.0), CYCLES, st.integers(1, 50))
def test_a_triangle_hits_both_extremes_and_is_straight_between(low, span, cycles, half):
    high = low + span
    u = hs.signals.triangle(low, high, cycles=cycles, samples_per_cycle=2 * half)
    assert u.size == 2 * half * cycles + 1
    assert np.array_equal(np.flatnonzero(u == low), 2 * half * np.arange(cycles + 1))
    assert np.array_equal(np.flatnonzero(u == high), 2 * half * np.arange(cycles) + half)
    assert np.array_equal(u, u[::-1])
    slopes = np.abs(np.diff(u))
    assert slopes == pytest.approx(span / half, abs=1e-13)  # rounding of levels up to 110


@given(st.floats(0.01, 10.0), LEVEL, CYCLES, st.integers(1, 60))
def test_a_sine_is_a_sine(amplitude, mean, cycles, n):
    u = hs.signals.sine(amplitude, mean=mean, cycles=cycles, samples_per_cycle=n)
    phase = 2 * np.pi * np.arange(cycles * n + 1) / n
    assert u == pytest.approx(mean + amplitude * np.sin(phase), abs=1e-12)  # rounding of the phase, up to 8 pi
    assert np.array_equal(u[:n], u[-n - 1 : -1])
    assert (u[0], u[-1]) == (mean, mean)


def test_a_sine_is_exact_where_its_value_is():
    assert hs.signals.sine(3.0, cycles=1, samples_per_cycle=4).tolist() == [0.0, 3.0, 0.0, -3.0, 0.0]
    u = hs.signals.sine(1.0, cycles=1, samples_per_cycle=100)
    assert np.array_equal(u[:51], u[50::-1])
    assert np.array_equal(u[50:], -u[:51])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hs.signals.staircase(0, 10, 3), "divide the span 10, got 3: 3.33333 steps"),
        (lambda: hs.signals.staircase(0, 1, 2), "divide the span"),
        (lambda: hs.signals.staircase(0, 1, -1), "step must be positive"),
        (lambda: hs.signals.staircase(1, 0, 1), "high must be above low"),
        (lambda: hs.signals.staircase(0, 1, 1, cycles=0), "cycles must be at least 1, got 0"),
        (lambda: hs.signals.staircase(0, 1, 1, samples_per_step=0), "samples_per_step must be at least 1"),
        (lambda: hs.signals.triangle(0, math.inf, cycles=1, samples_per_cycle=2), "finite"),
        (lambda: hs.signals.triangle(0, 1, cycles=1, samples_per_cycle=3), "must be even"),
        (lambda: hs.signals.sine(0.0, cycles=1, samples_per_cycle=4), "amplitude must be positive"),
        (lambda: hs.signals.sine(1.0, mean=math.nan, cycles=1, samples_per_cycle=4), "finite"),
    ],
)
def test_impossible_signals_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_counts_are_whole_numbers():
    with pytest.raises(TypeError, match="integer"):
        hs.signals.sine(1.0, cycles=1.5, samples_per_cycle=4)
