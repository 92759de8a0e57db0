"""The extensions of the Prandtl-Ishlinskii law, and the memory of plays as that of former turning points."""

import dataclasses
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import assert_cut_or_stepped_it_has_the_same_bits, assert_refused, refused, short_inputs

import hysim as hs
from hysim.identification._descent import Descent
from hysim.identification._noise import Gaussian
from hysim.identification._problem import problem
from hysim.identification._uncertainty import loop_widths, width_stderr
from hysim.identification.marquardt import least_squares
from hysim.models.search_space import ALL_FREE, Freedom

CLOSE = 1e-11  # of the range, what is promised; some ten roundings are what is measured
ROUNDING = 1e-14  # a few dozen roundings of numbers of order one
STEP = 0.5  # sample time [s]
PLAYS = {"thresholds": (0.0, 0.3, 0.7), "weights": (1.0, 0.5, -0.3)}
MODIFIED = hs.ModifiedPrandtlIshlinskii(
    **PLAYS, dead_zones=(-0.5, 0.0, 0.4, 0.6), dead_zone_weights=(0.5, 1.0, -0.4, 0.3), offset=0.2, z0=(0.0, 0.1, 0.2)
)
TANH = (1.0, 0.8, 0.1, 0.2, 0.3)
ONE = hs.GeneralizedPrandtlIshlinskii(**PLAYS, left=TANH, offset=0.2, z0=(0.0, 0.1, 0.2))
TWO = hs.GeneralizedPrandtlIshlinskii(
    thresholds=(0.0, 0.3, 0.7), weights=(1.0, 0.5, 0.3), left=TANH, right=(1.1, 0.8, 0.2, 0.5, 0.3), offset=-0.1
)
RATE = hs.RateDependentPrandtlIshlinskii(**PLAYS, beta=0.1, offset=0.2, z0=(0.0, 0.1, 0.2))
LAWS = {"dead zones": MODIFIED, "one envelope": ONE, "two envelopes": TWO, "speed": RATE}
every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
rate_independent = pytest.mark.parametrize("law", [MODIFIED, ONE, TWO], ids=list(LAWS)[:3])


def timed(law) -> tuple[float, ...]:
    """What the law's methods take beside the input."""
    return (STEP,) if isinstance(law, hs.RateDependentPrandtlIshlinskii) else ()


def named_time(law) -> dict[str, float]:
    return {"sample_time": STEP} if timed(law) else {}


def gamma(coefficients, u: float) -> float:
    a0, a1, a2, a3, a4 = coefficients
    return a0 * math.tanh(a1 * u + a2) + a3 + a4 * u


def dead_zone(d: float, x: float) -> float:
    return x if d == 0.0 else max(x - d, 0.0) if d > 0.0 else min(x - d, 0.0)


def literal(law, u) -> tuple[np.ndarray, np.ndarray]:
    """The definitions, one play after the other: output and positions."""
    z, last, y, positions = list(law.z0), u[0], [], []
    for value in u.tolist():
        below = above = value
        if isinstance(law, hs.GeneralizedPrandtlIshlinskii):
            below, above = gamma(law.left, value), gamma(law.right or law.left, value)
        speed = abs(value - last) / STEP
        for i, r in enumerate(law.thresholds):
            rho = r + law.beta * speed if r > 0.0 and isinstance(law, hs.RateDependentPrandtlIshlinskii) else r
            z[i] = max(below - rho, min(above + rho, z[i]))
        x = sum(w * position for w, position in zip(law.weights, z, strict=True))
        if isinstance(law, hs.ModifiedPrandtlIshlinskii):
            x = sum(c * dead_zone(d, x) for d, c in zip(law.dead_zones, law.dead_zone_weights, strict=True))
        y.append(law.offset + x)
        positions.append(list(z))
        last = value
    return np.array(y), np.array(positions)


