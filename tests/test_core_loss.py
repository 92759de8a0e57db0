"""Measures of magnetic loops and the parts of core loss, by closed forms."""

import numpy as np
import pytest
from scipy.special import beta
from strategies import assert_refused

import hysim as hs
from hysim.metrics import magnetic_metrics

MU0 = 1.25663706212e-6


def parallelogram(Hc=2.0, slope=3.0, peak=10.0, n=200):
    """A play: H and B = slope (H -+ Hc), flat after each turn."""
    H = hs.signals.triangle(-peak, peak, cycles=2, samples_per_cycle=n)
    return H, slope * hs.Play(threshold=Hc, z0=-(peak - Hc)).response(H)


def test_measures_of_a_parallelogram():
    loop = magnetic_metrics(*parallelogram())
    assert loop.energy == pytest.approx(4.0 * 3.0 * 2.0 * (10.0 - 2.0), rel=1e-13)
    assert loop.coercivity == pytest.approx(2.0, rel=1e-13)
    assert loop.remanence == pytest.approx(6.0, rel=1e-13)
    assert loop.peak_field == pytest.approx(10.0, rel=1e-13)
    assert loop.peak_induction == pytest.approx(24.0, rel=1e-13)
    assert loop.amplitude_permeability * MU0 == pytest.approx(2.4, rel=1e-13)
    assert loop.largest_permeability * MU0 == pytest.approx(3.0, rel=1e-12)
    assert np.isnan([loop.initial_permeability, loop.maximum_permeability]).all()


@pytest.mark.parametrize(
    ("reach", "drift", "noise", "closure"),
    [(10.0, 0.0, 1e-3, "closed"), (10.0, 0.05, 1e-3, "drift"), (10.0, 0.05, 0.03, "closed"), (1.5, 0.0, 1e-3, "open")],
)
def test_a_loop_is_closed_drifts_or_is_open(reach, drift, noise, closure):
    """Two branches of a hyperbolic tangent, at fields of ten coercivities and of 1.5, with a line of slope 0.02."""
    H = hs.signals.triangle(-reach, reach, cycles=1, samples_per_cycle=800)
    B = np.tanh(H - np.sign(np.gradient(H))) + 0.02 * H + drift * np.arange(H.size) / H.size
    loop = magnetic_metrics(H, B + noise * np.random.default_rng(0).standard_normal(H.size))
    assert loop.closure == closure
    assert f"closure        {closure}: " in str(loop)
    if reach == 10.0:
        assert loop.noise == pytest.approx(noise, rel=0.2)
        assert loop.saturated_slope == pytest.approx(0.02, abs=3.0 * noise)


def test_a_clockwise_loop_has_a_negative_energy_and_remanence():
    H, B = parallelogram()
    assert magnetic_metrics(H, -B).energy == pytest.approx(-192.0, rel=1e-13)
    assert magnetic_metrics(H, -B).remanence == pytest.approx(-6.0, rel=1e-13)


@pytest.mark.parametrize("family", [hs.Tellinen, hs.Chan])
def test_the_limiting_loop_has_four_times_saturation_times_coercivity(family):
    law = family(saturation=1.5, coercivity=40.0, squareness=0.6)
    H = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=4000)
    H = 400.0 * np.sinh(8.0 * H) / np.sinh(1.0)  # dense about zero, and far out
    loop = magnetic_metrics(H, law.response(H), cycles=1)
    # Chan's branches close like 1 / H, and the chords of 2 000 samples cut their bends
    assert loop.energy == pytest.approx(4.0 * 1.5 * 40.0, rel=1e-3)
    assert loop.remanence == pytest.approx(law.remanence, rel=1e-3)
    assert loop.coercivity == pytest.approx(40.0, rel=1e-3)


def test_measures_of_the_initial_curve():
    law = hs.Chan(coercivity=1.0, squareness=0.5)
    H = np.concatenate([np.linspace(0.0, 5.0, 501), -hs.signals.triangle(-5.0, 5.0, cycles=1, samples_per_cycle=40)])
    loop = magnetic_metrics(H, law.response(H), mu0=1.0)
    ratios = law.response(H[1:501]) / H[1:501]
    assert loop.initial_permeability == pytest.approx(0.25, rel=1e-2)  # knee / (coercivity + knee)^2 at H = 0
    assert loop.maximum_permeability > loop.initial_permeability
    assert loop.maximum_permeability == pytest.approx(ratios.max(), rel=1e-15)
    assert "initial curve" in str(loop)
    assert set(loop.to_dict()) >= {"energy", "coercivity", "maximum_permeability"}


