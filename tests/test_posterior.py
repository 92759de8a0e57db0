"""Posterior and evidence against closed forms: a model that is linear in its parameters, with normal noise.

With known sigma, y = C b + noise and flat priors that are wide, b is normal about the regression, and

    Z = (2 pi sigma^2)^(-(n - d)/2) |C^T C|^(-1/2) exp(-S / (2 sigma^2)) prod (1 / width of the prior).
"""

import dataclasses
import math
import sys

import numpy as np
import pytest
from scipy import stats
from strategies import assert_refused, refused

import hysim as hs
from hysim.identification.likelihood import density
from hysim.posterior import _evidence, _sampler, log_evidence
from hysim.posterior._evidence import bridge_evidence
from hysim.posterior._sample import posed, walkers_of
from hysim.posterior._sampler import effective_samples, sampled, split_rhat
from hysim.posterior._target import REACH, given, scaled_box

SIGMA = 0.05
KNOWN = {"sigma": (SIGMA * (1.0 - 1e-9), SIGMA * (1.0 + 1e-9))}
CUBIC = hs.PolynomialBoucWen(input_coefficients=(0.3, -0.2, 0.1), gain=0.0, offset=0.5)
HELD = {"A": 1.0, "beta": 0.5, "gamma": 0.5, "n": 1.0, "z0": 0.0, "gain": 0.0}


def cubic_record(seed=0, n=40, noise=SIGMA):
    """A polynomial through points with normal noise."""
    u = np.linspace(-1.0, 2.0, n)
    return hs.Record(u=u, y=CUBIC.response(u) + noise * np.random.default_rng(seed).standard_normal(n))


def fitted_line(n):
    """The polynomial at n points, and the line through them."""
    rec = cubic_record(n=n)
    return rec, hs.identify(hs.Line, rec)


@pytest.fixture(scope="module")
def cubic():
    """The record, its fit and the matrix of the regression in the order of the free names."""
    rec = cubic_record()
    fit = hs.identify(CUBIC, rec, fixed=HELD)
    zero = dict.fromkeys(fit.free_names, 0.0)
    columns = [CUBIC.with_scalars(zero | {name: 1.0}).response(rec.u) for name in fit.free_names]
    return rec, fit, np.stack(columns, axis=1)


def regression(rec, C):
    """Best parameters, C^T C, and the sum of squares."""
    best, squares, *_ = np.linalg.lstsq(C, rec.y, rcond=None)
    return best, C.T @ C, float(squares[0])


def log_evidence_of_cubic(rec, C):
    """The closed form, for priors of +-REACH spans of the output of what each term adds to it."""
    _, gram, squares = regression(rec, C)
    n, d = C.shape
    span = np.where(np.ptp(C, axis=0) > 0.0, np.ptp(C, axis=0), 1.0)
    widths = 2.0 * REACH * np.ptp(rec.y) / span
    return (
        -0.5 * (n - d) * math.log(2.0 * math.pi * SIGMA**2)
        - 0.5 * np.linalg.slogdet(gram)[1]
        - 0.5 * squares / SIGMA**2
        - np.log(widths).sum()
    )


# The density


def test_the_posterior_of_a_polynomial_is_the_normal_one_everywhere(cubic):
    """At random points: density in the sampler's coordinates = Z times the normal density times |db/de|."""
    rec, fit, C = cubic
    posterior = posed(fit, (rec,), "gaussian", given(KNOWN), None)
    rng = np.random.default_rng(1)
    q = np.column_stack([3.0 * rng.standard_normal((50, 4)), rng.standard_normal(50)])
    b = posterior.parameters(q)[:, :4]
    best, gram, _ = regression(rec, C)
    normal = stats.multivariate_normal(best, SIGMA**2 * np.linalg.inv(gram))
    linear = q.copy()
    linear[0, :4] = 0.0
    unit = [posterior.parameters(linear[:1] + step * np.eye(5)[k])[0, :4] for k in range(4) for step in (-1.0, 1.0)]
    log_slope = np.linalg.slogdet(0.5 * np.array([unit[2 * k + 1] - unit[2 * k] for k in range(4)]))[1]
    expected = log_evidence_of_cubic(rec, C) + normal.logpdf(b) + log_slope + stats.norm.logpdf(q[:, -1])
    np.testing.assert_allclose(posterior.log_posterior(q), expected, rtol=0.0, atol=1e-6)  # of sigma's narrow prior


