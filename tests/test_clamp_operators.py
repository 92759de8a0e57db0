"""Plays, stops and their sums: closed forms, the properties that define the family, the exact inverse."""

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import (
    assert_batch_has_the_bits_of_its_laws,
    assert_cut_or_stepped_it_has_the_same_bits,
    refused,
    short_inputs,
)

import hysim as hs
from hysim.models.search_space import Freedom

# Al Janaideh 2022, example 1.
THRESHOLDS = tuple(0.45 * k for k in range(7))
WEIGHTS = (0.72, 0.6, 0.48, 0.36, 0.24, 0.12, 0.012)
EXAMPLE = hs.PrandtlIshlinskii(thresholds=THRESHOLDS, weights=WEIGHTS)
SLIP = hs.MaxwellSlip(stiffness=(4.0, 2.0, 1.0), slips=(0.1, 0.5, 0.2), feedthrough=0.3, offset=0.1)
LAWS = [
    EXAMPLE,
    hs.PrandtlIshlinskii(thresholds=(0.1, 0.3), weights=(1.0, -0.4), offset=0.2, z0=(0.3, 0.2)),
    SLIP,
    hs.Play(threshold=0.2, gain=-2.0, offset=0.1, z0=0.1),
    hs.Stop(threshold=0.2, gain=3.0, offset=0.1, z0=-0.1),
]
ROUNDING = 1e-13  # a few hundred roundings of numbers of order one


def family(law) -> str:
    return type(law).__name__


def literal(law, u) -> tuple[np.ndarray, np.ndarray]:
    """The definition, one play after the other: output and positions."""
    y, positions = [], []
    stops = isinstance(law, hs.Stop | hs.MaxwellSlip)
    thresholds, weights, z0 = (part.tolist() for part in law.elements)
    z = list(z0)
    for value in u.tolist():
        z = [max(value - r, min(value + r, last)) for r, last in zip(thresholds, z, strict=True)]
        total = law.offset + getattr(law, "feedthrough", 0.0) * value
        for w, position in zip(weights, z, strict=True):
            total += w * (value - position if stops else position)
        y.append(total)
        positions.append(z)
    return np.array(y), np.array(positions)


def corners(law, amplitude: float) -> np.ndarray:
    """Three cycles between -amplitude and amplitude, with a sample at each corner of the steady loop."""
    thresholds = law.elements[0]
    inner = (amplitude - 2.0 * thresholds)[(thresholds > 0.0) & (thresholds < amplitude)]
    falling = np.unique(np.concatenate([[-amplitude, 0.0, amplitude], inner]))[::-1]
    cycle = np.concatenate([falling, np.unique(np.append(-inner, [0.0, amplitude]))])
    return np.concatenate([[amplitude], np.tile(cycle[1:], 3)])


@st.composite
def invertible_laws(draw) -> hs.PrandtlIshlinskii:
    """Sums of weights of one sign in [0.2, 3], thresholds at least 0.05 apart, a memory that an input left."""
    sums = np.array(draw(st.lists(st.floats(0.2, 3.0), min_size=1, max_size=6)))
    steps = draw(st.lists(st.floats(0.05, 0.3), min_size=sums.size - 1, max_size=sums.size - 1))
    sign, past = draw(st.sampled_from([1.0, -1.0])), draw(short_inputs(1.0))
    law = hs.PrandtlIshlinskii(
        thresholds=np.cumsum([0.0, *steps]),
        weights=sign * np.diff(sums, prepend=0.0),
        offset=draw(st.floats(-1.0, 1.0)),
    )
    return dataclasses.replace(law, z0=law.memory(past)[-1])


# ---------------------------------------------------------------------------------- closed forms


def test_the_published_example_has_its_peak_width_and_area():
    u = corners(EXAMPLE, 4.0)
    loop = hs.loop_metrics(u, EXAMPLE.response(u))
    cycle = EXAMPLE.limit_cycle(4.0)
    exact = {"abs": 1e-12}  # a dozen terms of order ten
    assert EXAMPLE.response(u).max() == pytest.approx(8.2056, **exact)
    assert (cycle.peak, cycle.mid_width, -cycle.energy) == pytest.approx((8.2056, 3.6912, 20.20248), **exact)
    assert (loop.mid_width, loop.area) == pytest.approx((3.6912, 20.20248), **exact)
    assert loop.orientation == "counterclockwise"


