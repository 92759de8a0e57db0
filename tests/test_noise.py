"""The noise of the output and of the input: densities, turns that are none, and samples that count by their weights."""

import io
import json
import re

import numpy as np
import pytest
from scipy import stats
from strategies import assert_refused

import hysim as hs
from hysim._columns.input_noise import input_noise, quiet_path, repeated_cycle
from hysim.cli import main
from hysim.identification._noise import Gaussian, Quantised, Robust
from hysim.identification.doubts import rate_noise_warning

# ---------------------------------------------------------------------------------- densities of the noise


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


@pytest.mark.parametrize("family", [hs.PrandtlIshlinskii, hs.Duhem, hs.SingleValued])
def test_an_output_without_weight_changes_nothing(family):
    """Neither the box of a search nor a measure of the fit."""
    rng, u = np.random.default_rng(3), hs.signals.decaying_sine(3.0, cycles=3, samples_per_cycle=60)
    y = hs.BoucWen(beta=0.5, gamma=0.2, feedthrough=0.6, gain=1.5).response(u) + 0.02 * rng.standard_normal(u.size)
    weights, wrong = np.ones(u.size), y.copy()
    weights[33], wrong[33] = 0.0, 1e9
    fits = [hs.identify(family, hs.Record(u=u, y=each), weights=weights, cross_validate=5) for each in (y, wrong)]
    assert fits[0].estimates == fits[1].estimates
    assert fits[0].cv_rmse == pytest.approx(fits[1].cv_rmse, rel=1e-6)
    assert str(fits[0]) == str(fits[1])
    assert fits[1].residual[33] == pytest.approx(1e9)


def test_robust_standard_errors_are_those_of_the_information():
    """That of Student's t on the location is (nu + 1) / (nu + 3) / sigma^2; the descent's weights sum up to more."""
    rng, u = np.random.default_rng(4), np.linspace(-1.0, 1.0, 200)
    fit = hs.identify(hs.Line, hs.Record(u=u, y=0.3 + 2.0 * u + 0.1 * rng.standard_t(4, u.size)), noise="robust")
    expected = fit.sigma * np.sqrt(7.0 / 5.0 * u.size / (u.size - 2)) / np.linalg.norm(u - u.mean())
    assert fit.stderr["slope"] == pytest.approx(expected, rel=1e-6)


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


# ---------------------------------------------------------------------------------- a measured input


CYCLES = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=200)
SINE = np.sin(2.0 * np.pi * np.arange(800) / 250.0)
LAW = hs.BoucWen(beta=1.5, gamma=0.5, n=1.0, gain=2.0, feedthrough=0.5)


def noise(size, n=CYCLES.size, seed=0):
    return size * np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize("u", [CYCLES, SINE], ids=["triangle", "sine"])
@pytest.mark.parametrize("size", [0.01, 0.03])
def test_the_noise_of_an_input_is_estimated(u, size):
    measured = u + noise(size, u.size)
    assert input_noise(measured) == pytest.approx(size, rel=0.2)
    path = quiet_path(measured, input_noise(measured))
    assert hs.Record(u=path, y=path).reversals().size == hs.Record(u=u, y=u).reversals().size
    assert np.std(path - u) < np.std(measured - u)


@pytest.mark.parametrize(
    "u",
    [CYCLES, SINE, np.sin(2.2 * np.arange(500)), np.sin(0.0005 * np.arange(1000.0) ** 2), noise(1.0), np.zeros(50),
     np.repeat(np.arange(30.0), 4), CYCLES[::20]],
    ids=["triangle", "sine", "fast sine", "chirp", "white", "constant", "staircase", "few samples"],
)  # fmt: skip
def test_a_signal_is_not_taken_for_noise(u):
    assert input_noise(u) == 0.0


