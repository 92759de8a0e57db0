"""Facts of a law without simulating it: its steady loop, its bounds, its slope.

The reference numbers were computed with 30 digits, from the length T_c(z) that the input travels from 0 to z
on dz/du = A - c z^n; `reference` does so again for laws of every kind.
"""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from strategies import assert_refused, bounded_laws, refused
from test_boucwen import ROWS

import hysim as hs

RELATIVE = 1e-12


def quantities(loop: hs.LimitCycle) -> list[float]:
    return [loop.peak, loop.coercive, loop.mid_width / 2, loop.energy]


def reference(law: hs.BoucWen, amplitude: float) -> list[float]:
    """The same four by hypergeometric series and root finding with 30 digits, for A > 0."""
    guess = law.limit_cycle(amplitude)
    with mpmath.workdps(30):
        A, s, d, n, X = map(mpmath.mpf, (law.A, law.beta + law.gamma, law.gamma - law.beta, law.n, amplitude))

        def moment(c, z, k):
            return z**k / k / A * mpmath.hyp2f1(1, k / n, 1 + k / n, c * z**n / A)

        peak = mpmath.findroot(lambda z: moment(d, z, 1) + moment(s, z, 1) - 2 * X, mpmath.mpf(guess.peak))
        coercive = X - moment(d, peak, 1)
        branch = max(s, d)
        middle = mpmath.findroot(lambda z: moment(branch, z, 1) - abs(coercive), mpmath.mpf(guess.mid_width / 2))
        return [
            float(mpmath.re(value)) for value in (peak, coercive, middle, 2 * (moment(s, peak, 2) - moment(d, peak, 2)))
        ]


@pytest.mark.parametrize(("A", "beta", "gamma", "n", "X", "peak", "coercive", "middle", "energy"), ROWS)
def test_table(A, beta, gamma, n, X, peak, coercive, middle, energy):
    found = quantities(hs.BoucWen(A=A, beta=beta, gamma=gamma, n=n).limit_cycle(X))
    assert found == pytest.approx([peak, coercive, middle, energy], rel=RELATIVE)


@pytest.mark.parametrize(
    ("amplitude", "expected"),
    [
        (1e-3, (77.75698098915592, 0.2763572362171734e-3, 14.40682508225496, 0.04916446876758035)),
        (2e-3, (221.6492359036899, 0.8194112682842666e-3, 46.44561914429927, 0.3666790804724017)),
    ],
)
def test_law_of_the_benchmark(amplitude, expected):
    law = hs.BoucWen(A=5e4, beta=800.0, gamma=-1100.0)
    assert quantities(law.limit_cycle(amplitude)) == pytest.approx(expected, rel=RELATIVE)


def test_normalised_law():
    loop = hs.BoucWen(A=1.3, beta=1.3 * 0.8, gamma=1.3 * 0.2, n=2).limit_cycle(1.0)
    expected = (0.945140646521285198, 0.372429563371060326, 0.449567772298066533, 1.17105633206690467)
    assert quantities(loop) == pytest.approx(expected, rel=RELATIVE)


@pytest.mark.parametrize(
    ("A", "beta", "gamma", "U", "peak", "relative_width", "relative_area"),
    [
        (0.35, 0.02, 0.005, 30.0, 8.70204658387247872, 0.130727703063551033, 0.0852976985513778019),
        (0.4297, 0.0338, 0.0113, 50.0, 9.2956792807126755, 0.179714981207951133, 0.123377650447201279),
    ],
)
def test_piezoelectric_stack(A, beta, gamma, U, peak, relative_width, relative_area):
    loop = hs.BoucWen(A=A, beta=beta, gamma=gamma).limit_cycle(U)
    stroke = 2 * (U - loop.peak)
    assert loop.peak == pytest.approx(peak, rel=RELATIVE)
    assert loop.mid_width / stroke == pytest.approx(relative_width, rel=RELATIVE)
    assert loop.energy / (2 * U * stroke) == pytest.approx(relative_area, rel=RELATIVE)


@pytest.mark.parametrize(
    ("parameters", "amplitude"),
    [
        ({"n": 0.5}, 3.0),
        ({"n": 0.5}, 1e-3),
        ({"beta": 0.01, "n": 1.5}, 3.0),
        ({"gamma": -0.7, "n": 3.3}, 0.8),
        ({"gamma": -0.5, "n": 2.7}, 1.1),
        ({"beta": 0.2, "gamma": 1.0, "n": 5.0}, 1.0),
        ({"beta": -0.2, "gamma": 1.0, "n": 1.3}, 1.0),
        ({"A": 2.0, "beta": 0.9, "gamma": 0.1, "n": 12.0}, 0.7),
    ],
)
def test_other_laws_agree_with_30_digits(parameters, amplitude):
    law = hs.BoucWen(**parameters)
    assert quantities(law.limit_cycle(amplitude)) == pytest.approx(reference(law, amplitude), rel=RELATIVE)