def test_a_flat_prior_is_told_in_terms_of_its_parameter():
    law = hs.BoucWen(beta=0.7)
    rec = hs.Record(u=cubic_record(n=40).u, y=law.response(cubic_record(n=40).u))
    bounds = {"z0": (-0.5, 0.75), "n": (0.5, 8.0)}
    fit = hs.identify(law, rec, bounds=bounds, free=("z0",), fixed={"gamma": 0.0}, max_evaluations=100)
    words = posed(fit, (rec,), "gaussian", given({}), None).priors_in_words()
    assert words["z0"] == "flat from -0.5 to 0.75"
    assert words["n"] == "flat in its logarithm from 0.5 to 8"
    assert words["beta"].endswith("in the coordinate of the search")


def test_the_mean_likelihood_over_the_cube_is_that_over_the_priors():
    """Brute force over a line's two parameters, against the density that the sampler has."""
    rec, fit = fitted_line(6)
    priors = {"slope": (0.0, 1.0), "offset": stats.norm(0.5, 0.3), "sigma": (0.3, 0.6)}
    posterior = posed(fit, (rec,), "gaussian", given(priors), None)
    rng = np.random.default_rng(3)
    n = 200_000
    slope, offset = rng.uniform(0.0, 1.0, n), rng.normal(0.5, 0.3, n)
    sigma = 0.3 * 2.0 ** rng.random(n)
    residual = rec.y - slope[:, None] * rec.u - offset[:, None]
    direct = np.exp(stats.norm.logpdf(residual, scale=sigma[:, None]).sum(axis=1))
    cube = np.exp(posterior.log_likelihood_in_cube(rng.random((n, 3))))
    error = math.hypot(direct.std(), cube.std()) / math.sqrt(n)
    assert abs(direct.mean() - cube.mean()) < 4.0 * error


@pytest.mark.parametrize("sigma", [0.003, 0.1, 0.5, 20.0])
def test_rounded_values_have_the_probability_of_their_interval(sigma):
    mpmath = pytest.importorskip("mpmath")
    quantum, residuals = 0.25, [0.0, 0.12, -0.125, 0.6, -1.5]
    noise = density("quantised", quantum)
    for r in residuals:
        with mpmath.workdps(60):
            low, high = ((mpmath.mpf(abs(r)) + side * quantum / 2) / sigma for side in (-1, 1))
            direct = float(mpmath.log(mpmath.quad(mpmath.npdf, [low, 0.5 * (low + high), high])))
            exact = float(mpmath.log(0.5 * (mpmath.erfc(low / mpmath.sqrt(2)) - mpmath.erfc(high / mpmath.sqrt(2)))))
        value = float(noise.log_likelihood(np.array([[r]]), np.array([sigma]))[0])
        assert value == pytest.approx(exact, rel=1e-9)
        if sigma >= 0.1:  # where the quadrature resolves the density
            assert value == pytest.approx(direct, rel=1e-6)


@pytest.mark.extra("emcee")
def test_weights_and_bounds_of_a_fit_are_those_of_its_posterior():
    """Samples of weight zero have no say, others that of their weight, and a bound is the end of a flat prior."""
    rng, u = np.random.default_rng(3), hs.signals.triangle(-1.0, 1.0, cycles=4, samples_per_cycle=40)
    weights = np.where(np.arange(u.size) < 100, 1.0, 0.0)
    y = 2.0 * u + 0.3 + np.where(weights > 0.0, 0.0, 3.0) + 0.01 * rng.standard_normal(u.size)
    record, part = hs.Record(u=u, y=y), hs.Record(u=u[:100], y=y[:100])
    for shares in (weights, np.where(u > 0.0, 4.0, 1.0) * weights):
        fit = hs.identify(hs.Line, record, weights=shares)
        post = hs.sample_posterior(fit, record, samples=1000)
        assert post.mean["offset"] == pytest.approx(fit.estimates["offset"], abs=0.2 * fit.stderr["offset"])
        assert np.std(post.samples["slope"]) == pytest.approx(fit.stderr["slope"], rel=0.15)
    assert_refused("are for noise=", hs.sample_posterior, fit, record, noise="robust")
    assert_refused("takes a result of hs.identify", hs.sample_posterior, hs.Line, record, error=TypeError)
    for lowest, highest in ((2.01, 3.0), (2.01, np.inf), (50.0, np.inf)):
        post = hs.sample_posterior(hs.identify(hs.Line, part, bounds={"slope": (lowest, highest)}), part, samples=200)
        assert post.samples["slope"].min() >= lowest
        assert f"from {lowest:g} to {highest:g}" in post.priors["slope"]


