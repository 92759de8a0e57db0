"""The inverse of a law gives back the input, and the law gives back the output, to rounding."""

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import COMPILED, assert_refused, bounded_laws, refused, short_inputs

import hysim as hs
from hysim.kernels import boucwen_inverse as kernels
from hysim.kernels._compile import signed_kernel
from hysim.kernels.controllers import CONTROLLER
from hysim.kernels.stepping import drive

CLOSE = 1e-11  # of the range, what is promised; a few roundings are what is measured
STACK = hs.BoucWen(A=0.35, beta=0.02, gamma=0.005, feedthrough=1.0, gain=-1.0)
ASYMMETRIC = hs.PolynomialBoucWen(A=0.4, beta=0.3, gamma=0.1, n=1.4, gain=-0.5, input_coefficients=(1.0, 0.1, 0.05))


@st.composite
def invertible_laws(draw) -> hs.BoucWen:
    """Laws whose slope is between 1e-3 and 1 times its largest for every input, rising or falling."""
    gain = draw(st.sampled_from([-1.0, 1.0])) * draw(st.floats(0.1, 2.0))
    law = replace(draw(bounded_laws()), gain=gain, feedthrough=0.0)
    low, high = law.slope_bounds()
    flattest = draw(st.sampled_from([1e-3, 0.03, 0.5]))
    feedthrough = (flattest * high - low) / (1.0 - flattest)  # then low is `flattest` times high
    turned = draw(st.sampled_from([-1.0, 1.0]))
    return replace(law, feedthrough=turned * feedthrough, gain=turned * law.gain)


def walk(rng: np.random.Generator, n_samples: int) -> np.ndarray:
    """Small steps, large ones, and plateaus."""
    steps = rng.normal(size=n_samples) * rng.choice([0.0, 1e-12, 1e-3, 0.1, 1.0], size=n_samples)
    return np.cumsum(steps) - steps.sum() / 2


@settings(max_examples=20 if COMPILED else 2)
@given(invertible_laws(), st.integers(0, 2**32))
def test_both_ways_on_10000_samples(law, seed):
    u = walk(np.random.default_rng(seed), 10_000 if COMPILED else 100)
    y = law.response(u)
    found = law.inverse_response(y)
    assert np.abs(law.response(found) - y).max() <= CLOSE * np.ptp(y)
    assert np.abs(found - u).max() <= CLOSE * np.ptp(u)
    still = np.diff(y) == 0.0
    assert still.sum() > 0.1 * u.size
    assert (np.diff(found)[still] == 0.0).all()


@given(short_inputs(), st.sampled_from([STACK, ASYMMETRIC]))
def test_short_records_of_a_stack(u, law):
    found = law.inverse_response(law.response(u))
    assert found == pytest.approx(u, abs=1e-13)  # roundings of numbers of order one


@given(invertible_laws(), short_inputs(), st.data())
def test_cut_and_continue_gives_the_same_bits(law, u, data):
    y = law.response(u)
    cut = data.draw(st.integers(1, y.size))
    inverse = law.inverse()
    head, state = inverse.advance(y[:cut])
    tail, end = inverse.advance(y[cut:], state)
    whole, whole_end = inverse.advance(y)
    assert np.array_equal(np.concatenate([head, tail]), whole)
    assert np.array_equal(law.inverse_response(y), whole)
    assert np.array_equal(inverse.response(y), whole)
    assert end == whole_end
    assert np.array_equal(law.inverse_response(y[cut:], state=state), tail)


@given(invertible_laws(), short_inputs())
def test_one_sample_at_a_time_in_a_compiled_loop(law, u):
    y = law.response(u)
    compiled = law.inverse().compiled(y[0])
    found = np.empty(y.size)
    assert drive(compiled.step, compiled.parameters, compiled.state, y, found) == -1
    assert np.array_equal(found, law.inverse_response(y))
    inverse, state, single = law.inverse(), None, []
    for sample in y:
        value, state = inverse.advance(sample, state)
        single.append(float(value))
    assert single == found.tolist()