def test_a_law_is_found_behind_a_noisy_input():
    record = hs.Record(u=CYCLES + noise(0.02), y=LAW.response(CYCLES) + noise(1e-3, seed=1))
    fit = hs.identify(hs.BoucWen, record, fixed={"n": 1.0})
    assert "fitted along 5 of 271 reversals, the model includes a filter of reversals up to 0.148" in fit.message
    assert fit.family == "ReversalFilter >> BoucWen"
    assert fit.estimates["reversal_filter.threshold"] == fit.model.stages[0].threshold
    assert fit.success
    floor = np.std(record.y - (fit.model.stages[0].placed(None) >> LAW).response(record.u))
    assert fit.rmse < 1.05 * floor  # the true law behind the same filter
    for name, true in {"beta": 1.5, "gamma": 0.5, "gain": 2.0, "feedthrough": 0.5}.items():
        assert abs(fit.estimates[name] - true) < 3.0 * fit.stderr[name], name
    quiet = hs.identify(hs.BoucWen, hs.Record(u=CYCLES, y=record.y), fixed={"n": 1.0})
    assert "noise" not in quiet.message
    assert isinstance(quiet.model, hs.BoucWen)


def test_the_treatment_of_the_input_can_be_told():
    record = hs.Record(u=CYCLES + noise(0.01), y=LAW.response(CYCLES) + noise(1e-3, seed=1))
    fits = {how: hs.identify(hs.BoucWen, record, fixed={"n": 1.0}, input=how) for how in ("raw", "filtered")}
    assert isinstance(fits["raw"].model, hs.BoucWen)
    assert isinstance(fits["filtered"].model, hs.Cascade)
    for fit in fits.values():
        np.testing.assert_array_equal(fit.residual, record.y - fit.model.response(record.u))
    assert_refused("input must be one of auto, raw, filtered", hs.identify, hs.BoucWen, record, input="quiet")
    with pytest.raises(ValueError, match="no noise was found in the input"):
        hs.identify(hs.BoucWen, hs.Record(u=CYCLES, y=record.y), input="filtered")


def test_plays_need_no_filter():
    """A play follows each sample and closes the loop of each false reversal."""
    plays = hs.PrandtlIshlinskii(thresholds=(0.0, 0.3, 0.6), weights=(1.0, 1.0, 0.5))
    record = hs.Record(u=CYCLES + noise(0.01), y=plays.response(CYCLES))
    fit = hs.identify(plays, record)
    assert isinstance(fit.model, hs.PrandtlIshlinskii)
    assert "follows the input as measured" in fit.message


def test_a_law_that_no_filter_saves_is_not_a_success():
    """The noise of the output is far below what the noise of the input does behind the filter."""
    rng = np.random.default_rng(3)
    u = np.repeat(np.linspace(0.0, 1.0, 40), 20)
    u = np.concatenate([u, u[::-1], u])
    stiff = hs.BoucWen(A=1.0, beta=200.0, gamma=0.0, n=1.0, gain=400.0)
    record = hs.Record(u=u + 0.02 * rng.standard_normal(u.size), y=stiff.response(u))
    fit = hs.identify(hs.BoucWen, record, fixed={"n": 1.0})
    assert not fit.success
    assert fit.message.startswith("NOT USABLE on this input")


def test_a_cycle_is_found_in_a_noisy_input():
    plays = hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(1.0, 1.0))
    u = 3.0 + CYCLES
    record = hs.Record(u=(u + noise(0.02))[130:580], y=plays.response(u)[130:580])
    assert repeated_cycle(record.u) == pytest.approx(200, abs=5)
    assert hs.identify(hs.PrandtlIshlinskii, record, initial="periodic").fit_percent > 95.0


@pytest.mark.parametrize("family", [hs.BoucWen, hs.PrandtlIshlinskii, hs.Line], ids=lambda each: each.__name__)
def test_a_sample_of_weight_zero_has_no_say(family):
    u = CYCLES[::5]
    y = LAW.response(u) + noise(1e-3, u.size)
    weights = np.ones(u.size)
    weights[20:60:3] = 0.0
    spoilt = np.where(weights, y, 50.0)
    fits = [hs.identify(family, hs.Record(u=u, y=each), weights=weights) for each in (y, spoilt)]
    for name, value in fits[0].estimates.items():
        assert fits[1].estimates[name] == pytest.approx(value, rel=1e-4, abs=1e-4), name
        assert fits[1].stderr.get(name, 0.0) == pytest.approx(fits[0].stderr.get(name, 0.0), rel=1e-2, nan_ok=True)
    assert fits[0].rmse == pytest.approx(fits[1].rmse, rel=1e-6)
    assert fits[0].residual.size == u.size


