"""Models are values: finite numbers that go to JSON and come back to the bit; other files are refused in one line."""

import copy
import dataclasses
import json
import pickle
import subprocess
import sys

import numpy as np
import pytest
from strategies import assert_refused

import hysim as hs
from hysim.cli import main
from hysim.models.storage import from_json, to_json

NUMBERS = [
    (hs.BoucWen(A=1 / 3, beta=0.1, gamma=-np.pi, n=1.7), "beta"),
    (hs.PolynomialBoucWen(input_coefficients=(0.1, 1e-17, 3e300)), "input_coefficients"),
    (hs.ZhuWangBoucWen(A=1.1, n=1.3, gain=-0.5, delta=0.4, z0=0.1, input_coefficients=(1.5, 0.1)), "delta"),
    (hs.GeneralizedBoucWen(n=1.3, b2=0.2, b3=-0.15, b4=0.1, b5=0.05, b6=-0.1), "b4"),
    (hs.Duhem.from_terms({"u'": 0.1, "|u'| u y": -2 / 3}, y0=0.7), "q"),
    (hs.Duhem(p=[[1.0]], q=[[0.0]], p_abs=[[0.5]], q_abs=[[0.0, -1.0]]), "q_abs"),
    (
        hs.Duhem.from_terms({"u'": 0.1, "u' u |z|": 1 / 3, "|u'| |z| z^2": -2 / 3}, feedthrough=0.3, y0=0.7),
        "feedthrough",
    ),
    (hs.PrandtlIshlinskii(thresholds=(0.0, 1 / 3), weights=(0.1, -1e-17), offset=0.7), "weights"),
    (hs.ModifiedPrandtlIshlinskii(dead_zones=(-1 / 3, 0.0), dead_zone_weights=(0.1, 1.0)), "dead_zone_weights"),
    (
        hs.GeneralizedPrandtlIshlinskii(
            thresholds=(0.0, 1 / 3), weights=(0.1, 0.2), left=(1 / 3, 0.1, -0.7, 1e-17, 0.3)
        ),
        "left",
    ),
    (hs.RateDependentPrandtlIshlinskii(thresholds=(0.0, 1 / 3), weights=(0.1, 0.2), beta=1e-17), "beta"),
    (hs.ParametricPrandtlIshlinskii(exponent=1 / 3, weight=1e-17, reach=0.1, z0=(0.1, 1 / 3, -0.7)), "exponent"),
    (hs.ParametricPrandtlIshlinskii(weight=1.0, reach=2.0), "reach"),
    (hs.Tellinen(saturation=1 / 3, squareness=0.1, z0=-1.0), "squareness"),
    (hs.TellinenTable(inputs=(0.0, 1 / 3), lower=(0.0, 0.7), upper=(1e-17, 0.7)), "upper"),
    (hs.Chan(coercivity=1 / 3, gap=1e-17), "gap"),
    (hs.EnergyPlays(thresholds=(0.0, 1 / 3), weights=(0.1, 0.2), field=1e-17), "weights"),
    (hs.ExcessLoss(c=1 / 3), "c"),
    (hs.CoreField(size=1 / 3, weights=(0.1, 1e-17, 0.0, 0.0, 0.0, 0.7)), "weights"),
    (hs.Dashpot(c=0.7), "c"),
    (hs.LuGre(sigma1=0.7), "sigma1"),
    (hs.StribeckFriction(viscous=0.7), "viscous"),
    (hs.GeneralizedMaxwellSlip(stiffness=(1.0, 2.0), weights=(0.5, 0.5)), "weights"),
    (hs.ElasticBacklash(half_gap=0.7), "half_gap"),
    (hs.Preisach(levels=(0.0, 1 / 3, 1.0), weights=(0.1, 1e-17, 0.3), offset=0.7, z0=(0.5, 0.2)), "weights"),
    (hs.PreisachRelays(levels=(0.0, 1 / 3), weights=(0.1,)), "levels"),
    (hs.Play(threshold=1 / 3, z0=0.1), "threshold"),
    (hs.Stop(threshold=1e300), "threshold"),
    (hs.MaxwellSlip(stiffness=(1 / 3, 0.1), slips=(0.3, 0.2), z0=(0.1, 0.2)), "stiffness"),
    (hs.Dahl(stiffness=1 / 3, coulomb=0.1), "coulomb"),
    (hs.ColemanHodgdon(alpha=1 / 3, c=0.1, B=0.7), "B"),
    (hs.VaianaRosati(alpha=1 / 3, beta_2=(0.1, 1e-17)), "beta_2"),
    (hs.MenegottoPinto(cR2=1 / 3, a1=1e-17), "cR2"),
    (hs.BoucWenBaberNoori(delta_nu=1 / 3, zeta_s=0.1, input_coefficients=(0.1, 1e-17)), "delta_nu"),
    (hs.JilesAtherton(k=1e3 / 3.0, anisotropy=0.1), "k"),
    (hs.TransferFunction(num=(1 / 3,), den=(1.0, 2.0), delay=0.1, sample="end"), "den"),
    (hs.BoucWenOscillator(mass=1 / 3, damping=0.1, stiffness=1e-17, law=hs.BoucWen(n=1.7), substeps=3), "stiffness"),
    (hs.Amplifier(slew_rate=2.0), "slew_rate"),
    (hs.Creep(time_constants=(1.0, 2.0), weights=(0.1, 0.2)), "weights"),
    (hs.StateSpace(A=[[-1.0]], B=[1.0], C=[2.0]), "A"),
    (hs.Modes(natural_frequencies=(1.0, 2.0), damping_ratios=(0.1, 0.2), gains=(1.0, 0.5)), "gains"),
    (hs.Sensor(quantum=0.1), "quantum"),
    (hs.Line(offset=0.1, slope=1e-300), "slope"),
    (hs.SingleValued(u=[0.0, 0.1], y=[1 / 3, 2.0]), "y"),
    (hs.PID(kp=1 / 3, ki=0.1, limits=(0.0, 125.0)), "kp"),
    (hs.PID(kd=-0.0, tracking_time=0.1), "tracking_time"),
]
"""Models of every kind, each with a parameter whose last number is replaced by others."""
MODELS = [
    *(model for model, _ in NUMBERS),
    hs.PrandtlIshlinskii(),
    hs.PreisachRelays(levels=(0.0, 1 / 3), weights=(0.1,), offset=0.3, z0=(0.5,)),
    hs.Duhem.from_terms({"u'": 1.0, "|u'| z": -0.6, "u' |z|": -0.3}, feedthrough=2.0, offset=7.0, y0=7.25),
    (hs.BoucWen(beta=0.1 + 0.2) >> hs.mode(5.0, 0.1, delay=0.07)) + hs.Dashpot(c=1 / 3) + hs.Play(threshold=0.5),
    hs.PID.standard(0.1, 0.7, limits=(0.0, 1 / 3), tracking_time=0.1),
    hs.Actuator(),
    hs.Actuator(vibration=hs.mode(1 / 3, 0.1)),
    hs.ParametricPrandtlIshlinskii(),
    hs.Actuator(hysteresis=hs.BoucWen(n=1.7), vibration=hs.TransferFunction(num=(1.0,), den=(1.0, 0.1, 3.0))),
    hs.Actuator(
        amplifier=hs.Amplifier(gain=15.0, limits=(0.0, 150.0), slew_rate=2e5, time_constant=1e-5),
        hysteresis=hs.BoucWen(n=1.7),
        creep=hs.Creep.per_decade(1.5),
        vibration=hs.Modes(natural_frequencies=(3e3, 8e3), damping_ratios=(0.01, 0.02), gains=(0.9, 0.1)),
        sensor=hs.Sensor(quantum=0.0763, noise=1e-3, delay=5e-5, seed=3),
    ),
    hs.Actuator(vibration=hs.StateSpace(A=[[-1.0, 2.0], [0.0, -3.0]], B=[0.0, 1.0], C=[1.0, 0.5], D=0.1, delay=0.2)),
]


