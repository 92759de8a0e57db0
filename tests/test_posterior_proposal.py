"""The proposal against known densities, and the density in the coordinates of the sampler."""

import math

import mpmath
import numpy as np
import pytest
from scipy import special, stats

import hysim as hs
from hysim.posterior import _proposal
from hysim.posterior._evidence import _error
from hysim.posterior._proposal import grown, mixture, particles, proposal_for
from hysim.posterior._sample import posed
from hysim.posterior._sampler import around_optima
from hysim.posterior._target import between, given, solved_within

NOWHERE = np.empty((0, 9))


class Known:
    """A target of numbers with a standard normal prior and the given ln L, without linear parameters."""

    n_linear = 0

    def __init__(self, n, log_likelihood):
        self.n_x, self.n_dim, self.log_likelihood = n - 1, n, log_likelihood

    def prior_draws(self, n, rng):
        return rng.standard_normal((n, self.n_dim))

    def marginal(self, v):
        return self.log_likelihood(v), stats.norm.logpdf(v).sum(axis=1)

    def log_posterior(self, q):
        return sum(self.marginal(q))

    def without_linear(self, q):
        return q


class Deceived(Known):
    """A target whose particles follow the prior, and whose posterior is a needle."""

    def log_posterior(self, q):
        return -1e6 * np.sum((q - 0.5) ** 2, axis=1)


def of_spike(n, power, width):
    """L = (width^2 + r^2)^-power about a point: broad at low powers, and all of it within the width at power 1."""
    return Known(n, lambda v: -power * np.log(width**2 + np.sum((v - 0.5) ** 2, axis=1)))


@pytest.mark.parametrize("n", [1, 2, 5, 6])
def test_the_density_is_that_of_the_mixture_of_t_distributions(n):
    rng = np.random.default_rng(n)
    found = mixture(rng.standard_normal((200, n)) @ rng.standard_normal((n, n)), np.ones(200), 0, rng)
    points = found.draw(100, rng)
    parts = [
        share * stats.multivariate_t(centre, root @ root.T, df=found.freedom).pdf(points)
        for share, centre, root in zip(found.share, found.centres, found.roots, strict=True)
    ]
    np.testing.assert_allclose(found.log_density_of_v(points), np.log(np.sum(parts, axis=0)), rtol=1e-9, atol=1e-12)


def test_particles_follow_a_likelihood_that_collapses_to_a_spike():
    """r^2 / width^2 has a beta prime distribution: E ln(1 + r^2 / width^2) = digamma(k) - digamma(k - n / 2)."""
    n, k, width = 4, 5.0, 1e-3
    target = of_spike(n, k, width)
    v, _ = particles(target, np.random.default_rng(0))
    expected = -k * (2.0 * np.log(width) + special.digamma(k) - special.digamma(k - 0.5 * n))
    spread = k * np.sqrt(special.polygamma(1, k - 0.5 * n) - special.polygamma(1, k))
    assert target.log_likelihood(v).mean() == pytest.approx(expected, abs=0.25 * spread)  # of 1024, not independent


def test_an_optimum_that_particles_miss_has_its_share_of_the_posterior():
    """Half of the posterior is a needle of width 1e-4 in four numbers: one draw of the prior in 1e14 is in it."""
    needle, width, n = np.full(4, 1.5), 1e-4, 4
    broad = stats.multivariate_normal(np.zeros(n), 0.25 * np.eye(n))
    narrow = stats.multivariate_normal(needle, width**2 * np.eye(n))

    def log_likelihood(v):
        return np.logaddexp(broad.logpdf(v), narrow.logpdf(v)) - stats.norm.logpdf(v).sum(axis=1)

    target = Known(n, log_likelihood)
    target.optima = needle[np.newaxis] + width
    rng = np.random.default_rng(0)
    found, _ = proposal_for(target, around_optima(target, rng), rng)
    q = found.draw(4000, rng)
    weight = np.exp(target.log_posterior(q) - found.log_density(q))
    in_needle = np.linalg.norm(q - needle, axis=1) < 10.0 * width
    assert weight[in_needle].sum() / weight.sum() == pytest.approx(0.5, abs=0.05)
    missed, _ = proposal_for(target, NOWHERE[:, :n], np.random.default_rng(0))
    assert np.linalg.norm(missed.draw(4000, rng) - needle, axis=1).min() > 10.0 * width


