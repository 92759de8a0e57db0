"""Signals hit their extremes exactly, and every cycle has the same bits; ground motions have their density."""

import itertools
import math
from itertools import pairwise

import numpy as np
import pytest
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st
from strategies import refused

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


@given(LEVEL, st.floats(0.01, 10.0), CYCLES, st.integers(2, 50))
def test_a_sawtooth_hits_both_ends_of_every_line(low, span, cycles, n):
    u = hs.signals.sawtooth(low, low + span, cycles=cycles, samples_per_cycle=n).reshape(cycles, n)
    assert (u == u[0]).all()
    assert (u[0, 0], u[0, -1]) == (low, low + span)
    assert np.diff(u[0]) == pytest.approx((low + span - low) / (n - 1), abs=1e-13)  # rounding of levels up to 110


@given(LEVEL, st.floats(0.01, 10.0), CYCLES, st.integers(1, 20))
def test_a_square_wave_has_two_values(low, span, cycles, half):
    assert hs.signals.square(0, 1, cycles=1, samples_per_half=2).dtype == float
    u = hs.signals.square(low, low + span, cycles=cycles, samples_per_half=half).reshape(cycles, 2, half)
    assert (u[:, 0] == low).all()
    assert (u[:, 1] == low + span).all()


@given(st.floats(0.01, 10.0), LEVEL, st.integers(1, 6), st.integers(1, 20), st.none() | st.floats(0.1, 1.0))
def test_cycles_of_a_fading_sine_are_sines_with_their_own_extremes(amplitude, mean, cycles, quarter, ratio):
    n, k = 4 * quarter, np.arange(cycles)
    amplitudes = amplitude * ((cycles - k) / cycles if ratio is None else ratio**k)
    options = {"mean": mean, "cycles": cycles, "samples_per_cycle": n, "ratio": ratio}
    fading, growing = hs.signals.decaying_sine(amplitude, **options), hs.signals.growing_sine(amplitude, **options)
    for u, swings in ((fading, amplitudes), (growing, amplitudes[::-1])):
        assert u.size == cycles * n + 1
        assert u[-1] == mean
        for cycle, swing in zip(u[:-1].reshape(cycles, n), swings, strict=True):
            assert (cycle[0], cycle[quarter], cycle[3 * quarter]) == (mean, mean + swing, mean - swing)
            assert (cycle.max(), cycle.min()) == (mean + swing, mean - swing)
            sine = hs.signals.sine(swing, mean=mean, cycles=1, samples_per_cycle=n)
            assert np.array_equal(cycle, sine[:-1])


@given(st.lists(LEVEL, min_size=2, max_size=8), st.floats(0.1, 50.0))
def test_lines_between_extremes_hit_them_and_step_evenly(levels, max_step):
    u = hs.signals.extremes(levels, max_step=max_step)
    counts = [max(1, math.ceil(abs(b - a) / max_step * (1 - 1e-12))) for a, b in itertools.pairwise(levels)]
    places = np.cumsum([0, *counts])
    assert u.size == places[-1] + 1
    assert u[places].tolist() == levels
    assert np.abs(np.diff(u)).max() <= max_step * (1 + 1e-11) + 1e-13  # a step that fits to rounding is not divided
    assert np.array_equal(u, hs.signals.extremes(levels, samples_per_line=counts))


def test_the_other_signals_are_lines_between_extremes():
    triangle = hs.signals.triangle(-1.0, 2.0, cycles=2, samples_per_cycle=10)
    assert hs.signals.extremes([-1.0, 2.0, -1.0, 2.0, -1.0], samples_per_line=5) == pytest.approx(triangle, abs=1e-15)
    curves = hs.signals.reversal_curves(0.0, 1.0, curves=2, samples_per_step=3)
    assert hs.signals.extremes([0.0, 0.5, 0.0, 1.0, 0.0], max_step=0.5 / 3) == pytest.approx(curves, abs=1e-15)