@st.composite
def invertible_plays(draw) -> dict:
    """Sums of weights of one sign in [0.2, 3], thresholds at least 0.05 apart, a memory that an input left."""
    sums = np.array(draw(st.lists(st.floats(0.2, 3.0), min_size=1, max_size=5)))
    steps = draw(st.lists(st.floats(0.05, 0.3), min_size=sums.size - 1, max_size=sums.size - 1))
    law = hs.PrandtlIshlinskii(
        thresholds=np.cumsum([0.0, *steps]), weights=draw(st.sampled_from([1.0, -1.0])) * np.diff(sums, prepend=0.0)
    )
    past = draw(short_inputs(1.0))
    return {
        "thresholds": law.thresholds,
        "weights": law.weights,
        "offset": draw(st.floats(-1.0, 1.0)),
        "z0": law.memory(past)[-1],
    }


@st.composite
def broken_lines(draw) -> dict:
    """Dead zones whose sums of weights have one sign outwards from zero."""
    sign, centre = draw(st.sampled_from([1.0, -1.0])), draw(st.floats(0.2, 3.0))
    sides = []
    for side in (-1.0, 1.0):
        sums = draw(st.lists(st.floats(0.2, 3.0), max_size=3))
        steps = draw(st.lists(st.floats(0.05, 0.5), min_size=len(sums), max_size=len(sums)))
        weights = np.diff([centre, *sums])
        sides.append(sorted(zip((side * np.cumsum(steps)).tolist(), (sign * weights).tolist(), strict=True)))
    zones = [*sides[0], (0.0, sign * centre), *sides[1]]
    return {"dead_zones": [d for d, _ in zones], "dead_zone_weights": [c for _, c in zones]}


envelopes = st.builds(
    lambda height, bend, phase, level, line: (height, bend, phase, level, line),
    *(st.floats(0.2, 2.0), st.floats(0.2, 1.5), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.0, 1.0)),
)  # slopes above 0.2 * 0.2 / cosh(2.5)^2 = 1e-3 for inputs within 1


# ---------------------------------------------------------------------------------- the definitions


@every_law
@given(u=short_inputs(1.0))
def test_the_definition(law, u):
    y, z = literal(law, u)
    assert law.response(u, *timed(law)) == pytest.approx(y, abs=ROUNDING)
    assert law.memory(u, *timed(law)) == pytest.approx(z, abs=ROUNDING)


@given(invertible_plays(), short_inputs(1.0))
def test_without_its_extension_each_law_is_the_plain_one_to_the_bit(plays, u):
    plays |= {"offset": 0.0}
    y, z = (getattr(hs.PrandtlIshlinskii(**plays), verb)(u) for verb in ("response", "memory"))
    for family in (hs.ModifiedPrandtlIshlinskii, hs.GeneralizedPrandtlIshlinskii, hs.RateDependentPrandtlIshlinskii):
        law = family(**plays)
        assert np.array_equal(law.response(u, *timed(law)), y)
        assert np.array_equal(law.memory(u, *timed(law)), z)


@rate_independent
@given(u=short_inputs(1.0), extra=st.integers(1, 4))
def test_samples_on_the_way_change_nothing_to_the_bit(law, u, extra):
    fine = np.append(np.linspace(u[:-1], u[1:], extra + 1, endpoint=False, axis=1).ravel(), u[-1])
    assert np.array_equal(law.response(fine)[:: extra + 1], law.response(u))


def test_a_faster_input_widens_the_loop_by_what_the_thresholds_grow():
    """A play of the threshold r + beta v has the mid width of min(rho, X - rho) each way."""
    u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=40)
    law = hs.RateDependentPrandtlIshlinskii(thresholds=(0.0, 0.2), weights=(1.0, 1.0), beta=0.1)
    for sample_time in (0.1, 0.2, 1.0):
        loop = hs.loop_metrics(u, law.response(u, sample_time))
        assert loop.mid_width == pytest.approx(2.0 * (0.2 + 0.1 * 0.1 / sample_time), abs=ROUNDING)
    still = hs.RateDependentPrandtlIshlinskii(thresholds=(0.0, 0.2), weights=(1.0, 1.0))
    assert np.array_equal(law.at(math.inf).response(u), still.response(u, 1.0))
    assert np.array_equal(law.response(u, 0.1, speed=np.zeros(u.size)), still.response(u, 1.0))


