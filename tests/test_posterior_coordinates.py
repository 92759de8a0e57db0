"""The density in the sampler's coordinates is likelihood times prior of the parameters times the volume of the map."""

import math

import mpmath
import numpy as np
import pytest
from scipy import stats

import hysim as hs
from hysim.posterior._priors import given
from hysim.posterior._sample import posed
from hysim.posterior._target import between, solved_within

PIXEL = 0.0763
PRIORS = {
    "beta": (-0.00065, -0.00035),
    "gamma": (0.0045, 0.0084),
    "n": (0.9, 1.7),
    "feedthrough": (0.0099, 0.0184),
    "gain": (0.0084, 0.0156),
    "offset": (0.26, 0.48),
    "z0": (-43.0, -23.0),
    "sigma": (0.01, 0.05),
}
IN_LOGARITHM = ("n", "sigma")


@pytest.fixture(scope="module")
def seven():
    """A law with seven free parameters, rounded values of its output, and the posterior in a region where some laws
    diverge."""
    u = hs.datasets.table1().u
    law = hs.BoucWen(beta=-0.0005, gamma=0.0065, n=1.3, feedthrough=0.014, gain=0.012, offset=0.37, z0=-33.0)
    noisy = law.response(u) + 0.03 * np.random.default_rng(0).standard_normal(u.size)
    rec = hs.Record(u=u, y=PIXEL * np.round(noisy / PIXEL), resolution=PIXEL)
    fit = hs.identify(law, rec, noise="quantised", max_evaluations=50)
    return law, rec, posed(fit, (rec,), None, given(PRIORS), None)


def direct(law, rec, theta):
    """ln of likelihood times prior of the parameters and sigma, from what the docstring of the verb says."""
    if not all(low <= theta[name] <= high for name, (low, high) in PRIORS.items()):
        return -math.inf
    widths = {name: math.log(high / low) * theta[name] if name in IN_LOGARITHM else high - low
              for name, (low, high) in PRIORS.items()}  # fmt: skip
    try:
        y = law.with_scalars({name: value for name, value in theta.items() if name != "sigma"}).response(rec.u)
    except hs.SimulationError:
        return -math.inf
    near, far = ((np.abs(rec.y - y) + side * PIXEL / 2) / theta["sigma"] for side in (-1, 1))
    if not (near < 30.0).all():
        return -math.inf  # beyond the digits of the difference
    return float(np.log(stats.norm.sf(near) - stats.norm.sf(far)).sum()) - sum(map(math.log, widths.values()))


def test_the_density_is_likelihood_times_prior_times_volume(seven):
    """At points of the prior and near the optimum, the volume by differences of the parameters."""
    law, rec, posterior = seven
    rng = np.random.default_rng(1)
    near = np.insert(posterior.optima[:1], [posterior.n_x] * posterior.n_linear, 0.0, axis=1)
    q = np.concatenate([rng.standard_normal((40, 8)), near + 0.2 * rng.standard_normal((40, 8))])
    value = posterior.log_posterior(q)
    step = 1e-5 * np.eye(8)
    compared = 0
    for k, log_density in enumerate(value):
        theta = dict(zip(posterior.names, posterior.parameters(q[k : k + 1])[0].tolist(), strict=True))
        expected = direct(law, rec, theta)
        if not (math.isfinite(expected) and math.isfinite(log_density)):
            assert not (math.isfinite(expected) and log_density == -math.inf)
            continue
        slope = (posterior.parameters(q[k] + step) - posterior.parameters(q[k] - step)) / 2e-5
        compared += 1
        # differences of second order, and the law's accuracy of 1e-8 in outputs that sigma divides
        assert log_density == pytest.approx(expected + np.linalg.slogdet(slope)[1], abs=1e-3)
    assert compared >= 30


def test_the_linear_parameters_never_leave_their_boxes(seven):
    _, _, posterior = seven
    q = 4.0 * np.random.default_rng(2).standard_normal((500, 8))
    drawn = posterior.parameters(q)
    for name in ("feedthrough", "gain", "offset"):
        low, high = PRIORS[name]
        values = drawn[:, posterior.names.index(name)]
        assert low * (1.0 - 1e-12) <= values.min() < values.max() <= high * (1.0 + 1e-12)


@pytest.mark.parametrize(("low", "high"), [(-1.0, 2.0), (-30.0, 0.5), (3.0, 4.0), (-12.0, -10.0), (20.0, 500.0)])
def test_a_number_between_ends_has_the_quantile_of_the_one_without(low, high):
    e = np.linspace(-3.0, 3.0, 13)
    x, log_slope = between(e, np.full(13, low), np.full(13, high))
    with mpmath.workdps(120):
        below, above = mpmath.ncdf(low), mpmath.ncdf(high)
        for place, value, found in zip(e.tolist(), x.tolist(), log_slope.tolist(), strict=True):
            share = (mpmath.ncdf(value) - below) / (above - below)
            assert float(share) == pytest.approx(stats.norm.cdf(place), rel=1e-9, abs=1e-9)
            slope = mpmath.npdf(place) * (above - below) / mpmath.npdf(value)
            assert found == pytest.approx(float(mpmath.log(slope)), abs=1e-8)


def test_ends_that_are_far_leave_the_regression_alone():
    rng = np.random.default_rng(0)
    triangle, best, e = np.triu(rng.standard_normal((5, 3, 3))) + 3.0 * np.eye(3), *rng.standard_normal((2, 5, 3))
    far = np.full((5, 3), 1e3)
    w, log_volume = solved_within(triangle, best, e, -far, far)
    np.testing.assert_allclose((triangle @ w[..., None])[..., 0], best + e, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(log_volume, -np.log(np.linalg.det(triangle)), rtol=1e-10)
