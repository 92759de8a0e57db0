"""Studies of structures: the numbers of single runs, on every executor; and fragility curves of their results."""

import math

import numpy as np
import pytest
from scipy.special import ndtr
from strategies import assert_refused, refused

import hysim as hs
from hysim.errors import SimulationError

SAMPLE_TIME = 0.02
SPACE = {"record": [0, 1], "scale": np.linspace(0.2, 3.0, 20).tolist()}


def frame(**options):
    column = hs.BoucWen(beta=50.0, gamma=50.0, feedthrough=20.0, gain=180.0)
    return hs.shear_frame([1.0, 1.0], laws=column, damping=hs.ModalDamping(ratio=0.02), **options)


def motions(duration=8.0):
    return [hs.signals.ground_motion(3.0, duration=duration, sample_time=SAMPLE_TIME, seed=seed) for seed in (1, 2)]


def task():
    return hs.structure_task(frame(), motions(), SAMPLE_TIME, ["peak_drift", "residual_drift", "energy"])


MIXED = hs.shear_frame(
    [1.0, 2.0],
    [300.0, 200.0],
    [hs.BoucWenBaberNoori(beta=5.0, gamma=5.0, gain=50.0), hs.Dahl() + hs.Dashpot(c=0.2)],
    damping=hs.Rayleigh.at(0.05, (1.0, 0.2)),
)
SIGNALS = {
    "peak_drift": "peak_drift",
    "residual_drift": "drift",
    "energy": "element_work",
    "peak_force": "peak_force",
    "peak_displacement": "peak_displacement",
    "peak_acceleration": "peak_acceleration",
}


@pytest.mark.parametrize("reduce", SIGNALS)
@pytest.mark.parametrize(
    ("structure", "parameters"),
    [
        (frame(), {"elements.0.beta": [25.0, 50.0, 75.0], "damping": [0.01, 0.02, 0.05], "scale": [1.0, 2.0, 3.0]}),
        (frame(substeps=2), {"elements.*.gain": [100.0, 200.0], "mass": [1.0, 1.3]}),
        (MIXED, {"stiffness": [0.5, 2.0], "damping.mass": [0.1, 0.2]}),
        (MIXED, {"elements.1.dahl.coulomb": [1.0, 2.0], "elements.1.dashpot.c": [0.0, 0.5]}),
    ],
    ids=["bouc-wen", "fixed steps", "matrices", "a sum"],
)
def test_responses_have_the_bits_of_single_runs(structure, parameters, reduce):
    a = motions(4.0)[0]
    rows = structure.responses(parameters, a, sample_time=SAMPLE_TIME, reduce=reduce)
    t = SAMPLE_TIME * np.arange(a.size)
    for k, row in enumerate(rows):
        own = {name: values[k] for name, values in parameters.items()}
        single = hs.simulate(
            structure.assemble({k: v for k, v in own.items() if k != "scale"}), t, own.get("scale", 1.0) * a
        )
        assert np.array_equal(single.signals[SIGNALS[reduce]][-1], row)


def test_responses_do_not_depend_on_the_number_of_threads():
    scales = np.linspace(0.1, 3.0, 31)
    one, two = (frame().responses(scales, motions(4.0)[0], sample_time=SAMPLE_TIME, workers=n) for n in (1, 2))
    assert np.array_equal(one, two)
    assert np.array_equal(one[7], frame().responses([scales[7]], motions(4.0)[0], sample_time=SAMPLE_TIME)[0])


def test_each_set_may_have_its_own_input():
    inputs = np.stack(motions(4.0))
    rows = frame().responses({}, inputs, sample_time=SAMPLE_TIME)
    for a, row in zip(inputs, rows, strict=True):
        assert np.array_equal(frame().responses([1.0], a, sample_time=SAMPLE_TIME)[0], row)


def test_a_motion_that_diverges_is_a_row_of_inf():
    escaping = hs.BoucWen(beta=-2000.0, gamma=0.0, n=2.0, gain=180.0)
    building = hs.shear_frame([1.0], laws=escaping, damping=hs.ModalDamping(ratio=0.02))
    a = motions(4.0)[0]
    rows = building.responses([0.01, 50.0], a, sample_time=SAMPLE_TIME)
    assert np.isfinite(rows[0]).all()
    assert np.isinf(rows[1]).all()
    with pytest.raises(SimulationError, match="diverges at t = "):
        hs.simulate(building, SAMPLE_TIME * np.arange(a.size), 50.0 * a)


test_errors_say_what_is_wrong = refused(
    ({"elements.0.nothing": [1.0]}, {}, "no parameter 'elements.0.nothing'"),
    ([1.0, 2.0], {"reduce": "drift"}, "reduce must be one of"),
    ({"damping": [0.1, 0.2], "scale": [1.0, 2.0, 3.0]}, {}, "one for each"),
    ({"elements.0.n": [-1.0]}, {}, "n must"),
    call=lambda parameters, options: frame().responses(parameters, motions(1.0)[0], sample_time=SAMPLE_TIME, **options),
)


@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_a_study_is_the_same_on_every_executor(executor):
    study = hs.sweep(task(), SPACE, executor=executor, workers=2)
    single = frame().responses(SPACE["scale"], motions()[1], sample_time=SAMPLE_TIME)
    assert np.array_equal(study["peak_drift_each"][20:], single)
    assert np.array_equal(study["peak_drift"][20:], single.max(axis=1))