def test_a_weight_of_two_is_a_sample_twice():
    u = np.linspace(0.0, 1.0, 12)
    y = 2.0 * u + noise(0.1, 12)
    twice = hs.identify(hs.Line, hs.Record(u=np.append(u, u[-1:]), y=np.append(y, y[-1:])))
    weighted = hs.identify(hs.Line, hs.Record(u=u, y=y), weights=np.append(np.ones(11), 2.0))
    assert weighted.estimates["slope"] == pytest.approx(twice.estimates["slope"], rel=1e-12)
    equal = hs.identify(hs.Line, hs.Record(u=u, y=y), weights=np.full(12, 7.0))
    plain = hs.identify(hs.Line, hs.Record(u=u, y=y))
    assert equal.stderr == pytest.approx(plain.stderr, rel=1e-12)
    assert equal.bic == pytest.approx(plain.bic, rel=1e-12)


@pytest.mark.parametrize(
    ("weights", "message"),
    [(np.ones(3), "one number for each sample, 12; got 3"), (-np.ones(12), "not be negative"), (np.zeros(12), "all")],
)
def test_wrong_weights_are_named(weights, message):
    u = np.linspace(0.0, 1.0, 12)
    assert_refused(message, hs.identify, hs.Line, hs.Record(u=u, y=u), weights=weights)
    assert_refused(message, hs.identify, hs.SingleValued, hs.Record(u=u, y=u), weights=weights)


def test_the_energy_decides_and_the_intervals_are_those_for_errors_of_the_output():
    """In closed form for a line; a law with memory loses less work than the one that fits the output best."""
    rng, u = np.random.default_rng(2), hs.signals.triangle(-1.0, 1.5, cycles=3, samples_per_cycle=60)
    works = [np.append(0.0, np.cumsum(np.diff(u) * 0.5 * (c[1:] + c[:-1]))) for c in np.eye(u.size)]
    work, columns = np.array(works).T, np.column_stack([np.ones_like(u), u])
    y = columns @ [0.3, 2.0] + 0.1 * rng.standard_normal(u.size)
    fit, back = hs.identify(hs.Line, hs.Record(u=u, y=y), weights="energy"), np.linalg.pinv(work @ columns) @ work
    np.testing.assert_allclose([fit.estimates[name] for name in ("offset", "slope")], back @ y, rtol=1e-9)
    stderr = np.sqrt(np.sum(fit.residual**2) / (u.size - 2) * np.sum(back**2, axis=1))
    np.testing.assert_allclose([fit.stderr[name] for name in ("offset", "slope")], stderr, rtol=1e-6)
    record = hs.Record(u=u, y=hs.Dahl(stiffness=3.0, coulomb=0.8).response(u) + 0.1 * rng.standard_normal(u.size))
    of_output, of_energy = (hs.identify(hs.Dahl, record, weights=each) for each in (None, "energy"))
    assert of_energy.least_squares.estimates == pytest.approx(of_output.estimates)
    assert f"where {of_output.fit_percent:.4g} % is possible" in of_energy.message
    by_output, by_energy = of_output.residual, of_energy.residual
    assert np.sum((work @ by_energy) ** 2) < 0.95 * np.sum((work @ by_output) ** 2)
    small = hs.Record(u=1e-9 * u, y=record.y)
    np.testing.assert_allclose(hs.identify(hs.Dahl, small, weights="energy").residual, by_energy, atol=1e-3)
    held = hs.identify(hs.Line, hs.Record(u=u, y=y), weights="energy", bounds={"slope": (0.0, 1.0)})
    assert "slope is at its given bound 1" in held.message
    assert_refused("no cross_validate", hs.identify, hs.Dahl, record, weights="energy", cross_validate="cycles")
    assert_refused("searched for", hs.identify, hs.SingleValued, record, weights="energy")
    frame = hs.shear_frame([1.0], laws=hs.Bilinear())
    assert_refused("not for a structure", hs.identify, frame, record, weights="energy")