@given(
    st.sets(st.integers(1, 31), min_size=1).map(sorted),
    st.floats(0.01, 100.0),
    LEVEL,
    st.integers(1, 3),
    st.sampled_from([64, 65, 100]),
    st.sampled_from(["random", "schroeder"]),
)
def test_a_multisine_has_its_lines_and_no_others(lines, rms, mean, periods, n, phases):
    u = hs.signals.multisine(lines, rms=rms, mean=mean, periods=periods, samples_per_period=n, phases=phases, seed=4)
    period = u[:n]
    assert np.array_equal(u, np.tile(period, periods))
    spectrum = np.abs(np.fft.rfft(period)) / n
    expected = np.zeros(n // 2 + 1)
    expected[lines] = rms / math.sqrt(2 * len(lines))
    expected[0] = abs(mean)
    assert spectrum == pytest.approx(expected, abs=1e-12 * (rms + abs(mean)))  # rounding of values of this size
    assert math.sqrt(np.mean((period - mean) ** 2)) == pytest.approx(rms, abs=1e-12 * (rms + abs(mean)))


def test_phases_come_from_the_seed_or_from_schroeder():
    options = {"rms": 1.0, "samples_per_period": 512}
    band = np.arange(1, 101)
    one, same, other = (hs.signals.multisine(band, seed=seed, **options) for seed in (1, np.random.default_rng(1), 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
    low = hs.signals.multisine(band, phases="schroeder", **options)
    assert np.abs(low).max() < 1.8 < 2.5 < min(np.abs(one).max(), np.abs(other).max())  # crest: 1.7, against about 3


@pytest.mark.parametrize(("spacing", "method"), [("linear", "linear"), ("logarithmic", "logarithmic")])
@pytest.mark.parametrize(("start", "stop"), [(1.0, 40.0), (40.0, 1.0)])
def test_a_sweep_is_that_of_scipy(spacing, method, start, stop):
    n, sample_time = 5000, 1e-3
    u = hs.signals.sweep(start, stop, amplitude=2.0, mean=1.0, n_samples=n, sample_time=sample_time, spacing=spacing)
    t = np.arange(n) / 1000.0
    expected = 1.0 + 2.0 * scipy.signal.chirp(t, start, n * sample_time, stop, method=method, phi=-90.0)
    assert u[0] == 1.0
    assert u == pytest.approx(expected, abs=1e-11)  # rounding of 100 turns, twice over


def test_a_sweep_of_one_frequency_is_a_sine():
    u = hs.signals.sweep(5.0, 5.0, amplitude=1.0, n_samples=201, sample_time=0.001)
    assert u == pytest.approx(hs.signals.sine(1.0, cycles=1, samples_per_cycle=200), abs=1e-14)


@given(st.integers(1, 10_000))
def test_times_are_the_nearest_numbers_to_the_decimal_ones(rate):
    assert np.array_equal(hs.signals.sample_times(1000, 1.0 / rate), np.arange(1000) / rate)


def test_times_of_any_step_are_rounded_once():
    t = hs.signals.sample_times(1001, 0.007)
    assert t[1000] == 1000 * 0.007
    assert hs.Record(u=t, y=t, t=t).sample_time == pytest.approx(0.007, rel=1e-15)


SIGNALS = hs.signals
LINES = {"rms": 1.0, "samples_per_period": 8}
SWEEP = {"amplitude": 1.0, "n_samples": 10, "sample_time": 0.1}


test_impossible_signals_are_refused = refused(
    (lambda: SIGNALS.sawtooth(0, 1, cycles=1, samples_per_cycle=1), "at least 2, one for each end"),
    (lambda: SIGNALS.square(1, 1, cycles=1, samples_per_half=1), "high must be above low"),
    (lambda: SIGNALS.square(0, 1, cycles=1, samples_per_half=0), "samples_per_half must be at least 1"),
    (lambda: SIGNALS.decaying_sine(-1, cycles=1, samples_per_cycle=4), "amplitude must be positive"),
    (lambda: SIGNALS.growing_sine(1, mean=math.inf, cycles=1, samples_per_cycle=4), "mean must be finite"),
    (lambda: SIGNALS.decaying_sine(1, cycles=1, samples_per_cycle=4, ratio=1.5), "above 0 and at most 1, got 1.5"),
    (lambda: SIGNALS.extremes([1.0], max_step=1), "two levels, got 1"),
    (lambda: SIGNALS.extremes([0.0, 1.0]), "either samples_per_line or max_step"),
    (lambda: SIGNALS.extremes([0.0, 1.0], samples_per_line=1, max_step=1.0), "either samples_per_line or"),
    (lambda: SIGNALS.extremes([0.0, 1.0], samples_per_line=[1, 1]), "one for each of 1 lines, got 2"),
    (lambda: SIGNALS.extremes([0.0, 1.0], samples_per_line=0), "at least 1, got 0"),
    (lambda: SIGNALS.extremes([0.0, 1.0], max_step=0.0), "max_step must be positive"),
    (lambda: SIGNALS.extremes([0.0, 1.0], max_step=1e-300), r"1e\+300 steps, more than 1e\+08"),
    (lambda: SIGNALS.multisine([4], **LINES), "below half of 8 samples, got 4 to 4"),
    (lambda: SIGNALS.multisine([2, 1], **LINES), "increasing"),
    (lambda: SIGNALS.multisine([], **LINES), "whole numbers"),
    (lambda: SIGNALS.multisine([1], rms=0.0, samples_per_period=8), "rms must be positive"),
    (lambda: SIGNALS.multisine([1], phases="zero", **LINES), '"random" or "schroeder"'),
    (lambda: SIGNALS.sweep(1.0, 5.0, **SWEEP), "stop must be from 0 to below half the sampling rate, got 5.0"),
    (lambda: SIGNALS.sweep(1.0, 2.0, **SWEEP | {"amplitude": 0.0}), "amplitude must be positive"),
    (lambda: SIGNALS.sweep(1.0, 2.0, **SWEEP | {"sample_time": 0.0}), "sample_time must be positive"),
    (lambda: SIGNALS.sweep(0.0, 2.0, spacing="logarithmic", **SWEEP), "two different positive frequencies"),
    (lambda: SIGNALS.sweep(1.0, 2.0, spacing="square", **SWEEP), '"linear" or "logarithmic"'),
    (lambda: SIGNALS.sample_times(0, 1.0), "n_samples must be at least 1"),
    (lambda: SIGNALS.sample_times(1, math.nan), "sample_time must be positive"),
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
    (lambda: hs.signals.sine(1.0, cycles=1.5, samples_per_cycle=4), TypeError, "cycles must be a whole number"),
    error=(ValueError, TypeError),
)


# ------------------------------------------ synthetic ground motions: density of the filters, envelope, rest at the end


SOILS = {
    "firm": {},
    "medium": {"ground_frequency": 10.0, "ground_damping": 0.4, "corner_frequency": 1.0},
    "soft": {"ground_frequency": 5.0, "ground_damping": 0.2, "corner_frequency": 0.5},
}


def motion(**changes):
    return hs.signals.ground_motion(**{"peak": 3.0, "duration": 20.0, "sample_time": 0.02, "seed": 4} | changes)


def clough_penzien(w, ground_frequency=15.0, ground_damping=0.6, corner_frequency=1.5, corner_damping=0.6):
    """The density of Clough and Penzien for S_0 = 1, as it is printed."""
    wg, zg, wc, zc = ground_frequency, ground_damping, corner_frequency, corner_damping
    soil = (wg**4 + (2 * zg * wg * w) ** 2) / ((wg**2 - w**2) ** 2 + (2 * zg * wg * w) ** 2)
    return soil * w**4 / ((wc**2 - w**2) ** 2 + (2 * zc * wc * w) ** 2)


@pytest.mark.parametrize("soil", SOILS)
def test_the_density_is_that_of_kanai_tajimi_and_clough_penzien(soil):
    """Periodograms of 120 stationary pieces of 82 s, under a Hann window against leakage, each over its own total.

    The mean of m lines of one periodogram has the relative variance 35 / (18 m): the window correlates neighbouring
    lines by 4 / 9 and 1 / 36, squared amplitudes. So the total has 35 / 18 of the sum of the lines' squared
    shares; division by it adds this variance, and a bias of the same size. Four standard errors of 120 seeds and the
    bias are allowed.
    """
    n, step, n_seeds = 4096, 0.02, 120
    window = np.hanning(n + 1)[:-1]
    options = {"duration": (n - 1) * step, "sample_time": step, "envelope": "none", **SOILS[soil]}
    total = np.zeros(n // 2 + 1)
    for seed in range(n_seeds):
        power = np.abs(np.fft.rfft(window * hs.signals.ground_motion(1.0, seed=seed, **options))) ** 2
        total += power / power.sum()
    w = 2 * np.pi * np.fft.rfftfreq(n, step)
    share = clough_penzien(w, **SOILS[soil])
    share /= share.sum()
    of_total = 35.0 / 18.0 * np.sum(share**2)
    edges = np.geomspace(8, n // 2, 15).astype(int)  # from 0.6 rad/s to half the sampling rate
    for begin, stop in pairwise(edges):
        measured, wanted = total[begin:stop].sum() / n_seeds, share[begin:stop].sum()
        tolerance = 4.0 * math.sqrt((35.0 / 18.0 / (stop - begin) + of_total) / n_seeds) + of_total
        assert measured == pytest.approx(wanted, rel=tolerance), (soil, w[begin])


@pytest.mark.parametrize("envelope", ["saragoni-hart", "jennings"])
def test_the_energy_comes_as_the_envelope_has_it(envelope):
    """Shares of the squared acceleration in tenths of the duration, over 200 seeds.

    Each share has an error of a few per cent of the largest one: a tenth of 2 s holds about 15 independent values of a
    motion whose correlation lasts 1 / (zeta_g w_g) = 0.1 s, with 200 seeds 2.6 %. Division by the peak of each motion,
    the high pass and the baseline change less. Five times as much is allowed.
    """
    t = np.linspace(0.0, 1.0, 1001)
    if envelope == "jennings":
        q = np.select([t < 0.2, t < 0.5], [(t / 0.2) ** 2, 1.0], 0.05 ** ((t - 0.5) / 0.5))
    else:
        b = 0.2 * math.log(0.05) / -(1 + 0.2 * (math.log(0.2) - 1))  # as Boore (1983) has it
        q = (t / 0.2) ** b * np.exp(b * (1.0 - t / 0.2))
        assert (q[200], q[-1]) == pytest.approx((1.0, 0.05))
    energy = sum(motion(envelope=envelope, seed=seed) ** 2 for seed in range(200))
    measured, wanted = (np.add.reduceat(each[:1000], np.arange(0, 1000, 100)) for each in (energy, q**2))
    assert measured / measured.sum() == pytest.approx(wanted / wanted.sum(), abs=0.13 * wanted.max() / wanted.sum())


@pytest.mark.parametrize("soil", SOILS)
@pytest.mark.parametrize("envelope", ["saragoni-hart", "jennings", "none"])
def test_the_peak_is_hit_and_the_ground_ends_where_it_was(envelope, soil):
    a, h = motion(envelope=envelope, **SOILS[soil]), 0.02
    assert a.size == 1001
    assert np.abs(a).max() == 3.0
    if envelope != "none":
        assert a[0] == 0.0
    velocity = np.concatenate([[0.0], np.cumsum(h * (a[1:] + a[:-1]) / 2)])  # exact for lines between samples
    displacement = np.concatenate([[0.0], np.cumsum(h * velocity[:-1] + h**2 * (2 * a[:-1] + a[1:]) / 6)])
    assert abs(velocity[-1]) < 1e-12  # rounding of 1000 sums of 0.1 m/s and of 1 m
    assert abs(displacement[-1]) < 1e-11
    assert np.abs(velocity).max() > 0.1


def test_a_seed_gives_the_same_bits_and_another_one_others():
    assert np.array_equal(motion(), motion())
    assert np.array_equal(motion(), motion(seed=np.random.default_rng(4)))
    assert not np.array_equal(motion(), motion(seed=5))
    assert np.array_equal(motion(peak=6.0), 2.0 * motion())


def test_an_oscillator_with_a_short_period_follows_the_ground_and_one_with_a_long_one_stays():
    """Limits of every response spectrum: the peak acceleration of the ground, and its peak displacement."""
    a, h = motion(duration=20.0), 0.02
    t = hs.signals.sample_times(a.size, h)
    velocity = np.concatenate([[0.0], np.cumsum(h * (a[1:] + a[:-1]) / 2)])
    displacement = np.concatenate([[0.0], np.cumsum(h * velocity[:-1] + h**2 * (2 * a[:-1] + a[1:]) / 6)])

    def drift(period):
        w = 2 * np.pi / period
        plant = hs.BoucWenOscillator(
            mass=1.0, damping=0.1 * w, stiffness=0.5 * w**2, law=hs.BoucWen(A=0.5 * w**2, beta=0.0, gamma=0.0),
            excitation="base",
        )  # fmt: skip
        return hs.simulate(plant, t, a).y, w

    stiff, w = drift(0.02)
    assert np.abs(stiff).max() * w**2 == pytest.approx(3.0, rel=0.02)  # lines between samples move it a little
    soft, _ = drift(1000.0)
    assert np.abs(soft).max() == pytest.approx(np.abs(displacement).max(), rel=0.02)  # damping of 2 % of a turn


test_an_impossible_motion_is_refused = refused(
    ({"peak": 0.0}, "peak must be positive, got 0.0"),
    ({"peak": math.inf}, "peak must be finite"),
    ({"duration": -1.0}, "duration must be positive and finite, got -1.0"),
    ({"sample_time": math.nan}, "sample_time must be positive and finite, got nan"),
    ({"duration": 0.1}, r"from 16 to 1e\+07 samples, got 6"),
    ({"duration": 1e9}, r"from 16 to 1e\+07 samples, got 5e\+10"),
    ({"ground_frequency": 160.0}, "ground_frequency must be below half the sampling rate, 157.08 rad/s, got 160"),
    ({"corner_frequency": 0.0}, "corner_frequency must be positive"),
    ({"ground_damping": math.nan}, "ground_damping must be positive"),
    ({"corner_damping": math.inf}, "corner_damping must be finite"),
    ({"envelope": "hann"}, "envelope must be one of saragoni-hart, jennings, none, got 'hann'"),
    ({"rise": 1.0}, "rise must be between 0 and 1, got 1.0"),
    ({"end": 0.0}, "end must be between 0 and 1, got 0.0"),
    ({"envelope": "jennings", "plateau": 0.8}, r"rise \+ plateau must be below 1, got 0.2 \+ 0.8"),
    ({"plateau": -0.1}, "plateau must not be negative"),
    call=lambda changes: motion(**changes),
)
