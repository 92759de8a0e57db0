"""The Jiles-Atherton law against its differential equation in H, and what must hold for every constant."""

import math
import subprocess
from dataclasses import replace

import mpmath
import numba
import numpy as np
import pytest
from magnetic_evolution import loop_of, steady_cycle
from magnetic_reference import Core, Exact, runge_kutta, strokes
from strategies import COMPILER, needs_compiled, needs_compiler, refused

import hysim as hs
from hysim.models.search_space import Freedom

MU0 = 4e-7 * math.pi
SLOW = numba.config.DISABLE_JIT
STEEL = Core(Ms=1.6e6, a=1100.0, alpha=1.6e-3, k=400.0, c=0.2)
ROUNDING = 1e-13  # of the range: some roundings of a dozen strokes, amplified by 1 / (1 - alpha dM_an/dHe)


def magnet(core=STEEL, **others):
    """The law with M as its output."""
    return hs.JilesAtherton(**core._asdict(), gain=1.0, feedthrough=0.0, **others)


def zigzag(rng, reach, n=12):
    return np.concatenate([[0.0], rng.uniform(-reach, reach, n)])


def any_law(rng, **others):
    """A law in units of a and Ms that does not jump, of any shape."""
    p = float(rng.choice([0.0, rng.uniform(-20.0, 20.0)]))
    coupling = float(rng.choice([0.0, rng.uniform(-2.0, 0.9)])) / initial_slope(p)
    core = Core(Ms=1.0, a=1.0, alpha=coupling, k=10.0 ** rng.uniform(-3.0, 2.0), c=rng.uniform(0.0, 1.0))
    return magnet(core, anisotropy=p, reversible_feedback=float(rng.choice([0.0, 0.5, 1.0])), **others)


def initial_slope(p):
    w, share = np.polynomial.legendre.leggauss(100)
    weight = share * np.exp(p * w**2)
    return float(weight @ w**2 / weight.sum())


# ---------------------------------------------------------------------------------- against the differential equation


@pytest.mark.skipif(SLOW, reason="20 000 steps a stroke")
def test_it_is_what_the_runge_kutta_loops_of_other_codes_tend_to():
    fields = strokes(1100.0 * np.array([0.0, 4.0, -4.0, 2.0, -1.0, 5.0]), 20_000)
    expected = runge_kutta(STEEL, fields, 0.0)
    assert np.abs(magnet().response(fields) - expected).max() <= 1e-8 * np.ptp(expected)  # its own, of the kinks


@pytest.mark.parametrize("core", [Core(1.0, 1.0, -1.0, 3.0, 0.0), Core(1.0, 1.0, 1.5, 1.0, 0.5)])
def test_it_has_the_digits_of_an_integration_with_30(core):
    turns = np.array([0.0, 2.0, -1.5])
    expected = np.array([float(M) for M in Exact(core).magnetisation(turns)])
    assert np.abs(magnet(core).response(turns) - expected).max() <= ROUNDING


def test_without_coupling_and_reversible_part_it_is_an_average_of_the_anhysteretic_curve():
    with mpmath.workdps(25):
        curve = lambda s: (mpmath.coth(s) - 1 / s) * mpmath.exp(s - 3)  # noqa: E731
        expected = float(mpmath.quad(curve, [mpmath.mpf(10) ** -20, 1, 2, 3]))
    assert magnet(Core(1.0, 1.0, 0.0, 1.0, 0.0)).response([0.0, 3.0])[-1] == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("p", [-300.0, -20.0, -1.0, -1e-8, 1e-8, 0.7, 20.0, 300.0])
@pytest.mark.parametrize("x", [1e-9, 0.3, 5.0, 39.0, 600.0, 1e5])
def test_the_anisotropic_curve_is_the_mean_cosine(p, x):
    """With c = 1 the law is the anhysteretic curve."""
    with mpmath.workdps(30):
        top = max(p + x, p - x, -x * x / (4 * p) if p < 0.0 and x < -2.0 * p else -mpmath.inf)
        density = lambda w: mpmath.exp(x * w + p * w * w - top)  # noqa: E731
        cuts = [-1, *sorted({min(1.0, x / (-2.0 * p)) if p < 0.0 else 0.0, 1.0 - min(1.9, 30.0 / (x + abs(p)))}), 1]
        even = mpmath.quad(density, cuts)
        expected = float(mpmath.quad(lambda w: w * density(w), cuts) / even)
    assert magnet(Core(1.0, 1.0, 0.0, 1.0, 1.0), anisotropy=p).response([x])[0] == pytest.approx(expected, rel=1e-11)


