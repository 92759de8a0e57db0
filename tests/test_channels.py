"""Parameters follow a channel of the records: what is identified, evaluated, stored, drawn, and refused."""

import dataclasses
import pickle
import warnings

import numpy as np
import pytest
from square_dahl import SquareDahl
from strategies import assert_refused, refused

import hysim as hs


@hs.family
class Slider(hs.Law):
    """A law that works out a number from its parameters, and whose start moves the memory, as that of Duhem's does."""

    k: float = 2.0
    z0: float = 0.1

    workspace = 1

    @classmethod
    def candidates(cls):
        """None: it is for this file."""
        return {}

    @staticmethod
    def start(parameters, state, u0):
        """Complete a state (u, z, 1/k)."""
        state[0] = u0
        state[1] -= 0.5 * u0
        state[2] = 1.0 / parameters[0]

    @staticmethod
    def step(parameters, state, u):
        """Output z after a stroke to `u`."""
        state[1] += (u - state[0]) * state[2]
        state[0] = u
        return state[1]


U = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=40) * 1.0
SUPPLIES = (1.0, 2.0, 4.0)
DEPENDS = {"threshold": ("T", 1), "gain": ("T", 2)}
PLAYS = hs.PrandtlIshlinskii(thresholds=(0.0, 0.3), weights=(1.0, 0.5))


def play(T):
    return hs.Play(threshold=0.1 + 0.05 * T, gain=1.0 + 0.1 * T**2)


def record(law, T, u=U, noise=0.0, seed=0):
    y = law.response(u) + noise * np.random.default_rng(seed).standard_normal(u.size)
    return hs.Record(u=u, y=y, channels={"T": T}, units={"T": "degC"})


def records(law=play, **others):
    return [record(law(T), T, seed=k, **others) for k, T in enumerate(SUPPLIES)]


@pytest.fixture(scope="module")
def fit():
    return hs.identify(hs.Play, records(noise=0.01), depends=DEPENDS)


def polynomial(parameter, *values, at=(20.0, 60.0), channel="T"):
    return hs.ChannelPolynomial(parameter=parameter, channel=channel, at=at, values=values)


# ---------------------------------------------------------------------------------- what is identified


def test_polynomials_of_two_degrees_are_found_and_evaluated_between_the_records():
    fit = hs.identify(hs.Play, records(), depends=DEPENDS)
    assert fit.free_names[:5] == ("threshold(T=1)", "threshold(T=4)", "gain(T=1)", "gain(T=2.5)", "gain(T=4)")
    for T in (1.0, 1.7, 3.9):
        assert fit.model.at(T=T).threshold == pytest.approx(play(T).threshold, rel=1e-9)
        assert fit.model.at(T=T).gain == pytest.approx(play(T).gain, rel=1e-9)
    curve = hs.parameter_curve(fit, "gain")
    np.testing.assert_allclose(curve.coefficients, (1.0, 0.0, 0.1), atol=1e-9)


def test_a_shape_whose_box_has_other_coordinates_is_found():
    """Bouc-Wen's beta and gamma are searched as sums and differences unless one of them depends on a channel."""

    def law(T):
        return hs.BoucWen(beta=1.0 + 0.3 * T, gamma=0.5, gain=1.0 + 0.1 * T)

    fixed = {"n": 1.0, "z0": 0.0, "feedthrough": 0.0, "offset": 0.0}
    fit = hs.identify(hs.BoucWen, records(law), depends={"beta": ("T", 1), "gain": ("T", 1)}, fixed=fixed)
    found = [fit.estimates[name] for name in ("beta(T=1)", "beta(T=4)", "gamma", "gain(T=1)", "gain(T=4)")]
    np.testing.assert_allclose(found, [1.3, 2.2, 0.5, 1.1, 1.4], rtol=1e-8)


@pytest.mark.parametrize("name", ["gain", "threshold"])
def test_degree_0_is_no_dependence_to_the_bit(name):
    plain = hs.identify(hs.Play, records(noise=0.01))
    same = hs.identify(hs.Play, records(noise=0.01), depends={name: ("T", 0)})
    assert same.estimates == plain.estimates
    np.testing.assert_equal(dict(same.stderr), dict(plain.stderr))
    assert same.message == plain.message
    assert same.model.at(T=1.0) == plain.model


