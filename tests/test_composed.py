"""Sums and cascades are models like any other: they respond, continue, invert, are stored and identified."""

import inspect

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import (
    assert_cut_or_stepped_it_has_the_same_bits,
    assert_refused,
    bounded_laws,
    needs_compiled,
    refused,
    short_inputs,
)

import hysim as hs
from hysim.models.model import every_family

TIME = 0.05
PLANT = hs.TransferFunction(num=(2.0, 30.0), den=(1.0, 2.0, 30.0), delay=0.07)


@st.composite
def sums(draw) -> hs.Sum:
    """A Bouc-Wen law, a play and a line."""
    return draw(bounded_laws()) + hs.Play(threshold=draw(st.floats(0.0, 0.3)), gain=0.7) + hs.Line(slope=-0.4)


@given(sums(), short_inputs())
def test_a_sum_is_the_sum_to_the_bit(law, u):
    first, second, third = (part.response(u) for part in law.parts)
    assert law.response(u).tolist() == ((first + second) + third).tolist()


@given(sums(), short_inputs())
def test_a_cascade_is_the_composition_to_the_bit(law, u):
    whole = law >> hs.Play(threshold=0.1) >> PLANT
    inner = hs.Play(threshold=0.1).response(law.response(u))
    assert whole.response(u, TIME).tolist() == PLANT.response(inner, TIME).tolist()
    assert whole.stages == (law, hs.Play(threshold=0.1), PLANT)


@given(sums(), short_inputs(), st.integers(0, 90))
def test_cut_or_stepped_it_has_the_same_bits(law, u, cut):
    dynamic = (law >> PLANT) + hs.Dashpot(c=0.3)
    for model in (law, law >> hs.Play(threshold=0.1)):
        assert_cut_or_stepped_it_has_the_same_bits(model, u, cut)
    for model, time in ((law >> law, {}), (dynamic, {"sample_time": TIME})):
        head, state = model.advance(u[:cut], **time)
        tail, _ = model.advance(u[cut:], state, **time)
        assert np.concatenate([head, tail]).tolist() == model.response(u, **time).tolist()


@given(
    short_inputs(), st.integers(1, 29), st.sampled_from([0.0, 0.02, 0.05, 0.13, 9.0]), st.sampled_from(["zoh", "foh"])
)
def test_a_transfer_function_continues_to_the_bit(u, cut, delay, hold):
    plant = hs.TransferFunction(
        num=(0.5, 2.0, 30.0), den=(1.0, 2.0, 30.0), delay=delay, hold=hold, initial_state=(0.3, -1.0)
    )
    head, state = plant.advance(u[:cut], sample_time=TIME)
    tail, _ = plant.advance(u[cut:], state, sample_time=TIME)
    assert np.concatenate([head, tail]).tolist() == plant.response(u, TIME).tolist()


CONTINUED = sorted(
    {
        family
        for family in every_family().values()
        if "advance" in dir(family) and family.__module__.startswith(("hysim.laws.", "hysim.models.", "hysim.plants."))
    }
    | {hs.TransferFunction, hs.Actuator, hs.Structure, hs.BoucWenOscillator, hs.Sum, hs.Cascade},
    key=lambda family: family.__name__,
)


@pytest.mark.parametrize("family", CONTINUED)
def test_whatever_can_be_continued_is_called_in_one_way(family):
    """``advance(u, state=None, *, sample_time=None)``; a plant may take more by keyword."""
    _, *arguments = inspect.signature(family.advance).parameters.values()
    by_place = [(each.name, each.default) for each in arguments if each.kind is each.POSITIONAL_OR_KEYWORD]
    by_name = {each.name: each.default for each in arguments if each.kind is each.KEYWORD_ONLY}
    assert by_place == [("u", inspect.Parameter.empty), ("state", None)]
    assert by_name["sample_time"] is None
    assert set(by_name.values()) == {None}


@given(sums(), short_inputs(), st.integers(1, 5))
def test_a_sum_of_laws_does_not_know_the_rate(law, u, repeats):
    slow = law.response(np.repeat(u, repeats))
    assert slow[repeats - 1 :: repeats].tolist() == law.response(u).tolist()


@given(sums(), short_inputs())
def test_an_actuator_has_the_response_of_its_law(law, u):
    assert hs.Actuator(hysteresis=law).response(u).tolist() == law.response(u).tolist()


@st.composite
def rising_laws(draw) -> hs.Sum:
    """Laws of positive slope: a piezo's and a friction's beside a spring."""
    plays = hs.PrandtlIshlinskii(thresholds=(0.0, 0.1, 0.2), weights=(0.5, draw(st.floats(0.0, 1.0)), 0.3))
    friction = hs.Dahl(stiffness=draw(st.floats(0.1, 3.0)), coulomb=draw(st.floats(0.1, 2.0)))
    return plays + friction + hs.Line(offset=0.2, slope=draw(st.floats(0.5, 2.0)))