def test_a_strong_easy_axis_is_a_hyperbolic_tangent_and_none_langevins_function():
    x = np.array([0.1, 1.0, 3.0])
    free = Core(1.0, 1.0, 0.0, 1.0, 1.0)
    assert magnet(free, anisotropy=1e9).response(x) == pytest.approx(np.tanh(x), abs=1e-8)  # 1 / p is left
    assert magnet(free).response(x) == pytest.approx(1.0 / np.tanh(x) - 1.0 / x, abs=1e-15)


# ---------------------------------------------------------------------------------- what must hold for all


def test_scales_drop_out():
    """In units of a and Ms the law is the same, so that a record in other units has the same loop."""
    u = zigzag(np.random.default_rng(0), 5.0)
    own = magnet(Core(1.0, 1.0, 2.0, 0.5, 0.3)).response(u)
    scaled = magnet(Core(2e5, 30.0, 2.0 * 30.0 / 2e5, 15.0, 0.3)).response(30.0 * u)
    assert scaled == pytest.approx(2e5 * own, abs=2e5 * ROUNDING)


@pytest.mark.parametrize("step", [1e-14, 1e-12, 1e-11, 1e-10])
def test_a_step_below_the_rounding_of_the_effective_field_is_not_lost(step):
    """He / a is 140 here, with roundings of 3e-14, and M_irr moves 650 times as fast: by 2e-11 from one to the next."""
    law = magnet(Core(1.0, 1.0, -8.5, 0.027, 0.0), z0=17.7)
    turns, end = [7.2, 9.1], 8.0
    once = law.response([*turns, end - step])
    twice = law.response([*turns, end, end - step])
    assert abs(twice[-1] - once[-1]) <= 1e-11 * np.ptp(once[1:])


def test_a_steady_loop_between_opposite_fields_takes_energy():
    """Its area is the loss in a cycle. With H + alpha M_irr as the effective field a loop may give energy."""
    rng, n_steady = np.random.default_rng(3), 0
    for _ in range(3 if SLOW else 30):
        law = replace(any_law(rng), reversible_feedback=1.0)
        u = 10.0 ** rng.uniform(-1.0, 1.0) * hs.signals.triangle(-1.0, 1.0, cycles=30, samples_per_cycle=60)
        loop = hs.loop_metrics(u, law.response(u))
        if loop.closure_gap > 1e-9 * loop.stroke:  # a wide memory takes more cycles
            continue
        assert loop.energy <= 0.0, law  # counterclockwise
        n_steady += 1
    assert n_steady > (0 if SLOW else 10)


def test_the_field_for_an_output_is_found_to_the_rounding_of_the_output():
    rng = np.random.default_rng(4)
    for _ in range(5 if SLOW else 100):
        law = replace(any_law(rng), feedthrough=10.0 ** rng.uniform(-6.0, 0.0), offset=rng.normal())
        y = law.response(zigzag(rng, 10.0 ** rng.uniform(-1.0, 1.5)))
        again = law.inverse_response(y, u0=0.0)
        assert np.abs(law.response(np.append(0.0, again))[1:] - y).max() <= 1e-12 * np.ptp(y)


def test_a_negative_gain_is_inverted_too_and_mixed_signs_by_the_search():
    law = hs.JilesAtherton()
    u = 1000.0 * np.array([0.0, 2.0, -1.0, 3.0])
    fallen = replace(law, gain=-law.gain, feedthrough=-law.feedthrough)
    assert fallen.inverse_response(-law.response(u)) == pytest.approx(u, abs=1e-9)  # roundings of B over mu0
    mixed = replace(law, feedthrough=-1e-3 * law.gain)
    assert not mixed.is_invertible()
    assert mixed.inverse_response(mixed.response(u), u0=0.0) == pytest.approx(u, abs=1e-6)


@needs_compiler
def test_the_inverse_is_the_same_in_c(tmp_path):
    law = hs.JilesAtherton(Ms=1.0, a=0.4, alpha=0.5, k=0.3, gain=1.0, feedthrough=0.2)
    program = hs.to_c(hs.InverseFeedforward(law=law), 1.0, name="inverse")
    (tmp_path / "inverse.c").write_text(program.source)
    (tmp_path / "inverse.h").write_text(program.header)
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
    subprocess.run([COMPILER, *strict, "inverse.c"], cwd=tmp_path, check=True)


