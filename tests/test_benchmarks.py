"""The generated benchmark is the published one."""

import numpy as np
import pytest
from strategies import needs_compiled, refused

import hysim as hs
from hysim.plants.oscillator_structure import decimated

# Eight of the 153 000 samples of the published, noise-free sine-sweep output (Noel and Schoukens 2016,
# doi 10.4121/12967592, file yval_sinesweep), read from the published pair and printed with 17 digits.
PUBLISHED = {
    1: 1.0763363794087143e-06,
    7: 0.0002287550886171345,
    100: 0.00039225705713048065,
    7_777: -0.0002530360837541445,
    50_000: 0.0006923365296895768,
    76_500: -0.0006832793651637574,
    120_000: -0.0005327016704158793,
    152_999: 0.0001266745035238127,
}


@needs_compiled
def test_the_published_sweep_comes_back():
    t = np.arange(hs.benchmarks.SWEEP_LENGTH) / 750.0
    u = 40.0 * np.sin(2.0 * np.pi * (18.0 * t + t**2 / 12.0))
    y = hs.benchmarks.simulate_official(u, kind="sweep")
    assert max(abs(y[k] - value) for k, value in PUBLISHED.items()) < 1e-14
    assert np.sqrt(np.mean(y**2)) == pytest.approx(6.637e-4, rel=1e-4)
    record = hs.benchmarks.noel_schoukens("sweep")
    assert np.array_equal(record.y, y)
    assert np.abs(record.u - u).max() < 1e-9


def test_the_begin_of_the_sweep_is_the_published_one():
    """The last sample alone feels where the record ends: the filter reaches 15 samples at 15 kHz ahead."""
    t = np.arange(12) / 750.0
    y = hs.benchmarks.simulate_official(40.0 * np.sin(2.0 * np.pi * (18.0 * t + t**2 / 12.0)), kind="sweep")
    early = {k: value for k, value in PUBLISHED.items() if k < 11}
    assert len(early) >= 2
    assert max(abs(y[k] - value) for k, value in early.items()) < 1e-17


@needs_compiled
def test_the_multisine_has_the_published_facts():
    record = hs.benchmarks.noel_schoukens(seed=1, periods=1)
    amplitudes = np.abs(np.fft.rfft(record.u))
    lines = np.flatnonzero(amplitudes > 1e-9 * amplitudes.max())
    assert lines.size == 1585
    assert np.round(lines[[0, -1]] * 750.0 / 8192.0, 3).tolist() == [5.035, 150.055]
    assert np.ptp(amplitudes[lines]) < 1e-9 * amplitudes.max()
    assert record.u.std() == pytest.approx(50.0, rel=1e-12)
    assert record.y.std() == pytest.approx(6.67e-4, rel=0.01)
    assert record.sample_time == pytest.approx(1.0 / 750.0)


@needs_compiled
def test_the_generator_and_the_simulation_of_a_published_input_agree():
    record = hs.benchmarks.noel_schoukens(seed=5, periods=2, level=30.0)
    official = hs.benchmarks.simulate_official(record.u[:8192])
    assert np.abs(official - record.y[:8192]).max() < 1e-14
    assert np.abs(record.y[8192:] - record.y[:8192]).max() < 1e-13  # what the transient has left
    assert record.u.std() == pytest.approx(30.0, rel=1e-12)


@needs_compiled
def test_training_noise_has_the_published_level():
    """7.35e-6 m after the filters, to the scatter of three periods (0.5 %) twice over; 39 dB; new in each period."""
    clean, noisy = (hs.benchmarks.noel_schoukens(seed=2, periods=3, noise=level) for level in (0.0, 8e-6))
    assert np.array_equal(clean.u, noisy.u)
    added = (noisy.y - clean.y).reshape(3, -1)
    assert added.std() == pytest.approx(7.35e-6, rel=0.01)
    assert 20.0 * np.log10(clean.y.std() / added.std()) == pytest.approx(39.0, abs=0.5)
    assert np.abs(np.corrcoef(added) - np.eye(3)).max() < 0.05


@needs_compiled
def test_a_record_from_rest_begins_at_rest_and_seeds_differ():
    record = hs.benchmarks.noel_schoukens(seed=1, periods=1, initial="rest")
    steady, other = (hs.benchmarks.noel_schoukens(seed=seed, periods=1) for seed in (1, 2))
    assert record.y[0] == pytest.approx(0.0, abs=1e-6)
    assert np.array_equal(record.u, steady.u)
    assert not np.array_equal(record.u, other.u)
    assert np.abs(record.y - steady.y)[4000:].max() < 1e-8


def test_decimation_keeps_straight_lines():
    """The mirrored ends continue a line, and the filter has no delay."""
    line = np.linspace(-1.0, 3.0, 400)
    for stages in ((2, 2, 5), (20,)):
        assert np.abs(decimated(line, stages) - line[::20]).max() < 1e-14


def test_a_short_period_is_simulated_too():
    u = 50.0 * np.sin(2.0 * np.pi * 3 * np.arange(48) / 48)
    assert hs.benchmarks.simulate_official(u).shape == (48,)


test_wrong_arguments_are_named = refused(
    (lambda: hs.benchmarks.noel_schoukens("chirp"), "kind must be one of multisine, sweep"),
    (lambda: hs.benchmarks.noel_schoukens(level=-1.0), "level must not be negative"),
    (lambda: hs.benchmarks.noel_schoukens(noise=np.inf), "noise must be finite, got inf"),
    (lambda: hs.benchmarks.noel_schoukens(periods=0), "periods must be at least 1"),
    (lambda: hs.benchmarks.noel_schoukens(initial="free"), "initial must be"),
    (lambda: hs.benchmarks.simulate_official([1.0] * 33), "an even number of samples from 32 on, got 33"),
    (lambda: hs.benchmarks.simulate_official([0.0, 5.0], kind="sweep"), "got 5.0 at sample 1"),
    (lambda: hs.benchmarks.simulate_official([], kind="sweep"), "must hold the published sweep"),
)
