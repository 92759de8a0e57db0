"""A result goes to JSON and back, is the same on one thread, and is drawn with what it knows."""

import json

import numpy as np
import pytest
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