def test_a_core_that_is_cut_by_a_gap_has_alpha_less_the_demagnetising_factor():
    """H_outer = H + N M: the same material seen from outside."""
    u = zigzag(np.random.default_rng(5), 3000.0)
    M = magnet().response(u)
    outer = u + 5e-3 * M
    assert magnet(STEEL._replace(alpha=STEEL.alpha - 5e-3)).response(outer) == pytest.approx(M, abs=1e-7 * np.ptp(M))


# ---------------------------------------------------------------------------------- jumps, refusals


def test_a_coupling_that_is_too_strong_jumps_and_stays_so():
    law = magnet(STEEL._replace(alpha=8e-3, c=0.0))
    with pytest.raises(hs.SimulationError, match=r"magnetisation jumps at sample 1 .*alpha Ms / a = 11\.6"):
        law.response([0.0, 5000.0])
    assert np.isinf(hs.JilesAtherton.responses({"alpha": [8e-3], "c": 0.0}, [0.0, 5000.0])).all()
    step, parameters, state = law.compiled(0.0)
    assert [math.isfinite(step(parameters, state, u)) for u in (5000.0, 4000.0, 0.0)] == [False] * 3


def test_whether_it_jumps_does_not_depend_on_the_samples():
    """alpha Ms / a from 2.5 to 12: the steepest place lies inside the stroke."""
    fine = np.linspace(-4000.0, 4000.0, 401 if SLOW else 4001)
    for coupling in np.linspace(2.5, 12.0, 5 if SLOW else 39):
        law = magnet(Core(1.6e6, 1100.0, coupling * 1100.0 / 1.6e6, 1500.0, 0.0), z0=-1.2e6)
        rows = [hs.JilesAtherton.responses(law.arguments, u)[0] for u in (fine[[0, -1]], fine)]
        assert np.isfinite(rows[0][-1]) == np.isfinite(rows[1][-1])
        if np.isfinite(rows[0][-1]):
            assert rows[0][-1] == pytest.approx(rows[1][-1], abs=1.6e6 * 1e-11)


test_constants_of_no_material_are_refused = refused(
    ("Ms", 0.0, "Ms must be positive"),
    ("a", -1.0, "a must be positive"),
    ("k", 0.0, "k must be positive"),
    ("c", 1.1, "c must be at most 1"),
    ("reversible_feedback", -0.1, "reversible_feedback must not be negative"),
    ("alpha", 0.02, "not unique"),
    call=lambda name, value: hs.JilesAtherton(**{name: value}),
)


# ---------------------------------------------------------------------------------- other spellings


def test_constants_of_other_spellings_come_back():
    total = {"Ms": 1.6e6, "a": 1100.0, "alpha": 1.6e-3, "k": 320.0, "c": 0.2}
    circuit = {"MS": 4e5, "A": 25.0, "K": 20.0, "C": 0.25}
    model = {"a": 50.0, "k": 20.0, "c": 0.2, "Ms": 1e6, "alpha": 1e-5, "Kan": 100.0, "psi": 0.5 * math.pi}
    for way, back, constants in (
        (hs.JilesAtherton.from_total, hs.JilesAtherton.to_total, total),
        (hs.JilesAtherton.from_circuit, hs.JilesAtherton.to_circuit, circuit),
        (hs.JilesAtherton.from_jamodel, hs.JilesAtherton.to_jamodel, model),
    ):
        assert back(way(**constants)) == pytest.approx(constants)


@pytest.mark.parametrize(("K", "C"), [(20.0, 0.25), (5.0, 1.0)])
def test_the_circuit_form_is_the_same_equation(K, C):
    """dM/dH = (M_an - M)+ / ((1 + C) delta K) + C / (1 + C) dM_an/dH, by 20 000 Euler steps a stroke."""
    law = replace(hs.JilesAtherton.from_circuit(MS=4e5, A=25.0, K=K, C=C), gain=1.0, feedthrough=0.0)
    fields, M = strokes(np.array([0.0, 80.0, -80.0]), 20_000), 0.0
    x = fields[1:] - 0.5 * np.diff(fields)
    for H, h in zip(x, np.diff(fields), strict=True):
        m = 1.0 / math.tanh(H / 25.0) - 25.0 / H
        steep = (25.0 / H) ** 2 - 1.0 / math.sinh(H / 25.0) ** 2
        M += h * (max(math.copysign(1.0, h) * (4e5 * m - M), 0.0) / ((1.0 + C) * K) + C / (1.0 + C) * 16e3 * steep)
    assert law.response([0.0, 80.0, -80.0])[-1] == pytest.approx(M, rel=1e-4)  # Euler's


