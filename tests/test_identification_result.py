"""A result goes to JSON and back, is the same on one thread, is drawn with what it knows, and has intervals."""

import dataclasses
import json

import numpy as np
import pytest
from scipy import optimize, stats
from strategies import assert_refused

import hysim as hs

LOOP = np.concatenate([hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40), [-0.4, 0.3, -0.2, 0.9]])
LAW = hs.BoucWen(beta=1.4, gamma=-0.6, feedthrough=0.7, gain=-0.5)


def record(seed=0, resolution=0.01):
    y = LAW.response(LOOP) + 0.01 * np.random.default_rng(seed).standard_normal(LOOP.size)
    return hs.Record(u=LOOP, y=y, resolution=resolution, units={"u": "V", "y": "um"})


def options():
    held = {"n": 1.0, "z0": 0.0}
    return {
        "linear": (hs.BoucWen, record(), {"fixed": held}),
        "profile": (hs.BoucWen, record(), {"fixed": held, "intervals": "profile", "cross_validate": 4}),
        "bootstrap": (hs.BoucWen, record(), {"fixed": held, "intervals": "bootstrap", "seed": 7}),
        "quantised": (hs.BoucWen, record(), {"fixed": held, "noise": "quantised"}),
        "open intervals": (hs.BoucWen, record(), {"fixed": {"n": 1.0}, "free": ("A", "gain"), "intervals": "profile"}),
        "several": (hs.BoucWen, [record(0), record(1, None)], {"fixed": {"n": 1.0}}),
        "regions": (hs.PolynomialBoucWen, hs.datasets.table1(), {"fixed": {"n": 1.0}, "noise": "robust"}),
        "arrays": (hs.PrandtlIshlinskii, record(), {}),
        "exact": (hs.Line, hs.Record(u=[0.0, 1.0], y=[0.0, 1.0]), {}),
        "perfect": (hs.Line, hs.Record(u=LOOP, y=0.0 * LOOP), {"intervals": "profile"}),
    }


@pytest.fixture(scope="module")
def fits():
    return {name: hs.identify(family, rec, **given) for name, (family, rec, given) in options().items()}


@pytest.mark.parametrize("name", list(options()))
def test_results_come_back_from_json_as_they_were(fits, name):
    fit = fits[name]
    text = fit.to_json()
    back = hs.Identification.from_json(text)
    assert back == fit
    assert back.to_json() == text
    assert back.summary() == fit.summary()
    assert type(back.model) is type(fit.model)
    assert back.models == fit.models
    document = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert document["hysim"] == hs.__version__
    assert document["identification"]["fields"]["seed"] == fit.seed


def test_what_is_not_finite_comes_back(fits):
    exact, perfect = (hs.Identification.from_json(fits[name].to_json()) for name in ("exact", "perfect"))
    assert np.isnan([exact.stderr["slope"], *exact.intervals["slope"], exact.fpe, exact.cv_rmse]).all()
    assert perfect.bic == -np.inf
    assert exact.resolution is None
    assert exact.residual_quanta is None


@pytest.mark.parametrize(
    "text",
    [
        *("", "null", "3", "[]", "{}", '{"identification": 3}', '{"identification": NaN}', "[" * 100_000),
        '{"identification": {"result": "Candidate", "fields": {}}}',
        '{"identification": {"result": "Model", "fields": {}}}',
        '{"identification": {"result": "Identification", "fields": {"colour": 1}}}',
        '{"identification": {"result": "Identification", "fields": 3}}',
    ],
)
def test_other_text_is_refused_in_one_line(text):
    assert_refused("this is no identification of hysim", hs.Identification.from_json, text)


@pytest.mark.parametrize("name", ["profile", "bootstrap", "several"])
def test_the_number_of_threads_changes_no_bit(fits, name):
    family, rec, given = options()[name]
    assert hs.identify(family, rec, workers=1, **given).to_json() == fits[name].to_json()