def family(model) -> str:
    return type(model).__name__


def arguments_of(model):
    return {field.name: getattr(model, field.name) for field in dataclasses.fields(model)}


def changed(model, name, value):
    return type(model)(**arguments_of(model) | {name: value})


@pytest.mark.parametrize("model", MODELS, ids=family)
def test_a_model_comes_back_to_the_bit(model, tmp_path):
    path = tmp_path / "model.json"
    hs.save(model, path, units={"u": "V", "y": "um"})
    assert hs.load_model(path) == model
    document = json.loads(path.read_text())
    assert document["family"] == family(model)
    assert document["units"] == {"u": "V", "y": "um"}
    assert document["hysim"] == hs.__version__
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.json"]


@pytest.mark.parametrize("model", MODELS, ids=family)
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_model_is_a_value(model, copied):
    twin = copied(model)
    assert twin == model
    assert hash(twin) == hash(model)
    assert twin is not model
    for field in dataclasses.fields(twin):
        value = getattr(twin, field.name)
        assert not isinstance(value, np.ndarray) or not value.flags.writeable
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(twin, field.name, value)


@pytest.mark.parametrize("model", MODELS, ids=family)
def test_a_typo_in_a_parameter_is_an_error(model):
    assert_refused("gian", changed, model, "gian", 1.0, error=TypeError)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(("model", "name"), NUMBERS)