@settings(max_examples=min(15, settings.default.max_examples))
@given(rising_laws(), short_inputs())
def test_the_inverse_undoes_the_response(law, u):
    for model in (law, law >> hs.Line(slope=-2.0, offset=0.3)):
        y = model.response(u)
        back = model.inverse_response(y)
        assert back == pytest.approx(u, abs=1e-11)
        assert model.response(back) == pytest.approx(y, abs=1e-11)
        resting = model.inverse_response(y[1:], u0=float(u[0]))
        assert resting == pytest.approx(u[1:], abs=1e-11)


def test_a_way_that_is_shorter_than_rounding_is_gone_back_too():
    law = hs.PrandtlIshlinskii(thresholds=(0.0, 0.1), weights=(0.5, 0.3)) + hs.Dahl() + hs.Line(offset=0.2, slope=1.0)
    u = np.array([0.0, 1e-16, 0.3, -0.04, 0.0, 1e-16])
    assert law.inverse_response(law.response(u), u0=0.0) == pytest.approx(u, abs=1e-15)


def test_a_guess_that_is_short_by_rounding_is_not_doubled_away():
    law = hs.Dahl(stiffness=2.0, coulomb=0.5) + hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(1.0, 0.5))
    u = hs.signals.triangle(-12.0, 12.0, cycles=3, samples_per_cycle=80)
    assert law.inverse_response(law.response(u)) == pytest.approx(u, abs=1e-13)  # a few roundings of 12


CURVE = hs.SingleValued(u=[0.0, 1.0], y=[0.0, 2.0])
test_what_has_no_inverse_says_so = refused(
    (hs.BoucWen() + hs.Dashpot(), [0.0, 1.0, 0.5], {}, "moves in time"),
    (hs.Play(threshold=0.2) + hs.Line(), [0.0, 1.0, 0.5], {"u0": 0.0}, "does not rise or fall"),
    (hs.BoucWen() + hs.Dahl(), [0.5, 0.7], {}, "give u0"),
    (hs.Dahl(coulomb=0.5) + hs.Dahl(coulomb=0.4), [0.0, 0.5, 1.0], {"u0": 0.0}, hs.SimulationError, "at sample 2"),
    (hs.Line(slope=1.0) + CURVE, [0.0, 1.0, 0.5], {}, TypeError, "SingleValued cannot be stepped"),
    call=lambda law, y, options: law.inverse_response(y, **options),
)


def test_a_dashpot_is_the_slope_of_the_stretch_before():
    u = np.array([0.0, 1.0, 3.0, 3.0, 2.5])
    assert hs.Dashpot(c=2.0).response(u, 0.5).tolist() == [0.0, 4.0, 8.0, 0.0, -2.0]
    assert hs.Dashpot().response([], 0.5).tolist() == []
    assert_refused("sample_time must be positive", hs.Dashpot().response, u, 0.0)


def test_parts_keep_their_order_and_are_not_nested_by_the_operators():
    a, b, c = hs.Line(slope=1.0), hs.Play(threshold=0.1), hs.Dashpot(c=3.0)
    assert (a + (b + c)).parts == ((a + b) + c).parts == (a, b, c)
    assert ((a >> b) >> c).stages == (a >> (b >> c)).stages == (a, b, c)
    assert (a >> b) + c == hs.Sum(parts=[hs.Cascade(stages=[a, b]), c])
    assert len({(a + b), (a + b), (b + a)}) == 2


@pytest.mark.parametrize("wrong", [hs.BoucWen, hs.PID(kp=1.0), 3.0, hs.TransferFunction.structure(poles=1, zeros=0)])
def test_a_part_without_a_response_is_refused(wrong):
    assert_refused("a response, got", hs.Sum, error=TypeError, parts=(hs.BoucWen(), wrong))
    assert_refused("a response, got", hs.Cascade, error=TypeError, stages=(hs.BoucWen(), wrong))


test_clear_refusals = refused(
    (lambda: hs.Sum(parts=()), "at least one"),
    (lambda: hs.Sum(parts=hs.BoucWen()), TypeError, "tuple of models, got BoucWen"),
    (lambda: hs.BoucWen() + 1.0, TypeError, "unsupported operand"),
    (lambda: (hs.BoucWen() + hs.Dashpot()).response([0.0, 1.0]), "a Dashpot moves in time: give sample_time"),
    (lambda: hs.Actuator(hysteresis=hs.BoucWen() + hs.Dashpot()), TypeError, "law that a loop can step"),
    (lambda: hs.Cascade.structure(PLANT), TypeError, "no stage can be identified"),
    (
        lambda: hs.Cascade.structure(hs.BoucWen, hs.TransferFunction(num=(1.0,), den=(1.0, 1.0), initial_state=(1.0,))),
        "initial state",
    ),
)