def test_a_summary_has_a_line_for_each_free_parameter(fits):
    for fit in fits.values():
        lines = fit.summary().splitlines()
        assert [line.split()[0] for line in lines[1 : 1 + fit.n_parameters]] == list(fit.free_names)
        rest = lines[lines.index(f"  {fit.message}") + 1 :]
        assert rest == (["Warnings", *(f"  {each}" for each in fit.warnings)] if fit.warnings else [])


def test_the_picture_shows_the_numbers_of_the_result(fits):
    fit, rec = fits["profile"], record()
    loop, residuals, curves = hs.plot.identification(fit, rec)
    np.testing.assert_array_equal(loop.lines[0].get_xydata(), np.column_stack([rec.u, rec.y]))
    np.testing.assert_allclose(loop.lines[1].get_ydata(), fit.model.response(rec.u), atol=1e-12)
    assert len(loop.patches) == 1
    np.testing.assert_array_equal(residuals.lines[-1].get_ydata(), fit.residual_quanta)
    assert residuals.get_ylabel() == "Residual [quanta]"
    assert [text.get_text() for text in curves.get_legend().get_texts()] == list(fit.free_names)


def test_pictures_take_every_kind_of_result(fits):
    for name, (_, rec, _) in options().items():
        axes = hs.plot.identification(fits[name], rec)
        assert len(axes) == (3 if fits[name].profiles else 2)
        assert axes[0].figure is not None
        axes[0].figure.draw_without_rendering()
    (loop, residuals) = hs.plot.identification(fits["several"], options()["several"][1])
    assert len(loop.lines) == 3
    assert len(residuals.lines[-1].get_ydata()) == 2 * LOOP.size


def test_residuals_without_resolution_have_the_unit_of_y():
    rec = record(resolution=None)
    _, residuals = hs.plot.identification(hs.identify(hs.Line, rec), rec)
    assert residuals.get_ylabel() == "Residual [µm]"


def test_a_picture_of_another_record_is_refused(fits):
    picture, two_axes = hs.plot.identification, hs.plot.figure().subplots(1, 2)
    assert_refused("the result is of 45 samples, the record has 44", picture, fits["linear"], record()[1:])
    assert_refused("the result is of another record", picture, fits["linear"], record(1))
    assert_refused("3 Axes are needed", picture, fits["profile"], record(), two_axes)


# ----------------------------------------------------- intervals: exact where theory is, nan where the data cannot tell


KINDS = ("linear", "profile", "bootstrap")
INPUT = np.concatenate([hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40), [-0.4, 0.3, -0.2, 0.9]])


def line_record(n=20, noise=0.3, seed=0):
    u = np.linspace(-1.0, 3.0, n)
    return hs.Record(u=u, y=1.0 + 2.0 * u + noise * np.random.default_rng(seed).standard_normal(n))


def noisy(sigma=0.01, seed=0):
    y = LAW.response(INPUT) + sigma * np.random.default_rng(seed).standard_normal(INPUT.size)
    return hs.Record(u=INPUT, y=y)