def test_envelopes_saturate_and_set_the_branches_apart():
    far = np.array([-50.0, 50.0, -50.0])
    law = dataclasses.replace(ONE, left=(1.0, 0.8, 0.1, 0.2, 0.0), weights=(1.0, 0.5, 0.3), offset=0.0)
    assert law.response(far)[1:] == pytest.approx(  # tanh is one there; each play stops r short of the envelope
        [1.8 * 1.2 - 0.5 * 0.3 - 0.3 * 0.7, 1.8 * -0.8 + 0.5 * 0.3 + 0.3 * 0.7], abs=ROUNDING
    )
    u = hs.signals.triangle(-1.0, 1.0, cycles=2, samples_per_cycle=40)
    y = hs.GeneralizedPrandtlIshlinskii(thresholds=(0.0,), weights=(1.0,), left=TWO.left, right=TWO.right).response(u)
    gap = 10  # samples after a reversal: more than it takes from one envelope to the other
    assert y[-41 + gap : -20] == pytest.approx([gamma(TWO.left, value) for value in u[-41 + gap : -20]], abs=ROUNDING)
    assert y[-20 + gap :] == pytest.approx([gamma(TWO.right, value) for value in u[-20 + gap :]], abs=ROUNDING)
    assert np.ptp(y[-20:-18]) == 0.0


# ---------------------------------------------------------------------------------- the same bits


@every_law
@given(u=short_inputs(1.0), data=st.data())
def test_cut_or_stepped_it_has_the_same_bits(law, u, data):
    assert_cut_or_stepped_it_has_the_same_bits(law, u, data.draw(st.integers(0, u.size)), **named_time(law))


@every_law
@pytest.mark.parametrize("own_inputs", [False, True])
def test_batch_is_the_path_to_the_bit(law, own_inputs):
    u = np.sin(np.linspace(0.0, 9.0, 50))
    inputs = u * np.array([[1.0], [0.7], [-0.3]]) if own_inputs else u
    sets = dataclasses.asdict(law) | {"offset": np.array([0.0, 0.1, 0.2]), "weights": np.outer([1, 2, -1], law.weights)}
    rows = type(law).responses(sets, inputs, *timed(law), workers=2)
    for k in range(3):
        one = dataclasses.replace(law, offset=sets["offset"][k], weights=sets["weights"][k])
        assert np.array_equal(rows[k], one.response(inputs[k] if own_inputs else u, *timed(law)))
    final = type(law).responses(sets, inputs, *timed(law), reduce="final")
    assert np.array_equal(final, rows[:, -1])


@every_law
def test_a_loop_takes_the_law(law):
    u = np.sin(np.linspace(0.0, 9.0, 50)) + 0.3
    plant = hs.Actuator(hysteresis=law)
    assert np.array_equal(plant.response(u, STEP), law.response(u, *timed(law)))
    run = hs.close_loop(law, hs.PID(kp=0.2, ki=0.2), STEP * np.arange(50), u, u0=0.1)
    ways = np.append(0.1, run.command)
    expected = plant.response(ways, STEP)
    assert np.append(run.y, expected[-1])[1:] == pytest.approx(expected[1:], abs=ROUNDING)
    assert np.array_equal(run.z, law.memory(ways, *timed(law))[:-1])


# ---------------------------------------------------------------------------------- the inverses


@given(invertible_plays(), broken_lines(), short_inputs(1.0))
def test_the_inverse_of_dead_zones_undoes_the_response_and_the_other_way_round(plays, zones, u):
    law = hs.ModifiedPrandtlIshlinskii(**plays, **zones)
    assert law.is_invertible()
    undone(law, u, abs=CLOSE)


@given(invertible_plays(), envelopes, short_inputs(1.0))
def test_the_inverse_behind_one_envelope_undoes_the_response(plays, left, u):
    law = hs.GeneralizedPrandtlIshlinskii(**plays, left=left)
    y = law.response(u)
    found = law.inverse_response(y)
    assert law.response(found) == pytest.approx(y, abs=CLOSE)
    assert found == pytest.approx(u, abs=1e-10)  # roundings of y over slopes down to 2e-4
    plain = hs.PrandtlIshlinskii(**plays).inverse_response(y)  # gamma^-1 of the plain inverse
    assert [gamma(left, value) for value in found] == pytest.approx(plain, abs=CLOSE)