@pytest.mark.parametrize("source", ["spoilt.csv", "-"])
def test_the_command_line_takes_weights_from_a_column(source, tmp_path, monkeypatch, capsys):
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    y = hs.Dahl(stiffness=3.0, coulomb=0.7).response(u)
    weights = np.ones(u.size)
    weights[30:40] = 0.0
    table = "u,y,quality\n" + "\n".join(
        f"{a!r},{b!r},{w!r}"
        for a, b, w in zip(u.tolist(), (y + 5.0 * (1.0 - weights)).tolist(), weights.tolist(), strict=True)
    )
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spoilt.csv").write_text(table)
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(table.encode())))
    assert main(["identify", source, "--model", "dahl", "--weights", "quality", "--json"]) == 0
    estimates = json.loads(capsys.readouterr().out)["estimates"]
    assert estimates["stiffness"] == pytest.approx(3.0, rel=1e-6)
    assert estimates["coulomb"] == pytest.approx(0.7, rel=1e-6)


RATE = 1e-2  # s
MOVING = np.sin(2.0 * np.pi * 0.4 * RATE * np.arange(800)) * (1.0 + 0.3 * np.sin(0.9 * RATE * np.arange(800)))
FRICTION = hs.LuGre(sigma0=50.0, sigma1=0.05, sigma2=0.1, coulomb=1.0, breakaway=1.4, stribeck_velocity=0.3)
DAMPER = hs.Line(slope=2.0) + hs.Dashpot(c=0.3)


def moved(model, size):
    """A record with noise of .3 % of the output's span, and of `size` on the measured input."""
    y = model.response(MOVING, RATE)
    y = y + 0.003 * np.ptp(y) * np.random.default_rng(4).standard_normal(y.size)
    return hs.Record(u=MOVING + noise(size, MOVING.size), y=y, t=RATE * np.arange(y.size))


@pytest.mark.parametrize("size", [3e-4, 3e-3, 0.03])
@pytest.mark.parametrize("model", [FRICTION, DAMPER], ids=["LuGre", "dashpot"])
def test_noise_of_an_input_whose_velocity_counts_is_named_with_its_size(model, size):
    sentence = rate_noise_warning([model], [moved(model, size)])
    level = float(re.search(r"noise of about (\S+) rms", sentence)[1])
    assert level == pytest.approx(size, rel=0.2)
    assert "savgol_filter" in sentence


@pytest.mark.parametrize("model", [FRICTION, DAMPER], ids=["LuGre", "dashpot"])
def test_an_input_without_noise_or_a_model_without_time_is_not_doubted(model):
    assert rate_noise_warning([model], [moved(model, 0.0)]) == ""
    assert rate_noise_warning([model], [moved(model, 1e-6)]) == ""
    assert rate_noise_warning([LAW], [moved(model, 3e-3)]) == ""


def test_a_fit_of_a_rate_says_that_its_input_is_noisy():
    clean, noisy = (hs.identify(hs.Line() + hs.Dashpot(), moved(DAMPER, size)) for size in (0.0, 0.01))
    assert clean.estimates["dashpot.c"] == pytest.approx(0.3, rel=0.01)
    assert noisy.estimates["dashpot.c"] < 0.25  # a noisy regressor makes its coefficient smaller
    assert not any("input has noise" in each for each in clean.warnings)
    assert any("the input has noise of about 0.011 rms" in each for each in noisy.warnings)


def test_parameters_that_follow_a_channel_take_a_noisy_input_as_it_is():
    records = [
        hs.Record(u=CYCLES + noise(0.01, seed=k), y=T * hs.Play(threshold=0.2).response(CYCLES), channels={"T": T})
        for k, T in enumerate((1.0, 2.0))
    ]
    fit = hs.identify(hs.Play, records, depends={"gain": ("T", 1)})
    assert isinstance(fit.model, hs.Dependent)
    assert fit.fit_percent > 95.0