def test_a_number_that_is_not_finite_is_refused_by_name(model, name, bad):
    values = np.array(getattr(model, name), dtype=float)
    values.flat[-1] = bad
    assert_refused(f"{name} must be finite", changed, model, name, values)


@pytest.mark.parametrize("wrong", ["one", 1j, {}])
@pytest.mark.parametrize(("model", "name"), NUMBERS)
def test_what_is_no_number_is_refused_by_name(model, name, wrong):
    assert_refused(f"{name} must be", changed, model, name, wrong, error=TypeError)


@pytest.mark.parametrize(("model", "name"), NUMBERS)
def test_parameters_go_by_name(model, name):
    assert_refused("positional", type(model), *arguments_of(model).values(), error=TypeError)


@pytest.mark.parametrize(("model", "name"), NUMBERS)
def test_equality_and_hash_see_every_number(model, name):
    twin = type(model)(**arguments_of(model))
    assert model == twin
    assert {model: 1}[twin] == 1
    values = np.array(getattr(model, name), dtype=float)
    values.flat[-1] *= 1 + 2**-52
    assert model != changed(model, name, values)


def test_families_with_the_same_numbers_differ():
    assert hs.Line() != hs.SingleValued(u=[0.0], y=[0.0])
    assert hs.Line() != dataclasses.asdict(hs.Line())
    assert hs.Actuator() != hs.Actuator(hysteresis=hs.Line())
    assert hs.Preisach(levels=(0.0, 1.0), weights=(1.0,)) != hs.PreisachRelays(levels=(0.0, 1.0), weights=(1.0,))


def test_numbers_may_be_integers_in_lists():
    law = hs.PolynomialBoucWen(input_coefficients=[1, 2])
    assert hash(law) == hash(hs.PolynomialBoucWen(input_coefficients=(1.0, 2.0)))
    assert hash(hs.Duhem(p=[[1]], q=[[0]])) == hash(hs.Duhem(p=[[1.0]], q=[[0.0]]))


def test_an_array_of_the_caller_stays_the_callers():
    y = np.array([0.0, 2.0])
    curve = hs.SingleValued(u=[0.0, 1.0], y=y)
    y[1] = 5.0
    assert curve.y.tolist() == [0.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        curve.y[0] = 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "does not hold a model"),
        ("[1, 2]", "does not hold a model"),
        ("{}", "does not hold a model"),
        (
            '{"family": "Ising", "parameters": {}}',
            "family 'Ising'; there are Actuator, AdaptiveInverse, Amplifier, Bilinear, BoucWen, ",
        ),
        ('{"family": "BoucWen", "parameters": {"bta": 1}}', "bta"),
        ('{"family": "BoucWen", "parameters": {"beta": NaN}}', "beta must be finite"),
        ('{"family": "BoucWen", "parameters": {"beta": "much"}}', "beta must be a number"),
        ("5", 'expected a mapping with "family" and "parameters", got 5'),
        ("[" * 5000 + "]" * 5000, "nested more than 100 deep"),
        (
            '{"family": "Line", "parameters": {"slope": ' + "9" * 5000 + "}}",
            "an integer of 5000 digits is no parameter",
        ),
        ('{"family": "Line"}', "'parameters' missing"),
        ('{"family": "Line", "parameters": 3}', "parameters must be a mapping, got 3"),
        ('{"family": "Line", "parameters": []}', r"parameters must be a mapping, got \[\]"),
        ('{"family": "BoucWen", "parameters": {"n": [1]}}', r"n must be a number, got \[1\]"),
        ('{"family": "Line", "parameters": {}, "units": null}', "units must be a mapping of names to labels, got None"),
        ('{"family": "Line", "parameters": {}, "units": {"u": 1}}', "units must be a mapping of names to labels"),
        ('{"family": "Line", "parameters": {"slope": 1}}', "offset missing"),
        ('{"family": ["Line"], "parameters": {}}', r"the family must be a name, got \['Line'\]"),
    ],
)
def test_a_file_without_a_model_is_named(tmp_path, text, message):
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        hs.load_model(path)
    assert "bad.json" in str(caught.value)
    assert "Error" not in str(caught.value)


def test_what_is_no_model_is_not_saved(tmp_path):
    assert_refused("takes a model", hs.save, {"beta": 1.0}, tmp_path / "model.json", error=TypeError)
    assert not list(tmp_path.iterdir())


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "model.json"
    hs.save(MODELS[0], path)
    assert_refused("JSON", hs.save, hs.Line(), path, units={"u": float("nan")})
    assert hs.load_model(path) == MODELS[0]


