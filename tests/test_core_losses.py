"""Losses of cores: closed forms, minor loops counted the slow way, and the MagNet Challenge's own script."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from strategies import refused

import hysim as hs

LAW = hs.Steinmetz(k=3.0, alpha=1.4, beta=2.6)
K_I = 3.0 / ((2.0 * np.pi) ** 0.4 * 2.0**1.2 * 4.0 * quad(lambda x: np.cos(x) ** 1.4, 0.0, 0.5 * np.pi)[0])  # of LAW


def test_igse_of_a_sine_is_steinmetz_and_of_ramps_its_closed_form():
    B = hs.signals.sine(0.3, mean=0.1, cycles=1, samples_per_cycle=4000)
    assert LAW.loss_of(B, 1.0 / (50.0 * 4000)) == pytest.approx(LAW.loss(50.0, 0.3), rel=2e-6)  # of the polygon
    B = np.interp(np.linspace(0.0, 1.0, 65), [0.0, 0.125, 1.0], [-0.3, 0.3, -0.3])
    exact = K_I * 0.6**LAW.beta * 50.0**LAW.alpha * (0.125 ** (1.0 - LAW.alpha) + 0.875 ** (1.0 - LAW.alpha))
    assert LAW.loss_of(B, 1.0 / (50.0 * 64)) == pytest.approx(exact, rel=1e-9)


def slow_loops(levels):
    """Spans of a closed path: the smallest stroke between two others is a loop, and is taken out."""
    while len(levels) > 3:
        k = 1 + np.argmin(np.abs(np.diff(levels))[1:-1])
        yield abs(levels[k + 1] - levels[k])
        levels = np.delete(levels, [k, k + 1])
    yield np.ptp(levels)


def test_each_minor_loop_has_its_own_span():
    for n in range(2, 60):
        levels = np.cumsum(np.random.default_rng(n).integers(1, 30, 2 * n) * np.tile([1, -1], n))[:-1]  # turns of B
        levels = np.pad(levels, 1, constant_values=levels.min() - n % 2)  # the lowest level once or twice
        strokes = np.abs(np.diff(levels))
        B = np.interp(np.arange(strokes.sum() + 1), np.append(0, strokes.cumsum()), levels)  # slope 1
        exact = K_I * sum(2.0 * span * span ** (LAW.beta - LAW.alpha) for span in slow_loops(levels)) / (B.size - 1)
        for period in (B, -B[::-1], np.append(B[n:-1], B[: n + 1])):
            assert LAW.loss_of(period, 1.0) == pytest.approx(exact, rel=1e-9)
    assert LAW.loss_of(np.ones(4), 1.0) == 0.0


def test_errors_of_sequences_are_those_of_the_challenge():
    B, meas, pred = np.random.default_rng(1).normal(size=(3, 5, 40))
    rms = np.linalg.norm(pred - meas, axis=1) / np.linalg.norm(meas, axis=1)
    np.testing.assert_allclose(hs.metrics.sequence_relative_error(meas, pred), rms)
    mid_p, mid_m = ((H[:, :-1] + H[:, 1:]) / 2 * np.diff(B, 1, 1) for H in (pred, meas))
    for loss, scale in ((B[:, 0], B[:, 0]), (None, mid_m.sum(1))):
        error = hs.metrics.normalised_energy_error(B, meas, pred, loss=loss)
        np.testing.assert_allclose(error, np.sum(mid_p - mid_m, 1) / np.abs(scale))
    assert np.isnan(hs.metrics.sequence_relative_error(np.zeros(2), np.ones(2)))


def test_a_loss_map_has_the_closed_forms_of_its_parts_and_gives_steinmetz_back():
    biased = SimpleNamespace(response=lambda B: 0.5 * (B.min() + B.max()) * hs.Stop(threshold=0.2).response(B))
    core = hs.Sum(parts=(hs.Stop(threshold=0.2, gain=30.0), hs.Dashpot(c=0.02), hs.ExcessLoss(c=0.5), biased))
    gain = hs.ChannelPolynomial(parameter="stop.gain", channel="T", at=(0.0, 1.0), values=(30.0, 60.0))
    A, f, bias, T = np.meshgrid([0.5, 1.5], [20.0, 80.0], [0.0, -0.4], [0.0, 1.0], indexing="ij", sparse=True)
    grid = {"bias": bias.ravel(), "channels": {"T": T.ravel()}}
    grid["waveform"] = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=600)
    ramps = hs.loss_map(hs.Dependent(law=core, polynomials=(gain,)), A.ravel(), f.ravel(), **grid)
    field = 0.02 * 4.0 * A * f + 0.5 * np.sqrt(4.0 * A * f)
    exact = 4.0 * (30.0 * (1.0 + T) + bias) * 0.2 * (A - 0.2) + 4.0 * A * field
    np.testing.assert_allclose(ramps.loss, exact * f, rtol=1e-4)  # the yield point lies between two samples
    eddy = hs.loss_map(hs.Dashpot(c=0.02), [0.5, 1.0], [20.0, 80.0]).loss[..., 0]
    found = hs.Steinmetz.from_losses([20.0, 80.0], [[0.5], [1.0]], eddy)
    np.testing.assert_allclose([found.k, found.alpha, found.beta], [0.04 * np.pi**2, 2.0, 2.0], rtol=4e-6)  # polygon


test_what_has_no_loss_is_refused = refused(
    (lambda: hs.loss_map(hs.Play(), [2.0], [1.0]), "every loss is negative"),
    (lambda: hs.loss_map(hs.Stop(), [1.0], [1.0], channels={"T": [1.0]}), TypeError, "depends on no channel"),
    (lambda: hs.loss_map(hs.Stop(), [], [1.0]), "needs an amplitude"),
    (lambda: hs.loss_map(hs.Stop(), [1.0], [1.0], bias=1e20), hs.SimulationError, "repeat under B from 1e.20 to 1e.20"),
    (lambda: hs.loss_map(hs.Stop(), [1.0], [1.0], waveform=[0.0, 2.0, -2.0, 0.0]), "the amplitude 1"),
    (lambda: LAW.loss(1.0, -1.0), "amplitude must not be negative"),
    (lambda: hs.Steinmetz.from_losses([1.0, 2.0], [1.0, 2.0], [1.0, 0.0]), "loss must be positive"),
    (lambda: hs.Steinmetz.from_losses([1.0, 1.0], [1.0, 2.0], [1.0, 3.0]), "two frequencies"),
    (lambda: hs.metrics.normalised_energy_error(*np.ones((3, 2, 5)), loss=np.ones((2, 1))), "one for each sequence"),
)