def test_a_channel_that_stands_still_is_one_number(fit):
    still = [dataclasses.replace(rec, channels={"T": np.full(U.size, rec.channel("T"))}) for rec in records(noise=0.01)]
    again = hs.identify(hs.Play, still, depends=DEPENDS)
    assert again.estimates == fit.estimates
    np.testing.assert_equal(dict(again.intervals), dict(fit.intervals))


def test_a_channel_that_varies_along_one_record_determines_the_polynomials():
    u, T = np.tile(U, 2), np.linspace(1.0, 4.0, 2 * U.size)
    threshold, gain = polynomial("threshold", 0.15, 0.3, at=(1.0, 4.0)), polynomial("gain", 1.0, 2.0, at=(1.0, 4.0))
    truth = hs.Dependent(law=hs.Play(), polynomials=(threshold, gain))
    rec = hs.Record(u=u, y=truth.response(u, channels={"T": T}), channels={"T": T})
    fit = hs.identify(hs.Play, rec, depends={"threshold": ("T", 1), "gain": ("T", 1)})
    found = [fit.estimates[name] for name in ("threshold(T=1)", "threshold(T=4)", "gain(T=1)", "gain(T=4)")]
    np.testing.assert_allclose(found, [0.15, 0.3, 1.0, 2.0], rtol=1e-8)
    np.testing.assert_allclose(rec.y - fit.residual, truth.response(u, channels={"T": T}), atol=1e-12)


def test_a_batch_starts_each_law_as_one_alone():
    sets = {"k": [1.0, 2.0, 5.0], "z0": [0.1, 0.2, -0.3]}
    rows = Slider.responses(sets, U)
    for k, (stiffness, z0) in enumerate(zip(*sets.values(), strict=True)):
        assert np.array_equal(rows[k], Slider(k=stiffness, z0=z0).response(U))


@pytest.mark.parametrize("name", ["a", "alpha", "Ms", "gain"])
def test_the_magnetisation_is_kept_where_a_constant_of_a_core_changes(name):
    law = hs.JilesAtherton()
    u, T = 3000.0 * np.sin(np.linspace(0.0, 12.0, 60)), np.linspace(20.0, 80.0, 60)
    value = law.scalars[name]
    core = hs.Dependent(law=law, polynomials=(polynomial(name, value, 1.2 * value, at=(20.0, 80.0)),))
    y, (field, magnetisation) = [], (u[0], law.z0)
    for k in range(u.size):
        output, state = core.at(T=float(T[k])).advance(u[k : k + 1], (field, magnetisation, 0.0, 0.0))
        (field, magnetisation), _ = state[:2], y.append(output[0])
    np.testing.assert_allclose(core.response(u, channels={"T": T}), y, rtol=0.0, atol=1e-13 * np.ptp(y))


def test_weights_leave_a_record_out():
    wrong = record(hs.Play(threshold=0.9, gain=-3.0), 3.0)
    weights = [np.ones(U.size)] * 3 + [np.zeros(U.size)]
    fit = hs.identify(hs.Play, [*records(), wrong], depends=DEPENDS, weights=weights)
    assert fit.model.at(T=3.0).gain == pytest.approx(play(3.0).gain, rel=1e-8)


def test_a_law_of_the_user_takes_part():
    recs = records(lambda T: SquareDahl(k=3.0, coulomb=0.2 + 0.1 * T, c=1.0))
    fit = hs.identify(SquareDahl, recs, depends={"coulomb": ("T", 1)}, fixed={"z0": 0.0, "k": 3.0})
    assert fit.model.at(T=3.0).coulomb == pytest.approx(0.5, rel=1e-7)


def test_parts_of_a_sum_depend_on_channels():
    """The viscosity of a damper whose supply varies along the record, beside a law that does not know it."""
    supply = np.linspace(0.0, 2.0, U.size)
    truth = hs.Play(threshold=0.2) + hs.Dashpot(c=1.0)
    y = truth.parts[0].response(U) + (1.0 + supply) * hs.Dashpot(c=1.0).response(U, 0.1)
    rec = hs.Record(u=U, y=y, t=0.1 * np.arange(U.size), channels={"I": supply})
    fit = hs.identify(truth, rec, depends={"dashpot.c": ("I", 1)})
    assert [fit.estimates[f"dashpot.c(I={k})"] for k in (0, 2)] == pytest.approx([1.0, 3.0], rel=1e-7)
    np.testing.assert_allclose(fit.model.response(U, 0.1, channels={"I": supply}), y, atol=1e-9)
    assert fit.model.at(I=1.0).parts[1].c == pytest.approx(2.0, rel=1e-7)