def test_a_file_that_is_not_text_is_named(tmp_path):
    path = tmp_path / "bad.json"
    path.write_bytes(b"\xff\xfe")
    assert_refused(r"bad\.json does not hold a model", hs.load_model, path)


def test_nothing_is_left_beside_a_file_that_cannot_be_replaced(tmp_path):
    (tmp_path / "folder").mkdir()
    assert_refused("folder", hs.save, hs.Line(), tmp_path / "folder", error=OSError)
    assert [entry.name for entry in tmp_path.iterdir()] == ["folder"]


def test_a_family_that_nobody_imported_is_found(tmp_path):
    path = tmp_path / "model.json"
    hs.save(hs.Duhem.from_terms({"u'": 0.1}), path)
    code = f"import hysim as hs; print(type(hs.load_model({str(path)!r})).__name__)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "Duhem\n"


# ------------------------------------------------------------------------- whatever stands at whichever place of a file


def nested(depth):
    value = []
    for _ in range(depth):
        value = [value]
    return value


def places(value, above=()):
    """Where something stands in a document, from the outside in."""
    yield above
    members = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, member in members:
        yield from places(member, (*above, key))


def replaced(document, place, value):
    if not place:
        return value
    changed = copy.deepcopy(document)
    inside = changed
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] = value
    return changed


HOSTILE = {"400 digits": 10**400, "in a list": [10**400, 1.0], "900 lists": nested(900), "null": None, "empty": {}}
BY_FAMILY = {type(model).__name__: model for model in MODELS}


def said_of(text):
    """The message with which a text is refused, or None for a model; another error passes through."""
    try:
        from_json(text, "x.json")
    except ValueError as error:
        return str(error)
    return None


@pytest.mark.parametrize("family", BY_FAMILY)
def test_a_hostile_value_at_any_place_is_one_line(family):
    document = json.loads(to_json(BY_FAMILY[family]))
    refused = 0
    for place in places(document):
        for value in HOSTILE.values():
            said = said_of(json.dumps(replaced(document, place, value)))
            if said is not None:
                refused += 1
                assert said.startswith("x.json "), (place, value)
                assert "\n" not in said, (place, value)
                assert len(said) <= 1200, (place, value)
    assert refused > 3 * len(document["parameters"])  # null may stand for a default


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"family": "Line", "parameters": {"slope": 1' + 400 * "0" + ', "offset": 0}}', "got a number beyond"),
        ('{"family": "Line", "parameters": {"slope": 1' + 5000 * "0" + ', "offset": 0}}', "does not hold a model"),
        ('{"family": "Line", "parameters": {"slope": 1e400, "offset": 0}}', "slope must be finite, got inf"),
        ('{"family": "Line", "parameters": {"slope": 1, "slope": 2, "offset": 0}}', "'slope' is there twice"),
        ('{"family": "Line", "family": "PID", "parameters": {}}', "'family' is there twice"),
        ('{"family": "Line", "parameters": {"slope": ' + 900 * "[" + 900 * "]" + "}}", "nested more than 100 deep"),
        ('{"family": "Line", "parameters": {"slope": ' + 10**5 * "[" + 10**5 * "]" + "}}", "does not hold a model"),
        (10**5 * '{"a":', "does not hold a model"),
        ('{"family": null, "parameters": {}}', "the family must be a name, got None"),
        ("\ufeff{}", "does not hold a model"),
    ],
)  # fmt: skip
def test_a_file_that_is_damaged_is_one_line_in_python_and_on_the_command_line(tmp_path, capsys, text, words):
    path = tmp_path / "bad.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=words) as caught:
        hs.load_model(path)
    assert str(path) in str(caught.value)
    (tmp_path / "loop.csv").write_text("u,y\n0,0\n1,1\n")
    assert main(["simulate", str(path), str(tmp_path / "loop.csv")]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)


def test_the_recursion_limit_of_who_calls_makes_no_difference(tmp_path):
    deep = hs.Line()
    for _ in range(20):
        deep = hs.Cascade(stages=(deep, hs.Line()))
    hs.save(deep, tmp_path / "deep.json")
    assert hs.load_model(tmp_path / "deep.json") == deep
    for _ in range(20):
        deep = hs.Cascade(stages=(deep, hs.Line()))
    assert_refused("nested more than 100 deep", hs.save, deep, tmp_path / "deeper.json")
    assert not (tmp_path / "deeper.json").exists()


@pytest.mark.parametrize("make", [lambda n: hs.BoucWen(A=n), lambda n: hs.Preisach(levels=(0, n), weights=(1,))])
def test_a_number_beyond_the_largest_float_is_not_finite(make):
    assert_refused(r"must be finite, got a number beyond 1\.8e\+308", make, 10**400)
    assert sys.float_info.max < 10**400