@pytest.mark.extra("emcee")
def test_a_bound_of_physics_is_one_of_the_posterior():
    u = 1.5 * np.sin(2.0 * np.pi * np.arange(200) / 50.0)
    y = hs.Chan(saturation=1.3, squareness=0.6).response(u) - 0.01 * u
    record = hs.Record(u=u, y=y + 0.01 * np.random.default_rng(0).standard_normal(u.size))
    fit = hs.identify(hs.Chan, record)
    assert fit.estimates["feedthrough"] == 0.0  # the best one would be negative
    feedthrough = hs.sample_posterior(fit, record, samples=200).samples["feedthrough"]
    assert feedthrough.min() >= 0.0
    assert np.median(feedthrough) < 0.005


@pytest.mark.parametrize(("name", "law"), [("gaussian", stats.norm), ("robust", stats.t(4.0))])
def test_densities_are_those_of_scipy(name, law):
    rng = np.random.default_rng(0)
    residual, sigma = rng.standard_normal((7, 5)), rng.uniform(0.1, 3.0, 7)
    expected = (law.logpdf(residual / sigma[:, None]) - np.log(sigma[:, None])).sum(axis=1)
    np.testing.assert_allclose(density(name).log_likelihood(residual, sigma), expected, rtol=1e-12)


def test_a_set_that_diverges_has_no_probability():
    rec = hs.datasets.table1()
    fit = hs.identify(hs.BoucWen(n=1.0), rec, fixed={"n": 1.0}, max_evaluations=200)
    posterior = posed(fit, (rec,), "gaussian", {}, None, factor=4.0)
    rng = np.random.default_rng(0)
    values = posterior.log_likelihood_in_cube(rng.random((400, posterior.n_dim)))
    assert (np.isfinite(values) | (values == -np.inf)).all()
    assert 0 < np.count_nonzero(values == -np.inf) < 400


# Priors


def test_a_distribution_is_one_of_the_parameter_and_not_of_its_coordinate():
    """n is searched by its logarithm: the density integrates to one, and its quantiles are those of the parameter."""
    rec = hs.datasets.table1()
    fit = hs.identify(hs.BoucWen, rec, fixed={"z0": 0.0}, max_evaluations=200)
    law = stats.gamma(4.0, scale=0.5)
    posterior = posed(fit, (rec,), "gaussian", given({"n": law}), None)
    place = posterior.problem.space.coordinates.index("n")
    prior, scale = posterior.v_prior.own[place]
    x = np.linspace(posterior.v_prior.lower[place], posterior.v_prior.upper[place], 20_001)
    values = np.exp(prior.log_density(scale.value(x)) + scale.log_slope(x))
    assert np.trapezoid(values, x) == pytest.approx(1.0, abs=1e-6)
    cube = np.full((3, posterior.n_x + 1), 0.5)
    cube[:, place] = 0.1, 0.5, 0.9
    n = posterior.problem.parameters(posterior.v_prior.quantile(cube)[:, :-1])["n"]
    np.testing.assert_allclose(n, law.ppf([0.1, 0.5, 0.9]), rtol=1e-9)


def test_a_box_is_scaled_about_its_centre_and_keeps_its_sign():
    low, high = scaled_box(np.array([-2.0, 1.0, -3.0]), np.array([4.0, 2.0, -2.0]), 4.0)
    assert low.tolist() == [-11.0, 1.0, -4.5]
    assert high.tolist() == [13.0, 3.5, -0.5]