def test_a_mixture_is_that_of_weighted_points():
    """Points are drawn evenly, and weighted by a normal density."""
    rng, normal = np.random.default_rng(0), stats.multivariate_normal([1.0, -0.5], [[1.0, 0.5], [0.5, 0.5]])
    v = rng.uniform(-4.0, 4.0, (4000, 2))
    found = mixture(v, normal.pdf(v), 0, rng)
    drawn = found.draw(20_000, rng)
    weight = np.exp(normal.logpdf(drawn) - found.log_density(drawn))
    assert weight.sum() ** 2 / np.sum(weight**2) > 0.7 * len(drawn)


def test_an_improvement_in_which_one_draw_has_all_weight_ends_with_the_best_proposal():
    target = Deceived(4, lambda v: np.zeros(len(v)))
    found, _ = proposal_for(target, NOWHERE[:, :4], np.random.default_rng(0))
    assert found.share.sum() == pytest.approx(1.0)
    assert np.isfinite(found.log_density(target.prior_draws(50, np.random.default_rng(1)))).all()


def test_a_posterior_in_which_one_draw_of_the_prior_lies_is_an_error():
    centre = np.random.default_rng(0).standard_normal((1, 3))  # the first draw of that seed

    def log_likelihood(v):
        return np.where((v == centre).all(axis=1), 0.0, -1e300)

    with pytest.raises(ValueError, match=r"the posterior was not found: 1 of .* pass narrower priors"):
        proposal_for(Known(3, log_likelihood), NOWHERE[:, :3], np.random.default_rng(0))


def bent(width):
    """A target that is normal along a bent line in four numbers and of this width across it; its evidence is one."""

    def log_likelihood(v):
        line = np.stack([v[:, 0] ** 2, np.sin(2.0 * v[:, 0]), np.cos(3.0 * v[:, 0])], axis=1)
        across = stats.norm.logpdf(v[:, 1:], line, width).sum(axis=1)
        return across - stats.norm.logpdf(v[:, 1:]).sum(axis=1)

    return Known(4, log_likelihood)


def weights_of(target, proposal):
    """Weights of new draws from a proposal, and their effective share."""
    q = proposal.draw(8192, np.random.default_rng(9))
    weight = np.exp(target.log_posterior(q) - proposal.log_density(q))
    return weight, weight.sum() ** 2 / np.sum(weight**2) / weight.size


def test_a_proposal_grows_along_a_bent_line(monkeypatch):
    """It starts from one broad normal part, whose draws nearly all miss the line."""
    monkeypatch.setattr(_proposal, "_GROWTHS", 10)  # enough for this line
    target, rng = bent(0.2), np.random.default_rng(1)
    start = mixture(3.0 * rng.standard_normal((2000, 4)), np.ones(2000), 0, rng, parts=1)
    _, before = weights_of(target, start)
    found, alone = grown(start, target, rng)
    for proposal in (found, alone):
        assert proposal.share.sum() == pytest.approx(1.0)
    weight, share = weights_of(target, found)
    assert before < 0.01
    assert share > 0.3
    assert weight.mean() == pytest.approx(1.0, abs=4.0 * weight.std() / np.sqrt(weight.size))


def test_only_a_proposal_that_is_worse_than_asked_for_grows(monkeypatch):
    calls = []
    monkeypatch.setattr(_proposal, "grown", lambda base, *_: calls.append(base) or (base, base))
    target = Known(2, lambda v: np.zeros(len(v)))
    for least in (0.1, 1.0):
        proposal_for(target, NOWHERE[:, :2], np.random.default_rng(0), least)
    assert len(calls) == 1


def test_walkers_that_do_not_meet_give_no_evidence():
    together = np.random.default_rng(0).standard_normal((100, 8))
    apart = together + np.where(np.arange(8) < 4, 0.0, 20.0)
    of_proposal = np.zeros(1000)
    assert np.isfinite(_error(together.ravel(), of_proposal, 0.5, (100, 8)))
    assert _error(apart.ravel(), of_proposal, 0.5, (100, 8)) == np.inf


@pytest.mark.parametrize("thickness", [1e-8, 1e-12, 0.0])
def test_points_on_a_line_have_a_mixture(thickness):
    rng = np.random.default_rng(0)
    v = rng.standard_normal((500, 1)) * [1.0, 2.0, -1.0, 0.5] + thickness * rng.standard_normal((500, 4))
    proposal = mixture(v, np.ones(500), 1, rng)
    assert np.isfinite(proposal.log_density_of_v(v)).all()
    beside = v + np.array([0.0, 0.1, 0.0, 0.0])
    assert proposal.log_density_of_v(beside).max() < proposal.log_density_of_v(v).min()


# ----------------------------------------------------------------- likelihood times prior times the volume of the map


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
    drawn = posterior.parameters(4.0 * np.random.default_rng(2).standard_normal((500, 8)))
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
