"""A whole actuator is identified: law, creep, modes and delay at once, and what records cannot tell apart is held."""

import dataclasses

import numpy as np
import pytest

import hysim as hs
from hysim.cli import main

CREEP = "creep.percent"
FREQUENCY, DAMPING, GAIN = (f"vibration.{name}[{{}}]" for name in ("natural_frequencies", "damping_ratios", "gains"))
DELAY = "vibration.delay"
STAGE = hs.Actuator(
    hysteresis=hs.Play(threshold=0.2), creep=hs.Creep.per_decade(2.0), vibration=hs.mode(600.0, 0.03, delay=0.7e-3)
)
TRUTH = {"hysteresis.threshold": 0.2, "hysteresis.gain": 1.0, CREEP: 2.0, FREQUENCY.format(0): 600.0,
         DAMPING.format(0): 0.03, DELAY: 0.7e-3}  # fmt: skip
SLOW, FAST = (
    (hs.signals.triangle(0.0, 1.0, cycles=2, samples_per_cycle=30), 0.1),
    (np.repeat([0.0, 1.0, 0.2, 0.8], 50), 1e-3),
)


def record(stage, command, noise=1e-3, seed=0):
    u, step = command
    y = stage.response(u, step) + noise * np.random.default_rng(seed).standard_normal(u.size)
    return hs.Record(u=u, y=y, t=step * np.arange(u.size))


def records(stage=STAGE, noise=1e-3):
    return [record(stage, command, noise, seed) for seed, command in enumerate((SLOW, FAST))]


@pytest.fixture(scope="module")
def fit():
    return hs.identify(hs.Actuator.structure(hs.Play), records())


# ---------------------------------------------------------------------------------- what is found


def test_every_part_is_found_within_its_standard_errors(fit):
    for name, value in TRUTH.items():
        assert abs(fit.estimates[name] - value) < 4.0 * fit.stderr[name], name
        assert fit.stderr[name] < 0.05 * value, name
    assert fit.success
    assert fit.message == "converged"


def test_the_model_is_an_actuator_whose_response_is_the_fit(fit):
    cuts = [len(rec) for rec in records()][:1]
    percent = fit.estimates[CREEP]
    np.testing.assert_allclose(fit.model.creep.weights, hs.Creep.per_decade(percent).weights, rtol=1e-12)
    assert fit.model.creep.step_response(0.1) == pytest.approx(1.0, rel=1e-12)
    for model, rec, residual in zip(fit.models, records(), np.split(fit.residual, cuts), strict=True):
        assert isinstance(model, hs.Actuator)
        np.testing.assert_allclose(model.response(rec.u, rec.sample_time), rec.y - residual, atol=1e-13)


def test_one_fast_record_is_enough_where_the_law_alone_explains_little_of_it():
    step, n = 5e-4, 160
    t = step * np.arange(n)
    u = 0.5 - np.exp(-t / 0.1) / np.pi * np.arcsin(np.cos(2.0 * np.pi * 40.0 * t))
    law = hs.Dahl(stiffness=12.0, coulomb=0.5)
    stage = hs.Actuator(hysteresis=law, vibration=hs.mode(700.0, 0.02, delay=0.3e-3))
    rec = record(stage, (u, step))
    fit = hs.identify(hs.Actuator.structure(hs.Dahl, creep=False), rec, initial="rest")
    assert np.std(fit.residual) < 1.1e-3
    assert fit.estimates[FREQUENCY.format(0)] == pytest.approx(700.0, rel=1e-3)
    assert fit.estimates["hysteresis.coulomb"] == pytest.approx(0.5, rel=0.02)


def test_a_delay_is_found_by_fractions_of_a_sample():
    for delay in (0.35e-3, 2.6e-3):
        stage = hs.Actuator(hysteresis=hs.Line(slope=2.0), vibration=hs.mode(600.0, 0.03, delay=delay))
        structure = hs.Actuator.structure(hs.Line, creep=False)
        bounds = {FREQUENCY.format(0): (300.0, 1200.0)}
        found = hs.identify(structure, record(stage, FAST, noise=1e-4), bounds=bounds)
        assert found.estimates[DELAY] == pytest.approx(delay, abs=1e-6)


def test_two_modes_and_offsets_of_each_record_are_found():
    vibration = hs.Modes(natural_frequencies=(500.0, 1400.0), damping_ratios=(0.05, 0.04), gains=(0.7, 0.3))
    slow, fast = records(hs.Actuator(hysteresis=hs.Line(slope=2.0), vibration=vibration), noise=1e-4)
    structure = hs.Actuator.structure(hs.Line, creep=False, modes=2, delay=False, offsets="own")
    bounds = {FREQUENCY.format(0): (300.0, 900.0), FREQUENCY.format(1): (900.0, 3000.0)}
    fit = hs.identify(structure, [slow, dataclasses.replace(fast, y=fast.y + 3.0)], bounds=bounds)
    assert fit.model.vibration.dc_gain == pytest.approx(1.0, rel=1e-12)
    found = fit.estimates
    assert found[FREQUENCY.format(0)] == pytest.approx(500.0, rel=1e-3)
    assert found[FREQUENCY.format(1)] == pytest.approx(1400.0, rel=1e-3)
    assert found[GAIN.format(1)] == pytest.approx(0.3, rel=1e-2)
    assert found["hysteresis.offset[1]"] - found["hysteresis.offset[0]"] == pytest.approx(3.0, abs=1e-3)