test_a_prior_that_does_not_fit_is_an_error = refused(
    ({"slope": (1.0, 0.0)}, "low < high"),
    ({"slope": (0.0, math.inf)}, "both finite"),
    ({"gain": (0.0, 1.0)}, "not free; the parameters are offset, slope"),
    ({"sigma": (-1.0, 1.0)}, "'sigma' must be positive"),
    ({"slope": 3.0}, TypeError, "or a frozen distribution of"),
    call=lambda priors: posed(
        hs.identify(hs.Line, cubic_record(n=6)), (cubic_record(n=6),), "gaussian", given(priors), None
    ),
)


def test_sampling_begins_at_the_optimum_of_the_fit():
    rec = hs.datasets.table1()
    fit = hs.identify(hs.BoucWen(n=1.0), rec, fixed={"n": 1.0}, max_evaluations=200)
    posterior = posed(fit, (rec,), "gaussian", {}, None)
    q = np.insert(posterior.optima[:1], [posterior.n_x] * posterior.n_linear, 0.0, axis=1)
    known = dict(zip(posterior.names, posterior.parameters(q)[0].tolist(), strict=True))
    names = ("beta", "gamma", "z0")
    assert [known[name] for name in names] == pytest.approx([fit.estimates[name] for name in names])
    assert known["sigma"] == pytest.approx(fit.sigma)


def test_the_number_of_walkers_follows_that_of_samples():
    assert [walkers_of(8, None, samples) for samples in (100, 1000, 10_000)] == [32, 40, 128]
    assert_refused("walkers must be even, and at least 16 for 8 parameters, got 14", walkers_of, 8, 14, 100)


def test_other_records_than_those_of_the_fit_are_an_error():
    fit = hs.identify(hs.Line, cubic_record(n=12))
    assert_refused("other residuals", posed, fit, (cubic_record(seed=1, n=12),), "gaussian", {}, None)


# Chains


def test_the_effective_number_of_an_autoregressive_chain():
    """tau = (1 + a) / (1 - a)."""
    a, n, m = 0.8, 4000, 20
    noise = np.random.default_rng(0).standard_normal((n, m))
    chains = np.empty((n, m))
    chains[0] = noise[0] / math.sqrt(1.0 - a**2)
    for k in range(1, n):
        chains[k] = a * chains[k - 1] + noise[k]
    expected = n * m * (1.0 - a) / (1.0 + a)
    assert effective_samples(chains) == pytest.approx(expected, rel=0.1)  # some standard errors of the estimate
    assert split_rhat(chains) < 1.005


def test_a_parameter_and_its_logarithm_are_judged_alike():
    chains = np.cumsum(np.random.default_rng(0).standard_normal((200, 6)), axis=0)
    assert effective_samples(np.exp(chains)) == effective_samples(chains)
    assert split_rhat(np.exp(chains)) == split_rhat(chains)


def test_rhat_sees_a_walker_that_stays_apart_and_one_that_drifts():
    chains = np.random.default_rng(0).standard_normal((500, 8))
    assert split_rhat(chains) < 1.01
    apart = chains + np.where(np.arange(8) == 3, 3.0, 0.0)
    drifting = chains + np.linspace(0.0, 3.0, 500)[:, np.newaxis]
    assert split_rhat(apart) > 1.2
    assert split_rhat(drifting) > 1.2
    assert effective_samples(apart) < 50.0
    assert split_rhat(np.ones((20, 4))) == 1.0
    assert split_rhat(np.ones((20, 4)) * np.arange(4.0)) == math.inf
    assert math.isnan(split_rhat(chains[:5]))


# Sampling


@pytest.mark.extra("emcee")
def test_samples_of_a_line_have_its_distribution():
    """With unknown sigma and a flat ln sigma the slope has Student's distribution with n - d degrees of freedom."""
    rec, fit = fitted_line(9)
    post = hs.sample_posterior(fit, rec, samples=1000, walkers=32)
    assert min(post.effective_samples.values()) >= 1000
    assert max(post.rhat.values()) < 1.05
    standard = (post.samples["slope"] - fit.estimates["slope"]) / fit.stderr["slope"]
    shares = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
    reached = stats.t(7).cdf(np.quantile(standard, shares))
    np.testing.assert_allclose(reached, shares, atol=4.0 * 0.5 / math.sqrt(1000))
    low, high = post.interval(0.9)["slope"]
    assert np.mean((post.samples["slope"] > low) & (post.samples["slope"] < high)) == pytest.approx(0.9, abs=1e-3)
    np.testing.assert_allclose(np.sqrt(np.diag(post.covariance)), post.table.std(axis=0, ddof=1))