def test_a_memory_alone_needs_its_first_input():
    """y = z says nothing about the input at which it begins."""
    law = hs.BoucWen(A=1.0, beta=0.6, gamma=0.4, n=1.5, z0=0.2)
    u = 3.0 + np.sin(np.linspace(0.0, 7.0, 200))
    y = law.response(u)
    assert law.inverse_response(y, u0=3.0) == pytest.approx(u, abs=1e-12)  # slopes are above 0.05 here
    assert law.inverse_response(y[1:], state=(3.0, 0.2)) == pytest.approx(u[1:], abs=1e-12)
    assert_refused("give u0", law.inverse_response, y)


def test_from_rest_at_an_input_the_first_sample_is_reached():
    found = STACK.inverse_response([5.0, 5.0, 2.0], u0=0.0)
    assert STACK.response(np.append(0.0, found))[1:] == pytest.approx([5.0, 5.0, 2.0], abs=1e-14)
    assert found[0] == found[1]


def test_laws_whose_memory_grows_without_bound():
    """beta + gamma < 0: the inverse stays on this side of the escape."""
    for n in (1.0, 1.5, 3.0):
        law = hs.BoucWen(beta=0.2, gamma=-0.9, n=n, feedthrough=0.1)
        y = 5.0 * np.sin(np.linspace(0.0, 9.0, 300)) * np.linspace(0.0, 1.0, 300)
        found = law.inverse_response(y)
        assert law.response(found) == pytest.approx(y, abs=1e-10)  # 1e-11 of the range
        # in one stride, past which Newton's first guess escapes; near the escape the slope is up to 1e9
        assert law.response(np.append(0.0, law.inverse_response([1e3], u0=0.0)))[1] == pytest.approx(1e3, rel=1e-9)


def test_other_branches_of_a_polynomial():
    law = hs.PolynomialBoucWen(A=0.1, beta=0.3, gamma=0.1, gain=-0.5, input_coefficients=(1.0, -0.5))  # turns at 0.95
    rising, falling = np.linspace(-1.0, 0.5, 50), np.linspace(3.0, 2.0, 50)
    assert law.inverse_response(law.response(rising)) == pytest.approx(rising, abs=1e-13)
    assert law.inverse_response(law.response(falling), u0=3.0) == pytest.approx(falling, abs=1e-13)
    assert_refused("sample", law.inverse_response, law.response(np.linspace(0.0, 2.0, 60)), error=hs.SimulationError)


def test_a_polynomial_that_turns_twice_between_two_samples_is_refused():
    law = hs.PolynomialBoucWen(A=1.0, beta=0.5, gamma=0.5, gain=0.01, input_coefficients=(1.0, -1.5, 0.55))
    u = np.array([0.0, 2.5])
    assert_refused("sample 1", law.inverse_response, law.response(u), error=hs.SimulationError)


def test_a_polynomial_that_turns_in_the_middle_alone_is_refused_and_one_that_flattens_is_not():
    """c1 + 3 u^2 is steep at both ends, and Newton's method steps over the middle; the bound decides neither."""
    u = np.array([-1.0, 1.0])
    turns, flattens = (
        hs.PolynomialBoucWen(gain=0.01, n=n, input_coefficients=(c1, 0.0, 1.0)) for n, c1 in ((1.5, -0.05), (1.0, 0.1))
    )
    assert_refused("sample 1", turns.inverse_response, turns.response(u), error=hs.SimulationError, u0=-1.0)
    assert flattens.inverse_response(flattens.response(u), u0=-1.0) == pytest.approx(u, abs=1e-14)


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0, 6.0])
def test_a_slope_that_is_not_positive_is_refused_with_its_place(n):
    """Rising is fine up to where the memory bends the output down; the place is between the samples."""
    law = hs.BoucWen(A=1.0, beta=0.6, gamma=0.4, n=n, feedthrough=-0.5)
    u = np.linspace(0.0, 0.49, 20)  # it turns where w^n = 1/2, at u of 0.53 or more
    y = law.response(u)
    assert law.inverse_response(y) == pytest.approx(u, abs=1e-13)
    with pytest.raises(hs.SimulationError, match=r"sample 20 \(y = 2\): at u = .* slope is -?\d"):
        law.inverse_response(np.append(y, 2.0))