def test_signals_show_what_each_part_gives():
    u = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=20)
    t = TIME * np.arange(u.size)
    model = (hs.Play(threshold=0.2) + hs.Play(threshold=0.4) + hs.Dashpot(c=0.2)) >> PLANT
    whole = hs.simulate(model, t, u)
    assert set(whole.signals) == {"t", "u", "y", "sum", "transfer_function"}
    inner = hs.simulate(model.stages[0], t, u)
    assert inner.y.tolist() == whole.signals["sum"].tolist()
    parts = [inner.signals[name] for name in ("play[0]", "play[1]", "dashpot")]
    assert inner.y.tolist() == ((parts[0] + parts[1]) + parts[2]).tolist()


def noisy(model, u, noise=0.002, seed=0):
    """A record of the model, with normal noise."""
    time = (TIME,) if model.dynamic else ()
    y = model.response(u, *time) + noise * np.random.default_rng(seed).standard_normal(u.size)
    return hs.Record(u=u, y=y, t=TIME * np.arange(u.size))


def within(fit, truth, sigmas=4.0):
    """All estimates near the truth: 4 standard errors are exceeded once in 15 000 times."""
    return all(abs(fit.estimates[name] - value) < sigmas * fit.stderr[name] for name, value in truth.items())


WAVES = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
WALK = np.interp(np.arange(240), np.arange(0, 240, 6), np.random.default_rng(3).uniform(-1.0, 1.0, 40))


@needs_compiled
def test_a_damper_is_found_in_noise():
    true = hs.BoucWen(beta=2.0, gamma=0.6, gain=2.0) + hs.Dashpot(c=0.2) + hs.Line(offset=0.3, slope=0.4)
    fit = hs.identify(hs.BoucWen() + hs.Dashpot() + hs.Line(), noisy(true, WAVES), fixed={"bouc_wen.n": 1.0})
    assert fit.free_names == (
        *("bouc_wen.beta", "bouc_wen.gamma", "bouc_wen.gain", "bouc_wen.z0"),
        *("dashpot.c", "line.offset", "line.slope"),
    )
    assert within(fit, {"bouc_wen.beta": 2.0, "bouc_wen.gain": 2.0, "dashpot.c": 0.2, "line.slope": 0.4})
    assert fit.rmse < 0.0022  # the noise's 0.002, give or take a tenth in 121 samples
    assert isinstance(fit.model, hs.Sum)
    assert "bouc_wen: the law is" in fit.message


@needs_compiled
def test_a_law_in_front_of_linear_dynamics_is_found_in_noise():
    true = hs.Play(threshold=0.3, gain=2.0) >> hs.TransferFunction(num=(2.0, 30.0), den=(1.0, 2.0, 30.0))
    structure = hs.Cascade.structure(hs.Play, hs.TransferFunction.structure(poles=2, zeros=1))
    fit = hs.identify(structure, noisy(true, WALK))
    truth = {"play.threshold": 0.3, "play.gain": 2.0, "transfer_function.den[1]": 2.0, "transfer_function.num[0]": 2.0}
    assert within(fit, truth)
    assert fit.model.stages[1].dc_gain == pytest.approx(1.0, rel=1e-12)  # den_n over itself, through a power


@needs_compiled
def test_a_law_behind_linear_dynamics_is_found_in_noise():
    true = hs.TransferFunction(num=(6.0,), den=(1.0, 6.0)) >> hs.Play(threshold=0.1, gain=2.0, offset=0.5)
    structure = hs.TransferFunction.structure(poles=1, zeros=0) >> hs.Play(threshold=0.2)
    fit = hs.identify(structure, noisy(true, WALK))
    assert within(fit, {"play.threshold": 0.1, "play.gain": 2.0, "transfer_function.den[1]": 6.0})


@needs_compiled
def test_a_plant_that_is_known_stays():
    true = hs.Play(threshold=0.3, gain=2.0) >> PLANT
    fit = hs.identify(hs.Play(threshold=0.1) >> PLANT, noisy(true, WALK))
    assert fit.free_names == ("play.threshold", "play.gain", "play.offset", "play.z0")
    assert fit.model.stages[1] == PLANT
    assert within(fit, {"play.threshold": 0.3, "play.gain": 2.0})