@given(invertible_plays(), envelopes, st.floats(0.0, 0.5), short_inputs(1.0))
def test_the_inverse_behind_two_envelopes_gives_an_input_that_gives_the_output(plays, left, gap, u):
    right = (*left[:3], left[3] + gap, left[4])
    plays |= {"weights": np.abs(plays["weights"]) + 0.1, "z0": (0.0,)}
    law = hs.GeneralizedPrandtlIshlinskii(**plays, left=left, right=right)
    y = law.response(u)
    assert law.response(law.inverse_response(y)) == pytest.approx(y, abs=CLOSE)


@given(invertible_plays(), st.floats(0.0, 0.9), short_inputs(1.0))
def test_the_inverse_of_growing_thresholds_undoes_the_response(plays, share, u):
    sums = np.cumsum(plays["weights"])
    lags = np.abs(sums - sums[0])
    longest = (np.abs(sums) / np.where(lags > 0.0, 2.0 * lags, 0.5 * np.abs(sums))).min()
    law = hs.RateDependentPrandtlIshlinskii(**plays, beta=share * longest * STEP)
    assert law.is_invertible(STEP)
    undone(law, u, abs=CLOSE / (1.0 - share) ** 2)  # an error is passed on, the less the shorter the share


@given(invertible_plays(), st.floats(0.0, 3.0), short_inputs(1.0), st.integers(0, 1000))
def test_the_analytic_inverse_holds_at_any_known_speed(plays, beta, u, seed):
    law = hs.RateDependentPrandtlIshlinskii(**plays, beta=beta)
    speed = np.random.default_rng(seed).exponential(size=u.size)
    y = law.response(u, STEP, speed=speed)
    assert law.inverse_response(y, STEP, speed=speed) == pytest.approx(u, abs=CLOSE)
    wanted = 3.0 * u + law.offset
    back = law.inverse().response(wanted, STEP, speed=speed)
    assert law.response(back, STEP, speed=speed) == pytest.approx(wanted, abs=CLOSE)


@every_law
@given(past=short_inputs(1.0), u=short_inputs(1.0))
def test_the_inverse_continues_from_a_state(law, past, u):
    _, state = law.advance(past, **named_time(law))
    y, _ = law.advance(u, state, **named_time(law))
    found = law.inverse_response(y, *timed(law), state=state)
    assert law.advance(found, state, **named_time(law))[0] == pytest.approx(y, abs=CLOSE)
    rested = law.response(np.append(0.5, u), *timed(law))[1:]
    again = law.inverse_response(rested, *timed(law), u0=0.5)
    assert law.response(np.append(0.5, again), *timed(law))[1:] == pytest.approx(rested, abs=CLOSE)


@every_law
def test_an_output_that_stands_still_needs_an_input_that_does(law):
    u = np.repeat([0.0, 0.8, 0.2, 0.9], 3)
    found = law.inverse_response(law.response(u, *timed(law)), *timed(law))
    assert found.reshape(4, 3)[:, 2] == pytest.approx(found.reshape(4, 3)[:, 1], abs=1e-14)  # a rounding of y
    if law is not TWO:
        assert found == pytest.approx(u, abs=CLOSE)


def undone(law, u, **tolerance) -> None:
    y = law.response(u, *timed(law))
    assert law.inverse_response(y, *timed(law)) == pytest.approx(u, **tolerance)
    wanted = 3.0 * u + law.offset
    found = law.inverse_response(wanted, *timed(law))
    assert law.response(found, *timed(law)) == pytest.approx(wanted, **tolerance)


