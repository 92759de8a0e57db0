"""An actuator with several inputs is identified: a law for each, and modes that each excites by gains of its own."""

import dataclasses

import numpy as np
import pytest

import hysim as hs
from hysim.identification._identify import _behind

STEP, PERIOD, AHEAD = 1.0 / 1000.0, 160, 60
FREQUENCIES, DAMPINGS, DELAY = (2.0 * np.pi * 90.0, 2.0 * np.pi * 260.0), (0.04, 0.03), 0.6e-3
LAWS = {
    "u": hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(1.0, 0.4)),
    "right": hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(-0.6, -0.3)),
}
GAINS = {"u": (0.7, 0.3), "right": (1.3, -0.3)}
BOUNDS = {f"vibration.natural_frequencies[{k}]": (0.8 * w, 1.25 * w) for k, w in enumerate(FREQUENCIES)}


def branch(name):
    vibration = hs.Modes(natural_frequencies=FREQUENCIES, damping_ratios=DAMPINGS, gains=GAINS[name], delay=DELAY)
    return hs.Actuator(hysteresis=LAWS[name], vibration=vibration)


STAGE = hs.MultiInputActuator(inputs=tuple(LAWS), actuators=tuple(map(branch, LAWS)))


def record(seed, amplitude=1.0, noise=1e-3):
    """A period of noise that repeats itself, after its last part."""
    rng = np.random.default_rng(seed)
    u, right = amplitude * np.pad(rng.uniform(-1.0, 1.0, (2, PERIOD)), ((0, 0), (AHEAD, 0)), mode="wrap")
    channels = {"right": right}
    y = STAGE.response(u, STEP, channels=channels) + noise * rng.standard_normal(u.size)
    return hs.Record(u=u, y=y, t=STEP * np.arange(u.size), channels=channels, name=f"at {amplitude:g}")


RECORDS = [record(0), record(1, 0.4)]


def structure(law=hs.Line, **options):
    laws = dict.fromkeys(LAWS, law)
    return hs.Actuator.structure(laws, **{"modes": 2, "creep": False} | options)


def identified(law, **options):
    weights = [np.repeat([0.0, 1.0], [AHEAD, PERIOD])] * 2
    return hs.identify(structure(law, **options), RECORDS, weights=weights, initial="rest", bounds=BOUNDS)


PLAYS = hs.PrandtlIshlinskii.structure(thresholds=(0.0, 0.3))


@pytest.fixture(scope="module")
def lines():
    return identified(hs.Line)


@pytest.fixture(scope="module")
def fit(lines):
    return identified(PLAYS, start=lines.model)


def test_laws_modes_and_the_gains_of_each_input_are_found(fit):
    truth = {f"hysteresis.{name}.weights[{k}]": w for name, law in LAWS.items() for k, w in enumerate(law.weights)}
    for k, (frequency, damping) in enumerate(zip(FREQUENCIES, DAMPINGS, strict=True)):
        truth |= {f"vibration.natural_frequencies[{k}]": frequency, f"vibration.damping_ratios[{k}]": damping}
    truth |= {f"vibration.gains[1].{name}": gains[1] for name, gains in GAINS.items()} | {"vibration.delay": DELAY}
    assert fit.success
    for name, value in truth.items():
        assert abs(fit.estimates[name] - value) < 4.0 * fit.stderr[name], name
        assert fit.stderr[name] < 0.05 * abs(value), name


def test_laws_predict_what_lines_do_not(fit, lines):
    other = record(2, 0.7, noise=0.0)
    errors = {
        name: float(np.std((other.y - each.model.response_of(other))[AHEAD:]))
        for name, each in {"laws": fit, "lines": lines}.items()
    }
    assert errors["laws"] < 1e-3 < 0.1 * errors["lines"]  # the noise that was learnt from


def test_the_response_to_a_record_is_the_fit(fit):
    modelled = np.concatenate([each.response_of(rec) for each, rec in zip(fit.models, RECORDS, strict=True)])
    np.testing.assert_allclose(modelled, np.concatenate([rec.y for rec in RECORDS]) - fit.residual, atol=1e-12)