def test_the_slope_just_after_a_reversal_is_looked_at():
    law = hs.BoucWen(A=0.9, beta=0.5, gamma=0.1, feedthrough=1.0, gain=-1.0)  # 1 - 1.5 at worst
    for u in ([0.0, 8.0, 7.9], [0.0, 8.0, 9.0]):  # where both ways raise the output, neither can be told
        with pytest.raises(hs.SimulationError, match=r"sample 2 .*u = 8 its slope is -0\.\d+, not positive"):
            law.inverse_response(law.response(u))
    assert not law.is_invertible()


def test_what_cannot_be_reached_is_refused():
    law = hs.BoucWen(A=1.0, beta=0.6, gamma=0.4)
    assert_refused(r"sample 1 \(y = 1\.5\)", law.inverse_response, [0.5, 1.5], error=hs.SimulationError, u0=0.0)
    compiled = law.inverse().compiled(u0=0.0)
    assert np.isnan(compiled.step(compiled.parameters, compiled.state, 1.5))
    # and the state has not moved: the next output is reached as if nothing had been
    again = compiled.step(compiled.parameters, compiled.state, 0.5)
    assert again == law.inverse_response([0.5], u0=0.0)[0]


test_wrong_arguments_are_named = refused(
    (lambda: STACK.inverse_response([0.0, np.nan]), "y must be finite, got nan at index 1"),
    (lambda: STACK.inverse_response([[0.0]]), "1 axis"),
    (lambda: STACK.inverse_response([0.0], u0=0.0, state=(0.0, 0.0)), "not both"),
    (lambda: hs.BoucWen(feedthrough=-1.0).inverse(), "slope is zero"),
    (lambda: ASYMMETRIC.inverse().advance([[1.0]]), "shape"),
)


def test_a_turned_polynomial_has_no_first_input():
    law = hs.PolynomialBoucWen(A=0.1, gain=0.1, input_coefficients=(1.0, 1.0))  # turns at u = -0.5, y = -0.25
    assert_refused("give u0", law.inverse_response, [-0.3], error=hs.SimulationError)


def test_nothing_in_nothing_out():
    assert STACK.inverse_response([]).size == 0
    assert STACK.inverse().advance([])[1] is None
    assert STACK.inverse().advance([], (1.0, 0.2, 0.8))[1] == (1.0, 0.2, 0.8)


def test_the_inverse_is_a_value():
    inverse = STACK.inverse()
    assert inverse == pickle.loads(pickle.dumps(inverse))
    assert hash(inverse) == hash(STACK.inverse())
    assert inverse != ASYMMETRIC.inverse()
    assert inverse.increasing
    assert not hs.BoucWen(gain=-1.0).inverse().increasing


def test_the_inverse_is_a_law_for_simulate():
    u = np.linspace(0.0, 30.0, 20)
    sim = hs.simulate(STACK.inverse(), None, STACK.response(u))
    assert sim.y == pytest.approx(u, abs=1e-12)


@cache
def ahead():
    """The inverse as a controller that does not look at the measurement."""

    @signed_kernel(CONTROLLER.signature)
    def step(parameters, state, reference, measurement):
        state[0] = kernels.step(parameters, state[1:], reference)
        return state[0]

    return step


class Feedforward:
    """The inverse of a law in front of it."""

    def __init__(self, law):
        self.inverse = law.inverse()

    def compiled(self, sample_time, u0, y0):
        _, parameters, state = self.inverse.compiled(u0=u0)
        return ahead(), parameters, np.concatenate([[u0], state])


@pytest.mark.parametrize("law", [STACK, ASYMMETRIC], ids=["stack", "asymmetric"])
def test_in_front_of_its_law_the_inverse_takes_the_hysteresis_away(law):
    t = np.arange(300) / 100.0
    reference = np.sin(3.0 * t) * np.exp(-t / 4.0)
    run = hs.close_loop(law, Feedforward(law), t, reference)
    # a sample late: the loop reads the displacement before it applies the voltage
    assert np.abs(run.y[1:] - reference[:-1]).max() <= CLOSE * np.ptp(reference)
    assert np.ptp(run.z) > 0.1