def test_a_polynomial_of_positive_values_stays_positive_between_them():
    """The parabola through 1, 0.01 and 0.2 dips below zero; one whose values differ in sign may pass through it."""
    from hysim.models.dependent_structure import _comes_near_zero

    dips = np.array([[1.0, 0.01, 0.2], [1.0, 2.0, 1.0], [-1.0, -0.01, -0.2], [1.0, -1.0, 1.0]])
    assert _comes_near_zero((0.0, 0.5, 1.0), dips).tolist() == [True, False, True, False]


# ---------------------------------------------------------------------------------- along an input


def transcribed(law_at, u, channel):
    """The obvious way: at each sample the law with its parameters goes on from the state of the one before."""
    y, state = [], None
    for value, c in zip(u.tolist(), channel.tolist(), strict=True):
        out, state = law_at(c).advance([value], state)
        y.append(out[0])
    return np.array(y)


@pytest.mark.parametrize(
    ("law", "polynomials"),
    [
        (hs.BoucWen(n=1.7, z0=0.3), (polynomial("beta", 0.2, 3.0), polynomial("gain", 1.0, -2.0))),
        (hs.BoucWen(gamma=-0.2), (polynomial("n", 0.8, 3.0), polynomial("A", 2.0, 0.5))),
        (hs.Play(z0=0.4), (polynomial("threshold", 0.0, 0.9),)),
        (hs.Dahl(), (polynomial("coulomb", 0.1, 2.0), polynomial("stiffness", 5.0, 1.0))),
        (SquareDahl(), (polynomial("k", 0.5, 9.0), polynomial("c", 0.0, 1.0))),
        (hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.2, 0.5)), (polynomial("slips[0]", 0.1, 0.3),)),
        (Slider(), (polynomial("k", 0.5, 3.0),)),
    ],
    ids=["BoucWen", "exponent", "Play", "Dahl", "SquareDahl", "MaxwellSlip", "Slider"],
)
def test_parameters_along_an_input_are_those_of_the_sample_at_the_end_of_each_branch(law, polynomials):
    rng = np.random.default_rng(5)
    u, channel = rng.uniform(-2.0, 2.0, 40), rng.uniform(20.0, 60.0, 40)
    u[7], channel[11] = u[6], channel[10]  # an input, and a channel, that stand still
    model = hs.Dependent(law=law, polynomials=polynomials)
    expected = transcribed(lambda c: model.at(T=c), u, channel)
    # paths of a fixed law may be summed in another order than its step
    np.testing.assert_allclose(model.response(u, channels={"T": channel}), expected, rtol=1e-12, atol=1e-13)


def test_friction_that_depends_on_the_velocity_follows_a_channel_along_a_record():
    """With the same friction at every speed LuGre is Dahl's law, whose varying parameters are those of a `Law`."""
    load = np.linspace(20.0, 60.0, U.size)
    levels = [polynomial(name, 0.3, 0.8) for name in ("coulomb", "breakaway")]
    bristles = hs.Dependent(law=hs.LuGre(sigma0=5.0, stribeck_velocity=1.0), polynomials=tuple(levels))
    dahl = hs.Dependent(law=hs.Dahl(stiffness=5.0), polynomials=(levels[0],))
    y = bristles.response(U, 0.1, channels={"T": load})
    np.testing.assert_allclose(y, dahl.response(U, channels={"T": load}), atol=1e-12)
    assert_refused("a LuGre moves in time: give sample_time", bristles.response, U, channels={"T": load})
    rec = hs.Record(u=U, y=y, t=0.1 * np.arange(U.size), channels={"T": load})
    known = {**bristles.law.scalars, "breakaway": 0.5, "stribeck_velocity": 1e-9}  # no peak at any speed
    depends, free = {"coulomb": ("T", 1)}, ("coulomb", "sigma2")
    fit = hs.identify(hs.LuGre, rec, fixed={k: v for k, v in known.items() if k not in free}, depends=depends)
    found = [fit.estimates[name] for name in ("coulomb(T=20)", "coulomb(T=60)", "sigma2")]
    np.testing.assert_allclose(found, [0.3, 0.8, 0.0], atol=1e-6)