def test_the_published_example_has_its_inverse():
    """The initial loading curve of the inverse is the inverse function of the law's, in exact fractions."""
    r, w = [Fraction(9, 20) * k for k in range(7)], [Fraction(str(weight)) for weight in WEIGHTS]
    slopes = [sum(w[: i + 1]) for i in range(7)]
    levels = [sum(w[j] * (r[i] - r[j]) for j in range(i)) for i in range(7)]
    weights = [1 / slopes[0]] + [1 / slopes[i] - 1 / slopes[i - 1] for i in range(1, 7)]
    inverse = EXAMPLE.inverse()
    assert inverse.weights == pytest.approx([float(weight) for weight in weights], abs=1e-12)
    assert inverse.thresholds == pytest.approx([float(level) for level in levels], abs=1e-12)
    printed = (1.388889, -0.631313, -0.20202, -0.092593, -0.046296, -0.019841, -0.001881)
    assert inverse.weights == pytest.approx(printed, abs=6e-7)  # half a unit of the last printed place
    assert inverse.thresholds == pytest.approx((0, 0.324, 0.918, 1.728, 2.7, 3.78, 4.914), abs=1e-12)


@pytest.mark.parametrize("law", LAWS, ids=family)
@pytest.mark.parametrize("amplitude", [0.15, 0.7, 5.0])
def test_the_limit_cycle_is_what_the_path_settles_to(law, amplitude):
    u = corners(law, amplitude)
    y = law.response(u) - law.offset
    cycle, loop = law.limit_cycle(amplitude), hs.loop_metrics(u, y)
    settled = all(law.elements[0] <= amplitude)  # a wider play keeps its place
    assert not settled or y[-1] == pytest.approx(cycle.peak, abs=1e-12)
    assert loop.mid_width == pytest.approx(cycle.mid_width, abs=1e-12)
    assert loop.area == pytest.approx(abs(cycle.energy), abs=1e-11)  # of terms up to 100
    if cycle.energy:
        assert loop.orientation == ("clockwise" if cycle.energy > 0.0 else "counterclockwise")


def test_the_coercive_input_is_where_the_falling_branch_crosses_zero():
    assert hs.Play(threshold=0.25, gain=2.0).limit_cycle(1.0).coercive == -0.25
    assert hs.Stop(threshold=0.25).limit_cycle(1.0).coercive == 0.75
    cycle = EXAMPLE.limit_cycle(4.0)
    assert EXAMPLE.response([-4.0, 4.0, cycle.coercive])[-1] == pytest.approx(0.0, abs=1e-12)


def test_saturation_is_reached_on_a_long_way():
    for law in (hs.Stop(threshold=0.2, gain=3.0), hs.MaxwellSlip(stiffness=(4.0, 2.0), slips=(0.1, 0.5))):
        assert law.response([-50.0, 50.0]) == pytest.approx([-law.saturation, law.saturation], abs=1e-12)
    assert SLIP.limits == (0.4, 1.0, 0.2)
    assert hs.MaxwellSlip.from_limits(stiffness=(4.0, 2.0), limits=(0.4, 1.0)).slips == pytest.approx((0.1, 0.5))


@pytest.mark.parametrize("law", LAWS, ids=family)
def test_the_tangent_is_the_slope_ahead_and_lies_between_its_bounds(law):
    u = np.cumsum(np.random.default_rng(3).normal(size=40)) * 0.3
    z, y = law.memory(u), law.response(u)
    low, high = law.slope_bounds()
    for direction in (-1.0, 1.0):
        slopes = law.tangent(np.full(u.size, direction), z, u)
        assert ((slopes >= low - 1e-14) & (slopes <= high + 1e-14)).all()
        for k in range(u.size):
            ahead, _ = law.advance([u[k] + direction * 1e-6], (u[k], *np.atleast_1d(z[k])))
            # of a step that meets no corner: rounding of order 1e-16 over 1e-6
            assert (ahead[0] - y[k]) / (direction * 1e-6) == pytest.approx(slopes[k], abs=1e-8)