@pytest.mark.parametrize(
    ("law", "changed", "message"),
    [
        (MODIFIED, {"weights": (1.0, -2.0, 3.0)}, "come to -1 for i = 1"),
        (MODIFIED, {"dead_zones": (-0.5, 0.1, 0.4, 0.6)}, "dead zone of threshold zero"),
        (MODIFIED, {"dead_zone_weights": (-2.0, 1.0, 0.0, 0.0)}, r"weight -2 of the dead zone -0\.5 they come to -1"),
        (MODIFIED, {"dead_zone_weights": (0.0, 1.0, 1.0, -2.0)}, r"-2 of the dead zone 0\.6 .* to 0"),
        (MODIFIED, {"z0": (0.0, 0.0, 5.0)}, "no input leads to the positions"),
        (ONE, {"thresholds": (0.1, 0.3, 0.7)}, "threshold zero"),
        (ONE, {"z0": (0.0, 0.0, 5.0)}, "no input leads to the positions"),
        (TWO, {"weights": (1.0, 0.5, -0.3)}, "two envelopes its weights must have one sign"),
        (RATE, {"beta": 1.0}, r"no stable inverse at this sample time: .* 1\.5 for i = 1; give the speed"),
        (RATE, {"weights": (1.0, -2.0, 3.0)}, "come to -1 for i = 1"),
    ],
)
def test_a_law_without_an_inverse_is_refused(law, changed, message):
    law = dataclasses.replace(law, **changed)
    assert not law.is_invertible(*timed(law)) or law.z0[2] == 5.0
    assert_refused(message, law.inverse_response, [0.0, 1.0], *timed(law))


def test_an_output_beyond_the_envelope_is_named():
    law = hs.GeneralizedPrandtlIshlinskii(thresholds=(0.0,), weights=(2.0,), left=(1.0, 1.0, 0.0, 0.0, 0.0))
    assert law.inverse_response([0.0, 2.0 * math.tanh(0.5)])[1] == pytest.approx(0.5, abs=1e-15)
    with pytest.raises(hs.SimulationError, match=r"no input gives the output at sample 1 \(y = 2\.5\)"):
        law.inverse_response([1.0, 2.5])


# ---------------------------------------------------------------------------------- identification


def record_of(law) -> hs.Record:
    """Three cycles of decaying amplitude from zero, faster from cycle to cycle."""
    corners = np.concatenate([[0.0], np.repeat([4.0, 3.0, 2.0], 2) * [1, -1, 1, -1, 1, -1]])
    times = np.cumsum([0.0, 20.0, 40.0, 20.0, 20.0, 10.0, 10.0])
    u = np.interp(np.arange(0.0, 120.1, 1.0), times, corners)
    return hs.Record(t=STEP * np.arange(u.size), u=u, y=law.response(u, *timed(law)))


SPREAD = {"thresholds": (0.0, 0.8, 1.6, 2.4), "weights": (1.0, 0.5, 0.3, 0.2), "offset": 0.3}


def test_dead_zones_come_back():
    law = hs.ModifiedPrandtlIshlinskii(**SPREAD, dead_zones=(-2.0, 0.0, 2.0), dead_zone_weights=(0.4, 1.0, -0.3))
    structure = hs.ModifiedPrandtlIshlinskii.structure(thresholds=law.thresholds, dead_zones=law.dead_zones)
    fit = hs.identify(structure, record_of(law))
    assert fit.n_parameters == 7
    assert fit.model.weights == pytest.approx(law.weights, abs=1e-7)  # where the polish ends
    assert fit.model.dead_zone_weights == pytest.approx(law.dead_zone_weights, abs=1e-7)
    again = hs.identify(law, record_of(law), initial="periodic", fixed={"offset": 0.3})
    assert again.n_parameters == 6
    assert set(fit.free_names) - set(again.free_names) == {"offset"}


@pytest.mark.parametrize("envelopes", [1, 2])
def test_envelopes_come_back(envelopes):
    structure = hs.GeneralizedPrandtlIshlinskii.structure(thresholds=SPREAD["thresholds"], envelopes=envelopes)
    record = record_of(hs.PrandtlIshlinskii(**SPREAD))
    true = {"bend": np.array([0.9]), "skew": np.array([0.4])} | ({"lead": np.array([0.3])} if envelopes == 2 else {})
    shape = hs.GeneralizedPrandtlIshlinskii.derived(true, record)
    law = hs.GeneralizedPrandtlIshlinskii(**SPREAD).with_scalars(shape)
    assert [gamma(law.left, end) for end in (-4.0, 4.0)] == pytest.approx([-4.0, 4.0], abs=ROUNDING)
    fit = hs.identify(structure, record_of(law))
    assert fit.model.weights == pytest.approx(law.weights, abs=1e-6)  # where the polish ends
    assert fit.model.left == pytest.approx(law.left, abs=1e-5)
    assert fit.model.right == pytest.approx(law.right, abs=1e-5)
    known = hs.identify(law, record_of(law))
    assert known.n_parameters == 5
    assert known.model.weights == pytest.approx(law.weights, abs=1e-11)  # rounding times the condition, 1e2


