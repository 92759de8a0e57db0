"""Data that cannot tell end in one clear line, or in a result that says what they cannot tell."""

import functools

import numpy as np
import pytest
from strategies import assert_refused, refused

import hysim as hs

LOOP = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
RISE = np.linspace(0.0, 1.0, 30)
KINDS = ("linear", "profile", "bootstrap")


PLAYS, SLIP = hs.PrandtlIshlinskii(thresholds=(0.0,), weights=(1.0,)), hs.MaxwellSlip(stiffness=(1.0,), slips=(0.1,))
CLASSES = [hs.BoucWen, hs.PolynomialBoucWen, hs.Line, hs.SingleValued, hs.Play, hs.PrandtlIshlinskii]


@pytest.mark.parametrize("model", [*CLASSES, PLAYS, SLIP, hs.Play(), hs.Dahl()])
def test_a_constant_input_is_refused(model):
    assert_refused("the input is constant", hs.identify, model, hs.Record(u=np.ones(20), y=np.arange(20.0)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("family", "untold"), [(hs.BoucWen, "beta gamma z0"), (hs.Play, "threshold z0"), (hs.Line, "")]
)
def test_a_constant_output_is_said_and_tells_nothing_of_the_memory(family, untold, kind):
    held = {"n": 1.0} if family is hs.BoucWen else {}
    for level in (0.0, 1.0) if kind == "linear" else (1.0,):
        fit = hs.identify(family, hs.Record(u=LOOP, y=np.full(LOOP.size, level)), fixed=held, intervals=kind)
        assert "the output is constant" in fit.warnings[0]
        assert "the output is constant" not in fit.message  # said once
        assert fit.rmse < 1e-14
        assert fit.estimates["offset"] == pytest.approx(level, abs=1e-14)
        for name in untold.split():
            assert np.isnan([fit.stderr[name], *fit.intervals[name]]).all()


test_too_few_samples_are_counted = refused(
    (hs.BoucWen, hs.datasets.table1()[:5], "7 parameters cannot be estimated from 5 samples; fix some of them"),
    (hs.Play, hs.Record(u=[0.0, 1.0], y=[0.0, 1.0]), "4 parameters cannot be estimated from 2 samples"),
    call=hs.identify,
)


def test_a_sample_that_carries_the_fit_and_an_offset_of_a_sensor_are_said():
    rng, u = np.random.default_rng(0), hs.signals.triangle(-3.0, 3.0, cycles=3, samples_per_cycle=80)
    y = hs.Dahl(stiffness=2.0).response(u) + 0.02 * rng.standard_normal(u.size)
    assert hs.identify(hs.Dahl, hs.Record(u=u, y=y)).warnings == ()
    shifted = hs.identify(hs.Line, hs.Record(u=u, y=y + 9.0), fixed={"offset": 0.0})
    assert any("mostly its mean" in each for each in shifted.warnings)
    wrong = hs.identify(hs.Dahl, hs.Record(u=u, y=np.where(np.arange(u.size) == 50, 1e9, y)))
    assert any(each.startswith("sample 50 alone") for each in wrong.warnings)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("noise", ["gaussian", "quantised", "robust"])
def test_as_many_samples_as_parameters_leave_no_standard_error(kind, noise):
    two = hs.Record(u=[0.0, 1.0], y=[0.0, 1.0], resolution=0.1)
    fit = hs.identify(hs.Line, two, intervals=kind, noise=noise)
    assert fit.estimates["slope"] == pytest.approx(1.0)
    assert np.isnan([*fit.stderr.values(), *fit.intervals["slope"], fit.fpe, fit.bic]).all()
    assert "no standard errors: 2 samples for 2 parameters" in fit.message


@pytest.mark.parametrize("family", [hs.BoucWen, hs.PolynomialBoucWen])
def test_loading_alone_tells_nothing_of_unloading(family):
    fit = hs.identify(family, hs.Record(u=RISE, y=np.tanh(RISE)), fixed={"n": 2.0, "z0": 0.0})
    assert "the input never turns back" in fit.message
    assert "do not determine beta, gamma separately" in fit.message
    trembling = np.where(np.arange(30) == 10, RISE[9] - 0.004, RISE)
    noisy = hs.identify(family, hs.Record(u=trembling, y=np.tanh(RISE)), fixed={"n": 2.0, "z0": 0.0})
    assert "the input turns back by at most 1 % of its span" in noisy.message
    assert np.isnan([fit.stderr["beta"], fit.stderr["gamma"]]).all()
    assert fit.model.beta + fit.model.gamma == pytest.approx(1.0, abs=1e-6)  # tanh' = 1 - tanh^2


@functools.cache
def fitted_in_units(of_u, of_y):
    table1 = hs.datasets.table1()
    return hs.identify(hs.BoucWen, hs.Record(u=of_u * table1.u, y=of_y * table1.y), fixed={"n": 1.0})


@pytest.mark.parametrize(("of_u", "of_y"), [(1e-6, 1.0), (1e6, 1.0), (1.0, 1e-6), (1.0, 1e6)])
def test_wrong_units_do_not_change_the_fit(of_u, of_y):
    fit, plain = fitted_in_units(of_u, of_y), fitted_in_units(1.0, 1.0)
    assert fit.fit_percent == pytest.approx(plain.fit_percent, abs=1e-6)
    for name, scale in (("gain", of_y / of_u), ("beta", 1.0 / of_u), ("z0", of_u), ("offset", of_y)):
        assert fit.estimates[name] == pytest.approx(plain.estimates[name] * scale, rel=1e-3)
        assert fit.stderr[name] == pytest.approx(plain.stderr[name] * scale, rel=1e-3)


def test_values_beyond_all_units_are_refused(table1):
    for family in (hs.Line, hs.BoucWen):
        with pytest.raises(ValueError, match=r"records between 1e-40 and 1e\+40 in size, got an output y of"):
            hs.identify(family, hs.Record(u=table1.u, y=1e200 * table1.y))


def test_a_large_offset_of_the_input_is_borne_by_the_output_offset(table1):
    plain = fitted_in_units(1.0, 1.0)
    moved = hs.identify(hs.BoucWen, hs.Record(u=table1.u + 1e5, y=table1.y), fixed={"n": 1.0})
    assert moved.fit_percent == pytest.approx(plain.fit_percent, abs=1e-6)
    for name in ("beta", "gamma", "gain", "z0"):
        # the slope's column differs from the offset's by 1e-3: the standard errors lose these digits
        assert moved.estimates[name] == pytest.approx(plain.estimates[name], rel=1e-3)
        assert moved.stderr[name] == pytest.approx(plain.stderr[name], rel=0.01)


def test_samples_that_are_there_twice_change_no_estimate(table1):
    twice = np.repeat(np.arange(len(table1)), 2)
    plain = fitted_in_units(1.0, 1.0)
    fit = hs.identify(hs.BoucWen, hs.Record(u=table1.u[twice], y=table1.y[twice]), fixed={"n": 1.0})
    assert fit.fit_percent == pytest.approx(plain.fit_percent, abs=1e-6)
    assert fit.estimates["beta"] == pytest.approx(plain.estimates["beta"], rel=1e-3)
    assert fit.whiteness < 1e-3  # which says that these are not independent


@pytest.mark.parametrize("noise", ["gaussian", "quantised", "robust"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_perfect_line_has_intervals_no_wider_than_its_quantum(noise, kind):
    fit = hs.identify(hs.Line, hs.Record(u=LOOP, y=3.0 * LOOP, resolution=0.05), noise=noise, intervals=kind)
    assert fit.estimates["slope"] == pytest.approx(3.0, abs=1e-12)
    lower, upper = fit.intervals["slope"]
    assert lower - 1e-12 <= 3.0 <= upper + 1e-12
    if (noise, kind) != ("quantised", "linear"):  # in the middle of a quantum the curvature says next to nothing
        assert upper - lower < (0.05 if noise == "quantised" else 1e-12)


test_what_is_asked_wrongly_is_named = refused(
    ({"noise": "quantized"}, "got 'quantized'; did you mean 'quantised'"),
    ({"intervals": "profiles"}, "intervals must be .* got 'profiles'"),
    ({"initial": "periodc"}, "initial must be .* got 'periodc'"),
    ({"cross_validate": "lou"}, "cross_validate must be .* got 'lou'"),
    ({"cross_validate": True}, "cross_validate must be .* got True"),
    ({"workers": 0}, "workers must be an integer of at least 1, got 0"),
    ({"workers": 1.5}, "workers must be an integer of at least 1, got 1.5"),
    ({"seed": -1}, "seed must be an integer from 0 on, got -1"),
    ({"seed": "a"}, "seed must be an integer from 0 on, got 'a'"),
    ({"bounds": {"slope": 3.0}}, r"bounds of 'slope' must be \(lower, upper\), got 3.0"),
    ({"fixed": {"slope": np.nan}}, "fixed must hold finite numbers, got nan for 'slope'"),
    ({"fixed": {"slope": "a"}}, "fixed must hold finite numbers, got 'a' for 'slope'"),
    ({"fixed": {"slope": 1.0, "offset": 0.0}}, "every parameter is fixed"),
    call=lambda options: hs.identify(hs.Line, hs.datasets.table1(), **options),
)


@pytest.mark.parametrize("n", [0.0, -1.0])
def test_an_exponent_that_is_not_positive_is_refused(table1, n):
    assert_refused("n must be positive", hs.identify, hs.BoucWen, table1, fixed={"n": n})


MASKED = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])


@pytest.mark.parametrize(
    "use",
    [
        lambda u: hs.Record(u=u, y=[1.0, 2.0, 3.0]),
        lambda u: hs.Record(u=[1.0, 2.0, 3.0], y=u),
        lambda u: hs.Record(u=[1.0, 2.0, 3.0], y=[1.0, 2.0, 3.0], t=u),
        lambda u: hs.simulate(hs.BoucWen(), None, u),
        lambda u: hs.BoucWen().response(u),
        lambda u: hs.BoucWen.responses({"beta": u}, [0.0, 1.0]),
        lambda u: hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)).response(u, 1.0),
        lambda u: hs.TransferFunction(num=u, den=(1.0, 1.0, 1.0, 1.0)),
        lambda u: hs.PrandtlIshlinskii(thresholds=(0.0, 1.0, 2.0), weights=u),
        lambda u: hs.loop_metrics(u, [1.0, 2.0, 3.0]),
        lambda u: hs.metrics.rmse(u, [1.0, 2.0, 3.0]),
        lambda u: hs.Sensor().measure(u),
        lambda u: hs.Amplifier().voltage(u),
        lambda u: hs.BoucWen(A=u[1]),
    ],
)
@pytest.mark.parametrize("masked", [MASKED, list(MASKED)], ids=["array", "list"])
def test_masked_values_are_refused_and_not_taken_for_numbers(use, masked):
    assert_refused("masked", use, masked)


def test_a_mask_that_hides_nothing_changes_nothing():
    u = np.ma.array([1.0, 2.0, 4.0])
    assert hs.Record(u=u, y=u) == hs.Record(u=u.data, y=u.data)
    assert type(hs.Record(u=u, y=u).u) is np.ndarray