def test_the_name_of_a_tuple_stands_for_all_its_numbers():
    law = hs.TabulatedDahl(rate=3.0)
    recs = [record(dataclasses.replace(law, amplitude=(0.1 * T, 0.2 * T)), T) for T in SUPPLIES]
    fit = hs.identify(law, recs, depends={"amplitude": ("T", 1)})
    np.testing.assert_allclose(fit.model.at(T=3.0).amplitude, [0.3, 0.6], rtol=1e-6)
    assert fit.model.response([], channels={"T": []}).size == 0


def test_a_state_that_depends_on_the_parameters_is_refused():
    law = hs.ParametricPrandtlIshlinskii(z0=(0.5, -0.2))
    model = hs.Dependent(law=law, polynomials=(polynomial("reach", 0.5, 1.0),))
    varying = {"T": np.linspace(20.0, 60.0, U.size)}
    assert_refused("holds numbers that depend on its parameters", model.response, U, channels=varying)


def test_what_cannot_change_from_sample_to_sample_is_refused():
    both = hs.TransferFunction(num=(1.0,), den=(1.0, 1.0)) + hs.Dashpot()
    model = hs.Dependent(law=both, polynomials=(polynomial("dashpot.c", 1.0, 2.0),))
    varying = np.linspace(20.0, 60.0, U.size)
    np.testing.assert_allclose(  # the part that varies is linear; the other does not vary
        model.response(U, 0.1, channels={"T": varying}) - model.at(T=20.0).parts[0].response(U, 0.1),
        np.linspace(1.0, 2.0, U.size) * hs.Dashpot(c=1.0).response(U, 0.1),
        atol=1e-12,
    )
    behind = hs.Play() >> hs.TransferFunction(num=(1.0,), den=(1.0, 1.0))
    cascade = hs.Dependent(law=behind, polynomials=(polynomial("play.threshold", 0.1, 0.2),))
    assert cascade.response(U, 0.1, channels={"T": 30.0}).size == U.size
    words = "play.threshold of a Cascade cannot vary along a record"
    assert_refused(words, cascade.response, U, 0.1, channels={"T": varying}, error=TypeError)


# ---------------------------------------------------------------------------------- the model


def test_a_dependent_law_comes_back_from_files_and_copies(fit, tmp_path):
    hs.save(fit.model, tmp_path / "law.json")
    assert hs.load_model(tmp_path / "law.json") == fit.model
    assert pickle.loads(pickle.dumps(fit.model)) == fit.model
    assert hash(fit.model) == hash(pickle.loads(pickle.dumps(fit.model)))
    assert hs.Identification.from_json(fit.to_json()).model == fit.model
    curve = hs.parameter_curve(fit, "gain")
    assert hs.ParameterCurve.from_json(curve.to_json()) == curve
    assert "gain" in str(fit.model)


def test_outside_the_identified_range_is_warned_of(fit):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit.model.at(T=1.0)
        fit.model.at(T=4.0)
    with pytest.warns(UserWarning, match="T = 4.1 is outside the range 1 to 4 in which threshold"):
        assert fit.model.at(T=4.1).gain > fit.model.at(T=4.0).gain
    with pytest.warns(UserWarning, match="T = 0 is outside"):
        fit.model.response(U, channels={"T": np.linspace(0.0, 4.0, U.size)})


test_what_is_no_dependent_law_is_refused = refused(
    ({"law": hs.Play}, TypeError, "law must be a model"),
    ({"polynomials": (polynomial("beta", 1.0, 2.0),)}, "no parameter 'beta'; its parameters are thre"),
    ({"polynomials": (polynomial("threshold", 1.0, -2.0),)}, "threshold"),
    ({"polynomials": (polynomial("gain", 1.0, 2.0),) * 2}, "two polynomials"),
    ({"polynomials": ("gain",)}, TypeError, "must hold ChannelPolynomial"),
    call=lambda given: hs.Dependent(**{"law": hs.Play(), "polynomials": (polynomial("gain", 1.0, 2.0),)} | given),
)


test_what_is_no_polynomial_is_refused = refused(
    ({"at": ()}, "increasing places"),
    ({"at": (2.0, 1.0)}, "increasing places"),
    ({"values": (1.0,)}, "one number for"),
    ({"span": (3.0, 1.0)}, "lowest and the highest"),
    call=lambda arguments: hs.ChannelPolynomial(
        **{"parameter": "gain", "channel": "T", "at": (1.0, 2.0), "values": (1.0, 2.0)} | arguments
    ),
)