def test_the_growth_of_thresholds_comes_back():
    law = hs.RateDependentPrandtlIshlinskii(**SPREAD, beta=0.4)
    record = record_of(law)
    fit = hs.identify(hs.RateDependentPrandtlIshlinskii.structure(thresholds=law.thresholds), record)
    assert fit.model.beta == pytest.approx(0.4, abs=1e-7)  # where the polish ends
    assert fit.model.weights == pytest.approx(law.weights, abs=1e-7)
    assert np.array_equal(hs.simulate(fit.model, record.t, record.u).y, fit.model.response(record.u, STEP))
    assert hs.identify(law, record, fixed={"beta": 0.4}).n_parameters == 5


def test_the_classes_are_identified_and_compared():
    record = hs.datasets.table1(dwell=1.0)
    families = {
        "plain": hs.PrandtlIshlinskii,
        "dead zones": hs.ModifiedPrandtlIshlinskii,
        "envelope": hs.GeneralizedPrandtlIshlinskii,
        "speed": hs.RateDependentPrandtlIshlinskii,
    }
    table = hs.compare(families, record, cross_validate=None)
    assert table["dead zones"].fit_percent > 96.0 > table["plain"].fit_percent
    assert table["envelope"].fit_percent > 96.0
    assert table["speed"].fit_percent >= table["plain"].fit_percent


@every_law
def test_the_steady_memory_repeats(law):
    period = np.array([0.0, 1.0, 0.4, 0.8, -0.6])
    record = hs.Record(t=STEP * np.arange(5), u=period, y=np.cos(period))
    space = law.search_space(record, hs.models.search_space.Freedom(initial="periodic"))
    found = {name: values[0] for name, values in space.parameters(space.starts[:1]).items()}
    numbers = {**law.steady(found, record), **dict.fromkeys(space.columns, 1.0)}
    twice = law.assemble(numbers).memory(np.tile(period, 2), *timed(law)).reshape(2, 5, -1)
    assert twice[1, 1:] == pytest.approx(twice[0, 1:], abs=ROUNDING)  # the first sample has no speed of its own


# ---------------------------------------------------------------------------------- arguments


test_wrong_arguments_are_named = refused(
    (lambda: dataclasses.replace(MODIFIED, dead_zones=(0.0,)), "equally long and not empty, got 1 and"),
    (lambda: dataclasses.replace(MODIFIED, dead_zones=(0, 0, 1, 2)), "dead_zones must increase"),
    (lambda: dataclasses.replace(ONE, left=(1.0, 2.0)), "left must hold 5 coefficients, got 2"),
    (lambda: dataclasses.replace(ONE, right=(1, -1, 0, 0, 2)), "the envelope right must increase"),
    (lambda: dataclasses.replace(ONE, left=(1, 0, 0, 0, 0)), "the envelope left must increase"),
    (lambda: dataclasses.replace(RATE, beta=-1.0), "beta must not be negative, got -1"),
    (lambda: RATE.response([0.0], 0.0), "sample_time must be positive"),
    (lambda: RATE.response([0.0, 1.0], 1.0, speed=[1.0]), "speed must have 2 samples"),
    (lambda: RATE.response([0.0], 1.0, speed=[-1.0]), "speed must not be negative"),
    (lambda: RATE.inverse_response([0.0], 1.0, u0=0.0, speed=[1.0]), "a speed goes with the z0"),
    (lambda: type(RATE).responses({"beta": [1, -1]}, [0.0], 1.0), "beta must not be negative"),
    (lambda: type(RATE).responses({"beta": 1.0}, [0.0], -1.0), "sample_time must be positive"),
    (lambda: ONE.inverse_response([0.0], u0=0.0, state=(0.0,) * 4), "not both"),
    (lambda: ONE.advance([0.0], (0.0, 1.0)), "must hold 4 numbers, got 2"),
    (lambda: type(ONE).structure(envelopes=3), "envelopes must be one of 1, 2"),
    (lambda: type(MODIFIED).structure(dead_zones=-1), "dead_zones must not be negative"),
    (lambda: type(MODIFIED).structure(dead_zones=(1, 0)), "dead_zones must increase"),
    (lambda: hs.identify(MODIFIED, record_of(MODIFIED), initial="free"), 'use initial="rest" or "periodic"'),
    (lambda: hs.identify(RATE, hs.Record(u=[0.0, 1.0, 0.0] * 5, y=np.arange(15.0))), "time"),
)