@pytest.mark.parametrize("initial", ["free", "rest"])
def test_regressors_are_the_response(initial):
    plant = hs.TransferFunction.structure(poles=2, zeros=1, initial=initial)
    structure = hs.Sum.structure(hs.Cascade.structure(hs.Dahl, plant), hs.Dashpot, PLANT)
    record = noisy(hs.BoucWen() + hs.Dashpot(), WALK)
    space = structure.search_space(record)
    x = space.lower + np.random.default_rng(0).uniform(0.4, 0.6, (3, space.lower.size)) * (space.upper - space.lower)
    parameters, linear = space.parameters(x), np.random.default_rng(1).standard_normal(len(space.columns))
    columns = structure.regressors(parameters, record)
    for k in range(3):
        one = {name: float(values[k]) for name, values in parameters.items()}
        model = structure.assemble(one | dict(zip(space.columns, linear, strict=True)))
        y = columns[k] @ [*linear, 1.0]
        assert y == pytest.approx(model.response(record.u, TIME), rel=1e-9, abs=1e-9)  # sums in another order


@needs_compiled
def test_of_columns_that_repeat_each_other_the_last_is_free():
    record = noisy(hs.Line(slope=1.0) + hs.Dashpot(), WAVES)
    structure = hs.Sum.structure(hs.BoucWen, hs.Line, hs.PrandtlIshlinskii.structure(plays=3))
    space = structure.search_space(record)
    assert {"bouc_wen.offset", "line.offset", "bouc_wen.feedthrough", "line.slope"} <= set(space.held)
    assert {"prandtl_ishlinskii.offset", "prandtl_ishlinskii.weights[0]"} <= set(space.linear)
    started = (hs.BoucWen(offset=0.5) + hs.Line(offset=0.25)).search_space(record)
    assert started.held["bouc_wen.offset"] == 0.5
    chosen = hs.identify(hs.Play(threshold=0.3) + hs.Line(), record, free="play.offset")
    assert "play.offset" in chosen.free_names
    assert "line.offset" not in chosen.free_names
    fixed = hs.identify(hs.Play(threshold=0.3) + hs.Line(), record, fixed={"play.offset": 0.1})
    assert fixed.model.parts[0].offset == 0.1
    assert "line.offset" in fixed.free_names


@needs_compiled
def test_names_are_those_of_the_parts():
    record = noisy(hs.Line(slope=1.0) + hs.Dashpot(), WAVES)
    twins = hs.identify(hs.Play(threshold=0.2) + hs.Play(threshold=0.4), record, bounds={"play[1].gain": (0.0, 2.0)})
    assert {"play[0].threshold", "play[1].threshold"} <= set(twins.free_names)
    with pytest.raises(ValueError, match=r"fixed names 'gain'; the parameters are play\.threshold"):
        hs.identify(hs.Play() + hs.Line(), record, fixed={"gain": 1.0})
    with pytest.raises(ValueError, match="bouc_wen: n must be positive"):
        hs.identify(hs.BoucWen() + hs.Line(), record, fixed={"bouc_wen.n": -1.0})
    with pytest.raises(ValueError, match="the gain one at rest"):
        hs.identify(hs.Play() >> hs.TransferFunction.structure(poles=2, zeros=1), record,
                    fixed={"transfer_function.num[0]": 1.0})  # fmt: skip


@needs_compiled
def test_a_steady_cycle_is_that_of_the_parts():
    true = hs.Dahl(stiffness=3.0, coulomb=0.5) + hs.Line(slope=0.5)
    u = np.tile(0.8 * np.sin(2 * np.pi * np.arange(40) / 40), 4)
    y = true.response(u)[80:120]  # two cycles leave exp(-2 * 3.2 * 6) of what was before
    fit = hs.identify(hs.Dahl() + hs.Line(), hs.Record(u=u[80:120], y=y), initial="periodic")
    assert fit.estimates["dahl.coulomb"] == pytest.approx(0.5, rel=1e-6)
    assert fit.rmse < 1e-12  # rounding
    record = hs.Record(u=u, y=true.response(u), t=TIME * np.arange(u.size))
    with pytest.raises(ValueError, match="no steady cycle"):
        hs.identify(hs.Dahl() >> hs.TransferFunction.structure(poles=1, zeros=0), record, initial="periodic")


@needs_compiled
def test_records_share_all_but_their_states():
    true = hs.Dahl(stiffness=3.0, coulomb=0.5) + hs.Dashpot(c=0.2)
    records = [noisy(true, WAVES, seed=1), noisy(true, WALK, seed=2)]
    fit = hs.identify(hs.Dahl() + hs.Dashpot(), records)
    assert {"dahl.z0[0]", "dahl.z0[1]"} <= set(fit.free_names)
    assert within(fit, {"dahl.stiffness": 3.0, "dahl.coulomb": 0.5, "dashpot.c": 0.2})


@needs_compiled
def test_a_composed_structure_is_compared():
    record = noisy(hs.Dahl(stiffness=3.0, coulomb=0.5) + hs.Dashpot(c=0.2), WAVES)
    table = hs.compare({"law": hs.Dahl, "damper": hs.Sum.structure(hs.Dahl, hs.Dashpot)}, record, cross_validate=None)
    assert table["damper"].rmse < 0.003 < table["law"].rmse
