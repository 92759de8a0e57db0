"""What holds for every law and every input."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import (
    assert_cut_or_stepped_it_has_the_same_bits,
    bounded_laws,
    outputs_of_compiled_steps,
    refused,
    short_inputs,
)

import hysim as hs

ROUNDING = 1e-13  # a few hundred roundings of numbers of order one


@given(bounded_laws(), short_inputs(), st.integers(1, 4))
def test_rate_independence(law, u, extra):
    """Samples put in between, evenly or not, do not change the others."""
    fractions = np.linspace(0.0, 1.0, extra + 2)[:-1] ** 1.5
    fine = np.append((u[:-1, None] + np.diff(u)[:, None] * fractions).ravel(), u[-1])
    coarse_z, fine_z = law.memory(u), law.memory(fine)[:: extra + 1]
    assert fine_z == pytest.approx(coarse_z, abs=ROUNDING)


@given(bounded_laws(), short_inputs())
def test_odd_symmetry(law, u):
    assert np.array_equal(law.memory(-u), -law.memory(u))


@given(bounded_laws(), short_inputs(), st.data())
def test_cut_or_stepped_it_has_the_same_bits(law, u, data):
    assert_cut_or_stepped_it_has_the_same_bits(law, u, data.draw(st.integers(0, u.size)))


@given(bounded_laws(), short_inputs())
def test_plateaus_change_nothing(law, u):
    assert np.array_equal(law.response(np.repeat(u, 3))[::3], law.response(u))


@given(st.lists(bounded_laws(), min_size=1, max_size=5), short_inputs(), st.booleans())
def test_batch_is_the_path_to_the_bit(laws, u, own_inputs):
    inputs = np.stack([u * (k + 1) / len(laws) for k in range(len(laws))]) if own_inputs else u
    parameters = {name: [getattr(law, name) for law in laws] for name in laws[0].scalars}
    rows = hs.BoucWen.responses(parameters, inputs, workers=2)
    for k, law in enumerate(laws):
        assert np.array_equal(rows[k], law.response(inputs[k] if own_inputs else u))


@pytest.mark.parametrize("scale", [0.05, 1.0, 30.0, 900.0])
@pytest.mark.parametrize("n_sets", [1, 63, 64, 200])
@np.errstate(over="ignore", invalid="ignore")  # an escape, where nothing is compiled
def test_laws_side_by_side_have_the_bits_of_each_alone(n_sets, scale):
    """Short and long ways, crossings, samples that repeat, A of either sign and zero, escapes: lanes part and meet."""
    rng = np.random.default_rng(n_sets)
    u = scale * np.cumsum(rng.choice([-1.0, -0.3, 0.0, 1e-9, 0.7, 1.0], 60))
    parameters = {
        "A": rng.choice([-1.0, 0.0, 0.4, 2.0], n_sets),
        "beta": rng.uniform(-0.5, 1.5, n_sets),
        "gamma": rng.uniform(-1.0, 1.0, n_sets),
        "gain": rng.uniform(-1.0, 1.0, n_sets),
        "z0": rng.choice([-0.5, 0.0, 0.5], n_sets),
    }
    rows = hs.BoucWen.responses(parameters, u, workers=1)
    for k, row in enumerate(rows):
        law = hs.BoucWen(**{name: float(values[k]) for name, values in parameters.items()})
        try:
            alone = law.response(u)
        except hs.SimulationError:
            alone = np.full(u.size, np.inf)
        assert row.tobytes() == alone.tobytes()


@given(st.floats(0.0, 3.0), st.floats(-1.0, 1.0), st.sampled_from([1.0, 1.5, 2.0]), st.floats(0.2, 5.0))
def test_admissible_laws_dissipate(beta, ratio, n, amplitude):
    """beta >= 0 and |gamma| <= beta: a closed loop of the force y = z never gives energy."""
    law = hs.BoucWen(beta=beta, gamma=ratio * beta, n=n)
    assert law.admissible
    u = hs.signals.triangle(-amplitude, amplitude, cycles=40, samples_per_cycle=200)
    loop = hs.loop_metrics(u, law.memory(u))
    # the trapezoidal area of a 200-sample loop: its error is 1e-4 of the stroke times the span
    slack = 1e-4 * 2 * amplitude * loop.stroke
    assert loop.orientation == "clockwise" or loop.area <= slack


def test_a_large_batch_is_the_same_on_one_thread_and_on_two():
    rng = np.random.default_rng(0)
    parameters = {"beta": rng.uniform(0, 2, 500), "gamma": rng.uniform(-1, 1, 500), "n": rng.uniform(0.5, 5, 500)}
    u = np.sin(np.linspace(0, 20, 60))
    assert np.array_equal(
        hs.BoucWen.responses(parameters, u, workers=1), hs.BoucWen.responses(parameters, u, workers=2)
    )


def test_a_law_that_escapes_is_a_row_of_inf():
    rows = hs.BoucWen.responses({"beta": [0.5, -3.0], "gamma": 0.0, "n": 2.0}, [0.0, 1.0, 5.0, 0.0])
    assert np.isfinite(rows[0]).all()
    assert np.isposinf(rows[1]).all()


def test_polynomial_law_is_the_plain_law_beside_a_polynomial():
    u = np.sin(np.linspace(0, 10, 100))
    plain = hs.BoucWen(beta=0.3, gamma=0.2, n=1.7, gain=-0.4)
    law = hs.PolynomialBoucWen(beta=0.3, gamma=0.2, n=1.7, gain=-0.4, offset=0.1, input_coefficients=(2.0, 0.3, -0.1))
    expected = 0.1 + 2.0 * u + 0.3 * u**2 - 0.1 * u**3 + plain.response(u)
    assert law.response(u) == pytest.approx(expected, abs=1e-14)  # a few roundings of terms of order one
    rows = hs.PolynomialBoucWen.responses({"beta": [0.3, 0.4], "input_coefficients": [[1, 2], [3, 4]]}, u)
    assert np.array_equal(rows[1], hs.PolynomialBoucWen(beta=0.4, input_coefficients=(3, 4)).response(u))


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({"beta": 0.6, "gamma": 0.4}, "I"),
        ({"beta": 0.2, "gamma": 0.4}, "II"),
        ({"A": -1.0, "beta": 0.6, "gamma": 0.4}, "III"),
        ({"A": -1.0, "beta": 0.2, "gamma": -0.4}, "IV"),
        ({"A": 0.0, "beta": 0.6, "gamma": 0.4}, "V"),
        ({"beta": 0.8, "gamma": -1.1}, "none"),
    ],
)
def test_stability_class(parameters, expected):
    assert hs.BoucWen(**parameters).stability_class == expected


test_wrong_arguments_are_named = refused(
    (lambda: hs.BoucWen(n=0.0), "n must be positive"),
    (lambda: hs.BoucWen(beta=float("nan")), "beta must be finite"),
    (lambda: hs.BoucWen(bta=1.0), TypeError, "bta"),
    (lambda: hs.PolynomialBoucWen(input_coefficients=()), "at least one"),
    (lambda: hs.BoucWen().response([0.0, float("inf")]), "u must be finite, got inf at index 1"),
    (lambda: hs.BoucWen().response([[0.0, 1.0]]), "1 axis"),
    (lambda: hs.BoucWen.responses({"bta": [1.0]}, [0.0, 1.0]), TypeError, "bta"),
    (lambda: hs.BoucWen.responses({"beta": [1.0, 2.0], "n": [1.0, 2.0, 3.0]}, [0.0, 1.0]), "length"),
    (lambda: hs.BoucWen.responses({"n": [1.0, -2.0]}, [0.0, 1.0]), "n must be positive"),
)


def test_a_law_is_a_value():
    law = hs.PolynomialBoucWen(input_coefficients=[1, 2])
    assert law == pickle.loads(pickle.dumps(law))
    assert hash(law) == hash(hs.PolynomialBoucWen(input_coefficients=(1.0, 2.0)))
    assert law != hs.PolynomialBoucWen(input_coefficients=(1.0, 3.0))


def test_one_compiled_loop_takes_every_law():
    """A loop that is compiled once takes laws of other families through the same type of step."""
    u = np.sin(np.linspace(0.0, 12.0, 200))
    for law in (
        hs.BoucWen(n=1.6, gain=-0.3, feedthrough=1.0),
        hs.PolynomialBoucWen(n=2.0, input_coefficients=(1.0, 0.2, -0.1)),
        hs.Duhem.from_terms({"u'": 1.0, "u' u": 0.1, "|u'| y": -0.7}, y0=0.2),
    ):
        assert np.array_equal(outputs_of_compiled_steps(law, u)[0], law.response(u))