@pytest.mark.parametrize("psi", [0.0, 0.4, 0.5 * math.pi])
def test_the_anisotropic_curve_is_that_of_jamodel(psi):
    """Its integrals over the angle, with the mean of both exponents."""
    constants = {"a": 60.0, "k": 20.0, "c": 1.0, "Ms": 1e6, "alpha": 0.0, "Kan": 300.0, "psi": psi}
    law = replace(hs.JilesAtherton.from_jamodel(**constants), gain=1.0, feedthrough=0.0)
    theta = np.linspace(0.0, math.pi, 200_001)
    for H in (3.0, 40.0, 200.0):
        sides = 0.5 * (np.sin(psi - theta) ** 2 + np.sin(psi + theta) ** 2)
        weight = np.exp(H / 60.0 * np.cos(theta) - 300.0 / (MU0 * 1e6 * 60.0) * sides) * np.sin(theta)
        expected = 1e6 * (weight * np.cos(theta)).sum() / weight.sum()
        assert law.response([H])[0] == pytest.approx(expected, rel=1e-7)  # of the trapezoidal rule


# ---------------------------------------------------------------------------------- identification


@pytest.mark.skipif(SLOW, reason="thousands of loops")
def test_periodic_loops_that_begin_anywhere_give_the_constants_back():
    truth = hs.JilesAtherton(Ms=4e5, a=50.0, alpha=2.5e-4, k=45.0, c=0.6)
    loop = hs.signals.triangle(-1.0, 1.0, cycles=1, samples_per_cycle=32)[:-1]
    records = []
    for amplitude, first in ((40.0, 5), (110.0, 21)):
        u = amplitude * np.tile(np.roll(loop, first), 30)
        records.append(
            hs.Record(
                u=u[: loop.size + 1],
                y=truth.response(u)[-loop.size - 1 :][np.r_[1 : loop.size + 1, 1]],
                units={"u": "A/m", "y": "T"},
            )
        )
    fit = hs.identify(hs.JilesAtherton, records, initial="periodic")
    assert fit.free_names == ("Ms", "a", "alpha", "k", "c", "offset")
    for name in ("Ms", "a", "alpha", "k", "c"):
        assert fit.estimates[name] == pytest.approx(getattr(truth, name), rel=1e-4)  # noise-free


@pytest.mark.skipif(SLOW, reason="20 cycles of 200 steps a branch")
def test_the_evolution_has_the_steady_loops_of_the_law():
    H = 3000.0 * np.cos(np.linspace(0.0, 2.0 * np.pi, 41))
    expected = magnet().response(np.append(0.0, np.tile(H, 20)))[-H.size :]
    loop = loop_of(H, expected)
    assert loop.steps == 10
    assert np.abs(steady_cycle(STEEL, loop.H, loop.steps) - expected).max() < 1e-5 * np.ptp(expected)  # Runge-Kutta's


@pytest.mark.skipif(SLOW, reason="thousands of loops")
def test_a_core_that_only_its_pinning_keeps_from_jumping_is_found():
    """alpha Ms / (3 a) is 1.2."""
    truth = magnet(Core(Ms=1.0, a=1.0, alpha=3.6, k=4.0, c=0.2))
    u = 12.0 * np.cos(np.linspace(0.0, 2.0 * np.pi, 41))
    y = truth.response(np.append(0.0, np.tile(u, 20)))[-u.size :]
    start = {"gain": 1.0, "feedthrough": 0.0}
    fit = hs.identify(hs.JilesAtherton(**start), hs.Record(u=u, y=np.append(y[:-1], y[0])), initial="periodic")
    for name in ("Ms", "a", "alpha", "k", "c"):
        assert fit.estimates[name] == pytest.approx(getattr(truth, name), rel=1e-4)  # noise-free


def box(freedom):
    start = hs.JilesAtherton()
    u = 100.0 * np.sin(np.linspace(0.0, 7.0, 50))
    return start.search_space(hs.Record(u=u, y=start.response(u)), freedom)


@pytest.mark.parametrize(
    "freedom",
    [
        Freedom(),
        Freedom(initial="periodic", fixed={"c": 0.1}),
        Freedom(fixed={"alpha": 1e-4}),
        Freedom(bounds={"alpha": (-1e-4, 1e-2)}, free=("anisotropy",)),
        Freedom(bounds={"a": (10.0, 1e4), "k": (1.0, 1e3), "z0": (-1e6, 1e6)}),
        Freedom(fixed={"Ms": 2e6}, bounds={"gain": (1e-6, 2e-6), "anisotropy": (-1.0, 2.0)}),
    ],
)
def test_coordinates_lead_to_the_parameters_and_back(freedom):
    space = box(freedom)
    x = np.random.default_rng(6).uniform(space.lower, space.upper, (200, space.lower.size))
    parameters = space.parameters(x)
    known = {**hs.JilesAtherton().scalars, **space.held}
    for k in range(len(x)):
        values = {name: float(column[k]) for name, column in parameters.items()}
        if values["alpha"] * values["Ms"] > -500.0 * values["a"]:  # else a was moved into its range
            assert space.encoded({**known, **values}) == pytest.approx(x[k], abs=1e-8)
    assert set(space.names) == set(known) - set(space.held)
    assert set(space.linear) <= {"gain", "feedthrough", "offset"}