# ---------------------------------------------------------------------------------- what is computed

STRUCTURES = {
    "mode, creep, delay": (hs.BoucWen, {}),
    "two modes, elements, time constant": (hs.BoucWen, {"modes": 2, "creep": (2e-3, 0.5), "amplifier": "first-order"}),
    "sloped creep, known amplifier": (hs.PrandtlIshlinskii.structure(plays=3),
                                      {"creep": 3, "amplifier": hs.Amplifier(gain=0.5, time_constant=2e-3)}),
    "static amplifier, known creep": (hs.Play, {"creep": hs.Creep(time_constants=(1.0,), weights=(0.1,)),
                                                "amplifier": hs.Amplifier(gain=2.0, offset=0.1, limits=(0.0, 1.5))}),
    "three modes alone": (hs.Line, {"creep": False, "modes": 3, "delay": False}),
    "delay alone": (hs.Play, {"creep": False, "modes": 0}),
    "law alone": (hs.Play, {"creep": False, "modes": 0, "delay": False}),
}  # fmt: skip


@pytest.mark.parametrize(("law", "options"), STRUCTURES.values(), ids=STRUCTURES)
def test_columns_are_the_responses_of_the_actuators_that_they_stand_for(law, options):
    """From random places of the box, which holds undamped modes, elements of the sample time, and delays."""
    rng = np.random.default_rng(5)
    u = np.cumsum(rng.standard_normal(60))
    rec = hs.Record(u=u, y=u, t=1e-3 * np.arange(u.size))
    structure, _ = hs.Actuator.structure(law, **options).over([rec], hs.models.search_space.ALL_FREE)
    space = structure.search_space(rec)
    x = rng.uniform(space.lower, space.upper, (6, space.lower.size))
    x = np.repeat(x, 2, axis=0)  # sets that share their work
    parameters = space.parameters(x)
    columns = structure.regressors(parameters, rec)
    linear = rng.standard_normal(len(space.columns))
    for k in range(0, len(columns), 3):
        row = columns[min(k, len(columns) - 1)]
        if not np.isfinite(row).all():
            continue
        values = {name: float(np.broadcast_to(value, len(x))[k]) for name, value in parameters.items()}
        values |= dict.fromkeys(space.held, 0.0) | dict(space.held)
        model = structure.assemble(values | dict(zip(space.columns, linear.tolist(), strict=True)))
        want = model.response(rec.u, rec.sample_time)
        np.testing.assert_allclose(row[:, :-1] @ linear + row[:, -1], want, rtol=0, atol=1e-9 * np.abs(want).max())


def test_a_sensor_reads_late_and_rounds():
    sensor = hs.Sensor(quantum=0.05, delay=1.5e-3)
    stage = dataclasses.replace(STAGE, creep=None, sensor=sensor)
    u, step = FAST
    rec = hs.Record(u=u, y=stage.measured(u, step), t=step * np.arange(u.size))
    structure = hs.Actuator.structure(hs.Play, creep=False, delay=False, sensor=sensor)
    fixed = {"hysteresis.z0": 0.0, "hysteresis.threshold": 0.2, "hysteresis.offset": 0.0}
    late = dataclasses.replace(stage, vibration=hs.mode(600.0, 0.03))
    rec = dataclasses.replace(rec, y=late.measured(u, step))
    found = hs.identify(structure, rec, fixed=fixed)
    assert found.noise == "quantised"
    assert found.resolution == 0.05
    assert found.estimates[FREQUENCY.format(0)] == pytest.approx(600.0, abs=5.0 * found.stderr[FREQUENCY.format(0)])
    assert found.model.sensor == sensor
    np.testing.assert_array_less(np.abs(found.residual), 0.1)


# ---------------------------------------------------------------------------------- what records do not tell


def test_a_slow_record_shows_neither_mode_nor_fractions_of_a_delay():
    found = hs.identify(hs.Actuator.structure(hs.Play), records()[0])
    assert "the records show no mode between" in found.message
    assert "held at 0.05 s, between 0 and 0.1 s all are alike" in found.message
    assert found.message in found.summary()
    assert DELAY not in found.free_names
    assert found.model.vibration == hs.TransferFunction(num=(1.0,), den=(1.0,), delay=0.05)
    assert abs(found.estimates[CREEP] - 2.0) < 4.0 * found.stderr[CREEP]