def test_a_model_without_its_channels_says_what_to_give(fit):
    assert_refused("depends on the channel 'T': give response", fit.model.response, U)
    assert_refused("depends on 'T', got 'I'", fit.model.at, I=1.0)


# ---------------------------------------------------------------------------------- what identify refuses


test_a_dependence_that_cannot_be_identified_is_refused = refused(
    ({"gain": ("I", 1)}, "record 0 has no channel 'I'; it has 'T'"),
    ({"beta": ("T", 1)}, "depends names 'beta'; the parameters are threshold"),
    ({"gain": ("T", 3)}, "needs 4 different values of the channel, the records have 3"),
    ({"gain": "T"}, TypeError, r"must hold \(channel, degree\)"),
    ({"gain": ("T", -1)}, "degree must be a whole number"),
    ({"z0": ("T", 1)}, "state at the first sample"),
    ({}, "names no parameter"),
    ({"gain": ("T", 1)}, hs.Play, {"gain": 1.0}, "'gain' is fixed and depends on 'T'"),
    ({"gain": ("T", 1)}, hs.SingleValued, TypeError, "depends is for laws"),
    ({"thresholds[1]": ("T", 1)}, PLAYS, r"'thresholds\[1\]' is not searched by itself: give bounds="),
    call=lambda depends, law=hs.Play, fixed=None: hs.identify(law, records(), depends=depends, fixed=fixed),
)


def test_a_search_with_few_evaluations_is_partial():
    fit = hs.identify(hs.Play, records(), depends=DEPENDS, max_evaluations=40)
    assert not fit.success
    assert "max_evaluations=40" in fit.message


def test_bounds_hold_at_every_place():
    fit = hs.identify(hs.Play, records(), depends=DEPENDS, bounds={"threshold": (0.2, 0.5), "gain": (0.0, 2.0)})
    assert [fit.estimates[name] for name in ("threshold(T=1)", "gain(T=4)")] == pytest.approx([0.2, 2.0])


# ---------------------------------------------------------------------------------- curves, estimates, comparisons


def test_a_curve_has_the_errors_of_the_fit_at_its_places(fit):
    curve = hs.parameter_curve(fit, "gain")
    for name, place in (("gain(T=1)", 1.0), ("gain(T=2.5)", 2.5), ("gain(T=4)", 4.0)):
        assert float(curve.value(place)) == fit.estimates[name]
        assert float(curve.stderr(place)) == pytest.approx(fit.stderr[name])
        np.testing.assert_allclose(np.ravel(curve.band(place)), fit.intervals[name])
    channel = np.linspace(1.0, 4.0, 7)
    np.testing.assert_allclose(np.polynomial.polynomial.polyval(channel, curve.coefficients), curve.value(channel))
    assert len(curve.coefficients_stderr) == 3
    assert_refused("'offset' depends on no channel", hs.parameter_curve, fit, "offset")


def test_an_unknown_channel_is_estimated_with_its_error(fit):
    unknown = record(play(3.2), 0.0, noise=0.01, seed=9)
    found = hs.estimate_channel(fit, dataclasses.replace(unknown, channels={}, units={}), "T")
    assert abs(found.estimates["T"] - 3.2) < 4.0 * found.stderr["T"] < 0.1
    assert found.model == fit.model.at(T=found.estimates["T"]).with_scalars({"z0": found.estimates["z0"]})
    beyond = hs.estimate_channel(fit, record(play(4.5), 0.0), "T", bounds=(1.0, 6.0))
    assert beyond.estimates["T"] == pytest.approx(4.5, abs=0.05)
    assert any("outside the range 1 to 4" in each for each in beyond.warnings)
    within = hs.estimate_channel(fit, record(play(4.5), 0.0), "T", bounds=(1.0, 4.0))
    assert within.estimates["T"] == 4.0
    assert "NOT converged: T is at 4, the end of its range" in within.summary()
    assert_refused("bounds of 'T' must be finite, .* got 20", hs.estimate_channel, fit, unknown, "T", bounds=20)
    assert_refused("not on 'I'", hs.estimate_channel, fit, unknown, "I")
    assert_refused("a law that depends on channels", hs.estimate_channel, hs.Play(), unknown, "T", error=TypeError)
    assert_refused("takes one Record, got list", hs.estimate_channel, fit, [unknown], "T", error=TypeError)


