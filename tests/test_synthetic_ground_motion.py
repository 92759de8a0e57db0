"""A synthetic ground motion has the density of its filters, the shape of its envelope, and ends at rest."""

import math
from itertools import pairwise

import numpy as np
import pytest
from strategies import refused

import hysim as hs

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