def test_an_interrupted_incremental_dynamic_analysis_goes_on_and_loses_nothing(tmp_path):
    """One that is killed loses nothing either: `test_sweep_store.py` kills a study of less costly tasks."""
    path = tmp_path / "ida.hysim"

    def interrupt(done, total):
        if done > 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hs.sweep(task(), SPACE, store=path, workers=1, progress=interrupt)
    assert 5 < len(hs.load_sweep(path)) < 120
    again = hs.sweep(task(), SPACE, store=path, workers=2)
    whole = hs.sweep(task(), SPACE)
    for name in ("peak_drift", "peak_drift_each", "residual_drift", "energy_each"):
        assert np.array_equal(again[name], whole[name])


def test_the_largest_acceleration_under_a_force_has_the_force():
    plant = frame(excitation="force", influence=(1.0, 0.5))
    u = 5.0 * motions(4.0)[0]
    rows = plant.responses([1.0], u, sample_time=SAMPLE_TIME, reduce="peak_acceleration")
    sim = hs.simulate(plant, SAMPLE_TIME * np.arange(u.size), u)
    np.testing.assert_allclose(rows[0], abs(sim.signals["acceleration"]).max(axis=0), rtol=1e-9)
    np.testing.assert_allclose(sim.peaks["acceleration"], rows[0], rtol=1e-9)


# ---------------------------------------------------------------------------------- fragility curves


MEDIAN, DISPERSION = 0.7, 0.4
LEVELS = np.linspace(0.2, 1.6, 8)


def test_a_curve_through_two_shares_has_the_closed_form():
    curve = hs.fragility([1.0, math.e], [16, 84], 100)
    quantile = 0.994457883  # of 84 %
    density = math.exp(-0.5 * quantile**2) / math.sqrt(2.0 * math.pi)
    error = 1.959964 * math.sqrt(0.16 * 0.84 / 200.0) / density / (2.0 * quantile)
    assert (curve.median, curve.dispersion) == pytest.approx((math.exp(0.5), 0.5 / quantile), rel=1e-8)
    assert np.log(curve.median_interval) == pytest.approx([0.5 - error, 0.5 + error], rel=1e-6)
    assert curve.probability([-1.0, 0.0, 1.0, math.e]) == pytest.approx([0.0, 0.0, 0.16, 0.84], rel=1e-8)
    far = hs.fragility([1e-9, 1.0, math.e, 1e9], [0, 16, 84, 100], 100)  # where counts say nothing more
    assert (far.median, far.dispersion) == pytest.approx((curve.median, curve.dispersion), rel=1e-6)


@pytest.mark.parametrize("same_records", [False, True])
def test_estimates_recover_the_truth_and_intervals_and_bands_cover_it(same_records):
    rng, x, estimates, covered = np.random.default_rng(3), np.array([0.4, 0.7, 1.2]), [], []
    truth = ndtr(np.log(x / MEDIAN) / DISPERSION)
    for _ in range(400):
        capacity = MEDIAN * np.exp(DISPERSION * rng.normal(size=(40, 1 if same_records else LEVELS.size)))
        curve = hs.fragility(LEVELS, (capacity < LEVELS).sum(axis=0), 40, same_records=same_records)
        limits = np.transpose([curve.median_interval, curve.dispersion_interval, *curve.band(x).T])
        estimates.append((curve.median, curve.dispersion))
        covered.append((limits[0] <= (MEDIAN, DISPERSION, *truth)) & ((MEDIAN, DISPERSION, *truth) <= limits[1]))
        assert curve.band([0.0]).tolist() == [[0.0], [0.0]]
    assert np.mean(estimates, axis=0) == pytest.approx((MEDIAN, DISPERSION), rel=0.03)  # 40 records: 2 % too small
    assert np.mean(covered, axis=0) == pytest.approx(0.945, abs=0.035)  # three standard errors of a share of 400


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([1.0, 2.0], [0, 0], 5), "no record exceeds"),
        (([1.0, 2.0], [5, 5], 5), "every record exceeds"),
        (([1.0, 2.0, 3.0], [0, 2, 5], 5), "below the intensity 2, and all do above it"),
        (([1.0, 2.0, 3.0], [4, 2, 1], 5), "does not rise with the intensity"),
        (([0.2, 0.4, 0.6], [10, 10, 10], 20), "does not rise with the intensity"),
        (([1.0, 1.0], [1, 2], 5), "two must differ"),
        (([1.0, 2.0], [1, 6], 5), "whole numbers from 0 to n_records"),
        (([1.0, 2.0, 3.0], [1, 2, 3], [5, 5]), "n_records must have equal lengths"),
    ],
)
def test_counts_that_determine_no_curve_are_refused(arguments, words):
    assert_refused(words, hs.fragility, *arguments)
    assert_refused("one number at all intensities", hs.fragility, [1.0, 2.0], [1, 2], [4, 5], same_records=True)


def test_the_figures_have_the_numbers():
    space = {"record": [0, 1, 2], "scale": [2.0, 1.0]}
    study = hs.sweep(lambda record, scale: math.inf if record * scale > 3.0 else (1.0 + record) * scale, space)
    ax = hs.plot.ida(study, "value", hs.plot.figure().add_subplot(), limit=2.5)
    assert [line.get_xdata().tolist() for line in ax.lines[:4]] == [[1, 2], [2, 4], [3, math.inf], [1, 2]]
    assert [line.get_label() for line in ax.lines[3:]] == ["16%", "50%", "84%", "limit"]
    assert_refused("a grid with the parameter pga", hs.plot.ida, study, "value", intensity="pga")
    curve = hs.fragility(study.axes["scale"], [2, 1], 3)
    points = hs.plot.fragility(curve, hs.plot.figure().add_subplot()).lines[1]
    assert points.get_xydata() == pytest.approx(np.array([[2.0, 2 / 3], [1.0, 1 / 3]]))