def test_what_does_not_cross_an_axis_has_no_measure_there():
    H, B = parallelogram()
    away = magnetic_metrics(H + 100.0, B + 100.0)
    assert np.isnan([away.remanence, away.coercivity]).all()
    assert away.energy == pytest.approx(192.0, rel=1e-11)


@pytest.mark.parametrize(("arguments", "message"), [({"mu0": 0.0}, "mu0 must be positive"), ({"cycles": 9}, "cycle")])
def test_a_loop_that_cannot_be_measured_is_refused(arguments, message):
    assert_refused(message, magnetic_metrics, *parallelogram(), **arguments)


# ---------------------------------------------------------------------------------- losses


def loss(part, B, sample_time):
    """Energy per cycle of a part along a periodic flux density: the rate is constant between samples."""
    H = part.response(np.append(B, B[1]), sample_time)[1:]
    return float(H @ np.diff(np.append(B, B[1])))


@pytest.mark.parametrize("frequency", [1.0, 50.0])
def test_losses_of_a_triangular_flux(frequency):
    B = 1.5 * hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40)
    rate, path, sample_time = 4.0 * 1.5 * frequency, 4.0 * 1.5, 1.0 / (40 * frequency)

    def per_cycle(part):
        return float(part.response(B, sample_time)[1:] @ np.diff(B))

    assert per_cycle(hs.Dashpot(c=0.02)) == pytest.approx(0.02 * rate * path, rel=1e-12)
    assert per_cycle(hs.ExcessLoss(c=0.5)) == pytest.approx(0.5 * np.sqrt(rate) * path, rel=1e-12)


def test_excess_loss_of_a_sinusoidal_flux_is_bertottis():
    """W = 4 c B^(3/2) (2 pi f)^(1/2) times the integral of cos^(3/2) over a quarter, 8.76 c B^(3/2) f^(1/2)."""
    n, frequency = 4000, 50.0
    B = 1.2 * np.sin(2.0 * np.pi * np.arange(n + 1) / n)
    H = hs.ExcessLoss(c=0.5).response(B, 1.0 / (n * frequency))
    quarter = 0.5 * beta(1.25, 0.5)
    expected = 0.5 * 4.0 * quarter * 1.2**1.5 * np.sqrt(2.0 * np.pi * frequency)
    assert 4.0 * quarter * np.sqrt(2.0 * np.pi) == pytest.approx(8.76, abs=5e-3)
    assert float(H[1:] @ np.diff(B)) == pytest.approx(expected, rel=1e-5)  # velocities by 4 000 chords


def test_excess_loss_steps_and_continues_as_it_responds():
    u, part = np.random.default_rng(1).normal(size=30), hs.ExcessLoss(c=0.7)
    y = part.response(u, 0.1)
    step, parameters, state = part.compiled(u[0], sample_time=0.1)
    assert [step(parameters, state, value) for value in u] == y.tolist()
    head, state = part.advance(u[:11], sample_time=0.1)
    assert [*head, *part.advance(u[11:], state, sample_time=0.1)[0]] == y.tolist()
    assert part.response(-u, 0.1).tolist() == (-y).tolist()


@pytest.mark.parametrize("part", [hs.Dashpot, hs.ExcessLoss])
def test_many_parts_at_once_have_the_bits_of_each(part):
    u, c = np.random.default_rng(2).normal(size=(3, 20)), [0.5, -2.0, 7.0]
    rows = part.responses({"c": c}, u, 0.1)
    assert rows.tolist() == [part(c=each).response(row, 0.1).tolist() for each, row in zip(c, u, strict=True)]
    assert part.responses({"c": c}, u[0], 0.1, reduce="final")[1] == part(c=-2.0).response(u[0], 0.1)[-1]
    assert part.responses({}, u[0], 0.1).tolist() == [part().response(u[0], 0.1).tolist()]
    assert_refused("unknown parameter 'k'", part.responses, {"k": 1.0}, u, 0.1, error=TypeError)
    assert_refused("sample_time must be positive", part.responses, {"c": c}, u, 0.0)


def test_the_parts_beside_a_line_are_identified_together():
    t = np.linspace(0.0, 0.1, 200)
    B = np.sin(2.0 * np.pi * 50.0 * t) + 0.2 * np.sin(2.0 * np.pi * 230.0 * t)
    parts = hs.Dashpot(c=0.01), hs.ExcessLoss(c=0.4)
    record = hs.Record(u=B, y=3.0 * B + sum(part.response(B, t[1]) for part in parts), t=t)
    fit = hs.identify(hs.Sum.structure(hs.Line, hs.Dashpot, hs.ExcessLoss), record)
    assert fit.estimates["dashpot.c"] == pytest.approx(0.01, rel=1e-6)
    assert fit.estimates["excess_loss.c"] == pytest.approx(0.4, rel=1e-6)