def test_a_channel_is_estimated_where_the_record_begins_inside_a_loop_and_its_other_value_is_said():
    parabola = hs.ChannelPolynomial(parameter="coulomb", channel="T", at=(1.0, 2.0, 3.0), values=(0.8, 0.4, 0.8))
    stack = hs.Dependent(law=hs.Dahl(stiffness=3.0), polynomials=(parabola,))
    found = hs.estimate_channel(stack, hs.Record(u=U, y=stack.at(T=1.5).response(U))[15:], "T")
    assert abs(found.estimates["T"] - 2.0) == pytest.approx(0.5, abs=1e-6)
    assert f"T = {4.0 - found.estimates['T']:.6g} gives the same law" in found.warnings[-1]
    other = dataclasses.replace(
        stack, polynomials=(parabola, polynomial("offset", 1e-10, 9e-10, at=(1.0, 3.0)))
    )  # a small unit
    assert hs.estimate_channel(other, hs.Record(u=U, y=other.at(T=1.5).response(U)), "T").warnings == ()
    bank = hs.Dependent(law=PLAYS, polynomials=(polynomial("offset", 0.0, 1.0),))
    assert_refused("has one number, got a Prandtl", hs.estimate_channel, bank, records()[0], "T", error=TypeError)


def test_a_dependence_is_compared_with_one_law_and_with_fits_one_by_one(fit):
    cycles = [record(play(T), T, u=np.tile(U, 2), noise=0.01) for T in SUPPLIES]
    subjects = {
        "one law": hs.Play,
        "in T": hs.Dependent.structure(hs.Play, DEPENDS),
        "known": fit,
        "one by one": [hs.identify(hs.Play, each) for each in cycles],
    }
    table = hs.compare(subjects, cycles, cross_validate=None, test=record(play(3.0), 3.0, noise=0.01, seed=7))
    assert not table.failed
    assert table["in T"].rmse < 1.1 * table["one by one"].rmse < 0.1 * table["one law"].rmse
    assert table["one by one"].n_parameters == 12
    assert table["in T"].test_rmse < 0.1 * table["one law"].test_rmse
    assert table.ranked("bic")[0].name in ("in T", "known")
    assert_refused("for each of the 3 records, got 2", hs.compare, {"two": [hs.Play(), hs.Play()]}, cycles)


def test_a_dependence_along_one_record_is_compared():
    u, T = np.tile(U, 2), np.linspace(1.0, 4.0, 2 * U.size)
    truth = hs.Dependent(law=hs.Play(threshold=0.2), polynomials=(polynomial("gain", 1.0, 2.0, at=(1.0, 4.0)),))
    rec = hs.Record(u=u, y=truth.response(u, channels={"T": T}), channels={"T": T})
    table = hs.compare({"constant": hs.Play, "in T": truth}, rec, cross_validate=None)
    assert table["in T"].rmse < 1e-12 < 0.01 < table["constant"].rmse
    assert table["in T"].is_rate_independent


def test_a_parameter_is_drawn_with_its_band_and_the_fits_one_by_one(fit):
    alone = [hs.identify(hs.Play, each) for each in records(noise=0.01)]
    axes = hs.plot.figure().add_subplot()
    hs.plot.parameter(fit, "gain", ax=axes, one_by_one=alone, records=records(noise=0.01), unit="um/V")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("T [degC]", "gain [µm/V]")
    drawn = [float(container.lines[0].get_ydata()[0]) for container in axes.containers]
    assert drawn == [each.estimates["gain"] for each in alone]
    x, y = axes.lines[0].get_xydata().T
    np.testing.assert_allclose(y, hs.parameter_curve(fit, "gain").value(x))
    assert_refused("one record for each fit", hs.plot.parameter, fit, "gain", ax=axes, one_by_one=alone)


# ---------------------------------------------------------------------------------- records and files

MEASURED = hs.Record(
    t=[0.0, 1.0, 2.0, 3.0], u=[0.0, 1.0, 2.0, 0.0], y=[0.0, 1.0, 1.5, 0.2],
    channels={"T": [20.0, 21.0, 22.5, 23.0], "supply": 0.5}, units={"T": "degC", "supply": "V", "u": "V"}, name="hot",
)  # fmt: skip


