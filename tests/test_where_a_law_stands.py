"""A state is a point: an input and a memory. A law begins where its memory holds, in every use."""

import dataclasses
import warnings

import numpy as np
import pytest
from strategies import assert_refused, needs_compiler, printed_by_main

import hysim as hs
from hysim.errors import warn_beyond
from hysim.models.law import Law

RNG = np.random.default_rng(7)
PLAYS = {"thresholds": (0.0, 0.2, 0.5), "weights": (1.0, 0.5, 0.3)}
LAWS = {
    "BoucWen": hs.BoucWen(beta=0.6, gamma=0.2, n=1.0, feedthrough=1.5, gain=-0.5, z0=0.1),
    "BoucWen, any exponent": hs.BoucWen(beta=0.6, gamma=0.2, n=1.4, feedthrough=1.5, gain=-0.5),
    "PolynomialBoucWen": hs.PolynomialBoucWen(beta=0.6, gamma=0.2, input_coefficients=(2.0, 0.1)),
    "ZhuWangBoucWen": hs.ZhuWangBoucWen(beta=0.6, gamma=0.2, delta=0.05, input_coefficients=(2.0,)),
    "GeneralizedBoucWen": hs.GeneralizedBoucWen(input_coefficients=(2.0,)),
    "BoucWenBaberNoori": hs.BoucWenBaberNoori(input_coefficients=(2.0,)),
    "Duhem": hs.Duhem.from_terms({"u'": 1.0, "|u'| y": -0.4, "|u'| u": 0.2}),
    "Dahl": hs.Dahl(stiffness=2.0, coulomb=0.5),
    "ColemanHodgdon": hs.ColemanHodgdon(),
    "VaianaRosati": hs.VaianaRosati(k_b=(2.0, 1.5), f_0=0.3),
    "MenegottoPinto": hs.MenegottoPinto(yield_input=0.3, hardening=0.1),
    "Play": hs.Play(threshold=0.2),
    "Stop": hs.Stop(threshold=0.4),
    "MaxwellSlip": hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.3, 0.6), feedthrough=0.5),
    "PrandtlIshlinskii": hs.PrandtlIshlinskii(**PLAYS),
    "ModifiedPrandtlIshlinskii": hs.ModifiedPrandtlIshlinskii(**PLAYS),
    "GeneralizedPrandtlIshlinskii": hs.GeneralizedPrandtlIshlinskii(**PLAYS),
    "ParametricPrandtlIshlinskii": hs.ParametricPrandtlIshlinskii(reach=2.0, weight=0.5),
    "Preisach": hs.Preisach(
        levels=(-2.0, -1.0, 0.0, 1.0, 2.0), weights=(1.0, 0.3, 1.0, 0.2, 0.3, 1.0, 0.1, 0.2, 0.3, 1.0)
    ),
    "JilesAtherton": hs.JilesAtherton(Ms=1.0, a=0.3, alpha=0.1, k=0.4, gain=1.0, feedthrough=0.1),
    "Tellinen": hs.Tellinen(coercivity=0.4, squareness=0.7),
    "Chan": hs.Chan(),
    "ReversalFilter": hs.ReversalFilter(threshold=0.3),
    "Line": hs.Line(slope=2.0),
}  # fmt: skip
MORE_THAN_FIELDS = {
    "BoucWenBaberNoori",
    "MenegottoPinto",
    "ParametricPrandtlIshlinskii",
    "Chan",
    "JilesAtherton",
    "ReversalFilter",
}
WITHOUT_INVERSE = {"Play", "Stop", "MaxwellSlip", "ColemanHodgdon", "ReversalFilter"}
U = RNG.uniform(-1.0, 1.0, 40)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_law_first_moves_from_where_it_stands(law):
    placed = law.placed(0.7)
    expected = law.response(np.append(0.7, U))[1:]
    np.testing.assert_array_equal(placed.response(U), expected)
    whole, state = placed.advance(U)
    first, cut = placed.advance(U[:13])
    rest, end = placed.advance(U[13:], cut)
    np.testing.assert_array_equal(np.concatenate([first, rest]), whole)
    assert end == state
    np.testing.assert_allclose(type(law).responses({**law.arguments, "u0": 0.7}, U)[0], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(placed.outputs({}, U)[0], expected, rtol=0, atol=1e-12)
    law_step = placed.compiled(float(U[0]))
    y = [law_step.step(law_step.parameters, law_step.state, u) for u in U[1:].tolist()]
    np.testing.assert_allclose(y, expected[1:], rtol=0, atol=1e-12)
    assert placed.placed(None) == law
    assert placed != law


@pytest.mark.parametrize("law", [law for name, law in LAWS.items() if name not in WITHOUT_INVERSE],
                         ids=[name for name in LAWS if name not in WITHOUT_INVERSE])  # fmt: skip
def test_an_inverse_begins_where_the_law_stands(law):
    placed = law.placed(0.7)
    y = placed.response(U)
    np.testing.assert_allclose(placed.response(placed.inverse_response(y)), y, rtol=0, atol=1e-9)
    inverse = hs.InverseFeedforward(law=placed)
    assert inverse.u0 == 0.7
    state, commands = inverse.initial(1.0), []
    for wanted in y.tolist():
        command, state = inverse.step(state, wanted, 0.0)
        commands.append(command)
    np.testing.assert_allclose(placed.response(commands), y, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("name", "law"), LAWS.items(), ids=LAWS)
def test_a_law_after_a_history_goes_on(name, law):
    later = RNG.uniform(-1.0, 1.0, 20)
    if name in MORE_THAN_FIELDS:
        assert_refused(r"continue with advance\(u, state\)", law.after, U, error=TypeError)
        return
    after = law.after(U)
    assert after.u0 == U[-1]
    np.testing.assert_allclose(after.response(later), law.response(np.append(U, later))[U.size :], rtol=0, atol=1e-12)


def test_a_file_keeps_where_a_law_stands_and_an_old_one_has_no_such_place(tmp_path):
    law = hs.BoucWen(beta=0.6, u0=30.0, u_range=(0.0, 100.0))
    hs.save(law, tmp_path / "law.json")
    loaded = hs.load_model(tmp_path / "law.json")
    assert (loaded, loaded.u_range) == (law, law.u_range)
    plain = tmp_path / "plain.json"
    hs.save(law.placed(None), plain)
    assert "u0" not in plain.read_text()
    assert hs.load_model(plain).u0 is None


def test_parts_stand_where_their_inputs_are():
    law, filtered = LAWS["BoucWen"], hs.ReversalFilter(threshold=0.3)
    total = (law + hs.Line(slope=1.0)).placed(0.7, (-1.0, 1.0))
    assert [part.u0 for part in total.parts] == [0.7, 0.7]
    assert total.u_range == (-1.0, 1.0)
    behind = (hs.Line(slope=2.0) >> law).placed(0.7)
    assert [stage.u0 for stage in behind.stages] == [0.7, 1.4]
    np.testing.assert_array_equal(behind.response(U), (hs.Line(slope=2.0) >> law).response(np.append(0.7, U))[1:])
    assert (filtered >> law).placed(0.7, (-1.0, 1.0)).behind_filter == law.placed(0.7, (-1.0, 1.0))
    stage = hs.Actuator(amplifier=hs.Amplifier(gain=10.0), hysteresis=law).placed(0.07, (0.0, 1.0))
    assert (stage.hysteresis.u0, stage.u0, stage.u_range) == (pytest.approx(0.7), pytest.approx(0.07), (0.0, 10.0))


@needs_compiler
@pytest.mark.parametrize("name", ["BoucWen", "BoucWen, any exponent", "PrandtlIshlinskii", "Preisach"])
def test_c_and_python_begin_alike(name, tmp_path, shell):
    law = LAWS[name].placed(0.7)
    y = law.response(U)
    hs.save(law, tmp_path / "law.json")
    for thing, inputs, expected in ((law, U, y), (hs.InverseFeedforward(law=law), y, law.inverse_response(y))):
        code = hs.to_c(thing, name="stack")
        in_c = printed_by_main(code, tmp_path, inputs)
        np.testing.assert_allclose(in_c, expected, rtol=0, atol=1e-9)
        inverse = ["--inverse"] if thing is not law else []
        assert shell("c", tmp_path / "law.json", *inverse, "--out", tmp_path / "stack.c")[0] == 0
        assert (tmp_path / "stack.c").read_text() == code.source


def test_a_loop_begins_where_the_law_stands():
    law = LAWS["BoucWen"].placed(0.7)
    t = 0.01 * np.arange(50)
    run = hs.close_loop(law, hs.PID(ki=5.0), t, np.full(50, float(law.response([0.7])[0])))
    assert run.conditions["u0"] == 0.7
    np.testing.assert_allclose(run.command, 0.7, atol=1e-12)  # it stands still where it began
    assert hs.close_loop(law, hs.PID(ki=5.0), t, np.zeros(50), u0=0.0).conditions["u0"] == 0.0
    assert hs.control.RestingPlant(law, 0.01).u0 == 0.7


def test_an_input_beyond_the_identified_range_is_warned_of():
    law = hs.BoucWen(beta=0.6, feedthrough=1.5, u0=0.0, u_range=(-1.0, 1.0))
    inside, outside = law.response([0.5, -0.5]), law.response([0.5, -1.5])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        law.inverse_response(inside)
    words = r"goes from -1\.5 to 0\.5, but the BoucWen was identified from -1 to 1"
    with pytest.warns(hs.HysimWarning, match=words):
        law.inverse_response(outside)
    with pytest.warns(hs.HysimWarning, match="but the .* was identified from -1 to 1"):
        (hs.ReversalFilter(threshold=0.1) >> law).placed(0.0, (-1.0, 1.0)).inverse_response(outside)
    t = 0.01 * np.arange(20)
    with pytest.warns(hs.HysimWarning, match="was identified from -1 to 1") as told:
        hs.close_loop(law, hs.InverseFeedforward(law=law), t, np.linspace(0.0, float(outside.min()), 20))
    assert {each.filename for each in told} == {__file__}
    assert warn_beyond(None, np.array([9.0]), "BoucWen") is None


def test_a_command_at_its_limit_is_warned_of():
    t = 0.01 * np.arange(100)
    limited = hs.TrackingController(feedforward=hs.InverseFeedforward(), limits=(0.0, 0.5))
    turning = hs.BoucWen(feedthrough=-0.2)  # its slope is zero at ln 5, where its output is 0.48
    for law, controller, n in ((hs.Line(slope=1.0), limited, 49), (turning, hs.InverseFeedforward(law=turning), 52)):
        words = f"in {n} of 100 samples: the reference .* there, or the slope of an inverted law changes"
        with pytest.warns(hs.HysimWarning, match=words) as told:
            hs.close_loop(law, controller, t, t)
        assert [each.filename for each in told] == [__file__]


def test_an_identified_law_stands_at_the_first_input_of_its_record():
    u = hs.signals.triangle(20.0, 120.0, cycles=2, samples_per_cycle=80)[17:]
    rec = hs.Record(u=u, y=hs.BoucWen(beta=0.03, gamma=0.01, gain=-1.0, feedthrough=1.5).response(u))
    for family in (hs.BoucWen, hs.PrandtlIshlinskii, hs.Dahl):
        fit = hs.identify(family, rec, max_evaluations=50)
        assert (fit.model.u0, fit.model.u_range) == (u[0], (20.0, 120.0))
        again = hs.identify(fit.model, rec[40:], max_evaluations=50)  # its own place is that of the new record
        assert again.model.u0 == rec.u[40]


def test_every_family_of_laws_has_such_a_place():
    families = {type(law) for law in LAWS.values()}
    assert all(issubclass(each, Law) for each in families)
    for each in families:
        assert {"u0", "u_range"} <= {field.name for field in dataclasses.fields(each)}


def test_many_structures_begin_as_one_does():
    law = hs.BoucWen(beta=2.0, gamma=1.0, feedthrough=5.0, gain=30.0, u0=0.3)
    frame = hs.Structure(mass=1.0, elements=[hs.Element(law, between=(0, 1))], damping=0.5)
    t = 0.01 * np.arange(100)
    quake = 5.0 * np.sin(12.0 * t)
    one = hs.simulate(frame, t, quake).peaks["drift"]
    many = frame.responses({"elements.0.beta": np.array([2.0, 1.0])}, quake, sample_time=0.01)
    np.testing.assert_allclose(many[0], one, rtol=1e-12)