# ---------------------------------------------------------------------------------- the operators' properties


@pytest.mark.parametrize("law", LAWS, ids=family)
@given(u=short_inputs(1.0))
def test_the_definition_to_the_bit(law, u):
    y, z = literal(law, u)
    assert np.array_equal(law.response(u), y)
    assert np.array_equal(law.memory(u).reshape(z.shape), z)


@given(short_inputs(1.0), short_inputs(1.0))
def test_a_larger_turn_wipes_out_the_smaller_ones(first, second):
    both = [EXAMPLE.memory(np.append(past, [4.0, -4.0]))[-1] for past in (first, second)]
    assert np.array_equal(*both)


@given(short_inputs(1.0), short_inputs(1.0))
def test_loops_between_the_same_inputs_are_congruent(first, second):
    loop = np.array([0.3, -0.2, 0.1, -0.1, 0.3])
    a, b = (EXAMPLE.response(np.concatenate([past, [0.3, -0.2], loop]))[-loop.size :] for past in (first, second))
    assert a - a[0] == pytest.approx(b - b[0], abs=ROUNDING)


@pytest.mark.parametrize("law", LAWS, ids=family)
@given(u=short_inputs(1.0), data=st.data())
def test_cut_or_stepped_it_has_the_same_bits(law, u, data):
    assert_cut_or_stepped_it_has_the_same_bits(law, u, data.draw(st.integers(0, u.size)))


@given(short_inputs(1.0), st.integers(0, 1000), st.booleans())
def test_batch_is_the_path_to_the_bit(u, seed, own_inputs):
    rng = np.random.default_rng(seed)
    sets = {
        "thresholds": np.cumsum(rng.uniform(0.05, 0.3, (3, 4)), axis=1),
        "weights": rng.normal(size=(3, 4)),
        "offset": rng.normal(size=3),
        "z0": rng.normal(size=(3, 1)),
    }
    assert_batch_has_the_bits_of_its_laws(hs.PrandtlIshlinskii, sets, u, own_inputs)


@given(
    st.integers(0, 2**32 - 1),
    st.integers(64, 200),
    st.sampled_from(["walk", "noise", "steps"]),
    st.sampled_from(["at zero", "after a past", "anywhere"]),
    st.integers(0, 40),
)
def test_many_plays_and_stops_are_the_sum_of_their_definitions(seed, plays, motion, before, cut):
    rng = np.random.default_rng(seed)
    r, w = np.sort(rng.choice(1000, plays, replace=False)) / 1000.0, rng.normal(size=plays)
    inputs = {
        "walk": 0.1 * np.cumsum(rng.normal(size=60)),
        "noise": rng.uniform(-1.0, 1.0, 60),
        "steps": rng.integers(-3, 4, 60) / 3.0,
    }
    u, z0 = inputs[motion], rng.uniform(-1.0, 1.0, plays) if before == "anywhere" else np.zeros(plays)
    if before == "after a past":
        z0 = literal(hs.PrandtlIshlinskii(thresholds=r, weights=w), rng.uniform(-1.0, 1.0, 5))[1][-1]
    for law in (
        hs.PrandtlIshlinskii(thresholds=r, weights=w, offset=0.3, z0=z0),
        hs.MaxwellSlip(slips=r + 1e-3, stiffness=w, feedthrough=0.7, z0=z0),
    ):
        y, z = literal(law, u)
        begun, state = law.advance(u[:cut])
        ended, state = law.advance(u[cut:], state)
        within = 1e-15 * plays * (1.0 + np.abs(w).sum())
        assert np.append(begun, ended) == pytest.approx(y, abs=within)
        assert law.response(u) == pytest.approx(y, abs=within)
        assert state[1:] == pytest.approx(z[-1], abs=4e-16 * (1.0 + np.abs(u).max()))