def test_channels_are_cut_interpolated_converted_and_printed_with_their_record():
    assert MEASURED[1:3].channel("T").tolist() == [21.0, 22.5]
    assert MEASURED[1:3].channel("supply") == 0.5
    assert MEASURED.resample(0.5).channel("T").tolist() == [20.0, 20.5, 21.0, 21.75, 22.5, 22.75, 23.0]
    assert MEASURED.convert({"supply": "mV"}).channel("supply") == 500.0
    assert [part.channel("T").size for part in MEASURED.split(2)] == [2, 2]
    assert "T       20 to 23 degC\n  supply  0.5 V" in str(MEASURED)
    assert pickle.loads(pickle.dumps(MEASURED)) == MEASURED != dataclasses.replace(MEASURED, channels={}, units={})
    assert_refused("'hot' has no channel 'I'; it has 'T', 'supply'", MEASURED.channel, "I")


test_what_is_no_channel_is_refused = refused(
    ({"u": 1.0}, "a name other than"),
    ({"": 1.0}, "a name other than"),
    ({"T": [1.0, 2.0]}, r"one number, or 3 as u has, got shape \(2,\)"),
    ({"T": np.nan}, "'T' must be finite, got nan"),
    ({"T": [1.0, np.inf, 2.0]}, "'T' must be finite, got inf at index 1"),
    ({"T": "hot"}, TypeError, "must be numbers"),
    ([1.0], TypeError, "must be a mapping"),
    call=lambda channels: hs.Record(u=[0.0, 1.0, 2.0], y=[0.0, 1.0, 2.0], channels=channels),
)


@pytest.mark.parametrize("ending", [".csv", ".tsv", ".npz", ".mat", ".h5"])
def test_channels_come_back_from_every_format(ending, tmp_path):
    if ending == ".h5":
        pytest.importorskip("h5py")
    hs.save_record(MEASURED, tmp_path / f"hot{ending}")
    assert hs.load(tmp_path / f"hot{ending}") == MEASURED
    assert hs.load(tmp_path / f"hot{ending}", channels=()).channels == {}


def test_columns_of_a_foreign_file_are_channels(tmp_path):
    path = tmp_path / "foreign.csv"
    path.write_text("volt [V],pos,temp [degC]\n0,0,20\n1,1,\n2,2,22\n")
    rec = hs.load(path, u="volt", y="pos", channels={"T": "temp", "supply": 0.5}, on_missing="drop")
    assert rec.channel("T").tolist() == [20.0, 22.0]
    assert (rec.channel("supply"), rec.units["T"]) == (0.5, "degC")
    assert [*hs.load(path, u=0, y=1, channels=["temp"], on_missing="drop").channels] == ["temp"]
    assert_refused("no column 'T'", hs.load, path, u=0, y=1, channels=["T"])


@pytest.mark.parametrize(("name", "ending"), [("T [K]", ".csv"), ("name", ".npz"), ("T 1", ".mat"), ("a_units", ".h5")])
def test_a_channel_whose_name_a_file_has_no_place_for_is_refused(name, ending, tmp_path):
    rec = hs.Record(u=[0.0, 1.0], y=[0.0, 1.0], channels={name: [1.0, 2.0]})
    assert_refused("a column cannot be called", hs.save_record, rec, tmp_path / f"record{ending}")


def test_the_command_line_identifies_a_dependence(tmp_path, capsys, monkeypatch):
    from hysim.cli import main

    monkeypatch.chdir(tmp_path)
    T = np.linspace(20.0, 60.0, U.size)
    rows = zip(U, (0.5 + 0.01 * T) * hs.Play(threshold=0.3).response(U), T, strict=True)
    (tmp_path / "rec.csv").write_text("u,y,temp\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows))
    options = ["--model", "play", "--depends", "gain=T:1", "--out", "law.json"]
    assert main(["identify", "rec.csv", "--channel", "T=temp", *options]) == 0
    assert "gain(T=20) = 0.7 " in capsys.readouterr().out
    assert hs.load_model("law.json").at(T=60.0).gain == pytest.approx(1.1)
    assert main(["identify", "rec.csv", *options]) == 2
    assert "has no channel 'T'" in capsys.readouterr().err