def test_nothing_in_nothing_out():
    for law in LAWS.values():
        assert law.response([], *timed(law)).size == 0
        assert law.inverse_response([], *timed(law)).size == 0
    assert hs.ModifiedPrandtlIshlinskii(offset=2.0).response([0.0, 1.0]).tolist() == [2.0, 2.0]


# ---------------------------------------------------------- former turning points, and samples that have forgotten them


THRESHOLDS = tuple((0.1 * np.arange(10)).tolist())
LAW = hs.PrandtlIshlinskii(thresholds=THRESHOLDS, weights=(3.0, *(0.8 ** np.arange(9)).tolist()), offset=0.5)
STRUCTURE = hs.PrandtlIshlinskii.structure(thresholds=THRESHOLDS)
NOISE = 1e-3


def through(*corners, samples=30):
    places = np.arange((len(corners) - 1) * samples + 1) / samples
    return np.interp(places, np.arange(len(corners)), corners)


def record_after(past, path, seed=0, noise=NOISE):
    """What is measured on a path, after the law went from rest through the past."""
    y = LAW.response(np.concatenate([past, path]))[len(past) :]
    return hs.Record(u=path, y=y + noise * np.random.default_rng(seed).standard_normal(path.size))


FADING = record_after((-0.95, 0.2), through(0.05, 0.5, -0.3, 0.6, -0.9, 1.0, -1.0, 0.7, -0.6))


def test_a_past_of_two_turns_is_found_by_default():
    fit = hs.identify(STRUCTURE, FADING)
    assert "identified, by 2 numbers (else the BIC is" in fit.message
    assert fit.rmse < 1.05 * NOISE  # of 241 samples, without which the BIC would not be so much lower
    assert fit.estimates["turn"] == pytest.approx(0.2, abs=0.01)
    assert fit.estimates["turn_2"] == pytest.approx(-0.95, abs=0.01)
    assert fit.stderr["turn_2"] < 0.01
    before = hs.PrandtlIshlinskii(thresholds=THRESHOLDS, weights=fit.model.weights)
    past = [fit.estimates["turn_2"], fit.estimates["turn"]]
    assert fit.model.z0 == pytest.approx(before.memory(past)[-1], abs=1e-15)


def test_no_more_turns_than_the_record_shows():
    fit = hs.identify(STRUCTURE, record_after((-0.9,), FADING.u))
    assert fit.estimates["turn"] == pytest.approx(-0.9, abs=0.01)
    assert "turn_2" not in fit.estimates
    assert "numbers" not in fit.message


def test_the_user_may_say_that_the_state_is_free():
    fit = hs.identify(STRUCTURE, FADING, initial="free")
    assert fit.rmse == pytest.approx(hs.identify(STRUCTURE, FADING).rmse, rel=1e-6)  # where the polish ends
    held = hs.identify(STRUCTURE, FADING, initial="free", fixed={"turn": 0.2})
    assert "turn_2" not in held.estimates