def test_every_law_has_a_batch():
    u = np.sin(np.linspace(0.0, 9.0, 50))
    gains = np.array([1.0, -2.0])
    for law in (hs.Play, hs.Stop):
        rows = law.responses({"threshold": 0.3, "gain": gains}, u)
        assert np.array_equal(rows[1], law(threshold=0.3, gain=-2.0).response(u))
    rows = hs.MaxwellSlip.responses({"slips": [0.1, 0.2], "stiffness": [[1, 2], [3, 4]], "feedthrough": gains}, u)
    law = hs.MaxwellSlip(slips=(0.1, 0.2), stiffness=(3.0, 4.0), feedthrough=-2.0)
    assert np.array_equal(rows[1], law.response(u))
    rows = hs.Dahl.responses({"coulomb": [0.5, 0.7], "stiffness": 2.0}, u)
    assert np.array_equal(rows[1], hs.Dahl(coulomb=0.7, stiffness=2.0).response(u))


@pytest.mark.parametrize("own_inputs", [False, True])
def test_reductions_are_the_measures_of_the_rows(own_inputs):
    rng = np.random.default_rng(0)
    sets = {"thresholds": THRESHOLDS, "weights": rng.uniform(0.1, 1.0, (300, 7))}
    u = hs.signals.triangle(-3.0, 3.0, cycles=2, samples_per_cycle=60)
    inputs = u * np.linspace(0.5, 1.0, 300)[:, np.newaxis] if own_inputs else u
    rows = hs.PrandtlIshlinskii.responses(sets, inputs)
    loops = [hs.loop_metrics(inputs[k] if own_inputs else u, rows[k]) for k in (0, 150, 299)]

    def reduced(name, **others):
        return hs.PrandtlIshlinskii.responses(sets, inputs, reduce=name, **others)[[0, 150, 299]]

    assert reduced("max_width").tolist() == [loop.max_width for loop in loops]
    assert reduced("area").tolist() == [loop.area for loop in loops]
    assert np.array_equal(reduced("final"), rows[[0, 150, 299], -1])
    assert reduced("sse", target=rows[150])[1] == 0.0


def test_play_and_stop_divide_the_input():
    u = np.sin(np.linspace(0.0, 9.0, 50))
    play, stop = hs.Play(threshold=0.4, z0=0.2), hs.Stop(threshold=0.4, z0=0.2)
    assert np.array_equal(stop.response(u), u - play.response(u))
    assert np.array_equal(play.memory(u), play.response(u))


@given(short_inputs(1.0))
def test_maxwell_slip_is_a_sum_of_plays(u):
    assert SLIP.to_prandtl_ishlinskii().response(u) == pytest.approx(SLIP.response(u), abs=ROUNDING)
    again = hs.MaxwellSlip(stiffness=(1.0, 2.0), slips=(0.2, 0.2), z0=(0.1, 0.1)).to_prandtl_ishlinskii()
    assert again.thresholds == (0.0, 0.2)
    assert again.weights == (3.0, -3.0)


def test_dahl_is_bouc_wen_under_other_names():
    u = np.sin(np.linspace(0.0, 9.0, 50))
    dahl = hs.Dahl(stiffness=3.0, coulomb=0.7, offset=0.2, z0=-0.1)
    law = hs.BoucWen(A=3.0, beta=3.0 / 0.7, gamma=0.0, n=1.0, offset=0.2, z0=-0.1)
    assert np.array_equal(dahl.response(u), law.response(u))
    assert dahl.saturation == pytest.approx(law.saturation)
    assert dahl.limit_cycle(1.0) == law.limit_cycle(1.0)
    assert dahl.inverse_response(dahl.response(u), u0=u[0]) == pytest.approx(u, abs=1e-9)  # flat near saturation
    assert hs.Dahl(stiffness=2.0, coulomb=0.5).tangent(1.0, 0.25) == 1.0


# ---------------------------------------------------------------------------------- the inverse


@given(invertible_laws(), short_inputs(1.0))
def test_the_inverse_undoes_the_response_and_the_other_way_round(law, u):
    y = law.response(u)
    assert law.inverse_response(y) == pytest.approx(u, abs=1e-11 * max(np.ptp(u), 1.0))
    wanted = 3.0 * u + law.offset
    assert law.response(law.inverse().response(wanted)) == pytest.approx(wanted, abs=1e-11 * max(np.ptp(wanted), 1.0))
    again = law.inverse().inverse()
    assert again.thresholds == pytest.approx(law.thresholds, abs=1e-11)
    assert again.response(u) == pytest.approx(y, abs=1e-11 * max(np.ptp(y), 1.0))


