"""The Bouc-Wen laws: closed forms of whole loops, 30 digits, what holds for every law, and facts without simulation."""

import math
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from strategies import (
    assert_batch_has_the_bits_of_its_laws,
    assert_cut_or_stepped_it_has_the_same_bits,
    assert_refused,
    bounded_laws,
    outputs_of_compiled_steps,
    refused,
    short_inputs,
)

import hysim as hs

# ---------------------------------------------------------------------------------- whole loops against closed forms


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
    assert_refused("sample 2", law.memory, [0.0, 0.5 * escape, 1.001 * escape, 0.0], error=hs.SimulationError)


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


# ------------------------------------------------------------------- the law against 30 digits, batches against paths


REFERENCE = np.load(Path(__file__).parent / "data" / "boucwen_reference.npz")
SWEEP = hs.signals.triangle(-1.0, 1.0, cycles=3, samples_per_cycle=26)


def test_a_thousand_random_laws_agree_with_thirty_digits():
    worst = []
    for (A, beta, gamma, n), u, z in zip(REFERENCE["laws"], REFERENCE["u"], REFERENCE["z"], strict=True):
        error = np.abs(hs.BoucWen(A=A, beta=beta, gamma=gamma, n=n).memory(u) - z).max()
        worst.append(error / np.ptp(z))
    assert len(worst) == 1000
    assert max(worst) < 1e-12