@pytest.mark.extra("emcee")
def test_the_share_of_accepted_moves_does_not_depend_on_how_many_draws_are_kept(monkeypatch):
    rec, fit = fitted_line(9)
    every = hs.sample_posterior(fit, rec, samples=200, walkers=32).acceptance
    monkeypatch.setattr(_sampler, "_DRAWS_PER_TIME", 0.2)
    assert hs.sample_posterior(fit, rec, samples=200, walkers=32).acceptance == pytest.approx(every, abs=0.15)
    assert every > 0.3


@pytest.mark.extra("emcee")
def test_a_prior_that_is_narrower_than_the_data_is_respected():
    rec, fit = fitted_line(9)
    centre, spread = fit.estimates["slope"] + fit.stderr["slope"], 0.1 * fit.stderr["slope"]
    priors = {"slope": stats.norm(centre, spread), "offset": (0.0, 0.55)}
    post = hs.sample_posterior(fit, rec, priors=priors, samples=500, walkers=32)
    assert post.mean["slope"] == pytest.approx(centre, abs=0.2 * fit.stderr["slope"])
    assert post.samples["slope"].std() == pytest.approx(spread, rel=0.2)
    assert 0.0 <= post.samples["offset"].min() < post.samples["offset"].max() <= 0.55


@pytest.fixture(scope="module")
def of_table1():
    """A play on the paper's points, and its posterior."""
    pytest.importorskip("emcee")
    rec = hs.datasets.table1()
    fit = hs.identify(hs.Play, rec, noise="quantised", fixed={"z0": 0.0})
    return rec, fit, hs.sample_posterior(fit, rec, samples=200, walkers=32, seed=3)


@pytest.mark.extra("emcee")
def test_the_same_seed_gives_the_same_bits():
    rec, fit = fitted_line(9)
    first, second, other = (hs.sample_posterior(fit, rec, walkers=8, most_steps=10, seed=seed) for seed in (3, 3, 4))
    assert first == second
    assert first.samples["slope"][0] != other.samples["slope"][0]


@pytest.mark.extra("emcee")
def test_bands_hold_the_points_of_the_paper(of_table1):
    rec, fit, post = of_table1
    bands = post.predict(rec.u, n=200)
    low, high = bands.measured_band
    assert np.mean((rec.y >= low) & (rec.y <= high)) > 0.9
    assert (bands.band[0] <= bands.y).all()
    np.testing.assert_allclose(bands.measured / rec.resolution, np.round(bands.measured / rec.resolution), atol=1e-9)
    assert bands.loop_width.lower < fit.loop_width.value < bands.loop_width.upper
    first = fit.model.with_scalars({name: float(post.samples[name][0]) for name in fit.free_names})
    known = post.predict(rec.u, n=post.log_density.size).outputs
    assert np.abs(known - first.response(rec.u)).max(axis=1).min() == 0.0


@pytest.mark.extra("emcee")
def test_a_posterior_is_read(of_table1):
    _, _, post = of_table1
    assert "Posterior of Play" in str(post)
    assert "R-hat" in post.summary()
    assert "prior of sigma: flat in its logarithm" in post.summary()
    assert_refused("level must be between 0 and 1", post.interval, 95.0)


@pytest.mark.extra("emcee", "arviz")
def test_arviz_takes_the_chains(of_table1):
    _, _, post = of_table1
    data = post.to_arviz()
    np.testing.assert_array_equal(data["posterior"]["gain"].values, post.chains("gain").T)
    assert data["sample_stats"]["lp"].shape == post.chains("gain").T.shape


@pytest.mark.extra("emcee")
def test_walkers_that_do_not_agree_are_a_warning():
    rec = cubic_record(n=9)
    post = hs.sample_posterior(hs.identify(hs.Line, rec), rec, samples=5000, most_steps=30, walkers=8)
    assert any("effective samples in place of 5000" in each for each in post.warnings)