@given(invertible_laws(), short_inputs(1.0), short_inputs(1.0))
def test_the_inverse_continues_from_a_state(law, past, u):
    _, state = law.advance(past)
    y, _ = law.advance(u, state)
    assert law.inverse_response(y, state=state) == pytest.approx(u, abs=1e-11 * max(np.ptp(u), 1.0))
    rested = law.response(np.append(0.5, u))[1:]
    assert law.inverse_response(rested, u0=0.5) == pytest.approx(u, abs=1e-11 * max(np.ptp(u), 1.0))


def test_springs_beside_one_that_does_not_slip_have_an_inverse():
    u = np.sin(np.linspace(0.0, 9.0, 50))
    assert SLIP.to_prandtl_ishlinskii().inverse_response(SLIP.response(u)) == pytest.approx(u, abs=1e-11)
    without = dataclasses.replace(SLIP, feedthrough=0.0).to_prandtl_ishlinskii()
    assert not without.is_invertible()


def test_an_input_that_stands_still_does_so_behind_the_inverse():
    u = np.repeat([0.0, 1.0, 0.2, 0.9], 3)
    assert np.array_equal(*EXAMPLE.inverse_response(EXAMPLE.response(u)).reshape(4, 3)[:, :2].T)


test_a_law_without_an_inverse_is_refused = refused(
    (hs.PrandtlIshlinskii(thresholds=(0.1,), weights=(1.0,)), "threshold zero"),
    (hs.PrandtlIshlinskii(), "threshold zero"),
    (hs.PrandtlIshlinskii(thresholds=(0.0, 0.1, 0.2), weights=(1.0, -2.0, 3.0)), r"come to -1 for i = 1"),
    (hs.PrandtlIshlinskii(thresholds=(0.0, 0.1), weights=(0.0, 1.0)), "come to 0 for i = 0"),
    (hs.PrandtlIshlinskii(thresholds=(0.0, 0.1, 0.2), weights=(1.0, 1.0, 1.0), z0=(0.0, 0.5, 0.0)), "plays 1 and 2"),
    call=lambda law: law.inverse(),
)


# ---------------------------------------------------------------------------------- identification


def record_of(law, seed: int = 0, **others) -> hs.Record:
    """Three cycles of decaying amplitude from zero."""
    u = np.concatenate([[0.0], np.repeat([4.0, 3.0, 2.0], 2) * [1, -1, 1, -1, 1, -1]])
    u = np.interp(np.arange(0.0, 6.01, 0.05), np.arange(7), u)
    return hs.Record(u=u, y=law.response(u), **others)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_weights_come_back_from_clean_data(sign):
    law = hs.PrandtlIshlinskii(thresholds=THRESHOLDS, weights=np.multiply(sign, WEIGHTS), offset=0.3)
    fit = hs.identify(hs.PrandtlIshlinskii.structure(thresholds=THRESHOLDS), record_of(law), initial="rest")
    assert fit.model.weights == pytest.approx(law.weights, abs=1e-11)  # rounding times the condition, 1e3
    assert fit.model.offset == pytest.approx(0.3, abs=1e-11)
    assert fit.n_parameters == 8
    assert fit.model.thresholds == law.thresholds


def test_weights_of_both_signs_come_back_from_a_start_that_has_them():
    law = hs.PrandtlIshlinskii(thresholds=(0.0, 0.5, 1.0), weights=(1.0, -0.3, 0.4))
    fit = hs.identify(law, record_of(law), initial="rest")
    assert fit.model.weights == pytest.approx(law.weights, abs=1e-12)


def test_a_class_takes_ten_plays_over_half_the_span():
    fit = hs.identify(hs.PrandtlIshlinskii, record_of(EXAMPLE), initial="rest")
    assert fit.model.thresholds == pytest.approx(np.linspace(0.0, 4.0, 10, endpoint=False))
    assert min(fit.model.weights) >= 0.0
    assert fit.model.is_invertible()
    assert fit.fit_percent > 99.0


