"""The law of Vaiana and Rosati against its published form, its energy, and hostile numbers."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import assert_batch_has_the_bits_of_its_laws as assert_batch
from strategies import assert_cut_or_stepped_it_has_the_same_bits, refused, short_inputs

import hysim as hs

NAMES = ("k_b", "f_0", "alpha", "beta_1", "beta_2", "gamma_1", "gamma_2", "gamma_3")
ASYMMETRIC = hs.VaianaRosati(
    k_b=(0.3, 0.2), f_0=(0.8, 0.6), alpha=(4.0, 6.0), beta_1=(0.1, -0.05), beta_2=(1.0, -1.5), gamma_1=(0.5, 0.4),
    gamma_2=(4.0, 3.0), gamma_3=(0.15, -0.2),
)  # fmt: skip


def curve(law: hs.VaianaRosati, rises: bool, u: float) -> float:
    """The limiting curve, as printed."""
    k_b, f_0, _, beta_1, beta_2, gamma_1, gamma_2, gamma_3 = (getattr(law, name)[0 if rises else 1] for name in NAMES)
    exponential = beta_1 * math.exp(beta_2 * u) - beta_1
    step = 4.0 * gamma_1 / (1.0 + math.exp(-gamma_2 * (u - gamma_3))) - 2.0 * gamma_1
    return exponential + step + k_b * u + (f_0 if rises else -f_0)


def by_history_variable(law: hs.VaianaRosati, u: np.ndarray) -> np.ndarray:
    """Force with the history variable u_j, made anew at each reversal, as the first paper has it."""
    f, rises, a, s, history = [law.z0], None, 1.0, 1.0, 0.0
    for last, here in itertools.pairwise(u.tolist()):
        if here != last and (here > last) is not rises:
            rises = here > last
            a, s = (law.alpha[0], 1.0) if rises else (law.alpha[1], -1.0)
            history = last + s * math.log(s * a * (curve(law, rises, last) - f[-1])) / a
        f.append(f[-1] if here == last else curve(law, rises, here) - s * math.exp(-s * a * (here - history)) / a)
    return np.array(f)


@given(short_inputs(2.0), st.floats(0.5, 8.0), st.floats(0.5, 8.0), st.floats(-0.3, 0.3))
def test_it_is_the_published_form_with_a_history_variable(u, rising, falling, z0):
    u = np.append(0.0, u)
    law = hs.VaianaRosati(**{**ASYMMETRIC.arguments, "f_0": (4.0, 3.0), "alpha": (rising, falling), "z0": z0})
    # the logarithm and the exponential of a history variable lose the digits of alpha times a few inputs
    assert np.abs(law.response(u) - by_history_variable(law, u)).max() < 1e-12


def test_one_number_is_a_law_that_is_point_symmetric():
    law = hs.VaianaRosati(**hs.VaianaRosati.example.fields, z0=0.1)
    u = hs.signals.decaying_sine(2.0, cycles=4, samples_per_cycle=60)
    mirrored = hs.VaianaRosati(**hs.VaianaRosati.example.fields, z0=-0.1)
    assert np.array_equal(law.response(-u), -mirrored.response(u))
    assert np.array_equal(law.two_sided().response(u), law.response(u))
    assert law.two_sided().gamma_3 == (0.15, -0.15)
    assert ASYMMETRIC.two_sided() == ASYMMETRIC


@given(st.floats(0.1, 9.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), short_inputs(2.0))
def test_it_contains_coleman_and_hodgdons_law(alpha, c, B, offset, u):
    numbers = {"alpha": alpha, "c": c, "B": B, "offset": offset, "z0": 0.3}
    expected = hs.ColemanHodgdon(**numbers).response(u)
    y = hs.VaianaRosati.from_coleman_hodgdon(**numbers, u0=u[0]).response(u)
    assert np.abs(y - expected).max() < 1e-13 * max(1.0, np.abs(expected).max())  # roundings of 90 samples


@given(short_inputs(2.0), st.data())
def test_cut_stepped_or_in_batch_it_is_the_same_bits(u, data):
    assert_cut_or_stepped_it_has_the_same_bits(ASYMMETRIC, u, data.draw(st.integers(1, u.size)))
    sets = {"f_0": [(0.5, 0.4), (1.0, 1.0)], "gamma_1": [(0.0, 0.1), (0.2, 0.0)], "alpha": [(2.0,), (3.0,)]}
    assert_batch(hs.VaianaRosati, sets, u, own_inputs=True)


@pytest.mark.parametrize("seed", range(40))
def test_more_samples_on_a_stroke_change_nothing_with_hostile_numbers(seed):
    """Units, shares of the terms and lengths over decades; an exponential or a tanh may be a straight line."""
    rng = np.random.default_rng(seed)
    length, force = 10.0 ** rng.uniform(-9.0, 9.0, 2)
    rate = 10.0 ** rng.uniform(-6.0, 0.5) / length
    units = (force / length, force, 10.0 ** rng.uniform(-3.0, 3.0) / length, force, rate, force, rate, length)
    numbers = {name: unit * rng.normal(size=2) for name, unit in zip(NAMES, units, strict=True)}
    law = hs.VaianaRosati(**{**numbers, "alpha": abs(numbers["alpha"])}, z0=force * rng.normal())
    ends = length * np.append(rng.normal(size=4), 0.0).cumsum()
    pieces = [np.append(a + (b - a) * np.sort(rng.random(30)), b) for a, b in itertools.pairwise(ends)]
    fine, coarse = law.response(np.append(ends[0], np.concatenate(pieces))), law.response(ends)
    assert np.abs(fine[31::31] - coarse[1:]).max() <= 1e-12 * np.ptp(fine)


def test_an_exponent_out_of_range_diverges_and_flat_terms_of_any_rate_do_not():
    steep = {"k_b": 1.0, "beta_2": 1e3, "gamma_2": 1e300}
    assert np.isfinite(hs.VaianaRosati(**steep, gamma_1=1.0).response([0.0, 5.0, -5.0])).all()
    with pytest.raises(hs.SimulationError, match="diverges at sample 1"):
        hs.VaianaRosati(**steep, beta_1=1.0).response([0.0, 5.0, -5.0])
    assert np.isinf(hs.VaianaRosati.responses({**steep, "beta_1": 1.0}, [0.0, 5.0, 0.0])[0, 1:]).all()


@pytest.mark.parametrize(("low", "high"), [(-2.0, 2.0), (-0.3, 0.2), (0.5, 1.5)])
def test_a_steady_cycle_dissipates_what_the_docstring_says(low, high):
    law = hs.VaianaRosati(**hs.VaianaRosati.example.fields).two_sided()
    u = np.linspace(low, high, 20001)
    h = np.array([0.5 * (curve(law, True, x) - curve(law, False, x)) for x in u.tolist()])
    expected = 2.0 * (np.trapezoid(h, u) - (h[0] + h[-1]) * math.tanh(2.0 * (high - low)) / 4.0)  # alpha is 4
    steady = np.concatenate([np.tile([low, high], 40), u, u[::-1]])  # the start is forgotten by e^-80 and more
    y = law.response(steady)[80:]
    assert 0.0 < np.trapezoid(y, steady[80:]) == pytest.approx(expected, rel=1e-6)  # of the rule of trapezoids


def test_the_inverse_undoes_the_response_and_a_curve_that_turns_is_refused():
    u = hs.signals.decaying_sine(1.5, cycles=4, samples_per_cycle=50)
    law = hs.VaianaRosati(**{**ASYMMETRIC.arguments, "k_b": (0.5, 0.5), "f_0": (0.9, 0.8)})
    y = law.response(u)
    assert np.abs(law.response(law.inverse_response(y, u0=u[0])) - y).max() < 1e-13 * np.ptp(y)  # roundings
    softening = hs.VaianaRosati(k_b=-0.5, f_0=1.0, alpha=5.0)
    with pytest.raises(hs.SimulationError, match="has no inverse at sample 1"):
        softening.inverse_response([0.0, 1.2], u0=0.0)


SHARE = np.linspace(0.0, 1.0, 120)
U = 2.0 * np.sin(10.0 * np.pi * SHARE) * (0.3 + 0.7 * SHARE)


def test_identify_recovers_the_numbers_of_both_directions():
    fit = hs.identify(hs.VaianaRosati().two_sided(), hs.Record(u=U, y=ASYMMETRIC.response(U)))
    assert fit.estimates == pytest.approx(ASYMMETRIC.scalars, rel=1e-6, abs=1e-9)


def test_identify_leaves_out_what_the_record_does_not_need():
    noise = 0.02 * np.random.default_rng(0).normal(size=U.size)
    fit = hs.identify(hs.VaianaRosati, hs.Record(u=U, y=hs.VaianaRosati(alpha=5.0, f_0=0.5).response(U) + noise))
    assert fit.free_names == ("k_b[0]", "f_0[0]", "alpha[0]", "z0")
    assert "leaves out exponential and tanh" in fit.message


test_wrong_arguments_are_named = refused(
    (lambda: hs.VaianaRosati(alpha=(1.0, 0.0)), "alpha must be positive, got 0"),
    (lambda: hs.VaianaRosati(gamma_3=(1.0, 0.0, 2.0)), "gamma_3 must hold one number or two, got 3"),
    (lambda: hs.VaianaRosati.responses({"k_b": np.ones((2, 3))}, [0.0, 1.0]), "k_b must hold one number or two, got 3"),
)