@given(st.lists(bounded_laws(), min_size=1, max_size=6), st.permutations(range(6)))
def test_every_reduction_is_the_measure_of_the_row(laws, order):
    laws = [laws[k] for k in order if k < len(laws)]
    sets = {name: [getattr(law, name) for law in laws] for name in laws[0].scalars}
    u, target = 0.4 * SWEEP, np.cos(SWEEP)
    rows = [law.response(u) for law in laws]
    loops = [hs.loop_metrics(u, row) for row in rows]
    expected = {
        "sse": [np.sum((row - target) ** 2) for row in rows],
        "max_width": [loop.max_width for loop in loops],
        "area": [loop.area for loop in loops],
        "final": [row[-1] for row in rows],
    }
    for reduce, values in expected.items():
        goal = target if reduce == "sse" else None
        # 1e-12: sums in another order; the absolute part is the rounding of a loop without a width
        assert hs.BoucWen.responses(sets, u, reduce=reduce, target=goal) == pytest.approx(values, rel=1e-12, abs=1e-15)
        own = hs.BoucWen.responses(sets, np.tile(u, (len(laws), 1)), reduce=reduce, target=goal, workers=1)
        assert own == pytest.approx(values, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("reduce", ["sse", "max_width", "area", "final"])
def test_a_law_that_escapes_is_reduced_to_inf(reduce):
    target = np.zeros(SWEEP.size) if reduce == "sse" else None
    sets = {"beta": [0.5, -9.0], "gamma": 0.0, "n": 2.0}
    kept, escaped = hs.BoucWen.responses(sets, SWEEP, reduce=reduce, target=target)
    assert np.isfinite(kept)
    assert escaped == np.inf


def test_the_order_of_the_sets_does_not_matter():
    rng = np.random.default_rng(1)
    sets = {"beta": rng.uniform(0.1, 2, 300), "n": rng.choice([0.5, 1.0, 1.3, 2.0, 7.0, 20.0], 300)}
    rows = hs.PolynomialBoucWen.responses(sets | {"input_coefficients": [[1.0, 0.2, 0.1]]}, SWEEP)
    for k in range(0, 300, 17):
        law = hs.PolynomialBoucWen(beta=sets["beta"][k], n=sets["n"][k], input_coefficients=(1.0, 0.2, 0.1))
        assert np.array_equal(rows[k], law.response(SWEEP))


test_wrong_reductions_are_named = refused(
    ({"reduce": "mean"}, "reduce must be one of"),
    ({"reduce": "sse"}, "takes a target"),
    ({"reduce": "area", "target": SWEEP}, "takes a target"),
    ({"reduce": "sse", "target": SWEEP[1:]}, "samples as u has"),
    call=lambda arguments: hs.BoucWen.responses({"beta": [0.1, 0.2]}, SWEEP, **arguments),
)


# --------------------------------------------------------------------------- what holds for every law and every input


ROUNDING = 1e-13  # a few hundred roundings of numbers of order one


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
    sets = {name: [getattr(law, name) for law in laws] for name in laws[0].scalars}
    assert_batch_has_the_bits_of_its_laws(hs.BoucWen, sets, u, own_inputs)


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
    assert loop.orientation == "clockwise" or loop.area <= 1e-4 * 2 * amplitude * loop.stroke


def test_a_large_batch_is_the_same_on_one_thread_and_on_two():
    rng = np.random.default_rng(0)
    sets = {"beta": rng.uniform(0, 2, 500), "gamma": rng.uniform(-1, 1, 500), "n": rng.uniform(0.5, 5, 500)}
    one, two = (hs.BoucWen.responses(sets, np.sin(np.linspace(0, 20, 60)), workers=workers) for workers in (1, 2))
    assert np.array_equal(one, two)


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


def test_one_compiled_loop_takes_every_law():
    """A loop that is compiled once takes laws of other families through the same type of step."""
    u = np.sin(np.linspace(0.0, 12.0, 200))
    for law in (
        hs.BoucWen(n=1.6, gain=-0.3, feedthrough=1.0),
        hs.PolynomialBoucWen(n=2.0, input_coefficients=(1.0, 0.2, -0.1)),
        hs.Duhem.from_terms({"u'": 1.0, "u' u": 0.1, "|u'| y": -0.7}, y0=0.2),
    ):
        assert np.array_equal(outputs_of_compiled_steps(law, u)[0], law.response(u))


# ---------------------------------------------------------------------------------- inputs far beyond saturation


@pytest.mark.parametrize("n", [0.5, 1.5, 3.0, 10.0, 20.0])
@pytest.mark.parametrize("reach", [1e3, 1e6, 1e12, 1e100, 1e300])
def test_a_huge_stretch_ends_at_saturation(n, reach):
    z = hs.BoucWen(beta=0.6, gamma=0.3, n=n).memory([0.0, reach, -reach, reach / 3.0])
    balance = (1.0 / 0.9) ** (1.0 / n)
    # a few roundings of w^n, whose relative error is n times that of w
    np.testing.assert_allclose(z, [0.0, balance, -balance, balance], rtol=1e-14)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("n", [0.32, 0.7, 1.0, 1.7, 2.0, 3.0])
def test_a_memory_far_above_a_tiny_balance_falls_to_it_and_not_past_it(n, sign):
    """A change of -642 rounds by 1e-13: added to the memory, it went past the balance, and past zero."""
    balance = 1e-17
    law = hs.BoucWen(A=balance**n, beta=0.6, gamma=0.4, n=n, z0=642.0 * sign)
    reach = 1e5 * max(1.0, balance ** (1.0 - n))
    end = law.memory([0.0, sign * reach])[-1]
    assert end == pytest.approx(sign * balance, rel=1e-14, abs=0.0)  # a few roundings of w^n


@pytest.mark.parametrize("n", [0.32, 0.7, 1.0, 1.7, 2.0, 3.0])
def test_one_long_fall_beside_a_growing_side_stays_on_its_own(n):
    """Below zero this law grows without bound, so that one rounding across zero would be the whole memory."""
    laws = [hs.BoucWen(A=1e-17**n, beta=-50.0, gamma=51.0, n=n, z0=z0) for z0 in (642.0, 641.9, 333.3, 77.7)]
    ends = [law.memory(np.linspace(0.0, 1e4, pieces + 1))[-1] for law in laws for pieces in (1, 2, 7)]
    assert min(ends) > 0.0
    assert max(ends) < 1.0


@pytest.mark.parametrize("above", [2.0**24, 2.0**30, 2.0**40, 2.0**60, 1e40])
def test_a_fall_from_far_above_the_balance_takes_its_length(above):
    """n = 1/2: the way from w to v is 2 (sqrt(w) - sqrt(v)) + 2 log((sqrt(w) - 1) / (sqrt(v) - 1))."""
    for share in (0.9, 0.5, 0.01):
        with mpmath.workdps(60):
            w, v = mpmath.sqrt(above), mpmath.sqrt(share * above)
            length = float(2 * (w - v) + 2 * mpmath.log((w - 1) / (v - 1)))
        z = hs.BoucWen(n=0.5, z0=above).memory([0.0, length])[-1]
        assert z == pytest.approx(share * above, rel=1e-13)  # roundings of the length and of w^n, 20-fold at the end


@pytest.mark.parametrize("n", [3.0, 10.0, 20.0])
@pytest.mark.parametrize("above", [1e10, 1e40, 1e100])
def test_a_fall_from_anywhere_far_above_the_balance_ends_together(n, above):
    """All that begin above 1e10 are within 1e-20 of the one that begins at infinity."""
    ends = [hs.BoucWen(n=n, z0=z0).memory([0.0, 0.3])[-1] for z0 in (above, 7.0 * above, 1e200)]
    assert ends == pytest.approx([ends[0]] * 3, rel=1e-14)


@pytest.mark.parametrize("n", [0.5, 0.9, 1.5, 3.0])
@pytest.mark.parametrize("z0", [0.25, 1.0, 4.0])
def test_without_forcing_the_memory_decays_as_a_power(n, z0):
    law = hs.BoucWen(A=0.0, beta=0.6, gamma=0.3, n=n, z0=z0)
    for length in (1e-3, 0.2, 0.4):
        expected = (z0 ** (1.0 - n) - (1.0 - n) * 0.9 * length) ** (1.0 / (1.0 - n))
        assert law.memory([0.0, length])[-1] == pytest.approx(expected, rel=1e-13)
    still = hs.BoucWen(A=0.0, beta=0.6, gamma=0.3, n=n)
    assert still.memory([0.0, 1.0, -2.0]).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("n", "balance"), [(100.0, 1e3), (50.0, 1e6), (50.0, 1e-6), (35.0, 4e8), (20.0, 1e15), (7.0, 1e-60)]
)
def test_a_sharp_knee_yields_in_any_unit(n, balance):
    """A / (beta + gamma) = balance^n is beyond the numbers of this size, the balance itself is not."""
    A = 10.0 ** (0.5 * n * np.log10(balance))  # the square root of the quotient; beta + gamma is its inverse
    law = hs.BoucWen(A=A, beta=0.5 / A, gamma=0.5 / A, n=n)
    u = np.array([0.0, 3.0, -3.0]) * (balance / A)
    assert law.memory(u) == pytest.approx([0.0, balance, -balance], rel=1e-12)  # n roundings of the quotient, and more


# ----------------------------------- facts of a law without simulating it, by numbers that were computed with 30 digits


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
    decay = factor ** (1 - law.n)
    taller = hs.BoucWen(A=law.A * factor, beta=law.beta * decay, gamma=law.gamma * decay, n=law.n)
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
    laws = [hs.BoucWen(beta=beta, gamma=gamma) for beta, gamma in ((0.6, 0.4), (0.4, 0.6), (0.8, -1.1))]
    assert [law.passive for law in laws] == [True, False, False]
    falling, u = hs.BoucWen(beta=0.6, gamma=0.4, feedthrough=-1.0), np.linspace(0.0, 9.0, 99)
    assert np.trapezoid(falling.response(u), u) < 0.0  # it gives out energy from rest: its memory alone is passive
    assert falling.notes(hs.datasets.table1(), falling)[0].endswith("class I, and its memory is passive")


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


def test_coefficients_that_are_given_away_change_no_law():
    law = hs.BoucWen(feedthrough=0.5)
    coefficients = law.input_polynomial
    coefficients += 1.0
    assert law.response([0.0, 1.0]).tolist() == hs.BoucWen(feedthrough=0.5).response([0.0, 1.0]).tolist()
