"""The densities of the noise are those of their formulas, finite however far a model is from the data."""

import numpy as np
import pytest
from scipy import stats

import hysim as hs
from hysim.identification._noise import Gaussian, Quantised, Robust

QUANTUM = 0.3
EVERYTHING = np.ones((1, 40))
DENSITIES = [Gaussian(floor=1e-14), Quantised(QUANTUM), Robust(floor=1e-14)]


def loss_of(noise, residual, sigma):
    return noise.terms(np.atleast_2d(residual), np.full((1, 1), sigma)).loss[0]


@pytest.mark.parametrize("sigma", [0.1, 0.4, 5.0])
def test_densities_are_those_of_their_formulas(sigma):
    residual = np.linspace(-3.0, 3.0, 13) * sigma  # farther out the literal difference of two cdf loses its digits
    interval = stats.norm.cdf((residual + QUANTUM / 2) / sigma) - stats.norm.cdf((residual - QUANTUM / 2) / sigma)
    np.testing.assert_allclose(loss_of(Quantised(QUANTUM), residual, sigma), -np.log(interval), rtol=1e-11)
    normal = -stats.norm.logpdf(residual, scale=sigma) - 0.5 * np.log(2.0 * np.pi)
    np.testing.assert_allclose(loss_of(DENSITIES[0], residual, sigma), normal, rtol=1e-12, atol=1e-12)
    student = stats.t.logpdf(0.0, 4.0) - stats.t.logpdf(residual, 4.0, scale=sigma)
    np.testing.assert_allclose(loss_of(DENSITIES[2], residual, sigma), student, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("noise", DENSITIES)
@pytest.mark.parametrize("sigma", [0.05, 0.4, 5.0])
def test_slopes_and_curvatures_are_those_of_the_loss(noise, sigma):
    """In the model's output; Student's curvature is that of the weighted square that touches it from above."""
    residual, step = np.linspace(-4.0, 4.0, 17) * sigma, 1e-4 * sigma
    ahead, here, behind = (loss_of(noise, residual - change, sigma) for change in (step, 0.0, -step))
    _, slope, curvature = (values[0] for values in noise.terms(residual[np.newaxis], np.full((1, 1), sigma)))
    # a difference over 1e-4 sigma: truncation 1e-8, rounding 1e-15 / 1e-4, and / 1e-8 for the second
    np.testing.assert_allclose(slope * sigma, (ahead - behind) / 2e-4, rtol=1e-6, atol=1e-9)
    if isinstance(noise, Robust):
        np.testing.assert_allclose(curvature * -residual, slope, rtol=1e-12)
    else:
        np.testing.assert_allclose(curvature * sigma**2, (ahead - 2 * here + behind) / 1e-8, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("noise", DENSITIES)
def test_residuals_of_any_size_have_finite_terms(noise):
    sizes = QUANTUM * np.array([0.0, *np.logspace(-6, 12, 19)])
    for sigma in (0.01 * QUANTUM, QUANTUM, 1e3 * QUANTUM):
        terms = noise.terms(np.concatenate([sizes, -sizes])[np.newaxis], np.full((1, 1), sigma))
        assert all(np.isfinite(values).all() for values in terms)
        assert (terms.curvature >= 0.0).all()
        assert (np.diff(terms.loss[0, : sizes.size]) > -1e-12).all()  # 1e3 times the rounding of ln P
        np.testing.assert_array_equal(terms.slope[0, : sizes.size], -terms.slope[0, sizes.size :])


@pytest.mark.parametrize("noise", DENSITIES)
@pytest.mark.parametrize("size", [0.3, 1.0, 30.0, 1e6])
def test_the_scale_is_the_most_likely_one(noise, size):
    residual = size * QUANTUM * np.random.default_rng(1).standard_normal((2, 40))
    sigma = noise.scale(residual, EVERYTHING)
    least = noise.terms(residual, sigma).loss.sum(axis=1)
    at_floor = sigma[:, 0] < 0.101 * QUANTUM  # of quantised data that rounding alone explains
    for factor in (0.5, 0.999, 1.001, 2.0):
        more = noise.terms(residual, factor * sigma).loss.sum(axis=1) > least
        assert (more | (at_floor & (factor < 2.0))).all()


def test_quanta_far_below_the_noise_change_nothing():
    residual = np.random.default_rng(2).standard_normal((1, 40))
    fine, gaussian = Quantised(1e-3), DENSITIES[0]
    sigma = gaussian.scale(residual, EVERYTHING)
    # the interval's width against the curvature of the density: (q / sigma)^2 / 24 = 4e-8
    np.testing.assert_allclose(fine.scale(residual, EVERYTHING), sigma, rtol=1e-6)
    for mine, other in zip(fine.terms(residual, sigma)[1:], gaussian.terms(residual, sigma)[1:], strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-6)


def test_one_outlier_does_not_move_the_robust_optimum():
    u = np.concatenate([hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40), [-0.4, 0.3, -0.2, 0.9]])
    law = hs.BoucWen(beta=1.4, gamma=-0.6, feedthrough=0.7, gain=-0.5, z0=0.1)
    y = law.response(u) + 1e-3 * np.random.default_rng(0).standard_normal(u.size)
    y[30] += 5.0
    fit = hs.identify(hs.BoucWen, hs.Record(u=u, y=y), fixed={"n": 1.0}, noise="robust")
    for name in fit.free_names:
        assert abs(fit.estimates[name] - getattr(law, name)) < 5.0 * fit.stderr[name]
    assert fit.stderr["beta"] < 0.01
    assert fit.least_squares.estimates["beta"] == pytest.approx(0.44, abs=0.1)  # where the outlier draws it


def test_quantised_noise_needs_one_quantum():
    u = hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=20)
    one, other = hs.Record(u=u, y=u, resolution=0.1), hs.Record(u=u, y=u, resolution=0.2)
    for records in (hs.Record(u=u, y=u), [one, other]):
        with pytest.raises(ValueError, match="needs the sensor's quantum, the same for all records"):
            hs.identify(hs.Line, records, noise="quantised")