def test_a_clockwise_loop_gets_stops():
    law = hs.MaxwellSlip(stiffness=(2.0, 1.0), slips=(0.5, 1.5), feedthrough=0.2, offset=-0.1)
    fit = hs.identify(hs.MaxwellSlip.structure(slips=(0.5, 1.0, 1.5)), record_of(law), initial="rest")
    assert fit.model.stiffness == pytest.approx((2.0, 0.0, 1.0), abs=1e-12)
    assert fit.model.feedthrough == pytest.approx(0.2, abs=1e-12)
    plays = hs.identify(hs.PrandtlIshlinskii.structure(thresholds=(0.0, 0.5, 1.5)), record_of(law), initial="rest")
    assert plays.model.weights == pytest.approx((3.2, -2.0, -1.0), abs=1e-12)


def test_the_former_turning_point_comes_back():
    law = hs.PrandtlIshlinskii(thresholds=(0.0, 0.5, 1.0, 1.5), weights=(1.0, 0.5, 0.3, 0.2))
    u = np.append(2.5, record_of(law).u)  # rest, 2.5, and then the record at 0
    record = hs.Record(u=u[1:], y=law.response(u)[1:])
    fit = hs.identify(law, record, initial="free")
    assert fit.estimates["turn"] >= 2.5 - 1e-9
    assert fit.model.weights == pytest.approx(law.weights, abs=1e-9)  # where the polish ends
    assert fit.model.response(record.u) == pytest.approx(record.y, abs=1e-9)


@pytest.mark.parametrize("family", [hs.Play, hs.Stop])
def test_a_single_element_comes_back(family):
    fit = hs.identify(family, record_of(family(threshold=0.7, gain=-2.0, offset=0.3, z0=0.4)))
    assert (fit.model.threshold, fit.model.gain, fit.model.offset) == pytest.approx((0.7, -2.0, 0.3), abs=1e-7)
    assert fit.model.z0 == pytest.approx(0.4, abs=1e-7)  # where the polish ends


def test_dahl_comes_back():
    law = hs.Dahl(stiffness=3.0, coulomb=0.7, offset=0.2, z0=-0.1)
    fit = hs.identify(hs.Dahl, record_of(law))
    for name in ("stiffness", "coulomb", "offset", "z0"):
        assert fit.estimates[name] == pytest.approx(getattr(law, name), abs=1e-7)  # where the polish ends


def test_a_freed_threshold_is_found_between_its_neighbours():
    law = hs.PrandtlIshlinskii(thresholds=(0.0, 0.6, 1.5), weights=(1.0, 0.5, 0.3))
    start = hs.PrandtlIshlinskii(thresholds=(0.0, 0.8, 1.5), weights=(1.0, 1.0, 1.0))
    fit = hs.identify(start, record_of(law), free=("thresholds[1]",), initial="rest")
    assert fit.model.thresholds == pytest.approx(law.thresholds, abs=1e-7)  # where the polish ends


@pytest.mark.parametrize(
    ("law", "names"),
    [
        (EXAMPLE, {"thresholds": "thresholds", "weights": "weights"}),
        (SLIP, {"slips": "thresholds", "stiffness": "weights"}),
    ],
    ids=family,
)
@pytest.mark.parametrize("offset", [0.0, 30.0])
def test_the_steady_memory_repeats(law, names, offset):
    period = offset + np.array([0.0, 2.0, 1.5, 1.8, -1.0])
    record = hs.Record(u=period, y=np.zeros(5))
    space = law.search_space(record, Freedom(initial="periodic"))
    parameters = {**space.parameters(np.zeros((1, 0)))}
    assert space.state == ("turn",)
    steady = law.steady(parameters, record)
    z0 = np.stack([steady[f"z0[{k}]"] for k in range(len(law.z0))], axis=1)
    assert np.array_equal(law.steady(steady, record)["z0[0]"], steady["z0[0]"])
    numbers = {name: float(np.ravel(value)[0]) for name, value in steady.items()}
    linear = dict.fromkeys(space.columns, 1.0)
    twice = law.assemble(numbers | linear).response(np.tile(period, 2)).reshape(2, -1)
    assert np.array_equal(*twice)
    assert np.array_equal(law.regressors(steady, record), law.regressors(steady | {"turn": 7.0}, record))
    assert z0.shape == (1, len(law.z0))


