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


def cycles(amplitude: float, n_cycles: int, extra: list[float]) -> np.ndarray:
    """Triangle from 0 that passes through `extra` on every branch."""
    down = np.unique(np.concatenate([np.linspace(-amplitude, amplitude, 17), extra, np.negative(extra)]))[::-1]
    cycle = np.concatenate([down, down[::-1][1:-1]])
    return np.concatenate([[0.0], np.tile(cycle, n_cycles), [amplitude]])


@pytest.mark.parametrize(("A", "beta", "gamma", "n", "X", "peak", "coercive", "middle", "energy"), ROWS)
def test_steady_loop_is_the_closed_form(A, beta, gamma, n, X, peak, coercive, middle, energy):
    law = hs.BoucWen(A=A, beta=beta, gamma=gamma, n=n)
    u = cycles(X, 60, [coercive, 0.0])  # 60 cycles: the transient is far below rounding
    z = law.memory(u)
    # 2e-14: rounding carried through 2 400 samples
    assert z[-1] == pytest.approx(peak, rel=2e-14)
    last = slice(-2 * 20, None)
    at = np.abs(np.abs(u[last]) - coercive) < 1e-12
    assert np.abs(z[last][at]).min() < 2e-14
    assert np.abs(z[last][u[last] == 0.0]) == pytest.approx(middle, rel=2e-14)


@pytest.mark.parametrize(("A", "beta", "gamma", "n", "X", "peak", "coercive", "middle", "energy"), ROWS)
def test_energy_of_a_cycle_is_the_closed_form(A, beta, gamma, n, X, peak, coercive, middle, energy):
    law = hs.BoucWen(A=A, beta=beta, gamma=gamma, n=n)
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


def test_normalised_law_of_ikhouane_and_rodellar():
    sigma, rho = 0.8, 1.3
    law = hs.BoucWen(A=rho, beta=rho * sigma, gamma=rho * (1 - sigma), n=2)
    u = cycles(1.0, 60, [0.0])
    z = law.memory(u)
    assert z[-1] == pytest.approx(0.945140646521285198, rel=1e-14)
    assert np.abs(z[-40:][u[-40:] == 0.0]) == pytest.approx(0.449567772298066533, rel=1e-14)


@pytest.mark.parametrize(
    ("amplitude", "peak", "coercive"),
    [(1e-3, 77.75698098915592, 0.2763572362171734e-3), (2e-3, 221.6492359036899, 0.8194112682842666e-3)],
)
def test_benchmark_law_with_negative_beta_plus_gamma(amplitude, peak, coercive):
    law = hs.BoucWen(A=5e4, beta=800.0, gamma=-1100.0)
    u = cycles(amplitude, 60, [coercive])
    z = law.memory(u)
    assert z[-1] == pytest.approx(peak, rel=2e-14)
    assert np.abs(z[-40:][np.abs(np.abs(u[-40:]) - coercive) < 1e-15]).min() < 1e-10  # 1e-12 of the peak


def travelled(z0: float, z1: float, A: float, c: float, n: float) -> float:
    """Input from z0 to z1 on dz/du = A - c z^n, by 30-digit quadrature."""
    with mpmath.workdps(30):
        points = mpmath.linspace(mpmath.mpf(z0), mpmath.mpf(z1), 9)
        return float(mpmath.quad(lambda w: 1 / (A - c * w ** mpmath.mpf(n)), points))


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
