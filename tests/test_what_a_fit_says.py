"""What a fit says is what its model does: the residual is the record's output less the model's response."""

import numpy as np
import pytest

import hysim as hs

CYCLES = np.concatenate([hs.signals.triangle(0.0, 100.0, cycles=2, samples_per_cycle=80),
                         hs.signals.triangle(20.0, 70.0, cycles=2, samples_per_cycle=60)[1:]])  # fmt: skip
LAW = hs.BoucWen(beta=0.03, gamma=0.01, gain=-1.0, feedthrough=1.5)
STEP = 1e-3


def record(noise=0.0, *, begin=0, quantum=0.0, seed=0, time=False):
    """A record of a piezo-like law, whose measured input has noise [V]."""
    rng = np.random.default_rng(seed)
    u, y = CYCLES[begin:], LAW.response(CYCLES)[begin:] + 0.1 * rng.standard_normal(CYCLES.size - begin)
    y = quantum * np.round(y / quantum) if quantum else y
    t = STEP * np.arange(u.size) if time else None
    return hs.Record(u=u + noise * rng.standard_normal(u.size), y=y, t=t, resolution=quantum or None)


def check(fit, records):
    """The residual, the error and the model of each record are one."""
    own = []
    for model, rec in zip(fit.models, records, strict=True):
        own.append(rec.y - hs.simulate(model, rec.t, rec.u).y)
    np.testing.assert_array_equal(fit.residual, np.concatenate(own))
    assert fit.rmse == pytest.approx(np.sqrt(np.mean(fit.residual**2)), rel=1e-12)
    assert fit.model == fit.models[0]


FAMILIES = [
    hs.BoucWen, hs.PolynomialBoucWen, hs.Dahl, hs.PrandtlIshlinskii, hs.ModifiedPrandtlIshlinskii,
    hs.ParametricPrandtlIshlinskii, hs.Preisach, hs.Play, hs.Line, hs.ColemanHodgdon,
]  # fmt: skip


@pytest.mark.parametrize("family", FAMILIES, ids=lambda each: each.__name__)
def test_families_of_actuators_with_a_noisy_input(family):
    rec = record(1.0, begin=30)
    check(hs.identify(family, rec, max_evaluations=60), [rec])


@pytest.mark.parametrize("family", [each for each in hs.families().values() if each is not hs.ReversalFilter])
def test_every_family(family):
    """Also of a record that is none of its own, where an optimum may lie far from what the law is made for."""
    u = np.interp(np.linspace(0.0, 8.0, 81), np.arange(9), [0.0, 1.0, -1.0, 0.6, -0.3, 0.8, -1.0, 0.2, -0.5])
    y = 1.5 * u - hs.BoucWen(beta=1.0, gamma=0.5).response(u) + 0.01 * np.random.default_rng(0).standard_normal(81)
    rec = hs.Record(u=u, y=y, t=0.01 * np.arange(81))
    fit = hs.identify(family, rec, max_evaluations=300)
    check(fit, [rec])
    bic = len(rec) * np.log(np.mean(fit.residual**2)) + fit.n_parameters * np.log(len(rec))
    assert fit.bic == pytest.approx(bic, abs=1e-4), "the search was for this law, and not for one near it"


def test_a_slope_that_no_sample_shows_is_zero():
    """Its column is the rounding of the others, in which 6e15 was the best slope."""
    law = hs.OriginOriented(stiffness=2.0, hardening=0.5, yield_input=3.0)
    columns = law.regressors({name: np.array([value]) for name, value in law.scalars.items()}, record())
    assert np.ptp(columns[0, :, 0]) > 0.0
    elastic = hs.Record(u=CYCLES / 100.0, y=CYCLES)
    columns = law.regressors({name: np.array([value]) for name, value in law.scalars.items()}, elastic)
    np.testing.assert_array_equal(columns[0, :, 1], 0.0)


def test_thresholds_do_not_shrink_with_the_speed():
    """The optimum of this record has no growth: the box must not be widened to a negative one."""
    u = np.interp(np.linspace(0.0, 8.0, 81), np.arange(9), [0.0, 1.0, -1.0, 0.6, -0.3, 0.8, -1.0, 0.2, -0.5])
    y = -(u**2) + 0.2 * hs.Play(threshold=0.2).response(u) + 0.01 * np.random.default_rng(0).standard_normal(81)
    fit = hs.identify(hs.RateDependentPrandtlIshlinskii, hs.Record(u=u, y=y, t=0.01 * np.arange(81)))
    assert fit.model.beta >= 0.0


@pytest.mark.parametrize(
    ("family", "options", "noise"),
    [
        (hs.BoucWen, {"initial": "rest"}, 1.0),
        (hs.BoucWen, {"initial": "periodic"}, 0.0),
        (hs.BoucWen, {"noise": "robust"}, 1.0),
        (hs.BoucWen, {"noise": "quantised"}, 1.0),
        (hs.BoucWen, {"input": "raw"}, 1.0),
        (hs.PrandtlIshlinskii, {"input": "filtered"}, 1.0),
        (hs.Dahl, {"intervals": "bootstrap"}, 1.0),
        (hs.BoucWen, {"cross_validate": 4}, 1.0),
        (hs.Sum.structure(hs.Dahl, hs.Line), {}, 1.0),
    ],
    ids=["rest", "periodic", "robust", "quantised", "raw", "filtered", "bootstrap", "left out", "sum"],
)  # fmt: skip
def test_every_option(family, options, noise):
    rec = record(noise, quantum=0.1 if options.get("noise") == "quantised" else 0.0)
    fixed = {"n": 1.0} if family is hs.BoucWen else {}
    check(hs.identify(family, rec, fixed=fixed, max_evaluations=60, **options), [rec])


def test_several_records():
    records = [record(1.0), record(1.0, begin=45, seed=1)]
    fit = hs.identify(hs.BoucWen, records, fixed={"n": 1.0}, max_evaluations=300)
    assert [model.u0 for model in fit.models] == [rec.u[0] for rec in records]
    check(fit, records)


def test_plants_in_time():
    rec = record(time=True)
    check(hs.identify(hs.TransferFunction.structure(poles=1, zeros=0), rec), [rec])
    structure = hs.Cascade.structure(hs.Dahl, hs.TransferFunction.structure(poles=1, zeros=0))
    check(hs.identify(structure, rec, max_evaluations=300), [rec])


def test_rivals_and_regions_are_behind_the_same_filter():
    fit = hs.identify(hs.BoucWen, record(1.0), input="filtered", max_evaluations=300)
    assert isinstance(fit.model, hs.Cascade)
    for each in (*fit.rivals, *fit.regions.values()):
        assert each.model.stages[0] == fit.model.stages[0]