@pytest.mark.parametrize(
    ("law", "options"),
    [(hs.Play, {"creep": True}), (PLAYS, {"amplifier": hs.Amplifier(gain=0.5, offset=0.1)}), (hs.Play, {"modes": 0})],
    ids=["creep", "an amplifier", "delay alone"],
)
def test_columns_are_the_responses_of_the_actuators_that_they_stand_for(law, options):
    rng = np.random.default_rng(5)
    found, _ = structure(law, **options).over(RECORDS, hs.models.search_space.ALL_FREE)
    space = found.search_space(RECORDS[0])
    x = rng.uniform(space.lower, space.upper, (4, space.lower.size))
    parameters = space.parameters(x)
    columns, linear = found.regressors(parameters, RECORDS[0]), rng.standard_normal(len(space.columns))
    for k, row in enumerate(columns):
        values = {name: float(np.broadcast_to(value, len(x))[k]) for name, value in parameters.items()}
        values |= dict.fromkeys(space.held, 0.0) | dict(space.held)
        model = found.assemble(values | dict(zip(space.columns, linear.tolist(), strict=True)))
        want = model.response_of(RECORDS[0])
        np.testing.assert_allclose(row[:, :-1] @ linear + row[:, -1], want, rtol=0, atol=1e-9 * np.abs(want).max())


def test_the_model_is_stored_and_printed(fit, tmp_path):
    hs.save(fit.model, tmp_path / "stage.json")
    assert hs.load_model(tmp_path / "stage.json") == fit.model
    assert "inputs = ('u', 'right')" in str(fit.model)
    assert str(structure()) == "Actuator of Line + Line, 2 modes, delay"


def test_each_input_makes_its_own_part():
    rec = RECORDS[0]
    parts = STAGE.contributions(rec.u, STEP, channels=rec.channels)
    np.testing.assert_array_equal(parts["right"], branch("right").response(rec.channel("right"), STEP))
    np.testing.assert_array_equal(sum(parts.values()), STAGE.response_of(rec))


def without_channel(rec):
    return dataclasses.replace(rec, channels={"left": 1.0})


REFUSED = {
    "the record 'at 1' has no channel 'right'; it has 'left'": lambda: hs.identify(
        structure(), [without_channel(rec) for rec in RECORDS]
    ),
    "must have a law for the input \"u\" of the record, got laws for 'right'": lambda: hs.Actuator.structure(
        {"right": hs.Line}
    ),
    "modes must be a number from 0 to 20": lambda: structure(modes=21),
    "a sensor with a delay is for one input": lambda: structure(sensor=hs.Sensor(delay=1e-3)),
    "start has 2 modes after u, and modes=1": lambda: hs.identify(structure(modes=1, start=STAGE), RECORDS),
    "start has the inputs u; hysteresis those of u, right": lambda: hs.identify(structure(start=branch("u")), RECORDS),
    "fixed names 'hysteresis.slope'; the parameters are hysteresis.u": lambda: hs.identify(
        structure(), RECORDS, fixed={"hysteresis.slope": 1.0}
    ),
    "the input has no channel 'right'; it has none": lambda: STAGE.response([0.0, 1.0], STEP),
    "channel 'right' must be one number, or 2": lambda: STAGE.response([0.0, 1.0], STEP, channels={"right": [1.0]}),
    "each input needs an actuator, got 2 inputs and 1": lambda: hs.MultiInputActuator(
        inputs=("u", "v"), actuators=(hs.Line(),)
    ),
    "inputs must be different names, .u. among them, got v, v": lambda: hs.MultiInputActuator(
        inputs=("v", "v"), actuators=(hs.Line(), hs.Line())
    ),
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_does_not_fit_is_refused_with_a_sentence(sentence):
    with pytest.raises(ValueError, match=sentence.replace("[", r"\[")):
        REFUSED[sentence]()


@pytest.mark.parametrize("start", [hs.Line(), hs.MultiInputActuator(inputs=("u",), actuators=(hs.Line(),))])
def test_a_start_that_is_no_actuator_is_refused(start):
    with pytest.raises(TypeError, match="start must be an Actuator, or a MultiInputActuator of them, got"):
        structure(start=start)


def test_a_law_that_is_none_is_refused():
    with pytest.raises(TypeError, match=r"hysteresis\['right'\] must be a law that can be identified, got int"):
        hs.Actuator.structure({"u": hs.Line, "right": 3})


def test_a_filter_before_the_law_is_in_the_unit_after_its_amplifier():
    stage = hs.Actuator(amplifier=hs.Amplifier(gain=-15.0), hysteresis=hs.Play(threshold=1.0))
    both = hs.MultiInputActuator(inputs=("u", "load"), actuators=(stage, hs.Actuator(hysteresis=hs.Line())))
    for alone in (stage, both):
        model = _behind(hs.ReversalFilter(threshold=0.1), alone)
        law = (model.actuators[0] if alone is both else model).hysteresis
        assert law.stages == (hs.ReversalFilter(threshold=1.5), stage.hysteresis)