def test_lambert_and_tanh_forms():
    for X in (0.01, 1.0, 30.0):
        with mpmath.workdps(30):
            lambert = float(1 - mpmath.lambertw(mpmath.exp(1 - 2 * mpmath.mpf(X))).real)
        assert hs.BoucWen(beta=0.5, gamma=0.5).limit_cycle(X).peak == pytest.approx(lambert, rel=RELATIVE)
        dahl = hs.BoucWen(A=2.0, beta=0.7, gamma=0.0).limit_cycle(X).peak
        assert dahl == pytest.approx(2.0 / 0.7 * math.tanh(0.7 * X), rel=RELATIVE)


@given(bounded_laws(), st.floats(0.05, 5.0), st.sampled_from([1, -1]))
def test_the_steady_loop_is_where_the_memory_settles(law, amplitude, sign):
    """60 cycles from the peak and back: the law's own response stays on the loop."""
    assume(law.beta > 1e-3)
    law = hs.BoucWen(A=sign * law.A, beta=law.beta, gamma=sign * law.gamma, n=law.n)
    loop = law.limit_cycle(amplitude)
    corners = [amplitude, loop.coercive, 0.0, -amplitude, -loop.coercive, 0.0, amplitude]
    z = hs.BoucWen(A=law.A, beta=law.beta, gamma=law.gamma, n=law.n, z0=loop.peak).memory(corners)
    middle = math.copysign(loop.mid_width / 2, law.A)
    expected = [loop.peak, 0.0, -middle, -loop.peak, 0.0, middle, loop.peak]
    assert z == pytest.approx(expected, rel=1e-11, abs=1e-13 * abs(loop.peak))  # roundings, and the slope's lever
    assert loop.energy * law.A > 0.0


@given(bounded_laws(), st.floats(0.1, 3.0))
def test_scaling_of_the_memory_and_of_the_input(law, factor):
    """z -> factor z and u -> factor u turn a law into another, and its loop with it."""
    loop = law.limit_cycle(0.7)
    wider = hs.BoucWen(A=law.A / factor, beta=law.beta / factor, gamma=law.gamma / factor, n=law.n)
    stretched = wider.limit_cycle(0.7 * factor)
    assert stretched.peak == pytest.approx(loop.peak, rel=RELATIVE)
    assert stretched.energy == pytest.approx(loop.energy * factor, rel=RELATIVE)
    taller = hs.BoucWen(
        A=law.A * factor, beta=law.beta * factor ** (1 - law.n), gamma=law.gamma * factor ** (1 - law.n), n=law.n
    )
    assert taller.limit_cycle(0.7).peak == pytest.approx(loop.peak * factor, rel=RELATIVE)


def test_a_narrow_loop_keeps_its_digits():
    """To first order in beta the coercive input is beta times the integral of w^n / (A - gamma w^n)^2."""
    with mpmath.workdps(40):
        peak = mpmath.findroot(lambda z: z * mpmath.hyp2f1(1, 1 / 3, 4 / 3, 0.5 * z**3) - 1, 0.9)
        slope = float(mpmath.quad(lambda w: w**3 / (1 - 0.5 * w**3) ** 2, [0, peak]))
    loop = hs.BoucWen(beta=1e-9, gamma=0.5, n=3.0).limit_cycle(1.0)
    assert loop.coercive == pytest.approx(1e-9 * slope, rel=1e-9)  # the second order is 1e-9 of the first
    assert hs.BoucWen(beta=0.0, gamma=0.5, n=3.0).limit_cycle(1.0).energy == 0.0


test_what_has_no_steady_loop_is_refused = refused(
    ({}, 0.0, "amplitude must be positive"),
    ({}, math.nan, "amplitude must be positive"),
    ({"A": 0.0}, 1.0, "A = 0"),
    ({"beta": 0.5, "gamma": -1.5, "n": 2.0}, 5.0, hs.SimulationError, "diverges"),
    call=lambda parameters, amplitude: hs.BoucWen(**parameters).limit_cycle(amplitude),
)


@given(bounded_laws())
def test_a_long_stretch_ends_at_the_saturation(law):
    rate = law.n * law.A / law.saturation  # at which the memory approaches its end
    reached = np.abs(law.memory([0.0, 40.0 / rate + law.saturation / law.A]))[-1]
    assert reached == pytest.approx(law.saturation, rel=1e-12)
    assert law.memory_bound == pytest.approx(law.saturation, rel=1e-12)


