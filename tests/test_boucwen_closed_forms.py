"""Whole loops against closed forms: the law is exact, so are peak, coercive input, width and energy.

Reference values: the limit cycle under a symmetric amplitude X follows from T_c(z), the input travelled
from 0 to z on dz/du = A - c z^n. They were computed with 30 digits (T by its hypergeometric series) and
agree with an independent Runge-Kutta integration.
"""

import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hysim as hs

ROWS = [
    # A, beta, gamma, n, X, peak z, |u| where z = 0, z at u = 0, energy of a cycle
    (1, 0.5, 0.5, 1, 1, 0.7215354572389262, 0.2784645427610738, 0.2430548935424163, 0.5932447549913089),
    (1, 0.5, 0.5, 2, 1, 0.8256588617463369, 0.1743411382536631, 0.1725959959458083, 0.4630878364923788),
    (1, 0.5, 0.5, 3, 1, 0.8724842136871529, 0.1275157863128471, 0.1274497458500011, 0.3753562720437431),
    (1, 0.5, 0.5, 1.5, 1, 0.7859595931392235, 0.2140404068607765, 0.2058666871229626, 0.5222645677215543),
    (1, 0.7, 0.3, 1, 2, 0.9587641987064171, 1.188448436520328, 0.6953063509573583, 3.723305299494096),
    (1, 0.7, -0.3, 1, 2, 1.744155707922608, 0.9905265468765354, 0.8178375924143486, 4.762489685171352),
    (1, 1, 0, 1, 1, 0.7615941559557649, 0.4337808304830272, 0.3519457263361146, 0.9536233761769404),
    (1, 0.9, 0.1, 2, 2, 0.996588610222785, 1.186037770366684, 0.8293459766935817, 4.258251857683756),
    (1, 2, 1, 2, 1, 0.570572522683592, 0.4814994527766827, 0.3941039719642776, 0.9706850251211054),
]
# the stack's table gives widths and areas over its stroke
STACK_1, STACK_2 = 2 * (30 - 8.70204658387247872), 2 * (50 - 9.2956792807126755)
OTHER_ROWS = [
    # the normalised law with rho = 1.3, sigma = 0.8; the Noel-Schoukens benchmark; two stacks after Low and Guo
    (1.3, 1.04, 0.26, 2, 1, 0.945140646521285198, 0.372429563371060326, 0.449567772298066533, 1.17105633206690467),
    (5e4, 800, -1100, 1, 1e-3, 77.75698098915592, 0.2763572362171734e-3, 14.40682508225496, 0.04916446876758035),
    (5e4, 800, -1100, 1, 2e-3, 221.6492359036899, 0.8194112682842666e-3, 46.44561914429927, 0.3666790804724017),
    (0.35, 0.02, 0.005, 1, 30, STACK_1 / -2 + 30, None, 0.130727703063551033 * STACK_1 / 2,
     0.0852976985513778019 * 60 * STACK_1),
    (0.4297, 0.0338, 0.0113, 1, 50, STACK_2 / -2 + 50, None, 0.179714981207951133 * STACK_2 / 2,
     0.123377650447201279 * 100 * STACK_2),
]  # fmt: skip


def cycles(amplitude: float, n_cycles: int, extra: list[float]) -> np.ndarray:
    """Triangle from 0 that passes through `extra` on every branch."""
    down = np.unique(np.concatenate([np.linspace(-amplitude, amplitude, 17), extra, np.negative(extra)]))[::-1]
    cycle = np.concatenate([down, down[::-1][1:-1]])
    return np.concatenate([[0.0], np.tile(cycle, n_cycles), [amplitude]])


@pytest.mark.parametrize(("A", "beta", "gamma", "n", "X", "peak", "coercive", "middle", "energy"), ROWS + OTHER_ROWS)
def test_steady_loop_is_the_closed_form(A, beta, gamma, n, X, peak, coercive, middle, energy):
    law = hs.BoucWen(A=A, beta=beta, gamma=gamma, n=n)
    crossing = [] if coercive is None else [coercive]
    u = cycles(X, 60, [*crossing, 0.0])  # 60 cycles: the transient is far below rounding
    z = law.memory(u)
    assert z[-1] == pytest.approx(peak, rel=1e-13)  # rounding carried through 2 400 samples
    last = slice(-2 * 20, None)
    assert np.abs(z[last][u[last] == 0.0]) == pytest.approx(middle, rel=1e-12)  # the table's own digits
    if crossing:
        at = np.abs(np.abs(u[last]) - coercive) < 1e-12 * X
        assert at.sum() >= 2
        assert np.abs(z[last][at]).min() < 1e-12 * A * coercive  # there the slope is A: 1e-12 of the input