def test_noise_has_no_parts():
    noise = np.random.default_rng(0).standard_normal(FAST[0].size)
    rec = hs.Record(u=FAST[0], y=noise, t=FAST[1] * np.arange(noise.size))
    found = hs.identify(hs.Actuator.structure(hs.Line, delay=False), rec)
    assert "no mode between" in found.message
    assert "creep.percent is held at 0" in found.message


def test_what_the_user_names_is_never_left_out():
    rec = records()[0]
    fixed = {FREQUENCY.format(0): 20.0, DAMPING.format(0): 0.5, DELAY: 0.0, CREEP: 1.0}
    found = hs.identify(hs.Actuator.structure(hs.Line), rec, fixed=fixed)
    assert {name: found.estimates[name] for name in fixed} == fixed
    assert set(found.free_names) == {"hysteresis.slope", "hysteresis.offset"}


def test_elements_slower_than_the_records_are_held_at_zero():
    structure, _ = hs.Actuator.structure(hs.Line, creep=(1.0, 1e6)).over(records(), hs.models.search_space.Freedom())
    assert structure.known == {"creep.weights[1]": 0.0}
    assert structure.remarks == (
        "the records are too short or too coarse for creep at 1e+06 s: its weights are held at 0",
    )


def flat(rec):
    return dataclasses.replace(rec, u=np.ones(len(rec)))


REFUSED = {
    "has no time, which an actuator needs": (lambda: [hs.Record(u=rec.u, y=rec.y) for rec in records()], {}),
    "record 1 is not sampled evenly: use Record.resample": (
        lambda: [records()[0], dataclasses.replace(records()[1], t=np.arange(200.0) ** 1.1)], {}),
    "the input is constant": (lambda: flat(records()[0]), {}),
    "has 5 samples: an actuator needs at least 8": (lambda: records()[0][:5], {}),
    "is beyond half the highest sampling rate, 500 Hz": (records, {"bounds": {FREQUENCY.format(0): (1e3, 1e4)}}),
    "vibration.delay must not be negative": (records, {"fixed": {DELAY: -1.0}}),
    "fixed names 'hysteresis.mu'; the parameters are hysteresis.offset": (records, {"fixed": {"hysteresis.mu": 1.0}}),
    "begins at rest, not in a cycle": (records, {"initial": "periodic"}),
}  # fmt: skip


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_does_not_fit_is_refused_with_a_sentence(sentence):
    make, options = REFUSED[sentence]
    with pytest.raises(ValueError, match=sentence):
        hs.identify(hs.Actuator.structure(hs.Play if "cycle" in sentence else hs.Line), make(), **options)


WRONG = {
    "hysteresis is needed": {"hysteresis": None},
    "modes must be a number from 0 to 3": {"modes": 4},
    "creep must be at least one element": {"creep": 0},
    "positive and increase": {"creep": (1.0, 0.5)},
    "amplifier must be None": {"amplifier": "slow"},
    "offsets must be one of shared, own": {"offsets": "none"},
}


@pytest.mark.parametrize("sentence", WRONG)
def test_a_structure_that_is_none_is_refused(sentence):
    with pytest.raises(ValueError, match=sentence):
        hs.Actuator.structure(**{"hysteresis": hs.Line} | WRONG[sentence])


def test_parameters_that_depend_on_a_channel_are_refused():
    with pytest.raises(TypeError, match="depends is for laws and sums of them, got ActuatorStructure"):
        hs.identify(hs.Actuator.structure(hs.Line), records(), depends={"hysteresis.slope": ("T", 1)})


def test_a_search_that_ends_early_says_so():
    found = hs.identify(hs.Actuator.structure(hs.Line), records(), max_evaluations=200)
    assert not found.success
    assert found.message.startswith("partial: the search stopped at max_evaluations=200")


# ---------------------------------------------------------------------------------- from files


def test_files_of_two_rates_on_the_command_line(tmp_path, capsys):
    stage = hs.Actuator(hysteresis=hs.Line(slope=2.0), creep=hs.Creep.per_decade(3.0))
    paths = [tmp_path / f"{name}.csv" for name in ("slow", "fast")]
    for path, rec in zip(paths, records(stage, noise=1e-5), strict=True):
        hs.save_record(rec, path)
    out = tmp_path / "stage.json"
    files = map(str, paths)
    options = ["--model", "actuator", "--law", "line", "--modes", "0", "--creep", "--out", str(out)]
    assert main(["identify", *files, *options]) == 0
    assert "creep.percent = 3.00" in capsys.readouterr().out
    assert hs.load_model(out).hysteresis.slope == pytest.approx(2.0, rel=1e-3)
    assert main(["identify", str(paths[0]), "--model", "line", "--modes", "0"]) == 2
    assert "--modes is no option of the model line" in capsys.readouterr().err