@pytest.mark.parametrize(
    ("parameters", "saturation", "bound"),
    [
        ({"A": 4.0, "beta": 0.6, "gamma": 0.4, "n": 2.0}, 2.0, 2.0),
        ({"A": 4.0, "beta": 0.6, "gamma": 0.4, "n": 2.0, "z0": -3.0}, 2.0, 3.0),
        ({"A": -4.0, "beta": 0.6, "gamma": -0.4, "n": 2.0}, 2.0, 2.0),
        ({"beta": 0.1, "gamma": 0.9, "z0": 1.3}, 1.0, math.inf),  # class II beyond 1 / (gamma - beta) = 1.25
        ({"beta": 0.1, "gamma": 0.9, "z0": 1.2}, 1.0, 1.2),
        ({"A": 0.0, "z0": 0.3}, 0.0, 0.3),
        ({"beta": 0.8, "gamma": -1.1}, math.inf, math.inf),
    ],
)
def test_saturation_and_bound(parameters, saturation, bound):
    law = hs.BoucWen(**parameters)
    assert (law.saturation, law.memory_bound) == pytest.approx((saturation, bound))


def test_passivity_is_class_one():
    assert hs.BoucWen(beta=0.6, gamma=0.4).passive
    assert not hs.BoucWen(beta=0.4, gamma=0.6).passive
    assert not hs.BoucWen(beta=0.8, gamma=-1.1).passive


@given(bounded_laws(), st.floats(-0.9, 0.9), st.sampled_from([-1.0, 1.0]))
def test_tangent_is_the_slope_of_the_response(law, fraction, direction):
    z = fraction * min(law.saturation, 1.0)
    assume(abs(z) > 1e-2)
    law = hs.PolynomialBoucWen(
        A=law.A, beta=law.beta, gamma=law.gamma, n=law.n, gain=law.gain, z0=z, input_coefficients=(1.0, 0.3, -0.2)
    )
    step = 1e-6 * direction
    y = law.response([0.4, 0.4 + step])
    # forward difference: half the curvature, at most 1e3 here, times the step, and rounding over the step
    assert law.tangent(direction, z, 0.4) == pytest.approx(np.diff(y)[0] / step, abs=1e-3)


def test_tangent_takes_arrays_and_refuses_a_standstill():
    law = hs.BoucWen(A=1.0, beta=0.6, gamma=0.4, feedthrough=2.0)
    assert law.tangent([1.0, -1.0, 1.0], [0.5, 0.5, 0.0]).tolist() == pytest.approx([2.5, 3.1, 3.0])
    assert_refused("direction must not be zero", law.tangent, [1.0, 0.0], 0.5)


@given(bounded_laws())
def test_slope_bounds_hold_on_a_record_and_are_reached(law):
    long = 40.0 * law.saturation / min(law.n, 1.0) / law.A
    z = law.memory(np.concatenate([np.random.default_rng(1).normal(size=200), [long, -long, long]]))
    low, high = law.slope_bounds()
    slopes = np.concatenate([law.tangent(1.0, z), law.tangent(-1.0, z), law.tangent(1.0, [0.0])])
    slack = 1e-12 * (abs(law.feedthrough) + abs(law.gain) * (abs(law.A) + abs(high) + abs(low)))
    assert (slopes.min(), slopes.max()) == pytest.approx((low, high), abs=10 * slack + 1e-15)


@pytest.mark.parametrize(
    ("alpha", "beta", "gamma"), [(0.35, 0.02, 0.005), (0.6, 0.05, 0.011), (0.6, 0.05, 0.009), (0.9, 0.01, 0.02)]
)
def test_condition_for_a_piezoelectric_stack(alpha, beta, gamma):
    """Low and Guo's law is monotone if alpha max(1, 2 sigma) < 1."""
    law = hs.BoucWen(A=alpha, beta=beta, gamma=gamma, feedthrough=1.0, gain=-1.0)
    steepest = alpha * max(1.0, 2.0 * beta / (beta + gamma))
    assert law.slope_bounds()[0] == pytest.approx(1.0 - steepest, abs=1e-15)
    assert law.is_invertible() == (steepest < 1.0)


@pytest.mark.parametrize(
    "law",
    [
        hs.BoucWen(A=0.6, beta=0.05, gamma=0.01, feedthrough=1.0, gain=-1.0),  # alpha 2 sigma = 1, the limit
        hs.BoucWen(A=1.0, beta=0.6, gamma=0.4),  # flat in the end
    ],
)
def test_at_the_limit_nothing_is_promised(law):
    assert law.slope_bounds()[0] == pytest.approx(0.0, abs=1e-15)
    assert not law.is_invertible()


def test_bounds_of_a_polynomial_depend_on_the_range():
    law = hs.PolynomialBoucWen(A=1.0, beta=0.5, gamma=0.5, gain=0.5, input_coefficients=(1.0, 0.0, -1.0))
    assert law.slope_bounds(-0.5, 1.0) == pytest.approx((-2.0, 1.5))
    assert law.is_invertible(-0.5, 0.5)
    assert not law.is_invertible()
    assert law.slope_bounds() == (-math.inf, pytest.approx(1.5))
    assert_refused("low must not be above high", law.slope_bounds, 1.0, 0.0)


def test_slopes_that_grow_without_bound_are_still_of_one_sign():
    law = hs.BoucWen(A=5e4, beta=800.0, gamma=-1100.0)
    assert law.slope_bounds() == (5e4, math.inf)
    assert law.is_invertible()