@pytest.mark.parametrize(("n", "shares"), [(5, [1.0]), (20, [1.0]), (200, [1.0]), (200, [0.0, 0.01, 1.0, 100.0])])
def test_intervals_of_a_line_are_those_of_student(n, shares):
    """Of the weighted regression: noise has the scale sigma / sqrt(weight), samples without weight have no say."""
    weights, record = np.repeat(shares, n // len(shares)), line_record(n, seed=4)
    root, line = np.sqrt(weights), 1.0 + 2.0 * record.u
    record = hs.Record(u=record.u, y=line + (record.y - line) / np.maximum(root, 1e-2))
    columns = np.column_stack([np.ones(n), record.u])
    design, freedom = root[:, np.newaxis] * columns, np.count_nonzero(root) - 2
    estimates, squares = np.linalg.lstsq(design, root * record.y, rcond=None)[:2]
    covariance = np.linalg.inv(design.T @ design) * squares[0] / freedom
    reach = stats.t.ppf(0.975, freedom) * np.sqrt(np.diag(covariance))
    exact = np.column_stack([estimates - reach, estimates + reach])
    fits = {kind: hs.identify(hs.Line, record, intervals=kind, weights=weights) for kind in KINDS}
    found = {kind: np.array([fit.intervals[name] for name in ("offset", "slope")]) for kind, fit in fits.items()}
    np.testing.assert_allclose(found["linear"], exact, rtol=1e-11)
    # the ends of a profile are found to 1 % of sqrt(D), which is a little more of half the width
    np.testing.assert_allclose(found["profile"], exact, atol=0.02 * reach.max())
    if n == 200:  # 500 draws: a quantile at 2.5 % scatters by 7 % of the standard error, and residuals are few
        np.testing.assert_allclose(found["bootstrap"], exact, atol=0.2 * reach.max())
    linear = fits["linear"]
    assert linear.warnings == ()  # independent noise of any weights is white, and no sample stands out
    np.testing.assert_allclose(linear.covariance, covariance, rtol=1e-10)
    np.testing.assert_allclose(linear.correlation, covariance / np.sqrt(np.outer(*[np.diag(covariance)] * 2)))
    np.testing.assert_allclose(linear.condition, np.linalg.cond(design / np.linalg.norm(design, axis=0)), rtol=1e-10)
    band = np.sqrt(np.einsum("nk,kl,nl->n", columns, covariance, columns))
    np.testing.assert_allclose(linear.response_stderr, band, rtol=1e-10)


def test_covariance_is_the_scatter_of_repeated_experiments():
    """300 records, fitted by SciPy from the truth: a standard deviation scatters by 4 %, a correlation by 0.06."""
    names = ("beta", "gamma", "feedthrough", "gain")
    truth = np.array([getattr(LAW, name) for name in names])

    def response(values):
        return hs.BoucWen(**dict(zip(names, values, strict=True))).response(INPUT)

    rng = np.random.default_rng(5)
    found = np.empty((300, 4))
    for k in range(300):
        y = LAW.response(INPUT) + 0.01 * rng.standard_normal(INPUT.size)
        found[k] = optimize.least_squares(lambda values, y=y: response(values) - y, truth).x
    outputs = np.array([response(values) for values in found])
    widths = np.array([hs.loop_metrics(INPUT, y).max_width for y in outputs])
    held = {"n": 1.0, "z0": 0.0, "offset": 0.0}
    fits = [hs.identify(hs.BoucWen, noisy(seed=seed), fixed=held) for seed in range(9)]
    assert fits[0].free_names == names
    # the standard errors of one record scatter by 11 % with its sigma, their median by 5 %
    stderr = np.median([list(fit.stderr.values()) for fit in fits], axis=0)
    np.testing.assert_allclose(stderr, np.std(found, axis=0), rtol=0.25)
    np.testing.assert_allclose(np.median([fit.correlation for fit in fits], axis=0), np.corrcoef(found.T), atol=0.25)
    band = np.median([fit.response_stderr for fit in fits], axis=0)
    np.testing.assert_allclose(band, np.std(outputs, axis=0), rtol=0.25, atol=1e-6)
    half = np.median([fit.loop_width.upper - fit.loop_width.value for fit in fits])
    assert half == pytest.approx(stats.t.ppf(0.975, INPUT.size - 4) * np.std(widths), rel=0.25)


def test_the_band_of_the_output_is_that_of_the_delta_method():
    fit = hs.identify(LAW, noisy(), fixed={"n": 1.0})
    slopes = np.empty((INPUT.size, fit.n_parameters))
    for place, name in enumerate(fit.free_names):
        ends = [
            dataclasses.replace(fit.model, **{name: fit.estimates[name] + step}).response(INPUT)
            for step in (1e-6, -1e-6)
        ]
        slopes[:, place] = (ends[0] - ends[1]) / 2e-6
    by_hand = np.sqrt(np.einsum("nk,kl,nl->n", slopes, fit.covariance, slopes))
    np.testing.assert_allclose(fit.response_stderr, by_hand, rtol=1e-5)  # differences of 1e-9, condition 1e2 to 1e3


def test_a_profile_ends_at_the_bound_of_its_parameter_and_says_so():
    record = line_record()
    free = hs.identify(hs.Line, record, intervals="profile")
    for bounds, side in (((0.0, 2.0), 1), ((1.95, np.inf), 0)):
        fit = hs.identify(hs.Line, record, bounds={"slope": bounds}, intervals="profile")
        assert fit.intervals["slope"][side] == pytest.approx(bounds[side], abs=1e-3)
        assert fit.intervals["slope"][1 - side] == pytest.approx(free.intervals["slope"][1 - side], rel=1e-3)
        assert fit.profiles["slope"].at_box == (side == 0, side == 1)
        assert "the interval of slope ends at its search bound" in fit.message


def test_a_linear_parameter_at_its_bound_is_named():
    fit = hs.identify(hs.Line, line_record(), bounds={"slope": (0.0, 1.5)}, intervals="profile")
    assert fit.estimates["slope"] == 1.5
    assert fit.intervals["slope"][1] == 1.5
    assert "slope is at its given bound 1.5" in fit.message


def test_an_exponent_at_the_side_of_its_box_is_taken_as_known():
    fit = hs.identify(LAW, noisy(), bounds={"n": (2.0, 3.0)})
    given = hs.identify(LAW, noisy(), fixed={"n": fit.estimates["n"]})
    assert fit.estimates["n"] == pytest.approx(2.0)
    assert np.isnan([fit.stderr["n"], *fit.intervals["n"]]).all()
    assert "n is at its given bound 2" in fit.message
    factor = np.sqrt((INPUT.size - given.n_parameters) / (INPUT.size - fit.n_parameters))
    assert fit.stderr["beta"] == pytest.approx(factor * given.stderr["beta"], rel=1e-3)  # of two descents


@pytest.mark.parametrize("kind", KINDS)
def test_a_redundant_pair_has_no_numbers_but_words(kind):
    fit = hs.identify(LAW, noisy(), free=("A", "gain"), fixed={"n": 1.0}, intervals=kind)
    for name in ("A", "gain"):
        assert np.isnan([fit.stderr[name], *fit.intervals[name]]).all()
        assert name not in fit.profiles
    (sentence,) = (each for each in fit.warnings if each.startswith("no standard error for"))
    assert all(name in sentence.split(":")[0].replace(",", "").split() for name in ("A", "gain"))
    assert all("the data determine only the product of A and gain" in text for text in (sentence, fit.message))
    assert any({"A", "gain"} <= set(group) for group in fit.redundant)
    assert np.isfinite([fit.stderr["beta"], *fit.intervals["beta"]]).all()
    assert fit.condition > 1e7


def test_a_bootstrap_of_data_that_rounding_alone_disturbs_is_not_trusted():
    quantum = 0.1
    rounded = hs.Record(u=INPUT, y=quantum * np.round(LAW.response(INPUT) / quantum), resolution=quantum)
    drawn, profile = (
        hs.identify(LAW, rounded, fixed={"n": 1.0, "z0": 0.0}, noise="quantised", intervals=kind)
        for kind in ("bootstrap", "profile")
    )
    assert 'use "profile"' in drawn.message
    assert "ask for profiles" not in profile.message
    for name in profile.free_names:
        lower, upper = profile.intervals[name]
        assert lower < getattr(LAW, name) < upper
        assert upper - lower > np.ptp(drawn.intervals[name])


def test_one_of_a_redundant_pair_can_be_chosen():
    fit = hs.identify(LAW, noisy(), free=("A",), fixed={"n": 1.0})
    assert "A" in fit.free_names
    assert "gain" not in fit.free_names
    assert np.isfinite(list(fit.stderr.values())).all()