test_bounds_that_make_no_box_are_refused = refused(
    ({"k": (0.0, 1.0)}, "'k' must be positive and finite"),
    ({"alpha": (0.0, np.inf)}, "'alpha' must be finite"),
    call=lambda bounds: box(Freedom(bounds=bounds)),
)


def test_no_core_falls_at_saturation():
    assert box(Freedom()).bounds == {"feedthrough": (0.0, math.inf)}
    assert box(Freedom(fixed={"feedthrough": 0.0})).physical["Ms"] == (True, False)  # nor has it more than Ms there


def test_a_core_whose_feedthrough_is_most_of_its_output_is_found():
    """Its magnetisation at saturation is less than half of the output over the gain."""
    k, true = np.arange(400), {"Ms": 300.0, "a": 0.1, "k": 0.08, "c": 0.2, "feedthrough": 2.6e-4}
    u = np.sin(2.0 * np.pi * k / 100.0) * (0.3 + 0.7 * np.minimum(1.0, k / 200.0)) * 1.5
    y = hs.JilesAtherton(**true, alpha=5e-4, gain=hs.JilesAtherton().gain).response(u)
    y = y + 1e-3 * np.ptp(y) * np.random.default_rng(0).standard_normal(k.size)
    fit = hs.identify(hs.JilesAtherton, hs.Record(u=u, y=y))
    assert fit.success
    for name, value in true.items():
        assert abs(fit.estimates[name] - value) < 4.0 * fit.stderr[name]


# ---------------------------------------------------------------------------------- numbers of a data sheet

SHEET = {"Hc": 15.0, "Br": 0.17, "Bs": 0.47, "Hs": 1200.0, "mu_i": 2300.0}


def test_the_numbers_of_a_data_sheet_are_those_of_a_steady_loop():
    core = hs.JilesAtherton(Ms=4e5, a=50.0, alpha=2.8e-4, k=47.0, c=0.7)
    own = replace(core, offset=3.0, gain=2.0, z0=9.0, u0=1.0).to_datasheet(Hs=200.0)
    B = core.response([0.0, 1e-6, *[200.0, -200.0] * 30, 200.0, 0.0, -own["Hc"]])
    assert B[[1, -3, -2, -1]] == pytest.approx([MU0 * 1e-6 * own["mu_i"], own["Bs"], own["Br"], 0.0], rel=1e-6)


@needs_compiled
@pytest.mark.parametrize("seed", range(10))
def test_a_law_is_found_by_the_numbers_of_its_loop(seed):
    rng = np.random.default_rng([seed, 44])
    (Ms, a, k), coupling = 10.0 ** rng.uniform([5.0, 1.0, 0.5], [6.3, 3.0, 3.5]), rng.uniform(0.0, 2.9)
    law = hs.JilesAtherton(Ms=Ms, a=a, alpha=coupling * a / Ms, k=k, c=rng.uniform(0.02, 0.9))
    numbers = law.to_datasheet(Hs=max(a, k) * rng.uniform(2.0, 50.0))
    assert hs.JilesAtherton.from_datasheet(**numbers).scalars == pytest.approx(law.scalars, rel=1e-4)
    numbers["coupling"] = 2.0
    assert hs.JilesAtherton.from_datasheet(**numbers).to_datasheet(Hs=numbers["Hs"]) == pytest.approx(numbers, rel=1e-4)


@needs_compiled
def test_numbers_that_no_law_has_are_named():
    with pytest.warns(hs.HysimWarning, match=r"Br is 0\.00\d+, not 0.001, .*: no Jiles-Atherton law"):
        hs.JilesAtherton.from_datasheet(**{**SHEET, "Br": 0.001})


test_numbers_of_no_core_are_refused = refused(
    ({"Br": 0.469}, "Br < Bs - mu0 Hs"),
    ({"Bs": 470.0}, r"< 5 \[T\].*Bs = 470"),
    call=lambda numbers: hs.JilesAtherton.from_datasheet(**{**SHEET, **numbers}),
)