def test_every_record_has_its_own_state():
    u = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=24)
    law = hs.BoucWen(beta=0.6, gamma=0.2, gain=2.0)
    rng = np.random.default_rng(0)
    records = [hs.Record(u=a * u, y=law.response(a * u) + 0.02 * rng.standard_normal(u.size)) for a in (1.0, 2.0)]
    fit = hs.identify(hs.BoucWen, records, fixed={"n": 1.0, "feedthrough": 0.0})
    posterior = posed(fit, records, "gaussian", given({"z0": (-0.5, 0.5)}), None)
    assert posterior.names == (*fit.free_names, "sigma")
    assert {"z0[0]", "z0[1]"} < set(posterior.names)
    q = np.insert(posterior.prior_draws(200, rng), posterior.n_x, np.zeros((2, 1)), axis=1)
    z0 = posterior.parameters(q)[:, [posterior.names.index(f"z0[{k}]") for k in (0, 1)]]
    assert np.abs(z0).max() <= 0.5
    assert np.ptp(z0, axis=0).min() > 0.8


# Evidence


@pytest.mark.extra("emcee")
def test_bridge_sampling_has_the_closed_form(cubic):
    rec, fit, C = cubic
    posterior = posed(fit, (rec,), "gaussian", given(KNOWN), None)
    chains = sampled(posterior, walkers=32, samples=500, seed=0, most_steps=2_000)
    found = bridge_evidence(posterior, chains, 0)
    assert abs(found.value - log_evidence_of_cubic(rec, C)) < 4.0 * found.error
    assert found.error < 0.1


@pytest.mark.extra("dynesty")
def test_nested_sampling_has_the_closed_form(monkeypatch):
    monkeypatch.setattr(_evidence, "_WALK", 6)  # enough for a normal posterior of three numbers
    rec, fit = fitted_line(12)
    found = log_evidence(fit, rec, priors=KNOWN, factor=2.0, live_points=20)
    truth = log_evidence_of_cubic(rec, np.column_stack([np.ones(12), rec.u])) - 2 * math.log(2.0)  # two boxes, doubled
    assert abs(found.value - truth) < 4.0 * found.error
    assert 0.1 < found.error < 1.5


def evidence(**values):
    """Evidences with errors of 0.1."""
    rows = [
        hs.EvidenceRow(name=name, n_parameters=1, fit_percent=0.0, log_evidence=each, error=(0.1,) * 3, n_evaluations=1)
        for name, each in values.items()
    ]
    return hs.Evidence(rows=tuple(rows), noise="gaussian", method="nested")


def test_a_preference_holds_with_every_box_or_is_none():
    clear = evidence(a=(0.0, 0.0, 0.0), b=(-4.0, -5.0, -6.0))
    assert clear.sentence == "the data prefer a, odds 55 : 1, with every box"
    assert clear.odds("a", "b") == pytest.approx(math.exp(4.0))
    turned = evidence(a=(0.0, 0.0, 0.0), b=(-4.0, -5.0, 3.0))
    assert turned.sentence == "the data do not decide between a and b: it depends on the boxes"
    near = evidence(a=(0.0, 0.0, 0.0), b=(-1.0, -1.0, -1.0), c=(-5.0, -6.0, -7.0))
    assert near.sentence == (
        "the data do not decide between a and b: their odds are too near to 1 : 1; each other model has odds of "
        "1 : 148 or less, with every box"
    )
    assert near.undecided == ("a", "b")
    assert sum(near.probabilities(2.0).values()) == pytest.approx(1.0)


def test_a_model_whose_evidence_was_not_found_stays_in_question():
    found = evidence(**{"law, n = 1": (0.0, 0.0, 0.0), "b": (-40.0, -50.0, -60.0), "c": (-40.0, -50.0, -60.0)})
    assert found.sentence.startswith('the data prefer "law, n = 1", odds')
    lost = dataclasses.replace(found["b"], error=(0.1, math.inf, 0.1))
    unsure = dataclasses.replace(found, rows=(found.rows[0], lost, found.rows[2]))
    assert unsure.undecided == ("law, n = 1", "b")
    assert 'do not decide between "law, n = 1" and b: the evidence of b was not found;' in unsure.sentence


def test_without_emcee_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "emcee", None)
    rec = cubic_record(n=9)
    assert_refused(r"hysim\[bayes\]", hs.sample_posterior, hs.identify(hs.Line, rec), rec, error=ImportError)