def test_the_steady_state_of_single_laws_repeats():
    period = np.array([0.0, 2.0, 1.5, 1.8, -1.0])
    record = hs.Record(u=period, y=np.zeros(5))
    for law in (hs.Play(threshold=0.6), hs.Stop(threshold=0.6), hs.Dahl(stiffness=0.5, coulomb=2.0)):
        steady = law.assemble(law.steady(dataclasses.asdict(law), record))
        first, second = steady.response(np.tile(period, 2)).reshape(2, -1)
        assert second == pytest.approx(first, abs=1e-14)  # Dahl's is a quotient, the others are to the bit


# ---------------------------------------------------------------------------------- arguments


test_wrong_arguments_are_named = refused(
    (lambda: hs.Play(threshold=-1.0), "threshold must not be negative, got -1"),
    (lambda: hs.PrandtlIshlinskii(thresholds=(0, 1), weights=(1,)), "equally long, got 2, 1 and 2"),
    (lambda: hs.PrandtlIshlinskii(thresholds=(0, 0), weights=(1, 1)), "thresholds must increase"),
    (lambda: hs.PrandtlIshlinskii(thresholds=(0, 1), weights=(1, 1), z0=(1, 2, 3)), "2, 2 and 3"),
    (lambda: hs.MaxwellSlip.from_limits(stiffness=(1, 2), limits=(1, -1)), "has its sign"),
    (lambda: hs.MaxwellSlip.from_limits(stiffness=(1, 2), limits=(1,)), "equally long"),
    (lambda: hs.Dahl(coulomb=0.0), "coulomb must be positive"),
    (lambda: hs.Dahl.responses({"stiffness": [1.0, -1.0]}, [0.0]), "stiffness must be positive"),
    (lambda: hs.Dahl.responses({"A": 1.0}, [0.0]), TypeError, "unknown parameter 'A'"),
    (lambda: EXAMPLE.response([0.0, np.nan]), "u must be finite"),
    (lambda: EXAMPLE.advance([0.0], (0.0, 1.0)), "must hold 8 numbers, got 2"),
    (lambda: EXAMPLE.tangent(0.0, np.zeros(7), 0.0), "two slopes"),
    (lambda: EXAMPLE.limit_cycle(0.0), "amplitude must be positive"),
    (lambda: EXAMPLE.inverse_response([0.0], u0=0.0, state=(0.0,)), "not both"),
    (lambda: hs.Play.responses({"r": 1.0}, [0.0]), TypeError, "unknown parameter 'r'"),
    (lambda: hs.PrandtlIshlinskii.responses({"weights[9]": 1.0}, [0.0]), r"weights\[9\] is beyond the"),
    (lambda: hs.Play.responses({"threshold": [[1.0]]}, [0.0]), "too many axes"),
    (lambda: hs.Play.responses({"threshold": [1.0, -2.0]}, [0.0]), "negative"),
    (lambda: hs.Play.responses({"gain": [1, 2], "z0": [1, 2, 3]}, [0.0]), "one length or length 1"),
    (lambda: hs.PrandtlIshlinskii.structure(plays=0), "at least 1"),
    (lambda: hs.PrandtlIshlinskii.structure(plays=2.0), TypeError, "plays must be a whole number"),
    (lambda: hs.PrandtlIshlinskii.structure(thresholds=(1, 0)), "increase"),
)


def test_nothing_in_nothing_out():
    assert EXAMPLE.response([]).size == 0
    many = {"thresholds": np.arange(80.0), "weights": np.ones((3, 80))}
    assert hs.PrandtlIshlinskii.responses(many, []).shape == (3, 0)
    assert EXAMPLE.advance([], (1.0, *EXAMPLE.z0))[1] == (1.0, *EXAMPLE.z0)
    assert hs.PrandtlIshlinskii(offset=2.0).response([0.0, 1.0]).tolist() == [2.0, 2.0]