@pytest.mark.parametrize(("A", "beta", "gamma", "n", "X", "peak", "coercive", "middle", "energy"), ROWS + OTHER_ROWS)
def test_energy_of_a_cycle_is_the_closed_form(A, beta, gamma, n, X, peak, coercive, middle, energy):
    law = hs.BoucWen(A=A, beta=beta, gamma=gamma, n=n)
    coercive = law.limit_cycle(X).coercive if coercive is None else coercive
    settled = law.advance(cycles(X, 60, [0.0]))[1]
    # Gauss-Legendre over the branch's two smooth pieces. At z = 0 it has a branch point |u - coercive|^(n + 1):
    # in s, with u - coercive proportional to s^4, that is a power of at least 8
    nodes, weights = np.polynomial.legendre.leggauss(60)
    s = (nodes + 1) / 2
    total, state = 0.0, settled
    for end, places, sign in ((X, s[::-1], -1), (-X, s, 1)):
        u = coercive + (end - coercive) * places**4
        z, state = law.advance(u, state)
        total += sign * (end - coercive) / 2 * float((weights * 4 * places**3) @ z)
    # odd symmetry: the other half of the cycle dissipates the same. 1e-12 is the quadrature's rounding
    assert 2 * total == pytest.approx(energy, rel=1e-12)


def test_symmetric_unit_loop_has_its_lambert_form():
    z = hs.BoucWen().memory(cycles(1.0, 60, []))
    peak = 1 - float(mpmath.lambertw(mpmath.e ** (1 - 2)).real)
    assert z[-1] == pytest.approx(peak, rel=1e-15)


def travelled(z0: float, z1: float, A: float, c: float, n: float) -> float:
    """Input from z0 to z1 on dz/du = A - c z^n, which is z / A 2F1(1, 1/n; 1 + 1/n; c z^n / A), with 30 digits."""
    with mpmath.workdps(30):
        power = mpmath.mpf(n)

        def from_zero(z: float) -> mpmath.mpf:
            return mpmath.mpf(z) / A * mpmath.hyp2f1(1, 1 / power, 1 + 1 / power, c * mpmath.mpf(z) ** power / A)

        return float(from_zero(z1) - from_zero(z0))


@pytest.mark.parametrize("n", [0.5, 0.7, 1.0, 1.0001, 1.5, 2.0, 2.0001, 3.3, 7.0, 20.0])
@pytest.mark.parametrize("z0", [0.0, 1e-3, 0.3, 0.9])
@pytest.mark.parametrize("c", [0.8, -0.2, 1e-9])
def test_one_step_travels_the_length_that_was_asked(n, z0, c):
    length = 0.15 if c < 0 else 0.6  # no law here escapes on the way
    z1 = hs.BoucWen(beta=c, gamma=0.0, n=n, z0=z0).memory([0.0, length])[-1]
    # the residual length times the slope is the error in z; a few roundings
    error = (travelled(z0, z1, 1.0, c, n) - length) * (1 - c * z1**n)
    assert abs(error) < 3e-15 * z1


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0, 3.0])
def test_escape_comes_at_its_length(n):
    law = hs.BoucWen(beta=-0.6, gamma=-0.4, n=n)
    if n == 1.0:  # no finite escape
        assert np.isfinite(law.memory([0.0, 600.0])).all()
        return
    escape = math.pi / n / math.sin(math.pi / n)
    assert np.isfinite(law.memory([0.0, 0.999 * escape])).all()
    with pytest.raises(hs.SimulationError, match="sample 2"):
        law.memory([0.0, 0.5 * escape, 1.001 * escape, 0.0])


@pytest.mark.parametrize("n", [1.25, 1.5, 2.0, 3.0, 7.3, 20.0])
@pytest.mark.parametrize("short", [1e-3, 1e-4, 1e-6, 1e-8, 1e-10])
def test_near_the_escape_the_error_is_the_conditioning(n, short):
    """The last thousandth before L_esc: a rounding of the input, of A or of w* moves z by far more than itself."""
    A, c = 1.3, -0.625
    with mpmath.workdps(40):
        exponent = mpmath.mpf(n)
        whole = mpmath.pi / exponent / mpmath.sin(mpmath.pi / exponent) * (mpmath.mpf(A) / -c) ** (1 / exponent) / A
        length = float(whole * (1 - mpmath.mpf(short)))
        z = float(hs.BoucWen(A=A, beta=0.375, gamma=-1.0, n=n).memory([0.0, length])[-1])
        w = mpmath.mpf(z)
        reached = w / A * mpmath.hyp2f1(1, 1 / exponent, 1 + 1 / exponent, c * w**exponent / A)
        slope = A - c * w**exponent
        error = abs(reached - length) * slope
        # one rounding of the length, of A, of both terms in w*; and of z itself
        bound = 2.0**-53 * (length * slope * (2 + 1 / exponent) + w)
    assert error < 4 * bound


@pytest.mark.parametrize("law", [hs.BoucWen(A=-1.0, beta=0.6, gamma=-0.2), hs.BoucWen(A=0.0, z0=0.7, n=1.5)])
def test_other_signs_of_the_initial_slope_agree_with_an_integrator(law):
    u = np.array([0.0, 1.0, -0.7, 0.4])

    def slope(sign):
        return lambda _, z: sign * (law.A - np.abs(z) ** law.n * (law.gamma + law.beta * np.sign(sign * z)))

    z = [law.z0]
    for du in np.diff(u):
        z.append(solve_ivp(slope(np.sign(du)), (0, abs(du)), [z[-1]], rtol=1e-10, atol=1e-12, max_step=0.01).y[0, -1])
    # the integrator meets a kink at z = 0: 1e-7 with steps of 0.01
    assert law.memory(u) == pytest.approx(z, abs=1e-7)