def test_the_inverse_is_a_plant_of_its_own():
    """A loop around the inverse asks for the displacement whose voltage is the reference: the law's response."""
    t = np.arange(400) / 100.0
    reference = np.sin(2.0 * t)
    run = hs.close_loop(STACK.inverse(), hs.PID(ki=60.0), t, reference)
    assert np.abs(run.error[-100:]).max() < 0.1  # an integrator's lag, 2/60 of the amplitude, and a sample
    assert run.y[1:] == pytest.approx(STACK.inverse_response(np.append(0.0, run.u))[1:-1], abs=1e-13)


FLAT_AT_ZERO = {"A": 1.0, "beta": 0.2, "gamma": 0.6, "gain": -1.0, "feedthrough": 0.95}  # a slope of -0.05 at z = 0


def rising_inverse(law, y):
    """Inputs on the branches on which the output rises with them, nan where there is none."""
    compiled = replace(law.inverse(), increasing=True).compiled(u0=0.0)
    return [compiled.step(compiled.parameters, compiled.state, each) for each in y.tolist()]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_crossing_of_zero_between_two_samples_is_looked_at(side):
    """The slope is positive at both samples, 0.15 and 0.35, and negative where the memory is zero in between."""
    law = hs.BoucWen(**FLAT_AT_ZERO, z0=-0.5 * side)
    u = np.array([0.0, 1.2 * side])
    z = law.memory(u)
    assert z[0] * z[1] < 0.0
    assert (law.tangent(side, z) > 0.1).all()
    assert np.isnan(rising_inverse(law, law.response(u))).tolist() == [False, True]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_where_the_memory_keeps_its_sign_the_slope_at_zero_is_of_no_account(side):
    law = hs.BoucWen(**FLAT_AT_ZERO, z0=0.5 * side)
    u = side * np.array([0.0, 0.3, 0.5, 0.4, 0.9])
    assert (law.memory(u) * side > 0.0).all()
    assert rising_inverse(law, law.response(u)) == pytest.approx(u, abs=1e-14)


@pytest.mark.parametrize(("A", "beta", "gamma"), [(0.3, 0.7, 0.2), (1.1, 0.1, 0.05), (0.7, 2.3, 0.9), (1e3, 0.3, 0.1)])
def test_a_slope_of_zero_on_the_way_back_is_no_negative_one(A, beta, gamma):
    """Where the law is saturated its slope back is f - 2 A beta / (gamma + beta), f the feedthrough."""
    u = np.array([0.0, 1000.0, 1001.0, 1005.0])
    flat = 2.0 * A * beta / (gamma + beta)

    def found(excess):
        law = hs.BoucWen(A=A, beta=beta, gamma=gamma, gain=-1.0, feedthrough=flat * (1.0 + excess))
        return law.inverse_response(law.response(u), u0=0.0)

    for roundings in (-4, -1, 0, 1, 4):
        assert found(roundings * 2.0**-52) == pytest.approx(u, rel=1e-13)
    for excess in (-1e-10, -1e-6):
        assert_refused("not positive", found, excess, error=hs.SimulationError)


@pytest.mark.parametrize("law", [STACK, ASYMMETRIC, hs.BoucWen(n=1.5, gain=0.5, feedthrough=0.2, offset=3.0)])
def test_the_output_is_reached_to_a_few_roundings_of_its_terms(law):
    u = 0.8 * walk(np.random.default_rng(3), 3000 if COMPILED else 300) / 10.0
    y = law.response(u)
    again = law.response(law.inverse_response(y))
    terms = np.abs(y) + np.abs(law.offset) + np.abs(law.gain * law.memory(u)) + np.abs(u)
    assert (np.abs(again - y) <= 4.0 * 2.0**-52 * terms).all()  # 1.2 is measured


@pytest.mark.parametrize(("n", "amplitude"), [(8.0, 75.0), (40.0, 2.0), (50.0, 2.0)])
def test_an_output_that_rises_within_a_rounding_of_the_input_is_passed(n, amplitude):
    """A law without yield far out, where the memory falls back at once when the input turns."""
    law, u = hs.BoucWen(beta=1.0, gamma=-1.0, n=n, feedthrough=0.2), amplitude * np.sin(np.linspace(0.0, 20.0, 600))
    np.testing.assert_allclose(law.response(law.inverse_response(law.response(u), u[0])), law.response(u), rtol=1e-12)