@pytest.mark.parametrize("family", [hs.PrandtlIshlinskii, hs.MaxwellSlip])
def test_what_is_forgotten_is_forgotten_to_the_bit(family):
    structure = family.structure(**{"slips" if family is hs.MaxwellSlip else "thresholds": (0.2, 0.5, 0.9)})
    space = structure.search_space(FADING, Freedom(initial="free"))
    first = structure.forgotten(FADING, space)
    ends = np.array([space.lower, space.upper])
    below, above = structure.regressors(space.parameters(ends), FADING)
    assert np.array_equal(below[first:], above[first:])
    assert not np.array_equal(below[first - 1], above[first - 1])
    searched = structure.search_space(FADING, Freedom(free=(f"{family.thresholds_name}[1]",)))
    assert structure.forgotten(FADING, searched) == len(FADING)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("initial", ["free", "rest", "periodic"])
def test_few_rows_have_the_sums_of_squares_of_all_samples(weighted, initial):
    records = [FADING, record_after((0.3,), through(0.2, 1.1, -1.0, 0.5, -0.5, 0.5), seed=2)]
    rng = np.random.default_rng(3)
    family = replace(STRUCTURE, one_signed=False, turns=2)
    whole = problem(family, records, Freedom(fixed={"weights[1]": 0.9}), initial)
    whole = whole.weighted([rng.uniform(0.0, 2.0, len(each)) for each in records]) if weighted else whole
    short = whole.condensed()
    assert short.y.size < 0.7 * whole.y.size
    space = whole.space
    x = space.lower + rng.uniform(size=(20, whole.n_x)) * (space.upper - space.lower)
    assert short.costs(x) == pytest.approx(whole.costs(x), rel=1e-9)
    assert short.completed(x) == pytest.approx(whole.completed(x), rel=1e-9, abs=1e-9)
    shared = problem(replace(family, turns=1), records, Freedom(fixed={"weights[1]": 0.9}), initial)
    again = replace(whole, settled=None).with_settled(whole.with_settled().settled)
    assert again.condensed().costs(x) == pytest.approx(whole.costs(x), rel=1e-9)
    assert shared.space.linear == whole.space.linear


def test_families_without_it_keep_their_samples():
    for family in (hs.PrandtlIshlinskii(thresholds=THRESHOLDS, weights=LAW.weights), hs.BoucWen()):
        free = Freedom(free=("thresholds[1]",)) if isinstance(family, hs.PrandtlIshlinskii) else ALL_FREE
        whole = problem(family, [FADING], free, None)
        assert whole.condensed() is whole


@pytest.mark.parametrize("rank", [9, 12])
def test_triangles_give_the_shortest_solutions(rank):
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((3, 40, rank)) @ rng.standard_normal((3, rank, 12))
    columns[1, 20:] = 0.0
    columns /= np.linalg.norm(columns, axis=1, keepdims=True)
    target = rng.standard_normal((3, 40))
    expected = [np.linalg.lstsq(c, t, rcond=1e-11)[0] for c, t in zip(columns, target, strict=True)]
    assert least_squares(columns, target) == pytest.approx(np.array(expected), abs=1e-10)  # conditions up to 1e4
    few = least_squares(columns[:, :7], target[:, :7])
    expected = [np.linalg.lstsq(c, t, rcond=1e-11)[0] for c, t in zip(columns[:, :7], target[:, :7], strict=True)]
    assert few == pytest.approx(np.array(expected), abs=1e-9)


def test_the_stderr_of_the_width_is_that_of_small_steps():
    u = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=60)
    y = hs.BoucWen(beta=1.2, gamma=0.3, gain=2.0).response(u)
    whole = problem(hs.BoucWen(), [hs.Record(u=u, y=y)], ALL_FREE, None)
    theta = whole.completed(whole.space.starts[-1:])[0]
    root = 1e-3 * np.random.default_rng(0).standard_normal((theta.size, theta.size))
    descent = Descent(whole, Gaussian(1e-14), whole.y[np.newaxis], np.ones((1, whole.y.size)))
    steps = 1e-5 * np.eye(theta.size)
    slope = (loop_widths(descent, theta + steps) - loop_widths(descent, theta - steps)) / 2e-5
    expected = float(np.sqrt(slope @ root @ root.T @ slope))
    assert width_stderr(whole, theta, root @ root.T) == pytest.approx(expected, rel=1e-4)  # of the differences
