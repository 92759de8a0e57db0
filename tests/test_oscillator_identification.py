"""The oscillator's parameters come back from its input and output alone."""

from dataclasses import replace

import numpy as np
import pytest
from strategies import COMPILED, assert_refused, needs_compiled, refused

import hysim as hs
from hysim.models.search_space import Freedom
from hysim.plants.oscillator_structure import decimated, interpolated, interpolated_record

TRUTH = {"mass": 2.0, "damping": 10.0, "stiffness": 5e4, "A": 5e4, "beta": 800.0, "gamma": -300.0, "n": 1.0}
STEP = 1.0 / 750.0
structure = hs.BoucWenOscillator.structure
BENCHMARK = structure(
    method="newmark", oversampling=20, decimation=(2, 2, 5), initial="periodic", period=8192, hold="band-limited"
)


def plant(**options) -> hs.BoucWenOscillator:
    law = hs.BoucWen(**{name: TRUTH[name] for name in ("A", "beta", "gamma", "n")})
    return hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=5e4, law=law, **options)


def sines(n_samples: int, seed: int = 0) -> np.ndarray:
    """One period of lines up to 80 Hz, random phases."""
    lines = np.arange(1, int(80.0 * n_samples * STEP) + 1)
    spectrum = np.zeros(n_samples // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * np.random.default_rng(seed).random(lines.size))
    period = np.fft.irfft(spectrum)
    return 40.0 * period / period.std()


def record(u: np.ndarray, y: np.ndarray) -> hs.Record:
    return hs.Record(u=u, y=y, t=STEP * np.arange(u.size))


def from_rest(n_samples: int = 256 if COMPILED else 96, **options) -> hs.Record:
    u = sines(n_samples)
    u = u - u[0]
    return record(u, plant(substeps=4, **options).response(u, STEP))


def steady(periods: int = 2, n_samples: int = 128 if COMPILED else 64) -> hs.Record:
    u = sines(n_samples)
    y = plant(substeps=4).periodic_response(u, STEP)
    return record(np.tile(u, periods), np.tile(y, periods))


def worst(fit: hs.Identification) -> float:
    return max(abs(fit.estimates[name] / TRUTH[name] - 1.0) for name in fit.free_names)


@needs_compiled
@pytest.mark.parametrize(("k", "size"), [(3, 1.0), (20, 10.0), (150, -30.0)])
def test_one_outlier_does_not_move_the_robust_optimum(k, size):
    rec = from_rest()
    y = rec.y + 1e-3 * rec.y.std() * np.random.default_rng(0).standard_normal(len(rec))
    y[k] += size * rec.y.std()
    fit = hs.identify(structure(), record(rec.u, y), fixed={"n": 1.0}, noise="robust")
    assert fit.success
    assert worst(fit) < 0.02


@pytest.mark.parametrize("made", ["from rest", pytest.param("steady", marks=needs_compiled)])
def test_all_seven_parameters_come_back_without_a_guess(made):
    rec = from_rest() if made == "from rest" else steady()
    given = {} if made == "from rest" else {"initial": "periodic", "period": len(rec) // 2}
    fit = hs.identify(structure(**given), rec)
    assert fit.success
    assert fit.fit_percent > 99.9999  # of the returned model, which begins as the record does
    assert fit.free_names == tuple(TRUTH)
    assert worst(fit) < 1e-6  # the search ends when a step lowers the sum of squares by less than 1e-10 of it


@needs_compiled
def test_the_benchmarks_recipe_gives_its_records():
    rec = hs.benchmarks.noel_schoukens(seed=4, periods=2)
    true = {**TRUTH, "gamma": -1100.0}
    output = BENCHMARK.regressors({name: np.array([value]) for name, value in true.items()}, rec)
    assert output.shape == (1, len(rec), 1)
    assert np.abs(output[0, :, 0] - rec.y).max() < 1e-13  # 1e-10 of the output: how steady a state must be


@needs_compiled
def test_a_noisy_record_by_the_benchmarks_recipe_comes_back_within_its_standard_errors():
    """The benchmark's own records, eight times as long, are those of its experiment."""
    u, rng = sines(1024, seed=3), np.random.default_rng(3)
    rec = record(np.tile(u, 2), np.tile(hs.benchmarks.simulate_official(u), 2) + 8e-6 * rng.standard_normal(2048))
    fit = hs.identify(replace(BENCHMARK, period=1024), rec, fixed={"n": 1.0})
    for name, value in {**TRUTH, "gamma": -1100.0}.items():
        assert abs(fit.estimates[name] - value) <= 4.0 * fit.stderr.get(name, 0.0)  # one in 3 000 is farther off
    test = sines(1024, seed=1000)
    error = hs.benchmarks.simulate_official(test, plant=fit.model) - hs.benchmarks.simulate_official(test)
    assert np.sqrt(np.mean(error**2)) < 9e-7  # sqrt(6 parameters / 2 048 samples) of the noise is 4.3e-7


def test_where_a_base_shakes_the_mass_is_held_and_the_ratios_come_back():
    fit = hs.identify(structure(excitation="base"), from_rest(excitation="base"), fixed={"n": 1.0})
    assert "mass" not in fit.free_names
    assert fit.estimates["mass"] == 1.0
    for name in ("damping", "stiffness", "A"):
        assert fit.estimates[name] == pytest.approx(TRUTH[name] / 2.0, rel=1e-6)
    assert fit.estimates["beta"] == pytest.approx(800.0, rel=1e-6)


@needs_compiled
def test_a_spring_that_yields_and_drifts_is_near_no_linear_plant_and_yet_found():
    """Yield at 10 mm, motions of 40 mm rms; the linear plant would have a negative mass."""
    law = hs.BoucWen(A=9e4, beta=60.0, gamma=40.0)
    yielding = hs.BoucWenOscillator(mass=2.0, damping=10.0, stiffness=8e3, law=law, substeps=4)
    white = np.random.default_rng(0).standard_normal(304)
    u = 1500.0 * np.convolve(white, np.ones(5) / 5.0, mode="valid")
    t = 3.0 * STEP * np.arange(300)
    fit = hs.identify(structure(), hs.Record(u=u, y=yielding.response(u, t[1]), t=t), fixed={"n": 1.0})
    for name, value in {"mass": 2.0, "damping": 10.0, "stiffness": 8e3, "A": 9e4, "beta": 60.0, "gamma": 40.0}.items():
        assert fit.estimates[name] == pytest.approx(value, rel=1e-6)


def test_fixed_parameters_stay_and_bounds_hold():
    rec, free = from_rest(), Freedom(fixed={"mass": 2.0, "n": 1.0}, bounds={"A": (1e4, 4e4), "damping": (0.0, np.inf)})
    space = structure().search_space(rec, free)
    assert space.names == ("damping", "stiffness", "A", "beta", "gamma")
    place = space.coordinates.index("A")
    assert (space.lower[place], space.upper[place]) == (1e4, 4e4)
    assert np.all((space.starts >= space.lower) & (space.starts <= space.upper))
    found = space.parameters(space.starts)
    assert np.all(found["mass"] == 2.0)
    assert np.all(found["A"] <= 4e4)


@pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")  # NumPy's scalars warn where nothing is compiled
def test_a_plant_that_escapes_is_a_row_of_inf_and_the_others_go_on():
    rec = from_rest()
    sets = {name: np.array([value, value]) for name, value in TRUTH.items()} | {"stiffness": np.array([5e4, -1e9])}
    rows = structure().regressors(sets, rec)[..., 0]
    assert np.abs(rows[0] - rec.y).max() < 1e-12 * rec.y.max()  # the steps' ends are rounded otherwise
    assert np.isinf(rows[1]).all()


@pytest.mark.parametrize("method", ["split", "newmark", "runge-kutta"])
def test_the_steady_state_is_where_a_long_simulation_ends(method):
    u = sines(64)
    periods = 60 if COMPILED else 12  # five seconds, in which a linear plant of this damping forgets to 3e-6
    stepper = plant(method=method, substeps=3)
    y = stepper.periodic_response(u, STEP)
    long = stepper.response(np.tile(u, periods), STEP)[-64:]
    assert np.abs(y - long).max() < (1e-8 if COMPILED else 1e-2) * y.std()
    again = stepper.periodic_response(np.roll(u, -20), STEP)
    assert np.abs(again - np.roll(y, -20)).max() < 1e-8 * y.std()  # the tolerance is 1e-10 from period to period


def test_without_damping_the_steady_state_is_refused():
    elastic = replace(plant(), damping=0.0, law=hs.BoucWen(A=5e4, beta=0.0, gamma=0.0))
    assert_refused("has not settled", elastic.periodic_response, [1.0, -1.0], STEP, error=hs.SimulationError)


def test_a_band_limited_period_is_interpolated_exactly():
    coarse, fine = (np.arange(32 * k) / k for k in (1, 5))
    assert np.abs(interpolated(np.cos(0.7 + np.pi * coarse / 4), 5) - np.cos(0.7 + np.pi * fine / 4)).max() < 1e-14


def test_a_period_is_decimated_as_the_middle_of_many():
    y = interpolated(sines(64), 20)
    tiled = decimated(np.tile(y, 5), (2, 2, 5))
    assert np.abs(decimated(y, (2, 2, 5), periodic=True) - tiled[128:192]).max() < 1e-13


def test_decimation_is_the_filter_at_every_rth_sample():
    """Against the convolution written out, at lengths that do and do not divide."""
    from scipy.signal import firwin

    for n in (100, 101, 103):
        y = np.random.default_rng(n).standard_normal(n)
        around = np.concatenate([2 * y[0] - y[15:0:-1], y, 2 * y[-1] - y[-2:-17:-1]])
        plain = np.convolve(around, firwin(31, 0.25), mode="valid")[::4]
        assert np.abs(decimated(y, (4,)) - plain).max() < 1e-14


test_a_structure_that_does_not_fit_is_refused = refused(
    ({"method": "euler"}, "method must be one of split"),
    ({"hold": "cubic"}, "hold must be one of"),
    ({"excitation": "ground"}, "excitation must be one of"),
    ({"initial": "free"}, "initial must be one of rest, periodic"),
    ({"oversampling": 0}, "must be at least 1, got 0"),
    ({"oversampling": 2.5}, TypeError, "must be a whole number, got 2.5"),
    ({"oversampling": 20, "decimation": (2, 5)}, "must multiply to the oversampling 20"),
    ({"initial": "periodic"}, "takes a period in samples"),
    ({"period": 100}, "takes a period in samples"),
    ({"hold": "band-limited", "period": 8}, "takes a period in samples"),
    call=lambda given: structure(**given),
)


U, T = sines(96), STEP * np.arange(96)


test_a_record_that_cannot_be_identified_is_refused = refused(
    (hs.Record(u=U, y=U), {}, "the record has no time"),
    (hs.Record(u=np.ones(96), y=U, t=T), {}, "the input is constant"),
    (hs.Record(u=U, y=np.ones(96), t=T), {}, "the output is constant"),
    (hs.Record(u=U[:20], y=U[:20], t=T[:20]), {}, "more than 30 samples, got 20"),
    (hs.Record(u=U, y=U, t=T), {"initial": "periodic", "period": 100}, "less than a period of 100"),
    (hs.Record(u=U, y=U, t=T), {"initial": "periodic", "period": 40}, "does not repeat itself every 40 samples"),
    call=lambda rec, given: hs.identify(structure(**given), rec),
)


def test_a_force_taken_for_an_acceleration_is_refused():
    with pytest.raises(ValueError, match=r"not that of a mass on springs: .*check the sign of u and y"):
        hs.identify(structure(excitation="base"), from_rest())


@needs_compiled
def test_a_band_limited_record_from_rest_is_not_linear_between_its_samples():
    rng, n, fine = np.random.default_rng(0), 400, 20
    t = STEP / fine * np.arange(n * fine)
    force = sum(np.sin(2.0 * np.pi * f * t + phase) for f, phase in rng.uniform([5, 0], [150, 6], (60, 2)))
    begin = np.minimum(t / 0.05, 1.0)
    force *= 40.0 / force.std() * begin**2 * (3.0 - 2.0 * begin)
    rec = record(force[::fine], plant(substeps=1).response(force, STEP / fine)[::fine])
    linear, limited = (
        worst(hs.identify(structure(hold=hold, oversampling=20), rec, fixed={"n": 1.0}))
        for hold in ("foh", "band-limited")
    )
    assert limited < 1e-4
    assert linear > 50.0 * limited


def test_a_record_is_continued_beyond_its_ends_before_it_is_interpolated():
    t = np.arange(240) / 24.0
    fine = np.sin(t) + 0.3 * np.cos(2.3 * t + 1.0)
    assert interpolated_record(fine[::6], 6) == pytest.approx(fine[: 39 * 6 + 1], abs=1e-3)
    assert np.array_equal(interpolated_record(fine, 1), fine)
    assert np.isfinite(interpolated_record(np.zeros(5), 3)).all()


def test_an_outlier_of_one_period_is_not_in_the_mean_period():
    u, spike = np.tile([1.0, 3.0, 2.0, -1.0], 24), 1e3 * (np.arange(96) == 41)
    assert structure(initial="periodic", period=4).motion(record(u, u + spike)).y == pytest.approx(u[:4], abs=0.2)


def test_the_structure_knows_how_the_record_begins_and_what_does_not_begin_so_is_said():
    assert_refused("the structure says how the record begins", hs.identify, structure(), from_rest(), initial="free")
    assert structure().notes(from_rest(), plant(substeps=4)) == ()
    assert any("does not begin at rest" in note for note in structure().notes(from_rest()[30:], plant()))


@pytest.mark.parametrize(("u", "tolerance", "message"), [([], 1e-9, "one period"), ([1.0], 0.0, "tolerance must be")])
def test_a_period_that_is_none_is_refused(u, tolerance, message):
    assert_refused(message, plant().periodic_response, u, STEP, tolerance=tolerance)


@pytest.mark.parametrize(("mass", "damping", "sample_time"), [(1e-3, 2.0, 0.01), (1.0, 100.0, 0.02)])
def test_a_plant_of_more_than_critical_damping_is_found_with_stable_steps(mass, damping, sample_time):
    """Four steps of order 6 a sample would be unstable for the first, and the second has eight times the critical."""
    truth = hs.BoucWenOscillator(
        mass=mass, damping=damping, stiffness=20.0, law=hs.BoucWen(A=20.0, beta=5.0, gamma=2.0)
    )
    t = sample_time * np.arange(250)
    u = 20.0 * (np.sin(0.07 * np.arange(250)) + 0.6 * np.sin(0.17 * np.arange(250) + 1.0))
    clean = truth.response(u, sample_time)
    y = clean + 0.01 * clean.std() * np.random.default_rng(0).standard_normal(250)
    fit = hs.identify(hs.BoucWenOscillator.structure(), hs.Record(u=u, y=y, t=t), fixed={"n": 1.0})
    assert fit.rmse < 1.05 * np.sqrt(np.mean((y - clean) ** 2))
    assert abs(fit.estimates["damping"] - damping) < 4.0 * fit.stderr["damping"] < 0.05 * damping
    finer = replace(fit.model, substeps=None).response(u, sample_time)
    assert np.abs(finer - fit.model.response(u, sample_time)).max() < 1e-6 * np.ptp(y)


def test_steps_that_are_too_coarse_are_said(monkeypatch):
    monkeypatch.setattr("hysim.plants.oscillator._LARGEST_ANGLE", 2.6)
    plant = hs.BoucWenOscillator(mass=1.0, damping=100.0, stiffness=20.0, law=hs.BoucWen(A=20.0), substeps=1)
    t = 0.025 * np.arange(250)
    record = hs.Record(u=np.sin(t), y=replace(plant, substeps=None).response(np.sin(t), 0.025), t=t)
    (note,) = hs.BoucWenOscillator.structure(oversampling=1).notes(record, plant)
    assert note.startswith("the steps are too coarse: with twice as many the output moves by")
    assert hs.BoucWenOscillator.structure(oversampling=8).notes(record, plant) == ()
